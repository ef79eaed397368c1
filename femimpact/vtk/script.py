"""The script for ParaView that opens the files of a folder: its template, and what is filled in."""

from __future__ import annotations

import ast
import math
import pprint
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.files import atomic_write
from femimpact.scene.scene import BEAM, CONNECTION, CONTACT_POINT, PARTS
from femimpact.vtk.formats import Frame, Series
from femimpact.vtk.modes import RELATIVE_STRESS, largest_known

TEMPLATE = '''"""Opens the files for ParaView that lie beside this script.

Written by femimpact. In ParaView: View > Python Shell > Run Script. In a terminal:

    pvpython @SCRIPT@ [FILE]                         a window
    pvpython @SCRIPT@ [FILE] PICTURE.png [TIME]      a picture at a time value, START unless given

FILE below is opened unless another one is given. It is there to be changed, as START and CLOSE_UP of each file.
"""

import os
import sys

from paraview.simple import *

FILE = @FILE@

# START: the time value shown first. CLOSE_UP: what a second view looks at, a name of CLOSE_UPS; None: no second view.
# WORDS: expression of the text at the top. COLOUR: array that colours the beam, CALCULATED: the expression of it.
# BARS: end of the colour bar, and its title; one for each time value, or one for all.
# BOUNDS: m, of all frames. CLOSE_UPS: m, of all frames, with the longest arrow.
# PARTS: number, name, colour and width of lines of the parts that carry no field.
# ARROWS: vectors at points of contact, metres of arrow for each unit, metres along x beside the contact, colour.
FILES = @FILES@

try:
    SCRIPT = __file__
except NameError:
    SCRIPT = sys._getframe().f_code.co_filename
arguments = sys.argv[1:]
if arguments and not arguments[0].endswith(".png"):
    FILE = os.path.basename(arguments.pop(0))
if FILE not in FILES:
    raise RuntimeError("%s: must be one of %s" % (FILE, ", ".join(FILES)))
DATA = os.path.join(os.path.dirname(os.path.abspath(SCRIPT)), FILE)
if not os.path.isfile(DATA):
    raise RuntimeError(DATA + " is missing: run this script from its file, beside " + FILE)
globals().update(FILES[FILE])
BLACK = [0.0, 0.0, 0.0]
TEXT, BAR = 0.13, 0.15  # of the height, for the text above the beam and the colour bar below it
SHARE = 0.64  # of the width, for the first of two views
TILT, CLOSE_TILT = 0.5, 0.1  # of the line of sight, towards y
NAME = "whole beam"

reader = OpenDataFile(DATA)
RenameSource(FILE, reader)
scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
times = list(reader.TimestepValues)
if arguments[1:]:
    START = float(arguments[1])
start = min(times, key=lambda t: abs(t - START))
if not times[0] <= START <= times[-1]:
    print("%g is outside %g to %g: %g is shown" % (START, times[0], times[-1], start), file=sys.stderr)


def part(number, name, source):
    """Cells of one part."""
    chosen = Threshold(registrationName=name, Input=source)
    chosen.Scalars = ["CELLS", "part"]
    chosen.LowerThreshold = chosen.UpperThreshold = number
    return chosen


def edges(source, name):
    """Edges of the beam's solid."""
    surface = ExtractSurface(registrationName="surface of " + name, Input=source)
    return FeatureEdges(registrationName=name, Input=surface)


warp = WarpByVector(registrationName="moved", Input=reader)
warp.Vectors = ["POINTS", "displacement"]
warp.ScaleFactor = 1.0

solid = part(@BEAM@, "beam", warp)
beam = Calculator(registrationName="stress", Input=solid)
beam.Function, beam.ResultArrayName = CALCULATED, COLOUR
# source, colour, width of lines, whether the edges of its cells are drawn: a ball has facets
drawn = [(part(number, name, warp), colour, width, name != "ball") for number, name, colour, width in PARTS]
drawn.append((edges(solid, "edges of the beam"), (0.25, 0.25, 0.25), 1.0, False))
drawn.append((edges(part(@BEAM@, "beam at rest", reader), "outline at rest"), (0.6, 0.6, 0.6), 1.5, False))
if ARROWS:
    marks = part(@MARKS@, "points of contact", warp)
for name, length, beside, colour in ARROWS:
    place = Transform(registrationName="place of " + name, Input=marks)
    place.Transform.Translate = [beside, 0.0, 0.0]
    arrows = Glyph(registrationName=name, Input=place, GlyphType="Arrow")
    arrows.OrientationArray = ["POINTS", name]
    arrows.ScaleArray = ["POINTS", name]
    arrows.ScaleFactor = length
    arrows.GlyphMode = "All Points"
    drawn.append((arrows, colour, 1.0, False))

colours = GetColorTransferFunction(COLOUR)
colours.ApplyPreset("Cool to Warm", True)
colours.AutomaticRescaleRangeMode = "Never"


def draw(view):
    """Show everything in a view; surfaces with stress have the very colours of the bar, whatever the light."""
    view.UseColorPaletteForBackground = 0
    view.Background = [1.0, 1.0, 1.0]
    view.OrientationAxesLabelColor = BLACK
    view.KeyLightWarmth = view.FillLightWarmth = view.BackLightWarmth = view.HeadLightWarmth = 0.5
    shown = Show(beam, view)
    ColorBy(shown, ("POINTS", COLOUR))
    shown.SetScalarBarVisibility(view, False)
    shown.Ambient, shown.Diffuse, shown.Specular = 1.0, 0.0, 0.0
    for source, colour, width, edged in drawn:
        display = Show(source, view)
        if edged:
            display.Representation, display.EdgeColor = "Surface With Edges", [0.2, 0.2, 0.2]
        display.ColorArrayName = [None, ""]
        display.DiffuseColor = display.AmbientColor = colour
        display.LineWidth, display.Ambient, display.Diffuse = width, 0.4, 0.6
    return shown


def seen(bounds, tilt):
    """Width and height (m) of a box in a picture that looks at it from a little above."""
    width, high, deep = [b - a for a, b in zip(bounds[0::2], bounds[1::2])]
    return width, (high + tilt * deep) / (1.0 + tilt**2) ** 0.5


def aim(view, bounds, pixels, tilt=TILT):
    """A parallel projection along z, from a little above: lengths along x are true, and the beam at rest is level."""
    width, height = seen(bounds, tilt)
    # of the picture, m: what is left by text and bar is filled
    tall = max(1.04 * height / (1.0 - TEXT - BAR), 1.04 * width * pixels[1] / pixels[0])
    centre = [0.5 * (a + b) for a, b in zip(bounds[0::2], bounds[1::2])]
    # upwards in the picture is across the line of sight
    for axis, share in ((1, 1.0), (2, -tilt)):
        centre[axis] += 0.5 * (TEXT - BAR) * tall * share / (1.0 + tilt**2) ** 0.5
    far = 3.0 * max(width, height)
    view.CameraParallelProjection = 1
    view.CameraFocalPoint = centre
    view.CameraPosition = [centre[0], centre[1] + tilt * far, centre[2] + far]
    view.CameraViewUp = [0.0, 1.0, 0.0]
    view.CameraParallelScale = 0.5 * tall


def write(view, source, size, place):
    """Show a text."""
    written = Show(source, view)
    written.Color, written.FontSize, written.WindowLocation = BLACK, size, place
    written.Justification = place.split()[1]


view = GetActiveViewOrCreate("RenderView")
RenameView(NAME, view)
# the first call of it chooses a camera, a later one does not
Render(view)
shown = draw(view)
bar = GetScalarBar(colours, view)
bar.ComponentTitle = ""
bar.TitleColor = bar.LabelColor = BLACK
bar.Orientation, bar.WindowLocation = "Horizontal", "Lower Center"
bar.ScalarBarLength = 0.5
bar.TitleFontSize, bar.LabelFontSize = 16, 14
bar.UseCustomLabels, bar.AddRangeLabels = 1, 0
shown.SetScalarBarVisibility(view, True)

text = PythonAnnotation(registrationName="text", Input=reader)
text.ArrayAssociation = "Field Data"
text.Expression = WORDS
write(view, text, 18, "Upper Left Corner")

layout = GetLayout(view)
PIXELS = [1280, 720]
if CLOSE_UP is None:
    # as high as what it shows asks for
    width, height = seen(BOUNDS, TILT)
    PIXELS = [1280, min(max(int(1280 * height / width / (1.0 - TEXT - BAR)), 480), 960)]
    aim(view, BOUNDS, PIXELS)
else:
    aim(view, BOUNDS, [SHARE * PIXELS[0], PIXELS[1]])
    close = CreateView("RenderView")
    AssignViewToLayout(view=close, layout=layout, hint=layout.SplitHorizontal(0, SHARE) + 1)
    draw(close)
    close.OrientationAxesVisibility = 0
    aim(close, CLOSE_UPS[CLOSE_UP], [(1.0 - SHARE) * PIXELS[0], PIXELS[1]], CLOSE_TILT)
    write(close, Text(registrationName="close-up", Text="close-up: " + CLOSE_UP), 18, "Upper Center")
    SetActiveView(view)
if LEGEND:
    legend = Text(registrationName="arrows", Text=LEGEND)
    write(view if CLOSE_UP is None else close, legend, 14, "Upper Right Corner" if CLOSE_UP is None else "Lower Center")

# ParaView runs it by itself at every change of the time
TICK = """
from paraview.simple import *

BARS = %r
TIMES = %r


def rescale(now):
    k = min(range(len(TIMES)), key=lambda i: abs(TIMES[i] - now))
    largest, title = BARS[min(k, len(BARS) - 1)]
    colours = GetColorTransferFunction(%r)
    colours.RescaleTransferFunction(-largest, largest)
    bar = GetScalarBar(colours, FindView(%r))
    bar.Title, bar.CustomLabels = title, [0.5 * i * largest for i in range(-2, 3)]


def start_cue(self):
    pass


def tick(self):
    rescale(self.GetClockTime())


def end_cue(self):
    pass
""" % (BARS, times, COLOUR, NAME)
cue = PythonAnimationCue(Script=TICK)
scene.Cues.append(cue)
scene.AnimationTime = start
space = {}
exec(TICK, space)
space["rescale"](start)

# in ParaView's window there is no script among the arguments
alone = sys.argv[0].endswith("@SCRIPT@")
if alone:
    layout.SetSize(PIXELS)
if arguments:
    SaveScreenshot(arguments[0], layout, ImageResolution=PIXELS)
else:
    RenderAllViews()
    if alone:
        Interact(view)
'''


COLOURS = {
    "box": (0.48, 0.54, 0.60), "ball": (0.0, 0.447, 0.698), "support": (0.2, 0.2, 0.2), "body": (0.60, 0.65, 0.70),
    "stop": (0.35, 0.35, 0.35), "spring or dashpot": (0.0, 0.62, 0.45),
}  # fmt: skip
"""Colours of the parts that carry no field."""

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
    """Expressions of the colours of a series and of the text at its top."""

    text: str  # expression of ParaView's Python annotation, on the field data
    # array that colours the beam, the expression of ParaView's calculator that makes it, and the title of its bar, in
    # which `{mode}` is the number of the mode
    stress: tuple[str, str, str]
    each: bool = False  # whether every frame has a separate colour bar, not all frames the same


OF_MODE = ("share_of_stress", RELATIVE_STRESS, "axial stress, as a share of the largest of mode {mode:.0f}")
IN_MPA = ("axial_stress_MPa", "axial_stress / 1e6", "axial stress (MPa)")
MODES = View(
    "'mode %d: %.5g Hz' % (mode[0], natural_frequency[0])",
    OF_MODE,
    each=True,
)
MODE = View(
    "'mode %d: %.5g Hz, phase %3.0f degrees' % (mode[0], natural_frequency[0], 57.29577951 * phase[0])",
    OF_MODE,
)
DEFLECTION = View(
    "name.GetValue(0).replace(', ', '\\n', 1) + '\\n' + contacts.GetValue(0)"
    " + ('\\ndisplacement drawn %g times as large' % exaggeration[0] if exaggeration[0] != 1 else '')",
    IN_MPA,
)


@dataclass(frozen=True, eq=False)
class FrameSummary:
    """Values of one frame that a script needs."""

    time: float
    mode: float  # its number; 0 of a deflection
    peaks: Mapping[str, float]  # largest axial stress (Pa), contact force (N) and impulse (N s), 0 where there is none
    # number of the contact with the largest impulse, or the largest force where there is no impulse; -1 for none
    pressed: int


class SeriesSummary:
    """Values of all frames that a script needs: the space that they and their contacts fill, and the largest arrays."""

    def __init__(self) -> None:
        self.all = Space()
        self.contacts: dict[int, Space] = {}
        self.frames: dict[int, FrameSummary] = {}
        self.parts: list[int] = []
        self.half_width = 0.0

    def gathering(self, series: Series) -> Series:
        """The same series, each of whose frames is added to the summary when it is made."""
        sizes = np.diff(series.offsets, prepend=0)

        def frame(k: int) -> Frame:
            fields = series.frame(k)
            moved = series.points + fields.points["displacement"]
            self.all.add(moved)
            pairs = fields.cells["contact_pair"]
            pair_of_entry, part_of_entry = np.repeat(pairs, sizes), np.repeat(fields.cells["part"], sizes)
            for pair in np.unique(pairs[pairs >= 0]):
                of_pair = series.connectivity[pair_of_entry == pair]
                self.contacts.setdefault(int(pair), Space()).add(moved[of_pair])
                marks = series.connectivity[(pair_of_entry == pair) & (part_of_entry == CONTACT_POINT)]
                # an absorber has no points of contact
                if marks.size:
                    reach = moved[of_pair, 0].max() - moved[marks, 0].min()
                    self.half_width = max(self.half_width, float(reach))
            self.parts = [int(part) for part in np.unique(fields.cells["part"])]
            self.frames[k] = _summary_of(series, fields, k, pair_of_entry)
            return fields

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
    peaks = {name: largest_known(frame.points.get(name, np.zeros(1))) for name in ("axial_stress", *ARROWS)}
    pressed = -1
    for name in ARROWS:
        if peaks[name] > 0.0:
            point = int(np.abs(frame.points[name][:, 1]).argmax())
            pressed = int(pair_of_entry[series.connectivity == point][0])
    mode = frame.fields.get("mode", 0.0)
    return FrameSummary(float(series.times[k]), mode if isinstance(mode, float) else 0.0, peaks, pressed)


def script_path(path: Path) -> Path:
    """Path of the script of a series, one for all in a folder."""
    return path.with_name("open_in_paraview.py")


def write_script(
    path: Path,  # of the series
    view: View,
    summary: SeriesSummary,  # of the series that was written
    names: Sequence[str] = (),  # of the contacts that a second view may show; none for no second view
) -> Path:
    """Write the script of a series, or add the series to that of its folder."""
    size = float(summary.all.high[0] - summary.all.low[0])
    first = _first(summary)
    # balls that meet, after all others, have no view of their own
    pressed = first.pressed if 0 <= first.pressed < len(names) else 0
    longest = size * max((share for name, (_, _, share, _) in ARROWS.items() if summary.peak(name) > 0.0), default=0.0)
    margins = ((len(ARROWS) + 1) * BESIDE * size, longest)
    close = {name: summary.contacts[pair].with_arrows(*margins).bounds() for pair, name in enumerate(names)}
    arrows = [(words, summary.peak(name), unit) for name, (words, unit, _, _) in ARROWS.items()]
    about = {
        "START": first.time,
        "CLOSE_UP": names[pressed] if names else None,
        "WORDS": view.text if path.suffix == ".pvd" else WITHOUT_FIELDS,
        "COLOUR": view.stress[0],
        "CALCULATED": view.stress[1],
        "BARS": _bars(view, summary),
        "BOUNDS": summary.all.with_arrows(*margins).bounds(),
        "CLOSE_UPS": close,
        "PARTS": _parts(summary),
        "ARROWS": _arrows(summary, size),
        "LEGEND": "\n".join(f"{words}, longest {peak:.3g} {unit}" for words, peak, unit in arrows if peak > 0.0),
    }
    script = script_path(path)
    lines = {
        "SCRIPT": script.name,
        "FILE": repr(path.name),
        "FILES": pprint.pformat({**_series_of(script), path.name: about}, width=118, sort_dicts=False),
        "BEAM": str(BEAM),
        "MARKS": str(CONTACT_POINT),
    }
    text = TEMPLATE
    for name, value in lines.items():
        text = text.replace(f"@{name}@", value)
    atomic_write(script, text)
    return script


def _series_of(script: Path) -> dict[str, Any]:
    """What a script says of each series that is still beside it; nothing where it is not there or not of femimpact."""
    with suppress(OSError, SyntaxError, ValueError, AttributeError, TypeError):
        lines = [line for line in ast.parse(script.read_text(encoding="utf-8")).body if isinstance(line, ast.Assign)]
        values = {ast.unparse(line.targets[0]): line.value for line in lines}
        series = ast.literal_eval(values.get("FILES", "{}"))
        return {name: about for name, about in series.items() if script.with_name(name).is_file()}
    return {}


def _first(summary: SeriesSummary) -> FrameSummary:
    """The frame that is shown first: of the largest impulse, else of the largest force, else the first one."""
    frames = [summary.frames[k] for k in sorted(summary.frames)]
    for name in ("contact_impulse_vector", "contact_force_vector"):
        if summary.peak(name) > 0.0:
            return max(frames, key=lambda frame: frame.peaks[name])
    return frames[0]


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
    arrows = [(name, share, colour) for name, (_, _, share, colour) in ARROWS.items() if summary.peak(name) > 0.0]
    return [
        (name, share * size / summary.peak(name), summary.half_width + (1 + i) * BESIDE * size, colour)
        for i, (name, share, colour) in enumerate(arrows)
    ]


def _rounded_up(value: float) -> float:
    """A value rounded up to two significant digits, for the labels of a colour bar; 1 for 0."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit * (1.0 - 1e-9)) * unit:.2g}")
