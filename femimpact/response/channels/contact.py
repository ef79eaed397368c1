"""Channels of contacts: the gap of a pair and the force on the beam."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from femimpact.errors import check_fields, optional, require, suggestion, text
from femimpact.response.channels.reading import Reading, zero_reading
from femimpact.system.system import System

__all__ = ["ContactForce", "Gap"]


def _pair_number(system: System, pair: str | None) -> int:
    """Where a pair stands among the contacts; None is the only one."""
    names = [contact.name for contact in system.contacts]
    if pair is None:
        require(len(names) == 1, "channels", pair, "", f"must name one of the contacts: {', '.join(names) or 'none'}")
        return 0
    require(pair in names, "channels", pair, "", suggestion(pair, names))
    return names.index(pair)


@dataclass(frozen=True)
class Gap:
    """Displacement x (m) that the gaps bound: ball minus beam, or the beam's deflection at a stop.

    At a stop fixed in space it is the absolute deflection.

    Parameters
    ----------
    pair : str, optional
        Name of a ball or a stop; None is the only one.

    Raises
    ------
    InputError
        If the value is no name; when it is read, if there is no such pair.
    """

    pair: str | None = field(default=None, metadata=optional(text()))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The pair's name with "gap" behind it."""
        return "gap" if self.pair is None else f"{self.pair}.gap"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "m"

    def reading(self, system: System) -> Reading:
        """x_j = y_j - b_j u, and ub more at a stop fixed in space."""
        j, nothing = _pair_number(system, self.pair), zero_reading(system)
        pair = system.contacts[j]
        ball = np.zeros(len(system.contacts)) if pair.is_stop else np.eye(len(system.contacts))[j]
        base = np.array([1.0, 0.0, 0.0]) if pair.fixed_to == "space" else nothing.base
        return replace(nothing, displacement=-pair.direction, ball_displacement=ball, base=base)


@dataclass(frozen=True)
class ContactForce:
    """Force (N) of contact of a pair on the beam, positive in the direction of w; a centring spring has no share in it.

    With Moreau-Jean and with an energy-consistent contact it is the mean over a step.

    Parameters
    ----------
    pair : str, optional
        Name of a ball or a stop; None is the only one.

    Raises
    ------
    InputError
        If the value is no name; when it is read, if there is no such pair.
    """

    pair: str | None = field(default=None, metadata=optional(text()))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The pair's name with "contact_force" behind it."""
        return "contact_force" if self.pair is None else f"{self.pair}.contact_force"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "N"

    def reading(self, system: System) -> Reading:
        """F_j; a stop's direction b_j points against w."""
        j = _pair_number(system, self.pair)
        sign = -1.0 if system.contacts[j].is_stop else 1.0
        return replace(zero_reading(system), contact_force=sign * np.eye(len(system.contacts))[j])
