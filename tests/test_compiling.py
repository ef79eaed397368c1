"""Compiled code is never older than a source that was compiled into it."""

from __future__ import annotations

from pathlib import Path

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
