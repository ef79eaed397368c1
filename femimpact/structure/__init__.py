"""The thing on the shaker: beam, bodies, stops, supports, damping."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
