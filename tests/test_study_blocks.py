"""What blocks of a parameter study are known by: another study, function or order of the axes has its own."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from builders import plain_study, rigid_study, study_key
from wrong import NOTHING_SOUND, NUMBERS_AND_WORDS

import femimpact as fi
from femimpact.app.parametric.dataset import BLOCKS

pytestmark = pytest.mark.impacts

GAP, RESTITUTION = "impactor.ball.gap", "impactor.ball.contact.restitution"
AXES = {GAP: [2e-3, 3e-3, 4e-3], RESTITUTION: [0.5, 0.7]}


study = partial(rigid_study, modes=2, elements=6)


def small(directory=None, axes=None, measures=("peak",), **more):
    """A study of six cases."""
    return fi.parameter_study(study(), axes or AXES, measures, cycles=3, directory=directory, **more)


def key_of(measure, axes=None):
    """The key of the study of a measure."""
    return study_key(plain_study(fi.app.ParameterStudy(study(), axes or {GAP: [2e-3]}, [measure], cycles=3)))


def test_axes_in_another_order_are_another_study_for_its_cases_are_counted_otherwise(tmp_path):
    small(tmp_path)
    with pytest.raises(fi.InputError, match=rf'another study: order\[0\] is "{GAP}" there, "{RESTITUTION}" here'):
        small(tmp_path, axes=dict(reversed(AXES.items())))


def test_a_block_under_the_name_of_another_studys_is_run_again(tmp_path):
    for name, amplitudes in (("one", [1e-4]), ("other", [2e-4])):
        small(tmp_path / name, axes={**AXES, "base.amplitude": amplitudes})
    # one block each, of the same cases
    (one,), (other,) = (list((tmp_path / name / BLOCKS).glob("*.block")) for name in ("one", "other"))
    expected = fi.app.load_parameter_study(tmp_path / "other")["peak"].to_numpy()
    other.write_bytes(one.read_bytes())
    with pytest.warns(fi.InputWarning, match=r"block is damaged \(its checksum is that of another content\)"):
        assert not fi.app.load_parameter_study(tmp_path / "other")["finished"].any()
    again = small(tmp_path / "other", axes={**AXES, "base.amplitude": [2e-4]})
    np.testing.assert_array_equal(again["peak"], expected)


def test_what_a_process_left_that_was_ended_while_it_wrote_goes_with_the_next_call(tmp_path):
    small(tmp_path)
    left = [tmp_path / ".study-abcd_123.nc", tmp_path / ".study_peak-abcd_123.png", tmp_path / ".report-abcd_123.html",
            tmp_path / BLOCKS / f".{'0' * 16}-{'1' * 16}-abcd_123.block"]  # fmt: skip
    others = [tmp_path / ".study.nc", tmp_path / ".notes-abcd_123.txt"]
    for path in (*left, *others):
        path.write_text("x")
    small(tmp_path)
    assert not any(path.exists() for path in left)
    assert all(path.exists() for path in others)


def test_a_directory_with_results_of_another_kind_is_refused_and_left_as_it_is(tmp_path):
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(fi.InputError, match=r"holds results of another kind \(summary.json\): choose another"):
        small(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_a_field_at_its_default_is_not_in_the_key_and_another_value_is_told_as_such(tmp_path):
    plain = plain_study(fi.app.ParameterStudy(study(), AXES, ["peak"], cycles=3))
    assert plain["study"]["structure"]["impactors"][0]["contact"] == {"noun": "Rigid", "restitution": 0.6}
    small(tmp_path)
    other = replace(study(), base=replace(study().base, phase=0.5))
    with pytest.raises(fi.InputError, match=r"another study: study.base.phase is at its default there, 0.5 here"):
        fi.parameter_study(other, AXES, ["peak"], cycles=3, directory=tmp_path)


# ---- values of axes --------------------------------------------------------------------------------


@pytest.mark.parametrize("label", [*NUMBERS_AND_WORDS, *NOTHING_SOUND])
def test_whatever_an_axis_is_given_is_taken_or_refused_in_one_line(label):
    value = {**NUMBERS_AND_WORDS, **NOTHING_SOUND}[label]
    for axes in ({GAP: value}, {GAP: [2e-3, value]}, {GAP: {"from": value, "to": 1.0, "points": 3}}, [{GAP: value}]):
        try:
            fi.app.ParameterStudy(study(), axes, ["peak"], cycles=3)
        except fi.InputError as error:
            (line,) = str(error).splitlines()
            # what is large is cut, and so is what has no end
            assert len(line) < 700
