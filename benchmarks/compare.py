"""Femimpact against everybody: one command, one table of ratios, errors beside times.

    python benchmarks/compare.py [--quick] [--output DIR] [--peers hand_c,scipy_lsoda]

Peers that are not installed are named with the reason. Writes compare.json, compare.md and compare.png. What is
printed was measured in this run; a slow peer's time is that of a piece of the task, scaled up, and says so.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
from pathlib import Path

import report
import scaling
import startup
from contestants import PEERS, versions
from picture import draw
from problem import load_problem
from tasks import as_data, run_points, run_tasks
from timing import machine


def measure(problem, peers, quick, say):
    """Everything that the tables show."""
    repeats = 2 if quick else 5
    rows, skipped = run_tasks(problem, peers, repeats, say)
    points = run_points(problem, peers, repeats, say)
    found = {}
    say("cost of a step")
    found["step_cost"] = scaling.step_cost(problem, repeats, 20_000 if quick else 100_000)
    found["physical"] = scaling.physical(problem, (10, 100) if quick else (10, 100, 1000), repeats)
    say("cost over dofs")
    sizes = (10, 100, 1000) if quick else (10, 30, 100, 300, 1000, 3000, 10_000)
    found["over_dofs"], found["exponent"], found["memory exponent"] = scaling.cost_over_dofs(
        problem, sizes, repeats=min(3, repeats)
    )
    found["all_modes"] = scaling.all_modes(problem, (100,) if quick else (100, 1000), 2, say)
    found["further time"] = scaling.further_time(problem, repeats)
    say("threads, memory, start")
    found["threads"] = scaling.threads(problem, repeats, 100 if quick else 1000)
    found["memory"], found["help"] = scaling.memory(), startup.help_time(repeats)
    if not quick:
        found["start"] = startup.start_times(2)
    return rows, points, found, skipped


def written(problem, rows, points, found, skipped, about):
    """The whole text."""
    parts = ["# femimpact against everybody\n"]
    parts.append(", ".join(f"{name} {value}" for name, value in about["machine"].items()) + "  ")
    parts.append(", ".join(f"{name} {value}" for name, value in about["versions"].items()) + "\n")
    parts.append(
        "CPU and wall time of the whole task on one core, the least of five runs that took turns (three of slow peers, "
        "two of all with --quick). The ratio is to femimpact's fastest method whose tip is at least as exact. "
        "Settings: step (s), LSODA's relative tolerance, samples a cycle read of an event-driven run.\n"
    )
    titles = {
        "A": "Task A: no ball, 21 frequencies, 60 s each; the tip's error over 4 s at 5.2 Hz",
        "B": "Task B: with the ball, 20 s each; the tip's error over the first 0.8 s at 5.2 Hz",
    }
    for task, title in titles.items():
        parts += [f"## {title}\n", report.task_table(rows, task) + "\n"]
    parts += [f"{name}: skipped, {reason}\n" for name, reason in skipped.items()]
    parts.append("## Time over error, the tip over the first 0.8 s\n")
    parts.append(report.error_table(points) + "\n")
    parts.append(report.tables(found))
    parts.append("## What was asked for\n")
    asked = report.goals(rows, points, found)
    parts.append(report.markdown(["what", "asked", "measured", "met"], asked) + "\n")
    return "\n".join(parts)


def _finite(value):
    """Without numbers that JSON does not know."""
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two repeats, small meshes, no starts")
    parser.add_argument("--output", default="benchmark-results", help="directory of the results")
    parser.add_argument("--peers", default=",".join(PEERS), help=f"of {', '.join(PEERS)}")
    options = parser.parse_args()
    peers = [name for name in options.peers.split(",") if name]
    unknown = sorted(set(peers) - set(PEERS))
    if unknown:
        parser.error(f"--peers: {', '.join(unknown)} unknown; choose of {', '.join(PEERS)}")
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)

    problem = load_problem()
    about = {"machine": machine(), "versions": versions()}
    rows, points, found, skipped = measure(problem, peers, options.quick, say)
    say("")
    text = written(problem, rows, points, found, skipped, about)
    print(text)
    (folder / "compare.md").write_text(text)
    report.write_page_tables(folder, rows, points)
    data = _finite({**about, "tasks": as_data(rows), "points": as_data(points), **found, "skipped": skipped})
    (folder / "compare.json").write_text(json.dumps(data, indent=1, default=float))
    where = f"{about['machine']['processor']}, Python {platform.python_version()}, {about['machine']['date']}"
    draw(points, folder / "compare.png", f"Tip of the beam with its ball, 0.8 s at 5.2 Hz ({where})")
    print(f"wrote {folder}/compare.json, compare.md, compare.png")


if __name__ == "__main__":
    main()
