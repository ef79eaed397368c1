"""Stepped-sine sweeps: one case beside another is one case alone, and the linear curve is the closed form."""

from dataclasses import replace

import numpy as np
import pytest
from builders import reduced, with_ball

import femimpact as fi
from femimpact.sweep.curve import SWEEP_UNITS

pytestmark = pytest.mark.impacts

AMPLITUDE = 0.2037e-3


@pytest.fixture(scope="module")
def empty(small):
    return fi.without_impactors(small)


def columns(curve):
    return {name: getattr(curve, name) for name in ("frequency", *SWEEP_UNITS, "steadiness")}


def exact_amplitude(system, frequency, row):
    w = 2 * np.pi * frequency
    matrix = (system.K - w**2 * system.M + 1j * w * system.C).toarray()
    return row @ np.linalg.solve(matrix, w**2 * AMPLITUDE * system.base_load)


@pytest.mark.parametrize("count", [2, 7, 33])
@pytest.mark.parametrize("impactors", [True, False])
def test_the_number_of_threads_does_not_change_one_bit(small, empty, count, impactors):
    system = small if impactors else empty
    method, frequencies = fi.Newmark(1e-4), np.linspace(4.6, 5.7, count)
    one, two = (fi.frequency_sweep(system, AMPLITUDE, frequencies, method, cycles=24, threads=n) for n in (1, 2))
    if impactors:
        assert np.max(one.impacts_per_cycle) > 0
    for name, column in columns(one).items():
        equal_nan = column.dtype.kind == "f"
        assert np.array_equal(column, columns(two)[name], equal_nan=equal_nan), name


def test_a_case_gets_the_same_bits_whatever_runs_beside_it(small):
    method, start = fi.Newmark(1e-4), fi.State(ball_velocity=[0.1])
    alone = fi.frequency_sweep(small, AMPLITUDE, [5.1, 5.2], method, cycles=12, initial=start, threads=1)
    beside = fi.frequency_sweep(small, AMPLITUDE, [5.2, 3.9, 5.1, 6.1], method, cycles=12, initial=start, threads=1)
    assert np.all(alone.impacts_per_cycle > 0)
    for name, column in columns(alone).items():
        np.testing.assert_array_equal(column, columns(beside)[name][[2, 0]], err_msg=name)
    # one case is not laid out in packs
    single = fi.frequency_sweep(small, AMPLITUDE, [5.1], method, cycles=12, initial=start, threads=1)
    for name, column in columns(single).items():
        np.testing.assert_array_equal(column, columns(beside)[name][[2]], err_msg=name)


@pytest.mark.parametrize("frequencies", [[45.0, 45.0], [30.0, 45.0]])
def test_a_case_of_a_sweep_measures_the_impacts_of_its_own_dwell_only(bouncing, frequencies):
    # a fast case beside a slow one: the block runs on for the slow one, the fast one's measure must not.
    # Nine regular impacts between walls that hardly move: no chaos, and none of them near a window's edge
    amplitude, method, cycles, start = 1e-6, fi.Newmark(1e-4), 12, fi.State(ball_velocity=[0.3])
    curve = fi.frequency_sweep(bouncing, amplitude, frequencies, method, cycles=cycles, initial=start, threads=1)
    for i, frequency in enumerate(frequencies):
        steps = int(np.ceil(cycles / (frequency * method.dt)))
        run = fi.integrate(bouncing, fi.Sine(amplitude, frequency), method, steps * method.dt, initial=start)
        # an impact counts when it ends: 2 ms after it began
        begin = (cycles - cycles // 3) / frequency
        assert np.min(np.abs(run.impacts.time + 1e-3 - begin)) > 3e-3
        inside = run.impacts.time >= begin
        assert inside.sum() > 1
        # few regular impacts: only the order of sums differs
        expected = inside.sum() / (cycles // 3)
        # the window is rounded to steps: one of 889
        assert curve.impacts_per_cycle[i] == pytest.approx(expected, rel=3e-3), frequency
        assert curve.mean_approach_speed[i] == pytest.approx(np.mean(run.impacts.approach_speed[inside]), rel=1e-6)
        assert curve.peak_force[i] == pytest.approx(np.max(run.impacts.peak_force[inside]), rel=1e-6)
        force = run.impacts.impulse[inside].sum() * frequency / (cycles // 3)
        assert curve.cycle_mean_force[i] == pytest.approx(force, rel=3e-3)


def test_a_sweep_agrees_with_single_runs_without_a_ball(empty):
    method, cycles = fi.Newmark(5e-4), 60
    frequencies = np.array([4.7, 5.25, 5.3, 5.6])
    curve = fi.frequency_sweep(empty, AMPLITUDE, frequencies, method, cycles=cycles)
    for i, frequency in enumerate(frequencies):
        steps = int(np.ceil(cycles / (frequency * method.dt)))
        steady = fi.integrate(empty, fi.Sine(AMPLITUDE, float(frequency)), method, steps * method.dt).steady
        for name in ("peak", "rms", "first_harmonic", "phase"):
            # a linear run; the two loops sum in another order
            assert getattr(curve, name)[i] == pytest.approx(getattr(steady, name)[0], rel=1e-10), name
        assert curve.steadiness[i] == steady.steadiness[0]


def test_the_linear_curve_is_the_closed_form(reference):
    structure = replace(reference, impactors=(), damping=fi.Rayleigh(ratio=0.02, modes=(1, 2)))
    system = fi.reduce(fi.assemble(structure, elements=10), modes=4)
    # 120 cycles: the transient falls by exp(-0.02 * 2 pi * 80) = 4e-5 before the last third begins
    frequencies = np.linspace(4.5, 6.0, 16)
    dt = 1 / (1000 * 5.3)
    for at in ("tip", "mid"):
        curve = fi.frequency_sweep(system, AMPLITUDE, frequencies, fi.Newmark(dt), cycles=120, at=at)
        exact = np.array([exact_amplitude(system, f, system.point_row(at)) for f in frequencies])
        # Newmark shifts w by (w dt)^2/12 = 3e-6, through 1/(2 zeta) = 25 into 1e-4; the transient beats with 4e-5
        np.testing.assert_allclose(curve.first_harmonic, np.abs(exact), rtol=3e-4)
        # the largest sample misses the crest by (w dt)^2/8 = 5e-6 at most
        np.testing.assert_allclose(curve.peak, np.abs(exact), rtol=3e-4)
        np.testing.assert_allclose(curve.rms, np.abs(exact) / np.sqrt(2), rtol=3e-4)
        # base sin(wt): U = |U| exp(i phase)
        np.testing.assert_allclose(curve.phase, np.angle(exact), rtol=0, atol=3e-4)
        assert set(curve.steadiness) == {"periodic"}
        assert curve.peak_amplitude == np.max(curve.peak)
        assert curve.peak_frequency == frequencies[np.argmax(np.abs(exact))]
        # the fit of the computed curve gives the damping that was put in; higher modes bend the curve by under 1 %
        assert curve.damping.ratio == pytest.approx(0.02, rel=0.01)
        assert curve.damping.frequency == pytest.approx(system.first_frequency, rel=1e-3)


def test_a_sweep_that_has_not_settled_says_so(empty):
    # at zeta = 0.0029, 12 cycles see exp(-0.0029 * 2 pi * 12) = 0.8 of the transient
    curve = fi.frequency_sweep(empty, AMPLITUDE, [5.1, 5.2, 5.3], fi.Newmark(5e-4), cycles=12)
    assert "transient" in curve.steadiness
    assert any("take a longer dwell" in warning for warning in curve.warnings)


def test_results_come_in_the_order_of_the_frequencies_given(empty):
    shuffled = np.array([5.5, 4.5, 5.3, 4.9, 5.1])
    curve = fi.frequency_sweep(empty, AMPLITUDE, shuffled, fi.Newmark(5e-4), cycles=9)
    order = np.argsort(shuffled)
    sorted_curve = fi.frequency_sweep(empty, AMPLITUDE, shuffled[order], fi.Newmark(5e-4), cycles=9)
    np.testing.assert_array_equal(curve.frequency, shuffled)
    np.testing.assert_array_equal(curve.peak[order], sorted_curve.peak)


def test_a_sweeps_residual_is_at_rounding_without_a_ball(empty):
    curve = fi.frequency_sweep(empty, AMPLITUDE, [5.0, 5.3], fi.Newmark(5e-4), cycles=30)
    # the linear balance is exact for the average acceleration
    assert np.all(curve.energy_residual < 1e-10)
    without = fi.frequency_sweep(empty, AMPLITUDE, [5.0, 5.3], fi.Newmark(5e-4), cycles=30, ledger=False)
    assert np.all(np.isnan(without.energy_residual))
    np.testing.assert_array_equal(curve.peak, without.peak)


def test_the_curve_is_read_only_and_labelled(empty):
    curve = fi.frequency_sweep(empty, AMPLITUDE, [5.0, 5.3], fi.Newmark(5e-4), cycles=6)
    for name, column in columns(curve).items():
        with pytest.raises(ValueError, match="read-only"):
            column[0] = column[1]
        if name != "frequency":
            assert curve.to_xarray()[name].dims == ("frequency",)
    data = curve.to_xarray()
    assert data.frequency.attrs["units"] == "Hz"
    for name, unit in SWEEP_UNITS.items():
        assert data[name].attrs["units"] == unit
    assert data.attrs["base_amplitude_m"] == AMPLITUDE
    assert curve.start == "base"
    assert curve.law == "none"


@pytest.mark.parametrize(
    ("initial", "start"),
    [(None, "base"), (fi.State.at_rest("space"), "space"), (fi.State(ball_velocity=[0.1]), "given")],
)
def test_a_curve_names_its_start(small, initial, start):
    curve = fi.frequency_sweep(small, AMPLITUDE, [5.0], fi.Newmark(1e-4), cycles=3, initial=initial)
    assert curve.start == start
    assert curve.law == "kelvin-voigt"


def test_the_curves_frequencies_are_not_the_callers_array(empty):
    mine = np.array([5.0, 5.3])
    fi.frequency_sweep(empty, AMPLITUDE, mine, fi.Newmark(5e-4), cycles=3)
    mine[0] = 5.1  # still writable
    assert mine[0] == 5.1


def test_progress_runs_to_one(empty):
    shares = []
    fi.frequency_sweep(
        empty, AMPLITUDE, np.linspace(4, 6, 9), fi.Newmark(5e-4), cycles=6, threads=2, progress=shares.append
    )
    assert shares[-1] == pytest.approx(1.0)
    assert shares == sorted(shares)


# ---- what fails, and how -------------------------------------------------------------------------


def switching(reference, stiffness):
    spring = fi.contact.SwitchingSpring(free_stiffness=0.0, stiffness=stiffness)
    return reduced(with_ball(reference, contact=spring), 2, 10)


def test_a_case_that_diverges_is_a_failed_row_with_its_reason(reference):
    # the paper's own step and spring: an energy source. From rest in the inertial frame, at 4 Hz, the beam never
    # reaches the ball
    system = switching(reference, 1e5)
    method = fi.Newmark(1 / (20 * system.first_frequency), allow_coarse_step=True, divergence_limit=2.0)
    curve = fi.frequency_sweep(system, AMPLITUDE, [4.0, 5.3], method, cycles=100, initial=fi.State.at_rest("space"))
    assert list(curve.steadiness == "failed") == [False, True]
    for name in SWEEP_UNITS:
        assert np.isnan(getattr(curve, name)[1]), name
    assert np.isfinite(curve.peak[0])
    assert any("the motion at 5.3 Hz" in w and "grew without bound" in w for w in curve.warnings)


def test_a_sweep_of_failures_and_a_diverging_run_are_divergence_errors(reference):
    system = switching(reference, 1e5)
    method = fi.Newmark(1 / (20 * system.first_frequency), allow_coarse_step=True, divergence_limit=2.0)
    with pytest.raises(fi.DivergenceError, match="take a smaller dt"):
        fi.frequency_sweep(system, AMPLITUDE, [5.2, 5.3], method, cycles=300)
    with pytest.raises(fi.DivergenceError, match=r"the motion at 5\.3 Hz"):
        fi.integrate(system, fi.Sine(AMPLITUDE, 5.3), method, 60.0)


def test_a_step_that_does_not_see_the_contact_is_refused_with_both_numbers(small):
    coarse = fi.Newmark(5e-4)
    for verb in (
        lambda: fi.integrate(small, fi.Sine(AMPLITUDE, 5.2), coarse, 1.0),
        lambda: fi.frequency_sweep(small, AMPLITUDE, [5.2], coarse, cycles=3),
    ):
        with pytest.raises(fi.InputError) as caught:
            verb()
        message = str(caught.value)
        assert "\n" not in message
        for words in ("method.dt = 0.0005 s", "must be <= 0.0002 s", "contact time of 0.002 s", "allow_coarse_step"):
            assert words in message


def test_a_coarse_step_let_through_leaves_its_warning_in_the_result(small):
    coarse = fi.Newmark(5e-4, allow_coarse_step=True)
    run = fi.integrate(small, fi.Sine(AMPLITUDE, 5.2), coarse, 0.5)
    curve = fi.frequency_sweep(small, AMPLITUDE, [5.2], coarse, cycles=3)
    for result in (run, curve):
        assert any("coarse step: dt = 0.0005 s against a contact time of 0.002 s" in w for w in result.warnings)
        assert "coarse step" in result.to_xarray().attrs["warnings"]
    # the longest step that is fine: a tenth of the contact
    assert fi.integrate(small, fi.Sine(AMPLITUDE, 5.2), fi.Newmark(2e-4), 0.5).warnings == ()


def test_the_recommended_step_resolves_contact_and_first_mode(small, empty):
    assert fi.recommended_step(small) == pytest.approx(2e-3 / 20, rel=1e-9)
    assert fi.recommended_step(empty) == pytest.approx(1 / (400 * 5.3), rel=1e-4)


def test_a_dwell_in_seconds_measures_the_whole_cycles_of_its_window(small):
    # 4 and 5 Hz: 2 s of 8 s are 8 and 10 whole cycles, those that the same dwell in cycles ends with
    method = fi.Newmark(1e-4)
    by_time = fi.frequency_sweep(small, AMPLITUDE, [4.0, 5.0], method, duration=6.0, window=2.0)
    assert by_time.cycles is None
    assert (by_time.duration, by_time.window) == (6.0, 2.0)
    for i, (frequency, cycles) in enumerate([(4.0, 24), (5.0, 30)]):
        by_cycles = fi.frequency_sweep(small, AMPLITUDE, frequency, method, cycles=cycles)
        assert by_time.peak[i] == by_cycles.peak[0]
        assert by_time.impacts_per_cycle[i] == by_cycles.impacts_per_cycle[0]
