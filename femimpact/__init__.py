"""Vibro-impact dynamics of beams, and the design of impact dampers on them.

Public names are loaded from their modules on first use, so that `import femimpact` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from femimpact.calibration import RestitutionScan, scan_restitution
    from femimpact.contact import (
        ALUMINIUM,
        STEEL,
        Collision,
        ContactLaw,
        ContactParameters,
        CustomLaw,
        Flores,
        GonthierCarvalhoMartins,
        Hertz,
        HuntCrossley,
        KelvinVoigt,
        LankaraniNikravesh,
        Material,
        PowerLaw,
        Rigid,
        SwitchingSpring,
        collide,
        contact_force,
        contact_potential,
        hertz_stiffness,
        integrated_collision,
    )
    from femimpact.convergence import ModeConvergence, converge_elements, converge_step, mode_convergence
    from femimpact.errors import DivergenceError, FemimpactError, InputError, InputWarning
    from femimpact.excitation import PointForce, RecordedBase, Sine
    from femimpact.export import figures
    from femimpact.fem.assembly import assemble
    from femimpact.fem.discretisation import Discretisation, discretise
    from femimpact.fem.mesh import Mesh, read_mesh, uniform_mesh
    from femimpact.identification import DampingEstimate, amplitude_ratio_damping, fit_one_pole, half_power
    from femimpact.integrators.collision import achieved_restitution
    from femimpact.integrators.event_driven import EventDriven
    from femimpact.integrators.integrate import integrate
    from femimpact.integrators.stepping.newmark import HHT, WBZ, GeneralizedAlpha, MoreauJean, Newmark
    from femimpact.integrators.stepping.step_size import recommended_step
    from femimpact.response.energy import EnergyLedger
    from femimpact.response.history import HistoryPiece
    from femimpact.response.impacts import Impacts, ImpactStatistics
    from femimpact.response.response import Recorder, Response
    from femimpact.response.sections import StroboscopicSection
    from femimpact.structure.damping import ModalDamping, Rayleigh
    from femimpact.structure.springs import Dashpot, Spring
    from femimpact.structure.structure import (
        Beam,
        Impactor,
        PointMass,
        Segment,
        Stop,
        Structure,
        Support,
        glue_impactors,
    )
    from femimpact.study.results import StudyResults, load
    from femimpact.study.run import run_study
    from femimpact.study.study import Study
    from femimpact.study.study_file import load_study
    from femimpact.sweep import FrequencyResponse, frequency_sweep
    from femimpact.system.damped import with_damping
    from femimpact.system.matrix_files import read_matrix
    from femimpact.system.modes import Modes, solve_modes
    from femimpact.system.own_terms import add_terms
    from femimpact.system.reactions import Reaction
    from femimpact.system.reduction import reduce, truncation_notes
    from femimpact.system.static import static_state
    from femimpact.system.system import ContactPair, State, System, without_impactors

_MODULES = {
    "fem.assembly": ("assemble",),
    "fem.discretisation": ("Discretisation", "discretise"),
    "calibration": ("RestitutionScan", "scan_restitution"),
    "contact": (
        "ALUMINIUM",
        "STEEL",
        "Collision",
        "ContactLaw",
        "ContactParameters",
        "CustomLaw",
        "Flores",
        "GonthierCarvalhoMartins",
        "Hertz",
        "HuntCrossley",
        "KelvinVoigt",
        "LankaraniNikravesh",
        "Material",
        "PowerLaw",
        "Rigid",
        "SwitchingSpring",
        "collide",
        "contact_force",
        "contact_potential",
        "hertz_stiffness",
        "integrated_collision",
    ),
    "convergence": ("ModeConvergence", "converge_elements", "converge_step", "mode_convergence"),
    "structure.damping": ("ModalDamping", "Rayleigh"),
    "response.energy": ("EnergyLedger",),
    "errors": ("DivergenceError", "FemimpactError", "InputError", "InputWarning"),
    "excitation": ("PointForce", "RecordedBase", "Sine"),
    "response.history": ("HistoryPiece",),
    "identification": ("DampingEstimate", "amplitude_ratio_damping", "fit_one_pole", "half_power"),
    "response.impacts": ("ImpactStatistics", "Impacts"),
    "integrators.collision": ("achieved_restitution",),
    "integrators.event_driven": ("EventDriven",),
    "integrators.integrate": ("integrate",),
    "integrators.stepping.newmark": ("HHT", "WBZ", "GeneralizedAlpha", "MoreauJean", "Newmark"),
    "integrators.stepping.step_size": ("recommended_step",),
    "fem.mesh": ("Mesh", "read_mesh", "uniform_mesh"),
    "system.damped": ("with_damping",),
    "system.matrix_files": ("read_matrix",),
    "system.modes": ("Modes", "solve_modes"),
    "system.reduction": ("reduce", "truncation_notes"),
    "response.response": ("Recorder", "Response"),
    "response.sections": ("StroboscopicSection",),
    "system.own_terms": ("add_terms",),
    "system.reactions": ("Reaction",),
    "system.static": ("static_state",),
    "structure.springs": ("Dashpot", "Spring"),
    "structure.structure": (
        "Beam",
        "Impactor",
        "PointMass",
        "Segment",
        "Stop",
        "Structure",
        "Support",
        "glue_impactors",
    ),
    "study.results": ("StudyResults", "load"),
    "study.run": ("run_study",),
    "study.study": ("Study",),
    "study.study_file": ("load_study",),
    "sweep": ("FrequencyResponse", "frequency_sweep"),
    "system.system": ("ContactPair", "State", "System", "without_impactors"),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}
_SUBMODULES = {"figures": "export.figures"}

__all__ = ["__version__", *sorted({*_MODULE_OF, *_SUBMODULES})]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    value: Any
    if name in _SUBMODULES:
        value = importlib.import_module(f"femimpact.{_SUBMODULES[name]}")
    elif name in _MODULE_OF:
        value = getattr(importlib.import_module(f"femimpact.{_MODULE_OF[name]}"), name)
    else:
        raise AttributeError(f"module 'femimpact' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULE_OF, *_SUBMODULES})
