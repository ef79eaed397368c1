"""Regimes of synthetic tables of impacts whose motion is known, and of one real run."""

from types import SimpleNamespace

import numpy as np
import pytest

import femimpact as fi
from femimpact.response.regimes import RegimeCriteria, classify, impacts_per_cycle, significant

FREQUENCY = 5.2
CYCLES = 60
END = CYCLES / FREQUENCY
NOTHING = SimpleNamespace(start=np.zeros(0), end=np.zeros(0))


def table(time, side, speed, impulse=None, impactor=None, dropped=0):
    """Impacts as the classifier reads them; phase from the time."""
    time, side, speed = (np.asarray(values, dtype=float) for values in (time, side, speed))
    return SimpleNamespace(
        time=time,
        phase=np.mod(2 * np.pi * FREQUENCY * time, 2 * np.pi),
        impactor=np.full(time.size, "ball") if impactor is None else np.asarray(impactor),
        side=side,
        approach_speed=speed,
        impulse=3e-3 * speed if impulse is None else np.asarray(impulse, dtype=float),
        dropped=dropped,
    )


def repeating(places, period, noise=0.0, seed=1):
    """Impacts at (cycle, side, speed) that repeat after so many cycles."""
    rng = np.random.default_rng(seed)
    rows = [(cycle + start, side, speed) for start in range(0, CYCLES, period) for cycle, side, speed in places]
    cycle, side, speed = np.array(rows).T
    cycle = cycle + noise * rng.uniform(-1, 1, cycle.size) / (2 * np.pi)
    return table(cycle / FREQUENCY, side, speed * (1 + noise * rng.uniform(-1, 1, cycle.size)))


def kind_of(impacts, sticking=NOTHING, start=0.0, **options):
    return classify(impacts, sticking, FREQUENCY, start, END, RegimeCriteria(**options))


@pytest.mark.parametrize("start", [0.0, 7.3 / FREQUENCY, 19.25 / FREQUENCY])
@pytest.mark.parametrize("noise", [0.0, 2e-3])
@pytest.mark.parametrize(
    ("impacts", "period", "places"),
    [
        (1, 1, [(0.3, 1, 0.2)]),
        (2, 1, [(0.1, 1, 0.2), (0.6, -1, 0.22)]),
        (3, 2, [(0.1, 1, 0.2), (0.8, -1, 0.15), (1.4, 1, 0.3)]),
        (2, 2, [(0.1, 1, 0.2), (1.1, 1, 0.22)]),  # a period doubled: the speeds alternate
        (5, 8, [(0.1, 1, 0.2), (2.8, -1, 0.15), (3.4, 1, 0.3), (5.0, -1, 0.1), (7.7, -1, 0.3)]),
    ],
)
def test_known_motions_are_found_in_any_window(impacts, period, places, noise, start):
    regime = kind_of(repeating(places, period, noise), start=start)
    assert (regime.kind, regime.impacts, regime.cycles) == ("periodic", impacts, period)
    assert regime.label == f"{impacts}:{period} periodic"
    assert "0.01 rad" in regime.criterion
    assert "4 repeats" in regime.criterion


def test_a_phase_that_wraps_does_not_break_a_period():
    impacts = repeating([(0.0, 1, 0.2), (0.5, -1, 0.2)], 1, noise=2e-3)
    assert np.ptp(impacts.phase[impacts.side > 0]) > 6.0
    assert kind_of(impacts, start=5.5 / FREQUENCY).label == "2:1 periodic"


def test_two_balls_may_hit_at_the_same_instant():
    one, other = (repeating([(0.3, 1, 0.2)], 1, noise=2e-3, seed=seed) for seed in (1, 2))
    time = np.concatenate([one.time, other.time])
    order = np.argsort(time)
    names = np.repeat(["left", "right"], CYCLES)[order]
    both = table(time[order], np.ones(time.size), np.full(time.size, 0.2), impactor=names)
    assert kind_of(both).label == "2:1 periodic"


def test_small_impacts_do_not_count_towards_the_period():
    large = repeating([(0.3, 1, 0.2)], 1)
    rng = np.random.default_rng(3)
    time = np.concatenate([large.time, np.sort(rng.uniform(0, END, 25))])
    speed = np.concatenate([large.approach_speed, np.full(25, 0.01)])
    order = np.argsort(time)
    impacts = table(time[order], np.ones(time.size), speed[order])
    assert np.count_nonzero(significant(impacts)) == CYCLES
    assert kind_of(impacts).label == "1:1 periodic"
    assert kind_of(impacts, significant_share=0.0).kind == "chaotic"
    assert impacts_per_cycle(impacts, FREQUENCY, 0.0, END) == pytest.approx((CYCLES + 25) / CYCLES)


def test_random_impacts_are_irregular():
    rng = np.random.default_rng(4)
    time = np.sort(rng.uniform(0, END, 3 * CYCLES))
    regime = kind_of(table(time, rng.choice([-1, 1], time.size), rng.uniform(0.1, 0.3, time.size)))
    assert regime.kind == "chaotic"
    assert regime.label == "chaotic (no period up to 8 cycles)"
    assert (regime.impacts, regime.cycles) == (0, 0)


def test_a_slow_drift_is_no_period():
    # 0.3 % of a cycle each: close to the next impact, far from the last
    time = np.arange(CYCLES) * 1.0005 / FREQUENCY
    assert kind_of(table(time, np.ones(CYCLES), np.full(CYCLES, 0.2))).kind == "chaotic"


def test_a_motion_that_stops_is_no_period():
    impacts = repeating([(0.3, 1, 0.2)], 1)
    kept = impacts.time < 0.6 * END
    assert kind_of(table(impacts.time[kept], impacts.side[kept], impacts.approach_speed[kept])).kind == "chaotic"


def bounces(seed=None):
    """A bouncing ball in every cycle: speed and interval fall by the restitution."""
    rng = np.random.default_rng(seed)
    rows = []
    for cycle in range(CYCLES):
        speed, at = 0.2 if seed is None else rng.uniform(0.1, 0.2), cycle if seed is None else cycle + rng.uniform(0, 1)
        for _ in range(12):
            rows.append((at / FREQUENCY, speed))
            at, speed = at + 1.5 * speed, 0.6 * speed
    return np.array(sorted(rows)).T


def test_bouncing_balls_chatter():
    time, speed = bounces()
    regime = kind_of(table(time, np.ones(time.size), speed))
    assert regime.kind == "chatter"
    assert regime.label == "chatter, 5:1 periodic"  # 0.6^5 is below a tenth
    assert "slower and sooner" in regime.criterion
    # the same impacts from one wall to the other are a motion across the gap
    assert kind_of(table(time, np.resize([1, -1], time.size), speed)).kind == "periodic"


def test_chatter_need_not_repeat():
    rng = np.random.default_rng(5)
    time, speed = bounces()
    start = np.repeat(rng.uniform(0, 0.3, CYCLES), 12) / FREQUENCY
    regime = kind_of(table(time + start, np.ones(time.size), speed))
    assert (regime.kind, regime.cycles) == ("chatter", 0)


def test_sticking_in_half_of_the_cycles():
    impacts = repeating([(0.2, 1, 0.2)], 2)
    start = np.arange(0.3, CYCLES, 2) / FREQUENCY
    sticking = SimpleNamespace(start=start, end=start + 0.4 / FREQUENCY)
    regime = kind_of(impacts, sticking)
    assert (regime.kind, regime.label) == ("sticking", "sticking, 1:2 periodic")
    assert "30 of 60 cycles" in regime.criterion
    few = SimpleNamespace(start=start[:-1], end=start[:-1] + 0.4 / FREQUENCY)
    assert kind_of(impacts, few).kind == "periodic"


def test_sticking_that_lasts_has_no_end():
    lasting = SimpleNamespace(start=np.array([0.4 * END]), end=np.array([np.nan]))
    assert kind_of(table([], [], []), lasting).label == "sticking"
    assert (
        kind_of(table([], [], []), SimpleNamespace(start=np.array([0.7 * END]), end=np.array([np.nan]))).kind
        == "no impacts"
    )


def test_nothing_happens():
    assert kind_of(table([], [], [])).kind == "no impacts"


def test_what_cannot_be_told_is_not_called_irregular():
    impacts = repeating([(0.3, 1, 0.2)], 1)
    assert classify(impacts, NOTHING, FREQUENCY, 0.0, 3.5 / FREQUENCY).kind == "undecided"
    assert classify(impacts, NOTHING, FREQUENCY, 0.0, 5 / FREQUENCY).label == "1:1 periodic"
    cut = table(impacts.time[:30], impacts.side[:30], impacts.approach_speed[:30], dropped=30)
    assert kind_of(cut).label == "undecided: 30 impacts met a full table"
    assert classify(cut, NOTHING, FREQUENCY, 0.0, 29.3 / FREQUENCY).label == "1:1 periodic"
    with pytest.raises(fi.InputError, match="end"):
        classify(impacts, NOTHING, FREQUENCY, 1.0, 1.0)
