"""Figures hold the data of the result, with quantities and units, on the axes given or on a new pyplot figure."""

from __future__ import annotations

import ast
import dataclasses
import math
import re

import numpy as np
import pytest
import xarray
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact.figures.histories import cycle_averaged_force
from femimpact.figures.portraits import changes_of_contact, corners_of, phase_curve

plt = pytest.importorskip("matplotlib.pyplot")

pytestmark = pytest.mark.impacts

CHANNELS = ("tip", "tip.velocity", "ball", "ball.velocity", "contact_force")
FREQUENCIES = np.linspace(4.6, 5.6, 11)


@pytest.fixture(autouse=True)
def _closed():
    plt.switch_backend("agg")
    plt.close("all")
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def run(small):
    return fi.integrate(small, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 6.0, fi.Recorder(channels=CHANNELS))


@pytest.fixture(scope="module")
def two_balls():
    wall = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    structure = fi.Structure(
        fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700),
        [fi.PointMass("midbox", at="mid", mass=0.01), fi.PointMass("tipbox", at="tip", mass=0.023)],
        [fi.Impactor("left", "mid", 2e-3, 1e-3, wall), fi.Impactor("right", "tip", 3.4e-3, 4e-3, wall)],
        fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )
    system = fi.assemble(structure, elements=10)
    record = fi.Recorder(channels=("mid", "tip", "left", "right"))
    response = fi.integrate(fi.reduce(system, modes=3), fi.Sine(0.2e-3, 5.0), fi.EventDriven(), 4.0, record)
    return structure, system, response


@pytest.fixture(scope="module")
def curves(small):
    with_ball = fi.frequency_sweep(small, 0.2037e-3, FREQUENCIES, fi.EventDriven(), 60)
    empty = fi.frequency_sweep(fi.without_impactors(small), 0.2037e-3, FREQUENCIES, fi.EventDriven(), 60)
    return empty, with_ball


@pytest.fixture(scope="module")
def mesh(reference):
    return fi.convergence.converge_elements(reference, (2, 4, 8), modes=2)


def line(axis, label):
    """The one line of a label."""
    (found,) = [line for line in axis.lines if line.get_label() == label]
    return found


def legend_words(axis):
    """Words of all legends of the axes."""
    from matplotlib.legend import Legend

    return [text.get_text() for legend in axis.findobj(Legend) for text in legend.get_texts()]


def table(values, a=None, **cells):
    """A dataset of a measure over two axes; `cells` are further variables."""
    variables = {name: (("a", "b"), entries) for name, entries in {"m": values, **cells}.items()}
    return xarray.Dataset(variables, {"a": np.arange(len(values)) if a is None else a, "b": [1.0, 2.0]})


def has_line(axis, x, y):
    """Whether a line of the axes goes through just these points."""
    return any(
        found.get_xdata().shape == np.shape(x)
        and np.allclose(found.get_xdata(), x)
        and np.allclose(found.get_ydata(), y, equal_nan=True)
        for found in axis.lines
    )


# ---- where a figure is drawn ----------------------------------------------------------------------


def panels(run, curves, mesh, two_balls):
    """Every figure of one panel, as functions of axes, with what it draws."""
    figures = fi.figures
    return {
        "spectrum": lambda ax: figures.spectrum(run, ax=ax),
        "phase portrait": lambda ax: figures.phase_portrait(run, ax=ax),
        "bifurcation": lambda ax: figures.bifurcation([run], ax=ax),
        "response curve": lambda ax: figures.response_curve(curves[1], ax=ax),
        "impulse phase": lambda ax: figures.impulse_phase(run, ax=ax),
        "mesh convergence": lambda ax: figures.convergence(mesh, ax=ax),
        "study": lambda ax: figures.study(table(np.ones((3, 2))), ax=ax),
    }


def several(run, two_balls):
    """Every figure of several panels, as functions of a figure."""
    figures, (structure, system, response) = fi.figures, two_balls
    modes = fi.solve_modes(system, count=3)
    wall = structure.impactors[0].contact
    return {
        "motion": lambda figure: figures.motion(response, figure=figure),
        "energies": lambda figure: figures.energies(run, figure=figure),
        "contact force": lambda figure: figures.contact_force(run, figure=figure),
        "mode shapes": lambda figure: figures.mode_shapes(system, modes, structure=structure, figure=figure),
        "impact histograms": lambda figure: figures.impact_histograms(run, figure=figure),
        "contact laws": lambda figure: figures.contact_laws([("ball", wall, 3e-3)], [0.1], figure=figure),
    }


def test_one_panel_is_drawn_on_the_axes_given_and_opens_no_figure(run, curves, mesh, two_balls):
    for name, draw in panels(run, curves, mesh, two_balls).items():
        plt.close("all")
        ax = plt.figure().subplots()
        assert draw(ax) is ax, name
        assert ax.has_data(), name
        assert len(plt.get_fignums()) == 1, name
        with pytest.raises(fi.InputError, match="ax = "):
            draw(ax.figure)


def test_several_panels_are_drawn_on_the_figure_given_and_open_none(run, two_balls):
    for name, draw in several(run, two_balls).items():
        plt.close("all")
        figure = plt.figure()
        axes = draw(figure)
        assert isinstance(axes, np.ndarray), name
        assert list(axes.flat) == figure.axes, name
        assert all(axis.has_data() for axis in axes.flat), name
        assert len(plt.get_fignums()) == 1, name
        with pytest.raises(fi.InputError, match="figure = "):
            draw(axes.flat[0])


def test_without_axes_it_is_a_figure_of_pyplot_and_off_screen_it_is_none(run, curves, mesh, two_balls, tmp_path):
    for name, draw in (panels(run, curves, mesh, two_balls) | several(run, two_balls)).items():
        plt.close("all")
        drawn = draw(None)
        assert len(plt.get_fignums()) == 1, name
        first = drawn.flat[0] if isinstance(drawn, np.ndarray) else drawn
        assert first.figure is plt.gcf(), name
        plt.close("all")
        drawn = draw(fi.figures.OffScreen())
        assert not plt.get_fignums(), name
        # all are drawn where their legends are looked at
        if name in ("study", "motion"):
            path = fi.figures.save_figure(drawn, tmp_path / f"{name}.png")
            assert path.read_bytes().startswith(b"\x89PNG"), name


def test_every_axis_names_its_quantity_and_its_unit(run, curves, mesh, two_balls):
    pictures = panels(run, curves, mesh, two_balls) | several(run, two_balls)
    # values of a map are whatever its caller computed; numbers have no unit
    del pictures["study"]
    plain = {"elements", "impacts", "w / max |w|", "relative error", ""}
    for name, draw in pictures.items():
        drawn = draw(fi.figures.OffScreen())
        for axis in drawn.flat if isinstance(drawn, np.ndarray) else [drawn]:
            for label in (axis.get_xlabel(), axis.get_ylabel()):
                # a shared axis is labelled once
                assert label in plain or ("(" in label and ")" in label), (name, label)


# ---- what it holds --------------------------------------------------------------------------------


def test_motion_holds_beam_ball_walls_and_impacts(run):
    whole, close = fi.figures.motion(run, cycles=10)[0]
    assert has_line(whole, run.time, 1e3 * run["tip"])
    assert has_line(whole, run.time, 1e3 * run["ball"])
    # gap 4 mm to either side of the beam
    assert has_line(whole, run.time, 1e3 * run["tip"] + 4.0)
    assert has_line(whole, run.time, 1e3 * run["tip"] - 4.0)
    start = run.time[-1] - 10 / 5.0
    np.testing.assert_allclose(close.get_xlim(), [start, run.time[-1]], atol=1.0 / 5.0 / 64)
    dots = line(close, "impact")
    times = run.impacts.time[run.impacts.time >= start]
    assert times.size > 5
    np.testing.assert_allclose(dots.get_xdata(), times)
    # a ball touches where its box is: the straight line between samples of a path with a kink is off by at most
    # half a sample times the change of speed, 0.5 (1/320 s) (0.4 m/s), and what the wall yields
    wall = np.interp(times, run.time, 1e3 * run["tip"]) + 4.0 * run.impacts.side[-times.size :]
    np.testing.assert_allclose(dots.get_ydata(), wall, atol=0.7)


def test_every_ball_has_its_trace_and_its_close_up(two_balls):
    response = two_balls[2]
    axes = fi.figures.motion(response)
    assert axes.shape == (2, 2)
    for row, (ball, place) in zip(axes, (("left", "mid"), ("right", "tip")), strict=True):
        np.testing.assert_allclose(row[0].lines[2].get_ydata(), 1e3 * response[place])
        np.testing.assert_allclose(row[0].lines[3].get_ydata(), 1e3 * response[ball])
        end = line(row[1], ball).get_ydata()
        np.testing.assert_allclose(end, 1e3 * response[ball][-end.size :])


def test_a_box_whose_place_was_not_recorded_is_named_and_its_gap_will_do(two_balls, small):
    response = two_balls[2]
    left_out = {name: values for name, values in response.channels.items() if name != "mid"}
    units = {name: response.units[name] for name in left_out}
    with pytest.raises(fi.InputError, match="must hold 'mid', where 'left' is"):
        fi.figures.motion(dataclasses.replace(response, channels=left_out, units=units))
    record = fi.Recorder(channels=("ball", "gap", "tip.velocity"))
    run = fi.integrate(small, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 1.0, record)
    whole = fi.figures.motion(run)[0, 0]
    assert has_line(whole, run.time, 1e3 * (run["ball"] - run["gap"]))


def test_a_stop_stands_where_it_is_and_in_space_moves_against_the_base():
    beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    for fixed_to, moves in (("base", 0.0), ("space", 1.0)):
        stop = fi.Stop("stop", at="tip", gap=(1e-3, math.inf), contact=fi.Rigid(0.7), fixed_to=fixed_to)
        structure = fi.Structure(beam, stops=[stop], damping=fi.Rayleigh(ratio=0.02, modes=(1, 2)))
        system = fi.reduce(fi.assemble(structure, elements=10), modes=2)
        response = fi.integrate(system, fi.Sine(1e-4, 14.0), fi.EventDriven(), 1.0, fi.Recorder(channels=("tip",)))
        wall = line(fi.figures.motion(response)[0, 0], "stop").get_ydata()
        np.testing.assert_allclose(wall, 1.0 - moves * 1e3 * response.base.displacement(response.time))


def test_energies_hold_the_ledger_and_its_residual(run):
    stored, since, residual = fi.figures.energies(run)
    ledger = run.energy
    assert "µJ" in stored.get_ylabel()
    np.testing.assert_allclose(line(stored, "balls").get_ydata(), 1e6 * ledger.ball)
    work, kept, structure, contacts = (found.get_ydata() for found in since.lines)
    # what the curves say balances as the ledger does
    np.testing.assert_allclose(work, kept + structure + contacts, atol=1e-9 * np.abs(work).max())
    np.testing.assert_array_equal(residual.lines[0].get_ydata(), ledger.residual_history)
    with pytest.raises(fi.InputError, match="ledger=True"):
        fi.figures.energies(dataclasses.replace(run, energy=None))


@pytest.mark.parametrize("samples", [400, 401])
def test_a_sine_has_its_amplitude_in_the_spectrum(samples):
    time = np.arange(samples) / samples
    values = 0.25 + 3.0 * np.sin(2 * np.pi * 20.0 * time + 0.4) + 0.5 * np.cos(2 * np.pi * 70.0 * time)
    frequency, amplitude = fi.signals.amplitude_spectrum(time, values)
    np.testing.assert_allclose(frequency[[20, 70]], [20.0, 70.0])
    np.testing.assert_allclose(amplitude[[0, 20, 70]], [0.25, 3.0, 0.5], rtol=1e-9)
    # a Hann window widens a line by one to either side
    others = np.delete(amplitude, [0, 1, 19, 20, 21, 69, 70, 71])
    assert others.max() < 1e-9


def test_the_portrait_holds_the_motion_in_the_box_with_its_section(run):
    axis = fi.figures.phase_portrait(run, cycles=10)
    last = run.time >= run.time[-1] - 10 / 5.0
    relative = (run["ball"] - run["tip"])[last]
    # every sample is on the curve, and so is every touch
    drawn = axis.lines[0].get_xydata()
    rate = (run["ball.velocity"] - run["tip.velocity"])[last]
    own = run.impacts.time >= run.time[last][0]
    side, speed = run.impacts.side[own], run.impacts.approach_speed[own]
    for points in ((1e3 * relative, 1e3 * rate), (4.0 * side, 1e3 * side * speed)):
        for point in np.column_stack(points):
            assert np.abs(drawn - point).max(axis=1).min() < 1e-9
    section = run.stroboscopic(0.0)
    points = line(axis, "once per cycle, base at 0 degrees")
    np.testing.assert_allclose(points.get_xdata(), 1e3 * (section["ball"] - section["tip"])[-points.get_xdata().size :])
    assert points.get_xdata().size in (10, 11)
    assert {found.get_xdata()[0] for found in axis.lines if len(found.get_xdata()) == 2} == {4.0, -4.0}
    tip = fi.figures.phase_portrait(run, "tip", phase=None)
    np.testing.assert_allclose(tip.lines[0].get_xdata()[::16], 1e3 * run["tip"])
    with pytest.raises(fi.InputError, match=r"must hold 'contact_force\.velocity'$"):
        fi.figures.phase_portrait(run, "contact_force")


@pytest.mark.parametrize("recorded", [("tip", "ball"), ("tip",), ("ball", "ball.gap", "tip.velocity"), ("mid",)])
@pytest.mark.parametrize("of", [None, 0])
def test_a_portrait_without_its_channels_names_a_recorder_with_which_it_is_drawn(of, recorded):
    def run_with(channels):
        record = fi.Recorder(channels=channels)
        return fi.integrate(reduced(REFERENCE, 3), fi.Sine(0.2e-3, 5.0), fi.EventDriven(), 2.0, record)

    of = of if of is None else recorded[of]
    with pytest.raises(fi.InputError, match=r"run with record=fi\.Recorder\(channels=\(") as refused:
        fi.figures.phase_portrait(run_with(recorded), of)
    named = ast.literal_eval(re.search(r"Recorder\(channels=(.*)\)", str(refused.value))[1])
    fi.figures.phase_portrait(run_with(named), of)


@pytest.fixture(scope="module")
def rigid(reference):
    """The same motion read at 64 and at 1024 instants of a cycle, with rigid impacts of one ball."""
    system = reduced(with_ball(reference, contact=fi.Rigid(0.6)), 2, 10)
    record = fi.Recorder(channels=("tip", "tip.velocity", "ball", "ball.velocity"))
    return [
        fi.integrate(system, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(samples_per_cycle=samples), 2.0, record)
        for samples in (64, 1024)
    ]


def test_a_portrait_of_few_samples_is_that_of_many(rigid):
    few, many = rigid
    np.testing.assert_array_equal(few.impacts.time, many.impacts.time)
    assert len(few.impacts) > 10

    def curve(run, points):
        relative = [run["ball"] - run["tip"], run["ball.velocity"] - run["tip.velocity"]]
        return phase_curve(run.time, *relative, changes_of_contact(run), corners_of(run, "ball"), points)

    exact = [many["ball"] - many["tip"], many["ball.velocity"] - many["tip.velocity"]]

    def largest_error(time, *drawn):
        # between an impact and a sample the instants are others
        at = np.searchsorted(many.time, time - 1e-9)
        known = np.abs(many.time[at] - time) < 1e-9
        assert np.count_nonzero(known) > 0.95 * many.time.size
        return [np.abs(one[known] - of[at[known]]).max() / np.ptp(of) for one, of in zip(drawn, exact, strict=True)]

    # of the two modes the second one, of 70 Hz, has 4.6 samples in a period: the rate of its cubic is off by
    # (2 pi / 4.6)^3 / (72 sqrt 3) = 2 % of that mode's rate, of which some tenths are in the whole
    assert max(largest_error(*curve(few, 16))) < 0.004
    # drawn straight, the rate of the second mode is off by (2 pi / 4.6)^2 / 8 = 23 %
    samples = [few["ball"] - few["tip"], few["ball.velocity"] - few["tip.velocity"]]
    straight = [np.interp(many.time, few.time, values) for values in samples]
    assert max(largest_error(many.time, *straight)) > 0.02


def test_corners_of_a_portrait_are_on_the_walls_with_both_speeds(rigid):
    few, _ = rigid
    axis = fi.figures.phase_portrait(few, phase=None, cycles=10)
    x, v = (np.asarray(data) for data in axis.lines[0].get_data())
    wall, impacts = 4.0, few.impacts
    # the ball of a rigid impact is nowhere inside a wall; the cubic beside an impact is off by far less than a pixel
    assert np.abs(x).max() < wall * (1.0 + 1e-4)
    for side, before, after in zip(impacts.side, impacts.approach_speed, impacts.rebound_speed, strict=True):
        at = np.flatnonzero((x == side * wall) & np.isclose(v, 1e3 * side * before, rtol=1e-12))
        assert at.size
        np.testing.assert_allclose(v[at + 1 + 15], -1e3 * side * after, rtol=1e-12)


def test_legends_are_over_nothing(run, curves, mesh, two_balls):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.legend import Legend

    three = {"without ball": curves[0]} | {f"with ball, at rest in frame {i} of two": curves[1] for i in (1, 2)}
    published = [("paper", 4.95, 7e-3)]

    def named(ax):
        return fi.figures.response_curve(three, coarse=FREQUENCIES[::2], published=published, ax=ax)

    for name, draw in (panels(run, curves, mesh, two_balls) | several(run, two_balls) | {"named": named}).items():
        drawn = draw(fi.figures.OffScreen())
        whole = np.atleast_1d(drawn)
        figure = whole.flat[0].figure
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        legends = figure.findobj(Legend)
        boxes = [legend.get_window_extent() for legend in legends]
        words = [axis._left_title for axis in whole.flat] + [axis.title for axis in whole.flat]
        others = [text.get_window_extent() for text in words if text.get_text()]
        others += [axis.get_window_extent() for axis in whole.flat]
        for i, box in enumerate(boxes):
            # of the line of an axis half a point is drawn outside
            inner = box.padded(-2.0)
            assert not any(inner.overlaps(other) for other in others), name
            assert not any(inner.overlaps(other) for other in boxes[:i]), name
            assert inner.x0 >= 0.0, name
            assert inner.x1 <= figure.bbox.x1, name
            assert inner.y1 <= figure.bbox.y1, name
    assert len(legends) == 2


def test_a_bifurcation_has_the_sections_of_every_run(small):
    bases = [fi.Sine(0.2037e-3, frequency) for frequency in (4.8, 5.0)]
    runs = fi.integrate(small, bases, fi.EventDriven(), 6.0, fi.Recorder(channels=("tip",)))
    axis = fi.figures.bifurcation(runs)
    drawn = axis.lines[0]
    for response in runs:
        section = response.stroboscopic()
        own = drawn.get_xdata() == response.base.frequency
        np.testing.assert_allclose(drawn.get_ydata()[own], 1e3 * section["tip"][section.time >= response.window[0]])


def test_a_bifurcation_is_drawn_over_the_number_that_differs_between_runs(small):
    def runs(systems, drives):
        record = fi.Recorder(channels=("tip",))
        return [
            fi.integrate(system, drive, fi.EventDriven(), 2.0, record)
            for system, drive in zip(systems, drives, strict=True)
        ]

    def across(responses, **over):
        axis = fi.figures.bifurcation(responses, ax=fi.figures.OffScreen(), **over)
        return axis.get_xlabel(), sorted(set(axis.lines[0].get_xdata().tolist()))

    def with_pair(**numbers):
        pair = dataclasses.replace(small.contacts[0], **numbers)
        return dataclasses.replace(small, contacts=(pair,))

    base = fi.Sine(0.2e-3, 5.0)
    levels = (0.1e-3, 0.2e-3)
    assert across(runs([small] * 2, [fi.Sine(level, 5.0) for level in levels])) == (
        "amplitude of the base (mm)",
        [0.1, 0.2],
    )
    forces = [fi.PointForce("tip", fi.Sine(level, 5.0)) for level in levels]
    assert across(runs([small] * 2, forces)) == ("amplitude of the force (N)", [0.1e-3, 0.2e-3])
    assert across(runs([with_pair(gaps=(gap, gap)) for gap in (1e-3, 3e-3)], [base] * 2)) == (
        "gap of ball (mm)",
        [1.0, 3.0],
    )
    assert across(runs([with_pair(gaps=(2e-3, gap)) for gap in (1e-3, 3e-3)], [base] * 2)) == (
        "gap of ball, - side (mm)",
        [1.0, 3.0],
    )
    laws = [fi.Rigid(e) for e in (0.5, 0.75)]
    assert across(runs([with_pair(law=law) for law in laws], [base] * 2)) == ("restitution of ball", [0.5, 0.75])
    equal = runs([small] * 2, [base] * 2)
    assert across(equal, over=("damping ratio (%)", [0.2, 0.1])) == ("damping ratio (%)", [0.1, 0.2])
    with pytest.raises(fi.InputError, match=r"over = 'none': .* the value of each run"):
        across(equal)
    with pytest.raises(fi.InputError, match=r"must be words and a value for each of 2 runs"):
        across(equal, over=("damping", [1.0, 2.0, 3.0]))
    with pytest.raises(fi.InputError, match=r"over = \[1.0, 2.0\]: must be words"):
        across(equal, over=[1.0, 2.0])


def test_a_line_joins_what_repeats_and_what_scatters_is_dots(curves):
    empty, with_ball = curves
    steadiness = np.array(["periodic"] * 4 + ["statistical"] * 5 + ["failed", "periodic"])
    peak = np.where(steadiness == "failed", np.nan, with_ball.peak)
    mixed = dataclasses.replace(with_ball, steadiness=steadiness, peak=peak, impacts_per_cycle=np.ones(11))
    axis = fi.figures.response_curve({"without ball": empty, "with ball": mixed}, published=[("paper", 4.95, 7e-3)])
    # linear: no scatter and no sample, whatever is left of its transient
    np.testing.assert_allclose(line(axis, "without ball: peak").get_ydata(), 1e3 * empty.peak)
    assert empty.peak_is_transient
    assert not empty.is_sample.any()
    assert not any("without ball: peak, one start" in str(drawn.get_label()) for drawn in axis.lines)
    assert any("transient has not died out" in drawn.get_text() for drawn in axis.texts)
    joined = line(axis, "with ball: peak").get_ydata()
    np.testing.assert_allclose(joined[steadiness == "periodic"], 1e3 * peak[steadiness == "periodic"])
    assert np.isnan(joined[steadiness != "periodic"]).all()
    dots = line(axis, "with ball: peak, one start's value: the motion is not periodic")
    assert dots.get_linestyle() == "None"
    np.testing.assert_allclose(dots.get_xdata(), FREQUENCIES[4:9])
    np.testing.assert_allclose(dots.get_ydata(), 1e3 * peak[4:9])
    # the rms of these is one start's, too
    assert has_line(axis, FREQUENCIES[4:9], 1e3 * mixed.rms[4:9])
    assert (*line(axis, "paper").get_xdata(), *line(axis, "paper").get_ydata()) == (4.95, 7.0)
    whole = fi.figures.response_curve(mixed, join_all=True)
    np.testing.assert_allclose(line(whole, "peak").get_ydata(), 1e3 * peak)
    assert has_line(whole, FREQUENCIES[4:9], 1e3 * peak[4:9])
    for drawn in (axis, whole):
        assert "one start's value: the motion is not periodic" in legend_words(drawn)
    steady = np.full(11, "periodic", dtype="<U11")
    calm = fi.figures.response_curve(dataclasses.replace(with_ball, steadiness=steady, impacts_per_cycle=np.ones(11)))
    assert legend_words(calm) == ["peak", "rms"]
    with pytest.raises(fi.InputError, match="curves"):
        fi.figures.response_curve({})


def test_the_averages_of_all_cycles_are_the_impulses_of_the_run(run):
    time, force = cycle_averaged_force(run)
    assert time.size == 30
    np.testing.assert_allclose(time[:2], [0.1, 0.3])
    inside = run.impacts.time < 6.0
    assert force.sum() * 0.2 == pytest.approx(run.impacts.impulse[inside].sum(), rel=1e-12)
    # over the whole cycles of the last third it is the mean force of the statistics; contacts over an edge count whole
    assert force[20:].mean() == pytest.approx(run.statistics.cycle_mean_force, rel=0.1)
    peaks, averages = fi.figures.contact_force(run)[1:]
    np.testing.assert_allclose(averages.lines[0].get_ydata(), 1e3 * force)
    assert "mN" in averages.get_ylabel()
    assert sum(found.get_xdata().size for found in peaks.lines) == len(run.impacts)


DRIVES = {
    "sine": fi.Sine(0.2e-3, 5.0),
    "sum": fi.Sine(0.2e-3, 5.0) + fi.Sine(0.1e-3, 7.3),
    "samples": fi.RecordedBase(np.random.default_rng(0).normal(size=300), 0.02),
}


@pytest.mark.parametrize("stepped", [False, True])
@pytest.mark.parametrize("name", DRIVES)
def test_the_figure_shows_every_contact_whole_however_coarsely_the_run_is_read(small, name, stepped):
    """Each impact of the table is one pulse of the line, with its peak, its impulse and its length."""
    method = fi.Newmark(fi.recommended_step(small)) if stepped else fi.EventDriven()
    record = fi.Recorder(channels=("contact_force",), every=20 if stepped else 1, ledger=False)
    before = fi.integrate(small, DRIVES[name], method, 2.0, record)
    run = fi.integrate(small, DRIVES[name], method, 3.0, record, before.final_state)
    time, force = fi.figures.contact_force(run, cycles=6)[0].lines[0].get_data()
    table, late = run.impacts, run.impacts.time >= time[0]
    assert late.sum() >= 4
    rows = zip(table.time[late], table.duration[late], table.peak_force[late], table.impulse[late], strict=True)
    for begin, duration, peak, impulse in rows:
        inside = (time >= begin) & (time <= begin + duration)
        assert inside.sum() >= 15
        assert np.abs(force[inside]).max() == pytest.approx(peak, rel=1e-2)
        assert np.trapezoid(np.abs(force[inside]), time[inside]) == pytest.approx(abs(impulse), rel=0.06)
    # the readings of the run are among those of the line
    shared = np.isin(time, run.time)
    assert shared.sum() == np.count_nonzero(run.time >= time[0])
    own = run["contact_force"][run.time >= time[0]]
    np.testing.assert_allclose(force[shared], own, rtol=0.0, atol=1e-9 * table.peak_force.max())


def test_a_contact_force_read_more_seldom_than_a_tenth_of_a_contact_has_a_note(small):
    base, said = fi.Sine(0.2037e-3, 5.0), {}
    lasting = np.median(fi.integrate(small, base, fi.EventDriven(), 3.0).impacts.duration)
    for share in (0.09, 0.11):
        record = fi.Recorder(channels=("tip", "contact_force"), interval=share * lasting)
        run = fi.integrate(small, base, fi.EventDriven(), 3.0, record)
        said[share] = [text for text in run.notes if "contact_force is read every" in text]
    assert said[0.09] == []
    (text,) = said[0.11]
    assert "fewer than 10 readings" in text
    # a rigid contact has no course
    rigid = with_ball(REFERENCE, contact=fi.Rigid(0.8))
    run = fi.integrate(reduced(rigid), base, fi.EventDriven(), 3.0)
    assert not any("is read every" in text for text in run.notes)
    without = fi.integrate(small, base, fi.EventDriven(), 3.0, fi.Recorder(channels=("tip",)))
    assert not any("contact_force is read" in text for text in without.notes)


def test_a_force_that_sticks_is_averaged_over_the_cycles_it_shares(run):
    """A ball pressed to its wall by 2 N from 0.3 to 0.5 s: half of the second and half of the third cycle of 0.2 s."""
    sticking = type(run.sticking)(
        impactor=np.array(["ball"]), side=np.array([1]), start=np.array([0.3]), end=np.array([0.5]),
        impulse=np.array([0.4]), mean_force=np.array([2.0]),
    )  # fmt: skip
    force = cycle_averaged_force(run)[1]
    pressed = cycle_averaged_force(dataclasses.replace(run, sticking=sticking))[1]
    np.testing.assert_allclose((pressed - force)[:4], [0.0, 1.0, 1.0, 0.0], atol=1e-12)


def test_mode_shapes_carry_boxes_balls_and_supports_where_the_shape_is(two_balls):
    structure, system, _ = two_balls
    modes = fi.solve_modes(system, count=3)
    axes = fi.figures.mode_shapes(system, modes, structure=structure)
    for i, axis in enumerate(axes):
        shape = axis.lines[1]
        assert np.abs(shape.get_ydata()).max() == pytest.approx(1.0)
        for name, x in (("midbox", 115.0), ("tipbox", 230.0), ("left", 115.0), ("right", 230.0), ("clamped", 0.0)):
            mark = line(axis, name)
            assert mark.get_xdata()[0] == pytest.approx(x)
            # the shape is drawn at 200 places, between which it is straight
            on_shape = np.interp(x, shape.get_xdata(), shape.get_ydata())
            assert mark.get_ydata()[0] == pytest.approx(on_shape, abs=1e-3)
        assert f"{modes.natural_frequency[i]:.5g} Hz" in axis.get_title(loc="left")
    # without the structure there is the shape and the line of rest
    assert all(len(axis.lines) == 2 for axis in fi.figures.mode_shapes(system, modes))


def test_springs_and_dashpots_end_on_the_shape_on_the_mesh_and_on_the_base(two_balls, tmp_path):
    structure, _, _ = two_balls
    structure = dataclasses.replace(
        structure, springs=[fi.Spring("tie", 0.05, 50.0, to="tipbox")], dashpots=[fi.Dashpot("damper", "tip", 0.1)]
    )
    system = fi.assemble(structure, elements=10)
    modes = fi.solve_modes(system, count=3)
    tip = 1e3 * structure.beam.length
    axes = fi.figures.mode_shapes(system, modes, structure=structure, figure=fi.figures.OffScreen())
    for axis in axes:
        shape = axis.lines[1]
        tie, damper = line(axis, "tie (spring)"), line(axis, "damper (dashpot)")
        for drawn, i in ((tie, 0), (tie, -1), (damper, 0)):
            x, y = drawn.get_xdata()[i], drawn.get_ydata()[i]
            assert x == pytest.approx(50.0 if (drawn, i) == (tie, 0) else tip)
            # the shape is drawn at 200 places, between which it is straight
            assert y == pytest.approx(np.interp(x, shape.get_xdata(), shape.get_ydata()), abs=1e-3)
        # as far from rest in every mode
        assert damper.get_ydata()[-1] == axis.get_ylim()[0]
    axis = fi.figures.beam_mesh(fi.uniform_mesh(structure, 10), structure, ax=fi.figures.OffScreen())
    tie, damper = line(axis, "tie (spring)"), line(axis, "damper (dashpot)")
    np.testing.assert_allclose(tie.get_xdata()[[0, -1]], [50.0, tip])
    np.testing.assert_allclose(damper.get_xdata(), [tip, tip])
    assert max(*tie.get_ydata(), *damper.get_ydata()) < axis.get_ylim()[1]
    fi.figures.save_figure(axis, tmp_path / "mesh.png")


def test_a_reference_slope_has_its_order(mesh):
    axis = fi.figures.convergence(mesh)
    np.testing.assert_allclose(line(axis, axis.lines[0].get_label()).get_ydata(), mesh.error[:, 0])
    slope = line(axis, "reference: order 4")
    x, y = np.log(slope.get_xdata()), np.log(slope.get_ydata())
    # over the length of the elements
    np.testing.assert_allclose(np.diff(y) / np.diff(x), 4.0)


def test_a_map_shows_every_value_in_its_cell():
    values = np.array([[0.1, 0.25], [0.5, 1.0], [2.0, 4.0]])
    axis = fi.figures.study(table(values))
    assert [text.get_text() for text in axis.texts] == ["0.1", "0.5", "2", "0.25", "1", "4"]
    np.testing.assert_array_equal(axis.images[0].get_array(), values.T)
    assert legend_words(axis) == []


def test_a_map_has_a_star_at_values_of_one_start_and_says_what_it_means():
    values, samples = np.array([[0.1, 0.25], [0.5, 1.0]]), np.array([[0, 1], [0, 0]])
    cells = {"periodic_starts": 1 - samples, "failed_starts": 0 * samples, "finished": 1 + 0 * samples}
    axis = fi.figures.study(table(values, **cells), "m", title="rms")
    assert [text.get_text() for text in axis.texts] == ["0.1", "0.5", "0.25*", "1"]
    assert legend_words(axis) == ["one start's value: the motion is not periodic"]
    assert axis.get_title(loc="left") == "rms"
    several = fi.figures.study(table(values, **cells).assign_attrs(starts=8), "m")
    assert legend_words(several) == ["not periodic: median of 8 starts"]


def test_print_for_a_projector_is_larger_in_a_picture_of_the_same_pixels(run, tmp_path):
    from PIL import Image

    plain = fi.figures.energies(run)
    with plt.rc_context(fi.figures.PROJECTOR):
        large = fi.figures.energies(run)
    sizes = []
    for axes in (plain, large):
        with Image.open(fi.figures.save_figure(axes, tmp_path / "energy.png")) as picture:
            sizes.append(picture.size)
        axes[0].figure.canvas.draw()
    assert sizes[0] == pytest.approx(sizes[1], abs=1)
    words = [axes[0].yaxis.label.get_window_extent().height / axes[0].figure.bbox.height for axes in (plain, large)]
    assert words[1] / words[0] == pytest.approx(1.3, rel=0.05)


def test_no_title_and_no_label_is_cut_in_print_for_a_projector(run, curves, mesh, two_balls):
    off = fi.figures.OffScreen()
    with plt.rc_context(fi.figures.PROJECTOR):
        drawn = [
            draw(off) for draw in (*panels(run, curves, mesh, two_balls).values(), *several(run, two_balls).values())
        ]
    for figure in {np.ravel(axes)[0].figure for axes in drawn}:
        figure.draw_without_rendering()
        texts = [axis._left_title for axis in figure.axes] + [figure._suptitle] * bool(figure._suptitle)
        texts += [label for axis in figure.axes for label in (axis.xaxis.label, axis.yaxis.label)]
        boxes = [text.get_window_extent() for text in texts if text.get_visible() and text.get_text()]
        assert boxes
        assert min(box.min.min() for box in boxes) > -1.0
        assert all((box.max < figure.bbox.size + 1.0).all() for box in boxes)


@pytest.mark.parametrize("step", [1.0, 1e-2, 1e-4, 1e-6])
def test_ticks_of_a_small_range_have_different_numbers_and_no_offset(step):
    values, own = 5.0 + step * np.arange(12.0), plt.figure().subplots()
    line = fi.figures.study(xarray.Dataset({"m": ("impactor.ball.gap", values)}, {"impactor.ball.gap": values}), ax=own)
    cells = fi.figures.study(table(values[:, None] + [0.0, 0.5 * step], a=values))
    bar = cells.figure.axes[-1].yaxis
    for axis, places in ((line.xaxis, None), (line.yaxis, None), (bar, None), (cells.xaxis, values)):
        axis.figure.canvas.draw()
        places = axis.get_ticklocs() if places is None else places
        texts = [float(tick.get_text()) for tick in axis.get_ticklabels()]
        np.testing.assert_allclose(texts, places, rtol=0.0, atol=0.05 * np.diff(places).min())
        assert axis.get_offset_text().get_text() == ""
    # each value of the study has a mark on the axis
    marks = np.concatenate([line.get_xticks(), line.get_xticks(minor=True)])
    np.testing.assert_allclose([np.abs(marks - value).min() for value in values], 0.0, atol=1e-3 * step)
    assert line.get_xlabel() == "gap of ball"
    # and its number, where there is room
    few = fi.figures.study(xarray.Dataset({"m": ("f", [1.0, 2.0, 3.0])}, {"f": [4.9, 5.0, 5.3]}))
    assert [tick.get_text() for tick in few.get_xticklabels()] == ["4.9", "5", "5.3"]


@pytest.mark.parametrize("cycles", [math.nan, math.inf, 0.0, -1.0, -math.inf, "4", True, None])
def test_cycles_that_are_none_are_not_drawn(run, cycles):
    for figure in (fi.figures.motion, fi.figures.contact_force, fi.figures.phase_portrait):
        with pytest.raises(fi.InputError, match=r"^cycles( = .*)?: must be a finite number > 0"):
            figure(run, cycles=cycles)
    # nothing was begun
    assert plt.get_fignums() == []


def test_more_cycles_than_a_run_has_are_all_of_them(run):
    # 6 s at 5 Hz
    words = "last 30 cycles at 5 Hz"
    assert words in fi.figures.motion(run, cycles=1e30)[-1, 1].get_xlabel()
    assert words in fi.figures.contact_force(run, cycles=1e30)[0].get_title(loc="left")
    axis = fi.figures.phase_portrait(run, cycles=1e30)
    assert words in axis.get_title(loc="left")
    whole = fi.figures.phase_portrait(run, cycles=30)
    assert all(np.array_equal(a.get_xdata(), b.get_xdata()) for a, b in zip(axis.lines, whole.lines, strict=True))


def test_a_streamed_run_has_no_history_to_draw(small):
    run = fi.integrate(small, fi.Sine(1e-4, 5.0), fi.EventDriven(), 1.0, fi.Recorder(sink=lambda piece: None))
    for draw in (fi.figures.motion, fi.figures.energies, fi.figures.spectrum, fi.figures.phase_portrait):
        with pytest.raises(fi.InputError, match=r"response\.time"):
            draw(run)
    # nor is a figure opened
    assert not plt.get_fignums()


def test_a_long_run_is_drawn_as_the_envelope_of_its_curves(small):
    record = fi.Recorder(channels=("tip", "ball"), interval=4e-3)
    long = fi.integrate(small, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 60.0, record)
    whole, close = fi.figures.motion(long)[0]
    assert not whole.lines
    for collection, name in zip(whole.collections, ("ball", "tip"), strict=True):
        edges = collection.get_paths()[0].vertices[:, 1]
        # every part's extremes are among them, so those of the run are
        assert edges.max() == pytest.approx(1e3 * long[name].max(), rel=1e-12)
        assert edges.min() == pytest.approx(1e3 * long[name].min(), rel=1e-12)
    # the close-up shows curves
    assert len(close.lines) >= 2


def test_a_short_run_is_drawn_as_curves_however_often_it_is_read(small):
    record = fi.Recorder(channels=("tip", "ball"), interval=2e-4)
    short = fi.integrate(small, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 6.0, record)
    whole, _ = fi.figures.motion(short)[0]
    np.testing.assert_array_equal(line(whole, "tip").get_ydata(), 1e3 * short["tip"])


def test_figures_over_frequency_have_the_axes_of_the_trade():
    off = fi.figures.OffScreen()
    system = fi.System.from_matrices([[1.0]], [[1.0]], [[900.0]], points={"tip": [1.0]})
    base = fi.RandomBase([(1.0, 0.5), (20.0, 0.5)], 20.0, seed=1)
    record = fi.Recorder(channels=("tip.absolute_acceleration", "tip"), interval=0.01)
    run = fi.integrate(system, base, fi.EventDriven(), 20.0, record)
    found = fi.spectrum(run)
    axis = fi.figures.spectrum(found, ax=off)
    assert (axis.get_xscale(), axis.get_yscale()) == ("log", "log")
    assert axis.get_ylabel().replace("\n", " ") == "spectral density of tip absolute acceleration, g²/Hz"
    # a straight density of 0.5 (m/s^2)^2/Hz of the base is that over 9.80665^2
    np.testing.assert_allclose(axis.get_lines()[0].get_ydata(), found.values[1:] / 9.80665**2)
    exact = fi.transfer_function(system, [1.0, 2.0, 10.0])
    axes = fi.figures.transfer_function(exact, figure=off)
    assert axes[0].get_ylabel() == "magnitude (dB re 1)"
    values = exact["tip.absolute_acceleration"]
    np.testing.assert_allclose(axes[0].get_lines()[0].get_ydata(), 20.0 * np.log10(np.abs(values)))
    np.testing.assert_allclose(axes[1].get_lines()[0].get_ydata(), np.degrees(np.angle(values)))
    measured = fi.measured_transfer(run, "tip.absolute_acceleration")
    assert len(fi.figures.transfer_function({"exact": exact, "measured": measured}, figure=off)) == 3
    shock = fi.shock_response_spectrum(fi.Shock("half-sine", 9.80665, 0.01), [10.0, 100.0])
    axis = fi.figures.shock_response_spectrum(shock, ax=off)
    assert axis.get_ylabel() == "absolute acceleration (g)"
    np.testing.assert_allclose(axis.get_lines()[0].get_ydata(), shock.acceleration / 9.80665)
    with pytest.raises(fi.InputError, match=r"^channel = 'mid'"):
        fi.figures.transfer_function(exact, "mid", figure=off)
    with pytest.raises(fi.InputError, match=r"^spectra = 'none'"):
        fi.figures.shock_response_spectrum({}, ax=off)
    with pytest.raises(fi.InputError, match=r"^highest = 0\.001 Hz: must be the lowest line or more"):
        fi.figures.spectrum(run, highest=1e-3, ax=off)


@pytest.mark.parametrize("kind", ["density", "amplitude"])
def test_the_spectrum_of_a_channel_at_rest_is_drawn(kind):
    system = fi.System.from_matrices([[1.0]], [[1.0]], [[900.0]], points={"tip": [1.0]})
    run = fi.integrate(system, fi.Sine(0.0, 4.0), fi.EventDriven(), 5.0, fi.Recorder(channels=("tip",), interval=0.01))
    axis = fi.figures.spectrum(fi.spectrum(run, kind=kind), ax=fi.figures.OffScreen())
    axis.figure.canvas.draw()
    assert not np.any(axis.get_lines()[0].get_ydata())


def test_no_curve_is_left_out_and_each_has_its_own_look(curves):
    off = fi.figures.OffScreen()
    system = fi.System.from_matrices([[1.0]], [[1.0]], [[900.0]], points={"tip": [1.0]})
    exact = fi.transfer_function(system, [1.0, 2.0, 10.0])
    shock = fi.shock_response_spectrum(fi.Shock("half-sine", 9.80665, 0.01), [10.0, 100.0])
    axes = fi.figures.transfer_function({str(i): exact for i in range(7)}, figure=off)
    axis = fi.figures.shock_response_spectrum({str(i): shock for i in range(7)}, ax=fi.figures.OffScreen())
    for drawn in (axes[0], axes[1], axis):
        looks = {(one.get_color(), one.get_linestyle()) for one in drawn.get_lines()}
        assert len(looks) == len(drawn.get_lines()) == 7
    one = curves[0]
    marks = [(f"published {i}", 5.0, 1e-3 * (i + 1)) for i in range(5)]
    drawn = fi.figures.response_curve({str(i): one for i in range(7)}, published=marks, ax=fi.figures.OffScreen())
    labels = {text.get_text() for legend in drawn.figure.findobj(plt.matplotlib.legend.Legend)
              for text in legend.get_texts()}  # fmt: skip
    assert {str(i) for i in range(7)} <= labels
    assert {label for label, *_ in marks} <= labels


def test_transfer_functions_of_several_inputs_or_units_do_not_share_an_axis():
    system = fi.System.from_matrices([[1.0]], [[1.0]], [[900.0]], points={"tip": [1.0]})
    f = [1.0, 2.0, 10.0]
    of = {name: fi.transfer_function(system, f, "tip", f"base.{name}") for name in ("acceleration", "displacement")}
    with pytest.raises(fi.InputError, match=r"^transfers\.displacement = 'over base\.displacement': must be over base"):
        fi.figures.transfer_function(of, figure=fi.figures.OffScreen())
    # a measured one is over the force by the name that the closed form has
    blow = fi.integrate(system, fi.HammerBlow("tip", 0.1, 0.02), fi.EventDriven(), 20.0,
                        fi.Recorder(channels=("tip",), interval=2e-3))  # fmt: skip
    both = {"exact": fi.transfer_function(system, f, "tip", force_at="tip"), "blow": fi.measured_transfer(blow, "tip")}
    axes = fi.figures.transfer_function(both, figure=fi.figures.OffScreen())
    assert axes[0].get_ylabel() == "magnitude\n(dB re 1 m/N)"


def test_a_record_is_drawn_with_the_largest_of_its_samples():
    samples = np.sin(0.7 * np.arange(6000))
    samples[4321] = -3.0
    (axis,) = fi.figures.drive(fi.RecordedBase(samples, interval=0.005), 30.0, fi.figures.OffScreen())
    assert "largest 3 m/s" in axis.get_title(loc="left")
    assert min(axis.get_lines()[0].get_ydata()) == -3.0
