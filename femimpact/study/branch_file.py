"""A branch of periodic orbits read back from its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femimpact.errors import faults_of, require, require_path
from femimpact.orbits import Bifurcation, Branch
from femimpact.study.results import load_dataset, undamaged

PARTS = ("value", "peak", "first_harmonic", "multipliers_real", "multipliers_imag", "bifurcation")
"""Variables that `Branch.to_xarray` writes and a branch is made of."""

ATTRIBUTES = ("parameter", "place", "first_end", "last_end")
"""Its attributes."""


def load_branch(path: str | Path) -> Branch:
    """The branch that `branch.to_xarray().to_netcdf(path)` wrote.

    Its values, multipliers, peaks, ends and bifurcations are those of the branch that was followed. It lacks the system
    and the equations: `orbits`, `at`, the `orbit` of a bifurcation and `switch_branch` are refused.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Branch

    Raises
    ------
    InputError
        If the file is missing, damaged, or holds no branch.
    """
    require_path(path, "path", "a file")
    require(Path(path).exists(), "path", str(path), "", "is missing")
    with faults_of("path"):
        return undamaged(Path(path), _branch_in)


def _branch_in(path: Path) -> Branch:
    # `to_netcdf` of some versions writes another format
    data = load_dataset(path, engine=None)
    missing = [name for name in PARTS if name not in data.variables] + [a for a in ATTRIBUTES if a not in data.attrs]
    require(not missing, "branch", ", ".join(missing), "", "is missing")
    value, peak, first_harmonic, real, imag, kinds = (np.asarray(data[name]) for name in PARTS)
    require(value.size > 0 and kinds.shape == value.shape, "bifurcation", kinds.shape, "", "must be one of each value")
    points, (parameter, place, first, last) = np.flatnonzero(kinds != ""), (data.attrs[name] for name in ATTRIBUTES)
    return Branch(
        parameter=parameter,
        unit=data["value"].attrs["units"],
        values=value,
        multipliers=real + 1j * imag,
        peak=peak,
        first_harmonic=first_harmonic,
        end=(first, last),
        bifurcations=tuple(Bifurcation(str(kinds[i]), value[i]) for i in points),
        bifurcation_points=points,
        place=place,
    )
