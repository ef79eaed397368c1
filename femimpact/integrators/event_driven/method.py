"""The event-driven method as a value, with the members of `integrators.methods.Method`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, quantity
from femimpact.excitation.excitation import Excitation
from femimpact.integrators.cases import AchievedRestitution
from femimpact.integrators.event_driven.dwells import event_driven_cases
from femimpact.integrators.event_driven.loop_data import check_events, reading_grid
from femimpact.integrators.event_driven.run import run_events
from femimpact.response.response import Recorder
from femimpact.system.contact_pair import ContactPair
from femimpact.system.system import System


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

    closure: float = field(default=1e-12, metadata=quantity("m", above=0.0))
    samples_per_cycle: int = field(default=64, metadata=quantity("1", at_least=8, at_most=1_000_000, integer=True))
    most_events: int = field(default=1_000_000, metadata=quantity("1", at_least=10, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def for_system(cls, system: System, **settings: Any) -> Self:
        """The method with these settings: nothing in it depends on the system."""
        return cls(**settings)

    def check(self, system: System) -> tuple[str, ...]:
        """No warnings; an error for a system that cannot be computed exactly."""
        check_events(system)
        return ()

    def check_drive(self, frequencies: NDArray[np.float64], key: str) -> None:
        """Any frequency of the drive will do."""

    def notes(self, system: System) -> tuple[str, ...]:
        """None: every mode is followed."""
        return ()

    def time_grid(self, system: System, excitation: Excitation, duration: float, recorder: Recorder) -> float:
        """Time (s) between the readings of a run; see `loop_data.reading_grid`."""
        return reading_grid(system, excitation, self, duration, recorder).interval

    def achieved_restitution(
        self, pair: ContactPair, approach_speed: float, phases: int = 32
    ) -> AchievedRestitution | None:
        """None: the law's, no step comes between."""
        return None

    run = run_events
    run_cases = event_driven_cases
