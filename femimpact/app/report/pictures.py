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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from femimpact.app.results.branch_file import read_followed
from femimpact.app.results.picture_data import read_bands, read_curves, read_film, read_last_cycles, read_mode_shapes
from femimpact.app.results.result_directory import FILES, update_results
from femimpact.app.results.results import carried_of, read_summary, write_summary
from femimpact.child_process import child_process
from femimpact.contact.laws import Rigid
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
        failures = [failure for failure in _drawn_figures(source, target, summary) if failure is not None]
        return "; ".join(failures) or None
    # what a library for pictures raises is without limit, and no result depends on it
    except Exception as error:
        return _in_words(error)


def _in_words(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        name = Path(os.fsdecode(error.filename)).name if error.filename else ""
        return f"{name}: {error.strerror}" if name else error.strerror
    return f"{' '.join(str(error).split()) or 'no words'} ({type(error).__name__})"[:400]


def _drawn_figures(source: Path, target: Path, summary: Mapping[str, Any]) -> Iterator[str | None]:
    from femimpact import figures

    plans = list(_figures(source, summary))
    require(bool(plans), "figures", None, "", "the results hold no data for any")
    for name, make in plans:
        try:
            figures.save_figure(make(), target / FILES[name].name)
            yield None
        except Exception as error:
            yield f"{FILES[name].name}: {_in_words(error)}"


def _figures(source: Path, summary: Mapping[str, Any]) -> Iterator[tuple[str, Callable[[], Any]]]:
    """The figures that the results have data for: a key of `FILES`, and what makes it."""
    from femimpact import figures

    off_screen = figures.OffScreen()
    modes = read_mode_shapes(source, summary)
    if modes is not None:
        system, shapes, structure = modes
        yield "mode_figure", lambda: figures.mode_shapes(system, shapes, structure=structure, figure=off_screen)
    swept = read_curves(source, summary)
    if swept is not None:
        curves, coarse = swept
        labels = {"empty": f"without {carried_of(summary)}", "ball": f"with {carried_of(summary)}"}
        named = {label: curves[case] for case, label in labels.items() if case in curves}
        yield (
            "response_figure",
            lambda: figures.response_curve(named, coarse=coarse, bands=read_bands(source, summary), ax=off_screen),
        )
    followed = read_followed(source, summary)
    if followed is not None:
        yield (
            "branch_figure",
            lambda: figures.branch(
                followed.branches, off_screen, title=f"{followed.modes} modes kept", swept=followed.swept
            ),
        )
    last = read_last_cycles(source, summary)
    if last is None:
        return
    run, end = last
    yield "impact_histograms", lambda: figures.impact_histograms(run, off_screen)
    yield "impulse_phase", lambda: figures.impulse_phase(run, off_screen)
    if set(run.impacts.law.values()) - {Rigid.name}:
        # a rigid impact has an impulse and no force to draw
        yield "force_figure", lambda: figures.contact_force(end, averaged=False, figure=off_screen)
    if end.system.balls:
        yield "portrait_figure", lambda: figures.phase_portrait(end, phase=None, ax=off_screen)


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
