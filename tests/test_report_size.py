"""A report of many results stays small: the first responses have a player, and of the others it says so."""

from __future__ import annotations

import pytest
from builders import REFERENCE, reduced

import femimpact as fi
from femimpact.app.report.script_page import MOST_PLAYERS


@pytest.mark.impacts
def test_of_many_responses_the_first_have_a_player_and_the_others_say_why_not(tmp_path):
    record = fi.Recorder(snapshots=2, snapshots_start=4.0)
    run = fi.integrate(reduced(REFERENCE, 4, 10), fi.Sine(0.5e-3, 5.0), fi.EventDriven(), 8.0, record)
    parts = {f"run {i}": run for i in range(MOST_PLAYERS + 2)}
    text = fi.report(tmp_path / "page.html", parts, REFERENCE).read_text(encoding="utf-8")
    assert text.count('class="player"') == MOST_PLAYERS
    assert text.count("player of this run was left out for the size of the page") == 2
    assert text.count("<figcaption>Channels over time") == len(parts)
