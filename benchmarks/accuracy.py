"""Exact answers to the benchmark problem, independent of femimpact's integrators.

Without contact: the state matrix of all dofs, decomposed once, and the closed form of its forced response.
With the ball: motion between contacts, touch and release are linear each, so that the matrix exponential of the
state (with the sine, the cosine and a constant appended) is exact; the changes between them are bracketed on a
fine grid and found as roots.
"""

from __future__ import annotations

import functools

import numpy as np
import scipy.linalg
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

__all__ = ["cycle_error", "exact_free_tip", "exact_peaks", "exact_tip", "history_error", "in_bands", "peak_error"]

GRID = 1e-5
"""Seconds between two looks for a change of phase; the contact lasts 155 of them."""


def _free_matrix(system):
    """State matrix of the structure, z = (u, u'), its load for a unit base acceleration, and the tip's row."""
    M, C, K = (np.asarray(matrix.toarray()) for matrix in (system.M, system.C, system.K))
    n = system.dofs
    lower = -np.linalg.solve(M, np.hstack([K, C]))
    load = -np.linalg.solve(M, system.base_load)
    return np.vstack([np.eye(n, 2 * n, n), lower]), np.append(np.zeros(n), load), system.point_row("tip")


class FreeResponse:
    """Response from rest of the structure alone to a sine of the base."""

    def __init__(self, system, amplitude, frequency):
        matrix, load, row = _free_matrix(system)
        values, vectors = np.linalg.eig(matrix)
        self.omega = 2.0 * np.pi * frequency
        forced = np.linalg.solve(1j * self.omega * np.eye(len(load)) - matrix, load * (-amplitude * self.omega**2))
        at_start = np.linalg.solve(vectors, -forced.imag)
        self.forced = complex(row @ forced[: system.dofs])
        self.values, self.weights = values, (row @ vectors[: system.dofs]) * at_start

    def __call__(self, times, derivative=0, alive_from=0.0):
        """Tip (m, m/s) at some times; of what decays only what is left at `alive_from`."""
        t = np.atleast_1d(np.asarray(times, dtype=float))
        turning = 1j * self.omega
        tip = (self.forced * turning**derivative * np.exp(turning * t)).imag
        left = np.abs(self.weights) * np.exp(self.values.real * alive_from) > 1e-20
        for value, weight in zip(self.values[left], self.weights[left], strict=True):
            tip += (weight * value**derivative * np.exp(value * t)).real
        return tip

    def largest(self, first, last):
        """Largest size of the tip between two times, m, in continuous time."""
        grid = np.linspace(first, last, int(400 * self.omega / (2.0 * np.pi) * (last - first)))
        size = np.abs(self(grid, alive_from=first))
        best = size[[0, -1]].max()
        inside = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:])) + 1
        for i in inside[size[inside] > (1.0 - 1e-3) * size.max()]:
            root = brentq(lambda t: float(self(t, 1, first)[0]), grid[i - 1], grid[i + 1], xtol=1e-13)
            best = max(best, abs(float(self(root, alive_from=first)[0])))
        return best


def exact_free_tip(problem, frequency, times):
    """Tip without the ball, all dofs of ten elements, m."""
    return FreeResponse(problem.full(ball=False), problem.amplitude, frequency)(times)


@functools.cache
def exact_peaks(problem, elements=10):
    """Exact answer to task A: largest tip in the window at every frequency, m."""
    task, system = problem.task("A"), problem.full(elements, ball=False)
    first = task.duration - task.window
    responses = [FreeResponse(system, problem.amplitude, f) for f in problem.frequencies]
    return np.array([response.largest(first, task.duration) for response in responses])


def peak_error(problem, peaks):
    """Largest relative error of the peaks of task A."""
    return float(np.max(np.abs(peaks / exact_peaks(problem) - 1.0)))


class Pair:
    """Structure on normal modes, ball, drive and a constant as one linear system for each phase.

    State: omega q, q', y, y', sin, cos, 1. Phases: 0 no force, +1 and -1 pressed against a wall.
    """

    def __init__(self, system, amplitude, frequency):
        pair, n = system.contacts[0], system.dofs
        numbers, row, own = pair.parameters, pair.direction, np.sqrt(system.K.diagonal())
        size, turning = 2 * n + 5, 2.0 * np.pi * frequency
        y, speed, sine, cosine, one = range(2 * n, size)
        self.tip = np.zeros(size)
        self.tip[:n] = system.point_row("tip") / own
        base = np.zeros(size)
        base[sine] = -amplitude * turning**2
        free = np.zeros((size, size))
        free[:n, n : 2 * n], free[n : 2 * n, :n] = np.diag(own), -np.diag(own)
        free[n : 2 * n, n : 2 * n] = -system.C.toarray()
        free[n : 2 * n] -= np.outer(system.base_load, base)
        free[y, speed], free[speed] = 1.0, -base
        free[sine, cosine], free[cosine, sine] = turning, -turning
        gap_row, rate_row = np.zeros(size), np.zeros(size)
        gap_row[:n], gap_row[y] = -row / own, 1.0
        rate_row[n : 2 * n], rate_row[speed] = -row, 1.0
        self.matrices, self.depth, self.force = {0: free}, {}, {}
        for side, gap in ((1, pair.gaps[0]), (-1, pair.gaps[1])):
            depth = side * gap_row
            depth[one] = -gap
            force = numbers.stiffness * depth + numbers.damping * side * rate_row
            pressed = free.copy()
            pressed[n : 2 * n] += np.outer(side * row, force)
            pressed[speed] -= side * force / pair.mass
            self.matrices[side], self.depth[side], self.force[side] = pressed, depth, force
        self.start = np.zeros(size)
        self.start[[cosine, one]] = 1.0
        self.steps = {phase: scipy.linalg.expm(GRID * matrix) for phase, matrix in self.matrices.items()}

    def carry(self, phase, state, time):
        """State after some seconds in one phase."""
        return scipy.linalg.expm(time * self.matrices[phase]) @ state

    def changes(self, phase, leaving):
        """Rows whose sign change from - to + ends the phase, each with the phase and wall that follow."""
        if phase:
            return [(-self.force[phase], 0, phase)]
        rows = [(self.depth[side], side, 0) for side in (1, -1) if side != leaving]
        # released but still inside the wall: pressed again, or clear of it
        return [*rows, (self.force[leaving], leaving, 0), (-self.depth[leaving], 0, 0)] if leaving else rows


@functools.cache
def exact_tip(problem, modes, frequency=None, duration=None):
    """Times (s) and tip (m) with the ball from rest, every GRID seconds; modes of ten elements."""
    chosen = problem.data["tip"]
    frequency, duration = frequency or chosen["frequency"], duration or chosen["duration"]
    pair = Pair(problem.modal(modes=modes), problem.amplitude, frequency)
    state, phase, leaving, tips = pair.start, 0, 0, [0.0]
    for _ in range(round(duration / GRID)):
        left, after = GRID, pair.steps[phase] @ state
        while (change := _first_change(pair, phase, leaving, state, after, left)) is not None:
            used, next_phase, leaving = change
            state, left = pair.carry(phase, state, used), left - used
            phase = next_phase
            after = pair.carry(phase, state, left)
        state = after
        tips.append(float(pair.tip @ state))
    return GRID * np.arange(len(tips)), np.array(tips)


def _first_change(pair, phase, leaving, state, after, left):
    """Time to the first change of phase within `left` seconds, the phase that follows and the wall then being left."""
    found = []
    for row, next_phase, next_leaving in pair.changes(phase, leaving):
        if row @ state <= 0.0 < row @ after:
            value = functools.partial(_value, pair, phase, row, state)
            found.append((brentq(value, 0.0, left, xtol=1e-17, rtol=1e-14), next_phase, next_leaving))
    return min(found, default=None, key=lambda change: change[0])


def _value(pair, phase, row, state, time):
    return float(row @ pair.carry(phase, state, time)) if time else min(float(row @ state), -1e-300)


def history_error(problem, times, tips, modes=0):
    """Largest difference of a tip's history from the exact one, over its largest; in the peer's own space."""
    at, exact = exact_tip(problem, modes or problem.data["modes"])
    # cubic between the grid's instants: 1e-5 s apart, the beam's modes of up to 1 kHz are exact to 1e-9
    smooth = CubicSpline(at, exact)
    inside = times <= at[-1] + 0.5 * GRID
    return float(np.max(np.abs(tips[inside] - smooth(times[inside]))) / np.max(np.abs(exact)))


def cycle_error(problem, sweep_of):
    """Largest relative error of the peaks of the last whole cycle before chaos decides, of a sweep itself.

    `sweep_of` takes frequencies (Hz), duration and window (s) and gives the peaks.
    """
    worst = 0.0
    for frequency in problem.frequencies[[0, 12, 20]]:
        cycles = int(problem.data["tip"]["duration"] * frequency)
        end, start = cycles / frequency, (cycles - 1) / frequency
        times, tips = exact_tip(problem, problem.data["modes"], frequency, end + GRID)
        # the largest may stand at an end of the cycle, between two instants of the grid
        exact = np.abs(CubicSpline(times, tips)(np.linspace(start, end, 100_001)))
        peak = float(sweep_of([frequency], end, 1.0 / frequency)[0])
        worst = max(worst, abs(peak / np.max(exact) - 1.0))
    return worst


def in_bands(problem, sweep):
    """Mean rms and mean peak of task B (m), and whether each lies in its band."""
    rms, peak = float(np.mean(sweep.rms)), float(np.mean(sweep.peak))
    bands = problem.data["bands"]
    return rms, peak, bands["rms"][0] <= rms <= bands["rms"][1], bands["peak"][0] <= peak <= bands["peak"][1]
