"""One collision, stepped as the time loop steps it: the restitution that a law achieves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from femimpact.errors import check_fields, checked, quantity, require_type
from femimpact.integrators.compiled.custom import address_of
from femimpact.integrators.compiled.laws import LawNumbers
from femimpact.integrators.stepping import touch
from femimpact.integrators.stepping.newmark import SteppingMethod, require_method, scheme_of
from femimpact.system.system import ContactPair

__all__ = ["AchievedRestitution", "achieved_restitution"]


@dataclass(frozen=True)
class AchievedRestitution:
    """Restitution of one collision, in continuous time and with a step.

    Parameters
    ----------
    exact : float, 1
        Of the law, in continuous time.
    mean, lowest, highest : float, 1
        With the step, over the instants within a step at which the touch can fall.
    peak_force : float, N
        Largest with the step, at the approach speed given.
    """

    exact: float = field(metadata=quantity("1", at_least=0.0, finite=False))
    mean: float = field(metadata=quantity("1", finite=False))
    lowest: float = field(metadata=quantity("1", finite=False))
    highest: float = field(metadata=quantity("1", finite=False))
    peak_force: float = field(metadata=quantity("N", at_least=0.0, finite=False))

    def __post_init__(self) -> None:
        check_fields(self)


def achieved_restitution(
    pair: ContactPair, method: SteppingMethod, approach_speed: float, phases: int = 32
) -> AchievedRestitution:
    """Throw the pair's effective mass at a wall with the method's own step, and look at the rebound.

    Parameters
    ----------
    pair : ContactPair
    method : SteppingMethod
    approach_speed : float, m/s
    phases : int
        At how many instants within a step the touch is tried.

    Returns
    -------
    AchievedRestitution

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range.
    """
    require_type(pair, ContactPair, "pair")
    approach_speed = checked("approach_speed", approach_speed, quantity("m/s", above=0.0))
    phases = checked("phases", phases, quantity("1", at_least=1, at_most=1_000_000, integer=True))
    require_method(method)
    scheme = scheme_of(method, method.dt / method.refine)
    law, force = pair.parameters, pair.law.force_function(pair.effective_mass)
    address = 0 if force is None else address_of(force)
    numbers = LawNumbers(
        law.kind, 0.0, np.inf, law.stiffness, law.damping, law.exponent, law.restitution, 0.0, approach_speed, address
    )
    starts = (np.arange(phases) + 0.5) / phases
    runs = [touch.collide(numbers, pair.effective_mass, approach_speed, start, scheme) for start in starts]
    rebound, peak = (np.array(column) for column in zip(*runs, strict=True))
    return AchievedRestitution(
        law.restitution, float(rebound.mean()), float(rebound.min()), float(rebound.max()), float(peak.max())
    )
