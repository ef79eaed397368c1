"""Time integration: the methods, and the verb that runs them in the compiled core."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
