"""Make pictures of pages from the results of the demo: `python docs/pictures/make_overview.py femimpact-demo`.

`overview.png` of the first page of the site has a frame of the movie above the response curve, as wide as the frame.
`paper_response.png` is the curve, and `report.png` the head of the report, where there is Chromium to draw it.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import imageio_ffmpeg
from PIL import Image

SHARE = 0.37
"""Of the movie before its frame: the ball is between its walls."""


def frame_of(movie: Path) -> Image.Image:
    """One frame of a movie."""
    count = imageio_ffmpeg.count_frames_and_secs(str(movie))[0]
    frames = imageio_ffmpeg.read_frames(str(movie))
    size = next(frames)["size"]
    for number, data in enumerate(frames):
        if number >= SHARE * count:
            return Image.frombytes("RGB", size, data)
    raise ValueError(f"{movie}: no frame")


def draw_report(page: Path, target: Path) -> None:
    """Write the first 1100 by 900 pixels of a page as a browser shows them."""
    browser = shutil.which("chromium")
    if browser is None:
        print(f"no chromium here: {target.name} stays as it is")
        return
    with tempfile.TemporaryDirectory() as directory:
        whole = Path(directory) / "whole.png"
        options = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1100,900")
        command = [browser, *options, f"--user-data-dir={directory}", f"--screenshot={whole}", page.resolve().as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        with Image.open(whole) as picture:
            picture.convert("RGB").quantize(256).save(target, optimize=True)


def main(results: Path) -> Path:
    """Write the pictures beside this file; the path of the first."""
    target = Path(__file__).with_name("overview.png")
    draw_report(results / "report.html", target.with_name("report.png"))
    above = frame_of(results / "movie.mp4")
    with Image.open(results / "figures" / "response.png") as picture:
        size = (above.width, round(picture.height * above.width / picture.width))
        # a few hundred colours are enough for a drawing
        picture.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(
            target.with_name("paper_response.png"), optimize=True
        )
        below = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    whole = Image.new("RGB", (above.width, above.height + below.height), "white")
    whole.paste(above, (0, 0))
    whole.paste(below, (0, above.height))
    whole.quantize(256, dither=Image.Dither.NONE).save(target, optimize=True)
    return target


if __name__ == "__main__":
    print(main(Path(sys.argv[1])))
