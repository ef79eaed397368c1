"""Runs of the cases of a study: which run together, where their balls start, and the measures read from them.

Cases whose base moves by a sine are dwells that a compiled call takes many of at once. Those of any other motion (a
chirp, a random motion, a shock, a record) are separate runs of the complete history.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.measures import INSTANTS, Measure, Source, columns_of, of_history, of_response
from femimpact.app.parametric.paths import Place, Stage, study_with
from femimpact.app.study.start import state_of
from femimpact.app.study.study import Study
from femimpact.arrays import Array, Integers
from femimpact.contact.law import ContactLaw
from femimpact.errors import FemimpactError, checked, quantity, require_type, warns
from femimpact.excitation.drives import until
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.cases import SineCases, SineDwellResults, start_of, with_balls, with_contacts_of
from femimpact.integrators.methods import Method, step_of
from femimpact.integrators.runs import response_by
from femimpact.response.channels import resolve_channels
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import gaps_with
from femimpact.system.state import State
from femimpact.system.system import System, with_checked_pairs, without_impactors

HISTORY_INSTANTS = 4096
"""Of a motion at which its largest speed is looked for, which scales the speeds of starts."""


@dataclass(frozen=True, eq=False)
class BlockValues:
    """Values of some cases of a study, filled as they are computed."""

    cases: Integers  # (n,) their numbers in the study
    values: Array  # (n, starts, measures) not a number where a start failed, or where the measure is a word
    # (n, starts) True where the motion repeats or has no impacts: another start then has the same values
    periodic: NDArray[np.bool_]
    failures: list[str]  # (n starts,) why a start has no values; empty where it has
    words: dict[str, list[str]]  # by measure, (n starts,)

    def runs_of(
        self,
        members: Integers,  # numbers of cases in the block
    ) -> Integers:
        """Numbers in the block of all runs of some cases."""
        starts = self.periodic.shape[1]
        return np.asarray((members[:, None] * starts + np.arange(starts)).reshape(-1))

    def fail(
        self,
        runs: Integers,  # numbers in the block
        reason: str,
    ) -> None:
        """Record why some runs have no values; the first reason stays."""
        self.values.reshape(-1, self.values.shape[2])[runs] = np.nan
        for run in runs.tolist():
            self.failures[run] = self.failures[run] or " ".join(reason.split())


def empty_block(study: ParameterStudy, cases: Integers) -> BlockValues:
    """A block of cases without values."""
    shape = cases.size, study.starts
    return BlockValues(
        cases,
        values=np.full((*shape, len(study.chosen)), np.nan),
        periodic=np.zeros(shape, dtype=bool),
        failures=[""] * (cases.size * study.starts),
        words={item.name: [""] * (cases.size * study.starts) for item in study.chosen if item.is_text},
    )


@dataclass(frozen=True, eq=False)
class CaseGroup:
    """Cases of a block that run together by one method: those of one system, or of systems that differ in numbers."""

    values: dict[Place, Any]  # of the first case
    system: System  # of the first case
    method: Method
    members: Integers  # numbers of the cases in the block
    runs: SineCases  # start by start of each case

    def response(self, run: int, record: Recorder) -> Response:
        """One of the runs with its history."""
        system = with_contacts_of(self.runs.system(run, self.system), self.runs, run)
        base = _base_of(self.runs, run)
        duration = float(self.runs.cycles[run]) / base.frequency
        return response_by(self.method, system, base, duration, record, start_of(self.runs, run))


def case_groups(study: ParameterStudy, block: BlockValues) -> Iterator[CaseGroup]:
    """Groups of the cases of a block; cases that have no system, law or method are recorded as failed."""
    groups: dict[Any, list[tuple[_Equations, Integers]]] = {}
    of_system: dict[Any, Method] = {}
    table = study.table
    laws = [axis for axis, *_ in _axes_of_laws(study)]
    frames = [axis for axis, place in enumerate(table.places) if place.path == "base.start"]
    axes = (*table.axes_before(Stage.CASE), *frames, *laws)
    for members in _equal_rows([table.codes[axis][block.cases] for axis in axes], block.cases.size):
        try:
            equations = equations_of_case(study, int(block.cases[members[0]]), of_system)
        except FemimpactError as error:
            block.fail(block.runs_of(members), str(error))
            continue
        groups.setdefault(equations.key, []).append((equations, members))
    for parts in groups.values():
        yield _group_of(study, block, parts)


def _group_of(study: ParameterStudy, block: BlockValues, parts: Sequence[tuple[_Equations, Integers]]) -> CaseGroup:
    """The group of cases that run together."""
    first = parts[0][0]
    members = np.concatenate([members for _, members in parts])
    sizes = [members.size for _, members in parts]
    systems = {id(equations.system): equations.system for equations, _ in parts}
    laws = {equations.law_values: equations.laws for equations, _ in parts}
    numbers: dict[Any, int] = {key: number for keys in (systems, laws) for number, key in enumerate(keys)}
    system_of, law_of = (
        np.repeat([numbers[key] for key in keys], sizes)
        for keys in zip(*((id(equations.system), equations.law_values) for equations, _ in parts), strict=True)
    )
    runs = _runs(study, first, block.cases[members], tuple(laws.values()), law_of)
    if len(systems) > 1:
        both = tuple((system, system.point_row(study.observed)) for system in systems.values())
        runs = replace(runs, systems=both, system_of=np.repeat(system_of, study.starts))
    return CaseGroup(first.values, first.system, first.method, members, _with_placed_balls(runs, first.system, study))


# ---- systems, laws and methods -----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Equations:
    """What cases that differ in gaps, sine and places of balls alone have in common."""

    values: dict[Place, Any]  # of one of the cases
    system: System  # with the laws and gaps of the study
    laws: tuple[ContactLaw, ...]  # of the pairs
    law_values: tuple[Any, ...]  # those that axes give to the laws
    method: Method
    initial: State

    @property
    def key(self) -> Any:
        """Equal for cases that may run together: by a method with a step those of one system."""
        # what is displaced or moves has the dofs of its system
        start = self.initial.frame, self.initial.equilibrium, None if self.initial.is_at_rest else id(self.system)
        if step_of(self.method) is not None:
            return id(self.system), start, _key(self.method)
        pairs = self.system.contacts
        return (
            self.system.dofs, self.system.is_diagonal, start, _key(self.method),
            tuple((pair.name, pair.is_stop, pair.gaps, pair.fixed_to, _key(pair.law)) for pair in pairs),
        )  # fmt: skip


def equations_of_case(study: ParameterStudy, case: int, of_system: dict[Any, Method] | None = None) -> _Equations:
    """System, laws and method of a case.

    A method without a step does not depend on the laws: `of_system` keeps it for other cases of a system.
    """
    values = study.table.values(case)
    system = study.systems.of(values)
    changes: dict[str, dict[str, Any]] = {}
    for axis, part, name in _axes_of_laws(study):
        changes.setdefault(part, {})[name] = study.table.value(axis, case)
    # all axes of one law are set in one step, for a law checks its fields together
    contacts: Any = tuple(
        replace(pair, law=replace(pair.law, **changes[pair.name])) if pair.name in changes else pair  # type: ignore[type-var]
        for pair in system.contacts
    )
    known = {} if of_system is None else of_system
    key = id(system), *(value for place, value in values.items() if place.stage == Stage.METHOD)
    method = known.get(key)
    if method is None:
        method = study.systems.method_of(with_checked_pairs(system, contacts) if changes else system, values)
        if step_of(method) is None:
            known[key] = method
    frame = next((value for place, value in values.items() if place.path == "base.start"), study.base["start"])
    begins = getattr(study.study, "begins", ())
    rest = State.static() if frame == "static" else State.at_rest(frame)
    initial = state_of(begins, system) if begins else rest
    law_values = tuple(study.table.value(axis, case) for axis, *_ in _axes_of_laws(study))
    return _Equations(values, system, tuple(pair.law for pair in contacts), law_values, method, initial)


def _axes_of_laws(study: ParameterStudy) -> list[tuple[int, str, str]]:
    """Axes of numbers of laws, with the pair and the field of each."""
    prefix = "contact."
    return [
        (axis, place.part, place.field.removeprefix(prefix))
        for axis, place in enumerate(study.table.places)
        if place.field.startswith(prefix)
    ]


def _equal_rows(codes: Sequence[Integers], count: int) -> list[Integers]:
    """Members of each group that has the same codes, in the order of the first of each."""
    if not codes:
        return [np.arange(count)]
    found: dict[tuple[int, ...], list[int]] = {}
    for member, row in enumerate(zip(*(column.tolist() for column in codes), strict=True)):
        found.setdefault(row, []).append(member)
    return [np.array(members) for members in found.values()]


def _key(noun: Any) -> Any:
    """Equal laws and methods have equal keys; what has no hash equals only itself."""
    try:
        hash(noun)
    except TypeError:
        return id(noun)
    return noun


# ---- runs ----------------------------------------------------------------------------------------------


def _base_of(runs: SineCases, run: int) -> Sine:
    return Sine(float(runs.amplitude[run]), float(runs.frequency[run]), float(runs.phase[run]))


def _runs(
    study: ParameterStudy, equations: _Equations, cases: Integers, laws: tuple[tuple[ContactLaw, ...], ...],
    law_of: Integers,
) -> SineCases:  # fmt: skip
    """The runs of some cases with one system, start by start of each case."""
    base, starts, balls = study.base, study.starts, len(equations.system.balls)
    by = "acceleration" if "acceleration" in base else "amplitude"
    frequency, amplitude, phase = (
        _column(study, f"base.{name}", cases, base[name]) for name in ("frequency", by, "phase")
    )
    if by == "acceleration":
        amplitude = amplitude / (2.0 * np.pi * frequency) ** 2
    gaps = _gaps(study, equations.system, cases)
    if starts > 1:
        draws = unit_draws(starts, balls, study.seed)
        placed, moving = scaled_starts(draws, gaps[:, :balls], amplitude * (2.0 * np.pi * frequency))
    else:
        placed, moving = (column[:, None] for column in _starts_of_balls(study, equations.system, cases))
    return SineCases(
        frequency=np.repeat(frequency, starts),
        amplitude=np.repeat(amplitude, starts),
        phase=np.repeat(phase, starts),
        gaps=np.repeat(gaps, starts, axis=0),
        laws=laws,
        law_of=np.repeat(law_of, starts),
        initial=equations.initial,
        ball_displacement=placed.reshape(cases.size * starts, balls),
        ball_velocity=moving.reshape(cases.size * starts, balls),
        cycles=np.full(cases.size * starts, study.dwell),
        measured=np.full(cases.size * starts, study.dwell // 3),
    )


def _column(study: ParameterStudy, path: str, cases: Integers, default: Any) -> Array:
    """Values of an axis in some cases; without such an axis the default."""
    table = study.table
    for axis, place in enumerate(table.places):
        if place.path == path:
            codes = table.codes[axis][cases]
            levels = table.levels[axis]
            if len(levels) > codes.size:
                return np.array([levels[code] for code in codes.tolist()], dtype=float)
            return np.asarray(np.array(levels, dtype=float)[codes])
    return np.full(cases.size, float(default))


def _gaps(study: ParameterStudy, system: System, cases: Integers) -> Array:
    """Gaps (n, pairs, 2) in m."""
    gaps = np.tile(np.array([pair.gaps for pair in system.contacts], dtype=float).reshape(-1, 2), (cases.size, 1, 1))
    table = study.table
    for axis, place in enumerate(table.places):
        # an argument of a function may have this name
        if place.field == "gap" and place.owner != "function":
            j = next(i for i, pair in enumerate(system.contacts) if pair.name == place.part)
            for row, code in enumerate(table.codes[axis][cases].tolist()):
                gaps[row, j] = gaps_with(system.contacts[j].gaps, table.levels[axis][code])
    return gaps


# ---- where balls start ---------------------------------------------------------------------------------


def unit_draws(starts: int, balls: int, seed: int) -> Array:
    """Numbers (starts, balls, 2) from 0 to 1, for the place and the speed of each ball; those of fewer starts first."""
    return np.random.default_rng(seed).random((starts, balls, 2))


def scaled_starts(
    draws: Array,  # (starts, balls, 2)
    gaps: Array,  # (cases, balls, 2) m: to the + and to the - side
    speed: Array,  # (cases,) m/s: amplitude times angular frequency of the base
) -> tuple[Array, Array]:  # (cases, starts, balls) m and m/s
    """Places of balls, uniform in their gaps, and speeds, uniform within +- a speed, relative to the structure.

    The body of an absorber, without walls, is in the middle.
    """
    plus, minus = np.moveaxis(np.where(np.isfinite(gaps), gaps, 0.0)[:, None], -1, 0)
    displacement = -minus + (plus + minus) * draws[None, :, :, 0]
    return displacement, speed[:, None, None] * (2.0 * draws[None, :, :, 1] - 1.0)


def _starts_of_balls(study: ParameterStudy, system: System, cases: Integers) -> Iterator[Array]:
    """Places (m) and speeds (m/s) of the balls that axes give, (cases, balls): not a number is the initial state's."""
    for name, default in (("position", np.nan), ("speed", 0.0)):
        rows = [_column(study, f"start.{pair.name}.{name}", cases, default) for pair in system.balls]
        yield np.reshape(rows, (len(rows), cases.size)).T


def _placed_balls(
    places: Array,  # (starts, balls) m: not a number where no axis places a ball; zero is a place as any other
    are_drawn: bool,
    system: System,
    initial: State,  # from which the run starts
    base: Excitation,
) -> Array:
    """Displacements (m) of the balls, (starts, balls): of a static state drawn ones are about the structure.

    Where axes place some of the balls, the others are where the initial state has them.
    """
    left = np.isnan(places)
    if left.all() or not (are_drawn or left.any()):
        return places
    if initial.is_at_rest and not initial.is_static_on(system):
        return np.where(left, 0.0, places)
    u, _, y, _ = initial.relative_to_base(system, base)
    if are_drawn:
        return np.asarray(places + np.array([pair.direction @ u for pair in system.balls]))
    return np.where(left, y[: places.shape[1]], places)


def _with_placed_balls(runs: SineCases, common: System, study: ParameterStudy) -> SineCases:
    """The runs with the places of their balls as of `_placed_balls`."""
    starts, are_drawn = study.starts, study.starts > 1
    places = runs.ball_displacement.reshape(runs.frequency.size // starts, starts, len(common.balls)).copy()
    left = np.isnan(places[:, 0])
    is_bent = (not runs.initial.is_at_rest) | runs.initial.equilibrium | (runs.gaps[::starts] < 0.0).any(axis=(1, 2))
    for case in np.flatnonzero(is_bent if are_drawn else left.any(axis=1) & ~left.all(axis=1)).tolist():
        # a static state that cannot be found is what the run itself fails with
        with suppress(FemimpactError):
            system = with_contacts_of(runs.system(case * starts, common), runs, case * starts)
            places[case] = _placed_balls(places[case], are_drawn, system, runs.initial, _base_of(runs, case * starts))
    return replace(runs, ball_displacement=places.reshape(runs.ball_displacement.shape))


def drawn_state(
    system: System,
    initial: State,
    base: Excitation,
    duration: float,  # s: of the run
    draws: Array,  # (balls, 2) of one start, as of `unit_draws`
) -> State:
    """The start of a history with its balls where the numbers have them, about the structure."""
    gaps = np.array([[pair.gaps for pair in system.balls]], dtype=float).reshape(1, len(system.balls), 2)
    placed, moving = (both[0] for both in scaled_starts(draws[None], gaps, _largest_speed(base, duration)))
    return with_balls(initial, _placed_balls(placed, True, system, initial, base)[0], moving[0])


def _largest_speed(base: Excitation, duration: float) -> Array:
    """Largest speed of the base (m/s), (1,)."""
    if isinstance(base, Sine):
        return np.array([base.amplitude * (2.0 * np.pi * base.frequency)])
    return np.array([float(np.abs(base.velocity(np.linspace(0.0, duration, HISTORY_INSTANTS))).max())])


# ---- runs of a history -------------------------------------------------------------------------------


def history_of_case(
    study: ParameterStudy, case: int, start: int, record: Recorder, without_balls: bool = False
) -> Response:  # fmt: skip
    """The run of one start of a case whose base has no cycle."""
    values = study.table.values(case)
    given: Any = study.study
    changed = study_with(given, {place: value for place, value in values.items() if place.stage is Stage.CASE})
    structure: Any = changed.structure
    bodies = {
        item.name: item for item in (*structure.impactors, *structure.absorbers, *structure.stops, *structure.meetings)
    }
    system = study.systems.of(values)
    contacts = tuple(
        replace(pair, gaps=bodies[pair.name].gaps, law=bodies[pair.name].contact) for pair in system.contacts
    )
    system = with_checked_pairs(system, contacts)
    state = _start_of_history(study, system, changed, case, start)
    if without_balls:
        system, state = without_impactors(system), replace(state, ball_displacement=None, ball_velocity=None)
    method = study.systems.method_of(system, values)
    duration = changed.history_duration
    drive = until(changed.excitation, state.time + duration + 0.5 * (record.interval or 0.0))
    return response_by(method, system, drive, duration, record, state)


def _start_of_history(
    study: ParameterStudy, system: System, changed: Study, case: int, start: int
) -> State:  # fmt: skip
    """The start of a case: that of its base, with the balls where the axes or the draws have them."""
    state, base = changed.initial_on(system), changed.excitation
    if study.starts > 1:
        draws = unit_draws(study.starts, len(system.balls), study.seed)[start]
        return drawn_state(system, state, base, changed.history_duration, draws)
    placed, moving = _starts_of_balls(study, system, np.array([case]))
    return with_balls(state, _placed_balls(placed, False, system, state, base)[0], moving[0])


def evaluated(
    study: ParameterStudy,
    cases: Integers,  # (n,) their numbers
) -> BlockValues:
    """Values of all measures for some cases of a study.

    A case has the same bits whatever cases stand beside it. A case that cannot be run has a reason in place of
    values; an error that femimpact does not raise itself is not caught.
    """
    block = empty_block(study, cases)
    if not study.has_cycle:
        _run_histories(study, block)
        return block
    for group in case_groups(study, block):
        for part, found in _dwells(study, group, np.arange(group.runs.frequency.size), block):
            _enter_dwells(study, group, part, found, block)
    return block


@warns
def run_case(study: ParameterStudy, number: int, start: int = 0, record: Recorder | None = None) -> Response:
    """A run of one start of one case of a parameter study, with its history.

    Parameters
    ----------
    study : ParameterStudy
    number : int
        Of the case from 0, in the order of the dataset: of a grid the last axis is the fastest.
    start : int
        Of its starts, from 0.
    record : Recorder, optional
        What is kept.
    """
    require_type(study, ParameterStudy, "study")
    for key, value, most in (("number", number, study.table.size), ("start", start, study.starts)):
        checked(key, value, quantity("1", at_least=0, at_most=most - 1, integer=True))
    if record is not None:
        require_type(record, Recorder, "record")
    record = Recorder() if record is None else record
    if not study.has_cycle:
        return history_of_case(study, int(number), int(start), record)
    groups = list(case_groups(study, empty_block(study, np.array([number], dtype=np.int64))))
    if not groups:
        equations_of_case(study, int(number))
    return groups[0].response(int(start), record)


# ---- dwells ------------------------------------------------------------------------------------------


def _dwells(
    study: ParameterStudy,
    group: CaseGroup,
    part: Integers,  # numbers of runs of the group
    block: BlockValues,
) -> Iterator[tuple[Integers, SineDwellResults]]:
    """Dwells of some runs; where one cannot be run at all, those of the two halves, so that the others are."""
    instants = INSTANTS if any(item.name == "damping" for item in study.chosen) else 1
    try:
        row = group.system.point_row(study.observed)
        found = group.method.run_cases(group.system, group.runs.of(part), row, instants, workers=1)
    except FemimpactError as error:
        if part.size == 1:
            block.fail(block.runs_of(group.members)[part], str(error))
            return
        for half in np.array_split(part, 2):
            yield from _dwells(study, group, half, block)
        return
    yield part, found


def _enter_dwells(
    study: ParameterStudy, group: CaseGroup, part: Integers, found: SineDwellResults, block: BlockValues
) -> None:  # fmt: skip
    """Enter the measures of some runs of a group into the block."""
    rows, runs = group.runs.of(part), block.runs_of(group.members)[part]
    columns = columns_of(found, rows.frequency, rows.measured)
    if any(item.name == "peak_ratio" for item in study.chosen):
        bare, reasons = _peaks_without_balls(study, group, rows)
        with np.errstate(divide="ignore", invalid="ignore"):
            columns["peak_ratio"] = columns["peak"] / bare
    else:
        reasons = [""] * part.size
    completed = np.array([not failure for failure in found.failures])
    without_impacts = ~(columns["impacts_per_cycle"] > 0.0)
    block.periodic.reshape(-1)[runs] = completed & ((found.motion.steadiness == "periodic") | without_impacts)
    values = block.values.reshape(-1, len(study.chosen))
    for m, item in enumerate(study.chosen):
        if item.function is None and item.name in columns:
            values[runs[completed], m] = columns[item.name][completed]
    for run, failure, reason in zip(runs.tolist(), found.failures, reasons, strict=True):
        if failure or reason:
            block.fail(np.array([run]), failure or f"without its balls: {reason}")
    completed &= np.array([not reason for reason in reasons])
    _enter_separate_runs(study, group, part[completed], runs[completed], columns, block)


def _peaks_without_balls(study: ParameterStudy, group: CaseGroup, rows: SineCases) -> tuple[Array, list[str]]:
    """Peak (m) of each run's case with its cavities empty, and why it has none; the same for all starts of a case."""
    bare = without_impactors(group.system)
    stops = len(group.system.balls)
    systems, system_of = _systems_without_balls(rows)
    keys = np.column_stack([rows.frequency, rows.amplitude, rows.phase, system_of])
    if bare.contacts:
        keys = np.column_stack([keys, rows.law_of, rows.gaps[:, stops:].reshape(len(keys), -1)])
    _, first, of_row = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    cases = rows.of(first)
    cases = replace(
        cases,
        gaps=cases.gaps[:, stops:],
        laws=tuple(laws[stops:] for laws in cases.laws),
        ball_displacement=np.zeros((first.size, 0)),
        ball_velocity=np.zeros((first.size, 0)),
        systems=systems,
        system_of=system_of[first] if systems else None,
    )
    try:
        method = study.systems.method_of(bare, group.values)
        found = method.run_cases(bare, cases, bare.point_row(study.observed), 0, workers=1)
    except FemimpactError as error:
        return np.full(of_row.size, np.nan), [str(error)] * of_row.size
    row = of_row.reshape(-1)
    return np.asarray(found.motion.peak[row]), [found.failures[case] for case in row]


def _systems_without_balls(rows: SineCases) -> tuple[tuple[tuple[System, Array], ...], Integers]:
    """The systems of runs without their balls, those with the same matrices once, and which of them each run has."""
    if rows.system_of is None:
        return (), np.zeros(rows.frequency.size, dtype=np.int64)
    matrices = [tuple(id(getattr(system, name)) for name in ("M", "C", "K", "expansion")) for system, _ in rows.systems]
    bare = {key: (without_impactors(system), row) for key, (system, row) in zip(matrices, rows.systems, strict=True)}
    numbers = {key: number for number, key in enumerate(bare)}
    return tuple(bare.values()), np.array([numbers[key] for key in matrices])[rows.system_of]


# ---- separate runs -----------------------------------------------------------------------------------


def _enter_separate_runs(
    study: ParameterStudy, group: CaseGroup, part: Integers, runs: Integers, columns: Mapping[str, Array],
    block: BlockValues,
) -> None:  # fmt: skip
    """Enter the measures that are read from a separate run of each case."""
    asked = [
        (m, item) for m, item in enumerate(study.chosen)
        if item.source is Source.RUN or (item.source is Source.LEDGER and item.name not in columns)
    ]  # fmt: skip
    if not asked:
        return
    measured = study.dwell // 3
    values = block.values.reshape(-1, len(study.chosen))
    # a function of the user may read anything of a run, from its start on
    whole = any(item.function is not None for _, item in asked)
    ledger = whole or any(item.source is Source.LEDGER for _, item in asked)
    record = Recorder(channels=_channels([item for _, item in asked], group.system), ledger=ledger)
    for run, member in zip(runs.tolist(), part.tolist(), strict=True):
        begin = (study.dwell - measured) / float(group.runs.frequency[member])
        try:
            response = group.response(member, record if whole else replace(record, start=begin))
            for m, item in asked:
                value = of_response(item, response, begin, measured)
                if isinstance(value, str):
                    block.words[item.name][run] = value
                else:
                    values[run, m] = value
        except FemimpactError as error:
            block.fail(np.array([run]), str(error))


def _channels(asked: Sequence[Measure], system: System, *others: str) -> tuple[str, ...]:
    """The channels of measures and others; a function of the user may read the default ones, too."""
    of_functions = resolve_channels(system, None) if any(item.function is not None for item in asked) else ()
    of_measures = [item.channel for item in asked if item.channel]
    return tuple(dict.fromkeys([*(channel.name for channel in of_functions), *others, *of_measures]))


def _run_histories(study: ParameterStudy, block: BlockValues) -> None:
    """Enter the measures of cases whose base has no cycle: of a run of each start over the complete history."""
    ratio = any(item.name == "peak_ratio" for item in study.chosen)
    observed = str(study.observed)
    record = Recorder(channels=_channels(study.chosen, study.nominal, observed))
    of_place = Recorder(channels=(observed,), ledger=False)
    for i, case in enumerate(block.cases.tolist()):
        for start in range(study.starts):
            try:
                response = history_of_case(study, case, start, record)
                bare = history_of_case(study, case, start, of_place, without_balls=True) if ratio else None
                for m, item in enumerate(study.chosen):
                    block.values[i, start, m] = of_history(item, response, observed, bare)
                block.periodic[i, start] = len(response.impacts) == 0
            except FemimpactError as error:
                block.fail(np.array([i * study.starts + start]), str(error))
