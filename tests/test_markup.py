"""Texts of a page stay texts, thinned lines keep every extreme, and a picture is the same bits twice."""

from __future__ import annotations

import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from femimpact.app.report.markup import data_element, element, markup, picture_element
from femimpact.arrays import thinned_line
from femimpact.figures.drawing import OffScreen, label_axes, legend_above, panel
from femimpact.units import typeset_number

MOST_POINTS = 2000

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
    kept = thinned_line(values, MOST_POINTS)
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
    assert 77_777 in thinned_line(values, MOST_POINTS)


def test_gaps_are_left_out_of_the_extremes():
    values = np.where(np.arange(9000) % 3 == 0, np.nan, np.arange(9000.0))
    kept = values[thinned_line(values, MOST_POINTS)]
    assert (np.nanmin(kept), np.nanmax(kept)) == (1.0, 8999.0)


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
    assert typeset_number(value) == text


def test_zeros_that_say_how_exact_a_number_is_stay():
    assert [typeset_number(value, zeros=True) for value in (5.3, 100.0, 0.29)] == ["5.300", "100.0", "0.2900"]


# ---- pictures -------------------------------------------------------------------------------------


def drawn(title="t", marks=3):
    """Axes with marks, and with a text wherever a figure has one."""
    axis = panel(OffScreen(), 6.0, 3.0)
    axis.plot(np.arange(marks), np.arange(marks), "o", label=title)
    axis.annotate(title, (0.0, 0.0))
    label_axes(axis, title, title, title)
    legend_above(axis)
    return axis


@pytest.mark.filterwarnings("ignore:Glyph .* missing from")
@pytest.mark.parametrize("text", HOSTILE)
def test_every_text_of_a_picture_stays_text(text):
    hostile, plain = (Parsed(markup(picture_element(drawn(words), "key", words))) for words in (text, "word"))
    assert hostile.tags == plain.tags
    names = [[(tag, name) for tag, name, _ in page.attributes] for page in (hostile, plain)]
    assert names[0] == names[1]


def test_a_picture_is_the_same_bits_twice_and_asks_for_nothing():
    text = markup(picture_element(drawn(), "key", "t"))
    assert markup(picture_element(drawn(), "key", "t")) == text
    assert "http" not in text
    assert "<style" not in text
    page = Parsed(text)
    identifiers = {value for _, name, value in page.attributes if name == "id"}
    assert identifiers
    assert all(value.startswith("key-") for value in identifiers)
    referred = {value[1:] for _, name, value in page.attributes if name == "href"}
    referred |= set(re.findall(r"url\(#([^)]*)\)", text))
    # what is referred to is there, and nothing else has an identifier
    assert referred == identifiers


@pytest.mark.parametrize(("marks", "images"), [(5000, 0), (5001, 1)])
def test_many_marks_are_one_image(marks, images):
    text = markup(picture_element(drawn(marks=marks), "key", "t"))
    assert text.count("<image") == images
    assert text.count("data:image/png") == images
    assert len(text) < 500_000
