"""An independent integrator of vibro-impact motion: Runge and Kutta's method of order 8 with located events.

M q'' + C q' + K q = load s(t) + given + contacts, for structure and balls relative to the base. It shares the
equations with femimpact, and none of its closed forms and searches: rigid pairs that close or rest at one instant
get impulses p >= 0 with u+ + e u- >= 0, one of both zero, here by least squares; a Kelvin-Voigt pair pushes with
k p + c p' from its touch until that is zero, and then separates without force until p = 0.

A pair that rests at its wall at the start, or is stopped there by a restitution of 0, is held until the force for that
would pull, or an impact elsewhere moves its wall. Of other sticking phases it knows none, and ends before the first
one: at an impact too slow, or a touch too slight, to be sure of.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from reference_equations import (
    FREE,
    PRESSED,
    RESTING,
    SEPARATING,
    Equations,
    Excitation,
    Real,
    drive_of,
    equations_of,
    inverse_mass,
    rows_of,
)
from scipy.integrate import DOP853
from scipy.optimize import brentq, nnls

import femimpact as fi

TOLERANCE = 1e-13
"""Relative tolerance of a step."""

PROBES = 8
"""Instants in a step at which its events are looked for."""

SLOW = 1e-6
"""An impact slower than this share of the largest speed so far is not gone through."""

TOO_SHORT = 1e-6
"""A step of this share of the longest, as between two events at one instant, shows rounding only."""

GRAZING = 1e-7
"""A wall missed by less than this share of the largest displacement so far is one that rounding may touch."""

AT_WALL = 1e-11
"""Distance from a wall, over the largest displacement so far, that counts as none at an impact."""


class _Ends(Exception):  # noqa: N818 - how a run ends, and no error
    """Why the reference goes no further."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Positions (m) of structure and balls at times (s) up to the end, the touches before it, and why it ended.

    `touches` holds time, pair and approach speed (m/s) of each, `rests` the times from which pairs rest at walls.
    """

    time: Real
    position: Real
    touches: tuple[tuple[float, int, float], ...]
    end: float
    why: str
    rests: tuple[float, ...]


@dataclass(eq=False)
class _Motion:
    """What moves, where it is, and what its pairs do: (state, side) of each."""

    system: fi.System
    history: Callable[[float], float]
    load: Real
    time: float
    z: Real
    states: list[tuple[int, int]]
    fresh: set[tuple[int, int, int]] = field(default_factory=set)
    let_go: tuple[int, int, int] | None = None
    touches: list[tuple[float, int, float]] = field(default_factory=list)
    rests: list[float] = field(default_factory=list)
    known: dict[tuple[tuple[int, int], ...], Equations] = field(default_factory=dict)
    largest: float = 0.0
    fastest: float = 0.0
    step: float = math.inf
    steps: int = 0

    @property
    def size(self) -> int:
        return self.z.size // 2

    def equations(self) -> Equations:
        key = tuple(self.states)
        if key not in self.known:
            self.known[key] = equations_of(self.system, self.load, self.states)
        return self.known[key]


def reference_motion(
    system: fi.System, excitation: Excitation, times: Real, initial: fi.State,
    most_touches: int = 5, most_steps: int = 5000,
) -> Reference:  # fmt: skip
    """Motion at these times (s, rising from 0), up to the touch that is one too many.

    Parameters
    ----------
    system : System
    excitation : Sine, PointForce or RecordedBase
    times : ndarray (n,), s
    initial : State
    most_touches, most_steps : int

    Returns
    -------
    Reference
    """
    u, v, y, y_rate = initial.relative_to_base(system, excitation)
    balls = len(system.balls)
    z = np.concatenate([u, y[:balls], v, y_rate[:balls]])
    history, load, knots = drive_of(system, excitation)
    motion = _Motion(system, history, load, 0.0, z, [(FREE, 0)] * len(system.contacts))
    kept, why = [z[: motion.size].copy()], "all times"
    try:
        _begin(motion)
        for time in times[1:]:
            for until in (*knots[(knots > motion.time) & (knots < time)], time):
                while motion.time < until:
                    _advance(motion, float(until), most_touches)
                    if motion.steps > most_steps:
                        raise _Ends("steps")
            kept.append(motion.z[: motion.size].copy())
    except _Ends as end:
        why = str(end)
    return Reference(times[: len(kept)], np.array(kept), tuple(motion.touches), motion.time, why, tuple(motion.rests))


# ---- steps ----------------------------------------------------------------------------------------


def _solver(motion: _Motion, e: Equations, until: float) -> DOP853:
    def rates(t: float, z: Real) -> Real:
        return e.A @ z + e.constant + e.drive * motion.history(t)

    d, floor = motion.size, max(motion.largest, 1e-12)
    # what is absolute: a thousandth of the relative tolerance of what has been reached so far
    least = np.concatenate([np.full(d, floor), np.full(d, max(motion.fastest, floor))]) * 1e-3 * TOLERANCE
    span = until - motion.time
    longest = min(e.longest_step, span)
    # the step before may have ended at an event
    first = min(max(motion.step, 1e-3 * e.longest_step), longest)
    return DOP853(rates, motion.time, motion.z, until, longest, TOLERANCE, least, first_step=first)


def _note_size(motion: _Motion) -> None:
    d = motion.size
    motion.largest = max(motion.largest, float(np.max(np.abs(motion.z[:d]))))
    motion.fastest = max(motion.fastest, float(np.max(np.abs(motion.z[d:]))))


def _advance(motion: _Motion, until: float, most_touches: int) -> None:
    """Move on to a time, or through the first event before it."""
    e = motion.equations()
    solver = _solver(motion, e, until)
    while solver.status == "running":
        before = motion.time, motion.z
        message = solver.step()
        if solver.status == "failed":
            raise _Ends(f"solver: {message}")
        motion.steps += 1
        motion.step = solver.step_size
        found = _first_event(motion, e, before[0], solver.t, solver.dense_output())
        if found is not None:
            number, time = found
            time, z = _polished(motion, e, number, time)
            _note_leaving(motion, e, time, z)
            motion.time, motion.z = time, z
            _note_size(motion)
            _pass_event(motion, e.meaning[number], most_touches)
            return
        _note_leaving(motion, e, float(solver.t), solver.y)
        motion.time, motion.z = float(solver.t), solver.y.copy()
        _note_size(motion)


def _note_leaving(motion: _Motion, e: Equations, time: float, z: Real) -> None:
    """Forget which event functions were at zero just now, where they have left it by this time (s)."""
    if time - motion.time >= TOO_SHORT * e.longest_step:
        values = e.rows @ z + e.offset + e.pull * motion.history(time)
        motion.fresh -= {meaning for meaning, value in zip(e.meaning, values, strict=True) if value < 0.0}


def _first_event(
    motion: _Motion, e: Equations, start: float, end: float, dense: Callable[[Real], Real]
) -> tuple[int, float] | None:
    """Number and time (s) of the first event in a step."""
    if not e.meaning:
        return None
    span = end - start
    times = start + span * np.arange(PROBES + 1) / PROBES
    if motion.fresh:
        # what has just met its bound must first be seen to leave it
        times = np.unique(np.concatenate([times, start + span * 0.5 ** np.arange(4, 25)]))
    values = e.rows @ dense(times) + e.offset[:, None] + np.outer(e.pull, [motion.history(float(t)) for t in times])
    first: tuple[int, float] | None = None
    for i, h in enumerate(values):
        time = _rise(motion, e, i, times, h, dense)
        if time is not None and (first is None or time < first[1]):
            first = i, time
    return first


def _rise(motion: _Motion, e: Equations, i: int, times: Real, h: Real, dense: Callable[[Real], Real]) -> float | None:
    """Time (s) at which one event function first rises through zero in a step."""
    begin = 0
    if e.meaning[i] in motion.fresh:
        negative = np.flatnonzero(h[1:] < 0.0)
        if times[-1] - times[0] < TOO_SHORT * e.longest_step:
            return None
        slow = motion.let_go == e.meaning[i]
        if slow:
            # a force that ends lets go without a jump, so that the pair leaves with the third power of the time
            negative = np.flatnonzero(h[1:] < -AT_WALL * motion.largest)
            if not negative.size:
                return None
        if not negative.size:
            raise _Ends("leaves too slowly")
        begin = 1 + int(negative[0])
        h = np.where(slow & (np.arange(h.size) < begin), 0.0, h)
        if np.any(h[1:begin] > 0.0) and np.max(h[1:begin]) > 1e-9 * abs(h[begin]):
            raise _Ends("does not leave at once")

    def value(t: float) -> float:
        return float(e.rows[i] @ dense(t) + e.offset[i] + e.pull[i] * motion.history(t))

    for k in range(begin, len(times)):
        if h[k] >= 0.0:
            low, high = float(times[max(k - 1, begin)]), float(times[k])
            if low == high or value(low) >= 0.0:
                return low
            # one time by itself rounds otherwise than in a row of them
            return high if value(high) < 0.0 else float(brentq(value, low, high, xtol=1e-300, rtol=1e-15))
        crest = begin < k < len(times) - 1 and h[k] > h[k - 1] and h[k] >= h[k + 1]
        if crest:
            top = h[k] + 0.125 * (h[k + 1] - h[k - 1]) ** 2 / max(2.0 * h[k] - h[k - 1] - h[k + 1], 1e-300)
            size = motion.largest * float(np.max(np.abs(e.rows[i])))
            if top > -GRAZING * size:
                raise _Ends("grazing")
    return None


def _polished(motion: _Motion, e: Equations, number: int, time: float) -> tuple[float, Real]:
    """Time and state of an event by steps that end there: a dense output has one order less."""
    z = motion.z
    for _ in range(3):
        if time <= motion.time:
            return motion.time, motion.z
        solver = _solver(motion, e, time)
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise _Ends(f"solver: {message}")
        z = solver.y.copy()
        rate = e.rows[number] @ (e.A @ z + e.constant + e.drive * motion.history(time))
        # a slope that is somewhat off takes a step more
        beside = 1e-6 * e.longest_step
        rate += e.pull[number] * (motion.history(time + beside) - motion.history(time - beside)) / (2.0 * beside)
        change = -(e.rows[number] @ z + e.offset[number] + e.pull[number] * motion.history(time)) / rate
        if abs(change) <= 4e-16 * time:
            break
        time += float(change)
    return time, z


# ---- events ---------------------------------------------------------------------------------------


def _begin(motion: _Motion) -> None:
    """Contact states at t = 0 of pairs that start at a wall."""
    _note_size(motion)
    rows, d, e = rows_of(motion.system), motion.size, motion.equations()
    acceleration = (e.A @ motion.z + e.constant + e.drive * motion.history(0.0))[d:]
    for j, pair in enumerate(motion.system.contacts):
        for side, gap in zip((1, -1), pair.gaps, strict=True):
            if side * float(rows[j] @ motion.z[:d]) < gap - 1e-12:
                continue
            rate, press = side * float(rows[j] @ motion.z[d:]), side * float(rows[j] @ acceleration)
            if abs(rate) <= 1e-9 * motion.fastest and abs(press) <= 1e-6 * float(np.max(np.abs(acceleration))):
                raise _Ends("at a wall, at rest")
            approaches = rate > 0.0 or (rate == 0.0 and press > 0.0)
            if isinstance(pair.law, fi.Rigid) and approaches:
                if rate != 0.0 or any(state == RESTING for state, _ in motion.states):
                    raise _Ends("on a wall")
                motion.states[j] = (RESTING, side)
                motion.rests.append(motion.time)
                continue
            if approaches:
                motion.states[j] = (PRESSED, side)
                motion.touches.append((0.0, j, rate))
                motion.fresh.add((j, side, SEPARATING))
            else:
                motion.fresh.add((j, side, PRESSED))


def _pass_event(motion: _Motion, meaning: tuple[int, int, int], most_touches: int) -> None:
    j, side, after = meaning
    state = motion.states[j][0]
    if state != FREE:
        motion.let_go = (j, side, PRESSED) if state == RESTING else None
        motion.states[j] = (after, side if after != FREE else 0)
        # the same function, or its negative, is at zero now
        follows = {SEPARATING: [(j, side, PRESSED)], PRESSED: [(j, side, SEPARATING)], FREE: [(j, side, PRESSED)]}
        motion.fresh = {m for m in motion.fresh if m[0] != j} | set(follows[after])
        return
    approach = side * float(rows_of(motion.system)[j] @ motion.z[motion.size :])
    if approach < SLOW * motion.fastest:
        raise _Ends("slow")
    if len(motion.touches) >= most_touches:
        raise _Ends("touches")
    if isinstance(motion.system.contacts[j].law, fi.Rigid):
        _collide(motion)
        return
    motion.touches.append((motion.time, j, approach))
    motion.states[j] = (PRESSED, side)
    motion.fresh = {m for m in motion.fresh if m[0] != j} | {(j, side, SEPARATING)}


def _collide(motion: _Motion) -> None:
    """Impulses of all rigid pairs that close or rest at their walls, together, until none approaches."""
    system, d = motion.system, motion.size
    rows, inverse = rows_of(system), inverse_mass(system)
    walls = []
    for j, pair in enumerate(system.contacts):
        x = float(rows[j] @ motion.z[:d])
        for side, gap in zip((1, -1), pair.gaps, strict=True):
            if isinstance(pair.law, fi.Rigid) and abs(side * x - gap) <= AT_WALL * motion.largest:
                walls.append((j, side, pair.law.restitution))
    approach = np.array([side * float(rows[j] @ motion.z[d:]) for j, side, _ in walls])
    rests = [motion.states[j][0] == RESTING for j, _, _ in walls]
    approach[rests] = 0.0
    hit: set[int] = set()
    for _ in range(1000):
        slow = 1e-12 * motion.fastest
        taking = [k for k, speed in enumerate(approach) if speed > -slow]
        if not taking or np.max(approach) <= slow:
            break
        push = np.array([walls[k][1] * rows[walls[k][0]] for k in taking])
        closing = np.maximum(approach[taking], 0.0)
        wanted = np.array([1.0 + walls[k][2] for k in taking]) * closing
        # p >= 0, A p >= wanted, one of both equal: with A = L L^T the least |L^T p - L^-1 wanted| of p >= 0
        lower = np.linalg.cholesky(push @ inverse @ push.T)
        impulse, _ = nnls(lower.T, np.linalg.solve(lower, wanted))
        motion.z[d:] -= inverse @ push.T @ impulse
        for k, speed, pushed in zip(taking, closing, impulse, strict=True):
            if pushed > 0.0 and not rests[k]:
                motion.touches.append((motion.time, walls[k][0], float(speed)))
                hit.add(walls[k][0])
        approach = np.array([side * float(rows[j] @ motion.z[d:]) for j, side, _ in walls])
    resting = {j for (j, _, _), rest, speed in zip(walls, rests, approach, strict=True) if rest and speed > -slow}
    stopped = [(j, side) for j, side, e in walls if j in hit and e == 0.0]
    left = [(j, side) for j, side, _ in walls if (j, side) not in stopped and j not in resting]
    if any(side * float(rows[j] @ motion.z[d:]) > -SLOW * motion.fastest for j, side in left) or len(stopped) > 1:
        raise _Ends("sticks")
    motion.fresh = {m for m in motion.fresh if m[0] not in hit} | {(j, side, PRESSED) for j, side, _ in walls}
    for j, (state, side) in enumerate(motion.states):
        if j in resting:
            continue
        if state == RESTING:
            # it was at its wall among the others, and has left it
            motion.states[j] = (FREE, 0)
        elif state != FREE:
            # a jump of p' may end a push, or begin one again
            pair = system.contacts[j]
            depth = side * float(rows[j] @ motion.z[:d]) - pair.gaps[0 if side > 0 else 1]
            rate = side * float(rows[j] @ motion.z[d:])
            push = pair.parameters.stiffness * depth + pair.parameters.damping * rate
            motion.states[j] = (PRESSED if push > 0.0 else SEPARATING, side)
            motion.fresh = {m for m in motion.fresh if m[0] != j}
    for j, side in stopped:
        # without a rebound, and pressed by what follows
        e = motion.equations()
        rate = e.A @ motion.z + e.constant + e.drive * motion.history(motion.time)
        if side * float(rows[j] @ rate[d:]) <= 0.0:
            raise _Ends("sticks")
        motion.states[j] = (RESTING, side)
        motion.rests.append(motion.time)
