"""A restitution that depends on the approach speed: closed forms, the ledger, orbits and their derivatives, studies."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from builders import REFERENCE, paper_study_text, read_study, reduced, rigid_study, study_text, with_ball
from scipy.optimize import brentq

import femimpact as fi
from femimpact.contact.laws import restitution_over, speed_pieces_of
from femimpact.validation.contacts import GRAVITY, shaken_floor

pytestmark = pytest.mark.impacts

POWER = fi.Rigid(0.8, at_speed=0.1, exponent=-0.25, at_most=0.95)
TABLE = fi.Rigid(0.8, over_speed=[(0.05, 1.1), (0.2, 0.9), (0.4, 0.5)])
LAWS = pytest.mark.parametrize("law", [POWER, TABLE], ids=["power", "table"])


def test_dropped_ball_loses_by_the_power_of_its_speed():
    """v_n = c^(4 (1 - q^n)) v_0^(q^n) with q = 3/4, above the speed from which the restitution is constant."""
    height, slowest, c, q = 0.02, 0.1 * (0.95 / 0.8) ** -4, 0.8 * 0.1**0.25, 0.75
    run = fi.integrate(
        shaken_floor(POWER, (1.0, height), -GRAVITY), fi.Sine(0.0, 5.0), fi.EventDriven(), 2.0, fi.Recorder(("ball",))
    )
    speed = run.impacts.approach_speed
    falling = q ** np.arange(speed.size)
    exact = c ** (4 * (1 - falling)) * math.sqrt(2 * GRAVITY * height) ** falling
    above = exact > slowest
    assert above.sum() > 5
    assert speed[above] == pytest.approx(exact[above], rel=1e-13)
    # below it the ball comes to rest as with one restitution
    slow = run.impacts.rebound_speed[1:-1][speed[1:-1] < slowest] / speed[1:-1][speed[1:-1] < slowest]
    assert slow == pytest.approx(0.95, rel=1e-12)
    assert run.sticking.start.size == 1


@pytest.mark.parametrize(
    ("law", "speed", "exact"),
    [
        (POWER, 0.0, 0.95), (POWER, 0.0502, 0.95), (POWER, 0.1, 0.8), (POWER, 1.6, 0.4),
        (TABLE, 0.0, 0.88), (TABLE, 0.05, 0.88), (TABLE, 0.125, 0.8), (TABLE, 0.3, 0.56), (TABLE, 9.0, 0.4),
        (fi.Rigid(0.8, over_speed=[(0.1, 0.5)]), 0.05, 0.4), (fi.Rigid(0.8), 0.05, 0.8),
    ],
)  # fmt: skip
def test_restitution_at_a_speed(law, speed, exact):
    assert law.parameters(1.0).restitution_at(speed) == pytest.approx(exact, rel=1e-14)
    if speed:
        assert fi.collide(law, 0.5, speed).restitution == pytest.approx(exact, rel=1e-14)


@LAWS
def test_slope_is_the_derivative_by_a_complex_step(law):
    for speed in (0.01, 0.07, 0.25, 0.9):
        _, slope = restitution_over(speed_pieces_of(law, law.restitution), speed)
        stepped, _ = restitution_over(speed_pieces_of(law, law.restitution), speed + 1e-30j)
        assert slope == pytest.approx(np.imag(stepped) / 1e-30, rel=1e-13)


def test_factors_of_one_leave_every_bit():
    system = reduced(with_ball(REFERENCE, contact=fi.Rigid(0.7)), 4)
    same = reduced(with_ball(REFERENCE, contact=fi.Rigid(0.7, over_speed=[(0.01, 1.0), (0.1, 1.0)])), 4)
    one, other = (fi.integrate(each, fi.Sine(2e-4, 5.0), fi.EventDriven(), 8.0) for each in (system, same))
    assert one.impacts.time.size > 20
    assert np.array_equal(one["tip"], other["tip"])


@LAWS
def test_impacts_on_a_beam_rebound_by_the_law_and_the_ledger_closes(law):
    system = reduced(with_ball(REFERENCE, contact=law), 4)
    run = fi.integrate(system, fi.Sine(4e-4, 5.0), fi.EventDriven(), 10.0)
    speeds = run.impacts.approach_speed
    assert np.ptp(speeds[speeds > 0]) > 0.1
    expected = [law.parameters(1.0).restitution_at(speed) for speed in speeds]
    moving = run.impacts.rebound_speed > 0.0
    assert moving.mean() > 0.8
    assert run.impacts.rebound_speed[moving] == pytest.approx((expected * speeds)[moving], rel=1e-12)
    lost = 0.5 * run.impacts.impulse * (speeds - run.impacts.rebound_speed)
    assert run.impacts.energy_loss == pytest.approx(lost, rel=1e-9, abs=1e-18)
    assert run.energy.residual < 1e-11


def box_orbits(restitution, exponent, ratio):
    """Phase, speed after an impact and eigenvalue product of two impacts a cycle in a box that moves by sin(theta).

    The ball flies V pi = 2 (d + sin theta) between the walls at distances +-d, and meets the wall at V - cos theta.
    """

    def left(phase):
        speed = 2 * (ratio + math.sin(phase)) / math.pi
        approach = speed - math.cos(phase)
        return speed + math.cos(phase) - restitution * approach**exponent * approach

    phases = np.linspace(0.0, 2.0 * math.pi, 4001)
    for low, high in pairwise(phases.tolist()):
        if left(low) * left(high) < 0.0:
            phase = brentq(left, low, high, xtol=1e-15)
            speed = 2 * (ratio + math.sin(phase)) / math.pi
            e = restitution * (speed - math.cos(phase)) ** exponent
            yield phase, speed, e * e * (1.0 + exponent)


def test_two_impacts_in_a_box_are_those_of_the_closed_form():
    amplitude, frequency, ratio = 1e-3, 10.0, 2.0
    unit = 2.0 * math.pi * frequency * amplitude
    law = fi.Rigid(0.6, at_speed=unit, exponent=-0.25, at_most=0.99)
    system = shaken_floor(law, (ratio * amplitude, ratio * amplitude))
    exact = sorted(box_orbits(0.6, -0.25, ratio))
    assert exact[0] == pytest.approx((2.238345816, 1.773203181, 0.174565727), abs=1e-9)
    orbits = fi.orbits.two_impact_orbits(system, fi.Sine(amplitude, frequency))
    assert [orbit.is_stable for orbit in orbits] == [True, False]
    for orbit, (phase, speed, product) in zip(orbits, exact, strict=True):
        # the other wall is met half a period later
        assert orbit.impacts.phase % math.pi == pytest.approx(phase % math.pi, abs=1e-11)
        assert orbit.impacts.rebound_speed[0] / unit == pytest.approx(speed + math.cos(phase), rel=1e-11)
        # of the whole period: those of the floor, which the ball does not move, and of two impacts of the ball
        floor = math.exp(-0.1 / frequency)
        assert np.prod(orbit.multipliers).real == pytest.approx(product**2 * floor, rel=1e-9)


@LAWS
def test_orbit_of_a_beam_has_the_multipliers_of_its_own_runs(law):
    """Central differences of runs over one period, in the state of which the orbit is."""
    system, drive = reduced(with_ball(REFERENCE, contact=law), 2), fi.Sine(4e-4, 5.2)
    orbit = fi.orbits.two_impact_orbits(system, drive)[0]
    matrix = orbit.monodromy
    start, step, d = orbit.state, 1e-7, system.dofs

    def after(change):
        u, y, v, w = np.split(state_row(start) + change, [d, d + 1, 2 * d + 1])
        state = fi.State(displacement=u, velocity=v, ball_displacement=y, ball_velocity=w, frame="base")
        drive_at = replace(drive, phase=orbit.phase) if hasattr(orbit, "phase") else drive
        run = fi.integrate(system, drive_at, fi.EventDriven(), orbit.period, initial=state)
        return state_row(run.final_state)

    unit = np.maximum(np.abs(state_row(start)), 1e-5)
    columns = [
        (after(row) - after(-row)) / (2 * step * size) for row, size in zip(np.diag(step * unit), unit, strict=True)
    ]
    assert np.array(columns).T / unit[:, None] * unit == pytest.approx(matrix / unit[:, None] * unit, abs=1e-5)


def state_row(state):
    return np.concatenate([state.displacement, state.ball_displacement, state.velocity, state.ball_velocity])


def test_branch_over_the_restitution_has_the_orbits_of_other_laws():
    law, drive = fi.Rigid(0.6, at_speed=0.05, exponent=-0.25, at_most=0.99), fi.Sine(1e-3, 10.0)
    first = fi.orbits.two_impact_orbits(shaken_floor(law, (2e-3, 2e-3)), drive)[0]
    branch = fi.continue_orbit(first, "impactor.ball.contact.restitution", (0.55, 0.7))
    other = fi.orbits.two_impact_orbits(shaken_floor(replace(law, restitution=0.7), (2e-3, 2e-3)), drive)[0]
    (there,) = branch.at(0.7)
    assert there.impacts.approach_speed == pytest.approx(other.impacts.approach_speed, rel=1e-10)
    assert np.abs(there.multipliers) == pytest.approx(np.abs(other.multipliers), rel=1e-8)


@LAWS
def test_sweep_has_the_peaks_of_single_runs(law):
    system = reduced(with_ball(REFERENCE, contact=law), 4)
    curve = fi.frequency_sweep(system, 4e-4, [4.9, 5.2], fi.EventDriven(), 9)
    for frequency, peak in zip(curve.frequency, curve.peak, strict=True):
        run = fi.integrate(system, fi.Sine(4e-4, frequency), fi.EventDriven(), 9 / frequency)
        assert peak == run.steady.peak


def test_study_over_the_exponent_has_the_peaks_of_sweeps():
    def of(law):
        return rigid_study(4, 10, structure=with_ball(REFERENCE, contact=law))

    path = "impactor.ball.contact.exponent"
    axes = {path: [-0.25, -0.1], "base.frequency": [5.2]}
    peaks = fi.parameter_study(of(POWER), axes, ["peak"], cycles=9)["peak"]
    assert np.ptp(peaks.values) > 1e-5
    for exponent in (-0.25, -0.1):
        alone = fi.parameter_study(of(replace(POWER, exponent=exponent)), {"base.frequency": [5.2]}, ["peak"], cycles=9)
        assert peaks.sel({path: exponent}).item() == alone["peak"].item()


def test_study_file_reads_texts_with_units_and_is_written_as_read(tmp_path):
    given = paper_study_text().replace(
        'law = "kelvin-voigt", restitution = 0.78, contact_time = 2e-3',
        'law = "rigid", restitution = 0.78, over_speed = [["10 mm/s", 1.1], [0.2, "90 %"]]',
    )
    given = given.replace('name = "newmark" ', 'name = "event-driven" ')
    study = read_study(given, tmp_path / "study.toml")
    law = study.structure.impactors[0].contact
    assert law == fi.Rigid(0.78, over_speed=[(0.01, 1.1), (0.2, 0.9)])
    changed = replace(study, structure=replace(study.structure, gravity=-9.81))
    assert read_study(study_text(changed), tmp_path / "study.toml").structure == changed.structure
    with pytest.raises(fi.InputError, match="must have a unit that fits: m/s"):
        read_study(given.replace("10 mm/s", "10 mm"), tmp_path / "study.toml")


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"over_speed": [(0.2, 1.0), (0.1, 1.0)]}, "0.2 m/s is followed by 0.1 m/s"),
        ({"over_speed": [(0.1, 1.3)]}, "leave the restitution 0.8 at most 1: it is 1.04"),
        ({"over_speed": [0.1, 1.0]}, "must be rows of a number in m/s, which rises, and a factor"),
        ({"over_speed": [(0.1, -1.0)]}, "all >= 0"),
        ({"exponent": -0.25}, "must be given together"),
        ({"at_speed": 0.1, "exponent": -0.25, "at_most": 0.9, "over_speed": [(0.1, 1.0)]}, "without over_speed"),
        ({"at_speed": 0.1, "exponent": -1.0, "at_most": 0.9}, "exponent = -1.0: must be a finite number > -1"),
        ({"at_speed": 0.1, "exponent": -0.25, "at_most": 1.0}, "at_most = 1.0: must be"),
        ({"at_speed": 0.1, "exponent": -0.25, "at_most": 0.7}, "must be at most at_most, 0.7"),
    ],
)  # fmt: skip
def test_what_is_no_restitution_is_refused(numbers, words):
    with pytest.raises(fi.InputError) as refusal:
        fi.Rigid(0.8, **numbers)
    assert words in str(refusal.value)


def test_a_method_with_steps_refuses_it_by_name():
    system = reduced(with_ball(REFERENCE, contact=POWER), 4)
    with pytest.raises(fi.InputError, match=r"one restitution at all speeds for MoreauJean.*EventDriven"):
        fi.integrate(system, fi.Sine(2e-4, 5.0), fi.MoreauJean(1e-4), 1.0)
