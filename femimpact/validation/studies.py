"""Parameter studies of a ball that stays where it starts: its places, their median's interval, and their report."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femimpact.excitation import Sine
from femimpact.parametric.verb import parameter_study
from femimpact.response.response import Response
from femimpact.study.result_conclusions import study_conclusions
from femimpact.study.starts import unit_draws
from femimpact.validation.case import Case
from femimpact.validation.contacts import shaken_floor

if TYPE_CHECKING:
    import xarray


STARTS = 20
GAPS = ((2e-3, 6e-3), (5e-3, 1e-3))
"""To the + and to the - side, m; the places of the first case are the smaller ones."""


def place(response: Response) -> float:
    """Place of the ball at the end, m."""
    return float(response["ball"][-1])


@cache
def _study() -> xarray.Dataset:
    """Nothing moves: a ball lies where each of its starts has put it."""
    return parameter_study(
        shaken_floor(0.5, (1.0, 1.0)), {"impactor.ball.gap": GAPS}, [place], starts=STARTS, cycles=3,
        excitation=Sine(0.0, 50.0),
    )  # fmt: skip


def _places(case: int) -> NDArray[np.float64]:
    """The gap of a case divided as the unit draws divide 0 to 1, from the smallest on."""
    plus, minus = GAPS[case]
    return np.sort(-minus + (plus + minus) * unit_draws(STARTS, 1, 0)[:, 0, 0])


def extreme_start(case: int, end: str) -> Case:
    """The first and the last of the places of a case."""
    plus, minus = (1e3 * gap for gap in GAPS[case])
    return Case(
        f"starts in gaps of {plus:g} mm and {minus:g} mm: {'smallest' if end == 'low' else 'largest'} place",
        "derived here (linear in the draws)", "place of the ball", "m", float(_places(case)[0 if end == "low" else -1]),
        float(_study()[f"place_{end}"][case]), 1e-12, "rounding",
    )  # fmt: skip


def median_interval(end: str) -> Case:
    """The k-th of 20 places from an end, for the largest k with 1 - 2 P(fewer than k of 20 tosses) of at least 0.9."""
    k = max(k for k in range(1, 11) if 1 - 2 * sum(math.comb(STARTS, i) for i in range(k)) / 2**STARTS >= 0.9)
    return Case(
        f"interval of the median of {STARTS} starts: its {'lower' if end == 'low' else 'upper'} end",
        "David and Nagaraja (2003), binomial sums", "place of the ball", "m",
        float(_places(0)[k - 1 if end == "low" else -k]), float(_study()[f"place_median_{end}"][0]), 1e-12, "rounding",
    )  # fmt: skip


def reported_scatter(end: str) -> Case:
    """The range of the case with the smallest value in the words of a report, "... to ... over 20 starts"."""
    words = study_conclusions(_study())[0].scatter.replace("\N{MINUS SIGN}", "-").split()
    return Case(
        f"report of a parameter study: scatter of the smallest value, {end} end", "derived here (linear in the draws)",
        "place of the ball", "m", float(_places(0)[0 if end == "lower" else -1]),
        float(words[0 if end == "lower" else 2]), 5e-4, "four digits in the report",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    *(partial(extreme_start, case, end) for case in (0, 1) for end in ("low", "high")),
    *(partial(median_interval, end) for end in ("low", "high")),
    *(partial(reported_scatter, end) for end in ("lower", "upper")),
)
"""The cases of this subject, in the order of the table."""
