"""Make the meshes of this folder again with gmsh: `python meshes/make_meshes.py`, after `pip install -e ".[mesh]"`.

Each file is a beam along x, from the root to the tip. Tagged points are named places, tagged lines are the regions
that a study's segments fill. `FAMILIES` says what is where; a family is one geometry at several numbers of elements.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Stretch:
    """A stretch of a beam between two named points.

    Parameters
    ----------
    region : str
    end : float, m
        Where it ends; it begins where the one before does.
    point : str
        Name of the point at its end.
    elements : int
    ratio : float, 1
        Length of its last element over that of its first, which grow geometrically.
    """

    region: str
    end: float
    point: str
    elements: int
    ratio: float = 1.0


def uniform(elements: int) -> list[Stretch]:
    """The beam of the reference study in equal elements, with an accelerometer's place a third from the tip."""
    third = elements // 3
    length = 0.23026615
    return [
        Stretch("beam", 2.0 * length / 3.0, "sensor", elements - third),
        Stretch("beam", length, "tip", third),
    ]


def graded(elements: int) -> list[Stretch]:
    """A stepped cantilever, finer towards its clamped root, where the stress is."""
    thick = elements // 2
    return [
        Stretch("thick", 0.10, "joint", thick, ratio=4.0),
        Stretch("thin", 0.25, "tip", elements - thick, ratio=2.0),
    ]


def stepped(elements: int) -> list[Stretch]:
    """The same cantilever in equal elements."""
    thick = 2 * elements // 5
    return [Stretch("thick", 0.10, "joint", thick), Stretch("thin", 0.25, "tip", elements - thick)]


FAMILIES = {
    "uniform": (uniform, (6, 12, 24, 48)),
    "graded": (graded, (6, 12, 24, 48)),
    "stepped": (stepped, (5, 10, 20, 40)),
}


def write(path: Path, stretches: Iterable[Stretch]) -> None:
    """One beam as a file of Gmsh 4.1."""
    try:
        import gmsh
    except ImportError as error:
        sys.exit(f"make_meshes: gmsh cannot be loaded ({error}): pip install -e '.[mesh]'")

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add(path.stem)
        begin = gmsh.model.geo.addPoint(0.0, 0.0, 0.0)
        points, lines = {"root": begin}, {}
        for stretch in stretches:
            end = gmsh.model.geo.addPoint(stretch.end, 0.0, 0.0)
            line = gmsh.model.geo.addLine(begin, end)
            # gmsh takes the ratio of two neighbours
            step = stretch.ratio ** (1.0 / (stretch.elements - 1)) if stretch.elements > 1 else 1.0
            gmsh.model.geo.mesh.setTransfiniteCurve(line, stretch.elements + 1, "Progression", step)
            points[stretch.point], begin = end, end
            lines.setdefault(stretch.region, []).append(line)
        gmsh.model.geo.synchronize()
        for name, tag in points.items():
            gmsh.model.addPhysicalGroup(0, [tag], name=name)
        for name, tags in lines.items():
            gmsh.model.addPhysicalGroup(1, tags, name=name)
        gmsh.model.mesh.generate(1)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def main(folder: Path = HERE) -> list[Path]:
    """Write all families into a folder; the paths of the files."""
    paths = []
    for name, (make, counts) in FAMILIES.items():
        for elements in counts:
            paths.append(folder / f"{name}_{elements}.msh")
            write(paths[-1], make(elements))
    return paths


if __name__ == "__main__":
    for path in main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE):
        print(path)
