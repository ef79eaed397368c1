"""Figure of mode shapes, with the bodies on the beam and its supports."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import having, instance, optional, quantity, require, takes
from femimpact.export.figures.connections import draw_connection, draw_ground
from femimpact.export.figures.drawing import BLUE, COLOURS, DARK, GREY, OffScreen, panels
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes, require_modes_of
from femimpact.system.system import System

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

__all__ = ["mode_shapes"]

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
"""What a study has left of one will do."""
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
        If the system has no beam to draw a shape of, the modes are of another one, or an argument is out of range.
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
            f"{100 * modes.damping_ratio[i]:.3g} %, {mass:.1f} % of the moving mass",
            loc="left",
        )
    axes[-1].set_xlabel("distance from the root (mm)")
    if structure is not None:
        _legend(axes[0])
    return axes


def _parts(axis: Any, system: System, structure: Structure, vector: NDArray[np.float64]) -> None:
    """Bodies, balls, supports, springs and dashpots where the shape puts them."""

    def point(at: Any) -> tuple[float, float]:
        x = system.position_of(structure.place_of(at))
        return 1e3 * x, float(np.asarray(system.deflection_rows([x]) @ vector)[0])

    def mark(at: Any, marker: Any, size: float, **style: Any) -> None:
        x, y = point(at)
        axis.plot([x], [y], linestyle="none", marker=marker, markersize=size, clip_on=False, **style)

    for _, item, places in structure.connections:
        first, *second = (point(place) for place in places.values())
        if second:
            draw_connection(axis, item, (first, second[0]), (0.0, 0.08))
        else:
            base = (first[0], -1.25)
            draw_connection(axis, item, (first, base), (0.006e3 * float(system.nodes[-1]), 0.0))
            draw_ground(axis, base)
    for body in structure.masses:
        mark(body.at, "s", 15.0, markerfacecolor="white", markeredgecolor=BOX, markeredgewidth=2.5, label=body.name)
    for contact in system.contacts:
        if not contact.is_stop:
            mark(contact.position, "o", 7.0, color=BLUE, label=contact.name)
            continue
        for side, gap, marker in zip((1.0, -1.0), contact.gaps, ("v", "^"), strict=True):
            if math.isfinite(gap):
                at = (1e3 * contact.position, side * STOP_AT)
                axis.plot(*at, marker, color=DARK, markersize=9.0, linestyle="none", clip_on=False, label=contact.name)
    for support in structure.supports:
        marker, size, label = SUPPORT_MARKS[support.kind]
        mark(support.at, marker, size, color="black", markeredgewidth=4.0 if size > 20.0 else 1.0, label=label)


def _legend(axis: Any) -> None:
    """Names of the parts, outside the axes: no corner is free for every shape."""
    handles, labels = axis.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    # rows of equal length
    columns = math.ceil(len(named) / math.ceil(len(named) / 6))
    legend = axis.figure.legend(
        list(named.values()), list(named), loc="outside lower center", ncols=columns, frameon=False
    )
    for handle in legend.legend_handles:
        handle.set_markersize(min(handle.get_markersize(), 12.0))
