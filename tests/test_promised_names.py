"""What scripts of version 0.1.0 use goes on working: names, attributes, channels, commands, files and columns."""

import csv
import importlib
import re
from operator import attrgetter
from pathlib import Path

import pytest
from builders import FILES

import femimpact as fi
from femimpact.cli import app
from femimpact.response.channels import channel_of
from femimpact.response.impacts import IMPACT_UNITS, StickingPhases
from femimpact.sweep.curve import SWEEP_UNITS
from femimpact.table import column_units

NAMES = """
    contact.ALUMINIUM
    Beam: joints length mass segments uniform
    system.ContactPair: acceleration direction effective_mass first_mode fixed_to flexibility free_stiffness gaps
        is_preloaded is_stop law mass mobility name parameters position shares_place
    CustomLaw: force name reference_speed
    signals.DampingEstimate: frequency interval method ratio warnings
    DivergenceError
    response.EnergyLedger: ball contact contact_loss kinetic largest_input residual residual_history stored strain
        structure_loss structure_loss_of_mode time work
    EventDriven: closure most_events samples_per_cycle
    FemimpactError
    contact.Flores
    sweep.FrequencyResponse: amplitude at cycle_mean_force cycles damping damping_half_power duration energy_residual
        first_harmonic frequency impacts_per_cycle is_sample largest_approach_speed law mean_approach_speed
        mean_impulse notes peak peak_amplitude peak_force peak_frequency peak_is_sample phase rms start
        steadiness to_xarray warnings window
    GeneralizedAlpha: allow_coarse_step divergence_limit dt refine spectral_radius
    contact.GonthierCarvalhoMartins
    HHT: allow_coarse_step alpha divergence_limit dt refine
    Hertz
    response.HistoryPiece: base channels energy snapshots time to_xarray units
    HuntCrossley
    response.ImpactStatistics: count cycle_mean_force impacts_per_cycle largest_approach_speed law mean_approach_speed
        mean_impulse peak_force
    Impactor: acceleration at contact free_stiffness gap gaps mass name
    response.Impacts: approach_speed contact_law dropped duration energy_loss energy_to_higher_modes energy_to_modes
        impactor impulse law mode_share peak_force phase rebound_speed restitution side time to_xarray
    InputError
    KelvinVoigt: contact_time damping name restitution stiffness
    contact.LankaraniNikravesh
    contact.Material: poisson_ratio young_modulus
    fem.Mesh: elements nodes points regions
    system.Modes: damping_ratio effective_mass natural_frequency participation_factor vectors
    MoreauJean: allow_coarse_step divergence_limit dt refine theta
    Newmark: allow_coarse_step beta contact divergence_limit dt gamma refine
    PointForce: acceleration amplitude at displacement force frequency history phase velocity
    PointMass: at mass name rotary_inertia
    contact.PowerLaw: exponent loss name reference_speed restitution stiffness
    Rayleigh: frequencies modes ratio
    RecordedBase: acceleration amplitude displacement frequency initial_velocity interval phase samples velocity
    Recorder: channels every impacts ledger memory_limit piece_samples residual_limit sink snapshots
        snapshots_start start
    response.Response: absolute base channels energy impacts notes regime snapshots statistics statistics_of
        steady sticking streamed_to system time to_xarray units warnings window
    Rigid: name restitution
    contact.STEEL
    Segment: area bending_stiffness density length mass_per_length name rectangle second_moment thickness width
        young_modulus
    Sine: acceleration amplitude displacement frequency omega phase velocity
    State: at_rest ball_displacement ball_velocity displacement equilibrium frame is_at_rest is_static_on
        relative_to_base static static_contacts velocity
    Stop: at contact fixed_to gap gaps name
    Structure: attachments beam damping gravity impactors masses stops supports
    app.Study: base initial mesh method output path reduction sine structure sweep text
    app.StudyResults: directory history impact_data impacts modes sticking summary sweep
    Support: at kind
    contact.SwitchingSpring: free_stiffness name stiffness
    System: C K M balls base_load computed_together constant_load constant_resultant contacts default_place
        deflection_rows directions dofs expansion first_frequency from_matrices is_diagonal nodes point_row points
        position_of rayleigh rigid_translation stiffness_factor total_mass
    WBZ: allow_coarse_step alpha divergence_limit dt refine
    integrators.achieved_restitution
    signals.amplitude_ratio_damping
    assemble
    collide
    contact.contact_force
    contact.contact_potential
    convergence.converge_elements
    convergence.converge_step
    fit_one_pole
    frequency_sweep
    structure.glue_impactors
    signals.half_power
    contact.hertz_stiffness
    integrate
    load
    load_study
    convergence.mode_convergence
    read_mesh
    recommended_step
    reduce
    report
    run_study
    solve_modes
    static_state
    system.truncation_notes
    uniform_mesh
    without_impactors
    figures.write_movie
"""
"""Public names, and behind a colon what each class has."""

COMMANDS = "demo init check modes simulate sweep run converge figures movie report validate"
FILE_NAMES = """
    summary.json study.toml modes.csv modes.nc sweep.csv sweep.nc history.nc impacts.csv impacts.nc
    paraview/modes.pvd paraview/deflection.pvd movie.mp4 movie.gif comparison.csv restitution.csv
    curves_of_starts.csv report.html
"""
MODULES = {
    "femimpact.figures": """
        COLOURS PROJECTOR STYLE OffScreen beam_mesh bifurcation calibration contact_force
        contact_laws convergence convergence_panels energies impact_histograms impulse_phase
        mode_shapes motion phase_portrait response_curve
        save_figure spectrum study write_mode write_movie
    """,
    "femimpact.response.history_file": "history_writer",
    "femimpact.figures.movie": "write_movie",
    "femimpact.files": "plain read_csv read_units write_csv write_json write_netcdf",
    "femimpact.vtk": "to_pyvista write_deflection write_mode write_modes",
}
"""Modules that pages name, with all of their public names."""

MOVED = [
    (name, folder)
    for row in (Path(__file__).parents[1] / "docs/development/changelog.md").read_text(encoding="utf-8").splitlines()
    if row.endswith(" and the name |") and row.startswith("| `fi.")
    for names, folder in [re.fullmatch(r"\| (.*) \| `fi\.(\w+)\.` and the name \|", row).groups()]
    for name in re.findall(r"`fi\.(\w+)`", names)
]
"""Names that have left `fi`, and the folder in which each now stands, as the changelog's table has them."""

IMPACT_COLUMNS = """
    time phase impactor side approach_speed rebound_speed impulse peak_force duration energy_loss contact_law
"""
STICKING_COLUMNS = "impactor side start end impulse mean_force"
SWEEP_COLUMNS = """
    peak rms first_harmonic phase impacts_per_cycle mean_approach_speed largest_approach_speed mean_impulse peak_force
    cycle_mean_force energy_residual
"""
CHANNELS = "tip tip.velocity mid 0.1 ball ball.velocity ball.gap ball.contact_force gap contact_force"


def promised():
    """Each name with its attributes; a line that is indented further goes on with those of the line before."""
    for entry in NAMES.replace("\n        ", " ").split("\n"):
        name, _, attributes = entry.strip().partition(":")
        if name:
            yield name, attributes.split()


@pytest.mark.parametrize(("name", "attributes"), list(promised()))
def test_a_public_name_and_its_attributes_are_still_there(name, attributes):
    found = attrgetter(name)(fi)
    fields = getattr(found, "__dataclass_fields__", {})
    assert [one for one in attributes if not hasattr(found, one) and one not in fields] == []


@pytest.mark.parametrize(("name", "folder"), MOVED)
def test_a_moved_name_stands_in_the_folder_that_the_changelog_names_and_nowhere_else(name, folder):
    assert hasattr(getattr(fi, folder), name)
    assert not hasattr(fi, name)


def test_the_table_of_moved_names_is_read_whole():
    assert len(MOVED) > 80
    assert {"Branch", "Flores", "Spectrum", "to_pyvista"} <= {name for name, _ in MOVED}


@pytest.mark.parametrize("module", MODULES)
def test_a_module_that_pages_name_still_has_its_names(module):
    found = importlib.import_module(module)
    assert set(MODULES[module].split()) <= set(found.__all__)
    assert all(hasattr(found, name) for name in found.__all__)
    assert fi.figures is importlib.import_module("femimpact.figures")


@pytest.mark.parametrize("command", COMMANDS.split())
def test_a_command_is_still_there(command):
    assert app[command]


def test_file_names_of_results_are_still_there():
    assert set(FILE_NAMES.split()) <= {file.name for file in FILES.values()}


def test_columns_are_still_there():
    assert set(IMPACT_COLUMNS.split()) <= set(IMPACT_UNITS)
    assert set(STICKING_COLUMNS.split()) <= set(column_units(StickingPhases))
    assert set(SWEEP_COLUMNS.split()) <= set(SWEEP_UNITS)


def test_names_of_channels_are_still_there():
    ball = fi.Impactor("ball", "tip", 3e-3, 1e-3, fi.Rigid(0.5))
    beam = fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700.0)
    system = fi.assemble(fi.Structure(beam, impactors=[ball]), elements=4)
    for name in CHANNELS.split():
        assert channel_of(system, name).reading(system) is not None


def test_a_table_of_modes_has_its_columns(tmp_path):
    study = tmp_path / "study.toml"
    app(["init", str(study)], result_action="return_value")
    results = fi.run_study(fi.load_study(study), tmp_path / "out", parts=("modes",))
    with (results.directory / "modes.csv").open(encoding="utf-8", newline="") as file:
        header = next(csv.reader(file))
    words = ("mode", "natural_frequency", "damping_ratio", "participation_factor", "effective_mass")
    assert all(any(column.startswith(word) for column in header) for word in words)
