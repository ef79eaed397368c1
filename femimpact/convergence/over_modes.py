"""Convergence of an impacting response over the number of normal modes, with and without static correction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.convergence.cases import OTHERS, PARTS, STATISTICS, Case, ModeConvergence, first_impact, run_statistics
from femimpact.convergence.quantities import Reading
from femimpact.errors import (
    DivergenceError,
    check_fields,
    checked,
    optional,
    place,
    quantity,
    require,
    require_type,
    rising_numbers,
)
from femimpact.excitation import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method
from femimpact.structure.structure import Position
from femimpact.system.reduction import reduce
from femimpact.system.system import System

UNSETTLED = 0.1
"""Share of the first impact's loss; a larger change between the last two counts is worth a note."""


def mode_convergence(
    system: System,
    excitation: Sine,
    method: Method,
    duration: float,
    counts: Sequence[int],
    *,
    at: Position | None = None,
) -> ModeConvergence:
    """What the number of kept modes does to an impacting response, with and without static correction.

    Two questions are kept apart. The statistics are of a whole run from rest, over its last third;
    impacting motion is often chaotic, two counts then never give the same history, and only differences
    beyond the scatter mean something: take a long duration. The first impact is one event from one state,
    the same for every count, and does converge: the displacement always; the loss in the contact of a rigid
    impact only where there is a body at the contact, for without one it goes over to the structure's damping as
    modes are added (a note says so).

    Parameters
    ----------
    system : System
        In physical dofs, with contacts.
    excitation : Sine
    method : EventDriven, Newmark or its family
        The first, and Moreau-Jean, for rigid contacts only.
    duration : float, s
        Of each run; its last third must hold eight base cycles.
    counts : sequence of int
        Three or more increasing numbers of modes.
    at : str or float, optional
        The observed place; the tip, or the system's first point.

    Returns
    -------
    ModeConvergence
        A run that diverged is a row of not-a-numbers, with a note.

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range, the system has no contact or is not held, or the
        duration is shorter than 24 base cycles.

    Notes
    -----
    The first impact: the structure is undeformed and at rest on a base at rest; the first ball starts 1e-6
    of its clearance before its nearer wall, at one clearance per first natural period. A stop, which has no
    ball, is met by the structure in its first mode, from no deflection, at twice the speed that just
    reaches it. Both states are exact on any number of modes.

    Examples
    --------
    >>> import femimpact as fi
    >>> full, base = fi.assemble(structure, elements=10), fi.Sine(amplitude=0.2e-3, frequency=5.0)
    >>> found = fi.mode_convergence(full, base, fi.Newmark(dt=1e-4), duration=5.0, counts=[2, 4, 8])
    >>> fi.figures.mode_convergence(found).shape  # doctest: +SKIP
    """
    require_type(system, System, "system")
    require_type(excitation, Sine, "excitation")
    duration = checked("duration", duration, quantity("s", above=0.0))
    numbers = rising_numbers("counts", counts, system.dofs)
    require(len(system.contacts) > 0, "system.contacts", 0, "", "must be one or more: without impacts modes decouple")
    require(system.first_frequency > 0.0, "system", 0.0, "Hz", "must be held: a first natural frequency > 0")
    cycles = PARTS * math.floor(duration * excitation.frequency / (3 * PARTS) + 1e-9)
    least = 3 * PARTS / excitation.frequency
    require(cycles > 0, "duration", duration, "s", f"must be >= {least:.4g} s, 24 base cycles")
    place = system.default_place if at is None else at
    # before long work
    system.point_row(place)
    columns: dict[str, Any] = {name: np.full((numbers.size, 2), np.nan) for name in (*STATISTICS, *OTHERS)}
    scatter = {name: np.full((numbers.size, 2), np.nan) for name in STATISTICS}
    notes = []
    for case in np.ndindex(numbers.size, 2):
        reduced = reduce(system, int(numbers[case[0]]), static_correction=bool(case[1]))
        try:
            values, spread = run_statistics(reduced, excitation, method, duration, place, cycles)
            values |= first_impact(reduced, method, place)
        except DivergenceError as error:
            corrected = "with" if case[1] else "without"
            notes.append(f"{numbers[case[0]]} modes {corrected} static correction: {error}")
            continue
        for name, value in values.items():
            columns[name][case] = value
        for name, value in spread.items():
            scatter[name][case] = value
    orders = _errors(numbers, columns)
    laws = ", ".join(dict.fromkeys(pair.law.name for pair in system.contacts))
    notes += _notes(columns, numbers, laws, cycles)
    return ModeConvergence(numbers, **columns, **orders, scatter=scatter, at=str(place), law=laws, cycles=cycles,
                           notes=tuple(notes))  # fmt: skip


def _errors(counts: NDArray[np.int64], columns: dict[str, Array]) -> dict[str, Array]:
    """Fill in the errors of the first impact; their orders in the count."""
    orders = {}
    for name, source in (("displacement", "first_displacement"), ("loss", "first_loss")):
        values = columns[source]
        exact = values[-1, 1]
        scale = abs(exact) if exact else 1.0
        columns[f"{name}_error"] = np.abs(values - exact) / scale
        # the largest count is its own reference
        orders[f"{name}_order"] = np.array([_order(counts[:-1], columns[f"{name}_error"][:-1, k]) for k in (0, 1)])
    return orders


def _order(counts: NDArray[np.int64], error: Array) -> float:
    usable = np.isfinite(error) & (error > 0.0)
    if np.count_nonzero(usable) < 2:
        return math.nan
    return -float(np.polyfit(np.log(counts[usable]), np.log(error[usable]), 1)[0])


def _notes(columns: Mapping[str, Array], counts: NDArray[np.int64], laws: str, cycles: int) -> list[str]:
    notes = [
        f"statistics over the last {cycles} base cycles; differences below the scatter mean nothing",
        "first impact: errors against the largest count with static correction",
    ]
    change = float(columns["loss_error"][-2, 1])
    if change > UNSETTLED:
        notes.append(
            f"loss of the first impact still changes by {100.0 * change:.3g} % from {counts[-2]} to {counts[-1]} "
            "modes: at a rigid contact without a body, more modes move it from the contact to the structure's own "
            "damping, and each impact's impulse falls; displacement and whole loss are what converges"
        )
    forces = columns["peak_force"]
    if np.any(forces > 0.0):
        low, high = np.nanmin(forces), np.nanmax(forces)
        notes.append(
            f"peak force ({laws}): {low:.4g} to {high:.4g} N over the counts; it does not converge with the modes of "
            "a beam for short contacts, and no order is given"
        )
    return notes


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
