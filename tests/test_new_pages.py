"""Scripts of how-to pages print what the pages say, and what they rest on holds."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr
from command import femimpact
from test_readme import PICTURES, ROOT
from test_study_forces import HEAD, SINE

import femimpact as fi

pytestmark = pytest.mark.impacts


@pytest.fixture
def ran(monkeypatch, tmp_path, capsys):
    """Runs a page's script in an empty folder: its names, the lines that it prints, and those that the page has."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)

    def names_and_lines(name: str):
        page = ROOT / "docs" / "howto" / f"{name}.md"
        names = PICTURES["ran"](page)
        said = [line for block in PICTURES["blocks"](page, "text") for line in block.splitlines()]
        return names, capsys.readouterr().out.splitlines(), said

    yield names_and_lines
    pyplot.close("all")


def numbers(line: str) -> list[float]:
    return [float(each) for each in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", line)]


def test_the_page_on_ball_and_box(ran):
    names, printed, said = ran("ball_and_box")
    assert printed[:4] == said[:4]
    # the run is chaotic: on another processor its fastest impact differs
    np.testing.assert_allclose(numbers(printed[4]), numbers(said[4]), rtol=0.3)
    ball = names["ball"]
    assert np.pi / 6 * ball.diameter**3 * 7850.0 == pytest.approx(ball.mass, rel=1e-12)
    assert ball.box_mass(1e-9) == pytest.approx(0.0, abs=1e-8)
    # without a material nothing is made up
    assert np.isnan(fi.Impactor("ball", "tip", 3e-3, 4e-3, fi.Rigid(0.6)).box_length)


def test_the_report_says_whether_the_ball_fits(tmp_path):
    ball = PICTURES["blocks"](ROOT / "docs" / "howto" / "ball_and_box.md", "toml")[0].replace("4.0 mm", "0.2 mm")
    text = f"{HEAD}[damping]\nratio = 0.0029\nmodes = [1, 2]\n{ball}{SINE}[output]\nfigures = false\n"
    text = f"{text}paraview = false\nmovie = false\n"
    (tmp_path / "ball.toml").write_text(text, encoding="utf-8")
    done = femimpact("run", "ball.toml", "-o", "out", cwd=tmp_path)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    study = fi.load_study(tmp_path / "out" / "study.toml")
    (steel,) = study.structure.impactors
    assert (steel.material, steel.wall) == ("steel", "aluminium")
    with xr.open_dataset(tmp_path / "out" / "impacts.nc") as impacts:
        fastest = float(impacts["approach_speed"].max())
    force, pressure = steel.wall_pressure(fastest)
    table = page.partition("Balls and their boxes")[2].partition("</table>")[0]
    cells = [float(each) for each in re.findall(r'data-value="([\d.e+-]+)"', table)]
    expected = [1e3 * steel.diameter, 1e3 * steel.box_length, 1e3 * steel.box_mass(1e-3)]
    expected += [fastest, force, 1e-6 * pressure]
    np.testing.assert_allclose(cells, expected, rtol=1e-4)
    assert "Balls and their boxes" in done.stdout


def test_the_pressure_of_hertz_carries_the_force():
    # p0 sqrt(1 - (r/a)^2) over the circle of contact, a^3 = 3 F R/(4 E*), is the force
    force, radius, steel, aluminium = 40.0, 5e-3, fi.contact.STEEL, fi.contact.ALUMINIUM
    modulus = 1 / sum((1 - one.poisson_ratio**2) / one.young_modulus for one in (steel, aluminium))
    a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
    pressure = fi.contact.hertz_pressure(force, radius, steel, aluminium)
    assert 2 / 3 * np.pi * a**2 * pressure == pytest.approx(force, rel=1e-12)
    # the approach a^2/R under this force is that of the law
    stiffness = fi.contact.hertz_stiffness(radius, steel, aluminium)
    assert stiffness * (a**2 / radius) ** 1.5 == pytest.approx(force, rel=1e-12)


def test_a_bare_ball_meets_a_bare_wall_as_in_a_run_of_hertz():
    ball = fi.Impactor("ball", "tip", 4e-3, 1e-3, fi.Rigid(1.0), material="steel", wall="glass")
    law = fi.Hertz(fi.contact.hertz_stiffness(ball.diameter / 2, fi.contact.STEEL, fi.contact.Material(60e9, 0.23)))
    # a block that is far heavier than the ball is a wall
    balls = [fi.Impactor("ball", "tip", 4e-3, 1e-3, law)]
    heavy = fi.System.from_matrices([[1e4]], [[0.0]], [[1.0]], points={"tip": [1.0]}, impactors=balls)
    run = fi.integrate(heavy, fi.Sine(1e-9, 1.0), fi.Newmark(2e-7), 0.011, initial=fi.State(ball_velocity=[0.1]))
    force, pressure = ball.wall_pressure(0.1)
    assert run.impacts.peak_force[0] == pytest.approx(force, rel=1e-3)
    walls = fi.contact.STEEL, fi.contact.Material(60e9, 0.23)
    assert pressure == fi.contact.hertz_pressure(force, ball.diameter / 2, *walls)
