"""Statistics of a motion: what "amplitude" and "steady" mean, the largest value of a run, peaks on a grid."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, checked, column, made, quantity, real_array, require, require_type, text
from femimpact.excitation.excitation import Excitation
from femimpact.response.channels import Channel
from femimpact.table import Head, column_units, head_of_columns, short_repr
from femimpact.units import counted, number_text

PARTS = 8
"""Parts of a window: their scatter tells how far its two halves may differ."""


@dataclass(frozen=True, eq=False)
class CycleStatistics:
    """Extremes and sums of every base cycle of a run, one row a cycle.

    Maximum and minimum are those of the motion w(t) from the cycle's begin to its end, both included, not of
    samples: crests between samples and instants of impact count. `EventDriven` has them to 1e-9 of the peak. The
    step methods take them from the cubic through both ends of a step with their rates, and at a rigid impact from
    the motion before it, so that they are of the order of the method: 2 for smooth motion, where the cubic alone
    has order 4, and 1 after rigid impacts with `MoreauJean`. The sums are over samples.

    Raises `InputError` if the arrays are not all of one shape (cycles, cases).
    """

    maximum: Array = field(metadata=column("m", "cycles", "cases"))  # (cycles, cases) m
    minimum: Array = field(metadata=column("m", "cycles", "cases"))  # (cycles, cases) m
    square: Array = field(metadata=column("m^2", "cycles", "cases"))  # (cycles, cases) m^2: sum of w^2 over the samples
    # (cycles, cases) m: sums of w sin(phase) and w cos(phase), phase being that of the base
    sine: Array = field(metadata=column("m", "cycles", "cases"))
    cosine: Array = field(metadata=column("m", "cycles", "cases"))  # (cycles, cases) m
    samples: Array = field(metadata=column("1", "cycles", "cases"))  # (cycles, cases)

    def __post_init__(self) -> None:
        check_fields(self)


def cycle_statistics(
    values: Array,  # (n,)
    phase: Array,  # (n,) rad: of the base
    first: NDArray[np.integer[Any]],  # (cycles,) sample that each cycle begins with
) -> CycleStatistics:
    """Statistics of the samples of base cycles, of which the extremes are those of samples."""
    sums = (np.add.reduceat(part, first) for part in (values**2, values * np.sin(phase), values * np.cos(phase)))
    extremes = (np.maximum.reduceat(values, first), np.minimum.reduceat(values, first))
    samples = np.diff(np.append(first, values.size)).astype(float)
    return CycleStatistics(*(column[:, None] for column in (*extremes, *sums, samples)))


ROUNDING = 1e-6
"""Share of a cycle: an instant this near to the end of a cycle is at its end."""


def samples_by_cycle(
    time: Array,  # (n,) s: of which the first is the end of the cycle before
    values: Array,  # (n,)
    base: Excitation,
    cycles: int,
) -> CycleStatistics:
    """Statistics of the samples of so many base cycles; those within rounding of an end belong to the nearer cycle."""
    turns = base.frequency * (time[1:] - time[0])
    number = np.clip(np.ceil(turns - ROUNDING).astype(int) - 1, 0, cycles - 1)
    first = np.flatnonzero(np.append(True, np.diff(number) > 0))
    return cycle_statistics(values[1:], 2.0 * np.pi * base.frequency * time[1:] + base.phase, first)


@short_repr
@dataclass(frozen=True, eq=False)
class SteadyMotion:
    """Amplitudes over a window of complete base cycles, and the steadiness of the motion there.

    Parameters
    ----------
    peak : ndarray (cases,), m
        Largest |w| in the window, instants of impact included: of all its cycles' maxima and minima, see
        `CycleStatistics`.
    rms : ndarray (cases,), m
    first_harmonic : ndarray (cases,), m
        Amplitude of the component at the base's frequency.
    phase : ndarray (cases,), rad
        Of that component, relative to the base's displacement.
    steadiness : ndarray (cases,) of str
        "periodic", "statistical" or "transient".
    """

    # every field is a column of a sweep; with words it is a measure of a parameter study, of which small values are
    # better. A field in m has the unit of the observed channel.
    peak: Array = field(
        metadata=column("m", "cases") | {"words": "largest displacement of the observed place relative to the base"}
    )
    rms: Array = field(
        metadata=column("m", "cases") | {"words": "root mean square of the displacement of the observed place"}
    )
    first_harmonic: Array = field(metadata=column("m", "cases") | {"words": "amplitude at the frequency of the base"})
    phase: Array = field(metadata=column("rad", "cases"))
    steadiness: NDArray[np.str_] = field(metadata=column("", "cases", of="text"))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def _head(self) -> Head:
        """Amplitudes by case, the first and the last."""
        columns = {item.name: getattr(self, item.name) for item in fields(self)}
        return head_of_columns(f"SteadyMotion: {counted(self.peak.size, 'case')}", columns, column_units(self))


def steady_motion(
    cycles: CycleStatistics,
    window: NDArray[np.int64],  # (cases,) how many cycles at the end are measured
    periodic_tolerance: float = 1e-3,
    statistical_tolerance: float = 0.05,  # 1
    standard_errors: float = 3.0,  # 1
    longest_period: int = 4,  # cycles
) -> SteadyMotion:
    """Amplitudes and steadiness over the last cycles of a run.

    The motion is "periodic" when the maximum, the minimum and the rms of cycles repeat after 1 to `longest_period`
    cycles within `periodic_tolerance` of the peak: a rigid stop holds one extreme in place, whatever the motion does.
    Where cycles have unlike numbers of samples the rms may differ by one sample's share more. Else it is "statistical"
    when the rms of the window's two halves agree within `statistical_tolerance`, or when their mean squares differ by
    fewer than `standard_errors` of the scatter between the window's eight parts; else "transient".

    Raises `InputError` if an argument is of the wrong kind or out of range.
    """
    require_type(cycles, CycleStatistics, "cycles")
    cases = cycles.samples.shape[1]
    allowed = f"must be whole numbers >= 1, one for each of {cases} cases"
    measured = real_array("window", window, "cycles", allowed)
    sound = measured.shape == (cases,) and bool(np.all((measured >= 1) & (measured % 1 == 0)))
    require(sound, "window", window, "cycles", allowed)
    periodic_tolerance, statistical_tolerance, standard_errors = (
        checked(key, value, quantity("1", at_least=0.0))
        for key, value in (
            ("periodic_tolerance", periodic_tolerance),
            ("statistical_tolerance", statistical_tolerance),
            ("standard_errors", standard_errors),
        )
    )
    longest_period = checked("longest_period", longest_period, quantity("cycles", at_least=1, integer=True))
    finished = np.count_nonzero(cycles.samples, axis=0)
    length = np.minimum(finished, measured.astype(int))
    (maximum, minimum, square, sine, cosine, samples), in_window = _rows_from_end(cycles, finished, length)
    total = _total(samples)
    with np.errstate(invalid="ignore", divide="ignore"):
        in_phase, in_quadrature = 2.0 * _total(sine) / total, 2.0 * _total(cosine) / total
        rms = np.sqrt(_total(square) / total)
        even = _halves_agree(square / samples, length, statistical_tolerance, standard_errors)
        readings = np.array([maximum, minimum, np.sqrt(square / samples)])
    peak = np.abs(np.maximum(maximum, -minimum).max(axis=0))
    most = np.max(samples, axis=0, where=in_window, initial=1.0)
    uneven = 1.0 - np.min(samples, axis=0, where=in_window, initial=np.inf) / most
    allowed = peak * np.array([np.full(cases, periodic_tolerance)] * 2 + [periodic_tolerance + np.maximum(uneven, 0.0)])
    # of a motion that diverged nothing repeats
    with np.errstate(invalid="ignore"):
        periodic = _repeats(readings, in_window, allowed, longest_period)
    return made(
        SteadyMotion,
        peak=np.where(length > 0, peak, np.nan),
        rms=rms,
        first_harmonic=np.hypot(in_phase, in_quadrature),
        phase=np.arctan2(in_quadrature, in_phase),
        steadiness=np.where(periodic, "periodic", np.where(even, "statistical", "transient")),
    )


def _rows_from_end(
    cycles: CycleStatistics,
    finished: NDArray[np.int64],  # (cases,) cycles that have ended
    length: NDArray[np.int64],  # (cases,) cycles of each window
) -> tuple[list[Array], NDArray[np.bool_]]:
    """Columns of the windows, (rows, cases), rows leading back from each case's end; which rows are in its window.

    Rows beyond a window are zero.
    """
    columns = [getattr(cycles, item.name) for item in fields(CycleStatistics)]
    back = np.arange(max(int(length.max(initial=0)), 1))[:, None]
    in_window = back < length
    if finished.size and np.all(finished == finished[0]) and np.all(length == back.size):
        # of one length, as the cases of a study are: no rows beyond a window
        first, last = int(finished[0]) - back.size, int(finished[0])
        return [column[first:last][::-1] for column in columns], in_window
    rows = np.maximum(finished - 1 - back, 0)
    return [np.where(in_window, np.take_along_axis(column, rows, axis=0), 0.0) for column in columns], in_window


def no_steady_motion() -> SteadyMotion:
    """The amplitudes of a run shorter than one base cycle: not a number, and a transient."""
    nothing = np.full(1, np.nan)
    return SteadyMotion(nothing, nothing, nothing, nothing, np.array(["transient"]))


def _total(values: Array) -> Array:
    """Sum over rows one after the other: the same bits whatever cases stand beside."""
    return np.asarray(np.cumsum(values, axis=0)[-1])


def _repeats(readings: Array, in_window: NDArray[np.bool_], allowed: Array, longest_period: int) -> NDArray[np.bool_]:
    """True for cases that repeat their readings (readings, rows, cases) after a few cycles, rows from the end back."""
    rows, cases = in_window.shape
    repeats = np.zeros(cases, dtype=bool)
    for period in range(1, min(longest_period, rows // 2) + 1):
        change = np.abs(readings[:, period:] - readings[:, :-period])
        near = np.max(change, axis=1, where=in_window[period:], initial=0.0) <= allowed
        # a slow drift also repeats from cycle to cycle: all of the window must stay level
        strobed, counts = readings[:, ::period], in_window[::period]
        high = np.max(strobed, axis=1, where=counts, initial=-np.inf)
        low = np.min(strobed, axis=1, where=counts, initial=np.inf)
        repeats |= (in_window.sum(axis=0) >= 2 * period) & np.all(near & (high - low <= allowed), axis=0)
    return repeats


def _halves_agree(
    mean_square: Array, length: NDArray[np.int64], tolerance: float, standard_errors: float
) -> NDArray[np.bool_]:
    """True for cases in which both halves of the window are one population of cycles; rows lead back from the end."""
    place = length - 1 - np.arange(mean_square.shape[0])[:, None]
    shorter, longer = np.divmod(length, PARTS)
    ahead = longer * (shorter + 1)
    part = np.where(place < ahead, place // (shorter + 1), longer + (place - ahead) // np.maximum(shorter, 1))
    inside = [(part == i) & (place >= 0) for i in range(PARTS)]
    if np.all(length == length[:1]) and length.size and length[0] >= PARTS:
        # of one length: zeros beside a part add nothing
        parts = np.array([_total(mean_square[rows[:, 0]]) / np.count_nonzero(rows[:, 0]) for rows in inside])
    else:
        parts = np.array([_total(np.where(p, mean_square, 0.0)) / np.maximum(p.sum(axis=0), 1) for p in inside])
    first, second = parts[: PARTS // 2], parts[PARTS // 2 :]
    low, high = np.sort(np.sqrt([first.mean(axis=0), second.mean(axis=0)]), axis=0)
    error = np.sqrt((first.var(axis=0, ddof=1) + second.var(axis=0, ddof=1)) / (PARTS // 2))
    scattered = np.abs(first.mean(axis=0) - second.mean(axis=0)) <= standard_errors * error
    return np.asarray((length >= PARTS) & ((high - low <= tolerance * high) | scattered))


@dataclass(frozen=True)
class Largest:
    """The value of a channel whose size is the largest of a run.

    Parameters
    ----------
    value : float
        With its sign: `abs(value)` is the largest absolute value of the channel. Of two of one size it is the first.
    time : float, s
        When the channel has it.
    unit : str
        Of the value.
    notes : tuple of str
        What the modes of a reduced system leave out of the channel.
    """

    value: float = field(metadata=quantity("", finite=False))
    time: float = field(metadata=quantity("s", at_least=0.0))
    unit: str = field(metadata=text())
    notes: tuple[str, ...] = field(default=(), metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(eq=False)
class LargestSample:
    """Value and time of the largest size among samples that come one piece after another."""

    value: float = 0.0
    time: float | None = None

    def add(self, values: Array, times: Array) -> None:
        """Take in the next samples with their times (s)."""
        if not values.size:
            return
        i = int(np.argmax(np.abs(values)))
        if self.time is None or abs(float(values[i])) > abs(self.value):
            self.value, self.time = float(values[i]), float(times[i])


Reread = Callable[[tuple[Channel, ...], float, float], tuple[Array, dict[str, Array]]]
"""From channels, a time (s) and a longest interval (s) to times and values from there on, of a run computed anew."""


@dataclass(frozen=True, eq=False)
class LargestValues:
    """Largest values of the channels of a run, found when they are first asked for and then known."""

    # from channels to the largest value of each, found by computing the run once more
    find: Callable[[tuple[Channel, ...]], tuple[Largest, ...]] = field(repr=False)
    # reads the same run at shorter intervals; a method with steps has its steps
    reread: Reread = field(repr=False)
    known: list[tuple[Channel, Largest]] = field(default_factory=list, repr=False)  # (Channel, Largest)

    def of(self, channels: tuple[Channel, ...]) -> tuple[Largest, ...]:
        """The largest value of each channel."""
        left = tuple(channel for channel in channels if self._known(channel) is None)
        if left:
            self.known.extend(zip(left, self.find(left), strict=True))
        values = (self._known(channel) for channel in channels)
        return tuple(largest for largest in values if largest is not None)

    def _known(self, channel: Channel) -> Largest | None:
        return next((largest for other, largest in self.known if other is channel or other == channel), None)


LARGE = 0.1
"""Largest deflection over the length of the beam that is not warned of: a cantilever's is exact to 1 % there."""


def deflection_warnings(
    deflection: ArrayLike,  # m: largest absolute values, of places or of runs; what is not a number does not count
    length: float,  # m: 0 for a structure without a beam, which has no warning
) -> tuple[str, ...]:
    """A warning where the beam deflects by more than a tenth of its length.

    What linear theory neglects goes as (w/L)^2. Of a cantilever under a transverse end load P the exact elastica,
    EI theta'' = -P cos(theta), has w/L = a/3 (1 - 4/35 a^2 + ...) with a = P L^2/(EI): the linear deflection w is too
    large by 36/35 (w/L)^2 of itself, 1.0 % at w/L = 0.1 and 4.3 % at 0.2. The tip moves towards the root by
    3/5 (w/L)^2 of the length.
    """
    largest = float(np.fmax.reduce(np.ravel(deflection), initial=0.0))
    if not 0.0 < LARGE * length < largest:
        return ()
    share = largest / length
    return (
        f"the beam deflects by up to {largest:.4g} m, more than {LARGE:g} of its length of {length:.4g} m: "
        "linear beam theory "
        f"has an error of about the square of that share, {number_text(100.0 * share * share, 2)} %",
    )


# ---- peaks over frequency ------------------------------------------------------------------------------


RESOLVED = 4.0
"""A half-power width counts as resolved when it holds this many frequency steps: the peak is then 3 % low at most."""


UNRESOLVED = "does not resolve the half-power width"
"""Words of every warning that a grid is too coarse, by which it is known."""


def _rounded_down(value: float) -> float:
    """The value, > 0, to two digits and not above it."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.floor(value / unit) * unit


@dataclass(frozen=True)
class PeakResolution:
    """How well a grid of frequencies resolves one resonance."""

    frequency: float  # Hz: the point of the grid beside which the steps are read
    step: float  # Hz: the larger of the two steps beside it
    width: float  # Hz: half-power width of the resonance

    @property
    def resolved(self) -> bool:
        """True if the width holds enough steps for a damping ratio and a peak."""
        return self.width >= RESOLVED * self.step

    @property
    def largest_miss(self) -> float:
        """Share by which the largest point of the grid may be below the peak: 1 - 1/sqrt(1 + (step/width)^2).

        Near a resonance at f0 the amplitude is that of the peak over sqrt(1 + (2 (f - f0)/width)^2), and a point of the
        grid lies within half a step of f0. (Derived here.)
        """
        return 1.0 - 1.0 / math.hypot(1.0, self.step / self.width)

    @property
    def step_needed(self) -> float:
        """Largest step (Hz) that resolves the width."""
        return self.width / RESOLVED


def peak_resolution(
    frequency: ArrayLike,  # (n,) Hz: n >= 2, ascending
    near: float,  # Hz: the resonance: steps are read beside the point of the grid next to it
    width: float,  # Hz: its half-power width, 2 zeta f0 where the damping ratio zeta is small
) -> PeakResolution:
    """Resolution of a resonance by a grid of frequencies."""
    f = real_array("frequency", frequency, "Hz", "must be finite numbers")
    near = checked("near", near, quantity("Hz", above=0.0))
    width = checked("width", width, quantity("Hz", above=0.0))
    require(f.ndim == 1 and f.size >= 2, "frequency", f.size, "points", "must hold at least 2")
    top = int(np.argmin(np.abs(f - near)))
    return PeakResolution(float(f[top]), float(np.max(np.diff(f[max(top - 1, 0) : top + 2]))), width)


def resolution_warnings(peak: PeakResolution, *, of_peak: bool = True) -> tuple[str, ...]:
    """A warning where a grid is too coarse for a resonance; `of_peak` says too how low the peak may be read."""
    if peak.resolved:
        return ()
    miss = number_text(100 * peak.largest_miss, 2)
    low = f"the peak may be read up to {miss} % too low (1 - 1/sqrt(1 + (step/width)^2)); "
    return (
        f"the frequency step of {number_text(peak.step, 3)} Hz {UNRESOLVED} of {number_text(peak.width, 3)} Hz "
        f"(at least {RESOLVED:g} steps are needed): {low if of_peak else ''}"
        f"take frequencies at most {number_text(_rounded_down(peak.step_needed), 2)} Hz apart around "
        f"{peak.frequency:.4g} Hz",
    )
