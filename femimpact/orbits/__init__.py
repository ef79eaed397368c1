"""Periodic orbits, stable and unstable: their search, their multipliers, their branches over a parameter."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
