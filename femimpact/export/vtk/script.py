"""A script for pvpython and for ParaView's own script window, which opens a series with colours, arrows and text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.files import atomic_write
from femimpact.export.scene_pieces import BEAM, CONNECTION, CONTACT_POINT, PARTS
from femimpact.export.vtk.fields import RELATIVE_STRESS
from femimpact.export.vtk.series import Frame, Series
from femimpact.export.vtk.template import TEMPLATE

__all__ = ["DEFLECTION", "MODE", "MODES", "SeriesSummary", "View", "script_path", "write_script"]

COLOURS = {
    "box": (0.48, 0.54, 0.60), "ball": (0.0, 0.447, 0.698), "support": (0.2, 0.2, 0.2), "body": (0.60, 0.65, 0.70),
    "stop": (0.35, 0.35, 0.35), "spring or dashpot": (0.0, 0.62, 0.45),
}  # fmt: skip
"""Of the parts that carry no field."""

ARROWS = {
    "contact_force_vector": ("green: force", "N", 0.04, (0.0, 0.62, 0.45)),
    "contact_impulse_vector": ("orange: impulse", "N s", 0.055, (0.84, 0.37, 0.0)),
}
"""Vectors shown as arrows: words, unit, the longest arrow as a share of the length of what is drawn, and colour."""

BESIDE = 0.012
"""Share of the length of what is drawn between a box and its first arrow, and between the arrows of both vectors."""


WITHOUT_FIELDS = "'time value %.6g' % t_value"
"""Text of a VTKHDF file, which has no field data."""


@dataclass(frozen=True)
class View:
    """What a script shows: its words, and what its text at the top is made of.

    Parameters
    ----------
    title : str
        Of the docstring.
    text : str
        Expression of ParaView's Python annotation, on the field data.
    stress : tuple of str
        Array that colours the beam, the expression of ParaView's calculator that makes it, and the title of its bar, in
        which `{mode}` is the number of the mode.
    each : bool
        Whether every frame has a separate colour bar, not all frames the same.
    """

    title: str
    text: str
    stress: tuple[str, str, str]
    each: bool = False


OF_MODE = ("share_of_stress", RELATIVE_STRESS, "axial stress, as a share of the largest of mode {mode:.0f}")
IN_MPA = ("axial_stress_MPa", "axial_stress / 1e6", "axial stress (MPa)")
MODES = View(
    "Mode shapes, one time value for each mode: its number. The colour bar is that of the mode.",
    "'mode %d: %.5g Hz' % (mode[0], natural_frequency[0])",
    OF_MODE,
    each=True,
)
MODE = View(
    "One mode over one period: press Play.",
    "'mode %d: %.5g Hz, phase %3.0f degrees' % (mode[0], natural_frequency[0], 57.29577951 * phase[0])",
    OF_MODE,
)
DEFLECTION = View(
    "The moving beam, with arrows of the contact forces and, at an impact, of its impulse.",
    "name.GetValue(0).replace(', ', '\\n', 1) + '\\n' + contacts.GetValue(0)"
    " + ('\\ndisplacement drawn %g times as large' % exaggeration[0] if exaggeration[0] != 1 else '')",
    IN_MPA,
)


@dataclass(frozen=True, eq=False)
class FrameSummary:
    """What a script needs of one frame.

    Parameters
    ----------
    time : float
    mode : float
        Its number; 0 of a deflection.
    peaks : mapping of str to float
        Largest axial stress (Pa), contact force (N) and impulse (N s), 0 where there is none.
    pressed : int
        Number of the contact with the largest impulse, or the largest force where there is no impulse; -1 for none.
    """

    time: float
    mode: float
    peaks: Mapping[str, float]
    pressed: int


class SeriesSummary:
    """What a script needs of all frames: the space that they and their contacts fill, and the largest values."""

    def __init__(self) -> None:
        self.whole = Space()
        self.contacts: dict[int, Space] = {}
        self.frames: dict[int, FrameSummary] = {}
        self.parts: list[int] = []
        self.half_width = 0.0

    def gathering(self, series: Series) -> Series:
        """The same series, each of whose frames is added to the summary when it is made."""
        sizes = np.diff(series.offsets, prepend=0)

        def frame(k: int) -> Frame:
            found = series.frame(k)
            moved = series.points + found.points["displacement"]
            self.whole.add(moved)
            pairs = found.cells["contact_pair"]
            pair_of_entry, part_of_entry = np.repeat(pairs, sizes), np.repeat(found.cells["part"], sizes)
            for pair in np.unique(pairs[pairs >= 0]):
                of_pair = series.connectivity[pair_of_entry == pair]
                self.contacts.setdefault(int(pair), Space()).add(moved[of_pair])
                marks = series.connectivity[(pair_of_entry == pair) & (part_of_entry == CONTACT_POINT)]
                reach = moved[of_pair, 0].max() - moved[marks, 0].min()
                self.half_width = max(self.half_width, float(reach))
            self.parts = [int(part) for part in np.unique(found.cells["part"])]
            self.frames[k] = _summary_of(series, found, k, pair_of_entry)
            return found

        return replace(series, frame=frame)

    def peak(self, name: str) -> float:
        """Largest value of an array in all frames."""
        return max((frame.peaks[name] for frame in self.frames.values()), default=0.0)


@dataclass(eq=False)
class Space:
    """The smallest box about points, m."""

    low: NDArray[np.float64] = field(default_factory=lambda: np.full(3, np.inf))
    high: NDArray[np.float64] = field(default_factory=lambda: np.full(3, -np.inf))

    def add(self, points: NDArray[np.float64]) -> None:
        """Make it hold these points (n, 3) too."""
        self.low, self.high = np.minimum(self.low, points.min(axis=0)), np.maximum(self.high, points.max(axis=0))

    def with_arrows(self, beside: float, along: float) -> Space:
        """The same box with margins (m) for arrows, on the right of it and along y on both sides."""
        if along == 0.0:
            return self
        more = np.array([0.0, along, 0.0])
        return Space(self.low - more, self.high + more + (beside, 0.0, 0.0))

    def bounds(self) -> tuple[float, ...]:
        """Lower and upper bound of x, y and z in turn, as VTK has them."""
        ends = zip(self.low, self.high, strict=True)
        return tuple(float(f"{value:.6g}") for pair in ends for value in pair)


def _summary_of(series: Series, frame: Frame, k: int, pair_of_entry: NDArray[np.float64 | np.int32]) -> FrameSummary:
    peaks = {name: float(np.abs(frame.points.get(name, 0.0)).max()) for name in ("axial_stress", *ARROWS)}
    pressed = -1
    for name in ARROWS:
        if peaks[name] > 0.0:
            point = int(np.abs(frame.points[name][:, 1]).argmax())
            pressed = int(pair_of_entry[series.connectivity == point][0])
    mode = frame.fields.get("mode", 0.0)
    return FrameSummary(float(series.times[k]), mode if isinstance(mode, float) else 0.0, peaks, pressed)


def script_path(path: Path) -> Path:
    """Where the script of a series stands: NAME_paraview.py beside NAME.pvd."""
    return path.with_name(f"{path.stem}_paraview.py")


def write_script(path: Path, view: View, summary: SeriesSummary, names: Sequence[str] = ()) -> Path:
    """Write the script of a series.

    Parameters
    ----------
    path : Path
        Of the series.
    view : View
    summary : SeriesSummary
        Of the series that was written.
    names : sequence of str
        Of the contacts that a second view may show; none for no second view.

    Returns
    -------
    Path
    """
    size = float(summary.whole.high[0] - summary.whole.low[0])
    first, why = _first(summary)
    longest = size * max((share for name, (_, _, share, _) in ARROWS.items() if summary.peak(name) > 0.0), default=0.0)
    margins = ((len(ARROWS) + 1) * BESIDE * size, longest)
    close = {name: summary.contacts[pair].with_arrows(*margins).bounds() for pair, name in enumerate(names)}
    lines = {
        "TITLE": view.title,
        "STEM": script_path(path).name,
        "FILE": path.name,
        "START": repr(first.time),
        "WHY": why,
        "CLOSE_UP": repr(names[max(first.pressed, 0)] if names else None),
        "TEXT": repr(view.text if path.suffix == ".pvd" else WITHOUT_FIELDS),
        "BARS": _listed(_bars(view, summary)),
        "BOUNDS": repr(summary.whole.with_arrows(*margins).bounds()),
        "COLOUR": repr(view.stress[0]),
        "CALCULATED": repr(view.stress[1]),
        "CLOSE_UPS": "{" + "".join(f"\n    {name!r}: {space!r}," for name, space in close.items()) + "\n}",
        "PARTS": _listed(_parts(summary)),
        "ARROWS": _listed(_arrows(summary, size)),
        "LEGEND": repr("\n".join(_legend(summary))),
        "BEAM": str(BEAM),
        "MARKS": str(CONTACT_POINT),
    }
    text = TEMPLATE
    for name, value in lines.items():
        text = text.replace(f"@{name}@", value)
    script = script_path(path)
    atomic_write(script, text)
    return script


def _first(summary: SeriesSummary) -> tuple[FrameSummary, str]:
    """The frame that is shown first: of the largest impulse, else of the largest force, else the first one."""
    frames = [summary.frames[k] for k in sorted(summary.frames)]
    for name, why in (("contact_impulse_vector", "the largest impact"), ("contact_force_vector", "the largest force")):
        if summary.peak(name) > 0.0:
            return max(frames, key=lambda frame: frame.peaks[name]), why
    return frames[0], "the first one"


def _bars(view: View, summary: SeriesSummary) -> list[tuple[float, str]]:
    """End and title of the colour bar, one for each frame, or one for all."""
    frames = [summary.frames[k] for k in sorted(summary.frames)]
    titles = (view.stress[2].format(mode=frame.mode) for frame in (frames if view.each else frames[:1]))
    end = 1.0 if view.stress == OF_MODE else _rounded_up(1e-6 * summary.peak("axial_stress"))
    return [(end, title) for title in titles]


def _parts(summary: SeriesSummary) -> list[tuple[Any, ...]]:
    """Number, name, colour and width of lines of the parts that carry no field; of most parts the lines are edges."""
    named = [(number, PARTS[number]) for number in summary.parts if PARTS[number] in COLOURS]
    return [(number, name, COLOURS[name], 4.0 if number == CONNECTION else 1.0) for number, name in named]


def _arrows(summary: SeriesSummary, size: float) -> list[tuple[Any, ...]]:
    """Name, metres for each unit, metres beside the contact, and colour of the vectors that are not zero.

    They stand on the right of the widest box, so that the ball in its gap is seen.
    """
    shown = [(name, share, colour) for name, (_, _, share, colour) in ARROWS.items() if summary.peak(name) > 0.0]
    return [
        (name, share * size / summary.peak(name), summary.half_width + (1 + i) * BESIDE * size, colour)
        for i, (name, share, colour) in enumerate(shown)
    ]


def _legend(summary: SeriesSummary) -> list[str]:
    peaks = [(words, summary.peak(name), unit) for name, (words, unit, _, _) in ARROWS.items()]
    return [f"{words}, longest {peak:.3g} {unit}" for words, peak, unit in peaks if peak > 0.0]


def _rounded_up(value: float) -> float:
    """To two significant digits, for the labels of a colour bar; 1 of nothing."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit * (1.0 - 1e-9)) * unit:.2g}")


def _listed(rows: list[Any]) -> str:
    return "(" + "".join(f"\n    {row!r}," for row in rows) + ("\n)" if rows else ")")
