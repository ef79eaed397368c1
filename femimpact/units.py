"""Units in texts: what "10 g", "4 mm" or "0.04 g^2/Hz" are in the unit of a field, and the one table of units.

Numbers for the eye too: with how many digits, and in which unit.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from typing import Any

from femimpact.errors import Fault, InputError

UNITS: Mapping[str, tuple[str, ...]] = {
    "m": ("m", "cm", "mm", "um", "in", "mil", "ft"),
    "s": ("s", "ms", "us", "min", "h"),
    "Hz": ("Hz", "kHz", "1/s", "1/min", "rpm"),
    "m/s": ("m/s", "cm/s", "mm/s", "in/s", "ft/s", "km/h"),
    "m/s^2": ("m/s^2", "mm/s^2", "g", "in/s^2", "ft/s^2"),
    "(m/s^2)^2/Hz": ("(m/s^2)^2/Hz", "m^2/s^3", "g^2/Hz"),
    "kg": ("kg", "g", "mg", "t", "lb"),
    "kg/m": ("kg/m", "g/m", "g/mm", "lb/ft"),
    "kg/m^3": ("kg/m^3", "g/cm^3", "t/m^3", "lb/in^3"),
    "kg m^2": ("kg m^2", "g cm^2", "kg mm^2"),
    "N": ("N", "mN", "kN", "lbf", "kgf"),
    "N^2/Hz": ("N^2/Hz", "lbf^2/Hz"),
    "N s": ("N s", "mN s", "lbf s"),
    "N m": ("N m", "N mm", "lbf in", "lbf ft"),
    "N m^2": ("N m^2", "N mm^2"),
    "N/m": ("N/m", "N/mm", "kN/m", "lbf/in"),
    "N/m^1.5": ("N/m^1.5", "N/mm^1.5"),
    "N s/m": ("N s/m", "N s/mm", "kg/s"),
    "Pa": ("Pa", "kPa", "MPa", "GPa", "N/mm^2", "bar", "psi"),
    "m^2": ("m^2", "cm^2", "mm^2", "in^2"),
    "m^4": ("m^4", "cm^4", "mm^4", "in^4"),
    "rad": ("rad", "mrad", "deg"),
    "rad/s": ("rad/s", "deg/s", "rpm", "Hz"),
    "1/s": ("1/s", "1/min"),
    "oct/min": ("oct/min", "oct/s"),
    "bytes": ("bytes", "kB", "MB", "GB"),
    "sigma": ("sigma",),
    "1": ("%",),
}
"""Units that a text may have, by the unit of the field: its dimension. Others of the same dimension are read too."""

_LENGTH, _MASS, _TIME, _ANGLE, _BYTES = ({name: Fraction(1)} for name in ("m", "kg", "s", "rad", "bytes"))
_ACCELERATION, _FORCE = {"m": 1, "s": -2}, {"m": 1, "kg": 1, "s": -2}
_PRESSURE, _RATE = {"m": -1, "kg": 1, "s": -2}, {"s": -1}
_GRAVITY, _POUND, _INCH = Fraction("9.80665"), Fraction("0.45359237"), Fraction("0.0254")

_WITH_PREFIX: Mapping[str, tuple[Fraction, Mapping[str, Any]]] = {
    "m": (Fraction(1), _LENGTH),
    "g": (Fraction(1, 1000), _MASS),
    "s": (Fraction(1), _TIME),
    "sec": (Fraction(1), _TIME),
    "Ns": (Fraction(1), {"m": 1, "kg": 1, "s": -1}),
    "Nm": (Fraction(1), {"m": 2, "kg": 1, "s": -2}),
    "N": (Fraction(1), _FORCE),
    "Pa": (Fraction(1), _PRESSURE),
    "bar": (Fraction(100_000), _PRESSURE),
    "Hz": (Fraction(1), _RATE),
    "rad": (Fraction(1), _ANGLE),
    "B": (Fraction(1), _BYTES),
    "Gal": (Fraction(1, 100), _ACCELERATION),
}
"""Size in SI and powers of the base units of what may have a prefix."""

_PREFIXES = {p: Fraction(10) ** n for p, n in (("", 0), *zip("GMkcmun", (9, 6, 3, -2, -3, -6, -9), strict=True))}

_SYMBOLS: Mapping[str, tuple[Fraction, Mapping[str, Any]]] = {
    **{p + name: (f * size, of) for (p, f), (name, (size, of)) in itertools.product(
        _PREFIXES.items(), _WITH_PREFIX.items())},
    "min": (Fraction(60), _TIME),
    "h": (Fraction(3600), _TIME),
    "in": (_INCH, _LENGTH),
    "mil": (_INCH / 1000, _LENGTH),
    "ft": (12 * _INCH, _LENGTH),
    "t": (Fraction(1000), _MASS),
    "lb": (_POUND, _MASS),
    "lbf": (_POUND * _GRAVITY, _FORCE),
    "kgf": (_GRAVITY, _FORCE),
    "psi": (_POUND * _GRAVITY / _INCH**2, _PRESSURE),
    "rpm": (Fraction(1, 60), _RATE),
    "deg": (Fraction(math.pi) / 180, _ANGLE),
    "bytes": (Fraction(1), _BYTES),
    "oct": (Fraction(1), {"oct": 1}),
    "octave": (Fraction(1), {"oct": 1}),
    "sigma": (Fraction(1), {"sigma": 1}),
    "%": (Fraction(1, 100), {}),
    "1": (Fraction(1), {}),
}  # fmt: skip
"""Size in SI and powers of the base units of every symbol; g is that of a mass here."""

_SPELLED: Mapping[str, str] = {
    word: symbol for symbol, words in {
        "s": "secs second seconds sek sekunde sekunden seconde secondes segundo segundos secondo secondi",
        "ms": "millisecond milliseconds millisekunde millisekunden milliseconde millisecondes",
        "us": "microsecond microseconds mikrosekunde mikrosekunden", "min": "minute minutes minuten",
        "in": "inch inches",
        "m": "meter meters metre metres", "mm": "millimeter millimeters millimetre millimetres", "mil": "mils",
        "um": "micron microns micrometer micrometers micrometre micrometres mikrometer", "ft": "foot feet",
        "N": "newton newtons", "Gal": "gal gals", "mGal": "mgal", "Hz": "hertz", "Pa": "pascal",
    }.items() for word in words.split()
}  # fmt: skip
"""Symbols of units that are written out, in small letters."""

_G = (_GRAVITY, _ACCELERATION)

GRAVITY = float(_GRAVITY)
"""Standard acceleration of gravity, m/s^2."""

_WRITTEN = {
    "⁻²": "^-2", "⁻¹": "^-1", "²": "^2", "³": "^3", "⁴": "^4", "µ": "u", "μ": "u", "·": " ", "*": " ", "°": "deg",
}  # fmt: skip

_GS = re.compile(r"\bg(?:[- ]?forces?|'?s)\b", re.IGNORECASE)
"""Words for g, as "g-force" and "g's"."""

_TOKEN = re.compile(
    r"\s*(?:(?P<symbol>[A-Za-z]+|%|1(?![\d.]))|(?P<mark>[()/])|\^?(?P<power>-?\d+(?:\.\d+)?))", re.ASCII
)

_QUANTITY = re.compile(
    r"\s*([+-]?(?:\d{1,40}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][+-]?\d{1,3})?)\s*((?:[^\d\s.,]|(?<=\s)1 ?/)[^\n]{0,40})",
    re.ASCII,
)

TEXT_SCHEMA = {
    "type": "string", "pattern": r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?(\s*[^0-9\s.,]|\s+1 ?/)",
}  # fmt: skip
"""JSON schema of a text with a number and a unit."""


class _NoUnitError(Exception):
    """A text is no unit."""


def read_unit(text: str, among: Iterable[str] = tuple(UNITS)) -> tuple[str, float] | None:
    """The first of some SI units of whose dimension a unit is, and how many of it the unit is.

    g is 9.80665 m/s^2 where that fits, as in a density of the acceleration, and else 1e-3 kg.

    Parameters
    ----------
    text : str
        As "mm", "g", "g^2/Hz", "N/mm"; powers with or without ^, products with a space, a point or *.
    among : iterable of str
        SI units, as those of fields.

    Returns
    -------
    tuple of (str, float), or None
        None where the text is no unit, or of none of these dimensions.
    """
    return next(((unit, float(size)) for unit in among if (size := _size_in(text, unit)) is not None), None)


def units_that_fit(unit: str) -> str:
    """Words for the units that a text may have where a field's unit is this one."""
    return ", ".join(UNITS.get(unit, (unit,)))


def in_si(key: str, value: Any, unit: str) -> Any:
    """The number in SI that a text with a unit is; any other value as it is.

    The number is the one nearest to the exact product, so that "4 mm" is 0.004.

    Parameters
    ----------
    key : str
        What faults name.
    unit : str
        Of the field, in SI.

    Returns
    -------
    object

    Raises
    ------
    InputError
        If the unit of a text is not of the field's dimension, with those that are.
    """
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) and unit else None
    if match is None:
        return value
    size = _size_in(match[2], unit)
    if size is None:
        raise InputError([Fault(key, value, "", f"must have a unit that fits: {units_that_fit(unit)}")])
    try:
        return float(Fraction(match[1]) * size)
    except OverflowError:
        raise InputError([Fault(key, value, "", f"must be a finite number, in {unit}")]) from None


# ---- numbers for the eye --------------------------------------------------------------------------


PLAIN = (1e-4, 1e7)
"""Sizes from and up to which a number is written without a power of ten."""

PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))
SMALLEST_IN_MM, LARGEST_IN_MM = 1e-5, 10.0
"""Lengths (m) that are shown in mm."""
SMALLEST_IN_MPA, LARGEST_IN_MPA = 1e5, 1e10
"""Stresses and moduli (Pa) that are shown in MPa; larger ones are in GPa."""

_POWER_FIRST = re.compile(r"[A-Za-z]+[\^²³]")

MOST_DIGITS = 5
"""Digits of the ends of an interval, where one digit of its half width remains."""


def number_text(
    value: float,
    digits: int = 4,  # that count
    zeros: bool = False,  # whether zeros at its end stay: they say how exact it is
) -> str:
    """A number for the eye, without a power of ten where that is readable."""
    text = f"{value:#.{digits}g}".rstrip(".").replace(".e", "e") if zeros and value else f"{value:.{digits}g}"
    if "e" not in text or not PLAIN[0] <= abs(value) < PLAIN[1]:
        return text
    # 12340 is read more easily than with a power of ten
    return f"{value:.0f}"


MINUS, TIMES, NO_NUMBER, INFINITE = "\u2212", "\u00d7", "\u2013", "\u221e"
"""A minus and a multiplication sign, a dash for a missing value, and the sign of infinity."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def typeset_number(value: float, digits: int = 4, zeros: bool = False) -> str:
    """The number of `number_text` with a minus sign, a power of ten as on paper, and a word for what is none."""
    if math.isnan(value):
        return NO_NUMBER
    if math.isinf(value):
        return INFINITE if value > 0 else f"{MINUS}{INFINITE}"
    mantissa, _, exponent = number_text(value, digits, zeros).partition("e")
    power = f"{TIMES}10{str(int(exponent)).translate(_RAISED)}" if exponent else ""
    return f"{mantissa}{power}".replace("-", MINUS)


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit with the prefix in which the largest value is at least 1.

    Lengths from 0.01 mm to 10 m are in mm, stresses from 0.1 MPa on in MPa, from 10 GPa on in GPa, masses below
    1 kg in g.
    """
    if not unit[:1].isalpha() or _POWER_FIRST.match(unit) or not math.isfinite(largest):
        # of a number in a time or a length; a prefix of m^2 would be squared too
        return 1.0, unit
    if unit.startswith("kg") and 0.0 < largest < 1.0:
        factor, text = prefixed(1e3 * largest, unit[1:])
        return 1e3 * factor, text
    if unit == "Pa" and largest >= SMALLEST_IN_MPA:
        return (1e-6, "MPa") if largest < LARGEST_IN_MPA else (1e-9, "GPa")
    if unit == "m" and SMALLEST_IN_MM <= largest < LARGEST_IN_MM:
        # as on every axis of a displacement, so that figures can be laid side by side
        return 1e3, "mm"
    prefix = next(((f, p) for f, p in PREFIXES if f * largest >= 1.0), PREFIXES[-1] if largest else PREFIXES[0])
    return prefix[0], prefix[1] + unit


def quantity_text(value: float, unit: str, digits: int = 4) -> str:
    """A number for the eye in the unit that fits, as "130 mm" for 0.13 m."""
    factor, prefixed_unit = prefixed(abs(value), unit)
    return f"{number_text(factor * value, digits)} {'' if prefixed_unit == '1' else prefixed_unit}".rstrip()


def interval_texts(value: float, low: float, high: float) -> tuple[str, str, str]:
    """A value and the ends of its interval, all to two digits of the half width.

    Of more than five digits one of the half width is enough: 5.3000 (5.2998 to 5.3003).
    """
    largest = max(abs(low), abs(high))
    half, first = decimal_place(0.5 * (high - low)), decimal_place(largest)
    fifth = first - MOST_DIGITS + 1
    place = fifth if half - 1 < fifth <= half else half - 1
    if not (low < high and math.isfinite(low + high) and half > first - 15):
        return number_text(value, 6), number_text(low, 6), number_text(high, 6)
    if PLAIN[0] <= largest < PLAIN[1]:
        return at_place(value, place), at_place(low, place), at_place(high, place)
    texts = (number_text(one, max(decimal_place(one) - place + 1, 1), zeros=True) for one in (value, low, high))
    return next(texts), next(texts), next(texts)


def decimal_place(value: float) -> int:
    """Power of ten of the first digit of a size, far below all others for zero."""
    return math.floor(math.log10(abs(value)) + 1e-9) if value and math.isfinite(value) else -400


def at_place(value: float, place: int) -> str:
    """The value rounded to a power of ten."""
    return f"{round(value, -place):.{max(-place, 0)}f}"


# ---- units ----------------------------------------------------------------------------------------


def _size_in(text: str, unit: str) -> Fraction | None:
    """How many of an SI unit a unit is; None where the text is no unit, or of another dimension."""
    if unit == "rad/s" and text.strip() in ("rpm", "Hz"):
        # of turns; 1/s may be meant as rad/s, and does not fit
        return Fraction(2.0 * math.pi) * _SYMBOLS[text.strip()][0]
    # g is what makes the unit fit, an acceleration before a mass; none is in a unit of SI
    fitting = (size / target for target, its in _readings(unit)[-1:] for size, of in _readings(text) if of == its)
    return next(fitting, None)


@lru_cache(4096)
def _readings(text: str) -> tuple[tuple[Fraction, dict[str, Fraction]], ...]:
    """What `_parsed` finds with g as an acceleration, and as a mass, where that makes the text a unit."""
    readings = []
    for g in (_G, None):
        with suppress(_NoUnitError, OverflowError):
            readings.append(_parsed(text, g))
    return tuple(readings)


def _parsed(text: str, g: tuple[Fraction, Mapping[str, Any]] | None) -> tuple[Fraction, dict[str, Fraction]]:
    """Size in SI and powers of the base units of a text; with g as an acceleration, with prefixes, or as a mass."""
    text = _GS.sub("g", text)
    for written, plain in _WRITTEN.items():
        text = text.replace(written, plain)
    tokens, at = [], 0
    while text[at:].strip():
        match = _TOKEN.match(text, at)
        if match is None:
            raise _NoUnitError
        tokens.append((str(match.lastgroup), match[str(match.lastgroup)]))
        at = match.end()
    product = _product(tokens, g)
    if tokens:
        raise _NoUnitError
    return product


def _product(
    tokens: list[tuple[str, str]], g: tuple[Fraction, Mapping[str, Any]] | None
) -> tuple[Fraction, dict[str, Fraction]]:
    """The product that tokens begin with, which are taken from the list; a slash divides by the next factor alone."""
    size, powers, sign, factors = Fraction(1), dict[str, Fraction](), 1, 0
    while tokens and tokens[0] != ("mark", ")"):
        kind, word = tokens.pop(0)
        if (kind, word) == ("mark", "/") and factors and sign == 1:
            sign = -1
            continue
        if (kind, word) == ("mark", "("):
            first, of = _product(tokens, g)
            if not tokens or tokens.pop(0) != ("mark", ")"):
                raise _NoUnitError
        elif kind == "symbol":
            first, of = _symbol(word, g)
        else:
            raise _NoUnitError
        exponent = Fraction(tokens.pop(0)[1]) if tokens and tokens[0][0] == "power" else Fraction(1)
        if abs(exponent) > 9:
            raise _NoUnitError
        size *= Fraction(first ** (sign * exponent))
        for name, power in of.items():
            powers[name] = powers.get(name, Fraction(0)) + sign * exponent * power
        sign, factors = 1, factors + 1
    if not factors or sign == -1:
        raise _NoUnitError
    return size, {name: power for name, power in powers.items() if power}


def _symbol(word: str, g: tuple[Fraction, Mapping[str, Any]] | None) -> tuple[Fraction, dict[str, Any]]:
    if g is not None and word in ("g", "mg", "ug", "G", "mG", "uG", "gn"):
        prefix = word[0] if len(word) == 2 and word != "gn" else ""
        return _PREFIXES[prefix] * g[0], dict(g[1])
    symbol = word if word in _SYMBOLS else _SPELLED.get(word.lower(), "")
    if symbol not in _SYMBOLS:
        raise _NoUnitError
    size, of = _SYMBOLS[symbol]
    return size, dict(of)


SHOWN_IN = {"m": (1e3, "mm"), "Pa": (1e-6, "MPa"), "N s": (1e3, "mN s"), "kg": (1e3, "g")}
"""Units of axes and measures that are shown in another one, by its factor and its name: the same wherever they are."""


def counted(number: int, what: str) -> str:
    """A number and what is counted, as "1 mode" or "2 modes"."""
    return f"{number} {what}{'s' * (number != 1)}"


def name_words(name: str) -> str:
    """Words for the name of a channel or a measure, as "root surface stress" for root.surface_stress."""
    return re.sub(r"\.(?=[a-z])", " ", name).replace("_", " ")


def unit_text(value: float, unit: str) -> str:
    """A number for the eye, with its unit."""
    factor, name = SHOWN_IN.get(unit, (1.0, unit))
    return f"{typeset_number(factor * float(value))} {unit_words(value, name)}".rstrip()


def unit_words(value: float, unit: str) -> str:
    """The unit that stands behind a number, of an acceleration with the number in g."""
    if unit == "m/s^2":
        return f"{unit} ({typeset_number(float(value) / GRAVITY, 3)} g)"
    return "" if unit == "1" else unit


PARAMETER_DIGITS = 8
"""Significant digits of a value of the parameter of branches: bifurcations side by side differ there."""


def parameter_text(value: float, unit: str, digits: int = PARAMETER_DIGITS) -> str:
    """A value of the parameter of branches with its unit."""
    return f"{value:.{digits}g} {unit_words(value, unit)}".rstrip()


def ranges_text(
    ranges: Sequence[tuple[float, float]], unit: str, most: int | None = None, digits: int = PARAMETER_DIGITS
) -> str:
    """Ranges of the parameter of branches with its unit; of more than `most` the widest, and how many more."""
    widest = sorted(sorted(ranges, key=lambda ends: ends[0] - ends[1])[:most])
    told = [
        f"{low:.{digits}g} to {parameter_text(high, unit, digits)}"
        if f"{high:.{digits}g}" != f"{low:.{digits}g}"
        else parameter_text(low, unit, digits)
        for low, high in widest
    ]
    return ", ".join([*told, *([f"and {len(ranges) - len(told)} more"] if len(ranges) > len(told) else [])])


def value_text(value: Any, unit: str) -> str:
    """A value of an axis for the eye: a name, a number or a pair of gaps."""
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return f"({', '.join(f'{1e3 * side:.4g}' for side in value)}) mm"
    return unit_text(value, unit)


def rounded(value: float, to: Callable[[float], int] = math.ceil) -> float:
    """The value with two digits, rounded up, or to `math.floor`."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    # rounding of the quotient adds no digit
    return float(f"{digit * to(round(value / digit, 9)):.2g}")
