"""The text of a record: every way of writing it gives the same numbers, whatever is read at once."""

from __future__ import annotations

import numpy as np
import pytest

import femimpact as fi
from femimpact.excitation import columns

TIME = np.arange(40) / 64.0
SAMPLES = np.random.default_rng(3).standard_normal(40)
ROWS = [(f"{t:.6f}", f"{a:.12e}") for t, a in zip(TIME, SAMPLES, strict=True)]
EXACT = np.array([float(a) for _, a in ROWS])

WAYS = {
    "commas": lambda t, a: f"{t},{a}",
    "semicolons": lambda t, a: f"{t};{a}",
    "decimal commas": lambda t, a: f"{t};{a}".replace(".", ","),
    "tabulators": lambda t, a: f"{t}\t{a}",
    "decimal commas, tabulators": lambda t, a: f"{t}\t{a}".replace(".", ","),
    "spaces": lambda t, a: f"  {t}   {a} ",
    "blanks beside commas": lambda t, a: f" {t} , {a} ",
    "quoted": lambda t, a: f'"{t}","{a}"',
    "quoted decimal commas": lambda t, a: f'"{t}";"{a}"'.replace(".", ","),
    "quoted, with blanks": lambda t, a: f' "{t}" , "{a}" ',
    "more columns": lambda t, a: f"{t},{a},x,",
    "plus signs": lambda t, a: f"+{t},{a}",
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("piece", [1, 100, 1 << 23])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_every_way_of_writing_gives_the_same_samples(tmp_path, monkeypatch, way, piece, end):
    monkeypatch.setattr(columns, "PIECE", piece)
    lines = ["time,base", "# a remark", "", *(WAYS[way](*row) for row in ROWS), "  ", "# 1,2"]
    if way == "commas":
        # the first mark counts, line by line
        lines[20] = lines[20].replace(",", ";")
    path = tmp_path / "a.csv"
    path.write_bytes(end.join(lines).encode("utf-8-sig"))
    base = fi.RecordedBase.from_csv(path)
    assert base.samples.tolist() == EXACT.tolist()
    assert base.interval == pytest.approx(1 / 64.0, rel=1e-12)
    assert fi.RecordedBase.from_text("\n".join(lines)).samples.tolist() == EXACT.tolist()


@pytest.mark.parametrize("cell", ["1_0", "1e", "0x10", "\uff11", "1d3", "1.5abc", "infinity", "1.2.3", "1 5", ""])
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_what_is_no_decimal_number_is_refused_with_its_line(cell, mark):
    lines = [f"{t}{mark}{a}" for t, a in ROWS]
    lines[30] = f"{ROWS[30][0]}{mark}{cell}"
    with pytest.raises(fi.InputError, match=r"line 31, column 1: [a-z ]+ is no finite number"):
        fi.RecordedBase.from_text("\n".join(lines))


def test_a_decimal_comma_among_commas_is_refused_and_a_remark_is_not():
    lines = [f"{t},{a}" for t, a in ROWS]
    lines[30] = f"{ROWS[30][0]},1,5"
    with pytest.raises(fi.InputError, match=r"line 31: a number, '5', behind the 2 cells of the first row"):
        fi.RecordedBase.from_text("\n".join(lines))
    for row in (f"{ROWS[30][0]},1.5,the door was shut", f"{ROWS[30][0]};1,5"):
        lines[30] = row
        assert fi.RecordedBase.from_text("\n".join(lines)).samples[30] == 1.5


def test_more_lines_than_are_read_are_refused_before_they_are_read(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(f"{t},{a}" for t, a in ROWS) + "\n")
    monkeypatch.setattr(columns, "MOST_LINES", 40)
    assert fi.RecordedBase.from_csv(path).samples.size == 40
    monkeypatch.setattr(columns, "MOST_LINES", 39)
    monkeypatch.setattr(columns, "_decoded", lambda _: pytest.fail("it is read"))
    with pytest.raises(fi.InputError, match="has 40 lines, of which at most 39 are read"):
        fi.RecordedBase.from_csv(path)


@pytest.mark.parametrize("size", [2, 3, 1000])
def test_the_line_of_least_squares_is_removed(size):
    # an independent computation, by numpy's polynomials; rounding is some 1e-13 of the largest sample
    time, samples = np.arange(size) / 8.0, 5.0 + np.random.default_rng(size).standard_normal(size).cumsum()
    text = "\n".join(f"{t!r},{a!r}" for t, a in zip(time.tolist(), samples.tolist(), strict=True))
    straight = np.polynomial.Polynomial.fit(time, samples, 1)(time)
    left = fi.RecordedBase.from_text(text, detrend="line").samples
    assert left == pytest.approx(samples - straight, abs=1e-11 * np.abs(samples).max())
    left = fi.RecordedBase.from_text(text, detrend="mean").samples
    assert left == pytest.approx(samples - samples.mean(), abs=1e-13 * np.abs(samples).max())


@pytest.mark.parametrize("header", ["time [s],tip [mm],time [s],acc [g]", "t [s],tip [mm],time_ms,acc [g]"])
def test_a_time_beside_each_channel_is_left_out_but_for_the_first(header, tmp_path):
    path = tmp_path / "scope.csv"
    path.write_text(header + "\n" + "".join(f"{k / 100},{k * k},{k / 100},{k % 7}\n" for k in range(30)))
    found = fi.read_record(path)
    assert list(found.data_vars) == ["tip", "acc"]
    assert any("is left out: a further time" in note for note in found.attrs["notes"])
    assert fi.read_record(path, columns=[0, 3])["acc"].attrs["units"] == "m/s^2"


def test_a_signal_of_the_name_of_the_time_is_refused(tmp_path):
    path = tmp_path / "scope.csv"
    path.write_text("time [s],tip,time [s]\n" + "".join(f"{k / 100},{k * k},{k}\n" for k in range(30)))
    with pytest.raises(fi.InputError, match="none of the name of the time"):
        fi.read_record(path, columns=[0, 2])
