"""The structure without balls: closed-form responses and the known errors of Newmark's method."""

import math
from dataclasses import replace

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


def undamped(system):
    return replace(system, C=0.0 * system.C, rayleigh=(0.0, 0.0))


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


def test_the_error_falls_with_the_square_of_the_step(beam_only):
    base = fi.Sine(amplitude=0.2e-3, frequency=4.0)
    exact = exact_phasor(beam_only, base, beam_only.point_row("tip"))
    system = fi.reduce(beam_only, modes=12)
    steps = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    error = [abs(measured_phasor(steady_run(system, base, dt, ("tip",)), "tip", 4.0) - exact) for dt in steps]
    slope = np.polyfit(np.log(steps), np.log(error), 1)[0]
    # second order; the fourth-order term at w0 dt = 0.13 moves the fit by under a hundredth
    assert slope == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("steps_per_period", [20, 50, 100])
def test_free_vibration_is_slowed_down_by_pi_squared_over_three(one_mode, steps_per_period):
    period = 1 / one_mode.first_frequency
    dt = period / steps_per_period
    still = fi.Sine(amplitude=0.0, frequency=1.0)
    start = fi.State(displacement=[1e-3])
    u = fi.integrate(undamped(one_mode), still, fi.Newmark(dt), 40 * period, initial=start)["tip"]
    # an undamped discrete vibration obeys u[n+1] + u[n-1] = 2 cos(w dt) u[n] exactly
    turn = np.arccos(np.sum((u[2:] + u[:-2]) * u[1:-1]) / (2 * np.sum(u[1:-1] ** 2)))
    elongation = 2 * np.pi / (turn * steps_per_period) - 1
    # closed form of the average acceleration method: w dt = 2 atan(w0 dt/2); the recurrence keeps 11 digits or more
    assert turn == pytest.approx(2 * math.atan(math.pi / steps_per_period), rel=1e-10)
    # leading term; the next one is 0.27 (2 pi/n)^2/4 of it, 0.7 % at n = 20
    leading = math.pi**2 / 3 / steps_per_period**2
    assert elongation == pytest.approx(leading, rel=0.3 * (math.pi / steps_per_period) ** 2)


def test_an_undamped_vibration_keeps_its_energy(one_mode):
    still, start = fi.Sine(amplitude=0.0, frequency=1.0), fi.State(displacement=[1e-3], velocity=[0.02])
    response = fi.integrate(undamped(one_mode), still, fi.Newmark(2e-3), 20.0, initial=start)
    stored = response.energy.stored
    # 10 000 steps of rounding
    np.testing.assert_allclose(stored, stored[0], rtol=1e-11)


@pytest.mark.parametrize("ratio", [0.0029, 0.02])
def test_the_logarithmic_decrement_is_that_of_the_damping_ratio(reference, ratio):
    structure = fi.Structure(reference.beam, reference.masses, damping=fi.Rayleigh(ratio=ratio, modes=(1, 2)))
    system = fi.reduce(fi.assemble(structure, elements=10), modes=1)
    dt = 1 / (400 * system.first_frequency)
    still, start = fi.Sine(amplitude=0.0, frequency=1.0), fi.State(displacement=[1e-3])
    u = fi.integrate(system, still, fi.Newmark(dt), 31 / system.first_frequency, initial=start)["tip"]
    peaks = np.flatnonzero((u[1:-1] > u[:-2]) & (u[1:-1] > u[2:])) + 1
    assert peaks.size >= 30
    before, at, after = u[peaks - 1], u[peaks], u[peaks + 1]
    heights = at + (after - before) ** 2 / (8 * (2 * at - before - after))  # vertex of the parabola
    decrement = np.log(heights[0] / heights[29]) / 29
    # delta = 2 pi zeta/sqrt(1 - zeta^2); Newmark changes it by (w dt)^2/4 = 6e-5 of itself
    assert decrement == pytest.approx(2 * math.pi * ratio / math.sqrt(1 - ratio**2), rel=2e-4)


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


def test_the_base_is_consistent_with_itself():
    base, h = fi.Sine(amplitude=2e-3, frequency=3.0, phase=0.4), 1e-5
    t = np.linspace(0.0, 1.0, 50)
    # central differences: h^2 w^2/6 = 6e-9 of the amplitude, and rounding 1e-16/h
    velocity = (base.displacement(t + h) - base.displacement(t - h)) / (2 * h)
    np.testing.assert_allclose(base.velocity(t), velocity, rtol=0, atol=1e-8 * 2e-3 * base.omega)
    acceleration = (base.velocity(t + h) - base.velocity(t - h)) / (2 * h)
    np.testing.assert_allclose(base.acceleration(t), acceleration, rtol=0, atol=1e-8 * 2e-3 * base.omega**2)


def test_a_run_starts_with_the_phase_of_the_base(one_mode):
    base = fi.Sine(amplitude=0.2e-3, frequency=5.0, phase=0.9)
    dt = 1e-5
    u = fi.integrate(one_mode, base, fi.Newmark(dt), 3e-4)["tip"]
    t = dt * np.arange(u.size)
    gain = float(one_mode.point_row("tip")[0] * one_mode.base_load[0])
    # from rest: u = -gain ub''(0) t^2/2 + ...; the next term is w t/3/tan(0.9) = 3e-3 of it at 3e-4 s
    np.testing.assert_allclose(u, -gain * base.acceleration(0.0) * t**2 / 2, rtol=4e-3, atol=1e-20)


def test_a_conditionally_stable_method_is_refused_beyond_its_limit(beam_only):
    modal = fi.reduce(beam_only, modes=4)
    limit = 2 / math.sqrt(modal.K.diagonal().max())  # central differences: dt < 2/w
    base = fi.Sine(amplitude=1e-3, frequency=5.0)
    with pytest.raises(fi.InputError, match="conditionally stable"):
        fi.integrate(modal, base, fi.Newmark(1.01 * limit, beta=0.0), 0.5)
    bounded = fi.integrate(modal, base, fi.Newmark(0.95 * limit, beta=0.0), 0.5)
    # no more than the resonant amplitude 1/(2 zeta) with the participation 1.5 of a tip
    assert np.max(np.abs(bounded["tip"])) < 1e-3 * 1.5 / 0.2


def test_peaks_of_the_beam_alone_are_exact_between_samples(small):
    system = fi.without_impactors(small)
    amplitude, frequency = 0.2037e-3, np.linspace(4.9, 5.7, 9)
    curve = fi.frequency_sweep(system, amplitude, frequency, fi.EventDriven(), duration=90.0, window=10.0, ledger=False)
    # the closed form on a grid so fine that its largest value is the peak to (pi/5,000)^2/2 = 2e-7
    for f, peak in zip(frequency, curve.peak, strict=True):
        begin = np.ceil(80.0 * f) / f
        end = np.floor(90.0 * f + 1e-9) / f
        time = np.linspace(begin, end, int(5_000 * (end - begin) * f) + 1)
        w = np.zeros(time.size)
        row, omega = system.point_row("tip"), 2 * np.pi * f
        for m, c, k, load, r in zip(
            system.M.diagonal(), system.C.diagonal(), system.K.diagonal(), system.base_load, row, strict=True
        ):
            steady = load * omega**2 * amplitude / (k - omega**2 * m + 1j * omega * c)
            roots = np.roots([m, c, k])
            # at rest at t = 0
            weights = np.linalg.solve([[1, 1], roots], [-steady.imag, -(1j * omega * steady).imag])
            w += r * (np.imag(steady * np.exp(1j * omega * time)))
            w += r * np.real(weights[0] * np.exp(roots[0] * time) + weights[1] * np.exp(roots[1] * time))
        assert peak == pytest.approx(np.abs(w).max(), rel=1e-6)
