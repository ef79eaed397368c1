"""Compiled code is never older than a source that was compiled into it, and never taken from where others can write."""

from __future__ import annotations

import ast
import gc
import importlib.util
import logging
import os
import pickle
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from numba.core.types.functions import BaseFunction

from femimpact.integrators.compiled import code_files, compiling, numba_insides
from femimpact.integrators.compiled.code_files import CodeFiles, candidates, open_code_files, sources_of, stamp_of
from femimpact.integrators.stepping import loop, touch

PACKAGE = compiling.PACKAGE
SOURCES = [source.relative_to(PACKAGE).as_posix() for source in sources_of(PACKAGE)]
STAMP = b"s" * 32

# ---- what makes compiled code out of date --------------------------------------------------------


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """The package's sources, nothing compiled among them."""
    copy = tmp_path_factory.mktemp("copy") / "femimpact"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.mark.parametrize("name", SOURCES)
def test_a_constant_changed_in_any_source_makes_compiled_code_stale(copied, name):
    source = copied / name
    before, text, times = stamp_of(copied), source.read_text(encoding="utf-8"), source.stat()
    number = re.search(r"(?<![\w.])\d", text) or re.search(r"\w", text)
    other = "1" if number[0] != "1" else "2"
    source.write_text(text[: number.start()] + other + text[number.end() :], encoding="utf-8")
    # neither the size nor the time tells
    os.utime(source, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert stamp_of(copied) != before
    source.write_text(text, encoding="utf-8")
    assert stamp_of(copied) == before


def _modules_read(source):
    """Files of the package's modules that a source imports, as Python's own parser and importer find them."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            if name.startswith("femimpact."):
                try:
                    found = importlib.util.find_spec(name)
                except ModuleNotFoundError:  # a name out of a module, not a module
                    found = None
                yield Path((found or importlib.util.find_spec(name.rpartition(".")[0])).origin)


def test_the_stamp_is_over_every_module_that_a_kernel_reads():
    sources = set(sources_of(PACKAGE))
    assert {"contact/formulas.py", "integrators/stepping/layout.py", "integrators/stepping/loop.py"} <= set(SOURCES)
    for source in sources:
        assert set(_modules_read(source)) <= sources, source


def test_kernels_are_kept_with_that_stamp():
    assert compiling.FILES is None or compiling.FILES.stamp == stamp_of(PACKAGE, *compiling.VERSIONS)
    for dispatcher in (loop.advance, touch.collide):
        assert compiling.FILES is None or dispatcher._cache._files is compiling.FILES
    # its own source is not in the stamp
    assert not hasattr(compiling.compiled(_square)._cache, "_files")


TINY = '''"""A kernel that takes a second to compile."""

from femimpact.contact import formulas
from femimpact.integrators.compiled.compiling import apart, compiled, inlined

force = inlined(formulas.kelvin_voigt_force)


@apart
def twice(x: float) -> float:
    return 2.0 * x


@compiled
def pressed(depth: float) -> float:
    return twice(force(depth, 0.5, 3.0, 0.25))
'''
ASK = """
from femimpact.integrators.compiled import tiny
value = tiny.pressed(2.0)
import sys
print(value, sum(tiny.pressed.stats.cache_hits.values()), "femimpact.integrators.compiled.numba_insides" in sys.modules)
"""


def _asked(package, home, before=""):
    """Value of the small kernel, whether it came from disk, whether numba's insides were used; lines on stderr."""
    kept = ("PATH", "SYSTEMROOT", "LD_LIBRARY_PATH")
    environment = {name: os.environ[name] for name in kept if name in os.environ}
    environment |= {"HOME": str(home), "PYTHONPATH": str(package.parent)}
    found = subprocess.run(
        [sys.executable, "-c", before + ASK], env=environment, cwd=package.parent, capture_output=True, text=True,
        timeout=120,
    )  # fmt: skip
    assert found.returncode == 0, found.stderr
    value, hits, insides = found.stdout.split()
    return float(value), int(hits), insides == "True", found.stderr.splitlines()


@pytest.fixture
def package(copied, tmp_path):
    """A copy of the package with one more kernel."""
    copy = tmp_path / "femimpact"
    shutil.copytree(copied, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "integrators" / "compiled" / "tiny.py").write_text(TINY, encoding="utf-8")
    return copy


def test_a_formula_changed_outside_the_kernels_is_compiled_anew(package, tmp_path):
    # 2 (3 * 2 + 0.25 * 0.5)
    assert _asked(package, tmp_path) == (12.25, 0, True, [])
    assert _asked(package, tmp_path) == (12.25, 1, True, [])
    formulas = package / "contact" / "formulas.py"
    text = formulas.read_text(encoding="utf-8")
    assert text.count("stiffness * depth + damping * rate") == 1
    formulas.write_text(text.replace("stiffness * depth +", "2 * stiffness * depth +"), encoding="utf-8")
    assert _asked(package, tmp_path) == (24.25, 0, True, [])


# ---- where it may lie ----------------------------------------------------------------------------


def test_a_package_and_a_home_that_cannot_be_written_leave_the_memory(package, tmp_path):
    # a file where a directory would be made: not even root can write there
    (package / "integrators" / "compiled" / "__pycache__").write_bytes(b"")
    for _ in range(2):
        value, hits, _, lines = _asked(package, package / "__init__.py")
        assert (value, hits) == (12.25, 0)
        assert len(lines) == 1
        assert "kept in memory" in lines[0]


def test_a_package_that_cannot_be_written_leaves_a_private_directory(package, tmp_path):
    (package / "integrators" / "compiled" / "__pycache__").write_bytes(b"")
    home = tmp_path / "home"
    home.mkdir()
    value, hits, _, lines = _asked(package, home)
    assert (value, hits) == (12.25, 0)
    assert len(lines) == 1
    assert str(home) in lines[0]
    (made,) = (home / ".cache" / "femimpact").iterdir()
    assert code_files.is_private(made)
    # told when it is made, not in every process
    assert _asked(package, home) == (12.25, 1, True, [])


def test_without_a_home_no_directory_is_made_where_the_user_happens_to_be(monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert all(place.is_relative_to(PACKAGE) for place in candidates(PACKAGE))


def test_a_directory_that_the_user_names_is_the_only_one(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (place,) = candidates(PACKAGE)
    assert place.parent == tmp_path
    files = open_code_files(PACKAGE, (place,))
    assert files.directories == (place,)
    assert stat.S_IMODE(place.stat().st_mode) == 0o700 or os.name == "nt"


@pytest.mark.skipif(os.name == "nt", reason="no owners, no permissions")
@pytest.mark.parametrize("fault", ["group", "world", "link", "file", "owner"])
def test_code_is_not_read_from_where_others_can_write(monkeypatch, tmp_path, caplog, fault):
    place, good = tmp_path / "place", tmp_path / "good"
    good.mkdir(mode=0o700)
    if fault == "link":
        place.symlink_to(good)
    elif fault == "file":
        place.write_bytes(b"")
    else:
        place.mkdir(mode=0o700)
    assert code_files.is_private(place) is (fault in ("group", "world", "owner"))
    if fault in ("group", "world"):
        place.chmod(0o720 if fault == "group" else 0o702)
    if fault == "owner":
        monkeypatch.setattr(os, "geteuid", lambda: place.stat().st_uid + 1)
    assert not code_files.is_private(place)
    code_files._say_once.cache_clear()
    assert open_code_files(PACKAGE, (place,)) is None
    assert [record.levelno for record in caplog.records] == [logging.WARNING]


# ---- what is damaged -----------------------------------------------------------------------------


def _flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def _directory(path):
    path.unlink()
    path.mkdir()
    (path / "inside").write_bytes(b"x")


def _wrong_object(path):
    CodeFiles((path.parent,), STAMP).write(path.name, pickle.dumps({"no": "code"}))


DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "mark only": lambda path: path.write_bytes(code_files.MARK + STAMP),
    "longer": lambda path: path.write_bytes(path.read_bytes() + b"x"),
    "garbage": lambda path: path.write_bytes(bytes(range(256)) * 40),
    "one bit": _flip,
    "a pickle": lambda path: path.write_bytes(pickle.dumps({"no": "code"})),
    "another version": lambda path: path.write_bytes(path.read_bytes().replace(b"code 1", b"code 0", 1)),
    "a whole file of another thing": _wrong_object,
    "a directory": _directory,
}


def _kept(directory, stamp=STAMP, long=False):
    return numba_insides.compiled(_square, CodeFiles((directory,), stamp), long)


def _hits(dispatcher):
    assert dispatcher(3.0) == 9.0
    return sum(dispatcher.stats.cache_hits.values())


def test_a_function_that_takes_long_says_once_that_it_is_compiled(tmp_path, caplog):
    assert _hits(_kept(tmp_path, long=True)) == 0
    (record,) = caplog.records
    assert "compiles test_compiling._square" in record.getMessage()
    assert _hits(_kept(tmp_path, long=True)) == 1
    assert len(caplog.records) == 1


def test_compiling_leaves_numba_and_the_collector_as_they_were(tmp_path):
    before = BaseFunction.get_call_type, gc.isenabled()
    assert _hits(_kept(tmp_path)) == 0
    assert (BaseFunction.get_call_type, gc.isenabled()) == before
    assert njit(lambda x: x + 1)(2) == 3


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_file_is_thrown_away_and_made_again(tmp_path, caplog, kind):
    assert _hits(_kept(tmp_path)) == 0
    (path,) = tmp_path.iterdir()
    assert _hits(_kept(tmp_path)) == 1
    assert not caplog.records
    DAMAGE[kind](path)
    assert _hits(_kept(tmp_path)) == 0
    (record,) = caplog.records
    assert "made again" in record.getMessage()
    assert list(tmp_path.iterdir()) == [path]
    assert _hits(_kept(tmp_path)) == 1


def test_a_file_that_may_not_be_read_is_made_again(tmp_path, caplog, monkeypatch):
    assert _hits(_kept(tmp_path)) == 0

    def denied(path):
        raise PermissionError(13, "Permission denied", str(path))

    with monkeypatch.context() as patch:
        # root may read what has no permission to be read
        patch.setattr(code_files, "open_regular", denied)
        assert _hits(_kept(tmp_path)) == 0
    assert len(caplog.records) == 1
    assert _hits(_kept(tmp_path)) == 1


def test_code_of_other_sources_is_not_taken(tmp_path, caplog):
    assert _hits(_kept(tmp_path)) == 0
    assert _hits(_kept(tmp_path, b"t" * 32)) == 0
    assert _hits(_kept(tmp_path, b"t" * 32)) == 1
    # written over: what is out of date does not pile up
    assert len(list(tmp_path.iterdir())) == 1
    assert not caplog.records


def test_a_directory_that_is_gone_or_full_costs_the_file_not_the_run(tmp_path, caplog, monkeypatch):
    code_files._say_once.cache_clear()
    assert _hits(_kept(tmp_path / "gone")) == 0

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    for _ in range(2):
        assert _hits(_kept(tmp_path)) == 0
    assert not list(tmp_path.iterdir())
    assert len(caplog.records) == 2  # one for each directory


# ---- how it is compiled --------------------------------------------------------------------------


def test_other_versions_of_numba_are_used_by_their_public_way(package, tmp_path):
    value, hits, insides, lines = _asked(package, tmp_path, 'import numba\nnumba.__version__ = "0.0"')
    assert (value, hits, insides) == (12.25, 0, False)
    assert len(lines) == 1
    assert "numba 0.0" in lines[0]


def test_inner_functions_become_machine_code_in_their_caller_alone():
    twice = compiling.inlined(lambda x: 2.0 * x)
    square = compiling.apart(_square)

    @njit
    def outer(x):
        return square(twice(x))

    assert outer(3.0) == 36.0
    for inner in (twice, square):
        (part,) = inner.overloads.values()
        assert isinstance(part.library, numba_insides._Part)
    (machine_code,) = outer.inspect_asm().values()
    functions = [line for line in machine_code.splitlines() if re.fullmatch(r"_ZN\w*:", line)]
    assert sum("_square" in line for line in functions) == 1
    assert not any("lambda" in line for line in functions)


def _square(x):
    return x * x


def test_an_index_written_as_zero_needs_no_code_of_its_own():
    inner = compiling.called(lambda values, i: values[i])

    @njit
    def outer(values):
        total = inner(values, compiling.ZERO)
        for i in range(values.size):
            total += inner(values, i)
        return total

    assert outer(np.array([1.0, 2.0])) == 4.0
    assert len(inner.overloads) == 1


HELD = """
from typing import NamedTuple

import numpy as np

from femimpact.integrators.compiled.addresses import by_address
from femimpact.integrators.compiled.compiling import UNCOUNTED, called, compiled


class Inner(NamedTuple):
    values: object
    scale: float


class Outer(NamedTuple):
    first: object
    inner: Inner
    wanted: bool


@called
def total(outer, more):
    found = outer.inner.scale * outer.inner.values[1] if outer.wanted else 0.0
    return outer.first[0, 1] + found + (0.0 if more is None else 1.0)


@compiled
def repeated(outer, more):
    held, found = by_address(outer), 0.0
    for _ in range(1000):
        found += total(held, by_address(more))
    return found


for _ in range(200):
    outer = Outer(np.full((3, 2), 2.0), Inner(np.arange(9.0) + 1j, 0.5), True)
    assert repeated(outer, None) == 1000 * (2.5 + 0.5j)
print(UNCOUNTED)
"""


@pytest.mark.parametrize(("first", "known"), [("", True), ('import numba\nnumba.__version__ = "0.0"\n', False)])
def test_tuples_are_handed_on_by_address_only_where_nothing_counts_references(tmp_path, first, known):
    script = tmp_path / "held.py"
    script.write_text(first + HELD, encoding="utf-8")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, str(known)), done.stderr
