"""Wrong values of every kind: what arguments of public names meet."""

from __future__ import annotations

import math

import numpy as np

import femimpact as fi

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
    "another noun": fi.Material(70e9, 0.3),
}
"""What next to no argument may be."""
