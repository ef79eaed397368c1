"""Quantities of a convergence study: each is a record that reads its values of a case, with the order to expect."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from femimpact.arrays import Array
from femimpact.convergence.cases import Case, newmark_frequency, time_factors
from femimpact.errors import check_fields, checked, choice, name_text, optional, place, quantity, require
from femimpact.structure.structure import Position
from femimpact.system.hermite import place_in_element


class Reading(NamedTuple):
    """One value of a case."""

    name: str  # of the quantity
    unit: str
    value: float
    # exponent of the axis's size with which the error is expected to fall; not a number where none is known
    order: float
    is_distance: bool = False  # whether the value is itself a distance from the finest case
    scatter: float = 0.0  # standard error of a value of statistics


@runtime_checkable
class Watched(Protocol):
    """A quantity of a study, which reads its values of a case."""

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """Values of a case; none where the quantity does not depend on the case's axis."""


COUNT = quantity("1", at_least=1, at_most=1000, integer=True)


def mesh_order(finest: Case, order: float) -> float:
    """Order over the mesh: half that of a thin beam once elements, of one shear strain, are below sqrt(EI/(kGA))."""
    lengths = None if finest.system.sections is None else finest.system.sections.shear_length
    return order if lengths is None or np.all(lengths < np.diff(finest.system.nodes)) else 0.5 * order


@dataclass(frozen=True)
class Frequencies:
    """The lowest natural frequencies (Hz).

    Over the mesh their relative error is of order 4: the Rayleigh quotient is stationary, so that the error of a
    frequency is the square of the mode's error in the energy norm, which is of order 2 (Strang and Fix, 1973). Over
    Newmark's step it is of order 2 (see `newmark_frequency`). They do not depend on the modes kept.

    A body between two nodes makes w''' jump inside an element: order 3 over the mesh, and 1 for its rotary inertia,
    which makes w'' jump. Give it a node.

    Parameters
    ----------
    count : int
    """

    count: int = field(default=4, metadata=COUNT)

    def __post_init__(self) -> None:
        check_fields(self)

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """A reading for each frequency; not a number for those that a coarse case does not have."""
        if case.axis == "modes":
            return ()
        most = min(self.count, finest.system.dofs)
        natural = case.modes(min(most, case.system.dofs)).natural_frequency
        values = natural if case.step is None else newmark_frequency(natural, case.step)
        order = {"mesh": mesh_order(finest, 4.0), "step": 2.0}[case.axis]
        padded = np.append(values, np.full(most - values.size, np.nan))
        return tuple(Reading(f"frequency {i + 1}", "Hz", float(f), order) for i, f in enumerate(padded))


@dataclass(frozen=True)
class ModeShapes:
    """Distance of mode shapes from those of the finest mesh: relative energy norm, and 1 - MAC.

    The energy norm sqrt(int EI (w'' - v'')^2) is that of the piecewise linear w'', of order 2 (Strang and Fix, 1973).
    The modal assurance criterion MAC = (int w v)^2/(int w^2 int v^2) is the squared cosine of an angle; the deflections
    differ by order 4, so that 1 - MAC, its squared sine, is of order 8. Both integrals are exact, on the nodes of both
    meshes together. Shapes depend neither on the step nor on the modes kept.

    Parameters
    ----------
    count : int
    """

    count: int = field(default=3, metadata=COUNT)

    def __post_init__(self) -> None:
        check_fields(self)

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """Two readings for each shape; not a number for those that a coarse case does not have."""
        if case.axis != "mesh":
            return ()
        most = min(self.count, finest.system.dofs)
        energy, deficiency = _shape_distances(case, finest, most)
        return tuple(
            Reading(f"{name} {i}", "1", distance, mesh_order(finest, order), is_distance=True)
            for name, distances, order in (("shape", energy, 2.0), ("1 - MAC", deficiency, 8.0))
            for i, distance in enumerate(distances.tolist(), start=1)
        )


def _shape_distances(case: Case, finest: Case, most: int) -> tuple[Array, Array]:
    """Relative energy norm of the difference of shapes and 1 - MAC, (most,) each."""
    energy, deficiency = np.full((2, most), np.nan)
    count = min(most, case.system.dofs)
    joint = np.unique(np.concatenate([case.system.nodes, finest.system.nodes]))
    # nodes that are one but for rounding leave no element between them
    joint = joint[np.append(True, np.diff(joint) > 1e-12 * joint[-1])]
    points, weights = np.polynomial.legendre.leggauss(4)
    length = np.diff(joint)
    x = (0.5 * (joint[1:] + joint[:-1])[:, None] + 0.5 * length[:, None] * points).ravel()
    weight = (0.5 * length[:, None] * weights).ravel()
    shapes = [(s.system, s.modes(count if s is case else most).vectors[:, :count]) for s in (case, finest)]
    (w, w2), (v, v2) = (
        [system.nodal_rows(x, order) @ system.expansion @ phi for order in (0, 2)] for system, phi in shapes
    )
    assert finest.system.sections is not None
    stiff = weight * finest.system.sections.bending_stiffness_at(*place_in_element(finest.system.nodes, x, "right"))
    product, norms = weight @ (w * v), (weight @ w**2) * (weight @ v**2)
    sign = np.where(product < 0.0, -1.0, 1.0)
    energy[:count] = np.sqrt((stiff @ (sign * w2 - v2) ** 2) / (stiff @ v2**2))
    # the squared sine from the difference itself: 1 - cos^2 would lose half the digits
    apart = w - v * (product / (weight @ v**2))
    deficiency[:count] = (weight @ apart**2) * (weight @ v**2) / norms
    return energy, deficiency


@dataclass(frozen=True)
class SteadyResponse:
    """Displacement amplitude (m) of places, relative to the base, in the steady response without contacts.

    Over the mesh of order 4: the error at a point is the energy product of the errors of the response and of the
    response to a force there, each of order 2. Over Newmark's step of order 2. Over n modes the terms left out are
    those of Gamma_n phi_n(x)/omega_n^2: Gamma_n ~ 1/n and omega_n^2 ~ n^4, and phi_n(x) changes its sign from mode to
    mode, so that the remainder is of the size of the next term, n^-5; at a tip with a body phi_n ~ 1/n, n^-6.

    Examples
    --------
    >>> import femimpact as fi
    >>> watch, base = fi.convergence.SteadyResponse(("tip", "mid")), fi.Sine(1e-4, 4.0)
    >>> study = fi.convergence_study(bare, fi.convergence.OverMeshes.uniform(bare, [4, 8, 16]), [watch], base)
    """

    at: tuple[Position, ...] = ("tip", "mid")

    def __post_init__(self) -> None:
        places = (self.at,) if isinstance(self.at, (str, int, float)) else self.at
        require(isinstance(places, (tuple, list)) and len(places) > 0, "at", places, "", "must be places of the beam")
        object.__setattr__(self, "at", tuple(checked("at", position, place()) for position in places))

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """A reading for each place."""
        readings = []
        for at in self.at:
            mesh, modes = mesh_order(finest, 4.0), 6.0 if _carries_mass(finest, at) else 5.0
            order = {"mesh": mesh, "step": 2.0, "modes": modes}[case.axis]
            value = abs(complex(case.system.point_row(at) @ case.steady))
            readings.append(Reading(f"steady {at}" if isinstance(at, str) else f"steady {at:g} m", "m", value, order))
        return tuple(readings)


def _carries_mass(finest: Case, at: Position) -> bool:
    """True if a place is a free end with a body: the one place named besides where bodies are."""
    system = finest.system
    bodies = set(system.points) - {"root", "tip", "mid"}
    return at == "tip" and any(system.points[name] == system.points["tip"] for name in bodies)


@dataclass(frozen=True)
class BendingMoment:
    """Bending moment EI w'' (N m) at a place: of the steady response, or of a mass-normalised mode.

    In an element w'' is linear. Where nodal values are exact, the cubic through them misses
    w'' by h^2 w''''/12 at a node. With EI w'''' = rho A omega^2 (w + ub) the orders over the mesh are

    - 2 inside the beam, of modes and of the response;
    - 2 at a clamped root under base excitation: w = 0 there, but the inertia of the base's motion ub is not;
    - 4 at a clamped root of a mode: w'''' and its derivative vanish with w and w', and h^4 w^(6)/120 is left;
    - 2 there where the section tapers: (EI w'')'' = 0 leaves EI w'''' = -2 (EI)' w''' - (EI)'' w''.

    Near a resonance the response is nearly that mode, and its order-4 part is the larger one until h is small.
    `SupportReaction` reads the same moment with order 4 always. Over Newmark's step of order 2. Over n modes the terms
    are Gamma_n phi_n''/omega_n^2 ~ n^-3: at a clamped root all of one sign, so that their sum is of order n^-2;
    inside the beam they alternate, n^-3.

    Between two nodes the factor of h^2 depends on where in its element the place lies, and no order can be fitted
    where refinement changes that: take a place that is a node of every mesh.

    Parameters
    ----------
    at : str or float
    mode : int, optional
        None for the steady response.
    side : {"left", "right"}
        Of the element read at a node.
    """

    at: Position = field(default="root", metadata=place())
    mode: int | None = field(default=None, metadata=optional(COUNT))
    side: str = field(default="right", metadata=choice("left", "right"))

    def __post_init__(self) -> None:
        check_fields(self)

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """One reading."""
        section = case.system.section_at(self.at, self.side)
        return _of_curvature(self, "moment EI w''", "N m", section.bending_stiffness, case, finest)


@dataclass(frozen=True)
class SurfaceStress:
    """Axial stress (Pa) on the surface at a place, E (h/2) w'': of the steady response, or of a mode.

    It is a constant times the bending moment, with the orders and the fields of `BendingMoment`.

    Parameters
    ----------
    at : str or float
    mode : int, optional
    side : str

    Examples
    --------
    >>> import femimpact as fi
    >>> watch, base = [fi.convergence.Frequencies(1), fi.convergence.SurfaceStress("root")], fi.Sine(1e-4, 4.0)
    >>> study = fi.convergence_study(bare, fi.convergence.OverMeshes.uniform(bare, [4, 8, 16]), watch, base)
    """

    at: Position = field(default="root", metadata=place())
    mode: int | None = field(default=None, metadata=optional(COUNT))
    side: str = field(default="right", metadata=choice("left", "right"))

    def __post_init__(self) -> None:
        check_fields(self)

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """One reading."""
        section = case.system.section_at(self.at, self.side)
        stress = section.young_modulus * section.known_half_height("SurfaceStress")
        return _of_curvature(self, "stress", "Pa", stress, case, finest)


def _of_curvature(
    watched: BendingMoment | SurfaceStress, what: str, unit: str, factor: float, case: Case, finest: Case
) -> tuple[Reading, ...]:
    """A constant times |w''| at a place."""
    if watched.mode is not None and case.axis != "mesh":
        return ()
    row = case.system.curvature_rows([case.system.position_of(watched.at)], watched.side)[0]
    at = watched.at if isinstance(watched.at, str) else f"{watched.at:g} m"
    clamped = {f"{at}.force", f"{at}.moment"} <= set(case.system.reactions)
    if watched.side == "left":
        # both sides of a place may be watched
        at += " left"
    if watched.mode is None:
        inside = {"mesh": mesh_order(finest, 2.0), "step": 2.0, "modes": 3.0}
        order = 2.0 if clamped else inside[case.axis]
        return (Reading(f"{what} {at}", unit, factor * abs(complex(row @ case.steady)), order),)
    name, per = f"{what} {at}, mode {watched.mode}", f"{unit} m^-1 kg^-0.5"
    sections = case.system.sections
    element, _ = place_in_element(case.system.nodes, np.array([case.system.position_of(watched.at)]), watched.side)
    tapers = sections is not None and bool(sections.is_tapered[element[0]])
    order = mesh_order(finest, 4.0 if clamped and not tapers else 2.0)
    if watched.mode > case.system.dofs:
        return (Reading(name, per, math.nan, order),)
    shape = case.modes(watched.mode).vectors[:, watched.mode - 1]
    return (Reading(name, per, factor * abs(float(row @ shape)), order),)


@dataclass(frozen=True)
class SupportReaction:
    """Amplitude of a support's force (N) or moment (N m) on the structure, in the steady response without contacts.

    It is read from the equations of the held dofs (`Reaction`), with damping and the inertia beside the support. The
    row of a held dof is the response tested with that dof's shape function: a reading of the energy, of order 4 over
    the mesh, where EI w'' of the same place has order 2. Over Newmark's step of order 2; over n modes n^-2 of a
    moment and n^-1 of a force, whose terms ~ n^-2 have one sign.

    Parameters
    ----------
    name : str
        Of the reaction, as "root.moment".
    """

    name: str = field(default="root.moment", metadata=name_text())

    def __post_init__(self) -> None:
        check_fields(self)

    def read(self, case: Case, finest: Case) -> tuple[Reading, ...]:
        """One reading."""
        known = case.system.reactions
        require(self.name in known, "name", self.name, "", f"must be a reaction of the system: {', '.join(known)}")
        item, steady = known[self.name], case.steady
        velocity, acceleration = time_factors(case.driven, case.step)
        rows = item.on_displacement + velocity * item.on_velocity + acceleration * item.on_acceleration
        moved = -((2.0 * math.pi * case.driven.frequency) ** 2) * case.driven.amplitude
        value = abs(complex(rows @ steady) + item.on_base_acceleration * moved)
        order = {"mesh": mesh_order(finest, 4.0), "step": 2.0, "modes": 2.0 if item.unit == "N m" else 1.0}[case.axis]
        return (Reading(f"reaction {self.name}", item.unit, value, order),)
