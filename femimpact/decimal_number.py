"""What counts as a number in text that is read: a decimal one, all of it.

Readers in C take `1,5` for 1 and `0x10` for 0; `float` takes `1_000` and the digits of every script.
"""

from __future__ import annotations

import re

__all__ = ["decimal_number"]

DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def decimal_number(text: str) -> float | None:
    """The number that a text is, with white space around it at most; None where it is not a number."""
    return float(text) if DECIMAL.fullmatch(text.strip()) else None
