"""Sums of motions of the base."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import check_fields, items, optional, quantity, require
from femimpact.excitation.excitation import MEMBERS, BrokenLine, Harmonic, holds_drives, is_force, require_excitation
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, fitted, pieces_of

Form = Harmonic | BrokenLine | PiecewisePolynomial

BEYOND = 2
"""Pieces of sines after the end of a run: it may end by half a reading, or half a step, later."""

PHASE_OF_SINE = 0.135
"""Phase of the fastest sine of a sum in one piece, rad: its polynomials of degree 5 are then within 1e-11 of it."""

MOST_PIECES = 50_000_000
"""Most pieces of sines in a sum, which take some gigabytes: a sum with more has no closed form."""


CANCELLED = 1e-15
"""Share of the amplitudes of sines below which that of their sum is rounding."""


@dataclass(frozen=True)
class Sum:
    """Motions of the base at the same time: displacement, velocity and acceleration are sums of those of the parts.

    `a + b` is one. A sum of sines of one frequency is a sine; other sums have no cycle. For the event-driven method,
    sines are then made of polynomials of degree 5, 47 in a cycle of the fastest one, up to the end of the run. As the
    history of a `PointForce` it is the sum of the forces that its parts are.

    Parameters
    ----------
    parts : sequence of excitations
        Motions of the base, each a `Sine` or another one with a closed form.
    end : float, s, optional
        Up to when the sines have a closed form; `integrate` sets it to the end of the run. It is no part of what the
        sum is: two sums that differ in it alone are equal.
    """

    parts: Any = field(metadata=items(object) | {"allowed": "must be a list or a tuple of motions of the base"})
    end: float | None = field(default=None, compare=False, metadata=optional(quantity("s", above=0.0)))

    def __post_init__(self) -> None:
        check_fields(self)
        require(len(self.parts) > 0, "parts", None, "", "must be one or more motions of the base")
        for part in self.parts:
            require_excitation(part, "parts")
            allowed = "must be motions of the base: a force acts elsewhere; PointForce(at, a + b) is a sum of forces"
            require(not is_force(part), "parts", type(part).__name__, "", allowed)
            allowed = "must be motions of the base: a + b adds to several drives, and keeps their forces"
            require(not holds_drives(part), "parts", type(part).__name__, "", allowed)

    @property
    def _harmonic(self) -> Harmonic | None:
        """The sum as one sine of the acceleration, where all parts are sines of one frequency."""
        return one_sine([getattr(part, "closed_form", None) for part in parts_of(self)])

    @property
    def frequency(self) -> float:
        """The highest one of the parts, Hz; that of a cycle where they share one."""
        return float(max(part.frequency for part in self.parts))

    @property
    def has_cycle(self) -> bool:
        """True if all parts are sines of one frequency."""
        return self._harmonic is not None

    @property
    def phase(self) -> float:
        """Phase of the displacement at t = 0 where all are sines of one frequency, rad; else not a number."""
        wave = self._harmonic
        return math.nan if wave is None else (wave.phase + 2.0 * np.pi) % (2.0 * np.pi) - np.pi

    @property
    def amplitude(self) -> float:
        """Largest displacement, m, if those of all parts met."""
        return float(sum(part.amplitude for part in self.parts))

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s."""
        return np.asarray(sum(part.displacement(time) for part in self.parts))

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s."""
        return np.asarray(sum(part.velocity(time) for part in self.parts))

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration (m/s^2) at times in s."""
        return np.asarray(sum(part.acceleration(time) for part in self.parts))

    @cached_property
    def closed_form(self) -> Form | None:
        """Acceleration of the base, m/s^2; None where a part has none, or sines have no end or one that is too late."""
        return self._sum_of([getattr(part, "closed_form", None) for part in parts_of(self)], self)

    @cached_property
    def force_form(self) -> Form | None:
        """Sum of the forces (N) that the parts are; None as of `closed_form`."""
        return self._sum_of([force_form_of(part) for part in parts_of(self)])

    def _sum_of(self, forms: Sequence[Form | None], motion: Sum | None = None) -> Form | None:
        sums = forms_together([forms], self.end, motion)
        return None if sums is None else sums[0]

    def __add__(self, other: Any) -> Any:
        return added(self, other)


def added(first: Any, second: Any) -> Any:
    """Both excitations at once: a `Sum` of motions of the base, `Drives` where there is a force."""
    from femimpact.excitation.drives import Drives, Rest  # which are made of sums

    if any(not hasattr(second, name) for name in MEMBERS):
        return NotImplemented
    drives = [drive for item in (first, second) for drive in getattr(item, "drives", (item,))]
    moving = (drive for drive in drives if not (is_force(drive) or isinstance(drive, Rest)))
    bases = [part for drive in moving for part in parts_of(drive)]
    forces = tuple(drive for drive in drives if is_force(drive))
    base = Sum(tuple(bases)) if len(bases) > 1 else bases[0] if bases else None
    return Drives(base, forces) if forces else base or first


def parts_of(history: Any) -> tuple[Any, ...]:
    """The histories that a sum is made of, those of its sums in their place; of another history itself."""
    if not isinstance(history, Sum):
        return (history,)
    return tuple(itertools.chain.from_iterable(map(parts_of, history.parts)))


def force_form_of(history: Any) -> Form | None:
    """Closed form of a history read as a force (N): that of its level, else of its acceleration; None without one."""
    force_form: Form | None = getattr(history, "force_form", None)
    return getattr(history, "closed_form", None) if force_form is None else force_form


def one_sine(forms: Sequence[Form | None]) -> Harmonic | None:
    """A sum of sines of one frequency."""
    sines = [form for form in forms if isinstance(form, Harmonic)]
    if len(sines) < len(forms) or len({form.omega for form in sines}) > 1:
        return None
    phasor = sum(form.amplitude * np.exp(1j * form.phase) for form in sines)
    if abs(phasor) <= CANCELLED * sum(abs(form.amplitude) for form in sines):
        phasor = 0.0
    return Harmonic(float(abs(phasor)), sines[0].omega, float(np.angle(phasor)))


def forms_together(
    groups: Sequence[Sequence[Form | None]],
    end: float | None,  # s, up to which sines are in pieces
    motion: Any = None,  # of the base, where that is the first group
) -> tuple[Form, ...] | None:
    """The sum of each group of closed forms: all are sines of one frequency, or in pieces between common knots.

    None as of `Sum.closed_form`.
    """
    forms = [form for group in groups for form in group]
    if one_sine(forms) is not None:
        return tuple(cast(Harmonic, one_sine(group) if len(group) > 1 else group[0]) for group in groups)
    if any(form is None for form in forms):
        return None
    fastest = max((form.omega for form in forms if isinstance(form, Harmonic)), default=None)
    of_sines: Array | None = None
    if fastest is not None:
        # of one length whatever the end: a run that goes on has the same pieces
        length = PHASE_OF_SINE / fastest
        if end is None or end / length > MOST_PIECES:
            return None
        of_sines = np.asarray(length * np.arange(math.ceil(end / length) + BEYOND + 1))
    in_pieces = [_in_pieces(group, of_sines) for group in groups]
    knots = _distinct(np.concatenate([pieces.knots for pieces in itertools.chain(*in_pieces)]))
    if of_sines is not None:
        # beyond their last piece the others are too long for a sine
        knots = knots[knots <= of_sines[-1]]
    degree = max(pieces.degree for pieces in itertools.chain(*in_pieces))
    sums = [sum(_coefficients_between(pieces, knots, degree) for pieces in group) for group in in_pieces]
    first = None if motion is None else np.column_stack([motion.displacement(knots), motion.velocity(knots)])
    return tuple(PiecewisePolynomial(knots, c, starts=None if i else first) for i, c in enumerate(sums))


def _in_pieces(forms: Sequence[Form | None], of_sines: Array | None) -> list[PiecewisePolynomial]:
    """Closed forms as polynomials, those of sines as one sum between their knots (s)."""
    polynomials = [pieces_of(form) for form in forms if isinstance(form, BrokenLine | PiecewisePolynomial)]
    sines = [form for form in forms if isinstance(form, Harmonic)]
    if not sines:
        return polynomials

    def history(time: Array) -> Array:
        return sum((form.amplitude * np.sin(form.omega * time + form.phase) for form in sines), np.zeros(time.shape))

    return [*polynomials, fitted(history, cast(Array, of_sines))]


def _coefficients_between(pieces: PiecewisePolynomial, knots: Array, degree: int) -> Array:
    """Coefficients (n, degree + 1) of polynomials between further knots (s): those of each, about another time.

    Values at points of a short piece would give derivatives of nothing but rounding.
    """
    number = np.searchsorted(pieces.knots, 0.5 * (knots[1:] + knots[:-1]), side="right") - 1
    acts = (number >= 0) & (number < pieces.knots.size - 1)
    number = np.where(acts, number, 0)
    later = knots[:-1] - pieces.knots[number]
    coefficients = np.zeros((number.size, degree + 1))
    coefficients[:, : pieces.degree + 1] = np.where(acts[:, None], pieces.coefficients[number], 0.0)
    # Horner's scheme, once for each coefficient
    for lowest in range(pieces.degree):
        for n in range(pieces.degree - 1, lowest - 1, -1):
            coefficients[:, n] += later * coefficients[:, n + 1]
    return coefficients


def _distinct(knots: Array) -> Array:
    """Rising times of which none are nearer to one another than rounding."""
    rising = np.unique(knots)
    apart = np.diff(rising) > 1e-12 * np.abs(rising[1:])
    return np.asarray(rising[np.concatenate([[True], apart])])
