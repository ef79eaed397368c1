"""Balls that meet one another: an independent simulator, closed forms of chains, what is refused, study files."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from builders import paper_study, plain_study
from scipy.optimize import brentq

import femimpact as fi

pytestmark = pytest.mark.impacts

STILL = fi.Sine(0.0, 1.0)


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


def test_step_methods_refuse_balls_that_meet():
    with pytest.raises(fi.InputError, match="EventDriven"):
        fi.integrate(box(2), STILL, fi.MoreauJean(1e-3), 1.0)


def test_a_field_at_its_default_is_not_in_the_key_of_a_study():
    study = fi.app.ParameterStudy(paper_study(), {"impactor.ball.gap": [2e-3]}, ["peak"], cycles=3)
    plain = json.dumps(plain_study(study))
    assert "stops" not in plain
    assert "meetings" not in plain
