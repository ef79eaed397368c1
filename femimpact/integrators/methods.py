"""Protocol of a method of time integration, and the methods by the names of a study file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import kind_of, require
from femimpact.excitation import Excitation
from femimpact.integrators.cases import AchievedRestitution, MethodCost, SineCases, SineDwellResults, SineDwells
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.stepping.newmark import HHT, WBZ, GeneralizedAlpha, MoreauJean, Newmark
from femimpact.progress import Progress
from femimpact.response.response import Recorder, Response
from femimpact.system.contact_pair import ContactPair
from femimpact.system.state import State
from femimpact.system.system import System


class Method(Protocol):
    """A method of time integration, from a system and an excitation to a response.

    A user's class with these members is a method like those of `METHODS`; one with steps of the Newmark
    family has them all from `stepping.newmark.SteppingMembers` but its scheme.
    """

    @classmethod
    def for_system(cls, system: System, **settings: Any) -> Self:
        """The method with some of its fields given, and the others as they suit the system."""

    @property
    def unit(self) -> str:
        """Name of the instants at which a run can be read: "steps" or "samples"."""

    def description(self, frequency: float, origin: str) -> str:
        """Words for its scheme and step under a drive of a frequency (Hz); `origin` says where fields come from."""

    def check(self, system: System) -> tuple[str, ...]:
        """Warnings on a system; `InputError` for one that the method does not take."""

    def check_drive(self, frequencies: NDArray[np.float64], key: str) -> None:
        """Raise `InputError`, naming the key, for frequencies of the drive (Hz) that the method does not resolve."""

    def notes(self, system: System) -> tuple[str, ...]:
        """Notes on what of a system the method does not follow."""

    def time_grid(self, frequency: float) -> float:
        """Time (s) between the instants at which a run under a sine of a frequency (Hz) can be read."""

    def interval(self, system: System, excitation: Excitation, duration: float, recorder: Recorder) -> float:
        """Time (s) between the instants at which a run of a duration (s) can be read; the recorder may set it."""

    def stride(self, frequency: float, points: int) -> int:
        """Every how many of these instants are kept where about so many points of a cycle are wanted."""

    def read_at_least(self, samples: int) -> Self:
        """The same motion, read at so many instants of a base cycle or more where they can be chosen."""

    def achieved_restitution(
        self, pair: ContactPair, approach_speed: float, phases: int = 32
    ) -> AchievedRestitution | None:
        """Restitution of a collision at a speed (m/s) with the method's step; None where it has none for the law."""

    def cost(self, system: System, frequency: float) -> MethodCost:
        """Time and memory that one cycle of a frequency (Hz) takes on a system."""

    def run(
        self, system: System, excitation: Excitation, duration: float, recorder: Recorder, initial: State,
        progress: Progress | None = None,
    ) -> Response:  # fmt: skip
        """One run of a duration (s); see `integrate`."""


class DwellMethod(Method, Protocol):
    """A user's method that takes dwells of one system from one state, with one base amplitude."""

    def run_dwells(
        self, system: System, dwells: SineDwells, initial: State, observed: NDArray[np.float64], ledger: bool,
        workers: int, progress: Progress | None = None,
    ) -> SineDwellResults:  # fmt: skip
        """Many dwells, read at a place by its row (dofs,), on so many threads; see `frequency_sweep`."""


class CaseMethod(Method, Protocol):
    """A method that also takes cases with different gaps, contact laws and starts in one call."""

    def run_cases(
        self, system: System, cases: SineCases, observed: NDArray[np.float64], instants: int, workers: int,
        progress: Progress | None = None,
    ) -> SineDwellResults:  # fmt: skip
        """Many dwells of one system; see `runs.run_cases`."""


METHODS: Mapping[str, type[Method]] = {
    "newmark": Newmark,
    "hht": HHT,
    "wbz": WBZ,
    "generalized-alpha": GeneralizedAlpha,
    "moreau-jean": MoreauJean,
    "event-driven": EventDriven,
}
"""Methods by the name that a study file gives them."""

MEMBERS = tuple(name for name in vars(Method) if not name.startswith("_"))
"""Members that a value must have to be a method, beside one of `run_cases` and `run_dwells`."""


def require_method(method: object) -> None:
    """Raise `InputError`, naming the missing members, unless the value has all members of a method."""
    *others, last = (noun.__name__ for noun in METHODS.values())
    allowed = f"must be a {', '.join(others)} or {last}"
    needed = MEMBERS if hasattr(method, "run_cases") else (*MEMBERS, "run_dwells")
    missing = [name for name in needed if not hasattr(method, name)]
    if missing and len(missing) < len(needed):
        allowed += f", or a method of your own that also has {', '.join(missing)}"
    require(not missing and not isinstance(method, type), "method", kind_of(method), "", allowed)
