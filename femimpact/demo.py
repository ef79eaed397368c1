"""The paper's case from end to end: the restitution by a scan, both starts, the published figures beside ours."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.calibration import RestitutionScan, scan_restitution, with_restitution
from femimpact.errors import Fault, InputError
from femimpact.export import figures, tables
from femimpact.integrators.integrate import integrate
from femimpact.response import Recorder
from femimpact.results import StudyResults, load, prepare_directory
from femimpact.run import (
    Found,
    Report,
    keep_history,
    keep_modes,
    keep_pictures,
    keep_study,
    keep_sweeps,
    run_modes,
    run_simulation,
    run_sweep,
)
from femimpact.study import Study, build, method_for
from femimpact.study_file import load_study
from femimpact.summary import SweepPair, summary_of
from femimpact.sweep import frequency_sweep
from femimpact.system import State, without_impactors

__all__ = ["PUBLISHED", "Demo", "ScanPlan", "paper_study", "paper_study_text", "run_demo"]

PUBLISHED: Mapping[str, float] = {
    "frequency_empty_theory": 5.30,
    "frequency_empty_experiment": 5.05,
    "frequency_ball_theory": 4.98,
    "frequency_ball_experiment": 4.95,
    "damping_empty": 0.0029,
    "damping_ball": 0.014,
    "amplitude_ratio": 5.0,
    "impact_force_theory": 0.02,
}
"""The paper's Table 1 and section 5: Hz, 1 and N."""

STARTS = {"base": "at rest on the base", "space": "at rest in space"}


@dataclass(frozen=True)
class ScanPlan:
    """How the restitution is scanned.

    Parameters
    ----------
    restitutions : tuple of float, 1
    points : int
        Frequencies of each sweep.
    cycles : int
        Dwell at each frequency.
    """

    restitutions: tuple[float, ...] = (
        0.3,
        0.4,
        0.5,
        0.6,
        0.65,
        0.7,
        0.74,
        0.76,
        0.78,
        0.80,
        0.82,
        0.84,
        0.88,
        0.92,
        0.96,
    )
    points: int = 41
    cycles: int = 450


@dataclass(frozen=True, eq=False)
class Demo:
    """Everything the demo found.

    Parameters
    ----------
    results : StudyResults
    comparison : tuple of rows
        (quantity, unit, paper theory, paper experiment, femimpact from rest on the base,
        from rest in space, method).
    scans : mapping of str to RestitutionScan
        By start.
    restitution : float, 1
        The one whose resonance, from rest on the base, is closest to the published one.
    remarks : tuple of str
        Where the paper cannot be met, and why.
    """

    results: StudyResults
    comparison: tuple[tuple[Any, ...], ...]
    scans: Mapping[str, RestitutionScan]
    restitution: float
    remarks: tuple[str, ...]


def paper_study_text() -> str:
    """The commented study file of the paper's case."""
    return files("femimpact").joinpath("paper.toml").read_text(encoding="utf-8")


def paper_study() -> Study:
    """The paper's case as a study."""
    with as_file(files("femimpact").joinpath("paper.toml")) as path:
        return load_study(path)


def free_directory(name: str) -> Path:
    """The name, or the first of name-2, name-3, ... that does not exist."""
    path, number = Path(name), 1
    while path.exists():
        number += 1
        path = Path(f"{name}-{number}")
    return path


def run_demo(
    directory: str | Path, *, force: bool = False, report: Report | None = None, scan: ScanPlan | None = None
) -> Demo:
    """Run the paper's case and write its results.

    Parameters
    ----------
    directory : str or Path
    force : bool
    report : callable, optional
    scan : ScanPlan, optional

    Returns
    -------
    Demo
    """
    report = report or (lambda _what, _share: None)
    study = paper_study()
    with prepare_directory(directory, force) as staging:
        modes = run_modes(study)
        keep_study(staging, study)
        keep_modes(staging, study, Found(modes), ("sweep", "history"))
        scans = scan_both_starts(study, scan or ScanPlan(), report)
        best = scans["base"].best(PUBLISHED["frequency_ball_experiment"], PUBLISHED["amplitude_ratio"])
        restitution = float(scans["base"].restitution[best])
        study = _with(study, restitution)
        keep_study(staging, study)
        sweeps = {start: _sweep_from(study, start, report) for start in STARTS}
        keep_sweeps(staging, study, Found(modes, None, sweeps["base"]), ("history",))
        _write_scans(staging.folder, scans, sweeps)
        study = _at_resonance(study, sweeps["base"])
        keep_study(staging, study)
        found = Found(modes, run_simulation(study, report), sweeps["base"])
        keep_history(staging, study, found)
        summary = summary_of(study, modes, found.response, found.sweeps)
        comparison = compare(summary, sweeps, _other_start(study, sweeps["space"]))
        remarks = remark(scans, sweeps, restitution)
        _write_comparison(staging.folder, comparison)
        more = {"restitution": restitution, "remarks": remarks, "sweep": summary["sweep"]}
        more["sweep"]["ball_from_rest_in_space"] = _sweep_row(sweeps["space"])
        keep_pictures(staging, study, found, report, more)
    return Demo(load(directory), comparison, scans, restitution, remarks)


def _sweep_from(study: Study, start: str, report: Report) -> SweepPair:
    return run_sweep(study, lambda what, share: report(f"{what}, {STARTS[start]}", share), State.at_rest(start))


def _with(study: Study, restitution: float) -> Study:
    text = study.text.replace("restitution = 0.78", f"restitution = {restitution:.2f}")
    return dataclasses.replace(study, structure=with_restitution(study.structure, restitution), text=text)


def _at_resonance(study: Study, sweeps: SweepPair) -> Study:
    """The same study with its history at the resonance with the ball, as the even grid sees it."""
    curve = sweeps.ball or sweeps.empty
    on_grid = np.isin(curve.frequency, np.round(sweeps.coarse, 9))
    peak = float(curve.frequency[on_grid][np.argmax(curve.peak[on_grid])])
    text = study.text.replace("frequency = 4.9 ", f"frequency = {peak:.6g} ")
    return dataclasses.replace(study, base=dataclasses.replace(study.base, frequency=peak), text=text)


def scan_both_starts(study: Study, plan: ScanPlan, report: Report) -> dict[str, RestitutionScan]:
    """One restitution scan from rest on the base, one from rest in space."""
    if study.sweep is None:
        raise InputError([Fault("sweep", None, "", "table [sweep] is missing")])
    _, small, _ = build(study)
    bare = without_impactors(small)
    frequencies = np.linspace(study.sweep.start, study.sweep.stop, plan.points)
    width = small.first_frequency * 0.02
    fine = np.unique(np.concatenate([frequencies, np.linspace(-width, width, 41) + small.first_frequency]))
    empty = frequency_sweep(bare, study.base.amplitude, fine, method_for(study, bare), study.sweep.cycles, ledger=False)

    def scan_from(start: str) -> RestitutionScan:
        return scan_restitution(
            study.structure,
            plan.restitutions,
            empty,
            elements=study.mesh.elements or 0,
            modes=study.reduction.modes if study.reduction else 0,
            frequencies=frequencies,
            cycles=plan.cycles,
            initial=State.at_rest(start),
            progress=lambda share: report(f"restitution scan, {STARTS[start]}", share),
        )

    return {start: scan_from(start) for start in STARTS}


def _other_start(study: Study, sweeps: SweepPair) -> Mapping[str, float]:
    """Impact statistics of a history at the resonance found from rest in space."""
    if sweeps.ball is None:
        return {}
    _, small, method = build(study)
    base = dataclasses.replace(study.sine, frequency=sweeps.ball.peak_frequency)
    record = Recorder(channels=("tip",), every=100, ledger=False)
    response = integrate(small, base, method, study.base.duration, record, State.at_rest("space"))
    return dataclasses.asdict(response.statistics)


def _sweep_row(sweeps: SweepPair) -> dict[str, Any]:
    if sweeps.ball is None:
        return {}
    return {
        "peak_frequency": sweeps.ball.peak_frequency,
        "peak_amplitude": sweeps.ball.peak_amplitude,
        "damping_fit": sweeps.ball.damping.ratio,
        "damping_half_power": sweeps.ball.damping_half_power.ratio,
        "amplitude_ratio": sweeps.empty.peak_amplitude / sweeps.ball.peak_amplitude,
    }


def compare(
    summary: Mapping[str, Any], sweeps: Mapping[str, SweepPair], other: Mapping[str, float]
) -> tuple[tuple[Any, ...], ...]:
    """Rows of the table "paper theory / paper experiment / femimpact"."""
    p, nothing = PUBLISHED, None
    here, empty = _sweep_row(sweeps["base"]), summary["sweep"]["empty"]
    there = _sweep_row(sweeps["space"])
    contact, law = summary["contact"], summary["contact"]["law"]
    glued, natural = summary["natural_frequency"]["glued"][0], summary["natural_frequency"]["empty"][0]
    zeta = empty["damping_fit"]
    coarse = empty["coarse_grid"]["damping_half_power"]
    peak_force = (contact["peak_force"], other.get("peak_force"))
    return (
        ("natural frequency without ball", "Hz", p["frequency_empty_theory"], p["frequency_empty_experiment"],
         natural, natural, "eigenvalue"),
        ("natural frequency, ball glued on", "Hz", p["frequency_ball_theory"], p["frequency_ball_experiment"],
         glued, glued, "eigenvalue"),
        ("peak of the response with ball", "Hz", p["frequency_ball_theory"], p["frequency_ball_experiment"],
         here["peak_frequency"], there["peak_frequency"], "sweep, largest peak"),
        ("damping without ball", "%", 100 * p["damping_empty"], 100 * p["damping_empty"], 100 * zeta, 100 * zeta,
         "one-pole fit, refined grid"),
        ("damping without ball, even grid", "%", nothing, nothing, 100 * coarse, 100 * coarse,
         "half-power on 21 points: not resolved"),
        ("damping with ball", "%", 100 * p["damping_ball"], 100 * p["damping_ball"],
         100 * zeta * here["amplitude_ratio"], 100 * zeta * there["amplitude_ratio"], "amplitude ratio"),
        ("damping with ball", "%", nothing, nothing, 100 * here["damping_fit"], 100 * there["damping_fit"],
         "one-pole fit, refined grid"),
        ("damping with ball", "%", nothing, nothing,
         100 * here["damping_half_power"], 100 * there["damping_half_power"], "half-power, refined grid"),
        ("amplitude ratio without / with", "1", p["amplitude_ratio"], p["amplitude_ratio"], here["amplitude_ratio"],
         there["amplitude_ratio"], "largest peaks"),
        ("impact force", "N", p["impact_force_theory"], nothing, contact["cycle_mean_force"],
         other.get("cycle_mean_force"), "cycle-averaged, at the peak"),
        ("peak force", "N", nothing, nothing, *peak_force, f"{law}, at the peak"),
        ("mean impulse", "mN s", nothing, nothing, 1e3 * contact["mean_impulse"], 1e3 * other.get("mean_impulse", 0.0),
         "at the peak"),
    )  # fmt: skip


def remark(
    scans: Mapping[str, RestitutionScan], sweeps: Mapping[str, SweepPair], restitution: float
) -> tuple[str, ...]:
    """Where the paper cannot be met, and why, with the numbers just found."""
    here, there = _sweep_row(sweeps["base"]), _sweep_row(sweeps["space"])
    near = {}
    for start, scan in scans.items():
        misfit = scan.misfit(PUBLISHED["frequency_ball_experiment"], PUBLISHED["amplitude_ratio"])
        near[start] = ", ".join(f"{e:.2f}" for e in scan.restitution[misfit < 1.5]) or "none of the scan"
    return (
        f"restitution {restitution:.2f} comes closest to the published resonance from rest on the base; "
        f"near it (misfit below 1.5): {near['base']}; from rest in space: {near['space']}",
        f"the start decides the headline: peak at {here['peak_frequency']:.3g} Hz with a ratio of "
        f"{here['amplitude_ratio']:.3g} from rest on the base, at {there['peak_frequency']:.3g} Hz with a ratio of "
        f"{there['amplitude_ratio']:.3g} from rest in space; the paper does not say which it took",
        "the experiment's 5.05 Hz without ball and the theory's 5.30 Hz cannot both be met: the shifts to 4.95 and "
        "4.98 Hz mean mass ratios of 0.041 and 0.133; the model follows the theory's. With the measured one and rigid "
        "impacts a restitution of 0.30 meets the published resonance: examples/rigid_reference_studies.py",
        "the curve with ball is bent and partly chaotic, so its fit and half-power ratios are no damping of a linear "
        "system; only the drop of the peak compares, and 1.4 % is the amplitude ratio times 0.29 %",
        "the paper's 0.02 N is what its eq. 31 leaves over, not a contact force; the cycle-averaged force is near it",
        "21 points 0.1 Hz apart cannot show a half-power width of 0.031 Hz: see the warning of the even grid",
    )


def _write_scans(folder: Path, scans: Mapping[str, RestitutionScan], sweeps: Mapping[str, SweepPair]) -> None:
    names = ("peak_frequency", "peak_amplitude", "amplitude_ratio", "damping_fit", "damping_half_power",
             "damping_amplitude_ratio")  # fmt: skip
    columns: dict[str, Any] = {"restitution": next(iter(scans.values())).restitution}
    for start, scan in scans.items():
        columns |= {f"{start}_{name}": getattr(scan, name) for name in names}
    units = {name: "Hz" if "frequency" in name else "m" if "peak_amplitude" in name else "1" for name in columns}
    tables.write_csv(folder / "restitution.csv", columns, units)
    labelled = [(STARTS[start], scan) for start, scan in scans.items()]
    figure = figures.restitution_figure(labelled, PUBLISHED["frequency_ball_experiment"], PUBLISHED["amplitude_ratio"])
    figures.save_figure(figure, folder / "restitution.png")
    balls = [(f"with ball, {STARTS[start]}", pair.ball) for start, pair in sweeps.items() if pair.ball is not None]
    figure = figures.response_figure(sweeps["base"].empty, balls, coarse=sweeps["base"].coarse)
    figures.save_figure(figure, folder / "response_of_starts.png")


def _write_comparison(folder: Path, comparison: tuple[tuple[Any, ...], ...]) -> None:
    names = (
        "quantity",
        "unit",
        "paper_theory",
        "paper_experiment",
        "from_rest_on_base",
        "from_rest_in_space",
        "method",
    )
    rows = [["" if value is None else value for value in row] for row in comparison]
    tables.write_csv(folder / "comparison.csv", dict(zip(names, zip(*rows, strict=True), strict=True)), {})
