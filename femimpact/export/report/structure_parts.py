"""The parts of a structure for a report: where each is, and what it is in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from femimpact.export.scene_pieces import BALL_DENSITY
from femimpact.structure.structure import Position, Structure
from femimpact.svg.axis import MINUS, TIMES, number_text

__all__ = [
    "Finder", "PlacedContact", "body_side", "gap_words", "millimetres", "part_words", "place_finder",
    "placed_contacts", "structure_words",
]  # fmt: skip

Finder = Callable[[Position], float]


@dataclass(frozen=True)
class PlacedContact:
    """What is drawn of a ball or a stop.

    Parameters
    ----------
    name : str
    position : float, m
    mass : float, kg
        Infinite for a stop.
    gaps : pair of float, m
    fixed_to : str
    law : str
        In words; empty where it is not known.
    """

    name: str
    position: float
    mass: float
    gaps: tuple[float, float]
    fixed_to: str = "base"
    law: str = ""

    @property
    def is_stop(self) -> bool:
        """Whether it is a fixed obstacle."""
        return math.isinf(self.mass)


def place_finder(structure: Structure, points: Any = None) -> Finder:
    """A function that gives the metres from the root of a place of a structure.

    Parameters
    ----------
    structure : Structure
    points : mapping of str to float, optional
        Places that a mesh or a system names.
    """
    length = structure.beam.length
    known = {"root": 0.0, "tip": length, "mid": 0.5 * length, **dict(points or {})}

    def position(at: Position) -> float:
        place = structure.place_of(at)
        return float(known[place] if isinstance(place, str) else place)

    return position


def placed_contacts(structure: Structure, position: Finder) -> tuple[PlacedContact, ...]:
    """Balls and stops of a structure at their places."""
    balls = [
        PlacedContact(ball.name, position(ball.at), ball.mass, _pair(ball.gap), "base", ball.contact.name)
        for ball in structure.impactors
    ]
    stops = [
        PlacedContact(stop.name, position(stop.at), math.inf, stop.gaps, stop.fixed_to, stop.contact.name)
        for stop in structure.stops
    ]
    return (*balls, *stops)


def _pair(gap: Any) -> tuple[float, float]:
    return (float(gap[0]), float(gap[1])) if isinstance(gap, (tuple, list)) else (float(gap), float(gap))


def body_side(mass: float) -> float:
    """Side (m) of the steel cube that is drawn for a body of this mass (kg)."""
    return float((mass / BALL_DENSITY) ** (1.0 / 3.0))


def structure_words(structure: Structure, contacts: Sequence[Any]) -> str:
    """A structure in a few words: how it is held, its length, and what is on it, contacts among it."""
    stops = sum(1 for one in contacts if one.is_stop)
    kinds = [f"{one.kind} at {_at(one.at)}" for one in structure.supports]
    root_only = len(kinds) == 1 and structure.supports[0].kind == "clamped" and structure.supports[0].at == "root"
    held = "cantilever" if root_only else f"beam ({', '.join(kinds) or 'on springs'})"
    counts = [
        (len(structure.masses), "body", "bodies"), (len(contacts) - stops, "ball", "balls"),
        (stops, "stop", "stops"), (len(structure.springs), "spring", "springs"),
        (len(structure.dashpots), "dashpot", "dashpots"),
    ]  # fmt: skip
    parts = [f"{'a' if n == 1 else n} {one if n == 1 else many}" for n, one, many in counts if n]
    *first, last = parts or [""]
    on_it = f" with {', '.join(first)}{' and ' if first else ''}{last}" if parts else ""
    return f"{held} of {millimetres(structure.beam.length)}{on_it}"


def _at(place: Position) -> str:
    return place if isinstance(place, str) else millimetres(place)


def millimetres(value: float) -> str:
    """A length (m) in words."""
    return f"{number_text(1e3 * value, 4)} mm"


def gap_words(one: Any) -> str:
    """The gaps of a contact in words."""
    plus, minus = one.gaps
    if plus == minus:
        return f"gaps {millimetres(plus)}"
    if math.isinf(plus) or math.isinf(minus):
        return f"gap {millimetres(min(plus, minus))} on the {MINUS if math.isinf(plus) else '+'} side"
    return f"gaps +{millimetres(plus)}, {MINUS}{millimetres(minus)}"


def part_words(structure: Structure, contacts: Sequence[Any], letters: dict[str, str]) -> Iterable[tuple[str, str]]:
    """Each part's letter and name, and what it is."""
    for i, segment in enumerate(structure.beam.segments):
        name = "beam" if len(structure.beam.segments) == 1 else f"segment {segment.name or i + 1}"
        yield name, _segment_words(segment)
    for support in structure.supports:
        yield support.kind, f"at {_at(support.at)}"
    for body in structure.masses:
        yield f"{letters[body.name]}  {body.name}", f"{number_text(1e3 * body.mass)} g at {_at(body.at)}"
    for one in contacts:
        yield f"{letters[one.name]}  {one.name}", _contact_words(one)
    for spring in structure.springs:
        yield spring.name, f"spring of {number_text(spring.stiffness)} N/m at {_at(spring.at)}"
    for dashpot in structure.dashpots:
        yield dashpot.name, f"dashpot of {number_text(dashpot.damping)} N s/m at {_at(dashpot.at)}"


def _segment_words(segment: Any) -> str:
    width, thickness = segment.rectangle
    end = segment.end_rectangle
    taper = "" if end == (width, thickness) else f" to {millimetres(end[0])} {TIMES} {millimetres(end[1])}"
    material = f"{number_text(segment.young_modulus / 1e9)} GPa, {number_text(segment.density)} kg/m\u00b3"
    return (
        f"{millimetres(segment.length)} long, {millimetres(width)} {TIMES} {millimetres(thickness)}{taper}, {material}"
    )


def _contact_words(one: Any) -> str:
    given = getattr(one, "law", "")
    law = f", {given}" if isinstance(given, str) and given else ""
    if one.is_stop:
        held = "space" if one.fixed_to == "space" else "the base"
        return f"fixed obstacle at {millimetres(one.position)}, {gap_words(one)}, fixed to {held}{law}"
    return (
        f"{number_text(1e3 * one.mass)} g, free between its walls at {millimetres(one.position)}: {gap_words(one)}{law}"
    )
