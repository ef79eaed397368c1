"""Periodic orbits, stable and unstable: their search, their multipliers."""

from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.orbits.search import find_orbit, find_orbits
from femimpact.orbits.two_impacts import two_impact_orbits

__all__ = ["PeriodicOrbit", "find_orbit", "find_orbits", "two_impact_orbits"]
