"""The energy ledger of a run, relative to the moving base: what was put in, and where it went."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import check_fields, column, kind_of, require
from femimpact.table import Head, flat_columns, frame_of, head_of_columns, named_column, short_repr
from femimpact.units import number_text

if TYPE_CHECKING:
    import pandas


CLOSED = 1e-9
"""Residual that rounding leaves of a ledger in closed form, unless contacts are so stiff that it leaves more."""

BALANCED = 1e-2
"""Residual beyond which a stepped run is warned of, and an event-driven one has failed."""


def largest_input(
    stored: Array,  # (samples, ...) J
    work: Array,  # (samples, ...) J
) -> Array:  # (...) J
    """Initial energy plus the largest work put in, J: what residuals are shares of."""
    return np.asarray(stored[0] + np.max(np.abs(work - work[0]), axis=0))


def energy_residual(stored: Array, work: Array, dissipated: Array) -> Array:
    """Energy that appears from nowhere, over the initial energy plus the largest work put in.

    r(t) = [E(t) - E(0) - (W(t) - W(0)) + D(t) - D(0)] / (E(0) + max |W - W(0)|)

    Parameters
    ----------
    stored, work, dissipated : ndarray (samples, ...), J

    Returns
    -------
    ndarray (samples, ...), 1
        Positive where energy appears.
    """
    put_in = work - work[0]
    missing = (stored - stored[0]) - put_in + (dissipated - dissipated[0])
    scale = largest_input(stored, work)
    return np.asarray(missing / np.where(scale > 0.0, scale, 1.0))


def unbalanced(residual: float) -> str:
    """Words for a run in closed form whose ledger does not close at all."""
    return (
        f"energy residual {number_text(residual, 2)} of the energy put in (limit {BALANCED:g}) where a closed form "
        "leaves rounding "
        "only: the equations are too badly scaled for it; Newmark takes this system"
    )


def residual_warnings(
    frequency: Array,  # (cases,) Hz
    residual: Array,  # (cases,) not a number where energies are beyond all numbers, which is warned of too
    bound: Array,  # (cases,) not a number where a method keeps no ledger
) -> list[str]:
    """One warning for all runs of a sweep whose ledger is off by more than a bound."""
    off = np.flatnonzero(~(residual <= bound) & ~np.isnan(bound))
    if not off.size:
        return []
    worst = off[np.argmax(np.nan_to_num(residual[off], nan=np.inf))]
    return [
        f"energy residual above its bound at {off.size} of {frequency.size} frequencies ({frequency[off].min():.4g} to "
        f"{frequency[off].max():.4g} Hz), at most {number_text(residual[worst], 2)} of the energy put in (bound "
        f"{number_text(bound[worst], 2)}) at {frequency[worst]:.4g} Hz: the method or the contact law makes or loses "
        "energy that "
        "the ledger does not name"
    ]


@short_repr
@dataclass(frozen=True, eq=False)
class EnergyLedger:
    """Energies (J) over time, relative to the base; the inertia forces of the base do the work.

    `energy["kinetic"]` reads a column.

    Parameters
    ----------
    time : ndarray (samples,), s
    kinetic, strain : ndarray (samples,), J
        Of the beam and the bodies on it.
    ball : ndarray (samples,), J
        Kinetic energy of balls and absorbers.
    contact : ndarray (samples,), J
        Stored in contact and centring springs.
    work : ndarray (samples,), J
        Work of the base (inertia forces), of constant accelerations and forces, and of what holds stops in space
        (relative to the base they move), since t = 0.
    structure_loss : ndarray (samples,), J
        Dissipated by the structure's damping since t = 0.
    contact_loss : ndarray (samples,), J
        Integral of (F - k p) p', and of c x'^2 in the dashpots of absorbers and beside centring springs, since t = 0:
        summed directly, never a remainder.
    structure_loss_of_mode : ndarray (samples, modes), J
        The same as `structure_loss`, mode by mode; no columns for physical dofs.
    work_of : mapping of str to ndarray (samples,), J
        Under several drives at once the work of each by its name, and of constant forces where there are any: their sum
        is `work`. What holds stops in space belongs to the base.
    """

    time: Array = field(metadata=column("s", "samples"))
    kinetic: Array = field(metadata=column("J", "samples"))
    strain: Array = field(metadata=column("J", "samples"))
    ball: Array = field(metadata=column("J", "samples"))
    contact: Array = field(metadata=column("J", "samples"))
    work: Array = field(metadata=column("J", "samples"))
    structure_loss: Array = field(metadata=column("J", "samples"))
    contact_loss: Array = field(metadata=column("J", "samples"))
    structure_loss_of_mode: Array = field(metadata=column("J", "samples", "modes"))
    work_of: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be a mapping of arrays by the names of drives"
        require(isinstance(self.work_of, Mapping), "work_of", kind_of(self.work_of), "J", allowed)

    def __getitem__(self, name: str) -> Array:
        return named_column(self, name)

    @property
    def _head(self) -> Head:
        closed = f", residual {number_text(self.residual, 2)} of the energy put in" if self.time.size else ""
        return head_of_columns(f"EnergyLedger: {self.time.size} samples{closed}", *flat_columns(self))

    def to_pandas(self) -> pandas.DataFrame:
        """The energies over time, those of modes as structure_loss_of_mode_1, ..., the work of drives as work_of_NAME.

        Units in `attrs["units"]`.
        """
        columns, units = flat_columns(self)
        of_drives = {f"work_of_{name}": values for name, values in self.work_of.items()}
        return frame_of(columns | of_drives, units | dict.fromkeys(of_drives, "J"), index="time")

    @property
    def stored(self) -> Array:
        """Sum of kinetic, strain, ball and contact energy, J."""
        return np.asarray(self.kinetic + self.strain + self.ball + self.contact)

    @property
    def residual_history(self) -> Array:
        """Signed residual of the energy balance over time, over the energy put in; see `energy_residual`."""
        return energy_residual(self.stored, self.work, self.structure_loss + self.contact_loss)

    @property
    def largest_input(self) -> float:
        """Initial energy plus the largest work put in, J."""
        return float(largest_input(self.stored, self.work))

    @property
    def residual(self) -> float:
        """Largest |residual| over the samples: energy unaccounted for, over the energy put in."""
        return float(np.max(np.abs(self.residual_history)))
