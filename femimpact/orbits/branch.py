"""The branch of periodic orbits over a parameter: its points, its bifurcations, its orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex
from femimpact.errors import (
    DivergenceError,
    Fault,
    InputError,
    check_fields,
    checked,
    choice,
    column,
    instance,
    items,
    made,
    optional,
    quantity,
    require,
    takes,
    text,
    warns,
)  # fmt: skip
from femimpact.orbits.curve import (
    LONGEST,
    Curve,
    LostError,
    Point,
    at_value,
    between,
    corrected,
    curve_of,
    evaluated,
    null_vectors,
)  # fmt: skip
from femimpact.orbits.equations import Solution, length_of, solve
from femimpact.orbits.following import CHANGES, CLOSED, Followed, follow, refusal
from femimpact.orbits.orbit import NEUTRAL, PeriodicOrbit, decays, parts_of
from femimpact.orbits.parameter import Parameter, parameter_of
from femimpact.orbits.search import first_guess, one_sine
from femimpact.orbits.verification import orbit_of, own_run
from femimpact.table import Head, frame_of, head_of_values, short_repr
from femimpact.units import number_text

if TYPE_CHECKING:
    import pandas
    import xarray


FAR_SMALLER = 0.1
"""Share of the unit of a branch below which that of one of its orbits asks for more digits."""

UNEXPLAINED = "unexplained"
"""Word in the tables for a change of stability at no bifurcation that was found."""

T = TypeVar("T")


def known(value: T | None, key: str) -> T:
    """What a branch from a file lacks.

    Raises `InputError` where it is None.
    """
    if value is None:
        allowed = "must be of a branch that was followed: one read from a file has no orbits"
        raise InputError([Fault(key, "read from a file", "", allowed)])
    return value


@dataclass(frozen=True, eq=False)
class Bifurcation:
    """A point of a branch at which orbits are born, or lose their stability, or an impact appears.

    Parameters
    ----------
    kind : str
        "fold", "period-doubling", "symmetry-breaking", "branch-point", "neimark-sacker", "grazing" or "sticking".
    value : float
        Of the parameter, to a relative 1e-10.
    point : Point or None
        Of the equations of the branch, from which `orbit` and `switch_branch` go on; none of a branch from a file.
    """

    kind: str = field(metadata=choice(*CHANGES, "grazing", "sticking"))
    value: float = field(metadata=quantity(""))
    point: Point | None = field(default=None, repr=False, metadata=optional(instance(Point)))

    def __post_init__(self) -> None:
        check_fields(self)

    @cached_property
    def orbit(self) -> PeriodicOrbit:
        """The orbit there, made when it is read. Its own run does not confirm it: rounding decides what that meets.

        At "grazing" and "sticking" its multipliers are no numbers to use: at no speed they are infinite.
        """
        point = known(self.point, "bifurcation")
        return _orbit(point.curve, point.x, is_bifurcation=True)


@short_repr
@dataclass(frozen=True, eq=False)
class Branch:
    """Periodic orbits over a parameter, in their order along the branch; both sheets of a fold are in it.

    Parameters
    ----------
    parameter : str
        Path of the parameter.
    unit : str
        Of the parameter.
    values : ndarray (points,)
        Of the parameter.
    multipliers : ndarray (points, 2(n+balls)), 1
        Of each orbit, as of `PeriodicOrbit`.
    peak : ndarray (points,), m
        Largest displacement of the place, relative to the base where its name says nothing else.
    first_harmonic : ndarray (points,), m
        Its component at the frequency of the excitation, a sum over 512 samples in the period of an orbit and at least
        64 in a cycle: exact to some 1e-5 of the peak, 1e-4 with 64.
    end : tuple of str
        Why the branch ends, at its first point and at its last.
    bifurcations : tuple of Bifurcation
        In their order; each is a point of the branch, too.
    bifurcation_points : ndarray (bifurcations,) of int
        Numbers of these points, from 0.
    place : str
        The place, ball or other channel, of which the displacement is.
    curve : Curve or None
        Equations of the branch, for `at` and `orbits`; none of a branch from a file.
    unknowns : ndarray (points, unknowns), 1, or None
        Those of each point: states after events in units of the smallest gap, phases of events, and the parameter.
    """

    parameter: str = field(metadata=text())
    unit: str = field(metadata=text())
    values: Array = field(metadata=column("", "points", finite=True))
    multipliers: Complex = field(metadata=column("1", "points", "multipliers", of="complex number"))
    peak: Array = field(metadata=column("m", "points"))
    first_harmonic: Array = field(metadata=column("m", "points"))
    end: tuple[str, str] = field(metadata=text(several=True))
    bifurcations: tuple[Bifurcation, ...] = field(metadata=items(Bifurcation))
    bifurcation_points: NDArray[np.int64] = field(metadata=column("1", "bifurcations", of="whole number"))
    place: str = field(metadata=text())
    curve: Curve | None = field(default=None, metadata=optional(instance(Curve)))
    unknowns: Array | None = field(default=None, metadata=optional(column("1", "points", "unknowns")))

    def __post_init__(self) -> None:
        check_fields(self)

    def __len__(self) -> int:
        return int(self.values.size)

    @property
    def is_stable(self) -> NDArray[np.bool_]:
        """True where every small disturbance decays, (points,), as of `PeriodicOrbit`."""
        return decays(self.multipliers)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Where the number of multipliers outside the unit circle changes and no bifurcation of the branch says why."""
        values = self.values.tolist()
        return tuple(
            f"between {self.parameter} = {values[i]:.10g} and {values[j]:.10g} the multipliers outside the unit circle "
            f"change from {before} to {after} in number, and no bifurcation that was found explains it"
            for i, j, before, after in self._unexplained
        )

    @property
    def orbits(self) -> Sequence[PeriodicOrbit]:
        """The orbit of each point, made and verified when it is read, as of `at`; a bifurcation's as of itself."""
        exempt = frozenset(self.bifurcation_points.tolist())
        return _Orbits(known(self.curve, "branch"), known(self.unknowns, "branch"), exempt)

    def at(self, value: float) -> tuple[PeriodicOrbit, ...]:
        """All orbits of the branch at a value of the parameter, in their order along it; none where it has none.

        Each is verified as one that `find_orbit` returns, unless an impact is so slow, below 1e-3 of a gap in a radian
        of the excitation, that rounding decides whether its run meets it.

        Raises
        ------
        InputError
            If the value is none that the parameter may have.
        DivergenceError
            If rounding keeps an orbit there from being found or confirmed, as beside a resonance without damping.
        """
        curve, unknowns = known(self.curve, "branch"), known(self.unknowns, "branch")
        value, found = checked("value", value, curve.parameter.allowed), list[PeriodicOrbit]()
        side = np.sign(self.values - value)
        # a closed branch ends with its first point
        for i in range(len(self) - (self.end[1] == CLOSED)):
            if side[i] == 0.0:
                found.append(self.orbits[i])
            elif side[i] * side[min(i + 1, len(self) - 1)] < 0.0:
                try:
                    found.append(_orbit(curve, between(curve, unknowns[i], unknowns[i + 1], value).x))
                except LostError as error:
                    words = f"{self.parameter} = {value:.10g}: an orbit of the branch is not found"
                    raise DivergenceError(f"{words}: {error}") from None
        return tuple(found)

    def to_pandas(self) -> pandas.DataFrame:
        """A row for every point, bifurcations by their kind; units in `attrs["units"]`.

        The point after a change of stability that `warnings` names is "unexplained".
        """
        kinds = self._kinds
        kinds[[j for _, j, *_ in self._unexplained]] = UNEXPLAINED
        columns: dict[str, Any] = {self.parameter: self.values, "peak": self.peak}
        columns |= {"first_harmonic": self.first_harmonic, "is_stable": self.is_stable}
        columns |= {"largest_multiplier": np.abs(self.multipliers[:, 0]), "bifurcation": kinds}
        units = {self.parameter: self.unit, "peak": "m", "first_harmonic": "m", "largest_multiplier": "1"}
        return frame_of(columns, units | {"is_stable": "", "bifurcation": ""})

    def to_xarray(self) -> xarray.Dataset:
        """The branch as a labelled dataset over its points, with the real and imaginary parts of its multipliers."""
        import xarray

        data: dict[str, Any] = {
            name: ("point", np.array(getattr(self, name)), {"units": "m", "long_name": name.replace("_", " ")})
            for name in ("peak", "first_harmonic")
        }
        data |= parts_of("multipliers", self.multipliers, "point", "multiplier")
        data["is_stable"] = ("point", self.is_stable)
        data["bifurcation"] = ("point", self._kinds)
        values = ("point", np.array(self.values), {"units": self.unit, "long_name": self.parameter})
        attributes = {"parameter": self.parameter, "place": self.place}
        attributes |= {"first_end": self.end[0], "last_end": self.end[1]}
        return xarray.Dataset(data, coords={"value": values}, attrs=attributes)

    @property
    def _kinds(self) -> NDArray[np.str_]:
        """Kind of the bifurcation at each point, an empty text where there is none."""
        kinds = np.full(len(self), "", dtype="<U17")
        kinds[self.bifurcation_points] = [each.kind for each in self.bifurcations]
        return kinds

    @property
    def _unexplained(self) -> list[tuple[int, int, int, int]]:
        """Points between which multipliers cross the unit circle unexplained, and how many are outside it at both."""
        outside = np.count_nonzero(np.abs(self.multipliers) > 1.0 + NEUTRAL, axis=1).tolist()
        found, last, crossed = list[tuple[int, int, int, int]](), -1, 0
        for i, kind in enumerate(self._kinds.tolist()):
            crossed += CHANGES.get(kind, 0)
            if kind:
                continue
            change = 0 if last < 0 else abs(outside[i] - outside[last])
            if change > crossed or (last >= 0 and (change - crossed) % 2):
                found.append((last, i, outside[last], outside[i]))
            last, crossed = i, 0
        return found

    @property
    def _head(self) -> Head:
        low, high = float(self.values.min()), float(self.values.max())
        unit = "" if self.unit == "1" else f" {self.unit}"
        values = {
            "values": f"{low:.6g} to {high:.6g}{unit}, {len(self)} points",
            "stable": f"{np.count_nonzero(self.is_stable)} of them",
            "bifurcations": ", ".join(f"{b.kind} {b.value:.6g}" for b in self.bifurcations) or "none",
            "first end": self.end[0],
            "last end": self.end[1],
        }
        values |= {"unexplained": "; ".join(self.warnings)} if self.warnings else {}
        return head_of_values(f"Branch of periodic orbits over {self.parameter}", values)


class _Orbits(Sequence[PeriodicOrbit]):
    """The orbits of a branch, each made when it is read."""

    def __init__(self, curve: Curve, unknowns: Array, bifurcations: frozenset[int]) -> None:
        self._curve, self._unknowns, self._bifurcations = curve, unknowns, bifurcations

    def __len__(self) -> int:
        return len(self._unknowns)

    @overload
    def __getitem__(self, number: int) -> PeriodicOrbit: ...

    @overload
    def __getitem__(self, number: slice) -> tuple[PeriodicOrbit, ...]: ...

    def __getitem__(self, number: int | slice) -> PeriodicOrbit | tuple[PeriodicOrbit, ...]:
        if isinstance(number, slice):
            return tuple(self[i] for i in range(*number.indices(len(self))))
        return _orbit(self._curve, self._unknowns[number], number % len(self) in self._bifurcations)


@warns
@takes(orbit=instance(PeriodicOrbit), points=quantity("1", at_least=2, at_most=10**6, integer=True))
def continue_orbit(
    orbit: PeriodicOrbit, parameter: str, to: tuple[float, float], *, points: int = 2000, of: str | None = None
) -> Branch:
    """The branch of periodic orbits through one of them, over a number of excitation, contacts, balls or damping.

    Followed both ways by pseudo-arclength: states, phases and the parameter are unknown together, so that a fold is a
    point as any other. A symmetric orbit is followed by its half map. Steps shrink where a multiplier near the unit
    circle moves by more than 0.1, where the number of unstable multipliers changes by more than the bifurcations found
    explain, and where multipliers cross the unit circle and come back. (Kuznetsov, 2004.)

    Parameters
    ----------
    parameter : str
        Path as in a study file: "base.frequency" (Hz) and "base.amplitude" (m, of a force N), also without "base.";
        "impactor.NAME.gap" (m, both walls); "impactor.NAME.contact.restitution"; of a `KelvinVoigt` contact also
        "impactor.NAME.contact.stiffness" (N/m), "impactor.NAME.contact.damping" (N s/m) and the numbers that its law
        was given with; the same of "stop.NAME". "impactor.NAME.mass" (kg). "damping.factor", by which the damping of
        the structure and the dashpots that hold balls are multiplied: 1 of the orbit, or what it is on the branch over
        this factor from which the orbit comes.
        What a law was given with beside its number that varies is held, also where the mass of the ball varies; where
        it was not given with the stiffness or the damping named, the other of both is held.
    to : pair of float
        Range of the parameter in which the branch is followed, with the orbit's own value in it.
    points : int
        Most points to each side of the orbit, itself among them.
    of : str, optional
        Place, ball or other displacement, as of `Recorder.channels`, whose largest value is kept. The default place;
        the first ball's in space, "ball.absolute_displacement", where no ball meets the beam, as at the root.

    Returns
    -------
    Branch
        Each orbit verified: an event-driven run over one period meets the same events and ends where it began. It ends
        at an edge of the range, where an impact has lost its speed, where the crest of a gap reaches a wall, or as its
        `end` says.

    Raises
    ------
    InputError
        If the system has no such number or displacement, or the number changes the modes.

    Examples
    --------
    >>> import femimpact as fi
    >>> ball = fi.Impactor("ball", "tip", mass=0.1, gap=10.0, contact=fi.Rigid(0.8))
    >>> box = fi.System.from_matrices([[1.0]], [[0.02]], [[1.0]], points={"tip": [1.0]}, impactors=[ball])
    >>> orbit, *_ = fi.orbits.two_impact_orbits(box, fi.PointForce("tip", fi.Sine(1.0, frequency=0.16)))
    >>> branch = fi.continue_orbit(orbit, "impactor.ball.gap", to=(6.0, 12.0))
    >>> breaking = branch.bifurcations[0]
    >>> print(f"{breaking.kind} at {breaking.value:.4f} m")
    symmetry-breaking at 7.7302 m
    >>> one, other = fi.orbits.switch_branch(breaking)
    >>> one.is_symmetric
    False
    """
    sine = one_sine(orbit.excitation)
    number = parameter_of(orbit.system, sine, parameter, of)
    low, high = _range(number, to)
    guess = first_guess(orbit.system, sine, orbit.cycles, orbit)
    length = length_of(number.hybrid, guess.states)
    curve = curve_of(number, guess.sequence, orbit.is_symmetric, length, high - low)
    # of an orbit without events the guess is one state
    found = solve(number.hybrid, guess, length).events
    start = at_value(curve, curve.unknowns(found.states, found.phases, number.value), number.value)
    if start is None:
        start = _beside(curve, curve.unknowns(guess.states, guess.phases, number.value))
    backward, first_end = follow(orbit.system, replace(start, tangent=-start.tangent), low, high, points)
    if first_end == CLOSED:
        return _branch(curve, backward[::-1], (CLOSED, CLOSED))
    forward, last_end = follow(orbit.system, start, low, high, points)
    return _branch(curve, [*backward[::-1], *forward[1:]], (first_end, last_end))


def _beside(curve: Curve, x: Array) -> Point:
    """The point a little along the curve from unknowns at which the equations fail at one value, as at a fold."""
    tangent = null_vectors(evaluated(curve, x, np.zeros(x.size)))[-1]
    start, change = corrected(curve, x + 0.1 * LONGEST * tangent, curve.weight * tangent)
    if start is None:
        words = f"no orbit found beside it: the last step of Newton's method changed it by {number_text(change, 2)}"
        raise DivergenceError(f"the orbit at {curve.parameter.path} = {x[-1]:.10g} begins no branch: {words}")
    return start


def _range(number: Parameter, to: Any) -> tuple[float, float]:
    """Both ends of a range.

    Raises `InputError` if it is none, or lacks the orbit's value.
    """
    to = to.tolist() if isinstance(to, np.ndarray) else to
    pair = isinstance(to, (tuple, list)) and len(to) == 2
    require(pair, "to", to, number.unit, "must be two numbers, the lowest and the highest value")
    low, high = (checked(f"to[{i}]", value, number.allowed) for i, value in enumerate(to))
    inside = low < high and low <= number.value <= high
    require(inside, "to", (low, high), number.unit, f"must rise, and have the orbit's {number.value:g} in it")
    return low, high


def _branch(curve: Curve, followed: list[Followed], end: tuple[str, str]) -> Branch:
    """The branch of points in their order."""
    points = [each.point for each in followed]
    numbers = [i for i, each in enumerate(followed) if each.kind]
    multipliers = np.array([point.multipliers for point in points])
    if curve.is_symmetric:
        with np.errstate(invalid="ignore"):
            # infinite where an impact has no speed
            multipliers = np.where(np.isfinite(multipliers), multipliers**2, multipliers)
    values = np.array([point.value for point in points])
    return made(
        Branch,
        parameter=curve.parameter.path,
        unit=curve.parameter.unit,
        values=values,
        multipliers=multipliers,
        peak=np.array([each.peak for each in followed]),
        first_harmonic=np.array([each.first_harmonic for each in followed]),
        end=end,
        bifurcations=tuple(
            made(Bifurcation, kind=followed[i].kind, value=float(values[i]), point=points[i]) for i in numbers
        ),
        bifurcation_points=np.array(numbers, dtype=np.int64),
        place=curve.parameter.place,
        curve=curve,
        unknowns=np.array([point.x for point in points]),
    )


def _orbit(curve: Curve, x: Array, is_bifurcation: bool = False) -> PeriodicOrbit:
    """The orbit of a point of a branch, confirmed by its own run unless rounding decides what that meets.

    Raises `DivergenceError` if it is not.
    """
    value = float(x[-1])
    system, excitation = curve.parameter.at(value)
    point = evaluated(curve, x, np.zeros_like(x))
    hybrid = point.maps.hybrid
    solution = Solution(hybrid, point.events, length_of(hybrid, point.events.states))
    if solution.length < FAR_SMALLER * curve.unit[0] and not is_bifurcation:
        # it has the digits of a larger unit
        nearer = solve(hybrid, solution.events, solution.length)
        solution = nearer if nearer.converged else solution
    run = own_run(system, excitation, solution)
    error = None if is_bifurcation else refusal(point, run)
    if error is not None:
        raise DivergenceError(f"{curve.parameter.path} = {value:.10g}: {error}")
    return orbit_of(system, excitation, solution, run)
