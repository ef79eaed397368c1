"""Cases that share one compiled call: their arrays, and the closed forms made when they are first needed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array, Complex
from femimpact.contact.laws import SpeedPiece
from femimpact.core.structs import zeros, zeros_together
from femimpact.errors import require
from femimpact.excitation.piecewise_polynomial import ORDERS, PiecewisePolynomial, motion_at, piece_at
from femimpact.integrators.channel_rows import Drive
from femimpact.integrators.event_driven.closed_form import steady_entries
from femimpact.integrators.event_driven.complex_modes import SLOW
from femimpact.integrators.event_driven.loop_data import CONTACT, FREE, EventSettings, Held
from femimpact.integrators.event_driven.store import FormStore, WantedForm
from femimpact.response.impacts import CYCLE_COLUMNS, IMPACT_COLUMNS, event_width
from femimpact.system.contact_pair import ContactPair

LONGEST_SERIES = 0.5
"""Longest time in which a driven entry is advanced at once, times the rate of the polynomials or of slow entries."""

EXTREMES = 2
"""Columns of a cycle behind those of `CYCLE_COLUMNS`: the times of its maximum and minimum."""

RESONANCE = "must not be a natural frequency of an undamped mode: the steady response is unbounded; add damping"


@dataclass(frozen=True, eq=False)
class Inputs:
    """Excitation, contacts and start of each of C cases, in the units of the compiled loop."""

    omega: Array  # (C,) rad/s: of what counts as a cycle
    # (C, H) of each load's s(t) (m/s^2 or N), the first one real, and rad, where it is a sine; 0 where it is not
    amplitude: Complex
    phase: Array  # (C,)
    # s(t) of all cases, of each load, where they are made of polynomials between the same knots
    pieces: tuple[PiecewisePolynomial, ...]
    gaps: Array  # (C, R, 2) m: to the + and to the - side
    stiffness: Array  # (C, R) n/m, N s/m and 1
    damping: Array  # (C, R)
    restitution: Array  # (C, R)
    over_speed: Array  # (C, R, 4V) of restitutions that depend on the approach speed; see `speed_pieces`
    is_sine: bool  # whether s(t) of the cases is a sine
    position: Array  # (C, d) structure and balls relative to the base, m and m/s
    velocity: Array  # (C, d)
    window: Array  # (C, 2) s: of which the totals are
    start: float = 0.0  # s: when all of them begin
    held: Held | None = None  # what an earlier run has left to a case alone

    def of(self, members: NDArray[np.intp]) -> Inputs:
        """The same of some cases."""
        common = ("pieces", "is_sine", "start", "held")
        names = [item.name for item in dataclasses.fields(self) if item.name not in common]
        return dataclasses.replace(self, **{name: getattr(self, name)[members] for name in names})


def inputs_of(
    drives: Sequence[Drive],
    contacts: Sequence[Sequence[ContactPair]],  # of each case: the system's pairs with its gaps and contact parameters
    position: Array,  # the others as the fields of `Inputs`
    velocity: Array,
    window: Array,
    start: float = 0.0,
    held: Held | None = None,
) -> Inputs:
    """Inputs of cases that are given by their drives and their contact pairs."""
    count, pairs = len(drives), len(contacts[0])

    def of_pairs(name: str) -> Array:
        values = [[getattr(pair.parameters, name) for pair in row] for row in contacts]
        return np.array(values, dtype=float).reshape(count, pairs)

    return Inputs(
        omega=np.array([drive.omega for drive in drives]),
        amplitude=np.array([relative_amplitudes(drive.loads, drive) for drive in drives]),
        phase=np.array([drive.sine.phase for drive in drives]),
        pieces=tuple(load.pieces for load in drives[0].loads if load.pieces is not None),
        gaps=np.array([[pair.gaps for pair in row] for row in contacts], dtype=float).reshape(count, pairs, 2),
        stiffness=of_pairs("stiffness"),
        damping=of_pairs("damping"),
        restitution=of_pairs("restitution"),
        over_speed=speed_pieces([[pair.parameters.over_speed for pair in row] for row in contacts], (count, pairs)),
        is_sine=drives[0].is_sine,
        position=position,
        velocity=velocity,
        window=window,
        start=start,
        held=held,
    )


def speed_pieces(rows: Sequence[Sequence[Sequence[SpeedPiece]]], shape: tuple[int, int]) -> Array:
    """Pieces of the restitutions of all cases and pairs, four numbers each; those that a pair lacks begin nowhere."""
    most = max((len(pieces) for row in rows for pieces in row), default=0)
    table = np.full((*shape, most, 4), math.inf)
    for c, row in enumerate(rows if most else ()):
        for j, pieces in enumerate(row):
            table[c, j, : len(pieces)] = np.reshape(pieces, (-1, 4))
    return table.reshape(*shape, 4 * most)


def relative_amplitudes(loads: Sequence[Drive], first: Drive) -> list[complex]:
    """Amplitudes of sines beside the phase of another one of their frequency: real where the phases are equal."""
    return [complex(load.sine.amplitude * np.exp(1j * (load.sine.phase - first.sine.phase))) for load in loads]


@dataclass(eq=False)
class Block:
    """Arrays of some cases under way; the compiled loop writes into them. C cases."""

    store: FormStore
    pairs: core.events.Pairs
    cases: core.events.Cases
    grid: core.events.Grid
    tables: core.events.Tables
    ledger: core.events.Ledger | None
    stopped: NDArray[np.int64]  # (C,)
    system_of: NDArray[np.int64]  # (C,) which of them a case has
    # of each system of the store that a case has: its pairs, and fields of its ledger, whose sums are common
    systems: dict[int, tuple[core.events.Pairs, dict[str, Any]]]
    space: core.events.Space | None = None  # working space, of the size for the closed forms of the last call


def new_block(
    store: FormStore, inputs: Inputs, method: EventSettings, ledger: bool | None, most_rows: int = 0,
    most_events: int = 0, system_of: NDArray[np.int64] | None = None,
) -> Block:  # fmt: skip
    """Cases at their start.

    The ledger is True for all energies, False for the losses of compliant contacts alone, as the table of impacts has
    them, None for no energy. `most_rows` is of the tables of impacts and sticking phases, of a case alone,
    `most_events` of the log of events of each case; `system_of` (C,) says which of the store's systems a case has.
    """
    equations, n, count = store.equations[0], store.systems[0].dofs, inputs.omega.size
    period, system_of = 2.0 * np.pi / inputs.omega, np.zeros(count, dtype=np.int64) if system_of is None else system_of
    of_systems = {number: _of_system(store, number, method) for number in sorted(set(system_of.tolist()))}
    pairs, fields = of_systems[int(system_of[0])]
    lengths = dict.fromkeys("yxkewDg", 0) | {"C": count, "O": store.outputs[0].constant.size, "n": n}
    lengths["d"] = equations.M.shape[0]
    return Block(
        store=store,
        pairs=pairs,
        cases=_new_cases(store, inputs, n if most_rows else 0),
        grid=zeros(
            core.events.Grid,
            lengths,
            start=np.full(count, inputs.start),
            interval=period / method.samples_per_cycle,
            per_cycle=float(method.samples_per_cycle),
        ),
        # not set to zero: that takes longer than a short run does, and only rows that were written are read
        tables=core.events.Tables(
            np.empty((most_rows, len(IMPACT_COLUMNS) + n)),
            np.empty((most_rows, 5)),
            np.zeros(2, dtype=np.int64),
            np.empty((count, most_events, event_width(equations.rigid.size, equations.M.shape[0]))),
            np.zeros(count, dtype=np.int64),
        ),
        ledger=None if ledger is None else zeros(core.events.Ledger, lengths, **fields, everywhere=ledger),
        stopped=np.zeros(count, dtype=np.int64),
        system_of=system_of,
        systems=of_systems,
    )


def _new_cases(store: FormStore, inputs: Inputs, modes: int) -> core.events.Cases:
    rigid, (d, pairs) = store.equations[0].rigid, store.equations[0].force.shape
    count, pieces, loads = inputs.omega.size, inputs.pieces, inputs.amplitude.shape[1]
    drive, piece, knots, table = np.zeros((count, ORDERS * loads)), 0, np.zeros(0), np.zeros((0, ORDERS * loads))
    if pieces:
        knots, table = pieces_from(pieces, inputs.start)
        drive[:] = np.concatenate([motion_at(each, inputs.start) for each in pieces])
        piece = piece_at(pieces[0], inputs.start)
    # with closed forms its arrays grow; see `_fitted`
    lengths = {"C": count, "R": pairs, "O": store.outputs[0].constant.size, "d": d, "m": modes, "K": 1, "P": 1, "N": 1}
    cases = zeros(
        core.events.Cases,
        lengths,
        omega=inputs.omega.copy() if inputs.is_sine else np.zeros(count),
        amplitude=inputs.amplitude.copy(),
        knots=knots,
        pieces=table,
        degree=max((each.degree for each in pieces), default=-1),
        longest=LONGEST_SERIES / max(store.rate or 0.0, SLOW),
        gap_plus=inputs.gaps[:, :, 0].copy(),
        gap_minus=inputs.gaps[:, :, 1].copy(),
        stiffness=np.where(rigid, 0.0, inputs.stiffness),
        damping=np.where(rigid, 0.0, inputs.damping),
        restitution=inputs.restitution.copy(),
        over_speed=np.ascontiguousarray(inputs.over_speed),
        form=np.full((count, 2), -1, dtype=np.int64),
        clock=np.stack([np.full(count, inputs.start), inputs.phase], axis=1),
        drive=drive,
        piece=np.full(count, piece, dtype=np.int64),
        coordinates=np.ascontiguousarray(np.stack([inputs.position, inputs.velocity], axis=1)),
        entering=np.full(count, core.events.STARTING, dtype=np.int64),
        window=np.array(inputs.window, dtype=float),
    )
    if inputs.held is None:
        return cases
    cases = _resumed(inputs.held, cases)
    # the arrays of all forms are then as large as a motion in this one
    add_forms(np.zeros(1, dtype=np.intp), cases, store, np.zeros(1, dtype=np.int64))
    (wanted,) = wanted_forms(np.zeros(1, dtype=np.intp), cases, np.zeros(1, dtype=np.int64))
    _split_anew(inputs.held, cases, store.forms, store.known[wanted.parameters, wanted.key])
    return cases


def _resumed(held: Held, cases: core.events.Cases) -> core.events.Cases:
    """A case alone that goes on with its contacts in progress, and with the motion where that is held."""
    cases.state[0], cases.touch[0], cases.leaving[0] = held.state, held.touch, held.leaving
    if held.to_modes.shape == cases.to_modes[0].shape:
        cases.to_modes[0] = held.to_modes
    else:
        # it was not summed before
        cases.to_modes[0, held.state != FREE] = np.nan
    cases.entering[0] = core.events.RESUMED if held.motion else core.events.STARTED
    motion: dict[str, Any] = {name: values[None].copy() for name, values in held.motion.items()}
    if motion and cases.knots.size:
        # the earlier run may have begun before the first knot, and had one piece more
        now = np.searchsorted(cases.knots, motion["clock"][0, 0], side="right") - 1
        motion["piece"] = np.array([max(now, 0)], dtype=np.int64)
    return cases._replace(**motion)


def _split_anew(held: Held, cases: core.events.Cases, forms: core.events.Forms, form: int) -> None:
    """Give entries of a case alone the share of their response that they hold in this run.

    The polynomials of a longer run may be faster, or slower beside a larger force, so that other entries are driven.
    """
    now, last = int(forms.driven[form]), int(forms.entries[form])
    first, end = min(now, held.driven), max(now, held.driven)
    if not held.motion or first == end:
        return
    rate = forms.coupling[form, :last, :last] + np.diag(forms.exponent[form, :last])
    steady = steady_entries(rate, forms.load[form, :, :last], first, end)
    steady = cases.drive[0] @ steady.reshape(cases.drive.shape[1], -1)
    cases.entry[0, first:end] += steady if now > held.driven else -steady


def pieces_from(pieces: Sequence[PiecewisePolynomial], start: float) -> tuple[Array, Array]:
    """Knots and what each piece begins with of all loads, from a time (s) on: before the first knot s is zero."""
    knots = pieces[0].knots
    table = pieces[0].table if len(pieces) == 1 else np.hstack([each.table for each in pieces])
    if start >= knots[0]:
        return knots, table
    before = np.concatenate([motion_at(each, start) for each in pieces])
    return np.concatenate([[start], knots]), np.vstack([before, table])


def no_cycles(cases: int, cycles: int) -> Array:
    """Statistics of cycles of which nothing was read."""
    table = np.zeros((cases, cycles, len(CYCLE_COLUMNS) + EXTREMES))
    table[:, :, 0], table[:, :, 1] = -np.inf, np.inf
    return table


def _of_system(store: FormStore, number: int, method: EventSettings) -> tuple[core.events.Pairs, dict[str, Any]]:
    """The pairs of a system, and what its ledger has of its equations; springs and dashpots of balls stand apart."""
    system, equations = store.systems[number], store.equations[number]
    n, d = system.dofs, equations.M.shape[0]
    damping, stiffness = np.zeros(d), np.zeros(d)
    damping[:n], stiffness[:n] = system.C.diagonal(), system.K.diagonal()
    pairs = core.events.Pairs(
        direction=np.ascontiguousarray(equations.force.T),
        in_space=equations.in_space,
        rigid=equations.rigid,
        mobility=-equations.force.T @ np.linalg.solve(equations.M, equations.force),
        closure=method.closure,
    )
    return pairs, {
        "mass": equations.M.diagonal().copy(), "damping": damping, "stiffness": stiffness, "load": equations.drive[0],
        "given": equations.given, "free_stiffness": np.array([pair.free_stiffness for pair in system.contacts]),
        "free_damping": np.array([pair.free_damping for pair in system.contacts]),
    }  # fmt: skip


def work_apart(block: Block, drive: Drive, start: float) -> None:
    """Let the ledger of a block sum the work of each of several drives that begin at a time (s)."""
    if block.ledger is None or not drive.parts:
        return
    pieces = [load.pieces for load in drive.parts if load.pieces is not None]
    table = np.zeros((0, len(drive.parts) * (ORDERS - 2)))
    if pieces:
        knots, of_all = pieces_from(pieces, start)
        table = np.ascontiguousarray(of_all.reshape(knots.size, -1, ORDERS)[:, :, 2:].reshape(knots.size, -1))
    load = block.store.equations[0].drive
    block.ledger = block.ledger._replace(
        drive_load=np.array([load[part.place] for part in drive.parts]),
        drive_amplitude=np.array(relative_amplitudes(drive.parts, drive)),
        drive_pieces=table,
        work_of=np.zeros((1, len(drive.parts) + 1)),
    )


def run_block(
    block: Block,  # `stopped` is how each ended: DONE, or UNENDING at the time `cases.clock[:, 0]`
    begin: NDArray[np.int64],  # (C,)
    end: NDArray[np.int64],  # (C,)
    most: Array,  # (C,) events beyond which a case is given up
    snapshots: core.events.Snapshots | None = None,
) -> None:
    """Take all cases to their sample `end`, reading those after `begin`."""
    store, members = block.store, np.arange(block.stopped.size)
    if snapshots is None:
        lengths = {"s": 0, "f": 0, "d": block.cases.coordinates.shape[2], "R": block.pairs.rigid.size}
        snapshots = zeros(core.events.Snapshots, lengths)
    block.cases.events[:, 0] = 0
    while members.size:
        forms = store.snapshot()
        block.cases = _fitted(block.cases, forms)
        needed = forms.exponent.shape[1], forms.rigid_body_drive.shape[2]
        if block.space is None or (block.space.motion.entry.size, block.space.motion.rigid_body.size) != needed:
            block.space = working_space(block, forms)
        job = core.events.Job(block.pairs, block.cases, forms, block.grid, snapshots, block.tables, block.space)
        for number, (pairs, fields) in block.systems.items():
            of_system = members[block.system_of[members] == number] if len(block.systems) > 1 else members
            ledger = None if block.ledger is None else block.ledger._replace(**fields)
            core.run_cases(
                core.events.Task(of_system, begin, end, most, block.stopped), job._replace(pairs=pairs), ledger
            )
        resonant = np.flatnonzero(block.stopped == core.events.RESONANT)
        if resonant.size:
            frequency = float(block.cases.omega[resonant[0]]) / (2.0 * np.pi)
            require(False, "frequency", frequency, "Hz", RESONANCE)
        members = members[block.stopped[members] == core.events.FORM_WANTED]
        add_forms(members, block.cases, store, block.system_of)


def add_forms(
    members: NDArray[np.intp], cases: core.events.Cases, store: FormStore, system_of: NDArray[np.int64]
) -> None:
    """Make the closed forms of the cases' contact states for their contact parameters, unless they are there."""
    cases.form[members, 0] = store.first_forms(wanted_forms(members, cases, system_of))


def wanted_forms(members: NDArray[np.intp], cases: core.events.Cases, system_of: NDArray[np.int64]) -> list[WantedForm]:
    """The closed forms of the contact states of some cases."""
    bits = (np.abs(cases.state[members]) == CONTACT) @ (1 << np.arange(cases.state.shape[1], dtype=np.int64))
    rows = np.hstack([cases.stiffness[members], cases.damping[members]])
    keys = zip(bits.tolist(), rows, system_of[members].tolist(), strict=True)
    return [WantedForm(key, system.to_bytes(4, "little") + row.tobytes(), row, system) for key, row, system in keys]


def _fitted(cases: core.events.Cases, forms: core.events.Forms) -> core.events.Cases:
    """The cases, with arrays of the size that the closed forms need now."""
    entries, rigid_bodies = forms.exponent.shape[1], forms.rigid_body_drive.shape[2]
    count = 1 + int(forms.number[: forms.made].max(initial=0))
    sizes = {
        "entry": (entries,), "rigid_body": (2, rigid_bodies), "known": (count,), "sine": (count, cases.sine.shape[2]),
        "harmonic": (count, cases.harmonic.shape[2]), "rigid_body_sine": (count, rigid_bodies),
    }  # fmt: skip
    larger: dict[str, Any] = {}
    for name, shape in sizes.items():
        old = getattr(cases, name)
        if old.shape[1:] != shape:
            larger[name] = np.zeros((old.shape[0], *shape), dtype=old.dtype)
            larger[name][tuple(slice(0, length) for length in old.shape)] = old
    return cases._replace(**larger) if larger else cases


def working_space(block: Block, forms: core.events.Forms) -> core.events.Space:
    """Working space that belongs to one call alone."""
    _, d, entries = forms.shape.shape
    pairs = block.pairs.rigid.size
    lengths = {
        "K": entries, "P": forms.rigid_body_drive.shape[2], "R": pairs, "O": forms.constant.shape[1] - 2 * pairs,
        "d": d, "H": forms.rigid_body_drive.shape[1], "S": math.ceil(block.grid.per_cycle) + 1,
    }  # fmt: skip
    return zeros_together(core.events.Space, lengths)
