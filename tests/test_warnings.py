"""Every warning of a run has an anchor on the page of warnings, by its words: what it means, what to do, an example."""

from __future__ import annotations

import ast
import re
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact.app.report.page import WARNINGS_PAGE
from femimpact.app.study.summary import _curve_warnings
from femimpact.errors import warnings_left_to_caller
from femimpact.sweep.curve import TAKE_STARTS, _steadiness_warnings

pytestmark = pytest.mark.impacts

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "reference" / "warnings.md").read_text("utf-8")
SECTIONS = dict(re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))

SITES = {
    ("app/tasks/starts.py", "_failures"): ["of the further starts failed"],
    ("sweep/curve.py", "_steadiness_warnings"): ["the motion never repeats",
                                                 "the two halves of the measured time differ"],
    ("sweep/curve.py", "dwell_warnings"): ["of the first mode's transient"],
    ("response/cycles.py", "resolution_warnings"): ["does not resolve the half-power width"],
    ("signals/one_pole.py", "half_power"): ["no half-power point"],
    ("signals/one_pole.py", "fit_one_pole"): ["no resonance within", "no interval: the misfit of",
                                                     "read the ratio as an equivalent one",
                                                     "do not determine a damping ratio"],
    ("signals/decay.py", "identify_decay"): ["the signal is clipped", "the envelope beats", "no free decay",
                                                    "no decay can be told from noise", "the record is rounded",
                                                    "the times wander"],
    ("signals/damped_sines.py", "reason_against"): ["no linear decay"],
    ("signals/damped_sines.py", "windows"): ["the decrement changes within one"],
    ("excitation/remarks.py", "motion_warnings"): ["is the amplitude of the base in metres",
                                                   "the mean acceleration of its record is"],
    ("excitation/remarks.py", "_removed_of_pulse"): ["the record is a pulse that changes the velocity"],
    ("excitation/remarks.py", "_kept"): ["no mode is kept"],
    ("integrators/channel_rows.py", "mode_notes"): ["changes slowly lacks the difference",
                                                    "modes are left out: reactions"],
    ("integrators/record_reading.py", "coarse_record"): ["the record is coarse"],
    ("integrators/stepping/operators.py", "check_step"): ["coarse step"],
    ("integrators/stepping/run.py", "_residual_warnings"): ["energy residual"],
    ("integrators/event_driven/run.py", "_balance_warnings"): ["energy residual"],
    ("integrators/runs.py", "response_by"): ["are not in the table"],
    ("response/energy.py", "residual_warnings"): ["energy residual"],
    ("integrators/runs.py", "_coarse_forces"): ["readings in it miss its peak"],
    ("response/cycles.py", "deflection_warnings"): ["linear beam theory"],
    ("app/study/prepared.py", "_coarse_history"): ["misses the extremes between them"],
    ("app/study/prepared.py", "_empty_sweep"): ["no natural frequency lies between them"],
    ("integrators/runs.py", "_missed_restitutions"): ["the law is made for the first mode's mass"],
    ("app/study/summary.py", "_estimates"): ["the motion around the peak does not repeat"],
    ("app/report/pictures.py", "with_pictures"): ["not drawn"],
    ("app/tasks/task.py", "_without"): ["the run was ended before"],
    ("signals/densities.py", "record_of"): ["lacks the impulses of"],
    ("signals/densities.py", "width_warnings"): ["are coarser than a fifth of the half-power width"],
    ("signals/densities.py", "too_coarse"): ["would be an alias"],
    ("signals/estimates.py", "_by_dwells"): ["dwells are not steady"],
    ("signals/transfer.py", "transfer_function"): ["in contact at rest"],
    ("integrators/planned_drive.py", "row_of"): ["(limit: at"],
    ("integrators/planned_drive.py", "_begin_in_motion"): ["begins in motion"],
    ("integrators/planned_drive.py", "contact_notes"): ["in contact at rest"],
    ("structure/structure.py", "unusual_numbers"): ["is it in Pa", "is it a percentage", "shear and rotary inertia"],
    ("fem/axial.py", "weight_words"): ["along the beam is left out"],
    ("fem/assembly.py", "unusual_words"): ["are units SI"],
}  # fmt: skip
"""Functions that make warnings of a run, and headings of the page that are words of them or of their module."""

BY_OTHERS = {
    "_estimate_warnings", "_curve_warnings", "_grid_warnings", "drive_warnings", "frequency_warnings",
    "result_warnings",
}  # fmt: skip
"""Functions that hand on what those above make, or begin it."""


def literals(path: Path) -> str:
    """All text of a module's strings, with braces for what they are filled with."""
    found = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.JoinedStr):
            found.append("".join(str(p.value) if isinstance(p, ast.Constant) else "{}" for p in node.values))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.append(node.value)
    return "\n".join(found)


@pytest.mark.parametrize("site", SITES, ids=":".join)
def test_the_words_of_each_heading_are_words_of_the_package(site):
    path, function = site
    assert f"def {function}(" in (ROOT / "femimpact" / path).read_text("utf-8")
    text = literals(ROOT / "femimpact" / path)
    for heading in SITES[site]:
        assert heading in text
        assert heading in SECTIONS


def test_the_page_is_named_by_its_title_and_part_of_the_site():
    title, part = re.findall(r'"(.*?)"', WARNINGS_PAGE)
    assert PAGE.startswith(f"# {title}\n")
    index = (ROOT / "docs" / "reference" / "index.md").read_text("utf-8")
    assert index.startswith(f"# {part}\n")
    assert "](warnings.md)" in index


def test_no_heading_is_of_a_warning_that_is_not_made():
    assert set(SECTIONS) == {heading for headings in SITES.values() for heading in headings}


@pytest.mark.parametrize("heading", SECTIONS)
def test_each_says_what_it_means_what_to_do_and_has_an_example(heading):
    for part in ("*Means:* ", "*Do:* ", "*Example:* "):
        assert SECTIONS[heading].count(part) == 1


@pytest.mark.parametrize("starts", [1, 5])
def test_a_study_with_several_starts_is_not_told_to_take_them(starts):
    curve = SimpleNamespace(
        warnings=(f"not steady at 1 of 9 frequencies (5 Hz): the motion never repeats; {TAKE_STARTS}",)
    )
    none = fi.signals.DampingEstimate(np.nan, np.nan, (np.nan, np.nan), "none")
    prepared = SimpleNamespace(study=SimpleNamespace(sweep=SimpleNamespace(starts=starts)))
    (text,) = _curve_warnings(curve, none, none, prepared)
    assert (TAKE_STARTS in text) == (starts == 1)
    assert ("over the starts" in text) == (starts == 5)
    assert "the motion never repeats" in text


def test_every_function_of_warnings_is_listed():
    known = {name for _, name in SITES} | BY_OTHERS
    for path in (ROOT / "femimpact").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef) and re.search(r"_warnings?$", node.name) and path.name != "cli.py":
                assert node.name in known, (path, node.name)


def test_impacts_that_never_repeat_are_told_from_what_has_not_died_out():
    system = reduced(with_ball(REFERENCE), 3)
    frequencies = np.linspace(4.9, 5.4, 26)
    # the first mode's transient after 2/3 of the cycles: exp(-0.0029 * 2 pi * 5.3/f * n 2/3)
    for cycles, words in (
        (60, "take a longer dwell"),
        (450, "the motion never repeats; take medians over several starts"),
    ):
        curve = fi.frequency_sweep(system, 0.2e-3, frequencies, fi.EventDriven(), cycles, ledger=False)
        said = [text for text in curve.warnings if text.startswith("not steady")]
        assert all(words in text for text in said)
        assert all(any(heading in text for heading in SECTIONS) for text in curve.warnings)
        # whether the halves of a chaotic dwell differ depends on the last bit of the modes: such halves by hand
        cases = SimpleNamespace(frequency=frequencies, cycles=np.full(26, cycles), measured=np.full(26, cycles // 3))
        columns = {"steadiness": np.full(26, "transient"), "impacts_per_cycle": np.full(26, 2.0)}
        (text,) = _steadiness_warnings(system, cases, columns)
        assert words in text
        assert "at 26 of 26 frequencies (4.9 to 5.4 Hz)" in text
        columns["steadiness"] = np.where(np.arange(26) == 0, "transient", "periodic")
        (text,) = _steadiness_warnings(system, cases, columns)
        assert "at 1 of 26 frequencies (4.9 Hz)" in text
    # without a ball nothing is chaotic, however short the dwell
    curve = fi.frequency_sweep(fi.without_impactors(system), 0.2e-3, frequencies, fi.EventDriven(), 60, ledger=False)
    assert any("take a longer dwell" in text for text in curve.warnings)
    assert not any("never repeats" in text for text in curve.warnings)


def result_warnings(function):
    """What a function returns, and the words of each `ResultWarning` with the file that it names."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = function()
    of_results = [one for one in caught if one.category is fi.ResultWarning]
    return result, [str(one.message) for one in of_results], {one.filename for one in of_results}


def test_each_warning_of_a_run_is_one_python_warning_with_its_page_at_the_line_of_the_call():
    large, quiet = fi.Sine(2e-3, 5.3), fi.Sine(1e-6, 5.3)
    system = reduced(REFERENCE, 4)
    run, words, files = result_warnings(lambda: fi.integrate(system, large, fi.EventDriven(), 10.0))
    assert len(run.warnings) >= 1
    assert words == [f"{text} (docs/reference/warnings.md)" for text in run.warnings]
    assert files == {__file__}
    run, words, _ = result_warnings(lambda: fi.integrate(system, quiet, fi.EventDriven(), 10.0))
    assert (run.warnings, words) == ((), [])


def test_a_call_warns_once_for_its_cases_and_not_for_the_calls_in_it():
    system, f = reduced(REFERENCE, 4), [5.1, 5.2, 5.3]
    curves, words, _ = result_warnings(
        lambda: fi.frequency_sweep(system, 2e-3, f, fi.EventDriven(), cycles=30, direction="both")
    )
    different = {text for curve in curves.values() for text in curve.warnings}
    assert len(different) > 1
    assert len(words) == 1
    assert f"{len(different) - 1} more in the warnings of 2 results" in words[0]
    # a study, whose dataset has one text
    axes = {"impactor.ball.gap": [3e-3, 4e-3]}
    dataset, words, _ = result_warnings(
        lambda: fi.parameter_study(system, axes, ["peak"], excitation=fi.Sine(1e-2, 5.3), cycles=60)
    )
    assert words == [f"{dataset.attrs['warnings']} (docs/reference/warnings.md)"]
    # a study of steps, which takes runs of its own
    _, words, _ = result_warnings(lambda: fi.convergence.converge_step(system, fi.Sine(2e-3, 5.3), fi.Newmark(2e-4), 2))
    assert words == []


def test_a_caller_that_shows_warnings_itself_is_left_to_do_so():
    system = reduced(REFERENCE, 4)

    def called():
        with warnings_left_to_caller():
            return fi.integrate(system, fi.Sine(2e-3, 5.3), fi.EventDriven(), 10.0)

    run, words, _ = result_warnings(called)
    assert run.warnings
    assert words == []
