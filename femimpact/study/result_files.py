"""The files that a study leaves behind: their names, and which of them stand in a folder.

No name of a file that is moved, replaced or removed comes from anywhere else: not from a file, not from a listing.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterable
from pathlib import Path

__all__ = [
    "FILES",
    "NAMES",
    "OTHER_FILES",
    "PLACES",
    "REPORT",
    "SUMMARY",
    "earlier_files",
    "is_file",
    "is_folder",
    "replaced_by",
    "result_files",
]

SUMMARY = "summary.json"

FILES = {
    "summary": SUMMARY,
    "study": "study.toml",
    "modes": "modes.csv",
    "mode_shapes": "modes.nc",
    "sweep": "sweep.csv",
    "sweep_data": "sweep.nc",
    "history": "history.nc",
    "impacts": "impacts.csv",
    "impact_data": "impacts.nc",
    "snapshots": "snapshots.nc",
    "last_cycles": "last_cycles.nc",
    "modes_scene": "modes.pvd",
    "modes_script": "modes_paraview.py",
    **{f"mode_{i}_scene": f"mode_{i}.pvd" for i in range(1, 5)},
    **{f"mode_{i}_script": f"mode_{i}_paraview.py" for i in range(1, 5)},
    "deflection_scene": "deflection.pvd",
    "deflection_script": "deflection_paraview.py",
    "movie": "deflection.mp4",
    "mode_figure": "modes.png",
    "response_figure": "response.png",
    "force_figure": "contact_force.png",
    "portrait_figure": "phase_portrait.png",
    "impact_histograms": "impact_histograms.png",
    "impulse_phase": "impulse_phase.png",
}
"""Every file that a study can leave behind."""

OTHER_FILES = {
    "deflection_hdf": "deflection.vtkhdf",
    "sticking": "sticking.csv",
    "old_sticking": "riding.csv",
    "base_record": "base_record.csv",
    "contact_table": "contact.csv",
    "movie_without_encoder": "deflection.gif",
    "comparison": "comparison.csv",
    "restitution": "restitution.csv",
    "restitution_figure": "restitution.png",
    "response_of_starts": "response_of_starts.png",
    "mesh_convergence": "mesh_convergence.csv",
    "mesh_convergence_figure": "mesh_convergence.png",
    "step_convergence": "step_convergence.csv",
    "step_convergence_figure": "step_convergence.png",
    "quantities_over_mesh": "quantities_over_mesh.csv",
    "quantities_over_mesh_figure": "quantities_over_mesh.png",
    "quantities_over_step": "quantities_over_step.csv",
    "quantities_over_step_figure": "quantities_over_step.png",
    "quantities_over_modes": "quantities_over_modes.csv",
    "quantities_over_modes_figure": "quantities_over_modes.png",
    "statistics_over_mesh": "statistics_over_mesh.csv",
    "convergence_summary": "convergence_summary.csv",
    "parameter_study": "study.nc",
    "parameter_table": "study.csv",
    "convergence_notes": "convergence.json",
    "report": "report.html",
}
"""What is left besides: one file of deflections where the study has `vtkhdf`, what a history leaves in which something
stuck (and its name in results of earlier versions), the record of the base, what a table of contacts, a movie
without an encoder, the demo, a convergence study and a parameter study leave, and the report of any of them."""

NAMES = sorted((*FILES.values(), *OTHER_FILES.values()), key=lambda name: (name == SUMMARY, name))
"""All of them, the summary last."""

SCENES = tuple(name.removesuffix(".pvd") for name in NAMES if name.endswith(".pvd"))
"""Folders of frames, beside the collections that name them."""

FRAME = re.compile(r"[0-9]{4,}\.vtu")

PLACES = (*NAMES, *(f"{scene}/0000.vtu" for scene in SCENES))
"""Every name, with one frame of each scene."""

REPORT = OTHER_FILES["report"]
"""It is made from the other files, and can be made again at any time."""

INPUTS = frozenset({FILES["study"], OTHER_FILES["base_record"]})
"""What a run is made from: it goes only where another run brings its own, for it may be the user's."""

MOVIES = frozenset({FILES["movie"], OTHER_FILES["movie_without_encoder"]})


def result_files(folder: Path) -> list[str]:
    """Names of the results that stand in a folder as regular files: frames, then what names them, the summary last."""
    return _standing(folder, stat.S_ISREG)


def earlier_files(folder: Path, new: Iterable[str] = ()) -> list[str]:
    """Names of the results in a folder that new ones supersede, the summary first; links of such a name, too."""
    found = _standing(folder, lambda mode: stat.S_ISREG(mode) or stat.S_ISLNK(mode))
    kept = frozenset() if FILES["study"] in new else INPUTS
    return [name for name in reversed(found) if name not in kept]


def replaced_by(added: Iterable[str]) -> frozenset[str]:
    """Names of results that must be gone before some are added to them: the summary, and the other of two movies."""
    names = frozenset(added)
    return names & {SUMMARY} | (MOVIES - names if names & MOVIES else frozenset())


def is_file(path: Path) -> bool:
    """Whether this is a regular file itself, and no link to one."""
    return stat.S_ISREG(_mode(path))


def is_folder(path: Path) -> bool:
    """Whether this is a folder itself, and no link to one."""
    return stat.S_ISDIR(_mode(path))


def _standing(folder: Path, kind: Callable[[int], bool]) -> list[str]:
    frames = [
        f"{scene}/{name}"
        for scene in SCENES
        if is_folder(folder / scene)
        for name in sorted(os.listdir(folder / scene))
        if FRAME.fullmatch(name)
    ]
    return [name for name in (*frames, *NAMES) if kind(_mode(folder / name))]


def _mode(path: Path) -> int:
    """Kind and permissions of what stands there, of a link its own; 0 where nothing does."""
    try:
        return path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return 0
