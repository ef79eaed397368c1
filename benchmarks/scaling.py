"""How the cost of a step goes with cases, dofs, threads; memory."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
from contestants import OWN
from newmark_step import kernel
from peers import hand_c
from problem import load_problem
from timing import Job, take_turns, timed

import femimpact as fi

__all__ = ["all_modes", "cost_over_dofs", "further_time", "memory", "physical", "step_cost", "threads"]

HERE = Path(__file__).parent


def _method(problem):
    return fi.Newmark(dt=problem.task("B").dt, allow_coarse_step=True)


def step_cost(problem, repeats=5, steps=100_000):
    """Rows: cases side by side, ns per step and case of the kernel on 8 modes, ledger off and on."""
    system, method = problem.modal(), _method(problem)
    return [
        {"cases": cases, "ledger": ledger, "ns": float(kernel(system, method, cases, ledger, steps, repeats))}
        for cases in (1, 8, 21, 64)
        for ledger in (False, True)
    ]


def _eight_cases(problem, elements, steps):
    """Femimpact's block of eight cases in physical dofs, ready to run."""
    from femimpact.integrators.stepping.arrays import Inputs
    from femimpact.integrators.stepping.run import prepare, run_block

    system, method = problem.full(elements), _method(problem)
    bases = [fi.Sine(problem.amplitude, f) for f in problem.frequencies[: hand_c.LANES]]

    def once():
        block = prepare(
            system, Inputs(bases, [steps] * len(bases), [0] * len(bases)), method,
            observed=system.point_row("tip"), ledger=False,
        )  # fmt: skip
        start = time.process_time()
        run_block(block)
        return time.process_time() - start

    return once


def physical(problem, elements=(10, 100, 1000), repeats=5):
    """Rows: all dofs with eight cases, femimpact and the C code in turns, ns per step and case."""
    reason, rows = hand_c.missing(), []
    if reason:
        return [{"skipped": reason}]
    dt = problem.task("B").dt
    for count in elements:
        steps = max(1000, 400_000 // count)
        run = hand_c.Run("physical", problem.full(count), problem.amplitude, problem.frequencies[:8], dt, steps)
        own, best = _eight_cases(problem, count, steps), [np.inf, np.inf]
        own()
        for _ in range(repeats):
            best[0] = min(best[0], own())
            best[1] = min(best[1], timed(run.go)[0])
        mine, theirs = (1e9 * seconds / steps / hand_c.LANES for seconds in best)
        rows.append({"elements": count, "dofs": 2 * count, "ns": mine, "ns in C": theirs, "ratio": mine / theirs})
    return rows


def cost_over_dofs(problem, elements=(10, 30, 100, 300, 1000, 3000, 10_000), cases=8, repeats=3):
    """Rows: ns per step and case and largest memory over the dofs, and the exponents fitted to them."""
    rows = []
    for count in elements:
        # long enough that the first touch of the arrays does not count
        steps = max(1000, 2_000_000 // count)
        ns = kernel(problem.full(count), _method(problem), cases, False, steps, repeats)
        rows.append({"elements": count, "dofs": 2 * count, "ns": float(ns), "MB": _largest_arrays(problem, count)})
    # small meshes weigh less than the interpreter's own objects
    large = [row for row in rows if row["elements"] >= 100]
    cost, size = (
        float(np.polyfit(np.log([row["dofs"] for row in some]), np.log([row[name] for row in some]), 1)[0])
        for name, some in (("ns", rows), ("MB", large))
    )
    return rows, cost, size


def _largest_arrays(problem, elements):
    """Largest memory (MB) that assembling the mesh, laying out eight cases and running them holds at once."""
    tracemalloc.start()
    _eight_cases(problem, elements, 10)()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def further_time(problem, repeats=5, further=100):
    """CPU time (ms) of a further 0.8 s in a long event-driven run: what is left without laying out and reading."""
    system, base = problem.modal(), fi.Sine(problem.amplitude, 5.2)
    record = fi.Recorder(channels=("tip",), ledger=False, impacts=0)
    times = {}
    for duration in (0.8, 0.8 * (1 + further)):
        best = np.inf
        for _ in range(repeats):
            start = time.process_time()
            fi.integrate(system, base, fi.EventDriven(), duration, record)
            best = min(best, time.process_time() - start)
        times[duration] = best
    short, long = times.values()
    return 1e3 * (long - short) / further


def all_modes(problem, elements=(100, 1000), repeats=2, say=print):
    """Rows: task B with every mode that the mesh has; Newmark at the task's step, and refined in touch."""
    task, rows = problem.task("B"), []
    for count in elements:
        say(f"all modes of {count} elements")
        setup, _, system = timed(lambda count=count: problem.modal(count, modes=2 * count))
        for name, method in (("Newmark", _method(problem)), ("refined", OWN[2].make(1 / 1000))):
            run = lambda system=system, method=method: fi.frequency_sweep(  # noqa: E731
                system, problem.amplitude, problem.frequencies, method,
                duration=task.duration, window=task.window, ledger=False, threads=1,
            )  # fmt: skip
            found = take_turns([Job(name, run, repeats if count < 1000 else 1)])[name]
            row = {"elements": count, "modes": 2 * count, "method": name, "modes found in (s)": setup}
            if isinstance(found, str):
                rows.append({**row, "refused": found})
                continue
            rows.append({**row, "cpu": found.cpu, "rms": found.result.rms.mean(), "peak": found.result.peak.mean()})
    return rows


def threads(problem, repeats=5, cases=1000):
    """Rows: wall time with one and two threads, on task B and on a study of many cases."""
    task, rows = problem.task("B"), []
    many = np.linspace(4.0, 6.0, cases)
    plan = {
        "task B": (problem.frequencies, task.duration, task.window),
        f"{cases} cases": (many, task.duration, task.window),
    }
    for name, (frequencies, length, window) in plan.items():
        for tool in OWN[:3]:
            system = tool.system(problem, task)

            def run(count, tool=tool, system=system, frequencies=frequencies, length=length, window=window):
                return fi.frequency_sweep(
                    system, problem.amplitude, frequencies, tool.make(tool.usual(task)),
                    duration=length, window=window, ledger=False, threads=count,
                ).rms  # fmt: skip

            jobs = [Job(str(count), lambda count=count, run=run: run(count), repeats) for count in (1, 2)]
            found = take_turns(jobs)
            row = {"work": name, "method": tool.NAME}
            if isinstance(found["1"], str):
                rows.append({**row, "refused": found["1"]})
                continue
            one, two = found["1"], found["2"]
            same = bool(np.array_equal(one.result, two.result))
            rows.append({**row, "one": one.wall, "two": two.wall, "faster": one.wall / two.wall, "same bits": same})
    return rows


def memory():
    """Largest memory (MB) of a child process: after the imports, and after task B."""
    run = subprocess.run(
        [sys.executable, str(HERE / "scaling.py"), "--memory"], capture_output=True, text=True, check=True, cwd=HERE
    )
    imported, finished = (float(part) for part in run.stdout.split())
    return {"imports": imported, "task B": finished}


def _memory_child():
    import resource

    def largest():
        # of this program only: getrusage counts the parent that it was forked from
        own = Path("/proc/self/status")
        if own.exists():
            return next(float(line.split()[1]) for line in own.read_text().splitlines() if "VmHWM" in line) / 1e3
        # kB on Linux, bytes on macOS
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)

    problem = load_problem()
    before = largest()
    OWN[1].sweep(problem, problem.task("B"))
    print(before, largest())


if __name__ == "__main__" and "--memory" in sys.argv:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    _memory_child()
