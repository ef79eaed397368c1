"""What `--perturb-modes` does: last bits change, alike for alike input, in every test file that runs impacts."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import LAST_BITS, perturbed

import femimpact as fi
import femimpact.system.modes
from femimpact.system import reduction

APART = {
    "test_cli.py": "runs commands in separate processes",
    "test_core_tables.py": "what is handed to the core, and refused there",
    "test_linear_response.py": "the structure without balls",
    "test_paraview.py": "a program apart, asked for by hand",
    "test_prepared.py": "how often what is made, and texts of studies",
    "test_promised_names.py": "names alone",
    "test_table.py": "columns of short runs",
    "test_regimes.py": "tables of impacts made by hand",
    "test_pictures.py": "one short run, and what is drawn of it",
    "test_replace.py": "looks at fields of one short run",
    "test_result_directory.py": "files, not motions",
}
"""Test files that speak of impacts and are not marked, with the reason."""


def test_only_the_last_bits_change_and_always_in_the_same_way(system):
    modes = fi.solve_modes(system, 6)
    once, again, other = (perturbed(modes, system, seed) for seed in (1, 1, 2))
    for name in ("natural_frequency", "damping_ratio", "vectors"):
        exact, changed = getattr(modes, name), getattr(once, name)
        np.testing.assert_array_equal(changed, getattr(again, name))
        assert np.any(changed != exact)
        assert np.any(changed != getattr(other, name))
        # the factor and the product are rounded once each
        np.testing.assert_allclose(changed, exact, rtol=LAST_BITS + 2 * np.finfo(float).eps, atol=0)
    np.testing.assert_array_equal(once.participation_factor, once.vectors.T @ system.base_load)


@pytest.mark.impacts
def test_with_the_option_every_module_solves_for_perturbed_modes(system, request):
    modes = fi.solve_modes(system, 4)
    assert reduction.lowest_modes is femimpact.system.modes.lowest_modes
    asked = request.config.getoption("--perturb-modes") is not None
    assert (reduction.lowest_modes.__module__ != "femimpact.system.modes") == asked
    np.testing.assert_array_equal(fi.reduce(system, 4).K.diagonal(), (2 * np.pi * modes.natural_frequency) ** 2)


def test_every_file_that_runs_impacts_is_marked():
    for path in sorted(Path(__file__).parent.glob("test_*.py")):
        source = path.read_text(encoding="utf-8")
        runs = re.search(r"\.impacts\b|impacts_per_cycle|\.contact_loss|task_of_demo", source)
        if runs and path.name not in (*APART, Path(__file__).name):
            assert "pytest.mark.impacts" in source, path.name
