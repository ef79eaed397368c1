"""The search for the next event: no crossing of a wall is missed, in thousands of random flights."""

import dataclasses
import math

import numpy as np
import pytest

import femimpact as fi
from femimpact.integrators.driving import drive_of
from femimpact.integrators.event_driven import new_search, space_of
from femimpact.integrators.flight_space import flight_space
from femimpact.integrators.kernels import search
from femimpact.integrators.kernels.compiling import entry
from femimpact.integrators.kernels.crossing import Flight

next_event = entry(search.next_event)


def beam_with_ball(modes):
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("box", at="tip", mass=0.02290976)],
        impactors=[fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.Rigid(restitution=0.7))],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )
    return fi.reduce(fi.assemble(structure, elements=20), modes=modes)


def first_beyond(space, flight, horizon, points):
    """First time at which a fine scan of the closed form finds the pair beyond a wall, else infinity."""
    t = np.linspace(0.0, horizon, points)
    terms = space.watch.weight[0][:, None] * flight.entry[:, None] * np.exp(np.outer(space.watch.exponent, t))
    wave = space.watch.sine[0] * np.exp(1j * (space.watch.omega * t + flight.clock[3]))
    y = flight.particle[:, None] + np.outer(flight.particle_rate, t) + 0.5 * np.outer(space.watch.particle_given, t**2)
    x = terms.real.sum(axis=0) + wave.real + space.watch.constant[0] + space.watch.particle_weight[0] @ y
    out = np.flatnonzero((x > space.watch.upper[0]) | (x < space.watch.lower[0]))
    return (t[out[0]] if out.size else math.inf), t[1]


@pytest.mark.parametrize(("modes", "states"), [(1, 1000), (4, 1000), (8, 1000), (16, 300)])
def test_no_crossing_is_missed_in_thousands_of_random_flights(modes, states):
    rng = np.random.default_rng(modes)
    horizon, points = 0.05, 40_001
    base = beam_with_ball(modes)
    met = 0
    for _ in range(states):
        gap = 10.0 ** rng.uniform(-6, -2)
        pair = dataclasses.replace(base.contacts[0], gaps=(gap, gap * 10.0 ** rng.uniform(-1, 1)))
        system = dataclasses.replace(base, contacts=(pair,))
        drive = drive_of(system, fi.Sine(10.0 ** rng.uniform(-6, -3), rng.uniform(1, 300), rng.uniform(0, 6)))
        closed = flight_space(system, drive)
        space = space_of(system, drive, closed, 1e-3)
        scale = gap * 10.0 ** rng.uniform(-3, 1)
        entry = scale * (rng.normal(size=modes) + 1j * rng.normal(size=modes)) * 10.0 ** rng.uniform(-3, 0, modes)
        ball = np.array([rng.uniform(-1, 1) * scale, 10.0 ** rng.uniform(-4, 0) * rng.choice([-1, 1])])
        flight = Flight(
            entry, ball[:1] / closed.particle_shape[-1, :1], ball[1:] / closed.particle_shape[-1, :1],
            np.array([0.0, 0.0, 0.0, drive.phase]), np.zeros(modes, dtype=complex),
        )  # fmt: skip
        expected, step = first_beyond(space, flight, horizon, points)
        if expected == 0.0:
            continue
        scratch = new_search(1, modes, 1)
        status = next_event(space.watch, flight, horizon, scratch)
        time = flight.clock[0] if status == search.HIT else math.inf
        met += status == search.HIT
        # the scan sees a crossing one point late at most; the event may be a graze between two points
        assert time <= expected
        if math.isfinite(expected) and time < expected - step:
            again, _ = first_beyond(space, flight, 0.0, 2)
            # an earlier event is a real one: at its instant the pair is at its wall, to rounding
            assert again in (0.0, math.inf)
            x = space.watch.upper[0] if scratch.at_wall[0] > 0 else space.watch.lower[0]
            assert abs(value_now(space, flight) - x) < 1e-12 * (abs(x) + scale + 1)
    assert met > states / 4


def value_now(space, flight):
    wave = space.watch.sine[0] * np.exp(1j * (space.watch.omega * flight.clock[0] + flight.clock[3]))
    return float(
        (space.watch.weight[0] @ flight.entry).real
        + wave.real
        + space.watch.constant[0]
        + space.watch.particle_weight[0] @ flight.particle
    )
