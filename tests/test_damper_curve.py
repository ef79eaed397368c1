"""The curve of a damper: closed form beside known numbers, runs and fine scans; shares of starts; figure and table."""

import math

import numpy as np
import pytest

import femimpact as fi
from femimpact.files import dataset_columns, read_csv, write_csv

pytestmark = pytest.mark.impacts

LEVELS = [0.159, 0.2, 0.22, 0.24]
KNOWN = [
    # e, A/d, loss, effective mass, fold, symmetry breaking: published with the formulas, to nine decimals
    (0.6, 0.5, 3.380523548, 2.079039683, 0.157176725, 0.732139872),
    (0.6, 0.25, 8.835629346, 2.532549222, 0.157176725, 0.732139872),
    (0.8, 0.1, 20.457521895, 5.675926615, 0.070559228, 0.691778557),
]


@pytest.fixture(scope="module")
def found():
    """The curve at e = 0.6 with the motions of 100 starts."""
    return fi.design.damper_curve(LEVELS, 0.6, starts=100, cycles=360).isel(restitution=0)


@pytest.mark.parametrize("known", KNOWN)
def test_the_curve_has_the_known_numbers(known):
    e, level, *numbers = known
    curve = fi.design.damper_curve(level, e)
    ours = [float(curve[name].squeeze()) for name in ("loss", "effective_mass", "fold", "symmetry_breaking")]
    np.testing.assert_allclose(ours, numbers, atol=6e-10)


@pytest.mark.parametrize("e", [0.1, 0.35, 0.6, 0.9])
def test_loss_is_largest_where_the_effective_mass_is_none(e):
    k = (1 - e) / (1 + e)
    best = float(fi.design.damper_curve(0.5, e)["best"][0])
    below, at, above = fi.design.damper_curve([best * (1 - 1e-4), best, best * (1 + 1e-4)], e)["loss"][0].values
    assert at == pytest.approx(4 / k, rel=1e-12)
    assert np.nanmax([below, above]) < at
    assert float(fi.design.damper_curve(best, e)["effective_mass"][0, 0]) == pytest.approx(0.0, abs=1e-6)


def box(e):
    """A ball of 1 kg in a box that is the base."""
    ball = fi.Impactor("ball", "box", 1.0, 1.0, fi.Rigid(e))
    return fi.System.from_matrices([[1.0]], [[0.1]], [[1.0]], points={"box": [0.0]}, impactors=[ball])


@pytest.mark.parametrize("e", [0.3, 0.6, 0.8])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_run_settles_on_the_closed_form(e, share):
    edges = fi.design.damper_curve(1.0, e)
    low, high = float(edges["fold"][0]), float(edges["symmetry_breaking"][0])
    level, omega = low + share * (high - low), 2 * math.pi * 5.0
    curve = fi.design.damper_curve(level, e).squeeze()
    assert bool(curve["stable"])
    # the phase and the speed of the formulas, 1 % too fast
    k, v = (1 - e) / (1 + e), math.sqrt(float(curve["loss"]) * (1 + e) / (4 * (1 - e)))
    phase = math.atan2(math.pi * v / 2 - 1 / level, -k * v)
    start = fi.State(ball_displacement=[1.0], ball_velocity=[-1.01 * level * omega * v * (1 - k)])
    run = fi.integrate(box(e), fi.Sine(level, 5.0, phase), fi.EventDriven(), 200.0, initial=start)
    last = slice(-2, None)
    loss = run.impacts.energy_loss[last].sum() / (omega * level) ** 2
    # the force on the box is one impulse on each wall, m_e w^2 A its part in phase with -s''
    pushes = run.impacts.side[last] * run.impacts.impulse[last] * np.sin(run.impacts.phase[last])
    assert loss == pytest.approx(float(curve["loss"]), rel=1e-9)
    assert 2 * 5.0 * pushes.sum() / (omega**2 * level) == pytest.approx(float(curve["effective_mass"]), abs=1e-9)


@pytest.mark.parametrize("e", [0.3, 0.6, 0.8])
def test_both_edges_are_those_of_orbits(e):
    edges = fi.design.damper_curve(1.0, e)
    low, high = float(edges["fold"][0]), float(edges["symmetry_breaking"][0])
    levels = [low * (1 - 1e-6), low * (1 + 1e-6), high * (1 - 1e-6), high * (1 + 1e-6)]
    ours = fi.design.damper_curve(levels, e)["stable"][0].values.tolist()
    for level, stable in zip(levels, ours, strict=True):
        orbits = fi.orbits.two_impact_orbits(box(e), fi.Sine(level, 5.0))
        assert any(orbit.is_stable for orbit in orbits) == stable
    assert ours == [False, True, True, False]


def test_the_motion_is_given_where_the_ball_meets_no_wall_between():
    random = np.random.default_rng(1)
    seen = set()
    for e, level in random.uniform((0.0, 0.05), (0.999, 8.0), (400, 2)):
        k, r = (1 - e) / (1 + e), 1 / level
        root = math.pi**2 + 4 * k**2 * (1 - r**2)
        v = 2 * (math.pi * r + math.sqrt(max(root, 0.0))) / (math.pi**2 + 4 * k**2)
        phase = math.atan2(math.pi * v / 2 - r, -k * v)
        angle = phase + np.linspace(0.0, math.pi, 20_001)[1:-1]
        ball = math.sin(phase) + r - v * (angle - phase)
        free = root >= 0.0 and np.all(np.abs(ball - np.sin(angle)) < r + 1e-9)
        assert np.isfinite(float(fi.design.damper_curve(level, e)["loss"][0, 0])) == free, (e, level)
        seen.add((root >= 0.0, free))
    assert seen == {(True, True), (True, False), (False, False)}


def test_shares_of_the_starts(found):
    np.testing.assert_allclose(100 * found["both_walls"], [0, 14, 98, 100], atol=5)
    np.testing.assert_allclose(found["motion_share"].sum("motion"), 1.0, rtol=1e-12)
    # each run that settled has the closed form: the loss to rounding, the effective mass as samples have it
    for level in LEVELS[1:]:
        own = found.sel(amplitude_over_gap=level)
        assert own["rhythm"].values[0] == "2:1 periodic"
        assert float(own["motion_loss"][0]) == pytest.approx(float(own["loss"]), rel=1e-9)
        assert float(own["motion_effective_mass"][0]) == pytest.approx(float(own["effective_mass"]), abs=1e-3)
    # at 0.2 the others take a tenth of that, and are no part of any mean with it
    assert float(found["motion_loss"].sel(amplitude_over_gap=0.2)[1]) < 0.1 * float(
        found["loss"].sel(amplitude_over_gap=0.2)
    )


def test_the_designers_point_is_where_every_start_that_meets_a_wall_finds_it(found):
    at = float(found["sure_from"])
    unmet = found["motion_share"].where(found["rhythm"] == "no impacts").sum("motion")
    sure = (found["both_walls"] + unmet).values > 1 - 1e-9
    assert at in LEVELS[2:]
    assert at == LEVELS[int(np.argmax(sure))]
    assert at > float(found["best"]) + 0.05


def test_above_the_symmetry_breaking_the_motion_is_that_of_runs():
    curve = fi.design.damper_curve([0.7, 0.8], 0.6, starts=4, cycles=360).isel(restitution=0, motion=0)
    assert curve["rhythm"].values.tolist() == ["2:1 periodic"] * 2
    off = (curve["motion_loss"] / curve["loss"] - 1.0).values
    assert abs(off[0]) < 1e-9 < 1e-2 < off[1]
    assert curve["stable"].values.tolist() == [True, False]


def test_stiff_walls_have_the_loss_of_rigid_ones():
    rigid = fi.design.damper_curve(0.3, 0.6)["loss"].item()
    # a wall gives way by v/sqrt(k/m), which is so much more gap, and holds the ball for a time of that order
    off = [
        fi.design.damper_curve(0.3, 0.6, starts=2, stiffness=k, cycles=120)["motion_loss"].values[0, 0, 0] / rigid - 1
        for k in (1e4, 1e6)
    ]
    assert 5.0 < off[0] / off[1] < 20.0
    assert abs(off[1]) < 3e-3


def test_gravity_holds_the_ball_on_its_wall():
    curve = fi.design.damper_curve([0.2, 0.5], 0.6, starts=3, cycles=120, gravity=1.5)
    assert "loss" not in curve
    # beyond (1 + e)/(pi (1 - e)) = 1.27 it bounces no more and rides on the wall: its mass is the box's
    np.testing.assert_allclose(curve["motion_effective_mass"], 1.0, atol=1e-6)
    np.testing.assert_allclose(curve["motion_loss"], 0.0, atol=1e-9)
    assert np.isnan(curve["sure_from"].item())
    # a small one hardly matters: the loss is even in it
    weak, none = (
        fi.design.damper_curve(0.5, 0.6, starts=2, cycles=240, gravity=g)["motion_loss"].values[0, 0, 0]
        for g in (1e-3, 0.0)
    )
    assert weak == pytest.approx(none, rel=1e-5)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"amplitude_over_gap": [0.5, 0.2]}, "amplitude_over_gap"),
        ({"amplitude_over_gap": []}, "amplitude_over_gap"),
        ({"amplitude_over_gap": 0.0}, "amplitude_over_gap"),
        ({"amplitude_over_gap": "0.5"}, "amplitude_over_gap"),
        ({"restitution": [0.6, 1.2]}, "restitution"),
        ({"restitution": -0.1}, "restitution"),
        ({"restitution": 0.0, "stiffness": 1e3, "starts": 2}, "restitution"),
        ({"gravity": 0.1}, "starts"),
        ({"stiffness": 1e3}, "starts"),
        ({"stiffness": -1.0, "starts": 1}, "stiffness"),
        ({"starts": -1}, "starts"),
        ({"starts": 2, "cycles": 10}, "cycles"),
    ],
)
def test_wrong_input_is_refused_in_one_line(wrong, key):
    with pytest.raises(fi.InputError) as error:
        fi.design.damper_curve(**{"amplitude_over_gap": 0.5, "restitution": 0.6, **wrong})
    assert str(error.value).startswith(key)
    assert "\n" not in str(error.value)


def test_the_figure_marks_the_designers_point(found):
    axes = fi.figures.damper_curve(found.expand_dims("restitution"), figure=fi.figures.OffScreen())
    loss, _, share = axes
    (star,) = (line for line in loss.lines if line.get_marker() == "*")
    at = float(found["sure_from"])
    assert star.get_xdata()[0] == at
    assert star.get_ydata()[0] == pytest.approx(float(found["loss"].sel(amplitude_over_gap=at)), rel=1e-9)
    np.testing.assert_allclose(share.lines[0].get_ydata(), found["both_walls"])
    # a circle's size is the share of its motion
    np.testing.assert_allclose(
        loss.collections[0].get_sizes() / 60.0, np.nan_to_num(found["motion_share"]).ravel(), rtol=1e-12
    )
    closed = fi.figures.damper_curve(fi.design.damper_curve([0.2, 0.5, 1.0], [0.6, 0.8]), figure=fi.figures.OffScreen())
    assert len(closed) == 2


def test_another_dataset_is_refused():
    other = fi.design.damper_curve(0.3, 0.6).rename(restitution="e")
    with pytest.raises(fi.InputError, match="must be a dataset of design"):
        fi.figures.damper_curve(other, figure=fi.figures.OffScreen())


def test_the_table_has_a_row_for_each_motion(found, tmp_path):
    table = read_csv(write_csv(tmp_path / "curve.csv", *dataset_columns(found)))
    assert len(table["loss"]) == found["motion_loss"].size
    rows = found["motion_loss"].sizes["motion"]
    assert np.array_equal(table["amplitude_over_gap"], np.repeat(LEVELS, rows))
    assert np.array_equal(table["loss"], np.repeat(found["loss"].values, rows))
    assert np.array_equal(table["motion_loss"], found["motion_loss"].values.ravel(), equal_nan=True)
