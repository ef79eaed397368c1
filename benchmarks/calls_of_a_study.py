"""How far is it from a study to its first run? Calls from file to file, functions and files before `integrate`.

    python benchmarks/calls_of_a_study.py

`run_study(study, DIR, parts=("simulate",))` of the study that `femimpact init` writes is followed by
`sys.setprofile` up to the first call of `integrate`: calls of a function of the package from another of its files,
the functions that were entered, and the files that these stand in. Compile times and imports are not counted.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
from pathlib import Path
from types import FrameType
from typing import Any

import femimpact as fi

PACKAGE = str(Path(fi.__file__).parent)


class ReachedError(Exception):
    """The first call of `integrate`."""


def main() -> dict[str, int]:
    """Print and return the counts."""
    calls, functions, places = 0, set[tuple[str, str]](), set[str]()

    def count(frame: FrameType, event: str, _argument: Any) -> None:
        nonlocal calls
        name, code = frame.f_code.co_filename, frame.f_code
        if event != "call" or not name.startswith(PACKAGE) or code.co_name == "<module>":
            return
        functions.add((name, code.co_qualname))
        places.add(name)
        before = frame.f_back.f_code.co_filename if frame.f_back else ""
        if before.startswith(PACKAGE) and before != name:
            calls += 1
        if code.co_name == "integrate" and name.endswith("runs.py"):
            raise ReachedError

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "study.toml")
        subprocess.run([sys.executable, "-m", "femimpact", "init", str(path)], check=True, capture_output=True)
        study = fi.load_study(path)
        verb = fi.run_study  # its imports are no part of the study
        sys.setprofile(count)
        with contextlib.suppress(ReachedError):
            verb(study, Path(folder, "results"), parts=("simulate",))
        sys.setprofile(None)
    counts = {"calls": calls, "functions": len(functions), "files": len(places)}
    print(", ".join(f"{number} {what}" for what, number in counts.items()))
    return counts


if __name__ == "__main__":
    main()
