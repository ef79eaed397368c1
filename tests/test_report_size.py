"""A report of many results stays within its bound: fewer players, then fewer pictures, and it says so."""

from __future__ import annotations

import pytest
from builders import REFERENCE, reduced

import femimpact as fi
from femimpact.app.report.markup import element
from femimpact.app.report.page import MOST_BYTES, Page, Section, page_bytes
from femimpact.app.report.player import player_element
from femimpact.app.report.script_page import bounded_page


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
    assert "player was left out for the size of the page" in text
    assert text.count('class="player"') >= 1
    assert text.count('class="picture"') >= 1
    assert ">run 11<" in text


@pytest.mark.impacts
def test_players_are_left_out_from_the_last_one_where_lines_do_not_do(run):
    players = [element("div", player_element(run, REFERENCE, None, f"player-{i}")) for i in range(3)]
    sections = tuple(Section(f"part-{i}", f"run {i}", (player,)) for i, player in enumerate(players))
    page = Page("many", sections=sections)
    one = len(page_bytes(Page("many", sections=sections[:1])))
    text = page_bytes(bounded_page(page, one + 2000)).decode()
    assert len(text) <= one + 2000
    assert text.count('class="player"') == 1
    assert text.count("This player was left out") == 2
