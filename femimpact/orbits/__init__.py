"""Periodic orbits, stable and unstable: their search, their multipliers, their branches over a parameter."""

from femimpact.orbits.branch import Bifurcation, Branch, continue_orbit
from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.orbits.search import find_orbit, find_orbits, two_impact_orbits
from femimpact.orbits.switching import switch_branch

__all__ = [
    "Bifurcation", "Branch", "PeriodicOrbit", "continue_orbit", "find_orbit", "find_orbits", "switch_branch",
    "two_impact_orbits",
]  # fmt: skip
