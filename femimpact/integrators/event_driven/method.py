"""The event-driven method as a value, and its dwells: each a separate case, all in blocks of one compiled call."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.contact.law import resolve
from femimpact.contact.laws import ContactParameters
from femimpact.errors import check_fields, quantity, require
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.assembly import cycles_of_table
from femimpact.integrators.cases import (
    AchievedRestitution,
    SineCases,
    SineDwellResults,
    in_blocks,
    start_of,
    with_contacts_of,
)
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.block import (
    Block,
    Inputs,
    add_forms,
    new_block,
    no_cycles,
    run_block,
    speed_pieces,
)
from femimpact.integrators.event_driven.loop_data import EventSettings, check_events, reading_grid
from femimpact.integrators.event_driven.run import not_finite, peaks_of_forces, run_events, unending
from femimpact.integrators.event_driven.store import FormStore, outputs_of
from femimpact.progress import Progress
from femimpact.response.cycles import steady_motion
from femimpact.response.energy import BALANCED, CLOSED, energy_residual, largest_input, unbalanced
from femimpact.response.impacts import CYCLE_COLUMNS, ENERGY_COLUMNS
from femimpact.response.response import Recorder
from femimpact.system.contact_pair import ContactPair
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
    arrays = {name: np.array(rows, dtype=float).reshape(shape) for name, rows in values.items()}
    arrays["over_speed"] = speed_pieces([[numbers.over_speed for numbers in parameters] for parameters in sets], shape)
    return {name: array[set_of.reshape(-1)] for name, array in arrays.items()}


def _starts(system: System, cases: SineCases) -> tuple[Array, Array]:
    """Displacements and velocities (n, d) of structure and balls at the start, relative to the base."""
    initial, n, balls = cases.initial, system.dofs, len(system.balls)
    # a static state is another one for other gaps, a stop fixed in space has another place under every base, a rigid
    # motion and the directions of pairs are other ones on other modes
    simple = not (cases.systems or initial.is_static_on(system) or np.any(cases.gaps < 0.0))
    simple = simple and all(pair.fixed_to == "base" and not pair.between for pair in system.contacts)
    if simple and initial.pull is initial.blow is initial.displacement is initial.velocity is None:
        position, velocity = np.zeros((2, cases.frequency.size, n + balls))
        position[:, n:], velocity[:, n:] = np.nan_to_num(cases.ball_displacement), cases.ball_velocity
        if initial.frame == "space":
            rigid = np.append(system.rigid_translation, np.ones(balls))
            scale = cases.amplitude * (2.0 * np.pi * cases.frequency)
            position -= np.outer(cases.amplitude * np.sin(cases.phase), rigid)
            velocity -= np.outer(scale * np.cos(cases.phase), rigid)
        for j, pair in enumerate(system.contacts):
            if pair.parameters.is_rigid:
                x = (0.0 if pair.is_stop else position[:, n + j]) - position[:, :n] @ pair.direction
                inside = (x >= -cases.gaps[:, j, 1] - ROUNDED) & (x <= cases.gaps[:, j, 0] + ROUNDED)
                simple = simple and bool(np.all(inside))
        if simple:
            return position, velocity
    # one by one, which refuses a start beyond a rigid wall
    starts = []
    for c in range(cases.frequency.size):
        base = Sine(float(cases.amplitude[c]), float(cases.frequency[c]), float(cases.phase[c]))
        own = with_contacts_of(cases.system(c, system), cases, c)
        u, v, y, y_rate = start_of(cases, c).relative_to_base(own, base)
        starts.append((np.concatenate([u, y[:balls]]), np.concatenate([v, y_rate[:balls]])))
    position, velocity = map(np.array, zip(*starts, strict=True))
    return position, velocity


def _fault(method: EventSettings, time: float, rms: float, residual: float, *, ledger: bool) -> str:
    """The fault of a case that is beyond rounding, in words; an empty text where there is none."""
    if math.isfinite(time):
        return unending(time, method)
    if not math.isfinite(rms) or (ledger and not math.isfinite(residual)):
        return not_finite("")
    return unbalanced(residual) if ledger and residual > BALANCED else ""


@dataclass(frozen=True)
class EventDriven:
    """Exact motion between impacts and through Kelvin-Voigt contacts: no step, nothing to tune.

    Between events every mode and every ball moves in closed form. The first crossing of a gap is
    approached by times in which a bound on the motion excludes one, so that none is missed, and
    met to rounding. A rigid impact changes the relative speed v to -e v by an impulse
    (1 + e) v/(1/m + b^T M^-1 b). Impacts at the same instant are solved together, over all pairs that
    close or rest at their walls, those that stick among them: impulses p >= 0 and u+ + e u- >= 0, one
    of both zero for each pair (Moreau, 1988). What separates is looked at again afterwards. The energy
    does not grow, and the order of the pairs does not matter.

    While the force of a Kelvin-Voigt contact pushes, structure, ball and wall are one linear system with a
    closed form. The contact ends where its force k p + c p' would turn into a pull; what the wall has
    stored by then is lost as it springs back behind the ball. Rigid and Kelvin-Voigt contacts may be mixed.

    Parameters
    ----------
    closure : float, m
        For rigid contacts. A bounce that would rise no higher is the last: the pair is captured, its momentum handed
        over, and sticks to its wall until the contact force changes sign. What is left out is a
        displacement below the closure and the energy m_eff v^2/2 of that bounce, which is counted as
        loss; the accumulation's end, 2 v/(a (1 - e)) later, is the start in the table of sticking phases.
    samples_per_cycle : int
        Grid on which channels, rms, harmonics and the ledger are read under a sine; neither events nor the peak of a
        cycle nor the largest contact force, which are exact, depend on it. `Recorder.interval` takes its place. A
        chirp, a stepped sine, and sums and several drives of these and sines, are read at as many instants of their
        shortest cycle. Another drive by samples is read at their interval, or at 1/20 of the period of the highest
        kept mode where that is less. There are no more than 10^6 instants; a note of the response says which.
    most_events : int
        Impacts and changes of contact for each base cycle, on average over what is computed at once,
        beyond which a run is given up.
    """

    closure: float = field(default=1e-12, metadata=quantity("m", above=0.0))
    samples_per_cycle: int = field(default=64, metadata=quantity("1", at_least=8, at_most=1_000_000, integer=True))
    most_events: int = field(default=1_000_000, metadata=quantity("1", at_least=10, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def for_system(cls, system: System, **settings: Any) -> Self:
        """The method with these settings: nothing in it depends on the system."""
        return cls(**settings)

    def check(self, system: System) -> tuple[str, ...]:
        """No warnings; an error for a system that cannot be computed exactly."""
        check_events(system)
        return ()

    def check_drive(self, frequencies: NDArray[np.float64], key: str) -> None:
        """Any frequency of the drive will do."""

    def notes(self, system: System) -> tuple[str, ...]:
        """None: every mode is followed."""
        return ()

    def time_grid(self, system: System, excitation: Excitation, duration: float, recorder: Recorder) -> float:
        """Time (s) between the readings of a run; see `loop_data.reading_grid`."""
        return reading_grid(system, excitation, self, duration, recorder).interval

    def achieved_restitution(
        self, pair: ContactPair, approach_speed: float, phases: int = 32
    ) -> AchievedRestitution | None:
        """None: the law's, no step comes between."""
        return None

    run = run_events
    run_cases = event_driven_cases
