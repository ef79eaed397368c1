"""The command line: every command is a few lines around one verb, loaded when it is called."""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from femimpact import __version__
from femimpact.errors import CoreError, FemimpactError, InputError, require, warnings_left_to_caller
from femimpact.units import number_text

if TYPE_CHECKING:
    from rich.console import Console

    from femimpact.app.parametric.verb import StudyProgress
    from femimpact.app.report.pictures import Report
    from femimpact.app.study.study import Study
    from femimpact.app.tasks.task import Task

BESIDE = 3
"""Characters between two columns."""

EDGES = 2
"""Characters beside the first and the last one."""

LEAST_WORDS = 18
"""Characters to which a column of words may be wrapped."""

PIPE = 180
"""Width of an output that is not a terminal: wide enough that few tables are divided."""

NO_DIGITS: Mapping[int, int] = {}


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
    digits: Mapping[int, int] = NO_DIGITS,  # significant ones, of columns by their numbers from 0
) -> None:
    """Print a table; where it is too wide it goes on below with its next columns beside the first one.

    Columns of several rows that say the same in each are one line under the title.
    """
    # on the page a unit is not divided
    names = [str(name).replace("_", " ").replace("\u00a0", " ") for name in header]
    columns = [[_cell(one, digits.get(i, 5)) for one in column] for i, column in enumerate(zip(*rows, strict=True))]
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


def _cell(value: Any, digits: int) -> str:
    if value is None or value == "" or value != value:
        return "-"
    return value if isinstance(value, str) else number_text(value, digits)


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
Plan = Annotated[bool, Parameter(negative="", help="Print what would be computed and what it takes, and end.")]
Force = Annotated[bool, Parameter(negative="", help="Replace results of the same names.")]
Quiet = Annotated[
    bool,
    Parameter(
        name=["-q", "--quiet"], negative="", help="No progress, no tables: warnings and errors alone, on stderr."
    ),
]

OtherPrograms = Annotated[
    bool, Parameter(negative="", help="The numbers of other programs, in place of the exact and published ones.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class To:
    """Where the results of a command go, and what it prints."""

    output: Output = None
    force: Force = False
    quiet: Quiet = False


@Parameter(name="*")
@dataclass(frozen=True)
class ToFile:
    """The file that a command writes."""

    output: Annotated[Output, Parameter(help="The file.")] = None
    force: Force = False

    def free(self) -> Path | None:
        """The file, where it may be written."""
        file = self.output
        if file is not None:
            allowed = "exists already: choose another, or --force"
            require(self.force or not file.exists(), "output", str(file), "", allowed)
            require(file.resolve().parent.is_dir(), "output", str(file), "", "must be in an existing directory")
        return file


HERE, NO_FILE = To(), ToFile()


def main() -> None:
    """Run the command line; input errors are lines on stderr and exit status 2, never a traceback."""
    # a request to end is an interrupt: nothing half-written stays behind. What the parent has ignored
    # (a job in the background) stays ignored, as with SIGINT, of which Python takes care
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_IGN:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    warnings.showwarning = _show_warning  # type: ignore[assignment]
    _check_memory_limit()
    try:
        with warnings_left_to_caller():
            app(sys.argv[1:], exit_on_error=False, print_error=False)
    except CycloptsError as error:
        folder = "; results go to a folder by --output FOLDER" * str(error).startswith("Unused Tokens")
        command = " ".join(["femimpact", *(error.command_chain or ()), "--help"])
        _fail(f"{str(error).strip()}{folder}\nsee: {command}", 2)
    except (InputError, CoreError) as error:
        _fail(_with_notes(str(error), error), 2)
    except FemimpactError as error:
        _fail(_with_notes(str(error), error), 1)
    except MemoryError as error:
        _fail(_with_notes(": ".join(filter(None, ("not enough memory", str(error)))), error), 2)
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
def demo(*, plan: Plan = False, to: To = HERE) -> None:
    """Run the paper's case from end to end, with the published figures beside ours.

    Example: femimpact demo -o my-demo
    """
    from femimpact.app.demo import free_directory, task_of_demo

    _do(task_of_demo(), free_directory("femimpact-demo"), plan, to)


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
def schema(*, to: ToFile = NO_FILE) -> None:
    """Print the JSON schema of the study file, with which an editor completes and checks one.

    Example: femimpact schema -o study.schema.json
    """
    import json

    from femimpact.app.study.study_file import study_schema
    from femimpact.files import atomic_write

    text, output = json.dumps(study_schema(), indent=2), to.free()
    if output is None:
        print(text)
        return
    atomic_write(output, text + "\n")
    print(f"wrote {output}; in the first line of a study: #:schema ./{output.name}")


@app.command
def check(study: Path, *, every: Annotated[bool, Parameter(name="--all")] = False, strict: bool = False) -> None:
    """Validate a study and print what would run and what it can show: cost, first frequency, limits that are passed.

    Example: femimpact check study.toml

    Parameters
    ----------
    every
        Print every number beside its limit, the notes, and what the study gives, in SI units.
    strict
        End with status 2 where a limit is passed beyond which the test does not show what it is made for, or a warning
        is printed.
    """
    from femimpact.app.planned_test import lines_of_check
    from femimpact.app.study.study_file import load_study

    with _waiting("check", quiet=False):
        lines, passed = lines_of_check(load_study(study), every)
    print(*lines, *([_warnings_page()] if passed else []), sep="\n")
    if strict and passed:
        _fail(f"check --strict: limits passed: {'; '.join(passed)}", 2)


@app.command
def modes(study: Path, *, animate: bool = False, plan: Plan = False, to: To = HERE) -> None:
    """Natural frequencies, damping and effective masses, without the ball and with it glued on.

    Example: femimpact modes study.toml

    Parameters
    ----------
    animate
        Leave each mode over its period for ParaView.
    """
    _run(_study(study, to), "modes", ("modes",), plan, to, animate)


@app.command
def simulate(study: Path, *, frequency: float | None = None, plan: Plan = False, to: To = HERE) -> None:
    """One history: the study's base motion, or another frequency (Hz).

    Example: femimpact simulate study.toml --frequency 5.2 -o at-5.2
    """
    from femimpact.app.study.study import sine_of

    one = _study(study, to)
    if frequency is not None:
        one = replace(one, base=replace(sine_of(one, "frequency", frequency, "Hz"), frequency=frequency))
    _run(one, "simulate", ("simulate",), plan, to)


@app.command
def sweep(study: Path, *, plan: Plan = False, to: To = HERE) -> None:
    """Response curves over the study's frequencies, without and with the ball.

    Example: femimpact sweep study.toml -o curves
    """
    from femimpact.app.study.study import sine_of

    one = _study(study, to)
    sine_of(one, "sweep")
    require(one.sweep is not None, "sweep", None, "", "table [sweep] is missing from the study")
    _run(one, "sweep", ("sweep",), plan, to)


@app.command
def run(study: Path, *, plan: Plan = False, to: To = HERE) -> None:
    """All parts of the study: modes, history and sweep.

    Example: femimpact run study.toml -o results
    """
    _run(_study(study, to), "results", ("modes", "simulate", "sweep"), plan, to)


@app.command
def converge(study: Path, *, accuracy: float = 1e-3, plan: Plan = False, to: To = HERE) -> None:
    """Errors over the mesh, the step and the modes, and what a relative accuracy takes.

    Example: femimpact converge study.toml --accuracy 1e-4
    """
    from femimpact.app.tasks.convergence import task_of_convergence

    _do(task_of_convergence(_study(study, to), accuracy), Path(f"{study.stem}-converge"), plan, to)


@app.command
def orbits(study: Path, *, plan: Plan = False, to: To = HERE) -> None:
    """Periodic orbits of [orbits], stable and unstable: their branches over a number, with bifurcations and a figure.

    Example: femimpact orbits study.toml -o branches
    """
    from femimpact.app.tasks.branches import task_of_orbits

    _do(task_of_orbits(_study(study, to)), Path(f"{study.stem}-orbits"), plan, to)


@app.command(name="study")
def parameter_study(
    study: Path, *, scheduler: str | None = None, plan: Plan = False, output: Output = None, quiet: Quiet = False
) -> None:  # fmt: skip
    """The parameter study of [study]: all cases of its axes; the same call goes on where an earlier one ended.

    Example: femimpact study study.toml -o gap-study

    Parameters
    ----------
    scheduler
        Address or scheduler file of a Dask cluster on which the cases run.
    """
    from femimpact.app.study.study_file import load_study
    from femimpact.app.tasks.study_command import plan_of_cases, write_parameter_study

    if plan:
        print(*plan_of_cases(load_study(study)).lines, sep="\n")
        return
    directory = output or Path(f"{study.stem}-study")
    with _study_progress(quiet) as report:
        write_parameter_study(load_study(study), directory, report, scheduler)
    print_results(directory, quiet)


@app.command
def report(directory: Path, *, short: bool = False, to: ToFile = NO_FILE, quiet: Quiet = False) -> None:
    """Write the report of results: one HTML file that opens in any browser.

    Example: femimpact report study-results

    Parameters
    ----------
    short
        On one sheet of paper, without paths and residuals: `sheet.html` beside the report.
    """
    from femimpact.app.report.result_page import write_report

    path = write_report(directory, to.free(), short)
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
    modes: int = 1, to: To = HERE,
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
    decay = identify_decay(record["time"], record[name], modes=modes)
    directory = to.output or Path(f"{file.stem}-identify")
    write_decay(directory, decay, record, to.force)
    for one in decay.warnings:
        _show_warning(one)
    if to.quiet:
        return
    for line in (*record.attrs["notes"], *map(str, decay.modes), *decay.notes):
        print(line)
    if len(decay):
        columns, about = decay.columns()
        header = [f"{key.replace('_', ' ')}{f' ({about[key]})' * (about[key] not in ('', '1'))}" for key in columns]
        rows = (tuple(map(float, row)) for row in zip(*columns.values(), strict=True))
        print_table(console(), header, rows, f"Damping ratio over the amplitude, {decay.level:.0%} intervals")
    print(f"results in {directory}")


@app.command
def validate(*, other_programs: OtherPrograms = False, to: ToFile = NO_FILE, quiet: Quiet = False) -> None:
    """Exact and published cases beside the computed ones; exit status 1 if one misses its bound.

    Example: femimpact validate -o validation.csv
    """
    from femimpact.files import write_csv
    from femimpact.validation import run_validation
    from femimpact.validation.case import HEADER, case_columns, table_row

    output = to.free()
    with _progress(quiet) as report:
        cases = run_validation(report, with_programs=other_programs)
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


def _study(path: Path, to: To) -> Study:
    from femimpact.app.study.study_file import load_study

    with _waiting("read", to.quiet):
        return load_study(path)


def _run(study: Study, kind: str, parts: tuple[str, ...], plan: bool, to: To, animate: bool = False) -> None:
    from femimpact.app.study.prepared import prepare
    from femimpact.app.tasks.run import task_of_run

    _do(task_of_run(prepare(study, parts), parts, animate), Path(f"{study.path.stem}-{kind}"), plan, to)


def _do(task: Task, usual: Path, plan: bool, to: To) -> None:
    """Print the plan of a task, or do it and print its results."""
    from femimpact.app.tasks.task import run_task

    if plan:
        print(*task.plan().lines, sep="\n")
        return
    directory = to.output or usual
    with _progress(to.quiet) as report:
        run_task(task, directory, to.force, report)
    print_results(directory, to.quiet)


def _draw_again(directory: Path, kind: str, quiet: bool) -> None:
    from femimpact.app.report.pictures import draw_again

    with _progress(quiet) as report:
        drawn = draw_again(directory, kind, report)
    if not quiet:
        print(f"drawn in {directory}: {', '.join(drawn)}")


def print_results(directory: Path, quiet: bool = False) -> None:
    """Print what the page says of results: tables, conclusions, notes, warnings, and where they are."""
    from femimpact.app.report.page import conclusion_lines
    from femimpact.app.report.result_conclusions import answer_of, best_of, result_conclusions, result_warnings
    from femimpact.app.report.result_page import convergence_tables, other_start_words, tables_of
    from femimpact.app.results.picture_data import read_results
    from femimpact.app.results.result_directory import FILES, REPORT

    results = read_results(directory)
    warned = result_warnings(results)
    if quiet:
        for text in warned:
            _show_warning(text)
        if warned:
            print(f"femimpact: {_warnings_page()}", file=sys.stderr)
        return
    where, findings = console(), results.findings
    if findings.answer:
        names = [FILES[key].name for key in ("report", "movie", "movie_without_encoder", "modes_scene")]
        look = ", ".join(name for name in names if (directory / name).exists())
        print(*findings.answer, "", f"Look:    {directory / look}", sep="\n")
        print("Next:    femimpact init mine.toml; femimpact check mine.toml; femimpact run mine.toml")
        return
    for table in tables_of(results):
        print_table(where, table.header, table.rows, table.title, table.digits)
    for line in (
        *(f"{problem}." for problem in findings.problems),
        *map(str, filter(None, convergence_tables(results))),
        *([answer_of(findings, ())] if findings.history_without is not None else []),
        *conclusion_lines(result_conclusions(results, best_of(results))),
        # the report has them
        *(f"note: {text}" for text in findings.notes if not (directory / REPORT).is_file()),
    ):
        where.print(line)
    for text in warned:
        where.print(f"warning: {text}", style="yellow")
    best = f"femimpact run {directory / FILES['best_study'].name}{other_start_words(results)}"
    for line in (
        _warnings_page() if warned else "",
        f"run the best case where it is worst, with its report: {best}" if results.best_design else "",
        f"to look at: {directory / REPORT}" if (directory / REPORT).is_file() else "",
        f"results in {directory}",
    ):
        if line:
            where.print(line)


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
