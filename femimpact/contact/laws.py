"""Contact laws: rigid, Kelvin-Voigt, the power laws from Hertz on, and the switching spring of the paper."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np

from femimpact import core
from femimpact.contact.collision import (
    Collision,
    collision_of,
    contact_time_of,
    damping_ratio_for_restitution,
    largest_by_parabola,
    linear_angle,
    loss_factor_for_restitution,
    restitution_of_damping_ratio,
    restitution_of_loss_factor,
)
from femimpact.errors import (
    Fault,
    InputError,
    check_fields,
    checked,
    choice,
    factor_rows,
    in_range,
    optional,
    quantity,
    require,
    require_type,
)

KELVIN_VOIGT, SWITCHING_SPRING, POWER, CUSTOM, RIGID = KINDS = range(5)
"""Kinds of laws, numbered as in femimpact/core/contact/formulas.hpp."""


SpeedPiece = tuple[Any, Any, Any, float]
"""Approach speed v (m/s) from which a restitution is a + b v^p, with a, b and p."""


class ContactParameters(NamedTuple):
    """Numbers that the time loop needs of a law."""

    kind: int
    stiffness: float  # N/m, or N/m^n
    damping: float  # N s/m; of a power law its loss factor d, 1
    contact_time: float  # s, from touch to zero force
    restitution: float  # 1, of one collision in continuous time
    exponent: float = 1.0
    over_speed: tuple[SpeedPiece, ...] = ()  # of a restitution that depends on the approach speed, from 0 m/s on

    @classmethod
    def of_function(cls, contact_time: float, restitution: float) -> ContactParameters:
        """Numbers of a law whose force is a function that the time loop calls."""
        return cls(CUSTOM, math.nan, 0.0, contact_time, restitution)

    @property
    def is_rigid(self) -> bool:
        """True if the contact is an impulse, without force and duration."""
        return self.kind == RIGID

    def restitution_at(self, approach_speed: float) -> float:
        """Restitution (1) of an impact with this speed (m/s)."""
        restitution, _ = restitution_over(self.over_speed, approach_speed)
        return self.restitution if restitution is None else float(restitution)


def restitution_over(pieces: Sequence[SpeedPiece], speed: Any) -> tuple[Any, Any]:
    """Restitution at an approach speed (m/s), which may be complex, and its slope (s/m); None and 0 without pieces."""
    restitution, slope = None, 0.0
    for _, constant, factor, exponent in (piece for piece in pieces if piece[0] <= speed.real):
        restitution = constant + factor * speed**exponent if factor else constant
        slope = factor * exponent * speed ** (exponent - 1.0) if factor else 0.0
    return restitution, slope


class CompiledLaw:
    """What laws have in common for which the time loop has a branch."""

    may_be_preloaded: ClassVar[bool] = True

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored: none."""
        return 0.0

    def force_function(self, effective_mass: float) -> None:
        """None: the time loop has a branch for this law."""

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Empty, where no number beside the restitution characterises the contact."""
        return ()


@dataclass(frozen=True)
class Rigid(CompiledLaw):
    """Impact of no duration: the relative speed v at the wall becomes -e v (Newton's restitution).

    For `EventDriven` and `MoreauJean`; the impulse is (1 + e) v/(1/m + b^T M^-1 b). With `EventDriven` the
    restitution may depend on the approach speed v, either by a table or as e (v/v1)^p.

    Parameters
    ----------
    restitution : float, 1
        Speed e after an impact over that before it.
    over_speed : sequence of (float, float), m/s and 1
        Approach speeds, rising, and factors of e there: straight between them, constant outside. An impact with
        just the speed of a row has the slope behind it.
    at_speed : float, m/s
        Approach speed v1 at which the restitution is e.
    exponent : float, 1
        p of the power; -1/4 is that of plastic impacts (Johnson, Contact Mechanics, 1985).
    at_most : float, 1
        Largest restitution: that of all impacts slower than v1 (at_most/e)^(1/p).
    """

    restitution: float = field(metadata=quantity("1", at_least=0.0, at_most=1.0))
    over_speed: tuple[tuple[float, float], ...] = field(default=(), metadata=factor_rows("m/s"))
    at_speed: float | None = field(default=None, metadata=optional(quantity("m/s", above=0.0)))
    exponent: float | None = field(default=None, metadata=optional(quantity("1", above=-1.0, below=0.0)))
    at_most: float | None = field(default=None, metadata=optional(quantity("1", above=0.0, below=1.0)))
    name: ClassVar[str] = "rigid"

    def __post_init__(self) -> None:
        check_fields(self)
        of_power = (self.at_speed, self.exponent, self.at_most)
        missing = [number is None for number in of_power]
        sound = all(missing) or not (any(missing) or self.over_speed)
        require(sound, "at_speed, exponent, at_most", of_power, "", "must be given together, and without over_speed")
        if self.at_most is not None:
            allowed = f"must be at most at_most, {self.at_most:g}"
            require(self.restitution <= self.at_most, "restitution", self.restitution, "", allowed)
        largest = self.restitution * max((factor for _, factor in self.over_speed), default=1.0)
        allowed = f"must have factors that leave the restitution {self.restitution:g} at most 1: it is {largest:g}"
        require(largest <= 1.0, "over_speed", self.over_speed, "", allowed)

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Not a number: an impulse has no force."""
        return math.nan

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision, without duration and penetration."""
        restitution = self.parameters(effective_mass).restitution_at(approach_speed)
        return collision_of(restitution, 0.0, math.nan, 0.0, effective_mass, approach_speed)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop."""
        over_speed = speed_pieces_of(self, self.restitution)
        return ContactParameters(RIGID, math.inf, 0.0, 0.0, self.restitution, over_speed=over_speed)


def speed_pieces_of(law: Rigid, restitution: Any) -> tuple[SpeedPiece, ...]:
    """The restitution over the approach speed, from 0 m/s on, with another number e, which may be complex."""
    if law.exponent is not None and law.at_speed is not None and law.at_most is not None:
        slowest = law.at_speed * (law.at_most / restitution.real) ** (1.0 / law.exponent) if restitution else 0.0
        scale = restitution * law.at_speed**-law.exponent
        return (0.0, law.at_most if restitution else 0.0, 0.0, 1.0), (slowest, 0.0, scale, law.exponent)
    if not law.over_speed:
        return ()
    rows = [(speed, restitution * factor) for speed, factor in law.over_speed]
    slopes = [(after - before) / (w - v) for (v, before), (w, after) in pairwise(rows)]
    straight = [(v, e - slope * v, slope, 1.0) for (v, e), slope in zip(rows, slopes, strict=False)]
    return (0.0, rows[0][1], 0.0, 1.0), *straight, (*rows[-1], 0.0, 1.0)


@dataclass(frozen=True)
class NoWalls(CompiledLaw):
    """The law of a body that has no walls to meet: no force, for every method."""

    name: ClassVar[str] = "no walls"
    may_be_preloaded: ClassVar[bool] = False
    restitution: ClassVar[None] = None

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N): none."""
        return 0.0

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """No collision: a mass that meets no wall goes on."""
        return collision_of(0.0, math.inf, 0.0, math.inf, effective_mass, approach_speed)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop: a spring without stiffness, which no motion reaches."""
        return ContactParameters(KELVIN_VOIGT, 0.0, 0.0, math.inf, 0.0)


@dataclass(frozen=True)
class KelvinVoigt(CompiledLaw):
    """Spring and dashpot in parallel at each wall, without pull: N = max(0, k p + c p').

    Give exactly one of the pairs (stiffness, damping), (stiffness, restitution),
    (restitution, contact_time). A contact ends at zero force, which decides its restitution (Schwager and
    Poeschel, 2007).

    Parameters
    ----------
    stiffness : float, N/m
        Of the spring.
    damping : float, N s/m
        Of the dashpot.
    restitution : float, 1
        Rebound over approach speed for the effective mass of the pair: of the ball and the first mode, at a stop of
        the first mode alone. With more modes `rebound_speed / approach_speed` of a run's impacts is what it achieves.
    contact_time : float, s
        From touch to zero force, for that mass.
    """

    stiffness: float | None = field(default=None, metadata=quantity("N/m", above=0.0))
    damping: float | None = field(default=None, metadata=quantity("N s/m", at_least=0.0))
    restitution: float | None = field(default=None, metadata=quantity("1", above=0.0, at_most=1.0))
    contact_time: float | None = field(default=None, metadata=quantity("s", above=0.0))
    name: ClassVar[str] = "kelvin-voigt"

    def __post_init__(self) -> None:
        check_fields(self)
        names = ("stiffness", "damping", "restitution", "contact_time")
        set_fields = {name for name in names if getattr(self, name) is not None}
        pairs = ({"stiffness", "damping"}, {"stiffness", "restitution"}, {"restitution", "contact_time"})
        if set_fields not in pairs:
            allowed = (
                "give exactly one pair: stiffness (N/m) and damping (N s/m), stiffness and "
                "restitution (0 < e <= 1), or restitution and contact_time (s)"
            )
            raise InputError([Fault("contact", " and ".join(sorted(set_fields)) or "nothing", "", allowed)])

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N) of spring and dashpot, never below zero."""
        return core.normal_force(KELVIN_VOIGT, depth, rate, *spring_and_dashpot(self, effective_mass), 1.0, 1.0)

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored by the spring."""
        return core.elastic_potential(KELVIN_VOIGT, depth, spring_and_dashpot(self, effective_mass)[0], 1.0)

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision: the closed form of m p'' + c p' + k p = 0 up to the first zero of the force."""
        stiffness, damping = spring_and_dashpot(self, effective_mass)
        mass, speed = effective_mass, approach_speed
        z = damping / (2.0 * math.sqrt(stiffness * mass))
        time = contact_time_of(stiffness, damping, mass)
        omega = math.sqrt(stiffness / mass)
        # sampled finely, then by a parabola: peak force and penetration have no short closed form for all z
        t = np.linspace(0.0, time, 2001)
        root = np.sqrt(complex(z * z - 1.0)) if z != 1.0 else complex(1e-9)
        p = speed / omega * np.real(np.exp(-z * omega * t) * np.sinh(root * omega * t) / root)
        rate = speed * np.real(
            np.exp(-z * omega * t) * (np.cosh(root * omega * t) - z / root * np.sinh(root * omega * t))
        )
        force = np.maximum(stiffness * p + damping * rate, 0.0)
        return collision_of(
            restitution_of_damping_ratio(z), time, largest_by_parabola(force), largest_by_parabola(p), mass, speed
        )

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop."""
        stiffness, damping = spring_and_dashpot(self, effective_mass)
        time = contact_time_of(stiffness, damping, effective_mass)
        restitution = restitution_of_damping_ratio(damping / (2.0 * math.sqrt(stiffness * effective_mass)))
        return ContactParameters(KELVIN_VOIGT, stiffness, damping, time, restitution)

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Stiffness and damping."""
        stiffness, damping = spring_and_dashpot(self, effective_mass)
        return ("stiffness", stiffness, "N/m"), ("damping", damping, "N s/m")


def spring_and_dashpot(law: KelvinVoigt, effective_mass: float) -> tuple[float, float]:
    """Stiffness (N/m) and damping (N s/m) of any of the three complete pairs of a Kelvin-Voigt law."""
    ratio = None if law.restitution is None else damping_ratio_for_restitution(law.restitution)
    stiffness = law.stiffness or 0.0
    if ratio is not None and law.contact_time is not None:
        rate = 2.0 * linear_angle(ratio) / law.contact_time
        stiffness = effective_mass * rate * rate
    key, unit = ("stiffness", "N/m") if law.contact_time is None else ("contact_time", "s")
    allowed = "must give a contact that is neither loose nor rigid to rounding with an effective_mass of "
    within = in_range(stiffness, quantity("N/m", above=0.0))
    require(within, key, getattr(law, key), unit, f"{allowed}{effective_mass:g} kg")
    damping = law.damping or 0.0
    return stiffness, damping if ratio is None else 2.0 * ratio * math.sqrt(stiffness * effective_mass)


QUADRATURE = 60
"""Gauss points of the contact time's quadrature; its integrand is smooth after the change of variable."""

LOSS_FACTORS: Mapping[str, Callable[[float], float]] = {
    "none": lambda e: 0.0,
    "hunt-crossley": lambda e: 1.5 * (1.0 - e),
    "lankarani-nikravesh": lambda e: 0.75 * (1.0 - e * e),
    "flores": lambda e: 1.6 * (1.0 - e) / e,
    "exact": loss_factor_for_restitution,
}
"""Loss factor d (1) of each author for a restitution e."""


@dataclass(frozen=True)
class PowerLaw(CompiledLaw):
    """Force N = k p^n max(0, 1 + d p'/v0), v0 the approach speed at the start of each contact.

    Of a contact that a run starts within, v0 is given by the energy of the start; see `State`.

    The common form of Hertz's law and of those that add damping in proportion to its force. They
    differ in nothing but the loss factor d that each author takes for a restitution e:

    =============================  =====================================
    none (Hertz, 1882)             0
    hunt-crossley (1975)           3 (1 - e)/2
    lankarani-nikravesh (1990)     3 (1 - e^2)/4
    flores (2011)                  8 (1 - e)/(5 e)
    exact (Gonthier et al., 2004;  the root of
    Carvalho and Martins, 2019)    d (1 + e) = ln[(1 + d)/(1 - e d)]
    =============================  =====================================

    Only the last has the restitution given; `collide` computes what the others have.
    `Hertz`, `HuntCrossley`, `LankaraniNikravesh`, `Flores` and `GonthierCarvalhoMartins` make one.

    Parameters
    ----------
    stiffness : float, N/m^n
        n = 3/2 for a sphere; see `hertz_stiffness`.
    restitution : float, 1
        The one that the author's loss factor is made for.
    loss : {"none", "hunt-crossley", "lankarani-nikravesh", "flores", "exact"}
    exponent : float, 1
        n of the force: 3/2 for a sphere.
    reference_speed : float, m/s
        At which the contact time of step recommendations is taken; it goes with v^-1/5 for n = 3/2.

    Raises
    ------
    InputError
        If a restitution other than 1 is given without a loss.
    """

    stiffness: float = field(metadata=quantity("N/m^1.5", above=0.0))
    restitution: float = field(default=1.0, metadata=quantity("1", above=0.0, at_most=1.0))
    loss: str = field(default="none", metadata=choice(*LOSS_FACTORS))
    exponent: float = field(default=1.5, metadata=quantity("1", at_least=1.0, at_most=5.0))
    reference_speed: float = field(default=0.25, metadata=quantity("m/s", above=0.0))

    def __post_init__(self) -> None:
        check_fields(self)
        lossless = self.loss != "none" or self.restitution == 1.0
        require(lossless, "restitution", self.restitution, "", "must be 1 for Hertz: the elastic law loses nothing")

    @property
    def name(self) -> str:
        """The author's name, as results show it."""
        return {"none": "hertz", "exact": "gonthier-carvalho-martins"}.get(self.loss, self.loss)

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N), never below zero."""
        return core.normal_force(POWER, depth, rate, self.stiffness, loss_factor(self), self.exponent, approach_speed)

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored by the elastic part."""
        return core.elastic_potential(POWER, depth, self.stiffness, self.exponent)

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision in closed form, but for the quadrature of its contact time."""
        mass, speed = effective_mass, approach_speed
        d, k, n = loss_factor(self), self.stiffness, self.exponent
        deepest = _depth(_potential_of_speed(d, 0.0) * mass * speed**2, k, n)
        # the force k p^n (1 + d r) is largest before the deepest point
        ratios = np.linspace(0.0, 1.0, 4001)[:-1]
        depths = [_depth(_potential_of_speed(d, r) * mass * speed**2, k, n) for r in ratios]
        force = k * np.array(depths) ** n * (1.0 + d * ratios)
        time = power_contact_time(k, n, d, mass, speed)
        return collision_of(restitution_of_loss_factor(d), time, largest_by_parabola(force), deepest, mass, speed)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop; the contact time is that at the reference speed."""
        d = loss_factor(self)
        time = power_contact_time(self.stiffness, self.exponent, d, effective_mass, self.reference_speed)
        return ContactParameters(POWER, self.stiffness, d, time, restitution_of_loss_factor(d), self.exponent)

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Stiffness and loss factor."""
        return ("stiffness", self.stiffness, f"N/m^{self.exponent:g}"), ("loss factor", loss_factor(self), "")


def Hertz(stiffness: float, exponent: float = 1.5, reference_speed: float = 0.25) -> PowerLaw:  # noqa: N802
    """Elastic sphere on a wall, N = k p^1.5: `PowerLaw` without loss.

    The stiffness is in N/m^n with another exponent n, the reference speed in m/s.
    """
    return PowerLaw(stiffness, 1.0, "none", exponent, reference_speed)


def HuntCrossley(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with the loss factor d = 3 (1 - e)/2 of the restitution e given.

    The restitution of a collision under this law is close to e only where e is near 1. The stiffness is in
    N/m^exponent, the reference speed in m/s.
    """
    return PowerLaw(stiffness, restitution, "hunt-crossley", exponent, reference_speed)


def LankaraniNikravesh(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with d = 3 (1 - e^2)/4: its restitution is near the one given where that is near 1."""
    return PowerLaw(stiffness, restitution, "lankarani-nikravesh", exponent, reference_speed)


def Flores(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with d = 8 (1 - e)/(5 e): its restitution is near the one given at 0 and at 1."""
    return PowerLaw(stiffness, restitution, "flores", exponent, reference_speed)


def GonthierCarvalhoMartins(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with the exact d: its restitution is the one given."""
    return PowerLaw(stiffness, restitution, "exact", exponent, reference_speed)


def loss_factor(law: PowerLaw) -> float:
    """Loss factor d (1) of a power law, by its author's formula."""
    return LOSS_FACTORS[law.loss](law.restitution)


def _potential_of_speed(loss: float, ratio: float) -> float:
    """(Stored energy)/(m v0^2) when the relative speed is `ratio` times the approach speed, -e to 1.

    m v dv/(1 + d v/v0) = -dU gives U/(m v0^2) = (1 - r)/d - ln[(1 + d)/(1 + d r)]/d^2, written
    here without differences of near numbers.
    """
    v = (1.0 - ratio) / max(1.0 + loss * ratio, 1e-300)
    u = loss * v
    if u > 1.0:
        # no near numbers here, and v may be huge next to the speed at which the force vanishes
        return (1.0 - ratio) / loss - math.log1p(u) / loss**2
    series = sum((-u) ** n / (n + 2.0) for n in range(8))
    shape = series if abs(u) < 0.02 else (u - math.log1p(u)) / u**2
    return ratio * v + v * v * shape


def _depth(energy: float, stiffness: float, exponent: float) -> float:
    return float(((exponent + 1.0) * max(energy, 0.0) / stiffness) ** (1.0 / (exponent + 1.0)))


def power_contact_time(stiffness: float, exponent: float, loss: float, mass: float, speed: float) -> float:
    """Contact time (s) of k p^n (1 + d p'/v0): the integral of -m dv/N over the speed, from v to -e v.

    For d = 0 and n = 3/2 it is 2.9432 times the largest penetration over v (Hertz; Johnson, 1985).
    """
    e = restitution_of_loss_factor(loss)
    x, w = np.polynomial.legendre.leggauss(QUADRATURE)
    s, w = 0.5 * (x + 1.0), 0.5 * w
    scale, q = mass * speed**2, exponent + 1.0
    # coming: -m dv/N, clustered at the touch, where the force grows from zero
    r = 1.0 - s**q
    depth = np.array([_depth(_potential_of_speed(loss, value) * scale, stiffness, exponent) for value in r])
    coming = mass * speed * q * s ** (q - 1.0) / (stiffness * depth**exponent * (1.0 + loss * r))
    # leaving: dp/|v|, for a lossy contact creeps back at a speed that hardly changes; clustered where it turns
    deepest = _depth(_potential_of_speed(loss, 0.0) * scale, stiffness, exponent)
    back = [_leaving_speed(loss, e, value) for value in (1.0 - s * s) ** q * _potential_of_speed(loss, 0.0)]
    leaving = 2.0 * s * deepest / (speed * np.array(back))
    return float(np.sum(w * (coming + leaving)))


def _leaving_speed(loss: float, restitution: float, potential: float) -> float:
    """Relative speed over v0 on the way back, positive, where (stored energy)/(m v0^2) is `potential`."""
    from scipy.optimize import brentq

    def left(ratio: float) -> float:
        return _potential_of_speed(loss, -ratio) - potential

    if left(restitution) >= 0.0:
        return restitution
    return float(brentq(left, 0.0, restitution, xtol=1e-17, rtol=1e-14))


@dataclass(frozen=True)
class SwitchingSpring(CompiledLaw):
    """The paper's law: k_I0 x inside the gap, k_I x outside, switched by the state before the step.

    The force jumps at the wall, and deciding one step late feeds energy in; the energy ledger
    of a run shows how much. Kept to reproduce the paper (eq. 25 to 30), not to be trusted.

    Parameters
    ----------
    free_stiffness : float, N/m
        k_I0, acts on the full relative displacement while the ball is inside its gap.
    stiffness : float, N/m
        k_I, acts on the full relative displacement outside.
    """

    free_stiffness: float = field(metadata=quantity("N/m", at_least=0.0))
    stiffness: float = field(metadata=quantity("N/m", above=0.0))
    name: ClassVar[str] = "switching-spring"
    restitution: ClassVar[float | None] = None
    may_be_preloaded: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_fields(self)

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Contact force (N): k_I times the depth beyond a wall at gap 0, and zero before the wall."""
        return self.stiffness * max(depth, 0.0)

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored beside a wall at gap 0."""
        return core.switching_potential(max(depth, 0.0), 0.0, 0.0, self.free_stiffness, self.stiffness)

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision: half a period of the mass on the spring k_I."""
        m, v = effective_mass, approach_speed
        omega = math.sqrt(self.stiffness / m)
        return collision_of(1.0, math.pi / omega, v * math.sqrt(self.stiffness * m), v / omega, m, v)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop."""
        half_period = math.pi * math.sqrt(effective_mass / self.stiffness)
        return ContactParameters(SWITCHING_SPRING, self.stiffness, 0.0, half_period, 1.0)

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Stiffness and damping, which is none."""
        return ("stiffness", self.stiffness, "N/m"), ("damping", 0.0, "N s/m")


LAWS: Mapping[str, tuple[Any, Mapping[str, Any]]] = {
    "kelvin-voigt": (KelvinVoigt, {}),
    "switching-spring": (SwitchingSpring, {}),
    "hertz": (PowerLaw, {"loss": "none", "restitution": 1.0}),
    "hunt-crossley": (PowerLaw, {"loss": "hunt-crossley"}),
    "lankarani-nikravesh": (PowerLaw, {"loss": "lankarani-nikravesh"}),
    "flores": (PowerLaw, {"loss": "flores"}),
    "gonthier-carvalho-martins": (PowerLaw, {"loss": "exact"}),
    "rigid": (Rigid, {}),
}
"""Noun of each law by its name in study files, and the fields that the name fixes."""


@dataclass(frozen=True)
class Material:
    """Elastic constants of a body in contact.

    Parameters
    ----------
    young_modulus : float, Pa
    poisson_ratio : float, 1
    """

    young_modulus: float = field(metadata=quantity("Pa", above=0.0))
    poisson_ratio: float = field(metadata=quantity("1", above=-1.0, at_most=0.5))

    def __post_init__(self) -> None:
        check_fields(self)


STEEL = Material(210e9, 0.30)
ALUMINIUM = Material(70e9, 0.33)
MATERIALS = {
    "steel": (STEEL, 7850.0),
    "aluminium": (ALUMINIUM, 2700.0),
    "glass": (Material(60e9, 0.23), 2500.0),
    "tungsten": (Material(400e9, 0.28), 19300.0),  # pure, by matweb.com
    "tungsten-carbide": (Material(630e9, 0.24), 15000.0),  # by makeitfrom.com
}
"""Materials of balls and walls by their names in study files, each with its density (kg/m^3)."""


def hertz_stiffness(radius: float, ball: Material, wall: Material) -> float:
    """Stiffness (N/m^1.5) of a sphere on a flat wall: k = 4/3 E* sqrt(R), 1/E* = sum of (1 - nu^2)/E.

    Parameters
    ----------
    radius : float, m
        Of the ball.

    Notes
    -----
    Hertz (1882); Johnson, Contact Mechanics (1985).

    Examples
    --------
    >>> import femimpact as fi
    >>> f"{fi.contact.hertz_stiffness(5e-3, fi.contact.STEEL, fi.contact.STEEL):.3g} N/m^1.5"
    '1.09e+10 N/m^1.5'
    """
    size = checked("radius", radius, quantity("m", above=0.0))
    for key, body in (("ball", ball), ("wall", wall)):
        require_type(body, Material, key)
    compliance = sum((1.0 - body.poisson_ratio**2) / body.young_modulus for body in (ball, wall))
    return 4.0 / 3.0 / compliance * math.sqrt(size)
