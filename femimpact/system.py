"""The semi-discrete equations: matrices, named places and contact pairs. No finite-element object inside.

M u'' + C u' + K u = -base_load ub'' + sum_j b_j F_j,   m_j (y_j'' + ub'') = m_j g_j - F_j,
with u and y relative to the moving base.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.contact import ContactLaw, ContactParameters
from femimpact.errors import check_fields, choice, require, suggestion
from femimpact.excitation import Sine
from femimpact.hermite import shape_functions
from femimpact.structure import Position

__all__ = ["ContactPair", "State", "System", "without_impactors"]


@dataclass(frozen=True)
class ContactPair:
    """One ball between its two walls, seen by the structure through one direction vector.

    Parameters
    ----------
    name : str
    direction : ndarray (dofs,)
        b: the structure's displacement at the pair is b @ u.
    position : float, m
    mass : float, kg
    gaps : pair of float, m
        On the + and on the - side.
    law : ContactLaw
    parameters : ContactParameters
        The law's numbers for this pair's effective mass.
    effective_mass : float, kg
        1/(1/m + phi1^2) with the first mass-normalised mode at the pair.
    free_stiffness : float, N/m
    acceleration : float, m/s^2
    """

    name: str
    direction: NDArray[Any]
    position: float
    mass: float
    gaps: tuple[float, float]
    law: ContactLaw
    parameters: ContactParameters
    effective_mass: float
    free_stiffness: float
    acceleration: float


@dataclass(frozen=True, eq=False)
class System:
    """Semi-discrete equations of a structure, in free degrees of freedom or in modal ones.

    Parameters
    ----------
    M, C, K : csr_array (dofs, dofs)
        Mass, damping and stiffness of the structure only (kg, N s/m, N/m; modal: 1, 1/s, 1/s^2).
    stiffness_factor : csr_array (strains, dofs)
        G with K = G^T G: weighted curvatures at the Gauss points (modal: diag(omega)).
    base_load : ndarray (dofs,), kg
        M r, the share of the held dofs included: the load is -base_load ub''.
    rigid_translation : ndarray (dofs,)
        r, the free dofs when the structure moves as a rigid body by 1 m.
    nodes : ndarray (n,), m
    expansion : csr_array or ndarray (2 n, dofs)
        From the dofs to (w1, w1', w2, w2', ...) at the nodes, held ones included.
    points : mapping of str to float
        Named places, m from the root.
    total_mass : float, kg
        Mass that moves with the base, balls excluded.
    first_frequency : float, Hz
        First natural frequency of the structure, without balls and undamped.
    contacts : tuple of ContactPair
    rayleigh : pair of float, optional
        alpha (1/s) and beta (s) where C = alpha M + beta K.
    """

    M: Any
    C: Any
    K: Any
    stiffness_factor: Any
    base_load: NDArray[Any]
    rigid_translation: NDArray[Any]
    nodes: NDArray[Any]
    expansion: Any
    points: Mapping[str, float]
    total_mass: float
    first_frequency: float
    contacts: tuple[ContactPair, ...] = ()
    rayleigh: tuple[float, float] | None = None

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom of the structure."""
        return int(self.base_load.size)

    @property
    def is_diagonal(self) -> bool:
        """Whether M, C and K are diagonal, as in modal coordinates."""
        return all(_is_diagonal(matrix) for matrix in (self.M, self.C, self.K))

    def position_of(self, at: Position) -> float:
        """Metres from the root of a named place or of a number, checked to lie on the beam."""
        if isinstance(at, str):
            require(at in self.points, "at", at, "", suggestion(at, self.points))
            return float(self.points[at])
        length = float(self.nodes[-1])
        inside = -1e-9 * length <= at <= length * (1 + 1e-9)
        require(inside, "at", at, "m", f"must be within the beam, 0 to {length:g} m")
        return float(np.clip(at, 0.0, length))

    def deflection_rows(self, positions: ArrayLike, derivative: int = 0) -> NDArray[Any]:
        """Rows that read the deflection (or its derivative by x) at positions off the dofs.

        w(x) = rows @ u, along the Hermite curve of the element that holds x.

        Parameters
        ----------
        positions : array_like (k,), m
        derivative : int
            0 deflection, 1 slope dw/dx, 2 curvature (1/m), 3 its slope (1/m^2).

        Returns
        -------
        ndarray (k, dofs)
        """
        rows: Any = hermite_rows(self.nodes, positions, derivative) @ self.expansion
        return np.asarray(rows if isinstance(rows, np.ndarray) else rows.toarray())

    def point_row(self, at: Position) -> NDArray[Any]:
        """Row (dofs,) that reads the deflection at one named or numbered place."""
        return np.asarray(self.deflection_rows([self.position_of(at)])[0])


def _is_diagonal(matrix: Any) -> bool:
    entries = sparse.coo_array(matrix)
    return bool(np.all((entries.coords[0] == entries.coords[1]) | (entries.data == 0.0)))


def hermite_rows(nodes: NDArray[Any], positions: ArrayLike, derivative: int = 0) -> Any:
    """Sparse rows from nodal (w, w') pairs to the deflection, or a derivative of it, at positions.

    Parameters
    ----------
    nodes : ndarray (n,), m
    positions : array_like (k,), m
    derivative : int

    Returns
    -------
    csr_array (k, 2 n)
    """
    x = np.atleast_1d(np.asarray(positions, dtype=float))
    element = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    length = nodes[element + 1] - nodes[element]
    values = shape_functions((x - nodes[element]) / length, derivative) / length**derivative
    values[[1, 3]] *= length
    row = np.repeat(np.arange(x.size), 4)
    column = (2 * element[:, None] + np.arange(4)).ravel()
    return sparse.csr_array((values.T.ravel(), (row, column)), shape=(x.size, 2 * nodes.size))


@dataclass(frozen=True, eq=False)
class State:
    """Displacements and velocities at the start of a run.

    Parameters
    ----------
    displacement, velocity : array_like (dofs,), optional
        Of the structure's dofs (m, m/s); None is zero.
    ball_displacement, ball_velocity : array_like (balls,), optional
        m and m/s, in the order of `System.contacts`; None is zero.
    frame : {"base", "space"}
        Whether the values are relative to the moving base or absolute.
    """

    displacement: Any = None
    velocity: Any = None
    ball_displacement: Any = None
    ball_velocity: Any = None
    frame: str = field(default="base", metadata=choice("base", "space"))

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def at_rest(cls, frame: str = "base") -> State:
        """Beam and balls at rest in the frame of the base, or in space."""
        return cls(frame=frame)

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing moves or is displaced in the state's own frame."""
        given = (self.displacement, self.velocity, self.ball_displacement, self.ball_velocity)
        return all(values is None or not np.any(values) for values in given)

    def relative_to_base(
        self, system: System, base: Sine
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        """u, u', y, y' at t = 0 relative to the base (m and m/s), checked for size and gaps."""
        balls = len(system.contacts)
        u = _vector(self.displacement, system.dofs, "initial.displacement", "m")
        v = _vector(self.velocity, system.dofs, "initial.velocity", "m/s")
        y = _vector(self.ball_displacement, balls, "initial.ball_displacement", "m")
        y_rate = _vector(self.ball_velocity, balls, "initial.ball_velocity", "m/s")
        if self.frame == "space":
            offset, speed = float(base.displacement(0.0)), float(base.velocity(0.0))
            u, v = u - offset * system.rigid_translation, v - speed * system.rigid_translation
            y, y_rate = y - offset, y_rate - speed
        for pair, place in zip(system.contacts, y, strict=True):
            x = float(place - pair.direction @ u)
            allowed = f"must start between its walls, -{pair.gaps[1]:g} to {pair.gaps[0]:g} m"
            inside = -pair.gaps[1] - 1e-12 <= x <= pair.gaps[0] + 1e-12
            require(inside, f"initial.{pair.name}.gap", x, "m", allowed)
        return u, v, y, y_rate


def _vector(values: Any, size: int, key: str, unit: str) -> NDArray[Any]:
    array = np.zeros(size) if values is None else np.atleast_1d(np.array(values, dtype=float))
    fits = array.shape == (size,) and bool(np.all(np.isfinite(array)))
    require(fits, key, f"array of shape {array.shape}", unit, f"must hold {size} finite numbers")
    return array


def without_impactors(system: System) -> System:
    """The same system with its cavity empty: no ball, no contact."""
    return replace(system, contacts=())
