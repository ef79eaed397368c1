"""`calibrate`: values of one or two parameters that explain the measured peaks of a response curve, with intervals.

All cases of a grid are run from several starts. There is no optimiser: where motions coexist the misfit has several
basins, which a grid shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.paths import bounds_of_axis
from femimpact.app.parametric.verb import StudyProgress, parameter_study
from femimpact.app.study.study import Study, sine_of
from femimpact.arrays import Array
from femimpact.errors import column, kind_of, quantity, require, takes, warns
from femimpact.structure.structure import Position
from femimpact.sweep.curve import dwell_warnings
from femimpact.system.system import System
from femimpact.units import unit_text

if TYPE_CHECKING:
    import xarray

FREQUENCY, PEAK = "base.frequency", "peak"

NODES = (13, 9)
"""Values of the first and of the second parameter in the grid of runs."""

FINE = 121
"""Values of each parameter at which the posterior is computed."""

LEVEL = 0.9
"""Probability of the intervals."""

FREEDOM = 4.0
"""Degrees of freedom of Student's t: one start may run into another motion than the median of several."""

INTERPOLATION = 0.03
"""Relative error of the peaks between the cases of the grid."""

AT_BOUND = 0.5
"""Density at a bound over the largest from which the interval reaches it: a bound cuts the tail there."""

STRONG = 0.9
"""Correlation of two parameters from which the peaks determine a combination of them only."""

UNEXPLAINED = 2.0
"""Root mean square of the scaled misfit from which the peaks are not explained."""


@dataclass(frozen=True)
class CalibratedParameter:
    """A parameter that `calibrate` has found.

    Parameters
    ----------
    path, unit : str
        Of the parameter, and the unit of all numbers.
    median, low, high : float
        Of the posterior: its median and the ends of the 90 % interval, which are not numbers where it reaches a bound.
    bound : {"", "lowest", "highest", "both"}
        The bound that the interval reaches.
    """

    path: str
    unit: str
    median: float
    low: float
    high: float
    bound: str

    def __str__(self) -> str:
        low, high = unit_text(self.low, self.unit), unit_text(self.high, self.unit)
        ends = "no interval" if self.bound else f"90 % interval {low} to {high}"
        return f"{self.path}: {unit_text(self.median, self.unit)} ({ends})"


@dataclass(frozen=True, eq=False)
class Calibration:
    """What `calibrate` finds; as a text, some lines for the eye.

    Parameters
    ----------
    parameters : tuple of CalibratedParameter
    correlation : float
        Of the two parameters in the posterior; not a number for one parameter.
    posterior : xarray.DataArray
        Density over the parameters, with the integral 1.
    frequency : ndarray (n,), Hz
    peak : ndarray (n,), m
        Measured.
    fitted, fitted_low, fitted_high : ndarray (n,), m
        Peak at the medians of the parameters: median over the starts, and ends between which 90 % of measured ones lie.
    misfit : float
        Root mean square of the misfit there, over its expected size: about 1 where the peaks are explained.
    start_dependent : ndarray of float, Hz
        Frequencies at which the starts run into two groups of peaks there.
    dataset : xarray.Dataset
        All cases of the grid, as `parameter_study` returns them.
    notes : tuple of str
        What limits the result.
    warnings : tuple of str
        Of dwells that measure what is left of the start.
    """

    parameters: tuple[CalibratedParameter, ...]
    correlation: float
    posterior: xarray.DataArray
    frequency: Array
    peak: Array
    fitted: Array
    fitted_low: Array
    fitted_high: Array
    misfit: float
    start_dependent: Array
    dataset: xarray.Dataset
    notes: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        lines = [str(one) for one in self.parameters]
        if len(lines) == 2:
            lines.append(f"correlation {self.correlation:.2f}")
        lines.append(f"misfit {self.misfit:.2f} of its expected size, {self.frequency.size} peaks")
        return "\n".join([*lines, *self.notes, *self.warnings])


@warns
@takes(
    frequency=column("Hz", "points", finite=True),
    peak=column("m", "points", finite=True),
    noise=quantity("1", above=0.0, at_most=1.0),
    starts=quantity("1", at_least=2, at_most=1000, integer=True),
    cycles=quantity("1", at_least=3, integer=True),
)
def calibrate(
    study: Study | System | Callable[..., Any],
    frequency: ArrayLike,
    peak: ArrayLike,
    parameters: Mapping[str, tuple[float, float]],
    *,
    excitation: Any = None,
    method: Any = None,
    elements: int | None = None,
    modes: int | None = None,
    at: Position | None = None,
    noise: float = 0.02,
    starts: int = 8,
    seed: int = 0,
    cycles: int = 300,
    directory: str | Path | None = None,
    version: str | None = None,
    client: Any = None,
    threads: int | None = None,
    progress: Callable[[StudyProgress], None] | bool | None = None,
) -> Calibration:
    r"""One or two parameters of a damper from the measured peaks of a response curve, with their intervals.

    The cases of a grid of 13 values of the first and 9 of the second parameter are run at all measured frequencies,
    from the same draws of the starts. With m and s the median and the spread of ln(peak) over n starts, the density of
    a measured peak is Student's t with 4 degrees of freedom of

    .. math::

       \frac{\ln p - m}{\sigma}, \qquad \sigma^2 = \Bigl(1 + \frac{\pi}{2 n}\Bigr) \bar s^2 + \mathrm{noise}^2 + 0.03^2,

    where 0.03 stands for the interpolation between the cases, s is the range of the starts over that of n normal
    numbers (Tippett, 1925), and the bar is the mean over neighbouring cases, since the range of few starts scatters.
    The posterior is the product over the peaks; before them all values between the bounds are equally likely.

    Parameters
    ----------
    study : Study, System or function
        As of `parameter_study`.
    frequency : array_like (n,), Hz
        Of the base; equal ones are measurements of their own.
    peak : array_like (n,), m
        Largest relative displacement of the place `at` in the last third of each dwell.
    parameters : mapping of str to (low, high)
        Bounds of one or two parameters by their paths, as "impactor.ball.gap".
    excitation, method, elements, modes, at, version, client, threads, progress
        As of `parameter_study`.
    noise : float, 1
        Standard deviation of the measured peaks over their values.
    starts, seed, cycles : int
        Of each case, and of their draws.
    directory : str or Path, optional
        Where the grid is kept as a study: the same call goes on from there, and other peaks at the same frequencies are
        calibrated without a run.

    Examples
    --------
    >>> import femimpact as fi
    >>> study = fi.load_study("meshes/stepped_cantilever.toml")
    >>> bounds = {"impactor.ball.contact.restitution": (0.3, 0.9)}
    >>> found = fi.calibrate(study, [8.6, 8.8, 9.0], [2e-3, 3e-3, 2e-3], bounds, starts=2, cycles=6)
    >>> found.posterior.sizes
    Frozen({'impactor.ball.contact.restitution': 121})
    """
    if isinstance(study, Study):
        sine_of(study, "calibrate")
    frequencies, peaks = np.asarray(frequency), np.asarray(peak)
    for name, values, unit in (("frequency", frequencies, "Hz"), ("peak", peaks, "m")):
        for i in np.flatnonzero(values <= 0.0).tolist():
            require(False, f"{name}[{i}]", float(values[i]), unit, "must be > 0")
    names = list(parameters) if isinstance(parameters, Mapping) else kind_of(parameters)
    given = isinstance(names, list) and len(names) in (1, 2) and all(isinstance(name, str) for name in names)
    require(given, "parameters", names, "", "must be the bounds of one or two parameters by their paths")
    require(FREQUENCY not in parameters, "parameters", FREQUENCY, "", "must not be named: frequency gives its values")
    bounds = {name: bounds_of_axis(f"parameters.{name}", value) for name, value in parameters.items()}
    least = len(bounds) + 1
    require(frequencies.size >= least, "frequency", f"{frequencies.size} values", "", f"must be {least} or more")
    unique, which = np.unique(frequencies, return_inverse=True)
    axes: dict[str, Any] = {
        name: np.linspace(*ends, nodes).tolist() for (name, ends), nodes in zip(bounds.items(), NODES, strict=False)
    }
    mesh: dict[str, Any] = {
        name: value for name, value in (("elements", elements), ("modes", modes)) if value is not None
    }
    dataset = parameter_study(
        study, axes | {FREQUENCY: unique.tolist()}, [PEAK], starts=starts, seed=seed, cycles=cycles,
        excitation=excitation, method=method, at=at, version=version, directory=directory, client=client,
        threads=threads, progress=progress, **mesh,
    )  # fmt: skip
    found = calibration_of(dataset, list(bounds), frequencies, peaks, np.ravel(which), noise)
    one = {name: values[:1] for name, values in axes.items()} | {FREQUENCY: unique[:1].tolist()}
    plan = ParameterStudy(study, one, [PEAK], excitation=excitation, method=method, at=at, version=version, **mesh)
    begin = (cycles - dataset.attrs["measured_cycles"]) / float(unique[-1])
    return replace(found, warnings=tuple(dwell_warnings(plan.nominal, begin)))


def calibration_of(
    dataset: Any,
    names: Sequence[str],
    frequency: Array,  # (n,) Hz
    peak: Array,  # (n,) m
    which: Any,  # (n,) numbers of the frequencies in the dataset
    noise: float,
) -> Calibration:
    """The posterior of the parameters from the cases of a grid."""
    import xarray
    from scipy.stats import t

    grid = [dataset[name].values for name in names]
    median, scale = _median_and_scale(dataset, names, noise)
    fine = [np.linspace(values[0], values[-1], FINE) for values in grid]
    places = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1)
    width = _between(grid, scale, places)[..., which]
    scaled = (np.log(peak) - _between(grid, median, places)[..., which]) / width
    likelihood = (t.logpdf(scaled, FREEDOM) - np.log(width)).sum(axis=-1)
    known = np.isfinite(likelihood)
    failed, reason = _failures(dataset)
    require(bool(known.any()), "study", f"{failed} cases without a peak", "", f"must have values: {reason}")
    density = np.exp(np.where(known, likelihood - likelihood[known].max(), -math.inf))
    posterior = xarray.DataArray(density, dict(zip(names, fine, strict=True)), tuple(names), "posterior")
    for name in names:
        posterior[name].attrs = dict(dataset[name].attrs)
    posterior = posterior / posterior.integrate(names)
    found = tuple(_parameter(posterior, name) for name in names)
    place = np.array([one.median for one in found])
    centre, width = _between(grid, median, place)[which], _between(grid, scale, place)[which]
    reach = float(t.ppf(0.5 + 0.5 * LEVEL, FREEDOM)) * width
    misfit = (np.log(peak) - centre) / width
    nearest = dataset.sel({one.path: one.median for one in found}, method="nearest")
    apart = dataset[FREQUENCY].values[nearest[f"{PEAK}_groups"].values > 1.5]
    size, worst = float(np.sqrt(np.mean(misfit**2))), float(frequency[np.argmax(np.abs(misfit))])
    correlation = _correlation(posterior) if len(names) == 2 else math.nan
    notes = _notes(found, correlation, size, worst, apart.tolist(), failed, reason)
    return Calibration(
        found, correlation, posterior, frequency, peak, np.exp(centre), np.exp(centre - reach), np.exp(centre + reach),
        size, apart, dataset, notes,
    )  # fmt: skip


def _median_and_scale(dataset: Any, names: Sequence[str], noise: float) -> tuple[Array, Array]:
    """Of ln(peak) at the cases of the grid (parameters..., frequencies): median over the starts, and scale sigma."""
    from scipy.ndimage import gaussian_filter1d
    from scipy.stats import norm

    dims, starts = (*names, FREQUENCY), int(dataset.attrs["starts"])
    low, middle, high = (np.log(dataset[f"{PEAK}{end}"].transpose(*dims).values) for end in ("_low", "", "_high"))
    # mean range of so many normal numbers of standard deviation 1
    ends = np.linspace(-9.0, 9.0, 2001)
    below = norm.cdf(ends)
    mean_range = float(np.trapezoid(1.0 - below**starts - (1.0 - below) ** starts, ends))
    variance = ((high - low) / mean_range) ** 2
    for axis in range(len(names)):
        variance = gaussian_filter1d(variance, 1.0, axis=axis, mode="nearest")
    return middle, np.sqrt((1.0 + 0.5 * math.pi / starts) * variance + noise**2 + INTERPOLATION**2)


def _between(grid: Sequence[Array], values: Array, places: Array) -> Array:
    """Values (..., frequencies) between the cases of the grid, linear in each parameter."""
    from scipy.interpolate import RegularGridInterpolator

    return np.asarray(RegularGridInterpolator(tuple(grid), values)(places.reshape(-1, len(grid)))).reshape(
        *places.shape[:-1], values.shape[-1]
    )


def _failures(dataset: Any) -> tuple[int, str]:
    """Number of cases without a peak, and why the first has none."""
    missing = ~np.isfinite(dataset[PEAK].values)
    reasons = dataset["failure"].values[missing]
    return int(np.count_nonzero(missing)), str(reasons[0]) if reasons.size else ""


def _parameter(posterior: Any, name: str) -> CalibratedParameter:
    """Median and interval of a parameter from its marginal density."""
    from scipy.integrate import cumulative_trapezoid

    density = posterior.integrate([other for other in posterior.dims if other != name])
    values = density[name].values
    share = cumulative_trapezoid(density.values, values, initial=0)
    low, median, high = np.interp((0.5 - 0.5 * LEVEL, 0.5, 0.5 + 0.5 * LEVEL), share / share[-1], values).tolist()
    lowest, highest = (bool(density.values[end] > AT_BOUND * density.values.max()) for end in (0, -1))
    bound = "both" if lowest and highest else "lowest" if lowest else "highest" if highest else ""
    if bound:
        low = high = math.nan
    return CalibratedParameter(name, str(density[name].attrs.get("units", "")), median, low, high, bound)


def _correlation(posterior: Any) -> float:
    """Correlation of the two parameters of a density."""
    names = list(posterior.dims)
    off = [posterior[name] - (posterior[name] * posterior).integrate(names) for name in names]
    first, both, second = (float((off[i] * off[j] * posterior).integrate(names)) for i, j in ((0, 0), (0, 1), (1, 1)))
    return both / math.sqrt(first * second)


def _notes(
    found: Sequence[CalibratedParameter], correlation: float, size: float, worst: float, apart: Sequence[float],
    failed: int, reason: str,
) -> tuple[str, ...]:  # fmt: skip
    """What limits the result, in words."""
    notes = [
        f"{one.path}: no interval, it reaches {'both bounds' if one.bound == 'both' else f'the {one.bound} bound'}; "
        "widen the bounds, or measure at more frequencies"
        for one in found
        if one.bound
    ]
    if abs(correlation) > STRONG:
        notes.append(
            f"the parameters are correlated by {correlation:.2f}: the peaks determine a combination of them; "
            "measure at another level too"
        )
    if size > UNEXPLAINED:
        notes.append(
            f"no value between the bounds explains the peaks: the misfit is {size:.1f} times its expected size, "
            f"and largest at {worst:.4g} Hz"
        )
    if apart:
        listed = ", ".join(f"{one:.4g}" for one in apart)
        notes.append(f"at {listed} Hz the starts run into two groups of peaks: measure there from several starts")
    if failed:
        notes.append(f"{failed} cases have no peak ({reason}); parameters beside them are left out")
    return tuple(notes)
