"""Damaged results: a file that cannot be read is our error, a changed one a warning; never a raw error."""

from __future__ import annotations

import json
import shutil
import warnings

import numpy as np
import pytest
from builders import ResultFileWarning

import femimpact as fi

FILES = ("summary.json", "modes.csv", "impacts.csv", "sweep.nc", "history.nc", "impacts.nc")


@pytest.fixture
def results(finished, tmp_path):
    return shutil.copytree(finished / "out", tmp_path / "out")


def damaged(data, other, kind, random):
    """Bytes of a file after an accident, or None where it is gone."""
    place = int(random.integers(len(data)))
    if kind == "truncated":
        return data[:place]
    if kind == "one bit":
        return data[:place] + bytes([data[place] ^ 1 << int(random.integers(8))]) + data[place + 1 :]
    if kind == "noise":
        return data[:place] + random.bytes(60) + data[place + 60 :]
    if kind == "zeros":
        return data[:place] + bytes(len(data[place : place + 4096])) + data[place + 4096 :]
    return {"swapped": other, "empty": b"", "deleted": None}[kind]


@pytest.mark.parametrize("kind", ["truncated", "one bit", "noise", "zeros", "swapped", "empty", "deleted"])
def test_damage_is_our_error_or_a_warning_and_names_the_file(results, kind):
    random = np.random.default_rng(len(kind))
    for name in FILES:
        whole = (results / name).read_bytes()
        for _ in range(2 if kind in ("truncated", "one bit", "noise", "zeros") else 1):
            content = damaged(whole, (results / FILES[FILES.index(name) - 1]).read_bytes(), kind, random)
            if content is None:
                (results / name).unlink()
            else:
                (results / name).write_bytes(content)
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                try:
                    fi.load(results)
                    said = [str(warning.message) for warning in told if warning.category is ResultFileWarning]
                    assert content == whole or any(name in text for text in said)
                except fi.InputError as error:
                    # of a file that took the place of the summary, no name is known
                    said = str(error)
                    assert name in said or name == "summary.json"
                    assert len(said.splitlines()) == 1
        (results / name).write_bytes(whole)
    fi.load(results)


def test_results_without_checksums_still_load(results):
    summary = json.loads((results / "summary.json").read_text())
    for key in ("checksums", "checksum"):
        del summary[key]
    (results / "summary.json").write_text(json.dumps(summary))
    assert fi.load(results).sweep is not None
    (results / "sweep.nc").write_bytes(b"not netCDF")
    with pytest.raises(fi.InputError, match=r"sweep.nc': is damaged and cannot be read"):
        fi.load(results)


def test_a_changed_number_is_a_warning(results):
    text = (results / "modes.csv").read_text()
    assert "\n4,462." in text
    (results / "modes.csv").write_text(text.replace("\n4,462.", "\n4,463.", 1))
    with pytest.warns(ResultFileWarning, match=r"modes.csv: is not as the study left it"):
        fi.load(results)
    (results / "modes.csv").write_text(text)
    text = (results / "summary.json").read_text()
    (results / "summary.json").write_text(text.replace('"method": "newmark"', '"method": "newmarc"'))
    with pytest.warns(ResultFileWarning, match=r"summary.json: is not as the study left it"):
        fi.load(results)


@pytest.mark.parametrize("name", ["sweep.csv", "modes.nc", "study.toml"])
def test_lost_or_changed_files_that_load_does_not_read_are_a_warning(results, name):
    path = results / name
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.warns(ResultFileWarning, match=f"{name}: is not as the study left it"):
        fi.load(results)
    path.unlink()
    with pytest.warns(ResultFileWarning, match=f"missing, though summary.json names them among the results: {name}"):
        fi.load(results)
