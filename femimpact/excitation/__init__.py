"""Excitations of a run: motions of the base, or a force at a place. A new one is a class in a separate file."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
