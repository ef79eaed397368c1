"""Scalars read from a motion in closed form: rows over its entries, its rigid-body coordinates and the drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.excitation.piecewise_polynomial import ORDERS
from femimpact.integrators.event_driven.alike import part_of
from femimpact.integrators.event_driven.complex_modes import ComplexModes
from femimpact.integrators.event_driven.equations import Equations

__all__ = ["OF_DISPLACEMENT", "OF_VELOCITY", "Rows", "driven_entries", "followed", "gap_rows", "rate_of", "scaled_sum"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

OF_DISPLACEMENT, OF_VELOCITY = (2, 0), (1, 1)
"""Where ub and ub' stand in `Rows.through` and in `Rows.follow`."""

SLOW = 1.0
"""|lambda| over the rate of the polynomials up to which an entry has its whole response to them."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Scalars read from a motion: R of them, of F systems.

    Parameters
    ----------
    weight : ndarray (F, R, K), complex
        Of the entries H.
    rigid_body, rigid_body_rate : ndarray (F, R, P)
        Of the rigid-body coordinates and their rates.
    constant : ndarray (F, R, 1 + pairs)
        Of constant loads, and per metre of each wall.
    through : ndarray (F, 3, R)
        Directly of s, ub' and ub, beside the response of the entries to them.
    follow : ndarray (F, 8, R)
        Steady, per unit of ub, ub', s and the derivatives of s to the fifth, under a polynomial s(t).
    """

    weight: Complex
    rigid_body: Array
    rigid_body_rate: Array
    constant: Array
    through: Array
    follow: Array


def rate_of(rows: Rows, modes: ComplexModes) -> Rows:
    """Rates of scalars that have no direct part of s or ub'."""
    zero = np.zeros((*rows.through.shape[:1], 1, rows.through.shape[2]))
    return Rows(
        weight=rows.weight @ modes.rate,
        rigid_body=rows.rigid_body_rate,
        rigid_body_rate=rows.rigid_body,
        constant=0.0 * rows.constant,
        through=np.concatenate([zero, rows.through[:, 2:], zero], axis=1),
        follow=np.concatenate([zero, rows.follow[:, :-1]], axis=1),
    )


def scaled_sum(rows: Rows, factor: Array, also: Rows, by: Array) -> Rows:
    """Sum of two sets of rows, each row with a factor (F, R) of its set."""
    first, second = factor[:, :, None], by[:, :, None]
    return Rows(
        weight=first * rows.weight + second * also.weight,
        rigid_body=first * rows.rigid_body + second * also.rigid_body,
        rigid_body_rate=first * rows.rigid_body_rate + second * also.rigid_body_rate,
        constant=first * rows.constant + second * also.constant,
        through=factor[:, None, :] * rows.through + by[:, None, :] * also.through,
        follow=factor[:, None, :] * rows.follow + by[:, None, :] * also.follow,
    )


def gap_rows(whole: Equations, rows: Rows, base: tuple[int, int]) -> Rows:
    """Rows of x_j = -P_j p - in_space_j ub, or of x_j'.

    Parameters
    ----------
    whole : Equations
    rows : Rows
        Of all coordinates, or their rates.
    base : tuple of int
        Which of the inputs in `through` and in `follow` is the base's motion: ub, or ub'.
    """
    P = -whole.force.mT
    through, follow = rows.through @ P.mT, rows.follow @ P.mT
    through[:, base[0]] -= whole.in_space
    follow[:, base[1]] -= whole.in_space
    return Rows(P @ rows.weight, P @ rows.rigid_body, P @ rows.rigid_body_rate, P @ rows.constant, through, follow)


def driven_entries(modes: ComplexModes, rate: float | None) -> NDArray[np.int64]:
    """Number (F,) of the entries, the slowest ones, that are advanced with their whole response to polynomials.

    The response of a fast entry is a polynomial itself, beside the exponential: a sum of derivatives of s over powers
    of lambda, which for a slow one are large and cancel the exponential.

    Parameters
    ----------
    modes : ComplexModes
    rate : float or None, 1/s
        Of the polynomials; none of a sine or of straight lines is driven.
    """
    size = modes.size
    if not rate:
        return np.zeros(size.shape[0], dtype=np.int64)
    fast = np.concatenate([size > SLOW * rate, np.ones((size.shape[0], 1), dtype=bool)], axis=1)
    count: NDArray[np.int64] = fast.argmax(axis=1)
    for first, length in modes.blocks:
        count = np.where((first < count) & (count < first + length), first, count)
    return count


def followed(rows: Rows, modes: ComplexModes, load: Complex, driven: NDArray[np.int64]) -> Array:
    """Steady response (F, 8, R) of scalars under a polynomial, as in `Rows.follow`, without that of driven entries."""
    if not np.any(driven):
        return rows.follow
    rates = modes.rate
    return np.stack([
        rows.follow[f] if count == 0 else _followed(part_of(rows, f), rates[f], load[f], count)
        for f, count in enumerate(driven.tolist())
    ])  # fmt: skip


def _followed(rows: Rows, rate: Complex, load: Complex, driven: int) -> Array:
    """That of one system, (8, R)."""
    fast = slice(driven, None)
    response = np.zeros((ORDERS, load.shape[1]), dtype=complex)
    before = np.zeros(load.shape[1] - driven, dtype=complex)
    for order in range(ORDERS):
        # G' = Lambda G + load (s, ub', ub) with G a sum over ub and its derivatives
        own = load[2 - order, fast] if order < 3 else 0.0
        before = scipy.linalg.solve_triangular(rate[fast, fast], before - own) if before.size else before
        response[order, fast] = before
    # each row by itself: the rounding of a matrix product depends on its shape, and events not on what else is read
    follow = np.sum(response[:, None, :] * rows.weight, axis=2).real
    follow[:3] += rows.through[::-1]
    return np.asarray(follow)
