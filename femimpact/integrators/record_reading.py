"""Warning of a coarse record: peaks without contacts by straight lines and by a cubic spline through its samples."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import InputError
from femimpact.excitation.drives import parts_in
from femimpact.excitation.excitation import BrokenLine, Excitation
from femimpact.integrators.channel_rows import Drive, drive_of
from femimpact.system.modes import solve_modes
from femimpact.system.system import System
from femimpact.units import number_text

DIFFERENCE = 0.01
"""Difference of the peak by straight lines from that by a cubic spline, as a share of the latter, above which a
warning is given."""

MODES = 2
"""Number of the structure's lowest modes from which the peak is computed."""

PER_CYCLE, LEAST = 24, 6
"""Instants in a cycle of the first of these modes, and of the fastest one, which adds little to the peak."""

PIECE = 1 << 15
"""Instants that are gone through at once."""

BESIDE = 40
"""Samples beyond a piece that its spline goes through: what lies farther changes it by 0.27^40."""

STIFF = 0.7
"""Damping ratio of a mode above half the sampling rate, which follows the record as if at rest."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)


def coarse_record(
    interval: float,  # s
    change: float,
) -> str:
    """A warning where straight lines through a record change the peak of a cubic spline by more than 1 %; else ""."""
    if abs(change) <= DIFFERENCE:
        return ""
    side = "below" if change < 0.0 else "above"
    # the difference goes with the square of the interval, where that is long with less: half of what follows from it
    needed = 0.5 * interval * math.sqrt(DIFFERENCE / abs(change))
    return (
        f"the record is coarse: straight lines between its samples, {interval:.4g} s apart, give a peak without "
        f"contacts {number_text(100.0 * abs(change), 2)} % {side} that of a cubic spline through them; sample it "
        f"faster, every {number_text(needed, 2)} s"
    )


def record_coarseness(
    system: System,
    excitation: Excitation,
    end: float,  # s
) -> tuple[float, float]:
    """Interval (s) of a record, infinite where there is none, and by how much straight lines change the peak.

    Compared with a cubic spline through the samples is the default place's peak up to a time, from rest at t = 0, of
    the structure without contacts in its first mode, and the second one if that is below half the sampling rate.
    """
    forms = (getattr(part, "closed_form", None) for part in parts_in(excitation))
    records = [form for form in forms if isinstance(form, BrokenLine)]
    if not records or end <= 0.0:
        return math.inf, 0.0
    interval = min(line.interval for line in records)
    try:
        by_lines, by_spline = _peaks(replace(system, contacts=()), excitation, records, end)
    except InputError:
        # modes that are no numbers, of matrices that a run may take
        return interval, 0.0
    return interval, by_lines / by_spline - 1.0 if by_spline > 0.0 else 0.0


def _peaks(bare: System, excitation: Excitation, records: list[BrokenLine], end: float) -> tuple[float, float]:
    """Largest |w| (m) of the default place by straight lines and by cubic splines."""
    drive, interval = drive_of(bare, excitation), min(line.interval for line in records)
    poles, shares = _modes(bare, drive, 0.5 / interval)
    if not poles.size:
        return 0.0, 0.0
    turns = interval * np.abs(poles) / (2.0 * math.pi)
    # the samples of the shortest record are instants
    step = interval / max(math.ceil(max(PER_CYCLE * turns[0], LEAST * turns[-1])), 1)
    inside = 0.5 * step * (1.0 + NODES)
    # integral of e^{lambda (step - t)} s(t) over a step, its real and imaginary part: a real product is fast
    weights = (0.5 * step * WEIGHTS * np.exp(poles[:, None] * (step - inside))).T.copy().view(float)
    held, peaks = np.zeros((2, poles.size), dtype=complex), np.zeros(2)
    count = max(math.ceil(end / step - 1e-6), 1)
    for first in range(0, count, PIECE):
        time = np.asarray(step * np.arange(first, min(first + PIECE, count)))
        within = time[:, None] + inside
        by_lines = drive.value(within.ravel()).reshape(within.shape)
        more = sum((_beside_lines(line, within) for line in records), np.zeros_like(by_lines))
        motion = np.zeros((2, time.size))
        for which, history in enumerate((by_lines, more)):
            pushes = (history @ weights).view(complex)
            for mode, pole in enumerate(poles):
                z = _recurrence(np.exp(pole * step), pushes[:, mode], held[which, mode])
                held[which, mode] = z[-1]
                motion[which] += shares[mode] * z.imag
        motion[1] += motion[0]
        peaks = np.maximum(peaks, np.abs(motion).max(axis=1))
    return float(peaks[0]), float(peaks[1])


def _modes(bare: System, drive: Drive, most: float) -> tuple[NDArray[np.complex128], Array]:
    """Poles (1/s) of the elastic modes up to a frequency (Hz), and w of the default place by their imaginary parts."""
    modes = solve_modes(bare, min(MODES, bare.dofs))
    elastic = modes.natural_frequency > 0.0
    natural, ratio, vectors = modes.natural_frequency[elastic], modes.damping_ratio[elastic], modes.vectors[:, elastic]
    count = max(int(np.count_nonzero(natural < most)), 1)
    natural, ratio, vectors = natural[:count], ratio[:count], vectors[:, :count]
    ratio = np.where(natural < most, np.minimum(ratio, STIFF), STIFF)
    omega = 2.0 * math.pi * np.minimum(natural, most)
    poles = omega * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
    return poles, (bare.point_row(bare.default_place) @ vectors) * (drive.load @ vectors) / poles.imag


def _beside_lines(line: BrokenLine, time: Array) -> Array:
    """The cubic spline through samples less the straight lines, at rising times (s); zero beyond the last sample."""
    from scipy.interpolate import CubicSpline

    samples, h = np.asarray(line.samples, dtype=float), line.interval
    first = max(int(time[0, 0] / h) - BESIDE, 0)
    last = min(int(time[-1, -1] / h) + BESIDE, samples.size)
    if last - first < 3:
        return np.zeros_like(time)
    knots, values = h * np.arange(first, last), samples[first:last]
    apart = CubicSpline(knots, values)(time) - np.interp(time, knots, values)
    return np.where(time < h * (samples.size - 1), apart, 0.0)


def _recurrence(factor: complex, added: NDArray[np.complex128], before: complex) -> NDArray[np.complex128]:
    """z_k = factor z_{k-1} + added_k from a value before the first, in rows of which each is one cumulative sum."""
    width = max(min(int(20.0 / max(-math.log(abs(factor)), 1e-300)), 256), 1)
    rows = np.zeros((-(-added.size // width), width), dtype=complex)
    rows.ravel()[: added.size] = added
    powers = factor ** np.arange(1, width + 1)
    rows = np.cumsum(rows / powers, axis=1) * powers
    starts = np.empty(len(rows), dtype=complex)
    for row, end in enumerate(rows[:, -1]):
        starts[row] = before
        before = powers[-1] * before + end
    return np.asarray((rows + powers * starts[:, None]).ravel()[: added.size])
