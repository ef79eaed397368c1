"""What is read of motions and curves: amplitudes, impact statistics, a laser, damping, a scan's amplitude ratio."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from femimpact.calibration import scan_restitution
from femimpact.contact import KelvinVoigt, Rigid
from femimpact.excitation import Sine
from femimpact.fem.assembly import assemble
from femimpact.identification import DampingEstimate, amplitude_ratio_damping, fit_one_pole, half_power
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.integrate import integrate
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.laser import Laser
from femimpact.response.response import Recorder, Response
from femimpact.response.signals import CycleStatistics, steady_motion
from femimpact.structure.damping import Rayleigh
from femimpact.structure.structure import Impactor, Structure
from femimpact.sweep import frequency_sweep
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors
from femimpact.validation.beams import ROOTS, beam_frequency, uniform_beam
from femimpact.validation.case import Case
from femimpact.validation.impacts import FREQUENCY, GRAVITY, shaken_floor

__all__ = ["CASES"]

# ---- amplitudes ----------------------------------------------------------------------------------


def subharmonic(column: str) -> Case:
    """A motion 0.2 + sin(w t) + 0.4 sin(w t/2) that repeats after two cycles: their largest |w| differ."""
    samples, cycles = 400, 24
    angle = 2 * math.pi / samples * np.arange(samples * cycles)
    motion = (0.2 + np.sin(angle) + 0.4 * np.sin(angle / 2)).reshape(cycles, samples)
    sine, cosine = (wave(angle).reshape(cycles, samples) for wave in (np.sin, np.cos))
    sums = (motion.max(axis=1), motion.min(axis=1), *((motion * by).sum(axis=1) for by in (motion, sine, cosine)))
    columns = [values[:, None] for values in (*sums, np.full(cycles, float(samples)))]
    found = steady_motion(CycleStatistics(*columns), np.array([8]))
    reference = {
        "peak": float(np.max(np.abs(motion))), "rms": math.sqrt(0.2**2 + 0.5 * (1 + 0.4**2)), "first_harmonic": 1.0,
    }[column]  # fmt: skip
    return Case(
        f"motion that repeats after two cycles: {column.replace('_', ' ')}", "derived here (orthogonal sines)",
        column.replace("_", " "), "m", reference, float(getattr(found, column)[0]), 1e-12,
        "sums over equal samples are exact for sines: rounding only",
    )  # fmt: skip


# ---- impacts -------------------------------------------------------------------------------------


def _bouncing(restitution: float) -> Response:
    """A ball of 1 kg that bounces once a cycle, on its orbit from the start; see `ball_bounces_once_a_cycle`."""
    pull = math.pi * GRAVITY * (1 - restitution) / (1 + restitution)
    omega, theta = 2 * math.pi * FREQUENCY, math.acos(1 / 1.3)
    table = Sine(1.3 * pull / omega**2, FREQUENCY, theta)
    rebound = GRAVITY / (2 * FREQUENCY) - table.amplitude * omega * math.cos(theta)
    start = State(ball_displacement=[0.0], ball_velocity=[rebound])
    system = shaken_floor(restitution, (1.0, 0.0), -GRAVITY)
    # half a cycle more: no impact lies at an end of the last third
    return integrate(system, table, EventDriven(), 60.75 / FREQUENCY, initial=start)


def impulse_of_a_cycle() -> Case:
    """One impact in each cycle turns g T of speed."""
    found = _bouncing(0.5).statistics.mean_impulse
    return Case(
        "ball on a vibrating table, once a cycle: impulse", "derived here (momentum of a cycle)", "mean impulse", "N s",
        GRAVITY / FREQUENCY, found, 1e-9, "rounding",
    )  # fmt: skip


def force_of_a_cycle() -> Case:
    """What a wall carries on average is the ball's weight, but for where the window cuts a cycle."""
    run = _bouncing(0.5)
    first, last = run.window
    inside = int(np.count_nonzero((run.impacts.time >= first) & (run.impacts.time < last)))
    return Case(
        "ball on a vibrating table, once a cycle: mean force", "derived here (momentum)", "cycle-averaged force", "N",
        inside * GRAVITY / FREQUENCY / (last - first), run.statistics.cycle_mean_force, 1e-9, "rounding",
    )  # fmt: skip


def force_across_a_window(event_driven: bool) -> Case:
    """A contact that began long before the window counts in it from its start on: weight and own change of momentum."""
    table = Sine(0.4 * GRAVITY / (2 * math.pi * FREQUENCY) ** 2 if event_driven else 0.0, FREQUENCY)
    ball = Impactor(
        "ball",
        "floor",
        1.0,
        (1.0, 0.0),
        Rigid(0.4) if event_driven else KelvinVoigt(stiffness=1e4, damping=1.0),
        acceleration=-GRAVITY,
    )
    system = System.from_matrices([[1.0]], [[0.1]], [[1.0]], points={"floor": [0.0]}, impactors=[ball])
    method = EventDriven() if event_driven else Newmark(1e-4)
    run = integrate(system, table, method, 1.0125, initial=State.static())
    first, last = run.window
    change = float(table.velocity(last) - table.velocity(first))
    return Case(
        f"ball that lies on a {'vibrating table, event-driven' if event_driven else 'table at rest, Newmark'}: "
        "mean force", "derived here (momentum)", "cycle-averaged force", "N", GRAVITY + change / (last - first),
        run.statistics.cycle_mean_force, 1e-9, "rounding",
    )  # fmt: skip


# ---- a laser -------------------------------------------------------------------------------------


def laser_end(side: int) -> Case:
    """What a laser reads of a larger motion ends at the middle of its range, and half the range from there."""
    system = shaken_floor(1.0, (1.0, 1.0))
    run = integrate(system, Sine(0.0, 1.0), EventDriven(), 10.0, Recorder(("ball",)), State(ball_velocity=[0.3]))
    moved = Laser("ball", range=0.6, offset=0.2).measure(run).displacement
    return Case(
        f"laser whose range of 600 mm has its middle at 200 mm: {'largest' if side > 0 else 'smallest'} reading",
        "derived here (middle and half the range)", "displacement", "m", 0.2 + side * 0.3,
        float(np.max(moved) if side > 0 else np.min(moved)), 1e-12, "rounding",
    )  # fmt: skip


# ---- damping -------------------------------------------------------------------------------------

RATIO, NATURAL = 0.0029, 5.3
"""The paper's damping ratio and natural frequency (Hz) without the ball."""


def one_pole() -> Case:
    """The fit finds the ratio of an exact curve of one pole."""
    f = np.linspace(5.2, 5.4, 41)
    curve = np.abs(f**2 / (NATURAL**2 - f**2 + 2j * RATIO * NATURAL * f))
    return Case(
        "one-pole fit of an exact curve", "derived here (transfer function)", "damping ratio", "1", RATIO,
        fit_one_pole(f, curve).ratio, 1e-8, "tolerance of the least-squares solver",
    )  # fmt: skip


def bandwidth() -> Case:
    """Half-power points of an exact curve: roots of a quadratic in the square of the frequency ratio."""
    # r^4/((1 - r^2)^2 + (2 z r)^2) is half its largest value 1/(4 z^2 (1 - z^2)), at r^2 = 1/(1 - 2 z^2)
    half = 0.5 / (4 * RATIO**2 * (1 - RATIO**2))
    low, high = np.sort(np.roots([1 - 1 / half, -2 + 4 * RATIO**2, 1.0]).real)
    f = NATURAL * np.linspace(0.985, 1.015, 20_001)
    curve = np.abs(f**2 / (NATURAL**2 - f**2 + 2j * RATIO * NATURAL * f))
    return Case(
        "half-power width of an exact curve", "derived here (roots of a quadratic)", "damping ratio", "1",
        float(high - low) / 4 * (1 - 2 * RATIO**2), half_power(f, curve).ratio, 3e-6,
        "20,001 points: the peak lies within 1.5e-6 f0 / 2 of one, crossings by straight lines",
    )  # fmt: skip


def drop_of_the_peak() -> Case:
    """Five times less amplitude is five times the damping: the paper's own estimate."""
    empty = DampingEstimate(RATIO, NATURAL, (RATIO, RATIO), "given")
    return Case(
        "amplitude ratio of 5", "derived here (peak of one pole)", "damping ratio", "1", 5 * RATIO,
        amplitude_ratio_damping(empty, 1.0, 0.2).ratio, 1e-12, "rounding",
    )  # fmt: skip


def scan_without_touch() -> Case:
    """A scan whose ball touches nothing, beside a sweep at three times the amplitude."""
    first, second = (beam_frequency(root) for root in ROOTS[:2])
    damping = Rayleigh(ratio=0.05, frequencies=(first, second))
    ball = Impactor("ball", "tip", 1e-3, 0.1, Rigid(0.5))
    structure = Structure(uniform_beam(), impactors=(ball,), damping=damping)
    frequencies = first * np.linspace(0.9, 1.1, 9)
    bare = without_impactors(reduce(assemble(structure, 4), 1))
    empty = frequency_sweep(bare, 3e-4, frequencies, EventDriven(), 60)
    # the scan takes the amplitude of its base from the sweep that it is given
    scan = scan_restitution(
        structure, [0.5], replace(empty, amplitude=1e-4), elements=4, modes=1, frequencies=frequencies, cycles=60
    )  # fmt: skip
    return Case(
        "scan of a ball that touches nothing", "derived here (linearity)", "amplitude ratio", "1", 3.0,
        float(scan.amplitude_ratio[0]), 1e-7, "40 cycles leave 4e-6 of the transient, in both alike",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    *(partial(subharmonic, column) for column in ("peak", "rms", "first_harmonic")),
    impulse_of_a_cycle,
    force_of_a_cycle,
    *(partial(force_across_a_window, event_driven) for event_driven in (True, False)),
    *(partial(laser_end, side) for side in (1, -1)),
    one_pole,
    bandwidth,
    drop_of_the_peak,
    scan_without_touch,
)
"""The cases of this subject, in the order of the table."""
