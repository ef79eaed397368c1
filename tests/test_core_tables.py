"""Arrays that Python hands to the core: names, types and shapes are the same on both sides, wrong ones are refused."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact import core
from femimpact.contact import formulas
from femimpact.integrators.event_driven import block, loop_data
from femimpact.response import columns

TYPES = {
    "Array": "float64", "Complex": "complex128", "Indices": "int64", "NDArray[np.bool_]": "bool",
    "int": "int", "float": "float", "bool": "bool number",
}  # fmt: skip

SINE = fi.Sine(1e-4, 5.0)

HANDED = {"task": loop_data.Task, "job": loop_data.Job, "ledger": loop_data.Ledger}


def fields_of(noun, prefix):
    """Names, types and number of axes of a named tuple and those within it, as its source says them."""
    tree = ast.parse(inspect.getsource(inspect.getmodule(noun)))
    lines = inspect.getsource(inspect.getmodule(noun)).splitlines()
    body = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == noun.__name__).body
    for item in body:
        if not isinstance(item, ast.AnnAssign):
            continue
        name, kind = f"{prefix}.{item.target.id}", ast.unparse(item.annotation)
        inner = getattr(loop_data, kind, None)
        if inspect.isclass(inner) and issubclass(inner, tuple):
            yield from fields_of(inner, name)
            continue
        shape = re.search(r"# \(([^)]*)\)", lines[item.lineno - 1])
        axes = len([axis for axis in shape[1].split(",") if axis.strip()]) if shape else 0
        yield name, TYPES[kind], axes


def rows_of(name):
    """The same of the core."""
    for path, kind, shape, _ in core.tables():
        if path.partition(".")[0] == name:
            yield path, "bool number" if kind == "bool" and not shape else kind, len(shape.split())


@pytest.mark.parametrize("name", HANDED)
def test_names_types_and_axes_are_those_of_the_core(name):
    assert list(fields_of(HANDED[name], name)) == list(rows_of(name))


def test_rows_of_tables_have_the_same_order_on_both_sides():
    text = (Path(fi.__file__).parent / "core" / "event_driven" / "loop_data.hpp").read_text(encoding="utf-8")
    for names in (
        "ENTERED, ENTERING, STARTED, RESUMED, STARTING",
        "BEGUN, TOUCH_SPEED, PUSHED, LARGEST_FORCE, LASTED, LOST",
    ):
        assert names in text
        assert [getattr(loop_data, name) for name in names.split(", ")] == list(range(len(names.split(", "))))
    totals = re.search(r"enum : Index \{ (COUNT, [A-Z_, ]+) \}", text)[1].split(", ")
    assert [getattr(columns, name) for name in totals] == list(range(6))


# ---- what is refused -------------------------------------------------------------------------------


def calls_of_a_run(monkeypatch, count, excitation=SINE):
    """Arguments of the first calls that a run makes."""
    kept, run_cases = [], core.run_cases

    class KeptError(Exception):
        pass

    def keep(*arguments):
        kept.append(arguments)
        if len(kept) == count:
            raise KeptError
        run_cases(*arguments)

    monkeypatch.setattr(block.core, "run_cases", keep, raising=False)
    system = reduced(with_ball(REFERENCE, contact=fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)), 4)
    record = fi.Recorder(("tip", "ball"), snapshots=7)
    with pytest.raises(KeptError):
        fi.integrate(system, excitation, fi.EventDriven(), 1.0, record)
    monkeypatch.undo()
    return kept


@pytest.fixture
def call(monkeypatch):
    """Arguments of the first call that a run makes."""
    return calls_of_a_run(monkeypatch, 1)[0]


@pytest.fixture
def second_call(monkeypatch):
    """Arguments of the second one, when a closed form has been made."""
    return calls_of_a_run(monkeypatch, 2)[1]


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
    "samples",
}  # fmt: skip
"""Arrays whose first length is their own."""


@pytest.mark.parametrize("how", SPOILT)
def test_every_array_that_is_spoilt_is_refused(call, how):
    names, count = names_of(call), 0
    for path, value in places(call):
        if not isinstance(value, np.ndarray):
            continue
        name = names[path]
        spoilt = SPOILT[how](value)
        same = isinstance(spoilt, np.ndarray) and spoilt.flags.c_contiguous and spoilt.dtype == value.dtype
        if same and (how != "one item more" or name in FREE or value.size == 0) and spoilt.ndim == value.ndim:
            # a length of its own, or still contiguous: nothing is wrong with it
            continue
        with pytest.raises((TypeError, ValueError)) as refusal:
            core.run_cases(*put(call, path, spoilt))
        assert "\n" not in str(refusal.value)
        count += 1
    assert count > 90


def names_of(call):
    """Name of the field at every place."""

    def walk(values, path=()):
        for i, (value, name) in enumerate(zip(values, values._fields, strict=True)):
            if isinstance(value, tuple):
                yield from walk(value, (*path, i))
            else:
                yield (*path, i), name

    return {(k, *path): name for k, one in enumerate(call) if one is not None for path, name in walk(one)}


def test_what_is_only_read_may_be_read_only_and_what_is_written_may_not(call):
    writable = [row[3] for row in core.tables()]
    names = [row[0] for row in core.tables()]
    order = [*(n for n in names if n.startswith("task.")), *(n for n in names if n.startswith("job."))]
    order += [n for n in names if n.startswith("ledger.")]
    flags = dict(zip(names, writable, strict=True))
    refused = 0
    for (path, value), name in zip(places(call), order, strict=True):
        if not isinstance(value, np.ndarray):
            continue
        frozen = value.copy()
        frozen.setflags(write=False)
        if flags[name]:
            with pytest.raises(ValueError, match="read-only"):
                core.run_cases(*put(call, path, frozen))
            refused += 1
    assert refused > 50


@pytest.mark.parametrize("count", [0, 1, 2, 4])
def test_another_number_of_arguments_is_refused(call, count):
    with pytest.raises(TypeError, match="takes 3 arguments"):
        core.run_cases(*[*call, *call][:count])


def test_a_tuple_too_short_or_too_long_is_refused(call):
    task, job, ledger = call
    for wrong in (tuple(job)[:-1], (*job, 1.0), [*job]):
        with pytest.raises(TypeError):
            core.run_cases(task, wrong, ledger)


def test_numbers_of_cases_and_rows_stay_within_their_arrays(call):
    task, job, ledger = call
    for members in ([1], [-1]):
        with pytest.raises(ValueError, match="members"):
            core.run_cases(task._replace(members=np.array(members)), job, ledger)
    for per_cycle in (0.0, np.nan, 1e9):
        with pytest.raises(ValueError, match="per_cycle"):
            core.run_cases(task, job._replace(grid=job.grid._replace(per_cycle=per_cycle)), ledger)
    for name, value in (("interval", 0.0), ("interval", np.nan), ("cycle", -1)):
        wrong = np.full_like(getattr(job.grid, name), value)
        with pytest.raises(ValueError, match=rf"grid\.{name}"):
            core.run_cases(task, job._replace(grid=job.grid._replace(**{name: wrong})), ledger)
    for name, value in (("hit", 7.0), ("hit", np.nan), ("entering", 99), ("form", 99)):
        wrong = np.full_like(getattr(job.cases, name), value)
        with pytest.raises(ValueError, match=rf"cases\.{name}"):
            core.run_cases(task, job._replace(cases=job.cases._replace(**{name: wrong})), ledger)
    with pytest.raises(ValueError, match="made"):
        core.run_cases(task, job._replace(forms=job.forms._replace(made=99)), ledger)


FAR = 2**63 - 1


@pytest.mark.parametrize(
    ("group", "name", "value"),
    [
        ("task", "begin", FAR), ("task", "most", np.nan), ("task", "most", np.inf),
        ("cases", "omega", np.inf), ("cases", "omega", -1.0), ("cases", "clock", np.nan), ("cases", "clock", 1e9),
        ("cases", "hit", 0.5), ("cases", "sample", FAR), ("cases", "events", FAR),
        ("grid", "start", np.nan), ("grid", "start", 1e30), ("grid", "origin", FAR),
        ("tables", "number", -1), ("tables", "number", FAR),
    ],
)  # fmt: skip
def test_times_and_counts_that_lead_nowhere_are_refused(call, group, name, value):
    task, job, ledger = call
    array = getattr(task if group == "task" else getattr(job, group), name)
    spoilt = {name: np.full_like(array, value)}
    if group == "task":
        task = task._replace(**spoilt)
    else:
        job = job._replace(**{group: getattr(job, group)._replace(**spoilt)})
    # beside a start so far the interval is rounding
    named = "interval" if value == 1e30 else name
    with pytest.raises(ValueError, match=rf"{group}\.{named}[,:] "):
        core.run_cases(task, job, ledger)


@pytest.mark.parametrize(
    ("name", "place", "value"),
    [
        ("following", 0, 0), ("following", 0, FAR), ("number", 0, -1), ("entries", 0, FAR), ("rigid_bodies", 0, -1),
        ("blocks", (0, 0), (FAR, FAR)), ("first", (0, 0), -1), ("first", (0, -1), FAR), ("first", (0, 1), FAR),
        ("members", (0, 0), -1), ("members", (0, 0), FAR), ("exponent", (0, 0), np.inf), ("size", (0, 0), np.nan),
    ],
)  # fmt: skip
def test_closed_forms_that_lead_outside_their_arrays_are_refused(second_call, name, place, value):
    task, job, ledger = second_call
    assert job.forms.made > 0
    spoilt = getattr(job.forms, name).copy()
    spoilt[place] = value
    with pytest.raises(ValueError, match=rf"^forms\..*{name}"):
        core.run_cases(task, job._replace(forms=job.forms._replace(**{name: spoilt})), ledger)


def test_cycles_need_an_output_and_have_begun(call):
    task, job, ledger = call
    grid = job.grid._replace(cycles=np.zeros((1, 9, 8)), cycle=np.full(1, 5))
    with pytest.raises(ValueError, match=r"^grid\.cycle: .* begun"):
        core.run_cases(task, job._replace(grid=grid), ledger)


def test_what_is_written_shares_no_memory_with_another_array(call):
    task, job, ledger = call
    with pytest.raises(ValueError, match=r"^task\.\w+, task\.\w+: must not share memory"):
        core.run_cases(task._replace(begin=task.stopped), job, ledger)
    memory = np.zeros(3, dtype=np.int64)
    for own, other in ((memory[:2], memory[1:]), (memory[1:], memory[:2])):
        cases = job.cases._replace(events=own[None], form=other[None])
        with pytest.raises(ValueError, match=r"^cases\.\w+, cases\.\w+: must not share memory"):
            core.run_cases(task, job._replace(cases=cases), ledger)


def test_what_is_only_read_may_share_memory(call):
    task, job, ledger = call
    core.run_cases(task._replace(members=task.members[:0]), job, ledger._replace(load=ledger.given))


# ---- what must end ---------------------------------------------------------------------------------


def test_a_long_record_goes_on_where_rounding_finds_the_same_sample_again(monkeypatch):
    base = fi.RecordedBase(np.linspace(-1.0, 1.0, 9), 0.1)
    task, job, _ = calls_of_a_run(monkeypatch, 2, base)[1]
    # so many samples after the start that the quotient of a sample's time and the interval is less than its number
    interval, number = 0.0077, 2**24 + np.arange(500_000)
    number = int(number[np.floor(number * interval / interval + 1e-9) < number][0])
    start = number * interval
    job.cases.clock[0, 0] = job.grid.start[0] = start
    cases = job.cases._replace(knots=np.zeros(number + 9), knot_interval=interval)
    none_shown, end = job.snapshots._replace(shown=np.zeros(0, dtype=np.int64)), task.begin + 2
    core.run_cases(task._replace(end=end), job._replace(cases=cases, snapshots=none_shown), None)
    assert task.stopped[0] == loop_data.DONE
    assert cases.clock[0, 0] == start + float(end[0]) * job.grid.interval[0]


# ---- formulas that stand on both sides until stepping is in the core ---------------------------------


def test_contact_formulas_are_those_of_python_bit_for_bit():
    rng = np.random.default_rng(5)
    for depth, rate, stiffness, damping in rng.normal(size=(2000, 4)) * 10.0 ** rng.uniform(-9, 9, (2000, 4)):
        force = core.kelvin_voigt_force(depth, rate, stiffness, damping)
        assert force == formulas.kelvin_voigt_force(depth, rate, stiffness, damping)
        assert core.spring_potential(depth, stiffness) == formulas.spring_potential(depth, stiffness)
