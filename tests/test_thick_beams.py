"""Beams that shear: statics in closed form, modes against a transfer matrix, orders, readings, and what is refused."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from skfem import BilinearForm

import femimpact as fi
from femimpact.app.demo import paper_study
from femimpact.app.parametric.identity import plain_study
from femimpact.app.results.picture_data import read_results
from femimpact.app.study.study_file import read_study, study_text
from femimpact.fem.assembly import beam_matrices, stiffness_factor
from femimpact.scene.scene import BEAM, build_scene
from femimpact.structure.structure import unusual_numbers
from femimpact.system.hermite import hermite_rows, shape_functions
from femimpact.system.modes import solve_stiffness

YOUNG, SHEAR, DENSITY, LENGTH, WIDTH, THICKNESS = 210e9, 80e9, 7850.0, 0.1, 0.02, 0.013
BENDING = YOUNG * WIDTH * THICKNESS**3 / 12.0
SHEARING = 5.0 / 6.0 * SHEAR * WIDTH * THICKNESS
STEEL = {"young_modulus": YOUNG, "density": DENSITY}
THICK = fi.Beam.uniform(length=LENGTH, width=WIDTH, thickness=THICKNESS, **STEEL, shear_modulus=SHEAR)
THIN = fi.Beam.uniform(length=LENGTH, width=WIDTH, thickness=THICKNESS, **STEEL)
STEPPED = fi.Beam(
    (
        fi.Segment(0.06, YOUNG, DENSITY, WIDTH, THICKNESS, name="holder", shear_modulus=SHEAR),
        fi.Segment(0.04, YOUNG, DENSITY, diameter=0.01, wall=2e-3, name="bar", shear_modulus=SHEAR, shear_factor=0.6),
    )
)


def shear_stiffness(segment):
    """K G A (N) of a segment, G and k as given, and a rectangle's 5/6."""
    return (segment.shear_factor or 5.0 / 6.0) * segment.shear_modulus * segment.mass_per_length / segment.density


def transfer_determinant(beam, omega, tip_mass=0.0, tip_inertia=0.0, offset=0.0):
    """Determinant of a clamped Timoshenko beam with a body on its tip, from exponentials of its state (w, t, M, Q).

    w' = t + Q/(kGA), t' = M/(EI), M' = -Q - rho I omega^2 t, Q' = -rho A omega^2 w.
    """
    whole = np.eye(4)
    for segment in beam.segments:
        A = np.zeros((4, 4))
        A[0, 1], A[0, 3], A[1, 2] = 1.0, 1.0 / shear_stiffness(segment), 1.0 / segment.bending_stiffness
        rotary = segment.density * segment.bending_stiffness / segment.young_modulus
        A[2, 3], A[2, 1], A[3, 0] = -1.0, -rotary * omega**2, -segment.mass_per_length * omega**2
        whole = expm(A * segment.length) @ whole
    # on the tip: -Q + m omega^2 (w + e t) = 0 and -M + e m omega^2 (w + e t) + J omega^2 t = 0
    inertia = tip_mass * omega**2 * np.array([1.0, offset, 0.0, 0.0])
    force = np.array([0.0, 0.0, 0.0, -1.0]) + inertia
    moment = np.array([0.0, tip_inertia * omega**2, -1.0, 0.0]) + offset * inertia
    scale = np.array([beam.length**3, beam.length**2]) / beam.segments[0].bending_stiffness
    ends = np.array([force, moment]) @ whole[:, 2:] * scale
    return np.linalg.det(ends / np.abs(ends).max())


def exact_frequency(beam, near, **body):
    """Natural frequency (Hz) of the transfer matrix within 3 % of one."""
    low, high = 0.97 * near, 1.03 * near
    return brentq(lambda f: transfer_determinant(beam, 2.0 * math.pi * f, **body), low, high, xtol=1e-12 * near)


# ---- statics ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [1, 3, 40])
def test_a_cantilever_under_a_tip_force_is_exact(elements):
    probe = fi.Stop("probe", "tip", (math.inf, 0.1), fi.Rigid(0.5))
    system = fi.assemble(fi.Structure(THICK, stops=[probe]), elements)
    exact = LENGTH**3 / (3.0 * BENDING) + LENGTH / SHEARING
    assert system.contacts[0].flexibility == pytest.approx(exact, rel=2e-14)
    u = solve_stiffness(system, system.point_row("tip"))
    x = np.linspace(0.0, LENGTH, 7)
    deflection = (3.0 * LENGTH - x) * x**2 / (6.0 * BENDING) + x / SHEARING
    assert system.deflection_rows(x) @ u == pytest.approx(deflection, rel=2e-14, abs=2e-14 * exact)
    turn = (LENGTH * x - 0.5 * x**2) / BENDING
    assert system.deflection_rows(x, 1) @ u == pytest.approx(turn, rel=1e-13, abs=1e-14 * turn[-1])
    for side in ("left", "right"):
        assert BENDING * system.curvature_rows(x, side) @ u == pytest.approx(LENGTH - x, abs=2e-13 * LENGTH)
        assert system.shear_rows(x, side) @ u == pytest.approx(-np.ones(7), rel=1e-12)
    held = {name: item.on_displacement @ u for name, item in system.reactions.items()}
    assert held == pytest.approx({"root.force": -1.0, "root.moment": -LENGTH}, rel=5e-14)


def test_a_tip_moment_bends_without_shear():
    grid = fi.fem.discretise(fi.Structure(THICK), 5)
    system = fi.assemble(fi.Structure(THICK), 5)
    u = solve_stiffness(system, grid.rows([LENGTH], 1).toarray()[0][grid.free])
    assert float(system.point_row("tip") @ u.ravel()) == pytest.approx(LENGTH**2 / (2.0 * BENDING), rel=1e-13)
    assert np.abs(system.shear_rows(np.linspace(0.0, LENGTH, 11)) @ u).max() * LENGTH < 1e-12


def test_a_stepped_beam_and_a_force_between_nodes():
    system = fi.assemble(fi.Structure(STEPPED), mesh=fi.uniform_mesh(fi.Structure(STEPPED), 7))
    at, (a, b) = 0.0733, STEPPED.segments
    u = solve_stiffness(system, system.deflection_rows([at])[0])
    # at the joint, by the force and the moment there; between nodes a load's own cubic is missing, at nodes nothing
    joint = 0.06
    turn = (at * joint - 0.5 * joint**2) / a.bending_stiffness
    w = (3.0 * at - joint) * joint**2 / (6.0 * a.bending_stiffness) + joint / shear_stiffness(a)
    arm = at - joint
    tip_turn = turn + arm**2 / (2.0 * b.bending_stiffness)
    loaded = w + turn * arm + arm**3 / (3.0 * b.bending_stiffness) + arm / shear_stiffness(b)
    assert system.deflection_rows([joint, LENGTH]) @ u == pytest.approx(
        [w, loaded + tip_turn * (LENGTH - at)], rel=1e-12
    )
    assert system.deflection_rows([LENGTH], 1) @ u == pytest.approx(tip_turn, rel=1e-12)


def test_a_line_load_is_exact_at_nodes():
    system = fi.assemble(fi.Structure(THICK), 4)
    line = fi.excitation.LineLoad(3.0)
    assert system.resultant(line) == pytest.approx(0.3, rel=1e-14)
    u = solve_stiffness(system, system.point_row(line))
    exact = 3.0 * LENGTH**4 / (8.0 * BENDING) + 3.0 * LENGTH**2 / (2.0 * SHEARING)
    assert system.point_row("tip") @ u == pytest.approx(exact, rel=1e-13)
    shares = dict(zip(system.reactions, system.held_shares(line), strict=True))
    force = system.reactions["root.force"].on_displacement @ u - shares["root.force"]
    moment = system.reactions["root.moment"].on_displacement @ u - shares["root.moment"]
    assert (force, moment) == pytest.approx((-0.3, -0.3 * LENGTH / 2.0), rel=1e-12)


def test_a_beam_on_two_supports_within_its_length_is_exact():
    # pinned at both ends, force in the middle: F L^3/(48 EI) + F L/(4 kGA)
    pins = [fi.Support("pinned", "root"), fi.Support("pinned", "tip")]
    system = fi.assemble(fi.Structure(THICK, supports=pins), 6)
    u = solve_stiffness(system, system.point_row("mid"))
    exact = LENGTH**3 / (48.0 * BENDING) + LENGTH / (4.0 * SHEARING)
    assert system.point_row("mid") @ u == pytest.approx(exact, rel=1e-13)


# ---- modes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("beam", "body"),
    [
        (THICK, {}),
        (STEPPED, {}),
        (THICK, {"tip_mass": 0.1, "tip_inertia": 2e-5, "offset": 8e-3}),
        (fi.Beam.round(length=0.15, diameter=0.025, **STEEL, shear_modulus=SHEAR), {}),
    ],
    ids=["rectangle", "stepped", "with a body", "round bar"],
)
def test_modes_are_those_of_the_transfer_matrix(beam, body):
    names = {"mass": "tip_mass", "rotary_inertia": "tip_inertia", "offset": "offset"}
    masses = [fi.PointMass("body", "tip", **{name: body[key] for name, key in names.items()})] if body else []
    structure = fi.Structure(beam, masses=masses)
    found = [fi.solve_modes(fi.assemble(structure, n), 3).natural_frequency for n in (60, 120)]
    exact = np.array([exact_frequency(beam, f, **body) for f in found[1]])
    coarse, fine = (f / exact - 1.0 for f in found)
    # from above, and of order 2
    assert np.all((fine > 0.0) & (fine < coarse) & (coarse < [2e-5, 2e-4, 1e-3]))
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.03)
    # two meshes give the limit of the order: to the next term
    assert (4.0 * found[1] - found[0]) / 3.0 == pytest.approx(exact, rel=3e-6)


def test_elements_much_longer_than_the_shear_length_have_the_order_of_a_thin_beam():
    beam = fi.Beam.uniform(length=3.0, width=WIDTH, thickness=THICKNESS, **STEEL, shear_modulus=SHEAR)
    length = beam.segments[0].shear_length
    assert length == pytest.approx(math.sqrt(BENDING / SHEARING), rel=1e-14)
    found = [fi.solve_modes(fi.assemble(fi.Structure(beam), n), 2).natural_frequency[1] for n in (8, 16)]
    assert 20.0 * length < 3.0 / 16
    exact = exact_frequency(beam, found[1])
    assert math.log2((found[0] / exact - 1.0) / (found[1] / exact - 1.0)) == pytest.approx(4.0, abs=0.2)


def test_a_free_beam_has_both_rigid_motions():
    system = fi.assemble(fi.Structure(THICK, supports=()), 12)
    frequencies = fi.solve_modes(system, 3).natural_frequency
    assert np.array_equal(frequencies[:2], [0.0, 0.0])
    # about its middle, m L^2/12 and the rotary inertia of its sections
    grid = fi.fem.discretise(fi.Structure(THICK, supports=()), 12)
    turning = np.column_stack([grid.mesh.nodes - LENGTH / 2.0, np.ones(13)]).ravel()
    rotary = DENSITY * WIDTH * THICKNESS**3 / 12.0 * LENGTH
    assert turning @ system.M @ turning == pytest.approx(THICK.mass * LENGTH**2 / 12.0 + rotary, rel=1e-12)
    assert np.abs(system.K @ turning).max() < 1e-12 * abs(system.K).max()


def test_a_shear_modulus_of_any_size_has_its_limits():
    """Rigid in shear it is the thin beam with rotary inertia; soft in shear, a string of k G A."""
    stiff = dataclasses.replace(THICK.segments[0], shear_modulus=1e9 * SHEAR)
    structure, thin = fi.Structure(fi.Beam((stiff,))), fi.Structure(THIN)
    K = [beam_matrices(fi.fem.discretise(one, 10))[0].on(np.arange(22), 22).toarray() for one in (structure, thin)]
    assert np.abs(K[0] - K[1]).max() < 1e-7 * np.abs(K[1]).max()
    soft = dataclasses.replace(THICK.segments[0], shear_modulus=1e-3 * SHEAR)
    pins = [fi.Support("pinned", "root"), fi.Support("pinned", "tip")]
    system = fi.assemble(fi.Structure(fi.Beam((soft,)), supports=pins), 100)
    u = solve_stiffness(system, system.point_row("mid"))
    exact = LENGTH**3 / (48.0 * BENDING) + LENGTH / (4.0 * 1e-3 * SHEARING)
    assert system.point_row("mid") @ u == pytest.approx(exact, rel=1e-12)


# ---- the element ---------------------------------------------------------------------------------------------------


def test_without_a_shear_modulus_the_element_is_the_cubic_one():
    system = fi.assemble(fi.Structure(THIN), 9)
    assert system.sections.shear_length is None
    rows = hermite_rows(system.nodes, [0.0123, LENGTH], 2) @ system.expansion
    assert np.array_equal(system.curvature_rows([0.0123, LENGTH]), rows.toarray())
    # and that is the limit of the one that shears, its slope included
    s = np.linspace(0.0, 1.0, 9)
    for order in range(4):
        assert np.array(shape_functions(s, order, 0.0)) == pytest.approx(np.array(shape_functions(s, order)), abs=1e-14)


def test_a_study_without_shear_has_the_key_of_before():
    axes = {"impactor.ball.gap": [1e-3, 2e-3]}
    thin, thick = paper_study(), paper_study()
    beam = thick.structure.beam
    sheared = fi.Beam((dataclasses.replace(beam.segments[0], shear_modulus=27e9),))
    thick = dataclasses.replace(thick, structure=dataclasses.replace(thick.structure, beam=sheared))
    texts = [repr(plain_study(fi.app.ParameterStudy(study, axes, ["peak"]))) for study in (thin, thick)]
    assert ["shear" in text for text in texts] == [False, True]


@pytest.mark.parametrize("ratio", [1e-3, 0.3, 50.0])
def test_an_element_is_in_equilibrium(ratio):
    """The turn is dw/dx less one shear strain, and kGA times that is minus EI times the third derivative of w."""
    h, dofs = 0.02, np.random.default_rng(5).standard_normal(4)
    s = np.linspace(0.0, 1.0, 5)
    w, turn, curvature, third = (dofs @ np.array(shape_functions(s, k, ratio)) / h**k for k in range(4))
    cubic = np.polynomial.Polynomial.fit(s * h, w, 3).convert()
    assert w[[0, -1]] == pytest.approx(dofs[[0, 2]], abs=1e-14)
    assert turn[[0, -1]] * h == pytest.approx(dofs[[1, 3]], abs=1e-13)
    strain = cubic.deriv()(s * h) - turn
    scale = np.abs(dofs).max() / h
    assert strain == pytest.approx(-((ratio * h) ** 2) * third, abs=1e-11 * scale)
    quadratic = np.polynomial.Polynomial.fit(s * h, turn, 2).convert()
    assert curvature == pytest.approx(quadratic.deriv()(s * h), abs=1e-9 * scale / h)
    assert third == pytest.approx(quadratic.deriv(2)(s * h), abs=1e-7 * scale / h**2)


def test_stiffness_is_the_product_of_its_factor_and_a_users_form_has_the_true_slope():
    grid = fi.fem.discretise(fi.Structure(STEPPED), 8)
    K, _ = beam_matrices(grid)
    G = stiffness_factor(grid)
    whole = K.on(np.arange(grid.dofs), grid.dofs)
    assert abs(whole - G.T @ G).max() < 1e-14 * abs(whole).max()

    @BilinearForm
    def tension(u, v, _):
        return u.grad[0] * v.grad[0]

    # the integral of w'^2, from w itself by Gauss points within each element
    matrix, u = tension.assemble(grid.basis), np.random.default_rng(1).standard_normal(grid.dofs)
    points, weights = np.polynomial.legendre.leggauss(3)
    total = 0.0
    for a, b in zip(grid.mesh.nodes[:-1], grid.mesh.nodes[1:], strict=True):
        x = np.linspace(a + 1e-9 * (b - a), b - 1e-9 * (b - a), 6)
        cubic = np.polynomial.Polynomial.fit(x, grid.rows(x) @ u, 3)
        total += 0.5 * (b - a) * weights @ cubic.deriv()(0.5 * (a + b) + 0.5 * (b - a) * points) ** 2
    assert u @ matrix @ u == pytest.approx(total, rel=1e-7)


def test_a_thin_segment_beside_one_that_shears_is_thin():
    thin = dataclasses.replace(STEPPED.segments[1], shear_modulus=None, shear_factor=None)
    system = fi.assemble(fi.Structure(fi.Beam((STEPPED.segments[0], thin))), 10)
    u = solve_stiffness(system, system.point_row("tip"))
    a, b = STEPPED.segments
    inner = (LENGTH**3 - 0.04**3) / (3.0 * a.bending_stiffness) + 0.06 / shear_stiffness(a)
    assert system.point_row("tip") @ u == pytest.approx(inner + 0.04**3 / (3.0 * b.bending_stiffness), rel=1e-13)
    # turned as a whole about the root: each segment's mass, and the rotary inertia of the one that shears
    grid = fi.fem.discretise(fi.Structure(fi.Beam((a, thin)), supports=()), 10)
    whole = np.column_stack([grid.mesh.nodes, np.ones(11)]).ravel()
    exact = a.mass_per_length * 0.06**3 / 3.0 + thin.mass_per_length * (LENGTH**3 - 0.06**3) / 3.0
    exact += DENSITY * a.bending_stiffness / YOUNG * 0.06
    assert whole @ beam_matrices(grid)[1].times(whole) == pytest.approx(exact, rel=1e-12)


# ---- what is given -------------------------------------------------------------------------------------------------


def test_shear_factors_are_cowpers():
    nu = YOUNG / (2.0 * SHEAR) - 1.0
    bar = fi.Beam.round(length=0.1, diameter=0.02, **STEEL, shear_modulus=SHEAR).segments[0]
    assert bar.shear_factor == pytest.approx(6.0 * (1.0 + nu) / (7.0 + 6.0 * nu), rel=1e-14)
    tube = [
        fi.Beam.tube(length=0.1, diameter=0.02, wall=w, **STEEL, shear_modulus=SHEAR).segments[0]
        for w in (1e-7, 0.0099999)
    ]
    assert tube[0].shear_factor == pytest.approx(2.0 * (1.0 + nu) / (4.0 + 3.0 * nu), rel=1e-8)
    assert tube[1].shear_factor == pytest.approx(bar.shear_factor, rel=1e-8)
    given = fi.Beam.round(length=0.1, diameter=0.02, **STEEL, shear_modulus=SHEAR, shear_factor=0.7).segments[0]
    assert given.shear_factor == 0.7
    rectangle = dataclasses.replace(THICK.segments[0], shear_factor=5.0 / 6.0)
    assert rectangle.shear_length == THICK.segments[0].shear_length
    section = {"length": 0.1, "area": 1e-4, "second_moment": 1e-9, "shear_modulus": SHEAR, "shear_factor": 0.5}
    assert fi.Beam.section(**section, **STEEL).segments[0].shear_length == pytest.approx(
        math.sqrt(YOUNG * 1e-9 / (0.5 * SHEAR * 1e-4)), rel=1e-14
    )


BAD = [
    ({"shear_modulus": 0.0}, r"^shear_modulus = 0\.0 Pa: must be a finite number > 0 Pa$"),
    ({"shear_modulus": math.nan}, r"^shear_modulus"),
    ({"shear_factor": 0.9}, r"^shear_factor = 0\.9: must be left out without shear_modulus"),
    ({"shear_modulus": SHEAR, "shear_factor": 1.01}, r"^shear_factor = 1\.01: must be a finite number > 0 and <= 1$"),
    ({"shear_modulus": SHEAR, "shear_factor": 0.0}, r"^shear_factor = 0\.0: must be"),
    ({"shear_modulus": SHEAR, "end_thickness": 0.01}, r"^shear_modulus = .*must be left out where the section tapers"),
]


@pytest.mark.parametrize(("fields", "words"), BAD)
def test_bad_numbers_are_refused_in_a_line(fields, words):
    with pytest.raises(fi.InputError, match=words) as refusal:
        fi.Segment(LENGTH, YOUNG, DENSITY, WIDTH, THICKNESS, **fields)
    assert "\n" not in str(refusal.value)


def test_a_section_that_is_no_rectangle_needs_a_factor():
    for form in ({"diameter": 0.02}, {"diameter": 0.02, "wall": 2e-3}, {"area": 1e-4, "second_moment": 1e-9}):
        with pytest.raises(fi.InputError, match=r"^shear_factor: must be given, as only a rectangle has a default"):
            fi.Segment(LENGTH, YOUNG, DENSITY, **form, shear_modulus=SHEAR)
    with pytest.raises(fi.InputError, match=r"gives Poisson's number E/\(2 G\) - 1 = 4\.25"):
        fi.Beam.round(length=LENGTH, diameter=0.02, **STEEL, shear_modulus=20e9)
    with pytest.raises(fi.InputError, match=r"^shear_modulus = 0\.0 Pa: must be a finite number > 0 Pa$"):
        fi.Beam.tube(length=LENGTH, diameter=0.02, wall=1e-3, **STEEL, shear_modulus=0.0)


def test_a_short_beam_is_unusual_only_where_shear_is_left_out():
    short = {"length": 0.06, "width": WIDTH, "thickness": THICKNESS, **STEEL}
    (word,) = map(str, unusual_numbers(fi.Structure(fi.Beam.uniform(**short))))
    assert "shear_modulus" in word
    assert unusual_numbers(fi.Structure(fi.Beam.uniform(**short, shear_modulus=SHEAR))) == []
    (word,) = map(
        str, unusual_numbers(fi.Structure(fi.Beam.uniform(**short | {"thickness": 0.13}, shear_modulus=SHEAR)))
    )
    assert word.startswith("beam.thickness = 0.13 m: more than the length of the beam")


# ---- what reads it -------------------------------------------------------------------------------------------------


def test_drawings_and_channels_read_the_turn_of_the_section():
    structure = fi.Structure(THICK, masses=[fi.PointMass("box", "tip", 0.05, offset=5e-3)])
    system = fi.assemble(structure, 6)
    u = solve_stiffness(system, system.point_row("tip"))
    nodal = np.asarray(system.expansion @ u)
    scene = build_scene(structure, system, subdivisions=2)
    # the beam's own points lie at their sections: those that turn by the closed form are all of them
    count = sum(len(body.points) for body in scene.bodies if body.part == BEAM)
    points = scene.points[:count]
    x = points[:, 0]
    turn = (LENGTH * x - 0.5 * x**2) / BENDING
    assert scene.rotation(nodal)[:count, 2] == pytest.approx(turn, rel=1e-11, abs=1e-12 * turn.max())
    deflection = (3.0 * LENGTH - x) * x**2 / (6.0 * BENDING) + x / SHEARING
    moved = scene.motion(nodal, np.zeros(0))[:count]
    assert moved[:, 1] == pytest.approx(deflection, rel=1e-11, abs=1e-12 * deflection.max())
    # sections turn, and do not follow the axis: the surface moves along by its height times the turn
    assert moved[:, 0] == pytest.approx(-points[:, 1] * turn, rel=1e-11, abs=1e-14)


def test_a_slow_run_reads_statics_in_its_channels():
    """A force of 1 N that grows over a hundred periods: moment, shear, turn, stress and reactions at rest under it."""
    structure = fi.Structure(THICK, damping=fi.Rayleigh(0.05, (1, 2)))
    system = fi.reduce(fi.assemble(structure, 8), modes=16)
    channels = ("tip.rotation", "root.bending_moment", "mid.shear_force", "root.surface_stress", "root.reaction_moment")
    force = fi.PointForce("tip", fi.Sine(1.0, 0.1))
    run = fi.integrate(system, force, fi.EventDriven(), duration=2.5, record=fi.Recorder(channels=channels))
    assert {name: run[name][-1] for name in channels} == pytest.approx(
        {
            "tip.rotation": LENGTH**2 / (2.0 * BENDING),
            "root.bending_moment": LENGTH,
            "mid.shear_force": -1.0,
            "root.surface_stress": -6.0 * LENGTH / (WIDTH * THICKNESS**2),
            "root.reaction_moment": -LENGTH,
        },
        rel=1e-6,
    )


STUDY = """
[beam]
length = "100 mm"
width = "20 mm"
thickness = "13 mm"
young_modulus = "210 GPa"
density = 7850
shear_modulus = "80 GPa"
shear_factor = "90 %"

[mesh]
elements = 6

[base]
amplitude = "1 um"
frequency = 500.0
duration = 0.1

[output]
frames = 10
frame_cycles = 1.0
figures = false
paraview = false
movie = false
"""


def test_a_study_file_has_both_keys_with_units(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text(STUDY, encoding="utf-8")
    study = fi.load_study(path)
    (segment,) = study.structure.beam.segments
    assert (segment.shear_modulus, segment.shear_factor) == (80e9, 0.9)
    thinner = dataclasses.replace(study.structure, beam=fi.Beam((dataclasses.replace(segment, thickness=0.012),)))
    written = study_text(dataclasses.replace(study, structure=thinner))
    assert read_study(written, path).structure == thinner
    path.write_text(STUDY.replace('"80 GPa"', "0.0"), encoding="utf-8")
    with pytest.raises(fi.InputError, match=r"^beam\.shear_modulus = 0\.0 Pa: must be a finite number > 0 Pa$"):
        fi.load_study(path)


def test_a_directory_that_is_read_back_draws_the_beam_that_shears(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text(STUDY, encoding="utf-8")
    fi.run_study(fi.load_study(path), tmp_path / "results")
    reading = read_results(tmp_path / "results", fi.load_study(path))
    system = fi.assemble(fi.load_study(path).structure, 6)
    x, nodal = np.linspace(0.0, LENGTH, 17), np.random.default_rng(3).standard_normal(14)
    for drawn in (reading.modes.system, reading.film.system):
        for order in (0, 1):
            rows = drawn.nodal_rows(x, order)
            assert np.array_equal(rows.toarray(), system.nodal_rows(x, order).toarray())
            assert np.abs((rows - hermite_rows(system.nodes, x, order)) @ nodal).max() > 1e-3


def test_convergence_expects_the_orders_that_it_finds():
    c, structure = fi.convergence, fi.Structure(THICK, damping=fi.Rayleigh(0.01, (1, 2)))
    watch = [
        c.Frequencies(2),
        c.ModeShapes(1),
        c.SteadyResponse("tip"),
        c.SurfaceStress("root"),
        c.BendingMoment("mid", 2),
        c.SupportReaction("root.moment"),
    ]
    base = fi.Sine(1e-6, 500.0)
    orders = {}
    for counts in ([48, 96, 192, 384], [2, 3, 4]):
        table = fi.convergence_study(structure, c.OverMeshes.uniform(structure, counts), watch, base)["mesh"]
        orders[counts[0]] = table.expected_order.tolist()
        if counts[0] == 48:
            assert table.fitted_order[:2] == pytest.approx([2.0, 2.0], abs=0.1)
            assert table.fitted_order[4:] == pytest.approx([2.0, 2.0, 1.0, 2.0], abs=0.2)
    assert orders[48] == [2.0, 2.0, 1.0, 4.0, 2.0, 2.0, 1.0, 2.0]
    # no element is as short as sqrt(EI/(kGA))
    assert orders[2] == [4.0, 4.0, 2.0, 8.0, 4.0, 2.0, 2.0, 4.0]
