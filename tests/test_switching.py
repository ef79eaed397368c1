"""Orbits beyond bifurcations: mirror images, doubled periods, impacts that appear, and branches read from files."""

import functools
import math
from collections import Counter

import numpy as np
import pytest
from builders import REFERENCE, oscillator, reduced, with_ball
from orbit_cases import MODELS
from test_branches import branch_over, kinds_of, settled
from test_orbits import state_of, units_of

import femimpact as fi
from femimpact.validation.closed_forms import stop_coefficients, stop_orbits

pytestmark = pytest.mark.impacts


def first(branch, kind):
    return next(each for each in branch.bifurcations if each.kind == kind)


def apart(one, other):
    """Largest difference of the states of two orbits at t = 0, in gaps and gaps times omega."""
    return np.max(np.abs(state_of(one) - state_of(other)) / units_of(one))


def half_a_period_later(orbit):
    """State of its run at half a period."""
    run = fi.integrate(orbit.system, orbit.excitation, fi.EventDriven(), 0.5 * orbit.period, initial=orbit.state)
    return state_of_end(run)


def one_cycle_later(orbit):
    cycle = 1.0 / orbit.excitation.frequency
    return state_of_end(fi.integrate(orbit.system, orbit.excitation, fi.EventDriven(), cycle, initial=orbit.state))


def state_of_end(run):
    end = run.final_state
    return np.concatenate([end.displacement, end.ball_displacement, end.velocity, end.ball_velocity])


# ---- symmetry breaking ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def beam():
    """The system on which the asymmetric branch ends at 5.15173 Hz, stable there."""
    return reduced(with_ball(REFERENCE, contact=fi.Rigid(0.3), gap=2e-3), 3, elements=80)


@pytest.fixture(scope="module")
def symmetric(beam):
    (orbit,) = fi.orbits.two_impact_orbits(beam, fi.Sine(0.2037e-3, 5.05))
    return fi.continue_orbit(orbit, "frequency", (4.9, 5.2))


@pytest.mark.parametrize("number", [0, 1])
def test_the_asymmetric_pair_are_mirror_images(symmetric, number):
    breaking = [each for each in symmetric.bifurcations if each.kind == "symmetry-breaking"][number]
    one, other = fi.orbits.switch_branch(breaking)
    assert one.excitation.frequency == pytest.approx(other.excitation.frequency, rel=1e-11)
    assert one.excitation.frequency != pytest.approx(breaking.value, rel=1e-6)
    assert not one.is_symmetric
    assert not other.is_symmetric
    # rounding grows by the multiplier of half a period
    mirrored = -half_a_period_later(one)
    assert np.max(np.abs(mirrored - state_of(other)) / units_of(one)) < 1e-8
    assert apart(one, other) > 1e-3
    np.testing.assert_allclose(np.abs(one.multipliers[0]), np.abs(other.multipliers[0]), rtol=1e-8)


def test_the_asymmetric_pair_is_where_runs_settle(beam, symmetric):
    """Where the symmetric orbit is unstable and the pair is stable."""
    breaking = [each for each in symmetric.bifurcations if each.kind == "symmetry-breaking"][1]
    pair = fi.orbits.switch_branch(breaking)
    frequency = pair[0].excitation.frequency
    (between,) = symmetric.at(frequency)
    assert not between.is_stable
    assert all(orbit.is_stable for orbit in pair)
    found = settled(beam, frequency)
    far = [apart(found, orbit) for orbit in pair]
    assert min(far) < 1e-8
    assert max(far) > 1e-3


def test_the_pair_is_the_same_from_the_branch_that_joins(beam, symmetric):
    asymmetric = fi.continue_orbit(settled(beam, 5.1), "frequency", (4.9, 5.2))
    pair = fi.orbits.switch_branch(asymmetric.bifurcations[-1])
    assert asymmetric.bifurcations[-1].kind == "symmetry-breaking"
    assert not any(orbit.is_symmetric for orbit in pair)
    # the branch has one of the two, its mirror image the other
    far = [min(apart(orbit, each) for each in asymmetric.at(orbit.excitation.frequency)) for orbit in pair]
    assert min(far) < 1e-8
    assert max(far) > 1e-3


def test_a_compliant_pair_is_mirrored_too():
    branch = fi.continue_orbit(MODELS["Kelvin-Voigt"].orbit(), "frequency", (4.5, 5.3))
    one, other = fi.orbits.switch_branch(first(branch, "symmetry-breaking"))
    assert np.max(np.abs(-half_a_period_later(one) - state_of(other)) / units_of(one)) < 1e-8
    assert apart(one, other) > 1e-3


# ---- period doubling --------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["rigid", "compliant"])
def single(request):
    """One impact a cycle on one stop, from its grazing on: it doubles between 0.37 and 0.6 N."""
    law = fi.Rigid(0.8) if request.param == "rigid" else fi.KelvinVoigt(stiffness=50.0, damping=1.0)
    (orbit,) = fi.orbits.switch_branch(first(linear(0.8, law), "grazing"))
    return fi.continue_orbit(orbit, "amplitude", (0.0, 0.7))


def test_a_doubled_orbit_repeats_after_two_cycles(single):
    for doubling in single.bifurcations:
        if doubling.kind != "period-doubling":
            continue
        (orbit,) = fi.orbits.switch_branch(doubling)
        assert orbit.cycles == 2
        assert orbit.period == pytest.approx(2.0 / orbit.excitation.frequency)
        assert np.max(np.abs(one_cycle_later(orbit) - state_of(orbit)) / units_of(orbit)) > 1e-5
        run = fi.integrate(orbit.system, orbit.excitation, fi.EventDriven(), orbit.period, initial=orbit.state)
        assert np.max(np.abs(state_of_end(run) - state_of(orbit)) / units_of(orbit)) < 1e-9
        # the doubled orbits are stable where the single one is not: they are born on its unstable side
        (beside,) = single.at(orbit.excitation.history.amplitude)
        assert orbit.is_stable is not beside.is_stable
        assert orbit.is_stable


def test_a_branch_of_doubled_orbits_joins_that_of_half_its_period(single):
    for doubling in single.bifurcations:
        if doubling.kind != "period-doubling":
            continue
        (orbit,) = fi.orbits.switch_branch(doubling)
        branch = fi.continue_orbit(orbit, "amplitude", (0.0, 0.7))
        joined = min(branch.bifurcations, key=lambda each: abs(each.value - doubling.value))
        assert joined.kind == "period-doubling"
        assert any("joins the branch of half its period" in end for end in branch.end)
        assert joined.value == pytest.approx(doubling.value, rel=1e-10)
        (again,) = fi.orbits.switch_branch(joined)
        assert again.cycles == 2


def test_the_orbits_at_a_branch_point_are_one_a_cycle_apart():
    """Of a branch that has its orbits twice the branch point is their doubling."""
    model = MODELS["gravity"]
    orbit = model.orbit()
    twice = fi.find_orbit(orbit.system, orbit.excitation, cycles=2, guess=orbit)
    one, other = fi.orbits.switch_branch(first(fi.continue_orbit(twice, "frequency", (4.5, 6.5)), "branch-point"))
    assert apart(one, other) > 1e-3
    assert np.max(np.abs(one_cycle_later(one) - state_of(other)) / units_of(one)) < 1e-8


# ---- grazing ----------------------------------------------------------------------------------------


DAMPING, RESTITUTION = 0.05, 0.8


def linear(ratio, law):
    """The branch without impacts of an oscillator M = K = 1 before a stop at 1 m, over the force up to grazing."""
    wall = fi.Stop("wall", "mass", (1.0, math.inf), law)
    system = oscillator(1.0, 2.0 * DAMPING, stops=[wall])
    force = fi.PointForce("mass", fi.Sine(0.01, ratio / (2 * math.pi)))
    return fi.continue_orbit(fi.find_orbit(system, force, guess=fi.State()), "amplitude", (0.0, 10.0))


@pytest.mark.parametrize("ratio", [0.6, 0.8, 1.3, 2.2])
def test_the_impact_added_at_grazing_is_on_the_side_of_the_closed_form(ratio):
    grazing = first(linear(ratio, fi.Rigid(RESTITUTION)), "grazing")
    x, _, amplitude = stop_coefficients(DAMPING, RESTITUTION, ratio)
    assert grazing.value == pytest.approx(1.0 / amplitude, rel=1e-10)
    (orbit,) = fi.orbits.switch_branch(grazing)
    force = orbit.excitation.history.amplitude
    # at v = 0 dF/dv = -x/A: one frequency has the orbit above the grazing force, another one below
    assert math.copysign(1.0, force - grazing.value) == -math.copysign(1.0, x)
    speeds = [exact for exact, *_ in stop_orbits(DAMPING, RESTITUTION, ratio, 1.0, force)]
    (speed,) = orbit.impacts.approach_speed
    assert np.min(np.abs(np.subtract(speeds, speed))) < 1e-9
    assert speed < 0.1


def test_the_sides_of_grazing_differ_between_frequencies():
    assert {
        math.copysign(1.0, stop_coefficients(DAMPING, RESTITUTION, ratio)[0]) for ratio in (0.6, 0.8, 1.3, 2.2)
    } == {-1.0, 1.0}


LAWS = {
    "rigid": fi.Rigid(0.8),
    "compliant": fi.KelvinVoigt(stiffness=50.0, damping=1.0),
    "without damping": fi.KelvinVoigt(stiffness=50.0, damping=0.0),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("ratio", [0.8, 1.3])
def test_an_impact_taken_away_leads_back_to_the_linear_motion(ratio, law):
    without = linear(ratio, law)
    (orbit,) = fi.orbits.switch_branch(first(without, "grazing"))
    branch = fi.continue_orbit(orbit, "amplitude", (0.0, 1.0))
    (back,) = fi.orbits.switch_branch(first(branch, "grazing"))
    assert len(back.events) == 0
    force = back.excitation.history.amplitude
    # beyond the grazing force the linear motion is in the wall
    assert force < first(without, "grazing").value
    response = force / complex(1.0 - ratio**2, 2.0 * DAMPING * ratio)
    assert back.state.displacement[0] == pytest.approx(response.imag, abs=1e-12)


def test_a_symmetric_motion_grazes_both_walls_at_once():
    model = MODELS["Kelvin-Voigt stop in space"]
    system = model.system()
    branch = fi.continue_orbit(fi.find_orbit(system, fi.Sine(1e-4, 5.6), guess=fi.State()), "amplitude", (0.0, 2e-3))
    (orbit,) = fi.orbits.switch_branch(first(branch, "grazing"))
    assert orbit.is_symmetric
    assert sorted(orbit.events.side) == [-1, -1, -1, 1, 1, 1]
    # it begins at the grazing of the motion without contact
    back = fi.continue_orbit(orbit, "amplitude", (0.0, 2e-3))
    assert first(back, "grazing").value == pytest.approx(first(branch, "grazing").value, rel=1e-10)


def test_two_impacts_more_at_the_grazing_of_an_orbit_with_impacts():
    branch = branch_over("clearance", 1.0, 20.0)
    grazing = first(branch, "grazing")
    assert "extra contact" in branch.end[0]
    (orbit,) = fi.orbits.switch_branch(grazing)
    assert len(orbit.impacts) == 4
    assert orbit.is_symmetric
    slow, fast = np.sort(orbit.impacts.approach_speed)[1:3]
    assert slow < 0.1 * fast
    np.testing.assert_allclose(np.sort(grazing.orbit.impacts.approach_speed)[-2:], fast, rtol=0.1)


# ---- grazing within a compliant contact -------------------------------------------------------------


# frequency of the second mode (Hz), its shape at the stop, restitution and contact time (s), frequency (Hz)
SHAKEN = {
    "release": (33.753, 4.327, 0.49, 7.588e-3, 7.557),
    "press again": (38.434, -4.129, 0.436, 11.979e-3, 7.933),
    "at the wall": (32.194, 4.291, 0.725, 10.142e-3, 7.228),
}


@functools.cache
def shaken(name):
    """One contact a cycle with a stop, within which a second mode shakes: its force touches zero at both ends."""
    second, shape, restitution, time, frequency = SHAKEN[name]
    omega = 2.0 * math.pi * np.array([5.0, second])
    stop = fi.Stop("stop", "tip", (2e-3, math.inf), fi.KelvinVoigt(restitution=restitution, contact_time=time))
    system = fi.System.from_matrices(
        np.eye(2), np.diag(0.06 * omega), np.diag(omega**2), points={"tip": np.array([4.0, shape])},
        base_load=[0.2, 0.1], stops=[stop],
    )  # fmt: skip
    base, record = fi.Sine(1.5e-3, frequency), fi.Recorder(channels=(), ledger=False)
    run = fi.integrate(system, base, fi.EventDriven(), 200 / frequency, record)
    return fi.continue_orbit(fi.find_orbit(system, base, guess=run), "frequency", (4.0, 9.0))


@pytest.mark.parametrize(
    ("name", "end", "words", "added"),
    [
        ("release", 0, "extra release", {"release": 1, "press again": 1}),
        ("press again", 0, "extra press again", {"release": 1, "press again": 1}),
        ("at the wall", 0, "press again at the wall", {"separate": 1, "touch": 1, "press again": -1}),
        ("at the wall", -1, "release and press again at one instant", {"release": -1, "press again": -1}),
    ],
)
def test_a_release_within_a_contact_is_added_or_taken_away(name, end, words, added):
    """And its branch begins at the same value, from which a switch leads back."""
    branch = shaken(name)
    grazing = branch.bifurcations[end]
    assert grazing.kind == "grazing"
    assert branch.end[end].startswith(words)
    (orbit,) = fi.orbits.switch_branch(grazing)
    met, before = (Counter(each.events.kind.tolist()) for each in (orbit, grazing.orbit))
    assert {kind: met[kind] - before[kind] for kind in met | before if met[kind] != before[kind]} == added
    value = orbit.excitation.frequency
    width = max(3.0 * abs(value - grazing.value), 0.01)
    other = fi.continue_orbit(orbit, "frequency", (value - width, value + width))
    back = min(other.bifurcations, key=lambda each: abs(each.value - grazing.value))
    assert back.kind == "grazing"
    assert back.value == pytest.approx(grazing.value, rel=1e-10)
    (again,) = fi.orbits.switch_branch(back)
    assert Counter(again.events.kind.tolist()) == before


def test_multipliers_go_on_through_an_extra_release():
    """The force is zero on both sides of its events, where the rates are one: no saltation, no jump."""
    grazing = shaken("release").bifurcations[0]
    (orbit,) = fi.orbits.switch_branch(grazing)
    # a release of 0.02 rad changes them by a share of it; at an impact without speed they are infinite
    np.testing.assert_allclose(np.abs(orbit.multipliers), np.abs(grazing.orbit.multipliers), atol=0.02)


# ---- what is refused --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("fold", "bifurcation = 'fold': has no other orbits to switch to: both sheets are in the branch"),
        ("neimark-sacker", "quasi-periodic motions are born there"),
        ("grazing", "bifurcation = 'grazing': must leave ball a contact: else it may be anywhere"),
    ],
)
def test_bifurcations_without_another_branch_are_refused(kind, words):
    branch = branch_over("clearance", 6.0, 400.0)
    with pytest.raises(fi.InputError) as caught:
        fi.orbits.switch_branch(first(branch, kind))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


# ---- branches in files ------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", [None, "scipy"])
def test_a_branch_comes_back_from_its_file(tmp_path, engine):
    """In the format that `to_netcdf` of some versions writes, too."""
    branch, path = branch_over("clearance", 6.0, 400.0), tmp_path / "branch.nc"
    branch.to_xarray().to_netcdf(path, engine=engine)
    loaded = fi.app.load_branch(path)
    for name in ("values", "multipliers", "peak", "first_harmonic", "is_stable", "bifurcation_points"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(branch, name))
    assert (loaded.parameter, loaded.unit, loaded.place, loaded.end) == (
        branch.parameter, branch.unit, branch.place, branch.end,
    )  # fmt: skip
    assert [(b.kind, b.value) for b in loaded.bifurcations] == [(b.kind, b.value) for b in branch.bifurcations]
    assert len(kinds_of(loaded)) == 4
    assert loaded.to_xarray().identical(branch.to_xarray())
    assert loaded.to_pandas().equals(branch.to_pandas())
    assert str(loaded) == str(branch)
    fi.figures.branch(loaded, ax=fi.figures.OffScreen())
    for call in (
        lambda: loaded.orbits,
        lambda: loaded.at(10.0),
        lambda: loaded.bifurcations[0].orbit,
        lambda: fi.orbits.switch_branch(first(loaded, "symmetry-breaking")),
    ):
        with pytest.raises(fi.InputError, match="one read from a file has no orbits"):
            call()


def without_a_variable(path, data):
    data.drop_vars("peak").to_netcdf(path)


def with_an_unknown_kind(path, data):
    data.assign(bifurcation=("point", np.full(data.sizes["point"], "hopf"))).to_netcdf(path)


def with_a_number_that_is_none(path, data):
    data.assign_coords(value=("point", np.full(data.sizes["point"], np.nan), data["value"].attrs)).to_netcdf(path)


def cut_off(path, data):
    data.to_netcdf(path)
    path.write_bytes(path.read_bytes()[:2000])


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (without_a_variable, "peak"),
        (with_an_unknown_kind, "hopf"),
        (with_a_number_that_is_none, "values"),
        (cut_off, ""),
        (lambda path, _: path.write_text("no branch"), ""),
    ],
)
def test_a_damaged_file_is_one_line(tmp_path, damage, words):
    path = tmp_path / "branch.nc"
    damage(path, branch_over("e", 0.75, 0.85).to_xarray())
    with pytest.raises(fi.InputError) as caught:
        fi.app.load_branch(path)
    assert "is damaged and cannot be read" in str(caught.value)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
