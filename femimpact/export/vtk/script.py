"""A script for pvpython and for ParaView's own script window, which opens a series ready to look at."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.export.files import atomic_write
from femimpact.export.scene_pieces import BEAM, CONTACT_POINT, PARTS
from femimpact.export.vtk.series import Frame, Series

__all__ = ["DEFLECTION", "MODE", "MODES", "View", "Watch", "script_path", "write_script"]

COLOURS = {
    "box": (0.48, 0.54, 0.60), "ball": (0.0, 0.447, 0.698), "support": (0.2, 0.2, 0.2), "body": (0.60, 0.65, 0.70),
    "stop": (0.35, 0.35, 0.35), "spring or dashpot": (0.0, 0.62, 0.45),
}  # fmt: skip
"""Of the parts that carry no field."""

ARROWS = {"contact_force_vector": ("green: contact force", "N", 0.1), "contact_impulse_vector":
          ("orange: impulse of the impact", "N s", 0.15)}  # fmt: skip
"""Vectors that are shown as arrows: words, unit, and the longest arrow as a share of the length of what is drawn."""


@dataclass(frozen=True)
class View:
    """What a script shows: its words, and what its text at the top is made of.

    Parameters
    ----------
    title : str
        Of the docstring.
    text : str
        Expression of ParaView's Python annotation, on the field data.
    stress_title : str
        Of the colour bar.
    """

    title: str
    text: str
    stress_title: str


DRAWN_STRESS = "axial stress (MPa) of the drawn deflection"
MODES = View(
    "Mode shapes, one time value for each mode: its number.",
    "'mode %d: %.5g Hz' % (mode[0], natural_frequency[0])",
    DRAWN_STRESS,
)
MODE = View(
    "One mode over one period: press Play.",
    "'mode %d: %.5g Hz, phase %3.0f degrees' % (mode[0], natural_frequency[0], 57.29577951 * phase[0])",
    DRAWN_STRESS,
)
DEFLECTION = View(
    "The moving beam, with arrows of the contact forces and, at an impact, of its impulse.",
    "'t = %.5f s%s%s' % (t_value, ', impact' if impact[0] else '', "
    "', displacement drawn %g times as large' % exaggeration[0] if exaggeration[0] != 1 else '')",
    "axial stress (MPa)",
)


class Watch:
    """What a script must know of all frames: the space that they fill, and the largest stress, force and impulse."""

    def __init__(self) -> None:
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.peaks = dict.fromkeys(("axial_stress", *ARROWS), 0.0)
        self.parts: list[int] = []

    def watched(self, series: Series) -> Series:
        """The same series, whose frames are looked at when they are made."""

        def frame(k: int) -> Frame:
            found = series.frame(k)
            moved = series.points + found.points["displacement"]
            self.low, self.high = np.minimum(self.low, moved.min(axis=0)), np.maximum(self.high, moved.max(axis=0))
            for name in self.peaks:
                self.peaks[name] = max(self.peaks[name], float(np.abs(found.points.get(name, 0.0)).max()))
            self.parts = [int(part) for part in np.unique(found.cells["part"])]
            return found

        return replace(series, frame=frame)


def script_path(path: Path) -> Path:
    """Where the script of a series stands: NAME_paraview.py beside NAME.pvd."""
    return path.with_name(f"{path.stem}_paraview.py")


def write_script(path: Path, view: View, watch: Watch) -> Path:
    """Write the script of a series.

    Parameters
    ----------
    path : Path
        Of the series.
    view : View
    watch : Watch
        Of the series that was written.

    Returns
    -------
    Path
    """
    size = float(watch.high[0] - watch.low[0])
    parts = [(number, PARTS[number], COLOURS[PARTS[number]]) for number in watch.parts if PARTS[number] in COLOURS]
    arrows, legend = [], []
    for name, (words, unit, share) in ARROWS.items():
        if watch.peaks[name] > 0.0:
            arrows.append((name, share * size / watch.peaks[name]))
            legend.append(f"{words}, at most {watch.peaks[name]:.3g} {unit}")
    lines = {
        "TITLE": view.title,
        "STEM": script_path(path).name,
        "FILE": path.name,
        "TEXT": view.text,
        "STRESS": view.stress_title,
        "LARGEST": repr(_rounded_up(1e-6 * watch.peaks["axial_stress"])),
        "BOUNDS": repr(tuple(float(value) for pair in zip(watch.low, watch.high, strict=True) for value in pair)),
        "PARTS": _listed(parts),
        "ARROWS": _listed(arrows),
        "LEGEND": repr("\n".join(legend)),
        "BEAM": str(BEAM),
        "MARKS": str(CONTACT_POINT),
    }
    text = TEMPLATE
    for name, value in lines.items():
        text = text.replace(f"@{name}@", value)
    script = script_path(path)
    atomic_write(script, text)
    return script


def _rounded_up(value: float) -> float:
    """To two significant digits, for the labels of a colour bar; 1 of nothing."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit * (1.0 - 1e-9)) * unit:.2g}")


def _listed(rows: list[Any]) -> str:
    return "(" + "".join(f"\n    {row!r}," for row in rows) + ("\n)" if rows else ")")


TEMPLATE = '''"""@TITLE@

Written by femimpact. In ParaView: View > Python Shell > Run Script. In a terminal:

    pvpython @STEM@                         a window
    pvpython @STEM@ PICTURE.png [TIME]      a picture at a time value, the last one unless given

The data is expected beside this script.
"""

import os
import sys

from paraview.simple import *

try:
    SCRIPT = __file__
except NameError:
    SCRIPT = sys._getframe().f_code.co_filename
DATA = os.path.join(os.path.dirname(os.path.abspath(SCRIPT)), "@FILE@")
if not os.path.isfile(DATA):
    raise RuntimeError(DATA + " is missing: run this script from its file, beside @FILE@")

LARGEST_STRESS = @LARGEST@  # MPa, of all frames
BOUNDS = @BOUNDS@  # m, of all frames
# number, name and colour of the parts that carry no field
PARTS = @PARTS@
# vectors at points of contact, and metres of arrow for each unit
ARROWS = @ARROWS@
LEGEND = @LEGEND@

reader = OpenDataFile(DATA)
RenameSource("@FILE@", reader)
scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
times = list(reader.TimestepValues)

view = GetActiveViewOrCreate("RenderView")
view.UseColorPaletteForBackground = 0
view.Background = [1.0, 1.0, 1.0]
view.OrientationAxesVisibility = 1
view.OrientationAxesLabelColor = [0.0, 0.0, 0.0]

warp = WarpByVector(registrationName="moved", Input=reader)
warp.Vectors = ["POINTS", "displacement"]
warp.ScaleFactor = 1.0


def part(number, name):
    """Cells of one part."""
    chosen = Threshold(registrationName=name, Input=warp)
    chosen.Scalars = ["CELLS", "part"]
    chosen.LowerThreshold = chosen.UpperThreshold = number
    return chosen


beam = Calculator(registrationName="stress in MPa", Input=part(@BEAM@, "beam"))
beam.Function, beam.ResultArrayName = "axial_stress / 1e6", "axial_stress_MPa"
shown = Show(beam, view)
ColorBy(shown, ("POINTS", "axial_stress_MPa"))
colours = GetColorTransferFunction("axial_stress_MPa")
colours.ApplyPreset("Cool to Warm (Extended)", True)
colours.AutomaticRescaleRangeMode = "Never"
colours.RescaleTransferFunction(-LARGEST_STRESS, LARGEST_STRESS)
bar = GetScalarBar(colours, view)
bar.Title, bar.ComponentTitle = "@STRESS@", ""
bar.TitleColor = bar.LabelColor = [0.0, 0.0, 0.0]
bar.Orientation, bar.WindowLocation = "Horizontal", "Lower Center"
bar.ScalarBarLength = 0.4
bar.TitleFontSize, bar.LabelFontSize = 16, 14
bar.UseCustomLabels, bar.AddRangeLabels = 1, 0
bar.CustomLabels = [0.5 * k * LARGEST_STRESS for k in range(-2, 3)]
shown.SetScalarBarVisibility(view, True)

for number, name, colour in PARTS:
    display = Show(part(number, name), view)
    display.ColorArrayName = [None, ""]
    display.DiffuseColor = display.AmbientColor = colour
    display.LineWidth = 4.0

if ARROWS:
    marks = part(@MARKS@, "points of contact")
for name, length in ARROWS:
    arrows = Glyph(registrationName=name, Input=marks, GlyphType="Arrow")
    arrows.OrientationArray = ["POINTS", name]
    arrows.ScaleArray = ["POINTS", name]
    arrows.ScaleFactor = length
    arrows.GlyphMode = "All Points"
    if "force" in name:
        arrows.GlyphType.ShaftRadius, arrows.GlyphType.TipRadius = 0.05, 0.14
    display = Show(arrows, view)
    display.ColorArrayName = [None, ""]
    colour = [0.84, 0.37, 0.0] if "impulse" in name else [0.0, 0.62, 0.45]
    display.DiffuseColor = display.AmbientColor = colour

text = PythonAnnotation(registrationName="text", Input=reader)
text.ArrayAssociation = "Field Data"
text.Expression = "@TEXT@"
written = Show(text, view)
written.Color = [0.0, 0.0, 0.0]
written.FontSize = 20

if LEGEND:
    legend = Text(registrationName="arrows", Text=LEGEND)
    written = Show(legend, view)
    written.Color, written.FontSize, written.WindowLocation = [0.0, 0.0, 0.0], 14, "Upper Right Corner"

low, high = BOUNDS[0::2], BOUNDS[1::2]
centre = [0.5 * (a + b) for a, b in zip(low, high)]
size = [b - a for a, b in zip(low, high)]
distance = 3.0 * max(size)
view.CameraParallelProjection = 1
view.CameraFocalPoint = centre
view.CameraPosition = [centre[0] + 0.25 * distance, centre[1] + 0.45 * distance, centre[2] + distance]
view.CameraViewUp = [0.0, 1.0, 0.0]
pixels = [1280, 720]
view.CameraParallelScale = 0.6 * max(size[1] + 0.4 * size[2], (size[0] + 0.25 * size[2]) * pixels[1] / pixels[0])

scene.AnimationTime = times[0]
if len(sys.argv) > 1 and sys.argv[1].endswith(".png"):
    scene.AnimationTime = min(times, key=lambda t: abs(t - float(sys.argv[2]))) if len(sys.argv) > 2 else times[-1]
    view.ViewSize = pixels
    SaveScreenshot(sys.argv[1], view, ImageResolution=pixels)
else:
    Render()
    if "pvpython" in os.path.basename(sys.executable or ""):
        Interact()
'''
