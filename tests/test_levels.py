"""Levels over frequency, dwells by seconds, and fades, of chirps and stepped sines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import femimpact as fi
from femimpact.excitation.remarks import motion_notes

G, D = 9.80665, 0.075e-3
CROSSOVER = np.sqrt(G / D) / (2.0 * np.pi)
PLAN = ((10.0, (2.0 * np.pi * 10.0) ** 2 * D), (CROSSOVER, G), (150.0, G))
"""75 um up to the crossover, and 1 g above."""
NOTCH = ((10.0, 5.0), (40.0, 5.0), (45.0, 1.0), (50.0, 1.0), (55.0, 5.0), (150.0, 5.0))


def level(rows: Any, f: Any) -> Any:
    points = np.log(np.array(rows))
    return np.exp(np.interp(np.log(f), points[:, 0], points[:, 1]))


SWEEPS = {
    "up": fi.Chirp(10.0, 150.0, acceleration=PLAN, kind="logarithmic", octaves_per_minute=4.0),
    "down": fi.Chirp(150.0, 10.0, acceleration=PLAN, kind="logarithmic", octaves_per_minute=4.0),
    "linear": fi.Chirp(10.0, 150.0, 40.0, acceleration=PLAN),
    "notch": fi.Chirp(10.0, 150.0, acceleration=NOTCH, kind="logarithmic", octaves_per_minute=4.0),
    "fast": fi.Chirp(12.0, 140.0, 1.0, acceleration=NOTCH),
}


@pytest.mark.parametrize("name", ["up", "down", "linear", "notch"])
def test_a_sweep_has_its_level_to_a_millionth_away_from_sharp_bends(name: str) -> None:
    base = SWEEPS[name]
    t = np.linspace(0.0, base.duration, 300_001)[:-1]
    size = level(base.level, base.frequency_at(t))
    error = np.abs(base.acceleration(t) - size * np.sin(base.phase_at(t))) / size
    rows = base._time_of(np.array(base.level)[1:-1, 0])
    away = np.abs(t[:, None] - rows).min(axis=1) > (1.0 if name == "notch" else 0.0)
    assert error[away].max() < 1e-6
    # at bends it is what is said of it: one of the knots is as near as an eighth of a cycle
    assert error.max() < 1.5 * base.level_error[0] + 1e-9
    assert base.level_error[0] < (2e-5 if name == "notch" else 1e-6)


def notch(edge: float, depth: float = 0.25) -> Any:
    """The plan, with a notch from 80 to 85 Hz between edges of some Hz."""
    return (*PLAN[:2], (80.0 - edge, G), (80.0, depth * G), (85.0, depth * G), (85.0 + edge, G), PLAN[2])


@pytest.mark.parametrize("edge", [1.0, 0.1, 0.01, 1e-4])
@pytest.mark.parametrize("rate", [1.0, 2.0, 4.0])
@pytest.mark.parametrize(("start", "stop"), [(10.0, 150.0), (150.0, 10.0)])
def test_a_notch_does_not_make_the_base_drift(start: float, stop: float, rate: float, edge: float) -> None:
    rows = notch(edge)
    base = fi.Chirp(start, stop, acceleration=rows, kind="logarithmic", octaves_per_minute=rate)
    t = np.linspace(0.0, base.duration, 200_001)[:-1]
    f, phase = base.frequency_at(t), base.phase_at(t)
    size = level(rows, f)
    amplitude = size / (2.0 * np.pi * f) ** 2
    off = np.abs(base.displacement(t) + amplitude * np.sin(phase)) / amplitude
    error = np.abs(base.acceleration(t) - size * np.sin(phase)) / size
    away = np.abs(t[:, None] - base._time_of(np.array(rows)[1:-1, 0])).min(axis=1) > 60.0 / 80.0 / rate
    # the crossover may move the base by a twentieth of its amplitude, and does by half of that
    assert off[away].max() < 0.03
    assert error[away].max() < 1e-6
    # a step within a cycle takes a part of a cycle
    assert np.abs(base.displacement(t)).max() < (1.03 if edge > 1e-4 else 1.1) * D
    # an edge of several cycles is followed to some twentieths of the displacement
    if edge == 1.0:
        assert off.max() < 0.15
        assert base.level_error[0] < 2e-4


def test_a_sharp_bend_is_said() -> None:
    base = fi.Chirp(10.0, 150.0, acceleration=notch(0.1), kind="logarithmic", octaves_per_minute=1.0)
    share, frequency = base.level_error
    (note,) = motion_notes(base, 0.2, 1.0)
    assert f"up to {100.0 * share:.2g} % of the level is added, the most at {frequency:.4g} Hz" in note
    assert min(abs(frequency - row) for row in (79.9, 80.0, 85.0, 85.1)) < 0.02
    plan = SWEEPS["up"]
    assert plan.level_error[0] < 1e-6
    assert motion_notes(plan, 0.2, 1.0) == ()


@pytest.mark.parametrize("rows", [7, 100, 3000])
def test_a_table_of_noise_keeps_the_base_in_its_place(rows: int) -> None:
    # as a shaker's reference from a file: a tenth of a decibel from row to row
    f = np.linspace(10.0, 150.0, rows)
    table = np.column_stack([f, 10.0 ** (0.1 * np.random.default_rng(rows).normal(size=rows) / 20.0)])
    base = fi.Chirp(10.0, 150.0, 60.0, acceleration=table)
    t = np.linspace(0.0, 60.0, 200_001)[:-1]
    amplitude = level(table, base.frequency_at(t)) / (2.0 * np.pi * base.frequency_at(t)) ** 2
    assert np.abs(base.displacement(t) / amplitude).max() < 1.15


@pytest.mark.parametrize("edge", [1.0, 1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize(("start", "stop"), [(5.0, 200.0), (200.0, 5.0)])
def test_a_step_of_the_level_costs_pieces_at_the_step_alone(start: float, stop: float, edge: float) -> None:
    rows = ((5.0, 1.0), (30.0, 1.0), (30.0 + edge, 0.01), (200.0, 0.01))
    forms = [
        fi.Chirp(start, stop, 20.0, acceleration=table, kind="logarithmic").closed_form
        for table in (rows, ((5.0, 1.0), (200.0, 1.0)))
    ]
    # 4.6 nepers in pieces of 0.27, and one more for each of the rows
    assert forms[0].knots.size - forms[1].knots.size < 4.6 / 0.27 + 20
    # a run reads the drive by the rate of its pieces: a step in less than a thousandth of a cycle has none
    assert forms[0].rate < (1.5 * forms[1].rate if edge in (1.0, 1e-6, 1e-9) else 1e6)
    t = np.linspace(0.0, 20.0, 100_001)
    amplitude = level(rows, 30.0) / (2.0 * np.pi * 30.0) ** 2
    beside = forms[0].displacement(t[np.abs(t - 20.0 * np.log(30.0 / start) / np.log(stop / start)) < 0.5])
    # at 27 Hz, half a second away, it is a quarter larger; a step moves the base by a part of it
    assert np.abs(beside).max() < 1.6 * amplitude


@pytest.mark.parametrize("name", ["up", "down", "linear"])
def test_the_displacement_is_constant_below_the_crossover_and_does_not_drift(name: str) -> None:
    base = SWEEPS[name]
    t = np.linspace(0.0, base.duration, 300_001)[:-1]
    f = base.frequency_at(t)
    sine = -level(PLAN, f) / (2.0 * np.pi * f) ** 2 * np.sin(base.phase_at(t))
    # the next term of the integrals is the relative change of the frequency in a radian, at 10 Hz, with its powers
    assert (
        np.abs(base.displacement(t) - sine).max()
        < 6.0 * abs(base._slope(np.array([0.0, base.duration])).max()) / (2.0 * np.pi * 10.0) * D + 0.02 * D
    )
    below = f < 0.98 * CROSSOVER
    assert np.abs(base.displacement(t[below])).max() == pytest.approx(D, rel=0.02)


@pytest.mark.parametrize("name", ["notch", "fast"])
def test_an_oscillator_under_a_profile_moves_as_an_independent_integration_says(name: str) -> None:
    base = SWEEPS[name]
    omega, zeta, end = 2.0 * np.pi * 30.0, 0.02, 1.0
    # the whole fast sweep; of the slow one the notch
    system = fi.System.from_matrices([[1.0]], [[2.0 * zeta * omega]], [[omega**2]], points={"mass": [1.0]})
    record = fi.Recorder(channels=("mass",), interval=0.01)
    found = fi.integrate(system, base, fi.EventDriven(), end, record)

    def rate(t: float, y: Any) -> Any:
        a = level(base.level, base.frequency_at(t)) * np.sin(base.phase_at(t))
        return [y[1], -a - 2.0 * zeta * omega * y[1] - omega**2 * y[0]]

    exact = solve_ivp(rate, (0.0, end), [0.0, 0.0], "DOP853", found.time, rtol=1e-11, atol=1e-15, max_step=1e-3)
    scale = np.abs(exact.y[0]).max()
    # what keeps the base in its place is less than 1e-6 of the level, beside the bends of the fast one 1 or 2 %
    most = 2e-6 if name == "notch" else 0.5 * base.level_error[0]
    assert np.abs(found.channels["mass"] - exact.y[0]).max() < most * scale


def test_every_step_of_a_stepped_sine_has_its_level() -> None:
    frequencies = np.array([10.0, 30.0, CROSSOVER, 100.0, 150.0])
    base = fi.SteppedSine(frequencies, cycles=8, acceleration=PLAN)
    begin = 0.0
    for f in frequencies:
        t = begin + np.linspace(0.0, 8.0 / f, 4001)[1:-1]
        np.testing.assert_allclose(
            base.acceleration(t), -level(PLAN, f) * np.cos(2.0 * np.pi * f * (t - begin)), atol=1e-8 * level(PLAN, f)
        )
        assert np.ptp(base.displacement(t)) == pytest.approx(2.0 * level(PLAN, f) / (2.0 * np.pi * f) ** 2, rel=1e-4)
        begin += 8.0 / f
    assert begin == pytest.approx(base.duration, rel=1e-15)
    # a force has the level, and no displacement
    force = fi.PointForce("tip", base)
    assert force.force(0.0) == pytest.approx(-level(PLAN, 10.0), rel=1e-9)


def test_dwells_by_seconds_are_whole_cycles_that_last_so_long() -> None:
    base = fi.SteppedSine([4.0, 7.3, 100.0], seconds=2.0, amplitude=1e-3)
    assert base.cycles_of_steps.tolist() == [8, 15, 200]
    assert base.duration == pytest.approx(2.0 + 15.0 / 7.3 + 2.0, rel=1e-15)
    one = fi.SteppedSine([7.3], seconds=0.01, amplitude=1e-3)
    assert one.cycles_of_steps.tolist() == [1]
    assert fi.SteppedSine([4.0], cycles=8, amplitude=1e-3) != fi.SteppedSine([4.0], seconds=2.0, amplitude=1e-3)


FADED = {
    "chirp by amplitude": (fi.Chirp, {"start": 5.0, "stop": 20.0, "duration": 4.0, "amplitude": 1e-3}),
    "chirp by acceleration": (fi.Chirp, {"start": 20.0, "stop": 5.0, "duration": 4.0, "acceleration": 3.0}),
    "steps": (fi.SteppedSine, {"frequencies": [5.0, 9.0], "cycles": 10, "amplitude": 1e-3}),
    "steps by acceleration": (fi.SteppedSine, {"frequencies": [5.0, 9.0], "cycles": 10, "acceleration": 3.0}),
    "profile": (fi.Chirp, {"start": 12.0, "stop": 120.0, "duration": 2.0, "acceleration": PLAN}),
}


@pytest.mark.parametrize("name", FADED)
def test_a_fade_multiplies_the_displacement(name: str) -> None:
    noun, arguments = FADED[name]
    whole, base = noun(**arguments), noun(**arguments, fade=0.4)
    end = base.duration
    assert end == whole.duration
    t = np.linspace(0.0, end, 10_001)
    window = np.sin(0.5 * np.pi * np.clip(np.minimum(t, end - t), 0.0, 0.4) / 0.4) ** 2
    scale = np.abs(whole.displacement(t)).max()
    np.testing.assert_allclose(base.displacement(t), window * whole.displacement(t), atol=1e-9 * scale)
    inside = (t > 0.4) & (t < end - 0.4)
    size = np.abs(whole.acceleration(t)).max()
    np.testing.assert_allclose(base.acceleration(t[inside]), whole.acceleration(t[inside]), atol=1e-8 * size)
    for rest in (0.0, end, end + 1.0):
        assert abs(base.displacement(rest)) < 1e-9 * scale
        assert abs(base.velocity(rest)) < 1e-8 * np.abs(whole.velocity(t)).max()
    # velocity and acceleration are its derivatives
    middle, h = t[1:-1], t[1] - t[0]
    slope = (base.displacement(middle + h / 50) - base.displacement(middle - h / 50)) / (h / 25)
    np.testing.assert_allclose(base.velocity(middle), slope, atol=1e-4 * np.abs(slope).max())
    # of a force the value is multiplied
    force, largest = fi.PointForce("tip", whole).force(t), np.abs(fi.PointForce("tip", whole).force(t)).max()
    np.testing.assert_allclose(fi.PointForce("tip", base).force(t[:-1]), (window * force)[:-1], atol=1e-8 * largest)


@pytest.mark.parametrize("fade", [0.5, 0.5 + 1e-12, 0.5 - 1e-9, 0.5 + 1e-6])
def test_a_fade_that_ends_beside_a_knot_has_no_derivatives_of_rounding(fade):
    # 34 s of 35 Hz: the last fade begins 1e-12 s beside a knot
    steps = fi.SteppedSine([35.0], seconds=34.0, acceleration=1.0, fade=fade)
    without = fi.SteppedSine([35.0], seconds=34.0, acceleration=1.0)
    # a fade of sin^2 adds (pi/fade)^2/omega^2, 1e-3, to the largest derivatives
    assert steps.closed_form.rate < 1.01 * without.closed_form.rate
    time = np.linspace(33.4, 33.6, 2001)
    window = np.where(time < 34.0 - fade, 1.0, np.sin(0.5 * np.pi * (34.0 - time) / fade) ** 2)
    np.testing.assert_allclose(
        steps.displacement(time), window * without.displacement(time), rtol=0.0, atol=1e-9 * without.amplitude
    )
