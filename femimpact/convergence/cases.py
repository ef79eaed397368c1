"""Cases of a convergence study and its axes: meshes from coarse to fine, Newmark's step, the modes kept."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import ClassVar, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import (
    FemimpactError,
    InputError,
    check_fields,
    checked,
    instance,
    items,
    quantity,
    require,
    require_type,
    rising_numbers,
)  # fmt: skip
from femimpact.excitation.harmonic import Sine
from femimpact.fem.assembly import assemble
from femimpact.fem.mesh import MOST_ELEMENTS, Mesh, graded_mesh, random_mesh, uniform_mesh
from femimpact.fem.mesh_files import read_mesh
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.signals.transfer import harmonic_amplitudes
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes, first_elastic_frequency, solve_modes
from femimpact.system.reduction import reduce
from femimpact.system.system import System


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
    frequencies = []
    for omega in 2.0 * math.pi * np.asarray(frequency):
        square = (omega * step.dt) ** 2
        roots = np.roots([
            1.0 + square * step.beta,
            -2.0 + square * (0.5 + step.gamma - 2.0 * step.beta),
            1.0 + square * (0.5 - step.gamma + step.beta),
        ])  # fmt: skip
        frequencies.append(abs(np.angle(roots[0])) / (2.0 * math.pi * step.dt))
    return np.array(frequencies)


def steady_amplitude(system: System, base: Sine, step: Newmark | None = None) -> NDArray[np.complex128]:
    """Complex amplitudes (dofs,) of the structure without contacts and constant loads; the base's is real."""
    load = base.amplitude * (2.0 * math.pi * base.frequency) ** 2 * system.base_load
    return harmonic_amplitudes(replace(system, contacts=()), load, 0.0, base.frequency, *time_factors(base, step))[0]


@dataclass(frozen=True, eq=False)
class Case:
    """One system of a study, with the excitation and step of its quantities."""

    axis: str  # "mesh", "step" or "modes": what the study goes over
    system: System  # of which the linear quantities are read
    integrated: System  # that runs with contacts integrate
    base: Sine | None
    step: Newmark | None = None  # none where time is exact
    is_limit: bool = False  # true of the case that the rows tend to

    @property
    def driven(self) -> Sine:
        """The motion of the base; `InputError` without one."""
        require(self.base is not None, "base", None, "", "must be a Sine: a watched quantity is of the response to it")
        assert self.base is not None
        return self.base

    @cached_property
    def steady(self) -> NDArray[np.complex128]:
        """Complex amplitudes (dofs,) of the steady response without contacts."""
        return steady_amplitude(self.system, self.driven, self.step)

    def modes(self, count: int) -> Modes:
        """The lowest modes of the system, computed once."""
        key, known = ("convergence modes", count), self.system.derived
        if key not in known:
            known[key] = solve_modes(self.system, count)
        modes: Modes = known[key]
        return modes


Made = TypeVar("Made")
Error = TypeVar("Error", bound=FemimpactError)


def attempted(make: Callable[[], Made], refused: type[Error] = FemimpactError) -> Made | Error:  # type: ignore[assignment]
    """The object made, or the error with which it was refused."""
    try:
        return make()
    except refused as error:
        return error


class Plan(NamedTuple):
    """Structure, base, and modes kept for runs with contacts (None: all dofs), common to all cases of a study."""

    structure: Structure
    base: Sine | None
    modes: int | None

    def integrated(self, system: System) -> System:
        """The system of a case reduced to its number of modes; the system itself where the case names none."""
        return system if self.modes is None else reduce(system, min(self.modes, system.dofs))


class Row(NamedTuple):
    """A row of a study before it is measured: its label, number and size, and the case or why there is none."""

    label: str
    number: float
    size: float
    case: Case | FemimpactError


@runtime_checkable
class Axis(Protocol):
    """Named rows of a study from coarse to fine, and the limit of their values."""

    @property
    def name(self) -> str:
        """Name of the axis, one word."""

    @property
    def units(self) -> tuple[str, str]:
        """Text of what `number` counts, and the unit of `size`."""

    def rows(self, plan: Plan) -> Iterator[Row]:
        """Cases from coarse to fine."""

    @property
    def is_family(self) -> bool:
        """True where one size describes a row: the rows can then be extrapolated."""

    @property
    def ratio(self) -> float:
        """Size of the finest row over that of the limit; infinite where the limit is exact."""

    def limit(self, plan: Plan, finest: Case) -> Case:
        """A case beyond the finest row."""

    def case(self, plan: Plan, number: float) -> Case | FemimpactError | None:
        """The case of a number between the rows or beyond; None where the axis does not make one."""


MOST_CHECKED = 1024
"""Elements of a mesh on which a recommended number is checked; a larger one follows from the order alone."""

SIMILAR = 0.02
"""Relative difference of the ratios of element lengths up to which two meshes are of one family."""


@dataclass(frozen=True, eq=False)
class OverMeshes:
    """Meshes from coarse to fine, whose size is their longest element.

    The longest element bounds the error: where meshes leave it as it is, being refined elsewhere, their errors tend to
    the one that it leaves, which has no order. Their errors are still those from an endlessly fine mesh, extrapolated
    from the finest one with each element halved.

    Parameters
    ----------
    meshes : tuple of Mesh or InputError
        An error stands for a mesh that could not be made or read; it becomes a row with its reason.
    labels : tuple of str, optional
        "8 elements" and so on by default.
    make : callable, optional
        The mesh of a number of elements, as of `uniform` and `graded`: a recommended number is then checked on it.

    Examples
    --------
    >>> import femimpact as fi
    >>> over = fi.convergence.OverMeshes.uniform(bare, [4, 8, 16])
    >>> study = fi.convergence_study(bare, over, fi.convergence.Frequencies(1))
    """

    meshes: tuple[Mesh | InputError, ...] = field(metadata=items(Mesh, InputError))
    labels: tuple[str, ...] = field(default=(), metadata=items(str))
    make: Callable[[int], Mesh] | None = None
    name: ClassVar[str] = "mesh"
    units: ClassVar[tuple[str, str]] = ("elements", "m")
    ratio: ClassVar[float] = 2.0
    """Longest element of the finest mesh over that of its refinement."""

    def __post_init__(self) -> None:
        check_fields(self)
        require(self.make is None or callable(self.make), "make", self.make, "", "must be callable, or None")
        known = [mesh for mesh in self.meshes if isinstance(mesh, Mesh)]
        reasons = [str(mesh) for mesh in self.meshes if not isinstance(mesh, Mesh)]
        why = f": {reasons[0]}" if reasons else ""
        require(len(known) >= 2, "meshes", len(known), "", f"must be two or more that can be used{why}")
        if not self.labels:
            words = tuple(f"{m.elements} elements" if isinstance(m, Mesh) else "none" for m in self.meshes)
            object.__setattr__(self, "labels", words)
        require(len(self.labels) == len(self.meshes), "labels", self.labels, "", f"must be {len(self.meshes)} texts")

    @classmethod
    def uniform(cls, structure: Structure, elements: Sequence[int]) -> OverMeshes:
        """Meshes of `uniform_mesh` with increasing numbers of elements."""
        counts = rising_numbers("elements", elements, MOST_ELEMENTS)
        require_type(structure, Structure, "structure")
        return cls._of(partial(uniform_mesh, structure), counts)

    @classmethod
    def graded(cls, structure: Structure, elements: Sequence[int], ratio: float) -> OverMeshes:
        """Meshes of `graded_mesh` of one ratio, with increasing numbers of elements."""
        counts = rising_numbers("elements", elements, MOST_ELEMENTS)
        graded_mesh(structure, int(counts[-1]), ratio)
        return cls._of(partial(graded_mesh, structure, ratio=ratio), counts)

    @classmethod
    def random(cls, structure: Structure, elements: Sequence[int], seed: int) -> OverMeshes:
        """Meshes of `random_mesh` with increasing numbers of elements, each from a different seed."""
        counts = rising_numbers("elements", elements, MOST_ELEMENTS)
        random_mesh(structure, int(counts[-1]), seed)
        return cls._of(lambda n: random_mesh(structure, n, seed + n), counts)

    @classmethod
    def refinements(cls, mesh: Mesh, times: int = 3) -> OverMeshes:
        """A mesh and its refinements, each with twice the elements of the one before."""
        require_type(mesh, Mesh, "mesh")
        times = checked("times", times, quantity("1", at_least=1, at_most=12, integer=True))
        return cls(tuple(mesh.refined(k) for k in range(times + 1)))

    @classmethod
    def files(cls, paths: Sequence[str | Path]) -> OverMeshes:
        """Mesh files, in the order of their numbers of elements; one that cannot be read is a row with its reason."""
        fine = isinstance(paths, (list, tuple)) and all(isinstance(path, (str, Path)) for path in paths)
        require(fine, "paths", paths, "", "must be a list of paths of mesh files")
        meshes = [(Path(path), attempted(partial(read_mesh, path), InputError)) for path in paths]
        meshes.sort(key=lambda pair: pair[1].elements if isinstance(pair[1], Mesh) else 0)
        return cls(tuple(mesh for _, mesh in meshes), tuple(path.name for path, _ in meshes))

    @classmethod
    def _of(cls, make: Callable[[int], Mesh], counts: NDArray[np.int64]) -> OverMeshes:
        meshes = tuple(attempted(partial(make, int(n)), InputError) for n in counts)
        return cls(meshes, tuple(f"{n} elements" for n in counts), make)

    def rows(self, plan: Plan) -> Iterator[Row]:
        """A system on each mesh."""
        for label, mesh in zip(self.labels, self.meshes, strict=True):
            if isinstance(mesh, Mesh):
                yield Row(label, mesh.elements, mesh.largest, attempted(partial(_case, "mesh", plan, mesh)))
            else:
                yield Row(label, np.nan, np.nan, mesh)

    @cached_property
    def is_family(self) -> bool:
        """True where all element lengths fall by one factor from mesh to mesh: the rows can then be extrapolated."""
        known = [np.diff(mesh.nodes) for mesh in self.meshes if isinstance(mesh, Mesh)]
        falls = [(b.max() / a.max(), b.mean() / a.mean()) for a, b in pairwise(known)]
        return all(abs(fall / other - 1.0) <= SIMILAR and fall < 1.0 for fall, other in falls)

    def limit(self, plan: Plan, finest: Case) -> Case:
        """The refinement of the finest mesh: a value extrapolated from it does not impose an order on the rows."""
        mesh = [mesh for mesh in self.meshes if isinstance(mesh, Mesh)][-1]
        system = assemble(plan.structure, mesh=mesh.refined())
        return Case("mesh", system, system, plan.base, is_limit=True)

    def case(self, plan: Plan, number: float) -> Case | FemimpactError | None:
        """The case on a mesh of so many elements, where the family has one and it is no larger than is checked."""
        if self.make is None or number > MOST_CHECKED:
            return None
        make = self.make
        return attempted(lambda: _case("mesh", plan, make(int(number))))


@dataclass(frozen=True, eq=False)
class OverSteps:
    """Newmark's step, halved again and again from that of the method on, on one mesh.

    Parameters
    ----------
    mesh : Mesh
    method : Newmark
    halvings : int
    """

    mesh: Mesh = field(metadata=instance(Mesh))
    method: Newmark = field(metadata=instance(Newmark))
    halvings: int = field(default=4, metadata=quantity("1", at_least=1, at_most=20, integer=True))
    name: ClassVar[str] = "step"
    units: ClassVar[tuple[str, str]] = ("steps per first natural period", "s")
    is_family: ClassVar[bool] = True
    ratio: ClassVar[float] = np.inf

    def __post_init__(self) -> None:
        check_fields(self)

    def rows(self, plan: Plan) -> Iterator[Row]:
        """The system with each step."""
        exact = _case("step", plan, self.mesh)
        for dt in self.method.dt / 2.0 ** np.arange(self.halvings + 1):
            step = replace(self.method, dt=float(dt))
            yield Row(
                f"{dt:.4g} s", 1.0 / (dt * first_elastic_frequency(exact.system)), float(dt), replace(exact, step=step)
            )

    def limit(self, plan: Plan, finest: Case) -> Case:
        """The same system, exact in time."""
        return replace(finest, step=None, is_limit=True)

    def case(self, plan: Plan, number: float) -> Case | FemimpactError | None:
        """The system with so many steps in the first natural period."""
        exact = _case("step", plan, self.mesh)
        dt = 1.0 / (number * first_elastic_frequency(exact.system))
        return replace(exact, step=replace(self.method, dt=float(dt)))


@dataclass(frozen=True, eq=False)
class OverModes:
    """Increasing numbers of kept normal modes on one mesh.

    Parameters
    ----------
    mesh : Mesh
    counts : tuple of int
    """

    mesh: Mesh = field(metadata=instance(Mesh))
    counts: tuple[int, ...]
    name: ClassVar[str] = "modes"
    units: ClassVar[tuple[str, str]] = ("modes", "1")
    is_family: ClassVar[bool] = True
    ratio: ClassVar[float] = np.inf

    def __post_init__(self) -> None:
        check_fields(self)
        counts = rising_numbers("counts", self.counts, 2 * MOST_ELEMENTS)
        object.__setattr__(self, "counts", tuple(int(n) for n in counts))

    def rows(self, plan: Plan) -> Iterator[Row]:
        """The system reduced to each number of modes; more than it has dofs is a row with its reason."""
        full = assemble(plan.structure, mesh=self.mesh)
        for count in self.counts:
            yield Row(f"{count} modes", count, 1.0 / count, _reduced(full, plan, count))

    def limit(self, plan: Plan, finest: Case) -> Case:
        """The system in all dofs of the mesh."""
        system = assemble(plan.structure, mesh=self.mesh)
        return Case("modes", system, system, plan.base, is_limit=True)

    def case(self, plan: Plan, number: float) -> Case | FemimpactError | None:
        """The system on so many modes."""
        return _reduced(assemble(plan.structure, mesh=self.mesh), plan, int(number))


def _case(axis: str, plan: Plan, mesh: Mesh) -> Case:
    system = assemble(plan.structure, mesh=mesh)
    return Case(axis, system, plan.integrated(system), plan.base)


def _reduced(full: System, plan: Plan, modes: int) -> Case | FemimpactError:
    reduced = attempted(lambda: reduce(full, modes))
    return Case("modes", reduced, reduced, plan.base) if isinstance(reduced, System) else reduced
