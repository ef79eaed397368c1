"""An excitation is an open protocol: classes that a user writes beside the built-in ones."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from builders import oscillator

import femimpact as fi
from femimpact.excitation.excitation import MEMBERS, Excitation, Harmonic

FREQUENCY, END = 5.0, 0.4


@dataclass(frozen=True)
class Polynomial:
    """The base moves by c t^3: velocity 3 c t^2, acceleration 6 c t, a straight line."""

    rate: float
    frequency = FREQUENCY
    phase = 0.0

    @property
    def amplitude(self):
        """Where it is in the end."""
        return self.rate * END**3

    def displacement(self, time):
        """A cubic."""
        return self.rate * np.asarray(time) ** 3

    def velocity(self, time):
        """A parabola."""
        return 3.0 * self.rate * np.asarray(time) ** 2

    def acceleration(self, time):
        """A straight line."""
        return 6.0 * self.rate * np.asarray(time)


@dataclass(frozen=True)
class OwnSine:
    """A sine of the base as a class that a user writes, with its closed form."""

    depth: float
    frequency: float
    phase: float = 0.3

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(fi.Sine(self.depth, self.frequency, self.phase), name)


def exact(time, rate):
    """U'' + 2 u' + 900 u = -6 c t at rest: a straight line and its transient."""
    slope = -6.0 * rate / 900.0
    level, decay, omega = -2.0 * slope / 900.0, 1.0, math.sqrt(899.0)
    sine = (-slope - decay * level) / omega
    return level + slope * time + np.exp(-time) * (-level * np.cos(omega * time) + sine * np.sin(omega * time))


def test_a_motion_of_one_s_own_meets_the_exact_answer_at_second_order():
    own, errors = Polynomial(0.5), []
    assert isinstance(own, Excitation)
    for dt in (2e-3, 1e-3):
        response = fi.integrate(oscillator(900.0, 2.0), own, fi.Newmark(dt), END, fi.Recorder(channels=("mass",)))
        errors.append(np.abs(response["mass"] - exact(response.time, own.rate)).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_a_stop_in_space_sees_the_base_of_one_s_own():
    # against the same motion by samples: straight between them as the polynomial's acceleration is
    stop = fi.Stop(name="stop", at="mass", gap=1e-3, contact=fi.KelvinVoigt(1e5, 10.0), fixed_to="space")
    system, own = oscillator(900.0, 2.0, stops=[stop]), Polynomial(0.5)
    samples = fi.RecordedBase(own.acceleration(np.arange(0.0, END + 0.02, 0.01)), 0.01)
    method, record = fi.Newmark(1e-4, refine=4), fi.Recorder(channels=("mass", "stop.gap", "stop.contact_force"))
    one, other = (fi.integrate(system, base, method, END, record) for base in (own, samples))
    for name in one.channels:
        # before and in the first contact, sums in another order
        assert np.abs(one[name] - other[name]).max() <= 1e-6 * np.abs(other[name]).max()
    assert np.abs(one["stop.contact_force"]).max() > 0.0


def test_a_closed_form_of_one_s_own_serves_every_method():
    own, base = OwnSine(1e-3, 4.0), fi.Sine(1e-3, 4.0, 0.3)
    for method in (fi.Newmark(1e-3), fi.EventDriven()):
        one, other = (fi.integrate(oscillator(900.0, 2.0), drive, method, 1.0)["mass"] for drive in (own, base))
        np.testing.assert_array_equal(one, other)


def test_a_force_of_one_s_own_acts_at_its_place():
    own = SimpleNamespace(
        frequency=4.0, phase=0.0, amplitude=0.0, at="mass", force=lambda t: 3.0 * np.sin(8.0 * np.pi * np.asarray(t)),
        displacement=np.zeros_like, velocity=np.zeros_like, acceleration=np.zeros_like,
    )  # fmt: skip
    known = fi.PointForce("mass", fi.Sine(3.0, 4.0))
    for method in (fi.Newmark(1e-3), fi.EventDriven()):
        if isinstance(method, fi.EventDriven):
            own.closed_form = Harmonic(3.0, 8.0 * np.pi, 0.0)
        one, other = (fi.integrate(oscillator(900.0, 2.0), drive, method, 0.5)["mass"] for drive in (own, known))
        assert np.abs(one - other).max() <= 1e-12 * np.abs(other).max()


def test_what_lacks_a_closed_form_is_refused_by_the_event_driven_method():
    with pytest.raises(fi.InputError, match=r"excitation = 'Polynomial': must have a closed_form for EventDriven"):
        fi.integrate(oscillator(900.0, 2.0), Polynomial(0.5), fi.EventDriven(), END)


def test_what_is_no_excitation_is_refused_with_what_one_must_have():
    with pytest.raises(fi.InputError, match=r"excitation = 'SimpleNamespace': must be a Sine.* with all of frequency"):
        fi.integrate(oscillator(900.0, 2.0), SimpleNamespace(frequency=1.0), fi.Newmark(1e-3), END)


def test_a_history_of_the_wrong_length_is_refused():
    @dataclass(frozen=True)
    class Short(Polynomial):
        def acceleration(self, time):
            return np.zeros(3)

    with pytest.raises(fi.InputError, match=r"excitation.*must give \d+ finite numbers"):
        fi.integrate(oscillator(900.0, 2.0), Short(0.5), fi.Newmark(1e-3), END)


@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(1e-3)], ids=["events", "steps"])
@pytest.mark.parametrize("frequency", [math.nan, math.inf, 0.0, -5.0, 1e-40])
def test_a_frequency_that_makes_no_cycle_is_refused(method, frequency):
    members = {name: getattr(fi.Sine(1e-3, FREQUENCY), name) for name in MEMBERS}
    own = SimpleNamespace(**members | {"frequency": frequency}, closed_form=Harmonic(1.0, 30.0, 0.0))
    with pytest.raises(fi.InputError, match=r"^excitation\.frequency = .* Hz: must be a finite number > 0 Hz"):
        fi.integrate(oscillator(30.0), own, method, END)
