"""Runs of the cases of a study: which run together, their laws and methods, where their balls start.

Cases whose base moves by a sine are dwells that a compiled call takes many of at once. Those of any other motion (a
chirp, a random motion, a shock, a record) are separate runs of the complete history.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.paths import Place, Stage, study_with
from femimpact.app.parametric.starts import drawn_state, placed_about_structure, scaled_starts, unit_draws
from femimpact.app.study.study import Study
from femimpact.arrays import Array, Integers
from femimpact.contact import ContactLaw
from femimpact.errors import FemimpactError
from femimpact.excitation import Excitation, Sine
from femimpact.excitation.drives import until
from femimpact.integrators.cases import SineCases, start_of, with_contacts_of
from femimpact.integrators.methods import Method, step_of
from femimpact.integrators.runs import response_by
from femimpact.response.response import Recorder, Response
from femimpact.system.modes import with_checked_pairs
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class BlockValues:
    """Values of some cases of a study, filled as they are computed."""

    cases: Integers  # (n,) their numbers in the study
    values: Array  # (n, starts, measures) not a number where a start failed, or where the measure is a word
    # (n, starts) True where the motion repeats or has no impacts: another start then has the same values
    periodic: Flags
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
    for parts in _cases_by_system(study, block):
        values, system, _ = parts[0]
        systems = tuple(system for _, system, _ in parts)
        members = np.concatenate([members for *_, members in parts])
        system_of = np.repeat(np.arange(len(parts)), [members.size for *_, members in parts])
        laws, law_of = _laws(study, system, members, block)
        for method, chosen in _methods(study, system, laws, law_of, values, members, block):
            runs = _runs(study, system, block.cases[members[chosen]], laws, law_of[chosen], values)
            if len(systems) > 1:
                runs = _with_systems(study, systems, system_of[chosen], runs)
            runs = placed_about_structure(runs, system) if study.starts > 1 else _with_all_placed(runs, system)
            yield CaseGroup(values, system, method, members[chosen], runs)


def raise_of_case(study: ParameterStudy, case: int) -> None:
    """Raise the error for which a case has no system, law or method."""
    values = study.table.values(case)
    system = study.systems.of(values)
    _laws_of_case(study, system, case)
    study.systems.method_of(system, values)


# ---- systems, laws and methods -----------------------------------------------------------------------


def _cases_by_system(
    study: ParameterStudy, block: BlockValues
) -> list[list[tuple[dict[Place, Any], System, Integers]]]:  # fmt: skip
    """Systems with their values and cases; in one list those that differ in numbers alone, unless a step does."""
    table = study.table
    frames = [axis for axis, place in enumerate(table.places) if place.path == "base.start"]
    codes = [table.codes[axis][block.cases] for axis in (*table.axes_before(Stage.CASE), *frames)]
    found: dict[Any, list[tuple[dict[Place, Any], System, Integers]]] = {}
    rows = _equal_rows(codes, block.cases.size)
    for number, members in enumerate(rows):
        values = study.table.values(int(block.cases[members[0]]))
        try:
            system = study.systems.of(values)
        except FemimpactError as error:
            block.fail(block.runs_of(members), str(error))
            continue
        key: Any = _common_of_group(system, values)
        if len(rows) == 1 or (key not in found and not _is_without_step(study, system, values)):
            key = number
        found.setdefault(key, []).append((values, system, members))
    return list(found.values())


def _equal_rows(codes: Sequence[Integers], count: int) -> list[Integers]:
    """Members of each group that has the same codes, in the order of the first of each."""
    if not codes:
        return [np.arange(count)]
    found: dict[tuple[int, ...], list[int]] = {}
    for member, row in enumerate(zip(*(column.tolist() for column in codes), strict=True)):
        found.setdefault(row, []).append(member)
    return [np.array(members) for members in found.values()]


def _common_of_group(system: System, values: dict[Place, Any]) -> tuple[Any, ...]:
    """A key that is equal for cases that may run together: method, frame, dofs and contact pairs."""
    method = tuple((place.path, value) for place, value in values.items() if place.stage == Stage.METHOD)
    frame = tuple(value for place, value in values.items() if place.path == "base.start")
    pairs = tuple((pair.name, pair.is_stop, pair.gaps, pair.fixed_to, _law_key(pair.law)) for pair in system.contacts)
    return method, frame, system.dofs, system.is_diagonal, pairs


def _law_key(law: ContactLaw) -> Any:
    """Equal laws have equal keys; a law without a hash equals only itself."""
    try:
        hash(law)
    except TypeError:
        return id(law)
    return law


def _is_without_step(study: ParameterStudy, system: System, values: dict[Place, Any]) -> bool:
    """True if the method is the same on all systems, without a step; a case without a method fails later."""
    try:
        return step_of(study.systems.method_of(system, values)) is None
    except FemimpactError:
        return False


def _with_systems(
    study: ParameterStudy, systems: tuple[System, ...], system_of: Integers, runs: SineCases
) -> SineCases:  # fmt: skip
    """The runs, each with the system of its case."""
    rows: dict[int, Array] = {}
    for system in systems:
        # of one expansion all places have the same rows
        if id(system.expansion) not in rows:
            rows[id(system.expansion)] = system.point_row(study.observed)
    both = tuple((system, rows[id(system.expansion)]) for system in systems)
    return replace(runs, systems=both, system_of=np.repeat(system_of, study.starts))


def _laws(
    study: ParameterStudy, system: System, members: Integers, block: BlockValues
) -> tuple[tuple[tuple[ContactLaw, ...], ...], Integers]:
    """Sets of laws, and which of them each member has; -1 where there is no such law."""
    table, axes = study.table, _axes_of_laws(study)
    law_of = np.zeros(members.size, dtype=np.int64)
    if not axes:
        return (tuple(pair.law for pair in system.contacts),), law_of
    sets = list[tuple[ContactLaw, ...]]()
    for rows in _equal_rows([table.codes[axis][block.cases[members]] for axis, *_ in axes], members.size):
        try:
            sets.append(_laws_of_case(study, system, int(block.cases[members[rows[0]]])))
            law_of[rows] = len(sets) - 1
        except FemimpactError as error:
            block.fail(block.runs_of(members[rows]), str(error))
            law_of[rows] = -1
    return tuple(sets), law_of


def _axes_of_laws(study: ParameterStudy) -> list[tuple[int, str, str]]:
    """Axes of numbers of laws, with the pair and the field of each."""
    prefix = "contact."
    return [
        (axis, place.part, place.field.removeprefix(prefix))
        for axis, place in enumerate(study.table.places)
        if place.field.startswith(prefix)
    ]


def _laws_of_case(study: ParameterStudy, system: System, case: int) -> tuple[ContactLaw, ...]:
    """The contact laws of a case; all its axes of one law are set in one step, for a law checks its fields together."""
    changes: dict[str, dict[str, Any]] = {}
    for axis, part, name in _axes_of_laws(study):
        changes.setdefault(part, {})[name] = study.table.value(axis, case)
    pairs: Any = system.contacts
    return tuple(replace(pair.law, **changes[pair.name]) if pair.name in changes else pair.law for pair in pairs)


def _methods(
    study: ParameterStudy, system: System, laws: tuple[tuple[ContactLaw, ...], ...], law_of: Integers,
    values: dict[Place, Any], members: Integers, block: BlockValues,
) -> list[tuple[Method, Flags]]:  # fmt: skip
    """Methods, and which members run by each: a recommended step depends on the contacts."""
    found = list[tuple[Method, Flags]]()
    for number, laws_of_set in enumerate(laws):
        chosen = law_of == number
        contacts = tuple(
            pair if pair.law is law else replace(pair, law=law)
            for pair, law in zip(system.contacts, laws_of_set, strict=True)
        )
        same = all(one is other for one, other in zip(contacts, system.contacts, strict=True))
        try:
            method = study.systems.method_of(system if same else with_checked_pairs(system, contacts), values)
        except FemimpactError as error:
            block.fail(block.runs_of(members[chosen]), str(error))
            continue
        equal = next((i for i, (other, _) in enumerate(found) if other == method), None)
        if equal is None:
            found.append((method, chosen))
        else:
            found[equal] = method, found[equal][1] | chosen
        if step_of(method) is None:
            # no step depends on the contacts: the other sets need not be asked for
            return [(method, law_of >= 0)]
    return found


# ---- runs and their starts ---------------------------------------------------------------------------


def _base_of(runs: SineCases, run: int) -> Sine:
    return Sine(float(runs.amplitude[run]), float(runs.frequency[run]), float(runs.phase[run]))


def _runs(
    study: ParameterStudy, system: System, cases: Integers, laws: tuple[tuple[ContactLaw, ...], ...],
    law_of: Integers, values: dict[Place, Any],
) -> SineCases:  # fmt: skip
    """The runs of some cases with one system, start by start of each case."""
    base, starts, balls = study.base, study.starts, len(system.balls)
    frequency, amplitude, phase = (
        _column(study, f"base.{name}", cases, base[name]) for name in ("frequency", "amplitude", "phase")
    )
    frame = next((value for place, value in values.items() if place.path == "base.start"), base["start"])
    gaps = _gaps(study, system, cases)
    if starts > 1:
        draws = unit_draws(starts, balls, study.seed)
        placed, moving = scaled_starts(draws, gaps[:, :balls], amplitude * (2.0 * np.pi * frequency))
    else:
        placed, moving = (column[:, None] for column in _starts_of_balls(study, system, cases))
    return SineCases(
        frequency=np.repeat(frequency, starts),
        amplitude=np.repeat(amplitude, starts),
        phase=np.repeat(phase, starts),
        gaps=np.repeat(gaps, starts, axis=0),
        laws=laws,
        law_of=np.repeat(law_of, starts),
        initial=State.static() if frame == "static" else State.at_rest(frame),
        ball_displacement=placed.reshape(cases.size * starts, balls),
        ball_velocity=moving.reshape(cases.size * starts, balls),
        cycles=np.full(cases.size * starts, study.dwell),
        measured=np.full(cases.size * starts, study.dwell // 3),
    )


def _starts_of_balls(study: ParameterStudy, system: System, cases: Integers) -> Iterator[Array]:
    """Places (m) and speeds (m/s) of the balls that axes give, (cases, balls): not a number is the initial state's."""
    for name, default in (("position", np.nan), ("speed", 0.0)):
        rows = [_column(study, f"start.{pair.name}.{name}", cases, default) for pair in system.balls]
        yield np.reshape(rows, (len(rows), cases.size)).T


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
                gaps[row, j] = table.levels[axis][code]
    return gaps


def _with_all_placed(runs: SineCases, common: System) -> SineCases:
    """The runs; where axes place some of the balls the others have the places of the initial state."""
    places = runs.ball_displacement.copy()
    left = np.isnan(places)
    for run in np.flatnonzero(left.any(axis=1) & ~left.all(axis=1)).tolist():
        # a static state that cannot be found is what the run itself fails with
        with suppress(FemimpactError):
            system = with_contacts_of(runs.system(run, common), runs, run)
            places[run] = _placed_balls(places[run], system, runs.initial, _base_of(runs, run))
    return replace(runs, ball_displacement=places)


def _placed_balls(
    given: Array,  # (balls,) m: not a number where no axis places a ball; zero is a place as any other
    system: System,
    initial: State,  # from which the run starts
    base: Excitation,
) -> Array:
    """Displacements (m) of the balls, (balls,): given ones, the others those of the initial state; none if none is."""
    left = np.isnan(given)
    if left.all() or not left.any():
        return given
    if not initial.is_static_on(system):
        return np.where(left, 0.0, given)
    *_, initial_displacement, _ = initial.relative_to_base(system, base)
    return np.where(left, initial_displacement[: given.size], given)


# ---- runs of a history -------------------------------------------------------------------------------


def history_of_case(
    study: ParameterStudy, case: int, start: int, record: Recorder, without_balls: bool = False
) -> Response:  # fmt: skip
    """The run of one start of a case whose base has no cycle.

    Raises `InputError` if the case cannot be run.
    """
    values = study.table.values(case)
    given: Any = study.study
    changed = study_with(given, {place: value for place, value in values.items() if place.stage is Stage.CASE})
    structure: Any = changed.structure
    bodies = {item.name: item for item in (*structure.impactors, *structure.absorbers, *structure.stops)}
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
    state, base = changed.initial, changed.excitation
    if study.starts > 1:
        draws = unit_draws(study.starts, len(system.balls), study.seed)[start]
        return drawn_state(system, state, base, changed.history_duration, draws)
    placed, moving = (rows[0] for rows in _starts_of_balls(study, system, np.array([case])))
    placed = _placed_balls(placed, system, state, base)
    # what is not given may be that of the static state
    given: dict[str, Any] = {"ball_displacement": placed} if placed.size and not np.isnan(placed).any() else {}
    if np.any(moving):
        given["ball_velocity"] = moving
    return replace(state, **given)
