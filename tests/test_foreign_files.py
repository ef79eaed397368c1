"""What is not a run's own stays: files outside the directory of results, others within it, and what links lead to."""

from __future__ import annotations

import json
import os
import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest
from builders import ResultsWarning, finish_results, paper_study_text
from command import femimpact
from test_result_directory import NEW, OLD, break_off, run, value_of, write_results

import femimpact as fi
from femimpact.app.results.result_directory import prepare_directory, unfinished_state, update_results
from femimpact.app.results.results import write_summary
from femimpact.files import read_csv, write_csv

posix = pytest.mark.skipif(os.name != "posix", reason="needs links and pipes")


def leave(out, **content):
    """A folder of a run as one that was ended leaves it, with more in it: text, or a call that makes it."""
    (out / ".running" / "files").mkdir(parents=True)
    (out / ".running" / "lock").touch()
    for name, made in content.items():
        place = out / ".running" / name.replace("_json", ".json")
        made(place) if callable(made) else place.write_bytes(made)


def one_line(work, words):
    """Do what must be refused in one line."""
    with pytest.raises(fi.InputError, match=words) as caught:
        work()
    assert len(str(caught.value).splitlines()) == 1


def add_a_figure(out):
    with update_results(out) as staging:
        (staging.folder / "modes.png").write_text("new")
        write_summary(staging.folder, fi.load(out).summary, beside=Path(out))


@pytest.mark.parametrize("absolute", [True, False])
def test_no_name_in_a_file_leads_out_of_the_directory(tmp_path, absolute):
    # a journal of an earlier version named what moves where
    (tmp_path / "removed.txt").write_text("mine")
    (tmp_path / "replaced.txt").write_text("mine")
    out = tmp_path / "out"
    before = f"{tmp_path}/" if absolute else "../"
    steps = {"move": [f"{before}replaced.txt"], "remove": [f"{before}removed.txt"]}
    leave(out, journal_json=json.dumps(steps).encode())
    (out / ".running" / "replaced.txt").write_text("not mine")
    (out / ".running" / "files" / "summary.json").write_text("{}")
    one_line(lambda: finish_results(out), "damaged or of another version, and cannot be finished")
    one_line(lambda: run(out, NEW), "run it again with --force")
    one_line(lambda: fi.load(out), "run it again with --force")
    with pytest.warns(ResultsWarning, match="removed what a run that did not end well had left there"):
        run(out, NEW, True)
    assert value_of(out) == NEW
    assert [(tmp_path / name).read_text() for name in ("removed.txt", "replaced.txt")] == ["mine", "mine"]


DAMAGE = {
    "empty": b"",
    "no JSON": b'{"move": ',
    "another type": b"[3]",
    "binary": b"\xff\xfe\x00" * 99,
    "deep": b"[" * 100_000,
    "wrong inside": b'{"parts": [[1]], "files": 3, "move": null, "remove": {"a": 1}}',
    "a folder": lambda place: (place / "deeper").mkdir(parents=True),
    "a pipe": lambda place: os.mkfifo(place),
    "a link": lambda place: place.symlink_to("/dev/zero"),
    "huge": lambda place: (place.touch(), os.truncate(place, 10**11)),
}


@posix
@pytest.mark.parametrize("name", ["journal_json", "finished_json", "finished", "replacing", "moving"])
@pytest.mark.parametrize("kind", DAMAGE)
@pytest.mark.parametrize("earlier", [True, False])
def test_damage_is_one_line_and_force_begins_anew(tmp_path, name, kind, earlier):
    out = tmp_path / "out"
    if earlier:
        run(out, OLD)
    leave(out, **{name: DAMAGE[kind]})
    state = str(unfinished_state(out))
    if (kind, name) == ("a folder", "moving"):
        # a move of which nothing is left to do
        finish_results(out)
    else:
        words = "before its first part was finished" if name == "finished" else "run it again with --force"
        assert words in state
        one_line(lambda: finish_results(out), words)
    if earlier:
        assert value_of(out) == OLD
        one_line(lambda: run(out, NEW), "exists already|run it again with --force")
        with pytest.warns(ResultsWarning, match="removed what") if unfinished_state(out) else nullcontext():
            add_a_figure(out)
        assert value_of(out) == OLD
    left = pytest.warns(ResultsWarning, match="removed what a run that did not end well had left there")
    with left if unfinished_state(out) else nullcontext():
        run(out, NEW, True)
    assert value_of(out) == NEW
    assert not (out / ".running").exists()


@posix
@pytest.mark.parametrize("folder", ["files", "finished", "replacing", "moving", "finished/1 modes", "moving/modes"])
def test_links_in_the_folder_of_a_run_lead_nowhere(tmp_path, folder):
    # to a folder that looks like results of a run
    out, outside = tmp_path / "out", tmp_path / "outside"
    run(outside, OLD)
    run(out, OLD)
    leave(out)
    shutil.rmtree(out / ".running" / "files")
    place = out / ".running" / folder
    place.parent.mkdir(exist_ok=True)
    place.symlink_to(outside / "modes" if folder == "moving/modes" else outside)
    if folder == "moving/modes":
        # a move without files
        finish_results(out)
    else:
        one_line(lambda: finish_results(out), "run it again")
    assert value_of(out) == OLD
    with pytest.warns(ResultsWarning) if unfinished_state(out) else nullcontext():
        run(out, NEW, True)
    assert value_of(outside) == OLD
    assert value_of(out) == NEW


@posix
@pytest.mark.parametrize("name", [".running", ".running/lock"])
def test_a_link_in_the_place_of_a_runs_own_is_refused(tmp_path, name):
    out, outside = tmp_path / "out", tmp_path / "outside"
    (outside / "files").mkdir(parents=True)
    (outside / "lock").write_text("mine")
    (out / name).parent.mkdir(parents=True)
    (out / name).symlink_to(outside if name == ".running" else outside / "missing")
    for work in (lambda: run(out, NEW), lambda: run(out, NEW, True)):
        one_line(work, "holds a .running that no run made: remove it, or choose another")
    one_line(lambda: finish_results(out), "holds no unfinished results")
    assert sorted(path.name for path in outside.iterdir()) == ["files", "lock"]
    assert (outside / "lock").read_text() == "mine"


@posix
def test_a_folder_of_frames_that_is_a_link_is_refused_before_and_after_the_work(tmp_path):
    out, outside = tmp_path / "out", tmp_path / "outside"
    run(out, OLD)
    (out / "modes").rename(outside)
    (out / "modes").symlink_to(outside)
    before = {path.name: path.read_text() for path in outside.iterdir()}
    one_line(lambda: run(out, NEW, True), "holds a link modes, where a folder of the results goes")
    # figures need none
    add_a_figure(out)
    (out / "modes").unlink()

    def linked_meanwhile():
        with prepare_directory(out, True) as staging:
            write_results(staging, NEW)
            (out / "modes").symlink_to(outside)

    one_line(linked_meanwhile, "holds a link modes")
    one_line(lambda: finish_results(out, True), "holds a link modes")
    assert before == {path.name: path.read_text() for path in outside.iterdir()}
    (out / "modes").unlink()
    finish_results(out, True)
    assert value_of(out) == NEW


@posix
def test_a_link_with_the_name_of_a_file_goes_and_what_it_led_to_stays(tmp_path):
    out = tmp_path / "out"
    run(out, OLD)
    for name in ("modes.csv", "sticking.csv", "summary.json"):
        (out / name).rename(tmp_path / name)
        (out / name).symlink_to(tmp_path / name)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    run(out, NEW, True)
    assert value_of(out) == NEW
    assert not (out / "modes.csv").is_symlink()
    assert before == {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}


@pytest.mark.parametrize("mounted", [True, False])
def test_foreign_files_stay_in_the_current_directory_and_on_a_mount_point(tmp_path, monkeypatch, mounted):
    folder = tmp_path / "here"
    folder.mkdir()
    if mounted:
        if not os.path.isdir("/dev/shm"):
            pytest.skip("needs a second file system")
        import tempfile

        folder.rmdir()
        folder.symlink_to(tempfile.mkdtemp(dir="/dev/shm"))
    try:
        out = folder if mounted else "."
        monkeypatch.chdir(folder)
        mine = ("mine.txt", "sub/deep.txt", "modes/view.pvsm", "modes/0001 (copy).vtu", "study.toml", "base_record.csv")
        for name in mine:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text("mine")

        def stay():
            assert {(folder / name).read_text() for name in mine} == {"mine"}
            names = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
            assert set(mine) <= names
            assert not (folder / ".running").exists()

        one_line(lambda: run(out, OLD), "exists already")
        stay()
        run(out, OLD, True)
        stay()
        add_a_figure(out)
        stay()
        run(out, NEW, True)
        stay()
        with pytest.raises(KeyboardInterrupt):
            break_off(out, KeyboardInterrupt(), True, OLD)
        finish_results(out, True)
        stay()
        (folder / "modes" / "view.pvsm").unlink()
        (folder / "modes" / "0001 (copy).vtu").unlink()
        assert value_of(out) == OLD
    finally:
        monkeypatch.undo()
        if mounted:
            shutil.rmtree(folder.resolve())


def test_parts_take_the_place_of_whole_tables_without_a_summary_only_by_force(tmp_path):
    # a convergence study and a table of contacts leave no summary
    def converge(value, error=None):
        with prepare_directory(tmp_path, True) as staging:
            write_csv(staging.folder / "quantities_over_mesh.csv", {"value": [value]}, {})
            staging.finish_part("quantities")
            if error is not None:
                raise error
            write_csv(staging.folder / "runs_over_step.csv", {"value": [value]}, {})
            staging.finish_part("steps")

    converge(OLD)
    with pytest.raises(KeyboardInterrupt) as caught:
        converge(NEW, KeyboardInterrupt())
    assert "the earlier results stay; finished parts (quantities) are kept beside them" in caught.value.__notes__[0]
    one_line(lambda: finish_results(tmp_path), "holds earlier results, which quantities of a later run would replace")
    assert (tmp_path / "runs_over_step.csv").exists()
    assert read_csv(tmp_path / "quantities_over_mesh.csv")["value"] == [OLD]
    assert finish_results(tmp_path, True) == ("quantities",)
    assert read_csv(tmp_path / "quantities_over_mesh.csv")["value"] == [NEW]
    assert not (tmp_path / "runs_over_step.csv").exists()


@posix
def test_every_command_ends_with_one_line_at_damage_and_begins_anew_by_force(tmp_path):
    (tmp_path / "study.toml").write_text(paper_study_text().replace("figures = true", "figures = false"))
    out = tmp_path / "out"
    leave(out, journal_json=b"", finished_json=b"\xff", moving=lambda place: os.mkfifo(place))
    for command in (["modes", "study.toml", "-o", "out"], ["finish", "out"], ["figures", "out"], ["movie", "out"]):
        done = femimpact(*command, cwd=tmp_path, check=False)
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert "its .running is damaged or of another version, and cannot be finished" in line
        assert "run it again with --force" in line
    done = femimpact("modes", "study.toml", "-o", "out", "--force", "-q", cwd=tmp_path)
    (line,) = done.stderr.splitlines()
    assert "removed what a run that did not end well had left there" in line
    assert fi.load(out).modes is not None
