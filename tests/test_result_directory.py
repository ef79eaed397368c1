"""The directory of results: whole, old or named as unfinished, whenever a run is ended, and one run at a time."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import textwrap
from contextlib import suppress
from pathlib import Path

import pytest
from builders import ResultsWarning

import femimpact as fi
from femimpact import files as tables
from femimpact.app.results import result_directory
from femimpact.app.results.result_directory import (
    Lock,
    added_results,
    beside,
    new_file,
    new_results,
    unfinished_state,
)
from femimpact.app.results.results import write_summary
from femimpact.app.study.findings import Findings
from femimpact.files import atomic_write
from femimpact.vtk import formats

OLD, NEW = 1.0, 2.0


def write_results(folder, value):
    """A few files as a run leaves them, all of which tell which run it was."""
    for name in ("modes.csv", "impacts.csv") if value == NEW else ("modes.csv", "sticking.csv"):
        tables.write_csv(folder / name, {"value": [value]}, {})
    # more frames before than after
    frames = range(2 if value == NEW else 4)
    formats.write_frames(new_file(folder, "modes_scene"), frames, (f"{value}" for _ in frames))
    write_summary(folder, Findings(step=value))


def run(directory, value, force=False):
    with new_results(directory, force) as folder:
        write_results(folder, value)


def value_of(directory):
    """Which run the results are of; every file must be of the same."""
    results = fi.load(directory)
    value = results.summary["step"]
    assert results.modes["value"][0] == value
    assert (results.impacts is None) == (results.sticking is not None) == (value == OLD)
    frames = sorted(path.read_text() for path in (Path(directory) / "paraview" / "modes").iterdir())
    assert frames == [str(value)] * (2 if value == NEW else 4)
    return value


def break_off(directory, error, force=False, value=None):
    """A run that ends with an error, after it has finished a part if a value is given."""
    with new_results(directory, force) as folder:
        if value is None:
            atomic_write(folder / "modes.csv", "half a part")
        else:
            write_results(folder, value)
        raise error


class Killed(BaseException):
    """Ends a process as a signal does: no code of it runs afterwards."""


def kill_at(work, step):
    """Do some work and end the process before a step of it that changes the file system; whether it came so far."""
    left = step

    def counted(change):
        def changed(*arguments, **options):
            nonlocal left
            if left < 0:
                return None  # the process is gone
            left -= 1
            if left < 0:
                raise Killed
            return change(*arguments, **options)

        return changed

    with pytest.MonkeyPatch.context() as patch:
        for name in ("replace", "rename", "unlink", "rmdir", "mkdir"):
            patch.setattr(os, name, counted(getattr(os, name)))
        patch.setattr(result_directory.shutil, "rmtree", counted(result_directory.shutil.rmtree))
        try:
            work()
        except Killed:
            return True
        return False


@pytest.mark.parametrize("earlier", [True, False])
@pytest.mark.filterwarnings("ignore::femimpact.app.results.result_directory.ResultsWarning")
def test_a_kill_at_any_step_of_a_run_leaves_old_or_new_and_the_next_call_finishes_it(tmp_path, earlier):
    seen, step = [], 0
    while True:
        out = tmp_path / f"{step}"
        if earlier:
            run(out, OLD)
        killed = kill_at(lambda out=out: run(out, NEW, earlier), step)
        if not out.exists():
            with pytest.raises(fi.InputError, match=r"is incomplete|must hold results"):
                fi.load(out)
            moved = earlier
            assert not moved or f"the earlier ones in {out}.old" in unfinished_state(out)
            seen.append("moved" if moved else "none")
        else:
            seen.append(value_of(out))
        # the next call that takes the directory; there may be none yet
        with suppress(fi.InputError), added_results(out):
            pass
        if seen[-1] in ("moved", NEW):
            assert value_of(out) == NEW
        else:
            run(out, NEW, True)
            assert value_of(out) == NEW
        assert not beside(out, ".old").exists() or not os.listdir(beside(out, ".old"))
        if not killed:
            break
        for path in (out, beside(out, ".part")):
            if path.exists():
                result_directory.shutil.rmtree(path)
        step += 1
    # every state was met, and they follow one another
    states = [OLD, "moved", NEW] if earlier else ["none", NEW]
    assert sorted(seen, key=states.index) == seen
    assert set(seen) == set(states)
    assert step > 15


CHILD = """
    import os, sys, time
    sys.path.insert(0, sys.argv[2])
    import test_result_directory as t
    def slowly(change):
        def changed(source, target):
            change(source, target)
            print(target, flush=True)
            time.sleep(0.02)
        return changed
    os.replace, os.rename = slowly(os.replace), slowly(os.rename)
    t.run(sys.argv[1], t.NEW, True)
"""


@pytest.mark.skipif(os.name != "posix", reason="kills a child process")
@pytest.mark.filterwarnings("ignore::femimpact.app.results.result_directory.ResultsWarning")
# within a part, before and after its summary, between the two renames, and behind them
@pytest.mark.parametrize("steps", [2, 4, 5, 6, 7])
def test_a_killed_process_leaves_old_or_new(tmp_path, steps):
    out = tmp_path / "out"
    run(out, OLD)
    child = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(CHILD), out, Path(__file__).parent], stdout=subprocess.PIPE, text=True
    )
    for _ in range(steps):
        child.stdout.readline()
    child.kill()
    child.communicate()
    with added_results(out):
        pass
    assert value_of(out) in (OLD, NEW)
    run(out, NEW, True)
    assert value_of(out) == NEW
    assert os.listdir(tmp_path) == ["out"]


@pytest.mark.parametrize("earlier", [True, False])
def test_an_error_before_the_first_part_leaves_what_was_there(tmp_path, earlier):
    out = tmp_path / "deep" / "out"
    if earlier:
        run(out, OLD)
    with pytest.raises(KeyboardInterrupt) as caught:
        break_off(out, KeyboardInterrupt(), force=True)
    assert caught.value.__notes__ == ["nothing was written"]
    if earlier:
        assert value_of(out) == OLD
        assert os.listdir(out.parent) == ["out"]
    else:
        assert list(tmp_path.iterdir()) == []


def test_finished_parts_are_kept_beside_earlier_results_and_replaced_by_the_next_run(tmp_path):
    out, part = tmp_path / "out", tmp_path / "out.part"
    run(out, OLD)
    with pytest.raises(KeyboardInterrupt) as caught:
        break_off(out, KeyboardInterrupt(), force=True, value=NEW)
    (note,) = caught.value.__notes__
    assert f"what was finished is kept in {part}" in note
    assert (value_of(out), value_of(part)) == (OLD, NEW)
    with pytest.warns(ResultsWarning, match="removed what a run that did not end well had left in out.part"):
        run(out, NEW, True)
    assert value_of(out) == NEW
    assert os.listdir(tmp_path) == ["out"]


def test_what_is_left_of_a_first_run_is_named(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        break_off(out, KeyboardInterrupt(), value=OLD)
    with pytest.raises(fi.InputError, match=f"what a run that was ended has finished is in {out}.part"):
        fi.load(out)
    with pytest.warns(ResultsWarning, match="removed what a run"):
        # without force: there are no results that could be lost
        run(out, NEW)
    assert value_of(out) == NEW


def test_a_file_that_no_summary_names_is_no_result(tmp_path):
    # of a part that was ended before its summary was written
    run(tmp_path / "out", OLD)
    tables.write_csv(tmp_path / "out" / "impacts.csv", {"value": [NEW]}, {})
    assert value_of(tmp_path / "out") == OLD


def test_a_second_run_into_a_directory_is_refused(tmp_path):
    out = tmp_path / "out"
    with new_results(out) as folder:
        for force in (False, True):
            with (
                pytest.raises(fi.InputError, match=f"output = '{out}': another run is writing into it"),
                new_results(out, force),
            ):
                pytest.fail("must not come here")
        with pytest.raises(fi.InputError, match="a run is writing into it"):
            fi.load(out)
        write_results(folder, NEW)
    assert value_of(out) == NEW
    with added_results(out), pytest.raises(fi.InputError, match="another run is writing"), added_results(out):
        pytest.fail("must not come here")


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="needs a second file system")
def test_results_go_to_the_end_of_a_link(tmp_path):
    # to another file system, which a rename cannot cross from here
    import tempfile

    with tempfile.TemporaryDirectory(dir="/dev/shm") as there:
        (tmp_path / "out").symlink_to(Path(there, "results"))
        run(tmp_path / "out", OLD)
        run(tmp_path / "out", NEW, True)
        assert value_of(tmp_path / "out") == NEW
        assert os.listdir(there) == ["results"]
    with pytest.raises(fi.InputError, match="is a mount point"):
        run("/dev/shm", NEW, True)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_directory_that_is_not_writable_is_one_clear_line(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(fi.InputError, match="cannot be written: Permission denied"):
            run(tmp_path / "other", NEW)
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.parametrize("name", ["notes.txt", "paraview/view.pvsm", "figures/mine.png", "blocks/study.json"])
def test_a_directory_with_a_file_that_is_no_result_is_refused_by_its_name(tmp_path, name):
    out = tmp_path / "out"
    run(out, OLD)
    (out / name).parent.mkdir(exist_ok=True)
    (out / name).write_text("mine")
    with pytest.raises(fi.InputError, match=f"holds {name}, which is no result of a run"):
        run(out, NEW, True)
    assert value_of(out) == OLD
    assert (out / name).read_text() == "mine"


@pytest.mark.skipif(os.name != "posix", reason="needs links")
def test_a_link_in_the_directory_goes_and_what_it_led_to_stays(tmp_path):
    out = tmp_path / "out"
    run(out, OLD)
    for name in ("modes.csv", "paraview/modes"):
        (out / name).rename(tmp_path / Path(name).name)
        (out / name).symlink_to(tmp_path / Path(name).name)

    def led_to():
        return {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file() and out not in path.parents}

    before = led_to()
    run(out, NEW, True)
    assert value_of(out) == NEW
    assert led_to() == before


@pytest.mark.parametrize("suffix", [".part", ".old"])
def test_a_folder_of_the_users_beside_the_directory_is_not_touched(tmp_path, suffix):
    run(tmp_path / "out", OLD)
    os.rename(tmp_path / "out", tmp_path / f"out{suffix}")
    with pytest.raises(fi.InputError, match=f"out{suffix} beside it, .* was made by no run"):
        run(tmp_path / "out", NEW)
    assert value_of(tmp_path / f"out{suffix}") == OLD


def test_the_working_directory_is_refused(tmp_path, monkeypatch):
    (tmp_path / "in").mkdir()
    monkeypatch.chdir(tmp_path / "in")
    for name in (".", "..", tmp_path):
        with pytest.raises(fi.InputError, match="is the working directory, or one above it"):
            run(name, NEW, True)


def test_a_full_disk_names_the_users_path_and_keeps_what_was_finished(tmp_path, monkeypatch):
    out = tmp_path / "out"

    def full(*_arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    def run_into_it():
        with new_results(out) as folder:
            write_results(folder, NEW)
            # of a part that does not get finished
            atomic_write(folder / "sweep.nc", "1")
            monkeypatch.setattr(Path, "write_bytes", full)
            atomic_write(folder / "sweep.csv", "1")

    with pytest.raises(OSError, match="No space left") as caught:
        run_into_it()
    monkeypatch.undo()
    assert caught.value.filename == str(out / "sweep.csv")
    assert f"is kept in {out}.part" in caught.value.__notes__[0]
    assert value_of(tmp_path / "out.part") == NEW


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="needs a limit on the size of files")
def test_a_limit_on_the_size_of_a_file_is_one_error_and_no_crash(tmp_path):
    code = """
        import resource, sys
        from pathlib import Path
        import numpy as np, xarray
        from femimpact.response.history_file import history_writer
        from femimpact.files import write_netcdf
        from femimpact.excitation.harmonic import Sine
        from femimpact.response.history import HistoryPiece
        data = xarray.Dataset({"a": ("t", np.random.default_rng(1).random(100_000))})
        _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        for limit in (0, 1000, 100_000, 400_000):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
            for name in ("a.nc", "b.nc"):
                try:
                    if name == "a.nc":
                        write_netcdf(name, data)
                    else:
                        with history_writer(name) as sink:
                            for k in range(9):
                                time = np.arange(1e4 * k, 1e4 * (k + 1))
                                sink(HistoryPiece(time, {"tip": time}, {"tip": "m"}, None, None, Sine(1.0, 1.0)))
                except OSError as error:
                    print(limit, error.filename, error.strerror, sorted(Path().iterdir()))
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    limits = (0, 1000, 100_000, 400_000)
    assert done.stdout.splitlines() == [f"{n} {name} File too large []" for n in limits for name in ("a.nc", "b.nc")]


def test_the_lock_ends_with_its_process(tmp_path):
    code = "import sys, time; sys.path.insert(0, sys.argv[2]); import test_result_directory as t\n"
    code += "with t.new_results(sys.argv[1]):\n    print('in', flush=True); time.sleep(600)"
    child = subprocess.Popen(
        [sys.executable, "-c", code, tmp_path / "out", Path(__file__).parent], stdout=subprocess.PIPE
    )
    assert child.stdout.readline() == b"in\n"
    with pytest.raises(fi.InputError, match="another run is writing"), new_results(tmp_path / "out"):
        pytest.fail("must not come here")
    child.kill()
    child.communicate()
    run(tmp_path / "out", NEW)
    assert value_of(tmp_path / "out") == NEW


def test_a_lock_that_was_removed_between_opening_and_locking_is_taken_anew(tmp_path, monkeypatch):
    lock_file = result_directory._lock_file
    calls = []

    def removed(file):
        calls.append(file)
        if len(calls) == 1:
            # the run before ended just now
            (tmp_path / ".lock").unlink()
        lock_file(file)

    monkeypatch.setattr(result_directory, "_lock_file", removed)
    with Lock(tmp_path):
        assert len(calls) == 2
        assert (tmp_path / ".lock").exists()
