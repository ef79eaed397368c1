"""What the mesh, the step and the number of kept modes do to a result."""

from femimpact.convergence.mesh_and_step import MeshConvergence, StepConvergence, converge_elements, converge_step
from femimpact.convergence.over_modes import mode_convergence
from femimpact.convergence.result import ModeConvergence

__all__ = [
    "MeshConvergence", "ModeConvergence", "StepConvergence", "converge_elements", "converge_step", "mode_convergence",
]  # fmt: skip
