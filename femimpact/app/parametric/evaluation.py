"""Values of the cases of a block: dwells in as few compiled calls as possible, and measures read from them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.measures import INSTANTS, Measure, Source, columns_of, of_history, of_response
from femimpact.app.parametric.runs import (
    BlockValues,
    CaseGroup,
    case_groups,
    empty_block,
    equations_of_case,
    history_of_case,
)
from femimpact.arrays import Array, Integers
from femimpact.errors import FemimpactError, checked, quantity, require_type
from femimpact.integrators.cases import SineCases, SineDwellResults
from femimpact.response.channels import resolve_channels
from femimpact.response.response import Recorder, Response
from femimpact.system.system import System, without_impactors


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
        if item.name in columns:
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
    number = dict[int, int]()
    found: dict[tuple[int, ...], tuple[int, tuple[System, Array]]] = {}
    for one in np.unique(rows.system_of).tolist():
        system, row = rows.systems[one]
        matrices = tuple(id(getattr(system, name)) for name in ("M", "C", "K", "expansion"))
        if matrices not in found:
            found[matrices] = len(found), (without_impactors(system), row)
        number[one] = found[matrices][0]
    return tuple(entry for _, entry in found.values()), np.array([number[one] for one in rows.system_of.tolist()])


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
    for run, member in zip(runs.tolist(), part.tolist(), strict=True):
        begin = (study.dwell - measured) / float(group.runs.frequency[member])
        try:
            response = group.response(member, _record([item for _, item in asked], begin, group.system))
            for m, item in asked:
                value = of_response(item, response, begin, measured)
                if isinstance(value, str):
                    block.words[item.name][run] = value
                else:
                    values[run, m] = value
        except FemimpactError as error:
            block.fail(np.array([run]), str(error))


def _record(asked: Sequence[Measure], begin: float, system: System) -> Recorder:
    """The recorder of a run for its measures; a function of the user may read anything of it from its start on."""
    channels = [item.channel for item in asked if item.channel]
    if any(item.function is not None for item in asked):
        return Recorder(channels=_with_default_channels(system, channels))
    ledger = any(item.source is Source.LEDGER for item in asked)
    return Recorder(channels=tuple(dict.fromkeys(channels)), start=begin, ledger=ledger)


def _with_default_channels(system: System, channels: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys([*(channel.name for channel in resolve_channels(system, None)), *channels]))


def _run_histories(study: ParameterStudy, block: BlockValues) -> None:
    """Enter the measures of cases whose base has no cycle: of a run of each start over the complete history."""
    ratio = any(item.name == "peak_ratio" for item in study.chosen)
    observed = str(study.observed)
    channels: Sequence[str] = [observed, *(item.channel for item in study.chosen if item.channel)]
    if any(item.function is not None for item in study.chosen):
        channels = _with_default_channels(study.nominal, channels)
    record = Recorder(channels=tuple(dict.fromkeys(channels)))
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
