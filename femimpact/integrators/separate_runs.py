"""Dwells under sine motions of the base, each a separate run: for any method, channel and start."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, require
from femimpact.excitation import Sine
from femimpact.integrators.cases import SineCases, SineDwellResults, in_blocks, start_of, with_contacts_of
from femimpact.integrators.methods import Method
from femimpact.integrators.runs import checked_run, response_by
from femimpact.progress import Progress
from femimpact.response.channels import Channel, Reading, zero_reading
from femimpact.response.cycles import ROUNDING, SteadyMotion, no_steady_motion, samples_by_cycle, steady_motion
from femimpact.response.energy import BALANCED
from femimpact.response.impacts import TOTAL_COLUMNS
from femimpact.response.response import Recorder
from femimpact.system.state import State
from femimpact.system.system import System


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

    Raises `InputError` if a dwell cannot be run at all.
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
