"""The build of the compiled core: compilers and their flags, one object for each target, one module, and its stubs."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from femimpact.core.binary import differs, record_of, record_text, source_hash

ZIG = "0.17.1"
"""Version of `ziglang` that serves where there is no compiler."""

TARGETS = {"x86_64": ("v2", "v3", "v4"), "arm64": ("arm64",)}
"""Targets for which kernels.cpp is compiled, by the kind of machine."""

# nothing here may change a rounding: gcc 12 fuses multiplication and addition in its vectoriser whatever -ffp-contract
# says, and CXXFLAGS, which stand before these, may ask for -ffast-math
COMMON_FLAGS = (
    "-std=c++20", "-fPIC", "-fvisibility=hidden", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-fno-lto",
    "-fno-fast-math", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off", "-fno-tree-vectorize",
    "-fno-tree-slp-vectorize",
)  # fmt: skip

KINDS = ("release", "checked", "sanitized", "zig")
"""Kinds of a build; "zig" is a release by the other compiler."""

KIND_FLAGS = {
    "release": ("-O3", "-DNDEBUG"),
    # a message that is cut at the end of its buffer is meant; an older clang does not know that warning
    "checked": (
        "-O2", "-g", "-UNDEBUG", "-DFEMIMPACT_CHECKED", "-Wall", "-Wextra", "-Werror",
        "-Wno-unknown-warning-option", "-Wno-format-truncation",
    ),
    "sanitized": (
        "-O1", "-g", "-UNDEBUG", "-DFEMIMPACT_CHECKED", "-fno-omit-frame-pointer",
        "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize=vptr", "-fno-sanitize-recover=undefined",
    ),
}  # fmt: skip

C20_TEST = """\
#include <concepts>
#include <cmath>
#include <cstdint>
template <typename T> concept Number = std::floating_point<T>;
struct Pair { double a = 0.0, b = 0.0; };
template <Number T> constexpr T twice(T x) { return x + x; }
static_assert(twice(2.0) == 4.0);
static constexpr Pair ORDER = {.a = 1.0, .b = 2.0};
constinit static std::int64_t calls = 0;
extern "C" double femimpact_test(double x) { return calls++, std::fma(x, ORDER.b, [](auto y) { return twice(y); }(x)); }
"""


class CompilationError(Exception):
    """The core cannot be built: why, in one line, and then what the compiler says."""


@dataclass(frozen=True)
class Compiler:
    """A compiler and its name."""

    name: str  # with the version, such as "gcc 12.2.0"
    command: tuple[str, ...]  # words that compile a C++ file and that link; empty where it is not here yet
    link: tuple[str, ...]

    @property
    def is_zig(self) -> bool:
        """True where its options are those of zig."""
        return self.name.startswith("zig ")


def targets_here() -> tuple[str, ...]:
    """Targets of this machine, the lowest first; refuses a machine or a Python for which there is none."""
    if sysconfig.get_config_var("Py_GIL_DISABLED") or sys.implementation.name != "cpython":
        raise CompilationError("the compiled core is made for CPython with its lock, not for free-threaded Python")
    machine = _machine()
    if machine not in TARGETS or sys.maxsize < 2**32:
        raise CompilationError(f"the compiled core is made for 64 bits of x86-64 and arm64, not for {machine!r}")
    return TARGETS[machine]


def _machine() -> str:
    """The kind of processor, by one name on every platform."""
    machine = platform.machine().lower()
    return {"amd64": "x86_64", "aarch64": "arm64"}.get(machine, machine)


# ---- compilers ------------------------------------------------------------------------------------


def find_compiler(kind: str) -> Compiler:
    """The system's compiler, or zig where there is none that takes C++20 or where the kind is "zig".

    Raises `CompilationError` if the system's compiler takes C++20 and cannot build for another reason: which, and
    what it says.
    """
    if kind != "zig":
        for name in ("CXX", "CC", "c++", "g++", "clang++"):
            compiler = _system_compiler(given_words(name) if name.isupper() else (name,), kind)
            if compiler is not None:
                return compiler
    if kind == "sanitized":
        raise CompilationError("FEMIMPACT_BUILD = 'sanitized': needs gcc or clang, of C++20")
    return _zig()


def given_words(variable: str) -> tuple[str, ...]:
    """Words of a variable of the environment; of a path of Windows the backslashes stay."""
    text = os.environ.get(variable) or ""
    try:
        if sys.platform != "win32":
            return tuple(shlex.split(text))
        return tuple(word.strip('"') for word in shlex.split(text, posix=False))
    except ValueError as error:
        # a quotation mark that is not closed, or a backslash at the end
        raise CompilationError(f"{variable} = {text!r}: cannot be read as words of a shell: {error}") from None


def _system_compiler(command: tuple[str, ...], kind: str) -> Compiler | None:
    """The compiler of a command, if it is there and takes what it is given by us."""
    program = shutil.which(command[0]) if command else None
    # Microsoft's, and clang in its place, have other options
    if program is None or Path(program).stem.lower() in ("cl", "clang-cl"):
        return None
    command = (str(Path(program).absolute()), *command[1:])
    with temporary_directory() as directory:
        source = Path(directory, "test.cpp")
        source.write_text(C20_TEST, encoding="utf-8")
        try:
            macros = run_compiler([*command, "-dM", "-E", str(source)], directory)
        except CompilationError as error:
            if len(command) == 1 or _system_compiler(command[:1], kind) is None:
                return None
            raise CompilationError(f"{shlex.join(command)}: the compiler fails with these words\n{error}") from None
        # some other program may end well whatever it is told
        if "__GNUC__" not in macros:
            return None
        compiler = Compiler(_name_of(macros), command, command)
        ours = compile_flags(compiler, kind, targets_here()[-1], flags=())
        try:
            # nothing is written: what it refuses here is newer than it
            run_compiler([*command, *ours, "-fsyntax-only", str(source)], directory)
        except CompilationError:
            return None
        _check_given(compiler, kind, source)
    return compiler


def _check_given(compiler: Compiler, kind: str, source: Path) -> None:
    """Refuse what keeps a compiler from building that takes our flags: those of the environment, or else the system."""
    target = targets_here()[-1]

    def compiling(words: Sequence[str]) -> list[str]:
        flags = compile_flags(compiler, kind, target, words)
        return [*compiler.command, *flags, "-c", str(source), "-o", "test.o"]

    def linking(words: Sequence[str]) -> list[str]:
        return link_command(compiler, kind, ["test.o"], "test.so", words)

    words_of = {name: given_words(name) for name in ("CXXFLAGS", "LDFLAGS")}
    steps: list[tuple[list[str], list[str]]] = [([], compiling(())), ([], linking(()))]
    if any(words_of.values()):
        # a linker may refuse what was compiled with other flags
        steps += [(["CXXFLAGS"], compiling(words_of["CXXFLAGS"])), ([*words_of], linking(words_of["LDFLAGS"]))]
    directory = str(source.parent)
    for names, command in steps:
        try:
            run_compiler(command, directory)
        except CompilationError as error:
            flags = " and ".join(f"{name} = {os.environ[name]!r}" for name in names if words_of[name])
            cause = f"{flags}: {compiler.name} builds without this, and fails with it"
            if not names:
                other = "CXX=... or FEMIMPACT_BUILD=zig takes another compiler"
                cause = f"{compiler.name} cannot build in {directory}; {other}"
            raise CompilationError(f"{cause}\n{error}") from None


def _name_of(macros: str) -> str:
    """Name and version of a compiler, from the macros that it defines."""
    values = dict(re.findall(r"^#define (\w+) (.*)$", macros, re.MULTILINE))
    # clang passes for an old gcc too
    name, parts = "gcc", ["__GNUC__", "__GNUC_MINOR__", "__GNUC_PATCHLEVEL__"]
    if "__clang__" in values:
        name, parts = "clang", ["__clang_major__", "__clang_minor__", "__clang_patchlevel__"]
    return f"{name} {'.'.join(values.get(part, '?') for part in parts)}"


def _zig() -> Compiler:
    """Zig of the version that is asked for; without commands where it is not installed."""
    name = f"zig {ZIG}"
    package = importlib.util.find_spec("ziglang")
    if package is None or package.origin is None:
        return Compiler(name, (), ())
    program = str(Path(package.origin).with_name("zig.exe" if sys.platform == "win32" else "zig"))
    try:
        version = subprocess.run([program, "version"], capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return Compiler(name, (), ())
    # whatever else is installed there, with the headers and libraries that zig brings
    target = ("-target", f"{_machine().replace('arm64', 'aarch64')}-windows-gnu") if sys.platform == "win32" else ()
    # linked as C: libc++, which nothing here needs, would be compiled from its source
    commands = ((program, "c++", *target), (program, "cc", *target)) if version == ZIG else ((), ())
    return Compiler(name, *commands)


# ---- flags ----------------------------------------------------------------------------------------


def compile_flags(compiler: Compiler, kind: str, target: str, flags: Sequence[str] | None = None) -> list[str]:
    """Flags of one object, after those of CXXFLAGS or others; `common` is what every processor runs."""
    ours = list(COMMON_FLAGS + KIND_FLAGS["release" if kind == "zig" else kind])
    if compiler.is_zig:
        ours.append("-fno-sanitize=undefined")
    if "v2" in targets_here():
        level = {"common": "x86-64"}.get(target, f"x86-64-{target}")
        zig_level = {"common": "baseline"}.get(target, f"x86_64_{target}")
        ours.append(f"-mcpu={zig_level}" if compiler.is_zig else f"-march={level}")
    elif compiler.is_zig:
        ours.append("-mcpu=baseline")
    if sys.platform == "darwin":
        ours.append("-mmacosx-version-min=11.0")
    return [*(given_words("CXXFLAGS") if flags is None else flags), *ours, f"-DFEMIMPACT_TARGET={target}"]


def link_command(
    compiler: Compiler, kind: str, objects: Sequence[str], binary: str, flags: Sequence[str] | None = None
) -> list[str]:
    """Command of a shared library that needs no library of C++, with the words of LDFLAGS or others."""
    flags = given_words("LDFLAGS") if flags is None else flags
    # of the sanitizers' libraries those that the driver adds
    sanitizers = [flag for flag in KIND_FLAGS.get(kind, ()) if flag.startswith("-fsanitize")]
    ours = ["-shared", "-fno-lto", "-fno-fast-math", *sanitizers]
    if sys.platform == "darwin":
        # zig 0.17 crashes where it is asked for a bundle; Python loads either
        library = "-shared" if compiler.is_zig else "-bundle"
        ours[:1] = [library, "-undefined", "dynamic_lookup", "-Wl,-dead_strip_dylibs", "-mmacosx-version-min=11.0"]
    elif sys.platform == "win32":
        # no library that comes with the compiler: none is on a machine without it. With zig it is so
        static = [] if compiler.is_zig else ["-static-libgcc"]
        ours += [*static, f"-L{Path(sys.base_prefix, 'libs')}", "-lpython3"]
    else:
        ours += ["-Wl,--as-needed", *(["-s"] if kind in ("release", "zig") else [])]
    if compiler.is_zig:
        # of the system that runs, but of no processor in particular
        ours.append("-mcpu=baseline")
    return [*compiler.link, *flags, *ours[:1], *objects, "-o", binary, *ours[1:], "-lm"]


@contextmanager
def temporary_directory() -> Iterator[str]:
    """An empty directory, for as long as it is used; what cannot be written in it is one line."""
    where = "TMPDIR"
    try:
        with tempfile.TemporaryDirectory(prefix="femimpact-") as directory:
            where = directory
            yield directory
    except OSError as error:
        raise CompilationError(f"{error.filename or where}: cannot be written: {error.strerror or error}") from None


def run_compiler(command: Sequence[str], directory: str) -> str:
    """Output of a compiler that is run in a directory, without a shell."""
    # what zig keeps from one call to the next goes with the directory, and so do a compiler's temporary files
    places = dict.fromkeys(("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"), str(Path(directory, "zig-cache")))
    places |= dict.fromkeys(("TMPDIR", "TMP", "TEMP"), directory)
    try:
        done = subprocess.run(
            command, cwd=directory, env=os.environ | places, capture_output=True, text=True, errors="replace"
        )
    except OSError as error:
        raise CompilationError(f"{command[0]}: {error.strerror or error}") from None
    if done.returncode != 0:
        raise CompilationError(f"the compiler failed: {shlex.join(command)}\n{done.stdout}{done.stderr}".rstrip())
    return done.stdout


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
    """Packages to be installed for a build where there is no compiler."""
    return f"ziglang=={ZIG}"


def needs_zig(root: Path, kind: str) -> bool:
    """True where a build has to install zig from the package index."""
    compiler = find_compiler(kind)
    return compiler.is_zig and not compiler.command and not _is_built(root, build_key(root, compiler, kind))


def _is_built(root: Path, key: str) -> bool:
    binary = root / "femimpact" / _binary_name()
    return not differs(binary) and f"femimpact build key {key}".encode() in binary.read_bytes()


def build(
    root: Path,  # directory of pyproject.toml
    kind: str,  # "release", "checked", "sanitized" or "zig"
    say: Callable[[str], None] = print,
) -> bool:
    """Compile the core of a checkout into its package, unless the binary there comes of the same.

    Returns whether anything was compiled; `say` takes a line on what is done.

    Raises `CompilationError` if there is no compiler, if it fails, or if the binary cannot be written.
    """
    for name, text in stubs(root / "femimpact" / "core").items():
        path = root / "femimpact" / "core" / f"{name}.pyi"
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            _write(path, text.encode())
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
    """Write a file at once: beside it and renamed, so that a process that has the earlier one open goes on with it."""
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
    build = "release" if kind == "zig" else kind
    about = {"COMPILER": compiler.name, "KIND": build, "SOURCES": source_hash(core), "KEY": key}
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


# ---- types of what the core is handed ------------------------------------------------------------------

TABLES = {
    "events": ("event_driven/loop_data.hpp", "contact/impulses.hpp"),
    "steps": ("stepping/loop_data.hpp", "contact/laws.hpp"),
}
"""Headers whose structs with fields, and names of rows, are those of `core.events` and `core.steps`."""

STUB = """\
# Made by `femimpact.core.compilation` from the tables in {headers}, which say what the fields are.
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex, Integers
"""

STRUCT = re.compile(r"^struct (\w+) \{\n    FIELDS_BEGIN;\n(.*?)^    FIELDS_END;", re.MULTILINE | re.DOTALL)
FIELD = re.compile(r'^ +(?:ARRAY|NUMBER|GROUP)\w*\("?(\w+)"?, (.*?)\);', re.MULTILINE)
ROWS = re.compile(r"^ENUMERATION\(\w+, (.*?)\);", re.MULTILINE | re.DOTALL)

ARRAYS = {"Complex": "Complex", "Ind": "Integers", "Flags": "NDArray[np.bool_]", "unsigned": "NDArray[np.bool_]"}
"""Types of arrays in Python, by a part of their type in C++; the others are `Array`."""


def stubs(core: Path) -> dict[str, str]:
    """Texts of the stubs of `core.events` and `core.steps`, which type checkers read, by their names."""
    texts = {}
    for name, headers in TABLES.items():
        source = "".join((core / header).read_text(encoding="utf-8") for header in headers)
        parts = [STUB.format(headers=", ".join(headers))]
        parts += [f"{row}: int\n" for names in ROWS.findall(source) for row in names.replace(",", " ").split()]
        for struct, lines in STRUCT.findall(source):
            fields = [f"    {field}: {_type_of(words)}\n" for field, words in FIELD.findall(lines)]
            parts.append(f"\nclass {struct}(NamedTuple):\n{''.join(fields)}")
        texts[name] = "".join(parts)
    return texts


def _type_of(words: str) -> str:
    """The type of a field in Python, by what stands behind its name: its shape, if it is an array, and its type."""
    _, is_array, kind = words.rpartition('", ')
    if is_array:
        return next((name for part, name in ARRAYS.items() if part in kind), "Array")
    kind = words.rpartition(", ")[2]
    return {"double": "float", "Index": "int"}.get(kind, kind)


def main() -> None:
    """Build the core of this checkout, as FEMIMPACT_BUILD asks."""
    try:
        build(Path(__file__).resolve().parents[2], asked_kind())
    except CompilationError as error:
        sys.exit(f"femimpact: {error}")


if __name__ == "__main__":
    main()
