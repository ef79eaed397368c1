"""What a drive asks of the shaker, of the kept modes and of the duration beside its limits, before a run and by it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polyval
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.contact.laws import CompiledLaw
from femimpact.errors import InputError
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import Drives, Rest, named_parts
from femimpact.excitation.excitation import BrokenLine, Excitation, Harmonic, is_force
from femimpact.excitation.harmonic import Sine, SteppedSine
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, pieces_of
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.records import high_passed
from femimpact.excitation.remarks import FAR, drives_above_modes, is_pulse, late_drives, motion_warnings
from femimpact.excitation.sums import force_form_of
from femimpact.integrators.record_reading import DIFFERENCE, coarse_record, record_coarseness
from femimpact.response.cycles import PeakResolution, peak_resolution, resolution_warnings
from femimpact.structure.beam import realised_damping_ratio
from femimpact.system.contact_pair import ContactPair
from femimpact.system.matrices import rigid_motions
from femimpact.system.modes import Modes, first_elastic_frequency, first_resonance, solve_modes
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors
from femimpact.units import GRAVITY, number_text, quantity_text, rounded

MODES = 10
"""Lowest modes at which a chirp's rate is looked at."""

SAMPLES = 64
"""Instants in a cycle at which a motion of the base is read for its extremes, 0.12 % low at most."""

SWEEP_RATE, RATE_ADVISED = 0.2, 0.1
"""b = 2 pi rate/(zeta omega)^2 up to which a swept peak is 1 % low, and the one that is advised (0.3 % low)."""

READINGS, CLOSE = 5, 16
"""Instants at which a piece is read for its largest value, and how many of the pieces are then searched."""

DRIFT = 0.25
"""Slow motion of the base over the gap beyond which a record's drift drives the ball."""

BELOW_LINES = 0.05
"""Share of the largest density that a record's lowest half octave has, and of its energy below the lowest line."""

BEGINS, PERIODS = 0.25, 8.0
"""Share of a record's rms that its first period may have where a run begins at rest, and its periods at least."""

RMS_ERROR = 0.05
"""Relative standard error of the root mean square of a random response that is accepted."""

TRANSIENT_LEFT = 0.03
"""Share of the first mode's transient that may be left where measuring begins without a warning."""

LONGEST_CONTACT = 0.2
"""Contact time over the first period beyond which a contact is part of the motion, and no impact."""


# ---- one number of a planned test beside its limit --------------------------------------------------


@dataclass(frozen=True)
class PreflightRow:
    """One number of a planned test beside its limit.

    Parameters
    ----------
    what : str
        Name of the number, with the place, mode or key that it belongs to.
    value : float
        In `unit`.
    unit : str
    limit : float
        In `unit`; not a number where the row only informs.
    at_least : bool
        True where the value must not be below the limit, False where it must not be above.
    instead : str
        What to choose where the limit is passed; "" where it is kept.
    """

    what: str
    value: float
    unit: str
    limit: float = math.nan
    at_least: bool = False
    instead: str = ""

    @property
    def passed(self) -> bool:
        """True where the value is beyond the limit: the test does not show what it is made for."""
        return self.value < self.limit if self.at_least else self.value > self.limit

    def __str__(self) -> str:
        words = f"{self.what}: {_with_unit(self.value, self.unit)}"
        if not math.isnan(self.limit):
            words += f" (limit: at {'least' if self.at_least else 'most'} {_with_unit(self.limit, self.unit)})"
        return f"{words}; {self.instead}" if self.passed and self.instead else words


WITH_PREFIX = ("m", "s", "Pa")
"""Units of rows that are shown with the prefix that fits; Hz, m/s^2, g and others are read as they are."""


def _with_unit(value: float, unit: str) -> str:
    if unit in WITH_PREFIX:
        return quantity_text(value, unit)
    return f"{number_text(value)} {'' if unit == '1' else unit}".rstrip()


def row_of(
    what: str, value: float, unit: str, limit: float = math.nan, instead: str = "", *, at_least: bool = False
) -> PreflightRow:
    """A row whose advice is dropped where the limit is kept."""
    row = PreflightRow(what, float(value), unit, float(limit), at_least, instead)
    return row if row.passed else replace(row, instead="")


# ---- the motion of the base, and the modes that follow it ------------------------------------------


def base_rows(system: System, excitation: Excitation, duration: float | None) -> Iterator[PreflightRow]:
    """Largest displacement, velocity and acceleration that the shaker has to make, and the drift of a record."""
    if isinstance(excitation, Rest):
        return
    if isinstance(excitation, Drives):
        excitation = excitation.base
    if excitation is None or is_force(excitation):
        return
    if isinstance(excitation, Sine):
        place, omega = excitation.amplitude, excitation.omega
        sizes = [place, place * omega, place * omega**2]
    elif duration is not None:
        sizes = largest_motion(excitation, duration)
    else:
        return
    far = motion_warnings(excitation, system.length)
    # without their size of the motion, which is that of the row
    causes = "; ".join(text.rpartition(" m: ")[2] for text in far)
    limit = FAR * system.length if far else math.nan
    yield row_of("largest displacement of the base", sizes[0], "m", limit, causes)
    yield row_of("largest velocity of the base", sizes[1], "m/s")
    yield row_of("largest acceleration of the base", sizes[2], "m/s^2")
    yield row_of("largest acceleration of the base", sizes[2] / GRAVITY, "g")
    if isinstance(excitation, RandomBase):
        yield row_of("kurtosis of the random motion", excitation.kurtosis, "1")
        yield row_of("crest factor of the random motion", excitation.crest, "1")
        if excitation.clip is not None:
            yield row_of("share of the density lost by clipping", excitation.lost_share, "1")


def largest_motion(excitation: Excitation, duration: float) -> list[float]:
    """Largest |displacement| (m), |velocity| (m/s) and |acceleration| (m/s^2) of a base up to a time (s).

    Of polynomials they are exact: the largest at the ends of the pieces, from both sides, and where the derivative is
    zero. A motion without closed form is read 64 times in a cycle.
    """
    read = (excitation.displacement, excitation.velocity, excitation.acceleration)
    form = getattr(excitation, "closed_form", None)
    if not isinstance(form, (BrokenLine, PiecewisePolynomial)):
        cycles = min(duration * excitation.frequency, 1e5)
        at = np.linspace(0.0, duration, max(math.ceil(SAMPLES * cycles), 2))
        return [float(np.abs(values(at)).max()) for values in read]
    pieces = pieces_of(form)
    length = np.minimum(np.diff(pieces.knots), duration - pieces.knots[:-1])
    taylor, length = pieces.table[:-1][length > 0.0], length[length > 0.0]
    # after the last piece the base moves on uniformly
    last = [float(np.abs(values(duration))) for values in read]
    return [max(_largest_of_pieces(taylor[:, k:], length), last[k]) for k in range(3)]


def _largest_of_pieces(derivatives: Array, length: Array) -> float:
    """Largest |sum of d_j t^j/j!| over pieces of some lengths (s): roots of the derivative of those that come close."""
    if not length.size:
        return 0.0
    degree = int(np.flatnonzero(np.any(derivatives != 0.0, axis=0)).max(initial=0))
    c = np.ascontiguousarray(derivatives[:, : degree + 1].T)
    c /= np.array([math.factorial(j) for j in range(degree + 1)])[:, None]
    size = np.zeros(length.size)
    for share in np.linspace(0.0, 1.0, READINGS):
        size = np.maximum(size, np.abs(polyval(share * length, c, tensor=False)))
    largest = float(size.max())
    for i in np.argpartition(size, -min(CLOSE, size.size))[-CLOSE:]:
        roots = polyroots(polyder(c[:, i]))
        inside = roots.real[(roots.real > 0.0) & (roots.real < length[i])]
        largest = max(largest, float(np.abs(polyval(inside, c[:, i])).max(initial=0.0)))
    return largest


def _drift(system: System, record: Excitation, of: str) -> Iterator[PreflightRow]:
    """Largest change of a record's displacement below half of its lowest line, beside a quarter of the smallest gap.

    The lines are those above a tenth of the first natural frequency. The lowest one is that below which 5 % of the
    energy of the lowest half octave lies whose mean density is a twentieth of the largest one, or the first natural
    frequency where that is less.
    """
    line, first = getattr(record, "closed_form", None), first_elastic_frequency(system)
    gaps = [gap for pair in system.balls for gap in pair.gaps if math.isfinite(gap)]
    if not isinstance(line, BrokenLine) or is_pulse(line.samples) or not gaps or first == 0.0:
        return
    frequency, size = (column[line.spectrum[0] > 0.1 * first] for column in line.spectrum)
    lowest, octave = first, np.floor(2.0 * np.log2(frequency / (0.1 * first))).astype(int)
    density = np.bincount(octave, size**2) / 2.0 ** (0.5 * np.arange(octave.max(initial=-1) + 1))
    if density.any():
        inside = octave == int(np.argmax(density >= BELOW_LINES * density.max()))
        energy = np.cumsum(size[inside] ** 2)
        lowest = min(first, float(frequency[inside][np.searchsorted(energy, BELOW_LINES * energy[-1], side="right")]))
    # down to two digits, as it is advised
    corner = rounded(0.5 * lowest, math.floor)
    if corner * 2.0 * line.interval >= 1.0:
        return
    displacement = np.asarray(record.displacement(line.interval * np.arange(len(line.samples))))
    slow = displacement - high_passed(displacement, line.interval, corner)
    instead = (
        f"it moves the box around a ball at rest: take RecordedBase.from_csv(..., high_pass = {corner:g}) of this "
        "record, or from_displacement(..., high_pass) of its displacement"
    )
    what = f"drift of the record below {corner:g} Hz{of}"
    yield row_of(what, np.abs(slow - slow[0]).max(), "m", DRIFT * min(gaps), instead)


def drive_rows(
    system: System, excitation: Excitation, duration: float | None, initial: State
) -> Iterator[PreflightRow]:
    """Each drive beside the modes that are kept, its record, and what `plan_rows` says of it."""
    yield from (row for row in _of_histories(system, excitation, duration, initial) if math.isfinite(row.limit))
    end = math.inf if duration is None else initial.time + duration
    for which, begin, text in late_drives(excitation, end):
        yield row_of(f"begin of the drive{f', {which}' * bool(which)}", begin, "s", end, text)
    yield from plan_rows(system, excitation, duration, initial)


def drive_warnings(system: System, excitation: Excitation, end: float, initial: State) -> tuple[str, ...]:
    """Warnings of a drive up to a time (s): a base that moves far, what modes miss, a coarse or a moving record."""
    histories = _of_histories(system, excitation, end, initial)
    return (*motion_warnings(excitation, system.length), *(each.instead for each in histories if each.passed))


def _of_histories(system: System, excitation: Excitation, end: float | None, initial: State) -> Iterator[PreflightRow]:
    """Each history beside the modes that are kept, and each record up to a time (s) beside its samples and start."""
    if isinstance(excitation, Rest):
        return
    if initial.is_at_rest and initial.time == 0.0:
        yield from _begin_in_motion(system, excitation)
    for what, value, unit, limit, text in drives_above_modes(excitation, system.highest_kept, system.first_left_out):
        yield row_of(what, value, unit, limit, text)
    if end is None:
        return
    for drive in getattr(excitation, "drives", (excitation,)):
        interval, change = record_coarseness(system, drive, end)
        if math.isfinite(interval):
            what = f"change of the peak by straight lines between the samples of the record, {interval:.4g} s apart"
            yield row_of(what, abs(change), "1", DIFFERENCE, coarse_record(interval, change))


def _begin_in_motion(system: System, excitation: Excitation) -> Iterator[PreflightRow]:
    """The rms of a record's first period of the first mode over that of the whole record, which lasts 8 or more.

    One that is larger by more than its inverse is a shock that begins at once.
    """
    first = first_elastic_frequency(system)
    for which, _, part in named_parts(excitation):
        line = getattr(part, "closed_form", None)
        if not isinstance(line, BrokenLine) or is_pulse(line.samples):
            continue
        if first * line.interval * len(line.samples) < PERIODS:
            continue
        early = line.samples[: math.ceil(1.0 / (first * line.interval)) + 1]
        whole = float(np.std(line.samples))
        share = float(np.std(early)) / whole if whole > 0.0 else 0.0
        decay = 2.0 * math.pi * math.prod(first_resonance(without_impactors(system)))
        left = f"falls to 37 % every 1/(zeta omega) = {rounded(1.0 / decay):g} s" if decay > 0.0 else "stays"
        instead = (
            f"the record{f' of {which}' * bool(which)} begins in motion (rms of its first {1e3 / first:.3g} ms: "
            f"{100.0 * share:.3g} % of that of all), the run at rest: the transient of it {left}; begin with the "
            "measured State(displacement, velocity)"
        )
        limit = BEGINS if share < 1.0 / BEGINS else math.nan
        yield row_of("rms of the record's first period over that of the record", share, "1", limit, instead)


def plan_notes(system: System, excitation: Excitation, duration: float, initial: State) -> tuple[str, ...]:
    """Notes of a run of some duration (s) on its contacts, and on the limits of `plan_rows` that it passes."""
    rows = plan_rows(system, excitation, duration, initial)
    return (*contact_notes(system), *_passed(rows))


def contact_notes(system: System) -> tuple[str, ...]:
    """Notes on contacts that last long, and on those that are preloaded."""
    pressed = (pair for pair in system.contacts if pair.is_preloaded)
    preloads = (f"{pair.name} is in contact at rest, {pair.preload_words}" for pair in pressed)
    return (*_passed(contact_rows(system)), *preloads)


def _passed(rows: Iterable[PreflightRow]) -> tuple[str, ...]:
    try:
        return tuple(dict.fromkeys(str(row) for row in rows if row.passed))
    except InputError:
        # modes that are no numbers, of matrices that a run may take
        return ()


# ---- what a run shows of its drives, of every history by itself --------------------------------------


def plan_rows(
    system: System,
    excitation: Excitation,
    duration: float | None,  # s: of the run, from the start
    initial: State,
) -> Iterator[PreflightRow]:
    """Levels, chirps, steps, random motions and records, of each history, and the transient under a sine."""
    yield from _levels(system, excitation, initial)
    parts, modes = list(named_parts(excitation)), None
    bare = without_impactors(system)
    end = math.inf if duration is None else initial.time + duration
    for which, drive, part in parts:
        of = f", {which}" * bool(which)
        if isinstance(part, Chirp):
            modes = solve_modes(bare, min(MODES, bare.dofs)) if modes is None else modes
            yield from _sweep_rate(part, modes, (initial.time, end), of)
        elif isinstance(part, SteppedSine):
            yield from _steps(bare, part, (initial.time, end), of)
        elif isinstance(part, RandomBase) and duration is not None:
            yield from _random_error(bare, duration, of)
        elif not is_force(drive):
            yield from _drift(system, part, of)
    # a run that goes on is no longer settling
    sines = any(isinstance(part, Sine) and part.amplitude > 0.0 for _, _, part in parts)
    if sines and duration is not None and initial.time == 0.0:
        yield from transient_rows(system, 2.0 / 3.0 * duration, lambda end: f"duration = {rounded(1.5 * end):g} s")


def _levels(system: System, excitation: Excitation, initial: State) -> Iterator[PreflightRow]:
    """How many of the drives have a level, where one has none; nothing of a motion that begins without a drive."""
    parts = list(named_parts(excitation))
    silent = [which for which, drive, part in parts if _is_silent(drive, part)]
    free = not initial.is_at_rest or initial.is_static_on(system) or bool(np.any(system.constant_load))
    if silent and not (free and len(silent) == len(parts)):
        named = " and ".join(silent) or "the drive"
        instead = f"the level of {named} is zero, which moves nothing"
        count = len(parts) - len(silent)
        yield row_of("drives with a level above zero", count, "1", len(parts), instead, at_least=True)


def _is_silent(drive: Excitation, part: Excitation) -> bool:
    """True of a history whose closed form is zero everywhere."""
    form = force_form_of(part) if is_force(drive) else getattr(part, "closed_form", None)
    if isinstance(form, Harmonic):
        return form.amplitude == 0.0
    if isinstance(form, BrokenLine):
        return form.initial_velocity == 0.0 and not np.any(form.samples)
    # base at uniform speed moves what lies in space
    return isinstance(form, PiecewisePolynomial) and not np.any(form.coefficients) and not np.any(form.starts)


def contact_rows(system: System) -> Iterator[PreflightRow]:
    """Contact time of each pair beside the first period."""
    first = first_elastic_frequency(system)
    for pair in system.contacts:
        if pair.has_walls and not pair.parameters.is_rigid and first > 0.0:
            limit = LONGEST_CONTACT / first
            instead = f"take at most {rounded(limit, math.floor):g} s, a fifth of the first period"
            if getattr(pair.law, "contact_time", None) is not None:
                instead += ": is it in milliseconds?"
            elif isinstance(pair.law, CompiledLaw) and hasattr(pair.law, "stiffness"):
                instead += f", as with a stiffness of {_stiffness_within(pair, limit)}"
            yield row_of(f"contact time of {pair.name}", pair.parameters.contact_time, "s", limit, instead)


def _stiffness_within(pair: ContactPair, limit: float) -> str:
    """A stiffness with its unit, rounded up, with which the contact time of a law with one is within a limit (s)."""
    law: Any = pair.law
    while pair.parameters.contact_time > limit:
        # the time goes with a power of the stiffness, -1/2 of a linear spring
        factor = 1.01 * (pair.parameters.contact_time / limit) ** 2
        law = replace(law, stiffness=rounded(factor * law.stiffness, math.ceil))
        pair = replace(pair, law=law)
    return quantity_text(law.stiffness, law.shown_numbers(pair.effective_mass)[0][2])


def transient_rows(system: System, begin: float, take: Callable[[float], str]) -> Iterator[PreflightRow]:
    """Share of the first mode's transient that is left at a time (s) at which measuring begins."""
    first, ratio, left = transient_left(system, begin)
    decay = 2.0 * math.pi * first * ratio
    if decay > 0.0:
        needed = -math.log(TRANSIENT_LEFT) / decay
        instead = f"the last third is measured, which must begin after {rounded(needed):g} s: take {take(needed)}"
        yield row_of(f"transient of the first mode left at {begin:.3g} s", left, "1", TRANSIENT_LEFT, instead)


def transient_left(system: System, begin: float) -> tuple[float, float, float]:
    """Frequency (Hz) and damping ratio of the first mode's transient, and the share exp(-ratio omega t) left at t.

    With absorbers it is the sum of one transient more for each of them: the share is that of the sum, and frequency and
    ratio are those of the transient of which most is left.
    """
    bare = without_impactors(system)
    first = first_elastic_frequency(system)
    if system.rayleigh is None or first == 0.0:
        first, ratio = first_resonance(bare)
    else:
        ratio = float(realised_damping_ratio(*system.rayleigh, 2.0 * math.pi * first))
    omega = 2.0 * math.pi * first
    hung = [pair for pair in system.contacts if pair.kind == "absorber"]
    if not hung or omega == 0.0:
        return first, ratio, math.exp(-ratio * omega * begin)
    mode = solve_modes(bare, min(rigid_motions(bare).shape[1] + 1, bare.dofs)).vectors[:, -1]
    poles, shares = _first_mode_with(hung, mode, omega, ratio)
    left = shares * np.exp(poles.real * begin)
    longest = poles[np.argmax(left)]
    return float(abs(longest)) / (2.0 * math.pi), float(-longest.real / abs(longest)), min(float(left.sum()), 1.0)


def _first_mode_with(
    absorbers: Sequence[ContactPair], mode: Array, omega: float, ratio: float
) -> tuple[NDArray[np.complex128], Array]:
    """Poles (1/s) of a mode with absorbers on it, and their shares of its motion after it is let go."""
    n = len(absorbers) + 1
    # of the mode's coordinate and of the bodies: lengths of the springs between them
    lengths = np.column_stack([[pair.direction @ mode for pair in absorbers], -np.eye(n - 1)])
    of_mode, mass = np.diag(np.eye(n)[0]), np.array([1.0, *(pair.mass for pair in absorbers)])
    stiffness, damping = (
        own * of_mode + lengths.T @ np.diag([getattr(pair, name) for pair in absorbers]) @ lengths
        for own, name in ((omega**2, "free_stiffness"), (2.0 * ratio * omega, "free_damping"))
    )
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness / mass[:, None], -damping / mass[:, None]]])
    poles, vectors = np.linalg.eig(matrix)
    shares = np.abs(vectors[0] * np.linalg.pinv(vectors)[:, 0])
    return poles, shares


def step_rows(bare: System, f: Array, of: str) -> Iterator[PreflightRow]:
    """The step of frequencies (Hz) beside the first resonance and its width."""
    grid = grid_resolution(bare, f)
    if grid is not None:
        instead = "; ".join(resolution_warnings(grid))
        yield row_of(f"frequency step{of} at {grid.frequency:.4g} Hz", grid.step, "Hz", grid.step_needed, instead)


def grid_resolution(system: System, f: Array) -> PeakResolution | None:
    """Resolution of the first resonance by frequencies (Hz); None where it is not among them or has no width."""
    near, ratio = first_resonance(system)
    if np.unique(f).size < 2 or not f.min() < near < f.max() or ratio == 0.0:
        return None
    return peak_resolution(np.unique(f), near, 2.0 * ratio * near)


def _steps(bare: System, stepped: SteppedSine, time: tuple[float, float], of: str) -> Iterator[PreflightRow]:
    """Resonances within the steps of a sine that a run goes through, their distance, and the shortest dwell."""
    begins = np.cumsum(stepped.cycles_of_steps / stepped.steps) - stepped.cycles_of_steps / stepped.steps
    within = (begins >= time[0]) & (begins < time[1])
    f, cycles = stepped.steps[within], stepped.cycles_of_steps[within]
    if not f.size:
        return
    modes = solve_modes(bare, min(MODES, bare.dofs))
    inside = (modes.natural_frequency >= f.min()) & (modes.natural_frequency <= f.max())
    # dwells stand where the plan wants them
    count = float(np.count_nonzero(inside))
    yield row_of(f"natural frequencies within the sweep{of}", count, "1", math.nan, at_least=True)
    yield from step_rows(bare, f, of.replace(", ", " of "))
    settling = (cycles - cycles // 3) / f
    short = int(np.argmin(settling))

    def take(end: float) -> str:
        if stepped.seconds is not None:
            return f"seconds = {rounded(1.5 * end):g}"
        return f"cycles = {math.ceil(rounded(1.5 * end * float(f[short])))}"

    for row in transient_rows(bare, float(settling[short]), take):
        yield replace(row, what=f"{row.what} of a dwell{of}")


def _sweep_rate(chirp: Chirp, modes: Modes, time: tuple[float, float], of: str) -> Iterator[PreflightRow]:
    """B = 2 pi rate/(zeta omega)^2 of a chirp at each mode that it passes in a run, and the number of modes passed."""
    low, high = np.sort(chirp.frequency_at(np.minimum(time, chirp.duration))).tolist()
    passed = [
        (k + 1, float(f), float(zeta))
        for k, (f, zeta) in enumerate(zip(modes.natural_frequency, modes.damping_ratio, strict=True))
        if low < f < high
    ]
    first = float(modes.natural_frequency[modes.natural_frequency > 0.0].min(initial=math.inf))
    instead = f"no resonance is met: the first natural frequency is {first:.4g} Hz"
    # a run that goes on, and one after the chirp, pass none
    least = 1 if time[0] == 0.0 else math.nan
    yield row_of(f"natural frequencies that the chirp passes{of}", len(passed), "1", least, instead, at_least=True)
    for number, f, zeta in passed:
        logarithmic = chirp.kind == "logarithmic"
        rate = abs(f * math.log(chirp.stop / chirp.start) if logarithmic else chirp.stop - chirp.start) / chirp.duration
        # of the rate in Hz/s, in the unit of the plan
        unit, of_rate = ("oct/min", 60.0 / (f * math.log(2.0))) if logarithmic else ("Hz/s", 1.0)
        what = f"sweep rate b = 2 pi rate/(zeta omega)^2 at mode {number} ({f:.4g} Hz){of}"
        decay = 2.0 * math.pi * zeta * f
        if decay == 0.0:
            yield row_of(what, math.inf, "1", SWEEP_RATE, "an undamped mode has no steady peak: give a damping ratio")
            continue
        b = 2.0 * math.pi * rate / decay**2
        advised = RATE_ADVISED * decay**2 / (2.0 * math.pi)
        instead = (
            f"the peak is {swept_peak(b):.2g} of the steady one at {rate * of_rate:.3g} {unit}: take "
            f"{rounded(advised * of_rate, math.floor):g} {unit} (b = "
            f"{RATE_ADVISED:g}), duration = {rounded(chirp.duration * rate / advised):g} s"
        )
        yield row_of(what, b, "1", SWEEP_RATE, instead)


def swept_peak(b: float) -> float:
    """Largest envelope over the steady peak of a mode that is swept at b = 2 pi rate/(zeta omega)^2 > 0.

    |integral_0^inf exp(-u + i b (tau - u)^2/2) du|, largest over tau = zeta omega t. With p = -i b/2 and
    q = 1 + i b tau the integral of exp(-q u - p u^2) is sqrt(pi/p)/2 exp(q^2/4p) erfc(q/(2 sqrt(p))).
    """
    from scipy.optimize import minimize_scalar

    at = np.linspace(-2.0, 3.0 + 6.0 / math.sqrt(b), 401)
    values = swept_envelope(b, at)
    near = int(np.argmax(values))
    bounds = (at[max(near - 1, 0)], at[min(near + 1, at.size - 1)])
    peak = minimize_scalar(lambda tau: -float(swept_envelope(b, np.array([tau]))[0]), bounds=bounds, method="bounded")
    return float(-peak.fun)


def swept_envelope(b: float, tau: Array) -> Array:
    """Envelope over the steady peak at tau = zeta omega t after the resonance; see `swept_peak`."""
    from scipy.special import wofz

    # exp(z^2) erfc(z) = w(i z) of the Faddeeva function
    p = np.sqrt(-0.5j * b)
    return np.asarray(np.abs(0.5 * np.sqrt(np.pi) / p * wofz(1j * (1.0 + 1j * b * tau) / (2.0 * p))))


def _random_error(bare: System, duration: float, of: str) -> Iterator[PreflightRow]:
    """Relative standard error of the rms of the first mode's response to a stationary Gaussian motion.

    The correlation exp(-zeta omega |t|) cos(omega t) gives the mean square over a time T the relative variance
    1/(zeta omega T), the rms half of its square root (derived here). A ball that takes energy makes it smaller.
    """
    f, zeta = first_resonance(bare)
    decay = 2.0 * math.pi * f * zeta
    if decay == 0.0:
        return
    instead = f"take a duration of at least {rounded((0.5 / RMS_ERROR) ** 2 / decay):g} s"
    what = f"standard error of the rms of the whole run without balls under a random motion{of}"
    yield row_of(what, 0.5 / math.sqrt(decay * duration), "1", RMS_ERROR, instead)
