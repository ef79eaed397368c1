"""Frames of a run: an even grid of its snapshots, and the instants of its impacts.

Snapshots are kept on a grid, impacts are not. The state at an impact is computed from the snapshot before it
(`propagation`), and taken on to the snapshot after it, where it must agree with the recorded state: the difference is
`Frames.mismatch`, and what differs by more than 1 % has no frame. The error of an event-driven run is that of
rounding; the error of a method that takes steps is what the method's own error makes of the time between two snapshots.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femimpact.export.scene import snapshots_of, thinned
from femimpact.export.vtk.contact_record import ContactRecord, Instant
from femimpact.export.vtk.propagation import Transition
from femimpact.response.history import Snapshots
from femimpact.response.response import Response

__all__ = ["Frames", "frames_of"]

Array = NDArray[np.float64]

MOST_DOFS = 200
"""Of structure and balls, for states at impacts: the matrix exponential is dense."""

LARGEST_MISMATCH = 0.01
"""Share of the largest displacement by which a state may miss the next snapshot."""

SAME_TIME = 1e-9
"""Share of the time shown within which two instants are one."""


@dataclass(frozen=True, eq=False)
class Frames:
    """States that are shown, in the order of time.

    Parameters
    ----------
    snapshots : Snapshots
    what : tuple of str
        What happens at each; "" on the grid.
    impulse : ndarray (frames, pairs), N s
        On the beam, of the impact at this frame, of the sign of `Snapshots.contact_force`; else 0.
    touching : ndarray (frames, pairs)
        Whether the pair is in contact.
    mismatch : float, 1
        Largest share of the largest displacement by which states at impacts, taken on, miss the next snapshot.
    """

    snapshots: Snapshots
    what: tuple[str, ...]
    impulse: Array
    touching: NDArray[np.bool_]
    mismatch: float


def frames_of(response: Response, most: int) -> Frames:
    """States of a run on an even grid and at every impact.

    Parameters
    ----------
    response : Response
        With snapshots.
    most : int
        At most so many frames. Impacts have at most half of them, evenly spread where there are more.

    Returns
    -------
    Frames

    Warns
    -----
    UserWarning
        If impacts have no frame.
    """
    grid = snapshots_of(response)
    record = ContactRecord(response, float(grid.time[0]), float(grid.time[-1]))
    instants = wanted = record.instants()
    if len(wanted) > max(most // 2, most - grid.time.size):
        instants = [wanted[i] for i in thinned(len(wanted), max(most // 2, most - grid.time.size))] if most > 1 else []
        _warn(f"{len(instants)} of {len(wanted)} impacts have a frame: at most {most} frames are written")
    states, mismatch = _states(record, grid, instants)
    chosen = thinned(grid.time.size, max(most - len(states), 1))
    return _merged(record, grid, chosen, states, mismatch)


def _warn(text: str) -> None:
    warnings.warn(text, UserWarning, stacklevel=4)


# ---- states ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _State:
    """One snapshot's worth of arrays, as `Snapshots` has them."""

    instant: Instant
    displacement: Array
    velocity: Array
    ball_displacement: Array
    ball_velocity: Array
    contact_force: Array


def _states(record: ContactRecord, grid: Snapshots, instants: list[Instant]) -> tuple[list[_State], float]:
    """States at instants off the grid, and their largest mismatch."""
    response = record.response
    slack = SAME_TIME * max(float(grid.time[-1] - grid.time[0]), 1e-300)
    before = np.searchsorted(grid.time, [item.time for item in instants], side="right") - 1
    size = response.system.dofs + len(response.system.balls)
    if instants and size > MOST_DOFS:
        _warn(f"no impact has a frame: the system has {size} dofs, more than {MOST_DOFS}; `reduce` it")
        return [], 0.0
    transition = Transition(response) if instants else None
    states, worst, lost = list[_State](), 0.0, 0
    for k in np.unique(before):
        mine = [item for item, at in zip(instants, before, strict=True) if at == k]
        on_grid = [item for item in mine if item.time - grid.time[k] <= slack]
        states += [_recorded(grid, int(k), item) for item in on_grid]
        rest = [item for item in mine if item.time - grid.time[k] > slack]
        if not rest or transition is None or k + 1 >= grid.time.size:
            continue
        found, mismatch = _between(transition, record, grid, int(k), rest)
        if mismatch <= LARGEST_MISMATCH:
            states, worst = states + found, max(worst, mismatch)
        else:
            lost += len(rest)
    if lost:
        share = f"{100.0 * LARGEST_MISMATCH:g} %"
        _warn(f"{lost} impacts have no frame: their states, taken on, miss the next snapshot by more than {share}")
    return states, worst


def _recorded(grid: Snapshots, k: int, instant: Instant) -> _State:
    names = ("displacement", "velocity", "ball_displacement", "ball_velocity", "contact_force")
    return _State(instant, *(getattr(grid, name)[k] for name in names))


def _between(
    transition: Transition, record: ContactRecord, grid: Snapshots, k: int, instants: list[Instant]
) -> tuple[list[_State], float]:
    """States at instants between two snapshots, just before what happens there, and by how much they miss the next."""
    names = ("displacement", "velocity", "ball_displacement", "ball_velocity")
    state = transition.state(*(getattr(grid, name)[k] for name in names))
    time, end = float(grid.time[k]), float(grid.time[k + 1])
    found = list[_State]()
    stops = sorted({*record.between(time, end), *(item.time for item in instants), end})
    due = sorted(instants, key=lambda item: item.time)
    for stop in stops:
        middle = 0.5 * (time + stop)
        touching, sticking = record.touching(middle), record.sticking(middle)
        state = transition.moved(state, time, stop, touching, sticking)
        time = stop
        while due and due[0].time == stop:
            item = due.pop(0)
            begun = [touch for touch, _ in record.starting(stop) if touch.pair == item.pair]
            forces = np.zeros(len(record.names))
            for touch in (*touching, *begun):
                forces[touch.pair] = record.on_beam(touch.pair) * transition.force(state, touch, stop)
            found.append(_State(item, *transition.nodal(state), forces))
        state = _through(transition, record, state, stop, sticking)
    reached = transition.nodal(state)
    wanted = [getattr(grid, name)[k + 1] for name in names]
    largest = max(float(np.abs(grid.displacement[:, 0::2]).max()), float(np.abs(grid.ball_displacement).max(initial=0)))
    missed = max(
        float(np.abs(reached[0] - wanted[0])[0::2].max()), float(np.abs(reached[2] - wanted[2]).max(initial=0.0))
    )
    return found, missed / largest if largest > 0.0 else 0.0


def _through(
    transition: Transition, record: ContactRecord, state: Array, time: float, sticking: frozenset[int]
) -> Array:
    """The state after what happens at a time: impulses of rigid impacts, and pairs that begin to stick."""
    after = record.sticking(math.nextafter(time, math.inf))
    # what lets go at this instant is free before the impulse
    lasting = sticking & after
    for touch, impulse in record.starting(time):
        if record.is_rigid(touch.pair):
            state = transition.struck(state, impulse, touch.pair, lasting - {touch.pair})
    return transition.held(state, after, time) if after - sticking else state


def _merged(
    record: ContactRecord, grid: Snapshots, chosen: NDArray[np.int64], states: list[_State], mismatch: float
) -> Frames:
    """Snapshots of the grid and states at instants, in the order of time, one for each time."""
    groups = _by_time(grid, chosen, states)
    pairs = len(record.names)
    impulse, touching = np.zeros((len(groups), pairs)), np.zeros((len(groups), pairs), dtype=bool)
    forces = np.zeros((len(groups), pairs))
    for f, group in enumerate(groups):
        time = group[-1].instant.time
        touching[f, [touch.pair for touch in record.touching(time)]] = True
        touching[f, list(record.sticking(time))] = True
        for item in group:
            forces[f] = np.where(item.contact_force != 0.0, item.contact_force, forces[f])
            if item.instant.pair >= 0:
                impulse[f, item.instant.pair] += item.instant.impulse
                touching[f, item.instant.pair] = True
    names = ("displacement", "velocity", "ball_displacement", "ball_velocity")
    snapshots = Snapshots(
        time=np.array([group[-1].instant.time for group in groups]),
        **{name: np.array([getattr(group[-1], name) for group in groups]) for name in names},
        contact_force=forces,
    )
    what = tuple("; ".join(item.instant.what for item in group if item.instant.what) for group in groups)
    return Frames(snapshots, what, impulse, touching | (forces != 0.0), mismatch)


def _by_time(grid: Snapshots, chosen: NDArray[np.int64], states: list[_State]) -> list[list[_State]]:
    """Chosen snapshots and states at instants in the order of time, those of one time together."""
    times = np.array([item.instant.time for item in states])
    slack = SAME_TIME * max(float(grid.time[-1] - grid.time[0]), 1e-300)
    apart = [k for k in chosen if not times.size or np.abs(times - grid.time[k]).min() > slack]
    every = [*(_recorded(grid, int(k), Instant(float(grid.time[k]), "")) for k in apart), *states]
    every.sort(key=lambda item: item.instant.time)
    groups: list[list[_State]] = []
    for item in every:
        if groups and item.instant.time - groups[-1][-1].instant.time <= slack:
            groups[-1].append(item)
        else:
            groups.append([item])
    return groups
