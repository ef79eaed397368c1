"""Convergence of runs with contacts: over the step, over the number of normal modes, and statistics that scatter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.convergence.cases import Case
from femimpact.convergence.quantities import Reading
from femimpact.convergence.table import (
    LINEAR,
    ConvergenceTable,
    agrees,
    fitted_order,
    local_orders,
    new_column,
    number_for,
    number_of_case,
    slope,
    statistic,
    table_of,
)
from femimpact.errors import (
    DivergenceError,
    check_fields,
    checked,
    optional,
    place,
    quantity,
    require,
    require_type,
    rising_numbers,
    warns,
)  # fmt: skip
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method, read_at_least, require_method, stride_of
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Position
from femimpact.sweep.sweep import frequency_sweep
from femimpact.system.modes import first_elastic_frequency
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors
from femimpact.units import number_text

# ---- over the step -----------------------------------------------------------------------------------

PHASES = 8
"""Base phases over which the error after the first impact is averaged."""

HALVINGS = 5
"""How often the step is halved."""


@warns
def converge_step(
    system: System, excitation: Sine, method: Newmark, halvings: int = HALVINGS, *, accuracy: float = 1e-3
) -> ConvergenceTable:
    """Error of runs in Newmark's steps over the step, against a run with a step four times finer than the finest.

    Without balls it is that of the tip over a few base cycles, relative to the largest tip displacement. With contacts
    it is that of the tip and the balls shortly after the first impact, relative to their largest displacements: the
    root mean square over 8 phases of the base, since where in a step the touch falls is chance. So is the energy
    residual of these short runs; later chaos makes histories incomparable.

    Parameters
    ----------
    system : System
    excitation : Sine
    method : Newmark
        Its dt is the coarsest step.
    halvings : int
        How often it is halved.
    accuracy : float, 1
        Relative error that the recommended numbers are for.

    Returns
    -------
    ConvergenceTable
        Its values are errors. The average-acceleration method has order 2 without contacts (Hughes, 1987).
    """
    arguments: tuple[tuple[str, Any, Any], ...] = (
        ("system", system, System), ("excitation", excitation, Sine), ("method", method, Newmark)
    )  # fmt: skip
    for key, value, kind in arguments:
        require_type(value, kind, key)
    halvings = checked("halvings", halvings, quantity("1", at_least=1, at_most=20, integer=True))
    accuracy = checked("accuracy", accuracy, quantity("1", above=0.0, below=1.0))
    dt = method.dt / 2.0 ** np.arange(halvings + 1, dtype=float)
    finest = replace(method, dt=float(dt[-1] / 4.0))
    # a multiple of the coarsest step, so that all runs end at the same instant
    cycles = method.dt * round(3.0 / (excitation.frequency * method.dt))
    errors = {LINEAR: _errors(without_impactors(system), excitation, method, dt, finest, cycles)[0]}
    notes = ["without balls: the tip over 3 base cycles from rest"]
    if system.contacts:
        squares = []
        for phase in 2.0 * math.pi * np.arange(PHASES) / PHASES:
            base = replace(excitation, phase=float(phase))
            duration = _past_first_impact(system, base, method)
            if duration is not None:
                squares.append(np.square(_errors(system, base, method, dt, finest, duration)))
        if squares:
            impact, residual = np.sqrt(np.mean(squares, axis=0))
            errors |= {"motion after an impact": impact, "energy residual": residual}
            notes.append(f"with balls: to shortly after the first impact, over {len(squares)} phases of the base")
        else:
            notes.append("with balls: no impact within 40 base cycles, nothing to compare")
    first, columns = first_elastic_frequency(system), list[dict[str, Any]]()
    number = 1.0 / (dt * first) if first > 0.0 else np.full(dt.size, np.nan)
    for name, error in errors.items():
        order = (2.0 if method.gamma == 0.5 else 1.0) if name == LINEAR else math.nan
        fitted = fitted_order(dt, error, 0.0)
        enough = (
            number_for(number, error, fitted, accuracy, 0.0) if agrees(fitted, order)
            else number_of_case(number, error, 0.0, accuracy)
        )  # fmt: skip
        columns.append(new_column(name, "1", error, expected_order=order) | {
            "error": error, "order": local_orders(dt, error, 0.0), "fitted_order": fitted, "recommended": enough
        })  # fmt: skip
    return table_of(
        "step", [f"{step:.4g} s" for step in dt], number, dt, columns, accuracy=accuracy, notes=tuple(notes),
        problem="Runs in Newmark's steps, compared with a step four times finer than the finest",
    )  # fmt: skip


def _past_first_impact(system: System, base: Sine, method: Newmark) -> float | None:
    """A whole number of coarse steps to a little after the first impact; None without one in 40 cycles."""
    probe = integrate(system, base, method, 40.0 / base.frequency, Recorder(channels=("tip",), every=50, ledger=False))
    if len(probe.impacts) == 0:
        return None
    contact_time = max(pair.parameters.contact_time for pair in system.contacts if pair.has_walls)
    return float(method.dt * round((probe.impacts.time[0] + 4.0 * contact_time) / method.dt))


def _errors(
    system: System, excitation: Sine, method: Newmark, dt: Array, finest: Newmark, duration: float
) -> tuple[Array, Array]:
    """Largest difference from the finest run at the coarse steps, and the energy residual, for each dt."""
    names = ("tip", *(pair.name for pair in system.contacts))

    def histories(step: float) -> tuple[Array, float]:
        every = round(method.dt / step)
        record = Recorder(channels=names, every=every)
        response = integrate(system, excitation, replace(method, dt=step), duration, record)
        residual = response.energy.residual if response.energy is not None else math.nan
        return np.array([response[name] for name in names]), residual

    exact, _ = histories(finest.dt)
    scale = np.abs(exact).max(axis=1, keepdims=True)
    runs = [histories(float(step)) for step in dt]
    errors = [float(np.max(np.abs(values - exact) / scale)) for values, _ in runs]
    return np.array(errors), np.array([residual for _, residual in runs])


# ---- over the modes ----------------------------------------------------------------------------------

STATISTICS = {
    "rms": "m",
    "peak": "m",
    "contact_loss": "J",
    "structure_loss": "J",
    "damping": "1",
    "mean_impulse": "N s",
}
"""Columns that scatter, and their units."""

FIRST_IMPACT = {"first_displacement": "m", "first_loss": "J"}
"""Columns of one event, which converge."""

OTHERS = {"peak_force": "N", "residual": "1"}
"""Columns of one value without scatter, which do not converge over the modes."""

CORRECTED = " corrected"
"""End of the name of a quantity with static correction."""


MOST_IMPACTS = 1_000_000
"""Impacts that a run keeps."""

PARTS = 8
"""Parts of the window between which statistics scatter."""

POINTS_PER_CYCLE = 64
"""Samples of a stepped run in a base cycle: a sine's peak is met to 0.1 %."""

POINTS_OF_AN_IMPACT = 256
"""Samples in a cycle of the first mode, at least, between which the first impact is looked for."""


def run_statistics(
    system: System, excitation: Sine, method: Method, duration: float, at: Position, cycles: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Values over the last `cycles` of a run, and their scatter between parts of it.

    The peak is that of `SteadyMotion`, over the last third of the run: the largest |w|, instants of impact included.
    At another place than the one that every run observes it is read by a sweep of one frequency, whose base has no
    phase. The scatter of the peak is that of samples, which miss the maxima of all parts equally, by 0.1 % or less.
    """
    require_method(method)
    every = stride_of(method, excitation.frequency, POINTS_PER_CYCLE)
    keep = Recorder(channels=(at,), every=every, impacts=MOST_IMPACTS)
    run = integrate(system, excitation, method, duration, keep)
    period = 1.0 / excitation.frequency
    edges = run.time[-1] - period * cycles * np.linspace(1.0, 0.0, PARTS + 1)
    values = _over(run, at, edges[0], edges[-1], cycles)
    pieces = [_over(run, at, *ends, cycles // PARTS) for ends in pairwise(edges)]
    spread = {}
    for name in STATISTICS:
        parts = np.array([piece[name] for piece in pieces])
        parts = parts[np.isfinite(parts)]
        error = float(np.std(parts, ddof=1)) if parts.size > 1 else math.nan
        spread[name] = error if name == "peak" else error / math.sqrt(max(parts.size, 1))
    assert run.energy is not None
    values["peak"] = _peak(system, excitation, method, duration, at, run)
    return values | {"peak_force": run.statistics.peak_force, "residual": run.energy.residual}, spread


def _peak(system: System, excitation: Sine, method: Method, duration: float, at: Position, run: Response) -> float:
    """Largest |w| (m) of a place over the last third of a run."""
    if np.array_equal(system.point_row(at), system.point_row(system.default_place)):
        return float(run.steady.peak[0])
    curve = frequency_sweep(
        system, excitation.amplitude, [excitation.frequency], method, duration=duration, at=at, ledger=False, threads=1
    )
    return float(curve.peak[0])


def _over(run: Response, at: Position, start: float, end: float, cycles: int) -> dict[str, float]:
    """Statistics of a run between two instants (s), a whole number of base cycles apart."""
    ledger = run.energy
    assert ledger is not None
    # half a sample of slack: an edge on a sample must not belong to both sides or to none
    slack = 0.5 * float(run.time[1] - run.time[0])
    inside = (run.time > start + slack) & (run.time <= end + slack)
    w = run[at][inside]
    contact, structure = (
        float(np.diff(np.interp((start, end), run.time, loss))[0]) / cycles
        for loss in (ledger.contact_loss, ledger.structure_loss)
    )
    strain = 2.0 * float(np.mean(ledger.strain[inside]))
    chosen = (run.impacts.time > start) & (run.impacts.time <= end)
    impulse = np.abs(run.impacts.impulse[chosen])
    return {
        "rms": float(np.sqrt(np.mean(w**2))),
        "peak": float(np.max(np.abs(w))),
        "contact_loss": contact,
        "structure_loss": structure,
        "damping": (contact + structure) / (4.0 * math.pi * strain) if strain > 0.0 else math.nan,
        "mean_impulse": float(impulse.mean()) if impulse.size else math.nan,
    }


def first_impact(system: System, method: Method, at: Position) -> dict[str, float]:
    """Displacement and loss a quarter of the first period after one impact from a given state."""
    quiet = Sine(0.0, system.first_frequency)
    state, until = _before_impact(system)
    finely = read_at_least(method, POINTS_OF_AN_IMPACT)
    run = integrate(system, quiet, finely, until + 0.5 / quiet.frequency, Recorder(channels=(at,)), state)
    require(len(run.impacts) > 0, "system.contacts", system.contacts[0].name, "", "is not met by the first impact")
    after = float(run.impacts.time[0]) + 0.25 / quiet.frequency
    assert run.energy is not None
    return {
        "first_displacement": float(np.interp(after, run.time, run[at])),
        "first_loss": float(np.interp(after, run.time, run.energy.contact_loss)),
    }


def _before_impact(system: System) -> tuple[State, float]:
    """A state shortly before the first pair meets a wall, and a time (s) by which it has."""
    j, pair = next((j, pair) for j, pair in enumerate(system.contacts) if pair.has_walls)
    side = 1.0 if pair.gaps[0] <= pair.gaps[1] else -1.0
    near = min(pair.gaps)
    allowed = "must be >= 0 for a convergence over impacts: a preloaded stop has no first one"
    require(near >= 0.0, f"{pair.name}.gaps", pair.gaps, "m", allowed)
    if pair.is_stop:
        # x = -b u, so the first mode moves towards the stop with -side b
        speed = 2.0 * max(near, 1e-6) * 2.0 * math.pi * system.first_frequency
        still = abs(float(pair.direction[0])) == 0.0
        require(not still, pair.name, "at a node of the first mode", "", "must be where the first mode moves")
        velocity = np.zeros(system.dofs)
        velocity[0] = -side * speed / float(pair.direction[0])
        return State(velocity=velocity), 0.25 / system.first_frequency
    clearance = sum(pair.gaps) if math.isfinite(sum(pair.gaps)) else max(near, 1e-6)
    place, rate = np.zeros((2, len(system.balls)))
    place[j] = side * (near - 1e-6 * clearance)
    rate[j] = side * clearance * system.first_frequency
    return State(ball_displacement=place, ball_velocity=rate), 1e-5 / system.first_frequency


UNSETTLED = 0.1
"""Share of the first impact's loss; a larger change between the last two counts is worth a note."""


@warns
def mode_convergence(
    system: System,
    excitation: Sine,
    method: Method,
    duration: float,
    counts: Sequence[int],
    *,
    at: Position | None = None,
) -> ConvergenceTable:
    """Impacting response over the number of kept modes, with and without static correction.

    Two questions are kept apart. The statistics are of a run from rest, over its last third;
    impacting motion is often chaotic, two counts then never give the same history, and only differences
    beyond the scatter mean something: take a long duration. The first impact is one event from one state,
    the same for every count, and does converge: the displacement always; the loss in the contact of a rigid
    impact only where there is a body at the contact, for without one it goes over to the structure's damping as
    modes are added (a note says so). The static correction is that of `reduce` (MacNeal, 1971; Rubin, 1975).

    Parameters
    ----------
    system : System
        In physical dofs, with contacts.
    excitation : Sine
    method : EventDriven, Newmark or its family
        The first, and Moreau-Jean, for rigid contacts only.
    duration : float, s
        Of each run; its last third must hold eight base cycles.
    counts : sequence of int
        Three or more increasing numbers of modes.
    at : str or float, optional
        The observed place; the tip, or the system's first point.

    Returns
    -------
    ConvergenceTable
        Each quantity without and, "corrected", with static correction, which adds one vector for every distinct contact
        direction. Of the observed place rms and peak (m), over the last third of the run; contact and structure loss
        (J) per base cycle; the equivalent damping ratio D/(4 pi U), D being all loss per cycle and U twice the mean
        strain energy; the mean impulse (N s) of an impact. Their scatter is a standard error from eight parts of the
        window, of the peak the standard deviation of the parts' peaks. The first displacement (m), a quarter of the
        first natural period after one first impact, and the loss (J) in the contact until then have errors against the
        largest count with static correction; counts near it flatter the fitted order. The peak force (N), as computed,
        does not converge for short contacts; the residual (1) is that of the energy ledger. A run that diverged is
        not a number, with a note.

    Notes
    -----
    The first impact: the structure is undeformed and at rest on a base at rest; the first ball starts 1e-6
    of its clearance before its nearer wall, at one clearance per first natural period. A stop, which has no
    ball, is met by the structure in its first mode, from no deflection, at twice the speed that just
    reaches it. Both states are exact on any number of modes.

    Examples
    --------
    >>> import femimpact as fi
    >>> full, base = fi.assemble(structure, elements=10), fi.Sine(amplitude=0.2e-3, frequency=5.0)
    >>> found = fi.convergence.mode_convergence(full, base, fi.Newmark(dt=1e-4), duration=5.0, counts=[2, 4, 8])
    >>> found.value[:, found.index("first displacement corrected")].shape
    (3,)
    """
    require_type(system, System, "system")
    allowed = "must be a Sine of the base; under a force integrate on each number of modes"
    require(isinstance(excitation, Sine), "excitation", type(excitation).__name__, "", allowed)
    duration = checked("duration", duration, quantity("s", above=0.0))
    numbers = rising_numbers("counts", counts, system.dofs)
    require(len(system.contacts) > 0, "system.contacts", 0, "", "must be one or more: without impacts modes decouple")
    require(system.first_frequency > 0.0, "system", 0.0, "Hz", "must be held: a first natural frequency > 0")
    cycles = PARTS * math.floor(duration * excitation.frequency / (3 * PARTS) + 1e-9)
    least = 3 * PARTS / excitation.frequency
    require(cycles > 0, "duration", duration, "s", f"must be >= {least:.4g} s, 24 base cycles")
    place = system.default_place if at is None else at
    # before long work
    system.point_row(place)
    columns = {name: np.full((numbers.size, 2), np.nan) for name in (*STATISTICS, *FIRST_IMPACT, *OTHERS)}
    scatter = {name: np.zeros((numbers.size, 2)) for name in columns}
    notes = []
    for case in np.ndindex(numbers.size, 2):
        reduced = reduce(system, int(numbers[case[0]]), static_correction=bool(case[1]))
        try:
            values, spread = run_statistics(reduced, excitation, method, duration, place, cycles)
            values |= first_impact(reduced, method, place)
        except DivergenceError as error:
            corrected = "with" if case[1] else "without"
            notes.append(f"{numbers[case[0]]} modes {corrected} static correction: {error}")
            continue
        for name, value in values.items():
            columns[name][case] = value
        for name, value in spread.items():
            scatter[name][case] = value
    laws = ", ".join(dict.fromkeys(pair.law.name for pair in system.contacts))
    units = STATISTICS | FIRST_IMPACT | OTHERS
    parts = [
        _column(name, new_column(name.replace("_", " ") + end, units[name], values[:, k], scatter[name][:, k]), numbers,
                float(values[-1, 1]))
        for name, values in columns.items() for k, end in enumerate(("", CORRECTED))
    ]  # fmt: skip
    return table_of(
        "modes", [f"{count} modes" for count in numbers], numbers.astype(float), 1.0 / numbers, parts,
        accuracy=ACCURACY,
        notes=(*notes, *_notes(columns, parts, numbers, laws, cycles)),
        problem=(
            f"Runs with contacts ({laws}), base motion of {1e3 * excitation.amplitude:g} mm at "
            f"{excitation.frequency:g} Hz: {place} over the last {cycles} base cycles, and after one first impact"
        ),
    )  # fmt: skip


ACCURACY = 1e-3
"""Relative error of the first impact for which a number of modes is recommended."""


def _column(name: str, column: dict[str, Any], counts: NDArray[np.int64], exact: float) -> dict[str, Any]:
    """A quantity with its errors, orders, reference and recommended number, as far as it has them."""
    value, scatter, number = column["value"], column["scatter"], counts.astype(float)
    known = np.flatnonzero(np.isfinite(value))
    if name in STATISTICS and known.size and np.any(scatter > 0.0):
        return column | statistic(value, scatter, number, known, ACCURACY)
    if name not in FIRST_IMPACT:
        return column
    error = np.abs(value - exact) / (abs(exact) if exact else 1.0)
    # the largest count is the reference, and so has no error
    usable = np.isfinite(error[:-1]) & (error[:-1] > 0.0)
    return column | {
        "error": error,
        "order": local_orders(1.0 / number, error, 0.0),
        "fitted_order": -slope(counts[:-1], error[:-1], usable),
        "reference": exact,
        "recommended": number_of_case(number, error, 0.0, ACCURACY),
    }


def _notes(
    columns: Mapping[str, Array], parts: Sequence[Any], counts: NDArray[np.int64], laws: str, cycles: int
) -> list[str]:  # fmt: skip
    notes = [
        f"statistics over the last {cycles} base cycles; differences below the scatter mean nothing",
        "first impact: errors against the largest count with static correction",
    ]
    change = float(parts[2 * list(columns).index("first_loss") + 1]["error"][-2])
    if change > UNSETTLED:
        notes.append(
            f"loss of the first impact still changes by {number_text(100.0 * change, 3)} % from {counts[-2]} to "
            f"{counts[-1]} "
            "modes: at a rigid contact without a body, more modes move it from the contact to the structure's own "
            "damping, and each impact's impulse falls; displacement and whole loss are what converges"
        )
    forces = columns["peak_force"]
    if np.any(forces > 0.0):
        low, high = np.nanmin(forces), np.nanmax(forces)
        notes.append(
            f"peak force ({laws}): {low:.4g} to {high:.4g} N over the counts; it does not converge with the modes of "
            "a beam for short contacts, and no order is given"
        )
    return notes


@dataclass(frozen=True)
class ContactStatistics:
    """Statistics of runs with contacts: rms and peak of a place, losses per cycle, damping, impulse of one impact.

    Impacting motion is often chaotic, and two meshes then never give the same history: what can agree are means over
    long runs. Each case is run from several phases of the base, and each value is the mean over these starts with its
    standard error. No order is fitted; a difference from the finest case within three standard errors of both means
    nothing. Rigid impacts of a bare beam have means that do depend on the mesh without end: the mass that acts
    in an impact falls with the element length (`mode_convergence`).

    Runs are event-driven over meshes and modes, and take the steps of the case over steps.

    Parameters
    ----------
    starts : int
        Phases of the base, even over a period.
    cycles : int
        Base cycles of each run, of which the last third counts.
    at : str or float, optional
        The observed place; the tip, or the system's first point.
    """

    starts: int = field(default=6, metadata=quantity("1", at_least=2, at_most=1000, integer=True))
    cycles: int = field(default=240, metadata=quantity("1", at_least=3 * PARTS, at_most=10_000_000, integer=True))
    at: Position | None = field(default=None, metadata=optional(place()))

    def __post_init__(self) -> None:
        check_fields(self)

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """Value and standard error of each statistic of the impacts in a run of the case."""
        system = case.integrated
        if case.is_limit:
            # means over starts are compared with the finest row, and not extrapolated
            return tuple(self._reading(name, np.zeros(0)) for name in STATISTICS)
        require(len(system.contacts) > 0, "contacts", 0, "", "must be one or more for statistics of impacts")
        base, at = case.driven, system.default_place if self.at is None else self.at
        window = PARTS * (self.cycles // (3 * PARTS))
        series: dict[str, list[float]] = {name: [] for name in STATISTICS}
        for k in range(self.starts):
            begun = replace(base, phase=base.phase + 2.0 * math.pi * k / self.starts)
            method = case.step or EventDriven()
            values, _ = run_statistics(system, begun, method, self.cycles / base.frequency, at, window)
            for name, column in series.items():
                column.append(values[name])
        return tuple(self._reading(name, np.array(values)) for name, values in series.items())

    def _reading(self, name: str, values: NDArray[np.float64]) -> Reading:
        known = values[np.isfinite(values)]
        if known.size < 2:
            return Reading(name.replace("_", " "), STATISTICS[name], math.nan, math.nan)
        error = float(np.std(known, ddof=1) / math.sqrt(known.size))
        # equal to rounding is no scatter of chance; a difference below the digits of a run means nothing either
        least = 1e-12 * float(np.abs(known).max())
        return Reading(
            name.replace("_", " "), STATISTICS[name], float(known.mean()), math.nan, scatter=max(error, least)
        )
