"""A case of a convergence study, and the protocol of what a study goes over."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence.harmonic import steady_amplitude
from femimpact.errors import FemimpactError, require
from femimpact.excitation import Sine
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes, solve_modes
from femimpact.system.reduction import reduce
from femimpact.system.system import System

__all__ = ["Axis", "Case", "Plan", "Row"]


@dataclass(frozen=True, eq=False)
class Case:
    """One system of a study, with what its quantities are read of.

    Parameters
    ----------
    axis : str
        "mesh", "step" or "modes": what the study goes over.
    system : System
        Of which the linear quantities are read.
    integrated : System
        That runs with contacts integrate.
    base : Sine or None
    step : Newmark or None
        None where time is exact.
    is_limit : bool
        Whether the case is no row but what the rows tend to.
    """

    axis: str
    system: System
    integrated: System
    base: Sine | None
    step: Newmark | None = None
    is_limit: bool = False

    @cached_property
    def steady(self) -> NDArray[np.complex128]:
        """Complex amplitudes (dofs,) of the steady response without contacts."""
        if self.base is None:
            require(False, "base", None, "", "must be a Sine: a watched quantity is of the response to it")
            raise AssertionError
        return steady_amplitude(self.system, self.base, self.step)

    def modes(self, count: int) -> Modes:
        """The lowest modes of the system, computed once."""
        return _known_modes(self.system, count)


def _known_modes(system: System, count: int) -> Modes:
    key = ("convergence modes", count)
    if key not in system.derived:
        system.derived[key] = solve_modes(system, count)
    found: Modes = system.derived[key]
    return found


class Plan(NamedTuple):
    """What all cases of a study share: structure, base, and modes kept for runs with contacts (None: all dofs)."""

    structure: Structure
    base: Sine | None
    modes: int | None

    def integrated(self, system: System) -> System:
        """The system that a run integrates."""
        return system if self.modes is None else reduce(system, min(self.modes, system.dofs))


class Row(NamedTuple):
    """A row of a study before it is measured: its label, number and size, and the case or why there is none."""

    label: str
    number: float
    size: float
    case: Case | FemimpactError


@runtime_checkable
class Axis(Protocol):
    """What a study goes over: named rows from coarse to fine, and what their values tend to."""

    @property
    def name(self) -> str:
        """Name of the axis, one word."""

    @property
    def units(self) -> tuple[str, str]:
        """What `number` counts, and the unit of `size`."""

    def rows(self, plan: Plan) -> Iterator[Row]:
        """Cases from coarse to fine."""

    @property
    def is_family(self) -> bool:
        """Whether one size describes a row, so that the rows themselves can be extrapolated."""

    @property
    def ratio(self) -> float:
        """Size of the finest row over that of the limit; infinite where the limit is exact."""

    def limit(self, plan: Plan, finest: Case) -> Case:
        """A case beyond the finest row."""

    def case(self, plan: Plan, number: float) -> Case | FemimpactError | None:
        """The case of a number between the rows or beyond; None where the axis does not make one."""
