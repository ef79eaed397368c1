"""What one reduced system shows: statistics of a long run, and one first impact."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from femimpact.convergence.result import STATISTICS
from femimpact.errors import require
from femimpact.excitation import Sine
from femimpact.integrators.integrate import integrate
from femimpact.integrators.methods import Method, require_method
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Position
from femimpact.sweep import frequency_sweep
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["PARTS", "first_impact", "run_statistics"]

PARTS = 8
"""Parts of the window between which statistics scatter."""

POINTS_PER_CYCLE = 64
"""Samples of a stepped run in a base cycle: a sine's peak is met to 0.1 %."""

POINTS_OF_AN_IMPACT = 256
"""Samples in a cycle of the first mode, at least, between which the first impact is looked for."""


def run_statistics(
    system: System, excitation: Sine, method: Method, duration: float, at: Position, cycles: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Values over the last `cycles` of a run, and their scatter between parts of it.

    The peak is that of `SteadyMotion`, over the last third of the run: the largest |w|, instants of impact included.
    At another place than the one that every run observes it is read by a sweep of one frequency, whose base has no
    phase. The scatter of the peak is that of samples, which miss the crests of all parts alike, by 0.1 % or less.
    """
    require_method(method)
    every = method.stride(excitation.frequency, POINTS_PER_CYCLE)
    keep = Recorder(channels=(at,), every=every, impacts=1_000_000)
    run = integrate(system, excitation, method, duration, keep)
    period = 1.0 / excitation.frequency
    edges = run.time[-1] - period * cycles * np.linspace(1.0, 0.0, PARTS + 1)
    whole = _over(run, at, edges[0], edges[-1], cycles)
    pieces = [_over(run, at, *ends, cycles // PARTS) for ends in pairwise(edges)]
    spread = {}
    for name in STATISTICS:
        parts = np.array([piece[name] for piece in pieces])
        parts = parts[np.isfinite(parts)]
        error = float(np.std(parts, ddof=1)) if parts.size > 1 else math.nan
        spread[name] = error if name == "peak" else error / math.sqrt(max(parts.size, 1))
    assert run.energy is not None
    whole["peak"] = _peak(system, excitation, method, duration, at, run)
    return whole | {"peak_force": run.statistics.peak_force, "residual": run.energy.residual}, spread


def _peak(system: System, excitation: Sine, method: Method, duration: float, at: Position, run: Response) -> float:
    """Largest |w| (m) of a place over the last third of a run."""
    if np.array_equal(system.point_row(at), system.point_row(system.default_place)):
        return float(run.steady.peak[0])
    curve = frequency_sweep(
        system, excitation.amplitude, [excitation.frequency], method, duration=duration, at=at, ledger=False, threads=1
    )
    return float(curve.peak[0])


def _over(run: Response, at: Position, start: float, end: float, cycles: int) -> dict[str, float]:
    """Statistics of a run between two instants (s), a whole number of base cycles apart."""
    ledger = run.energy
    assert ledger is not None
    # half a sample of slack: an edge on a sample must not belong to both sides or to none
    slack = 0.5 * float(run.time[1] - run.time[0])
    inside = (run.time > start + slack) & (run.time <= end + slack)
    w = run[at][inside]
    contact, structure = (
        float(np.diff(np.interp((start, end), run.time, loss))[0]) / cycles
        for loss in (ledger.contact_loss, ledger.structure_loss)
    )
    strain = 2.0 * float(np.mean(ledger.strain[inside]))
    chosen = (run.impacts.time > start) & (run.impacts.time <= end)
    impulse = np.abs(run.impacts.impulse[chosen])
    return {
        "rms": float(np.sqrt(np.mean(w**2))),
        "peak": float(np.max(np.abs(w))),
        "contact_loss": contact,
        "structure_loss": structure,
        "damping": (contact + structure) / (4.0 * math.pi * strain) if strain > 0.0 else math.nan,
        "mean_impulse": float(impulse.mean()) if impulse.size else math.nan,
    }


def first_impact(system: System, method: Method, at: Position) -> dict[str, float]:
    """Displacement and loss a quarter of the first period after one impact from a given state."""
    quiet = Sine(0.0, system.first_frequency)
    state, until = _before_impact(system)
    finely = method.read_at_least(POINTS_OF_AN_IMPACT)
    run = integrate(system, quiet, finely, until + 0.5 / quiet.frequency, Recorder(channels=(at,)), state)
    require(len(run.impacts) > 0, "system.contacts", system.contacts[0].name, "", "is not met by the first impact")
    after = float(run.impacts.time[0]) + 0.25 / quiet.frequency
    assert run.energy is not None
    return {
        "first_displacement": float(np.interp(after, run.time, run[at])),
        "first_loss": float(np.interp(after, run.time, run.energy.contact_loss)),
    }


def _before_impact(system: System) -> tuple[State, float]:
    """A state shortly before the first pair meets a wall, and a time (s) by which it has."""
    pair = system.contacts[0]
    side = 1.0 if pair.gaps[0] <= pair.gaps[1] else -1.0
    near = min(pair.gaps)
    allowed = "must be >= 0 for a convergence over impacts: a preloaded stop has no first one"
    require(near >= 0.0, f"{pair.name}.gaps", pair.gaps, "m", allowed)
    if pair.is_stop:
        # x = -b u, so the first mode moves towards the stop with -side b
        speed = 2.0 * max(near, 1e-6) * 2.0 * math.pi * system.first_frequency
        still = abs(float(pair.direction[0])) == 0.0
        require(not still, pair.name, "at a node of the first mode", "", "must be where the first mode moves")
        velocity = np.zeros(system.dofs)
        velocity[0] = -side * speed / float(pair.direction[0])
        return State(velocity=velocity), 0.25 / system.first_frequency
    clearance = sum(pair.gaps) if math.isfinite(sum(pair.gaps)) else max(near, 1e-6)
    place, rate = np.zeros((2, len(system.balls)))
    place[0] = side * (near - 1e-6 * clearance)
    rate[0] = side * clearance * system.first_frequency
    return State(ball_displacement=place, ball_velocity=rate), 1e-5 / system.first_frequency
