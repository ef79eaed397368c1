"""The basis of a structure on a mesh: weak forms that a user writes stand beside those of `assemble`, dof by dof."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from skfem import BilinearForm
from skfem.helpers import dd, ddot

import femimpact as fi

STEPPED = fi.Structure(
    beam=fi.Beam(
        (
            fi.Segment(0.1, 70e9, 2700.0, width=0.02, thickness=2e-3, name="thick"),
            fi.Segment(0.2, 210e9, 7850.0, area=2e-5, second_moment=1.5e-12, name="thin"),
        )
    ),
    supports=(fi.Support("pinned", "root"), fi.Support("guided", 0.1), fi.Support("clamped", "tip")),
)


@BilinearForm
def stiffness(u, v, w):
    return w.EI * ddot(dd(u), dd(v))


@BilinearForm
def mass(u, v, w):
    return w.rhoA * u * v


THICK, THIN = STEPPED.beam.segments
TAPERED = dataclasses.replace(
    STEPPED, beam=fi.Beam((dataclasses.replace(THICK, end_width=5e-3, end_thickness=4e-3), THIN))
)
HEAVIER = dataclasses.replace(STEPPED, beam=fi.Beam((THICK, dataclasses.replace(THIN, density=9000.0))))


# one after the other on the same mesh, whose element integrals they share
@pytest.mark.parametrize("structure", [STEPPED, TAPERED, HEAVIER])
def test_forms_of_ones_own_have_the_dofs_and_the_values_of_the_system(structure):
    grid, system = fi.fem.discretise(structure, elements=6), fi.assemble(structure, elements=6)
    K = stiffness.assemble(grid.basis, EI=grid.bending_stiffness)
    M = mass.assemble(grid.basis, rhoA=grid.mass_per_length)
    if structure is not TAPERED:
        constant = grid.at_quadrature(grid.sections.bending_stiffness)
        np.testing.assert_array_equal(grid.bending_stiffness, constant)
    for own, whole in ((K, system.K), (M, system.M)):
        # to rounding, each entry against the diagonal ones: the system has the integrals of ones times the sections
        own = own[grid.free][:, grid.free].toarray()
        size = np.sqrt(np.outer(np.diag(own), np.diag(own)))
        np.testing.assert_allclose(own / size, whole.toarray() / size, rtol=0.0, atol=1e-15)


def test_supports_hold_deflection_or_slope_at_their_nodes():
    grid = fi.fem.discretise(STEPPED, elements=6)
    node = int(np.argmin(np.abs(grid.mesh.nodes - 0.1)))
    np.testing.assert_array_equal(grid.held, [0, 2 * node + 1, grid.dofs - 2, grid.dofs - 1])
    assert grid.free.size + grid.held.size == grid.dofs == grid.basis.N


def test_sections_fill_the_beam():
    grid = fi.fem.discretise(STEPPED, elements=7)
    lengths, sections = np.diff(grid.mesh.nodes), grid.sections
    assert lengths @ sections.mass_per_length == pytest.approx(STEPPED.beam.mass, rel=1e-14)
    thin = sections.region == "thin"
    assert lengths[thin].sum() == pytest.approx(0.2, rel=1e-14)
    np.testing.assert_allclose(sections.bending_stiffness[thin], 210e9 * 1.5e-12, rtol=1e-14)
    np.testing.assert_allclose(sections.rotary_inertia[thin], 7850.0 * 1.5e-12, rtol=1e-14)
    # area and second moment do not say where the surface is
    assert np.isnan(sections.half_height[thin]).all()
    np.testing.assert_allclose(sections.half_height[~thin], 1e-3, rtol=1e-14)


def test_a_cubic_has_its_exact_energy_on_any_mesh():
    mesh = fi.fem.Mesh([0.0, 0.02, 0.1, 0.15, 0.3], regions={"thick": [0, 1], "thin": [2, 3]})
    grid = fi.fem.discretise(STEPPED, mesh=mesh)
    K = stiffness.assemble(grid.basis, EI=grid.at_quadrature(grid.sections.bending_stiffness))
    x = mesh.nodes
    # w = x^3 + 2 x^2, with w'' = 6 x + 4, whose square integrates to 12 x^3 + 24 x^2 + 16 x
    u = np.column_stack([x**3 + 2 * x**2, 3 * x**2 + 4 * x]).ravel()
    integral = 12 * x**3 + 24 * x**2 + 16 * x
    exact = grid.sections.bending_stiffness @ np.diff(integral)
    # rounding of 1e-16, times how much larger the terms of a single element are than their sum
    assert u @ K @ u == pytest.approx(exact, rel=1e-11)
