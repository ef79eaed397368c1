"""Reference loops in C (`benchmarks/reference.c`), compiled by the system's compiler, called by ctypes.

    python benchmarks/peers/hand_c.py

prints what a step costs, ns per step, case and dof.
"""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.linalg
import scipy.sparse as sparse

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from peers import Sweep

NAME = "C by hand, one case at a time"
SPACE = "8 modes"
MODES = 8
SETTINGS = (2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6, 1e-6)
SOURCE = Path(__file__).parents[1] / "reference.c"
LANES = 8
COMMAND = ("cc", "-O3", "-march=native", "-shared", "-fPIC")


class Wall(ctypes.Structure):
    """The ball between its walls, as the C code has it."""

    _fields_ = [
        (name, ctypes.c_double) for name in ("ball", "mass", "plus", "minus", "stiffness", "damping", "mobility")
    ]


def missing() -> str:
    """Why it cannot run here; empty if it can."""
    if shutil.which(COMMAND[0]) is None:
        return "no C compiler (cc) on this machine"
    try:
        library()
    except (OSError, subprocess.CalledProcessError) as error:
        return f"reference.c does not compile or load: {error}"
    return ""


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled code, in a directory that goes when the process ends."""
    folder = tempfile.TemporaryDirectory()
    target = Path(folder.name) / "reference.so"
    subprocess.run([*COMMAND, "-o", str(target), str(SOURCE), "-lm"], check=True, capture_output=True)
    loaded = ctypes.CDLL(str(target))
    loaded.folder = folder
    return loaded


def _wall(system, dt):
    """The pair's numbers; S^-1 b comes with them where the system has physical dofs."""
    if not system.contacts:
        return Wall(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0), np.zeros(system.dofs)
    pair = system.contacts[0]
    effective = (system.M + 0.5 * dt * system.C + 0.25 * dt * dt * system.K).toarray()
    h = scipy.linalg.solve(effective, pair.direction, assume_a="pos")
    numbers = pair.parameters
    mobility = 1.0 / pair.mass + float(pair.direction @ h)
    return Wall(1.0, pair.mass, *pair.gaps, numbers.stiffness, numbers.damping, mobility), h


def _doubles(array):
    return np.ascontiguousarray(array, dtype=float)


def _address(array):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class Run:
    """One prepared call: the tables are made once, `go` is what is timed.

    `kind` is modal, modal eight, modal adaptive (in `parts` fine steps where the ball may touch) or physical.
    """

    def __init__(self, kind, system, amplitude, frequencies, dt, steps, start=0, every=0, parts=1):
        self.omega = 2.0 * np.pi * _doubles(frequencies)
        self.kind, self.dt, self.amplitude = kind, dt, amplitude
        self.steps, self.start, self.every = int(steps), int(start), int(every)
        self.parts, self.alone = int(parts), kind in ("modal", "modal adaptive")
        self.wall, h = _wall(system, dt / parts)
        row = system.point_row("tip")
        if kind == "physical":
            self.at = int(np.argmax(np.abs(row)))
            self.tables = [_aligned_rows(system, dt, h)]
            self.dofs = system.dofs
        else:
            columns = (system.K.diagonal(), system.C.diagonal(), system.base_load, row)
            self.tables = [_doubles(column) for column in columns]
            self.dofs = system.dofs
        count = self.steps // self.every if self.every else 1
        self.cases = len(self.omega)
        self.padded = LANES * -(-self.cases // LANES)
        self.trace = np.zeros((count, 1 if self.alone else LANES))
        self.result = np.zeros((self.padded, 2))

    def go(self) -> Sweep:
        """All cases, one at a time or eight side by side."""
        code, double, long = library(), ctypes.c_double, ctypes.c_long
        tables = [_address(table) for table in self.tables]
        times = (long(self.steps), long(self.start), double(self.dt), double(self.amplitude))
        wall, every, trace = ctypes.byref(self.wall), long(self.every), _address(self.trace)
        if self.alone:
            for i, omega in enumerate(self.omega):
                given = (self.dofs, *times, double(omega), *tables, wall, every, trace, _address(self.result[i]))
                if self.kind == "modal":
                    code.modal_one(*given)
                else:
                    code.modal_adaptive(*given, long(self.parts))
        else:
            filled = np.append(self.omega, np.repeat(self.omega[-1], self.padded - self.cases))
            for first in range(0, self.padded, LANES):
                omega, found = _address(filled[first : first + LANES].copy()), _address(self.result[first:])
                if self.kind == "physical":
                    code.physical_eight(self.dofs, self.at, *times, omega, *tables, wall, every, trace, found)
                else:
                    code.modal_eight(self.dofs, *times, omega, *tables, wall, every, trace, found)
        peak, rms = self.result[: self.cases].T
        return Sweep(peak.copy(), rms.copy())


def _aligned_rows(system, dt, h):
    """24 numbers a dof, as `physical_eight` reads them."""
    n = system.dofs
    table = np.zeros((n, 24))
    for offset, matrix in ((0, system.C), (7, system.K)):
        entries = sparse.coo_array(matrix)
        row, column = entries.coords
        np.add.at(table, (row, offset + 3 + column - row), entries.data)
    effective = sparse.coo_array(system.M + 0.5 * dt * system.C + 0.25 * dt * dt * system.K)
    row, column = effective.coords
    lower = row >= column
    band = np.zeros((4, n))
    np.add.at(band, (row[lower] - column[lower], column[lower]), effective.data[lower])
    factor = scipy.linalg.cholesky_banded(band, lower=True)
    unit = factor / factor[0]
    table[:, 17] = 1.0 / factor[0] ** 2
    for k in (1, 2, 3):
        table[k:, 17 - k] = unit[k, :-k] if k < n else 0.0
        table[:-k, 17 + k] = unit[k, :-k]
    table[:, 21], table[:, 22] = system.base_load, h
    return _doubles(table)


def prepared(problem, task, frequencies=None, kind="modal", elements=10, modes=0) -> Run:
    """A task, ready to run."""
    full = kind == "physical"
    system = problem.full(elements, task.ball) if full else problem.modal(elements, task.ball, modes)
    chosen = problem.frequencies if frequencies is None else frequencies
    return Run(kind, system, problem.amplitude, chosen, task.dt, task.steps, task.first)


def usual(task) -> float:
    """Step that the task asks for, s."""
    return task.dt


def sweep(problem, task) -> Sweep:
    """All frequencies, one after the other."""
    return prepared(problem, task).go()


def history(problem, task, frequency, duration, setting):
    """The tip after every step of `setting` seconds."""
    steps = round(duration / setting)
    run = Run("modal", problem.modal(ball=task.ball), problem.amplitude, [frequency], setting, steps, every=1)
    run.go()
    return setting * np.arange(1, steps + 1), run.trace[:, 0].copy()


def cost(run, repeats=5):
    """CPU time of the best of some runs, ns per step and case; lanes that stand idle count as cases."""
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        run.go()
        best = min(best, time.process_time() - start)
    return 1e9 * best / run.steps / (run.cases if run.alone else run.padded)


def main() -> None:
    from problem import load_problem

    problem = load_problem()
    reason = missing()
    if reason:
        print("skipped:", reason)
        return
    dt = problem.task("B").dt
    print("coordinates   elements    dofs   cases   ns per step and case   ns per step, case and dof")
    eight = problem.frequencies[:LANES]
    plan = [("modal", 10, 8, [5.2]), ("modal eight", 10, 8, eight)]
    plan += [("physical", elements, 0, eight) for elements in (10, 40, 100, 1000)]
    for kind, elements, modes, frequencies in plan:
        system = problem.full(elements) if kind == "physical" else problem.modal(elements, modes=modes)
        run = Run(
            kind, system, problem.amplitude, frequencies, dt, max(2000, 2_000_000 // system.dofs // len(frequencies))
        )
        each = cost(run)
        name = "physical" if kind == "physical" else "modes"
        print(f"{name:13} {elements:8d} {run.dofs:7d} {run.cases:7d} {each:22.2f} {each / run.dofs:27.3f}")


if __name__ == "__main__":
    main()
