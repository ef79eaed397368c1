"""Vibro-impact dynamics of beams, and the design of impact dampers on them.

Public names are loaded from their modules on first use, so that `import femimpact` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from femimpact.absorber import tuned_absorber as tuned_absorber
    from femimpact.calibration import RestitutionScan as RestitutionScan
    from femimpact.calibration import scan_restitution as scan_restitution
    from femimpact.contact import ALUMINIUM as ALUMINIUM
    from femimpact.contact import STEEL as STEEL
    from femimpact.contact import Collision as Collision
    from femimpact.contact import ContactLaw as ContactLaw
    from femimpact.contact import CustomLaw as CustomLaw
    from femimpact.contact import Material as Material
    from femimpact.contact import collide as collide
    from femimpact.contact import contact_force as contact_force
    from femimpact.contact import contact_potential as contact_potential
    from femimpact.contact import hertz_stiffness as hertz_stiffness
    from femimpact.contact import integrated_collision as integrated_collision
    from femimpact.contact.laws import ContactParameters as ContactParameters
    from femimpact.contact.laws import Flores as Flores
    from femimpact.contact.laws import GonthierCarvalhoMartins as GonthierCarvalhoMartins
    from femimpact.contact.laws import Hertz as Hertz
    from femimpact.contact.laws import HuntCrossley as HuntCrossley
    from femimpact.contact.laws import KelvinVoigt as KelvinVoigt
    from femimpact.contact.laws import LankaraniNikravesh as LankaraniNikravesh
    from femimpact.contact.laws import PowerLaw as PowerLaw
    from femimpact.contact.laws import Rigid as Rigid
    from femimpact.contact.laws import SwitchingSpring as SwitchingSpring
    from femimpact.convergence import BendingMoment as BendingMoment
    from femimpact.convergence import ContactStatistics as ContactStatistics
    from femimpact.convergence import ConvergenceStudy as ConvergenceStudy
    from femimpact.convergence import ConvergenceTable as ConvergenceTable
    from femimpact.convergence import Frequencies as Frequencies
    from femimpact.convergence import ModeShapes as ModeShapes
    from femimpact.convergence import OverMeshes as OverMeshes
    from femimpact.convergence import OverModes as OverModes
    from femimpact.convergence import OverSteps as OverSteps
    from femimpact.convergence import SteadyResponse as SteadyResponse
    from femimpact.convergence import SupportReaction as SupportReaction
    from femimpact.convergence import SurfaceStress as SurfaceStress
    from femimpact.convergence import converge_elements as converge_elements
    from femimpact.convergence import converge_step as converge_step
    from femimpact.convergence import convergence_study as convergence_study
    from femimpact.convergence import mode_convergence as mode_convergence
    from femimpact.errors import DivergenceError as DivergenceError
    from femimpact.errors import FemimpactError as FemimpactError
    from femimpact.errors import InputError as InputError
    from femimpact.errors import InputWarning as InputWarning
    from femimpact.excitation import Chirp as Chirp
    from femimpact.excitation import Drives as Drives
    from femimpact.excitation import HammerBlow as HammerBlow
    from femimpact.excitation import PiecewisePolynomial as PiecewisePolynomial
    from femimpact.excitation import PointForce as PointForce
    from femimpact.excitation import RandomBase as RandomBase
    from femimpact.excitation import RecordedBase as RecordedBase
    from femimpact.excitation import Shock as Shock
    from femimpact.excitation import Sine as Sine
    from femimpact.excitation import SteppedSine as SteppedSine
    from femimpact.excitation import Sum as Sum
    from femimpact.excitation.record_files import read_record as read_record
    from femimpact.export import figures as figures
    from femimpact.export.movie import write_movie as write_movie
    from femimpact.export.records import write_record as write_record
    from femimpact.export.vtk import to_pyvista as to_pyvista
    from femimpact.fem.assembly import assemble as assemble
    from femimpact.fem.discretisation import Discretisation as Discretisation
    from femimpact.fem.discretisation import discretise as discretise
    from femimpact.fem.mesh import Mesh as Mesh
    from femimpact.fem.mesh import graded_mesh as graded_mesh
    from femimpact.fem.mesh import random_mesh as random_mesh
    from femimpact.fem.mesh import uniform_mesh as uniform_mesh
    from femimpact.fem.mesh_files import read_mesh as read_mesh
    from femimpact.identification import DampingEstimate as DampingEstimate
    from femimpact.identification import DecayEstimate as DecayEstimate
    from femimpact.identification import DecayMode as DecayMode
    from femimpact.identification import amplitude_ratio_damping as amplitude_ratio_damping
    from femimpact.identification import fit_one_pole as fit_one_pole
    from femimpact.identification import half_power as half_power
    from femimpact.identification import identify_decay as identify_decay
    from femimpact.integrators.event_driven import EventDriven as EventDriven
    from femimpact.integrators.preflight_row import PreflightRow as PreflightRow
    from femimpact.integrators.runs import achieved_restitution as achieved_restitution
    from femimpact.integrators.runs import integrate as integrate
    from femimpact.integrators.stepping.newmark import HHT as HHT
    from femimpact.integrators.stepping.newmark import WBZ as WBZ
    from femimpact.integrators.stepping.newmark import GeneralizedAlpha as GeneralizedAlpha
    from femimpact.integrators.stepping.newmark import MoreauJean as MoreauJean
    from femimpact.integrators.stepping.newmark import Newmark as Newmark
    from femimpact.integrators.stepping.operators import recommended_step as recommended_step
    from femimpact.laser import Laser as Laser
    from femimpact.laser import LaserReading as LaserReading
    from femimpact.laser import extrapolate as extrapolate
    from femimpact.orbits import Bifurcation as Bifurcation
    from femimpact.orbits import Branch as Branch
    from femimpact.orbits import PeriodicOrbit as PeriodicOrbit
    from femimpact.orbits import continue_orbit as continue_orbit
    from femimpact.orbits import find_orbit as find_orbit
    from femimpact.orbits import find_orbits as find_orbits
    from femimpact.orbits import switch_branch as switch_branch
    from femimpact.orbits import two_impact_orbits as two_impact_orbits
    from femimpact.parametric import AxisMargin as AxisMargin
    from femimpact.parametric import BestCase as BestCase
    from femimpact.parametric import BestDesign as BestDesign
    from femimpact.parametric import ParameterStudy as ParameterStudy
    from femimpact.parametric import StudyProgress as StudyProgress
    from femimpact.parametric import best_case as best_case
    from femimpact.parametric import load_parameter_study as load_parameter_study
    from femimpact.parametric import parameter_study as parameter_study
    from femimpact.parametric import run_case as run_case
    from femimpact.parametric.measured_peaks import CalibratedParameter as CalibratedParameter
    from femimpact.parametric.measured_peaks import Calibration as Calibration
    from femimpact.parametric.measured_peaks import calibrate as calibrate
    from femimpact.parametric.planned_test import Preflight as Preflight
    from femimpact.parametric.planned_test import preflight as preflight
    from femimpact.refinement import Refinement as Refinement
    from femimpact.refinement import refine as refine
    from femimpact.response.energy import EnergyLedger as EnergyLedger
    from femimpact.response.history import HistoryPiece as HistoryPiece
    from femimpact.response.history import StroboscopicSection as StroboscopicSection
    from femimpact.response.impacts import EventLog as EventLog
    from femimpact.response.impacts import Impacts as Impacts
    from femimpact.response.impacts import ImpactStatistics as ImpactStatistics
    from femimpact.response.response import Recorder as Recorder
    from femimpact.response.response import Response as Response
    from femimpact.response.signals import Largest as Largest
    from femimpact.spectra import ShockResponseSpectrum as ShockResponseSpectrum
    from femimpact.spectra import Spectrum as Spectrum
    from femimpact.spectra import TransferFunction as TransferFunction
    from femimpact.spectra import measured_transfer as measured_transfer
    from femimpact.spectra import shock_response_spectrum as shock_response_spectrum
    from femimpact.spectra import spectrum as spectrum
    from femimpact.spectra import transfer_function as transfer_function
    from femimpact.structure.beam import Beam as Beam
    from femimpact.structure.beam import Segment as Segment
    from femimpact.structure.damping import ModalDamping as ModalDamping
    from femimpact.structure.damping import Rayleigh as Rayleigh
    from femimpact.structure.structure import Absorber as Absorber
    from femimpact.structure.structure import Dashpot as Dashpot
    from femimpact.structure.structure import Impactor as Impactor
    from femimpact.structure.structure import PointMass as PointMass
    from femimpact.structure.structure import Spring as Spring
    from femimpact.structure.structure import Stop as Stop
    from femimpact.structure.structure import Structure as Structure
    from femimpact.structure.structure import Support as Support
    from femimpact.structure.structure import glue_impactors as glue_impactors
    from femimpact.study.branch_file import load_branch as load_branch
    from femimpact.study.results import StudyResults as StudyResults
    from femimpact.study.results import load as load
    from femimpact.study.run import run_study as run_study
    from femimpact.study.script_page import report as report
    from femimpact.study.study import Study as Study
    from femimpact.study.study_file import load_study as load_study
    from femimpact.sweep import FrequencyResponse as FrequencyResponse
    from femimpact.sweep import frequency_sweep as frequency_sweep
    from femimpact.system.added_terms import add_terms as add_terms
    from femimpact.system.contact_pair import ContactPair as ContactPair
    from femimpact.system.hermite import Reaction as Reaction
    from femimpact.system.matrix_files import read_matrix as read_matrix
    from femimpact.system.modes import Modes as Modes
    from femimpact.system.modes import solve_modes as solve_modes
    from femimpact.system.modes import with_damping as with_damping
    from femimpact.system.reduction import reduce as reduce
    from femimpact.system.reduction import truncation_notes as truncation_notes
    from femimpact.system.state import State as State
    from femimpact.system.static import static_state as static_state
    from femimpact.system.system import System as System
    from femimpact.system.system import without_impactors as without_impactors
    from femimpact.versions import show_versions as show_versions

_MODULES = {
    "absorber": ("tuned_absorber",),
    "calibration": ("RestitutionScan", "scan_restitution"),
    "contact": (
        "ALUMINIUM", "Collision", "ContactLaw", "CustomLaw", "Material", "STEEL", "collide", "contact_force",
        "contact_potential", "hertz_stiffness", "integrated_collision",
    ),
    "contact.laws": (
        "ContactParameters", "Flores", "GonthierCarvalhoMartins", "Hertz", "HuntCrossley", "KelvinVoigt",
        "LankaraniNikravesh", "PowerLaw", "Rigid", "SwitchingSpring",
    ),
    "convergence": (
        "BendingMoment", "ContactStatistics", "ConvergenceStudy", "ConvergenceTable", "Frequencies",
        "ModeShapes", "OverMeshes", "OverModes", "OverSteps", "SteadyResponse", "SupportReaction", "SurfaceStress",
        "converge_elements", "converge_step", "convergence_study", "mode_convergence",
    ),
    "errors": ("DivergenceError", "FemimpactError", "InputError", "InputWarning"),
    "excitation": (
        "Chirp", "Drives", "HammerBlow", "PiecewisePolynomial", "PointForce", "RandomBase", "RecordedBase", "Shock",
        "Sine", "SteppedSine", "Sum",
    ),
    "export.movie": ("write_movie",),
    "excitation.record_files": ("read_record",),
    "export.records": ("write_record",),
    "export.vtk": ("to_pyvista",),
    "fem.assembly": ("assemble",),
    "fem.discretisation": ("Discretisation", "discretise"),
    "fem.mesh": ("Mesh", "graded_mesh", "random_mesh", "uniform_mesh"),
    "fem.mesh_files": ("read_mesh",),
    "identification": (
        "DampingEstimate", "DecayEstimate", "DecayMode", "amplitude_ratio_damping", "fit_one_pole", "half_power",
        "identify_decay",
    ),
    "integrators.event_driven": ("EventDriven",),
    "integrators.runs": ("achieved_restitution", "integrate"),
    "integrators.stepping.newmark": ("GeneralizedAlpha", "HHT", "MoreauJean", "Newmark", "WBZ"),
    "integrators.stepping.operators": ("recommended_step",),
    "laser": ("Laser", "LaserReading", "extrapolate"),
    "orbits": (
        "Bifurcation", "Branch", "PeriodicOrbit", "continue_orbit", "find_orbit", "find_orbits", "switch_branch",
        "two_impact_orbits",
    ),
    "parametric": (
        "AxisMargin", "BestCase", "BestDesign", "ParameterStudy", "StudyProgress", "best_case", "load_parameter_study",
        "parameter_study", "run_case",
    ),
    "parametric.measured_peaks": ("CalibratedParameter", "Calibration", "calibrate"),
    "parametric.planned_test": ("Preflight", "preflight"),
    "integrators.preflight_row": ("PreflightRow",),
    "refinement": ("Refinement", "refine"),
    "response.energy": ("EnergyLedger",),
    "response.history": ("HistoryPiece", "StroboscopicSection"),
    "response.impacts": ("EventLog", "ImpactStatistics", "Impacts"),
    "response.response": ("Recorder", "Response"),
    "response.signals": ("Largest",),
    "spectra": (
        "ShockResponseSpectrum", "Spectrum", "TransferFunction", "measured_transfer", "shock_response_spectrum",
        "spectrum", "transfer_function",
    ),
    "structure.beam": ("Beam", "Segment"),
    "structure.damping": ("ModalDamping", "Rayleigh"),
    "structure.structure": (
        "Absorber", "Dashpot", "Impactor", "PointMass", "Spring", "Stop", "Structure", "Support", "glue_impactors",
    ),
    "study.branch_file": ("load_branch",),
    "study.results": ("StudyResults", "load"),
    "study.run": ("run_study",),
    "study.script_page": ("report",),
    "study.study": ("Study",),
    "study.study_file": ("load_study",),
    "sweep": ("FrequencyResponse", "frequency_sweep"),
    "system.added_terms": ("add_terms",),
    "system.contact_pair": ("ContactPair",),
    "system.hermite": ("Reaction",),
    "system.matrix_files": ("read_matrix",),
    "system.modes": ("Modes", "solve_modes", "with_damping"),
    "system.reduction": ("reduce", "truncation_notes"),
    "system.state": ("State",),
    "system.static": ("static_state",),
    "system.system": ("System", "without_impactors"),
    "versions": ("show_versions",),
}  # fmt: skip
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}
_SUBMODULES = {"figures": "export.figures"}

__all__ = ["__version__", *sorted({*_MODULE_OF, *_SUBMODULES})]  # pyright: ignore[reportUnsupportedDunderAll]


if not TYPE_CHECKING:
    # seen by a type checker, it would give a type to every misspelt name

    def __getattr__(name: str) -> Any:
        if name in _SUBMODULES:
            value = importlib.import_module(f"femimpact.{_SUBMODULES[name]}")
        elif name in _MODULE_OF:
            value = getattr(importlib.import_module(f"femimpact.{_MODULE_OF[name]}"), name)
            if isinstance(value, type):
                importlib.import_module("femimpact.errors").show_ranges(value)
        else:
            raise AttributeError(f"module 'femimpact' has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return __all__
