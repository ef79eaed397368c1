"""Warnings and notes on a motion of the base that is allowed, and so unusual that another one may have been meant."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import named_parts
from femimpact.excitation.excitation import BrokenLine, Excitation, holds_drives, is_force
from femimpact.excitation.harmonic import SteppedSine
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.shock import Shock
from femimpact.excitation.sums import Sum

FAR = 0.5
"""Displacement of the base over the length of the beam beyond which a wrong unit, or an offset, is likely."""

PARTS, FEW = 50, 12
"""Equal parts of a record, and in how many of them a pulse changes the velocity."""

ELSEWHERE = 0.25
"""Share of the total change of velocity that the other parts may have, their sizes summed, beside a pulse."""

AT_REST = 0.5
"""Share of the mean of a record below which its ends lie at rest."""

LEAST_CHANGE = 1e-3
"""Share of the integral of |a| below which the integral of a is that of an oscillation."""

ROUNDING = 1e-9
"""Share of |a| that is left where all has been removed: of the sum of a without its mean, or of a straight record."""

ONE_SIGNED = 0.5
"""Share of the integral of |a| that the integral of a has in a pulse with little rest before and after."""

NEXT = 0.25
"""Share of the first natural frequency left out, below which that mode follows as if at rest: to 7 %, (1/4)^2."""

BESIDE = 1.1
"""Frequency over that of the highest mode kept up to which that mode follows a drive, the next one being farther."""

ENERGY_ABOVE = 0.01
"""Share of a drive's energy above the modes that is warned of: 10 % of its amplitude."""


LEVEL_ERROR = 1e-6
"""Share of a level over frequency that a note is given from."""


# ---- how far the base moves ----------------------------------------------------------------------


def motion_warnings(
    # of one whose closed form is a `BrokenLine` the mean of its samples is named. Of a sum each part is looked at, and
    # then what those that are no pulses move together.
    excitation: Excitation,
    length: float,  # m: 0 for a structure without one, beside which nothing is far
) -> tuple[str, ...]:
    """A warning where the base moves further than half the length of the beam, or a pulse lacks its mean.

    A pulse that moves the base away has a note instead (`motion_notes`).
    """
    if holds_drives(excitation):
        return tuple(text for drive in excitation.drives for text in motion_warnings(drive, length))  # type: ignore[attr-defined]
    if isinstance(excitation, Sum):
        of_parts = [text for part in excitation.parts for text in motion_warnings(part, length)]
        if of_parts:
            return tuple(dict.fromkeys(of_parts))
    line, far = getattr(excitation, "closed_form", None), _distance(excitation)
    if isinstance(line, BrokenLine) and getattr(excitation, "at", None) is None:
        removed = _removed_of_pulse(line)
        if removed or is_pulse(line.samples):
            return removed
    if not 0.0 < FAR * length < far:
        return ()
    moved = f"the base moves by up to {far:.4g} m, beside a beam of {length:.4g} m"
    if not isinstance(line, BrokenLine):
        bring = "pulses leave it with a velocity, from which compensated = true brings it back to its place"
        return (f"{moved}: {bring if isinstance(excitation, Shock) else 'is the amplitude of the base in metres?'}",)
    mean = float(line.samples.mean())
    return (
        f"{moved}: the mean acceleration of its record is {mean:.3g} m/s^2; remove offset and drift first, as "
        'RecordedBase.from_csv(..., detrend="line") does; is the record in m/s^2?',
    )


def _distance(excitation: Excitation) -> float:
    """Largest displacement of the base (m), in a sum that of the parts whose record is no pulse."""
    if not isinstance(excitation, Sum):
        return float(excitation.amplitude)
    forms = [(part, getattr(part, "closed_form", None)) for part in excitation.parts]
    return sum(_distance(part) for part, form in forms if not (isinstance(form, BrokenLine) and is_pulse(form.samples)))


def _removed_of_pulse(line: BrokenLine) -> tuple[str, ...]:
    """A warning of a pulse without its mean: its samples sum up to nothing, and it is one beside their usual level.

    That is the line through the medians of the first and of the last third. A pulse that takes more than half of a
    third is not recognised.
    """
    a = np.asarray(line.samples, dtype=float)
    third = max(a.size // 3, 1)
    early, late = float(np.median(a[:third])), float(np.median(a[-third:]))
    # through the middles of both thirds, where a pulse hardly moves the median
    first, last = early - (late - early) / 4.0, late + (late - early) / 4.0
    level = a - np.linspace(first, last, a.size)
    size = float(np.abs(a).sum())
    if (
        abs(float(a.sum())) > ROUNDING * size
        or abs(_total(level)) <= LEAST_CHANGE * size
        or not _changes_at_once(level)
    ):
        return ()
    change = line.interval * _total(level)
    return (
        f"the record is a pulse that changes the velocity of the base by {change:.3g} m/s, without its mean: "
        f"its samples at rest go from {first:.3g} to {last:.3g} m/s^2, and its peak is wrong by as much; take "
        'it as it was measured (detrend = "none")',
    )


def motion_notes(
    excitation: Excitation,
    length: float,
    end: float,
) -> tuple[str, ...]:
    """Notes where a run ends (s) before a drive begins or after the record, and where a pulse moves the base away."""
    notes = [text for *_, text in late_drives(excitation, end)]
    for which, drive, part in named_parts(excitation):
        notes += _of_part(part, is_force(drive), length)
        if is_force(drive) or part is not drive:
            notes += _after_its_end(which or "the force", part, end)
    for drive in getattr(excitation, "drives", (excitation,)):
        notes += [] if is_force(drive) else _base_moves_on(getattr(drive, "closed_form", None), end)
    return tuple(dict.fromkeys(notes))


def late_drives(excitation: Excitation, end: float) -> Iterator[tuple[str, float, str]]:
    """Which histories begin after the end of a run (s), when (s), and a note on it."""
    for which, _, part in named_parts(excitation):
        line = getattr(part, "closed_form", None)
        if isinstance(line, PiecewisePolynomial) and end <= line.knots[0]:
            without = "it does not act" if which else "nothing drives it"
            begins = f"{which or 'the excitation'} begins at {line.knots[0]:.6g} s"
            yield which, float(line.knots[0]), f"the run ends at {end:.6g} s, before {begins}: {without}"


def _after_its_end(
    which: str,
    history: Excitation,  # a force, or a part of a sum
    end: float,
) -> tuple[str, ...]:
    """A note where a run ends (s) after a history, unless that is a pulse: what follows is meant."""
    line = getattr(history, "closed_form", None)
    if isinstance(line, BrokenLine):
        last = math.inf if is_pulse(line.samples) else (len(line.samples) - 1) * line.interval
    else:
        last = history.duration if isinstance(history, (Chirp, RandomBase, SteppedSine)) else math.inf
    if end <= 1.01 * last:
        return ()
    return (f"the run ends at {end:.6g} s, {which} at {last:.6g} s: from there on it does not act",)


def _of_part(part: Excitation, is_of_force: bool, length: float) -> Iterator[str]:
    """What a history says itself, what clipping takes from its density, a level that bends, a pulse that moves far."""
    if note := str(getattr(part, "note", "")):
        yield note
    if isinstance(part, RandomBase) and part.clip is not None:
        yield (
            f"the random motion is clipped at {part.clip:g} root mean squares: {100.0 * part.lost_share:.3g} % of the "
            f"mean square of its density is lost, its kurtosis is {part.kurtosis:.4g}, its crest factor "
            f"{part.crest:.4g}"
        )
    if is_of_force:
        return
    error, frequency = part.level_error if isinstance(part, Chirp) else (0.0, 0.0)
    if error > LEVEL_ERROR:
        yield (
            f"the level over frequency bends sharply: so that the base does not drift, an acceleration of up to "
            f"{100.0 * error:.2g} % of the level is added, the most at {frequency:.4g} Hz"
        )
    line, far = getattr(part, "closed_form", None), float(part.amplitude)
    if isinstance(line, BrokenLine) and 0.0 < FAR * length < far and is_pulse(line.samples):
        change = line.interval * _total(np.asarray(line.samples, dtype=float))
        yield (
            f"a pulse changes the velocity of the base by {change:.3g} m/s for good, so that it moves by up to "
            f"{far:.4g} m: no offset is to be removed; motion relative to the base depends on the pulse alone"
        )


def _base_moves_on(line: Any, end: float) -> Iterator[str]:
    """A note where a run ends (s) after the closed form of a motion of the base; it ends at a step or sample."""
    if isinstance(line, PiecewisePolynomial):
        what, last, speed = "excitation", line.duration, float(line.starts[-1, 1])
        late, rests = 0.01 * abs(last), abs(speed) <= ROUNDING * float(np.abs(line.starts[:, 1]).max())
    elif isinstance(line, BrokenLine):
        what, last = "record", (len(line.samples) - 1) * line.interval
        late, rests, speed = 1.5 * line.interval, False, float(line.motion_at(last)[1])
    else:
        return
    if end > last + late:
        moving = "rests" if rests else f"moves on at {speed:.3g} m/s"
        ends = f"the run ends at {end:.6g} s, the {what} at {last:.6g} s"
        yield f"{ends}: from there on the base {moving}, without acceleration"


def _total(samples: Array) -> float:
    """Integral of the broken line, per interval."""
    return float(samples.sum() - 0.5 * (samples[0] + samples[-1]))


def is_pulse(
    samples: Array,  # (n,) m/s^2
) -> bool:
    """True if a record of accelerations is a pulse, whose change of velocity is true, and no offset or drift.

    Of 50 equal parts of the record, the 12 with the largest changes of velocity are where the pulse is. It is one if
    the sizes of the changes in the other 38 sum up to no more than 25 % of the total change: 76 % under an offset, 56 %
    under a line from zero, nothing beside a pulse of less than a quarter of the record. A record that is little more
    than the pulse is one where its first and its last 2 % are each closer to zero, in the mean, than half of the mean
    of all samples, and |integral of a| is at least half of the integral of |a|: an offset does not begin at zero, and
    an oscillation is of both signs. Where |integral of a| is below 1/1000 of the integral of |a| nothing has
    changed the velocity.
    """
    total, size = abs(_total(samples)), float(np.abs(samples).sum())
    if total <= LEAST_CHANGE * size:
        return False
    # means of the first and of the last 2 %
    few = max(samples.size // PARTS, 1)
    ends = max(abs(float(samples[:few].mean())), abs(float(samples[-few:].mean())))
    bare = ends < AT_REST * abs(float(samples.mean())) and total >= ONE_SIGNED * size
    return bare or _changes_at_once(samples)


def _changes_at_once(samples: Array) -> bool:
    """True if the velocity hardly changes but in a quarter of the record."""
    of_intervals = 0.5 * (samples[1:] + samples[:-1])
    changes = np.sort([abs(float(part.sum())) for part in np.array_split(of_intervals, PARTS)])
    total = abs(float(of_intervals.sum()))
    return of_intervals.size >= PARTS and float(changes[:-FEW].sum()) <= ELSEWHERE * total


# ---- what the kept modes cannot follow -----------------------------------------------------------


def drives_above_modes(
    excitation: Excitation,
    highest: float,  # Hz: of the modes kept
    # Hz: the lowest natural frequency that is left out; infinite where none is, which gives no limit. Below a quarter
    # of it that mode follows as if at rest, and nothing is said, nor up to 10 % above the highest mode kept where the
    # next one is farther from the drive.
    left_out: float,
) -> Iterator[tuple[str, float, str, float, str]]:
    """What of each history is compared with the kept modes: its name, value, unit and limit, and a warning or "".

    A sine, and what else has no closed form by samples, is compared by its frequency, a record by the share of the
    energy of its acceleration, or force, above the highest frequency that the modes follow. Its line of least squares
    is no part of it. Of a chirp that is the share of its time, of a random motion that of its mean square.
    """
    for which, _, part in named_parts(excitation):
        what, value, unit, limit = _above_modes(part, _limit(highest, left_out))
        texts = frequency_warnings([value], highest, left_out) if unit == "Hz" else ()
        if unit != "Hz" and value > limit:
            words = what.removeprefix("share of the ").replace(" above ", " is above ")
            texts = (f"{100.0 * value:.3g} % of the {words}, where {_kept(highest, left_out)}",)
        of = f", {which}" * bool(which)
        yield f"{what}{of}", value, unit, limit, "".join(f"{which}: {text}" if which else text for text in texts)


def _above_modes(history: Excitation, limit: float) -> tuple[str, float, str, float]:
    line = getattr(history, "closed_form", None)
    if isinstance(history, (Chirp, RandomBase)):
        share, of = _band_above(history, limit)
        return f"share of the {of} above {limit:.4g} Hz", share, "1", ENERGY_ABOVE
    if isinstance(line, BrokenLine):
        share = _energy_above(line, limit) if math.isfinite(limit) else 0.0
        return f"share of the energy of the record above {limit:.4g} Hz", share, "1", ENERGY_ABOVE
    return "frequency of the drive", float(history.frequency), "Hz", limit


def frequency_warnings(frequencies: ArrayLike, highest: float, left_out: float) -> tuple[str, ...]:
    """A warning where sines of some frequencies (Hz) are above the modes; see `drives_above_modes`."""
    f = np.ravel(frequencies)
    above = f > _limit(highest, left_out)
    if not np.any(above):
        return ()
    which = f", at {np.count_nonzero(above)} of {f.size} frequencies" if f.size > 1 else ""
    most = f"{f.max():.4g} Hz"
    words = f"the drive is at {'up to ' if which else ''}{most}{which}, where {_kept(highest, left_out)}"
    return (f"{words}: all up to {most}",)


def _band_above(excitation: Chirp | RandomBase, limit: float) -> tuple[float, str]:
    """Share of a chirp's time, or of the mean square of a random motion, above a frequency (Hz), and words for it."""
    if isinstance(excitation, Chirp):
        frequency = excitation.frequency_at(excitation.duration * np.linspace(0.0, 1.0, 10_001))
        return float(np.mean(frequency > limit)), "time of the chirp"
    frequency, level = excitation.lines[:2]
    return float(np.sum(level[frequency > limit] ** 2) / np.sum(level**2)), "mean square of the random motion"


def _limit(highest: float, left_out: float) -> float:
    """Frequency (Hz) up to which the kept modes follow a drive."""
    return max(min(BESIDE * highest, 0.5 * (highest + left_out)), NEXT * left_out)


def _kept(highest: float, left_out: float) -> str:
    return (
        f"no mode is kept: the highest one kept is at {highest:.4g} Hz, the next one, left out, at {left_out:.4g} Hz; "
        "keep more modes"
    )


def _energy_above(line: BrokenLine, limit: float) -> float:
    """Share of the energy of the samples without their line of least squares above a frequency (Hz)."""
    frequency, lines = line.spectrum
    energy, n = lines**2, len(line.samples)
    if not energy.any():
        return 0.0
    # all lines but the first, and the last of an even number, stand for two
    energy[1 : n - n // 2] *= 2.0
    return float(energy[frequency > limit].sum() / energy.sum())
