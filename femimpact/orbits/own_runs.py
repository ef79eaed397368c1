"""Event-driven runs over one period of many orbits in one compiled call, each with its parameter and start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from femimpact import core
from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.block import Inputs, new_block, no_cycles, run_block
from femimpact.integrators.event_driven.equations import equations_of
from femimpact.integrators.event_driven.loop_data import CONTACT, SEPARATING
from femimpact.integrators.event_driven.store import FormStore, Outputs, Source, outputs_of
from femimpact.orbits.crests import crests, top
from femimpact.orbits.curve import LostError, Point, locate, near_points
from femimpact.orbits.equations import PRESS_AGAIN, RELEASE, SECTION, SEPARATE, TOUCH, state_unit
from femimpact.orbits.limits import where
from femimpact.orbits.search import length_of
from femimpact.orbits.verification import OwnRun, check_events, check_missed, first_other
from femimpact.response.cycles import CycleStatistics, steady_motion
from femimpact.response.impacts import CYCLE_COLUMNS, EventLog, event_log
from femimpact.system.system import System

MOST_CRESTS = 10
"""Crests of a gap between two points of which the first to reach a wall is looked for."""

BEFORE_CREST = 1e-4
"""Share of the way to a crest at the wall that lies between it and the last orbit that is looked at."""

SLOW = 1e-3
"""Speed of an impact, in lengths and rad, below which no run confirms it: rounding decides whether it is met."""

SAMPLES = 512
"""Instants of a period over which the first harmonic is summed; of many cycles those of `EventDriven` in each."""

MORE_EVENTS = 64
"""Events of a run beyond those of its orbit that are kept: of an orbit that is no motion some are met."""


@dataclass(frozen=True, eq=False)
class OwnRuns:
    """What the runs of n orbits leave."""

    each: tuple[OwnRun, ...]  # in the units of the curve, or of a larger motion
    peak: Array  # (n,) m: largest displacement of the default place
    first_harmonic: Array  # (n,) m: its component at the frequency of the excitation


def own_runs(system: System, points: Sequence[Point]) -> OwnRuns:
    """Runs over one period of the orbits of some points of a curve, each from between two events."""
    curve, count = points[0].curve, len(points)
    method = EventDriven(samples_per_cycle=max(SAMPLES // curve.sequence.cycles, EventDriven().samples_per_cycle))
    starts, phase, first = zip(*(point.intervals.start() for point in points), strict=True)
    hybrids, state = [point.maps.hybrid for point in points], np.array(starts)
    # where the parameter is in the matrices, the closed forms of each differ
    systems = [curve.parameter.at(point.value)[0] for point in points] if curve.parameter.of_matrices else [system]
    excitation = curve.parameter.at(curve.parameter.value)[1]
    equations = [equations_of(each, drive_of(each, excitation)) for each in systems]
    d, rigid = hybrids[0].mass.size, np.array([pair.parameters.is_rigid for pair in system.contacts], dtype=bool)
    outputs = _outputs(system, d)
    sources = [Source(of, outputs, each.derived) for each, of in zip(systems, equations, strict=True)]
    store = FormStore(sources, rigid, rate=None)
    inputs = Inputs(
        omega=np.array([hybrid.omega for hybrid in hybrids]),
        amplitude=np.array([[hybrid.drive] for hybrid in hybrids], dtype=complex),
        phase=np.array(phase),
        pieces=(),
        gaps=np.array([hybrid.gaps for hybrid in hybrids]),
        stiffness=np.array([hybrid.contact_stiffness for hybrid in hybrids]),
        damping=np.array([hybrid.contact_damping for hybrid in hybrids]),
        restitution=np.array([hybrid.restitution for hybrid in hybrids]),
        is_sine=True,
        position=state[:, :d],
        velocity=state[:, d:],
        window=np.tile([0.0, np.inf], (count, 1)),
    )
    kept = len(curve.sequence.kind) + MORE_EVENTS
    system_of = np.arange(count) if len(systems) > 1 else None
    block = new_block(systems, store, inputs, method, None, most_events=kept, system_of=system_of)
    samples, cycles = curve.sequence.cycles * method.samples_per_cycle, curve.sequence.cycles
    block.grid = block.grid._replace(cycles=no_cycles(count, cycles), values=np.zeros((count, samples, 1 + 2 * d)))
    begin, end = np.zeros(count, dtype=np.int64), np.full(count, samples)
    run_block(block, begin, end, np.full(count, 10.0 * kept + samples))
    lengths = [length_of(point.maps.hybrid, point.events.states) for point in points]
    own_units = np.array([state_unit(each, hybrid.omega, d) for each, hybrid in zip(lengths, hybrids, strict=True)])
    # a motion may vanish on its curve
    unit = np.maximum(own_units, curve.unit[:-1])
    names = tuple(pair.name for pair in system.contacts)
    missed = np.max(np.abs(block.grid.values[:, -1, 1:] - state) / unit, axis=1)
    logs = tuple(
        event_log(rows, int(found), names) for rows, found in zip(block.tables.events, block.tables.logged, strict=True)
    )
    table = np.moveaxis(block.grid.cycles[:, :, : len(CYCLE_COLUMNS)], (2, 1), (0, 1))
    motion = steady_motion(CycleStatistics(*table), np.full(count, cycles))
    missed = np.where(block.stopped == core.events.DONE, missed, np.inf)
    at_events = [begun + omega * log.time for begun, omega, log in zip(phase, inputs.omega, logs, strict=True)]
    runs = tuple(map(OwnRun, logs, at_events, first, missed.tolist()))
    return OwnRuns(runs, motion.peak, motion.first_harmonic)


def _outputs(system: System, d: int) -> Outputs:
    """The default place, whose peak is found, then all coordinates and their rates."""
    place, pairs = outputs_of(system, system.point_row(system.default_place)), len(system.contacts)
    nothing, each = np.zeros((d, d)), np.eye(d)
    return Outputs(
        np.concatenate([place.position, each, nothing]),
        np.concatenate([place.rate, nothing, each]),
        np.zeros((1 + 2 * d, pairs)),
        np.zeros((place.drive.shape[0], 1 + 2 * d)),
        np.zeros(1 + 2 * d),
    )


@dataclass(frozen=True, eq=False)
class Followed:
    """One way along a curve from its start, which is the first point."""

    points: list[Point]
    kinds: dict[int, str]  # of bifurcations, by the number of their points
    peak: list[float]  # of each point, see `OwnRuns`
    first_harmonic: list[float]
    end: str


def refusal(point: Point, run: OwnRun) -> DivergenceError | None:
    """Why its own run does not confirm the orbit of a point; None where it does, or an impact is too slow for that."""
    growth = float(np.abs(point.multipliers[0])) ** (2 if point.curve.is_symmetric else 1)
    try:
        check_events(run, point.curve.sequence)
        check_missed(run, point.events, growth)
    except DivergenceError as error:
        return None if _is_slow(point, run) else error
    return None


def _is_slow(point: Point, run: OwnRun) -> bool:
    """Whether a run leaves its orbit at an event so slow that rounding decides whether it is met."""
    n, kinds = point.curve.count, point.curve.solved.kind
    slow = [k for k in range(n) if kinds[k] != SECTION and np.any(np.abs(point.limits[[0, 2], k]) < SLOW)]
    extra = _extra_event(point, run)
    if extra is None or not slow:
        return bool(slow)
    count = len(point.curve.sequence.kind)
    met = (run.first + extra[1]) % count
    return any(abs(met - k - half) <= 1 for k in slow for half in (0, n, count))


def verify(system: System, way: Followed) -> str:
    """Cut a curve where its orbits are no motions of the system, and say why; their peaks are kept."""
    begin, unbounded = len(way.peak), ""
    while True:
        try:
            points = way.points[begin:]
            runs = own_runs(system, points)
            break
        except InputError as error:
            # a resonance, at the last point of which the damping is zero
            if len(way.points) == 1:
                raise
            unbounded = f"no convergence: {error}"
            way.kinds.pop(len(way.points) - 1, None)
            del way.points[-1]
            if len(points) == 1:
                return unbounded
    for i, point in enumerate(points):
        number = begin + i
        refused = None if way.kinds.get(number) == "grazing" else refusal(point, runs.each[i])
        if refused is not None:
            return _cut(system, way, number, runs.each[i], refused)
        way.peak.append(float(runs.peak[i]))
        way.first_harmonic.append(float(runs.first_harmonic[i]))
    return unbounded


def _cut(system: System, way: Followed, number: int, run: OwnRun, error: DivergenceError) -> str:
    """End a curve before a point, at the crest of a gap that reaches a wall if there is one."""
    left, right = way.points[max(number - 1, 0)], way.points[number]
    del way.points[number:]
    for k in [k for k in way.kinds if k >= number]:
        del way.kinds[k]
    for _ in range(MOST_CRESTS):
        extra = _extra_event(right, run)
        if extra is None or not number:
            break
        log, row, at = extra
        pair, side = int(log.pair[row]), float(log.side[row])
        kind = _kind_there(right, str(log.kind[row]), pair, at)
        try:
            beyond = kind == TOUCH and log.kind[row] in (RELEASE, SEPARATE)
            found = locate(left, right, _crest(right, kind, pair, side, at, beyond))
        except LostError:
            break
        # whether another one is met before
        before = near_points(left, ((1.0 - BEFORE_CREST) * float(left.row @ (found.x - left.x)),))
        if not before:
            break
        runs, right = own_runs(system, [before[0], found]), before[0]
        run = runs.each[0]
        if _extra_event(right, run) is None:
            way.kinds[len(way.points)] = "grazing"
            way.points.append(found)
            way.peak.append(float(runs.peak[1]))
            way.first_harmonic.append(float(runs.first_harmonic[1]))
            what = "contact" if kind == TOUCH else kind
            return f"extra {what} of {log.contacts[pair]} on its {'+' if side > 0.0 else '-'} side {where(found)}"
    return f"no convergence: {error}"


def _extra_event(point: Point, run: OwnRun) -> tuple[EventLog, int, float] | None:
    """The first event of a run that is none of its orbit's: its row in the log, and its phase in the orbit's cycle."""
    phases = point.events.phases
    row = first_other(run, point.events)
    if row is None or row == len(run.log):
        return None
    return run.log, row, float(phases[0] + (run.phases[row] - phases[0]) % point.cycle)


def _kind_there(point: Point, kind: str, pair: int, at: float) -> str:
    """What an extra event is from the contact state that its pair has in the orbit: a run may begin beyond a wall."""
    k = int(np.searchsorted(point.events.phases, at, side="right")) - 1
    state = abs(float(point.curve.sequence.contact_state[k, pair]))
    if state == CONTACT:
        return RELEASE
    if state == SEPARATING:
        return kind if kind == SEPARATE else PRESS_AGAIN
    return TOUCH


def _crest(
    right: Point, kind: str, pair: int, side: float, at: float, begun_beyond: bool
) -> Callable[[Point], float]:  # fmt: skip
    """How far beyond that of an event is the crest of its condition next to the phase at which a point has met it."""
    k, event = int(np.searchsorted(right.events.phases, at, side="right")) - 1, (kind, pair, side)
    intervals = _intervals(right, k, pair, -1 if begun_beyond else 1)
    found = crests(right, event, intervals)
    if begun_beyond:
        # the contact has turned the run from its orbit
        place = max(found, key=lambda crest: top(right, event, *crest)[1], default=(at, at, k))[1]
    else:
        place = min((high for _, high, _ in found if high >= at), default=at)
    place -= right.events.phases[k]

    def crest(point: Point) -> float:
        between, from_here = crests(point, event, intervals), point.events.phases[k] + place
        nearest = min(between, key=lambda crest: abs(crest[1] - from_here), default=None)
        return -1.0 if nearest is None else top(point, event, *nearest)[1]

    return crest


def _intervals(point: Point, k: int, pair: int, way: int) -> list[int]:
    """Events after which the pair goes on as after event k, until one of that pair: later ones, or earlier ones."""
    found, of = [k], point.curve.sequence.pair
    while len(found) < of.size and of[(found[-1] + (way > 0)) % of.size] != pair:
        found.append(found[-1] + way)
    return found[::way]
