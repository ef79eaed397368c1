"""The report of results as a file beside them, at the end of a run or at any later time."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

from femimpact.errors import require, require_path
from femimpact.export.report.page import write_page
from femimpact.study.result_directory import ResultsWarning, finished_parts, update_results
from femimpact.study.result_files import REPORT, result_files
from femimpact.study.result_page import page_of

__all__ = ["add_report", "write_report"]


def write_report(directory: str | Path, path: str | Path | None = None) -> Path:
    """Write the report of a directory of results.

    Results of an earlier version, damaged ones and the finished parts of a run that was ended make a report that says
    what is missing.

    Parameters
    ----------
    directory : str or Path
    path : str or Path, optional
        Of the file; `report.html` beside the results without one.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If the directory holds no results, a run writes into it, or the file cannot be there.
    """
    require_path(directory, "directory", "a directory")
    folder = Path(directory)
    require(folder.is_dir(), "directory", str(folder), "", "must be a directory of results")
    parts = finished_parts(folder)
    source = folder if parts is None or set(result_files(folder)) - {REPORT} else parts
    some = bool(set(result_files(source)) - {REPORT})
    require(some, "directory", str(folder), "", "must hold results of a study: none of their files is there")
    page = page_of(source, folder)
    if path is not None:
        return write_page(Path(path), page)
    with update_results(folder) as staging:
        write_page(staging.folder / REPORT, page)
    return folder / REPORT


def add_report(directory: str | Path, report: Callable[[str, float], None]) -> None:
    """Write the report of a run that is done; what keeps it from being written is a warning, and the results stand."""
    report("report", 0.0)
    try:
        write_report(directory)
    # no result hangs on it
    except Exception as error:
        words = " ".join(str(error).split()) or type(error).__name__
        text = f"report not written: {words}; 'femimpact report {directory}' writes it"
        warnings.warn(text, ResultsWarning, stacklevel=3)
    report("report", 1.0)
