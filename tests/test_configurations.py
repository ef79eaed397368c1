"""Stops in space, preloads, gravity and mixed laws, event-driven: against small steps, closed forms and the ledger."""

import dataclasses
import math

import numpy as np
import pytest

import femimpact as fi
from femimpact.integrators.cases import SineCases

pytestmark = pytest.mark.impacts

EXACT = fi.EventDriven()
SOFT = fi.KelvinVoigt(stiffness=2e4, restitution=0.6)


def beam(modes=4, *, gravity=0.0, stops=(), balls=(), damping=0.01):
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.3, width=0.020, thickness=2e-3, young_modulus=70e9, density=2700),
        stops=list(stops),
        impactors=list(balls),
        damping=fi.Rayleigh(ratio=damping, modes=(1, 2)),
        gravity=gravity,
    )
    return fi.reduce(fi.assemble(structure, elements=12), modes)


def compare(system, base, duration, dt, tolerance, initial=None, law=fi.Newmark):
    """Both methods' tips over a short time, before chaos."""
    keep = fi.Recorder(channels=("tip",))
    exact = fi.integrate(system, base, EXACT, duration, keep, initial=initial)
    steps = fi.integrate(system, base, law(dt), duration, fi.Recorder(channels=("tip",), every=20), initial=initial)
    inside = exact.time < 0.98 * duration
    other = np.interp(exact.time[inside], steps.time, steps["tip"])
    scale = np.abs(other).max()
    np.testing.assert_allclose(exact["tip"][inside], other, atol=tolerance * scale)
    assert exact.energy.residual < 1e-10
    return exact


def test_a_soft_stop_in_space_is_the_one_of_small_steps():
    system = beam(stops=[fi.Stop("stop", at="tip", gap=2e-4, contact=SOFT, fixed_to="space")])
    run = compare(system, fi.Sine(1e-4, 14.0), 0.3, 1e-6, 2e-3)
    assert len(run.impacts) >= 4
    # on the base the same stop is met at other times
    other = beam(stops=[fi.Stop("stop", at="tip", gap=2e-4, contact=SOFT)])
    fixed = fi.integrate(other, fi.Sine(1e-4, 14.0), EXACT, 0.3)
    assert abs(fixed.impacts.time[0] - run.impacts.time[0]) > 1e-4


@pytest.mark.parametrize("law", [SOFT, fi.Rigid(0.5), fi.Rigid(0.0)])
def test_a_stop_in_space_holds_the_beam_where_it_is_and_its_ledger_closes(law):
    system = beam(stops=[fi.Stop("stop", at="tip", gap=2e-4, contact=law, fixed_to="space")])
    base = fi.Sine(1e-4, 14.0)
    run = fi.integrate(system, base, EXACT, 3.0, fi.Recorder(channels=("tip", "gap"), every=8))
    assert len(run.impacts) > 20
    np.testing.assert_allclose(run["gap"], run["tip"] + base.displacement(run.time), atol=1e-15)
    if isinstance(law, fi.Rigid):
        assert np.abs(run["gap"]).max() <= 2e-4 * (1.0 + 1e-12)
    assert run.energy.residual < 1e-10
    if law == fi.Rigid(0.0):
        # it sticks to a wall that moves against the base
        assert len(run.sticking) > 0


def test_a_recorded_base_and_a_stop_in_space_close_the_ledger_too():
    # two sines by samples, with the velocity at which the base does not drift
    time, omega, size = 2e-3 * np.arange(500), 2.0 * np.pi * np.array([14.0, 23.0]), np.array([2.0, 1.0])
    base = fi.RecordedBase(np.sin(np.outer(time, omega)) @ size, 2e-3, -float(np.sum(size / omega)))
    for law in (SOFT, fi.Rigid(0.4)):
        for fixed_to in ("base", "space"):
            system = beam(stops=[fi.Stop("stop", at="tip", gap=1e-4, contact=law, fixed_to=fixed_to)])
            run = fi.integrate(system, base, EXACT, 1.0, fi.Recorder(channels=("tip", "gap")))
            assert len(run.impacts) > 3
            moved = base.displacement(run.time) if fixed_to == "space" else 0.0
            np.testing.assert_allclose(run["gap"], run["tip"] + moved, atol=1e-14)
            assert run.energy.residual < 1e-10


def test_a_recorded_base_through_soft_contacts_is_the_one_of_small_steps():
    rng = np.random.default_rng(5)
    ball = fi.Impactor("ball", at="tip", mass=3e-3, gap=1e-4, contact=SOFT)
    system = beam(balls=[ball])
    run = compare(system, fi.RecordedBase(3.0 * rng.normal(size=100), 5e-3), 0.1, 5e-7, 2e-3)
    assert len(run.impacts) >= 2


def test_gravity_bends_a_static_start_and_swings_one_that_is_not():
    system = beam(gravity=-9.81, damping=0.02)
    still = fi.integrate(system, fi.Sine(0.0, 10.0), EXACT, 1.0, fi.Recorder(channels=("tip",)), fi.State.static())
    np.testing.assert_allclose(still["tip"], still["tip"][0], rtol=1e-12)
    swing = fi.integrate(system, fi.Sine(0.0, 10.0), EXACT, 1.0, fi.Recorder(channels=("tip",)))
    assert swing["tip"][0] == 0.0
    # from u = 0 it swings about the static place, nearly twice as far
    assert swing["tip"].min() == pytest.approx(2.0 * still["tip"][0], rel=0.1)
    assert swing.energy.residual < 1e-12


@pytest.mark.parametrize("law", [SOFT, fi.Rigid(0.5)])
def test_a_preloaded_stop_pushes_from_the_start_and_loses_touch_when_the_base_shakes(law):
    system = beam(stops=[fi.Stop("stop", at="tip", gap=(-1e-4, math.inf), contact=law)])
    row = system.point_row("tip")
    stiffness = 1.0 / float(row @ np.linalg.solve(system.K.toarray(), row))
    own = 0.0 if isinstance(law, fi.Rigid) else 1.0 / law.stiffness
    force = 1e-4 / (1.0 / stiffness + own)
    names = ("tip", "stop.contact_force")
    still = fi.integrate(system, fi.Sine(0.0, 10.0), EXACT, 0.5, fi.Recorder(names))
    np.testing.assert_allclose(still["stop.contact_force"], -force, rtol=1e-9)
    np.testing.assert_allclose(still["tip"], still["tip"][0], rtol=1e-10)
    assert len(still.impacts) == 0
    shaken = fi.integrate(system, fi.Sine(2e-3, 14.0), EXACT, 1.0, fi.Recorder(names))
    assert len(shaken.impacts) > 3
    assert shaken.energy.residual < 1e-10


def test_rigid_and_soft_pairs_stand_in_one_system():
    balls = [
        fi.Impactor("hard", at="tip", mass=2e-3, gap=5e-4, contact=fi.Rigid(0.6)),
        fi.Impactor("soft", at=0.2, mass=1e-3, gap=3e-4, contact=SOFT),
    ]
    stops = [fi.Stop("stop", at="tip", gap=2e-3, contact=fi.Rigid(0.8))]
    run = fi.integrate(beam(balls=balls, stops=stops), fi.Sine(3e-4, 18.0), EXACT, 4.0, fi.Recorder(every=8))
    assert {"hard", "soft"} <= set(run.impacts.impactor)
    assert run.energy.residual < 1e-10


def test_twelve_soft_pairs():
    balls = [
        fi.Impactor(f"ball {i}", at=0.3 - 0.015 * i, mass=5e-4, gap=2e-4 + 1e-5 * i, contact=SOFT) for i in range(12)
    ]
    run = fi.integrate(beam(3, balls=balls), fi.Sine(3e-4, 18.0), EXACT, 1.0, fi.Recorder(channels=("tip",), every=8))
    assert set(run.impacts.impactor) == {ball.name for ball in balls}
    assert run.energy.residual < 1e-10


@pytest.mark.parametrize("law", [SOFT, fi.Rigid(0.6)])
def test_the_peak_of_a_cycle_is_exact_and_does_not_hang_on_the_grid(law):
    ball = fi.Impactor("ball", at="tip", mass=3e-3, gap=4e-4, contact=law)
    system, base = beam(balls=[ball]), fi.Sine(2e-4, 17.0)
    coarse, fine = (
        fi.integrate(system, base, fi.EventDriven(samples_per_cycle=n), 3 / 17.0, fi.Recorder(channels=("tip",)))
        for n in (8, 20_000)
    )
    assert len(coarse.impacts) > 0
    # the last cycle's largest sample misses the crest by (omega dt)^2/8 at most: 1e-7 with the modes at work
    last = fine.time >= 2 / 17.0
    assert coarse.steady.peak[0] == pytest.approx(np.abs(fine["tip"][last]).max(), rel=1e-6)
    assert coarse.steady.peak[0] == pytest.approx(fine.steady.peak[0], rel=1e-9)
    assert coarse.steady.peak[0] >= np.abs(fine["tip"][last]).max() * (1.0 - 1e-9)


def test_the_peak_of_a_beam_that_hits_a_rigid_stop_is_the_gap():
    system = beam(stops=[fi.Stop("stop", at="tip", gap=(1e-3, math.inf), contact=fi.Rigid(0.7))])
    curve = fi.frequency_sweep(system, 1e-3, [16.0, 18.0], EXACT, cycles=30)
    # the beam sways farther to its free side; the cycles' maxima are the gap, touched between two samples
    assert np.all(curve.peak >= 1e-3 * (1.0 - 1e-9))


def test_each_case_of_a_call_has_its_own_contacts_and_the_bits_it_has_alone():
    """Frequency, amplitude, phase, gaps, restitution, stiffness and damping differ; closed forms are shared."""
    rng, count = np.random.default_rng(7), 24
    balls = [
        fi.Impactor("hard", at="tip", mass=2e-3, gap=5e-4, contact=fi.Rigid(0.6)),
        fi.Impactor("soft", at=0.2, mass=1e-3, gap=3e-4, contact=SOFT),
    ]
    system = beam(balls=balls)
    bases, contacts = [], []
    for _ in range(count):
        base = fi.Sine(rng.uniform(2e-4, 4e-4), rng.uniform(14.0, 20.0), rng.uniform(0.0, 6.0))
        bases.append(base)
        hard, soft = system.contacts
        law = fi.KelvinVoigt(stiffness=rng.choice([1e4, 3e4]), restitution=rng.choice([0.4, 0.8]))
        contacts.append((
            dataclasses.replace(hard, gaps=tuple(rng.uniform(2e-4, 6e-4, 2)), law=fi.Rigid(rng.uniform(0.2, 0.9))),
            dataclasses.replace(soft, gaps=tuple(rng.uniform(2e-4, 6e-4, 2)), law=law),
        ))  # fmt: skip
    row = system.point_row("tip")
    frequency, amplitude, phase = np.array([(base.frequency, base.amplitude, base.phase) for base in bases]).T
    cases = SineCases(
        frequency, amplitude, phase, gaps=np.array([[pair.gaps for pair in pairs] for pairs in contacts]),
        laws=tuple(tuple(pair.law for pair in pairs) for pairs in contacts), law_of=np.arange(count),
        initial=fi.State(), ball_displacement=np.zeros((count, 2)), ball_velocity=np.zeros((count, 2)),
        cycles=np.full(count, 24), measured=np.full(count, 8),
    )  # fmt: skip

    def run(own, threads):
        return EXACT.run_cases(system, cases.of(np.array(own)), row, 1, threads)

    together, spread = run(list(range(count)), 1), run(list(range(count)), 2)
    assert np.all(together.residual < 1e-9)
    assert np.all(together.totals[0].sum(axis=0) > 0)
    for name in ("residual", "totals"):
        np.testing.assert_array_equal(getattr(together, name), getattr(spread, name))
    np.testing.assert_array_equal(together.motion.peak, spread.motion.peak)
    for i in (0, 11, 23):
        alone = run([i], 1)
        np.testing.assert_array_equal(alone.totals[:, :, 0], together.totals[:, :, i])
        np.testing.assert_array_equal(alone.motion.peak[0], together.motion.peak[i])
