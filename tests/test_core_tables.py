"""Arrays that Python hands to the core: names, types and shapes are the same on both sides, wrong ones are refused."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact import core
from femimpact.contact import laws
from femimpact.core import compilation
from femimpact.core.structs import LINE, zeros, zeros_together
from femimpact.integrators.event_driven import block
from femimpact.integrators.stepping import run as stepping_run
from femimpact.response import impacts

TYPES = {"float64": "Array", "complex128": "Complex", "int64": "Integers", "bool": "NDArray[np.bool_]"}

SINE, RECORD = fi.Sine(1e-4, 5.0), fi.RecordedBase(np.linspace(-1.0, 1.0, 9), 0.1)


@pytest.mark.parametrize("name", core.ARGUMENTS)
def test_stubs_of_the_sources_have_the_structs_and_rows_of_the_binary(name):
    structs, rows = {}, {}
    for path, kind, shape, _ in core.tables():
        outer, _, field = path.rpartition(".")
        if outer in structs:
            structs[outer][1][field] = shape if kind == "tuple" else TYPES[kind] if shape else kind
        if kind == "tuple" and path.partition(".")[0] in core.ARGUMENTS[name]:
            structs[path] = shape, {}
        if (path, kind) == (name, "names"):
            rows |= {row: number for number, row in enumerate(shape.split(", "))}
    stub = ast.parse(compilation.stubs(Path(core.__file__).parent)[name])
    fields = {
        each.name: {line.target.id: ast.unparse(line.annotation) for line in each.body}
        for each in stub.body
        if isinstance(each, ast.ClassDef)
    }
    assert fields == dict(structs.values())
    assert {line.target.id for line in stub.body if isinstance(line, ast.AnnAssign)} == set(rows)
    space = vars(getattr(core, name))
    assert {row: number for row, number in space.items() if isinstance(number, int)} == rows
    assert {struct: noun._fields for struct, noun in space.items() if struct not in rows} == {
        struct: tuple(of_struct) for struct, of_struct in fields.items()
    }


def test_arrays_of_zeros_have_the_shapes_and_types_of_the_tables():
    lengths = {"C": 2, "R": 3, "O": 4, "N": 5, "d": 6, "P": 7, "K": 8, "H": 9, "L": 0, "m": 0, "V": 0}
    hit = np.ones(2)
    cases = zeros(core.events.Cases, lengths, degree=1, longest=0.5, hit=hit)
    assert cases.hit is hit
    assert (cases.sine.shape, cases.sine.dtype) == ((2, 5, 2 * 3 + 4), complex)
    assert (cases.known.dtype, cases.form.dtype, cases.pieces.shape) == (bool, np.int64, (0, 8 * 9))
    assert not any(np.any(array) for name, array in cases._asdict().items() if name not in ("degree", "longest", "hit"))
    space = zeros_together(core.events.Space, lengths | {"S": 2})
    assert space.products.rates.shape == (6, 9 + 9 + 6)
    arrays = [value for _, value in places(space)]
    lines = [array.ctypes.data // LINE + k for array in arrays for k in range(-(-array.nbytes // LINE))]
    assert all(array.ctypes.data % LINE == 0 and not np.any(array) for array in arrays)
    assert len(set(lines)) == len(lines) > 40
    for wrong in ({"degree": 1}, {"degree": 1, "longest": 0.5, "hits": hit}):
        with pytest.raises(TypeError):
            zeros(core.events.Cases, lengths, **wrong)


def test_a_struct_has_the_same_fields_wherever_it_is_handed_over():
    of_struct = {}
    tables = core.tables()
    for path, kind, name, _ in tables:
        if kind == "tuple":
            rows = [(row[0].removeprefix(f"{path}."), *row[1:]) for row in tables if row[0].startswith(f"{path}.")]
            space = next(space for space, roots in core.ARGUMENTS.items() if path.partition(".")[0] in roots)
            assert of_struct.setdefault((space, name), rows) == rows
    assert len(of_struct) > 25


ROWS = {"total": impacts, "law kind": laws}
"""Modules that have the names of rows that the core numbers."""


def names_of_rows(name):
    """Names that the core numbers from 0 on."""
    (names,) = (shape for path, kind, shape, _ in core.tables() if (path, kind) == (name, "names"))
    return names.split(", ")


@pytest.mark.parametrize("name", ROWS)
def test_names_of_rows_have_the_same_numbers_on_both_sides(name):
    names = names_of_rows(name)
    assert len(names) > 1
    assert [getattr(ROWS[name], each) for each in names] == list(range(len(names)))


def test_columns_of_tables_have_the_same_order_on_both_sides():
    for name in ("energy", "event", "impact"):
        columns = getattr(impacts, f"{name.upper()}_COLUMNS")
        assert names_of_rows(name) == [f"{name}_{column}".upper() for column in columns]
    kinds = [f"KIND_{kind.upper().replace(' ', '_')}" for kind in impacts.EVENT_KINDS]
    assert names_of_rows("kind of event") == kinds
    cycle = names_of_rows("cycle")
    assert [column.partition("_")[0].lower() for column in cycle] == list(impacts.CYCLE_COLUMNS)
    assert [getattr(impacts, each) for each in cycle[:2]] == [0, 1]
    assert len(names_of_rows("total")) == len(impacts.TOTAL_COLUMNS)


# ---- what is refused -------------------------------------------------------------------------------


class KeptError(Exception):
    """Ends a run at its first call of the core."""


def calls_of_a_run(monkeypatch, module, name, method, count=1, excitation=SINE):
    """Arguments of the first calls of a function of the core that a run makes."""
    kept, function = [], getattr(core, name)

    def keep(*arguments):
        kept.append(arguments)
        if len(kept) == count:
            raise KeptError
        function(*arguments)

    monkeypatch.setattr(module.core, name, keep, raising=False)
    law = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    system, record = reduced(with_ball(REFERENCE, contact=law), 4), fi.Recorder(("tip", "ball"), snapshots=7)
    with pytest.raises(KeptError):
        fi.integrate(system, excitation, method, 1.0, record)
    monkeypatch.undo()
    return kept


def of_events(monkeypatch, count=1, excitation=SINE):
    """The last of so many calls of the event-driven method."""
    return calls_of_a_run(monkeypatch, block, "run_cases", fi.EventDriven(), count, excitation)[-1]


def of_steps(monkeypatch):
    """The first call of a method with steps, which divides those with contact."""
    return calls_of_a_run(monkeypatch, stepping_run, "advance", fi.Newmark(1e-4, refine=4))[-1]


CALLS = {"run_cases": (of_events, ("task", "job", "ledger")), "advance": (of_steps, (None, "block", "fine"))}


@pytest.fixture(params=CALLS)
def function(request):
    """Name of a function of the core that takes arrays."""
    return request.param


@pytest.fixture
def arguments(function, monkeypatch):
    """What a run hands to it first."""
    return CALLS[function][0](monkeypatch)


def places(values, path=()):
    for i, value in enumerate(values):
        if isinstance(value, tuple):
            yield from places(value, (*path, i))
        else:
            yield (*path, i), value


def put(values, path, value):
    """A copy of nested tuples with another value at a place."""
    first, *rest = path
    own = list(values)
    own[first] = put(own[first], rest, value) if rest else value
    return tuple(own)


SPOILT = {
    "another type": lambda a: np.zeros(a.shape, np.float32),
    "one axis more": lambda a: a[None],
    "one item more": lambda a: np.concatenate([a, a[:1]]) if a.shape[0] else np.zeros((1, *a.shape[1:]), a.dtype),
    "strided": lambda a: np.stack([a, a], axis=-1)[..., 0],
    "no array": lambda a: a.tolist(),
    "none": lambda a: None,
    "text": lambda a: "array",
}


FREE = {
    "members", "knots", "kept", "shown", "fields", "forces", "impacts", "sticking", "values", "cycles", "energy",
    "samples", "snapshots", "columns", "factor", "channels", "mass_band", "obstacles", "table", "loss_of_mode",
    "drive_pieces",
}  # fmt: skip
"""Arrays whose first length is their own."""


@pytest.mark.parametrize("how", SPOILT)
def test_every_array_that_is_spoilt_is_refused(function, arguments, how):
    names, count = names_of(arguments), 0
    for path, value in places(arguments):
        if not isinstance(value, np.ndarray):
            continue
        name = names[path]
        spoilt = SPOILT[how](value)
        same = isinstance(spoilt, np.ndarray) and spoilt.flags.c_contiguous and spoilt.dtype == value.dtype
        if same and (how != "one item more" or name in FREE or value.size == 0) and spoilt.ndim == value.ndim:
            # a length that no other array has, or still contiguous: nothing is wrong with it
            continue
        with pytest.raises((TypeError, ValueError)) as refusal:
            getattr(core, function)(*put(arguments, path, spoilt))
        assert "\n" not in str(refusal.value)
        count += 1
    assert count > 50


def names_of(arguments):
    """Name of the field at every place."""

    def walk(values, path=()):
        for i, (value, name) in enumerate(zip(values, values._fields, strict=True)):
            if isinstance(value, tuple):
                yield from walk(value, (*path, i))
            else:
                yield (*path, i), name

    given = [(k, one) for k, one in enumerate(arguments) if isinstance(one, tuple)]
    return {(k, *path): name for k, one in given for path, name in walk(one)}


def test_what_is_only_read_may_be_read_only_and_what_is_written_may_not(function, arguments):
    table = core.tables()
    rows = [
        row for root in CALLS[function][1] for row in table if row[0].partition(".")[0] == root and row[1] != "tuple"
    ]
    given = [(path, value) for path, value in places(arguments) if len(path) > 1]
    refused = 0
    for (path, value), (_, _, _, writable) in zip(given, rows, strict=True):
        if not isinstance(value, np.ndarray):
            continue
        frozen = value.copy()
        frozen.setflags(write=False)
        if writable:
            with pytest.raises(ValueError, match="read-only"):
                getattr(core, function)(*put(arguments, path, frozen))
            refused += 1
    assert refused > 25


@pytest.mark.parametrize("count", [0, 1, 2, 4])
def test_another_number_of_arguments_is_refused(function, arguments, count):
    with pytest.raises(TypeError, match="takes 3 arguments"):
        getattr(core, function)(*[*arguments, *arguments][:count])


def test_a_tuple_too_short_or_too_long_is_refused(function, arguments):
    first, second, last = arguments
    for wrong in (tuple(second)[:-1], (*second, 1.0), [*second]):
        with pytest.raises(TypeError):
            getattr(core, function)(first, wrong, last)


# ---- what must end ---------------------------------------------------------------------------------


def test_a_long_record_goes_on_where_rounding_finds_the_same_sample_again(monkeypatch):
    task, job, _ = of_events(monkeypatch, 2, RECORD)
    # so many samples after the start that the quotient of a sample's time and the interval is less than its number
    interval, number = 0.0077, 2**24 + np.arange(500_000)
    number = int(number[np.floor(number * interval / interval + 1e-9) < number][0])
    start = number * interval
    job.cases.clock[0, 0] = job.grid.start[0] = start
    cases = job.cases._replace(knots=(number + np.arange(9)) * interval)
    none_shown, end = job.snapshots._replace(shown=np.zeros(0, dtype=np.int64)), task.begin + 2
    core.run_cases(task._replace(end=end), job._replace(cases=cases, snapshots=none_shown), None)
    assert task.stopped[0] == core.events.DONE
    assert cases.clock[0, 0] == start + float(end[0]) * job.grid.interval[0]
