"""Design of dampers: what a ball in a box takes from whatever shakes it, and the best tuned absorber."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
