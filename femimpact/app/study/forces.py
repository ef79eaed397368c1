"""Forces in a study: `[[force]]`, and the motion of its base together with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

from femimpact.app.study.base_motion import BaseMotion, DriveKind, RecordedMotion, SignalMotion, check_delay
from femimpact.errors import InputError, check_fields, choice, instance, items, name_text, optional, place, quantity
from femimpact.excitation import Chirp, Drives, HammerBlow, PointForce, RandomBase, Shock, Sine, SteppedSine
from femimpact.excitation.drives import alone
from femimpact.excitation.excitation import words_of

OF_PLACE = ("at", "name")
"""Keys of [[force]] of every kind."""

OF_NAME = "forces.name"
"""Key of faults of `Drives` on names."""

FORCE_KINDS: Mapping[str, DriveKind] = {
    "sine": DriveKind(Sine, {"force": "amplitude"}),
    "chirp": DriveKind(Chirp, {"force": "amplitude", "rate": "kind"}, ("level", "by", "acceleration"), ("force",)),
    "stepped-sine": DriveKind(SteppedSine, {"force": "amplitude"}, ("level", "by", "acceleration"), ("force",)),
    "random": DriveKind(RandomBase),
    "shock": DriveKind(
        Shock, {"force": "acceleration", "pulse": "kind"}, ("level", "by", "amplitude"), ("force", "duration")
    ),
    "hammer": DriveKind(HammerBlow, without=OF_PLACE),
}
"""Each kind of [[force]]; its level is called force."""


@dataclass(frozen=True)
class StudyForce:
    """`[[force]]`: a force at a place, by its kind and the keys of that kind.

    Parameters
    ----------
    kind : {"sine", "chirp", "stepped-sine", "random", "shock", "hammer"}
        Of its history: that of a motion of the base, read as newtons, or the blow of a hammer.
    at : str or float
        Named place, or metres from the root.
    values : tuple of (str, value)
        Keys of the kind: `force` (N) is its level, `duration` (s) that of the force itself.
    name : str, optional
        Without a dot; by default "force 1", "force 2" and so on in their order.

    Raises
    ------
    InputError
        If a key is missing, or there is none of that name.
    """

    kind: str = field(metadata=choice(*FORCE_KINDS))
    at: str | float = field(metadata=place())
    values: tuple[tuple[str, Any], ...] = ()
    name: str | None = field(default=None, metadata=optional(name_text()))

    def __post_init__(self) -> None:
        check_fields(self)
        # made here, so that its faults are those of this noun
        _ = self.excitation

    @cached_property
    def excitation(self) -> PointForce | HammerBlow:
        """The force."""
        kind, values, where = FORCE_KINDS[self.kind], dict(self.values), f"a [[force]] of kind {self.kind!r}"
        try:
            if kind.noun is HammerBlow:
                blow: HammerBlow = kind.made(values, where, OF_PLACE, at=self.at, name=self.name)
                return blow
            return PointForce(self.at, kind.made(values, where, OF_PLACE), self.name)
        except InputError as error:
            faults = [replace(one, allowed=one.allowed.replace("(m/s^2)^2/Hz", "N^2/Hz")) for one in error.faults]
            raise InputError(faults) from None

    @property
    def table(self) -> dict[str, Any]:
        """Keys and values of [[force]] in a study file."""
        named = {} if self.name is None else {"name": self.name}
        return {**named, "at": self.at, "kind": self.kind, **dict(self.values)}


@dataclass(frozen=True)
class RestMotion:
    """`[base]` of kind "rest": a base that stands still while forces act.

    Parameters
    ----------
    history : float, s
        Duration of the simulated history.
    initial : {"base", "space", "static"}
        At rest relative to the base, at rest in the inertial frame, or in the static state (`State.static`).
    """

    history: float = field(metadata=quantity("s", above=0.0))
    initial: str = field(default="base", metadata=choice("base", "space", "static"))

    def __post_init__(self) -> None:
        check_fields(self)

    excitation: ClassVar[None] = None

    @property
    def history_duration(self) -> float:
        """Time (s) that the history takes."""
        return self.history

    @property
    def start(self) -> str:
        """Where everything is at rest at t = 0."""
        return self.initial

    @property
    def words(self) -> str:
        """Words for the length of the history and for its excitation."""
        return f"{self.history:g} s of a base at rest"

    @property
    def table(self) -> dict[str, Any]:
        """Keys and values of [base] in a study file."""
        return {
            "kind": "rest",
            "history": self.history,
            **({} if self.initial == "base" else {"initial": self.initial}),
        }


Motion = BaseMotion | RecordedMotion | SignalMotion | RestMotion


@dataclass(frozen=True)
class DrivenMotion:
    """`[base]` together with `[[force]]`: the drives of the history.

    Parameters
    ----------
    motion : BaseMotion, RecordedMotion, SignalMotion or RestMotion
        What [base] gives: the motion of the base, the length and the start of the history.
    forces : sequence of StudyForce
        What [[force]] gives, one or more.

    Raises
    ------
    InputError
        If two forces have one name.
    """

    FREQUENCY_KEY: ClassVar[str] = "force"
    """Key of the study file that sets the highest frequency."""

    kind: ClassVar[str] = "base-and-force"

    motion: Motion = field(metadata=instance(BaseMotion, RecordedMotion, SignalMotion, RestMotion))
    forces: tuple[StudyForce, ...] = field(metadata=items(StudyForce))

    def __post_init__(self) -> None:
        check_fields(self)
        try:
            # made here, so that its faults are those of the file
            _ = self.excitation
        except InputError as error:
            # "force 2" may be the default of one, and the name of another
            more = ', and a force without a name is "force 1", "force 2" and so on by its place in the file'
            faults = [
                replace(one, key=one.key.replace("forces", "force"), allowed=one.allowed + more * (one.key == OF_NAME))
                for one in error.faults
            ]
            raise InputError(faults) from None
        for name, force in self.named():
            check_delay(f"force.{name}.delay", getattr(force.excitation, "history", None), self.history_duration)

    @cached_property
    def drives(self) -> Drives:
        """All drives at once."""
        return Drives(self.motion.excitation, tuple(force.excitation for force in self.forces))

    @property
    def excitation(self) -> Any:
        """The drives; the force itself, where it is one beside a base at rest."""
        return alone(self.drives)

    @property
    def frequency(self) -> float:
        """Highest frequency of the drives, Hz; that of a cycle where they share one."""
        return float(self.drives.frequency)

    @property
    def history_duration(self) -> float:
        """Time (s) that the history takes."""
        return float(self.motion.history_duration)

    @property
    def start(self) -> str:
        """Where everything is at rest at t = 0."""
        return self.motion.start

    @property
    def words(self) -> str:
        """Words for the length of the history and for its excitation."""
        return f"{self.motion.words}, with {', '.join(words_of(force.excitation) for force in self.forces)}"

    def named(self) -> Iterator[tuple[str, StudyForce]]:
        """Names of the forces, and the forces."""
        yield from zip(self.drives.names[-len(self.forces) :], self.forces, strict=True)
