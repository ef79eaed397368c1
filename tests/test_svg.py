"""Charts: thinning keeps every extreme, ticks are round, lines are read back as they were, and no text is markup."""

from __future__ import annotations

import math
import re
import warnings
from html.parser import HTMLParser

import numpy as np
import pytest

from femimpact.svg import (
    GRID,
    MOST_POINTS,
    Axis,
    Band,
    Chart,
    Line,
    axis_of,
    chart_element,
    data_element,
    element,
    markup,
    notebook_markup,
    thinned_line,
)
from femimpact.units import typeset

HOSTILE = ("<script>alert(1)</script>", '" onload="alert(1)', "</style><b>", "a & b", "\0\x1b\ud800", "]]>", "<!--")


class Parsed(HTMLParser):
    """Tags, attributes and text of a document."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str | None]] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        """Note an element and its attributes."""
        self.tags.append(tag)
        self.attributes += [(tag, name, value) for name, value in attrs]

    def handle_data(self, data):
        """Note a text."""
        self.text += data


@pytest.mark.parametrize("count", [0, 1, 5, MOST_POINTS, MOST_POINTS + 1, 54_321])
def test_a_thinned_line_keeps_ends_and_every_extreme_of_its_stretches(count):
    values = np.random.default_rng(count).standard_normal(count)
    kept = thinned_line(values)
    assert kept.size <= MOST_POINTS
    assert np.all(np.diff(kept) > 0)
    if count:
        assert {0, count - 1} <= set(kept.tolist())
        assert values[kept].min() == values.min()
        assert values[kept].max() == values.max()
        # no stretch of four times the mean distance between two points hides a larger value than is drawn there
        stretch = max(4 * count // MOST_POINTS, 1)
        for first in range(0, count - stretch, stretch):
            near = kept[(kept >= first - stretch) & (kept < first + 2 * stretch)]
            assert values[near].max() >= values[first : first + stretch].max()


def test_one_sample_of_a_hundred_thousand_is_drawn():
    values = np.zeros(100_000)
    values[77_777] = 1.0
    assert 77_777 in thinned_line(values)


def test_gaps_are_left_out_of_the_extremes():
    values = np.where(np.arange(9000) % 3 == 0, np.nan, np.arange(9000.0))
    kept = values[thinned_line(values)]
    assert (np.nanmin(kept), np.nanmax(kept)) == (1.0, 8999.0)


@pytest.mark.parametrize("seed", range(20))
def test_linear_ticks_are_round_lie_within_the_range_and_say_their_value(seed):
    random = np.random.default_rng(seed)
    low = random.uniform(-1, 1) * 10.0 ** random.integers(-6, 6)
    axis = Axis("x", low, low + 10.0 ** random.uniform(-4, 5))
    ticks = axis.ticks
    assert 3 <= len(ticks) <= 15
    steps = np.diff([value for value, _ in ticks])
    assert np.allclose(steps, steps[0], rtol=1e-6)
    mantissa = steps[0] / 10.0 ** math.floor(math.log10(steps[0]) + 1e-9)
    assert min(abs(mantissa - n) for n in (1, 2, 5, 10)) < 1e-6
    for value, text in ticks:
        assert axis.low - 1e-9 * steps[0] <= value <= axis.high + 1e-9 * steps[0]
        if "\u00d7" not in text:
            assert float(text.replace("\u2212", "-")) == pytest.approx(value, abs=1e-6 * steps[0] + 1e-9 * abs(value))
    assert len({text for _, text in ticks}) == len(ticks)


@pytest.mark.parametrize("decades", [0.3, 1.0, 2.5, 4.0, 9.0, 30.0, 300.0])
def test_logarithmic_ticks_lie_within_the_range(decades):
    axis = axis_of("x", [10.0 ** (-decades / 2), 10.0 ** (decades / 2)], logarithmic=True)
    assert 1 <= len(axis.ticks) <= 12
    assert all(axis.low <= value <= axis.high for value, _ in axis.ticks)


@pytest.mark.parametrize(
    "values",
    [[], [0.0], [1.0, 1.0], [np.nan], [np.inf, 1.0], [-1e308, 1e308], [5e-324], [1e-300, 2e-300], [1e16, 1e16 + 2]],
)
@pytest.mark.parametrize("logarithmic", [False, True])
def test_any_numbers_have_an_axis_and_a_chart(values, logarithmic):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        axis = axis_of("y", values, logarithmic=logarithmic)
        assert math.isfinite(axis.low)
        assert axis.low < axis.high < math.inf
        line = Line("line", np.arange(float(len(values))), np.array(values, dtype=float))
        text = markup(chart_element(Chart("", axis_of("x", line.x), axis, (line,))))
    assert "nan" not in text
    assert "inf" not in text


def test_values_are_read_back_from_the_drawn_line():
    x, y = np.linspace(2.0, 7.0, 300), np.sin(np.linspace(0.0, 9.0, 300)) * 3e-3
    chart = Chart("", axis_of("x", x, tight=True), axis_of("y", y), (Line("sine", x, y),))
    figure = chart_element(chart)
    path = next(one for one in figure.iter("path") if one.get("data-name") == "sine")
    points = np.array(re.findall(r"[ML](-?\d+) (-?\d+)", path.get("d")), dtype=float)
    ends = {name: [float(word) for word in figure.get(f"data-{name}").split()[:2]] for name in "xy"}
    across = ends["x"][0] + points[:, 0] / GRID * (ends["x"][1] - ends["x"][0])
    up = ends["y"][0] + (1 - points[:, 1] / GRID) * (ends["y"][1] - ends["y"][0])
    # half a step of the grid
    assert np.abs(across - x).max() <= 0.51 * 5.0 / GRID
    assert np.abs(up - y).max() <= 0.51 * (ends["y"][1] - ends["y"][0]) / GRID


def test_a_gap_of_a_line_is_not_bridged():
    y = np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    figure = chart_element(Chart("", axis_of("x", np.arange(5.0)), axis_of("y", y), (Line("a", np.arange(5.0), y),)))
    path = next(one for one in figure.iter("path") if one.get("data-name") == "a")
    assert path.get("d").count("M") == 2


@pytest.mark.parametrize("text", HOSTILE)
def test_every_text_of_a_chart_stays_text(text):
    x = np.arange(3.0)
    chart = Chart(
        text, axis_of(text, x), axis_of(text, x), (Line(text, x, x), Line("b", x, x)), (Band(text, x, x, x + 1),),
        levels=((text, 1.0),), places=((text, 1.0),), note=text,
    )  # fmt: skip
    plain = markup(chart_element(Chart("t", axis_of("a", x), axis_of("b", x), chart.lines, chart.bands,
                                       (("l", 1.0),), (("p", 1.0),), "n")))  # fmt: skip
    whole = markup(chart_element(chart))
    found, same = Parsed(whole), Parsed(plain)
    assert found.tags == same.tags
    assert [(tag, name) for tag, name, _ in found.attributes] == [(tag, name) for tag, name, _ in same.attributes]
    whole.encode("utf-8")


@pytest.mark.parametrize("text", HOSTILE)
def test_data_for_a_script_ends_only_where_it_ends(text):
    found = Parsed(markup(element("div", data_element({"name": text}), element("p", "after"))))
    assert found.tags == ["div", "script", "p"]


def test_a_style_or_a_script_that_holds_its_own_end_is_refused():
    with pytest.raises(ValueError, match="holds its own end"):
        markup(element("style", "a { } </STYLE><b>"))


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-1.5, "\u22121.5"), (12345.0, "12345"), (1.25e-7, "1.25\u00d710\u207b\u2077"), (math.nan, "\u2013"),
     (math.inf, "\u221e"), (-math.inf, "\u2212\u221e")],
)  # fmt: skip
def test_numbers_for_the_eye(value, text):
    assert typeset(value) == text


def test_zeros_that_say_how_exact_a_number_is_stay():
    assert [typeset(value, zeros=True) for value in (5.3, 100.0, 0.29)] == ["5.300", "100.0", "0.2900"]


def test_a_chart_of_a_notebook_is_small_whatever_the_line():
    x = np.linspace(0.0, 1.0, 200_000)
    lines = tuple(Line(f"{i}", x, np.random.default_rng(i).standard_normal(x.size), 1 + i) for i in range(3))
    text = notebook_markup(Chart("", axis_of("x", x), axis_of("y", lines[0].y), lines))
    assert len(text) < 50_000
