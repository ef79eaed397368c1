"""Contact laws beside the linear one: closed forms against the differential equation, and against published numbers."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import femimpact as fi
from femimpact.figures import OffScreen, contact_laws
from femimpact.figures.contacts import collision_history

MASS, SPEED, STIFFNESS = 3.43e-3, 0.26, 2e9
LOSSY = {
    "hunt-crossley": fi.HuntCrossley,
    "lankarani-nikravesh": fi.contact.LankaraniNikravesh,
    "flores": fi.contact.Flores,
    "gonthier-carvalho-martins": fi.contact.GonthierCarvalhoMartins,
}
PUBLISHED_LOSS = {
    "hunt-crossley": lambda e: 3 * (1 - e) / 2,
    "lankarani-nikravesh": lambda e: 3 * (1 - e**2) / 4,
    "flores": lambda e: 8 * (1 - e) / (5 * e),
}
EVERY_LAW = [
    fi.KelvinVoigt(restitution=0.6, contact_time=2e-3),
    fi.contact.SwitchingSpring(free_stiffness=0.0, stiffness=1e4),
    fi.Hertz(STIFFNESS),
    *(make(STIFFNESS, 0.5) for make in LOSSY.values()),
    fi.Rigid(0.6),
    fi.CustomLaw(lambda depth, rate, speed: 1e4 * depth + 2.0 * rate),
]
"""One of each."""
WITH_FORCE = [law for law in EVERY_LAW if not isinstance(law, fi.Rigid)]


def by_name(law):
    return law.name


def thrown(loss, exponent, stiffness=STIFFNESS, mass=MASS, speed=SPEED):
    """Restitution, contact time, peak force and depth of m p'' = -k p^n (1 + d p'/v), by integration in units of one.

    With length L = (m v^2/k)^(1/(n+1)) and time L/v the equation is x'' = -x^n (1 + d x'), x'(0) = 1.
    """
    length = (mass * speed**2 / stiffness) ** (1 / (exponent + 1))

    def force(state):
        return max(state[0], 0.0) ** exponent * max(1 + loss * state[1], 0.0)

    def back(_, state):
        return state[0]

    back.terminal, back.direction = True, -1
    start = 1e-12  # the event must not fire at the touch itself
    run = solve_ivp(
        lambda _, s: [s[1], -force(s)], (0, 50), [start, 1.0], events=back, method="DOP853", rtol=1e-12, atol=1e-14,
        max_step=2e-3,
    )  # fmt: skip
    peak = max(force(state) for state in run.y.T)
    return (
        -run.y[1, -1],
        run.t[-1] * length / speed,
        peak * mass * speed**2 / length,
        run.y[0].max() * length,
    )


@pytest.mark.parametrize("exponent", [1.5, 2.2])
@pytest.mark.parametrize("e", [0.3, 0.8, 1.0])
@pytest.mark.parametrize("name", LOSSY)
def test_a_collision_is_that_of_the_differential_equation(name, e, exponent):
    law = LOSSY[name](STIFFNESS, e, exponent)
    found = fi.collide(law, MASS, SPEED)
    if name == "gonthier-carvalho-martins":
        # the loss factor read back from the force itself
        at = 1e-5
        elastic = fi.contact.contact_force(law, at, 0.0, SPEED, MASS)
        loss = fi.contact.contact_force(law, at, SPEED, SPEED, MASS) / elastic - 1
    else:
        loss = PUBLISHED_LOSS[name](e)
    restitution, time, peak, depth = thrown(loss, exponent)
    # 1e-12 a step and the event's own root; the contact's end is flat, so the time is worse
    assert found.restitution == pytest.approx(restitution, rel=1e-7)
    assert found.contact_time == pytest.approx(time, rel=1e-5)
    # largest of samples 2e-3 apart (in units of the contact's own time)
    assert found.peak_force == pytest.approx(peak, rel=1e-5)
    assert found.largest_penetration == pytest.approx(depth, rel=1e-5)


@pytest.mark.parametrize("e", [1e-3, 0.05, 0.5, 0.99])
def test_the_exact_loss_factor_returns_the_restitution_asked_for(e):
    # brentq to 1e-14, there and back
    assert fi.collide(fi.contact.GonthierCarvalhoMartins(STIFFNESS, e), MASS, SPEED).restitution == pytest.approx(
        e, rel=1e-9
    )


@pytest.mark.parametrize("speed", [0.01, 0.26, 3.0])
@pytest.mark.parametrize("law", EVERY_LAW, ids=by_name)
def test_energy_loss_is_what_the_rebound_lacks(law, speed):
    found = fi.collide(law, MASS, speed)
    started = 0.5 * MASS * speed**2
    # rounding; without loss, that of the energy itself
    assert found.energy_loss == pytest.approx((1 - found.restitution**2) * started, rel=1e-9, abs=1e-12 * started)


@pytest.mark.parametrize("speed", [0.02, 0.26, 1.0])
@pytest.mark.parametrize("name", LOSSY)
def test_a_law_of_ones_own_is_the_built_in_one(name, speed):
    law = LOSSY[name](STIFFNESS, 0.6)
    own = fi.CustomLaw(lambda depth, rate, at: fi.contact.contact_force(law, depth, rate, at, MASS))
    found, expected = fi.collide(own, MASS, speed), fi.collide(law, MASS, speed)
    # integrated to 1e-10 a step; the end of the contact and the peak are read from the steps themselves
    assert found.restitution == pytest.approx(expected.restitution, rel=1e-6)
    assert found.energy_loss == pytest.approx(expected.energy_loss, rel=1e-6)
    assert found.contact_time == pytest.approx(expected.contact_time, rel=2e-2)
    assert found.peak_force == pytest.approx(expected.peak_force, rel=1e-2)
    assert found.largest_penetration == pytest.approx(expected.largest_penetration, rel=1e-2)


@pytest.mark.parametrize("depth", [1e-7, 3e-6, 2e-5])
@pytest.mark.parametrize("law", WITH_FORCE, ids=by_name)
def test_the_elastic_force_is_the_slope_of_the_potential(law, depth):
    h = 1e-4 * depth
    slope = (
        fi.contact.contact_potential(law, depth + h, MASS) - fi.contact.contact_potential(law, depth - h, MASS)
    ) / (2 * h)
    # central difference: h^2 of the curvature, over rounding of 1e-16/1e-4
    assert slope == pytest.approx(fi.contact.contact_force(law, depth, 0.0, 0.25, MASS), rel=1e-7)


@pytest.mark.parametrize("law", WITH_FORCE, ids=by_name)
def test_no_law_acts_or_stores_outside_its_wall(law):
    assert fi.contact.contact_force(law, -1e-6, 0.3, 0.3, MASS) == 0.0
    assert fi.contact.contact_potential(law, -1e-6, MASS) == 0.0


@pytest.mark.parametrize("law", WITH_FORCE, ids=by_name)
def test_no_law_pulls_however_fast_the_ball_leaves(law):
    assert fi.contact.contact_force(law, 1e-6, -50.0, 0.25, MASS) >= 0.0


def test_a_rigid_contact_has_no_force_and_stores_nothing():
    found = fi.collide(fi.Rigid(0.6), MASS, SPEED)
    assert (found.restitution, found.contact_time, found.largest_penetration) == (0.6, 0.0, 0.0)
    assert math.isnan(found.peak_force)
    assert math.isnan(fi.contact.contact_force(fi.Rigid(0.6), 1e-6, 0.0, SPEED, MASS))
    assert fi.contact.contact_potential(fi.Rigid(0.6), 1e-6, MASS) == 0.0


@pytest.mark.parametrize("law", EVERY_LAW)
def test_a_speed_beyond_numbers_is_named(law):
    for speed in (1e-300, 1e300):
        with pytest.raises(
            fi.InputError,
            match=r"^approach_speed = .* m/s: must be .* > 0 m/s, and of 1e-30",
        ):
            fi.collide(law, MASS, speed)


@pytest.mark.parametrize("speed", [0.01, 1.0])
@pytest.mark.parametrize(
    "law",
    [
        fi.KelvinVoigt(restitution=0.6, contact_time=2e-3),
        fi.KelvinVoigt(restitution=0.05, contact_time=2e-3),
        fi.contact.SwitchingSpring(free_stiffness=0.0, stiffness=1e4),
        fi.Hertz(1e9),
        fi.contact.Flores(1e9, 0.2),
        fi.contact.GonthierCarvalhoMartins(1e9, 0.9),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_the_loop_drawn_is_the_collision_alone(law, speed):
    found = fi.collide(law, MASS, speed)
    depth, rate, force = collision_history(law, MASS, speed)
    # integrated to 1e-9; extremes of 400 samples, with a curvature of a half period in them
    assert -rate[-1] / speed == pytest.approx(found.restitution, rel=1e-5)
    assert force.max() == pytest.approx(found.peak_force, rel=1e-3)
    assert depth.max() == pytest.approx(found.largest_penetration, rel=1e-4)
    # the loop's area, by trapezoids
    area = np.trapezoid(force, depth)
    started = 0.5 * MASS * speed**2
    assert area == pytest.approx(found.energy_loss, abs=2e-3 * started)


def test_a_figure_has_one_panel_a_contact_and_labels_every_loop():
    laws = [fi.KelvinVoigt(restitution=0.6, contact_time=2e-3), fi.Rigid(0.5), fi.Hertz(1e9)]
    axes = contact_laws([(law.name, law, MASS) for law in laws], [0.25, 0.5, 1.0], OffScreen())
    texts = [[text.get_text() for text in axis.texts] for axis in axes]
    assert texts == [
        ["1 m/s", "0.5 m/s", "0.25 m/s"],
        ["an impulse only: no force, no penetration"],
        ["1 m/s", "0.5 m/s", "0.25 m/s"],
    ]
