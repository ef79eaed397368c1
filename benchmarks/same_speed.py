"""Is this commit as fast as another one? Ratios of CPU times, now over before, of interleaved pairs.

    python benchmarks/same_speed.py COMMIT [--pairs 20]

The commit is unpacked and installed into a separate environment. Each pair runs every task once by both versions, in
processes that have run it before; the table has the median ratio of each task with the 90 % interval of the median by
order statistics. The exit status is 1 where an interval lies above 1.05.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from same_bits import ROOT, installed

BOUND = 1.05
"""Ratio above which a task has become slower."""

CHILD = """
import json, sys, time, warnings
import numpy as np
import femimpact as fi
warnings.simplefilter("ignore")

def system(contact, modes):
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", at="tip", mass=3.4e-3, gap=4e-3, contact=contact)
    box = fi.PointMass("box", at="tip", mass=0.023)
    structure = fi.Structure(beam, [box], [ball], fi.Rayleigh(ratio=0.0029, modes=(1, 2)))
    return fi.reduce(fi.assemble(structure, elements=40), modes=modes)

rigid, soft = fi.Rigid(restitution=0.6), fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
base, method, bare = fi.Sine(0.2e-3, 5.0), fi.EventDriven(), fi.Recorder(ledger=False)
frequencies = np.linspace(4.0, 6.0, 101)
systems = {(law.name, modes): system(law, modes) for law in (rigid, soft) for modes in (4, 8)}
R4, R8, K4, K8 = (systems[key] for key in ((rigid.name, 4), (rigid.name, 8), (soft.name, 4), (soft.name, 8)))
TASKS = {
    "rigid, 8 modes, 60 s": lambda: fi.integrate(R8, base, method, 60.0),
    "rigid, 8 modes, 60 s, no energy balance": lambda: fi.integrate(R8, base, method, 60.0, bare),
    "rigid, 4 modes, 60 s, no energy balance": lambda: fi.integrate(R4, base, method, 60.0, bare),
    "Kelvin-Voigt, 8 modes, 60 s": lambda: fi.integrate(K8, base, method, 60.0),
    "Kelvin-Voigt, 4 modes, 60 s, no energy balance": lambda: fi.integrate(K4, base, method, 60.0, bare),
    "rigid, 1 s": lambda: fi.integrate(R8, base, method, 1.0),
    "sweep, rigid, 101 x 50 cycles": lambda: fi.frequency_sweep(R4, 0.2e-3, frequencies, method, cycles=50, threads=1),
    "sweep, Kelvin-Voigt, 101 x 50 cycles": lambda: fi.frequency_sweep(
        K4, 0.2e-3, frequencies, method, cycles=50, threads=1
    ),
}
for task in TASKS.values():
    task()
for line in sys.stdin:
    start = time.process_time()
    TASKS[line.strip()]()
    print(time.process_time() - start, flush=True)
"""

TASKS = (
    "rigid, 8 modes, 60 s", "rigid, 8 modes, 60 s, no energy balance", "rigid, 4 modes, 60 s, no energy balance",
    "Kelvin-Voigt, 8 modes, 60 s", "Kelvin-Voigt, 4 modes, 60 s, no energy balance", "rigid, 1 s",
    "sweep, rigid, 101 x 50 cycles", "sweep, Kelvin-Voigt, 101 x 50 cycles",
)  # fmt: skip


def started(python: Path, source: Path) -> subprocess.Popen[str]:
    """A process of one version that runs tasks by their names and prints their CPU times."""
    environment = os.environ | {"PYTHONPATH": str(source), "OMP_NUM_THREADS": "1"}
    words = [str(python), "-c", CHILD]
    return subprocess.Popen(words, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def seconds(process: subprocess.Popen[str], task: str) -> float:
    """CPU time (s) of a task."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(task + "\n")
    process.stdin.flush()
    return float(process.stdout.readline())


def interval_of_median(values: np.ndarray) -> tuple[float, float]:
    """90 % interval of the median by order statistics."""
    from scipy.stats import binom

    ordered, n = np.sort(values), values.size
    low = max(int(binom.ppf(0.05, n, 0.5)) - 1, 0)
    return float(ordered[low]), float(ordered[n - 1 - low])


def measured(old: tuple[Path, Path], pairs: int) -> dict[str, list[tuple[float, float]]]:
    """CPU times (s) of every task, before and now, pair by pair."""
    before, now = started(*old), started(Path(sys.executable), ROOT)
    found: dict[str, list[tuple[float, float]]] = {task: [] for task in TASKS}
    for pair in range(pairs):
        for task in TASKS:
            # who begins alternates: what the processor does meanwhile is shared
            first, second = (before, now) if pair % 2 else (now, before)
            times = {first: seconds(first, task), second: seconds(second, task)}
            found[task].append((times[before], times[now]))
    for process in (before, now):
        process.terminate()
    return found


def main() -> int:
    """Measure, print, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit")
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        found = measured(installed(given.commit, Path(directory)), given.pairs)
    print("| task | before (ms) | now (ms) | ratio | 90 % interval |\n| --- | --- | --- | --- | --- |")
    slower = []
    for task, times in found.items():
        before, now = np.array(times).T
        ratio, (low, high) = float(np.median(now / before)), interval_of_median(now / before)
        least = f"{1e3 * np.median(before):.4g} | {1e3 * np.median(now):.4g}"
        print(f"| {task} | {least} | {ratio:.3f} | {low:.3f} to {high:.3f} |")
        if low > BOUND:
            slower.append(task)
    if given.json:
        given.json.write_text(json.dumps(found))
    print(f"slower than {BOUND:g} times: {', '.join(slower) or 'none'}")
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
