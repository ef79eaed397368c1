"""Modes of nearly zero frequency: each motion as 30 digits have it, whatever drives, brakes or holds it."""

import math

import mpmath as mp
import numpy as np
import pytest

import femimpact as fi
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.closed_form import closed_forms
from femimpact.integrators.event_driven.equations import equations_of, stacked
from femimpact.orbits.motion import flow_of, hybrid_system

pytestmark = pytest.mark.impacts

EXACT = fi.EventDriven()
FREQUENCIES = (0.0, 1e-9, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 1e-2, 0.1, 0.3, 0.89, 0.91, 1.0, 3.0, 10.0)
"""rad/s, beside the border between what is slow and what is not."""


def against_a_wall(omega, damping=0.0, constant=0.0, **more):
    """A mass of 1 kg before a rigid stop at -0.5 m that does not move with the base."""
    stop = fi.Stop("wall", at="m", gap=(math.inf, 0.5), contact=fi.Rigid(0.5), fixed_to="space")
    matrices = [[1.0]], [[damping]], [[omega**2]]
    return fi.System.from_matrices(*matrices, points={"m": [1.0]}, stops=[stop], constant_load=[constant], **more)


class Exact:
    """x'' + c x' + w^2 x = g - ub'', in 30 digits; z = (x, x', 1, ub, ub', ...) with what ub needs behind."""

    def __init__(self, omega, damping, constant, base, more):
        size = 5 + len(more)
        self.A = mp.zeros(size)
        self.A[0, 1] = self.A[3, 4] = 1
        self.A[1, 0], self.A[1, 1], self.A[1, 2] = -(mp.mpf(omega) ** 2), -mp.mpf(damping), mp.mpf(constant)
        # ub'' and the derivatives of what stands behind by all behind
        for j, number in enumerate(base[0]):
            self.A[1, 5 + j], self.A[4, 5 + j] = -mp.mpf(number), mp.mpf(number)
        for (i, j), number in base[1].items():
            self.A[5 + i, 5 + j] = mp.mpf(number)
        self.more = more

    def start(self, speed, base=(0, 0)):
        """State z at the start."""
        return mp.matrix([0, mp.mpf(speed), 1, *base, *self.more])

    def at(self, z, time):
        """State z after a time."""
        return mp.expm(self.A * time, method="taylor") * z

    def missed(self, z, time, wall=-0.5):
        """By how much (s) a time differs from that at which x + ub is at the wall: a step of Newton's."""
        after = self.at(z, time)
        return float((after[0] + after[3] - mp.mpf(wall)) / (after[1] + after[4]))


def sine_of(omega, damping, constant, amplitude, frequency):
    """Under ub = amplitude sin(2 pi f t), from z of which the base has its velocity."""
    rate = 2 * mp.pi * mp.mpf(frequency)
    pushes = [-mp.mpf(amplitude) * rate**2, 0]
    exact = Exact(omega, damping, constant, (pushes, {(0, 1): rate, (1, 0): -rate}), [0, 1])
    return exact, (0, mp.mpf(amplitude) * rate)


def run_of(system, excitation, speed=-1.0, duration=1.0, **more):
    """A run from x = 0 relative to the base."""
    recorder = fi.Recorder(("m",), interval=1.0 / 64.0)
    return fi.integrate(system, excitation, EXACT, duration, recorder, fi.State([0.0], [speed]), **more)


@pytest.mark.parametrize("constant", [0.0, -9.81])
@pytest.mark.parametrize("damping", [0.0, 1e-4, 0.02, 0.5, 5.0])
def test_a_sine_and_a_constant_force_meet_the_wall_when_they_should(damping, constant):
    for omega in FREQUENCIES:
        for amplitude, frequency in ((0.1, 1.0), (1.0, 1e-3)):
            run = run_of(against_a_wall(omega, damping, constant), fi.Sine(amplitude, frequency))
            assert run.energy.residual < 2e-12
            if not len(run.impacts):
                continue
            found = float(run.impacts.time[0])
            with mp.workdps(30):
                exact, base = sine_of(omega, damping, constant, amplitude, frequency)
                missed = exact.missed(exact.start(-1, base), found)
            assert abs(missed) < 1e-12, (omega, frequency)


@pytest.mark.parametrize("constant", [0.0, -9.81])
@pytest.mark.parametrize("damping", [0.0, 1e-4, 0.5])
def test_straight_lines_meet_the_wall_when_they_should(damping, constant):
    """0.5 s but for omega^2/50 without a constant force."""
    for omega in FREQUENCIES:
        run = run_of(against_a_wall(omega, damping, constant), fi.RecordedBase([0.0, 1.0, -1.0, 0.0], 0.5))
        assert run.energy.residual < 2e-12
        if not len(run.impacts):
            continue
        found = float(run.impacts.time[0])
        with mp.workdps(30):
            # s and s' of the first line
            rising = Exact(omega, damping, constant, ([1, 0], {(0, 1): 1}), [0, 2])
            z, passed = rising.start(-1), 0
            if found > 0.5:
                z, passed = rising.at(z, mp.mpf(0.5)), mp.mpf(0.5)
                z[6] = -4
            missed = rising.missed(z, found - passed)
        assert abs(missed) < 1e-12, omega


def test_a_wall_is_met_from_any_start():
    """A velocity becomes a displacement: a bound on the motion that does not grow with it passes walls."""
    rng = np.random.default_rng(4)
    for omega in np.repeat([1e-6, 1e-3, 0.3, 0.8], 25).tolist():
        place, speed, time = rng.uniform(-1.0, 1.0), rng.uniform(0.1, 1.0), rng.uniform(0.1, 1.4)
        angle = omega * time
        wall = place * math.cos(angle) + speed * math.sin(angle) / omega
        if wall <= max(place, 0.0) or speed * math.cos(angle) <= omega * place * math.sin(angle):
            continue
        stop = fi.Stop("wall", at="m", gap=(wall, math.inf), contact=fi.Rigid(0.5))
        system = fi.System.from_matrices([[1.0]], [[0.0]], [[omega**2]], points={"m": [1.0]}, stops=[stop])
        run = fi.integrate(system, fi.Sine(0.0, 1.0), EXACT, 1.5, initial=fi.State([place], [speed]))
        assert float(run.impacts.time[0]) == pytest.approx(time, abs=1e-12)


def test_a_braked_motion_that_nothing_pulls_back_goes_on_at_its_last_speed():
    """By x = (F/c) t - (F/c - v) (1 - e^-ct)/c; the dashpot takes the whole force in the end."""
    for damping in (1e-3, 0.1, 2.0):
        system = fi.System.from_matrices([[1.0]], [[damping]], [[0.0]], points={"m": [1.0]}, constant_load=[0.3])
        run = run_of(system, fi.Sine(0.0, 1.0), duration=20.0)
        last, decay = 0.3 / damping, -np.expm1(-damping * run.time) / damping
        np.testing.assert_allclose(run["m"], last * run.time - (last + 1.0) * decay, rtol=1e-11, atol=1e-12)
        assert run.energy.residual < 1e-13


DRIVES = {
    "sine": fi.Sine(0.02, 3.0),
    "lines": fi.RecordedBase([0.0, 3.0, -1.0, 2.0, 0.0], 0.1),
    "shock": fi.Shock("half-sine", 30.0, 0.02),
    "hammer": fi.HammerBlow("a", 0.3, 0.01, begin=0.05),
    "sum": fi.PointForce("a", fi.Sine(1.0, 3.0)) + fi.HammerBlow("b", 0.3, 0.02, begin=0.1),
    "both": fi.Sine(0.02, 3.0) + fi.PointForce("b", fi.Sine(1.0, 3.0, 0.4)),
}


def structure(slow, contact, wall, at="space"):
    """Two slow motions and two others, a stop on one place and a ball on another."""
    omega = np.array([slow, 40.0, slow, 300.0])
    return fi.System.from_matrices(
        np.eye(4), np.diag([0.0, 0.4, 0.3, 3.0]), np.diag(omega**2), base_load=[1.0, 0.5, -0.8, 0.2],
        points={"a": [1.0, 0.6, -0.7, 0.4], "b": [0.8, -0.9, 0.5, 0.7]}, constant_load=[-0.5, 0.2, 1.0, 3.0],
        stops=[fi.Stop("stop", at="a", gap=(math.inf, 0.03), contact=wall, fixed_to=at)],
        impactors=[fi.Impactor("ball", at="b", mass=0.2, gap=0.02, contact=contact)],
    )  # fmt: skip


@pytest.mark.parametrize("slow", [1e-9, 1e-7])
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(
    ("contact", "wall"),
    [
        (fi.Rigid(0.6), fi.Rigid(0.7)),
        (fi.Rigid(0.0), fi.Rigid(0.0)),
        (fi.KelvinVoigt(stiffness=2e3, damping=2.0), fi.KelvinVoigt(stiffness=5e3, damping=0.0)),
        (fi.Rigid(0.0), fi.KelvinVoigt(stiffness=1e3, damping=100.0)),
    ],
)
def test_what_is_nearly_free_moves_as_what_is_free(contact, wall, drive, slow):
    """Two ways of computing: rigid motions are parabolas. What holds the slow ones does less than rounding."""
    runs = []
    for omega in (0.0, slow):
        start = fi.State(np.zeros(4), np.array([0.1, 0.3, -0.2, 0.0]), np.zeros(1), np.zeros(1))
        recorder = fi.Recorder(("a", "b"), events=1000, interval=0.01)
        runs.append(fi.integrate(structure(omega, contact, wall), DRIVES[drive], EXACT, 0.4, recorder, start))
    free, nearly = runs
    assert len(free.events) > 0
    assert list(free.events.kind) == list(nearly.events.kind)
    np.testing.assert_allclose(nearly.events.time[:4], free.events.time[:4], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(nearly["a"], free["a"], rtol=0.0, atol=1e-11)
    for run in runs:
        assert run.energy.residual < 1e-12
    for name in ("work", "kinetic", "structure_loss", "contact_loss", "contact"):
        size = np.abs(free.energy.work).max()
        np.testing.assert_allclose(nearly.energy[name], free.energy[name], rtol=0.0, atol=1e-10 * size)


def test_a_free_bar_may_have_a_rigid_motion_to_rounding():
    """Bounces that end in sticking phases, of 9 modes: the lowest eigenvalue is 2e-27 or 1e-8 where it should be 0."""
    n, rng, runs = 9, np.random.default_rng(3), []
    shapes, omega = np.linalg.qr(rng.normal(size=(n, n)))[0], np.linspace(0.0, 1e4, n)
    for square in (0.0, 2e-27, 1e-12):
        K = np.diag(np.where(omega > 0.0, omega**2, square))
        stop = fi.Stop("stop", at="end", gap=(1e-3, math.inf), contact=fi.Rigid(0.6), fixed_to="space")
        bar = fi.System.from_matrices(
            np.eye(n), 1e-5 * K, K, points={"end": np.abs(shapes[0])}, stops=[stop], constant_load=9.81 * np.eye(n)[0]
        )  # fmt: skip
        runs.append(fi.integrate(bar, fi.Sine(1e-4, 20.0), EXACT, 0.3))
    for run in runs:
        assert run.energy.residual < 1e-12
        assert len(run.impacts) > 20
        np.testing.assert_allclose(run.impacts.time[:8], runs[0].impacts.time[:8], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("stiffness", [None, 1e2, 1e7])
def test_what_a_stop_leaves_is_as_slow_as_it_is(stiffness):
    """A stop that holds a place, or presses it: the eigenvalues of Omega^2 + k b b^T in 150 digits."""
    omega, b = [1e-9, 300.0, 3e-9, 40.0, 2e-4], [0.3, 1.0, -0.5, 0.7, 0.2]
    wall = fi.Rigid(0.0) if stiffness is None else fi.KelvinVoigt(stiffness=stiffness, damping=0.0)
    system = fi.System.from_matrices(
        np.eye(5), np.zeros((5, 5)), np.diag(np.square(omega)), points={"a": b},
        stops=[fi.Stop("stop", at="a", gap=0.01, contact=wall)],
    )  # fmt: skip
    equations = stacked([equations_of(system, drive_of(system, fi.Sine(1e-3, 1.0)))])
    touch, of_wall = np.ones(1, dtype=bool), np.array([[stiffness or 0.0]])
    [(_, forms)] = closed_forms(equations, touch, of_wall, np.zeros((1, 1)))
    found = np.unique(np.abs(forms.modes.exponent[0]))
    with mp.workdps(150):
        push = mp.matrix(b)
        K = mp.diag([mp.mpf(each) ** 2 for each in omega]) + mp.mpf(stiffness or "1e60") * push * push.T
        exact = [float(mp.sqrt(each)) for each in mp.eigsy(K, eigvals_only=True)]
    np.testing.assert_allclose(found, exact[: found.size], rtol=1e-12)
    assert found.size == (4 if stiffness is None else 5)


# ---- periodic orbits --------------------------------------------------------------------------------


@pytest.mark.parametrize("stiffness", [0.0, 1e-18, 1e-12, 1e-9, 1e-7])
def test_a_nearly_free_mass_in_a_box_loses_its_symmetry_where_a_free_one_does(stiffness):
    """At gap/amplitude (pi^2 - 4)/(2 sqrt(4 + pi^2 k^2)), k = (1 - e)/(1 + e), but for 0.56 k/omega^2."""
    for frequency in (0.5 / math.pi, 1.0):
        stop = fi.Stop("walls", at="m", gap=1.35, contact=fi.Rigid(0.9))
        box = fi.System.from_matrices([[1.0]], [[0.0]], [[stiffness]], points={"m": [1.0]}, stops=[stop])
        orbit = fi.orbits.two_impact_orbits(box, fi.Sine(1.0, frequency))[0]
        branch = fi.continue_orbit(orbit, "stop.walls.gap", to=(1.35, 1.55))
        (value,) = [each.value for each in branch.bifurcations if each.kind == "symmetry-breaking"]
        exact = (math.pi**2 - 4.0) / (2.0 * math.hypot(2.0, math.pi * 0.1 / 1.9))
        assert value == pytest.approx(exact - 0.5604 * stiffness / (2.0 * math.pi * frequency) ** 2, abs=2e-11)


def test_the_flow_of_slow_motions_is_that_of_the_matrix_exponential():
    """Of random slow, braked and pressed motions under constant forces, in 30 digits."""
    rng = np.random.default_rng(1)
    for _ in range(60):
        omega = rng.choice([0.0, 1e-9, 1e-6, 1e-4, 1e-2, 0.1, 1.0, 40.0], 2)
        brakes = 2.0 * omega * rng.choice([0.0, 0.3, 1.0, 3.0]) + rng.choice([0.0, 1e-9, 1e-4, 0.1, 3.0])
        wall = fi.KelvinVoigt(stiffness=10.0 ** rng.uniform(1, 3), damping=rng.choice([0.0, 1.0]))
        system = fi.System.from_matrices(
            np.eye(2), np.diag(brakes), np.diag(omega**2), points={"a": rng.normal(size=2)},
            constant_load=rng.normal(size=2), stops=[fi.Stop("stop", at="a", gap=0.01, contact=wall)],
        )  # fmt: skip
        flow = flow_of(hybrid_system(system, fi.Sine(1e-3, 0.7)), rng.choice([0.0, 1.0], 1))
        time = 10.0 ** rng.uniform(-2, 0.7)
        (propagator,), (moved,) = flow.over(np.array([time]))
        augmented = np.zeros((5, 5))
        augmented[:4, :4], augmented[:4, 4] = flow.matrix, flow.constant
        with mp.workdps(30):
            exact = mp.expm(mp.matrix(augmented.tolist()) * mp.mpf(time), method="taylor")
        exact = np.array(exact.tolist(), dtype=float)[:4]
        # displacements and velocities, of which each motion has its size
        for rows in (slice(0, 2), slice(2, 4)):
            size = np.abs(exact[rows]).max()
            np.testing.assert_allclose(propagator[rows], exact[rows, :4], rtol=0.0, atol=1e-11 * size)
            size = np.abs(exact[rows, 4]).max() + 1e-3 * np.abs(flow.constant).max()
            np.testing.assert_allclose(moved[rows], exact[rows, 4], rtol=0.0, atol=1e-11 * size)
