"""Frames of a run: an even grid of its snapshots, and the instants of its impacts.

Snapshots are kept on a grid, impacts are not. The state at an impact is computed from the snapshot before it
(`propagation`), and taken on to the snapshot after it, where it must meet the recorded state: by how much it misses is
`Frames.mismatch`, and what misses it by more than 1 % has no frame. The error of an event-driven run is that of
rounding; the error of a method that takes steps is what the method's own error makes of the time between two snapshots.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.scene import snapshots_of, thinned
from femimpact.export.vtk.propagation import Touching, Transition
from femimpact.response.history import Snapshots
from femimpact.response.response import Response

__all__ = ["Frames", "Instant", "frames_of", "instants_of"]

MOST_DOFS = 200
"""Of structure and balls, for states at impacts: the matrix exponential is dense."""

LARGEST_MISMATCH = 0.01
"""Share of the largest displacement by which a state may miss the next snapshot."""

SAME_TIME = 1e-9
"""Share of the time shown within which two instants are one."""


@dataclass(frozen=True)
class Instant:
    """An instant that is shown: its time (s), what happens, the pair (-1: none), its side and the impulse (N s)."""

    time: float
    what: str
    pair: int = -1
    side: int = 0
    impulse: float = 0.0


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
    impulse: NDArray[Any]
    touching: NDArray[Any]
    mismatch: float


def instants_of(response: Response, start: float, end: float) -> list[Instant]:
    """Impacts between two times (s), the first and the last of every captured accumulation only, in order of time.

    An accumulation is the row of impacts of one pair on one side, at ever shorter intervals, that ends in a sticking
    phase (`StickingPhases.start`).
    """
    impacts, sticking = response.impacts, response.sticking
    numbers = {pair.name: j for j, pair in enumerate(response.system.contacts)}
    left_out, ends = set[int](), list[Instant]()
    for name, side, begin in zip(sticking.impactor, sticking.side, sticking.start, strict=True):
        rows = _accumulation(response, str(name), int(side), float(begin))
        left_out.update(rows[1:])
        what = f"{name} sticks to the {'+' if side > 0 else '-'} wall: end of an accumulation of {len(rows)} impacts"
        ends.append(Instant(float(begin), what, numbers[str(name)], int(side)))
    found = []
    for i in range(len(impacts)):
        if i not in left_out:
            name, side = str(impacts.impactor[i]), int(impacts.side[i])
            what = f"{name} meets the {'+' if side > 0 else '-'} wall at {impacts.approach_speed[i]:.4g} m/s"
            signed = side * _on_structure(response, numbers[name]) * float(impacts.impulse[i])
            found.append(Instant(float(impacts.time[i]), what, numbers[name], side, signed))
    return sorted((item for item in (*found, *ends) if start <= item.time <= end), key=lambda item: item.time)


def _on_structure(response: Response, j: int) -> float:
    """Sign of a force on the structure where the ball, or the structure beside a stop, is at its + wall."""
    return -1.0 if response.system.contacts[j].is_stop else 1.0


def _accumulation(response: Response, name: str, side: int, end: float) -> list[int]:
    """Rows of the table of impacts that lead to a sticking phase, in the order of time."""
    impacts = response.impacts
    mine = np.flatnonzero((impacts.impactor == name) & (impacts.time <= end))
    mine = mine[np.argsort(impacts.time[mine], kind="stable")]
    rows, wait = list[int](), 0.0
    for i in reversed(mine):
        between = float(impacts.time[rows[-1]] - impacts.time[i]) if rows else 0.0
        if int(impacts.side[i]) != side or between < wait:
            break
        rows.append(int(i))
        wait = between
    return rows[::-1]


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
    wanted = instants_of(response, float(grid.time[0]), float(grid.time[-1]))
    instants = wanted
    if len(wanted) > max(most // 2, most - grid.time.size):
        instants = [wanted[i] for i in thinned(len(wanted), max(most // 2, most - grid.time.size))] if most > 1 else []
        _warn(f"{len(instants)} of {len(wanted)} impacts have a frame: at most {most} frames are written")
    states, mismatch = _states(response, grid, instants)
    chosen = thinned(grid.time.size, max(most - len(states), 1))
    return _merged(response, grid, chosen, states, mismatch)


def _warn(text: str) -> None:
    warnings.warn(text, UserWarning, stacklevel=4)


# ---- states ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _State:
    """One snapshot's worth of arrays, as `Snapshots` has them."""

    instant: Instant
    displacement: NDArray[Any]
    velocity: NDArray[Any]
    ball_displacement: NDArray[Any]
    ball_velocity: NDArray[Any]
    contact_force: NDArray[Any]


def _states(response: Response, grid: Snapshots, instants: list[Instant]) -> tuple[list[_State], float]:
    """States at instants off the grid, and their largest mismatch."""
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
        found, mismatch = _between(transition, response, grid, int(k), rest)
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
    transition: Transition, response: Response, grid: Snapshots, k: int, instants: list[Instant]
) -> tuple[list[_State], float]:
    """States at instants between two snapshots, just before what happens there, and by how much they miss the next."""
    names = ("displacement", "velocity", "ball_displacement", "ball_velocity")
    state = transition.state(*(getattr(grid, name)[k] for name in names))
    time, end = float(grid.time[k]), float(grid.time[k + 1])
    found, events = list[_State](), _events(response, time, end)
    stops = sorted({*(event for event in events), *(item.time for item in instants), end})
    due = sorted(instants, key=lambda item: item.time)
    for stop in stops:
        touching, sticking = _contacts(response, 0.5 * (time + stop))
        state = transition.moved(state, time, stop, touching, sticking)
        time = stop
        while due and due[0].time == stop:
            item = due.pop(0)
            begun = [touch for touch in _starting(response, stop) if touch.pair == item.pair]
            forces = np.zeros(len(response.system.contacts))
            for touch in (*touching, *begun):
                forces[touch.pair] = _on_structure(response, touch.pair) * transition.force(state, touch, stop)
            found.append(_State(item, *transition.nodal(state), forces))
        state = _through(transition, response, state, stop, sticking)
    reached = transition.nodal(state)
    wanted = [getattr(grid, name)[k + 1] for name in names]
    largest = max(float(np.abs(grid.displacement[:, 0::2]).max()), float(np.abs(grid.ball_displacement).max(initial=0)))
    missed = max(
        float(np.abs(reached[0] - wanted[0])[0::2].max()), float(np.abs(reached[2] - wanted[2]).max(initial=0.0))
    )
    return found, missed / largest if largest > 0.0 else 0.0


def _rigid(response: Response, name: str) -> bool:
    return any(pair.name == name and pair.parameters.is_rigid for pair in response.system.contacts)


def _events(response: Response, start: float, end: float) -> list[float]:
    """Times in (start, end] at which a contact begins or ends."""
    impacts, sticking = response.impacts, response.sticking
    times = np.concatenate([impacts.time, impacts.time + impacts.duration, _begins(response), sticking.end])
    times = times[np.isfinite(times)]
    return [float(t) for t in np.unique(times[(times > start) & (times < end)])]


def _touching_rows(response: Response, time: float) -> list[int]:
    impacts = response.impacts
    chosen = (impacts.time <= time) & (impacts.time + impacts.duration > time)
    return [int(i) for i in np.flatnonzero(chosen)]


def _touch(response: Response, i: int) -> Touching:
    impacts = response.impacts
    j = [pair.name for pair in response.system.contacts].index(str(impacts.impactor[i]))
    return Touching(j, int(impacts.side[i]), abs(float(impacts.approach_speed[i])), float(impacts.duration[i]))


def _contacts(response: Response, time: float) -> tuple[tuple[Touching, ...], frozenset[int]]:
    """Compliant contacts that go on at a time, and rigid pairs that stick."""
    touching = tuple(_touch(response, i) for i in _touching_rows(response, time))
    return touching, _sticking(response, time)


def _sticking(response: Response, time: float) -> frozenset[int]:
    names, phases = [pair.name for pair in response.system.contacts], response.sticking
    on = (_begins(response) <= time) & ~(phases.end <= time)
    return frozenset(names.index(str(name)) for name in phases.impactor[on] if _rigid(response, str(name)))


def _begins(response: Response) -> NDArray[Any]:
    """When each sticking phase begins in the run (s): with the impact that captures the pair, which has no rebound.

    The table's `start` is the end of the accumulation, whose bounces after that impact are too low to be computed.
    """
    impacts, phases = response.impacts, response.sticking
    begins, last = np.array(phases.start), impacts.rebound_speed == 0.0
    for k, (name, side, start) in enumerate(zip(phases.impactor, phases.side, phases.start, strict=True)):
        mine = impacts.time[last & (impacts.impactor == name) & (impacts.side == side) & (impacts.time <= start)]
        # of an earlier phase, if the one before has ended since
        before = phases.end[(phases.impactor == name) & (phases.end <= start)].max(initial=-math.inf)
        begins[k] = mine[mine > before].max(initial=-math.inf) if np.any(mine > before) else start
    return begins


def _starting(response: Response, time: float) -> list[Touching]:
    return [_touch(response, int(i)) for i in np.flatnonzero(response.impacts.time == time)]


def _through(
    transition: Transition, response: Response, state: NDArray[Any], time: float, sticking: frozenset[int]
) -> NDArray[Any]:
    """The state after what happens at a time: impulses of rigid impacts, and pairs that begin to stick."""
    impacts, after = response.impacts, _sticking(response, math.nextafter(time, math.inf))
    # what lets go at this instant is free before the impulse
    lasting = sticking & after
    for i in np.flatnonzero(impacts.time == time):
        if _rigid(response, str(impacts.impactor[i])):
            touch = _touch(response, int(i))
            state = transition.struck(state, touch.side * float(impacts.impulse[i]), touch.pair, lasting - {touch.pair})
    return transition.held(state, after, time) if after - sticking else state


def _merged(response: Response, grid: Snapshots, chosen: NDArray[Any], states: list[_State], mismatch: float) -> Frames:
    """Snapshots of the grid and states at instants, in the order of time, one for each time."""
    states = sorted(states, key=lambda item: item.instant.time)
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
    pairs = len(response.system.contacts)
    impulse, touching = np.zeros((len(groups), pairs)), np.zeros((len(groups), pairs), dtype=bool)
    forces = np.zeros((len(groups), pairs))
    for f, group in enumerate(groups):
        time = group[-1].instant.time
        for i in _touching_rows(response, time):
            touching[f, _touch(response, i).pair] = True
        touching[f, list(_sticking(response, time))] = True
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
