"""The equations of motion: matrices, contacts, states, modes, reduction."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
