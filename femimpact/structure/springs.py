"""Springs and dashpots between the beam and the base, or between two places of the beam."""

from __future__ import annotations

from dataclasses import dataclass, field

from femimpact.errors import check_fields, optional, place, quantity, require, text

__all__ = ["Dashpot", "Spring"]


@dataclass(frozen=True)
class Spring:
    """A linear spring along the deflection, to the moving base or between two places of the beam.

    The force on the beam at `at` is -stiffness (w(at) - w(to)), and the opposite one acts at `to`. A place need not be
    a node of the mesh: the force acts through the interpolation of its element.

    Parameters
    ----------
    name : str
        A name that no other part of the structure has.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.
    stiffness : float, N/m
        Force over elongation.
    to : str or float, optional
        The other end's place on the beam; None is the base.

    Raises
    ------
    InputError
        If a value is out of range, or both ends are at one place.
    """

    name: str = field(metadata=text())
    at: str | float = field(metadata=place())
    stiffness: float = field(metadata=quantity("N/m", at_least=0.0))
    to: str | float | None = field(default=None, metadata=optional(place()))

    def __post_init__(self) -> None:
        check_fields(self)
        require(self.to != self.at, "to", self.to, "", "must be another place than the one at `at`, or None")


@dataclass(frozen=True)
class Dashpot:
    """A viscous damper along the deflection, to the moving base or between two places of the beam.

    The force on the beam at `at` is -damping (w'(at) - w'(to)) with the velocities w' relative to the base, and the
    opposite one acts at `to`. The damping no longer decouples on the normal modes (`reduce`), but by chance.

    Parameters
    ----------
    name : str
        A name that no other part of the structure has.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.
    damping : float, N s/m
        Force over speed.
    to : str or float, optional
        The other end's place on the beam; None is the base.

    Raises
    ------
    InputError
        If a value is out of range, or both ends are at one place.
    """

    name: str = field(metadata=text())
    at: str | float = field(metadata=place())
    damping: float = field(metadata=quantity("N s/m", at_least=0.0))
    to: str | float | None = field(default=None, metadata=optional(place()))

    def __post_init__(self) -> None:
        check_fields(self)
        require(self.to != self.at, "to", self.to, "", "must be another place than the one at `at`, or None")
