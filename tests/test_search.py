"""The search for the next event: no crossing of a wall is missed, in thousands of random motions."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact import core
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.block import inputs_of, new_block, run_block, working_space
from femimpact.integrators.event_driven.store import FormStore, outputs_of

HIT, STUCK = 1, 4
"""How a search ends at a wall that is met at speed, and where it finds no end."""

SPAN = 200
"""Instants of a fine scan that share the exponentials of the first of them."""


def first_beyond(scalars, motion, horizon, points):
    """First time at which a fine scan of the closed form finds the pair beyond a wall, else infinity."""
    t = np.linspace(0.0, horizon, points)
    entries = scalars.exponent.size
    # the entries, and the steady motion as one more
    exponent = np.append(scalars.exponent, 1j * scalars.omega)
    own = np.append(
        scalars.weight[0, :entries] * motion.entry[:entries], scalars.sine[0] * np.exp(1j * motion.clock[1])
    )
    # exp(a (t + s)) = exp(a t) exp(a s): a matrix product over every SPAN-th instant and the instants after it
    starts = own * np.exp(np.outer(t[::SPAN], exponent))
    x = (starts @ np.exp(np.outer(exponent, t[:SPAN]))).real.ravel()[:points]
    y = motion.rigid_body[:, None] + np.outer(motion.rigid_body_rate, t)
    y += 0.5 * np.outer(scalars.rigid_body_given, t**2)
    x += scalars.constant[0] + scalars.rigid_body_weight[0] @ y
    out = np.flatnonzero((x > scalars.upper[0]) | (x < scalars.lower[0]))
    return (t[out[0]] if out.size else math.inf), t[1]


def free_motion(system, drive):
    """Scalars of a system whose ball flies, and a motion of that size."""
    store = FormStore([system], [drive], [outputs_of(system, system.point_row("tip"))])
    rest = np.zeros((1, system.dofs + 1))
    window = np.array([[0.0, np.inf]])
    inputs = inputs_of([drive], [system.contacts], rest, rest, window)
    block = new_block(store, inputs, fi.EventDriven(), None)
    nothing = np.zeros(1, dtype=np.int64)
    # to t = 0: the closed form is made, and its steady motion is known
    run_block(block, nothing - 1, nothing, np.ones(1))
    space = working_space(block, store.forms)
    forms, bounds, (plus, minus) = store.forms, space.bounds, system.contacts[0].gaps
    # nothing is in contact: no wall holds anything, and both are watched
    bounds.constant[:], bounds.given[:] = forms.constant[0, :, 0], forms.rigid_body_given[0, :, 0]
    bounds.upper[:], bounds.lower[:] = np.inf, -np.inf
    bounds.upper[0], bounds.lower[0] = plus, -minus
    return scalars_of(block, forms, drive, space), space, float(forms.rigid_body_shape[0, -1, 0])


def scalars_of(block, forms, drive, space):
    """Scalars of the first case in the first form, named as the core does, in its order."""
    entries, rigid_bodies, bounds = int(forms.entries[0]), int(forms.rigid_bodies[0]), space.bounds
    values = {
        "exponent": forms.exponent[0, :entries], "coupling": forms.coupling[0, :entries, :entries].copy(),
        "blocks": forms.blocks[0], "size": forms.size[0, :entries], "omega": drive.omega, "degree": -1,
        "rigid_body_given": bounds.given[:rigid_bodies], "rigid_body_drive": bounds.nothing[:, :rigid_bodies].copy(),
        "lasting": bounds.lasting, "upper": bounds.upper, "lower": bounds.lower,
        "weight": forms.weight[0, :, :entries].copy(), "weight_size": forms.weight_size[0, :, :entries].copy(),
        "rigid_body_weight": forms.rigid_body_weight[0, :, :rigid_bodies].copy(),
        "rigid_body_rate_weight": forms.rigid_body_rate_weight[0, :, :rigid_bodies].copy(),
        "sine": block.cases.sine[0, 0], "constant": bounds.constant, "follow": forms.follow[0],
        "driven": 0, "slow": 0, "load": forms.load[0, :, :entries].copy(), "given": bounds.entry_given[:entries],
        "term": np.zeros(entries, dtype=complex), "growth": np.zeros(entries, dtype=complex),
    }  # fmt: skip
    prefix = "search_call.scalars."
    names = [name.removeprefix(prefix) for name, *_ in core.tables() if name.startswith(prefix)]
    return SimpleNamespace(**values, handed=tuple(values[name] for name in names))


def motion_alone(motion, entries, rigid_bodies):
    """A motion of the size of one form."""
    return motion._replace(
        entry=motion.entry[:entries],
        rigid_body=motion.rigid_body[:rigid_bodies],
        rigid_body_rate=motion.rigid_body_rate[:rigid_bodies],
    )


@pytest.mark.parametrize(("modes", "cases"), [(1, 700), (4, 700), (8, 700), (16, 200)])
def test_no_crossing_is_missed_in_thousands_of_random_motions(modes, cases):
    rng = np.random.default_rng(modes)
    horizon, points = 0.05, 40_001
    base = reduced(with_ball(REFERENCE, contact=fi.Rigid(restitution=0.7)), modes)
    met = 0
    for _ in range(cases):
        gap = 10.0 ** rng.uniform(-6, -2)
        pair = dataclasses.replace(base.contacts[0], gaps=(gap, gap * 10.0 ** rng.uniform(-1, 1)))
        system = dataclasses.replace(base, contacts=(pair,))
        drive = drive_of(system, fi.Sine(10.0 ** rng.uniform(-6, -3), rng.uniform(1, 300), rng.uniform(0, 6)))
        scalars, space, shape = free_motion(system, drive)
        entries = scalars.exponent.size
        motion = motion_alone(space.trial, entries, scalars.rigid_body_given.size)
        search = space.search._replace(
            size=np.zeros(entries), drift=np.zeros((2, entries)), power=np.zeros((3, entries), dtype=complex)
        )
        scale = gap * 10.0 ** rng.uniform(-3, 1)
        motion.entry[:] = 0.0
        motion.entry[:modes] = scale * (rng.normal(size=modes) + 1j * rng.normal(size=modes))
        motion.entry[:modes] *= 10.0 ** rng.uniform(-3, 0, modes)
        motion.rigid_body[:] = rng.uniform(-1, 1) * scale / shape
        motion.rigid_body_rate[:] = 10.0 ** rng.uniform(-4, 0) * rng.choice([-1, 1]) / shape
        motion.clock[:] = 0.0, drive.sine.phase
        expected, step = first_beyond(scalars, motion, horizon, points)
        if expected == 0.0:
            continue
        status = core.next_event((scalars.handed, motion, search), horizon)
        time = motion.clock[0] if status == HIT else math.inf
        met += status == HIT
        # the scan sees a crossing one point late at most; the event may be a graze between two points
        assert time <= expected
        if math.isfinite(expected) and time < expected - step:
            again, _ = first_beyond(scalars, motion, 0.0, 2)
            # an earlier event is a real one: at its instant the pair is at its wall, to rounding
            assert again in (0.0, math.inf)
            x = scalars.upper[0] if space.search.at_wall[0] > 0 else scalars.lower[0]
            assert abs(value_now(scalars, motion) - x) < 1e-12 * (abs(x) + scale + 1)
    assert met > cases / 4


@pytest.mark.parametrize("size", [-1e13, -1e15, 1e30, -1e200])
@pytest.mark.parametrize("horizon", [0.05, 1e9])
def test_a_sine_far_larger_than_its_gap_ends_the_search(size, horizon):
    """Both walls lie within the rounding of such a motion, and no time between them can be told from the next one."""
    system = reduced(with_ball(REFERENCE, contact=fi.Rigid(restitution=0.7)), 4)
    drive = drive_of(system, fi.Sine(1e-4, 5.0, 0.3))
    scalars, space, _ = free_motion(system, drive)
    entries = scalars.exponent.size
    motion = motion_alone(space.trial, entries, scalars.rigid_body_given.size)
    search = space.search._replace(
        size=np.zeros(entries), drift=np.zeros((2, entries)), power=np.zeros((3, entries), dtype=complex)
    )
    motion.entry[:], motion.rigid_body[:], motion.rigid_body_rate[:] = 0.0, 0.0, 0.0
    motion.clock[:] = 0.0, drive.sine.phase
    scalars.sine[0] = size
    assert core.next_event((scalars.handed, motion, search), horizon) in (HIT, STUCK)


def value_now(scalars, motion):
    wave = scalars.sine[0] * np.exp(1j * (scalars.omega * motion.clock[0] + motion.clock[1]))
    return float(
        (scalars.weight[0] @ motion.entry).real
        + wave.real
        + scalars.constant[0]
        + scalars.rigid_body_weight[0] @ motion.rigid_body
    )
