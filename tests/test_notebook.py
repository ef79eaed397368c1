"""In a notebook every figure appears: those of femimpact, and a user's after them."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

EXECUTE = """
import json, sys
import nbformat
from nbclient import NotebookClient

notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in json.load(sys.stdin)])
NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
print(json.dumps([[sorted(output.get("data", ())) for output in cell.outputs] for cell in notebook.cells]))
"""

FIRST = """
import femimpact as fi
beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=0.001, young_modulus=70e9, density=2700.0)
structure = fi.Structure(beam)
system = fi.assemble(structure, elements=4)
modes = fi.solve_modes(system, 3)
"""

FIGURES = {
    "one panel": "drawn = fi.figures.mode_shapes(system, modes)",
    "of a mesh": "drawn = fi.figures.beam_mesh(fi.uniform_mesh(structure, 4), structure)",
    "in a style": "drawn = fi.figures.mode_shapes(system, modes, structure=structure)",
    "own": "import matplotlib.pyplot as plt\nlines = plt.plot([0, 1], [1, 0])",
}
"""Cells that draw one figure each; none of them ends with a value that is shown."""


def _outputs(cells, folder):
    """Kinds of data of every output of every cell, executed by a kernel in a separate process."""
    # what the kernel sets itself where it is not set, as it is not for a user
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    environment |= {name: str(folder) for name in ("HOME", "IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "MPLCONFIGDIR")}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", EXECUTE], input=json.dumps(cells), env=environment, capture_output=True,
        text=True, timeout=240, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_three_figures_and_a_plot_of_ones_own_are_all_shown(tmp_path):
    first, *drawn = _outputs([FIRST, *FIGURES.values()], tmp_path)
    assert first == []
    shown = {name: ["image/png" in kinds for kinds in outputs] for name, outputs in zip(FIGURES, drawn, strict=True)}
    assert shown == {name: [True] for name in FIGURES}


def test_progress_is_one_output_of_a_cell(tmp_path):
    pytest.importorskip("ipywidgets")
    run = "run = fi.integrate(system, fi.Sine(1e-4, 9.0), fi.Newmark(1e-4), 0.5, progress=True)"
    assert len(_outputs([FIRST, run], tmp_path)[1]) == 1
