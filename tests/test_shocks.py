"""Every shock: its shape, velocity change and net displacement, and a linear oscillator's response in closed form."""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import numpy as np
import pytest
from builders import read_study, same_study, study_text

import femimpact as fi
from femimpact.excitation.shock import COMPENSATION

A, D, RAMP = 98.0665, 0.011, 0.2

SHAPES = {
    "half-sine": lambda x: np.sin(np.pi * x),
    "haversine": lambda x: np.sin(np.pi * x) ** 2,
    "triangle": lambda x: 1.0 - np.abs(2.0 * x - 1.0),
    "rectangle": lambda x: np.ones_like(x),
    "terminal-sawtooth": lambda x: x,
    "initial-sawtooth": lambda x: 1.0 - x,
    "trapezoid": lambda x: np.minimum(1.0, np.minimum(x, 1.0 - x) / RAMP),
}
CHANGES = {
    "half-sine": (2.0 / np.pi, 1.0 / np.pi), "haversine": (0.5, 0.25), "triangle": (0.5, 0.25), "rectangle": (1.0, 0.5),
    "terminal-sawtooth": (0.5, 1.0 / 6.0), "initial-sawtooth": (0.5, 1.0 / 3.0),
    "trapezoid": (1.0 - RAMP, 0.5 * (1.0 - RAMP)),
}  # fmt: skip
"""Change of velocity over a d, and displacement at the end of the pulse over a d^2, by hand."""


def shock(kind: str, **more: object) -> fi.Shock:
    ramp = {"ramp": RAMP} if kind == "trapezoid" else {}
    return fi.Shock(kind, A, D, **ramp, **more)  # type: ignore[arg-type]


def transform(kind: str, omega: float) -> complex:
    """Integral of a(t) exp(-i omega t) over one pulse from t = 0 on."""

    def level(d: float, w: float = omega) -> complex:
        return d if w == 0.0 else (1.0 - cmath.exp(-1j * w * d)) / (1j * w)

    first = D * cmath.exp(-1j * omega * D) / (-1j * omega) + level(D) / (1j * omega)
    beside = np.pi / D
    return (
        A
        * {
            "half-sine": (level(D, omega - beside) - level(D, omega + beside)) / 2j,
            "haversine": level(D) / 2.0 - (level(D, omega - 2.0 * beside) + level(D, omega + 2.0 * beside)) / 4.0,
            # a triangle and a trapezoid are rectangles folded with one another
            "triangle": level(D / 2.0) ** 2 * 2.0 / D,
            "trapezoid": level(RAMP * D) * level((1.0 - RAMP) * D) / (RAMP * D),
            "rectangle": level(D),
            "terminal-sawtooth": first / D,
            "initial-sawtooth": level(D) - first / D,
        }[kind]
    )


@pytest.mark.parametrize("kind", SHAPES)
def test_shape_velocity_change_and_net_displacement_are_the_closed_ones(kind: str) -> None:
    base, x = shock(kind, delay=0.05), np.linspace(0.001, 0.999, 997)
    # pieces are within 1e-9 of the largest value
    np.testing.assert_allclose(base.acceleration(0.05 + D * x), A * SHAPES[kind](x), rtol=0.0, atol=1e-9 * A)
    assert np.all(base.acceleration([0.0, 0.04999, 0.05 + 1.001 * D, 1.0]) == 0.0)
    speed, place = CHANGES[kind]
    assert base.velocity(0.05 + D) == pytest.approx(speed * A * D, rel=1e-12)
    assert base.displacement(0.05 + D) == pytest.approx(place * A * D**2, rel=1e-12)
    assert base.displacement(0.05) == 0.0
    assert base.displacement(1.0) == pytest.approx(place * A * D**2 + speed * A * D * (0.95 - D), rel=1e-12)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize(("pulses", "period", "delay"), [(1, None, 0.0), (3, 0.07, 0.013), (4, D, 0.0)])
def test_an_oscillator_rings_as_the_transform_of_the_pulses_says(
    kind: str, pulses: int, period: float | None, delay: float
) -> None:
    base = shock(kind, pulses=pulses, period=period, delay=delay)
    for omega in 2.0 * np.pi * np.array([8.0, 73.0]):
        system = fi.System.from_matrices([[1.0]], [[0.0]], [[omega**2]], points={"mass": [1.0]})
        end = delay + (pulses - 1) * (period or 0.0) + D
        record = fi.Recorder(channels=("mass",), interval=1e-3)
        found = fi.integrate(system, base, fi.EventDriven(), end + 0.1, record)
        after = found.time > end + 1e-6
        t = found.time[after]
        begins = delay + (period or 0.0) * np.arange(pulses)
        total = transform(kind, omega) * np.sum(np.exp(-1j * omega * begins))
        # z'' + omega^2 z = -a, by Duhamel's integral
        expected = -np.imag(np.exp(1j * omega * t) * total) / omega
        scale = abs(transform(kind, omega)) / omega
        np.testing.assert_allclose(found.channels["mass"][after], expected, rtol=0.0, atol=1e-8 * scale + 1e-15)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("side", ["after", "before"])
def test_compensated_pulses_end_at_rest_in_place_each(kind: str, side: str) -> None:
    length = COMPENSATION * D
    base = shock(kind, compensated=True, compensation=side, pulses=3, period=0.4, delay=0.02)
    begin = 0.02 + length * (side == "before")
    x = np.linspace(0.001, 0.999, 101)
    for n in range(3):
        np.testing.assert_allclose(base.acceleration(begin + 0.4 * n + D * x), A * SHAPES[kind](x), atol=2e-9 * A)
        rest = 0.02 + 0.4 * n + length + D + np.array([1e-6, 0.05])
        np.testing.assert_allclose(base.velocity(rest), 0.0, atol=1e-13 * A * D)
        np.testing.assert_allclose(base.displacement(rest), 0.0, atol=1e-12 * A * D**2)
    # it moves before a pulse that it comes before
    moved = np.abs(base.displacement(0.02 + 0.5 * length))
    assert moved > 0.0
    assert float(np.abs(base.velocity(begin))) == pytest.approx(
        CHANGES[kind][0] * A * D * (side == "before"), abs=1e-12
    )


def test_todays_pulses_keep_their_bits() -> None:
    length = COMPENSATION * D
    pulse = fi.excitation.PiecewisePolynomial(
        [0.0, 0.1 * D, 0.9 * D, D], [[0.0, A / (0.1 * D)], [A, 0.0], [A, -A / (0.1 * D)]]
    )
    place, speed = pulse.starts[-1]
    found = fi.Shock("trapezoid", A, D, True).closed_form
    right = [-speed / length, -place / length**2 - speed / length]
    p, q = np.linalg.solve([[1 / 6, 1 / 12], [1 / 12, 1 / 30]], right)
    np.testing.assert_array_equal(found.coefficients[-1, 1:4], np.array([p, q - p, -q]) / length ** np.arange(1, 4))
    np.testing.assert_array_equal(fi.Shock("trapezoid", A, D).closed_form.coefficients, pulse.coefficients)


def test_half_a_ramp_is_a_triangle() -> None:
    t = np.linspace(0.0, D, 101)
    half = fi.Shock("trapezoid", A, D, ramp=0.5)
    np.testing.assert_allclose(half.acceleration(t), fi.Shock("triangle", A, D).acceleration(t), atol=1e-12 * A)


def test_shock_of_a_study_file_has_all_of_it() -> None:
    text = Path(__file__).parent.parent.joinpath("femimpact/app/paper.toml").read_text(encoding="utf-8")
    head = text[: text.index("[base]")]
    study = """[base]
kind = "shock"
pulse = "haversine"
acceleration = "10 g"
duration = "11 ms"
delay = "50 ms"
pulses = 3
period = "0.5 s"
compensated = true
compensation = "before"
history = 2.0
"""
    found = read_study(head + study, Path("study.toml"))
    assert found.excitation == fi.Shock("haversine", A, D, True, "before", delay=0.05, pulses=3, period=0.5)
    assert same_study(read_study(study_text(found), Path("study.toml")), found)
    assert math.isclose(found.history_duration, 2.0)
