"""The warning of a motion that is larger than linear beam theory holds for."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["LARGE", "deflection_warnings"]

LARGE = 0.1
"""Largest deflection over the length of the beam that is not warned of: a cantilever's is exact to 1 % there."""


def deflection_warnings(deflection: ArrayLike, length: float) -> tuple[str, ...]:
    """A warning where the beam deflects by more than a tenth of its length.

    What linear theory neglects goes as (w/L)^2. Of a cantilever under a transverse end load P the exact elastica,
    EI theta'' = -P cos(theta), has w/L = a/3 (1 - 4/35 a^2 + ...) with a = P L^2/(EI): the linear deflection w is too
    large by 36/35 (w/L)^2 of itself, 1.0 % at w/L = 0.1 and 4.3 % at 0.2. The tip moves towards the root by
    3/5 (w/L)^2 of the length.

    Parameters
    ----------
    deflection : array_like, m
        Largest absolute values, of places or of runs; what is not a number does not count.
    length : float, m
        0 for a structure without a beam, which has no warning.

    Returns
    -------
    tuple of str
    """
    largest = float(np.fmax.reduce(np.ravel(deflection), initial=0.0))
    if not 0.0 < LARGE * length < largest:
        return ()
    share = largest / length
    return (
        f"the beam deflects by up to {largest:.4g} m, {share:.3g} of its length, beyond {LARGE:g}: linear beam theory "
        f"neglects terms of the size of the square of that share, {100.0 * share * share:.2g} %",
    )
