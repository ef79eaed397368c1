"""Scripts of how-to pages print what the pages say, and what they rest on holds."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from builders import read_study, same_study, study_text
from command import femimpact
from test_readme import PICTURES, ROOT
from test_study_forces import HEAD, REST, SINE, read

import femimpact as fi
from femimpact.app.parametric.paths import paths_of_study, study_with
from femimpact.excitation.drives import drive_words
from femimpact.files import read_csv

pytestmark = pytest.mark.impacts


@pytest.fixture
def ran(monkeypatch, tmp_path, capsys):
    """Runs a page's script in an empty folder: its names, the lines that it prints, and those that the page has."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)

    def names_and_lines(name: str):
        page = ROOT / "docs" / "howto" / f"{name}.md"
        for number, block in enumerate(PICTURES["blocks"](page, "toml")):
            Path("mast.toml" if number == 0 else f"{number}.toml").write_text(block, encoding="utf-8")
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
    # of a heavier material a ball is smaller, and stiffer ones press harder
    tungsten, wc = (fi.Impactor("ball", "tip", 3e-3, 4e-3, fi.Rigid(0.6), material=name, wall="steel")
                    for name in ("tungsten", "tungsten-carbide"))  # fmt: skip
    assert np.pi / 6 * tungsten.diameter**3 * 19300.0 == pytest.approx(3e-3, rel=1e-12)
    assert tungsten.diameter < wc.diameter < ball.diameter
    assert wc.wall_pressure(0.1)[1] > replace(wc, material="steel").wall_pressure(0.1)[1]
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
    # in the beam it is only where this is larger
    expected += [1e3 * study.structure.beam.segments[0].thickness]
    expected += [fastest, force, 1e-6 * pressure]
    np.testing.assert_allclose(cells, expected, rtol=1e-4)
    assert "Balls and their boxes" in done.stdout


def test_the_pressure_at_the_wall_is_the_formula_of_hertz():
    ball = fi.Impactor("ball", "tip", 4e-3, 1e-3, fi.Rigid(0.6), material="steel", wall="aluminium")
    force, pressure = ball.wall_pressure(0.2)
    # p0 sqrt(1 - (r/a)^2) over the circle of contact, a^3 = 3 F R/(4 E*), is the force
    walls = fi.contact.STEEL, fi.contact.ALUMINIUM
    modulus = 1 / sum((1 - one.poisson_ratio**2) / one.young_modulus for one in walls)
    radius = (3 * 4e-3 / (4 * np.pi * 7850.0)) ** (1 / 3)
    a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
    assert 2 / 3 * np.pi * a**2 * pressure == pytest.approx(force, rel=1e-12)
    assert pressure == pytest.approx((6 * force * modulus**2 / (np.pi**3 * radius**2)) ** (1 / 3), rel=1e-12)


def test_a_bare_ball_meets_a_bare_wall_as_in_a_run_of_hertz():
    ball = fi.Impactor("ball", "tip", 4e-3, 1e-3, fi.Rigid(1.0), material="steel", wall="glass")
    law = fi.Hertz(fi.contact.hertz_stiffness(ball.diameter / 2, fi.contact.STEEL, fi.contact.Material(60e9, 0.23)))
    # a block that is far heavier than the ball is a wall
    balls = [fi.Impactor("ball", "tip", 4e-3, 1e-3, law)]
    heavy = fi.System.from_matrices([[1e4]], [[0.0]], [[1.0]], points={"tip": [1.0]}, impactors=balls)
    run = fi.integrate(heavy, fi.Sine(1e-9, 1.0), fi.Newmark(2e-7), 0.011, initial=fi.State(ball_velocity=[0.1]))
    assert run.impacts.peak_force[0] == pytest.approx(ball.wall_pressure(0.1)[0], rel=1e-3)


def test_the_page_on_sections(ran):
    _, printed, said = ran("sections")
    assert len(printed) == len(said) == 5
    for ours, theirs in zip(printed, said, strict=True):
        assert ours.split() == theirs.split()
        # moment over section modulus is the stress
        assert re.search(r"M/W ([\d.]+)", ours)[1] == re.search(r"stress ([\d.]+)", ours)[1]


def test_the_page_on_notebooks(ran):
    names, printed, said = ran("notebooks")
    kept = [[line for line in lines if "energy residual" not in line] for lines in (printed, said)]
    assert kept[0] == kept[1]
    run = names["run"]
    for record in (names["structure"], names["system"], run, run.impacts, fi.solve_modes(names["system"], 2)):
        assert record._repr_html_().startswith("<table>")
    assert "fi.figures.channels(response)" in run._repr_html_()
    assert Path("portrait.png").stat().st_size > 10_000
    assert Path("run.gif").read_bytes()[:3] == b"GIF"


def test_the_page_on_where_a_damper_works(ran):
    names, printed, said = ran("where_it_works")
    # orbits are the same on every processor; motions that do not repeat are not
    assert printed[6:23] == said[6:23]
    assert printed[26:] == said[26:]
    assert [row[:12] for row in printed[:6]] == [row[:12] for row in said[:6]]
    np.testing.assert_allclose([numbers(row)[1] for row in printed[23:26]], [0.48, 0.61, 2.2], rtol=0.5)
    # where an orbit is stable, runs find a periodic motion at 2 mm
    orbits, runs = (rows[2].split()[-1] for rows in (printed[6:12], printed[:6]))
    assert all(run == "p" for run, orbit in zip(runs, orbits, strict=True) if orbit == "S")
    assert names["over_frequency"].is_stable.any()


def test_the_page_on_which_ball(ran):
    names, printed, said = ran("which_ball")
    assert len(printed) == len(said) == 16
    # what has a closed form is the same on every processor, and the run that repeats
    exact = [0, 1, 2, 3, 4, *range(8, 16)]
    assert [printed[i] for i in exact] == [said[i] for i in exact]
    # shares of 20 starts, some of which are chaotic for long
    np.testing.assert_allclose([numbers(row)[1] for row in printed[5:8]], [0.0, 10.0, 100.0], atol=15.0)
    # of the two amplitudes of one harmonic each is 5 % off its orbit, which leaves nothing out
    curve, orbits = ([numbers(row)[0] for row in printed[first : first + 2]] for first in (8, 11))
    np.testing.assert_allclose(np.divide(curve, orbits), [0.95, 1.05], atol=0.005)
    table = read_csv("which_ball.csv")
    assert len(table["loss"]) == names["curve"]["motion_loss"].size
    assert Path("which_ball.png").stat().st_size > 10_000


def test_the_page_on_a_mast_in_the_wind(ran):
    names, printed, said = ran("mast_in_the_wind")
    assert printed[:5] == said[:5]
    # the study is chaotic in part: the best gap and its factor hold, digits of one start need not
    assert [re.sub(r"[\d.]+", "", line) for line in printed[5:8]] == [re.sub(r"[\d.]+", "", line) for line in said[5:8]]
    assert numbers(printed[6])[-1] == pytest.approx(numbers(said[6])[-1], rel=1e-3)
    # a first gap of a light loss, and a restitution of 0.5: the best one is 1.1 to 1.35 times it, as for a base
    assert 1.05 < numbers(printed[7])[-1] / numbers(printed[6])[-1] < 1.4
    worst = names["found"]["peak"].max("force.wind.frequency")
    assert float(worst.min()) < 0.3 * float(names["run"].steady.peak[0])
    assert Path("mast.html").stat().st_size > 10_000


MAST = fi.Structure(
    fi.Beam.tube(length=6.0, diameter=0.1143, wall=3.6e-3, young_modulus=210e9, density=7850.0),
    [fi.PointMass("box", at="tip", mass=3.0)],
    [fi.Impactor("ball", at="tip", mass=2.0, gap=0.05, contact=fi.Rigid(0.5))],
    damping=fi.Rayleigh(ratio=0.002, modes=(1, 2)),
)


def test_a_uniform_line_force_bends_a_cantilever_as_the_closed_form():
    full, line = fi.assemble(MAST, elements=3), fi.excitation.LineLoad(4.0)
    deflection = np.linalg.solve(full.K.toarray(), full.point_row(line))
    stiffness = full.section_at("root").bending_stiffness
    assert full.point_row("tip") @ deflection == pytest.approx(4.0 * 6.0**4 / (8 * stiffness), rel=1e-10)
    assert full.resultant(line) == pytest.approx(24.0, rel=1e-12)
    # of q = x^2 the integral is L^3/3, and that of q w for a rigid motion w = 1 as well
    assert full.resultant(fi.excitation.LineLoad(lambda x: x * x)) == pytest.approx(72.0, rel=1e-12)


@pytest.mark.parametrize("density", [3.0, lambda x: 0.1 * x**2], ids=["uniform", "growing"])
def test_a_line_force_is_a_force_at_the_tip_of_equal_work_near_mode_1(density):
    system = fi.reduce(fi.assemble(fi.structure.glue_impactors(MAST), elements=10), 3)
    modes = fi.solve_modes(system, 1)
    line = fi.LineForce(density, fi.Sine(1.0, modes.natural_frequency[0]))
    phi = modes.vectors[:, 0]
    tip = (system.point_row(line.at) @ phi) / (system.point_row("tip") @ phi)
    record = fi.Recorder(channels=("tip", "shaker_force", "root.reaction_force", "root.reaction_moment"))
    runs = [
        fi.integrate(system, drive, fi.EventDriven(), 60.0, record)
        for drive in (line, fi.PointForce("tip", fi.Sine(tip, modes.natural_frequency[0])))
    ]
    for run in runs:
        assert run.energy.residual < 1e-10
    for name, bound in (("tip", 1e-3), ("shaker_force", 0.01), ("root.reaction_force", 0.01)):
        largest = [np.abs(run[name]).max() for run in runs]
        assert largest[0] == pytest.approx(largest[1], rel=bound)
    # the other modes feel the difference
    assert not np.allclose(runs[0]["root.reaction_moment"], runs[1]["root.reaction_moment"], rtol=1e-9, atol=0.0)


def test_reactions_are_less_by_what_of_a_line_force_acts_on_them():
    # at rest under a constant force a support carries all of it, also that on its own held dof; without damping in
    # proportion to the mass nothing else acts between structure and base
    full = fi.assemble(replace(MAST, impactors=(), damping=None), elements=5)
    slow = fi.LineForce(2.0, fi.Sine(1.0, 1e-4))
    record = fi.Recorder(channels=("shaker_force", "root.reaction_force", "root.reaction_moment"))
    run = fi.integrate(full, slow, fi.Newmark(1e-2), 1.0, record)
    np.testing.assert_allclose(run["shaker_force"], run["root.reaction_force"], atol=1e-9 * 12.0)
    total = slow.force(run.time) * 12.0
    np.testing.assert_allclose(run["root.reaction_force"][-1], -total[-1], rtol=0.05)
    np.testing.assert_allclose(run["root.reaction_moment"][-1], -3.0 * total[-1], rtol=0.05)


def test_a_study_file_has_a_force_along_the_beam():
    wind = '[[force]]\nname = "wind"\ndensity = "3.0 N/m"\nkind = "sine"\nfrequency = 5.0\n'
    study = read(REST, wind)
    assert study.excitation == fi.LineForce(3.0, fi.Sine(1.0, 5.0), "wind")
    assert same_study(read_study(study_text(study), Path("study.toml")), study)
    varied = study_with(study, {paths_of_study(study)["force.wind.density"]: 6.0})
    assert varied.excitation.at == fi.excitation.LineLoad(6.0)
    assert paths_of_study(study)["force.wind.density"].unit == "N/m"
    for text, words in (
        (wind + "at = 0.1\n", r"force.wind.at = 0.1: must be one of both"),
        (wind.replace('density = "3.0 N/m"\n', ""), r"force.wind.at: is missing: .* or density \(N/m\)"),
        (wind.replace("3.0 N/m", "3.0 N"), r"force.wind.density"),
        (wind.replace("sine", "hammer").replace("frequency = 5.0", "impulse = 1.0\nduration = 0.1"), "density"),
    ):
        with pytest.raises(fi.InputError, match=words):
            read_study(HEAD + REST + text, Path("study.toml"))


def test_the_first_gap_under_a_force_is_that_under_a_base_of_the_same_modal_force():
    system = fi.reduce(fi.assemble(MAST, elements=10), 3)
    modes = fi.solve_modes(fi.without_impactors(system), 1)
    frequency, phi = modes.natural_frequency[0], modes.vectors[:, 0]
    line = fi.excitation.LineLoad(3.0)
    # ub omega^2 Gamma is the modal force of a base, integral q phi dx that of a line
    amplitude = abs(system.point_row(line) @ phi / modes.participation_factor[0]) / (2 * np.pi * frequency) ** 2
    drives = (
        fi.Sine(amplitude, frequency),
        fi.LineForce(3.0, fi.Sine(1.0, frequency)),
        fi.PointForce("tip", fi.Sine(abs(system.point_row(line) @ phi / (system.point_row("tip") @ phi)), frequency)),
    )
    gaps = [row.value for drive in drives for row in fi.preflight(system, drive).rows if "first gap" in row.what]
    assert len(gaps) == 3
    np.testing.assert_allclose(gaps, gaps[0], rtol=1e-9)


def test_a_density_that_gives_no_number_is_named():
    system = fi.assemble(MAST, elements=3)
    for wrong in (lambda x: float("nan"), lambda x: "3 N/m", lambda x: None):
        with pytest.raises(fi.InputError, match=r"density.*must be a finite number at each place of the beam"):
            system.point_row(fi.excitation.LineLoad(wrong))
    with pytest.raises(fi.InputError, match="density = 'strong'"):
        fi.LineForce("strong", fi.Sine(1.0, 5.0))
    points = fi.System.from_matrices([[1.0]], [[0.0]], [[1.0]], points={"tip": [1.0]})
    with pytest.raises(fi.InputError, match="there is no beam"):
        fi.integrate(points, fi.LineForce(3.0, fi.Sine(1.0, 5.0)), fi.EventDriven(), 1.0)


def test_a_line_force_beside_a_base_keeps_its_work_apart_and_words_name_it():
    system = fi.reduce(fi.assemble(MAST, elements=10), 3)
    drives = fi.Sine(1e-3, 3.0) + fi.LineForce(3.0, fi.Sine(0.5, 3.0, 0.3), "wind")
    assert "the whole beam, 3 N/m" in "; ".join(drive_words(drives))
    panel = fi.figures.drive(drives, 1.0, figure=fi.figures.OffScreen())[1]
    assert panel.get_ylabel() == "factor (1)"
    assert np.abs(panel.lines[0].get_ydata()).max() == pytest.approx(0.5, rel=1e-3)
    record = fi.Recorder(channels=("tip", "root.reaction_force"))
    run = fi.integrate(system, drives, fi.EventDriven(), 20.0, record)
    assert run.energy.residual < 1e-9
    assert set(run.energy.work_of) == {"base", "wind"}
    # by steps the same motion, before impacts tell them apart
    stepped = fi.integrate(system, drives, fi.MoreauJean(1e-4), 0.4, record)
    wanted = np.interp(stepped.time, run.time, run["tip"])
    np.testing.assert_allclose(stepped["tip"], wanted, atol=0.02 * np.abs(wanted).max())


def test_the_page_for_a_course(ran):
    names, printed, said = ran("course")
    assert printed[1:] == said[1:]
    assert printed[0].partition(";")[0] == said[0].partition(";")[0] == "4:2 periodic"
    np.testing.assert_allclose(numbers(printed[0]), numbers(said[0]), rtol=1e-3)
    # closed forms and what is computed, as the page prints them
    assert numbers(printed[1]) == pytest.approx(numbers(printed[2]), rel=1e-6)
    assert [numbers(row)[0] for row in printed[3:5]] == [numbers(row)[0] for row in printed[5:7]]
    overshoot, exact = numbers(printed[7])
    assert overshoot == pytest.approx(exact, abs=1e-4)
    assert len(set(names["runs"][-1].stroboscopic()["ball"][-50:].round(6))) > 10  # no short period at the end
    assert Path("ruler.gif").read_bytes()[:3] == b"GIF"
    page = (ROOT / "docs" / "howto" / "course.md").read_text(encoding="utf-8")
    assert len(page.split()) <= 900


@pytest.mark.impacts
def test_what_the_page_for_a_course_says_of_modes_at_the_stop():
    def at_stop(law, modes):
        ruler = fi.Beam.uniform(length=0.3, width=0.025, thickness=1e-3, young_modulus=210e9, density=7850)
        stop = fi.Stop("stop", at="tip", gap=(5e-3, np.inf), contact=law)
        structure = fi.Structure(ruler, stops=[stop], damping=fi.Rayleigh(ratio=0.02, modes=(1, 2)))
        system = fi.reduce(fi.assemble(structure, elements=20), modes)
        run = fi.integrate(system, fi.Sine(2e-3, 12.0), fi.EventDriven(), 30.0, fi.Recorder(("tip",)))
        late = run.impacts.time > 20.0
        rebound = run.impacts.rebound_speed[late] / run.impacts.approach_speed[late]
        begin = int(np.searchsorted(run.time, 20.0))
        loss = (run.energy.work[-1] - run.energy.work[begin]) / (12.0 * (run.time[-1] - run.time[begin]))
        return 1e3 * loss, run.steady.peak[0], rebound, run.impacts.duration[late]

    rigid = {modes: at_stop(fi.Rigid(0.7), modes) for modes in (2, 4, 8, 16)}
    np.testing.assert_allclose([rigid[n][0] for n in rigid], [4.89, 7.8, 7.52, 7.48], rtol=0.01)
    for number in range(2):
        assert rigid[8][number] == pytest.approx(rigid[16][number], rel=5e-3)
        assert rigid[2][number] != pytest.approx(rigid[16][number], rel=0.05)
    compliant = {modes: at_stop(fi.KelvinVoigt(restitution=0.7, contact_time=5e-3), modes) for modes in (1, 6, 16)}
    for number in range(2):
        assert compliant[6][number] == pytest.approx(compliant[16][number], rel=0.01)
    assert compliant[1][2] == pytest.approx(0.7, abs=0.01)
    assert compliant[1][3] == pytest.approx(5e-3, rel=0.02)
    assert np.median(compliant[6][2]) == pytest.approx(0.91, abs=0.01)
    assert np.median(compliant[6][3]) == pytest.approx(5.7e-3, rel=0.02)
    assert compliant[6][2].min() == pytest.approx(0.13, abs=0.01)


def test_a_phase_portrait_reaches_the_stop():
    # between two readings the tip meets it: the instants of the table of impacts are corners of the curve
    ruler = fi.Beam.uniform(length=0.3, width=0.025, thickness=1e-3, young_modulus=210e9, density=7850)
    stop = fi.Stop("stop", at="tip", gap=(5e-3, np.inf), contact=fi.Rigid(restitution=0.7))
    structure = fi.Structure(ruler, stops=[stop], damping=fi.Rayleigh(ratio=0.02, modes=(1, 2)))
    system = fi.reduce(fi.assemble(structure, elements=10), modes=2)
    record = fi.Recorder(channels=("tip", "tip.velocity"))
    run = fi.integrate(system, fi.Sine(2e-3, 12.0), fi.EventDriven(), 15.0, record)
    curve = fi.figures.phase_portrait(run, ax=fi.figures.OffScreen()).lines[0]
    start = run.time[-1] - 40 / 12.0
    last = run.impacts.time > start
    at_wall = np.flatnonzero(np.abs(curve.get_xdata() - 5.0) < 1e-6)
    # each impact is a line from the speed before it to that after it
    jumps = np.split(at_wall, np.flatnonzero(np.diff(at_wall) > 1) + 1)
    assert len(jumps) == np.count_nonzero(last)
    rates = np.abs([curve.get_ydata()[[jump[0], jump[-1]]] for jump in jumps])
    speeds = np.stack([run.impacts.approach_speed[last], run.impacts.rebound_speed[last]], axis=1)
    np.testing.assert_allclose(rates, 1e3 * speeds, rtol=1e-6)
    np.testing.assert_allclose(rates[:, 1] / rates[:, 0], 0.7, rtol=1e-6)
    # what is not there has no line
    drawn = [line.get_label() for axis in fi.figures.energies(run, fi.figures.OffScreen()) for line in axis.lines]
    assert "contacts" in drawn
    assert "balls" not in drawn
    still = fi.reduce(fi.assemble(replace(structure, stops=()), elements=10), modes=2)
    bare = fi.integrate(still, fi.Sine(2e-3, 12.0), fi.EventDriven(), 1.0, record)
    drawn = [line.get_label() for axis in fi.figures.energies(bare, fi.figures.OffScreen()) for line in axis.lines]
    assert not {"balls", "contacts", "lost in the contacts"} & set(drawn)
    assert "lost in the structure" in drawn
