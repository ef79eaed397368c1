"""Files that are read are regular ones of known size: no pipe is waited for, no device fills the memory."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys

import numpy as np
import pytest
import xarray
from builders import paper_study_text, read_csv
from command import femimpact

import femimpact as fi
from femimpact.files import atomic_path, atomic_write
from femimpact.regular_file import open_regular, read_regular

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")

READERS = {".csv": "RecordedBase.from_csv", ".toml": "load_study", ".msh": "read_mesh"} | dict.fromkeys(
    (".mtx", ".mtx.gz", ".npz"), "system.read_matrix"
)
"""By the suffix of the file that each function takes."""

SCRIPT = """
import operator, sys
import femimpact as fi
for name, path in zip(sys.argv[1::2], sys.argv[2::2]):
    try:
        operator.attrgetter(name)(fi)(path)
        print("read")
    except fi.InputError as error:
        print(error)
"""


def _told(*calls):
    """Lines of the input errors of functions of a path, in a separate process, which is ended after a minute."""
    arguments = [str(part) for call in calls for part in call]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *arguments], capture_output=True, text=True, timeout=60, check=True
    )
    return done.stdout.splitlines()


def bind(path):
    # by a short name: that of a socket has its limit
    with contextlib.chdir(path.parent), socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)


KINDS = {
    "a pipe": os.mkfifo,
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a directory": lambda path: path.mkdir(),
    "a socket": bind,
}
"""What may have the name of a file, and what makes it."""


def test_what_is_no_regular_file_is_refused_at_once(tmp_path):
    cases = [(kind, READERS[suffix], tmp_path / f"given {kind}{suffix}") for kind in KINDS for suffix in READERS]
    for kind, _, path in cases:
        KINDS[kind](path)
    lines = _told(*((reader, path) for _, reader, path in cases))
    assert len(lines) == len(cases)
    for line, (kind, _, path) in zip(lines, cases, strict=True):
        assert f"is {kind}, no regular file" in line
        assert path.name in line


def test_a_record_of_a_study_that_is_a_pipe_or_a_device_is_one_line(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    text, records = paper_study_text(), {"pipe.csv": "a pipe", "/dev/zero": "a device"}
    begin, end = text.index("[base]"), text.index("[method]")
    studies = [tmp_path / f"{number}.toml" for number in range(len(records))]
    for study, record in zip(studies, records, strict=True):
        study.write_text(f'{text[:begin]}[base]\nrecord = "{record}"\n{text[end : text.index("[sweep]")]}')
    lines = _told(*(("load_study", study) for study in studies))
    for line, (record, kind) in zip(lines, records.items(), strict=True):
        assert f"is {kind}, no regular file" in line
        assert line.startswith(f"base.record = '{tmp_path / record}'")


@pytest.mark.impacts
def test_results_with_a_pipe_in_the_place_of_a_file_are_one_line(finished, tmp_path):
    names = ("modes.csv", "impacts.csv", "sweep.nc", "history.nc", "impacts.nc", "summary.json")
    for name in names:
        results = shutil.copytree(finished / "out", tmp_path / name)
        (results / name).unlink(missing_ok=True)
        os.mkfifo(results / name)
    lines = _told(*(("load", tmp_path / name) for name in names))
    assert len(lines) == len(names)
    assert all(str(tmp_path / name) in line for line, name in zip(lines, names, strict=True))
    assert all("is a pipe, no regular file" in line for line in lines[:-1])


def test_a_table_that_is_a_pipe_is_an_error(tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    with pytest.raises(OSError, match="is a pipe, no regular file"):
        read_csv(tmp_path / "a.csv")


def test_a_regular_file_is_opened_and_read_up_to_a_size(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    (tmp_path / "link").symlink_to(path)
    with open_regular(tmp_path / "link", 3) as file:
        assert file.read() == b"abc"
    assert read_regular(path, 3) == b"abc"
    for refuses in (open_regular, read_regular):
        with pytest.raises(OSError, match="has 3 bytes, of which at most 2 are read"):
            refuses(path, 2)
        with pytest.raises(FileNotFoundError):
            refuses(tmp_path / "b", 2)
        with pytest.raises(OSError, match="no path of a file"):
            refuses("a\0b", 2)


def test_a_large_file_is_refused_without_being_read(tmp_path):
    # a sparse file takes no place on the disk, and its zeros would be text
    paths = {suffix: tmp_path / f"large{suffix}" for suffix in READERS}
    for path in paths.values():
        with path.open("wb") as file:
            file.truncate(10**11)
    lines = _told(*((READERS[suffix], path) for suffix, path in paths.items()))
    assert len(lines) == len(paths)
    assert all("has 100,000,000,000 bytes, of which at most" in line for line in lines)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_regular_file_is_not_replaced_by_one(tmp_path, kind):
    path = tmp_path / "signals.csv"
    KINDS[kind](path)
    before = os.lstat(path)
    record = xarray.Dataset({"tip": ("time", np.arange(3.0))}, {"time": ("time", np.arange(3.0))})
    writers = [
        lambda: fi.excitation.write_record(path, record),
        lambda: atomic_write(path, "text"),
        lambda: save_nothing(path),
    ]
    for write in writers:
        with pytest.raises(fi.InputError, match=f"must be a file: this is {kind}"):
            write()
    assert (os.lstat(path).st_ino, os.lstat(path).st_mode) == (before.st_ino, before.st_mode)
    assert os.listdir(tmp_path) == ["signals.csv"]
    done = femimpact("schema", "-o", "signals.csv", "--force", cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def save_nothing(path):
    with atomic_path(path):
        pass


@pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="no links to open files")
def test_a_link_to_an_open_file_as_that_of_the_output_is_not_replaced(tmp_path):
    with (tmp_path / "held.txt").open("w") as held:
        # as /dev/stdout is made
        (tmp_path / "stdout").symlink_to(f"/proc/self/fd/{held.fileno()}")
        with pytest.raises(fi.InputError, match="this is a link to an open file"):
            atomic_write(tmp_path / "stdout", "text")
        assert (tmp_path / "stdout").is_symlink()


def test_a_file_of_branches_that_is_no_netcdf_is_one_line(tmp_path):
    (tmp_path / "text.nc").write_text("no numbers")
    with pytest.raises(fi.InputError, match="must be netCDF"):
        fi.app.load_branch(tmp_path / "text.nc")
