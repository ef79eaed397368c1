"""Figures and movie of results, drawn from their files; what fails there costs no result."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from femimpact.app.results.branch_file import read_followed
from femimpact.app.results.picture_data import read_bands, read_curves, read_film, read_last_cycles, read_mode_shapes
from femimpact.app.results.result_directory import FILES, update_results
from femimpact.app.results.results import carried_of, read_summary, write_summary
from femimpact.contact.laws import Rigid
from femimpact.errors import Fault, InputError, require

KINDS = ("figures", "movie")
"""Kinds of pictures in the order in which they are drawn: the one that fails most often comes last."""

Report = Callable[[str, float], None]


def draw(
    source: Path,  # directory with the files of results
    target: Path,  # where the pictures go
    kind: str,  # {"figures", "movie"}
) -> str | None:
    """Draw one kind of pictures; why one failed, or None."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
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


def draw_kinds(
    source: Path,  # directory with the files of results
    target: Path,  # where the pictures go
    kinds: Sequence[str],  # of `KINDS`
    report: Report,  # called with "pictures" and the share that is done
) -> dict[str, str | None]:
    """Draw; for each kind why it failed, or None."""
    failures: dict[str, str | None] = {}
    for kind in kinds:
        report("pictures", len(failures) / len(kinds))
        failures[kind] = draw(source, target, kind)
    report("pictures", 1.0)
    return failures


def with_pictures(summary: Mapping[str, Any], failures: Mapping[str, str | None], target: Path) -> dict[str, Any]:
    """The summary with what became of its pictures, and a warning for each kind that was not drawn."""
    said = list(summary.get("warnings", []))
    pictures = dict(summary.get("pictures", {}))
    for kind, failure in failures.items():
        said = [text for text in said if not text.startswith(f"{kind} not drawn: ")]
        pictures[kind] = "drawn" if failure is None else f"not drawn: {failure}"
        if failure is not None:
            said.append(f"{kind} {pictures[kind]}; 'femimpact {kind} {target}' draws again")
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
    read_summary(folder)
    with update_results(folder) as staging:
        # again, under the lock
        summary = read_summary(folder)
        failure = draw_kinds(folder, staging.folder, (kind,), report)[kind]
        drawn = tuple(sorted(path.name for path in staging.folder.iterdir() if not path.name.startswith(".")))
        refused = InputError([Fault(kind, str(folder), "", f"not drawn: {failure}")])
        if not drawn:
            raise refused
        updated = with_pictures(summary, {kind: failure}, folder)
        write_summary(staging.folder, updated, beside=folder)
    if failure is not None:
        raise refused
    return drawn
