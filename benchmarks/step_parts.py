"""Where the time of task B goes: the table docs/tables/parts.csv, by samples of `perf` within the core.

    python benchmarks/step_parts.py [--table docs/tables/parts.csv]

Needs perf, addr2line and a compiler. The core is compiled with names and lines into a copy of the package.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from unittest.mock import patch

import report

from femimpact.core import compilation
from femimpact.core.binary import record_of, record_text

HERE = Path(__file__).parent

PARTS = {
    "step_modes": "the modes",
    "step_ball": "the ball, and which cases touch",
    "turn_drive": "the drive, and the sums, sines and extremes of a cycle",
    "acting_drive": "the drive, and the sums, sines and extremes of a cycle",
    "observe": "the drive, and the sums, sines and extremes of a cycle",
    "split_cycles": "the drive, and the sums, sines and extremes of a cycle",
    "close_cycles": "the drive, and the sums, sines and extremes of a cycle",
    "contact_step": "contacts, case by case",
}
"""What a function of the kernel belongs to; all else is the loop itself."""

REST = "the loop itself"

CHILD = """
from contestants import OWN
from problem import load_problem
problem = load_problem()
own = next(own for own in OWN if own.NAME == "femimpact, Newmark")
for _ in range(50):
    own.sweep(problem, problem.task("B"))
"""


def built_with_lines(folder: Path) -> Path:
    """The binary of a copy of the package, of the usual flags and with names and lines."""
    root = HERE.parent
    shutil.copytree(root / "femimpact", folder / "femimpact", ignore=shutil.ignore_patterns("__pycache__", "_core*"))
    link_command = compilation.link_command
    unstripped = lambda *given: [word for word in link_command(*given) if word != "-s"]  # noqa: E731
    with (
        tempfile.TemporaryDirectory() as work,
        patch.dict(os.environ, CXXFLAGS="-g"),
        patch.object(compilation, "link_command", unstripped),
    ):
        compiler = compilation.find_compiler("release")
        made = compilation._compile(root, compiler, "release", "none", work)
        content = made.read_bytes()
    binary = folder / "femimpact" / made.name
    binary.write_bytes(content)
    record_of(binary).write_bytes(record_text(content))
    return binary


def samples(folder: Path, binary: Path) -> Counter[int]:
    """How many samples fell on each address of the binary."""
    data = str(folder / "perf.data")
    paths = os.pathsep.join([str(folder), str(HERE)])
    record = ["perf", "record", "-q", "-e", "cpu-clock", "-F", "4000", "-o", data, sys.executable, "-c", CHILD]
    # elsewhere the package of the working directory would be taken
    subprocess.run(record, check=True, cwd=folder, env=os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"})
    script = ["perf", "script", "-i", data, "--show-mmap-events", "-F", "ip"]
    shown = subprocess.run(script, check=True, capture_output=True, text=True).stdout
    places, found = [], Counter()
    for line in shown.splitlines():
        mapped = re.search(r"\[0x(\w+)\(0x(\w+)\) @ (\w+) .*\]: r-xp (\S+)", line)
        if mapped and mapped[4] == str(binary):
            start, length, offset = int(mapped[1], 16), int(mapped[2], 16), int(mapped[3], 0)
            places.append((start, start + length, offset - start))
        elif address := re.fullmatch(r"\s*([0-9a-f]+)\s*", line):
            ip = int(address[1], 16)
            found.update(ip + shift for start, end, shift in places[-1:] if start <= ip < end)
    return found


def part_of(names: list[str]) -> str:
    """The part of a sample, by the functions inlined at its address from the innermost on."""
    words = [word for name in reversed(names) for word in re.findall(r"\w+", name)]
    return next((PARTS[word] for word in words if word in PARTS), REST)


def shares(binary: Path, found: Counter[int]) -> Counter[str]:
    """Samples of each part."""
    given = "\n".join(f"{address:#x}" for address in found)
    words = ["addr2line", "-a", "-f", "-i", "-C", "-e", str(binary)]
    lines = subprocess.run(words, input=given, check=True, capture_output=True, text=True).stdout.splitlines()
    parts, names, address = Counter(), [], 0
    for line in [*lines, "0x0"]:
        if line.startswith("0x"):
            parts[part_of(names)] += found[address]
            names, address = [], int(line, 16)
        elif not re.search(r":(\d+|\?)( \(discriminator \d+\))?$", line):
            names.append(line)
    return parts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", help="CSV file of the table on the page docs/paper/speed.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        binary = built_with_lines(Path(name))
        found = samples(Path(name), binary)
        parts = shares(binary, found)
    print(f"{found.total()} samples within the core")
    rows = [(part, f"{100 * parts[part] / found.total():.0f} %") for part in dict.fromkeys([*PARTS.values(), REST])]
    print(report.markdown(("part", "share"), rows))
    if options.table:
        report.write_csv(options.table, ("part", "share"), rows)


if __name__ == "__main__":
    main()
