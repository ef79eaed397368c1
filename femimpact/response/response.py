"""The recorder and the response of a run: channels, snapshots, impacts, energies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import (
    Fault,
    InputError,
    check_fields,
    column,
    having,
    in_range,
    instance,
    optional,
    quantity,
    require,
    require_type,
    suggestion,
    takes,
    text,
    truth,
)
from femimpact.excitation.excitation import MEMBERS, Excitation, has_cycle
from femimpact.response.channels import Channel, channel_key, channel_of, motion_of, resolve_channels
from femimpact.response.cycles import Largest, LargestValues, SteadyMotion
from femimpact.response.energy import EnergyLedger
from femimpact.response.history import (
    HistoryPiece,
    Snapshots,
    StroboscopicSection,
    check_histories,
    history_dataset,
    stroboscopic,
)
from femimpact.response.impacts import EventLog, Impacts, ImpactStatistics, StickingPhases
from femimpact.response.regimes import Regime, classify, without_cycle
from femimpact.structure.structure import Position
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import Head, frame_of, head_of_values, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True)
class Recorder:
    """Choice of what a run keeps.

    Parameters
    ----------
    channels : sequence of str, float or Channel, optional
        A place ("tip", "mid", a point of the mesh, metres from the root) or a ball's name gives
        its displacement relative to the base; with a quantity behind a dot, as "tip.velocity" or
        "ball.absolute_acceleration", that one (`response.channels.QUANTITIES` lists them).
        "gap" (ball minus beam, m) and "contact_force" (on the beam, N) belong to the only ball,
        "ball.gap" and "ball.contact_force" to the one named. A user's `Channel` reads any
        linear function of the state. None keeps the tip, every ball and every contact force; names given take
        the place of these: ("tip", "ball", "ball.contact_force", "tip.velocity") adds one.
    interval : float, s, optional
        Between the instants at which an event-driven run is read, in place of its `samples_per_cycle`, whatever drives
        it. `every` and `snapshots` count these. A method with steps is read at its steps, and refuses it. None reads a
        sine `samples_per_cycle` times in a cycle, and a drive by samples as `EventDriven` says.
    every : int, steps or samples
        Stride of channels and energies.
    start : float, s
        First time kept, to the nearest sample.
    snapshots : int, steps or samples
        Stride of deflections of the entire beam; 0 keeps none.
    snapshots_start : float, s
        First time of a snapshot, to the nearest sample.
    state_at : float, s, optional
        Keep the state at this time too as `Response.kept_state`: to the nearest step, or, event-driven, at the end of
        the base cycle before it.
    impacts : int
        Most impacts kept in the table; later ones are counted only.
    ledger : bool
        Keep the energy ledger.
    memory_limit : float, bytes
        A run that would keep more is refused before it starts.
    residual_limit : float, 1
        Energy residual beyond which the response carries a warning.
    sink : callable, optional
        Called with one `HistoryPiece` after another while the run goes on, so that a history of
        any length needs the memory of a piece. The response itself then holds no history. An
        exception in it ends the run. Statistics of base cycles stay, some 100 bytes a cycle.
    piece_samples : int
        Most samples in a piece; an event-driven run with a whole number of samples in a base cycle passes on complete
        cycles, and the first piece has the state at the start besides.
    events : int
        Most events kept in the log of an event-driven run, `Response.events`; later ones are counted only. 0 keeps no
        log. A method with steps finds no events, and refuses more.
    """

    channels: Sequence[Position | Channel] | None = None
    every: int = field(default=1, metadata=quantity("steps", at_least=1, integer=True))
    start: float = field(default=0.0, metadata=quantity("s", at_least=0.0))
    snapshots: int = field(default=0, metadata=quantity("steps", at_least=0, integer=True))
    snapshots_start: float = field(default=0.0, metadata=quantity("s", at_least=0.0))
    state_at: float | None = field(default=None, metadata=quantity("s", at_least=0.0))
    impacts: int = field(default=100_000, metadata=quantity("1", at_least=0, integer=True))
    ledger: bool = field(default=True, metadata=truth())
    memory_limit: float = field(default=1e9, metadata=quantity("bytes", above=0.0))
    residual_limit: float = field(default=0.01, metadata=quantity("1", above=0.0))
    sink: Callable[[HistoryPiece], None] | None = None
    piece_samples: int = field(default=100_000, metadata=quantity("1", at_least=1, integer=True))
    interval: float | None = field(default=None, metadata=optional(quantity("s", above=0.0)))
    events: int = field(default=0, metadata=quantity("1", at_least=0, integer=True))

    @takes(time=quantity("s", at_least=0.0))
    def seen_from(self, time: float) -> Recorder:
        """The same with its first times counted from the start of a run at a time (s); earlier ones are that start."""
        if time == 0.0:
            return self
        start, snapshots_start = (max(first - time, 0.0) for first in (self.start, self.snapshots_start))
        state_at = None if self.state_at is None else max(self.state_at - time, 0.0)
        return replace(self, start=start, snapshots_start=snapshots_start, state_at=state_at)

    def __post_init__(self) -> None:
        if isinstance(self.channels, (str, int, float, np.number, Channel)):
            object.__setattr__(self, "channels", (self.channels,))
        elif isinstance(self.channels, list) or (isinstance(self.channels, np.ndarray) and self.channels.ndim == 1):
            object.__setattr__(self, "channels", tuple(self.channels))
        faults = []
        if self.channels is not None and not (
            isinstance(self.channels, tuple)
            and all(isinstance(entry, (str, Channel)) or in_range(entry, quantity("m")) for entry in self.channels)
        ):
            allowed = "must be names of places or balls, metres from the root, or channels with name, unit and reading"
            faults.append(Fault("channels", self.channels, "", allowed))
        if self.sink is not None and not callable(self.sink):
            faults.append(Fault("sink", type(self.sink).__name__, "", "must be callable, with one HistoryPiece"))
        check_fields(self, *faults)
        if self.channels is not None:
            # numpy's texts and numbers become Python's
            plain = (
                entry if isinstance(entry, Channel) else str(entry) if isinstance(entry, str) else float(entry)
                for entry in self.channels
            )
            object.__setattr__(self, "channels", tuple(plain))


@runtime_checkable
class ShownSystem(Protocol):
    """The parts of a system that a response shows: places, contacts, and curves between nodes."""

    @property
    def nodes(self) -> Array:
        """Positions of the nodes, m."""

    @property
    def points(self) -> Mapping[str, float]:
        """Named places, m."""

    @property
    def contacts(self) -> tuple[Any, ...]:
        """Balls first, then stops."""

    @property
    def balls(self) -> tuple[Any, ...]:
        """The contacts that are balls."""

    def deflection_rows(self, positions: ArrayLike) -> Array:
        """Rows that read the deflection at positions."""


@short_repr
@dataclass(frozen=True, eq=False)
class Response:
    """Histories of one run; arrays are read-only.

    Of a run whose history went to `Recorder.sink`, all is the same but `time`, `channels` and
    `snapshots`, which are empty, and `energy`.

    Parameters
    ----------
    time : ndarray (samples,), s
    channels : mapping of str to ndarray (samples,)
        Relative to the base; `response["tip"]` reads one.
    units : mapping of str to str
    sticking : StickingPhases
        Balls moving with their wall as a named state; only the event-driven method has it.
    statistics : ImpactStatistics
        Over the last third of the run.
    statistics_of : mapping of str to ImpactStatistics
        The same for each ball.
    steady : SteadyMotion
        Of the tip over the last third of the run's complete base cycles, arrays of one entry. Where the excitation has
        no cycle its rms is that of the samples kept of the last third, if the tip is recorded.
    energy : EnergyLedger or None
        Of a streamed run, the few samples that decide the residual of all: the first, those of the
        largest imbalance and of the largest work, the last.
    base : Excitation
        Its motion of the base makes absolute results.
    warnings, notes : tuple of str
    streamed_to : float or None, s
        Time of the last sample that went to the recorder's sink, if it has one.
    start : float, s
        When the run began: `State.time` of its initial state.
    final_state : State or None
        At the end of the run, relative to the base; as `initial` of the next run, that goes on from there.
    kept_state : State or None
        The same at `Recorder.state_at`: a run from there has the bits of this one. None
        without one, and where that time is not within the run.
    largest_values : LargestValues or None
        What `largest` asks; None of a response that was read from files.
    events : EventLog or None
        All events of an event-driven run with the states after them, where `Recorder.events` asks for them.

    Raises
    ------
    InputError
        If the samples, pairs or dofs of a field are not those of the others.
    """

    _figure: ClassVar[str] = "fi.figures.channels(response)"

    time: Array = field(metadata=column("s", "samples", finite=True))
    channels: Mapping[str, Array]
    units: Mapping[str, str]
    impacts: Impacts = field(metadata=instance(Impacts))
    sticking: StickingPhases = field(metadata=instance(StickingPhases))
    statistics: ImpactStatistics = field(metadata=instance(ImpactStatistics))
    statistics_of: Mapping[str, ImpactStatistics]
    steady: SteadyMotion = field(metadata=instance(SteadyMotion))
    energy: EnergyLedger | None = field(metadata=optional(instance(EnergyLedger)))
    snapshots: Snapshots | None = field(metadata=optional(instance(Snapshots)))
    base: Excitation = field(metadata=having("an excitation", MEMBERS))
    system: System = field(metadata=instance(ShownSystem))
    warnings: tuple[str, ...] = field(default=(), metadata=text(several=True))
    notes: tuple[str, ...] = field(default=(), metadata=text(several=True))
    streamed_to: float | None = field(default=None, metadata=quantity("s", at_least=0.0))
    start: float = field(default=0.0, metadata=quantity("s", at_least=0.0))
    final_state: State | None = field(default=None, metadata=optional(instance(State)))
    kept_state: State | None = field(default=None, metadata=optional(instance(State)))
    largest_values: LargestValues | None = field(
        default=None, repr=False, metadata=optional(instance(LargestValues))
    )  # fmt: skip
    events: EventLog | None = field(default=None, metadata=optional(instance(EventLog)))

    def __post_init__(self) -> None:
        check_fields(self)
        check_histories(self)
        contacts = tuple(pair.name for pair in self.system.contacts)
        require_type(self.statistics_of, Mapping, "statistics_of")
        same = tuple(self.statistics_of) == contacts
        require(same, "statistics_of", list(self.statistics_of), "", f"must be of the contacts, {list(contacts)}")
        for name, of_pair in self.statistics_of.items():
            require_type(of_pair, ImpactStatistics, f"statistics_of.{name}")
        # the regime and the histories of balls name them
        for key, table in (("impacts", self.impacts), ("sticking", self.sticking)):
            unknown = sorted(set(table.impactor.tolist()) - set(contacts))
            require(not unknown, key, unknown, "", f"must be of the contacts, {list(contacts)}")

    @property
    def _head(self) -> Head:
        span = f"{self.time[0]:.5g} to {self.time[-1]:.5g} s, " if self.time.size else ""
        extent = (
            f"{span}{self.time.size} samples" if self.streamed_to is None else f"streamed to {self.streamed_to:.5g} s"
        )
        statistics = self.statistics
        rate = f"{statistics.impacts_per_cycle:.5g} per base cycle" if has_cycle(self.base) else f"{statistics.count}"
        values = {
            "channels": ", ".join(f"{name} ({unit})" for name, unit in self.units.items()),
            "impacts": f"{len(self.impacts)}, {rate} over the last third",
            "sticking phases": str(len(self.sticking)),
        }
        if self.energy is not None:
            values["energy residual"] = f"{self.energy.residual:.5g} of the energy put in"
        for name, texts in (("warnings", self.warnings), ("notes", self.notes)):
            values[name] = f"{len(texts)}{f': {texts[0]}' if texts else ''}"
        return head_of_values(f"Response: {extent}", values)

    def __getitem__(self, name: Position) -> Array:
        key = channel_key(name)
        require(self.streamed_to is None, "channel", key, "", "went to Recorder.sink: its pieces hold the history")
        if key not in self.channels:
            kept = ", ".join(map(repr, self.channels))
            more = f"to record more, run with fi.Recorder(channels=({kept}, ...)): names given replace the default ones"
            require(False, "channel", key, "", f"{suggestion(key, self.channels)}; {more}")
        return self.channels[key]

    @property
    def window(self) -> tuple[float, float]:
        """Start and end (s) of the last third of the run, over which statistics and regime are taken."""
        # a run whose only sample is its first has an empty window, which is still one
        end = float(self.time[-1]) if self.streamed_to is None else self.streamed_to
        end = max(end, 1e-300, (1.0 + 1e-12) * self.start)
        return self.start + 2.0 * (end - self.start) / 3.0, end

    @cached_property
    def regime(self) -> Regime:
        """Kind of motion over the last third of the run; `regimes.classify` says by which criterion."""
        if not has_cycle(self.base):
            return without_cycle(self.impacts, self.base)
        return classify(self.impacts, self.sticking, self.base.frequency, *self.window)

    def absolute(self, name: Position) -> Array:
        """A displacement (m), velocity (m/s) or acceleration (m/s^2) channel in space: relative plus the base's.

        Raises
        ------
        InputError
            If there is no such channel, it is of another kind, or the history went to `Recorder.sink`.
        """
        values, channel = self[name], channel_of(self.system, name)
        _, absolute = motion_of(channel) or (0, True)
        allowed = "must be a relative displacement, velocity or acceleration to have an absolute value"
        require(not absolute, "channel", str(name), self.units[str(name)], allowed)
        moved_by = {"m": self.base.displacement, "m/s": self.base.velocity, "m/s^2": self.base.acceleration}
        return np.asarray(values + moved_by[channel.unit](self.time))

    def largest(self, channel: Position | Channel) -> Largest:
        """The largest value of any channel over all of the run, and its time: recorded or not, kept or not.

        It is that of max |value|, and has the sign that the channel has there: a stress of -98 MPa is larger than one
        of 60 MPa. An event-driven run has it to 1e-9 of itself, between samples too, with the values on both sides of
        an impact; its time, where the channel is level, to about 1e-5 of the period of what oscillates there. A run
        with steps has the largest of all its steps. An impact that lasts no time has no force. A value is found by
        computing the run once more, which takes as long as the run, and is then known.

        Parameters
        ----------
        channel : str, float or Channel
            As of `Recorder.channels`.

        Returns
        -------
        Largest
            Value, time (s) and unit.

        Raises
        ------
        InputError
            If there is no such channel, or the response was not made by a run but read from files.
        """
        return self.largest_of((channel,))[0]

    def largest_of(self, channels: Sequence[Position | Channel]) -> tuple[Largest, ...]:
        """The same of several channels; a method with steps finds all of them in one run.

        Raises
        ------
        InputError
            As of `largest`.
        """
        allowed = "must be a response of `integrate`: what was read from files has samples only"
        largest_values = self.largest_values
        if largest_values is None:
            raise InputError([Fault("largest", None, "", allowed)])
        return largest_values.of(resolve_channels(self.system, Recorder(channels).channels))

    def to_pandas(self) -> pandas.DataFrame:
        """All channels over time; units in `attrs["units"]`.

        Raises
        ------
        InputError
            If the history went to `Recorder.sink`.
        """
        columns = {"time": self.time} | {name: self[name] for name in self.units}
        return frame_of(columns, {"time": "s", **self.units}, index="time")

    def stroboscopic(self, phase: float = 0.0) -> StroboscopicSection:
        """Every channel once per base cycle, at a phase (rad) of the base: the Poincare section of the run.

        `history.stroboscopic` says how values between samples are read. No cycles of a streamed run.
        """
        return stroboscopic(self.time, self.channels, self.units, self.base, phase)

    def to_xarray(self) -> xarray.Dataset:
        """All channels, energies and the base's motion as a labelled dataset over time."""
        # of a streamed run the few samples of energy are no history
        energy = self.energy if self.streamed_to is None else None
        attributes: dict[str, Any] = {"warnings": "; ".join(self.warnings)}
        if self.energy is not None:
            attributes["energy_residual"] = self.energy.residual
        return history_dataset(self.time, self.channels, self.units, energy, self.base).assign_attrs(attributes)
