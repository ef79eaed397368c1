"""The result of a convergence study over the number of normal modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, checked, column, quantity, require, require_type, text
from femimpact.table import column_units, frame_of, named_column

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["OTHERS", "STATISTICS", "ModeConvergence"]

Array = NDArray[np.float64]

STATISTICS = {
    "rms": "m",
    "peak": "m",
    "contact_loss": "J",
    "structure_loss": "J",
    "damping": "1",
    "mean_impulse": "N s",
}
"""Columns that scatter, and their units."""

OTHERS = {
    "peak_force": "N",
    "residual": "1",
    "first_displacement": "m",
    "first_loss": "J",
    "displacement_error": "1",
    "loss_error": "1",
}
"""Columns of one value without scatter."""


@dataclass(frozen=True, eq=False)
class ModeConvergence:
    """Response over the number of normal modes; columns are (n, 2): without and with static correction.

    `convergence["rms"]` reads a column.

    Parameters
    ----------
    counts : ndarray (n,)
        Normal modes; the correction adds one vector for every distinct contact direction.
    rms, peak : ndarray (n, 2), m
        Of the observed place, relative to the base; the peak is that of `SteadyMotion` over the run's last third.
    contact_loss, structure_loss : ndarray (n, 2), J
        Per base cycle.
    damping : ndarray (n, 2), 1
        Equivalent damping ratio D/(4 pi U): D all loss per cycle, U twice the mean strain energy, which is
        the largest strain energy of a sine.
    mean_impulse : ndarray (n, 2), N s
        Of one impact; not a number without impacts.
    scatter : mapping of str to ndarray (n, 2)
        Standard error of each of these from eight parts of the window; of `peak` the standard deviation of
        the parts' peaks. Differences below it mean nothing.
    peak_force : ndarray (n, 2), N
        Of a compliant law, as computed: it does not converge for short contacts. Not a number where a rigid pair
        collides.
    residual : ndarray (n, 2), 1
        Energy unaccounted for over the energy put in.
    first_displacement : ndarray (n, 2), m
        Of the observed place a quarter of the first natural period after one first impact.
    first_loss : ndarray (n, 2), J
        Lost in the contact until then.
    displacement_error, loss_error : ndarray (n, 2), 1
        Of these two, relative to the largest count with static correction.
    displacement_order, loss_order : ndarray (2,), 1
        Fitted exponent with which the error falls with the count; counts near the largest flatter it.
    at, law : str
    cycles : int
        In the window of the statistics.
    notes : tuple of str

    Raises
    ------
    InputError
        If a column is not of shape (n, 2), a count is not whole, or `scatter` names none of these columns.
    """

    counts: NDArray[np.int64] = field(metadata=column("1", "counts", of="whole number"))
    rms: Array = field(metadata=column("m", "counts", 2))
    peak: Array = field(metadata=column("m", "counts", 2))
    contact_loss: Array = field(metadata=column("J", "counts", 2))
    structure_loss: Array = field(metadata=column("J", "counts", 2))
    damping: Array = field(metadata=column("1", "counts", 2))
    mean_impulse: Array = field(metadata=column("N s", "counts", 2))
    scatter: Mapping[str, Array]
    peak_force: Array = field(metadata=column("N", "counts", 2))
    residual: Array = field(metadata=column("1", "counts", 2))
    first_displacement: Array = field(metadata=column("m", "counts", 2))
    first_loss: Array = field(metadata=column("J", "counts", 2))
    displacement_error: Array = field(metadata=column("1", "counts", 2))
    loss_error: Array = field(metadata=column("1", "counts", 2))
    displacement_order: Array = field(metadata=column("1", 2))
    loss_order: Array = field(metadata=column("1", 2))
    at: str = field(metadata=text())
    law: str = field(metadata=text())
    cycles: int = field(metadata=quantity("1", at_least=1, integer=True))
    notes: tuple[str, ...] = field(metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)
        require_type(self.scatter, Mapping, "scatter")
        for name, values in self.scatter.items():
            known = name in STATISTICS
            require(known, "scatter", name, "", f"must be of {', '.join(STATISTICS)}")
            checked(f"scatter.{name}", values, column(STATISTICS[name], self.counts.size, 2))

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    def to_pandas(self) -> pandas.DataFrame:
        """Two rows for every count, without and with static correction; units in `attrs["units"]`."""
        units = {name: unit for name, unit in column_units(self).items() if name != "counts"}
        columns: dict[str, Any] = {
            "modes": np.repeat(self.counts, 2),
            "static_correction": np.tile([False, True], self.counts.size),
        }
        columns |= {name: getattr(self, name).ravel() for name in units}
        columns |= {f"{name}_scatter": values.ravel() for name, values in self.scatter.items()}
        units |= {f"{name}_scatter": units[name] for name in self.scatter}
        return frame_of(columns, {"modes": "1", "static_correction": "", **units}, index="modes")

    def to_xarray(self) -> xarray.Dataset:
        """All columns as a labelled dataset over the count and the static correction."""
        import xarray

        dims = ("modes", "static_correction")
        data: dict[str, Any] = {}
        for name, unit in (STATISTICS | OTHERS).items():
            labels = {"units": unit, "long_name": name.replace("_", " ")}
            data[name] = (dims, np.array(getattr(self, name)), labels)
            if name in self.scatter:
                labels = {"units": unit, "long_name": f"scatter of {labels['long_name']}"}
                data[f"{name}_scatter"] = (dims, np.array(self.scatter[name]), labels)
        for name in ("displacement_order", "loss_order"):
            data[name] = (dims[1], np.array(getattr(self, name)), {"units": "1", "long_name": name.replace("_", " ")})
        coords = {"modes": np.array(self.counts), "static_correction": np.array([False, True])}
        attributes = {"at": self.at, "contact_law": self.law, "cycles": self.cycles, "notes": "; ".join(self.notes)}
        return xarray.Dataset(data, coords=coords, attrs=attributes)
