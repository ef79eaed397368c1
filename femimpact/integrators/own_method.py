"""What any method may stand on: a run from the states at its instants, and dwells that are each a separate run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, own
from femimpact.errors import DivergenceError, changed, require
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.assembly import MethodRun, Readings, cycles_of_table, impacts_of
from femimpact.integrators.cases import SineCases, SineDwellResults, first_steps, in_blocks, start_of, with_contacts_of
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.methods import Method
from femimpact.integrators.runs import checked_run, response_by
from femimpact.progress import Progress
from femimpact.response.channels import Channel, Reading, resolve_channels, zero_reading
from femimpact.response.cycles import (
    ROUNDING,
    CycleStatistics,
    SteadyMotion,
    no_steady_motion,
    samples_by_cycle,
    steady_motion,
)
from femimpact.response.energy import BALANCED
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
    readings = Readings(system, excitation, drive, resolve_channels(system, shifted.channels), springs_apart=True)
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


@dataclass(frozen=True, eq=False)
class _Observed:
    """The channel of an observed place, given by its row."""

    row: Array  # (dofs,)
    name: str = "observed"
    unit: str = "m"

    def reading(self, system: System) -> Reading:
        """Its row; nothing on the unreduced system, where it is asked for by notes that are dropped."""
        zero = zero_reading(system)
        return replace(zero, displacement=self.row) if self.row.size == system.dofs else zero


def run_cases_apart(
    method: Method,
    system: System,
    cases: SineCases,
    observed: Array | Channel,  # row (dofs,) of the observed place, or any channel
    instants: int,
    workers: int,
    progress: Progress | None = None,
) -> SineDwellResults:
    """Results of cases by separate runs: `run_cases` of a method that has no faster way; see `methods.Method`."""

    def run(members: NDArray[np.intp], _: Progress | None) -> SineDwellResults:
        case = int(members[0])
        of_case, channel = with_contacts_of(cases.system(case, system), cases, case), None
        if not isinstance(observed, np.ndarray):
            channel = observed
        elif not np.array_equal(row := cases.row(case, observed), of_case.point_row(of_case.default_place)):
            channel = _Observed(row)
        return dwell(method, of_case, cases, case, start_of(cases, case), channel, instants > 0)[0]

    return in_blocks(run, [np.array([case]) for case in range(cases.frequency.size)], workers, progress)


def dwell(
    method: Method, system: System, cases: SineCases, case: int, start: State,
    channel: Channel | None,  # None for the displacement of the default place
    ledger: bool,
) -> tuple[SineDwellResults, State]:  # fmt: skip
    """Results of one dwell from a start, and where it ends; of one that fails, its start.

    What comes before three times the measured cycles is a run by itself, then come these, whose last third is measured.
    """
    f, amplitude = float(cases.frequency[case]), float(cases.amplitude[case])
    cycles, measured = int(cases.cycles[case]), int(cases.measured[case])
    allowed = "must be at most a third of the dwell where each frequency is a separate run"
    require(3 * measured <= cycles, "window", measured / f, "s", allowed)
    base = Sine(amplitude, f, phase=float(cases.phase[case]) - 2.0 * math.pi * f * start.time)
    state, unknown = start, np.full(1, np.nan)
    try:
        if cycles > 3 * measured:
            state = checked_run(method, system, base, (cycles - 3 * measured) / f, _recorder(), state).final_state
        begin = None if channel is None else state.time + (2.0 * measured + ROUNDING) / f
        run = checked_run(method, system, base, 3 * measured / f, _recorder(ledger=ledger, state_at=begin), state)
        # of the default place every run has the amplitudes
        motion = run.steady if channel is None else _motion(system, base, run.kept_state, method, channel, measured)
    except DivergenceError as error:
        totals = np.full((len(TOTAL_COLUMNS), len(system.contacts), 1), np.nan)
        failures = (f"at {f:g} Hz: {error}",)
        return SineDwellResults(no_steady_motion(), totals, unknown, unknown, unknown, failures), start
    energy = run.history.energy
    return SineDwellResults(
        motion=motion,
        totals=run.totals[:, :, None],
        duration=np.array([run.measured]),
        residual=unknown if energy is None else np.array([energy.residual]),
        bound=unknown if energy is None else np.array([BALANCED]),
        failures=("",),
        warnings=run.warnings,
    ), run.final_state


def _recorder(*channels: Channel, ledger: bool = False, state_at: float | None = None) -> Recorder:
    """The recorder of a run; of a ledger that does not close the curve warns, not the run."""
    return Recorder(channels, ledger=ledger, state_at=state_at, memory_limit=1e15, residual_limit=1e30)


def _motion(
    system: System, base: Sine, state: Any, method: Method, channel: Channel, measured: int
) -> SteadyMotion:  # fmt: skip
    """Amplitudes of a channel over measured cycles, which are run once more from a state with the channel read."""
    again = response_by(method, system, base, measured / base.frequency, _recorder(channel), state)
    # the first sample is the last one of the cycle before
    cycles = samples_by_cycle(again.time, again.channels[channel.name], base, measured)
    motion = steady_motion(cycles, np.array([measured]))
    return replace(motion, peak=np.array([abs(again.largest(channel).value)]))
