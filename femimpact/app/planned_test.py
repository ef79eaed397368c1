"""What a planned test can show: numbers of the drive, the grid and the structure beside their limits, before a run.

Every row is a number with its unit, the limit beyond which the test does not show what it is made for, and what to
choose instead. Rows whose data are not given are left out; a row without a limit informs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from femimpact.app.parametric.dataset import axis_rows
from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.study.prepared import carried_words, in_study_words, prepare, refined_grid
from femimpact.app.study.study import Study, build_systems
from femimpact.app.study.study_file import unit_lines
from femimpact.app.tasks.branches import task_of_orbits
from femimpact.app.tasks.run import task_of_run
from femimpact.app.tasks.study_command import definition_of, plan_of_cases
from femimpact.arrays import Array
from femimpact.contact.laws import Rigid
from femimpact.errors import (
    DivergenceError,
    InputError,
    kind_of,
    level_rows,
    quantity,
    real_array,
    require,
    require_type,
    warns,
)
from femimpact.errors import checked as checked_value
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import alone, parts_in
from femimpact.excitation.excitation import Excitation, is_force, require_excitation
from femimpact.excitation.harmonic import Level, Sine, SteppedSine, level_at, require_reach
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.remarks import drives_above_modes, frequency_warnings
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method, require_method, step_of
from femimpact.integrators.planned_drive import (
    MODES,
    SAMPLES,
    PreflightRow,
    base_rows,
    contact_rows,
    drive_rows,
    row_of,
    step_rows,
    transient_rows,
)
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.operators import STEPS_PER_CONTACT, UNRESOLVED
from femimpact.response.cycles import LARGE, deflection_warnings
from femimpact.response.response import Recorder
from femimpact.structure.structure import Structure, unusual_numbers
from femimpact.system.modes import Modes, solve_modes
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors
from femimpact.table import frame_of
from femimpact.units import rounded, value_text

if TYPE_CHECKING:
    import pandas

OF_MATERIAL = ("Young's modulus", "density")

LEAST_MODULUS, LEAST_DENSITY = 1e6, 20.0
"""Pa and kg/m^3: rubber and foam; GPa, MPa and g/cm^3 give numbers below."""

MOST_CYCLES = 5e4
"""Cycles of chirps, steps and random motions, times the drives, beyond which no run without contacts is made."""

FIRST_GAP = "best of runs: 1.1 to 1.35 times it at a restitution of 0.35 to 0.52, 1.6 to 2.9 times at 0.6 to 0.8"
"""Best gaps of the beam of `examples/design_map.py` over that of a light loss."""

LEAST_RATIO = 1e-6
"""Mass of a ball over that of a mode below which it sits at a node of the mode."""

WIDE = 1e3
"""Gap (m) of a cavity whose walls are not met."""


@dataclass(frozen=True)
class Preflight:
    """Numbers of a planned test beside their limits.

    Parameters
    ----------
    rows : tuple of PreflightRow
    """

    rows: tuple[PreflightRow, ...]

    @property
    def passed(self) -> tuple[PreflightRow, ...]:
        """Rows whose limit is passed."""
        return tuple(row for row in self.rows if row.passed)

    def to_pandas(self) -> pandas.DataFrame:
        """A row for every number: what, value, unit, limit, whether the limit is passed, what to choose instead."""
        names = ("what", "value", "unit", "limit", "passed", "instead")
        columns = {name: [getattr(row, name) for row in self.rows] for name in names}
        return frame_of(columns, dict.fromkeys(names, ""))

    def __str__(self) -> str:
        return "\n".join(str(row) for row in self.rows)


@warns
def preflight(
    plan: Study | System | ParameterStudy,
    excitation: Excitation | None = None,
    *,
    duration: float | None = None,
    frequencies: ArrayLike | None = None,
    cycles: int | None = None,
    structure: Structure | None = None,
    method: Method | None = None,
    initial: State | None = None,
    acceleration: ArrayLike | None = None,
) -> Preflight:
    """Numbers of a planned test beside the limits within which it shows what it is made for.

    The swept peak of a mode with damping ratio zeta and natural frequency omega depends on
    b = 2 pi (df/dt)/(zeta omega)^2 alone: with tau = zeta omega t its envelope over the steady peak is
    |integral_0^inf exp(-u + i b (tau - u)^2/2) du|, 0.99 at b = 0.2, 0.90 at 1 and 0.82 at 2 (derived here; the
    integral is a complex complementary error function).

    Parameters
    ----------
    plan : Study, System or ParameterStudy
        Of a study, or a parameter study, every other argument follows from it.
    excitation : Excitation, optional
        Drive of the history; of a sweep by frequencies a `Sine` with its amplitude.
    duration : float, s, optional
        Of the history; by default that of the excitation where it has one.
    frequencies : array_like (n,), Hz, optional
        Of a sweep with stepped sines.
    cycles : int, optional
        Of the base at each of the frequencies; the last third is measured.
    structure : Structure, optional
        Whose numbers are looked at for another unit.
    method : Method, optional
        That runs the system without contacts; `EventDriven()` by default, whose system is reduced.
    initial : State, optional
        At the start; whether the ball moves at all is answered for a start at rest in space.
    acceleration : float or array_like (k, 2), m/s^2, optional
        Of the sweep, as of `frequency_sweep`, in place of the amplitude of the excitation.

    Returns
    -------
    Preflight
        Rows without data are left out.

    Raises
    ------
    InputError
        If an argument is of another kind, or other arguments are given beside a study; of a study's axes as of
        `ParameterStudy`.
    """
    if isinstance(plan, (Study, ParameterStudy)):
        given = (excitation, duration, frequencies, cycles, structure, method, initial, acceleration)
        alone = all(value is None for value in given)
        require(alone, "plan", kind_of(plan), "", "must be the only argument: the rest follows from the study")
        return preflight_of_study(plan, build_systems(plan)[1]) if isinstance(plan, Study) else _of_cases(plan)
    require_type(plan, System, "plan")
    if excitation is not None:
        require_excitation(excitation)
        duration = getattr(excitation, "duration", None) if duration is None else duration
    if duration is not None:
        duration = checked_value("duration", duration, quantity("s", above=0.0))
    f: Array | None = None
    if frequencies is not None:
        f = np.unique(real_array("frequencies", frequencies, "Hz", "must be finite numbers"))
        require(f.size > 0, "frequencies", "none", "Hz", "must be one or more")
        for end in (f[0], f[-1]):
            checked_value("frequencies", float(end), quantity("Hz", above=0.0))
    if cycles is not None:
        cycles = checked_value("cycles", cycles, quantity("1", at_least=1, integer=True))
    for key, value, kind in (("structure", structure, Structure), ("initial", initial, State)):
        if value is not None:
            require_type(value, kind, key)
    if method is not None:
        require_method(method)
    rows = list(_of_structure(structure))
    if _is_of_another_material(rows):
        # what follows from its modes says nothing, as "keep more modes"
        return Preflight(tuple(rows))
    rows += contact_rows(plan)
    if excitation is not None:
        rows += [*base_rows(plan, excitation, duration), *drive_rows(plan, excitation, duration, initial or State())]
        rows += _first_gaps(plan, excitation)
        if duration is not None:
            rows += _of_linear_run(plan, excitation, duration, method, initial or State())
    if f is not None:
        level: Level | None = None
        if acceleration is not None:
            level = checked_value("acceleration", acceleration, level_rows("m/s^2"))
            require_reach(level, float(f[0]), float(f[-1]))
        rows += _of_grid(plan, f, cycles, excitation, level)
    return Preflight(tuple(rows))


CHOSEN_BY = ("first gap to try", "frequency step")
"""Beginnings of the rows that are shown within their limits too: a user chooses the study by them."""


def lines_of_check(study: Study, every: bool = False) -> tuple[list[str], list[str]]:
    """Lines on what the tables of a study ask for and what it can show, and the limits and warnings among them.

    Without `every` they are cost, first natural frequency, the numbers to choose by, and what is beyond its limit.

    Raises `InputError` for everything that would stop a task before it starts.
    """
    prepared = prepare(study)
    numbers, run = preflight_of_study(study, prepared.small), task_of_run(prepared).plan()
    # a row has the size of a motion beside its limit, and only the rest of the warning
    advice = "; ".join(row.instead for row in numbers.passed)
    left = [text for text in run.warnings if text.rpartition(" m: ")[2] not in advice]
    run = replace(run, warnings=() if _is_of_another_material(numbers.rows) else tuple(left))
    plans = [plan_of_cases(study)] if study.plan is not None else []
    plans += [task_of_orbits(study).plan()] if study.orbits is not None else []
    rows = [row for row in numbers.rows if every or row.passed or row.what.startswith(CHOSEN_BY)]
    texts = [f"{'limit passed' if row.passed else 'test'}: {row}" for row in rows]
    passed = [*(row.what for row in numbers.passed), *(f"warning: {text}" for text in run.warnings)]
    if every:
        return [*unit_lines(study), *run.lines, *texts, *(line for plan in plans for line in plan.lines)], passed
    costs = [text for plan in (run, *plans) for text in plan.costs]
    within = len(numbers.rows) - len(rows)
    count = f"{within} more number{'s' * (within != 1)} within {'its limit' if within == 1 else 'their limits'}"
    step, small = step_of(prepared.method), prepared.small
    # impacts excite modes up to some two over the contact time; rigid ones, without a contact time, all
    times = [one.parameters.contact_time for one in small.contacts]
    excites = step is not None and any(not STEPS_PER_CONTACT * step <= 1.001 * each for each in times)
    texts += [f"note: {text}" for text in run.notes if excites and text.endswith(UNRESOLVED)]
    lines = [*run.numbers, *costs, *texts, *(f"warning: {text}" for text in run.warnings)]
    return [*lines, f"{count}, and what the study gives: femimpact check {study.path.name} --all"], passed


def preflight_of_study(study: Study, small: System) -> Preflight:
    """The rows of a study with the system that is integrated."""
    plan = study.sweep
    grid = None if plan is None else refined_grid(plan, without_impactors(small), None)
    found = preflight(
        small, study.excitation, duration=study.history_duration, frequencies=grid,
        cycles=plan.cycles if plan else None, structure=study.structure, initial=study.initial_on(small),
        acceleration=study.sweep_level["acceleration"] if plan else None,
    )  # fmt: skip
    axes = () if study.plan is None else axis_rows(definition_of(study))
    return Preflight((*(replace(row, instead=in_study_words(row.instead)) for row in found.rows), *axes))


def _of_cases(plan: ParameterStudy) -> Preflight:
    """The rows of the system or study that the cases vary, and the steps of their axes of frequencies."""
    if isinstance(plan.study, Study):
        # the axes are those given, not those of the study's file
        found = preflight_of_study(replace(plan.study, plan=None), plan.nominal)
    else:
        found = preflight(plan.nominal, plan.excitation)
    return Preflight((*found.rows, *axis_rows(plan)))


# ---- numbers that are probably in another unit ---------------------------------------------------


def _of_structure(structure: Structure | None) -> Iterator[PreflightRow]:
    """Modulus and density that were given, and what else is unusual."""
    if structure is None:
        return
    for segment in {(s.name, s.young_modulus, s.density): s for s in structure.beam.segments}.values():
        of, modulus, density = f" of segment {segment.name!r}", segment.young_modulus, segment.density
        instead = f"is it in GPa? {modulus:g} GPa are {1e9 * modulus:.4g} Pa"
        yield row_of(f"Young's modulus{of}", modulus, "Pa", LEAST_MODULUS, instead, at_least=True)
        instead = f"is it in g/cm^3? {density:g} g/cm^3 are {1e3 * density:.4g} kg/m^3"
        yield row_of(f"density{of}", density, "kg/m^3", LEAST_DENSITY, instead, at_least=True)
    for one in unusual_numbers(structure):
        if not one.path.endswith((".young_modulus", ".density")):
            value, instead = abs(one.value), f"{one.usual}; {one.instead}"
            yield row_of(one.path, value, one.unit, one.limit, instead, at_least=value < one.limit)


def _is_of_another_material(rows: Sequence[PreflightRow]) -> bool:
    """Whether modulus or density are in another unit."""
    return any(row.passed and row.what.startswith(OF_MATERIAL) for row in rows)


# ---- the drive and the balls -----------------------------------------------------------------------


def _first_gaps(system: System, excitation: Excitation) -> Iterator[PreflightRow]:
    """Best gap of a light loss of each free ball between two walls, of the mode nearest to the drive.

    Two impacts in a cycle take up all that the base puts into the mode where d = pi^2 Gamma phi ub/(8 m phi^2), with
    the mass-normalised mode phi at the ball and its participation factor Gamma (derived here). Of a force on the mode,
    integral q phi dx, this over omega^2 stands in place of Gamma ub.
    """
    drive = alone(excitation)
    sine = getattr(drive, "history", drive)
    if not isinstance(sine, Sine) or sine.amplitude == 0.0:
        return
    modes = solve_modes(without_impactors(system), min(MODES, system.dofs))
    elastic = np.flatnonzero(modes.natural_frequency > 0.0)
    if elastic.size == 0:
        return
    k = elastic[np.argmin(np.abs(modes.natural_frequency[elastic] - sine.frequency))]
    factor = modes.participation_factor[k]
    if is_force(drive):
        factor = system.point_row(drive.at) @ modes.vectors[:, k] / (2.0 * math.pi * modes.natural_frequency[k]) ** 2
    driven = abs(float(factor)) * sine.amplitude
    by_itself = ", alone" if len(system.balls) > 1 else ""
    for pair in system.balls:
        free = pair.free_stiffness == pair.free_damping == pair.acceleration == 0.0
        phi = abs(float(pair.direction @ modes.vectors[:, k]))
        if free and max(pair.gaps) < math.inf and pair.mass * phi**2 > LEAST_RATIO and driven > 0.0:
            own = value_text(pair.gaps[0] if len(set(pair.gaps)) == 1 else pair.gaps, "m")
            of_ball = f"{pair.name}{by_itself}, which has {own}"
            what = f"first gap to try of {of_ball}: best gap of a light loss, mode {k + 1} ({FIRST_GAP})"
            yield row_of(what, math.pi**2 * driven / (8.0 * pair.mass * phi), "m")


# ---- one run without contacts ----------------------------------------------------------------------


def _of_linear_run(
    system: System, excitation: Excitation, duration: float, method: Method | None, initial: State
) -> Iterator[PreflightRow]:
    """Deflection without balls, whether each ball moves at all, and what is left of the start where measuring begins.

    One run with cavities so wide that no ball meets a wall: the ball of a start at rest in space stays there, and its
    gap is the absolute displacement of its place. That run is linear where no stop is met.
    """
    wide = tuple(
        pair if pair.is_stop or not pair.has_walls else replace(pair, gaps=(WIDE, WIDE), law=Rigid(1.0))
        for pair in system.contacts
    )
    bare, record = replace(system, contacts=wide), Recorder(channels=(), ledger=False)
    in_many_pieces = [part for part in parts_in(excitation) if isinstance(part, (Chirp, RandomBase, SteppedSine))]
    # every drive is taken in the pieces of all
    drives = len(getattr(excitation, "drives", (excitation,)))
    cycles = drives * duration * sum(part.frequency for part in in_many_pieces)
    if cycles > MOST_CYCLES:
        yield row_of(f"cycles in pieces, beyond {MOST_CYCLES:g} of which no run without contacts is made", cycles, "1")
        return
    if method is None:
        bare = bare if bare.is_diagonal else reduce(bare, min(MODES, bare.dofs))
        method = EventDriven()
    free = [pair for pair in system.balls if pair.free_stiffness == pair.free_damping == pair.acceleration == 0.0]
    at_rest_in_space = initial.is_at_rest and initial.frame == "space"
    stops = [pair for pair in system.contacts if pair.kind == "stop" and min(pair.gaps) > 0.0]
    met = [*(free if at_rest_in_space else []), *stops]
    names = [f"{pair.name}.gap" for pair in met]
    if any(pair.gaps[0] != pair.gaps[1] for pair in met):
        # these are read, the others found between the readings too
        interval = 1.0 / (SAMPLES * excitation.frequency) if in_many_pieces else None
        record = replace(record, channels=tuple(names), interval=interval if step_of(method) is None else None)
    try:
        run = integrate(bare, excitation, method, duration, record, initial)
        of_place, *of_gaps = run.largest_of((system.default_place, *names))
    except (InputError, DivergenceError):
        return
    if system.length > 0.0:
        yield _deflection(system, abs(of_place.value), "")
    for pair, largest in zip(met, of_gaps, strict=True):
        moved, gap = abs(largest.value), pair.gaps[0]
        if pair.gaps[0] != pair.gaps[1]:
            # to the + and to the - wall, as it was read
            values = run.channels[f"{pair.name}.gap"]
            sides = zip((values.max(), -values.min()), pair.gaps, strict=True)
            moved, gap = max(sides, key=lambda side: side[0] / side[1])
        if pair.is_stop and np.any(run.impacts.impactor == pair.name):
            moved = max(moved, gap)
        of = f"displacement {'at' if pair.is_stop else 'of the place of'} {pair.name} beside its gap"
        instead = f"{pair.name} {'is never met' if pair.is_stop else 'never meets a wall'}: {_nearer(moved, gap)}"
        yield row_of(f"largest {'' if pair.is_stop else 'absolute '}{of}", moved, "m", gap, instead, at_least=True)


def _nearer(moved: float, gap: float) -> str:
    """What brings a wall that is not met within reach: motion without contacts goes with the drive."""
    if moved <= 0.0:
        return "nothing moves"
    return f"take a gap of at most {rounded(moved, math.floor):g} m or a drive {rounded(gap / moved):g} times as large"


# ---- the grid of a sweep ---------------------------------------------------------------------------


def _of_grid(
    system: System, f: Array, cycles: int | None, excitation: Excitation | None, acceleration: Level | None
) -> Iterator[PreflightRow]:
    """Resonances within a sweep, its step beside the width of the first one, its dwell, and the linear peak."""
    bare = without_impactors(system)
    modes = solve_modes(bare, min(MODES, bare.dofs))
    natural = modes.natural_frequency[modes.natural_frequency > 0.0]
    inside = int(np.count_nonzero((natural >= f[0]) & (natural <= f[-1])))
    instead = f"the sweep has no resonance: the first natural frequency is {natural.min(initial=math.inf):.4g} Hz"
    yield row_of("natural frequencies within the sweep", inside, "1", 1, instead, at_least=True)
    yield from step_rows(bare, f, "")
    above = drives_above_modes(Sine(1.0, float(f[-1])), bare.highest_kept, bare.first_left_out)
    what, value, unit, limit, _ = next(above)
    if math.isfinite(limit):
        texts = frequency_warnings(f, bare.highest_kept, bare.first_left_out)
        yield row_of(f"{what}, of the sweep", value, unit, limit, "; ".join(texts))
    if cycles is not None:
        begin = float((cycles - cycles // 3) / f[-1])
        yield from transient_rows(bare, begin, lambda end: f"cycles = {math.ceil(rounded(1.5 * end * float(f[-1])))}")
    amplitude = None
    if acceleration is not None:
        amplitude = level_at(acceleration, f) / (2.0 * np.pi * f) ** 2
    elif isinstance(excitation, Sine):
        amplitude = np.full(f.size, excitation.amplitude)
    if amplitude is not None and bare.length > 0.0:
        yield _deflection(system, _linear_peak(bare, modes, f, amplitude), " of the sweep")


def _deflection(system: System, largest: float, of: str) -> PreflightRow:
    """The largest deflection (m) of a linear run over the length: the same limit as in a run."""
    without = f" without {carried_words(system)}" if system.balls else ""
    what = f"largest deflection{of}{without}, over the length"
    share = largest / system.length
    instead = "; ".join(deflection_warnings(largest, system.length))
    if share > LARGE:
        instead += f"; take at most {rounded(LARGE / share, math.floor):g} of the drive"
    return row_of(what, share, "1", LARGE, instead)


def _linear_peak(bare: System, modes: Modes, f: Array, amplitude: Array) -> float:
    """Largest relative displacement (m) of the default place under amplitudes of the base (m), of the lowest modes."""
    at = bare.point_row(bare.default_place) @ modes.vectors * modes.participation_factor
    omega, drive = 2.0 * np.pi * modes.natural_frequency, (2.0 * np.pi * f[:, None]) ** 2
    below = omega**2 - drive + 2j * modes.damping_ratio * omega * np.sqrt(drive)
    return float((amplitude * np.abs((at * drive / below).sum(axis=1))).max())
