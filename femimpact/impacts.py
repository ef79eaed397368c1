"""The record of impacts: what each one was, and what they add up to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray

__all__ = ["IMPACT_UNITS", "RIDING_UNITS", "ImpactStatistics", "Impacts", "Riding", "impact_statistics"]

SHOWN = 8
"""Rows of a table that its repr shows."""

IMPACT_UNITS = {
    "time": "s",
    "phase": "rad",
    "impactor": "",
    "side": "1",
    "approach_speed": "m/s",
    "rebound_speed": "m/s",
    "impulse": "N s",
    "peak_force": "N",
    "duration": "s",
    "energy_loss": "J",
    "energy_to_higher_modes": "J",
}
"""Columns of the impact table and their units, in their order."""

RIDING_UNITS = {"impactor": "", "side": "1", "start": "s", "end": "s", "impulse": "N s", "mean_force": "N"}
"""Columns of the table of riding states and their units."""


@dataclass(frozen=True, eq=False, repr=False)
class Impacts:
    """Table of the finished impacts of a run, one entry each, in the order in which they ended.

    Parameters
    ----------
    time : ndarray (n,), s
        Instant of touch.
    phase : ndarray (n,), rad
        Of the excitation at that instant, 0 to 2 pi.
    impactor : ndarray (n,) of str
    side : ndarray (n,), 1
        +1 or -1: which wall.
    approach_speed, rebound_speed : ndarray (n,), m/s
        Relative speed at touch and at separation, both positive.
    impulse : ndarray (n,), N s
    peak_force : ndarray (n,), N
        Under the law named in `law`; not a number for a rigid contact.
    duration : ndarray (n,), s
        Time under force.
    energy_loss : ndarray (n,), J
        Dissipated in the contact.
    energy_to_modes : ndarray (n, modes), J
        Work of the contact force on each mode of a reduced system; no columns for physical dofs.
    law : mapping of str to str
        Contact law of each impactor.
    dropped : int
        Impacts that met a full table and were counted only.
    """

    time: NDArray[Any]
    phase: NDArray[Any]
    impactor: NDArray[Any]
    side: NDArray[Any]
    approach_speed: NDArray[Any]
    rebound_speed: NDArray[Any]
    impulse: NDArray[Any]
    peak_force: NDArray[Any]
    duration: NDArray[Any]
    energy_loss: NDArray[Any]
    energy_to_modes: NDArray[Any]
    law: Mapping[str, str]
    dropped: int = 0

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        names = [name for name in IMPACT_UNITS if name not in ("phase", "duration")]
        lines = [f"Impacts: {len(self)}" + (f" ({self.dropped} more not kept)" if self.dropped else "")]
        lines.append("  ".join(f"{name:>22}" for name in names))
        for i in range(min(len(self), SHOWN)):
            cells = (getattr(self, name)[i] for name in names)
            lines.append("  ".join(f"{cell:>22}" if isinstance(cell, str) else f"{cell:>22.6g}" for cell in cells))
        return "\n".join([*lines, "..."] if len(self) > SHOWN else lines)

    @property
    def energy_to_higher_modes(self) -> NDArray[Any]:
        """Energy (J) that each impact scatters to the modes above the first; negative where it takes some."""
        return np.asarray(self.energy_to_modes[:, 1:].sum(axis=1))

    @property
    def mode_share(self) -> NDArray[Any]:
        """Share (n, modes) of each mode in the energy that an impact moves: |E_k| over the sum of all |E|."""
        size = np.abs(self.energy_to_modes)
        total = size.sum(axis=1, keepdims=True)
        return np.asarray(np.divide(size, total, out=np.zeros_like(size), where=total > 0.0))

    @property
    def restitution(self) -> NDArray[Any]:
        """Rebound over approach speed of each impact, 1 (the structure's own motion included)."""
        return np.asarray(self.rebound_speed / self.approach_speed)

    def to_xarray(self) -> xarray.Dataset:
        """The table as a labelled dataset over impacts and modes."""
        import xarray

        data: dict[str, Any] = {
            name: ("impact", np.array(getattr(self, name)), {"units": unit, "long_name": name.replace("_", " ")})
            for name, unit in IMPACT_UNITS.items()
        }
        data["energy_to_modes"] = (("impact", "mode"), np.array(self.energy_to_modes), {"units": "J"})
        data["mode_share"] = (("impact", "mode"), self.mode_share, {"units": "1"})
        laws = "; ".join(f"{name}: {law}" for name, law in self.law.items())
        modes = ("mode", np.arange(1, self.energy_to_modes.shape[1] + 1))
        return xarray.Dataset(data, coords={"mode": modes}, attrs={"contact_law": laws, "dropped": self.dropped})


@dataclass(frozen=True, eq=False)
class Riding:
    """Table of riding states: a ball and its wall, or the beam and a stop, moving together.

    Parameters
    ----------
    impactor : ndarray (n,) of str
    side : ndarray (n,), 1
        +1 or -1: which wall.
    start, end : ndarray (n,), s
        From the end of the accumulation of impacts to the change of sign of the contact force; the
        end is not a number for a state that lasts.
    impulse : ndarray (n,), N s
        Integral of the contact force; positive towards + where the wall pushes the structure so.
    mean_force : ndarray (n,), N
    """

    impactor: NDArray[Any]
    side: NDArray[Any]
    start: NDArray[Any]
    end: NDArray[Any]
    impulse: NDArray[Any]
    mean_force: NDArray[Any]

    def __len__(self) -> int:
        return int(self.start.size)

    @classmethod
    def none(cls) -> Riding:
        """No riding state."""
        nothing = np.zeros(0)
        return cls(np.zeros(0, dtype=str), nothing, nothing, nothing, nothing, nothing)


@dataclass(frozen=True)
class ImpactStatistics:
    """What the contacts of a time window add up to.

    Parameters
    ----------
    count : int
        Impacts that ended in the window.
    impacts_per_cycle : float, 1
    mean_approach_speed, largest_approach_speed : float, m/s
    mean_impulse : float, N s
    peak_force : float, N
        Of every contact in the window, also one that has not ended.
    law : str
        The contact law behind the peak force.
    cycle_mean_force : float, N
        Integral of the normal force over the window's length, a ball that rides on its wall included.
    """

    count: int
    impacts_per_cycle: float
    mean_approach_speed: float
    largest_approach_speed: float
    mean_impulse: float
    peak_force: float
    law: str
    cycle_mean_force: float


def impact_statistics(totals: NDArray[Any], duration: float, frequency: float, law: str) -> ImpactStatistics:
    """Statistics from the sums that the time loop keeps over a window.

    Parameters
    ----------
    totals : ndarray (6, balls)
        Impacts, sum and largest of the approach speed (m/s), sum of the impulse (N s), largest
        force (N), integral of the force (N s); see `integrators.layout.TOTAL_COLUMNS`.
    duration : float, s
        Of the window.
    frequency : float, Hz
        Of the base, to count per cycle.
    law : str

    Returns
    -------
    ImpactStatistics
        Over all balls given; means over no impact are 0.
    """
    count = int(totals[0].sum())
    each = 1.0 / max(count, 1)
    return ImpactStatistics(
        count=count,
        impacts_per_cycle=count / (duration * frequency),
        mean_approach_speed=float(totals[1].sum()) * each,
        largest_approach_speed=float(totals[2].max(initial=0.0)),
        mean_impulse=float(totals[3].sum()) * each,
        peak_force=float(totals[4].max(initial=0.0)),
        law=law,
        cycle_mean_force=float(totals[5].sum()) / duration,
    )
