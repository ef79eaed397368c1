"""The stress at a clamped root belongs to the results of a study wherever the section has a height."""

from __future__ import annotations

from pathlib import Path

import pytest
from builders import NO_PICTURES, short_study

import femimpact as fi
from femimpact.study.prepared import root_stress

MATERIAL = {"young_modulus": 70e9, "density": 2700.0}
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
            fi.Beam((fi.Segment(length=0.23, area=2e-5, second_moment=1.7e-12, **MATERIAL),)),
            [fi.Support("clamped", "root")],
            (),
        ),
        (
            BEAM,
            [fi.Support("pinned", "root"), fi.Support("pinned", "tip")],
            (),
        ),
    ],
)
def test_it_needs_a_clamped_root_and_a_height(beam: fi.Beam, supports: list[fi.Support], expected: tuple[str]) -> None:
    structure = fi.Structure(beam, supports=supports)
    system = fi.assemble(structure, elements=4)
    assert root_stress(structure, system) == expected
    assert root_stress(structure, fi.reduce(system, 2)) == expected
