"""The benchmark problem as data (`yardstick.toml`) and as femimpact's equations, which every peer may take."""

from __future__ import annotations

import functools
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import femimpact as fi

__all__ = ["Problem", "Task", "load_problem"]


@dataclass(frozen=True)
class Task:
    """One sweep: every frequency from rest, statistics of the tip in the last `window` seconds."""

    name: str
    ball: bool
    duration: float
    window: float
    dt: float

    @property
    def steps(self) -> int:
        """Steps of the whole history."""
        return round(self.duration / self.dt)

    @property
    def first(self) -> int:
        """Steps before the window."""
        return round((self.duration - self.window) / self.dt)


@dataclass(frozen=True)
class Problem:
    """`data` as in the file, and the systems made of it."""

    data: dict

    @property
    def frequencies(self) -> np.ndarray:
        """Hz."""
        sweep = self.data["sweep"]
        return np.linspace(sweep["start"], sweep["stop"], sweep["points"])

    @property
    def amplitude(self) -> float:
        """Of the base, m."""
        return self.data["base"]["amplitude"]

    def task(self, name: str) -> Task:
        """A or B."""
        return Task(name=name, **self.data["task"][name])

    def structure(self, ball: bool = True) -> fi.Structure:
        """Beam and box, with or without the ball."""
        data = self.data
        wall = fi.KelvinVoigt(**data["wall"])
        balls = [fi.Impactor("ball", at="tip", contact=wall, **data["ball"])] if ball else []
        return fi.Structure(
            beam=fi.Beam.uniform(**data["beam"]),
            masses=[fi.PointMass("box", at="tip", mass=data["box"]["mass"])],
            impactors=balls,
            damping=fi.Rayleigh(ratio=data["rayleigh"]["ratio"], modes=tuple(data["rayleigh"]["modes"])),
        )

    def full(self, elements: int = 10, ball: bool = True) -> fi.System:
        """All degrees of freedom."""
        return _full(self, elements, ball)

    def modal(self, elements: int = 10, ball: bool = True, modes: int = 0) -> fi.System:
        """On normal modes, as many as the file says unless told."""
        return _modal(self, elements, ball, modes or self.data["modes"])

    def __hash__(self) -> int:
        return id(self)


@functools.cache
def _full(problem: Problem, elements: int, ball: bool) -> fi.System:
    return fi.assemble(problem.structure(ball), elements=elements)


@functools.cache
def _modal(problem: Problem, elements: int, ball: bool, modes: int) -> fi.System:
    return fi.reduce(problem.full(elements, ball), modes=modes)


@functools.cache
def load_problem() -> Problem:
    """The problem of `yardstick.toml`."""
    return Problem(tomllib.loads((Path(__file__).parent / "yardstick.toml").read_text()))
