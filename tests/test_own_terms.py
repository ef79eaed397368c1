"""Terms that a user adds on the basis: foundations, axial forces, gravity along the beam, rotary inertia."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.special
from skfem import BilinearForm

import femimpact as fi
from femimpact.system.hermite import hermite_rows
from femimpact.system.modes import solve_stiffness

LENGTH, WIDTH, THICKNESS, MODULUS, DENSITY = 0.4, 0.02, 1.2e-3, 70e9, 2700.0
BEAM = fi.Beam.uniform(length=LENGTH, width=WIDTH, thickness=THICKNESS, young_modulus=MODULUS, density=DENSITY)
EI, RHO_A = BEAM.segments[0].bending_stiffness, BEAM.segments[0].mass_per_length
LAW = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
PINNED = (fi.Support("pinned", "root"), fi.Support("pinned", "tip"))
CLAMPED = (fi.Support("clamped", "root"), fi.Support("clamped", "tip"))
CANTILEVER = (fi.Support("clamped", "root"),)


@BilinearForm
def product(u, v, w):
    return w.c * u * v


@BilinearForm
def slopes(u, v, w):
    """Integral of c w' v': of an axial force, or of rotary inertia."""
    return w.c * u.grad[0] * v.grad[0]


def matrix(form, structure, elements, coefficient):
    """A form on the structure's basis, its coefficient a number or a function of x."""
    grid = fi.fem.discretise(structure, elements=elements)
    values = coefficient(grid.basis.global_coordinates()[0]) if callable(coefficient) else coefficient
    return form.assemble(grid.basis, c=values + grid.basis.zero_w())


def omega(system, count):
    return 2.0 * math.pi * fi.solve_modes(system, count).natural_frequency


@pytest.mark.parametrize("supports", [CANTILEVER, PINNED], ids=["cantilever", "pinned"])
@pytest.mark.parametrize("elements", [10, 60])
def test_a_uniform_foundation_adds_k_over_rho_a_to_every_square(supports, elements):
    structure, stiffness = fi.Structure(beam=BEAM, supports=supports), 800.0
    bare = fi.assemble(structure, elements=elements)
    held = fi.system.add_terms(bare, stiffness=matrix(product, structure, elements, stiffness))
    # the foundation is in proportion to the mass, so that the modes stay; rounding of the two solves is left
    np.testing.assert_allclose(omega(held, 6) ** 2, omega(bare, 6) ** 2 + stiffness / RHO_A, rtol=1e-9)


EULER = {"clamped and free": (CANTILEVER, 0.25), "clamped at both ends": (CLAMPED, 4.0)}


@pytest.mark.parametrize("ends", EULER)
def test_the_euler_load_is_met_with_the_fourth_order(ends):
    supports, share = EULER[ends]
    structure, exact = fi.Structure(beam=BEAM, supports=supports), share * math.pi**2 * EI / LENGTH**2
    errors = []
    for elements in (8, 16, 32):
        bare = fi.assemble(structure, elements=elements)
        unit = fi.system.add_terms(bare, stiffness=matrix(slopes, structure, elements, 1.0)).K - bare.K
        critical = 1.0 / scipy.linalg.eigh(unit.toarray(), bare.K.toarray(), eigvals_only=True)[-1]
        errors.append(critical / exact - 1.0)
        # and there the structure buckles
        below, above = (matrix(slopes, structure, elements, -s * critical) for s in (1.0 - 1e-6, 1.0 + 1e-6))
        assert fi.system.add_terms(bare, stiffness=below).first_frequency < 0.01 * bare.first_frequency
        with pytest.raises(fi.InputError, match=r"stiffness: .* has buckled"):
            fi.system.add_terms(bare, stiffness=above)
    assert min(errors) > 0.0
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 4.0, atol=0.1)


@pytest.mark.parametrize("share", [5.0, 0.5, -0.5, -0.99])
def test_an_axial_force_shifts_the_frequencies_of_a_pinned_beam(share):
    structure, elements = fi.Structure(beam=BEAM, supports=PINNED), 40
    force = share * math.pi**2 * EI / LENGTH**2
    loaded = fi.system.add_terms(
        fi.assemble(structure, elements=elements), stiffness=matrix(slopes, structure, elements, force)
    )
    n = np.arange(1, 4)
    unloaded = (n * math.pi / LENGTH) ** 4 * EI / RHO_A
    exact = unloaded + (n * math.pi / LENGTH) ** 2 * force / RHO_A
    # the mesh's share of the unloaded square, (kh)^4/720, and Cholesky's rounding of it
    mesh = (n * math.pi / elements) ** 4 / 720.0
    assert np.all(np.abs(omega(loaded, 3) ** 2 - exact) <= (1.1 * mesh + 1e-8) * unloaded + 1.1 * mesh * np.abs(exact))


def heavy_column(weight, tip):
    """Shares of both weights, as a tip force over EI/L^2, under which a standing cantilever buckles.

    With s = distance from the tip over L, theta'' + lambda (weight s + tip) theta = 0, theta'(0) = 0, theta(1) = 0:
    theta is a sum of Airy functions of -z, z = a s + b with a^3 = lambda weight and b = a tip/weight.
    """

    def at_root(factor):
        a = (factor * weight) ** (1.0 / 3.0)
        b = a * tip / weight
        tip_end, root_end = scipy.special.airy(-b), scipy.special.airy(-(a + b))
        return tip_end[3] * root_end[0] - tip_end[1] * root_end[2]

    grid = np.linspace(1e-3, 10.0, 4001)
    first = int(np.flatnonzero(np.diff(np.sign([at_root(x) for x in grid])))[0])
    return scipy.optimize.brentq(at_root, grid[first], grid[first + 1], xtol=1e-13)


def test_the_reference_of_a_heavy_column_is_greenhills():
    assert heavy_column(1.0, 0.0) == pytest.approx(7.83735, rel=1e-6)
    assert heavy_column(1e-4, 1.0) == pytest.approx(math.pi**2 / 4.0, rel=1e-4)


@pytest.mark.parametrize("tip", [0.0, 0.3, 2.0], ids=["own weight", "light box", "heavy box"])
def test_gravity_along_a_standing_beam_buckles_it_and_a_hanging_one_stiffens(tip):
    # box of `tip` times the beam's mass; gravity enough to buckle
    box = [fi.PointMass("box", "tip", tip * BEAM.mass)] if tip else []
    structure, elements = fi.Structure(beam=BEAM, masses=box), 16
    bare = fi.assemble(structure, elements=elements)

    def weight(x):
        """Weight (N) above x under 1 m/s^2."""
        return RHO_A * (LENGTH - x) + tip * BEAM.mass

    critical = heavy_column(1.0, tip) * EI / LENGTH**3 / RHO_A
    # the mesh meets the load to the fourth order of the element's length
    for gravity, buckled in ((critical * (1 - 1e-4), False), (critical * (1 + 1e-4), True)):
        standing = matrix(slopes, structure, elements, lambda x, g=gravity: -g * weight(x))
        if buckled:
            with pytest.raises(fi.InputError, match="has buckled"):
                fi.system.add_terms(bare, stiffness=standing)
        else:
            assert fi.system.add_terms(bare, stiffness=standing).first_frequency < 0.02 * bare.first_frequency
    hanging = fi.system.add_terms(bare, stiffness=matrix(slopes, structure, elements, lambda x: critical * weight(x)))
    # the least eigenvalue is concave in the load: the square rises by no more than it fell
    assert bare.first_frequency < hanging.first_frequency < math.sqrt(2.0) * bare.first_frequency
    if not tip:
        # Southwell's bound: squares of the weightless beam and of the hanging chain, whose root of J0 is 2.404826
        chain = (2.404826 / 2.0) ** 2 * critical / LENGTH
        beam = 1.8751041**4 * EI / (RHO_A * LENGTH**4)
        assert (2.0 * math.pi * hanging.first_frequency) ** 2 > beam + chain


def test_a_beams_own_rotary_inertia_is_that_of_the_rayleigh_beam():
    thick = fi.Beam.uniform(length=0.4, width=0.02, thickness=0.03, young_modulus=MODULUS, density=DENSITY)
    structure, elements = fi.Structure(beam=thick, supports=PINNED), 40
    rotary = DENSITY * 0.02 * 0.03**3 / 12.0
    bare = fi.assemble(structure, elements=elements)
    turning = fi.system.add_terms(bare, mass=matrix(slopes, structure, elements, rotary))
    n = np.arange(1, 4)
    k = n * math.pi / 0.4
    section = thick.segments[0]
    exact = k**4 * section.bending_stiffness / (section.mass_per_length + rotary * k**2)
    mesh = (k * 0.4 / elements) ** 4 / 720.0
    assert np.all(np.abs(omega(turning, 3) ** 2 / exact - 1.0) <= 1.1 * mesh + 1e-9)
    # a translation turns nothing, also where the held dofs move along
    np.testing.assert_allclose(turning.base_load, bare.base_load, atol=1e-12 * bare.total_mass)
    assert turning.total_mass == pytest.approx(bare.total_mass, rel=1e-12)


def bodies(at):
    """A structure with a ball and a wall, and the same with a body at a place."""
    without = fi.Structure(
        beam=BEAM,
        impactors=[fi.Impactor("ball", "tip", 3e-3, 1e-3, LAW)],
        stops=[fi.Stop("wall", 0.25, 1e-3, LAW)],
        damping=fi.Rayleigh(0.01, frequencies=(20.0, 200.0)),
        gravity=-9.81,
    )
    return without, replace(without, masses=[fi.PointMass("body", at, 0.03, 2e-6)])


@pytest.mark.parametrize("at", ["tip", 0.013], ids=["tip", "beside the root"])
def test_a_mass_added_as_a_matrix_is_the_body_assembled(at):
    without, whole = bodies(at)
    mesh = fi.fem.Mesh(np.linspace(0.0, LENGTH, 9))
    assembled, bare = fi.assemble(whole, mesh=mesh), fi.assemble(without, mesh=mesh)
    place = [LENGTH if at == "tip" else at]
    shape, slope = (hermite_rows(mesh.nodes, place, order).toarray() for order in (0, 1))
    mass = 0.03 * shape.T @ shape + 2e-6 * slope.T @ slope
    rigid = np.tile([1.0, 0.0], mesh.nodes.size)
    added = fi.system.add_terms(bare, mass=mass, load=-9.81 * mass @ rigid)
    for name in ("M", "C", "K"):
        one, other = (getattr(s, name).toarray() for s in (added, assembled))
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-14 * np.abs(other).max())
    for name in ("base_load", "constant_load", "total_mass", "first_frequency"):
        np.testing.assert_allclose(getattr(added, name), getattr(assembled, name), rtol=1e-9, atol=1e-15)
    assert added.rayleigh == assembled.rayleigh
    for one, other in zip(added.contacts, assembled.contacts, strict=True):
        assert one.effective_mass == pytest.approx(other.effective_mass, rel=1e-9)
        assert one.flexibility == pytest.approx(other.flexibility, rel=1e-9)
    for name, item in assembled.reactions.items():
        own = added.reactions[name]
        for part in ("on_acceleration", "on_velocity", "on_displacement", "on_base_acceleration", "constant"):
            exact = getattr(item, part)
            tolerance = 1e-14 * np.abs(exact).max()
            np.testing.assert_allclose(getattr(own, part), exact, rtol=1e-12, atol=tolerance)


def test_a_load_bends_as_statics_say():
    structure = fi.Structure(beam=BEAM)
    system = fi.assemble(structure, elements=8)
    force = np.zeros(18)
    force[-2], force[-1] = 2.0, 0.3
    loaded = fi.system.add_terms(system, load=force)
    u = solve_stiffness(loaded, loaded.constant_load)
    deflection = 2.0 * LENGTH**3 / (3 * EI) + 0.3 * LENGTH**2 / (2 * EI)
    # cubic elements are exact under forces at nodes
    assert float(loaded.point_row("tip") @ u) == pytest.approx(deflection, rel=1e-10)
    assert loaded.first_frequency == pytest.approx(system.first_frequency, rel=1e-12)


def test_rayleigh_damping_holds_for_the_sums_and_reduces():
    without, _ = bodies("tip")
    elements = 12
    bare = fi.assemble(without, elements=elements)
    tense = fi.system.add_terms(bare, stiffness=matrix(slopes, without, elements, 40.0))
    alpha, beta = bare.rayleigh
    modes = fi.solve_modes(tense, 4)
    w = 2.0 * math.pi * modes.natural_frequency
    np.testing.assert_allclose(modes.damping_ratio, 0.5 * (alpha / w + beta * w), rtol=1e-12)
    small = fi.reduce(tense, modes=4)
    np.testing.assert_allclose(small.C.diagonal(), alpha + beta * w**2, rtol=1e-9)


def test_damping_of_ones_own_adds_to_rayleighs():
    without, _ = bodies("tip")
    elements, air = 12, 0.05
    bare = fi.assemble(without, elements=elements)
    damped = fi.system.add_terms(bare, damping=matrix(product, without, elements, air))
    before, after = fi.solve_modes(bare, 3), fi.solve_modes(damped, 3)
    # a viscous force per length in proportion to the mass: c/(2 rho A omega) more
    more = air / (2.0 * RHO_A * 2.0 * math.pi * before.natural_frequency)
    np.testing.assert_allclose(after.damping_ratio, before.damping_ratio + more, rtol=1e-8)
    root = damped.reactions["root.force"].on_velocity - bare.reactions["root.force"].on_velocity
    np.testing.assert_allclose(root, (air / RHO_A) * bare.reactions["root.force"].on_acceleration, rtol=1e-10)


def test_damping_and_load_leave_frequency_and_compliances_what_they_are():
    ball, stop = fi.Impactor("ball", "tip", 2e-3, 1e-3, LAW), fi.Stop("stop", "mid", 1e-3, LAW)
    structure = fi.Structure(beam=BEAM, impactors=[ball], stops=[stop])
    bare, elements = fi.assemble(structure, elements=40), 40
    air = matrix(product, structure, elements, 0.05)
    for system in (fi.system.add_terms(bare, damping=air, load=np.ones(2 * elements + 2)), fi.system.add_terms(bare)):
        assert system.first_frequency == bare.first_frequency
        assert [pair.effective_mass for pair in system.contacts] == [pair.effective_mass for pair in bare.contacts]
        assert [pair.flexibility for pair in system.contacts] == [pair.flexibility for pair in bare.contacts]


def test_a_fine_mesh_keeps_its_digits_under_tension_and_on_a_foundation():
    structure, coarse, fine = fi.Structure(beam=BEAM), 20, 1000
    for form, size in ((slopes, 30.0), (product, 500.0)):
        first = []
        for elements in (coarse, fine):
            system = fi.assemble(structure, elements=elements)
            held = fi.system.add_terms(system, stiffness=matrix(form, structure, elements, size))
            first.append(held.first_frequency)
        # the coarse mesh's own error, (k h)^4/720 with kL = 1.875 or more, and what tension adds to it; rounding of an
        # assembled stiffness of 1000 elements would be 1e-4
        assert first[1] == pytest.approx(first[0], rel=1e-6)
