"""Figures and movie of results, drawn from their files; what fails there costs no result."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from femimpact.app.report.markup import Element
from femimpact.app.report.result_page import records_of
from femimpact.app.report.views import pictures_of, reason_of, save_pictures
from femimpact.app.results.picture_data import ResultReading, read_results
from femimpact.app.results.result_directory import FILES, added_results, new_file, result_files
from femimpact.app.results.results import read_summary, write_summary
from femimpact.app.study.findings import Findings, read_findings
from femimpact.app.study.study import Study
from femimpact.errors import Fault, InputError, require

KINDS = ("figures", "movie")
"""Kinds of pictures in the order in which they are drawn: the one that fails most often comes last."""

Report = Callable[[str, float], None]
"""Called with what is being done and the share of it that is done."""


def draw_kinds(
    folder: Path,  # of results, where the pictures go
    kinds: Sequence[str],  # of `KINDS`
    report: Report,  # called with "pictures" and the share that is done
    study: Study | None = None,  # of the results; that of their file by default
) -> tuple[dict[str, str | None], dict[str, Element]]:
    """Draw; for each kind why it failed, or None, and the figures as elements of a page by their names."""
    failures, elements = dict[str, str | None](), dict[str, Element]()
    for kind in kinds:
        report("pictures", len(failures) / len(kinds))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                results = read_results(folder, study)
                if kind == "figures":
                    elements, failures[kind] = _draw_figures(results)
                else:
                    _draw_movie(results)
                    failures[kind] = None
        # what a library for pictures raises is without limit, and no result depends on it
        except Exception as error:
            failures[kind] = reason_of(error)
    report("pictures", 1.0)
    return failures, elements


def _draw_figures(results: ResultReading) -> tuple[dict[str, Element], str | None]:
    records, _ = records_of(results)
    allowed = "; ".join(("the results hold no data for any", *results.failures))
    require(bool(pictures_of(records)), "figures", None, "", allowed)
    elements, failures = save_pictures(records, results.folder)
    return elements, "; ".join((*failures, *results.failures)) or None


def _draw_movie(results: ResultReading) -> None:
    film, study, folder = results.film, results.study, results.folder
    if film is None or study is None:
        allowed = "the results hold no whole deflections: simulate with [output] frames > 0"
        raise InputError([Fault("movie", None, "", "; ".join((allowed, *results.failures)))])
    from femimpact.figures import movie

    path, exaggeration = new_file(folder, "movie"), study.output.exaggeration
    drawn = movie.write_movie(path, film, study.structure, exaggeration=exaggeration)
    # of two movies, with an encoder and without, the later one stays
    for key in ("movie", "movie_without_encoder"):
        if FILES[key].name != drawn.name:
            (folder / FILES[key].name).unlink(missing_ok=True)


def with_pictures(findings: Findings, failures: Mapping[str, str | None], directory: str | Path) -> Findings:
    """The findings with what became of their pictures, and a warning for each kind that was not drawn."""
    texts, pictures = findings.warnings, dict(findings.pictures)
    for kind, failure in failures.items():
        texts = tuple(text for text in texts if not text.startswith(f"{kind} not drawn: "))
        pictures[kind] = "drawn" if failure is None else f"not drawn: {failure}"
        if failure is not None:
            texts += (f"{kind} {pictures[kind]}; 'femimpact {kind} {directory}' draws again",)
    return replace(findings, pictures=pictures, warnings=texts)


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
        findings = read_findings(read_summary(folder))
        before = {name: (folder / name).stat().st_mtime_ns for name in result_files(folder)}
        failure = draw_kinds(folder, (kind,), report)[0][kind]
        drawn = tuple(name for name in result_files(folder) if (folder / name).stat().st_mtime_ns != before.get(name))
        refused = InputError([Fault(kind, str(folder), "", f"not drawn: {failure}")])
        if not drawn:
            raise refused
        sums = {name: one for name, one in findings.checksums.items() if name not in drawn}
        write_summary(folder, with_pictures(replace(findings, checksums=sums), {kind: failure}, folder))
    if failure is not None:
        raise refused
    return drawn
