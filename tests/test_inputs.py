"""Every argument of every public name meets wrong values of every kind: an `InputError`, or the right result."""

from __future__ import annotations

import math
import re
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
import scipy.sparse as sparse
from builders import Output
from nouns import NOUNS, OTHERS, VERBS

import femimpact as fi
from femimpact.errors import Fault

WRONG = {
    "none": None,
    "word": "no",
    "word of a number": "1.0",
    "words of numbers": ["1.0", "2.0"],
    "array of words": np.array(["1.0", "2.0"]),
    "bytes": np.array([b"1.0", b"2.0"]),
    "true": True,
    "nan": math.nan,
    "infinite": math.inf,
    "minus infinite": -math.inf,
    "negative": -3,
    "negative fraction": -0.3,
    "zero": 0,
    "complex": 1j,
    "pair": [1.0, 2.0],
    "masked": np.ma.array([0.5, 1.0, 2.0, 3.0, 4.0], mask=[False, True, False, False, False]),
    "masked in a list": [np.ma.array([0.5, 1.0], mask=[False, True])],
    "masked number": np.ma.masked,
    "empty": np.array([]),
    "objects": np.array([object(), None]),
    "2-D": np.ones((2, 3)),
    "3-D": np.ones((2, 2, 2)),
    "huge": 10**400,
    "large": 10**30,
    "single precision": np.float32(0.5),
    "dictionary": {},
    "function": lambda *_: None,
}


WORDS = ("words of numbers", "array of words", "bytes")
"""What no argument takes for numbers."""

REFUSED_ANYWAY = ("load", "load_study", "read_matrix", "read_record", "write_record", "run_study", "mode_convergence")
"""What takes seconds when all is right, and is stopped by another argument."""


def plain(value: object) -> object:
    """The same in Python's own numbers."""
    return value.item() if isinstance(value, np.generic) else value


def found(result: object) -> list[object]:
    """What a result is made of, in one order: numbers, texts and arrays."""
    if is_dataclass(result):
        return [part for item in fields(result) if item.compare for part in found(getattr(result, item.name))]
    if isinstance(result, (tuple, list)):
        return [part for entry in result for part in found(entry)]
    if isinstance(result, dict):
        return [part for entry in result.values() for part in found(entry)]
    return [result.toarray()] if sparse.issparse(result) else [result]


def same(one: object, other: object) -> bool:
    """Whether two results are equal to the last bit; functions and results of results are not looked into."""
    alike = []
    for a, b in zip(found(one), found(other), strict=True):
        if isinstance(a, (float, np.ndarray, np.floating)) and not (isinstance(a, np.ndarray) and a.dtype.kind in "UO"):
            alike.append(np.array_equal(a, b, equal_nan=True))
        elif isinstance(a, (str, int, np.ndarray)):
            alike.append(np.array_equal(a, b))
    return all(alike)


def not_numbers(result: object) -> int:
    """How many of the numbers of a result are none: of a good call only those that are documented to be unknown."""
    return sum(isinstance(part, float) and math.isnan(part) for part in found(result))


@pytest.mark.parametrize("name", sorted(set(fi.__all__) - OTHERS))
def test_every_public_name_is_in_the_tables(name):
    assert name in NOUNS or name in VERBS


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_refuses_a_wrong_argument_by_name_or_takes_it_as_the_number_it_is(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, good = VERBS[name]
    faults, unknown = [], 0 if name in REFUSED_ANYWAY else not_numbers(call(**good()))
    for key in good():
        for label, value in WRONG.items():
            try:
                result = call(**{**good(), key: value})
            except fi.InputError as error:
                # a line names something and says what is allowed
                if any(": " not in line for line in str(error).splitlines()):
                    faults.append(f"{key} = {label}: {error}")
                continue
            except Exception as error:
                faults.append(f"{key} = {label}: {type(error).__name__}: {error}")
                continue
            if label in WORDS:
                faults.append(f"{key} = {label}: taken for numbers")
            elif not_numbers(result) > unknown and label != "none":
                faults.append(f"{key} = {label}: not a number, and not a word")
            elif not same(result, call(**{**good(), key: plain(value)})):
                faults.append(f"{key} = {label}: another result than of {plain(value)!r}")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("name", NOUNS)
def test_a_noun_refuses_a_wrong_field_or_holds_it_as_what_it_is(name):
    noun = NOUNS[name]()
    faults = []
    # None asks a system for its checks anew, and a motion in pieces for starts that go on
    for item in (item for item in fields(noun) if item.init and item.name not in ("computed_together", "starts")):
        for label, value in WRONG.items():
            try:
                changed = getattr(replace(noun, **{item.name: value}), item.name)
            except fi.InputError as error:
                if any(": " not in line for line in str(error).splitlines()):
                    faults.append(f"{item.name} = {label}: {error}")
                continue
            except Exception as error:
                faults.append(f"{item.name} = {label}: {type(error).__name__}: {error}")
                continue
            if np.ma.is_masked(value):
                faults.append(f"{item.name} = {label}: the mask is lost")
            elif not holds(changed, value, item.metadata):
                faults.append(f"{item.name} = {label}: became {changed!r}")
    assert not faults, "\n".join(faults)


def holds(kept: object, given: object, metadata: dict[str, object]) -> bool:
    """Whether a field holds what it was given, in its own type."""
    if given is None and isinstance(kept, np.ndarray):
        # no load is a load of zeros
        return not kept.any()
    if given is None or isinstance(given, str) or callable(given):
        return kept is given or kept == given or kept == (given,)
    if isinstance(given, bool):
        return kept is given
    if np.asarray(given).dtype.kind in "SU":
        return np.array_equal(np.asarray(kept), np.asarray(given))
    if isinstance(given, dict):
        return kept == given or "points" in str(kept) or "root" in kept
    # one number may stand for a row of one
    row = np.atleast_1d(np.asarray(kept, dtype=float))
    return np.array_equal(row, np.atleast_1d(np.asarray(given, dtype=float)), equal_nan=True)


@pytest.mark.parametrize("name", [name for name in VERBS if name not in REFUSED_ANYWAY])
def test_a_class_in_place_of_what_it_makes_is_named_with_the_call(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, good = VERBS[name]
    faults = []
    for key, value in good().items():
        if is_dataclass(value):
            kind = type(value)
            try:
                call(**{**good(), key: kind})
                faults.append(f"{key}: taken")
            except fi.InputError as error:
                if f"the class {kind.__name__} (did you mean {kind.__name__}(" not in str(error):
                    faults.append(f"{key}: {error}")
            except Exception as error:
                faults.append(f"{key}: {type(error).__name__}: {error}")
    assert not faults, "\n".join(faults)


def test_a_function_in_place_of_its_result_is_named_with_the_call():
    words = re.escape("dt = the function recommended_step (did you mean recommended_step(system=...)?) s: must be")
    with pytest.raises(fi.InputError, match=words):
        fi.Newmark(dt=fi.recommended_step)


NO_NAMES = ("a\0b", "a\nb", "a\x7fb", "a\x85b", "a\u2028b", "a\ud800b")
"""What neither a file of results nor a line of a message can hold as a name."""


def test_no_name_of_a_noun_holds_a_control_character():
    nouns = {name: NOUNS[name]() for name in NOUNS}
    # a table has a column of names
    named = {name: noun for name, noun in nouns.items() if isinstance(getattr(noun, "name", ()), str | None)}
    named = {name: noun for name, noun in named.items() if "name" in {item.name for item in fields(noun)}}
    assert {"Absorber", "Dashpot", "HammerBlow", "Impactor", "PointMass", "Segment", "Spring", "Stop"} <= named.keys()
    for noun in named.values():
        assert replace(noun, name="Ω größer 2").name == "Ω größer 2"
        for bad in NO_NAMES:
            with pytest.raises(fi.InputError, match="must be a text without control characters"):
                replace(noun, name=bad)


def test_no_place_channel_measure_or_title_holds_a_control_character():
    system = fi.System.from_matrices([[1.0]], [[0.1]], [[1e3]], points={"m": [1.0]})
    sine = fi.Sine(1e-3, 5.0)

    class Reading:
        name, unit = "m", "m"

        def reading(self, system):
            raise AssertionError

    def measure(response):
        return 1.0

    for bad in NO_NAMES:
        Reading.name = measure.__name__ = bad
        calls = (
            lambda bad=bad: fi.System.from_matrices([[1.0]], [[0.1]], [[1e3]], points={bad: [1.0]}),
            lambda bad=bad: fi.Mesh(np.array([0.0, 1.0]), {bad: 0.5}),
            lambda bad=bad: fi.Mesh(np.array([0.0, 1.0]), {}, {bad: [0]}),
            lambda: fi.integrate(system, sine, fi.EventDriven(), 1.0, fi.Recorder((Reading(),))),
            lambda: fi.parameter_study(system, {"base.frequency": [4.0, 5.0]}, [measure], excitation=sine),
        )
        for call in calls:
            with pytest.raises(fi.InputError, match="must be a text without control characters"):
                call()
    for key in ("title", "author", "date"):
        assert getattr(Output(**{key: "a\tb\nc"}), key) == "a\tb\nc"
        with pytest.raises(fi.InputError, match=f"^{key} = 'a.x00b': must be a text without"):
            Output(**{key: "a\0b"})


def test_a_line_shows_the_control_characters_of_a_key():
    assert str(Fault("force.a\0b.name", 1.0, "", "unknown")) == r"force.a\x00b.name = 1.0: unknown"
