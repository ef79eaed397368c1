"""Cubic Hermite shape functions, the one formula behind element and deflection, and the rows that read a deflection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import checked, choice, quantity, real_array, require
from femimpact.system.matrices import Matrix

__all__ = ["DERIVATIVE", "element_of", "hermite_rows", "place_in_element", "positions_on_beam", "shape_functions"]

Array = NDArray[np.float64]

OFF_BEAM = 1e-6
"""Share of the length by which a position in single precision may lie off the beam."""


AT_NODE = 1e-9
"""Share of the length within which a position is at a node."""

SIDE = choice("left", "right")
"""Which of the two elements at a node: towards the root, or towards the tip."""

DERIVATIVE = quantity("1", at_least=0, at_most=3, integer=True)
"""Orders of derivative that a cubic has."""


def shape_functions(s: ArrayLike, derivative: int = 0) -> Array:
    """Cubic Hermite shape functions of (w1, h w1', w2, h w2') or a derivative of them by s.

    w(s) = H1 w1 + H2 h w1' + H3 w2 + H4 h w2', with s = (x - x1)/h.

    Parameters
    ----------
    s : array_like, shape (...), 1
        Position inside the element, 0 at its first node and 1 at its second.
    derivative : int
        Order of the derivative by s, 0 to 3.

    Returns
    -------
    ndarray, shape (4, ...), 1
        Values; multiply rows 1 and 3 by the element length for dofs (w, dw/dx),
        and divide all by its `derivative`-th power for derivatives by x.
    """
    s = real_array("s", s, "1", "must be finite numbers")
    return np.array(_SHAPES[checked("derivative", derivative, DERIVATIVE)](s))


_SHAPES: tuple[Callable[[Array], tuple[Array, ...]], ...] = (
    lambda s: (1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3, 3 * s**2 - 2 * s**3, s**3 - s**2),
    lambda s: (6 * s**2 - 6 * s, 1 - 4 * s + 3 * s**2, 6 * s - 6 * s**2, 3 * s**2 - 2 * s),
    lambda s: (12 * s - 6, 6 * s - 4, 6 - 12 * s, 6 * s - 2),
    lambda s: (12 + 0.0 * s, 6 + 0.0 * s, -12 + 0.0 * s, 6 + 0.0 * s),
)
"""The functions and their derivatives by s, by the order of the derivative."""


def positions_on_beam(nodes: Array, positions: ArrayLike, key: str) -> Array:
    """Positions (m) on the beam, those off it by rounding only moved to its end."""
    root, tip = float(nodes[0]), float(nodes[-1])
    allowed = f"must be within the beam, {root:g} to {tip:g} m"
    x = real_array(key, positions, "m", allowed)
    slack = OFF_BEAM * (tip - root)
    beyond = x[(x < root - slack) | (x > tip + slack)]
    require(beyond.size == 0, key, float(beyond[0]) if beyond.size else None, "m", allowed)
    return np.minimum(np.maximum(x, root), tip)


def element_of(nodes: Array, positions: Array, side: str) -> NDArray[np.intp]:
    """Numbers of the elements that hold positions (k,) in m; at a node, to 1e-9 of the length, the one on a side."""
    shift = (1.0 if checked("side", side, SIDE) == "right" else -1.0) * AT_NODE * (nodes[-1] - nodes[0])
    element = np.searchsorted(nodes, positions + shift, side="right") - 1
    return np.asarray(np.minimum(np.maximum(element, 0), nodes.size - 2))


def place_in_element(nodes: Array, positions: Array, side: str) -> tuple[NDArray[np.intp], Array]:
    """Elements that hold positions (k,) in m, as `element_of`, and places from 0 to 1 inside them."""
    element = element_of(nodes, positions, side)
    s = (positions - nodes[element]) / (nodes[element + 1] - nodes[element])
    return element, np.asarray(np.clip(s, 0.0, 1.0))


def hermite_rows(nodes: Array, positions: ArrayLike, derivative: int = 0, side: str = "right") -> Matrix:
    """Sparse rows from nodal (w, w') pairs to the deflection, or a derivative of it, at positions.

    Parameters
    ----------
    nodes : ndarray (n,), m
    positions : array_like (k,), m
    derivative : int
    side : {"left", "right"}
        Which element is read at a node, where curvature and its slope jump.

    Returns
    -------
    csr_array (k, 2 n)

    Raises
    ------
    InputError
        If a position lies off the nodes, or a cubic has no such derivative.
    """
    x = np.atleast_1d(positions_on_beam(nodes, positions, "positions"))
    require(x.ndim == 1, "positions", f"array of shape {x.shape}", "m", "must be one place or a row of them")
    derivative = checked("derivative", derivative, DERIVATIVE)
    element = element_of(nodes, x, side)
    length = nodes[element + 1] - nodes[element]
    values = np.array(_SHAPES[derivative]((x - nodes[element]) / length)) / length**derivative
    values[[1, 3]] *= length
    column = (2 * element[:, None] + np.arange(4)).ravel()
    first = np.arange(0, column.size + 1, 4)
    return sparse.csr_array((values.T.ravel(), column, first), shape=(x.size, 2 * nodes.size))
