"""The cubic Hermite element: closed-form matrices, any mesh, any order of meshes."""

import numpy as np
import pytest
from builders import stepped_structure
from skfem import Basis, ElementLineHermite, MeshLine

import femimpact as fi
from femimpact.fem.assembly import bending, inertia
from femimpact.fem.discretisation import ElementLineHermiteReference
from femimpact.system.hermite import shape_functions


def closed_form(nodes, bending_stiffness, mass_per_length):
    """K and M of a row of Euler-Bernoulli elements from the textbook 4 x 4 matrices."""
    K, M = (np.zeros((2 * nodes.size, 2 * nodes.size)) for _ in range(2))
    for i, h in enumerate(np.diff(nodes)):
        dofs = slice(2 * i, 2 * i + 4)
        K[dofs, dofs] += (bending_stiffness / h**3) * np.array(
            [
                [12, 6 * h, -12, 6 * h],
                [6 * h, 4 * h**2, -6 * h, 2 * h**2],
                [-12, -6 * h, 12, -6 * h],
                [6 * h, 2 * h**2, -6 * h, 4 * h**2],
            ]
        )
        M[dofs, dofs] += (mass_per_length * h / 420) * np.array(
            [
                [156, 22 * h, 54, -13 * h],
                [22 * h, 4 * h**2, 13 * h, -3 * h**2],
                [54, 13 * h, 156, -22 * h],
                [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
            ]
        )
    return K, M


def assembled(nodes, element, bending_stiffness=2.5, mass_per_length=0.7):
    basis = Basis(MeshLine(nodes), element, intorder=6)
    each = basis.zero_w()
    K = bending.assemble(basis, bending_stiffness=bending_stiffness + each)
    M = inertia.assemble(basis, mass_per_length=mass_per_length + each)
    return K.toarray(), M.toarray()


def difference(matrix, exact):
    """Largest entry of the difference, each entry against the diagonal ones of its row and column."""
    scale = np.sqrt(np.diag(exact))
    return np.max(np.abs(matrix - exact) / np.outer(scale, scale))


MESHES = {
    "one element": np.array([0.0, 0.3]),
    "mild": np.linspace(0.0, 1.0, 6),
    # lengths from 1 to 1e-4
    "graded": np.concatenate([[0.0], np.cumsum(np.geomspace(1.0, 1e-4, 9))]),
    "far from the origin": 1000.0 + np.linspace(0.0, 0.5, 9),
}


@pytest.mark.parametrize("name", MESHES)
def test_element_matrices_are_the_closed_form_ones(name):
    nodes = MESHES[name]
    matrices = assembled(nodes, ElementLineHermiteReference())
    exact = closed_form(nodes, 2.5, 0.7)
    for matrix, reference in zip(matrices, exact, strict=True):
        # some hundred roundings of 1e-16 in a quadrature sum
        assert difference(matrix, reference) < 1e-13


def test_one_instance_is_right_on_a_second_mesh_where_the_stock_element_is_wrong():
    ours, stock = ElementLineHermiteReference(), ElementLineHermite()
    first, second = np.linspace(0.0, 1.0, 6), np.linspace(0.0, 2.0, 6)
    for element in (ours, stock):
        for matrix, exact in zip(assembled(first, element), closed_form(first, 2.5, 0.7), strict=True):
            # the stock element inverts a Vandermonde matrix in global coordinates: it loses 3 digits or so
            assert difference(matrix, exact) < 1e-10
    K, M = closed_form(second, 2.5, 0.7)
    ours_K, ours_M = assembled(second, ours)
    stock_K, stock_M = assembled(second, stock)
    # rounding, as above
    assert difference(ours_K, K) < 1e-13
    assert difference(ours_M, M) < 1e-13
    # the stock one keeps the first mesh's polynomials: off by the order of one
    assert max(difference(stock_K, K), difference(stock_M, M)) > 0.1


def test_reversed_elements_give_the_same_matrices():
    nodes = np.linspace(0.0, 1.0, 5)
    mesh = MeshLine(nodes[None, :], np.array([[1, 1, 3, 3], [0, 2, 2, 4]]), sort_t=False)
    assert np.any(mesh.p[0, mesh.t[1]] < mesh.p[0, mesh.t[0]])
    basis = Basis(mesh, ElementLineHermiteReference(), intorder=6)
    K = bending.assemble(basis, bending_stiffness=2.5 + basis.zero_w()).toarray()
    # rounding of the quadrature sum
    assert difference(K, closed_form(nodes, 2.5, 0.7)[0]) < 1e-13


def test_every_cubic_is_reproduced_with_all_its_derivatives():
    x = np.linspace(0.2, 0.9, 7)
    h, s = x[-1] - x[0], (x - x[0]) / (x[-1] - x[0])
    cubic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 1.5])
    dofs = [cubic(x[0]), h * cubic.deriv()(x[0]), cubic(x[-1]), h * cubic.deriv()(x[-1])]
    for order in range(4):
        value = dofs @ np.array(shape_functions(s, order)) / h**order
        # values of order 10, a dozen operations
        np.testing.assert_allclose(value, cubic.deriv(order)(x) if order else cubic(x), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("modes", [None, 8])
def test_stiffness_factor_times_its_transpose_is_the_stiffness(system, modes):
    used = system if modes is None else fi.reduce(system, modes=modes)
    K, G = used.K.toarray(), used.stiffness_factor.toarray()
    # rounding of sums of 4 products
    assert difference(G.T @ G, K) < 1e-13


def test_a_stepped_beam_is_the_sum_of_its_segments():
    system = fi.assemble(stepped_structure(), elements=10)
    K, M = np.zeros((22, 22)), np.zeros((22, 22))
    for (first, last), bending_stiffness, mass_per_length in (
        ((0, 6), 70e9 * 0.02 * 2e-3**3 / 12, 2700 * 0.02 * 2e-3),
        ((6, 10), 70e9 * 0.02 * 1e-3**3 / 12, 2700 * 0.02 * 1e-3),
    ):
        parts = closed_form(system.nodes[first : last + 1], bending_stiffness, mass_per_length)
        dofs = slice(2 * first, 2 * last + 2)
        K[dofs, dofs] += parts[0]
        M[dofs, dofs] += parts[1]
    # rounding of the quadrature sum; the clamped root takes the first two dofs
    assert difference(system.K.toarray(), K[2:, 2:]) < 1e-13
    assert difference(system.M.toarray(), M[2:, 2:]) < 1e-13


def test_deflection_rows_read_any_cubic_and_its_derivatives_between_the_nodes():
    nodes = np.array([0.0, 0.02, 0.05, 0.2])
    beam = fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=7e10, density=2700)
    system = fi.assemble(fi.Structure(beam), mesh=fi.fem.Mesh(nodes))
    cubic = np.polynomial.Polynomial([0.0, 0.0, 2.0, -3.0])  # clamped at the root
    dofs = np.column_stack([cubic(nodes), cubic.deriv()(nodes)]).ravel()[2:]
    x = np.array([0.0, 0.013, 0.02, 0.0499, 0.11, 0.2])
    for order in range(4):
        exact = cubic.deriv(order)(x) if order else cubic(x)
        # rounding, divided by up to h^3 = 8e-6 of the shortest element with values of 1e-3
        np.testing.assert_allclose(system.deflection_rows(x, order) @ dofs, exact, rtol=1e-10, atol=1e-12 * 50**order)
