"""Figure of a mesh: its elements in the sections of the beam, its regions and its named points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.errors import require_type
from femimpact.export.figures.look import COLOURS, GREY, OffScreen, panel
from femimpact.fem.discretisation import discretise
from femimpact.fem.mesh import Mesh
from femimpact.structure.structure import Structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["beam_mesh"]

MOST_NODES = 400
"""Up to which each node is drawn."""


def beam_mesh(mesh: Mesh, structure: Structure | None = None, ax: Axes | OffScreen | None = None) -> Axes:
    """The elements of a mesh as the beam's side view, coloured by region, with its named points.

    Parameters
    ----------
    mesh : Mesh
    structure : Structure, optional
        Gives the thickness along every element, checked against the mesh; all are drawn equally thick without it.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If an argument is of the wrong kind, or the structure does not fit the mesh.
    """
    require_type(mesh, Mesh, "mesh")
    # of each element at its two ends
    half = np.full((mesh.elements, 2), 0.5)
    if structure is not None:
        sections = discretise(structure, mesh=mesh).sections
        half = 1e3 * sections.half_height_at(np.arange(mesh.elements)[:, None], np.array([0.0, 1.0]))
    axis = panel(ax, 9.0, 3.2)
    x, tallest = 1e3 * mesh.nodes, float(half.max())
    ends = np.repeat(x, 2)[1:-1]
    axis.fill_between(ends, half.ravel(), -half.ravel(), color="#dddddd", linewidth=0.0)
    for colour, (name, members) in zip(COLOURS * 20, mesh.regions.items(), strict=False):
        inside = np.isin(np.arange(mesh.elements), members)
        # outside the region the fill has no height
        filled = np.where(inside[:, None], half, 0.0).ravel()
        axis.fill_between(ends, filled, -filled, color=colour, alpha=0.45, linewidth=0.0)
        axis.plot([], [], color=colour, linewidth=6.0, alpha=0.45, label=f"{name}: {members.size} elements")
    if mesh.nodes.size <= MOST_NODES:
        beside = np.maximum(np.append(half[:, 0], 0.0), np.append(0.0, half[:, 1]))
        axis.vlines(x, -beside, beside, color="#333333", linewidth=0.8)
    _mark_points(axis, mesh, tallest)
    axis.set_xlabel("distance from the root (mm)")
    axis.set_ylabel("distance from the axis (mm)" if structure is not None else "")
    if structure is None:
        axis.set_yticks([])
    axis.set_ylim(-2.6 * tallest, 1.8 * tallest)
    lengths = 1e3 * np.diff(mesh.nodes)
    axis.set_title(f"{mesh.elements} elements of {lengths.min():.3g} to {lengths.max():.3g} mm", loc="left")
    if mesh.regions:
        axis.legend(loc="upper right", frameon=False, fontsize=9.0, ncols=min(len(mesh.regions), 4))
    return axis


def _mark_points(axis: Any, mesh: Mesh, tallest: float) -> None:
    """Named points below the beam; names at one place stand in one label."""
    places: dict[float, list[str]] = {}
    for name, at in mesh.points.items():
        near = next((place for place in places if abs(place - at) <= 1e-6 * mesh.nodes[-1]), at)
        places.setdefault(near, []).append(name)
    for row, (at, names) in enumerate(sorted(places.items())):
        # in two rows, so that neighbours do not cover one another
        level = -1.5 * tallest - 0.5 * tallest * (row % 2)
        axis.plot([1e3 * at], [-1.15 * tallest], "^", color="#333333", markersize=6.0)
        axis.annotate(", ".join(names), (1e3 * at, level), ha="center", va="top", color=GREY, fontsize=9.0)
