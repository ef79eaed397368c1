"""Parameter studies: axes, cases, blocks on disk, statistics over starts, and where they run."""

from femimpact.parametric.definition import ParameterStudy
from femimpact.parametric.evaluation import run_case
from femimpact.parametric.verb import StudyProgress, load_parameter_study, parameter_study

__all__ = ["ParameterStudy", "StudyProgress", "load_parameter_study", "parameter_study", "run_case"]
