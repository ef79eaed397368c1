"""The compiled core: C++20 kernels in `femimpact._core`, loaded when the first of its functions is asked for.

`from femimpact import core` costs nothing; `core.exponentials` loads the binary, and refuses one that is missing, that
does not fit this processor, or that is older than the sources beside it. Nothing else imports `femimpact._core`.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import shlex
import sys
import sysconfig
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from femimpact.errors import CoreError

if TYPE_CHECKING:
    from femimpact._core import build_info as build_info
    from femimpact._core import choose_target as choose_target
    from femimpact._core import exponentials as exponentials

# what the binary gives; read by `__getattr__`
__all__ = ["build_info", "choose_target", "exponentials"]

HERE = Path(__file__).parent


def __getattr__(name: str) -> Any:
    """A function of the binary, which is loaded for the first of them."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(_binary(), name)
    return found


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
        info = importlib.import_module(__name__).build_info()
    except CoreError as error:
        return str(error)
    kind = "" if info["kind"] == "release" else f", {info['kind']} build"
    return f"compiled core: {info['target']} of {', '.join(info['targets'])}; {info['compiler']}; " + (
        f"sources {info['sources'][:12]}{kind}"
    )


@functools.cache
def _binary() -> ModuleType:
    """The binary, once it is known to fit.

    Raises
    ------
    CoreError
        One line: why it cannot be loaded, and the command that mends it.
    """
    if sysconfig.get_config_var("Py_GIL_DISABLED"):
        raise CoreError("the compiled core is not made for free-threaded Python: use a build of Python with its lock")
    try:
        binary = importlib.import_module("femimpact._core")
    except ModuleNotFoundError:
        raise CoreError(f"the compiled core is missing: {_rebuild()}") from None
    except ImportError as error:
        # of the binary itself, or of the loader, which may take several lines
        raise CoreError(f"the compiled core cannot be loaded: {' '.join(str(error).split())}") from None
    # an installed package has no sources beside it
    beside = source_hash()
    if beside and beside != binary.build_info()["sources"]:
        raise CoreError(f"the compiled core was not built from the sources in {HERE}: {_rebuild()}")
    return binary


def _rebuild() -> str:
    """The command that builds the core, or installs it, in words."""
    given = ["-e", str(HERE.parents[1])] if any(HERE.glob("*.cpp")) else ["--force-reinstall", "--no-deps", "femimpact"]
    return f"run {shlex.join([sys.executable, '-m', 'pip', 'install', *given])}"
