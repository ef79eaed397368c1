"""The application: study files, runs, results on disk, parameter studies, reports."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
