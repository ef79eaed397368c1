"""Springs and dashpots at any place: what statics, rigid beams and exact determinants say of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi
from femimpact.system.modes import solve_stiffness

LENGTH = 0.4
BEAM = fi.Beam.uniform(length=LENGTH, width=0.02, thickness=1.2e-3, young_modulus=70e9, density=2700.0)
EI = BEAM.segments[0].bending_stiffness
RIGID = fi.Beam.uniform(length=LENGTH, width=0.02, thickness=0.3, young_modulus=210e9, density=1000.0)


UNSLENDER = pytest.mark.filterwarnings("ignore:beam.length:femimpact.errors.InputWarning")


def bending(x, force_at):
    """Deflection (m/N) of a cantilever at x under a unit force at a place, in closed form."""
    low, high = min(x, force_at), max(x, force_at)
    return low**2 * (3.0 * high - low) / (6.0 * EI)


@pytest.mark.parametrize("elements", [4, 5])
def test_a_spring_at_the_tip_is_the_closed_form_one(elements):
    stiffness = 40.0
    system = fi.assemble(
        fi.Structure(beam=BEAM, springs=[fi.Spring("support", "tip", stiffness)]), elements=elements
    )  # fmt: skip
    u = solve_stiffness(system, system.point_row("tip"))
    tip = 3.0 * EI / LENGTH**3
    # one over the sum of both; cubic elements are exact under forces at nodes
    assert float(system.point_row("tip") @ u) == pytest.approx(1.0 / (tip + stiffness), rel=1e-10)
    spring, root = system.reactions["support.force"], system.reactions["root.force"]
    assert float(spring.on_displacement @ u) == pytest.approx(-stiffness / (tip + stiffness), rel=1e-10)
    # the two hold the unit force
    assert float((spring.on_displacement + root.on_displacement) @ u) == pytest.approx(-1.0, rel=1e-9)


def test_a_spring_between_two_places_carries_what_the_two_places_part():
    stiffness, first, second = 300.0, 0.15, LENGTH
    structure = fi.Structure(beam=BEAM, springs=[fi.Spring("tie", first, stiffness, to="tip")])
    # a node where the spring is, so that statics are exact
    mesh = fi.fem.Mesh(np.array([0.0, 0.08, 0.15, 0.3, 0.4]))
    system = fi.assemble(structure, mesh=mesh)
    u = solve_stiffness(system, system.point_row("tip"))
    own = bending(first, first) + bending(second, second) - 2.0 * bending(first, second)
    pulled = (bending(second, second) - bending(first, second)) / (1.0 / stiffness + own)
    exact = bending(second, second) - pulled * (bending(second, second) - bending(first, second))
    assert float(system.point_row("tip") @ u) == pytest.approx(exact, rel=1e-9)
    # an inner force is no reaction
    assert set(system.reactions) == {"root.force", "root.moment"}
    assert float(system.reactions["root.force"].on_displacement @ u) == pytest.approx(-1.0, rel=1e-9)


def test_a_spring_stays_at_its_place_between_nodes():
    place = 0.137
    frequencies = []
    for elements in (5, 10, 20, 40, 80):
        structure = fi.Structure(beam=BEAM, springs=[fi.Spring("spring", place, 500.0)])
        mesh = fi.uniform_mesh(structure, elements)
        # no node is made for it
        assert mesh.elements == elements
        assert not np.any(np.isclose(mesh.nodes, place, rtol=1e-6))
        frequencies.append(fi.assemble(structure, mesh=mesh).first_frequency)
    fitted = fi.fem.Mesh(np.sort(np.append(np.linspace(0.0, LENGTH, 80), place)))
    exact = fi.assemble(structure, mesh=fitted).first_frequency
    errors = np.array(frequencies) / exact - 1.0
    # from above, for the trial functions are a subset; of third order, times where in its element the spring is, for
    # w has a jump of its third derivative there: 16^3 = 4096 from the first mesh to the last
    assert np.all(errors > 0.0)
    assert errors[-1] < errors[0] / 1000.0
    # at the nearest node it would be another frequency
    moved = fi.assemble(fi.Structure(beam=BEAM, springs=[fi.Spring("spring", 0.14, 500.0)]), elements=80)
    assert abs(moved.first_frequency / exact - 1.0) > 100.0 * errors[-1]


@UNSLENDER
def test_a_rigid_beam_on_two_springs_bounces_and_pitches():
    # w = a + b (x - L/2): m a'' = -(k1 + k2) a, I b'' = -(k1 + k2) (L/2)^2 b for equal springs at the ends
    stiffness = 200.0
    springs = [fi.Spring("left", "root", stiffness), fi.Spring("right", "tip", stiffness)]
    system = fi.assemble(fi.Structure(beam=RIGID, supports=(), springs=springs), elements=6)
    frequency = fi.solve_modes(system, 2).natural_frequency
    mass = RIGID.mass
    exact = np.sqrt([2.0 * stiffness / mass, 6.0 * stiffness / mass]) / (2.0 * math.pi)
    # of a beam that bends by a few 1e-9 of the springs
    np.testing.assert_allclose(frequency, exact, rtol=1e-7)
    assert set(system.reactions) == {"left.force", "right.force"}


@UNSLENDER
def test_a_dashpot_to_the_base_damps_a_rigid_beam_as_one_mass():
    # equal springs and equal dashpots at both ends: zeta = c/(2 sqrt(k m)) of the bounce, sqrt(3) times it of the pitch
    stiffness, damping = 200.0, 0.4
    structure = fi.Structure(
        beam=RIGID,
        supports=(),
        springs=[fi.Spring("k1", "root", stiffness), fi.Spring("k2", "tip", stiffness)],
        dashpots=[fi.Dashpot("c1", "root", damping), fi.Dashpot("c2", "tip", damping)],
    )
    system = fi.assemble(structure, elements=4)
    ratio = 2.0 * damping / (2.0 * math.sqrt(2.0 * stiffness * RIGID.mass))
    np.testing.assert_allclose(fi.solve_modes(system, 2).damping_ratio, [ratio, math.sqrt(3.0) * ratio], rtol=1e-6)
    rng = np.random.default_rng(1)
    v = rng.normal(size=system.dofs)
    rigid = system.rigid_translation
    found = sum(float(item.on_velocity @ v) for item in system.reactions.values())
    # all the damping acts between beam and base
    assert found == pytest.approx(-float(rigid @ (system.C @ v)), rel=1e-12)


def test_a_dashpot_between_two_places_leaves_a_rigid_translation_alone():
    structure = fi.Structure(
        beam=BEAM,
        supports=(),
        springs=[fi.Spring("k1", "root", 10.0), fi.Spring("k2", "tip", 10.0)],
        dashpots=[fi.Dashpot("across", 0.05, 2.0, to=0.33)],
    )
    system = fi.assemble(structure, elements=7)
    v = system.rigid_translation
    assert np.abs(system.C @ v).max() <= 1e-14 * np.abs(system.C).max()
    # and of a rotation takes power by the square of the places' distance
    turned = np.column_stack([system.nodes, np.ones(system.nodes.size)]).ravel()
    assert float(turned @ (system.C @ turned)) == pytest.approx(2.0 * (0.33 - 0.05) ** 2, rel=1e-12)


def test_dashpots_stand_beside_rayleigh_damping_and_reactions_balance():
    damping = fi.Rayleigh(0.01, modes=(1, 2))
    structure = fi.Structure(
        beam=BEAM, damping=damping, springs=[fi.Spring("k", 0.2, 50.0)], dashpots=[fi.Dashpot("c", 0.031, 0.3)]
    )
    mesh = fi.fem.Mesh(np.linspace(0.0, LENGTH, 6))
    system = fi.assemble(structure, mesh=mesh)
    alpha = fi.assemble(replace(structure, dashpots=()), mesh=mesh).rayleigh[0]
    assert system.rayleigh is None
    rng = np.random.default_rng(2)
    u, v = rng.normal(size=(2, system.dofs))
    a = np.linalg.solve(system.M.toarray(), -system.C @ v - system.K @ u)
    forces = [item for item in system.reactions.values() if item.unit == "N"]
    assert len(forces) == 3
    found = sum(float(r.on_acceleration @ a + r.on_velocity @ v + r.on_displacement @ u) for r in forces)
    exact = float(system.base_load @ (a + alpha * v))
    assert found == pytest.approx(exact, abs=1e-9 * np.abs(system.K @ u).max())
