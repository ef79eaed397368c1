"""Exponentials of many complex numbers at once, by arithmetic alone: the loop over them takes several at a time.

Calls of the C library, one by one, took two fifths of a run. What is computed here is within two units in the last
place, and the same on every processor.

Angles are reduced by multiples of pi/2 in three parts (Cody and Waite, 1980); the polynomials of sine and cosine are
those of k_sin.c and k_cos.c in Sun Microsystems' fdlibm. That of e^x, reduced by multiples of ln 2, is Taylor's.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import called, inlined

__all__ = ["cosine_and_sine", "exponentials"]

LARGEST_ANGLE = 1e6
"""rad up to which multiples of the first part of pi/2 are exact; beyond it the C library takes over."""

LARGEST_DECAY = 700.0
"""Negative exponent up to which e^x is no denormal number."""

ROUND = 6755399441055744.0
"""3 . 2^51: added and taken off again it rounds to the nearest whole number."""

TWO_OVER_PI = 0.6366197723675814
PI_1, PI_2, PI_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
"""pi/2 in parts, the first two of 33 bits."""

ONE_OVER_LN_2 = 1.4426950408889634
LN_1, LN_2 = 0.6931471803691238, 1.9082149292705877e-10
"""ln 2 in parts, the first of 33 bits."""


@inlined
def _cosine_and_sine(angle: float) -> tuple[float, float]:
    n = (angle * TWO_OVER_PI + ROUND) - ROUND
    r = ((angle - n * PI_1) - n * PI_2) - n * PI_3
    z = r * r
    z2 = z * z
    s = -1.66666666666666324348e-01 + z * 8.33333333332248946124e-03
    s += z2 * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
    s += z2 * z2 * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    c = 4.16666666666666019037e-02 + z * -1.38888888888741095749e-03
    c += z2 * (2.48015872894767294178e-05 + z * -2.75573143513906633035e-07)
    c += z2 * z2 * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    s, c = r + r * z * s, 1.0 - (0.5 * z - z2 * c)
    # quarter turns, from -2 to 2
    q = n - 4.0 * ((n * 0.25 + ROUND) - ROUND)
    turned = q * q == 1.0
    sine, cosine = c if turned else s, s if turned else c
    return (cosine if q == 0.0 or q == -1.0 else -cosine), (sine if q == 0.0 or q == 1.0 else -sine)


@inlined
def cosine_and_sine(angle: float) -> tuple[float, float]:
    """Both of an angle (rad)."""
    if abs(angle) < LARGEST_ANGLE:
        return _cosine_and_sine(angle)
    return math.cos(angle), math.sin(angle)


@inlined
def _exponential(x: float) -> float:
    moved = x * ONE_OVER_LN_2 + ROUND
    n = moved - ROUND
    r = (x - n * LN_1) - n * LN_2
    r2 = r * r
    r4 = r2 * r2
    p = (1 / 6 + r * (1 / 24)) + r2 * (1 / 120 + r * (1 / 720))
    p += r4 * ((1 / 5040 + r * (1 / 40320)) + r2 * (1 / 362880 + r * (1 / 3628800)))
    p += r4 * r4 * ((1 / 39916800 + r * (1 / 479001600)) + r2 * (1 / 6227020800))
    # n stands in the last places of what was rounded: shifted to where a number's power of two stands
    bits = np.float64(moved).view(np.int64)
    power = np.int64((bits << 52) + (1023 << 52)).view(np.float64)
    return float((1.0 + (r + r2 * (0.5 + r * p))) * power)


@called
def exponentials(exponent: NDArray[np.complex128], time: float, out: NDArray[np.complex128]) -> None:
    """e^{lambda t} of several lambda with Re lambda <= 0."""
    beyond = 0
    for k in range(exponent.size):
        x, angle = exponent[k].real * time, exponent[k].imag * time
        cosine, sine = _cosine_and_sine(angle)
        size = _exponential(x)
        out[k] = complex(size * cosine, size * sine)
        beyond += 1 if abs(angle) > LARGEST_ANGLE or x < -LARGEST_DECAY else 0
    if beyond > 0:
        for k in range(exponent.size):
            x, angle = exponent[k].real * time, exponent[k].imag * time
            if abs(angle) > LARGEST_ANGLE or x < -LARGEST_DECAY:
                size = math.exp(x)
                out[k] = complex(size * math.cos(angle), size * math.sin(angle))
