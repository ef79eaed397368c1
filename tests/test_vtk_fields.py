"""Moment, shear force, stress and energy in files for ParaView, read back and set beside statics and reactions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from grids import points_of, read_series

import femimpact as fi
from femimpact.scene.scene import BEAM
from femimpact.system.hermite import hermite_rows
from femimpact.vtk import write_deflection, write_modes

ALUMINIUM = {"young_modulus": 70e9, "density": 2700.0}
THICK = fi.Segment(length=0.12, width=0.030, thickness=3e-3, name="thick", **ALUMINIUM)
THIN = fi.Segment(length=0.08, width=0.020, thickness=1e-3, name="thin", **ALUMINIUM)
STEPPED = fi.Structure(beam=fi.Beam((THICK, THIN)))
FORCE = 0.7


def one_shape(system, shape):
    """A deflection (dofs,) in the place of a mode."""
    number = np.array([1.0])
    return fi.system.Modes(
        natural_frequency=number, damping_ratio=number, participation_factor=number, vectors=shape[:, None]
    )


@pytest.fixture(scope="module")
def under_tip_force(tmp_path_factory):
    """A stepped cantilever under a force at its tip, drawn at its own deflection: grid of the beam and deflection."""
    system = fi.assemble(STEPPED, elements=10)
    shape = np.linalg.solve(system.K.toarray(), FORCE * system.point_row("tip"))
    tip = float(system.point_row("tip") @ shape)
    path = tmp_path_factory.mktemp("static") / "static.pvd"
    _, (grid,) = read_series(write_modes(path, system, one_shape(system, shape), STEPPED, scale=tip))
    return system, shape, grid, grid.extract_cells(np.flatnonzero(grid["part"] == BEAM))


def test_moment_and_shear_force_are_those_of_statics(under_tip_force):
    """F (L - x) and -F at every point, to rounding: a cubic is the exact deflection."""
    _, _, _, beam = under_tip_force
    arm = STEPPED.beam.length - beam.points[:, 0]
    np.testing.assert_allclose(beam["bending_moment"], FORCE * arm, atol=1e-9 * FORCE * arm.max())
    np.testing.assert_allclose(beam["shear_force"], -FORCE, rtol=1e-7)


def test_stress_is_moment_over_section_modulus_and_jumps_with_the_section(under_tip_force):
    """Stress = -+ M/(b h^2/6) on the surfaces; at the step both values are there, at separate points."""
    _, _, _, beam = under_tip_force
    joint = np.isclose(beam.points[:, 0], THICK.length, atol=1e-12)
    assert np.count_nonzero(joint) == 8
    found = {}
    for segment in (THICK, THIN):
        width, height = segment.rectangle
        # a point at the joint belongs to the segment whose corner it is
        mine = np.isclose(np.abs(beam.points[:, 1]), 0.5 * height, atol=1e-12)
        arm = STEPPED.beam.length - beam.points[mine, 0]
        bending = FORCE * arm / (width * height**2 / 6.0)
        side = np.sign(beam.points[mine, 1])
        scale = np.abs(bending).max()
        np.testing.assert_allclose(beam["axial_stress"][mine], -side * bending, atol=1e-8 * scale)
        np.testing.assert_allclose(beam["axial_strain"][mine], -side * bending / 70e9, atol=1e-8 * scale / 70e9)
        density = beam["strain_energy_density"][mine]
        np.testing.assert_allclose(density, bending**2 / (2 * 70e9), atol=1e-8 * density.max())
        found[segment.name] = np.abs(beam["axial_stress"][joint & mine]).max()
    assert found["thin"] / found["thick"] == pytest.approx(0.03 * 3e-3**2 / (0.02 * 1e-3**2), rel=1e-7)


def test_energy_densities_sum_to_the_work_of_the_force(under_tip_force):
    """Sum of density times volume = F w/2."""
    system, shape, grid, _ = under_tip_force
    volume = grid.compute_cell_sizes(length=False, area=False, volume=True)["Volume"]
    tip = float(system.point_row("tip") @ shape)
    assert (volume * grid["mean_strain_energy_density"]).sum() == pytest.approx(0.5 * FORCE * tip, rel=1e-9)


TIP_FORCE = {
    "round bar": (fi.Segment(length=0.2, diameter=4e-3, **ALUMINIUM), np.pi * 4e-3**4 / 64, np.pi * 4e-3**2 / 4),
    "tube": (
        fi.Segment(length=0.2, diameter=6e-3, wall=1e-3, **ALUMINIUM),
        np.pi * (6e-3**4 - 4e-3**4) / 64,
        np.pi * (6e-3**2 - 4e-3**2) / 4,
    ),
}
"""Segments, second moment (m^4) and area (m^2) of each."""


def bent_by_a_force(path, segment):
    """The deflected cantilever under a force at its tip: system, deflection and grid."""
    structure = fi.Structure(beam=fi.Beam((segment,)))
    system = fi.assemble(structure, elements=4)
    shape = np.linalg.solve(system.K.toarray(), FORCE * system.point_row("tip"))
    tip = float(system.point_row("tip") @ shape)
    _, (grid,) = read_series(write_modes(path / "static.pvd", system, one_shape(system, shape), structure, scale=tip))
    return tip, grid


@pytest.mark.parametrize("key", TIP_FORCE)
def test_a_round_bar_and_a_tube_are_round_with_the_stress_of_every_point(tmp_path, key):
    """Points on circles about the axis, stress = -M y/I there, and the energy of all cells = F w/2."""
    segment, second_moment, area = TIP_FORCE[key]
    tip, grid = bent_by_a_force(tmp_path, segment)
    beam = grid.extract_cells(np.flatnonzero(grid["part"] == BEAM))
    radius = np.hypot(beam.points[:, 1], beam.points[:, 2])
    inner = 0.0 if segment.wall is None else 0.5 * segment.diameter - segment.wall
    on_surface = np.isclose(radius, 0.5 * segment.diameter, rtol=1e-9)
    assert (on_surface | np.isclose(radius, inner, atol=1e-12)).all()
    # the + surface is reached, and every direction has points
    assert beam.points[:, 1].max() == pytest.approx(0.5 * segment.diameter, rel=1e-12)
    turn = np.unique(np.round(np.arctan2(beam.points[on_surface, 1], beam.points[on_surface, 2]), 9))
    assert np.diff(turn).max() < 0.3
    expected = -FORCE * (0.2 - beam.points[:, 0]) * beam.points[:, 1] / second_moment
    np.testing.assert_allclose(beam["axial_stress"], expected, atol=1e-7 * np.abs(expected).max())
    volume = beam.compute_cell_sizes(length=False, area=False, volume=True)["Volume"]
    # the area of a polygon of 24 corners is 1.1 % below that of its circle
    assert 0.985 < volume.sum() / (0.2 * area) < 1.0
    assert (volume * beam["mean_strain_energy_density"]).sum() == pytest.approx(0.5 * FORCE * tip, rel=1e-9)


@pytest.mark.parametrize("outer_fibre", [None, 6e-4])
def test_a_section_is_drawn_as_its_rectangle_with_the_stress_of_its_outer_fibre(tmp_path, outer_fibre):
    segment = fi.Segment(length=0.2, area=2e-5, second_moment=1.7e-12, outer_fibre=outer_fibre, **ALUMINIUM)
    _, grid = bent_by_a_force(tmp_path, segment)
    beam = grid.extract_cells(np.flatnonzero(grid["part"] == BEAM))
    width, height = (np.ptp(beam.points[:, i]) for i in (2, 1))
    assert (width * height, width * height**3 / 12) == pytest.approx((2e-5, 1.7e-12), rel=1e-12)
    note = grid.field_data["note"][0]
    assert "beam: drawn as the rectangle of its area and second moment" in note
    if outer_fibre is None:
        assert "needs outer_fibre (m) of segment 'beam'" in note
        assert np.isnan(beam["axial_stress"]).all()
    else:
        assert "axial strain and stress of beam at its outer fibre" in note
        assert np.abs(beam["axial_stress"]).max() == pytest.approx(FORCE * 0.2 * outer_fibre / 1.7e-12, rel=1e-7)


def test_root_moment_of_statics_is_the_reaction(under_tip_force):
    system, shape, _, beam = under_tip_force
    root = np.isclose(beam.points[:, 0], 0.0, atol=1e-12)
    reaction = float(system.reactions["root.moment"].on_displacement @ shape)
    np.testing.assert_allclose(beam["bending_moment"][root], -reaction, rtol=1e-9)


def root_of(grid):
    """Bending moment of the beam's points at the root."""
    return grid["bending_moment"][np.isclose(grid.points[:, 0], 0.0, atol=1e-12) & (grid["bending_moment"] != 0.0)]


def test_root_moment_of_modes_tends_to_the_reaction_with_the_fourth_order(tmp_path):
    """R = -EI w'' - omega^2 integral rho A w H dx, H the slope's shape function: w ~ x^2 makes the integral O(h^4)."""
    errors = []
    for count in (10, 20, 40):
        system = fi.assemble(STEPPED, elements=count)
        modes = fi.solve_modes(system, 3)
        item, found = system.reactions["root.moment"], []
        for i, grid in enumerate(read_series(write_modes(tmp_path / "m.pvd", system, modes, STEPPED))[1]):
            coordinate, phi = grid.field_data["modal_coordinate"][0], modes.vectors[:, i]
            omega = 2.0 * np.pi * modes.natural_frequency[i]
            reaction = coordinate * float(item.on_displacement @ phi - omega**2 * item.on_acceleration @ phi)
            found.append(abs(root_of(grid)[0] / -reaction - 1.0))
        errors.append(found)
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    # the third mode on 10 elements is 0.1 below
    np.testing.assert_allclose(rates, 4.0, atol=0.15)


@pytest.mark.parametrize("count", [10, 20, 40])
def test_root_moment_of_a_response_is_the_reaction_but_for_inertia_and_damping(tmp_path, count):
    """R + EI w'' = rho A ub'' h^2/12 (the base's acceleration on the held slope) - beta EI dw''/dt, and O(h^4)."""
    beam = fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, **ALUMINIUM)
    structure = fi.Structure(beam=beam, damping=fi.Rayleigh(ratio=0.01, modes=(1, 2)))
    system = fi.reduce(fi.assemble(structure, elements=count), modes=4)
    # far below the first frequency, 20 Hz: the base's acceleration is not small beside that of the beam
    base = fi.Sine(amplitude=1e-3, frequency=5.0)
    record = fi.Recorder(channels=("root.reaction_moment",), every=4, snapshots=4)
    run = fi.integrate(system, base, fi.EventDriven(), 2.0, record)
    _, grids = read_series(write_deflection(tmp_path / "a.pvd", run, structure))
    moment = np.array([root_of(grid)[0] if root_of(grid).size else 0.0 for grid in grids])
    rates = run.snapshots.velocity @ np.asarray(hermite_rows(system.nodes, [0.0], 2).toarray())[0]
    segment, h = beam.segments[0], 0.2 / count
    _, beta = system.rayleigh
    left = run["root.reaction_moment"] + moment + beta * segment.bending_stiffness * rates
    inertia = segment.mass_per_length * h**2 / 12 * base.acceleration(run.time)
    # the acceleration relative to the base has the share h^2 omega^2 |w''| of it, some tens of h^2/L^2
    np.testing.assert_allclose(left, inertia, atol=20 * (h / 0.2) ** 2 * np.abs(inertia).max())
    assert np.abs(inertia).max() < np.abs(moment).max() * (h / 0.2) ** 2


def test_moment_is_stiffness_times_curvature_of_the_response(tmp_path, small, reference):
    """At every point of every frame, away from nodes, where a reading has one value."""
    record = fi.Recorder(channels=("tip",), snapshots=8, snapshots_start=2.8)
    stiffness = reference.beam.segments[0].bending_stiffness
    quiet = fi.integrate(fi.without_impactors(small), fi.Sine(0.2037e-3, 4.9), fi.EventDriven(), 3.0, record)
    _, grids = read_series(write_deflection(tmp_path / "a.pvd", quiet, reference, exaggeration=3.0))
    for k, grid in enumerate(grids):
        points = points_of(grid, grid["part"] == BEAM)
        x = grid.points[points, 0]
        inside = np.abs(x[:, None] - small.nodes).min(axis=1) > 1e-6
        nodal = quiet.snapshots.displacement[k]
        # second differences of the Hermite cubic are exact for a cubic
        step = 1e-4
        rows = [small.deflection_rows(x[inside] + shift * step) for shift in (-1, 0, 1)]
        state = np.linalg.lstsq(np.asarray(small.expansion), nodal, rcond=None)[0]
        before, at, after = (row @ state for row in rows)
        curvature = (before - 2 * at + after) / step**2
        scale = np.abs(curvature).max()
        # differences of 1e-4 m lose eight digits of sixteen
        np.testing.assert_allclose(grid["curvature"][points][inside], curvature, atol=1e-6 * scale + 1e-9)
        np.testing.assert_allclose(
            grid["bending_moment"], stiffness * grid["curvature"], atol=1e-11 * stiffness * scale
        )
    assert quiet.snapshots.time.size == len(grids)


def test_sections_are_cut_where_a_force_acts(tmp_path):
    """Under a force at midspan the shear force steps by it: both values are there."""
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, **ALUMINIUM),
        masses=[fi.PointMass("body", at=0.1, mass=1e-3)],
    )
    system = fi.assemble(structure, elements=8)
    shape = np.linalg.solve(system.K.toarray(), FORCE * system.point_row(0.1))
    scale = float(np.abs(system.expansion @ shape)[0::2].max())
    _, (grid,) = read_series(write_modes(tmp_path / "m.pvd", system, one_shape(system, shape), structure, scale=scale))
    beam = grid.extract_cells(np.flatnonzero(grid["part"] == BEAM))
    middle = np.isclose(beam.points[:, 0], 0.1, atol=1e-12)
    shear = np.sort(beam["shear_force"][middle])
    np.testing.assert_allclose(shear, [-FORCE] * 4 + [0.0] * 4, atol=1e-8 * FORCE)
    x = np.unique(beam.points[:, 0])
    assert all(np.isclose(x, node, atol=1e-12).any() for node in system.nodes)
    assert max(b - a for a, b in itertools.pairwise(x)) <= 0.2 / 120 * (1 + 1e-9)
