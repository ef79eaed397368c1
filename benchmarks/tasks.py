"""Tasks A and B by everybody, and the tip's history over accuracy: times beside errors."""

from __future__ import annotations

import functools
from dataclasses import asdict, dataclass, field

import numpy as np
from accuracy import cycle_error, exact_free_tip, history_error, in_bands, peak_error
from contestants import OWN, SEPARATE, peer
from problem import load_problem
from timing import Child, Job, Measured, take_turns

__all__ = ["Point", "Row", "run_points", "run_tasks"]

PIECE = {"A": 4.0, "B": 2.0}
"""Seconds of motion at one frequency that a slow peer runs of a task; its time is scaled up to the whole."""

SLOW = 3
"""Repeats of a slow peer; all others take five."""


@dataclass
class Row:
    """One tool on one task: times of the whole task (s), error of the tip (1), and what has to be said."""

    task: str
    tool: str
    space: str
    cpu: float = float("nan")
    wall: float = float("nan")
    note: str = ""
    setting: float = float("nan")
    tip: float = float("nan")
    repeats: int = 0
    own: bool = False
    statistics: dict = field(default_factory=dict)


@dataclass
class Point:
    """One history of the tip: setting, CPU time (s), error over the largest tip (1)."""

    tool: str
    setting: float
    cpu: float
    error: float
    own: bool


def history_of(name, task_name, duration, setting):
    """Times and tip of a peer given by its name, as a separate process can be asked."""
    problem = load_problem()
    task = problem.task(task_name)
    return peer(name).history(problem, task, problem.data["tip"]["frequency"], duration, setting)


def contestants(chosen):
    """Femimpact's methods and the chosen peers, with the reasons of those that are left out."""
    able, skipped = [], {}
    for name in chosen:
        module = peer(name)
        reason = module.missing()
        if reason:
            skipped[module.NAME] = reason
        else:
            able.append((name, module))
    return [("", own) for own in OWN] + able, skipped


def _call(name, tool, problem, task, duration, setting):
    """What runs one history, in this process or in a separate one."""
    if name in SEPARATE:
        return Child(history_of, name, task.name, duration, setting)
    frequency = problem.data["tip"]["frequency"]
    return lambda: tool.history(problem, task, frequency, duration, setting)


def run_tasks(problem, chosen, repeats=5, say=print) -> tuple[list[Row], dict[str, str]]:
    """Rows of both tasks, and why some tools have none."""
    tools, skipped = contestants(chosen)
    rows = []
    for task in (problem.task("A"), problem.task("B")):
        jobs, known = [], {}
        for name, tool in tools:
            if not name and task.name not in tool.tasks:
                continue
            whole = hasattr(tool, "sweep")
            if whole:
                call = lambda tool=tool, task=task: tool.sweep(problem, task)  # noqa: E731
            else:
                call = _call(name, tool, problem, task, PIECE[task.name], tool.usual(task))
            jobs.append(Job(tool.NAME, call, repeats if whole else min(SLOW, repeats)))
            known[tool.NAME] = (tool, whole, not name)
        measured = take_turns(jobs, say)
        for job in jobs:
            tool, whole, own = known[job.name]
            rows.append(_row(problem, task, tool, whole, own, measured[job.name]))
            if isinstance(job.call, Child):
                job.call.close()
    return rows, skipped


def _row(problem, task, tool, whole, own, found):
    row = Row(task.name, tool.NAME, tool.SPACE, own=own, setting=float(tool.usual(task)))
    if isinstance(found, str):
        row.note = f"refused: {found}"
        return row
    full = len(problem.frequencies) * task.duration
    scale = 1.0 if whole else full / PIECE[task.name]
    row.cpu, row.wall, row.repeats = scale * found.cpu, scale * found.wall, found.repeats
    tip = problem.data["tip"]
    history = found.result
    if whole:
        length = tip["duration"] if task.ball else PIECE[task.name]
        history = tool.history(problem, task, tip["frequency"], length, tool.usual(task))
    if task.ball:
        row.tip = history_error(problem, *history, tool.MODES)
    else:
        exact = exact_free_tip(problem, tip["frequency"], history[0])
        row.tip = float(np.max(np.abs(history[1] - exact)) / np.max(np.abs(exact)))
    if whole and task.ball:
        rms, peak, rms_fits, peak_fits = in_bands(problem, found.result)
        row.statistics = {"rms": rms, "peak": peak, "rms in band": rms_fits, "peak in band": peak_fits}
    elif whole:
        row.statistics = {"peaks": peak_error(problem, found.result.peak)}
    if own and task.ball:
        worst = cycle_error(problem, functools.partial(tool.peaks, problem, task))
        row.statistics["cycle"] = worst
        row.note = f"peaks of the sweep's own cycle before {tip['duration']:g} s: error {worst:.1e}"
    if not whole:
        row.note = f"{PIECE[task.name]:g} s at one frequency, times {scale:.0f}; best of {found.repeats}"
    return row


def run_points(problem, chosen, repeats=5, say=print) -> list[Point]:
    """The tip's history of task B at every setting of every tool."""
    tools, _ = contestants(chosen)
    task, tip = problem.task("B"), problem.data["tip"]
    jobs, known = [], {}
    for name, tool in tools:
        for setting in tool.SETTINGS:
            label = f"{tool.NAME} at {setting:g}"
            call = _call(name, tool, problem, task, tip["duration"], setting)
            jobs.append(Job(label, call, min(SLOW, repeats) if name in SEPARATE else repeats))
            known[label] = (tool, setting, not name)
    found = take_turns(jobs, say)
    points = []
    for job in jobs:
        tool, setting, own = known[job.name]
        measured = found[job.name]
        if isinstance(measured, Measured):
            error = history_error(problem, *measured.result, tool.MODES)
            points.append(Point(tool.NAME, float(setting), measured.cpu, error, own))
        if isinstance(job.call, Child):
            job.call.close()
    return points


def as_data(items):
    """For JSON."""
    return [asdict(item) for item in items]
