"""What `run` does with a study, the names of its result files, and how they are read back."""

from __future__ import annotations

import importlib.metadata
import json
import math
import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.errors import require
from femimpact.export import figures, tables
from femimpact.identification import amplitude_ratio_damping, fit_one_pole, half_power
from femimpact.impacts import IMPACT_UNITS
from femimpact.integrators.collision import achieved_restitution
from femimpact.integrators.integrate import integrate
from femimpact.integrators.newmark import Newmark, check_step, recommended_step
from femimpact.modes import Modes, solve_modes
from femimpact.response import Recorder, Response
from femimpact.structure import glue_impactors
from femimpact.study import Study, build
from femimpact.sweep import SWEEP_UNITS, FrequencyResponse, frequency_sweep
from femimpact.system import State, System, without_impactors

if TYPE_CHECKING:
    import xarray

__all__ = [
    "FILES",
    "Report",
    "StudyResults",
    "SweepPair",
    "history_record",
    "load",
    "prepare_directory",
    "run_modes",
    "run_simulation",
    "run_study",
    "run_sweep",
    "summary_of",
]

FILES = {
    "summary": "summary.json",
    "study": "study.toml",
    "modes": "modes.csv",
    "sweep": "sweep.csv",
    "sweep_data": "sweep.nc",
    "history": "history.nc",
    "impacts": "impacts.csv",
    "modes_scene": "modes.pvd",
    "deflection_scene": "deflection.pvd",
    "movie": "deflection.mp4",
    "mode_figure": "modes.png",
    "response_figure": "response.png",
    "force_figure": "contact_force.png",
    "portrait_figure": "phase_portrait.png",
}
"""Every file that a study can leave behind."""

MODES_LISTED = 4

Report = Callable[[str, float], None]
"""Called with what is being done and the share of it that is done."""


def _silent(_what: str, _share: float) -> None:
    pass


# ---- reading back ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class StudyResults:
    """Results of a study, read back from its directory.

    Parameters
    ----------
    directory : Path
    summary : mapping
        `summary.json`.
    modes, impacts : mapping of str to ndarray, or None
        Tables by column.
    sweep, history : xarray.Dataset or None
    """

    directory: Path
    summary: Mapping[str, Any]
    modes: Mapping[str, Any] | None
    impacts: Mapping[str, Any] | None
    sweep: xarray.Dataset | None
    history: xarray.Dataset | None


def load(directory: str | Path) -> StudyResults:
    """Read the results that a study left in a directory.

    Raises
    ------
    InputError
        If the directory holds no results.
    """
    import xarray

    folder = Path(directory)
    found = (folder / FILES["summary"]).is_file()
    require(found, "directory", str(folder), "", f"must hold results of a study ({FILES['summary']} is missing)")

    def table(name: str) -> Mapping[str, Any] | None:
        path = folder / FILES[name]
        return tables.read_csv(path) if path.is_file() else None

    def dataset(name: str) -> xarray.Dataset | None:
        path = folder / FILES[name]
        return xarray.load_dataset(path, engine="h5netcdf") if path.is_file() else None

    summary = json.loads((folder / FILES["summary"]).read_text(encoding="utf-8"))
    return StudyResults(folder, summary, table("modes"), table("impacts"), dataset("sweep_data"), dataset("history"))


# ---- where results go -----------------------------------------------------------------------------


@contextmanager
def prepare_directory(directory: str | Path, force: bool = False) -> Iterator[Path]:
    """A staging folder whose content moves into the directory when all went well, and vanishes otherwise.

    Raises
    ------
    InputError
        If the directory exists and is not empty, unless forced; then only files of the same
        names are replaced.
    """
    target = Path(directory)
    free = not target.exists() or (target.is_dir() and not any(target.iterdir()))
    usable = free or (force and target.is_dir())
    require(usable, "output", str(target), "", "exists already: choose another directory with -o, or --force")
    parent = target.resolve().parent
    parent.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=parent))
    try:
        yield staging
        target.mkdir(exist_ok=True)
        for item in sorted(staging.iterdir()):
            place = target / item.name
            if place.is_dir() and not place.is_symlink():
                shutil.rmtree(place)
            os.replace(item, place)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


# ---- the parts of a run ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SweepPair:
    """The sweep of a study without and with its balls, on one grid of frequencies.

    Parameters
    ----------
    empty : FrequencyResponse
    ball : FrequencyResponse or None
        None where the study has no impactor.
    coarse : ndarray, Hz
        The even grid of the study; the other frequencies refine it.
    """

    empty: FrequencyResponse
    ball: FrequencyResponse | None
    coarse: Any


def run_modes(study: Study) -> tuple[System, Modes, Modes | None]:
    """The full system, its modes without balls, and those with every ball glued on."""
    full = build(study)[0]
    count = min(MODES_LISTED, full.dofs)
    glued = None
    if study.structure.impactors:
        glued = solve_modes(build(study, glue_impactors(study.structure))[0], count)
    return full, solve_modes(full, count), glued


def history_record(study: Study, small: System, method: Newmark) -> Recorder:
    """What the study's history keeps: every place that carries a ball, the balls, the last cycles whole."""
    output = study.output
    kept = _frames_duration(study)
    channels: list[str | float] = ["tip", "tip.velocity", "mid"]
    for pair in small.contacts:
        place = next((name for name, x in small.points.items() if x == pair.position), None)
        if place not in (None, "tip"):
            channels += [str(place), f"{place}.velocity"]
        channels += [pair.name, f"{pair.name}.velocity", f"{pair.name}.contact_force"]
    return Recorder(
        channels=tuple(channels),
        every=output.every,
        snapshots=max(round(kept / (output.frames * method.dt)), 1) if output.frames else 0,
        snapshots_start=max(study.base.duration - kept, 0.0),
    )


def _frames_duration(study: Study) -> float:
    return min(study.output.frame_cycles / study.base.frequency, study.base.duration)


def run_simulation(study: Study, report: Report = _silent) -> Response:
    """The history that the study asks for, with snapshots over its last cycles."""
    _, small, method = build(study)
    record = history_record(study, small, method)
    return integrate(
        small, study.sine, method, study.base.duration, record, study.initial, lambda share: report("history", share)
    )


def run_sweep(study: Study, report: Report = _silent, initial: State | None = None) -> SweepPair:
    """Sweeps without and with balls: the even grid, refined around both resonances."""
    plan = study.sweep
    require(plan is not None, "sweep", None, "", "table [sweep] is missing")
    if plan is None:
        raise AssertionError("require raises")
    _, small, method = build(study)
    bare = without_impactors(small)
    bare_method = build_method(study, bare)
    coarse = np.linspace(plan.start, plan.stop, plan.points)
    state = initial or study.initial
    frequencies = coarse
    if plan.refine:
        centres = [small.first_frequency]
        reach = [8.0 * max(float(solve_modes(bare, 1).damping_ratio[0]), 1e-4) * small.first_frequency]
        if small.contacts:
            first = frequency_sweep(
                small, study.base.amplitude, coarse, method, plan.cycles, initial=state, ledger=False,
                progress=lambda share: report("sweep with ball, even grid", share),
            )  # fmt: skip
            centres.append(first.peak_frequency)
            reach.append(1.5 * float(coarse[1] - coarse[0]))
        fine = [np.linspace(c - r, c + r, plan.refine) for c, r in zip(centres, reach, strict=True)]
        inside = [part[(part > plan.start) & (part < plan.stop)] for part in fine]
        frequencies = np.unique(np.round(np.concatenate([coarse, *inside]), 9))
    empty = frequency_sweep(
        bare, study.base.amplitude, frequencies, bare_method, plan.cycles, initial=_structure_only(state),
        progress=lambda share: report("sweep without ball", share),
    )  # fmt: skip
    ball = None
    if small.contacts:
        ball = frequency_sweep(
            small, study.base.amplitude, frequencies, method, plan.cycles, initial=state,
            progress=lambda share: report("sweep with ball", share),
        )  # fmt: skip
    return SweepPair(empty, ball, coarse)


def build_method(study: Study, bare: System) -> Newmark:
    """The method for the study without balls: its own recommended step unless the study gives one."""
    settings = dict(study.method)
    settings.setdefault("dt", recommended_step(bare))
    return Newmark(**settings)


def _structure_only(state: State) -> State:
    return State(state.displacement, state.velocity, frame=state.frame)


# ---- the summary ----------------------------------------------------------------------------------


def _curve_summary(curve: FrequencyResponse, coarse: Any) -> dict[str, Any]:
    on_grid = np.isclose(curve.frequency[:, None], coarse[None, :], atol=1e-9).any(axis=1)
    fit, half = curve.damping, curve.damping_half_power
    grid = (curve.frequency[on_grid], curve.peak[on_grid])
    coarse_fit, coarse_half = fit_one_pole(*grid), half_power(*grid)
    return {
        "peak_frequency": curve.peak_frequency,
        "peak_amplitude": curve.peak_amplitude,
        "damping_fit": fit.ratio,
        "damping_fit_interval": fit.interval,
        "damping_fit_frequency": fit.frequency,
        "damping_half_power": half.ratio,
        "damping_half_power_interval": half.interval,
        "coarse_grid": {"damping_fit": coarse_fit.ratio, "damping_half_power": coarse_half.ratio},
        "start": curve.start,
        "cycles": curve.cycles,
        "largest_energy_residual": float(np.nanmax(curve.energy_residual)),
        "steadiness": {str(k): int(n) for k, n in zip(*np.unique(curve.steadiness, return_counts=True), strict=True)},
        "warnings": [*curve.warnings, *_prefixed("fit", fit.warnings), *_prefixed("half-power", half.warnings)],
        "coarse_warnings": [*_prefixed("fit", coarse_fit.warnings), *_prefixed("half-power", coarse_half.warnings)],
    }


def _prefixed(label: str, warnings: tuple[str, ...]) -> list[str]:
    return [f"{label}: {warning}" for warning in warnings]


def summary_of(
    study: Study,
    modes: tuple[System, Modes, Modes | None] | None = None,
    response: Response | None = None,
    sweeps: SweepPair | None = None,
) -> dict[str, Any]:
    """Machine-readable summary: plain numbers in Hz, m, N, N s and 1."""
    _, small, method = build(study)
    warnings = list(check_step(small, method))
    summary: dict[str, Any] = {"study": str(study.path.name), "versions": _versions(), "step": method.dt}
    if modes is not None:
        _, empty, glued = modes
        summary["natural_frequency"] = {"empty": empty.natural_frequency}
        summary["damping_ratio"] = empty.damping_ratio
        if glued is not None:
            summary["natural_frequency"]["glued"] = glued.natural_frequency
    if small.contacts:
        first = small.contacts[0]
        summary["restitution"] = first.parameters.restitution
        summary["contact"] = _contact_summary(small, method, response)
    if sweeps is not None:
        summary["sweep"] = {"empty": _curve_summary(sweeps.empty, sweeps.coarse)}
        warnings += [f"sweep without ball: {text}" for text in summary["sweep"]["empty"]["warnings"]]
        if sweeps.ball is not None:
            summary["sweep"]["ball"] = _curve_summary(sweeps.ball, sweeps.coarse)
            ratio = sweeps.empty.peak_amplitude / sweeps.ball.peak_amplitude
            by_ratio = amplitude_ratio_damping(
                sweeps.empty.damping, sweeps.empty.peak_amplitude, sweeps.ball.peak_amplitude
            )
            summary["amplitude_ratio"] = ratio
            summary["sweep"]["ball"]["damping_amplitude_ratio"] = by_ratio.ratio
            warnings += [f"sweep with ball: {text}" for text in summary["sweep"]["ball"]["warnings"]]
    if response is not None:
        warnings += [f"history: {text}" for text in response.warnings]
        summary["history"] = {
            "frequency": response.base.frequency,
            "peak": response.steady.peak[0],
            "rms": response.steady.rms[0],
            "steadiness": str(response.steady.steadiness[0]),
            "impacts": len(response.impacts) + response.impacts.dropped,
            "impacts_per_cycle": response.statistics.impacts_per_cycle,
        }
        summary["energy_residual"] = response.energy.residual if response.energy is not None else math.nan
        summary["notes"] = list(response.notes)
    elif sweeps is not None:
        summary["energy_residual"] = float(np.nanmax((sweeps.ball or sweeps.empty).energy_residual))
    summary["warnings"] = list(dict.fromkeys(warnings))
    return summary


def _contact_summary(small: System, method: Newmark, response: Response | None) -> dict[str, Any]:
    first = small.contacts[0]
    speed = 0.1
    if response is not None and response.statistics.count:
        speed = response.statistics.mean_approach_speed
    achieved = achieved_restitution(first, method, speed)
    result: dict[str, Any] = {
        "law": first.law.name,
        "stiffness": first.parameters.stiffness,
        "damping": first.parameters.damping,
        "contact_time": first.parameters.contact_time,
        "effective_mass": first.effective_mass,
        "total_clearance": sum(first.gaps),
        "achieved_restitution": {"mean": achieved.mean, "lowest": achieved.lowest, "highest": achieved.highest},
    }
    if response is not None:
        statistics = response.statistics
        result |= {
            "peak_force": statistics.peak_force,
            "mean_impulse": statistics.mean_impulse,
            "cycle_mean_force": statistics.cycle_mean_force,
            "mean_approach_speed": statistics.mean_approach_speed,
        }
    return result


def _versions() -> dict[str, str]:
    names = ("femimpact", "numpy", "scipy", "scikit-fem", "numba", "xarray", "pyvista", "meshio")
    return {"python": platform.python_version(), **{name: importlib.metadata.version(name) for name in names}}


# ---- writing --------------------------------------------------------------------------------------


def run_study(
    study: Study,
    directory: str | Path,
    *,
    parts: tuple[str, ...] = ("modes", "simulate", "sweep"),
    force: bool = False,
    report: Report = _silent,
) -> StudyResults:
    """Run what the study asks for and write its results into a directory.

    Parameters
    ----------
    study : Study
    directory : str or Path
        Must not exist or be empty, unless forced.
    parts : tuple of str
        Any of "modes", "simulate", "sweep"; a study without [sweep] skips it.
    force : bool
    report : callable, optional

    Returns
    -------
    StudyResults
        As read back from the directory.
    """
    # all that can be wrong is found before the first long step and before anything is written
    _, small, method = build(study)
    check_step(small, method)
    with prepare_directory(directory, force) as folder:
        modes = run_modes(study) if "modes" in parts else None
        response = run_simulation(study, report) if "simulate" in parts else None
        sweeps = run_sweep(study, report) if "sweep" in parts and study.sweep is not None else None
        write_results(study, folder, modes, response, sweeps, report)
    return load(directory)


def write_results(
    study: Study,
    folder: Path,
    modes: tuple[System, Modes, Modes | None] | None,
    response: Response | None,
    sweeps: SweepPair | None,
    report: Report = _silent,
) -> None:
    """Write every table, figure and scene of what was run; the summary comes last."""
    (folder / FILES["study"]).write_text(study.text, encoding="utf-8")
    if modes is not None:
        _write_modes(study, folder, *modes)
    if sweeps is not None:
        _write_sweeps(study, folder, sweeps)
    if response is not None:
        _write_history(study, folder, response, report)
    tables.write_json(folder / FILES["summary"], summary_of(study, modes, response, sweeps))


def _write_modes(study: Study, folder: Path, full: System, modes: Modes, glued: Modes | None) -> None:
    columns: dict[str, Any] = {
        "mode": list(range(1, modes.natural_frequency.size + 1)),
        "natural_frequency": modes.natural_frequency,
        "damping_ratio": modes.damping_ratio,
        "participation_factor": modes.participation_factor,
        "effective_mass": modes.effective_mass,
    }
    units = {"natural_frequency": "Hz", "damping_ratio": "1", "participation_factor": "kg^0.5", "effective_mass": "kg"}
    if glued is not None:
        columns["natural_frequency_glued"], units["natural_frequency_glued"] = glued.natural_frequency, "Hz"
    tables.write_csv(folder / FILES["modes"], columns, units)
    if study.output.figures:
        figures.save_figure(figures.mode_shape_figure(full, modes), folder / FILES["mode_figure"])
    if study.output.paraview:
        from femimpact.export import vtk

        vtk.write_modes(folder / FILES["modes_scene"], full, modes, study.structure)


def _write_sweeps(study: Study, folder: Path, sweeps: SweepPair) -> None:
    import xarray

    curves = {"empty": sweeps.empty, **({"ball": sweeps.ball} if sweeps.ball is not None else {})}
    frequency = sweeps.empty.frequency
    columns: dict[str, Any] = {"frequency": frequency}
    units = {"frequency": "Hz"}
    on_grid = np.isclose(frequency[:, None], sweeps.coarse[None, :], atol=1e-9).any(axis=1)
    columns["grid"] = np.where(on_grid, "even", "refined")
    for label, curve in curves.items():
        for name in (*SWEEP_UNITS, "steadiness"):
            if label == "empty" and name not in (
                "peak",
                "rms",
                "first_harmonic",
                "phase",
                "energy_residual",
                "steadiness",
            ):
                continue
            columns[f"{label}_{name}"] = getattr(curve, name)
            units[f"{label}_{name}"] = SWEEP_UNITS.get(name, "")
    tables.write_csv(folder / FILES["sweep"], columns, units)
    data = xarray.concat(
        [curve.to_xarray() for curve in curves.values()],
        xarray.Variable("case", list(curves)),
        combine_attrs="override",
    )
    data = data.assign_coords(grid=("frequency", columns["grid"]))
    laws = "; ".join(f"{label}: {curve.law}" for label, curve in curves.items())
    tables.write_netcdf(folder / FILES["sweep_data"], data.assign_attrs(contact_law=laws))
    if study.output.figures:
        balls = [("with ball", sweeps.ball)] if sweeps.ball is not None else []
        figure = figures.response_figure(sweeps.empty, balls, coarse=sweeps.coarse)
        figures.save_figure(figure, folder / FILES["response_figure"])


def _write_history(study: Study, folder: Path, response: Response, report: Report) -> None:
    tables.write_netcdf(folder / FILES["history"], response.to_xarray())
    impacts = {name: getattr(response.impacts, name) for name in IMPACT_UNITS}
    tables.write_csv(folder / FILES["impacts"], impacts, IMPACT_UNITS)
    output = study.output
    if output.figures and response.system.contacts:
        figures.save_figure(figures.contact_force_figure(response), folder / FILES["force_figure"])
        figures.save_figure(figures.phase_portrait_figure(response), folder / FILES["portrait_figure"])
    if response.snapshots is None:
        return
    if output.paraview:
        from femimpact.export import vtk

        exaggeration = output.exaggeration or 1.0
        vtk.write_deflection(folder / FILES["deflection_scene"], response, study.structure, exaggeration)
    if output.movie:
        from femimpact.export import movie

        report("movie", 0.0)
        movie.write_movie(folder / FILES["movie"], response, study.structure, exaggeration=output.exaggeration)
        report("movie", 1.0)
