"""A law's force as a C function: of Python with and without numba, of ctypes, of SciPy; what ends a run, and how."""

from __future__ import annotations

import ctypes
import math

import numba
import numpy as np
import pytest
from scipy import LowLevelCallable

import femimpact as fi
from femimpact.contact import custom_law

pytestmark = pytest.mark.impacts

STIFFNESS, MASS, SPEED = 1e4, 2.0, 0.7
DEEPEST = SPEED / math.sqrt(1.0 + STIFFNESS / MASS)
"""m, of the collision below without damping, on a separate spring: 9.9 mm."""

PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * 3)
OTHER = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)


def linear(depth, rate, approach_speed):
    return 1e4 * depth * (1.0 + 0.1 * rate / approach_speed)


def raising(depth, rate, approach_speed):
    if depth > 5e-3:
        raise ValueError("the felt is\nworn through")
    return 1e4 * depth


def not_a_number(depth, rate, approach_speed):
    return math.nan if depth > 5e-3 else 1e4 * depth


def endless(depth, rate, approach_speed):
    return math.inf if depth > 5e-3 else 1e4 * depth


def interrupted(depth, rate, approach_speed):
    if depth > 5e-3:
        raise KeyboardInterrupt
    return 1e4 * depth


class Linear:
    """An object that is called."""

    def __call__(self, depth, rate, approach_speed):  # noqa: D102
        return linear(depth, rate, approach_speed)


@pytest.fixture
def without_numba(monkeypatch):
    """Functions of Python are called as such."""
    custom_law._of_python.cache_clear()
    monkeypatch.setattr(custom_law, "_compiled", lambda force: None)
    yield
    custom_law._of_python.cache_clear()


def system_of(law):
    stop = fi.Stop("wall", "mass", (0.0, math.inf), law)
    return fi.System.from_matrices([[MASS]], [[0.0]], [[MASS]], points={"mass": [1.0]}, stops=[stop])


def collision(force, method=fi.Newmark(1e-4)):  # noqa: B008 - a value
    """From the middle away from the wall, half a free period, then one collision."""
    start = fi.State(velocity=[-SPEED])
    system, base = system_of(fi.CustomLaw(force)), fi.Sine(amplitude=0.0, frequency=0.1)
    return fi.integrate(system, base, method, 3.5, fi.Recorder(("mass",)), initial=start)


MADE = {
    "numba.njit": lambda: numba.njit(linear),
    "numba.cfunc": lambda: numba.cfunc("float64(float64, float64, float64)")(linear),
    "ctypes": lambda: PROTOTYPE(linear),
    "LowLevelCallable": lambda: LowLevelCallable(PROTOTYPE(linear)),
    "object": Linear,
}


@pytest.mark.parametrize("kind", MADE)
def test_every_kind_of_function_is_the_same_law(kind):
    expected, found = collision(linear), collision(MADE[kind]())
    # the same operations in the same order
    np.testing.assert_array_equal(found["mass"], expected["mass"])
    np.testing.assert_array_equal(found.energy.contact_loss, expected.energy.contact_loss)
    assert len(found.impacts) == 1


def test_without_numba_the_run_is_the_same_and_a_note_says_what_would_be_faster(without_numba):
    slow = collision(linear)
    custom_law._of_python.cache_clear()
    assert [note for note in slow.notes if "called as a function of Python" in note]
    assert not [note for note in collision(PROTOTYPE(linear)).notes if "called as a function of Python" in note]


def test_a_function_that_numba_cannot_compile_runs_in_python():
    run = collision(lambda depth, rate, speed: float(str(linear(depth, rate, speed))))
    assert len(run.impacts) == 1
    assert [note for note in run.notes if "numba cannot compile it" in note]


@pytest.mark.parametrize("method", [fi.Newmark(1e-4), fi.Newmark(1e-4, contact="energy-consistent"), fi.HHT(1e-4)])
@pytest.mark.parametrize("how", ["compiled", "in Python"])
def test_a_law_that_raises_ends_the_run_with_its_name_and_cause(how, method, request):
    if how == "in Python":
        request.getfixturevalue("without_numba")
    with pytest.raises(fi.InputError) as refusal:
        collision(raising, method)
    line = str(refusal.value)
    assert line.startswith("wall.contact.force: raised ValueError: the felt is worn through, at depth 0.005")
    assert "\n" not in line
    assert isinstance(refusal.value.__cause__, ValueError)


@pytest.mark.parametrize("how", ["compiled", "in Python", "ctypes"])
@pytest.mark.parametrize(("force", "shown"), [(not_a_number, "nan"), (endless, "inf")])
def test_a_force_that_is_not_finite_ends_the_run(how, force, shown, request):
    if how == "in Python":
        request.getfixturevalue("without_numba")
    with pytest.raises(fi.InputError, match=f"^wall.contact.force = {shown} N: must be finite, at depth 0.005"):
        collision(PROTOTYPE(force) if how == "ctypes" else force)


def test_a_sweep_ends_too():
    system = system_of(fi.CustomLaw(not_a_number))
    with pytest.raises(fi.InputError, match=r"^wall.contact.force = nan N"):
        fi.frequency_sweep(system, 5.0, [0.1, 0.14], fi.Newmark(1e-3), cycles=3, at="mass")


def test_an_interrupt_within_the_law_is_an_interrupt(without_numba):
    with pytest.raises(KeyboardInterrupt):
        collision(interrupted)
    # and nothing of it is left for the next run
    assert len(collision(linear).impacts) == 1


def test_one_collision_alone_ends_too():
    shallow = fi.CustomLaw(raising, reference_speed=0.1)
    pair = system_of(shallow).contacts[0]
    with pytest.raises(fi.InputError, match=r"^wall.contact.force: raised ValueError"):
        fi.integrators.achieved_restitution(pair, fi.Newmark(1e-4), SPEED)


@pytest.mark.parametrize(
    "wrong",
    [3, "force", None, linear.__code__, Linear, OTHER(abs), LowLevelCallable(OTHER(abs)), ctypes.CDLL(None).cos,
     PROTOTYPE(0), 140_000_000_000],
    ids=lambda value: str(value).partition(" at 0x")[0],
)  # fmt: skip
def test_what_is_no_function_of_the_signature_is_refused(wrong):
    with pytest.raises(fi.InputError, match="must be a function of depth, rate, approach_speed"):
        fi.CustomLaw(wrong)


def test_a_law_that_raises_at_its_reference_speed_says_so_when_it_is_used():
    law = fi.CustomLaw(raising, reference_speed=10.0)
    with pytest.raises(fi.InputError, match=r"^custom.force: raised ValueError: the felt is worn through"):
        law.parameters(MASS)


def test_the_penetration_is_that_of_the_linear_law():
    # no loss: x = v/w sin(w t); second order, (w dt)^2/24 with w dt = 0.007
    run = collision(lambda depth, rate, speed: 1e4 * depth)
    assert np.max(run["mass"]) == pytest.approx(DEEPEST, rel=1e-4)
