"""Mean and peak force of a window: those of the force in it, however long a contact lasts and wherever it is cut."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball
from random_structures import random_case

import femimpact as fi
from femimpact import core
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.block import inputs_of, new_block, run_block
from femimpact.integrators.event_driven.store import FormStore, outputs_of
from femimpact.response.impacts import TOTAL_COLUMNS

pytestmark = pytest.mark.impacts

EXACT = fi.EventDriven()
MASS, GRAVITY = 3.43e-3, 9.81
WEIGHT = MASS * GRAVITY
COMPLIANT, RIGID = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3), fi.Rigid(0.4)
FORCES = fi.Recorder(("contact_force", "ball.absolute_velocity"), ledger=False)


def floor(law, modes=3, damping=0.05):
    """The reference beam with a ball that lies on a floor in its tip, under gravity; transients die within seconds."""
    structure = with_ball(REFERENCE, contact=law, gap=(10.0, 0.0), acceleration=-GRAVITY)
    return reduced(replace(structure, damping=fi.Rayleigh(damping, modes=(1, 2))), modes, 10)


def preloaded(law, overlap=2e-4):
    """1 kg at 2 Hz, pressed on a stop by its spring: at rest without it, it would be 0.2 mm behind the wall."""
    stop = fi.Stop("stop", "mass", (-overlap, math.inf), law)
    stiffness = (4.0 * math.pi) ** 2
    return fi.reduce(
        fi.System.from_matrices(
            [[1.0]], [[2.0]], [[stiffness]], points={"mass": [1.0]}, base_load=[1.0], stops=[stop]
        ), 1,
    )  # fmt: skip


def harmonic_peak(force):
    """Largest value of a sine about its mean, from whole cycles of samples."""
    turned = np.fft.rfft(np.abs(force)) / force.size
    return turned[0].real + 2.0 * np.abs(turned[1:]).max()


def smooth_peak(force):
    """Largest value of a force: by the polynomial through nine samples about the largest one, if it is smooth there."""
    force = np.abs(force)
    i = int(force.argmax())
    around = force[max(i - 4, 0) : i + 5]
    if around.size < 9 or np.any(around == 0.0):
        return float(force[i])
    polynomial = np.polynomial.Polynomial.fit(np.arange(-4.0, 5.0), around, 8)
    roots = polynomial.deriv().roots()
    inside = np.abs(roots.imag) + np.maximum(np.abs(roots.real) - 1.0, 0.0) < 1e-9
    return float(np.max(polynomial(roots[inside].real), initial=force[i]))


# ---- contacts that last through the window -----------------------------------------------------------


@pytest.mark.parametrize("law", [COMPLIANT, RIGID], ids=["compliant", "rigid"])
def test_a_ball_at_rest_on_its_wall_weighs_on_it(law):
    # exp(-0.05 2 pi 5.3 33) of the transient is left: nothing; a ball's momentum over whole cycles is unchanged
    system = floor(law)
    curve = fi.frequency_sweep(system, 2e-4, [4.0, 4.7], EXACT, cycles=200)
    np.testing.assert_allclose(curve.cycle_mean_force, WEIGHT, rtol=1e-12)
    assert np.all(curve.impacts_per_cycle == 0.0)
    for i, frequency in enumerate(curve.frequency):
        # 150 cycles: the window is the last 50
        run = fi.integrate(system, fi.Sine(2e-4, float(frequency)), EXACT, 150.0 / float(frequency), FORCES)
        assert run.statistics.cycle_mean_force == pytest.approx(WEIGHT, rel=1e-11)
        expected = harmonic_peak(run["contact_force"][-640:])
        assert run.statistics.peak_force == pytest.approx(expected, rel=1e-9)
        assert curve.peak_force[i] == pytest.approx(expected, rel=1e-9)
        assert expected > 1.01 * WEIGHT


@pytest.mark.parametrize("law", [fi.KelvinVoigt(stiffness=2e4, restitution=0.5), fi.Rigid(0.3)], ids=["soft", "rigid"])
def test_a_preloaded_stop_carries_its_preload(law):
    system, spring = preloaded(law), (4.0 * math.pi) ** 2
    wall = 2e4 if isinstance(law, fi.KelvinVoigt) else math.inf
    # the spring's deflection is what the wall leaves of the overlap
    preload = spring * 2e-4 / (1.0 + spring / wall)
    curve = fi.frequency_sweep(system, 1e-5, [3.0], EXACT, cycles=150, at="mass")
    assert curve.cycle_mean_force[0] == pytest.approx(preload, rel=1e-12)
    run = fi.integrate(system, fi.Sine(1e-5, 3.0), EXACT, 40.0, fi.Recorder(("stop.contact_force",), ledger=False))
    assert run.statistics.peak_force == pytest.approx(harmonic_peak(run["stop.contact_force"][-640:]), rel=1e-9)
    assert curve.peak_force[0] == pytest.approx(run.statistics.peak_force, rel=1e-9)


def test_newmark_comes_to_the_same_statistics_at_its_order():
    # the ball stays on its wall, while the beam's transient goes on
    system, base = floor(COMPLIANT, 1, 0.01), fi.Sine(5e-5, 4.0)
    exact = fi.integrate(system, base, EXACT, 3.0, FORCES).statistics
    steps = np.array([4e-4, 2e-4, 1e-4])
    found = [fi.integrate(system, base, fi.Newmark(dt, allow_coarse_step=True), 3.0, FORCES).statistics for dt in steps]
    for name in ("cycle_mean_force", "peak_force"):
        error = np.array([getattr(one, name) for one in found]) - getattr(exact, name)
        assert np.abs(error[-1]) < 1e-4 * getattr(exact, name)
        assert np.polyfit(np.log(steps), np.log(np.abs(error)), 1)[0] == pytest.approx(2.0, abs=0.3)


# ---- windows that begin and end within contacts ------------------------------------------------------


def parts_in_contact(run):
    """Fractions of the run in the middle of each contact and sticking phase that has ended."""
    begun = np.concatenate([run.impacts.time, run.sticking.start])
    lasted = np.concatenate([run.impacts.duration, run.sticking.end - run.sticking.start])
    return (begun + 0.37 * lasted)[lasted > 0.0]


@pytest.mark.parametrize("law", [COMPLIANT, fi.KelvinVoigt(stiffness=20.0, damping=0.2), fi.Rigid(0.5)], ids=repr)
def test_the_impulse_in_a_window_is_the_change_of_momentum_and_the_weight(law):
    # near resonance the beam throws its ball up and catches it again
    system, base = floor(law, 2, 0.01), fi.Sine(1e-3, 5.0)
    method = replace(EXACT, samples_per_cycle=4096)
    times = parts_in_contact(fi.integrate(system, base, method, 3.0, FORCES))
    cut = 0
    for time in times[:: max(times.size // 8, 1)]:
        if not 0.0 < time < 2.5:
            continue
        # the window is the last third of a number of samples that three divides
        length = 3 * round(0.5 * float(time) * base.frequency * 4096) / (base.frequency * 4096)
        run = fi.integrate(system, base, method, length, FORCES)
        (begin, end), speed = run.window, run["ball.absolute_velocity"]
        first = int(np.searchsorted(run.time, begin - 1e-9))
        cut += run["contact_force"][first] != 0.0
        impulse = MASS * (speed[-1] - speed[first] + GRAVITY * (end - begin))
        # rounding of speeds that are far larger than what gravity adds in a short window
        assert run.statistics.cycle_mean_force * (end - begin) == pytest.approx(impulse, rel=1e-9, abs=1e-14)
        if isinstance(law, fi.KelvinVoigt):
            # a polynomial through 49 us apart of half a sine of 2 ms or more: (pi/41)^9
            sampled = smooth_peak(run["contact_force"][first:])
            assert run.statistics.peak_force == pytest.approx(sampled, rel=1e-9)
    assert cut >= 2


# ---- random structures -------------------------------------------------------------------------------


def run_in_windows(case, windows, rows=0):
    """A run of a random case, once for each window (s): the sums of each, and the block with its tables."""
    system, drive, count = case.system, drive_of(case.system, case.excitation), len(windows)
    observed = outputs_of(system, system.point_row(system.default_place))
    store = FormStore([system], [drive], [observed])
    u, v, y, y_rate = case.initial.relative_to_base(system, case.excitation)
    balls = len(system.balls)
    inputs = inputs_of(
        [drive] * count, [system.contacts] * count,
        window=np.array(windows),
        position=np.tile(np.concatenate([u, y[:balls]]), (count, 1)),
        velocity=np.tile(np.concatenate([v, y_rate[:balls]]), (count, 1)),
    )  # fmt: skip
    block = new_block(store, inputs, EXACT, None, rows)
    samples = round(case.duration / float(block.grid.interval[0]))
    run_block(block, np.zeros(count, dtype=np.int64), np.full(count, samples), np.full(count, 1e7))
    assert np.all(block.stopped == core.events.DONE), case.description
    return {name: block.cases.totals[:, i] for i, name in enumerate(TOTAL_COLUMNS)}, block


@pytest.mark.parametrize("seed", range(0, 100, 3))
def test_windows_that_are_cut_within_contacts_add_up_to_the_run(seed):
    case = random_case(seed)
    always = (-math.inf, math.inf)
    totals, block = run_in_windows(case, [always], 1_000_000)
    impacts, sticking = (
        table[:count] for table, count in zip(block.tables[:2], block.tables.number.tolist(), strict=True)
    )
    # what has ended, and what goes on
    pushed = np.zeros(len(case.system.contacts))
    np.add.at(pushed, impacts[:, 1].astype(int), impacts[:, 5])
    np.add.at(pushed, sticking[:, 0].astype(int), sticking[:, 4])
    pushed += np.where(block.cases.state[0] != 0.0, block.cases.touch[0, core.events.PUSHED], 0.0)
    rounding = 1e-12 * np.abs(impacts[:, 5]).sum() + 1e-18
    # a sticking phase that another rigid pair ends while its bounces would still go on has no row
    rigid = block.pairs.rigid
    whole = ~rigid | (np.count_nonzero(rigid) == 1)
    words = case.description
    np.testing.assert_allclose(totals["force_time"][0][whole], pushed[whole], rtol=1e-9, atol=rounding, err_msg=words)
    # one cut in the middle of the contact that lasts longest, one in that of the last sticking phase or contact
    longest = impacts[impacts[:, 7].argmax()] if len(impacts) else np.zeros(9)
    last = sticking[-1, 2:4].mean() if len(sticking) else (impacts[-1, 0] + 0.5 * impacts[-1, 7] if len(impacts) else 0)
    first, second = sorted([float(longest[0] + 0.5 * longest[7]), float(last)])
    parts, _ = run_in_windows(case, [(-math.inf, first), (first, second), (second, math.inf)])
    np.testing.assert_array_equal(parts["count"].sum(axis=0), totals["count"][0])
    for name in ("force_time", "impulse", "approach_speed"):
        np.testing.assert_allclose(parts[name].sum(axis=0), totals[name][0], rtol=1e-12, atol=rounding)
    # the tolerance of the search for a peak
    np.testing.assert_allclose(parts["peak_force"].max(axis=0), totals["peak_force"][0], rtol=1e-9)


@pytest.mark.parametrize("seed", range(1, 100, 3))
def test_no_sample_of_a_force_is_above_its_peak(seed):
    case = random_case(seed)
    names = tuple(f"{pair.name}.contact_force" for pair in case.system.contacts)
    method = replace(EXACT, samples_per_cycle=512)
    run = fi.integrate(case.system, case.excitation, method, case.duration, fi.Recorder(names), case.initial)
    inside = run.time >= run.window[0]
    for pair, name in zip(case.system.contacts, names, strict=True):
        statistics = run.statistics_of[pair.name]
        if isinstance(pair.law, fi.Rigid) and statistics.count:
            assert math.isnan(statistics.peak_force)
            continue
        largest = np.abs(run[name][inside]).max(initial=0.0)
        # below 1e-20 N nothing pushes
        assert largest <= statistics.peak_force * (1.0 + 1e-9) + 1e-20, case.description
        # of contacts that began and ended in the window, and of parts of others
        own = (run.impacts.impactor == pair.name) & (run.impacts.time >= run.window[0])
        assert statistics.peak_force >= run.impacts.peak_force[own].max(initial=0.0), case.description
