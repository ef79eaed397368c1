"""A contact law of the user's own: any object that answers what the protocol asks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

import femimpact as fi
from femimpact.contact.law import require_law, resolve
from femimpact.figures.contacts import collision_history

pytestmark = pytest.mark.impacts

STILL = fi.Sine(amplitude=0.0, frequency=0.1)
MASS, SPEED = 2.0, 0.7


@lru_cache
def two_slopes(loading, unloading):
    def force(depth, rate, approach_speed):
        return (loading if rate >= 0.0 else unloading) * depth

    return force


@dataclass(frozen=True)
class TwoSlopes:
    """N = k p on the way in and e^2 k p on the way back; k from the contact time T = (pi/2)(1 + 1/e) sqrt(m/k)."""

    restitution: float
    contact_time: float
    name: str = "two-slopes"
    may_be_preloaded: bool = True

    def slopes(self, mass):
        """Stiffness (N/m) on the way in and on the way back."""
        stiffness = mass * (0.5 * math.pi * (1.0 + 1.0 / self.restitution) / self.contact_time) ** 2
        return stiffness, self.restitution**2 * stiffness

    def normal_force(self, depth, rate, approach_speed, effective_mass):
        """Force (N)."""
        return two_slopes(*self.slopes(effective_mass))(max(depth, 0.0), rate, approach_speed)

    def potential(self, depth, effective_mass, approach_speed):
        """Energy (J) that the spring of the way in has taken up."""
        return 0.5 * self.slopes(effective_mass)[0] * max(depth, 0.0) ** 2

    def collide(self, effective_mass, approach_speed):
        """One collision in closed form."""
        m, v, k = effective_mass, approach_speed, self.slopes(effective_mass)[0]
        loss = 0.5 * m * v**2 * (1.0 - self.restitution**2)
        return fi.contact.Collision(
            self.restitution, self.contact_time, v * math.sqrt(k * m), v * math.sqrt(m / k), loss
        )

    def parameters(self, effective_mass):
        """Numbers for the time loop, which calls the function."""
        return fi.contact.ContactParameters.of_function(self.contact_time, self.restitution)

    def force_function(self, effective_mass):
        """The function that the time loop compiles."""
        return two_slopes(*self.slopes(effective_mass))

    def shown_numbers(self, effective_mass):
        """Stiffness on the way in."""
        return (("stiffness", self.slopes(effective_mass)[0], "N/m"),)


LAW = TwoSlopes(restitution=0.6, contact_time=0.02)


def oscillator(law, omega=1.0):
    """A mass on a spring, its stop at the middle on the + side."""
    stop = fi.Stop("wall", "mass", (0.0, math.inf), law)
    return fi.System.from_matrices([[MASS]], [[0.0]], [[MASS * omega**2]], points={"mass": [1.0]}, stops=[stop])


def test_a_law_of_ones_own_is_a_contact_law():
    assert isinstance(LAW, fi.contact.ContactLaw)
    for law in (
        fi.Rigid(0.5),
        fi.Hertz(1e7),
        fi.KelvinVoigt(stiffness=1e4, damping=1.0),
        fi.contact.SwitchingSpring(0.0, 1e4),
    ):
        assert isinstance(law, fi.contact.ContactLaw)
    assert isinstance(fi.CustomLaw(lambda depth, rate, speed: depth), fi.contact.ContactLaw)


@pytest.mark.parametrize("contact", ["end", "energy-consistent"])
def test_a_run_with_a_law_of_ones_own_is_the_exact_one(contact):
    """From the middle away from the wall, half a free period, then a quarter of each of two faster sines."""
    system = oscillator(LAW)
    assert system.contacts[0].effective_mass == pytest.approx(MASS, rel=1e-12)
    dt = LAW.contact_time / 500
    method = replace(fi.Newmark(dt), contact=contact)
    run = fi.integrate(system, STILL, method, 6.0, fi.Recorder(("mass",)), initial=fi.State(velocity=[-SPEED]))
    k, back = LAW.slopes(MASS)
    pressed, leaving = math.sqrt(1.0 + k / MASS), math.sqrt(1.0 + back / MASS)
    impacts = run.impacts
    assert len(impacts) == 1
    # second order over half a period: (pi/12) dt^2 = 4e-10
    assert impacts.time[0] == pytest.approx(math.pi, abs=1e-9)
    assert impacts.approach_speed[0] == pytest.approx(SPEED, rel=1e-9)
    # the step in which the mass turns back has one of both slopes: a share (omega dt)^2 = (pi/500)^2 (1 + 1/e)^2/4
    share = 7e-5
    assert impacts.restitution[0] == pytest.approx(leaving / pressed, rel=share)
    assert impacts.duration[0] == pytest.approx(0.5 * math.pi * (1.0 / pressed + 1.0 / leaving), abs=2.0 * dt)
    assert impacts.peak_force[0] == pytest.approx(k * SPEED / pressed, rel=share)
    assert np.max(run["mass"]) == pytest.approx(SPEED / pressed, rel=share)
    # what the mass has lost is in the ledger of the contact
    lost = 0.5 * MASS * SPEED**2 * (1.0 - (leaving / pressed) ** 2)
    assert run.energy.contact_loss[-1] == pytest.approx(lost, rel=2 * share)


def test_one_collision_is_what_the_force_gives():
    exact = fi.collide(LAW, MASS, SPEED)
    found = fi.contact.integrated_collision(
        lambda p, rate: fi.contact.contact_force(LAW, p, rate, SPEED, MASS), MASS, SPEED
    )
    # the force jumps where the mass turns back: the integration halves its step down to its tolerance there
    assert vars(found) == pytest.approx(vars(exact), rel=1e-6)
    stepped = fi.integrators.achieved_restitution(
        oscillator(LAW).contacts[0], fi.Newmark(LAW.contact_time / 500), SPEED
    )
    assert stepped.mean == pytest.approx(0.6, rel=3e-3)


def test_figures_ask_the_law_itself():
    depth, _, force = collision_history(LAW, MASS, SPEED)
    exact = fi.collide(LAW, MASS, SPEED)
    # 400 instants of a sine: its top lies within (pi/400)^2/8 of one of them
    assert np.max(depth) == pytest.approx(exact.largest_penetration, rel=1e-4)
    # the area of the loop is the loss; 400 instants of a force with a jump
    assert np.trapezoid(force, depth) == pytest.approx(exact.energy_loss, rel=2e-2)


def test_the_event_driven_method_refuses_it_in_one_line():
    system = fi.reduce(oscillator(LAW), 1)
    with pytest.raises(fi.InputError) as refused:
        fi.integrate(system, STILL, fi.EventDriven(), 1.0)
    words = "wall.contact = 'two-slopes': must be Rigid or KelvinVoigt for EventDriven; other laws are for Newmark"
    assert str(refused.value).startswith(words)
    assert len(str(refused.value).splitlines()) == 1


def parts_of(law, **changed):
    names = (name for name in dir(law) if not name.startswith("_"))
    return SimpleNamespace(**{**{name: getattr(law, name) for name in names}, **changed})


REST = "restitution, may_be_preloaded, normal_force(), potential(), parameters(), force_function(), shown_numbers()"


@pytest.mark.parametrize(
    ("law", "missing"),
    [
        (fi.KelvinVoigt, ""),
        (None, ""),
        (parts_of(LAW, potential=3.0), "; as one of your own it has no potential()"),
        (SimpleNamespace(name="felt", collide=LAW.collide), f"; as one of your own it has no {REST}"),
    ],
)
def test_what_is_no_law_is_refused_by_what_it_misses(law, missing):
    with pytest.raises(fi.InputError) as refused:
        fi.Impactor("ball", "tip", 3e-3, 1e-3, law)
    line = str(refused.value)
    assert line.startswith("contact")
    assert line.endswith(f": must be a contact law (KelvinVoigt, ..., Rigid){missing}")
    assert "\n" not in line


def test_a_law_that_has_every_part_is_one_whatever_it_is_made_of():
    require_law(parts_of(LAW))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"parameters": lambda mass: (1.0, 2.0)}, "two-slopes.parameters = (1.0, 2.0): must be ContactParameters"),
        ({"force_function": lambda mass: None}, "two-slopes.force_function: must give a function of depth, rate"),
    ],
)
def test_a_law_the_time_loop_could_not_take_is_refused(changed, words):
    with pytest.raises(fi.InputError) as refused:
        resolve(parts_of(LAW, **changed), MASS)
    assert str(refused.value).startswith(words)
