"""What README shows runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.impacts

ROOT = Path(__file__).parent.parent
PAGES = [Path("README.md"), *sorted(path.relative_to(ROOT) for path in (ROOT / "docs").glob("*.md"))]
LINKS = [
    (page, link)
    for page in PAGES
    for link in sorted(set(re.findall(r"\]\(((?!http)[^)#]+)\)", (ROOT / page).read_text(encoding="utf-8"))))
]


def ran(page):
    """Names that a page's script leaves."""
    text = (ROOT / page).read_text(encoding="utf-8")
    names: dict[str, object] = {}
    exec(compile("\n".join(re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)), page, "exec"), names)
    return names


def test_the_script_of_the_readme_runs_as_it_stands(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    names = ran("README.md")
    pyplot.close("all")
    assert (tmp_path / "response.png").stat().st_size > 10_000
    assert len(list((tmp_path / "modes").iterdir())) == 4
    # some millimetres: without the ball the resonance has some centimetres
    assert 2e-3 < names["curves"]["with ball"].peak_amplitude < 2e-2
    assert 4.5 < names["curves"]["with ball"].peak_frequency < 5.7
    assert names["run"].energy.residual < 1e-10
    # the errors of the first frequency fall with the fourth power of the element's length
    lines = [line for line in capsys.readouterr().out.splitlines() if re.match(r"\d+ \[", line)]
    first = [float(re.search(r"\[\s*([\d.]+)", line)[1]) for line in lines]
    assert len(first) == 4
    assert first[0] - first[1] > 8 * (first[1] - first[2])


def test_the_script_of_the_page_on_scripting_runs_as_it_stands(capsys):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    names = ran("docs/python.md")
    drawn = len(pyplot.get_fignums())
    pyplot.close("all")
    # the shapes and names are the public interface
    assert names["modes"].natural_frequency.shape == (4,)
    assert names["small"].dofs == 8
    assert len(names["runs"]) == 3
    np.testing.assert_array_equal(names["curve"].frequency, np.linspace(4, 6, 21))
    # the largest peak of the sweep: some millimetres, near the resonance of the beam with its ball
    peak, frequency = map(float, capsys.readouterr().out.splitlines()[0].split())
    assert 2e-3 < peak < 2e-2
    assert 4.5 < frequency < 5.7
    rigid = names["response"]
    assert len(rigid.impacts) > 100
    assert rigid.energy.residual < 1e-10
    # four figures of their own and one with two panels
    assert drawn == 5
    np.testing.assert_array_equal(names["motion"][0, 0].lines[2].get_ydata(), 1e3 * names["run"]["tip"])
    assert names["section"]["tip"].shape == (151,)


def test_the_pages_on_paraview_and_root_stress_run_as_they_stand(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/mode_shapes_in_paraview.md")
    assert len(names["blocks"]) == 4
    assert len(list((tmp_path / "mode_2").iterdir())) == 24
    names = ran("docs/root_stress.md")
    # under a static moment the root's stress is that moment over the section modulus; inertia and damping add little
    modulus = 0.02 * 1e-3**2 / 6
    moment = np.abs(names["run"]["root.reaction_moment"]).max()
    assert np.abs(names["stress"]).max() == pytest.approx(moment / modulus, rel=0.02)
    written = np.loadtxt(tmp_path / "root_stress.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(written[:, 1], names["stress"])
    for page in ("modes_paraview.py", "mode_2_paraview.py", "deflection_paraview.py"):
        compile((tmp_path / page).read_text(encoding="utf-8"), page, "exec")
    assert "MPa" in capsys.readouterr().out


@pytest.mark.parametrize(("page", "link"), LINKS)
def test_links_lead_somewhere(page, link):
    assert (ROOT / page.parent / link).exists()


def test_the_two_commands_stand_on_lines_of_their_own():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert """python3 -m venv .venv && .venv/bin/pip install -e ".[movie,test]" && .venv/bin/femimpact demo""" in lines
    assert ".venv/bin/python -m pytest" in lines
