"""The binary of the core: loaded once, where it fits this processor and comes of the sources beside it."""

from __future__ import annotations

import functools
import hashlib
import importlib
import shlex
import sys
import sysconfig
from pathlib import Path
from types import ModuleType

from femimpact.errors import CoreError

HERE = Path(__file__).parent


def source_hash(directory: Path = HERE) -> str:
    """SHA-256 of the C++ sources below a directory, their names and contents; "" where there are none."""
    files = {path.relative_to(directory).as_posix(): path for path in directory.rglob("*.[ch]pp")}
    if not files:
        return ""
    found = hashlib.sha256()
    for name in sorted(files):
        contents = files[name].read_bytes()
        found.update(f"{name}\0{len(contents)}\0".encode())
        found.update(contents)
    return found.hexdigest()


def build_words() -> str:
    """Target, compiler and sources of the core in one line; or why it cannot be loaded."""
    try:
        info = loaded().build_info()
    except CoreError as error:
        return str(error)
    kind = "" if info["kind"] == "release" else f", {info['kind']} build"
    return f"compiled core: {info['target']} of {', '.join(info['targets'])}; {info['compiler']}; " + (
        f"sources {info['sources'][:12]}{kind}"
    )


@functools.cache
def loaded() -> ModuleType:
    """The binary, once it is known to fit.

    Raises `CoreError` one line: why it cannot be loaded, and the command that mends it.
    """
    if sysconfig.get_config_var("Py_GIL_DISABLED"):
        raise CoreError("the compiled core is not made for free-threaded Python: use a build of Python with its lock")
    try:
        module = importlib.import_module("femimpact._core")
    except ModuleNotFoundError:
        raise CoreError(f"the compiled core is missing: {_rebuild()}") from None
    except ImportError as error:
        # of the binary itself, or of the loader, which may take several lines
        raise CoreError(f"the compiled core cannot be loaded: {' '.join(str(error).split())}") from None
    # an installed package has no sources beside it
    beside = source_hash()
    if beside and beside != module.build_info()["sources"]:
        raise CoreError(f"the compiled core was not built from the sources in {HERE}: {_rebuild()}")
    return module


def _rebuild() -> str:
    """The command that builds the core, or installs it, in words."""
    given = ["-e", str(HERE.parents[1])] if any(HERE.glob("*.cpp")) else ["--force-reinstall", "--no-deps", "femimpact"]
    return f"run {shlex.join([sys.executable, '-m', 'pip', 'install', *given])}"
