"""Branches of periodic orbits in a file, and read back from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femimpact.app.results.results import undamaged
from femimpact.arrays import Array
from femimpact.errors import faults_of, quantity, require, require_path, takes
from femimpact.files import load_netcdf
from femimpact.orbits.branch import Bifurcation, Branch
from femimpact.orbits.parameter import NUMBERS

if TYPE_CHECKING:
    import xarray

PARTS = ("value", "peak", "first_harmonic", "multipliers_real", "multipliers_imag", "bifurcation", "is_stable")
"""Variables that `Branch.to_xarray` writes and a branch is made of."""

ATTRIBUTES = ("parameter", "place")
"""Its attributes; in a file of several branches they are those of all."""

UNITS = {
    "frequency": ("Hz",), "amplitude": ("m", "N"), "factor": ("1",), "gap": ("m",), "mass": ("kg",),
    **{name: (str(number.metadata["unit"]),) for name, number in NUMBERS.items()},
}  # fmt: skip
"""Units that a parameter may have, by the last word of its path."""

ROUNDING = 1e-9
"""Relative difference of two moduli that may be in either order."""

ENDS = ("first_end", "last_end")
"""Attributes of one branch; in a file of several they are variables."""


@takes(number=quantity("1", at_least=1, integer=True))
def load_branch(path: str | Path, *, number: int = 1) -> Branch:
    """The branch that `branch.to_xarray().to_netcdf(path)` wrote, or one of those that `femimpact orbits` wrote.

    Its values, multipliers, peaks, ends and bifurcations are those of the branch that was followed. It lacks the system
    and the equations: `orbits`, `at`, the `orbit` of a bifurcation and `switch_branch` are refused.

    Parameters
    ----------
    path : str or Path
    number : int
        Of the branch in a file of several, as in its tables.

    Raises
    ------
    InputError
        If the file is missing, damaged, or holds no branch of this number.

    Examples
    --------
    >>> import femimpact as fi
    >>> branch = fi.app.load_branch("study-orbits/branches.nc", number=2)  # doctest: +SKIP
    >>> branch.bifurcations[0].value  # doctest: +SKIP
    """
    require_path(path, "path", "a file")
    require(Path(path).exists(), "path", str(path), "", "is missing")
    with faults_of("path"):
        # `to_netcdf` of some versions writes another format
        branches = undamaged(Path(path), lambda file: branches_of(load_netcdf(file, None)))
    require(number <= len(branches), "number", number, "", f"must be <= {len(branches)}: the file has no more branches")
    return branches[number - 1]


@dataclass(frozen=True, eq=False)
class FollowedBranches:
    """Branches of periodic orbits of a study, by their numbers from 1."""

    modes: int  # that the system keeps
    branches: list[Branch] = field(default_factory=list)
    origins: list[str] = field(default_factory=list)  # from which orbit each was followed
    cycles: list[int] = field(default_factory=list)  # periods of the excitation in one of the orbits of each
    swept: tuple[Array, Array] | None = None  # values of the parameter and largest displacements (m) of a sweep


def dataset_of(followed: FollowedBranches) -> xarray.Dataset:
    """Points of the branches one after the other: `number` is that of the branch of each."""
    import xarray

    branches = followed.branches
    numbers = np.arange(1, len(branches) + 1)
    parts = [branch.to_xarray() for branch in branches]
    data = xarray.concat(parts, "point", combine_attrs="override").drop_attrs(deep=False)
    data = data.assign_coords(branch=numbers, number=("point", np.repeat(numbers, list(map(len, branches)))))
    data = data.assign_attrs({name: parts[0].attrs[name] for name in ATTRIBUTES} | {"modes": followed.modes})
    data = data.assign({name: ("branch", [part.attrs[name] for part in parts]) for name in ENDS})
    data = data.assign(origin=("branch", followed.origins), cycles=("branch", followed.cycles))
    if followed.swept is None:
        return data
    value, peak = followed.swept
    return data.assign_coords(swept=("swept", value, dict(data["value"].attrs))).assign(
        swept_peak=("swept", peak, {"units": "m", "long_name": "peak of a stepped sweep"})
    )


def followed_in(data: xarray.Dataset) -> FollowedBranches:
    """The branches of a file of several."""
    swept = (np.asarray(data["swept"]), np.asarray(data["swept_peak"])) if "swept" in data.coords else None
    origins, cycles = (np.asarray(data[name]).tolist() for name in ("origin", "cycles"))
    return FollowedBranches(int(data.attrs["modes"]), branches_of(data), origins, cycles, swept)


def branches_of(data: xarray.Dataset) -> list[Branch]:
    """The branches of a dataset, of one branch or of several.

    Raises `InputError` if it lacks a part of them, or a part is none of a branch.
    """
    several = "number" in data.variables
    missing = [name for name in PARTS if name not in data.variables] + [a for a in ATTRIBUTES if a not in data.attrs]
    missing += [name for name in ENDS if name not in (data.variables if several else data.attrs)]
    require(not missing, "branch", ", ".join(missing), "", "is missing")
    if not several:
        return [_branch_in(data, data.attrs["first_end"], data.attrs["last_end"])]
    first, last = (np.asarray(data[name]).tolist() for name in ENDS)
    numbers = np.asarray(data["number"])
    given, allowed = sorted(set(numbers.tolist())), f"must be 1 to {len(first)}, for as many branches have ends"
    require(given == list(range(1, len(first) + 1)), "number", given, "", allowed)
    return [_branch_in(data.isel(point=numbers == i), *ends) for i, ends in enumerate(zip(first, last, strict=True), 1)]


def _branch_in(data: xarray.Dataset, first_end: str, last_end: str) -> Branch:
    value, peak, first_harmonic, real, imag, kinds, stable = (np.asarray(data[name]) for name in PARTS)
    require(value.size > 0 and kinds.shape == value.shape, "bifurcation", kinds.shape, "", "must be one of each value")
    points, (parameter, place) = np.flatnonzero(kinds != ""), (data.attrs[name] for name in ATTRIBUTES)
    known = {"value": UNITS.get(parameter.rpartition(".")[2]), "peak": ("m",), "first_harmonic": ("m",)}
    for name, units in known.items():
        given = data[name].attrs.get("units")
        allowed = f"must be {' or '.join(units)}" if units else "must be the unit of the parameter"
        require(given in units if units else bool(given), f"units of {name}", given or "none", "", allowed)
    for name, sizes in (("peak", peak), ("first_harmonic", first_harmonic)):
        sound = bool(np.all(np.isfinite(sizes) & (sizes >= 0.0)))
        require(sound, name, sizes, "m", "must be finite numbers >= 0")
    multipliers = real.astype(complex)
    multipliers.imag = imag
    branch = Branch(
        parameter=parameter,
        unit=data["value"].attrs["units"],
        values=value,
        multipliers=multipliers,
        peak=peak,
        first_harmonic=first_harmonic,
        end=(first_end, last_end),
        bifurcations=tuple(Bifurcation(str(kinds[i]), value[i]) for i in points),
        bifurcation_points=points,
        place=place,
    )
    # at an impact without speed they are no numbers to use
    size = np.abs(multipliers[~np.isin(kinds, ("grazing", "sticking"))])
    falls = size.shape[-1] > 0 and bool(np.all(size[:, 1:] <= (1.0 + ROUNDING) * size[:, :-1]))
    require(falls, "multipliers", multipliers, "1", "must be one or more of each orbit, the largest first")
    same = np.array_equal(stable, branch.is_stable)
    require(same, "is_stable", stable, "", "must be what the multipliers say")
    return branch
