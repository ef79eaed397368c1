"""Spectra of recorded channels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from femimpact.arrays import Array
from femimpact.contact.laws import Rigid
from femimpact.errors import (
    InputError,
    choice,
    column,
    instance,
    optional,
    quantity,
    require,
    require_name,
    takes,
    warns,
)
from femimpact.excitation.excitation import has_cycle, is_force
from femimpact.excitation.random_base import RandomBase
from femimpact.response.channels import MOTIONS, channel_key, channel_of, motion_at, motion_of
from femimpact.response.response import Response
from femimpact.structure.structure import Position
from femimpact.system.modes import solve_modes
from femimpact.system.system import System
from femimpact.table import Head, head_of_values, short_repr
from femimpact.units import number_text

if TYPE_CHECKING:
    import xarray

LEAST_WINDOWS = 16
"""Half windows of a spectral density without a given resolution, and the fewest samples of one."""

EVEN = 1e-3
"""Share of their interval by which samples may be off an even grid: times in files have nine digits."""

RESOLVED = 5.0
"""Lines in a half-power width that resolve it."""

MODES = 12
"""Lowest modes of a system in physical coordinates whose half-power widths are compared with the resolution."""


HANN_BANDWIDTH = 1.5
"""Lines of a Hann window over which the square of a sine spreads: N sum w^2/(sum w)^2."""

CONFIDENCE = 0.95
"""Probability that the interval of a line holds the density, unless it is given."""


def remarks(estimate: Any) -> dict[str, str]:
    """Notes and warnings of what was read off a run, as texts by name."""
    return {name: "; ".join(getattr(estimate, name)) for name in ("notes", "warnings")}


@short_repr
@dataclass(frozen=True, eq=False)
class Spectrum:
    """The spectrum of one channel: a one-sided density, or amplitudes.

    Parameters
    ----------
    frequency : ndarray (n,), Hz
    values : ndarray (n,)
        In `unit`.
    low, high : ndarray (n,)
        Confidence interval of a density, from the chi-squared distribution; the values themselves of amplitudes.
    unit : str
        Of the values: "(m/s^2)^2/Hz" of a density, "m/s^2" of amplitudes.
    channel : str
    kind : {"density", "amplitude"}
    degrees_of_freedom : float, 1
        Of the chi-squared distribution; not a number of amplitudes.
    confidence : float, 1
    notes, warnings : tuple of str
    """

    frequency: Array
    values: Array
    low: Array
    high: Array
    unit: str
    channel: str
    kind: str
    degrees_of_freedom: float
    confidence: float
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def resolution(self) -> float:
        """Distance of the lines, Hz."""
        return float(self.frequency[1] - self.frequency[0])

    @property
    def mean_square(self) -> float:
        """Mean square of the channel: of a density its integral, without the mean; of amplitudes with it.

        Of amplitudes it is (a_0^2 + sum a_k^2/2)/1.5, as a Hann window has a sine in three lines, A/2, A and A/2. Of a
        motion that is not steady it is weighted by the square of that window: the middle of the readings counts most.
        """
        if self.kind == "density":
            return float(np.sum(self.values) * self.resolution)
        return float((self.values[0] ** 2 + 0.5 * np.sum(self.values[1:] ** 2)) / HANN_BANDWIDTH)

    def in_gravity(self) -> Spectrum:
        """The density of an acceleration in g^2/Hz, g = 9.80665 m/s^2; any other spectrum as it is."""
        from scipy.constants import g

        if self.unit != "(m/s^2)^2/Hz":
            return self
        low, values, high = (density / g**2 for density in (self.low, self.values, self.high))
        return replace(self, low=low, values=values, high=high, unit="g^2/Hz")

    @property
    def _head(self) -> Head:
        f, peak = self.frequency, int(np.argmax(self.values))
        values = {
            "lines": f"{f.size}, {self.resolution:.4g} Hz apart, to {f[-1]:.5g} Hz",
            "largest": f"{self.values[peak]:.5g} {self.unit} at {f[peak]:.5g} Hz",
        }
        if self.kind == "density":
            span = f"{100 * self.confidence:g} %, {self.degrees_of_freedom:.4g} degrees of freedom"
            values["interval there"] = f"{self.low[peak]:.4g} to {self.high[peak]:.4g} {self.unit} ({span})"
        values |= {name: text for name, text in remarks(self).items() if text}
        return head_of_values(f"Spectrum: {self.kind} of {self.channel}", values)

    def to_xarray(self) -> xarray.Dataset:
        """The spectrum as a labelled dataset over frequency."""
        import xarray

        names = (self.kind, "low", "high") if self.kind == "density" else (self.kind,)
        columns = zip(names, (self.values, self.low, self.high), strict=False)
        data = {name: ("frequency", values, {"units": self.unit}) for name, values in columns}
        attributes = {name: getattr(self, name) for name in ("channel", "degrees_of_freedom", "confidence")}
        axis = ("frequency", self.frequency, {"units": "Hz"})
        return xarray.Dataset(data, coords={"frequency": axis}, attrs=attributes | remarks(self))


@takes(time=column("s", "samples", finite=True), values=column("", "samples", finite=True))
def amplitude_spectrum(time: Array, values: Array) -> tuple[Array, Array]:
    """Single-sided amplitudes of a history under a Hann window.

    A sine of amplitude A whose periods fill the history reads A.

    Parameters
    ----------
    time : ndarray (n,), s
        Ascending; samples that are not evenly spaced are read from the straight lines between them.
    values : ndarray (n,)

    Returns
    -------
    frequency : ndarray (n // 2 + 1,), Hz
    amplitude : ndarray (n // 2 + 1,), as the values
    """
    from scipy.signal import get_window

    ascending = time.size >= 2 and bool(np.all(np.diff(time) > 0.0))
    require(ascending, "time", f"{time.size} samples", "", "must be two or more ascending times")
    even = np.linspace(time[0], time[-1], time.size)
    window = get_window("hann", time.size)
    lines = np.abs(np.fft.rfft(np.interp(even, time, values) * window)) / window.sum()
    # of every line but the mean and the last of an even count there are two, at +f and -f
    lines[1 : (time.size + 1) // 2] *= 2.0
    return np.fft.rfftfreq(time.size, even[1] - even[0]), lines


RUN = instance(Response) | {
    "allowed": "must be a Response, as fi.integrate returns; report.html has the spectra of results of a study, and of "
    "measured columns docs/howto/spectra.md shows them"
}
"""Metadata of a run of which something is read."""


@warns
@takes(
    response=RUN, kind=optional(choice("density", "amplitude")),
    resolution=optional(quantity("Hz", above=0.0)), start=optional(quantity("s", at_least=0.0)),
    confidence=optional(quantity("1", above=0.0, below=1.0)),
)  # fmt: skip
def spectrum(
    response: Response,
    channel: Position | None = None,
    kind: str | None = None,
    *,
    resolution: float | None = None,
    start: float | None = None,
    confidence: float | None = None,
) -> Spectrum:
    """Spectral density of a recorded channel with its confidence interval, or its amplitudes.

    A density is the average over Hann windows that overlap by half, each without its mean (Welch, 1967); its integral
    is the mean square. The interval is that of a stationary normal process. Amplitudes are those of one Hann window, by
    default over the complete base cycles in the last third of the run: a sine of amplitude A reads A. Of a free decay
    `start=0.0` takes the whole run, of which the last third may be all but nothing.

    The acceleration beside rigid contacts lacks the impulses of the impacts: its spectrum is taken from that of the
    velocity, times (2 pi f)^2 as a density. The velocity has to be recorded too. Aliases of its jumps are taken out of
    a density: they are (x/sin x)^2 - 1, x = pi f interval, of the even level of jumps, which is read near half the
    reading rate.

    Parameters
    ----------
    response : Response
    channel : str or float, optional
        The first one recorded by default.
    kind : {"density", "amplitude"}, optional
        By default amplitudes where the excitation has a cycle and is no record, else a density.
    resolution : float, Hz, optional
        Distance of the lines of a density; by default that of 15 windows.
    start : float, s, optional
        Samples before it are left out; amplitudes of a run with a cycle are those of the whole cycles after it.
    confidence : float, optional
        Probability that the interval of a line holds the density; 0.95 by default.

    Raises
    ------
    InputError
        If there is no such channel or history, a kept mode lies above half the reading rate (of amplitudes, and of a
        system in physical coordinates, a warning), the velocity is missing, the record is too short for the resolution,
        or a resolution or a confidence is given for amplitudes.

    Examples
    --------
    >>> import femimpact as fi
    >>> motion = fi.RandomBase([(2.0, 0.1), (20.0, 0.1)], duration=20.0)
    >>> run = fi.integrate(system, motion, fi.EventDriven(), 20.0)
    >>> fi.spectrum(run, "tip").unit
    'm^2/Hz'
    """
    kind = kind or ("amplitude" if is_steady(response.base) else "density")
    record = record_of(response, channel, start, amplitudes=kind == "amplitude")
    if kind == "amplitude":
        for name, argument, unit in (("resolution", resolution, "Hz"), ("confidence", confidence, "")):
            require(argument is None, name, argument, unit, 'must be left out: it belongs to kind="density"')
        return _amplitudes(response, record, start)
    confidence = CONFIDENCE if confidence is None else confidence
    from scipy.signal import welch
    from scipy.stats import chi2

    window, segments = windows_of(record, resolution)
    f, values = welch(record.values, 1.0 / record.interval, nperseg=window)
    values = values * (2.0 * np.pi * f) ** (2 * record.derivatives)
    notes: tuple[str, ...] = ()
    if record.derivatives:
        # a velocity with jumps falls with 1/f^2, whose aliases sum to this over its own; a resonance has none
        own = np.sinc(f * record.interval) ** 2
        level = float(np.median((values * own)[f > 0.375 / record.interval]))
        values = np.maximum(values - level * (1.0 / own - 1.0), values * own)
        notes = (
            f"of the level of the jumps, {number_text(level, 3)}, the aliases are taken out: 147 % of it at half the "
            "reading rate",
        )
    freedom = degrees_of_freedom(window, segments)
    # the mean and the last line of an even count have half as many
    single = (f == 0.0) | ((np.arange(f.size) == f.size - 1) & (window % 2 == 0))
    of_line = np.where(single, 0.5 * freedom, freedom)
    below, above = (of_line * values / chi2.ppf(0.5 * (1.0 + side * confidence), of_line) for side in (1.0, -1.0))
    fixed = isinstance(drive_history(response), RandomBase) and drive_history(response).amplitudes == "fixed"
    notes += ("the lines of the drive have fixed amplitudes: runs scatter by less than the interval",) if fixed else ()
    # brackets only where the square would be read as that of a part of the unit
    squared = f"{record.unit}^2" if record.unit.isalpha() else f"({record.unit})^2"
    return Spectrum(
        f, values, below, above, f"{squared}/Hz", record.name, "density", freedom, confidence,
        (*record.notes, *notes), (*record.warnings, *width_warnings(response, float(f[1]), float(f[-1]))),
    )  # fmt: skip


def _amplitudes(response: Response, record: Record, start: float | None) -> Spectrum:
    time, values, base = record.time, record.values, response.base.frequency
    if is_steady(response.base):
        begin, end = max(response.window[0] if start is None else start, float(time[0])), float(time[-1])
        cycles = int((end - begin) * base + 1e-9)
        allowed = f"must hold a base cycle, {number_text(1.0 / base, 3)} s, in its end"
        require(cycles >= 1, "response.time", end - begin, "s", allowed)
        # the sample at the end of the last cycle would be the first of the next
        inside = (time >= end - cycles / base * (1.0 + 1e-9)) & (time < end)
        time, values = time[inside], values[inside]
    f, amplitude = amplitude_spectrum(time, values)
    amplitude = amplitude * (2.0 * np.pi * f) ** record.derivatives
    return Spectrum(
        f, amplitude, amplitude, amplitude, record.unit, record.name, "amplitude", math.nan, math.nan, record.notes,
        record.warnings,
    )  # fmt: skip


# ---- what is read of a response ------------------------------------------------------------------


class Record(NamedTuple):
    """Even samples, of which so many derivatives by time are the channel."""

    name: str
    unit: str
    time: Array
    values: Array
    interval: float  # s
    derivatives: int
    holds_drive: bool  # True where the value at a time has a share of the drive's then
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def record_of(
    response: Response,
    channel: Position | None,
    start: float | None = None,  # s
    key: str = "channel",  # of the argument that names it
    *,
    amplitudes: bool = False,  # which a mode above half the reading rate spoils less: it is warned of
    whole: bool = False,  # of a transform of all samples, in which the drive's own jumps have aliases
) -> Record:
    """Samples of a channel, of the velocity for an acceleration with impulses; checked to be even and fine enough."""
    allowed = "must hold a history; that of a run with Recorder.sink is in the pieces"
    require(response.time.size > 0, "response.time", "no samples", "", allowed)
    require(bool(response.channels), "response.channels", "none", "", "must be one or more")
    name = next(iter(response.channels)) if channel is None else channel_key(channel, key)
    require_name(name, response.channels, key)
    inside = response.time >= (response.time[0] if start is None else start)
    time = response.time[inside]
    count = int(np.count_nonzero(inside))
    require(count >= LEAST_WINDOWS, "response.time", count, "samples", f"must be {LEAST_WINDOWS} or more")
    interval = float(time[-1] - time[0]) / (count - 1)
    even = float(np.abs(np.diff(time) - interval).max()) <= EVEN * interval
    require(even, "response.time", None, "s", "must be evenly spaced")
    coarse = too_coarse(response, interval)
    # how fine the steps of a system in physical coordinates were is not known: they show no more than half their rate
    refused = not amplitudes and getattr(response.system, "is_diagonal", False)
    require(not coarse or not refused, "interval of response.time", interval, "s", coarse)
    values, derivatives = response[name], 0
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = (f"the readings are {number_text(interval, 3)} s apart and {coarse}",) if coarse else ()
    impacts = _rigid_impacts(response)
    read = _channel(response, name)
    lacks = f"{name} lacks the impulses of {impacts} rigid impacts"
    order, absolute = motion_of(read) or (0, False)
    # in space the motion of the base, which need not end at rest, would be in it
    apart = whole and not (absolute and not is_force(response.base))
    of_forces = getattr(read, "quantity", "") in ("shaker_force", "reaction_force", "reaction_moment")
    for slower in range(order) if apart else (1,) if impacts and order == 2 else ():
        motion = _motion(response, read, slower)
        if motion is not None:
            values, derivatives = motion, order - slower
            break
    if impacts and order == 2:
        allowed = f"must be a recorded channel too: {lacks}, which the velocity has"
        require(derivatives > 0, "channel", motion_at(read.at, 1, absolute).name, "", allowed)
        notes = (f"{lacks}: it is taken from the {'velocity' if derivatives == 1 else 'displacement'}, which has them",)
    elif impacts and (of_forces or name.rpartition(".")[2] == "contact_force"):
        warnings += (f"{lacks}: its spectrum is that of what acts between them",)
    holds = of_forces or (apart and order == 2 and derivatives == 0)
    return Record(name, response.units[name], time, values[inside], interval, derivatives, holds, notes, warnings)


def _channel(response: Response, name: str) -> Any:
    """The channel of a name; None for one of a user."""
    try:
        return channel_of(response.system, name)
    except InputError:
        return None


def _rigid_impacts(response: Response) -> int:
    impacts = response.impacts
    rigid = [name for name, law in impacts.law.items() if law == Rigid.name]
    # those that the table did not keep are not named
    return int(np.count_nonzero(np.isin(impacts.impactor, rigid))) + (impacts.dropped if rigid else 0)


def _motion(response: Response, read: Any, derivative: int) -> Array | None:
    """Displacement (0) or velocity (1) of the place of a channel, from a recorded one in space or relative to the base.

    None without one.
    """
    relative, absolute = (motion_at(read.at, derivative, in_space).name for in_space in (False, True))
    wanted, other, sign = (absolute, relative, 1.0) if MOTIONS[read.quantity][1] else (relative, absolute, -1.0)
    if wanted in response.channels or other not in response.channels:
        return response.channels.get(wanted)
    base = (response.base.displacement, response.base.velocity)[derivative]
    return np.asarray(response[other] + sign * base(response.time))


def is_steady(base: Any) -> bool:
    """True of sines. A record may repeat, but has no phase: its frequency is only that of its largest line."""
    return has_cycle(base) and not math.isnan(base.phase)


def drive_history(response: Response) -> Any:
    """What drives a run: the history of a force, or the motion of the base."""
    return getattr(response.base, "history", response.base)


def absolute_motion(response: Response, channel: Position | None) -> tuple[str, str, Array, float]:
    """Name, unit (m/s^2, or m/s where impulses count), samples and interval (s) of a channel's motion in space."""
    record = record_of(response, channel)
    read = _channel(response, record.name)
    derivative, absolute = motion_of(read) or (0, False)
    require(derivative > 0, "channel", record.name, record.unit, "must be an acceleration or a velocity")
    order = derivative - record.derivatives
    base = (response.base.velocity, response.base.acceleration)[order - 1]
    added = 0.0 if absolute else base(record.time)
    return (
        motion_at(read.at, derivative, True).name,
        ("m/s", "m/s^2")[order - 1],
        record.values + added,
        record.interval,
    )


def modes_of(system: Any, most: int) -> tuple[Array, Array]:
    """Natural frequencies (Hz) and damping ratios of the kept modes, or of the lowest ones of a system on its dofs."""
    if not isinstance(system, System):
        # as results hold them
        modes: tuple[Array, Array] = getattr(system, "modes", (np.zeros(0), np.zeros(0)))
        return modes
    if not system.is_diagonal:
        solved = solve_modes(system, min(most, system.dofs))
        return solved.natural_frequency, solved.damping_ratio
    M, C, K = (matrix.diagonal() for matrix in (system.M, system.C, system.K))
    omega = np.sqrt(K / M)
    # attachment vectors of a static correction are no modes
    known = (omega > 0.0) & (omega <= 2.0 * np.pi * system.first_left_out)
    return omega[known] / (2.0 * np.pi), 0.5 * (C / M)[known] / omega[known]


def too_coarse(response: Response, interval: float) -> str:
    """What interval would do, where something excites a mode that samples do not follow; else no words."""
    if is_steady(response.base) and not len(response.impacts):
        return ""
    frequency, ratio = modes_of(response.system, MODES)
    above = frequency[(ratio < 1.0) & (frequency * interval > 0.5)]
    if not above.size:
        return ""
    if not getattr(response.system, "is_diagonal", False):
        return f"the mode at {above.min():.4g} Hz is an alias there where the steps were finer"
    highest = float(above.max())
    finer = 10.0 ** math.floor(math.log10(0.5 / highest) - 1.0)
    finer *= math.floor(0.5 / highest / finer)
    longest = number_text(finer, 3)
    return f"must be <= {longest} s, by Recorder(interval=): a kept mode at {highest:.4g} Hz would be an alias"


# ---- densities -----------------------------------------------------------------------------------


def windows_of(record: Record, resolution: float | None) -> tuple[int, int]:
    """Samples in each window, and how many windows that overlap by half there are."""
    count = record.time.size
    window = 2 * count // LEAST_WINDOWS
    if resolution is not None:
        window = round(1.0 / (resolution * record.interval))
        low, high = 1.0 / (count * record.interval), 0.5 / record.interval
        allowed = f"must be {number_text(low, 3)} Hz, one line of the record, to {number_text(high, 3)} Hz"
        require(2 <= window <= count, "resolution", resolution, "Hz", allowed)
    return window, (count - window // 2) // (window - window // 2)


def degrees_of_freedom(window: int, segments: int) -> float:
    """Degrees of freedom of the average over Hann windows of so many samples that overlap by half (Welch, 1967)."""
    from scipy.signal import get_window

    weights = get_window("hann", window)
    step = window - window // 2
    shared = [
        (float(weights[: window - k * step] @ weights[k * step :]) / float(weights @ weights)) ** 2
        for k in range(1, min(segments, -(-window // step)))
    ]
    return 2.0 * segments**2 / (segments + 2.0 * sum((segments - k) * squared for k, squared in enumerate(shared, 1)))


def resolution_bias(width: float, resolution: float) -> float:
    """Relative error of a resonance's largest density, and of |H1| there, of a half-power width and lines so far apart.

    A narrow resonance has the correlation e^{-a t}, a = pi width, beside its oscillation; a window sees it times the
    window's own correlation.
    """
    share = np.linspace(0.0, 1.0, 20_001)
    own = (1.0 - share) * (2.0 + np.cos(2.0 * np.pi * share)) / 3.0 + np.sin(2.0 * np.pi * share) / (2.0 * np.pi)
    decay = np.pi * width / resolution
    # the integral of e^{-a t} itself over the same points, so that coarse points do not count
    kernel = np.exp(-decay * share)
    rest = math.exp(-decay) / decay
    return float(np.trapezoid(kernel * own, share) / (np.trapezoid(kernel, share) + rest) - 1.0)


def width_warnings(response: Response, resolution: float, highest: float) -> tuple[str, ...]:
    """A warning where lines are coarser than a fifth of the half-power width of a mode: of the narrowest one."""
    frequency, ratio = modes_of(response.system, MODES)
    seen = (frequency > 0.0) & (frequency < highest)
    width = 2.0 * (ratio * frequency)[seen]
    if not width.size or resolution <= width.min() / RESOLVED:
        return ()
    narrow = int(np.argmin(width))
    least = float(width[narrow])
    bias = resolution_bias(least, resolution) if least > 0.0 else -1.0
    wanted, span = "no damping", float(np.ptp(response.time))
    if least > 0.0:
        longer = f", and a run longer than its {number_text(span, 3)} s" if RESOLVED / least > span else ""
        wanted = f"resolution={number_text(least / RESOLVED, 2)} needs windows of {number_text(RESOLVED / least, 3)} s"
        wanted += longer
    return (
        f"lines {number_text(resolution, 3)} Hz apart are coarser than a fifth of the half-power width, "
        f"{number_text(least, 3)} Hz, of the mode at {frequency[seen][narrow]:.4g} Hz: its peak is "
        f"{number_text(-100.0 * bias, 2)} % too low; {wanted}",
    )
