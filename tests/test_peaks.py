"""The peak of a cycle with step methods: largest and smallest displacement between samples, impacts included."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import oscillator

import femimpact as fi
from femimpact.integrators.stepping.arrays import Inputs
from femimpact.integrators.stepping.run import prepare, run_block

pytestmark = pytest.mark.impacts

FREQUENCY = 1.37


def extremes(system, bases, method, cycles, start=None):
    """Maximum and minimum of every finished cycle, one pair of columns a base; cycles that are not finished: nan."""
    steps = [math.ceil(cycles / (base.frequency * method.dt)) for base in bases]
    block = prepare(
        system, Inputs(bases, steps, [0] * len(bases), start or fi.State()), method,
        observed=system.point_row("mass"), ledger=False,
    )  # fmt: skip
    run_block(block)
    found = block.cycle_statistics
    own = (found.samples > 0) & (np.arange(found.samples.shape[0])[:, None] < cycles)
    return np.where(own, found.maximum, np.nan), np.where(own, found.minimum, np.nan)


def damped(damping=2.0, **more):
    """1 kg on 100 N/m, 10 % of critical damping: no transient is left after 60 s."""
    return oscillator(100.0, damping, **more)


# ---- between samples ---------------------------------------------------------------------------------


def steady_start(n, late):
    """A run of the average acceleration that is steady from its first step, and its amplitude.

    n steps a cycle; a crest lies `late` steps (0 to 1) after t = 0. The rule takes w for (2/dt) tan(w dt/2), exactly.
    """
    base, dt = fi.Sine(1e-3, FREQUENCY), 1 / (FREQUENCY * n)
    felt = 2 / dt * math.tan(base.omega * dt / 2)
    phasor = base.amplitude * base.omega**2 / (100.0 - felt**2 + 2j * felt)
    phase = np.pi / 2 - late * 2 * np.pi / n - np.angle(phasor)
    turned = phasor * np.exp(1j * phase)
    start = fi.State(displacement=[turned.imag], velocity=[(1j * felt * turned).imag])
    return replace(base, phase=phase), fi.Newmark(dt), start, abs(phasor)


@pytest.mark.parametrize("n", [16, 40, 100])
def test_the_crest_is_that_of_the_cubic_through_both_ends_with_their_rates(n):
    base, method, start, amplitude = steady_start(n, 0.5)
    high, low = extremes(damped(), [base], method, 6, start)
    # half-way between two samples at A c, c = cos(w dt/2), with rates +-(2/dt) A tan sin: A c + (A/2) tan sin
    c = math.cos(np.pi / n)
    crest = amplitude * (1 + c * c) / (2 * c)
    # rounding of some hundred steps
    np.testing.assert_allclose(high[:6, 0], crest, rtol=1e-12)
    np.testing.assert_allclose(low[:6, 0], -crest, rtol=1e-12)


def test_interpolation_alone_is_of_order_four_wherever_the_samples_lie():
    counts = np.array([16, 32, 64])
    for late in (0.5, 0.3, 0.11):
        error, missed = [], []
        for n in counts:
            base, method, start, amplitude = steady_start(int(n), late)
            error.append(extremes(damped(), [base], method, 6, start)[0][5, 0] / amplitude - 1)
            missed.append(1 - math.cos(2 * np.pi * min(late, 1 - late) / n))
        assert np.polyfit(np.log(counts), np.log(np.abs(error)), 1)[0] == pytest.approx(-4, abs=0.1)
        # the largest sample is off by far more, and by order two
        assert np.all(np.abs(error) < 0.2 * np.array(missed))


@pytest.mark.parametrize(
    "method", [fi.Newmark(1), fi.HHT(1), fi.WBZ(1), fi.GeneralizedAlpha(1), fi.MoreauJean(1)], ids=repr
)
def test_peaks_of_smooth_motion_are_of_the_order_of_the_method(method):
    base, counts = fi.Sine(1e-3, FREQUENCY), np.array([39.7, 81.3, 157.9, 322.1])
    exact = base.amplitude * base.omega**2 / abs(100.0 - base.omega**2 + 2j * base.omega)
    error = []
    for n in counts:
        curve = fi.frequency_sweep(
            damped(), 1e-3, [FREQUENCY], replace(method, dt=1 / (FREQUENCY * n)), 60, at="mass", ledger=False
        )
        error.append(curve.peak[0] / exact - 1)
    # steps that divide no cycle: with bare samples the errors would be those of chance, (w dt)^2/8 at most
    assert np.polyfit(np.log(counts), np.log(np.abs(error)), 1)[0] == pytest.approx(-2, abs=0.05)


# ---- the cycle ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [fi.Newmark(7.3e-3), fi.MoreauJean(7.3e-3), fi.HHT(7.3e-3)], ids=repr)
def test_a_cycle_begins_and_ends_between_samples(method):
    free, speed = oscillator(0.0), 0.3
    bases = [fi.Sine(0.0, f) for f in (1.37, 1.0, 2.1)]
    for beside in (bases, bases[:1]):
        high, low = extremes(free, beside, method, 20, fi.State(velocity=[speed]))
        end = np.arange(1, 21)[:, None] / np.array([base.frequency for base in beside])
        # a straight line: exact to the rounding of some 3000 steps
        np.testing.assert_allclose(high[:20], speed * end, rtol=1e-11)
        np.testing.assert_allclose(low[1:20], speed * end[:-1], rtol=1e-11)
        assert np.all(low[0] == 0.0)


def test_a_mirrored_motion_has_mirrored_extremes():
    wall = fi.Stop("wall", "mass", (4e-3, 6e-3), fi.KelvinVoigt(0.7, 0.02))
    other = replace(wall, gap=(6e-3, 4e-3))
    bases, method = [fi.Sine(0.0, FREQUENCY)], fi.Newmark(1.7e-3, refine=4)
    found = [
        extremes(damped(0.2, stops=[stop]), bases, method, 8, fi.State(velocity=[sign * 0.3]))
        for stop, sign in ((wall, 1), (other, -1))
    ]
    np.testing.assert_array_equal(found[0][0], -found[1][1])
    np.testing.assert_array_equal(found[0][1], -found[1][0])


# ---- with contacts -----------------------------------------------------------------------------------


def test_a_refined_step_has_the_crest_of_its_fine_steps():
    # without force every step is exact: what the coarse run does in touch is what the fine one does
    law = fi.KelvinVoigt(restitution=0.7, contact_time=0.02)
    system = oscillator(0.0, stops=[fi.Stop("wall", "mass", (0.1, 0.1), law)])
    bases, start = [fi.Sine(0.0, f) for f in (1.0, 1.37)], fi.State(velocity=[0.5])
    coarse = extremes(system, bases, fi.Newmark(8e-3, refine=16), 3, start)
    fine = extremes(system, bases, fi.Newmark(5e-4), 3, start)
    for one, other in zip(coarse, fine, strict=True):
        # a collision hangs on where in a step it begins: each of the two or three multiplies the rounding by some 30
        np.testing.assert_allclose(one[:3], other[:3], rtol=0, atol=1e-10)
    # the deepest points of the touch, 3 mm beyond the gap, are among them
    assert np.all(coarse[0][0] > 0.102)
    assert np.all(np.min(coarse[1][:3], axis=0) < -0.101)


@pytest.mark.parametrize("n", [30.7, 211.3])
def test_the_peak_at_a_rigid_stop_is_its_gap(n):
    system = damped(0.4, stops=[fi.Stop("wall", "mass", (math.inf, 1e-3), fi.Rigid(0.6))])
    high, low = extremes(system, [fi.Sine(1e-3, FREQUENCY)], fi.MoreauJean(1 / (FREQUENCY * n)), 40)
    # whether the samples fall short of it or lie beyond; x = w, so that its instant is met to rounding
    np.testing.assert_allclose(low[20:40, 0], -1e-3, rtol=1e-11)
    assert np.all(high[20:40, 0] > 0)


def zigzag(mass, e, speeds, gap, cycles):
    """Extremes per cycle of a free mass with a free ball between its walls: straight lines between the impacts."""
    (v, u), w, x, time = speeds, 0.0, 0.0, 0.0
    times, places = [0.0], [0.0]
    while time < cycles:
        hit = (math.copysign(gap, u - v) - x) / (u - v)
        time, w, x = time + hit, w + v * hit, math.copysign(gap, u - v)
        times.append(time)
        places.append(w)
        impulse = (1 + e) * (u - v) / (1 + 1 / mass)
        v, u = v + impulse, u - impulse / mass
    highs, lows = [], []
    for k in range(cycles):
        inside = [p for t, p in zip(times, places, strict=True) if k < t < k + 1]
        ends = [float(np.interp(t, times, places)) for t in (k, k + 1)]
        highs.append(max(inside + ends))
        lows.append(min(inside + ends))
    return np.array(highs), np.array(lows), len(times) - 2


@pytest.mark.parametrize("dt", [1.3e-2, 3.1e-3, 7.7e-4])
def test_peaks_at_impacts_of_a_ball_are_of_order_one(dt):
    ball = fi.Impactor("ball", "mass", 1.5, 0.05, fi.Rigid(0.9))
    system = oscillator(0.0, impactors=[ball])
    start, cycles = fi.State(velocity=[0.1], ball_velocity=[-0.3]), 3
    high, low = extremes(system, [fi.Sine(0.0, 1.0)], fi.MoreauJean(dt), cycles, start)
    exact_high, exact_low, impacts = zigzag(1.5, 0.9, (0.1, -0.3), 0.05, cycles)
    assert impacts > 5
    # the first peak lies at the first impact, after a motion that is exact
    assert high[0, 0] == pytest.approx(exact_high[0], rel=1e-12)
    # each impact moves what follows by a jump of velocity, 0.7 m/s at most, times half a step
    bound = impacts * 0.7 * dt / 2
    np.testing.assert_allclose(high[:cycles, 0], exact_high, rtol=0, atol=bound)
    np.testing.assert_allclose(low[:cycles, 0], exact_low, rtol=0, atol=bound)


def test_peaks_in_a_compliant_contact_are_of_order_two():
    # energy-consistent, without loss: the deepest point is gap + v sqrt(m/k), at a rate that is continuous
    law = fi.KelvinVoigt(restitution=1.0, contact_time=0.05)
    system = oscillator(0.0, stops=[fi.Stop("wall", "mass", (0.1, 0.1), law)])
    stiffness = system.contacts[0].parameters.stiffness
    exact, steps = 0.1 + 0.5 / math.sqrt(stiffness), 0.05 / np.array([11.3, 22.9, 46.1, 93.7, 187.1])
    for dt in steps:
        method = fi.Newmark(float(dt), contact="energy-consistent")
        high = extremes(system, [fi.Sine(0.0, 1.0)], method, 1, fi.State(velocity=[0.5]))[0][0, 0]
        # (w dt)^2/6 of the depth for the period and for the step in which the wall is met
        assert abs(high - exact) < (math.pi * dt / 0.05) ** 2 / 6 * (exact - 0.1)


@pytest.mark.parametrize(
    "method", [fi.Newmark(2e-3), fi.HHT(2e-3, alpha=-0.3), fi.WBZ(2e-3, alpha=-1.0), fi.GeneralizedAlpha(2e-3, 0.0)],
    ids=repr,
)  # fmt: skip
def test_no_sample_lies_beyond_the_extremes_of_its_cycle(method):
    ball = fi.Impactor("ball", "mass", 0.4, 2e-3, fi.KelvinVoigt(0.6, 0.03))
    system, base, start = damped(0.5, impactors=[ball]), fi.Sine(3e-3, 2.31), fi.State(ball_velocity=[0.2])
    high, low = extremes(system, [base], method, 20, start)
    run = fi.integrate(system, base, method, 20 / 2.31 + method.dt, fi.Recorder(channels=("mass",)), initial=start)
    assert len(run.impacts.time) > 0
    for k in range(20):
        inside = run["mass"][(run.time * 2.31 > k) & (run.time * 2.31 < k + 1)]
        # crests are looked for only where the rate changes sign: with numerical damping too, none is elsewhere
        assert low[k, 0] <= inside.min() <= inside.max() <= high[k, 0]


@pytest.mark.parametrize("method", [fi.Newmark(1e-3), fi.Newmark(4e-3, refine=8), fi.MoreauJean(1e-3)], ids=repr)
def test_a_case_has_the_same_peaks_alone_and_beside_others(method):
    law = fi.Rigid(0.7) if isinstance(method, fi.MoreauJean) else fi.KelvinVoigt(0.7, 0.02)
    system = damped(0.4, impactors=[fi.Impactor("ball", "mass", 0.2, 2e-3, law)])
    bases = [fi.Sine(2e-3, f) for f in (1.2, FREQUENCY, 1.5)]
    beside = extremes(system, bases, method, 8)
    for c, base in enumerate(bases):
        for one, other in zip(extremes(system, [base], method, 8), beside, strict=True):
            np.testing.assert_array_equal(one[:8, 0], other[:8, c])
