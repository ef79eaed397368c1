"""The search of periodic orbits: what is one orbit, what is refused, and why; against closed forms."""

import math

import numpy as np
import pytest
from builders import oscillator

import femimpact as fi
from femimpact.orbits.newton import _at_rounding

pytestmark = pytest.mark.impacts

FIRST = 1 / (2 * math.pi)
"""Natural frequency (Hz) of an oscillator of 1 kg and 1 N/m."""


def force(ratio, amplitude=1.0):
    """A sine of so many natural frequencies."""
    return fi.PointForce("mass", fi.Sine(amplitude, ratio * FIRST))


def boxed(gap=10.0, restitution=0.7, damping=0.0):
    """A ball between two equal walls on an oscillator."""
    return oscillator(damping=damping, impactors=[fi.Impactor("ball", "mass", 0.1, gap, fi.Rigid(restitution))])


def stopped(law, damping=0.1, gap=0.3, names=("stop",)):
    """An oscillator with stops to its + side."""
    return oscillator(damping=damping, stops=[fi.Stop(name, "mass", (gap, math.inf), law) for name in names])


def test_steps_that_halve_are_no_rounding():
    # Newton's method at a double root halves its error: it is as large as the step
    assert not _at_rounding([0.08 * 0.5**k for k in range(24)])
    # at a simple root it falls quadratically, and then moves by what rounding leaves
    assert _at_rounding([1e-2, 1e-4, 3e-9, 2e-9])
    # from the orbit itself it is rounding at once, and what still falls is not
    assert _at_rounding([4e-9, 2e-9])
    assert not _at_rounding([1e-3, 1e-5, 1e-9])


def test_a_resonance_without_damping_is_refused_as_in_runs():
    words = "frequency = .* Hz: must not be a natural frequency of an undamped mode"
    for search in (
        lambda: fi.two_impact_orbits(boxed(), force(1.0)),
        lambda: fi.find_orbit(boxed(), force(1.0), guess=fi.two_impact_orbits(boxed(), force(0.99))[0]),
        lambda: fi.find_orbits(boxed(), force(1.0), [fi.State()]),
        lambda: fi.integrate(boxed(), force(1.0), fi.EventDriven(), 10.0),
    ):
        with pytest.raises(fi.InputError, match=words):
            search()
