"""What nothing drives: pulled and struck beams, balls in a box at rest, free beams; by their closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import read_study, study_text

import femimpact as fi
from femimpact.excitation.excitation import words_of
from femimpact.system.matrices import rigid_motions

EXACT = fi.EventDriven()
BEAM = fi.Beam.uniform(length=0.5, width=0.02, thickness=2e-3, young_modulus=70e9, density=2700)
BALL = fi.Impactor("ball", "tip", 3e-3, (2e-3, 4e-3), fi.Rigid(0.6))
CLAMPED = fi.Structure(BEAM, [fi.PointMass("box", "tip", 0.02)])
FREE = fi.Structure(BEAM, supports=(), damping=fi.Rayleigh(0.01, modes=(3, 4)))
STUDY = """
[beam]
length = 0.23
width = 0.02
thickness = 1e-3
young_modulus = 70e9
density = 2700
[[impactor]]
name = "ball"
at = "tip"
mass = 1e-3
gap = 3e-3
contact = { law = "rigid", restitution = 0.6 }
[damping]
ratio = 0.01
modes = [1, 2]
[mesh]
elements = 4
[reduction]
modes = 2
[gravity]
acceleration = -9.81
[base]
kind = "rest"
history = "2 s"
[method]
name = "event-driven"
"""

pytestmark = pytest.mark.impacts


def reduced(structure: fi.Structure, modes: int = 6) -> fi.System:
    return fi.reduce(fi.assemble(structure, elements=12), modes=modes)


def begun(system: fi.System, start: fi.State) -> fi.response.Response:
    return fi.integrate(system, fi.Rest(), EXACT, 0.1, initial=start)


# ---- the excitation --------------------------------------------------------------------------------


def test_none_is_a_rest_and_both_stand_still():
    system, start = reduced(replace(CLAMPED, impactors=(BALL,)), 2), fi.State.pulled("tip", 5e-3)
    runs = fi.integrate(system, [None, fi.Rest()], EXACT, 1.0, initial=start)
    one = fi.integrate(system, None, EXACT, 1.0, initial=start)
    for run in (*runs, one):
        np.testing.assert_array_equal(run["tip"], one["tip"])
        assert (words_of(run.base), run.regime.label) == ("nothing drives it", "free decay")
        assert not run.base.has_cycle
        assert np.all(run.energy.work == 0.0)
    assert fi.Rest() == runs[0].base
    sine, blow = fi.Sine(1e-3, 5.0), fi.HammerBlow("tip", 0.01, 0.003)
    assert (fi.Rest() + sine, (fi.Rest() + blow).drives, fi.Rest() + fi.Rest()) == (sine, (blow,), fi.Rest())


@pytest.mark.parametrize(
    ("method", "law", "unaccounted"),
    [
        (EXACT, fi.Rigid(0.6), 1e-12), (EXACT, fi.KelvinVoigt(restitution=0.6, contact_time=5e-3), 1e-10),
        (fi.MoreauJean(1e-4), fi.Rigid(0.6), 1e-10),
    ],
)  # fmt: skip
def test_what_is_lost_is_the_energy_at_the_start_less_that_at_the_end(method, law, unaccounted):
    ball, damping = replace(BALL, contact=law), fi.Rayleigh(0.003, modes=(1, 2))
    system = reduced(replace(CLAMPED, impactors=(ball,), damping=damping), 2)
    run = fi.integrate(system, fi.Rest(), method, 3.0, initial=fi.State.pulled("tip", 8e-3))
    ledger = run.energy
    lost = ledger.structure_loss[-1] + ledger.contact_loss[-1]
    assert len(run.impacts) > 10
    assert ledger.contact_loss[-1] > 1e-3 * ledger.stored[0]
    assert abs(ledger.stored[0] - ledger.stored[-1] - lost) < unaccounted * ledger.stored[0]


@pytest.mark.parametrize(
    "method", [fi.Newmark(1e-4), fi.HHT(1e-4), fi.WBZ(1e-4), fi.GeneralizedAlpha(1e-4), fi.MoreauJean(1e-4)]
)
def test_every_method_runs_what_nothing_drives(method):
    system = reduced(CLAMPED, 2)
    runs = [fi.integrate(system, None, one, 1.0, initial=fi.State.pulled("tip", 5e-3)) for one in (EXACT, method)]
    exact = np.interp(runs[1].time, runs[0].time, runs[0]["tip"])
    assert np.abs(runs[1]["tip"] - exact).max() < 0.02 * 5e-3


# ---- where it begins -------------------------------------------------------------------------------


def test_a_beam_that_is_pulled_has_the_shape_of_its_force_and_swings_as_the_sum_of_its_modes():
    system, d = reduced(CLAMPED), 10e-3
    full, modes = fi.assemble(CLAMPED, elements=12), fi.solve_modes(reduced(CLAMPED), 6)
    u, *_ = fi.State.pulled("tip", d).relative_to_base(full, fi.Rest())
    x = full.nodes[1:]
    # w = d x^2 (3 L - x)/(2 L^3): the box has no weight
    np.testing.assert_allclose(u[0::2], d * x**2 * (1.5 - x) / (2 * 0.5**3), rtol=1e-8)
    run = fi.integrate(system, fi.Rest(), EXACT, 0.5, fi.Recorder(("tip",)), fi.State.pulled("tip", d))
    omega, tip = 2 * np.pi * modes.natural_frequency, system.point_row("tip") @ modes.vectors
    shares = tip**2 / omega**2
    swing = d * np.cos(np.outer(run.time, omega)) @ shares / shares.sum()
    np.testing.assert_allclose(run["tip"], swing, rtol=0.0, atol=1e-10 * d)


def test_a_pulled_beam_has_its_weight_and_its_balls_where_they_are_given():
    system = reduced(replace(CLAMPED, impactors=(BALL,), gravity=-9.81))
    row = system.point_row("tip")
    u, v, y, y_rate = fi.State.pulled("tip", 7e-3).relative_to_base(system, fi.Rest())
    assert row @ u == pytest.approx(7e-3, rel=1e-12)
    # in the middle of a box with 2 mm above and 4 mm below
    assert y[0] == pytest.approx(6e-3, rel=1e-12)
    assert not np.any(np.append(v, y_rate))
    # the load beside the constant forces acts at the tip alone
    load = system.K @ u - system.constant_load
    np.testing.assert_allclose(load, (load @ row) / (row @ row) * row, atol=1e-9 * np.abs(load).max())
    *_, placed, _ = fi.State.pulled("tip", 7e-3, ball_displacement=[8e-3]).relative_to_base(system, fi.Rest())
    assert placed[0] == 8e-3


def test_a_blow_gives_the_place_its_speed_by_an_impulse_there():
    for system in (reduced(CLAMPED), fi.assemble(CLAMPED, elements=12)):
        u, v, *_ = fi.State.struck("mid", 0.3).relative_to_base(system, fi.Rest())
        row = system.point_row("mid")
        assert row @ v == pytest.approx(0.3, rel=1e-12)
        assert not np.any(u)
        impulse = system.M @ v
        np.testing.assert_allclose(impulse, (impulse @ row) / (row @ row) * row, atol=1e-10 * np.abs(impulse).max())
    # a short blow of the same impulse
    system = reduced(CLAMPED)
    row = system.point_row("tip")
    given = 0.3 / (row @ np.linalg.solve(system.M.toarray(), row))
    struck = fi.integrate(system, None, EXACT, 0.2, fi.Recorder(("tip",), interval=1e-3), fi.State.struck("tip", 0.3))
    blow = fi.HammerBlow("tip", given, 2e-5)
    hit = fi.integrate(system, blow, EXACT, 0.2, fi.Recorder(("tip",), interval=1e-3))
    np.testing.assert_allclose(hit["tip"], struck["tip"], atol=0.01 * np.abs(struck["tip"]).max())


def test_a_ball_bounces_in_a_box_at_rest_slower_each_time():
    e, v, gap = 0.6, 0.2, 3e-3
    stiff = fi.Beam.uniform(length=0.1, width=0.05, thickness=0.02, young_modulus=210e9, density=7850)
    system = reduced(fi.Structure(stiff, impactors=[fi.Impactor("ball", "root", 5e-3, gap, fi.Rigid(e))]), 1)
    run = fi.integrate(system, fi.Rest(), EXACT, 2.0, initial=fi.State(ball_velocity=[v]))
    n = np.arange(len(run.impacts))
    assert n.size > 5
    np.testing.assert_allclose(run.impacts.approach_speed, v * e**n, rtol=1e-12)
    np.testing.assert_allclose(run.impacts.rebound_speed, v * e ** (n + 1), rtol=1e-12)
    # the first way is half as long as the others: t_n = gap/v + 2 gap/v (1/e + ... + 1/e^n)
    times = gap / v * (1.0 + 2.0 * np.cumsum(np.where(n > 0, e**-n, 0.0)))
    np.testing.assert_allclose(run.impacts.time, times, rtol=1e-12)


# ---- a beam that nothing holds ---------------------------------------------------------------------


def test_a_free_beam_has_two_rigid_motions_and_the_modes_of_the_tables():
    full = fi.assemble(FREE, elements=60)
    modes = fi.solve_modes(full, 5)
    assert np.all(modes.natural_frequency[:2] == 0.0)
    stiffness, mass = full.section_at("root").bending_stiffness, 2700 * 0.02 * 2e-3
    exact = np.array([4.730040744862704, 7.853204624095838, 10.995607838001671]) ** 2
    exact *= np.sqrt(stiffness / mass) / (2 * np.pi * 0.5**2)
    np.testing.assert_allclose(modes.natural_frequency[2:], exact, rtol=2e-6)


@pytest.mark.parametrize(
    "damping", [None, FREE.damping, fi.Rayleigh(0.01, frequencies=(40.0, 120.0)), fi.ModalDamping((0, 0, 0.01, 0.02))]
)
def test_a_struck_free_beam_keeps_its_momentum(damping):
    system, speed = reduced(replace(FREE, damping=damping)), 1.0
    ratios = fi.solve_modes(system, 6).damping_ratio
    assert np.all(ratios[:2] == 0.0)
    assert np.all(ratios[2:] > 0.005) or damping is None
    start = fi.State.struck("tip", speed)
    run = fi.integrate(system, fi.Rest(), EXACT, 2.0, fi.Recorder(("tip", "mid")), start)
    before, after = start.relative_to_base(system, run.base)[1], run.final_state.velocity
    nodes = np.repeat(system.unreduced.nodes, 2)
    line = np.where(np.arange(nodes.size) % 2, 1.0, nodes)
    of_rigid = np.column_stack([np.arange(nodes.size) % 2 == 0, line]).astype(float)
    weights = of_rigid.T @ (system.unreduced.M @ system.expansion)
    momentum = weights @ before
    np.testing.assert_allclose(weights @ after, momentum, rtol=1e-13)
    # J/m at the centre of mass, and the angular momentum J L about the root
    row = system.point_row("tip")
    impulse = speed / (row @ row)
    np.testing.assert_allclose(momentum, [impulse, impulse * 0.5], rtol=1e-9)
    assert not run.warnings
    if damping is not None:
        # its own modes die out: the middle goes on with the speed of the centre
        long = fi.integrate(system, fi.Rest(), EXACT, 12.0, fi.Recorder(("mid", "mid.velocity")), start)
        assert long["mid.velocity"][-1] == pytest.approx(impulse / BEAM.mass, rel=1e-6)
        assert run.energy.structure_loss[-1] > 0.1 * run.energy.stored[0]


def test_rayleigh_damping_of_a_free_beam_is_that_of_its_elastic_modes():
    full = fi.assemble(FREE, elements=12)
    rigid = rigid_motions(full)
    # of what is as long as the terms of the matrix
    assert np.abs(full.C @ rigid).max() < 1e-9 * (abs(full.C) @ np.abs(rigid)).max()
    np.testing.assert_allclose(fi.solve_modes(full, 4).damping_ratio, [0, 0, 0.01, 0.01], atol=1e-9)


def test_what_a_free_beam_does_not_have_is_refused():
    for system in (reduced(FREE), fi.assemble(FREE, elements=12)):
        method = EXACT if system.is_diagonal else fi.Newmark(1e-4)
        with pytest.raises(fi.InputError, match="must be held: a force moves what is free without end"):
            fi.integrate(system, None, method, 0.1, initial=fi.State.pulled("tip", 1e-3))
        with pytest.raises(fi.InputError, match="must be held"):
            fi.State.under_force(system, 1.0)
    falling = reduced(replace(FREE, gravity=-9.81))
    with pytest.raises(fi.InputError, match=r"initial = 'static'.*rigid motion free, on which"):
        fi.integrate(falling, None, EXACT, 0.1, initial=fi.State.static())
    with pytest.raises(fi.InputError, match="must begin with 2 of 0: a rigid motion has no ratio"):
        fi.assemble(replace(FREE, damping=fi.ModalDamping((0.01, 0.01, 0.01))), elements=12)


@pytest.mark.parametrize(
    ("words", "call"),
    [
        (r"pull = 'root'.*must be a place that moves", lambda s: begun(s, fi.State.pulled("root", 1e-3))),
        (r"blow = 'root'.*must be a place that moves", lambda s: begun(s, fi.State.struck("root", 1.0))),
        (r"at = 'nose': unknown", lambda s: begun(s, fi.State.struck("nose", 1.0))),
        (r"displacement = nan m", lambda s: fi.State.pulled("tip", float("nan"))),
        (r"pull = 3 m: must be a place and a finite number in m", lambda s: fi.State(pull=3)),
        (r"pull = .*left out where that of dofs is given", lambda s: fi.State([0.0] * 6, pull=("tip", 1e-3))),
        (r"excitation = 'Rest': must be .*integrate runs", lambda s: fi.find_orbit(s, None, guess=fi.State())),
        (r"excitation = 'Rest': must be one Sine", lambda s: fi.orbits.two_impact_orbits(s, fi.Rest())),
        (r"amplitude = 'Rest': has no frequency", lambda s: fi.frequency_sweep(s, fi.Rest(), [5.0], EXACT, 30)),
        (r"history = 'Rest': must be a Sine", lambda s: fi.PointForce("tip", fi.Rest())),
    ],
)  # fmt: skip
def test_faults_are_said_by_name(words, call):
    with pytest.raises(fi.InputError, match=words):
        call(reduced(replace(CLAMPED, impactors=(BALL,))))


# ---- study files -----------------------------------------------------------------------------------


def test_a_study_of_a_base_at_rest_is_a_free_decay(tmp_path):
    study = read_study(STUDY, tmp_path / "study.toml")
    assert study.excitation == fi.Rest()
    assert study_text(study)
    assert study.history_words == "2 s of a base at rest, nothing drives it"
    rows = fi.preflight(study).rows
    assert not [row for row in rows if "drive" in row.what or "base" in row.what]
    with pytest.raises(fi.InputError, match=r"base\.frequency: needs a motion of the base, .* of kind 'rest'"):
        fi.preflight(
            read_study(
                STUDY + "[study]\naxes = { 'base.frequency' = [4, 5] }\nmeasures = ['peak']\n", tmp_path / "study.toml"
            )
        )
    results = fi.run_study(study, tmp_path / "results")
    assert results is not None
    page = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert "Nothing drives it: a free decay." in page
    assert "Damping ratio over the amplitude" in page
    assert "acceleration of the base" not in page
    assert "0.5 Hz" not in page
