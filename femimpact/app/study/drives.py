"""The drives of a study: motions of the base and forces, of the tables [base] and [[force]], and as tables again."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from femimpact.errors import (
    Fault,
    InputError,
    checked,
    choice,
    faults_under,
    level_rows,
    name_text,
    optional,
    place,
    quantity,
    suggestion,
    text,
)
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.columns import record_text
from femimpact.excitation.drives import Drives, HammerBlow, PointForce, Rest
from femimpact.excitation.excitation import LineLoad, words_of
from femimpact.excitation.harmonic import Sine, SteppedSine
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.records import RecordedBase
from femimpact.excitation.shock import Shock
from femimpact.excitation.sums import Sum

MEANT: Mapping[str, str] = {
    "dwell": "stepped-sine", "sine-dwell": "stepped-sine", "stepped": "stepped-sine", "sine-sweep": "chirp",
    "swept-sine": "chirp", "sweep": "chirp", "noise": "random", "random-vibration": "random", "bump": "shock",
    "pulse": "shock", "recorded": "record", "measured": "record", "impact": "hammer", "log": "logarithmic",
    "saw-tooth": "terminal-sawtooth", "sawtooth": "terminal-sawtooth", "square": "rectangle", "versine": "haversine",
}  # fmt: skip
"""Kinds by other words for them."""

ALTERNATIVES = {
    "amplitude": "acceleration", "acceleration": "amplitude", "cycles": "seconds", "seconds": "cycles",
    "duration": "octaves_per_minute", "octaves_per_minute": "duration",
}  # fmt: skip
"""Keys of which a drive has one alone."""

LISTS = ("psd",)
"""Keys of lists of numbers that an axis may have, which have no range of their own."""

COUNTED = quantity("1", at_least=0, integer=True)
"""Allowed numbers of a column without a name."""

SECONDS = quantity("s", above=0.0)
START = choice("base", "space", "static")
REQUIRED = inspect.Parameter.empty


class Key(NamedTuple):
    """A key of a table: the argument that it gives, what that is by default, and its unit and range."""

    argument: str
    default: Any
    metadata: Mapping[str, Any]


def _history(duration: str, start: str, seconds: Mapping[str, Any], default: Any = None) -> dict[str, Key]:
    """The keys of [base] that give duration and start of the history."""
    return {duration: Key("duration", default, seconds), start: Key("start", "base", START)}


@dataclass(frozen=True)
class Kind:
    """How a table of a study file becomes a noun, and the noun a table: the fields of the noun are the keys.

    Parameters
    ----------
    noun : type
        That it makes.
    make : callable or None
        What makes it of the arguments that keys give; None is the noun.
    names : mapping of str to str
        Arguments by their keys, where those have another name.
    without : tuple of str
        Arguments that are no keys.
    needs : tuple of str
        Keys that a table must have although the argument has a default.
    ranges : mapping of str to mapping
        Units and ranges of keys, where they are not those of the noun's field.
    beside : mapping of str to Key
        Keys of the table that give no argument of the noun.
    where : str
        Words for the table that lacks a key; empty where the range of the key is said instead.
    elsewhere : mapping of str to str
        Words for keys that are unknown here, and belong to another table.
    """

    noun: Any
    make: Any = None
    names: Mapping[str, str] = field(default_factory=dict)
    without: Iterable[str] = ("level", "by")
    needs: tuple[str, ...] = ()
    ranges: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    beside: Mapping[str, Key] = field(default_factory=dict)
    where: str = ""
    elsewhere: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def keys(self) -> dict[str, Key]:
        """Keys that give arguments, by their names."""
        metadata = {item.name: item.metadata for item in fields(self.noun)} if is_dataclass(self.noun) else {}
        keys = {argument: key for key, argument in self.names.items()}
        arguments = inspect.signature(self.make or self.noun).parameters
        named = [(keys.get(name, name), name) for name in arguments if name not in self.without]
        ranges = {key: self.ranges.get(key, metadata.get(name, {})) for key, name in named}
        return {key: Key(name, arguments[name].default, ranges[key]) for key, name in named}

    @property
    def table_keys(self) -> dict[str, Key]:
        """All keys of the table."""
        return {**self.keys, **self.beside}

    @property
    def needed(self) -> list[str]:
        """Keys that a table must have."""
        return [key for key, one in self.table_keys.items() if one.default is REQUIRED or key in self.needs]

    def check(self, values: Mapping[str, Any]) -> None:
        """Raise `InputError` for unknown and missing keys, and for values out of their range."""
        known, faults = self.table_keys, list[Fault]()
        for key, (argument, _, metadata) in known.items():
            if key not in values and key in self.needed:
                allowed = f" in {self.where}" if self.where else f"; {metadata['allowed']}" if metadata else ""
                faults.append(Fault(key, None, "", f"is missing{allowed}"))
            if key in values and "take" in metadata:
                try:
                    checked(key, values[key], metadata)
                except InputError as error:
                    of_kind = key != argument == "kind" and kind_fault(key, values[key], metadata["schema"]["enum"])
                    faults += [of_kind] if of_kind else error.faults
        unknown = (key for key in values if key not in known)
        faults += [Fault(key, None, "", self.elsewhere.get(key) or suggestion(key, known)) for key in unknown]
        if faults:
            raise InputError(faults)

    def made(self, values: Mapping[str, Any], **given: Any) -> Any:
        """The noun of keys and values, and of arguments that no key gives; keys beside those of the noun are left out.

        Raises `InputError` as of `check`, and of the noun, by the keys.
        """
        self.check(values)
        arguments = {one.argument: values[key] for key, one in self.keys.items() if key in values}
        keys = {one.argument: key for key, one in self.keys.items()}
        try:
            return (self.make or self.noun)(**arguments, **given)
        except InputError as error:
            words = f'{keys.get("kind", "kind")} "'
            faults = [replace(one, allowed=one.allowed.replace('kind "', words)) for one in error.faults]
            raise InputError([replace(one, key=keys.get(one.key, one.key)) for one in faults]) from None

    def table(self, noun: Any) -> dict[str, Any]:
        """Keys and values from which `made` makes the noun again: those that are not as they are by default."""
        values = {key: _argument(noun, one.argument) for key, one in self.keys.items()}
        return {key: value for key, value in values.items() if value is not None and value != self.keys[key].default}

    def axes(self, noun: Any) -> dict[str, str]:
        """Units of the keys that are numbers, given or by default."""
        given = self.table(noun)
        return {
            key: one.metadata.get("unit", "")
            for key, one in self.keys.items()
            if (one.metadata.get("unit") or key in LISTS) and (key in given or ALTERNATIVES.get(key) not in given)
        }


def _argument(noun: Any, name: str) -> Any:
    """The argument that a motion or a force was made of, None where it was made of another one."""
    source = getattr(noun, "source", None)
    if source is not None:
        return source.get(name)
    if name == "parts":
        return [table_of(part, PARTS) for part in noun.parts]
    if name in ("amplitude", "acceleration") and hasattr(noun, "level"):
        return noun.level if getattr(noun, "by", name) == name else None
    if name == "duration" and getattr(noun, "octaves_per_minute", None) is not None:
        return None
    return getattr(noun, name)


def kind_fault(key: str, value: object, kinds: Iterable[str]) -> Fault:
    """The fault of a value that is no kind, with the kind that is meant."""
    known = list(kinds)
    words = str(value).strip().lower().replace(" ", "-").replace("_", "-")
    meant = MEANT.get(words, words)
    hint = f"; {value!r} is {meant!r} here" if meant in known else ""
    if key == "rate" and hint == "":
        hint = '; octaves in a minute are octaves_per_minute = "1 oct/min"'
    return Fault(key, value, "", f"must be one of {', '.join(map(repr, known))}{hint}")


# ---- what makes a motion of other keys than its arguments -------------------------------------------


def recorded(
    record: str,
    scale: float | None = None,
    detrend: str = "none",
    columns: Any = (0, 1),
    high_pass: float | None = None,
    content: str | None = None,
    folder: Path = Path(),
) -> RecordedBase:
    """A record of the base's acceleration from a file, with the options of `RecordedBase.from_csv`.

    Parameters
    ----------
    record : str
        Path of the file, from the folder of the study file.
    scale : float, optional
        Times which the column is m/s^2: 9.80665 for a record in g; None is what its header says, or 1.
    detrend : {"none", "mean", "line"}
        What is removed: the mean of the acceleration (an offset), or its line of least squares (offset and drift).
    columns : two of int or str
        Time and acceleration, by their numbers from 0 or their names in the header.
    high_pass : float, Hz, optional
        What is slower is taken out, without delay; None takes out nothing.
    content : str, optional
        The file as read: no run reads it again, wherever it is by then.
    folder : Path
        From which the path is taken where there is no content.

    Returns
    -------
    RecordedBase
        With content and options as its `source`.

    Raises
    ------
    InputError
        If the file cannot be read, or is no record.
    """
    if isinstance(columns, (tuple, list)):
        columns = tuple(str(one) if isinstance(one, str) else checked("columns", one, COUNTED) for one in columns)
    try:
        content = record_text(folder / record) if content is None else content
        base = RecordedBase.from_text(content, scale, detrend, columns, record, high_pass)
    except InputError as error:
        # a study file has another key for the path
        raise InputError([replace(one, key="record") if one.key == "path" else one for one in error.faults]) from None
    options = {"scale": scale, "detrend": detrend, "columns": columns, "high_pass": high_pass}
    return replace(base, source={"record": record, "content": content, **options})


def _sum(parts: Any = ()) -> Sum:
    """Motions of the base at the same time, of the tables [[base.parts]]."""
    if not isinstance(parts, (list, tuple)) or not parts or not all(isinstance(part, Mapping) for part in parts):
        raise InputError([Fault("parts", None, "", "must be one or more tables, [[base.parts]]")])
    return Sum(tuple(_part(number, dict(part)) for number, part in enumerate(parts, start=1)))


def _rest() -> None:
    """A base that stands still: forces drive the structure, or nothing does."""


def _part(number: int, values: dict[str, Any]) -> Any:
    """A part of a sum by its kind and keys."""
    kind = values.pop("kind", "sine")
    if kind == "record" or "record" in values:
        allowed = "is no part of a sum in a study file; in Python RecordedBase is one of fi.excitation.Sum"
        raise InputError([Fault(f"parts.{number}.record", None, "", allowed)])
    if not isinstance(kind, str) or kind not in PARTS:
        raise InputError([kind_fault(f"parts.{number}.kind", kind, PARTS)])
    with faults_under(f"parts.{number}"):
        return PARTS[kind].made(values)


# ---- the kinds --------------------------------------------------------------------------------------

SUM = "sum"
"""Kind of [base] that has parts."""

LEVELS: dict[str, Any] = {
    "amplitude": quantity("m", at_least=0.0), "force": quantity("N", at_least=0.0),
    "acceleration": level_rows("m/s^2"), "octaves_per_minute": quantity("oct/min", above=0.0),
    "clip": {**optional(quantity("1", at_least=1.0)), "unit": "sigma"},
}  # fmt: skip
"""Units and ranges of keys of which a drive makes its level, or that have a unit in texts."""

OF_SINE: dict[str, Any] = {"acceleration": quantity("m/s^2", above=0.0)}
"""Range of a level that is no table."""

PARTS: Mapping[str, Kind] = {
    name: replace(kind, where=f"[base] of kind {name!r}", ranges={**LEVELS, **kind.ranges})
    for name, kind in {
        "sine": Kind(Sine, needs=("frequency",), ranges=OF_SINE),
        "chirp": Kind(Chirp, names={"rate": "kind"}),
        "stepped-sine": Kind(SteppedSine),
        "random": Kind(RandomBase),
        "shock": Kind(
            Shock,
            names={"pulse": "kind"},
            needs=("acceleration", "duration"),
            ranges={"acceleration": quantity("m/s^2")},
        ),
    }.items()
}
"""Each kind of [[base.parts]], of which a sum is made."""

OF_SIGNAL = _history("history", "initial", optional(SECONDS))

BASES: Mapping[str, Kind] = {
    "sine": Kind(
        Sine, ranges={"amplitude": quantity("m", above=0.0), **OF_SINE}, needs=("frequency",),
        beside=_history("duration", "start", SECONDS, 30.0),
    ),
    "record": Kind(
        RecordedBase, recorded, without=("content", "folder"), beside=_history("duration", "start", optional(SECONDS)),
        ranges={
            "record": text(), "scale": optional(quantity("1")), "detrend": choice("none", "mean", "line"),
            "high_pass": optional(quantity("Hz", above=0.0)),
        },
    ),
    **{name: replace(kind, beside=OF_SIGNAL) for name, kind in PARTS.items() if name != "sine"},
    SUM: Kind(Sum, _sum, ranges={"parts": {}}, beside=OF_SIGNAL),
    "rest": Kind(type(None), _rest, beside=_history("history", "initial", SECONDS, REQUIRED)),
}  # fmt: skip
"""Each kind of [base]."""

OF_PLACE = {"at": Key("at", REQUIRED, place()), "name": Key("name", None, optional(name_text()))}
OF_LINE = {**OF_PLACE, "at": Key("at", None, place()), "density": Key("density", None, quantity("N/m"))}
"""Keys of [[force]] of every kind, and of one that may act along the beam, where its density stands for `at`."""

FORCES: Mapping[str, Kind] = {
    name: replace(
        kind,
        beside=OF_PLACE if name == "hammer" else OF_LINE,
        where=f"a [[force]] of kind {name!r}",
        ranges={**LEVELS, **kind.ranges},
    )
    for name, kind in {
        "sine": Kind(
            Sine, names={"force": "amplitude"}, without=("level", "by", "acceleration"), needs=("force", "frequency")
        ),
        "chirp": Kind(
            Chirp, names={"force": "amplitude", "rate": "kind"}, without=("level", "by", "acceleration"),
            needs=("force",),
        ),
        "stepped-sine": Kind(
            SteppedSine, names={"force": "amplitude"}, without=("level", "by", "acceleration"), needs=("force",)
        ),
        "random": Kind(RandomBase),
        "shock": Kind(
            Shock, names={"force": "acceleration", "pulse": "kind"}, without=("level", "by", "amplitude"),
            needs=("force", "duration"), ranges={"force": quantity("N")},
        ),
        "hammer": Kind(HammerBlow, without=("at", "name")),
    }.items()
}  # fmt: skip
"""Each kind of [[force]]; its level is called force."""


def kind_of(noun: Any, kinds: Mapping[str, Kind]) -> str:
    """Name of the kind of a motion or a force."""
    return next(name for name, kind in kinds.items() if type(noun) is kind.noun)


# ---- motions and forces as tables, and with another value -------------------------------------------


def table_of(noun: Any, kinds: Mapping[str, Kind]) -> dict[str, Any]:
    """Kind, keys and values of a motion or of the history of a force, from which `made_of` makes it again."""
    name = kind_of(noun, kinds)
    return {"kind": name, **kinds[name].table(noun)}


def made_of(table: Mapping[str, Any], kinds: Mapping[str, Kind], **given: Any) -> Any:
    """The motion or force that a table gives, with arguments that no key gives.

    Raises `InputError` as of `Kind.made`.
    """
    return kinds[table["kind"]].made({key: value for key, value in table.items() if key != "kind"}, **given)


def base_with(base: Any, key: str, value: Any) -> Any:
    """A motion of the base with another value of a key; `parts.1.amplitude` is one of a part of a sum.

    Raises `InputError` if the value is out of range, or does not fit the others.
    """
    table = table_of(base, BASES)
    table.pop(ALTERNATIVES.get(key, ""), None)
    if key.startswith("parts."):
        _, number, name = key.split(".")
        table["parts"][int(number) - 1][name] = value
    else:
        table[key] = value
    return made_of(table, BASES, **({"content": base.source["content"]} if table["kind"] == "record" else {}))


def force_of(table: Mapping[str, Any]) -> PointForce | HammerBlow:
    """The force of a table [[force]].

    Raises `InputError` as of `Kind.made`.
    """
    of_place: dict[str, Any] = {"at": table.get("at"), "name": table.get("name")}
    if table.get("density") is not None and table["kind"] != "hammer":
        of_place["at"] = LineLoad(table["density"])
        # of the density the level is a factor
        table = {"force": 1.0, **table} if "force" in FORCES[table["kind"]].keys else table
    try:
        if table["kind"] == "hammer":
            blow: HammerBlow = made_of(table, FORCES, **of_place)
            return blow
        return PointForce(history=made_of(table, FORCES), **of_place)
    except InputError as error:
        faults = [replace(one, allowed=one.allowed.replace("(m/s^2)^2/Hz", "N^2/Hz")) for one in error.faults]
        raise InputError(faults) from None


def force_table(force: PointForce | HammerBlow) -> dict[str, Any]:
    """Keys and values of the table [[force]] of a force."""
    named = {} if force.name is None else {"name": force.name}
    place = {"density": force.at.density} if isinstance(force.at, LineLoad) else {"at": force.at}
    return {**named, **place, **table_of(getattr(force, "history", force), FORCES)}


# ---- the history that they drive --------------------------------------------------------------------


def history_duration(base: Any, duration: float | None) -> float | None:
    """Time (s) that the history takes: as given, or that of the motion, of a sum its longest; None without either."""
    motions = getattr(base, "parts", (base,))
    lasting = [one.duration for one in motions if hasattr(one, "duration") and not isinstance(one, Shock)]
    return max(map(float, lasting), default=None) if duration is None else duration


def named_forces(base: Any, forces: tuple[Any, ...]) -> Iterator[tuple[str, Any]]:
    """Names of the forces, and the forces."""
    yield from zip(Drives(base, forces).names[-len(forces) :] if forces else (), forces, strict=True)


def check_drives(base: Any, forces: tuple[Any, ...], duration: float | None) -> None:
    """Raise `InputError`, by the keys of the study file, for drives that do not fit one another or the history."""
    history = history_duration(base, duration)
    if history is None:
        of = "with the shock" if isinstance(base, Shock) else "with all parts"
        allowed = f"is missing; must be a finite number > 0 s: how long the history is that begins {of}"
        raise InputError([Fault("base.history", None, "", allowed)])
    try:
        named = list(named_forces(base, forces))
    except InputError as error:
        # "force 2" may be the default of one, and the name of another
        more = ', and a force without a name is "force 1", "force 2" and so on by its place in the file'
        faults = [replace(one, allowed=one.allowed + more * (one.key == "forces.name")) for one in error.faults]
        raise InputError([replace(one, key=one.key.replace("forces", "force")) for one in faults]) from None
    for name, force in named:
        if isinstance(force.at, LineLoad) and callable(force.at.density):
            allowed = "must be a number in a study: a function of x is one of a script, fi.LineForce(density, history)"
            raise InputError([Fault(f"force.{name}.density", None, "N/m", allowed)])
    motions = [("base.delay", motion) for motion in getattr(base, "parts", (base,))]
    for key, one in motions + [(f"force.{name}.delay", getattr(force, "history", None)) for name, force in named]:
        if isinstance(one, Shock) and one.delay >= history:
            allowed = f"must be < {history:g} s, the history: the shock would begin after its end"
            raise InputError([Fault(key, one.delay, "s", allowed)])


def words_of_history(base: Any, forces: tuple[Any, ...], duration: float) -> str:
    """Words for the length (s) of a history and for its drives."""
    drives = f"with {', '.join(map(words_of, forces))}" if forces else Rest.words
    if base is None:
        return f"{duration:g} s of a base at rest, {drives}"
    if forces:
        return f"{words_of_history(base, (), duration)}, {drives}"
    if isinstance(base, Sine):
        return f"{duration:g} s at {base.frequency:g} Hz"
    if isinstance(base, RecordedBase):
        cycle = "a cycle is that of its largest line" if base.has_cycle else "no cycle; its largest line is at"
        return (
            f"{duration:g} s of the record {(base.source or {}).get('record')!r} ({base.samples.size} samples, "
            f"{base.interval:.6g} s apart; {cycle}{',' * base.has_cycle} {base.frequency:.4g} Hz)"
            f"{'; ' * bool(base.note)}{base.note}"
        )
    highest = "" if isinstance(base, Shock) else f", up to {base.frequency:.4g} Hz"
    whole = ""
    if isinstance(base, SteppedSine) and base.seconds is not None:
        longest = float((base.cycles_of_steps / base.steps).max())
        whole = f", up to {longest:.4g} s at a frequency, in whole cycles" * (longest > 1.01 * base.seconds)
    return f"{duration:g} s of a {kind_of(base, BASES)} motion of the base{highest}{whole}"
