"""Channels: what is recorded of a run, each a linear reading of the state.

A new built-in channel is a function and a line in `QUANTITIES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import (
    changed,
    check_fields,
    checked,
    choice,
    column,
    in_range,
    name_text,
    optional,
    place,
    quantity,
    require,
    require_name,
    require_type,
    suggestion,
)
from femimpact.regular_file import decimal_number
from femimpact.structure.structure import Position
from femimpact.system.system import System


@dataclass(frozen=True, eq=False)
class Reading:
    """A scalar that is linear in the state of a system, in its accelerations, in the base's motion and in the forces.

    value = displacement u + velocity u' + acceleration u'' + ball_displacement y + ball_velocity y'
    + ball_acceleration y'' + base (ub, ub', ub'') + contact_force F + point_force F(t) + reaction R + constant

    u and y are relative to the base, F_j acts on the structure along the direction b_j of its pair. Change a
    `zero_reading` with `dataclasses.replace`.

    Raises `InputError` if a row is not one of finite numbers.
    """

    displacement: NDArray[np.float64] = field(metadata=column("1", "dofs", finite=True))  # (dofs,)
    velocity: NDArray[np.float64] = field(metadata=column("1", "dofs", finite=True))  # (dofs,)
    acceleration: NDArray[np.float64] = field(metadata=column("1", "dofs", finite=True))  # (dofs,)
    # (pairs,) entries of stops are without effect: a stop does not move by itself
    ball_displacement: NDArray[np.float64] = field(metadata=column("1", "pairs", finite=True))
    ball_velocity: NDArray[np.float64] = field(metadata=column("1", "pairs", finite=True))  # (pairs,)
    ball_acceleration: NDArray[np.float64] = field(metadata=column("1", "pairs", finite=True))  # (pairs,)
    # (3,) of the base's displacement (m), velocity (m/s) and acceleration (m/s^2)
    base: NDArray[np.float64] = field(metadata=column("1", 3, finite=True))
    # (pairs,) per newton of each F_j, centring springs left out. Of a rigid pair this is the force while it sticks; an
    # impact is an impulse, which no instant shows.
    contact_force: NDArray[np.float64] = field(metadata=column("1/N", "pairs", finite=True))
    # (reactions,) per unit of each of `System.reactions`, in their order
    reaction: NDArray[np.float64] = field(metadata=column("1", "reactions", finite=True))
    # per newton of the force that drives, where one does
    point_force: float = field(default=0.0, metadata=quantity("1"))
    constant: float = field(default=0.0, metadata=quantity("1"))

    def __post_init__(self) -> None:
        check_fields(self)


def zero_reading(system: System) -> Reading:
    """The reading that is zero in every state of a system: others are made of it by `dataclasses.replace`."""
    if "zero reading" not in system.derived:
        dofs, pairs, base = np.zeros(system.dofs), np.zeros(len(system.contacts)), np.zeros(3)
        reactions = np.zeros(len(system.reactions))
        system.derived["zero reading"] = Reading(dofs, dofs, dofs, pairs, pairs, pairs, base, pairs, reactions)
    zero: Reading = system.derived["zero reading"]
    return zero


@runtime_checkable
class Channel(Protocol):
    """One recorded column: what it is called, its unit, and what it reads of a state.

    A user's class with these three serves in `Recorder.channels` beside the names of the built-in ones.
    """

    @property
    def name(self) -> str:
        """Name under which a response holds the channel."""

    @property
    def unit(self) -> str:
        """Unit of its values."""

    def reading(self, system: System) -> Reading:
        """The linear reading of a system's state."""


def _of_pair(system: System, at: Any, read: str) -> dict[str, Any]:
    """Gap or contact force of a ball or a stop; of the only one where none is named.

    - gap (m): the displacement x_j = y_j - b_j u that the gaps bound, ball minus beam, or the beam's deflection at a
      stop; at a stop fixed in space the absolute deflection; of balls that meet y_a - y_b;
    - contact_force (N): force F_j of contact on the beam, positive in the direction of w, or on the second of two
      balls that meet; a centring spring has no share in it. With Moreau-Jean and with an energy-consistent contact it
      is the mean over a step.
    """
    names = [contact.name for contact in system.contacts]
    if at is None:
        require(len(names) == 1, "channels", at, "", f"must name one of the contacts: {', '.join(names) or 'none'}")
    else:
        require_name(at, names, "channels")
    j = 0 if at is None else names.index(at)
    pair, chosen = system.contacts[j], np.eye(len(names))[j]
    if read == "contact_force":
        # a stop's b_j points against w
        return {"contact_force": pair.sign * chosen}
    of_balls = (not pair.is_stop) * chosen
    if pair.between:
        of_balls[list(system.meetings[j])] = 1.0, -1.0
    base = np.array([1.0 if pair.fixed_to == "space" else 0.0, 0.0, 0.0])
    return {"displacement": -pair.direction, "ball_displacement": of_balls, "base": base}


DERIVATIVES = ("displacement", "velocity", "acceleration")
"""What is read of a motion, by the order of its derivative."""


def _motion(system: System, at: Any, derivative: int, absolute: bool) -> dict[str, Any]:
    """Displacement, velocity or acceleration of a place or a ball: w(x, t) or y(t), in space with the base's added.

    The acceleration is the one that the equations of motion give at the instant of the sample, for every method.
    Beside rigid contacts it is that between impacts, whose share is an impulse.
    """
    read, balls = DERIVATIVES[derivative], [pair.name for pair in system.contacts]
    base = {"base": np.eye(3)[derivative]} if absolute else {}
    if at in balls and at not in system.points:
        return base | {f"ball_{read}": np.eye(len(balls))[balls.index(str(at))]}
    return base | {read: system.point_row(at)}


def _rotation(system: System, at: Any) -> dict[str, Any]:
    """Slope w'(x, t) of the deflection at a place on the beam, 1."""
    return {"displacement": np.asarray(system.deflection_rows([system.position_of(at)], derivative=1)[0])}


SECTION_UNITS = {
    "curvature": "1/m",
    "bending_moment": "N m",
    "shear_force": "N",
    "surface_strain": "1",
    "surface_stress": "Pa",
}


def _of_section(system: System, at: Any, read: str, side: str) -> dict[str, Any]:
    """A quantity of the section at a place on the beam, with the signs of `femimpact.system.hermite`.

    - curvature w'' (1/m); its error in an element is of the second order of the element's length;
    - bending_moment EI w'' (N m), the elastic part: damping in proportion to the stiffness and terms that a user adds
      add to the moment in the beam and are not in it;
    - shear_force (EI w'')' (N), the elastic part: EI w''' and, along a taper, (EI)' w''; of the first order of the
      element's length, and of the second in its middle; one value in an element of constant section;
    - surface_strain -c w'' (1) and surface_stress -E c w'' (Pa) of the surface on the side of +w, at the distance c
      from the neutral axis: half the thickness or the diameter, or the outer fibre of a section.

    `side` is which element is read at a node: "right" towards the tip, "left" towards the root. They differ where the
    section jumps.

    Raises `InputError` if no section is known there, or, of strain and stress, it is given by area and second moment
    alone.
    """
    x = [system.position_of(at)]
    if read == "shear_force":
        return {"displacement": system.shear_rows(x, side)[0]}
    section, factor = system.section_at(at, side), 1.0
    if read == "bending_moment":
        factor = section.bending_stiffness
    elif read != "curvature":
        factor = -section.known_half_height(f"{at}.{read}{'_left' if side == 'left' else ''}")
        factor *= section.young_modulus if read == "surface_stress" else 1.0
    return {"displacement": factor * np.asarray(system.curvature_rows(x, side)[0])}


def _reaction(system: System, at: Any, read: str) -> dict[str, Any]:
    """Force (N, along +w) or moment (N m, along +dw/dx) of one support on the structure.

    It is read from the held rows of M, C and K, with the forces that act on the support itself taken off, and with
    the acceleration that the equations of motion give; see `femimpact.system.hermite.Reaction`. With all dofs or
    all modes it is the sum of inertia and contact forces. With modes left out it is the reaction of the
    modes that are kept; "shaker_force" then shows the other sum, and a note of the response the difference.

    A root has three forces, which differ in phase: this one; the elastic shear force EI w''', which leaves damping
    and the mass beside the root out; and the shaker's force, which alone closes the balance of power.
    """
    known = list(system.reactions)
    reaction = f"{at if isinstance(at, str) else f'{at:.9g}'}.{read}"
    if reaction not in known:
        names, channel = _reaction_channels(system), f"{at}.reaction_{read}"
        other = next((name for name in names if name.startswith(f"{at}.")), None)
        lacks = f"the support there has no {read}; take {other!r}" if other else suggestion(channel, names)
        require(False, "channels", channel, "", f"no such reaction: {lacks}")
    return {"reaction": np.eye(len(known))[known.index(reaction)]}


def _reaction_channels(system: Any) -> list[str]:
    """Names of the channels of what supports do to a structure; the force of a spring or dashpot has none."""
    parts = [name.rpartition(".") for name in getattr(system, "reactions", ())]
    return [f"{stem}.reaction_{read}" for stem, _, read in parts if _kind(system, stem)]


def _shaker_force(system: System, at: None) -> dict[str, Any]:
    """Force (N, along +w) that moves the base: the rate of the momentum of all that stands on it, but for other forces.

    base_load u'' + m ub'' + sum m_j (y_j'' + ub'') - (gravity and other constant forces) - (forces of stops that stand
    in space) - (a driving point force). Its power is what the energy in the inertial frame gains and damping takes.
    The mass of the shaker's table is not in it.

    With modes left out, u'' is that of the kept ones, and the mass m and gravity are those of all: the momentum and
    the power of the motion that is computed. At rest it is the full weight whatever the number of modes, and gravity
    reads as a base acceleration of -g does.
    """
    balls = np.array([0.0 if pair.is_stop else pair.mass for pair in system.contacts])
    ball_weights = sum(mass * pair.acceleration for mass, pair in zip(balls, system.contacts, strict=True))
    held = sum(item.constant for item in system.reactions.values() if item.unit == "N")
    return {
        "acceleration": system.base_load,
        "ball_acceleration": balls,
        "base": np.array([0.0, 0.0, system.total_mass + float(balls.sum())]),
        # a stop's direction points against w
        "contact_force": np.array([float(pair.is_stop and pair.fixed_to == "space") for pair in system.contacts]),
        "point_force": -1.0,
        "constant": -float(system.constant_resultant + held + ball_weights),
    }


class Quantity(NamedTuple):
    """Meaning of the part of a name behind its dot, as in "tip.velocity"."""

    of: tuple[str, ...]  # things that have it
    unit: str
    fields: Callable[[System, Any], dict[str, Any]]  # of the reading of a thing: those that are not zero


MOTIONS = {
    f"{'absolute_' * absolute}{read}": (derivative, absolute)
    for absolute in (False, True)
    for derivative, read in enumerate(DERIVATIVES)
}
"""Order of the derivative of each quantity that is a motion, and whether it is in space."""

QUANTITIES: Mapping[str, Quantity] = {
    **{
        name: Quantity(
            ("place", "ball"), ("m", "m/s", "m/s^2")[derivative],
            partial(_motion, derivative=derivative, absolute=absolute),
        )
        for name, (derivative, absolute) in MOTIONS.items()
    },
    "rotation": Quantity(("place",), "1", _rotation),
    **{
        f"{name}{behind}": Quantity(("place",), unit, partial(_of_section, read=name, side=side))
        for side, behind in (("right", ""), ("left", "_left"))
        for name, unit in SECTION_UNITS.items()
    },
    "reaction_force": Quantity(("place",), "N", partial(_reaction, read="force")),
    "reaction_moment": Quantity(("place",), "N m", partial(_reaction, read="moment")),
    "gap": Quantity(("ball", "stop"), "m", partial(_of_pair, read="gap")),
    "contact_force": Quantity(("ball", "stop"), "N", partial(_of_pair, read="contact_force")),
    "shaker_force": Quantity((), "N", _shaker_force),
}  # fmt: skip
"""Quantities by the part of a name behind its dot; without a dot a place or a ball gives its relative displacement."""


@dataclass(frozen=True)
class QuantityAt:
    """The channel of a quantity: of a place (a name, or metres from the root), a ball, a stop or the base.

    Raises `InputError` if a value is out of range; when it is read, if the place or pair is unknown or lacks it.
    """

    quantity: str = field(metadata=choice(*QUANTITIES))
    at: Position | None = field(default=None, metadata=optional(place()))  # None of the base, and of the only contact

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it unless it is the relative displacement."""
        if self.at is None:
            return self.quantity
        return str(self.at) if self.quantity == "displacement" else f"{self.at}.{self.quantity}"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return QUANTITIES[self.quantity].unit

    def reading(self, system: System) -> Reading:
        """The reading of a state that the quantity is."""
        return changed(zero_reading(system), **QUANTITIES[self.quantity].fields(system, self.at))


def motion_at(at: Position, derivative: int = 0, absolute: bool = False) -> QuantityAt:
    """The channel of the displacement (0), velocity (1) or acceleration (2) of a place or a ball."""
    return QuantityAt(next(name for name, motion in MOTIONS.items() if motion == (derivative, absolute)), at)


def motion_of(channel: Any) -> tuple[int, bool] | None:
    """Order of the derivative that a channel is of a motion, and whether that is in space; None of any other one."""
    return MOTIONS.get(channel.quantity) if isinstance(channel, QuantityAt) else None


def is_of_contact(channel: Any) -> bool:
    """Whether a channel is a gap or a contact force."""
    return isinstance(channel, QuantityAt) and channel.quantity in ("gap", "contact_force")


def channel_key(name: Position, key: str = "channel") -> str:
    """The name under which a channel is kept: a text as it is, metres from the root as they are written.

    Raises `InputError` if it is neither.
    """
    fits = isinstance(name, str) or in_range(name, quantity("m"))
    require(fits, key, name, "", "must be the name of a channel, or metres from the root")
    # as `QuantityAt` writes them
    return name if isinstance(name, str) else str(float(name))


def _kind(system: Any, stem: str) -> str | None:
    """The kind of thing with a name, or at metres from the root: "place", "ball" or "stop"; None if unknown."""
    if stem in system.points or _metres(stem) is not None:
        return "place"
    return next(("stop" if pair.is_stop else "ball" for pair in system.contacts if pair.name == stem), None)


def _metres(text: str) -> float | None:
    value = decimal_number(text)
    return value if value is not None and in_range(value, quantity("m")) else None


def channel_of(
    system: Any,  # or what else has `points` and `contacts`
    # a place ("tip", a point of the mesh, metres from the root) or a ball, with what is read of it behind a dot (see
    # `QUANTITIES`); "gap" and "contact_force" alone belong to the only contact; "shaker_force" is the force that moves
    # the base
    channel: Position | Channel,
) -> Channel:
    """The channel that a name stands for.

    Raises `InputError` naming the unknown name and the known ones.
    """
    if not isinstance(channel, (str, float, int)):
        return channel
    if not isinstance(channel, str):
        return motion_at(channel)
    if channel == "shaker_force" or (channel in ("gap", "contact_force") and len(system.contacts) == 1):
        return QuantityAt(channel)
    stem, _, read = (channel, "", "displacement") if _kind(system, channel) else channel.rpartition(".")
    kind = _kind(system, stem)
    reaction = f"{stem}.{read.removeprefix('reaction_')}"
    is_reaction = reaction in getattr(system, "reactions", ())
    if kind is None:
        spring = "is the force of a spring or dashpot, no channel: take displacement or velocity of its place times "
        require(not is_reaction, "channels", channel, "", f"{spring}its stiffness or damping")
        alone = ["gap", "contact_force"] if len(system.contacts) == 1 else []
        known = [*system.points, *(pair.name for pair in system.contacts), *alone, "shaker_force"]
        behind = [name for name, entry in QUANTITIES.items() if entry.of]
        words = suggestion(stem if read in behind else channel, known)
        allowed = f"{words}, metres from the root, or one of these with one of .{', .'.join(behind)}"
        require(False, "channels", channel, "", allowed)
    fitting = [f"{stem}.{name}" for name, entry in QUANTITIES.items() if kind in entry.of]
    moving = kind != "stop" or read not in DERIVATIVES
    require(moving, "channels", channel, "", "is a stop, which does not move: take its .gap or .contact_force")
    if f"{stem}.{read}" not in fitting:
        words = f"unknown; did you mean '{stem}.reaction_{read}'?" if is_reaction else suggestion(channel, fitting)
        require(False, "channels", channel, "", words)
    return QuantityAt(read, stem if stem in system.points or kind != "place" else _metres(stem))


def resolve_channels(system: System, channels: Sequence[Position | Channel] | None) -> tuple[Channel, ...]:
    """The channels that names stand for; by default the default place, balls and absorbers, and contact forces.

    Raises
    ------
    InputError
        Naming the first unknown or ambiguous channel and the known ones, or a name that two channels have.
    """
    if channels is None:
        pairs = [pair.name for pair in system.contacts if pair.has_walls]
        alone = len(pairs) == len(system.contacts) == 1
        forces = ["contact_force"] if alone else [f"{pair}.contact_force" for pair in pairs]
        channels = (system.default_place, *(pair.name for pair in system.balls), *forces)
    resolved = tuple(channel_of(system, channel) for channel in channels)
    names: dict[str, Channel] = {}
    for channel in resolved:
        # a user's channel may have anything for a name and a unit
        checked("channels", channel.name, name_text())
        require_type(channel.unit, str, f"units.{channel.name}")
        same = names.setdefault(channel.name, channel)
        require(same == channel, "channels", channel.name, "", "must be the name of one channel, not of two")
    return resolved
