"""Convergence of an impacting response over the number of normal modes, with and without static correction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError, require
from femimpact.excitation import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.integrate import integrate
from femimpact.integrators.newmark import Newmark
from femimpact.reduction import reduce
from femimpact.response import Recorder, Response
from femimpact.structure import Position
from femimpact.system import State, System

if TYPE_CHECKING:
    import xarray

__all__ = ["ModeConvergence", "mode_convergence"]

PARTS = 8
"""Parts of the window between which statistics scatter."""

POINTS_PER_CYCLE = 64
"""Samples of a Newmark run in a base cycle: a sine's peak is met to 0.1 %."""

STATISTICS = {
    "rms": "m",
    "peak": "m",
    "contact_loss": "J",
    "structure_loss": "J",
    "damping": "1",
    "mean_impulse": "N s",
}
"""Columns that scatter, and their units."""

OTHERS = {
    "peak_force": "N",
    "residual": "1",
    "first_displacement": "m",
    "first_loss": "J",
    "displacement_error": "1",
    "loss_error": "1",
}


@dataclass(frozen=True, eq=False)
class ModeConvergence:
    """Response over the number of normal modes; columns are (n, 2): without and with static correction.

    Parameters
    ----------
    counts : ndarray (n,)
        Normal modes; the correction adds one vector for every distinct contact direction.
    rms, peak : ndarray (n, 2), m
        Of the observed place, relative to the base.
    contact_loss, structure_loss : ndarray (n, 2), J
        Per base cycle.
    damping : ndarray (n, 2), 1
        Equivalent damping ratio D/(4 pi U): D all loss per cycle, U twice the mean strain energy, which is
        the largest strain energy of a sine.
    mean_impulse : ndarray (n, 2), N s
        Of one impact; not a number without impacts.
    scatter : mapping of str to ndarray (n, 2)
        Standard error of each of these from eight parts of the window; of `peak` the standard deviation of
        the parts' peaks. Differences below it mean nothing.
    peak_force : ndarray (n, 2), N
        Of a compliant law, as computed: it does not converge for short contacts. Not a number for a rigid one.
    residual : ndarray (n, 2), 1
        Energy unaccounted for over the energy put in.
    first_displacement : ndarray (n, 2), m
        Of the observed place a quarter of the first natural period after one first impact.
    first_loss : ndarray (n, 2), J
        Lost in the contact until then.
    displacement_error, loss_error : ndarray (n, 2), 1
        Of these two, relative to the largest count with static correction.
    displacement_order, loss_order : ndarray (2,), 1
        Fitted exponent with which the error falls with the count; counts near the largest flatter it.
    at, law : str
    cycles : int
        In the window of the statistics.
    notes : tuple of str
    """

    counts: NDArray[Any]
    rms: NDArray[Any]
    peak: NDArray[Any]
    contact_loss: NDArray[Any]
    structure_loss: NDArray[Any]
    damping: NDArray[Any]
    mean_impulse: NDArray[Any]
    scatter: Mapping[str, NDArray[Any]]
    peak_force: NDArray[Any]
    residual: NDArray[Any]
    first_displacement: NDArray[Any]
    first_loss: NDArray[Any]
    displacement_error: NDArray[Any]
    loss_error: NDArray[Any]
    displacement_order: NDArray[Any]
    loss_order: NDArray[Any]
    at: str
    law: str
    cycles: int
    notes: tuple[str, ...]

    def to_xarray(self) -> xarray.Dataset:
        """All columns as a labelled dataset over the count and the static correction."""
        import xarray

        dims = ("modes", "static_correction")
        data: dict[str, Any] = {}
        for name, unit in (STATISTICS | OTHERS).items():
            labels = {"units": unit, "long_name": name.replace("_", " ")}
            data[name] = (dims, np.array(getattr(self, name)), labels)
            if name in self.scatter:
                labels = {"units": unit, "long_name": f"scatter of {labels['long_name']}"}
                data[f"{name}_scatter"] = (dims, np.array(self.scatter[name]), labels)
        for name in ("displacement_order", "loss_order"):
            data[name] = (dims[1], np.array(getattr(self, name)), {"units": "1", "long_name": name.replace("_", " ")})
        coords = {"modes": np.array(self.counts), "static_correction": np.array([False, True])}
        attributes = {"at": self.at, "contact_law": self.law, "cycles": self.cycles, "notes": "; ".join(self.notes)}
        return xarray.Dataset(data, coords=coords, attrs=attributes)


def mode_convergence(
    system: System,
    excitation: Sine,
    method: EventDriven | Newmark,
    duration: float,
    counts: Sequence[int],
    *,
    at: Position | None = None,
) -> ModeConvergence:
    """What the number of kept modes does to an impacting response, with and without static correction.

    Two questions are kept apart. The statistics are of a whole run from rest, over its last third;
    impacting motion is often chaotic, two counts then never give the same history, and only differences
    beyond the scatter say something: take a long duration. The first impact is one event from one state,
    the same for every count, and does converge.

    Parameters
    ----------
    system : System
        In physical dofs, with contacts.
    excitation : Sine
    method : EventDriven or Newmark
        The first for rigid contacts only.
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

    Notes
    -----
    The first impact: the structure undeformed and at rest on a base at rest; the first ball leaves its
    wall's side 1e-6 of its clearance away from the wall with a speed of one clearance per first natural
    period. A stop, which has no ball, is met by the structure in its first mode, from no deflection, at
    twice the speed that just reaches it. Both states are exact on any number of modes.
    """
    numbers = np.array(counts, dtype=int)
    rising = numbers.size >= 3 and bool(np.all(np.diff(numbers) > 0))
    require(rising, "counts", list(counts), "", "must be three or more increasing numbers")
    require(len(system.contacts) > 0, "system.contacts", 0, "", "must be one or more: without impacts modes decouple")
    require(system.first_frequency > 0.0, "system", 0.0, "Hz", "must be held: a first natural frequency > 0")
    cycles = PARTS * math.floor(duration * excitation.frequency / (3 * PARTS) + 1e-9)
    least = 3 * PARTS / excitation.frequency
    require(cycles > 0, "duration", duration, "s", f"must be >= {least:.4g} s, 24 base cycles")
    place = system.default_place if at is None else at
    columns: dict[str, Any] = {name: np.full((numbers.size, 2), np.nan) for name in (*STATISTICS, *OTHERS)}
    scatter = {name: np.full((numbers.size, 2), np.nan) for name in STATISTICS}
    notes = []
    for case in np.ndindex(numbers.size, 2):
        reduced = reduce(system, int(numbers[case[0]]), static_correction=bool(case[1]))
        try:
            values, spread = _statistics(reduced, excitation, method, duration, place, cycles)
            values |= _first_impact(reduced, method, place)
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
    notes += _notes(columns, laws, cycles)
    return ModeConvergence(numbers, **columns, **orders, scatter=scatter, at=str(place), law=laws, cycles=cycles,
                           notes=tuple(notes))  # fmt: skip


def _statistics(
    system: System, excitation: Sine, method: EventDriven | Newmark, duration: float, at: Position, cycles: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Values over the last `cycles` of a run, and their scatter between parts of it."""
    every = 1
    if isinstance(method, Newmark):
        every = max(math.floor(1.0 / (POINTS_PER_CYCLE * excitation.frequency * method.dt)), 1)
    keep = Recorder(channels=(at,), every=every, impacts=1_000_000)
    run = integrate(system, excitation, method, duration, keep)
    period = 1.0 / excitation.frequency
    edges = run.time[-1] - period * cycles * np.linspace(1.0, 0.0, PARTS + 1)
    whole = _over(run, at, edges[0], edges[-1], cycles)
    pieces = [_over(run, at, *ends, cycles // PARTS) for ends in pairwise(edges)]
    spread = {}
    for name in STATISTICS:
        parts = np.array([piece[name] for piece in pieces])
        parts = parts[np.isfinite(parts)]
        error = float(np.std(parts, ddof=1)) if parts.size > 1 else math.nan
        spread[name] = error if name == "peak" else error / math.sqrt(max(parts.size, 1))
    assert run.energy is not None
    return whole | {"peak_force": run.statistics.peak_force, "residual": run.energy.residual}, spread


def _over(run: Response, at: Position, start: float, end: float, cycles: int) -> dict[str, float]:
    """Statistics of a run between two instants (s), a whole number of base cycles apart."""
    ledger = run.energy
    assert ledger is not None
    # half a sample of slack: an edge on a sample must not belong to both sides or to none
    slack = 0.5 * float(run.time[1] - run.time[0])
    inside = (run.time > start + slack) & (run.time <= end + slack)
    w = run[at][inside]
    contact, structure = (
        float(np.diff(np.interp((start, end), run.time, loss))[0]) / cycles
        for loss in (ledger.contact_loss, ledger.structure_loss)
    )
    strain = 2.0 * float(np.mean(ledger.strain[inside]))
    chosen = (run.impacts.time > start) & (run.impacts.time <= end)
    impulse = np.abs(run.impacts.impulse[chosen])
    return {
        "rms": float(np.sqrt(np.mean(w**2))),
        "peak": float(np.max(np.abs(w))),
        "contact_loss": contact,
        "structure_loss": structure,
        "damping": (contact + structure) / (4.0 * math.pi * strain) if strain > 0.0 else math.nan,
        "mean_impulse": float(impulse.mean()) if impulse.size else math.nan,
    }


def _first_impact(system: System, method: EventDriven | Newmark, at: Position) -> dict[str, float]:
    """Displacement and loss a quarter of the first period after one impact from a given state."""
    quiet = Sine(0.0, system.first_frequency)
    state, until = _before_impact(system)
    if isinstance(method, EventDriven):
        method = replace(method, samples_per_cycle=max(256, method.samples_per_cycle))
    run = integrate(system, quiet, method, until + 0.5 / quiet.frequency, Recorder(channels=(at,)), state)
    require(len(run.impacts) > 0, "system.contacts", system.contacts[0].name, "", "is not met by the first impact")
    after = float(run.impacts.time[0]) + 0.25 / quiet.frequency
    assert run.energy is not None
    return {
        "first_displacement": float(np.interp(after, run.time, run[at])),
        "first_loss": float(np.interp(after, run.time, run.energy.contact_loss)),
    }


def _before_impact(system: System) -> tuple[State, float]:
    """A state shortly before the first pair meets a wall, and a time (s) by which it has."""
    pair = system.contacts[0]
    side = 1.0 if pair.gaps[0] <= pair.gaps[1] else -1.0
    near = min(pair.gaps)
    if pair.is_stop:
        # x = -b u, so the first mode moves towards the stop with -side b
        speed = 2.0 * max(near, 1e-6) * 2.0 * math.pi * system.first_frequency
        velocity = np.zeros(system.dofs)
        velocity[0] = -side * speed / float(pair.direction[0])
        return State(velocity=velocity), 0.25 / system.first_frequency
    clearance = sum(pair.gaps) if math.isfinite(sum(pair.gaps)) else max(near, 1e-6)
    place, rate = np.zeros((2, len(system.balls)))
    place[0] = side * (near - 1e-6 * clearance)
    rate[0] = side * clearance * system.first_frequency
    return State(ball_displacement=place, ball_velocity=rate), 1e-5 / system.first_frequency


def _errors(counts: NDArray[Any], columns: dict[str, Any]) -> dict[str, NDArray[Any]]:
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


def _order(counts: NDArray[Any], error: NDArray[Any]) -> float:
    usable = np.isfinite(error) & (error > 0.0)
    if np.count_nonzero(usable) < 2:
        return math.nan
    return -float(np.polyfit(np.log(counts[usable]), np.log(error[usable]), 1)[0])


def _notes(columns: Mapping[str, NDArray[Any]], laws: str, cycles: int) -> list[str]:
    notes = [
        f"statistics over the last {cycles} base cycles; differences below the scatter mean nothing",
        "first impact: errors against the largest count with static correction",
    ]
    forces = columns["peak_force"]
    if np.any(forces > 0.0):
        low, high = np.nanmin(forces), np.nanmax(forces)
        notes.append(
            f"peak force ({laws}): {low:.4g} to {high:.4g} N over the counts; it does not converge with the modes of "
            "a beam for short contacts, and no order is given"
        )
    return notes
