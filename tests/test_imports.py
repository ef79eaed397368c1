"""`import femimpact` and `femimpact --help` cost nothing: the heavy libraries stay away."""

from __future__ import annotations

import pickle
import subprocess
import sys

import pytest
from public import PATHS, public

import femimpact

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


def test_a_name_of_a_folder_is_imported_from_it():
    from femimpact.contact import Flores

    assert Flores is femimpact.contact.Flores
    assert pickle.loads(pickle.dumps(Flores(1e7, 0.7))) == Flores(1e7, 0.7)
