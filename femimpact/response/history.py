"""Histories: what was kept over time, whole or in the pieces in which a run hands it over."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, checked, column, having, instance, optional, require, require_type
from femimpact.excitation import Excitation
from femimpact.excitation.excitation import MEMBERS, has_cycle
from femimpact.response.energy import EnergyLedger

if TYPE_CHECKING:
    import xarray

__all__ = ["HistoryPiece", "Snapshots", "Stream", "check_histories", "deciding_rows", "history_dataset"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Snapshots:
    """Whole deflections, relative to the base.

    Parameters
    ----------
    time : ndarray (snapshots,), s
    displacement, velocity : ndarray (snapshots, 2 nodes), m and 1; m/s and 1/s
        (w1, w1', w2, w2', ...) at the nodes.
    ball_displacement, ball_velocity : ndarray (snapshots, balls), m and m/s
    contact_force : ndarray (snapshots, pairs), N
        On the beam, balls first, then stops.

    Raises
    ------
    InputError
        If an array does not have one row for each snapshot, or a time is not finite.
    """

    time: Array = field(metadata=column("s", "snapshots", finite=True))
    displacement: Array = field(metadata=column("m", "snapshots", "nodal values"))
    velocity: Array = field(metadata=column("m/s", "snapshots", "nodal values"))
    ball_displacement: Array = field(metadata=column("m", "snapshots", "balls"))
    ball_velocity: Array = field(metadata=column("m/s", "snapshots", "balls"))
    contact_force: Array = field(metadata=column("N", "snapshots", "pairs"))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, eq=False)
class HistoryPiece:
    """A stretch of a history, as a run passes it to `Recorder.sink`; its arrays are read-only and its own.

    Parameters
    ----------
    time : ndarray (samples,), s
        At most `Recorder.piece_samples`, or one base cycle of an event-driven run, next to those of
        the piece before; none where only snapshots were due.
    channels : mapping of str to ndarray (samples,)
        As `Response.channels` has them.
    units : mapping of str to str
    energy : EnergyLedger or None
        Of these samples; work and losses since the start of the run.
    snapshots : Snapshots or None
        Those due between the same steps.
    base : Excitation

    Raises
    ------
    InputError
        If a channel or the ledger does not have the samples of `time`, or a channel has no unit.
    """

    time: Array = field(metadata=column("s", "samples", finite=True))
    channels: Mapping[str, Array]
    units: Mapping[str, str]
    energy: EnergyLedger | None = field(metadata=optional(instance(EnergyLedger)))
    snapshots: Snapshots | None = field(metadata=optional(instance(Snapshots)))
    base: Excitation = field(metadata=having("an excitation", MEMBERS))

    def __post_init__(self) -> None:
        check_fields(self)
        check_histories(self)

    def to_xarray(self) -> xarray.Dataset:
        """Channels, energies and the base's motion as a labelled dataset over time."""
        return history_dataset(self.time, self.channels, self.units, self.energy, self.base)


def check_histories(kept: Any) -> None:
    """Refuse channels of a history that are not as long as its time, or whose unit is not named.

    A history that went to a sink has units only, and a ledger of few samples.
    """
    for key in ("channels", "units"):
        require_type(getattr(kept, key), Mapping, key)
    for name, values in kept.channels.items():
        series = checked(f"channels.{name}", values, column(str(kept.units.get(name, "")), "samples"))
        fits = series.shape == kept.time.shape
        require(
            fits, f"channels.{name}", f"{series.size} samples", "", f"must have {kept.time.size} samples, as time has"
        )
        require(name in kept.units, "units", sorted(kept.units), "", f"must name the unit of {name!r}")
    for name, unit in kept.units.items():
        require_type(unit, str, f"units.{name}")
    if kept.channels:
        same = set(kept.units) == set(kept.channels)
        require(same, "units", sorted(kept.units), "", f"must be of the channels, {sorted(kept.channels)}")
        same = kept.energy is None or np.array_equal(kept.energy.time, kept.time)
        require(same, "energy", None, "", "must be at the times of the channels")


def history_dataset(
    time: Array,
    channels: Mapping[str, Array],
    units: Mapping[str, str],
    energy: EnergyLedger | None,
    base: Excitation,
) -> xarray.Dataset:
    """Channels, energies and the base's motion over time as a labelled dataset, units in the attributes."""
    import xarray

    def variable(values: Array, unit: str, name: str) -> tuple[Any, ...]:
        return ("time", np.array(values), {"units": unit, "long_name": name})

    data = {
        name: variable(values, units[name], f"{name}, relative to the base" if units[name] != "N" else name)
        for name, values in channels.items()
    }
    data["base"] = variable(base.displacement(time), "m", "base displacement")
    if energy is not None:
        for name in ("kinetic", "strain", "ball", "contact", "work", "structure_loss", "contact_loss"):
            data[f"energy_{name}"] = variable(getattr(energy, name), "J", f"energy: {name.replace('_', ' ')}")
    attributes = {"base_amplitude_m": base.amplitude}
    if has_cycle(base):
        attributes["base_frequency_Hz"] = base.frequency
    coordinate = ("time", np.array(time), {"units": "s", "long_name": "time"})
    return xarray.Dataset(data, coords={"time": coordinate}, attrs=attributes)


def deciding_rows(before: EnergyLedger | None, piece: EnergyLedger) -> EnergyLedger:
    """The few rows of a ledger in pieces that give its residual: first, largest imbalance, largest work, last.

    Parameters
    ----------
    before : EnergyLedger or None
        Those of all the pieces before.
    piece : EnergyLedger
        With one sample or more.

    Returns
    -------
    EnergyLedger
        At most 4 samples; its residual is the one of all samples so far, to the last bit.
    """
    first = piece if before is None else before
    rows = _take(piece, _extremes(piece, first))
    if before is None:
        return rows
    columns = [item.name for item in dataclasses.fields(EnergyLedger)]
    joined = EnergyLedger(**{name: np.concatenate([getattr(before, name), getattr(rows, name)]) for name in columns})
    return _take(joined, _extremes(joined, first))


def _extremes(ledger: EnergyLedger, first: EnergyLedger) -> list[int]:
    """Rows of the first and last sample, of the largest imbalance and of the largest work since the first of all."""
    put_in = ledger.work - first.work[0]
    lost, lost_at_first = (of.structure_loss + of.contact_loss for of in (ledger, first))
    # unscaled: the scale of the residual is known only at the end, and rounding must not pick another row
    missing = (ledger.stored - first.stored[0]) - put_in + (lost - lost_at_first[0])
    return sorted({0, int(np.argmax(np.abs(missing))), int(np.argmax(np.abs(put_in))), ledger.time.size - 1})


def _take(ledger: EnergyLedger, rows: list[int]) -> EnergyLedger:
    columns = {item.name: getattr(ledger, item.name)[rows] for item in dataclasses.fields(EnergyLedger)}
    for values in columns.values():
        values.setflags(write=False)
    return EnergyLedger(**columns)


@dataclass(eq=False)
class Stream:
    """Where the history of a run goes: piece by piece to a sink, or as a whole to the response.

    Parameters
    ----------
    read : callable
        What the run holds now, given how many samples and snapshots were taken from it before.
    clear : callable
        Empties the run of that.
    sink : callable or None
        As of `Recorder`.
    """

    read: Callable[[int, int], HistoryPiece]
    clear: Callable[[], None]
    sink: Callable[[HistoryPiece], None] | None
    samples: int = 0
    snapshots: int = 0
    deciding: EnergyLedger | None = None
    streamed_to: float | None = None

    def hand_over(self) -> None:
        """Give the sink, if there is one, what has come together in the run, and free the arrays there."""
        if self.sink is None:
            return
        found = self.read(self.samples, self.snapshots)
        shown = 0 if found.snapshots is None else found.snapshots.time.size
        self.samples, self.snapshots = self.samples + found.time.size, self.snapshots + shown
        self.clear()
        if found.time.size + shown == 0:
            return
        if found.time.size:
            self.streamed_to = float(found.time[-1])
            self.deciding = None if found.energy is None else deciding_rows(self.deciding, found.energy)
        self.sink(found)

    def left(self) -> HistoryPiece:
        """What the response gets: all of it, or, behind a sink, units and the rows that decide the residual."""
        found = self.read(self.samples, self.snapshots)
        if self.sink is None:
            return found
        return dataclasses.replace(found, channels={}, energy=self.deciding, snapshots=None)
