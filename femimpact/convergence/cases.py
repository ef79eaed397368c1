"""The cases of a convergence study, and what is read of them: a steady response, statistics, one impact."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import FemimpactError, check_fields, checked, column, quantity, require, require_type, text
from femimpact.excitation import Sine
from femimpact.integrators.methods import Method, require_method
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Position, Structure
from femimpact.sweep import frequency_sweep
from femimpact.system.modes import Modes, solve_modes
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import column_units, frame_of, named_column

if TYPE_CHECKING:
    import pandas
    import xarray


def time_factors(base: Sine, step: Newmark | None = None) -> tuple[complex, complex]:
    """v/u (1/s) and a/u (1/s^2) of a steady motion u e^(i omega t): exact, or as Newmark's formulas relate them.

    With z = e^(i omega dt), the formulas of a step give v = dt (1 - gamma + gamma z)/(z - 1) a and
    u = [dt v + dt^2 (1/2 - beta + beta z) a]/(z - 1).
    """
    omega = 2.0 * math.pi * base.frequency
    if step is None:
        return 1j * omega, complex(-(omega**2))
    z = cmath.exp(1j * omega * step.dt)
    speed = step.dt * (1.0 - step.gamma + step.gamma * z) / (z - 1.0)
    place = (step.dt * speed + step.dt**2 * (0.5 - step.beta + step.beta * z)) / (z - 1.0)
    return speed / place, 1.0 / place


def newmark_frequency(frequency: NDArray[np.float64], step: Newmark) -> NDArray[np.float64]:
    """Frequencies (Hz) at which undamped modes move in Newmark's steps.

    A step multiplies by z with (z - 1)^2 + Omega^2 [beta z^2 + (1/2 + gamma - 2 beta) z + 1/2 - gamma + beta] = 0,
    Omega = omega dt; its frequency is arg(z)/(2 pi dt). For gamma = 1/2 and small steps the relative error is
    -(12 beta - 1)/24 Omega^2, which is -Omega^2/12 at beta = 1/4.
    """
    found = []
    for omega in 2.0 * math.pi * np.asarray(frequency):
        square = (omega * step.dt) ** 2
        roots = np.roots([
            1.0 + square * step.beta,
            -2.0 + square * (0.5 + step.gamma - 2.0 * step.beta),
            1.0 + square * (0.5 - step.gamma + step.beta),
        ])  # fmt: skip
        found.append(abs(np.angle(roots[0])) / (2.0 * math.pi * step.dt))
    return np.array(found)


def steady_amplitude(system: System, base: Sine, step: Newmark | None = None) -> NDArray[np.complex128]:
    """Complex amplitudes (dofs,) of the structure without contacts and constant loads; the base's is real.

    The stiffness is applied through its factor, as in `solve_stiffness`, so that fine meshes keep their digits.
    """
    from scipy.sparse.linalg import splu

    velocity, acceleration = time_factors(base, step)
    alpha, beta = system.rayleigh or (0.0, 0.0)
    rest = (acceleration + alpha * velocity) * system.M
    if system.rayleigh is None:
        rest = rest + velocity * system.C
    factor = sparse.csr_array(system.stiffness_factor)
    scale = 2.0 * math.pi * (system.first_frequency or base.frequency)
    blocks: Any = [
        [scale * sparse.eye_array(factor.shape[0]), factor],
        [(1.0 + beta * velocity) * factor.T, rest / -scale],
    ]
    matrix = sparse.block_array(blocks, format="csc").astype(complex)
    load = base.amplitude * (2.0 * math.pi * base.frequency) ** 2 * system.base_load
    right = np.concatenate([np.zeros(factor.shape[0]), load / -scale]).astype(complex)
    solver = splu(matrix)
    found = solver.solve(right)
    # one refinement: without it 256 elements leave 1e-9, with it 1024 leave 1e-10
    found = found + solver.solve(right - matrix @ found)
    return np.asarray(found[factor.shape[0] :])


@dataclass(frozen=True, eq=False)
class Case:
    """One system of a study, with what its quantities are read of."""

    axis: str  # "mesh", "step" or "modes": what the study goes over
    system: System  # of which the linear quantities are read
    integrated: System  # that runs with contacts integrate
    base: Sine | None
    step: Newmark | None = None  # none where time is exact
    is_limit: bool = False  # whether the case is no row but what the rows tend to

    @cached_property
    def steady(self) -> NDArray[np.complex128]:
        """Complex amplitudes (dofs,) of the steady response without contacts."""
        if self.base is None:
            require(False, "base", None, "", "must be a Sine: a watched quantity is of the response to it")
            raise AssertionError
        return steady_amplitude(self.system, self.base, self.step)

    def modes(self, count: int) -> Modes:
        """The lowest modes of the system, computed once."""
        return _known_modes(self.system, count)


def _known_modes(system: System, count: int) -> Modes:
    key = ("convergence modes", count)
    if key not in system.derived:
        system.derived[key] = solve_modes(system, count)
    found: Modes = system.derived[key]
    return found


class Plan(NamedTuple):
    """What all cases of a study share: structure, base, and modes kept for runs with contacts (None: all dofs)."""

    structure: Structure
    base: Sine | None
    modes: int | None

    def integrated(self, system: System) -> System:
        """The system that a run integrates."""
        return system if self.modes is None else reduce(system, min(self.modes, system.dofs))


class Row(NamedTuple):
    """A row of a study before it is measured: its label, number and size, and the case or why there is none."""

    label: str
    number: float
    size: float
    case: Case | FemimpactError


@runtime_checkable
class Axis(Protocol):
    """What a study goes over: named rows from coarse to fine, and what their values tend to."""

    @property
    def name(self) -> str:
        """Name of the axis, one word."""

    @property
    def units(self) -> tuple[str, str]:
        """What `number` counts, and the unit of `size`."""

    def rows(self, plan: Plan) -> Iterator[Row]:
        """Cases from coarse to fine."""

    @property
    def is_family(self) -> bool:
        """Whether one size describes a row, so that the rows themselves can be extrapolated."""

    @property
    def ratio(self) -> float:
        """Size of the finest row over that of the limit; infinite where the limit is exact."""

    def limit(self, plan: Plan, finest: Case) -> Case:
        """A case beyond the finest row."""

    def case(self, plan: Plan, number: float) -> Case | FemimpactError | None:
        """The case of a number between the rows or beyond; None where the axis does not make one."""


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
        If a column is not of shape (n, 2), a count is not whole, or `scatter` names none of these columns.
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
    phase. The scatter of the peak is that of samples, which miss the crests of all parts alike, by 0.1 % or less.
    """
    require_method(method)
    every = method.stride(excitation.frequency, POINTS_PER_CYCLE)
    keep = Recorder(channels=(at,), every=every, impacts=1_000_000)
    run = integrate(system, excitation, method, duration, keep)
    period = 1.0 / excitation.frequency
    edges = run.time[-1] - period * cycles * np.linspace(1.0, 0.0, PARTS + 1)
    whole = _over(run, at, edges[0], edges[-1], cycles)
    pieces = [_over(run, at, *ends, cycles // PARTS) for ends in pairwise(edges)]
    spread = {}
    for name in STATISTICS:
        parts = np.array([piece[name] for piece in pieces])
        parts = parts[np.isfinite(parts)]
        error = float(np.std(parts, ddof=1)) if parts.size > 1 else math.nan
        spread[name] = error if name == "peak" else error / math.sqrt(max(parts.size, 1))
    assert run.energy is not None
    whole["peak"] = _peak(system, excitation, method, duration, at, run)
    return whole | {"peak_force": run.statistics.peak_force, "residual": run.energy.residual}, spread


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
    finely = method.read_at_least(POINTS_OF_AN_IMPACT)
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
