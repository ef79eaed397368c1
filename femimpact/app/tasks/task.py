"""A task: what a command computes of a study, part by part, and the one function that leaves its results."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from femimpact.app.report.markup import Element
from femimpact.app.report.pictures import Report, draw_kinds, with_pictures
from femimpact.app.report.result_page import add_report
from femimpact.app.results.result_directory import FILES, new_file, new_results
from femimpact.app.results.results import StudyResults, load, write_summary
from femimpact.app.study.findings import Findings, joined
from femimpact.app.study.study import Study
from femimpact.app.study.study_file import study_text, with_record
from femimpact.files import atomic_write, write_csv, write_netcdf


@dataclass(frozen=True, eq=False)
class Finished:
    """A part of a task that is done: its files, and what the summary says of it.

    A file of `FILES`, by its key, is a labelled dataset, the columns of a table with their units, a text, or a function
    that writes it.
    """

    part: str
    files: Mapping[str, Any] = field(default_factory=dict)
    findings: Findings = field(default_factory=Findings)


@dataclass(frozen=True)
class Plan:
    """What a task would do, in lines."""

    costs: tuple[str, ...]  # what is computed, and the memory and time that it takes
    numbers: tuple[str, ...] = ()  # that are looked at first
    details: tuple[str, ...] = ()  # other numbers, and what the study gives
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def lines(self) -> list[str]:
        """All lines, in the order in which they are printed."""
        said = [f"{kind}: {text}" for kind in ("note", "warning") for text in getattr(self, f"{kind}s")]
        return [*self.numbers, *self.details, *self.costs, *said]


@dataclass(frozen=True, eq=False)
class Task:
    """What is computed of a study."""

    study: Study
    findings: Findings  # what is known before the work
    parts: tuple[str, ...]  # names, in their order
    work: Callable[[Report], Iterator[Finished]]  # each part is on disk before the next one begins
    plan: Callable[[], Plan]


def run_task(task: Task, directory: str | Path, force: bool, report: Report) -> StudyResults:
    """Do the work of a task, write its results, pictures and report into a directory, and read them back.

    What cannot be drawn is a warning of the results.
    """
    output, findings, left, written = task.study.output, task.findings, task.parts, set[str]()
    with new_results(directory, force) as folder:
        write_files(folder, study_files(task.study))
        for finished in task.work(report):
            texts = [f"{finished.part}: {text}" for text in write_files(folder, finished.files)]
            findings = joined(joined(findings, finished.findings), Findings(warnings=tuple(texts)))
            written |= set(finished.files)
            left = tuple(part for part in left if part != finished.part)
            write_summary(folder, _without(findings, left))
        drawn = dict[str, Element]()
        figured = output.figures and bool(written)
        filmed = output.movie and output.frames > 0 and "history" in written
        kinds = [kind for kind, asked in (("figures", figured), ("movie", filmed)) if asked]
        if kinds:
            ended = dict.fromkeys(kinds, "the run was ended before")
            # what they are drawn from stays with the results, should the run end now
            write_summary(folder, with_pictures(findings, ended, directory))
            failures, drawn = draw_kinds(folder, kinds, report, task.study)
            findings = with_pictures(findings, failures, directory)
        write_summary(folder, findings)
    if output.report:
        add_report(directory, report, task.study, drawn)
    return load(directory)


def _without(findings: Findings, left: tuple[str, ...]) -> Findings:
    """What the summary says until the parts that are left are done."""
    if not left:
        return findings
    text = f"the run was ended before its part{'s' if len(left) > 1 else ''} {' and '.join(left)}"
    return joined(findings, Findings(unfinished=left, warnings=(text,)))


def study_files(study: Study) -> dict[str, Any]:
    """The study file, that of the study as it is run, and the record that it names."""
    if study.record is None:
        return {"study": study_text(study)}
    named = with_record(study, FILES["base_record"].name)
    return {
        "base_record": study.source["content"],
        "study": lambda path: atomic_write(path, study_text(replace(named, path=path))),
    }


def write_files(folder: Path, files: Mapping[str, Any]) -> list[str]:
    """Write files by their keys in `FILES`, or by their names; what is left out of one is a text with its name."""
    left_out = dict[str, str]()
    for key, content in files.items():
        path = new_file(folder, key)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            if callable(content):
                content(path)
            elif isinstance(content, str | bytes):
                atomic_write(path, content)
            elif isinstance(content, tuple):
                write_csv(path, *content)
            else:
                write_netcdf(path, content)
        # of two files of one motion the last one says it
        name = path.relative_to(folder).as_posix()
        left_out |= {f"{one.message}": name for one in caught if issubclass(one.category, UserWarning)}
    return [f"{name}: {text}" for text, name in left_out.items()]
