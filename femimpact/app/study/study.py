"""A study: a structure and what is to be done with it, and the systems and the method that follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from femimpact.app.study.drives import (
    BASES,
    SECONDS,
    START,
    check_drives,
    history_duration,
    kind_of,
    named_forces,
    words_of_history,
)
from femimpact.app.study.parameter_plan import MOST_STARTS, ParameterPlan
from femimpact.app.study.start import PartStart, state_of
from femimpact.errors import (
    Fault,
    InputError,
    check_fields,
    faults_of,
    instance,
    items,
    level_rows,
    name_text,
    optional,
    quantity,
    require,
    require_name,
    require_type,
    suggestion,
    text,
    truth,
)
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import Drives, HammerBlow, PointForce, alone, until
from femimpact.excitation.excitation import Excitation, has_cycle
from femimpact.excitation.harmonic import Level, Sine, SteppedSine, require_reach
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.records import RecordedBase
from femimpact.excitation.shock import Shock
from femimpact.excitation.sums import Sum
from femimpact.fem.assembly import assemble
from femimpact.fem.mesh import Mesh
from femimpact.fem.mesh_files import read_mesh
from femimpact.integrators.methods import METHODS, Method
from femimpact.orbits.following import CHANGES
from femimpact.orbits.switching import REFUSED
from femimpact.structure.structure import Structure
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System

TWO_VALUES: dict[str, Any] = quantity("", several=True) | {
    "allowed": "must be two finite numbers, the lowest and the highest value",
    "schema": {
        "type": "array", "minItems": 2, "maxItems": 2, "items": {"anyOf": [{"type": "number"}, {"type": "string"}]},
    },
}  # fmt: skip
"""Metadata of a range whose unit another key decides."""

MOTIONS = (Sine, RecordedBase, Chirp, SteppedSine, RandomBase, Shock, Sum)
"""Motions of the base that a study file can give."""

SWITCHED = tuple(kind for kind in (*CHANGES, "grazing") if kind not in REFUSED)
"""Kinds of bifurcations at which another branch begins."""

KINDS: dict[str, Any] = text(several=True) | {
    "allowed": f"must be a list of {' or '.join(map(repr, SWITCHED))}",
    "schema": {"type": "array", "items": {"enum": list(SWITCHED)}},
}
"""Metadata of the kinds of bifurcations at which another branch is followed."""


@dataclass(frozen=True)
class MeshChoice:
    """`[mesh]`: a number of elements, or a mesh file beside the study.

    Parameters
    ----------
    elements : int
        How many; each is at most as long as the others, between the places that have to be nodes.
    file : str
        Path of a mesh of two-node lines along x, from the folder of the study file: Gmsh 2.2 or 4.1, VTU, VTK, XDMF,
        Abaqus, MED and what else meshio reads. A place is a physical point of Gmsh, or in a format without names an
        array of whole numbers on the points, 1 at one node and 0 elsewhere; regions likewise on curves and lines.

    Raises
    ------
    InputError
        If not exactly one of elements and file is given.
    """

    elements: int | None = field(default=None, metadata=quantity("1", at_least=1, at_most=100_000, integer=True))
    file: str | None = field(default=None, metadata=text())

    def __post_init__(self) -> None:
        check_fields(self)
        one = (self.elements is None) != (self.file is None)
        require(one, "elements", self.elements, "", "give either elements (a whole number) or file (a path)")


@dataclass(frozen=True)
class Reduction:
    """`[reduction]`: how many normal modes are kept.

    Parameters
    ----------
    modes : int
        The lowest so many. Without the table the run is in the dofs of the mesh.
    """

    modes: int = field(metadata=quantity("1", at_least=1, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Gravity:
    """`[gravity]`: a constant acceleration along the deflection, of beam, bodies and balls (`Structure.gravity`).

    Parameters
    ----------
    acceleration : float, m/s^2
        Positive towards +w; -9.81 pulls down.
    """

    acceleration: float = field(metadata=quantity("m/s^2"))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class SweepPlan:
    """`[sweep]`: an even grid, and how many points refine it around each resonance.

    Parameters
    ----------
    start, stop : float, Hz
        First and last frequency of the even grid.
    points : int
        Number of frequencies of the even grid.
    cycles : int
        Base cycles at each frequency; the last third is measured.
    refine : int
        Points added around each resonance.
    starts : int
        Further sweeps with the balls at different places and speeds, as in [study]; the results have medians and ranges
        of them. With 1 there are none.
    acceleration : float or array_like (k, 2) or None, m/s^2
        Amplitude of the base's acceleration, or rows of a frequency (Hz) and an amplitude, straight in a plot of the
        logarithms. Absent: the base has the amplitude or the acceleration of [base] at all frequencies.

    Raises
    ------
    InputError
        If the stop is not above the start, or rows do not reach from start to stop.
    """

    start: float = field(metadata=quantity("Hz", above=0.0))
    stop: float = field(metadata=quantity("Hz", above=0.0))
    points: int = field(metadata=quantity("1", at_least=4, at_most=100_000, integer=True))
    cycles: int = field(metadata=quantity("1", at_least=24, at_most=10_000_000, integer=True))
    refine: int = field(default=0, metadata=quantity("1", at_least=0, at_most=100_000, integer=True))
    starts: int = field(default=1, metadata=quantity("1", at_least=1, at_most=MOST_STARTS, integer=True))
    acceleration: Level | None = field(default=None, metadata=optional(level_rows("m/s^2")))

    def __post_init__(self) -> None:
        check_fields(self)
        require(self.stop > self.start, "stop", self.stop, "Hz", f"must be > start, {self.start:g} Hz")
        if self.acceleration is not None:
            require_reach(self.acceleration, self.start, self.stop)


@dataclass(frozen=True)
class OrbitsPlan:
    """`[orbits]`: branches of periodic orbits over a number of the study, from the motion that its run settles to.

    Parameters
    ----------
    parameter : str
        Path of the number, as of `fi.continue_orbit`: "frequency", "amplitude", "impactor.ball.gap", ...
    range : pair of float
        Its lowest and its highest value, with that of the study between them; in the unit of the number.
    guess_duration : float, s
        Length of the run from the study's own start, from the end of which the first orbit is searched.
    cycles : int
        Periods of the excitation in one of the first orbit.
    switch : sequence of str
        Kinds of bifurcations at which the other branch is followed too: "symmetry-breaking", "branch-point",
        "period-doubling", "grazing".
    most_branches : int
        Branches that are followed at most, that of the first orbit included.
    points : int
        Most points of a branch to each side of the orbit from which it is followed.
    of : str
        Displacement whose largest value is kept, as a channel. Absent: the tip, or of a ball in space at the root.

    Raises
    ------
    InputError
        If the range does not rise, a kind of bifurcation is there twice, or there is no other branch at one.
    """

    parameter: str = field(metadata=text())
    range: tuple[float, float] = field(metadata=TWO_VALUES)
    guess_duration: float = field(metadata=quantity("s", above=0.0))
    cycles: int = field(default=1, metadata=quantity("1", at_least=1, at_most=1000, integer=True))
    switch: tuple[str, ...] = field(default=(), metadata=KINDS)
    most_branches: int = field(default=10, metadata=quantity("1", at_least=1, at_most=1000, integer=True))
    points: int = field(default=2000, metadata=quantity("1", at_least=2, at_most=10**6, integer=True))
    of: str | None = field(default=None, metadata=optional(name_text()))

    def __post_init__(self) -> None:
        check_fields(self)
        rises = isinstance(self.range, tuple) and len(self.range) == 2 and self.range[0] < self.range[1]
        require(rises, "range", self.range, "", TWO_VALUES["allowed"])
        for kind in self.switch:
            allowed = REFUSED[kind] if kind in REFUSED else suggestion(kind, SWITCHED)
            require(kind in SWITCHED, "switch", kind, "", allowed)
        require(len(set(self.switch)) == len(self.switch), "switch", self.switch, "", "must have each kind once")


@dataclass(frozen=True)
class Output:
    """`[output]`: channels, snapshots, files and pictures that are written.

    Parameters
    ----------
    every : int
        One of so many samples is kept in the history, which are steps of a method that has them. Absent: one of 10, or
        of fewer where a base cycle would have less than 20, and all of an event-driven run; a sine's file has 20 then.
    interval : float, s
        Time between the instants at which an event-driven history is read. Absent: under a sine `samples_per_cycle` of
        the method, under a record what its samples and the highest mode need.
    channels : sequence of str
        Kept in the history besides those of the tip, the middle, the balls and the contacts, by their names, as
        "root.reaction_force"; the reference has a page of channels.
    frames : int
        Number of snapshots of the deflection that are kept for ParaView and the movie.
    frame_cycles : float
        Last base cycles over which they are spread; of a motion without one, periods of the first mode.
    exaggeration : float
        Scale of motion and gaps in these. Absent: chosen by the movie, 1 for ParaView.
    memory_limit : float, bytes
        A run that would keep more is refused.
    figures, paraview, movie : bool
        Whether they are made.
    vtkhdf : bool
        Whether the deflections are in one temporal VTKHDF file too.
    report : bool or "short"
        Whether `report.html` is written; "short": as one sheet of paper for who asked for the design.
    title, author, date : str
        Stand at the head of the report as they are; a title takes the place of the name of the study.
    starts : int
        Further histories with the balls at different places and speeds, as in [study]; the results have medians and
        ranges of them, and the files are those of the study's own start. With 1 there are none.
    """

    every: int | None = field(default=None, metadata=quantity("samples", at_least=1, integer=True))
    interval: float | None = field(default=None, metadata=optional(quantity("s", above=0.0)))
    channels: tuple[str, ...] = field(default=(), metadata=text(several=True))
    frames: int = field(default=160, metadata=quantity("1", at_least=0, at_most=5000, integer=True))
    frame_cycles: float = field(default=3.0, metadata=quantity("1", above=0.0))
    exaggeration: float | None = field(default=None, metadata=quantity("1", above=0.0))
    memory_limit: float = field(default=1e9, metadata=quantity("bytes", above=0.0))
    figures: bool = field(default=True, metadata=truth())
    paraview: bool = field(default=True, metadata=truth())
    vtkhdf: bool = field(default=False, metadata=truth())
    movie: bool = field(default=True, metadata=truth())
    report: bool | str = field(default=True, metadata=truth("short"))
    title: str = field(default="", metadata=name_text(lines=True))
    author: str = field(default="", metadata=name_text(lines=True))
    date: str = field(default="", metadata=name_text(lines=True))
    starts: int = field(default=1, metadata=quantity("1", at_least=1, at_most=MOST_STARTS, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)
        require(self.frames > 0 or not self.vtkhdf, "vtkhdf", self.vtkhdf, "", "must be false where frames = 0")


class AsRead(NamedTuple):
    """What a study file was read as: an equal study has the text of its file."""

    study: Study
    tables: Mapping[str, Any]  # with numbers in SI
    quantities: tuple[tuple[str, str, Any, str], ...]  # texts with a unit: key, text, number and unit in SI


@dataclass(frozen=True, eq=False)
class Study:
    """A validated study file.

    Parameters
    ----------
    structure : Structure
    mesh : MeshChoice
    base : Sine, RecordedBase, Chirp, SteppedSine, RandomBase, Shock, Sum or None
        Motion of the base; None is at rest.
    reduction : Reduction or None
        None integrates in physical dofs.
    method : mapping of str to value
        Its name and fields as given; dt may be absent and is then the recommended step.
    sweep : SweepPlan or None
    output : Output
    path : Path
    text : str
        The file as read; what is kept with the results is `study_file.study_text`.
    plan : ParameterPlan or None
        The axes and measures of a parameter study.
    orbits : OrbitsPlan or None
    forces : sequence of PointForce and HammerBlow
        Beside the motion of the base.
    duration : float or None, s
        Duration of the simulated history; None is that of the motion, of a sum its longest. A shock and a sine have
        none.
    start : {"base", "space", "static"}
        At rest relative to the base, at rest in the inertial frame, or in the static state (`State.static`).
    begins : sequence of PartStart
        Places that are displaced or move at the start, and balls.
    as_read : AsRead or None
        None of a study that was not read from a file.

    Raises
    ------
    InputError
        If the method's name is unknown, there is a sweep and no sine, or drives or starts do not fit one another.
    """

    structure: Structure = field(metadata=instance(Structure))
    mesh: MeshChoice = field(metadata=instance(MeshChoice))
    base: Sine | RecordedBase | Chirp | SteppedSine | RandomBase | Shock | Sum | None = field(
        metadata=optional(instance(*MOTIONS))
    )
    reduction: Reduction | None = field(metadata=optional(instance(Reduction)))
    method: Mapping[str, Any] = field(metadata=instance(Mapping))
    sweep: SweepPlan | None = field(metadata=optional(instance(SweepPlan)))
    output: Output = field(metadata=instance(Output))
    path: Path = field(metadata=instance(Path))
    text: str = field(repr=False, metadata=text())
    plan: ParameterPlan | None = field(default=None, metadata=optional(instance(ParameterPlan)))
    orbits: OrbitsPlan | None = field(default=None, metadata=optional(instance(OrbitsPlan)))
    forces: tuple[PointForce | HammerBlow, ...] = field(default=(), metadata=items(PointForce, HammerBlow))
    duration: float | None = field(default=None, metadata=optional(SECONDS))
    start: str = field(default="base", metadata=START)
    begins: tuple[PartStart, ...] = field(default=(), metadata=items(PartStart))
    as_read: AsRead | None = field(default=None, repr=False, metadata=optional(instance(AsRead)))

    def __post_init__(self) -> None:
        check_fields(self)
        check_drives(self.base, self.forces, self.duration)
        require_name(self.method.get("name", "newmark"), METHODS, "method.name")
        allowed = "must be 'base' beside [[start]], whose values are relative to the base"
        require(not self.begins or self.start == "base", "base.start", self.start, "", allowed)
        of = [part.ball or ("" if part.at is None else 0) for part in self.begins]
        require(
            len(set(of)) == len(of), "start", None, "", "must have at most one table for a ball, and one for a place"
        )
        if self.sweep is not None:
            ways = "; remove [sweep], or give [base] an amplitude and a frequency"
            cyclic = [name for name, force in named_forces(self.base, self.forces) if has_cycle(force)]
            over = [f"; over its frequency goes [study] with the axis 'force.{name}.frequency'" for name in cyclic[:1]]
            sine_of(self, "sweep", instead="".join([ways, *over]))

    @cached_property
    def excitation(self) -> Excitation:
        """Drives of the simulated history: the motion of the base, a force, several of them as `Drives`, or `Rest`."""
        drives = Drives(self.base, self.forces) if self.forces else self.base
        excitation: Excitation = until(alone(drives), self.history_duration)
        return excitation

    @cached_property
    def history_duration(self) -> float:
        """Time (s) that the history takes."""
        return float(history_duration(self.base, self.duration) or 0.0)

    @property
    def history_words(self) -> str:
        """Words for the length of the history and for its drives."""
        return words_of_history(self.base, self.forces, self.history_duration)

    @property
    def kind(self) -> str:
        """Kind of the motion of the base in a study file; "base-and-force" where forces act."""
        return "base-and-force" if self.forces else kind_of(self.base, BASES)

    @property
    def source(self) -> Mapping[str, Any]:
        """Path, content and options of the record of the base; empty without one."""
        return getattr(self.base, "source", None) or {}

    @property
    def record(self) -> str | None:
        """Path of the record of the base, from the folder of the study file; None without one."""
        return self.source.get("record")

    @cached_property
    def shown_frequency(self) -> float:
        """Frequency (Hz) of the cycles that pictures show: of the base where it moves, and not of forces beside it."""
        return float((self.base or self.excitation).frequency)

    @property
    def sine(self) -> Sine:
        """The motion of a base that moves by a sine alone; of another study it is refused."""
        return sine_of(self, "study.sine")

    @property
    def sweep_level(self) -> dict[str, Any]:
        """Amplitude (m) or acceleration (m/s^2) of the base in the sweep, and None for the other."""
        given = self.sweep.acceleration if self.sweep else None
        by, level = (self.sine.by, self.sine.level) if given is None else ("acceleration", given)
        return {"amplitude": None, "acceleration": None, by: level}

    @property
    def initial(self) -> State:
        """State at the start without [[start]], as of the sweep."""
        return State.static() if self.start == "static" else State.at_rest(self.start)

    def initial_on(self, system: System) -> State:
        """State of a system at the start of a history or a case."""
        require_type(system, System, "system")
        return state_of(self.begins, system) if self.begins else self.initial


def sine_of(study: Study, key: str, value: object = None, unit: str = "", instead: str = "") -> Sine:
    """The motion of a base that moves by a sine alone.

    Raises
    ------
    InputError
        Of a record or another motion, naming what needs a sine.
    """
    if isinstance(study.base, Sine) and not study.forces:
        return study.base
    other = "has forces beside it, [[force]]" if study.forces else f"is of kind {study.kind!r}"
    if isinstance(study.base, RecordedBase) and not study.forces:
        other = f"has a record, {study.record!r}"
    allowed = f"needs a sine of the base, and [base] of this study {other}{instead}"
    raise InputError([Fault(key, value, unit, allowed)])


def build_systems(study: Study, mesh: Mesh | None = None) -> tuple[System, System]:
    """The full system on the mesh of the study's file, read where none is given, and the one that is integrated."""
    mesh = mesh or read_mesh_of(study)
    full = assemble_on(study, study.structure, mesh)
    for name, force in named_forces(study.base, study.forces):
        with faults_of(f"force.{name}.at"):
            full.point_row(force.at)
    if study.reduction is None:
        return full, full
    kept = study.reduction.modes
    require(kept <= full.dofs, "reduction.modes", kept, "", f"must be <= {full.dofs}, the dofs of this mesh")
    return full, reduce(full, kept)


def assemble_on(study: Study, structure: Structure, mesh: Mesh | None) -> System:
    """A structure on the study's mesh: that of its file, or one of as many elements as it gives."""
    return assemble(structure, mesh=mesh, elements=None if mesh else study.mesh.elements)


def method_for(study: Study, system: System) -> Method:
    """The study's method for a system: with the step recommended for it unless the study gives one."""
    settings = dict(study.method)
    method: Method = METHODS[settings.pop("name", "newmark")].for_system(system, **settings)
    return method


def check_method(study: Study, system: System, method: Method) -> tuple[str, ...]:
    """Warnings of the study's method about a system.

    Raises
    ------
    InputError
        Of the method; where it takes a reduced system only, with the table of the study file that reduces it.
    """
    try:
        return method.check(system)
    except InputError as error:
        if study.reduction is not None:
            raise
        more = "; in a study file add [reduction] modes = n"
        faults = [replace(f, allowed=f.allowed + more) if "reduce(" in f.allowed else f for f in error.faults]
        raise InputError(faults) from None


def read_mesh_of(study: Study) -> Mesh | None:
    """The mesh of the study's file; None where it gives a number of elements."""
    return read_mesh(study.path.parent / study.mesh.file) if study.mesh.file else None
