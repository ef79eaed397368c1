"""The study file: TOML of the same nouns, every fault found at once and named by its path."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, create_model
from pydantic_core import PydanticCustomError

from femimpact.assembly import assemble
from femimpact.contact import KelvinVoigt, PowerLaw, Rigid, SwitchingSpring
from femimpact.damping import Rayleigh
from femimpact.errors import (
    Fault,
    InputError,
    allowed_range,
    check_fields,
    choice,
    in_range,
    quantity,
    require,
    suggestion,
)
from femimpact.excitation import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import METHODS, Method
from femimpact.integrators.stepping import recommended_step
from femimpact.mesh import Mesh, read_mesh, uniform_mesh
from femimpact.reduction import reduce
from femimpact.structure import Beam, Impactor, PointMass, Segment, Stop, Structure, Support
from femimpact.system import State, System

__all__ = [
    "BaseMotion",
    "MeshChoice",
    "Output",
    "Reduction",
    "Study",
    "SweepPlan",
    "build",
    "build_systems",
    "load_study",
    "method_for",
]

LAWS: Mapping[str, tuple[Any, Mapping[str, Any]]] = {
    "kelvin-voigt": (KelvinVoigt, {}),
    "switching-spring": (SwitchingSpring, {}),
    "hertz": (PowerLaw, {"loss": "none", "restitution": 1.0}),
    "hunt-crossley": (PowerLaw, {"loss": "hunt-crossley"}),
    "lankarani-nikravesh": (PowerLaw, {"loss": "lankarani-nikravesh"}),
    "flores": (PowerLaw, {"loss": "flores"}),
    "gonthier-carvalho-martins": (PowerLaw, {"loss": "exact"}),
    "rigid": (Rigid, {}),
}
"""Each law of a study file: its noun, and the fields that the law's name fixes."""


@dataclass(frozen=True)
class MeshChoice:
    """`[mesh]`: a number of elements, or a mesh file beside the study."""

    elements: int | None = field(default=None, metadata=quantity("1", at_least=1, at_most=100_000, integer=True))
    file: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        one = (self.elements is None) != (self.file is None)
        require(one, "elements", self.elements, "", "give either elements (a whole number) or file (a path)")


@dataclass(frozen=True)
class Reduction:
    """`[reduction]`: how many normal modes are kept."""

    modes: int = field(metadata=quantity("1", at_least=1, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class BaseMotion:
    """`[base]`: amplitude of the sine; frequency, phase and duration of the simulated history; start."""

    amplitude: float = field(metadata=quantity("m", above=0.0))
    frequency: float = field(metadata=quantity("Hz", above=0.0))
    duration: float = field(default=30.0, metadata=quantity("s", above=0.0))
    phase: float = field(default=0.0, metadata=quantity("rad"))
    start: str = field(default="base", metadata=choice("base", "space"))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class SweepPlan:
    """`[sweep]`: an even grid, and how many points refine it around each resonance."""

    start: float = field(metadata=quantity("Hz", above=0.0))
    stop: float = field(metadata=quantity("Hz", above=0.0))
    points: int = field(metadata=quantity("1", at_least=4, at_most=100_000, integer=True))
    cycles: int = field(metadata=quantity("1", at_least=24, integer=True))
    refine: int = field(default=0, metadata=quantity("1", at_least=0, at_most=100_000, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)
        require(self.stop > self.start, "stop", self.stop, "Hz", f"must be > start, {self.start:g} Hz")


@dataclass(frozen=True)
class Output:
    """`[output]`: what is written.

    `every` is the stride of the history in steps; `frames` whole deflections are kept over the last
    `frame_cycles` base cycles for ParaView and the movie; `exaggeration` scales the motion there
    (absent: chosen by the movie, 1 for ParaView); a run that would keep more than `memory_limit`
    is refused.
    """

    every: int = field(default=10, metadata=quantity("steps", at_least=1, integer=True))
    frames: int = field(default=160, metadata=quantity("1", at_least=0, at_most=5000, integer=True))
    frame_cycles: float = field(default=3.0, metadata=quantity("1", above=0.0))
    exaggeration: float | None = field(default=None, metadata=quantity("1", above=0.0))
    memory_limit: float = field(default=1e9, metadata=quantity("bytes", above=0.0))
    figures: bool = True
    paraview: bool = True
    movie: bool = True

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, eq=False)
class Study:
    """A validated study file.

    Parameters
    ----------
    structure : Structure
    mesh : MeshChoice
    base : BaseMotion
    reduction : Reduction or None
        None integrates in physical dofs.
    method : mapping of str to value
        Its name and fields as given; dt may be absent and is then the recommended step.
    sweep : SweepPlan or None
    output : Output
    path : Path
    text : str
        The file as read, kept with the results.
    """

    structure: Structure
    mesh: MeshChoice
    base: BaseMotion
    reduction: Reduction | None
    method: Mapping[str, Any]
    sweep: SweepPlan | None
    output: Output
    path: Path
    text: str

    @property
    def sine(self) -> Sine:
        """Base motion of the simulated history."""
        return Sine(self.base.amplitude, self.base.frequency, self.base.phase)

    @property
    def initial(self) -> State:
        """State at the start."""
        return State.at_rest(self.base.start)


def build(study: Study, structure: Structure | None = None) -> tuple[System, System, Method]:
    """The full system, the one that is integrated, and the method with its step.

    Parameters
    ----------
    study : Study
    structure : Structure, optional
        Another structure on the study's mesh and reduction.

    Returns
    -------
    full, small : System
    method : Method
    """
    full, small = build_systems(study, structure)
    return full, small, method_for(study, small)


def build_systems(study: Study, structure: Structure | None = None) -> tuple[System, System]:
    """The full system and the one that is integrated."""
    mesh = _mesh(study)
    full = assemble(structure or study.structure, mesh=mesh, elements=None if mesh else study.mesh.elements)
    small = full
    if study.reduction is not None:
        kept = study.reduction.modes
        fits = kept <= full.dofs
        require(fits, "reduction.modes", kept, "", f"must be <= {full.dofs}, the dofs of this mesh")
        small = reduce(full, kept)
    return full, small


def method_for(study: Study, system: System) -> Method:
    """The study's method for a system: with the step recommended for it unless the study gives one."""
    settings = dict(study.method)
    noun = METHODS[settings.pop("name", "newmark")]
    if noun is not EventDriven and "dt" not in settings:
        settings["dt"] = recommended_step(system, settings.get("refine", 1))
    made: Method = noun(**settings)
    return made


def _mesh(study: Study) -> Mesh | None:
    return read_mesh(study.path.parent / study.mesh.file) if study.mesh.file else None


# ---- from text to nouns ---------------------------------------------------------------------------


def load_study(path: str | Path) -> Study:
    """Read and validate a study file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Study

    Raises
    ------
    InputError
        With every fault of the file: key path, value, unit and allowed range.
    """
    path = Path(path)
    require(path.is_file(), "study", str(path), "", "must be an existing TOML file ('femimpact init FILE' writes one)")
    try:
        text = path.read_text(encoding="utf-8-sig")
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise InputError([Fault("study", str(path), "", f"must be readable TOML: {error}")]) from None
    return _from_tables(data, path, text)


def _from_tables(data: Mapping[str, Any], path: Path, text: str) -> Study:
    faults: list[Fault] = []
    unknown = sorted(set(data) - set(TABLES))
    faults += [Fault(name, None, "", suggestion(name, TABLES)) for name in unknown]
    missing = [name for name, table in TABLES.items() if table.required and name not in data]
    faults += [Fault(name, None, "", f"table [{name}] is missing") for name in missing]
    made: dict[str, Any] = {}
    for name, table in TABLES.items():
        if name in data and name not in unknown:
            before = len(faults)
            made[name] = _table(name, table, data[name], faults)
            if len(faults) > before:
                made[name] = None
    structure = None
    if made.get("beam") is not None:
        # with what is sound of the rest, so that faults between tables are found in the same pass
        parts = {"masses": "mass", "impactors": "impactor", "stops": "stop", "supports": "support"}
        parts["damping"] = "damping"
        given = {key: made[name] for key, name in parts.items() if made.get(name) is not None}
        structure = _collected("", partial(Structure, beam=made["beam"], **given), faults)
    mesh = made.get("mesh")
    if structure is not None and mesh is not None and mesh.elements is not None:
        _collected("", partial(uniform_mesh, structure, mesh.elements), faults)
    if faults or structure is None:
        raise InputError(faults)
    return Study(
        structure=structure,
        mesh=made["mesh"],
        base=made["base"],
        reduction=made.get("reduction"),
        method=made.get("method") or {},
        sweep=made.get("sweep"),
        output=made.get("output") or Output(),
        path=path,
        text=text,
    )


def _collected(prefix: str, make: Callable[[], Any], faults: list[Fault]) -> Any:
    """The result, or None with the faults of an `InputError` noted under the prefix."""
    try:
        return make()
    except InputError as error:
        faults += [fault.under(prefix) for fault in error.faults]
        return None


@dataclass(frozen=True)
class _Table:
    """How one TOML table becomes a noun."""

    make: Callable[[str, Mapping[str, Any], list[Fault]], Any]
    many: bool = False
    required: bool = False


def _table(name: str, table: _Table, value: Any, faults: list[Fault]) -> Any:
    if not table.many:
        if not isinstance(value, dict):
            faults.append(Fault(name, value, "", f"must be a table, [{name}]"))
            return None
        return table.make(name, value, faults)
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        faults.append(Fault(name, None, "", f"must be a list of tables, [[{name}]]"))
        return None
    labels = [str(item.get("name", item.get("at", i + 1))) for i, item in enumerate(value)]
    made = [table.make(f"{name}.{label}", item, faults) for label, item in zip(labels, value, strict=True)]
    return None if any(item is None for item in made) else made


def _noun(noun: Any, prefix: str, values: Mapping[str, Any], faults: list[Fault], **given: Any) -> Any:
    """Check keys, types and ranges against the noun's own fields, then make it."""
    before = len(faults)
    faults += _model_faults(_model_of(noun, tuple(given)), noun, prefix, values)
    if len(faults) > before or any(value is None for value in given.values()):
        return None
    clean = {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
    return _collected(prefix, lambda: noun(**clean, **given), faults)


def _model_of(noun: Any, without: tuple[str, ...] = (), optional: tuple[str, ...] = ()) -> type[BaseModel]:
    """A pydantic model of a dataclass: the same keys, and each number's range from the field itself."""
    fields: dict[str, Any] = {}
    for item in dataclasses.fields(noun):
        if item.name in without:
            continue
        kind: Any = {"str": str, "str | None": str, "bool": bool}.get(str(item.type), Any)
        if "unit" in item.metadata:
            kind = Annotated[Any, BeforeValidator(partial(_check_quantity, metadata=item.metadata))]
        needed = item.default is dataclasses.MISSING and item.name not in optional
        fields[item.name] = (kind, ... if needed else None)
    return create_model(noun.__name__, __config__=ConfigDict(extra="forbid", strict=True), **fields)


def _check_quantity(value: Any, metadata: Mapping[str, Any]) -> Any:
    entries = value if isinstance(value, list) else [value]
    if not entries or not all(in_range(entry, metadata) for entry in entries):
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": allowed_range(metadata)})
    return value


def _model_faults(model: type[BaseModel], noun: Any, prefix: str, values: Mapping[str, Any]) -> list[Fault]:
    try:
        model(**values)
    except ValidationError as error:
        return [_fault(noun, prefix, model, problem) for problem in error.errors(include_url=False)]
    return []


def _fault(noun: Any, prefix: str, model: type[BaseModel], problem: Any) -> Fault:
    key = ".".join(str(part) for part in problem["loc"])
    path = f"{prefix}.{key}"
    metadata: Mapping[str, Any] = next((f.metadata for f in dataclasses.fields(noun) if f.name == key), {})
    if problem["type"] == "extra_forbidden":
        return Fault(path, None, "", suggestion(key, model.model_fields))
    if problem["type"] == "missing":
        wanted = f"; {allowed_range(metadata)}" if metadata else ""
        return Fault(path, None, "", f"is missing{wanted}")
    if problem["type"] == "quantity":
        return Fault(path, problem["input"], metadata["unit"], problem["msg"])
    return Fault(path, problem["input"], "", problem["msg"].replace("Input should be", "must be"))


def _beam(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    if "segment" not in values:
        segment = _noun(Segment, prefix, values, faults)
        return Beam((segment,)) if segment is not None else None
    for name in sorted(set(values) - {"segment"}):
        faults.append(Fault(f"{prefix}.{name}", None, "", "belongs into each [[beam.segment]] of a stepped beam"))
    segments = _table(f"{prefix}.segment", _Table(partial(_noun, Segment), many=True), values["segment"], faults)
    return _collected(prefix, lambda: Beam(tuple(segments)), faults) if segments else None


def _with_contact(noun: Any, prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    rest = {key: value for key, value in values.items() if key != "contact"}
    contact = values.get("contact")
    law = None
    if not isinstance(contact, dict) or str(contact.get("law")) not in LAWS:
        named = contact.get("law") if isinstance(contact, dict) else contact
        allowed = f"must be a table with law = one of {', '.join(repr(name) for name in LAWS)}"
        faults.append(Fault(f"{prefix}.contact.law", named, "", allowed))
    else:
        numbers = {key: value for key, value in contact.items() if key != "law"}
        made_by, fixed = LAWS[contact["law"]]
        law = _noun(made_by, f"{prefix}.contact", numbers, faults, **fixed)
    return _noun(noun, prefix, rest, faults, contact=law)


def _method(prefix: str, values: Mapping[str, Any], faults: list[Fault]) -> Any:
    settings = {key: value for key, value in values.items() if key != "name"}
    name = values.get("name", "newmark")
    if not isinstance(name, str) or name not in METHODS:
        allowed = f"must be one of {', '.join(repr(known) for known in METHODS)}"
        faults.append(Fault(f"{prefix}.name", name, "", allowed))
        return None
    noun = METHODS[name]
    found = _model_faults(_model_of(noun, optional=("dt",)), noun, prefix, settings)
    # dt is chosen later: any will do to check the rest together
    stand_in = {} if noun is EventDriven else {"dt": 1.0}
    if not found:
        _collected(prefix, lambda: noun(**{**stand_in, **settings}), found)
    faults += found
    return {"name": name, **settings}


TABLES: Mapping[str, _Table] = {
    "beam": _Table(_beam, required=True),
    "mesh": _Table(partial(_noun, MeshChoice), required=True),
    "mass": _Table(partial(_noun, PointMass), many=True),
    "impactor": _Table(partial(_with_contact, Impactor), many=True),
    "stop": _Table(partial(_with_contact, Stop), many=True),
    "support": _Table(partial(_noun, Support), many=True),
    "damping": _Table(partial(_noun, Rayleigh)),
    "reduction": _Table(partial(_noun, Reduction)),
    "base": _Table(partial(_noun, BaseMotion), required=True),
    "method": _Table(_method),
    "sweep": _Table(partial(_noun, SweepPlan)),
    "output": _Table(partial(_noun, Output)),
}
