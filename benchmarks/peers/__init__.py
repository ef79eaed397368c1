"""One module a peer: how another tool, or a loop written by hand, solves the benchmark problem.

Each has NAME, SPACE (what its coordinates are), missing() (why it cannot run here, or an empty string) and
any of

- sweep(problem, task, frequencies) -> Sweep
- tip(problem, frequency, duration, level) -> times (s) and tip (m); LEVELS are its settings from coarse to fine.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Sweep(NamedTuple):
    """Peak and rms (m) of the tip in the window, one for each frequency."""

    peak: np.ndarray
    rms: np.ndarray
