"""The results of a study as far as it is, from its directory, while it runs or after it was ended."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from femimpact.errors import require, require_path
from femimpact.parametric.block_files import blocks_of, read_manifest
from femimpact.parametric.labelled import Columns, dataset_of

if TYPE_CHECKING:
    import xarray

__all__ = ["load_parameter_study"]


def load_parameter_study(directory: str | Path) -> xarray.Dataset:
    """The dataset of a study from its finished blocks; what is not finished is not a number, and `finished` says so.

    Parameters
    ----------
    directory : str or Path
        That of `parameter_study`, which may be at work.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the directory holds no study, or a damaged one.
    """
    require_path(directory, "directory", "a directory")
    found = read_manifest(Path(directory))
    require(found is not None, "directory", str(directory), "", "must hold a parameter study")
    manifest = found or {}
    columns = Columns(manifest["table"])
    for block in blocks_of(Path(directory), manifest["key"], manifest["table"]):
        columns.add(block)
    return dataset_of(columns)
