"""A factor G of the stiffness, K = G^T G, that keeps the digits of fine meshes, also of elements that taper."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from femimpact.fem.discretisation import Discretisation
from femimpact.system.hermite import hermite_rows
from femimpact.system.matrices import Matrix

__all__ = ["stiffness_factor"]

Array = NDArray[np.float64]


def stiffness_factor(grid: Discretisation) -> Matrix:
    """G with K = G^T G over all dofs: sqrt(weight) w'' at two points of every element.

    The energy of an element is the integral of EI w''^2 with w'' linear. The two Gauss points of the weight EI itself
    integrate any cubic times EI exactly, so that G has two rows for each element whether it tapers or not, and K is
    that of the weak form to rounding. Where EI is constant they are the usual Gauss points. More of those would be
    exact too, as the degree of EI w''^2 is 6 (four points), with twice the rows for the same rank.

    Parameters
    ----------
    grid : Discretisation

    Returns
    -------
    csr_array (2 elements, dofs), sqrt(N m) per unit of a dof
    """
    nodes, sections = grid.mesh.nodes, grid.sections
    lengths = np.diff(nodes)
    places, shares = _gauss_points(sections.bending_polynomial)
    weight = np.sqrt(lengths[:, None] * sections.bending_stiffness[:, None] * shares)
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    points = middles[:, None] + lengths[:, None] * places / (2.0 * math.sqrt(3.0))
    curvature = hermite_rows(nodes, points.ravel(), derivative=2)
    # four entries in each row
    curvature.data *= np.repeat(weight.ravel(), 4)
    return curvature


def _gauss_points(polynomial: Array) -> tuple[Array, Array]:
    """Two Gauss points of half a polynomial (5, elements) in x = -1 to 1, and their weights, (elements, 2) each.

    It is the weight, positive and 1 at x = 0.

    The points are in 1/sqrt(3), so that those of a constant weight are -1 and 1 to the last bit. They are the
    eigenvalues of the Jacobi matrix of the first two orthogonal polynomials, and the weights are the squared first
    components of its eigenvectors times the integral of the weight (Golub and Welsch, 1969).
    """
    _, c1, c2, c3, c4 = polynomial
    m0, m1 = 1.0 + c2 / 3.0 + c4 / 5.0, c1 / 3.0 + c3 / 5.0
    m2, m3 = 1.0 / 3.0 + c2 / 5.0 + c4 / 7.0, c1 / 5.0 + c3 / 7.0
    first = m1 / m0
    variance = m2 / m0 - first**2
    second = (m3 - 2.0 * first * m2 + first**2 * m1) / (m0 * variance)
    half = 0.5 * (second - first)
    spread = np.sqrt(1.0 + 3.0 * (half**2 + (variance - 1.0 / 3.0)))
    middle, lean = math.sqrt(3.0) * 0.5 * (first + second), math.sqrt(3.0) * half / spread
    places = np.stack([middle - spread, middle + spread], axis=1)
    return places, 0.5 * m0[:, None] * np.stack([1.0 + lean, 1.0 - lean], axis=1)
