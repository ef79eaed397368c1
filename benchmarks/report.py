"""The printed tables: everybody's times beside errors, the ratios to femimpact, and what was asked for."""

from __future__ import annotations

import csv
import math
from pathlib import Path

__all__ = ["at_error", "error_table", "goals", "markdown", "tables", "task_table", "write_csv", "write_page_tables"]

EIGHT = "C by hand, 8 cases side by side"
"""What the page on speed compares with."""


def number(value, digits=3) -> str:
    """A number for a table; empty where there is none."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if value is None or not math.isfinite(value):
        return ""
    if value == int(value) and abs(value) < 1e5:
        return str(int(value))
    size = abs(value)
    if size >= 10**digits:
        return f"{value:.0f}"
    return f"{value:.{digits}g}" if size >= 1e-3 else f"{value:.1e}"


def markdown(header, rows) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(header) + " |", "| " + " | ".join("---" for _ in header) + " |"]
    return "\n".join(lines + ["| " + " | ".join(number(cell) for cell in row) + " |" for row in rows])


def write_csv(path, header, rows) -> None:
    """Write a table as CSV, numbers as in Markdown."""
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *([number(cell) for cell in row] for row in rows)])


def write_page_tables(folder, rows, points) -> None:
    """Write the tables of the page docs/paper/speed.md as CSV; `docs/make_tables.py` writes them into the page."""
    by_hand = [row for row in rows if row.own or row.tool.startswith("C by hand")]
    eight = next((row.cpu for row in rows if row.tool == EIGHT and row.task == "B"), math.nan)
    others = [row for row in rows if row not in by_hand]
    head = ["tool", "coordinates", "task A: CPU (ms)", "error of the tip", "task B: CPU (ms)", "error of the tip"]
    body = [[*cells, cells[4] / 1e3 / eight if cells[4] else ""] for cells in _both_tasks(by_hand, 1e3)]
    write_csv(Path(folder) / "beside_c.csv", [*head, "task B over eight cases in C (times)"], body)
    head = [word.replace("(ms)", "(s)") for word in head]
    write_csv(Path(folder) / "beside_programs.csv", head, _both_tasks(others, 1.0))
    limits = (1e-2, 1e-3, 1e-4, 1e-5, 1e-8)
    body = []
    for tool, own in dict.fromkeys((point.tool, point.own) for point in points):
        best = [at_error(points, own, limit, (tool,)) for limit in limits]
        body.append([tool, *("" if point is None else 1e3 * point.cpu for point in best)])
    head = ["CPU time (ms) for an error of the tip over 0.8 s of at most", *(f"{limit:g}" for limit in limits)]
    write_csv(Path(folder) / "time_for_error.csv", head, body)


def _both_tasks(rows, scale):
    """Tool, coordinates, then CPU time (s times scale) and error of both tasks; empty where a task was not run."""
    found = {}
    for row in rows:
        if math.isfinite(row.cpu):
            found.setdefault((row.tool, row.space), {})[row.task] = (scale * row.cpu, row.tip)
    return [[*key, *both.get("A", ("", "")), *both.get("B", ("", ""))] for key, both in found.items()]


def rival(rows, row):
    """Femimpact's fastest method on the same task that is at least as exact; the most exact one if none is."""
    own = [r for r in rows if r.own and r.task == row.task and math.isfinite(r.cpu)]
    exact = [r for r in own if r.tip <= 1.05 * row.tip]
    return min(exact, key=lambda r: r.cpu, default=None) or min(own, key=lambda r: r.tip, default=None)


def task_table(rows, task) -> str:
    """One task: CPU and wall time of the whole of it, error, femimpact's advantage, what has to be said."""
    table = []
    for row in (r for r in rows if r.task == task):
        best, ratio, note, checked = rival(rows, row), "", row.note, ""
        if not row.own and best is not None and math.isfinite(row.cpu):
            ratio = row.cpu / best.cpu
            if row.tip < 0.95 * best.tip:
                note += "; " * bool(note) + "more exact than femimpact's most exact"
        if "rms" in row.statistics:
            s = row.statistics
            marks = ["in" if s[f"{name} in band"] else "OUTSIDE" for name in ("rms", "peak")]
            checked = f"{1e3 * s['rms']:.3f} ({marks[0]}), {1e3 * s['peak']:.3f} ({marks[1]})"
        checked = row.statistics.get("peaks", checked)
        setting = f"{row.setting:g}" if math.isfinite(row.setting) else ""
        table.append([row.tool, row.space, setting, row.cpu, row.wall, row.tip, checked, ratio, note])
    last = "error of 21 peaks (1)" if task == "A" else "mean rms, mean peak (mm)"
    head = ["tool", "coordinates", "setting", "CPU (s)", "wall (s)", "error of the tip (1)", last]
    return markdown([*head, "femimpact is faster (times)", "note"], table)


def at_error(points, own, limit, tools=()):
    """Fastest point with an error of at most `limit` among femimpact's or among named tools."""
    fitting = [p for p in points if p.own == own and p.error <= limit and (not tools or p.tool in tools)]
    return min(fitting, key=lambda p: p.cpu, default=None)


def error_table(points) -> str:
    """CPU time (ms) that each tool takes to get below an error; empty where no setting of it does."""
    limits = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
    body = []
    for tool, own in dict.fromkeys((point.tool, point.own) for point in points):
        best = [at_error(points, own, limit, (tool,)) for limit in limits]
        body.append([tool, *("" if point is None else 1e3 * point.cpu for point in best)])
    return markdown(["CPU time (ms) for an error of at most", *(f"{limit:g}" for limit in limits)], body)


def tables(found) -> str:
    """All but the tasks."""
    parts = []
    plain = {
        "Kernel of the fixed step, 8 modes": ("step_cost", ["cases", "ledger", "ns"]),
        "All dofs, eight cases side by side": ("physical", ["elements", "dofs", "ns", "ns in C", "ratio"]),
        "All modes, task B": ("all_modes", ["elements", "modes", "method", "modes found in (s)", "cpu", "rms", "peak"]),
        "Cost of a step over the dofs, eight cases": ("over_dofs", ["elements", "dofs", "ns", "MB"]),
        "Two threads over one, wall time (s)": ("threads", ["work", "method", "one", "two", "faster", "same bits"]),
        "Start to finished task B, wall time (s)": ("start", ["method", "start", "first", "second"]),
    }
    for title, (key, columns) in plain.items():
        rows = found.get(key)
        if not rows:
            continue
        parts.append(f"## {title}\n")
        extra = [name for name in ("refused", "skipped") if any(name in row for row in rows)]
        body = [[row.get(name, "") for name in [*columns, *extra]] for row in rows]
        words = {"ns": "ns per step and case", "cpu": "CPU (s)", "start": "process", "first": "first call"}
        words["second"] = "second call"
        heads = [words.get(name, name) for name in [*columns, *extra]]
        parts.append(markdown(heads, body) + "\n")
        if key == "over_dofs":
            parts.append(
                f"Cost goes with the dofs to the power {found['exponent']:.3f}, memory, from 200 dofs on, to the power "
                f"{found['memory exponent']:.3f}.\n"
            )
    if "memory" in found:
        memory = found["memory"]
        parts.append(
            f"Largest memory of a process: {memory['imports']:.0f} MB after the imports, "
            f"{memory['task B']:.0f} MB after task B. `femimpact --help`: {found['help']:.2f} s.\n"
        )
    return "\n".join(parts)


def goals(rows, points, found) -> list[list]:
    """What was asked for: text, limit, measured, whether met. Only what was measured is listed."""
    out = []

    def add(text, limit, value, at_least=False):
        if value is not None and math.isfinite(value):
            out.append([text, limit, value, value >= limit if at_least else value <= limit])

    finished = [r for r in rows if r.own and math.isfinite(r.cpu)]
    stated = next((r.tip for r in finished if r.task == "B" and r.tool == "femimpact, Newmark"), math.nan)
    task_b = [r for r in finished if r.task == "B" and r.tip <= 1.05 * stated]
    peaks = {r.tool: r.statistics["peaks"] for r in finished if r.task == "A"}
    task_a = [r for r in finished if r.task == "A" and peaks[r.tool] <= 1e-6]
    add("task B, at Newmark's error or better, CPU (s)", 0.03, min((r.cpu for r in task_b), default=None))
    for name, limit in (("Exudyn", 2500), ("OpenSees", 30_000)):
        theirs = next((r.cpu for r in rows if r.task == "B" and r.tool == name), None)
        if theirs and task_b:
            add(f"task B against {name} (times)", limit, theirs / min(r.cpu for r in task_b), at_least=True)
    add("task A, peaks within 1e-6, CPU (s)", 0.01, min((r.cpu for r in task_a), default=None))
    add("task A, smallest error of the peaks (1)", 1e-6, min(peaks.values(), default=None))
    for row in found.get("step_cost", []):
        limit = {21: 12.0, 64: 6.0}.get(row["cases"])
        if limit and not row["ledger"]:
            add(f"step of 8 modes, {row['cases']} cases (ns per case)", limit, row["ns"])
    for count, limit in ((100, 2.0), (1000, 30.0)):
        times = [row["cpu"] for row in found.get("all_modes", []) if row["elements"] == count and "cpu" in row]
        add(f"task B with all modes of {count} elements, CPU (s)", limit, min(times, default=None))
    for row in found.get("physical", []):
        if "ratio" in row:
            add(f"all dofs against C, {row['elements']} elements (times)", 2.0, row["ratio"])
    own, lsoda = at_error(points, True, 1e-4), at_error(points, False, 1e-4, ("scipy LSODA with events",))
    if own and lsoda:
        add("tip within 1e-4: time over LSODA's (1)", 0.1, own.cpu / lsoda.cpu)
    events = at_error(points, True, 1e-4, ("femimpact, event-driven",))
    if events and lsoda:
        add("tip within 1e-4, event-driven, the whole call: time over LSODA's (1)", 1e-3, events.cpu / lsoda.cpu)
        if "further time" in found:
            add(
                "tip within 1e-4, event-driven, further time alone: time over LSODA's (1)",
                1e-3,
                1e-3 * found["further time"] / lsoda.cpu,
            )
    for name, text in (("exponent", "cost"), ("memory exponent", "memory")):
        add(f"{text} over dofs, exponent (1)", 1.1, found.get(name))
    for row in found.get("threads", []):
        if "faster" in row:
            add(f"two threads, {row['work']}, {row['method']} (times)", 1.8, row["faster"], at_least=True)
    starts = [row for row in found.get("start", []) if "start" in row]
    add("start to finished task B, wall (s)", 1.0, min((row["start"] for row in starts), default=None))
    later = [row["first"] - row["second"] for row in starts]
    add("task B, first call less second call, wall (s)", 0.3, max(later, default=None))
    eight = {r.tool: r.cpu for r in rows if r.task == "B"}
    ratio = eight.get("femimpact, Newmark", math.nan) / eight.get("C by hand, 8 cases side by side", math.nan)
    add("task B, Newmark against eight cases in C (times)", 1.8, ratio)
    add("femimpact --help, wall (s)", 0.2, found.get("help"))
    add("memory of the sweep (MB)", 250, found.get("memory", {}).get("task B"))
    return out
