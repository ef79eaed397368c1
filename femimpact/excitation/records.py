"""Recorded motions of the base: the file of columns, and the motion as straight lines between samples."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import (
    Fault,
    InputError,
    InputWarning,
    check_fields,
    checked,
    choice,
    instance,
    optional,
    quantity,
    real_array,
    require,
    takes,
)
from femimpact.errors import text as a_text
from femimpact.excitation.column_names import in_si, unit_of
from femimpact.excitation.columns import TextTable, is_column, record_text, text_table
from femimpact.excitation.excitation import BrokenLine, times
from femimpact.excitation.sums import added

SAME = 2e-3
"""Share by which a scale may differ from a unit that it stands for: 9.81 is one g."""


def _factors(table: TextTable, places: Sequence[int], scale: float | None) -> tuple[float, float, str]:
    """What times and accelerations are multiplied by for s and m/s^2, and a note where the header's units say so."""
    allowed = f"must be a column of time: {table.name(places[0])!r} counts samples"
    require(places[0] not in table.counted, "columns", places[0], "", allowed)
    factors, stated, assumed = [1.0, 1.0 if scale is None else scale], list[str](), list[str]()
    for i, (place, si) in enumerate(zip(places, ("s", "m/s^2"), strict=True)):
        unit = table.units.get(place, "")
        (unit_in_si, factor, note), known = in_si(table.name(place), unit, (si,)), unit_of(unit)
        named = table.has_row or (known is not None and known[0] != "1")
        if scale is not None and i == 1:
            if known is not None and named and (unit_in_si != si or abs(abs(scale) / factor - 1.0) > SAME):
                _warn(table.path, f"column {place}: {unit!r} in the header, taken as {scale:g} m/s^2 by scale")
        elif unit_in_si == si:
            factors[i] = factor
            stated += [note] * (factor != 1.0)
        elif unit and named:
            allowed = f"column {place} is in {unit} by its header: must be in a unit of {si}{'; or give scale' * i}"
            raise InputError([Fault("path", str(table.path), "", allowed)])
        elif unit or note.endswith("?"):
            _warn(table.path, f"column {place}: {note} (taken as {si}{'; scale = 1 says so' * i})")
        if unit_in_si != si and not (scale is not None and i == 1):
            assumed.append(
                f"{table.name(place)!r} is taken as {si}: {'its unit is not known' if unit else 'no unit is there'}"
            )
    parts = [f"{', '.join(stated)}, by its header"] * bool(stated) + assumed
    return factors[0], factors[1], f"{table.path.name}: {'; '.join(parts)}" if parts else ""


def _warn(path: Path, words: str) -> None:
    warnings.warn(f"{path.name}, {words}", InputWarning, stacklevel=6)


LEAKAGE = 2
"""Lines on either side of one that a sine between them has 95 % of its energy in, all five together."""

LASTING = 0.5
"""Rms of the last third of a record over that of all of it, below which it has died away."""


@dataclass(frozen=True, eq=False)
class RecordedBase:
    """Base motion from samples of its acceleration, straight between them; at rest at t = 0.

    Velocity and displacement are the exact integrals of these straight lines, and nothing is filtered: an offset or a
    drift of the sensor is taken for motion. An offset a moves the base by a t^2/2, so that offset and drift are to be
    removed before; of relative motion, a constant one bends the beam by its static deflection. Between samples a sine
    is read too low, by (pi f interval)^2/3 at a frequency f. Beyond the last sample the base moves on uniformly.

    Parameters
    ----------
    samples : array_like (n,), m/s^2
        n >= 2, the first at t = 0.
    interval : float, s
        Between samples.
    initial_velocity : float, m/s
    note : str
        What a file's units were taken for.
    source : mapping, optional
        Keys of [base] that a study file gives the record by, and the text of its file.
    """

    samples: Any
    interval: float = field(metadata=quantity("s", above=0.0))
    initial_velocity: float = field(default=0.0, metadata=quantity("m/s"))
    note: str = field(default="", metadata=a_text())
    source: Mapping[str, Any] | None = field(default=None, repr=False, metadata=optional(instance(Mapping)))

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        scale: float | None = None,
        detrend: str = "none",
        columns: Sequence[int | str] = (0, 1),
        high_pass: float | None = None,
    ) -> RecordedBase:
        """The motion that a text file of columns holds: time (s) and acceleration, evenly spaced.

        Parameters
        ----------
        path : str or Path
            Rows of numbers, in columns between commas, semicolons, tabulators or spaces. A header before the first row
            may have any number of lines; empty lines, and those that begin with #, are left out. The first row is at
            t = 0. A regular file of at most 10 million rows and 600 MB.
        scale : float, optional
            Times which the column is m/s^2: 9.80665 for a record in g. Without it units of the header count, in a row
            or beside the names, as `note` says; 1 where there are none. With it the unit of the acceleration is only
            compared, and a contradiction is warned of. A unit of the time is applied with it as well.
        detrend : {"none", "mean", "line"}
            What is removed: the mean of the acceleration (an offset), or its line of least squares (offset and drift).
            With either the base moves at t = 0 with the velocity that brings it back to its place at the last sample,
            which no motion relative to the base depends on. Not of a pulse: it changes the velocity of the base for
            good, its mean is no offset, and without it the peak is wrong. A run on such a record has a warning;
            `excitation.remarks.is_pulse` says how pulses are told from drift.
        columns : two of int or str
            Time and acceleration, by their numbers from 0 or their names in the header.
        high_pass : float, Hz, optional
            What is slower is taken out after that, as of `from_velocity`, and the base comes back to its place.
        """
        return cls.from_text(record_text(path), scale, detrend, columns, path, high_pass)

    @classmethod
    @takes(
        text=a_text(), path=instance(str, Path), scale=optional(quantity("1")), detrend=choice("none", "mean", "line")
    )
    def from_text(
        cls,
        text: str,
        scale: float | None = None,
        detrend: str = "none",
        columns: Sequence[int | str] = (0, 1),
        path: str | Path = "text",
        high_pass: float | None = None,
    ) -> RecordedBase:
        """The motion that the text of such a file holds; a fault names it by the path."""
        require(scale != 0.0, "scale", scale, "1", "must not be 0")
        two = isinstance(columns, (tuple, list)) and len(columns) == 2 and all(map(is_column, columns))
        allowed = "must be two numbers from 0 or names of the header, of time and acceleration"
        require(two, "columns", columns, "", allowed)
        table = text_table(text, path)
        places = [table.place(column) for column in columns]
        seconds, factor, note = _factors(table, places, scale)
        time, samples = table.read(places)
        time *= seconds
        interval = table.interval(time)
        # a long text, or column, is as large as all the rest
        del text, table, time
        zeros = "must be time and acceleration: the second holds zeros only"
        require(bool(samples.any()), "columns", tuple(columns), "", zeros)
        samples *= factor
        if detrend != "none":
            from scipy.signal import detrend as without_trend

            # of huge samples the squares of what is left, which nobody asks for, are no numbers
            with np.errstate(over="ignore"):
                samples = without_trend(samples, type="constant" if detrend == "mean" else "linear")
        if high_pass is not None:
            samples = high_passed(samples, interval, high_pass)
        base = cls(samples, interval, note=note)
        return base if detrend == "none" and high_pass is None else base.returning()

    @classmethod
    def from_velocity(cls, samples: ArrayLike, interval: float, high_pass: float | None = None) -> RecordedBase:
        """The motion whose velocity is recorded.

        Its acceleration is the slope of the cubic spline through the samples. An offset of the sensor moves the base
        steadily; without `high_pass` it stays in.

        Parameters
        ----------
        samples : array_like (n,), m/s
            n >= 4, the first at t = 0.
        interval : float, s
        high_pass : float, Hz, optional
            What is slower is taken out, by a Butterworth filter of order 4 forwards and backwards, which leaves no
            delay: half of the amplitude is left at this frequency.
        """
        spline = _spline(samples, interval, high_pass, "m/s")
        return cls(spline(spline.x, 1), interval, initial_velocity=float(spline(0.0)))

    @classmethod
    def from_displacement(cls, samples: ArrayLike, interval: float, high_pass: float | None = None) -> RecordedBase:
        """The motion whose displacement is recorded, from its place at the first sample.

        The cubic spline through the samples has straight lines as its acceleration: the motion meets every sample, and
        nothing drifts. Noise of the samples is multiplied by some 1/interval^2.

        Parameters
        ----------
        samples : array_like (n,), m
            n >= 4, the first at t = 0.
        interval : float, s
        high_pass : float, Hz, optional
            As of `from_velocity`.
        """
        spline = _spline(samples, interval, high_pass, "m")
        return cls(spline(spline.x, 2), interval, initial_velocity=float(spline(0.0, 1)))

    def returning(self) -> RecordedBase:
        """The same with the velocity at t = 0 that brings the base back to its place at the last sample.

        Motions relative to the base do not depend on it.
        """
        moved = float(self._knots[1][-1])
        return replace(self, initial_velocity=self.initial_velocity - moved / self.duration)

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be 2 or more finite numbers"
        samples = real_array("samples", self.samples, "m/s^2", allowed)
        several = samples.ndim == 1 and samples.size >= 2
        require(several, "samples", f"array of shape {samples.shape}", "m/s^2", allowed)
        samples.setflags(write=False)
        object.__setattr__(self, "samples", samples)
        with np.errstate(over="ignore", invalid="ignore"):
            bounded = bool(np.isfinite(self.amplitude))
        allowed = "must move the base by a finite distance"
        require(bounded, "samples", f"array of shape {samples.shape}", "m/s^2", allowed)

    @cached_property
    def _knots(self) -> tuple[Array, Array]:
        """Velocity and displacement at the samples: exact integrals of the broken line."""
        a, h = self.samples, self.interval
        v = self.initial_velocity + np.concatenate([[0.0], np.cumsum(0.5 * h * (a[1:] + a[:-1]))])
        steps = h * v[:-1] + h * h * (2.0 * a[:-1] + a[1:]) / 6.0
        return v, np.concatenate([[0.0], np.cumsum(steps)])

    def _locate(self, time: ArrayLike) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Sample before each time, time since then (s), acceleration there, and its slope."""
        t = times(time)
        # the end is that of `duration`, whose ratio to the interval may be rounded down to the sample before
        index = np.floor(np.clip(t, 0.0, self.duration) / self.interval).astype(int)
        index = np.where(t >= self.duration, self.samples.size - 1, np.clip(index, 0, self.samples.size - 1))
        padded = np.append(self.samples, self.samples[-1])
        beyond = index >= self.samples.size - 1
        slope = np.where(beyond, 0.0, (padded[index + 1] - padded[index]) / self.interval)
        return index, t - index * self.interval, np.where(beyond, 0.0, padded[index]), slope

    @property
    def duration(self) -> float:
        """Time (s) of the last sample."""
        return float((self.samples.size - 1) * self.interval)

    @cached_property
    def frequency(self) -> float:
        """Frequency (Hz) of the largest line of the spectrum, a multiple of 1/(n interval).

        That of the record without its line of least squares: an offset or a drift is no cycle. Where nothing is left
        beside that line, all of the record is one cycle.
        """
        _, lines = self.closed_form.spectrum
        return float(max(np.argmax(lines), 1) / (self.samples.size * self.interval))

    @cached_property
    def has_cycle(self) -> bool:
        """True if half of the energy of the samples is in the largest line of the spectrum and the two on either side.

        That of a recorded sine is; noise, a pulse and a chirp have no cycle after which anything could repeat, and what
        has died away in the last third, as an earthquake, is no sine either. What is said of `frequency` holds here:
        without the line of least squares, and with 2 cycles or more in the record.
        """
        power = np.square(self.samples)
        if power[-max(power.size // 3, 1) :].mean() < LASTING**2 * power.mean():
            return False
        energy = self.closed_form.spectrum[1] ** 2
        largest = int(np.argmax(energy))
        near = energy[max(largest - LEAKAGE, 0) : largest + LEAKAGE + 1].sum()
        return largest >= 2 and bool(near >= 0.5 * energy.sum())

    @property
    def phase(self) -> float:
        """Not a number: a record has no phase, and no impact has one in it."""
        return math.nan

    @cached_property
    def amplitude(self) -> float:
        """Largest displacement, m."""
        return float(np.max(np.abs(self._knots[1])))

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s."""
        index, s, a, slope = self._locate(time)
        v, u = self._knots
        return np.asarray(u[index] + s * v[index] + s * s * a / 2.0 + s**3 * slope / 6.0)

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s."""
        index, s, a, slope = self._locate(time)
        return np.asarray(self._knots[0][index] + s * a + s * s * slope / 2.0)

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration (m/s^2) at times in s."""
        _, s, a, slope = self._locate(time)
        return np.asarray(a + s * slope)

    @cached_property
    def closed_form(self) -> BrokenLine:
        """Acceleration of the base, m/s^2."""
        return BrokenLine(self.samples, self.interval, self.initial_velocity)

    __add__ = added


def _spline(samples: ArrayLike, interval: float, high_pass: float | None, unit: str) -> Any:
    """Cubic spline through samples, without what is slower than a frequency (Hz)."""
    from scipy.interpolate import CubicSpline

    interval = checked("interval", interval, quantity("s", above=0.0))
    allowed = "must be 4 or more finite numbers"
    values = real_array("samples", samples, unit, allowed)
    several = values.ndim == 1 and values.size >= 4
    require(several, "samples", f"array of shape {values.shape}", unit, allowed)
    if high_pass is not None:
        values = high_passed(values, interval, high_pass)
    return CubicSpline(interval * np.arange(values.size), values)


def high_passed(values: Array, interval: float, high_pass: float) -> Array:
    """Samples without what is slower than a frequency (Hz), without delay.

    Either end is continued by three periods, turned about its level. A record that ends in motion goes on without a
    step of its mean; turned about its last sample it would take that for its level, and drift.
    """
    from scipy.signal import butter, sosfiltfilt

    high_pass = checked("high_pass", high_pass, quantity("Hz", above=0.0, below=0.5 / interval))
    sections = butter(4, high_pass, "highpass", fs=1.0 / interval, output="sos")
    padding = min(values.size - 1, int(3.0 / (high_pass * interval)) + 1)
    begin, end = values[: padding + 1], values[: -padding - 2 : -1]
    before, after = ((2.0 * _level(part) - part)[:0:-1] for part in (begin, end))
    longer = np.concatenate([before, values, after[::-1]])
    return np.asarray(sosfiltfilt(sections, longer, padtype=None)[padding : padding + values.size])


def _level(values: Array) -> float:
    """The line of least squares, weighted by a Hann window, at the first of some samples."""
    at = np.arange(values.size)
    weights = np.sin(np.pi * (at + 1.0) / (values.size + 1.0))
    return float(np.polynomial.Polynomial.fit(at, values, 1, w=weights)(0.0))
