"""Every argument of every public name meets wrong values of every kind: it works, or one line names the argument.

The names are found in the package, so that a new one without a good call fails here.
"""

from __future__ import annotations

import inspect
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace

import pytest
from calls import CALLS
from nouns import NOUNS, OTHERS, VERBS
from wrong import NOTHING_SOUND, NUMBERS_AND_WORDS

import femimpact as fi
from femimpact import vtk
from femimpact.contact import ContactLaw
from femimpact.convergence.cases import Axis
from femimpact.convergence.quantities import Watched
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


def made_from(noun: Callable[[], object]) -> tuple[Call, Callable[[], dict[str, object]]]:
    """A noun as a function of its fields, with good ones."""
    return (
        lambda **given: replace(noun(), **given),
        lambda: {item.name: getattr(noun(), item.name) for item in fields(noun()) if item.init},
    )


def public(name: str) -> bool:
    return name.partition(" ")[0].partition(".")[0] in fi.__all__


ALL = {
    **{name: made_from(noun) for name, noun in NOUNS.items()},
    **{name: call for name, call in VERBS.items() if public(name)},
    **CALLS,
}
"""By name: the function, and good arguments of it."""


def methods(name: str) -> Iterator[str]:
    """Methods with arguments of a public class."""
    kind = getattr(fi, name)
    for method in vars(kind) if inspect.isclass(kind) and is_dataclass(kind) else ():
        found = getattr(kind, method)
        asked = not any(hasattr(protocol, method) for protocol in PROTOCOLS)
        if method.startswith("_") or not (inspect.isfunction(found) or inspect.ismethod(found)) or not asked:
            continue
        if set(inspect.signature(found).parameters) - {"self"}:
            yield f"{name}.{method}"


def public_names() -> Iterator[str]:
    for name in sorted(set(fi.__all__) - OTHERS):
        yield name
        yield from methods(name)
    for name in fi.figures.__all__:
        if inspect.isfunction(getattr(fi.figures, name)):
            yield f"figures.{name}"
    for name in vtk.__all__:
        yield f"vtk.{name}"


@pytest.fixture(autouse=True)
def _apart(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    yield
    plt.close("all")


def fault_of(name: str, call: Call, given: dict[str, object], key: str, beside: bool) -> str | None:
    """What is wrong with the answer to a call, where anything is.

    A line may name another argument of the call too, where the wrong one may be wrong only beside it.
    """
    words = [WORDS.get((name, key), key), key, *(given if beside else ())]
    try:
        with warnings.catch_warnings():
            # whatever else numpy and matplotlib warn of
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", fi.InputWarning)
            call(**given)
    except fi.InputError as error:
        lines = str(error).splitlines()
        strange = [line for line in lines if ": " not in line or not any(re.search(rf"\b{w}\b", line) for w in words)]
        return f"names another: {strange[0]}" if strange else None
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        plt.close("all")
    return None


@pytest.mark.parametrize("name", sorted(set(public_names())))
def test_every_public_name_has_a_good_call(name):
    assert name in ALL or any(other.startswith(f"{name} ") for other in ALL)


@pytest.mark.parametrize("name", ALL)
def test_a_wrong_argument_is_named_in_one_line(name):
    call, good = ALL[name]
    given, faults = good(), []
    key = next(iter(given), "")
    # a good call that fails would hide every fault of its arguments
    answers = {"a good call": fault_of(name, call, given, key, False)}
    for key in given:
        for values, beside in ((NUMBERS_AND_WORDS, True), (NOTHING_SOUND, False)):
            for label, value in values.items():
                answers[f"{key} = {label}"] = fault_of(name, call, {**given, key: value}, key, beside)
    faults = [f"{what}: {answer}" for what, answer in answers.items() if answer]
    assert not faults, "\n".join(faults)
