"""Figures of the beam: its mesh and its mode shapes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import having, instance, optional, quantity, require, takes
from femimpact.fem.discretisation import Discretisation, discretise
from femimpact.fem.mesh import Mesh
from femimpact.figures.drawing import (
    BLUE,
    COLOURS,
    DARK,
    GREY,
    LEGEND,
    OffScreen,
    draw_connection,
    draw_ground,
    label_axes,
    panel,
    panels,
)
from femimpact.scene.placed import placed_structure
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes, require_modes_of
from femimpact.system.system import System
from femimpact.units import number_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

MOST_NODES = 400
"""Nodes of a mesh up to which each is drawn."""


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

    Raises
    ------
    InputError
        If the structure does not fit the mesh.
    """
    # of each element at its two ends
    half = np.full((mesh.elements, 2), 0.5)
    discretised = None if structure is None else discretise(structure, mesh=mesh)
    if discretised is not None:
        sections = discretised.sections
        half = 1e3 * sections.half_height_at(np.arange(mesh.elements)[:, None], np.array([0.0, 1.0]))
        for segment in discretised.structure.beam.segments:
            if segment.thickness is None:
                half[sections.region == segment.name] = 500.0 * segment.drawn_at(0.0)[1]
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
    if structure is None:
        axis.set_yticks([])
    axis.set_ylim(-2.6 * tallest, top)
    lengths = 1e3 * np.diff(mesh.nodes)
    title = f"{mesh.elements} elements of {number_text(lengths.min(), 3)} to {number_text(lengths.max(), 3)} mm"
    if structure is not None and structure.beam.drawn_words:
        title += f"\n{structure.beam.drawn_words}"
    label_axes(axis, "distance from the root (mm)", "" if structure is None else "distance from the axis (mm)", title)
    _, labels = axis.get_legend_handles_labels()
    place: dict[str, Any] = {"loc": "upper right"}
    if structure is not None and structure.connections:
        # they are above the beam
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2)}
    if labels:
        axis.legend(frameon=False, fontsize=9.0, ncols=min(len(labels), 4), **place)
    return axis


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


BOX = "#7b8a9a"
SUPPORT_MARKS: dict[str, tuple[Any, float, str]] = {
    "clamped": ("|", 34.0, "clamped"),
    "pinned": ((3, 0, 0), 12.0, "pinned: no deflection"),
    "guided": ("_", 26.0, "guided: no slope"),
}
"""Marker, its size in points, and its label."""
STOP_AT = 1.13
"""Height of the mark of a stop, whose point is towards the beam."""
SYSTEM: Any = having("a System", ("nodes", "contacts", "total_mass", "position_of", "deflection_rows"))
"""A `DrawnSystem` will do."""
MOST = 4
"""Modes that are drawn."""
MOST_POINTS = 100_000
"""Along the beam, far beyond what a picture shows."""


@takes(
    system=SYSTEM, modes=instance(Modes), points=quantity("1", at_least=2, at_most=MOST_POINTS, integer=True),
    structure=optional(instance(Structure)),
)  # fmt: skip
def mode_shapes(
    system: System,
    modes: Modes,
    points: int = 200,
    structure: Structure | None = None,
    figure: FigureBase | OffScreen | None = None,
) -> NDArray[np.object_]:
    """Mode shapes along the beam, each scaled to 1, with frequency, damping and share of the moving mass.

    Parameters
    ----------
    system : System
    modes : Modes
        The first four are drawn.
    points : int
        Along the beam.
    structure : Structure, optional
        Its bodies, supports, springs and dashpots are drawn on the shapes, with the balls and stops of the system. A
        stop is at its place and on its side; its gap is not drawn, for a shape has no length.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (modes,) of Axes

    Raises
    ------
    InputError
        If the system has no beam to draw a shape of, or the modes are of another one.
    """
    require(system.nodes.size > 1, "system.nodes", system.nodes.size, "", "must be 2 or more: a shape needs a beam")
    count = min(modes.natural_frequency.size, MOST)
    x = np.linspace(0.0, float(system.nodes[-1]), points)
    rows = system.deflection_rows(x)
    require_modes_of(rows.shape[1], modes)
    axes = panels(figure, 8.0, 1.55 * count + 0.6, count, 1, sharex=True)[:, 0]
    shapes = rows @ modes.vectors[:, :count]
    for i, axis in enumerate(axes):
        largest = np.abs(shapes[:, i]).max()
        axis.axhline(0.0, color=GREY, linewidth=0.8)
        axis.plot(1e3 * x, shapes[:, i] / largest, color=COLOURS[i % len(COLOURS)], linewidth=2.2)
        if structure is not None:
            _parts(axis, system, structure, modes.vectors[:, i] / largest)
        axis.set_ylim(-1.25, 1.25)
        axis.set_ylabel("w / max |w|")
        mass = 100.0 * modes.effective_mass[i] / system.total_mass
        axis.set_title(
            f"mode {i + 1}: {modes.natural_frequency[i]:.5g} Hz, damping ratio "
            f"{number_text(100 * modes.damping_ratio[i], 3)} %, {mass:.1f} % of the moving mass",
            loc="left",
        )
    axes[-1].set_xlabel("distance from the root (mm)")
    if structure is not None:
        _legend(axes[0])
    return axes


def _parts(axis: Any, system: System, structure: Structure, vector: NDArray[np.float64]) -> None:
    """Bodies, balls, supports, springs and dashpots where the shape puts them."""
    placed = placed_structure(structure, system)

    def point(x: float) -> tuple[float, float]:
        return 1e3 * x, float(np.asarray(system.deflection_rows([x]) @ vector)[0])

    def mark(place: float, marker: Any, size: float, **style: Any) -> None:
        x, y = point(place)
        axis.plot([x], [y], linestyle="none", marker=marker, markersize=size, clip_on=False, **style)

    for item, places in placed.connections:
        first, *second = map(point, places)
        if second:
            draw_connection(axis, item, (first, second[0]), (0.0, 0.08))
        else:
            base = (first[0], -1.25)
            draw_connection(axis, item, (first, base), (0.006e3 * float(system.nodes[-1]), 0.0))
            draw_ground(axis, base)
    for body, x in placed.bodies:
        mark(x, "s", 15.0, markerfacecolor="white", markeredgecolor=BOX, markeredgewidth=2.5, label=body.name)
    for contact in placed.contacts:
        if not contact.is_stop:
            mark(contact.position, "o", 7.0, color=BLUE, label=contact.name)
            continue
        for side, gap, marker in zip((1.0, -1.0), contact.gaps, ("v", "^"), strict=True):
            if math.isfinite(gap):
                at = (1e3 * contact.position, side * STOP_AT)
                axis.plot(*at, marker, color=DARK, markersize=9.0, linestyle="none", clip_on=False, label=contact.name)
    for support, x in placed.supports:
        marker, size, label = SUPPORT_MARKS[support.kind]
        mark(x, marker, size, color="black", markeredgewidth=4.0 if size > 20.0 else 1.0, label=label)


def _legend(axis: Any) -> None:
    """Names of the parts, outside the axes: no corner is free for every shape."""
    handles, labels = axis.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    # rows of equal length
    columns = math.ceil(len(named) / math.ceil(len(named) / 6))
    legend = axis.figure.legend(
        list(named.values()), list(named), loc="outside lower center", ncols=columns, frameon=False, fontsize=LEGEND
    )
    for handle in legend.legend_handles:
        handle.set_markersize(min(handle.get_markersize(), 12.0))
