"""Flights through compliant contacts: from the initial states of many cases to what is read of them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compliant import Compliant, reading_of, waves_of
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_driven import Outputs, new_flight, new_search
from femimpact.integrators.kernels.books import Books
from femimpact.integrators.kernels.forms import CONTACT, FREE, REBOUND, Waves
from femimpact.integrators.kernels.passage import Journey, Reading, fly_cases
from femimpact.integrators.layout import ENERGY_COLUMNS, IMPACT_COLUMNS, TOTAL_COLUMNS
from femimpact.system import System

__all__ = ["Passing", "energy_now", "new_books", "new_passing", "pass_on"]

LINE = 64
"""Bytes of a cache line."""


@dataclass(frozen=True, eq=False)
class Passing:
    """Arrays of some cases on their way; the kernel writes into them.

    Parameters
    ----------
    found : Compliant
    waves : Waves
    reading : Reading
    way : Journey
    stuck : ndarray (cases,), s
        When changes of contact did not end, else infinite.
    books : Books or None
    """

    found: Compliant
    waves: Waves
    reading: Reading
    way: Journey
    stuck: NDArray[Any]
    books: Books | None


def new_passing(
    system: System, found: Compliant, drives: Sequence[Drive], outputs: Outputs, per_cycle: int, samples: int,
    cycles: int, window: NDArray[Any], position: NDArray[Any], velocity: NDArray[Any],
) -> Passing:  # fmt: skip
    """Cases at t = 0, without a ledger.

    Parameters
    ----------
    system : System
    found : Compliant
    drives : sequence of Drive
        One for each case.
    outputs : Outputs
        The first is the observed place, the second its rate.
    per_cycle : int
        Samples of a base cycle.
    samples, cycles : int
        Most samples that one call keeps of a case, and cycles of which it keeps statistics.
    window : ndarray (cases, 2), s
        In which impacts are counted.
    position, velocity : ndarray (cases, d)
        Structure and balls relative to the base, m and m/s.

    Returns
    -------
    Passing
    """
    waves = waves_of(system, found, drives)
    interval = 2.0 * np.pi / (waves.omega * per_cycle)
    reading = reading_of(system, found, waves, outputs, interval, samples, per_cycle, cycles)
    # sums case by case: a matrix product may round differently with the number of rows
    reading.last[:] = (position[:, None] * outputs.position[:2] + velocity[:, None] * outputs.rate[:2]).sum(axis=2)
    forms, pairs, cases = found.forms, len(system.contacts), len(drives)
    entries = forms.exponent.shape[1]
    mode = _modes(system, found, position, velocity)
    number = (np.where(np.abs(mode) == CONTACT, np.where(mode > 0, 1, 2), 0) * 3 ** np.arange(pairs)).sum(axis=1)
    turned = waves.harmonic[np.arange(cases), number] * np.exp(1j * waves.phase)[:, None]
    p = position - forms.static[number] - turned.real
    v = velocity + waves.omega[:, None] * turned.imag
    way = Journey(
        entry=(forms.to_entry_u[number] * p[:, None] + forms.to_entry_v[number] * v[:, None]).sum(axis=2),
        particle=(forms.to_particle[number] * p[:, None]).sum(axis=2),
        particle_rate=(forms.to_particle[number] * v[:, None]).sum(axis=2),
        clock=np.stack([np.zeros(cases), np.zeros(cases), np.zeros(cases), waves.phase], axis=1),
        mode=mode,
        tally=np.zeros((cases, 3), dtype=np.int64),
        window=np.array(window, dtype=float),
        totals=np.zeros((cases, len(TOTAL_COLUMNS), pairs)),
        touch=np.zeros((cases, 6, pairs)),
        state=np.zeros((2, position.shape[1])),
        turn=np.zeros((2, entries + 1), dtype=complex),
    )
    return Passing(
        found=found,
        waves=waves,
        reading=reading,
        way=way,
        stuck=np.full(cases, np.inf),
        books=None,
    )


def _modes(system: System, found: Compliant, position: NDArray[Any], velocity: NDArray[Any]) -> NDArray[Any]:
    """What each pair does at the start: FREE, or CONTACT or REBOUND at a wall, (cases, pairs)."""
    x, rate = (-(values[:, None] * found.equations.force.T).sum(axis=2) for values in (position, velocity))
    mode = np.full(x.shape, float(FREE))
    for j, pair in enumerate(system.contacts):
        for side, gap in zip((1.0, -1.0), pair.gaps, strict=True):
            depth = side * x[:, j] - gap
            force = pair.parameters.stiffness * depth + pair.parameters.damping * side * rate[:, j]
            mode[:, j] = np.where(depth > 0.0, side * np.where(force > 0.0, CONTACT, REBOUND), mode[:, j])
    return mode


def new_books(
    system: System, found: Compliant, drive: Drive, kept: NDArray[Any], shown: NDArray[Any], rows: int, cases: int,
    most_impacts: int, snapshots: int,
) -> Books:  # fmt: skip
    """A ledger that has not begun; `rows` of energies a case, none where only snapshots and impacts are kept."""
    n, balls, pairs = system.dofs, len(system.balls), len(system.contacts)
    d, terms = n + balls, found.forms.exponent.shape[1] + 1
    mass = np.concatenate([system.M.diagonal(), [pair.mass for pair in system.balls]])
    numbers = np.zeros((5, d))
    numbers[0], numbers[1, :n], numbers[2, :n] = mass, system.C.diagonal(), system.K.diagonal()
    numbers[3], numbers[4] = found.equations.drive, found.equations.given
    parameters = [pair.parameters for pair in system.contacts]
    square = np.zeros((terms, terms), dtype=complex)
    return Books(
        numbers=numbers,
        loose=(np.abs(found.forms.particle_shape).sum(axis=2) > 0.0).astype(float),
        pair=np.array(
            [
                [p.stiffness for p in parameters],
                [p.damping for p in parameters],
                [pair.free_stiffness for pair in system.contacts],
            ]
        ).reshape(3, pairs),
        direction=np.ascontiguousarray(found.equations.force.T),
        gap=found.forms.gap,
        sums=np.zeros((cases, 3)),
        loss_of_mode=np.zeros((cases, n)),
        kept=kept,
        shown=shown,
        energy=np.zeros((cases, rows, len(ENERGY_COLUMNS) + n)),
        fields=np.zeros((snapshots, 2, d)),
        impacts=np.zeros((most_impacts, len(IMPACT_COLUMNS) + n)),
        tally=np.zeros(1, dtype=np.int64),
        to_modes=np.zeros((cases, pairs, n)),
        before=np.zeros((2, d)),
        after=np.zeros((2, d)),
        strength=np.zeros((d + pairs, terms), dtype=complex),
        growth=np.zeros(terms, dtype=complex),
        plus=square,
        minus=square.copy(),
        together=_products(found),
        spare=new_flight(terms - 1, found.forms.particle_given.shape[1]),
    )


def _products(found: Compliant) -> NDArray[Any]:
    """Which products of two terms occur in the ledger of each state: of any where contacts act, else of one mode."""
    used = np.abs(found.forms.shape_rate) > 0.0
    # the drive's term is in every sum
    used = np.concatenate([used, np.ones((*used.shape[:2], 1), dtype=bool)], axis=2)
    touching = np.array([any(sides) for sides in found.states])
    return np.asarray(np.any(used[:, :, :, None] & used[:, :, None], axis=1) | touching[:, None, None])


def energy_now(system: System, found: Compliant, position: NDArray[Any], velocity: NDArray[Any]) -> NDArray[Any]:
    """Energies (J) of states at which nothing is booked yet, (cases, columns); see ENERGY_COLUMNS."""
    n = system.dofs
    mass = found.equations.M.diagonal()
    kinetic = 0.5 * mass * velocity**2
    table = np.zeros((position.shape[0], len(ENERGY_COLUMNS) + n))
    table[:, 0], table[:, 2] = kinetic[:, :n].sum(axis=1), kinetic[:, n:].sum(axis=1)
    table[:, 1] = 0.5 * (system.K.diagonal() * position[:, :n] ** 2).sum(axis=1)
    x = -position @ found.equations.force
    for j, pair in enumerate(system.contacts):
        depth = np.maximum(x[:, j] - pair.gaps[0], 0.0) + np.maximum(-x[:, j] - pair.gaps[1], 0.0)
        table[:, 3] += 0.5 * pair.free_stiffness * x[:, j] ** 2 + 0.5 * pair.parameters.stiffness * depth**2
    return table


def pass_on(run: Passing, cases: NDArray[Any], begin: NDArray[Any], end: NDArray[Any], most: NDArray[Any]) -> None:
    """Take some cases to their sample `end`, reading those after `begin`; others may be on their way meanwhile.

    Parameters
    ----------
    run : Passing
    cases : ndarray (k,) of int
    begin, end : ndarray (all cases,) of int
    most : ndarray (all cases,)
        Changes of contact beyond which a case is given up.
    """
    entries, particles, pairs = run.way.entry.shape[1], run.way.particle.shape[1], run.way.mode.shape[1]
    nothing, spare = new_flight(entries, particles), new_flight(entries, particles)
    search, limits, books = new_search(2 * pairs, entries, particles), np.zeros((4, 2 * pairs)), run.books
    written = ("before", "after", "strength", "growth", "plus", "minus") if books is not None else ()
    # what is written on the way belongs to this call alone
    flight, trial, mark, spare, search, (limits, state, turn), own = _together(
        nothing, nothing, nothing, spare, search, (limits, run.way.state, run.way.turn),
        [getattr(books, name) for name in written],
    )  # fmt: skip
    search = search._replace(spare=spare)
    if books is not None:
        books = books._replace(**dict(zip(written, own, strict=True)), spare=new_flight(entries, particles))
    fly_cases(
        cases, begin, end, most, run.found.forms, run.waves, run.reading, run.way._replace(state=state, turn=turn),
        search, limits, flight, trial, mark, run.stuck, books,
    )  # fmt: skip


def _together(*groups: Any) -> list[Any]:
    """Copies of tuples of arrays, all in one piece of memory, each array on cache lines of its own.

    Threads that write to one line wait for each other, and arrays whole pages apart look like one another to
    the processor.
    """
    sizes = [-(-array.nbytes // LINE) * LINE for group in groups for array in group if isinstance(array, np.ndarray)]
    memory = np.zeros(sum(sizes) + 4 * LINE, dtype=np.uint8)
    first = 2 * LINE + (-memory.ctypes.data) % LINE
    places = itertools.accumulate(sizes, initial=first)
    copies = []
    for group in groups:
        own = []
        for array in group:
            if not isinstance(array, np.ndarray):
                own.append(array)
                continue
            place = next(places)
            own.append(memory[place : place + array.nbytes].view(array.dtype).reshape(array.shape))
            own[-1][...] = array
        copies.append(type(group)._make(own) if hasattr(group, "_make") else own)
    return copies
