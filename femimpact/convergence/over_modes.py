"""Convergence of an impacting response over the number of normal modes, with and without static correction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence.measure import PARTS, first_impact, run_statistics
from femimpact.convergence.result import OTHERS, STATISTICS, ModeConvergence
from femimpact.errors import DivergenceError, checked, quantity, require, require_type, rising_numbers
from femimpact.excitation import Sine
from femimpact.integrators.methods import Method
from femimpact.structure.structure import Position
from femimpact.system.reduction import reduce
from femimpact.system.system import System

__all__ = ["mode_convergence"]

Array = NDArray[np.float64]

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
