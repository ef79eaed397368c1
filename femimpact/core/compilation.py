"""Compiling the core: the one file that comes of the sources below.

The build of the package calls `build` (femimpact/core/build.py); `python -m femimpact.core.compilation` calls it in a
checkout. Standard library only: nothing else is installed when a package is built.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shlex
import sys
import sysconfig
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from femimpact.core.binary import differs, record_of, record_text, source_hash
from femimpact.core.compilers import (
    KINDS,
    ZIG,
    CompilationError,
    Compiler,
    compile_flags,
    find_compiler,
    link_command,
    run_compiler,
    targets_here,
    temporary_directory,
)

__all__ = ["asked_kind", "build", "build_key", "needs_zig", "wheel_tag", "zig_requirement"]

PROCESSES = 2
"""Compilers that run at a time."""


def asked_kind() -> str:
    """The kind of build that the environment asks for: release, checked, sanitized, or zig."""
    kind = os.environ.get("FEMIMPACT_BUILD") or "release"
    if kind not in KINDS:
        raise CompilationError(f"FEMIMPACT_BUILD = {kind!r}: must be one of checked, sanitized, zig, or not set")
    return kind


def wheel_tag() -> str:
    """Tag of a wheel for this machine: one binary serves every Python from 3.11 on."""
    if sys.platform == "darwin":
        return f"cp311-abi3-macosx_11_0_{platform.machine()}"
    return f"cp311-abi3-{re.sub('[^A-Za-z0-9]', '_', sysconfig.get_platform())}"


def _binary_name() -> str:
    return "_core.pyd" if sys.platform == "win32" else "_core.abi3.so"


def build_key(root: Path, compiler: Compiler, kind: str) -> str:
    """SHA-256 of everything that a binary comes from: sources, compiler and flags."""
    # where zig lies changes with every environment in which a package is built
    commands = [] if compiler.is_zig else [compiler.command, compiler.link]
    targets = ("common", *targets_here())
    flags = [compile_flags(compiler, kind, target) for target in targets]
    link = link_command(Compiler(compiler.name, (), ()), kind, targets, _binary_name())
    parts = [source_hash(root / "femimpact" / "core"), compiler.name, commands, flags, link]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def zig_requirement() -> str:
    """What the package index is asked for where there is no compiler."""
    return f"ziglang=={ZIG}"


def needs_zig(root: Path, kind: str) -> bool:
    """Whether a build has to ask the package index for zig."""
    compiler = find_compiler(kind)
    return compiler.is_zig and not compiler.command and not _is_built(root, build_key(root, compiler, kind))


def _is_built(root: Path, key: str) -> bool:
    binary = root / "femimpact" / _binary_name()
    return not differs(binary) and f"femimpact build key {key}".encode() in binary.read_bytes()


def build(root: Path, kind: str, say: Callable[[str], None] = print) -> bool:
    """Compile the core of a checkout into its package, unless the binary there comes of the same.

    Parameters
    ----------
    root : Path
        Directory of pyproject.toml.
    kind : str
        "release", "checked", "sanitized" or "zig".
    say : callable
        Takes a line on what is done.

    Returns
    -------
    bool
        Whether anything was compiled.

    Raises
    ------
    CompilationError
        If there is no compiler, if it fails, or if the binary cannot be written.
    """
    compiler = find_compiler(kind)
    key = build_key(root, compiler, kind)
    if _is_built(root, key):
        say(f"the compiled core is up to date ({compiler.name}, {kind})")
        return False
    if not compiler.command:
        pip = shlex.join([sys.executable, "-m", "pip", "install", zig_requirement()])
        raise CompilationError(
            f"no compiler of C++20 was found (CXX, CC, c++, g++, clang++): install one, or run {pip}, or leave out "
            "--no-build-isolation"
        )
    say(f"compiling the core with {compiler.name} ({kind})")
    with temporary_directory() as directory:
        content = _compile(root, compiler, kind, key, directory).read_bytes()
    binary = root / "femimpact" / _binary_name()
    _write(binary, content)
    _write(record_of(binary), record_text(content))
    return True


def _write(path: Path, content: bytes) -> None:
    """Write a file whole: beside it and renamed, so that a process that has the earlier one open goes on with it."""
    part = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except OSError as error:
        raise CompilationError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        with suppress(OSError):
            part.unlink()


def _compile(root: Path, compiler: Compiler, kind: str, key: str, directory: str) -> Path:
    """The linked binary, in an empty directory."""
    core = root / "femimpact" / "core"
    shown = "release" if kind == "zig" else kind
    about = {"COMPILER": compiler.name, "KIND": shown, "SOURCES": source_hash(core), "KEY": key}
    texts = [f'-DFEMIMPACT_{name}="{text}"' for name, text in about.items()]
    # the longest first
    objects: list[tuple[str, str, list[str]]] = [("kernels", target, []) for target in reversed(targets_here())]
    objects += [("module", "common", texts), ("targets", "common", [])]
    commands = []
    for source, target, more in objects:
        flags = [*compile_flags(compiler, kind, target), *more]
        commands.append([*compiler.command, *flags, "-c", str(core / f"{source}.cpp"), "-o", f"{source}_{target}.o"])
    with ThreadPoolExecutor(PROCESSES) as pool:
        list(pool.map(lambda command: run_compiler(command, directory), commands))
    run_compiler(link_command(compiler, kind, [command[-1] for command in commands], _binary_name()), directory)
    return Path(directory, _binary_name())


def main() -> None:
    """Build the core of this checkout, as FEMIMPACT_BUILD asks."""
    try:
        build(Path(__file__).resolve().parents[2], asked_kind())
    except CompilationError as error:
        sys.exit(f"femimpact: {error}")


if __name__ == "__main__":
    main()
