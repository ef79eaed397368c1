"""Vibro-impact dynamics of beams, and the design of impact dampers on them.

Public names are loaded from their modules on first use, so that `import femimpact` costs nothing.
"""

from femimpact.lazy import face

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = face(__name__, __file__)
__all__.append("__version__")
