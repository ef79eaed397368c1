"""Static correction: what it repairs, what is left out without it, and what a reduced system says of itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, cantilever

import femimpact as fi

SOFT = fi.KelvinVoigt(stiffness=40.0, restitution=0.6)

STEEL = fi.KelvinVoigt(stiffness=1e6, restitution=0.6)


def static_flexibility(system):
    return np.array([np.sum(pair.direction**2 / system.K.diagonal()) for pair in system.contacts])


@pytest.mark.parametrize(("places", "more"), [(("tip",), 1), (("tip", "tip", 0.1), 2), (("root",), 0), ((), 0)])
def test_the_corrected_system_is_diagonal_and_keeps_its_modes(places, more):
    full = cantilever(places=places)
    plain, corrected = fi.reduce(full, 4), fi.reduce(full, 4, static_correction=True)
    assert corrected.dofs == 4 + more
    assert corrected.is_diagonal
    for name in ("M", "C", "K"):
        np.testing.assert_array_equal(getattr(corrected, name).diagonal()[:4], getattr(plain, name).diagonal())
    np.testing.assert_allclose(corrected.base_load[:4], plain.base_load, rtol=1e-14)
    # attachment vectors lie in the span of the modes left out, so none is slower than the first of those
    assert np.all(corrected.K.diagonal()[4:] >= (2 * math.pi * fi.solve_modes(full, 5).natural_frequency[4]) ** 2)
    # the basis, read back through its expansion, is what the diagonals say: no coupling hides behind them
    free = full.expansion.toarray()
    basis = free.T @ corrected.expansion
    bent = full.stiffness_factor @ basis
    # rounding of K^-1 b through the stiffness factor
    np.testing.assert_allclose(basis.T @ (full.M @ basis), np.eye(4 + more), atol=1e-10)
    scale = np.sqrt(corrected.K.diagonal())
    np.testing.assert_allclose(bent.T @ bent / np.outer(scale, scale), np.eye(4 + more), atol=1e-9)
    alpha, beta = full.rayleigh
    np.testing.assert_allclose(corrected.C.diagonal(), alpha + beta * corrected.K.diagonal(), rtol=1e-12)


def test_a_slow_force_bends_the_corrected_system_as_statics_say():
    full = cantilever(places=(0.1,), damping=0.05)
    push = fi.PointForce(0.1, fi.Sine(1e-3, 0.01, math.pi / 2))
    exact = 1e-3 * full.contacts[0].flexibility
    deflection = {}
    for corrected in (False, True):
        system = fi.without_impactors(fi.reduce(full, 1, static_correction=corrected))
        run = fi.integrate(system, push, fi.EventDriven(), 100.0, fi.Recorder((0.1,)))
        deflection[corrected] = run[0.1][-1]
    # (f/f1)^2 = 4e-6 of dynamics is left
    assert deflection[True] == pytest.approx(exact, rel=1e-5)
    # one mode alone misses the share of the others
    assert deflection[False] < 0.9 * exact


def test_all_modes_leave_nothing_to_correct():
    full = cantilever(elements=5)
    assert fi.reduce(full, full.dofs, static_correction=True).dofs == full.dofs


def test_notes_name_both_frequencies_of_a_short_contact():
    system = fi.reduce(cantilever(STEEL), 4)
    highest = math.sqrt(system.K.diagonal().max()) / (2 * math.pi)
    contact = 1.0 / system.contacts[0].parameters.contact_time
    assert highest < contact
    first, last = fi.system.truncation_notes(system)
    assert f"{highest:.4g} Hz" in first
    assert f"{contact:.4g} Hz" in first
    assert last.startswith("4 modes kept: the peak force")


def test_notes_name_both_flexibilities():
    full = cantilever(SOFT, places=(0.1,))
    system = fi.reduce(full, 1)
    missing = [note for note in fi.system.truncation_notes(system) if "m/N" in note]
    assert len(missing) == 1
    assert f"{static_flexibility(system)[0]:.4g} m/N" in missing[0]
    assert f"{full.contacts[0].flexibility:.4g} m/N" in missing[0]
    corrected = fi.system.truncation_notes(fi.reduce(full, 1, static_correction=True))
    assert not any("m/N" in note for note in corrected)


def test_a_rigid_contact_has_one_note_with_the_modes_and_the_mass_that_is_felt():
    system = fi.reduce(cantilever(places=("tip", "tip")), 6)
    (note,) = fi.system.truncation_notes(system)
    assert note.startswith("6 modes kept")
    felt = 1.0 / float(system.contacts[0].direction @ system.contacts[0].direction)
    assert f"ball 0 {felt:.4g} kg, ball 1 {felt:.4g} kg" in note


def test_nothing_is_noted_where_nothing_is_cut():
    assert fi.system.truncation_notes(fi.reduce(cantilever(SOFT), 4)) == ()
    assert fi.system.truncation_notes(cantilever()) == ()
    assert fi.system.truncation_notes(fi.reduce(cantilever(places=()), 2)) == ()
    # one mass on one spring is diagonal, and whole
    oscillator = fi.System.from_matrices(
        [[1.0]], [[0.1]], [[1.0]], points={"mass": [1.0]}, impactors=[fi.Impactor("ball", "mass", 0.1, 1.0, STEEL)]
    )
    assert fi.system.truncation_notes(oscillator) == ()


def test_of_all_modes_nothing_is_left_out_and_nothing_said():
    stop = fi.Stop("wall", "p", (1e-3, math.inf), fi.Rigid(0.7))
    one = fi.System.from_matrices([[1.0]], [[0.1]], [[100.0]], points={"p": [1.0]}, stops=[stop])
    assert fi.system.truncation_notes(fi.reduce(one, 1)) == ()
    beam = fi.assemble(replace(REFERENCE, stops=(replace(stop, at="tip"),), impactors=()), 2)
    assert fi.system.truncation_notes(fi.reduce(beam, beam.dofs)) == ()
    assert len(fi.system.truncation_notes(fi.reduce(beam, beam.dofs - 1))) == 1
