"""Damping mode by mode: the ratios that were given, exactly, and what a damping is computed from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.3, width=0.02, thickness=1.5e-3, young_modulus=70e9, density=2700.0)
RATIOS = (0.02, 0.004, 0.03)
STRUCTURE = fi.Structure(
    beam=BEAM, masses=[fi.PointMass("box", "tip", 0.02, 1e-6)], damping=fi.ModalDamping(RATIOS)
)  # fmt: skip


@pytest.mark.parametrize("elements", [6, 50], ids=["dense modes", "shift-invert modes"])
def test_the_given_modes_have_their_ratios_and_higher_ones_rise_with_frequency(elements):
    system = fi.assemble(STRUCTURE, elements=elements)
    modes = fi.solve_modes(system, 6)
    # rounding of the modes, which are orthogonal to 1e-9
    np.testing.assert_allclose(modes.damping_ratio[:3], RATIOS, rtol=1e-8)
    rising = RATIOS[-1] * modes.natural_frequency[3:] / modes.natural_frequency[2]
    np.testing.assert_allclose(modes.damping_ratio[3:], rising, rtol=1e-8)
    small = fi.reduce(system, modes=5)
    omega = 2.0 * math.pi * modes.natural_frequency[:5]
    np.testing.assert_allclose(small.C.diagonal(), 2.0 * modes.damping_ratio[:5] * omega, rtol=1e-8)


def test_free_decay_has_the_logarithmic_decrement_of_the_ratio():
    # one mode alone: after a period the deflection is exp(-2 pi zeta/sqrt(1 - zeta^2)) times what it was
    system = fi.reduce(fi.assemble(replace(STRUCTURE, damping=fi.ModalDamping(0.02)), elements=8), modes=1)
    period = 1.0 / (system.first_frequency * math.sqrt(1.0 - 0.02**2))
    start = fi.State(displacement=[1e-3])
    run = fi.integrate(
        system, fi.Sine(0.0, 1.0 / period), fi.EventDriven(), 4.0 * period, fi.Recorder(("tip",)), initial=start
    )  # fmt: skip
    decay = np.exp(-8.0 * math.pi * 0.02 / math.sqrt(1.0 - 0.02**2))
    # closed form at the last sample, which is where the whole periods end but for rounding of the grid
    assert run.time[-1] == pytest.approx(4.0 * period, rel=1e-3)
    assert np.interp(4.0 * period, run.time, run["tip"]) / run["tip"][0] == pytest.approx(decay, rel=1e-3)


def test_with_the_ratios_of_rayleigh_at_all_modes_it_is_rayleighs_matrix():
    rayleigh = fi.assemble(replace(STRUCTURE, damping=fi.Rayleigh((0.02, 0.03), modes=(1, 3))), elements=4)
    ratios = tuple(fi.solve_modes(rayleigh, rayleigh.dofs).damping_ratio)
    # the last modes of a coarse mesh may be overcritical, which a ratio given by a user may not
    assert max(ratios) < 1.0
    modal = fi.system.with_damping(rayleigh, fi.ModalDamping(ratios))
    exact = rayleigh.C.toarray()
    np.testing.assert_allclose(modal.C.toarray(), exact, atol=1e-10 * np.abs(exact).max())
    assert modal.rayleigh is None


def test_reactions_balance_the_forces_of_modal_damping():
    system = fi.assemble(STRUCTURE, elements=6)
    rng = np.random.default_rng(4)
    u, v = rng.normal(size=(2, system.dofs))
    a = np.linalg.solve(system.M.toarray(), -system.C @ v - system.K @ u)
    modes = fi.solve_modes(system, 3)
    item = system.reactions["root.force"]
    found = float(item.on_acceleration @ a + item.on_velocity @ v + item.on_displacement @ u)
    # beta K has no resultant; that of a mode's damping is its participation times its modal force
    omega = 2.0 * math.pi * modes.natural_frequency
    size = 2.0 * np.array(RATIOS) * omega - 2.0 * RATIOS[-1] / omega[-1] * omega**2
    damping = modes.participation_factor @ (size * (modes.vectors.T @ (system.M @ v)))
    assert found == pytest.approx(float(system.base_load @ a) + damping, abs=1e-9 * np.abs(system.K @ u).max())


def test_a_damping_is_computed_anew_for_the_modes_of_the_system_as_it_is():
    system = fi.assemble(STRUCTURE, elements=8)
    tip = np.zeros((18, 18))
    tip[-2, -2] = 300.0
    stiffer = fi.system.add_terms(system, stiffness=tip)
    assert abs(fi.solve_modes(stiffer, 1).damping_ratio[0] / RATIOS[0] - 1.0) > 0.1
    again = fi.system.with_damping(stiffer, STRUCTURE.damping)
    np.testing.assert_allclose(fi.solve_modes(again, 3).damping_ratio, RATIOS, rtol=1e-8)
    assert fi.reduce(again, modes=4).dofs == 4
    rayleigh = fi.system.with_damping(stiffer, fi.Rayleigh((0.01, 0.02), modes=(1, 2)))
    np.testing.assert_allclose(fi.solve_modes(rayleigh, 2).damping_ratio, (0.01, 0.02), rtol=1e-9)
    undamped = fi.system.with_damping(rayleigh, None)
    assert undamped.C.nnz == 0
    assert undamped.rayleigh == (0.0, 0.0)
    assert not np.any(undamped.reactions["root.force"].on_velocity)


def test_a_replaced_damping_is_that_of_the_assembled_structure():
    for damping in (fi.Rayleigh(0.01, modes=(1, 2)), fi.ModalDamping((0.01, 0.02))):
        one = fi.assemble(replace(STRUCTURE, damping=damping), elements=6)
        other = fi.system.with_damping(fi.assemble(replace(STRUCTURE, damping=None), elements=6), damping)
        np.testing.assert_array_equal(one.C.toarray(), other.C.toarray())
        assert one.rayleigh == other.rayleigh
