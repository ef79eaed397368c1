"""Figures of results, in one style: every figure is a function of a result.

A figure of one panel takes `ax=None` and returns axes; one of several panels takes `figure=None` and returns
its axes as an array. Without them it is drawn on a new pyplot figure, which a notebook shows. `OffScreen()` in their
place gives a figure that is not shown, for a file. matplotlib is loaded by the first figure. For other figures
in the same style there are `STYLE`, which `matplotlib.rc_context` takes, and `COLOURS`; figures made in `PROJECTOR`
have large print.
"""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)
