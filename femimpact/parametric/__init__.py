"""Parameter studies: axes, cases, blocks on disk, statistics over starts, and where they run."""

from femimpact.parametric.definition import ParameterStudy
from femimpact.parametric.evaluation import run_case
from femimpact.parametric.verb import StudyProgress, load_parameter_study, parameter_study
from femimpact.study.best_case import best_case
from femimpact.study.best_design import AxisMargin, BestCase, BestDesign

__all__ = [
    "AxisMargin",
    "BestCase",
    "BestDesign",
    "ParameterStudy",
    "StudyProgress",
    "best_case",
    "load_parameter_study",
    "parameter_study",
    "run_case",
]
