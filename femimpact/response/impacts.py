"""The record of impacts: what each one was, what they add up to, and the log of all events."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, column, made, quantity, require_type, text
from femimpact.table import Head, column_units, flat_columns, frame_of, head_of_columns, named_column, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

# the first two are extremes of the motion, the others sums over samples; see cycles.CycleStatistics
CYCLE_COLUMNS = ("maximum", "minimum", "square", "sine", "cosine", "samples")
MAXIMUM, MINIMUM = range(2)
ENERGY_COLUMNS = ("kinetic", "strain", "ball", "contact", "work", "structure_loss", "contact_loss")
IMPACT_COLUMNS = (
    "time", "pair", "side", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss",
)  # fmt: skip
EVENT_COLUMNS = ("time", "kind", "pair", "side", "impacts")
EVENT_KINDS = ("impact", "capture", "let go", "touch", "release", "press again", "separate")
TOTAL_COLUMNS = ("count", "approach_speed", "approach_speed_max", "impulse", "peak_force", "force_time")
COUNT, APPROACH_SUM, LARGEST_APPROACH, IMPULSE_SUM, PEAK_FORCE, FORCE_TIME = range(6)
# the first four count impacts that end within the window; the last two every force in it, sticking included


READINGS_IN_CONTACT, DRAWN_IN_CONTACT = 10, 20
"""Readings of a contact force in a compliant contact, below which it has a note, and those of a figure at least."""


IMPACT_UNITS = {
    "time": "s",
    "phase": "rad",
    "impactor": "",
    "side": "1",
    "approach_speed": "m/s",
    "rebound_speed": "m/s",
    "impulse": "N s",
    "peak_force": "N",
    "contact_law": "",
    "duration": "s",
    "energy_loss": "J",
    "energy_to_higher_modes": "J",
}
"""Columns of the impact table and their units, in their order."""


@short_repr
@dataclass(frozen=True, eq=False)
class Impacts:
    """Table of the finished impacts of a run, one entry each, in the order in which they ended.

    `impacts["time"]` reads a column of `IMPACT_UNITS`.

    Parameters
    ----------
    time : ndarray (n,), s
        Instant of touch.
    phase : ndarray (n,), rad
        Of the excitation at that instant, 0 to 2 pi; not a number where the excitation has none (`RecordedBase`).
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
        Impacts after the table was full: counted, not kept.

    Raises
    ------
    InputError
        If `law` is no mapping of names to names.
    """

    _figure: ClassVar[str] = "fi.figures.impact_histograms(response)"

    time: Array = field(metadata=column("s", "impacts"))
    phase: Array = field(metadata=column("rad", "impacts"))
    impactor: NDArray[np.str_] = field(metadata=column("", "impacts", of="text"))
    side: Array = field(metadata=column("1", "impacts"))
    approach_speed: Array = field(metadata=column("m/s", "impacts"))
    rebound_speed: Array = field(metadata=column("m/s", "impacts"))
    impulse: Array = field(metadata=column("N s", "impacts"))
    peak_force: Array = field(metadata=column("N", "impacts"))
    duration: Array = field(metadata=column("s", "impacts"))
    energy_loss: Array = field(metadata=column("J", "impacts"))
    energy_to_modes: Array = field(metadata=column("J", "impacts", "modes"))
    law: Mapping[str, str]
    dropped: int = field(default=0, metadata=quantity("1", at_least=0, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)
        require_type(self.law, Mapping, "law")
        for name in self.law:
            require_type(self.law[name], str, f"law.{name}")

    def __len__(self) -> int:
        return int(self.time.size)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name, IMPACT_UNITS)

    @property
    def _head(self) -> Head:
        lost = f", {self.dropped} more not kept" if self.dropped else ""
        laws = ", ".join(f"{name}: {law}" for name, law in self.law.items())
        # what no impact has, as a phase without a sine, is left out
        names = [name for name in IMPACT_UNITS if name not in ("contact_law", "energy_to_higher_modes")]
        names = [name for name in names if not len(self) or not np.all(self[name] != self[name])]
        title = f"Impacts: {len(self)}{lost}" + (f" (contact law of {laws})" if laws else "")
        return head_of_columns(title, {name: self[name] for name in names}, IMPACT_UNITS)

    @property
    def contact_law(self) -> NDArray[np.str_]:
        """Law behind the peak force of each impact, (n,) of str."""
        laws = np.array([self.law.get(str(name), "") for name in self.impactor], dtype=str)
        laws.setflags(write=False)
        return laws

    @property
    def energy_to_higher_modes(self) -> Array:
        """Energy (J) that each impact scatters to the modes above the first; negative where it takes some.

        Not a number where the energies of the modes were not kept: nothing is known, which is not zero.
        """
        has_modes = self.energy_to_modes.shape[1] > 0
        energy = self.energy_to_modes[:, 1:].sum(axis=1) if has_modes else np.full(len(self), np.nan)
        energy.setflags(write=False)
        return np.asarray(energy)

    @property
    def mode_share(self) -> Array:
        """Share (n, modes) of each mode in the energy that an impact moves: |E_k| over the sum of all |E|.

        The shares of an impact sum to 1, or are all 0 where it moved no energy.
        """
        size = np.abs(self.energy_to_modes)
        total = size.sum(axis=1, keepdims=True)
        return np.asarray(np.divide(size, total, out=np.zeros_like(size), where=total > 0.0))

    @property
    def restitution(self) -> Array:
        """Rebound over approach speed of each impact, 1 (the motion of the structure included).

        Not a number for a contact that the run began in: it had no approach.
        """
        unknown = np.full(self.approach_speed.shape, np.nan)
        return np.asarray(
            np.divide(self.rebound_speed, self.approach_speed, out=unknown, where=self.approach_speed != 0.0)
        )

    def to_pandas(self) -> pandas.DataFrame:
        """A row for every impact, with the columns of `impact_columns`; units in `attrs["units"]`."""
        return frame_of(*impact_columns(self))

    def to_xarray(self) -> xarray.Dataset:
        """The table as a labelled dataset over impacts and, where their energies were kept, modes."""
        import xarray

        def variable(
            values: NDArray[Any], unit: str, name: str, dims: tuple[str, ...] = ("impact",)
        ) -> tuple[Any, ...]:
            labels = {"units": unit, "long_name": name.replace("_", " ")} if unit else {"long_name": name}
            return (dims, np.array(values), labels)

        data = {name: variable(getattr(self, name), unit, name) for name, unit in IMPACT_UNITS.items()}
        coords: dict[str, Any] = {"impact": ("impact", np.arange(len(self)))}
        modes = self.energy_to_modes.shape[1]
        if modes:
            dims = ("impact", "mode")
            data["energy_to_modes"] = variable(self.energy_to_modes, "J", "energy to each mode", dims)
            data["mode_share"] = variable(self.mode_share, "1", "share of each mode in the energy moved", dims)
            coords["mode"] = ("mode", np.arange(1, modes + 1))
        laws = "; ".join(f"{name}: {law}" for name, law in self.law.items())
        return xarray.Dataset(data, coords=coords, attrs={"contact_law": laws, "dropped": self.dropped})


def impact_columns(impacts: Impacts) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns of the impact table and their units, with one more column for the share of every mode.

    `columns` (n,): those of `IMPACT_UNITS`, then share_of_mode_1, ... (see `Impacts.mode_share`).
    `units`
    """
    columns = {name: getattr(impacts, name) for name in IMPACT_UNITS}
    shares = {f"share_of_mode_{k + 1}": share for k, share in enumerate(impacts.mode_share.T)}
    return columns | shares, IMPACT_UNITS | dict.fromkeys(shares, "1")


@short_repr
@dataclass(frozen=True, eq=False)
class StickingPhases:
    """Table of sticking phases: a ball and its wall, or the beam and a stop, moving together.

    `sticking["start"]` reads a column.

    Parameters
    ----------
    impactor : ndarray (n,) of str
    side : ndarray (n,), 1
        +1 or -1: which wall.
    start, end : ndarray (n,), s
        From the end of the accumulation of impacts to the change of sign of the contact force; the
        end is not a number for a state that lasts.
    impulse : ndarray (n,), N s
        Integral of the normal force, with which wall and ball push each other apart.
    mean_force : ndarray (n,), N
    """

    impactor: NDArray[np.str_] = field(metadata=column("", "states", of="text"))
    side: Array = field(metadata=column("1", "states"))
    start: Array = field(metadata=column("s", "states"))
    end: Array = field(metadata=column("s", "states"))
    impulse: Array = field(metadata=column("N s", "states"))
    mean_force: Array = field(metadata=column("N", "states"))

    def __post_init__(self) -> None:
        check_fields(self)

    def __len__(self) -> int:
        return int(self.start.size)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    @property
    def _head(self) -> Head:
        lasting = np.count_nonzero(np.isnan(self.end))
        title = f"StickingPhases: {len(self)}" + (f", {lasting} of them last" if lasting else "")
        return head_of_columns(title, *flat_columns(self))

    def to_pandas(self) -> pandas.DataFrame:
        """A row for every phase; units in `attrs["units"]`."""
        return frame_of(*flat_columns(self))

    @classmethod
    def none(cls) -> StickingPhases:
        """No sticking phase."""
        nothing = np.zeros(0)
        return cls(np.zeros(0, dtype=str), nothing, nothing, nothing, nothing, nothing)


@short_repr
@dataclass(frozen=True, eq=False)
class EventLog:
    """Log of an event-driven run: one row for each event, with the state just after it.

    From a row to the next one the motion is that of the linear system of the row's contact states. What a run begins
    with is no event. An impact may also press or release a Kelvin-Voigt contact elsewhere, and let rigid pairs go that
    stick: that has no separate row, and is seen in `contact_state`. `log["time"]` reads a column.

    Parameters
    ----------
    time : ndarray (k,), s
    kind : ndarray (k,) of str
        What happens to the pair. Of a rigid one "impact": it rebounds; "capture": it sticks from here on, after an
        impact without rebound or pressed at rest; "let go": the force that holds it is zero; "touch": beside others
        that stick it meets its wall at a speed of rounding. Of a Kelvin-Voigt one "touch": it meets its wall;
        "release": its force is zero before the wall has sprung back; "press again": the force rises anew before that;
        "separate": it leaves its wall.
    pair : ndarray (k,) of int
        Number in `contacts`; of impacts of several pairs at one instant the one that was found first.
    side : ndarray (k,) of int
        +1 or -1: which wall.
    impacts : ndarray (k,) of int
        Impacts that end with the event, each a row of `Response.impacts`: more than 1 where several pairs, or one
        repeatedly, collide at one instant. They are one row here. A pair that rests free at its wall, and is pushed
        by others, has one with an approach speed of zero.
    contact_state : ndarray (k, pairs) of int
        Of every pair after the event: 0 free, +1 or -1 pressed by that wall or sticking to it, +2 or -2 a Kelvin-Voigt
        contact without force that has not left that wall.
    displacement : ndarray (k, n), m
        Of all coordinates just after the event, relative to the moving base: those of the structure as in
        `Response.final_state`, of a reduced system its modes, then of the balls.
    velocity : ndarray (k, n), m/s
        The same of the rates.
    contacts : tuple of str
        Names of all pairs, in the order of `System.contacts`.
    dropped : int
        Events after the log was full: counted, not kept.
    """

    time: Array = field(metadata=column("s", "events"))
    kind: NDArray[np.str_] = field(metadata=column("", "events", of="text"))
    pair: NDArray[np.int64] = field(metadata=column("1", "events", of="whole number"))
    side: NDArray[np.int64] = field(metadata=column("1", "events", of="whole number"))
    impacts: NDArray[np.int64] = field(metadata=column("1", "events", of="whole number"))
    contact_state: NDArray[np.int64] = field(metadata=column("1", "events", "pairs", of="whole number"))
    displacement: Array = field(metadata=column("m", "events", "coordinates"))
    velocity: Array = field(metadata=column("m/s", "events", "coordinates"))
    contacts: tuple[str, ...] = field(metadata=text(several=True))
    dropped: int = field(default=0, metadata=quantity("1", at_least=0, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def __len__(self) -> int:
        return int(self.time.size)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    @property
    def _head(self) -> Head:
        lost = f", {self.dropped} more not kept" if self.dropped else ""
        units = {name: unit for name, unit in column_units(self).items() if getattr(self, name).ndim == 1}
        return head_of_columns(f"EventLog: {len(self)}{lost}", {name: self[name] for name in units}, units)

    def to_pandas(self) -> pandas.DataFrame:
        """A row for every event, with a column for each pair and coordinate; units in `attrs["units"]`."""
        return frame_of(*flat_columns(self))

    def to_xarray(self) -> xarray.Dataset:
        """The log as a labelled dataset over events, contacts and coordinates."""
        import xarray

        axes = {"contact_state": ("contact",), "displacement": ("coordinate",), "velocity": ("coordinate",)}
        data = {}
        for name, unit in column_units(self).items():
            labels = {"long_name": name.replace("_", " ")} | ({"units": unit} if unit else {})
            data[name] = (("event", *axes.get(name, ())), np.array(self[name]), labels)
        coords = {"event": np.arange(len(self)), "contact": np.array(self.contacts, dtype=str)}
        return xarray.Dataset(data, coords=coords, attrs={"dropped": self.dropped})


def event_width(pairs: int, coordinates: int) -> int:
    """Columns of the compiled log: those of `EVENT_COLUMNS`, contact states, displacements and velocities."""
    return len(EVENT_COLUMNS) + pairs + 2 * coordinates


def event_log(
    rows: Array,  # (l, event_width): the compiled log of one case; only those that were written are read
    count: int,  # events in all
    contacts: tuple[str, ...],
) -> EventLog:
    """The log of a case from the rows that the compiled loop has written."""
    first, pairs = len(EVENT_COLUMNS), len(contacts)
    logged = rows[: min(count, rows.shape[0])]
    columns = dict(zip(EVENT_COLUMNS, logged.T[:first], strict=True))
    position, rate = np.split(logged[:, first + pairs :], 2, axis=1)
    values: dict[str, NDArray[Any]] = {
        **{name: columns[name].astype(np.int64) for name in ("pair", "side", "impacts")},
        "time": columns["time"].copy(),
        "kind": np.array(EVENT_KINDS)[columns["kind"].astype(int)],
        "contact_state": logged[:, first : first + pairs].astype(np.int64),
        "displacement": position.copy(),
        "velocity": rate.copy(),
    }
    for array in values.values():
        array.setflags(write=False)
    return made(EventLog, contacts=contacts, dropped=count - logged.shape[0], **values)


@dataclass(frozen=True)
class ImpactStatistics:
    """Sums and extremes over the contacts of a time window.

    Parameters
    ----------
    count : int
        Impacts that ended in the window.
    impacts_per_cycle : float, 1
        Not a number where the excitation has no cycle.
    mean_approach_speed, largest_approach_speed : float, m/s
    mean_impulse : float, N s
    peak_force : float, N
        Largest force in the window, also of contacts that go on across an end of it; event-driven to 1e-9. Not a number
        where a rigid pair collides, whose impulses have none; event-driven, one that only sticks has that of sticking.
    law : str
        The contact law behind the peak force.
    cycle_mean_force : float, N
        Integral of the normal force over the window's length, a ball that sticks to its wall included. A contact that
        goes on across an end of the window is cut there.
    """

    count: int = field(metadata=quantity("1", at_least=0, integer=True))
    impacts_per_cycle: float = field(metadata=quantity("1", finite=False))
    mean_approach_speed: float = field(metadata=quantity("m/s", finite=False))
    largest_approach_speed: float = field(metadata=quantity("m/s", finite=False))
    mean_impulse: float = field(metadata=quantity("N s", finite=False))
    peak_force: float = field(metadata=quantity("N", finite=False))
    law: str = field(metadata=text())
    cycle_mean_force: float = field(metadata=quantity("N", finite=False))

    def __post_init__(self) -> None:
        check_fields(self)


def observed_restitution(
    impacts: Impacts,
    name: str,  # of the ball or stop
    mean_speed: float,  # m/s: of its approaches
) -> float:
    """Median of rebound over approach speed of one contact's impacts, 1; not a number without any.

    Slow touches, in which the motion of the beam counts as rebound, are left out.
    """
    fast = (impacts.impactor == name) & (impacts.approach_speed >= SLOW_TOUCH * mean_speed)
    known = impacts.restitution[fast]
    return float(np.median(known)) if known.size else math.nan


SLOW_TOUCH = 0.2
"""Share of the mean approach speed below which an impact is a slow touch."""


def impact_statistics(
    # (6, balls) impacts, sum and largest of the approach speed (m/s), sum of the impulse (N s), largest force (N),
    # integral of the force (N s); see `TOTAL_COLUMNS`
    totals: Array,
    duration: float,  # s: of the window
    frequency: float,  # Hz: of the base, to count per cycle
    law: str,
) -> ImpactStatistics:
    """Statistics from the sums that the time loop keeps over a window.

    Returns: over all balls given; means over no impact are 0.
    """
    columns = statistics_of_cases(totals[:, :, None], np.array([duration]), np.array([frequency]))
    count = int(totals[0].sum())
    return made(ImpactStatistics, count=count, law=law, **{name: float(column[0]) for name, column in columns.items()})


def statistics_of_cases(
    totals: Array,  # (6, balls, cases)
    duration: Array,  # (cases,) s
    frequency: Array,  # (cases,) Hz
) -> dict[str, Array]:  # (cases,)
    """The same of many cases: columns (cases,) by the names of `ImpactStatistics`."""
    count = totals[0].sum(axis=0)
    share = 1.0 / np.maximum(count, 1.0)
    return {
        "impacts_per_cycle": count / (duration * frequency),
        "mean_approach_speed": totals[1].sum(axis=0) * share,
        "largest_approach_speed": totals[2].max(axis=0, initial=0.0),
        "mean_impulse": totals[3].sum(axis=0) * share,
        "peak_force": totals[4].max(axis=0, initial=0.0),
        "cycle_mean_force": totals[5].sum(axis=0) / duration,
    }
