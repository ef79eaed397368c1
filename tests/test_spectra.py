"""Spectra, measured transfer functions and shock response spectra against closed forms, and what is refused."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from nouns import STRUCTURE

import femimpact as fi
from femimpact.signals.densities import degrees_of_freedom, resolution_bias
from femimpact.signals.estimates import _transform_of

G = 9.80665
RATIO, NATURAL = 0.02, 5.0


@cache
def oscillator(ratio: float = RATIO, *, ball: bool = False) -> fi.System:
    omega = 2 * math.pi * NATURAL
    balls = [fi.Impactor("ball", "tip", 0.2, 2e-3, fi.Rigid(0.7))] if ball else []
    return fi.System.from_matrices(
        [[1.0]], [[2 * ratio * omega]], [[omega**2]], points={"tip": [1.0]}, impactors=balls
    )  # fmt: skip


NAMES = ("tip", "tip.velocity", "tip.acceleration", "tip.absolute_acceleration")


def run_of(
    system: fi.System, drive: object, duration: float, interval: float = 4e-3, names=NAMES
) -> fi.response.Response:
    return fi.integrate(system, drive, fi.EventDriven(), duration, fi.Recorder(names, interval=interval))


@cache
def random_run(*, ball: bool = False, interval: float = 4e-3) -> fi.response.Response:
    base = fi.RandomBase([(1.0, 0.5), (40.0, 0.5)], 60.0, seed=3, amplitudes="random")
    return run_of(oscillator(ball=ball), base, 60.0, interval)


# ---- densities ----------------------------------------------------------------------------------------------------


def test_the_integral_of_a_density_is_the_mean_square():
    """Exact for one window over all of it; of averages within what their windows weigh otherwise."""
    run = random_run()
    values = run["tip.absolute_acceleration"]
    found = fi.spectrum(run, "tip.absolute_acceleration")
    assert found.mean_square == pytest.approx(np.var(values), rel=0.1)
    assert found.unit == "(m/s^2)^2/Hz"
    assert fi.spectrum(run, "tip").unit == "m^2/Hz"
    tones = sum(a * np.sin(2 * np.pi * f * run.time) for a, f in ((1.0, 10.0), (0.5, 30.0)))
    # lines within the windows are weighed alike
    sines = fi.spectrum(replace(run, channels={"tip": tones}, units={"tip": "m"}), "tip", resolution=0.5)
    assert sines.mean_square == pytest.approx(0.5 * (1.0 + 0.25), rel=1e-3)


@pytest.mark.parametrize("kind", ["amplitude", "density"])
def test_a_spectrum_has_the_mean_square_of_its_windowed_samples(kind):
    """Parseval: of an odd number of samples every line but that of the mean stands for two."""
    run, count = random_run(), 1001
    noise = 0.7 + np.random.default_rng(2).standard_normal(count)
    kept = {"time": run.time[:count], "channels": {"tip": noise}, "units": {"tip": "m"}, "energy": None}
    resolution = {} if kind == "amplitude" else {"resolution": 250.0 / count}
    found = fi.spectrum(replace(run, **kept), "tip", kind, **resolution)
    window = 1.0 - np.cos(2.0 * np.pi * np.arange(count) / count)
    # a density has no mean
    moving = noise if kind == "amplitude" else noise - noise.mean()
    assert found.mean_square == pytest.approx(np.sum((window * moving) ** 2) / np.sum(window**2), rel=1e-12)


def test_the_mean_square_of_amplitudes_is_that_of_the_steady_motion():
    weight = fi.System.from_matrices(
        [[1.0]], [[0.2 * math.pi * NATURAL]], [[(2 * math.pi * NATURAL) ** 2]], points={"tip": [1.0]},
        constant_load=[0.3],
    )  # fmt: skip
    run = fi.integrate(weight, fi.Sine(1e-3, 4.0), fi.EventDriven(), 12.0, fi.Recorder(("tip",)))
    assert abs(run["tip"].mean()) > 1e-4
    assert fi.spectrum(run, "tip").mean_square == pytest.approx(run.steady.rms[0] ** 2, rel=1e-8)


@pytest.mark.parametrize("window", [64, 65])
def test_the_interval_holds_the_density_of_white_noise(window):
    """Of normal white noise the density is known: the interval of 90 % holds it in 90 % of the lines."""
    run, rate = random_run(), 250.0
    generator = np.random.default_rng(7)
    held = []
    for _ in range(60):
        noise = generator.standard_normal(run.time.size)[:1000]
        kept = {"time": run.time[:1000], "channels": {"tip": noise}, "units": {"tip": "m"}, "energy": None}
        found = fi.spectrum(replace(run, **kept), "tip", resolution=rate / window, confidence=0.9)
        inside = (found.low <= 2.0 / rate) & (2.0 / rate <= found.high)
        # the lowest lines lack the mean of each window
        held.append(inside[2:-1])
    share = np.mean(held)
    # neighbouring lines under a Hann window share half of their values: a third as many draws as lines
    assert abs(share - 0.9) < 4.0 * math.sqrt(0.09 / (np.size(held) / 3))


def test_degrees_of_freedom_are_those_of_welch():
    assert degrees_of_freedom(1000, 1) == 2.0
    # two windows share (1/6)^2 of their values (Welch, 1967): 2 * 4/(2 + 2/36)
    assert degrees_of_freedom(1000, 2) == pytest.approx(8.0 / (2.0 + 2.0 / 36.0), rel=1e-3)


def test_the_bias_of_a_coarse_resolution_is_that_of_the_expected_density():
    """The window's correlation times that of the resonance, transformed by brute force at the peak."""
    width, resolution, rate = 0.03, 0.1, 50.0
    count = round(rate / resolution)
    window = np.hanning(count + 1)[:-1]
    own = np.correlate(window, window, "full")[count - 1 :] / (window @ window)
    lags = np.arange(200_000) / rate
    correlation = np.exp(-np.pi * width * lags)
    weight = np.ones_like(lags)
    weight[0] = 0.5
    exact = np.sum((weight * correlation)[:count] * own) / np.sum(weight * correlation) - 1.0
    assert resolution_bias(width, resolution) == pytest.approx(exact, rel=1e-3)
    assert resolution_bias(1.0, 1e-3) == pytest.approx(0.0, abs=1e-5)


def test_a_coarse_resolution_is_warned_of_with_its_bias():
    run = random_run()
    width = 2 * RATIO * NATURAL
    (text,) = fi.spectrum(run, "tip", resolution=width / 4).warnings
    assert f"half-power width, {width:.3g} Hz, of the mode at 5 Hz" in text
    assert f"{-100 * resolution_bias(width, round(1 / (width / 4) / 4e-3) ** -1 / 4e-3):.2g} % too low" in text
    assert not fi.spectrum(run, "tip", resolution=width / 6).warnings


def test_a_mode_above_half_the_reading_rate_is_refused_with_the_interval_to_use():
    run = random_run(interval=0.11)
    with pytest.raises(fi.InputError, match=r"must be <= 0\.1 s, by Recorder\(interval=\): a kept mode at 5 Hz"):
        fi.spectrum(run, "tip")
    with pytest.raises(fi.InputError, match="would be an alias"):
        fi.measured_transfer(run, "tip")
    fi.spectrum(random_run(interval=0.1), "tip")


@pytest.mark.parametrize("place", [lambda sum_: sum_, lambda sum_: fi.PointForce("tip", sum_)], ids=["base", "force"])
def test_a_sum_with_a_transient_has_no_averages_over_windows(place):
    chirp = fi.Chirp(2.0, 9.0, 10.0, acceleration=1.0, kind="linear")
    run = fi.integrate(oscillator(), place(fi.Sine(1e-3, 3.0) + chirp), fi.EventDriven(), 10.0)
    with pytest.raises(fi.InputError, match=r"part 2, Chirp': .* averages over windows take no transient"):
        fi.measured_transfer(run, "tip")


def test_a_mode_of_a_full_mesh_above_half_the_reading_rate_is_warned_of():
    full = fi.assemble(fi.Structure(STRUCTURE.beam, damping=STRUCTURE.damping), 3)
    base = fi.RandomBase([(1.0, 0.5), (40.0, 0.5)], 3.0, seed=3)
    second = fi.solve_modes(full, 2).natural_frequency[1]
    every = math.ceil(0.6 / second / 1e-4)
    run = fi.integrate(full, base, fi.Newmark(dt=1e-4), 3.0, fi.Recorder(["tip"], every=every))
    assert any("Hz is an alias there where the steps were finer" in text for text in fi.spectrum(run, "tip").warnings)


@pytest.mark.impacts
def test_acceleration_beside_rigid_contacts_has_its_impulses_by_the_velocity():
    """The truth is read finely, where jumps of the velocity have no aliases."""
    fine = random_run(ball=True, interval=2.5e-4)
    # of one run: of two the motions part, by the last bit of some processors
    every = {name: values[::16] for name, values in fine.channels.items()}
    coarse = replace(fine, time=fine.time[::16], channels=every, energy=None)
    assert len(coarse.impacts) > 200
    truth = fi.spectrum(fine, "tip.acceleration", resolution=1.0)
    found = fi.spectrum(coarse, "tip.acceleration", resolution=1.0)
    assert f"lacks the impulses of {len(coarse.impacts)} rigid impacts" in found.notes[0]
    assert found.notes[1].startswith("of the level of the jumps, ")
    # with their aliases they would be (x/sin x)^2 of it, x = pi f interval: 1.15, 1.5 and 2.2
    # beside half the rate, 125 Hz, the aliases are as large as the line, and so is the scatter of what is taken out
    for low, high, share in ((45.0, 60.0, 0.06), (80.0, 100.0, 0.06), (110.0, 124.0, 0.2)):
        band = (found.frequency >= low) & (found.frequency <= high)
        ratio = found.values[band].mean() / truth.values[: found.frequency.size][band].mean()
        assert ratio == pytest.approx(1.0, abs=share)
    # in space and relative to the base, from whichever velocity there is
    other = fi.spectrum(coarse, "tip.absolute_acceleration", resolution=1.0).values
    base = coarse.base.velocity(coarse.time)
    kept = {"tip.absolute_velocity": coarse["tip.velocity"] + base, "tip.acceleration": coarse["tip.acceleration"],
            "tip.absolute_acceleration": coarse["tip.absolute_acceleration"]}  # fmt: skip
    units = {name: "m/s" if "velocity" in name else "m/s^2" for name in kept}
    swapped = replace(coarse, channels=kept, units=units)
    np.testing.assert_allclose(fi.spectrum(swapped, "tip.absolute_acceleration", resolution=1.0).values, other)
    again = fi.spectrum(swapped, "tip.acceleration", resolution=1.0).values
    np.testing.assert_allclose(again[1:], found.values[1:], rtol=1e-6)
    alone = {"tip.acceleration": coarse["tip.acceleration"]}
    with pytest.raises(
        fi.InputError, match=r"^channel = 'tip\.velocity': must be a recorded channel too: .* lacks the"
    ):
        fi.spectrum(replace(coarse, channels=alone, units={"tip.acceleration": "m/s^2"}), "tip.acceleration")


@pytest.mark.impacts
def test_forces_that_lack_impulses_say_so():
    base = fi.RandomBase([(1.0, 0.5), (40.0, 0.5)], 20.0, seed=3)
    run = run_of(oscillator(ball=True), base, 20.0, names=("shaker_force", "contact_force"))
    for name in run.channels:
        assert any(f"{name} lacks the impulses" in text for text in fi.spectrum(run, name).warnings)


def test_amplitudes_of_a_steady_sine_are_its_amplitude():
    run = run_of(oscillator(), fi.Sine(1e-3, 4.0), 30.0)
    found = fi.spectrum(run, "tip")
    exact = abs(fi.transfer_function(oscillator(), 4.0, "tip", "base.displacement")["tip"][0])
    line = np.argmin(abs(found.frequency - 4.0))
    # of the transient exp(-0.02 2 pi 5 20) is left
    assert found.values[line] == pytest.approx(1e-3 * exact, rel=1e-5)
    assert (found.kind, found.unit) == ("amplitude", "m")
    assert math.isnan(found.degrees_of_freedom)
    # a start within a cycle leaves whole cycles after it
    late = fi.spectrum(run_of(oscillator(), fi.Sine(1e-3, 4.0), 32.0), "tip", start=30.4)
    assert late.values.max() == pytest.approx(1e-3 * exact, rel=1e-5)


# ---- measured transfer functions ----------------------------------------------------------------------------------


@pytest.mark.parametrize("of", ["base.acceleration", "base.displacement"])
def test_averages_tend_to_the_closed_form(of):
    damped = oscillator(0.2)
    run = run_of(damped, fi.RandomBase([(1.0, 0.5), (40.0, 0.5)], 60.0, seed=3), 60.0)
    found = fi.measured_transfer(run, to="tip.absolute_acceleration", of=of, resolution=0.1)
    assert found.frequency.min() > 0.7
    assert found.frequency.max() < 40.3
    exact = fi.transfer_function(damped, found.frequency, "tip.absolute_acceleration", of)
    inner = (found.frequency > 1.2) & (found.frequency < 39.0)
    name = "tip.absolute_acceleration"
    assert found.units[name] == exact.units[name]
    # windows of 10 s over a decay of 0.16 s: the share of what lies outside of them
    error = np.abs(found[name] - exact[name])[inner] / np.abs(exact[name]).max()
    assert error.max() < 0.02
    assert np.all(found.coherence[name][inner] > 0.9)
    second = np.abs(found.h2[name] - exact[name])[inner] / np.abs(exact[name]).max()
    assert second.max() < 0.04


def test_coherence_and_both_estimates_of_a_noisy_output():
    """Noise in the output leaves H1, raises H2 by 1/coherence, and the coherence is that of the two powers."""
    run = random_run()
    generator = np.random.default_rng(1)
    x = generator.standard_normal(run.time.size)
    y = 2.0 * x + 2.0 * generator.standard_normal(x.size)
    both = replace(run, channels={"x": x, "y": y}, units={"x": "N", "y": "m"})
    found = fi.measured_transfer(both, to="y", of="x", resolution=2.0)
    assert found.units == {"y": "m/N"}
    # 60 averages: 1/sqrt(60 * 125 lines / 3), of which four
    assert np.mean(found["y"].real) == pytest.approx(2.0, abs=0.08)
    assert np.mean(found.coherence["y"]) == pytest.approx(0.5, abs=0.05)
    np.testing.assert_allclose(np.abs(found.h2["y"]) * found.coherence["y"], np.abs(found["y"]), rtol=1e-12)


@pytest.mark.parametrize("to", ["tip", "tip.absolute_acceleration"])
@pytest.mark.parametrize("chirp", [fi.Chirp(2.0, 30.0, 10.0, acceleration=2.0),
                                   fi.Chirp(30.0, 2.0, 10.0, amplitude=1e-3, kind="logarithmic")])  # fmt: skip
def test_a_chirp_transformed_whole_is_the_closed_form(to, chirp):
    found = fi.measured_transfer(run_of(oscillator(), chirp, 30.0), to)
    exact = fi.transfer_function(oscillator(), found.frequency, to)[to]
    assert found.frequency[[0, -1]] == pytest.approx([2.0, 30.0], abs=0.04)
    # what has not decayed after 20 s, exp(-0.02 2 pi 5 20), and the samples' (pi f interval)^2 of the end of the chirp
    assert np.abs(found[to] - exact).max() < 1e-4 * np.abs(exact).max()
    assert np.all(np.isnan(found.coherence[to]))


def test_a_blow_transformed_whole_is_the_closed_form():
    blow = fi.HammerBlow("tip", 0.1, 0.02, begin=0.1)
    found = fi.measured_transfer(run_of(oscillator(), blow, 15.0, 2e-3), "tip")
    exact = fi.transfer_function(oscillator(), found.frequency, "tip", force_at="tip")["tip"]
    assert found.units["tip"] == "m/N"
    assert np.abs(found["tip"] - exact).max() < 1e-3 * np.abs(exact).max()


def error_of(run: fi.response.Response, to: str, of: str | None = None, **given: str) -> np.ndarray:
    """Relative error of a measured transfer function at its lines."""
    found = fi.measured_transfer(run, to, of)
    system = run.system
    if of is not None and of.startswith("tip"):
        both = fi.transfer_function(system, found.frequency, [to, of], **given)
        return np.abs(found[to] / (both[to] / both[of]) - 1.0)
    return np.abs(found[to] / fi.transfer_function(system, found.frequency, to, of, **given)[to] - 1.0)


@pytest.mark.parametrize(
    ("duration", "begin", "interval"),
    [(1e-3, 0.0, 0.02), (2e-3, 0.1, 0.02), (0.011, 0.1, 0.02), (1e-3, 4e-3, 4e-3), (0.01, 0.0, 1e-3)],
)
def test_a_blow_and_a_shock_between_readings_have_their_exact_transform(duration, begin, interval):
    """Of displacements after an impulse aliases are (f/(rate - f))^2: 1 % at the lines that are kept, or less."""
    drives = [
        (fi.HammerBlow("tip", 0.1, duration, begin=begin), True),
        *(
            (fi.Shock(kind, 30.0, duration, delay=begin), False)
            for kind in ("half-sine", "rectangle", "terminal-sawtooth")
        ),
    ]
    for drive, by_force in drives:
        run = run_of(oscillator(), drive, 20.0, interval)
        for name in NAMES[:3] if by_force else NAMES:
            found = fi.measured_transfer(run, name)
            assert found.frequency.size >= 15
            assert found.frequency.max() <= 0.25 / interval
            omega, own = 2 * np.pi * found.frequency, 2 * np.pi * NATURAL
            # of an oscillator of 1 kg under a force, and relative to its base
            u = (1.0 if by_force else -1.0) / (own**2 - omega**2 + 2j * RATIO * own * omega)
            exact = {"tip": u, "tip.velocity": 1j * omega * u, "tip.acceleration": -(omega**2) * u}
            exact["tip.absolute_acceleration"] = 1.0 - omega**2 * u
            assert np.abs(found[name] / exact[name] - 1.0).max() < 0.01


def test_several_pulses_are_transformed_exactly():
    shock = fi.Shock("half-sine", 30.0, PULSE, compensated=True, pulses=5, period=0.5, delay=0.05)
    run = run_of(oscillator(), shock, 20.0, 2e-3)
    assert error_of(run, "tip").max() < 0.01
    pieces = replace(shock, compensated=False).closed_form
    f = np.array([0.3, 7.0, 200.0, 3000.0])
    # brute force: 2000 lengths in each piece, with the error of Simpson's rule, (2 pi f h)^4/180 of h = 5e-7 s
    t = (pieces.knots[:-1, None] + np.diff(pieces.knots)[:, None] * np.linspace(0.0, 1.0, 2001)).ravel()
    inside = np.clip(t, np.repeat(pieces.knots[:-1], 2001), np.repeat(np.nextafter(pieces.knots[1:], -1.0), 2001))
    waves = pieces.value(inside) * np.exp(-2j * np.pi * np.outer(f, t - 0.02))
    weights = np.tile([2.0, 4.0], 1001)[:2001]
    weights[[0, -1]] = 1.0
    exact = waves @ (np.repeat(np.diff(pieces.knots), 2001) * np.tile(weights, len(pieces.knots) - 1) / 6000.0)
    found = _transform_of(pieces, f, 0.02)
    assert np.abs(found - exact).max() < 1e-9 * np.abs(exact).max()


def test_lines_that_aliases_spoil_are_left_out_and_it_is_said():
    run = run_of(oscillator(), fi.HammerBlow("tip", 0.1, 0.01), 20.0, 1e-3)
    found = fi.measured_transfer(run, "tip")
    assert found.frequency.max() < 250.0
    assert any("lines to 250 Hz are left out for aliases" in text for text in found.notes)
    # an acceleration alone holds the blow itself, which lies between two readings
    alone = run_of(oscillator(), fi.HammerBlow("tip", 0.1, 1e-3), 20.0, 4e-3, ("tip.acceleration",))
    with pytest.raises(
        fi.InputError,
        match=r"^interval of response\.time = 0\.004 s: must be finer, or the displacement .* aliases spoil all",
    ):
        fi.measured_transfer(alone, "tip.acceleration")


def test_a_relative_acceleration_is_taken_from_what_has_fewer_aliases():
    blow = run_of(oscillator(), fi.HammerBlow("tip", 0.1, 0.02), 20.0, 2e-3)
    assert error_of(blow, "tip.acceleration", force_at="tip").max() < 2e-3
    chirp = run_of(oscillator(), fi.Chirp(1.0, 20.0, 10.0, acceleration=2.0), 25.0, 0.01)
    assert error_of(chirp, "tip.acceleration").max() < 5e-3


def test_a_recorded_input_is_read_at_its_samples():
    run = run_of(oscillator(), fi.Chirp(2.0, 30.0, 10.0, acceleration=2.0), 25.0)
    found = fi.measured_transfer(run, "tip", "tip.velocity")
    assert found.frequency.max() > 20.0
    assert error_of(run, "tip", "tip.velocity").max() < 1e-4
    only = {name: run[name] for name in ("tip.absolute_acceleration", "tip.velocity")}
    both = replace(run, channels=only, units={name: run.units[name] for name in only})
    assert error_of(both, "tip.absolute_acceleration", "tip.velocity").max() < 2e-3


def test_a_record_that_does_not_begin_at_rest_is_refused():
    chirp = fi.Chirp(2.0, 30.0, 10.0, acceleration=2.0)
    late = fi.integrate(oscillator(), chirp, fi.EventDriven(), 25.0, fi.Recorder(NAMES, interval=4e-3, start=2.0))
    with pytest.raises(fi.InputError, match=r"^response\.time = 2\.0 s: must begin with the run, at 0 s"):
        fi.measured_transfer(late, "tip")
    for state in (fi.State([0.02], [0.5]), fi.State([0.0], [0.5])):
        recorder = fi.Recorder(NAMES, interval=4e-3)
        run = fi.integrate(oscillator(), chirp, fi.EventDriven(), 25.0, recorder, initial=state)
        with pytest.raises(fi.InputError, match=r"^response\.time = 0\.0 s: must begin at rest, and .* begins at"):
            fi.measured_transfer(run, "tip")


def test_an_input_that_is_zero_is_refused():
    still = run_of(oscillator(), fi.Sine(0.0, 4.0), 10.0)
    for run, of in ((still, None), (still, "tip"), (run_of(oscillator(), fi.HammerBlow("tip", 0.0, 0.01), 9.0), None)):
        with pytest.raises(fi.InputError, match=r"^of: must not be zero"):
            fi.measured_transfer(run, "tip", of)


def test_a_record_that_has_not_decayed_is_refused_with_the_time_it_takes():
    chirp = fi.Chirp(2.0, 30.0, 10.0, acceleration=2.0)
    with pytest.raises(fi.InputError, match=r"must end when tip is at 0\.1 % .* takes (\S+) s more") as refusal:
        fi.measured_transfer(run_of(oscillator(), chirp, 11.0), "tip")
    assert "\n" not in str(refusal.value)
    more = float(str(refusal.value).split("takes ")[1].split(" s")[0])
    fi.measured_transfer(run_of(oscillator(), chirp, 11.0 + 1.2 * more), "tip")
    with pytest.raises(fi.InputError, match=r"must hold all of the drive, 0 to 10 s, and the decay after it$"):
        fi.measured_transfer(run_of(oscillator(), chirp, 5.0), "tip")


def test_dwells_of_a_stepped_sine_are_the_closed_form():
    drive = fi.SteppedSine([4.0, 4.9, 6.0], 200, amplitude=1e-3, direction="both")
    run = run_of(oscillator(), drive, drive.duration, 2e-3)
    found = fi.measured_transfer(run, "tip", "base.displacement")
    np.testing.assert_array_equal(found.frequency, [4.0, 4.9, 6.0, 4.9, 4.0])
    exact = fi.transfer_function(oscillator(), found.frequency, "tip", "base.displacement")["tip"]
    # the transient decays by exp(-0.02 2 pi 5 100/6) = 3e-5 before the half that is read
    np.testing.assert_allclose(found["tip"], exact, rtol=1e-3)
    assert np.all(found.coherence["tip"] > 1.0 - 1e-6)
    short = fi.SteppedSine([4.0, 4.9, 6.0], 8, amplitude=1e-3)
    (text,) = fi.measured_transfer(run_of(oscillator(), short, short.duration, 2e-3), "tip").warnings
    assert "dwells are not steady" in text


def test_a_sine_is_one_dwell():
    found = fi.measured_transfer(run_of(oscillator(), fi.Sine(1e-3, 4.0), 60.0), "tip", "base.velocity")
    exact = fi.transfer_function(oscillator(), 4.0, "tip", "base.velocity")["tip"]
    np.testing.assert_allclose(found["tip"], exact, rtol=1e-9)


# ---- shock response spectra ---------------------------------------------------------------------------------------

PULSE = 0.011


def half_sine(frequency: float, ratio: float) -> np.ndarray:
    """Both sides of the absolute acceleration and of omega^2 times the displacement, of a half-sine of 1 m/s^2.

    x'' + 2 ratio w x' + w^2 x = -sin(p t) in closed form during the pulse and after it; extremes by bisection.
    """
    w, p = 2 * math.pi * frequency, math.pi / PULSE
    forced, rate = -1.0 / (w**2 - p**2 + 2j * ratio * w * p), w * complex(-ratio, math.sqrt(1.0 - ratio**2))

    def free(x: float, v: float) -> complex:
        return x - 1j * (v + ratio * w * x) / rate.imag

    first = free(-forced.imag, -(1j * p * forced).imag)

    def during(t: np.ndarray, n: int) -> np.ndarray:
        return ((1j * p) ** n * forced * np.exp(1j * p * t)).imag + (rate**n * first * np.exp(rate * t)).real

    second = free(*(float(during(np.array(PULSE), n)) for n in (0, 1)))

    def after(t: np.ndarray, n: int) -> np.ndarray:
        return (rate**n * second * np.exp(rate * t)).real

    sides = []
    for damping in (2.0 * ratio * w, 0.0):
        found = [np.zeros(1)]
        for x, end in ((during, PULSE), (after, 1.5 / frequency)):

            def slope(t: np.ndarray, n: int = 1, x=x, damping=damping) -> np.ndarray:
                return -damping * x(t, n + 1) - w**2 * x(t, n)

            t = np.linspace(0.0, end, int(400 * (frequency * end + 4)))
            turns = np.flatnonzero(slope(t)[:-1] * slope(t)[1:] <= 0.0)
            low, high = t[turns], t[turns + 1]
            for _ in range(50):
                middle = 0.5 * (low + high)
                same = slope(middle) * slope(low) > 0.0
                low, high = np.where(same, middle, low), np.where(same, high, middle)
            found.append(slope(np.concatenate([low, [0.0, end]]), 0))
        values = np.concatenate(found)
        sides += [values.max(), -values.min()]
    return np.array(sides)


@pytest.mark.parametrize("ratio", [0.0, 0.05])
def test_a_half_sine_has_its_closed_form(ratio):
    f = np.array([5.0, 20.0, 60.0, 100.0, 300.0, 48 / PULSE, 60 / PULSE, 80 / PULSE, 96 / PULSE])
    found = fi.shock_response_spectrum(fi.Shock("half-sine", 30 * G, PULSE), f, ratio)
    exact = 30 * G * np.array([half_sine(one, ratio) for one in f]).T
    both = (found.positive_acceleration, found.negative_acceleration, 2 * np.pi * f * found.positive_pseudo_velocity,
            2 * np.pi * f * found.negative_pseudo_velocity)  # fmt: skip
    for values, side, other in zip(both, exact, exact[[1, 0, 3, 2]], strict=True):
        # of the larger side: 20 polynomials are within 2e-11 of the pulse, and what is left after it is a difference
        assert np.all(np.abs(values - side) < 1e-9 * np.maximum(side, other))
    np.testing.assert_allclose(found.acceleration, exact[:2].max(axis=0), rtol=1e-9)


def test_a_ratio_of_almost_one_is_that_of_a_little_less():
    shock = fi.Shock("half-sine", 30 * G, PULSE)
    found, less = (fi.shock_response_spectrum(shock, [20.0, 300.0], ratio) for ratio in (1.0 - 1e-16, 1.0 - 1e-7))
    # the ratio itself changes by 1e-7
    np.testing.assert_allclose(found.pseudo_velocity, less.pseudo_velocity, rtol=1e-6)
    np.testing.assert_allclose(found.acceleration, less.acceleration, rtol=1e-6)


def test_frequencies_above_what_samples_show_are_warned_of():
    record = fi.RecordedBase(np.sin(0.1 * np.arange(200)), 1e-3)
    (text,) = fi.shock_response_spectrum(record, [20.0, 150.0, 300.0]).warnings
    assert text.startswith("above 100 Hz, a tenth of the sampling rate")
    assert "above 100 Hz" in fi.shock_response_spectrum(record, [150.0]).to_xarray().attrs["warnings"]
    assert not fi.shock_response_spectrum(record, [20.0]).warnings
    run = run_of(oscillator(), fi.Shock("half-sine", 1.0, PULSE), 1.0, 1e-3)
    assert fi.shock_response_spectrum(run, [150.0], channel="tip.velocity").warnings


def test_a_steady_sine_tends_to_the_transmissibility():
    sine = fi.Sine(1e-3, 4.0)
    found = fi.shock_response_spectrum(sine, [NATURAL], RATIO, duration=20.0)
    exact = abs(fi.transfer_function(oscillator(), 4.0)["tip.absolute_acceleration"][0])
    # the largest value from rest is that of the transient and the steady motion, at most twice the latter
    assert 1.0 < found.acceleration[0] / (1e-3 * (8 * math.pi) ** 2 * exact) < 2.0
    with pytest.raises(fi.InputError, match=r"^duration: must be given: base at 4 Hz does not end by itself$"):
        fi.shock_response_spectrum(sine, [5.0])
    two = sine + fi.Sine(1e-3, 5.0)
    with pytest.raises(fi.InputError, match=r"^duration: must be given"):
        fi.shock_response_spectrum(two, [5.0])
    assert fi.shock_response_spectrum(two, [5.0], duration=1.0).acceleration[0] > 0.0


def test_a_record_and_a_channel_have_that_of_their_broken_line():
    shock = fi.Shock("trapezoid", 10 * G, PULSE)
    f, h = np.array([10.0, 50.0]), PULSE / 110
    exact = fi.shock_response_spectrum(shock, f, 0.05)
    samples = shock.acceleration(h * np.arange(300))
    # the corners of a trapezoid lie on samples, and its end falls to 0 there
    by_record = fi.shock_response_spectrum(fi.RecordedBase(samples, h), f, 0.05)
    np.testing.assert_allclose(by_record.acceleration, exact.acceleration, rtol=1e-6)
    # a mass that hardly moves relative to the base reads the base
    stiff = fi.System.from_matrices([[1.0]], [[2 * 0.7 * 3e4]], [[9e8]], points={"tip": [1.0]})
    run = run_of(stiff, shock, 300 * h, h, ("tip.absolute_acceleration", "tip.velocity", "tip"))
    for channel in ("tip.absolute_acceleration", "tip.velocity"):
        found = fi.shock_response_spectrum(run, f, 0.05, channel=channel)
        assert found.of.startswith("tip.absolute_")
        np.testing.assert_allclose(found.acceleration, exact.acceleration, rtol=0.01)
    with pytest.raises(fi.InputError, match=r"^channel = 'tip' m: must be an acceleration or a velocity$"):
        fi.shock_response_spectrum(run, f, channel="tip")


def test_datasets_have_units():
    run = random_run()
    density = fi.spectrum(run, "tip.acceleration").to_xarray()
    assert {name: one.attrs["units"] for name, one in density.data_vars.items()} == dict.fromkeys(
        ("density", "low", "high"), "(m/s^2)^2/Hz"
    )
    shock = fi.shock_response_spectrum(fi.Shock("half-sine", 1.0, PULSE), [5.0, 6.0]).to_xarray()
    assert shock["pseudo_velocity"].attrs["units"] == "m/s"
    assert shock["frequency"].attrs["units"] == "Hz"
    measured = fi.measured_transfer(run, "tip").to_xarray()
    assert set(measured.data_vars) == {"tip", "tip H2", "tip coherence"}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: fi.spectrum(random_run(), "tp"), "^channel = 'tp'"),
        (lambda: fi.spectrum(random_run(), "tip", "power"), "^kind = 'power': must be 'density' or 'amplitude'"),
        (lambda: fi.spectrum(random_run(), "tip", resolution=1e-3), r"^resolution = 0\.001 Hz: must be 0\.0167 Hz"),
        (lambda: fi.spectrum(random_run(), "tip", resolution=-1.0), r"^resolution = -1\.0 Hz: must be"),
        (lambda: fi.spectrum(random_run(), "tip", confidence=1.0), r"^confidence = 1\.0: must be"),
        (lambda: fi.spectrum(random_run(), "tip", start=59.99), "^response.time = 3 samples: must be 16 or more"),
        (lambda: fi.spectrum(3, "tip"), "^response = 3: must be a Response"),
        (lambda: fi.measured_transfer(random_run(), "tip", "force"), "^of = 'force': must be a motion of the base"),
        (lambda: fi.measured_transfer(random_run(), "tip", "tp"), "^of = 'tp'"),
        (lambda: fi.spectrum(random_run(), "tip", "amplitude", resolution=1.0), r"^resolution = 1\.0 Hz: must be left"),
        (lambda: fi.spectrum(random_run(), "tip", "amplitude", confidence=0.9), r"^confidence = 0\.9: must be left"),
        (lambda: fi.measured_transfer(run_of(oscillator(), fi.Chirp(2.0, 9.0, 5.0, acceleration=1.0), 20.0), "tip",
                                      resolution=1.0), r"^resolution = 1\.0 Hz: must be left out"),
        (lambda: fi.measured_transfer(random_run(), "tip", resolution=0.017), "^resolution = 0.017 Hz: must leave two"),
        (lambda: fi.shock_response_spectrum(fi.Shock("half-sine", 1.0, 0.01), [0.0]), r"^frequency = 0\.0 Hz"),
        (lambda: fi.shock_response_spectrum(fi.Shock("half-sine", 1.0, 0.01), [1.0], 1.0), r"^ratio = 1\.0: must"),
        (lambda: fi.shock_response_spectrum(fi.HammerBlow("tip", 1.0, 0.01), [1.0]), "^of = .*HammerBlow.*is a force"),
        (lambda: fi.shock_response_spectrum(3, [1.0]), "^of = 'int': must be a Sine"),
        (lambda: fi.shock_response_spectrum(fi.Shock("half-sine", 1.0, 0.01), [1.0], channel="a"), "^channel = .a."),
    ],
)  # fmt: skip
def test_what_is_damaged_is_refused_in_one_line(call, words):
    with pytest.raises(fi.InputError, match=words) as refusal:
        call()
    assert "\n" not in str(refusal.value)


def test_uneven_samples_are_refused():
    run = random_run()
    time = run.time.copy()
    time[5] += 1e-3
    with pytest.raises(fi.InputError, match=r"^response\.time: must be evenly spaced"):
        fi.spectrum(replace(run, time=time, energy=None), "tip")


def test_a_beam_is_read_as_an_oscillator_is():
    bare = fi.reduce(fi.assemble(fi.Structure(STRUCTURE.beam, damping=STRUCTURE.damping), 4), 2)
    run = run_of(bare, fi.Chirp(5.0, 60.0, 5.0, acceleration=1.0), 25.0, 2e-3, ("root.surface_stress",))
    found = fi.measured_transfer(run, "root.surface_stress")
    exact = fi.transfer_function(bare, found.frequency, "root.surface_stress")
    assert found.units == exact.units == {"root.surface_stress": "Pa/(m/s^2)"}
    error = np.abs(found["root.surface_stress"] - exact["root.surface_stress"])
    assert error.max() < 1e-3 * np.abs(exact["root.surface_stress"]).max()
