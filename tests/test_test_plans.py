"""The test plans of the documentation are sound study files, and say what their words say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import read_study, same_study, study_text

import femimpact as fi

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs/howto/test_plan.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
HEAD = (ROOT / "femimpact/app/paper.toml").read_text(encoding="utf-8").partition("[base]")[0]
G = 9.80665


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_every_plan_is_a_study(tmp_path: Path, number: int) -> None:
    t = np.arange(500) * 1e-3
    rows = np.column_stack([t, np.sin(40.0 * np.pi * t)])
    np.savetxt(tmp_path / "shaker.csv", rows, delimiter=",")
    # a block without a drive goes with that of the random test
    plan = (
        BLOCKS[number] if re.search(r"^\[+(base|force)\]", BLOCKS[number], re.MULTILINE) else BLOCKS[5] + BLOCKS[number]
    )
    study = read_study(HEAD + plan, tmp_path / "study.toml")
    assert same_study(read_study(study_text(study), tmp_path / "study.toml"), study)


def bases() -> list[Any]:
    return [read_study(HEAD + block, Path("study.toml")).excitation for block in BLOCKS[:8]]


def test_the_plans_say_what_their_words_say() -> None:
    sweep, notch, _, dwell, steps, random, shock, bumps = bases()
    assert sweep.duration == pytest.approx(60.0 * np.log2(15.0), rel=1e-14)
    assert np.abs(sweep.displacement(np.linspace(10.0, 60.0, 100_000))).max() == pytest.approx(75e-6, rel=0.01)
    # in the notch and above the crossover the acceleration is the level, below the notch the displacement
    time = np.linspace(0.0, notch.duration, 200_001)
    frequency, size = notch.frequency_at(time), np.abs(notch.acceleration(time))
    for low, high, level in ((5.1, 5.5, 0.03 * G), (7.2, 19.0, 0.1 * G)):
        assert size[(frequency > low) & (frequency < high)].max() == pytest.approx(level, rel=1e-3)
    slow = frequency < 4.7
    assert size[slow].max() == pytest.approx(0.5e-3 * (2.0 * np.pi * 4.7) ** 2, rel=0.01)
    assert dwell == fi.SteppedSine([35.0], seconds=600.0, acceleration=2.0 * G, fade=0.5)
    assert steps.steps.tolist() == [20.0, 25.0, 31.5, 25.0, 20.0]
    # the mean square of a flat part and of two slopes of one power of the frequency
    slope = np.log2(10.0**0.3)
    level = 0.04 * G**2
    rise = level * 80.0 / (slope + 1.0) * (1.0 - 0.25 ** (slope + 1.0))
    fall = level * 350.0 / (1.0 - slope) * ((2000.0 / 350.0) ** (1.0 - slope) - 1.0)
    # the generator's amplitudes scatter about it
    assert random.rms == pytest.approx(np.sqrt(rise + level * 270.0 + fall), rel=0.02)
    assert shock == fi.Shock("half-sine", 294.1995, 0.011, delay=0.05)
    assert bumps.closed_form.duration == pytest.approx(4.5 + 21.0 * 0.006, rel=1e-12)
