"""Figures and movie of results, drawn from their files by one child process with a time limit.

A missing GL library ends a process, and an encoder can hang: neither may take a run's results with it. The
child reports each kind of picture on its standard output; run as `python -P -c CHILD`, it is `draw` below.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from femimpact.app.report.result_conclusions import ResultReading
from femimpact.app.report.result_page import records_of
from femimpact.app.report.views import pictures_of, reason_of, save_pictures
from femimpact.app.results.picture_data import read_film
from femimpact.app.results.result_directory import FILES, update_results
from femimpact.app.results.results import read_summary, write_summary
from femimpact.child_process import child_process
from femimpact.errors import Fault, InputError, require

KINDS = ("figures", "movie")
"""Kinds of pictures in the order in which they are drawn: the one that fails most often comes last."""

TIME_LIMIT = 600.0
"""Seconds for all pictures of a run; the movie of a usual one takes ten."""

CHILD = (
    "import importlib.util as u, sys\n"
    "s = u.spec_from_file_location('femimpact', sys.argv[1], submodule_search_locations=[sys.argv[2]])\n"
    "m = sys.modules['femimpact'] = u.module_from_spec(s)\n"
    "s.loader.exec_module(m)\n"
    "from femimpact.app.report.pictures import child\n"
    "child(*sys.argv[3:])\n"
)
"""The package of this process, wherever it was found; nothing of the current directory is imported (-P)."""

Report = Callable[[str, float], None]


# ---- in the child ---------------------------------------------------------------------------------


def child(source: str, target: str, *kinds: str) -> None:
    """Draw, and print for each kind a line of JSON: its name, and why it failed."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for kind in kinds:
        print(json.dumps({"kind": kind, "failure": draw(Path(source), Path(target), kind)}), flush=True)


def _end_with_parent() -> None:
    """End this process and those that it started when the parent is gone: its end of the pipe is closed then."""
    sys.stdin.buffer.read()
    if hasattr(os, "killpg"):
        os.killpg(os.getpgrp(), signal.SIGKILL)
    os._exit(1)


def draw(
    source: Path,  # directory with the files of results
    target: Path,  # where the pictures go
    kind: str,  # {"figures", "movie"}
) -> str | None:
    """Draw one kind of pictures; why one failed, or None."""
    try:
        summary = read_summary(source)
        if kind == "movie":
            _draw_movie(source, target, summary)
            return None
        return _draw_figures(source, target, summary)
    # what a library for pictures raises is without limit, and no result depends on it
    except Exception as error:
        return reason_of(error)


def _draw_figures(source: Path, target: Path, summary: Mapping[str, Any]) -> str | None:
    results = ResultReading(source, dict(summary))
    records, _ = records_of(results)
    allowed = "; ".join(("the results hold no data for any", *results.failures))
    require(bool(pictures_of(records)), "figures", None, "", allowed)
    return "; ".join((*save_pictures(records, target), *results.failures)) or None


def _draw_movie(source: Path, target: Path, summary: Mapping[str, Any]) -> None:
    film = read_film(source, summary)
    if film is None:
        allowed = "the results hold no whole deflections: simulate with [output] frames > 0"
        raise InputError([Fault("movie", None, "", allowed)])
    from femimpact.figures import movie

    response, structure, exaggeration = film
    movie.write_movie(target / FILES["movie"].name, response, structure, exaggeration=exaggeration)


# ---- in the parent --------------------------------------------------------------------------------


def draw_in_child(
    source: Path,  # directory with the files of results
    target: Path,  # where the pictures go
    kinds: Sequence[str],  # of `KINDS`
    report: Report,  # called with "pictures" and the share that is done
) -> dict[str, str | None]:
    """Draw in a child process, within `TIME_LIMIT`; for each kind why it failed, or None."""
    found: dict[str, str | None] = {}
    report("pictures", 0.0)

    def listen(lines: IO[bytes]) -> None:
        for line in lines:
            with suppress(ValueError, KeyError, TypeError):
                message = json.loads(line)
                found[message["kind"]] = message["failure"]
                report("pictures", len(found) / len(kinds))

    package = Path(__file__).parents[2]
    where = [str(package / "__init__.py"), str(package), str(source.resolve()), str(target.resolve())]
    with tempfile.TemporaryFile() as errors:
        why = f"not done within {TIME_LIMIT:g} s"
        try:
            with (
                child_process([sys.executable, "-P", "-c", CHILD, *where, *kinds], listen, stderr=errors) as process,
                suppress(subprocess.TimeoutExpired),
            ):
                process.wait(TIME_LIMIT)
                why = ""
        except OSError as error:
            return dict.fromkeys(kinds, f"the process that draws could not be started: {error.strerror or error}")
        errors.seek(0)
        last = (errors.read().decode(errors="replace").strip().splitlines() or [""])[-1]
    for left in target.glob(".*"):
        # of a file that was not finished
        left.unlink()
    why = why or _why(process.returncode, last)
    return {kind: found.get(kind, why) for kind in kinds}


def _why(status: int, last: str) -> str:
    """How a child ended that did not say so itself."""
    if status < 0:
        with suppress(ValueError):
            return f"the process that draws was ended by {signal.Signals(-status).name}"
    return f"the process that draws ended with status {status}{': ' if last else ''}{last[:300]}"


def with_pictures(summary: Mapping[str, Any], failures: Mapping[str, str | None], target: Path) -> dict[str, Any]:
    """The summary with what became of its pictures, and a warning for each kind that was not drawn."""
    warnings = list(summary.get("warnings", []))
    pictures = dict(summary.get("pictures", {}))
    for kind, failure in failures.items():
        warnings = [text for text in warnings if not text.startswith(f"{kind} not drawn: ")]
        pictures[kind] = "drawn" if failure is None else f"not drawn: {failure}"
        if failure is not None:
            warnings.append(f"{kind} {pictures[kind]}; 'femimpact {kind} {target}' draws again")
    return {**summary, "pictures": pictures, "warnings": warnings}


def draw_again(
    directory: str | Path,  # of results
    kind: str,  # {"figures", "movie"}
    report: Report,  # as of `draw_in_child`
) -> tuple[str, ...]:
    """Draw the figures or the movie of results once more, and put them beside the results.

    Returns: names of the files.

    Raises `InputError` if the directory holds no results, or something could not be drawn; figures that could are
    kept.
    """
    folder = Path(directory)
    read_summary(folder)
    with update_results(folder) as staging:
        # again, under the lock
        summary = read_summary(folder)
        failure = draw_in_child(folder, staging.folder, (kind,), report)[kind]
        drawn = tuple(sorted(path.name for path in staging.folder.iterdir() if not path.name.startswith(".")))
        refused = InputError([Fault(kind, str(folder), "", f"not drawn: {failure}")])
        if not drawn:
            raise refused
        updated = with_pictures(summary, {kind: failure}, folder)
        write_summary(staging.folder, updated, beside=folder)
    if failure is not None:
        raise refused
    return drawn
