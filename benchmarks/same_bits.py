"""Do two commits give the same bits? All arrays of whole runs, sweeps and continued runs, before and now.

    python benchmarks/same_bits.py COMMIT [--runs 1000] [--sweeps 100] [--steps 1000]

The commit is unpacked and installed into a separate environment. Each version runs its own copy of this script, and so
its own random structures (tests/random_structures.py; for methods with steps stepped_cases.py), under names of its own.
Of the jobs of both, every array of their responses is compared by its name: what differs is printed with the largest
difference, relative to the array's largest value. Zeros of both signs count as equal. The exit status is 1 where
anything differs.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]

LEFT_OUT = {"system", "base", "final_state", "kept_state", "largest_values", "versions"}
"""Fields of a response that hold no results."""


def arrays_of(value: object, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Every array below a value, with a path of names."""
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from arrays_of(entry, f"{name}.{key}")
    elif is_dataclass(value):
        for item in fields(value):
            if item.name not in LEFT_OUT:
                yield from arrays_of(getattr(value, item.name), f"{name}.{item.name}")
    elif isinstance(value, float | int):
        yield name, np.array(value)


def event_driven(kind: str, seed: int) -> dict[str, np.ndarray]:
    """Arrays of one event-driven "run", "continued" run or "sweep"."""
    sys.path.insert(0, str(ROOT / "tests"))
    from random_structures import random_case

    import femimpact as fi

    case, method, record = random_case(seed), fi.EventDriven(), fi.Recorder(impacts=100_000)
    if kind == "sweep":
        frequencies = case.system.first_frequency * np.linspace(0.8, 1.2, 11)
        return dict(arrays_of(fi.frequency_sweep(case.system, 1e-3, frequencies, method, cycles=30), "curve"))
    run = fi.integrate(case.system, case.excitation, method, case.duration, record, case.initial)
    found = dict(arrays_of(run, "run"))
    if kind == "continued":
        more = fi.integrate(case.system, case.excitation, method, case.duration, record, run.final_state)
        found |= dict(arrays_of(more, "more"))
    return found


def stepped(kind: str, seed: int) -> dict[str, np.ndarray]:
    """Arrays of one run by a method with steps and its continuation, or of a sweep."""
    from stepped_cases import stepped_case

    import femimpact as fi

    case = stepped_case(seed)
    if kind == "steps-sweep":
        frequencies = case.system.first_frequency * np.linspace(0.8, 1.2, 3 + seed % 9)
        curve = fi.frequency_sweep(case.system, 3e-4, frequencies, case.method, cycles=6, initial=case.initial)
        return dict(arrays_of(curve, "curve"))
    run = fi.integrate(case.system, case.excitation, case.method, case.duration, case.recorder, case.initial)
    found = dict(arrays_of(run, "run"))
    more = fi.integrate(case.system, case.excitation, case.method, 0.3 * case.duration, case.recorder, run.final_state)
    return found | dict(arrays_of(more, "more"))


def results_of(job: str) -> dict[str, np.ndarray]:
    """Arrays of one job: a kind and a seed."""
    import femimpact as fi

    kind, seed = job.split()
    try:
        return (stepped if kind.startswith("steps") else event_driven)(kind, int(seed))
    except (fi.InputError, fi.DivergenceError) as refusal:
        return {f"refused: {type(refusal).__name__}: {' '.join(str(refusal).split())[:60]}": np.zeros(1)}


def digest(values: np.ndarray) -> str:
    """Of type, shape and bits; zeros of both signs are one."""
    plain = values + 0.0 if values.dtype.kind in "fc" else values
    return hashlib.sha256(f"{plain.dtype} {plain.shape} ".encode() + plain.tobytes()).hexdigest()[:24]


def work(jobs: list[str], out: Path, whole: bool) -> None:
    """Run jobs in this process and write digests of their arrays, or the whole arrays, to files."""
    import warnings

    warnings.simplefilter("ignore")
    table = {}
    for job in jobs:
        found = results_of(job)
        if whole:
            np.savez(out / f"{job.replace(' ', '-')}.npz", **found)
        table[job] = {name: digest(values) for name, values in found.items()}
    (out / "digests.json").write_text(json.dumps(table))


def asked(python: Path, source: Path, jobs: list[str], out: Path, whole: bool) -> dict[str, dict[str, str]]:
    """Digests of jobs by one version and its own script, in a separate process."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "jobs.json").write_text(json.dumps(jobs))
    script = source / "benchmarks" / "same_bits.py"
    words = [str(python), str(script), "--work", str(out), *(["--whole"] if whole else [])]
    environment = os.environ | {"PYTHONPATH": str(source), "OMP_NUM_THREADS": "1"}
    subprocess.run(words, env=environment, check=True)
    table: dict[str, dict[str, str]] = json.loads((out / "digests.json").read_text())
    return table


def installed(commit: str, where: Path) -> tuple[Path, Path]:
    """Python of a new environment with a commit, and where its sources are."""
    source = where / "source"
    source.mkdir()
    packed = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", str(source)], input=packed, check=True)
    venv.create(where / "venv", with_pip=True)
    python = where / "venv" / "bin" / "python"
    subprocess.run([str(python), "-m", "pip", "install", "--quiet", "-e", str(source)], check=True)
    return python, source


def differences(job: str, before: Path, now: Path) -> list[str]:
    """Names of the arrays of a job that differ, with the size of the difference."""
    file = f"{job.replace(' ', '-')}.npz"
    with np.load(before / file) as old, np.load(now / file) as new:
        lines = [f"{name}: only on one side" for name in sorted(set(old.files) ^ set(new.files))]
        for name in sorted(set(old.files) & set(new.files)):
            a, b = old[name], new[name]
            if digest(a) == digest(b):
                continue
            if a.shape != b.shape or a.dtype.kind not in "fc":
                lines.append(f"{name}: {a.dtype} {a.shape} and {b.dtype} {b.shape}")
                continue
            size = np.nanmax(np.abs(a), initial=1e-300)
            lines.append(f"{name}: {np.nanmax(np.abs(a - b), initial=0.0) / size:.2g} of its largest value")
    return lines


def main() -> int:
    """Compare, print, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", nargs="?")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--sweeps", type=int, default=100)
    parser.add_argument("--steps", type=int, default=1000, help="runs by methods with steps, and a tenth of sweeps")
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--whole", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work(json.loads((given.work / "jobs.json").read_text()), given.work, given.whole)
        return 0
    continued = range(given.runs // 10)
    jobs = [f"run {seed}" for seed in range(given.runs)]
    jobs += [f"sweep {seed}" for seed in range(given.sweeps)] + [f"continued {seed}" for seed in continued]
    jobs += [f"steps {seed}" for seed in range(given.steps)]
    jobs += [f"steps-sweep {seed}" for seed in range(given.steps // 10)]
    with tempfile.TemporaryDirectory() as directory:
        folder = Path(directory)
        old, now = installed(given.commit, folder), (Path(sys.executable), ROOT)
        tables = [asked(*side, jobs, folder / name, False) for side, name in ((old, "before"), (now, "now"))]
        differing = [job for job in jobs if tables[0][job] != tables[1][job]]
        arrays = sum(len(tables[0][job]) for job in jobs)
        print(f"{len(jobs)} jobs, {arrays} arrays: {len(differing)} jobs differ")
        if differing:
            for side, name in ((old, "before"), (now, "now")):
                asked(*side, differing, folder / name, True)
            for job in differing:
                print(job, *differences(job, folder / "before", folder / "now"), sep="\n    ")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
