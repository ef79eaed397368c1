"""Convergence of frequencies over the mesh and of the response over the step, with fitted orders."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.convergence.table import extrapolated, fitted_order
from femimpact.errors import check_fields, checked, column, quantity, require_type, rising_numbers, text
from femimpact.excitation import Sine
from femimpact.fem.assembly import assemble
from femimpact.fem.mesh import MOST_ELEMENTS, Mesh, uniform_mesh
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.response.response import Recorder
from femimpact.structure.structure import Structure
from femimpact.system.modes import solve_modes
from femimpact.system.system import System, without_impactors
from femimpact.table import flat_columns, frame_of, named_column

if TYPE_CHECKING:
    import pandas


ASSEMBLED_STIFFNESS_FLOOR = 4.0
"""Rounding of an assembled Hermite stiffness shifts the first frequency by about this times eps N^4 / sqrt(N)."""


PHASES = 8
"""Base phases over which the error after the first impact is averaged."""


@dataclass(frozen=True, eq=False)
class MeshConvergence:
    """Natural frequencies over the number of elements.

    `convergence["error"]` reads a column.

    Raises `InputError` if the arrays do not have one row for each mesh and one column for each mode, or a number of
    elements is not an integer.
    """

    elements: NDArray[np.int64] = field(metadata=column("1", "meshes", of="whole number"))  # (n,)
    natural_frequency: Array = field(metadata=column("Hz", "meshes", "modes"))  # (n, modes) Hz
    error: Array = field(metadata=column("1", "meshes", "modes"))  # (n, modes) relative, against the reference
    # (modes,) fitted exponent of the error in the element length, above the floor
    order: Array = field(metadata=column("1", "modes"))
    # (modes,) Hz: extrapolated from the two finest meshes that still converge
    reference: Array = field(metadata=column("Hz", "modes"))
    # (modes,) relative error below which rounding, not the mesh, decides
    floor: Array = field(metadata=column("1", "modes"))
    notes: tuple[str, ...] = field(metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    def to_pandas(self) -> pandas.DataFrame:
        """Columns natural_frequency_1, ..., error_1, ... over the elements; units in `attrs["units"]`."""
        return frame_of(*flat_columns(self), index="elements")


def converge_elements(structure: Structure, elements: Sequence[int], modes: int = 4) -> MeshConvergence:
    """Natural frequencies of a structure over its mesh; cubic Hermite elements give order 4 (Strang and Fix, 1973).

    Parameters
    ----------
    structure : Structure
    elements : sequence of int
        Increasing numbers of elements.
    modes : int
        How many frequencies; fewer where the coarsest mesh has fewer dofs.

    Returns
    -------
    MeshConvergence

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range.
    """
    require_type(structure, Structure, "structure")
    modes = checked("modes", modes, quantity("1", at_least=1, integer=True))
    counts = rising_numbers("elements", elements, MOST_ELEMENTS)
    bare = replace(structure, impactors=())
    return converge_meshes(bare, [uniform_mesh(bare, int(n)) for n in counts], modes)


def converge_meshes(structure: Structure, meshes: Sequence[Mesh], modes: int = 4) -> MeshConvergence:
    """Natural frequencies of a structure on meshes of one family, from coarse to fine; see `converge_elements`."""
    bare, counts = replace(structure, impactors=()), np.array([mesh.elements for mesh in meshes])
    systems = [assemble(bare, mesh=mesh) for mesh in meshes]
    modes = min(modes, min(system.dofs for system in systems))
    f = np.array([solve_modes(system, modes).natural_frequency for system in systems])
    floor = np.full(modes, 1e-11)
    reference = np.array([_limit(counts, f[:, i]) for i in range(modes)])
    error = np.abs(f / reference - 1.0)
    order = np.array([fitted_order(1.0 / counts, error[:, i], 100 * floor[i]) for i in range(modes)])
    notes = [
        "frequencies are read from the stiffness factor: their round-off floor is near 1e-12, where errors flatten"
    ]
    spoiled = counts[[_assembled_floor(int(n)) > e for n, e in zip(counts, error[:, 0], strict=True)]]
    if spoiled.size:
        notes.append(
            f"from N = {spoiled[0]} on, rounding in the assembled stiffness (about 4 eps N^3.5, "
            f"{_assembled_floor(int(spoiled[-1])):.1g} in the first frequency at N = {spoiled[-1]}) exceeds the "
            "mesh's error: it is in time integration in physical dofs, not in that of reduced systems"
        )
    return MeshConvergence(counts, f, error, order, reference, floor, tuple(notes))


def _assembled_floor(elements: int) -> float:
    return float(ASSEMBLED_STIFFNESS_FLOOR * np.finfo(float).eps * elements**3.5)


def _limit(counts: NDArray[np.int64], f: Array) -> float:
    """Richardson's value of order 4 from the last two meshes that still differ beyond rounding."""
    last = f.size - 1
    while last > 1 and abs(f[last] / f[last - 1] - 1.0) < 1e-9:
        last -= 1
    return extrapolated(f[last - 1], f[last], counts[last] / counts[last - 1], 4.0)


@dataclass(frozen=True, eq=False)
class StepConvergence:
    """Response over the step of the method.

    `convergence["linear_error"]` reads a column.

    Raises `InputError` if the columns do not have one value for each step, a step is not finite, or `impacts` is no
    whole number from 0.
    """

    dt: Array = field(metadata=column("s", "steps", finite=True))  # (n,) s
    # (n,) of the tip without balls over a few base cycles, relative to the largest tip displacement
    linear_error: Array = field(metadata=column("1", "steps"))
    linear_order: float = field(metadata=quantity("1", finite=False))
    # (n,) of the tip and the balls shortly after the first impact, relative to their largest displacement; root mean
    # square over 8 phases of the base, since where in a step the touch falls is chance
    first_impact_error: Array = field(metadata=column("1", "steps"))
    first_impact_order: float = field(metadata=quantity("1", finite=False))
    energy_residual: Array = field(metadata=column("1", "steps"))  # (n,) of these short runs, root mean square
    # first impacts that were compared; later chaos makes histories incomparable
    impacts: int = field(metadata=quantity("1", at_least=0, integer=True))
    notes: tuple[str, ...] = field(metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    def to_pandas(self) -> pandas.DataFrame:
        """The errors over the step; units in `attrs["units"]`."""
        return frame_of(*flat_columns(self), index="dt")


def converge_step(system: System, excitation: Sine, method: Newmark, halvings: int = 5) -> StepConvergence:
    """Error of the response over the step, against a run with a step four times finer than the finest.

    Parameters
    ----------
    system : System
    excitation : Sine
    method : Newmark
        Its dt is the coarsest step.
    halvings : int
        How often it is halved.

    Returns
    -------
    StepConvergence
        The average-acceleration method has order 2 (Hughes, 1987).

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range.
    """
    given: tuple[tuple[str, Any, Any], ...] = (
        ("system", system, System), ("excitation", excitation, Sine), ("method", method, Newmark)
    )  # fmt: skip
    for key, value, kind in given:
        require_type(value, kind, key)
    halvings = checked("halvings", halvings, quantity("1", at_least=1, at_most=20, integer=True))
    dt = method.dt / 2.0 ** np.arange(halvings + 1, dtype=float)
    finest = replace(method, dt=float(dt[-1] / 4.0))
    bare = without_impactors(system)
    # a multiple of the coarsest step, so that all runs end at the same instant
    cycles = method.dt * round(3.0 / (excitation.frequency * method.dt))
    linear = _errors(bare, excitation, method, dt, finest, cycles)[0]
    notes = ["linear part: the tip over 3 base cycles from rest"]
    impact, residual, count = np.full(dt.size, np.nan), np.full(dt.size, np.nan), 0
    if system.contacts:
        squares = []
        for phase in 2.0 * math.pi * np.arange(PHASES) / PHASES:
            base = replace(excitation, phase=float(phase))
            duration = _past_first_impact(system, base, method)
            if duration is not None:
                squares.append(np.square(_errors(system, base, method, dt, finest, duration)))
        count = len(squares)
        if count:
            impact, residual = np.sqrt(np.mean(squares, axis=0))
            notes.append(f"with balls: to shortly after the first impact, over {count} phases of the base")
        else:
            notes.append("with balls: no impact within 40 base cycles, nothing to compare")
    return StepConvergence(
        dt=dt,
        linear_error=linear,
        linear_order=fitted_order(dt, linear, 0.0),
        first_impact_error=impact,
        first_impact_order=fitted_order(dt, impact, 0.0),
        energy_residual=residual,
        impacts=count,
        notes=tuple(notes),
    )


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
