"""Progress of a long computation: passed to a function, or drawn as a bar."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any, ParamSpec, TypeVar

from femimpact.errors import kind_of, require

P = ParamSpec("P")
R = TypeVar("R")
Progress = Callable[[float], None]
"""Called with the share done, 0 to 1."""


def check_progress(progress: Progress | bool | None) -> Progress | None:
    """The function called with the share done, or None; `InputError` for what cannot be called."""
    usable = progress is None or (callable(progress) and not isinstance(progress, type))
    require(usable, "progress", kind_of(progress), "", "must be True, or callable with the share done")
    return progress if callable(progress) else None


def draws_progress(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator of a function with `progress`: True draws a bar on stderr, or in the notebook, while it works."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args: P.args, **named: P.kwargs) -> R:
        try:
            bound = signature.bind(*args, **named)
        except TypeError:
            # the error that Python raises names the function
            return function(*args, **named)
        progress = bound.arguments.get("progress")
        if isinstance(progress, bool):
            bound.arguments["progress"] = None
        if progress is not True:
            return function(*bound.args, **bound.kwargs)
        with _bar(function.__name__.replace("_", " ")) as report:
            bound.arguments["progress"] = report
            return function(*bound.args, **bound.kwargs)

    return call


@contextmanager
def _bar(what: str) -> Iterator[Progress]:
    """Context with a function that draws the share done as a bar."""
    drawn = bars()
    task = drawn.add_task(what, total=1.0)
    with drawn:
        # what a study tells of itself has the share done as its number, and words
        yield lambda done: drawn.update(
            task, completed=float(done), description=what if isinstance(done, (int, float)) else f"{what}: {done}"
        )
        if drawn.console.is_jupyter:
            # the end of a bar would be a second, empty output of the notebook's cell
            drawn.refresh()
            drawn.console.quiet = True


def bars() -> Any:
    """Bars with the time that has passed and that remains, `rich.progress.Progress`, on stderr or in a notebook."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    # a notebook without widgets shows one line of text, which rich would fill with warnings instead
    in_notebook = None if find_spec("ipywidgets") else False
    return Progress(*columns, console=Console(stderr=True, force_jupyter=in_notebook))
