"""Run the scripts of README and of how-to pages and keep the pictures that they write: `make_pictures.py [NAME ...]`.

A page is run in an empty directory, with the files that it asks its reader to save. A page without a whole script shows
the picture of an example, which is run instead.
"""

from __future__ import annotations

import contextlib
import re
import runpy
import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PAGES = (
    "README",
    "axial_load",
    "balls_that_meet",
    "calibration",
    "course",
    "measured_base",
    "own_mesh",
    "parameter_studies",
    "root_stress",
    "two_balls",
    "which_ball",
)
EXAMPLES = ("absorber_or_ball", "design_map")
"""Whose pictures pages show."""
MESHES = {f"beam_{n}.msh": ROOT / "meshes" / f"graded_{n}.msh" for n in (6, 12, 24, 48)}
"""What gmsh makes of the geometry on the page on meshes."""


def page_of(name: str) -> Path:
    """README, or the how-to page of a name."""
    return ROOT / "README.md" if name == "README" else ROOT / "docs" / "howto" / f"{name}.md"


def blocks(page: Path, language: str) -> list[str]:
    """Text of the code blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def prepare(page: Path, folder: Path) -> None:
    """Save in a folder what the reader of a page has to save before the script runs."""
    if page.stem == "axial_load":
        (folder / "blade.toml").write_text(blocks(page, "toml")[0], encoding="utf-8")
    if page.stem == "own_mesh":
        (folder / "beam.toml").write_text(blocks(page, "toml")[0], encoding="utf-8")
        for name, source in MESHES.items():
            shutil.copyfile(source, folder / name)


def ran(*pages: Path, names: Mapping[str, Any] = MappingProxyType({})) -> dict[str, Any]:
    """Names that the Python of pages leaves, their blocks run one after another in the current directory.

    Before the first block there are the names of a script from which the pages go on.
    """
    names = dict(names)
    for page in pages:
        exec(compile("\n".join(blocks(page, "python")), str(page), "exec"), names)
    return names


def main(names: tuple[str, ...] = (*PAGES, *EXAMPLES), folder: Path = HERE) -> list[Path]:
    """Write the pictures of pages and examples into a folder; their paths."""
    import matplotlib
    from PIL import Image

    matplotlib.use("agg")
    made = []
    for name in names:
        with tempfile.TemporaryDirectory() as directory, contextlib.chdir(directory):
            if name in EXAMPLES:
                runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
            else:
                prepare(page_of(name), Path(directory))
                ran(page_of(name))
            for picture in sorted(Path(directory).glob("*.png")):
                made.append(folder / picture.name)
                with Image.open(picture) as whole:
                    # a palette takes less than half of the bytes
                    whole.convert("RGB").quantize(256).save(made[-1], optimize=True)
    return made


if __name__ == "__main__":
    for path in main(tuple(sys.argv[1:]) or (*PAGES, *EXAMPLES)):
        print(path)
