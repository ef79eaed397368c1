"""Channels: every quantity of a state, by both families of methods, and channels that a user writes."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import femimpact as fi
from femimpact.response.channels import QUANTITIES, Channel, channel_of, zero_reading

pytestmark = pytest.mark.impacts

BEAM = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
COMPLIANT = fi.KelvinVoigt(restitution=0.7, contact_time=1e-3)


def structure(contact, **ball):
    """The cantilever with a box and a ball that touches within the first 50 ms."""
    impactor = fi.Impactor(name="impactor", mass=5e-3, gap=2e-4, contact=contact, at="tip", **ball)
    return fi.Structure(
        beam=BEAM,
        masses=[fi.PointMass("box", at="tip", mass=0.01)],
        impactors=[impactor],
        damping=fi.Rayleigh(ratio=0.01, modes=(1, 2)),
    )


def reduced(contact, modes=3, **ball):
    return fi.reduce(fi.assemble(structure(contact, **ball), elements=6), modes)


BASE = fi.Sine(1e-3, 9.0, 0.4)
READ = ("tip", "tip.velocity", "tip.acceleration", "impactor", "impactor.velocity", "impactor.acceleration",
        "contact_force", "gap", "tip.absolute_displacement", "tip.absolute_velocity",
        "tip.absolute_acceleration", "impactor.absolute_acceleration", "tip.rotation", "0.1.acceleration")  # fmt: skip


def run(system, method, base=BASE, channels=READ, duration=0.3, **more):
    return fi.integrate(system, base, method, duration, fi.Recorder(channels=channels), **more)


def balance(system, response, force):
    """The largest |M a + C v + K u - load| over the samples, in the modes, and the scale of it."""
    names = [f"mode {k}" for k in range(system.dofs)]
    u, v, a = (np.array([response[f"{name} {what}"] for name in names]) for what in ("u", "v", "a"))
    drive = -np.outer(system.base_load, response.base.acceleration(response.time))
    contact = sum(np.outer(pair.direction, f) for pair, f in zip(system.contacts, force, strict=True))
    left = system.M @ a + system.C @ v + system.K @ u
    right = drive + contact + np.asarray(system.constant_load)[:, None]
    return np.abs(left - right).max(), np.abs(system.K @ u).max()


@dataclass(frozen=True)
class Coordinate:
    """One coordinate of a system, its rate or its acceleration: a channel that a user writes."""

    number: int
    what: str
    unit = "1"

    @property
    def name(self):
        """Under which it is kept."""
        return f"mode {self.number} {self.what}"

    def reading(self, system):
        """A row with one entry."""
        field = {"u": "displacement", "v": "velocity", "a": "acceleration"}[self.what]
        return replace(zero_reading(system), **{field: np.eye(system.dofs)[self.number]})


METHODS = {
    "newmark": (fi.Newmark(2e-5), COMPLIANT),
    "hht": (fi.HHT(2e-5), COMPLIANT),
    "energy-consistent": (fi.Newmark(2e-5, contact="energy-consistent"), COMPLIANT),
    "event-driven, compliant": (fi.EventDriven(), COMPLIANT),
    "event-driven, rigid": (fi.EventDriven(), fi.Rigid(0.7)),
}


@pytest.mark.parametrize("key", METHODS)
def test_accelerations_obey_the_equations_of_motion(key):
    method, law = METHODS[key]
    system = reduced(law)
    own = tuple(Coordinate(k, what) for k in range(system.dofs) for what in "uva")
    response = run(system, method, channels=(*own, "contact_force", "impactor.acceleration"))
    residual, scale = balance(system, response, [response["contact_force"]])
    # sums of a few products, each rounded
    assert residual < 1e-11 * scale
    force = response["contact_force"]
    # m (y'' + ub'') = -F
    ball = 5e-3 * (response["impactor.acceleration"] + BASE.acceleration(response.time)) + force
    assert np.abs(ball).max() < 1e-11 * max(np.abs(force).max(), 5e-3 * BASE.amplitude * BASE.omega**2)
    if law is COMPLIANT:
        assert np.abs(force).max() > 0.0


def test_newmark_acceleration_is_that_of_the_scheme():
    # v1 = v0 + dt/2 (a0 + a1) holds for the scheme's own accelerations only
    method = fi.Newmark(2e-5)
    response = run(reduced(COMPLIANT), method)
    v, a = response["tip.velocity"], response["tip.acceleration"]
    error = np.diff(v) - 0.5 * method.dt * (a[1:] + a[:-1])
    assert np.abs(error).max() < 1e-11 * np.abs(v).max()


def test_event_driven_acceleration_is_the_rate_of_the_velocity():
    # by central differences of the closed form: second order in the interval, until a contact comes
    system, errors = reduced(COMPLIANT), []
    for samples in (200, 400):
        response = run(system, fi.EventDriven(samples_per_cycle=samples), duration=0.02)
        assert len(response.impacts) == 0
        h = response.time[1]
        rate = (response["tip.velocity"][2:] - response["tip.velocity"][:-2]) / (2.0 * h)
        errors.append(np.abs(rate - response["tip.acceleration"][1:-1]).max())
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_both_families_read_the_same():
    # short, before chaos; between samples beside a touch, where the force jumps, lines are no more than near
    event = run(reduced(COMPLIANT), fi.EventDriven(samples_per_cycle=1000), duration=0.05)
    step = run(reduced(COMPLIANT), fi.Newmark(1e-6), duration=0.05)
    for name in READ:
        there = np.interp(event.time, step.time, step[name])
        scale = np.abs(event[name]).max()
        assert np.abs(event[name] - there).max() <= 1e-2 * scale, name


@pytest.mark.parametrize("method", [fi.Newmark(1e-5), fi.EventDriven()], ids=["newmark", "event-driven"])
def test_centring_spring_is_a_part_of_the_ball_s_acceleration(method):
    k0 = 3.0
    response = run(reduced(COMPLIANT, free_stiffness=k0), method, duration=0.02)
    assert len(response.impacts) == 0
    whole = 5e-3 * (response["impactor.acceleration"] + BASE.acceleration(response.time)) + k0 * response["gap"]
    assert np.abs(whole).max() < 1e-11 * 5e-3 * BASE.amplitude * BASE.omega**2
    # no contact: no contact force, whatever the spring does
    assert not np.any(response["contact_force"])


@pytest.mark.parametrize("method", [fi.Newmark(1e-5), fi.EventDriven()], ids=["newmark", "event-driven"])
def test_gravity_and_a_force_are_in_the_acceleration(method):
    # one mass on a spring, its exact balance: m a = F - c v - k u + g m
    system = fi.System.from_matrices([[2.0]], [[3.0]], [[400.0]], points={"mass": [1.0]}, constant_load=[2.0 * 9.81])
    drive = fi.PointForce("mass", fi.Sine(5.0, 3.0, 0.2))
    response = run(system, method, drive, ("mass", "mass.velocity", "mass.acceleration"), 1.0)
    u, v, a = (response[name] for name in ("mass", "mass.velocity", "mass.acceleration"))
    error = 2.0 * a + 3.0 * v + 400.0 * u - drive.force(response.time) - 2.0 * 9.81
    assert np.abs(error).max() < 1e-12 * 400.0 * np.abs(u).max() + 1e-12 * 20.0


def test_absolute_values_are_the_relative_ones_and_the_base():
    response = run(reduced(COMPLIANT), fi.Newmark(2e-5))
    for what in ("displacement", "velocity", "acceleration"):
        name = "tip" if what == "displacement" else f"tip.{what}"
        scale = np.abs(response.absolute(name)).max()
        assert np.abs(response[f"tip.absolute_{what}"] - response.absolute(name)).max() <= 1e-14 * scale
    with pytest.raises(fi.InputError, match=r"channel = 'tip\.absolute_velocity'.*must be a relative"):
        response.absolute("tip.absolute_velocity")


def test_pieces_of_a_stream_are_the_whole():
    kept, channels = [], ("tip.absolute_acceleration", "impactor.acceleration")
    for method in (fi.Newmark(2e-5), fi.EventDriven()):
        kept.clear()
        recorder = fi.Recorder(channels=channels, sink=kept.append, piece_samples=700)
        fi.integrate(reduced(COMPLIANT), BASE, method, 0.3, recorder)
        whole = run(reduced(COMPLIANT), method, channels=channels)
        for name in channels:
            np.testing.assert_array_equal(np.concatenate([piece.channels[name] for piece in kept]), whole[name])


def test_every_quantity_has_a_name_that_leads_back_to_it():
    system = reduced(COMPLIANT)
    for read, entry in QUANTITIES.items():
        for stem in {"place": ["tip", "0.1"], "ball": ["impactor"], "base": []}[(*entry.of, "base")[0]]:
            channel = channel_of(system, f"{stem}.{read}")
            assert isinstance(channel, Channel)
            assert channel_of(system, channel.name) == channel


def test_two_channels_of_one_name_are_refused():
    @dataclass(frozen=True)
    class Other(Coordinate):
        @property
        def name(self):
            return "tip"

    with pytest.raises(fi.InputError, match="one channel, not of two"):
        run(reduced(COMPLIANT), fi.Newmark(2e-5), channels=("tip", Other(0, "u")))


def test_a_system_used_before_gives_the_bits_of_a_fresh_one():
    # closed forms are kept with the system; other channels and another drive must not disturb them
    used = reduced(COMPLIANT)
    run(used, fi.EventDriven(), channels=("tip.acceleration",))
    run(used, fi.EventDriven(), fi.PointForce("tip", fi.Sine(0.1, 9.0)), channels=("tip",))
    one, other = (run(system, fi.EventDriven()) for system in (used, reduced(COMPLIANT)))
    for name in READ:
        np.testing.assert_array_equal(one[name], other[name])


def test_a_place_is_read_by_its_number_as_it_was_asked_for():
    system = fi.without_impactors(reduced(COMPLIANT))
    method = fi.Newmark(1e-3, allow_coarse_step=True)
    response = run(system, method, channels=(0, 0.1, np.float32(0.05)))
    for place in (0, 0.0, 0.1, np.float32(0.05)):
        assert response[place] is response.channels[str(float(place))]
    for wrong in (None, True, 1j, np.nan, 10**5000):
        with pytest.raises(fi.InputError, match=r"^channel"):
            response[wrong]
