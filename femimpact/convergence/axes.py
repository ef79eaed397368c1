"""What a convergence study goes over: meshes from coarse to fine, Newmark's step, the modes kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence.cases import Case, Plan, Row
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
)
from femimpact.fem.assembly import assemble
from femimpact.fem.mesh import MOST_ELEMENTS, Mesh, graded_mesh, random_mesh, uniform_mesh
from femimpact.fem.mesh_files import read_outcomes
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.structure.structure import Structure
from femimpact.system.modes import first_elastic_frequency
from femimpact.system.reduction import reduce
from femimpact.system.system import System

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

    Raises
    ------
    InputError
        If there are fewer than two meshes, or not as many labels.

    Examples
    --------
    >>> import femimpact as fi
    >>> study = fi.convergence_study(bare, fi.OverMeshes.uniform(bare, [4, 8, 16]), fi.Frequencies(1))
    """

    meshes: tuple[Mesh | InputError, ...] = field(metadata=items(Mesh, InputError))
    labels: tuple[str, ...] = field(default=(), metadata=items(str))
    make: Callable[[int], Mesh] | None = None

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
        """Meshes of `uniform_mesh` with increasing numbers of elements.

        Raises
        ------
        InputError
            If the numbers are not three or more that increase, or the structure is not a `Structure`.
        """
        counts = rising_numbers("elements", elements, MOST_ELEMENTS)
        require_type(structure, Structure, "structure")
        return cls._of(partial(uniform_mesh, structure), counts)

    @classmethod
    def graded(cls, structure: Structure, elements: Sequence[int], ratio: float) -> OverMeshes:
        """Meshes of `graded_mesh` of one ratio, with increasing numbers of elements.

        Raises
        ------
        InputError
            If the numbers are not three or more that increase, or the finest mesh cannot be made.
        """
        counts = rising_numbers("elements", elements, MOST_ELEMENTS)
        graded_mesh(structure, int(counts[-1]), ratio)
        return cls._of(partial(graded_mesh, structure, ratio=ratio), counts)

    @classmethod
    def random(cls, structure: Structure, elements: Sequence[int], seed: int) -> OverMeshes:
        """Meshes of `random_mesh` with increasing numbers of elements, each from a different seed.

        Raises
        ------
        InputError
            If the numbers are not three or more that increase, or the finest mesh cannot be made.
        """
        counts = rising_numbers("elements", elements, MOST_ELEMENTS)
        random_mesh(structure, int(counts[-1]), seed)
        return cls._of(lambda n: random_mesh(structure, n, seed + n), counts)

    @classmethod
    def refinements(cls, mesh: Mesh, times: int = 3) -> OverMeshes:
        """A mesh and its refinements, each with twice the elements of the one before.

        Raises
        ------
        InputError
            If the mesh is not a `Mesh`, or the number of refinements is not from 1 to 12.
        """
        require_type(mesh, Mesh, "mesh")
        times = checked("times", times, quantity("1", at_least=1, at_most=12, integer=True))
        return cls(tuple(mesh.refined(k) for k in range(times + 1)))

    @classmethod
    def files(cls, paths: Sequence[str | Path]) -> OverMeshes:
        """Mesh files, in the order of their numbers of elements; one that cannot be read is a row with its reason.

        Raises
        ------
        InputError
            If the paths are no list of paths, or fewer than two files hold a mesh.
        """
        fine = isinstance(paths, (list, tuple)) and all(isinstance(path, (str, Path)) for path in paths)
        require(fine, "paths", paths, "", "must be a list of paths of mesh files")
        found = list(zip(map(Path, paths), read_outcomes([Path(path) for path in paths]), strict=True))
        found.sort(key=lambda pair: pair[1].elements if isinstance(pair[1], Mesh) else 0)
        return cls(tuple(mesh for _, mesh in found), tuple(path.name for path, _ in found))

    @classmethod
    def _of(cls, make: Callable[[int], Mesh], counts: NDArray[np.int64]) -> OverMeshes:
        made: list[Mesh | InputError] = []
        for n in counts:
            try:
                made.append(make(int(n)))
            except InputError as error:
                made.append(error)
        return cls(tuple(made), tuple(f"{n} elements" for n in counts), make)

    @property
    def name(self) -> str:
        """Name of the axis."""
        return "mesh"

    @property
    def units(self) -> tuple[str, str]:
        """Elements, and the longest one in m."""
        return "elements", "m"

    def rows(self, plan: Plan) -> Iterator[Row]:
        """A system on each mesh."""
        for label, mesh in zip(self.labels, self.meshes, strict=True):
            if isinstance(mesh, Mesh):
                yield Row(label, mesh.elements, mesh.largest, _attempt(plan, mesh))
            else:
                yield Row(label, np.nan, np.nan, mesh)

    @cached_property
    def is_family(self) -> bool:
        """Whether all element lengths fall alike from mesh to mesh, so that the rows themselves can be extrapolated."""
        known = [np.diff(mesh.nodes) for mesh in self.meshes if isinstance(mesh, Mesh)]
        falls = [(b.max() / a.max(), b.mean() / a.mean()) for a, b in pairwise(known)]
        return all(abs(one / other - 1.0) <= SIMILAR and one < 1.0 for one, other in falls)

    @property
    def ratio(self) -> float:
        """2: the longest element of the finest mesh over that of its refinement."""
        return 2.0

    def limit(self, plan: Plan, finest: Case) -> Case:
        """The refinement of the finest mesh: what is extrapolated from it leaves the rows' own orders unforced."""
        mesh = [mesh for mesh in self.meshes if isinstance(mesh, Mesh)][-1]
        system = assemble(plan.structure, mesh=mesh.refined())
        return Case("mesh", system, system, plan.base, is_limit=True)

    def case(self, plan: Plan, number: float) -> Case | FemimpactError | None:
        """The case on a mesh of so many elements, where the family has one and it is no larger than is checked."""
        if self.make is None or number > MOST_CHECKED:
            return None
        try:
            return _case("mesh", plan, self.make(int(number)))
        except FemimpactError as error:
            return error


@dataclass(frozen=True, eq=False)
class OverSteps:
    """Newmark's step, halved again and again, on one mesh.

    Parameters
    ----------
    mesh : Mesh
    method : Newmark
        Its dt is the coarsest step.
    halvings : int
    """

    mesh: Mesh = field(metadata=instance(Mesh))
    method: Newmark = field(metadata=instance(Newmark))
    halvings: int = field(default=4, metadata=quantity("1", at_least=1, at_most=20, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """Name of the axis."""
        return "step"

    @property
    def units(self) -> tuple[str, str]:
        """Steps in the first natural period, and dt in s."""
        return "steps per first natural period", "s"

    def rows(self, plan: Plan) -> Iterator[Row]:
        """The system with each step."""
        exact = _case("step", plan, self.mesh)
        for dt in self.method.dt / 2.0 ** np.arange(self.halvings + 1):
            step = replace(self.method, dt=float(dt))
            yield Row(
                f"{dt:.4g} s", 1.0 / (dt * first_elastic_frequency(exact.system)), float(dt), replace(exact, step=step)
            )

    @property
    def is_family(self) -> bool:
        """True: a step is described by its size."""
        return True

    @property
    def ratio(self) -> float:
        """Infinite: the limit is exact in time."""
        return np.inf

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

    Raises
    ------
    InputError
        If the counts do not increase.
    """

    mesh: Mesh = field(metadata=instance(Mesh))
    counts: tuple[int, ...]

    def __post_init__(self) -> None:
        check_fields(self)
        counts = rising_numbers("counts", self.counts, 2 * MOST_ELEMENTS)
        object.__setattr__(self, "counts", tuple(int(n) for n in counts))

    @property
    def name(self) -> str:
        """Name of the axis."""
        return "modes"

    @property
    def units(self) -> tuple[str, str]:
        """Modes, and one over their number."""
        return "modes", "1"

    def rows(self, plan: Plan) -> Iterator[Row]:
        """The system reduced to each number of modes; more than it has dofs is a row with its reason."""
        full = assemble(plan.structure, mesh=self.mesh)
        for count in self.counts:
            yield Row(f"{count} modes", count, 1.0 / count, _reduced(full, plan, count))

    @property
    def is_family(self) -> bool:
        """True: a count is described by its size, one over the number of modes."""
        return True

    @property
    def ratio(self) -> float:
        """Infinite: the limit is exact on its mesh."""
        return np.inf

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
    try:
        reduced = reduce(full, modes)
    except FemimpactError as error:
        return error
    return Case("modes", reduced, reduced, plan.base)


def _attempt(plan: Plan, mesh: Mesh) -> Case | FemimpactError:
    try:
        return _case("mesh", plan, mesh)
    except FemimpactError as error:
        return error
