"""What is read of a beam's nodal values for colours: curvature, moment, shear force, strain, stress, energy.

Within a stretch of beam a reading at a node is the mean of those of the two elements beside it, which for moment and
shear force is of a higher order than either of them. At the end of a stretch, where a section jumps or a force acts,
it is the reading of the element inside the stretch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.export.scene import Scene
from femimpact.export.scene_pieces import BEAM, sections_along
from femimpact.structure.structure import Structure
from femimpact.system.hermite import hermite_rows, place_in_element
from femimpact.system.matrices import Matrix
from femimpact.system.system import System

__all__ = ["POINT_UNITS", "RELATIVE_STRESS", "BeamFields", "beam_fields"]

Array = NDArray[np.float64]

POINT_UNITS = {
    "displacement": "m", "velocity": "m/s", "rotation": "1", "curvature": "1/m", "bending_moment": "N m",
    "shear_force": "N", "axial_strain": "1", "axial_stress": "Pa", "strain_energy_density": "J/m^3",
    "contact_force_vector": "N", "contact_impulse_vector": "N s", "relative_stress": "1",
}  # fmt: skip
"""Arrays at points and their units; `rotation` in radians."""

RELATIVE_STRESS = "relative_stress"
"""Axial stress as a share of the largest of its mode: a mode has no size, and neither has its stress."""

POINTS_OF_SECTION = 4


@dataclass(frozen=True, eq=False)
class BeamFields:
    """Readings of nodal values on the sections of a scene's beam.

    Parameters
    ----------
    curvature, moment, shear : csr_array (sections, 2 nodes)
        w'' (1/m), E I w'' (N m) and (E I w'')' (N).
    begin, end : csr_array (beam cells, 2 nodes)
        w'' at both ends of a cell, read inside the cell.
    modulus : ndarray (sections,), Pa
    height : ndarray (beam points,), m
        y of each point above the neutral axis.
    cell_energy : ndarray (beam cells, 3), N
        Mean strain energy density of a cell by the products a a, a b and b b of w'' at its ends a and b.
    points, cells : int
        Of the whole scene.
    on_beam : ndarray (cells,)
        Which of its cells are the beam's.
    """

    curvature: Matrix
    moment: Matrix
    shear: Matrix
    begin: Matrix
    end: Matrix
    modulus: Array
    height: Array
    cell_energy: Array
    points: int
    on_beam: NDArray[np.bool_]

    def at_points(self, nodal: Array) -> dict[str, Array]:
        """Arrays at points, 0 off the beam; strain and stress are those of the point, on a surface of the beam."""
        curvature = np.repeat(self.curvature @ nodal, POINTS_OF_SECTION)
        strain = -self.height * curvature
        stress = np.repeat(self.modulus, POINTS_OF_SECTION) * strain
        values = {
            "curvature": curvature,
            "bending_moment": np.repeat(self.moment @ nodal, POINTS_OF_SECTION),
            "shear_force": np.repeat(self.shear @ nodal, POINTS_OF_SECTION),
            "axial_strain": strain,
            "axial_stress": stress,
            "strain_energy_density": 0.5 * stress * strain,
        }
        off = np.zeros(self.points - curvature.size)
        return {name: np.concatenate([value, off]) for name, value in values.items()}

    def on_cells(self, nodal: Array) -> Array:
        """Mean strain energy density (J/m^3) of every cell: times its volume it sums to the strain energy."""
        a, b = self.begin @ nodal, self.end @ nodal
        values = np.zeros(self.on_beam.size)
        values[self.on_beam] = np.sum(self.cell_energy * np.stack([a * a, a * b, b * b], axis=1), axis=1)
        return values


def beam_fields(scene: Scene, structure: Structure, system: System) -> BeamFields:
    """Readings on the sections of a scene.

    Parameters
    ----------
    scene : Scene
    structure : Structure
        Whose rectangles are drawn.
    system : System
        Gives nodes, and the constants of the section in every element where it has them.

    Returns
    -------
    BeamFields
    """
    x = np.concatenate(scene.stretches)
    sizes = [stations.size for stations in scene.stretches]
    last = np.cumsum(sizes) - 1
    first = last + 1 - np.array(sizes)
    # of the element on the right: half inside a stretch, all at its beginning, nothing at its end
    share = np.full(x.size, 0.5)
    share[first], share[last] = 1.0, 0.0
    weights = (share, 1.0 - share)
    sides = ("right", "left")
    middle = np.repeat([0.5 * (stations[0] + stations[-1]) for stations in scene.stretches], sizes)
    constants = [_constants(structure, system, x, middle, side) for side in sides]
    rows = [[hermite_rows(system.nodes, x, order, side) for side in sides] for order in (2, 3)]

    def mean(order: int, factors: Any) -> Any:
        parts = zip(weights, factors, rows[order - 2], strict=True)
        right, left = (sparse.diags_array(weight * factor) @ row for weight, factor, row in parts)
        return sparse.csr_array(right + left)

    stiffness, slope = ([each[i] for each in constants] for i in (0, 2))
    begins, ends = (np.delete(np.arange(x.size), gone) for gone in (last, first))
    return BeamFields(
        curvature=mean(2, (1.0, 1.0)),
        moment=mean(2, stiffness),
        shear=mean(3, stiffness) + mean(2, slope),
        begin=sparse.csr_array(rows[0][0])[begins],
        end=sparse.csr_array(rows[0][1])[ends],
        modulus=share * constants[0][1] + (1.0 - share) * constants[1][1],
        height=scene.points[: POINTS_OF_SECTION * x.size, 1],
        cell_energy=_cell_energy(scene, structure, system, x[begins], x[ends], middle[begins]),
        points=len(scene.points),
        on_beam=scene.part == BEAM,
    )


def _constants(structure: Structure, system: System, x: Array, middle: Array, side: str) -> tuple[Array, Array, Array]:
    """E I (N m^2), E (Pa) and d(E I)/dx (N m) beside positions.

    They are those of the drawn segments where the system has no sections.
    """
    if system.sections is not None:
        element, s = place_in_element(system.nodes, x, side)
        slope = system.sections.bending_stiffness_at(element, s, 1) / np.diff(system.nodes)[element]
        return system.sections.bending_stiffness_at(element, s), system.sections.young_modulus[element], slope
    beam = structure.beam
    found = []
    for at, within in zip(x, middle, strict=True):
        i = beam.segment_index_at(float(within))
        segment = beam.segments[i]
        (width, thickness), start, end = (
            segment.rectangle_at(at - beam.joints[i]),
            segment.rectangle,
            segment.end_rectangle,
        )
        stiffness = segment.young_modulus * width * thickness**3 / 12.0
        growth = (end[0] - start[0]) / width + 3.0 * (end[1] - start[1]) / thickness
        found.append((stiffness, segment.young_modulus, stiffness * growth / segment.length))
    return tuple(np.array(found).T)


def _cell_energy(scene: Scene, structure: Structure, system: System, begin: Array, end: Array, middle: Array) -> Array:
    """Half the integral of E I w''^2 over cells, by w'' at both ends, over their volume: (cells, 3).

    E I is of degree 4 along a taper and w'' linear: four Gauss points are exact.
    """
    places, weights = np.polynomial.legendre.leggauss(4)
    share = 0.5 * (1.0 + places)
    x = begin[:, None] + (end - begin)[:, None] * share
    stiffness = _constants(structure, system, x.ravel(), np.repeat(middle, share.size), "right")[0].reshape(x.shape)
    products = np.stack([(1.0 - share) ** 2, 2.0 * share * (1.0 - share), share**2], axis=1)
    section = [sections_along(structure, stations) for stations in scene.stretches]
    (w, t), (u, v) = (np.concatenate([each[cut] for each in section]).T for cut in (slice(-1), slice(1, None)))
    area = (w * t + u * v) / 3.0 + (w * v + u * t) / 6.0
    return np.asarray(0.25 * (stiffness * weights) @ products / area[:, None])
