"""Histories: what was kept over time, in one piece or several, or once per base cycle."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Integers, thinned
from femimpact.errors import (
    changed,
    check_fields,
    checked,
    column,
    having,
    instance,
    made,
    optional,
    quantity,
    real_array,
    require,
    require_name,
    require_type,
)
from femimpact.excitation.excitation import MEMBERS, Excitation, has_cycle
from femimpact.response.channels import channel_key
from femimpact.response.energy import EnergyLedger
from femimpact.structure.structure import Position
from femimpact.system.system import System
from femimpact.table import Head, head_of_columns, short_repr

if TYPE_CHECKING:
    import xarray

FRAMES_OF_PERIOD = 12
"""Frames of a period below which its motion is not seen."""


@dataclass(frozen=True, eq=False)
class Snapshots:
    """Deflections of the entire beam, relative to the base.

    Raises `InputError` if an array does not have one row for each snapshot, or a time is not finite.
    """

    time: Array = field(metadata=column("s", "snapshots", finite=True))  # (snapshots,) s
    # (snapshots, 2 nodes) m and 1; m/s and 1/s: (w1, w1', w2, w2', ...) at the nodes
    displacement: Array = field(metadata=column("m", "snapshots", "nodal values"))
    # (snapshots, 2 nodes) m and 1; m/s and 1/s
    velocity: Array = field(metadata=column("m/s", "snapshots", "nodal values"))
    ball_displacement: Array = field(metadata=column("m", "snapshots", "balls"))  # (snapshots, balls) m and m/s
    ball_velocity: Array = field(metadata=column("m/s", "snapshots", "balls"))  # (snapshots, balls) m and m/s
    # (snapshots, pairs) N: on the beam, balls first, then stops
    contact_force: Array = field(metadata=column("N", "snapshots", "pairs"))

    def __post_init__(self) -> None:
        check_fields(self)


def shown_snapshots(snapshots: Snapshots, base: Excitation, system: System, most: int) -> Integers:
    """Numbers of at most so many snapshots that are shown, evenly spread over the run or over a part of it.

    Where a period of the drive, or without a cycle of the first mode, would have fewer than `FRAMES_OF_PERIOD`, they
    are the last of the run, or without a cycle the first.
    """
    count, cyclic = snapshots.time.size, has_cycle(base)
    # not known of a system read from results, whose snapshots are a part already
    frequency = base.frequency if cyclic else system.first_frequency
    span = FRAMES_OF_PERIOD * frequency * float(snapshots.time[-1] - snapshots.time[0])
    stride = max(int((count - 1) / span), 1) if span > 0.0 else count
    if count <= most * stride:
        return thinned(count, most)
    first = count - 1 - stride * (most - 1) if cyclic else 0
    return first + stride * np.arange(most)


@dataclass(frozen=True, eq=False)
class HistoryPiece:
    """A stretch of a history, as a run passes it to `Recorder.sink`; its arrays are read-only and shared with no other.

    Parameters
    ----------
    time : ndarray (samples,), s
        At most `Recorder.piece_samples`, or one base cycle of an event-driven run, next to those of
        the piece before; none where only snapshots were due.
    channels : mapping of str to ndarray (samples,)
        As `Response.channels` has them.
    units : mapping of str to str
        That of each channel.
    energy : EnergyLedger or None
        Of these samples; work and losses since the start of the run.
    snapshots : Snapshots or None
        Those due between the same steps.
    base : Excitation
        The drive of the run.

    Raises `InputError` if a channel or the ledger does not have the samples of `time`, or a channel has no unit.
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


def check_histories(record: Any) -> None:
    """Refuse channels of a history that are not as long as its time, or whose unit is not named.

    A history that went to a sink has units only, and a ledger of few samples.
    """
    for key in ("channels", "units"):
        require_type(getattr(record, key), Mapping, key)
    for name, values in record.channels.items():
        series = checked(f"channels.{name}", values, column(str(record.units.get(name, "")), "samples"))
        fits = series.shape == record.time.shape
        require(
            fits, f"channels.{name}", f"{series.size} samples", "", f"must have {record.time.size} samples, as time has"
        )
        require(name in record.units, "units", sorted(record.units), "", f"must name the unit of {name!r}")
    for name, unit in record.units.items():
        require_type(unit, str, f"units.{name}")
    if record.channels:
        same = set(record.units) == set(record.channels)
        require(same, "units", sorted(record.units), "", f"must be of the channels, {sorted(record.channels)}")
        same = record.energy is None or np.array_equal(record.energy.time, record.time)
        require(same, "energy", None, "", "must be at the times of the channels")


def _long_name(name: str, unit: str) -> str:
    """Words for a channel: a motion is relative to the base, unless it is absolute or bounded by gaps."""
    read = name.rpartition(".")[2]
    relative = unit in ("m", "m/s", "m/s^2") and not read.startswith("absolute_") and read != "gap"
    return f"{name}, relative to the base" if relative else name


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

    data = {name: variable(values, units[name], _long_name(name, units[name])) for name, values in channels.items()}
    data["base"] = variable(base.displacement(time), "m", "base displacement")
    if energy is not None:
        for name in ("kinetic", "strain", "ball", "contact", "work", "structure_loss", "contact_loss"):
            data[f"energy_{name}"] = variable(getattr(energy, name), "J", f"energy: {name.replace('_', ' ')}")
        for name, values in energy.work_of.items():
            data[f"energy_work_of_{name}"] = variable(values, "J", f"energy: work of {name}")
    attributes = {"base_amplitude_m": base.amplitude}
    if has_cycle(base):
        attributes["base_frequency_Hz"] = base.frequency
    coordinate = ("time", np.array(time), {"units": "s", "long_name": "time"})
    return xarray.Dataset(data, coords={"time": coordinate}, attrs=attributes)


def deciding_rows(
    before: EnergyLedger | None,  # those of all the pieces before
    piece: EnergyLedger,  # with one sample or more
) -> EnergyLedger:
    """The few rows of a ledger in pieces that give its residual: first, largest imbalance, largest work, last.

    Returns: at most 4 samples; its residual is the one of all samples so far, to the last bit.
    """
    first = piece if before is None else before
    rows = _each_column(lambda values: values[_extremes(piece, first)], piece)
    if before is None:
        return rows
    joined = _each_column(lambda *parts: np.concatenate(parts), before, rows)
    return _each_column(lambda values: values[_extremes(joined, first)], joined)


def _extremes(ledger: EnergyLedger, first: EnergyLedger) -> list[int]:
    """Rows of the first and last sample, of the largest imbalance and of the largest work since the first of all."""
    put_in = ledger.work - first.work[0]
    lost, lost_at_first = (of.structure_loss + of.contact_loss for of in (ledger, first))
    # unscaled: the scale of the residual is known only at the end, and rounding must not pick another row
    missing = (ledger.stored - first.stored[0]) - put_in + (lost - lost_at_first[0])
    return sorted({0, int(np.argmax(np.abs(missing))), int(np.argmax(np.abs(put_in))), ledger.time.size - 1})


def _each_column(change: Callable[..., Array], *ledgers: EnergyLedger) -> EnergyLedger:
    """A ledger of what a function makes of each column of ledgers, read-only."""

    def changed_column(*columns: Array) -> Array:
        changed_rows = change(*columns)
        changed_rows.setflags(write=False)
        return changed_rows

    names = [item.name for item in dataclasses.fields(EnergyLedger) if item.metadata]
    work_of = {name: changed_column(*(ledger.work_of[name] for ledger in ledgers)) for name in ledgers[0].work_of}
    columns = {name: changed_column(*(getattr(ledger, name) for ledger in ledgers)) for name in names}
    return made(EnergyLedger, work_of=work_of, **columns)


@dataclass(eq=False)
class Stream:
    """Passes the history of a run piece by piece to a sink, or in one piece to the response."""

    # what the run holds now, given how many samples and snapshots were taken from it before
    read: Callable[[int, int], HistoryPiece]
    clear: Callable[[], None]  # empties the run of that
    sink: Callable[[HistoryPiece], None] | None  # as of `Recorder`
    samples: int = 0
    snapshots: int = 0
    deciding: EnergyLedger | None = None
    streamed_to: float | None = None

    def hand_over(self) -> None:
        """Give the sink, if there is one, what has come together in the run, and free the arrays there."""
        if self.sink is None:
            return
        piece = self.read(self.samples, self.snapshots)
        snapshots = 0 if piece.snapshots is None else piece.snapshots.time.size
        self.samples, self.snapshots = self.samples + piece.time.size, self.snapshots + snapshots
        self.clear()
        if piece.time.size + snapshots == 0:
            return
        if piece.time.size:
            self.streamed_to = float(piece.time[-1])
            self.deciding = None if piece.energy is None else deciding_rows(self.deciding, piece.energy)
        self.sink(piece)

    def left(self) -> HistoryPiece:
        """The history for the response: all of it, or, with a sink, units and the rows that decide the residual."""
        piece = self.read(self.samples, self.snapshots)
        if self.sink is None:
            return piece
        return changed(piece, channels={}, energy=self.deciding, snapshots=None)


SAME_INSTANT = 1e-9
"""Cycles by which an instant may differ from that of a sample and still be it: rounding of long times."""


@short_repr
@dataclass(frozen=True, eq=False)
class StroboscopicSection:
    """Channels once per base cycle, at one phase of the base.

    Parameters
    ----------
    phase : float, rad
        Of the base, 0 to 2 pi.
    time : ndarray (cycles,), s
    channels : mapping of str to ndarray (cycles,)
        As `Response.channels` has them; `section["tip"]` reads one.
    units : mapping of str to str

    Raises
    ------
    InputError
        If a channel does not have the samples of `time`, or has no unit.
    """

    phase: float = field(metadata=quantity("rad"))
    time: Array = field(metadata=column("s", "cycles", finite=True))
    channels: Mapping[str, Array]
    units: Mapping[str, str]

    def __post_init__(self) -> None:
        check_fields(self)
        for key, mapping in (("channels", self.channels), ("units", self.units)):
            require_type(mapping, Mapping, key)
        known = set(self.channels) <= set(self.units)
        require(known, "units", list(self.units), "", f"must be those of the channels, {list(self.channels)}")
        for name, values in self.channels.items():
            array = real_array(f"channels.{name}", values, self.units[name], "must hold numbers", finite=False)
            fits = array.shape == self.time.shape
            require(fits, f"channels.{name}", f"array of shape {array.shape}", "", "must have the samples of time")

    @property
    def _head(self) -> Head:
        title = f"StroboscopicSection: {self.time.size} cycles, at {self.phase:.5g} rad of the base"
        return head_of_columns(title, {"time": self.time, **self.channels}, {"time": "s", **self.units})

    def __getitem__(self, name: Position) -> Array:
        key = channel_key(name)
        require_name(key, self.channels, "channel")
        return self.channels[key]


def stroboscopic(
    time: Array,
    channels: Mapping[str, Array],
    units: Mapping[str, str],
    base: Excitation,
    phase: float = 0.0,
) -> StroboscopicSection:
    """Channels at the instants at which the base has a phase.

    An instant that is a sample is read from it. Between samples a displacement whose velocity was
    recorded too is read from the cubic with the values and rates of both neighbours (order 4), every other
    channel from the straight line between them (order 2). Where an impact lies between the neighbours the
    error is at most the spacing of samples times the jump of the rate.

    Parameters
    ----------
    time : ndarray (samples,), s
        Ascending.
    channels : mapping of str to ndarray (samples,)
    units : mapping of str to str
    base : Excitation
        Its `frequency` and `phase` say what a cycle is: 2 pi frequency t + base.phase.
    phase : float, rad

    Returns
    -------
    StroboscopicSection
        Of all complete cycles between the first and the last sample; none where there is no sample.

    Raises
    ------
    InputError
        If the phase is no finite number, or the base has none, as a record.
    """
    taken_at = checked("phase", phase, quantity("rad")) % (2.0 * math.pi)
    require(
        math.isfinite(base.phase),
        "base.phase",
        base.phase,
        "rad",
        "must be finite: no record and nothing without a cycle has one",
    )
    instants = _instants(time, base, taken_at)
    right = np.clip(np.searchsorted(time, instants), 1, max(time.size - 1, 1))
    read = {}
    for name, values in channels.items():
        rate = channels.get(f"{name}.velocity") if units[name] == "m" else None
        read[name] = _read(time, values, rate, instants, right, SAME_INSTANT / base.frequency)
    return made(StroboscopicSection, phase=taken_at, time=instants, channels=read, units=dict(units))


def _instants(time: Array, base: Excitation, phase: float) -> Array:
    """Instants (s) at which the base has the phase, within the samples."""
    if time.size == 0:
        return np.zeros(0)
    shift = (phase - base.phase) / (2.0 * math.pi)
    first = math.ceil(time[0] * base.frequency - shift - SAME_INSTANT)
    last = math.floor(time[-1] * base.frequency - shift + SAME_INSTANT)
    return np.clip((np.arange(first, last + 1) + shift) / base.frequency, time[0], time[-1])


def _read(
    time: Array,
    values: Array,
    rate: Array | None,
    instants: Array,
    right: NDArray[np.int64],
    same: float,
) -> Array:
    """Values at instants from their neighbours, of which `right` is the number of the later one."""
    if time.size < 2 or instants.size == 0:
        return np.asarray(values[np.zeros(instants.size, dtype=int)])
    left = right - 1
    h = time[right] - time[left]
    s = np.divide(instants - time[left], h, out=np.zeros_like(h), where=h > 0.0)
    between = values[left] + s * (values[right] - values[left])
    if rate is not None:
        # the cubic that has the values and rates of both neighbours, as its distance from the straight line
        secant = values[right] - values[left]
        between += s * (1.0 - s) * ((1.0 - s) * (h * rate[left] - secant) - s * (h * rate[right] - secant))
    nearest = np.where(s < 0.5, left, right)
    return np.asarray(np.where(np.abs(time[nearest] - instants) <= same, values[nearest], between))
