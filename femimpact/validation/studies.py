"""Estimates: studies of a ball that stays where it starts, intervals of a free decay's mode, and of a calibration."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femimpact.app.parametric.measured_peaks import calibration_of
from femimpact.app.parametric.runs import unit_draws
from femimpact.app.parametric.verb import parameter_study
from femimpact.app.report.result_conclusions import study_conclusions
from femimpact.contact.laws import Rigid
from femimpact.excitation.harmonic import Sine
from femimpact.response.response import Response
from femimpact.signals.decay import identify_decay
from femimpact.validation.case import Case
from femimpact.validation.contacts import shaken_floor

STARTS = 20
GAPS = ((2e-3, 6e-3), (5e-3, 1e-3))
"""To the + and to the - side, m; the places of the first case are the smaller ones."""


PLACE = "place of the ball"


def place(response: Response) -> float:
    """Place of the ball at the end, m."""
    return float(response["ball"][-1])


def starts_of_a_ball() -> Iterator[Case]:
    """Nothing moves: a ball lies where each of its starts has put it."""
    study = parameter_study(
        shaken_floor(Rigid(0.5), (1.0, 1.0)), {"impactor.ball.gap": GAPS}, [place], starts=STARTS, cycles=3,
        excitation=Sine(0.0, 50.0),
    )  # fmt: skip
    # the gap of a case is divided as the unit draws divide 0 to 1
    draws = np.sort(unit_draws(STARTS, 1, 0)[:, 0, 0])
    places = [-minus + (plus + minus) * draws for plus, minus in GAPS]
    linear, unit = "derived here (linear in the draws)", "m"
    for case, (plus, minus) in enumerate(GAPS):
        for size, end, number in (("smallest", "low", 0), ("largest", "high", -1)):
            yield Case(
                f"starts in gaps of {1e3 * plus:g} mm and {1e3 * minus:g} mm: {size} place", linear, PLACE, unit,
                float(places[case][number]), float(study[f"place_{end}"][case]), 1e-12, "rounding",
            )  # fmt: skip
    # the k-th of the places from an end, for the largest k with 1 - 2 P(fewer than k of 20 tosses) of at least 0.9
    k = max(k for k in range(1, 11) if 1 - 2 * sum(math.comb(STARTS, i) for i in range(k)) / 2**STARTS >= 0.9)
    for side, end, number in (("lower", "low", k - 1), ("upper", "high", -k)):
        yield Case(
            f"interval of the median of {STARTS} starts: its {side} end", "David and Nagaraja (2003), binomial sums",
            PLACE, unit, float(places[0][number]), float(study[f"place_median_{end}"][0]), 1e-12, "rounding",
        )  # fmt: skip
    # the range of the case with the smallest value, as "... to ... over 20 starts"
    words = study_conclusions(study)[0].scatter.replace("\N{MINUS SIGN}", "-").split()
    for side, number in (("lower", 0), ("upper", -1)):
        yield Case(
            f"report of a parameter study: scatter of the smallest value, {side} end", linear, PLACE, unit,
            float(places[0][number]), float(words[-2 * number]), 5e-4, "four digits in the report",
        )  # fmt: skip


# ---- estimates with their intervals ---------------------------------------------------------------

MODE = np.array([5.3, 0.0029, 25.0, 0.3])
"""Frequency (Hz), damping ratio, amplitude and phase (rad) of a decay."""


def intervals_of_a_mode() -> Iterator[Case]:
    """Half the widths of the 90 % intervals of frequency and ratio, by least squares about the truth."""
    from scipy.special import stdtrit

    time = 0.01 * np.arange(2000)

    def decay(f: float, ratio: float, amplitude: float, phase: float) -> NDArray[np.float64]:
        omega = 2 * math.pi * f
        angle = omega * math.sqrt(1 - ratio**2) * time + phase
        return np.asarray(amplitude * np.exp(-ratio * omega * time) * np.cos(angle))

    noise, steps = 0.25 * np.random.default_rng(3).standard_normal(time.size), 1e-6 * np.diag(MODE)
    slopes = [(decay(*(MODE + step)) - decay(*(MODE - step))) / (2 * step.max()) for step in steps]
    q, r = np.linalg.qr(np.column_stack([np.ones(time.size), time, *slopes]))
    freedom, misfit = time.size - r.shape[0], noise - q @ (q.T @ noise)
    exact = np.linalg.norm(np.linalg.inv(r), axis=1)[2:4] * np.linalg.norm(misfit) / math.sqrt(freedom)
    (mode,) = identify_decay(time, decay(*MODE) + noise).modes
    half_widths = 0.5 * np.ptp([mode.frequency_interval, mode.damping_ratio_interval], axis=1)
    pairs = zip((exact * stdtrit(freedom, 0.95)).tolist(), half_widths.tolist(), strict=True)
    for (quantity, unit), (reference, computed) in zip(
        (("frequency", "Hz"), ("damping ratio", "1")), pairs, strict=True
    ):
        yield Case(
            f"free decay with white noise: interval of the {quantity}", "derived here (Cramer-Rao bound)",
            "half its width", unit, reference, computed, 1e-3, "the misfit is bent within the noise of 1 %",
        )  # fmt: skip


BETWEEN = (-0.2, 1.2)
"""Bounds of the parameter of a calibration."""


def calibrated() -> Iterator[Case]:
    """The ends of the interval of a parameter, of which the logarithm of the peak is linear, from starts that scatter.

    Of n = 5 starts of the standard deviation s the range is 2.32593 s (Tippett, 1925), and the median has the variance
    pi s^2/(2 n). A peak is distributed as Student's t with 4 degrees of freedom.
    """
    import xarray

    starts, spread, measured = 5, 0.2, np.array([0.45, 0.5, 0.58])
    grid = {"ratio": np.linspace(*BETWEEN, 13), "base.frequency": np.arange(4.0, 7.0)}
    peaks, half = np.exp(grid["ratio"])[:, None] * np.ones(3), math.exp(0.5 * 2.32593 * spread)
    values = {
        "peak": peaks,
        "peak_low": peaks / half,
        "peak_high": peaks * half,
        "peak_groups": np.ones_like(peaks),
        "failure": np.full(peaks.shape, ""),
    }
    cases = xarray.Dataset({name: (tuple(grid), column) for name, column in values.items()}, grid, {"starts": starts})
    (fit,) = calibration_of(cases, ["ratio"], grid["base.frequency"], np.exp(measured), np.arange(3), 0.02).parameters
    sigma = math.sqrt((1 + math.pi / (2 * starts)) * spread**2 + 0.02**2 + 0.03**2)

    ratio = np.linspace(*BETWEEN, 100_001)
    share = np.cumsum(np.prod((1 + ((measured - ratio[:, None]) / sigma) ** 2 / 4) ** -2.5, axis=1))
    for side, quantile, computed in (("lower", 0.05, fit.low), ("upper", 0.95, fit.high)):
        yield Case(
            f"calibration from the scatter of {starts} starts: {side} end of its interval",
            "derived here (integrals of Student's t)", "parameter", "1",
            float(np.interp(quantile, share / share[-1], ratio)), computed, 2e-3, "trapezoids of 1/120 of the bounds",
        )  # fmt: skip


CASES = (starts_of_a_ball, intervals_of_a_mode, calibrated)
"""The cases of this subject, in the order of the table."""
