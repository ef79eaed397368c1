"""The structure drawn to scale in the plane of its motion: beam, supports, bodies, balls with their gaps, stops."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from femimpact.app.report.markup import Element, element
from femimpact.scene.placed import Contact, PlacedStructure, ball_radius, offsets_of, travel_of, zigzag
from femimpact.scene.scene import BALL, BODY, BOX, STOP, SUPPORT, Body, bodies_on_beam
from femimpact.structure.beam import Segment
from femimpact.structure.structure import Position, Spring, Structure
from femimpact.units import MINUS, TIMES, prefixed, typeset_number

# ---- words ----------------------------------------------------------------------------------------


def structure_words(structure: Structure, contacts: Sequence[Contact]) -> str:
    """A structure in a few words: how it is held, its length, its bodies, contacts, springs and dashpots."""
    balls, absorbers, stops = (sum(one.kind == kind for one in contacts) for kind in ("impactor", "absorber", "stop"))
    kinds = [f"{one.kind} at {_at(one.at)}" for one in structure.supports]
    root_only = len(kinds) == 1 and structure.supports[0].kind == "clamped" and structure.supports[0].at == "root"
    held = "cantilever" if root_only else f"beam ({', '.join(kinds) or 'on springs'})"
    counts = [
        (len(structure.masses), "body", "bodies"), (balls, "ball", "balls"),
        (absorbers, "absorber", "absorbers"), (stops, "stop", "stops"), (len(structure.springs), "spring", "springs"),
        (len(structure.dashpots), "dashpot", "dashpots"),
    ]  # fmt: skip
    *first, last = [f"{_article(one)} {one}" if n == 1 else f"{n} {many}" for n, one, many in counts if n] or [""]
    on_it = f" with {', '.join(first)}{' and ' if first else ''}{last}" if last else ""
    return f"{held} of {in_words(structure.beam.length)}{on_it}"


def _article(noun: str) -> str:
    """The indefinite article of a noun."""
    return "an" if noun[0] in "aeiou" else "a"


def _at(place: Position) -> str:
    return place if isinstance(place, str) else in_words(place)


def in_words(value: float, unit: str = "m") -> str:
    """A length (m), a mass (kg) or another quantity in the unit that fits."""
    factor, shown = prefixed(abs(value), unit)
    return f"{typeset_number(factor * value, 4)} {shown}"


def gap_words(one: Contact) -> str:
    """The gaps of a contact in words."""
    plus, minus = one.gaps
    if plus == minus:
        return f"gaps {in_words(plus)}" if plus < math.inf else "without walls"
    if math.isinf(plus) or math.isinf(minus):
        return f"gap {in_words(min(plus, minus))} on the {MINUS if math.isinf(plus) else '+'} side"
    factor, unit = prefixed(max(abs(plus), abs(minus)), "m")
    above, below = (typeset_number(factor * gap, 4) for gap in (plus, minus))
    return f"gaps +{above} {unit}, {MINUS}{below} {unit}"


NO_AXES: Mapping[str, Sequence[str]] = {}


OF_FILE = "in the study file"
"""Where the values of a part that a study varies are from."""


def varied_words(names: Sequence[str], of_design: str = OF_FILE) -> str:
    """Whose the values of a part are that the study varies; empty without any."""
    axes = f"{' and '.join(names)} {'is an axis' if len(names) == 1 else 'are axes'} of the study"
    return f", {of_design}; {axes}" if names else ""


def part_words(
    placed: PlacedStructure, letters: dict[str, str], varied: Mapping[str, Sequence[str]] = NO_AXES,
    of_design: str = OF_FILE,
) -> Iterable[tuple[str, str]]:  # fmt: skip
    """Letter and name of each part, and words for it, with those of its values that a study varies."""
    for head, owner, words in _part_words(placed, letters):
        yield head, f"{words}{varied_words(varied.get(owner, ()), of_design)}"


def _part_words(placed: PlacedStructure, letters: dict[str, str]) -> Iterable[tuple[str, str, str]]:
    """Letter and name of each part, its table and name in a study file, and words for it."""
    structure = placed.structure
    for i, segment in enumerate(structure.beam.segments):
        name = "beam" if len(structure.beam.segments) == 1 else f"segment {segment.name or i + 1}"
        owner = "beam" if len(structure.beam.segments) == 1 else f"beam.{segment.name}"
        yield name, owner, _segment_words(segment)
    for support in structure.supports:
        yield support.kind, "support", f"at {_at(support.at)}"
    for body in structure.masses:
        words = f"{in_words(body.mass, 'kg')} at {_at(body.at)}"
        yield f"{letters[body.name]}  {body.name}", f"mass.{body.name}", words
    for one in placed.contacts:
        yield f"{letters[one.name]}  {one.name}", f"{one.kind}.{one.name}", _contact_words(one)
    for meeting in structure.meetings:
        words = f"{' and '.join(meeting.between)} meet, gap {in_words(meeting.gap)}, {meeting.contact.name}"
        yield meeting.name, f"meeting.{meeting.name}", words
    for spring in structure.springs:
        owner = f"spring.{spring.name}"
        yield spring.name, owner, f"spring of {typeset_number(spring.stiffness)} N/m at {_at(spring.at)}"
    for dashpot in structure.dashpots:
        owner = f"dashpot.{dashpot.name}"
        yield dashpot.name, owner, f"dashpot of {typeset_number(dashpot.damping)} N s/m at {_at(dashpot.at)}"


def _of_gap(varied: Mapping[str, Sequence[str]], ball: Contact, of_design: str) -> str:
    return varied_words([name for name in varied.get(f"impactor.{ball.name}", ()) if name == "gap"], of_design)


def _segment_words(segment: Segment) -> str:
    material = f"{typeset_number(segment.young_modulus / 1e9)} GPa, {typeset_number(segment.density)} kg/m\u00b3"
    shear = f", shear {typeset_number(segment.shear_modulus / 1e9)} GPa" if segment.shear_modulus else ""
    return f"{in_words(segment.length)} long, {_section_words(segment)}, {material}{shear}"


def _section_words(segment: Segment) -> str:
    (width, thickness), end = segment.rectangle, segment.end_rectangle
    if segment.diameter is not None:
        wall = "" if segment.wall is None else f", wall {in_words(segment.wall)}"
        return f"diameter {in_words(segment.diameter)}{wall}"
    if segment.area is not None and segment.second_moment is not None:
        outer = segment.outer_fibre
        known = "" if outer is None else f", outer fibre at {in_words(outer)}"
        moment = typeset_number(1e12 * segment.second_moment)
        return f"area {typeset_number(1e6 * segment.area)} mm\u00b2, second moment {moment} mm\u2074{known}"
    taper = "" if end == (width, thickness) else f" to {in_words(end[0])} {TIMES} {in_words(end[1])}"
    return f"{in_words(width)} {TIMES} {in_words(thickness)}{taper}"


def _contact_words(one: Contact) -> str:
    name = one.law if isinstance(one.law, str) else one.law.name
    law = f", {name}" if name else ""
    if one.is_stop:
        held = "space" if one.fixed_to == "space" else "the base"
        return f"fixed obstacle at {in_words(one.position)}, {gap_words(one)}, fixed to {held}{law}"
    if one.kind == "absorber":
        hung = f"{typeset_number(one.free_stiffness)} N/m and {typeset_number(one.free_damping)} N s/m"
        return f"{in_words(one.mass, 'kg')} on {hung} at {in_words(one.position)}"
    free = "free between its walls" if max(one.gaps) < math.inf else "free"
    return f"{in_words(one.mass, 'kg')}, {free} at {in_words(one.position)}: {gap_words(one)}{law}"


# ---- drawing --------------------------------------------------------------------------------------


WIDTH = 1000.0
"""Units of a drawing."""

FOOT = 0.1
"""Distance below the beam at which springs and dashpots are fixed, as a share of its length."""

STATIONS = 33
"""Points of each edge of a segment whose section changes."""

MOST_CLOSE = 4
"""Balls that are drawn in their boxes."""


def structure_element(
    placed: PlacedStructure,
    varied: Mapping[str, Sequence[str]] = NO_AXES,  # fields that a study varies, by parts as "impactor.ball"
    of_design: str = OF_FILE,  # words for the design whose values stand there
) -> Element:
    """The structure at one scale, each ball in its box at a larger one, and the parts in words."""
    names = [*(body.name for body, _ in placed.bodies), *(one.name for one in placed.contacts)]
    letters = {
        name: chr(ord("A") + i % 26) + (str(i // 26) if i >= 26 else "") for i, name in enumerate(dict.fromkeys(names))
    }
    details = [
        element(
            "figure.drawing",
            _detail(placed, ball),
            element(
                "figcaption",
                f"{letters[ball.name]}  {ball.name} in its box, {gap_words(ball)}{_of_gap(varied, ball, of_design)}",
            ),
        )
        for ball in [one for one in placed.contacts if one.kind == "impactor"][:MOST_CLOSE]
    ]
    parts = (
        element("li", element("b", head), f" {words}") for head, words in part_words(placed, letters, varied, of_design)
    )
    scale = "Lengths, thicknesses, gaps and balls are to one scale. Balls and bodies are drawn as steel of their mass"
    boxed = any(placed.box_of(one) for one in placed.contacts)
    scale += ", a body at the place of a ball as its box." if boxed else "."
    return element(
        "div",
        element("figure.drawing", _overview(placed, letters)),
        element("p.below", scale),
        element("ul.parts", *parts),
        element("div.details", *details) if details else None,
    )


@dataclass(frozen=True)
class _Canvas:
    """Map from metres to units of a drawing."""

    left: float
    top: float
    scale: float

    def x(self, metres: float) -> float:
        return round((metres - self.left) * self.scale, 2)

    def y(self, metres: float) -> float:
        return round((self.top - metres) * self.scale, 2)

    def polygon(self, kind: str, corners: Iterable[Sequence[float]], **more: Any) -> Element:
        points = " ".join(f"{self.x(x)},{self.y(y)}" for x, y in corners)
        return element(f"polygon.{kind}", points=points, **more)


def _overview(placed: PlacedStructure, letters: dict[str, str]) -> Element:
    """The structure with everything on it."""
    structure, length, bodies = placed.structure, placed.length, bodies_on_beam(placed)
    left, right = -0.07 * length, 1.07 * length
    high = 0.5 * max(segment.drawn_at(0.0)[1] for segment in structure.beam.segments)
    for body in bodies:
        if body.part in (BODY, BOX, BALL, STOP):
            (low, bottom, _), (far, top, _) = body.points.min(axis=0), body.points.max(axis=0)
            margin = 0.1 * (far - low)
            left, right, high = min(left, low - margin), max(right, far + margin), max(high, top, -bottom)
    scale = WIDTH / (right - left)
    high = min(max(high, 0.05 * length), 0.6 * length)
    rise = max((_lift(placed, one) for one in placed.contacts if one.kind == "absorber"), default=0.0)
    canvas = _Canvas(left, high + rise + 34.0 / scale, scale)
    below = 0.12 * length if placed.connections else 0.0
    height = canvas.y(-max(high, below)) + 62.0
    drawn = [
        *(_block(canvas, body) for body in bodies if body.part in CLASSES),
        *_beam(canvas, structure),
        *(shape for one in placed.contacts if not one.is_stop for shape in _ball(canvas, placed, one)),
        *_connections(canvas, placed),
        *_names(canvas, placed, letters),
        *_scale_bar(canvas, structure, height),
    ]
    words = f"{structure_words(structure, placed.contacts)}, drawn to scale"
    return element("svg", *drawn, viewBox=f"0 0 {WIDTH:g} {height:.2f}", role="img", aria_label=words)


CLASSES = {SUPPORT: "solid", BODY: "body", BOX: "wall", STOP: "solid"}
"""Classes of the style sheet for blocks, by their parts."""


def _block(canvas: _Canvas, body: Body) -> Element:
    kind = "free" if body.part == BOX and body.side == 0 else CLASSES[body.part]
    more = {"opacity": "0.55"} if body.part == BODY else {}
    return canvas.polygon(kind, body.outline, **more)


def _beam(canvas: _Canvas, structure: Structure) -> list[Element]:
    shapes, joints = [], structure.beam.joints
    for segment, start in zip(structure.beam.segments, joints[:-1], strict=True):
        stations = np.linspace(0.0, segment.length, STATIONS if segment.is_tapered else 2)
        half = [0.5 * segment.drawn_at(float(s))[1] for s in stations]
        # a thickness of a third of a pixel would not be seen
        least = 1.1 / canvas.scale
        upper = [(start + float(s), max(h, least)) for s, h in zip(stations, half, strict=True)]
        shapes.append(canvas.polygon("beam", [*upper, *((x, -y) for x, y in reversed(upper))]))
    return shapes


def _lift(placed: PlacedStructure, one: Contact) -> float:
    """Height (m) above the axis at which an absorber's body is drawn, or a ball."""
    if one.kind == "impactor":
        return offsets_of(placed.structure).get(one.name, 0.0)
    return placed.half_height(one.position) + 3.0 * ball_radius(one.mass)


def _ball(canvas: _Canvas, placed: PlacedStructure, one: Contact) -> list[Element]:
    """A ball, or the body of an absorber on its spring."""
    x, radius, high = one.position, ball_radius(one.mass), _lift(placed, one)
    circle = element("circle.ball", cx=canvas.x(x), cy=canvas.y(high), r=round(radius * canvas.scale, 2))
    if one.kind == "impactor":
        return [circle]
    foot = high - 3.0 * radius
    corners = zigzag(((x, foot), (x, high - radius)), (0.5 * radius, 0.0))
    return [element("path.thread", d=_thread(canvas, corners)), circle]


def _connections(canvas: _Canvas, placed: PlacedStructure) -> list[Element]:
    length, shapes = placed.length, []
    for item, (at, *to) in placed.connections:
        if to:
            corners = [(at, 0.0), (at, -0.06 * length), (to[0], -0.06 * length), (to[0], 0.0)]
            shapes.append(element("path.thread", d=_thread(canvas, corners)))
            continue
        spring = zigzag(((at, 0.0), (at, -FOOT * length)), (0.008 * length, 0.0))
        drawn = [spring] if isinstance(item, Spring) else _dashpot(at, length)
        shapes.append(element("path.thread", d="".join(_thread(canvas, corners) for corners in drawn)))
        base = [(at + x * length, y * length) for y in (-FOOT, -FOOT - 0.004) for x in (-0.012, 0.012)]
        shapes.append(canvas.polygon("solid", (base[i] for i in (0, 1, 3, 2))))
    return shapes


def _thread(canvas: _Canvas, corners: Iterable[Sequence[float]]) -> str:
    return "M" + "L".join(f"{canvas.x(x)} {canvas.y(y)}" for x, y in corners)


def _dashpot(at: float, length: float) -> list[list[tuple[float, float]]]:
    """A piston in its pot."""
    left, right = at - 0.01 * length, at + 0.01 * length
    top, piston, bottom = -0.04 * length, -0.05 * length, -0.07 * length
    return [
        [(at, 0.0), (at, piston)],
        [(left, piston), (right, piston)],
        [(left, top), (left, bottom), (right, bottom), (right, top)],
        [(at, bottom), (at, -FOOT * length)],
    ]


def _names(canvas: _Canvas, placed: PlacedStructure, letters: dict[str, str]) -> list[Element]:
    """Letters above what they name, those of one place beside one another."""
    places = [(x + body.offset, letters[body.name]) for body, x in placed.bodies]
    places += [(one.position, letters[one.name]) for one in placed.contacts]
    together: dict[float, list[str]] = {}
    for x, letter in places:
        near = next((at for at in together if abs(at - x) < 0.04 * placed.length), x)
        together.setdefault(near, []).append(letter)
    return [
        element("text", ", ".join(found), x=canvas.x(x), y=18, text_anchor="middle")
        for x, found in sorted(together.items())
    ]


def _scale_bar(canvas: _Canvas, structure: Structure, height: float) -> list[Element]:
    """The length of the beam, below it, and what of it is drawn as another section."""
    length = structure.beam.length
    words = "; ".join(filter(None, (in_words(length), structure.beam.drawn_words)))
    y, left, right = round(height - 26.0, 2), canvas.x(0.0), canvas.x(length)
    path = f"M{left} {y}H{right}M{left} {y - 6}V{y + 6}M{right} {y - 6}V{y + 6}"
    middle = round(0.5 * (left + right), 2)
    return [
        element("path.measure", d=path),
        element("text.quiet", words, x=middle, y=y + 20, text_anchor="middle"),
    ]


def _detail(placed: PlacedStructure, one: Contact) -> Element:
    """A ball in its box, with the gaps between its surface and the walls."""
    structure = placed.structure
    radius, middle, travel = ball_radius(one.mass), _lift(placed, one), travel_of(one, structure)
    high = max((gap for gap in travel if gap < math.inf), default=0.0) + 1.5 * radius
    scale = 120.0 / high
    wide = 160.0 / scale
    canvas = _Canvas(one.position - wide, middle + high + 6.0 / scale, scale)
    x = canvas.x(one.position)
    marks = []
    for side, gap in ((1.0, travel[0]), (-1.0, travel[1])):
        near, far = canvas.y(middle + side * radius), canvas.y(middle + side * (radius + gap))
        if 0.0 < gap < math.inf:
            marks.append(element("path.measure", d=f"M{x} {near}V{far}M{x - 6} {near}h12M{x - 6} {far}h12"))
            marks.append(element("text", in_words(gap), x=x + 12, y=round(0.5 * (near + far) + 4.5, 2)))
    half = max(0.5 * structure.beam.drawn_at(min(one.position, structure.beam.length))[1], 0.6 / scale)
    left, right = max(one.position - wide, 0.0), min(one.position + wide, placed.length)
    number = list(placed.contacts).index(one)
    beside = [other for other in placed.contacts if other is one or other.name in placed.met_by(one)]
    shapes = [
        *(_block(canvas, body) for body in bodies_on_beam(placed) if body.part == BOX and body.pair == number),
        canvas.polygon("beam", [(left, -half), (right, -half), (right, half), (left, half)]),
        *(shape for other in beside for shape in _ball(canvas, placed, other)),
        *marks,
    ]
    words = f"{one.name} in its box, {gap_words(one)}"
    return element("svg", *shapes, viewBox=f"0 0 320 {2 * 126.0:g}", role="img", aria_label=words)
