"""What the drive of a planned test asks of the shaker, of the kept modes and of the duration, beside its limits."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polyval

from femimpact.arrays import Array
from femimpact.excitation import Chirp, Drives, Excitation, RandomBase, Sine
from femimpact.excitation.excitation import BrokenLine, is_force
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, pieces_of
from femimpact.excitation.remarks import FAR, drive_above_modes, drive_warnings, is_pulse, motion_warnings
from femimpact.export.tables import GRAVITY
from femimpact.integrators.record_reading import DIFFERENCE, record_coarseness, record_warnings
from femimpact.parametric.preflight_row import PreflightRow, rounded, row_of
from femimpact.system.modes import Modes, first_elastic_frequency, first_resonance, solve_modes
from femimpact.system.system import System, without_impactors

MODES = 10
"""Lowest modes at which a chirp's rate is looked at."""

SAMPLES = 64
"""Instants in a cycle at which a motion of the base is read for its extremes, 0.12 % low at most."""

SWEEP_RATE, RATE_ADVISED = 0.2, 0.1
"""b = 2 pi rate/(zeta omega)^2 up to which a swept peak is 1 % low, and the one that is advised (0.3 % low)."""

READINGS, CLOSE = 5, 16
"""Instants at which a piece is read for its largest value, and how many of the pieces are then searched."""

DRIFT = 0.25
"""Slow motion of the base over the gap beyond which a record's drift drives the ball."""

RMS_ERROR = 0.05
"""Relative standard error of the root mean square of a random response that is accepted."""


# ---- the motion of the base, and the modes that follow it ------------------------------------------


def base_rows(system: System, excitation: Excitation, duration: float | None) -> Iterator[PreflightRow]:
    """Largest displacement, velocity and acceleration that the shaker has to make, and the drift of a record."""
    if isinstance(excitation, Drives):
        excitation = excitation.base
    if excitation is None or is_force(excitation):
        return
    if isinstance(excitation, Sine):
        place, omega = excitation.amplitude, excitation.omega
        sizes = [place, place * omega, place * omega**2]
    elif duration is not None:
        sizes = largest_motion(excitation, duration)
    else:
        return
    far = motion_warnings(excitation, system.length)
    # without their size of the motion, which is that of the row
    causes = "; ".join(text.rpartition(" m: ")[2] for text in far)
    limit = FAR * system.length if far else math.nan
    yield row_of("largest displacement of the base", sizes[0], "m", limit, causes)
    yield row_of("largest velocity of the base", sizes[1], "m/s")
    yield row_of("largest acceleration of the base", sizes[2], "m/s^2")
    yield row_of("largest acceleration of the base", sizes[2] / GRAVITY, "g")
    if isinstance(excitation, RandomBase):
        yield row_of("kurtosis of the random motion", excitation.kurtosis, "1")
        yield row_of("crest factor of the random motion", excitation.crest, "1")
        if excitation.clip is not None:
            yield row_of("share of the density lost by clipping", excitation.lost_share, "1")
    yield from _drift(system, excitation)


def largest_motion(excitation: Excitation, duration: float) -> list[float]:
    """Largest |displacement| (m), |velocity| (m/s) and |acceleration| (m/s^2) of a base up to a time (s).

    Of polynomials they are exact: the largest at the ends of the pieces, from both sides, and where the derivative is
    zero. A motion without closed form is read 64 times in a cycle.
    """
    read = (excitation.displacement, excitation.velocity, excitation.acceleration)
    form = getattr(excitation, "closed_form", None)
    if not isinstance(form, (BrokenLine, PiecewisePolynomial)):
        cycles = min(duration * excitation.frequency, 1e5)
        at = np.linspace(0.0, duration, max(math.ceil(SAMPLES * cycles), 2))
        return [float(np.abs(values(at)).max()) for values in read]
    pieces = pieces_of(form)
    length = np.minimum(np.diff(pieces.knots), duration - pieces.knots[:-1])
    taylor, length = pieces.table[:-1][length > 0.0], length[length > 0.0]
    # after the last piece the base moves on uniformly
    last = [float(np.abs(values(duration))) for values in read]
    return [max(_largest_of_pieces(taylor[:, k:], length), last[k]) for k in range(3)]


def _largest_of_pieces(derivatives: Array, length: Array) -> float:
    """Largest |sum of d_j t^j/j!| over pieces of some lengths (s): roots of the derivative of those that come close."""
    if not length.size:
        return 0.0
    degree = int(np.flatnonzero(np.any(derivatives != 0.0, axis=0)).max(initial=0))
    c = np.ascontiguousarray(derivatives[:, : degree + 1].T)
    c /= np.array([math.factorial(j) for j in range(degree + 1)])[:, None]
    size = np.zeros(length.size)
    for share in np.linspace(0.0, 1.0, READINGS):
        size = np.maximum(size, np.abs(polyval(share * length, c, tensor=False)))
    largest = float(size.max())
    for i in np.argpartition(size, -min(CLOSE, size.size))[-CLOSE:]:
        roots = polyroots(polyder(c[:, i]))
        inside = roots.real[(roots.real > 0.0) & (roots.real < length[i])]
        largest = max(largest, float(np.abs(polyval(inside, c[:, i])).max(initial=0.0)))
    return largest


def _drift(system: System, excitation: Excitation) -> Iterator[PreflightRow]:
    """Largest change of a record's displacement below half the first frequency, beside a quarter of the smallest gap.

    The displacement passes a Butterworth filter of order 4 forwards and backwards, so that it is not delayed.
    """
    from scipy.signal import butter, sosfiltfilt

    line, first = getattr(excitation, "closed_form", None), first_elastic_frequency(system)
    gaps = [gap for pair in system.balls for gap in pair.gaps if math.isfinite(gap)]
    if not isinstance(line, BrokenLine) or is_pulse(line.samples) or not gaps or first == 0.0:
        return
    corner = 0.5 * first * 2.0 * line.interval
    if corner >= 1.0:
        return
    at = line.interval * np.arange(len(line.samples))
    displacement = np.asarray(excitation.displacement(at))
    # both ends are continued by three periods of the corner, as far as there are so many samples
    padding = min(math.ceil(6.0 / corner), at.size - 1)
    slow = sosfiltfilt(butter(4, corner, output="sos"), displacement, padtype="odd", padlen=padding)
    limit = DRIFT * min(gaps)
    instead = (
        f"it moves the box around a ball at rest: take RecordedBase.from_displacement(displacement, interval, "
        f"high_pass = {rounded(0.5 * first):g}) of the displacement of this record"
    )
    yield row_of(f"drift of the record below {0.5 * first:.3g} Hz", np.abs(slow - slow[0]).max(), "m", limit, instead)


def drive_rows(system: System, excitation: Excitation, duration: float | None) -> Iterator[PreflightRow]:
    """The drive beside the modes that are kept, the rate of a chirp, and the length of a random motion."""
    kept = (system.highest_kept, system.first_left_out)
    what, value, unit, limit = drive_above_modes(excitation, *kept)
    if math.isfinite(limit) and unit:
        yield row_of(what, value, unit, limit, "; ".join(drive_warnings(excitation, *kept)))
    interval, change = record_coarseness(system, excitation, duration or 0.0)
    if math.isfinite(interval) and duration is not None:
        what = f"change of the peak by straight lines between the samples of the record, {interval:.4g} s apart"
        yield row_of(what, abs(change), "1", DIFFERENCE, "; ".join(record_warnings(system, excitation, duration)))
    bare = without_impactors(system)
    if isinstance(excitation, Chirp):
        yield from _sweep_rate(excitation, solve_modes(bare, min(MODES, bare.dofs)))
    if isinstance(excitation, RandomBase) and duration is not None:
        yield from _random_error(bare, duration)


def _sweep_rate(chirp: Chirp, modes: Modes) -> Iterator[PreflightRow]:
    """B = 2 pi rate/(zeta omega)^2 of a chirp at each mode that it passes, and the number of modes passed."""
    low, high = sorted((chirp.start, chirp.stop))
    passed = [
        (k + 1, float(f), float(zeta))
        for k, (f, zeta) in enumerate(zip(modes.natural_frequency, modes.damping_ratio, strict=True))
        if low < f < high
    ]
    first = float(modes.natural_frequency[modes.natural_frequency > 0.0].min(initial=math.inf))
    instead = f"no resonance is met: the first natural frequency is {first:.4g} Hz"
    yield row_of("natural frequencies that the chirp passes", len(passed), "1", 1, instead, at_least=True)
    for number, f, zeta in passed:
        logarithmic = chirp.kind == "logarithmic"
        rate = abs(f * math.log(chirp.stop / chirp.start) if logarithmic else chirp.stop - chirp.start) / chirp.duration
        # of the rate in Hz/s, in the unit of the plan
        unit, of_rate = ("oct/min", 60.0 / (f * math.log(2.0))) if logarithmic else ("Hz/s", 1.0)
        what = f"sweep rate b = 2 pi rate/(zeta omega)^2 at mode {number} ({f:.4g} Hz)"
        decay = 2.0 * math.pi * zeta * f
        if decay == 0.0:
            yield row_of(what, math.inf, "1", SWEEP_RATE, "an undamped mode has no steady peak: give a damping ratio")
            continue
        b = 2.0 * math.pi * rate / decay**2
        advised = RATE_ADVISED * decay**2 / (2.0 * math.pi)
        instead = (
            f"the peak is {swept_peak(b):.2g} of the steady one at {rate * of_rate:.3g} {unit}: take "
            f"{rounded(advised * of_rate, math.floor):g} {unit} (b = "
            f"{RATE_ADVISED:g}), duration = {rounded(chirp.duration * rate / advised):g} s"
        )
        yield row_of(what, b, "1", SWEEP_RATE, instead)


def swept_peak(b: float) -> float:
    """Largest envelope over the steady peak of a mode that is swept at b = 2 pi rate/(zeta omega)^2 > 0.

    |integral_0^inf exp(-u + i b (tau - u)^2/2) du|, largest over tau = zeta omega t. With p = -i b/2 and
    q = 1 + i b tau the integral of exp(-q u - p u^2) is sqrt(pi/p)/2 exp(q^2/4p) erfc(q/(2 sqrt(p))).
    """
    from scipy.optimize import minimize_scalar

    at = np.linspace(-2.0, 3.0 + 6.0 / math.sqrt(b), 401)
    values = swept_envelope(b, at)
    near = int(np.argmax(values))
    bounds = (at[max(near - 1, 0)], at[min(near + 1, at.size - 1)])
    found = minimize_scalar(lambda tau: -float(swept_envelope(b, np.array([tau]))[0]), bounds=bounds, method="bounded")
    return float(-found.fun)


def swept_envelope(b: float, tau: Array) -> Array:
    """Envelope over the steady peak at tau = zeta omega t after the resonance; see `swept_peak`."""
    from scipy.special import wofz

    # exp(z^2) erfc(z) = w(i z) of the Faddeeva function
    p = np.sqrt(-0.5j * b)
    return np.asarray(np.abs(0.5 * np.sqrt(np.pi) / p * wofz(1j * (1.0 + 1j * b * tau) / (2.0 * p))))


def _random_error(bare: System, duration: float) -> Iterator[PreflightRow]:
    """Relative standard error of the rms of the first mode's response to a stationary Gaussian motion.

    The correlation exp(-zeta omega |t|) cos(omega t) gives the mean square over a time T the relative variance
    1/(zeta omega T), the rms half of its square root (derived here; the last third of the run is measured).
    """
    f, zeta = first_resonance(bare)
    decay, measured = 2.0 * math.pi * f * zeta, duration / 3.0
    if decay == 0.0:
        return
    needed = 3.0 * (0.5 / RMS_ERROR) ** 2 / decay
    instead = f"take a duration of at least {rounded(needed):g} s"
    yield row_of(
        "standard error of the rms under a random motion", 0.5 / math.sqrt(decay * measured), "1", RMS_ERROR, instead
    )
