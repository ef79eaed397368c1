"""Starts within a compliant contact: the contact state that its force has, its energy, and two halves as the whole."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi

pytestmark = pytest.mark.impacts

SOFT = fi.KelvinVoigt(restitution=0.6, contact_time=5e-3)
SINE = fi.Sine(0.4e-3, 5.2)
RECORD = fi.RecordedBase(np.sin(0.3 * np.arange(400)), 5e-3)
STILL = fi.Sine(0.0, 5.0)
STEPPED = (fi.Newmark(1e-4), fi.Newmark(1e-4, contact="energy-consistent"), fi.HHT(1e-4, alpha=-0.1))
LAWS = {
    "kelvin-voigt": SOFT,
    "hertz": fi.Hertz(1e6),
    "hunt-crossley": fi.HuntCrossley(1e6, 0.7),
    "lankarani-nikravesh": fi.contact.LankaraniNikravesh(1e6, 0.7),
    "flores": fi.contact.Flores(1e6, 0.7),
    "gonthier": fi.contact.GonthierCarvalhoMartins(1e6, 0.7),
    "switching spring": fi.contact.SwitchingSpring(1.0, 1e3),
    "custom": fi.CustomLaw(lambda depth, rate, speed: 1e3 * depth * (1.0 + 0.2 * rate / speed)),
}


def on_a_block(law, mass=0.1, **ball):
    """A ball beside a mass so large that it stays where it is: one contact of the ball's own mass."""
    impactor = fi.Impactor("ball", "m", mass, 1e-3, law, **ball)
    return fi.System.from_matrices(1e9, 0.0, 1e9, points={"m": [1.0]}, impactors=[impactor])


def plain(state):
    """The positions and rates of a state alone."""
    return fi.State(
        state.displacement, state.velocity, state.ball_displacement, state.ball_velocity, time=state.time
    )  # fmt: skip


# ---- two halves are the whole ----------------------------------------------------------------------


@pytest.mark.parametrize("excitation", [SINE, RECORD], ids=["sine", "record"])
@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(1e-4)], ids=repr)
def test_a_run_goes_on_from_the_places_and_rates_within_a_contact(method, excitation):
    system = reduced(with_ball(REFERENCE, contact=SOFT, gap=2e-3), 4, 10)
    record = fi.Recorder(("tip", "ball", "ball.velocity", "contact_force", "gap"))
    interval = method.time_grid(system, excitation, 1.0, record) if method == fi.EventDriven() else method.dt
    whole = fi.integrate(system, excitation, method, 1.0, record)
    touching = np.flatnonzero(np.abs(whole["gap"][2:]) > 2e-3) + 2
    pushed = whole["contact_force"][touching] != 0.0
    # pressed, and leaving the wall that no longer pushes
    assert np.any(pushed)
    assert np.any(~pushed)
    for cut in (touching[pushed][0], touching[pushed][1], touching[~pushed][0]):
        first = fi.integrate(system, excitation, method, cut * interval)
        second = fi.integrate(system, excitation, method, 0.2, record, plain(first.final_state))
        assert any("ball starts in contact" in text for text in second.notes)
        for name, values in second.channels.items():
            same = whole[name][cut : cut + values.size]
            # the steady answer is taken off anew: rounding, which some impacts enlarge
            np.testing.assert_allclose(values, same, rtol=0, atol=1e-8 * np.abs(same).max(), err_msg=name)
        # the contact that it begins in counts from the start on
        assert second.impacts.time[0] == pytest.approx(second.start, abs=1e-12)
        later = whole.impacts.time[whole.impacts.time > second.start]
        np.testing.assert_allclose(second.impacts.time[1:], later[: len(second.impacts) - 1], rtol=1e-7)
        assert len(second.impacts) >= 2


# ---- the contact that it is in ---------------------------------------------------------------------


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_lies_still_in_a_wall_leaves_it_as_the_spring_and_dashpot_say(side):
    mass, depth, damping = 0.1, 2e-4, 0.2
    stiffness = 1e3
    omega = math.sqrt(stiffness / mass)
    law = fi.KelvinVoigt(stiffness=stiffness, damping=2 * damping * math.sqrt(stiffness * mass))
    system = on_a_block(law)
    run = fi.integrate(
        system, STILL, fi.EventDriven(), 0.2, fi.Recorder(("ball", "contact_force"), interval=1e-4),
        fi.State(ball_displacement=[side * (1e-3 + depth)]),
    )  # fmt: skip
    # p'' + 2 D w p' + w^2 p = 0 from p0 at rest, until k p + c p' = 0: with p' + i a p a turning vector, at the time
    # with tan(damped t) = sqrt(1 - D^2)/D, below that of p = 0
    damped = omega * math.sqrt(1 - damping**2)
    end = math.atan2(math.sqrt(1 - damping**2), damping) / damped
    t = run.time[run.time < end]
    p = depth * np.exp(-damping * omega * t) * (np.cos(damped * t) + damping * omega / damped * np.sin(damped * t))
    np.testing.assert_allclose(side * run["ball"][: t.size] - 1e-3, p, rtol=0, atol=1e-12)
    # on the structure: the ball pushes the wall that it is in outwards
    assert side * run["contact_force"][0] == pytest.approx(stiffness * depth, rel=1e-9)
    assert run.energy.contact[0] == pytest.approx(0.5 * stiffness * depth**2, rel=1e-9)
    assert run.energy.residual < 1e-9


@pytest.mark.parametrize("method", [fi.EventDriven(), *STEPPED], ids=repr)
def test_what_leaves_faster_than_its_wall_springs_back_is_without_force(method):
    system = on_a_block(fi.KelvinVoigt(stiffness=1e3, damping=10.0))
    # k p + c p' = 0.2 - 1 N
    start = fi.State(ball_displacement=[1.2e-3], ball_velocity=[-0.1])
    record = fi.Recorder(("ball", "contact_force"), **({"interval": 1e-4} if method == fi.EventDriven() else {}))
    run = fi.integrate(system, STILL, method, 0.01, record, start)
    np.testing.assert_array_equal(run["contact_force"], 0.0)
    np.testing.assert_allclose(run["ball"], 1.2e-3 - 0.1 * run.time, rtol=0, atol=1e-12)
    # the energy of the wall was there, and is lost
    assert run.energy.contact[0] == pytest.approx(0.5 * 1e3 * 2e-4**2, rel=1e-9)
    assert run.energy.contact_loss[-1] == pytest.approx(run.energy.contact[0], rel=1e-9)
    assert len(run.impacts) == 1
    assert run.impacts.impulse[0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("rate", [0.0, 0.1, -0.05])
@pytest.mark.parametrize("method", STEPPED, ids=repr)
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_the_ledger_closes_from_a_compressed_wall_on(law, method, rate):
    method = replace(method, dt=2e-5)
    system, depth = on_a_block(law), 2e-4
    start = fi.State(ball_displacement=[-1e-3 - depth], ball_velocity=[-rate])
    run = fi.integrate(system, STILL, method, 0.1, fi.Recorder(("ball", "contact_force")), start)
    pair, energy = system.contacts[0], run.energy
    speed = math.sqrt(rate**2 + 2 * law.potential(depth, pair.effective_mass, abs(rate) or 1.0) / pair.effective_mass)
    force = law.normal_force(depth, rate, speed, pair.effective_mass)
    if isinstance(law, fi.contact.SwitchingSpring):
        # from the centre on
        force = law.stiffness * (1e-3 + depth)
    # a method with a mean force has none at its start
    assert -run["contact_force"][0] == pytest.approx(force, rel=1e-9)
    if not isinstance(law, fi.contact.SwitchingSpring):
        stored = law.potential(depth, pair.effective_mass, speed)
        assert energy.contact[0] == pytest.approx(stored, rel=1e-6)
    # to the step squared in the contact's period of some ms, and to the step where the force jumps
    assert energy.residual < (0.3 if isinstance(law, fi.contact.SwitchingSpring) else 2e-2)
    assert len(run.impacts) >= 1


def test_a_law_with_an_approach_speed_takes_that_of_a_pair_without_loss():
    """A ball that has come through a wall without loss goes on as if the run had begun at the touch."""
    weak = fi.HuntCrossley(1e6, 0.999)
    system = on_a_block(weak)
    record, method = fi.Recorder(("ball", "gap")), fi.Newmark(1e-6)
    whole = fi.integrate(system, STILL, method, 0.02, record, fi.State(ball_velocity=[0.3]))
    inside = np.flatnonzero(whole["gap"] > 1e-3)
    cut = inside[inside.size // 4]
    first = fi.integrate(system, STILL, method, cut * 1e-6, record, fi.State(ball_velocity=[0.3]))
    second = fi.integrate(system, STILL, method, 0.01, record, plain(first.final_state))
    # the loss of 0.1 % until the cut makes that much of the damping, itself 0.1 % of the force
    assert second.impacts.approach_speed[0] == pytest.approx(0.3, rel=2e-3)
    assert second.impacts.rebound_speed[0] == pytest.approx(whole.impacts.rebound_speed[0], rel=1e-5)


# ---- sweeps and studies ----------------------------------------------------------------------------


@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(1e-4)], ids=repr)
def test_a_sweep_and_a_parameter_study_begin_there_too(method):
    system = reduced(with_ball(REFERENCE, contact=SOFT, gap=1e-3), 3, 8)
    start = fi.State(ball_displacement=[1.3e-3])
    swept = fi.frequency_sweep(system, 0.2e-3, [5.0, 5.4], method, 6, initial=start)
    for number, frequency in enumerate((5.0, 5.4)):
        base = fi.Sine(0.2e-3, frequency)
        alone = fi.integrate(system, base, method, 6 / frequency, fi.Recorder(("tip",)), start)
        # a step does not divide the cycle
        assert swept.peak[number] == pytest.approx(
            alone.steady.peak[0], rel=1e-9 if method == fi.EventDriven() else 0.05
        )
    axes = {"impactor.ball.gap": [1e-3, 2e-3], "start.ball.position": [0.0, 1.3e-3]}
    base = fi.Sine(0.2e-3, 5.0)
    found = fi.parameter_study(system, axes, ["peak"], excitation=base, method=method, cycles=6)
    assert not np.any(found["failure"] != "")
    assert found["peak"][0, 1] == pytest.approx(swept.peak[0], rel=1e-12)
    rigid = reduced(with_ball(REFERENCE, contact=fi.Rigid(0.6), gap=1e-3), 3, 8)
    with pytest.raises(fi.InputError, match=r"initial\.ball\.gap = 0\.0013 m: must start between its walls"):
        fi.frequency_sweep(rigid, 0.2e-3, [5.0], fi.EventDriven(), 6, initial=start)
    with pytest.raises(fi.InputError, match=r"initial\.ball\.gap = 0\.0013 m: must start between its walls"):
        fi.integrate(rigid, SINE, fi.EventDriven(), 1.0, initial=start)
