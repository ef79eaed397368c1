"""Figure of a mesh: its elements in the sections of the beam, its regions and its named points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.errors import instance, optional, takes
from femimpact.export.figures.connections import draw_connection, draw_ground
from femimpact.export.figures.drawing import COLOURS, GREY, OffScreen, panel
from femimpact.fem.discretisation import Discretisation, discretise
from femimpact.fem.mesh import Mesh
from femimpact.structure.structure import Structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["beam_mesh"]

MOST_NODES = 400
"""Up to which each node is drawn."""


@takes(mesh=instance(Mesh), structure=optional(instance(Structure)))
def beam_mesh(mesh: Mesh, structure: Structure | None = None, ax: Axes | OffScreen | None = None) -> Axes:
    """The elements of a mesh as the beam's side view, coloured by region, with its named points.

    Parameters
    ----------
    mesh : Mesh
    structure : Structure, optional
        Gives the thickness along every element, checked against the mesh; all are drawn equally thick without it.
        Its springs and dashpots are drawn above the beam.
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
    # of each element at its two ends
    half = np.full((mesh.elements, 2), 0.5)
    discretised = None if structure is None else discretise(structure, mesh=mesh)
    if discretised is not None:
        sections = discretised.sections
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
    top = 1.8 * tallest
    if discretised is not None:
        top = max(top, _draw_connections(axis, discretised, tallest) + 0.6 * tallest)
    axis.set_xlabel("distance from the root (mm)")
    axis.set_ylabel("distance from the axis (mm)" if structure is not None else "")
    if structure is None:
        axis.set_yticks([])
    axis.set_ylim(-2.6 * tallest, top)
    lengths = 1e3 * np.diff(mesh.nodes)
    axis.set_title(f"{mesh.elements} elements of {lengths.min():.3g} to {lengths.max():.3g} mm", loc="left")
    _legend(axis, connected=structure is not None and bool(structure.connections))
    return axis


def _legend(axis: Any, connected: bool) -> None:
    """Names of regions, springs and dashpots; below the axes where there are connections above the beam."""
    _, labels = axis.get_legend_handles_labels()
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2)} if connected else {"loc": "upper right"}
    if labels:
        axis.legend(frameon=False, fontsize=9.0, ncols=min(len(labels), 4), **place)


def _draw_connections(axis: Any, discretised: Discretisation, tallest: float) -> float:
    """Springs and dashpots above the beam, those between two places in rows; the height (mm) that they take."""
    highest, rows = 0.0, 0
    for _, item, places in discretised.structure.connections:
        at, *to = (1e3 * discretised.position_of(place) for place in places.values())
        level, end = 1.3 * tallest, (at, 2.4 * tallest)
        if to:
            rows += 1
            level += (1.3 + 1.0 * rows) * tallest
            end = (to[0], level)
        for x in (at, *to):
            axis.plot([x, x], [0.0, level], color=GREY, linewidth=0.8, linestyle=":")
        across = (0.0, 0.25 * tallest) if to else (6.0 * float(discretised.mesh.nodes[-1]), 0.0)
        draw_connection(axis, item, ((at, level), end), across)
        if not to:
            draw_ground(axis, end)
        highest = max(highest, end[1])
    return highest


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
