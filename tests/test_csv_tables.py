"""A table on disk is read back as it was written, and a damaged cell of numbers is an error with its line."""

from __future__ import annotations

import numpy as np
import pytest
from builders import read_csv

from femimpact.files import write_csv

COLUMNS = {"time": np.array([0.0, 1e-300, -1.5e300]), "ball": np.array(["a", "1", "b, c"]), "count": [1, 2, 3]}


@pytest.fixture
def table(tmp_path):
    return write_csv(tmp_path / "a.csv", COLUMNS, {"time": "s"})


def test_what_was_written_is_read(table, tmp_path):
    found = read_csv(table)
    assert {name: list(values) for name, values in found.items()} == {k: list(v) for k, v in COLUMNS.items()}
    # a third and its neighbour differ in the last bit
    wild = np.array([np.nan, np.inf, -np.inf, 5e-324, 1 / 3, np.nextafter(1 / 3, 1.0)])
    assert np.array_equal(read_csv(write_csv(tmp_path / "b.csv", {"x": wild}, {"x": "m"}))["x"], wild, equal_nan=True)


@pytest.mark.parametrize("cell", ["1_0", "0x10", "\uff11", "1.5abc", "", "infinity", "1e"])
def test_a_cell_of_a_column_with_a_unit_that_is_no_number_is_named(table, cell):
    table.write_text(table.read_text().replace("1e-300", cell), encoding="utf-8")
    with pytest.raises(ValueError, match=f"line 3, time: {cell!r} is no number"):
        read_csv(table)


def test_a_decimal_comma_is_one_cell_more(table):
    table.write_text(table.read_text().replace("1e-300", "1,5"))
    with pytest.raises(ValueError, match="line 3 has 4 cells, the header 3"):
        read_csv(table)


def test_an_empty_table_is_an_error(table):
    table.write_text("")
    with pytest.raises(ValueError, match="it is empty"):
        read_csv(table)
