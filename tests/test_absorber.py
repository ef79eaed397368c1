"""Absorbers and dashpots of balls: closed-form responses, limits, energy balances, methods, files and the optimum."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, UNDRAWN_STUDY, read_study, study_text
from command import femimpact
from scipy.linalg import expm

import femimpact as fi
from femimpact.sweep.curve import transient_left

pytestmark = pytest.mark.impacts

MASS, STIFFNESS, DAMPING = 0.1, 0.08, 0.03
SYSTEM = {"M": [[1.0]], "C": [[0.01]], "K": [[1.0]], "points": {"tip": [1.0]}}
ABSORBER = fi.Absorber("absorber", "tip", MASS, STIFFNESS, DAMPING)
BASE = fi.Sine(amplitude=0.01, frequency=0.95 / (2.0 * math.pi))
PERIOD = 1.0 / BASE.frequency
METHODS = {
    "event-driven": fi.EventDriven(),
    "newmark": fi.Newmark(dt=PERIOD / 400),
    "energy-consistent": fi.Newmark(dt=PERIOD / 400, contact="energy-consistent"),
    "moreau-jean": fi.MoreauJean(dt=PERIOD / 400),
    "hht": fi.HHT(dt=PERIOD / 400, alpha=-0.05),
    "generalized-alpha": fi.GeneralizedAlpha(dt=PERIOD / 400),
}
CHANNELS = ("tip", "absorber", "absorber.velocity", "absorber.gap", "absorber.acceleration", "tip.acceleration")


def two_dof_response(stiffness=STIFFNESS, damping=DAMPING):
    """Complex amplitudes of structure and body, relative to the base, of the two coupled equations."""
    M, omega = np.diag([1.0, MASS]), BASE.omega
    joined = np.array([[1.0, -1.0], [-1.0, 1.0]])
    K, C = np.diag([1.0, 0.0]) + stiffness * joined, np.diag([0.01, 0.0]) + damping * joined
    load = omega**2 * BASE.amplitude * np.array([1.0, MASS])
    return np.linalg.solve(K + 1j * omega * C - omega**2 * M, load)


def shaken(body, method, cycles=150, record=None, base=BASE, **contacts):
    system = fi.System.from_matrices(**SYSTEM, **(contacts or {"absorbers": [body]}))
    return fi.integrate(system, base, method, cycles * PERIOD, record or fi.Recorder(channels=CHANNELS))


def harmonic(run, name):
    """Complex amplitude of the last 50 cycles of a channel, which are steady to 1e-9."""
    last = run.time > run.time[-1] - 50.0 * PERIOD
    time, values = run.time[last], run.channels[name][last]
    waves = np.column_stack([np.sin(BASE.omega * time), np.cos(BASE.omega * time)])
    first, second = np.linalg.lstsq(waves, values, rcond=None)[0]
    return first + 1j * second


@pytest.mark.parametrize("name", METHODS)
def test_steady_motion_is_that_of_two_coupled_masses(name):
    run, exact = shaken(ABSORBER, METHODS[name]), two_dof_response()
    # steps of 1/400 of a cycle shift a phase by (omega dt)^2/12 = 2e-5; the event-driven run is exact
    share = 1e-8 if name == "event-driven" else 1e-3
    relative = exact[1] - exact[0]
    wanted = {
        "tip": exact[0], "absorber": exact[1], "absorber.gap": relative,
        "absorber.velocity": 1j * BASE.omega * exact[1],
    }  # fmt: skip
    if name not in ("energy-consistent", "moreau-jean"):
        # those keep a mean force for a step, and no acceleration at its end
        wanted |= {f"{who}.acceleration": -(BASE.omega**2) * exact[i] for i, who in enumerate(("tip", "absorber"))}
    for channel, amplitude in wanted.items():
        assert abs(harmonic(run, channel) - amplitude) < share * abs(amplitude), channel
    assert len(run.impacts) == 0
    assert not run.warnings


@pytest.mark.parametrize("name", ["event-driven", "newmark", "energy-consistent", "moreau-jean"])
def test_energy_balance_closes_with_the_loss_of_the_dashpot(name):
    run = shaken(ABSORBER, METHODS[name], cycles=40, record=fi.Recorder(channels=("absorber.gap",)))
    # constant average acceleration keeps the balance of linear equations exactly, a closed form to rounding
    assert run.energy.residual < 1e-10
    # of the steady motion the dashpot takes c omega^2 X^2/2 on average
    exact = two_dof_response()
    per_cycle = 0.5 * DAMPING * BASE.omega**2 * abs(exact[1] - exact[0]) ** 2 * PERIOD
    late = np.interp([30.0 * PERIOD, 40.0 * PERIOD], run.time, run.energy.contact_loss)
    # the transient has decayed to exp(-30 cycles * 0.15 per radian)
    np.testing.assert_allclose((late[1] - late[0]) / 10.0, per_cycle, rtol=1e-2)


@pytest.mark.parametrize("drive", ["broken line", "polynomials", "sum"])
def test_balance_closes_under_records_and_chirps(drive):
    time = np.arange(0.0, 60.0, 0.5)
    base = {
        "broken line": fi.RecordedBase(samples=0.01 * np.sin(0.9 * time), interval=0.5),
        "polynomials": fi.RandomBase(psd=[[0.05, 1e-4], [0.5, 1e-4]], duration=60.0, seed=1),
        "sum": fi.Chirp(start=0.05, stop=0.3, duration=60.0, amplitude=0.01),
    }[drive]
    system = fi.System.from_matrices(**SYSTEM, absorbers=[ABSORBER])
    exact = fi.integrate(system, base, fi.EventDriven(), 60.0, fi.Recorder(channels=("tip", "absorber")))
    steps = fi.integrate(system, base, fi.Newmark(dt=5e-3), 60.0, fi.Recorder(channels=("tip", "absorber")))
    assert exact.energy.residual < 1e-9
    assert exact.energy.contact_loss[-1] > 0.0
    for name in ("tip", "absorber"):
        ours = np.interp(exact.time, steps.time, steps.channels[name])
        # errors of (omega dt)^2/12 of the period over some ten cycles, and of reading between steps
        # but for the last sample, beyond the last step
        assert np.abs(ours - exact.channels[name])[:-1].max() < 2e-3 * np.abs(exact.channels[name]).max()


@pytest.mark.parametrize("law", [fi.Rigid(0.6), fi.KelvinVoigt(restitution=0.6, contact_time=0.1)])
def test_dashpot_beside_impacts(law):
    ball = fi.Impactor("absorber", "tip", MASS, 0.03, law, free_stiffness=STIFFNESS, free_damping=DAMPING)
    rigid = isinstance(law, fi.Rigid)
    steps = fi.MoreauJean(dt=PERIOD / 4000) if rigid else fi.Newmark(dt=PERIOD / 4000)
    runs = [shaken(ball, method, 3, impactors=[ball]) for method in (fi.EventDriven(), steps)]
    assert len(runs[0].impacts) >= 2
    assert len(runs[0].impacts) == len(runs[1].impacts)
    assert runs[0].energy.residual < 1e-9
    assert runs[1].energy.residual < 1e-2
    # a step of 1/4000 of a cycle meets an impact to 1/4000 of one, which each impact passes on
    for name in ("tip", "absorber"):
        ours = np.interp(runs[0].time, runs[1].time, runs[1].channels[name])
        assert np.abs(ours - runs[0].channels[name]).max() < 2e-2 * np.abs(runs[0].channels[name]).max()


@pytest.mark.parametrize("name", ["event-driven", "newmark", "hht", "energy-consistent"])
def test_absorber_without_damping_is_a_ball_on_a_spring_with_walls_out_of_reach(name):
    body = replace(ABSORBER, damping=0.0)
    ball = fi.Impactor("absorber", "tip", MASS, 1e3, fi.KelvinVoigt(stiffness=1.0, damping=0.0), STIFFNESS)
    ours, theirs = shaken(body, METHODS[name], 10), shaken(ball, METHODS[name], 10, impactors=[ball])
    for channel in CHANNELS:
        # the same equations, in the same operations but for the order of sums of zeros
        np.testing.assert_allclose(ours.channels[channel], theirs.channels[channel], rtol=0.0, atol=1e-15)


def test_stiff_spring_makes_a_point_mass():
    body = fi.Absorber("body", "tip", 3.43e-3, 1e6, 0.0)
    # undamped: Rayleigh damping would be that of other modes and masses
    beam, base = replace(REFERENCE, damping=None), fi.Sine(amplitude=1e-4, frequency=4.0)
    glued = replace(beam, impactors=(), masses=(*beam.masses, fi.PointMass("body", "tip", 3.43e-3)))
    hung = replace(beam, impactors=(), absorbers=(body,))
    runs = [
        fi.integrate(fi.reduce(fi.assemble(one, 8), 16), base, fi.EventDriven(), 0.25, fi.Recorder(channels=("tip",)))
        for one in (glued, hung)
    ]
    # the spring gives way by m omega^2/k = 2e-6 of the motion, at the mode of 5 Hz; all 16 modes of the mesh are kept
    largest = np.abs(runs[0].channels["tip"]).max()
    assert np.abs(runs[0].channels["tip"] - runs[1].channels["tip"]).max() < 1e-4 * largest


def test_dashpot_alone_brakes_a_ball_that_nothing_pulls_back():
    # a structure that cannot move: v' = -c v/m
    ball = fi.Impactor("ball", "tip", 0.5, 10.0, fi.Rigid(0.5), free_damping=0.2)
    system = fi.System.from_matrices([[1e9]], [[0.0]], [[1e9]], points={"tip": [1.0]}, impactors=[ball])
    start, still = fi.State(ball_velocity=[1.0]), fi.Sine(amplitude=0.0, frequency=1.0)
    for method, share in ((fi.EventDriven(), 1e-8), (fi.MoreauJean(dt=1e-3), 1e-6)):
        run = fi.integrate(system, still, method, 5.0, fi.Recorder(channels=("ball.velocity",)), start)
        np.testing.assert_allclose(run.channels["ball.velocity"], np.exp(-0.4 * run.time), rtol=share)
        np.testing.assert_allclose(run.energy.contact_loss[-1], 0.25 * (1.0 - math.exp(-4.0)), rtol=1e-5)


def test_absorber_at_rest_hangs_on_its_spring():
    structure = replace(REFERENCE, impactors=(), gravity=-9.81, absorbers=(fi.Absorber("body", "tip", 2e-3, 5.0, 0.1),))
    system = fi.assemble(structure, 6)
    u, y = fi.static_state(system)
    # k x = m g
    np.testing.assert_allclose(y[0] - system.point_row("tip") @ u, -2e-3 * 9.81 / 5.0, rtol=1e-12)
    reduced = fi.reduce(system, 2)
    run = fi.integrate(reduced, fi.Sine(0.0, 5.0), fi.EventDriven(), 1.0, fi.Recorder(channels=("body.gap",)),
                       fi.State.static())  # fmt: skip
    np.testing.assert_allclose(run.channels["body.gap"], -2e-3 * 9.81 / 5.0, rtol=1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.003, 0.03, 0.1])
def test_transient_that_is_left_is_that_of_the_coupled_motion(damping):
    """After a release of the structure, by the exponential of the matrix of both equations."""
    body = replace(ABSORBER, damping=damping)
    system = fi.System.from_matrices(**SYSTEM, absorbers=[body])
    joined, mass = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[1.0], [MASS]])
    lower = -np.hstack([np.diag([1.0, 0.0]) + STIFFNESS * joined, np.diag([0.01, 0.0]) + damping * joined]) / mass
    matrix = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), lower])
    step = 0.25
    one, state, moved = expm(step * matrix), np.array([1.0, 0.0, 0.0, 0.0]), []
    for _ in range(1600):
        moved.append(abs(state[0]))
        state = one @ state
    for begin in (0.0, 20.0, 60.0, 150.0):
        left = transient_left(system, begin)[2]
        # within a beat of 2 pi/0.3 the parts meet, as far as they last
        later = max(moved[int(begin / step) : int((begin + 22.0) / step)])
        assert later <= left * 1.001
        assert later >= 0.45 * left
    bare = transient_left(fi.System.from_matrices(**SYSTEM), 60.0)
    light = fi.System.from_matrices(**SYSTEM, absorbers=[replace(body, mass=1e-9, stiffness=1e-9, damping=0.0)])
    assert transient_left(light, 60.0)[2] == pytest.approx(bare[2], rel=1e-3)


def test_a_tuned_absorber_leaves_nothing_that_a_longer_dwell_would_change():
    bare = replace(REFERENCE, impactors=())
    absorber = fi.tuned_absorber(bare, mass=3.43e-3, at="tip")
    system = fi.reduce(fi.assemble(replace(bare, absorbers=[absorber]), elements=10), 2)
    curves = [fi.frequency_sweep(system, 2e-4, [4.5, 5.5], fi.EventDriven(), cycles=n) for n in (200, 2000)]
    np.testing.assert_allclose(curves[0].peak, curves[1].peak, rtol=1e-9)
    assert not any("transient is left" in text for curve in curves for text in curve.warnings)
    assert all("transient" not in text for text in curves[0].warnings)


def test_sweep_agrees_with_the_closed_form():
    absorber = fi.tuned_absorber(replace(REFERENCE, impactors=()), 3.43e-3)
    structure = replace(REFERENCE, impactors=(), absorbers=(absorber,))
    system, frequencies = fi.reduce(fi.assemble(structure, 8), 8), np.array([4.4, 4.9, 5.8])
    by_events = fi.frequency_sweep(system, 1e-4, frequencies, fi.EventDriven(), cycles=400)
    by_steps = fi.frequency_sweep(system, 1e-4, frequencies, fi.Newmark(dt=5e-4), cycles=400)
    exact = 1e-4 * response_of(fi.assemble(structure, 8), absorber, frequencies)
    # 8 of 16 modes: the others give way by 1e-4 of the tip's flexibility
    np.testing.assert_allclose(by_events.peak, exact, rtol=2e-3)
    np.testing.assert_allclose(by_steps.peak, exact, rtol=5e-3)
    assert by_events.energy_residual.max() < 1e-9


def response_of(system, absorber, frequencies, under="base"):
    """|w/ub| or |w/F| of the absorber's place, by complex solutions for all dofs, its own beside them."""
    omega = 2.0 * math.pi * np.asarray(frequencies)[:, None, None]
    n, row = system.dofs, system.point_row(absorber.at)
    stretch = np.append(-row, 1.0)
    M, C, K = np.zeros((3, n + 1, n + 1))
    for matrix, own in ((M, system.M), (C, system.C), (K, system.K)):
        matrix[:n, :n] = own.toarray()
    M[n, n] = absorber.mass
    K += absorber.stiffness * np.outer(stretch, stretch)
    C += absorber.damping * np.outer(stretch, stretch)
    of_base, of_force = np.append(system.base_load, absorber.mass), np.append(row, 0.0)
    load = omega**2 * of_base[:, None] if under == "base" else np.ones_like(omega) * of_force[:, None]
    return np.abs(np.linalg.solve(K + 1j * omega * C - omega**2 * M, load)[:, :n, 0] @ row)


@pytest.mark.parametrize("under", ["base", "force"])
@pytest.mark.parametrize(
    ("mass", "at", "damping"),
    [(3.43e-3, "tip", REFERENCE.damping), (3e-6, "tip", REFERENCE.damping), (2e-2, "tip", None), (4e-3, "mid", None)],
)
def test_tuned_absorber_is_the_best_of_a_fine_search(mass, at, damping, under):
    structure = replace(REFERENCE, impactors=(), damping=damping)
    found = fi.tuned_absorber(structure, mass, at, under=under)
    system = fi.assemble(structure, 8)
    modes = fi.solve_modes(system, 1)
    first, mu = modes.natural_frequency[0], mass * float(system.point_row(at) @ modes.vectors[:, 0]) ** 2
    spread = 4.0 * math.sqrt(mu)
    frequencies = first * np.linspace(max(1.0 - spread, 0.35), 1.0 + spread, 91)

    def largest(absorber):
        return response_of(system, absorber, frequencies, under).max()

    def absorber(tuning, ratio):
        omega = 2.0 * math.pi * first * tuning
        return replace(found, stiffness=found.mass * omega**2, damping=2.0 * ratio * found.mass * omega)

    tuning = math.sqrt(found.stiffness / found.mass) / (2.0 * math.pi * first)
    ratio = found.damping / (2.0 * math.sqrt(found.stiffness * found.mass))
    best = min(
        largest(absorber(tuning * (1.0 + a), ratio * (1.0 + b)))
        for a in np.linspace(-0.02, 0.02, 9) for b in np.linspace(-0.2, 0.2, 9)
    )  # fmt: skip
    assert largest(found) < 1.01 * best
    # and far from it nothing is better
    far = [absorber(tuning * f, ratio * z) for f in (0.8, 0.9, 1.0, 1.1) for z in (0.25, 0.5, 2.0)]
    assert all(largest(body) > largest(found) for body in far)


def test_start_of_the_search_is_the_optimum_under_an_acceleration():
    """Warburton's numbers leave the smallest |w/(ub''/omega1^2)| of an undamped mass, to what fixed points miss."""
    g = np.linspace(0.4, 1.8, 4001)

    def largest(mu, f, z):
        hung = f**2 + 2j * z * f * g
        pull = mu * g**2 * hung / (hung - g**2)
        # w = (1 + D/g^2)/(1 - g^2 - D) per ub''/omega1^2
        return np.abs((1.0 + pull / g**2) / (1.0 - g**2 - pull)).max()

    for mu in (0.02, 0.1):
        f, z = math.sqrt(1.0 - mu / 2.0) / (1.0 + mu), math.sqrt(3.0 * mu / (4.0 * (1.0 + mu) * (2.0 - mu)))
        best = min(largest(mu, f * a, z * b) for a in np.linspace(0.98, 1.02, 17) for b in np.linspace(0.85, 1.15, 13))
        assert largest(mu, f, z) < 1.01 * best


STUDY = """
[beam]
length = 0.2
width = 0.02
thickness = 1e-3
young_modulus = 70e9
density = 2700
[mesh]
elements = 4
[[impactor]]
name = "ball"
at = 0.1
mass = 1e-3
gap = 1e-3
free_stiffness = 2.0
free_damping = 0.01
contact = { law = "kelvin-voigt", restitution = 0.6, contact_time = 2e-3 }
[[absorber]]
name = "body"
at = "tip"
mass = 2e-3
stiffness = 5.5
damping = 0.0123456789012345
[reduction]
modes = 2
[base]
amplitude = 1e-4
frequency = 20.0
duration = 1.0
"""


def test_study_file_goes_round(tmp_path):
    study = read_study(STUDY, tmp_path / "study.toml")
    assert study.structure.absorbers == (fi.Absorber("body", "tip", 2e-3, 5.5, 0.0123456789012345),)
    assert study.structure.impactors[0].free_damping == 0.01
    changed = replace(study, structure=replace(study.structure, gravity=-9.81))
    again = read_study(study_text(changed), tmp_path / "study.toml")
    assert again.structure == changed.structure


def test_axes_of_a_parameter_study(tmp_path):
    study = read_study(STUDY, tmp_path / "study.toml")
    study = replace(study, method={"name": "event-driven"}, structure=replace(study.structure, impactors=()))
    axes = {"absorber.body.stiffness": [4.0, 6.0], "absorber.body.damping": [0.01, 0.02]}
    run = {"measures": ["peak"], "cycles": 300, "threads": 1}
    damped = replace(study, structure=replace(study.structure, damping=fi.Rayleigh(ratio=0.02, modes=(1, 2))))
    several, single = fi.parameter_study(damped, axes, starts=3, **run), fi.parameter_study(damped, axes, **run)
    # a linear motion settles to the same from every start
    np.testing.assert_allclose(several["peak"], single["peak"], rtol=1e-6)
    for i, stiffness in enumerate(axes["absorber.body.stiffness"]):
        for j, damping in enumerate(axes["absorber.body.damping"]):
            body = fi.Absorber("body", "tip", 2e-3, stiffness, damping)
            system = fi.assemble(replace(damped.structure, absorbers=(body,)), 4)
            # two of eight modes
            np.testing.assert_allclose(single["peak"][i, j], 1e-4 * response_of(system, body, [20.0]), rtol=2e-2)


def test_case_under_a_chirp_is_the_run_of_its_absorber(tmp_path):
    chirp = 'kind = "chirp"\nstart = 18.0\nstop = 22.0\namplitude = 1e-4\nduration = 1.0'
    text = STUDY.replace("amplitude = 1e-4\nfrequency = 20.0\nduration = 1.0", chirp)
    study = read_study(text, tmp_path / "study.toml")
    study = replace(study, method={"name": "event-driven"}, structure=replace(study.structure, impactors=()))
    stiffness = [4.0, 6.0]
    found = fi.parameter_study(study, {"absorber.body.stiffness": stiffness}, measures=["peak"], starts=2, threads=1)
    assert np.all(np.isfinite(found["peak"]))
    one = fi.parameter_study(study, {"absorber.body.stiffness": stiffness}, measures=["peak"], threads=1)
    for value, each in zip(one["peak"], stiffness, strict=True):
        body = fi.Absorber("body", "tip", 2e-3, each, 0.0123456789012345)
        system = fi.reduce(fi.assemble(replace(study.structure, absorbers=(body,)), 4), 2)
        run = fi.integrate(system, study.base, fi.EventDriven(), 1.0, fi.Recorder(interval=1e-3))
        # the largest is found between samples by both
        assert value == pytest.approx(abs(run.largest("tip").value), rel=1e-3)


def test_planned_test_has_no_contact_and_no_wall_of_an_absorber():
    body = fi.Absorber("tuned", "tip", 1e-3, 1.0, 0.01)
    system = fi.reduce(fi.assemble(replace(REFERENCE, impactors=(), absorbers=(body,)), 8), 3)
    found = fi.preflight(system, fi.Sine(1e-4, 5.0), duration=20.0, initial=fi.State.at_rest("space"))
    assert not [row.what for row in found.rows if "tuned" in row.what]
    run = fi.integrate(system, fi.Sine(1e-4, 5.0), fi.EventDriven(), 20.0, initial=fi.State.at_rest("space"))
    (deflection,) = (row for row in found.rows if row.what.startswith("largest deflection"))
    # the absorber of the run is that of the test
    assert deflection.value == pytest.approx(abs(run.largest("tip").value) / system.length, rel=1e-9)


WRONG = {
    "mass": (0.0, "mass = 0.0 kg: must be a finite number > 0 and <= 1e+30 kg"),
    "stiffness": (0.0, "stiffness = 0.0 N/m: must be a finite number > 0 N/m"),
    "damping": (-1.0, "damping = -1.0 N s/m: must be a finite number >= 0 N s/m"),
}


@pytest.mark.parametrize("field", WRONG)
def test_bad_numbers_are_one_line(field):
    value, words = WRONG[field]
    with pytest.raises(fi.InputError) as refused:
        replace(ABSORBER, **{field: value})
    assert str(refused.value) == words


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fi.Structure(REFERENCE.beam, absorbers=[fi.PointMass("a", "tip", 1.0)]), "absorbers"),
        (lambda: fi.Structure(REFERENCE.beam, absorbers=[ABSORBER, ABSORBER]), "must be distinct"),
        (lambda: fi.Structure(REFERENCE.beam, absorbers=[replace(ABSORBER, at=9.0)]), "absorber.absorber.at"),
        (lambda: fi.assemble(fi.Structure(REFERENCE.beam, absorbers=[replace(ABSORBER, at="nose")]), 4), "nose"),
        (lambda: fi.Impactor("b", "tip", 1.0, 1.0, fi.Rigid(0.5), free_damping=-1.0), "free_damping = -1.0 N s/m"),
        (
            lambda: fi.Impactor("b", "tip", 1.0, 1.0, fi.contact.SwitchingSpring(1.0, 1e3), free_damping=1.0),
            "free_damping = 1.0 N s/m: must be 0 N s/m with the law switching-spring",
        ),
        (lambda: fi.System.from_matrices(**SYSTEM, absorbers=[replace(ABSORBER, at="nose")]), "nose"),
        (lambda: fi.tuned_absorber(REFERENCE, -1.0), "mass = -1.0 kg"),
        (lambda: fi.tuned_absorber(REFERENCE, 1.0), "mass = 1.0 kg: must be 2.586e-08 to 0.02586 kg"),
        (lambda: fi.tuned_absorber(REFERENCE, 1e-3, "root"), "must be a place that moves in mode 1"),
        (lambda: fi.tuned_absorber(REFERENCE, 1e-3, "nose"), "nose"),
        (lambda: fi.tuned_absorber("beam", 1e-3), "structure"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(make, words):
    with pytest.raises(fi.InputError) as refused:
        make()
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_default_channels_have_no_contact_force_of_an_absorber():
    run = shaken(ABSORBER, fi.EventDriven(), 2, fi.Recorder())
    assert set(run.channels) == {"tip", "absorber"}


CASES = {
    "two equal": [(3e-3, 3.0, 0.04), (3e-3, 3.0, 0.04)],
    "critically damped": [(3e-3, 3.0, 2.0 * math.sqrt(3.0 * 3e-3))],
    "nearly rigid dashpot": [(3e-3, 3.0, 1e3)],
    "nearly no spring": [(3e-3, 1e-6, 1e-9)],
}


@pytest.mark.parametrize("case", CASES)
def test_balance_closes_where_eigenvalues_meet_or_lie_far_apart(case):
    bodies = [fi.Absorber(f"body {i}", "tip", *numbers) for i, numbers in enumerate(CASES[case])]
    system = fi.reduce(fi.assemble(replace(REFERENCE, impactors=(), absorbers=bodies), 6), 3)
    run = fi.integrate(system, fi.Sine(2e-4, 5.0), fi.EventDriven(), 3.0)
    # rounding, times what the dashpot of 1e3 N s/m is beside the others
    assert run.energy.residual < 1e-9


def test_forces_at_the_base_agree_where_an_absorber_stands_on_the_support():
    bodies = [fi.Absorber("low", "root", 2e-3, 3.0, 0.04), fi.Absorber("high", "tip", 3e-3, 3.0, 0.04)]
    system = fi.assemble(replace(REFERENCE, impactors=(), damping=None, absorbers=bodies), 4)
    record = fi.Recorder(channels=("root.reaction_force", "shaker_force"))
    for one, method in ((system, fi.Newmark(dt=1e-4)), (fi.reduce(system, system.dofs), fi.EventDriven())):
        run = fi.integrate(one, fi.Sine(2e-4, 5.0), method, 0.3, record)
        reaction, shaker = (run.channels[name] for name in record.channels)
        # the balance of momentum, to the rounding of a stiff mesh
        np.testing.assert_allclose(reaction, shaker, rtol=0.0, atol=1e-9 * np.abs(shaker).max())


def test_results_and_pictures_show_the_absorber(tmp_path):
    study = read_study(STUDY, tmp_path / "study.toml")
    plain = replace(study.structure, impactors=())
    output = replace(study.output, frames=4, frame_cycles=1.0, movie=False)
    study = replace(study, structure=plain, method={"name": "event-driven"}, output=output)
    results = fi.run_study(study, tmp_path / "out", parts=("modes", "simulate"))
    assert {"body", "body.velocity", "body.gap"} <= set(results.history.data_vars)
    assert {"phase_portrait.png", "deflection.pvd", "report.html"} <= {p.name for p in (tmp_path / "out").rglob("*")}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "cantilever of 200 mm with an absorber" in page
    assert "2 g on 5.5 N/m and 0.01235 N s/m at 200 mm" in page
    # what is drawn again from the results is the same
    assert fi.load(tmp_path / "out").summary == results.summary


@pytest.mark.parametrize(
    ("number", "absorbers", "words"),
    [(0, 1, "absorber"), (0, 2, "absorbers"), (1, 0, "ball"), (2, 0, "balls"), (1, 1, "ball and absorber")],
)
def test_texts_name_what_the_structure_carries(request, tmp_path, number, absorbers, words):
    if "ball" in words:
        # its texts are looked at for what is there; in pictures too for what must not be there
        request.getfixturevalue("empty_pictures")
    text = UNDRAWN_STUDY
    begin, end = text.index("[[impactor]]"), text.index("[damping]")
    ball = text[begin:end]
    bodies = "".join(ball.replace('name = "ball"', f'name = "b{i}"') for i in range(number))
    for i in range(absorbers):
        bodies += f'[[absorber]]\nname = "a{i}"\nat = "tip"\nmass = 3e-3\nstiffness = 3.0\ndamping = 0.03\n'
    (tmp_path / "study.toml").write_text(text[:begin] + bodies + text[end:], encoding="utf-8")
    printed = femimpact("run", "study.toml", "-o", "out", cwd=tmp_path).stdout
    assert f"Largest peak with {words}: " in printed
    assert f"Peak without {words} over peak with " in printed
    assert f" without {words}" in femimpact("check", "study.toml", cwd=tmp_path).stdout
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    page = re.sub(r"<(script|style).*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL)
    for label in (f"Largest peak without {words}", f"Largest peak with {words}"):
        assert label in page
    if "ball" not in words:
        assert not re.search(r"(with|without) (the )?balls?\b", page)
