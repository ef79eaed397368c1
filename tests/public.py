"""Every public name: those of `femimpact`, and those of its folders."""

from __future__ import annotations

from types import ModuleType

import femimpact as fi

FOLDERS = [name for name in fi.__all__ if isinstance(getattr(fi, name), ModuleType)]
"""Folders of public names, pictures and files for ParaView among them."""

PATHS = {name: name for name in fi.__all__ if name not in (*FOLDERS, "__version__")} | {
    name: f"{folder}.{name}"
    for folder in FOLDERS
    if folder not in ("figures", "vtk")
    for name in getattr(fi, folder).__all__
}
"""Path below `femimpact` of each name but those of figures and `vtk`."""


def public(name: str) -> object:
    """The public thing of this name, wherever it stands."""
    folder, _, last = PATHS[name].rpartition(".")
    return getattr(getattr(fi, folder) if folder else fi, last)
