"""The protocol of a contact law; force, stored energy and one collision of any law."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from femimpact.contact.collision import EFFECTIVE_MASS, Collision, mass_and_speed
from femimpact.contact.custom_law import ForceFunction, is_force
from femimpact.contact.laws import CUSTOM, KINDS, ContactParameters
from femimpact.errors import checked, having, quantity, require


@runtime_checkable
class ContactLaw(Protocol):
    """A contact law: any object with these attributes is one.

    Numbers are checked before they come here: `effective_mass` (kg) and `approach_speed` (m/s, at the start of the
    contact) are > 0, `depth` (m) is the penetration, negative off the wall, and `rate` (m/s) is its rate.
    """

    @property
    def name(self) -> str:
        """Name of the law in results and messages."""

    @property
    def restitution(self) -> float | None:
        """Restitution (1) that the law was given; None where it follows from other numbers."""

    @property
    def may_be_preloaded(self) -> bool:
        """True if a stop may press on the structure at rest: not where a spring acts from the middle of the gaps."""

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N) that pushes the bodies apart, >= 0; not a number where the contact is an impulse."""

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored at a penetration: the part that the law gives back."""

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision in continuous time, from touch to zero force."""

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop; a law without a compiled branch gives `ContactParameters.of_function`."""

    def force_function(self, effective_mass: float) -> ForceFunction | None:
        """Function of depth, rate and approach speed to the force (N), which the time loop calls as a C function.

        Of Python, of ctypes, or a scipy.LowLevelCallable; see `CustomLaw`. None where the kind of the parameters has
        a compiled branch. The same function object each time is compiled once; a new one is compiled again.
        """

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Name, value and unit of what characterises the contact; empty where no number does."""


MEMBERS = {name: member for name, member in vars(ContactLaw).items() if not name.startswith("_")}
VALUES = tuple(name for name, member in MEMBERS.items() if isinstance(member, property))
METHODS = tuple(name for name in MEMBERS if name not in VALUES)


def a_law() -> dict[str, Any]:
    """Metadata of a field or an argument that holds a contact law; `require_law` names what a user's law misses."""
    return having("a contact law (KelvinVoigt, ..., Rigid)", tuple(MEMBERS))


def require_law(law: object, key: str = "law") -> None:
    """Refuse what is no contact law, and name what a user's law misses."""
    missing = [name for name in VALUES if not hasattr(law, name)]
    missing += [f"{name}()" for name in METHODS if not callable(getattr(law, name, None))]
    allowed = "must be a contact law (KelvinVoigt, ..., Rigid)"
    is_object = not isinstance(law, type)
    if is_object and missing and len(missing) < len(VALUES) + len(METHODS):
        allowed += f"; as one of your own it has no {', '.join(missing)}"
    require(is_object and not missing, key, law, "", allowed)


def resolve(law: ContactLaw, effective_mass: float) -> ContactParameters:
    """Numbers of a law for the effective mass (kg) of its pair, 1/(1/m + phi1^2).

    Contact time (s) and restitution (1) are those at the law's reference speed where they depend on speed.

    Raises `InputError` if a user's law gives parameters of no kind, or no function for the time loop.
    """
    require_law(law)
    mass = float(checked("effective_mass", effective_mass, EFFECTIVE_MASS))
    params = law.parameters(mass)
    sound = isinstance(params, ContactParameters) and params.kind in KINDS
    require(sound, f"{law.name}.parameters", params, "", "must be ContactParameters: see ContactParameters.of_function")
    has_force = params.kind != CUSTOM or is_force(law.force_function(mass))
    allowed = "must give a function of depth, rate, approach_speed: the time loop has no branch for this law"
    require(has_force, f"{law.name}.force_function", None, "", allowed)
    return params


def contact_force(law: ContactLaw, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
    """Normal force of a law (N, pushing the bodies apart).

    Parameters
    ----------
    law : ContactLaw
        A Rigid one has no force: not a number. The switching spring's is beside its wall at gap 0.
    depth : float, m
    rate : float, m/s
    approach_speed : float, m/s
        At the start of the contact.
    effective_mass : float, kg
    """
    require_law(law)
    depth, rate = checked("depth", depth, quantity("m")), checked("rate", rate, quantity("m/s"))
    effective_mass, approach_speed = mass_and_speed(effective_mass, approach_speed)
    return law.normal_force(depth, rate, approach_speed, effective_mass)


def contact_potential(law: ContactLaw, depth: float, effective_mass: float, approach_speed: float = 0.25) -> float:
    """Energy (J) that a law has stored at a penetration (m): the part that it gives back.

    A Rigid contact stores none; of a custom law it is the integral of force(p, 0, v0).
    """
    require_law(law)
    depth = checked("depth", depth, quantity("m"))
    effective_mass, approach_speed = mass_and_speed(effective_mass, approach_speed)
    return law.potential(depth, effective_mass, approach_speed)


def collide(law: ContactLaw, effective_mass: float, approach_speed: float) -> Collision:
    """Send a mass against a wall of the law: m p'' = -N(p, p'), p(0) = 0, p'(0) = v, until N is zero again.

    Parameters
    ----------
    effective_mass : float, kg
    approach_speed : float, m/s

    Returns
    -------
    Collision
        In closed form for the linear and the power laws, by integration for a custom one.

    Raises
    ------
    InputError
        If the energy is beyond numbers, or a custom law never lets go.
    """
    require_law(law)
    return law.collide(*mass_and_speed(effective_mass, approach_speed))
