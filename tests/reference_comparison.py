"""Event-driven motion against the reference integrator, up to the first few touches."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from reference_equations import Excitation
from reference_motion import reference_motion

import femimpact as fi


@dataclass(frozen=True)
class Comparison:
    """Largest difference of positions over the largest position, the touches before its end (s), and why it ended."""

    difference: float
    touches: int
    end: float
    why: str


def compare(
    system: fi.System, excitation: Excitation, duration: float, initial: fi.State,
    most_touches: int = 5, most_steps: int = 2000, samples: int = 48,
) -> Comparison:  # fmt: skip
    """Event-driven positions of all places and balls against the reference, up to some touch.

    Balls that are equal in all but their name may hit at one instant: which of them is the first is left to
    rounding, so that they are compared in the order of their positions.

    Parameters
    ----------
    system : System
    excitation : Sine, PointForce or RecordedBase
    duration : float, s
        At most.
    initial : State
    most_touches, most_steps, samples : int
        Before the end of what is compared.

    Returns
    -------
    Comparison
    """
    places = [name for name in system.points if np.any(system.point_row(name))]
    names = (*places, *(pair.name for pair in system.balls))
    found = fi.integrate(system, excitation, fi.EventDriven(), duration, fi.Recorder(names), initial)
    touched = np.sort(found.impacts.time[found.impacts.time > 0.0])
    until = min(duration, float(touched[most_touches - 1]) if touched.size >= most_touches else duration)
    # events do not depend on the grid, which is to have some samples before the last of them
    interval = 1.0 / (max(math.ceil(samples / (until * excitation.frequency)), 8) * excitation.frequency)
    span = max(1.05 * until, interval)
    run = fi.integrate(system, excitation, fi.EventDriven(), span, fi.Recorder(names, interval=interval), initial)
    stride = max(run.time.size // (2 * samples), 1)
    reference = reference_motion(system, excitation, run.time[::stride], initial, most_touches, most_steps)
    # of sticking phases the reference knows some
    known = np.array(reference.rests)
    unknown = [start for start in run.sticking.start if not np.any(np.abs(known - start) <= 1e-9 * until)]
    end = min([reference.end, *unknown])
    kept = reference.time <= end
    rows = np.zeros((len(names), system.dofs + len(system.balls)))
    rows[: len(places), : system.dofs] = [system.point_row(name) for name in places]
    rows[len(places) :, system.dofs :] = np.eye(len(system.balls))
    expected = reference.position[kept] @ rows.T
    got = np.column_stack([run[name][::stride][: kept.size][kept] for name in names])
    for group in _alike(system):
        columns = len(places) + np.array(group)
        expected[:, columns], got[:, columns] = np.sort(expected[:, columns]), np.sort(got[:, columns])
    size = float(np.max(np.abs(expected)))
    difference = float(np.max(np.abs(got - expected))) / (size if size > 0.0 else 1.0)
    touches = sum(time < end for time, _, _ in reference.touches)
    return Comparison(difference, touches, end, reference.why)


def _alike(system: fi.System) -> list[list[int]]:
    """Numbers of balls that only their names tell apart."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, ball in enumerate(system.balls):
        key = (ball.mass, ball.gaps, ball.law, ball.free_stiffness, ball.acceleration, ball.direction.tobytes())
        groups.setdefault(key, []).append(i)
    return list(groups.values())
