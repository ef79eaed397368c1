"""The moving beam, its boxes and balls as a series of frames."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import checked, quantity, require_name
from femimpact.export.scene import BALL_DENSITY, EXAGGERATION, Scene, ball_radius, build_whole_scene
from femimpact.export.vtk.fields import beam_fields
from femimpact.export.vtk.instants import Frames, frames_of
from femimpact.export.vtk.modes import PARTS_IN_WORDS, in_words
from femimpact.export.vtk.series import Frame, Series, Value
from femimpact.response.response import Response
from femimpact.structure.structure import Structure

__all__ = ["deflection_series"]

Kind = TypeVar("Kind", np.float64, np.int32)


def deflection_series(
    response: Response, structure: Structure, exaggeration: float = 1.0, most: int = 600, frame: str = "base"
) -> Series:
    """Frames of a run on an even grid and at its impacts; see `write_deflection`."""
    exaggeration = checked("exaggeration", exaggeration, EXAGGERATION)
    most = checked("most", most, quantity("frames", at_least=1, integer=True))
    require_name(frame, ("base", "space"), "frame")
    frames = frames_of(response, most)
    scene = build_whole_scene(structure, response.system, exaggeration)
    fields = beam_fields(scene, structure, response.system)
    fixed = _about(response, exaggeration, frame, frames.mismatch)
    times, absolute = [float(t) for t in frames.snapshots.time], frame == "space"

    def make(k: int) -> Frame:
        snapshots, base = frames.snapshots, response.base
        at, rate = float(base.displacement(times[k])), float(base.velocity(times[k]))
        shift, speed = ((at, 0.0), (rate, 0.0)) if absolute else ((0.0, -at), (0.0, -rate))
        nodal = snapshots.displacement[k]
        points = {
            "displacement": scene.displacement(nodal, snapshots.ball_displacement[k], *shift),
            "velocity": scene.motion(snapshots.velocity[k], snapshots.ball_velocity[k], *speed),
            "rotation": scene.rotation(nodal),
            **fields.at_points(nodal),
            "contact_force_vector": _at_marks(scene, response, snapshots.contact_force[k]),
            "contact_impulse_vector": _at_marks(scene, response, frames.impulse[k]),
        }
        cells = {
            "part": scene.part,
            "contact_pair": scene.pair,
            "contact_force": _on_cells(scene, snapshots.contact_force[k]),
            "state": _on_cells(scene, frames.touching[k].astype(np.int32)),
            "mean_strain_energy_density": fields.on_cells(nodal),
        }
        about: dict[str, Value] = {
            "name": _name(frames, k),
            "impact": float(bool(frames.what[k])),
            "contacts": _contacts(response, snapshots.contact_force[k], frames.impulse[k]),
            "units": in_words(points),
        }
        return Frame({**about, **fixed}, points, cells)

    names = [_name(frames, k) for k in range(len(times))]
    return Series(scene.points, scene.connectivity, scene.offsets, scene.types, times, names, make)


def _name(frames: Frames, k: int) -> str:
    return f"t = {frames.snapshots.time[k]:.6g} s" + (f", {frames.what[k]}" if frames.what[k] else "")


def _contacts(response: Response, forces: NDArray[np.float64], impulses: NDArray[np.float64]) -> str:
    """What presses in a frame, in words: name, wall or side, force and impulse; one line for each contact."""
    lines = []
    for pair, force, impulse in zip(response.system.contacts, forces, impulses, strict=True):
        known = (("force", force, "N"), ("impulse", impulse, "N s"))
        values = [f"{what} {abs(value):.3g} {unit}" for what, value, unit in known if value != 0.0]
        if values:
            pressed = (impulse or force) * (-1.0 if pair.is_stop else 1.0)
            place = f"{'+' if pressed > 0.0 else '-'} {'side' if pair.is_stop else 'wall'}"
            lines.append(f"{pair.name} on its {place}: {', '.join(values)}")
    return "\n".join(lines)


def _about(response: Response, exaggeration: float, frame: str, mismatch: float) -> dict[str, Value]:
    """Field data that is the same in every file; the radii (m) in the order of the impactors."""
    motion = "relative to the moving base" if frame == "base" else "absolute, in space"
    note = (
        f"displacement {motion}; displacement and clearance times {exaggeration:g}; every other array true, not "
        "exaggerated"
    )
    fields: dict[str, Value] = {"exaggeration": float(exaggeration), "impact_state_mismatch": float(mismatch)}
    if response.system.balls:
        # the model has no radius: the ball is a point mass to it
        fields["ball_radius"] = [ball_radius(pair.mass) for pair in response.system.balls]
        note += f"; each ball is drawn as a steel sphere ({BALL_DENSITY:g} kg/m^3) of its mass"
    return {**fields, "parts": PARTS_IN_WORDS, "note": note}


def _on_cells(scene: Scene, values: NDArray[Kind]) -> NDArray[Kind]:
    """Value of its pair on every cell of boxes, balls and stops, 0 elsewhere."""
    # cells of no pair have -1, which reads the appended zero
    return np.asarray(np.append(values, np.zeros(1, dtype=values.dtype))[scene.pair])


def _at_marks(scene: Scene, response: Response, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Forces (or impulses) along y at the points of contact on the side that is pressed, (points, 3).

    At the wall of a box, or the beam beside a stop, it is that on the structure; at the ball, or the stop, the
    opposite one.
    """
    result = np.zeros_like(scene.points)
    for point, pair, side, reaction in scene.marks:
        # the + wall of a box is pushed towards +w, and the beam away from its + stop
        pressed = -side if response.system.contacts[pair].is_stop else side
        if pressed * values[pair] > 0.0:
            result[point, 1] = -values[pair] if reaction else values[pair]
    return result
