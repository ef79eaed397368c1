"""One collision by a method: the restitution that a law achieves with it."""

from __future__ import annotations

from femimpact.errors import checked, quantity, require, require_type
from femimpact.integrators.answers import AchievedRestitution
from femimpact.integrators.methods import Method, require_method
from femimpact.system.contact_pair import ContactPair

__all__ = ["AchievedRestitution", "achieved_restitution"]


def achieved_restitution(
    pair: ContactPair, method: Method, approach_speed: float, phases: int = 32
) -> AchievedRestitution:
    """Restitution that a method achieves when the pair's effective mass collides with a wall in its own steps.

    Parameters
    ----------
    pair : ContactPair
    method : Newmark, HHT, WBZ, GeneralizedAlpha or MoreauJean
        One with a step that takes the pair's law.
    approach_speed : float, m/s
    phases : int
        At how many instants within a step the touch is tried.

    Returns
    -------
    AchievedRestitution

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range, or the method has no step for the pair's law.
    """
    require_type(pair, ContactPair, "pair")
    approach_speed = checked("approach_speed", approach_speed, quantity("m/s", above=0.0))
    phases = checked("phases", phases, quantity("1", at_least=1, at_most=1_000_000, integer=True))
    require_method(method)
    found = method.achieved_restitution(pair, approach_speed, phases)
    if found is None:
        allowed = f"must be a method with a step for the law {pair.law.name}"
        require(False, "method", type(method).__name__, "", allowed)
        raise AssertionError("require raises")
    return found
