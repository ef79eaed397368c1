"""The structure on the shaker: its parts and places; numbers of it that may be meant in another unit."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from femimpact.contact.law import ContactLaw, collide, require_law
from femimpact.contact.laws import MATERIALS, Hertz, KelvinVoigt, NoWalls, Rigid, hertz_stiffness
from femimpact.errors import (
    LARGEST,
    Fault,
    InputError,
    check_fields,
    checked,
    choice,
    instance,
    name_text,
    optional,
    place,
    quantity,
    require,
    require_name,
    require_type,
    text,
)
from femimpact.structure.axial import Axial
from femimpact.structure.beam import Beam, ModalDamping, Rayleigh
from femimpact.table import Head, head_of_values, short_repr

Position = str | float
"""A place on the beam: "root", "tip", "mid", a name that the mesh gives, a body's name, or metres from the root."""

RESERVED = ("root", "tip", "mid", "time", "base", "gap", "contact_force", "frequency", "grid")
"""Names that mean something else in channels and result files."""

GAP_OF_STOP = (
    "must be one number >= 0 or two (to the + side, to the - side), one of which may be infinite, or negative where "
    "their sum is > 0 (a preloaded stop)"
)

SUPPORTS = {"clamped": ("w", "slope"), "pinned": ("w",), "guided": ("slope",)}


def sound_gaps(gaps: tuple[float, ...]) -> bool:
    """True if two gaps (m) leave a stop's beam a place: none negative, or one of them with a sum > 0."""
    if len(gaps) != 2 or any(map(math.isnan, gaps)):
        return False
    return min(gaps) >= 0.0 or sum(gaps) > 0.0


def gaps_with(gaps: tuple[float, float], gap: float | tuple[float, float]) -> tuple[float, float]:
    """Gaps (m) to both sides with another number: a side that is open stays so, where the number is no pair."""
    if isinstance(gap, tuple):
        return gap
    plus, minus = (gap if math.isfinite(side) else side for side in gaps)
    return plus, minus


def require_preload(gaps: tuple[float, ...], law: ContactLaw) -> None:
    """Refuse a law that cannot be preloaded where one of the gaps (m) is negative."""
    fits = min(gaps) >= 0.0 or law.may_be_preloaded
    allowed = "must be another law for a preloaded stop: its spring acts from the middle of its gaps"
    require(fits, "contact", law.name, "", allowed)


def require_free_damping(damping: float, law: ContactLaw) -> None:
    """Refuse a dashpot (N s/m) beside a law that has a centring spring itself."""
    allowed = f"must be 0 N s/m with the law {law.name}, whose spring acts everywhere"
    require(damping == 0.0 or not hasattr(law, "free_stiffness"), "free_damping", damping, "N s/m", allowed)


@dataclass(frozen=True)
class PointMass:
    """A body lumped on the beam's displacement and rotation at one place.

    Parameters
    ----------
    name : str
        By which it is named in results; a place for everything else.
    at : str or float
        Place on the beam: "root", "tip", "mid", a point of the mesh, or metres from the root.
    mass : float, kg
        Of the body.
    rotary_inertia : float, kg m^2
        About the centre of the body.
    offset : float, m
        Of the body's centre from its place along the beam, positive towards the tip, also beyond it: the body is
        fixed to the section at its place, and its centre moves by w + offset dw/dx.
    """

    name: str = field(metadata=name_text())
    at: Position = field(metadata=place())
    mass: float = field(metadata=quantity("kg", at_least=0.0, at_most=LARGEST))
    rotary_inertia: float = field(default=0.0, metadata=quantity("kg m^2", at_least=0.0, at_most=LARGEST))
    offset: float = field(default=0.0, metadata=quantity("m"))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Support:
    """Support of the beam on the moving base: "clamped", "pinned" (no deflection), "guided" (no slope).

    Parameters
    ----------
    kind : {"clamped", "pinned", "guided"}
        Neither deflection nor slope, no deflection, no slope.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.

    Examples
    --------
    A beam on two pins, as part of a structure:

    >>> import femimpact as fi
    >>> pins = [fi.Support(at="root", kind="pinned"), fi.Support(at="tip", kind="pinned")]
    >>> beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    >>> fi.Structure(beam, supports=pins).supports[1].kind
    'pinned'
    """

    kind: str = field(metadata=choice(*SUPPORTS))
    at: Position = field(metadata=place())

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Impactor:
    """A free ball in a cavity that is fixed to the beam.

    m (y'' + ub'') = m acceleration - free_stiffness x - free_damping x' - N(p, p'), x = y - w, relative to the base.

    Parameters
    ----------
    name : str
        By which it is named in results.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.
    mass : float, kg
        Of the ball.
    gap : float or pair of float, m
        Free travel from the centre to each wall (the paper's d1 on the + side, d2 on the - side);
        the total clearance is their sum. `math.inf` where other balls keep it from a wall (`Meeting`).
    contact : a contact law
        Of both walls.
    free_stiffness : float, N/m
        Centring spring between ball and beam, acting everywhere.
    acceleration : float, m/s^2
        Constant acceleration along the ball's path (gravity for a vertical motion).
    free_damping : float, N s/m
        Dashpot beside the centring spring, acting everywhere.
    material, wall : {"steel", "aluminium", "glass", "tungsten", "tungsten-carbide"}, optional
        Of the ball, a full sphere, and of the walls of its box: what these measure, no motion.

    Raises
    ------
    InputError
        If the contact is one with a spring of its own beside a dashpot.
    """

    name: str = field(metadata=name_text())
    at: Position = field(metadata=place())
    mass: float = field(metadata=quantity("kg", above=0.0))
    gap: float | tuple[float, float] = field(metadata=quantity("m", at_least=0.0, several=True, finite=False))
    contact: ContactLaw
    free_stiffness: float = field(default=0.0, metadata=quantity("N/m", at_least=0.0))
    acceleration: float = field(default=0.0, metadata=quantity("m/s^2"))
    free_damping: float = field(default=0.0, metadata=quantity("N s/m", at_least=0.0))
    material: str | None = field(default=None, metadata=optional(choice(*MATERIALS)))
    wall: str | None = field(default=None, metadata=optional(choice(*MATERIALS)))

    def __post_init__(self) -> None:
        check_fields(self)
        fits = len(self.gaps) == 2 and min(self.gaps) >= 0.0 and not any(map(math.isnan, self.gaps))
        require(fits, "gap", self.gap, "m", "must be one number or two (d1 on the + side, d2 on the - side), >= 0 m")
        require_law(self.contact, "contact")
        require_free_damping(self.free_damping, self.contact)

    @property
    def gaps(self) -> tuple[float, float]:
        """Gap (m) on the + side and on the - side."""
        return self.gap if isinstance(self.gap, tuple) else (self.gap, self.gap)

    @property
    def diameter(self) -> float:
        """Of a full sphere of its mass and its material, m; not a number without a material."""
        density = MATERIALS[self.material][1] if self.material else math.nan
        return math.cbrt(6.0 * self.mass / (math.pi * density))

    @property
    def box_length(self) -> float:
        """Inside of the box along the path, m: the diameter and both gaps."""
        return self.diameter + sum(self.gaps)

    def box_mass(self, thickness: float) -> float:
        """Mass (kg) of a box with walls of a thickness (m), which holds the ball without clearance across its path."""
        density, d = MATERIALS[self.wall][1] if self.wall else math.nan, self.diameter
        t = checked("thickness", thickness, quantity("m", above=0.0))
        return float(density * ((d + 2.0 * t) ** 2 * (self.box_length + 2.0 * t) - d**2 * self.box_length))

    def wall_pressure(self, approach_speed: float) -> tuple[float, float]:
        """Largest force F (N) and pressure (Pa) where the bare ball meets its bare wall, which does not give way.

        By Hertz's law 3 F/(2 pi a^2), with a^2 = R p of the penetration p. A wall begins to yield below its surface
        where this is 1.6 times its yield stress (Johnson, 1985).
        """
        if self.material is None or self.wall is None:
            return math.nan, math.nan
        law = Hertz(hertz_stiffness(0.5 * self.diameter, MATERIALS[self.material][0], MATERIALS[self.wall][0]))
        impact = collide(law, self.mass, approach_speed)
        return impact.peak_force, 3.0 * impact.peak_force / (math.pi * self.diameter * impact.largest_penetration)


@dataclass(frozen=True)
class Absorber:
    """A body on a spring and a dashpot on the beam, without walls: a tuned mass damper.

    m (y'' + ub'') = m gravity - stiffness x - damping x', x = y - w, both relative to the base.

    Parameters
    ----------
    name : str
        By which it is named in results: as a ball, `name` is its displacement and `name.gap` is x.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.
    mass : float, kg
        Of the body.
    stiffness : float, N/m
        Of the spring between body and beam.
    damping : float, N s/m
        Of the dashpot beside it.

    See Also
    --------
    tuned_absorber : the stiffness and damping that leave the smallest resonance.
    """

    name: str = field(metadata=name_text())
    at: Position = field(metadata=place())
    mass: float = field(metadata=quantity("kg", above=0.0, at_most=LARGEST))
    stiffness: float = field(metadata=quantity("N/m", above=0.0))
    damping: float = field(metadata=quantity("N s/m", at_least=0.0))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def gaps(self) -> tuple[float, float]:
        """Infinite on both sides (m)."""
        return math.inf, math.inf

    @property
    def contact(self) -> NoWalls:
        """The law of walls that are not there."""
        return NoWalls()


@dataclass(frozen=True)
class Stop:
    """A fixed obstacle beside the beam: the same contact pair, without a moving mass.

    The beam touches it on the + side at w = gap[0] and on the - side at w = -gap[1], w relative to the base; one
    fixed in space it touches at w + ub = gap[0] and w + ub = -gap[1], ub the base's displacement.

    Parameters
    ----------
    name : str
        By which it is named in results.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.
    gap : float or pair of float, m
        Free travel of the beam to the + and to the - side; `inf` leaves a side open. A negative gap
        preloads: the undeformed beam would be that far inside the obstacle, and a run starts from the static
        state (`State`) unless its initial state gives displacements.
    contact : a contact law
        Of both sides.
    fixed_to : {"base", "space"}
        Whether the obstacle moves with the base or is fixed in space.
    """

    name: str = field(metadata=name_text())
    at: Position = field(metadata=place())
    gap: float | tuple[float, float] = field(
        metadata=quantity("m", several=True, finite=False) | {"allowed": GAP_OF_STOP}
    )
    contact: ContactLaw
    fixed_to: str = field(default="base", metadata=choice("base", "space"))

    def __post_init__(self) -> None:
        check_fields(self)
        # one gap may be infinite, both would leave no obstacle
        fine = sound_gaps(self.gaps) and min(self.gaps) < math.inf
        require(fine, "gap", self.gap, "m", GAP_OF_STOP)
        require_law(self.contact, "contact")
        require_preload(self.gaps, self.contact)

    @property
    def gaps(self) -> tuple[float, float]:
        """Gap (m) to the + side and to the - side."""
        return self.gap if isinstance(self.gap, tuple) else (self.gap, self.gap)


@dataclass(frozen=True)
class Meeting:
    """Contact of two balls in one box, or in boxes at one place of the beam: they touch at y_a - y_b = gap.

    Parameters
    ----------
    name : str
        By which it is named in results: `name.gap` is y_a - y_b, `name.contact_force` the force on the second ball.
    between : pair of str
        Names of the balls, the second on the + side of the first.
    gap : float, m
        Free distance when both balls stand at their zero.
    contact : Rigid or KelvinVoigt
        Of the two surfaces: the laws of `EventDriven`, which alone takes balls that meet.

    Examples
    --------
    >>> import femimpact as fi
    >>> fi.Meeting("ab", between=("a", "b"), gap=3e-3, contact=fi.Rigid(0.8)).gaps
    (0.003, inf)
    """

    name: str = field(metadata=name_text())
    between: tuple[str, ...] = field(metadata=text(several=True))
    gap: float = field(metadata=quantity("m", at_least=0.0))
    contact: Rigid | KelvinVoigt

    def __post_init__(self) -> None:
        check_fields(self)
        two = len(set(self.between)) == len(self.between) == 2
        require(two, "between", ", ".join(self.between), "", "must be the names of two different balls")
        law = getattr(self.contact, "name", self.contact)
        require(isinstance(self.contact, Rigid | KelvinVoigt), "contact", law, "", "must be Rigid or KelvinVoigt")

    @property
    def gaps(self) -> tuple[float, float]:
        """Gap (m) to where the balls touch; they part without end."""
        return self.gap, math.inf


def check_meetings(meetings: Sequence[Meeting], place_of: Mapping[str, Position]) -> None:
    """Refuse meetings of balls that are unknown, at two places of the beam, or met in another one."""
    pairs = list[set[str]]()
    for meeting in meetings:
        key, (a, b) = f"meeting.{meeting.name}.between", meeting.between
        for name in (a, b):
            require_name(name, place_of, key)
        allowed = f"must be balls at one place of the beam: {a} is at {place_of[a]}, {b} at {place_of[b]}"
        require(place_of[a] == place_of[b], key, f"{a}, {b}", "", allowed)
        require({a, b} not in pairs, key, f"{a}, {b}", "", "must be two balls that no other meeting has")
        pairs.append({a, b})


def _check_ends(connection: Any) -> None:
    """Refuse a spring or a dashpot whose fields are out of range, or whose ends are at one place."""
    check_fields(connection)
    allowed = "must be another place than the one at `at`, or None"
    require(connection.to != connection.at, "to", connection.to, "", allowed)


@dataclass(frozen=True)
class Spring:
    """A linear spring along the deflection, to the moving base or between two places of the beam.

    The force on the beam at `at` is -stiffness (w(at) - w(to)), and the opposite one acts at `to`. A place need not be
    a node of the mesh: the force acts through the interpolation of its element.

    Parameters
    ----------
    name : str
        A name that no other part of the structure has.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.
    stiffness : float, N/m
        Force over elongation.
    to : str or float, optional
        The other end's place on the beam; None is the base.
    """

    name: str = field(metadata=name_text())
    at: str | float = field(metadata=place())
    stiffness: float = field(metadata=quantity("N/m", at_least=0.0))
    to: str | float | None = field(default=None, metadata=optional(place()))

    def __post_init__(self) -> None:
        _check_ends(self)


@dataclass(frozen=True)
class Dashpot:
    """A viscous damper along the deflection, to the moving base or between two places of the beam.

    The force on the beam at `at` is -damping (w'(at) - w'(to)) with the velocities w' relative to the base, and the
    opposite one acts at `to`. The damping no longer decouples on the normal modes (`reduce`), but by chance.

    Parameters
    ----------
    name : str
        A name that no other part of the structure has.
    at : str or float
        Place on the beam: "root", "tip", "mid", a body's name, a point of the mesh, or metres from the root.
    damping : float, N s/m
        Force over speed.
    to : str or float, optional
        The other end's place on the beam; None is the base.
    """

    name: str = field(metadata=name_text())
    at: str | float = field(metadata=place())
    damping: float = field(metadata=quantity("N s/m", at_least=0.0))
    to: str | float | None = field(default=None, metadata=optional(place()))

    def __post_init__(self) -> None:
        _check_ends(self)


@short_repr
@dataclass(frozen=True)
class Structure:
    """Beam, supports, bodies, balls, absorbers and stops, and the structure's damping.

    Parameters
    ----------
    damping : Rayleigh or ModalDamping, optional
        None means undamped.
    supports : sequence of Support
        The default clamps the root. None at all leave the beam free: Rayleigh damping, and ratios of modes, then act on
        the elastic modes alone, and its momentum stays.
    gravity : float, m/s^2
        Constant acceleration along the deflection of everything that moves: beam, bodies and balls. The
        `acceleration` of a ball adds to it.
    axial : Axial, optional
        Load along the beam: weight, spin, tension. None is none.
    springs : sequence of Spring
        Those to the base hold the beam, so that there may be no supports. About a single one, without supports, the
        beam is free to turn: a rigid motion of frequency 0.

    Raises
    ------
    InputError
        For repeated names, places beyond the beam, or where neither supports nor a spring to the base hold the beam.
    """

    beam: Beam
    masses: Sequence[PointMass] = ()
    impactors: Sequence[Impactor] = ()
    damping: Rayleigh | ModalDamping | None = None
    supports: Sequence[Support] = (Support("clamped", "root"),)
    stops: Sequence[Stop] = ()
    gravity: float = field(default=0.0, metadata=quantity("m/s^2"))
    springs: Sequence[Spring] = ()
    dashpots: Sequence[Dashpot] = ()
    absorbers: Sequence[Absorber] = ()
    axial: Axial | None = field(default=None, metadata=optional(instance(Axial)))
    meetings: Sequence[Meeting] = ()

    def __post_init__(self) -> None:
        kinds = {
            "masses": PointMass, "impactors": Impactor, "supports": Support, "stops": Stop, "springs": Spring,
            "dashpots": Dashpot, "absorbers": Absorber, "meetings": Meeting,
        }  # fmt: skip
        for key in kinds:
            if isinstance(getattr(self, key), list):
                object.__setattr__(self, key, tuple(getattr(self, key)))
        check_fields(self)
        require_type(self.beam, Beam, "beam")
        for key, kind in kinds.items():
            require_type(getattr(self, key), tuple, key)
            for item in getattr(self, key):
                require_type(item, kind, key)
        hung = (*self.springs, *self.dashpots, *self.absorbers)
        named: tuple[Any, ...] = (*self.masses, *self.impactors, *self.stops, *hung, *self.meetings)
        names = [item.name for item in named]
        allowed = "must be distinct among masses, impactors, stops, springs, dashpots, absorbers and meetings"
        require(len(set(names)) == len(names), "name", names, "", allowed)
        for name in names:
            plain = isinstance(name, str) and re.fullmatch(r"[A-Za-z][\w -]*", name) and name not in RESERVED
            allowed = f"must be letters, digits, spaces, - and _, and none of {', '.join(RESERVED)}"
            require(bool(plain), "name", name, "", allowed)
        damped = self.damping is None or isinstance(self.damping, (Rayleigh, ModalDamping))
        require(damped, "damping", self.damping, "", "must be a Rayleigh, a ModalDamping or None")
        allowed = f"must be within the beam, 0 to {self.beam.length:g} m"
        places = [(f"{key}.at", item.at) for key, item in self.attachments]
        places += [(f"{key}.{end}", place) for key, _, ends in self.connections for end, place in ends.items()]
        beyond = [
            Fault(key, place, "m", allowed)
            for key, place in places
            if not isinstance(place, str) and place > self.beam.length * (1 + 1e-9)
        ]
        if beyond:
            raise InputError(beyond)
        check_meetings(self.meetings, {ball.name: self._metres_of(ball.at) for ball in self.impactors})
        self._check_supports()
        if self.axial is not None:
            held = bool(self.supports or self.springs_to_base)
            require(held, "axial", self.axial, "", "must be None for a beam that nothing holds")
            still = not self.axial.spin or not (self.impactors or self.absorbers)
            allowed = "must be 0 beside balls and absorbers: what a spin does to them is left out"
            require(still, "axial.spin", self.axial.spin, "rad/s", allowed)

    @property
    def _head(self) -> Head:
        """Summary of the beam, its bodies and where they are."""
        lists = ("supports", "masses", "impactors", "stops", "springs", "dashpots", "absorbers")
        labels = {key: [getattr(one, "name", getattr(one, "kind", "")) for one in getattr(self, key)] for key in lists}
        places = {key: [one.at for one in getattr(self, key)] for key in lists}
        rows = {
            key: ", ".join(f"{name} at {place}" for name, place in zip(names, places[key], strict=True))
            for key, names in labels.items()
            if names
        }
        rows |= {f"meeting {one.name}": " and ".join(one.between) for one in self.meetings}
        rows["damping"] = "none" if self.damping is None else repr(self.damping)
        if self.gravity:
            rows["gravity"] = f"{self.gravity:g} m/s^2"
        if self.axial is not None:
            rows["axial"] = repr(self.axial)
        return head_of_values(f"Structure: beam of {self.beam.length:g} m, {self.beam.mass:.4g} kg", rows)

    @property
    def attachments(self) -> tuple[tuple[str, PointMass | Impactor | Absorber | Support | Stop], ...]:
        """Everything that sits on a node of the beam, each with its key path."""
        return (
            *((f"mass.{body.name}", body) for body in self.masses),
            *((f"impactor.{ball.name}", ball) for ball in self.impactors),
            *((f"absorber.{body.name}", body) for body in self.absorbers),
            *((f"support.{support.kind}", support) for support in self.supports),
            *((f"stop.{stop.name}", stop) for stop in self.stops),
        )

    def place_of(self, at: Position) -> Position:
        """The place itself, where it is given as the name of a body."""
        places: dict[Position, Position] = {body.name: body.at for body in self.masses}
        return places.get(at, at) if isinstance(at, str) else at

    @property
    def connections(self) -> tuple[tuple[str, Spring | Dashpot, dict[str, Position]], ...]:
        """Springs and dashpots, each with its key path and its places on the beam by the field's name."""
        return tuple(
            (f"{kind}.{one.name}", one, {"at": one.at} if one.to is None else {"at": one.at, "to": one.to})
            for kind, several in (("spring", self.springs), ("dashpot", self.dashpots))
            for one in several
        )

    @property
    def springs_to_base(self) -> tuple[Spring, ...]:
        """Springs between the beam and the base, of a stiffness that holds."""
        return tuple(spring for spring in self.springs if spring.to is None and spring.stiffness > 0.0)

    def _metres_of(self, at: Position) -> Position:
        """Metres from the root of a place, or its name where only a mesh has it."""
        standard: dict[Position, float] = {"root": 0.0, "tip": self.beam.length, "mid": 0.5 * self.beam.length}
        place = self.place_of(at)
        return standard.get(place, place)

    def _check_supports(self) -> None:
        held = [kind for support in self.supports for kind in SUPPORTS[support.kind]]
        holding: tuple[Any, ...] = tuple(s for s in self.supports if "w" in SUPPORTS[s.kind])
        places = [self._metres_of(s.at) for s in (*holding, *self.springs_to_base)]
        metres = [place for place in places if not isinstance(place, str)]
        apart = bool(metres) and max(metres) - min(metres) > 1e-6 * self.beam.length
        # a name that only the mesh defines counts as a separate place here; assembly checks again where it is
        named = {place for place in places if isinstance(place, str)}
        stiff = apart or len(named) + bool(metres) >= 2 or (bool(places) and "slope" in held)
        # a rotation about a single spring may stay free
        stiff = stiff or bool(self.springs_to_base)
        kinds = [f"{support.kind} at {support.at}" for support in self.supports]
        allowed = (
            "must hold the beam: one clamped end, two pinned places, a pinned and a guided one, or a spring to the "
            "base at one place or more; without any support it is free"
        )
        require(stiff or not self.supports, "supports", ", ".join(kinds) or "none", "", allowed)


def glue_impactors(structure: Structure) -> Structure:
    """The same structure with every ball glued to the beam as a point mass (the second case of the paper's Table 1).

    Examples
    --------
    >>> import femimpact as fi
    >>> glued = fi.structure.glue_impactors(structure)
    >>> glued.impactors, glued.masses[-1].mass == structure.impactors[0].mass
    ((), True)
    """
    require_type(structure, Structure, "structure")
    glued = tuple(PointMass(ball.name, ball.at, ball.mass) for ball in structure.impactors)
    return replace(structure, masses=(*structure.masses, *glued), impactors=(), meetings=())


USUAL_MODULUS = (1e8, 2e12)
"""Young's moduli (Pa) of what beams are made of: from soft plastics to diamond. Rubber, from 1e6 Pa, is warned of."""

USUAL_DENSITY = (10.0, 3e4)
"""Densities (kg/m^3) of what beams are made of: from light foam to osmium, 22,600."""

LARGEST_RATIO = 0.2
"""Damping ratio above which a percentage was probably given as a ratio."""

HEAVY_BODY = 100.0
"""Mass of a body over that of the beam above which grams may have been typed as kilograms."""


SLENDER = 5.0
"""Length over thickness below which Euler-Bernoulli theory does not hold."""


@dataclass(frozen=True)
class UnusualNumber:
    """A number beyond the one that is usual, which may be in another unit."""

    path: str
    value: float
    unit: str
    limit: float
    usual: str
    instead: str  # a question

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.path} = {self.value:.4g}{unit}: {self.usual}; {self.instead}"


def unusual_numbers(structure: Structure) -> list[UnusualNumber]:
    """Every number that may be in another unit."""
    return [*_of_damping(structure), *_of_sections(structure), *_of_gaps(structure), *_of_masses(structure)]


def _of_damping(structure: Structure) -> Iterator[UnusualNumber]:
    if structure.damping is None:
        return
    ratios = structure.damping.ratios if isinstance(structure.damping, ModalDamping) else structure.damping.ratio
    ratio = max(ratios) if isinstance(ratios, tuple) else ratios
    if ratio > LARGEST_RATIO:
        instead = f"is it a percentage? {ratio:g} % is a ratio of {0.01 * ratio:.4g}"
        yield UnusualNumber("damping.ratio", ratio, "1", LARGEST_RATIO, f"more than {LARGEST_RATIO:g}", instead)


def _of_sections(structure: Structure) -> Iterator[UnusualNumber]:
    beam = structure.beam
    thickness = max(part.drawn_at(x)[1] for part in beam.segments for x in (0.0, part.length))
    if beam.length < SLENDER * thickness and not all(segment.shear_modulus for segment in beam.segments):
        usual = f"below {SLENDER:g}, where shear and rotary inertia, left out for want of shear_modulus, matter"
        instead = f"is it in metres? take a thickness of at most {beam.length / SLENDER:.6g} m"
        yield UnusualNumber("beam.length", beam.length / thickness, "times the thickness", SLENDER, usual, instead)
    for segment in beam.segments:
        path = "beam" if len(beam.segments) == 1 else f"beam.{segment.name}"
        for name, unit, (low, high), examples, instead in (
            ("young_modulus", "Pa", USUAL_MODULUS, "rubber 1e6 to 1e8, aluminium 7e10, steel 2.1e11", "is it in Pa?"),
            ("density", "kg/m^3", USUAL_DENSITY, "aluminium 2700, steel 7850", "is it in kg/m^3?"),
        ):
            value = getattr(segment, name)
            if not low <= value <= high:
                usual = f"outside {low:g} to {high:g} {unit} ({examples})"
                limit = low if value < low else high
                yield UnusualNumber(f"{path}.{name}", value, unit, limit, usual, instead)
        for name in ("width", "diameter", "outer_fibre", *(("thickness",) if segment.shear_modulus else ())):
            value = getattr(segment, name)
            if value is not None and value > beam.length:
                usual = f"more than the length of the beam, {beam.length:.4g} m, which is no beam"
                yield _too_long(f"{path}.{name}", value, beam.length, usual)


def _of_gaps(structure: Structure) -> Iterator[UnusualNumber]:
    length = structure.beam.length
    pairs = [(f"impactor.{ball.name}", ball.gaps) for ball in structure.impactors]
    for path, gaps in [*pairs, *((f"stop.{stop.name}", stop.gaps) for stop in structure.stops)]:
        # one wall out of reach may be meant
        if length < min(gaps) < math.inf:
            yield _too_long(f"{path}.gap", min(gaps), length, f"wider than the beam is long, {length:.4g} m")
    for body in structure.masses:
        if length < abs(body.offset):
            yield _too_long(f"mass.{body.name}.offset", body.offset, length, f"longer than the beam, {length:.4g} m")


def _of_masses(structure: Structure) -> Iterator[UnusualNumber]:
    beam = structure.beam.mass
    # a density out of range is named already
    solid = all(USUAL_DENSITY[0] <= segment.density for segment in structure.beam.segments)
    heavy = [body for body in structure.masses if solid and body.mass > HEAVY_BODY * beam]
    for body in heavy:
        usual = f"more than {HEAVY_BODY:g} times the beam's {beam:.4g} kg"
        yield _too_heavy(f"mass.{body.name}.mass", body.mass, HEAVY_BODY * beam, usual)
    # beside a body in grams a ball in grams is not heavy
    rest = beam + math.fsum(body.mass for body in structure.masses if body not in heavy)
    carried: list[tuple[str, Impactor | Absorber]] = [("impactor", ball) for ball in structure.impactors]
    carried += [("absorber", body) for body in structure.absorbers]
    for owner, ball in carried:
        if ball.mass > rest:
            usual = f"more than beam and bodies together, {rest:.4g} kg"
            yield _too_heavy(f"{owner}.{ball.name}.mass", ball.mass, rest, usual)


def _too_long(path: str, metres: float, limit: float, usual: str) -> UnusualNumber:
    instead = f"is it in metres? {metres:.4g} mm are {1e-3 * metres:.4g} m"
    return UnusualNumber(path, metres, "m", limit, usual, instead)


def _too_heavy(path: str, kilograms: float, limit: float, usual: str) -> UnusualNumber:
    instead = f"is it in kilograms? {kilograms:.4g} g are {1e-3 * kilograms:.4g} kg"
    return UnusualNumber(path, kilograms, "kg", limit, usual, instead)
