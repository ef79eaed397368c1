"""The study file: its tables read and checked against the fields of the nouns, described, and written."""

from __future__ import annotations

import dataclasses
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from femimpact.app.study.drives import BASES, FORCES, Kind, check_drives, force_of, force_table, kind_fault, table_of
from femimpact.app.study.file_units import flat, in_si_units, is_table, label_of, with_numbers, with_texts
from femimpact.app.study.parameter_plan import (
    AxisValues,
    BestPlan,
    Distribution,
    ParameterPlan,
    SamplePlan,
    axis_from,
    is_part_of_path,
)
from femimpact.app.study.schema import (
    axes_schema,
    base_schema,
    beam_schema,
    chosen_later,
    contact_schema,
    damping_schema,
    force_schema,
    limits_schema,
    method_schema,
    noun_schema,
    plan_schema,
)
from femimpact.app.study.start import PartStart
from femimpact.app.study.study import AsRead, Gravity, MeshChoice, OrbitsPlan, Output, Reduction, Study, SweepPlan
from femimpact.contact.law import ContactLaw
from femimpact.contact.laws import LAWS
from femimpact.errors import Fault, InputError, changed, require_path, suggestion
from femimpact.fem.mesh import uniform_mesh
from femimpact.integrators.methods import METHODS
from femimpact.regular_file import read_regular
from femimpact.structure.axial import Axial
from femimpact.structure.beam import Beam, ModalDamping, Rayleigh, Segment, require_single
from femimpact.structure.structure import (
    Absorber,
    Dashpot,
    Impactor,
    Meeting,
    PointMass,
    Spring,
    Stop,
    Structure,
    Support,
)

MOST_BYTES = 10_000_000
"""Largest size of a study file, bytes."""

DEEPEST = 20
"""Tables and lists in one another; the deepest of a sound study are four."""

LONG_NUMBER = re.compile(r"\d[\d_]{4000,}")

OF_SINE = frozenset({"amplitude", "acceleration", "frequency", "phase"})
OF_RECORD = frozenset({"scale", "detrend", "columns", "file", "samples", "high_pass"})
"""Keys of [base] that only one of its motions has, or might be taken to have."""


OF_STEPS = frozenset({"fade", "cycles", "seconds", "frequencies", "direction"})
"""Keys of [base] that a stepped sine has, and a sine not."""

OF_BASE = dict.fromkeys(OF_STEPS, 'belongs to [base] kind = "stepped-sine"')

RECORD_LINE = re.compile(r"""^(\s*record\s*=\s*)("[^"\n]*"|'[^'\n]*')""", re.MULTILINE)
"""The usual line of a record in a study file, and the quoted path in it."""


def load_study(path: str | Path) -> Study:
    """Read and validate a study file.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    InputError
        With every fault of the file: key path, value, unit and allowed range.

    Examples
    --------
    >>> import femimpact as fi
    >>> study = fi.load_study("meshes/stepped_cantilever.toml")
    >>> study.base.frequency
    9.0
    """
    require_path(path, "study", "a study file")
    path = Path(path)
    try:
        text = read_regular(path, MOST_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        allowed = "must be an existing TOML file ('femimpact init FILE' writes one)"
        raise InputError([Fault("study", str(path), "", allowed)]) from None
    except OSError as error:
        raise InputError([Fault("study", str(path), "", f"must be readable TOML: {error.strerror}")]) from None
    except UnicodeDecodeError as error:
        raise InputError([Fault("study", str(path), "", f"must be readable TOML: {error}")]) from None
    return read_study(text.replace("\r\n", "\n").replace("\r", "\n"), path)


def read_study(
    text: str,
    path: Path,  # of the file: a mesh file and a record are looked for beside it
) -> Study:
    """Validate the text of a study file.

    Raises `InputError` as of `load_study`.
    """
    try:
        data = tomllib.loads(text)
        reason = f"tables or lists in one another more than {DEEPEST} times" if _depth(data) > DEEPEST else ""
    except RecursionError:
        reason = "lists or tables in one another too many times"
    except ValueError as error:
        # of TOML, or of Python for a whole number of thousands of digits, in words on how to set its limit
        digits = None if isinstance(error, tomllib.TOMLDecodeError) else LONG_NUMBER.search(text)
        line = text.count("\n", 0, digits.start()) + 1 if digits else 0
        reason = f"a number of {len(digits[0])} digits in line {line}" if digits else str(error)
    if reason:
        raise InputError([Fault("study", str(path), "", f"must be readable TOML: {reason}")])
    data, readings = in_si_units(data, study_schema(), path.parent)
    study = _from_tables(data, path, text, readings.faults)
    return changed(study, as_read=AsRead(study, data, tuple(readings.found)))


def unit_lines(study: Study) -> list[str]:
    """Lines of what a study file has as texts with a unit, with the numbers in SI that they are."""

    def shown(value: Any) -> str:
        if isinstance(value, list):
            return f"{len(value)} rows"
        return f"{value[0]:.9g} Hz, {value[1]:.9g}" if isinstance(value, tuple) else f"{value:.9g}"

    # a text may stand twice in a list
    return list(dict.fromkeys(
        f"{key} = {words}: {shown(value)}{'' if unit in ('1', 'sigma') else f' {unit}'}"
        for key, words, value, unit in (study.as_read.quantities if study.as_read else ())
    ))  # fmt: skip


@cache
def study_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a study file as parsed from TOML.

    Every key has its type and range, a `description`, and as `x-unit` and `x-range` its unit and range in words.

    Returns: of what `json.dump` writes.
    """
    made = {name: table.schema() for name, table in TABLES.items()}
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "femimpact study",
        "description": "A structure on a moving base, and what is computed of it. SI units.",
        "type": "object",
        "properties": {n: {"type": "array", "items": made[n]} if TABLES[n].many else made[n] for n in TABLES},
        "required": [name for name, table in TABLES.items() if table.required],
        "additionalProperties": False,
        "$defs": {"axes": with_texts(axes_schema()), "limits": with_texts(limits_schema())},
    }
    return {**schema, "properties": with_texts(schema["properties"])}


def study_text(study: Study) -> str:
    """A study file that gives this study, with numbers in SI.

    Returns: the text that the study was read from, with its comments, unless the study was changed since. A contact law
    that has no name in study files is named in a comment; such a file cannot be loaded, and says where.
    """
    read = study.as_read
    if read is not None and study.text == read.study.text and same_study(study, read.study):
        text = with_numbers(study.text, read.tables) if read.quantities else study.text
        # a text in several lines keeps its unit
        if tomllib.loads(text) == read.tables:
            return text
    return "\n".join(study_lines(study)) + "\n"


def same_study(one: Study, other: Study) -> bool:
    """True where two studies are equal, whatever their paths and texts are."""
    names = (item.name for item in dataclasses.fields(Study) if item.name not in ("path", "text", "as_read"))
    if all(getattr(one, name) is getattr(other, name) for name in names):
        return True
    return one.source.get("content") == other.source.get("content") and [*study_lines(one)] == [*study_lines(other)]


def with_record(study: Study, record: str) -> Study:
    """The study with another path of its record, also in its text, where that stands on a separate line.

    Where it stands elsewhere the text does not fit its study any more, which `study_text` finds.
    """
    base: Any = study.base
    base = dataclasses.replace(base, source={**study.source, "record": record})
    text = RECORD_LINE.sub(lambda found: found[1] + _value(record), study.text, count=1)
    moved, read = dataclasses.replace(study, base=base, text=text), study.as_read
    if read is None or not same_study(study, read.study):
        return moved
    tables = {**read.tables, "base": {**read.tables["base"], "record": record}}
    return changed(moved, as_read=read._replace(study=moved, tables=tables))


# ---- reading --------------------------------------------------------------------------------------


def _depth(data: Any) -> int:
    """How many tables and lists are in one another at most, of which Python could show or compare no more than some."""
    depth, inner = 0, [data]
    while inner := [
        part for item in inner if isinstance(item, (dict, list))
        for part in (item.values() if isinstance(item, dict) else item)
    ]:  # fmt: skip
        depth += 1
    return depth


def _from_tables(data: Mapping[str, Any], path: Path, text: str, of_units: list[Fault]) -> Study:
    faults: list[Fault] = []
    unknown = sorted(set(data) - set(TABLES))
    faults += [Fault(name, None, "", suggestion(name, TABLES)) for name in unknown]
    missing = [name for name, table in TABLES.items() if table.required and name not in data]
    faults += [Fault(name, None, "", f"table [{name}] is missing") for name in missing]
    # with what is sound, so that faults between tables are found in the same pass
    fields: dict[str, Any] = {}
    for name, table in TABLES.items():
        if name in data:
            before = len(faults)
            read = partial(_base, folder=path.parent) if name == "base" else table.read
            nouns = _table(name, read, table.many, data[name], faults)
            if len(faults) == before and nouns is not None:
                fields |= nouns if name == "base" else {table.place: nouns}
    structure, mesh = None, fields.get("mesh")
    if "structure.beam" in fields:
        parts = {place.removeprefix("structure."): fields.pop(place) for place in list(fields) if "." in place}
        if "impactor" in data and "impactors" not in parts:
            # a fault of a ball is none of what it meets
            parts.pop("meetings", None)
        structure = _collected("", partial(Structure, **parts), faults)
    if structure is not None and mesh is not None and mesh.elements is not None:
        _collected("", partial(uniform_mesh, structure, mesh.elements), faults)
    if "base" in fields and ("force" not in data or "forces" in fields):
        forces = fields["forces"] = tuple(fields.get("forces", ()))
        _collected("", partial(check_drives, fields["base"], forces, fields["duration"]), faults)
    # what has no number in SI is no number of its field either
    keys = {fault.key for fault in of_units}
    faults = [*of_units, *(fault for fault in faults if fault.key not in keys)]
    if faults or structure is None:
        raise InputError(faults)
    absent: dict[str, Any] = {"reduction": None, "method": {}, "sweep": None, "output": Output()}
    return Study(structure=structure, path=path, text=text, **{**absent, **fields})


def _collected(prefix: str, make: Callable[[], Any], faults: list[Fault]) -> Any:
    """The result, or None with the faults of an `InputError` noted under the prefix."""
    try:
        return make()
    except InputError as error:
        faults += [fault.under(prefix) for fault in error.faults]
        return None


def _table(name: str, read: Reader, many: bool, value: Any, faults: list[Fault]) -> Any:
    """The noun or nouns made of a table or a list of tables; None with the faults noted."""
    if not many:
        if not isinstance(value, dict):
            faults.append(Fault(name, value, "", f"must be a table, [{name}]"))
            return None
        return read(name, value, faults)
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        faults.append(Fault(name, None, "", f"must be a list of tables, [[{name}]]"))
        return None
    made = [read(f"{name}.{label_of(item, i)}", item, faults) for i, item in enumerate(value, 1)]
    return None if any(item is None for item in made) else made


def _noun(noun: Any, prefix: str, values: Mapping[str, Any], faults: list[Fault], **given: Any) -> Any:
    """Check keys, types and ranges against the fields of a noun, then make it; where a field is None, check alone."""
    kind = Kind(noun, without=tuple(given), elsewhere=OF_BASE if noun is SweepPlan else {})
    if any(value is None for value in given.values()):
        return _collected(prefix, partial(kind.check, values), faults)
    return _collected(prefix, partial(kind.made, values, **given), faults)


def _segment(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    before = len(faults)
    _collected(prefix, partial(require_single, values), faults)
    if len(faults) == before:
        return _noun(Segment, prefix, values, faults)
    single = {name: value for name, value in values.items() if name not in ("width", "thickness")}
    return _collected(prefix, partial(Kind(Segment).check, single), faults)


def _beam(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    if "segment" not in values:
        segment = _segment(prefix, values, faults)
        return Beam((segment,)) if segment is not None else None
    for name in sorted(set(values) - {"segment"}):
        faults.append(Fault(f"{prefix}.{name}", None, "", "belongs into each [[beam.segment]] of a stepped beam"))
    segments = _table(f"{prefix}.segment", _segment, True, values["segment"], faults)
    if segments == []:
        faults.append(Fault(f"{prefix}.segment", None, "", "must hold at least one segment"))
    return _collected(prefix, lambda: Beam(tuple(segments)), faults) if segments else None


def _with_contact(noun: Any, prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    rest = {key: value for key, value in values.items() if key != "contact"}
    contact = values.get("contact")
    law = None
    if not isinstance(contact, dict) or str(contact.get("law")) not in LAWS:
        named = contact.get("law") if isinstance(contact, dict) else contact
        table = "" if isinstance(contact, dict) else "a table with law = "
        allowed = f"must be {table}one of {', '.join(repr(name) for name in LAWS)}"
        faults.append(Fault(f"{prefix}.contact.law", named, "", allowed))
    else:
        numbers = {key: value for key, value in contact.items() if key != "law"}
        made_by, fixed = LAWS[contact["law"]]
        law = _noun(made_by, f"{prefix}.contact", numbers, faults, **fixed)
    return _noun(noun, prefix, rest, faults, contact=law)


def _damping(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    """Ratios mode by mode, or Rayleigh's coefficients from two of them."""
    return _noun(ModalDamping if "ratios" in values else Rayleigh, prefix, values, faults)


def _gravity(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    made = _noun(Gravity, prefix, values, faults)
    return None if made is None else made.acceleration


def _base(prefix: str, values: Mapping[str, Any], faults: list[Fault], folder: Path = Path()) -> Any:
    """The motion of the base, duration and start of the history; the path of a record is given from a folder."""
    kind = values.get("kind", "record" if "record" in values else "sine")
    if not isinstance(kind, str) or kind not in BASES:
        faults.append(kind_fault(f"{prefix}.kind", kind, BASES))
        return None
    values = {name: value for name, value in values.items() if name != "kind"}
    if kind == "sine" and "record" in values:
        faults.append(Fault(f"{prefix}.record", None, "", 'belongs to kind = "record", and [base] is of kind "sine"'))
        return None
    if kind == "record" and "record" not in values:
        faults.append(Fault(f"{prefix}.record", None, "", "is missing: the path of a file, record = 'shaker.csv'"))
        return None
    if kind == "sine" and OF_RECORD & set(values):
        of_record = ", ".join(sorted(OF_RECORD & set(values)))
        allowed = f"is missing: [base] has {of_record}, and a record is given by its path, record = 'shaker.csv'"
        faults.append(Fault(f"{prefix}.record", None, "", allowed))
        return None
    if kind == "sine" and OF_STEPS & set(values):
        faults.append(_of_steps(prefix, values))
        return None
    before, given = len(faults), dict[str, Any]()
    if kind == "record":
        for name in sorted(OF_SINE & set(values)):
            allowed = "belongs to a sine, and [base] has a record: give one of the two (scale multiplies a record)"
            faults.append(Fault(f"{prefix}.{name}", values[name], "", allowed))
        values = {name: value for name, value in values.items() if name not in OF_SINE}
        given["folder"] = folder
    elif kind not in ("sine", "rest"):
        values = _values(prefix, values, faults)
    motion = _collected(prefix, partial(BASES[kind].made, values, **given), faults)
    beside = {one.argument: values.get(key, one.default) for key, one in BASES[kind].beside.items()}
    return {"base": motion, **beside} if len(faults) == before else None


def _of_steps(prefix: str, values: Mapping[str, Any]) -> Fault:
    """What to write where a sine has keys of a stepped sine."""
    name = next(name for name in values if name in OF_STEPS)
    allowed = 'belongs to kind = "stepped-sine", with frequencies = [...] and cycles or seconds'
    if name == "frequencies":
        allowed += '; cases of a sine at several frequencies are an axis, [study.axes] "base.frequency" = [...]'
    unit = "" if isinstance(values[name], str) else BASES["stepped-sine"].keys[name].metadata.get("unit", "")
    return Fault(f"{prefix}.{name}", values[name], unit, allowed)


def _force(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    """A force by its kind, with the keys of that kind."""
    kind = values.get("kind")
    if not isinstance(kind, str) or kind not in FORCES:
        faults.append(kind_fault(f"{prefix}.kind", kind, FORCES))
        return None
    placed = [key for key in ("at", "density") if values.get(key) is not None]
    if len(placed) != 1:
        along = "the place at which the force acts, or density (N/m) of one along the beam"
        words = f"must be one of both: {along}" if placed else f"is missing: {along}"
        faults.append(Fault(f"{prefix}.at", values.get("at"), "", words))
        return None
    return _collected(prefix, partial(force_of, _values(prefix, values, faults)), faults)


def _values(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> dict[str, Any]:
    """Keys and values of a kind of motion or force; frequencies between two of them are these numbers."""
    if not isinstance(values.get("frequencies"), dict):
        return dict(values)
    axis = _collected("", partial(axis_from, f"{prefix}.frequencies", values["frequencies"]), faults)
    if isinstance(axis, Distribution):
        allowed = "must be numbers, or points between two of them: from, to and points"
        faults.append(Fault(f"{prefix}.frequencies", values["frequencies"], "", allowed))
    return {**values, "frequencies": getattr(axis, "values", (1.0,))}


def _method(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    settings = {key: value for key, value in values.items() if key != "name"}
    name = values.get("name", "newmark")
    if not isinstance(name, str) or name not in METHODS:
        allowed = f"must be one of {', '.join(repr(known) for known in METHODS)}"
        faults.append(Fault(f"{prefix}.name", name, "", allowed))
        return None
    noun = METHODS[name]
    # what may be left out is chosen later: any will do to check the rest together
    _noun(noun, prefix, {**dict.fromkeys(chosen_later(noun), 1.0), **settings}, faults)
    return {"name": name, **settings}


def _plan(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    """Axes, sample and best are tables within the table."""
    before, inner = len(faults), {"axes": values.get("axes", {}), "sample": values.get("sample")}
    inner["best"] = values.get("best")
    for name, table in inner.items():
        if table is not None and not isinstance(table, dict):
            faults.append(Fault(f"{prefix}.{name}", table, "", f"must be a table, [{prefix}.{name}]"))
    if isinstance(inner["axes"], dict) and not inner["axes"]:
        faults.append(Fault(f"{prefix}.axes", None, "", f"table [{prefix}.axes] is missing"))
    if len(faults) > before:
        return None
    axes: dict[str, Any] = {}
    for path, given in flat(inner["axes"], is_part_of_path):
        if path in axes:
            # once in quotes and once in tables
            faults.append(Fault(f"{prefix}.axes.{path}", None, "", "is given twice: an axis must be given once"))
        axes[path] = _collected("", partial(axis_from, f"{prefix}.axes.{path}", given), faults)
    sample = _noun(SamplePlan, f"{prefix}.sample", inner["sample"], faults) if inner["sample"] is not None else None
    best = _best(f"{prefix}.best", inner["best"], faults) if inner["best"] is not None else None
    rest = {key: value for key, value in values.items() if key not in inner}
    own = {name: made for name, made in (("sample", sample), ("best", best)) if inner[name]}
    plan = _noun(ParameterPlan, prefix, rest, faults, axes=axes, **own)
    return plan if len(faults) == before else None


def _best(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    """Limits are numbers by the names of measures, of which those of channels have dots."""
    limits = values.get("limits", {})
    if not isinstance(limits, dict):
        faults.append(Fault(f"{prefix}.limits", limits, "", "must be numbers by the names of measures"))
        return None
    return _noun(BestPlan, prefix, {**values, "limits": dict(flat(limits, is_table))}, faults)


# ---- writing --------------------------------------------------------------------------------------


def study_lines(study: Study) -> Iterator[str]:
    """Lines of a study file that gives this study, without comments and with numbers in SI."""
    structure = study.structure
    yield "# Written by femimpact: the study that was run. SI units."
    if not structure.supports:
        # without a word of them the root is clamped; keys come before all tables
        yield "support = []"
    for name, table in TABLES.items():
        found: Any = attrgetter(table.place)(study) if table.place else study
        for part in found if table.many else [found] if found else []:
            yield from table.write(f"[[{name}]]" if table.many else f"[{name}]", part)


def _beam_lines(header: str, beam: Beam) -> Iterator[str]:
    if len(beam.segments) == 1:
        yield from _noun_lines(header, beam.segments[0])
    for segment in beam.segments if len(beam.segments) > 1 else ():
        yield from _table_lines("[[beam.segment]]", {"name": segment.name, **_given(segment)})


def _plan_lines(header: str, plan: ParameterPlan) -> Iterator[str]:
    given = _given(plan)
    yield from _table_lines(header, {name: given[name] for name in given if name not in ("axes", "sample", "best")})
    yield from _table_lines("[study.axes]", {json.dumps(path): axis for path, axis in plan.axes.items()})
    if plan.sample is not None:
        yield from _table_lines("[study.sample]", {"points": plan.sample.points, **_given(plan.sample)})
    if plan.best is not None:
        best = _given(plan.best)
        limits = {json.dumps(name): limit for name, limit in (plan.best.limits or {}).items()}
        yield from _table_lines("[study.best]", {name: best[name] for name in best if name != "limits"})
        yield from _table_lines("[study.best.limits]", limits) if limits else ()


def _noun_lines(header: str, noun: Any) -> Iterator[str]:
    return _table_lines(header, _given(noun))


def _base_lines(header: str, study: Study) -> Iterator[str]:
    table = table_of(study.base, BASES)
    beside = BASES[table["kind"]].beside
    if table["kind"] in ("sine", "record"):
        del table["kind"]
    given = {key: (getattr(study, one.argument), one.default) for key, one in beside.items()}
    return _table_lines(header, table | {key: value for key, (value, default) in given.items() if value != default})


def _given(noun: Any) -> dict[str, Any]:
    """Fields of a noun that are not as they are by default."""
    return Kind(type(noun)).table(noun)


def _table_lines(header: str, values: Mapping[str, Any]) -> Iterator[str]:
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
    pairs = (f"{key} = {_value(value)}" for key, value in {"law": law.name, **left}.items())
    yield f"{name} = {{ {', '.join(pairs)} }}"


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
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{name} = {_value(item)}' for name, item in value.items())} }}"
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)


# ---- the tables -----------------------------------------------------------------------------------


Reader = Callable[[str, Mapping[str, Any], list[Fault]], Any]
"""Makes something of a table by its name in the file, its keys and values, and a list to which faults are added."""


@dataclass(frozen=True)
class _Table:
    """A TOML table: how it is read, described and written."""

    place: str  # in a `Study`, of what is read from the table; empty where it is several fields
    read: Reader
    schema: Callable[[], dict[str, Any]]  # JSON schema
    write: Callable[[str, Any], Iterable[str]] = _noun_lines  # lines of a file, from the header and what stands there
    many: bool = False  # a list of tables
    required: bool = False


def _of(noun: Any, place: str, many: bool = False, required: bool = False, laws: Iterable[str] = LAWS) -> _Table:
    """The table whose keys are the fields of a noun, with a table `contact` where the noun has one."""
    if any(item.name == "contact" for item in dataclasses.fields(noun)):
        read, schema = partial(_with_contact, noun), lambda: noun_schema(noun, contact=contact_schema(laws))
        return _Table(place, read, schema, many=many, required=required)
    return _Table(place, partial(_noun, noun), partial(noun_schema, noun), many=many, required=required)


TABLES: Mapping[str, _Table] = {
    "beam": _Table("structure.beam", _beam, beam_schema, _beam_lines, required=True),
    "mesh": _of(MeshChoice, "mesh", required=True),
    "mass": _of(PointMass, "structure.masses", many=True),
    "impactor": _of(Impactor, "structure.impactors", many=True),
    "stop": _of(Stop, "structure.stops", many=True),
    "meeting": _of(Meeting, "structure.meetings", many=True, laws=("kelvin-voigt", "rigid")),
    "support": _of(Support, "structure.supports", many=True),
    "spring": _of(Spring, "structure.springs", many=True),
    "dashpot": _of(Dashpot, "structure.dashpots", many=True),
    "absorber": _of(Absorber, "structure.absorbers", many=True),
    "damping": _Table("structure.damping", _damping, damping_schema),
    "gravity": _Table(
        "structure.gravity",
        _gravity,
        partial(noun_schema, Gravity),
        lambda header, g: _table_lines(header, {"acceleration": g}),
    ),
    "axial": _of(Axial, "structure.axial"),
    "reduction": _of(Reduction, "reduction"),
    "base": _Table("", _base, base_schema, _base_lines, required=True),
    "force": _Table(
        "forces", _force, force_schema, lambda header, force: _table_lines(header, force_table(force)), many=True
    ),
    "start": _of(PartStart, "begins", many=True),
    "method": _Table("method", _method, method_schema, _table_lines),
    "sweep": _of(SweepPlan, "sweep"),
    "orbits": _of(OrbitsPlan, "orbits"),
    "output": _of(Output, "output"),
    "study": _Table("plan", _plan, plan_schema, _plan_lines),
}
"""Every table of a study file. Reading, schema and writing go over them in this order."""
