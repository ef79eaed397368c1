"""One good value of every public noun, and every public verb with good arguments: what tables of inputs go through."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
from builders import MeshChoice, OrbitsPlan, Output, Reduction, SweepPlan, paper_study

import femimpact as fi
from femimpact.app.study.study import Gravity
from femimpact.integrators.cases import AchievedRestitution
from femimpact.response.cycles import CycleStatistics
from femimpact.response.impacts import StickingPhases, event_log, event_width
from femimpact.response.regimes import Regime, RegimeCriteria
from femimpact.signals.one_pole import one_pole_amplitude

LAW = fi.KelvinVoigt(restitution=0.6, contact_time=5e-3)
STEEL_BALL = fi.Impactor("ball", "tip", 3e-3, 1e-3, LAW, material="steel", wall="aluminium")
STRUCTURE = fi.Structure(
    beam=fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700.0),
    masses=(fi.PointMass("box", "tip", 0.02),),
    impactors=(fi.Impactor("ball", "tip", 3e-3, 1e-3, LAW),),
    stops=(fi.Stop("wall", "mid", (math.inf, 5e-3), LAW),),
    damping=fi.Rayleigh(0.01, modes=(1, 2)),
)
MOTIONS = {
    "Chirp": fi.Chirp(4.0, 8.0, 1.0, amplitude=1e-3),
    "Drives": fi.Sine(1e-3, 5.0) + fi.HammerBlow("tip", 0.1, 1e-3),
    "HammerBlow": fi.HammerBlow("tip", 0.1, 1e-3),
    "RandomBase": fi.RandomBase([(4.0, 0.1), (8.0, 0.1)], 2.0),
    "Shock": fi.Shock("half-sine", acceleration=10.0, duration=0.01),
    "SteppedSine": fi.SteppedSine([4.0, 5.0], 2, amplitude=1e-3),
    "Sum": fi.Sine(1e-3, 5.0) + fi.Sine(1e-3, 6.0),
}
"""Excitations of which displacement, velocity and acceleration take times."""
PIECES = fi.excitation.PiecewisePolynomial([0.0, 1.0], [[1.0, 2.0]])
BASE = fi.Sine(2e-3, 6.0)
LASER = fi.Laser("tip", range=5e-4, noise=1e-6, sample_rate=900.0, offset=1e-5)
STATE = fi.State(displacement=[0.0, 1e-4], ball_velocity=[0.1])
CURVE = np.linspace(5.0, 7.0, 41), one_pole_amplitude(np.linspace(5.0, 7.0, 41), 1e-3, 6.0, 0.01)

DECAY = 0.01 * np.arange(200), np.exp(-0.006 * np.arange(200)) * np.cos(0.3 * np.arange(200))


@cache
def system() -> fi.System:
    return fi.assemble(STRUCTURE, elements=4)


@cache
def grid() -> fi.fem.Discretisation:
    return fi.fem.discretise(STRUCTURE, elements=4)


@cache
def small() -> fi.System:
    return fi.reduce(system(), 2)


@cache
def oscillators() -> fi.System:
    M, C, K = np.diag([1.0, 2.0]), np.diag([0.1, 0.2]), np.array([[300.0, -100.0], [-100.0, 100.0]])
    ball = fi.Impactor("ball", "first", 0.1, 1e-3, LAW)
    return fi.System.from_matrices(M, C, K, points={"first": [1.0, 0.0], "second": [0.0, 1.0]}, impactors=[ball])


@cache
def response() -> fi.response.Response:
    method = fi.Newmark(2e-4)
    return fi.integrate(small(), BASE, method, 1.0, fi.Recorder(("tip", "ball"), every=5, snapshots=500))


@cache
def curve() -> fi.sweep.FrequencyResponse:
    bare = fi.without_impactors(small())
    return fi.frequency_sweep(bare, 1e-4, np.linspace(5.0, 7.0, 5), fi.Newmark(1e-3, allow_coarse_step=True), 12)


def parameter_study() -> dict[str, object]:
    """Good arguments of a parameter study."""
    return {
        "study": small(), "axes": {"impactor.ball.gap": [1e-3, 2e-3]}, "measures": ["peak"], "starts": 2, "seed": 1,
        "sample": None, "cycles": 3, "excitation": BASE, "method": None, "at": "tip", "elements": 4, "modes": 2,
        "version": None,
    }  # fmt: skip


def columns(kind: type, sizes: dict[str | int, int], **given: object) -> object:
    """A record of a kind with arrays of ones, of the given length along each of its axes."""
    values = {}
    for item in fields(kind):
        if "axes" in item.metadata and item.name not in given:
            values[item.name] = np.ones([sizes.get(axis, axis) for axis in item.metadata["axes"]])
    return kind(**{**values, **given})


@cache
def piece() -> fi.response.HistoryPiece:
    kept = response()
    return fi.response.HistoryPiece(kept.time, kept.channels, kept.units, kept.energy, kept.snapshots, kept.base)


def convergence_table() -> fi.convergence.ConvergenceTable:
    sizes = {"cases": 3, "quantities": 4}
    texts = {name: np.array(["a", "b", "c"]) for name in ("label", "failure")}
    texts |= {name: np.array(["a", "b", "c", "d"]) for name in ("name", "unit")}
    return columns(fi.convergence.ConvergenceTable, sizes, axis="mesh", accuracy=1e-3, notes=("note",), **texts)


@cache
def orbit() -> fi.orbits.PeriodicOrbit:
    """Two impacts a cycle of a ball in a box."""
    ball = fi.Impactor("ball", "tip", 0.1, 10.0, fi.Rigid(0.8))
    box = fi.System.from_matrices([[1.0]], [[0.02]], [[1.0]], points={"tip": [1.0]}, impactors=[ball])
    return fi.orbits.two_impact_orbits(box, fi.PointForce("tip", fi.Sine(1.0, 1.0 / (2.0 * math.pi))))[0]


@cache
def branch() -> fi.orbits.Branch:
    """A fold in it."""
    return fi.continue_orbit(orbit(), "amplitude", to=(0.5, 1.5))


NOUNS = {
    "Bifurcation": lambda: branch().bifurcations[0],
    "Branch": branch,
    "BendingMoment": lambda: fi.convergence.BendingMoment("root", 1, "left"),
    "ContactStatistics": lambda: fi.convergence.ContactStatistics(4, 48, "tip"),
    "ConvergenceStudy": lambda: fi.convergence.ConvergenceStudy({"mesh": convergence_table()}),
    "ConvergenceTable": convergence_table,
    "Frequencies": lambda: fi.convergence.Frequencies(2),
    "ModeShapes": lambda: fi.convergence.ModeShapes(2),
    "OverMeshes": lambda: fi.convergence.OverMeshes(
        tuple(fi.uniform_mesh(STRUCTURE, n) for n in (2, 4)), ("coarse", "fine")
    ),
    "OverModes": lambda: fi.convergence.OverModes(fi.uniform_mesh(STRUCTURE, 4), (1, 2, 3)),
    "OverSteps": lambda: fi.convergence.OverSteps(fi.uniform_mesh(STRUCTURE, 4), fi.Newmark(1e-3), 2),
    "SteadyResponse": lambda: fi.convergence.SteadyResponse(("tip", 0.1)),
    "SupportReaction": lambda: fi.convergence.SupportReaction("root.force"),
    "SurfaceStress": lambda: fi.convergence.SurfaceStress("root", 1, "left"),
    "Absorber": lambda: fi.Absorber("absorber", "mid", 1e-3, 4.0, 0.02),
    "Beam": lambda: STRUCTURE.beam,
    "ContactPair": lambda: system().contacts[0],
    "CustomLaw": lambda: fi.CustomLaw(lambda depth, rate, speed: 1e4 * depth),
    "Dashpot": lambda: fi.Dashpot("dashpot", "mid", 1.0, to=0.05),
    "DampingEstimate": lambda: fi.signals.DampingEstimate(0.01, 6.0, (0.009, 0.011), "fit", ("warning",)),
    "DecayEstimate": lambda: fi.identify_decay(*DECAY),
    "DecayMode": lambda: fi.signals.DecayMode(5.0, 0.01, 1e-3, (4.9, 5.1), (0.009, 0.011)),
    "EnergyLedger": lambda: response().energy,
    "EventDriven": fi.EventDriven,
    "EventLog": lambda: event_log(np.ones((2, event_width(2, 3))), 3, ("ball", "stop")),
    "FrequencyResponse": curve,
    "GeneralizedAlpha": lambda: fi.GeneralizedAlpha(1e-4),
    "HHT": lambda: fi.HHT(1e-4),
    "HistoryPiece": piece,
    "Impactor": lambda: STRUCTURE.impactors[0],
    "ImpactStatistics": lambda: response().statistics,
    "Impacts": lambda: response().impacts,
    "KelvinVoigt": lambda: LAW,
    "Largest": lambda: fi.response.Largest(-1.0, 0.5, "m"),
    "Material": lambda: fi.contact.STEEL,
    "Mesh": lambda: fi.fem.Mesh([0.0, 0.1, 0.2], {"sensor": 0.1}, {"root half": [0]}),
    "ModalDamping": lambda: fi.ModalDamping((0.01, 0.02)),
    "Modes": lambda: fi.solve_modes(system(), 2),
    "MoreauJean": lambda: fi.MoreauJean(1e-4),
    "Newmark": lambda: fi.Newmark(1e-4),
    **{name: (lambda base=base: base) for name, base in MOTIONS.items()},
    "PeriodicOrbit": orbit,
    "PiecewisePolynomial": lambda: PIECES,
    "LineLoad": lambda: fi.excitation.LineLoad(3.0),
    "PointForce": lambda: fi.PointForce("tip", BASE),
    "PointMass": lambda: STRUCTURE.masses[0],
    "PowerLaw": lambda: fi.contact.Flores(1e7, 0.7),
    "Rest": lambda: fi.Rest(),
    "Rayleigh": lambda: fi.Rayleigh((0.01, 0.02), modes=(1, 2)),
    "RecordedBase": lambda: fi.RecordedBase([0.0, 1.0, 0.5], 0.1),
    "ParameterStudy": lambda: fi.app.ParameterStudy(**parameter_study()),
    "StudyProgress": lambda: fi.app.StudyProgress(cases=8, finished=4, found=0, failed=0, rate=2.0),
    "Recorder": lambda: fi.Recorder(("tip", 0.1)),
    "Response": response,
    "Rigid": lambda: fi.Rigid(0.7),
    "Segment": lambda: fi.Segment(0.2, 70e9, 2700.0, 0.02, 1e-3, end_width=0.01, end_thickness=5e-4),
    "Sine": lambda: BASE,
    "Spring": lambda: fi.Spring("spring", "mid", 100.0, to="tip"),
    "State": lambda: STATE,
    "Laser": lambda: LASER,
    "LaserReading": lambda: LASER.measure(response()),
    "StroboscopicSection": lambda: response().stroboscopic(),
    "Axial": lambda: fi.Axial(acceleration=9.81, spin=2.0, hub=0.1, tension=0.5, spin_plane="lag"),
    "Meeting": lambda: fi.Meeting("ab", ("a", "b"), 1e-3, LAW),
    "Stop": lambda: STRUCTURE.stops[0],
    "Structure": lambda: STRUCTURE,
    "Study": paper_study,
    "Support": lambda: fi.Support("clamped", "root"),
    "SwitchingSpring": lambda: fi.contact.SwitchingSpring(1.0, 1e4),
    "System": system,
    "WBZ": lambda: fi.WBZ(1e-4),
    # of results and studies, reached through others
    "AchievedRestitution": lambda: AchievedRestitution(0.6, 0.6, 0.5, 0.7, 1.0),
    "Collision": lambda: fi.collide(LAW, 3e-3, 0.2),
    "CycleStatistics": lambda: columns(CycleStatistics, {"cycles": 8, "cases": 2}),
    "Gravity": lambda: Gravity(-9.81),
    "MeshChoice": lambda: MeshChoice(elements=4),
    "Output": Output,
    "Reduction": lambda: Reduction(4),
    "Regime": lambda: Regime("periodic", 2, 1, "2:1 periodic", "words"),
    "RegimeCriteria": RegimeCriteria,
    "StickingPhases": lambda: columns(StickingPhases, {"states": 1}, impactor=np.array(["ball"])),
    "Snapshots": lambda: response().snapshots,
    "SteadyMotion": lambda: response().steady,
    "OrbitsPlan": lambda: OrbitsPlan("frequency", (4.0, 6.0), 10.0, switch=("grazing",)),
    "SweepPlan": lambda: SweepPlan(4.0, 6.0, 21, 300),
}
"""Every noun by its name."""


def no_beam(**given: object) -> fi.System:
    return fi.System.from_matrices(**{"M": 1.0, "C": 0.1, "K": 40.0, "points": {"p": [1.0]}, **given})


VERBS = {
    "add_terms": (fi.system.add_terms, lambda: {
        "system": system(), "stiffness": np.eye(10), "mass": 1e-3 * np.eye(10), "damping": np.eye(10),
        "load": np.ones(10),
    }),
    "assemble": (fi.assemble, lambda: {"structure": STRUCTURE, "elements": 4}),
    "assemble on a mesh": (fi.assemble, lambda: {"structure": STRUCTURE, "mesh": fi.uniform_mesh(STRUCTURE, 4)}),
    "discretise": (fi.fem.discretise, lambda: {"structure": STRUCTURE, "elements": 4}),
    "Discretisation.at_quadrature": (lambda values: grid().at_quadrature(values), lambda: {"values": np.ones(4)}),
    "Discretisation.position_of": (lambda at: grid().position_of(at), lambda: {"at": 0.1}),
    "Hertz": (fi.Hertz, lambda: {"stiffness": 1e7, "exponent": 1.5, "reference_speed": 0.2}),
    "HuntCrossley": (fi.HuntCrossley, lambda: {"stiffness": 1e7, "restitution": 0.7}),
    "LankaraniNikravesh": (fi.contact.LankaraniNikravesh, lambda: {"stiffness": 1e7, "restitution": 0.7}),
    "Flores": (fi.contact.Flores, lambda: {"stiffness": 1e7, "restitution": 0.7}),
    "GonthierCarvalhoMartins": (fi.contact.GonthierCarvalhoMartins, lambda: {"stiffness": 1e7, "restitution": 0.7}),
    "collide": (fi.collide, lambda: {"law": LAW, "effective_mass": 3e-3, "approach_speed": 0.2}),
    "contact_force": (fi.contact.contact_force, lambda: {
        "law": LAW, "depth": 1e-4, "rate": 0.1, "approach_speed": 0.2, "effective_mass": 3e-3
    }),
    "contact_potential": (fi.contact.contact_potential, lambda: {
        "law": LAW, "depth": 1e-4, "effective_mass": 3e-3, "approach_speed": 0.2
    }),
    "integrated_collision": (fi.contact.integrated_collision, lambda: {
        "force": lambda depth, rate: 1e4 * depth, "effective_mass": 3e-3, "approach_speed": 0.2
    }),
    "Impactor.box_mass": (lambda **given: STEEL_BALL.box_mass(**given), lambda: {"thickness": 1e-3}),
    "Impactor.wall_pressure": (lambda **given: STEEL_BALL.wall_pressure(**given), lambda: {"approach_speed": 0.2}),
    "hertz_stiffness": (fi.contact.hertz_stiffness,
        lambda: {"radius": 5e-3, "ball": fi.contact.STEEL, "wall": fi.contact.ALUMINIUM}),
    "converge_elements": (fi.convergence.converge_elements,
        lambda: {"structure": STRUCTURE, "elements": [2, 3, 4], "modes": 1}),
    "convergence_study": (fi.convergence_study, lambda: {
        "structure": STRUCTURE, "over": fi.convergence.OverMeshes.uniform(STRUCTURE, [2, 4, 8]),
        "watch": fi.convergence.SteadyResponse("tip"),
        "base": BASE, "modes": 2, "accuracy": 1e-2,
    }),
    "OverMeshes.uniform": (fi.convergence.OverMeshes.uniform, lambda: {"structure": STRUCTURE, "elements": [2, 4, 8]}),
    "OverMeshes.graded": (fi.convergence.OverMeshes.graded, lambda: {
        "structure": STRUCTURE, "elements": [2, 4, 8], "ratio": 3.0
    }),
    "OverMeshes.random": (fi.convergence.OverMeshes.random,
        lambda: {"structure": STRUCTURE, "elements": [2, 4, 8], "seed": 1}),
    "OverMeshes.refinements": (fi.convergence.OverMeshes.refinements, lambda: {
        "mesh": fi.uniform_mesh(STRUCTURE, 4), "times": 2
    }),
    "OverMeshes.files": (fi.convergence.OverMeshes.files,
        lambda: {"paths": [Path(__file__).parent / "data" / "stepped.msh"] * 2}),
    "ConvergenceTable.index": (lambda name: convergence_table().index(name), lambda: {"name": "b"}),
    "graded_mesh": (fi.fem.graded_mesh, lambda: {"structure": STRUCTURE, "elements": 4, "ratio": 3.0}),
    "random_mesh": (fi.fem.random_mesh, lambda: {"structure": STRUCTURE, "elements": 4, "seed": 1}),
    "Mesh.refined": (lambda times: fi.uniform_mesh(STRUCTURE, 4).refined(times), lambda: {"times": 2}),
    "converge_step": (fi.convergence.converge_step, lambda: {
        "system": replace(small(), contacts=()), "excitation": BASE, "method": fi.Newmark(5e-4), "halvings": 1
    }),
    "amplitude_ratio_damping": (fi.signals.amplitude_ratio_damping, lambda: {
        "reference": fi.signals.DampingEstimate(0.01, 6.0, (0.009, 0.011), "fit"), "reference_peak": 2e-3, "peak": 1e-3
    }),
    "fit_one_pole": (fi.fit_one_pole, lambda: {
        "frequency": CURVE[0], "amplitude": CURVE[1], "share": 0.2, "misfit_limit": 0.05,
        "held": "displacement",
    }),
    "identify_decay": (fi.identify_decay, lambda: {"time": DECAY[0], "signal": DECAY[1], "modes": 1}),
    "half_power": (fi.signals.half_power, lambda: {"frequency": CURVE[0], "amplitude": CURVE[1]}),
    "achieved_restitution": (fi.integrators.achieved_restitution, lambda: {
        "pair": small().contacts[0], "method": fi.Newmark(1e-4), "approach_speed": 0.2, "phases": 4
    }),
    "integrate": (fi.integrate, lambda: {
        "system": small(), "excitation": BASE, "method": fi.Newmark(2e-4), "duration": 0.1, "record": fi.Recorder(),
        "initial": fi.State(), "progress": None, "threads": 1,
    }),
    "find_orbit": (fi.find_orbit, lambda: {
        "system": orbit().system, "excitation": orbit().excitation, "cycles": 1, "guess": orbit()
    }),
    "find_orbits": (fi.orbits.find_orbits, lambda: {
        "system": orbit().system, "excitation": orbit().excitation, "guesses": [orbit()], "cycles": 1
    }),
    "continue_orbit": (fi.continue_orbit, lambda: {
        "orbit": orbit(), "parameter": "amplitude", "to": (0.9, 1.1), "points": 3
    }),
    "switch_branch": (fi.orbits.switch_branch, lambda: {
        "bifurcation": fi.continue_orbit(orbit(), "impactor.ball.gap", to=(8.0, 10.0)).bifurcations[0]
    }),
    "two_impact_orbits": (fi.orbits.two_impact_orbits, lambda: {
        "system": orbit().system, "excitation": orbit().excitation
    }),
    "recommended_step": (fi.recommended_step, lambda: {"system": small(), "refine": 2}),
    "read_mesh": (fi.read_mesh, lambda: {"path": Path(__file__).parent / "data" / "stepped.msh"}),
    "uniform_mesh": (fi.uniform_mesh, lambda: {"structure": STRUCTURE, "elements": 4}),
    "static_state": (fi.static_state, lambda: {"system": system(), "stop_displacement": 1e-4}),
    "solve_modes": (fi.solve_modes, lambda: {"system": system(), "count": 2}),
    "reduce": (fi.reduce, lambda: {"system": system(), "modes": 2, "static_correction": True}),
    "truncation_notes": (fi.system.truncation_notes, lambda: {"system": small()}),
    "glue_impactors": (fi.structure.glue_impactors, lambda: {"structure": STRUCTURE}),
    "damper_curve": (fi.design.damper_curve, lambda: {
        "amplitude_over_gap": [0.3, 0.5], "restitution": [0.5, 0.6], "starts": 1, "seed": 1, "cycles": 60,
        "gravity": 0.1, "stiffness": 1e4,
    }),
    "tuned_absorber": (fi.tuned_absorber, lambda: {
        "structure": STRUCTURE, "mass": 1e-3, "at": "tip", "name": "absorber", "elements": 2, "under": "base",
    }),
    "with_damping": (fi.system.with_damping, lambda: {"system": system(), "damping": fi.ModalDamping((0.01, 0.02))}),
    "without_impactors": (fi.without_impactors, lambda: {"system": small()}),
    "frequency_sweep": (fi.frequency_sweep, lambda: {
        "system": fi.without_impactors(small()), "amplitude": 1e-4, "frequencies": [5.0, 6.0],
        "method": fi.Newmark(1e-3, allow_coarse_step=True), "cycles": 9, "initial": fi.State(), "at": "tip",
        "ledger": False, "threads": 1,
    }),
    "frequency_sweep of a duration": (fi.frequency_sweep, lambda: {
        "system": fi.without_impactors(small()), "amplitude": 1e-4, "frequencies": [5.0, 6.0],
        "method": fi.Newmark(1e-3, allow_coarse_step=True), "duration": 2.0, "window": 1.0, "threads": 1,
    }),
    "calibrate": (fi.calibrate, lambda: {
        "study": small(), "frequency": [5.0, 5.1, 5.2], "peak": [1e-3, 1e-3, 1e-3],
        "parameters": {"impactor.ball.gap": (1e-3, 2e-3)}, "excitation": fi.Sine(1e-3, 5.0), "noise": 0.9,
        "starts": 2, "seed": 0, "cycles": 3,
    }),
    "refine": (fi.refine, lambda: {
        "study": small(), "measure": "peak", "axes": {"impactor.ball.gap": (1e-3, 2e-3)}, "worst_over": (),
        "limits": {"peak": 1.0}, "rounds": 0, "starts": 1, "seed": 0, "excitation": fi.Sine(1e-4, 5.0), "cycles": 3,
    }),
    "preflight": (fi.preflight, lambda: {
        "plan": small(), "excitation": fi.Sine(1e-4, 5.0), "duration": 1.0, "frequencies": [5.0, 6.0], "cycles": 30,
        "structure": STRUCTURE, "method": fi.EventDriven(), "initial": fi.State(),
    }),
    "best_case": (fi.best_case, lambda: {
        "dataset": fi.parameter_study(**parameter_study(), threads=1), "measure": "peak", "worst_over": (),
        "limits": {"peak": 1.0},
    }),
    "parameter_study of a sample": (fi.parameter_study, lambda: {
        **parameter_study(), "axes": {"impactor.ball.gap": {"uniform": [1e-3, 2e-3]}}, "sample": {"points": 2},
    }),
    "run_case": (fi.app.run_case, lambda: {
        "study": NOUNS["ParameterStudy"](), "number": 1, "start": 1, "record": fi.Recorder(("tip",)),
    }),
    # methods of nouns
    "Beam.uniform": (fi.Beam.uniform, lambda: {
        "length": 0.2, "width": 0.02, "thickness": 1e-3, "young_modulus": 70e9, "density": 2700.0
    }),
    "Beam.round": (fi.Beam.round, lambda: {"length": 0.2, "diameter": 4e-3, "young_modulus": 70e9, "density": 2700.0}),
    "Beam.tube": (fi.Beam.tube, lambda: {
        "length": 0.2, "diameter": 4e-3, "wall": 5e-4, "young_modulus": 70e9, "density": 2700.0
    }),
    "Beam.section": (fi.Beam.section, lambda: {
        "length": 0.2, "area": 2e-5, "second_moment": 2e-12, "outer_fibre": 6e-4, "young_modulus": 70e9,
        "density": 2700.0
    }),
    "Beam.drawn_at": (STRUCTURE.beam.drawn_at, lambda: {"position": 0.1}),
    "Beam.segment_index_at": (STRUCTURE.beam.segment_index_at, lambda: {"position": 0.1}),
    "Segment.drawn_at": (STRUCTURE.beam.segments[0].drawn_at, lambda: {"position": 0.1}),
    "Segment.rectangle_at": (STRUCTURE.beam.segments[0].rectangle_at, lambda: {"position": 0.1}),
    "System.from_matrices": (no_beam, lambda: {
        "M": 1.0, "C": 0.1, "K": 40.0, "points": {"p": [1.0]}, "base_load": [1.0], "impactors": [], "stops": [],
        "constant_load": [0.5],
    }),
    "System.deflection_rows": (lambda **given: system().deflection_rows(**given), lambda: {
        "positions": [0.1], "derivative": 1
    }),
    "vtk.to_pyvista": (fi.vtk.to_pyvista, lambda: {
        "result": fi.solve_modes(system(), 2), "structure": STRUCTURE, "system": system(),
    }),
    "System.curvature_rows": (lambda **given: system().curvature_rows(**given), lambda: {
        "positions": [0.1], "side": "left"
    }),
    "System.nodal_rows": (lambda **given: system().nodal_rows(**given), lambda: {
        "positions": [0.1], "derivative": 1, "side": "left"
    }),
    "System.shear_rows": (lambda **given: system().shear_rows(**given), lambda: {"positions": [0.1], "side": "left"}),
    "System.section_at": (lambda **given: system().section_at(**given), lambda: {"at": 0.1, "side": "left"}),
    "LineForce": (fi.LineForce, lambda: {"density": 3.0, "history": BASE}),
    "System.resultant": (lambda line: system().resultant(line), lambda: {"line": fi.excitation.LineLoad(3.0)}),
    "System.held_shares": (lambda at: system().held_shares(at), lambda: {"at": 0.01}),
    "System.position_of": (lambda at: system().position_of(at), lambda: {"at": 0.1}),
    "System.point_row": (lambda at: system().point_row(at), lambda: {"at": 0.1}),
    "System.point_row without a beam": (lambda at: oscillators().point_row(at), lambda: {"at": "first"}),
    "State.at_rest": (fi.State.at_rest, lambda: {"frame": "space"}),
    "Laser.measure": (lambda **given: LASER.measure(**given), lambda: {"response": response(), "seed": 3}),
    "extrapolate": (fi.signals.extrapolate, lambda: {
        "system": small(), "measured": LASER.measure(response()), "to": "mid", "mode": 1
    }),
    "State.of_mode": (fi.State.of_mode, lambda: {"system": small(), "mode": 1, "amplitude": 1e-3, "at": "tip"}),
    "State.under_force": (fi.State.under_force, lambda: {"system": small(), "force": 0.01, "at": "tip"}),
    "State.pulled": (fi.State.pulled, lambda: {"at": "tip", "displacement": 1e-3}),
    "State.struck": (fi.State.struck, lambda: {"at": "tip", "speed": 0.1}),
    "State.with_speed": (fi.State.with_speed, lambda: {"system": small(), "speed": 0.1}),
    **{
        f"{noun}.{name}": (getattr(base, name), lambda: {"time": 0.1})
        for noun, base in MOTIONS.items()
        for name in ("displacement", "velocity", "acceleration")
    },
    "Study.initial_on": (paper_study().initial_on, lambda: {"system": small()}),
    "Chirp.frequency_at": (MOTIONS["Chirp"].frequency_at, lambda: {"time": 0.1}),
    "Chirp.phase_at": (MOTIONS["Chirp"].phase_at, lambda: {"time": 0.1}),
    "HammerBlow.force": (MOTIONS["HammerBlow"].force, lambda: {"time": 0.1}),
    "RecordedBase.from_velocity": (fi.RecordedBase.from_velocity, lambda: {
        "samples": [0.0, 1.0, 0.5, 0.0, 0.2], "interval": 0.1, "high_pass": 1.0
    }),
    "RecordedBase.from_displacement": (fi.RecordedBase.from_displacement, lambda: {
        "samples": [0.0, 1.0, 0.5, 0.0, 0.2], "interval": 0.1, "high_pass": 1.0
    }),
    "transfer_function": (fi.transfer_function, lambda: {
        "system": small(), "frequency": [5.0, 6.0], "to": "tip", "of": None, "force_at": "mid"
    }),
    "spectrum": (fi.spectrum, lambda: {
        "response": response(), "channel": "tip", "kind": "density", "resolution": 4.0, "start": 0.2, "confidence": 0.9
    }),
    "measured_transfer": (fi.measured_transfer, lambda: {
        "response": response(), "to": "tip", "of": "base.velocity", "resolution": None
    }),
    "shock_response_spectrum": (fi.shock_response_spectrum, lambda: {
        "of": MOTIONS["Shock"], "frequency": [5.0, 6.0], "ratio": 0.1, "channel": None, "duration": 0.1
    }),
    **{
        f"PiecewisePolynomial.{name}": (getattr(PIECES, name), lambda: {"time": 0.1})
        for name in ("displacement", "velocity", "value")
    },
    "Sine.displacement": (BASE.displacement, lambda: {"time": [0.0, 0.1]}),
    "Sine.velocity": (BASE.velocity, lambda: {"time": 0.1}),
    "Sine.acceleration": (BASE.acceleration, lambda: {"time": 0.1}),
    "RecordedBase.displacement": (fi.RecordedBase([0.0, 1.0], 0.1).displacement, lambda: {"time": 0.1}),
    "PointForce.displacement": (fi.PointForce("tip", BASE).displacement, lambda: {"time": 0.1}),
    "Response.absolute": (lambda name: response().absolute(name), lambda: {"name": "tip"}),
}  # fmt: skip
"""Every verb by its name: the function, and good arguments of it."""

OTHERS = {
    "ALUMINIUM", "STEEL", "AxisMargin", "BestCase", "BestDesign", "ContactLaw", "ContactParameters", "DivergenceError",
    "CalibratedParameter", "Calibration", "Discretisation", "Preflight", "PreflightRow", "Reaction", "Refinement",
    "FemimpactError", "InputError", "InputWarning", "ResultWarning", "StudyResults", "load_branch",
    "load_parameter_study",
    "ShockResponseSpectrum", "Spectrum", "TransferFunction", "report", "show_versions", "write_movie",
}  # fmt: skip
"""Public names that take no numbers: constants, errors, what a verb alone makes, protocols, figures and files."""
