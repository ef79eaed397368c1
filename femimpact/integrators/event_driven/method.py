"""The event-driven method as a value, with the members of `integrators.methods.Method`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, quantity
from femimpact.excitation import Excitation
from femimpact.integrators.cases import AchievedRestitution, MethodCost, SineCases, SineDwellResults
from femimpact.integrators.event_driven.dwells import event_driven_cases
from femimpact.integrators.event_driven.loop_data import check_events, reading_grid
from femimpact.integrators.event_driven.run import run_events
from femimpact.progress import Progress
from femimpact.response.response import Recorder, Response
from femimpact.system.contact_pair import ContactPair
from femimpact.system.state import State
from femimpact.system.system import System

CYCLE_SECONDS = 5e-5
"""Rough cost of one base cycle with a few modes, on one core of a 2024 server."""

CYCLE = 150.0
"""Bytes of a base cycle of a case of a sweep."""

AT_ONCE = 64
"""Cases of a sweep that are in memory together on each thread."""


@dataclass(frozen=True)
class EventDriven:
    """Exact motion between impacts and through Kelvin-Voigt contacts: no step, nothing to tune.

    Between events every mode and every ball moves in closed form. The first crossing of a gap is
    approached by times in which a bound on the motion excludes one, so that none is missed, and
    met to rounding. A rigid impact changes the relative speed v to -e v by an impulse
    (1 + e) v/(1/m + b^T M^-1 b). Impacts at the same instant are solved together, over all pairs that
    close or rest at their walls, those that stick among them: impulses p >= 0 and u+ + e u- >= 0, one
    of both zero for each pair (Moreau, 1988). What separates is looked at again afterwards. The energy
    does not grow, and the order of the pairs does not matter.

    While the force of a Kelvin-Voigt contact pushes, structure, ball and wall are one linear system with a
    closed form. The contact ends where its force k p + c p' would turn into a pull; what the wall has
    stored by then is lost as it springs back behind the ball. Rigid and Kelvin-Voigt contacts may be mixed.

    Parameters
    ----------
    closure : float, m
        For rigid contacts. A bounce that would rise no higher is the last: the pair is captured, its momentum handed
        over, and sticks to its wall until the contact force changes sign. What is left out is a
        displacement below the closure and the energy m_eff v^2/2 of that bounce, which is counted as
        loss; the accumulation's end, 2 v/(a (1 - e)) later, is the start in the table of sticking phases.
    samples_per_cycle : int
        Grid on which channels, rms, harmonics and the ledger are read under a sine; neither events nor the peak of a
        cycle nor the largest contact force, which are exact, depend on it. `Recorder.interval` takes its place. A
        chirp, a stepped sine, and sums and several drives of these and sines, are read at as many instants of their
        shortest cycle. Another drive by samples is read at their interval, or at 1/20 of the period of the highest
        kept mode where that is less. There are no more than 10^6 instants; a note of the response says which.
    most_events : int
        Impacts and changes of contact for each base cycle, on average over what is computed at once,
        beyond which a run is given up.
    """

    takes_several_systems: ClassVar[bool] = True
    """True: `run_cases` takes cases with different systems."""

    closure: float = field(default=1e-12, metadata=quantity("m", above=0.0))
    samples_per_cycle: int = field(default=64, metadata=quantity("1", at_least=8, at_most=1_000_000, integer=True))
    most_events: int = field(default=1_000_000, metadata=quantity("1", at_least=10, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def for_system(cls, system: System, **settings: Any) -> Self:
        """The method with these settings: nothing in it depends on the system."""
        return cls(**settings)

    @property
    def unit(self) -> str:
        """Name of the instants at which a run can be read."""
        return "samples"

    def description(self, frequency: float, origin: str) -> str:
        """How it advances in time, in words: at no step that a frequency of the drive (Hz) would tell."""
        return "exact between impacts and through compliant ones"

    def check(self, system: System) -> tuple[str, ...]:
        """No warnings; an error for a system that cannot be computed exactly."""
        check_events(system)
        return ()

    def check_drive(self, frequencies: NDArray[np.float64], key: str) -> None:
        """Any frequency of the drive will do."""

    def notes(self, system: System) -> tuple[str, ...]:
        """None: every mode is followed."""
        return ()

    def time_grid(self, frequency: float) -> float:
        """Time (s) between readings under a sine of a frequency (Hz)."""
        return 1.0 / (frequency * self.samples_per_cycle)

    def interval(self, system: System, excitation: Excitation, duration: float, recorder: Recorder) -> float:
        """Time (s) between the readings of a run; see `loop_data.reading_grid`."""
        return reading_grid(system, excitation, self, duration, recorder).interval

    def stride(self, frequency: float, points: int) -> int:
        """One: the grid of readings was chosen, and all of it is kept."""
        return 1

    def read_at_least(self, samples: int) -> Self:
        """The same motion, read at so many instants of a base cycle or more."""
        return replace(self, samples_per_cycle=max(samples, self.samples_per_cycle))

    def achieved_restitution(
        self, pair: ContactPair, approach_speed: float, phases: int = 32
    ) -> AchievedRestitution | None:
        """None: the law's, no step comes between."""
        return None

    def cost(self, system: System, frequency: float) -> MethodCost:
        """Time and memory that a cycle takes on a system."""
        return MethodCost(CYCLE_SECONDS, CYCLE_SECONDS, CYCLE, AT_ONCE)

    def run(
        self, system: System, excitation: Excitation, duration: float, recorder: Recorder, initial: State,
        progress: Progress | None = None,
    ) -> Response:  # fmt: skip
        """One run; see `integrate`."""
        return run_events(system, excitation, self, duration, recorder, initial, progress)

    def run_cases(
        self, system: System, cases: SineCases, observed: NDArray[np.float64], instants: int, workers: int,
        progress: Progress | None = None,
    ) -> SineDwellResults:  # fmt: skip
        """Results of many sine dwells, each with a system, start, gaps and laws of its case; see `runs.run_cases`."""
        return event_driven_cases(system, cases, self, observed, instants, workers, progress)
