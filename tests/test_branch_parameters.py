"""Branches over numbers of contacts, balls and damping: closed forms, 50-digit arithmetic, systems built anew."""

import json
import math
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest
from builders import REFERENCE, oscillator, reduced, with_ball
from orbit_cases import HELD_BALL, MODELS
from scipy.optimize import brentq
from test_branches import CASE, kinds_of, values_of
from test_orbits import box, units_of

import femimpact as fi
from femimpact.orbits.equations import derivative_by, event_maps, jacobian
from femimpact.orbits.orbit import state_vector
from femimpact.orbits.parameter import parameter_of
from femimpact.orbits.search import first_guess
from femimpact.validation.closed_forms import box_fold, box_orbits

pytestmark = pytest.mark.impacts

DIGITS = json.loads((Path(__file__).parent / "data" / "orbit_derivatives.json").read_text())
"""Made once by `orbit_reference.py`."""

CASES = MODELS | {"held ball": HELD_BALL}


def path_of(model, number):
    owner = "stop.stop 0" if model.pairs[0][1] is None else "impactor.ball 0"
    of_contact = {"stiffness": f"{owner}.contact.stiffness", "damping": f"{owner}.contact.damping"}
    return {"factor": "damping.factor", "mass": f"{owner}.mass", **of_contact}[number]


# ---- derivatives ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "number"), [(n, k) for n in CASES for k in ("factor", "mass", "stiffness", "damping") if k in DIGITS[n]]
)
def test_derivatives_by_a_parameter_have_the_digits_of_50_digit_arithmetic(name, number):
    orbit = CASES[name].orbit()
    guess = first_guess(orbit.system, orbit.excitation, 1, orbit)
    parameter = parameter_of(orbit.system, orbit.excitation, path_of(CASES[name], number))
    maps = event_maps(parameter.hybrid, guess)
    by = derivative_by(parameter.hybrid_at, parameter.value, guess)
    found = -np.linalg.solve(jacobian(maps).reshape(2 * [by.size]), by.reshape(by.size)).reshape(by.shape)[0]
    exact, unit = np.array(DIGITS[name][number]), np.append(units_of(orbit), 1.0)
    assert np.max(np.abs(found - exact) / unit) < 1e-8 * np.max(np.abs(exact) / unit)


def exact_law(restitution, contact_time, stiffness, mass):
    """Stiffness and damping by the formulas of a Kelvin-Voigt contact, in mpmath's numbers."""

    def angle(z):
        return mpmath.hyp2f1(1, 1, mpmath.mpf(3) / 2, (1 - z) / 2)

    at_one = mpmath.mpf(1)
    z = mpmath.mpf(0)
    if restitution < at_one:
        z = mpmath.findroot(lambda z: 2 * z * angle(z) + mpmath.log(restitution), 0.5 / restitution**0.5)
    if contact_time is not None:
        stiffness = mass * (2 * angle(z) / contact_time) ** 2
    return stiffness, 2 * z * mpmath.sqrt(stiffness * mass)


@pytest.mark.parametrize("restitution", [0.02, 0.0729, 0.6, 0.97])
@pytest.mark.parametrize("given", ["stiffness", "contact_time"])
@pytest.mark.parametrize("number", ["restitution", "other", "mass"])
def test_the_numbers_of_a_law_are_followed_by_its_formulas(restitution, given, number):
    """A complex step through the numbers of a law is the derivative of its formulas, and at() has their values."""
    law = fi.KelvinVoigt(restitution=restitution, **{given: {"stiffness": 3e3, "contact_time": 2e-3}[given]})
    ball = fi.Impactor("ball", "mass", 0.2, 1.0, law)
    system, sine = oscillator(damping=0.1, impactors=[ball]), fi.Sine(1.0, 0.1)
    path = {"restitution": "contact.restitution", "other": f"contact.{given}", "mass": "mass"}[number]
    parameter = parameter_of(system, sine, f"impactor.ball.{path}")

    def exact(value):
        numbers = {"restitution": mpmath.mpf(restitution), "other": getattr(law, given), "mass": mpmath.mpf(0.2)}
        numbers[number] = value
        time, stiffness = (numbers["other"], None) if given == "contact_time" else (None, numbers["other"])
        # of the effective mass of the ball and the mass of 1 kg
        mass = 1 / (1 + 1 / numbers["mass"])
        return exact_law(numbers["restitution"], time, stiffness, mass)

    with mpmath.workdps(40):
        step = mpmath.mpf(10) ** -15 * parameter.value
        here, ahead, behind = (exact(parameter.value + way * step) for way in (0, 1, -1))
        slopes = [float((a - b) / (2 * step)) for a, b in zip(ahead, behind, strict=True)]
    hybrid = parameter.hybrid_at(complex(parameter.value, 1e-30))
    found = np.array([hybrid.contact_stiffness[0], hybrid.contact_damping[0]])
    np.testing.assert_allclose(found.real, [float(each) for each in here], rtol=1e-12)
    np.testing.assert_allclose(found.imag / 1e-30, slopes, rtol=1e-11, atol=1e-12 * abs(found[0].real))
    (pair,) = parameter.at(1.01 * parameter.value)[0].contacts
    changed = parameter.hybrid_at(1.01 * parameter.value)
    np.testing.assert_allclose(changed.contact_stiffness[0], pair.parameters.stiffness, rtol=1e-13)
    np.testing.assert_allclose(changed.contact_damping[0], pair.parameters.damping, rtol=1e-13)


def test_a_loss_free_law_has_the_slope_of_its_formulas():
    """At e = 1 the damping ratio is (1 - e)/pi to first order."""
    ball = fi.Impactor("ball", "mass", 0.2, 1.0, fi.KelvinVoigt(stiffness=3e3, restitution=1.0))
    system, sine = oscillator(damping=0.1, impactors=[ball]), fi.Sine(1.0, 0.1)
    hybrid = parameter_of(system, sine, "impactor.ball.contact.restitution").hybrid_at(complex(1.0, 1e-30))
    assert hybrid.contact_damping[0].real == 0.0
    assert hybrid.contact_damping[0].imag == pytest.approx(-1e-30 * 2 / math.pi * math.sqrt(3e3 / 6), rel=1e-12)


# ---- systems that a user builds with another number -------------------------------------------------


def beam_with(mass=3.43e-3, ratio=0.0029, **law):
    contact = fi.KelvinVoigt(**law) if law else fi.Rigid(0.6)
    structure = with_ball(REFERENCE, mass=mass, gap=2e-3, contact=contact)
    return reduced(replace(structure, damping=fi.Rayleigh(ratio, (1, 2))), 4)


def with_absorber(mass):
    structure = with_ball(REFERENCE, gap=2e-3, contact=fi.Rigid(0.6))
    return reduced(replace(structure, absorbers=[fi.Absorber("damper", "mid", mass, 20.0, 0.01)]), 4)


def of_model(name, **changes):
    """The system of a model with other numbers; of a pair the mass."""
    model = CASES[name]
    if "mass" in changes:
        (shape, _, gap), *others = model.pairs
        model = replace(model, pairs=((shape, changes.pop("mass"), gap), *others))
    if "factor" in changes:
        factor = changes.pop("factor")
        model = replace(model, ratio=factor * model.ratio, held=(model.held[0], factor * model.held[1]))
    return replace(model, **changes).system()


COMPLIANT = {"restitution": 0.6, "contact_time": 2e-3}
STIFF = {"stiffness": 4e3, "restitution": 0.6}
OF_BALL, OF_CONTACT = "impactor.ball.mass", "impactor.ball.contact"

ANEW = {
    # path, range, system of a value
    "mass of a rigid ball": (OF_BALL, (3e-3, 4.5e-3), lambda v: beam_with(v)),
    "ratio of a beam": ("damping.factor", (0.5, 2.0), lambda v: beam_with(ratio=0.0029 * v)),
    "mass of an absorber": ("absorber.damper.mass", (1e-3, 2e-3), with_absorber),
    "mass of a compliant ball": (OF_BALL, (3e-3, 3.8e-3), lambda v: beam_with(v, **COMPLIANT)),
    "mass beside a stiffness": (OF_BALL, (3e-3, 3.8e-3), lambda v: beam_with(v, **STIFF)),
    "restitution": (f"{OF_CONTACT}.restitution", (0.5, 0.7), lambda v: beam_with(restitution=v, contact_time=2e-3)),
    "contact time": (f"{OF_CONTACT}.contact_time", (15e-4, 3e-3), lambda v: beam_with(restitution=0.6, contact_time=v)),
    "stiffness beside a restitution": (
        f"{OF_CONTACT}.stiffness", (3e3, 8e3), lambda v: beam_with(stiffness=v, restitution=0.6)
    ),
    "restitution beside a stiffness": (
        f"{OF_CONTACT}.restitution", (0.5, 0.7), lambda v: beam_with(stiffness=4e3, restitution=v)
    ),
    "stiffness": (
        "impactor.ball 0.contact.stiffness", (2e3, 5e3), lambda v: of_model("Kelvin-Voigt", law=(v, 2.0))
    ),
    "dashpot": ("impactor.ball 0.contact.damping", (1.5, 3.0), lambda v: of_model("Kelvin-Voigt", law=(3e3, v))),
    "dashpot of a stop in space": (
        "stop.stop 0.contact.damping", (0.4, 0.9), lambda v: of_model("Kelvin-Voigt stop in space", law=(500.0, v))
    ),
    "damping beside a stop in space": ("damping.factor", (0.7, 1.5), lambda v: of_model("stop in space", factor=v)),
    "mass under gravity": ("impactor.ball 0.mass", (3e-3, 4e-3), lambda v: of_model("gravity", mass=v)),
    "mass of one of two balls": ("impactor.ball 0.mass", (3.3e-3, 3.56e-3), lambda v: of_model("two balls", mass=v)),
    "mass of a held ball": ("impactor.ball 0.mass", (3.2e-3, 3.66e-3), lambda v: of_model("held ball", mass=v)),
    "damping of a held ball": ("damping.factor", (0.7, 1.5), lambda v: of_model("held ball", factor=v)),
}  # fmt: skip


@pytest.mark.parametrize("name", ANEW)
def test_a_branch_has_the_orbits_of_systems_that_are_built_anew(name):
    path, (low, high), build = ANEW[name]
    system = build(1.0 if path == "damping.factor" else 0.5 * (low + high))
    model = next((CASES[key] for key in ("stop in space", "two balls", "held ball") if key in name), MODELS["rigid"])
    base = fi.Sine(model.amplitude, model.frequency)
    run = fi.integrate(system, base, fi.EventDriven(), 80.0, fi.Recorder(channels=(), ledger=False))
    branch = fi.continue_orbit(fi.find_orbit(system, base, guess=run), path, (low, high))
    assert branch.end == (f"edge: {path} = {low:g}", f"edge: {path} = {high:g}")
    checked = 0
    for value in np.linspace(low, high, 5).tolist():
        for orbit in branch.at(value):
            fresh = fi.find_orbit(build(value), base, guess=orbit)
            np.testing.assert_allclose(
                state_vector(orbit.state) / units_of(orbit), state_vector(fresh.state) / units_of(orbit), atol=1e-9
            )
            np.testing.assert_allclose(orbit.impacts.approach_speed, fresh.impacts.approach_speed, rtol=1e-9)
            size = max(1.0, abs(fresh.multipliers[0]))
            np.testing.assert_allclose(np.abs(orbit.multipliers), np.abs(fresh.multipliers), atol=1e-8 * size)
            assert orbit.residual < 1e-10 * size
            assert orbit.is_symmetric == fresh.is_symmetric
            # caches of one system serve no other one
            again = fi.integrate(orbit.system, base, fi.EventDriven(), orbit.period, initial=orbit.state)
            newly = fi.integrate(build(value), base, fi.EventDriven(), orbit.period, initial=orbit.state)
            np.testing.assert_allclose(
                again.final_state.displacement, newly.final_state.displacement, atol=1e-11 * orbit.length
            )
            checked += 1
    assert checked >= 5


def test_stiffness_and_dashpot_are_numbers_of_every_compliant_contact():
    """Of a law that is given otherwise the other one of both is held."""
    system = beam_with(**COMPLIANT)
    (pair,), base = system.contacts, fi.Sine(0.2037e-3, 5.3)
    has = pair.parameters
    for name, held in (("stiffness", "damping"), ("damping", "stiffness")):
        parameter = parameter_of(system, base, f"impactor.ball.contact.{name}")
        assert parameter.value == pytest.approx(getattr(has, name), rel=1e-15)
        changed = parameter.at(1.1 * parameter.value)[0].contacts[0].parameters
        assert getattr(changed, name) == pytest.approx(1.1 * getattr(has, name), rel=1e-15)
        assert getattr(changed, held) == getattr(has, held)


def test_all_damping_is_multiplied_also_at_the_supports():
    structure = replace(REFERENCE, damping=fi.ModalDamping(ratios=(0.01, 0.02, 0.03)))
    systems = [reduced(replace(structure, damping=fi.ModalDamping(tuple(f * r for r in (0.01, 0.02, 0.03)))), 3)
               for f in (1.0, 2.0)]  # fmt: skip
    one, twice = systems
    changed, _ = parameter_of(one, fi.Sine(1e-4, 5.0), "damping.factor").at(2.0)
    np.testing.assert_allclose(changed.C.toarray(), twice.C.toarray(), rtol=1e-13)
    for name, item in twice.reactions.items():
        np.testing.assert_allclose(changed.reactions[name].on_velocity, item.on_velocity, rtol=1e-10)
    assert changed.contacts[0].parameters == one.contacts[0].parameters
    assert changed.derived is not one.derived


# ---- the quadratic of two impacts -------------------------------------------------------------------

SCALE = {"mu": ("impactor.ball.mass", 1.0), "zeta": ("damping.factor", 100.0)}


def branch_over(number, low, high, **changed):
    orbit, *_ = fi.orbits.two_impact_orbits(*box(*(CASE | changed).values()))
    path, scale = SCALE[number]
    return fi.continue_orbit(orbit, path, (scale * low, scale * high))


@pytest.mark.parametrize(("number", "low", "high"), [("mu", 0.02, 0.5), ("zeta", 1e-3, 0.05)])
def test_a_fold_is_that_of_the_quadratic(number, low, high):
    """The discriminant is zero where the gap is A sqrt(p^2 + r^2)/r."""
    branch = branch_over(number, low, high, clearance=102.0)

    def discriminant(value):
        mu, e, zeta, ratio, _ = (CASE | {number: value}).values()
        return box_fold(mu, e, zeta, ratio) - 102.0

    (fold,) = values_of(branch, "fold")
    exact = brentq(discriminant, low, high, xtol=1e-16, rtol=1e-15)
    assert fold == pytest.approx(SCALE[number][1] * exact, rel=1e-10)
    assert len(branch.at(0.999 * fold)) == 2
    for orbit in branch.at(0.97 * fold):
        case = CASE | {number: 0.97 * exact, "clearance": 102.0}
        speeds = [speed for speed, _, _ in box_orbits(*case.values())]
        assert min(abs(orbit.impacts.approach_speed[0] / speed - 1) for speed in speeds) < 1e-9


def test_an_orbit_over_the_damping_grazes_where_the_linear_motion_reaches_the_wall():
    branch = branch_over("zeta", 1e-3, 0.05, clearance=102.0)
    assert branch.end[1].startswith("impact speed zero, of ball")
    # at resonance the amplitude is 1/(2 zeta)
    assert values_of(branch, "grazing")[0] == pytest.approx(100.0 / (2 * 51.0), rel=1e-10)


@pytest.mark.parametrize(("number", "low", "high", "clearance"), [("mu", 0.05, 0.1, 20.0), ("zeta", 3e-3, 3e-2, 16.0)])
def test_symmetry_breaking_is_minus_one_of_the_half_map(number, low, high, clearance):
    branch = branch_over(number, *((0.02, 0.5) if number == "mu" else (low, high)), clearance=clearance)

    def at_minus_one(value):
        case = CASE | {number: value, "clearance": clearance}
        *_, half_map = max(box_orbits(*case.values()), key=lambda each: each[0])
        return np.linalg.det(half_map + np.eye(4))

    (value,) = values_of(branch, "symmetry-breaking")
    scale = SCALE[number][1]
    assert value == pytest.approx(scale * brentq(at_minus_one, low, high, xtol=1e-15), rel=1e-10)
    # both orbits without the symmetry have the number of their side
    breaking = next(each for each in branch.bifurcations if each.kind == "symmetry-breaking")
    for orbit in fi.orbits.switch_branch(breaking):
        assert not orbit.is_symmetric
        assert orbit.residual < 1e-10 * max(1.0, abs(orbit.multipliers[0]))
        found = {"mu": orbit.system.contacts[0].mass, "zeta": 0.5 * orbit.system.C.toarray()[0, 0]}
        assert [name for name in SCALE if found[name] != CASE[name]] == [number]
        asymmetric = fi.continue_orbit(orbit, "frequency", (0.155, 0.165))
        assert len(asymmetric) > 3
        # the other branch has the scale of the one that it begins at, also a factor
        path, scale = SCALE[number]
        again = fi.continue_orbit(orbit, path, tuple(scale * limit for limit in (low, high)))
        joined = [one for one in again.bifurcations if one.kind == "symmetry-breaking"]
        assert min(abs(one.value / value - 1.0) for one in joined) < 1e-9


# ---- ends and bad input -----------------------------------------------------------------------------


def test_a_resonance_without_damping_ends_a_branch():
    orbit = MODELS["rigid"].orbit()
    branch = fi.continue_orbit(orbit, "damping.factor", (0.0, 2.0))
    assert branch.end[0].startswith("no convergence: ")
    assert branch.values[0] > 0.0
    below = fi.continue_orbit(orbit, "base.frequency", (5.1, 5.3)).at(5.2)[0]
    assert fi.continue_orbit(below, "damping.factor", (0.0, 2.0)).end[0] == "edge: damping.factor = 0"


def test_a_contact_without_loss_is_followed_over_other_numbers():
    """It lets go where it separates, two events at one instant all along."""
    over_damping = fi.continue_orbit(MODELS["Kelvin-Voigt"].orbit(), "impactor.ball 0.contact.damping", (0.0, 3.0))
    assert over_damping.end[0] == "edge: impactor.ball 0.contact.damping = 0"
    (orbit,) = over_damping.at(0.0)
    released, separated = (orbit.events.time[orbit.events.kind == kind] for kind in ("release", "separate"))
    np.testing.assert_allclose(released, separated, atol=1e-12)
    for path, low, high in (("impactor.ball 0.mass", 3e-3, 3.7e-3), ("frequency", 5.15, 5.5)):
        branch = fi.continue_orbit(orbit, path, (low, high))
        assert all(words.startswith("edge") for words in branch.end)
    in_space = fi.continue_orbit(
        MODELS["Kelvin-Voigt stop in space"].orbit(), "stop.stop 0.contact.damping", (0.0, 1.0)
    )
    assert in_space.end[0] == "edge: stop.stop 0.contact.damping = 0"


def refused(system, parameter, to, words):
    base = fi.Sine(0.2037e-3, 5.3)
    run = fi.integrate(system, base, fi.EventDriven(), 80.0, fi.Recorder(channels=(), ledger=False))
    orbit = fi.find_orbit(system, base, guess=run)
    with pytest.raises(fi.InputError) as caught:
        fi.continue_orbit(orbit, parameter, to)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("parameter", "to", "words"),
    [
        ("impactor.ball 0.mass", (0.0, 1.0), "to[0] = 0.0 kg: must be a finite number > 0 kg"),
        ("impactor.ball 0.mass", (-1e-3, 1.0), "to[0] = -0.001 kg: must be a finite number > 0 kg"),
        ("impactor.ball 0.mass", (1e-3, math.inf), "to[1] = inf kg"),
        ("impactor.ball 0.contact.stiffness", (0.0, 1e4), "to[0] = 0.0 N/m: must be a finite number > 0 N/m"),
        ("impactor.ball 0.contact.damping", (-1.0, 3.0), "to[0] = -1.0 N s/m: must be a finite number >= 0 N s/m"),
        ("damping.factor", (-0.1, 3.0), "to[0] = -0.1: must be a finite number >= 0"),
        ("damping.factor", (0.1, 0.9), "must rise, and have the orbit's 1 in it"),
        ("damping.ratio", (0.1, 0.9), "is in a system's damping matrix, of which damping.factor multiplies all"),
        ("dashpot.a.damping", (0.1, 0.9), "of which damping.factor multiplies all"),
        ("impactor.ball 0.contact.restitution", (0.5, 0.9), "contact's law, KelvinVoigt with stiffness and damping"),
        ("impactor.ball 0.contact.contact_time", (0.5, 0.9), "contact's law, KelvinVoigt with stiffness and damping"),
        ("impactor.ball 0.free_stiffness", (0.5, 0.9), "is no number that a branch is followed over; known: amplitude"),
        ("impactor.ball 0.contact.stifness", (0.5, 0.9), "is no number of the contact's law"),
        ("impactor.ball 1.mass", (0.5, 0.9), "unknown; did you mean 'impactor.ball 0.mass'"),
        ("stop.ball 0.mass", (0.5, 0.9), "unknown; did you mean 'impactor.ball 0.mass'"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(parameter, to, words):
    refused(MODELS["Kelvin-Voigt"].system(), parameter, to, words)


def test_a_rigid_contact_has_neither_stiffness_nor_dashpot():
    for number in ("stiffness", "damping"):
        words = "is no number of the contact's law, Rigid with restitution; known: amplitude"
        refused(MODELS["rigid"].system(), f"impactor.ball 0.contact.{number}", (1.0, 2.0), words)


def test_a_system_without_damping_has_no_factor():
    stop = fi.Stop("wall", "mass", (1.0, 1.0), fi.Rigid(0.8))
    orbit = fi.find_orbit(oscillator(stops=[stop]), fi.PointForce("mass", fi.Sine(0.1, 0.1)), guess=fi.State())
    with pytest.raises(fi.InputError, match="must have a system with damping, of which this one has none; known"):
        fi.continue_orbit(orbit, "damping.factor", (0.5, 2.0))
    with pytest.raises(fi.InputError, match="is no number that a branch is followed over"):
        fi.continue_orbit(orbit, "stop.wall.mass", (0.5, 2.0))
    assert kinds_of(fi.continue_orbit(orbit, "stop.wall.contact.restitution", (0.5, 1.0))) == []
