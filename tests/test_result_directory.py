"""The directory of results: whole, old or incomplete, whenever a run is ended, and one run at a time."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from builders import ResultsWarning, finish_results

import femimpact as fi
from femimpact import files
from femimpact.app.results import result_directory
from femimpact.app.results.result_directory import Lock, prepare_directory, unfinished_state, update_results
from femimpact.app.results.results import write_summary
from femimpact.files import atomic_write, write_csv
from femimpact.vtk import formats

OLD, NEW = 1.0, 2.0


def write_results(staging, value):
    """A few files as a run leaves them, all of which tell which run it was."""
    folder = staging.folder
    for name in ("modes.csv", "impacts.csv", "contact_force.png") if value == NEW else ("modes.csv", "sticking.csv"):
        write_csv(folder / name, {"value": [value]}, {})
    # more frames before than after
    texts = (f"{value}" for _ in range(2 if value == NEW else 4))
    formats.write_frames(folder / "modes.pvd", range(2 if value == NEW else 4), texts)
    write_summary(folder, {"value": value})
    staging.finish_part("modes")


def run(directory, value, force=False):
    with prepare_directory(directory, force) as staging:
        write_results(staging, value)


def value_of(directory):
    """Which run the results are of; every file must be of the same."""
    results = fi.load(directory)
    value = results.summary["value"]
    assert results.modes["value"][0] == value
    assert (results.impacts is None) == (results.sticking is not None) == (value == OLD)
    frames = sorted(path.read_text() for path in (Path(directory) / "modes").iterdir())
    assert frames == [str(value)] * (2 if value == NEW else 4)
    return value


def state_of(directory):
    """Which run the results are of, or "incomplete"; and what the error says."""
    try:
        return value_of(directory), ""
    except fi.InputError as error:
        return "incomplete", str(error)


def break_off(directory, error, force=False, value=None):
    """A run that ends with an error, after it has finished a part if a value is given."""
    with prepare_directory(directory, force) as staging:
        if value is None:
            atomic_write(staging.folder / "modes.csv", "half a part")
        else:
            write_results(staging, value)
        raise error


class Killed(BaseException):
    """Ends a process as a signal does: no code of it runs afterwards."""


class Mortal:
    """Counts the changes to the file system, and ends the process before one of them."""

    def __init__(self, monkeypatch, last):
        self.left = last
        for name in ("replace", "rename", "unlink", "rmdir", "mkdir"):
            monkeypatch.setattr(os, name, self.counted(getattr(os, name)))
        # what the kernel does, and nothing of what the process would have removed
        monkeypatch.setattr(Lock, "release", lambda lock: os.close(lock.file))
        monkeypatch.setattr(result_directory, "_drop_unfinished", lambda running: None)

    def counted(self, change):
        """The same change, counted."""

        def changed(*arguments, **options):
            if self.left == 0:
                raise Killed
            self.left -= 1
            return change(*arguments, **options)

        return changed


def kill_at(work, step):
    """Do some work and end the process before a step of it; whether it came so far."""
    with pytest.MonkeyPatch.context() as patch:
        mortal = Mortal(patch, step)
        try:
            work()
        except Killed:
            return True
        assert mortal.left >= 0
        return False


def kill_in_move(directory, step):
    """Run into a directory with earlier results and end the process before a step of the move."""

    def work():
        with prepare_directory(directory, True) as staging:
            write_results(staging, NEW)
            mortal.left = step

    with pytest.MonkeyPatch.context() as patch:
        mortal = Mortal(patch, -1)
        with pytest.raises(Killed):
            work()


@pytest.mark.parametrize("earlier", [True, False])
def test_a_kill_at_any_step_of_a_run_leaves_old_new_or_what_can_be_finished(tmp_path, earlier):
    seen, step = [], 0
    while True:
        out = tmp_path / f"{step}"
        if earlier:
            run(out, OLD)
            (out / "mine.txt").write_text("keep me")
        if not kill_at(lambda out=out: run(out, NEW, earlier), step):
            break
        state, text = state_of(out)
        left = unfinished_state(out) or ""
        moved, finished = "moved in part" in left, "ended after modes" in left
        seen.append("incomplete" if finished and not earlier else state)
        if moved and state == "incomplete":
            assert f"'femimpact finish {out}'" in text
        if moved and len(list(out.iterdir())) > 1:
            # the next run says so, too
            with pytest.raises(fi.InputError, match=f"femimpact finish {out}"):
                run(out, OLD)
        if moved or finished:
            # the name of the part is among the last to go
            assert finish_results(out, force=True) in (("modes",), ())
            assert not (out / ".running").exists()
            assert value_of(out) == NEW
        elif earlier:
            assert value_of(out) in (OLD, NEW)
        else:
            assert state == NEW or [path.name for path in out.glob("*")] in ([".running"], [])
        assert not earlier or (out / "mine.txt").read_text() == "keep me"
        step += 1
    assert value_of(out) == NEW
    # every state was met, and they follow one another
    states = [OLD if earlier else "incomplete", "incomplete", NEW]
    assert sorted(set(seen), key=states.index) == list(dict.fromkeys(states))
    assert seen == sorted(seen, key=states.index)
    assert len(seen) > 40


def test_a_kill_at_any_step_of_an_update_leaves_old_new_or_what_can_be_finished(tmp_path):
    # beside finished parts of a run that was ended, which are not touched
    def update(out):
        with update_results(out) as staging:
            (staging.folder / "modes.png").write_text("new")
            (staging.folder / "deflection.mp4").write_text("new")
            write_summary(staging.folder, fi.load(out).summary | {"drawn": True}, beside=out)

    seen, step = set(), 0
    while True:
        out = tmp_path / f"{step}"
        with prepare_directory(out) as staging:
            write_results(staging, OLD)
            (staging.folder / "deflection.gif").write_text("old")
            write_summary(staging.folder, {"value": OLD}, beside=staging.finished)
        with pytest.raises(KeyboardInterrupt):
            break_off(out, KeyboardInterrupt(), True, NEW)
        killed = kill_at(lambda out=out: update(out), step)
        if "moved in part" in (unfinished_state(out) or ""):
            finish_results(out)
        # its files and its checksums agree: `load` would warn
        assert value_of(out) == OLD
        drawn = fi.load(out).summary.get("drawn", False)
        assert [(out / name).exists() for name in ("modes.png", "deflection.mp4", "deflection.gif")] == [
            drawn, drawn, not drawn,
        ]  # fmt: skip
        seen.add(drawn)
        assert finish_results(out, force=True) == ("modes",)
        assert value_of(out) == NEW
        step += 1
        if not killed:
            break
    assert seen == {False, True}
    assert step > 10


def test_a_summary_is_finished_with_the_files_that_it_names(tmp_path):
    # the summary of a part is written before the part is finished: an end between the two leaves that of the last part
    out = tmp_path / "out"

    def break_off_between():
        with prepare_directory(out) as staging:
            write_results(staging, OLD)
            write_csv(staging.folder / "sticking.csv", {"value": [NEW]}, {})
            write_csv(staging.folder / "sweep.csv", {"value": [NEW]}, {})
            write_summary(staging.folder, {"value": NEW}, beside=staging.finished)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        break_off_between()
    assert finish_results(out) == ("modes",)
    assert value_of(out) == OLD
    assert not (out / "sweep.csv").exists()


def test_files_are_on_disk_before_a_rename_relies_on_them(tmp_path, monkeypatch):
    done = []
    to_disk, rename = result_directory.to_disk, os.rename

    def noted(path):
        to_disk(path)
        done.append(Path(path).name)

    def renamed(source, target):
        if Path(source).name == "files":
            written = list(Path(source).rglob("*"))
            assert written
            assert {path.name for path in written} | {"files"} <= set(done)
        if Path(source).name == "finished":
            assert "finished" in done
        done.clear()
        rename(source, target)
        renames.append(Path(source).name)

    renames = []
    monkeypatch.setattr(result_directory, "to_disk", noted)
    monkeypatch.setattr(files, "to_disk", noted)
    monkeypatch.setattr(os, "rename", renamed)
    run(tmp_path / "out", NEW)
    # the collection of frames renames, too
    assert [name for name in renames if name != "new"] == ["files", "finished", "replacing"]
    done.clear()
    # the directory, before what says that the move is unfinished goes; a single file, before it takes its place
    remove = result_directory.shutil.rmtree
    monkeypatch.setattr(result_directory.shutil, "rmtree", lambda path, **more: (gone.append(list(done)), remove(path)))
    gone = []
    with prepare_directory(tmp_path / "out", True) as staging:
        write_results(staging, NEW)
    assert "out" in gone[-1]
    replace = os.replace

    def replaced(source, target):
        assert Path(source).name in done
        replace(source, target)

    monkeypatch.setattr(os, "replace", replaced)
    atomic_write(tmp_path / "alone.txt", "content")


def test_the_next_run_finishes_an_interrupted_move_and_says_so(tmp_path):
    out = tmp_path / "out"
    run(out, OLD)
    kill_in_move(out, 4)
    # until the new results are complete there are those of the run before
    with pytest.warns(ResultsWarning, match="moved in part; that move is now finished"), prepare_directory(out, True):
        assert value_of(out) == NEW


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
# one in each state of the directory: before and after a part is finished, at the replacement, within it, at the end
@pytest.mark.parametrize("steps", [6, 14, 15, 19, 40])
def test_a_killed_process_leaves_old_new_or_incomplete(tmp_path, steps):
    out = tmp_path / "out"
    run(out, OLD)
    child = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(CHILD), out, Path(__file__).parent], stdout=subprocess.PIPE, text=True
    )
    for _ in range(steps):
        child.stdout.readline()
    child.kill()
    child.communicate()
    state, text = state_of(out)
    assert state != "incomplete" or "femimpact finish" in text
    if "femimpact finish" in (unfinished_state(out) or ""):
        finish_results(out, force=True)
        assert value_of(out) == NEW
    elif unfinished_state(out) is not None:
        # what was not finished goes with the next run
        with pytest.warns(ResultsWarning, match="did not end well"):
            run(out, NEW, True)
    else:
        run(out, NEW, True)
    assert value_of(out) in (OLD, NEW)
    assert not (out / ".running").exists()


def test_an_error_in_the_move_names_the_command_that_finishes_it(tmp_path, monkeypatch):
    out = tmp_path / "out"
    replace = os.replace

    def full(source, target):
        if Path(target) == out / "modes.csv":
            raise OSError(errno.ENOSPC, "No space left on device", source)
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space left") as caught:
        run(out, NEW)
    assert caught.value.filename == str(out / "modes.csv")
    assert f"'femimpact finish {out}'" in caught.value.__notes__[0]
    monkeypatch.undo()
    finish_results(out)
    assert value_of(out) == NEW


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
        assert not (out / ".running").exists()
    else:
        assert list(tmp_path.iterdir()) == []


def test_finished_parts_are_kept_beside_earlier_results_until_they_are_asked_for(tmp_path):
    out = tmp_path / "out"
    run(out, OLD)
    with pytest.raises(KeyboardInterrupt) as caught:
        break_off(out, KeyboardInterrupt(), force=True, value=NEW)
    (note,) = caught.value.__notes__
    assert "the earlier results stay; finished parts (modes) are kept beside them" in note
    assert f"'femimpact finish {out} --force' puts them in their place" in note
    assert value_of(out) == OLD
    # parts of a run do not take the place of a whole one unasked
    with pytest.raises(fi.InputError, match=r"holds earlier results, which modes of a later run would replace"):
        finish_results(out)
    assert value_of(out) == OLD
    assert finish_results(out, force=True) == ("modes",)
    assert value_of(out) == NEW
    with pytest.raises(fi.InputError, match="holds no unfinished results"):
        finish_results(out)


def test_what_a_killed_run_left_is_named_and_removed_by_the_next(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        break_off(out, KeyboardInterrupt(), value=OLD)
    with pytest.raises(fi.InputError, match=f"ended after modes: 'femimpact finish {out}'"):
        fi.load(out)
    with pytest.warns(
        ResultsWarning, match=f"{out}: removed what a run that did not end well had left there, with modes"
    ):
        # without force: there are no results that could be lost
        run(out, NEW)
    assert value_of(out) == NEW


def test_a_second_run_into_a_directory_is_refused(tmp_path):
    out = tmp_path / "out"
    with prepare_directory(out) as staging:
        for force in (False, True):
            with (
                pytest.raises(fi.InputError, match=f"output = '{out}': another run is writing into it"),
                prepare_directory(out, force),
            ):
                pytest.fail("must not come here")
        with pytest.raises(fi.InputError, match="a run is writing into it"):
            fi.load(out)
        with pytest.raises(fi.InputError, match="another run is writing into it"):
            finish_results(out)
        write_results(staging, NEW)
    assert value_of(out) == NEW


def test_the_files_of_a_run_lie_in_its_directory(tmp_path):
    # the same file system, and the only place that the user has named
    out = tmp_path / "out"
    out.mkdir()
    with prepare_directory(out) as staging:
        assert staging.folder.parent.parent == out
        assert [path.name for path in tmp_path.iterdir()] == ["out"]
        write_results(staging, NEW)
    assert value_of(out) == NEW


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="needs a second file system")
def test_results_go_to_a_mount_point(tmp_path):
    # by a symbolic link to a folder of another file system, which os.replace cannot cross from here
    import tempfile

    with tempfile.TemporaryDirectory(dir="/dev/shm") as there:
        (tmp_path / "out").symlink_to(there)
        run(tmp_path / "out", NEW)
        assert value_of(tmp_path / "out") == NEW


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_directory_that_is_not_writable_is_one_clear_line(tmp_path):
    (tmp_path / "out").mkdir()
    tmp_path.chmod(0o500)
    try:
        run(tmp_path / "out", NEW)
        with pytest.raises(fi.InputError, match="cannot be written: Permission denied"):
            run(tmp_path / "other", NEW)
    finally:
        tmp_path.chmod(0o700)


def test_files_that_stand_in_the_way_are_found_before_the_work(tmp_path):
    (tmp_path / "sweep.nc").mkdir()
    with pytest.raises(fi.InputError, match=r"holds a folder sweep.nc"), prepare_directory(tmp_path, force=True):
        pytest.fail("must not come here")
    (tmp_path / "sweep.nc").rmdir()
    (tmp_path / "modes").write_text("mine")
    with pytest.raises(fi.InputError, match="holds a file modes"), prepare_directory(tmp_path, force=True):
        pytest.fail("must not come here")


def test_a_folder_of_frames_keeps_other_files(tmp_path):
    run(tmp_path / "out", OLD)
    (tmp_path / "out" / "modes" / "view.pvsm").write_text("mine")
    run(tmp_path / "out", NEW, True)
    names = sorted(path.name for path in (tmp_path / "out" / "modes").iterdir())
    assert names == ["0000.vtu", "0001.vtu", "view.pvsm"]


def test_a_hidden_folder_of_somebody_else_is_not_touched(tmp_path):
    (tmp_path / ".running").mkdir()
    (tmp_path / ".running" / "precious").write_text("mine")
    with pytest.raises(fi.InputError, match="no run made"), prepare_directory(tmp_path):
        pytest.fail("must not come here")
    assert (tmp_path / ".running" / "precious").read_text() == "mine"


def test_a_full_disk_names_the_users_path_and_keeps_what_was_finished(tmp_path, monkeypatch):
    out = tmp_path / "out"

    def full(*_arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    def run_into_it():
        with prepare_directory(out) as staging:
            write_results(staging, NEW)
            # of a part that does not get finished
            atomic_write(staging.folder / "sweep.nc", "1")
            monkeypatch.setattr(Path, "write_bytes", full)
            atomic_write(staging.folder / "sweep.csv", "1")

    with pytest.raises(OSError, match="No space left") as caught:
        run_into_it()
    monkeypatch.undo()
    assert caught.value.filename == str(out / "sweep.csv")
    assert "finished parts (modes) are kept" in caught.value.__notes__[0]
    finish_results(out)
    assert value_of(out) == NEW
    assert not (out / "sweep.nc").exists()


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="needs a limit on the size of files")
def test_a_limit_on_the_size_of_a_file_is_one_error_and_no_crash(tmp_path):
    code = """
        import resource, sys
        from pathlib import Path
        import numpy as np, xarray
        from femimpact.response.history_file import history_writer
        from femimpact.files import write_netcdf
        from femimpact.excitation import Sine
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
    code += "with t.prepare_directory(sys.argv[1]):\n    print('in', flush=True); time.sleep(600)"
    child = subprocess.Popen(
        [sys.executable, "-c", code, tmp_path / "out", Path(__file__).parent], stdout=subprocess.PIPE
    )
    assert child.stdout.readline() == b"in\n"
    with pytest.raises(fi.InputError, match="another run is writing"), prepare_directory(tmp_path / "out"):
        pytest.fail("must not come here")
    child.kill()
    child.communicate()
    with pytest.warns(ResultsWarning, match="removed what a run that did not end well"):
        run(tmp_path / "out", NEW)
    assert value_of(tmp_path / "out") == NEW


def test_a_lock_that_was_removed_between_opening_and_locking_is_taken_anew(tmp_path, monkeypatch):
    lock_file = result_directory._lock_file
    calls = []

    def removed(file):
        calls.append(file)
        if len(calls) == 1:
            # the run before ended just now and removed its folder
            (tmp_path / ".running" / "lock").unlink()
            (tmp_path / ".running").rmdir()
        lock_file(file)

    monkeypatch.setattr(result_directory, "_lock_file", removed)
    run(tmp_path, NEW)
    assert len(calls) == 2
    assert value_of(tmp_path) == NEW


def test_sticking_phases_of_an_earlier_version_are_read(tmp_path):
    with prepare_directory(tmp_path / "results", force=False) as staging:
        write_csv(staging.folder / "modes.csv", {"value": [1.0]}, {})
        write_csv(staging.folder / "riding.csv", {"start": [0.25]}, {"start": "s"})
        write_summary(staging.folder, {})
        staging.finish_part("modes")
    results = fi.load(tmp_path / "results")
    assert results.sticking["start"] == [0.25]
    assert results.riding is results.sticking
