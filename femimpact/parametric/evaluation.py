"""Cases of a block: their systems, their dwells in as few compiled calls as there can be, and their measures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Integers
from femimpact.contact import ContactLaw
from femimpact.errors import FemimpactError, checked, quantity, require_type
from femimpact.excitation import Sine
from femimpact.integrators.cases import SineCases, SineDwellResults, start_of, with_contacts_of
from femimpact.integrators.methods import Method
from femimpact.integrators.runs import run_cases
from femimpact.parametric.definition import ParameterStudy
from femimpact.parametric.history_cases import history_of_case, value_of_history, values_of_case
from femimpact.parametric.measures import INSTANTS, Measure, Source, columns_of, of_response
from femimpact.parametric.paths import Place, Stage, placed_balls, scaled_starts, structure_at_balls, unit_draws
from femimpact.response.channels import resolve_channels
from femimpact.response.response import Recorder, Response
from femimpact.system.modes import with_checked_pairs
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors


@dataclass(frozen=True, eq=False)
class BlockValues:
    """What was found of some cases."""

    cases: Integers  # (n,) their numbers in the study
    values: Array  # (n, starts, measures) not a number where a start failed, or where the measure is a word
    # (n, starts) whether the motion repeats, or has no impacts: another start then has the same values
    periodic: NDArray[np.bool_]
    failures: tuple[str, ...]  # (n starts,) why a start has no values; empty where it has
    words: dict[str, tuple[str, ...]]  # by measure


@dataclass(frozen=True, eq=False)
class _Group:
    """Cases of one system or of systems that are alike, with one method and one kind of start.

    `runs` are theirs, start by start of each case, `members` the numbers of the cases in their block, `values` and
    `system` those of the first of them.
    """

    values: dict[Place, Any]
    system: System
    method: Method
    members: Integers
    runs: SineCases


@dataclass(frozen=True, eq=False)
class _Alike:
    """Systems that are alike but for numbers: `members` are the cases of the block, `system_of` which one each has."""

    values: dict[Place, Any]
    systems: tuple[System, ...]
    members: Integers
    system_of: Integers


class _Answers:
    """The values of a block as they are found."""

    def __init__(self, study: ParameterStudy, cases: Integers) -> None:
        self.study, self.cases = study, cases
        shape = cases.size, study.starts
        self.values = np.full((*shape, len(study.chosen)), np.nan)
        self.periodic = np.zeros(shape, dtype=bool)
        self.failures: list[str] = [""] * (cases.size * study.starts)
        self.words = {item.name: [""] * (cases.size * study.starts) for item in study.chosen if item.is_text}

    def fail(self, runs: Integers, reason: str) -> None:
        """Note why some runs, by their numbers in the block, have no values."""
        self.values.reshape(-1, len(self.study.chosen))[runs] = np.nan
        for run in runs.tolist():
            self.failures[run] = self.failures[run] or " ".join(reason.split())

    def whole(self) -> BlockValues:
        """All of them."""
        words = {name: tuple(column) for name, column in self.words.items()}
        return BlockValues(self.cases, self.values, self.periodic, tuple(self.failures), words)


def evaluated(
    study: ParameterStudy,
    cases: Integers,  # (n,) their numbers
) -> BlockValues:
    """What the study measures of some of its cases.

    A case has the same bits whatever cases stand beside it. A case that cannot be run has a reason in place of
    values; an error that femimpact does not raise itself is not caught.
    """
    answers = _Answers(study, cases)
    if not study.has_cycle:
        _run_histories(study, cases, answers)
        return answers.whole()
    for group in _groups(study, cases, answers):
        _run_group(group, answers)
    return answers.whole()


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

    Returns
    -------
    Response

    Raises
    ------
    InputError
        If there is no such case or start, or the case cannot be run.
    """
    require_type(study, ParameterStudy, "study")
    for key, value, most in (("number", number, study.table.size), ("start", start, study.starts)):
        checked(key, value, quantity("1", at_least=0, at_most=most - 1, integer=True))
    if record is not None:
        require_type(record, Recorder, "record")
    if not study.has_cycle:
        return history_of_case(study, int(number), int(start), Recorder() if record is None else record)
    answers = _Answers(study, np.array([number], dtype=np.int64))
    groups = list(_groups(study, answers.cases, answers))
    if not groups:
        _raise_of_case(study, int(number))
    return _response(groups[0], int(start), Recorder() if record is None else record)


def _raise_of_case(study: ParameterStudy, case: int) -> None:
    """Raise what a case fails with."""
    values = values_of_case(study, case)
    system = study.systems.of(values)
    _laws_of(study, system, case, _axes_of_laws(study))
    study.systems.method_of(system, values)


# ---- from cases to runs ----------------------------------------------------------------------------


def _groups(study: ParameterStudy, cases: Integers, answers: _Answers) -> Iterator[_Group]:
    """Cases that run together; those that have no system are noted as failures."""
    for alike in _alike(study, cases, answers):
        system, values, members = alike.systems[0], alike.values, alike.members
        laws, law_of = _laws(study, system, cases, members, answers)
        sound = law_of >= 0
        for method, own in _methods(study, system, laws, law_of, values, members, answers):
            chosen = own & sound
            if np.any(chosen):
                runs = _runs(study, system, cases[members[chosen]], laws, law_of[chosen], values)
                if len(alike.systems) > 1:
                    runs = _with_systems(study, alike.systems, alike.system_of[chosen], runs)
                runs = _about_structure(runs, system) if study.starts > 1 else _with_all_placed(runs, system)
                yield _Group(values, system, method, members[chosen], runs)


def _alike(study: ParameterStudy, cases: Integers, answers: _Answers) -> list[_Alike]:
    """Systems with their cases; those that differ in numbers alone together where the method takes them so."""
    table = study.table
    axes = table.axes_before(Stage.CASE)
    frames = [axis for axis, place in enumerate(table.places) if place.path == "base.start"]
    codes = [table.codes[axis][cases] for axis in (*axes, *frames)]
    found: dict[Any, list[tuple[dict[Place, Any], System, Integers]]] = {}
    rows = _equal_rows(codes, cases.size)
    for number, members in enumerate(rows):
        values = values_of_case(study, int(cases[members[0]]))
        try:
            system = study.systems.of(values)
        except FemimpactError as error:
            answers.fail(_runs_of(members, study.starts), str(error))
            continue
        key: Any = _kind_of(system, values)
        if len(rows) == 1 or (key not in found and not _taken_together(study, system, values)):
            key = number
        found.setdefault(key, []).append((values, system, members))
    return [
        _Alike(
            parts[0][0],
            tuple(system for _, system, _ in parts),
            np.concatenate([members for *_, members in parts]),
            np.repeat(np.arange(len(parts)), [members.size for *_, members in parts]),
        )
        for parts in found.values()
    ]


def _kind_of(system: System, values: dict[Place, Any]) -> tuple[Any, ...]:
    """What is equal of systems that are alike, and of the methods and the frames of their cases."""
    own = tuple((place.path, value) for place, value in values.items() if place.stage == Stage.METHOD)
    frame = tuple(value for place, value in values.items() if place.path == "base.start")
    pairs = tuple((pair.name, pair.is_stop, pair.gaps, pair.fixed_to, _law_key(pair.law)) for pair in system.contacts)
    return own, frame, system.dofs, system.is_diagonal, pairs


def _law_key(law: ContactLaw) -> Any:
    """Equal laws have equal ones; one that cannot be compared is like itself alone."""
    try:
        hash(law)
    except TypeError:
        return id(law)
    return law


def _taken_together(study: ParameterStudy, system: System, values: dict[Place, Any]) -> bool:
    """Whether the method takes cases with different systems; one that takes none is an error of its cases."""
    try:
        return bool(getattr(study.systems.method_of(system, values), "takes_several_systems", False))
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


def _about_structure(runs: SineCases, common: System) -> SineCases:
    """The runs, those from a static state with their balls about where the structure is there."""
    places, known = runs.ball_displacement.copy(), dict[Any, Any]()
    own = np.column_stack([runs.amplitude, runs.frequency, runs.phase, runs.law_of, runs.gaps.reshape(len(places), -1)])
    for run in range(len(places)):
        system = runs.system(run, common)
        if not (runs.initial.is_static_on(system) or np.any(runs.gaps[run] < 0.0)):
            continue
        key = id(system), own[run].tobytes()
        if key not in known:
            base = Sine(float(runs.amplitude[run]), float(runs.frequency[run]), float(runs.phase[run]))
            try:
                known[key] = structure_at_balls(with_contacts_of(system, runs, run), runs.initial, base)
            except FemimpactError:
                # the run itself says why
                known[key] = 0.0
        places[run] += known[key]
    return replace(runs, ball_displacement=places)


def _with_all_placed(runs: SineCases, common: System) -> SineCases:
    """The runs, those of which axes place some of the balls with the others where they lie."""
    places = runs.ball_displacement.copy()
    left = np.isnan(places)
    for run in np.flatnonzero(left.any(axis=1) & ~left.all(axis=1)).tolist():
        base = Sine(float(runs.amplitude[run]), float(runs.frequency[run]), float(runs.phase[run]))
        # a static state that cannot be found is what the run itself fails with
        with suppress(FemimpactError):
            system = with_contacts_of(runs.system(run, common), runs, run)
            places[run] = placed_balls(places[run], system, runs.initial, base)
    return replace(runs, ball_displacement=places)


def _runs_of(members: Integers, starts: int) -> Integers:
    """Numbers in the block of the runs of some cases."""
    return (members[:, None] * starts + np.arange(starts)).reshape(-1)


def _equal_rows(codes: Sequence[Integers], count: int) -> list[Integers]:
    """Members of each group that has the same codes, in the order of the first of each."""
    if not codes:
        return [np.arange(count)]
    found: dict[tuple[int, ...], list[int]] = {}
    for row, own in enumerate(zip(*(column.tolist() for column in codes), strict=True)):
        found.setdefault(own, []).append(row)
    return [np.array(rows) for rows in found.values()]


def _laws(
    study: ParameterStudy, system: System, cases: Integers, members: Integers, answers: _Answers
) -> tuple[tuple[tuple[ContactLaw, ...], ...], Integers]:
    """Sets of laws, and which of them each member has; -1 where there is no such law."""
    table, axes = study.table, _axes_of_laws(study)
    nominal = tuple(pair.law for pair in system.contacts)
    law_of = np.zeros(members.size, dtype=np.int64)
    if not axes:
        return (nominal,), law_of
    sets = list[tuple[ContactLaw, ...]]()
    for own in _equal_rows([table.codes[axis][cases[members]] for axis, *_ in axes], members.size):
        try:
            sets.append(_laws_of(study, system, int(cases[members[own[0]]]), axes))
            law_of[own] = len(sets) - 1
        except FemimpactError as error:
            answers.fail(_runs_of(members[own], study.starts), str(error))
            law_of[own] = -1
    return tuple(sets), law_of


def _axes_of_laws(study: ParameterStudy) -> list[tuple[int, str, str]]:
    """Axes of numbers of laws, with the pair and the field of each."""
    prefix = "contact."
    return [
        (axis, place.part, place.field.removeprefix(prefix))
        for axis, place in enumerate(study.table.places)
        if place.field.startswith(prefix)
    ]


def _laws_of(
    study: ParameterStudy, system: System, case: int, axes: Sequence[tuple[int, str, str]]
) -> tuple[ContactLaw, ...]:  # fmt: skip
    """The contact laws of a case; all its axes of one law are set in one step, for a law checks its fields together."""
    changes: dict[str, dict[str, Any]] = {}
    for axis, part, name in axes:
        changes.setdefault(part, {})[name] = study.table.value(axis, case)
    laws: list[Any] = [pair.law for pair in system.contacts]
    return tuple(
        replace(law, **changes[pair.name]) if pair.name in changes else law
        for pair, law in zip(system.contacts, laws, strict=True)
    )


def _methods(
    study: ParameterStudy, system: System, laws: tuple[tuple[ContactLaw, ...], ...], law_of: Integers,
    values: dict[Place, Any], members: Integers, answers: _Answers,
) -> list[tuple[Method, NDArray[np.bool_]]]:  # fmt: skip
    """Methods, and which members run by each: a recommended step depends on the contacts."""
    found = list[tuple[Method, NDArray[np.bool_]]]()
    for number, own_laws in enumerate(laws):
        own = law_of == number
        contacts = tuple(
            pair if pair.law is law else replace(pair, law=law)
            for pair, law in zip(system.contacts, own_laws, strict=True)
        )
        alike = all(one is other for one, other in zip(contacts, system.contacts, strict=True))
        try:
            own_system = system if alike else with_checked_pairs(system, contacts)
            method = study.systems.method_of(own_system, values)
        except FemimpactError as error:
            answers.fail(_runs_of(members[own], study.starts), str(error))
            continue
        same = next((i for i, (other, _) in enumerate(found) if other == method), None)
        if same is None:
            found.append((method, own))
        else:
            found[same] = method, found[same][1] | own
        if getattr(method, "takes_several_systems", False):
            # one that takes all contacts as they are: the others need not be asked for
            return [(method, law_of >= 0)]
    return found


def _column(study: ParameterStudy, path: str, cases: Integers, default: Any) -> Array:
    """Values of an axis in some cases, or what stands in its place."""
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
        if place.field == "gap":
            j = next(i for i, pair in enumerate(system.contacts) if pair.name == place.part)
            for row, code in enumerate(table.codes[axis][cases].tolist()):
                gaps[row, j] = table.levels[axis][code]
    return gaps


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
    initial = State.static() if frame == "static" else State.at_rest(frame)
    gaps = _gaps(study, system, cases)
    if starts > 1:
        draws = unit_draws(starts, balls, study.seed)
        placed, moving = scaled_starts(draws, gaps[:, :balls], amplitude * (2.0 * np.pi * frequency))
    else:
        placed, moving = (
            np.stack(
                [_column(study, f"start.{pair.name}.{name}", cases, none) for pair in system.balls]
                or [np.zeros(cases.size)], axis=1,
            )[:, None, :balls]
            # where no axis places a ball it is where the initial state has it
            for name, none in (("position", np.nan), ("speed", 0.0))
        )  # fmt: skip
    return SineCases(
        frequency=np.repeat(frequency, starts),
        amplitude=np.repeat(amplitude, starts),
        phase=np.repeat(phase, starts),
        gaps=np.repeat(gaps, starts, axis=0),
        laws=laws,
        law_of=np.repeat(law_of, starts),
        initial=initial,
        ball_displacement=placed.reshape(cases.size * starts, balls),
        ball_velocity=moving.reshape(cases.size * starts, balls),
        cycles=np.full(cases.size * starts, study.dwell),
        measured=np.full(cases.size * starts, study.dwell // 3),
    )


# ---- from runs to measures -------------------------------------------------------------------------


def _run_group(group: _Group, answers: _Answers) -> None:
    study, names = answers.study, [item.name for item in answers.study.chosen]
    block_runs = _runs_of(group.members, study.starts)
    instants = INSTANTS if "damping" in names else 1
    every = np.arange(block_runs.size)
    for part, found in _found(group.system, group.runs, group.method, study, instants, every, answers, block_runs):
        own, rows = block_runs[part], group.runs.of(part)
        columns = columns_of(found, rows.frequency, rows.measured)
        fine = np.array([not failure for failure in found.failures])
        impacts = columns["impacts_per_cycle"] > 0.0
        answers.periodic.reshape(-1)[own] = fine & ((found.motion.steadiness == "periodic") | ~impacts)
        for run, failure in zip(own.tolist(), found.failures, strict=True):
            if failure:
                answers.fail(np.array([run]), failure)
        flat = answers.values.reshape(-1, len(names))
        for m, name in enumerate(names):
            if name in columns:
                flat[own[fine], m] = columns[name][fine]
        if "peak_ratio" in names:
            bare, reasons = _peaks_without_balls(group, rows, study)
            with np.errstate(divide="ignore", invalid="ignore"):
                flat[own[fine], names.index("peak_ratio")] = (columns["peak"] / bare)[fine]
            for run, reason in zip(own.tolist(), reasons, strict=True):
                if reason:
                    answers.fail(np.array([run]), f"without its balls: {reason}")
            fine &= np.array([not reason for reason in reasons])
        _read_runs(group, part[fine], own[fine], columns, answers)


def _found(
    system: System, runs: SineCases, method: Method, study: ParameterStudy, instants: int, part: Integers,
    answers: _Answers, block_runs: Integers,
) -> Iterator[tuple[Integers, SineDwellResults]]:  # fmt: skip
    """Dwells of some runs; where one cannot be run at all, those of the two halves, so that the others are."""
    try:
        found = run_cases(system, runs.of(part), method, system.point_row(study.observed), instants)
    except FemimpactError as error:
        if part.size == 1:
            answers.fail(block_runs[part], str(error))
            return
        for half in np.array_split(part, 2):
            yield from _found(system, runs, method, study, instants, half, answers, block_runs)
        return
    yield part, found


def _peaks_without_balls(group: _Group, rows: SineCases, study: ParameterStudy) -> tuple[Array, list[str]]:
    """Peak (m) of each run's case with its cavities empty, and why it has none; the same for all starts of a case."""
    bare = without_impactors(group.system)
    stops = len(group.system.balls)
    systems, system_of = _systems_without_balls(rows)
    keys = np.column_stack([rows.frequency, rows.amplitude, rows.phase, system_of])
    if bare.contacts:
        keys = np.column_stack([keys, rows.law_of, rows.gaps[:, stops:].reshape(len(keys), -1)])
    _, first, of_row = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    own = rows.of(first)
    cases = replace(
        own,
        gaps=own.gaps[:, stops:],
        laws=tuple(laws[stops:] for laws in own.laws),
        ball_displacement=np.zeros((first.size, 0)),
        ball_velocity=np.zeros((first.size, 0)),
        systems=systems,
        system_of=system_of[first] if systems else None,
    )
    try:
        method = study.systems.method_of(bare, group.values)
        found = run_cases(bare, cases, method, bare.point_row(study.observed), 0)
    except FemimpactError as error:
        return np.full(of_row.size, np.nan), [str(error)] * of_row.size
    row = of_row.reshape(-1)
    return np.asarray(found.motion.peak[row]), [found.failures[case] for case in row]


def _systems_without_balls(rows: SineCases) -> tuple[tuple[tuple[System, Array], ...], Integers]:
    """The systems of runs without their balls, those with the same matrices once, and which of them each run has."""
    if rows.system_of is None:
        return (), np.zeros(rows.frequency.size, dtype=np.int64)
    number, found = {}, list[tuple[System, Array]]()
    for own in np.unique(rows.system_of).tolist():
        system, row = rows.systems[own]
        same = next((i for i, (other, _) in enumerate(found) if _same_structure(system, other)), None)
        if same is None:
            found.append((without_impactors(system), row))
        number[own] = len(found) - 1 if same is None else same
    return tuple(found), np.array([number[own] for own in rows.system_of.tolist()])


def _same_structure(one: System, other: System) -> bool:
    return all(getattr(one, name) is getattr(other, name) for name in ("M", "C", "K", "expansion"))


def _read_runs(group: _Group, part: Integers, own: Integers, columns: Any, answers: _Answers) -> None:
    """Measures that are read from a separate run of each case."""
    study = answers.study
    asked = [
        (m, item) for m, item in enumerate(study.chosen)
        if item.source is Source.RUN or (item.source is Source.LEDGER and item.name not in columns)
    ]  # fmt: skip
    if not asked:
        return
    flat = answers.values.reshape(-1, len(study.chosen))
    for run, member in zip(own.tolist(), part.tolist(), strict=True):
        frequency = float(group.runs.frequency[member])
        begin = (study.dwell - study.dwell // 3) / frequency
        try:
            response = _response(group, member, _record([item for _, item in asked], begin, group.system))
            for m, item in asked:
                value = of_response(item, response, begin, study.dwell // 3)
                if isinstance(value, str):
                    answers.words[item.name][run] = value
                else:
                    flat[run, m] = value
        except FemimpactError as error:
            answers.fail(np.array([run]), str(error))


def _run_histories(study: ParameterStudy, cases: Integers, answers: _Answers) -> None:
    """Measures of cases whose base has no cycle: of a run of each start over its whole history."""
    ratio = any(item.name == "peak_ratio" for item in study.chosen)
    channels = [str(study.observed), *(item.channel for item in study.chosen if item.channel)]
    usual = [channel.name for channel in resolve_channels(study.nominal, None)]
    whole = any(item.function is not None for item in study.chosen)
    record = Recorder(channels=tuple(dict.fromkeys([*(usual if whole else []), *channels])))
    of_place = Recorder(channels=channels[:1], ledger=False)
    for i, case in enumerate(cases.tolist()):
        for start in range(study.starts):
            run = i * study.starts + start
            try:
                response = history_of_case(study, case, start, record)
                bare = history_of_case(study, case, start, of_place, without_balls=True) if ratio else None
                for m, item in enumerate(study.chosen):
                    answers.values[i, start, m] = (
                        _ratio_of_peaks(response, bare, channels[0])
                        if item.name == "peak_ratio"
                        else value_of_history(item, response, channels[0])
                    )
                answers.periodic[i, start] = len(response.impacts) == 0
            except FemimpactError as error:
                answers.fail(np.array([run]), str(error))


def _ratio_of_peaks(response: Response, bare: Response | None, observed: str) -> float:
    largest = abs(bare.largest(observed).value) if bare is not None else 0.0
    return abs(response.largest(observed).value) / largest if largest > 0.0 else np.nan


def _record(asked: Sequence[Measure], begin: float, system: System) -> Recorder:
    """What a run keeps for its measures; a function of the user's own may read anything of the whole run."""
    channels = [item.channel for item in asked if item.channel]
    if any(item.function is not None for item in asked):
        usual = [channel.name for channel in resolve_channels(system, None)]
        return Recorder(channels=tuple(dict.fromkeys([*usual, *channels])))
    ledger = any(item.source is Source.LEDGER for item in asked)
    return Recorder(channels=tuple(dict.fromkeys(channels)), start=begin, ledger=ledger)


def _response(group: _Group, run: int, record: Recorder) -> Response:
    """A run with its history."""
    runs = group.runs
    system, start = with_contacts_of(runs.system(run, group.system), runs, run), start_of(runs, run)
    base = Sine(float(runs.amplitude[run]), float(runs.frequency[run]), float(runs.phase[run]))
    duration = float(runs.cycles[run]) / base.frequency
    return group.method.run(system, base, duration, record, start)
