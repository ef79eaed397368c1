"""The figure: time over error of the tip's history, everybody."""

from __future__ import annotations

__all__ = ["draw"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F")
MARKERS = "osD^vP*X<>"


def draw(points, path, title) -> None:
    """Write a PNG: femimpact in full lines and filled, all others dashed and hollow."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(9.0, 6.0))
    names = list(dict.fromkeys(point.tool for point in points))
    for i, name in enumerate(names):
        own = [point for point in points if point.tool == name]
        colour, filled = COLOURS[i % len(COLOURS)], own[0].own
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
    axis.grid(True, which="major", color="0.9")
    axis.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, dpi=130, bbox_inches="tight")
    plt.close(figure)
