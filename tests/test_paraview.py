"""Scripts for ParaView, run by its own pvpython; asked for by FEMIMPACT_PARAVIEW=1, for it takes a minute.

Debian: apt-get install paraview python3-paraview xvfb. FEMIMPACT_PARAVIEW_PICTURES names a folder for the pictures.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from builders import REFERENCE, reduced
from test_paraview_scripts import constants

import femimpact as fi
from femimpact import vtk
from femimpact.vtk.script import script_path

PVPYTHON, XVFB = shutil.which("pvpython"), shutil.which("Xvfb")
asked = pytest.mark.skipif(not os.environ.get("FEMIMPACT_PARAVIEW"), reason="asked for by FEMIMPACT_PARAVIEW=1")


@pytest.fixture(scope="module")
def display():
    """A display that this process started, unless there is one."""
    if os.environ.get("DISPLAY"):
        yield os.environ["DISPLAY"]
        return
    assert XVFB, "needs Xvfb, or a display"
    read, write = os.pipe()
    # without -noreset the server begins anew after its last client, and refuses the next one meanwhile
    command = [XVFB, "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset"]
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        with os.fdopen(read) as number:
            name = number.readline().strip()
        yield f":{name}"
        server.terminate()


def picture(path, display, *time):
    """What pvpython draws of a file that was moved with its script, as pixels (rows, columns, 3)."""
    from PIL import Image

    folder = Path(os.environ.get("FEMIMPACT_PARAVIEW_PICTURES", path.parent))
    target = folder / ("_".join([path.stem, *map(str, time)]) + ".png")
    done = subprocess.run(
        [PVPYTHON, script_path(path), path.name, target, *map(str, time)], cwd="/",
        env={**os.environ, "DISPLAY": display}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "rror" not in done.stderr + done.stdout
    with Image.open(target) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def share(pixels, colour, tolerance=40):
    """Share of pixels near a colour of hue: its channels, normalised by the brightest."""
    bright = pixels.max(axis=2)
    scaled = 255 * pixels / np.maximum(bright, 1)[..., None]
    wanted = 255 * np.array(colour) / max(colour)
    return float(np.mean((np.abs(scaled - wanted).max(axis=2) < tolerance) & (bright > 50)))


@asked
def test_modes_are_drawn_with_stress_colours_text_and_bar(tmp_path, system, reference, display):
    made = tmp_path / "made"
    made.mkdir()
    modes = fi.solve_modes(system, 3)
    paths = [vtk.write_modes(made / "modes.pvd", system, modes, reference)]
    paths.append(vtk.write_mode(made / "mode_2.pvd", system, modes, reference, mode=2))
    # paths in the scripts are relative to themselves
    moved = made.rename(tmp_path / "moved")
    for path in paths:
        pixels = picture(moved / path.name, display, *([3] if path.stem == "modes" else []))
        # tension red, compression blue, what is around them white, and black text at the top on the left
        redder = pixels[..., 0] - pixels[..., 2]
        assert np.mean(redder > 60) > 0.005
        assert np.mean(redder < -60) > 0.005
        # the surfaces with stress have the colours of the bar: no light changes them
        bar = pixels[len(pixels) - 12, 322:958]
        assert np.ptp(bar[len(bar) // 2]) < 10
        beam = pixels[100 : len(pixels) - 100, 100:1000].reshape(-1, 3)
        beam, count = np.unique(beam[np.ptp(beam, axis=1) > 60], axis=0, return_counts=True)
        nearest = np.abs(beam[:, None] - bar[None]).max(axis=2).min(axis=1)
        # but for the ball, and for pixels on edges, which are of both colours beside them
        assert np.average(nearest <= 3, weights=count) > 0.8
        assert np.mean(pixels.min(axis=2) == 255) > 0.6
        assert np.mean(pixels[:40, :420].max(axis=2) < 128) > 0.005
        assert np.mean(pixels[-80:, 320:960].min(axis=2) < 128) > 0.05


@asked
def test_without_a_picture_a_window_stays_open(tmp_path, system, reference, display):
    path = vtk.write_modes(tmp_path / "modes.pvd", system, fi.solve_modes(system, 1), reference)
    command = [PVPYTHON, script_path(path)]
    with subprocess.Popen(command, env={**os.environ, "DISPLAY": display}) as window:
        # it is drawn within a few seconds, and what closes by itself would have closed
        with pytest.raises(subprocess.TimeoutExpired):
            window.wait(20.0)
        window.terminate()


STEPS = """
import sys
path = sys.argv[1]
# as in ParaView's window: the script does not wait for a window
sys.argv = [""]
space = {"__file__": path, "__name__": "__main__"}
with open(path) as file:
    exec(compile(file.read(), path, "exec"), space)
for step in ("GoToNext", "GoToLast", "GoToPrevious"):
    getattr(space["scene"], step)()
    print(space["bar"].Title, space["colours"].RGBPoints[-4])
"""


@asked
def test_the_colour_bar_is_that_of_the_mode_when_the_time_is_stepped(tmp_path, system, reference, display):
    path = vtk.write_modes(tmp_path / "modes.pvd", system, fi.solve_modes(system, 4), reference)
    (tmp_path / "steps.py").write_text(STEPS)
    done = subprocess.run(
        [PVPYTHON, tmp_path / "steps.py", script_path(path)], env={**os.environ, "DISPLAY": display},
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    bars = constants(path)["BARS"]
    assert done.stdout.splitlines() == [f"{title} {end}" for end, title in (bars[1], bars[3], bars[2])]


@asked
def test_impacts_are_drawn_with_arrows(tmp_path, display):
    record = fi.Recorder(channels=("tip",), snapshots=8, snapshots_start=2.0)
    run = fi.integrate(reduced(REFERENCE), fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 4.0, record)
    path = vtk.write_deflection(tmp_path / "deflection.pvd", run, REFERENCE)
    late = run.impacts.time >= 2.0
    hardest = run.impacts.time[late][np.argmax(run.impacts.impulse[late])]
    orange = [share(picture(path, display, time), (214, 94, 0), 30) for time in (hardest, 2.0)]
    assert orange[0] > 0.0005
    assert orange[1] < 0.1 * orange[0]
