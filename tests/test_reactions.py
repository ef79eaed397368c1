"""Reactions of supports and readings of sections: what statics and the sum of all forces say they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi
from femimpact.system.modes import solve_stiffness

LAW = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
BEAM = fi.Beam.uniform(length=0.3, width=0.02, thickness=1.5e-3, young_modulus=70e9, density=2700.0)
CANTILEVER = fi.Structure(
    beam=BEAM,
    masses=[fi.PointMass("box", "tip", 0.02, 1e-6), fi.PointMass("collar", 0.13, 0.01)],
    impactors=[fi.Impactor("ball", "tip", 3e-3, 1e-3, LAW)],
    stops=[fi.Stop("wall", 0.2, 1e-3, LAW)],
    damping=fi.Rayleigh(0.01, modes=(1, 2)),
    gravity=-9.81,
)
STEPPED = fi.Beam(
    (
        fi.Segment(0.1, 70e9, 2700.0, width=0.02, thickness=2e-3, name="thick"),
        fi.Segment(0.2, 210e9, 7850.0, width=0.01, thickness=1e-3, name="thin"),
    )
)
SUPPORTS = {
    "clamped": (fi.Support("clamped", "root"),),
    "pinned at both ends": (fi.Support("pinned", "root"), fi.Support("pinned", "tip")),
    "guided and pinned": (fi.Support("guided", "root"), fi.Support("pinned", "tip")),
    "clamped and pinned between": (fi.Support("clamped", "root"), fi.Support("pinned", 0.22)),
}


def read(system, name, u=None, v=None, a=None, base=0.0, forces=None):
    """Reaction by the documented sum."""
    item, rest = system.reactions[name], np.zeros(system.dofs)
    u, v, a = (rest if given is None else given for given in (u, v, a))
    value = item.on_acceleration @ a + item.on_velocity @ v + item.on_displacement @ u
    value += item.on_base_acceleration * base - item.constant
    if forces is not None:
        value -= system.contact_shares[list(system.reactions).index(name)] @ forces
    return value


def moving(system, seed):
    """A random state, base acceleration and contact forces, with the accelerations of the equation of motion."""
    rng = np.random.default_rng(seed)
    u, v = rng.normal(size=(2, system.dofs))
    base, forces = rng.normal(), rng.normal(size=len(system.contacts))
    load = system.constant_load - system.base_load * base - system.C @ v - system.K @ u
    load += sum(pair.direction * force for pair, force in zip(system.contacts, forces, strict=True))
    return u, v, np.linalg.solve(system.M.toarray(), load), base, forces


@pytest.mark.parametrize("elements", [1, 7])
def test_a_static_force_on_the_tip_gives_f_and_f_times_l_at_the_root(elements):
    force, length = 2.5, BEAM.length
    system = fi.assemble(fi.Structure(beam=BEAM), elements=elements)
    u = solve_stiffness(system, force * system.point_row("tip"))
    # cubic elements are exact under forces at nodes; the rest is rounding, amplified by a few elements' stiffness
    assert read(system, "root.force", u) == pytest.approx(-force, rel=1e-9)
    assert read(system, "root.moment", u) == pytest.approx(-force * length, rel=1e-9)
    x = np.array([0.0, 0.1, 0.29])
    stiffness = system.section_at("tip").bending_stiffness
    np.testing.assert_allclose(stiffness * (system.curvature_rows(x) @ u), force * (length - x), rtol=1e-9)
    np.testing.assert_allclose(system.shear_rows(x) @ u, -force, rtol=1e-9)


def test_units_and_names_say_what_a_support_holds():
    structure = replace(CANTILEVER, supports=SUPPORTS["clamped and pinned between"])
    reactions = fi.assemble(structure, elements=6).reactions
    assert {name: item.unit for name, item in reactions.items()} == {
        "root.force": "N", "root.moment": "N m", "0.22.force": "N",
    }  # fmt: skip


@pytest.mark.parametrize("supports", SUPPORTS)
@pytest.mark.parametrize("contact", ["tip", 0.004])
def test_reactions_are_the_sum_of_inertia_and_all_other_forces(supports, contact):
    # the second place lies in the element beside the root, on a mesh that has no node there
    structure = replace(
        CANTILEVER,
        supports=SUPPORTS[supports],
        impactors=[replace(CANTILEVER.impactors[0], at=contact)],
    )
    mesh = fi.fem.Mesh(np.array([0.0, 0.05, 0.13, 0.2, 0.22, 0.26, 0.3]))
    system = fi.assemble(structure, mesh=mesh)
    alpha = system.rayleigh[0]
    weight = -9.81 * system.total_mass
    for seed in range(5):
        u, v, a, base, forces = moving(system, seed)
        found = sum(
            read(system, name, u, v, a, base, forces) for name, item in system.reactions.items() if item.unit == "N"
        )
        inertia = system.base_load @ a + system.total_mass * base + alpha * (system.base_load @ v)
        # the ball's force acts on the structure as it is, the wall's with the opposite sign of its direction
        exact = inertia - weight - (forces[0] - forces[1])
        largest = np.abs(system.reactions[next(iter(system.reactions))].on_displacement @ np.diag(u)).max()
        assert found == pytest.approx(exact, abs=1e-9 * largest)


@pytest.mark.parametrize("supports", SUPPORTS)
def test_moments_about_the_root_balance_too(supports):
    structure = replace(CANTILEVER, supports=SUPPORTS[supports], damping=None)
    system = fi.assemble(structure, elements=9)
    grid = fi.fem.discretise(structure, elements=9)
    # a rigid rotation about the root: w = x, w' = 1
    turned = np.column_stack([grid.mesh.nodes, np.ones(grid.mesh.nodes.size)]).ravel()
    u, v, a, base, forces = moving(system, 3)
    found = sum(turned[item.dof] * read(system, name, u, v, a, base, forces) for name, item in system.reactions.items())
    # first moment of the mass, and the same for the free dofs: beam, box at the tip, collar
    moved = turned[grid.free] @ (system.M @ a)
    moved += sum(turned[item.dof] * (item.on_acceleration @ a) for item in system.reactions.values())
    first_moment = 0.5 * BEAM.mass * BEAM.length + 0.02 * BEAM.length + 0.01 * 0.13
    exact = moved + first_moment * (base + 9.81) - (forces[0] * 0.3 - forces[1] * 0.2)
    largest = np.abs(system.K @ u).max()
    assert found == pytest.approx(exact, abs=1e-9 * largest)


@pytest.mark.parametrize("supports", SUPPORTS)
def test_reduced_to_all_modes_the_reactions_are_the_same(supports):
    structure = replace(CANTILEVER, supports=SUPPORTS[supports])
    system = fi.assemble(structure, elements=7)
    small = fi.reduce(system, modes=system.dofs)
    phi = small.expansion[fi.fem.discretise(structure, elements=7).free]
    rng = np.random.default_rng(5)
    q, p, b = rng.normal(size=(3, system.dofs))
    forces = rng.normal(size=2)
    for name in system.reactions:
        one = read(system, name, phi @ q, phi @ p, phi @ b, 0.3, forces)
        assert read(small, name, q, p, b, 0.3, forces) == pytest.approx(one, rel=1e-10)


def test_a_force_on_a_support_is_all_its_own():
    system = fi.assemble(CANTILEVER, elements=6)
    np.testing.assert_array_equal(system.held_shares("root"), [1.0, 0.0])
    np.testing.assert_array_equal(system.held_shares("tip"), [0.0, 0.0])
    np.testing.assert_array_equal(fi.without_impactors(system).contact_shares, np.zeros((2, 1)))


def test_reactions_follow_a_replaced_damping_or_are_not_known():
    undamped = fi.assemble(replace(CANTILEVER, damping=None), elements=6)
    damped = fi.assemble(CANTILEVER, elements=6)
    again = replace(undamped, C=damped.C, rayleigh=damped.rayleigh)
    for name, item in damped.reactions.items():
        np.testing.assert_array_equal(again.reactions[name].on_velocity, item.on_velocity)
        assert np.any(item.on_velocity)
    assert replace(damped, rayleigh=None).reactions == {}


def test_a_replaced_constant_load_acts_on_the_free_dofs_alone():
    system = fi.assemble(CANTILEVER, elements=6)
    assert system.reactions["root.force"].constant < 0.0
    assert replace(system, constant_load=None).reactions["root.force"].constant == 0.0
    kept = replace(system, contacts=())
    assert kept.reactions["root.force"].constant == system.reactions["root.force"].constant


def test_both_sides_of_a_section_jump_are_read():
    system = fi.assemble(fi.Structure(beam=STEPPED), elements=9)
    u = solve_stiffness(system, system.point_row("tip"))
    left, right = (system.section_at(0.1, side) for side in ("left", "right"))
    assert (left.region, right.region) == ("thick", "thin")
    assert left.half_height == pytest.approx(1e-3, rel=1e-14)
    assert right.young_modulus == 210e9
    for side, section in (("left", left), ("right", right)):
        curvature = float(system.curvature_rows([0.1], side)[0] @ u)
        # a unit force 0.2 m away: one moment, two curvatures
        assert section.bending_stiffness * curvature == pytest.approx(0.2, rel=1e-9)
        assert float(system.shear_rows([0.1], side)[0] @ u) == pytest.approx(-1.0, rel=1e-8)
    np.testing.assert_allclose(system.curvature_rows([0.3], "left") @ u, 0.0, atol=1e-9)


def test_moments_of_a_bending_beam_converge_with_the_second_order_and_shear_with_the_first():
    # a uniform static load q: M = q (L - x)^2/2 and V = -q (L - x), off the elements' middles and nodes
    load, x = 3.0, np.array([0.15])
    errors = []
    for elements in (20, 40, 80):
        system = fi.assemble(replace(CANTILEVER, masses=(), impactors=(), stops=(), damping=None), elements=elements)
        u = solve_stiffness(system, load / BEAM.segments[0].mass_per_length * system.base_load)
        at = x + 0.1 * BEAM.length / elements
        moment = system.section_at("mid").bending_stiffness * (system.curvature_rows(at) @ u)
        shear = system.shear_rows(at) @ u
        errors.append([moment[0] - load * (0.3 - at[0]) ** 2 / 2, shear[0] + load * (0.3 - at[0])])
    orders = np.log2(np.abs(np.array(errors[:-1]) / np.array(errors[1:])))
    # a node and a share of its element: the leading term alone is left
    np.testing.assert_allclose(orders, [[2.0, 1.0]] * 2, atol=0.1)


def test_a_system_by_matrices_has_neither_sections_nor_reactions():
    system = fi.System.from_matrices([[1.0]], [[0.1]], [[40.0]], points={"p": [1.0]})
    assert system.reactions == {}
    with pytest.raises(fi.InputError, match="sections: are not known"):
        system.section_at(0.1)
