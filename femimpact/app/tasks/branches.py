"""`femimpact orbits`: the branches of periodic orbits of a study over one of its numbers, and their files."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from femimpact.app.report.pictures import Report
from femimpact.app.results.branch_file import FollowedBranches, dataset_of
from femimpact.app.study.findings import BranchSummary, Findings, OrbitsSummary, PlacedBifurcation
from femimpact.app.study.prepared import PreparedStudy, check_sweep, in_study_words, prepare
from femimpact.app.study.study import OrbitsPlan, Study
from femimpact.app.study.summary import findings_of
from femimpact.app.tasks.task import Finished, Plan, Task
from femimpact.arrays import Array
from femimpact.errors import DivergenceError, Fault, FemimpactError, InputError, checked, require
from femimpact.excitation.drives import PointForce
from femimpact.excitation.excitation import words_of
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.cases import memory_needed
from femimpact.integrators.methods import seconds_of_cycle
from femimpact.integrators.runs import integrate
from femimpact.orbits.branch import UNEXPLAINED, Branch, continue_orbit, known
from femimpact.orbits.figures import kind_words, stable_ranges
from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.orbits.parameter import Parameter, parameter_of
from femimpact.orbits.search import TRY, find_orbit, one_sine
from femimpact.orbits.switching import switch_branch
from femimpact.response.response import Recorder
from femimpact.sweep.sweep import frequency_sweep
from femimpact.units import counted, number_text, parameter_text

SAME = 1e-6
"""Relative difference of the impact speeds of one orbit that was found twice."""

MOST_NAMED = 3
"""Bifurcations that a note names of those from which no more branches are followed."""

LOCATED = 1e-9
"""Relative difference of the values of one bifurcation that two branches share."""

IN_STUDY = {
    "to": "orbits.range", "parameter": "orbits.parameter", "of": "orbits.of", "duration": "orbits.guess_duration",
    "cycles": "orbits.cycles", "record.memory_limit": "output.memory_limit",
}  # fmt: skip
"""Keys of the study file that stand for arguments of the functions that are called."""

ADVICE = (
    "try numbers of the study at which its run settles, a longer orbits.guess_duration, or another number of "
    "orbits.cycles"
)


UNSETTLED = (
    "the first orbit is unstable: the run has not settled on it, and another orbits.guess_duration or another "
    "processor may lead to another orbit, or to none"
)
"""What is said of an orbit that a motion only passes."""


@dataclass(frozen=True, eq=False)
class PreparedOrbits:
    """A study whose branches are to be followed."""

    prepared: PreparedStudy
    plan: OrbitsPlan
    sine: Sine | PointForce
    number: Parameter

    @property
    def record(self) -> Recorder:
        """What the run that settles keeps: its end, and its impacts."""
        return Recorder(channels=(), ledger=False, memory_limit=self.prepared.study.output.memory_limit)


def prepare_orbits(study: Study) -> PreparedOrbits:
    """Make the branches of a study ready, and find what can be wrong with them before the first run.

    Raises `InputError` if there is no [orbits], the method is not event-driven, the excitation is not one sine, or the
    parameter or its range does not fit the study.
    """
    plan: Any = study.orbits
    require(plan is not None, "orbits", None, "", "table [orbits] is missing from the study")
    method = study.method.get("name", "newmark")
    require(method == "event-driven", "method.name", method, "", "must be 'event-driven' for [orbits]")
    prepared = prepare(study, ())
    small = prepared.small
    try:
        sine = one_sine(study.excitation)
    except InputError:
        allowed = "needs one sine, of the base or of a force beside a base at rest"
        require(False, "orbits", words_of(study.excitation), "", allowed)
    with _study_words():
        number = parameter_of(small, sine, plan.parameter, plan.of)
    for value in plan.range:
        checked("orbits.range", value, number.allowed)
    inside = plan.range[0] <= number.value <= plan.range[1]
    allowed = f"must have the study's {number.path} = {parameter_text(number.value, number.unit)} in it"
    require(inside, "orbits.range", plan.range, number.unit, allowed)
    ready = PreparedOrbits(prepared, plan, sine, number)
    _check_run(ready)
    if _has_sweep(ready):
        check_sweep(study, small, prepared.method)
    return ready


def _check_run(ready: PreparedOrbits) -> None:
    """Refuse a run that is shorter than one of its readings, or keeps more than fits."""
    small, duration, record = ready.prepared.small, ready.plan.guess_duration, ready.record
    grid = ready.prepared.method.time_grid(small, ready.sine, duration, record)
    allowed = f"must be >= one reading of the run, {grid:g} s"
    require(duration >= grid, "orbits.guess_duration", duration, "s", allowed)
    needed = sum(memory_needed(small, record, 0, round(duration / grid), grid, ready.sine.frequency).values())
    allowed = f"must be shorter: the run keeps {needed:.3g} bytes, output.memory_limit is {record.memory_limit:.3g}"
    require(needed <= record.memory_limit, "orbits.guess_duration", duration, "s", allowed)


def task_of_orbits(study: Study) -> Task:
    """The branches of a study: data, tables, figure and report.

    Raises as `prepare_orbits` does, and its work as `first_orbit`.
    """
    ready = prepare_orbits(study)
    work, plan = partial(_parts_of_orbits, ready), partial(plan_of_orbits, ready)
    return Task(study, findings_of(ready.prepared), ("branches",), work, plan)


def plan_of_orbits(ready: PreparedOrbits) -> Plan:
    """The run that settles, the branches, and their time."""
    plan, number, small = ready.plan, ready.number, ready.prepared.small
    seconds = seconds_of_cycle(ready.prepared.method, small, ready.sine.frequency)
    low, high = plan.range
    switched = f", and at {', '.join(plan.switch)} the others too" if plan.switch else ""
    return Plan((
        f"orbits: a run of {plan.guess_duration:g} s, about "
        f"{number_text(seconds * ready.sine.frequency * plan.guess_duration, 2)} "
        f"s, leads to an orbit of {_cycles(plan.cycles)}; its branch over {number.path} from {low:g} to "
        f"{parameter_text(high, number.unit)}{switched}",
        f"orbits: up to {plan.most_branches} branches of up to {plan.points} points each way; 500 points take some "
        "3 to 12 s",
    ))  # fmt: skip


def _cycles(count: int) -> str:
    return f"{counted(count, 'cycle')} of the excitation"


# ---- the branches ---------------------------------------------------------------------------------


Leads = dict[tuple[int, int], set[int]]
"""Numbers of the branches to which a bifurcation of a branch leads, by its branch and its number in it."""


def first_orbit(ready: PreparedOrbits, report: Report) -> PeriodicOrbit:
    """The orbit to which the study's run leads.

    Raises `InputError` if the motion at the end of the run is none that a search takes, and `DivergenceError` if no
    orbit is found from there.
    """
    small, plan = ready.prepared.small, ready.plan
    with _study_words():
        run = integrate(
            small, ready.sine, ready.prepared.method, plan.guess_duration, ready.record, ready.prepared.initial,
            lambda share: report("run that settles", share),
        )  # fmt: skip
        try:
            return find_orbit(small, ready.sine, plan.cycles, guess=run)
        except DivergenceError as error:
            words = f"orbits: after {plan.guess_duration:g} s, {str(error).replace(TRY, ADVICE)}"
            raise DivergenceError(words) from None


def _follow(
    start: PeriodicOrbit, ready: PreparedOrbits, notes: list[str], report: Report
) -> tuple[FollowedBranches, Leads]:
    """The branch of an orbit and those that its bifurcations lead to, the nearest first.

    An orbit that lies on one of the branches is left out, as are its mirror image and the same a cycle later: their
    curves are one.
    """
    plan, done, leads = ready.plan, FollowedBranches(ready.prepared.small.dofs), Leads()
    waiting: deque[tuple[PeriodicOrbit, str, tuple[int, int]]] = deque([(start, "the run that settles", (0, 0))])
    left = list[str]()
    while waiting:
        orbit, origin, place = waiting.popleft()
        report("branches", len(done.branches) / plan.most_branches)
        try:
            number = next((i for i, branch in enumerate(done.branches, 1) if _lies_on(orbit, branch)), 0)
            if not number and len(done.branches) == plan.most_branches:
                left.append(origin)
                continue
            if not number:
                branch = continue_orbit(orbit, plan.parameter, to=plan.range, points=plan.points, of=plan.of)
                done.branches.append(branch)
                done.origins.append(origin)
                done.cycles.append(orbit.cycles)
                number = len(done.branches)
                notes += [f"branch {number}: {words}" for words in branch.warnings]
                waiting.extend(_switched(branch, number, ready, notes))
        except FemimpactError as error:
            if not done.branches:
                with _study_words():
                    raise
            notes.append(f"not followed from {origin}: {_words(error)}")
            continue
        if place[0]:
            leads.setdefault(place, set()).add(number)
    report("branches", 1.0)
    if left:
        places = list(dict.fromkeys(left))
        more = f" and {len(places) - MOST_NAMED} more" if len(places) > MOST_NAMED else ""
        named = f"{', '.join(places[:MOST_NAMED])}{more}"
        notes.append(f"not followed, for orbits.most_branches = {plan.most_branches}: from {named}")
    return done, leads


def _switched(
    branch: Branch, number: int, ready: PreparedOrbits, notes: list[str]
) -> Iterator[tuple[PeriodicOrbit, str, tuple[int, int]]]:
    """Orbits of other branches at the bifurcations of one, each with words for its origin, and its place."""
    for i, bifurcation in enumerate(branch.bifurcations):
        if bifurcation.kind not in ready.plan.switch:
            continue
        origin = (
            f"{kind_words(bifurcation.kind)} of branch {number} at {parameter_text(bifurcation.value, branch.unit)}"
        )
        try:
            for orbit in (*_joined(branch, i), *switch_branch(bifurcation)):
                yield orbit, origin, (number, i)
        except FemimpactError as error:
            notes.append(f"not followed from {origin}: {_words(error)}")


def _joined(branch: Branch, i: int) -> Iterator[PeriodicOrbit]:
    """The orbit of the branch on which one ends at its bifurcation: a symmetric orbit, or one of half the period."""
    at, bifurcation = int(branch.bifurcation_points[i]), branch.bifurcations[i]
    if at in (0, len(branch) - 1) and branch.end[0 if at == 0 else 1].startswith("joins "):
        orbit = bifurcation.orbit
        half = bifurcation.kind == "period-doubling"
        yield find_orbit(orbit.system, orbit.excitation, orbit.cycles // 2, guess=orbit.state) if half else orbit


def _lies_on(orbit: PeriodicOrbit, branch: Branch) -> bool:
    """Whether an orbit, its mirror image or the same some cycles later is one of a branch.

    A symmetric orbit is none of a branch without the symmetry, nor one of fewer cycles of a branch of more: these end
    there.
    """
    curve = known(branch.curve, "branch")
    if orbit.is_symmetric > curve.is_symmetric or orbit.cycles < curve.sequence.cycles:
        return False
    value = parameter_of(orbit.system, one_sine(orbit.excitation), branch.parameter).value
    return any(_is_same(orbit, other) for other in branch.at(value))


def _is_same(orbit: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Whether two orbits have the same impact speeds; of one of several times the period so many times over."""
    times = math.lcm(orbit.cycles, other.cycles)
    one, two = (np.sort(np.tile(each.impacts.approach_speed, times // each.cycles)) for each in (orbit, other))
    return one.size == two.size and bool(np.all(np.abs(one - two) <= SAME * one.max(initial=0.0)))


@contextmanager
def _study_words() -> Iterator[None]:
    """Context in which faults have keys of the study file."""
    try:
        yield
    except InputError as error:
        raise InputError(map(_of_study, error.faults)) from None


def _of_study(fault: Fault) -> Fault:
    """The fault with a key of the study file: what it says of the guess it says of the run that leads to it."""
    if fault.key.split(".")[0] != "guess":
        return replace(fault, key=IN_STUDY.get(fault.key, fault.key))
    names = [fault.key.partition(".")[2], "" if fault.value is None else str(fault.value)]
    return replace(fault, key="orbits.guess_duration", value=": ".join(filter(None, names)) or None)


def _words(error: FemimpactError) -> str:
    given = InputError(map(_of_study, error.faults)) if isinstance(error, InputError) else error
    return " ".join(str(given).split())


def _has_sweep(ready: PreparedOrbits) -> bool:
    """Whether a stepped sweep is beside the branches."""
    given = ready.prepared.study.sweep
    return given is not None and given.acceleration is None and ready.number.path == "base.frequency"


def _sweep(ready: PreparedOrbits, notes: list[str], report: Report) -> tuple[Array, Array] | None:
    """Frequencies (Hz) and peaks (m) of a stepped sweep over the range; None where the study has none of them."""
    plan, study, small = ready.plan, ready.prepared.study, ready.prepared.small
    given = study.sweep
    if given is None or not _has_sweep(ready):
        if given is not None and ready.number.path == "base.frequency":
            notes.append("no sweep beside the branches: sweep.acceleration has another amplitude at each frequency")
        return None
    try:
        swept = frequency_sweep(
            small, frequencies=np.linspace(*plan.range, given.points), method=ready.prepared.method,
            cycles=given.cycles, channel=ready.number.place, initial=study.initial, at=small.default_place,
            ledger=False, progress=lambda share: report("sweep", share), **study.sweep_level,
        )  # fmt: skip
    except FemimpactError as error:
        notes.append(f"no sweep beside the branches: {_words(error)}")
        return None
    notes += [f"sweep: {in_study_words(text)}" for text in swept.warnings]
    notes.append(
        f"sweep: {given.points} frequencies over the range of the branches, each {given.cycles} cycles from the "
        "study's start, event-driven; a motion that does not settle has the largest peak of its last third"
    )
    known = np.isfinite(swept.peak)
    return swept.frequency[known], swept.peak[known]


# ---- files ----------------------------------------------------------------------------------------


def _parts_of_orbits(ready: PreparedOrbits, report: Report) -> Iterator[Finished]:
    start = first_orbit(ready, report)
    notes = [] if start.is_stable else [UNSETTLED]
    followed, leads = _follow(start, ready, notes, report)
    followed = replace(followed, swept=_sweep(ready, notes, report))
    points, units = _points(followed.branches)
    files = {
        "branches": dataset_of(followed),
        "branch_table": (points, units),
        "bifurcations": (_bifurcations(followed.branches, leads, points), units),
    }
    notes = [*ready.prepared.method.notes(ready.prepared.small), *notes]
    yield Finished("branches", files, Findings(orbits=_summary(ready, followed), notes=tuple(notes)))


def _points(branches: list[Branch]) -> tuple[dict[str, Any], dict[str, str]]:
    """A row for each orbit, with the number of its branch."""
    frames = [branch.to_pandas() for branch in branches]
    columns: dict[str, Any] = {"branch": np.repeat(np.arange(1, len(frames) + 1), list(map(len, frames)))}
    columns |= {str(name): np.concatenate([frame[name].to_numpy() for frame in frames]) for name in frames[0]}
    return columns, dict(frames[0].attrs["units"])


def _bifurcations(branches: list[Branch], leads: Leads, columns: dict[str, Any]) -> dict[str, Any]:
    """A row for each bifurcation, of those of the points, with the numbers of the other branches that meet there."""
    here = ~np.isin(columns["bifurcation"], ("", UNEXPLAINED))
    rows = {name: values[here] for name, values in columns.items() if name not in ("is_stable", "bifurcation")}
    numbers = rows.pop("branch")
    each = [(number, i, one) for number, branch in enumerate(branches, 1) for i, one in enumerate(branch.bifurcations)]
    leads_to = []
    for number, i, one in each:
        near = LOCATED * abs(one.value)
        joined = {n for n, _, other in each if other.kind == one.kind and abs(other.value - one.value) <= near}
        leads_to.append(" ".join(map(str, sorted((joined | leads.get((number, i), set())) - {number}))))
    return {"branch": numbers, "kind": columns["bifurcation"][here], **rows, "leads_to": leads_to}


def _summary(ready: PreparedOrbits, followed: FollowedBranches) -> OrbitsSummary:
    """What the summary says of the branches."""
    rows = tuple(
        BranchSummary(
            origin=origin,
            cycles=cycles,
            points=len(branch),
            stable=stable_ranges(branch),
            lowest=float(branch.values.min()),
            highest=float(branch.values.max()),
            largest_peak=float(np.nanmax(branch.peak)),
            ends=branch.end,
            bifurcations=tuple(PlacedBifurcation(each.kind, each.value) for each in branch.bifurcations),
        )
        for branch, origin, cycles in zip(followed.branches, followed.origins, followed.cycles, strict=True)
    )
    number, plan = ready.number, ready.plan
    return OrbitsSummary(number.path, number.unit, tuple(plan.range), followed.modes, rows)
