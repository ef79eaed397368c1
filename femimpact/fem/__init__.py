"""The mesh, and the assembly of a structure on it by scikit-fem."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
