"""What a periodic orbit knows: amplitudes, energies, clearances, histories over one period, and its figure."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray
from builders import REFERENCE, oscillator, reduced, with_ball
from orbit_cases import MODELS
from test_orbits import box, units_of

import femimpact as fi
from femimpact.orbits.orbit import state_vector

pytestmark = pytest.mark.impacts

READ = 3e-6
"""Relative error of rms and first harmonic: 1,024 samples of a curve with bends at impacts, some (2 pi/1024)^2/12."""


def random_orbit(seed):
    """The orbit where a run of a random damper or stop settles, if it has settled; rigid or Kelvin-Voigt."""
    rng = np.random.default_rng(seed)
    modes, is_rigid = int(rng.integers(1, 4)), seed % 2 == 0
    omega = 2 * math.pi * 5 * np.array([1.0, 6.27, 17.5])[:modes]
    shape = 5.0 * np.append(1.0, rng.uniform(-1, 1, modes - 1))
    e, gap, frequency = rng.uniform(0.3, 0.8), rng.uniform(0.5e-3, 2e-3), 5 * rng.uniform(0.85, 1.2)
    law = fi.Rigid(e) if is_rigid else fi.KelvinVoigt(restitution=e, contact_time=10 ** rng.uniform(-3, -2.2))
    ball = fi.Impactor("ball", "tip", rng.uniform(1e-3, 4e-3), gap, law, acceleration=rng.choice([0.0, -0.1]))
    stop = fi.Stop("stop", "tip", (gap, math.inf), law, fixed_to=("base", "space")[int(rng.integers(2))])
    pair = {"impactors": [ball]} if rng.random() < 0.6 else {"stops": [stop]}
    system = fi.System.from_matrices(
        np.eye(modes), np.diag(0.04 * omega), np.diag(omega**2), points={"tip": shape, "mid": 0.4 * shape[::-1]},
        base_load=rng.uniform(0.1, 0.3, modes), **pair,
    )  # fmt: skip
    base = fi.Sine(rng.uniform(0.2e-3, 0.6e-3), frequency)
    run = fi.integrate(system, base, fi.EventDriven(), 300 / frequency, fi.Recorder(channels=(), ledger=False))
    for cycles in (1, 2, 3):
        try:
            return fi.find_orbit(system, base, cycles, guess=run)
        except (fi.DivergenceError, fi.InputError):
            continue
    return None


@pytest.fixture(scope="module")
def settled():
    """Twenty orbits of each kind of contact."""
    found = {True: [], False: []}
    for seed in range(300):
        kind = found[seed % 2 == 0]
        if len(kind) < 20 and (orbit := random_orbit(seed)) is not None and len(orbit.events):
            kind.append(orbit)
    assert {len(each) for each in found.values()} == {20}
    return [*found[True], *found[False]]


@pytest.fixture(scope="module")
def beam():
    system = reduced(with_ball(REFERENCE, contact=fi.Rigid(0.6), gap=2e-3), 4)
    run = fi.integrate(system, fi.Sine(0.2037e-3, 5.3), fi.EventDriven(), 80.0)
    return fi.find_orbit(system, run.base, guess=run)


@pytest.fixture(scope="module")
def branch(beam):
    return fi.continue_orbit(beam, "frequency", (4.9, 5.6))


@pytest.fixture(scope="module")
def asymmetric(branch):
    """Unstable orbits without symmetry: a multiplier of up to some 20."""
    one, _ = fi.orbits.switch_branch(next(each for each in branch.bifurcations if each.kind == "symmetry-breaking"))
    return fi.continue_orbit(one, "frequency", (4.9, 5.6))


@pytest.fixture(scope="module")
def doubled():
    """An orbit of two cycles at a compliant stop."""
    wall = fi.Stop("wall", "mass", (1.0, math.inf), fi.KelvinVoigt(stiffness=50.0, damping=1.0))
    system, omega = oscillator(1.0, 0.1, stops=[wall]), 0.8
    level = abs(1 - omega**2 + 0.1j * omega)
    push = fi.PointForce("mass", fi.Sine(0.5 * level, omega / (2 * math.pi)))
    orbit = fi.find_orbit(system, push, guess=fi.State())
    linear = fi.continue_orbit(orbit, "amplitude", (0.1, 0.7))
    (single,) = fi.orbits.switch_branch(next(each for each in linear.bifurcations if each.kind == "grazing"))
    single = fi.continue_orbit(single, "amplitude", (0.1, 0.7))
    return fi.orbits.switch_branch(next(each for each in single.bifurcations if each.kind == "period-doubling"))[0]


def dense_run(orbit, channels, samples=8192):
    """A run of several periods that begins in space where the orbit is."""
    record = fi.Recorder(channels=channels, ledger=False)
    method = fi.EventDriven(samples_per_cycle=samples)
    return fi.integrate(orbit.system, orbit.excitation, method, 3 * orbit.period, record, orbit.state)


# ---- energies ---------------------------------------------------------------------------------------


def assert_balanced(orbit):
    moved, growth = orbit.energy.largest_input, max(1.0, abs(orbit.multipliers[0]))
    # rounding of the state, some 1e-13 of its units, grows over the period
    assert abs(orbit.work - orbit.losses) < 1e-12 * growth * moved
    assert orbit.losses == orbit.structure_loss + orbit.contact_loss
    assert orbit.structure_loss > 0
    np.testing.assert_allclose(orbit.contact_loss, orbit.impacts.energy_loss.sum(), atol=1e-12 * growth * moved)
    assert orbit.energy.residual < 1e-9


def test_the_excitation_does_the_work_that_is_lost(settled):
    for orbit in settled:
        assert_balanced(orbit)


def test_a_branch_of_doubled_orbits_reads_both_cycles(doubled):
    """Its peaks and first harmonics are those of orbits and of a run of many periods."""
    branch = fi.continue_orbit(doubled, "amplitude", (0.1, 0.7), points=3)
    for i, orbit in enumerate(branch.orbits):
        run = fi.integrate(orbit.system, orbit.excitation, fi.EventDriven(), 30 * orbit.period, initial=orbit.state)
        for steady in (orbit.steady(), run.steady):
            assert branch.peak[i] == pytest.approx(float(steady.peak[0]), rel=1e-6)
            assert branch.first_harmonic[i] == pytest.approx(float(steady.first_harmonic[0]), rel=1e-4)


def test_the_work_is_what_is_lost_on_unstable_orbits_and_over_several_cycles(asymmetric, doubled, beam):
    unstable = [orbit for orbit in asymmetric.orbits if not orbit.is_stable]
    assert max(abs(orbit.multipliers[0]) for orbit in unstable) > 10
    for orbit in [*unstable[::6], doubled, beam]:
        assert_balanced(orbit)
    twice = fi.find_orbit(beam.system, beam.excitation, cycles=2, guess=beam)
    np.testing.assert_allclose([twice.work, twice.losses], [2 * beam.work, 2 * beam.losses], rtol=1e-11)


def test_energies_that_are_kept_cannot_be_written_to(beam):
    with pytest.raises(ValueError, match="read-only"):
        beam.energy.work[:] = 0.0


def test_the_work_of_a_linear_motion_is_that_of_its_dashpot():
    """In a cycle pi c omega |X|^2, of x = Im(X e^(i omega t)) under a force."""
    omega, stiffness, damping = 0.9, 1.0, 0.1
    system, push = oscillator(stiffness, damping), fi.PointForce("mass", fi.Sine(0.3, omega / (2 * math.pi), 0.7))
    orbit = fi.find_orbit(system, push, guess=fi.State())
    amplitude = abs(0.3 / (stiffness - omega**2 + 1j * damping * omega))
    exact = math.pi * damping * omega * amplitude**2
    np.testing.assert_allclose([orbit.work, orbit.losses, orbit.structure_loss], exact, rtol=1e-11)
    assert orbit.contact_loss == 0


def test_the_dashpot_of_an_absorber_is_in_the_losses_of_contacts():
    absorber = fi.Absorber("body", "mass", 0.1, 0.09, 0.01)
    system = oscillator(1.0, 0.02, absorbers=[absorber])
    orbit = fi.find_orbit(system, fi.PointForce("mass", fi.Sine(1.0, 0.15)), guess=fi.State())
    omega = 2 * math.pi * 0.15
    M, C = np.diag([1.0, 0.1]), np.array([[0.03, -0.01], [-0.01, 0.01]])
    K = np.array([[1.09, -0.09], [-0.09, 0.09]])
    x, y = np.linalg.solve(K - omega**2 * M + 1j * omega * C, [1.0, 0.0])
    np.testing.assert_allclose(orbit.contact_loss, math.pi * omega * 0.01 * abs(y - x) ** 2, rtol=1e-10)
    np.testing.assert_allclose(orbit.structure_loss, math.pi * omega * 0.02 * abs(x) ** 2, rtol=1e-10)


# ---- momentum ---------------------------------------------------------------------------------------


def test_the_walls_carry_the_weight_of_the_ball(settled):
    """Over a period the momentum of the ball is unchanged, of impulses and of forces."""
    with_gravity = 0
    for orbit in settled:
        for ball in orbit.system.balls:
            of_ball = orbit.impacts.impactor == ball.name
            on_beam = float(orbit.impacts.side[of_ball] @ orbit.impacts.impulse[of_ball])
            size = orbit.impacts.impulse[of_ball].sum()
            bound = 1e-10 * max(1.0, abs(orbit.multipliers[0])) * size
            assert on_beam == pytest.approx(ball.mass * ball.acceleration * orbit.period, abs=bound)
            with_gravity += ball.acceleration != 0
    assert with_gravity >= 5


# ---- amplitudes -------------------------------------------------------------------------------------


def test_a_linear_structure_has_its_frequency_response():
    structure = replace(REFERENCE, impactors=(), damping=fi.Rayleigh(0.02, (1, 2)))
    system, base = reduced(structure, 3), fi.Sine(1e-3, 5.1, 0.3)
    orbit = fi.find_orbit(system, base, guess=fi.State())
    omega = 2 * math.pi * base.frequency
    M, C, K = (matrix.toarray() for matrix in (system.M, system.C, system.K))
    response = np.linalg.solve(K - omega**2 * M + 1j * omega * C, system.base_load * base.amplitude * omega**2)
    for place in ("tip", "mid", 0.1):
        exact = system.point_row(place) @ response
        motion = orbit.steady(place)
        np.testing.assert_allclose([motion.peak[0], motion.first_harmonic[0]], abs(exact), rtol=1e-9)
        np.testing.assert_allclose(motion.rms[0], abs(exact) / math.sqrt(2), rtol=1e-9)
        # to the phase of the base, which begins at 0.3 rad
        assert abs(np.exp(1j * motion.phase[0]) - exact / abs(exact)) < 1e-9
        assert motion.steadiness.tolist() == ["periodic"]


def test_amplitudes_are_those_of_a_settled_run(settled):
    """At every place and of every ball, from runs that go on from the orbit and are read eight times as often."""
    for orbit in [each for each in settled if abs(each.multipliers[0]) < 0.95]:
        places = ["tip", "mid", *(ball.name for ball in orbit.system.balls)]
        run = dense_run(orbit, places)
        for place in places:
            values, motion = run[place][1:], orbit.steady(place)
            largest = np.abs(run[place]).max()
            # its crests lie between the samples: at most v h/2 of a bend
            assert largest * (1 - 1e-9) <= motion.peak[0] <= largest * (1 + 1e-3)
            np.testing.assert_allclose(motion.peak[0], abs(run.largest(place).value), rtol=1e-8)
            np.testing.assert_allclose(motion.rms[0], np.sqrt(np.mean(values**2)), rtol=READ)
            turn = np.exp(-1j * (2 * math.pi * orbit.excitation.frequency * run.time[1:]))
            first = 2j * np.mean(values * turn)
            error = motion.first_harmonic[0] * np.exp(1j * motion.phase[0]) - first
            assert abs(error) < READ * motion.peak[0]


def test_impulses_and_the_load_give_the_first_harmonic(settled):
    """(K - omega^2 M + i omega C) U = load + b F of the first harmonics, of impulses F = 2/T sum J e^(-i omega t)."""
    checked = 0
    for orbit in settled:
        system, base = orbit.system, orbit.excitation
        if not system.contacts[0].parameters.is_rigid:
            continue
        checked += 1
        omega = 2 * math.pi * base.frequency
        M, C, K = (matrix.toarray() for matrix in (system.M, system.C, system.K))
        impacts, (pair,) = orbit.impacts, system.contacts
        # of Im(F e^(i omega t)), on the structure along the direction of the pair
        force = 2j / orbit.period * np.sum(impacts.side * impacts.impulse * np.exp(-1j * omega * impacts.time))
        load = system.base_load * base.amplitude * omega**2 + pair.direction * force
        exact = system.point_row("tip") @ np.linalg.solve(K - omega**2 * M + 1j * omega * C, load)
        motion = orbit.steady()
        error = motion.first_harmonic[0] * np.exp(1j * motion.phase[0]) - exact
        assert abs(error) < READ * motion.peak[0]
    assert checked == 20


def test_a_branch_has_the_peaks_of_its_orbits(asymmetric):
    for i in range(0, len(asymmetric), 8):
        motion = asymmetric.orbits[i].steady()
        np.testing.assert_allclose(motion.peak[0], asymmetric.peak[i], rtol=1e-7)
        # 64 samples in a cycle
        np.testing.assert_allclose(motion.first_harmonic[0], asymmetric.first_harmonic[i], rtol=64**2 * READ)


def test_a_symmetric_orbit_has_no_mean(beam):
    data = beam.to_xarray()
    for name in ("tip", "ball", "ball.gap"):
        values = data[name].to_numpy()[:-1]
        assert abs(values.mean()) < 1e-11 * np.abs(values).max()
        np.testing.assert_allclose(np.roll(values, values.size // 2), -values, atol=1e-10 * np.abs(values).max())


@pytest.mark.parametrize("name", MODELS)
def test_the_phase_of_the_excitation_moves_the_orbit_and_changes_none_of_its_numbers(name):
    orbit = MODELS[name].orbit()
    later = fi.find_orbit(orbit.system, replace(orbit.excitation, phase=2.0), guess=orbit)
    for read in ("work", "structure_loss", "contact_loss", "smallest_approach_speed", "smallest_clearance"):
        np.testing.assert_allclose(getattr(later, read), getattr(orbit, read), rtol=1e-9)
    one, other = orbit.steady(), later.steady()
    np.testing.assert_allclose(other.peak, one.peak, rtol=1e-9)
    np.testing.assert_allclose([other.rms, other.first_harmonic], [one.rms, one.first_harmonic], rtol=READ)
    # the harmonic keeps its phase to the base
    assert abs(np.exp(1j * other.phase[0]) - np.exp(1j * one.phase[0])) < 2 * READ
    # and the impacts their phase in the cycle
    phases = [np.sort(np.exp(1j * each.impacts.phase)) for each in (orbit, later)]
    np.testing.assert_allclose(*phases, atol=1e-8)


def test_an_impact_at_the_start_of_the_period_is_in_it_once(beam):
    omega = 2 * math.pi * beam.excitation.frequency
    for time in beam.events.time:
        shifted = replace(beam.excitation, phase=omega * float(time))
        orbit = fi.find_orbit(beam.system, shifted, guess=beam)
        assert np.min(orbit.events.time) < 1e-9 or np.max(orbit.events.time) > orbit.period - 1e-9
        assert_balanced(orbit)
        np.testing.assert_allclose(orbit.work, beam.work, rtol=1e-9)


# ---- the table of impacts ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def held():
    """A mass that two compliant stops press from both sides, of which one is always in contact."""
    law = fi.KelvinVoigt(stiffness=5.0, damping=0.3)
    stops = [
        fi.Stop("above", "mass", (-0.3, math.inf), law),
        fi.Stop("below", "mass", (math.inf, -0.05), law),
    ]
    system, force = oscillator(damping=0.1, stops=stops), fi.PointForce("mass", fi.Sine(6.0, 0.4))
    run = fi.integrate(system, force, fi.EventDriven(), 400.0)
    return run, fi.find_orbit(system, force, guess=run)


def test_where_a_contact_is_always_closed_each_impact_is_whole(held):
    run, orbit = held
    assert np.all(np.any(orbit.events.contact_state != 0, axis=1))
    assert sorted(orbit.impacts.impactor) == ["above", "below"]
    for name in orbit.impacts.impactor:
        settled, found = (np.flatnonzero(table.impactor == name)[-1] for table in (run.impacts, orbit.impacts))
        for column in ("approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss"):
            # the run has settled to rounding: a disturbance falls to 0.61 in each of its 160 periods
            np.testing.assert_allclose(orbit.impacts[column][found], run.impacts[column][settled], rtol=1e-7)
    np.testing.assert_allclose(orbit.impacts.energy_loss.sum(), orbit.contact_loss, rtol=1e-9)
    # a period changes no momentum: the spring of 1 N/m takes what the walls give
    frame = orbit.to_xarray(["mass"])
    taken = np.trapezoid(frame["mass"], frame["time"])
    given = -(orbit.impacts.side * orbit.impacts.impulse).sum()
    assert abs(taken - given) < READ * orbit.impacts.impulse.sum()
    assert abs(given) > 1e3 * READ * orbit.impacts.impulse.sum()


@pytest.mark.parametrize("name", ["rigid", "Kelvin-Voigt", "two balls", "held"])
def test_impacts_are_in_the_order_and_at_the_times_of_their_events(held, name):
    """Also where one is at t = 0, the other side of which is the end of the period."""
    orbit = held[1] if name == "held" else MODELS[name].orbit()
    omega, drive = 2 * math.pi * orbit.excitation.frequency, orbit.excitation
    for time in np.append(orbit.events.time, 0.1 * orbit.period):
        for off in (-1e-15, 0.0, 1e-15):
            phase = omega * float(time) + off
            turned = (
                replace(drive, history=replace(drive.history, phase=phase))
                if isinstance(drive, fi.PointForce)
                else replace(drive, phase=phase)
            )
            found = fi.find_orbit(orbit.system, turned, guess=orbit)
            log, table = found.events, found.impacts
            touches = np.isin(log.kind, ("impact", "touch"))
            assert table.time.tolist() == log.time[touches].tolist()
            assert table.impactor.tolist() == [log.contacts[j] for j in log.pair[touches]]
            assert table.side.tolist() == log.side[touches].tolist()
            assert np.all((table.time >= 0.0) & (table.time < found.period))
            turns = (omega * table.time + phase - table.phase) / (2 * math.pi)
            np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)


def test_arrays_of_an_orbit_are_only_read(beam, held):
    """Its multipliers are kept once they are read: the monodromy must not change after that."""
    for orbit in (beam, held[1]):
        multipliers = orbit.multipliers
        for record in (orbit, orbit.state, orbit.events, orbit.impacts):
            arrays = [value for value in vars(record).values() if isinstance(value, np.ndarray)]
            assert arrays
            assert not any(array.flags.writeable for array in arrays)
        assert not multipliers.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            orbit.monodromy[0, 0] = 1.0


# ---- clearances -------------------------------------------------------------------------------------


def stop_beside(gap, clear):
    """A mass at a stop with a second one on the other side."""
    stops = [
        fi.Stop("near", "mass", (gap, math.inf), fi.Rigid(0.8)),
        fi.Stop("far", "mass", (math.inf, clear), fi.Rigid(0.8)),
    ]
    return oscillator(1.0, 0.1, stops=stops)


def test_the_clearance_of_a_linear_motion_is_the_gap_less_its_amplitude():
    stop = fi.Stop("wall", "mass", (3.0, 4.0), fi.Rigid(0.8))
    push = fi.PointForce("mass", fi.Sine(1.0, 0.2))
    orbit = fi.find_orbit(oscillator(1.0, 0.2, stops=[stop]), push, guess=fi.State())
    omega = 2 * math.pi * 0.2
    amplitude = 1 / abs(1 - omega**2 + 0.2j * omega)
    np.testing.assert_allclose(orbit.clearances["wall"], [3 - amplitude, 4 - amplitude], rtol=1e-12)
    assert orbit.smallest_clearance == pytest.approx(3 - amplitude, rel=1e-12)
    assert orbit.smallest_approach_speed == math.inf


def test_a_wall_that_is_not_met_has_its_distance_from_the_exact_crest():
    system, push = stop_beside(1.0, 5.0), fi.PointForce("mass", fi.Sine(1.0, 1.1 / (2 * math.pi)))
    run = fi.integrate(system, push, fi.EventDriven(), 400 / push.frequency)
    orbit = fi.find_orbit(system, push, guess=run)
    assert len(orbit.impacts) == 1
    assert orbit.clearances["near"] == (math.inf, math.inf)
    # the largest of the displacement is away from the stop
    np.testing.assert_allclose(orbit.clearances["far"][1], 5.0 - orbit.steady().peak[0], rtol=1e-9)
    assert orbit.clearances["far"][0] == math.inf
    np.testing.assert_allclose(orbit.smallest_approach_speed, orbit.impacts.approach_speed[0])


def test_an_extra_contact_begins_where_the_clearance_is_zero_and_an_impact_is_lost_at_no_speed():
    stop = fi.Stop("stop", "mass", (1.0, math.inf), fi.Rigid(0.8))
    system, push = oscillator(1.0, 0.1, stops=[stop]), fi.PointForce("mass", fi.Sine(1.0, 1.1 / (2 * math.pi)))
    run = fi.integrate(system, push, fi.EventDriven(), 400 / push.frequency)
    branch = fi.continue_orbit(fi.find_orbit(system, push, guess=run), "frequency", (0.1, 0.6))
    extra, lost = (next(i for i, end in enumerate(branch.end) if words in end) for words in ("extra", "speed zero"))
    assert {extra, lost} == {0, 1}
    grazing = [each for each in branch.bifurcations if each.kind == "grazing"]
    at = {0: grazing[0].orbit, 1: grazing[-1].orbit}
    assert at[extra].smallest_clearance < 1e-8
    assert at[extra].smallest_approach_speed > 0.1
    assert at[lost].smallest_approach_speed < 1e-8
    # towards it the clearance falls to zero, and stays above before
    near = [orbit.smallest_clearance for orbit in (branch.orbits[:8] if extra == 0 else branch.orbits[-8:][::-1])]
    assert all(0 <= before < after for before, after in itertools.pairwise(near))


def test_the_smallest_approach_speed_is_that_of_the_slowest_impact(settled, asymmetric, doubled):
    for orbit in [*settled, *asymmetric.orbits[::10], doubled]:
        # those of the table are of the run
        bound = 1e-9 * max(1.0, abs(orbit.multipliers[0])) * orbit.impacts.approach_speed.max()
        assert orbit.smallest_approach_speed == pytest.approx(orbit.impacts.approach_speed.min(), abs=bound)


def test_clearances_are_the_crests_of_a_dense_run(settled, asymmetric, doubled):
    """Local extremes of samples, without those at the impacts of the wall itself."""
    finite = 0
    for orbit in [*settled, *asymmetric.orbits[::10], doubled]:
        for j, pair in enumerate(orbit.system.contacts):
            record = fi.Recorder(channels=[f"{pair.name}.gap"], ledger=False)
            method = fi.EventDriven(samples_per_cycle=16384)
            run = fi.integrate(orbit.system, orbit.excitation, method, orbit.period, record, orbit.state)
            x, time = run[f"{pair.name}.gap"][:-1], run.time[:-1]
            for side, gap, found in zip((1, -1), pair.gaps, orbit.clearances[pair.name], strict=True):
                if math.isinf(gap):
                    assert found == math.inf
                    continue
                apart = gap - side * x
                crest = (apart <= np.roll(apart, 1)) & (apart < np.roll(apart, -1)) & (apart > 0)
                met = orbit.events.time[(orbit.events.pair == j) & (orbit.events.side == side)]
                for event in met:
                    crest &= np.minimum(abs(time - event), orbit.period - abs(time - event)) > 3 * time[1]
                nearest = apart[crest].min(initial=math.inf)
                # where a bend lies between two samples: v h
                assert found == nearest or abs(found - nearest) < 1e-3 * gap
                finite += math.isfinite(found)
    assert finite >= 10


# ---- histories --------------------------------------------------------------------------------------


def test_the_histories_go_over_one_period_from_the_state_of_the_orbit(settled, doubled):
    for orbit in [*settled[::5], doubled]:
        data = orbit.to_xarray()
        time = data["time"].to_numpy()
        assert time[0] == 0
        assert time[-1] == orbit.period
        state, row = orbit.state, orbit.system.point_row(orbit.system.default_place)
        unit = units_of(orbit)
        for place, size, rate, shape in (
            (orbit.system.default_place, state.displacement, state.velocity, row),
            *((ball.name, state.ball_displacement, state.ball_velocity, np.eye(len(orbit.system.balls))[i])
              for i, ball in enumerate(orbit.system.balls)),
        ):  # fmt: skip
            scale = 1e-8 * np.abs(shape).sum()
            for end in (0, -1):
                assert abs(data[place].to_numpy()[end] - shape @ size) < scale * unit[0]
                assert abs(data[f"{place}.velocity"].to_numpy()[end] - shape @ rate) < scale * unit[-1]
        np.testing.assert_allclose(data["base"], orbit.excitation.displacement(time))
        np.testing.assert_allclose(data["energy_work"][-1], orbit.work)
        assert data["energy_work"][0] == data["energy_contact_loss"][0] == 0


def test_a_kelvin_voigt_force_has_the_impulses_of_the_table():
    orbit = MODELS["Kelvin-Voigt"].orbit()
    data = orbit.to_xarray()
    force, time = data["ball 0.contact_force"].to_numpy(), data["time"].to_numpy()
    # a force that jumps at touch, on 1024 samples of a cycle: h/2 F of each contact
    for side in (1, -1):
        found = np.trapezoid(np.where(side * force > 0, side * force, 0.0), time)
        exact = orbit.impacts.impulse[orbit.impacts.side == side].sum()
        assert abs(found - exact) < time[1] * np.abs(force).max()


@pytest.mark.parametrize("name", MODELS)
def test_netcdf_gives_it_back(name, tmp_path):
    orbit = MODELS[name].orbit()
    written = orbit.to_xarray()
    written.to_netcdf(tmp_path / "orbit.nc")
    with xarray.open_dataset(tmp_path / "orbit.nc") as read:
        xarray.testing.assert_identical(read.load(), written)
        np.testing.assert_array_equal(read["multipliers_real"] + 1j * read["multipliers_imag"], orbit.multipliers)
        assert ("half_multipliers_real" in read) == orbit.is_symmetric
        assert read.attrs["is_stable"] == 1
        assert read.attrs["period_s"] == orbit.period
        assert read.attrs["work_J"] == orbit.work
        for variable in read.variables.values():
            assert "units" in variable.attrs or variable.dims == ()
        pair = orbit.system.contacts[0].name
        assert read[f"{pair}.gap"].attrs["units"] == "m"
        assert read[f"{pair}.contact_force"].attrs["units"] == "N"


def test_histories_of_channels_that_are_named(beam):
    data = beam.to_xarray(["mid", 0.1, "root.bending_moment"])
    assert {"mid", "0.1", "root.bending_moment"} < set(data)
    assert "tip" not in data
    assert data["root.bending_moment"].attrs["units"] == "N m"
    largest = np.abs(data["root.bending_moment"]).max()
    assert largest <= beam.steady("root.bending_moment").peak[0] < 1.01 * largest


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda orbit: orbit.steady("tp"), "channels = 'tp': unknown; did you mean 'tip'"),
        (lambda orbit: orbit.steady(3j), "channels"),
        (lambda orbit: orbit.to_xarray(["bal.gap"]), "channels = 'bal.gap': unknown; did you mean 'ball'"),
        (
            lambda orbit: fi.figures.orbit(orbit, of="bal", figure=fi.figures.OffScreen()),
            "of = 'bal': unknown; did you",
        ),
        (lambda orbit: fi.figures.orbit(orbit.excitation), "must be a PeriodicOrbit"),
    ],
)
def test_bad_input_is_one_line(beam, call, words):
    with pytest.raises(fi.InputError) as caught:
        call(beam)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


# ---- the figure -------------------------------------------------------------------------------------


def lines_of(axis):
    return {line.get_label(): line for line in axis.get_lines()}


def test_the_figure_has_the_impacts_at_the_walls_and_the_multipliers(beam):
    ((portrait, over_time, plane),) = fi.figures.orbit(beam, figure=fi.figures.OffScreen())
    x, _ = max((line.get_data() for line in portrait.get_lines()), key=lambda data: np.size(data[0]))
    # mm: to both walls, and no further
    np.testing.assert_allclose([x.min(), x.max()], [-2.0, 2.0], atol=1e-6)
    impacts = lines_of(over_time)["impact"].get_xdata()
    np.testing.assert_allclose(np.sort(impacts), np.sort(beam.impacts.time))
    assert over_time.get_xlim() == pytest.approx((0.0, beam.period))
    for label, values in (("multipliers", beam.multipliers), ("half multipliers", beam.half_multipliers)):
        drawn = lines_of(plane)[label]
        np.testing.assert_array_equal(drawn.get_xdata() + 1j * drawn.get_ydata(), values)
    assert "4 modes" in over_time.get_title(loc="left")
    assert plane.get_title(loc="left").startswith("symmetric, stable")


def test_the_section_of_a_doubled_orbit_has_two_points(doubled):
    ((portrait, over_time, plane),) = fi.figures.orbit(doubled, figure=fi.figures.OffScreen())
    (section,) = [line for label, line in lines_of(portrait).items() if str(label).startswith("once per cycle")]
    points = np.unique(np.round(section.get_xydata(), 9), axis=0)
    assert len(points) == 2
    assert over_time.get_title(loc="left").startswith("2 cycles")
    assert "half multipliers" not in lines_of(plane)


@pytest.mark.parametrize("name", MODELS)
def test_every_kind_of_orbit_is_drawn(name):
    orbit = MODELS[name].orbit()
    for of in (None, "place 0", orbit.system.contacts[-1].name):
        axes = fi.figures.orbit(orbit, of, fi.figures.OffScreen())
        assert axes.shape == (1, 3)


def test_a_motion_without_contacts_is_drawn():
    orbit = fi.find_orbit(oscillator(1.0, 0.1), fi.PointForce("mass", fi.Sine(1.0, 0.2)), guess=fi.State())
    ((portrait, _, _),) = fi.figures.orbit(orbit, figure=fi.figures.OffScreen())
    x, rate = max((line.get_data() for line in portrait.get_lines()), key=lambda data: np.size(data[0]))
    # mm and mm/s: an ellipse
    omega = 2 * math.pi * 0.2
    peak = 1e3 * orbit.steady().peak[0]
    np.testing.assert_allclose(np.hypot(x, np.asarray(rate) / omega), peak, rtol=1e-6)


def test_a_published_unstable_orbit_is_drawn_and_balanced():
    (orbit, *_) = fi.orbits.two_impact_orbits(*box(0.1, 0.8, 0.01, 0.98, 20.0))
    assert_balanced(orbit)
    ((_, _, plane),) = fi.figures.orbit(orbit, figure=fi.figures.OffScreen())
    assert "unstable" in plane.get_title(loc="left")
    assert np.abs(state_vector(orbit.state)).max() > 0
