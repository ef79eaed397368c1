"""A report of many results stays within its bound: fewer points of its lines, then fewer players, and it says so."""

from __future__ import annotations

import re

import numpy as np
import pytest
from builders import REFERENCE, reduced

import femimpact as fi
from femimpact.app.report.page import MOST_BYTES, Page, Section, page_bytes
from femimpact.app.report.player import player_element
from femimpact.app.report.script_page import bounded_page, thinned_path
from femimpact.svg import element, path_of


@pytest.fixture(scope="module")
def run():
    record = fi.Recorder(snapshots=2, snapshots_start=4.0)
    return fi.integrate(reduced(REFERENCE, 4, 10), fi.Sine(0.5e-3, 5.0), fi.EventDriven(), 8.0, record)


@pytest.mark.impacts
def test_a_report_of_dozens_of_responses_stays_within_its_bound_and_says_how(run, tmp_path):
    parts = {f"run {i}": run for i in range(12)}
    fi.report(tmp_path / "page.html", parts, REFERENCE)
    assert (tmp_path / "page.html").stat().st_size < MOST_BYTES
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "points of a line at most, its extremes among them" in text
    assert ">run 11<" in text


def test_a_thinned_path_keeps_its_ends_its_extremes_and_its_gaps():
    height = np.concatenate([np.sin(np.arange(3000.0)), [np.nan], 2.0 + np.sin(np.arange(1000.0))]) / 4.0 + 0.3
    path = path_of(np.linspace(0.0, 1.0, height.size), height)
    fewer = thinned_path(path, 200)
    assert fewer.count("M") == path.count("M") == 2
    whole, kept = (np.array(re.findall(r"(-?\d+) (-?\d+)", one), dtype=int) for one in (path, fewer))
    assert len(kept) <= 210
    assert {tuple(one) for one in kept} <= {tuple(one) for one in whole}
    assert (kept[:, 1].min(), kept[:, 1].max()) == (whole[:, 1].min(), whole[:, 1].max())
    assert (kept[[0, -1]] == whole[[0, -1]]).all()
    # what is closed is no line
    assert thinned_path(f"{path}Z", 200) == f"{path}Z"


@pytest.mark.impacts
def test_players_are_left_out_from_the_last_one_where_lines_do_not_do(run):
    players = [element("div", player_element(run, REFERENCE, None)) for _ in range(3)]
    sections = tuple(Section(f"part-{i}", f"run {i}", (player,)) for i, player in enumerate(players))
    page = Page("many", sections=sections)
    one = len(page_bytes(Page("many", sections=sections[:1])))
    text = page_bytes(bounded_page(page, one + 2000)).decode()
    assert len(text) <= one + 2000
    assert text.count('class="player"') == 1
    assert text.count("This player was left out") == 2
