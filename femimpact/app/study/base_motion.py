"""Motions of the base in a study: a sine, a record, a chirp, a stepped sine, a random motion and a shock."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from femimpact.errors import (
    Fault,
    InputError,
    check_fields,
    checked,
    choice,
    level_rows,
    optional,
    quantity,
    suggestion,
    text,
)
from femimpact.excitation import Chirp, RandomBase, RecordedBase, Shock, Sine, SteppedSine, Sum
from femimpact.excitation.columns import record_text

NUMBER = quantity("1", at_least=0, integer=True)
"""Allowed numbers of a column without a name."""


@dataclass(frozen=True)
class BaseMotion:
    """`[base]`: amplitude of the sine; frequency, phase and duration of the simulated history; start.

    Parameters
    ----------
    amplitude : float, m
        Amplitude of the base's displacement, in the history and in the sweep.
    frequency : float, Hz
        Frequency of the simulated history.
    duration : float, s
        Duration of the simulated history.
    phase : float, rad
        Phase of the sine at t = 0.
    start : {"base", "space", "static"}
        At rest relative to the base, at rest in the inertial frame, or in the static state (`State.static`).
    """

    FREQUENCY_KEY: ClassVar[str] = "base.frequency"
    """Key of the study file that sets the frequency of a cycle."""

    amplitude: float = field(metadata=quantity("m", above=0.0))
    frequency: float = field(metadata=quantity("Hz", above=0.0))
    duration: float = field(default=30.0, metadata=quantity("s", above=0.0))
    phase: float = field(default=0.0, metadata=quantity("rad"))
    start: str = field(default="base", metadata=choice("base", "space", "static"))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def excitation(self) -> Sine:
        """The motion that drives the history."""
        return Sine(self.amplitude, self.frequency, self.phase)

    @property
    def history_duration(self) -> float:
        """Time (s) that the history takes."""
        return self.duration

    @property
    def words(self) -> str:
        """Words for the length of the history and for its excitation."""
        return f"{self.duration:g} s at {self.frequency:g} Hz"


@dataclass(frozen=True)
class RecordedMotion:
    """`[base]`: the file of a record with the options of `RecordedBase.from_csv`, duration of the history, and start.

    Parameters
    ----------
    record : str
        Path of the file, from the folder of the study file.
    content : str
        The file as read: no run reads it again, wherever it is by then.
    scale : float or None
        Times which the column is m/s^2: 9.80665 for a record in g; None is what its header says, or 1.
    detrend : {"none", "mean", "line"}
        What is removed: the mean of the acceleration (an offset), or its line of least squares (offset and drift).
    columns : two of int or str
        Time and acceleration, by their numbers from 0 or their names in the header.
    duration : float or None, s
        Duration of the simulated history; None is that of the record.
    start : {"base", "space", "static"}
        At rest relative to the base, at rest in the inertial frame, or in the static state (`State.static`).
    high_pass : float or None, Hz
        What is slower is taken out, without delay; None takes out nothing.

    Raises
    ------
    InputError
        If the content is no record.
    """

    FREQUENCY_KEY: ClassVar[str] = "base.record"
    """Key of the study file that sets the frequency of a cycle."""

    record: str = field(metadata=text())
    content: str = field(repr=False, metadata=text())
    scale: float | None = field(default=None, metadata=optional(quantity("1")))
    detrend: str = field(default="none", metadata=choice("none", "mean", "line"))
    columns: tuple[int | str, int | str] = (0, 1)
    duration: float | None = field(default=None, metadata=optional(quantity("s", above=0.0)))
    start: str = field(default="base", metadata=choice("base", "space", "static"))
    high_pass: float | None = field(default=None, metadata=optional(quantity("Hz", above=0.0)))

    def __post_init__(self) -> None:
        check_fields(self)
        if isinstance(self.columns, (tuple, list)):
            plain = (str(c) if isinstance(c, str) else checked("columns", c, NUMBER) for c in self.columns)
            object.__setattr__(self, "columns", tuple(plain))
        with _faults_of_record():
            # made here, so that its faults are those of this noun
            _ = self.excitation

    @cached_property
    def excitation(self) -> RecordedBase:
        """The motion that drives the history."""
        return RecordedBase.from_text(self.content, self.scale, self.detrend, self.columns, self.record, self.high_pass)

    @property
    def frequency(self) -> float:
        """Frequency of a cycle, Hz: that of the largest line of the record's spectrum."""
        return self.excitation.frequency

    @property
    def history_duration(self) -> float:
        """Time (s) that the history takes."""
        return self.excitation.duration if self.duration is None else self.duration

    @property
    def words(self) -> str:
        """Words for the length of the history and for its excitation."""
        base = self.excitation
        cycle = "a cycle is that of its largest line" if base.has_cycle else "no cycle; its largest line is at"
        return (
            f"{self.history_duration:g} s of the record {self.record!r} ({base.samples.size} samples, "
            f"{base.interval:.6g} s apart; {cycle}{',' * base.has_cycle} {base.frequency:.4g} Hz)"
            f"{'; ' * bool(base.note)}{base.note}"
        )


def record_beside(folder: Path, record: str) -> str:
    """Text of the file of a record, whose path is given from a folder.

    Raises
    ------
    InputError
        If it cannot be read, or is no text.
    """
    with _faults_of_record():
        return record_text(folder / record)


@contextmanager
def _faults_of_record() -> Iterator[None]:
    """Faults of a file under the key that a study file has for it."""
    try:
        yield
    except InputError as error:
        raise InputError([replace(f, key="record") if f.key == "path" else f for f in error.faults]) from None


Signal = Chirp | SteppedSine | RandomBase | Shock

MEANT: Mapping[str, str] = {
    "dwell": "stepped-sine", "sine-dwell": "stepped-sine", "stepped": "stepped-sine", "sine-sweep": "chirp",
    "swept-sine": "chirp", "sweep": "chirp", "noise": "random", "random-vibration": "random", "bump": "shock",
    "pulse": "shock", "recorded": "record", "measured": "record", "impact": "hammer", "log": "logarithmic",
    "saw-tooth": "terminal-sawtooth", "sawtooth": "terminal-sawtooth", "square": "rectangle", "versine": "haversine",
}  # fmt: skip
"""Kinds by other words for them."""


def kind_fault(key: str, value: object, kinds: Iterable[str]) -> Fault:
    """The fault of a value that is no kind, with the kind that is meant."""
    known = list(kinds)
    words = str(value).strip().lower().replace(" ", "-").replace("_", "-")
    meant = MEANT.get(words, words)
    hint = f"; {value!r} is {meant!r} here" if meant in known else ""
    if key == "rate" and hint == "":
        hint = '; octaves in a minute are octaves_per_minute = "1 oct/min"'
    return Fault(key, value, "", f"must be one of {', '.join(map(repr, known))}{hint}")


@dataclass(frozen=True)
class DriveKind:
    """A kind of motion or of force in a study file.

    Parameters
    ----------
    noun : type
        That it makes.
    names : mapping of str to str
        Arguments of the noun by their keys in a study file, where those have another name.
    without : tuple of str
        Arguments that are no keys of the kind.
    needs : tuple of str
        Keys that a study file must have although the noun has a default for them.
    """

    noun: type[Any]
    names: Mapping[str, str] = field(default_factory=dict)
    without: tuple[str, ...] = ("level", "by")
    needs: tuple[str, ...] = ()

    @property
    def keys(self) -> dict[str, inspect.Parameter]:
        """Keys of the kind, each with the argument of the noun."""
        arguments = inspect.signature(self.noun).parameters
        return {self.key_of(name): item for name, item in arguments.items() if name not in self.without}

    @property
    def metadata(self) -> dict[str, Mapping[str, Any]]:
        """Unit and range of each key, as a field of a dataclass has them; of a list of numbers nothing."""
        found: dict[str, Any] = {item.name: item.metadata for item in fields(self.noun)}
        # a pulse may go down
        least = None if self.noun is Shock else 0.0
        of_level: dict[str, Any] = {"amplitude": quantity("m", at_least=least), "force": quantity("N", at_least=least)}
        of_level["acceleration"] = quantity("m/s^2") if self.noun is Shock else level_rows("m/s^2")
        of_level["octaves_per_minute"] = quantity("oct/min", above=0.0)
        of_level["clip"] = {**found.get("clip", {}), "unit": "sigma"}
        return {key: of_level.get(key) or found.get(self.names.get(key, key), {}) for key in self.keys}

    @property
    def needed(self) -> list[str]:
        """Keys that a study file must have."""
        return [key for key, item in self.keys.items() if item.default is inspect.Parameter.empty or key in self.needs]

    def key_of(self, argument: str) -> str:
        """The key of an argument."""
        return next((key for key, name in self.names.items() if name == argument), argument)

    def made(self, values: Mapping[str, Any], where: str, others: tuple[str, ...], **given: Any) -> Any:
        """The noun of keys and values; other keys of the table are named where one is unknown."""
        faults = [
            Fault(key, None, "", suggestion(key, [*self.keys, *others])) for key in values if key not in self.keys
        ]
        faults += [Fault(key, None, "", f"is missing in {where}") for key in self.needed if key not in values]
        kind = self.key_of("kind")
        for key, metadata in self.metadata.items():
            if key in values and "take" in metadata:
                try:
                    checked(key, values[key], metadata)
                except InputError as error:
                    of_kind = key == kind and kind_fault(key, values[key], metadata["schema"]["enum"])
                    faults += [of_kind] if of_kind else error.faults
        if faults:
            raise InputError(faults)
        arguments = {self.names.get(key, key): value for key, value in values.items()} | given
        if "octaves_per_minute" in arguments:
            # a sweep of so many octaves a minute can be nothing else
            arguments.setdefault("kind", "logarithmic")
        try:
            return self.noun(**arguments)
        except InputError as error:
            raise InputError([
                replace(one, key=self.key_of(one.key), allowed=one.allowed.replace('kind "', f'{kind} "'))
                for one in error.faults
            ]) from None  # fmt: skip


SIGNALS: Mapping[str, DriveKind] = {
    "chirp": DriveKind(Chirp, {"rate": "kind"}),
    "stepped-sine": DriveKind(SteppedSine),
    "random": DriveKind(RandomBase),
    "shock": DriveKind(Shock, {"pulse": "kind"}, needs=("acceleration", "duration")),
}
"""Each kind of [base]."""

PARTS: Mapping[str, DriveKind] = {"sine": DriveKind(Sine), **SIGNALS}
"""Each kind of [[base.parts]], of which a sum is made."""

SUM = "sum"
"""Kind of [base] that has parts."""

HISTORY_KEYS = ("history", "initial")
"""Keys of [base] on the history, beside the fields of the motion."""


@dataclass(frozen=True)
class SignalMotion:
    """`[base]`: the kind of a motion with the fields of its noun, duration of the history, and start.

    Parameters
    ----------
    kind : {"chirp", "stepped-sine", "random", "shock", "sum"}
    values : tuple of (str, value)
        Fields of `Chirp`, `SteppedSine`, `RandomBase` or `Shock`, lists as tuples. A chirp's kind is called `rate`
        here, a shock's `pulse`. Of a sum `parts`, for each the same with its kind, which may be a sine too.
    history : float or None, s
        Duration of the simulated history; None is that of the motion, of a sum its longest. A shock and a sine have
        none.
    initial : {"base", "space", "static"}
        At rest relative to the base, at rest in the inertial frame, or in the static state (`State.static`). The key is
        not called start, which is the first frequency of a chirp.

    Raises
    ------
    InputError
        If a field is missing, or there is none of that name.
    """

    FREQUENCY_KEY: ClassVar[str] = "base.kind"
    """Key of the study file that sets the highest frequency."""

    kind: str = field(metadata=choice(*SIGNALS, SUM))
    values: tuple[tuple[str, Any], ...]
    history: float | None = field(default=None, metadata=optional(quantity("s", above=0.0)))
    initial: str = field(default="base", metadata=choice("base", "space", "static"))

    def __post_init__(self) -> None:
        check_fields(self)
        # made here, so that its faults are those of this noun
        _ = self.excitation
        if self.history is None and not self._durations:
            of = "with the shock" if self.kind == "shock" else "with all parts"
            allowed = f"is missing; must be a finite number > 0 s: how long the history is that begins {of}"
            raise InputError([Fault("history", None, "", allowed)])
        for motion in getattr(self.excitation, "parts", (self.excitation,)):
            check_delay("delay", motion, self.history_duration)

    @cached_property
    def excitation(self) -> Signal | Sum:
        """The motion that drives the history."""
        if self.kind != SUM:
            motion: Signal = _made(self.kind, dict(self.values))
            return motion
        parts = dict(self.values).get("parts", ())
        wrong = [name for name, _ in self.values if name != "parts"]
        if wrong:
            raise InputError([Fault(name, None, "", suggestion(name, ["parts", *HISTORY_KEYS])) for name in wrong])
        if not isinstance(parts, tuple) or not parts or not all(isinstance(part, tuple) for part in parts):
            raise InputError([Fault("parts", None, "", "must be one or more tables, [[base.parts]]")])
        return Sum(tuple(_part_of(number, dict(part)) for number, part in enumerate(parts, start=1)))

    @property
    def _durations(self) -> list[float]:
        """Durations (s) of the motions that last for the history."""
        motions = getattr(self.excitation, "parts", (self.excitation,))
        return [
            float(motion.duration) for motion in motions if hasattr(motion, "duration") and type(motion) is not Shock
        ]

    @property
    def start(self) -> str:
        """Where everything is at rest at t = 0."""
        return self.initial

    @property
    def frequency(self) -> float:
        """Highest frequency of the motion, Hz. It has no cycle."""
        return float(self.excitation.frequency)

    @property
    def history_duration(self) -> float:
        """Time (s) that the history takes."""
        return max(self._durations) if self.history is None else float(self.history)

    @property
    def words(self) -> str:
        """Words for the length of the history and for its excitation."""
        highest = "" if self.kind == "shock" else f", up to {self.frequency:.4g} Hz"
        motion, whole = self.excitation, ""
        if isinstance(motion, SteppedSine) and motion.seconds is not None:
            longest = float((motion.cycles_of_steps / motion.steps).max())
            whole = f", up to {longest:.4g} s at a frequency, in whole cycles" * (longest > 1.01 * motion.seconds)
        return f"{self.history_duration:g} s of a {self.kind} motion of the base{highest}{whole}"

    @property
    def table(self) -> dict[str, Any]:
        """Keys and values of [base] in a study file."""
        optional_keys = {"history": self.history, "initial": None if self.initial == "base" else self.initial}
        given = {name: value for name, value in optional_keys.items() if value is not None}
        values = dict(self.values)
        if self.kind == SUM:
            values["parts"] = [dict(part) for part in values["parts"]]
        return {"kind": self.kind, **values, **given}


def check_delay(key: str, motion: Any, history: float) -> None:
    """Raise `InputError` for a shock that begins after the end of the history (s)."""
    if isinstance(motion, Shock) and motion.delay >= history:
        allowed = f"must be < {history:g} s, the history: the shock would begin after its end"
        raise InputError([Fault(key, motion.delay, "s", allowed)])


def _part_of(number: int, values: dict[str, Any]) -> Signal | Sine:
    """A part of a sum by its kind and keys."""
    kind = values.pop("kind", "sine")
    if kind == "record" or "record" in values:
        allowed = "is no part of a sum in a study file; in Python RecordedBase is one of fi.Sum"
        raise InputError([Fault(f"parts.{number}.record", None, "", allowed)])
    if not isinstance(kind, str) or kind not in PARTS:
        raise InputError([kind_fault(f"parts.{number}.kind", kind, PARTS)])
    try:
        motion: Signal | Sine = _made(kind, values)
        return motion
    except InputError as error:
        raise InputError([fault.under(f"parts.{number}") for fault in error.faults]) from None


def _made(kind: str, values: Mapping[str, Any]) -> Any:
    return PARTS[kind].made(values, f"[base] of kind {kind!r}", HISTORY_KEYS)


def numbers_of_signal(signal: Signal) -> dict[str, Any]:
    """The kind of a motion and its fields by name, from which `signal_of_numbers` makes it again."""
    kind = next(name for name, kind in SIGNALS.items() if isinstance(signal, kind.noun))
    return {"signal": kind, "fields": {item.name: getattr(signal, item.name) for item in fields(signal)}}


def signal_of_numbers(numbers: Mapping[str, Any]) -> Signal:
    """The motion that `numbers_of_signal` has described."""
    signal: Signal = SIGNALS[numbers["signal"]].noun(**numbers["fields"])
    return signal
