"""The moving beam, its boxes and balls as a series of frames."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, thinned
from femimpact.errors import checked, quantity, require_name
from femimpact.integrators.channel_rows import drive_of
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.scene.placed import BALL_DENSITY, ball_radius
from femimpact.scene.scene import EXAGGERATION, Scene, build_scene, snapshots_of
from femimpact.structure.structure import Structure
from femimpact.units import number_text
from femimpact.vtk.formats import Frame, Series, Value
from femimpact.vtk.modes import PARTS_IN_WORDS, beam_fields, in_words, notes_of
from femimpact.vtk.propagation import Touching, Transition


@dataclass(frozen=True)
class Instant:
    """An instant that is shown."""

    time: float  # s
    what: str  # in words; "" for one of the even grid
    pair: int = -1  # number of the contact, -1 for none
    impulse: float = 0.0  # N s: on the beam, of the impact that begins here; 0 for none


@dataclass(eq=False)
class ContactRecord:
    """Impacts and sticking phases that have to do with a stretch of time."""

    response: Response
    start: float  # s
    end: float  # s
    names: list[str] = field(init=False)
    rows: NDArray[np.intp] = field(init=False)
    phases: NDArray[np.intp] = field(init=False)

    def __post_init__(self) -> None:
        self.names = [pair.name for pair in self.response.system.contacts]
        impacts, sticking = self.response.impacts, self.response.sticking
        self.rows = np.flatnonzero((impacts.time + impacts.duration >= self.start) & (impacts.time <= self.end))
        self.phases = np.flatnonzero(~(sticking.end < self.start) & (sticking.start <= self.end))

    def is_rigid(self, pair: int) -> bool:
        """True where a pair's contact is an impulse."""
        return bool(self.response.system.contacts[pair].parameters.is_rigid)

    def on_beam(self, pair: int) -> float:
        """Sign of a force on the beam where the ball, or the beam beside a stop, is at its + wall."""
        return self.response.system.contacts[pair].sign

    @cached_property
    def begins(self) -> NDArray[np.float64]:
        """Beginning of each sticking phase in the run, (phases,) in s: the impact that captures the pair.

        That impact has no rebound. The table's `start` is the end of the accumulation, whose bounces after that impact
        are too low to be computed.
        """
        impacts, sticking = self.response.impacts, self.response.sticking
        begins, last = np.array(sticking.start)[self.phases], self.rows[impacts.rebound_speed[self.rows] == 0.0]
        for k, phase in enumerate(self.phases):
            name, side, start = (column[phase] for column in (sticking.impactor, sticking.side, sticking.start))
            own = last[(impacts.impactor[last] == name) & (impacts.side[last] == side) & (impacts.time[last] <= start)]
            # one of an earlier phase captured the pair for that one
            ended = sticking.end[self.phases][(sticking.impactor[self.phases] == name)]
            before = ended[ended <= start].max(initial=-math.inf)
            begins[k] = impacts.time[own][impacts.time[own] > before].max(initial=-math.inf)
            begins[k] = begins[k] if math.isfinite(begins[k]) else start
        return np.asarray(begins)

    @cached_property
    def changes(self) -> NDArray[np.float64]:
        """Times (s), ascending, at which a contact begins or ends."""
        impacts, sticking = self.response.impacts, self.response.sticking
        touch = impacts.time[self.rows]
        times = [touch, touch + impacts.duration[self.rows], self.begins, sticking.end[self.phases]]
        instants = np.unique(np.concatenate(times))
        return np.asarray(instants[np.isfinite(instants)])

    def between(self, start: float, end: float) -> list[float]:
        """Changes of contact within two times."""
        first, last = np.searchsorted(self.changes, start, side="right"), np.searchsorted(self.changes, end)
        return [float(time) for time in self.changes[first:last]]

    def touching(self, time: float) -> tuple[Touching, ...]:
        """Compliant contacts that go on at a time."""
        impacts = self.response.impacts
        on = (impacts.time[self.rows] <= time) & ((impacts.time + impacts.duration)[self.rows] > time)
        return tuple(self.touch(int(i)) for i in self.rows[on])

    def starting(self, time: float) -> list[tuple[Touching, float]]:
        """Contacts that begin at a time, each with its impulse (N s) of the sign of its side."""
        impacts = self.response.impacts
        rows = self.rows[impacts.time[self.rows] == time]
        return [(self.touch(int(i)), float(impacts.side[i] * impacts.impulse[i])) for i in rows]

    def touch(self, row: int) -> Touching:
        """The contact of a row of the table of impacts."""
        impacts = self.response.impacts
        pair, speed = self.names.index(str(impacts.impactor[row])), abs(float(impacts.approach_speed[row]))
        return Touching(pair, int(impacts.side[row]), speed, float(impacts.duration[row]))

    def sticking(self, time: float) -> frozenset[int]:
        """Rigid pairs that stick at a time."""
        sticking = self.response.sticking
        on = (self.begins <= time) & ~(sticking.end[self.phases] <= time)
        pairs = (self.names.index(str(name)) for name in sticking.impactor[self.phases][on])
        return frozenset(pair for pair in pairs if self.is_rigid(pair))

    def instants(self) -> list[Instant]:
        """Impacts in the order of time, the first and the end of every captured accumulation only.

        An accumulation is the row of impacts of one pair on one side, at ever shorter intervals, that ends in a
        sticking phase (`StickingPhases.start`).
        """
        impacts, sticking, events, left_out = self.response.impacts, self.response.sticking, list[Instant](), set[int]()
        for phase in self.phases:
            name, side, end = str(sticking.impactor[phase]), sticking.side[phase], float(sticking.start[phase])
            rows = self._accumulation(name, int(side), end)
            left_out.update(rows[1:])
            what = f"{self._meets(name, side, 'sticks to')}: end of an accumulation of {len(rows)} impacts"
            events.append(Instant(end, what, self.names.index(name)))
        for i in self.rows:
            if int(i) not in left_out:
                name, side, pair = str(impacts.impactor[i]), impacts.side[i], self.names.index(str(impacts.impactor[i]))
                what = f"{self._meets(name, side)} at {impacts.approach_speed[i]:.4g} m/s"
                impulse = self.on_beam(pair) * float(side * impacts.impulse[i])
                events.append(Instant(float(impacts.time[i]), what, pair, impulse))
        in_window = (item for item in events if self.start <= item.time <= self.end)
        return sorted(in_window, key=lambda item: item.time)

    def _meets(self, name: str, side: float, verb: str = "meets") -> str:
        """What meets what, of a pair."""
        between = self.response.system.contacts[self.names.index(name)].between
        return f"{between[0]} {verb} {between[1]}" if between else f"{name} {verb} the {'+' if side > 0 else '-'} wall"

    def _accumulation(self, name: str, side: int, end: float) -> list[int]:
        """Rows of the table of impacts that lead to a sticking phase, in the order of time."""
        impacts = self.response.impacts
        of_pair = np.flatnonzero((impacts.impactor == name) & (impacts.time <= end))
        of_pair = of_pair[np.argsort(impacts.time[of_pair], kind="stable")]
        rows, wait = list[int](), 0.0
        for i in reversed(of_pair):
            between = float(impacts.time[rows[-1]] - impacts.time[i]) if rows else 0.0
            if int(impacts.side[i]) != side or between < wait:
                break
            rows.append(int(i))
            wait = between
        return rows[::-1]


MOST_DOFS = 200
"""Degrees of freedom up to which states at impacts are computed: the matrix exponential is dense."""

LARGEST_MISMATCH = 0.01
"""Share of the largest displacement by which a state may miss the next snapshot."""

SAME_TIME = 1e-9
"""Share of the time shown within which two instants are one."""


@dataclass(frozen=True, eq=False)
class Frames:
    """States that are shown, in the order of time."""

    snapshots: Snapshots
    what: tuple[str, ...]  # what happens at each; "" on the grid
    # (frames, pairs) N s: on the beam, of the impact at this frame, of the sign of `Snapshots.contact_force`; else 0
    impulse: Array
    touching: NDArray[np.bool_]  # (frames, pairs) whether the pair is in contact
    # largest share of the largest displacement by which states at impacts, taken on, miss the next snapshot
    mismatch: float


def frames_of(
    response: Response,  # with snapshots
    most: int,  # at most so many frames. Impacts have at most half of them, evenly spread where there are more.
) -> Frames:
    """States of a run on an even grid and at every impact.

    Warns
    -----
    UserWarning
        If impacts have no frame.
    """
    grid = snapshots_of(response)
    record = ContactRecord(response, float(grid.time[0]), float(grid.time[-1]))
    instants = wanted = record.instants()
    if len(wanted) > max(most // 2, most - grid.time.size):
        instants = [wanted[i] for i in thinned(len(wanted), max(most // 2, most - grid.time.size))] if most > 1 else []
        _warn(f"{len(instants)} of {len(wanted)} impacts have a frame: at most {most} frames are written")
    states, mismatch = _states(record, grid, instants)
    chosen = thinned(grid.time.size, max(most - len(states), 1))
    return _merged(record, grid, chosen, states, mismatch)


def _warn(text: str) -> None:
    warnings.warn(text, UserWarning, stacklevel=4)


# ---- states ---------------------------------------------------------------------------------------


ARRAYS = ("displacement", "velocity", "ball_displacement", "ball_velocity", "contact_force")
"""Arrays of a state, as `Snapshots` has them."""


class _State(NamedTuple):
    """An instant, and the arrays of its state."""

    instant: Instant
    arrays: tuple[Array, ...]


def _states(record: ContactRecord, grid: Snapshots, instants: list[Instant]) -> tuple[list[_State], float]:
    """States at instants off the grid, and their largest mismatch."""
    response = record.response
    slack = SAME_TIME * max(float(grid.time[-1] - grid.time[0]), 1e-300)
    before = np.searchsorted(grid.time, [item.time for item in instants], side="right") - 1
    size = response.system.dofs + len(response.system.balls)
    if instants and size > MOST_DOFS:
        _warn(f"no impact has a frame: the system has {size} dofs, more than {MOST_DOFS}; `reduce` it")
        return [], 0.0
    if instants and drive_of(response.system, response.base).more:
        _warn("no impact has a frame: several drives act at different places, and what lies between frames is of one")
        return [], 0.0
    transition = Transition(response) if instants else None
    states, worst, lost = list[_State](), 0.0, 0
    for k in np.unique(before):
        of_interval = [item for item, at in zip(instants, before, strict=True) if at == k]
        on_grid = [item for item in of_interval if item.time - grid.time[k] <= slack]
        states += [_recorded(grid, int(k), item) for item in on_grid]
        rest = [item for item in of_interval if item.time - grid.time[k] > slack]
        if not rest or transition is None or k + 1 >= grid.time.size:
            continue
        between, mismatch = _between(transition, record, grid, int(k), rest)
        if mismatch <= LARGEST_MISMATCH:
            states, worst = states + between, max(worst, mismatch)
        else:
            lost += len(rest)
    if lost:
        share = f"{100.0 * LARGEST_MISMATCH:g} %"
        _warn(f"{lost} impacts have no frame: their states, taken on, miss the next snapshot by more than {share}")
    return states, worst


def _recorded(grid: Snapshots, k: int, instant: Instant) -> _State:
    return _State(instant, tuple(getattr(grid, name)[k] for name in ARRAYS))


def _between(
    transition: Transition, record: ContactRecord, grid: Snapshots, k: int, instants: list[Instant]
) -> tuple[list[_State], float]:
    """States at instants between two snapshots, just before what happens there, and by how much they miss the next."""
    state = transition.state(*(getattr(grid, name)[k] for name in ARRAYS[:-1]))
    time, end = float(grid.time[k]), float(grid.time[k + 1])
    states = list[_State]()
    stops = sorted({*record.between(time, end), *(item.time for item in instants), end})
    due = sorted(instants, key=lambda item: item.time)
    for stop in stops:
        middle = 0.5 * (time + stop)
        touching, sticking = record.touching(middle), record.sticking(middle)
        state = transition.moved(state, time, stop, touching, sticking)
        time = stop
        while due and due[0].time == stop:
            item = due.pop(0)
            begun = [touch for touch, _ in record.starting(stop) if touch.pair == item.pair]
            forces = np.zeros(len(record.names))
            for touch in (*touching, *begun):
                forces[touch.pair] = record.on_beam(touch.pair) * transition.force(state, touch, stop)
            states.append(_State(item, (*transition.nodal(state), forces)))
        state = _through(transition, record, state, stop, sticking)
    reached = transition.nodal(state)
    wanted = [getattr(grid, name)[k + 1] for name in ARRAYS]
    largest = max(float(np.abs(grid.displacement[:, 0::2]).max()), float(np.abs(grid.ball_displacement).max(initial=0)))
    missed = max(
        float(np.abs(reached[0] - wanted[0])[0::2].max()), float(np.abs(reached[2] - wanted[2]).max(initial=0.0))
    )
    return states, missed / largest if largest > 0.0 else 0.0


def _through(
    transition: Transition, record: ContactRecord, state: Array, time: float, sticking: frozenset[int]
) -> Array:
    """The state after what happens at a time: impulses of rigid impacts, and pairs that begin to stick."""
    after = record.sticking(math.nextafter(time, math.inf))
    # what lets go at this instant is free before the impulse
    lasting = sticking & after
    for touch, impulse in record.starting(time):
        if record.is_rigid(touch.pair):
            state = transition.struck(state, impulse, touch.pair, lasting - {touch.pair})
    return transition.held(state, after, time) if after - sticking else state


def _merged(
    record: ContactRecord, grid: Snapshots, chosen: NDArray[np.int64], states: list[_State], mismatch: float
) -> Frames:
    """Snapshots of the grid and states at instants, in the order of time, one for each time."""
    groups = _by_time(grid, chosen, states)
    pairs = len(record.names)
    impulse, touching = np.zeros((len(groups), pairs)), np.zeros((len(groups), pairs), dtype=bool)
    forces = np.zeros((len(groups), pairs))
    for f, group in enumerate(groups):
        time = group[-1].instant.time
        touching[f, [touch.pair for touch in record.touching(time)]] = True
        touching[f, list(record.sticking(time))] = True
        for item in group:
            forces[f] = np.where(item.arrays[-1] != 0.0, item.arrays[-1], forces[f])
            if item.instant.pair >= 0:
                impulse[f, item.instant.pair] += item.instant.impulse
                touching[f, item.instant.pair] = True
    motion = {name: np.array([group[-1].arrays[i] for group in groups]) for i, name in enumerate(ARRAYS[:-1])}
    times = np.array([group[-1].instant.time for group in groups])
    snapshots = Snapshots(time=times, **motion, contact_force=forces)
    what = tuple("; ".join(item.instant.what for item in group if item.instant.what) for group in groups)
    return Frames(snapshots, what, impulse, touching | (forces != 0.0), mismatch)


def _by_time(grid: Snapshots, chosen: NDArray[np.int64], states: list[_State]) -> list[list[_State]]:
    """Chosen snapshots and states at instants in the order of time, those of one time together."""
    times = np.array([item.instant.time for item in states])
    slack = SAME_TIME * max(float(grid.time[-1] - grid.time[0]), 1e-300)
    apart = [k for k in chosen if not times.size or np.abs(times - grid.time[k]).min() > slack]
    every = [*(_recorded(grid, int(k), Instant(float(grid.time[k]), "")) for k in apart), *states]
    every.sort(key=lambda item: item.instant.time)
    groups: list[list[_State]] = []
    for item in every:
        if groups and item.instant.time - groups[-1][-1].instant.time <= slack:
            groups[-1].append(item)
        else:
            groups.append([item])
    return groups


Kind = TypeVar("Kind", np.float64, np.int32)


def deflection_series(
    response: Response, structure: Structure, exaggeration: float = 1.0, most: int = 600, frame: str = "base"
) -> Series:
    """Frames of a run on an even grid and at its impacts; see `write_deflection`."""
    exaggeration = checked("exaggeration", exaggeration, EXAGGERATION)
    most = checked("most", most, quantity("frames", at_least=1, integer=True))
    require_name(frame, ("base", "space"), "frame")
    frames = frames_of(response, most)
    scene = build_scene(structure, response.system, exaggeration)
    fields = beam_fields(scene, structure, response.system)
    fixed = _about(response, structure, exaggeration, frame, frames.mismatch)
    times, absolute = [float(t) for t in frames.snapshots.time], frame == "space"

    def make(k: int) -> Frame:
        snapshots, base = frames.snapshots, response.base
        at, rate = float(base.displacement(times[k])), float(base.velocity(times[k]))
        shift, speed = ((at, 0.0), (rate, 0.0)) if absolute else ((0.0, -at), (0.0, -rate))
        nodal = snapshots.displacement[k]
        points = {
            "displacement": scene.displacement(nodal, snapshots.ball_displacement[k], *shift),
            "velocity": scene.motion(snapshots.velocity[k], snapshots.ball_velocity[k], *speed),
            "rotation": scene.rotation(nodal),
            **fields.at_points(nodal),
            "contact_force_vector": _at_marks(scene, response, snapshots.contact_force[k]),
            "contact_impulse_vector": _at_marks(scene, response, frames.impulse[k]),
        }
        cells = {
            "part": scene.part,
            "contact_pair": scene.pair,
            "contact_force": _on_cells(scene, snapshots.contact_force[k]),
            "state": _on_cells(scene, frames.touching[k].astype(np.int32)),
            "mean_strain_energy_density": fields.on_cells(nodal),
        }
        about: dict[str, Value] = {
            "name": _name(frames, k),
            "impact": float(bool(frames.what[k])),
            "contacts": _contacts(response, snapshots.contact_force[k], frames.impulse[k]),
            "units": in_words(points),
        }
        return Frame({**about, **fixed}, points, cells)

    names = [_name(frames, k) for k in range(len(times))]
    return Series(scene.points, scene.connectivity, scene.offsets, scene.types, times, names, make)


def _name(frames: Frames, k: int) -> str:
    return f"t = {frames.snapshots.time[k]:.6g} s" + (f", {frames.what[k]}" if frames.what[k] else "")


def _contacts(response: Response, forces: NDArray[np.float64], impulses: NDArray[np.float64]) -> str:
    """Contacts under load in a frame, a line each: name, wall or side, force and impulse."""
    lines = []
    for pair, force, impulse in zip(response.system.contacts, forces, impulses, strict=True):
        known = (("force", force, "N"), ("impulse", impulse, "N s"))
        values = [f"{what} {number_text(abs(value), 3)} {unit}" for what, value, unit in known if value != 0.0]
        if values:
            pressed = (impulse or force) * pair.sign
            place = f"on its {'+' if pressed > 0.0 else '-'} {'side' if pair.is_stop else 'wall'}"
            place = f"of {' and '.join(pair.between)}" if pair.between else place
            lines.append(f"{pair.name} {place}: {', '.join(values)}")
    return "\n".join(lines)


def _about(
    response: Response, structure: Structure, exaggeration: float, frame: str, mismatch: float
) -> dict[str, Value]:
    """Field data that is the same in every file; the radii (m) in the order of the impactors."""
    motion = "relative to the moving base" if frame == "base" else "absolute, in space"
    note = (
        f"displacement {motion}; displacement and clearance times {exaggeration:g}; every other array true, not "
        "exaggerated"
    )
    fields: dict[str, Value] = {"exaggeration": float(exaggeration), "impact_state_mismatch": float(mismatch)}
    if response.system.balls:
        # the model has no radius: the ball is a point mass to it
        fields["ball_radius"] = [ball_radius(pair.mass) for pair in response.system.balls]
        note += f"; each ball is drawn as a steel sphere ({BALL_DENSITY:g} kg/m^3) of its mass"
    return {**fields, "parts": PARTS_IN_WORDS, "note": notes_of(structure, note)}


def _on_cells(scene: Scene, values: NDArray[Kind]) -> NDArray[Kind]:
    """Value of its pair on every cell of boxes, balls and stops, 0 elsewhere."""
    # cells of no pair have -1, which reads the appended zero
    return np.asarray(np.append(values, np.zeros(1, dtype=values.dtype))[scene.pair])


def _at_marks(scene: Scene, response: Response, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Forces (or impulses) along y at the points of contact on the side that is pressed, (points, 3).

    At the wall of a box, or the beam beside a stop, it is that on the structure; at the ball, or the stop, the
    opposite one.
    """
    result = np.zeros_like(scene.points)
    for point, pair, side, reaction in scene.marks:
        # the + wall of a box is pushed towards +w, and the beam away from its + stop
        pressed = response.system.contacts[pair].sign * side
        if pressed * values[pair] > 0.0:
            result[point, 1] = -values[pair] if reaction else values[pair]
    return result
