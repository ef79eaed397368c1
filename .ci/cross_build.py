"""Compile and link the core for other platforms by zig, with the flags of a build there; nothing of it is run.

    python .ci/cross_build.py DIRECTORY
    python .ci/cross_build.py DIRECTORY x86_64-windows-gnu

Needs `ziglang` of the version that the build asks for. Each binary is left in a folder of its platform.
"""

from __future__ import annotations

import argparse
import platform
import re
import sys
import sysconfig
import tempfile
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from femimpact.core import compilation  # noqa: E402
from femimpact.core.compilation import CompilationError, Compiler, run_compiler  # noqa: E402

PLATFORMS = {
    "x86_64-windows-gnu": ("win32", "AMD64", b"MZ"),
    "x86_64-linux-gnu.2.17": ("linux", "x86_64", b"\x7fELF"),
    "x86_64-linux-musl": ("linux", "x86_64", b"\x7fELF"),
    "aarch64-linux-gnu.2.17": ("linux", "aarch64", b"\x7fELF"),
    "aarch64-linux-musl": ("linux", "aarch64", b"\x7fELF"),
    "aarch64-macos.11.0": ("darwin", "arm64", b"\xcf\xfa\xed\xfe"),
    "x86_64-macos.11.0": ("darwin", "x86_64", b"\xcf\xfa\xed\xfe"),
}
"""By zig's name of a target: `sys.platform` and `platform.machine()` there, and the first bytes of a library."""

DATA = re.compile(r"^FEMIMPACT_PYTHON_DATA \w+ \*?(\w+);", re.MULTILINE)
FUNCTION = re.compile(r"^[\w ]+[ *](Py\w+)\(", re.MULTILINE)
"""What the core takes from Python, as `limited_api.hpp` declares it."""


def import_library(zig: str, folder: Path) -> None:
    """`libs/python3.lib` as an installation of Python on Windows has it, of what the core takes."""
    text = (ROOT / "femimpact" / "core" / "limited_api.hpp").read_text(encoding="utf-8")
    names = [*FUNCTION.findall(text), *(f"{name} DATA" for name in DATA.findall(text))]
    (folder / "libs").mkdir()
    (folder / "python3.def").write_text("\n".join(["LIBRARY python3.dll", "EXPORTS", *names]) + "\n", encoding="utf-8")
    words = [zig, "dlltool", "-m", "i386:x86-64", "-d", "python3.def", "-l", "libs/python3.lib"]
    run_compiler(words, str(folder))


def built(target: str, zig: str, to: Path) -> Path:
    """The linked binary for a platform."""
    system, machine, magic = PLATFORMS[target]
    compiler = Compiler(f"zig {compilation.ZIG}", (zig, "c++", "-target", target), (zig, "cc", "-target", target))
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        # known before this process takes itself for another platform
        sysconfig.get_config_vars()
        if system == "win32":
            import_library(zig, Path(folder))
        stack.enter_context(patch.object(sys, "platform", system))
        stack.enter_context(patch.object(sys, "base_prefix", folder))
        stack.enter_context(patch.object(platform, "machine", lambda: machine))
        with tempfile.TemporaryDirectory() as work:
            made = compilation._compile(ROOT, compiler, "zig", "none", work)
            content = made.read_bytes()
    if not content.startswith(magic):
        raise CompilationError(f"{target}: the linker made something else than a library of that platform")
    to.mkdir(parents=True, exist_ok=True)
    (to / made.name).write_bytes(content)
    return to / made.name


def main() -> None:
    """Build for all platforms, or for some; exit status 1 where one fails."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("target", nargs="*", default=list(PLATFORMS))
    options = parser.parse_args()
    words = compilation._zig().command
    if not words:
        sys.exit(f"needs {compilation.zig_requirement()}")
    failed = []
    for target in options.target:
        try:
            made = built(target, words[0], options.directory / target)
            print(f"{target}: {made.name}, {made.stat().st_size} bytes, not run", flush=True)
        except CompilationError as error:
            print(f"{target}: {error}", flush=True)
            failed.append(target)
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
