"""Numbers of a noun are Python's float and int, so that compiled code meets one type of each argument and no other."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from nouns import NOUNS, STRUCTURE

import femimpact as fi

KINDS = {"whole": int, "single precision": np.float32, "double precision": np.float64, "of numpy": np.int64}


def same_in(kind: type, value: object) -> object:
    """A number, or each of a tuple, as another type where that is the same number."""
    if isinstance(value, tuple):
        return [same_in(kind, entry) for entry in value]
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return kind(value) if number and np.isfinite(value) and float(kind(value)) == value else value


def scalars(value: object) -> list[object]:
    return [entry for part in value for entry in scalars(part)] if isinstance(value, tuple) else [value]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NOUNS)
def test_fields_keep_one_type_whatever_type_a_number_comes_in(name, kind):
    noun = NOUNS[name]()
    for item in fields(noun):
        value = getattr(noun, item.name)
        if not scalars(value) or not all(type(part) in (int, float) for part in scalars(value)):
            continue
        changed = getattr(replace(noun, **{item.name: same_in(KINDS[kind], value)}), item.name)
        assert changed == value or value != value
        assert [type(part) for part in scalars(changed)] == [type(part) for part in scalars(value)]


@pytest.mark.parametrize(
    ("made", "exact"),
    [
        (lambda: fi.EventDriven(closure=1, samples_per_cycle=64.0).closure, float),
        (lambda: fi.EventDriven(closure=1, samples_per_cycle=64.0).samples_per_cycle, int),
        (lambda: fi.Sine(1, np.float32(5)).amplitude, float),
        (lambda: fi.Sine(1, np.float32(5)).frequency, float),
        (lambda: fi.Newmark(np.float64(1e-4), refine=np.int64(2)).refine, int),
        (lambda: fi.Recorder(every=8.0).every, int),
        (lambda: fi.Impactor("b", 0, 1, np.array([1, 2]), fi.Rigid(1)).gap[0], float),
        (lambda: fi.Impactor("b", 0, 1, np.array([1, 2]), fi.Rigid(1)).at, float),
        (lambda: fi.Stop("b", 0, 1, fi.Rigid(1)).gap, float),
        (lambda: fi.Rayleigh(0, modes=[1.0, np.int64(2)]).modes[0], int),
        (lambda: fi.Newmark(1e-4, allow_coarse_step=np.True_).allow_coarse_step, bool),
        (lambda: fi.Segment(1, 1, 1, 1, 1).length, float),
    ],
)
def test_a_whole_number_is_a_float_where_a_float_is_meant(made, exact):
    assert type(made()) is exact


def runs(number, whole):
    """A run by each kind of method and a sweep, with the numbers in given types."""
    rigid = replace(STRUCTURE.impactors[0], contact=fi.Rigid(number(0.5)), gap=(number(1) / 1024, number(1) / 512))
    bodies = [STRUCTURE.impactors[0], rigid]
    for body in bodies:
        system = fi.reduce(fi.assemble(replace(STRUCTURE, impactors=[body], stops=()), elements=whole(4)), whole(2))
        base = fi.Sine(number(1) / 512, number(6), number(0))
        compliant = body.contact is STRUCTURE.impactors[0].contact
        stepping = fi.Newmark(1 / 8192) if compliant else fi.MoreauJean(1 / 8192)
        keep = fi.Recorder(every=whole(4))
        for method in (fi.EventDriven(closure=number(1) / 2**30, samples_per_cycle=whole(64)), stepping):
            yield fi.integrate(system, base, method, number(1), keep)["tip"]
        yield fi.frequency_sweep(system, number(1) / 512, [number(6)], fi.EventDriven(), whole(6), ledger=False).peak


def test_runs_are_the_same_whatever_the_types_of_their_numbers():
    first = list(runs(float, int))
    for number, whole in ((np.float32, np.int64), (lambda x: int(x) if float(x).is_integer() else x, float)):
        again = list(runs(number, whole))
        for one, other in zip(first, again, strict=True):
            # the numbers are powers of two or small: the same in every type, so that the runs are the same
            np.testing.assert_array_equal(one, other)
