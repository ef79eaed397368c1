"""Common parts of figures: colours and style, axes and legends, channels of a response, springs and dashpots."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, checked, quantity, require, require_type, suggestion
from femimpact.excitation.excitation import has_cycle
from femimpact.files import atomic_path, target_path
from femimpact.regular_file import decimal_number
from femimpact.response.channels import channel_key
from femimpact.response.response import Response
from femimpact.scene.placed import zigzag
from femimpact.structure.structure import Dashpot, Position, Spring
from femimpact.system.system import System
from femimpact.units import number_text, prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

Kind = TypeVar("Kind")

BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW, GREY = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#666666"
)  # fmt: skip
"""Okabe and Ito's colours, which most colour-blind readers can distinguish."""
DARK = "#333333"
"""Colour of supports, stops, connections and samples."""
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY)
WALLS: tuple[tuple[int, str, str, str], ...] = ((1, BLUE, "o", "+ wall"), (-1, ORANGE, "^", "- wall"))
"""Side, colour, marker and label."""
STYLE: Any = {
    "font.size": 11.0,
    "axes.titlesize": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.prop_cycle": f"cycler('color', {list(COLOURS)})",
    "lines.linewidth": 1.6,
}
"""Settings of matplotlib, for `matplotlib.rc_context`."""
PROJECTOR: Any = STYLE | {"font.size": 14.3}
"""The same with large print: a figure that is made in it is so much smaller, with more pixels to the inch."""
LEGEND = 10.0
"""Size of the text of a legend, points."""
LETTER, HANDLE, GAP, ROW = 0.46, 4.0, 1.6, 1.55
"""Widths of a letter, of an entry besides its words, and of the space between columns (part of that), and the height of
a row of a legend, by the size of its text."""
BEYOND = 1.1
"""Longest line of a title or of a label, over the axes before they are laid out, which makes them larger."""
MOST_MARKS, PIXELS = 5000, 96
"""Marks, cells or points of a line beyond which they become an image in SVG, and pixels of an inch of it."""
CLOSE = 0.02
"""Largest error of the number of a tick, by the distance to the next one."""
CYCLES: Any = quantity("1", above=0.0)
"""Number of cycles of the base that are drawn."""


@dataclass(frozen=True)
class OffScreen:
    """Stands for axes or a figure: a new one that no window and no notebook shows, for a file."""


# ---- cycles of the base -------------------------------------------------------------------------------


def walls_of(response: Response) -> list[tuple[int, str, str, str]]:
    """Those of `WALLS` that a ball or stop of a response has, as one of a stop on one side; without contacts both."""
    gaps = [pair.gaps for pair in response.system.contacts] or [(0.0, 0.0)]
    return [wall for wall in WALLS if any(math.isfinite(each[0 if wall[0] > 0 else 1]) for each in gaps)]


def last_cycles(response: Response, cycles: float) -> tuple[float, str]:
    """Time (s) at which the last base cycles of a history begin, and words for them; all of it where it has fewer.

    Under what has no cycle they are those of the first mode, and the words are of their time.
    """
    base, first, last = response.base, float(response.time[0]), float(response.time[-1])
    first_mode = response.system.first_frequency
    known = first_mode > 0.0 and math.isfinite(first_mode)
    frequency = first_mode if known and not has_cycle(base) else base.frequency
    start = max(last - cycles / frequency, first)
    if math.isnan(base.phase):
        return start, f"last {number_text(last - start, 3)} s"
    cycles_in_run = cycles if start > first else (last - first) * frequency
    return start, f"last {cycles_in_run:.4g} cycles at {frequency:.4g} Hz"


# ---- where a figure is drawn ----------------------------------------------------------------------


def panel(ax: Axes | OffScreen | None, width: float, height: float) -> Axes:
    """The axes to draw on: those given, or those of a new figure of this size (inches).

    Raises `InputError` if `ax` is neither axes, nor `OffScreen`, nor None.
    """
    if ax is None or isinstance(ax, OffScreen):
        axes: Axes = panels(ax, width, height)[0, 0]
        return axes
    from matplotlib.axes import Axes
    from matplotlib.ticker import ScalarFormatter

    require_type(ax, Axes, "ax")
    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_formatter(), ScalarFormatter):
            axis.set_major_formatter(ScalarFormatter(useOffset=False))
    return ax


def panels(
    figure: FigureBase | OffScreen | None, width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> NDArray[np.object_]:
    """Axes (rows, columns) on a figure given, or on a new one of this size (inches).

    Without a figure it is one of pyplot's, which a notebook shows. Where matplotlib's `font.size` is above that of
    `STYLE`, all print is larger by as much.

    Raises `InputError` if `figure` is neither a figure, nor `OffScreen`, nor None.
    """
    import matplotlib
    from matplotlib.figure import Figure, FigureBase

    larger = max(matplotlib.rcParams["font.size"] / STYLE["font.size"], 1.0)
    size: Any = {"figsize": (width / larger, height / larger), "dpi": larger * matplotlib.rcParams["figure.dpi"]}
    if figure is None:
        import matplotlib.pyplot as plt

        # outside the style: the first figure of a notebook chooses the backend, which sets pyplot to interactive, and
        # the end of the style would set that back: no later figure would be shown
        figure = plt.figure(**size, layout="constrained")
    with matplotlib.rc_context(STYLE):
        if isinstance(figure, OffScreen):
            figure = Figure(**size, layout="constrained")
        require_type(figure, FigureBase, "figure")
        axes: NDArray[np.object_] = figure.subplots(rows, columns, squeeze=False, **options)
    return axes


def save_figure(drawn: Axes | NDArray[np.object_] | Figure, path: str | Path) -> Path:
    """Write the figure of axes; the suffix chooses the format.

    Parameters
    ----------
    drawn : Axes, ndarray of Axes, or Figure
        What a function of `femimpact.figures` returned.
    path : str or Path

    Raises
    ------
    InputError
        If `drawn` is no figure, no file can be there, or the suffix is that of no format.
    """
    import matplotlib

    path, figure = target_path(path), figure_of(drawn)
    suffix, known = path.suffix.lstrip(".").lower(), sorted(figure.canvas.get_supported_filetypes())
    require(suffix in known, "path", str(path), "", f"must end in .{', .'.join(known)}")
    with matplotlib.rc_context(STYLE), atomic_path(path) as temporary:
        figure.savefig(temporary, format=suffix, dpi=1.5 * figure.dpi)
    return path


def svg_text(drawn: Axes | NDArray[np.object_] | Figure) -> str:
    """The figure of axes as SVG, the same text whenever it is drawn; of many marks an image stands in it."""
    import matplotlib

    figure, text = figure_of(drawn), io.StringIO()
    _join_marks(figure)
    fixed = {"svg.hashsalt": "femimpact", "svg.fonttype": "none"}
    with matplotlib.rc_context(STYLE | fixed):
        figure.savefig(text, format="svg", dpi=PIXELS, metadata={"Date": None})
    return text.getvalue()


def _join_marks(figure: Any) -> None:
    """Let what has more than `MOST_MARKS` parts be drawn as an image."""
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D

    for line in figure.findobj(Line2D):
        line.set_rasterized(len(line.get_xdata(orig=False)) > MOST_MARKS)
    for cells in figure.findobj(Collection):
        offsets, paths = len(cells.get_offsets()), cells.get_paths()
        points = sum(len(path.vertices) for path in paths)
        cells.set_rasterized(
            bool(cells.get_rasterized()) or max(offsets, points, np.size(cells.get_array())) > MOST_MARKS
        )


def figure_of(drawn: Axes | NDArray[np.object_] | Figure) -> Any:
    """The figure of what a function of `femimpact.figures` returned.

    Raises `InputError` if it is none.
    """
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    first = drawn.flat[0] if isinstance(drawn, np.ndarray) and drawn.size else drawn
    # the figure of axes may be a part of one
    figure = first.figure.figure if isinstance(first, Axes) else first
    require_type(figure, Figure, "drawn")
    return figure


# ---- axes -----------------------------------------------------------------------------------------


def plain_log_ticks(axis: Any) -> None:
    """Label a logarithmic axis 1, 2, 5, 10, ... instead of by powers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def tick_texts(values: Array) -> list[str]:
    """Numbers of ticks, with as many digits as tell each from its neighbours: 3 of most."""
    steps = np.abs(np.diff(values))
    # of a single value any digits will do
    nearest = np.minimum(np.append(steps, math.inf), np.append(math.inf, steps))
    for digits in range(3, 16):
        texts = [number_text(value, digits) for value in values]
        if np.all(np.abs(np.array(texts, dtype=float) - values) <= CLOSE * nearest):
            break
    return texts


def label_axes(axis: Axes, x: str, y: str, title: str = "") -> None:
    """Set the labels of both axes, and a title on the left, in lines that are hardly longer than the axes."""
    axis.set(xlabel=x, ylabel=y)
    box = axis.get_window_extent()
    for text in (axis.set_title(title, loc="left"), axis.xaxis.label):
        break_lines(text, BEYOND * box.width)
    break_lines(axis.yaxis.label, BEYOND * box.height)


def break_lines(text: Any, room: float) -> None:
    """Break the words of a text of matplotlib so that no line is longer than so many pixels."""
    # what no font can write has no width
    if not text.get_text().replace("\n", "").isprintable():
        return
    longest, words = max(text.get_window_extent().size), text.get_text().splitlines()
    if longest > room:
        letters = max(int(max(map(len, words)) * room / longest), 1)
        text.set_text("\n".join(textwrap.fill(line, letters, break_long_words=False) for line in words))


def legend_above(
    axis: Axes,  # with its title
    # entries, by their labels, each group on a separate row; all labelled artists of the axes by default
    *groups: Sequence[Any],
) -> None:
    """Name the curves between the axes and their left title: inside, no corner is free for every result."""
    from matplotlib.transforms import ScaledTranslation

    if (drawn_before := axis.get_legend()) is not None:
        # of curves that are named again now
        drawn_before.remove()
    named = [list(group) for group in groups if group] or [axis.get_legend_handles_labels()[0]]
    figure: Any = axis.figure
    width, height = 72.0 * axis.get_window_extent().width / figure.dpi, 0.0
    for handles in reversed(named):
        if not handles:
            continue
        earlier = axis.get_legend()
        if earlier is not None:
            axis.add_artist(earlier)
        columns = _columns([str(handle.get_label()) for handle in handles], width)
        above = axis.transAxes + ScaledTranslation(0.0, height / 72.0, figure.dpi_scale_trans)
        axis.legend(
            handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), bbox_transform=above, ncols=columns,
            fontsize=LEGEND, frameon=False, borderaxespad=0.1, borderpad=0.2, handlelength=1.6,
            columnspacing=GAP,
        )  # fmt: skip
        height += ROW * LEGEND * -(-len(handles) // columns)
    title = axis.get_title(loc="left")
    if title and height:
        axis.set_title(title, loc="left", pad=height + 0.8 * LEGEND)


def _columns(labels: Sequence[str], width: float) -> int:
    """Columns of the legend with the fewest rows that is not wider (points) than the axes, as far as can be guessed."""
    lengths = np.array([len(label) for label in labels])
    for rows in range(1, len(labels)):
        columns = -(-len(labels) // rows)
        longest = [part.max() for part in np.array_split(lengths, columns)]
        if LEGEND * (sum(LETTER * letters + HANDLE for letters in longest) - GAP) <= width:
            return columns
    return 1


def scaled(values: Any, unit: str) -> tuple[Any, str]:
    """Values and unit with the prefix of the largest."""
    factor, label_unit = prefixed(float(np.abs(values).max(initial=0.0)), unit)
    return factor * values, label_unit


# ---- what is read of a response -------------------------------------------------------------------


def require_history(response: Response) -> None:
    """Raise `InputError` for a response without samples."""
    allowed = "must hold a history; that of a run with Recorder.sink is in the pieces"
    require(response.time.size > 0, "response.time", "no samples", "", allowed)


def channel_name(response: Response, channel: Position | None) -> str:
    """Name of a recorded channel; the first one for None."""
    require(bool(response.channels), "response.channels", "none", "", "must be one or more")
    name = next(iter(response.channels)) if channel is None else channel_key(channel)
    response[name]  # what is not recorded is refused in its words
    return name


def by_label(key: str, argument: Any, kind: type[Kind], words: str) -> Mapping[str, Kind]:
    """One or more things of a kind by their labels; a single one has none.

    Raises `InputError` if there is none, or something else.
    """
    named = {"": argument} if isinstance(argument, kind) else argument
    require_type(named, Mapping, key)
    require(len(named) > 0, key, "none", "", f"must be one or more {words}")
    for label, member in named.items():
        require_type(member, kind, f"{key}.{label}")
    return cast(Mapping[str, Kind], named)


def rows_of(key: str, argument: object, **metadata: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """Rows of an argument that is a list of tuples, each entry in the type that its metadata allows.

    Raises `InputError` if it is no list, or an entry is not what it must be, which is named.
    """
    allowed = f"must be a list of ({', '.join(metadata)})"
    require(isinstance(argument, (list, tuple)), key, argument, "", allowed)
    rows: Any = argument
    for i, row in enumerate(rows):
        fits = isinstance(row, (list, tuple)) and len(row) == len(metadata)
        require(fits, f"{key}[{i}]", row, "", f"must be ({', '.join(metadata)})")
    return [
        tuple(
            checked(f"{key}[{i}].{name}", value, allowed)
            for (name, allowed), value in zip(metadata.items(), row, strict=True)
        )
        for i, row in enumerate(rows)
    ]


def ball_of(response: Response, name: str | None) -> Any:
    """The contact pair of a ball by its name; the first for None."""
    balls = {pair.name: pair for pair in response.system.balls}
    require(bool(balls), "ball", name, "", "must be of a system with balls")
    require(name is None or name in balls, "ball", name, "", suggestion(str(name), balls))
    return balls[next(iter(balls)) if name is None else name]


def place_of(response: Response, pair: Any) -> str | None:
    """Name of the recorded channel that is the beam's displacement where a pair is; None if there is none."""
    system = response.system
    for name, unit in response.units.items():
        at = _is_at(system, name, pair) if name in system.points else decimal_number(name) == pair.position
        if unit == "m" and at:
            return name
    return None


def name_at(system: System, pair: Any) -> str | None:
    """Name of the point of a system where a pair is, the first of several."""
    return next((name for name in system.points if _is_at(system, name, pair)), None)


def _is_at(system: Any, point: str, pair: Any) -> bool:
    if not math.isnan(pair.position):
        return bool(system.points[point] == pair.position)
    # places of a system given by matrices are rows, without positions
    return np.array_equal(system.point_row(point), -pair.direction if pair.is_stop else pair.direction)


def beam_at(response: Response, pair: Any) -> NDArray[np.float64]:
    """Displacement (m) of the beam where a pair is, from its channel or from ball and gap.

    Raises `InputError` if neither was recorded.
    """
    place = place_of(response, pair)
    if place is not None:
        return response[place]
    for gap in (f"{pair.name}.gap", "gap"):
        if gap in response.channels and pair.name in response.channels:
            return np.asarray(response[pair.name] - response[gap])
    at = name_at(response.system, pair) or f"{pair.position:g}"
    raise InputError([Fault("channels", list(response.channels), "", f"must hold {at!r}, where {pair.name!r} is")])


Point = tuple[float, float]


def draw_connection(
    axis: Any,
    item: Spring | Dashpot,
    ends: tuple[Point, Point],  # pair of (x, y) in units of the axes
    across: Point,  # (x, y) from the line between the ends to the corners of a zigzag
) -> None:
    """A spring or a dashpot between two points of a figure, with its name for the legend."""
    damps = isinstance(item, Dashpot)
    points = np.array(ends, dtype=float) if damps else zigzag(ends, across)
    label, line = f"{item.name} ({'dashpot' if damps else 'spring'})", "--" if damps else "-"
    axis.plot(points[:, 0], points[:, 1], line, color=DARK, linewidth=1.2, label=label, clip_on=False)
    axis.plot(*np.array(ends, dtype=float).T, "o", color=DARK, markersize=3.5, clip_on=False)


def draw_ground(axis: Any, at: Point) -> None:
    """The base, where a spring or a dashpot ends on it."""
    axis.plot([at[0]], [at[1]], "_", color=GREY, markersize=14.0, markeredgewidth=2.5, clip_on=False)
