"""The machine-readable summary of what a study found: plain numbers in Hz, m, N, N s and 1."""

from __future__ import annotations

import importlib.metadata
import math
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact import core
from femimpact.app.study.prepared import PreparedStudy, finer_grid_words, in_study_words, root_stress_notes
from femimpact.excitation import Drives
from femimpact.excitation.excitation import has_cycle, is_force
from femimpact.fem.assembly import unusual_words
from femimpact.integrators.methods import Method
from femimpact.response.resolution import UNRESOLVED, PeakResolution, peak_resolution
from femimpact.response.response import Response
from femimpact.signals.bandwidth import DampingEstimate, amplitude_ratio_damping, half_power
from femimpact.signals.one_pole import fit_one_pole
from femimpact.sweep import FrequencyResponse, on_grid
from femimpact.sweep.curve import TAKE_STARTS
from femimpact.system.contact_pair import ContactPair
from femimpact.system.modes import Modes, first_elastic_frequency
from femimpact.units import at_place, decimal_place, number_text, prefixed

RESTITUTION_MISSED = 0.1
"""Difference between a law's restitution and the median seen in a run that is warned of."""


@dataclass(frozen=True, eq=False)
class SweepPair:
    """The sweep of a study without and with its balls, on one grid of frequencies."""

    empty: FrequencyResponse
    ball: FrequencyResponse | None  # none where the study has no impactor
    coarse: NDArray[np.float64]  # Hz: the even grid of the study; the other frequencies refine it


@dataclass(frozen=True)
class Spread:
    """One quantity of a chaotic motion over several starts."""

    median: float
    lowest: float
    highest: float
    resolution: float = 0.0  # what one start's value is exact to, as the step of a grid; 0 where it is rounding

    def text(self, scale: float = 1.0) -> str:
        """Median and range in words, to two digits of half the range, of at most four that are significant.

        What is exact to the step of a grid has no more digits than the step. The range is rounded outwards, after a
        quarter of it at each end for the starts that were not run.
        """
        low, middle, high, step = (scale * x for x in (self.lowest, self.median, self.highest, self.resolution))
        largest = max(abs(low), abs(middle), abs(high))
        if not 0.0 < largest < math.inf:
            return number_text(middle)
        beyond = step + (high - low) / 4.0
        place = max(decimal_place((high - low) / 2.0) - 1, decimal_place(step), decimal_place(largest + beyond) - 3)
        unit = 10.0**place
        down, up = math.floor((low - beyond) / unit + 1e-6), math.ceil((high + beyond) / unit - 1e-6)
        if low >= 0.0:
            down = max(down, 0)
        # a median far below the largest value keeps two digits
        of_middle = min(place, decimal_place(middle) - 1) if middle else place
        return f"{at_place(middle, of_middle)} ({at_place(down * unit, place)} to {at_place(up * unit, place)})"

    def in_unit_that_fits(self, unit: str) -> tuple[str, str]:
        """The same words, and the unit with the prefix in which they are; a ratio may be in %."""
        factor, shown = (100.0, "%") if unit == "%" else prefixed(max(abs(self.lowest), abs(self.highest)), unit)
        return self.text(factor), shown


def spread_text(spread: Spread, unit: str) -> str:
    """Median and range in words, with the unit that fits."""
    text, shown = spread.in_unit_that_fits(unit)
    return text if shown == "1" else f"{text} {shown}"


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


def _curve_summary(curve: FrequencyResponse, coarse: NDArray[np.float64], prepared: PreparedStudy) -> dict[str, Any]:
    even = on_grid(curve.frequency, coarse)
    fit, half = _estimates(curve)
    resolution = _resolution(curve, fit)
    grid = (curve.frequency[even], curve.peak[even])
    coarse_fit, coarse_half = (fit, half) if math.isnan(fit.ratio) else (fit_one_pole(*grid), half_power(*grid))
    return {
        "peak_frequency": curve.peak_frequency,
        "peak_amplitude": curve.peak_amplitude,
        "peak_is_one_start": curve.peak_is_sample,
        "peak_is_transient": curve.peak_is_transient,
        "peak_too_low_at_most": resolution.largest_miss if resolution else math.nan,
        "resolved": resolution.resolved if resolution else None,
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
        "warnings": _curve_warnings(curve, fit, half, prepared),
        "coarse_warnings": _estimate_warnings(coarse_fit, coarse_half),
    }


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


def summary_of(
    prepared: PreparedStudy,
    modes: tuple[Modes, Modes | None] | None = None,
    response: Response | None = None,
    sweeps: SweepPair | None = None,
) -> dict[str, Any]:
    """Machine-readable summary: plain numbers in Hz, m, N, N s and 1."""
    study, small, method = prepared.study, prepared.small, prepared.method
    # the page of results has what was said when the beam was assembled
    unusual = unusual_words(study.structure, first_elastic_frequency(prepared.full))
    warnings = [*unusual, *prepared.warnings]
    summary: dict[str, Any] = {
        "study": str(study.path.name),
        "versions": library_versions(),
        "core": core.build_info(),
        "method": str(study.method.get("name", "newmark")),
        "step": getattr(method, "dt", math.nan),
        "carried": prepared.carried,
    }
    if modes is not None:
        empty, glued = modes
        summary["natural_frequency"] = {"empty": empty.natural_frequency}
        summary["damping_ratio"] = empty.damping_ratio
        if glued is not None:
            summary["natural_frequency"]["glued"] = glued.natural_frequency
    pairs = [pair for pair in small.contacts if pair.has_walls]
    if pairs:
        contacts = {pair.name: _contact_summary(pair, method, response) for pair in pairs}
        first, *others = contacts
        summary["restitution"] = contacts[first]["restitution"]
        summary["contact"] = {"name": first, **contacts[first]}
        if others:
            summary["further_contacts"] = {name: contacts[name] for name in others}
        warnings += _restitution_warnings(contacts)
    if sweeps is not None:
        summary["sweep"] = {"empty": _curve_summary(sweeps.empty, sweeps.coarse, prepared)}
        warnings += [f"sweep without {prepared.carried}: {text}" for text in summary["sweep"]["empty"]["warnings"]]
        if sweeps.ball is not None:
            summary["sweep"]["ball"] = _curve_summary(sweeps.ball, sweeps.coarse, prepared)
            ratio = sweeps.empty.peak_amplitude / sweeps.ball.peak_amplitude
            by_ratio = amplitude_ratio_damping(
                sweeps.empty.damping, sweeps.empty.peak_amplitude, sweeps.ball.peak_amplitude
            )
            summary["amplitude_ratio"] = ratio
            summary["sweep"]["ball"]["damping_amplitude_ratio"] = by_ratio.ratio
            warnings += [f"sweep with {prepared.carried}: {text}" for text in summary["sweep"]["ball"]["warnings"]]
    if response is not None:
        warnings += [f"history: {in_study_words(text)}" for text in response.warnings]
        summary["history"] = {
            **({"frequency": response.base.frequency} if has_cycle(response.base) else {}),
            "peak": peak_of_history(response),
            **kind_of_peak(response),
            "rms": response.steady.rms[0],
            "steadiness": str(response.steady.steadiness[0]),
            "impacts": len(response.impacts) + response.impacts.dropped,
            "impacts_per_cycle": response.statistics.impacts_per_cycle,
            "regime": asdict(response.regime),
            "channels": channel_summary(response),
        }
        summary["energy_residual"] = response.energy.residual if response.energy is not None else math.nan
        summary |= work_summary(response)
        about_stress = root_stress_notes(prepared.study.structure, prepared.small)
        summary["notes"] = [*map(in_study_words, response.notes), *about_stress]
    elif sweeps is not None:
        summary["energy_residual"] = float(np.nanmax((sweeps.ball or sweeps.empty).energy_residual))
    # a run repeats what is said of its study
    known = prepared.warnings
    parts = ("history", *(f"sweep {word} {prepared.carried}" for word in ("without", "with")))
    repeated = {f"{part}: {text}" for part in parts for text in known}
    summary["warnings"] = [text for text in dict.fromkeys(warnings) if text not in repeated]
    return summary


def work_summary(response: Response) -> dict[str, Any]:
    """Work (J) of all drives and of each of them by its name, at the end of a run; nothing without a ledger."""
    if response.energy is None:
        return {}
    energy = response.energy
    each = {name: float(work[-1]) for name, work in energy.work_of.items()}
    return {"work": float(energy.work[-1]), "work_of": each or {drive_name(response.base): float(energy.work[-1])}}


def drive_name(excitation: Any) -> str:
    """Name of a single drive, as it would have among several."""
    return Drives(forces=(excitation,)).names[0] if is_force(excitation) else "base"


def channel_summary(response: Response) -> dict[str, Any]:
    """Unit of every channel, its largest absolute value and rms over the last third, and the largest of the run.

    The first two are of the samples that the history keeps, but for the largest force of a contact, which is exact; the
    peak of the tip between samples is `peak` of the history. The largest of the run, and its time (s), are those of
    `Response.largest`. The force of a rigid pair that has collided has none of them: its impulses are those of
    `contact_forces`.
    """
    steady = response.time >= response.window[0]
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
        found[name] = {"unit": unit, **(dict.fromkeys(numbers, math.nan) if name in impulsive else numbers)}
    return found


def peak_of_history(response: Response) -> float:
    """Peak (m) of the default place: of the last third, and where the excitation has no cycle of the whole run."""
    if has_cycle(response.base):
        return float(response.steady.peak[0])
    return abs(response.largest(response.system.default_place).value)


def window_of_peaks(history: Mapping[str, Any]) -> str:
    """Words for the part of the run of which the peaks in a history's summary are."""
    return "of the whole run" if history.get("frequency") is None else "over the last third"


def kind_of_peak(response: Response) -> dict[str, bool]:
    """Whether the peak of a motion that does not repeat is one start's value, or holds a transient of the start.

    With impacts in the last third it is the former; without them, where the drive repeats, the latter.
    """
    motion = response.steady
    irregular = bool(has_cycle(response.base) and motion.steadiness[0] != "periodic" and math.isfinite(motion.peak[0]))
    struck = response.statistics.count > 0
    repeats = math.isfinite(response.base.phase)
    return {"peak_is_one_start": irregular and struck, "peak_is_transient": irregular and repeats and not struck}


def contact_forces(response: Response, name: str) -> dict[str, float]:
    """Forces (N) and impulses (N s) of a contact; the peak force without a cycle is that of the whole run.

    The largest impulse is that of the whole run. Where a rigid pair has collided there is no peak force.
    """
    statistics, impulses = response.statistics_of[name], response.impacts.impulse[response.impacts.impactor == name]
    peak = statistics.peak_force
    if not has_cycle(response.base):
        peak = math.nan if _has_struck(response, name) else abs(response.largest(f"{name}.contact_force").value)
    return {
        "peak_force": peak,
        "mean_impulse": statistics.mean_impulse,
        "largest_impulse": float(np.abs(impulses).max(initial=0.0)),
        "cycle_mean_force": statistics.cycle_mean_force,
    }


def _has_struck(response: Response, name: str) -> bool:
    """True if a pair has collided by a rigid law: its impulses have no force, whatever its channel shows."""
    rigid = any(pair.name == name and pair.parameters.is_rigid for pair in response.system.contacts)
    return rigid and name in response.impacts.impactor


def contacts_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of a summary on every contact, by name; none where the study has no contact."""
    first = summary.get("contact")
    return {} if first is None else {first["name"]: first, **summary.get("further_contacts", {})}


def _contact_summary(pair: ContactPair, method: Method, response: Response | None) -> dict[str, Any]:
    """Law, achieved restitution and statistics of one ball; N, N s, m/s and 1."""
    statistics = response.statistics_of[pair.name] if response is not None else None
    speed = statistics.mean_approach_speed if statistics is not None and statistics.count else 0.1
    exact = pair.parameters.restitution
    achieved = {"mean": exact, "lowest": exact, "highest": exact}
    stepped = method.achieved_restitution(pair, speed)
    if stepped is not None:
        achieved = {"mean": stepped.mean, "lowest": stepped.lowest, "highest": stepped.highest}
    result: dict[str, Any] = {
        "law": pair.law.name,
        "restitution": pair.parameters.restitution,
        "stiffness": pair.parameters.stiffness,
        "damping": pair.parameters.damping,
        "contact_time": pair.parameters.contact_time,
        "effective_mass": pair.effective_mass,
        "total_clearance": sum(pair.gaps),
        "achieved_restitution": achieved,
        "achieved_by": "law" if stepped is None else "step",
    }
    if response is not None and statistics is not None:
        mine = response.impacts.impactor == pair.name
        fast = mine & (response.impacts.approach_speed >= 0.2 * statistics.mean_approach_speed)
        result |= {
            "impacts": int(mine.sum()),
            # slow touches, in which the motion of the beam counts as rebound, are left out
            "observed_restitution": float(np.median(response.impacts.restitution[fast])) if fast.any() else math.nan,
            **contact_forces(response, pair.name),
            "mean_approach_speed": statistics.mean_approach_speed,
        }
    return result


def _restitution_warnings(contacts: dict[str, Any]) -> list[str]:
    """Where the beam's higher modes change the rebound that the law was made for."""
    return [
        f"{name}: impacts rebound with {contact['observed_restitution']:.3g} (median) where the law has "
        f"{contact['restitution']:.3g}: the law is made for the first mode's mass, and the beam's other modes take part"
        for name, contact in contacts.items()
        if abs(contact.get("observed_restitution", math.nan) - contact["restitution"]) > RESTITUTION_MISSED
    ]


def library_versions() -> dict[str, str]:
    """Versions of Python, femimpact and the libraries that results hang on."""
    names = ("femimpact", "numpy", "scipy", "scikit-fem", "numba", "xarray", "pyvista", "meshio")
    # an extra may be missing
    known = {name: _version(name) for name in names}
    return {"python": platform.python_version(), **{name: found for name, found in known.items() if found is not None}}


def _version(name: str) -> str | None:
    """Version of a library; None where it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
