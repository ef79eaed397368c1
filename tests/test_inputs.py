"""Every argument of every public name meets wrong values of every kind: an `InputError` that names it, or it is right.

The names are found in the package, so that a new one without a good call fails here.
"""

from __future__ import annotations

import inspect
import math
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sparse
from builders import Output
from calls import CALLS
from nouns import NOUNS, OTHERS, VERBS
from public import PATHS, public
from wrong import NOTHING_SOUND, NUMBERS_AND_WORDS

import femimpact as fi
from femimpact import vtk
from femimpact.contact import ContactLaw
from femimpact.convergence.cases import Axis
from femimpact.convergence.quantities import Watched
from femimpact.errors import Fault
from femimpact.integrators.methods import Method
from femimpact.integrators.stepping.operators import SteppingMethod

plt = pytest.importorskip("matplotlib.pyplot")

# some runs have impacts, whose rounding decides nothing here
pytestmark = [pytest.mark.impacts, pytest.mark.filterwarnings("ignore::femimpact.InputWarning")]

Call = Callable[..., object]

PROTOCOLS = (ContactLaw, Axis, Watched, Method, SteppingMethod)
"""Whose methods femimpact calls, with values that it has checked."""

WORDS = {
    ("load_study", "path"): "study",
    ("read_mesh", "path"): "mesh.file",
    ("OverMeshes.files", "paths"): "meshes",
    ("ConvergenceTable.index", "name"): "quantity",
    ("figures.convergence", "names"): "quantity",
    ("figures.contact_laws", "speeds"): "approach_speed",
    ("Response.absolute", "name"): "channel",
    ("Response.largest", "channel"): "(channels|at)",
    ("Response.largest_of", "channels"): "at",
    ("PeriodicOrbit.steady", "channel"): "(channels|at)",
    ("PeriodicOrbit.to_xarray", "channels"): "(channels|at)",
}
"""What messages call an argument for which a user has a better word."""

MADE_ANEW = ("computed_together", "labels", "starts")
"""Fields that are made where None or nothing is given."""

NO_NUMBERS = ("words of numbers", "array of words", "bytes")
"""What no argument takes for numbers."""


def made_from(noun: Callable[[], object]) -> tuple[Call, Callable[[], dict[str, object]]]:
    """A noun as a function of its fields, with good ones."""
    kept = cache(noun)
    return (
        lambda **given: replace(kept(), **given),
        lambda: {item.name: getattr(kept(), item.name) for item in fields(kept()) if item.init},
    )


ALL = {**{name: made_from(noun) for name, noun in NOUNS.items()}, **VERBS, **CALLS}
"""By name: the function, and good arguments of it."""


def methods(name: str) -> Iterator[str]:
    """Methods with arguments of a public class."""
    kind = public(name)
    for method in vars(kind) if inspect.isclass(kind) and is_dataclass(kind) else ():
        found = getattr(kind, method)
        asked = not any(hasattr(protocol, method) for protocol in PROTOCOLS)
        if method.startswith("_") or not (inspect.isfunction(found) or inspect.ismethod(found)) or not asked:
            continue
        if set(inspect.signature(found).parameters) - {"self"}:
            yield f"{name}.{method}"


def public_names() -> Iterator[str]:
    for name in sorted(set(PATHS) - OTHERS):
        yield name
        yield from methods(name)
    for name in fi.figures.__all__:
        if inspect.isfunction(getattr(fi.figures, name)) and name not in OTHERS:
            yield f"figures.{name}"
    for name in vtk.__all__:
        yield f"vtk.{name}"


@pytest.mark.parametrize("name", sorted(set(public_names())))
def test_every_public_name_has_a_good_call(name):
    assert name in ALL or any(other.startswith(f"{name} ") for other in ALL)


@pytest.fixture(autouse=True)
def _apart(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    yield
    plt.close("all")


def parts_of(result: object) -> list[object]:
    """What a result is made of, in one order: numbers, texts and arrays."""
    if is_dataclass(result):
        return [part for item in fields(result) if item.compare for part in parts_of(getattr(result, item.name))]
    if isinstance(result, (tuple, list)):
        return [part for entry in result for part in parts_of(entry)]
    if isinstance(result, dict):
        return [part for entry in result.values() for part in parts_of(entry)]
    return [result.toarray()] if sparse.issparse(result) else [result]


def same(one: object, other: object) -> bool:
    """Whether two results are equal to the last bit; functions and results of results are not looked into."""
    alike = []
    for a, b in zip(parts_of(one), parts_of(other), strict=True):
        if isinstance(a, (float, np.ndarray, np.floating)) and not (isinstance(a, np.ndarray) and a.dtype.kind in "UO"):
            alike.append(np.array_equal(a, b, equal_nan=True))
        elif isinstance(a, (str, int, np.ndarray)):
            alike.append(np.array_equal(a, b))
    return all(alike)


def not_numbers(result: object) -> int:
    """How many of the numbers of a result are none: of a good call only those that are documented to be unknown."""
    return sum(isinstance(part, float) and math.isnan(part) for part in parts_of(result))


def holds(kept: object, given: object) -> bool:
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


def fault_of_result(name: str, result: object, given: dict[str, object], key: str, label: str) -> str | None:
    """What is wrong with the result of a call with a value that is taken."""
    value = given[key]
    if name in NOUNS:
        if np.ma.is_masked(value):
            return "the mask is lost"
        kept = getattr(result, key)
        # of a chirp without a kind it follows from its rate
        given_up = key in MADE_ANEW or (name, key, value) == ("Chirp", "kind", None)
        return None if given_up or holds(kept, value) else f"became {kept!r}"
    if name in CALLS:
        return None
    call, good = ALL[name]
    if label in NO_NUMBERS:
        return "taken for numbers"
    unknown = not_numbers(result)
    if unknown and label != "none" and unknown > not_numbers(call(**good())):
        return "not a number, and not a word"
    # the same in Python's own numbers
    alike = not isinstance(value, np.generic) or same(result, call(**{**given, key: value.item()}))
    return None if alike else f"another result than of {value.item()!r}"


def fault_of(name: str, given: dict[str, object], key: str, label: str, beside: bool) -> str | None:
    """What is wrong with the answer to a call, where anything is.

    A line may name another argument of the call too, where the wrong one may be wrong only beside it.
    """
    words = [WORDS.get((name, key), key), key, *(given if beside else ())]
    try:
        with warnings.catch_warnings():
            # whatever else numpy and matplotlib warn of
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", fi.InputWarning)
            warnings.simplefilter("ignore", fi.ResultWarning)
            result = ALL[name][0](**given)
            return fault_of_result(name, result, given, key, label) if label else None
    except fi.InputError as error:
        if not label:
            return f"refused: {error}"
        lines = str(error).splitlines()
        strange = [line for line in lines if ": " not in line or not any(re.search(rf"\b{w}\b", line) for w in words)]
        return f"names another: {strange[0]}" if strange else None
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        plt.close("all")


def fault_of_class(name: str, given: dict[str, object], key: str) -> str | None:
    """What is wrong with the answer to the class of an argument in its place."""
    kind = type(given[key])
    try:
        ALL[name][0](**{**given, key: kind})
    except fi.InputError as error:
        return None if f"the class {kind.__name__} (did you mean {kind.__name__}(" in str(error) else str(error)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "taken"


@pytest.mark.parametrize("name", ALL)
@pytest.mark.usefixtures("empty_pictures")
def test_a_wrong_argument_is_named_in_one_line_or_taken_as_what_it_is(name):
    given = ALL[name][1]()
    # a good call that fails would hide every fault of its arguments
    answers = {"a good call": fault_of(name, given, next(iter(given), ""), "", False)}
    for key in given:
        for values, beside in ((NUMBERS_AND_WORDS, True), (NOTHING_SOUND, False)):
            for label, value in values.items():
                answers[f"{key} = {label}"] = fault_of(name, {**given, key: value}, key, label, beside)
        if name in VERBS and is_dataclass(given[key]):
            answers[f"{key} = its class"] = fault_of_class(name, given, key)
    faults = [f"{what}: {answer}" for what, answer in answers.items() if answer]
    assert not faults, "\n".join(faults)


KINDS = {"whole": int, "single precision": np.float32, "double precision": np.float64, "of numpy": np.int64}


def same_in(kind: type, value: object) -> object:
    """A number, or each of a tuple, as another type where that is the same number."""
    if isinstance(value, tuple):
        return [same_in(kind, entry) for entry in value]
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return kind(value) if number and np.isfinite(value) and float(kind(value)) == value else value


def scalars(value: object) -> list[object]:
    return [entry for part in value for entry in scalars(part)] if isinstance(value, tuple) else [value]


@pytest.mark.parametrize("name", NOUNS)
def test_fields_keep_one_type_whatever_type_a_number_comes_in(name):
    noun = NOUNS[name]()
    for item in fields(noun):
        value = getattr(noun, item.name)
        if not scalars(value) or not all(type(part) in (int, float) for part in scalars(value)):
            continue
        for kind in KINDS.values():
            changed = getattr(replace(noun, **{item.name: same_in(kind, value)}), item.name)
            assert changed == value or value != value
            assert [type(part) for part in scalars(changed)] == [type(part) for part in scalars(value)]


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
            lambda bad=bad: fi.fem.Mesh(np.array([0.0, 1.0]), {bad: 0.5}),
            lambda bad=bad: fi.fem.Mesh(np.array([0.0, 1.0]), {}, {bad: [0]}),
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
