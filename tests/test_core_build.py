"""How the compiled core is built, packed and loaded, and in which words it is refused."""

from __future__ import annotations

import base64
import csv
import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import time
import tomllib
import zipfile
from concurrent.futures import ThreadPoolExecutor
from email.parser import Parser
from pathlib import Path

import pytest
from builders import paper_study_text

from femimpact import core
from femimpact.core import binary, compilation
from femimpact.core.binary import record_of, record_text, source_hash

ROOT = Path(__file__).parents[1]
CORE = ROOT / "femimpact" / "core"
SOURCES = {path.relative_to(ROOT).as_posix() for path in CORE.rglob("*.[ch]pp")}
BINARY = compilation._binary_name()
RECORD = record_of(Path(BINARY)).name

ENVIRONMENT = {name: value for name, value in os.environ.items() if name not in ("FEMIMPACT_BUILD", "FEMIMPACT_CORE")}


def ran(*command, cwd, **environment):
    """A finished child process."""
    return subprocess.run(
        [sys.executable, *command], cwd=cwd, env=ENVIRONMENT | environment, capture_output=True, text=True
    )


@pytest.fixture(scope="session")
def sdist(tmp_path_factory):
    """A source distribution."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("sdist")
    done = ran("-m", "hatchling", "build", "-t", "sdist", "-d", str(folder), cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return next(folder.glob("*.tar.gz"))


@pytest.fixture(scope="session")
def unpacked(sdist, tmp_path_factory):
    """A checkout from the sdist; with the binary of this one, so that nothing is compiled again."""
    folder = tmp_path_factory.mktemp("unpacked")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    root = next(folder.iterdir())
    if core.build_info()["kind"] == "release":
        for name in (BINARY, RECORD):
            shutil.copy2(ROOT / "femimpact" / name, root / "femimpact" / name)
    return root


@pytest.fixture(scope="session")
def wheel(unpacked, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    done = ran("-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "-w", str(folder), ".", cwd=unpacked)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(folder.glob("*.whl"))


@pytest.fixture
def checkout(tmp_path):
    """What loads the core and its sources, in a separate place."""
    package = tmp_path / "femimpact"
    shutil.copytree(CORE, package / "core", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("__init__.py", "__init__.pyi", "lazy.py", "errors.py", "regular_file.py", BINARY, RECORD):
        shutil.copy2(ROOT / "femimpact" / name, package / name)
    return tmp_path


def placed(checkout, content):
    """The binary of a checkout, with this content and the record of it."""
    binary = checkout / "femimpact" / BINARY
    binary.write_bytes(content)
    record_of(binary).write_bytes(record_text(content))
    return binary


# ---- wheel and sdist ------------------------------------------------------------------------------


def test_an_sdist_holds_every_source_and_no_binary(sdist):
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert names >= SOURCES | {
        "femimpact/core/build.py",
        "femimpact/core/compilation.py",
        "femimpact/core/__init__.pyi",
    }
    assert [name for name in names if re.search(r"\.(so|pyd|dylib|o)\b", name)] == []


def test_a_wheel_holds_the_binary_and_nothing_of_its_build(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {f"femimpact/{BINARY}", f"femimpact/{RECORD}"} <= set(names)
    core_files = sorted(Path(name).name for name in names if name.startswith("femimpact/core/"))
    assert core_files == ["__init__.py", "__init__.pyi", "binary.py", "events.pyi", "steps.pyi", "structs.py"]
    # all else of the package is there: what git ignores is left out of a wheel without a word
    python = {path.relative_to(ROOT).as_posix() for path in (ROOT / "femimpact").rglob("*.py")}
    assert python - set(names) == {f"femimpact/core/{name}.py" for name in ("build", "compilation")}


def test_a_wheel_is_for_this_platform_and_every_python(wheel):
    with zipfile.ZipFile(wheel) as archive:
        about = next(name for name in archive.namelist() if name.endswith(".dist-info/WHEEL"))
        record = Parser().parsestr(archive.read(about).decode())
    assert record["Root-Is-Purelib"] == "false"
    assert record["Tag"] == compilation.wheel_tag()
    assert wheel.name.endswith(f"-{compilation.wheel_tag()}.whl")
    assert compilation.wheel_tag().startswith("cp311-abi3-")


def test_the_binary_of_a_wheel_is_loaded_without_sources_beside_it(wheel, tmp_path):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    code = "import sys; sys.path.insert(0, ''); from femimpact import core; print(core.build_info()['sources'])"
    done = ran("-I", "-c", code, cwd=tmp_path)
    assert done.stdout.strip() == source_hash(), done.stderr


def test_a_wheel_whose_binary_a_repair_has_changed_gets_another_record(wheel, tmp_path):
    repaired, folder = tmp_path / "repaired", tmp_path / "installed"
    repaired.mkdir()
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(repaired / wheel.name, "w") as new:
        for entry in old.infolist():
            # as auditwheel, delocate and strip do; what follows the end of a library is not read
            more = b"repaired" if entry.filename == f"femimpact/{BINARY}" else b""
            new.writestr(entry, old.read(entry) + more)
    done = ran(str(ROOT / ".ci" / "wheel_record.py"), str(repaired), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(repaired / wheel.name) as archive:
        archive.extractall(folder)
        names = archive.namelist()
        about = next(name for name in names if name.endswith(".dist-info/RECORD"))
        rows = list(csv.reader(archive.read(about).decode().splitlines()))
    with zipfile.ZipFile(wheel) as archive:
        assert names == archive.namelist()
    # what an installer compares: of the binary itself the repair writes it
    (row,) = [row for row in rows if row[0] == f"femimpact/{RECORD}"]
    content = (folder / row[0]).read_bytes()
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
    assert row[1:] == [f"sha256={digest}", str(len(content))]
    assert len(rows) == len(names)
    assert content == record_text((folder / "femimpact" / BINARY).read_bytes())
    if sys.platform == "linux":
        assert ran("-I", "-c", LOAD, cwd=folder).stdout.strip() in compilation.targets_here()


def test_the_record_of_a_wheel_is_written_after_its_repair_on_every_platform():
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["cibuildwheel"]
    last = [step for step in table["overrides"] if "repair-wheel-command" in step]
    assert [(step["select"], step["inherit"]["repair-wheel-command"]) for step in last] == [("*", "append")]
    assert last[0]["repair-wheel-command"] == "python {project}/.ci/wheel_record.py {dest_dir}"


@pytest.mark.parametrize("kind", ["checked", "sanitized", "fast"])
def test_no_wheel_is_made_of_a_build_with_checks(unpacked, kind, tmp_path):
    command = ("-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path))
    done = ran(*command, cwd=unpacked, FEMIMPACT_BUILD=kind)
    assert done.returncode != 0
    # one line, no traceback
    assert re.fullmatch(rf"femimpact: FEMIMPACT_BUILD = '{kind}': .*", done.stderr.strip())
    assert list(tmp_path.iterdir()) == []


# ---- what is compiled, and by what ----------------------------------------------------------------


def release():
    """A compiler that is never called."""
    return compilation.Compiler("gcc 12.2.0", ("c++",), ("c++",))


def test_an_unchanged_build_is_skipped(checkout, monkeypatch):
    lines = []
    monkeypatch.setattr(compilation, "find_compiler", lambda kind: release())
    key = compilation.build_key(checkout, release(), "release")
    binary = placed(checkout, b"\x7fELF femimpact build key " + key.encode() + b"\0")
    assert not compilation.build(checkout, "release", lines.append)
    assert "up to date" in lines[0]
    assert not compilation.needs_zig(checkout, "release")
    # one that is not that of its record is built again
    binary.write_bytes(binary.read_bytes() + b"\0")
    assert not compilation._is_built(checkout, key)
    record_of(binary).unlink()
    assert not compilation._is_built(checkout, key)


def test_sources_compiler_and_flags_each_make_another_build(checkout, monkeypatch):
    monkeypatch.delenv("CXXFLAGS", raising=False)
    keys = [compilation.build_key(checkout, release(), "release")]
    assert compilation.build_key(checkout, release(), "release") == keys[0]
    keys.append(compilation.build_key(checkout, release(), "checked"))
    keys.append(compilation.build_key(checkout, compilation.Compiler("gcc 13.1.0", ("c++",), ("c++",)), "release"))
    with monkeypatch.context() as changed:
        changed.setenv("CXXFLAGS", "-g")
        keys.append(compilation.build_key(checkout, release(), "release"))
    header = checkout / "femimpact" / "core" / "kernels.hpp"
    header.write_text(header.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    keys.append(compilation.build_key(checkout, release(), "release"))
    assert len(set(keys)) == len(keys)


def test_zig_is_the_same_wherever_it_lies(checkout):
    # every build from pip has it in another temporary directory
    places = [("/a/zig", "c++"), ("/b/zig", "c++"), ()]
    keys = {compilation.build_key(checkout, compilation.Compiler("zig 0.17.1", at, at), "zig") for at in places}
    assert len(keys) == 1


def test_a_binary_that_is_in_use_stays_whole(checkout, monkeypatch):
    def compiled(root, compiler, kind, key, directory):
        path = Path(directory, BINARY)
        path.write_bytes(b"new")
        return path

    monkeypatch.setattr(compilation, "find_compiler", lambda kind: release())
    monkeypatch.setattr(compilation, "_compile", compiled)
    binary = checkout / "femimpact" / BINARY
    earlier = binary.read_bytes()
    with binary.open("rb") as in_use:
        assert compilation.build(checkout, "release", lambda line: None)
        assert in_use.read() == earlier
    assert binary.read_bytes() == b"new"
    assert record_of(binary).read_bytes() == record_text(b"new")
    assert sorted(path.name for path in (checkout / "femimpact").glob("_core*")) == [BINARY, RECORD]


def test_a_build_that_fails_leaves_the_binary(checkout, monkeypatch):
    def fails(*arguments):
        raise compilation.CompilationError("the compiler failed")

    monkeypatch.setattr(compilation, "find_compiler", lambda kind: release())
    monkeypatch.setattr(compilation, "_compile", fails)
    earlier = (checkout / "femimpact" / BINARY).read_bytes()
    with pytest.raises(compilation.CompilationError):
        compilation.build(checkout, "release", lambda line: None)
    assert (checkout / "femimpact" / BINARY).read_bytes() == earlier


def test_a_binary_that_cannot_be_written_is_one_line(checkout, monkeypatch):
    def refuses(*arguments):
        raise PermissionError(13, "Permission denied", str(checkout))

    monkeypatch.setattr(compilation, "find_compiler", lambda kind: release())
    monkeypatch.setattr(compilation, "_compile", lambda *arguments: checkout / "femimpact" / "errors.py")
    monkeypatch.setattr(compilation.os, "replace", refuses)
    with pytest.raises(compilation.CompilationError, match=r"^.*: cannot be written: Permission denied$"):
        compilation.build(checkout, "release", lambda line: None)
    assert sorted(path.name for path in (checkout / "femimpact").glob("_core*")) == [BINARY, RECORD]


def test_our_flags_come_after_those_of_the_environment(monkeypatch):
    monkeypatch.setenv("CXXFLAGS", "-Ofast -ffp-contract=fast -fopenmp")
    for compiler in (release(), compilation.Compiler("zig 0.17.1", ("zig", "c++"), ("zig", "cc"))):
        flags = compilation.compile_flags(compiler, "release", "common")
        assert flags[:3] == ["-Ofast", "-ffp-contract=fast", "-fopenmp"]
        assert {"-O3", "-fno-fast-math", "-ffp-contract=off", "-fno-tree-vectorize"} <= set(flags[3:])
        # what every processor runs is not made for the one that compiles
        assert {"-march=x86-64", "-mcpu=baseline", "-fPIC"} & set(flags[3:])


@pytest.mark.parametrize(
    ("system", "machine", "name", "tag", "linked", "not_linked"),
    [
        ("linux", "x86_64", "_core.abi3.so", "linux_x86_64", "-shared -Wl,--as-needed -s -lm", "-lpython3"),
        ("linux", "aarch64", "_core.abi3.so", "linux_aarch64", "-shared -Wl,--as-needed -s -lm", "-lpython3"),
        ("darwin", "arm64", "_core.abi3.so", "macosx_11_0_arm64", "-bundle -undefined dynamic_lookup", "-shared -s"),
        ("darwin", "x86_64", "_core.abi3.so", "macosx_11_0_x86_64", "-bundle -undefined dynamic_lookup", "-shared -s"),
        ("win32", "AMD64", "_core.pyd", "win_amd64", "-shared -static-libgcc -lpython3", "-Wl,--as-needed -s"),
    ],
)
def test_each_platform_has_its_flags_name_and_tag(monkeypatch, system, machine, name, tag, linked, not_linked):
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(compilation.platform, "machine", lambda: machine)
    monkeypatch.setattr(sysconfig, "get_platform", lambda: {"win32": "win-amd64"}.get(system, f"{system}-{machine}"))
    assert compilation._binary_name() == name
    assert compilation.wheel_tag() == f"cp311-abi3-{tag}"
    words = compilation.link_command(release(), "release", ["a.o"], name)
    assert set(linked.split()) <= set(words)
    assert not set(not_linked.split()) & set(words)
    # of the Python that runs, not of an environment in it
    assert (f"-L{Path(sys.base_prefix, 'libs')}" in words) == (system == "win32")
    targets = ("arm64",) if machine in ("arm64", "aarch64") else ("v2", "v3", "v4")
    assert compilation.targets_here() == targets
    level = [word for word in compilation.compile_flags(release(), "release", targets[-1]) if word.startswith("-march")]
    assert level == ([] if targets == ("arm64",) else ["-march=x86-64-v4"])


def test_a_path_of_windows_keeps_its_backslashes(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv("CXX", r'"C:\Program Files\LLVM\bin\clang++.exe" -target x86_64-windows-gnu')
    given = compilation.given_words("CXX")
    assert given == (r"C:\Program Files\LLVM\bin\clang++.exe", "-target", "x86_64-windows-gnu")
    monkeypatch.delenv("CXX")
    assert compilation.given_words("CXX") == ()


@pytest.mark.parametrize("variable", ["CXX", "CXXFLAGS", "LDFLAGS"])
@pytest.mark.parametrize("text", ["-DNAME='a", '"', "-O2 \\"])
def test_a_quotation_mark_that_is_not_closed_is_one_line(checkout, variable, text):
    done = ran("-m", "femimpact.core.compilation", cwd=checkout, **{variable: text})
    assert done.returncode == 1
    assert re.fullmatch(f"femimpact: {variable} = .*: cannot be read as words of a shell: .*\n", done.stderr)


def test_the_pages_name_the_versions_that_the_build_asks_for():
    pages = ("docs/howto/installation.md", "CONTRIBUTING.md")
    text = "".join((ROOT / name).read_text(encoding="utf-8") for name in pages)
    (backend,) = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    assert set(re.findall(r"ziglang==[\d.]+", text)) == {compilation.zig_requirement()}
    assert set(re.findall(r"hatchling>=[\d.,<]+", text)) == {backend}
    assert f"zig {compilation.ZIG.rpartition('.')[0]} " in text


@pytest.fixture
def no_compiler(monkeypatch, tmp_path):
    """A PATH without compilation, and no zig."""
    for name in ("CC", "CXX"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(compilation.importlib.util, "find_spec", lambda name: None)


def test_without_a_compiler_the_index_is_asked_for_zig(no_compiler, checkout):
    assert compilation.find_compiler("release").is_zig
    assert compilation.zig_requirement() == f"ziglang=={compilation.ZIG}"
    (checkout / "femimpact" / BINARY).unlink()
    assert compilation.needs_zig(checkout, "release")


def test_with_neither_compiler_nor_zig_one_line_says_what_to_do(no_compiler, checkout):
    (checkout / "femimpact" / BINARY).unlink()
    with pytest.raises(compilation.CompilationError, match=r"^no compiler of C\+\+20 .* ziglang==.*isolation$"):
        compilation.build(checkout, "release")


def test_a_sanitized_build_takes_no_zig(no_compiler):
    with pytest.raises(compilation.CompilationError, match="'sanitized': needs gcc or clang"):
        compilation.find_compiler("sanitized")


@pytest.mark.skipif(os.name != "posix", reason="a program that is a script of the shell")
@pytest.mark.parametrize("variable", ["CXX", "CC", "PATH"])
@pytest.mark.parametrize("status", [0, 1])
def test_a_program_that_takes_no_new_language_is_passed_over(no_compiler, monkeypatch, tmp_path, variable, status):
    old = tmp_path / "c++"
    # one that ends well has compiled nothing either
    old.write_text(f"#!/bin/sh\nexit {status}\n", encoding="utf-8")
    old.chmod(0o755)
    if variable != "PATH":
        monkeypatch.setenv("PATH", "")
        monkeypatch.setenv(variable, str(old))
    assert compilation.find_compiler("release").is_zig


@pytest.fixture(scope="module")
def compiler():
    """The system's compiler."""
    found = compilation.find_compiler("release")
    if found.is_zig:
        pytest.skip("no compiler of the system")
    return found


@pytest.mark.parametrize(
    ("variable", "text", "said"),
    [
        ("CXXFLAGS", "-fno-such-flag", "-fno-such-flag"),
        ("CXXFLAGS", "-include no_such_file.hpp", "no_such_file.hpp"),
        ("LDFLAGS", "-lno_such_library", "no_such_library"),
    ],
)
def test_flags_that_a_compiler_refuses_are_named_with_its_words(compiler, monkeypatch, variable, text, said):
    monkeypatch.setenv(variable, text)
    with pytest.raises(compilation.CompilationError) as refused:
        compilation.find_compiler("release")
    cause, command, words = str(refused.value).split("\n", 2)
    assert cause.startswith(f"{variable} = '{text}': {compiler.name} ")
    assert command.startswith("the compiler failed: ")
    assert said in words


def test_words_after_a_compiler_that_it_refuses_are_named(compiler, monkeypatch):
    monkeypatch.setenv("CXX", f"{compiler.command[0]} -fno-such-flag")
    with pytest.raises(
        compilation.CompilationError, match=r"^.* -fno-such-flag: the compiler fails with these words\n"
    ):
        compilation.find_compiler("release")


def test_flags_are_not_blamed_for_what_fails_without_them(compiler, monkeypatch, tmp_path):
    real, fails = compilation.run_compiler, []

    def run(command, directory):
        if "-c" in command:
            fails.append(command)
            raise compilation.CompilationError("the compiler failed: c++\nno room")
        return real(command, directory)

    monkeypatch.setattr(compilation, "run_compiler", run)
    monkeypatch.setenv("CXXFLAGS", "-O2")
    with pytest.raises(
        compilation.CompilationError, match=r"^.* cannot build in .*\nthe compiler failed: c\+\+\nno room$"
    ):
        compilation.find_compiler("release")
    assert len(fails) == 1


def test_without_any_temporary_directory_one_line_says_so(monkeypatch):
    def refuses(**options):
        raise FileNotFoundError(2, "No usable temporary directory found in ['/tmp']")

    monkeypatch.setattr(compilation.tempfile, "TemporaryDirectory", refuses)
    with pytest.raises(compilation.CompilationError, match=r"^TMPDIR: cannot be written: No usable temporary .*$"):
        compilation.find_compiler("release")


def test_machines_without_a_target_are_one_line(monkeypatch):
    monkeypatch.setattr(compilation.platform, "machine", lambda: "riscv64")
    with pytest.raises(compilation.CompilationError, match=r"^the compiled core is made for .* not for 'riscv64'$"):
        compilation.targets_here()


def test_free_threaded_python_is_one_line(monkeypatch):
    monkeypatch.setattr(sysconfig, "get_config_var", lambda name: int(name == "Py_GIL_DISABLED"))
    with pytest.raises(compilation.CompilationError, match=r"^the compiled core .* free-threaded Python$"):
        compilation.targets_here()


def test_the_declarations_of_pythons_limited_api_are_pythons(tmp_path):
    headers = Path(sysconfig.get_path("include"))
    compiler = compilation.find_compiler("release")
    if not (headers / "Python.h").is_file() or not compiler.command:
        pytest.skip("Python.h or a compiler is missing")
    source = tmp_path / "both.cpp"
    # what is declared twice must be the same; layouts and numbers are asserted below the declarations
    source.write_text('#include <Python.h>\n#include "limited_api.hpp"\n', encoding="utf-8")
    flags = ["-std=c++20", "-DPy_LIMITED_API=0x030b0000", f"-I{headers}", f"-I{CORE}", "-fsyntax-only"]
    compilation.run_compiler([*compiler.command, *flags, str(source)], str(tmp_path))


def test_the_binary_needs_no_library_of_cpp():
    binary = (ROOT / "femimpact" / BINARY).read_bytes()
    assert b"PyInit__core" in binary
    if core.build_info()["kind"] != "sanitized":
        assert not any(name in binary for name in (b"libstdc++", b"libc++", b"libgcc_s"))


# ---- what is loaded -------------------------------------------------------------------------------


def test_the_core_says_what_it_was_made_of():
    info = core.build_info()
    assert info["sources"] == source_hash()
    assert info["target"] in info["targets"] == compilation.targets_here()
    assert re.fullmatch(r"(gcc|clang|zig) \d+\.\d+\.\d+", info["compiler"])
    assert info["kind"] in ("release", "checked", "sanitized")


def test_the_names_of_the_core_are_those_of_its_binary():
    import femimpact._core as binary

    functions = sorted(name for name in vars(binary) if not name.startswith("_"))
    stub = (CORE / "__init__.pyi").read_text(encoding="utf-8")
    assert sorted(core.__all__) == functions == sorted(re.findall(r"^def (\w+)", stub, re.MULTILINE))


def test_importing_the_package_does_not_load_the_binary():
    code = "import femimpact, femimpact.core, femimpact.integrators.event_driven, sys; print([*sys.modules])"
    done = ran("-c", code, cwd=ROOT)
    assert "femimpact.core" in done.stdout
    assert "femimpact._core" not in done.stdout


LOAD = """
import sys
sys.path.insert(0, "")
from femimpact import core, errors
try:
    print(core.build_info()["target"])
except errors.CoreError as error:
    print("REFUSED", error)
"""


def test_a_core_that_is_missing_is_one_line_with_the_command(checkout):
    (checkout / "femimpact" / BINARY).unlink()
    done = ran("-I", "-c", LOAD, cwd=checkout)
    command = re.escape(f"{sys.executable} -m pip install -e {checkout}")
    assert re.fullmatch(f"REFUSED the compiled core is missing: run {command}\n", done.stdout), done.stderr


def test_a_core_of_other_sources_is_one_line_with_the_command(checkout):
    with (checkout / "femimpact" / "core" / "kernels.cpp").open("a", encoding="utf-8") as source:
        source.write("// changed\n")
    done = ran("-I", "-c", LOAD, cwd=checkout)
    command = re.escape(f"{sys.executable} -m pip install -e {checkout}")
    assert re.fullmatch(f"REFUSED the compiled core was not built from .*: run {command}\n", done.stdout), done.stderr


def test_a_core_that_is_no_library_is_one_line(checkout):
    placed(checkout, b"nothing")
    done = ran("-I", "-c", LOAD, cwd=checkout)
    assert re.fullmatch("REFUSED the compiled core cannot be loaded: .*\n", done.stdout), done.stderr


def cut(binary):
    binary.write_bytes(binary.read_bytes()[:100_000])


def one_bit(binary):
    content = bytearray(binary.read_bytes())
    content[len(content) // 2] ^= 1
    binary.write_bytes(content)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (cut, r"has 100,000 bytes of [\d,]+ \(.*\)"),
        (one_bit, r"is not the file that was built: its SHA-256 is another \(.*\)"),
        (lambda binary: record_of(binary).unlink(), r"has no record of its size and SHA-256 \(.*\.record\)"),
        (lambda binary: record_of(binary).write_bytes(b"\xff" * 87), "has a record .* that is damaged .*"),
    ],
    ids=["cut", "one bit", "no record", "damaged record"],
)
def test_a_core_that_is_not_that_of_its_record_is_one_line_with_the_command(checkout, damage, words):
    damage(checkout / "femimpact" / BINARY)
    # in another process: one that loads a library that is cut short ends by a signal
    done = ran("-I", "-c", LOAD, cwd=checkout)
    command = re.escape(f"{sys.executable} -m pip install -e {checkout}")
    assert re.fullmatch(f"REFUSED the compiled core {words}: run {command}\n", done.stdout), done.stdout + done.stderr
    assert (done.returncode, done.stderr) == (0, "")


def level():
    """The highest x86-64-vN by what the kernel of Linux says of the processor."""
    wanted = {
        2: "cx16 lahf_lm popcnt sse4_1 sse4_2 ssse3",
        3: "abm avx avx2 bmi1 bmi2 f16c fma movbe",
        4: "avx512f avx512bw avx512cd avx512dq avx512vl",
    }
    flags = set(re.search(r"^flags\s*: (.*)$", Path("/proc/cpuinfo").read_text("utf-8"), re.MULTILINE)[1].split())
    found = 1
    for number, names in wanted.items():
        if not set(names.split()) <= flags:
            break
        found = number
    return found


of_x86 = pytest.mark.skipif(compilation.targets_here()[0] != "v2", reason="x86-64 alone has several targets")


@of_x86
@pytest.mark.parametrize("target", ["v2", "v3", "v4"])
def test_a_target_can_be_chosen(target):
    done = ran("-c", LOAD, cwd=ROOT, FEMIMPACT_CORE=target)
    # by what the library itself takes: another processor has fewer
    if int(target[1]) <= int(ran("-c", LOAD, cwd=ROOT).stdout.strip()[1]):
        assert done.stdout == f"{target}\n"
    else:
        assert f"REFUSED the compiled core cannot be loaded: FEMIMPACT_CORE = '{target}': this processor" in done.stdout


@of_x86
@pytest.mark.parametrize(
    ("processor", "asked", "taken"), [(2, "", "v2"), (3, "", "v3"), (4, "", "v4"), (4, "v2", "v2"), (3, "v3", "v3")]
)
def test_each_processor_has_its_target(processor, asked, taken):
    assert core.choose_target(processor, asked) == taken


@of_x86
@pytest.mark.parametrize(
    ("processor", "asked", "words"),
    [
        (1, "", "this processor lacks x86-64-v2"),
        (1, "v2", "this processor lacks x86-64-v2"),
        (2, "v3", "FEMIMPACT_CORE = 'v3': this processor has no x86-64-v3"),
        (3, "v4", "FEMIMPACT_CORE = 'v4': this processor has no x86-64-v4"),
        (4, "v5", "FEMIMPACT_CORE = 'v5': must be one of v2, v3, v4"),
        (4, "v" * 1000, "must be one of v2, v3, v4"),
        (4, "é" * 1000, "must be one of v2, v3, v4"),
    ],
)
def test_a_target_that_a_processor_lacks_is_one_line(processor, asked, words):
    with pytest.raises(ImportError, match=words) as refused:
        core.choose_target(processor, asked)
    assert len(str(refused.value)) < 200
    assert "\n" not in str(refused.value)


def test_the_command_line_refuses_in_one_line(tmp_path):
    (tmp_path / "study.toml").write_text(paper_study_text(), encoding="utf-8")
    for command in (["check", "study.toml"], ["run", "study.toml"]):
        done = ran("-m", "femimpact", *command, cwd=tmp_path, PYTHONPATH=str(ROOT), FEMIMPACT_CORE="v9")
        assert done.returncode == 2
        assert re.fullmatch(r"femimpact: .*FEMIMPACT_CORE = 'v9': must be one of .*\n", done.stderr)
        assert not (tmp_path / "study-results").exists()


def test_the_version_names_target_compiler_and_sources(tmp_path):
    done = ran("-m", "femimpact", "--version", cwd=tmp_path, PYTHONPATH=str(ROOT))
    info = core.build_info()
    version, line = done.stdout.splitlines()
    assert version == tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert info["compiler"] in line
    assert info["sources"][:12] in line
    # also where it is what is at fault
    done = ran("-m", "femimpact", "--version", cwd=tmp_path, PYTHONPATH=str(ROOT), FEMIMPACT_CORE="v9")
    assert done.returncode == 0
    assert "must be one of" in done.stdout.splitlines()[1]


def test_threads_that_ask_for_the_core_at_once_load_it_one_after_the_other(monkeypatch):
    """A module that another thread loads has no loader yet, and looks damaged."""
    inside, most = [], []

    def load():
        inside.append(1)
        most.append(len(inside))
        time.sleep(0.02)
        inside.pop()
        return binary

    monkeypatch.setattr(binary, "_loaded", load)
    binary.loaded.cache_clear()
    try:
        with ThreadPoolExecutor(4) as pool:
            assert set(pool.map(lambda _: binary.loaded(), range(4))) == {binary}
    finally:
        binary.loaded.cache_clear()
    assert set(most) == {1}
