"""The C loop on modes with coarse steps without contact and fine ones within, one case at a time."""

from __future__ import annotations

import numpy as np

from peers import Sweep, hand_c
from peers.hand_c import missing

__all__ = ["MODES", "NAME", "SETTINGS", "SPACE", "history", "missing", "sweep", "usual"]

NAME = "C by hand, adaptive step"
SPACE = "8 modes"
MODES = 8
SETTINGS = (1 / 500, 1 / 1000, 1 / 2000, 1 / 5000, 1 / 10_000, 1 / 20_000, 1 / 50_000, 1 / 100_000)
PARTS = 20
"""Fine steps in a coarse one."""


def usual(task) -> float:
    """Coarse step, s: with the ball, one whose fine steps are those of the task."""
    return PARTS * task.dt if task.ball else task.dt


def _run(problem, task, frequencies, dt, duration, start=0.0, every=0):
    system, steps, first = problem.modal(ball=task.ball), round(duration / dt), round(start / dt)
    return hand_c.Run("modal adaptive", system, problem.amplitude, frequencies, dt, steps, first, every, PARTS)


def sweep(problem, task) -> Sweep:
    """All frequencies, one after the other."""
    start = task.duration - task.window
    return _run(problem, task, problem.frequencies, usual(task), task.duration, start).go()


def history(problem, task, frequency, duration, setting):
    """The tip after every coarse step of `setting` seconds."""
    run = _run(problem, task, [frequency], setting, duration, every=1)
    run.go()
    return setting * np.arange(1, run.steps + 1), run.trace[:, 0].copy()
