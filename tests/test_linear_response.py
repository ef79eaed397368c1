"""The structure without balls: closed-form responses and the known errors of Newmark's method."""

import numpy as np
import pytest

import femimpact as fi


@pytest.fixture(scope="module")
def beam_only(reference):
    """The reference beam with 10 % damping, without its ball, on 6 elements: 12 dofs."""
    structure = fi.Structure(reference.beam, reference.masses, damping=fi.Rayleigh(ratio=0.1, modes=(1, 2)))
    return fi.assemble(structure, elements=6)


@pytest.fixture(scope="module")
def one_mode(reference):
    return fi.reduce(fi.without_impactors(fi.assemble(reference, elements=10)), modes=1)


def exact_phasor(system, base, row):
    """U of u(t) = Im(U exp(i w t)), from (K - w^2 M + i w C) U = w^2 ub base_load."""
    w = base.omega
    matrix = (system.K - w**2 * system.M + 1j * w * system.C).toarray()
    return row @ np.linalg.solve(matrix, w**2 * base.amplitude * system.base_load)


def measured_phasor(response, name, frequency):
    """Least squares of U on sin and cos over the samples kept."""
    angle = 2 * np.pi * frequency * response.time
    in_phase, quadrature = np.linalg.lstsq(np.column_stack([np.sin(angle), np.cos(angle)]), response[name])[0]
    return in_phase + 1j * quadrature


def steady_run(system, base, dt, channels=("tip", "mid", 0.1)):
    # after 6 s the transient has fallen by exp(-0.1 * 33.3 * 6) = 2e-9
    return fi.integrate(system, base, fi.Newmark(dt), 8.0, fi.Recorder(channels=channels, every=10, start=6.0))


@pytest.mark.parametrize("modal", [True, False])
@pytest.mark.parametrize("frequency", [2.0, 5.2, 7.0])
def test_steady_response_is_the_closed_form_one(beam_only, modal, frequency):
    system = fi.reduce(beam_only, modes=12) if modal else beam_only
    base = fi.Sine(amplitude=0.2e-3, frequency=frequency)
    response = steady_run(system, base, dt=2.5e-5)
    for name, at in (("tip", "tip"), ("mid", "mid"), ("0.1", 0.1)):
        exact = exact_phasor(beam_only, base, beam_only.point_row(at))
        # Newmark takes w^2 for w^2 (1 + (w dt)^2/6); at resonance 1/(2 0.1) multiplies that: 5.6e-7
        assert abs(measured_phasor(response, name, frequency) - exact) < 1e-6 * abs(exact)


@pytest.mark.parametrize("ball", [False, True])
def test_physical_space_equals_the_space_of_all_modes(reference, ball):
    system = fi.assemble(reference, elements=8)
    start = fi.State(ball_velocity=[0.1]) if ball else None
    system = system if ball else fi.without_impactors(system)
    modal = fi.reduce(system, modes=system.dofs)
    base, method = fi.Sine(amplitude=0.2e-3, frequency=5.0), fi.Newmark(1e-4)
    channels = ("tip", "mid", "tip.velocity", *(("ball", "contact_force") if ball else ()))
    runs = [
        fi.integrate(used, base, method, 0.1, fi.Recorder(channels=channels), initial=start) for used in (system, modal)
    ]
    if ball:
        assert len(runs[0].impacts) == len(runs[1].impacts) == 1
    for name in channels:
        scale = np.max(np.abs(runs[0][name]))
        # K's condition number 1e8 leaves 8 digits of a solve; 1000 steps and one impact do not blow it up
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0, atol=1e-7 * scale)


def test_absolute_motion_is_the_relative_one_plus_the_bases(one_mode):
    base = fi.Sine(amplitude=0.2e-3, frequency=5.0, phase=0.7)
    response = fi.integrate(one_mode, base, fi.Newmark(1e-3), 1.0, fi.Recorder(channels=("tip", "tip.velocity")))
    angle = 2 * np.pi * 5.0 * response.time + 0.7
    # rounding of one sum, near 1e-3 m and 0.01 m/s
    np.testing.assert_allclose(response.absolute("tip") - response["tip"], 0.2e-3 * np.sin(angle), rtol=0, atol=1e-17)
    velocity = response.absolute("tip.velocity") - response["tip.velocity"]
    np.testing.assert_allclose(velocity, 0.2e-3 * 10 * np.pi * np.cos(angle), rtol=0, atol=1e-16)
