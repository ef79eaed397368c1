"""Channels: what is recorded of a run, each a linear reading of the state.

A new built-in channel is a class in a separate file and a line in `QUANTITIES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from femimpact.decimal_number import decimal_number
from femimpact.errors import in_range, quantity, require, suggestion
from femimpact.response.channels.contact import ContactForce, Gap
from femimpact.response.channels.motion import Motion, Rotation
from femimpact.response.channels.reading import Channel, Reading, zero_reading
from femimpact.response.channels.section import UNITS as SECTION_UNITS
from femimpact.response.channels.section import SectionReading
from femimpact.response.channels.support import ShakerForce, SupportReaction
from femimpact.structure.structure import Position
from femimpact.system.system import System

__all__ = [
    "QUANTITIES",
    "Channel",
    "ContactForce",
    "Gap",
    "Motion",
    "Reading",
    "Rotation",
    "SectionReading",
    "ShakerForce",
    "SupportReaction",
    "channel_key",
    "channel_of",
    "resolve_channels",
    "zero_reading",
]


def channel_key(name: Position, key: str = "channel") -> str:
    """The name under which a channel is kept: a text as it is, metres from the root as they are written.

    Raises
    ------
    InputError
        If it is neither.
    """
    fits = isinstance(name, str) or in_range(name, quantity("m"))
    require(fits, key, name, "", "must be the name of a channel, or metres from the root")
    # as `Motion` writes them
    return name if isinstance(name, str) else str(float(name))


class Quantity(NamedTuple):
    """What a name like "tip.velocity" may stand for: of which kinds of things, and the channel of one."""

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
    "gap": Quantity(("ball", "stop"), Gap),
    "contact_force": Quantity(("ball", "stop"), ContactForce),
}
"""What stands behind the dot of a channel's name; without a dot a place or a ball gives its relative displacement."""


def _kind(shown: Any, stem: str) -> str | None:
    """Whether a name, or metres from the root, is that of a place, a ball or a stop; None of nothing known."""
    if stem in shown.points or _metres(stem) is not None:
        return "place"
    return next(("stop" if pair.is_stop else "ball" for pair in shown.contacts if pair.name == stem), None)


def _metres(text: str) -> float | None:
    value = decimal_number(text)
    return value if value is not None and in_range(value, quantity("m")) else None


def channel_of(shown: Any, channel: Position | Channel) -> Channel:
    """The channel that a name stands for.

    Parameters
    ----------
    shown : System
        Or what else has `points` and `contacts`.
    channel : str, float or Channel
        A place ("tip", a point of the mesh, metres from the root) or a ball, with what is read of it behind a dot
        (see `QUANTITIES`); "gap" and "contact_force" alone belong to the only contact; "shaker_force" is the force that
        moves the base.

    Returns
    -------
    Channel

    Raises
    ------
    InputError
        Naming the unknown name and the known ones.
    """
    if not isinstance(channel, (str, float, int)):
        return channel
    if not isinstance(channel, str):
        return Motion(channel)
    if channel == "shaker_force":
        return ShakerForce()
    if channel in ("gap", "contact_force") and len(shown.contacts) == 1:
        return QUANTITIES[channel].make(None)
    stem, _, read = (channel, "", "displacement") if _kind(shown, channel) else channel.rpartition(".")
    kind = _kind(shown, stem)
    if kind is None:
        alone = ["gap", "contact_force"] if len(shown.contacts) == 1 else []
        known = [*shown.points, *(pair.name for pair in shown.contacts), *alone, "shaker_force"]
        behind = ", ".join(f".{name}" for name in QUANTITIES)
        words = suggestion(stem if read in QUANTITIES else channel, known)
        allowed = f"{words}, metres from the root, or one of these with one of {behind}"
        require(False, "channels", channel, "", allowed)
    fitting = [f"{stem}.{name}" for name, entry in QUANTITIES.items() if kind in entry.of]
    moving = kind != "stop" or read not in ("displacement", "velocity", "acceleration")
    require(moving, "channels", channel, "", "is a stop, which does not move: take its .gap or .contact_force")
    if f"{stem}.{read}" not in fitting:
        require(False, "channels", channel, "", suggestion(channel, fitting))
    return QUANTITIES[read].make(stem if stem in shown.points or kind != "place" else _metres(stem))


def resolve_channels(system: System, channels: Sequence[Position | Channel] | None) -> tuple[Channel, ...]:
    """The channels that names stand for; by default the default place, every ball and every contact force.

    Raises
    ------
    InputError
        Naming the first unknown or ambiguous channel and the known ones, or a name that two channels have.
    """
    if channels is None:
        pairs = [pair.name for pair in system.contacts]
        forces = [f"{pair}.contact_force" for pair in pairs] if len(pairs) > 1 else ["contact_force"] * len(pairs)
        channels = (system.default_place, *(pair.name for pair in system.balls), *forces)
    found = tuple(channel_of(system, channel) for channel in channels)
    names: dict[str, Channel] = {}
    for channel in found:
        same = names.setdefault(channel.name, channel)
        require(same == channel, "channels", channel.name, "", "must be the name of one channel, not of two")
    return found
