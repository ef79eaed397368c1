"""Tables on a terminal of 80 columns: no number loses a digit or its exponent, no line is longer."""

import io

import numpy as np
import pytest
from rich.console import Console

from femimpact.cli import print_table
from femimpact.units import number_text


def printed(header, rows, width=80):
    stream = io.StringIO()
    print_table(Console(file=stream, highlight=False, width=width), header, rows, "A table")
    return stream.getvalue()


@pytest.mark.parametrize("seed", range(20))
def test_every_number_is_whole_at_any_width(seed):
    rng = np.random.default_rng(seed)
    columns, width = int(rng.integers(1, 15)), int(rng.integers(60, 120))
    values = 10.0 ** rng.uniform(-12, 12, (4, columns)) * rng.choice([-1.0, 1.0], (4, columns))
    text = printed([f"quantity number {i} (m/s)" for i in range(columns)], values.tolist(), width)
    assert max(map(len, text.splitlines())) <= width
    cells = text.split()
    for value in values.ravel():
        assert number_text(value, 5) in cells


def test_words_are_wrapped_and_none_is_lost():
    sentence = "a remark of many words that no terminal of eighty columns shows in one line beside numbers"
    rows = [("first", sentence, 1.2345e-10), ("second", sentence[::-1], None)]
    text = printed(("name", "remark", "number"), rows)
    assert max(map(len, text.splitlines())) <= 80
    for word in (*sentence.split(), *sentence[::-1].split(), "1.2345e-10", "-"):
        assert word in text


def test_what_all_rows_say_stands_above_them_once():
    text = printed(("law", "speed", "restitution"), [("rigid", 1.0, 0.5), ("rigid", 2.0, 0.5)])
    assert text.count("rigid") == text.count("0.5") == 1


def test_a_table_of_equal_rows_still_has_its_rows():
    assert printed(("a", "b"), [(1.0, 2.0), (1.0, 2.0)]).count("1") == 2
