"""The machine-readable summary of what a study found: plain numbers in Hz, m, N, N s and 1."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact import __version__, core
from femimpact.app.study.findings import (
    AchievedRestitution,
    ChannelSummary,
    CoarseDamping,
    ContactSummary,
    CurveSummary,
    Findings,
    HistorySummary,
    Spread,
)
from femimpact.app.study.prepared import (
    ROOT_STRESS,
    PreparedStudy,
    finer_grid_words,
    in_study_words,
    root_stress,
    root_stress_notes,
)
from femimpact.app.study.study import Study
from femimpact.excitation.drives import Drives
from femimpact.excitation.excitation import has_cycle, is_force
from femimpact.excitation.random_base import RandomBase
from femimpact.fem.assembly import unusual_words
from femimpact.integrators.methods import Method
from femimpact.response.cycles import UNRESOLVED, PeakResolution, peak_resolution
from femimpact.response.impacts import observed_restitution
from femimpact.response.regimes import FREE_DECAY
from femimpact.response.response import Response
from femimpact.signals.one_pole import DampingEstimate, amplitude_ratio_damping, fit_one_pole, half_power
from femimpact.signals.transfer import transfer_function
from femimpact.sweep.curve import TAKE_STARTS, FrequencyResponse, on_grid
from femimpact.system.contact_pair import ContactPair
from femimpact.system.modes import Modes
from femimpact.system.system import System
from femimpact.versions import ABSENT, version_of


@dataclass(frozen=True, eq=False)
class SweepPair:
    """The sweep of a study without and with its balls, on one grid of frequencies."""

    empty: FrequencyResponse
    ball: FrequencyResponse | None  # none where the study has no impactor
    coarse: NDArray[np.float64]  # Hz: the even grid of the study; the other frequencies refine it


def spread_of(
    values: ArrayLike,  # (n,)
    resolution: float = 0.0,
) -> Spread:
    """Median and range of values that are finite."""
    array = np.asarray(values, dtype=float)
    return Spread(float(np.median(array)), float(array.min()), float(array.max()), float(resolution))


def _estimates(curve: FrequencyResponse) -> tuple[DampingEstimate, DampingEstimate]:
    """One-pole fit and half-power of a curve; none where the motion around its peak does not repeat."""
    around = curve.peak >= curve.peak_amplitude / math.sqrt(2.0)
    irregular = (curve.steadiness != "periodic") & (curve.impacts_per_cycle > 0.0)
    if not np.any(irregular & around):
        return curve.damping, curve.damping_half_power
    why = "the motion around the peak does not repeat: no damping can be read from its width"
    none = DampingEstimate(math.nan, math.nan, (math.nan, math.nan), "none", (why,))
    return none, none


def _resolution(curve: FrequencyResponse, fit: DampingEstimate) -> PeakResolution | None:
    """How well a curve's frequencies resolve its resonance; None where it shows none."""
    if math.isnan(fit.ratio) or fit.ratio == 0.0:
        return None
    return peak_resolution(np.unique(curve.frequency), fit.frequency, 2.0 * fit.ratio * fit.frequency)


def _curve_summary(
    curve: FrequencyResponse,
    coarse: NDArray[np.float64],
    prepared: PreparedStudy,
    empty: FrequencyResponse | None = None,
) -> CurveSummary:
    """The summary of a curve; beside that of the empty structure with the damping by the drop of the peak."""
    even = on_grid(curve.frequency, coarse)
    fit, half = _estimates(curve)
    resolution = _resolution(curve, fit)
    grid = (curve.frequency[even], curve.peak_at_one_level[even])
    coarse_fit, coarse_half = (fit, half) if math.isnan(fit.ratio) else (fit_one_pole(*grid), half_power(*grid))
    peaks = () if empty is None else (empty.damping, empty.peak_amplitude, curve.peak_amplitude)
    linear = empty is None and not prepared.bare.contacts
    return CurveSummary(
        peak_frequency=curve.peak_frequency,
        peak_amplitude=curve.peak_amplitude,
        peak_is_one_start=curve.peak_is_sample,
        peak_is_transient=curve.peak_is_transient,
        peak_too_low_at_most=resolution.largest_miss if resolution else math.nan,
        resolved=resolution.resolved if resolution else None,
        damping_fit=fit.ratio,
        damping_fit_interval=fit.interval,
        damping_fit_frequency=fit.frequency,
        damping_half_power=half.ratio,
        damping_half_power_interval=half.interval,
        coarse_grid=CoarseDamping(coarse_fit.ratio, coarse_half.ratio),
        start=curve.start,
        cycles=curve.cycles,
        largest_energy_residual=float(np.nanmax(curve.energy_residual)),
        steadiness={str(k): int(n) for k, n in zip(*np.unique(curve.steadiness, return_counts=True), strict=True)},
        warnings=tuple(_curve_warnings(curve, fit, half, prepared)),
        coarse_warnings=tuple(_estimate_warnings(coarse_fit, coarse_half)),
        damping_amplitude_ratio=amplitude_ratio_damping(*peaks).ratio if peaks else None,
        root_stress=steady_root_stress(prepared, curve.peak_frequency, curve.peak_amplitude) if linear else None,
    )


def steady_root_stress(prepared: PreparedStudy, frequency: float, peak: float | None = None) -> float | None:
    """Largest stress (Pa) at the root in the steady motion without what the structure carries, on a sine of the base.

    With a peak (m) of the default place, the stress in a motion as large. None where what is left is not linear.
    """
    study, bare = prepared.study, prepared.bare
    if bare.contacts or study.kind != "sine" or not (math.isfinite(frequency) and root_stress(study.structure, bare)):
        return None
    place = bare.default_place
    steady = transfer_function(bare, (frequency,), to=(place, ROOT_STRESS), of="base.displacement")
    size, motion = (abs(complex(steady[name][0])) for name in (ROOT_STRESS, place))
    return size * (study.sine.amplitude if peak is None else peak / motion)


def _curve_warnings(
    curve: FrequencyResponse, fit: DampingEstimate, half: DampingEstimate, prepared: PreparedStudy
) -> list[str]:
    """Warnings of a curve and its damping: that the grid is too coarse once, with the key that makes it finer."""
    texts = list(dict.fromkeys([*curve.warnings, *_estimate_warnings(fit, half)]))
    coarse = [text for text in texts if UNRESOLVED in text]
    plan, resolution = prepared.study.sweep, _resolution(curve, fit)
    if plan is not None and plan.starts > 1:
        taken = "this curve is that of one start: read the medians and ranges over the starts"
        texts = [text.replace(TAKE_STARTS, taken) for text in texts]
    if coarse and resolution is not None and plan is not None:
        key = finer_grid_words(plan, prepared.bare, resolution)
        texts = [text for text in texts if text not in coarse]
        texts.append(f"{coarse[0]} ({key}); the amplitude ratio and the damping by half-power are as inexact")
    return texts


def _estimate_warnings(fit: DampingEstimate, half: DampingEstimate) -> list[str]:
    if fit is half:
        return list(fit.warnings)
    return [*(f"fit: {text}" for text in fit.warnings), *(f"half-power: {text}" for text in half.warnings)]


def findings_of_study(study: Study, system: System, method: Method) -> Findings:
    """What is known of results before the work: the study, its method, and by which versions they are made."""
    return Findings(
        study=str(study.path.name),
        versions=library_versions(),
        core=core.build_info(),
        method=str(study.method.get("name", "newmark")),
        step=getattr(method, "dt", math.nan),
        points=dict(system.points) if study.mesh.file else {},
        seeds=(f"{study.base.seed} of the motion of the base",) if isinstance(study.base, RandomBase) else (),
    )


def findings_of(prepared: PreparedStudy) -> Findings:
    """The same of a study that is ready, with its contacts and what was said when it was made ready."""
    study, contacts = prepared.study, _contacts(prepared)
    return replace(
        findings_of_study(study, prepared.full, prepared.method),
        carried=prepared.carried,
        place=prepared.small.default_place,
        restitution=next((contact.restitution for contact in contacts.values()), None),
        **_named(contacts),
        # the page of results has what was said when the beam was assembled
        warnings=(*unusual_words(study.structure, prepared.full), *prepared.warnings),
    )


def findings_of_modes(
    modes: tuple[Modes, Modes | None],  # without balls, and with every ball glued on
) -> Findings:
    """Natural frequencies and damping ratios."""
    of_case = {name: one for name, one in zip(("empty", "glued"), modes, strict=True) if one is not None}
    frequencies = {name: tuple(one.natural_frequency.tolist()) for name, one in of_case.items()}
    return Findings(natural_frequency=frequencies, damping_ratio=tuple(modes[0].damping_ratio.tolist()))


def findings_of_sweeps(prepared: PreparedStudy, sweeps: SweepPair) -> Findings:
    """Both curves, and how they compare."""
    curves = {"empty": _curve_summary(sweeps.empty, sweeps.coarse, prepared)}
    ratio = None
    if sweeps.ball is not None:
        curves["ball"] = _curve_summary(sweeps.ball, sweeps.coarse, prepared, sweeps.empty)
        ratio = sweeps.empty.peak_amplitude / sweeps.ball.peak_amplitude
    said = list[str]()
    for word, curve in zip(("without", "with"), curves.values(), strict=False):
        said += _new_words(f"sweep {word} {prepared.carried}", curve.warnings, prepared)
    residual = float(np.nanmax((sweeps.ball or sweeps.empty).energy_residual))
    return Findings(sweep=curves, amplitude_ratio=ratio, energy_residual=residual, warnings=tuple(said))


def findings_of_history(prepared: PreparedStudy, response: Response, bare: Response | None = None) -> Findings:
    """The history, its contacts and its energy; the same without what the structure carries, where it was run."""
    contacts = _contacts(prepared, response)
    said = _new_words("history", map(in_study_words, response.warnings), prepared)
    history = _history_summary(response)
    if bare is None and prepared.small.contacts and history.frequency is not None:
        history = replace(history, root_stress_without=steady_root_stress(prepared, history.frequency))
    return Findings(
        history=history,
        history_without=None if bare is None else _history_summary(bare),
        **_named(contacts),
        energy_residual=response.energy.residual if response.energy is not None else math.nan,
        notes=(*map(in_study_words, response.notes), *root_stress_notes(prepared.study.structure, prepared.small)),
        warnings=tuple(said),
        **_work(response),
    )


def _new_words(part: str, texts: Iterable[str], prepared: PreparedStudy) -> list[str]:
    """Warnings of a part, without those that repeat what is said of its study."""
    return [f"{part}: {text}" for text in texts if text not in prepared.warnings]


def _contacts(prepared: PreparedStudy, response: Response | None = None) -> dict[str, ContactSummary]:
    pairs = (pair for pair in prepared.small.contacts if pair.has_walls)
    return {pair.name: _contact_summary(pair, prepared.method, response) for pair in pairs}


def _named(contacts: dict[str, ContactSummary]) -> dict[str, Any]:
    """The fields of the first contact and of the others."""
    first = next(iter(contacts), None)
    if first is None:
        return {}
    others = {name: contact for name, contact in contacts.items() if name != first}
    return {"contact": replace(contacts[first], name=first), "further_contacts": others}


def _history_summary(response: Response) -> HistorySummary:
    return HistorySummary(
        peak=peak_of_history(response),
        **kind_of_peak(response),
        rms=rms_of_history(response),
        steadiness=str(response.steady.steadiness[0]),
        impacts=len(response.impacts) + response.impacts.dropped,
        impacts_per_cycle=response.statistics.impacts_per_cycle,
        regime=response.regime,
        channels=channel_summary(response),
        frequency=response.base.frequency if has_cycle(response.base) else None,
    )


def _work(response: Response) -> dict[str, Any]:
    """Work (J) of all drives and of each of them by its name, at the end of a run; nothing without a ledger."""
    if response.energy is None:
        return {}
    energy = response.energy
    each = {name: float(work[-1]) for name, work in energy.work_of.items()}
    # a single drive has the name that it would have among several
    name = Drives(forces=(response.base,)).names[0] if is_force(response.base) else "base"
    return {"work": float(energy.work[-1]), "work_of": each or {name: float(energy.work[-1])}}


def channel_summary(response: Response) -> dict[str, ChannelSummary]:
    """Unit of every channel, its largest absolute value and rms over the last third, and the largest of the run.

    Where the excitation has no cycle the first two are of the whole run. They are of the samples that the history
    keeps, but for the largest force of a contact, which is exact; the peak of the tip between samples is `peak` of the
    history. The largest of the run, and its time (s), are those of `Response.largest`. The force of a rigid pair that
    has collided has none of them: its impulses are those of `contact_forces`.
    """
    steady = response.time >= (response.window[0] if has_cycle(response.base) else response.start)
    found = {}
    rigid = {pair.name for pair in response.system.contacts if _has_struck(response, pair.name)}
    impulsive = {f"{name}.contact_force" for name in rigid} | ({"contact_force"} if rigid else set())
    peaks = {f"{name}.contact_force": one.peak_force for name, one in response.statistics_of.items()}
    for (name, unit), largest in zip(response.units.items(), response.largest_of(tuple(response.units)), strict=True):
        size = np.abs(response[name])
        numbers = {
            # a contact lasts less than readings are apart
            "largest": max(float(np.max(size[steady])), peaks.get(name, 0.0)),
            "rms": float(np.sqrt(np.mean(size[steady] ** 2))),
            "largest_of_run": abs(largest.value),
            "time_of_largest": largest.time,
        }
        found[name] = ChannelSummary(unit, **(dict.fromkeys(numbers, math.nan) if name in impulsive else numbers))
    return found


def peak_of_history(response: Response) -> float:
    """Peak (m) of the default place: of the last third, and where the excitation has no cycle of the whole run."""
    if has_cycle(response.base):
        return float(response.steady.peak[0])
    return abs(response.largest(response.system.default_place).value)


def rms_of_history(response: Response) -> float:
    """Rms (m) of the default place over the same time as `peak_of_history`; not a number where it was not kept."""
    if has_cycle(response.base):
        return float(response.steady.rms[0])
    kept = response.channels.get(response.system.default_place)
    return float(np.sqrt(np.mean(kept**2))) if kept is not None and kept.size else math.nan


def kind_of_peak(response: Response) -> dict[str, bool]:
    """Whether the peak of a motion that does not repeat is one start's value, or holds a transient of the start.

    With impacts in the last third it is the former; without them, where the drive repeats, the latter. Of a driven run
    without a cycle it is the former once a ball has struck.
    """
    motion = response.steady
    if not has_cycle(response.base):
        struck = len(response.impacts) + response.impacts.dropped > 0 and bool(response.system.balls)
        return {"peak_is_one_start": struck and response.regime.label != FREE_DECAY, "peak_is_transient": False}
    irregular = bool(motion.steadiness[0] != "periodic" and math.isfinite(motion.peak[0]))
    struck = response.statistics.count > 0
    repeats = math.isfinite(response.base.phase)
    return {"peak_is_one_start": irregular and struck, "peak_is_transient": irregular and repeats and not struck}


def contact_forces(response: Response, name: str) -> dict[str, float]:
    """Forces (N) and impulses (N s) of a contact; without a cycle peak force and mean impulse are of the whole run.

    The largest impulse is that of the whole run. Where a rigid pair has collided there is no peak force.
    """
    statistics, impulses = response.statistics_of[name], response.impacts.impulse[response.impacts.impactor == name]
    peak, mean = statistics.peak_force, statistics.mean_impulse
    if not has_cycle(response.base):
        mean = float(np.abs(impulses).mean()) if impulses.size else 0.0
        peak = math.nan if _has_struck(response, name) else abs(response.largest(f"{name}.contact_force").value)
    return {
        "peak_force": peak,
        "mean_impulse": mean,
        "largest_impulse": float(np.abs(impulses).max(initial=0.0)),
        "cycle_mean_force": statistics.cycle_mean_force,
    }


def _has_struck(response: Response, name: str) -> bool:
    """True if a pair has collided by a rigid law: its impulses have no force, whatever its channel shows."""
    rigid = any(pair.name == name and pair.parameters.is_rigid for pair in response.system.contacts)
    return rigid and name in response.impacts.impactor


def _contact_summary(pair: ContactPair, method: Method, response: Response | None) -> ContactSummary:
    """Law, achieved restitution and statistics of one ball; N, N s, m/s and 1."""
    statistics = response.statistics_of[pair.name] if response is not None else None
    speed = statistics.mean_approach_speed if statistics is not None and statistics.count else 0.1
    exact, stepped = pair.parameters.restitution_at(speed), method.achieved_restitution(pair, speed)
    ends = (exact,) * 3 if stepped is None else (stepped.mean, stepped.lowest, stepped.highest)
    law = ContactSummary(
        law=pair.law.name,
        restitution=exact,
        stiffness=pair.parameters.stiffness,
        damping=pair.parameters.damping,
        contact_time=pair.parameters.contact_time,
        effective_mass=pair.effective_mass,
        total_clearance=sum(pair.gaps),
        achieved_restitution=AchievedRestitution(*ends),
        achieved_by="law" if stepped is None else "step",
    )
    if response is None or statistics is None:
        return law
    mine = response.impacts.impactor == pair.name
    forces: Any = contact_forces(response, pair.name)
    return replace(
        law,
        impacts=int(mine.sum()),
        observed_restitution=observed_restitution(response.impacts, pair.name, statistics.mean_approach_speed),
        mean_approach_speed=statistics.mean_approach_speed,
        **forces,
    )


def library_versions() -> dict[str, str]:
    """Versions of Python, femimpact and the libraries that results hang on."""
    names = ("numpy", "scipy", "scikit-fem", "numba", "xarray", "pyvista", "meshio")
    # an extra may be missing
    known = {name: version_of(name) for name in names}
    installed = {name: version for name, version in known.items() if version != ABSENT}
    return {"python": platform.python_version(), "femimpact": __version__, **installed}
