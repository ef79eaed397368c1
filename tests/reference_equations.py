"""The equations of a vibro-impact system in one tuple of contact states, as matrices for a Runge-Kutta method."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

import femimpact as fi

Real = NDArray[np.float64]
Excitation = fi.Sine | fi.PointForce | fi.RecordedBase

STEPS_PER_PERIOD = 4
"""Steps in the fastest period of a tuple of contact states."""

FREE, PRESSED, SEPARATING, RESTING = range(4)
"""Contact states; a rigid pair is free, or rests at its wall."""


@dataclass(frozen=True, eq=False)
class Equations:
    """z' = A z + constant + drive s(t) of one tuple of contact states, z = (q, q'), and its event functions.

    An event is a rise of `rows` z + `offset` + `pull` s(t) through zero; `meaning` has pair, side and the state that
    follows.
    """

    A: Real
    constant: Real
    drive: Real
    rows: Real
    offset: Real
    pull: Real
    meaning: tuple[tuple[int, int, int], ...]
    longest_step: float


def drive_of(system: fi.System, excitation: Excitation) -> tuple[Callable[[float], float], Real, Real]:
    """s(t), the load (d,) that it scales, and the times (s) at which it bends."""
    ball_mass = np.array([pair.mass for pair in system.balls])
    inertia = -np.concatenate([system.base_load, ball_mass])
    if isinstance(excitation, fi.RecordedBase):
        knots = excitation.interval * np.arange(excitation.samples.size)
        samples = excitation.samples

        def broken_line(t: float) -> float:
            # the last piece ends with a jump to zero: a step never straddles a knot, and belongs to its start
            return float(np.interp(t, knots, samples)) if t < knots[-1] else 0.0

        return broken_line, inertia, knots
    sine = excitation.history if isinstance(excitation, fi.PointForce) else excitation
    omega, force = 2.0 * math.pi * sine.frequency, isinstance(excitation, fi.PointForce)
    scale = sine.amplitude if force else -sine.amplitude * omega**2
    load = np.concatenate([system.point_row(excitation.at), 0.0 * ball_mass]) if force else inertia
    return lambda t: scale * math.sin(omega * t + sine.phase), load, np.zeros(0)


def rows_of(system: fi.System) -> Real:
    """Rows (pairs, d) that read x = y - w of every pair; y = 0 of a stop."""
    balls = len(system.balls)
    rows = np.zeros((len(system.contacts), system.dofs + balls))
    for j, pair in enumerate(system.contacts):
        rows[j, : system.dofs] = -pair.direction
        if j < balls:
            rows[j, system.dofs + j] = 1.0
    return rows


def inverse_mass(system: fi.System) -> Real:
    balls = np.diag([1.0 / pair.mass for pair in system.balls]) if system.balls else np.zeros((0, 0))
    return np.asarray(scipy.linalg.block_diag(np.linalg.inv(system.M.toarray()), balls))


def equations_of(system: fi.System, load: Real, states: list[tuple[int, int]]) -> Equations:
    rows, inverse = rows_of(system), inverse_mass(system)
    n, d = system.dofs, rows.shape[1]
    C, K, given = np.zeros((d, d)), np.zeros((d, d)), np.zeros(d)
    C[:n, :n], K[:n, :n] = system.C.toarray(), system.K.toarray()
    events, offset, meaning = [], [], []
    for j, (pair, (state, side)) in enumerate(zip(system.contacts, states, strict=True)):
        K += pair.free_stiffness * np.outer(rows[j], rows[j])
        if not pair.is_stop:
            given[n + j] = pair.mass * pair.acceleration
        k, c = pair.parameters.stiffness, pair.parameters.damping
        gap = pair.gaps[0 if side > 0 else 1]
        depth, none = side * rows[j], np.zeros(d)
        if state == PRESSED:
            K += k * np.outer(rows[j], rows[j])
            C += c * np.outer(rows[j], rows[j])
            given += side * k * gap * rows[j]
            events.append(np.concatenate([-k * depth, -c * depth]))
            offset.append(k * gap)
            meaning.append((j, side, SEPARATING))
        elif state == SEPARATING:
            events.extend([np.concatenate([-depth, none]), np.concatenate([k * depth, c * depth])])
            offset.extend([gap, -k * gap])
            meaning.extend([(j, side, FREE), (j, side, PRESSED)])
        elif state == FREE:
            for own, wall in zip((1, -1), pair.gaps, strict=True):
                if math.isfinite(wall):
                    events.append(np.concatenate([own * rows[j], none]))
                    offset.append(-wall)
                    meaning.append((j, own, PRESSED))
    A = np.block([[np.zeros((d, d)), np.eye(d)], [-inverse @ K, -inverse @ C]])
    still, rate = np.zeros(d), np.hstack([-inverse @ K, -inverse @ C])
    constant, drive, pull = inverse @ given, inverse @ load, [0.0] * len(events)
    for j, (_, side) in ((j, own) for j, own in enumerate(states) if own[0] == RESTING):
        # the force that leaves the pair no acceleration; the event is its end
        push = -side / float(rows[j] @ inverse @ rows[j])
        events.append(push * rows[j] @ rate)
        offset.append(push * float(rows[j] @ constant))
        pull.append(push * float(rows[j] @ drive))
        meaning.append((j, side, FREE))
        held = np.eye(d) - np.outer(inverse @ rows[j], rows[j]) / float(rows[j] @ inverse @ rows[j])
        rate, constant, drive = held @ rate, held @ constant, held @ drive
    A[d:] = rate
    speed = float(np.max(np.abs(np.linalg.eigvals(A))))
    longest = 2.0 * math.pi / (STEPS_PER_PERIOD * speed) if speed > 0.0 else math.inf
    return Equations(
        A, np.concatenate([still, constant]), np.concatenate([still, drive]),
        np.array(events).reshape(-1, 2 * d), np.array(offset), np.array(pull), tuple(meaning), longest,
    )  # fmt: skip
