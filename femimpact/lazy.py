"""Public names of a package that are loaded from their modules when they are first used; a stub says where each is."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from typing import Any

GONE = {
    "solve_modes": "modes natural_frequencies eigenfrequencies modal_analysis solve_eigen",
    "integrate": "simulate run solve time_history solve_ivp",
    "frequency_sweep": "frequency_response run_sweep",
    "parameter_study": "scan_restitution RestitutionScan",
    "best_case": "optimise optimize minimise minimize",
    "transfer_function": "frf",
    "spectrum": "fft psd",
    "load": "load_results read_results",
    "read_record": "read_csv load_csv",
    "Impactor": "Ball ball ImpactDamper Particle",
    "Dashpot": "Damper",
    "PointMass": "Mass",
    "PointForce": "Force StepForce step_response",
    "Sine": "Shaker Base",
    "Segment": "Tube Rod Plate Section",
    "figures": "plot plots figure draw",
    "figures.energies": "energy energy_balance",
    "figures.phase_portrait": "phase_plot phase_plane",
    "figures.write_movie": "animate animation movie",
    "figures.write_mode": "animate_mode animate_modes",
    "figures.study": "study_lines study_map study_maps study_scatter value_map restitution_scan",
    "figures.convergence": "mesh_convergence step_convergence",
    "convergence.ConvergenceTable": "MeshConvergence StepConvergence ModeConvergence",
    "vtk.to_pyvista": "to_pyvista",
}
"""Names that are gone or looked for, by the path of what takes their place; those that moved are found by the stubs."""

CLOSE = 0.7
"""Likeness of two names, as `difflib` counts it, from which one may be meant by the other."""


def modules_of(init: str) -> dict[str, str]:
    """Module of each public name, from the lines `from MODULE import NAME as NAME` of the stub beside `__init__.py`.

    The module `.` is the package itself: the name is that of one of its modules.
    """
    # without ast, re and pathlib, which an import of the package would wait for
    with open(init.removesuffix("c") + "i", encoding="utf-8") as stub:
        words = [line.split() for line in stub]
    return {row[3]: row[1] for row in words if row[:1] == ["from"]}


def face(package: str, init: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package, whose `__init__.py` is given with its path."""
    module_of = modules_of(init)
    names = sorted(module_of)

    def attribute(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}{_way_on(package, name)}")
        value = _loaded(package, module_of[name], name)
        setattr(sys.modules[package], name, value)
        return value

    return attribute, lambda: sorted(names), names


def _way_on(package: str, name: str) -> str:
    """Words for where a name is that is not in a package, or what is like it; none for names of Python's own."""
    if name.startswith("_"):
        return ""
    import difflib

    root, _, folder = package.partition(".")
    init = str(sys.modules[root].__file__)
    top = modules_of(init)
    paths = {public: public for public in top}
    folders = [each for each, module in top.items() if module == "."]
    # of several places of a name the last counts: figures come first, the package itself last
    for part in sorted(folders, key=lambda each: (each == folder, each != "figures")):
        stub = os.path.join(os.path.dirname(init), part, os.path.basename(init))
        inside = modules_of(stub) if os.path.exists(f"{stub.removesuffix('c')}i") else {}
        paths |= {public: f"{part}.{public}" for public in inside if public not in top}
    paths |= {gone: path for path, names in GONE.items() for gone in names.split()}
    if name in paths:
        elsewhere = folder == "figures" and not paths[name].startswith("figures.")
        pictures = (path for path in paths.values() if path.startswith("figures.") and path.islower())
        return f": it is fi.{paths[name]}" + f"; pictures are {', '.join(dict.fromkeys(pictures))}" * elsewhere
    near = difflib.get_close_matches(name, paths, 1, CLOSE)
    return f"; did you mean fi.{paths[near[0]]}?" if near else ""


def _loaded(package: str, module: str, name: str) -> Any:
    """A public name of a package; of a class, the allowed ranges of its fields stand in its docstring."""
    if module == ".":
        return importlib.import_module(f"{package}.{name}")
    value = getattr(importlib.import_module(module), name)
    if isinstance(value, type):
        importlib.import_module("femimpact.errors").show_ranges(value)
    return value
