"""Stops fixed in space beside a moving base: the same physics in the absolute frame, exact places, a closed ledger."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from random_structures import random_case

import femimpact as fi

pytestmark = pytest.mark.impacts

FIRST, SECOND = 400.0, 900.0
BASE = fi.Sine(0.02, 2.3)
KELVIN = fi.KelvinVoigt(stiffness=4e4, damping=20.0)
RIGID = fi.Rigid(0.7)
POINTS = {"near": [1.0, 0.0], "far": [0.0, 1.0]}
RECORD = fi.Recorder(("far", "wall.gap", "wall.contact_force"))


def chain(law, fixed_to, gap=(0.015, 0.02), **more):
    """Two masses in a row on springs; the first spring stands on the base."""
    K = np.array([[FIRST + SECOND, -SECOND], [-SECOND, SECOND]])
    stop = fi.Stop("wall", "far", gap, law, fixed_to=fixed_to)
    return fi.System.from_matrices(np.diag([1.0, 0.5]), np.zeros((2, 2)), K, points=POINTS, stops=[stop], **more)


def both_frames(law, method, duration=1.0):
    """One motion relative to the base, and in space, where the base is the force k ub on the first mass."""
    relative = fi.integrate(chain(law, "space"), BASE, method, duration, RECORD, fi.State.at_rest("space"))
    force = fi.PointForce("near", fi.Sine(FIRST * BASE.amplitude, BASE.frequency, BASE.phase))
    return relative, fi.integrate(chain(law, "base"), force, method, duration, RECORD)


METHODS = [
    (KELVIN, fi.Newmark(2e-4)),
    (KELVIN, fi.Newmark(2e-4, contact="energy-consistent")),
    (KELVIN, fi.Newmark(1e-3, refine=10, contact="energy-consistent")),
    (KELVIN, fi.GeneralizedAlpha(2e-4)),
    (fi.contact.Flores(4e5, 0.7), fi.Newmark(2e-4, contact="energy-consistent")),
    (RIGID, fi.MoreauJean(2e-4)),
]


@pytest.mark.parametrize(("law", "method"), METHODS)
def test_a_stop_in_space_is_a_stop_in_the_absolute_frame(law, method):
    off = []
    for finer in (1, 2, 4):
        relative, space = both_frames(law, replace(method, dt=method.dt / finer))
        absolute = relative["far"] + BASE.displacement(relative.time)
        # what the gap bounds is the absolute displacement: to the rounding of the phase
        np.testing.assert_allclose(relative["wall.gap"], absolute, rtol=0, atol=1e-14)
        assert len(relative.impacts) == len(space.impacts) > 5
        off.append(np.abs(absolute - space["far"]).max())
    # both frames step one motion of 0.03 m: order 2 apart, up to where impacts fall within the step
    assert off[2] < 5e-7
    assert off[2] < 0.2 * off[0]


def test_the_ledger_closes_with_the_work_of_what_holds_the_stop():
    elastic = fi.KelvinVoigt(stiffness=4e4, damping=0.0)
    exact = [
        (elastic, fi.Newmark(1e-3, contact="energy-consistent")),
        (KELVIN, fi.Newmark(1e-3, contact="energy-consistent", allow_coarse_step=True)),
        (KELVIN, fi.Newmark(4e-3, contact="energy-consistent", refine=8)),
        (RIGID, fi.MoreauJean(1e-3)),
    ]
    for law, method in exact:
        run = both_frames(law, method, 2.0)[0]
        # at any step, however coarse: rounding
        assert run.energy.residual < 1e-12
    held = both_frames(elastic, exact[0][1], 2.0)[0]
    # nothing is lost, and what the base and the stop's holder put in is stored
    np.testing.assert_allclose(np.diff(held.energy.stored), np.diff(held.energy.work), atol=1e-12)
    # the holder's share by itself: mean force over the way of the obstacle, in every step
    ub = BASE.displacement(held.time)
    holder = np.concatenate([[0.0], np.cumsum(held["wall.contact_force"][1:] * np.diff(ub))])
    assert np.abs(holder).max() > 1e-3 * np.abs(held.energy.work).max()
    # with the force at the step's end the ledger closes with the step
    residuals = [both_frames(KELVIN, fi.Newmark(dt))[0].energy.residual for dt in (4e-4, 1e-4)]
    assert residuals[1] < 0.3 * residuals[0] < 1e-2


def test_work_in_space_differs_by_what_the_base_does_there():
    # in space the base's spring does the work k ub u'; both ledgers lose the same in the contact
    relative, space = both_frames(RIGID, fi.MoreauJean(1e-4))
    np.testing.assert_allclose(relative.energy.contact_loss[-1], space.energy.contact_loss[-1], rtol=1e-4)


@pytest.mark.parametrize("method", [fi.Newmark(2e-4), fi.Newmark(1e-3, refine=5)])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_recorded_base_leaves_the_stop_where_it_was(method, seed):
    rng = np.random.default_rng(seed)
    base = fi.RecordedBase(rng.normal(size=60) * 4.0, 0.03, initial_velocity=-0.05)
    ball = fi.Impactor("ball", "near", 0.05, 0.01, fi.KelvinVoigt(restitution=0.5, contact_time=0.02))
    system = chain(KELVIN, "space", impactors=[ball])
    run = fi.integrate(system, base, method, 1.5, RECORD)
    np.testing.assert_allclose(run["wall.gap"], run["far"] + base.displacement(run.time), rtol=0, atol=1e-14)
    assert "wall" in run.impacts.impactor
    residuals = [
        fi.integrate(system, base, fi.Newmark(dt, contact="energy-consistent"), 1.5, RECORD).energy.residual
        for dt in (1e-3, 5e-4)
    ]
    assert max(residuals) < 1e-12


def test_a_recorded_sine_is_the_sine():
    method, start = fi.Newmark(2e-4, contact="energy-consistent"), fi.State.at_rest("space")
    system, errors = chain(KELVIN, "space"), []
    exact = fi.integrate(system, BASE, method, 0.6, RECORD, start)
    for interval in (4e-3, 2e-3, 1e-3):
        samples = BASE.acceleration(np.arange(round(0.6 / interval) + 1) * interval)
        recorded = fi.RecordedBase(samples, interval, initial_velocity=float(BASE.velocity(0.0)))
        run = fi.integrate(system, recorded, method, 0.6, RECORD, start)
        errors.append(np.abs(run["wall.gap"] - exact["wall.gap"]).max())
    # the broken line is second order in its interval
    np.testing.assert_allclose(errors[:2], [4.0 * errors[1], 4.0 * errors[2]], rtol=0.1)


def test_a_force_moves_no_base_and_both_stops_are_the_same():
    force = fi.PointForce("near", fi.Sine(10.0, 2.3))
    runs = [fi.integrate(chain(KELVIN, where), force, fi.Newmark(2e-4), 1.0, RECORD) for where in ("base", "space")]
    for name in RECORD.channels:
        np.testing.assert_array_equal(runs[0][name], runs[1][name])


def test_a_rigid_mass_on_a_stiff_spring_meets_the_stop_where_the_base_takes_it():
    # the mass follows the base: the first touch is where ub = gap, closed form
    stop = fi.Stop("wall", "mass", (0.01, math.inf), fi.KelvinVoigt(stiffness=100.0, damping=0.0), fixed_to="space")
    stiff = fi.System.from_matrices(1.0, 100.0, 4e7, points={"mass": [1.0]}, stops=[stop])
    run = fi.integrate(stiff, fi.Sine(0.02, 1.0), fi.Newmark(1e-4), 0.6, initial=fi.State.at_rest("base"))
    assert run.impacts.time[0] == pytest.approx(math.asin(0.5) / (2 * math.pi), abs=1e-4)
    # and what the spring of the stop takes is the way of the base beyond it
    assert run.impacts.peak_force[0] == pytest.approx(100.0 * 0.01, rel=1e-4)


def test_reduced_and_full_systems_keep_what_a_stop_is_fixed_to():
    structure = fi.Structure(
        fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700.0),
        stops=(fi.Stop("wall", "tip", 1e-3, RIGID, fixed_to="space"),),
        impactors=(fi.Impactor("ball", "tip", 1e-3, 1e-3, RIGID),),
    )
    full = fi.assemble(structure, elements=4)
    for system in (full, fi.reduce(full, 2), fi.without_impactors(full)):
        assert system.contacts[-1].fixed_to == "space"
    assert full.balls[0].fixed_to == "base"


def test_many_cases_side_by_side_have_each_its_own_base():
    system = chain(KELVIN, "space")
    method = fi.Newmark(5e-4, contact="energy-consistent", allow_coarse_step=True)
    f = np.linspace(1.5, 3.0, 11)
    start = fi.State.at_rest("space")
    curve = fi.frequency_sweep(system, 0.01, f, method, 4, initial=start, at="far", ledger=True, threads=1)
    assert np.max(curve.energy_residual) < 1e-12
    for i in (0, 5, 10):
        alone = fi.frequency_sweep(system, 0.01, f[i : i + 1], method, 4, initial=start, at="far", threads=1)
        assert curve.peak[i] == pytest.approx(alone.peak[0], rel=1e-9)


def pressed(seed):
    """A cantilever under its weight with balls that press on it, and a stop that does not move with the base."""
    rng = np.random.default_rng(seed)
    law, gravity = fi.Rigid(rng.uniform(0.0, 0.8)), -9.81
    beam = fi.Beam.uniform(length=0.3, width=0.02, thickness=1.5e-3, young_modulus=70e9, density=2700.0)
    balls = [
        fi.Impactor(f"ball{i}", at, rng.uniform(1e-3, 5e-3), rng.choice([1e-4, 5e-4]), law, acceleration=gravity)
        for i, at in enumerate(("tip", 0.2, 0.1))
    ]
    structure = fi.Structure(
        beam=beam, masses=[fi.PointMass("box", "tip", 0.02, 1e-6)], impactors=balls, gravity=gravity,
        stops=[fi.Stop("wall", 0.15, rng.choice([1e-4, 1e-3]), law, fixed_to="space")],
        damping=fi.Rayleigh(0.005, modes=(1, 2)),
    )  # fmt: skip
    base = fi.Sine(1.5e-3, rng.uniform(6.0, 14.0)) if seed % 2 else fi.RecordedBase(rng.normal(size=40) * 3.0, 0.01)
    return fi.reduce(fi.assemble(structure, elements=5), modes=10), base


@pytest.mark.parametrize("seed", range(8))
def test_a_ball_comes_to_rest_on_a_beam_that_a_stop_in_space_holds(seed):
    """The pairs that stick take the last approach up at once: their impulses do work where the wall moves."""
    system, base = pressed(seed)
    run = fi.integrate(system, base, fi.EventDriven(), 0.3, fi.Recorder(("wall.gap",)))
    assert "wall" in run.sticking.impactor
    assert len(run.sticking) > 20
    # sums of some thousand impacts
    assert run.energy.residual < 1e-10
    assert np.min(np.diff(run.energy.contact_loss)) >= -1e-12 * run.energy.largest_input
    # a sticking wall is where it is in space, to the closure
    plus, minus = system.contacts[-1].gaps
    assert np.all((run["wall.gap"] < plus + 2e-9) & (run["wall.gap"] > -minus - 2e-9))


def test_what_rests_on_a_stop_in_space_rests_in_space():
    """The stop carries the spring that the base moves, the dashpot and both weights; the ball its own weight alone."""
    K, damping, mass, weight, ball_weight, gap = 400.0, 2.0, 1.0, 9.81, 0.981, 1e-4
    stop = fi.Stop("wall", "mass", (math.inf, gap), fi.Rigid(0.3), fixed_to="space")
    ball = fi.Impactor("ball", "mass", 0.1, (2e-4, gap), fi.Rigid(0.5), acceleration=-9.81)
    system = fi.System.from_matrices(
        mass, damping, K, points={"mass": [1.0]}, stops=[stop], impactors=[ball], constant_load=[-weight]
    )
    base = fi.Sine(2e-3, 1.3)
    run = fi.integrate(
        system, base, fi.EventDriven(), 3.0, fi.Recorder(("mass", "wall.contact_force", "ball.contact_force"))
    )
    # a second after the last impact of the start
    late = run.time > 1.0
    assert np.all(run.impacts.time < 0.1)
    w, rate = -gap - base.displacement(run.time), -base.velocity(run.time)
    np.testing.assert_allclose(run["mass"][late], w[late], rtol=0, atol=1e-15)
    held = K * w + damping * rate + weight + ball_weight
    np.testing.assert_allclose(run["wall.contact_force"][late], held[late], rtol=1e-12)
    np.testing.assert_allclose(np.abs(run["ball.contact_force"][late]), ball_weight, rtol=1e-12)
    assert run.energy.residual < 1e-12


def test_a_stiff_stop_pushes_a_soft_spring_as_two_springs_in_a_row():
    """F = ub/(1/k + 1/K) with k = 1e6 K: a difference of displacements would leave eight digits of the force."""
    K = 200.0
    stop = fi.Stop("wall", "mass", (0.0, math.inf), fi.KelvinVoigt(stiffness=1e6 * K, damping=300.0), fixed_to="space")
    system = fi.System.from_matrices([[1.0]], [[0.5]], [[K]], points={"mass": [1.0]}, stops=[stop])
    # 0.1 s of acceleration, and as much against it: the base is moved by 10 mm, slowly against the contact
    base = fi.RecordedBase([0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0], 0.05)
    run = fi.integrate(system, base, fi.EventDriven(), 2.0, fi.Recorder(("wall.contact_force",)))
    assert run.energy.residual < 1e-12
    held = base.displacement(2.0) / (1.0 / (1e6 * K) + 1.0 / K)
    np.testing.assert_allclose(run["wall.contact_force"][-1], -held, rtol=1e-12)


SEEDS_IN_SPACE = [0, 5, 7, 8, 17, 18, 19, 24, 31, 33, 36, 45, 49, 57, 69, 79, 83, 92, 102, 119]
"""Of the random structures: some that have stops, and a base that moves."""


@pytest.mark.parametrize("seed", SEEDS_IN_SPACE)
def test_random_structures_against_stops_in_space(seed):
    case = random_case(seed)
    stops = tuple(replace(pair, fixed_to="space") if pair.is_stop else pair for pair in case.system.contacts)
    assert stops != case.system.contacts
    assert not isinstance(case.excitation, fi.PointForce)
    system, record, base = replace(case.system, contacts=stops), fi.Recorder(impacts=1_000_000), case.excitation
    # at t = 0 the base is where it is at rest, and the gaps are those given
    base = replace(base, phase=0.0) if isinstance(base, fi.Sine) else base
    run = fi.integrate(system, base, fi.EventDriven(), case.duration, record, fi.State.at_rest("base"))
    # a record may drift further than half the beam's length and moves from its first sample on, stops in space bend the
    # beam as far, and one mode may be driven far above itself, or have few samples in its period: all are warned of
    bent = ("the base moves", "the beam deflects", "where no mode is kept")
    # compliant laws are made for the first mode alone
    allowed = (*bent, "the record is coarse", "begins in motion", "made for the first mode's mass")
    assert [text for text in run.warnings if not any(words in text for words in allowed)] == [], case.description
    assert np.min(np.diff(run.energy.contact_loss)) >= -1e-11 * run.energy.largest_input
