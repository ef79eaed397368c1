"""Fields along the beam, and mode shapes as series of frames: every mode once, or one mode over its period."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import checked, quantity, require
from femimpact.scene.scene import BEAM, PARTS, Scene, build_scene, outline_of, sections_along
from femimpact.structure.structure import Structure
from femimpact.system.hermite import needs_outer_fibre, place_in_element
from femimpact.system.matrices import Matrix
from femimpact.system.modes import Modes, require_modes_of
from femimpact.system.system import System
from femimpact.vtk.formats import Frame, Series, Value

POINT_UNITS = {
    "displacement": "m", "velocity": "m/s", "rotation": "1", "curvature": "1/m", "bending_moment": "N m",
    "shear_force": "N", "axial_strain": "1", "axial_stress": "Pa", "strain_energy_density": "J/m^3",
    "contact_force_vector": "N", "contact_impulse_vector": "N s", "relative_stress": "1",
}  # fmt: skip
"""Arrays at points and their units; `rotation` in radians."""

RELATIVE_STRESS = "relative_stress"
"""Axial stress as a share of the largest of its mode: a mode has no size, and neither has its stress."""


@dataclass(frozen=True, eq=False)
class BeamFields:
    """Readings of nodal values on the sections of a scene's beam."""

    curvature: Matrix  # csr_array (sections, 2 nodes) 1/m: w''
    moment: Matrix  # csr_array (sections, 2 nodes) N m: E I w''
    shear: Matrix  # csr_array (sections, 2 nodes) N: (E I w'')'
    begin: Matrix  # csr_array (beam cells, 2 nodes) 1/m: w'' at both ends of a cell, read inside the cell
    end: Matrix
    modulus: Array  # (sections,) Pa
    section: NDArray[np.intp]  # (beam points,) number of the section of each point
    # (beam points,) m: y of each point above the neutral axis, of a section that is drawn as another one up to its
    # outer fibre; not a number where that is not known
    height: Array
    # (beam cells, 3) N: mean strain energy density of a cell by the products a a, a b and b b of w'' at its ends a, b
    cell_energy: Array
    points: int  # of the scene
    on_beam: NDArray[np.bool_]  # (cells,) True for cells of the beam

    def at_points(self, nodal: Array) -> dict[str, Array]:
        """Arrays at points, 0 off the beam; strain and stress are those of the point, on a surface of the beam."""
        curvature = (self.curvature @ nodal)[self.section]
        strain = -self.height * curvature
        stress = self.modulus[self.section] * strain
        values = {
            "curvature": curvature,
            "bending_moment": (self.moment @ nodal)[self.section],
            "shear_force": (self.shear @ nodal)[self.section],
            "axial_strain": strain,
            "axial_stress": stress,
            "strain_energy_density": 0.5 * stress * strain,
        }
        off = np.zeros(self.points - curvature.size)
        return {name: np.concatenate([value, off]) for name, value in values.items()}

    def on_cells(self, nodal: Array) -> Array:
        """Mean strain energy density (J/m^3) of every cell: times its volume it sums to that of bending."""
        a, b = self.begin @ nodal, self.end @ nodal
        values = np.zeros(self.on_beam.size)
        values[self.on_beam] = np.sum(self.cell_energy * np.stack([a * a, a * b, b * b], axis=1), axis=1)
        return values


def beam_fields(
    scene: Scene,
    structure: Structure,  # whose sections are drawn
    system: System,  # gives nodes, and the constants of the section in every element where it has them
) -> BeamFields:
    """Readings on the sections of a scene."""
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
    rows = [[system.nodal_rows(x, order, side) for side in sides] for order in (2, 3)]

    def mean(order: int, factors: Any) -> Any:
        parts = zip(weights, factors, rows[order - 2], strict=True)
        right, left = (sparse.diags_array(weight * factor) @ row for weight, factor, row in parts)
        return sparse.csr_array(right + left)

    stiffness, slope = ([constant[i] for constant in constants] for i in (0, 2))
    begins, ends = (np.delete(np.arange(x.size), gone) for gone in (last, first))
    segments = [sections_along(structure, stations)[0] for stations in scene.stretches]
    outlines, steps = [outline_of(segment) for segment in segments], np.array(sizes) - 1
    section = np.repeat(np.arange(x.size), np.repeat([len(face.points) for face in outlines], sizes))
    step = np.repeat(np.arange(begins.size), np.repeat([len(face.cells) for face in outlines], steps))
    dense = np.concatenate([np.tile(face.share / face.area, n) for face, n in zip(outlines, steps, strict=True)])
    energy = _cell_energy(scene, structure, system, x[begins], x[ends], middle[begins])
    outer = [(segment.half_height or math.nan) / (0.5 * segment.drawn_at(0.0)[1]) for segment in segments]
    return BeamFields(
        curvature=mean(2, (1.0, 1.0)),
        moment=mean(2, stiffness),
        shear=mean(3, stiffness) + mean(2, slope),
        begin=sparse.csr_array(rows[0][0])[begins[step]],
        end=sparse.csr_array(rows[0][1])[ends[step]],
        modulus=share * constants[0][1] + (1.0 - share) * constants[1][1],
        section=section,
        height=scene.points[: section.size, 1] * np.repeat(outer, sizes)[section],
        cell_energy=energy[step] * dense[:, None],
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
    rows = []
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
        rows.append((stiffness, segment.young_modulus, stiffness * growth / segment.length))
    return tuple(np.array(rows).T)


def _cell_energy(scene: Scene, structure: Structure, system: System, begin: Array, end: Array, middle: Array) -> Array:
    """Half the integral of E I w''^2 from section to section, by w'' at both ends, over width, height and length.

    Returns (steps, 3).

    E I is of degree 4 along a taper and w'' linear: four Gauss points are exact.
    """
    places, weights = np.polynomial.legendre.leggauss(4)
    share = 0.5 * (1.0 + places)
    x = begin[:, None] + (end - begin)[:, None] * share
    stiffness = _constants(structure, system, x.ravel(), np.repeat(middle, share.size), "right")[0].reshape(x.shape)
    products = np.stack([(1.0 - share) ** 2, 2.0 * share * (1.0 - share), share**2], axis=1)
    section = [sections_along(structure, stations)[1] for stations in scene.stretches]
    (w, t), (u, v) = (np.concatenate([sizes[cut] for sizes in section]).T for cut in (slice(-1), slice(1, None)))
    area = (w * t + u * v) / 3.0 + (w * v + u * t) / 6.0
    return np.asarray(0.25 * (stiffness * weights) @ products / area[:, None])


PARTS_IN_WORDS = ", ".join(f"{number} {name}" for number, name in enumerate(PARTS))

SCALE = quantity("m", above=0.0, at_most=1e9)
"""Largest deflection that is drawn; its bound keeps energies, of its square, finite."""

NOTE = (
    "mode shapes have no size of their own: this one is drawn with the largest deflection in `amplitude` (m), and "
    "every other array is that of this deflection; warp by displacement, factor 1"
)


def largest_known(values: Array) -> float:
    """Largest absolute value, without what is not known; 0 where nothing is."""
    return float(np.nanmax(np.abs(values), initial=0.0))


def notes_of(structure: Structure, *first: str) -> str:
    """Notes of a frame: the first ones, and those on segments drawn as another section or without a known surface."""
    surfaces = [
        f"no axial strain and stress: each {needs_outer_fibre(segment.name)}"
        if segment.half_height is None
        else f"axial strain and stress of {segment.name} at its outer fibre, not where that is drawn"
        for segment in structure.beam.segments
        if segment.area is not None
    ]
    return "; ".join(filter(None, (*first, structure.beam.drawn_words, *surfaces)))


def in_words(names: Any) -> str:
    """Units of arrays in one line, as "displacement: m; ..."."""
    return "; ".join(f"{name}: {POINT_UNITS[name]}" for name in names)


class _Shapes:
    """Every mode of a system on the points of its scene."""

    def __init__(
        self, system: System, modes: Modes, structure: Structure, subdivisions: int, scale: float | None
    ) -> None:
        allowed = quantity("cells", at_least=1, integer=True)
        subdivisions = checked("subdivisions", subdivisions, allowed)
        height = 0.1 * structure.beam.length if scale is None else checked("scale", scale, SCALE)
        require_modes_of(system.dofs, modes)
        self.modes, self.height, self.note = modes, height, notes_of(structure, NOTE)
        self.scene = build_scene(structure, system, 1.0, subdivisions)
        self.fields = beam_fields(self.scene, structure, system)
        nodal = np.asarray(system.expansion @ modes.vectors)
        x = np.concatenate(self.scene.stretches)
        largest = np.abs(np.asarray(system.deflection_rows(x) @ modes.vectors)).max(axis=0)
        self.factor = height / largest
        self.nodal = nodal * self.factor
        stresses = [largest_known(self.fields.at_points(column)["axial_stress"]) for column in self.nodal.T]
        # a rigid motion has none but of rounding
        rigid = np.array(stresses) * modes.natural_frequency == 0.0
        self.largest_stress = np.where(rigid, np.inf, stresses)
        # every ball moves with its box, or it would leave it
        places = [pair.position for pair in system.balls]
        at_balls = np.asarray(system.deflection_rows(places)) if places else np.zeros((0, system.dofs))
        self.balls = np.asarray(at_balls @ modes.vectors) * self.factor

    def name(self, i: int) -> str:
        return f"mode {i + 1}, {self.modes.natural_frequency[i]:.6g} Hz"

    def about(self, i: int) -> dict[str, Value]:
        return {
            "name": self.name(i),
            "mode": float(i + 1),
            "natural_frequency": float(self.modes.natural_frequency[i]),
            "damping_ratio": float(self.modes.damping_ratio[i]),
            "effective_mass": float(self.modes.effective_mass[i]),
            "amplitude": float(self.height),
            "modal_coordinate": float(self.factor[i]),
            "parts": PARTS_IN_WORDS,
        }

    def frame(self, i: int, share: float, speed: float | None, **more: Value) -> Frame:
        """The mode times a share of its largest deflection, with the velocities of a speed (1/s) times it."""
        nodal, balls = share * self.nodal[:, i], share * self.balls[:, i]
        points: dict[str, NDArray[np.float64]] = {"displacement": self.scene.displacement(nodal, balls)}
        if speed is not None:
            points["velocity"] = self.scene.motion(speed * self.nodal[:, i], speed * self.balls[:, i])
        points["rotation"] = self.scene.rotation(nodal)
        points |= self.fields.at_points(nodal)
        points[RELATIVE_STRESS] = points["axial_stress"] / self.largest_stress[i]
        cells: dict[str, NDArray[np.float64 | np.int32]] = {
            "part": self.scene.part,
            "contact_pair": self.scene.pair,
            "mean_strain_energy_density": self.fields.on_cells(nodal),
        }
        fields = {**self.about(i), **more, "units": in_words(points), "note": self.note}
        return Frame(fields, points, cells)

    def series(self, times: list[float], names: list[str], frame: Any) -> Series:
        scene = self.scene
        grid = (scene.points, scene.connectivity, scene.offsets, scene.types)
        return Series(*grid, times, names, frame, coloured_by=RELATIVE_STRESS)


def mode_series(
    system: System, modes: Modes, structure: Structure, subdivisions: int = 1, scale: float | None = None
) -> Series:
    """One frame for each mode, its time value the mode's number; see `write_modes`."""
    shapes = _Shapes(system, modes, structure, subdivisions, scale)
    count = modes.natural_frequency.size
    times, names = [float(i + 1) for i in range(count)], [shapes.name(i) for i in range(count)]
    return shapes.series(times, names, lambda i: shapes.frame(i, 1.0, None))


def mode_motion_series(
    system: System, modes: Modes, structure: Structure, mode: int, frames: int = 24, subdivisions: int = 1,
    scale: float | None = None,
) -> Series:  # fmt: skip
    """One mode over one undamped period, its time value in s; see `write_mode`."""
    count = modes.natural_frequency.size
    mode = checked("mode", mode, quantity("", at_least=1, at_most=count, integer=True))
    frames = checked("frames", frames, quantity("frames", at_least=2, integer=True))
    shapes, i = _Shapes(system, modes, structure, subdivisions, scale), mode - 1
    frequency = float(modes.natural_frequency[i])
    require(frequency > 0.0, "mode", mode, "", "must be an elastic one: a rigid motion has no period")
    phases = [2.0 * math.pi * k / frames for k in range(frames)]
    omega = 2.0 * math.pi * frequency

    def frame(k: int) -> Frame:
        return shapes.frame(i, math.cos(phases[k]), -omega * math.sin(phases[k]), phase=phases[k])

    times = [k / (frames * frequency) for k in range(frames)]
    return shapes.series(times, [f"{shapes.name(i)}, phase {p:.4g} rad" for p in phases], frame)
