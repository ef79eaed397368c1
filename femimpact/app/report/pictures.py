"""Figures and movie of results, drawn from their files; what fails there costs no result."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from femimpact.app.report.result_conclusions import ResultReading
from femimpact.app.report.result_page import records_of
from femimpact.app.report.views import pictures_of, reason_of, save_pictures
from femimpact.app.results.picture_data import read_film
from femimpact.app.results.result_directory import FILES, added_results, new_file, result_files
from femimpact.app.results.results import CHECKSUMS, read_summary, write_summary
from femimpact.errors import Fault, InputError, require

KINDS = ("figures", "movie")
"""Kinds of pictures in the order in which they are drawn: the one that fails most often comes last."""

Report = Callable[[str, float], None]


def draw(
    folder: Path,  # of results, where the pictures go
    kind: str,  # {"figures", "movie"}
) -> str | None:
    """Draw one kind of pictures; why one failed, or None."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            summary = read_summary(folder)
            if kind == "movie":
                _draw_movie(folder, summary)
                return None
            return _draw_figures(folder, summary)
    # what a library for pictures raises is without limit, and no result depends on it
    except Exception as error:
        return reason_of(error)


def _draw_figures(folder: Path, summary: Mapping[str, Any]) -> str | None:
    results = ResultReading(folder, dict(summary))
    records, _ = records_of(results)
    allowed = "; ".join(("the results hold no data for any", *results.failures))
    require(bool(pictures_of(records)), "figures", None, "", allowed)
    return "; ".join((*save_pictures(records, folder), *results.failures)) or None


def _draw_movie(folder: Path, summary: Mapping[str, Any]) -> None:
    film = read_film(folder, summary)
    if film is None:
        allowed = "the results hold no whole deflections: simulate with [output] frames > 0"
        raise InputError([Fault("movie", None, "", allowed)])
    from femimpact.figures import movie

    response, structure, exaggeration = film
    drawn = movie.write_movie(new_file(folder, "movie"), response, structure, exaggeration=exaggeration)
    # of two movies, with an encoder and without, the later one stays
    for key in ("movie", "movie_without_encoder"):
        if FILES[key].name != drawn.name:
            (folder / FILES[key].name).unlink(missing_ok=True)


def draw_kinds(
    folder: Path,  # of results, where the pictures go
    kinds: Sequence[str],  # of `KINDS`
    report: Report,  # called with "pictures" and the share that is done
) -> dict[str, str | None]:
    """Draw; for each kind why it failed, or None."""
    failures: dict[str, str | None] = {}
    for kind in kinds:
        report("pictures", len(failures) / len(kinds))
        failures[kind] = draw(folder, kind)
    report("pictures", 1.0)
    return failures


def with_pictures(
    summary: Mapping[str, Any], failures: Mapping[str, str | None], directory: str | Path
) -> dict[str, Any]:
    """The summary with what became of its pictures, and a warning for each kind that was not drawn."""
    said = list(summary.get("warnings", []))
    pictures = dict(summary.get("pictures", {}))
    for kind, failure in failures.items():
        said = [text for text in said if not text.startswith(f"{kind} not drawn: ")]
        pictures[kind] = "drawn" if failure is None else f"not drawn: {failure}"
        if failure is not None:
            said.append(f"{kind} {pictures[kind]}; 'femimpact {kind} {directory}' draws again")
    return {**summary, "pictures": pictures, "warnings": said}


def draw_again(
    directory: str | Path,  # of results
    kind: str,  # {"figures", "movie"}
    report: Report,  # as of `draw_kinds`
) -> tuple[str, ...]:
    """Draw the figures or the movie of results once more, and put them beside the results.

    Returns: names of the files.

    Raises `InputError` if the directory holds no results, or something could not be drawn; figures that could are
    kept.
    """
    folder = Path(directory)
    with added_results(folder):
        summary = read_summary(folder)
        before = {name: (folder / name).stat().st_mtime_ns for name in result_files(folder)}
        failure = draw_kinds(folder, (kind,), report)[kind]
        drawn = tuple(name for name in result_files(folder) if (folder / name).stat().st_mtime_ns != before.get(name))
        refused = InputError([Fault(kind, str(folder), "", f"not drawn: {failure}")])
        if not drawn:
            raise refused
        sums = {name: one for name, one in summary.get(CHECKSUMS, {}).items() if name not in drawn}
        write_summary(folder, with_pictures({**summary, CHECKSUMS: sums}, {kind: failure}, folder))
    if failure is not None:
        raise refused
    return drawn
