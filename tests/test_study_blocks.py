"""What blocks of a parameter study are known by: another study, function or order of the axes has its own."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import FunctionType

import numpy as np
import pytest
from builders import paper_study, plain_study, study_key, with_ball
from wrong import NOTHING_SOUND, NUMBERS_AND_WORDS

import femimpact as fi
from femimpact.export.files import atomic_path
from femimpact.parametric.block_files import BLOCKS

pytestmark = pytest.mark.impacts

GAP, RESTITUTION = "impactor.ball.gap", "impactor.ball.contact.restitution"
AXES = {GAP: [2e-3, 3e-3, 4e-3], RESTITUTION: [0.5, 0.7]}


def study():
    """The paper's case with rigid impacts on two modes, event-driven."""
    paper = paper_study()
    structure = with_ball(paper.structure, contact=fi.Rigid(0.6))
    given = {"structure": structure, "method": {"name": "event-driven"}, "reduction": replace(paper.reduction, modes=2)}
    return replace(paper, mesh=replace(paper.mesh, elements=6), **given)


def small(directory=None, axes=None, measures=("peak",), **more):
    """A study of six cases."""
    return fi.parameter_study(study(), axes or AXES, measures, cycles=3, directory=directory, **more)


def key_of(measure, axes=None):
    """The key of the study of a measure."""
    return study_key(plain_study(fi.ParameterStudy(study(), axes or {GAP: [2e-3]}, [measure], cycles=3)))


def test_axes_in_another_order_are_another_study_for_its_cases_are_counted_otherwise(tmp_path):
    small(tmp_path)
    with pytest.raises(fi.InputError, match=rf'another study: order\[0\] is "{GAP}" there, "{RESTITUTION}" here'):
        small(tmp_path, axes=dict(reversed(AXES.items())))


def test_a_block_under_the_name_of_another_studys_is_run_again(tmp_path):
    for name, amplitudes in (("one", [1e-4]), ("other", [2e-4])):
        small(tmp_path / name, axes={**AXES, "base.amplitude": amplitudes})
    # one block each, of the same cases
    (one,), (other,) = (list((tmp_path / name / BLOCKS).glob("*.block")) for name in ("one", "other"))
    expected = fi.load_parameter_study(tmp_path / "other")["peak"].to_numpy()
    other.write_bytes(one.read_bytes())
    with pytest.warns(fi.InputWarning, match=r"block is damaged \(it belongs to another study\)"):
        assert not fi.load_parameter_study(tmp_path / "other")["finished"].any()
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


def test_a_full_disk_names_the_file_and_nothing_else(tmp_path):
    with pytest.raises(OSError, match="No space") as caught, atomic_path(tmp_path / "study.nc"):
        raise OSError(28, "No space left on device")
    assert str(caught.value) == f"[Errno 28] No space left on device: '{tmp_path / 'study.nc'}'"


def test_a_directory_with_results_of_another_kind_is_refused_and_left_as_it_is(tmp_path):
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(fi.InputError, match=r"holds results of another kind \(summary.json\): choose another"):
        small(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


# ---- functions of the user's own -------------------------------------------------------------------


def of_module(text, **names):
    """The function `measure` of a module with this text."""
    exec(text, names)
    return names["measure"]


TEXT = (
    "def helper(response):\n    return FACTOR * response.time[-1]\n\n"
    "def measure(response):\n    return helper(response)"
)


def test_a_function_is_known_by_what_it_takes_from_its_module():
    one = key_of(of_module(TEXT, FACTOR=1.0))
    assert key_of(of_module(TEXT, FACTOR=1.0, ANOTHER=3.0)) == one
    assert key_of(of_module(TEXT, FACTOR=2.0)) != one
    assert key_of(of_module(TEXT.replace("[-1]", "[-2]"), FACTOR=1.0)) != one
    # where it stands does not matter
    assert key_of(of_module("\n\n" + TEXT, FACTOR=1.0)) == one


def test_functions_that_take_one_another_and_those_of_libraries_have_a_key():
    text = (
        "from functools import lru_cache\nfrom math import sin\nimport numpy as np\n"
        "def even(n):\n    return n == 0 or odd(n - 1)\n"
        "def odd(n):\n    return n != 0 and even(n - 1)\n"
        "@lru_cache\ndef kept(n):\n    return sin(n)\n"
        "def measure(response):\n    return float(even(2)) + kept(1) + np.sum(WEIGHTS)"
    )
    one = key_of(of_module(text, WEIGHTS=np.ones(3)))
    assert key_of(of_module(text, WEIGHTS=np.ones(3))) == one
    assert key_of(of_module(text, WEIGHTS=np.zeros(3))) != one
    assert key_of(of_module(text.replace("sin(n)", "sin(2 * n)"), WEIGHTS=np.ones(3))) != one


def test_a_function_that_takes_what_cannot_be_compared_asks_for_a_version(tmp_path):
    measure = of_module(TEXT, FACTOR=threading.Lock())
    assert isinstance(measure, FunctionType)
    with pytest.raises(fi.InputError, match=r"measure.*: uses a value that .* cannot recognise .*: give version="):
        small(tmp_path, measures=[measure])


def test_a_class_that_has_changed_is_named_where_its_numbers_are_kept(tmp_path):
    class Steel:
        strength = 50e6

        def __call__(self, response):
            return self.strength * response.time[-1]

    first = small(tmp_path, measures=[Steel()])
    np.testing.assert_array_equal(small(tmp_path, measures=[Steel()])["Steel"], first["Steel"])
    Steel.strength = 100e6
    told = r"another study: measures\[0\].class.attributes.strength is 50000000.0 there, 100000000.0 here"
    with pytest.raises(fi.InputError, match=told):
        small(tmp_path, measures=[Steel()])


def test_the_key_of_a_function_is_the_same_in_every_process(tmp_path):
    # a set of texts has another order in each
    script = tmp_path / "script.py"
    script.write_text(
        f"import sys\nsys.path[:0] = [{str(Path(__file__).parent)!r}]\n"
        "from test_study_blocks import key_of\n"
        "WORDS = {'one', 'two', 'three'}\n"
        "def measure(response):\n    return float(response.regime.label in {'one', 'two', 'three'} | WORDS)\n"
        "print(key_of(measure))\n"
    )
    keys = set()
    for seed in ("1", "2"):
        found = {**os.environ, "PYTHONPATH": str(Path(fi.__file__).parent.parent), "PYTHONHASHSEED": seed}
        told = subprocess.run([sys.executable, script], env=found, check=True, capture_output=True, text=True)
        keys.add(told.stdout)
    assert len(keys) == 1


# ---- values of axes --------------------------------------------------------------------------------


@pytest.mark.parametrize("label", [*NUMBERS_AND_WORDS, *NOTHING_SOUND])
def test_whatever_an_axis_is_given_is_taken_or_refused_in_one_line(label):
    value = {**NUMBERS_AND_WORDS, **NOTHING_SOUND}[label]
    for axes in ({GAP: value}, {GAP: [2e-3, value]}, {GAP: {"from": value, "to": 1.0, "points": 3}}, [{GAP: value}]):
        try:
            fi.ParameterStudy(study(), axes, ["peak"], cycles=3)
        except fi.InputError as error:
            (line,) = str(error).splitlines()
            # what is large is cut, and so is what has no end
            assert len(line) < 700
