"""Text of the scripts for pvpython and for ParaView's own script window; names between @ are filled in by `script`."""

from __future__ import annotations

__all__ = ["TEMPLATE"]

TEMPLATE = '''"""@TITLE@

Written by femimpact. In ParaView: View > Python Shell > Run Script. In a terminal:

    pvpython @STEM@                         a window
    pvpython @STEM@ PICTURE.png [TIME]      a picture at a time value, START unless given

The data is expected beside this script. START and CLOSE_UP are there to be changed.
"""

import os
import sys

from paraview.simple import *

START = @START@  # the time value shown first: @WHY@
CLOSE_UP = @CLOSE_UP@  # what a second view looks at, a name of CLOSE_UPS; None: no second view

try:
    SCRIPT = __file__
except NameError:
    SCRIPT = sys._getframe().f_code.co_filename
DATA = os.path.join(os.path.dirname(os.path.abspath(SCRIPT)), "@FILE@")
if not os.path.isfile(DATA):
    raise RuntimeError(DATA + " is missing: run this script from its file, beside @FILE@")

# end of the colour bar, and its title: one for each time value, or one for all
BARS = @BARS@
COLOUR = @COLOUR@  # array that colours the beam
BOUNDS = @BOUNDS@  # m, of all frames
# m, of all frames, with the longest arrow
CLOSE_UPS = @CLOSE_UPS@
# number, name, colour and width of lines of the parts that carry no field
PARTS = @PARTS@
# vectors at points of contact, metres of arrow for each unit, metres along x beside the contact, colour
ARROWS = @ARROWS@
LEGEND = @LEGEND@
BLACK = [0.0, 0.0, 0.0]
TEXT, BAR = 0.13, 0.15  # of the height, for the text above the beam and the colour bar below it
SHARE = 0.64  # of the width, for the first of two views
TILT, CLOSE_TILT = 0.5, 0.1  # of the line of sight, towards y
NAME = "whole beam"

reader = OpenDataFile(DATA)
RenameSource("@FILE@", reader)
scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
times = list(reader.TimestepValues)
if len(sys.argv) > 2 and sys.argv[1].endswith(".png"):
    START = float(sys.argv[2])
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
beam.Function, beam.ResultArrayName = @CALCULATED@, COLOUR
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
text.Expression = @TEXT@
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
alone = sys.argv[0].endswith("@STEM@")
if alone:
    layout.SetSize(PIXELS)
if len(sys.argv) > 1 and sys.argv[1].endswith(".png"):
    SaveScreenshot(sys.argv[1], layout, ImageResolution=PIXELS)
else:
    RenderAllViews()
    if alone:
        Interact(view)
'''
