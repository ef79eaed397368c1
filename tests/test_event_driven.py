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

pytestmark = pytest.mark.impacts

EXACT = fi.EventDriven()


def beam_with_ball(modes=4, restitution=0.7, *, damping=0.0029, **ball):
    structure = with_ball(REFERENCE, contact=fi.Rigid(restitution=restitution), **ball)
    return reduced(replace(structure, damping=fi.Rayleigh(ratio=damping, modes=(1, 2))), modes)


# ---- closed-form orbits ---------------------------------------------------------------------------


# ---- bouncing, resting, leaving -------------------------------------------------------------------


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
    ((_, closed),) = closed_forms(stacked([equations_of(system, drive)]), one, none[None], none[None])
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
