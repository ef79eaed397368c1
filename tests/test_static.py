"""Constant forces, preloaded stops and the static state: beam theory, complementarity, and runs that stay at rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import build, load_study, oscillator

import femimpact as fi
from femimpact.system.static import static_contacts

pytestmark = pytest.mark.impacts

LENGTH, BOX, GRAVITY = 0.25, 0.02, -9.81
BEAM = fi.Beam.uniform(length=LENGTH, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700.0)
EI, MASS_PER_LENGTH = BEAM.segments[0].bending_stiffness, BEAM.segments[0].mass_per_length
SOFT, STIFF = fi.KelvinVoigt(stiffness=2e3, damping=1.0), fi.Rigid(0.6)
STILL = fi.Sine(0.0, 5.0)


def beam(*, elements=16, modes=None, **more):
    full = fi.assemble(fi.Structure(BEAM, masses=(fi.PointMass("box", "tip", BOX),), **more), elements=elements)
    return full if modes is None else fi.reduce(full, modes)


def sprung(stiffness=400.0, damping=0.0, **more):
    return oscillator(stiffness, damping, **more)


# ---- the static state -------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [1, 7, 40])
@pytest.mark.parametrize("modes", [None, "all"])
def test_a_cantilever_sags_as_beam_theory_has_it(elements, modes):
    system = beam(elements=elements, gravity=GRAVITY)
    if modes == "all":
        system = fi.reduce(system, system.dofs)
    u, y = fi.static_state(system)
    sag = GRAVITY * (MASS_PER_LENGTH * LENGTH**4 / (8 * EI) + BOX * LENGTH**3 / (3 * EI))
    # cubic elements are exact at their nodes under a uniform load
    assert float(system.point_row("tip") @ u) == pytest.approx(sag, rel=1e-10)
    assert y.size == 0


def test_a_ball_hands_its_weight_on():
    ball = fi.Impactor("ball", "tip", 3e-3, 2e-3, STIFF, acceleration=1.0)
    system = beam(impactors=(ball,), gravity=GRAVITY)
    u, y = fi.static_state(system)
    load = BOX * GRAVITY + 3e-3 * (GRAVITY + 1.0)
    sag = GRAVITY * MASS_PER_LENGTH * LENGTH**4 / (8 * EI) + load * LENGTH**3 / (3 * EI)
    tip = float(system.point_row("tip") @ u)
    assert tip == pytest.approx(sag, rel=1e-10)
    # on the lower wall
    assert y[0] - tip == pytest.approx(-2e-3, abs=1e-15)
    assert system.contacts[0].acceleration == GRAVITY + 1.0


@pytest.mark.parametrize(
    ("law", "spring", "gap", "expected"),
    [
        # x = m g/k of the spring, the wall with p = (m g - k gap)/(k + k_c), (m g/k_c)^(2/3), and the middle of the box
        (STIFF, 20.0, 2e-3, 0.03 / 20.0),
        (STIFF, 20.0, 1e-3, 1e-3),
        (SOFT, 20.0, 1e-3, 1e-3 + (0.03 - 0.02) / 2020.0),
        (SOFT, 0.0, 1e-3, 1e-3 + 0.03 / 2e3),
        (fi.Hertz(1e6), 0.0, 1e-3, 1e-3 + (0.03 / 1e6) ** (2 / 3)),
        (fi.Hertz(1e6), 20.0, 2e-3, 0.03 / 20.0),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_ball_rests_on_spring_or_wall(law, spring, gap, expected, sign):
    ball = fi.Impactor("ball", "mass", 0.01, gap, law, free_stiffness=spring, acceleration=sign * 3.0)
    system = sprung(impactors=[ball])
    u, y = fi.static_state(system)
    assert u[0] == pytest.approx(sign * 0.03 / 400.0, rel=1e-14)
    assert sign * (y[0] - u[0]) == pytest.approx(expected, rel=1e-12)


def test_a_spring_and_a_hertz_wall_share_a_weight():
    ball = fi.Impactor("ball", "mass", 0.01, 1e-3, fi.Hertz(1e6), free_stiffness=20.0, acceleration=3.0)
    found = static_contacts(sprung(impactors=[ball]))
    depth = found.other[0] - found.displacement[0] - 1e-3
    assert 1e6 * depth**1.5 + 20.0 * (1e-3 + depth) == pytest.approx(0.03, rel=1e-12)
    assert found.normal[0] == pytest.approx(1e6 * depth**1.5, rel=1e-10)


def test_a_ball_that_nothing_holds_sits_in_the_middle():
    ball = fi.Impactor("ball", "tip", 3e-3, (1e-3, 5e-3), STIFF, acceleration=-GRAVITY)
    u, y = fi.static_state(system := beam(impactors=(ball,), gravity=GRAVITY))
    assert y[0] == pytest.approx(float(system.point_row("tip") @ u), abs=1e-15)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("place", [0.5 * LENGTH, LENGTH])
@pytest.mark.parametrize("law", [STIFF, SOFT, fi.Hertz(1e7), fi.contact.PowerLaw(1e7, exponent=2.0)])
def test_a_preloaded_stop_pushes_with_the_force_of_beam_theory(law, place, side):
    preload = 2e-4
    gap = (-preload, math.inf) if side > 0 else (3e-4, -preload)
    system = beam(stops=(fi.Stop("wall", place, gap, law),))
    found = static_contacts(system)
    force, w = side * found.normal[0], float(system.point_row(place) @ found.displacement)
    # of the cantilever, 3 EI/a^3
    assert force == pytest.approx(-side * w * 3 * EI / place**3, rel=1e-9)
    depth = preload + side * w
    if law is STIFF:
        assert depth == pytest.approx(0.0, abs=1e-15)
    elif law is SOFT:
        assert force == pytest.approx(2e3 * depth, rel=1e-9)
    else:
        assert force == pytest.approx(1e7 * depth**law.exponent, rel=1e-9)
    assert force > 0.0


def test_a_propped_cantilever_leans_on_its_prop():
    rigid = fi.Stop("prop", "tip", (math.inf, 0.0), STIFF)
    system = fi.assemble(fi.Structure(BEAM, stops=(rigid,), gravity=GRAVITY), elements=6)
    found = static_contacts(system)
    # 3/8 of the weight, upwards: of the - wall
    assert -found.normal[0] == pytest.approx(3 / 8 * BEAM.mass * -GRAVITY, rel=1e-9)
    assert float(system.point_row("tip") @ found.displacement) == pytest.approx(0.0, abs=1e-15)
    # gravity the other way leaves it
    other = static_contacts(fi.assemble(fi.Structure(BEAM, stops=(rigid,), gravity=-GRAVITY), elements=6))
    assert other.normal[0] == 0.0


def test_a_stop_in_space_is_where_the_base_has_left_it():
    system = beam(stops=(fi.Stop("wall", "tip", (1e-4, math.inf), STIFF, fixed_to="space"),))
    # x = w + ub: pressed by all of ub beyond the gap
    found = static_contacts(system, 3e-4)
    assert float(system.point_row("tip") @ found.displacement) == pytest.approx(-2e-4, abs=1e-15)
    assert found.other[0] == 3e-4
    u, v, y, rate = fi.State.static().relative_to_base(system, base := fi.Sine(5e-4, 3.0, phase=math.asin(0.6)))
    np.testing.assert_allclose(u, found.displacement, rtol=1e-12)
    assert (y[0], rate[0]) == (base.displacement(0.0), base.velocity(0.0))
    np.testing.assert_array_equal(v, 0.0)


LAWS = [
    STIFF, fi.KelvinVoigt(stiffness=50.0, damping=0.0), fi.KelvinVoigt(stiffness=1e5, damping=3.0), fi.Hertz(1e5),
    fi.contact.PowerLaw(3e3, exponent=1.2),
]  # fmt: skip


@pytest.mark.parametrize("seed", range(60))
def test_walls_push_or_are_open_on_random_systems(seed):
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(2, 12)), int(rng.integers(1, 7))
    factor = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-1, 1, n)
    K = factor @ factor.T + 0.1 * np.eye(n)
    points = {f"p{i}": rng.normal(size=n) * 10.0 ** rng.uniform(-1, 1) for i in range(count)}
    laws = [LAWS[i] for i in rng.integers(0, len(LAWS), count)]
    stops = []
    for i, law in enumerate(laws):
        # as many rigid walls as dofs cannot all be preloaded
        low = -0.01 if i < n // 2 else 0.0
        gaps = sorted(rng.uniform(low, 0.02, 2))
        stops.append(fi.Stop(f"wall{i}", f"p{i}", (gaps[0], max(gaps[1], 0.011)), law))
    load = rng.normal(size=n) * rng.choice([0.0, 0.1, 10.0])
    system = fi.System.from_matrices(np.eye(n), np.zeros((n, n)), K, points=points, stops=stops, constant_load=load)
    found = static_contacts(system)
    u, size = found.displacement, np.abs(K @ found.displacement).max() + np.abs(load).max()
    force = sum(pair.direction * normal for pair, normal in zip(system.contacts, found.normal, strict=True))
    # the balance to the rounding of a solution with the condition of K
    np.testing.assert_allclose(K @ u - load - force, 0.0, atol=1e-9 * size + 1e-300)
    for pair, normal in zip(system.contacts, found.normal, strict=True):
        x = -float(pair.direction @ u)
        depth = max(x - pair.gaps[0], -pair.gaps[1] - x)
        numbers = pair.parameters
        if pair.law is STIFF:
            assert depth <= 1e-11
            assert normal == 0.0 or depth >= -1e-11
        else:
            wanted = numbers.stiffness * max(depth, 0.0) ** numbers.exponent
            assert abs(normal) == pytest.approx(wanted, rel=1e-6, abs=1e-9 * size)
        # walls never pull
        assert normal * (1.0 if x - pair.gaps[0] > -pair.gaps[1] - x else -1.0) >= 0.0


# ---- runs -------------------------------------------------------------------------------------------

REST = [
    (SOFT, fi.Newmark(5e-5)),
    (SOFT, fi.Newmark(5e-5, contact="energy-consistent")),
    (SOFT, fi.Newmark(5e-4, refine=10)),
    (SOFT, fi.GeneralizedAlpha(5e-5)),
    (STIFF, fi.MoreauJean(5e-5)),
    (STIFF, fi.MoreauJean(5e-5, theta=1.0)),
]


@pytest.mark.parametrize("modes", [None, 5])
@pytest.mark.parametrize(("law", "method"), REST)
def test_a_static_start_stays_at_rest(law, method, modes):
    ball = fi.Impactor("ball", "tip", 3e-3, 1e-3, law)
    stop = fi.Stop("wall", "mid", (math.inf, -1e-4), law)
    system = beam(modes=modes, impactors=(ball,), stops=(stop,), gravity=GRAVITY)
    record = fi.Recorder(("tip", "ball", "ball.contact_force", "wall.contact_force"))
    run = fi.integrate(system, STILL, method, 0.1, record, fi.State.static())
    rest = static_contacts(system)
    # rounding of a deflection of 10 mm; of physical dofs K u is taken from entries of 1e8 N/m
    small = 1e-12 if modes is None else 1e-14
    for name in ("tip", "ball"):
        assert np.ptp(run[name]) < small
    # a displacement of 1e-14 m is 2e-11 N in these walls, over dt a velocity of 1e-10 m/s an impulse
    np.testing.assert_allclose(run["ball.contact_force"], rest.normal[0], atol=1e-7)
    np.testing.assert_allclose(run["wall.contact_force"], -rest.normal[1], atol=1e-4 if law is STIFF else 1e-7)
    assert run["ball.contact_force"][-1] == pytest.approx(3e-3 * GRAVITY, rel=1e-5)
    assert run.energy.residual < 1e-9
    assert len(run.impacts) == 0
    assert not run.warnings


def test_a_preloaded_start_without_displacements_is_the_static_state():
    stop = fi.Stop("wall", "tip", (-1e-4, 3e-4), SOFT)
    system = beam(modes=3, stops=(stop,))
    run = fi.integrate(system, STILL, fi.Newmark(1e-4), 0.05, fi.Recorder(("tip",)))
    assert run["tip"][0] == pytest.approx(float(system.point_row("tip") @ fi.static_state(system)[0]), rel=1e-12)
    assert np.ptp(run["tip"]) < 1e-15
    # displacements that are given, between the walls, are taken as they are
    lower = fi.State(displacement=-2e-4 * np.eye(3)[0] / system.point_row("tip")[0])
    run = fi.integrate(system, STILL, fi.Newmark(1e-4), 0.05, fi.Recorder(("tip",)), lower)
    assert run["tip"][0] == pytest.approx(-2e-4, rel=1e-12)


@pytest.mark.parametrize("contact", ["end", "energy-consistent"])
def test_free_vibration_about_a_static_state_has_the_stiffness_of_both(contact):
    spring, wall, speed = 400.0, 2500.0, 0.02
    stop = fi.Stop("wall", "mass", (-5e-3, math.inf), fi.KelvinVoigt(stiffness=wall, damping=0.0))
    system = sprung(spring, stops=[stop], constant_load=[2.0])
    omega = math.sqrt(spring + wall)
    rest = (2.0 - wall * 5e-3) / (spring + wall)
    start = fi.State(velocity=[speed])
    dt = 2e-4
    method = fi.Newmark(dt, contact=contact)
    run = fi.integrate(system, STILL, method, 1.0, fi.Recorder(("mass", "wall.contact_force")), start)
    # speed/omega is less than the static penetration of 4 mm: never open. Phase error omega^3 dt^2/12 over 1 s
    exact = rest + speed / omega * np.sin(omega * run.time)
    np.testing.assert_allclose(run["mass"], exact, rtol=0, atol=speed / omega * omega**3 * dt**2 / 11)
    # at the step's end, or the mean of the step
    np.testing.assert_allclose(run["wall.contact_force"], -wall * (run["mass"] + 5e-3), atol=wall * speed * dt)
    # elastic forces at the step's end are those of the linear system, whose ledger closes
    assert run.energy.residual < 1e-12
    np.testing.assert_allclose(run.energy.work, 2.0 * (run["mass"] - run["mass"][0]), atol=1e-15)


def test_a_contact_from_the_start_on_ends_as_an_impact_without_approach():
    stop = fi.Stop("wall", "mass", (-1e-3, math.inf), fi.KelvinVoigt(stiffness=2500.0, damping=0.0))
    run = fi.integrate(sprung(stops=[stop]), STILL, fi.Newmark(1e-4), 0.5, initial=fi.State(velocity=[-0.2]))
    first = run.impacts
    assert first.time[0] == 0.0
    assert first.approach_speed[0] == 0.0
    assert math.isnan(first.restitution[0])
    assert np.all(first.approach_speed[1:] > 0.0)


@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_a_ball_stays_on_its_floor_while_the_base_shakes_with_less_than_gravity(phase):
    ball = fi.Impactor("ball", "mass", 0.1, 1e-3, fi.Rigid(0.6), acceleration=GRAVITY)
    system = sprung(4e4, 2.0, impactors=[ball], constant_load=[GRAVITY])
    base, dt = fi.Sine(-0.5 * GRAVITY / (10 * math.pi) ** 2, 5.0, phase), 5e-5
    record = fi.Recorder(("mass", "mass.velocity", "ball", "ball.contact_force"))
    run = fi.integrate(system, base, fi.MoreauJean(dt), 1.0, record, fi.State.static())
    np.testing.assert_allclose(run["ball"] - run["mass"], -1e-3, rtol=0, atol=1e-13)
    assert len(run.impacts) == 0
    np.testing.assert_array_equal(run.sticking.start, 0.0)
    # m (g - y'' - ub''), with the force the mean of a step: half a step late, by its slope of 40 N/s
    acceleration = np.gradient(run["mass.velocity"], dt) + base.acceleration(run.time)
    exact = 0.1 * (GRAVITY - acceleration)
    np.testing.assert_allclose(run["ball.contact_force"][3:-3], exact[3:-3], atol=5e-3)
    assert run.energy.residual < 1e-12


def test_constant_force_alone_moves_a_free_mass_exactly():
    free = fi.System.from_matrices([[2.0]], [[0.0]], [[0.0]], points={"mass": [1.0]}, constant_load=[3.0])
    for method in (fi.Newmark(1e-2), fi.HHT(1e-2), fi.MoreauJean(1e-2)):
        run = fi.integrate(free, STILL, method, 2.0, fi.Recorder(("mass",)))
        # constant acceleration is exact, to the rounding of 200 sums
        np.testing.assert_allclose(run["mass"], 0.75 * run.time**2, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(run.energy.work, 3.0 * run["mass"], rtol=1e-12, atol=1e-15)
        assert run.energy.residual < 1e-12


SHIFTED = [
    fi.Newmark(1e-4), fi.Newmark(1e-4, contact="energy-consistent"), fi.HHT(1e-4), fi.WBZ(1e-4),
    fi.GeneralizedAlpha(1e-4), fi.Newmark(4e-4, refine=4), fi.MoreauJean(1e-4, theta=0.6),
]  # fmt: skip


@pytest.mark.parametrize("method", SHIFTED, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("modes", [None, 3])
def test_a_constant_load_shifts_the_gaps_of_a_stop_and_nothing_else(method, modes):
    law = STIFF if isinstance(method, fi.MoreauJean) else SOFT
    heavy = beam(elements=4, modes=modes, stops=(fi.Stop("wall", "tip", (2e-3, 12e-3), law),), gravity=GRAVITY)
    sag = float(heavy.point_row("tip") @ fi.static_state(heavy)[0])
    light = replace(heavy, constant_load=None, contacts=(replace(heavy.contacts[0], gaps=(2e-3 - sag, 12e-3 + sag)),))
    base = fi.Sine(1e-3, 6.0)
    record = fi.Recorder(("tip", "wall.contact_force"))
    shifted = fi.integrate(heavy, base, method, 0.5, record, fi.State.static())
    plain = fi.integrate(light, base, method, 0.5, record)
    # impacts multiply rounding: some five of them, in physical dofs from 1e-14 m on
    np.testing.assert_allclose(shifted["tip"] - sag, plain["tip"], atol=1e-9)
    assert len(shifted.impacts) == len(plain.impacts) > 2
    difference = shifted.energy.residual_history * shifted.energy.largest_input
    expected = plain.energy.residual_history * plain.energy.largest_input
    np.testing.assert_allclose(difference, expected, atol=1e-9)


def test_cases_side_by_side_feel_a_constant_load_as_one_alone_does():
    stop = fi.Stop("wall", "tip", (-1e-4, 12e-3), SOFT, fixed_to="space")
    ball = fi.Impactor("ball", "tip", 3e-3, 4e-3, SOFT)
    system = beam(elements=4, modes=3, stops=(stop,), impactors=(ball,), gravity=GRAVITY)
    method = fi.Newmark(1e-4, contact="energy-consistent")
    f = np.linspace(5.0, 7.0, 9)
    curve = fi.frequency_sweep(system, 2e-4, f, method, 3, initial=fi.State.static(), ledger=True, threads=1)
    assert curve.start == "static"
    assert np.max(curve.energy_residual) < 1e-12
    for i in (0, 8):
        alone = fi.frequency_sweep(system, 2e-4, f[i : i + 1], method, 3, initial=fi.State.static(), threads=1)
        # a case alone rounds as it does in a pack, its contact equations apart
        assert curve.peak[i] == pytest.approx(alone.peak[0], rel=1e-9)
        assert curve.mean_impulse[i] == pytest.approx(alone.mean_impulse[0], rel=1e-6, nan_ok=True)


# ---- what is refused --------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [(-1e-4, -1e-4), -1e-4, (-1e-4, 1e-4), (-2e-4, 1e-4), (-math.inf, math.inf)])
def test_a_stop_that_leaves_no_place_is_refused(gap):
    with pytest.raises(fi.InputError, match=r"gap = .*: must be one number >= 0 or two .* their sum is > 0") as refused:
        fi.Stop("wall", "tip", gap, SOFT)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    "law",
    [
        fi.contact.Flores(1e7, 0.7),
        fi.CustomLaw(lambda depth, rate, speed: 1e4 * depth),
        fi.contact.SwitchingSpring(1.0, 1e4),
    ],
)
def test_a_law_without_a_force_at_rest_is_refused_by_name_where_it_is_pressed(law):
    words = f"wall.contact = '{law.name}': must be Rigid, KelvinVoigt or a power law without loss for a static state"
    # the switching spring has no preload: gravity presses it
    gap = (0.0, 0.0) if isinstance(law, fi.contact.SwitchingSpring) else (1.0, -1e-4)
    pressed = beam(stops=(fi.Stop("wall", "tip", gap, law),), gravity=GRAVITY)
    with pytest.raises(fi.InputError, match=words):
        fi.static_state(pressed)
    ball = fi.Impactor("ball", "tip", 3e-3, 1e-3, law, acceleration=-1.0)
    with pytest.raises(fi.InputError, match=words.replace("wall", "ball")):
        fi.static_state(beam(impactors=(ball,)))
    # nothing presses it: its force at rest is not asked for
    _, y = fi.static_state(beam(impactors=(replace(ball, acceleration=0.0),)))
    assert y[0] == 0.0


def test_what_has_no_static_state_is_refused():
    unheld = fi.System.from_matrices(1.0, 0.0, 0.0, points={"mass": [1.0]}, constant_load=[1.0])
    with pytest.raises(fi.InputError, match="initial = 'static': needs a structure that is held: K is singular"):
        fi.static_state(unheld)
    walls = [fi.Stop("a", "mass", (-1e-3, math.inf), STIFF), fi.Stop("b", "mass", (math.inf, 0.0), STIFF)]
    with pytest.raises(fi.InputError, match="rigid stops among a, b leave the structure no place"):
        fi.static_state(sprung(stops=walls))
    ball = sprung(impactors=[fi.Impactor("ball", "mass", 0.1, 1.0, STIFF, acceleration=1.0)])
    open_box = replace(ball, contacts=(replace(ball.contacts[0], gaps=(math.inf, 1.0)),))
    with pytest.raises(fi.InputError, match=r"ball\.gaps = .*: must be finite where a constant force presses the ball"):
        fi.static_state(open_box)
    with pytest.raises(fi.InputError, match="system = 'Structure': must be a System"):
        fi.static_state(fi.Structure(BEAM))


def test_a_static_start_is_one_relative_to_the_base():
    words = "frame = 'space': must be 'base' for a static start"
    with pytest.raises(fi.InputError, match=words):
        fi.State(frame="space", equilibrium=True)
    preloaded = sprung(stops=[fi.Stop("wall", "mass", (-1e-3, math.inf), SOFT)])
    with pytest.raises(fi.InputError, match=f"initial.{words}"):
        fi.State.at_rest("space").relative_to_base(preloaded, STILL)


def test_a_start_inside_a_rigid_wall_is_refused_and_inside_a_soft_one_is_taken():
    for law, refused in ((SOFT, False), (fi.Rigid(0.5), True)):
        preloaded = sprung(stops=[fi.Stop("wall", "mass", (-1e-3, math.inf), law)])
        rest = fi.static_state(preloaded)[0]
        fi.State(displacement=rest, equilibrium=True).relative_to_base(preloaded, STILL)
        for start in (fi.State(displacement=0.9 * rest), fi.State(displacement=[0.0])):
            if refused:
                with pytest.raises(
                    fi.InputError, match=r"initial\.wall\.gap = .* must start between its walls, -inf to -0\.001"
                ):
                    start.relative_to_base(preloaded, STILL)
            else:
                start.relative_to_base(preloaded, STILL)


def test_a_constant_load_may_be_replaced_and_must_fit():
    system = beam(elements=2)
    np.testing.assert_array_equal(system.constant_load, 0.0)
    heavier = replace(system, constant_load=system.base_load * GRAVITY)
    np.testing.assert_array_equal(heavier.constant_load, beam(elements=2, gravity=GRAVITY).constant_load)
    for wrong in (np.ones(3), np.full(system.dofs, np.nan), "much"):
        with pytest.raises(fi.InputError, match="constant_load"):
            replace(system, constant_load=wrong)
    with pytest.raises(fi.InputError, match="constant_load"):
        sprung(constant_load=[1.0, 2.0])
    with pytest.raises(fi.InputError, match="gravity = 'down'"):
        fi.Structure(BEAM, gravity="down")


# ---- the study file ---------------------------------------------------------------------------------

STUDY = """
[beam]
length = 0.25
width = 0.02
thickness = 0.001
young_modulus = 70e9
density = 2700
[mesh]
elements = 8
[[mass]]
name = "box"
at = "tip"
mass = 0.02
[[stop]]
name = "wall"
at = "tip"
gap = [-1e-4, inf]
fixed_to = "space"
contact = { law = "kelvin-voigt", stiffness = 2e3, damping = 1.0 }
[gravity]
acceleration = -9.81
[reduction]
modes = 3
[base]
amplitude = 1e-4
frequency = 5.0
start = "static"
"""


def test_a_study_file_says_all_of_it(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    study = load_study(path)
    wall = fi.Stop("wall", "tip", (-1e-4, math.inf), SOFT, fixed_to="space")
    assert study.structure.stops == (wall,)
    assert study.structure.gravity == GRAVITY
    assert study.initial.equilibrium
    _, small, method = build(study)
    assert small.contacts[0].fixed_to == "space"
    run = fi.integrate(small, study.sine, method, 0.2, initial=study.initial)
    assert run["tip"][0] == pytest.approx(float(small.point_row("tip") @ fi.static_state(small)[0]), rel=1e-12)
    for find, put, words in (
        ('fixed_to = "space"', 'fixed_to = "moon"', "stop.wall.fixed_to = 'moon': must be 'base' or 'space'"),
        ("gap = [-1e-4, inf]", "gap = [-1e-4, -1e-4]", "stop.wall.gap = (-0.0001, -0.0001) m: must be one number >= 0"),
        ("acceleration = -9.81", "acceleration = inf", "gravity.acceleration = inf m/s^2: must be a finite number"),
        ("acceleration = -9.81", "", "gravity.acceleration: is missing"),
        ('start = "static"', 'start = "moon"', "base.start = 'moon': must be 'base' or 'space' or 'static'"),
    ):
        path.write_text(STUDY.replace(find, put), encoding="utf-8")
        with pytest.raises(fi.InputError) as refused:
            load_study(path)
        assert words in str(refused.value)
