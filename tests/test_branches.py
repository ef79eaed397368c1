"""Branches of periodic orbits: closed forms, frequency responses, and what holds at each bifurcation and step."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, oscillator, reduced, with_ball
from orbit_cases import MODELS
from scipy.optimize import brentq, minimize_scalar
from test_orbits import box

import femimpact as fi
from femimpact.figures.drawing import BLUE
from femimpact.figures.study_labels import path_words
from femimpact.orbits.figures import MARKS
from femimpact.orbits.orbit import state_vector
from femimpact.validation.closed_forms import box_fold, box_orbits, stop_orbits

CASE = {"mu": 0.1, "e": 0.8, "zeta": 0.01, "ratio": 1.0, "clearance": 20.0}
"""A ball in a box on an oscillator that a force of 1 N drives."""

PATHS = {
    "ratio": ("base.frequency", 1.0 / (2.0 * math.pi)),
    "clearance": ("impactor.ball.gap", 0.5),
    "e": ("impactor.ball.contact.restitution", 1.0),
}
"""Path and value of a parameter for one unit of a number of the case."""


def branch_over(number, low, high, **changed):
    """The branch of the faster of the two-impact orbits of the case."""
    orbit, *_ = fi.orbits.two_impact_orbits(*box(*(CASE | changed).values()))
    path, scale = PATHS[number]
    return fi.continue_orbit(orbit, path, (scale * low, scale * high))


@pytest.fixture(scope="module")
def over_gap():
    return branch_over("clearance", 1.0, 400.0)


@pytest.fixture(scope="module")
def beam():
    """The system on which the asymmetric branch begins at 5.01159 Hz."""
    return reduced(with_ball(REFERENCE, contact=fi.Rigid(0.3), gap=2e-3), 3, elements=80)


def settled(system, frequency):
    base = fi.Sine(0.2037e-3, frequency)
    run = fi.integrate(system, base, fi.EventDriven(), 120.0, fi.Recorder(channels=(), ledger=False))
    return fi.find_orbit(system, base, guess=run)


@pytest.fixture(scope="module")
def asymmetric(beam):
    return fi.continue_orbit(settled(beam, 5.027), "frequency", (4.9, 5.2))


@pytest.fixture(scope="module")
def symmetric(beam):
    (orbit,) = fi.orbits.two_impact_orbits(beam, fi.Sine(0.2037e-3, 5.05))
    return fi.continue_orbit(orbit, "frequency", (4.9, 5.2))


def kinds_of(branch):
    return [each.kind for each in branch.bifurcations]


def values_of(branch, kind):
    return [each.value for each in branch.bifurcations if each.kind == kind]


# ---- the quadratic of two impacts, beside the reference cases ---------------------------------------


def test_symmetry_breaking_is_no_fold(over_gap):
    """Though +1 is a multiplier of the full map."""
    assert len(values_of(over_gap, "symmetry-breaking")) == kinds_of(over_gap).count("fold") == 1
    assert "impact speed zero, of ball" in over_gap.end[1]


def test_both_sheets_of_a_fold_are_in_one_branch(over_gap):
    exact = [speed for speed, *_ in box_orbits(*(CASE | {"clearance": 102.0}).values())]
    found = [orbit.impacts.approach_speed[0] for orbit in over_gap.at(51.0)]
    np.testing.assert_allclose(sorted(found), exact, rtol=1e-9)
    assert over_gap.at(over_gap.values.max() * 1.001) == ()
    assert len(over_gap.at(20.0)) == 1


def test_at_a_fold_is_one_orbit_and_inside_it_are_two(over_gap):
    """As far as rounding tells the two roots of the quadratic from one."""
    (fold,) = values_of(over_gap, "fold")
    for apart in 10.0 ** -np.arange(2.0, 11.0):
        value = fold * (1.0 - apart)
        found = over_gap.at(value)
        exact = [speed for speed, *_ in box_orbits(*(CASE | {"clearance": 2.0 * value}).values())]
        speeds = sorted(orbit.impacts.approach_speed[0] for orbit in found)
        assert all(orbit.system.contacts[0].gaps[0] == value for orbit in found)
        # they are 11 times the root of the distance apart, of which this share is an error of 3e-12 of the value, or of
        # what an orbit misses its start by: rounding decides with which step Newton's method ends
        missed = max(3e-12, *(orbit.residual for orbit in found))
        np.testing.assert_allclose(speeds, exact, rtol=11.0 * missed / math.sqrt(apart))
    (at_fold,) = over_gap.at(fold)
    assert np.abs(at_fold.multipliers - 1).min() < 1e-6
    assert over_gap.at(fold * (1 + 1e-9)) == ()


def test_a_branch_begins_at_a_fold_too(over_gap):
    (fold,) = (each for each in over_gap.bifurcations if each.kind == "fold")
    again = fi.continue_orbit(fold.orbit, "impactor.ball.gap", (0.5, 200.0))
    # a symmetric orbit reaches both walls at once
    ends, before = ([end.replace("+", "-") for end in branch.end] for branch in (again, over_gap))
    assert sorted(ends) == sorted(before)
    for one, other in zip(again.bifurcations[::-1], over_gap.bifurcations, strict=True):
        assert one.kind == other.kind
        assert one.value == pytest.approx(other.value, rel=1e-10)


@pytest.mark.parametrize("beyond", [1e-3, 1e-5, 1e-9])
def test_a_branch_ends_at_an_edge_before_a_fold(over_gap, beyond):
    """Where it first leaves the range: the other sheet comes back from outside."""
    (fold,) = values_of(over_gap, "fold")
    edge = fold * (1.0 - beyond)
    branch = branch_over("clearance", 8.0, 2.0 * edge)
    assert branch.end[1].startswith("edge: impactor.ball.gap = 51.")
    assert branch.values[-1] == edge == branch.values.max()
    faster = max(speed for speed, *_ in box_orbits(*(CASE | {"clearance": 2.0 * edge}).values()))
    # as beside a fold
    assert branch.orbits[-1].impacts.approach_speed[0] == pytest.approx(faster, rel=3e-11 / math.sqrt(beyond))


def test_a_closed_branch_is_followed_once():
    """With a gap above the highest linear response the two roots exist between two folds, at no speed nowhere."""
    branch = branch_over("ratio", 0.5, 2.0, clearance=102.0)
    assert branch.end == ("closed on itself", "closed on itself")
    assert kinds_of(branch).count("fold") == 2
    mu, e, zeta, *_ = CASE.values()
    for fold in values_of(branch, "fold"):
        assert box_fold(mu, e, zeta, fold * 2 * math.pi) == pytest.approx(102.0, rel=1e-9)
    assert len(branch.at(1.0 / (2 * math.pi))) == 2
    assert len(branch.at(branch.values.min())) == len(branch.at(branch.values.max())) == 1
    again = fi.continue_orbit(branch.bifurcations[0].orbit, "frequency", (0.5 / (2 * math.pi), 2.0 / (2 * math.pi)))
    assert sorted(kinds_of(again)) == sorted(kinds_of(branch))


@pytest.mark.impacts
def test_the_grazing_of_a_compliant_contact_is_that_of_a_rigid_one():
    """At no speed there is no contact: the amplitude is that at which the linear motion reaches the wall."""
    found = []
    for name in ("rigid", "Kelvin-Voigt"):
        model = MODELS[name]
        branch = fi.continue_orbit(model.orbit(), "amplitude", (1e-6, 3e-4))
        assert branch.end[0].startswith("impact speed zero")
        found.append(branch.bifurcations[0].value)
        assert branch.bifurcations[0].kind == "grazing"
    (natural,), omega, (base_load,) = model.omega, 2 * math.pi * model.frequency, model.base_load
    ((shape, _, gap),) = model.pairs
    w = shape[0] * base_load * omega**2 / (natural**2 - omega**2 + 2j * model.ratio * natural * omega)
    # the ball stays where it is in space
    np.testing.assert_allclose(found, gap / abs(1 + w), rtol=1e-10)


# ---- motions without impacts ------------------------------------------------------------------------


def test_a_linear_beam_has_one_branch():
    """Its frequency response is a reference case."""
    structure = replace(REFERENCE, impactors=(), damping=fi.Rayleigh(0.02, (1, 2)))
    orbit = fi.find_orbit(reduced(structure, 3), fi.Sine(1e-3, 5.1, 0.3), guess=fi.State())
    branch = fi.continue_orbit(orbit, "frequency", (3.0, 8.0))
    assert branch.end == ("edge: base.frequency = 3", "edge: base.frequency = 8")
    assert branch.is_stable.all()
    np.testing.assert_allclose(branch.peak, branch.first_harmonic, rtol=1e-9)
    (at,) = branch.at(4.2)
    again = fi.find_orbit(orbit.system, fi.Sine(1e-3, 4.2, 0.3), guess=fi.State())
    np.testing.assert_allclose(at.state.displacement, again.state.displacement, atol=1e-14)


@pytest.mark.parametrize("frequency", [4.0, 5.3])
def test_a_sharp_resonance_is_passed(frequency):
    """With a damping ratio of 0.0029: steps are a share of a motion that has grown."""
    system = reduced(replace(REFERENCE, impactors=()), 4)
    orbit = fi.find_orbit(system, fi.Sine(0.2037e-3, frequency), guess=fi.State())
    branch = fi.continue_orbit(orbit, "frequency", (4.0, 6.0))
    assert branch.end == ("edge: base.frequency = 4", "edge: base.frequency = 6")
    assert branch.bifurcations == ()
    assert len(branch) < 1000
    # beyond one resonance the response has turned round
    assert branch.peak.max() > 30.0 * max(branch.peak[0], branch.peak[-1])


@pytest.mark.parametrize(("ratio", "of_force"), [(1e-6, False), (1e-6, True), (1e-2, False)])
def test_the_peak_of_an_oscillator_is_reached(ratio, of_force):
    """At the frequency of the peak of its response, of a thousand times the motion at the start and more."""
    system = oscillator(1.0, 2.0 * ratio)
    sine = fi.Sine(1e-3, 0.1, 0.4)
    force = fi.PointForce("mass", sine) if of_force else sine
    branch = fi.continue_orbit(fi.find_orbit(system, force, guess=fi.State()), "frequency", (0.05, 0.5))
    assert branch.end == ("edge: base.frequency = 0.05", "edge: base.frequency = 0.5")
    omega = 2 * math.pi * branch.values
    response = 1e-3 / np.abs(1 - omega**2 + 2j * ratio * omega) * (1.0 if of_force else omega**2)
    # the natural frequency has no more digits than rounding of the matrices
    np.testing.assert_allclose(branch.peak, response, rtol=1e-8)
    assert branch.peak.max() > 0.98 * 1e-3 / (2 * ratio)


def test_a_branch_over_the_frequency_holds_the_acceleration_that_a_sine_is_given_by():
    base = fi.Sine(acceleration=0.5, frequency=0.1, phase=0.4)
    branch = fi.continue_orbit(fi.find_orbit(oscillator(1.0, 0.02), base, guess=fi.State()), "frequency", (0.05, 0.5))
    omega = 2 * math.pi * branch.values
    np.testing.assert_allclose(branch.peak, 0.5 / np.abs(1 - omega**2 + 0.02j * omega), rtol=1e-8)
    (at,) = branch.at(0.2)
    assert at.excitation == fi.Sine(acceleration=0.5, frequency=0.2, phase=0.4)


def test_an_amplitude_grows_five_thousand_times():
    """A linear motion is in proportion to it."""
    orbit = fi.find_orbit(oscillator(1.0, 0.02), fi.Sine(1e-3, 0.1, 0.4), guess=fi.State())
    branch = fi.continue_orbit(orbit, "amplitude", (0.0, 5.0))
    assert branch.end == ("edge: base.amplitude = 0", "edge: base.amplitude = 5")
    np.testing.assert_allclose(branch.peak, branch.values * orbit.steady("mass").peak / 1e-3, rtol=1e-9, atol=1e-15)


def test_a_motion_without_damping_has_no_bifurcations():
    """Its multipliers are on the unit circle all along: rounding moves them over it."""
    orbit = fi.find_orbit(oscillator(1.0, 0.0), fi.Sine(1e-3, 0.1, 0.4), guess=fi.State())
    assert fi.continue_orbit(orbit, "frequency", (0.08, 0.13)).bifurcations == ()


@pytest.mark.parametrize(("ratio", "amplitude"), [(0.8, 0.2), (1.3, 0.3)])
def test_a_crest_ends_a_branch_where_it_reaches_the_wall(ratio, amplitude):
    """Of a linear motion it is the amplitude of the response."""
    wall = fi.Stop("wall", "mass", (1.0, math.inf), fi.Rigid(0.8))
    system, force = oscillator(1.0, 0.1, stops=[wall]), fi.Sine(amplitude, ratio / (2 * math.pi))
    orbit = fi.find_orbit(system, fi.PointForce("mass", force), guess=fi.State())
    branch = fi.continue_orbit(orbit, "amplitude", (0.0, 3.0))
    exact = math.hypot(1 - ratio**2, 0.1 * ratio)
    assert branch.end[0] == "edge: base.amplitude = 0"
    assert branch.end[1].startswith("extra contact of wall on its + side")
    (grazing,) = branch.bifurcations
    assert grazing.kind == "grazing"
    assert grazing.value == pytest.approx(exact, rel=1e-10)
    over_gap = fi.continue_orbit(orbit, "stop.wall.gap", (0.0, 3.0))
    assert over_gap.bifurcations[0].value == pytest.approx(amplitude / exact, rel=1e-10)


# ---- asymmetric branches ----------------------------------------------------------------------------


@pytest.mark.impacts
def test_two_neimark_sacker_points_3_mhz_apart_are_found(asymmetric):
    found = values_of(asymmetric, "neimark-sacker")
    np.testing.assert_allclose(found, [5.025867, 5.028924], atol=1.5e-6)


@pytest.mark.impacts
def test_no_multiplier_near_the_unit_circle_moves_far_in_a_step(asymmetric):
    """By at most 0.1 where it is within 0.3 of the circle: two Neimark-Sacker points in one step would go unseen."""
    far = []
    for here, there in itertools.pairwise(asymmetric.multipliers):
        apart = np.abs(here[:, None] - there)
        for one, distances in ((here, apart.min(axis=1)), (there, apart.min(axis=0))):
            far.extend(distances[np.abs(np.abs(one) - 1.0) < 0.3])
    assert 0.05 < max(far) < 0.1 + 1e-12


@pytest.mark.impacts
@pytest.mark.parametrize("start", [5.184870350741823, 5.24, 5.24020925, 5.32])
def test_two_neimark_sacker_points_in_one_step_are_found_from_every_start(start):
    """Beyond both the number of multipliers outside the unit circle is what it was."""
    beam = reduced(with_ball(REFERENCE, contact=fi.Rigid(0.8), gap=2e-3), 3, elements=40)
    (orbit,) = fi.orbits.two_impact_orbits(beam, fi.Sine(0.2037e-3, start))
    branch = fi.continue_orbit(orbit, "frequency", (4.9, 5.6))
    low, high, *_ = values_of(branch, "neimark-sacker")
    # of the same beam on a finer mesh they are 5.256771598 and 5.266205630
    np.testing.assert_allclose([low, high], [5.25677, 5.26621], atol=1e-5)
    assert not any(each.is_stable for each in branch.at(0.5 * (low + high)))
    assert branch.warnings == ()


@pytest.mark.parametrize("more", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("start", [0.9, 1.0, 1.06])
def test_two_symmetry_breakings_in_one_step_are_those_of_the_closed_form(start, more):
    """Above a restitution at which the determinant of the half map and 1 touches zero it has two roots."""
    mu, zeta, clearance = 0.025, 0.05, 23.5

    def test(ratio, e):
        half = max(box_orbits(mu, e, zeta, ratio, clearance), key=lambda orbit: orbit[0])[-1]
        return float(np.linalg.det(half + np.eye(len(half))))

    def least(e):
        return minimize_scalar(lambda ratio: test(ratio, e), bounds=(0.96, 0.99), options={"xatol": 1e-10}).x

    e = brentq(lambda e: test(least(e), e), 0.5, 0.54) + more
    exact = [brentq(lambda ratio: test(ratio, e), *pair) for pair in ((0.95, least(e)), (least(e), 1.0))]
    branch = branch_over("ratio", 0.6, 1.4, mu=mu, e=e, zeta=zeta, ratio=start, clearance=clearance)
    found = 2.0 * math.pi * np.array(values_of(branch, "symmetry-breaking"))
    np.testing.assert_allclose(np.sort(found), exact, rtol=1e-9)
    assert branch.warnings == ()


@pytest.mark.impacts
def test_a_change_of_stability_that_no_bifurcation_explains_is_said(asymmetric):
    """As of a branch of which one Neimark-Sacker point had been missed."""
    missed = [each.kind for each in asymmetric.bifurcations].index("neimark-sacker")
    others = [i for i in range(len(asymmetric.bifurcations)) if i != missed]
    keep = np.delete(np.arange(len(asymmetric)), asymmetric.bifurcation_points[missed])
    found = np.searchsorted(keep, asymmetric.bifurcation_points[others])
    branch = replace(
        asymmetric, bifurcations=tuple(asymmetric.bifurcations[i] for i in others), bifurcation_points=found,
        **{name: getattr(asymmetric, name)[keep]
           for name in ("values", "multipliers", "peak", "first_harmonic", "unknowns")},
    )  # fmt: skip
    (words,) = branch.warnings
    assert "the multipliers outside the unit circle change from" in words
    assert "\nunexplained   between base.frequency = 5.02" in str(branch)
    frame, value = branch.to_pandas(), asymmetric.bifurcations[missed].value
    (row,) = np.flatnonzero(frame["bifurcation"] == "unexplained")
    low, high = sorted(branch.values[[row - 1, row]])
    assert low < value < high
    assert asymmetric.warnings == ()
    assert set(asymmetric.to_pandas()["bifurcation"]) == {"", *kinds_of(asymmetric)}


@pytest.mark.parametrize("start", [5.07, 5.12])
def test_every_change_of_stability_is_explained_where_bifurcations_lie_close(start):
    """Five modes with impacts that graze at both ends of the branch: one step would pass several bifurcations."""
    system = fi.System.from_matrices(
        np.eye(5), np.diag([0.2891489, 1.769405, 4.936432, 10.12181, 16.98199]),
        np.diag([1009.908, 37817.52, 294350.5, 1237528.0, 3483500.0]),
        points={"tip": [2.554894, -2.769566, -1.792057, -1.505366, 2.537632]},
        base_load=[0.2614713, 0.1090854, 0.2924295, 0.1032195, 0.1486595],
        impactors=[fi.Impactor("ball", "tip", 3.014875e-3, 1.444392e-3, fi.Rigid(0.5))],
    )  # fmt: skip
    orbit, *_ = fi.orbits.two_impact_orbits(system, fi.Sine(3.128796e-5, start))
    branch = fi.continue_orbit(orbit, "frequency", (4.3, 6.1), points=300)
    assert len(values_of(branch, "neimark-sacker")) > 2
    assert branch.warnings == ()


@pytest.mark.impacts
@pytest.mark.parametrize("apart", [1e-2, 1e-4, 1e-6])
def test_two_doublings_in_one_step_are_both_found(apart):
    """Two oscillators alone, half a cycle apart, whose stops differ a little: -1 is passed twice the same way.

    The product of both tests keeps its sign, but two multipliers more are outside the unit circle. The force at
    which one impact a cycle doubles is in proportion to the distance of the stop.
    """
    damping, restitution, ratio = 0.05, 0.8, 0.8

    def at_minus_one(force):
        return np.linalg.det(stop_orbits(damping, restitution, ratio, 1.0, force)[-1][-1] + np.eye(2))

    exact = brentq(at_minus_one, 0.45, 0.6, xtol=1e-15) * np.array([1.0, 1.0 + apart])
    stops = [
        fi.Stop(f"wall {i}", f"mass {i}", (distance, math.inf), fi.Rigid(restitution))
        for i, distance in enumerate((1.0, 1.0 + apart))
    ]
    system = fi.System.from_matrices(
        np.eye(2), 2 * damping * np.eye(2), np.eye(2), points={"mass 0": [1.0, 0.0], "mass 1": [0.0, 1.0]},
        base_load=[1.0, -1.0], stops=stops,
    )  # fmt: skip
    # the force on a unit of the base load is omega squared times the amplitude
    base = fi.Sine(0.6 / ratio**2, ratio / (2 * math.pi))
    run = fi.integrate(system, base, fi.EventDriven(), 400 / base.frequency, fi.Recorder(channels=(), ledger=False))
    orbit = fi.find_orbit(system, base, guess=run)
    assert len(orbit.impacts) == 2
    branch = fi.continue_orbit(orbit, "amplitude", (0.5 / ratio**2, 0.65 / ratio**2))
    np.testing.assert_allclose(np.multiply(values_of(branch, "period-doubling"), ratio**2), exact, rtol=1e-10)


@pytest.mark.impacts
def test_an_asymmetric_branch_ends_on_the_symmetric_one(asymmetric, symmetric):
    exact = values_of(symmetric, "symmetry-breaking")
    assert exact[0] == pytest.approx(5.01159, abs=1e-5)
    np.testing.assert_allclose(values_of(asymmetric, "symmetry-breaking"), exact, rtol=1e-10)
    assert all(words.startswith("joins a symmetric branch") for words in asymmetric.end)
    assert not asymmetric.orbits[len(asymmetric) // 2].is_symmetric
    assert asymmetric.bifurcations[0].orbit.is_symmetric


@pytest.mark.impacts
def test_a_branch_is_the_same_from_any_of_its_orbits(beam, asymmetric):
    again = fi.continue_orbit(settled(beam, 5.035), "frequency", (4.9, 5.2))
    assert kinds_of(again) == kinds_of(asymmetric)
    for one, other in zip(again.bifurcations, asymmetric.bifurcations, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-10)


@pytest.mark.impacts
def test_a_doubled_orbit_has_branch_points_where_the_single_one_doubles(branches):
    """Twice its period, the multipliers are squares: -1 is +1 without a fold."""
    single, model = branches["gravity"], MODELS["gravity"]
    orbit = model.orbit()
    twice = fi.find_orbit(orbit.system, orbit.excitation, cycles=2, guess=orbit)
    branch = fi.continue_orbit(twice, "frequency", (4.5, 6.5))
    np.testing.assert_allclose(values_of(branch, "branch-point"), values_of(single, "period-doubling"), rtol=1e-10)
    for kind in ("fold", "grazing", "neimark-sacker"):
        np.testing.assert_allclose(values_of(branch, kind), values_of(single, kind), rtol=1e-10)
    assert values_of(single, "period-doubling")
    assert "period-doubling" not in kinds_of(branch)


def test_twice_an_orbit_has_a_branch_point_where_it_loses_its_symmetry(over_gap):
    """Where the equations are singular: the point is found from others around it."""
    system, force = box(*CASE.values())
    orbit, *_ = fi.orbits.two_impact_orbits(system, force)
    branch = fi.continue_orbit(fi.find_orbit(system, force, 2, guess=orbit), "impactor.ball.gap", (3.0, 20.0))
    np.testing.assert_allclose(values_of(branch, "branch-point"), values_of(over_gap, "symmetry-breaking"), rtol=1e-10)


@pytest.mark.parametrize("points", [2, 3, 5, 20])
def test_no_side_has_more_points_than_asked_for(over_gap, points):
    """Bifurcations among them."""
    orbit = over_gap.at(9.0)[0]
    branch = fi.continue_orbit(orbit, "impactor.ball.gap", (0.5, 200.0), points=points)
    assert branch.end == (f"number of points: {points}",) * 2
    assert len(branch) == 2 * points - 1
    assert all(point < len(branch) for point in branch.bifurcation_points)
    assert f"{len(branch)} points" in str(branch)


def test_a_number_without_a_unit_has_none_in_print():
    assert " to 0.85, " in str(branch_over("e", 0.75, 0.85))


# ---- what holds for every branch --------------------------------------------------------------------


@pytest.fixture(scope="module")
def branches(over_gap, asymmetric, symmetric):
    several = {"over gap": over_gap, "asymmetric": asymmetric, "symmetric": symmetric}
    orbit = MODELS["two balls"].orbit()
    several["two balls"] = fi.continue_orbit(orbit, "frequency", (4.5, 6.5))
    several["gravity"] = fi.continue_orbit(MODELS["gravity"].orbit(), "base.frequency", (4.5, 6.5))
    several["Kelvin-Voigt"] = fi.continue_orbit(MODELS["Kelvin-Voigt"].orbit(), "frequency", (4.5, 6.5))
    several["stop in space"] = fi.continue_orbit(MODELS["stop in space"].orbit(), "amplitude", (1e-5, 2e-3))
    return several


NAMES = ("over gap", "asymmetric", "symmetric", "two balls", "gravity", "Kelvin-Voigt", "stop in space")


@pytest.mark.impacts
@pytest.mark.parametrize("name", NAMES)
def test_a_multiplier_is_on_the_unit_circle_at_each_bifurcation(branches, name):
    for each in branches[name].bifurcations:
        full, half = each.orbit.multipliers, each.orbit.half_multipliers
        if each.kind == "fold":
            assert np.abs(full - 1).min() < 1e-6
            # of a symmetric orbit +1 of the half map
            assert half.size == 0 or np.abs(half - 1).min() < 1e-6
        elif each.kind == "symmetry-breaking":
            assert np.abs(half + 1).min() < 1e-6
        elif each.kind == "period-doubling":
            assert half.size == 0
            assert np.abs(full + 1).min() < 1e-6
        elif each.kind == "neimark-sacker":
            nearest = full[np.argmin(np.abs(np.abs(full) - 1))]
            assert abs(abs(nearest) - 1) < 1e-6
            assert abs(nearest.imag) > 1e-6
        else:
            assert each.kind == "grazing"


@pytest.mark.impacts
@pytest.mark.parametrize("name", NAMES)
def test_stability_changes_only_at_bifurcations(branches, name):
    """The number of multipliers outside the unit circle changes between two points by those that cross between them."""
    assert branches[name].warnings == ()
    assert branches[name].bifurcations


@pytest.mark.impacts
@pytest.mark.parametrize("name", NAMES)
def test_every_orbit_is_that_which_find_orbit_finds(branches, name):
    branch = branches[name]
    for i in range(3, len(branch), max(len(branch) // 5, 1)):
        if branch.to_pandas()["bifurcation"][i]:
            continue
        orbit = branch.orbits[i]
        assert orbit.residual <= 1e-10 * max(1.0, abs(orbit.multipliers[0]))
        found = fi.find_orbit(orbit.system, orbit.excitation, guess=orbit)
        size = np.maximum(np.abs(found.multipliers), 1.0)
        assert np.max(np.abs(np.abs(branch.multipliers[i]) - np.abs(found.multipliers)) / size) < 1e-7
        speed = orbit.length * 2 * math.pi * orbit.excitation.frequency
        if min(orbit.impacts.approach_speed) < 1e-2 * speed:
            # its run leaves it by rounding times a multiplier of 1/speed
            continue
        np.testing.assert_allclose(found.impacts.approach_speed, orbit.impacts.approach_speed, rtol=1e-9)
        run = fi.integrate(orbit.system, orbit.excitation, fi.EventDriven(), orbit.period, initial=orbit.state)
        assert run.steady.peak[0] == pytest.approx(branch.peak[i], rel=1e-6)


@pytest.fixture(scope="module")
def undamped():
    """A branch through the natural frequency of an oscillator without damping."""
    orbit, *_ = fi.orbits.two_impact_orbits(*box(*(CASE | {"zeta": 0.0, "ratio": 0.99}).values()))
    return fi.continue_orbit(orbit, "frequency", (0.157, 0.161))


def test_an_orbit_between_two_points_that_no_run_confirms_is_refused(undamped):
    """Beside the resonance the steady response is 1e5 to 1e7 gaps, and rounding of it is no orbit to 1e-10."""
    first = 1.0 / (2.0 * math.pi)
    assert undamped.values[0] < first < undamped.values[-1]
    (far,) = undamped.at(0.158)
    assert far.residual <= 1e-10
    for near, words in (
        ((1.0 + 1e-8) * first, "own run misses its start by"),
        (first, "an orbit of the branch is not found"),
    ):
        with pytest.raises(fi.DivergenceError, match=words) as refused:
            undamped.at(near)
        assert f"base.frequency = {near:.10g}" in str(refused.value)


@pytest.mark.impacts
def test_orbits_of_points_are_confirmed_by_their_runs(branches):
    """But for bifurcations, and impacts slower than 1e-3 of a gap in a radian, of which rounding decides."""
    for name in NAMES:
        branch = branches[name]
        for i in (*range(0, len(branch), max(len(branch) // 7, 1)), -1):
            orbit, slow = branch.orbits[i], 1e-3 * 2 * math.pi
            orbit_is_slow = orbit.smallest_approach_speed < slow * orbit.length * orbit.excitation.frequency
            exempt = i % len(branch) in branch.bifurcation_points
            assert exempt or orbit_is_slow or orbit.residual <= 1e-10 * max(1.0, abs(orbit.multipliers[0]))
        for each, number in zip(branch.bifurcations, branch.bifurcation_points, strict=True):
            assert np.array_equal(state_vector(each.orbit.state), state_vector(branch.orbits[number].state))


@pytest.mark.impacts
@pytest.mark.parametrize("name", NAMES)
def test_every_end_has_its_reason(branches, name):
    reasons = ("edge", "impact speed zero", "extra contact", "joins a symmetric branch", "closed on itself")
    assert all(words.startswith(reasons) for words in branches[name].end)


@pytest.mark.impacts
def test_a_branch_of_few_points_says_so():
    orbit = MODELS["rigid"].orbit()
    branch = fi.continue_orbit(orbit, "frequency", np.array([4.5, 6.5]), points=4)
    assert branch.end == ("number of points: 4", "number of points: 4")
    assert len(branch) == 7


@pytest.mark.impacts
def test_tables_have_the_points(asymmetric):
    frame, labelled = asymmetric.to_pandas(), asymmetric.to_xarray()
    np.testing.assert_array_equal(frame["base.frequency"], asymmetric.values)
    assert frame.attrs["units"]["base.frequency"] == labelled["value"].attrs["units"] == "Hz"
    multipliers = labelled["multipliers_real"].to_numpy() + 1j * labelled["multipliers_imag"].to_numpy()
    np.testing.assert_array_equal(multipliers, asymmetric.multipliers)
    named = frame[frame["bifurcation"] != ""]
    assert list(named["bifurcation"]) == kinds_of(asymmetric)
    np.testing.assert_array_equal(named["base.frequency"], [each.value for each in asymmetric.bifurcations])
    assert "joins a symmetric branch" in labelled.attrs["last_end"]


@pytest.mark.impacts
def test_the_figure_has_every_bifurcation_and_two_lines(asymmetric):
    axis = fi.figures.branch(asymmetric, ax=fi.figures.OffScreen())
    words = [text.get_text() for text in axis.get_legend().get_texts()]
    assert {"stable", "unstable", "Neimark-Sacker", "symmetry breaking"} <= set(words)
    assert len(words) == len(set(words))
    marks = [line for line in axis.get_lines() if line.get_linestyle() == "None"]
    np.testing.assert_array_equal([m.get_xdata()[0] for m in marks], [b.value for b in asymmetric.bifurcations])
    # between the two Neimark-Sacker points it is unstable
    low, high = values_of(asymmetric, "neimark-sacker")
    drawn = {}
    for line in axis.get_lines():
        x = np.asarray(line.get_xdata())
        for value in (0.5 * (low + high), 5.04):
            if x.size > 1 and x.min() < value < x.max():
                drawn[value] = line.get_label()
    assert drawn == {0.5 * (low + high): "unstable", 5.04: "stable"}
    # no two kinds have the same shape or the same colour, and none has the line's
    shapes, colours = zip(*MARKS.values(), strict=True)
    assert len(set(shapes)) == len({*colours, BLUE}) - 1 == len(MARKS)


def test_the_axis_of_a_branch_names_its_parameter_in_words(over_gap):
    axis = fi.figures.branch(over_gap, ax=fi.figures.OffScreen())
    assert axis.get_xlabel().partition(" (")[0] == "gap of ball"
    for path, words in (
        ("impactor.ball.contact.restitution", "restitution of ball"), ("stop.left.gap", "gap of left"),
        ("base.frequency", "frequency of base"), ("start.ball.position", "position of start ball"),
        ("mass.box.rotary_inertia", "rotary inertia of mass box"), ("spring_rate", "spring rate"),
    ):  # fmt: skip
        assert path_words(path) == words


# ---- bad input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameter", "to", "words"),
    [
        ("frequncy", (0.1, 0.2), "parameter = 'frequncy': unknown; did you mean 'frequency'"),
        ("impactor.bal.gap", (1.0, 20.0), "did you mean 'impactor.ball.gap'"),
        ("mass.box.mass", (1.0, 2.0), "changes the modes"),
        ("beam.thickness", (1.0, 2.0), "changes the modes"),
        ("impactor.ball.acceleration", (1.0, 2.0), "is no number that a branch is followed over; known: amplitude, b"),
        (5, (1.0, 2.0), "parameter = 'int': must be a str"),
        ("frequency", (0.2, 0.1), "to = (0.2, 0.1) Hz: must rise, and have the orbit's 0.159155 in it"),
        ("frequency", (0.2, 0.3), "must rise, and have the orbit's"),
        ("frequency", 0.2, "to = 0.2 Hz: must be two numbers"),
        ("frequency", (0.0, 0.3), "to[0] = 0.0 Hz: must be a finite number > 0 Hz"),
        ("frequency", (0.1, math.nan), "to[1] = nan Hz"),
        ("impactor.ball.contact.restitution", (0.5, 1.1), "to[1] = 1.1: must be a finite number >= 0 and <= 1"),
        ("impactor.ball.gap", (0.0, 20.0), "to[0] = 0.0 m: must be a finite number > 0 m"),
    ],
)
def test_bad_input_is_one_line(parameter, to, words):
    orbit, *_ = fi.orbits.two_impact_orbits(*box(*CASE.values()))
    with pytest.raises(fi.InputError) as caught:
        fi.continue_orbit(orbit, parameter, to)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("high", [0.225, 0.3, 0.45])
def test_orbits_at_a_far_smaller_gap_than_that_of_the_start_are_confirmed(high):
    """Their unit is the smaller gap, the branch has the digits of the larger one."""
    wall = fi.Stop("wall", "tip", (0.15, math.inf), fi.Rigid(0.8))
    system = fi.System.from_matrices([[1.0]], [[0.04]], [[1.0]], points={"tip": [1.0]}, stops=[wall])
    push = fi.PointForce("tip", fi.Sine(1.2, 1.0 / math.pi))
    for speed, phase, _ in stop_orbits(0.02, 0.8, 2.0, 0.15, 1.2):
        start = fi.State([0.15], [-0.8 * speed], time=(phase % (2 * math.pi)) / 2.0)
        orbits = fi.continue_orbit(fi.find_orbit(system, push, guess=start), "stop.wall.gap", (1.5e-5, high)).orbits
        for orbit in orbits:
            assert orbit.residual <= 1e-10 * max(1.0, abs(orbit.multipliers[0]))


def test_where_no_ball_meets_the_beam_a_branch_has_the_displacement_of_the_ball():
    # a ball on a vibrating table: fold and doubling have closed forms (Holmes, 1982)
    e, frequency = 0.5, 20.0
    beam = fi.Beam.uniform(length=0.1, width=0.05, thickness=0.02, young_modulus=210e9, density=7850)
    ball = fi.Impactor("ball", at="root", mass=5e-3, gap=(1.0, 0.0), contact=fi.Rigid(e))
    structure = fi.Structure(beam, impactors=[ball], damping=fi.Rayleigh(0.05, modes=(1, 2)), gravity=-9.81)
    table = fi.reduce(fi.assemble(structure, elements=4), modes=1)
    # the impact is where the upward speed of the table is w A cos(phase) = g T (1 - e)/(2 (1 + e))
    ratio, gravity = (1 - e) / (1 + e), 9.81 / (2 * np.pi * frequency) ** 2
    amplitude = 0.8e-3
    phase = math.acos(math.pi * ratio * gravity / amplitude)
    speed = 9.81 / (2 * frequency) * (1 - ratio)
    start = fi.State(ball_displacement=[0.0], ball_velocity=[speed])
    orbit = fi.find_orbit(table, fi.Sine(amplitude, frequency, phase), guess=start)
    branch = fi.continue_orbit(orbit, "amplitude", to=(0.6e-3, 1.1e-3))
    assert branch.place == "ball.absolute_displacement"
    kinds = {each.kind: each.value for each in branch.bifurcations}
    doubling = math.hypot(math.pi * ratio, 2 * (1 + e * e) / (1 + e) ** 2) * gravity
    assert kinds == pytest.approx({"fold": math.pi * ratio * gravity, "period-doubling": doubling}, rel=1e-6)
    both = branch.at(amplitude)
    assert sorted(one.is_stable for one in both) == [False, True]
    low, high = sorted(float(one.steady(branch.place).peak[0]) for one in both)
    assert high > 1.3 * low
    order = np.argsort(branch.values)
    stable = order[branch.is_stable[order]]
    found = np.interp(amplitude, branch.values[stable], branch.peak[stable])
    assert found == pytest.approx(high, rel=1e-3)
    # the table moves by its drive alone
    tip = fi.continue_orbit(orbit, "amplitude", to=(0.6e-3, 1.1e-3), of="tip")
    assert tip.place == "tip"
    assert tip.peak.max() < 1e-6
    with pytest.raises(fi.InputError, match=r"of = 'table'"):
        fi.continue_orbit(orbit, "amplitude", to=(0.6e-3, 1.1e-3), of="table")
    assert "largest absolute displacement of ball (mm)" in fi.figures.branch(branch).get_ylabel()


def test_a_ball_that_meets_the_beam_leaves_the_tip_as_what_a_branch_has(beam):
    orbit = settled(beam, 5.027)
    of_tip, of_ball = (fi.continue_orbit(orbit, "frequency", (5.0, 5.05), of=of) for of in (None, "ball"))
    assert (of_tip.place, of_ball.place) == ("tip", "ball")
    for branch in (of_tip, of_ball):
        i = len(branch) // 2
        assert branch.peak[i] == pytest.approx(branch.orbits[i].steady(branch.place).peak[0], rel=1e-9)


def test_sheets_of_a_ball_in_a_driven_box_are_told_apart():
    # relative to the box each orbit has the gap for its peak; in space it is half of v/(2 f) and the wall beside
    beam = fi.Beam.uniform(length=0.1, width=0.05, thickness=0.02, young_modulus=210e9, density=7850)
    ball = fi.Impactor("ball", at="root", mass=5e-3, gap=5e-3, contact=fi.Rigid(0.6))
    structure = fi.Structure(beam, impactors=[ball], damping=fi.Rayleigh(0.05, modes=(1, 2)))
    box = fi.reduce(fi.assemble(structure, elements=4), modes=1)
    orbits = fi.orbits.two_impact_orbits(box, fi.Sine(3e-3, 10.0))
    assert [one.is_stable for one in orbits] == [True, False]
    # the ball crosses at v = V (1 + e)/2 in half a period: it goes v/(4 f) to either side
    crossing = [one.impacts.approach_speed[0] * 0.8 / (4 * 10.0) for one in orbits]
    for one, way in zip(orbits, crossing, strict=True):
        branch = fi.continue_orbit(one, "amplitude", to=(2.9e-3, 3.1e-3))
        at = np.flatnonzero(np.isclose(branch.values, 3e-3, rtol=1e-12))
        assert branch.peak[at] == pytest.approx(way, rel=1e-6)
        relative = fi.continue_orbit(one, "amplitude", to=(2.9e-3, 3.1e-3), of="ball")
        assert relative.peak == pytest.approx(5e-3, rel=1e-9)
    with pytest.raises(fi.InputError, match="must be a displacement"):
        fi.continue_orbit(orbits[0], "amplitude", to=(2.9e-3, 3.1e-3), of="ball.velocity")
