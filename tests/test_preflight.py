"""What `preflight` says of a planned test is what a run of it shows: swept peaks, the first contact, drift, the rms."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import REFERENCE, ParameterPlan, cantilever, oscillator, paper_study, read_study, reduced, with_ball
from scipy.integrate import quad

import femimpact as fi
from femimpact.app.demo import paper_study_text
from femimpact.app.planned_test import lines_of_check
from femimpact.app.study.parameter_plan import AxisValues
from femimpact.integrators.planned_drive import contact_notes, largest_motion, plan_notes, swept_envelope, swept_peak

pytestmark = pytest.mark.impacts

SPACE = fi.State.at_rest("space")


def row(found: fi.app.Preflight, words: str) -> fi.integrators.PreflightRow:
    """The only row whose name has these words."""
    (one,) = (each for each in found.rows if words in each.what)
    return one


def words(found: fi.app.Preflight) -> str:
    """Names of the rows whose limit is passed."""
    return "; ".join(each.what for each in found.passed)


# ---- the rate of a sweep -------------------------------------------------------------------------


@pytest.mark.parametrize(("b", "peak"), [(0.2, 0.99), (1.0, 0.90), (2.0, 0.82), (22.0, 0.44)])
def test_the_swept_peak_is_the_known_one(b: float, peak: float) -> None:
    assert swept_peak(b) == pytest.approx(peak, abs=0.005)


@pytest.mark.parametrize("b", [0.05, 1.0, 22.0])
@pytest.mark.parametrize("tau", [-1.0, 0.0, 2.0])
def test_the_envelope_is_its_integral(b: float, tau: float) -> None:
    parts = [
        quad(lambda u, of=of: np.exp(-u) * of(0.5 * b * (tau - u) ** 2), 0.0, 40.0, limit=2000)[0]
        for of in (np.cos, np.sin)
    ]
    # 40 decay times leave e^-40
    assert swept_envelope(b, np.array([tau]))[0] == pytest.approx(np.hypot(*parts), rel=1e-7)


@pytest.mark.parametrize("kind", ["linear", "logarithmic"])
def test_the_swept_peak_is_that_of_a_run(kind: str) -> None:
    # a force of constant amplitude: the steady peak at resonance is F/(2 zeta k)
    omega, ratio = 2.0 * np.pi * 5.0, 0.01
    system = oscillator(omega**2, 2.0 * ratio * omega)
    chirp = fi.Chirp(4.0, 6.0, 60.0, amplitude=1e-3, kind=kind)
    run = fi.integrate(system, fi.PointForce("mass", chirp), fi.EventDriven(), 60.0)
    share = abs(run.largest("mass").value) * 2.0 * ratio * omega**2 / 1e-3
    found = row(fi.preflight(system, chirp), "sweep rate")
    # the envelope neglects terms of the relative order zeta
    assert share == pytest.approx(swept_peak(found.value), rel=0.02)
    assert found.passed
    # the rate in the unit of the plan: an octave is a factor of 2
    rate = float(found.instead.split("take ")[1].split()[0])
    unit, given = ("oct/min", 60.0 * np.log2(6.0 / 4.0) / 60.0) if kind == "logarithmic" else ("Hz/s", 2.0 / 60.0)
    assert f"at {given:.3g} {unit}" in found.instead
    # b goes with the rate, and 0.1 is advised, rounded down to two digits
    assert rate == pytest.approx(given * 0.1 / found.value, rel=0.1)
    assert rate <= given * 0.1 / found.value


def test_the_advised_duration_keeps_the_limit() -> None:
    system = reduced(replace(REFERENCE, damping=fi.Rayleigh(ratio=0.03, modes=(1, 2))), 2)
    found = row(fi.preflight(system, fi.Chirp(4.0, 6.0, 10.0, amplitude=1e-5)), "sweep rate")
    assert found.passed
    advised = float(found.instead.split("duration = ")[1].split()[0])
    slow = row(fi.preflight(system, fi.Chirp(4.0, 6.0, advised, amplitude=1e-5)), "sweep rate")
    assert slow.value <= 0.1
    assert slow.instead == ""


# ---- the ball --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "drive",
    [
        fi.Sine(2e-5, 5.3),
        fi.Sine(2e-4, 4.6, phase=1.0),
        fi.Chirp(4.0, 6.0, 8.0, amplitude=1e-4),
        fi.Shock("half-sine", 3.0, 0.05),
        fi.RandomBase([[3.0, 0.01], [20.0, 0.01]], 8.0, seed=3),
    ],
)
def test_a_ball_moves_where_its_gap_is_below_the_named_displacement(drive: object) -> None:
    system = cantilever(fi.Rigid(0.6))
    system = fi.reduce(system, 3)
    found = row(fi.preflight(system, drive, duration=8.0, initial=SPACE), "beside its gap")
    for share, moves in ((0.98, True), (1.02, False)):
        gap = share * found.value
        pairs = tuple(replace(pair, gaps=(gap, gap)) for pair in system.contacts)
        run = fi.integrate(replace(system, contacts=pairs), drive, fi.EventDriven(), 8.0, initial=SPACE)
        assert (run.impacts.time.size > 0) is moves


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_nearer_of_two_walls_decides(sign: float) -> None:
    # half a cycle of 2 mm to one side on a stiff support: the ball at rest nears the wall on the other side of the box
    ball = fi.Impactor("ball", "mass", 1e-3, (3e-3, 1e-3), fi.Rigid(0.6))
    system = oscillator((2.0 * np.pi * 50.0) ** 2, 2.0 * np.pi * 50.0, impactors=[ball])
    drive = fi.Sine(2e-3, 1.0, phase=0.0 if sign > 0.0 else np.pi)
    found = row(fi.preflight(system, drive, duration=0.5, initial=SPACE), "beside its gap")
    # x = y - b u goes to - where the base goes to +, and 1 mm is there
    assert found.limit == (1e-3 if sign > 0.0 else 3e-3)
    assert found.passed is (sign < 0.0)


def test_only_a_start_at_rest_in_space_has_a_row_of_the_ball() -> None:
    system, drive = reduced(REFERENCE, 3), fi.Sine(1e-6, 5.3)
    assert "beside its gap" in words(fi.preflight(system, drive, duration=10.0, initial=SPACE))
    assert "beside its gap" not in str(fi.preflight(system, drive, duration=10.0))


def test_the_first_gap_is_that_of_two_impacts_that_take_up_the_drive() -> None:
    # a mass M on a spring: phi = 1/sqrt(M) and Gamma = sqrt(M) give d = pi^2 M ub/(8 m)
    ball = fi.Impactor("ball", "mass", 0.02, 1e-3, fi.Rigid(0.6))
    system = oscillator((2.0 * np.pi * 5.0) ** 2, 0.1, impactors=[ball])
    found = row(fi.preflight(system, fi.Sine(2e-4, 4.0)), "first gap to try")
    assert found.value == pytest.approx(np.pi**2 * 2e-4 / (8.0 * 0.02), rel=1e-12)
    assert "restitution" in found.what
    # beside it stands the gap that the ball has
    assert "first gap to try of ball, which has 1 mm: " in found.what
    uneven = oscillator((2.0 * np.pi * 5.0) ** 2, 0.1, impactors=[replace(ball, gap=(1e-3, 2e-3))])
    assert "of ball, which has (1, 2) mm: " in row(fi.preflight(uneven, fi.Sine(2e-4, 4.0)), "first gap to try").what
    assert not found.passed


def test_the_first_gap_is_of_the_mode_nearest_to_the_drive() -> None:
    # steady impacts at the amplitude 0 of the mode: the ball crosses 2 d in half a cycle, at a speed v of 4 d f; its
    # impulse m 2 v at the mode, phi, is what the base puts into it in half a cycle at resonance, pi/2 Gamma ub omega
    system = reduced(REFERENCE, 3)
    modes = fi.solve_modes(system, 3)
    for k in range(2):
        f = float(modes.natural_frequency[k])
        found = row(fi.preflight(system, fi.Sine(1e-4, 1.01 * f)), f"mode {k + 1}")
        impulse = 2.0 * system.contacts[0].mass * 4.0 * found.value * f
        phi = abs(system.contacts[0].direction @ modes.vectors[:, k])
        taken = 0.5 * np.pi * abs(modes.participation_factor[k]) * 1e-4 * 2.0 * np.pi * f
        assert phi * impulse == pytest.approx(taken, rel=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"free_stiffness": 1.0}, {"acceleration": 9.81}, {"free_damping": 0.1}, {"mass": 1e-30},
    ],
)  # fmt: skip
def test_a_ball_that_is_not_free_has_no_first_gap(change: dict[str, float]) -> None:
    ball = replace(REFERENCE.impactors[0], **change)
    found = fi.preflight(reduced(replace(REFERENCE, impactors=(ball,)), 3), fi.Sine(1e-4, 5.3))
    assert "first gap" not in str(found)


# ---- the base --------------------------------------------------------------------------------------


def test_the_shaker_of_a_sine_is_exact() -> None:
    sine = fi.Sine(2e-3, 20.0)
    found = fi.preflight(reduced(REFERENCE, 3), sine)
    sizes = [each.value for each in found.rows if "of the base" in each.what]
    omega = 40.0 * np.pi
    np.testing.assert_allclose(sizes, [2e-3, 2e-3 * omega, 2e-3 * omega**2, 2e-3 * omega**2 / 9.80665], rtol=1e-14)


SHAPES = ("half-sine", "haversine", "triangle", "rectangle", "terminal-sawtooth", "initial-sawtooth", "trapezoid")


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("compensation", ["after", "before"])
def test_the_largest_acceleration_of_a_shock_is_its_level(kind, compensation):
    # of a saw-tooth at its last instant, from before the jump; the compensation is far below
    shock = fi.Shock(kind, -30.0, 0.011, True, compensation, delay=0.05)
    found = fi.preflight(reduced(REFERENCE, 3), shock, duration=1.0)
    (value,) = (each.value for each in found.rows if "acceleration of the base" in each.what and each.unit == "m/s^2")
    # the polynomials of a half-sine and a haversine are within 1e-9 of it
    assert value == pytest.approx(30.0, rel=2e-9)


def test_the_largest_motion_of_a_pulse_is_that_of_its_integrals():
    # a half-sine moves the base by a d^2/pi in its duration, and on with 2 a d/pi after it
    a, d = 30.0, 0.011
    place, speed, _ = largest_motion(fi.Shock("half-sine", a, d), 1.0)
    assert speed == pytest.approx(2.0 * a * d / np.pi, rel=1e-8)
    assert place == pytest.approx(a * d**2 / np.pi + speed * (1.0 - d), rel=1e-8)


def test_the_largest_motion_ends_with_the_run():
    shock = fi.Shock("terminal-sawtooth", 30.0, 0.01)
    # half of the ramp: half the level, a quarter of the velocity
    _, speed, acceleration = largest_motion(shock, 0.005)
    assert acceleration == pytest.approx(15.0, rel=1e-12)
    assert speed == pytest.approx(30.0 * 0.01 / 8.0, rel=1e-12)


def test_pulses_that_carry_the_base_away_have_one_displacement_and_the_cure():
    bumps = fi.Shock("half-sine", 400.0, 0.006, pulses=10, period=0.5)
    found = row(fi.preflight(reduced(REFERENCE, 3), bumps, duration=5.5), "largest displacement")
    assert found.passed
    assert "compensated = true" in found.instead
    assert "moves by up to" not in found.instead
    mended = row(fi.preflight(reduced(REFERENCE, 3), replace(bumps, compensated=True), duration=5.5), "displacement of")
    assert not mended.passed


def test_dwells_beside_the_resonance_pass_no_limit():
    system = reduced(replace(REFERENCE, damping=fi.Rayleigh(ratio=0.05, modes=(1, 2))), 3)
    dwells = fi.SteppedSine([20.0, 25.0, 31.5], 100, amplitude=1e-6)
    found = row(fi.preflight(system, dwells), "within the sweep")
    assert (found.value, found.passed) == (0.0, False)
    # a sweep is one over a resonance
    assert row(fi.preflight(system, frequencies=[20.0, 25.0, 31.5]), "within the sweep").passed


def test_a_drift_is_named_with_its_size_and_a_fast_motion_is_not() -> None:
    t = np.arange(12_000) / 400.0
    fast, slow = 2e-4 * np.sin(2.0 * np.pi * 5.0 * t), 2.5e-3 * (1.0 - np.cos(2.0 * np.pi * t / 30.0)) / 2.0
    system = reduced(REFERENCE, 3)
    for place, drifts in ((fast, False), (fast + slow, True)):
        found = row(fi.preflight(system, fi.RecordedBase.from_displacement(place, 1 / 400.0)), "drift")
        assert found.passed is drifts
    # the half cosine is a line of 1/30 Hz, which the filter lets through
    assert found.value == pytest.approx(2.5e-3, rel=0.1)


@pytest.mark.parametrize("highest", [60.0, 190.0])
def test_the_lowest_content_of_a_broad_record_is_no_drift_and_what_is_added_below_is(highest: float) -> None:
    system, interval, count = reduced(REFERENCE, 3), 1.0 / 400.0, 12_000
    frequency, rng = np.fft.rfftfreq(count, interval), np.random.default_rng(1)
    lines = np.exp(2j * np.pi * rng.random(frequency.size)) * ((frequency >= 2.0) & (frequency <= highest))
    # a flat density of accelerations, as a displacement whose lowest lines are the largest
    place = np.fft.irfft(lines / np.maximum(2.0 * np.pi * frequency, 1.0) ** 2, count)
    place *= 3e-3 / np.abs(place).max()
    slow = 2e-3 * np.sin(2.0 * np.pi * 0.2 * interval * np.arange(count))
    for motion, drifts in ((place, False), (place + slow, True)):
        found = row(fi.preflight(system, fi.RecordedBase.from_displacement(motion, interval)), "drift")
        assert found.passed is drifts
        assert 0.9 <= float(found.what.partition("below ")[2].split()[0]) <= 1.1


def test_the_standard_error_of_an_rms_is_the_scatter_of_whole_runs() -> None:
    system = fi.System.from_matrices([[1.0]], [[2.0]], [[(2.0 * np.pi * 8.0) ** 2]], points={"mass": [1.0]})
    drives = [fi.RandomBase([[3.0, 1.0], [20.0, 1.0]], 40.0, seed=i, amplitudes="random") for i in range(150)]
    rms = [run["mass"].std() for run in fi.integrate(system, drives, fi.EventDriven(), 40.0)]
    said = row(fi.preflight(system, drives[0]), "standard error of the rms").value
    assert said == pytest.approx(0.5 / np.sqrt(40.0))
    # the scatter of 150 is known to 6 %; of a third of the run it would be 1.73 times as large
    assert np.std(rms) / np.mean(rms) == pytest.approx(said, rel=0.25)


# ---- twenty tests that cannot show what they are made for ------------------------------------------

SLACK = replace(REFERENCE, damping=fi.Rayleigh(ratio=0.29, modes=(1, 2)))
GRID = np.linspace(4.0, 6.0, 21)


def changed_beam(**values: float) -> fi.Structure:
    """The reference structure with another material."""
    return replace(REFERENCE, beam=fi.Beam((replace(REFERENCE.beam.segments[0], **values),)))


def with_contact_time(seconds: float) -> fi.System:
    """The reference system with another contact."""
    return of_law(fi.KelvinVoigt(restitution=0.6, contact_time=seconds))


def of_law(law) -> fi.System:
    ball = replace(REFERENCE.impactors[0], contact=law)
    return reduced(replace(REFERENCE, impactors=(ball,)), 3)


USELESS = {
    "a fast linear chirp": (fi.Chirp(4.0, 6.0, 60.0, amplitude=1e-5), {}, "sweep rate"),
    "a fast logarithmic chirp": (
        fi.Chirp(4.0, 6.0, acceleration=0.1, kind="logarithmic", octaves_per_minute=1.0), {}, "sweep rate"
    ),
    "a chirp downwards": (fi.Chirp(6.0, 4.0, 60.0, amplitude=1e-5), {}, "sweep rate"),
    "a chirp beside the resonance": (fi.Chirp(8.0, 20.0, 60.0, amplitude=1e-5), {}, "chirp passes"),
    "a level that moves no ball": (fi.Sine(1e-6, 5.3), {"duration": 60.0, "initial": SPACE}, "beside its gap"),
    "a frequency that moves no ball": (fi.Sine(1e-4, 2.0), {"duration": 60.0, "initial": SPACE}, "beside its gap"),
    "a short run": (fi.Sine(1e-4, 5.3), {"duration": 10.0}, "transient"),
    "a short dwell": (None, {"frequencies": GRID, "cycles": 60}, "transient"),
    "a coarse grid": (None, {"frequencies": GRID, "cycles": 2000}, "frequency step"),
    "a sweep below the resonance": (None, {"frequencies": np.linspace(2.0, 4.0, 21)}, "within the sweep"),
    "a sweep above the kept modes": (None, {"frequencies": np.linspace(4.0, 900.0, 30000)}, "of the sweep"),
    "a sine above the kept modes": (fi.Sine(1e-6, 900.0), {}, "frequency of the drive"),
    "a chirp above the kept modes": (fi.Chirp(4.0, 2000.0, 1.0, acceleration=0.1), {}, "time of the chirp"),
    "a random motion above the kept modes": (
        fi.RandomBase([[100.0, 1e-3], [2000.0, 1e-3]], 2.0), {}, "mean square of the random"
    ),
    "a short random run": (fi.RandomBase([[3.0, 1e-3], [20.0, 1e-3]], 60.0), {}, "standard error"),
    "a damping ratio in per cent": (None, {"structure": SLACK}, "damping.ratio"),
    "a modulus in GPa": (None, {"structure": changed_beam(young_modulus=70.0)}, "Young's modulus"),
    "a modulus in MPa": (None, {"structure": changed_beam(young_modulus=70e3)}, "Young's modulus"),
    "a density in g/cm^3": (None, {"structure": changed_beam(density=2.7)}, "density"),
    "a gap in mm": (None, {"structure": with_ball(REFERENCE, gap=4.0)}, "impactor.ball.gap"),
    "a ball in g": (None, {"structure": with_ball(REFERENCE, mass=3.4)}, "impactor.ball.mass"),
    "a thickness in cm": (None, {"structure": changed_beam(thickness=0.1)}, "beam.length"),
    "an amplitude in mm": (fi.Sine(0.2, 5.0), {}, "largest displacement of the base"),
    "short steps": (fi.SteppedSine(GRID, 60, amplitude=1e-5), {}, "transient"),
    "coarse steps": (fi.SteppedSine(GRID, 600, amplitude=1e-5), {}, "frequency step"),
    "a coarse record": (fi.RecordedBase(0.1 * np.cos(np.arange(400.0)), 0.05), {"duration": 19.0}, "of the record, 0"),
}  # fmt: skip


@pytest.mark.parametrize("name", USELESS)
def test_a_useless_test_is_named(name: str) -> None:
    drive, more, what = USELESS[name]
    found = [each for each in fi.preflight(reduced(REFERENCE, 3), drive, **more).passed if what in each.what]
    assert len(found) == 1
    assert found[0].instead


def test_of_another_material_nothing_else_is_said():
    soft = changed_beam(young_modulus=70.0)
    with pytest.warns(fi.InputWarning, match="is it in Pa|units SI"):
        system = reduced(soft, 3)
    found = fi.preflight(system, fi.Sine(1e-4, 5.0), structure=soft, duration=60.0)
    assert [each.what for each in found.passed] == ["Young's modulus of segment 'beam'"]


@pytest.mark.parametrize("gaps", [(1.0, 1.0), (1.0, np.inf), (np.inf, 1.0)])
def test_a_stop_that_is_not_met_is_named_with_a_gap_and_a_level_that_are(gaps):
    def planned(gap, level=1.0):
        stop = fi.Stop("stop", "tip", tuple(gap * np.array(gaps)), fi.Rigid(0.5), fixed_to="space")
        system = reduced(replace(REFERENCE, impactors=(), stops=(stop,)), 3)
        drive = fi.Sine(2e-5 * level, 4.6)
        met = fi.integrate(system, drive, fi.EventDriven(), 20.0).impacts.time.size > 0
        return met, row(fi.preflight(system, drive, duration=20.0), "beside its gap")

    met, found = planned(0.02)
    assert (met, found.passed) == (False, True)
    gap = float(found.instead.split("at most ")[1].split()[0])
    level = float(found.instead.split("a drive ")[1].split()[0])
    for met, mended in (planned(gap), planned(0.02, level)):
        assert (met, mended.passed) == (True, False)


def test_the_named_gap_dwell_drive_and_high_pass_keep_their_limits():
    system = reduced(REFERENCE, 3)
    # two digits of 4.596e-5 rounded to the nearest would be above it
    found = row(fi.preflight(system, fi.Sine(5e-6, 4.4), duration=60.0, initial=SPACE), "beside its gap")
    assert float(found.instead.split("at most ")[1].split()[0]) <= found.value
    cycles = int(row(fi.preflight(system, frequencies=GRID, cycles=60), "transient").instead.split("cycles = ")[1])
    assert not row(fi.preflight(system, frequencies=GRID, cycles=cycles), "transient").passed
    short = row(fi.preflight(system, fi.Sine(1e-4, 5.3), duration=10.0), "transient")
    duration = float(short.instead.split("duration = ")[1].split()[0])
    assert not row(fi.preflight(system, fi.Sine(1e-4, 5.3), duration=duration), "transient").passed
    bare = reduced(replace(REFERENCE, impactors=()), 3)
    large = row(fi.preflight(bare, fi.Sine(2e-3, 5.3), duration=60.0), "deflection")
    share = float(large.instead.split("at most ")[1].split()[0])
    assert not row(fi.preflight(bare, fi.Sine(2e-3 * share, 5.3), duration=60.0), "deflection").passed
    # a sine of the acceleration from rest moves on; the line of least squares of an oscillation is not zero
    t = np.arange(8000) / 200.0
    record = fi.RecordedBase(np.sin(2.0 * np.pi * 4.4 * t) + 0.02, 1 / 200.0)
    drift = row(fi.preflight(system, record), "drift")
    high_pass = float(drift.instead.split("high_pass = ")[1].split(")")[0])
    mended = fi.RecordedBase.from_displacement(record.displacement(t), 1 / 200.0, high_pass=high_pass)
    assert drift.passed
    assert not row(fi.preflight(system, mended), "drift").passed


@pytest.mark.parametrize("frequency", [4.4, 5.25])
@pytest.mark.parametrize("interval", [0.1, 0.03])
def test_the_named_interval_of_a_record_is_short_enough(frequency, interval):
    def planned(step):
        record = fi.RecordedBase(0.1 * np.cos(2.0 * np.pi * frequency * np.arange(0.0, 31.0, step)), step)
        return row(fi.preflight(reduced(REFERENCE, 3), record, duration=30.0), "samples of the record")

    found = planned(interval)
    assert found.passed
    assert not planned(float(found.instead.split("every ")[1].split()[0])).passed


T_RECORD = 0.005 * np.arange(13_334)

SOUND = {
    "a sine": (fi.Sine(2e-4, 5.2), {"duration": 120.0, "initial": SPACE}),
    "a sweep": (fi.Sine(1e-4, 5.0), {"frequencies": np.linspace(4.8, 5.6, 201), "cycles": 600}),
    "a shock": (fi.Shock("half-sine", 50.0, 0.011), {"duration": 3.0, "initial": SPACE}),
    "a record": (
        fi.RecordedBase.from_displacement(np.minimum(T_RECORD, 5.0) * 4e-5 * np.sin(31.2 * T_RECORD), 0.005),
        {},
    ),
    "steps": (fi.SteppedSine(np.linspace(5.2, 5.4, 41), 600, amplitude=1e-5), {}),
}


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_test_passes_no_limit(name):
    drive, more = SOUND[name]
    assert fi.preflight(reduced(REFERENCE, 3), drive, structure=REFERENCE, **more).passed == ()


def test_a_contact_in_milliseconds_is_named() -> None:
    assert "contact time of ball" in words(fi.preflight(with_contact_time(0.1)))
    assert fi.preflight(with_contact_time(2e-3)).passed == ()


@pytest.mark.parametrize("balls", [REFERENCE.impactors, ()])
def test_a_large_deflection_is_named_at_the_share_that_a_run_warns_of(balls) -> None:
    system, drive = reduced(replace(REFERENCE, impactors=balls), 3), fi.Sine(2e-4, 5.3)
    found = row(fi.preflight(system, drive, duration=60.0), "largest deflection")
    assert found.passed
    assert "linear beam theory" in found.instead
    bare = fi.integrate(fi.without_impactors(system), drive, fi.EventDriven(), 60.0)
    assert any("linear beam theory" in text for text in bare.warnings)


# ---- a study, a table, bad calls -------------------------------------------------------------------


def test_a_study_has_the_rows_of_its_parts() -> None:
    study = paper_study()
    found = fi.preflight(study)
    assert row(found, "frequency step").value > 0.0
    table = found.to_pandas()
    assert list(table.columns) == ["what", "value", "unit", "limit", "passed", "instead"]
    assert len(table) == len(found.rows)


def test_a_coarse_axis_of_frequencies_is_named_as_a_coarse_sweep_is() -> None:
    system, coarse = reduced(REFERENCE, 3), np.linspace(4.5, 6.0, 16)
    axes = {"impactor.ball.gap": [1e-3, 2e-3], "base.frequency": coarse}
    of_sweep = row(fi.preflight(system, frequencies=coarse), "frequency step")
    plan = fi.app.ParameterStudy(system, axes, ["peak"], excitation=fi.Sine(1e-4, 5.0))
    of_axis = row(fi.preflight(plan), "frequency step of the axis base.frequency")
    assert (of_axis.value, of_axis.limit, of_axis.instead) == (of_sweep.value, of_sweep.limit, of_sweep.instead)
    assert of_axis.passed
    fine = {**axes, "base.frequency": np.arange(4.5, 6.0, 0.99 * of_axis.limit)}
    assert not row(fi.preflight(replace(plan, axes=fine)), "frequency step").passed
    # the cases of a list have the steps of their values, a sample has none
    listed = [{"base.frequency": float(f)} for f in coarse[::-1]]
    assert row(fi.preflight(replace(plan, axes=listed)), "frequency step").value == of_axis.value
    drawn = replace(plan, axes={"base.frequency": {"from": 4.5, "to": 6.0}}, sample={"points": 8})
    assert "frequency step" not in str(fi.preflight(drawn))


def test_the_axis_of_a_study_is_beside_its_sweep() -> None:
    values = AxisValues(tuple(np.linspace(4.5, 6.0, 16).tolist()))
    study = replace(paper_study(), plan=ParameterPlan(("peak",), {"base.frequency": values}))
    names = [each.what for each in fi.preflight(study).passed]
    assert sum("frequency step of the axis base.frequency" in name for name in names) == 1
    # axes given in Python stand for those of the file
    given = fi.app.ParameterStudy(study, {"impactor.ball.gap": [1e-3, 2e-3]}, ["peak"])
    assert "axis base.frequency" not in str(fi.preflight(given))
    bad = replace(study, plan=ParameterPlan(("peak",), {"base.frequency": AxisValues(("a",))}))
    with pytest.raises(fi.InputError, match=r"study\.axes\.base\.frequency"):
        fi.preflight(bad)


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (("beam",), "plan"),
        ((reduced(REFERENCE, 2), fi.Sine(1e-4, 5.0)), None),
        ((reduced(REFERENCE, 2), 5.0), "excitation"),
    ],
)
def test_bad_calls_name_the_argument(arguments: tuple[object, ...], key: str | None) -> None:
    if key is None:
        with pytest.raises(fi.InputError, match="duration"):
            fi.preflight(*arguments, duration=-1.0)
        with pytest.raises(fi.InputError, match="frequencies"):
            fi.preflight(*arguments, frequencies=[0.0, 1.0])
        with pytest.raises(fi.InputError, match="cycles"):
            fi.preflight(*arguments, cycles=0)
        return
    with pytest.raises(fi.InputError, match=key):
        fi.preflight(*arguments)


# ---- what is said before a run is said in it, wherever a drive stands ------------------------------

CALM, CALM_FORCE = fi.Sine(1e-5, 4.4), fi.PointForce("tip", fi.Sine(1e-4, 4.4), name="calm")
PLACES = {
    "alone": lambda drive: drive,
    "in a sum": lambda drive: CALM + drive,
    "beside a force": lambda drive: fi.excitation.Drives(drive, [CALM_FORCE]),
    "as a force": lambda drive: fi.PointForce("tip", drive),
    "in the sum of a force": lambda drive: fi.PointForce("tip", CALM + drive),
    "as one of several forces": lambda drive: fi.excitation.Drives(
        CALM, [CALM_FORCE, fi.PointForce("mid", drive, name="other")]
    ),
}
BAD = {
    "a fast chirp": (fi.Chirp(4.0, 7.0, 4.0, acceleration=1e-2), 4.0, "sweep rate"),
    "a chirp beside the resonance": (fi.Chirp(8.0, 12.0, 4.0, acceleration=1e-2), 4.0, "that the chirp passes"),
    "a chirp that is cut off": (fi.Chirp(4.0, 7.0, 400.0, acceleration=1e-2), 4.0, "that the chirp passes"),
    "coarse steps": (fi.SteppedSine([4.9, 5.2, 5.5], 10, acceleration=1e-2), 6.0, "frequency step"),
    "short steps": (fi.SteppedSine([5.2, 5.4], 10, acceleration=1e-2), 4.0, "of a dwell"),
    "steps short by seconds": (fi.SteppedSine([5.2, 5.4], seconds=2.0, acceleration=1e-2), 4.0, "take seconds = 55"),
    "a short random motion": (fi.RandomBase([[3.0, 1e-5], [8.0, 1e-5]], 4.0), 4.0, "standard error of the rms"),
    "a short sine": (fi.Sine(1e-5, 5.0), 4.0, "transient of the first mode left at 2.67 s"),
    "a sine without a level": (fi.Sine(0.0, 5.0), 4.0, "zero, which moves nothing"),
    "a record without a level": (fi.RecordedBase(np.zeros(80), 0.05), 4.0, "zero, which moves nothing"),
    "a late shock": (fi.Shock("half-sine", 1.0, 0.01, delay=9.0), 4.0, "the run ends at 4 s, before"),
    "a sine above the modes": (fi.Sine(1e-8, 900.0), 0.2, "the drive is at 900 Hz, where no mode is kept"),
    "a random motion above the modes": (
        fi.RandomBase([[500.0, 1e-5], [900.0, 1e-5]], 1.0), 1.0, "mean square of the random motion is above"
    ),
}  # fmt: skip
BARE = fi.without_impactors(reduced(REFERENCE, 3))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", BAD)
def test_a_bad_plan_is_named_before_a_run_and_in_it_wherever_the_drive_stands(name, place):
    drive, duration, said = BAD[name]
    excitation = PLACES[place](drive)
    run = fi.integrate(BARE, excitation, fi.EventDriven(), duration, fi.Recorder(channels=()))
    in_run = "\n".join((*run.warnings, *run.notes))
    assert said in in_run
    assert said in "\n".join(map(str, fi.preflight(BARE, excitation, duration=duration).passed))
    # where there are several the words say which
    parts = {"in a sum": "part 2", "in the sum of a force": "part 2", "as one of several forces": '"other"'}
    transient = name == "a short sine"
    assert transient or parts.get(place, "") in next(line for line in in_run.splitlines() if said in line)


SOUND_DRIVES = {
    "a sine": (fi.Sine(1e-5, 4.5), 60.0),
    "a slow chirp": (fi.Chirp(5.28, 5.32, 300.0, acceleration=1e-3), 300.0),
    "fine and long steps": (fi.SteppedSine([5.294, 5.297, 5.3, 5.303, 5.306], 320, acceleration=1e-3), 302.0),
    "a long random motion": (fi.RandomBase([[5.0, 1e-8], [5.6, 1e-8]], 3200.0), 3200.0),
    "a shock": (fi.Shock("half-sine", 0.01, 0.05), 60.0),
}


@pytest.mark.parametrize("place", ["alone", "in the sum of a force", "as one of several forces"])
@pytest.mark.parametrize("name", ["a sine", "fine and long steps", "a shock"])
def test_nothing_is_said_of_a_sound_plan_wherever_the_drive_stands(name, place):
    drive, duration = SOUND_DRIVES[name]
    scaled = replace(drive, level=1e-4 * drive.level) if hasattr(drive, "level") else replace(drive, amplitude=1e-5)
    excitation = PLACES[place](scaled)
    assert fi.preflight(BARE, excitation, duration=duration).passed == ()
    assert plan_notes(BARE, excitation, duration, fi.State()) == ()


@pytest.mark.parametrize("name", SOUND_DRIVES)
def test_nothing_is_said_of_a_sound_plan(name):
    drive, duration = SOUND_DRIVES[name]
    assert fi.preflight(BARE, drive, duration=duration).passed == ()
    assert plan_notes(BARE, drive, duration, fi.State()) == ()


def test_a_run_that_goes_on_has_no_transient_and_a_free_decay_no_level():
    sine, method, record = fi.Sine(1e-5, 5.0), fi.EventDriven(), fi.Recorder(channels=())
    first = fi.integrate(BARE, sine, method, 4.0, record)
    second = fi.integrate(BARE, sine, method, 4.0, record, first.final_state)
    assert any("transient of the first mode" in text for text in first.notes)
    assert not any("transient of the first mode" in text for text in second.notes)
    free = fi.integrate(BARE, fi.Sine(0.0, 5.0), method, 4.0, record, first.final_state)
    assert not any("moves nothing" in text for text in free.notes)


def test_a_drifting_record_is_named_in_a_run_also_within_a_sum():
    system, at = reduced(REFERENCE, 3), np.arange(0.0, 8.0, 1 / 400.0)
    place = 1e-4 * np.sin(2 * np.pi * 5.0 * at) + 5e-3 * np.sin(2 * np.pi * 0.2 * at)
    record = fi.RecordedBase.from_displacement(place, 1 / 400.0)
    for excitation in (record, CALM + record, fi.excitation.Drives(record, [CALM_FORCE])):
        run = fi.integrate(system, excitation, fi.EventDriven(), 7.9, fi.Recorder(channels=()))
        assert any(text.startswith("drift of the record below 2.5 Hz") for text in run.notes)


def test_a_record_that_begins_in_motion_is_warned_of_where_the_run_begins_at_rest():
    t = 0.005 * np.arange(4001)
    moving = 0.1 * np.sin(2.0 * np.pi * 4.4 * t + 1.0)
    noise = 0.02 * np.random.default_rng(3).standard_normal(t.size)
    record, decay = fi.Recorder(channels=()), 1.0 / (2.0 * np.pi * 5.3 * 0.0029)
    words = f"falls to 37 % every 1/(zeta omega) = {np.ceil(decay):.0f} s"

    def told(samples, start=None):
        base = fi.RecordedBase(samples, 0.005).returning()
        run = fi.integrate(BARE, base, fi.EventDriven(), 2.0, record, start)
        plan = fi.preflight(BARE, base, duration=2.0, initial=start or fi.State())
        said = [text for text in run.warnings if "begins in motion" in text]
        assert [each.instead for each in plan.passed if "begins in motion" in each.instead] == said
        return said

    for samples in (moving, moving + noise, np.random.default_rng(1).standard_normal(t.size)):
        (text,) = told(samples)
        assert words in text
        # a measured start, whatever it is
        assert told(samples, fi.State.of_mode(BARE, 1, 1e-3)) == []
    # from rest, within the noise of the sensor; a shock; one that begins at once; nothing
    assert told(moving * np.clip(t - 0.2, 0.0, 2.0) / 2.0 + 0.1 * noise) == []
    assert told(np.where(t < 0.02, 50.0, 0.0)) == []
    assert told(moving * np.exp(-5.0 * t)) == []
    assert told(np.full(t.size, 0.1)) == []


@pytest.mark.parametrize("line", [3.0, 4.6, 8.0])
def test_the_advised_high_pass_lies_below_the_lines_of_the_record_itself(line):
    system, t = reduced(REFERENCE, 3), np.arange(4000) / 200.0
    place = 0.2e-3 * np.sin(2.0 * np.pi * line * t) + 3e-3 * np.sin(2.0 * np.pi * 0.1 * t)
    found = row(fi.preflight(system, fi.RecordedBase.from_displacement(place, 1 / 200.0)), "drift")
    high_pass = float(found.instead.split("high_pass = ")[1].split(")")[0])
    # half of the line or of the first natural frequency, 5.3 Hz, to two digits and a line of 20 s
    assert 0.45 * min(line, 5.3) < high_pass <= 0.5 * min(line, 5.3)
    # from the first sample, 0, up to 3 mm and down to -3 mm, whatever the ends are
    assert found.value == pytest.approx(3e-3, rel=0.1)
    without = fi.RecordedBase.from_displacement(place, 1 / 200.0, high_pass=high_pass)
    assert not row(fi.preflight(system, without), "drift").passed
    # the line itself stays: from below to above twice its amplitude
    assert np.ptp(without.displacement(t)[1000:3000]) == pytest.approx(0.4e-3, rel=0.05)


def test_long_contacts_preloads_and_percentages_are_named_in_runs_and_curves():
    system = with_contact_time(0.1)
    run = fi.integrate(system, CALM, fi.EventDriven(), 1.0, fi.Recorder(channels=()))
    curve = fi.frequency_sweep(system, 1e-5, [5.0, 5.1], fi.EventDriven(), 3, ledger=False)
    for notes in (run.notes, curve.notes):
        assert any("contact time of ball: 100 ms" in text and "milliseconds" in text for text in notes)
    for law in (fi.KelvinVoigt(stiffness=2.0, restitution=0.5), fi.Hertz(1.0)):
        text = next(words for words in contact_notes(of_law(law)) if "contact time of ball" in words)
        assert "milliseconds" not in text
        # the stiffness that is named fits, and 15 % less does not
        stiffness = float(text.rpartition("stiffness of ")[2].split()[0])
        both = [of_law(replace(law, stiffness=k)) for k in (stiffness, 0.85 * stiffness)]
        assert ["contact time of ball" in str(contact_notes(one)) for one in both] == [False, True]
    pressed = fi.Stop("wall", "tip", (-1e-4, np.inf), fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
    system = reduced(replace(REFERENCE, impactors=(), stops=(pressed,)), 3)
    run = fi.integrate(system, CALM, fi.EventDriven(), 0.2, fi.Recorder(channels=()), fi.State.static())
    assert "wall is in contact at rest, preloaded by 0.1 mm" in run.notes
    for damping in (fi.Rayleigh(ratio=0.29, modes=(1, 2)), fi.ModalDamping((0.0029, 0.29))):
        with pytest.warns(fi.InputWarning, match="damping.ratio = 0.29: .* is it a percentage"):
            fi.assemble(replace(REFERENCE, damping=damping), elements=4)


@pytest.mark.parametrize("key", ["base.parts.2.frequency", "force.coil.frequency"])
def test_a_coarse_axis_of_a_part_or_a_force_is_named_before_a_study_and_by_it(key):
    study = read_study(DRIVEN, Path("study.toml"))
    values = AxisValues(tuple(np.linspace(5.0, 5.6, 4).tolist()))
    plan = fi.app.ParameterStudy(study, {key: list(values.values)}, ["peak"])
    found = row(fi.preflight(plan), f"frequency step of the axis {key}")
    assert found.passed
    assert str(found) in fi.parameter_study(study, {key: list(values.values)}, ["peak"]).attrs["warnings"]
    fine = fi.app.ParameterStudy(study, {key: {"from": 5.26, "to": 5.34, "points": 21}}, ["peak"])
    assert not row(fi.preflight(fine), f"frequency step of the axis {key}").passed


DRIVEN = """
[beam]
length = 0.23026615
width = 0.02
thickness = 1e-3
young_modulus = 70e9
density = 2700
[[mass]]
name = "box"
at = "tip"
mass = 0.02290976
[damping]
ratio = 0.0029
modes = [1, 2]
[mesh]
elements = 8
[reduction]
modes = 2
[method]
name = "event-driven"
[base]
kind = "sum"
history = 2.0
[[base.parts]]
amplitude = 1e-5
frequency = 4.0
[[base.parts]]
amplitude = 1e-5
frequency = 5.0
[[force]]
name = "coil"
at = "tip"
kind = "sine"
force = 1e-3
frequency = 4.5
"""


def test_a_study_says_that_the_beam_bends_far_as_a_run_does():
    system = fi.without_impactors(reduced(REFERENCE, 2))
    found = fi.parameter_study(
        system, {"base.frequency": [5.0, 5.3]}, ["peak"], excitation=fi.Sine(1e-3, 5.0), cycles=300
    )
    run = fi.integrate(system, fi.Sine(1e-3, 5.3), fi.EventDriven(), 300 / 5.3)
    (said,) = (text for text in run.warnings if "linear beam theory" in text)
    assert float(found["peak"].max()) > 0.1 * system.length
    assert said.partition("up to")[0] in found.attrs["warnings"]
    soft = with_contact_time(0.1)
    with pytest.warns(fi.ResultWarning) as caught:
        both = fi.parameter_study(soft, {"base.frequency": [5.3]}, ["peak"], excitation=fi.Sine(5e-3, 5.0), cycles=60)
    # each is a warning of its own, on one line
    told = both.attrs["warnings"].splitlines()
    assert [str(one.message).removesuffix(" (docs/reference/warnings.md)") for one in caught] == told
    assert ["contact time of ball" in told[0], "linear beam theory" in told[-1], len(told) > 1] == [True] * 3
    small = fi.parameter_study(
        system, {"base.amplitude": [1e-6, 2e-6]}, ["peak"], excitation=fi.Sine(1e-3, 5.0), cycles=6
    )
    assert "warnings" not in small.attrs


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (
            fi.integrators.PreflightRow("modulus", 7e10, "Pa", 1e6, at_least=True),
            "modulus: 70 GPa (limit: at least 1 MPa)",
        ),
        (fi.integrators.PreflightRow("gap", 0.0002037, "m", 0.012), "gap: 0.2037 mm (limit: at most 12 mm)"),
        (fi.integrators.PreflightRow("contact", 0.002, "s"), "contact: 2 ms"),
        (fi.integrators.PreflightRow("step", 0.003153, "Hz"), "step: 0.003153 Hz"),
        (fi.integrators.PreflightRow("level", 0.0201, "g"), "level: 0.0201 g"),
        (
            fi.integrators.PreflightRow("share", 0.28, "1", 0.03, instead="wait"),
            "share: 0.28 (limit: at most 0.03); wait",
        ),
    ],
)
def test_a_row_is_written_in_the_unit_that_fits(row, words):
    assert str(row) == words


RIGID = 'name = "moreau-jean"\ndt = 1e-4', 'law = "rigid", restitution = 0.78'
COMPLIANT = 'law = "kelvin-voigt", restitution = 0.78, contact_time = 2e-3'


@pytest.mark.parametrize(
    ("method", "contact", "noted"),
    [('name = "newmark"', COMPLIANT, False), ('name = "newmark"\ndt = 1.5e-4', COMPLIANT, True), (*RIGID, True)],
)
def test_modes_that_no_step_follows_stand_in_the_short_check_if_impacts_excite_them(tmp_path, method, contact, noted):
    text = paper_study_text().replace(COMPLIANT, contact)
    text = re.sub(r'^name = "newmark".*$', method, text, flags=re.MULTILINE)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    study = fi.load_study(tmp_path / "study.toml")
    short, whole = (lines_of_check(study, every)[0] for every in (False, True))
    assert sum("not resolved in time" in line for line in short) == noted
    assert sum("not resolved in time" in line for line in whole) == 1
