"""Contact laws as values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from femimpact.contact.restitution import damping_ratio_for_restitution, linear_angle, loss_factor_for_restitution
from femimpact.errors import Fault, InputError, check_fields, checked, choice, quantity, require, require_type, text

__all__ = [
    "ALUMINIUM",
    "STEEL",
    "ContactLaw",
    "CustomLaw",
    "Flores",
    "GonthierCarvalhoMartins",
    "Hertz",
    "HuntCrossley",
    "KelvinVoigt",
    "LankaraniNikravesh",
    "Material",
    "PowerLaw",
    "Rigid",
    "SwitchingSpring",
    "hertz_stiffness",
    "loss_factor",
    "require_law",
    "spring_and_dashpot",
]


@dataclass(frozen=True)
class KelvinVoigt:
    """Spring and dashpot in parallel at each wall, without pull: N = max(0, k p + c p').

    Give exactly one of the pairs (stiffness, damping), (stiffness, restitution),
    (restitution, contact_time).

    Parameters
    ----------
    stiffness : float, N/m
    damping : float, N s/m
    restitution : float, 1
        Rebound over approach speed of the ball against the effective mass of the pair.
    contact_time : float, s
        From touch to zero force.

    Raises
    ------
    InputError
        If a value is out of range or the pair given is not one of the three.
    """

    stiffness: float | None = field(default=None, metadata=quantity("N/m", above=0.0))
    damping: float | None = field(default=None, metadata=quantity("N s/m", at_least=0.0))
    restitution: float | None = field(default=None, metadata=quantity("1", above=0.0, at_most=1.0))
    contact_time: float | None = field(default=None, metadata=quantity("s", above=0.0))
    name: ClassVar[str] = "kelvin-voigt"

    def __post_init__(self) -> None:
        check_fields(self)
        names = ("stiffness", "damping", "restitution", "contact_time")
        given = {name for name in names if getattr(self, name) is not None}
        pairs = ({"stiffness", "damping"}, {"stiffness", "restitution"}, {"restitution", "contact_time"})
        if given not in pairs:
            allowed = (
                "give exactly one pair: stiffness (N/m) and damping (N s/m), stiffness and "
                "restitution (0 < e <= 1), or restitution and contact_time (s)"
            )
            raise InputError([Fault("contact", " and ".join(sorted(given)) or "nothing", "", allowed)])


@dataclass(frozen=True)
class SwitchingSpring:
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

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Rigid:
    """Impact of no duration: the relative speed v at the wall becomes -e v (Newton's restitution).

    For `EventDriven` and `MoreauJean`; the impulse is (1 + e) v/(1/m + b^T M^-1 b).

    Parameters
    ----------
    restitution : float, 1
    """

    restitution: float = field(metadata=quantity("1", at_least=0.0, at_most=1.0))
    name: ClassVar[str] = "rigid"

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class PowerLaw:
    """Force N = k p^n max(0, 1 + d p'/v0), v0 the approach speed at the start of each contact.

    The common form of Hertz's law and of those that brake it in proportion to its force. They
    differ in nothing but the loss factor d that each author takes for a restitution e:

    =============================  =====================================
    none (Hertz, 1882)             0
    hunt-crossley (1975)           3 (1 - e)/2
    lankarani-nikravesh (1990)     3 (1 - e^2)/4
    flores (2011)                  8 (1 - e)/(5 e)
    exact (Gonthier et al., 2004;  the root of
    Carvalho and Martins, 2019)    d (1 + e) = ln[(1 + d)/(1 - e d)]
    =============================  =====================================

    Only the last returns the restitution asked for; `collide` tells what the others return.
    `Hertz`, `HuntCrossley`, `LankaraniNikravesh`, `Flores` and `GonthierCarvalhoMartins` make one.

    Parameters
    ----------
    stiffness : float, N/m^n
        n = 3/2 for a sphere; see `hertz_stiffness`.
    restitution : float, 1
        As asked for.
    loss : {"none", "hunt-crossley", "lankarani-nikravesh", "flores", "exact"}
    exponent : float, 1
    reference_speed : float, m/s
        At which the contact time of step recommendations is taken; it goes with v^-1/5 for n = 3/2.
    """

    stiffness: float = field(metadata=quantity("N/m^1.5", above=0.0))
    restitution: float = field(default=1.0, metadata=quantity("1", above=0.0, at_most=1.0))
    loss: str = field(
        default="none", metadata=choice("none", "hunt-crossley", "lankarani-nikravesh", "flores", "exact")
    )
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


def Hertz(stiffness: float, exponent: float = 1.5, reference_speed: float = 0.25) -> PowerLaw:  # noqa: N802
    """Elastic sphere on a wall, N = k p^1.5: `PowerLaw` without loss; stiffness in N/m^1.5.

    Hertz, 1882.
    """
    return PowerLaw(stiffness, 1.0, "none", exponent, reference_speed)


def HuntCrossley(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with d = 3 (1 - e)/2: right near e = 1.

    Hunt and Crossley, 1975.
    """
    return PowerLaw(stiffness, restitution, "hunt-crossley", exponent, reference_speed)


def LankaraniNikravesh(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with d = 3 (1 - e^2)/4: right near e = 1.

    Lankarani and Nikravesh, 1990.
    """
    return PowerLaw(stiffness, restitution, "lankarani-nikravesh", exponent, reference_speed)


def Flores(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with d = 8 (1 - e)/(5 e): right at both ends.

    Flores et al., 2011.
    """
    return PowerLaw(stiffness, restitution, "flores", exponent, reference_speed)


def GonthierCarvalhoMartins(  # noqa: N802
    stiffness: float, restitution: float, exponent: float = 1.5, reference_speed: float = 0.25
) -> PowerLaw:
    """`PowerLaw` with the exact d: every e comes back.

    Gonthier et al., 2004; Carvalho and Martins, 2019.
    """
    return PowerLaw(stiffness, restitution, "exact", exponent, reference_speed)


@dataclass(frozen=True)
class CustomLaw:
    """A law of one's own: N = force(depth, rate, approach_speed), never below zero.

    Parameters
    ----------
    force : callable
        Plain function of three floats, penetration (m), its rate (m/s) and the approach speed at
        the start of the contact (m/s), to the normal force (N); compiled with numba for the time
        loop. Its elastic part is force(depth, 0, approach_speed).
    name : str
    reference_speed : float, m/s
        At which the contact time of step recommendations is taken.
    """

    force: Callable[[float, float, float], float]
    name: str = field(default="custom", metadata=text())
    reference_speed: float = field(default=0.25, metadata=quantity("m/s", above=0.0))

    def __post_init__(self) -> None:
        check_fields(self)
        require(callable(self.force), "force", self.force, "", "must be a function of depth, rate, approach_speed")


ContactLaw = KelvinVoigt | SwitchingSpring | PowerLaw | CustomLaw | Rigid


def require_law(law: object, key: str = "law") -> None:
    """Raise `InputError` unless the value is a contact law."""
    require(isinstance(law, ContactLaw), key, law, "", "must be a contact law (KelvinVoigt, ..., Rigid)")


@dataclass(frozen=True)
class Material:
    """Elastic constants of a body in contact: young_modulus (Pa) and poisson_ratio (1)."""

    young_modulus: float = field(metadata=quantity("Pa", above=0.0))
    poisson_ratio: float = field(metadata=quantity("1", above=-1.0, at_most=0.5))

    def __post_init__(self) -> None:
        check_fields(self)


STEEL = Material(210e9, 0.30)
ALUMINIUM = Material(70e9, 0.33)


def hertz_stiffness(radius: float, ball: Material, wall: Material) -> float:
    """Stiffness (N/m^1.5) of a sphere on a flat wall: k = 4/3 E* sqrt(R), 1/E* = sum of (1 - nu^2)/E.

    Parameters
    ----------
    radius : float, m
        Of the ball.
    ball, wall : Material

    Returns
    -------
    float, N/m^1.5

    Notes
    -----
    Hertz (1882); Johnson, Contact Mechanics (1985).
    """
    size = checked("radius", radius, quantity("m", above=0.0))
    for key, body in (("ball", ball), ("wall", wall)):
        require_type(body, Material, key)
    compliance = sum((1.0 - body.poisson_ratio**2) / body.young_modulus for body in (ball, wall))
    return 4.0 / 3.0 / compliance * math.sqrt(size)


def loss_factor(law: PowerLaw) -> float:
    """Loss factor d (1) of a power law, by its author's formula."""
    require_type(law, PowerLaw, "law")
    e = law.restitution
    if law.loss == "none":
        return 0.0
    if law.loss == "hunt-crossley":
        return 1.5 * (1.0 - e)
    if law.loss == "lankarani-nikravesh":
        return 0.75 * (1.0 - e * e)
    if law.loss == "flores":
        return 1.6 * (1.0 - e) / e
    return loss_factor_for_restitution(e)


def spring_and_dashpot(law: KelvinVoigt, effective_mass: float) -> tuple[float, float]:
    """Stiffness (N/m) and damping (N s/m) of any of the three complete pairs of a Kelvin-Voigt law."""
    require_type(law, KelvinVoigt, "law")
    effective_mass = checked("effective_mass", effective_mass, quantity("kg", above=0.0))
    if law.restitution is None:
        return law.stiffness or 0.0, law.damping or 0.0
    ratio = damping_ratio_for_restitution(law.restitution)
    stiffness = law.stiffness or 0.0
    if law.contact_time is not None:
        stiffness = effective_mass * (2.0 * linear_angle(ratio) / law.contact_time) ** 2
    return stiffness, 2.0 * ratio * math.sqrt(stiffness * effective_mass)
