"""Forces at places, and several drives at once: a motion of the base with forces; their words and numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, items, kind_of, name_text, optional, place, quantity, require
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.excitation import (
    MEMBERS,
    Harmonic,
    LineLoad,
    WithoutCycle,
    has_cycle,
    holds_drives,
    is_force,
    require_excitation,
    times,
    words_of,
)
from femimpact.excitation.harmonic import Sine
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, half_sine, pieces_of
from femimpact.excitation.sums import Form, Sum, added, force_form_of, forms_together, one_sine, parts_of
from femimpact.units import GRAVITY, typeset_number, unit_text

BASE = "base"
"""Name of the motion of the base among the drives."""

CONSTANT_FORCES = "constant forces"
"""Name of their work beside that of the drives."""


class BaseAtRest:
    """Displacement, velocity and acceleration of a base that does not move while a force acts."""

    def __post_init__(self) -> None:
        check_fields(self)
        name = getattr(self, "name", None)
        # what parts names of axes or of a file's data
        good = name is None or (bool(name.strip()) and not {".", "/"} & set(name))
        require(good, "name", name, "", "must be a text without a dot or a slash that is not empty")

    @property
    def amplitude(self) -> float:
        """Amplitude of the base's motion: 0 m."""
        return 0.0

    def displacement(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base displacement: zero, m."""
        return np.zeros_like(times(time))

    velocity = displacement
    acceleration = displacement

    __add__ = added
    __radd__ = added


@dataclass(frozen=True)
class Rest(WithoutCycle, BaseAtRest):
    """Nothing drives the structure: the base stands still and no force acts, as in a free decay. It has no cycle.

    As an excitation None is the same.

    Parameters
    ----------
    end : float, s, optional
        When the run ends; `integrate` sets it.
    """

    end: float | None = field(default=None, compare=False, metadata=optional(quantity("s", above=0.0)))

    words: ClassVar[str] = "nothing drives it"

    @property
    def frequency(self) -> float:
        """The lowest frequency (Hz) of which a run holds a period, 1/end; 0 Hz before the end is known."""
        return 0.0 if self.end is None else 1.0 / self.end

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base: zero, m/s^2."""
        return PiecewisePolynomial([0.0, 1.0 if self.end is None else self.end], [[0.0]])


PLACE = place()
PLACE_OR_LINE = {**PLACE, "take": lambda at: at if isinstance(at, LineLoad) else PLACE["take"](at)}


@dataclass(frozen=True)
class PointForce(BaseAtRest):
    """Force on the structure at one place, the base at rest: F(t) = history(t), read as newtons.

    What a history was given by is the force, with its sign: the displacement where that is an amplitude (of a sine, a
    chirp or a stepped sine), the acceleration where it is one (of a chirp, a stepped sine, a record, a shock, a density
    in N^2/Hz). So a stepped sine begins with +amplitude, and with -acceleration, which is that of a base that is
    farthest out on the + side. After its end a history is no force. The force of a sum is the sum of those of its
    parts.

    Parameters
    ----------
    at : str or float
        Named place, or metres from the root.
    history : Sine, Chirp, SteppedSine, RandomBase, Shock, RecordedBase or Sum
        Its level is a force, N.
    name : str, optional
        Among several drives, without a dot or a slash; see `Drives`.

    Raises
    ------
    InputError
        If the history, or a part of a sum, has no closed form.

    Examples
    --------
    A sine of 10 mN at the tip of a beam at rest:

    >>> import femimpact as fi
    >>> force = fi.PointForce("tip", fi.Sine(amplitude=0.01, frequency=5.0))
    >>> fi.integrate(system, force, fi.EventDriven(), duration=1.0).channels["tip"].size > 0
    True
    """

    at: str | float | LineLoad = field(metadata=PLACE_OR_LINE)
    history: Any
    name: str | None = field(default=None, metadata=optional(name_text()))

    def __post_init__(self) -> None:
        super().__post_init__()
        allowed = "must be a Sine, Chirp, SteppedSine, RandomBase, Shock, RecordedBase or a sum of motions of the base"
        good = all(hasattr(self.history, name) for name in MEMBERS) and not (
            hasattr(self.history, "at") or holds_drives(self.history) or isinstance(self.history, Rest)
        )
        require(good and not isinstance(self.history, type), "history", kind_of(self.history), "", allowed)
        for part in parts_of(self.history):
            allowed = "must have a closed form, and each part of a sum as well: sample it into a RecordedBase"
            require(force_form_of(part) is not None, "history", kind_of(part), "", allowed)
            by_force = not isinstance(part, Sine) or part.by == "amplitude"
            allowed = "must have an amplitude, in newtons: the acceleration of a sine is one of the base"
            require(by_force, "history", kind_of(part), "", allowed)

    @property
    def frequency(self) -> float:
        """Frequency of the force, Hz."""
        return float(self.history.frequency)

    @property
    def has_cycle(self) -> bool:
        """True if the history has a cycle."""
        return has_cycle(self.history)

    @property
    def phase(self) -> float:
        """Phase of the force at t = 0, rad."""
        return float(self.history.phase)

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force (N) at times in s."""
        if isinstance(self.history, Sum):
            return np.asarray(sum(replace(self, history=part).force(time) for part in parts_of(self.history)))
        form = self.closed_form
        if isinstance(form, Harmonic):
            return np.asarray(form.amplitude * np.sin(form.omega * times(time) + form.phase))
        return pieces_of(form).value(time)

    @property
    def closed_form(self) -> Any:
        """Force, N."""
        return force_form_of(self.history)


def LineForce(density: Any, history: Any, name: str | None = None) -> PointForce:  # noqa: N802
    """Force per length along the whole beam, the base at rest: q(x, t) = density(x) history(t).

    On a mode phi it does the work of a force at the tip of integral q phi dx/phi(tip). The loads of the nodes are the
    integrals of q with the cubic functions of the elements, by 8 Gauss points in each: exact for a density of degree
    12, while a jump of it inside an element costs up to a share of that element's load.

    Parameters
    ----------
    density : float or function, N/m
        Along +w, the same everywhere or a function of x (m), from the root.
    history : Sine, Chirp, SteppedSine, RandomBase, Shock, RecordedBase or Sum
        Of the density, a factor without a unit: what is a force in newtons in `PointForce`.
    name : str, optional
        Among several drives, without a dot or a slash; see `Drives`.

    Returns
    -------
    PointForce
        With a `LineLoad` as its place.
    """
    return PointForce(LineLoad(density), history, name)


@dataclass(frozen=True)
class HammerBlow(WithoutCycle, BaseAtRest):
    """Half a sine of force at one place, the base at rest: F = pi impulse/(2 duration) sin(pi (t - begin)/duration).

    The history is made of 12 polynomials of degree 5, within 1e-9 of its largest value.

    Parameters
    ----------
    at : str or float
        Named place, or metres from the root.
    impulse : float, N s
        Its sign is that of the force.
    duration : float, s
        Of the half sine.
    begin : float, s
        When it begins.
    name : str, optional
        Among several drives, without a dot or a slash; see `Drives`.
    """

    at: str | float = field(metadata=place())
    impulse: float = field(metadata=quantity("N s"))
    duration: float = field(metadata=quantity("s", above=0.0))
    begin: float = field(default=0.0, metadata=quantity("s", at_least=0.0))
    name: str | None = field(default=None, metadata=optional(name_text()))

    @property
    def frequency(self) -> float:
        """Frequency of the sine of which it is a half, Hz: a blow has no cycle."""
        return 0.5 / self.duration

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Force, N."""
        return half_sine(0.5 * np.pi * self.impulse / self.duration, self.duration, self.begin)

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force (N) at times in s."""
        return self.closed_form.value(time)


@dataclass(frozen=True)
class Drives:
    """A motion of the base and forces, all at the same time; `a + b` is one where a or b is a force.

    Its displacement, velocity and acceleration are those of the base. Forces at one place are one history. Sines of one
    frequency, of the base and of forces at any places, have a cycle and stay sines; all others have none, and the
    event-driven method takes sines among them as polynomials of degree 5, as in a `Sum`. The energy ledger has the
    work of each drive by its name.

    Parameters
    ----------
    base : Sine, Sum or another motion of the base, optional
        At rest without one.
    forces : sequence of PointForce and HammerBlow
        Names of forces, by default "force 1", "force 2" and so on in their order, differ.
    end : float, s, optional
        Up to when sines among others have a closed form; `integrate` sets it to the end of the run. It is no part of
        what the drives are.

    Examples
    --------
    >>> import femimpact as fi
    >>> drives = fi.Sine(1e-3, 5.0) + fi.HammerBlow("tip", impulse=0.01, duration=0.003, name="hammer")
    >>> drives.names
    ('base', 'hammer')
    """

    base: Any = None
    forces: Any = field(
        default=(),
        metadata=items(object) | {"allowed": "must be a list or a tuple of PointForce, HammerBlow and other forces"},
    )
    end: float | None = field(default=None, compare=False, metadata=optional(quantity("s", above=0.0)))

    def __post_init__(self) -> None:
        check_fields(self)
        if self.base is not None:
            require_excitation(self.base, "base")
            allowed = "must be a motion of the base: a force is one of forces, and a + b adds to several drives"
            require(not is_force(self.base) and not holds_drives(self.base), "base", kind_of(self.base), "", allowed)
        for force in self.forces:
            require_excitation(force, "forces")
            allowed = "must be a PointForce, a HammerBlow or another force at a place: a motion of the base is the base"
            require(is_force(force), "forces", kind_of(force), "", allowed)
        require(len(self.drives) > 0, "forces", None, "", "must be one or more where the base has no motion")
        names = self.names
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            allowed = (
                f'must differ from that of another drive; the motion of the base has the name "{BASE}", forces without '
                f'one have "force 1", "force 2" and so on in their order'
            )
            require(False, "forces.name", twice[0], "", allowed)
        allowed = "must differ from the name that the work of gravity and of other constant forces has"
        require(CONSTANT_FORCES not in names, "forces.name", CONSTANT_FORCES, "", allowed)

    @property
    def drives(self) -> tuple[Any, ...]:
        """The motion of the base, if it moves, then the forces."""
        return (*(() if self.base is None else (self.base,)), *self.forces)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the drives in their order."""
        names = [getattr(force, "name", None) for force in self.forces]
        of_forces = [name or f"force {number}" for number, name in enumerate(names, start=1)]
        return (*(() if self.base is None else (BASE,)), *of_forces)

    @property
    def frequency(self) -> float:
        """The highest one of the drives, Hz; that of a cycle where they share one."""
        return float(max(drive.frequency for drive in self.drives))

    @property
    def has_cycle(self) -> bool:
        """True if all drives are sines of one frequency."""
        return self._phase is not None

    @property
    def phase(self) -> float:
        """Phase at t = 0 of the base, or of the forces at the first place, rad; not a number without a cycle."""
        return math.nan if self._phase is None else self._phase

    @cached_property
    def _phase(self) -> float | None:
        drives = self.drives
        if not all(has_cycle(drive) and drive.frequency == drives[0].frequency for drive in drives):
            return None
        if self.base is not None:
            return float(self.base.phase)
        waves = [getattr(force, "closed_form", None) for force in self.forces if force.at == self.forces[0].at]
        wave = one_sine(waves)
        return float(self.forces[0].phase if wave is None or len(waves) == 1 else wave.phase)

    @property
    def _motion(self) -> Any:
        return BaseAtRest() if self.base is None else self.base

    @property
    def amplitude(self) -> float:
        """Largest displacement of the base, m."""
        return float(self._motion.amplitude)

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s."""
        return np.asarray(self._motion.displacement(time))

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s."""
        return np.asarray(self._motion.velocity(time))

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration (m/s^2) at times in s."""
        return np.asarray(self._motion.acceleration(time))

    @cached_property
    def closed_forms(self) -> tuple[Form, ...] | None:
        """Of every drive, m/s^2 or N, between the same knots; None where one has none."""
        return forms_together([_forms_of(drive) for drive in self.drives], self.end, self.base)

    __add__ = added
    __radd__ = added


def until(excitation: Any, end: float) -> Any:
    """An excitation with a closed form up to a time (s): of a sum, a force, drives or a `Rest`, others as they are."""
    if isinstance(excitation, PointForce) and isinstance(excitation.history, Sum):
        return replace(excitation, history=until(excitation.history, end))
    # that of the same end has its forms already
    if not isinstance(excitation, Sum | Drives | Rest) or (isinstance(end, float) and end == excitation.end):
        return excitation
    if isinstance(excitation, Sum | Rest):
        return replace(excitation, end=end)
    forces = tuple(until(force, end) for force in excitation.forces)
    return replace(excitation, base=until(excitation.base, end), forces=forces, end=end)


def alone(excitation: Any) -> Any:
    """The drive itself where there is but one of `Drives`; None is a `Rest`."""
    if excitation is None:
        return Rest()
    return excitation.drives[0] if isinstance(excitation, Drives) and len(excitation.drives) == 1 else excitation


def _forms_of(drive: Any) -> list[Form | None]:
    """Closed forms whose sum a drive is, m/s^2 or N."""
    if isinstance(drive, PointForce):
        return [force_form_of(part) for part in parts_of(drive.history)]
    return [getattr(part, "closed_form", None) for part in parts_of(drive)]


def named_parts(excitation: Any) -> Iterator[tuple[str, Any, Any]]:
    """The histories that an excitation is made of: which one it is, the drive that it belongs to, and itself.

    Which one is "part 2" of a sum, '"hammer"' of several drives, 'part 2 of "coil"', or "" where there is but one.
    """
    drives = getattr(excitation, "drives", (excitation,))
    for drive, name in zip(drives, getattr(excitation, "names", ("",) * len(drives)), strict=True):
        parts = parts_of(getattr(drive, "history", drive))
        for number, part in enumerate(parts, start=1):
            which = (f"part {number}" * (len(parts) > 1), f'"{name}"' if name else "")
            yield " of ".join(filter(None, which)), drive, part


def parts_in(excitation: Any) -> Iterator[Any]:
    """The histories that an excitation is made of: parts of sums, and of the drives."""
    return (part for _, _, part in named_parts(excitation))


def drive_words(excitation: Any) -> list[str]:
    """A line for each drive: its name, what it is, and its numbers with units."""
    lines = []
    drives = getattr(excitation, "drives", (excitation,))
    for name, drive in zip(getattr(excitation, "names", ("",)), drives, strict=True):
        unit = "1" if isinstance(getattr(drive, "at", None), LineLoad) else "N" if is_force(drive) else "m/s^2"
        words, numbers = words_of(drive), list(_numbers(getattr(drive, "history", drive), unit))
        if words.endswith(" Hz"):
            numbers = [text for text in numbers if not text.startswith("frequency ")]
        named = f"{f'{name}, ' * (name not in ('', 'base'))}{words}"
        lines.append("; ".join(filter(None, (named, ", ".join(numbers)))))
    return lines


def _of_density(history: Any, unit: str) -> Iterator[str]:
    """Density of a random drive, from its smallest to its largest, and its rms."""
    density = np.array([row[1] for row in history.psd])
    # that of a base in g too, as tests are asked for
    units = {"m/s^2": {"(m/s^2)^2/Hz": 1.0, "g^2/Hz": GRAVITY**-2}, "N": {"N^2/Hz": 1.0}}.get(unit, {"1/Hz": 1.0})
    for name, factor in units.items():
        ends = dict.fromkeys(typeset_number(factor * float(one), 3) for one in (density.min(), density.max()))
        yield f"{' to '.join(ends)} {name}"
    yield f"rms {unit_text(history.rms, unit)}"


def _numbers(history: Any, unit: str) -> Iterator[str]:
    """Numbers of a drive by their names, with units, where they are not those that it has by default."""
    for part in getattr(history, "parts", ()):
        yield from _numbers(part, unit)
    for item in fields(history) if is_dataclass(history) else ():
        value, name = getattr(history, item.name), item.name.replace("_", " ")
        if item.name in ("by", "at", "name", "parts", "end", "source") or value is None or value is item.default:
            continue
        own = item.metadata.get("unit") or ""
        if name in ("level", "amplitude"):
            own = unit if unit in ("N", "1") else "m" if "amplitude" in (name, getattr(history, "by", "")) else "m/s^2"
        if isinstance(value, (str, bool)):
            yield name if isinstance(value, bool) else value
        elif isinstance(value, (int, float)):
            if value != item.default:
                yield f"{getattr(history, 'by', name) if name == 'level' else name} {unit_text(value, own)}"
        elif name == "level":
            yield (
                f"level {unit_text(value[0][1], own)} at {value[0][0]:g} Hz to {unit_text(value[-1][1], own)} at "
                f"{value[-1][0]:g} Hz in {len(value)} rows"
            )
        elif name in ("psd", "frequencies"):
            f = np.ravel([row[0] if name == "psd" else row for row in value])
            yield f"{f.min():g} to {f.max():g} Hz" + (f" in {f.size} steps" if name == "frequencies" else "")
            yield from _of_density(history, unit) if name == "psd" else ()
        elif name == "samples":
            yield f"{np.size(value)} samples, largest {unit_text(float(np.abs(value).max()), unit)}"
        else:
            yield f"{np.size(value)} {name}"
    if isinstance(history, Chirp) and history.kind == "logarithmic":
        yield f"{typeset_number(60.0 * abs(math.log2(history.stop / history.start)) / history.duration)} oct/min"
    elif isinstance(history, Chirp):
        yield f"{typeset_number(abs(history.stop - history.start) / history.duration)} Hz/s"
