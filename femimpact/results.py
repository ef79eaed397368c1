"""The files that a study leaves behind: their names, where they go, and how they are read back."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femimpact.errors import require
from femimpact.export import tables

if TYPE_CHECKING:
    import xarray

__all__ = ["FILES", "RIDING_FILE", "StudyResults", "load", "prepare_directory"]

FILES = {
    "summary": "summary.json",
    "study": "study.toml",
    "modes": "modes.csv",
    "sweep": "sweep.csv",
    "sweep_data": "sweep.nc",
    "history": "history.nc",
    "impacts": "impacts.csv",
    "impact_data": "impacts.nc",
    "modes_scene": "modes.pvd",
    "deflection_scene": "deflection.pvd",
    "movie": "deflection.mp4",
    "mode_figure": "modes.png",
    "response_figure": "response.png",
    "force_figure": "contact_force.png",
    "portrait_figure": "phase_portrait.png",
    "impact_histograms": "impact_histograms.png",
    "impulse_phase": "impulse_phase.png",
}
"""Every file that a study can leave behind."""

RIDING_FILE = "riding.csv"
"""Left only by a history in which something rode."""

OTHER_FILES = (
    RIDING_FILE, "contact.csv",
    "deflection.gif", "comparison.csv", "restitution.csv", "restitution.png", "mesh_convergence.csv",
    "mesh_convergence.png", "step_convergence.csv", "step_convergence.png",
)  # fmt: skip
"""What a riding ball, a table of contacts, the demo and a convergence study leave besides."""


@dataclass(frozen=True, eq=False)
class StudyResults:
    """Results of a study, read back from its directory.

    Parameters
    ----------
    directory : Path
    summary : mapping
        `summary.json`.
    modes, impacts, riding : mapping of str to ndarray, or None
        Tables by column; no riding where nothing rode.
    sweep, history, impact_data : xarray.Dataset or None
        The last holds the impacts with the energy to each mode.
    """

    directory: Path
    summary: Mapping[str, Any]
    modes: Mapping[str, Any] | None
    impacts: Mapping[str, Any] | None
    sweep: xarray.Dataset | None
    history: xarray.Dataset | None
    impact_data: xarray.Dataset | None
    riding: Mapping[str, Any] | None


def load(directory: str | Path) -> StudyResults:
    """Read the results that a study left in a directory.

    Raises
    ------
    InputError
        If the directory holds no results.
    """
    import xarray

    require(isinstance(directory, (str, Path)), "directory", directory, "", "must be the path of a directory")
    folder = Path(directory)
    found = (folder / FILES["summary"]).is_file()
    require(found, "directory", str(folder), "", f"must hold results of a study ({FILES['summary']} is missing)")

    def table(file: str) -> Mapping[str, Any] | None:
        path = folder / file
        return tables.read_csv(path) if path.is_file() else None

    def dataset(name: str) -> xarray.Dataset | None:
        path = folder / FILES[name]
        return xarray.load_dataset(path, engine="h5netcdf") if path.is_file() else None

    summary = json.loads((folder / FILES["summary"]).read_text(encoding="utf-8"))
    return StudyResults(
        folder,
        summary,
        modes=table(FILES["modes"]),
        impacts=table(FILES["impacts"]),
        sweep=dataset("sweep_data"),
        history=dataset("history"),
        impact_data=dataset("impact_data"),
        riding=table(RIDING_FILE),
    )


@contextmanager
def prepare_directory(directory: str | Path, force: bool = False) -> Iterator[Path]:
    """A staging folder whose content moves into the directory when all went well, and vanishes otherwise.

    Raises
    ------
    InputError
        If the directory exists and is not empty, unless forced; then earlier results are
        replaced and other files stay.
    """
    target = Path(directory)
    free = not target.exists() or (target.is_dir() and not any(target.iterdir()))
    require(free or target.is_dir(), "output", str(target), "", "must be a directory: this is a file")
    usable = free or force
    require(usable, "output", str(target), "", "exists already: choose another directory with -o, or --force")
    parent = target.resolve().parent
    parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=parent))
    try:
        yield staging
        target.mkdir(exist_ok=True)
        # results of an earlier run must not stand beside these; foreign files stay
        for name in (*FILES.values(), *OTHER_FILES):
            (target / name).unlink(missing_ok=True)
        for item in sorted(staging.iterdir()):
            place = target / item.name
            if place.is_dir() and not place.is_symlink():
                shutil.rmtree(place)
            os.replace(item, place)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
