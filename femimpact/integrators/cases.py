"""Cases of a method and their results; starts, contacts, memory and threads of cases."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.contact.law import ContactLaw
from femimpact.errors import check_fields, in_range, quantity, require
from femimpact.progress import Progress
from femimpact.response.cycles import SteadyMotion
from femimpact.response.impacts import CYCLE_COLUMNS, ENERGY_COLUMNS, IMPACT_COLUMNS, event_width
from femimpact.response.response import Recorder
from femimpact.system.state import State
from femimpact.system.system import System, with_checked_pairs
from femimpact.units import number_text


@dataclass(frozen=True)
class AchievedRestitution:
    """Restitution of one collision, in continuous time and with a step.

    Parameters
    ----------
    exact : float, 1
        Of the law, in continuous time.
    mean, lowest, highest : float, 1
        With the step, over the instants within a step at which the touch can fall.
    peak_force : float, N
        Largest with the step, at the approach speed given.
    """

    exact: float = field(metadata=quantity("1", at_least=0.0, finite=False))
    mean: float = field(metadata=quantity("1", finite=False))
    lowest: float = field(metadata=quantity("1", finite=False))
    highest: float = field(metadata=quantity("1", finite=False))
    peak_force: float = field(metadata=quantity("N", at_least=0.0, finite=False))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, eq=False)
class SineCases:
    """Dwells of one system under sine motions of the base, each with its frequency, amplitude, gaps, laws and start."""

    frequency: Array  # (n,) of the base: Hz, m and rad
    amplitude: Array  # (n,)
    phase: Array  # (n,)
    gaps: Array  # (n, pairs, 2) m: to the + and to the - side, in the order of `System.contacts`
    laws: tuple[tuple[ContactLaw, ...], ...]  # sets of one law for each pair
    law_of: NDArray[np.int64]  # (n,) which set a case has
    initial: State  # what all cases start from, at t = 0
    # (n, balls) in place of those of the initial state, and in its frame, m and m/s. Of a case whose displacements are
    # not numbers the balls are where the initial state has them.
    ball_displacement: Array
    ball_velocity: Array  # (n, balls)
    cycles: NDArray[np.int64]  # (n,) complete base cycles run, and how many of them at the end are measured
    measured: NDArray[np.int64]  # (n,)
    # (dofs,) systems in place of the common one, with the row of the observed place of each: equal in the number of
    # dofs, and in their pairs but for numbers. None for the common one.
    systems: tuple[tuple[System, Array], ...] = ()
    system_of: NDArray[np.int64] | None = None  # (n,) which of them a case has

    def of(self, members: NDArray[np.intp]) -> SineCases:
        """Some of the cases."""
        common = ("laws", "initial", "systems")
        columns = {item.name: getattr(self, item.name) for item in fields(self) if item.name not in common}
        return replace(self, **{name: values[members] for name, values in columns.items() if values is not None})

    def system(self, case: int, common: System) -> System:
        """That of a case."""
        return self.systems[int(self.system_of[case])][0] if self.system_of is not None else common

    def row(self, case: int, common: Array) -> Array:
        """Row (dofs,) of the observed place of a case."""
        return self.systems[int(self.system_of[case])][1] if self.system_of is not None else common

    @property
    def numbers_of_systems(self) -> NDArray[np.int64]:
        """Which system each case has, (n,); 0 where there is but one."""
        return np.zeros(self.frequency.size, dtype=np.int64) if self.system_of is None else self.system_of


@dataclass(frozen=True, eq=False)
class SineDwellResults:
    """Results of dwells, measured at their ends."""

    motion: SteadyMotion  # of the observed place, arrays (n,)
    # (6, pairs, n) sums over the measured time; see `impacts.TOTAL_COLUMNS`. The peak force of a rigid pair is not a
    # number.
    totals: Array
    duration: Array  # (n,) s: of the measured time
    residual: Array  # (n,) largest energy residual; not a number without a ledger
    bound: Array  # (n,) of the residual, beyond which it is warned of
    failures: tuple[str, ...]  # (n,) why a case has no results, with its frequency; empty where it has
    warnings: tuple[str, ...] = ()  # of the method on the system
    # (n,) J: of structure and contacts in the measured time; not a number without a ledger, no entry of a method that
    # does not sum it up
    loss: Array = field(default_factory=lambda: np.zeros(0))
    # (n,) J: largest of all energy stored at the instants of the ledger in the measured time
    stored: Array = field(default_factory=lambda: np.zeros(0))


def in_blocks(
    run: Callable[[NDArray[np.intp], Progress | None], SineDwellResults],
    blocks: Sequence[NDArray[np.intp]],
    workers: int,
    progress: Progress | None,
) -> SineDwellResults:
    """Results of all cases in their order, from those of blocks of them by their numbers."""
    return joined(run_each(run, blocks, workers, progress), np.argsort(np.concatenate(blocks)))


def joined(parts: Sequence[SineDwellResults], order: NDArray[np.intp]) -> SineDwellResults:
    """All parts in one, their cases in the order of a permutation."""

    def column(name: str, axis: int = 0) -> Array:
        values = np.concatenate([getattr(part, name) for part in parts], axis)
        return np.take(values, order, axis) if values.size else values

    motion = {
        item.name: np.concatenate([getattr(part.motion, item.name) for part in parts])[order]
        for item in fields(SteadyMotion)
    }
    failures = [failure for part in parts for failure in part.failures]
    return SineDwellResults(
        SteadyMotion(**motion),
        column("totals", 2),
        **{name: column(name) for name in ("duration", "residual", "bound", "loss", "stored")},
        failures=tuple(failures[case] for case in order.tolist()),
        warnings=tuple(dict.fromkeys(text for part in parts for text in part.warnings)),
    )


def with_contacts_of(system: System, cases: SineCases, case: int) -> System:
    """The system with the gaps and the laws of a case."""
    laws = cases.laws[int(cases.law_of[case])]
    contacts = []
    for pair, gaps, law in zip(system.contacts, cases.gaps[case].tolist(), laws, strict=True):
        same = pair.gaps == tuple(gaps) and pair.law == law
        contacts.append(pair if same else replace(pair, gaps=tuple(gaps), law=law))
    if all(one is other for one, other in zip(contacts, system.contacts, strict=True)):
        return system
    return with_checked_pairs(system, tuple(contacts))


def equal_groups(cases: SineCases) -> list[NDArray[np.intp]]:
    """Numbers of the cases that have an equal system, gaps, laws and starts, for each such group."""
    count, names = cases.frequency.size, ("numbers_of_systems", "gaps", "law_of", "ball_displacement", "ball_velocity")
    columns = [getattr(cases, name) for name in names]
    rows = np.hstack([np.asarray(values, dtype=float).reshape(count, -1) for values in columns])
    groups: dict[bytes, list[int]] = {}
    for case in range(count):
        groups.setdefault(rows[case].tobytes(), []).append(case)
    return [np.array(members) for members in groups.values()]


def start_of(cases: SineCases, case: int) -> State:
    """The start of a case."""
    return with_balls(cases.initial, cases.ball_displacement[case], cases.ball_velocity[case])


def with_balls(
    initial: State,
    displacement: Array,  # (balls,) m: not a number for the places of the initial state
    velocity: Array,  # (balls,) m/s
) -> State:
    """The state with its balls elsewhere."""
    changed: dict[str, Any] = {}
    # what is not given may be that of the static state
    if displacement.size and not np.isnan(displacement).any():
        changed["ball_displacement"] = displacement
    if np.any(velocity):
        changed["ball_velocity"] = velocity
    return replace(initial, **changed)


def memory_needed(
    system: System, recorder: Recorder, channels: int, steps: int, dt: float, frequency: float, drive: int = 0
) -> dict[str, int]:
    """Bytes that a run will keep: channels, energies, snapshots, impacts, events, cycle statistics, the drive's values.

    With a sink these are channels, energies and snapshots of one piece.
    """
    samples, snapshots = kept_rows(recorder, steps, dt)
    pairs = len(system.contacts)
    width = 2 * (system.dofs + pairs) + pairs
    cycles, modes = int(steps * dt * frequency) + 2, modes_kept(system, recorder)
    return {
        "channels": 8 * samples * channels,
        "energies": 8 * samples * (len(ENERGY_COLUMNS) + modes) * recorder.ledger,
        # in dofs while running, at the nodes afterwards
        "snapshots": 8 * snapshots * (width + 4 * system.nodes.size),
        "impacts": 8 * recorder.impacts * (len(IMPACT_COLUMNS) + modes) * bool(system.contacts),
        "events": 8 * recorder.events * event_width(pairs, system.dofs + len(system.balls)),
        "cycles": 8 * cycles * (len(CYCLE_COLUMNS) + len(ENERGY_COLUMNS)),
        "drive": 8 * drive,
    }


def modes_kept(system: System, recorder: Recorder) -> int:
    """Number of modes whose energies are kept separately: all of a system on its modes, with a ledger."""
    return system.dofs if recorder.ledger and system.is_diagonal else 0


def check_memory(
    system: System, recorder: Recorder, channels: int, steps: int, dt: float, frequency: float,
    key: str = "record.memory_limit", drive: int = 0,
) -> int:  # fmt: skip
    """Bytes that a run will keep; an error, naming what takes how much, when they are more than the recorder allows."""
    parts = memory_needed(system, recorder, channels, steps, dt, frequency, drive)
    needed = sum(parts.values())
    shares = ", ".join(f"{name} {number_text(size / 1e6, 3)} MB" for name, size in parts.items() if size > 1e6)
    allowed = (
        f"must be >= {needed:.3g}, what this run keeps ({shares}): keep less (a larger stride every or "
        "interval, fewer "
        "snapshots, a shorter duration), give the recorder a sink, or raise it"
    )
    require(needed <= recorder.memory_limit, key, recorder.memory_limit, "bytes", allowed)
    return needed


def kept_rows(recorder: Recorder, steps: int, dt: float) -> tuple[int, int]:
    """Rows for samples and snapshots: of the run, or of its largest piece where it has a sink."""
    first, first_field = first_steps(recorder, steps, dt)
    samples = (steps - first) // recorder.every + 1
    snapshots = (steps - first_field) // recorder.snapshots + 1 if recorder.snapshots else 0
    if recorder.sink is None:
        return samples, snapshots
    piece = recorder.piece_samples * recorder.every
    return min(samples, recorder.piece_samples), min(snapshots, math.ceil(piece / max(recorder.snapshots, 1)))


def first_steps(recorder: Recorder, steps: int, dt: float) -> tuple[int, int]:
    """Steps of the first sample and of the first snapshot."""
    start, start_field = (round(min(t / dt, steps)) for t in (recorder.start, recorder.snapshots_start))
    return start, start_field


Case = TypeVar("Case")
Result = TypeVar("Result")


class _Stopped(Exception):  # noqa: N818 - no error: the caller no longer waits for this run
    """Ends a run whose result is no longer wanted."""


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def workers_of(threads: int | None) -> int:
    """Number of threads to use: all cores by default."""
    positive = threads is None or in_range(threads, quantity("1", at_least=1, integer=True))
    require(positive, "threads", threads, "", "must be a whole number >= 1")
    return cores() if threads is None else int(threads)


def run_each(
    run: Callable[[Case, Progress | None], Result],  # of a case and of what it calls with the share of it that is done
    cases: Sequence[Case],
    workers: int,  # threads at most
    progress: Progress | None,  # called with the share done of all, by one thread at a time
) -> tuple[Result, ...]:
    """Results of all cases in their order; of several that fail, the first raises."""
    if len(cases) == 1:
        return (run(cases[0], progress),)
    stop, lock, shares = threading.Event(), threading.Lock(), [0.0] * len(cases)

    def report(index: int, share: float) -> None:
        # runs report now and then: the only place where one can be ended
        if stop.is_set():
            raise _Stopped
        with lock:
            shares[index] = share
            if progress is not None:
                progress(sum(shares) / len(shares))

    def one(index: int) -> Result:
        report(index, 0.0)
        return run(cases[index], lambda share: report(index, share))

    if workers == 1:
        return tuple(one(index) for index in range(len(cases)))
    with ThreadPoolExecutor(min(workers, len(cases))) as pool:
        futures = [pool.submit(one, index) for index in range(len(cases))]
        try:
            return tuple(future.result() for future in futures)
        finally:
            # after an error or an interrupt the others are not waited for
            stop.set()
