"""What a history is as a force, and that the force of a sum is the sum of the forces, for all pairs of kinds."""

import itertools
import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from builders import REFERENCE, reduced
from test_own_excitation import Polynomial
from test_piecewise_polynomial import Own

import femimpact as fi
from femimpact.excitation.excitation import words_of

END, INTERVAL, DT = 0.4, 2e-3, 2e-4
SINE = fi.Sine(0.05, 5.0)
LATE = Own(fi.excitation.PiecewisePolynomial([0.1003, 0.15, 0.2507], [[0.0, 1.0, 0.0], [0.05, -1.0, 4.0]]))
"""Begins late and ends early."""
RECORD = fi.RecordedBase(0.1 * np.random.default_rng(1).standard_normal(40), 0.0077, 0.2)
KINDS = {
    "sine": SINE,
    "sine of its frequency": fi.Sine(0.02, 5.0, 1.0),
    "sine of another": fi.Sine(0.03, 7.3, 0.4),
    "chirp": fi.Chirp(4.0, 9.0, 0.31, amplitude=0.1),
    "chirp by acceleration": fi.Chirp(8.0, 4.0, 3.0, acceleration=0.1, kind="logarithmic"),
    "stepped": fi.SteppedSine((9.0, 11.0), 2, amplitude=0.1),
    "stepped by acceleration": fi.SteppedSine((9.0, 11.0), 2, acceleration=0.1, direction="down"),
    "random": fi.RandomBase([(2.0, 1e-4), (40.0, 1e-4)], 0.3313, seed=2),
    "random amplitudes": fi.RandomBase([(2.0, 1e-4), (40.0, 1e-4)], 5.0, seed=2, amplitudes="random"),
    "shock": fi.Shock("terminal-sawtooth", acceleration=0.5, duration=0.0301),
    "compensated": fi.Shock("half-sine", acceleration=0.5, duration=0.0111, compensated=True),
    "record": RECORD,
    "late": LATE,
    "sum": fi.Sine(0.02, 3.1) + fi.Sine(0.02, 11.0, 0.3),
    "sum with an end": fi.excitation.Sum((fi.Sine(0.02, 6.1), RECORD), end=0.05),
    "sum of a sum": fi.excitation.Sum((fi.excitation.Sum((SINE, fi.Sine(0.01, 12.0))), LATE)),
}  # fmt: skip
BY_AMPLITUDE = ("sine", "sine of its frequency", "sine of another", "chirp", "stepped", "sum")
PAIRS = list(itertools.combinations_with_replacement(KINDS, 2))


@pytest.fixture(scope="module")
def beam():
    return fi.without_impactors(reduced(REFERENCE, 4, 12))


def push(history):
    return fi.PointForce("tip", history)


@cache
def runs_alone(system, name):
    return runs(system, KINDS[name])


def runs(system, history):
    """Motions of the tip under a force, event-driven and by Newmark."""
    exact = fi.integrate(system, push(history), fi.EventDriven(), END, fi.Recorder("tip", interval=INTERVAL))
    steps = fi.integrate(system, push(history), fi.Newmark(DT), END, fi.Recorder("tip"))
    return exact["tip"], steps["tip"]


@pytest.mark.parametrize("name", [name for name in KINDS if not name.startswith("sum ")])
def test_a_history_is_the_force_that_it_was_given_by_and_none_outside(name):
    history = KINDS[name]
    first, last = {"late": (0.1003, 0.2507), "record": (0.0, 39 * 0.0077)}.get(
        name, (0.0, END if name == "compensated" else getattr(history, "duration", END))
    )
    t = np.linspace(-0.05, END + 0.1, 1003)[1:]
    given = history.displacement if name in BY_AMPLITUDE else history.acceleration
    last = min(last, END)
    acts = (t >= first) & (t < last)
    if "sine" in name or name == "sum":
        acts[:] = True
    t, acts = t[t < END], acts[t < END]
    size = np.abs(given(t[acts])).max()
    # pieces meet a history to 1e-9 of its largest value
    np.testing.assert_allclose(push(history).force(t), np.where(acts, given(t), 0.0), atol=2e-9 * size)


def test_a_stepped_sine_begins_farthest_out():
    # ub = A cos has the acceleration -a cos: what it was given by is the force
    assert push(KINDS["stepped"]).force(0.0) == pytest.approx(0.1, rel=1e-8)
    assert push(KINDS["stepped by acceleration"]).force(0.0) == pytest.approx(-0.1, rel=1e-8)


@pytest.mark.parametrize("pair", PAIRS, ids=" and ".join)
def test_the_force_of_a_sum_is_the_sum_of_the_forces(beam, pair):
    first, second = (KINDS[name] for name in pair)
    t = np.random.default_rng(0).uniform(-0.1, 1.0, 200)
    parts = push(first).force(t) + push(second).force(t)
    for whole in (fi.excitation.Sum((first, second)), fi.excitation.Sum((second, first), end=0.02)):
        np.testing.assert_allclose(push(whole).force(t), parts, rtol=0.0, atol=1e-14)
    # without contacts all is linear; pieces meet each force to 1e-9
    found, alone = runs(beam, fi.excitation.Sum((first, second))), [runs_alone(beam, name) for name in pair]
    for values, one, other in zip(found, *alone, strict=True):
        size = np.abs(one).max() + np.abs(other).max()
        assert np.abs(values - one - other).max() < 1e-8 * size
        assert np.abs(values).max() > 0.0 < min(np.abs(one).max(), np.abs(other).max())


def test_a_sum_of_sines_of_one_frequency_is_a_force_with_a_cycle(beam):
    force = push(SINE + fi.Sine(0.02, 5.0, 1.0))
    assert force.has_cycle
    assert words_of(force) == "force at tip, 5 Hz"
    t = np.linspace(0.0, 1.0, 101)
    size = math.hypot(0.05 + 0.02 * math.cos(1.0), 0.02 * math.sin(1.0))
    np.testing.assert_allclose(force.force(t), size * np.sin(10.0 * np.pi * t + force.phase), atol=1e-15)


def test_sines_last_until_the_last_reading(beam):
    # 1.06 s are rounded to 11 readings
    whole = fi.integrate(beam, push(KINDS["sum"]), fi.EventDriven(), 2.0, fi.Recorder("tip", interval=0.1))
    short = fi.integrate(beam, push(KINDS["sum"]), fi.EventDriven(), 1.06, fi.Recorder("tip", interval=0.1))
    assert short.time.size == 12
    np.testing.assert_allclose(short["tip"], whole["tip"][:12], rtol=0.0, atol=1e-12 * np.abs(whole["tip"]).max())


def test_sums_in_sums_move_the_base(beam):
    nested, flat = fi.excitation.Sum((KINDS["sum"], SINE)), KINDS["sum"] + SINE
    found = [
        fi.integrate(beam, base, fi.EventDriven(), END, fi.Recorder("tip", interval=INTERVAL))["tip"]
        for base in (nested, flat)
    ]
    np.testing.assert_allclose(*found, rtol=0.0, atol=1e-8 * np.abs(found[0]).max())


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: push(fi.excitation.Sum((SINE, Polynomial(1.0)))), r"history = 'Polynomial'.*must have a closed form"),
        (lambda: push(fi.excitation.Sum((fi.excitation.Sum((SINE, Polynomial(1.0))), SINE))),
            r"history = 'Polynomial'.*closed form"),
        (lambda: push(SimpleNamespace(frequency=5.0, phase=0.0, amplitude=1.0)), r"history = 'SimpleNamespace'"),
        (lambda: fi.excitation.Sum((SINE, fi.HammerBlow("tip", 0.1, 1e-3))),
            r"parts = 'HammerBlow'.*a force acts elsewhere"),
        (lambda: fi.excitation.Sum((push(SINE), SINE)), r"parts = 'PointForce'.*PointForce\(at, a \+ b\)"),
        (lambda: push(fi.excitation.Sum), r"history"),
        (lambda: push([SINE, SINE]), r"history"),
        (lambda: fi.excitation.Sum((SINE, 3.0)), r"parts = 'float'"),
        (lambda: fi.excitation.Sum((SINE,), end=0.0), r"end = 0"),
    ],
)  # fmt: skip
def test_what_a_sum_cannot_be_is_refused_when_it_is_made(make, words):
    with pytest.raises(fi.InputError, match=words) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_a_run_of_sines_that_is_too_long_is_refused_for_what_it_keeps(beam):
    for drive in (KINDS["sum"], push(KINDS["sum"])):
        for method in (fi.EventDriven(), fi.Newmark(DT)):
            with pytest.raises(fi.InputError, match=r"record.memory_limit"):
                fi.integrate(beam, drive, method, 1e9)


@pytest.mark.parametrize("duration", ["a", None, math.nan, math.inf, -1.0, 0.0])
def test_a_sum_is_refused_a_duration_by_its_name(beam, duration):
    for drive in (KINDS["sum"], push(KINDS["sum"])):
        for method in (fi.EventDriven(), fi.Newmark(DT)):
            with pytest.raises(fi.InputError, match=r"^duration"):
                fi.integrate(beam, drive, method, duration)
