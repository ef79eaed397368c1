"""The response curve of a sweep, and its columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array, read_only
from femimpact.errors import (
    DivergenceError,
    check_fields,
    choice,
    column,
    level_rows,
    optional,
    place,
    quantity,
    real_array,
    require,
    text,
    warnings_left_to_caller,
)
from femimpact.excitation.harmonic import Level, Sine, level_at
from femimpact.excitation.remarks import frequency_warnings, motion_warnings
from femimpact.integrators.cases import SineCases, SineDwellResults
from femimpact.integrators.methods import Method
from femimpact.integrators.planned_drive import TRANSIENT_LEFT, contact_notes, grid_resolution, transient_left
from femimpact.response.cycles import SteadyMotion, deflection_warnings, resolution_warnings
from femimpact.response.energy import residual_warnings
from femimpact.response.impacts import ImpactStatistics, statistics_of_cases
from femimpact.signals.one_pole import DampingEstimate, fit_one_pole, half_power
from femimpact.structure.structure import Position
from femimpact.system.modes import first_elastic_frequency
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import Head, flat_columns, frame_of, head_of_columns, named_column, short_repr
from femimpact.units import number_text

if TYPE_CHECKING:
    import pandas
    import xarray

SAME_FREQUENCY = 2e-9
"""Difference (Hz) up to which two frequencies are one: they are rounded to nine digits behind the point."""

MOTION_UNITS = {item.name: str(item.metadata["unit"]) for item in fields(SteadyMotion)}
"""Columns that are read from the steady motion, and their units; "" for the steadiness, which is no number."""

IMPACT_UNITS = {
    item.name: str(item.metadata["unit"]) for item in fields(ImpactStatistics) if item.name not in ("count", "law")
}
"""Columns that are statistics of impacts, and their units."""

SWEEP_UNITS = {name: unit for name, unit in MOTION_UNITS.items() if unit} | IMPACT_UNITS | {"energy_residual": "1"}
"""Numeric columns of a sweep and their units."""

OF_THE_CHANNEL = tuple(name for name, unit in MOTION_UNITS.items() if unit == "m")
"""Those of them that have the unit of what a sweep observes, m unless it is another channel."""

ONE_START = "one start's value: the motion is not periodic"
"""Legend of the mark of a value of `FrequencyResponse.is_sample`, a star or a dot: another start has another value."""

TAKE_STARTS = "take medians over several starts"
"""What a motion that never repeats asks for, in a warning of a curve of one start."""


def on_grid(
    frequency: ArrayLike,  # (n,) Hz
    grid: ArrayLike,  # (m,) Hz
) -> NDArray[np.bool_]:
    """True for the frequencies that are points of a grid, (n,)."""
    wanted, points = (
        real_array(key, values, "Hz", "must be finite numbers")
        for key, values in (("frequency", frequency), ("grid", grid))
    )
    points = np.sort(points, axis=None)
    if points.size == 0:
        return np.zeros(wanted.shape, dtype=bool)
    right = np.searchsorted(points, wanted)
    neighbours = (points[np.minimum(right, points.size - 1)], points[np.maximum(right - 1, 0)])
    distance = np.minimum(*(np.abs(point - wanted) for point in neighbours))
    return np.asarray(distance <= SAME_FREQUENCY + 1e-12 * np.abs(wanted))


@short_repr
@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Response curve over the base frequency, measured at the end of each dwell.

    `curve["peak"]` reads a column. Where `steadiness` is not "periodic" and there are impacts the values are those of
    one start: another one has others. They have a star where the curve is printed, and a dot where it is drawn; see
    `is_sample`. Without impacts what does not repeat is a transient of the start.

    Parameters
    ----------
    frequency : ndarray (n,), Hz
    peak, rms, first_harmonic : ndarray (n,), `unit`
        Of the observed place relative to the base, or of the channel; not a number where a case failed.
    phase : ndarray (n,), rad
        Of the first harmonic relative to the base's displacement.
    steadiness : ndarray (n,) of str
        "periodic", "statistical", "transient" or "failed".
    impacts_per_cycle : ndarray (n,), 1
    mean_approach_speed, largest_approach_speed : ndarray (n,), m/s
    mean_impulse : ndarray (n,), N s
    peak_force : ndarray (n,), N
        Largest of the measured time, under the law named in `law`; see `ImpactStatistics`.
    cycle_mean_force : ndarray (n,), N
        Integral of the force over the measured time, divided by that time.
    energy_residual : ndarray (n,), 1
        Largest at the ends of base cycles, event-driven through compliant contacts or without any of the measured ones;
        not a number without a ledger.
    amplitude : float or None, m
        Of the base, the same at all frequencies; None of a sweep at constant acceleration.
    cycles : int or None
        Of the dwell at each frequency; None where the dwell is a duration.
    at : str or float
        The observed place, or the name of the channel.
    start : str
        Frame in which everything was at rest, "static", or "given".
    law : str
    warnings, notes : tuple of str
    duration, window : float or None, s
        Of the dwell at each frequency, and of the measured part at its end; None where the dwell is a number of cycles.
    unit : str
        Of peak, rms and first harmonic.
    acceleration : float or array_like (k, 2) or None, m/s^2
        Amplitude of the base's acceleration, the same at all frequencies, or rows of a frequency (Hz) and an amplitude;
        None of a sweep at constant displacement.
    direction : "up", "down" or None
        The way in which each frequency began with the end of the one before it; None where each is a separate run.
    """

    _figure: ClassVar[str] = "fi.figures.response_curve(curve)"

    frequency: Array = field(metadata=column("Hz", "frequencies", finite=True))
    peak: Array = field(metadata=column("m", "frequencies"))
    rms: Array = field(metadata=column("m", "frequencies"))
    first_harmonic: Array = field(metadata=column("m", "frequencies"))
    phase: Array = field(metadata=column("rad", "frequencies"))
    steadiness: NDArray[np.str_] = field(metadata=column("", "frequencies", of="text"))
    impacts_per_cycle: Array = field(metadata=column("1", "frequencies"))
    mean_approach_speed: Array = field(metadata=column("m/s", "frequencies"))
    largest_approach_speed: Array = field(metadata=column("m/s", "frequencies"))
    mean_impulse: Array = field(metadata=column("N s", "frequencies"))
    peak_force: Array = field(metadata=column("N", "frequencies"))
    cycle_mean_force: Array = field(metadata=column("N", "frequencies"))
    energy_residual: Array = field(metadata=column("1", "frequencies"))
    amplitude: float | None = field(metadata=optional(quantity("m", at_least=0.0)))
    cycles: int | None = field(metadata=optional(quantity("1", at_least=1, integer=True)))
    at: Position = field(metadata=place())
    start: str = field(metadata=choice("base", "space", "static", "given"))
    law: str = field(metadata=text())
    warnings: tuple[str, ...] = field(default=(), metadata=text(several=True))
    notes: tuple[str, ...] = field(default=(), metadata=text(several=True))
    duration: float | None = field(default=None, metadata=quantity("s", above=0.0))
    window: float | None = field(default=None, metadata=quantity("s", above=0.0))
    unit: str = field(default="m", metadata=text())
    acceleration: Level | None = field(default=None, metadata=optional(level_rows("m/s^2")))
    direction: str | None = field(default=None, metadata=optional(choice("up", "down")))

    def __post_init__(self) -> None:
        check_fields(self)
        one = (self.cycles is None) != (self.duration is None)
        require(one, "cycles", self.cycles, "", "must be given, or a duration (s) instead")
        one = (self.amplitude is None) != (self.acceleration is None)
        require(one, "amplitude", self.amplitude, "m", "must be given, or an acceleration (m/s^2) instead")
        fits = self.window is None or (self.duration is not None and self.window <= self.duration)
        require(fits, "window", self.window, "s", "must be at most the duration, which it goes with")

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    @property
    def base_amplitude(self) -> Array:
        """Amplitude (n,) of the base's displacement at each frequency, m."""
        if self.acceleration is None:
            return np.full(self.frequency.size, self.amplitude)
        return level_at(self.acceleration, self.frequency) / (2.0 * np.pi * self.frequency) ** 2

    def _units_of(self, units: dict[str, str]) -> dict[str, str]:
        return units | dict.fromkeys(OF_THE_CHANNEL, self.unit)

    @property
    def _head(self) -> Head:
        size = self.frequency.size
        span = f" at {self.frequency.min():.5g} to {self.frequency.max():.5g} Hz" if size else ""
        highest = ""
        if np.any(np.isfinite(self.peak)):
            star = "*" if self.peak_is_sample else ""
            highest = f", peak {self.peak_amplitude:.5g}{star} {self.unit} at {self.peak_frequency:.5g} Hz"
            highest += " (transient)" if self.peak_is_transient else ""
        title = f"FrequencyResponse: {size}{span}{highest}, {len(self.warnings)} warnings"
        columns, units = flat_columns(self)
        units = self._units_of(units)
        if np.any(self.is_sample):
            units["steadiness"] = "* one start"
        return head_of_columns(title, columns, units, dict.fromkeys(SWEEP_UNITS, self.is_sample))

    @property
    def is_sample(self) -> NDArray[np.bool_]:
        """True where the values are one start's of a motion with impacts that is not periodic, (n,).

        Such a motion has other values from another start. A mark says so: a star in printed tables, a dot in figures;
        in files it is the column `steadiness`. False where a case failed, and where there are no impacts in the
        measured time: what does not repeat there is a transient that has not died out, as `has_transient` says.
        """
        return np.asarray(self._irregular & (self.impacts_per_cycle > 0.0))

    @property
    def has_transient(self) -> NDArray[np.bool_]:
        """True where a motion without impacts does not repeat: a transient of the start has not died out, (n,)."""
        return np.asarray(self._irregular & (self.impacts_per_cycle == 0.0))

    @property
    def _irregular(self) -> NDArray[np.bool_]:
        return np.asarray((self.steadiness != "periodic") & (self.steadiness != "failed"))

    @property
    def peak_is_sample(self) -> bool:
        """True if the largest peak of the curve is one start's value."""
        return bool(self.is_sample[np.nanargmax(self.peak)])

    @property
    def peak_is_transient(self) -> bool:
        """True if the largest peak of the curve has a transient of the start in it."""
        return bool(self.has_transient[np.nanargmax(self.peak)])

    @property
    def peak_at_one_level(self) -> Array:
        """Peaks (n,) times the share of the base's displacement at the largest one in that at their own frequency.

        Of a linear structure they are the curve at constant displacement of the base, from which damping is read.
        """
        if not self.acceleration:
            return self.peak
        base = self.base_amplitude
        return np.asarray(self.peak * (base[np.nanargmax(self.peak)] / base))

    @cached_property
    def damping(self) -> DampingEstimate:
        """One-pole fit of `peak_at_one_level`."""
        with warnings_left_to_caller():
            return fit_one_pole(self.frequency, self.peak_at_one_level)

    @cached_property
    def damping_half_power(self) -> DampingEstimate:
        """Half-power estimate of `peak_at_one_level`."""
        with warnings_left_to_caller():
            return half_power(self.frequency, self.peak_at_one_level)

    @property
    def peak_amplitude(self) -> float:
        """Largest peak of the curve, in its `unit`."""
        return float(np.nanmax(self.peak))

    @property
    def peak_frequency(self) -> float:
        """Frequency of the largest peak, Hz."""
        return float(self.frequency[np.nanargmax(self.peak)])

    @property
    def _level(self) -> dict[str, Any]:
        rows = self.acceleration
        given: dict[str, Any] = {
            "base_amplitude_m": self.amplitude,
            # of rows one after the other: frequency, acceleration, frequency, ...
            "base_acceleration_m_s2": rows if isinstance(rows, float) or rows is None else np.ravel(rows),
            "direction": self.direction,
        }
        return {name: value for name, value in given.items() if value is not None}

    @property
    def _dwell(self) -> dict[str, float]:
        given = {"cycles": self.cycles, "duration_s": self.duration, "window_s": self.window}
        return {name: value for name, value in given.items() if value is not None}

    def to_pandas(self) -> pandas.DataFrame:
        """The curve over frequency, with the base's amplitude; units in `attrs["units"]`."""
        columns, units = flat_columns(self)
        columns, units = columns | {"base_amplitude": self.base_amplitude}, self._units_of(units)
        return frame_of(columns, units | {"base_amplitude": "m"}, index="frequency")

    def to_xarray(self) -> xarray.Dataset:
        """The curve as a labelled dataset over frequency."""
        import xarray

        data: dict[str, Any] = {
            name: ("frequency", np.array(getattr(self, name)), {"units": unit, "long_name": name.replace("_", " ")})
            for name, unit in self._units_of(SWEEP_UNITS).items()
        }
        data["base_amplitude"] = ("frequency", self.base_amplitude, {"units": "m", "long_name": "base amplitude"})
        data["steadiness"] = ("frequency", np.array(self.steadiness, dtype=str))
        frequency = ("frequency", np.array(self.frequency), {"units": "Hz", "long_name": "base frequency"})
        attributes = {
            **self._level,
            **self._dwell,
            "at": str(self.at),
            "start": self.start,
            "contact_law": self.law,
            "warnings": "; ".join(self.warnings),
        }
        return xarray.Dataset(data, coords={"frequency": frequency}, attrs=attributes)


Columns = dict[str, NDArray[Any]]


def dwell_columns(dwells: SineDwellResults, frequency: Array) -> Columns:
    """Columns (n,) of dwells by the names of `SWEEP_UNITS`, and their steadiness."""
    motion = {name: getattr(dwells.motion, name) for name in MOTION_UNITS}
    impacts = statistics_of_cases(dwells.totals, dwells.duration, frequency)
    return motion | impacts | {"energy_residual": dwells.residual}


def columns_of_dwells(dwells: SineDwellResults, f: Array, ledger: bool) -> tuple[Columns, list[str]]:
    """Columns of dwells, and their warnings, with one for each dwell that failed: its row is not a number, "failed".

    Raises `DivergenceError` if all have.
    """
    completed = np.array([not failure for failure in dwells.failures])
    if not np.any(completed):
        raise DivergenceError(dwells.failures[0])
    columns = {
        name: np.where(completed, column, "failed" if name == "steadiness" else np.nan)
        for name, column in dwell_columns(dwells, f).items()
    }
    warnings = [*dwells.warnings, *filter(None, dwells.failures)]
    if ledger:
        # a dwell that failed has a warning already
        warnings += residual_warnings(f, np.where(completed, dwells.residual, 0.0), dwells.bound)
    return columns, warnings


def curve_of(
    system: System, method: Method, cases: SineCases, columns: Columns, warnings: list[str], about: Mapping[str, Any]
) -> FrequencyResponse:
    """The curve of columns, with its warnings and notes."""
    f = cases.frequency
    values: dict[str, Any] = {name: read_only(column) for name, column in columns.items()}
    warnings = warnings + _steadiness_warnings(system, cases, columns) + dwell_warnings(system, _shortest_begin(cases))
    warnings += _grid_warnings(system, f)
    curve = FrequencyResponse(
        frequency=read_only(f),
        **values,
        law=", ".join(dict.fromkeys(pair.law.name for pair in system.contacts)) or "none",
        **about,
    )
    largest = int(np.argmax(curve.base_amplitude))
    warnings += motion_warnings(Sine(float(curve.base_amplitude[largest]), float(f[largest])), system.length)
    warnings += frequency_warnings(f, system.highest_kept, system.first_left_out)
    if curve.unit == "m":
        warnings += deflection_warnings(columns["peak"], system.length)
    notes = (*method.notes(system), *contact_notes(system), *curve.notes)
    return replace(curve, warnings=tuple(warnings), notes=notes)


def start_of(state: State, system: System) -> str:
    """Name of the state from which all runs start: its frame, "static" or "given"."""
    if not state.is_at_rest:
        return "given"
    return "static" if state.is_static_on(system) else state.frame


def _steadiness_warnings(system: System, cases: SineCases, columns: Columns) -> list[str]:
    """Warnings where the halves of the measured time differ: of a motion that never repeats, and of one that settles.

    With impacts, and little of the first mode's transient left, it is the motion that does not repeat.
    """
    f, unlike = cases.frequency, columns["steadiness"] == "transient"
    chaotic = unlike & (columns["impacts_per_cycle"] > 0.0)
    if np.any(chaotic):
        chaotic = chaotic & (transient_left(system, _shortest_begin(cases))[2] <= TRANSIENT_LEFT)
    texts = (
        (chaotic, f"the motion never repeats; {TAKE_STARTS}"),
        (unlike & ~chaotic, "the two halves of the measured time differ; take a longer dwell"),
    )  # fmt: skip
    return [
        f"not steady at {np.count_nonzero(which)} of {f.size} frequencies ({_reach(f[which])}): {text}"
        for which, text in texts
        if np.any(which)
    ]


def _reach(f: Array) -> str:
    """Words on the first and the last of some frequencies (Hz)."""
    return " to ".join(dict.fromkeys((f"{f.min():.4g}", f"{f.max():.4g}"))) + " Hz"


def dwell_warnings(
    system: System,
    begin: float,  # s: since the start of the shortest dwell
) -> list[str]:
    """A warning where much of the first mode's transient is left when measuring begins."""
    if system.rayleigh is None or first_elastic_frequency(system) == 0.0:
        return []
    first, ratio, left = transient_left(system, begin)
    if left <= TRANSIENT_LEFT:
        return []
    return [
        f"dwell of {number_text(begin, 3)} s before measuring begins: {number_text(100 * left, 2)} % of the first "
        f"mode's transient (damping ratio {number_text(ratio, 3)}) is left there: peaks and damping near "
        f"{first:.4g} Hz need a longer dwell"
    ]


def _shortest_begin(cases: SineCases) -> float:
    """Time (s) at which the shortest dwell begins to measure."""
    return float(((cases.cycles - cases.measured) / cases.frequency).min())


def _grid_warnings(system: System, f: Array) -> list[str]:
    """A warning where the grid is too coarse for the first resonance of a structure without contacts."""
    resolution = None if system.contacts else grid_resolution(system, f)
    return [] if resolution is None else list(resolution_warnings(resolution))
