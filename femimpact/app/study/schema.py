"""A JSON schema of the study file, from the metadata of the fields that `load_study` checks.

An editor completes and checks keys, types and ranges with it. `NOT_IN_SCHEMA` names the rules that it does not hold.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from collections.abc import Iterable, Mapping
from typing import Any

from femimpact.app.study.drives import BASES, FORCES, PARTS, Kind
from femimpact.app.study.parameter_plan import DISTRIBUTIONS, MOST_POINTS, BestPlan, ParameterPlan, SamplePlan
from femimpact.contact.laws import LAWS, PowerLaw
from femimpact.errors import quantity
from femimpact.integrators.methods import METHODS
from femimpact.structure.beam import ModalDamping, Rayleigh, Segment

NOT_IN_SCHEMA = (
    "what is not a number (nan), for which a schema has no word",
    "pairs of keys that belong together, as width and thickness, or restitution and contact_time",
    "comparisons of two keys, as stop above start in [sweep], of the two numbers of an axis or a range, of the rows of "
    "a density",
    'units: whether that of a text, as of "4 mm", fits the key; a slope, which needs a level beside it',
    "axes: whether a path leads to a number of the study, and a measure is known; a power of two of a Sobol sequence",
    "how many numbers a list has: two for a gap and for the ratio, modes or frequencies of [damping]",
    "names: each once, none of those that mean a place, none with a dot; places and channels must exist",
    "files: a mesh file, a record or a file of rows must be there and be sound",
    "the structure as a whole: held, within the beam, with gaps and contact laws that fit",
)
"""Rules of `load_study` that the schema does not hold."""

MOST_FLOAT = sys.float_info.max

DISTRIBUTION_WORDS = {name: f"{name} with {first} and {second}" for name, (first, second) in DISTRIBUTIONS.items()}


def noun_schema(noun: Any, without: Iterable[str] = (), title: str = "", **given: Any) -> dict[str, Any]:
    """Schema of a table with the keys of a noun's fields."""
    schema = kind_schema(Kind(noun, without=without), **given)
    return schema | ({"title": title} if title else {})


def kind_schema(kind: Kind, **given: Any) -> dict[str, Any]:
    """Schema of a table by its keys."""
    about, keys = _meanings(kind.make or kind.noun), dict[str, Any]()
    for key, one in kind.table_keys.items():
        beside = OF_HISTORY.get(one.argument) if key in kind.beside else None
        meaning = beside or about.get(one.argument) or f"amplitude of the base's {key}" * (kind.ranges != {})
        keys[key] = given.get(key) or (not one.metadata and LISTS.get(key)) or _key(one.metadata, one.default, meaning)
    schema = {"type": "object", "description": _first(kind.make or kind.noun), "properties": keys}
    return schema | {"additionalProperties": False} | ({"required": kind.needed} if kind.needed else {})


def forms_schema(
    kinds: Mapping[str, Kind], key: str, words: str, absent: Iterable[str] = ()
) -> dict[str, dict[str, Any]]:
    """Schemas of a table in each of its forms, which a key names; `absent` are those that are meant without the key."""
    forms = {name: kind_schema(kind) for name, kind in kinds.items()}
    return {
        name: {
            "title": name, **form, "properties": {key: {"const": name, "description": words}, **form["properties"]},
            "required": [*([] if name in absent else [key]), *form.get("required", [])],
        }
        for name, form in forms.items()
    }  # fmt: skip


def _first(noun: Any) -> str:
    """First paragraph of a docstring."""
    return (inspect.getdoc(noun) or "").split("\n\n")[0].replace("\n", " ")


def _key(metadata: Mapping[str, Any], default: Any, meaning: str) -> dict[str, Any]:
    """Schema of one key from the metadata and the default of its field."""
    key = {**(metadata.get("schema") or _COLUMNS), "description": meaning}
    if "unit" in metadata:
        of_file = ", or the path of a file of rows" * ("x-rows" in key)
        key |= {"x-unit": metadata["unit"], "x-range": metadata["allowed"].removeprefix("must be ") + of_file}
    if default not in (dataclasses.MISSING, inspect.Parameter.empty, None):
        key["default"] = list(default) if isinstance(default, tuple) else default
    return key


def _closed(properties: dict[str, Any], required: list[str] | None = None) -> dict[str, Any]:
    """A table with these keys alone, all of which are required where no list says which."""
    return {
        "type": "object", "properties": properties, "additionalProperties": False,
        "required": required or list(properties),
    }  # fmt: skip


def _number_of(metadata: Mapping[str, Any]) -> Any:
    """Schema of a number with its unit and its range in words."""
    return {**metadata["schema"], "x-unit": metadata["unit"], "x-range": metadata["allowed"].removeprefix("must be ")}


def grid_schema(number: dict[str, Any]) -> dict[str, Any]:
    """Schema of points between two numbers."""
    points = _number_of(quantity("1", at_least=2, at_most=MOST_POINTS, integer=True))
    grid = {"from": number, "to": number, "points": points, "spacing": {"enum": ["even", "logarithmic"]}}
    return _closed(grid, ["from", "to", "points"])


_POSITIVE = {"type": "number", "exclusiveMinimum": 0}

_NUMBERS = {"type": "array", "items": _POSITIVE, "minItems": 1}

LISTS: Mapping[str, dict[str, Any]] = {
    "frequencies": {
        "anyOf": [_NUMBERS, grid_schema(_POSITIVE)],
        "description": "one after the other, or points between two of them",
        "x-unit": "Hz",
        "x-range": "finite numbers > 0",
    },
    "psd": {
        "type": "array",
        "items": {**_NUMBERS, "minItems": 2, "maxItems": 2},
        "minItems": 2,
        "description": "one-sided density of the acceleration, straight in a plot of its logarithms",
        "x-unit": "Hz, (m/s^2)^2/Hz",
        "x-rows": "(m/s^2)^2/Hz",
        "x-range": "rows of a frequency, rising, and a level > 0, or the path of a file of rows",
    },
}
"""Schemas of the keys that are lists of numbers."""

_COLUMNS = {
    "type": "array",
    "items": {"anyOf": [{"type": "string"}, {"type": "integer", "minimum": 0}]},
    "x-range": "numbers from 0 or names of two columns: time, acceleration",
}
"""Schema of the columns of a record, the one key that is neither a number nor a text."""


def _meanings(noun: Any) -> dict[str, str]:
    """Meaning of each field, from the Parameters section of a noun's docstring."""
    # without the ranges that are in the docstring once the package has shown it: the schema has them beside it
    text = inspect.cleandoc(getattr(vars(noun).get("__doc__"), "words", noun.__doc__) or "")
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w+\n-+$|\Z)", text, re.MULTILINE | re.DOTALL)
    found: dict[str, str] = {}
    for names, words in re.findall(
        r"^(\S[^\n]*)\n((?:(?:    [^\n]*)?\n)*)", (section[1] if section else "") + "\n", re.M
    ):
        for name in names.partition(" :")[0].split(", "):
            found[name] = " ".join(words.split())
    return found


def contact_schema(names: Iterable[str] = LAWS) -> dict[str, Any]:
    """Schema of a contact: a law by one of some names, with the fields that the name leaves open."""
    kinds = {name: Kind(LAWS[name][0], without=tuple(LAWS[name][1])) for name in names}
    laws = forms_schema(kinds, "law", "the contact law")
    for name, kind in kinds.items():
        if kind.noun is PowerLaw:
            laws[name]["properties"]["stiffness"] |= {"x-unit": "N/m^exponent"}
    return {"description": "the contact law of the walls", "oneOf": list(laws.values())}


def beam_schema() -> dict[str, Any]:
    """Schema of [beam]: a segment, or a list of them."""
    one = noun_schema(Segment, title="a beam of one segment")
    part = noun_schema(Segment, title="one of several segments")
    about = "from the root to the tip, [[beam.segment]]"
    segments = {"type": "array", "items": part, "minItems": 1, "description": about}
    several = {
        "title": "a beam of several segments", "type": "object", "properties": {"segment": segments},
        "required": ["segment"], "additionalProperties": False,
    }  # fmt: skip
    return {"description": "The beam: one segment with the keys below, or a list of them.", "oneOf": [one, several]}


def damping_schema() -> dict[str, Any]:
    """Schema of [damping]: the two forms of it."""
    forms = [noun_schema(Rayleigh, title="proportional"), noun_schema(ModalDamping, title="mode by mode")]
    return {"description": "Damping of the structure alone; without the table it has none.", "oneOf": forms}


KIND_WORDS = "the kind of motion or force"

OF_HISTORY = {
    "duration": "Duration of the simulated history; absent, that of the motion, of a sum its longest.",
    "start": "At rest relative to the base, at rest in the inertial frame, or in the static state; a ball elsewhere by "
    "the axes start.NAME.position and start.NAME.speed of [study].",
    "at": "Named place, or metres from the root.",
    "density": "Force per length along the beam, in place of at; the level is then a factor, 1 by default.",
    "name": 'Without a dot; by default "force 1", "force 2" and so on in their order.',
}
"""Meanings of the keys of [base] and [[force]] beside those of the noun, by what they give."""


def base_schema() -> dict[str, Any]:
    """Schema of [base]: a form for each kind of motion."""
    forms = forms_schema(BASES, "kind", KIND_WORDS, ("sine", "record"))
    # "1 g" is the scale of a record in g
    forms["record"]["properties"]["scale"]["x-unit"] = "m/s^2"
    forms["shock"]["required"].append("history")
    forms["sum"]["required"].append("parts")
    forms["sum"]["properties"]["parts"] = {
        "type": "array", "minItems": 1,
        "items": {"oneOf": list(forms_schema(PARTS, "kind", KIND_WORDS, ("sine",)).values())},
        "description": "motions that are added, [[base.parts]]",
    }  # fmt: skip
    about = (
        "Motion of the base: a sine, a record of its acceleration, a chirp, a stepped sine, a random motion, a shock, "
        "or none, beside forces."
    )
    return {"description": about, "oneOf": list(forms.values())}


def force_schema() -> dict[str, Any]:
    """Schema of [[force]]: a form for each kind."""
    forms = list(forms_schema(FORCES, "kind", KIND_WORDS).values())
    density = {"description": "one-sided density of the force", "x-unit": "Hz, N^2/Hz", "x-rows": "N^2/Hz"}
    for keys in (form["properties"] for form in forms):
        if "force" in keys:
            keys["force"]["description"] = "level of the force, needed where it acts at a place"
        if "psd" in keys:
            keys["psd"] = keys["psd"] | density
    for form in forms:
        form["required"] = [key for key in form["required"] if key != "force"]
    return {"description": "A force at a place or along the beam, beside the motion of the base.", "oneOf": forms}


def chosen_later(noun: Any) -> tuple[str, ...]:
    """Fields of a method that a study may leave to `Method.for_system`: those without a default."""
    return tuple(item.name for item in dataclasses.fields(noun) if item.default is dataclasses.MISSING)


def method_schema() -> dict[str, Any]:
    """Schema of [method]: a form for each method."""
    # a table without a name is the first of them
    forms = forms_schema({name: Kind(noun) for name, noun in METHODS.items()}, "name", "the method", ("newmark",))
    for name, noun in METHODS.items():
        forms[name]["required"] = [key for key in forms[name]["required"] if key not in chosen_later(noun)]
    return {"description": "How time runs; without dt the recommended step is taken.", "oneOf": list(forms.values())}


def plan_schema() -> dict[str, Any]:
    """Schema of [study]."""
    axes = {"$ref": "#/$defs/axes", "description": "What the study goes over: see [study.axes]."}
    limits = {"$ref": "#/$defs/limits", "description": _meanings(BestPlan)["limits"]}
    best = noun_schema(BestPlan, limits=limits)
    return noun_schema(ParameterPlan, axes=axes, sample=noun_schema(SamplePlan), best=best)


def limits_schema() -> dict[str, Any]:
    """Schema of [study.best.limits]; without quotes TOML takes the dots of a channel for tables in one another."""
    forms = [_number_of(quantity("1")), {"title": "a part of a name", "$ref": "#/$defs/limits"}]
    about = "Limits of the worst values, by the names of the measures; in the units of the measures."
    return {"type": "object", "description": about, "additionalProperties": {"anyOf": forms}}


def axes_schema() -> dict[str, Any]:
    """Schema of [study.axes]; without quotes TOML takes the dots of a path for tables in one another."""
    number = _number_of(quantity("1"))
    value = {"anyOf": [
        {"type": "number", "minimum": -MOST_FLOAT, "maximum": MOST_FLOAT},
        {"type": "array", "items": number, "minItems": 2, "maxItems": 2},
        {"type": "string"},
    ]}  # fmt: skip
    forms = [
        {"title": "values", "type": "array", "items": value, "minItems": 1, "uniqueItems": True},
        {"title": "points between two values", **grid_schema(number)},
        {"title": "of a sample: uniform between two values", **_closed({"from": number, "to": number})},
        *({"title": f"of a sample: {words}", **_closed({name: _two_numbers(name)})}
          for name, words in DISTRIBUTION_WORDS.items()),
    ]  # fmt: skip
    return {
        "type": "object",
        "description": "Values or a distribution of every axis, by the study path of the number.",
        "minProperties": 1,
        "additionalProperties": {"anyOf": [*forms, {"title": "a part of a path", "$ref": "#/$defs/axes"}]},
    }


def _two_numbers(distribution: str) -> dict[str, Any]:
    """Schema of the numbers of a distribution."""
    anything, positive = _number_of(quantity("1")), _number_of(quantity("1", above=0.0))
    first = positive if distribution == "lognormal" else anything
    second = anything if distribution == "uniform" else positive
    return {"type": "array", "prefixItems": [first, second], "minItems": 2, "maxItems": 2}
