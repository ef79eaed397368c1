"""Stops, drives, laws and contact steps of the step methods: exact solutions, invariants, rates."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import oscillator, with_ball

import femimpact as fi

pytestmark = pytest.mark.impacts

STILL = fi.Sine(amplitude=0.0, frequency=0.1)
CONTACT_TIME = 2e-3


# ---- stops and drives -------------------------------------------------------------------------------


def test_by_default_a_stop_has_a_force_but_no_motion():
    stop = fi.Stop("wall", "mass", (0.2, math.inf), fi.KelvinVoigt(stiffness=10.0, damping=0.0))
    ball = fi.Impactor("ball", "mass", 0.1, 0.1, fi.KelvinVoigt(stiffness=10.0, damping=0.0))
    one = fi.integrate(oscillator(stops=[stop]), STILL, fi.Newmark(1e-3), 0.1)
    both = fi.integrate(oscillator(stops=[stop], impactors=[ball]), STILL, fi.Newmark(1e-3), 0.1)
    assert tuple(one.channels) == ("mass", "contact_force")
    assert tuple(both.channels) == ("mass", "ball", "ball.contact_force", "wall.contact_force")
    with pytest.raises(fi.InputError, match="is a stop"):
        fi.integrate(oscillator(stops=[stop]), STILL, fi.Newmark(1e-3), 0.1, fi.Recorder(("wall",)))


def test_a_force_does_not_touch_the_ball_and_the_base_does():
    ball = fi.Impactor("ball", "mass", 0.1, 10.0, fi.KelvinVoigt(stiffness=10.0, damping=0.0))
    system = oscillator(impactors=[ball])
    history = fi.Sine(amplitude=1.0, frequency=0.3)
    pushed = fi.integrate(system, fi.PointForce("mass", history), fi.Newmark(1e-3), 1.0)
    shaken = fi.integrate(system, history, fi.Newmark(1e-3), 1.0)
    np.testing.assert_array_equal(pushed["ball"], 0.0)
    assert np.max(np.abs(shaken["ball"])) > 0.1


# ---- a mean force of the step -----------------------------------------------------------------------


def thrown(law, method, speed=0.1, shift=0.3, mass=3.43e-3, **more):
    """A ball thrown at the wall of a heavier mass; `shift` moves the touch within a step."""
    ball = fi.Impactor("ball", "mass", mass, 4e-3, law, **more)
    system = oscillator(30.0**2, impactors=[ball])
    start = fi.State(ball_displacement=[-shift * speed * method.dt], ball_velocity=[speed])
    return fi.integrate(system, STILL, method, 0.08, initial=start)


ELASTIC = {
    "linear": fi.KelvinVoigt(restitution=1.0, contact_time=CONTACT_TIME),
    "hertz": fi.Hertz(stiffness=2.5e5),
    "own": fi.CustomLaw(lambda depth, rate, speed: 2.5e5 * depth**1.5),
}


@pytest.mark.parametrize("name", ELASTIC)
@pytest.mark.parametrize("shift", [0.1, 0.37, 0.9])
def test_an_energy_consistent_contact_keeps_energy_at_any_step(name, shift):
    system = oscillator(impactors=[fi.Impactor("ball", "mass", 3.43e-3, 4e-3, ELASTIC[name])])
    contact_time = system.contacts[0].parameters.contact_time
    plain = fi.Newmark(contact_time, allow_coarse_step=True)
    kept = thrown(ELASTIC[name], replace(plain, contact="energy-consistent"), shift=shift)
    assert len(kept.impacts) == 1
    energy = kept.energy
    # one step a contact: rounding, and no loss is counted
    assert energy.residual < 1e-12
    np.testing.assert_allclose(energy.contact_loss, 0.0, atol=1e-12 * energy.stored[0])
    assert kept.impacts.restitution[0] == pytest.approx(1.0, abs=1e-3)
    lost = thrown(ELASTIC[name], plain, shift=shift)
    assert lost.energy.residual > 0.05
    assert any("energy residual" in warning for warning in lost.warnings)
    assert not any("energy residual" in warning for warning in kept.warnings)


LOSSY = {
    "linear": fi.KelvinVoigt(restitution=0.5, contact_time=CONTACT_TIME),
    "power": fi.contact.GonthierCarvalhoMartins(stiffness=2.5e5, restitution=0.5, reference_speed=0.1),
    "own": fi.CustomLaw(lambda depth, rate, speed: 2.5e5 * depth**1.5 * (1.0 + 0.6 * rate / speed)),
}


@pytest.mark.parametrize("name", LOSSY)
@pytest.mark.parametrize("share", [0.1, 1.0])
def test_an_energy_consistent_contact_loses_what_its_law_takes(name, share):
    system = oscillator(impactors=[fi.Impactor("ball", "mass", 3.43e-3, 4e-3, LOSSY[name])])
    dt = share * system.contacts[0].parameters.contact_time
    run = thrown(LOSSY[name], fi.Newmark(dt, contact="energy-consistent", allow_coarse_step=True))
    # own sum, its equation solved to rounding
    assert run.energy.residual < 1e-12
    assert run.energy.contact_loss[-1] > 0.1 * run.energy.stored[0]
    assert np.all(np.diff(run.energy.contact_loss) >= -1e-15 * run.energy.stored[0])


def test_both_walls_in_one_step_keep_the_energy():
    law = fi.KelvinVoigt(restitution=1.0, contact_time=CONTACT_TIME)
    ball = fi.Impactor("ball", "mass", 3.43e-3, 1e-6, law)
    method = fi.Newmark(CONTACT_TIME, contact="energy-consistent", allow_coarse_step=True)
    run = fi.integrate(oscillator(30.0**2, impactors=[ball]), STILL, method, 1.0, initial=fi.State(ball_velocity=[0.1]))
    assert run.energy.residual < 1e-10


@pytest.mark.parametrize("seed", range(12))
def test_contacts_at_one_place_make_no_energy_at_any_step(seed):
    """What one contact pushes may open or close another within the step: balls and a stop at one place."""
    rng = np.random.default_rng(seed)

    def law():
        if rng.random() < 0.5:
            return fi.KelvinVoigt(
                stiffness=float(10.0 ** rng.uniform(1.0, 3.0)), restitution=float(rng.uniform(0.3, 1.0))
            )
        return fi.Hertz(stiffness=float(10.0 ** rng.uniform(1.0, 3.0)))

    balls = [
        fi.Impactor(
            f"ball {i}", at="a", mass=float(rng.uniform(0.05, 1.0)), gap=float(rng.uniform(0.2, 1.0)), contact=law()
        )
        for i in range(2)
    ]
    stop = fi.Stop("stop", at="a", gap=float(rng.uniform(0.2, 1.0)), contact=law())
    system = fi.System.from_matrices(
        [[1.0]], [[0.02]], [[1.0]], points={"a": [1.0]}, impactors=balls, stops=[stop]
    )  # fmt: skip
    base = fi.Sine(amplitude=float(rng.uniform(0.2, 1.0)), frequency=0.15)
    for dt in (0.5, 0.1, 0.02):
        method = fi.Newmark(dt, contact="energy-consistent", allow_coarse_step=True)
        run = fi.integrate(system, base, method, 100.0, fi.Recorder(channels=("a",)))
        assert len(run.impacts) > 5
        # rounding of some hundred contacts; with sides decided before the other contacts push it was up to 87
        assert run.energy.residual < 1e-11


# ---- laws -------------------------------------------------------------------------------------------

LAWS = {
    "hertz": fi.Hertz(stiffness=2.5e5, reference_speed=0.1),
    "exact": fi.contact.GonthierCarvalhoMartins(stiffness=2.5e5, restitution=0.6, reference_speed=0.1),
    "hunt-crossley": fi.HuntCrossley(stiffness=2.5e5, restitution=0.6, reference_speed=0.1),
    "square": fi.contact.Flores(stiffness=2e7, restitution=0.7, exponent=2.0, reference_speed=0.1),
    "own": fi.CustomLaw(
        lambda depth, rate, speed: 3e3 * depth + 1e8 * depth**3 * (1 + 0.2 * rate), reference_speed=0.1
    ),
}
METHODS = [
    fi.Newmark(1.0),
    fi.Newmark(1.0, contact="energy-consistent"),
    fi.HHT(1.0, alpha=-0.2),
    fi.WBZ(1.0, alpha=-0.2),
    fi.GeneralizedAlpha(1.0, spectral_radius=0.6),
]


def pair_of(law, mass=3.43e-3):
    return oscillator(30.0**2, impactors=[fi.Impactor("ball", "mass", mass, 4e-3, law)]).contacts[0]


@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("name", LAWS)
def test_every_law_with_every_method_tends_to_its_collision(name, method):
    pair = pair_of(LAWS[name])
    exact = fi.collide(LAWS[name], pair.effective_mass, 0.1)
    steps = exact.contact_time / np.array([20, 80])
    errors = []
    for dt in steps:
        achieved = fi.integrators.achieved_restitution(pair, replace(method, dt=float(dt)), 0.1)
        errors.append(max(abs(achieved.highest - exact.restitution), abs(achieved.lowest - exact.restitution)))
    # no force jumps at touch: second order, at worst n = 1.5 for the kink of the force
    assert errors[0] < 0.03
    assert errors[1] < errors[0] / 6 or errors[1] < 1e-6
    assert achieved.peak_force == pytest.approx(exact.peak_force, rel=5e-3)


@pytest.mark.parametrize("name", LAWS)
def test_a_run_obeys_the_law(name):
    pair = pair_of(LAWS[name])
    exact = fi.collide(LAWS[name], pair.effective_mass, 0.1)
    run = thrown(LAWS[name], fi.Newmark(exact.contact_time / 200))
    impacts = run.impacts
    assert len(impacts) == 1
    # T_c/200; the mass's own spring takes (w T_c)^2/8 or so
    assert impacts.restitution[0] == pytest.approx(exact.restitution, abs=3e-3)
    assert impacts.peak_force[0] == pytest.approx(exact.peak_force, rel=3e-3)
    assert impacts.duration[0] == pytest.approx(exact.contact_time, rel=0.05)
    assert impacts.energy_loss[0] == pytest.approx(exact.energy_loss, rel=2e-2, abs=1e-9)
    assert run.energy.contact_loss[-1] == pytest.approx(impacts.energy_loss[0], rel=1e-12, abs=1e-18)
    assert run.energy.residual < 1e-3


# ---- fine steps in contact --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "method", [fi.Newmark(1.0), fi.Newmark(1.0, contact="energy-consistent"), fi.HHT(1.0)], ids=repr
)
def test_fine_steps_in_contact_are_as_good_as_fine_steps_throughout(reference, method):
    system = fi.reduce(fi.assemble(reference, elements=10), modes=2)
    base = fi.Sine(1e-3, 5.0)
    fine, refine = 2e-5, 10
    record = fi.Recorder(("tip", "ball", "tip.velocity", "ball.velocity"))
    start = fi.State(ball_velocity=[0.1])
    uniform = fi.integrate(system, base, replace(method, dt=fine), 0.06, record, initial=start)
    mixed = fi.integrate(system, base, replace(method, dt=fine * refine, refine=refine), 0.06, record, initial=start)
    coarse = fi.integrate(system, base, replace(method, dt=fine * refine), 0.06, record, initial=start)
    assert len(uniform.impacts) == len(mixed.impacts) == len(coarse.impacts) == 1
    for name in record.channels:
        scale = np.max(np.abs(uniform[name]))
        error = np.max(np.abs(mixed[name] - uniform[name][::refine])) / scale
        crude = np.max(np.abs(coarse[name] - uniform[name][::refine])) / scale
        # the own error of the motion between contacts, (w2 dt)^2/12 of the second mode at the coarse step
        assert error < 2e-3, name
        assert error < 0.3 * crude, name
    for name in ("time", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss"):
        one, other = getattr(mixed.impacts, name)[0], getattr(uniform.impacts, name)[0]
        assert one == pytest.approx(other, rel=5e-3, abs=fine), name
    assert mixed.energy.residual < 1.5 * uniform.energy.residual + 1e-4
    assert mixed.energy.contact_loss[-1] == pytest.approx(mixed.impacts.energy_loss[0], rel=1e-12)


def test_the_ledger_closes_to_rounding_across_changes_of_the_step(reference):
    law = fi.KelvinVoigt(restitution=0.6, contact_time=CONTACT_TIME)
    full = fi.assemble(with_ball(reference, contact=law), elements=5)
    start = fi.State(ball_velocity=[0.1])
    method = fi.Newmark(1e-3, refine=10, contact="energy-consistent")
    for system in (full, fi.reduce(full, modes=4)):
        run = fi.integrate(system, fi.Sine(1e-3, 5.0), method, 1.0, initial=start)
        assert len(run.impacts) > 3
        assert run.energy.residual < 1e-10


def test_fine_steps_beside_other_cases_are_those_alone(small):
    method = fi.Newmark(1e-3, refine=10)
    alone = fi.frequency_sweep(small, 0.5e-3, [5.1], method, 3)
    beside = fi.frequency_sweep(small, 0.5e-3, [4.9, 5.1, 5.3], method, 3, threads=1)
    assert alone.impacts_per_cycle[0] > 0
    for name in ("peak", "mean_impulse", "peak_force", "energy_residual"):
        # sums over the modes are taken in another order, and five impacts amplify that tenfold each
        assert getattr(beside, name)[1] == pytest.approx(getattr(alone, name)[0], rel=1e-6), name


def test_a_step_without_contact_may_be_longer_than_the_contact(small):
    assert fi.recommended_step(small, refine=4) == pytest.approx(4 * fi.recommended_step(small))
    # bounded by the first mode
    assert fi.recommended_step(small, refine=100) == pytest.approx(1 / (400 * small.first_frequency))
    fi.integrate(small, fi.Sine(1e-4, 5.0), fi.Newmark(1e-3, refine=10), 0.1)
    with pytest.raises(fi.InputError, match=r"dt/2 = 0\.0005 s against a contact time"):
        fi.integrate(small, fi.Sine(1e-4, 5.0), fi.Newmark(1e-3, refine=2), 0.1)


# ---- mode by mode -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "method", [fi.Newmark(1e-4), fi.Newmark(1e-3, refine=10), fi.Newmark(1e-4, contact="energy-consistent")], ids=repr
)
def test_losses_and_gains_of_the_modes_add_up(small, method):
    run = fi.integrate(small, fi.Sine(1e-3, 5.0), method, 1.0, initial=fi.State(ball_velocity=[0.1]))
    energy, impacts = run.energy, run.impacts
    assert len(impacts) > 3
    assert energy.structure_loss_of_mode.shape == (run.time.size, 8)
    np.testing.assert_allclose(energy.structure_loss_of_mode.sum(axis=1), energy.structure_loss, rtol=1e-12)
    assert np.all(np.diff(energy.structure_loss_of_mode, axis=0) >= 0.0)
    assert impacts.energy_to_modes.shape == (len(impacts), 8)


def test_an_impact_passes_to_each_mode_what_the_mode_gains(reference):
    system = fi.reduce(fi.assemble(replace(reference, damping=None), elements=10), modes=4)
    method = fi.Newmark(1e-5, contact="energy-consistent")
    run = fi.integrate(system, STILL, method, 0.05, fi.Recorder(snapshots=1), initial=fi.State(ball_velocity=[0.1]))
    assert len(run.impacts) == 1
    gained = run.impacts.energy_to_modes[0]
    # at rest before: the modes' energies afterwards
    assert gained.sum() == pytest.approx((run.energy.kinetic + run.energy.strain)[-1], rel=1e-10)
    assert np.all(gained > 0.0)
    # the ball's loss is what modes and contact take
    lost = run.energy.ball[0] - run.energy.ball[-1]
    assert lost == pytest.approx(gained.sum() + run.impacts.energy_loss[0], rel=1e-10)


def test_the_residual_warns_beyond_its_limit(small):
    start = fi.State(ball_velocity=[0.1])
    quiet, loud = (
        fi.integrate(small, STILL, fi.Newmark(1e-4), 0.06, fi.Recorder(residual_limit=limit), initial=start)
        for limit in (0.02, 1e-9)
    )
    assert quiet.warnings == ()
    assert len(loud.warnings) == 1
    assert "energy residual" in loud.warnings[0]
