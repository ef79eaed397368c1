"""What all methods with steps answer alike; see `integrators.methods.Method` for the questions."""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.excitation import Excitation
from femimpact.integrators.answers import AchievedRestitution, MethodCost, SineCases, SineDwellResults, SineDwells
from femimpact.integrators.stepping.collision import stepped_restitution
from femimpact.integrators.stepping.dwells import stepped_cases, stepped_dwells
from femimpact.integrators.stepping.record import check_recorder
from femimpact.integrators.stepping.run import run_steps
from femimpact.integrators.stepping.scheme import SteppingMethod, scheme_of
from femimpact.integrators.stepping.step_size import check_sampling, check_step, recommended_step, step_notes
from femimpact.integrators.threads import Progress
from femimpact.response.response import Recorder, Response
from femimpact.system.contact_pair import ContactPair
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["SteppingAnswers"]

NANOSECONDS, BESIDE_OTHERS = {"modal": 9.0, "physical": 20.0}, {"modal": 2.5, "physical": 20.0}
"""Rough cost of one dof and step on one core of a 2024 server, of a run alone and of one of many."""

WITHOUT_BALLS = 1.5
"""Time of a sweep with balls and of the one without them, over that of the first."""

CYCLE = 170.0
"""Bytes of a base cycle of a case of a sweep."""

AT_ONCE = 64
"""Cases of a sweep that are in memory together on each thread."""


class SteppingAnswers:
    """The answers of a method with steps, for one that satisfies `scheme.SteppingMethod`."""

    @classmethod
    def for_system(cls, system: System, **settings: Any) -> Self:
        """The method with these settings, and with the recommended step unless they hold a dt."""
        step = {} if "dt" in settings else {"dt": recommended_step(system, settings.get("refine", 1))}
        return cls(**step, **settings)

    @property
    def unit(self) -> str:
        """What the instants are called at which a run can be read."""
        return "steps"

    @property
    def stability_limit(self) -> float:
        """Largest dt omega (1) that is stable: any."""
        return math.inf

    def description(self: SteppingMethod, frequency: float, origin: str) -> str:
        """The step, in words; `origin` says where it comes from."""
        refined = f", divided by {self.refine} in contact" if self.refine > 1 else ""
        return f"step: {self.dt:.4g} s ({origin}){refined}"

    def check(self: SteppingMethod, system: System) -> tuple[str, ...]:
        """Warnings of the step on a system; see `step_size.check_step`."""
        return check_step(system, self)

    def check_drive(self: SteppingMethod, frequencies: NDArray[np.float64], key: str) -> None:
        """Refuse frequencies of the drive (Hz) that the step does not see."""
        check_sampling(frequencies, self, key)

    def notes(self: SteppingMethod, system: System) -> tuple[str, ...]:
        """Notes on modes that the step does not follow."""
        return step_notes(system, self)

    def time_grid(self: SteppingMethod, frequency: float) -> float:
        """The step, s."""
        return self.dt

    def interval(
        self: SteppingMethod, system: System, excitation: Excitation, duration: float, recorder: Recorder
    ) -> float:  # fmt: skip
        """The step, s; refused is a recorder with an interval."""
        check_recorder(recorder)
        return self.dt

    def stride(self: SteppingMethod, frequency: float, points: int) -> int:
        """Steps between records of which about so many are wanted in a cycle of a frequency (Hz)."""
        return max(math.floor(1.0 / (points * frequency * self.dt)), 1)

    def read_at_least(self, samples: int) -> Self:
        """The same method: it is read at its steps."""
        return self

    def steps_in(self: SteppingMethod, duration: float) -> float:
        """Steps in so long a contact (s)."""
        return duration * self.refine / self.dt

    def achieved_restitution(
        self: SteppingMethod, pair: ContactPair, approach_speed: float, phases: int = 32
    ) -> AchievedRestitution | None:
        """Restitution with the step; none where the method does not take the pair's law."""
        if (pair.parameters.kind == RIGID) != scheme_of(self).rigid:
            return None
        return stepped_restitution(pair, self, approach_speed, phases)

    def cost(self: SteppingMethod, system: System, frequency: float) -> MethodCost:
        """What a cycle of a frequency (Hz) takes on a system."""
        kind = "modal" if system.is_diagonal else "physical"
        steps = 1e-9 * max(system.dofs, 4) / (frequency * self.dt)
        return MethodCost(NANOSECONDS[kind] * steps, WITHOUT_BALLS * BESIDE_OTHERS[kind] * steps, CYCLE, AT_ONCE)

    def run(
        self: SteppingMethod, system: System, excitation: Excitation, duration: float, recorder: Recorder,
        initial: State, progress: Progress | None = None,
    ) -> Response:  # fmt: skip
        """One run; see `integrate`."""
        return run_steps(system, excitation, self, duration, recorder, initial, progress)

    def run_dwells(
        self: SteppingMethod, system: System, dwells: SineDwells, initial: State, observed: NDArray[np.float64],
        ledger: bool, workers: int, progress: Progress | None = None,
    ) -> SineDwellResults:  # fmt: skip
        """Many dwells side by side; see `frequency_sweep`."""
        return stepped_dwells(system, dwells, self, initial, observed, ledger, workers, progress)

    def run_cases(
        self: SteppingMethod, system: System, cases: SineCases, observed: NDArray[np.float64], instants: int,
        workers: int, progress: Progress | None = None,
    ) -> SineDwellResults:  # fmt: skip
        """Many cases side by side, each with its own gaps, laws and start; see `many_cases.run_cases`."""
        return stepped_cases(system, cases, self, observed, instants, workers, progress)
