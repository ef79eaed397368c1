"""What the number of kept modes does to an impacting response."""

from femimpact.truncation.over_modes import mode_convergence
from femimpact.truncation.result import ModeConvergence

__all__ = ["ModeConvergence", "mode_convergence"]
