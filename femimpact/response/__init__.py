"""Results of a run: channels and history, impacts, the energy ledger, regimes."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
