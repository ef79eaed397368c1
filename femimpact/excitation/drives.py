"""Several drives at once: a motion of the base and forces at places."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import check_fields, items, kind_of, optional, quantity, require
from femimpact.excitation.excitation import has_cycle, holds_drives, is_force, require_excitation, times
from femimpact.excitation.forces import PointForce
from femimpact.excitation.sums import Form, Sum, added, force_form_of, forms_together, one_sine, parts_of

BASE = "base"
"""Name of the motion of the base among the drives."""

CONSTANT_FORCES = "constant forces"
"""Name of their work beside that of the drives."""


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

    Raises
    ------
    InputError
        If there is no drive, the base is a force or several drives, a force is none, two drives have one name, or one
        has that of the constant forces.

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
    def amplitude(self) -> float:
        """Largest displacement of the base, m."""
        return 0.0 if self.base is None else float(self.base.amplitude)

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s."""
        return np.zeros_like(times(time)) if self.base is None else np.asarray(self.base.displacement(time))

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s."""
        return np.zeros_like(times(time)) if self.base is None else np.asarray(self.base.velocity(time))

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration (m/s^2) at times in s."""
        return np.zeros_like(times(time)) if self.base is None else np.asarray(self.base.acceleration(time))

    def until(self, end: float) -> Drives:
        """The same with closed forms up to a time (s)."""
        if isinstance(end, float) and end == self.end:
            # with the forms that it has
            return self
        return replace(self, base=until(self.base, end), forces=tuple(until(f, end) for f in self.forces), end=end)

    @cached_property
    def closed_forms(self) -> tuple[Form, ...] | None:
        """Of every drive, m/s^2 or N, between the same knots; None where one has none."""

        def starts(knots: Array) -> Array:
            return np.column_stack([self.displacement(knots), self.velocity(knots)])

        groups = [_forms_of(drive) for drive in self.drives]
        return forms_together(groups, self.end, None if self.base is None else starts)

    __add__ = added
    __radd__ = added


def until(excitation: Any, end: float) -> Any:
    """An excitation with a closed form up to a time (s): of a sum, a force or several drives, others as they are."""
    return excitation.until(end) if isinstance(excitation, Sum | PointForce | Drives) else excitation


def alone(excitation: Any) -> Any:
    """The drive itself where there is but one of `Drives`."""
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
