"""Starts in the shape of a mode, under a force that lets go, and with a speed."""

from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi

pytestmark = pytest.mark.impacts

EXACT = fi.EventDriven()
STILL = fi.Sine(0.0, 5.0)


@pytest.fixture(scope="module")
def ball():
    return reduced(with_ball(REFERENCE), 4)


@pytest.fixture(scope="module")
def bare(ball):
    return fi.without_impactors(ball)


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_start_in_a_mode_decays_in_it_alone(bare, mode):
    state = fi.State.of_mode(bare, mode, 2e-3)
    modes = fi.solve_modes(bare, 4)
    ratio, omega = modes.damping_ratio[mode - 1], 2 * np.pi * modes.natural_frequency[mode - 1]
    run = fi.integrate(bare, STILL, EXACT, 5.0 * 2 * np.pi / omega, fi.Recorder(("tip", "mid")), state)
    damped = omega * np.sqrt(1 - ratio**2)
    # x'' + 2 z w x' + w^2 x = 0 from x = A at rest
    t = run.time
    exact = np.exp(-ratio * omega * t) * (np.cos(damped * t) + ratio * omega / damped * np.sin(damped * t))
    np.testing.assert_allclose(run["tip"], 2e-3 * exact, rtol=0.0, atol=1e-10 * 2e-3)
    np.testing.assert_allclose(run["mid"], run["mid"][0] * exact, rtol=0.0, atol=1e-10 * 2e-3)


def test_the_amplitude_is_that_of_the_place_asked_for(bare):
    state = fi.State.of_mode(bare, 2, -1e-3, at="mid")
    assert bare.point_row("mid") @ state.displacement == pytest.approx(-1e-3, rel=1e-12)


def test_a_force_bends_a_cantilever_by_its_stiffness():
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    system = fi.assemble(fi.Structure(beam), elements=12)
    state = fi.State.under_force(system, 0.1)
    # F L^3 / (3 E I), to which the cubic elements are exact
    exact = 0.1 * 0.23**3 / (3 * 70e9 * 0.020 * 1e-9 / 12)
    assert system.point_row("tip") @ state.displacement == pytest.approx(exact, rel=1e-9)
    half = fi.State.under_force(system, 0.1, at="mid")
    # Maxwell: the tip under a force at mid-span moves as mid-span under one at the tip
    assert system.point_row("tip") @ half.displacement == pytest.approx(
        system.point_row("mid") @ state.displacement, rel=1e-9
    )


def test_when_the_force_lets_go_the_place_swings_no_farther(bare):
    state = fi.State.under_force(bare, 0.05)
    run = fi.integrate(bare, STILL, EXACT, 1.0, fi.Recorder("tip"), state)
    assert run["tip"][0] == pytest.approx(np.abs(run["tip"]).max(), rel=1e-6)
    # the work of a force that grows from zero
    assert run.energy.stored[0] == pytest.approx(0.5 * 0.05 * run["tip"][0], rel=1e-9)


def test_a_speed_is_that_of_a_base_that_is_stopped(ball):
    state = fi.State.with_speed(ball, 0.3)
    run = fi.integrate(ball, STILL, EXACT, 0.02, fi.Recorder(("ball", "ball.velocity", "tip")), state)
    # the ball flies on until it meets its wall
    free = run.time < (run.impacts.time[0] if len(run.impacts) else np.inf)
    np.testing.assert_allclose(run["ball"][free], 0.3 * run.time[free], rtol=0.0, atol=1e-12)
    assert run.energy.stored[0] <= 0.5 * (ball.total_mass + 0.00343) * 0.3**2


@pytest.mark.parametrize(("gap", "middle"), [(2e-3, 0.0), ((3e-3, 1e-3), 1e-3)])
@pytest.mark.parametrize("start", ["mode", "force"])
def test_a_ball_begins_in_the_middle_of_the_box_that_is_carried_along(gap, middle, start):
    carried = fi.Impactor("carried", at="tip", mass=3e-3, gap=gap, contact=fi.Rigid(0.6))
    hung = fi.Absorber("hung", at="mid", mass=1e-3, stiffness=3.0, damping=0.01)
    system = reduced(replace(REFERENCE, impactors=(carried,), absorbers=(hung,)), 4)
    # by many times the gap
    state = fi.State.of_mode(system, 1, 0.02) if start == "mode" else fi.State.under_force(system, 0.3)
    run = fi.integrate(system, STILL, EXACT, 0.05, fi.Recorder(("tip", "mid", "carried", "hung")), state)
    assert abs(run["tip"][0]) > 5e-3
    assert run["carried"][0] - run["tip"][0] == pytest.approx(middle, abs=1e-12)
    # its spring at its own length
    assert run["hung"][0] == pytest.approx(run["mid"][0], rel=1e-12)
    without = fi.State.of_mode(fi.without_impactors(system), 1, 0.02)
    assert without.ball_displacement is None
