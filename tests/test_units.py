"""Texts with a unit where a field holds a number in SI."""

from __future__ import annotations

import math

import numpy as np
import pytest

from femimpact.errors import InputError
from femimpact.units import UNITS, in_si, interval_texts, number_text, quantity_text, ranges_text, read_unit


def test_every_unit_of_the_table_is_of_its_dimension() -> None:
    for unit, fitting in UNITS.items():
        for text in fitting:
            found = read_unit(text, (unit,))
            assert found is not None, (unit, text)
        if unit != "1":
            assert read_unit(unit, (unit,)) == (unit, 1.0)


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("4 mm", "m", 0.004),
        ("0.3mm", "m", 0.0003),
        ("1 in", "m", 0.0254),
        ("10 g", "m/s^2", 98.0665),
        ("10 g", "kg", 0.01),
        ("-1 g", "m/s^2", -9.80665),
        ("5 mg", "m/s^2", 0.04903325),
        ("5 mg", "kg", 5e-6),
        ("0.04 g^2/Hz", "(m/s^2)^2/Hz", 0.04 * 9.80665**2),
        ("0.04 g²/Hz", "(m/s^2)^2/Hz", 0.04 * 9.80665**2),
        ("0.04 G2/Hz", "(m/s^2)^2/Hz", 0.04 * 9.80665**2),
        ("70 GPa", "Pa", 70e9),
        ("2.7 g/cm^3", "kg/m^3", 2700.0),
        ("2 N/mm", "N/m", 2000.0),
        ("3 N/mm^1.5", "N/m^1.5", 3.0 * 1000.0**1.5),
        ("1 oct/min", "oct/min", 1.0),
        ("0.5 oct/s", "oct/min", 30.0),
        ("90 deg", "rad", 0.5 * math.pi),
        ("5 %", "1", 0.05),
        ("1500 rpm", "Hz", 25.0),
        ("1500 1/min", "Hz", 25.0),
        ("2 GB", "bytes", 2e9),
        ("1 kg m^2/s^2", "N m", 1.0),
        ("100 µm", "m", 1e-4),
        ("2 Ns", "N s", 2.0),
        ("3 Ns/m", "N s/m", 3.0),
        ("5 Nm", "N m", 5.0),
        ("5 nm", "m", 5e-9),
        ("9 m·s⁻²", "m/s^2", 9.0),
        ("3 sec", "s", 3.0),
    ],
)
def test_number_of_a_text(text: str, unit: str, number: float) -> None:
    # products of a square and of a power beside are rounded once more in the expected value
    assert in_si("key", text, unit) == pytest.approx(number, rel=3e-16)


def test_number_of_millimetres_is_the_one_nearest_to_the_decimal() -> None:
    for n in range(1, 2000):
        assert in_si("key", f"{n} mm", "m") == float(f"{n}e-3")
        assert in_si("key", f"{n / 10} ms", "s") == float(f"{n / 10}e-3")


def test_other_values_stay() -> None:
    others: list[object] = ["tip", "", "4", "nan", "inf mm", True, None, 3, {}]
    for value in others:
        assert in_si("key", value, "m") == value
    # a field without a unit holds names
    assert in_si("key", "4 mm", "") == "4 mm"


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("4 kg", "m"), ("10 g", "m"), ("10 rad/s", "Hz"), ("1 oct", "Hz"), ("5 oct/s", "Hz"),
        ("1 Hz", "oct/min"), ("1 rpm", "oct/min"), ("3 %", "sigma"), ("4 m m", "m"), ("4 m/", "m"), ("4 /m", "m"),
        ("4 (m", "m"), ("4 m)", "m"), ("4 m^99999", "m"), ("1e999 m", "m"), ("4 m//s", "m/s"), ("4 furlong", "m"),
        ("1e300 GPa", "Pa"), ("4 mm, or so", "m"), ("3 dB/oct", "(m/s^2)^2/Hz"), ("4 ()", "m"),
    ],
)  # fmt: skip
def test_unit_that_does_not_fit_is_refused_with_those_that_do(text: str, unit: str) -> None:
    with pytest.raises(InputError) as error:
        in_si("impactor.ball.gap", text, unit)
    words = str(error.value)
    assert words.startswith(f"impactor.ball.gap = {text!r}: must")
    assert unit in words
    assert "\n" not in words


def test_unit_alone_says_its_dimension() -> None:
    assert read_unit("g") == ("m/s^2", 9.80665)
    assert read_unit("g", ("s", "kg", "N")) == ("kg", 1e-3)
    assert read_unit("mm/s", ("s", "m/s^2", "m/s", "m")) == ("m/s", 1e-3)
    assert read_unit("s") == ("s", 1.0)
    assert read_unit("volts") is None
    assert read_unit("g", ("s", "N")) is None


# ---- numbers for the eye -----------------------------------------------------------------------------


@pytest.mark.parametrize("digits", [2, 3, 4, 5])
def test_a_number_for_the_eye_has_no_exponent_where_it_is_readable(digits: int) -> None:
    for value in (10.0 ** np.random.default_rng(digits).uniform(-3.0, 4.0, 200)).tolist():
        text = number_text(value, digits)
        assert "e" not in text
        assert float(text) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))
        assert len(text.replace(".", "").lstrip("0")) <= max(digits, 4)
        assert number_text(-value, digits) == f"-{text}"


def test_quantities_have_the_unit_that_fits() -> None:
    words = [
        quantity_text(0.13, "m"),
        quantity_text(103.3, "N"),
        quantity_text(0.0203, "N"),
        quantity_text(7.438e7, "Pa"),
        quantity_text(7e10, "Pa"),
        # a prefix of m^2 is squared
        quantity_text(1.5e-7, "m^2"),
        quantity_text(0.5, "1"),
        quantity_text(math.nan, "N"),
    ]
    assert words == ["130 mm", "103.3 N", "20.3 mN", "74.38 MPa", "70 GPa", "1.5e-07 m^2", "0.5", "nan N"]
    assert [number_text(value, 2) for value in (980.0, 130.4, 9.8)] == ["980", "130", "9.8"]


def test_an_interval_has_two_digits_of_its_half_width() -> None:
    assert interval_texts(5.30003, 5.29978, 5.30028) == ("5.3000", "5.2998", "5.3003")
    assert interval_texts(0.29, 0.2888, 0.2912) == ("0.2900", "0.2888", "0.2912")
    assert interval_texts(5.3, 5.3, 5.3) == ("5.3", "5.3", "5.3")
    rng = np.random.default_rng(0)
    for _ in range(300):
        value = float(10.0 ** rng.uniform(-3.0, 4.0))
        half = float(value * 10.0 ** rng.uniform(-8.0, -0.5))
        middle, low, high = (float(text) for text in interval_texts(value, value - half, value + half))
        # of five digits one of the half width may be enough, else two
        assert low < middle < high
        assert high - low == pytest.approx(2.0 * half, rel=0.55 if half < 1e-3 * value else 0.11)
        assert abs(middle - value) <= 0.51 * half


def test_ends_of_a_range_that_are_written_alike_are_written_once() -> None:
    assert ranges_text([(6.88080, 6.88081), (7.0, 8.0)], "Hz", digits=5) == "6.8808 Hz, 7 to 8 Hz"
    assert ranges_text([(6.8808, 6.8809)], "Hz", digits=5) == "6.8808 to 6.8809 Hz"
