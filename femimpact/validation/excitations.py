"""Reference cases of excitations, of what is read from a run, and of estimates over several runs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from femimpact.app.parametric.measured_peaks import calibration_of
from femimpact.app.parametric.runs import unit_draws
from femimpact.app.parametric.verb import parameter_study
from femimpact.app.report.result_conclusions import study_conclusions
from femimpact.contact.law import ContactLaw
from femimpact.contact.laws import KelvinVoigt, Rigid
from femimpact.excitation.drives import HammerBlow, PointForce
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine
from femimpact.excitation.records import RecordedBase
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import GeneralizedAlpha, Newmark
from femimpact.response.cycles import CycleStatistics, steady_motion
from femimpact.response.response import Recorder, Response
from femimpact.signals.decay import identify_decay
from femimpact.signals.laser import Laser
from femimpact.signals.one_pole import DampingEstimate, amplitude_ratio_damping, fit_one_pole, half_power
from femimpact.structure.structure import Impactor
from femimpact.sweep.sweep import frequency_sweep
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case, oscillator
from femimpact.validation.contacts import FREQUENCY, GRAVITY, bouncing, shaken_floor

# ---- amplitudes ----------------------------------------------------------------------------------


def subharmonic() -> Iterator[Case]:
    """A motion 0.2 + sin(w t) + 0.4 sin(w t/2) that repeats after two cycles: their largest |w| differ."""
    samples, cycles = 400, 24
    angle = 2 * math.pi / samples * np.arange(samples * cycles)
    motion = (0.2 + np.sin(angle) + 0.4 * np.sin(angle / 2)).reshape(cycles, samples)
    sine, cosine = (wave(angle).reshape(cycles, samples) for wave in (np.sin, np.cos))
    sums = (motion.max(axis=1), motion.min(axis=1), *((motion * by).sum(axis=1) for by in (motion, sine, cosine)))
    columns = [values[:, None] for values in (*sums, np.full(cycles, float(samples)))]
    of_window = steady_motion(CycleStatistics(*columns), np.array([8]))
    exact = {
        "peak": float(np.max(np.abs(motion))),
        "rms": math.sqrt(0.2**2 + 0.5 * (1 + 0.4**2)),
        "first_harmonic": 1.0,
    }
    for column, reference in exact.items():
        yield Case(
            f"motion that repeats after two cycles: {column.replace('_', ' ')}", "derived here (orthogonal sines)",
            column.replace("_", " "), "m", reference, float(getattr(of_window, column)[0]), 1e-12,
            "sums over equal samples are exact for sines: rounding only",
        )  # fmt: skip


# ---- impacts -------------------------------------------------------------------------------------


def impacts_of_a_cycle() -> Iterator[Case]:
    """One impact in each cycle turns g T of speed; the mean force is the weight, but where the window cuts a cycle."""
    # half a cycle more: no impact lies at an end of the last third
    run = bouncing(0.5, 1.0, 60.75)
    yield Case(
        "ball on a vibrating table, once a cycle: impulse", "derived here (momentum of a cycle)", "mean impulse", "N s",
        GRAVITY / FREQUENCY, run.statistics.mean_impulse, 1e-9, "rounding",
    )  # fmt: skip
    first, last = run.window
    inside = int(np.count_nonzero((run.impacts.time >= first) & (run.impacts.time < last)))
    yield Case(
        "ball on a vibrating table, once a cycle: mean force", "derived here (momentum)", "cycle-averaged force", "N",
        inside * GRAVITY / FREQUENCY / (last - first), run.statistics.cycle_mean_force, 1e-9, "rounding",
    )  # fmt: skip


def force_across_a_window() -> Iterator[Case]:
    """A contact that began long before the window counts in it from its start on: weight and change of momentum."""
    amplitude = 0.4 * GRAVITY / (2 * math.pi * FREQUENCY) ** 2
    ways: tuple[tuple[str, ContactLaw, Method, float], ...] = (
        ("a vibrating table, event-driven", Rigid(0.4), EventDriven(), amplitude),
        ("a table at rest, Newmark", KelvinVoigt(stiffness=1e4, damping=1.0), Newmark(1e-4), 0.0),
    )
    for where, law, method, moved in ways:
        table = Sine(moved, FREQUENCY)
        system = shaken_floor(law, (1.0, 0.0), -GRAVITY)
        run = integrate(system, table, method, 1.0125, initial=State.static())
        first, last = run.window
        change = float(table.velocity(last) - table.velocity(first))
        yield Case(
            f"ball that lies on {where}: mean force", "derived here (momentum)", "cycle-averaged force", "N",
            GRAVITY + change / (last - first), run.statistics.cycle_mean_force, 1e-9, "rounding",
        )  # fmt: skip


# ---- a laser -------------------------------------------------------------------------------------


def laser_end() -> Iterator[Case]:
    """Reading of a laser under a larger motion: it ends at the middle of its range, and half the range from there."""
    system = shaken_floor(Rigid(1.0), (1.0, 1.0))
    run = integrate(system, Sine(0.0, 1.0), EventDriven(), 10.0, Recorder(("ball",)), State(ball_velocity=[0.3]))
    moved = Laser("ball", range=0.6, offset=0.2).measure(run).displacement
    for end, reference, computed in (("largest", 0.2 + 0.3, np.max(moved)), ("smallest", 0.2 - 0.3, np.min(moved))):
        yield Case(
            f"laser whose range of 600 mm has its middle at 200 mm: {end} reading",
            "derived here (middle and half the range)", "displacement", "m", reference, float(computed), 1e-12,
            "rounding",
        )  # fmt: skip


# ---- damping -------------------------------------------------------------------------------------

RATIO, NATURAL = 0.0029, 5.3
"""The paper's damping ratio and natural frequency (Hz) without the ball."""


def damping() -> Iterator[Case]:
    """Readings of an exact curve of one pole: its fit, the half-power width by a quadratic, the drop of the peak."""

    def curve(f: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.abs(f**2 / (NATURAL**2 - f**2 + 2j * RATIO * NATURAL * f))

    f = np.linspace(5.2, 5.4, 41)
    yield Case(
        "one-pole fit of an exact curve", "derived here (transfer function)", "damping ratio", "1", RATIO,
        fit_one_pole(f, curve(f)).ratio, 1e-8, "tolerance of the least-squares solver",
    )  # fmt: skip
    # r^4/((1 - r^2)^2 + (2 z r)^2) is half its largest value 1/(4 z^2 (1 - z^2)), at r^2 = 1/(1 - 2 z^2)
    half = 0.5 / (4 * RATIO**2 * (1 - RATIO**2))
    low, high = np.sort(np.roots([1 - 1 / half, -2 + 4 * RATIO**2, 1.0]).real)
    f = NATURAL * np.linspace(0.985, 1.015, 20_001)
    yield Case(
        "half-power width of an exact curve", "derived here (roots of a quadratic)", "damping ratio", "1",
        float(high - low) / 4 * (1 - 2 * RATIO**2), half_power(f, curve(f)).ratio, 3e-6,
        "20,001 points: the peak lies within 1.5e-6 f0 / 2 of one, crossings by straight lines",
    )  # fmt: skip
    # five times less amplitude is five times the damping: the paper's estimate
    empty = DampingEstimate(RATIO, NATURAL, (RATIO, RATIO), "given")
    yield Case(
        "amplitude ratio of 5", "derived here (peak of one pole)", "damping ratio", "1", 5 * RATIO,
        amplitude_ratio_damping(empty, 1.0, 0.2).ratio, 1e-12, "rounding",
    )  # fmt: skip


OMEGA = 2 * math.pi
"""Natural frequency of the oscillator of these cases, rad/s; its mass is 1 kg."""
DAMPING = 0.03
"""Its damping ratio."""


# ---- a ball that no wall touches -----------------------------------------------------------------


def ball_stays() -> Iterator[Case]:
    """A ball between walls that the base's motion does not reach stays where it is in space."""
    drift = "(omega dt)^2/12 = 5.6e-6 of the drift of 38 mm that the sine's own speed cancels"
    ways: tuple[tuple[str, Method, ContactLaw, float, str], ...] = (
        ("event-driven", EventDriven(), Rigid(0.5), 1e-14, "rounding"),
        ("Newmark", Newmark(1e-3), KelvinVoigt(restitution=0.5, contact_time=0.1), 4e-7, drift),
    )
    what, source = "ball at rest in the inertial frame on a shaken base", "derived here (no force, no motion)"
    record = Recorder(("ball", "ball.velocity"))
    for way, method, law, bound, reason in ways:
        ball = Impactor("ball", "tip", 0.1, 1.0, law)
        system = System.from_matrices([[1.0]], [[0.1]], [[OMEGA**2]], points={"tip": [1.0]}, impactors=[ball])
        run = integrate(system, Sine(1e-3, 1.3, 0.4), method, 5.0, record, State.at_rest("space"))
        largest, speed = (float(np.max(np.abs(run.absolute(name)))) for name in ("ball", "ball.velocity"))
        yield Case(f"{what}, {way}", source, "largest displacement in space", "m", 0.0, largest, bound, reason)
        if way == "event-driven":
            yield Case(f"{what}, {way}: speed", source, "largest speed in space", "m/s", 0.0, speed, 1e-13, "rounding")


# ---- an oscillator from rest ---------------------------------------------------------------------


def _forced(time: float, frequency: float, phase: float) -> float:
    """U'' + 2 z w u' + w^2 u = sin(2 pi f t + phase) from rest: the steady sine and the free motion beside it."""
    from scipy.linalg import expm

    omega = 2 * math.pi * frequency
    answer = np.exp(1j * phase) / (OMEGA**2 - omega**2 + 2j * DAMPING * OMEGA * omega)
    free = np.array([-answer.imag, -(1j * omega * answer).imag])
    decayed = expm(np.array([[0.0, 1.0], [-(OMEGA**2), -2 * DAMPING * OMEGA]]) * time) @ free
    return float((answer * np.exp(1j * omega * time)).imag + decayed[0])


def driven() -> Iterator[Case]:
    """A force that begins with a phase; and a base that does, whose force is its amplitude times omega^2."""
    base, name = Sine(1e-3, 1.4, 0.7), "oscillator under a sine of force with a phase, event-driven"
    drives: tuple[tuple[str, Excitation, float], ...] = (
        (name, PointForce("tip", Sine(1.0, 1.4, 0.7)), 1.0),
        ("oscillator on a shaken base with a phase, event-driven", base, base.amplitude * (2 * math.pi * 1.4) ** 2),
    )
    for name, drive, force in drives:
        run = integrate(
            oscillator(DAMPING, OMEGA), drive, EventDriven(samples_per_cycle=100), 5.0, Recorder(("tip",))
        )  # fmt: skip
        yield Case(
            name, "derived here (steady sine and free motion)", "displacement after 5 s", "m",
            force * _forced(float(run.time[-1]), 1.4, 0.7), float(run["tip"][-1]), 1e-11, "rounding",
        )  # fmt: skip


def continued_sum() -> Iterator[Case]:
    """A run that goes on under a slow sine and a blow that comes after its cut: half a sine is two sines in turn."""
    impulse, duration, begin = 0.02, 0.1, 2.0
    drive = PointForce("tip", Sine(1.0, 0.5, 0.7)) + HammerBlow("tip", impulse, duration, begin=begin)
    record = Recorder(("tip",), interval=0.01)
    first = integrate(oscillator(DAMPING, OMEGA), drive, EventDriven(), 1.0, record)
    run = integrate(oscillator(DAMPING, OMEGA), drive, EventDriven(), 2.0, record, first.final_state)
    time, largest = float(run.time[-1]), 0.5 * math.pi * impulse / duration
    blow = sum(_forced(time - start, 0.5 / duration, 0.0) for start in (begin, begin + duration))
    yield Case(
        "oscillator under a sine and a blow, in two runs", "derived here (steady sines and free motions)",
        "displacement after 3 s", "m", _forced(time, 0.5, 0.7) + largest * blow, float(run["tip"][-1]), 1e-9,
        "polynomials within 1e-9 of the largest force of the blow",
    )  # fmt: skip


def _recurrence(history: NDArray[np.float64], dt: float, mass: float, force: float) -> float:
    """Last displacement of the oscillator under a history of force per unit mass, step by step.

    (1 - mass) a1 + mass a0 + (1 - force)(c v1 + k u1 - f1) + force (c v0 + k u0 - f0) = 0, with
    gamma = 1/2 - mass + force and beta = (1 - mass + force)^2/4.
    """
    gamma, beta = 0.5 - mass + force, (1 - mass + force) ** 2 / 4
    c, k = 2 * DAMPING * OMEGA, OMEGA**2
    u, v, a = 0.0, 0.0, float(history[0])
    for before, after in itertools.pairwise(history):
        u_free, v_free = u + dt * v + dt**2 * (0.5 - beta) * a, v + dt * (1 - gamma) * a
        load = (1 - force) * (after - c * v_free - k * u_free) + force * (before - c * v - k * u) - mass * a
        a = float(load / (1 - mass + (1 - force) * (gamma * dt * c + beta * dt**2 * k)))
        u, v = u_free + beta * dt**2 * a, v_free + gamma * dt * a
    return u


def stepped_drive() -> Iterator[Case]:
    """A step method under a sine of the base, against the same recurrence in plain Python."""
    base, steps = Sine(1e-3, 1.4, 0.7), 150
    for name, method, mass, force in (
        ("Newmark 1/4, 1/2", Newmark(0.02), 0.0, 0.0),
        ("generalised alpha, r = 0.5", GeneralizedAlpha(0.02, 0.5), 0.0, 1 / 3),
    ):
        run = integrate(oscillator(DAMPING, OMEGA), base, method, steps * method.dt, Recorder(("tip",)))
        history = -base.acceleration(method.dt * np.arange(steps + 1))
        yield Case(
            f"{name}: oscillator on a shaken base, {steps} steps", "derived here (the recurrence, step by step)",
            "displacement", "m", _recurrence(history, method.dt, mass, force), float(run["tip"][-1]), 1e-11,
            "150 steps of rounding",
        )  # fmt: skip


# ---- a base given by samples ---------------------------------------------------------------------

RAMP = RecordedBase([0.0, 3.0, 1.0, -2.0, 0.5], 0.4)
"""Samples of acceleration (m/s^2), 0.4 s apart."""


def _integrals(time: float) -> tuple[float, float]:
    """Displacement of the base, and of the undamped oscillator on it from rest: integrals of the broken line."""
    from scipy.integrate import quad

    knots = 0.4 * np.arange(5)

    def a(t: float) -> float:
        return float(np.interp(t, knots, RAMP.samples))

    def integral(weight: Callable[[float], float]) -> float:
        ends = [*knots[knots < time], time]
        return math.fsum(
            quad(lambda t: a(t) * weight(time - t), p, q, epsabs=1e-15, epsrel=1e-13)[0]
            for p, q in itertools.pairwise(ends)
        )

    return integral(lambda s: s), -integral(lambda s: math.sin(OMEGA * s) / OMEGA)


def recorded() -> Iterator[Case]:
    """The base's displacement is the double integral of its samples; Duhamel's integral is that of an oscillator."""
    yield Case(
        "recorded base: its own motion", "derived here (quadrature)", "displacement after 1.3 s", "m",
        _integrals(1.3)[0], float(RAMP.displacement(1.3)), 1e-12, "rounding",
    )  # fmt: skip
    a_radian = "(omega dt)^2/12 = 8e-7 a radian over 9 of them, of an amplitude some times this displacement"
    ways: tuple[tuple[str, Method, str, float, str], ...] = (
        ("event-driven", EventDriven(), "near", 1e-11, "rounding"), ("Newmark", Newmark(5e-4), "after", 5e-5, a_radian),
    )  # fmt: skip
    for way, method, when, bound, reason in ways:
        run = integrate(oscillator(0.0, OMEGA), RAMP, method, 1.5, Recorder(("tip",)))
        yield Case(
            f"oscillator on a recorded base, {way}", "derived here (Duhamel's integral)",
            f"displacement {when} 1.5 s", "m", _integrals(float(run.time[-1]))[1], float(run["tip"][-1]), bound, reason,
        )  # fmt: skip


# ---- the steady motion ---------------------------------------------------------------------------


def steady() -> Iterator[Case]:
    """Columns of a sweep for a steady sine above resonance, long enough for exp(-0.03 2 pi 200) = 4e-17."""
    curve = frequency_sweep(oscillator(DAMPING, OMEGA), 1e-3, [1.4], EventDriven(), duration=300.0, window=20.0)
    omega = 2 * math.pi * 1.4
    transfer = omega**2 / (OMEGA**2 - omega**2 + 2j * DAMPING * OMEGA * omega)
    amplitude, phase = 1e-3 * abs(transfer), math.atan2(transfer.imag, transfer.real)
    for column, reference in (("rms", amplitude / math.sqrt(2)), ("first_harmonic", amplitude), ("phase", phase)):
        yield Case(
            f"oscillator on a shaken base, sweep: {column.replace('_', ' ')}", "derived here (transfer function)",
            column.replace("_", " "), "rad" if column == "phase" else "m", reference, float(curve[column][0]),
            1e-9, "rounding; whole cycles, sums over equal samples are exact for a sine",
        )  # fmt: skip


CASES = (ball_stays, driven, continued_sum, stepped_drive, recorded, steady)
"""The cases of this subject, in the order of the table."""


STARTS = 20
GAPS = ((2e-3, 6e-3), (5e-3, 1e-3))
"""To the + and to the - side, m; the places of the first case are the smaller ones."""


PLACE = "place of the ball"


def place(response: Response) -> float:
    """Place of the ball at the end, m."""
    return float(response["ball"][-1])


def starts_of_a_ball() -> Iterator[Case]:
    """Nothing moves: a ball lies where each of its starts has put it."""
    study = parameter_study(
        shaken_floor(Rigid(0.5), (1.0, 1.0)), {"impactor.ball.gap": GAPS}, [place], starts=STARTS, cycles=3,
        excitation=Sine(0.0, 50.0),
    )  # fmt: skip
    # the gap of a case is divided as the unit draws divide 0 to 1
    draws = np.sort(unit_draws(STARTS, 1, 0)[:, 0, 0])
    places = [-minus + (plus + minus) * draws for plus, minus in GAPS]
    linear, unit = "derived here (linear in the draws)", "m"
    for case, (plus, minus) in enumerate(GAPS):
        for size, end, number in (("smallest", "low", 0), ("largest", "high", -1)):
            yield Case(
                f"starts in gaps of {1e3 * plus:g} mm and {1e3 * minus:g} mm: {size} place", linear, PLACE, unit,
                float(places[case][number]), float(study[f"place_{end}"][case]), 1e-12, "rounding",
            )  # fmt: skip
    # the k-th of the places from an end, for the largest k with 1 - 2 P(fewer than k of 20 tosses) of at least 0.9
    k = max(k for k in range(1, 11) if 1 - 2 * sum(math.comb(STARTS, i) for i in range(k)) / 2**STARTS >= 0.9)
    for side, end, number in (("lower", "low", k - 1), ("upper", "high", -k)):
        yield Case(
            f"interval of the median of {STARTS} starts: its {side} end", "David and Nagaraja (2003), binomial sums",
            PLACE, unit, float(places[0][number]), float(study[f"place_median_{end}"][0]), 1e-12, "rounding",
        )  # fmt: skip
    # the range of the case with the smallest value, as "... to ... over 20 starts"
    words = study_conclusions(study)[0].scatter.replace("\N{MINUS SIGN}", "-").split()
    for side, number in (("lower", 0), ("upper", -1)):
        yield Case(
            f"report of a parameter study: scatter of the smallest value, {side} end", linear, PLACE, unit,
            float(places[0][number]), float(words[-2 * number]), 5e-4, "four digits in the report",
        )  # fmt: skip


# ---- estimates with their intervals ---------------------------------------------------------------

MODE = np.array([5.3, 0.0029, 25.0, 0.3])
"""Frequency (Hz), damping ratio, amplitude and phase (rad) of a decay."""


def intervals_of_a_mode() -> Iterator[Case]:
    """Half the widths of the 90 % intervals of frequency and ratio, by least squares about the truth."""
    from scipy.special import stdtrit

    time = 0.01 * np.arange(2000)

    def decay(f: float, ratio: float, amplitude: float, phase: float) -> NDArray[np.float64]:
        omega = 2 * math.pi * f
        angle = omega * math.sqrt(1 - ratio**2) * time + phase
        return np.asarray(amplitude * np.exp(-ratio * omega * time) * np.cos(angle))

    noise, steps = 0.25 * np.random.default_rng(3).standard_normal(time.size), 1e-6 * np.diag(MODE)
    slopes = [(decay(*(MODE + step)) - decay(*(MODE - step))) / (2 * step.max()) for step in steps]
    q, r = np.linalg.qr(np.column_stack([np.ones(time.size), time, *slopes]))
    freedom, misfit = time.size - r.shape[0], noise - q @ (q.T @ noise)
    exact = np.linalg.norm(np.linalg.inv(r), axis=1)[2:4] * np.linalg.norm(misfit) / math.sqrt(freedom)
    (mode,) = identify_decay(time, decay(*MODE) + noise).modes
    half_widths = 0.5 * np.ptp([mode.frequency_interval, mode.damping_ratio_interval], axis=1)
    pairs = zip((exact * stdtrit(freedom, 0.95)).tolist(), half_widths.tolist(), strict=True)
    for (quantity, unit), (reference, computed) in zip(
        (("frequency", "Hz"), ("damping ratio", "1")), pairs, strict=True
    ):
        yield Case(
            f"free decay with white noise: interval of the {quantity}", "derived here (Cramer-Rao bound)",
            "half its width", unit, reference, computed, 1e-3, "the misfit is bent within the noise of 1 %",
        )  # fmt: skip


BETWEEN = (-0.2, 1.2)
"""Bounds of the parameter of a calibration."""


def calibrated() -> Iterator[Case]:
    """The ends of the interval of a parameter, of which the logarithm of the peak is linear, from starts that scatter.

    Of n = 5 starts of the standard deviation s the range is 2.32593 s (Tippett, 1925), and the median has the variance
    pi s^2/(2 n). A peak is distributed as Student's t with 4 degrees of freedom.
    """
    import xarray

    starts, spread, measured = 5, 0.2, np.array([0.45, 0.5, 0.58])
    grid = {"ratio": np.linspace(*BETWEEN, 13), "base.frequency": np.arange(4.0, 7.0)}
    peaks, half = np.exp(grid["ratio"])[:, None] * np.ones(3), math.exp(0.5 * 2.32593 * spread)
    values = {
        "peak": peaks,
        "peak_low": peaks / half,
        "peak_high": peaks * half,
        "peak_groups": np.ones_like(peaks),
        "failure": np.full(peaks.shape, ""),
    }
    cases = xarray.Dataset({name: (tuple(grid), column) for name, column in values.items()}, grid, {"starts": starts})
    (fit,) = calibration_of(cases, ["ratio"], grid["base.frequency"], np.exp(measured), np.arange(3), 0.02).parameters
    sigma = math.sqrt((1 + math.pi / (2 * starts)) * spread**2 + 0.02**2 + 0.03**2)

    ratio = np.linspace(*BETWEEN, 100_001)
    share = np.cumsum(np.prod((1 + ((measured - ratio[:, None]) / sigma) ** 2 / 4) ** -2.5, axis=1))
    for side, quantile, computed in (("lower", 0.05, fit.low), ("upper", 0.95, fit.high)):
        yield Case(
            f"calibration from the scatter of {starts} starts: {side} end of its interval",
            "derived here (integrals of Student's t)", "parameter", "1",
            float(np.interp(quantile, share / share[-1], ratio)), computed, 2e-3, "trapezoids of 1/120 of the bounds",
        )  # fmt: skip


READING_CASES = (
    subharmonic,
    impacts_of_a_cycle,
    force_across_a_window,
    laser_end,
    damping,
    starts_of_a_ball,
    intervals_of_a_mode,
    calibrated,
)
"""The cases of this subject, in the order of the table."""
