"""The stress at a clamped root belongs to the results of a study wherever the section has a height."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from builders import NO_PICTURES, plan_lines, short_study

import femimpact as fi
from femimpact.app.study.prepared import root_stress

MATERIAL = {"young_modulus": 70e9, "density": 2700.0}
SECTION = {"length": 0.23, "area": 2e-5, "second_moment": 1.7e-12, **MATERIAL}
BEAM = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, **MATERIAL)


def test_a_run_of_a_study_has_the_stress_at_the_root(tmp_path: Path) -> None:
    fi.run_study(short_study(2.0, **NO_PICTURES), tmp_path / "results")
    told = fi.load(tmp_path / "results").summary["history"]["channels"]["root.surface_stress"]
    assert told["unit"] == "Pa"
    assert told["largest_of_run"] >= told["largest"] > 0.0


@pytest.mark.parametrize(
    ("beam", "supports", "expected"),
    [
        (BEAM, [fi.Support("clamped", "root")], ("root.surface_stress",)),
        (
            fi.Beam.section(**SECTION),
            [fi.Support("clamped", "root")],
            (),
        ),
        (fi.Beam.section(**SECTION, outer_fibre=6e-4), [fi.Support("clamped", "root")], ("root.surface_stress",)),
        (
            fi.Beam.tube(length=0.23, diameter=6e-3, wall=1e-3, **MATERIAL),
            [fi.Support("clamped", "root")],
            ("root.surface_stress",),
        ),
        (
            BEAM,
            [fi.Support("pinned", "root"), fi.Support("pinned", "tip")],
            (),
        ),
    ],
)
def test_it_needs_a_clamped_root_and_a_known_surface(
    beam: fi.Beam, supports: list[fi.Support], expected: tuple[str]
) -> None:
    structure = fi.Structure(beam, supports=supports)
    system = fi.assemble(structure, elements=4)
    assert root_stress(structure, system) == expected
    assert root_stress(structure, fi.reduce(system, 2)) == expected


@pytest.mark.parametrize("outer_fibre", [None, 6e-4])
def test_where_it_is_left_out_the_check_and_the_results_say_what_it_needs(
    tmp_path: Path, outer_fibre: float | None
) -> None:
    study = short_study(1.0, **NO_PICTURES)
    beam = fi.Beam.section(**SECTION, outer_fibre=outer_fibre)
    study = replace(study, structure=replace(study.structure, beam=beam), sweep=None)
    fi.run_study(study, tmp_path / "results", parts=("simulate",))
    summary = fi.load(tmp_path / "results").summary
    words = "root.surface_stress is left out: it needs outer_fibre (m) of segment 'beam'"
    for texts in (summary["notes"], plan_lines(study)):
        assert any(words in text for text in texts) == (outer_fibre is None)
    assert ("root.surface_stress" in summary["history"]["channels"]) == (outer_fibre is not None)
