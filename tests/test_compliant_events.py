"""Event-driven runs through Kelvin-Voigt contacts: exact against other programs, closed in energy."""

import dataclasses
import math

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi

pytestmark = pytest.mark.impacts

AMPLITUDE, EXACT = 0.2037e-3, fi.EventDriven()


def beam(modes=8, contact=None, **ball):
    """The reference beam with a ball whose contact is given."""
    return reduced(with_ball(REFERENCE, **ball, **({} if contact is None else {"contact": contact})), modes)


@pytest.mark.parametrize("modes", [1, 4, 8])
def test_the_ledger_closes_over_thousands_of_contacts(modes):
    system = beam(modes)
    run = fi.integrate(system, fi.Sine(AMPLITUDE, 5.0), EXACT, 400.0, fi.Recorder(every=64))
    assert len(run.impacts) > 1000
    # rounding of a few 1e-16 in each of some 1e4 motions between events
    assert run.energy.residual < 1e-10
    np.testing.assert_allclose(run.energy.structure_loss_of_mode.sum(axis=1), run.energy.structure_loss, rtol=1e-12)
    # what is in the table, and a contact that may be open at the end
    assert run.impacts.energy_loss.sum() == pytest.approx(run.energy.contact_loss[-1], rel=1e-2)


def test_stops_balls_springs_and_gravity_together_close_too():
    structure = fi.Structure(
        beam=REFERENCE.beam,
        impactors=[
            fi.Impactor(
                "sprung", at=0.15, mass=2e-3, gap=(1e-4, 2e-4), free_stiffness=3.0, acceleration=-9.81,
                contact=fi.KelvinVoigt(stiffness=3e3, restitution=0.5),
            )
        ],
        stops=[fi.Stop("stop", at="tip", gap=2e-4, contact=fi.KelvinVoigt(stiffness=2e4, restitution=0.7))],
        damping=fi.Rayleigh(ratio=0.01, modes=(1, 2)),
    )  # fmt: skip
    system = fi.reduce(fi.assemble(structure, elements=10), 5)
    run = fi.integrate(system, fi.Sine(2e-4, 14.0), EXACT, 30.0, fi.Recorder(every=8))
    assert {"sprung", "stop"} <= set(run.impacts.impactor)
    assert run.energy.residual < 1e-10
    # a small step comes to the same motion while chaos has not had its time
    short = fi.integrate(system, fi.Sine(2e-4, 14.0), EXACT, 0.1, fi.Recorder(channels=("tip",)))
    steps = fi.integrate(system, fi.Sine(2e-4, 14.0), fi.Newmark(2e-7), 0.1, fi.Recorder(channels=("tip",), every=50))
    inside = short.time < 0.099
    other = np.interp(short.time[inside], steps.time, steps["tip"])
    np.testing.assert_allclose(short["tip"][inside], other, atol=2e-3 * np.max(np.abs(other)))


def test_the_table_of_impacts_holds_what_the_contact_does():
    system = beam(1)
    run = fi.integrate(system, fi.Sine(AMPLITUDE, 5.0), EXACT, 20.0)
    i, pair = run.impacts, system.contacts[0]
    # with one mode the pair is a single mass on its wall: restitution and contact time are those of the law,
    # but for the accelerations of beam and base, some 1 m/s^2 over 2 ms against speeds of 0.05 m/s and more
    fast = i.approach_speed > 0.05
    assert fast.sum() > 20
    np.testing.assert_allclose(i.rebound_speed[fast] / i.approach_speed[fast], 0.6, atol=0.03)
    np.testing.assert_allclose(i.duration[fast], pair.parameters.contact_time, rtol=0.05)
    # the impulse is what the ball's momentum changes by, and no force was larger than the largest
    assert np.all(i.impulse <= i.peak_force * i.duration * (1 + 1e-12))
    loss = 0.5 * pair.effective_mass * (i.approach_speed**2 - i.rebound_speed**2)
    np.testing.assert_allclose(i.energy_loss[fast], loss[fast], rtol=0.1)
    # what the ball and the wall lose, the mode and the dashpot have
    assert i.energy_to_modes.shape == (len(i), 1)


def test_impulse_and_peak_are_those_of_a_fine_history():
    system = beam(4)
    fine = fi.EventDriven(samples_per_cycle=100_000)
    run = fi.integrate(
        system, fi.Sine(AMPLITUDE, 5.2), fine, 0.8, fi.Recorder(channels=("contact_force",), ledger=False)
    )
    force, dt = run["contact_force"], float(run.time[1])
    first = (run.time > run.impacts.time[0] - dt) & (run.time < run.impacts.time[0] + 4e-3)
    push = run.impacts.side[0] * force[first]
    # 1000 samples in a contact: the sum to 1e-3, the largest of them to 1e-5
    assert run.impacts.impulse[0] == pytest.approx(push.sum() * dt, rel=1e-3)
    assert run.impacts.peak_force[0] == pytest.approx(push.max(), rel=1e-5)
    assert run.impacts.peak_force[0] >= push.max()
    assert run.impacts.duration[0] == pytest.approx(np.count_nonzero(push) * dt, abs=2 * dt)


def test_a_sweep_is_its_runs_one_by_one():
    system, frequencies = beam(), np.array([4.6, 5.0, 5.3])
    both = [fi.frequency_sweep(system, AMPLITUDE, frequencies, EXACT, cycles=12, threads=n) for n in (1, 2)]
    for name in ("peak", "rms", "phase", "impacts_per_cycle", "peak_force", "energy_residual"):
        assert np.array_equal(getattr(both[0], name), getattr(both[1], name)), name
    assert np.all(both[0].energy_residual < 1e-10)
    without = fi.frequency_sweep(system, AMPLITUDE, frequencies, EXACT, cycles=12, ledger=False)
    for i, frequency in enumerate(frequencies):
        run = fi.integrate(system, fi.Sine(AMPLITUDE, frequency), EXACT, 12 / frequency, fi.Recorder(every=64))
        # the same motion, divided in other places: rounding grows, to 1e-10 with the first 17 impacts
        assert both[0].peak[i] == pytest.approx(run.steady.peak[0], rel=1e-3)
        assert both[0].impacts_per_cycle[i] == pytest.approx(run.statistics.impacts_per_cycle, rel=0.02)
        assert without.rms[i] == pytest.approx(both[0].rms[i], rel=1e-3)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("contact", [None, fi.Rigid(0.6)])
def test_a_sweep_tells_its_progress_to_the_end(contact, threads):
    shares = []
    fi.frequency_sweep(
        beam(2, contact), AMPLITUDE, np.linspace(4.0, 6.0, 5), EXACT, cycles=12, threads=threads, progress=shares.append
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_at_rest_in_space_and_given_starts_are_those_of_the_step_methods():
    system = beam(4)
    for start in (fi.State(frame="space"), fi.State(ball_displacement=[1e-3], ball_velocity=[0.3])):
        runs = [
            fi.integrate(system, fi.Sine(AMPLITUDE, 5.2), method, 0.05, fi.Recorder(channels=("tip", "ball")), start)
            for method in (EXACT, fi.Newmark(1e-6))
        ]
        for name in ("tip", "ball"):
            inside = runs[0].time < 0.049
            other = np.interp(runs[0].time[inside], runs[1].time, runs[1][name])
            # the step method's own error in an impact, of order 1 in dt = T_c/2000
            np.testing.assert_allclose(runs[0][name][inside], other, atol=1e-3 * np.max(np.abs(other)))


def test_a_ball_comes_to_rest_on_its_wall_and_stays():
    # gravity presses it; at rest the force carries its weight
    system = beam(2, fi.KelvinVoigt(stiffness=5e3, restitution=0.4), acceleration=9.81, gap=1e-3)
    run = fi.integrate(system, fi.Sine(1e-6, 2.0), EXACT, 10.0)
    # the beam still swings below it
    assert np.mean(run["contact_force"][run.time > 2.0]) == pytest.approx(3.43e-3 * 9.81, rel=0.02)
    assert any("is in contact at the end" in note for note in run.notes)
    assert run.energy.residual < 1e-10


def test_pieces_of_a_history_are_the_history():
    system, base = beam(3), fi.Sine(AMPLITUDE, 5.0)
    whole = fi.integrate(system, base, EXACT, 8.0, fi.Recorder(every=2, snapshots=16))
    pieces = []
    record = fi.Recorder(every=2, snapshots=16, sink=pieces.append, piece_samples=300)
    streamed = fi.integrate(system, base, EXACT, 8.0, record)
    assert len(pieces) > 3
    assert streamed.time.size == 0
    np.testing.assert_array_equal(np.concatenate([piece.time for piece in pieces]), whole.time)
    # divided in other places, a motion is computed anew from its start: rounding, grown by impacts
    early = whole.time < 0.9
    tip = np.concatenate([piece.channels["tip"] for piece in pieces])
    np.testing.assert_allclose(tip[early], whole["tip"][early], atol=1e-9 * np.abs(whole["tip"]).max())
    assert sum(piece.snapshots.time.size for piece in pieces) == whole.snapshots.time.size
    assert streamed.energy.residual < 1e-10


def test_a_grid_twice_as_fine_reads_the_same_motion_to_the_last_bit():
    # over more cycles than one piece of a run has
    system, base, keep = beam(1), fi.Sine(AMPLITUDE, 5.0), fi.Recorder(channels=("tip",), ledger=False)
    coarse = fi.integrate(system, base, EXACT, 60.0, keep)
    fine = fi.integrate(system, base, dataclasses.replace(EXACT, samples_per_cycle=128), 60.0, keep)
    assert len(coarse.impacts) > 100
    np.testing.assert_array_equal(coarse.impacts.time, fine.impacts.time)


def test_a_stop_on_one_side_has_no_other_wall():
    structure = fi.Structure(
        beam=REFERENCE.beam,
        stops=[fi.Stop("stop", at="tip", gap=(1e-4, np.inf), contact=fi.KelvinVoigt(stiffness=1e4, restitution=0.6))],
        damping=fi.Rayleigh(ratio=0.01, modes=(1, 2)),
    )
    system = fi.reduce(fi.assemble(structure, elements=8), 4)
    run = fi.integrate(system, fi.Sine(2e-4, 14.0), EXACT, 5.0, fi.Recorder(channels=("tip", "stop.contact_force")))
    assert len(run.impacts) > 10
    assert set(run.impacts.side) == {1.0}
    # a force on the beam that pushes it back, or none
    assert np.max(run["stop.contact_force"]) == 0.0
    assert np.min(run["stop.contact_force"]) < -0.05
    # on the open side the tip goes several times as far as a wall at the same distance would let it
    assert -run["tip"].min() > 2.0 * run["tip"].max()
    assert run.energy.residual < 1e-10


def test_most_events_are_those_of_each_case_whatever_runs_beside_it():
    # a hot beam: more than 10 changes of contact a cycle at 5.2 Hz, hardly any at 40 Hz
    system, method = beam(1), dataclasses.replace(EXACT, most_events=10)
    curve = fi.frequency_sweep(system, 4e-3, [5.2, 40.0], method, duration=6.0)
    assert list(curve.steadiness == "failed") == [True, False]
    with pytest.raises(fi.DivergenceError, match="do not resolve within 10 events a cycle"):
        fi.frequency_sweep(system, 4e-3, [5.2], method, duration=6.0)
    with pytest.raises(fi.DivergenceError, match="do not resolve within 10 events a cycle"):
        fi.integrate(system, fi.Sine(4e-3, 5.2), method, 6.0)


def test_what_is_braked_but_not_pulled_back_moves_under_a_record():
    ball = fi.Impactor("ball", at="p", mass=0.1, gap=1e-3, contact=fi.KelvinVoigt(stiffness=1e4, damping=2.0))
    free = fi.System.from_matrices([[1.0]], [[0.1]], [[0.0]], points={"p": [1.0]}, impactors=[ball])
    assert fi.integrate(free, fi.Sine(1e-4, 5.0), EXACT, 0.6).energy.residual < 1e-10
    run = fi.integrate(free, fi.RecordedBase([0.0, 30.0, 0.0, -30.0, 0.0], 0.1), EXACT, 0.6)
    assert len(run.impacts)
    assert run.energy.residual < 1e-12


# ---- a beam that rests on its stop: the breathing crack -------------------------------------------


def resting_on_a_stop(modes, gap, restitution=0.6, contact_time=1e-3):
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.3, width=0.020, thickness=2e-3, young_modulus=70e9, density=2700),
        stops=[
            fi.Stop(
                "stop", at="tip", gap=gap, contact=fi.KelvinVoigt(restitution=restitution, contact_time=contact_time)
            )
        ],
        damping=fi.Rayleigh(ratio=0.01, modes=(1, 2)),
    )
    return fi.reduce(fi.assemble(structure, elements=12), modes)


@pytest.mark.parametrize("modes", [1, 2, 4, 8])
@pytest.mark.parametrize("gap", [(0.0, math.inf), (math.inf, 0.0), (0.0, 1e-4)])
def test_a_beam_at_rest_on_its_stop_moves_off(modes, gap):
    rng = np.random.default_rng(modes)
    for phase in (0.0, 0.5 * math.pi, math.pi, float(rng.uniform(0.0, 6.0))):
        for restitution in (0.3, 0.6, 0.9):
            system = resting_on_a_stop(modes, gap, restitution, float(rng.choice([1e-3, 3e-3])))
            base = fi.Sine(amplitude=1e-4, frequency=float(rng.uniform(2.0, 60.0)), phase=phase)
            run = fi.integrate(system, base, EXACT, 20.0 / base.frequency, fi.Recorder(channels=("tip",)))
            assert run.energy.residual < 1e-10
            assert np.abs(run["tip"]).max() > 0.0


@pytest.mark.parametrize("stiffness", [3.0, 50.0])
def test_an_undamped_breathing_oscillator_has_the_bilinear_period(stiffness):
    """Half a period of the oscillator alone and half of it with the stop's spring: T = pi/w1 + pi/w2."""
    system = fi.System.from_matrices(
        [[1.0]], [[0.0]], [[1.0]], points={"a": [1.0]},
        stops=[fi.Stop("stop", at="a", gap=(0.0, math.inf), contact=fi.KelvinVoigt(stiffness=stiffness, damping=0.0))],
    )  # fmt: skip
    start = fi.State(velocity=[-1.0])
    run = fi.integrate(system, fi.Sine(1e-15, 0.02), EXACT, 400.0, fi.Recorder(channels=("a",)), initial=start)
    period = math.pi * (1.0 + 1.0 / math.sqrt(1.0 + stiffness))
    # impacts begin once a period; the base moves 1e-15 m
    np.testing.assert_allclose(np.diff(run.impacts.time), period, rtol=1e-12)
