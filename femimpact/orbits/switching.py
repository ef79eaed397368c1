"""The orbits that meet a branch at one of its bifurcations, a small step beyond it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError, checked, instance, require, takes, warns
from femimpact.integrators.event_driven.loop_data import CONTACT, FREE, SEPARATING
from femimpact.orbits.branch import Bifurcation, known
from femimpact.orbits.curve import SAME, Curve, Point, corrected, curve_of, evaluated, null_vectors
from femimpact.orbits.equations import SECTION, EventStates
from femimpact.orbits.following import AT_WALL, without_speed
from femimpact.orbits.motion import IMPACT, PRESS_AGAIN, RELEASE, SEPARATE, TOUCH, HybridSystem
from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.orbits.search import orbit_near, untouched_ball, without_events

STEPS = (1e-2, 3e-3, 1e-3, 2e-2)
"""Steps beyond a bifurcation, in the unit of the curve; the first is taken at which the orbits are found."""

FARTHEST = 0.02
"""Distance from the guess, in the same unit, beyond which an orbit is another one."""

REFUSED = {
    "fold": "has no other orbits to switch to: both sheets are in the branch",
    "neimark-sacker": "has no periodic orbits to switch to: quasi-periodic motions are born there",
    "sticking": "has no orbits to switch to that are looked for: those beyond it stick to a wall",
}
"""Why there is no other branch at some kinds of bifurcations."""


@warns
@takes(bifurcation=instance(Bifurcation))
def switch_branch(bifurcation: Bifurcation) -> tuple[PeriodicOrbit, ...]:
    """The orbits of the other branch that a bifurcation belongs to, a small step beyond it.

    The step is along the second null vector of the equations with the parameter among the unknowns, to which the
    branch is orthogonal. At grazing it is along the tangent of the curve of orbits with the impact added or taken away,
    which starts at speed zero: its equations are regular there. (Kuznetsov, 2004.)

    Parameters
    ----------
    bifurcation : Bifurcation
        Of a branch that was followed, of the kind "symmetry-breaking", "branch-point", "period-doubling" or "grazing".

    Returns
    -------
    tuple of PeriodicOrbit
        At symmetry breaking and branch points both orbits; at a doubling the one of twice the period; at grazing the
        one with the impact added or taken away. Each is verified, and the parameter is that of its `system` and
        `excitation`: its side of the bifurcation is the one on which the orbit is a motion of the system.

    Raises
    ------
    InputError
        If no other periodic orbits meet there, as at folds, Neimark-Sacker points and sticking, or where a ball that
        loses its impacts touches nothing; and where a contact is released once more.
    DivergenceError
        If none are found.
    """
    kind = bifurcation.kind
    require(kind not in REFUSED, "bifurcation", kind, "", REFUSED.get(kind, ""))
    there = known(bifurcation.point, "bifurcation")
    # a branch that has ended on that of half its period is of twice that
    joins = there.curve.half_sign > 0.0 and float(np.abs(there.half_difference).max()) < SAME
    point = _whole(there, 2 if kind == "period-doubling" and not joins else 1)
    tries = _grazed(point) if kind == "grazing" else _crossed(point, kind)
    found = next((orbits for orbits in tries if orbits), ())
    if not found:
        raise DivergenceError(
            f"no orbits found beyond the {kind} at {point.curve.parameter.path} = {bifurcation.value:.10g}"
        )
    return found


def _whole(point: Point, times: int) -> Point:
    """A point as one of the equations of all events, of so many periods of its orbit."""
    old, here, ahead = point.curve, point.events, point.curve.events_at(point.x + point.tangent)
    states, phases = here.states, here.phases
    later = np.repeat(np.arange(times) * point.cycle, phases.size)
    sequence = old.sequence.rows(np.tile(np.arange(phases.size), times))
    sequence = replace(sequence, section=sequence.section + later, cycles=old.sequence.cycles * times)
    curve = replace(old, sequence=sequence, is_symmetric=False)
    x = curve.unknowns(np.tile(states, (times, 1)), np.tile(phases, times) + later, point.value)
    moved, turned = np.tile(ahead.states - states, (times, 1)), np.tile(ahead.phases - phases, times)
    tangent = curve.unknowns(moved, turned, float(point.tangent[-1]))
    return evaluated(curve, x, tangent)


# ---- branches that cross ----------------------------------------------------------------------------


def _crossed(point: Point, kind: str) -> Iterator[tuple[PeriodicOrbit, ...]]:
    """The orbits to both sides of a branch, of a doubling to one of them, for each of the steps that are tried."""
    vectors, both = null_vectors(point), kind != "period-doubling"
    # where a symmetry is lost, one period after the other among them, the parameter is at a turn
    along = vectors @ point.row if kind == "branch-point" else vectors[:, -1]
    across = (along[0] * vectors[1] - along[1] * vectors[0]) / math.hypot(*along)
    for step in STEPS:
        found = [_beside(point.curve, point.x, way * step * across) for way in ((1.0, -1.0) if both else (1.0,))]
        yield tuple(orbit for orbit in found if orbit is not None) if None not in found else ()


def _beside(curve: Curve, x: Array, step: Array) -> PeriodicOrbit | None:
    """The verified orbit on the plane across a step, if there is one near."""
    return _verified(curve, x + step, curve.weight * step)


def _verified(curve: Curve, guess: Array, row: Array) -> PeriodicOrbit | None:
    """The verified orbit next to a guess, on the plane through it across a row, if there is one near."""
    found, _ = corrected(curve, guess, row)
    if found is None or curve.weight @ (found.x - guess) ** 2 > FARTHEST**2:
        return None
    try:
        checked("value", found.value, curve.parameter.allowed)
        return orbit_near(*curve.parameter.at(found.value), found.events)
    except (InputError, DivergenceError):
        return None


# ---- grazing ----------------------------------------------------------------------------------------


def _grazed(point: Point) -> Iterator[tuple[PeriodicOrbit, ...]]:
    """The orbit with other events on the side on which it is a motion, for each of the steps that are tried."""
    old = point.curve
    # a press again at the wall is another event beyond it
    away = np.flatnonzero(np.abs(point.limits[2]) < AT_WALL).tolist()
    still = [k for k in without_speed(point, AT_WALL) if k not in away]
    reached = [] if still else list(_reached(point))
    for step in STEPS if still or reached else ():
        guess = _without(point, still) if still else _with(point, reached, step)
        ball = untouched_ball(old.parameter.at(point.value)[0], guess.sequence.pair, guess.sequence.contact_state[-1])
        require(ball is None, "bifurcation", "grazing", "", f"must leave {ball} a contact: else it may be anywhere")
        curve = curve_of(old.parameter, guess.sequence, False, float(old.unit[0]), old.width)
        x = curve.unknowns(guess.states, guess.phases, point.value)
        ends = [reached[0].phase - step, reached[0].phase + step] if reached else []
        k = np.flatnonzero(np.isin(guess.phases, ends))
        if k.size:
            # without a duration these events are one, and the equations singular: the duration is given
            row = np.zeros(x.size)
            row[:-1].reshape(curve.count, -1)[k[[0, -1]], -1] = -1.0, 1.0
            found = [_verified(curve, x, row)]
        else:
            along = null_vectors(evaluated(curve, x, np.zeros(x.size)))[-1]
            found = [_beside(curve, x, way * step * along) for way in (1.0, -1.0)]
        yield tuple(orbit for orbit in found if orbit is not None)


def _without(point: Point, still: list[int]) -> EventStates:
    """Events and states of an orbit without those that have no speed, contacts to their end."""
    states, phases, sequence = point.events.states, point.events.phases, point.curve.sequence
    hybrid = point.maps.hybrid
    kinds, count, gone = list(sequence.kind), len(sequence.kind), set(still)
    for k in still:
        last, after = k, (k + 1) % count
        while sequence.kind[k] == TOUCH and sequence.kind[last] != SEPARATE:
            last = (last + 1) % count
            if sequence.pair[last] == sequence.pair[k]:
                gone.add(last)
        if sequence.kind[k] in (RELEASE, PRESS_AGAIN):
            gone.add(after)
        if sequence.kind[k] == SEPARATE:
            # a contact that no longer ends before it begins again, which one without damping has not left to press
            kinds[after] = PRESS_AGAIN
            if not hybrid.contact_damping[sequence.pair[k]]:
                gone |= {k - 1 if k else count - 1, after}
    left = np.array([k for k in range(count) if k not in gone], dtype=np.int64)
    if left.size:
        return EventStates(replace(sequence, kind=tuple(kinds)).rows(left), states[left], phases[left])
    free = np.zeros(len(hybrid.gaps))
    guess = without_events(states[0], free.astype(np.int8), float(phases[0]), sequence.cycles)
    later, _ = hybrid.flow(free).carried(states[:1], guess.phases[:1], guess.phases[1:])
    return replace(guess, states=np.concatenate([states[:1], later]))


@dataclass(frozen=True)
class _Reached:
    """The condition of an event that is just met."""

    k: int  # event before it, or a press again at which the contact just separates
    kind: str
    pair: int
    side: float
    phase: float  # rad

    def met(self, hybrid: HybridSystem, step: float) -> list[tuple[float, str, int]]:
        """Events that are added: phases so many rad before and after it, kinds, and the pair's contact states."""
        before, after = self.phase - step, self.phase + step
        stiffness, damping = hybrid.contact_stiffness[self.pair], hybrid.contact_damping[self.pair] * hybrid.omega
        if self.kind == IMPACT:
            return [(self.phase, IMPACT, FREE)]
        if self.kind == RELEASE and damping:
            return [(before, RELEASE, SEPARATING), (after, PRESS_AGAIN, CONTACT)]
        if self.kind == PRESS_AGAIN:
            return [(before, PRESS_AGAIN, CONTACT), (after, RELEASE, SEPARATING)]
        if self.kind == TOUCH:
            # a parabola of depth: stiffness (step^2 - t^2)/2 = damping t
            release = self.phase + float(math.hypot(damping, stiffness * step) - damping) / stiffness
            return [(before, TOUCH, CONTACT), (release, RELEASE, SEPARATING), (after, SEPARATE, FREE)]
        apart = [(before, SEPARATE, FREE), (after, TOUCH, CONTACT)]
        return apart if damping else [(before, RELEASE, SEPARATING), *apart]


def _reached(point: Point) -> Iterator[_Reached]:
    """The conditions of events that are just met, between the events of an orbit or at one of them."""
    sequence, phases = point.curve.sequence, point.events.phases
    pairs = point.curve.parameter.at(point.value)[0].contacts
    for k, j in np.ndindex(sequence.contact_state.shape):
        state = float(sequence.contact_state[k, j])
        first = IMPACT if pairs[j].parameters.is_rigid else TOUCH
        kind = {FREE: first, CONTACT: RELEASE, SEPARATING: PRESS_AGAIN}[abs(int(state))]
        for side in (math.copysign(1.0, state),) if state else (1.0, -1.0) if pairs[j].has_walls else ():
            for at, height in point.solution.motion.crests((kind, j, side), k):
                if abs(height) < AT_WALL * point.curve.by_rows[-1]:
                    yield _Reached(k, kind, j, side, at)
        if sequence.kind[k] == PRESS_AGAIN and sequence.pair[k] == j:
            side = float(sequence.side[k])
            depth = point.solution.motion.condition(k, (TOUCH, j, side), phases[[k]])[0, 0]
            if abs(depth) < AT_WALL * point.curve.unit[0]:
                yield _Reached(k, SEPARATE, j, side, float(phases[k]))


def _with(point: Point, reached: list[_Reached], step: float) -> EventStates:
    """Events and states of an orbit with events without speed where their conditions are just met.

    Those of a Kelvin-Voigt contact are from so many rad before that to as many after it.
    """
    states, phases, sequence = point.events.states, point.events.phases, point.curve.sequence
    hybrid = point.maps.hybrid
    gone = {one.k for one in reached if one.kind == SEPARATE}
    # phase, event before, or itself, kind, pair, side, and the pair's contact state after it
    met: list[tuple[float, int, str, int, float, float]] = [
        (float(phases[k]), k, sequence.kind[k], j, float(sequence.side[k]), float(sequence.contact_state[k, j]))
        for k, j in enumerate(sequence.pair.tolist())
        if sequence.kind[k] != SECTION and k not in gone
    ]
    for one in reached:
        for at, name, state in one.met(hybrid, step):
            met.append((at, one.k, name, one.pair, one.side, state * one.side))
    met.sort(key=lambda event: event[0])
    found, before, kind, pair, side_of, after = zip(*met, strict=True)
    rows, at_phase, states_there = sequence.rows(np.array(before)), np.array(found), states[list(before)]
    for i, k in enumerate(before):
        flow = hybrid.flow(sequence.contact_state[k])
        states_there[i] = flow.carried(states[[k]], phases[[k]], at_phase[[i]])[0][0]
        rows.contact_state[i, pair[i]] = after[i]
    return EventStates(replace(rows, kind=kind, pair=np.array(pair), side=np.array(side_of)), states_there, at_phase)
