"""Convergence of an impacting response over the number of normal modes, and statistics of runs with contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.convergence.cases import Case
from femimpact.convergence.quantities import Reading
from femimpact.convergence.table import slope
from femimpact.errors import (
    DivergenceError,
    check_fields,
    checked,
    column,
    optional,
    place,
    quantity,
    require,
    require_type,
    rising_numbers,
    text,
)  # fmt: skip
from femimpact.excitation import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method, read_at_least, require_method, stride_of
from femimpact.integrators.runs import integrate
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Position
from femimpact.sweep import frequency_sweep
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import column_units, frame_of, named_column
from femimpact.units import number_text

if TYPE_CHECKING:
    import pandas
    import xarray

STATISTICS = {
    "rms": "m",
    "peak": "m",
    "contact_loss": "J",
    "structure_loss": "J",
    "damping": "1",
    "mean_impulse": "N s",
}
"""Columns that scatter, and their units."""

OTHERS = {
    "peak_force": "N",
    "residual": "1",
    "first_displacement": "m",
    "first_loss": "J",
    "displacement_error": "1",
    "loss_error": "1",
}
"""Columns of one value without scatter."""


@dataclass(frozen=True, eq=False)
class ModeConvergence:
    """Response over the number of normal modes; columns are (n, 2): without and with static correction.

    `convergence["rms"]` reads a column.

    Parameters
    ----------
    counts : ndarray (n,)
        Normal modes; the correction adds one vector for every distinct contact direction.
    rms, peak : ndarray (n, 2), m
        Of the observed place, relative to the base; the peak is that of `SteadyMotion` over the run's last third.
    contact_loss, structure_loss : ndarray (n, 2), J
        Per base cycle.
    damping : ndarray (n, 2), 1
        Equivalent damping ratio D/(4 pi U): D all loss per cycle, U twice the mean strain energy, which is
        the largest strain energy of a sine.
    mean_impulse : ndarray (n, 2), N s
        Of one impact; not a number without impacts.
    scatter : mapping of str to ndarray (n, 2)
        Standard error of each of these from eight parts of the window; of `peak` the standard deviation of
        the parts' peaks. Differences below it mean nothing.
    peak_force : ndarray (n, 2), N
        Of a compliant law, as computed: it does not converge for short contacts. Not a number where a rigid pair
        collides.
    residual : ndarray (n, 2), 1
        Energy unaccounted for over the energy put in.
    first_displacement : ndarray (n, 2), m
        Of the observed place a quarter of the first natural period after one first impact.
    first_loss : ndarray (n, 2), J
        Lost in the contact until then.
    displacement_error, loss_error : ndarray (n, 2), 1
        Of these two, relative to the largest count with static correction.
    displacement_order, loss_order : ndarray (2,), 1
        Fitted exponent with which the error falls with the count; counts near the largest flatter it.
    at, law : str
    cycles : int
        In the window of the statistics.
    notes : tuple of str

    Raises
    ------
    InputError
        If a column is not of shape (n, 2), a count is not an integer, or `scatter` names none of these columns.
    """

    counts: NDArray[np.int64] = field(metadata=column("1", "counts", of="whole number"))
    rms: Array = field(metadata=column("m", "counts", 2))
    peak: Array = field(metadata=column("m", "counts", 2))
    contact_loss: Array = field(metadata=column("J", "counts", 2))
    structure_loss: Array = field(metadata=column("J", "counts", 2))
    damping: Array = field(metadata=column("1", "counts", 2))
    mean_impulse: Array = field(metadata=column("N s", "counts", 2))
    scatter: Mapping[str, Array]
    peak_force: Array = field(metadata=column("N", "counts", 2))
    residual: Array = field(metadata=column("1", "counts", 2))
    first_displacement: Array = field(metadata=column("m", "counts", 2))
    first_loss: Array = field(metadata=column("J", "counts", 2))
    displacement_error: Array = field(metadata=column("1", "counts", 2))
    loss_error: Array = field(metadata=column("1", "counts", 2))
    displacement_order: Array = field(metadata=column("1", 2))
    loss_order: Array = field(metadata=column("1", 2))
    at: str = field(metadata=text())
    law: str = field(metadata=text())
    cycles: int = field(metadata=quantity("1", at_least=1, integer=True))
    notes: tuple[str, ...] = field(metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)
        require_type(self.scatter, Mapping, "scatter")
        for name, values in self.scatter.items():
            known = name in STATISTICS
            require(known, "scatter", name, "", f"must be of {', '.join(STATISTICS)}")
            checked(f"scatter.{name}", values, column(STATISTICS[name], self.counts.size, 2))

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    def to_pandas(self) -> pandas.DataFrame:
        """Two rows for every count, without and with static correction; units in `attrs["units"]`."""
        units = {name: unit for name, unit in column_units(self).items() if name != "counts"}
        columns: dict[str, Any] = {
            "modes": np.repeat(self.counts, 2),
            "static_correction": np.tile([False, True], self.counts.size),
        }
        columns |= {name: getattr(self, name).ravel() for name in units}
        columns |= {f"{name}_scatter": values.ravel() for name, values in self.scatter.items()}
        units |= {f"{name}_scatter": units[name] for name in self.scatter}
        return frame_of(columns, {"modes": "1", "static_correction": "", **units}, index="modes")

    def to_xarray(self) -> xarray.Dataset:
        """All columns as a labelled dataset over the count and the static correction."""
        import xarray

        dims = ("modes", "static_correction")
        data: dict[str, Any] = {}
        for name, unit in (STATISTICS | OTHERS).items():
            labels = {"units": unit, "long_name": name.replace("_", " ")}
            data[name] = (dims, np.array(getattr(self, name)), labels)
            if name in self.scatter:
                labels = {"units": unit, "long_name": f"scatter of {labels['long_name']}"}
                data[f"{name}_scatter"] = (dims, np.array(self.scatter[name]), labels)
        for name in ("displacement_order", "loss_order"):
            data[name] = (dims[1], np.array(getattr(self, name)), {"units": "1", "long_name": name.replace("_", " ")})
        coords = {"modes": np.array(self.counts), "static_correction": np.array([False, True])}
        attributes = {"at": self.at, "contact_law": self.law, "cycles": self.cycles, "notes": "; ".join(self.notes)}
        return xarray.Dataset(data, coords=coords, attrs=attributes)


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
    keep = Recorder(channels=(at,), every=every, impacts=1_000_000)
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
    pair = system.contacts[0]
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
    place[0] = side * (near - 1e-6 * clearance)
    rate[0] = side * clearance * system.first_frequency
    return State(ball_displacement=place, ball_velocity=rate), 1e-5 / system.first_frequency


UNSETTLED = 0.1
"""Share of the first impact's loss; a larger change between the last two counts is worth a note."""


def mode_convergence(
    system: System,
    excitation: Sine,
    method: Method,
    duration: float,
    counts: Sequence[int],
    *,
    at: Position | None = None,
) -> ModeConvergence:
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
    ModeConvergence
        A run that diverged is a row of not-a-numbers, with a note.

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range, the system has no contact or is not held, or the
        duration is shorter than 24 base cycles.

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
    >>> found = fi.mode_convergence(full, base, fi.Newmark(dt=1e-4), duration=5.0, counts=[2, 4, 8])
    >>> fi.figures.mode_convergence(found).shape  # doctest: +SKIP
    """
    require_type(system, System, "system")
    require_type(excitation, Sine, "excitation")
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
    columns: dict[str, Any] = {name: np.full((numbers.size, 2), np.nan) for name in (*STATISTICS, *OTHERS)}
    scatter = {name: np.full((numbers.size, 2), np.nan) for name in STATISTICS}
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
    orders = _errors(numbers, columns)
    laws = ", ".join(dict.fromkeys(pair.law.name for pair in system.contacts))
    notes += _notes(columns, numbers, laws, cycles)
    return ModeConvergence(numbers, **columns, **orders, scatter=scatter, at=str(place), law=laws, cycles=cycles,
                           notes=tuple(notes))  # fmt: skip


def _errors(counts: NDArray[np.int64], columns: dict[str, Array]) -> dict[str, Array]:
    """Fill in the errors of the first impact; their orders in the count."""
    orders = {}
    for name, source in (("displacement", "first_displacement"), ("loss", "first_loss")):
        values = columns[source]
        exact = values[-1, 1]
        scale = abs(exact) if exact else 1.0
        columns[f"{name}_error"] = np.abs(values - exact) / scale
        # the largest count is the reference, and so has no error
        orders[f"{name}_order"] = np.array([
            -slope(counts[:-1], error, np.isfinite(error) & (error > 0.0)) for error in columns[f"{name}_error"][:-1].T
        ])  # fmt: skip
    return orders


def _notes(columns: Mapping[str, Array], counts: NDArray[np.int64], laws: str, cycles: int) -> list[str]:
    notes = [
        f"statistics over the last {cycles} base cycles; differences below the scatter mean nothing",
        "first impact: errors against the largest count with static correction",
    ]
    change = float(columns["loss_error"][-2, 1])
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
        system, base = case.integrated, case.base
        if case.is_limit:
            # means over starts are compared with the finest row, and not extrapolated
            return tuple(self._reading(name, np.zeros(0)) for name in STATISTICS)
        require(len(system.contacts) > 0, "contacts", 0, "", "must be one or more for statistics of impacts")
        require(base is not None, "base", None, "", "must be a Sine: a watched quantity is of the response to it")
        assert base is not None
        at = system.default_place if self.at is None else self.at
        window = PARTS * (self.cycles // (3 * PARTS))
        found: dict[str, list[float]] = {name: [] for name in STATISTICS}
        for k in range(self.starts):
            begun = replace(base, phase=base.phase + 2.0 * math.pi * k / self.starts)
            method = case.step or EventDriven()
            values, _ = run_statistics(system, begun, method, self.cycles / base.frequency, at, window)
            for name, kept in found.items():
                kept.append(values[name])
        return tuple(self._reading(name, np.array(values)) for name, values in found.items())

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
