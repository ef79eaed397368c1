"""The state at the start of a run: displacements and velocities, or the static state, and its time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import (
    check_fields,
    choice,
    column,
    having,
    instance,
    optional,
    place,
    quantity,
    real_array,
    require,
    takes,
    truth,
)
from femimpact.excitation.excitation import MEMBERS, Excitation
from femimpact.structure.structure import Position
from femimpact.system.matrices import rigid_motions
from femimpact.system.modes import mode_count, solve_modes, solve_stiffness
from femimpact.system.static import StaticContacts, static_contacts
from femimpact.system.system import System


@dataclass(frozen=True, eq=False)
class Continuation:
    """Data of a finished run with which its method continues it; only that method reads them."""

    kind: object  # equal for methods that can go on from `held`
    held: Any  # arrays that the method made
    # pair of ndarray: of the dofs (dofs,) and of the balls (balls,) relative to the base at that time, m and m/s
    displacements: tuple[Array, Array]
    velocities: tuple[Array, Array]  # pair of ndarray
    time: float  # s
    system: Any
    excitation: Excitation
    touching: tuple[str, ...] = ()  # names of the contacts in progress, sticking ones included

    def has_contacts_of(self, system: Any, excitation: Excitation, time: float) -> bool:
        """True if contacts in progress are those of a system under an excitation from a time (s) on.

        The cavities of balls move with a base that jumps, a stop that is fixed in space does not.
        """
        alone = all(pair.fixed_to == "base" for pair in system.contacts)
        return _same_contacts(self.system, system) and (alone or self._same_drive(excitation, time))

    def has_equations_of(self, system: Any, excitation: Excitation, time: float) -> bool:
        """True if all equations are those of the run, so that accelerations too go on as they are."""
        return self._same_drive(excitation, time) and _same_equations(self.system, system)

    def _same_drive(self, excitation: Excitation, time: float) -> bool:
        return time == self.time and same_excitation(self.excitation, excitation)


def begun_anew(left: Continuation | None, going_on: Collection[str]) -> tuple[str, ...]:
    """A note on contacts in progress at the end of a run, but for those that go on in the one that began there."""
    names = [] if left is None else [name for name in left.touching if name not in going_on]
    if not names:
        return ()
    return (
        f"the initial state is inside a contact of {', '.join(names)}, which begins anew: the state was left by "
        "another method, on another system or under another excitation, or its values were changed",
    )


def same_excitation(first: Any, second: Any) -> bool:
    """True if two excitations are one: the same object, equal ones, or equal samples at the same place."""
    if first is second:
        return True
    if type(first) is not type(second):
        return False
    if hasattr(first, "drives"):
        pairs = zip(first.drives, second.drives, strict=False)
        return first.names == second.names and all(same_excitation(*pair) for pair in pairs)
    lines = [getattr(item, "closed_form", None) for item in (first, second)]
    if all(hasattr(line, "samples") for line in lines):
        places = [getattr(item, "at", None) for item in (first, second)]
        rest = [(line.interval, line.initial_velocity) for line in lines if line is not None]
        return places[0] == places[1] and rest[0] == rest[1] and np.array_equal(*(line.samples for line in lines))  # type: ignore[union-attr]
    return bool(np.all(first == second))


def _same_contacts(first: Any, second: Any) -> bool:
    if first is second or first.contacts is second.contacts:
        return True
    names = ("name", "gaps", "law", "mass", "fixed_to", "free_stiffness", "free_damping", "acceleration")
    return len(first.contacts) == len(second.contacts) and all(
        all(getattr(a, name) == getattr(b, name) for name in names) and np.array_equal(a.direction, b.direction)
        for a, b in zip(first.contacts, second.contacts, strict=True)
    )


def _same_equations(first: Any, second: Any) -> bool:
    if first is second:
        return True
    if first.dofs != second.dofs or not _same_contacts(first, second):
        return False
    loads = all(np.array_equal(getattr(first, name), getattr(second, name)) for name in ("base_load", "constant_load"))
    return loads and all((getattr(first, name) != getattr(second, name)).nnz == 0 for name in ("M", "C", "K"))


ROUNDED = 1e-12
"""Distance (m) by which rounding may put a start beyond a wall."""

STILL = 1e-9
"""Share of the largest motion of a mode below which a place is at rest in it, but for rounding."""

SYSTEM, BASE = instance(System), having("an excitation", MEMBERS)


def _at_place(unit: str) -> dict[str, Any]:
    """Metadata of a field that holds None, or a place and a number in a unit."""
    at, size = place(), quantity(unit)
    allowed = f"must be a place and a finite number in {unit}: {at['allowed']}"

    def take(pair: Any) -> tuple[Position, float]:
        name, number = pair if isinstance(pair, tuple) and len(pair) == 2 else (None, None)
        return at["take"](name), size["take"](number)

    return optional({"unit": unit, "allowed": allowed, "take": take})


STATIC_FRAME = "must be 'base' for a static start: the static state is one relative to the base"


@dataclass(frozen=True, eq=False)
class State:
    """Displacements and velocities at the start of a run, and its time.

    `Response.final_state` is one that carries what the run has reached beyond them. The same method goes on from it:
    on the same system under the same excitation two halves equal one run, in other cases as far as it still holds.
    Contacts in progress go on where the contacts are the same (and, of stops fixed in space, the excitation and the
    time). Of another method, and of values that were replaced, the displacements and velocities alone are used, and a
    response says so where that begins a contact anew.

    Where a stop is preloaded (a negative gap), a start without `displacement` is the static state: undeformed, the
    structure would be inside the stop.

    A start may lie beyond a compliant wall, as a state within a contact does. The contact is then in progress: its law
    pushes from the start on, or the pair leaves without force where k p + c p' of `KelvinVoigt` would pull, and the
    energy V(p) of the wall is there at the start. A law that takes the approach speed v0 of its contact takes
    sqrt(p'^2 + 2 V(p)/m), with which a pair of the effective mass m would have met the wall without loss. The row of
    that contact in the table of impacts counts from the start on.

    Parameters
    ----------
    displacement, velocity : array_like (dofs,), optional
        Of the structure's dofs (m, m/s); None is zero, or of displacements the static state.
    ball_displacement, ball_velocity : array_like (balls,), optional
        m and m/s, in the order of `System.contacts`; None is zero, or of displacements the static state.
    frame : {"base", "space"}
        Whether the values are relative to the moving base or absolute.
    equilibrium : bool
        Whether displacements that are not given are those of the static state (`State.static`), relative to the
        base, in place of zero.
    time : float, s
        When the run begins: the excitation is taken from there on, and all times of the response are counted from 0 s.
    pull, blow : (str or float, float), optional
        A place, and its displacement (m) of `State.pulled` or its speed (m/s) of `State.struck`.
    continuation : Continuation, optional
        What the run that ended here has left to its method; None for a state made by hand.

    Raises
    ------
    InputError
        If the state is both static and at rest in the inertial frame.
    """

    displacement: Any = field(default=None, metadata=column("m", "dofs", finite=True))
    velocity: Any = field(default=None, metadata=column("m/s", "dofs", finite=True))
    ball_displacement: Any = field(default=None, metadata=column("m", "balls", finite=True))
    ball_velocity: Any = field(default=None, metadata=column("m/s", "balls", finite=True))
    frame: str = field(default="base", metadata=choice("base", "space"))
    equilibrium: bool = field(default=False, metadata=truth())
    time: float = field(default=0.0, metadata=quantity("s", at_least=0.0))
    pull: tuple[Position, float] | None = field(default=None, metadata=_at_place("m"))
    blow: tuple[Position, float] | None = field(default=None, metadata=_at_place("m/s"))
    continuation: Continuation | None = field(default=None, repr=False, metadata=optional(instance(Continuation)))

    def __post_init__(self) -> None:
        for item in fields(self)[:4]:
            value = getattr(self, item.name)
            if value is not None:
                # one number for one dof; a copy, for what is frozen does not follow the caller's array
                array = np.atleast_1d(real_array(item.name, value, item.metadata["unit"], item.metadata["allowed"]))
                array.setflags(write=False)
                object.__setattr__(self, item.name, array)
        check_fields(self)
        sound = not self.equilibrium or self.frame == "base"
        require(sound, "frame", self.frame, "", STATIC_FRAME)
        for name, given in (("pull", self.displacement), ("blow", self.velocity)):
            twice = getattr(self, name) is not None and (given is not None or (name == "pull" and self.equilibrium))
            require(not twice, name, getattr(self, name), "", "must be left out where that of dofs is given")

    @classmethod
    def static(cls) -> State:
        """Structure and balls at rest in static equilibrium: constant forces, contacts and preloaded stops."""
        return cls(equilibrium=True)

    @classmethod
    def at_rest(cls, frame: str = "base") -> State:
        """Beam and balls at rest in the frame of the base, or in space."""
        return cls(frame=frame)

    @classmethod
    @takes(
        system=SYSTEM, mode=quantity("1", at_least=1, integer=True), amplitude=quantity("m"), at=place()
    )  # fmt: skip
    def of_mode(cls, system: System, mode: int, amplitude: float, at: Position | None = None) -> State:
        """The structure at rest in the shape of one of its modes: w(x) = amplitude phi_k(x)/phi_k(at).

        Parameters
        ----------
        system : System
        mode : int
            From 1 on.
        amplitude : float, m
            Deflection of the place.
        at : str or float, optional
            The tip by default, or the first place of a system without one.

        Returns
        -------
        State
            Balls are in the middle of their boxes, at rest.

        Raises
        ------
        InputError
            If the system has no such mode, or the place is at rest in it.
        """
        name = system.default_place if at is None else at
        mode = mode_count(system, mode, "mode")
        row, shape = system.point_row(name), solve_modes(system, mode).vectors[:, mode - 1]
        moved = float(row @ shape)
        still = abs(moved) <= STILL * float(np.linalg.norm(row) * np.linalg.norm(shape))
        require(not still, "at", name, "", f"must be a place that moves in mode {mode}")
        return cls._with_balls(system, amplitude / moved * shape)

    @classmethod
    @takes(system=SYSTEM, force=quantity("N"), at=place())
    def under_force(cls, system: System, force: float, at: Position | None = None) -> State:
        """The structure at rest as a force bends it, K u = b F + constant forces; the force lets go at the start.

        Parameters
        ----------
        system : System
            Its contacts do not act: a run refuses a start beyond rigid walls.
        force : float, N
            Along the deflection.
        at : str or float, optional
            The tip by default, or the first place of a system without one.

        Returns
        -------
        State
            Balls are in the middle of their boxes, at rest.

        Raises
        ------
        InputError
            If the structure can move as a rigid body, or the place is unknown.
        """
        name = system.default_place if at is None else at
        own, of_force = _bent(system, name)
        return cls._with_balls(system, own + force * of_force)

    @classmethod
    def _with_balls(cls, system: System, u: Array) -> State:
        """The structure at rest where it is displaced (m), each ball in the middle of the box that it carries along."""
        carried = _carried(system, u)
        return cls(displacement=u, ball_displacement=carried if carried.size else None)

    @classmethod
    @takes(at=place(), displacement=quantity("m"))
    def pulled(cls, at: Position, displacement: float, ball_displacement: ArrayLike | None = None) -> State:
        """The structure at rest as a force at a place bends it; the force lets go at the start.

        K u = b F + constant forces, with F such that b^T u = displacement. The system's contacts do not act, and a run
        refuses a start beyond rigid walls, and a structure that is not held.

        Parameters
        ----------
        at : str or float
            Named place, or metres from the root.
        displacement : float, m
            Of the place.
        ball_displacement : array_like (balls,), optional
            m, relative to the base, in the order of `System.contacts`; None is the middle of each box where the bent
            structure carries it.
        """
        return cls(pull=(at, displacement), ball_displacement=ball_displacement)

    @classmethod
    @takes(at=place(), speed=quantity("m/s"))
    def struck(cls, at: Position, speed: float) -> State:
        """The structure undeformed as an ideal blow at a place leaves it; balls at rest.

        v = M^-1 b J with the impulse J = speed/(b^T M^-1 b) (N s). Of a reduced system M^-1 is that of the modes kept,
        v = speed sum phi_k phi_k(at)/sum phi_k(at)^2: J becomes less with each further mode, and settles only where a
        body stands at the place. Where J is known, `HammerBlow` is a blow of some length.

        Parameters
        ----------
        at : str or float
            Named place, or metres from the root.
        speed : float, m/s
            Of the place, along the deflection.
        """
        return cls(blow=(at, speed))

    @classmethod
    @takes(system=SYSTEM, speed=quantity("m/s"))
    def with_speed(cls, system: System, speed: float) -> State:
        """Structure and balls undeformed, all with one speed relative to the base: as if the base had been stopped.

        Parameters
        ----------
        system : System
            Of a reduced one the modes kept have their part of that motion.
        speed : float, m/s
        """
        return cls(velocity=speed * system.rigid_translation, ball_velocity=np.full(len(system.balls), speed))

    @property
    def is_at_rest(self) -> bool:
        """True if nothing moves, or is displaced from where the state's frame or equilibrium has it."""
        fields = (self.displacement, self.velocity, self.ball_displacement, self.ball_velocity)
        return self.pull is self.blow is None and all(values is None or not np.any(values) for values in fields)

    @takes(system=SYSTEM)
    def is_static_on(self, system: System) -> bool:
        """True if displacements that are not given are those of the static state of a system."""
        preloaded = any(pair.is_preloaded for pair in system.contacts)
        return self.equilibrium or (self.displacement is None and self.pull is None and preloaded)

    @takes(system=SYSTEM, base=BASE)
    def static_contacts(self, system: System, base: Excitation) -> StaticContacts | None:
        """Static state of a system with its contact forces; None where `is_static_on` is False."""
        if not self.is_static_on(system):
            return None
        require(self.frame == "base", "initial.frame", self.frame, "", STATIC_FRAME)
        return static_contacts(system, float(base.displacement(self.time)))

    @takes(system=SYSTEM, base=BASE)
    def left_by_run(self, system: System, base: Excitation) -> Continuation | None:
        """The continuation left by the run that ended here, if values and contacts are still those of that run."""
        left = self._left_there(system, base)
        same = left is not None and _are_equal((self.velocity, self.ball_velocity), left.velocities)
        return left if same else None

    def _left_there(self, system: System, base: Excitation) -> Continuation | None:
        """The same whatever the velocities are now."""
        left = self.continuation
        if left is None or self.frame != "base" or not left.has_contacts_of(system, base, self.time):
            return None
        return left if _are_equal((self.displacement, self.ball_displacement), left.displacements) else None

    @takes(system=SYSTEM, base=BASE)
    def relative_to_base(self, system: System, base: Excitation) -> tuple[Array, Array, Array, Array]:
        """u, u', y, y' at the start relative to the base (m and m/s), checked for size and gaps.

        y and y' have one entry for each contact pair: zero for stops that are fixed to the base, ub and ub' for
        those fixed in space, y_a - y_b and its rate for balls that meet. Rigid contacts start between their walls, to
        1e-12 m, but where a run has left them; compliant ones anywhere (`State`).

        Raises
        ------
        InputError
            If values are not one for each dof or ball, or a contact starts beyond a rigid wall.
        """
        balls, stops = len(system.balls), system.contacts[len(system.balls) :]
        rest = self.static_contacts(system, base)
        still, placed = (None, None) if rest is None else (rest.displacement, rest.other[:balls])
        if self.pull is not None:
            still, placed = _pulled(system, *self.pull)
        u = _vector(self.displacement, system.dofs, "initial.displacement", "m", still)
        moved = None if self.blow is None else _struck(system, *self.blow)
        v = _vector(self.velocity, system.dofs, "initial.velocity", "m/s", moved)
        y = _vector(self.ball_displacement, balls, "initial.ball_displacement", "m", placed)
        y_rate = _vector(self.ball_velocity, balls, "initial.ball_velocity", "m/s")
        if self.frame == "space":
            offset, speed = float(base.displacement(self.time)), float(base.velocity(self.time))
            u, v = u - offset * system.rigid_translation, v - speed * system.rigid_translation
            y, y_rate = y - offset, y_rate - speed
        in_space = np.array([float(pair.fixed_to == "space") for pair in stops])
        y = np.concatenate([y, in_space * float(base.displacement(self.time))])
        y_rate = np.concatenate([y_rate, in_space * float(base.velocity(self.time))])
        for j, (first, second) in system.meetings.items():
            y[j], y_rate[j] = y[first] - y[second], y_rate[first] - y_rate[second]
        if self._left_there(system, base) is not None:
            return u, v, y, y_rate
        for j, pair in enumerate(system.contacts):
            if not pair.parameters.is_rigid:
                continue
            x = float(y[j] - pair.direction @ u)
            own = "" if pair.is_stop else "ball_displacement of State less "
            reach = f"{-pair.gaps[1]:g} to {pair.gaps[0]:g} m"
            allowed = f"must start between its walls, {reach}; it is {own}the beam's displacement there"
            if pair.between:
                allowed = f"must be at most {pair.gaps[0]:g} m; it is y of {' less y of '.join(pair.between)}"
            inside = -pair.gaps[1] - ROUNDED <= x <= pair.gaps[0] + ROUNDED
            require(inside, f"initial.{pair.name}.gap", x, "m", allowed)
        return u, v, y, y_rate


def _carried(system: System, u: Array) -> Array:
    """Places (m) of the balls in the middle of the boxes that a displaced structure carries along."""
    middles = [0.5 * (pair.gaps[0] - pair.gaps[1]) if np.all(np.isfinite(pair.gaps)) else 0.0 for pair in system.balls]
    return np.array([pair.direction @ u + middle for pair, middle in zip(system.balls, middles, strict=True)])


def _bent(system: System, at: Position) -> tuple[Array, Array]:
    """Displacements (dofs,) by constant forces (m), and by a force of 1 N at a place."""
    held = rigid_motions(system).shape[1] == 0
    require(held, "system", "one with rigid motions", "", "must be held: a force moves what is free without end")
    loads = np.column_stack([system.constant_load, system.point_row(at)])
    own, of_force = solve_stiffness(system, loads).T
    return own, of_force


def _pulled(system: System, at: Position, displacement: float) -> tuple[Array, Array]:
    """Displacements of the structure and of the balls in it; see `State.pulled`."""
    own, of_force = _bent(system, at)
    u = own + (displacement - own @ system.point_row(at)) * _along(system, of_force, "initial.pull", at)
    return u, _carried(system, u)


def _struck(system: System, at: Position, speed: float) -> Array:
    """Velocities of the structure; see `State.struck`."""
    from scipy.sparse.linalg import spsolve

    row = system.point_row(at)
    return speed * _along(system, spsolve(system.M.tocsc(), row), "initial.blow", at)


def _along(system: System, motion: Array, key: str, at: Position) -> Array:
    """A motion of the structure (dofs,) scaled so that a place moves by 1."""
    row = system.point_row(at)
    moved = float(row @ motion)
    still = moved <= STILL**2 * float(np.linalg.norm(row) * np.linalg.norm(motion))
    require(not still, key, at, "", "must be a place that moves")
    return motion / moved


def _are_equal(own: tuple[Array | None, ...], reference: tuple[Array, ...]) -> bool:
    return all(values is not None and np.array_equal(values, left) for values, left in zip(own, reference, strict=True))


def _vector(values: ArrayLike | None, size: int, key: str, unit: str, default: Array | None = None) -> Array:
    allowed = f"must hold {size} finite numbers"
    if values is None:
        return np.zeros(size) if default is None else np.array(default)
    array = np.atleast_1d(real_array(key, values, unit, allowed))
    require(array.shape == (size,), key, f"array of shape {array.shape}", unit, allowed)
    return array
