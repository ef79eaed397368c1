"""One module a peer: how another tool, or a loop written by hand, solves the benchmark problem.

Each has NAME, SPACE (what its coordinates are), MODES (whose exact history its own is held against: 20 are all
dofs of ten elements), missing() (why it cannot run here, or an empty string), SETTINGS of accuracy from coarse to
fine, usual(task) (the setting that the tasks ask for) and

- history(problem, task, frequency, duration, setting) -> times (s) and tip (m), from rest.

A fast one also has sweep(problem, task) -> Sweep, all frequencies at the usual setting.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Sweep(NamedTuple):
    """Peak and rms (m) of the tip in the window, one for each frequency."""

    peak: np.ndarray
    rms: np.ndarray
