"""Mode shapes as series of frames: all modes one after another, and one mode over its period."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import checked, quantity, require
from femimpact.export.scene import build_whole_scene
from femimpact.export.scene_pieces import PARTS
from femimpact.export.vtk.fields import POINT_UNITS, RELATIVE_STRESS, beam_fields
from femimpact.export.vtk.series import Frame, Series, Value
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes, require_modes_of
from femimpact.system.system import System

__all__ = ["PARTS_IN_WORDS", "in_words", "mode_motion_series", "mode_series"]

PARTS_IN_WORDS = ", ".join(f"{number} {name}" for number, name in enumerate(PARTS))

SCALE = quantity("m", above=0.0, at_most=1e9)
"""Of the largest deflection drawn: energies are of its square."""

NOTE = (
    "mode shapes have no size of their own: this one is drawn with the largest deflection in `amplitude` (m), and "
    "every other array is that of this deflection; warp by displacement, factor 1"
)


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
        self.modes, self.height = modes, height
        self.scene = build_whole_scene(structure, system, 1.0, subdivisions)
        self.fields = beam_fields(self.scene, structure, system)
        nodal = np.asarray(system.expansion @ modes.vectors)
        x = np.concatenate(self.scene.stretches)
        largest = np.abs(np.asarray(system.deflection_rows(x) @ modes.vectors)).max(axis=0)
        self.factor = height / largest
        self.nodal = nodal * self.factor
        stresses = [float(np.abs(self.fields.at_points(column)["axial_stress"]).max()) for column in self.nodal.T]
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
        fields = {**self.about(i), **more, "units": in_words(points), "note": NOTE}
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
