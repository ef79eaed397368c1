"""The binary of the core: loaded once, where it is complete, fits this processor and comes of the sources beside it.

The build writes its size and SHA-256 into a file beside it. Both are compared before it is loaded, since a library that
is cut short ends the process at the first read beyond its end.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import re
import shlex
import sys
import sysconfig
import threading
from pathlib import Path
from types import ModuleType

from femimpact.errors import CoreError
from femimpact.regular_file import read_regular

HERE = Path(__file__).parent

RECORD = re.compile(rb"([0-9]{1,12}) bytes, SHA-256 ([0-9a-f]{64})\n")
"""All that the file beside the binary holds."""


def source_hash(directory: Path = HERE) -> str:
    """SHA-256 of the C++ sources below a directory, their names and contents; "" where there are none."""
    files = {path.relative_to(directory).as_posix(): path for path in directory.rglob("*.[ch]pp")}
    if not files:
        return ""
    digest = hashlib.sha256()
    for name in sorted(files):
        contents = files[name].read_bytes()
        digest.update(f"{name}\0{len(contents)}\0".encode())
        digest.update(contents)
    return digest.hexdigest()


def record_of(binary: Path) -> Path:
    """The file beside a binary that says its size and SHA-256."""
    return binary.with_name(f"{binary.name}.record")


def record_text(content: bytes) -> bytes:
    """Text of the record of a binary with this content."""
    return f"{len(content)} bytes, SHA-256 {hashlib.sha256(content).hexdigest()}\n".encode()


def differs(binary: Path) -> str:
    """In what a binary is not the file of its record, in words; "" where it is."""
    record = record_of(binary)
    try:
        stated = RECORD.fullmatch(read_regular(record, 100))
        if stated is None:
            return f"has a record of its size and SHA-256 that is damaged ({record})"
        size, actual = int(stated[1]), binary.stat().st_size
        if actual != size:
            return f"has {actual:,} bytes of {size:,} ({binary})"
        if record_text(read_regular(binary, size)) != stated[0]:
            return f"is not the file that was built: its SHA-256 is another ({binary})"
    except FileNotFoundError as error:
        what = "record of its size and SHA-256" if error.filename == str(record) else "file"
        return f"has no {what} ({error.filename})"
    except OSError as error:
        return f"cannot be read ({error.filename or binary}: {error.strerror or error})"
    return ""


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


LOADING = threading.RLock()
"""Held while the binary is loaded: to another thread it would look like a module without a loader."""


@functools.cache
def loaded() -> ModuleType:
    """The binary, once it is known to fit.

    Raises `CoreError` one line: why it cannot be loaded, and the command that mends it.
    """
    with LOADING:
        return _loaded()


def _loaded() -> ModuleType:
    if sysconfig.get_config_var("Py_GIL_DISABLED"):
        raise CoreError("the compiled core is not made for free-threaded Python: use a build of Python with its lock")
    spec = importlib.util.find_spec("femimpact._core")
    if spec is None or spec.origin is None:
        raise CoreError(f"the compiled core is missing: {_rebuild()}")
    fault = differs(Path(spec.origin))
    if fault:
        raise CoreError(f"the compiled core {fault}: {_rebuild()}")
    try:
        module = importlib.import_module("femimpact._core")
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
    args = ["-e", str(HERE.parents[1])] if any(HERE.glob("*.cpp")) else ["--force-reinstall", "--no-deps", "femimpact"]
    return f"run {shlex.join([sys.executable, '-m', 'pip', 'install', *args])}"
