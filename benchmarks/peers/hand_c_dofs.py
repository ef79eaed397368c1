"""The C loop on all dofs, banded, with eight cases side by side in SIMD lanes."""

from __future__ import annotations

import numpy as np

from peers import Sweep, hand_c
from peers.hand_c import missing, usual

__all__ = ["MODES", "NAME", "SETTINGS", "SPACE", "history", "missing", "sweep", "usual"]

NAME = "C by hand, all dofs, 8 cases side by side"
SPACE = "20 dofs"
MODES = 20
SETTINGS = ()


def sweep(problem, task) -> Sweep:
    """All frequencies, eight at a time."""
    return hand_c.prepared(problem, task, kind="physical").go()


def history(problem, task, frequency, duration, setting):
    """The tip after every step of `setting` seconds, of the first of eight equal cases."""
    steps, same = round(duration / setting), [frequency] * hand_c.LANES
    system = problem.full(ball=task.ball)
    run = hand_c.Run("physical", system, problem.amplitude, same, setting, steps, every=1)
    run.go()
    return setting * np.arange(1, steps + 1), run.trace[:, 0].copy()
