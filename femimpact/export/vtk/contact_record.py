"""Contacts in a stretch of time, from the tables of a run: when they begin and end, which go on, which stick."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femimpact.export.vtk.propagation import Touching
from femimpact.response.response import Response

__all__ = ["ContactRecord", "Instant"]


@dataclass(frozen=True)
class Instant:
    """An instant that is shown.

    Parameters
    ----------
    time : float, s
    what : str
        In words; "" for one of the even grid.
    pair : int
        Number of the contact, -1 for none.
    impulse : float, N s
        On the beam, of the impact that begins here; 0 for none.
    """

    time: float
    what: str
    pair: int = -1
    impulse: float = 0.0


@dataclass(eq=False)
class ContactRecord:
    """Impacts and sticking phases that have to do with a stretch of time.

    Parameters
    ----------
    response : Response
    start, end : float, s
    """

    response: Response
    start: float
    end: float
    names: list[str] = field(init=False)
    rows: NDArray[np.intp] = field(init=False)
    phases: NDArray[np.intp] = field(init=False)

    def __post_init__(self) -> None:
        self.names = [pair.name for pair in self.response.system.contacts]
        impacts, sticking = self.response.impacts, self.response.sticking
        self.rows = np.flatnonzero((impacts.time + impacts.duration >= self.start) & (impacts.time <= self.end))
        self.phases = np.flatnonzero(~(sticking.end < self.start) & (sticking.start <= self.end))

    def is_rigid(self, pair: int) -> bool:
        """Whether a pair's contact is an impulse."""
        return bool(self.response.system.contacts[pair].parameters.is_rigid)

    def on_beam(self, pair: int) -> float:
        """Sign of a force on the beam where the ball, or the beam beside a stop, is at its + wall."""
        return -1.0 if self.response.system.contacts[pair].is_stop else 1.0

    @cached_property
    def begins(self) -> NDArray[np.float64]:
        """When each sticking phase begins in the run, (phases,) in s: with the impact that captures the pair.

        That impact has no rebound. The table's `start` is the end of the accumulation, whose bounces after that impact
        are too low to be computed.
        """
        impacts, sticking = self.response.impacts, self.response.sticking
        begins, last = np.array(sticking.start)[self.phases], self.rows[impacts.rebound_speed[self.rows] == 0.0]
        for k, phase in enumerate(self.phases):
            name, side, start = (column[phase] for column in (sticking.impactor, sticking.side, sticking.start))
            mine = last[(impacts.impactor[last] == name) & (impacts.side[last] == side) & (impacts.time[last] <= start)]
            # one of an earlier phase captured the pair for that one
            ended = sticking.end[self.phases][(sticking.impactor[self.phases] == name)]
            before = ended[ended <= start].max(initial=-math.inf)
            begins[k] = impacts.time[mine][impacts.time[mine] > before].max(initial=-math.inf)
            begins[k] = begins[k] if math.isfinite(begins[k]) else start
        return np.asarray(begins)

    @cached_property
    def changes(self) -> NDArray[np.float64]:
        """Times (s), ascending, at which a contact begins or ends."""
        impacts, sticking = self.response.impacts, self.response.sticking
        touch = impacts.time[self.rows]
        times = [touch, touch + impacts.duration[self.rows], self.begins, sticking.end[self.phases]]
        found = np.unique(np.concatenate(times))
        return np.asarray(found[np.isfinite(found)])

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
        impacts, sticking, found, left_out = self.response.impacts, self.response.sticking, list[Instant](), set[int]()
        for phase in self.phases:
            name, side, end = str(sticking.impactor[phase]), sticking.side[phase], float(sticking.start[phase])
            rows = self._accumulation(name, int(side), end)
            left_out.update(rows[1:])
            what = f"{name} sticks to the {_sign(side)} wall: end of an accumulation of {len(rows)} impacts"
            found.append(Instant(end, what, self.names.index(name)))
        for i in self.rows:
            if int(i) not in left_out:
                name, side, pair = str(impacts.impactor[i]), impacts.side[i], self.names.index(str(impacts.impactor[i]))
                what = f"{name} meets the {_sign(side)} wall at {impacts.approach_speed[i]:.4g} m/s"
                impulse = self.on_beam(pair) * float(side * impacts.impulse[i])
                found.append(Instant(float(impacts.time[i]), what, pair, impulse))
        shown = (item for item in found if self.start <= item.time <= self.end)
        return sorted(shown, key=lambda item: item.time)

    def _accumulation(self, name: str, side: int, end: float) -> list[int]:
        """Rows of the table of impacts that lead to a sticking phase, in the order of time."""
        impacts = self.response.impacts
        mine = np.flatnonzero((impacts.impactor == name) & (impacts.time <= end))
        mine = mine[np.argsort(impacts.time[mine], kind="stable")]
        rows, wait = list[int](), 0.0
        for i in reversed(mine):
            between = float(impacts.time[rows[-1]] - impacts.time[i]) if rows else 0.0
            if int(impacts.side[i]) != side or between < wait:
                break
            rows.append(int(i))
            wait = between
        return rows[::-1]


def _sign(side: float) -> str:
    return "+" if side > 0 else "-"
