"""Convergence of results with the mesh, the step and the number of kept modes."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
