"""`refine` finds the best design between the cases of a study, and goes on from what is on disk."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from builders import build, oscillator, paper_study_text, read_study

import femimpact as fi

RATIO, LEVEL = 0.05, 1e-3
FREQUENCIES = [4.0, 6.0]
DRIVE = {"excitation": fi.Sine(LEVEL, 5.0), "cycles": 60, "starts": 1}


def mass_on(natural: float) -> fi.System:
    """An oscillator of a natural frequency (Hz)."""
    omega = 2.0 * np.pi * natural
    return oscillator(omega**2, 2.0 * RATIO * omega)


def relative_peak(natural: float, frequency: float) -> float:
    """Steady peak (m) relative to the base, r^2/|1 - r^2 + 2 i zeta r| of the base's amplitude."""
    r = frequency / natural
    return LEVEL * r**2 / abs(1.0 - r**2 + 2j * RATIO * r)


def search(bounds: tuple[float, float] = (4.1, 5.9), **more: object) -> fi.app.Refinement:
    """The natural frequency whose worst peak under two frequencies of the base is smallest."""
    return fi.refine(mass_on, "peak", {"natural": bounds, "base.frequency": FREQUENCIES}, **{**DRIVE, **more})


def test_the_best_of_a_closed_form_is_found_to_the_last_spacing() -> None:
    natural = np.linspace(4.1, 5.9, 18_001)
    worst = np.max([[relative_peak(one, f) for f in FREQUENCIES] for one in natural], axis=1)
    found = search().best.designs[0]
    # boxes of half-width 1/32 and 1/256 of the bounds, the first with 8 points
    assert found.values["natural"] == pytest.approx(natural[worst.argmin()], abs=1.8 / 128)
    # a transient of e^(-2 pi 0.05 40) = 3e-6 is left when measuring begins
    assert found.value == pytest.approx(worst.min(), rel=0.02)
    assert found.value >= worst.min() * (1.0 - 1e-4)


def test_more_rounds_are_no_worse_and_come_closer() -> None:
    values = [search(rounds=rounds).best.designs[0].value for rounds in (0, 1, 2)]
    assert values[0] >= values[1] >= values[2]


def test_a_best_at_a_bound_is_found_there() -> None:
    # far above both frequencies the peak falls with the natural frequency
    found = search((10.0, 20.0))
    assert found.best.designs[0].values["natural"] > 20.0 - 10.0 / 32
    assert found.dataset["natural"].max() <= 20.0


def test_limits_hold_for_the_winner() -> None:
    free = search(rounds=0).best.designs[0]
    found = search(limits={"rms": 0.99 * relative_peak(free.values["natural"], 4.0)})
    assert found.best.designs[0].limited["rms"] <= found.best.limits["rms"]


def test_the_same_call_goes_on_from_what_is_on_disk(tmp_path: Path) -> None:
    whole = search(directory=tmp_path / "a")
    blocks = {path: path.stat().st_mtime_ns for path in sorted((tmp_path / "a").rglob("*.block"))}
    again = search(directory=tmp_path / "a")
    assert blocks == {path: path.stat().st_mtime_ns for path in sorted((tmp_path / "a").rglob("*.block"))}
    assert len({path.parents[1] for path in blocks}) == 3
    assert str(again) == str(whole)
    assert again.dataset.drop_attrs().equals(whole.dataset.drop_attrs())


def test_progress_rises_over_all_rounds_to_one() -> None:
    shares: list[float] = []
    search(progress=lambda done: shares.append(float(done)))
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert shares[-1] == 1.0


def test_axes_of_a_study_file_are_searched_between_their_ends_and_met_in_full() -> None:
    text = (
        paper_study_text()
        + """
[study]
measures = ["peak"]
[study.axes]
"impactor.ball.gap" = [0.002, 0.003, 0.006]
"damping.ratio" = [0.002, 0.003, 0.004]
[study.best]
measure = "peak"
worst_over = ["damping.ratio"]
"""
    )
    found = fi.refine(read_study(text, Path("study.toml")), "peak", rounds=0, starts=1, cycles=3)
    assert found.best.worst_over == ("damping.ratio",)
    assert sorted(set(found.dataset["damping.ratio"].values.tolist())) == [0.002, 0.003, 0.004]
    gaps = found.dataset["impactor.ball.gap"]
    assert 0.002 <= gaps.min() <= gaps.max() <= 0.006
    other = text.replace("[0.002, 0.003, 0.006]", "{ normal = [0.004, 0.0002] }") + "[study.sample]\npoints = 4\n"
    with pytest.raises(fi.InputError, match=r"study\.axes\.impactor\.ball\.gap.*list of numbers"):
        fi.refine(read_study(other, Path("study.toml")), "peak", rounds=0, starts=1, cycles=3)


@pytest.mark.parametrize(
    ("axes", "more", "words"),
    [
        (
            {"natural": (5.0, 4.0), "base.frequency": [4.0]},
            {},
            r"axes\.natural = \(5\.0, 4\.0\): must be \(low, high\)",
        ),
        ({"natural": [4.0, 5.0, 6.0]}, {}, r"axes\.natural"),
        # two values of a list may be all that is meant
        ({"natural": [4.0, 5.0], "base.frequency": [4.0]}, {}, r"must be \(low, high\), as a tuple: a list of values"),
        ({"base.frequency": [4.0, 5.0]}, {}, "no axis to choose on"),
        ({"natural": (4.0, 5.0)}, {"worst_over": ["base.amplitude"]}, "worst_over"),
        ({"natural": (4.0, 5.0), "base.amplitude": (1e-3, 2e-3)}, {}, r"axes\.base\.amplitude.*name it in worst_over"),
        (None, {}, r"no table \[study.axes\]"),
        ({"natural": (4.0, 5.0), "base.frequency": [4.0, 5.0]}, {"rounds": -1}, "rounds"),
        (
            {"natural": (4.0, 5.0), "base.frequency": [4.0, 5.0]},
            {"measure": "damping"},
            "small or large values are better",
        ),
        ({"natural": (4.0, 5.0), "base.frequency": [4.0, 5.0]}, {"limits": {"peek": 1.0}}, "peek"),
    ],
)
def test_bad_input_is_one_line(axes: object, more: dict[str, object], words: str) -> None:
    with pytest.raises(fi.InputError, match=words) as refused:
        fi.refine(mass_on, axes=axes, **{"measure": "peak", **DRIVE, **more})
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("more", [{"measure": "peak_force"}, {"measure": "peak", "limits": {"peak_force": 50.0}}])
def test_the_force_of_a_rigid_ball_is_refused_before_the_first_round(more: dict[str, object]) -> None:
    contact = re.compile(r"^contact = .*$", re.MULTILINE)
    text = contact.sub('contact = { law = "rigid", restitution = 0.78 }', paper_study_text())
    study = read_study(text.replace('"newmark"', '"event-driven"'), Path("study.toml"))
    axes = {"impactor.ball.gap": (1e-3, 3e-3), "base.frequency": [4.9, 5.0]}
    begun: list[object] = []
    for given in (study, build(study)[1]):
        drive = {} if given is study else {"excitation": study.excitation}
        named = axes if given is study else {"impactor.ball.gap": (1e-3, 3e-3), "base.frequency": [4.9, 5.0]}
        with pytest.raises(fi.InputError, match=r"^peak_force: has no value .*\(ball: rigid\)") as refused:
            fi.refine(given, axes=named, starts=1, cycles=3, progress=begun.append, **drive, **more)
        assert len(str(refused.value).splitlines()) == 1
    assert not begun
