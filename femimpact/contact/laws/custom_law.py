"""A contact law whose force is a function of the user's own."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from femimpact.contact.callback import ForceFunction, as_function, is_force, raised_error
from femimpact.contact.collision import Collision, integrated_collision
from femimpact.contact.parameters import ContactParameters
from femimpact.errors import check_fields, checked, quantity, require, text

__all__ = ["CustomLaw"]


@dataclass(frozen=True)
class CustomLaw:
    """A law that a user writes: N = force(depth, rate, approach_speed), never below zero.

    Parameters
    ----------
    force : callable or scipy.LowLevelCallable
        Function of three floats, penetration (m), its rate (m/s) and the approach speed at the start of the contact
        (m/s; see `State` where a run starts within it), to the normal force (N). Its elastic part is
        force(depth, 0, approach_speed). The loop over steps calls it as a C function: a function of Python is compiled
        by numba where that is installed (the extra `laws`), else each call is one of Python, some 0.2 us. C functions
        are taken as they are: of ctypes with three c_double and a c_double returned, of numba.cfunc, or a
        scipy.LowLevelCallable of "double (double, double, double)". A function of Python that raises ends the run with
        its error; a C function cannot raise, and ends the run only by a force that is no finite number.
    name : str
    reference_speed : float, m/s
        At which the contact time of step recommendations is taken.

    Raises
    ------
    InputError
        If the force is no function, or a pointer of another signature, or another value is out of range.
    """

    force: ForceFunction
    name: str = field(default="custom", metadata=text())
    reference_speed: float = field(default=0.25, metadata=quantity("m/s", above=0.0))
    restitution: ClassVar[float | None] = None
    may_be_preloaded: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fields(self)
        require(is_force(self.force), "force", self.force, "", "must be a function of depth, rate, approach_speed")
        as_function(self.force)

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N): what the function gives, none off the wall and never below zero."""
        return max(self._finite_force(depth, rate, approach_speed), 0.0) if depth > 0.0 else 0.0

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored: the integral of force(p, 0, approach_speed)."""
        if depth <= 0.0:
            return 0.0
        from scipy.integrate import quad

        return float(quad(lambda p: self._finite_force(p, 0.0, approach_speed), 0.0, depth)[0])

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision, integrated."""
        return integrated_collision(
            lambda depth, rate: self.normal_force(depth, rate, approach_speed, effective_mass),
            effective_mass,
            approach_speed,
        )

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop, of a collision at the reference speed."""
        typical = self.collide(effective_mass, self.reference_speed)
        return ContactParameters.of_function(typical.contact_time, typical.restitution)

    def force_function(self, effective_mass: float) -> ForceFunction:
        """The function itself."""
        return self.force

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Empty: of a function no number is known."""
        return ()

    def with_restitution(self, restitution: float) -> None:
        """None: the function decides the restitution."""

    def _finite_force(self, depth: float, rate: float, approach_speed: float) -> float:
        try:
            force = as_function(self.force)(depth, rate, approach_speed)
        except Exception as error:
            where = f"at depth {depth:.6g} m, rate {rate:.6g} m/s and approach speed {approach_speed:.6g} m/s"
            raise raised_error(f"{self.name}.force", error, where) from error
        return float(checked(f"{self.name}.force", force, quantity("N")))
