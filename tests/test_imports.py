"""`import femimpact` and `femimpact --help` cost nothing: the heavy libraries stay away."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from operator import attrgetter
from pathlib import Path

import pytest
from public import PATHS, public

import femimpact
from femimpact.lazy import GONE

SOUGHT = {
    "modes": "fi.solve_modes", "simulate": "fi.integrate", "write_movie": "fi.figures.write_movie",
    "to_pyvista": "fi.vtk.to_pyvista", "amplitude_spectrum": "fi.signals.amplitude_spectrum",
    "scan_restitution": "fi.parameter_study", "RestitutionScan": "fi.parameter_study",
    "plot": "fi.figures", "natural_frequencies": "fi.solve_modes", "run": "fi.integrate", "Ball": "fi.Impactor",
    "animate": "fi.figures.write_movie", "energies": "fi.figures.energies", "Force": "fi.PointForce",
}  # fmt: skip
"""Names that are looked for below the package, and what they are."""

HEAVY = ("pyvista", "vtk", "vtkmodules", "matplotlib", "meshio", "skfem", "numba", "xarray", "pandas", "scipy.signal")


@pytest.mark.parametrize("statement", ["import femimpact", "import sys; sys.argv = ['femimpact', '--help']; HELP"])
def test_light_start_loads_no_heavy_library(statement):
    # a separate process: this one has loaded everything already
    code = statement.replace(
        "HELP", "import femimpact.cli\ntry:\n    femimpact.cli.main()\nexcept SystemExit:\n    pass"
    )
    code += f"\nimport sys\nprint('LOADED', [name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("LOADED []"), done.stdout[-300:]


def test_every_public_name_can_be_loaded():
    for name in femimpact.__all__:
        assert getattr(femimpact, name) is not None
    for name in PATHS:
        assert public(name) is not None


def test_an_unknown_public_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Bean'"):
        _ = femimpact.Bean
    with pytest.raises(AttributeError, match=r"'femimpact\.contact' has no attribute 'Bean'"):
        _ = femimpact.contact.Bean


def moved_names():
    """Names and paths of the rows of the page's table of moved names."""
    page = (Path(__file__).parents[1] / "docs" / "development" / "changelog.md").read_text(encoding="utf-8")
    for was, to in re.findall(r"^ *\| (`fi\..*) \| `(fi\..*?)`.* \|$", page, re.MULTILINE):
        for name in re.findall(r"`fi\.(\w+)`", was):
            yield name, f"{to}{name}" if to.endswith(".") else to


def test_a_name_that_moved_says_where_it_is_and_one_that_is_like_another_which():
    moved = {name: f"fi.{path}" for name, path in PATHS.items() if "." in path}
    assert dict(moved_names()).items() <= (moved | SOUGHT).items()
    for name, path in (moved | SOUGHT).items():
        with pytest.raises(AttributeError, match=rf"no attribute '{name}': it is {re.escape(path)}$"):
            getattr(femimpact, name)
    for path, names in GONE.items():
        assert attrgetter(path)(femimpact) is not None
        assert not {*names.split()} & {*femimpact.__all__, *femimpact.figures.__all__}
    with pytest.raises(AttributeError, match=r"'study_lines': it is fi\.figures\.study$"):
        _ = femimpact.figures.study_lines
    with pytest.raises(AttributeError, match=r"'assembel'; did you mean fi\.assemble\?$"):
        _ = femimpact.assembel
    # of nothing like it nothing is said, and libraries ask for names of their own
    for name in ("xyzzy", "_repr_html_", "Newton", "step"):
        with pytest.raises(AttributeError, match=f"no attribute '{name}'$"):
            getattr(femimpact.contact, name)


def test_a_name_of_a_folder_is_imported_from_it():
    from femimpact.contact import Flores

    assert Flores is femimpact.contact.Flores
    assert pickle.loads(pickle.dumps(Flores(1e7, 0.7))) == Flores(1e7, 0.7)
