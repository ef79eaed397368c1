"""Dwells under sine motions of the base, event-driven: each a separate case, all in blocks of one compiled call."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.contact.law import resolve
from femimpact.contact.laws import ContactParameters
from femimpact.errors import require
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.assembly import cycles_of_table
from femimpact.integrators.cases import SineCases, SineDwellResults, in_blocks, start_of, with_contacts_of
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.block import (
    Block,
    Inputs,
    add_forms,
    new_block,
    no_cycles,
    run_block,
)
from femimpact.integrators.event_driven.loop_data import EventSettings, check_events
from femimpact.integrators.event_driven.run import not_finite, peaks_of_forces, unending
from femimpact.integrators.event_driven.store import FormStore, outputs_of
from femimpact.progress import Progress
from femimpact.response.cycles import steady_motion
from femimpact.response.energy import BALANCED, CLOSED, energy_residual, largest_input, unbalanced
from femimpact.response.impacts import CYCLE_COLUMNS, ENERGY_COLUMNS
from femimpact.system.state import ROUNDED
from femimpact.system.system import System

LARGEST_BLOCK = 64
"""Cases between two reports of progress, when interrupts are checked."""

BLOCKS = 8
"""Blocks per thread: cases cost differently, small blocks even that out."""


def _run_block(
    store: FormStore, cases: SineCases, inputs: Inputs, members: NDArray[np.intp], method: EventSettings,
    instants: int,
) -> SineDwellResults:  # fmt: skip
    """Results of some of the cases, over the measured cycles of their dwells."""
    per_cycle, count = method.samples_per_cycle, members.size
    cycles, measured, most_measured = cases.cycles[members], cases.measured[members], int(cases.measured.max())
    block = new_block(
        store, inputs.of(members), method, True if instants else None, system_of=cases.numbers_of_systems[members]
    )  # fmt: skip
    # every case needs one: they are made together
    add_forms(np.arange(count), block.cases, store, block.system_of)
    end = cycles * per_cycle
    # one sample more: the first measured cycle begins with it, be it that at the start
    begin = (cycles - measured) * per_cycle - 1
    number = np.arange(most_measured * per_cycle + 1)
    between = per_cycle // max(instants, 1)
    shape = (count, most_measured * instants + 1 if instants else 0, block.grid.energy.shape[2])
    block.cases.sample[:] = begin
    block.grid = block.grid._replace(
        origin=begin + 1,
        cycles=no_cycles(count, most_measured),
        kept=np.where((number % between == 0) & (instants > 0), number // between, -1),
        energy=np.zeros(shape),
    )
    run_block(block, begin, end, float(method.most_events) * cycles.astype(float))
    none = np.full(count, np.nan)
    residual, bound, loss, stored = _energies(block, measured, instants) if instants else (none,) * 4
    table = block.grid.cycles[:, :, : len(CYCLE_COLUMNS)]
    table = np.where(table[:, :, 5:] > 0.0, table, 0.0)
    motion = steady_motion(cycles_of_table(np.moveaxis(table, (2, 1), (0, 1))), measured)
    ends = np.where(block.stopped == core.events.DONE, np.inf, block.cases.clock[:, 0])
    faults = [
        _fault(method, *numbers, ledger=instants > 0)
        for numbers in zip(ends.tolist(), motion.rms.tolist(), residual.tolist(), strict=True)
    ]
    f = cases.frequency[members]
    return SineDwellResults(
        motion,
        totals=peaks_of_forces(np.moveaxis(block.cases.totals, 0, 2), block.pairs.rigid),
        duration=measured / f,
        residual=residual,
        bound=bound,
        failures=tuple(f"at {one:g} Hz: {fault}" if fault else "" for one, fault in zip(f, faults, strict=True)),
        loss=loss,
        stored=stored,
    )


def _energies(block: Block, measured: NDArray[np.int64], instants: int) -> tuple[Array, Array, Array, Array]:
    """Residual, its bound, loss and largest stored energy of each case; see `SineDwellResults`.

    The residual is that of the start and of the ends of measured cycles.
    """
    ledger = cast("core.events.Ledger", block.ledger)
    table = np.concatenate([ledger.start[:, None], block.grid.energy], axis=1)[:, :, : len(ENERGY_COLUMNS)]
    # a case with fewer cycles than others: its last row stands for those after it
    row = np.minimum(np.arange(table.shape[1]), instants * measured[:, None] + 1)
    table = np.take_along_axis(table, row[:, :, None], axis=1)
    kinetic, strain, ball, contact, work, lost, in_contact = table.T
    stored, lost = kinetic + strain + ball + contact, lost + in_contact
    ends = np.append(0, np.arange(1, table.shape[1], instants))
    residual = np.max(np.abs(energy_residual(stored[ends], work[ends], lost[ends])), axis=0)
    put_in = largest_input(stored[ends], work[ends])
    bound = np.maximum(CLOSED, ledger.rounding / np.where(put_in > 0.0, put_in, 1.0))
    return np.asarray(residual), bound, lost[-1] - lost[1], np.asarray(np.max(stored[1:], axis=0))


def event_driven_cases(
    method: EventSettings, system: System, cases: SineCases, observed: Array, instants: int, workers: int,
    progress: Progress | None = None,
) -> SineDwellResults:  # fmt: skip
    """Results of cases, event-driven."""
    check_events(system)
    first = Sine(float(cases.amplitude[0]), float(cases.frequency[0]), float(cases.phase[0]))
    systems, rows = zip(*(cases.systems or ((system, observed),)), strict=True)
    store = FormStore(systems, [drive_of(own, first) for own in systems], list(map(outputs_of, systems, rows)))
    inputs = _inputs(system, cases)

    def run(members: NDArray[np.intp], share: Progress | None) -> SineDwellResults:
        part = _run_block(store, cases, inputs, members, method, instants)
        if share is not None:
            share(1.0)
        return part

    count = cases.frequency.size
    blocks = max(math.ceil(count / LARGEST_BLOCK), 1 if workers == 1 else min(BLOCKS * workers, count))
    return in_blocks(run, np.array_split(np.arange(count), blocks), workers, progress)


def _inputs(system: System, cases: SineCases) -> Inputs:
    """Inputs of every case from the state that the initial one means under its base."""
    position, velocity = _starts(system, cases)
    omega = 2.0 * np.pi * cases.frequency
    begin = (cases.cycles - cases.measured) * (2.0 * np.pi / omega)
    return Inputs(
        omega=omega,
        amplitude=(-cases.amplitude * omega**2)[:, None].astype(complex),
        phase=cases.phase,
        pieces=(),
        gaps=cases.gaps,
        **_parameters(system, cases),
        is_sine=True,
        position=position,
        velocity=velocity,
        window=np.stack([begin, np.full(begin.size, np.inf)], axis=1),
    )


def _parameters(system: System, cases: SineCases) -> dict[str, Any]:
    """Numbers of each case's laws with the effective masses of its system, (n, pairs)."""
    kinds = tuple(pair.parameters.kind for pair in system.contacts)
    numbers, set_of = np.unique(np.column_stack([cases.law_of, cases.numbers_of_systems]), axis=0, return_inverse=True)
    sets: list[list[ContactParameters]] = []
    known = set[type]()
    for law_of, system_of in numbers.tolist():
        laws = cases.laws[law_of]
        contacts = cases.systems[system_of][0].contacts if cases.systems else system.contacts
        # a law of a kind that was found sound: of many laws the members need not be looked for each time
        parameters = [
            law.parameters(pair.effective_mass) if type(law) in known else resolve(law, pair.effective_mass)
            for law, pair in zip(laws, contacts, strict=True)
        ]
        known.update(map(type, laws))
        same = tuple(numbers.kind for numbers in parameters) == kinds
        require(same, "laws", ", ".join(law.name for law in laws), "", "must be laws of the kinds of the system's")
        sets.append(parameters)
    names, shape = ("stiffness", "damping", "restitution"), (len(sets), len(kinds))
    values = {name: [[getattr(numbers, name) for numbers in parameters] for parameters in sets] for name in names}
    return {name: np.array(rows, dtype=float).reshape(shape)[set_of.reshape(-1)] for name, rows in values.items()}


def _starts(system: System, cases: SineCases) -> tuple[Array, Array]:
    """Displacements and velocities (n, d) of structure and balls at the start, relative to the base."""
    if not cases.systems:
        return _starts_of(system, cases)
    position, velocity = np.zeros((2, cases.frequency.size, system.dofs + len(system.balls)))
    # a rigid motion and the directions of pairs are other ones on other modes
    for number in np.unique(cases.numbers_of_systems).tolist():
        rows = np.flatnonzero(cases.numbers_of_systems == number)
        position[rows], velocity[rows] = _starts_of(cases.systems[number][0], cases.of(rows))
    return position, velocity


def _starts_of(system: System, cases: SineCases) -> tuple[Array, Array]:
    # a static state is another one for other gaps, a stop fixed in space has another place under every base
    simple = not cases.initial.is_static_on(system) and all(pair.fixed_to == "base" for pair in system.contacts)
    simple = simple and cases.initial.displacement is None and cases.initial.velocity is None
    simple = simple and (cases.gaps.size == 0 or float(cases.gaps.min()) >= 0.0)
    if not simple:
        return _starts_one_by_one(system, cases)
    count, n = cases.frequency.size, system.dofs
    position, velocity = (np.zeros((count, n + len(system.balls))) for _ in range(2))
    position[:, n:], velocity[:, n:] = np.nan_to_num(cases.ball_displacement), cases.ball_velocity
    if cases.initial.frame == "space":
        rigid = np.append(system.rigid_translation, np.ones(len(system.balls)))
        scale = cases.amplitude * (2.0 * np.pi * cases.frequency)
        position -= np.outer(cases.amplitude * np.sin(cases.phase), rigid)
        velocity -= np.outer(scale * np.cos(cases.phase), rigid)
    for j, pair in enumerate(system.contacts):
        if not pair.parameters.is_rigid:
            continue
        other = 0.0 if pair.is_stop else position[:, n + j]
        x = other - position[:, :n] @ pair.direction
        inside = (x >= -cases.gaps[:, j, 1] - ROUNDED) & (x <= cases.gaps[:, j, 0] + ROUNDED)
        if not np.all(inside):
            c = int(np.argmin(inside))
            minus, plus = float(cases.gaps[c, j, 1]), float(cases.gaps[c, j, 0])
            allowed = f"must start between its walls, {-minus:g} to {plus:g} m"
            require(False, f"initial.{pair.name}.gap", float(x[c]), "m", allowed)
    return position, velocity


def _starts_one_by_one(system: System, cases: SineCases) -> tuple[Array, Array]:
    balls, starts = len(system.balls), []
    for c in range(cases.frequency.size):
        base = Sine(float(cases.amplitude[c]), float(cases.frequency[c]), float(cases.phase[c]))
        starts.append(start_of(cases, c).relative_to_base(with_contacts_of(system, cases, c), base))
    return (
        np.array([np.concatenate([u, y[:balls]]) for u, _, y, _ in starts]),
        np.array([np.concatenate([v, y_rate[:balls]]) for _, v, _, y_rate in starts]),
    )


def _fault(method: EventSettings, time: float, rms: float, residual: float, *, ledger: bool) -> str:
    """The fault of a case that is beyond rounding, in words; an empty text where there is none."""
    if math.isfinite(time):
        return unending(time, method)
    if not math.isfinite(rms) or (ledger and not math.isfinite(residual)):
        return not_finite("")
    return unbalanced(residual) if ledger and residual > BALANCED else ""
