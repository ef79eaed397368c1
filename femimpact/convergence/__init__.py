"""Convergence of results with the mesh, the step and the number of kept modes."""

from femimpact.convergence.cases import OverMeshes, OverModes, OverSteps
from femimpact.convergence.mesh_and_step import converge_elements, converge_step
from femimpact.convergence.over_modes import ContactStatistics, mode_convergence
from femimpact.convergence.quantities import (
    BendingMoment,
    Frequencies,
    ModeShapes,
    SteadyResponse,
    SupportReaction,
    SurfaceStress,
)
from femimpact.convergence.study import convergence_study
from femimpact.convergence.table import ConvergenceStudy, ConvergenceTable

__all__ = [
    "BendingMoment", "ContactStatistics", "ConvergenceStudy", "ConvergenceTable", "Frequencies", "ModeShapes",
    "OverMeshes", "OverModes", "OverSteps", "SteadyResponse", "SupportReaction", "SurfaceStress", "converge_elements",
    "converge_step", "convergence_study", "mode_convergence",
]  # fmt: skip
