"""Whether the misfits of a fitted curve are random over frequency, by what independent noise shows after the same fit.

A fit takes from noise what its parameters can follow, and a search over many shapes finds one that suits any noise.
Both are counted here: the same numbers are read of simulated noise, less what the fit takes of it (a Monte Carlo
test: Hope, 1968).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["pattern_in"]

Array = NDArray[np.float64]

LEVEL = 0.005
"""Share of curves of one pole and noise in which each of two patterns is seen."""

DRAWS = 1999
"""Simulated curves of noise."""

SEED = 20240607
"""Of the simulated noise: the same misfits are judged alike in every call."""

BLOCK = 2_000_000
"""Numbers that are drawn at a time."""

INDEPENDENT = 1e-8
"""Share of a shape beyond what the fit follows below which it is rounding."""


def pattern_in(misfit: Array, tangents: Array, shapes: Mapping[str, Array]) -> str:
    """What is seen in the misfits of a least-squares fit that noise seldom shows, in words; nothing otherwise.

    Seldom is in 1 of 200 curves or fewer with independent noise of one size at all points, for each of

    - the correlation of neighbours, sum r_i r_(i+1) / sum r_i^2, which smooth misfits make large;
    - the largest share of sum r_i^2 that one of the shapes takes away.

    Parameters
    ----------
    misfit : ndarray (n,)
        By rising frequency.
    tangents : ndarray (n, parameters)
        Jacobian of the fit.
    shapes : mapping of str to ndarray (n, k)
        What a further term of the model, by its name, adds per unit of each of its k parameters.

    Returns
    -------
    str
    """
    own, _ = np.linalg.qr(tangents)
    bases = [_beyond(own, shape) for shape in shapes.values()]
    correlation, share, which = (float(x[0]) for x in _read(misfit[:, None] - own @ (own.T @ misfit[:, None]), bases))
    random, counts = np.random.default_rng(SEED), np.zeros(2)
    block = max(1, BLOCK // misfit.size)
    for first in range(0, DRAWS, block):
        noise = random.standard_normal((misfit.size, min(block, DRAWS - first)))
        alike, taken, _ = _read(noise - own @ (own.T @ noise), bases)
        counts += np.sum(alike >= correlation), np.sum(taken >= share)
    seldom = (1.0 + counts) / (1.0 + DRAWS) <= LEVEL
    found = []
    if seldom[0]:
        found.append(f"neighbouring misfits are alike (correlation {correlation:.2f})")
    if seldom[1]:
        found.append(f"{list(shapes)[int(which)]} beside the first would take {100.0 * share:.0f} % of their square")
    return " and ".join(found)


def _beyond(own: Array, shape: Array) -> Array:
    """Orthonormal columns (n, k or fewer) of what a shape has beyond the fit's own tangents."""
    left = shape - own @ (own.T @ shape)
    columns, size, _ = np.linalg.svd(left, full_matrices=False)
    return np.asarray(columns[:, size > INDEPENDENT * np.linalg.norm(shape)])


def _read(misfit: Array, bases: Sequence[Array]) -> tuple[Array, Array, NDArray[np.intp]]:
    """Correlation of neighbours, the largest share that a shape takes, and which one, of each column of misfits."""
    size = np.sum(misfit**2, axis=0)
    alike = np.sum(misfit[1:] * misfit[:-1], axis=0) / size
    taken = [np.sum((basis.T @ misfit) ** 2, axis=0) for basis in bases]
    return alike, np.max(taken, axis=0) / size, np.argmax(taken, axis=0)
