"""Channels: what is recorded of a run, each a linear reading of the state.

A new built-in channel is a class and a line in `QUANTITIES`.
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
    text,
    truth,
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


def _pair_number(system: System, pair: str | None) -> int:
    """Number of a pair among the contacts; None is the only one."""
    names = [contact.name for contact in system.contacts]
    if pair is None:
        require(len(names) == 1, "channels", pair, "", f"must name one of the contacts: {', '.join(names) or 'none'}")
        return 0
    require_name(pair, names, "channels")
    return names.index(pair)


@dataclass(frozen=True)
class ContactReading:
    """Gap or contact force of a ball or a stop.

    - gap (m): the displacement x that the gaps bound, ball minus beam, or the beam's deflection at a stop; at a stop
      fixed in space the absolute deflection;
    - contact_force (N): force of contact on the beam, positive in the direction of w; a centring spring has no share in
      it. With Moreau-Jean and with an energy-consistent contact it is the mean over a step.

    Raises `InputError` if a value is out of range; when it is read, if there is no such pair.
    """

    quantity: str = field(metadata=choice("gap", "contact_force"))
    pair: str | None = field(default=None, metadata=optional(text()))  # name of a ball or a stop; None is the only one

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The pair's name with what is read of it."""
        return self.quantity if self.pair is None else f"{self.pair}.{self.quantity}"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "m" if self.quantity == "gap" else "N"

    def reading(self, system: System) -> Reading:
        """x_j = y_j - b_j u, and ub more at a stop fixed in space; or F_j, a stop's b_j pointing against w."""
        j, nothing = _pair_number(system, self.pair), zero_reading(system)
        pair, chosen = system.contacts[j], np.eye(len(system.contacts))[j]
        if self.quantity == "contact_force":
            return changed(nothing, contact_force=(-1.0 if pair.is_stop else 1.0) * chosen)
        ball = np.zeros(len(system.contacts)) if pair.is_stop else chosen
        base = np.array([1.0, 0.0, 0.0]) if pair.fixed_to == "space" else nothing.base
        return changed(nothing, displacement=-pair.direction, ball_displacement=ball, base=base)


NAMES = ("displacement", "velocity", "acceleration")
UNITS = ("m", "m/s", "m/s^2")


@dataclass(frozen=True)
class Motion:
    """Displacement, velocity or acceleration of a place or a ball: w(x, t) or y(t), in space with the base's added.

    The acceleration is the one that the equations of motion give at the instant of the sample, for every method.
    Beside rigid contacts it is that between impacts, whose share is an impulse.

    Raises `InputError` if a value is out of range; when it is read, if the place is unknown.
    """

    at: Position = field(metadata=place())  # a place of the structure, metres from the root, or a ball's name
    # 0 for the displacement (m), 1 for the velocity (m/s), 2 for the acceleration (m/s^2)
    derivative: int = field(default=0, metadata=quantity("1", at_least=0, at_most=2, integer=True))
    # in the inertial frame; otherwise relative to the moving base
    absolute: bool = field(default=False, metadata=truth())

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it unless it is the relative displacement."""
        read = NAMES[self.derivative]
        if self.absolute:
            return f"{self.at}.absolute_{read}"
        return f"{self.at}.{read}" if self.derivative else str(self.at)

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return UNITS[self.derivative]

    def reading(self, system: System) -> Reading:
        """Row of the place, or the coordinate of the ball, and the base's share."""
        balls = [pair.name for pair in system.contacts]
        nothing = zero_reading(system)
        base = np.eye(3)[self.derivative] if self.absolute else nothing.base
        if self.at in balls and self.at not in system.points:
            coordinate: Any = np.eye(len(balls))[balls.index(str(self.at))]
            moving = {("ball_displacement", "ball_velocity", "ball_acceleration")[self.derivative]: coordinate}
        else:
            moving = {NAMES[self.derivative]: system.point_row(self.at)}
        return changed(nothing, base=base, **moving)


@dataclass(frozen=True)
class Rotation:
    """Slope w'(x, t) of the deflection at a place on the beam, 1.

    Raises `InputError` if the value is no place; when it is read, if the place is unknown or lies on no beam.
    """

    at: Position = field(metadata=place())  # a named place, or metres from the root

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it."""
        return f"{self.at}.rotation"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "1"

    def reading(self, system: System) -> Reading:
        """Row of w' there."""
        row = system.deflection_rows([system.position_of(self.at)], derivative=1)[0]
        return changed(zero_reading(system), displacement=np.asarray(row))


SECTION_UNITS = {
    "curvature": "1/m",
    "bending_moment": "N m",
    "shear_force": "N",
    "surface_strain": "1",
    "surface_stress": "Pa",
}


@dataclass(frozen=True)
class SectionReading:
    """A quantity of the section at a place on the beam, with the signs of `femimpact.system.hermite`.

    - curvature w'' (1/m); its error in an element is of the second order of the element's length;
    - bending_moment EI w'' (N m), the elastic part: damping in proportion to the stiffness and terms that a user adds
      add to the moment in the beam and are not in it;
    - shear_force (EI w'')' (N), the elastic part: EI w''' and, along a taper, (EI)' w''; of the first order of the
      element's length, and of the second in its middle; one value in an element of constant section;
    - surface_strain -c w'' (1) and surface_stress -E c w'' (Pa) of the surface on the side of +w, at the distance c
      from the neutral axis: half the thickness or the diameter, or the outer fibre of a section.

    Raises `InputError` if a value is out of range; when it is read, if the place is unknown, no section is known
    there, or, of strain and stress, the section is given by area and second moment alone.
    """

    at: Position = field(metadata=place())  # a named place, or metres from the root
    # {"curvature", "bending_moment", "shear_force", "surface_strain", "surface_stress"}
    quantity: str = field(metadata=choice(*SECTION_UNITS))
    # {"right", "left"}: which element is read at a node: towards the tip, or towards the root. They differ where the
    # section jumps.
    side: str = field(default="right", metadata=choice("right", "left"))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it."""
        return f"{self.at}.{self.quantity}{'_left' if self.side == 'left' else ''}"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return SECTION_UNITS[self.quantity]

    def reading(self, system: System) -> Reading:
        """Row of w'' with the section's values at the place, or of (EI w'')'."""
        x = [system.position_of(self.at)]
        if self.quantity == "shear_force":
            return changed(zero_reading(system), displacement=system.shear_rows(x, self.side)[0])
        section = system.section_at(self.at, self.side)
        if self.quantity == "curvature":
            factor = 1.0
        elif self.quantity == "bending_moment":
            factor = section.bending_stiffness
        else:
            factor = -section.known_half_height(self.name)
            factor *= section.young_modulus if self.quantity == "surface_stress" else 1.0
        return changed(zero_reading(system), displacement=factor * np.asarray(system.curvature_rows(x, self.side)[0]))


@dataclass(frozen=True)
class SupportReaction:
    """Force (N, along +w) or moment (N m, along +dw/dx) of one support on the structure.

    It is read from the held rows of M, C and K, with the forces that act on the support itself taken off, and with
    the acceleration that the equations of motion give; see `femimpact.system.hermite.Reaction`. With all dofs or
    all modes it is the sum of inertia and contact forces. With modes left out it is the reaction of the
    modes that are kept; `ShakerForce` then shows the other sum, and a note of the response the difference.

    A root has three forces, which differ in phase: this one; the elastic shear force EI w''', which leaves damping
    and the mass beside the root out; and the shaker's force, which alone closes the balance of power.

    Parameters
    ----------
    at : str or float
        Place of the support.
    quantity : {"force", "moment"}

    Raises
    ------
    InputError
        When it is read, if no support gives this reaction.
    """

    at: Position = field(metadata=place())
    quantity: str = field(default="force", metadata=choice("force", "moment"))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it."""
        return f"{self.at}.reaction_{self.quantity}"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "N" if self.quantity == "force" else "N m"

    def reading(self, system: System) -> Reading:
        """The reaction of this support alone."""
        known = list(system.reactions)
        at = self.at if isinstance(self.at, str) else f"{self.at:.9g}"
        reaction = f"{at}.{self.quantity}"
        if reaction not in known:
            require(False, "channels", self.name, "", f"no such reaction: {suggestion(reaction, known)}")
        return changed(zero_reading(system), reaction=np.eye(len(known))[known.index(reaction)])


@dataclass(frozen=True)
class ShakerForce:
    """Force (N, along +w) that moves the base: the rate of the momentum of all that stands on it, but for other forces.

    base_load u'' + m ub'' + sum m_j (y_j'' + ub'') - (gravity and other constant forces) - (forces of stops that stand
    in space) - (a driving point force). Its power is what the energy in the inertial frame gains and damping takes.
    The mass of the shaker's table is not in it.

    With modes left out, u'' is that of the kept ones, and the mass m and gravity are those of all: the momentum and
    the power of the motion that is computed. At rest it is the full weight whatever the number of modes, and gravity
    reads as a base acceleration of -g does.
    """

    @property
    def name(self) -> str:
        """Always "shaker_force": there is one base."""
        return "shaker_force"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "N"

    def reading(self, system: System) -> Reading:
        """Momentum of structure and balls, and what else acts on them."""
        balls = np.array([0.0 if pair.is_stop else pair.mass for pair in system.contacts])
        ball_weights = sum(mass * pair.acceleration for mass, pair in zip(balls, system.contacts, strict=True))
        held = sum(item.constant for item in system.reactions.values() if item.unit == "N")
        constant = system.constant_resultant + held + ball_weights
        # a stop's direction points against w
        in_space = np.array([1.0 if pair.is_stop and pair.fixed_to == "space" else 0.0 for pair in system.contacts])
        return changed(
            zero_reading(system),
            acceleration=system.base_load,
            ball_acceleration=balls,
            base=np.array([0.0, 0.0, system.total_mass + float(balls.sum())]),
            contact_force=in_space,
            point_force=-1.0,
            constant=-float(constant),
        )


def channel_key(name: Position, key: str = "channel") -> str:
    """The name under which a channel is kept: a text as it is, metres from the root as they are written.

    Raises `InputError` if it is neither.
    """
    fits = isinstance(name, str) or in_range(name, quantity("m"))
    require(fits, key, name, "", "must be the name of a channel, or metres from the root")
    # as `Motion` writes them
    return name if isinstance(name, str) else str(float(name))


class Quantity(NamedTuple):
    """Meaning of the part of a name behind its dot, as in "tip.velocity": things that have it, and the channel."""

    of: tuple[str, ...]
    make: Callable[[Any], Channel]


QUANTITIES: Mapping[str, Quantity] = {
    "displacement": Quantity(("place", "ball"), Motion),
    "velocity": Quantity(("place", "ball"), partial(Motion, derivative=1)),
    "acceleration": Quantity(("place", "ball"), partial(Motion, derivative=2)),
    "absolute_displacement": Quantity(("place", "ball"), partial(Motion, absolute=True)),
    "absolute_velocity": Quantity(("place", "ball"), partial(Motion, derivative=1, absolute=True)),
    "absolute_acceleration": Quantity(("place", "ball"), partial(Motion, derivative=2, absolute=True)),
    "rotation": Quantity(("place",), Rotation),
    **{name: Quantity(("place",), partial(SectionReading, quantity=name)) for name in SECTION_UNITS},
    **{
        f"{name}_left": Quantity(("place",), partial(SectionReading, quantity=name, side="left"))
        for name in SECTION_UNITS
    },
    "reaction_force": Quantity(("place",), SupportReaction),
    "reaction_moment": Quantity(("place",), partial(SupportReaction, quantity="moment")),
    "gap": Quantity(("ball", "stop"), partial(ContactReading, "gap")),
    "contact_force": Quantity(("ball", "stop"), partial(ContactReading, "contact_force")),
}
"""Quantities by the part of a name behind its dot; without a dot a place or a ball gives its relative displacement."""


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
        return Motion(channel)
    if channel == "shaker_force":
        return ShakerForce()
    if channel in ("gap", "contact_force") and len(system.contacts) == 1:
        return QUANTITIES[channel].make(None)
    stem, _, read = (channel, "", "displacement") if _kind(system, channel) else channel.rpartition(".")
    kind = _kind(system, stem)
    if kind is None:
        alone = ["gap", "contact_force"] if len(system.contacts) == 1 else []
        known = [*system.points, *(pair.name for pair in system.contacts), *alone, "shaker_force"]
        behind = ", ".join(f".{name}" for name in QUANTITIES)
        words = suggestion(stem if read in QUANTITIES else channel, known)
        allowed = f"{words}, metres from the root, or one of these with one of {behind}"
        require(False, "channels", channel, "", allowed)
    fitting = [f"{stem}.{name}" for name, entry in QUANTITIES.items() if kind in entry.of]
    moving = kind != "stop" or read not in ("displacement", "velocity", "acceleration")
    require(moving, "channels", channel, "", "is a stop, which does not move: take its .gap or .contact_force")
    if f"{stem}.{read}" not in fitting:
        require(False, "channels", channel, "", suggestion(channel, fitting))
    return QUANTITIES[read].make(stem if stem in system.points or kind != "place" else _metres(stem))


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
