"""The command line: every command is a few lines around one verb, loaded when it is called."""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from femimpact import __version__
from femimpact.errors import CoreError, FemimpactError, InputError, require
from femimpact.units import number_text

if TYPE_CHECKING:
    from rich.console import Console

    from femimpact.app.parametric.verb import StudyProgress
    from femimpact.app.results.results import StudyResults
    from femimpact.app.tasks.run import Report

BESIDE = 3
"""Characters between two columns."""

EDGES = 2
"""Characters beside the first and the last one."""

LEAST_WORDS = 18
"""Characters to which a column of words may be wrapped."""

PIPE = 180
"""Width of an output that is not a terminal: wide enough that few tables are divided."""


def console() -> Console:
    """Console on which a command prints."""
    from rich.console import Console

    # brackets in texts are tables of a study file
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else PIPE)


def print_table(
    where: Console,
    header: Iterable[Any],
    rows: Iterable[Sequence[Any]],  # numbers, texts, or None
    title: str,
) -> None:
    """Print a table; where it is too wide it goes on below with its next columns beside the first one.

    Columns of several rows that say the same in each are one line under the title.
    """
    names = [str(name).replace("_", " ") for name in header]
    columns = [list(map(_cell, column)) for column in zip(*rows, strict=True)]
    same = [i for i, column in enumerate(columns) if len(column) > 1 and len(set(column)) == 1]
    varied = [i for i in range(len(columns)) if i not in same]
    where.print(title, style="italic")
    if same and varied:
        where.print(", ".join(f"{names[i]} {columns[i][0]}".replace("\n", " ") for i in same))
    shown = varied or same
    for group in _groups([_least_width(names[i], columns[i]) for i in shown], where.width):
        chosen = [shown[k] for k in group]
        _print_columns(where, [names[i] for i in chosen], [columns[i] for i in chosen])


def _print_columns(where: Console, names: list[str], columns: list[list[str]]) -> None:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for i, (name, column) in enumerate(zip(names, columns, strict=True)):
        numbers = _are_numbers(column)
        wrapped = name.replace(" ", "\n") if numbers else name
        table.add_column(wrapped, justify="right" if numbers and i > 0 else "left", no_wrap=numbers)
    for row in zip(*columns, strict=True):
        table.add_row(*row)
    where.print(table)


def _groups(widths: list[int], width: int) -> list[list[int]]:
    """Numbers of the columns that fit side by side; every group begins with the first column."""
    groups, used = [[0]], EDGES + widths[0]
    for i in range(1, len(widths)):
        if used + BESIDE + widths[i] > width and len(groups[-1]) > 1:
            groups.append([0])
            used = EDGES + widths[0]
        groups[-1].append(i)
        used += BESIDE + widths[i]
    return groups


def _least_width(name: str, column: list[str]) -> int:
    """Characters that a column cannot do without: of a number all, of words the longest one."""
    longest = max((len(word) for word in name.split()), default=0)
    if _are_numbers(column):
        return max([longest, *map(len, column)])
    words = [word for text in column for word in text.split()]
    return max([longest, *map(len, words), min(LEAST_WORDS, max(map(len, column), default=0))])


def _are_numbers(column: list[str]) -> bool:
    return all(cell == "-" or _is_number(cell) for cell in column)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else number_text(value, 5)


LEAST_MEMORY = 1e9
"""Address space in bytes in which every command was run."""

UNTIL_BAR = 2.0
"""Seconds after which a bar shows that a study is still read."""

app = App(
    name="femimpact",
    help="Vibro-impact dynamics of beams, and the design of impact dampers on them.",
    version_flags=[],
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)

app.register_install_completion_command(
    help="Install shell completion of femimpact: adds two lines to ~/.bashrc (bash), ~/.zshrc (zsh without oh-my-zsh) "
    "or the profile of PowerShell; for fish no file is edited. The script that the shell reads is a new file, whose "
    "path is printed."
)

Output = Annotated[Path | None, Parameter(name=["-o", "--output"], help="Directory of the results.")]
Force = Annotated[bool, Parameter(negative="", help="Replace results of the same names.")]
Quiet = Annotated[
    bool,
    Parameter(
        name=["-q", "--quiet"], negative="", help="No progress, no tables: warnings and errors alone, on stderr."
    ),
]


def main() -> None:
    """Run the command line; input errors are lines on stderr and exit status 2, never a traceback."""
    # a request to end is an interrupt: nothing half-written stays behind. What the parent has ignored
    # (a job in the background) stays ignored, as with SIGINT, of which Python takes care
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_IGN:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    warnings.showwarning = _show_warning  # type: ignore[assignment]
    _check_memory_limit()
    try:
        app(sys.argv[1:], exit_on_error=False, print_error=False)
    except CycloptsError as error:
        _fail(str(error).strip() + "\nsee: femimpact --help", 2)
    except (InputError, CoreError) as error:
        _fail(_with_notes(str(error), error), 2)
    except FemimpactError as error:
        _fail(_with_notes(str(error), error), 1)
    except MemoryError as error:
        _fail(_with_notes(f"not enough memory{': ' if str(error) else ''}{error}", error), 2)
    except OSError as error:
        _fail(_with_notes(f"{error.filename or 'file system'}: {error.strerror or error}", error), 2)
    except ImportError as error:
        # of a library that does not fit into a limited memory, or is incomplete
        _fail(_with_notes(f"a library cannot be loaded: {error}", error), 2)
    except KeyboardInterrupt as error:
        _fail(_with_notes("interrupted", error), 130)


def _check_memory_limit() -> None:
    """Refuse to begin in a memory in which a library would end the process without a word."""
    try:
        import resource
    except ImportError:  # no such limits outside POSIX
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    begins_work = not {"--help", "-h", "--version"} & set(sys.argv) and len(sys.argv) > 1
    if limit != resource.RLIM_INFINITY and limit < LEAST_MEMORY and begins_work:
        needed = f"the libraries take up to {LEAST_MEMORY / 1e6:.0f} MB"
        _fail(f"memory limit (ulimit -v) = {limit / 1e6:.0f} MB: {needed}; raise it", 2)


def _with_notes(text: str, error: BaseException) -> str:
    """The text, and behind it the error's notes on what was written, all on one line."""
    return "; ".join([text, *getattr(error, "__notes__", [])])


def _show_warning(message: Warning | str, *_about: Any) -> None:
    """A warning is a line on stderr, without the place in the code."""
    print(f"femimpact: warning: {message}", file=sys.stderr)


def _show_warnings(results: StudyResults) -> None:
    """The warnings of results, where nothing else of them is printed."""
    found = results.summary.get("warnings", [])
    for text in found:
        _show_warning(text)
    if found:
        print(f"femimpact: {_warnings_page()}", file=sys.stderr)


def _warnings_page() -> str:
    """Words on where warnings are explained."""
    from femimpact.app.report.page import WARNINGS_PAGE

    return f"what warnings mean and what to do: {WARNINGS_PAGE}"


def _fail(message: str, status: int) -> None:
    for line in message.splitlines():
        print(f"femimpact: {line}", file=sys.stderr)
    sys.exit(status)


# ---- commands -------------------------------------------------------------------------------------


@app.command(name="--version")
def version() -> None:
    """Print the version of femimpact, and what its compiled core was made of."""
    from femimpact.core.binary import build_words

    print(f"{__version__}\n{build_words()}")


@app.command
def demo(*, output: Output = None, force: Force = False, quiet: Quiet = False) -> None:
    """Run the paper's case from end to end, with the published figures beside ours.

    Example: femimpact demo -o my-demo
    """
    from femimpact.app.demo import free_directory, run_demo

    directory = output or free_directory("femimpact-demo")
    with _progress(quiet) as report:
        found = run_demo(directory, force=force, report=report)
    if quiet:
        _show_warnings(found.results)
        return
    where = console()
    header = (
        "quantity",
        "unit",
        "paper theory",
        "paper experiment",
        "rest relative to base",
        "rest in inertial frame",
        "method",
    )
    print_table(where, header, found.comparison, "The paper beside femimpact")
    columns = (
        "restitution",
        "peak (Hz), relative to base",
        "amplitude ratio",
        "peak (Hz), inertial frame",
        "amplitude ratio",
    )
    print_table(where, columns, found.scan_rows, "Restitution scan")
    for text in found.remarks:
        where.print(f"- {text}")
    _print_closing(where, found.results)


@app.command
def init(file: Path, *, force: Force = False) -> None:
    """Write a commented study file.

    Example: femimpact init study.toml
    """
    from femimpact.app.demo import paper_study_text
    from femimpact.files import atomic_write

    require(force or not file.exists(), "file", str(file), "", "exists already: choose another name, or --force")
    require(file.resolve().parent.is_dir(), "file", str(file), "", "must be in an existing directory")
    atomic_write(file, paper_study_text())
    print(f"wrote {file}; next: femimpact check {file}")


@app.command
def schema(
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="File of the schema.")] = None,
    force: Force = False,
) -> None:
    """Print the JSON schema of the study file, with which an editor completes and checks one.

    Example: femimpact schema -o study.schema.json
    """
    import json

    from femimpact.app.study.study_file import study_schema
    from femimpact.files import atomic_write

    text = json.dumps(study_schema(), indent=2)
    if output is None:
        print(text)
        return
    _require_new_file(output, force)
    atomic_write(output, text + "\n")
    print(f"wrote {output}; in the first line of a study: #:schema ./{output.name}")


@app.command
def check(study: Path, *, strict: bool = False) -> None:
    """Validate a study and print what would run and what it can show: dofs, steps, memory, time; numbers by limits.

    Example: femimpact check study.toml

    Parameters
    ----------
    strict
        End with status 2 where a limit is passed beyond which the test does not show what it is made for, or a warning
        is printed.
    """
    from femimpact.app.planned_test import lines_of_check
    from femimpact.app.study.study_file import load_study, unit_lines

    with _waiting("check", quiet=False):
        plan = load_study(study)
        lines, found = lines_of_check(plan)
        lines = [*unit_lines(plan), *lines]
    if plan.plan is not None:
        from femimpact.app.tasks.study_command import plan_lines as study_lines

        lines += study_lines(plan)
    if plan.orbits is not None:
        from femimpact.app.tasks.branches import orbit_lines

        lines += orbit_lines(plan)
    for line in lines:
        print(line)
    warned = [line for line in lines if line.startswith("warning: ")]
    if found.passed or warned:
        print(_warnings_page())
    passed = [row.what for row in found.passed] + warned
    if strict and passed:
        _fail(f"check --strict: limits passed: {'; '.join(passed)}", 2)


@app.command
def modes(study: Path, *, output: Output = None, force: Force = False, quiet: Quiet = False) -> None:
    """Natural frequencies, damping and effective masses, without the ball and with it glued on.

    Example: femimpact modes study.toml
    """
    _run(study, output, force, quiet, ("modes",), "modes")


@app.command
def simulate(
    study: Path, *, frequency: float | None = None, output: Output = None, force: Force = False, quiet: Quiet = False
) -> None:
    """One history: the study's base motion, or another frequency (Hz).

    Example: femimpact simulate study.toml --frequency 5.2 -o at-5.2
    """
    _run(study, output, force, quiet, ("simulate",), "simulate", frequency)


@app.command
def sweep(study: Path, *, output: Output = None, force: Force = False, quiet: Quiet = False) -> None:
    """Response curves over the study's frequencies, without and with the ball.

    Example: femimpact sweep study.toml -o curves
    """
    _run(study, output, force, quiet, ("sweep",), "sweep")


@app.command
def run(study: Path, *, output: Output = None, force: Force = False, quiet: Quiet = False) -> None:
    """All parts of the study: modes, history and sweep.

    Example: femimpact run study.toml -o results
    """
    _run(study, output, force, quiet, ("modes", "simulate", "sweep"), "results")


@app.command
def converge(
    study: Path, *, accuracy: float = 1e-3, output: Output = None, force: Force = False, quiet: Quiet = False
) -> None:
    """Errors over the mesh, the step and the modes, and what a relative accuracy takes.

    Example: femimpact converge study.toml --accuracy 1e-4
    """
    from femimpact.app.study.study_file import load_study
    from femimpact.app.tasks.convergence import convergence_lines, write_convergence

    plan = load_study(study)
    with _progress(quiet) as report:
        found = write_convergence(plan, output or _directory(study, "converge"), force, report, accuracy)
    if quiet:
        return
    for line in convergence_lines(found):
        print(line)
    _print_report(console(), found.directory)
    print(f"results in {found.directory}")


@app.command
def orbits(study: Path, *, output: Output = None, force: Force = False, quiet: Quiet = False) -> None:
    """Periodic orbits of [orbits], stable and unstable: their branches over a number, with bifurcations and a figure.

    Example: femimpact orbits study.toml -o branches
    """
    from femimpact.app.study.study_file import load_study
    from femimpact.app.tasks.branches import write_orbits

    plan = load_study(study)
    with _progress(quiet) as report:
        results = write_orbits(plan, output or _directory(study, "orbits"), force, report)
    if quiet:
        _show_warnings(results)
        return
    where = console()
    _print_branches(where, results)
    _print_closing(where, results)


@app.command(name="study")
def parameter_study(
    study: Path, *, scheduler: str | None = None, output: Output = None, quiet: Quiet = False
) -> None:  # fmt: skip
    """The parameter study of [study]: all cases of its axes; the same call goes on where an earlier one ended.

    Example: femimpact study study.toml -o gap-study

    Parameters
    ----------
    scheduler
        Address or scheduler file of a Dask cluster on which the cases run.
    """
    from femimpact.app.study.study_file import load_study
    from femimpact.app.tasks.study_command import summary_lines, write_parameter_study

    plan, directory = load_study(study), output or _directory(study, "study")
    with _study_progress(quiet) as report:
        found = write_parameter_study(plan, directory, report, scheduler)
    if quiet:
        return
    *lines, where = summary_lines(found, directory, plan.plan.best if plan.plan else None)
    for line in lines:
        print(line)
    _print_report(console(), directory)
    print(where)


@app.command
def report(
    directory: Path,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="File of the report.")] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write the report of results: one HTML file that opens in any browser.

    Example: femimpact report study-results
    """
    from femimpact.app.report.result_page import write_report

    if output is not None:
        _require_new_file(output, force)
    path = write_report(directory, output)
    if not quiet:
        print(f"wrote {path}")


@app.command
def figures(directory: Path, *, quiet: Quiet = False) -> None:
    """Draw the figures of results again, from their files.

    Example: femimpact figures study-results
    """
    _draw_again(directory, "figures", quiet)


@app.command
def movie(directory: Path, *, quiet: Quiet = False) -> None:
    """Draw the movie of results again, from their files.

    Example: femimpact movie study-results
    """
    _draw_again(directory, "movie", quiet)


@app.command
def identify(
    file: Path, *, column: str | None = None, sample_rate: float | None = None, units: str | None = None,
    modes: int = 1, output: Output = None, force: Force = False, quiet: Quiet = False,
) -> None:  # fmt: skip
    """Damping of a free decay that a file of columns or a UFF file holds: by damped sines, and over the amplitude.

    Example: femimpact identify ring-down.csv --column tip --units s,mm

    Parameters
    ----------
    column
        Name of the signal, where the file has several.
    sample_rate
        Samples in a second (Hz) of a file without a column of time.
    units
        Of the time and the signal, in place of those in the file: s,mm.
    modes
        Damped sines that are fitted, 1 to 3.
    """
    from femimpact.app.results.results import write_decay
    from femimpact.excitation.record_files import one_signal
    from femimpact.signals.decay import identify_decay

    record = one_signal(file, column, None if units is None else units.split(","), sample_rate)
    name = str(next(iter(record.data_vars)))
    found = identify_decay(record["time"], record[name], modes=modes)
    directory = output or _directory(file, "identify")
    write_decay(directory, found, record, force)
    for one in found.warnings:
        _show_warning(one)
    if quiet:
        return
    for line in (*record.attrs["notes"], *map(str, found.modes), *found.notes):
        print(line)
    if len(found):
        columns, about = found.columns()
        header = [f"{key.replace('_', ' ')}{f' ({about[key]})' * (about[key] not in ('', '1'))}" for key in columns]
        rows = ([None if v != v else v for v in row] for row in zip(*columns.values(), strict=True))
        title = f"Damping ratio over the amplitude, {found.level:.0%} intervals"
        print_table(console(), header, ([None if v is None else float(v) for v in row] for row in rows), title)
    print(f"results in {directory}")


@app.command
def validate(
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="CSV file of the table.")] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Exact and published cases beside the computed ones; exit status 1 if one misses its bound.

    Example: femimpact validate -o validation.csv
    """
    from femimpact.files import write_csv
    from femimpact.validation import run_validation
    from femimpact.validation.case import HEADER, case_columns, table_row

    if output is not None:
        _require_new_file(output, force)
    with _progress(quiet) as report:
        cases = run_validation(report)
    if output is not None:
        write_csv(output, case_columns(cases), {})
    failed = [case for case in cases if not case.passes]
    if not quiet:
        where = console()
        print_table(where, HEADER, [table_row(case) for case in cases], "Validation")
        where.print(f"{len(cases) - len(failed)} of {len(cases)} pass")
    if failed:
        _fail(
            "\n".join(
                f"{case.name}: error {number_text(case.error, 2)}, bound {number_text(case.bound, 2)}"
                for case in failed
            ),
            1,
        )


# ---- what they share ------------------------------------------------------------------------------


def _require_new_file(output: Path, force: bool) -> None:
    require(force or not output.exists(), "output", str(output), "", "exists already: choose another, or --force")
    require(output.resolve().parent.is_dir(), "output", str(output), "", "must be in an existing directory")


def _directory(study: Path, kind: str) -> Path:
    return Path(f"{study.stem}-{kind}")


def _run(
    path: Path, output: Path | None, force: bool, quiet: bool, parts: tuple[str, ...], kind: str,
    frequency: float | None = None,
) -> None:  # fmt: skip
    from femimpact.app.study.study import sine_of
    from femimpact.app.study.study_file import load_study
    from femimpact.app.tasks.run import run_study

    with _waiting("read", quiet):
        study = load_study(path)
    if frequency is not None:
        study = replace(study, base=replace(sine_of(study, "frequency", frequency, "Hz"), frequency=frequency))
    if parts == ("sweep",):
        sine_of(study, "sweep")
        require(study.sweep is not None, "sweep", None, "", "table [sweep] is missing from the study")
    with _progress(quiet) as report:
        results = run_study(study, output or _directory(path, kind), parts=parts, force=force, report=report)
    if quiet:
        _show_warnings(results)
    else:
        print_results(results)


def _draw_again(directory: Path, kind: str, quiet: bool) -> None:
    from femimpact.app.report.pictures import draw_again

    with _progress(quiet) as report:
        drawn = draw_again(directory, kind, report)
    if not quiet:
        print(f"drawn in {directory}: {', '.join(drawn)}")


def print_results(results: StudyResults) -> None:
    """Print what the page says of results: tables, conclusions, notes, warnings, and where they are."""
    from femimpact.app.report.page import conclusion_lines
    from femimpact.app.report.page_tables import channel_table
    from femimpact.app.report.result_conclusions import conclusions_of
    from femimpact.app.study.findings import read_findings

    where, found = console(), read_findings(results.summary)
    if results.modes is not None:
        columns = list(results.modes)
        print_table(where, columns, zip(*results.modes.values(), strict=True), "Modes (Hz, 1, kg^0.5, kg)")
    channels = channel_table(found)
    if channels is not None:
        print_table(where, channels.header, channels.rows, channels.title)
    for line in conclusion_lines(conclusions_of(found)):
        where.print(line)
    _print_closing(where, results)


def _print_branches(where: Console, results: StudyResults) -> None:
    """Print a line for each branch with its ends, and the table of the bifurcations."""
    from femimpact.app.results.result_directory import FILES
    from femimpact.figures.study_labels import in_shown_units
    from femimpact.files import read_units
    from femimpact.units import PARAMETER_DIGITS, parameter_text

    found = results.summary["orbits"]
    for number, branch in enumerate(found["branches"], 1):
        low, high = (parameter_text(branch[edge], unit) for edge, unit in (("lowest", "1"), ("highest", found["unit"])))
        where.print(
            f"branch {number}, from {branch['origin']}: {low} to {high}, {branch['points']} points, "
            f"{branch['stable_points']} of them stable"
        )
        for side, end in zip(("first", "last"), branch["ends"], strict=True):
            where.print(f"  {side} end: {end}")
    rows = results.bifurcations
    if rows is not None and len(rows["kind"]):
        units = read_units(results.directory / FILES["bifurcations"].name)
        rows, shown = in_shown_units(rows, units)
        rows[found["parameter"]] = [f"{value:.{PARAMETER_DIGITS}g}" for value in rows[found["parameter"]]]
        header = [name + (f" ({shown[name]})" if shown.get(name, "1") != "1" else "") for name in rows]
        title = f"Bifurcations over {found['parameter']}, {found['modes']} modes kept"
        cells = ([None if value == "" else value for value in row] for row in zip(*rows.values(), strict=True))
        print_table(where, header, cells, title)


def _print_closing(where: Console, results: StudyResults) -> None:
    for text in results.summary.get("notes", []):
        where.print(f"note: {text}")
    for text in results.summary.get("warnings", []):
        where.print(f"warning: {text}", style="yellow")
    if results.summary.get("warnings"):
        where.print(_warnings_page())
    _print_report(where, results.directory)
    where.print(f"results in {results.directory}")


def _print_report(where: Console, directory: Path) -> None:
    from femimpact.app.results.result_directory import REPORT

    if (directory / REPORT).is_file():
        where.print(f"to look at: {directory / REPORT}")


@contextmanager
def _study_progress(quiet: bool) -> Iterator[Callable[[StudyProgress], None] | None]:
    """A reporter of a parameter study: one bar with cases, rate, failures and the time that remains."""
    if quiet:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("study", total=1.0)
        yield lambda now: bar.update(task, completed=now.share, description=str(now))


@contextmanager
def _waiting(what: str, quiet: bool) -> Iterator[None]:
    """Draw a bar with the time that has passed beside what takes some seconds, where stderr is a terminal."""
    from threading import Timer

    drawn: list[Any] = []

    def begin() -> None:
        from femimpact.progress import bars as new_bars

        drawn.append(new_bars())
        drawn[0].add_task(what, total=None)
        drawn[0].start()

    timer = Timer(UNTIL_BAR, begin)
    timer.daemon = True
    # elsewhere an error is one line, however long the reading took
    drawing = not quiet and sys.stderr.isatty()
    if drawing:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()
        if drawing:
            # it may be about to draw
            timer.join()
        for bar in drawn:
            bar.stop()


@contextmanager
def _progress(quiet: bool) -> Iterator[Report]:
    """A reporter that draws one bar for each kind of work that has begun, with the time that remains."""
    if quiet:
        yield lambda _what, _share: None
        return
    from femimpact.progress import bars as new_bars

    bars = new_bars()
    tasks: dict[str, Any] = {}

    def report(what: str, share: float) -> None:
        if what not in tasks:
            # bars that stop before the first of them leave an empty line
            bars.start()
            tasks[what] = bars.add_task(what, total=1.0)
        bars.update(tasks[what], completed=share)

    try:
        yield report
    finally:
        if tasks:
            bars.stop()
