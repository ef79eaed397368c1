"""Statistics of event-driven runs over several starts, with the scatter beyond which a difference means something."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence.cases import Case
from femimpact.convergence.measure import PARTS, run_statistics
from femimpact.convergence.quantities import Reading
from femimpact.convergence.result import STATISTICS
from femimpact.errors import check_fields, optional, place, quantity, require
from femimpact.integrators.event_driven import EventDriven
from femimpact.structure.structure import Position

__all__ = ["ContactStatistics"]


@dataclass(frozen=True)
class ContactStatistics:
    """Statistics of runs with contacts: rms and peak of a place, losses per cycle, damping, impulse of one impact.

    Impacting motion is often chaotic, and two meshes then never give the same history: what can agree are means over
    long runs. Each case is run from several phases of the base, and each value is the mean over these starts with its
    standard error. No order is fitted; a difference from the finest case within three standard errors of both means
    nothing. Rigid impacts of a bare beam have means that do depend on the mesh without end: the mass that acts
    in an impact falls with the element length (`mode_convergence`).

    Runs are event-driven over meshes and modes, and take the steps of the case over steps.

    Parameters
    ----------
    starts : int
        Phases of the base, even over a period.
    cycles : int
        Base cycles of each run, of which the last third counts.
    at : str or float, optional
        The observed place; the tip, or the system's first point.

    Raises
    ------
    InputError
        If a value is of the wrong kind or out of range.
    """

    starts: int = field(default=6, metadata=quantity("1", at_least=2, at_most=1000, integer=True))
    cycles: int = field(default=240, metadata=quantity("1", at_least=3 * PARTS, at_most=10_000_000, integer=True))
    at: Position | None = field(default=None, metadata=optional(place()))

    def __post_init__(self) -> None:
        check_fields(self)

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """A reading with its standard error for each statistic."""
        system, base = case.integrated, case.base
        if case.is_limit:
            # means over starts are compared with the finest row, and not extrapolated
            return tuple(self._reading(name, np.zeros(0)) for name in STATISTICS)
        require(len(system.contacts) > 0, "contacts", 0, "", "must be one or more for statistics of impacts")
        require(base is not None, "base", None, "", "must be a Sine: a watched quantity is of the response to it")
        assert base is not None
        at = system.default_place if self.at is None else self.at
        window = PARTS * (self.cycles // (3 * PARTS))
        found: dict[str, list[float]] = {name: [] for name in STATISTICS}
        for k in range(self.starts):
            begun = replace(base, phase=base.phase + 2.0 * math.pi * k / self.starts)
            method = case.step or EventDriven()
            values, _ = run_statistics(system, begun, method, self.cycles / base.frequency, at, window)
            for name, kept in found.items():
                kept.append(values[name])
        return tuple(self._reading(name, np.array(values)) for name, values in found.items())

    def _reading(self, name: str, values: NDArray[np.float64]) -> Reading:
        known = values[np.isfinite(values)]
        if known.size < 2:
            return Reading(name.replace("_", " "), STATISTICS[name], math.nan, math.nan)
        error = float(np.std(known, ddof=1) / math.sqrt(known.size))
        # equal to rounding is no scatter of chance; a difference below the digits of a run means nothing either
        least = 1e-12 * float(np.abs(known).max())
        return Reading(
            name.replace("_", " "), STATISTICS[name], float(known.mean()), math.nan, scatter=max(error, least)
        )
