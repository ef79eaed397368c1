"""A run that is not finite, or whose energy does not add up, is stopped or warned of, alone and in a sweep."""

import dataclasses

import numpy as np
import pytest
import scipy.sparse as sparse
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact.response.energy import BALANCED, residual_warnings
from femimpact.units import number_text

pytestmark = pytest.mark.impacts


def oscillator(law, damping=0.02, stiffness=1.0):
    return fi.System.from_matrices(
        [[1.0]], [[damping]], [[stiffness]], points={"a": [1.0]},
        impactors=[fi.Impactor("ball", at="a", mass=0.1, gap=1.0, contact=law)],
    )  # fmt: skip


COMPLIANT = fi.KelvinVoigt(stiffness=50.0, restitution=0.6)


def test_a_sweep_whose_law_makes_energy_says_so_with_its_numbers():
    """The switching spring as printed is an energy source at any step: the audit shows it."""
    spring = fi.contact.SwitchingSpring(free_stiffness=0.1, stiffness=50.0)
    system = fi.System.from_matrices(
        [[1.0]], [[0.02]], [[1.0]], points={"a": [1.0]},
        impactors=[fi.Impactor("ball", at="a", mass=0.1, gap=0.1, contact=spring)],
    )  # fmt: skip
    curve = fi.frequency_sweep(
        system, 0.5, [0.14, 0.16], fi.Newmark(dt=0.02, allow_coarse_step=True), cycles=40, at="a"
    )
    off = curve.energy_residual > BALANCED
    assert np.any(off)
    said = [warning for warning in curve.warnings if "energy residual" in warning]
    assert len(said) == 1
    assert f"{off.sum()} of 2" in said[0]
    assert number_text(curve.energy_residual.max(), 2) in said[0]


def test_large_amplitude_alone_is_no_fault():
    """An undamped resonance grows without end, rightly: its ledger closes."""
    system = dataclasses.replace(oscillator(COMPLIANT, damping=0.0), contacts=())
    resonance = 1.0 / (2.0 * np.pi)
    method = fi.Newmark(dt=0.05, divergence_limit=1e12)
    run = fi.integrate(system, fi.Sine(1e-3, resonance), method, 4000.0, fi.Recorder(channels=("a",), every=10))
    # u = (A/2) w t at resonance; the step detunes it by (w dt)^2/12, which it does not feel so soon
    assert np.abs(run["a"]).max() > 100 * 1e-3
    assert run.energy.residual < BALANCED
    assert not any("energy" in warning for warning in run.warnings)
    with pytest.raises(fi.InputError, match="natural frequency of an undamped mode"):
        fi.integrate(system, fi.Sine(1e-3, resonance), fi.EventDriven(), 10.0)


@pytest.mark.parametrize("law", [COMPLIANT, fi.Rigid(restitution=0.7)])
def test_an_event_driven_run_that_is_not_finite_is_stopped(law):
    """A start at 1e200 m has an energy beyond the largest number."""
    system = oscillator(law)
    start = fi.State(displacement=[1e200], ball_displacement=[1e200])
    with np.errstate(all="ignore"), pytest.raises(fi.DivergenceError, match=r"not finite|do not resolve|residual"):
        fi.integrate(system, fi.Sine(0.5, 0.15), fi.EventDriven(), 50.0, initial=start)


def test_a_sweep_without_fault_says_nothing_of_energy():
    curve = fi.frequency_sweep(oscillator(COMPLIANT), 0.5, [0.14, 0.15], fi.EventDriven(), cycles=60, at="a")
    assert np.all(curve.energy_residual < 1e-9)
    assert not any("energy" in warning for warning in curve.warnings)


def test_a_case_whose_residual_is_within_its_bound_is_not_named():
    f, residual = np.array([1.0, 2.0, 3.0]), np.array([0.0, 1e-3, 0.5])
    assert residual_warnings(f, residual, np.full(3, 1.0)) == []
    (warning,) = residual_warnings(f, residual, np.array([1e-2, 1e-2, 1e-2]))
    assert "1 of 3 frequencies (3 to 3 Hz)" in warning
    assert "0.5" in warning
    # an energy beyond all numbers is no energy that adds up
    (warning,) = residual_warnings(f, np.array([0.0, np.nan, 0.5]), np.full(3, 1e-2))
    assert "2 of 3 frequencies (2 to 3 Hz), at most nan" in warning


def test_a_stepped_run_whose_energies_are_beyond_all_numbers_says_so():
    with np.errstate(all="ignore"):
        base, method = fi.Sine(1e155, 0.15), fi.Newmark(dt=0.01)
        run = fi.integrate(oscillator(COMPLIANT), base, method, 30.0, fi.Recorder(channels=("a",)))
        curve = fi.frequency_sweep(oscillator(COMPLIANT), 1e155, [0.15], method, cycles=5, at="a")
    assert any("energy residual" in warning for warning in run.warnings)
    assert any("energy residual" in warning for warning in curve.warnings)


@pytest.mark.parametrize("contact_time", [2e-4, 1e-5])
def test_stiff_walls_close_their_ledger_within_the_rounding_of_their_gap(contact_time):
    law = fi.KelvinVoigt(restitution=0.6, contact_time=contact_time)
    system = reduced(with_ball(REFERENCE, contact=law), 8, 10)
    run = fi.integrate(
        system, fi.Sine(0.2037e-3, 5.1), fi.EventDriven(), 20.0, fi.Recorder(channels=("tip",), every=64)
    )
    assert len(run.impacts) > 50
    # 16 units in the last place of 4 mm, as a share of a penetration v T_c/pi at 0.2 m/s
    assert run.energy.residual < 16 * 2.2e-16 * 4e-3 / (0.2 * contact_time / np.pi) * 10
    assert run.warnings == ()
    curve = fi.frequency_sweep(system, 0.2037e-3, [4.9, 5.1], fi.EventDriven(), duration=20.0)
    assert not any("energy" in warning for warning in curve.warnings)


@pytest.mark.parametrize("contact", [None, COMPLIANT])
def test_the_ledger_of_a_sweep_changes_no_bit_of_it(contact):
    system = oscillator(COMPLIANT)
    system = system if contact else dataclasses.replace(system, contacts=())
    one, other = (
        fi.frequency_sweep(system, 0.5, [0.12, 0.15, 0.2], fi.EventDriven(), cycles=30, at="a", ledger=ledger)
        for ledger in (True, False)
    )
    for name in ("peak", "rms", "first_harmonic", "phase"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert np.all(one.energy_residual < 1e-10)


def test_a_badly_scaled_system_is_not_answered_with_nonsense():
    """Frequencies 12 decades apart: either the ledger closes or the run says what is wrong."""
    system = fi.System.from_matrices(
        sparse.diags_array([1.0, 1.0]), sparse.diags_array([1e-2, 1e-2]), sparse.diags_array([1.0, 1e24]),
        points={"a": [1.0, 1.0]},
        impactors=[fi.Impactor("ball", at="a", mass=0.1, gap=1.0, contact=COMPLIANT)],
    )  # fmt: skip
    try:
        run = fi.integrate(system, fi.Sine(0.5, 0.15), fi.EventDriven(), 40.0)
    except (fi.DivergenceError, fi.InputError):
        return
    assert run.energy.residual < BALANCED
    assert np.all(np.isfinite(run["a"]))
