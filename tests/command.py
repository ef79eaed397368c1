"""The command line in this process, as a separate process would run it; and in one, where that is the subject."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot

from femimpact import cli

__all__ = ["Done", "femimpact", "femimpact_process"]

UNSEEN = (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning)
"""Warnings that Python does not show where nobody asks for them."""


@dataclass(frozen=True)
class Done:
    """What a command left: its exit status and what it printed, the processes that it began included."""

    returncode: int
    stdout: str
    stderr: str


def femimpact_process(*arguments: object, cwd: Path, check: bool = True) -> subprocess.CompletedProcess[str]:
    """The command line in a separate process; it must end well unless told otherwise."""
    done = subprocess.run(
        [sys.executable, "-m", "femimpact", *map(str, arguments)], cwd=cwd, capture_output=True, text=True
    )
    if check:
        assert done.returncode == 0, done.stderr
    return done


def femimpact(*arguments: object, cwd: Path, check: bool = True) -> Done:
    """The command line by its `main`; it must end well unless told otherwise, and leave nothing behind in here."""
    before = _shared()
    printed: list[str] = []
    with _printed(printed), chdir(cwd), _as_begun(["femimpact", *map(str, arguments)]):
        try:
            cli.main()
            status = 0
        except SystemExit as ended:
            status = ended.code or 0
    done = Done(status, *printed)
    left = {name: (before[name], now) for name, now in _shared().items() if now != before[name]}
    assert not left, f"a command leaves these changed: {left}"
    if check:
        assert status == 0, done.stderr
    return done


def _shared() -> dict[str, Any]:
    """What the commands of one process share, but for what `main` sets for its process on purpose."""
    return {
        "environment": dict(os.environ),
        "figures": tuple(pyplot.get_fignums()),
        "rcParams": dict(pyplot.rcParams),
        "SIGINT": signal.getsignal(signal.SIGINT),
        "sys.path": tuple(sys.path),
        "unraisable": sys.unraisablehook,
        "excepthook": sys.excepthook,
        "errors of numpy": np.geterr(),
        "mask of new files": _mask(),
    }


def _mask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@contextmanager
def _as_begun(words: list[str]) -> Iterator[None]:
    """Arguments, warnings and the answer to SIGTERM as a new process has them; afterwards they are as before."""
    own, ended = sys.argv, signal.getsignal(signal.SIGTERM)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    sys.argv = words
    try:
        # what is raised as an error in tests is shown in a process
        with warnings.catch_warnings():
            warnings.resetwarnings()
            for kind in UNSEEN:
                warnings.simplefilter("ignore", kind)
            yield
    finally:
        sys.argv = own
        signal.signal(signal.SIGTERM, ended)


@contextmanager
def _printed(texts: list[str]) -> Iterator[None]:
    """What this process and its children print on either stream is taken from them, and added to texts in the end."""
    streams = sys.stdout, sys.stderr
    for stream in streams:
        stream.flush()
    kept = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile("w+", encoding="utf-8") as out, tempfile.TemporaryFile("w+", encoding="utf-8") as err:
        for number, file in enumerate((out, err), 1):
            os.dup2(file.fileno(), number)
        sys.stdout, sys.stderr = out, err
        try:
            yield
        finally:
            sys.stdout, sys.stderr = streams
            for number, (file, before) in enumerate(zip((out, err), kept, strict=True), 1):
                file.flush()
                os.dup2(before, number)
                os.close(before)
                # the children have written behind what this process knows of
                file.seek(0)
                texts.append(file.read())
