"""Bodies: a centre beside the place, and their names as places."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

import femimpact as fi
from femimpact.system.modes import solve_stiffness

LENGTH = 0.3
BEAM = fi.Beam.uniform(length=LENGTH, width=0.02, thickness=1.5e-3, young_modulus=70e9, density=2700.0)
EI, RHO_A = BEAM.segments[0].bending_stiffness, BEAM.segments[0].mass_per_length
LAW = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)


def exact_frequencies(mass, inertia, offset, count):
    """Of a cantilever with a rigid body at its tip, the body's centre beyond it by the offset.

    w = A (cosh kx - cos kx) + B (sinh kx - sin kx); the tip's shear and moment move the body:
    EI w''' = -omega^2 m (w + e w'), EI w'' = omega^2 (m e w + (J + m e^2) w').
    """

    def determinant(z):
        k = z / LENGTH
        square = k**4 * EI / RHO_A
        ch, sh, c, s = math.cosh(z), math.sinh(z), math.cos(z), math.sin(z)
        rows = []
        for w, d1, d2, d3 in ((ch - c, sh + s, ch + c, sh - s), (sh - s, ch - c, sh + s, ch + c)):
            d1, d2, d3 = k * d1, k**2 * d2, k**3 * d3
            shear = EI * d3 + square * mass * (w + offset * d1)
            moment = EI * d2 - square * (mass * offset * w + (inertia + mass * offset**2) * d1)
            rows.append((shear, moment))
        return (rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]) / ch**2

    grid = np.linspace(0.05, 12.0, 4000)
    values = [determinant(z) for z in grid]
    roots = [
        scipy.optimize.brentq(determinant, a, b, xtol=1e-13)
        for a, b, one, other in zip(grid, grid[1:], values, values[1:], strict=False)
        if one * other < 0.0
    ]
    return (np.array(roots[:count]) / LENGTH) ** 2 * math.sqrt(EI / RHO_A) / (2.0 * math.pi)


@pytest.mark.parametrize("offset", [0.0, 0.02, -0.015])
def test_a_tip_body_with_its_centre_beside_the_tip_has_the_exact_frequencies(offset):
    mass, inertia = 0.03, 4e-6
    body = fi.PointMass("box", "tip", mass, inertia, offset)
    system = fi.assemble(fi.Structure(beam=BEAM, masses=[body]), elements=40)
    exact = exact_frequencies(mass, inertia, offset, 4)
    # (k h)^4/1440 of a frequency, kL up to 12: 6e-6
    np.testing.assert_allclose(fi.solve_modes(system, 4).natural_frequency, exact, rtol=6e-6)


def test_the_weight_of_an_offset_body_turns_the_tip():
    mass, offset = 0.05, 0.04
    bodies = [fi.PointMass("box", "tip", mass, offset=offset)]
    gravity = -9.81
    structure = fi.Structure(beam=BEAM, masses=bodies, gravity=gravity)
    system = fi.assemble(structure, elements=6)
    u = solve_stiffness(system, system.constant_load)
    force = mass * gravity
    own = RHO_A * gravity * LENGTH**4 / (8.0 * EI)
    exact = own + force * LENGTH**3 / (3.0 * EI) + force * offset * LENGTH**2 / (2.0 * EI)
    # the consistent load of a uniform force is exact at nodes
    assert float(system.point_row("tip") @ u) == pytest.approx(exact, rel=1e-10)
    # the root carries the weight at its distance
    reaction = system.reactions["root.moment"]
    moment = float(reaction.on_displacement @ u) - reaction.constant
    assert moment == pytest.approx(-gravity * (mass * (LENGTH + offset) + 0.5 * BEAM.mass * LENGTH), rel=1e-9)
    assert system.total_mass == pytest.approx(mass + BEAM.mass, rel=1e-12)


def test_a_bodys_name_is_its_place_for_everything():
    by_number = fi.Structure(
        beam=BEAM,
        masses=[fi.PointMass("midbox", 0.17, 0.02), fi.PointMass("lid", 0.17, 0.001)],
        impactors=[fi.Impactor("ball", 0.17, 3e-3, 1e-3, LAW)],
        stops=[fi.Stop("wall", 0.17, 2e-3, LAW)],
        springs=[fi.Spring("spring", 0.17, 20.0)],
        dashpots=[fi.Dashpot("dashpot", 0.17, 0.1, to="tip")],
        supports=[fi.Support("clamped", "root")],
    )
    by_name = replace(
        by_number,
        masses=[by_number.masses[0], replace(by_number.masses[1], at="midbox")],
        **{
            key: [replace(getattr(by_number, key)[0], at="midbox")]
            for key in ("impactors", "stops", "springs", "dashpots")
        },
    )
    one, other = (fi.assemble(structure, elements=7) for structure in (by_number, by_name))
    for name in ("M", "C", "K"):
        np.testing.assert_array_equal(getattr(one, name).toarray(), getattr(other, name).toarray())
    for pair, same in zip(one.contacts, other.contacts, strict=True):
        np.testing.assert_array_equal(pair.direction, same.direction)
    np.testing.assert_array_equal(other.point_row("midbox"), other.point_row(0.17))
    glued = fi.assemble(fi.structure.glue_impactors(by_name), elements=7)
    assert glued.total_mass == pytest.approx(one.total_mass + 3e-3, rel=1e-12)
    held = replace(by_name, supports=[fi.Support("pinned", "root"), fi.Support("pinned", "midbox")], springs=())
    assert set(fi.assemble(held, elements=7).reactions) == {"root.force", "midbox.force"}
