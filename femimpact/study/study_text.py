"""The text of a study file: as it was read while it says what the study is, written anew where it does not."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from femimpact.contact import ContactLaw
from femimpact.errors import InputError
from femimpact.study.parameter_plan import AxisValues, Distribution, ParameterPlan
from femimpact.study.signal_motion import SignalMotion
from femimpact.study.study import Study
from femimpact.study.study_file import LAWS, read_study

__all__ = ["same_study", "study_text", "with_record"]

RECORD_LINE = re.compile(r"""^(\s*record\s*=\s*)("[^"\n]*"|'[^'\n]*')""", re.MULTILINE)
"""The usual line of a record in a study file, and the quoted path in it."""


def study_text(study: Study) -> str:
    """A study file that gives this study.

    Parameters
    ----------
    study : Study

    Returns
    -------
    str
        The text that the study was read from, with its comments, unless the study was changed since. A contact law
        that has no name in study files is named in a comment; such a file cannot be loaded, and says where.
    """
    try:
        if same_study(read_study(study.text, study.path), study):
            return study.text
    except InputError:
        pass
    return "\n".join(_lines(study)) + "\n"


def same_study(one: Study, other: Study) -> bool:
    """Whether two studies mean the same, wherever and however they are written."""
    names = [item.name for item in dataclasses.fields(Study) if item.name not in ("path", "text")]
    return all(getattr(one, name) == getattr(other, name) for name in names)


def with_record(text: str, record: str) -> str:
    """The text of a study file with another path of its record, where that stands on a separate line.

    Where it stands elsewhere the text does not fit its study any more, which `study_text` finds.
    """
    return RECORD_LINE.sub(lambda found: found[1] + _value(record), text, count=1)


def _lines(study: Study) -> Iterator[str]:
    structure = study.structure
    yield "# Written by femimpact: the study that was run. SI units."
    if not structure.supports:
        # without a word of them the root is clamped; keys come before all tables
        yield "support = []"
    segments = structure.beam.segments
    if len(segments) == 1:
        yield from _table("[beam]", _given(segments[0]))
    for segment in segments if len(segments) > 1 else ():
        yield from _table("[[beam.segment]]", {"name": segment.name, **_given(segment)})
    yield from _table("[mesh]", _given(study.mesh))
    for name, parts in (("mass", structure.masses), ("impactor", structure.impactors), ("stop", structure.stops),
                        ("support", structure.supports), ("spring", structure.springs),
                        ("dashpot", structure.dashpots)):  # fmt: skip
        for part in parts:
            yield from _table(f"[[{name}]]", _given(part))
    if structure.damping is not None:
        yield from _table("[damping]", _given(structure.damping))
    if structure.gravity:
        yield from _table("[gravity]", {"acceleration": structure.gravity})
    for name, table in (("reduction", study.reduction), ("base", study.base)):
        if table is not None:
            yield from _table(f"[{name}]", table.table if isinstance(table, SignalMotion) else _given(table))
    if study.method:
        yield from _table("[method]", study.method)
    if study.sweep is not None:
        yield from _table("[sweep]", _given(study.sweep))
    yield from _table("[output]", _given(study.output))
    if study.plan is not None:
        yield from _plan(study.plan)


def _plan(plan: ParameterPlan) -> Iterator[str]:
    own = _given(plan)
    yield from _table("[study]", {name: own[name] for name in own if name not in ("axes", "sample")})
    yield from _table("[study.axes]", {json.dumps(path): axis for path, axis in plan.axes.items()})
    if plan.sample is not None:
        yield from _table("[study.sample]", {"points": plan.sample.points, **_given(plan.sample)})


def _given(noun: Any) -> dict[str, Any]:
    """Fields of a noun that are not as they are by default, but for those that its text leaves out."""
    values = {item.name: (getattr(noun, item.name), item.default) for item in dataclasses.fields(noun) if item.repr}
    return {name: value for name, (value, default) in values.items() if value != default}


def _table(header: str, values: Mapping[str, Any]) -> Iterator[str]:
    yield ""
    yield header
    for name, value in values.items():
        yield from _law(name, value) if isinstance(value, ContactLaw) else [f"{name} = {_value(value)}"]


def _law(name: str, law: ContactLaw) -> Iterator[str]:
    """A law by its name in study files and the fields that this name leaves open."""
    noun, fixed = LAWS.get(law.name, (None, {}))
    if type(law) is not noun:
        yield f"# {name}: the law {law.name!r} ({type(law).__name__}) has no name in study files"
        return
    left = {key: value for key, value in _given(law).items() if key not in fixed}
    yield f"{name} = {{ {', '.join(_pairs({'law': law.name, **left}))} }}"


def _pairs(values: Mapping[str, Any]) -> Iterable[str]:
    return (f"{name} = {_value(value)}" for name, value in values.items())


def _value(value: Any) -> str:
    """A value as TOML writes it; floats to the last bit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # a basic string of TOML is one of JSON, but for the character "delete"
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, AxisValues):
        return _value(value.values)
    if isinstance(value, Distribution):
        return f"{{ {value.name} = {_value(value.numbers)} }}"
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)
