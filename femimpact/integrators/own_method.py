"""What a method of a user's own may stand on: a run from the states at its instants."""

from __future__ import annotations

import numpy as np

from femimpact.arrays import Array, own
from femimpact.errors import changed
from femimpact.excitation import Excitation
from femimpact.integrators.assembly import MethodRun, cycles_of_table, impacts_of, readings_of
from femimpact.integrators.cases import first_steps
from femimpact.integrators.channel_rows import drive_of
from femimpact.response.channels import resolve_channels
from femimpact.response.cycles import CycleStatistics, samples_by_cycle
from femimpact.response.impacts import CYCLE_COLUMNS, IMPACT_COLUMNS, TOTAL_COLUMNS
from femimpact.response.response import Recorder
from femimpact.system.state import State
from femimpact.system.system import System


def run_of_states(
    system: System,
    excitation: Excitation,
    recorder: Recorder,
    time: Array,
    structure: tuple[Array, Array],
    balls: tuple[Array, Array],
    contact_force: Array,
) -> MethodRun:
    """A run from the states at its evenly spaced instants, with impacts as far as these show them.

    An impact is a stretch of instants with a force; its numbers are of the order of their interval. There are no
    energies and no snapshots, and a sink gets all in one piece.

    Parameters
    ----------
    recorder : Recorder
        Channels, `every` and `start` are read.
    time : ndarray (samples,), s
        The first is the start.
    structure : pair of ndarray (samples, dofs)
        Displacements and velocities relative to the base.
    balls : pair of ndarray (samples, pairs), m and m/s
        y and y' relative to the base, balls first, then stops.
    contact_force : ndarray (samples, pairs), N
        Of the walls on the structure along b_j, positive at the + wall; without centring springs.
    """
    (u, v), (y, y_rate), drive = structure, balls, drive_of(system, excitation)
    shifted = recorder.seen_from(float(time[0]))
    readings = readings_of(system, excitation, drive, resolve_channels(system, shifted.channels), springs_apart=True)
    first, _ = first_steps(shifted, time.size - 1, float(time[1] - time[0]))
    chosen, rows = slice(first, None, shifted.every), readings.rows
    values = rows.displacement @ u[chosen].T + rows.velocity @ v[chosen].T
    values += rows.ball_displacement @ y[chosen].T + rows.ball_velocity @ y_rate[chosen].T
    values += rows.contact_force @ contact_force[chosen].T
    directions = np.array([pair.direction for pair in system.contacts]).reshape(-1, system.dofs)
    impacts = _impact_rows(time, contact_force, y_rate - v @ directions.T)
    moving, begin = len(system.balls), float(time[0] + 2.0 * (time[-1] - time[0]) / 3.0)
    history, streamed_to = readings.piece(own(time[chosen]), own(values)), None
    if recorder.sink is not None:
        recorder.sink(history)
        streamed_to, history = float(history.time[-1]), changed(history, time=own(()), channels={})
    return MethodRun(
        history=history,
        final_state=State(own(u[-1]), own(v[-1]), own(y[-1, :moving]), own(y_rate[-1, :moving]), time=float(time[-1])),
        cycles=_whole_cycles(time, u @ system.point_row(system.default_place), excitation),
        measured=float(time[-1]) - begin,
        totals=_totals(impacts, begin, time, contact_force),
        impacts=impacts_of(system, excitation, impacts, len(impacts)),
        streamed_to=streamed_to,
        notes=readings.notes,
    )


def _whole_cycles(time: Array, values: Array, excitation: Excitation) -> CycleStatistics:
    """Statistics of all base cycles that have ended, to half an interval."""
    turns = excitation.frequency * (time - time[0])
    half = 0.5 * float(turns[1])
    count = int(turns[-1] + half)
    if count == 0:
        return cycles_of_table(np.zeros((len(CYCLE_COLUMNS), 0, 1)))
    complete = turns <= count + half
    return samples_by_cycle(time[complete], values[complete], excitation, count)


def _impact_rows(time: Array, force: Array, rate: Array) -> Array:
    """Rows of impacts (n, columns) from forces (N) and the rates of gaps (m/s), in the order in which they end."""
    rows = []
    for j, (pushes, speed) in enumerate(zip(force.T, rate.T, strict=True)):
        closed = np.concatenate([[False], pushes != 0.0, [False]]).astype(int)
        begins, ends = (np.flatnonzero(np.diff(closed) == change) for change in (1, -1))
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
            # one that lasts at the end is no finished impact
            if end == time.size:
                continue
            side, inside = float(np.sign(pushes[begin])), slice(max(begin - 1, 0), end + 1)
            impulse, loss = (abs(np.trapezoid(curve[inside], time[inside])) for curve in (pushes, pushes * speed))
            rows.append((
                time[begin], j, side, side * speed[inside][0], -side * speed[end], impulse,
                np.abs(pushes[inside]).max(), time[end] - time[begin], loss,
            ))  # fmt: skip
    table = np.array(rows).reshape(-1, len(IMPACT_COLUMNS))
    return np.asarray(table[np.argsort(table[:, 0] + table[:, 7], kind="stable")])


def _totals(impacts: Array, begin: float, time: Array, force: Array) -> Array:
    """Sums (6, pairs) over impacts that end after a time (s), and over the forces from then on."""
    totals = np.zeros((len(TOTAL_COLUMNS), force.shape[1]))
    late, size = impacts[impacts[:, 0] + impacts[:, 7] > begin], np.abs(force[time >= begin])
    for j in range(force.shape[1]):
        speed, impulse = late[late[:, 1] == j][:, [3, 5]].T
        totals[:4, j] = speed.size, speed.sum(), speed.max(initial=0.0), impulse.sum()
    totals[4], totals[5] = size.max(axis=0, initial=0.0), np.trapezoid(size, time[time >= begin], axis=0)
    return totals
