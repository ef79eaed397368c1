"""One collision, stepped as the time loop steps it."""

from __future__ import annotations

import numpy as np

from femimpact import core
from femimpact.contact.callback import force_pointer, law_error
from femimpact.errors import require
from femimpact.integrators.answers import AchievedRestitution
from femimpact.integrators.stepping.layout import Law
from femimpact.integrators.stepping.scheme import SteppingMethod, scheme_of
from femimpact.system.contact_pair import ContactPair

__all__ = ["stepped_restitution"]


def stepped_restitution(
    pair: ContactPair, method: SteppingMethod, approach_speed: float, phases: int
) -> AchievedRestitution:
    """Send the pair's effective mass against a wall with the method's own step, and look at the rebound.

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
        If a collision does not end with this step, or a custom law gives a force that is not finite.
    """
    scheme = scheme_of(method, method.dt / method.refine)
    law, force = pair.parameters, pair.law.force_function(pair.effective_mass)
    pointer = None if force is None else force_pointer(force)
    address = 0 if pointer is None else pointer.address
    numbers = Law(
        law.kind, 0.0, np.inf, law.stiffness, law.damping, law.exponent, law.restitution, 0.0, approach_speed, address
    )
    starts = (np.arange(phases) + 0.5) / phases
    runs = [core.collide(numbers, pair.effective_mass, approach_speed, start, scheme) for start in starts]
    for *_, refused in runs:
        if pointer is not None and refused[0] != 0.0:
            raise law_error(pair.name, pointer, *refused)
    if any(np.isnan(ratio) for ratio, *_ in runs):
        allowed = f"must let a collision of {pair.name} end: this one has not within 10,000,000 steps, or has diverged"
        require(False, "method.dt", method.dt, "s", allowed)
    rebound, peak = (np.array(column) for column in list(zip(*runs, strict=True))[:2])
    return AchievedRestitution(
        law.restitution, float(rebound.mean()), float(rebound.min()), float(rebound.max()), float(peak.max())
    )
