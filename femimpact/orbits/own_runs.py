"""Event-driven runs over one period of many orbits in one compiled call, each with its frequency, gaps and start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femimpact.arrays import Array
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.block import Inputs, new_block, no_cycles, run_block
from femimpact.integrators.event_driven.equations import equations_of
from femimpact.integrators.event_driven.loop_data import DONE
from femimpact.integrators.event_driven.store import FormStore, Outputs, outputs_of
from femimpact.orbits.curve import Point
from femimpact.orbits.verification import between_events
from femimpact.response.impacts import CYCLE_COLUMNS, EventLog, event_log
from femimpact.response.signals import CycleStatistics, steady_motion
from femimpact.system.system import System

MORE_EVENTS = 64
"""Events of a run beyond those of its orbit that are kept: of an orbit that is no motion some are met."""


@dataclass(frozen=True, eq=False)
class OwnRuns:
    """What the runs of n orbits leave."""

    missed: Array  # (n,) by which each misses its start, in the units of the curve; infinite where events did not end
    logs: tuple[EventLog, ...]
    phase: Array  # (n,) rad: of the drive where each begins
    first: tuple[int, ...]  # event that each is to meet first
    peak: Array  # (n,) m: largest displacement of the default place
    first_harmonic: Array  # (n,) m: its component at the frequency of the excitation


def own_runs(system: System, points: Sequence[Point]) -> OwnRuns:
    """Runs over one period of the orbits of some points of a curve, each from between two events."""
    curve, count, method = points[0].curve, len(points), EventDriven()
    starts, phase, first = zip(
        *(between_events(p.passed.hybrid, curve.sequence, *p.orbit, p.flows) for p in points), strict=True
    )
    hybrids, state = [point.passed.hybrid for point in points], np.array(starts)
    equations = equations_of(system, drive_of(system, curve.parameter.at(curve.parameter.value)[1]))
    d, rigid = hybrids[0].mass.size, np.array([pair.parameters.is_rigid for pair in system.contacts], dtype=bool)
    store = FormStore(equations, rigid, _outputs(system, d), rate=None, derived=system.derived)
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
    block = new_block(system, store, inputs, method, None, most_events=kept)
    samples, cycles = curve.sequence.cycles * method.samples_per_cycle, curve.sequence.cycles
    block.grid = block.grid._replace(cycles=no_cycles(count, cycles), values=np.zeros((count, samples, 1 + 2 * d)))
    begin, end = np.zeros(count, dtype=np.int64), np.full(count, samples)
    run_block(block, begin, end, np.full(count, 10.0 * kept + samples))
    unit, names = curve.unit[:-1], tuple(pair.name for pair in system.contacts)
    missed = np.max(np.abs(block.grid.values[:, -1, 1:] - state) / unit, axis=1)
    logs = tuple(
        event_log(rows, int(found), names) for rows, found in zip(block.tables.events, block.tables.logged, strict=True)
    )
    table = np.moveaxis(block.grid.cycles[:, :, : len(CYCLE_COLUMNS)], (2, 1), (0, 1))
    motion = steady_motion(CycleStatistics(*table), np.full(count, cycles))
    done = block.stopped == DONE
    return OwnRuns(np.where(done, missed, np.inf), logs, np.array(phase), first, motion.peak, motion.first_harmonic)


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
