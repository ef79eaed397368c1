"""Exponentials of the event-driven method, against the C library's, which is good to a unit in the last place."""

import math
from fractions import Fraction

import numpy as np
import pytest

from femimpact.core import cosine_and_sine, exponentials

LARGEST_ANGLE, LARGEST_DECAY = 1e6, 700.0
"""Of an angle and of a negative exponent, beyond which the core asks the C library."""

EPS = np.finfo(float).eps


def exponentials_of(numbers, time=1.0):
    out = np.empty_like(numbers)
    exponentials(numbers, time, out)
    return out


# 21: some are left over where several are taken at a time
@pytest.mark.parametrize("count", [1, 2, 3, 4, 8, 21, 1000])
@pytest.mark.parametrize(
    ("decay", "angle"), [(0.0, 1.0), (0.3, 10.0), (40.0, 1e4), (LARGEST_DECAY, LARGEST_ANGLE), (LARGEST_DECAY, 1e9)]
)
def test_exponentials_are_those_of_the_library(count, decay, angle):
    random = np.random.default_rng(count)
    numbers = -decay * random.uniform(0.0, 1.0, count) + 1j * angle * random.uniform(-1.0, 1.0, count)
    exact = np.exp(numbers)
    # two units of own rounding, one of the library's
    assert np.all(np.abs(exponentials_of(numbers) - exact) <= 3.0 * EPS * np.exp(numbers.real))


def test_what_does_not_move_is_left_to_the_last_bit():
    assert np.all(exponentials_of(np.zeros(9, dtype=complex)) == 1.0)
    assert np.all(exponentials_of(np.full(9, -3.0 + 40.0j), 0.0) == 1.0)


def test_what_has_died_out_is_zero():
    assert np.all(exponentials_of(np.array([-1e4 + 1j, -1e300 + 5j, -800.0 + 0j])) == 0.0)


def test_damping_without_oscillation_is_real():
    numbers = -np.geomspace(1e-9, 600.0, 50) + 0j
    found = exponentials_of(numbers)
    assert np.all(found.imag == 0.0)
    np.testing.assert_allclose(found.real, np.exp(numbers.real), rtol=3.0 * EPS)


def test_sine_and_cosine_close_to_multiples_of_a_quarter_turn():
    # where the library, with a longer pi, has the digits that are left of the angle
    for n in (*range(-9, 10), 1001, 600_001):
        for off in (0.0, 1e-13, -1e-9, 0.3, math.pi / 4):
            angle = n * math.pi / 2 + off
            cosine, sine = cosine_and_sine(angle)
            assert abs(cosine - math.cos(angle)) <= 2.0 * EPS * max(abs(math.cos(angle)), 0.1)
            assert abs(sine - math.sin(angle)) <= 2.0 * EPS * max(abs(math.sin(angle)), 0.1)


def test_an_undamped_turn_neither_grows_nor_dies():
    angles = np.random.default_rng(3).uniform(-1e5, 1e5, 5000)
    grown = [float(Fraction(c) ** 2 + Fraction(s) ** 2 - 1) for c, s in map(cosine_and_sine, angles)]
    # half a unit of rounding in each of both; a bias would be energy from nothing, and the mean of so many roundings
    # is a seventieth of one
    assert np.max(np.abs(grown)) <= 2.0 * EPS
    assert abs(np.mean(grown)) < 0.05 * EPS
