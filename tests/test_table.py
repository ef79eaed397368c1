"""Results as tables: columns by name, pandas frames with units, and reprs that are short and true."""

from __future__ import annotations

import html
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from nouns import NOUNS, curve, oscillators, response, small, system

import femimpact as fi
from femimpact.response.impacts import IMPACT_UNITS, impact_columns
from femimpact.table import column_units

TABLES = {
    "EnergyLedger": "time",
    "EventLog": None,
    "FrequencyResponse": "frequency",
    "Impacts": None,
    "StickingPhases": None,
}
"""Tables with columns, and the index of their frames."""

SHORT = {
    "EnergyLedger": lambda: response().energy,
    "EventLog": NOUNS["EventLog"],
    "FrequencyResponse": curve,
    "Impacts": lambda: response().impacts,
    "Mesh": NOUNS["Mesh"],
    "Modes": lambda: fi.solve_modes(system(), 8),
    "Response": response,
    "StickingPhases": NOUNS["StickingPhases"],
    "StroboscopicSection": NOUNS["StroboscopicSection"],
    "System": system,
    "System, reduced": small,
    "System of matrices": oscillators,
}
"""What has a short repr."""

ROUNDED = 5e-5
"""Relative: numbers are shown with five digits."""


def columns_of(name, table):
    return IMPACT_UNITS if name == "Impacts" else column_units(table)


@pytest.mark.parametrize("name", TABLES)
def test_a_column_is_read_by_its_name(name):
    table = NOUNS[name]()
    for column in columns_of(name, table):
        np.testing.assert_array_equal(table[column], getattr(table, column))


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("wrong", [0, None, ["time"], np.ones(2)])
def test_what_is_no_name_is_no_column(name, wrong):
    with pytest.raises(fi.InputError, match=r"^column.*: must be a str$"):
        NOUNS[name]()[wrong]


@pytest.mark.parametrize(
    ("name", "wrong", "meant"),
    [
        ("Impacts", "tme", "time"),
        ("Impacts", "aproach_speed", "approach_speed"),
        ("EnergyLedger", "kinetik", "kinetic"),
        ("FrequencyResponse", "peaks", "peak"),
        ("StickingPhases", "begin", "end"),
        # no column: the number of modes is its length, and the order is of the whole study
    ],
)
def test_an_unknown_column_is_refused_with_the_closest_one(name, wrong, meant):
    with pytest.raises(fi.InputError, match=r"^column = .*: unknown; ") as refused:
        NOUNS[name]()[wrong]
    assert meant in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("name", TABLES)
def test_a_frame_holds_the_columns_with_their_units(name):
    table = NOUNS[name]()
    frame = table.to_pandas()
    assert frame.index.name == TABLES[name]
    names = [*frame.columns] if TABLES[name] is None else [frame.index.name, *frame.columns]
    assert list(frame.attrs["units"]) == names
    for column, unit in columns_of(name, table).items():
        values = np.asarray(getattr(table, column))
        if values.ndim == 1:
            kept = frame.index if column == TABLES[name] else frame[column]
            np.testing.assert_array_equal(kept, values)
            assert frame.attrs["units"][column] == unit
        else:
            parts = [frame[f"{column}_{i + 1}"] for i in range(values.shape[1])]
            np.testing.assert_array_equal(np.reshape(parts, values.T.shape), values.T)


def test_a_frame_is_a_copy():
    impacts = response().impacts
    before = impacts.time.copy(), impacts.phase.copy()
    frame = impacts.to_pandas()
    frame["time"] *= 2.0
    frame.loc[0, "phase"] = 9.0
    np.testing.assert_array_equal((impacts.time, impacts.phase), before)


def test_the_frame_of_impacts_has_the_columns_of_their_file():
    impacts = response().impacts
    columns, units = impact_columns(impacts)
    frame = impacts.to_pandas()
    assert (list(frame.columns), frame.attrs["units"]) == (list(columns), units)
    assert len(impacts) > 5


def test_the_frame_of_a_response_has_its_channels_over_time():
    run = response()
    frame = run.to_pandas()
    np.testing.assert_array_equal(frame.index, run.time)
    for name in run.channels:
        np.testing.assert_array_equal(frame[name], run[name])
    assert frame.attrs["units"] == {"time": "s", **run.units}


def test_the_frame_of_modes_has_a_row_for_every_mode():
    modes = fi.solve_modes(system(), 3)
    frame = modes.to_pandas()
    assert list(frame.index) == [1, 2, 3]
    for name in frame.columns:
        np.testing.assert_array_equal(frame[name], getattr(modes, name))
    assert frame.attrs["units"] == {
        "mode": "1", "natural_frequency": "Hz", "damping_ratio": "1", "participation_factor": "kg^0.5",
        "effective_mass": "kg",
    }  # fmt: skip


@pytest.mark.parametrize("name", SHORT)
def test_a_repr_is_short_and_named(name):
    lines = repr(SHORT[name]()).splitlines()
    assert 3 <= len(lines) <= 10
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith(f"{name.split(',')[0].split(' ')[0]}: ")


@pytest.mark.parametrize("name", ["EnergyLedger", "FrequencyResponse", "Impacts", "Modes", "StickingPhases"])
def test_numbers_that_a_repr_shows_are_those_held(name):
    noun = SHORT[name]()
    _, names, units, *rows = (re.split(r"\s{2,}", line.strip()) for line in repr(noun).splitlines())
    rows = [row for row in rows if not row[0].startswith("also: ")]
    frame = noun.to_pandas().reset_index()
    # a star is no part of a number, and is explained among the units
    assert set(units) - {"", "* one start"} <= set(frame.attrs["units"].values())
    # the first rows, then the last ones where some are left out
    gap = rows.index(["..."] * len(names)) if ["..."] * len(names) in rows else len(rows)
    places = [*range(gap), *range(len(frame) - len(rows) + gap + 1, len(frame))]
    shown = [row for row in rows if row[0] != "..."]
    assert len(shown) == len(places)
    for i, row in zip(places, shown, strict=True):
        for column, cell in zip(names, row, strict=True):
            held = frame[column].iloc[i]
            assert (
                cell == held if isinstance(held, str) else float(cell.rstrip("*")) == pytest.approx(held, rel=ROUNDED)
            )


def test_columns_beyond_the_width_are_named_in_the_last_line():
    ledger = response().energy
    *_, last = repr(ledger).splitlines()
    shown = repr(ledger).splitlines()[1].split()
    assert [*shown, *last.removeprefix("also: ").split(", ")] == list(ledger.to_pandas().reset_index().columns)


def test_values_that_a_repr_shows_are_those_held():
    whole, run = system(), response()
    assert f"{whole.dofs} dofs" in repr(whole)
    assert f"{whole.first_frequency:.5g} Hz" in repr(whole)
    assert f"{whole.total_mass:.5g} kg" in repr(whole)
    assert "gaps inf and 0.005 m" in repr(whole)
    assert f"{run.time.size} samples" in repr(run)
    assert f"{len(run.impacts)}, " in repr(run)
    assert f"{run.energy.residual:.5g} of the energy put in" in repr(run)


def test_values_of_one_start_have_a_star_where_the_motion_is_not_periodic():
    whole = curve()
    words = np.array(["periodic", "statistical", "transient", "failed", "periodic"])
    linear = replace(whole, steadiness=words, peak=np.array([1.0, 2.0, 5.0, np.nan, 3.0]))
    assert linear.has_transient.tolist() == [False, True, True, False, False]
    assert "peak 5 m" in repr(linear).splitlines()[0]
    assert "peak 5 m at 6 Hz (transient)" in repr(linear)
    assert "*" not in repr(linear)
    mixed = replace(linear, impacts_per_cycle=np.ones(5))
    assert not mixed.has_transient.any()
    assert mixed.is_sample.tolist() == [False, True, True, False, False]
    assert mixed.peak_is_sample
    title, _, units, *rows = repr(mixed).splitlines()[:8]
    assert "peak 5* m" in title
    assert units.endswith("* one start")
    for word, row in zip(words, rows, strict=True):
        # frequency and steadiness are no values of the motion
        assert row.count("*") == (4 if word in ("statistical", "transient") else 0)
    assert "*" not in repr(replace(whole, steadiness=np.full(5, "periodic")))
    assert max(map(len, repr(mixed).splitlines())) <= 80


def test_many_contacts_points_and_channels_stay_short():
    dofs = 12
    points = {f"place number {i}": np.eye(dofs)[i] for i in range(dofs)}
    balls = [
        fi.Impactor(f"ball {i}", at=f"place number {i}", mass=0.1, gap=1e-3, contact=fi.Rigid(0.6)) for i in range(dofs)
    ]
    many = fi.System.from_matrices(np.eye(dofs), np.eye(dofs), np.eye(dofs), points=points, impactors=balls)
    run = fi.integrate(many, fi.Sine(1e-4, 5.0), fi.EventDriven(), 0.1)
    for noun in (many, run, run.impacts, run.stroboscopic(), fi.solve_modes(many, dofs)):
        lines = repr(noun).splitlines()
        assert len(lines) <= 10
        assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("name", SHORT)
def test_html_is_a_table_of_the_same_cells(name):
    noun = SHORT[name]()
    page, end, call = noun._repr_html_().partition("</table>")
    assert page.startswith("<table>")
    assert end
    # below it some name the function that draws them, which is there
    named = re.fullmatch(r"<p>figure: <code>fi\.figures\.(\w+)\(\w+\)</code></p>", call)
    assert not call or callable(getattr(fi.figures, named[1]))
    title = html.unescape(re.search("<caption>(.*)</caption>", page)[1])
    assert title[:70] == repr(noun).splitlines()[0][:70]
    rows = [re.findall("<t[hd]>(.*?)</t[hd]>", row) for row in re.findall("<tr>(.*?)</tr>", page)]
    assert len({len(row) for row in rows}) == 1
    assert 3 <= len(rows) <= 9


def test_html_is_escaped():
    name = "<b>ball & wall</b>"
    points = {"mass": [1.0]}
    ball = fi.Impactor(name, at="mass", mass=0.1, gap=1e-3, contact=fi.Rigid(0.6))
    odd = fi.System.from_matrices([[1.0]], [[0.0]], [[1.0]], points=points, impactors=[ball])
    page = odd._repr_html_()
    assert "<b>" not in page
    assert html.escape(name) in page
    assert name in repr(odd)


def test_what_no_impact_has_is_left_out_of_the_head():
    impacts = response().impacts
    unknown = replace(impacts, peak_force=np.full(len(impacts), math.nan), phase=np.full(len(impacts), math.nan))
    names = re.findall("<th>(.*?)</th>", unknown._repr_html_())
    assert "time" in names
    assert not {"phase", "peak_force"} & set(names)
    assert np.isnan(unknown["phase"]).all()
    assert np.isnan(unknown.to_pandas()["phase"]).all()
