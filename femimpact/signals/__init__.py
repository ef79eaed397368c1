"""What is read from a signal or a curve: damping, decays, spectra, transfer functions, shocks, laser."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
