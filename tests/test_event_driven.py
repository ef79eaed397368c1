"""Event-driven runs: exact orbits, exact rest times, a ledger closed to rounding."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.closed_form import closed_forms
from femimpact.integrators.event_driven.equations import equations_of, stacked
from femimpact.validation.closed_forms import box_orbits

pytestmark = pytest.mark.impacts

EXACT = fi.EventDriven()


def beam_with_ball(modes=4, restitution=0.7, *, damping=0.0029, **ball):
    structure = with_ball(REFERENCE, contact=fi.Rigid(restitution=restitution), **ball)
    return reduced(replace(structure, damping=fi.Rayleigh(ratio=damping, modes=(1, 2))), modes)


# ---- closed-form orbits ---------------------------------------------------------------------------


def symmetric_orbit(mu, e, zeta, ratio, clearance):
    """Speed of the ball, position and velocity of the oscillator after an impact, and phase of the force there."""
    approach, phase, _ = box_orbits(mu, e, zeta, ratio, clearance)[-1]
    speed = approach * (1 + e) / (2 * (1 + mu))
    return speed, speed * math.pi / (2 * ratio) - clearance / 2, -(1 - e - 2 * mu * e) / (1 + e) * speed, phase


ORBITS = [
    # mu, e, zeta, frequency ratio, total clearance; position and speed as published, 6 decimals; stable
    (0.1, 0.8, 0.01, 1.0, 20.0, 2.090133, 7.696818, True),
    (0.1, 0.6, 0.01, 1.0, 24.0, -0.175073, 7.527982, True),
    (0.05, 0.7, 0.005, 1.0, 40.0, 3.954411, 15.249852, True),
    (0.1, 0.8, 0.01, 0.98, 20.0, 5.187468, 9.475270, False),
]


@pytest.mark.parametrize(("mu", "e", "zeta", "ratio", "clearance", "position", "speed", "stable"), ORBITS)
def test_two_impacts_per_cycle_stay_on_their_orbit(mu, e, zeta, ratio, clearance, position, speed, stable):
    found, x, v, phase = symmetric_orbit(mu, e, zeta, ratio, clearance)
    assert found == pytest.approx(speed, abs=5e-7)
    assert x == pytest.approx(position, abs=5e-7)
    system = fi.System.from_matrices(
        [[1.0]], [[2 * zeta]], [[1.0]], points={"mass": [1.0]},
        impactors=[fi.Impactor("ball", "mass", mu, clearance / 2, fi.Rigid(e))],
    )  # fmt: skip
    push = fi.PointForce("mass", fi.Sine(1.0, ratio / (2 * math.pi), phase))
    start = fi.State([x], [v], [x + clearance / 2], [-found])
    cycles = 100 if stable else 5
    run = fi.integrate(system, push, EXACT, cycles * 2 * math.pi / ratio, initial=start)
    approach = 2 * found * (1 + mu) / (1 + e)
    assert len(run.impacts) in (2 * cycles - 1, 2 * cycles)
    # a stable orbit keeps rounding down; the unstable one lets 1e-15 grow by 1.26 at each of ten impacts
    np.testing.assert_allclose(run.impacts.approach_speed, approach, rtol=1e-11)
    np.testing.assert_allclose(run.impacts.rebound_speed / run.impacts.approach_speed, e, rtol=1e-12)


def test_the_unstable_orbit_is_left():
    speed, x, v, phase = symmetric_orbit(0.1, 0.8, 0.01, 0.98, 20.0)
    system = fi.System.from_matrices(
        [[1.0]], [[0.02]], [[1.0]], points={"mass": [1.0]},
        impactors=[fi.Impactor("ball", "mass", 0.1, 10.0, fi.Rigid(0.8))],
    )  # fmt: skip
    push = fi.PointForce("mass", fi.Sine(1.0, 0.98 / (2 * math.pi), phase))
    start = fi.State([x], [v], [x + 10.0], [-speed * (1 + 1e-9)])
    run = fi.integrate(system, push, EXACT, 20 * 2 * math.pi / 0.98, initial=start)
    off = np.abs(run.impacts.approach_speed / (2 * speed * 1.1 / 1.8) - 1)
    growth = (off[35] / off[15]) ** (1 / 20)
    # largest eigenvalue of the half map as published, 1.2605
    assert growth == pytest.approx(1.2605, abs=2e-3)


# ---- bouncing, resting, leaving -------------------------------------------------------------------


@pytest.mark.parametrize("e", [0.0, 0.3, 0.7, 0.95, 0.99])
def test_a_bouncing_ball_comes_to_rest_when_it_should(e):
    height, g = 4e-3, 9.81
    # the root moves with the base and with nothing else: b = 0
    system = beam_with_ball(2, e, at="root", gap=(1.0, height), acceleration=-g)
    speed = math.sqrt(2 * g * height)
    rest = speed / g + 2 * e * speed / (g * (1 - e))
    run = fi.integrate(system, fi.Sine(0.0, 5.0), EXACT, rest + 0.5, fi.Recorder(("ball", "contact_force")))
    assert run.sticking.start == pytest.approx([rest], rel=1e-13)
    assert math.isnan(run.sticking.end[0])
    assert run["ball"][-1] == pytest.approx(-height, abs=1e-12)
    # the wall pushes the ball up and the structure down with the ball's weight
    assert run["contact_force"][-1] == pytest.approx(-3.43e-3 * g, rel=1e-12)
    # each bounce loses 1 - e^2: as many as it takes to the closure of 1e-12 m
    bounces = 1 if e == 0 else math.ceil(math.log(height / 1e-12) / (-2 * math.log(e)))
    assert abs(len(run.impacts) - bounces) <= 1
    assert run.energy.residual < 1e-12


def test_a_plate_that_outruns_gravity_lets_its_ball_go_at_the_exact_phase():
    g, f, gain = 9.81, 20.0, 1.3
    system = beam_with_ball(2, 0.4, at="root", gap=(1.0, 0.0), acceleration=-g)
    base = fi.Sine(gain * g / (2 * math.pi * f) ** 2, f)
    run = fi.integrate(system, base, EXACT, 2.0)
    # the ball leaves where the plate falls faster than it: gain sin(theta) = 1 (downward acceleration g)
    phase = np.mod(2 * math.pi * f * run.sticking.end[:-1], 2 * math.pi)
    np.testing.assert_allclose(phase, math.asin(1 / gain), rtol=1e-9)
    assert run.energy.residual < 1e-12


def test_sticking_hands_the_balls_momentum_over():
    # e = 0: the ball sticks to its wall while the box decelerates, as one body of M + m
    system = beam_with_ball(1, 0.0)
    start = fi.State([0.0], [0.01], [4e-3 - 1e-9], [0.5])
    run = fi.integrate(
        system, fi.Sine(0.0, 5.0), EXACT, 1.0, fi.Recorder(("tip.velocity", "ball.velocity", "gap")), start
    )
    b = float(system.contacts[0].direction[0])
    mass = 1.0 / b**2
    together = (mass * b * 0.01 + 3.43e-3 * 0.5) / (mass + 3.43e-3)
    sticks = (run.time > run.sticking.start[0]) & (run.time < run.sticking.end[0])
    assert np.count_nonzero(sticks) > 5
    np.testing.assert_allclose(run["tip.velocity"][sticks], run["ball.velocity"][sticks], atol=1e-14)
    np.testing.assert_allclose(run["gap"][sticks], 4e-3, rtol=1e-13)
    # within a sample of the impact the glued body has moved on by less than omega dt
    assert run["ball.velocity"][sticks][0] == pytest.approx(together, rel=0.05)
    assert run.energy.residual < 1e-13


def test_a_sticking_ball_moves_like_the_glued_structure():
    system = beam_with_ball(3, 0.0)
    drive = drive_of(system, fi.Sine(1e-4, 5.0))
    none, one = np.zeros(1), np.ones(1, dtype=bool)
    ((_, closed),) = closed_forms(stacked([equations_of(system, drive)]), one, one, none[None], none[None])
    # frequencies of the modal system with the ball's mass added at its place
    row = system.contacts[0].direction
    K, M = system.K.toarray(), np.eye(3) + 3.43e-3 * np.outer(row, row)
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    # light damping shifts frequencies by zeta^2
    np.testing.assert_allclose(np.sort(np.abs(closed.modes.exponent[0])), np.sort(omega), rtol=1e-4)


# ---- ledger ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("modes", "restitution"), [(4, 0.7), (8, 0.3)])
def test_the_ledger_closes_over_a_thousand_cycles(modes, restitution):
    system = beam_with_ball(modes, restitution)
    run = fi.integrate(system, fi.Sine(0.2037e-3, 5.0), EXACT, 200.0, fi.Recorder(every=64))
    assert len(run.impacts) > 1000
    # rounding of 1e-16 a step over 64,000 samples: 6e-12 if all of it had one sign
    assert run.energy.residual < 1e-11
    np.testing.assert_allclose(run.energy.structure_loss_of_mode.sum(axis=1), run.energy.structure_loss, rtol=1e-12)
    # the table's losses are the ledger's
    assert run.impacts.energy_loss.sum() == pytest.approx(run.energy.contact_loss[-1], rel=1e-9)


def test_what_an_impact_takes_from_the_ball_goes_to_the_modes_and_is_lost():
    system = beam_with_ball(6, 0.6)
    run = fi.integrate(system, fi.Sine(0.2037e-3, 5.0), EXACT, 20.0)
    i = run.impacts
    np.testing.assert_allclose(i.mode_share.sum(axis=1), 1.0, rtol=1e-12)
    mu = 1.0 / (1.0 / 3.43e-3 + float(system.contacts[0].direction @ system.contacts[0].direction))
    # the last impact of an accumulation has no rebound
    e = np.where(i.rebound_speed > 0.0, 0.6, 0.0)
    # rounding of speeds of 1 m/s, for the slowest impacts of an accumulation
    slow = 1e-15
    np.testing.assert_allclose(i.rebound_speed, e * i.approach_speed, rtol=1e-10, atol=slow)
    # (1 + e) m_eff v, and (1 - e^2) m_eff v^2/2
    np.testing.assert_allclose(i.impulse, (1 + e) * mu * i.approach_speed, rtol=1e-10, atol=mu * slow)
    loss = 0.5 * (1 - e**2) * mu * i.approach_speed**2
    np.testing.assert_allclose(i.energy_loss, loss, rtol=1e-10, atol=mu * slow)


# ---- drives ---------------------------------------------------------------------------------------


def test_a_recorded_base_is_exact_for_its_broken_line():
    # a triangle of acceleration: the closed form of the broken line against Newmark at ever smaller steps
    system = fi.without_impactors(beam_with_ball(2))
    dt = 0.02
    samples = np.array([0.0, 1.0, -1.0, 0.5, 0.0])
    base = fi.RecordedBase(samples, dt)
    run = fi.integrate(system, base, fi.EventDriven(samples_per_cycle=100), 0.4, fi.Recorder(("tip",)))

    def exact(time):
        # Duhamel's integral of every mode by fine quadrature
        total = 0.0
        for omega2, c, load, row in zip(
            system.K.diagonal(), system.C.diagonal(), system.base_load, system.point_row("tip"), strict=True
        ):
            s = np.linspace(0, min(time, 0.08), 400_001)
            omega_d = math.sqrt(omega2 - c * c / 4)
            kernel = np.exp(-c / 2 * (time - s)) * np.sin(omega_d * (time - s)) / omega_d
            total -= row * load * np.trapezoid(kernel * base.acceleration(s), s)
        return total

    for index in (20, 60, -1):
        # the quadrature's own error, 1e-9 of the motion
        assert run["tip"][index] == pytest.approx(exact(run.time[index]), rel=1e-6, abs=1e-12)
    assert run.energy.residual < 1e-12


def test_a_sampled_sine_converges_to_the_sine_with_order_two():
    system = beam_with_ball(3, 0.8)
    sine = fi.Sine(0.2037e-3, 5.0)
    keep = fi.Recorder(("tip",), interval=1.0 / (5.0 * 64))
    exact = fi.integrate(system, sine, EXACT, 0.5, keep, fi.State.at_rest())
    errors = []
    for n in (50, 100, 200):
        t = np.arange(int(0.6 * 5 * n)) / (5.0 * n)
        base = fi.RecordedBase(sine.acceleration(t), 1.0 / (5.0 * n), initial_velocity=float(sine.velocity(0.0)))
        run = fi.integrate(system, base, EXACT, 0.5, keep)
        errors.append(np.max(np.abs(np.interp(run.time, exact.time, exact["tip"])[::16] - run["tip"][::16])))
    # linear interpolation of the comparison itself adds 1e-7 m; the trend is order 2
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.4)


def test_stops_bound_the_beam_on_both_sides():
    structure = fi.Structure(
        beam=REFERENCE.beam,
        masses=REFERENCE.masses,
        stops=[fi.Stop("bumper", at="tip", gap=(1e-3, 2e-3), contact=fi.Rigid(restitution=0.5))],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )
    system = fi.reduce(fi.assemble(structure, elements=10), modes=5)
    run = fi.integrate(system, fi.Sine(0.2037e-3, 5.3), EXACT, 20.0)
    assert run["tip"].max() == pytest.approx(1e-3, rel=1e-2)
    assert run["tip"].max() <= 1e-3 * (1 + 1e-12)
    assert run["tip"].min() >= -2e-3 * (1 + 1e-12)
    assert set(run.impacts.side) == {1.0} or set(run.impacts.side) == {1.0, -1.0}
    assert run.energy.residual < 1e-11


# ---- input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["event-driven", "moreau-jean", "newmark"])
def test_the_force_of_a_stop_is_the_one_on_the_beam(method):
    # a static push of 1 N towards + against a stop in touch: the stop pushes back, towards -
    law = fi.KelvinVoigt(stiffness=1e5, restitution=0.2) if method == "newmark" else fi.Rigid(0.0)
    system = fi.System.from_matrices(
        [[1.0]], [[4.0]], [[1.0]], points={"mass": [1.0]},
        stops=[fi.Stop("wall", "mass", (0.0, math.inf), law)],
    )  # fmt: skip
    # a force that hardly changes over the run: 1 N from phase 90 degrees on
    push = fi.PointForce("mass", fi.Sine(1.0, 1e-3, math.pi / 2))
    chosen = {
        "event-driven": fi.EventDriven(samples_per_cycle=100_000),
        "moreau-jean": fi.MoreauJean(dt=1e-3),
        "newmark": fi.Newmark(dt=2e-4),
    }[method]
    run = fi.integrate(system, push, chosen, 5.0, fi.Recorder(("wall.contact_force", "mass")))
    # the soft wall gives 1e-5 m, and the mass's own spring takes as much
    assert run["wall.contact_force"][-1] == pytest.approx(-1.0, rel=2e-3)
    assert abs(run["mass"][-1]) < 1e-4


def test_a_ball_that_accumulates_while_another_rides_comes_to_rest():
    # what presses the second ball to its wall is the first one's weight: seen only with the sticking ball in place
    structure = fi.Structure(
        beam=REFERENCE.beam,
        masses=REFERENCE.masses,
        impactors=[
            fi.Impactor("heavy", "tip", 4.33e-3, 45e-6, fi.Rigid(0.0), acceleration=-9.81, free_stiffness=2.0),
            fi.Impactor("light", 0.1, 2.1e-3, (48e-6, 480e-6), fi.Rigid(0.3), free_stiffness=2.0),
        ],
    )
    system = fi.reduce(fi.assemble(structure, elements=16), modes=4)
    push = fi.PointForce("tip", fi.Sine(0.22, 7.0))
    run = fi.integrate(system, push, EXACT, 1.0, fi.Recorder(("heavy.gap", "light.gap")))
    assert {"heavy", "light"} <= set(run.sticking.impactor)
    assert run.energy.residual < 1e-10
    # rounding of a displacement of centimetres
    assert np.abs(run["heavy.gap"]).max() < 45e-6 + 1e-15
