"""Records with units: what a header says is applied, said, compared or refused."""

import os
import warnings
from contextlib import suppress

import numpy as np
import pytest

import femimpact as fi
from femimpact.excitation import record_files
from femimpact.excitation.columns import record_text

ROWS = "".join(f"{0.01 * i:.2f},{np.cos(i):.5f}\n" for i in range(20))
VALUES = np.array([round(np.cos(i), 5) for i in range(20)])
GERMAN = ROWS.replace(",", ";").replace(".", ",")
HEADERS = ["time,tip\ns,mm\n", "time [s],tip [mm]\n", "# time (s), tip (mm)\n", "s,mm\n", "[s],[mm]\n", "t,tip (mm)\n"]


def written(tmp_path, text, name="record.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("header", HEADERS)
def test_units_of_a_header_are_applied_and_said(tmp_path, header):
    found = fi.read_record(written(tmp_path, header + ROWS))
    (name,) = found.data_vars
    assert found[name].attrs["units"] == "m"
    # one rounding of the product
    np.testing.assert_allclose(found[name], 1e-3 * VALUES, rtol=1e-15)
    assert any("in mm, taken as 0.001 m" in note for note in found.attrs["notes"])


def test_decimal_commas_words_and_a_trailing_mark(tmp_path):
    text = "Messung;Balken\nRate;100\nZeit [s];Weg [mm];\n" + GERMAN.replace("\n", ";\n")
    found = fi.read_record(written(tmp_path, text))
    np.testing.assert_allclose(found["Weg"], 1e-3 * VALUES, rtol=1e-15)
    assert found["time"].to_numpy() == pytest.approx(0.01 * np.arange(20))


def test_no_header_and_no_time(tmp_path):
    plain = fi.read_record(written(tmp_path, ROWS))
    assert plain["column 1"].attrs["units"] == ""
    alone = written(tmp_path, "".join(f"{value}\n" for value in VALUES), "alone.csv")
    found = fi.read_record(alone, sample_rate=50.0, units=("mm",))
    assert found["time"].to_numpy() == pytest.approx(0.02 * np.arange(20))
    np.testing.assert_allclose(found["column 0"], 1e-3 * VALUES, rtol=1e-15)
    with pytest.raises(fi.InputError, match="or give sample_rate"):
        fi.read_record(alone)
    with pytest.raises(fi.InputError, match="decimal"):
        fi.read_record(written(tmp_path, alone.read_text().replace(".", ",")), sample_rate=50.0)


LINES = ROWS.splitlines()
DAMAGED = {
    "line 9: the time leaves a gap": [*LINES[:7], *LINES[8:]],
    "line 8, column 1: a text is no finite number": [*LINES[:6], "0.06,nan", *LINES[7:]],
    "line 2, column 1: a text is no finite number": ["0.00,nan", *LINES[1:]],
    "line 5, column 1: nothing is no finite number": [*LINES[:3], "0.03", *LINES[4:]],
    "line 8: the time does not rise": [*LINES[:6], LINES[5], *LINES[7:]],
    "is uneven": [f"{0.01 * i + 0.003 * (i % 2):.3f},1" for i in range(20)],
    "more numbers than names": [line.replace(".", ",") for line in LINES],
}


@pytest.mark.parametrize("words", DAMAGED)
def test_damage_is_one_line_with_its_row(tmp_path, words):
    with pytest.raises(fi.InputError, match=words.replace(":", ".*")) as refused:
        fi.read_record(written(tmp_path, "time,tip\n" + "\n".join(DAMAGED[words])))
    assert "\n" not in str(refused.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="has no pipes")
def test_pipe_device_folder_and_nothing_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    os.mkfifo(tmp_path / "pipe.uff")
    for path in (tmp_path / "pipe.csv", tmp_path / "pipe.uff", "/dev/zero", tmp_path, tmp_path / "none.csv"):
        with pytest.raises(fi.InputError) as refused:
            fi.read_record(path)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["record.csv", "record.uff"])
def test_what_is_written_is_read(tmp_path, name):
    record = fi.read_record(written(tmp_path, "time,tip,force\ns,mm,N\n" + ROWS.replace("\n", ",1.5\n"), "in.csv"))
    found = fi.read_record(fi.excitation.write_record(tmp_path / name, record))
    assert list(found.data_vars) == list(record.data_vars)
    for each in record.data_vars:
        # UFF has 12 digits
        np.testing.assert_allclose(found[each], record[each], rtol=1e-11)
        assert found[each].attrs["units"] == record[each].attrs["units"]
    np.testing.assert_allclose(found["time"], record["time"], rtol=1e-5)


@pytest.mark.parametrize(("unit", "seconds"), [("ms", 1e-3), ("NONE", 1.0), ("SEC", 1.0), ("mm", None), ("days", None)])
def test_the_unit_of_the_time_of_a_uff_file_is_applied_and_said(tmp_path, unit, seconds):
    text = fi.excitation.write_record(
        tmp_path / "s.uff", fi.read_record(written(tmp_path, "time,tip\ns,mm\n" + ROWS))
    ).read_text()
    path = written(
        tmp_path, text.replace(" NONE                 s   ", f" NONE                 {unit:4}", 1), "other.uff"
    )
    if seconds is None:
        with pytest.raises(fi.InputError, match=f"in '{unit}': must be in a unit of s"):
            fi.read_record(path)
        return
    found = fi.read_record(path)
    assert found["time"].to_numpy() == pytest.approx(0.01 * seconds * np.arange(20), rel=1e-12)
    assert found.attrs["notes"][0].startswith("the time is in " + ("s" if unit == "NONE" else unit))


@pytest.mark.parametrize("name", ["out.csv", "out.uff"])
def test_what_is_written_is_what_was_there_or_is_refused(tmp_path, name):
    xarray = pytest.importorskip("xarray")

    def dataset(time, values, unit="m", signal="tip", of_time="s"):
        return xarray.Dataset({signal: ("time", values, {"units": unit})}, {"time": ("time", time, {"units": of_time})})

    time, path = 0.01 * np.arange(20), tmp_path / name
    found = fi.read_record(fi.excitation.write_record(path, dataset(1e3 * time, VALUES, of_time="ms")))
    np.testing.assert_allclose(found["time"], time, rtol=1e-12)
    refused = [dataset(time, np.where(time == 0.05, np.nan, VALUES)), dataset(time, VALUES, of_time="m")]
    refused += [dataset(time**1.5, VALUES), dataset(time[::-1], VALUES), dataset(time[:1], VALUES[:1])]
    refused += [dataset(time[:0], VALUES[:0]), dataset(time + 1j, VALUES), dataset(time, VALUES + 1j)]
    refused += [dataset(np.datetime64("2026-01-01") + (1e9 * time).astype("m8[ns]"), VALUES)]
    for one in refused:
        path.unlink(missing_ok=True)
        with pytest.raises(fi.InputError, match=r"must (h|b)"):
            fi.excitation.write_record(path, one)
        assert not path.exists()
    for unit in ("m8[ns]", "m8[ms]"):
        found = fi.read_record(
            fi.excitation.write_record(path, dataset((1e9 * time).astype("m8[ns]").astype(unit), VALUES))
        )
        np.testing.assert_allclose(found["time"], time, rtol=1e-12)
    # a name that is no text, and marks in names and units
    assert "0" in fi.read_record(fi.excitation.write_record(path, dataset(time, VALUES, signal=0)))
    found = fi.read_record(fi.excitation.write_record(path, dataset(time, VALUES, unit="m,\nor so", signal="a\nb")))
    np.testing.assert_allclose(found["a b"], VALUES, rtol=1e-11)
    assert found["a b"].attrs["units"] == "m, or so"


@pytest.mark.parametrize("ending", [".csv", ".uff"])
def test_names_that_are_written_are_read_back_or_refused(tmp_path, ending):
    xarray = pytest.importorskip("xarray")
    names = [
        "a b", "a,b", "Time", "t", "time [ms]", "a;b", 'a"b', "#a", "", " ", "none", "x in mm", "acc (g)", "g-force",
        "1.5", "No.", "Units", "double", "s", "µ", "a" * 99, "a, (g)", '"a"', "V/s", "T_s", "gFx", "Unit: g",
    ]  # fmt: skip
    written_names = 0
    for several in [*([name] for name in names), names[:2], names[2:4], ["a" * 90, "a" * 91]]:
        for unit in ("", "mm", "V", "1/s", "a long unit of many letters"):
            signals = {name: ("time", VALUES, {"units": unit}) for name in several}
            record = xarray.Dataset(signals, {"time": ("time", 0.01 * np.arange(20))})
            path = tmp_path / f"signals{ending}"
            with suppress(fi.InputError):
                fi.excitation.write_record(path, record)
            if not path.exists():
                continue
            found = fi.read_record(path)
            assert list(found.data_vars) == several
            factor = 1e-3 if unit == "mm" else 1.0
            for name in several:
                np.testing.assert_allclose(found[name], factor * VALUES, rtol=1e-11)
            written_names += len(several)
            path.unlink()
    assert written_names > 60


def test_base_from_csv_takes_the_unit_of_its_header(tmp_path):
    g = written(tmp_path, "time,acc\ns,g\n" + ROWS, "g.csv")
    plain = fi.RecordedBase.from_csv(written(tmp_path, ROWS, "plain.csv"))
    for columns in ((0, 1), ("time", "acc")):
        found = fi.RecordedBase.from_csv(g, columns=columns)
        np.testing.assert_allclose(found.samples, 9.80665 * plain.samples, rtol=1e-15)
        assert "'acc' is in g, taken as 9.80665 m/s^2" in found.note
    assert plain.note.endswith(
        "'column 0' is taken as s: no unit is there; 'column 1' is taken as m/s^2: no unit is there"
    )
    with pytest.raises(fi.InputError, match=r"mm by its header: must be in a unit of m/s\^2"):
        fi.RecordedBase.from_csv(written(tmp_path, "time,acc\ns,mm\n" + ROWS))
    with pytest.warns(fi.InputWarning, match="'g' in the header"):
        assert fi.RecordedBase.from_csv(g, scale=2.0).samples.tolist() == (2.0 * plain.samples).tolist()
    assert fi.RecordedBase.from_csv(g, scale=9.80665).note == ""
    milliseconds = fi.RecordedBase.from_csv(written(tmp_path, "time,acc\nms,m/s^2\n" + ROWS))
    assert milliseconds.interval == pytest.approx(1e-5)


@pytest.mark.parametrize(
    ("header", "mark"),
    [
        ("time [ms];acceleration [g]\n", ";"),
        ("Zeit in ms;Beschleunigung in g\n", ";"),
        ("# t / msec, a / G\n", ","),
    ],
)
def test_units_beside_the_names_of_a_record_are_those_of_a_row_of_units(tmp_path, header, mark):
    rows = ROWS.replace(",", mark)
    plain = fi.RecordedBase.from_csv(written(tmp_path, ROWS, "plain.csv"))
    path = written(tmp_path, header + rows, "named.csv")
    found = fi.RecordedBase.from_csv(path)
    np.testing.assert_allclose(found.samples, 9.80665 * plain.samples, rtol=1e-15)
    assert found.interval == pytest.approx(1e-3 * plain.interval, rel=1e-14)
    assert "is in g, taken as 9.80665 m/s^2" in found.note.lower()
    # a scale is that of the accelerations, and 9.81 is what many take for g
    scaled = fi.RecordedBase.from_csv(path, scale=9.81)
    assert scaled.interval == found.interval
    assert scaled.samples.tolist() == (9.81 * plain.samples).tolist()
    with pytest.warns(fi.InputWarning, match=r"in the header, taken as 1 m/s\^2 by scale"):
        fi.RecordedBase.from_csv(path, scale=1.0)


def test_what_is_no_unit_of_acceleration_is_refused_or_said(tmp_path):
    for header in ("time [s],a [mm]\n", "t,a\ns,V\n"):
        path = written(tmp_path, header + ROWS)
        with pytest.raises(fi.InputError, match=r"column 1 is in (mm|V) by its header: must be in a unit of m/s\^2"):
            fi.RecordedBase.from_csv(path)
    assert fi.RecordedBase.from_csv(path, scale=3.0).note == ""
    with pytest.warns(fi.InputWarning, match=r"the unit 'raw' is not known \(taken as m/s\^2; scale = 1 says so"):
        fi.RecordedBase.from_csv(written(tmp_path, "time [s],a [raw]\n" + ROWS))
    with pytest.raises(fi.InputError, match=r"column 0 is in Hz by its header: must be in a unit of s$"):
        fi.RecordedBase.from_csv(written(tmp_path, "f [Hz],a [g]\n" + ROWS))
    # a(t) is no column in tonnes
    note = fi.RecordedBase.from_csv(written(tmp_path, "t(s),a(t)\n" + ROWS)).note
    assert note == "record.csv: 'a(t)' is taken as m/s^2: no unit is there"


def test_a_name_without_its_unit_finds_a_column_and_others_are_told_the_names(tmp_path):
    path = written(tmp_path, "time [ms],acceleration [g]\n" + ROWS)
    found = fi.RecordedBase.from_csv(path, columns=("time", "acceleration"))
    assert found.samples.tolist() == fi.RecordedBase.from_csv(path).samples.tolist()
    with pytest.raises(fi.InputError, match=r"'force': must be one of the columns .*: \['time', 'acceleration'\]"):
        fi.RecordedBase.from_csv(path, columns=("time", "force"))


UNITS_OF_TIME = {
    "time,acc\nsec,g\n": 1.0, "time,acc\nSec,g\n": 1.0, "time,acc\nsecs,g\n": 1.0, "Seconds,g\n": 1.0,
    "time,acc\nmsec,g\n": 1e-3, "time,acc\nms,g\nDOUBLE,DOUBLE\n": 1e-3, "time [msec],acc [g]\n": 1e-3,
    "t / ms,acc / (g)\n": 1e-3, "t/ms,acc/g\n": 1e-3, "t_ms,acc in g\n": 1e-3, "Time ms,acc in g\n": 1e-3,
    '"time, of the rig [ms]","acc, z [g]"\n': 1e-3,
    '"time\n[ms]","acc\n[g]"\n': 1e-3, 'pipe,5" wide\ntime [ms],acc [g]\n': 1e-3,
}  # fmt: skip


@pytest.mark.parametrize("header", UNITS_OF_TIME)
def test_spellings_of_units_in_a_header_mean_the_same(tmp_path, header):
    path = written(tmp_path, header + ROWS)
    base, record = fi.RecordedBase.from_csv(path), fi.read_record(path)
    interval = 0.01 * UNITS_OF_TIME[header]
    assert base.interval == pytest.approx(interval, rel=1e-14)
    assert record["time"].to_numpy() == pytest.approx(interval * np.arange(20), rel=1e-14)
    (name,) = record.data_vars
    assert record[name].attrs["units"] == "m/s^2"
    for found in (base.samples, record[name]):
        # one rounding of the product
        np.testing.assert_allclose(found, 9.80665 * VALUES, rtol=1e-15)


@pytest.mark.parametrize(
    ("header", "words", "others"),
    [
        ("time,acc\ns,EU\n", r"column 1 is in EU .*or give scale", None),
        ("time,acc\nmsec,V\n", r"column 1 is in V .*or give scale", None),
        ("time,acc\ndays,g\n", "column 0 is in days .*a unit of s$", "'time' must be a time"),
        ("time,acc\nsamples,EU\n", "column 0 is in samples .*a unit of s$", "'time' must be a time"),
        ("sample,acc\n", "'sample' counts samples", "'sample' counts samples; give sample_rate"),
        ("No.,acc\n,g\n", "'No.' counts samples", "'No.' counts samples; give sample_rate"),
    ],
)
def test_a_row_with_a_unit_that_is_not_known_is_no_row_of_names(tmp_path, header, words, others):
    path = written(tmp_path, header + ROWS)
    with pytest.raises(fi.InputError, match=words):
        fi.RecordedBase.from_csv(path)
    if others is None:
        assert "the unit" in fi.read_record(path).attrs["notes"][1]
        assert list(fi.read_record(path).data_vars) == ["acc"]
    else:
        with pytest.raises(fi.InputError, match=others):
            fi.read_record(path)
        with warnings.catch_warnings():
            # that it contradicts the file
            warnings.simplefilter("ignore", fi.InputWarning)
            assert fi.read_record(path, columns=(0, 1), units=("s", "g"))["time"][1] == 0.01


SCOPE = "Model,MSO\nVertical Units,{}\nHorizontal Units,{}\n\nTIME,CH1\n"
LVM = """LabVIEW Measurement\t
Time_Pref\tAbsolute
Time\t10:22:11.123
***End_of_Header***\t

Channels\t1\t
Y_Unit_Label\t{}\t
X_Dimension\tTime\t
X0\t0.0000000000000000E+0\t
Delta_X\t0.010000\t
***End_of_Header***\t
X_Value\tAcceleration\tComment
"""
G, DIN = 9.80665, str.maketrans({",": ";", ".": ","})
FIELD = {
    # separator of the rows, header: factor and unit in SI
    (" ", "time/s acc x/g\n"): (G, "m/s^2"), (" ", "   Time (s)      Acc X (g)\n"): (G, "m/s^2"),
    (" ", "time in s acc in g\n"): (G, "m/s^2"), (",", "Time in s,Acc in g\n"): (G, "m/s^2"),
    (",", "Time (s), Acc, X (g)\n"): (G, "m/s^2"), (",", "Time {s},Acc <g>\n"): (G, "m/s^2"),
    ("\t", LVM.format("g")): (G, "m/s^2"), ("\t", LVM.format("mm/s")): (1e-3, "m/s"),
    (",", SCOPE.format("g", "s")): (G, "m/s^2"), (",", SCOPE.format("mN", "s")): (1e-3, "N"),
    (";", "Zeit / s;Weg / mm/s\n"): (1e-3, "m/s"), (";", "t/s;v/mm/s\n"): (1e-3, "m/s"),
    (";", "Zeit in Sekunden;Schnelle in mm/s\n"): (1e-3, "m/s"), (";", "Messzeit / s;F/N\n"): (1.0, "N"),
    (";", "Temps en s;Accélération en g\n"): (G, "m/s^2"), (";", "Temps (s);Accélération (g)\n"): (G, "m/s^2"),
    (";", "Messung;Balken\nEinheit;mm/s\nZeit;Schnelle\n"): (1e-3, "m/s"), (";", "Unités;s;g\ntemps;a\n"): (G, "m/s^2"),
    (",", "# Unit = g\n# time,acc\n"): (G, "m/s^2"), (",", "Units: s, g\n"): (G, "m/s^2"),
    (",", "s,g\ntime,acc\n"): (G, "m/s^2"), (",", "Time (s),g-force\n"): (G, "m/s^2"),
    (",", "time,gFz\n"): (G, "m/s^2"), (",", "time,acc (G-Force)\n"): (G, "m/s^2"),
    (",", "time,acc [g's]\n"): (G, "m/s^2"), (",", "time,acc (mG)\n"): (1e-3 * G, "m/s^2"),
    (",", "time (s),acc (Gal)\n"): (1e-2, "m/s^2"), (",", "TIME (S),ACC (CM/S/S)\n"): (1e-2, "m/s^2"),
    (",", "time,acc (m s^-2)\n"): (1.0, "m/s^2"), (",", "time,acc (g) left\n"): (G, "m/s^2"),
    (",", "time (s),disp (mils)\n"): (2.54e-5, "m"), (",", "time,force (Newton)\n"): (1.0, "N"),
    (",", "time_s,acc_g\n"): (G, "m/s^2"), (";", "Time, s;Acc, g\n"): (G, "m/s^2"),
    (";", "t: s;v: mm/s\n"): (1e-3, "m/s"),
}  # fmt: skip


@pytest.mark.parametrize(("mark", "header"), FIELD)
def test_a_unit_is_read_wherever_a_header_of_the_field_has_it(tmp_path, mark, header):
    rows = ROWS.translate(DIN) if mark == ";" else ROWS.replace(",", mark)
    factor, unit = FIELD[mark, header]
    path = written(tmp_path, header + rows)
    record = fi.read_record(path)
    (name,) = record.data_vars
    assert record[name].attrs["units"] == unit
    np.testing.assert_allclose(record[name], factor * VALUES, rtol=1e-14)
    assert record["time"].to_numpy() == pytest.approx(0.01 * np.arange(20), rel=1e-14)
    if unit == "m/s^2":
        np.testing.assert_allclose(fi.RecordedBase.from_csv(path).samples, factor * VALUES, rtol=1e-14)
    else:
        with pytest.raises(fi.InputError, match=r"by its header: must be in a unit of m/s\^2"):
            fi.RecordedBase.from_csv(path)


def test_settings_beside_the_rows_of_an_oscilloscope_have_the_units(tmp_path):
    beside = ["Record Length,20,", "Vertical Units,g,", "Horizontal Units,ms,", *[",,"] * 17]
    path = written(tmp_path, "".join(f"{one},{row}\n" for one, row in zip(beside, LINES, strict=True)))
    record = fi.read_record(path)
    np.testing.assert_allclose(record["column 4"], G * VALUES, rtol=1e-14)
    assert record["time"][1] == pytest.approx(1e-5)


def test_each_channel_of_a_line_of_units_has_its_own(tmp_path):
    header = LVM.replace("\tComment", "\tForce\tComment").format("g\tkN")
    record = fi.read_record(written(tmp_path, header + ROWS.replace(",", "\t").replace("\n", "\t2.5\n")))
    np.testing.assert_allclose(record["Acceleration"], G * VALUES, rtol=1e-14)
    assert record["Force"].to_numpy().tolist() == [2500.0] * 20
    one = fi.read_record(written(tmp_path, "Unit,mm\ntime,left,right\n" + ROWS.replace("\n", ",3\n")))
    assert {name: each.attrs["units"] for name, each in one.items()} == {"left": "m", "right": "m"}


def test_words_that_fit_no_column_are_no_names(tmp_path):
    record = fi.read_record(
        written(tmp_path, "time acc left acc right\n" + ROWS.replace(",", " ").replace("\n", " 2\n"))
    )
    assert list(record.data_vars) == ["column 1", "column 2"]
    wide = fi.read_record(
        written(tmp_path, "time   acc left   acc right\n" + ROWS.replace(",", " ").replace("\n", " 2\n"))
    )
    assert list(wide.data_vars) == ["acc left", "acc right"]


@pytest.mark.parametrize(
    "factor", [("ACCELERATION", "G", G), ("VELOCITY", "CM/SEC", 0.01), ("DISPLACEMENT", "CM", 0.01)]
)
@pytest.mark.parametrize("line", ["NPTS=     20, DT=   .0050 SEC,", "    20   0.0050   NPTS, DT"])
def test_a_peer_file_has_five_values_a_row_and_no_times(tmp_path, factor, line):
    title = "PEER NGA STRONG MOTION DATABASE RECORD\nImperial Valley-06, 10/15/1979, El Centro Array #9, 180\n"
    rows = "".join("".join(f"{value:15.7E}" for value in VALUES[i : i + 5]) + "\n" for i in range(0, 20, 5))
    text = f"{title}{factor[0]} TIME SERIES IN UNITS OF {factor[1]}\n{line}\n{rows}"
    path = written(tmp_path, text, "record.AT2")
    record = fi.read_record(path)
    np.testing.assert_allclose(record[factor[0].lower()], factor[2] * VALUES, rtol=1e-14)
    assert record["time"].to_numpy() == pytest.approx(0.005 * np.arange(20), rel=1e-14)
    if factor[1] == "G":
        base = fi.RecordedBase.from_csv(path)
        np.testing.assert_allclose(base.samples, G * VALUES, rtol=1e-14)
        assert base.interval == pytest.approx(0.005, rel=1e-14)
    for damaged in (text[:-20], text.replace("20,", "21,").replace("    20 ", "    21 ")):
        with pytest.raises(fi.InputError, match=r"samples, and 2[01] by its NPTS: is the file cut off"):
            fi.read_record(written(tmp_path, damaged, "record.AT2"))


def uff_text(tmp_path, unit="mm"):
    record = fi.read_record(written(tmp_path, "time,tip\n" + ROWS))
    record["tip"].attrs["units"] = unit
    return fi.excitation.write_record(tmp_path / "whole.uff", record).read_text()


def binary_uff(tmp_path, kind="<f8", end=b"\n", line=b"\n"):
    """A file of two datasets 58b of the samples, and where the numbers of the first one begin."""
    lines = uff_text(tmp_path).split("\n")[:13]
    order, of_data = ("1" if kind[0] == "<" else "2"), {"f4": "2", "f8": "4"}[kind[1:]]
    lines[1] = f"    58b     {order}     2          11         160     0     0           0           0"
    lines[8] = f"{of_data:>10}{lines[8][10:]}"
    head = line.join(one.encode() for one in lines) + line
    second = head.replace(b"tip", b"two")
    data = VALUES.astype(kind).tobytes() + end + b"    -1" + line
    return head + data + second + data, len(head)


SAME = {
    "exponents with a D": lambda text: text.replace("e-", "D-").replace("e+", "D+"),
    "no last -1": lambda text: text[: text.rindex("    -1")],
    "columns 15 wide": lambda text: "\n".join(
        "".join(f"{float(cell):15.7e}" for cell in line.split()) if 12 < i < 18 else line
        for i, line in enumerate(text.split("\n"))),
    "one in a row": lambda text: "\n".join(
        "\n".join(line.split()) if 12 < i < 18 else line for i, line in enumerate(text.split("\n"))),
    "exponents without a letter": lambda text: text.replace("e-01", "-001"),
    "lines of Windows": lambda text: text.replace("\n", "\r\n"),
    "blanks behind -1": lambda text: text.replace("    -1\n", "    -1" + 74 * " " + "\n"),
    "other datasets": lambda text: "    -1\n   151\nNONE\n    -1\n" + text + "    -1\n  2420\n 1 1\n    -1\n",
}  # fmt: skip


@pytest.mark.parametrize("way", SAME)
@pytest.mark.parametrize("ending", [".uff", ".uf", ".ufb", ".unv", ".UNV"])
def test_every_way_of_writing_a_uff_file_gives_the_same_samples(tmp_path, way, ending):
    path = written(tmp_path, SAME[way](uff_text(tmp_path)), f"other{ending}")
    record = fi.read_record(path)
    np.testing.assert_allclose(record["tip"], 1e-3 * VALUES, rtol=1e-6)
    assert record["tip"].attrs["units"] == "m"
    assert record["time"].to_numpy() == pytest.approx(0.01 * np.arange(20), rel=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("mm/s²", 1e-3), ("µm", 1e-6), ("g", G), ("m·s⁻²", 1.0)])
@pytest.mark.parametrize("code", ["utf-8", "latin-1"])
def test_the_unit_of_a_uff_file_keeps_its_factor_in_either_code(tmp_path, unit, factor, code):
    if code == "latin-1" and "⁻" in unit:
        pytest.skip("has no such letter")
    path = tmp_path / "other.uff"
    path.write_bytes(
        uff_text(tmp_path, "N").replace("NONE                 N ", f"NONE                 {unit} ").encode(code)
    )
    np.testing.assert_allclose(fi.read_record(path)["tip"], factor * VALUES, rtol=1e-11)


@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", ">f4"])
@pytest.mark.parametrize(("end", "line"), [(b"", b"\n"), (b"\n", b"\n"), (b"\r\n", b"\r\n")])
def test_a_binary_uff_file_is_read_and_one_with_a_byte_lost_is_refused(tmp_path, kind, end, line):
    content, begin = binary_uff(tmp_path, kind, end, line)
    path = tmp_path / "b.uff"
    path.write_bytes(content)
    record = fi.read_record(path)
    for name in ("tip", "two"):
        np.testing.assert_allclose(record[name], 1e-3 * VALUES, rtol=1e-7)
    size = 20 * np.dtype(kind).itemsize
    for lost in (begin, begin + 7, begin + size // 2, begin + size - 1):
        for damaged in (content[:lost] + content[lost + 1 :], content[:lost] + b"7" + content[lost:]):
            path.write_bytes(damaged)
            with pytest.raises(fi.InputError, match="are bytes lost or added"):
                fi.read_record(path)
    path.write_bytes(content[: begin + size - 3])
    with pytest.raises(fi.InputError, match="is the file cut off"):
        fi.read_record(path)
    nan = np.where(np.arange(20) == 5, np.nan, VALUES).astype(kind).tobytes()
    path.write_bytes(content[:begin] + nan + content[begin + size :])
    with pytest.raises(fi.InputError, match="sample 6: is no finite number"):
        fi.read_record(path)


@pytest.mark.parametrize(
    ("kind", "words"), [(0, "type 0"), (1, "type 1"), (3, "type 3"), (99, "type 99"), (5, "complex"), (6, "complex")]
)
def test_data_of_a_uff_file_that_is_no_real_number_is_refused_by_its_type(tmp_path, kind, words):
    text = uff_text(tmp_path).replace("         4        20", f"{kind:10}        20")
    with pytest.raises(fi.InputError, match=words):
        fi.read_record(written(tmp_path, text, "other.uff"))


def test_uneven_times_and_a_lost_line_between_datasets_of_a_uff_file(tmp_path):
    text = uff_text(tmp_path)
    lines = text.split("\n")
    lines[8] = f"{4:10}{20:10}{0:10}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}"
    lines[13:18] = [f"{0.01 * i:13.5e}{value:20.12e}" for i, value in enumerate(VALUES)]
    uneven = fi.read_record(written(tmp_path, "\n".join(lines), "uneven.uff"))
    np.testing.assert_allclose(uneven["tip"], 1e-3 * VALUES, rtol=1e-12)
    two = text[: text.rindex("    -1")] + text.replace("tip", "two")
    assert list(fi.read_record(written(tmp_path, two, "two.uff")).data_vars) == ["tip", "two"]
    again = fi.read_record(written(tmp_path, text * 3, "again.uff"))
    assert list(again.data_vars) == ["tip", "tip 2", "tip 3"]


# pyuff leaves the file of what it has written to the garbage collector
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore:unclosed file:ResourceWarning")
def test_a_reader_that_shares_no_code_finds_what_is_written_in_a_uff_file(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    uff_text(tmp_path)
    found = pyuff.UFF(str(tmp_path / "whole.uff")).read_sets()
    np.testing.assert_allclose(found["data"], VALUES, rtol=1e-11)
    np.testing.assert_allclose(found["x"], 0.01 * np.arange(20), rtol=1e-9)
    assert (found["id1"], found["ordinate_axis_units_lab"], found["abscissa_spec_data_type"]) == ("tip", "mm", 17)
    pyuff.UFF(str(tmp_path / "binary.uff")).write_sets({**found, "binary": 1}, "add")
    np.testing.assert_allclose(fi.read_record(tmp_path / "binary.uff")["tip"], 1e-3 * VALUES, rtol=1e-11)


def test_damaged_uff_files_are_refused(tmp_path):
    record = fi.read_record(written(tmp_path, "time,tip,force\ns,mm,N\n" + ROWS.replace("\n", ",1.5\n"), "in.csv"))
    text = fi.excitation.write_record(tmp_path / "whole.uff", record).read_text()
    half = len(text) // 2
    damaged = {
        "no dataset": "", "no dataset ": ROWS, "in the header": text[: half // 3], "cut off": text[: half + half // 2],
        "has none": "    -1\n   151\n    -1\n", "has none ": "    -1\n    58  ",
        "line 7 of its header": text.replace("        20", "        2x"),
        "20,000,000 samples": text.replace("        20", "  20000000", 1),
        "over time": text.replace("        17", "        18"),
        "holds what is no number": text.replace(f"{1e-3 * VALUES[3]:20.11e}", "            x.5e-01"),
    }  # fmt: skip
    for words, content in damaged.items():
        with pytest.raises(fi.InputError, match=words.strip()):
            fi.read_record(written(tmp_path, content, "damaged.uff"))


def test_a_name_that_may_have_a_unit_is_asked_after(tmp_path):
    path = written(tmp_path, "time,acc_g\n" + ROWS)
    assert fi.read_record(path).attrs["notes"][1].endswith("no unit is there; is it in g?")
    with pytest.warns(fi.InputWarning, match=r"is it in g\? \(taken as m/s\^2; scale = 1 says so"):
        assert fi.RecordedBase.from_csv(path).samples.tolist() == VALUES.tolist()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fi.RecordedBase.from_csv(path, scale=1.0)
        fi.RecordedBase.from_csv(written(tmp_path, "time,a\n" + ROWS))


@pytest.mark.parametrize("name", ["V/s", "samples / s", "T_min", "T_s", "a(t)", "acc_x", "acc - t", "g", "acc_N"])
def test_a_name_that_only_looks_like_one_with_a_unit_is_a_name(tmp_path, name):
    record = fi.read_record(written(tmp_path, f"{name},time\n" + "".join(f"1,{0.1 * i:.1f}\n" for i in range(9))))
    assert list(record.data_vars) == [name]
    assert record[name].attrs["units"] == ""


@pytest.mark.parametrize("rows", ["{},{:+.5f}", "{},{:.5f}", "{},{:.4e}"])
@pytest.mark.parametrize("header", ["", "time [ms],tip [mm]\n", "Rate,100,Hz\n"])
def test_decimal_commas_between_commas_are_refused(tmp_path, header, rows):
    # 10,0,98765: whole milliseconds, so that every row has three cells
    text = header + "".join(rows.format(10 * i, np.cos(i)).replace(".", ",") + "\n" for i in range(20))
    for read in (fi.read_record, fi.RecordedBase.from_csv):
        with pytest.raises(fi.InputError, match="is a comma a decimal one"):
            read(written(tmp_path, text))


def test_what_is_in_quotes_is_one_cell(tmp_path):
    text = '"time [s]";"tip; left [mm]";"with ""quotes"" [N]"\n' + GERMAN.replace("\n", ";2\n")
    record = fi.read_record(written(tmp_path, text))
    assert list(record.data_vars) == ["tip; left", 'with "quotes"']
    np.testing.assert_allclose(record["tip; left"], 1e-3 * VALUES, rtol=1e-15)
    quoted = "".join(f'"{line.replace(";", chr(34) + "," + chr(34))}"\n' for line in GERMAN.splitlines())
    record = fi.read_record(written(tmp_path, '"time [s]","tip, left [mm]"\n' + quoted))
    np.testing.assert_allclose(record["tip, left"], 1e-3 * VALUES, rtol=1e-15)


LATE = [f"{line},{'' if i < 8 else 1}" for i, line in enumerate(LINES)]
FEW = [f"{line},{'nan' if i % 5 < 3 else 1}" for i, line in enumerate(LINES)]


@pytest.mark.parametrize("lines", [[f"{line},{1 if i < 5 else ''}" for i, line in enumerate(LINES)], FEW])
@pytest.mark.parametrize("header", ["time,tip,force\n", ""])
def test_a_column_with_few_numbers_is_named_and_is_no_signal(tmp_path, lines, header):
    record = fi.read_record(written(tmp_path, header + "\n".join(lines)))
    assert len(record.data_vars) == 1
    name = "force" if header else "column 2"
    assert f"{name!r} is left out: few of its rows have numbers, or none" in record.attrs["notes"]


def test_a_column_that_begins_late_does_not_hide_the_others(tmp_path):
    path = written(tmp_path, "time,acc,force\ns,g,N\n" + "\n".join(LATE))
    base = fi.RecordedBase.from_csv(path)
    np.testing.assert_allclose(base.samples, 9.80665 * VALUES, rtol=1e-15)
    with pytest.raises(fi.InputError, match="line 3, column 2: nothing is no finite number"):
        fi.read_record(path)


def test_samples_are_counted_beside_a_time_and_without_one(tmp_path):
    counted = "".join(f"{i},{line}\n" for i, line in enumerate(LINES))
    record = fi.read_record(written(tmp_path, "Sample,Time [s],tip [mm]\n" + counted))
    assert list(record.data_vars) == ["tip"]
    assert "'Sample' is left out: it counts samples" in record.attrs["notes"]
    alone = "No.,tip\n,mm\n" + "".join(f"{i},{value}\n" for i, value in enumerate(VALUES))
    record = fi.read_record(written(tmp_path, alone), sample_rate=100.0)
    assert record["time"][1] == 0.01
    np.testing.assert_allclose(record["tip"], 1e-3 * VALUES, rtol=1e-15)
    with_numbers = fi.read_record(written(tmp_path, alone.split("mm\n")[1]))
    assert "it counts by 1" in with_numbers.attrs["notes"][0]


def test_texts_of_spreadsheets_are_read_and_one_with_zeros_is_none(tmp_path):
    text = "Zeit [s];Beschl. [µm/s²]\n" + GERMAN
    path = tmp_path / "record.csv"
    path.write_bytes(text.encode("cp1252"))
    np.testing.assert_allclose(fi.RecordedBase.from_csv(path).samples, 1e-6 * VALUES, rtol=1e-15)
    for mark, code in (("", "utf-16"), ("\ufeff", "utf-16-be")):
        path.write_bytes((mark + text).encode(code))
        np.testing.assert_allclose(fi.RecordedBase.from_csv(path).samples, 1e-6 * VALUES, rtol=1e-15)
    path.write_bytes(text.encode("cp1252") + b"\0")
    with pytest.raises(fi.InputError, match="is no text"):
        fi.read_record(path)


@pytest.mark.parametrize("lines", [
    "X axis unit:\tms\nY axis unit:\tmm/s\nX axis\tY axis\n", "Y units: mm/s\nX units: ms\ntime acc\n",
    "Time unit\tms\nAmplitude unit\tmm/s\ntime\tacc\n", "HUnit,ms\nVUnit,mm/s\ntime,acc\n",
    "Y Axis Units = mm/s\nX Axis Units = ms\ntime acc\n", "time,ms;v / mm/s (laser)\n",
])  # fmt: skip
def test_units_of_axes_and_before_a_remark_are_applied(tmp_path, lines):
    mark = next((one for one in ";\t" if one in lines), "," if "," in lines else " ")
    found = fi.read_record(written(tmp_path, lines + ROWS.replace(",", mark)))
    (signal,) = found.data_vars.values()
    np.testing.assert_allclose(signal, 1e-3 * VALUES, rtol=1e-15)
    assert signal.attrs["units"] == "m/s"
    assert float(found["time"][1]) == pytest.approx(1e-5)


def test_a_temperature_is_no_time_and_a_text_in_few_rows_is_named(tmp_path):
    rows = ROWS.replace("\n", ",20\n")
    assert set(fi.read_record(written(tmp_path, "time [s],tip [mm],T [°C]\n" + rows)).data_vars) == {"tip", "T"}
    dated = "".join(f"10:00:{i},{i}\n" for i in range(10, 20))
    with pytest.raises(fi.InputError, match="'clock' has numbers in few of its rows"):
        fi.read_record(written(tmp_path, "clock,tip [mm]\n" + dated))


def test_a_row_behind_a_mark_is_a_remark(tmp_path):
    record = fi.read_record(written(tmp_path, "# 12,1\n# 3,4\n# time [s],tip [mm]\n" + ROWS))
    np.testing.assert_allclose(record["tip"], 1e-3 * VALUES, rtol=1e-15)


def test_one_signal_reads_the_file_once(tmp_path, monkeypatch):
    path = written(tmp_path, "time,tip,force\ns,mm,N\n" + ROWS.replace("\n", ",1.5\n"))
    read = []
    monkeypatch.setattr(record_files, "record_text", lambda at: read.append(at) or record_text(at))
    with pytest.warns(fi.InputWarning, match="units of 'tip': 'cm' is given, and the file has 'mm'"):
        found = record_files.one_signal(path, "tip", ("s", "cm"), None)
    np.testing.assert_allclose(found["tip"], 1e-2 * VALUES, rtol=1e-15)
    assert list(found.data_vars) == ["tip"]
    assert read == [path]
    with pytest.raises(fi.InputError, match=r"column: must name one of the signals: \['tip', 'force'\]"):
        record_files.one_signal(path, None, None, None)
    assert record_files.one_signal(path, "tip", ("mm",), 50.0)["time"][1] == 0.02
