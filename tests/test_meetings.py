"""Balls that meet one another: an independent simulator, closed forms of chains, what is refused, study files."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builders import paper_study, plain_study, read_study, same_study, study_text
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import femimpact as fi
from femimpact.app.report import player
from femimpact.app.report.structure_drawing import structure_element, structure_words
from femimpact.scene.placed import placed_structure
from femimpact.scene.scene import BALL, BOX, build_scene

pytestmark = pytest.mark.impacts

STILL, PATH = fi.Sine(0.0, 1.0), Path("study.toml")


def chain(count, gap=3e-3, restitution=0.8, masses=None, at="wall", law=None):
    """Balls of which the outer ones reach a wall, each free to move `gap`, and their meetings."""
    law = fi.Rigid(restitution) if law is None else law
    masses = [0.01] * count if masses is None else masses
    names = "abcdefg"[:count]
    plus, minus = [math.inf] * count, [math.inf] * count
    minus[0] = plus[-1] = gap
    balls = [
        fi.Impactor(name, at, mass, (p, m), law) for name, mass, p, m in zip(names, masses, plus, minus, strict=True)
    ]
    meetings = [fi.Meeting(a + b, (a, b), gap, law) for a, b in pairwise(names)]
    return balls, meetings


def box(count, **changes):
    """A box whose motion is that of the base."""
    balls, meetings = chain(count, **changes)
    return fi.System.from_matrices(
        [[1.0]], [[0.0]], [[1e4]], points={"wall": [0.0]}, base_load=[0.0], impactors=balls, meetings=meetings
    )


def simulated(system, base, duration, y, y_rate, grid=4000):
    """Times and pairs of impacts of rigid pairs: modes in closed form, roots by bracketing, impulses one by one.

    Nothing is shared with the package but the numbers of the system: diag(M) = 1, C and K diagonal.
    """
    n, balls = system.dofs, [pair for pair in system.contacts if math.isfinite(pair.mass)]
    w2, c = system.K.diagonal(), system.C.diagonal()
    mass = np.concatenate([system.M.diagonal(), [pair.mass for pair in balls]])
    numbers = {pair.name: n + i for i, pair in enumerate(balls)}
    rows = np.zeros((len(system.contacts), mass.size))
    for j, pair in enumerate(system.contacts):
        if pair.name in numbers:
            rows[j, :n], rows[j, numbers[pair.name]] = -pair.direction, 1.0
        else:
            rows[j, numbers[pair.between[0]]], rows[j, numbers[pair.between[1]]] = 1.0, -1.0
    w, a0 = 2 * math.pi * base.frequency, base.amplitude
    # m q'' + c q' + k q = load a0 w^2 sin(w t)
    steady = np.asarray(system.base_load) * a0 * w**2 / (w2 - system.M.diagonal() * w**2 + 1j * w * c)
    delta, omega = (
        0.5 * c / system.M.diagonal(),
        np.sqrt(w2 / system.M.diagonal() - (0.5 * c / system.M.diagonal()) ** 2),
    )

    def motion(t, t0, p, v):
        t = np.atleast_1d(t)[:, None]
        s0, s = np.exp(1j * w * t0), np.exp(1j * w * t)
        q0, r0 = p[:n] - (steady * s0).imag, v[:n] - (1j * w * steady * s0).imag
        e, cos, sin = np.exp(-delta * (t - t0)), np.cos(omega * (t - t0)), np.sin(omega * (t - t0))
        b = (r0 + delta * q0) / omega
        q = e * (q0 * cos + b * sin)
        r = e * ((b * omega - delta * q0) * cos - (q0 * omega + delta * b) * sin)
        q, r = q + (steady * s).imag, r + (1j * w * steady * s).imag
        ub, ub0 = a0 * np.sin(w * t), a0 * math.sin(w * t0)
        rate, rate0 = a0 * w * np.cos(w * t), a0 * w * math.cos(w * t0)
        y_abs = p[n:] + ub0 + (v[n:] + rate0) * (t - t0)
        return np.hstack([q, y_abs - ub]), np.hstack([r, v[n:] + rate0 - rate])

    t0, last, impacts = 0.0, -1, []
    p, v = np.concatenate([np.zeros(n), y]), np.concatenate([np.zeros(n), y_rate])
    step = 1.0 / (base.frequency * grid)
    walls = [(j, s, g) for j, pair in enumerate(system.contacts)
             for s, g in ((1.0, pair.gaps[0]), (-1.0, pair.gaps[1])) if math.isfinite(g)]  # fmt: skip
    while t0 < duration:
        times = t0 + step * np.arange(1, 401)
        x = motion(times, t0, p, v)[0] @ rows.T
        first = None
        for j, s, g in walls:
            beyond = np.flatnonzero(s * x[:, j] > g)
            if beyond.size:
                k = beyond[0]
                # the pair that has just parted is at zero to rounding
                begin = times[k] - step if k else t0 + (1e-3 * step if j == last else 0.0)

                def depth(t, j=j, s=s, g=g, at=(t0, p, v)):
                    return float(s * (motion(t, *at)[0] @ rows[j])[0] - g)

                root = brentq(depth, begin, times[k], xtol=1e-17, rtol=1e-15)
                if first is None or root < first[0]:
                    first = root, j, s
        if first is None:
            p, v = (both[0] for both in motion(times[-1], t0, p, v))
            t0 = times[-1]
            continue
        p, v = (both[0] for both in motion(first[0], t0, p, v))
        t0, j, _ = first
        last = j
        e = system.contacts[j].law.restitution
        v = v - (1 + e) * float(rows[j] @ v) / float(rows[j] ** 2 @ (1 / mass)) * rows[j] / mass
        impacts.append((t0, system.contacts[j].name))
    return impacts


def beside_simulator(system, base, y, y_rate, impacts=60):
    run = fi.integrate(
        system, base, fi.EventDriven(), 40 / base.frequency,
        fi.Recorder(tuple(f"{pair.name}.gap" for pair in system.contacts)),
        fi.State(ball_displacement=y, ball_velocity=y_rate),
    )  # fmt: skip
    own = simulated(system, base, float(run.impacts.time[impacts]), np.array(y), np.array(y_rate))[:impacts]
    assert list(run.impacts.impactor[:impacts]) == [name for _, name in own]
    difference = np.abs(run.impacts.time[:impacts] - [time for time, _ in own]).max()
    assert run.energy.residual < 1e-12
    for pair in system.contacts:
        x = run.channels[f"{pair.name}.gap"]
        assert x.max() <= pair.gaps[0] + 1e-12
        assert -x.min() <= pair.gaps[1] + 1e-12
    between = np.isin(run.impacts.impactor, [pair.name for pair in system.contacts if pair.between])
    assert 0 < between.sum() < between.size
    return difference


@pytest.mark.parametrize("count", [2, 3, 5])
def test_balls_in_a_driven_box_meet_as_in_an_independent_simulator(count):
    y_rate = [0.05 * (-1) ** i + 0.0237 * math.sqrt(i) for i in range(count)]
    difference = beside_simulator(box(count), fi.Sine(2e-3, 5.0, 0.0), [1.3e-4 * i**1.5 for i in range(count)], y_rate)
    assert difference < 1e-12


def test_balls_on_a_beam_of_four_modes_meet_as_in_an_independent_simulator():
    balls, meetings = chain(3, at="tip")
    beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    structure = fi.Structure(beam, impactors=balls, meetings=meetings, damping=fi.Rayleigh(0.003, (1, 2)))
    system = fi.reduce(fi.assemble(structure, elements=20), modes=4)
    assert beside_simulator(system, fi.Sine(2e-3, 15.0, 0.0), [0.0, 1e-4, 2e-4], [0.05, 0.0, -0.1]) < 1e-8


def thrown(count, gap, speed, duration=1.0, touching=False, **changes):
    """Balls of a still box; the first one is given a speed (m/s) towards the others."""
    balls, meetings = chain(count, gap=100.0, **changes)
    meetings = [fi.Meeting(item.name, item.between, gap, item.contact) for item in meetings]
    system = fi.System.from_matrices(
        [[1.0]], [[0.0]], [[1e4]], points={"wall": [0.0]}, base_load=[0.0], impactors=balls, meetings=meetings
    )
    y = [0.0 if touching else -0.5, *[0.0] * (count - 1)]
    start = fi.State(ball_displacement=y, ball_velocity=[speed, *[0.0] * (count - 1)])
    return fi.integrate(system, STILL, fi.EventDriven(), duration, initial=start)


def test_a_cradle_that_touches_follows_the_rule_and_one_with_gaps_does_not():
    touching = thrown(3, 0.0, 1.0, touching=True, restitution=1.0)
    np.testing.assert_allclose(touching.final_state.ball_velocity, [-1 / 3, 2 / 3, 2 / 3], rtol=0, atol=1e-14)
    apart = thrown(3, 1e-6, 1.0, restitution=1.0)
    np.testing.assert_allclose(apart.final_state.ball_velocity, [0.0, 0.0, 1.0], rtol=0, atol=1e-14)
    assert list(apart.impacts.impactor) == ["ab", "bc"]


@pytest.mark.parametrize("gap", [0.0, 1e-7])
def test_a_stack_that_falls(gap):
    # the lower ball m1 meets the floor at V, the upper one m2 comes behind it
    m1, m2, speed, law = 0.01, 0.003, 1.0, fi.Rigid(1.0)
    balls = [
        fi.Impactor("lower", "wall", m1, (math.inf, 0.1), law), fi.Impactor("upper", "wall", m2, math.inf, law),
    ]  # fmt: skip
    system = fi.System.from_matrices(
        [[1.0]], [[0.0]], [[1e4]], points={"wall": [0.0]}, base_load=[0.0], impactors=balls,
        meetings=[fi.Meeting("pair", ("lower", "upper"), gap, law)],
    )  # fmt: skip
    start = fi.State(ball_velocity=[-speed, -speed])
    run = fi.integrate(system, STILL, fi.EventDriven(), 0.2, initial=start)
    expected = [speed, speed] if gap == 0.0 else [(m1 - 3 * m2) / (m1 + m2), (3 * m1 - m2) / (m1 + m2)]
    np.testing.assert_allclose(run.final_state.ball_velocity, expected, rtol=0, atol=1e-13)


def test_three_balls_of_small_restitution_end_in_contact():
    # below 7 - 4 sqrt(3) free balls meet infinitely often in finite time
    run = thrown(3, 0.01, 1.0, restitution=0.05, duration=2.0)
    assert run.impacts.time.size > 20
    np.testing.assert_allclose(run.final_state.ball_velocity, 1 / 3, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.diff(run.final_state.ball_displacement), -0.01, rtol=0, atol=1e-9)
    assert run.energy.residual < 1e-12
    above = thrown(3, 0.01, 1.0, restitution=0.09, duration=2.0)
    assert above.impacts.time.size == 7
    assert np.all(np.diff(above.final_state.ball_velocity) > 1e-6)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"between": ("a", "a")}, "two different balls"),
        ({"between": ("a", "z")}, "z"),
        ({"gap": -1e-3}, "gap"),
        ({"gap": math.nan}, "gap"),
        ({"gap": math.inf}, "gap"),
        ({"name": "a"}, "distinct"),
        ({"between": ("a", "far")}, "one place of the beam"),
        ({"between": ("a", "b", "far")}, "two different balls"),
    ],
)
def test_bad_meetings_are_refused_in_one_line(changes, said):
    law = fi.Rigid(0.8)
    balls = [fi.Impactor(name, at, 0.01, 3e-3, law) for name, at in (("a", "tip"), ("b", 0.23), ("far", "mid"))]
    beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    good = {"name": "ab", "between": ("a", "b"), "gap": 3e-3, "contact": law}
    fi.Structure(beam, impactors=balls, meetings=[fi.Meeting(**good)])
    with pytest.raises(fi.InputError, match=said) as error:
        fi.Structure(beam, impactors=balls, meetings=[fi.Meeting(**good | changes)])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("law", [fi.Hertz(1e9), fi.contact.SwitchingSpring(10.0, 1e4)], ids=lambda law: law.name)
def test_a_meeting_takes_the_laws_that_its_method_takes(law):
    with pytest.raises(fi.InputError, match=f"contact = '{law.name}': must be Rigid or KelvinVoigt"):
        fi.Meeting("ab", ("a", "b"), 3e-3, law)


@pytest.mark.parametrize("method", [fi.MoreauJean(1e-3), fi.Newmark(1e-4)], ids=lambda method: type(method).__name__)
def test_step_methods_refuse_balls_that_meet(method):
    with pytest.raises(fi.InputError, match=r"meeting = 'ab, bc': .*EventDriven\(\)"):
        fi.integrate(box(3), STILL, method, 1.0)


def test_a_state_in_which_balls_have_passed_is_refused():
    with pytest.raises(fi.InputError, match=r"ab.gap = 0.004 m: must be at most 0.003 m; it is y of a less y of b"):
        fi.integrate(box(2), STILL, fi.EventDriven(), 1.0, initial=fi.State(ball_displacement=[2e-3, -2e-3]))


@pytest.mark.parametrize(
    ("law", "e"),
    [
        (fi.KelvinVoigt(restitution=0.6, contact_time=2e-3), 0.6),
        (fi.KelvinVoigt(stiffness=1e4, damping=0.0), 1.0),
        # straight between 1 and 0.5 at 0 and 2 m/s
        (fi.Rigid(0.8, over_speed=[(0.0, 1.0), (2.0, 0.5)]), 0.8 * 0.75),
        (fi.Rigid(0.6, at_speed=0.1, exponent=-0.25, at_most=0.95), 0.6 * 10.0**-0.25),
    ],
    ids=["Kelvin-Voigt", "spring", "over speed", "power of the speed"],
)
def test_two_balls_part_with_the_restitution_of_their_law(law, e):
    masses = [0.01, 0.004]
    run = thrown(2, 1e-3, 1.0, duration=0.6, masses=masses, law=law)
    first, second = run.final_state.ball_velocity
    assert second - first == pytest.approx(e, rel=1e-12)
    assert masses[0] * first + masses[1] * second == pytest.approx(masses[0], rel=1e-13)
    # of the relative motion, whose mass is that of both balls
    lost = 0.5 * (1 - e**2) / (1 / masses[0] + 1 / masses[1])
    assert run.energy.contact_loss[-1] == pytest.approx(lost, rel=1e-11, abs=1e-16)
    assert run.energy.residual < 1e-12


def test_balls_of_springs_that_touch_move_as_their_equations_say():
    # three balls in a row on springs that only push, the first struck: once more by a general integrator
    k, m = 1e4, [0.01, 0.02, 0.005]
    run = thrown(3, 0.0, 1.0, duration=0.05, touching=True, masses=m, law=fi.KelvinVoigt(stiffness=k, damping=0.0))

    def rate(_, z):
        push = k * np.maximum(-np.diff(z[:3]), 0.0)
        return np.concatenate([z[3:], np.array([-push[0], push[0] - push[1], push[1]]) / m])

    own = solve_ivp(rate, (0.0, 0.05), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-15, max_step=1e-5)
    np.testing.assert_allclose(run.final_state.ball_velocity, own.y[3:, -1], rtol=0, atol=1e-8)


def test_forces_between_balls_leave_the_structure_and_its_mass_alone():
    balls, meetings = chain(3, at="tip", law=fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
    beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    full = fi.assemble(fi.Structure(beam, impactors=balls, meetings=meetings), elements=10)
    apart = fi.assemble(fi.Structure(beam, impactors=balls), elements=10)
    assert full.total_mass == apart.total_mass
    system = fi.reduce(full, modes=3)
    channels = (
        "a.contact_force",
        "ab.contact_force",
        "bc.contact_force",
        "c.contact_force",
        "b.acceleration",
        "shaker_force",
    )
    # the balls meet, and no wall
    start = fi.State(ball_velocity=[1.0, 0.0, 0.0])
    run = fi.integrate(system, fi.Rest(), fi.EventDriven(), 8e-3, fi.Recorder(channels, interval=2e-5), start)
    a, ab, bc, c, acceleration, shaker = (run[name] for name in channels)
    assert not a.any()
    assert not c.any()
    assert ab.max() > 1.0
    # the force on the second is positive; the middle ball has the difference of both
    assert ab.min() >= 0.0
    np.testing.assert_allclose(0.01 * acceleration, ab - bc, rtol=0, atol=1e-9)
    np.testing.assert_allclose(shaker, 0.0, rtol=0, atol=1e-12)


def test_an_orbit_of_balls_that_meet_has_the_multipliers_of_runs():
    system, base, step = box(2, restitution=0.5), fi.Sine(4e-3, 5.0), 1e-8
    orbit = fi.find_orbit(system, base, guess=fi.integrate(system, base, fi.EventDriven(), 80.0))
    assert {system.contacts[j].name for j in orbit.events.pair} == {"a", "b", "ab"}
    state = orbit.state

    def end_of(z):
        u, y, v, rate = np.split(z, [1, 3, 4])
        moved = state.displacement + u, state.velocity + v, state.ball_displacement + y, state.ball_velocity + rate
        end = fi.integrate(system, base, fi.EventDriven(), 0.2, initial=fi.State(*moved, time=state.time)).final_state
        return np.concatenate([end.displacement, end.ball_displacement, end.velocity, end.ball_velocity])

    own = np.array([end_of(step * one) - end_of(-step * one) for one in np.eye(6)]).T / (2 * step)
    of_runs = np.sort(np.abs(np.linalg.eigvals(own)))
    np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), of_runs, rtol=0, atol=1e-4)
    # that of the box, which is given, are 1
    assert 0.1 < of_runs[-3] < 0.99
    with pytest.raises(fi.InputError, match=r"3 pairs with walls.*: must have one ball or stop"):
        fi.orbits.two_impact_orbits(system, base)
    branch = fi.continue_orbit(orbit, "meeting.ab.gap", (2.9e-3, 3.1e-3))
    assert branch.values.max() == pytest.approx(3.1e-3)


def structure_of_three():
    """The paper's beam with three balls of 2, 1 and 2 g in its box."""
    balls, meetings = chain(3, at="tip", restitution=0.6, masses=[2e-3, 1e-3, 2e-3])
    beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    box = fi.PointMass("box", "tip", 0.023)
    return fi.Structure(beam, [box], balls, fi.Rayleigh(0.003, (1, 2)), meetings=meetings)


STUDY = """
[beam]
length = "230 mm"
width = "20 mm"
thickness = "1 mm"
young_modulus = "70 GPa"
density = 2700
[mesh]
elements = 10
[[mass]]
name = "box"
at = "tip"
mass = "23 g"
[[impactor]]
name = "a"
at = "tip"
mass = "2 g"
gap = [inf, "3 mm"]
contact = { law = "rigid", restitution = 0.6 }
[[impactor]]
name = "b"
at = "tip"
mass = "1 g"
gap = inf
contact = { law = "rigid", restitution = 0.6 }
[[impactor]]
name = "c"
at = "tip"
mass = "2 g"
gap = ["3 mm", inf]
contact = { law = "rigid", restitution = 0.6 }
[[meeting]]
name = "ab"
between = ["a", "b"]
gap = "3 mm"
contact = { law = "rigid", restitution = 0.6 }
[[meeting]]
name = "bc"
between = ["b", "c"]
gap = "3 mm"
contact = { law = "kelvin-voigt", restitution = 0.6, contact_time = "2 ms" }
[damping]
ratio = 0.003
modes = [1, 2]
[reduction]
modes = 2
[base]
amplitude = "1 mm"
frequency = "5.3 Hz"
[method]
name = "event-driven"
"""


def test_a_study_file_says_with_units_which_balls_meet():
    study = read_study(STUDY, PATH)
    law = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    expected = replace(structure_of_three(), meetings=(
        fi.Meeting("ab", ("a", "b"), 3e-3, fi.Rigid(0.6)), fi.Meeting("bc", ("b", "c"), 3e-3, law),
    ))  # fmt: skip
    assert study.structure.meetings == expected.meetings
    assert [ball.gaps for ball in study.structure.impactors] == [ball.gaps for ball in expected.impactors]
    assert same_study(read_study(study_text(study), PATH), study)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('between = ["a", "b"]', 'between = ["a", "a"]', r"meeting.ab.between = 'a, a': must be the names of two"),
        ('between = ["a", "b"]', 'between = ["a", "z"]', r"meeting.ab.between = 'z': "),
        (
            'gap = "3 mm"\ncontact = { law = "kelvin',
            'gap = "-3 mm"\ncontact = { law = "kelvin',
            r"meeting.bc.gap = -0.003 m",
        ),
        ('contact_time = "2 ms"', "stiffness = 1e3, damping = 2.0", r"meeting.bc.contact"),
        (
            '"kelvin-voigt", restitution = 0.6',
            '"kelvin-voigt", restitution = 1.6',
            r"meeting.bc.contact.restitution = 1.6",
        ),
        # a fault of a ball is none of what it meets
        ('gap = [inf, "3 mm"]', 'gap = ["inf", "3 mm"]', r"impactor.a.gap = 'inf': must be inf for an open side"),
        ('mass = "1 g"', 'mass = "-1 g"', r"impactor.b.mass = -0.001 kg"),
    ],
)
def test_a_wrong_meeting_of_a_study_file_is_one_line(old, new, said):
    assert STUDY.count(old) == 1
    with pytest.raises(fi.InputError, match=said) as error:
        read_study(STUDY.replace(old, new), PATH)
    assert len(str(error.value).splitlines()) == 1


def test_a_study_over_gap_law_and_mass_has_the_numbers_of_single_runs():
    axes = {
        "meeting.ab.gap": [1e-3, 3e-3],
        "meeting.bc.contact.restitution": [0.4, 0.6],
        "impactor.b.mass": [1e-3, 2e-3],
    }
    table = fi.parameter_study(read_study(STUDY, PATH), axes, ["peak"], cycles=6)
    for gap, e, mass in itertools.product(*axes.values()):
        text = STUDY.replace('"1 g"', str(mass)).replace('voigt", restitution = 0.6', f'voigt", restitution = {e}')
        text = text.replace('"b"]\ngap = "3 mm"', f'"b"]\ngap = {gap}')
        system = fi.reduce(fi.assemble(read_study(text, PATH).structure, elements=10), modes=2)
        one = fi.frequency_sweep(system, 1e-3, [5.3], fi.EventDriven(), cycles=6)
        case = dict(zip(axes, (gap, e, mass), strict=True))
        assert float(table["peak"].sel(case)) == pytest.approx(one.peak[0], rel=1e-9)


@pytest.fixture(scope="module")
def drawn():
    """A run of three balls, and its structure."""
    structure = structure_of_three()
    system = fi.reduce(fi.assemble(structure, elements=10), modes=2)
    record = fi.Recorder(("tip", "a", "b", "c"), snapshots=1, snapshots_start=2.2)
    return fi.integrate(system, fi.Sine(1e-3, 5.3), fi.EventDriven(128), 2.4, record), structure


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_stack_that_lies_on_a_shaken_floor_leaves_it_where_one_ball_does(restitution):
    # in flight no force is between its balls, whatever their masses: rounding must not part them again and again
    law, base = fi.Rigid(restitution), fi.Sine(2e-3, 20.0)
    floors = {"a": (math.inf, 0.0), "b": math.inf, "c": math.inf}
    balls = [fi.Impactor(x, "floor", 0.01 / (1 + i), gap, law, acceleration=-9.81)
             for i, (x, gap) in enumerate(floors.items())]  # fmt: skip
    met = [fi.Meeting(x + y, (x, y), 0.0, law) for x, y in ("ab", "bc")]
    matrices = [[1.0]], [[0.0]], [[1e4]]
    start = {"points": {"floor": [0.0]}, "base_load": [0.0]}
    stack = fi.System.from_matrices(*matrices, **start, impactors=balls, meetings=met)
    single = fi.System.from_matrices(*matrices, **start, impactors=balls[:1])
    record = fi.Recorder(("a", "a.contact_force"), interval=1e-3)
    runs = [fi.integrate(system, base, fi.EventDriven(), 0.4, record) for system in (stack, single)]
    of_floor = [run.impacts.time[run.impacts.impactor == "a"] for run in runs]
    assert of_floor[0].size > 4
    np.testing.assert_allclose(*of_floor, rtol=0, atol=1e-11)
    np.testing.assert_allclose(runs[0]["a"], runs[1]["a"], rtol=0, atol=1e-11)
    # balls that lie on one another part at no other time than that of an impact on the floor
    between = runs[0].impacts.time[runs[0].impacts.impactor != "a"]
    assert np.abs(between[:, None] - of_floor[0]).min(axis=1, initial=np.inf).max(initial=0.0) < 1e-9
    assert any(text.startswith("ab sticks since t = ") for text in runs[0].notes)
    # the floor carries all three
    np.testing.assert_allclose(runs[0]["a.contact_force"], (1 + 1 / 2 + 1 / 3) * runs[1]["a.contact_force"], atol=1e-9)


@pytest.mark.parametrize("exaggeration", [1.0, 3.0])
def test_drawn_balls_touch_where_they_meet_and_at_their_walls(drawn, exaggeration):
    run, structure = drawn
    scene = build_scene(structure, run.system, exaggeration)
    first = dict(zip([(body.part, body.pair, body.side) for body in scene.bodies], scene.bodies, strict=True))
    spheres = [first[BALL, j, 0] for j in range(3)]
    tops = [body.points[:, 1].max() for body in spheres]
    bottoms = [body.points[:, 1].min() for body in spheres]
    # at rest the surfaces are a gap apart, of balls of different sizes too, and as far from both walls
    apart = exaggeration * 3e-3
    lower, upper = first[BOX, 0, -1].points[:, 1].max(), first[BOX, 2, 1].points[:, 1].min()
    for below, above in ((lower, bottoms[0]), (tops[0], bottoms[1]), (tops[1], bottoms[2]), (tops[2], upper)):
        assert above - below == pytest.approx(apart, rel=1e-12)
    assert lower == pytest.approx(-upper, rel=1e-12)
    # no wall between balls
    assert {(j, side) for part, j, side in first if part == BOX and side} == {(0, -1), (2, 1)}


def test_vtk_has_the_impulse_between_balls_on_both(drawn, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    run, structure = drawn
    reader = pyvista.get_reader(fi.vtk.write_deflection(tmp_path / "run.pvd", run, structure, most=60))
    met = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        mesh = reader.read()[0]
        impulse = mesh["contact_impulse_vector"][:, 1]
        if "a meets b" in str(mesh.field_data["name"][0]) and np.count_nonzero(impulse) == 2:
            met.append((time, impulse[impulse != 0.0], str(mesh.field_data["contacts"][0])))
            place = mesh.warp_by_vector("displacement").points[impulse != 0.0]
            assert place[0, 1] == pytest.approx(place[1, 1], abs=1e-7)
    assert met
    of_run = run.impacts.impulse[run.impacts.impactor == "ab"]
    for _, impulse, words in met:
        assert words.startswith("ab of a and b: impulse")
        # on the first of them downwards
        assert impulse[0] == -impulse[1] < 0.0
        assert np.abs(of_run - impulse[1]).min() < 1e-12
    # states at impacts, taken on from a snapshot, meet the next one
    assert float(mesh.field_data["impact_state_mismatch"][0]) < 1e-9


def test_player_and_overview_show_balls_beside_one_another(drawn):
    run, structure = drawn
    frames = player.frames_of(run)
    placed = placed_structure(structure, run.system)
    contacts = player._data(frames, placed, 3.0)["contacts"]
    assert [one["met"] for one in contacts] == [[1], [0, 2], [1]]
    low, middle, high = (one["beside"] for one in contacts)
    assert middle == pytest.approx([0.0, 0.0], abs=1e-15)
    assert low == pytest.approx([-y for y in high])
    assert high[0] - high[1] == pytest.approx(2 * 3e-3)
    # an impact between balls is one of both, at no wall
    number = [pair.name for pair in run.system.contacts].index("ab")
    inside = run.impacts.time >= run.snapshots.time[0]
    between = np.count_nonzero(run.impacts.impactor[inside] == "ab")
    assert number == 3
    assert len([one for one in frames.impacts if one[1:] == (0, 0)]) == between > 0
    words = "".join(structure_element(placed).itertext())
    assert "a and b meet, gap 3 mm, rigid" in words
    assert "3 balls" in structure_words(structure, run.system.contacts)
    assert "stop" not in structure_words(structure, run.system.contacts)


def test_a_field_at_its_default_is_not_in_the_key_of_a_study():
    study = fi.app.ParameterStudy(paper_study(), {"impactor.ball.gap": [2e-3]}, ["peak"], cycles=3)
    plain = json.dumps(plain_study(study))
    assert "stops" not in plain
    assert "meetings" not in plain
