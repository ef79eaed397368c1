"""The figure: time over error of the tip's history, everybody."""

from __future__ import annotations

import femimpact as fi
from femimpact.figures.drawing import COLOURS, GREY, panel

__all__ = ["draw"]

MARKERS = "osD^vP*X<>"


def draw(points, path, title) -> None:
    """Write a PNG: femimpact in full lines and filled, all others dashed and hollow."""
    axis = panel(fi.figures.OffScreen(), 9.0, 6.0)
    names = list(dict.fromkeys(point.tool for point in points))
    for i, name in enumerate(names):
        own = [point for point in points if point.tool == name]
        colour, filled = (*COLOURS, "black", GREY)[i % (len(COLOURS) + 2)], own[0].own
        axis.loglog(
            [point.error for point in own],
            [1e3 * point.cpu for point in own],
            marker=MARKERS[i % len(MARKERS)],
            linestyle="-" if filled else "--",
            color=colour,
            markerfacecolor=colour if filled else "white",
            label=name,
        )
    axis.set_xlabel("largest error of the tip over the first 0.8 s, share of its largest (1)")
    axis.set_ylabel("CPU time of one core (ms)")
    axis.set_title(title, loc="left", fontsize=10)
    # better is to the left and down
    axis.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(1.0, 0.5))
    fi.figures.save_figure(axis, path)
