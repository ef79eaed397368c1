"""Linear tapers: exact modes of wedges, statics of M/EI, exact integrals, and what reads, draws and writes a taper."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from builders import paper_study, paper_study_text, read_study, same_study, study_text
from numpy.polynomial import Polynomial
from scipy.integrate import quad

import femimpact as fi
from femimpact.response.channels import QuantityAt
from femimpact.scene.scene import BEAM, build_scene
from femimpact.system.hermite import shape_functions
from femimpact.system.modes import solve_stiffness
from femimpact.system.system import with_checked_fields
from femimpact.validation.beams import TaperedCantilever
from femimpact.vtk import write_modes
from femimpact.vtk.modes import beam_fields

LENGTH, WIDTH, THICKNESS = 0.3, 0.02, 4e-3
MATERIAL = {"young_modulus": 70e9, "density": 2700.0}
FORCE = 0.7


def tapered(ratio, both=False, **more):
    """A beam whose thickness, or both dimensions, change linearly to `ratio` times those at the root."""
    given = {"width": WIDTH, "thickness": THICKNESS, "end_thickness": ratio * THICKNESS}
    if both:
        given["end_width"] = ratio * WIDTH
    return fi.Beam((fi.Segment(LENGTH, **MATERIAL, **given, **more),))


WEDGE = fi.Structure(tapered(0.25))
STEP = fi.Structure(
    fi.Beam((
        fi.Segment(0.1, **MATERIAL, width=0.03, thickness=4e-3, end_width=0.02, end_thickness=3e-3, name="thick"),
        fi.Segment(0.15, **MATERIAL, width=0.02, thickness=2e-3, end_thickness=0.7e-3, name="thin"),
    ))
)  # fmt: skip


def under_tip_force(system):
    """Deflection (dofs,) of a cantilever under a static force at its tip."""
    return solve_stiffness(system, FORCE * system.point_row("tip"))


# ---- exact modes ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "beam",
    [
        TaperedCantilever(0.25), TaperedCantilever(0.25, body=0.4), TaperedCantilever(2.5),
        TaperedCantilever(0.4, both=True), TaperedCantilever(0.4, both=True, body=0.3),
    ],
    ids=str,
)  # fmt: skip
def test_frequencies_of_truncated_wedges_and_pyramids_are_met_with_order_4(beam):
    """Order and factor of the error: h^4/1440 int EI w''''^2/int EI w''^2 above the exact frequency."""
    wavenumbers = beam.wavenumbers(3)
    exact = [beam.frequency(k) for k in wavenumbers]
    # the next term is of order h^6: 2 % and 0.5 % at the strongest taper
    for elements, tolerance in ((48, 0.025), (96, 0.007)):
        found = fi.solve_modes(fi.assemble(beam.structure, elements=elements), 3).natural_frequency
        expected = [beam.mesh_error(k, elements) for k in wavenumbers]
        np.testing.assert_allclose(found / exact - 1.0, expected, rtol=tolerance)


def test_closed_form_modes_are_those_of_the_beam():
    """Their Rayleigh quotient int EI w''^2/int rho A w^2 is omega^2, and they are held at the root."""
    beam = TaperedCantilever(0.3)
    root, tip = beam.ends
    for k in beam.wavenumbers(3):
        w, bent = beam.shape(k, 0), beam.shape(k, 2)
        x, weight = np.polynomial.legendre.leggauss(40)
        x, weight = 0.5 * (root + tip) + 0.5 * (root - tip) * x, 0.5 * (root - tip) * weight
        energy = weight @ [at**3 * bent(at) ** 2 for at in x]
        inertia = weight @ [at * w(at) ** 2 for at in x]
        assert energy / inertia == pytest.approx(k**4, rel=1e-10)
        assert abs(w(root)) < 1e-12 * abs(w(tip))


def test_fine_meshes_of_a_wedge_keep_the_digits():
    """The mesh leaves 5e-15 on 1500 elements, where K and M alone leave N^4 times 1e-16."""
    beam = TaperedCantilever(0.25)
    (k,) = beam.wavenumbers(1)
    assert beam.mesh_error(k, 1500) < 1e-14
    found = fi.solve_modes(fi.assemble(beam.structure, elements=1500), 1).natural_frequency[0]
    assert found == pytest.approx(beam.frequency(k), rel=2e-11)


# ---- integrals ------------------------------------------------------------------------------------


@pytest.mark.parametrize("tapers", [(0.0, 0.7), (-1.2, 0.0), (0.9, -1.9), (-1.99, -1.99)])
def test_matrices_of_an_element_are_the_integrals_of_polynomials(tapers):
    """K and M of one free element against exact integration of E I w''^2 and rho A w^2, of degrees 6 and 8."""
    ends = [
        [size * (1.0 + sign * taper / 2.0) for sign in (-1, 1)]
        for size, taper in zip((WIDTH, THICKNESS), tapers, strict=True)
    ]
    (w0, w1), (t0, t1) = ends
    segment = fi.Segment(LENGTH, **MATERIAL, width=w0, thickness=t0, end_width=w1, end_thickness=t1)
    grid = fi.fem.discretise(fi.Structure(fi.Beam((segment,))), elements=1)
    width, thickness = Polynomial([w0, w1 - w0]), Polynomial([t0, t1 - t0])
    s = np.linspace(0.0, 1.0, 4)
    fits = [np.polynomial.polynomial.polyfit(s, values, 3) for values in shape_functions(s, 0)]
    shapes = [Polynomial(fit) * (LENGTH if i % 2 else 1.0) for i, fit in enumerate(fits)]

    def integral(p):
        return LENGTH * (p.integ()(1.0) - p.integ()(0.0))

    stiff = MATERIAL["young_modulus"] * width * thickness**3 / 12.0
    heavy = MATERIAL["density"] * width * thickness
    K = [[integral(stiff * a.deriv(2) * b.deriv(2)) / LENGTH**4 for a in shapes] for b in shapes]
    M = [[integral(heavy * a * b) for a in shapes] for b in shapes]
    from femimpact.fem.assembly import bending, inertia, stiffness_factor

    found = bending.assemble(grid.basis, bending_stiffness=grid.bending_stiffness).toarray()
    np.testing.assert_allclose(found, K, atol=1e-13 * np.abs(K).max())
    found = inertia.assemble(grid.basis, mass_per_length=grid.mass_per_length).toarray()
    np.testing.assert_allclose(found, M, atol=1e-13 * np.abs(M).max())
    G = stiffness_factor(grid).toarray()
    assert G.shape == (2, 4)
    np.testing.assert_allclose(G.T @ G, K, atol=1e-13 * np.abs(K).max())


def test_a_segment_cut_in_two_is_the_segment():
    whole = fi.Segment(LENGTH, **MATERIAL, width=0.02, thickness=3e-3, end_width=0.01, end_thickness=1e-3)
    width, thickness = whole.rectangle_at(0.1)
    near = dataclasses.replace(whole, length=0.1, end_width=width, end_thickness=thickness, name="near")
    far = dataclasses.replace(whole, length=0.2, width=width, thickness=thickness, name="far")
    cut = fi.assemble(fi.Structure(fi.Beam((near, far))), elements=9)
    one = fi.assemble(fi.Structure(fi.Beam((whole,))), mesh=fi.fem.Mesh(cut.nodes))
    for name in ("K", "M", "stiffness_factor"):
        a, b = (getattr(system, name).toarray() for system in (one, cut))
        np.testing.assert_allclose(a, b, atol=1e-13 * np.abs(b).max())


def test_mass_and_first_moment_are_those_of_a_frustum():
    """Mass by its volume; at rest under gravity the root carries the weight, at the arm of the centre of mass."""
    structure = dataclasses.replace(fi.Structure(tapered(0.3, both=True)), gravity=9.81)
    system = fi.assemble(structure, elements=3)
    area = WIDTH * THICKNESS
    volume = LENGTH * area * (1.0 + 0.3 + 0.09) / 3.0
    centre = LENGTH * (1.0 + 2.0 * 0.3 + 3.0 * 0.09) / (4.0 * (1.0 + 0.3 + 0.09))
    weight = 2700.0 * volume * 9.81
    assert structure.beam.mass == pytest.approx(2700.0 * volume, rel=1e-14)
    assert system.total_mass == pytest.approx(2700.0 * volume, rel=1e-13)
    u = solve_stiffness(system, system.constant_load)
    force, moment = system.reactions["root.force"], system.reactions["root.moment"]
    assert force.on_displacement @ u - force.constant == pytest.approx(-weight, rel=1e-9)
    assert moment.on_displacement @ u - moment.constant == pytest.approx(-weight * centre, rel=1e-9)


# ---- statics: M = F (L - x), w'' = M/EI -----------------------------------------------------------


def wedge_stiffness(x):
    return MATERIAL["young_modulus"] * WIDTH * (THICKNESS * (1.0 - 0.75 * x / LENGTH)) ** 3 / 12.0


def test_tip_deflection_of_a_wedge_has_order_4_and_its_root_stress_order_2():
    tip = FORCE * quad(lambda x: (LENGTH - x) ** 2 / wedge_stiffness(x), 0.0, LENGTH, epsabs=0.0, epsrel=1e-13)[0]
    stress = 6.0 * FORCE * LENGTH / (WIDTH * THICKNESS**2)
    errors = []
    for elements in (16, 32, 64):
        system = fi.assemble(WEDGE, elements=elements)
        u = under_tip_force(system)
        read = QuantityAt("surface_stress", "root").reading(system).displacement @ u
        errors.append((abs(system.point_row("tip") @ u / tip - 1.0), abs(-read / stress - 1.0)))
        # the row of the held slope is tested with the whole beam: the reaction is that of equilibrium
        assert system.reactions["root.moment"].on_displacement @ u == pytest.approx(-FORCE * LENGTH, rel=1e-9)
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(rates, [[4.0, 2.0]] * 2, atol=0.2)


def test_shear_force_of_a_wedge_is_the_derivative_of_its_moment():
    """-F everywhere, with order 2 in the middles of the elements and 1 at nodes; EI w''' alone would stay off it."""
    errors = []
    for elements in (64, 128, 256):
        system = fi.assemble(WEDGE, elements=elements)
        u, nodes = under_tip_force(system), system.nodes
        middles = 0.5 * (nodes[1:] + nodes[:-1])
        found = [np.abs(system.shear_rows(x) @ u + FORCE).max() / FORCE for x in (middles, nodes)]
        section = [system.section_at(float(x)).bending_stiffness for x in middles]
        alone = np.array(section) * (system.deflection_rows(middles, 3) @ u)
        assert np.abs(alone + FORCE).max() > FORCE
        errors.append(found)
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(rates, [[2.0, 1.0]] * 2, atol=0.1)


def test_rows_of_the_shear_force_are_the_derivative_of_those_of_the_moment():
    system, step = fi.assemble(STEP, elements=7), 1e-5
    u = np.random.default_rng(1).standard_normal(system.dofs)
    x = 0.5 * (system.nodes[1:] + system.nodes[:-1])

    def moment(at):
        return np.array([system.section_at(float(p)).bending_stiffness for p in at]) * (system.curvature_rows(at) @ u)

    slope = (moment(x + step) - moment(x - step)) / (2.0 * step)
    # EI is of degree 4: a central difference misses its third derivative, (step/L)^2
    np.testing.assert_allclose(system.shear_rows(x) @ u, slope, atol=1e-6 * np.abs(slope).max())


def test_both_sides_of_a_joint_are_read_with_their_own_section():
    system = fi.assemble(STEP, elements=10)
    left, right = (system.section_at(0.1, side) for side in ("left", "right"))
    assert left.half_height == pytest.approx(1.5e-3, rel=1e-12)
    assert right.half_height == pytest.approx(1e-3, rel=1e-12)
    assert left.bending_stiffness == pytest.approx(70e9 * 0.02 * 3e-3**3 / 12.0, rel=1e-12)
    assert (left.region, right.region) == ("thick", "thin")
    assert system.section_at(0.05).half_height == pytest.approx(0.5 * 3.5e-3, rel=1e-12)
    assert system.section_at("tip").half_height == pytest.approx(0.35e-3, rel=1e-12)


def test_stress_on_both_sides_of_a_joint_tends_to_moment_over_section_modulus():
    errors = []
    for elements in (20, 40, 80):
        system = fi.assemble(STEP, elements=elements)
        u = under_tip_force(system)
        found = []
        for side, height in (("_left", 3e-3), ("", 2e-3)):
            reading = QuantityAt(f"surface_stress{side}", 0.1).reading(system)
            found.append(abs(-reading.displacement @ u * 0.02 * height**2 / 6.0 / (FORCE * 0.15) - 1.0))
        errors.append(found)
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(rates, 2.0, atol=0.3)


def test_a_convergence_study_expects_the_orders_that_a_taper_has():
    """The moment at a clamped root of a mode has order 2 where it tapers, and 4 where it does not."""
    thick = fi.Segment(0.1, **MATERIAL, width=WIDTH, thickness=THICKNESS, name="thick")
    thin = fi.Segment(0.2, **MATERIAL, width=WIDTH, thickness=THICKNESS, end_thickness=1e-3, name="thin")
    watched = (
        fi.convergence.Frequencies(2), fi.convergence.ModeShapes(1), fi.convergence.BendingMoment(mode=1),
        fi.convergence.SurfaceStress(), fi.convergence.SteadyResponse("tip"),
        fi.convergence.SupportReaction(),
    )  # fmt: skip
    for structure, moment in ((WEDGE, 2.0), (fi.Structure(fi.Beam((thick, thin))), 4.0)):
        over = fi.convergence.OverMeshes.uniform(structure, [24, 48, 96, 192])
        table = fi.convergence_study(structure, over, watched, fi.Sine(1e-4, 5.0))["mesh"]
        expected = [4.0, 4.0, 2.0, 8.0, moment, 2.0, 4.0, 4.0]
        np.testing.assert_array_equal(table.expected_order, expected)
        # what is left is the next order on these meshes, 0.1 to 0.2 in the exponent
        np.testing.assert_allclose(table.fitted_order, expected, atol=0.25)


# ---- meshes and studies ---------------------------------------------------------------------------


def test_a_mesh_file_with_named_regions_takes_tapers():
    mesh = fi.read_mesh(Path(__file__).parent / "data" / "stepped.msh")
    thick = fi.Segment(0.15, **MATERIAL, width=0.02, thickness=2e-3, end_thickness=1e-3, name="thick")
    thin = fi.Segment(0.10, **MATERIAL, width=0.02, thickness=1e-3, end_width=0.01, name="thin")
    structure = fi.Structure(fi.Beam((thick, thin)))
    read, made = (
        fi.fem.discretise(structure, mesh=m).sections for m in (mesh, fi.fem.Mesh(mesh.nodes, regions=mesh.regions))
    )
    x = 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])
    expected = [structure.beam.drawn_at(float(at)) for at in x]
    np.testing.assert_allclose(2.0 * read.half_height, [t for _, t in expected], rtol=1e-9)
    np.testing.assert_allclose(read.mass_per_length, [2700.0 * w * t for w, t in expected], rtol=1e-9)
    np.testing.assert_array_equal(read.width_taper, made.width_taper)
    # the mesh halved is the same beam
    finer = fi.fem.discretise(structure, mesh=mesh.refined()).sections
    for s, number in ((0.25, 0), (0.75, 1)):
        every = np.arange(mesh.elements)
        np.testing.assert_allclose(read.bending_stiffness_at(every, s), finer.bending_stiffness[number::2], rtol=1e-12)


def test_the_thickest_place_is_held_against_the_length():
    with pytest.warns(fi.InputWarning, match=r"beam\.length = 3 times the thickness"):
        fi.assemble(fi.Structure(tapered(LENGTH / 3.0 / THICKNESS)), elements=4)
    with warnings.catch_warnings():
        warnings.simplefilter("error", fi.InputWarning)
        fi.assemble(fi.Structure(tapered(2.0)), elements=4)


def test_a_study_file_takes_tapers_and_is_written_with_them():
    text = paper_study_text().replace("\nthickness = ", "\nend_thickness = 0.0005\nend_width = 0.01\nthickness = ", 1)
    study = read_study(text, Path("study.toml"))
    segment = study.structure.beam.segments[0]
    assert (segment.end_width, segment.end_thickness) == (0.01, 0.0005)
    assert study_text(study) == text
    changed = dataclasses.replace(study, structure=dataclasses.replace(study.structure, beam=STEP.beam))
    assert same_study(read_study(study_text(changed), changed.path), changed)
    assert "end_thickness = 0.003" in study_text(changed)
    with pytest.raises(fi.InputError, match=r"beam\.end_thickness = -1 m: must be a finite number > 0 m"):
        read_study(text.replace("end_thickness = 0.0005", "end_thickness = -1"), Path("study.toml"))
    with pytest.raises(fi.InputError, match=r"beam\.end_thicknes: .*end_thickness"):
        read_study(text.replace("end_thickness", "end_thicknes", 1), Path("study.toml"))


def test_a_study_without_tapers_is_written_without_them():
    plain = dataclasses.replace(paper_study(), mesh=dataclasses.replace(paper_study().mesh, elements=7))
    assert "end_" not in study_text(plain).split("[mesh]")[0]


# ---- pictures -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solid(tmp_path_factory):
    """A beam of two tapers under a force at its tip, drawn at its own deflection."""
    import pyvista

    system = fi.assemble(STEP, elements=40)
    shape = under_tip_force(system)
    number, tip = np.array([1.0]), float(system.point_row("tip") @ shape)
    one = fi.system.Modes(
        natural_frequency=number, damping_ratio=number, participation_factor=number, vectors=shape[:, None]
    )
    path = write_modes(tmp_path_factory.mktemp("taper") / "static.pvd", system, one, STEP, scale=tip)
    grid = pyvista.get_reader(path).read()[0]
    return tip, grid, grid.extract_cells(np.flatnonzero(grid["part"] == BEAM))


def test_the_solid_has_the_sections_and_the_volume_of_the_beam(solid):
    _, _, beam = solid
    assert 2700.0 * beam.volume == pytest.approx(STEP.beam.mass, rel=1e-9)
    inner = ~np.isclose(beam.points[:, 0], 0.1, atol=1e-9)
    expected = np.array([STEP.beam.drawn_at(float(x)) for x in beam.points[inner, 0]])
    np.testing.assert_allclose(2.0 * np.abs(beam.points[inner][:, [2, 1]]), expected, rtol=1e-12)
    # at the joint there are points of both
    heights = np.unique(np.abs(beam.points[~inner, 1]).round(12))
    np.testing.assert_allclose(heights, [1e-3, 1.5e-3], rtol=1e-9)


def test_energy_densities_of_a_taper_sum_to_the_work_of_the_force(solid):
    tip, grid, _ = solid
    volume = grid.compute_cell_sizes(length=False, area=False, volume=True)["Volume"]
    assert (volume * grid["mean_strain_energy_density"]).sum() == pytest.approx(0.5 * FORCE * tip, rel=1e-9)


def test_drawn_moment_and_stress_are_those_of_statics(solid):
    """Both are of order 2 in h, at the tip 1/13 of the distance to the point where the taper would end."""
    _, _, beam = solid
    arm = STEP.beam.length - beam.points[:, 0]
    np.testing.assert_allclose(beam["bending_moment"], FORCE * arm, atol=1e-3 * FORCE * arm.max())
    y, z = beam.points[:, 1], beam.points[:, 2]
    stress = -6.0 * FORCE * arm * np.sign(y) / (2.0 * np.abs(z) * (2.0 * y) ** 2)
    np.testing.assert_allclose(beam["axial_stress"], stress, atol=2e-2 * np.abs(stress).max())


def test_drawn_shear_force_at_nodes_has_order_2():
    """The mean of both elements at a node; each of them is of order 1."""
    errors = []
    for elements in (40, 80, 160):
        system = fi.assemble(STEP, elements=elements)
        scene = build_scene(STEP, system)
        drawn = beam_fields(scene, STEP, system).shear @ (system.expansion @ under_tip_force(system))
        x = np.concatenate(scene.stretches)
        inner = np.abs(x[:, None] - [0.0, 0.1, 0.25]).min(axis=1) > 1e-9
        at_node = inner & (np.abs(x[:, None] - system.nodes).min(axis=1) < 1e-12)
        assert np.count_nonzero(at_node) == elements - 2
        errors.append(np.abs(drawn[at_node] + FORCE).max() / FORCE)
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.2)


def test_a_system_without_sections_is_drawn_with_those_of_the_structure():
    known = fi.assemble(STEP, elements=7)
    unknown = with_checked_fields(known, sections=None)
    scene = build_scene(STEP, known)
    one, other = (beam_fields(scene, STEP, system) for system in (known, unknown))
    for name in ("moment", "shear"):
        a, b = (getattr(fields, name).toarray() for fields in (one, other))
        np.testing.assert_allclose(a, b, atol=1e-11 * np.abs(a).max())
    np.testing.assert_allclose(one.cell_energy, other.cell_energy, rtol=1e-11)


def test_the_figure_of_a_mesh_has_the_outline_of_the_taper():
    mesh = fi.uniform_mesh(STEP, 5)
    axes = fi.figures.beam_mesh(mesh, STEP, ax=fi.figures.OffScreen())
    outline = axes.collections[0].get_paths()[0].vertices
    for x, thickness in ((0.0, 4e-3), (0.1, 3e-3), (0.1, 2e-3), (0.25, 0.7e-3)):
        corner = [1e3 * x, 0.5e3 * thickness]
        assert np.abs(outline - corner).max(axis=1).min() < 1e-9


@pytest.mark.parametrize("name", ["thickness", "width"])
def test_a_pair_in_a_study_file_is_refused_with_the_key_of_the_other_end(name):
    text = re.sub(rf"^{name} = .*$", f"{name} = [2e-3, 1e-3]", paper_study_text(), flags=re.MULTILINE)
    with pytest.raises(fi.InputError, match=rf"^beam\.{name} = \[0\.002, 0\.001\] m: .* is end_{name}$"):
        read_study(text, Path("study.toml"))
    stepped = "\n".join(["[[beam.segment]]", 'name = "arm"', *text.split("[beam]")[1].split("\n")[1:]])
    with pytest.raises(fi.InputError, match=rf"^beam\.segment\.arm\.{name} .* is end_{name}$"):
        read_study(stepped, Path("study.toml"))
