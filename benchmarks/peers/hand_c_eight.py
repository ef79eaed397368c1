"""The C loop on modes with eight cases side by side in SIMD lanes."""

from __future__ import annotations

from peers import Sweep, hand_c
from peers.hand_c import history, missing, usual

__all__ = ["MODES", "NAME", "SETTINGS", "SPACE", "history", "missing", "sweep", "usual"]

NAME = "C by hand, 8 cases side by side"
SPACE = "8 modes"
MODES = 8
SETTINGS = ()
"""One history of eight shows nothing that `hand_c` does not: the arithmetic is the same."""


def sweep(problem, task) -> Sweep:
    """All frequencies, eight at a time."""
    return hand_c.prepared(problem, task, kind="modal eight").go()
