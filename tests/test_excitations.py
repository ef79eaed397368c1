"""Chirps, stepped sines, random motions, shocks, blows and sums: what they are, and that every method takes them."""

import itertools
import math

import matplotlib.text
import mpmath as mp
import numpy as np
import pytest
import scipy.integrate
import scipy.special
import scipy.stats
from builders import REFERENCE, reduced, with_ball
from reference_events import Oscillator
from test_piecewise_polynomial import BALL, GAP, MASS, OMEGA, RESTITUTION, ZETA, in_a_box, same_impacts

import femimpact as fi
from femimpact.excitation.drives import until
from femimpact.excitation.excitation import words_of
from femimpact.figures.histories import cycle_averaged_force

G = 9.80665
CHIRP = fi.Chirp(4.0, 8.0, 4.0, amplitude=1e-3)
BY_ACCELERATION = fi.Chirp(8.0, 4.0, 4.0, acceleration=2.0, kind="logarithmic")
STEPPED = fi.SteppedSine((4.0, 5.0, 6.0), 6, acceleration=2.0, direction="both")
RANDOM = fi.RandomBase([(2.0, 0.05), (20.0, 0.01), (40.0, 0.01)], 6.0, seed=2)
SHOCK = fi.Shock("half-sine", acceleration=10.0 * G, duration=0.011)
SINES = fi.Sine(1e-3, 5.0) + fi.Sine(2e-4, 11.3, 0.4) + fi.Sine(1e-4, 17.9, 2.0)
MOTIONS = {
    "chirp": CHIRP, "chirp by acceleration": BY_ACCELERATION, "stepped": STEPPED, "random": RANDOM, "shock": SHOCK,
    "compensated": fi.Shock("trapezoid", acceleration=20.0, duration=0.02, compensated=True),
    "sines": until(SINES, 4.0),
    "chirp and sine": until(CHIRP + fi.Sine(1e-4, 30.0), 4.0),
}  # fmt: skip


@pytest.mark.parametrize("name", MOTIONS)
def test_displacement_velocity_and_acceleration_are_derivatives_of_one_another(name):
    base = MOTIONS[name]
    # pulses within their smooth parts
    low, high = {"shock": (0.0, 0.007), "compensated": (0.003, 0.014)}.get(name, (0.01, 3.9))
    ends = np.linspace(low, high, 40)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    length = 0.003
    inner = ends[:, None] + 0.5 * length * (1.0 + nodes)
    for lower, upper in ((base.displacement, base.velocity), (base.velocity, base.acceleration)):
        change = lower(ends + length) - lower(ends)
        # a difference of two near values is known to their rounding; Gauss points see no jump of a last digit
        size = np.abs(lower(ends)).max()
        np.testing.assert_allclose(0.5 * length * (upper(inner) @ weights), change, atol=1e-10 * size)


def test_chirps_have_their_phase_and_do_not_drift():
    t = np.linspace(0.0, 4.0, 20_001)[:-1]
    phase = 2.0 * np.pi * (4.0 * t + 0.5 * t**2)
    assert np.abs(CHIRP.displacement(t) - 1e-3 * np.sin(phase)).max() < 1e-14
    rate = 2.0 * np.pi * (4.0 + t)
    exact = 1e-3 * (2.0 * np.pi * np.cos(phase) - rate**2 * np.sin(phase))
    assert np.abs(CHIRP.acceleration(t) - exact).max() < 1e-9 * np.abs(exact).max()
    for kind, (start, stop) in itertools.product(("linear", "logarithmic"), ((5.0, 50.0), (50.0, 5.0), (5.0, 5.0))):
        base = fi.Chirp(start, stop, 4.0, acceleration=2.0, kind=kind)
        assert np.abs(base.acceleration(t) - 2.0 * np.sin(base.phase_at(t))).max() < 1e-9 * 2.0
        # about zero, with the amplitude of a sine of this frequency to second order in the change of a cycle
        size = base.displacement(t) * (2.0 * np.pi * base.frequency_at(t)) ** 2 / 2.0
        assert np.abs(size).max() == pytest.approx(1.0, abs=1e-4)


def test_octaves_per_minute_are_a_duration():
    base = fi.Chirp(5.0, 40.0, amplitude=1e-3, kind="logarithmic", octaves_per_minute=2.0)
    assert base.duration == pytest.approx(90.0)
    assert base.frequency_at(30.0) == pytest.approx(10.0)
    assert fi.Chirp(5.0, 40.0, amplitude=1e-3, octaves_per_minute=2.0) == base
    assert fi.Chirp(5.0, 40.0, 90.0, amplitude=1e-3).kind == "linear"


def test_stepped_sines_change_where_the_base_stands_still():
    ends = np.cumsum(6.0 / STEPPED.steps)
    np.testing.assert_allclose(STEPPED.steps, [4.0, 5.0, 6.0, 5.0, 4.0])
    assert STEPPED.duration == pytest.approx(ends[-1])
    before, after = ends[:-1] - 1e-9, ends[:-1] + 1e-9
    for motion, size in ((STEPPED.displacement, 1e-9), (STEPPED.velocity, 1e-8), (STEPPED.acceleration, 1e-8)):
        np.testing.assert_allclose(motion(before), motion(after), atol=size)
    np.testing.assert_allclose(STEPPED.velocity(ends), 0.0, atol=1e-9)
    t = np.linspace(0.0, ends[0], 1001)[:-1]
    np.testing.assert_allclose(STEPPED.acceleration(t), -2.0 * np.cos(8.0 * np.pi * t), atol=2e-9)


def test_a_random_motion_is_its_sum_of_lines():
    f, size, phase = RANDOM.lines
    t = np.random.default_rng(0).uniform(0.0, 6.0, 50)
    angle = 2.0 * np.pi * np.outer(t, f) + phase
    largest = np.abs(RANDOM.closed_form.value(np.linspace(0.0, 6.0, 20_001))).max()
    np.testing.assert_allclose(RANDOM.acceleration(t), np.cos(angle) @ size, atol=1e-9 * largest)
    np.testing.assert_allclose(RANDOM.displacement(t), -np.cos(angle) @ (size / (2 * np.pi * f) ** 2), atol=1e-13)
    # the mean square of the lines is the density's integral, by straight lines of its logarithms
    points = np.log(np.array(RANDOM.psd))
    exact = scipy.integrate.quad(lambda x: np.exp(np.interp(np.log(x), *points.T)), 2.0, 40.0, points=[20.0])[0]
    assert RANDOM.rms**2 == pytest.approx(exact, rel=0.02)


def test_another_seed_is_another_motion_of_the_same_density():
    other = fi.RandomBase(RANDOM.psd, RANDOM.duration, seed=3)
    np.testing.assert_array_equal(other.lines[1], RANDOM.lines[1])
    assert np.all(other.lines[2] != RANDOM.lines[2])
    assert fi.RandomBase(RANDOM.psd, RANDOM.duration, seed=2) == RANDOM


def test_random_amplitudes_are_those_of_a_gaussian_process():
    fixed, drawn = (
        fi.RandomBase([(5.0, 0.3), (105.0, 0.3)], 100.0, seed=4, amplitudes=kind) for kind in ("fixed", "random")
    )
    assert fixed == fi.RandomBase(fixed.psd, 100.0, seed=4)
    np.testing.assert_array_equal(drawn.lines[2], fixed.lines[2])
    # 10,001 lines: (a/a0)^2 is exponential of mean and deviation 1, and independent of the phase
    shares, count = (drawn.lines[1] / fixed.lines[1]) ** 2, fixed.lines[1].size
    assert abs(shares.mean() - 1.0) < 4.0 / math.sqrt(count)
    assert scipy.stats.kstest(shares, "expon").pvalue > 1e-3
    assert abs(np.corrcoef(shares, np.cos(fixed.lines[2]))[0, 1]) < 4.0 / math.sqrt(count)
    assert drawn.rms != fixed.rms == pytest.approx(math.sqrt(0.3 * 100.01), rel=1e-12)


def test_mean_squares_scatter_over_seeds_as_those_of_a_gaussian_process_with_random_amplitudes_only():
    # one mode at 5 Hz with 2 % damping over 30 s: the variance of a mean square is 2/T times the integral of the square
    # of the correlation exp(-zeta omega |t|) cos omega t, so that the deviation is 1/sqrt(zeta omega T) = 23 % of the
    # mean; with fixed amplitudes only the start at rest scatters
    omega, zeta, end, seeds = 10.0 * np.pi, 0.02, 30.0, 80
    system = fi.System.from_matrices([[1.0]], [[2.0 * zeta * omega]], [[omega**2]], points={"mass": [1.0]})
    system, record = fi.reduce(system, modes=1), fi.Recorder(interval=0.03, channels=("mass",), ledger=False)
    scatter = {}
    for kind in ("fixed", "random"):
        drives = [fi.RandomBase([(2.0, 0.04), (12.0, 0.04)], end, seed, amplitudes=kind) for seed in range(seeds)]
        found = [np.mean(run["mass"] ** 2) for run in fi.integrate(system, drives, fi.EventDriven(), end, record)]
        scatter[kind] = np.std(found, ddof=1) / np.mean(found)
    gaussian = 1.0 / math.sqrt(zeta * omega * end)
    # a deviation of so many draws is known to 1/sqrt(2 n), of which four
    assert abs(scatter["random"] / gaussian - 1.0) < 4.0 / math.sqrt(2.0 * seeds)
    assert scatter["fixed"] < 0.3 * gaussian


def test_sums_of_one_frequency_are_a_sine_and_others_have_no_cycle():
    one = fi.Sine(1e-3, 5.0) + fi.Sine(2e-3, 5.0, 1.0)
    t = np.linspace(0.0, 1.0, 101)
    wave = one.closed_form
    same = fi.Sine(wave.amplitude / wave.omega**2, 5.0, one.phase)
    np.testing.assert_allclose(one.displacement(t), same.displacement(t), atol=1e-17)
    assert one.frequency == 5.0
    assert math.isnan(SINES.phase)
    assert len((SINES + one).parts) == 5


@pytest.mark.impacts
@pytest.mark.parametrize("name", ["five sines", "chirp"])
def test_the_first_ten_impacts_are_those_of_30_digits(name):
    if name == "chirp":
        base = fi.Chirp(3.0, 8.0, 4.0, amplitude=1e-3)

        def s(t):
            start, slope = mp.mpf(3), mp.mpf(5) / 4
            phase, rate = 2 * mp.pi * (start * t + slope * t * t / 2), 2 * mp.pi * (start + slope * t)
            return (2 * mp.pi * slope * mp.cos(phase) - rate * rate * mp.sin(phase)) / 1000
    else:
        parts = [fi.Sine(1e-3 / (n + 1), f, 0.3 * n) for n, f in enumerate((4.1, 5.3, 7.7, 9.2, 13.1))]
        base = fi.excitation.Sum(parts)

        def s(t):
            total = mp.mpf(0)
            for part in parts:
                omega = 2 * mp.pi * mp.mpf(part.frequency)
                total -= mp.mpf(part.amplitude) * omega**2 * mp.sin(omega * t + mp.mpf(part.phase))
            return total

    exact = Oscillator(OMEGA, ZETA, MASS, BALL, GAP, RESTITUTION, s).impacts(np.arange(1, 101) * 0.02, 10)
    run = fi.integrate(in_a_box(), base, fi.EventDriven(), 2.0, fi.Recorder(interval=1e-3))
    same_impacts(run, exact, 1e-10)


@pytest.mark.impacts
@pytest.mark.parametrize("name", MOTIONS)
def test_the_balance_closes_under_every_motion(name):
    system = reduced(with_ball(REFERENCE, contact=fi.Rigid(restitution=0.7), gap=1e-4), 4)
    run = fi.integrate(system, MOTIONS[name], fi.EventDriven(), 3.0, fi.Recorder(interval=2e-3))
    assert len(run.impacts) > 3
    assert run.energy.residual < 1e-10


@pytest.mark.parametrize("name", MOTIONS)
def test_steps_converge_to_the_event_driven_motion(name):
    alone, base = fi.without_impactors(in_a_box()), MOTIONS[name]
    # what begins at once is met at first order only; the shock ends at a step
    order = 1 if name in ("compensated", "stepped", "random") else 2
    errors = []
    for dt in (4.4e-4, 2.2e-4) if name == "shock" else (4e-4, 2e-4):
        record = fi.Recorder(interval=dt, channels=("mass",))
        exact = fi.integrate(alone, base, fi.EventDriven(), 0.8, record)["mass"]
        steps = fi.integrate(alone, base, fi.Newmark(dt), 0.8, fi.Recorder(channels=("mass",)))["mass"]
        errors.append(np.abs(exact - steps).max() / np.abs(exact).max())
    assert errors[1] < 1e-2
    assert errors[0] / errors[1] > 1.8**order


def test_records_of_displacement_and_velocity_are_met():
    t = 1e-3 * np.arange(8001)
    place, speed = np.sin(20.0 * t) - 0.2 * np.cos(33.0 * t), 20.0 * np.cos(20.0 * t) + 6.6 * np.sin(33.0 * t)
    base = fi.RecordedBase.from_displacement(place, 1e-3)
    np.testing.assert_allclose(base.displacement(t), place - place[0], atol=1e-11)
    by_speed = fi.RecordedBase.from_velocity(speed, 1e-3)
    np.testing.assert_allclose(by_speed.velocity(t), speed, atol=2e-3 * np.abs(speed).max())
    # an offset and a slow drift are taken out, what is well above stays
    drifting = fi.RecordedBase.from_velocity(speed + 0.5 + 0.3 * t, 1e-3, high_pass=0.7)
    inner = (t > 3.0) & (t < 5.0)
    assert np.abs(drifting.velocity(t) - speed)[inner].max() < 0.1 * np.abs(speed).max()


@pytest.mark.parametrize("phase", np.linspace(0.0, 7.0 * np.pi / 4.0, 8))
def test_a_high_pass_keeps_the_motion_up_to_the_ends_of_a_record_cut_within_it(phase, tmp_path):
    t, omega = 1e-3 * np.arange(20_001), 2.0 * np.pi * 7.6
    wave = 0.7 * np.sin(omega * t + phase)
    path, ends = tmp_path / "cut.csv", (t < 0.5) | (t > 19.5)
    columns = np.column_stack([t, wave + 0.13 + 0.01 * t + 0.05 * np.sin(2.0 * np.pi * t / 60.0)])
    np.savetxt(path, columns, delimiter=",")
    base = fi.RecordedBase.from_csv(path, high_pass=1.0)
    rms = np.sqrt(np.mean((base.samples - wave)[ends] ** 2))
    # continued about the last sample it is up to 0.6 of the amplitude, and 5 mm
    assert rms < 0.006 * 0.7
    # from the place of the first sample, which is the one of the last
    size = 0.7 / omega**2
    assert 0.99 * size < base.amplitude < 2.1 * size


@pytest.mark.parametrize("psd", [[(5.0, 1.0), (100.0, 1.0)], [(5.0, 1.0), (100.0, 1e-4)], [(40.0, 1.0), (41.0, 1.0)]])
def test_a_random_motion_is_met_to_1e_9_with_no_more_pieces_than_its_density_takes(psd):
    base = fi.RandomBase(psd, 3.0, seed=4)
    (f, size, phase), knots = base.lines, base.closed_form.knots
    # the ends of pieces, where the error is largest
    t = np.random.default_rng(0).choice(knots[1:], 400) - 1e-9
    exact = np.cos(2.0 * np.pi * np.outer(t, f) + phase) @ size
    assert np.abs(base.acceleration(t) - exact).max() < 1e-9 * np.abs(base.acceleration(knots)).max()
    assert 8.0 < (knots.size - 1) / (3.0 * f[-1]) < 24.0


@pytest.mark.parametrize(
    ("base", "words"),
    [
        (fi.Sine(1e-3, 5.0), "base at 5 Hz"), (CHIRP + fi.Sine(1e-4, 30.0), "base: chirp + sine"),
        (STEPPED, "base: stepped sine"), (RANDOM, "base: random"), (fi.RecordedBase([0.0, 1.0], 0.1), "base: recorded"),
        (fi.HammerBlow("tip", 0.1, 1e-3), "force at tip: hammer blow"),
        (fi.PointForce(0.1, SHOCK), "force at 0.1 m: shock"),
        (fi.PointForce("mid", fi.Sine(1.0, 7.0)), "force at mid, 7 Hz"),
    ],
)  # fmt: skip
def test_what_drives_a_run_has_words(base, words):
    assert words_of(base) == words


@pytest.mark.impacts
@pytest.mark.parametrize("base", [RANDOM, SHOCK, CHIRP + RANDOM, fi.HammerBlow("tip", 0.02, 2e-3)])
def test_nothing_names_a_cycle_where_there_is_none(base):
    contact = fi.KelvinVoigt(restitution=0.7, contact_time=4e-3)
    system = reduced(with_ball(REFERENCE, contact=contact, gap=1e-4), 4)
    channels = ("tip", "tip.velocity", "ball", "ball.velocity", "ball.contact_force")
    run = fi.integrate(system, base, fi.EventDriven(), 0.5, fi.Recorder(channels, interval=1e-3))
    assert len(run.impacts) > 0
    off, drawn = fi.figures.OffScreen(), []
    for draw in (fi.figures.motion, fi.figures.contact_force, fi.figures.impact_histograms):
        drawn += list(np.ravel(draw(run, figure=off)))
    for draw in (fi.figures.spectrum, fi.figures.impulse_phase, fi.figures.phase_portrait):
        drawn.append(draw(run, ax=off))
    texts = [text.get_text() for axis in drawn for text in axis.figure.findobj(matplotlib.text.Text)]
    said = " ".join([*texts, repr(run), str(run.to_xarray().attrs)]).replace("the excitation has no cycle", "")
    assert "cycle" not in said
    assert "Hz" not in said.replace("frequency (Hz)", "").replace("²/Hz", "").replace("Hz apart", "")
    with pytest.raises(fi.InputError, match="must have a cycle"):
        cycle_averaged_force(run)
