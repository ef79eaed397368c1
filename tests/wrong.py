"""Wrong values of every kind: what arguments of public names meet."""

from __future__ import annotations

import itertools
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np

import femimpact as fi


class Raises:
    """An object that raises whatever it is asked for."""

    def _refuse(self, *given, **named):
        raise RuntimeError("asked")

    __len__ = __iter__ = __getitem__ = __repr__ = __array__ = __float__ = __int__ = __eq__ = __bool__ = _refuse
    __hash__ = object.__hash__


def cyclic(kind):
    """A list or a dictionary that contains itself, twice or under another."""
    inner = [1.0]
    if kind == "dictionary":
        found = {"a": inner}
        found["b"] = found
        return found
    inner.extend([inner, inner])
    return (1.0, inner) if kind == "tuple" else inner


def deep(levels, times=1):
    """A list in a list, and so on."""
    found = [1.0]
    for _ in range(levels):
        found = [found] * times
    return found


NUMBERS_AND_WORDS = {
    "word": "no",
    "no word": "",
    "null character": "a\0b",
    "word of a number": "1.0",
    "words of numbers": ["1.0", "2.0"],
    "nan": math.nan,
    "negative": -3,
    "negative fraction": -0.3,
    "zero": 0,
    "pair": [1.0, 2.0],
    "five": np.linspace(0.1, 0.5, 5),
    "empty": np.array([]),
    "empty list": [],
    "2-D": np.ones((2, 3)),
    "3-D": np.ones((2, 2, 2)),
    "large": 10**30,
    "largest": 1e300,
    "most negative": -1e300,
    "least": 1e-300,
    "long word": "x" * 10**6,
    "fraction": Fraction(1, 3),
    "single precision": np.float32(0.5),
    "none": None,
}
"""What some argument may be: where it is wrong it may be so beside another argument."""

NOTHING_SOUND = {
    "array of words": np.array(["1.0", "2.0"]),
    "bytes": np.array([b"1.0", b"2.0"]),
    "plain bytes": b"1.0",
    "true": True,
    "infinite": math.inf,
    "minus infinite": -math.inf,
    "complex": 1j,
    "pair with nan": [1.0, math.nan],
    "rows of two lengths": [[1.0], [1.0, 2.0]],
    "masked": np.ma.array([0.5, 1.0, 2.0, 3.0, 4.0], mask=[False, True, False, False, False]),
    "masked in a list": [np.ma.array([0.5, 1.0], mask=[False, True])],
    "masked number": np.ma.masked,
    "objects": np.array([object(), None]),
    "object": object(),
    "huge": 10**5000,
    "dictionary": {},
    "dictionary of nothing": {"a": None},
    "set": {1.0},
    "function": lambda *_: None,
    "class": fi.Beam,
    "duration": np.timedelta64(3, "s"),
    "plain duration": np.timedelta64(3),
    "date": np.datetime64("2020-01-01"),
    "durations": np.array([1, 2], dtype="m8[s]"),
    "a list that contains itself": cyclic("list"),
    "a tuple of a list that contains itself": cyclic("tuple"),
    "a dictionary that contains itself": cyclic("dictionary"),
    "long range": range(10**15),
    "longer range": range(10**30),
    "long range downwards": range(10**12, 0, -1),
    "long bytes": b"x" * 10**6,
    "memory": memoryview(b"1234"),
    "array of bytes": bytearray(b"12"),
    "decimal": Decimal("0.5"),
    "void": np.void(b"1234"),
    "structured": np.zeros(2, dtype=[("a", float)]),
    "raises": Raises(),
    "list of what raises": [Raises()],
    "count": itertools.count(),
    "deep": deep(100),
    "the same twice, 60 levels deep": deep(60, times=2),
    "the same twice, 28 levels deep": deep(28, times=2),
    "another noun": fi.contact.Material(70e9, 0.3),
}
"""What next to no argument may be."""
