"""Channels of the beam's section: curvature, bending moment, shear force, strain and stress at the surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from femimpact.errors import check_fields, choice, place
from femimpact.response.channels.reading import Reading, zero_reading
from femimpact.structure.structure import Position
from femimpact.system.system import System

__all__ = ["SectionReading"]

UNITS = {
    "curvature": "1/m",
    "bending_moment": "N m",
    "shear_force": "N",
    "surface_strain": "1",
    "surface_stress": "Pa",
}


@dataclass(frozen=True)
class SectionReading:
    """A quantity of the section at a place on the beam, with the signs of `femimpact.system.sections`.

    - curvature w'' (1/m); its error in an element is of the second order of the element's length;
    - bending_moment EI w'' (N m), the elastic part: damping in proportion to the stiffness and terms that a user adds
      add to the moment in the beam and are not in it;
    - shear_force (EI w'')' (N), the elastic part: EI w''' and, along a taper, (EI)' w''; of the first order of the
      element's length, and of the second in its middle; one value in an element of constant section;
    - surface_strain -h/2 w'' (1) and surface_stress -E h/2 w'' (Pa) of the surface on the side of +w.

    Parameters
    ----------
    at : str or float
        A named place, or metres from the root.
    quantity : {"curvature", "bending_moment", "shear_force", "surface_strain", "surface_stress"}
    side : {"right", "left"}
        Which element is read at a node: towards the tip, or towards the root. They differ where the section jumps.

    Raises
    ------
    InputError
        If a value is out of range; when it is read, if the place is unknown, or no section is known there.
    """

    at: Position = field(metadata=place())
    quantity: str = field(metadata=choice(*UNITS))
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
        return UNITS[self.quantity]

    def reading(self, system: System) -> Reading:
        """Row of w'' with the section's values at the place, or of (EI w'')'."""
        x = [system.position_of(self.at)]
        if self.quantity == "shear_force":
            return replace(zero_reading(system), displacement=system.shear_rows(x, self.side)[0])
        section = system.section_at(self.at, self.side)
        factor = {
            "curvature": 1.0,
            "bending_moment": section.bending_stiffness,
            "surface_strain": -section.half_height,
            "surface_stress": -section.young_modulus * section.half_height,
        }[self.quantity]
        return replace(zero_reading(system), displacement=factor * np.asarray(system.curvature_rows(x, self.side)[0]))
