"""Compiled code is never older than a source that was compiled into it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numba import njit

from femimpact.contact import formulas
from femimpact.integrators.kernels import compiling, loop, touch


def test_every_kernel_is_stale_when_any_of_its_sources_changes(tmp_path, monkeypatch):
    copy = tmp_path / "formulas.py"
    copy.write_bytes(Path(formulas.__file__).read_bytes() + b"\n")
    monkeypatch.setattr(formulas, "__file__", str(copy))
    assert compiling._stamp() != compiling.STAMP


def test_numba_keeps_that_stamp_with_what_it_compiled():
    # the loop inlines formulas of formulas.py: its own file alone must not decide
    for dispatcher in (loop.advance, touch.collide):
        assert dispatcher._cache._cache_file._source_stamp == compiling.STAMP


def test_inner_functions_become_machine_code_in_their_caller_alone():
    twice = compiling.inlined(lambda x: 2.0 * x)
    square = compiling.apart(_square)

    @njit
    def outer(x):
        return square(twice(x))

    assert outer(3.0) == 36.0
    for inner in (twice, square):
        (part,) = inner.overloads.values()
        assert isinstance(part.library, compiling._Part)
    (machine_code,) = outer.inspect_asm().values()
    functions = [line for line in machine_code.splitlines() if re.fullmatch(r"_ZN\w*:", line)]
    assert sum("_square" in line for line in functions) == 1
    assert not any("lambda" in line for line in functions)


def _square(x):
    return x * x


def test_an_index_written_as_zero_needs_no_code_of_its_own():
    inner = compiling.called(lambda values, i: values[i])

    @njit
    def outer(values):
        total = inner(values, compiling.ZERO)
        for i in range(values.size):
            total += inner(values, i)
        return total

    assert outer(np.array([1.0, 2.0])) == 4.0
    assert len(inner.overloads) == 1
