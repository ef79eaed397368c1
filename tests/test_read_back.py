"""What a study's directory holds may be damaged or moved: it is named and run again, or gives the same dataset."""

from __future__ import annotations

import itertools
import shutil
import warnings

import pytest
from test_study_blocks import GAP, RESTITUTION, study

import femimpact as fi
from femimpact.app.parametric.dataset import BLOCKS

pytestmark = pytest.mark.impacts

MANIFEST = "study.json"
GRID = {GAP: [2e-3, (3e-3, 4e-3)], "base.start": ["base", "space"]}
CASES = [{GAP: 2e-3, RESTITUTION: 0.5}, {GAP: 3e-3, RESTITUTION: 0.7}, {GAP: 2e-3, RESTITUTION: 0.7}]


def run(directory, axes=GRID):
    """A study of a few cases with a measure that is a number and one that is a word, from two starts."""
    return fi.parameter_study(study(), axes, ["peak", "regime"], cycles=3, starts=2, directory=directory)


@pytest.fixture(scope="module", params=["grid", "list"])
def whole(request, tmp_path_factory):
    """A finished study: its directory, its axes, its dataset."""
    axes = GRID if request.param == "grid" else CASES
    directory = tmp_path_factory.mktemp(request.param)
    return directory, axes, run(directory, axes)


@pytest.fixture
def copied(whole, tmp_path):
    directory, axes, dataset = whole
    shutil.copytree(directory, tmp_path / "study")
    return tmp_path / "study", axes, dataset


def loaded(directory):
    """The dataset in a directory, and what is warned of."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        dataset = fi.app.load_parameter_study(directory)
    return dataset, [str(one.message) for one in found]


def test_every_flipped_bit_of_a_block_is_found(copied):
    directory, axes, dataset = copied
    (block,) = (directory / BLOCKS).glob("*.block")
    content = block.read_bytes()
    for place, bit in itertools.product(range(0, len(content), 29), (0, 5)):
        flipped = bytearray(content)
        flipped[place] ^= 1 << bit
        block.write_bytes(flipped)
        found, lines = loaded(directory)
        assert not found["finished"].any(), place
        assert lines == [
            f"{block} is damaged (its checksum is that of another content): its cases count as not finished"
        ]
    assert run(directory, axes).identical(dataset)
    assert block.read_bytes() == content


def test_a_block_that_cannot_be_read_is_run_again(copied):
    directory, axes, dataset = copied
    (block,) = (directory / BLOCKS).glob("*.block")
    block.unlink()
    block.symlink_to(block.name)
    assert "is damaged (it cannot be read: " in loaded(directory)[1][0]
    assert run(directory, axes).identical(dataset)


def test_a_study_that_is_moved_to_another_folder_goes_on_there(copied, tmp_path, capfd):
    directory, axes, dataset = copied
    moved = directory.rename(tmp_path / "moved")
    assert loaded(moved)[0].identical(dataset)
    capfd.readouterr()
    assert run(moved, axes).identical(dataset)
    assert capfd.readouterr().err == f"found {dataset['peak'].size} of {dataset['peak'].size} finished\n"


# ---- what the study is -----------------------------------------------------------------------------

TEXTS = [b"null", b"[]", b"3", b'"x"', b"{}", b"", b"{", b"[" * 100_000, b"1" * 5000, b"\0", b"\xff\xfe\xfa"]


def test_a_study_file_that_is_none_is_named_and_written_again(copied, capfd):
    directory, axes, dataset = copied
    manifest = directory / BLOCKS / MANIFEST
    content = manifest.read_bytes()
    for text in TEXTS:
        manifest.write_bytes(text)
        with pytest.raises(fi.InputError) as caught:
            fi.app.load_parameter_study(directory)
        (line,) = str(caught.value).splitlines()
        assert f"directory = {str(directory)!r}: holds a {BLOCKS}/{MANIFEST} that is damaged (" in line, text
    capfd.readouterr()
    assert run(directory, axes).identical(dataset)
    said = capfd.readouterr().err.splitlines()
    assert f"{BLOCKS}/{MANIFEST} is damaged (" in said[0]
    assert said[1].startswith("found ")
    assert len(said) == 2
    assert manifest.read_bytes() == content


def test_a_digit_changed_in_the_table_of_an_axis_is_found(copied):
    directory, axes, dataset = copied
    manifest = directory / BLOCKS / MANIFEST
    content = manifest.read_bytes()
    at = content.index(b"0.002")
    manifest.write_bytes(content[:at] + b"0.003" + content[at + 5 :])
    words = r"study.json that is damaged \(its checksum is that of another content\): run the same study again"
    with pytest.raises(fi.InputError, match=words):
        fi.app.load_parameter_study(directory)
    assert run(directory, axes).identical(dataset)
    assert manifest.read_bytes() == content


def test_every_flipped_bit_of_the_study_file_is_found_or_changes_nothing(copied):
    directory, _, dataset = copied
    manifest = directory / BLOCKS / MANIFEST
    content = manifest.read_bytes()
    for place, bit in itertools.product(range(0, len(content), 17), (0, 5)):
        flipped = bytearray(content)
        flipped[place] ^= 1 << bit
        manifest.write_bytes(flipped)
        try:
            found = fi.app.load_parameter_study(directory)
        except fi.InputError:
            continue
        assert found.identical(dataset), place


def test_a_damaged_study_file_with_blocks_of_another_study_is_left_as_it_is(copied):
    directory, axes, _ = copied
    manifest = directory / BLOCKS / MANIFEST
    manifest.write_text("{}")
    with pytest.raises(fi.InputError, match=r"damaged \(its checksum is that of another content\)"):
        fi.parameter_study(study(), axes, ["rms"], cycles=3, directory=directory)
    assert manifest.read_text() == "{}"
