"""A prepared study: mesh, systems, methods and record, the grid of its sweep, and an estimate of memory and time."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.app.study.study import Study, SweepPlan, build_systems, check_method, method_for, read_mesh_of
from femimpact.errors import InputError, faults_under, require
from femimpact.excitation.drives import Rest
from femimpact.excitation.excitation import Excitation, has_cycle
from femimpact.excitation.harmonic import Sine
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.remarks import frequency_warnings, motion_warnings
from femimpact.fem.mesh import Mesh
from femimpact.integrators.cases import check_memory, memory_needed, workers_of
from femimpact.integrators.methods import AT_ONCE, Method, bytes_of_cycle, seconds_of_cycle, stride_of
from femimpact.integrators.planned_drive import drive_warnings
from femimpact.response.channels import resolve_channels
from femimpact.response.cycles import PeakResolution
from femimpact.response.response import Recorder
from femimpact.structure.structure import Structure
from femimpact.system.hermite import needs_outer_fibre
from femimpact.system.modes import DENSE_LIMIT, first_elastic_frequency, first_resonance, solve_modes
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors
from femimpact.units import number_text

PARTS = ("modes", "simulate", "sweep")
"""Names of the parts of `run_study`."""

FIGURE_CYCLES = 40
"""Base cycles at the end of a history that figures show at every step."""

ROOT_STRESS = "root.surface_stress"

LEAST_SAMPLES = 20
"""Samples of a base cycle below which a history has a warning: their spacing may hide 1 % of a sine's maximum."""

USUAL_STRIDE = 10
"""One of so many steps is kept in a history unless the study says otherwise or a base cycle has too few."""


IN_PYTHON = {
    r"response\.time": "base.history",
    r"by Recorder\(interval=\)": "by output.interval",
    r"Recorder\(interval=\) sets another one, and largest\(channel\) of the response finds what lies between": (
        "output.interval sets another one; the largest values of the summary are exact between the readings too"
    ),
    r"impacts\.peak_force": "impacts.csv",
    r"a smaller every, or Recorder\(interval=\) of EventDriven,": (
        "a smaller output.every, or output.interval of the event-driven method,"
    ),
    r'as RecordedBase\.from_csv\(\.\.\., detrend="line"\) does': 'by base.detrend = "line"',
    r"RecordedBase\.from_csv\(\.\.\., (high_pass = [^)]*)\) of this record.*": r"base.\1",
}
"""What warnings and notes name in Python, and the keys of a study file that do the same."""


def in_study_words(text: str) -> str:
    """A warning, a note or a fault with keys of the study file in place of names of Python."""
    for named, key in IN_PYTHON.items():
        text = re.sub(named, key, text)
    return text


def carried_words(system: System) -> str:
    """What a structure carries, or meets: "ball", "balls", "absorber", "ball and absorber", "stop", ..."""
    counts = counts_of(system)
    if counts["ball"] or counts["absorber"]:
        counts["stop"] = 0
    return " and ".join(f"{name}{'s' if count > 1 else ''}" for name, count in counts.items() if count) or "ball"


def without_carried(system: System) -> System:
    """The system without what `carried_words` names: its balls and absorbers, or its stops where it has no others."""
    return without_impactors(system) if system.balls else replace(system, contacts=())


def counts_of(system: System) -> dict[str, int]:
    """Numbers of balls, absorbers and stops."""
    kinds = {"ball": "impactor", "absorber": "absorber", "stop": "stop"}
    return {word: sum(pair.kind == kind for pair in system.contacts) for word, kind in kinds.items()}


@dataclass(frozen=True, eq=False)
class PreparedStudy:
    """A study with the mesh, systems, methods and record of its run."""

    study: Study
    mesh: Mesh | None  # of the study's file; None where it gives a number of elements
    full: System  # that of the mesh, and the one that is integrated
    small: System
    bare: System  # the one that is integrated, without what it carries or meets
    method: Method  # with the steps for `small` and `bare`
    bare_method: Method
    record: Recorder  # what the history keeps
    grid: float  # s: between instants at which the history can be read
    warnings: tuple[str, ...] = ()

    @property
    def carried(self) -> str:
        """What the structure carries, in words."""
        return carried_words(self.small)

    @cached_property
    def initial(self) -> State:
        """State of the system that is integrated at the start."""
        return self.study.initial_on(self.small)


def prepare(study: Study, parts: tuple[str, ...] = PARTS) -> PreparedStudy:
    """Make a study ready, and find all that can be wrong with a run before its first long step.

    Parameters
    ----------
    study : Study
    parts : tuple of str
        Of `PARTS`: which of them will run.

    Raises
    ------
    InputError
        If mesh or sweep would not fit, the step does not resolve contact or base, or the history would keep too much.
    CoreError
        If the compiled core cannot be loaded.
    """
    core.build_info()
    mesh = read_mesh_of(study)
    elements = study.mesh.elements if mesh is None else mesh.nodes.size - 1
    check_mesh(study, elements or 1)
    full, small = build_systems(study, mesh)
    method = method_for(study, small)
    of_method, bare = check_method(study, small, method), without_carried(small)
    record, grid = history_record(study, small, method)
    _check_channels(study, small)
    prepared = PreparedStudy(study, mesh, full, small, bare, method, method_for(study, bare), record, grid)
    texts = (*of_method, *_coarse_history(prepared), *_empty_sweep(prepared, parts), *_of_drives(prepared, parts))
    _check_drives(prepared, parts)
    return replace(prepared, warnings=tuple(map(in_study_words, texts)))


def with_base(prepared: PreparedStudy, base: Sine) -> PreparedStudy:
    """The same study with another sine of its base: the systems and methods stay, the record is made anew."""
    study = replace(prepared.study, base=base)
    record, grid = history_record(study, prepared.small, prepared.method)
    return replace(prepared, study=study, record=record, grid=grid)


def film_window(study: Study, small: System, largest: float = math.inf) -> tuple[float, float]:
    """Begin and end (s) of the snapshots: the last cycles, without a cycle those of the first mode around a time (s).

    They begin a period before that of the largest motion, and end with the run at the latest.
    """
    end, frequency = study.history_duration, study.shown_frequency
    if not has_cycle(study.excitation):
        frequency = first_elastic_frequency(small) or frequency
    kept = min(study.output.frame_cycles / frequency, end)
    begin = min(max(largest - 1.0 / frequency, 0.0), end - kept)
    return begin, begin + kept


def history_record(study: Study, small: System, method: Method) -> tuple[Recorder, float]:
    """The recorder of the study's history, and the time (s) between instants at which that can be read.

    It keeps stress, channels of every place with a ball and of the balls, and snapshots.

    Raises `InputError` if the study gives an interval that the method does not take.
    """
    output, asked = study.output, Recorder(interval=study.output.interval)
    try:
        grid = method.time_grid(small, study.excitation, study.history_duration, asked)
    except InputError as error:
        renamed = {"record.interval": "output.interval"}
        raise InputError([replace(fault, key=renamed.get(fault.key, fault.key)) for fault in error.faults]) from None
    every = output.every
    if every is None:
        # so many that a base cycle is resolved
        every = min(USUAL_STRIDE, stride_of(method, study.excitation.frequency, LEAST_SAMPLES))
    begin, end = film_window(study, small)
    observed = small.default_place
    channels: list[str | float] = [observed, f"{observed}.velocity", "mid", *root_stress(study.structure, small)]
    for pair in small.contacts:
        # a place without a name by its distance from the root
        place = next((name for name, x in small.points.items() if x == pair.position), str(pair.position))
        if place != observed:
            channels += [place, f"{place}.velocity"]
        moving = [] if pair.is_stop else [pair.name, f"{pair.name}.velocity"]
        channels += [*moving, f"{pair.name}.contact_force" if pair.has_walls else f"{pair.name}.gap"]
    record = replace(
        asked,
        channels=tuple(dict.fromkeys([*channels, *output.channels])),
        every=every,
        snapshots=max(round((end - begin) / (output.frames * grid)), 1) if output.frames else 0,
        snapshots_start=begin,
        state_at=last_cycles_start(study, small),
        memory_limit=output.memory_limit,
    )
    return record, grid


def root_stress(structure: Structure, system: System) -> tuple[str, ...]:
    """The channel of the stress at a clamped root; none where the root can turn, or its surface is not known."""
    known = _is_clamped(system) and structure.beam.segments[0].half_height is not None
    return (ROOT_STRESS,) if known else ()


def root_stress_notes(structure: Structure, system: System) -> tuple[str, ...]:
    """A note where the stress at a clamped root is left out."""
    if not _is_clamped(system) or root_stress(structure, system):
        return ()
    return (f"{ROOT_STRESS} is left out: it {needs_outer_fibre(structure.beam.segments[0].name)}",)


def _is_clamped(system: System) -> bool:
    return {"root.force", "root.moment"} <= set(system.reactions)


def last_cycles_start(study: Study, small: System) -> float:
    """Time (s) at which the last cycles begin that figures show; of a free decay they are those of the first mode."""
    first = first_elastic_frequency(small) if isinstance(study.excitation, Rest) else 0.0
    return max(study.history_duration - FIGURE_CYCLES / (first or study.shown_frequency), 0.0)


def _coarse_history(prepared: PreparedStudy) -> tuple[str, ...]:
    """A warning where the history keeps so few samples of a base cycle that its maxima are not those of the motion."""
    every = prepared.record.every
    samples = 1.0 / (prepared.study.excitation.frequency * prepared.grid * every)
    if samples >= LEAST_SAMPLES:
        return ()
    most = max(int(every * samples / LEAST_SAMPLES), 1)
    mend = (
        f"at most {most}" if every > 1 else "a smaller method.dt or output.interval, or more method.samples_per_cycle"
    )
    return (
        f"output.every = {every}: the history keeps {number_text(samples, 3)} samples of a base cycle, below "
        f"{LEAST_SAMPLES}, and misses the extremes between them; take {mend}",
    )


def _empty_sweep(prepared: PreparedStudy, parts: tuple[str, ...]) -> tuple[str, ...]:
    """A warning where no resonance of the structure without its balls or stops lies within the sweep."""
    plan, bare = prepared.study.sweep, prepared.bare
    if "sweep" not in parts or plan is None:
        return ()
    modes = solve_modes(bare, min(10, bare.dofs)).natural_frequency
    if np.any((plan.start <= modes) & (modes <= plan.stop)):
        return ()
    natural = ", ".join(f"{f:.4g}" for f in modes[:3] if f > 0.0)
    return (
        f"sweep.start = {plan.start:g} Hz, sweep.stop = {plan.stop:g} Hz: no natural frequency lies between them (the "
        f"first without {prepared.carried}: {natural} Hz): the curve has no resonance, and its peak no damping",
    )


def _of_drives(prepared: PreparedStudy, parts: tuple[str, ...]) -> Iterator[str]:
    """Warnings of the drive of the history, and of the highest frequency of the sweep."""
    study, small = prepared.study, prepared.small
    if "simulate" in parts:
        yield from drive_warnings(small, study.excitation, study.history_duration, prepared.initial)
    else:
        yield from motion_warnings(study.excitation, small.length)
    if "sweep" in parts and study.sweep is not None:
        for text in frequency_warnings(study.sweep.stop, small.highest_kept, small.first_left_out):
            yield f"sweep.stop: {text}"


def _check_channels(study: Study, small: System) -> None:
    """Refuse a channel of the study that the system cannot read."""
    with faults_under("output"):
        for channel in resolve_channels(small, study.output.channels):
            channel.reading(small)


def _check_drives(prepared: PreparedStudy, parts: tuple[str, ...]) -> None:
    """Refuse a history or a sweep that the methods do not resolve, or that would keep too much."""
    study, small, method, record = prepared.study, prepared.small, prepared.method, prepared.record
    if "simulate" in parts:
        prepared.initial.relative_to_base(small, study.excitation)
        frequency, base = study.excitation.frequency, {"sine": "base.frequency", "record": "base.record"}
        key = "force" if study.forces else base.get(study.kind, "base.kind")
        method.check_drive(np.array([frequency]), key)
        grid = prepared.grid
        channels, key = len(record.channels or ()), "output.memory_limit"
        check_memory(small, record, channels, round(study.history_duration / grid), grid, frequency, key)
    if "sweep" in parts and study.sweep is not None:
        check_sweep(study, small, method)
        for each in (method, prepared.bare_method):
            each.check_drive(np.array([study.sweep.stop]), "sweep.stop")


def runs_of_starts(small: System, starts: int) -> int:
    """How many runs a part of a study takes: its own and those of several starts, which differ in the balls alone."""
    return 1 + starts if starts > 1 and small.balls else 1


# ---- grid of a sweep -----------------------------------------------------------------------------


REACH = 8.0
"""Half-width of the refined part around the first mode over damping ratio times frequency: 4 half-power widths."""

LEAST_RATIO = 1e-4
"""Damping ratio that is taken for the reach where the structure has less."""

BESIDE_BALL = 1.5
"""Half-width of the refined part around the largest peak with ball, in steps of the even grid."""


def even_grid(plan: SweepPlan) -> NDArray[np.float64]:
    """Frequencies (Hz) of the even grid."""
    return np.linspace(plan.start, plan.stop, plan.points)


def refined_grid(
    plan: SweepPlan,
    bare: System,  # without balls
    peak_with_ball: float | None,  # Hz: on the even grid; None without a ball
) -> NDArray[np.float64]:
    """All frequencies (Hz) of a sweep, ascending.

    Returns (n,) Hz: the even grid, `plan.refine` points around the first natural frequency and as many around the peak
    with ball, and that natural frequency itself: the largest point of a linear curve is then its peak.
    """
    even = even_grid(plan)
    if not plan.refine:
        return even
    first, reach = _first_mode(bare)
    parts = [np.linspace(first - reach, first + reach, plan.refine), np.array([first])]
    if peak_with_ball is not None:
        around = BESIDE_BALL * float(even[1] - even[0])
        parts.append(np.linspace(peak_with_ball - around, peak_with_ball + around, plan.refine))
    inside = [part[(part > plan.start) & (part < plan.stop)] for part in parts]
    return np.asarray(np.unique(np.round(np.concatenate([even, *inside]), 9)))


def most_frequencies(plan: SweepPlan) -> int:
    """Largest number of frequencies of a sweep."""
    return plan.points + (2 * plan.refine + 1 if plan.refine else 0)


def finer_grid_words(plan: SweepPlan, bare: System, found: PeakResolution) -> str:
    """The key of a study file with the value that makes its sweep resolve a resonance, as "sweep.refine = 33"."""
    first, reach = _first_mode(bare)
    if abs(found.frequency - first) <= reach:
        return f"sweep.refine = {math.ceil(2.0 * reach / found.step_needed) + 1}"
    return f"sweep.points = {math.ceil((plan.stop - plan.start) / found.step_needed) + 1}"


def _first_mode(bare: System) -> tuple[float, float]:
    """First natural frequency (Hz), and how far the refined part reaches to either side of it (Hz)."""
    first, ratio = first_resonance(bare)
    return first, REACH * max(ratio, LEAST_RATIO) * first


# ---- memory and time, estimated before a run -----------------------------------------------------


ELEMENT = 4200.0
"""Bytes of an element while the matrices are made."""

ELEMENT_KEPT = 2000.0
"""Bytes of an element afterwards."""

DENSE_MATRICES = 8
"""Full matrices of the dofs in a dense solution."""

COPIES = 2.3
"""Histories in memory while one is labelled and written."""

PIECE = 300.0
"""Bytes of a polynomial of a drive while a history is run."""

POINT = 1200.0
"""Bytes of a frequency of a sweep in its tables."""

LIBRARIES = "besides: some 200 MB for the libraries"
"""What any plan says of the memory of the libraries."""

LEAST = 1e6
"""Bytes of any part."""

START = 1.5
"""Time of a command beside its run, s: starting, systems, summary, reading back."""

WRITING = 8e-9
"""Labelling and writing of a byte that is kept, s."""


FIGURES, MOVIE, FRAME = 3.0, 1.0, 0.012
"""Drawing all figures, beginning a movie, and each frame of it, s."""


RUNS_OF_HISTORY = 2
"""A history, and the same run once more in which the largest values between its samples are found."""


@dataclass(frozen=True)
class Cost:
    """Peak of the memory (bytes) that a part of a run takes beyond the libraries', and its time (s) on one core."""

    memory: float
    seconds: float

    def __str__(self) -> str:
        return f"{number_text(self.memory / 1e6, 3)} MB and {number_text(self.seconds, 2)} s"


def picture_seconds(study: Study) -> float:
    """Time (s) that figures and movie take, which are drawn last in a run."""
    output = study.output
    filmed = MOVIE + FRAME * output.frames if output.movie and output.frames > 0 else 0.0
    return (FIGURES if output.figures else 0.0) + filmed


def mesh_memory(
    elements: int,
    modes: int | None,  # of the reduction; None where the physical dofs are integrated
) -> dict[str, float]:
    """Bytes at the peak of making the matrices of a mesh, and of solving for its modes."""
    dofs, count = 2 * elements, max(modes or 0, 4)
    kept = ELEMENT_KEPT * elements
    if dofs <= DENSE_LIMIT or count > dofs // 4:
        solved = kept + 8.0 * DENSE_MATRICES * dofs**2
    else:
        # Lanczos vectors, and copies of those that are kept
        solved = kept + 8.0 * dofs * (max(2 * count + 1, 20) + 2 * count)
    return {"mesh": ELEMENT * elements, "modes": solved}


def check_mesh(study: Study, elements: int) -> None:
    """Refuse a mesh or a number of modes that does not fit, before anything is assembled.

    Raises `InputError` naming what takes how much.
    """
    parts = mesh_memory(elements, study.reduction.modes if study.reduction else None)
    mesh, modes = (number_text(parts[part] / 1e6, 3) for part in ("mesh", "modes"))
    shares = f"mesh of {elements} elements {mesh} MB, modes {modes} MB"
    _require_room(study, max(parts.values()), f"this study takes ({shares}): take fewer elements or modes")


def check_sweep(study: Study, small: System, method: Method) -> None:
    """Refuse a sweep that does not fit.

    Raises `InputError` naming what it takes.
    """
    needed = sweep_cost(study, small, method).memory
    _require_room(study, needed, "the sweep takes: take fewer points or cycles")


def _require_room(study: Study, needed: float, what: str) -> None:
    limit, allowed = study.output.memory_limit, f"must be >= {needed:.3g}, what {what}, or raise it"
    require(needed <= limit, "output.memory_limit", limit, "bytes", allowed)


def history_cost(study: Study, small: System, method: Method, record: Recorder, runs: int) -> Cost:
    """Memory and time of one history that takes so many runs, until it is written."""
    grid = method.time_grid(small, study.excitation, study.history_duration, record)
    steps = round(study.history_duration / grid)
    parts: Mapping[str, int] = memory_needed(
        small, record, len(record.channels or ()), steps, grid, study.excitation.frequency
    )
    kept = parts["channels"] + parts["energies"]
    rest = sum(parts.values()) - kept + PIECE * _pieces(study.excitation)
    cycles = study.history_duration * study.excitation.frequency
    seconds = seconds_of_cycle(method, small, study.excitation.frequency) * cycles
    return Cost(LEAST + COPIES * kept + rest, START + runs * seconds + WRITING * kept)


def _pieces(excitation: Excitation) -> int:
    """Polynomials that all drives of a history are made of."""
    forms = getattr(excitation, "closed_forms", None) or (getattr(excitation, "closed_form", None),)
    return sum(form.knots.size for form in forms if isinstance(form, PiecewisePolynomial))


def sweep_cost(study: Study, small: System, method: Method) -> Cost:
    """Memory and time of a sweep without and with balls, until it is written."""
    plan = study.sweep
    if plan is None:
        return Cost(0.0, 0.0)
    cases = most_frequencies(plan)
    seconds = seconds_of_cycle(method, small, 0.5 * (plan.start + plan.stop), sweep=True)
    at_once = min(cases, AT_ONCE * workers_of(None))
    memory = bytes_of_cycle(method) * at_once * plan.cycles + POINT * cases
    runs = runs_of_starts(small, plan.starts)
    return Cost(LEAST + memory, START + runs * seconds * cases * plan.cycles)
