"""What is said of a run whose drive has no cycle: its last third whole, no word for what repeats, and where it ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, paper_study, prepare, summary_of

import femimpact as fi

pytestmark = pytest.mark.impacts


SMALL = fi.reduce(fi.assemble(REFERENCE, elements=20), 2)
RATE = 500.0
TIME = np.arange(0.0, 8.0, 1.0 / RATE)
NOISE = np.random.default_rng(1).normal(size=TIME.size)


def noise(seed, size=2.0):
    return fi.RecordedBase(size * np.random.default_rng(seed).normal(size=TIME.size), 1.0 / RATE).returning()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(fi.recommended_step(SMALL))])
def test_recorded_noise_is_called_by_no_word_for_what_repeats(seed, method):
    run = fi.integrate(SMALL, noise(seed, 5.0), method, 8.0)
    assert len(run.impacts) > 0
    assert run.regime.kind == "not periodic"
    assert np.isnan(run.statistics.impacts_per_cycle)
    late = run["tip"][run.time >= run.window[0]]
    assert run.steady.rms[0] == np.sqrt(np.mean(late**2))
    for channel in ("tip", "ball"):
        assert abs(run.largest(channel).value) >= np.abs(run[channel]).max() * (1.0 - 1e-9)


@pytest.mark.parametrize(
    ("samples", "cycle"),
    [
        (np.sin(2 * np.pi * 5.0 * TIME), True),
        # between two lines of the spectrum, with an offset, a drift and noise
        (np.sin(2 * np.pi * 5.06 * TIME) + 3.0 - 0.2 * TIME + 0.3 * NOISE, True),
        (np.sign(np.sin(2 * np.pi * 5.03 * TIME)), True),
        (np.sin(2 * np.pi * (3.0 + TIME) * TIME), False),
        (np.where(TIME < 0.011, 1.0, 0.0), False),
        # one cycle: nothing repeats
        (np.sin(2 * np.pi * 0.125 * TIME), False),
        # a burst that dies away, as an earthquake with one strong line
        (np.exp(-((TIME - 2.0) ** 2)) * np.sin(2 * np.pi * 3.0 * TIME), False),
        # a sine that begins late
        (np.where(TIME > 2.0, np.sin(2 * np.pi * 5.0 * TIME), 0.0), True),
        (np.zeros(TIME.size), False),
        (0.5 * TIME, False),
    ],
)  # fmt: skip
def test_a_record_has_a_cycle_where_one_line_has_most_of_it(samples, cycle):
    record = fi.RecordedBase(samples, 1.0 / RATE)
    assert record.has_cycle == cycle
    assert fi.PointForce("tip", record).has_cycle == cycle
    for size in (1e-6, 1e6):
        assert fi.RecordedBase(size * samples, 1.0 / RATE).has_cycle == cycle


def test_noise_has_no_cycle_whatever_its_length():
    rng = np.random.default_rng(2)
    for size in (100, 1000, 100_000):
        assert not any(fi.RecordedBase(rng.normal(size=size), 1e-3).has_cycle for _ in range(10))


def test_a_summary_has_one_rms_of_the_last_third():
    record = noise(3)
    rows = "\n".join(f"{t:.6f},{a:.12g}" for t, a in zip(TIME, record.samples, strict=True))
    study = replace(paper_study(), base=fi.RecordedBase.from_text(f"{rows}\n"), duration=None, sweep=None)
    prepared = prepare(study, ("simulate",))
    run = fi.integrate(
        prepared.small, study.excitation, prepared.method, study.history_duration, prepared.record
    )  # fmt: skip
    history = summary_of(prepared, response=run)["history"]
    assert history["rms"] == history["channels"]["tip"]["rms"]
    assert "frequency" not in history
    for name, found in history["channels"].items():
        assert found["largest_of_run"] >= found["largest"] * (1.0 - 1e-9), name
    assert "no cycle" in study.history_words


def test_a_run_that_ends_elsewhere_than_asked_says_where():
    record = fi.Recorder(channels=("tip",), interval=0.0083)
    found = fi.integrate(SMALL, fi.Shock("half-sine", 5.0, 0.011), fi.EventDriven(), 0.5999, record)
    assert found.time[-1] == pytest.approx(0.5976)
    (note,) = [text for text in found.notes if "and not at" in text]
    assert "ends at 0.5976 s" in note
    assert "0.5999 s" in note
    # half a step of many is not worth a word
    for drive, method in (
        (fi.Sine(1e-3, 5.0), fi.EventDriven()),
        (noise(1), fi.EventDriven()),
        (noise(1), fi.Newmark(2e-4)),
    ):
        assert not any("and not at" in text for text in fi.integrate(SMALL, drive, method, 2.00007).notes)
