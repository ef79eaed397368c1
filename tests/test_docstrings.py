"""The reference page and `help` show the allowed range of every checked field and argument of a public name."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pydoc
import re
from collections.abc import Iterator

import pytest
from public import PATHS, public

import femimpact as fi
from femimpact.errors import InputError, choice, quantity, takes, with_ranges

PAGES = ("figures", "vtk", "response.history_file", "files")
"""Modules whose functions have pages of their own."""


def _nouns() -> dict[str, type]:
    """Public dataclasses with checked fields."""
    named = ((name, public(name)) for name in PATHS)
    kinds = {name: one for name, one in named if isinstance(one, type) and dataclasses.is_dataclass(one)}
    return {name: kind for name, kind in kinds.items() if any(field.metadata for field in dataclasses.fields(kind))}


def _words(one: object) -> str:
    return re.sub(r"\s+", " ", inspect.getdoc(one) or "")


def test_every_noun_that_checks_its_fields_shows_what_they_must_be():
    nouns = _nouns()
    # as many as there are at least: a walk that found none would pass
    assert {"Rigid", "Sine", "System", "Response", "EventDriven", "Study", "HHT"} <= set(nouns)
    hidden = [
        f"{name}.{field.name}: {field.metadata['allowed']}"
        for name, kind in nouns.items()
        for field in dataclasses.fields(kind)
        # of what is an instance of a class the annotation says it
        if field.metadata and "kinds" not in field.metadata
        if field.metadata["allowed"].removeprefix("m") not in _words(kind)
    ]
    assert hidden == []


def _declared_functions() -> Iterator[tuple[str, object, list[str]]]:
    """Public functions and methods below `@takes` that have entries of arguments, with the ranges of these."""
    functions = [(name, public(name)) for name in PATHS]
    for place in PAGES:
        module = importlib.import_module(f"femimpact.{place}")
        functions += [(f"{place}.{name}", getattr(module, name)) for name in module.__all__]
    functions += [(f"{name}.{key}", one) for name, kind in _nouns().items() for key, one in vars(kind).items()]
    for name, one in functions:
        function = getattr(one, "__func__", one)
        inner, layer = {}, function
        # decorators stand upon one another
        while inspect.isfunction(layer):
            inner |= inspect.getclosurevars(layer).nonlocals
            layer = getattr(layer, "__wrapped__", None)
        # a method in one sentence has no entries; its annotations say the kinds
        if "declared" in inner and "Parameters" in (function.__doc__ or ""):
            yield (
                name,
                function,
                [metadata["allowed"] for _, metadata, _ in inner["declared"] if "kinds" not in metadata],
            )


def test_every_function_that_checks_its_arguments_shows_what_they_must_be():
    pytest.importorskip("matplotlib")
    found = list(_declared_functions())
    assert {"figures.contact_laws", "State.of_mode", "report"} <= {name for name, _, _ in found}
    hidden = [
        f"{name}: {allowed}"
        for name, function, ranges in found
        for allowed in ranges
        if allowed.removeprefix("m") not in _words(function)
    ]
    assert hidden == []


def test_help_of_a_noun_has_the_range_below_the_entry_of_its_field():
    shown = pydoc.render_doc(fi.Sine, renderer=pydoc.plaintext)
    entries = re.findall(
        r"(\w+) : float, (?:m or m/s\^2|Hz|rad)\n(?: \|  +[A-Z](?!ust).*\n)* \|  +(Must be .*)\n", shown
    )
    assert dict(entries) == {
        "level": "Must be a finite number >= 0 m or m/s^2.",
        "frequency": "Must be a finite number > 0 Hz.",
        "phase": "Must be a finite number, in rad.",
    }


def test_names_of_one_entry_share_a_range_or_have_one_each():
    @takes(a=quantity("m", above=0.0), b=quantity("m", above=0.0), c=choice("x", "y"), d=choice("z"))
    def function(a: float, b: float, c: str, d: str) -> float:
        """Sum of a and b.

        Parameters
        ----------
        a, b : float, m
            Two lengths,
            in two lines.
        c, d

        Returns
        -------
        a
        """
        return a + b

    assert "Must" not in (function.__doc__ or "").partition("Returns")[2]
    lines = [line.strip() for line in (function.__doc__ or "").splitlines()]
    assert lines[4:8] == ["a, b : float, m", "Two lengths,", "in two lines.", "Must be a finite number > 0 m."]
    assert lines[8:11] == ["c, d", "`c` must be 'x' or 'y'.", "`d` must be 'z'."]
    with pytest.raises(InputError, match=r"a = -1\.0 m"):
        function(-1.0, 1.0, "x", "z")


def test_without_docstrings_nothing_is_shown():
    # as below python -OO
    assert with_ranges(None, ()) is None
