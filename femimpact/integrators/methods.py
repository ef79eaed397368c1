"""Protocol of a method of time integration, the methods by the names of a study file, and what a step costs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol, Self, cast

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import kind_of, require
from femimpact.excitation.excitation import Excitation
from femimpact.integrators.assembly import MethodRun
from femimpact.integrators.cases import AchievedRestitution, SineCases, SineDwellResults
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.stepping.newmark import HHT, WBZ, GeneralizedAlpha, MoreauJean, Newmark
from femimpact.progress import Progress
from femimpact.response.response import Recorder
from femimpact.system.contact_pair import ContactPair
from femimpact.system.state import State
from femimpact.system.system import System


class Method(Protocol):
    """A method of time integration, from a system and an excitation to what a response is made of.

    A user's class with these members is a method like those of `METHODS`; one with steps of the Newmark
    family has them all from `stepping.newmark.SteppingMembers` but its scheme. A method with a step has it as `dt`, s.
    """

    @classmethod
    def for_system(cls, system: System, **settings: Any) -> Self:
        """The method with some of its fields given, and the others as they suit the system."""

    def check(self, system: System) -> tuple[str, ...]:
        """Warnings on a system; `InputError` for one that the method does not take."""

    def check_drive(self, frequencies: NDArray[np.float64], key: str) -> None:
        """Raise `InputError`, naming the key, for frequencies of the drive (Hz) that the method does not resolve."""

    def notes(self, system: System) -> tuple[str, ...]:
        """Notes on what of a system the method does not follow."""

    def time_grid(self, system: System, excitation: Excitation, duration: float, recorder: Recorder) -> float:
        """Time (s) between the instants at which a run of a duration (s) can be read; the recorder may set it."""

    def run(
        self, system: System, excitation: Excitation, duration: float, recorder: Recorder, initial: State,
        progress: Progress | None = None,
    ) -> MethodRun:  # fmt: skip
        """One run of a duration (s) on a system that `check` has taken; `integrate` makes its response of it."""

    def run_cases(
        self, system: System, cases: SineCases, observed: NDArray[np.float64], instants: int, workers: int,
        progress: Progress | None = None,
    ) -> SineDwellResults:  # fmt: skip
        """Results of all cases in their order, read at a place by its row (dofs,), on so many threads.

        `instants` is at how many of a measured cycle the energy ledger is read; 0 for no ledger. `InputError` where a
        case cannot be run at all. One that runs case by case is `own_method.run_cases_apart`.
        """

    def achieved_restitution(
        self, pair: ContactPair, approach_speed: float, phases: int = 32
    ) -> AchievedRestitution | None:
        """Restitution of a collision at a speed (m/s) with the method's step; None where it has none for the law."""


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
"""Members that a value must have to be a method."""


def require_method(method: object) -> None:
    """Raise `InputError`, naming the missing members, unless the value has all members of a method."""
    *others, last = (noun.__name__ for noun in METHODS.values())
    allowed = f"must be a {', '.join(others)} or {last}"
    missing = [name for name in MEMBERS if not hasattr(method, name)]
    if missing and len(missing) < len(MEMBERS):
        allowed += f", or a method of your own that also has {', '.join(missing)}"
    require(not missing and not isinstance(method, type), "method", kind_of(method), "", allowed)


# ---- what follows from a method's step ---------------------------------------------------------------


def step_of(method: Method) -> float | None:
    """The step (s) of a method that has one."""
    return getattr(method, "dt", None)


def stride_of(method: Method, frequency: float, points: int) -> int:
    """Every how many instants of a run are kept where about so many points of a cycle (Hz) are wanted.

    All of them without a step: the grid of readings was chosen.
    """
    step = step_of(method)
    return 1 if step is None else max(math.floor(1.0 / (points * frequency * step)), 1)


def read_at_least(method: Method, samples: int) -> Method:
    """The same motion, read at so many instants of a base cycle or more where they can be chosen."""
    least = getattr(method, "samples_per_cycle", samples)
    changes: Any = {} if least >= samples else {"samples_per_cycle": samples}
    return replace(cast(Any, method), **changes) if changes else method


NANOSECONDS, BESIDE_OTHERS = {"modal": 9.0, "physical": 20.0}, {"modal": 2.5, "physical": 20.0}
"""Rough cost of one dof and step on one core of a 2024 server, of a run alone and of one of many."""

WITHOUT_BALLS = 1.5
"""Time of a sweep with balls and of the one without them, over that of the first."""

CYCLE_SECONDS = 5e-5
"""Rough cost of one base cycle with a few modes where there is no step."""

AT_ONCE = 64
"""Cases of a sweep that are in memory together on each thread."""


def seconds_of_cycle(method: Method, system: System, frequency: float, *, sweep: bool = False) -> float:
    """Time (s) that a base cycle of a frequency (Hz) takes in a run, or in a sweep with the one without balls."""
    step, kind = step_of(method), "modal" if system.is_diagonal else "physical"
    if step is None:
        return CYCLE_SECONDS
    nanoseconds = WITHOUT_BALLS * BESIDE_OTHERS[kind] if sweep else NANOSECONDS[kind]
    return 1e-9 * nanoseconds * max(system.dofs, 4) / (frequency * step)


def bytes_of_cycle(method: Method) -> float:
    """Memory that a base cycle of a case of a sweep takes."""
    return 150.0 if step_of(method) is None else 170.0
