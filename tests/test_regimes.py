"""Regimes of tables of impacts whose motion is known, and of a run whose orbit has a closed form."""

import dataclasses
import math

import numpy as np
import pytest
from builders import impact_table

import femimpact as fi
from femimpact.response.impacts import StickingPhases
from femimpact.response.regimes import RegimeCriteria, classify, impacts_per_cycle, significant

FREQUENCY = 5.2
CYCLES = 60
END = CYCLES / FREQUENCY


def table(time, side, speed, **more):
    return impact_table(FREQUENCY, time, side, speed, **more)


def repeating(places, period, noise=0.0, seed=1):
    """Impacts at (cycle, side, speed) that repeat after so many cycles, times and speeds changed by a little noise."""
    rng = np.random.default_rng(seed)
    rows = [(cycle + start, side, speed) for start in range(0, CYCLES, period) for cycle, side, speed in places]
    cycle, side, speed = np.array(rows).T
    cycle = cycle + noise * rng.uniform(-1, 1, cycle.size) / (2 * np.pi)
    return table(cycle / FREQUENCY, side, speed * (1 + noise * rng.uniform(-1, 1, cycle.size)))


def sticking_at(start, end):
    """Sticking phases (s) of one ball at its + wall."""
    ones = np.ones(len(start))
    return StickingPhases(np.full(len(start), "ball"), ones, np.array(start), np.array(end), ones, ones)


def regime_of(impacts, sticking=None, start=0.0, end=END, **options):
    return classify(impacts, sticking or StickingPhases.none(), FREQUENCY, start, end, RegimeCriteria(**options))


# ---- periods --------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [0.0, 7.3 / FREQUENCY, 19.25 / FREQUENCY])
@pytest.mark.parametrize("noise", [0.0, 2e-3])
@pytest.mark.parametrize(
    ("impacts", "period", "places"),
    [
        (1, 1, [(0.3, 1, 0.2)]),
        (2, 1, [(0.1, 1, 0.2), (0.6, -1, 0.22)]),
        (2, 1, [(0.0, 1, 0.3), (0.5, -1, 0.2)]),  # on the wrap of the phase: half of the noisy ones before it
        (3, 2, [(0.1, 1, 0.2), (0.8, -1, 0.15), (1.4, 1, 0.3)]),
        (4, 2, [(0.1, 1, 0.3), (0.6, -1, 0.25), (1.15, 1, 0.28), (1.55, -1, 0.35)]),
        (2, 2, [(0.1, 1, 0.2), (1.1, 1, 0.22)]),  # a period doubled: the speeds alternate
        (3, 3, [(0.1, 1, 0.3), (0.9, -1, 0.5), (2.2, 1, 0.2)]),
        (3, 8, [(0.1, 1, 0.3), (0.12, -1, 0.5), (4.0, 1, 0.2)]),
        (5, 8, [(0.1, 1, 0.2), (2.8, -1, 0.15), (3.4, 1, 0.3), (5.0, -1, 0.1), (7.7, -1, 0.3)]),
    ],
)
def test_a_motion_that_repeats_is_named_by_its_smallest_period_in_any_window(impacts, period, places, noise, start):
    regime = regime_of(repeating(places, period, noise), start=start)
    assert (regime.kind, regime.impacts, regime.cycles) == ("periodic", impacts, period)
    assert regime.label == f"{impacts}:{period} periodic"
    for number in ("0.1 of the largest impulse", "0.01 rad", "4 repeats"):
        assert number in regime.criterion


def test_a_phase_that_wraps_does_not_break_a_period():
    impacts = repeating([(0.0, 1, 0.2), (0.5, -1, 0.2)], 1, noise=2e-3)
    assert np.ptp(impacts.phase[impacts.side > 0]) > 6.0
    assert regime_of(impacts, start=5.5 / FREQUENCY).label == "2:1 periodic"


def test_tolerances_decide_what_repeats():
    impacts = repeating([(0.2, 1, 0.3), (0.7, -1, 0.3)], 1, noise=3e-2)
    assert regime_of(impacts).kind == "chaotic"
    assert regime_of(impacts, phase_tolerance=0.1, speed_tolerance=0.1).label == "2:1 periodic"
    two = repeating([(0.2, 1, 0.3), (1.2, 1, 0.31)], 2)
    assert regime_of(two).label == "2:2 periodic"
    assert regime_of(two, longest_period=1).cycles == 0
    assert regime_of(two, speed_tolerance=0.1).label == "1:1 periodic"


def test_small_impacts_do_not_count_towards_the_period():
    large = repeating([(0.2, 1, 0.3), (0.7, -1, 0.3)], 1)
    rng = np.random.default_rng(3)
    small = 25
    impacts = table(
        np.concatenate([large.time, rng.uniform(0, END, small)]),
        np.concatenate([large.side, np.ones(small)]),
        np.concatenate([large.approach_speed, np.full(small, 0.02)]),
    )
    assert np.count_nonzero(significant(impacts)) == 2 * CYCLES
    assert np.count_nonzero(significant(impacts, share=0.0)) == 2 * CYCLES + small
    assert impacts_per_cycle(impacts, FREQUENCY, 0.0, END) == pytest.approx((2 * CYCLES + small) / CYCLES)
    assert regime_of(impacts).label == "2:1 periodic"
    assert regime_of(impacts, significant_share=0.0).kind == "chaotic"


def test_two_balls_at_the_same_instant_repeat_each_for_itself():
    rng = np.random.default_rng(5)
    time = np.repeat((np.arange(CYCLES) + 0.3) / FREQUENCY, 2) + 1e-9 * rng.uniform(-1, 1, 2 * CYCLES)
    names = np.tile(["left", "right"], CYCLES)
    both = table(time, 1, np.where(names == "left", 0.3, 0.2), impactor=names)
    # rounding decides which of the two is the first
    assert set(both.impactor[::2]) == {"left", "right"}
    assert regime_of(both).label == "2:1 periodic"


def test_without_a_phase_of_the_excitation_the_time_decides():
    periodic = repeating([(0.1, 1, 0.2), (0.6, -1, 0.22)], 1, noise=2e-3)
    drifting = table(np.arange(CYCLES) * 1.0005 / FREQUENCY, 1, 0.2)
    for impacts, kind in ((periodic, "periodic"), (drifting, "chaotic")):
        unknown = dataclasses.replace(impacts, phase=np.full(len(impacts), math.nan))
        assert regime_of(unknown) == regime_of(impacts)
        assert regime_of(unknown).kind == kind


# ---- no period ------------------------------------------------------------------------------------


def test_of_random_impacts_the_label_says_what_was_tested():
    rng = np.random.default_rng(4)
    time = rng.uniform(0, END, 3 * CYCLES)
    impacts = table(time, rng.choice([-1, 1], time.size), rng.uniform(0.1, 0.3, time.size))
    regime = regime_of(impacts)
    assert (regime.kind, regime.label) == ("chaotic", "no period up to 8 cycles")
    assert (regime.impacts, regime.cycles) == (0, 0)
    assert "up to 8 cycles" in regime.criterion
    # a window of 20 cycles can show four repeats of 4 cycles at most, one of 9 four of 1 cycle
    for cycles, tested in ((20, "4 cycles"), (9, "1 cycle")):
        short = regime_of(impacts, end=cycles / FREQUENCY)
        assert short.label == f"no period up to {tested}"
        assert f"up to {tested}," in short.criterion


@pytest.mark.parametrize("drift", [5e-4, -5e-4])
def test_a_slow_drift_is_no_period(drift):
    # 3e-3 rad a cycle: close to the next impact, 0.2 rad from the last
    cycle = np.arange(CYCLES)
    assert regime_of(table((0.2 + cycle * (1 + drift)) / FREQUENCY, 1, 0.2)).kind == "chaotic"


def test_a_motion_that_stops_is_no_period():
    impacts = repeating([(0.3, 1, 0.2)], 1)
    kept = impacts.time < 0.6 * END
    assert regime_of(table(impacts.time[kept], 1, 0.2)).kind == "chaotic"


def test_what_cannot_be_told_is_undecided():
    impacts = repeating([(0.3, 1, 0.2)], 1)
    assert regime_of(table([], 1, 0.2)).label == "no impacts"
    assert regime_of(impacts, end=3.5 / FREQUENCY).kind == "undecided"
    assert regime_of(impacts, end=5 / FREQUENCY).label == "1:1 periodic"
    cut = table(impacts.time[:30], 1, 0.2, dropped=30)
    assert regime_of(cut).label == "undecided: 30 impacts met a full table"
    assert regime_of(cut, end=29.3 / FREQUENCY).label == "1:1 periodic"
    # the table was full before the window began: no impacts in it mean nothing
    assert regime_of(cut, start=END, end=2 * END).kind == "undecided"
    with pytest.raises(fi.InputError, match="end"):
        regime_of(impacts, start=1.0, end=1.0)
    with pytest.raises(fi.InputError, match="repeats"):
        regime_of(impacts, repeats=0)


# ---- chatter and sticking -------------------------------------------------------------------------


def bounces(cycles, restitution=0.7, count=12):
    """Times and speeds (cycles, count) of a ball on a wall: v_k = e^k v_0, intervals 2 v_k/g."""
    speed = 0.3 * restitution ** np.arange(count)
    after = np.concatenate([[0.0], np.cumsum(speed[1:])])
    # the geometric series fits into 0.6 of a cycle
    return (cycles[:, None] + 0.1 + 0.6 * after / after[-1]) / FREQUENCY, np.tile(speed, (cycles.size, 1))


@pytest.mark.parametrize(("restitution", "repeated"), [(0.6, 5), (0.7, 7)])  # 0.6^5 and 0.7^7 are below a tenth
def test_geometric_bounces_in_every_cycle_are_chatter(restitution, repeated):
    time, speed = bounces(np.arange(CYCLES), restitution)
    regime = regime_of(table(time.ravel(), 1, speed.ravel()))
    assert (regime.kind, regime.label) == ("chatter", f"chatter, {repeated}:1 periodic")
    assert "slower and sooner" in regime.criterion
    # in every third cycle only: less than half
    time, speed = bounces(np.arange(0, CYCLES, 3), restitution)
    assert regime_of(table(time.ravel(), 1, speed.ravel())).kind == "periodic"


def test_chatter_need_not_repeat():
    time, speed = bounces(np.arange(CYCLES))
    jitter = np.random.default_rng(5).uniform(0, 0.2, (CYCLES, 1)) / FREQUENCY
    regime = regime_of(table((time + jitter).ravel(), 1, speed.ravel()))
    assert (regime.kind, regime.label, regime.cycles) == ("chatter", "chatter", 0)


def test_alternate_walls_or_growing_intervals_are_no_chatter():
    time, speed = bounces(np.arange(CYCLES))
    # from one wall to the other it is a motion across the gap
    assert regime_of(table(time.ravel(), np.tile([1, -1], time.size // 2), speed.ravel())).kind == "periodic"
    backwards = (2 * np.arange(CYCLES)[:, None] + 1) / FREQUENCY - time[:, ::-1]
    assert regime_of(table(backwards.ravel(), 1, speed.ravel())).kind == "periodic"


def test_sticking_in_half_of_the_cycles_is_sticking():
    impacts, nothing = repeating([(0.2, 1, 0.2)], 2), table([], 1, 0.2)
    start = np.arange(0.3, CYCLES, 2) / FREQUENCY
    regime = regime_of(impacts, sticking_at(start, start + 0.4 / FREQUENCY))
    assert (regime.kind, regime.label) == ("sticking", "sticking, 1:2 periodic")
    assert "30 of 60 cycles" in regime.criterion
    assert regime_of(nothing, sticking_at(start, start + 0.4 / FREQUENCY)).kind == "sticking"
    # in one cycle fewer
    few = sticking_at(start[:-1], start[:-1] + 0.4 / FREQUENCY)
    assert regime_of(impacts, few).label == "1:2 periodic"


@pytest.mark.parametrize(("begun", "label"), [(0.0, "sticking"), (0.4, "sticking"), (0.7, "no impacts")])
def test_sticking_that_lasts_has_no_end(begun, label):
    assert regime_of(table([], 1, 0.2), sticking_at([begun * END], [np.nan])).label == label


# ---- of a run -------------------------------------------------------------------------------------


@pytest.mark.impacts
def test_the_closed_form_orbit_is_two_impacts_per_cycle():
    # mass ratio 0.1, restitution 0.6, damping 0.01, at resonance, total clearance 24: |u| = 7.527982
    ball = fi.Impactor("ball", "mass", 0.1, 12.0, fi.Rigid(0.6))
    system = fi.System.from_matrices([[1.0]], [[0.02]], [[1.0]], points={"mass": [1.0]}, impactors=[ball])
    push, start = fi.PointForce("mass", fi.Sine(1.0, 1 / (2 * math.pi), 0.3)), fi.State([0.0], [0.0], [0.0], [5.0])
    run = fi.integrate(system, push, fi.EventDriven(), 300 * math.pi, fi.Recorder(channels=("mass",)), start)
    assert run.regime.label == "2:1 periodic"
    last = run.impacts.approach_speed[-1]
    assert last == pytest.approx(2 * 7.527982 * (1 + 0.1) / (1 + 0.6), rel=1e-6)
    np.testing.assert_allclose(np.abs(np.diff(run.impacts.phase[-5:])), math.pi, atol=1e-6)


@pytest.mark.impacts
@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(2e-4)])
def test_impacts_of_a_record_have_no_phase(bouncing, method):
    sine = fi.Sine(3e-3, 5.2)
    samples = sine.acceleration(np.arange(400) * 5e-3)
    base = fi.RecordedBase(samples, 5e-3, initial_velocity=float(sine.velocity(0.0)))
    run = fi.integrate(bouncing, base, method, 2.0, fi.Recorder(channels=("tip",)))
    assert len(run.impacts) > 3
    assert np.isnan(run.impacts.phase).all()
    assert "phase" not in repr(run.impacts)
    turns = np.mod(2 * np.pi * base.frequency * run.impacts.time, 2 * np.pi)
    known = dataclasses.replace(run.impacts, phase=turns)
    assert classify(known, run.sticking, base.frequency, *run.window) == run.regime
