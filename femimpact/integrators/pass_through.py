"""One event-driven run through compliant contacts, or without any, piece by piece."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError, require
from femimpact.integrators.compliant import compliant_forms
from femimpact.integrators.event_driven import Outputs
from femimpact.integrators.event_state import EventRun, kept_rows, piece_of, require_finite
from femimpact.integrators.kernels.forms import FREE
from femimpact.integrators.passing import Passing, energy_now, new_books, new_passing, pass_on
from femimpact.integrators.threads import Progress

__all__ = ["pass_through"]


def pass_through(
    run: EventRun, position: NDArray[Any], velocity: NDArray[Any], samples: int, progress: Progress | None,
    after_piece: Callable[[], None],
) -> None:  # fmt: skip
    """Fly from the given coordinates at t = 0 to the last sample; see `run_event_driven`.

    Raises
    ------
    InputError
        For a drive given by samples.
    DivergenceError
        If changes of contact do not end.
    """
    allowed = "must be a sine for EventDriven with Kelvin-Voigt contacts; Newmark takes a recorded base"
    require(run.drive.samples is None, "excitation", "RecordedBase", "", allowed)
    state = position[None], velocity[None]
    passing, books = _start(run, *state)
    outputs = run.outputs
    if run.keep.every and run.keep.first == 0:
        run.samples.append((outputs.position @ position + outputs.rate @ velocity)[None, :])
        if run.ledger:
            run.energy.append(energy_now(run.system, passing.found, *state))
    if run.keep.snapshots and run.keep.first_snapshot == 0:
        run.fields.append(np.array([[position, velocity]]))
    per_cycle = run.method.samples_per_cycle
    done, piece, most = 0, piece_of(run), float(run.method.most_events)
    while done < samples:
        count = min(piece, samples - done)
        kept, shown = kept_rows(run, done, count)
        rows = (int(kept.max()) + 1) if run.ledger else 0
        energy = np.zeros((1, rows, books.energy.shape[2]))
        fields = np.zeros((int(shown.max()) + 1, 2, position.size))
        reading = passing.reading._replace(
            values=np.zeros((1, count, len(outputs.force) + 1)),
            origin=np.array([done]),
            cycles=np.zeros((1, count // per_cycle, passing.reading.cycles.shape[2])),
        )
        own = books._replace(kept=kept, shown=shown, energy=energy, fields=fields)
        one, flown = np.array([0]), replace(passing, reading=reading, books=own)
        changes = np.array([most * max(count // per_cycle, 1)])
        pass_on(flown, one, np.array([done]), np.array([done + count]), changes)
        _check(passing, run)
        require_finite(reading.values, (done + count) * run.interval)
        run.cycles.append(reading.cycles[0])
        # the rate of the observed place is for the statistics only
        run.samples.append(np.delete(reading.values[0][kept >= 0], 1, axis=1))
        run.energy.append(energy[0])
        run.fields.append(fields)
        done += count
        run.contact.totals[:] = passing.way.totals[0]
        run.contact.tally[0] = books.tally[0]
        run.rounding = float(books.sums[0, 2])
        run.touching = tuple(int(j) for j in np.flatnonzero(passing.way.mode[0] != FREE))
        after_piece()
        if progress is not None:
            progress(done / samples)


def _start(run: EventRun, position: NDArray[Any], velocity: NDArray[Any]) -> tuple[Passing, Any]:
    """The case at t = 0, and its ledger, which writes into the run's table of impacts."""
    found = compliant_forms(run.system, run.drive)
    rows, rates = run.outputs.position, run.outputs.rate
    # the rate of the observed place comes second
    outputs = Outputs(
        np.insert(rows, 1, rates[0], axis=0), np.insert(rates, 1, rows[0], axis=0),
        (run.outputs.force[0], -1, *run.outputs.force[1:]),
    )  # fmt: skip
    window = np.array([run.contact.window])
    per_cycle = run.method.samples_per_cycle
    passing = new_passing(run.system, found, [run.drive], outputs, per_cycle, 0, 0, window, position, velocity)
    none = np.zeros(0, dtype=np.int64)
    books = new_books(run.system, found, run.drive, none, none, 0, 1, 0, 0)
    return passing, books._replace(impacts=run.contact.impacts)


def _check(passing: Passing, run: EventRun) -> None:
    if np.isfinite(passing.stuck[0]):
        raise DivergenceError(
            f"contacts at t = {passing.stuck[0]:.6g} s do not resolve within {run.method.most_events} changes a cycle: "
            "raise most_events, or check gaps that leave no clearance"
        )
