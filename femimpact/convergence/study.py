"""Run a convergence study: each axis from coarse to fine, what is watched read of every case, and orders fitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from femimpact.arrays import Array
from femimpact.convergence.cases import Axis, Case, OverMeshes, Plan, Row, attempted
from femimpact.convergence.quantities import Frequencies, Reading, Watched
from femimpact.convergence.table import (
    AGREED,
    ConvergenceStudy,
    ConvergenceTable,
    agrees,
    extrapolated,
    fitted_order,
    is_finer,
    local_orders,
    new_column,
    number_for,
    number_of_case,
    observed_order,
    relative_error,
    rounding_floor,
    statistic,
    table_of,
    usable_rows,
)
from femimpact.errors import FemimpactError, checked, optional, quantity, require, require_type, warns
from femimpact.excitation.harmonic import Sine
from femimpact.progress import Progress, check_progress, draws_progress
from femimpact.structure.structure import Structure

Measured = tuple[tuple[Reading, ...], ...] | FemimpactError
"""Readings of each watched quantity, or why there are none."""

LOSS = 0.5
"""Order that a jump between two nodes may take from two cases alone."""

STRIDE = 1.1
"""Factor to the next number that is tried, where the case of one misses the accuracy."""


def measured_of(case: Case | FemimpactError, finest: Case, watched: Sequence[Watched]) -> Measured:
    """The readings of each watched quantity of a case, or why there are none."""
    if isinstance(case, FemimpactError):
        return case
    try:
        return tuple(kind.read(case, finest) for kind in watched)
    except FemimpactError as error:
        return error
    # what a factorisation or a memory does not manage is a row with its reason, too
    except (MemoryError, ArithmeticError, np.linalg.LinAlgError, RuntimeError) as error:
        return FemimpactError(f"{type(error).__name__}: {error}")


class Trial(NamedTuple):
    """Axis, plan and reference case on which recommended numbers are tried; cases that were computed are kept."""

    axis: Axis
    plan: Plan
    finest: Case
    most: float
    accuracy: float
    known: dict[float, Case | FemimpactError | None]

    def case(self, number: float) -> Case | FemimpactError | None:
        """The case of a number; None where the axis does not make one."""
        if number not in self.known:
            self.known[number] = self.axis.case(self.plan, number)
        return self.known[number]

    def error(
        self, number: float, watched: Watched, part: int, reference: float, reference_error: float
    ) -> float | None:
        """Relative error of a quantity in the case of a number; None where there is no case to read it of.

        Beyond the rows of a reference that is extrapolated, it is that from a case of twice the number, with what this
        one misses by an order that is `LOSS` below the expected one.
        """
        case, finest = self.case(number), self.finest
        beyond = number > self.most and math.isfinite(self.axis.ratio)
        if beyond:
            twice = self.case(2.0 * number)
            if not isinstance(twice, Case):
                return None
            finest = twice
        if not isinstance(case, Case):
            return None if case is None else math.inf
        measured = measured_of(case, finest, [watched])
        exact = measured_of(finest, finest, [watched]) if beyond else None
        if isinstance(measured, FemimpactError) or isinstance(exact, FemimpactError):
            return math.inf
        reading = measured[0][part]
        order = reading.order - LOSS
        if reading.is_distance:
            return math.hypot(reading.value, reading.value / math.sqrt(4.0**order - 1.0) if beyond else reference_error)
        if exact is not None:
            reference = extrapolated(reading.value, exact[0][part].value, 2.0, order)
        return abs(reading.value - reference) / abs(reference) if reference else math.inf


def number_tried(
    trial: Trial, watched: Watched, part: int, column: dict[str, Any], reference_error: float, number: Array
) -> float:
    """The recommended number, or the next larger one whose case has the accuracy when it is computed.

    Between the rows a place may lie otherwise in its element, and lengths fall otherwise on each side of a joint.
    Beyond them it is a multiple of the first number that an order is fitted to, so that a place which is a node of the
    rows is a node of this case and of the one with twice the number.
    """
    most = STRIDE * max(2.0 * trial.most, column["recommended"])
    known = number[np.isfinite(column["error"])]
    unit = 1.0 if math.isinf(trial.axis.ratio) else float(known[min(1, known.size - 1)])

    def admitted(number: float) -> float:
        return unit * math.ceil(number / unit) if number > trial.most else number

    wanted = admitted(column["recommended"])
    enough = number[(number >= wanted) & (column["error"] <= trial.accuracy)]
    while math.isfinite(wanted) and wanted not in enough:
        error = trial.error(wanted, watched, part, column["reference"], reference_error)
        if error is None or error <= trial.accuracy:
            return float(wanted)
        beyond = math.ceil(STRIDE * wanted)
        rows = enough[enough <= beyond]
        wanted = rows[0] if rows.size else admitted(beyond) if beyond <= most else math.nan
    return float(wanted)


AS_EXPECTED = 0.5
"""Difference from the expected order up to which the expected one extrapolates, in place of the one found."""

FLOOR = 1e-11
"""Relative error up to which no order is read, where rounding was not seen."""


@warns
@draws_progress
def convergence_study(
    structure: Structure,
    over: Axis | Sequence[Axis],
    watch: Watched | Sequence[Watched] | None = None,
    base: Sine | None = None,
    *,
    modes: int | None = None,
    accuracy: float = 1e-3,
    progress: Progress | bool | None = None,
) -> ConvergenceStudy:
    """How far results are from those of an endlessly fine mesh, a vanishing step and all modes.

    Parameters
    ----------
    structure : Structure
    over : OverMeshes, OverSteps, OverModes, or a sequence of them
        One table for each.
    watch : Frequencies, ModeShapes, SteadyResponse, BendingMoment, SurfaceStress, SupportReaction, \
ContactStatistics, a user's class, or a sequence of them
        The quantities; four frequencies by default. Each has its expected order, derived in its docstring.
    base : Sine, optional
        Base motion, for quantities of the response to it.
    modes : int, optional
        Normal modes kept for runs with contacts over meshes and steps; all dofs by default.
    accuracy : float, 1
        Relative error that the recommended numbers are for.
    progress : callable or bool, optional
        Called with the share done, 0 to 1; True draws a bar.

    Returns
    -------
    ConvergenceStudy
        A case that failed is a row with its reason.

    Examples
    --------
    >>> import femimpact as fi
    >>> meshes = fi.convergence.OverMeshes.uniform(bare, [4, 8, 16])
    >>> study = fi.convergence_study(bare, meshes, fi.convergence.Frequencies(1))
    >>> table = study.tables["mesh"]
    >>> round(float(table.order.ravel()[-1]), 1)
    4.0
    """
    require_type(structure, Structure, "structure")
    axes = _several("over", over, Axis, "OverMeshes, OverSteps or OverModes")
    watched = _several("watch", Frequencies() if watch is None else watch, Watched, "quantities to watch")
    if base is not None:
        require_type(base, Sine, "base")
        require(base.amplitude > 0.0, "base.amplitude", base.amplitude, "m", "must be > 0 m")
    mode_count = checked("modes", modes, optional(quantity("1", at_least=1, integer=True)))
    accuracy = checked("accuracy", accuracy, quantity("1", above=0.0, below=1.0))
    report = check_progress(progress)
    names = [axis.name for axis in axes]
    require(len(set(names)) == len(names), "over", names, "", "must be one of each kind")
    plan, tables = Plan(structure, base, mode_count), {}
    for i, axis in enumerate(axes):

        def report_share(share: float, done: int = i) -> None:
            if report is not None:
                report((done + share) / len(axes))

        tables[axis.name] = _table(axis, plan, watched, accuracy, report_share)
    return ConvergenceStudy(tables)


def _several(key: str, argument: Any, kind: Any, words: str) -> list[Any]:
    members = list(argument) if isinstance(argument, (list, tuple)) else [argument]
    fine = len(members) > 0 and all(isinstance(member, kind) and not isinstance(member, type) for member in members)
    require(fine, key, argument if not fine else None, "", f"must be one of, or a list of, {words}")
    return members


def _table(
    axis: Axis, plan: Plan, watched: Sequence[Watched], accuracy: float, progress: Callable[[float], None]
) -> ConvergenceTable:
    rows = list(axis.rows(plan))
    last = next((row.case for row in reversed(rows) if isinstance(row.case, Case)), None)
    if last is None:
        raise next(row.case for row in rows if isinstance(row.case, FemimpactError))
    # there is none beyond the most elements that a mesh may have: the rows alone are left
    limit = attempted(lambda: axis.limit(plan, last))
    finest = limit if isinstance(limit, Case) else last
    measured: list[Measured] = []
    for i, row in enumerate(rows):
        measured.append(measured_of(row.case, finest, watched))
        progress((i + 1) / len(rows))
    readings_of = next((row for row in reversed(measured) if not isinstance(row, FemimpactError)), None)
    if readings_of is None:
        raise next(row for row in measured if isinstance(row, FemimpactError))
    heads = _flat(readings_of)
    independent = [type(kind).__name__ for kind, readings in zip(watched, readings_of, strict=True) if not readings]
    require(len(heads) > 0, "watch", None, "", f"must hold a quantity that depends on the {axis.name}")
    value, scatter = _values([*measured, measured_of(limit, finest, watched)], len(heads))
    value, limits, scatter = value[:-1], value[-1], scatter[:-1]
    size, number = np.array([row.size for row in rows]), np.array([row.number for row in rows], dtype=float)
    columns = [
        _column(head, value[:, j], scatter[:, j], size, number, axis, float(limits[j]), accuracy)
        for j, head in enumerate(heads)
    ]
    trial = Trial(axis, plan, finest, float(np.nanmax(number)), accuracy, {})
    parts = [(kind, i) for kind, readings in zip(watched, readings_of, strict=True) for i in range(len(readings))]
    for column, (kind, i) in zip(columns, parts, strict=True):
        reference_error = column.pop("reference_error")
        if math.isfinite(reference_error):
            column["recommended"] = number_tried(trial, kind, i, column, reference_error, number)
    return table_of(
        axis.name, [row.label for row in rows], number, size, columns,
        [" ".join(str(row).split()) if isinstance(row, Exception) else "" for row in measured],
        accuracy=accuracy,
        notes=(*_not_finer(axis, rows, value), *_notes(axis, plan, heads, columns, independent, accuracy)),
        problem=_problem(plan, scatter),
    )  # fmt: skip


def _values(measured: Sequence[Measured], count: int) -> tuple[Array, Array]:
    """Values and their scatter, (cases, quantities) each; not numbers of a case without readings."""
    value, scatter = np.full((2, len(measured), count), np.nan)
    for i, groups in enumerate(measured):
        if not isinstance(groups, FemimpactError):
            value[i], scatter[i] = [r.value for r in _flat(groups)], [r.scatter for r in _flat(groups)]
    return value, scatter


def _flat(groups: tuple[tuple[Reading, ...], ...]) -> tuple[Reading, ...]:
    return tuple(reading for readings in groups for reading in readings)


def _column(
    head: Reading, value: Array, scatter: Array, size: Array, number: Array,
    axis: Axis, limit: float,  # value of the case beyond the rows; not a number where there is none
    accuracy: float,
) -> dict[str, Any]:  # fmt: skip
    """Errors, orders, reference, floor and recommended number of one quantity."""
    known = np.flatnonzero(np.isfinite(value))
    error, nothing = np.full(value.size, np.nan), math.nan
    column = new_column(head.name, head.unit, value, scatter, head.order)
    column |= {"reference_error": nothing, "error": error, "order": error.copy()}
    if known.size == 0:
        return column
    if np.any(scatter[known] > 0.0):
        return column | statistic(value, scatter, number, known, accuracy)
    h, v = size[known], value[known]
    reference, floor, order = nothing, nothing, head.order
    if head.is_distance:
        reference_error = _reference_distance(h, v, order, axis, limit)
        e = np.hypot(v, reference_error)
    else:
        reference, floor = _reference(h, v, order, axis, limit)
        e = relative_error(v, reference)
        reference_error = float(relative_error(limit if math.isfinite(limit) else v[-1], reference))
    bottom = FLOOR if math.isnan(floor) else max(floor, FLOOR)
    if head.is_distance and head.order > 4.0:
        # a squared sine, whose rounding is squared too
        bottom = 1e-22
    error[known] = e
    column["order"][known] = local_orders(h, e, bottom)
    fitted = fitted_order(h, e, 3.0 * bottom)
    wanted = number_of_case(number[known], e, reference_error, accuracy)
    if agrees(fitted, order) and wanted != number[known[0]]:
        wanted = number_for(number[known], e, fitted, accuracy, 0.0 if math.isnan(floor) else floor)
    return column | {
        "fitted_order": fitted, "reference": reference, "floor": floor, "recommended": wanted,
        "reference_error": reference_error,
    }  # fmt: skip


def _reference(size: Array, value: Array, order: float, axis: Axis, limit: float) -> tuple[float, float]:
    """The value that a column tends to, and its round-off floor where this was reached."""
    expected = order if math.isfinite(order) else 2.0
    if math.isfinite(limit):
        if math.isinf(axis.ratio):
            return limit, math.nan
        if not axis.is_family:
            return extrapolated(float(value[-1]), limit, axis.ratio, expected), math.nan
        size, value = np.append(size, size[-1] / axis.ratio), np.append(value, limit)
    if value.size < 2:
        return float(value[-1]), math.nan
    if not np.all(is_finer(size)):
        return math.nan, math.nan
    usable = usable_rows(size, value, expected)
    floor = rounding_floor(value, usable) if usable < value.size and np.any(value) else math.nan
    h, v = size[:usable], value[:usable]
    observed = observed_order(h, v)
    if math.isfinite(observed) and abs(observed - expected) > AS_EXPECTED:
        expected = observed
    return extrapolated(v[-2], v[-1], h[-2] / h[-1], expected), floor


def _reference_distance(size: Array, value: Array, order: float, axis: Axis, limit: float) -> float:
    """Distance from the exact shape of the reference case, which is the limit, or the finest row without one.

    It follows from that of the row before it and the order. Both add up as the sides of a right angle, since the error
    of a Galerkin solution is orthogonal to the finer space.
    """
    if math.isfinite(limit):
        return float(value[-1] / math.sqrt(axis.ratio ** (2.0 * order) - 1.0))
    if value.size < 2 or not is_finer(size[-2:])[0]:
        return math.nan
    return float(value[-2] / math.sqrt((size[-2] / size[-1]) ** (2.0 * order) - 1.0))


def _problem(plan: Plan, scatter: Array) -> str:
    """Description of the motion that the values of a table are read of."""
    scatters = np.any(scatter > 0.0, axis=0)
    if plan.base is None:
        return "Free vibration of the structure without contacts"
    moved = f"base motion of {1e3 * plan.base.amplitude:g} mm at {plan.base.frequency:g} Hz"
    if np.all(scatters):
        return f"Runs with contacts, {moved}: means over several starts"
    also = "; statistics of runs with contacts" if np.any(scatters) else ""
    return f"Linear response without contacts, {moved}{also}"


def _not_finer(axis: Axis, rows: Sequence[Row], value: Array) -> tuple[str, ...]:
    """Why no order is fitted, where a row has no smaller size than the one before."""
    known = [row for row, read in zip(rows, value, strict=True) if np.any(np.isfinite(read))]
    finer = is_finer(np.array([row.size for row in known]))
    if np.all(finer):
        return ()
    before, row = known[int(np.argmin(finer)) :][:2]
    size = "longest element" if axis.name == "mesh" else "size"
    return (
        f"no order is fitted: the {size} of {row.label}, {row.size:.4g} {axis.units[1]}, is no smaller than that of "
        f"{before.label}; errors hold all the same, and a recommended number is that of a case",
    )


def _notes(
    axis: Axis, plan: Plan, heads: Sequence[Reading], columns: Sequence[Any], independent: Sequence[str],
    accuracy: float,
) -> tuple[str, ...]:  # fmt: skip
    notes, scatters = [], [math.isnan(head.order) for head in heads]
    pairs = list(zip(heads, columns, strict=True))
    seen = [(column["floor"], head.name) for head, column in pairs if math.isfinite(column["floor"])]
    if seen:
        worst, name = max(seen)
        notes.append(f"round-off floor: reached by {len(seen)} of {len(heads)}, at most {worst:.1g} ({name})")
    elif axis.name == "mesh" and not all(scatters):
        notes.append("round-off floor: not reached")
    unlike = [
        f"{head.name} ({column['fitted_order']:.2f})"
        for head, column in pairs
        if math.isfinite(column["fitted_order"] + head.order) and not agrees(column["fitted_order"], head.order)
    ]
    if unlike:
        notes.append(
            f"orders off by more than {AGREED:g} from the expected ones, see their docstrings: {', '.join(unlike)}. "
            "More than one term of the error is seen: the number recommended is that of a case with the accuracy, "
            "a bound"
        )
    absent = [head.name for head, row in pairs if math.isnan(row["recommended"]) and np.any(row["error"] > 0.0)]
    if absent:
        why = "no case is known to have the accuracy" + (", and none follows from such an order" if unlike else "")
        notes.append(f"no number is recommended for {', '.join(absent)}: {why}; take finer cases")
    if any(scatters):
        notes.append("statistics: differences within three standard errors of both mean nothing; no order is fitted")
    if independent:
        notes.append(f"do not depend on the {axis.name}: {', '.join(dict.fromkeys(independent))}")
    if not all(scatters):
        impacting = plan.structure.impactors or plan.structure.stops
        beside = " without contacts; of runs with impacts compare statistics, which scatter" if impacting else ""
        notes.append(f"recommended numbers are of {axis.units[0]}, for a relative error of {accuracy:g}{beside}")
    return tuple(notes)


@warns
def converge_elements(structure: Structure, elements: Sequence[int], modes: int = 4) -> ConvergenceTable:
    """Natural frequencies of a structure over uniform meshes, without its balls; see `Frequencies`.

    Parameters
    ----------
    structure : Structure
    elements : sequence of int
        Increasing numbers of elements.
    modes : int
        How many frequencies; fewer where the finest mesh has fewer dofs.

    Returns
    -------
    ConvergenceTable
        That of `convergence_study` over `OverMeshes.uniform`.
    """
    require_type(structure, Structure, "structure")
    modes = checked("modes", modes, quantity("1", at_least=1, at_most=1000, integer=True))
    bare = replace(structure, impactors=(), meetings=())
    return convergence_study(bare, OverMeshes.uniform(bare, elements), Frequencies(modes))["mesh"]
