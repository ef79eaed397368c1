"""Cubic Hermite shape functions on the unit interval: the one formula behind element and deflection."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import checked, quantity, real_array

__all__ = ["DERIVATIVE", "shape_functions"]

DERIVATIVE = quantity("1", at_least=0, at_most=3, integer=True)
"""Orders of derivative that a cubic has."""


def shape_functions(s: ArrayLike, derivative: int = 0) -> NDArray[Any]:
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
    derivative = checked("derivative", derivative, DERIVATIVE)
    zero = 0.0 * s
    rows = (
        (1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3, 3 * s**2 - 2 * s**3, s**3 - s**2),
        (6 * s**2 - 6 * s, 1 - 4 * s + 3 * s**2, 6 * s - 6 * s**2, 3 * s**2 - 2 * s),
        (12 * s - 6, 6 * s - 4, 6 - 12 * s, 6 * s - 2),
        (12 + zero, 6 + zero, -12 + zero, 6 + zero),
    )
    return np.stack(rows[derivative])
