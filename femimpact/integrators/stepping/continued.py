"""A stepped run that goes on from the step at which another one ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.excitation import Excitation
from femimpact.integrators.stepping.operators import SteppingMethod, scheme_of
from femimpact.system.state import Continuation, State
from femimpact.system.system import System

Kind = TypeVar("Kind", np.float64, np.int64)

MOTION = ("q", "v", "a", "w", "w_rate", "ball", "touch", "drive")
CYCLES = ("next_wrap", "number", "sums", "last")


@dataclass(frozen=True, eq=False)
class Held:
    """State of a run of one case where it ended."""

    origin: float  # s: time of its step 0
    step: int
    motion: Mapping[str, Array]  # arrays of `core.steps.Motion` and `core.steps.Cycles` by their names
    cycles: Mapping[str, Array | NDArray[np.int64]]
    gaps: Array  # (2, pairs, 1) m: of rigid contacts that the run began in, these are the start's
    # (pairs, n) J: what contacts in progress have given to each mode; without columns where it was not summed
    to_modes: Array

    def contacts_in_progress(self, system: System) -> tuple[str, ...]:
        """Names of the contacts in progress."""
        opened = self.motion["touch"][core.steps.OPEN, :, 0] != 0.0
        return tuple(pair.name for pair, is_open in zip(system.contacts, opened, strict=True) if is_open)


@dataclass(frozen=True, eq=False)
class Beginning:
    """Initial state of a run."""

    origin: float = 0.0  # s: time of step 0
    step: int = 0  # step at which the run begins: that at which the run ended that this one goes on from, or 0
    held: Held | None = None  # contacts in progress, where they go on
    # whether all else that is held goes on as well: the drive, the accelerations and the base cycle are the same
    complete: bool = False

    @property
    def cycle(self) -> int:
        """Base cycles that were finished before."""
        return int(self.held.cycles["number"][0]) if self.held is not None and self.complete else 0

    def going_on(self, system: System) -> tuple[str, ...]:
        """Names of the contacts in progress that go on."""
        return () if self.held is None else self.held.contacts_in_progress(system)

    def times(self, steps: int, method: SteppingMethod) -> Array:
        """Times (s) of all fine steps from step 0 until a number of steps after the beginning."""
        time = self.origin + np.arange((self.step + steps) * method.refine + 1) * (method.dt / method.refine)
        return np.asarray(time, dtype=float)


def beginning_of(initial: State, system: System, excitation: Excitation, method: SteppingMethod) -> Beginning:
    """Where a run from an initial state begins, and what of the run that ended there goes on."""
    left = initial.left_by_run(system, excitation)
    if left is None or left.kind != _kind(method):
        return Beginning(initial.time)
    held: Held = left.held
    if left.has_equations_of(system, excitation, initial.time):
        return Beginning(held.origin, held.step, held, complete=True)
    return Beginning(initial.time, 0, held)


def resume_contacts(held: Held, beginning: Beginning, pairs: core.steps.Pairs, touch: Array, time_step: float) -> Array:
    """Contacts in progress go on; their forces (N) on the structure, those of centring springs included."""
    pairs.constants[[core.steps.GAP_PLUS, core.steps.GAP_MINUS]] = held.gaps
    touch[...] = held.motion["touch"]
    if not beginning.complete:
        # of steps that are counted anew
        touch[core.steps.START] -= held.step * time_step
    return np.broadcast_to(held.motion["ball"][core.steps.FORCE], touch.shape[1:])


def go_on(beginning: Beginning, motion: core.steps.Motion, cycles: core.steps.Cycles) -> None:
    """Set motion and cycles to what the run has reached that this one goes on from."""
    held = beginning.held
    if held is None:
        return
    if held.to_modes.shape == motion.to_modes.shape:
        motion.to_modes[...] = held.to_modes
    else:
        # it was not summed before
        motion.to_modes[held.motion["touch"][core.steps.OPEN, :, 0] != 0.0] = np.nan
    if not beginning.complete:
        return
    for arrays, target in ((held.motion, motion), (held.cycles, cycles)):
        for name, values in arrays.items():
            getattr(target, name)[...] = values


def final_state(
    system: System, excitation: Excitation, method: SteppingMethod, beginning: Beginning, step: int,
    pairs: core.steps.Pairs, motion: core.steps.Motion, cycles: core.steps.Cycles,
) -> State:  # fmt: skip
    """Where a run of one case stands at a step, with all that the same method needs to go on."""
    held = Held(
        origin=beginning.origin,
        step=step,
        motion={name: _copy(getattr(motion, name)) for name in MOTION},
        cycles={name: _copy(getattr(cycles, name)) for name in CYCLES},
        gaps=_copy(pairs.constants[[core.steps.GAP_PLUS, core.steps.GAP_MINUS]]),
        to_modes=_copy(motion.to_modes),
    )
    balls, time = len(system.balls), beginning.origin + step * method.dt
    places, rates = (
        (_copy(of_dofs[:, 0]), _copy(motion.ball[row, :balls, 0]))
        for of_dofs, row in ((motion.q, core.steps.Y), (motion.v, core.steps.Y_RATE))
    )
    left = Continuation(_kind(method), held, places, rates, time, system, excitation, held.contacts_in_progress(system))
    return State(places[0], rates[0], places[1], rates[1], time=time, continuation=left)


def _kind(method: SteppingMethod) -> object:
    """Methods whose steps are the same go on from one another."""
    return "steps", scheme_of(method), method.refine


def _copy(array: NDArray[Kind]) -> NDArray[Kind]:
    copy = np.array(array)
    copy.setflags(write=False)
    return copy
