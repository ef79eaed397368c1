"""Figures of results, in one style: every figure is a function of a result.

A figure of one panel takes `ax=None` and returns axes; one of several panels takes `figure=None` and returns
its axes as an array. Without them it is drawn on a new pyplot figure, which a notebook shows. `OffScreen()` in their
place gives a figure that is not shown, for a file. matplotlib is loaded by the first figure. For other figures
in the same style there are `STYLE`, which `matplotlib.rc_context` takes, and `COLOURS`.
"""

from femimpact.export.figures.branches import branch, orbit
from femimpact.export.figures.channels import channels, drive
from femimpact.export.figures.contacts import collision_history, contact_laws, impact_histograms, impulse_phase
from femimpact.export.figures.curves import decay, response_columns, response_curve, restitution_scan, value_map
from femimpact.export.figures.drawing import COLOURS, STYLE, OffScreen, save_figure
from femimpact.export.figures.histories import contact_force, cycle_averaged_force, energies
from femimpact.export.figures.orders import (
    convergence,
    convergence_panels,
    mesh_convergence,
    mode_convergence,
    step_convergence,
)
from femimpact.export.figures.portraits import bifurcation, motion, phase_portrait
from femimpact.export.figures.shapes import beam_mesh, mode_shapes
from femimpact.export.figures.spectra import shock_response_spectrum, spectrum, transfer_function
from femimpact.export.figures.studies import calibration, study_lines, study_map, study_maps, study_scatter
from femimpact.spectra import amplitude_spectrum

__all__ = [
    "COLOURS", "STYLE", "OffScreen", "amplitude_spectrum", "beam_mesh", "bifurcation", "branch", "calibration",
    "channels", "collision_history", "contact_force", "contact_laws", "convergence", "convergence_panels",
    "cycle_averaged_force", "decay", "drive", "energies", "impact_histograms", "impulse_phase", "mesh_convergence",
    "mode_convergence", "mode_shapes", "motion", "orbit", "phase_portrait", "response_columns", "response_curve",
    "restitution_scan", "save_figure", "shock_response_spectrum", "spectrum", "step_convergence", "study_lines",
    "study_map", "study_maps", "study_scatter", "transfer_function", "value_map",
]  # fmt: skip


def __dir__() -> list[str]:
    return sorted(__all__)
