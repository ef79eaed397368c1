"""What a study's directory holds may have a right checksum and be none of its own: it is named, and run again."""

from __future__ import annotations

import hashlib
import io
import itertools
import json
import shutil
import warnings
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from test_study_blocks import GAP, RESTITUTION, study

import femimpact as fi
from femimpact.parametric.block_files import BLOCKS

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


# ---- blocks ----------------------------------------------------------------------------------------


def with_hash(payload: bytes) -> bytes:
    return hashlib.sha256(payload).hexdigest().encode() + b"\n" + payload


def packed(arrays: dict[str, Any], words: Any, save: Callable[..., None] = np.savez) -> bytes:
    """A block of some arrays and words."""
    text = words if isinstance(words, bytes) else json.dumps(words).encode()
    out = io.BytesIO()
    save(out, **{"words": np.frombuffer(text, dtype=np.uint8), **arrays})
    return out.getvalue()


def member(name: str, content: bytes, others: dict[str, bytes]) -> bytes:
    """A file of arrays with one member's bytes in place of its own."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for own, text in {**others, name: content}.items():
            archive.writestr(own, text)
    return out.getvalue()


def crafted_blocks(content: bytes) -> Iterator[tuple[str, bytes]]:
    """Contents of a block that are none of it, by what is wrong."""
    payload = content.partition(b"\n")[2]
    with np.load(io.BytesIO(payload)) as found:
        arrays = {name: found[name] for name in found.files}
    words = json.loads(arrays.pop("words").tobytes())
    with zipfile.ZipFile(io.BytesIO(payload)) as archive:
        members = {one: archive.read(one) for one in archive.namelist()}
    cases, values, periodic = arrays["cases"], arrays["values"], arrays["periodic"]
    count = periodic.size
    failed = {**words, "failures": ["why", *words["failures"][1:]]}
    others = {
        "cases": [cases + 10**6, cases - 10**6, -cases - 1, cases * 0, cases.astype(float), cases.astype(np.int32),
                  cases[:0], cases[:1], cases[::-1], np.append(cases, 99), cases[:, None], np.int64(3),
                  cases.astype("U9"),
                  cases.astype("datetime64[s]"), cases.astype(complex), cases.astype(np.uint64), cases > 0,
                  cases.astype(">i8")],
        "values": [values[0], values[:-1], values[:, :1], values[:, :, :1], values.astype(np.float32), values.T,
                   np.nan_to_num(values).astype(int), values.astype(complex), values.astype("U30"), values[None],
                   np.concatenate([values, values], axis=2), np.zeros_like(values), values.astype("S9"),
                   values[:, :, :0],
                   np.float64(1.0), values.astype(">f8"), np.zeros(values.shape, dtype=[("a", float)]), values[:0]],
        "periodic": [periodic.astype(int), periodic.astype(float), periodic[0], periodic[:, :1], periodic[None],
                     periodic.astype("U5"), ~periodic[:-1], np.bool_(True), periodic.ravel()],
    }  # fmt: skip
    for name, rows in others.items():
        for row in rows:
            yield f"{name} of {np.asarray(row).dtype} {np.shape(row)}", packed({**arrays, name: row}, words)
        yield f"no {name}", packed({key: value for key, value in arrays.items() if key != name}, words)
        yield f"{name} as objects", packed({**arrays, name: np.array([None, {}], dtype=object)}, words)
    yield "one array more", packed({**arrays, "more": cases}, words)
    texts: dict[str, Any] = {
        "key": [None, 3, "", "0" * 64, words["key"][:-1], [words["key"]]],
        "failures": [None, "", "x" * count, {}, [], [None] * count, [0] * count, words["failures"][1:],
                     [*words["failures"], ""], [[""]] * count, 3],
        "words": [None, [], {}, "regime", {"regime": None}, {"regime": ""}, {"regime": "x" * count}, {"regime": []},
                  {"regime": [None] * count}, {"regime": [1] * count}, {"other": words["words"]["regime"]},
                  {**words["words"], "peak": [""] * count}, {"regime": words["words"]["regime"][1:]}],
    }  # fmt: skip
    for name, given in texts.items():
        for value in given:
            yield f"{name} = {value!r:.40}", packed(arrays, {**words, name: value})
        yield f"no {name}", packed(arrays, {key: value for key, value in words.items() if key != name})
    yield "a failure with values", packed({**arrays, "values": np.where(np.isnan(values), values, 1.0)}, failed)
    for text in (b"", b"null", b"[]", b"3", b'"x"', b"{", b"\xff\xfe", b"[" * 100_000, b"1" * 5000):
        yield f"words of {text[:9]!r}", packed(arrays, text)
    yield "words as numbers", packed({**arrays, "words": np.zeros(9)}, words)
    header = members["cases.npy"]
    for label, text in {
        "cases of 10^15": header[:10] + header[10:].replace(b"(%d,)" % cases.size, b"(1000000000000000,)", 1),
        "cases of -1": header.replace(b"(%d,)" % cases.size, b"(-1,)"),
        "no header": b"", "a header cut": header[:30], "no numbers": header[:-8], "a pickle": b"\x80\x04N.",
        "a header that is code": header.replace(b"False", b"exit("), "version 9": header[:6] + b"\x09" + header[7:],
    }.items():  # fmt: skip
        yield label, member("cases.npy", text, members)
    yield "packed", packed(arrays, words, np.savez_compressed)
    yield "a bomb", packed({**arrays, "values": np.zeros((10**6, 2))}, words, np.savez_compressed)
    for label, text in {"nothing": b"", "text": b"x" * 99, "an array": header, "half": payload[: len(payload) // 2],
                        "no end": payload[:-22], "a pickle": b"\x80\x04N.", "zeros": b"\0" * 200}.items():  # fmt: skip
        yield label, text


def loaded(directory):
    """The dataset in a directory, and what is warned of."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        dataset = fi.load_parameter_study(directory)
    return dataset, [str(one.message) for one in found]


def test_a_block_with_a_right_checksum_and_a_wrong_content_is_named_and_run_again(copied, capfd):
    directory, axes, dataset = copied
    (block,) = (directory / BLOCKS).glob("*.block")
    content = block.read_bytes()
    crafted = list(crafted_blocks(content))
    assert len(crafted) >= 60
    for number, (label, payload) in enumerate(crafted):
        block.write_bytes(with_hash(payload))
        found, lines = loaded(directory)
        assert not found["finished"].any(), label
        assert len(lines) == 1, label
        assert len(lines[0].splitlines()) == 1, label
        assert f"{block} is damaged (" in lines[0], label
        # what is refused is run again: of some of them it is seen that the bits are the same
        if number % 30 == 0:
            capfd.readouterr()
            assert run(directory, axes).identical(dataset), label
            said = capfd.readouterr().err.splitlines()
            assert len(said) == 1, label
            assert f"{BLOCKS}/{block.name} is damaged (" in said[0], label
            assert block.read_bytes() == content, label
    run(directory, axes)
    assert loaded(directory)[0].identical(dataset)


def test_a_block_that_cannot_be_read_is_run_again(copied):
    directory, axes, dataset = copied
    (block,) = (directory / BLOCKS).glob("*.block")
    block.unlink()
    block.symlink_to(block.name)
    assert "is damaged (it cannot be read: " in loaded(directory)[1][0]
    assert run(directory, axes).identical(dataset)


# ---- what the study is -----------------------------------------------------------------------------

WRONG = [None, True, 3, -1, 0, 1.5, 1e300, 10**15, "", "x", [], {}, [None], ["x"], [10**15], [[1, 2, 3]], {"x": 1}]


def changed(plain: Any, path: tuple[Any, ...], value: Any) -> Any:
    """A copy of plain data with another value, or without one, at a path."""
    found = json.loads(json.dumps(plain))
    inner = found
    for key in path[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return found


def crafted_manifests(plain: dict[str, Any]) -> Iterator[tuple[str, bytes]]:
    """Contents of a study's file that are none of its own, by what is wrong: each with a right checksum."""
    paths: list[tuple[Any, ...]] = [
        ("key",), ("study",), ("table",), *(("table", name) for name in plain["table"]),
        *(("table", "axes", 0, name) for name in plain["table"]["axes"][0]), ("table", "axes", 0, "levels", 0),
        *(("table", "measures", 0, name) for name in plain["table"]["measures"][0]), ("table", "shape", 0),
        ("table", "axes", 0), ("table", "measures", 0), ("table", "attributes", "starts"),
        *(("study", name) for name in ("axes", "order", "starts", "measures", "cases")),
    ]  # fmt: skip
    if not plain["table"]["is_grid"]:
        paths.append(("table", "axes", 0, "codes", 0))
    for number, path in enumerate(paths):
        old = plain
        for key in path:
            old = old[key]
        # any text may be a name or a unit
        words = path[-1] in ("unit", "words", "distribution") and path[1] != "attributes"
        code = path[-2:-1] == ("codes",)
        for value in (*WRONG[number % 4 :: 4], ...):
            same = type(value) is type(old) and value == old
            if same or (words and isinstance(value, str)) or (code and type(value) is int and value in (0, 1)):
                continue
            if path == ("study", "cases") and not plain["table"]["is_grid"]:
                # the hashes of another list of cases are those of another study
                continue
            # a name that a function of the user's own may have
            named = path[-1] == "name" or path[:2] == ("table", "attributes")
            if named and isinstance(value, str) and path[-1] != "starts":
                continue
            yield f"{'.'.join(map(str, path))} = {value!r:.30}", signed(changed(plain, path, value))
    yield "twice an axis", signed(changed(plain, ("table", "axes"), plain["table"]["axes"][:1] * 2))
    yield "twice a measure", signed(changed(plain, ("table", "measures"), plain["table"]["measures"][:1] * 2))
    yield "one key more", signed({**plain, "more": 1})
    for text in ("null", "[]", "3", '"x"', "{}", "", "{", "[" * 100_000, "1" * 5000, "\0", '{"key": "x"}'):
        yield f"text {text[:12]!r}", text.encode()
    yield "another encoding", b"\xff\xfe\xfa"


def signed(plain: Any) -> bytes:
    """Plain data with their checksum, as a study writes them."""
    text = json.dumps(plain, sort_keys=True)
    return json.dumps({"sha256": hashlib.sha256(text.encode()).hexdigest(), **plain}).encode()


def plain_of(path) -> dict[str, Any]:
    plain = json.loads(path.read_bytes())
    del plain["sha256"]
    return plain


def test_a_study_file_with_a_right_checksum_and_a_wrong_content_is_named_and_written_again(copied, capfd):
    directory, axes, dataset = copied
    manifest = directory / BLOCKS / MANIFEST
    content = manifest.read_bytes()
    crafted = list(crafted_manifests(plain_of(manifest)))
    assert len(crafted) >= 80
    # the test makes checksums as the study does
    assert signed(plain_of(manifest)) == content
    for number, (label, text) in enumerate(crafted):
        manifest.write_bytes(text)
        with pytest.raises(fi.InputError) as caught:
            fi.load_parameter_study(directory)
        (line,) = str(caught.value).splitlines()
        assert f"directory = {str(directory)!r}: holds a {BLOCKS}/{MANIFEST} that is damaged (" in line, label
        if number % 40 == 0:
            capfd.readouterr()
            assert run(directory, axes).identical(dataset), label
            said = capfd.readouterr().err.splitlines()
            assert len(said) == 2, label
            assert f"{BLOCKS}/{MANIFEST} is damaged (" in said[0], label
            assert said[1].startswith("found "), label
            assert manifest.read_bytes() == content, label


def test_a_digit_changed_in_the_table_of_an_axis_is_found(copied):
    directory, axes, dataset = copied
    manifest = directory / BLOCKS / MANIFEST
    content = manifest.read_bytes()
    at = content.index(b"0.002", content.index(b'"levels"'))
    manifest.write_bytes(content[:at] + b"0.003" + content[at + 5 :])
    words = r"study.json that is damaged \(its checksum is that of another content\): run the same study again"
    with pytest.raises(fi.InputError, match=words):
        fi.load_parameter_study(directory)
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
            found = fi.load_parameter_study(directory)
        except fi.InputError:
            continue
        assert found.identical(dataset), place


def test_a_directory_of_an_earlier_version_has_no_checksum_and_gains_one(copied):
    directory, axes, dataset = copied
    manifest = directory / BLOCKS / MANIFEST
    content, plain = manifest.read_bytes(), plain_of(manifest)
    manifest.write_text(json.dumps(plain))
    found, lines = loaded(directory)
    assert found.identical(dataset)
    assert not lines
    # the table is held to the study beside it
    manifest.write_text(json.dumps(changed(plain, ("table", "axes", 0, "levels", 0), 2.5e-3)))
    with pytest.raises(fi.InputError, match=r"damaged \(table has other axes than study"):
        fi.load_parameter_study(directory)
    assert run(directory, axes).identical(dataset)
    assert manifest.read_bytes() == content


def test_a_damaged_study_file_with_blocks_of_another_study_is_left_as_it_is(copied):
    directory, axes, _ = copied
    manifest = directory / BLOCKS / MANIFEST
    manifest.write_text("{}")
    with pytest.raises(fi.InputError, match=r"damaged \(the file must have key, study, table alone"):
        fi.parameter_study(study(), axes, ["rms"], cycles=3, directory=directory)
    assert manifest.read_text() == "{}"
