"""Random structures, event by event, against an integrator that shares nothing with the event-driven method."""

from functools import cache

import numpy as np
import pytest
from random_structures import random_case, resting_case
from reference_comparison import Comparison, compare
from reference_motion import reference_motion

import femimpact as fi

pytestmark = pytest.mark.impacts

SEEDS = range(100, 140)


@cache
def compared(seed: int) -> Comparison:
    case = random_case(seed)
    return compare(case.system, case.excitation, case.duration, case.initial)


@pytest.mark.parametrize("seed", SEEDS)
def test_positions_are_those_of_the_reference_up_to_the_fifth_touch(seed):
    # 1e-13 in each of up to 2000 steps of the reference, some tenfold at each of four touches; a start from rest, where
    # the steady answer cancels the free one, loses as many digits as the motion is smaller than that answer
    assert compared(seed).difference < 1e-8, random_case(seed).description


def test_most_seeds_are_compared_through_three_touches_or_more():
    assert sum(compared(seed).touches >= 3 for seed in SEEDS) >= 20


@pytest.mark.parametrize("seed", range(16))
def test_a_ball_that_lies_on_its_wall_goes_where_the_reference_says_when_the_wall_leaves_it(seed):
    case = resting_case(seed)
    found = compare(case.system, case.excitation, case.duration, case.initial, most_touches=4)
    assert found.touches >= 1
    assert found.difference < 1e-8, case.description


# ---- the reference itself -------------------------------------------------------------------------


def oscillator(*laws: fi.Rigid | fi.KelvinVoigt) -> fi.System:
    """One damped mass with a ball for each law, at gaps that no two of them meet at once."""
    balls = [fi.Impactor(f"ball{i}", "m", 0.1, 1e-3 * (1 + 0.3 * i), law) for i, law in enumerate(laws)]
    return fi.System.from_matrices(1.0, 0.2, 400.0, points={"m": [1.0]}, impactors=balls)


TIMES = np.linspace(0.0, 0.3, 31)
PUSH = fi.PointForce("m", fi.Sine(2.0, 3.0))


def test_the_reference_is_the_exact_motion_before_any_touch():
    system = fi.System.from_matrices(1.0, 0.0, 400.0, points={"m": [1.0]})
    found = reference_motion(system, fi.Sine(0.0, 1.0), TIMES, fi.State([1e-3], [0.02]))
    exact = 1e-3 * np.cos(20.0 * TIMES) + 0.02 / 20.0 * np.sin(20.0 * TIMES)
    # 1e-13 in each of some hundreds of steps
    np.testing.assert_allclose(found.position[:, 0], exact, atol=1e-10 * 1.5e-3)


def test_a_rigid_impact_of_the_reference_is_the_limit_of_a_short_contact_beside_another_contact():
    """Two rules for two laws in one system: a Kelvin-Voigt contact of time T departs by O(T) from the impact."""
    soft = fi.KelvinVoigt(restitution=0.5, contact_time=0.05)
    start = fi.State([0.0], [0.02], [0.0, 0.0], [-0.05, 0.06])

    def motion(law: fi.Rigid | fi.KelvinVoigt) -> np.ndarray:
        found = reference_motion(oscillator(law, soft), PUSH, TIMES, start, most_touches=50, most_steps=20_000)
        assert found.why == "all times"
        assert {pair for _, pair, _ in found.touches} == {0, 1}
        return found.position

    rigid = motion(fi.Rigid(0.6))
    apart = [
        np.max(np.abs(motion(fi.KelvinVoigt(restitution=0.6, contact_time=time)) - rigid)) for time in (1e-4, 1e-5)
    ]
    # a tenth of the time, a tenth of the departure; what is of second order leaves some per cent
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.05)
    assert apart[1] < 1e-3 * np.max(np.abs(rigid))


def test_simultaneous_impacts_of_the_reference_are_symmetric():
    """Two balls meet a mass equal to theirs from both sides at once: e = 1, and it stays where it is."""
    balls = [fi.Impactor(name, "m", 1.0, gap, fi.Rigid(1.0)) for name, gap in (("one", 1.0), ("two", 2.0))]
    system = fi.System.from_matrices(1.0, 0.0, 1e-6, points={"m": [1.0]}, impactors=balls)
    start = fi.State([0.0], [0.0], [0.0, -1.0], [1.0, -1.0])
    found = reference_motion(system, fi.Sine(0.0, 1.0), np.linspace(0.0, 1.2, 13), start)
    assert [round(speed, 9) for _, _, speed in found.touches] == [1.0, 1.0]
    np.testing.assert_allclose([time for time, _, _ in found.touches], 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.position[-1], [0.0, 0.8, -1.8], atol=1e-11)


def test_mixed_pairs_of_one_mass_move_as_the_reference_says():
    system = oscillator(fi.Rigid(0.6), fi.KelvinVoigt(restitution=0.5, contact_time=0.05))
    found = compare(system, PUSH, 1.0, fi.State([0.0], [0.02], [0.0, 0.0], [-0.05, 0.06]))
    assert found.touches >= 3
    assert found.difference < 1e-8
