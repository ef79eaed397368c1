"""Contact laws: closed forms against the differential equation, and one collision in the time loop."""

import math

import numpy as np
import pytest
from builders import reduced, with_ball
from scipy.integrate import quad, solve_ivp

import femimpact as fi
from femimpact import core
from femimpact.contact.collision import contact_time_of, damping_ratio_for_restitution, restitution_of_damping_ratio
from femimpact.contact.law import resolve

pytestmark = pytest.mark.impacts


def collision(damping_ratio):
    """Restitution and contact time of x'' + 2 z x' + x = 0, x'(0) = 1, left at zero force (m = k = 1)."""

    def force(_, state):
        return state[0] + 2 * damping_ratio * state[1]

    force.terminal, force.direction = True, -1
    start = [0.0, 1.0] if damping_ratio > 0 else [1e-300, 1.0]
    run = solve_ivp(
        lambda t, s: [s[1], -force(t, s)], (0, 1e3), start, events=force, method="DOP853", rtol=1e-12, atol=1e-14
    )
    return -run.y_events[0][0, 1], run.t_events[0][0]


@pytest.mark.parametrize("z", [0.0, 0.01, 0.1, 0.3, 0.7, 0.95, 1.0, 1.05, 1.5, 3.0])
def test_restitution_and_contact_time_are_those_of_the_differential_equation(z):
    expected, time = collision(z)
    # the integrator's tolerance of 1e-12 over a dozen steps
    assert restitution_of_damping_ratio(z) == pytest.approx(expected, rel=1e-8)
    assert contact_time_of(1.0, 2 * z, 1.0) == pytest.approx(time, rel=1e-8)


def test_restitution_is_smooth_across_critical_damping():
    z = 1.0 + np.array([-3e-6, -2e-6, -1e-6, -1e-7, 0, 1e-7, 1e-6, 2e-6, 3e-6])
    e = np.array([restitution_of_damping_ratio(float(value)) for value in z])
    # d(ln e)/dz at z = 1: e = exp(-2 z a), a = 1 - (z-1)/3, so -2 (1 - 1/3); curvature adds 1e-11, acos rounds to 1e-10
    np.testing.assert_allclose(np.log(e), -2.0 - 4.0 / 3.0 * (z - 1.0), rtol=0, atol=1e-9)


@pytest.mark.parametrize("e", [1e-4, 0.01, 0.135, math.exp(-2), 0.136, 0.3, 0.6, 0.9, 0.999, 1.0])
def test_damping_ratio_for_a_restitution_is_the_inverse(e):
    # brentq to 1e-15, times the slope of e
    assert restitution_of_damping_ratio(damping_ratio_for_restitution(e)) == pytest.approx(e, rel=1e-8)


@pytest.mark.parametrize("e", [0.05, 0.3, 0.6, 0.95, 1.0])
def test_a_law_from_restitution_and_contact_time_has_both(e):
    numbers = resolve(fi.KelvinVoigt(restitution=e, contact_time=2e-3), effective_mass=3e-3)
    assert numbers.contact_time == pytest.approx(2e-3, rel=1e-9)
    assert numbers.restitution == pytest.approx(e, rel=1e-9)
    w0 = math.sqrt(numbers.stiffness / 3e-3)
    z = numbers.damping / (2 * math.sqrt(numbers.stiffness * 3e-3))
    observed, time = collision(z)
    # the integrated equation again, now with units
    assert time / w0 == pytest.approx(2e-3, rel=1e-7)
    assert observed == pytest.approx(e, rel=1e-7)


def test_the_three_complete_pairs_are_one_law():
    first = resolve(fi.KelvinVoigt(restitution=0.6, contact_time=2e-3), 3e-3)
    second = resolve(fi.KelvinVoigt(stiffness=first.stiffness, restitution=0.6), 3e-3)
    third = resolve(fi.KelvinVoigt(stiffness=first.stiffness, damping=first.damping), 3e-3)
    for other in (second, third):
        # rounding of square roots
        assert other[:-1] == pytest.approx(first[:-1], rel=1e-12)
        assert other.over_speed == first.over_speed == ()


def test_the_wall_never_pulls():
    depth, rate = np.meshgrid(np.linspace(0.0, 1e-3, 11), np.linspace(-1.0, 1.0, 21))
    law, depth, rate = fi.KelvinVoigt(stiffness=1e3, damping=5.0), depth.ravel(), rate.ravel()
    force = [fi.contact.contact_force(law, d, r, 0.1, 1.0) for d, r in zip(depth, rate, strict=True)]
    free = 1e3 * depth + 5.0 * rate
    assert np.any(free < 0)
    np.testing.assert_array_equal(force, np.where((free > 0) & (depth > 0), free, 0.0))


@pytest.mark.parametrize(
    ("x", "expected"),
    [(0.0, (0.0, 0.0)), (1e-3, (0.0, 0.0)), (-3e-3, (0.0, 0.0)), (1.5e-3, (0.5e-3, 1.0)), (-3.5e-3, (0.5e-3, -1.0))],
)
def test_penetration_begins_at_either_gap(x, expected):
    # subtraction near 1e-3
    assert core.penetration(x, 1e-3, 3e-3) == pytest.approx(expected, abs=1e-18)


@pytest.mark.parametrize("x", [0.0, 5e-4, 1e-3, 2.2e-3, -1e-3, -3e-3, -4.1e-3])
def test_the_switching_springs_potential_is_the_integral_of_its_force(x):
    k0, k, plus, minus = 7.0, 900.0, 1e-3, 3e-3
    wall = plus if x > 0 else -minus

    def force(s):
        return core.switching_stiffness(s, plus, minus, k0, k) * s

    work = quad(force, 0.0, x, points=[wall] if abs(x) > abs(wall) else None, epsabs=1e-18)[0]
    # quadrature of a piecewise linear force
    assert core.switching_potential(x, plus, minus, k0, k) == pytest.approx(work, rel=1e-10, abs=1e-18)


# ---- one collision, stepped ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def one_mode(reference):
    """One mode: the ball meets exactly the effective mass that the law is made for."""
    return fi.reduce(fi.assemble(reference, elements=10), modes=1)


def thrown(system, dt, speed=0.1, start=0.0, duration=0.06, every=1, **record):
    """The ball thrown at a wall of the resting structure; the base stays still."""
    still = fi.Sine(amplitude=0.0, frequency=5.0)
    state = fi.State(ball_displacement=[start], ball_velocity=[speed])
    # what counts as divergence has a separate test below
    method = fi.Newmark(dt, divergence_limit=1e9)
    return fi.integrate(system, still, method, duration, fi.Recorder(every=every, **record), initial=state)


def with_law(structure, law):
    return reduced(with_ball(structure, contact=law), 1, 10)


@pytest.mark.parametrize("restitution", [0.2, 0.6, 0.9])
def test_achieved_restitution_tends_to_the_law_at_second_order_of_the_step_or_better(reference, restitution):
    pair = with_law(reference, fi.KelvinVoigt(restitution=restitution, contact_time=2e-3)).contacts[0]
    steps = 2e-3 / np.array([20, 40, 80, 160, 320])
    achieved = [
        fi.integrators.achieved_restitution(pair, fi.Newmark(dt), approach_speed=0.1, phases=64) for dt in steps
    ]
    assert achieved[0].exact == pytest.approx(restitution, rel=1e-9)
    error = np.array([abs(a.mean - restitution) for a in achieved])
    spread = np.array([a.highest - a.lowest for a in achieved])
    # the mean over touch instants; the fit over 4 halvings scatters by a tenth or two
    assert np.polyfit(np.log(steps), np.log(error), 1)[0] > 1.8
    # a single collision depends on where in a step it falls: first order at worst, for the force jumps at touch
    assert np.polyfit(np.log(steps), np.log(spread), 1)[0] > 0.9


@pytest.mark.parametrize("restitution", [0.2, 0.6, 0.9])
@pytest.mark.parametrize("side", [1, -1])
def test_one_collision_in_a_run_obeys_the_law(reference, restitution, side):
    system = with_law(reference, fi.KelvinVoigt(restitution=restitution, contact_time=2e-3))
    dt = 2e-3 / 400
    response = thrown(system, dt, speed=0.1 * side, start=0.1 * 0.4 * dt * side)  # touches inside a step
    pair, impacts = system.contacts[0], response.impacts
    assert len(impacts) == 1
    assert impacts.side[0] == side
    assert impacts.impactor[0] == "ball"
    # uniform motion over 4 mm at 0.1 m/s; the time is read from a depth that the first force has pushed back a little
    pushed = 0.25 * dt**2 * (pair.parameters.damping + 0.4 * dt * pair.parameters.stiffness) / pair.effective_mass
    assert impacts.time[0] == pytest.approx(0.04 - 0.4 * dt, abs=1.01 * pushed + 1e-12)
    assert impacts.approach_speed[0] == pytest.approx(0.1, rel=1e-9)
    # a touch anywhere in a step of T_c/400 scatters e by up to 8e-4; the beam's own spring takes 5e-4
    assert impacts.restitution[0] == pytest.approx(restitution, abs=1e-3)
    assert impacts.duration[0] == pytest.approx(2e-3, abs=2 * 2e-3 / 400)  # one step at each end
    exact = (1 + restitution) * pair.effective_mass * 0.1
    # the first step's jump of the dashpot force is resolved to a step: 1/400 times its share
    assert impacts.impulse[0] == pytest.approx(exact, rel=5e-3)
    # energy lost: (1 - e^2)/2 m_eff v^2, to 1 %
    loss = 0.5 * (1 - restitution**2) * pair.effective_mass * 0.1**2
    assert impacts.energy_loss[0] == pytest.approx(loss, rel=1e-2)


@pytest.mark.parametrize("restitution", [0.1, 0.6])
def test_approach_speed_is_that_before_the_touch_wherever_in_a_step_the_touch_falls(reference, restitution):
    system = with_law(reference, fi.KelvinVoigt(restitution=restitution, contact_time=2e-3))
    dt = 2e-3 / 20
    for share in (0.001, 0.01, 0.03, 0.3, 0.7, 0.999):
        # the touch falls `share` of a step before the end of a step
        response = thrown(system, dt, start=0.1 * dt * share, duration=0.05)
        # uniform motion at 0.1 m/s until a wall at rest: no force has acted before the touch
        assert response.impacts.approach_speed[0] == pytest.approx(0.1, rel=1e-9), share


def test_a_collision_hands_the_balls_momentum_to_the_structure(reference):
    system = with_law(reference, fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
    dt = 2e-3 / 400
    channels = ("ball.velocity", "tip.velocity", "contact_force")
    response = thrown(system, dt, channels=channels)
    force = response["contact_force"]
    last = np.flatnonzero(force)[-1] + 1
    ball_change = response["ball.velocity"][last] - 0.1
    tip_change = response["tip.velocity"][last]
    impulse = np.sum(force) * dt
    mobility = system.contacts[0].direction[0] ** 2
    # Newton on the ball is exact in every step of the average acceleration method: only rounding
    assert 3.43e-3 * ball_change == pytest.approx(-impulse, rel=1e-10)
    # on the structure its spring acts back over the contact: less than (w1 T_c)^2/2 = 2.2e-3
    assert tip_change == pytest.approx(mobility * impulse, rel=2.2e-3)
    # so momentum of ball and effective structure is kept: m y' + w'/phi^2
    assert 3.43e-3 * ball_change + tip_change / mobility == pytest.approx(0.0, abs=2.2e-3 * impulse)


@pytest.mark.parametrize("restitution", [0.1, 0.6, 1.0])
def test_in_a_run_the_wall_pushes_while_the_ball_is_in_it_and_never_pulls(reference, restitution):
    system = with_law(reference, fi.KelvinVoigt(restitution=restitution, contact_time=2e-3))
    response = thrown(system, 1e-4, speed=0.3, duration=0.4, channels=("gap", "contact_force"))
    gap, force = response["gap"], response["contact_force"]
    assert len(response.impacts) >= 3
    assert np.all(force * np.sign(gap) >= 0.0)
    # gated on the penetration without force: it may end a hair inside the gap, by no more than it moved the ball
    inside = np.abs(gap) <= 4e-3
    allowed = 0.25 * 1e-4**2 * np.abs(force) / system.contacts[0].effective_mass
    assert np.all(4e-3 - np.abs(gap[inside & (force != 0)]) <= 1.001 * allowed[inside & (force != 0)])


@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_a_ball_thrown_at_the_wall_of_a_resting_structure_is_not_a_divergence(one_mode, speed):
    still, start = fi.Sine(amplitude=0.0, frequency=5.0), fi.State(ball_velocity=[speed])
    response = fi.integrate(one_mode, still, fi.Newmark(1e-4), 0.1, initial=start)
    # all of the ball's energy in the first mode, at most
    bound = speed * np.sqrt(3.43e-3 * one_mode.contacts[0].direction[0] ** 2) / (2 * np.pi * one_mode.first_frequency)
    assert 0 < np.max(np.abs(response["tip"])) < bound


def test_a_ball_that_falls_on_the_wall_of_a_resting_structure_is_not_a_divergence(reference):
    system = reduced(with_ball(reference, acceleration=9.81), 1, 10)
    response = fi.integrate(system, fi.Sine(amplitude=0.0, frequency=5.0), fi.Newmark(1e-4), 0.1)
    # falls 4 mm under its own weight
    assert response.impacts.time[0] == pytest.approx(np.sqrt(2 * 4e-3 / 9.81), rel=1e-4)
