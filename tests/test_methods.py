"""The step methods against the exact analysis of their amplification matrices, and Moreau-Jean against ballistics."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from builders import oscillator, reduced, with_ball

import femimpact as fi
from femimpact.integrators.methods import MEMBERS, METHODS, read_at_least, require_method, seconds_of_cycle
from femimpact.integrators.own_method import run_cases_apart, run_of_states
from femimpact.integrators.stepping.newmark import SteppingMembers
from femimpact.integrators.stepping.operators import family_scheme, scheme_of

pytestmark = pytest.mark.impacts

STILL = fi.Sine(amplitude=0.0, frequency=0.1)
FAMILY = [
    fi.Newmark(1.0),
    fi.Newmark(1.0, beta=0.3025, gamma=0.6),
    fi.Newmark(1.0, contact="energy-consistent"),
    fi.HHT(1.0, alpha=-0.1),
    fi.HHT(1.0, alpha=-1 / 3),
    fi.WBZ(1.0, alpha=-0.1),
    fi.WBZ(1.0, alpha=-1.0),
    fi.GeneralizedAlpha(1.0, spectral_radius=1.0),
    fi.GeneralizedAlpha(1.0, spectral_radius=0.8),
    fi.GeneralizedAlpha(1.0, spectral_radius=0.0),
    fi.MoreauJean(1.0),
    fi.MoreauJean(1.0, theta=0.6),
]
SECOND_ORDER = [method for method in FAMILY if getattr(method, "gamma", 0.5) == 0.5 and method != FAMILY[-1]]


def amplification(method, omega, damping_ratio=0.0):
    """A of (u, v, a) after one step without load, from the textbook form of the method: derived by hand."""
    h, c, k = method.dt, 2 * damping_ratio * omega, omega**2
    if isinstance(method, fi.MoreauJean):
        th = method.theta
        left = np.array([[1, -h * th, 0], [h * th * k, 1 + h * th * c, 0], [k, c, 1]])
        right = np.array([[1, h * (1 - th), 0], [-h * (1 - th) * k, 1 - h * (1 - th) * c, 0], [0, 0, 0]])
        return np.linalg.solve(left, right)
    am = af = 0.0
    if isinstance(method, fi.HHT):
        af = -method.alpha
    elif isinstance(method, fi.WBZ):
        am = method.alpha
    elif isinstance(method, fi.GeneralizedAlpha):
        r = method.spectral_radius
        am, af = (2 * r - 1) / (r + 1), r / (r + 1)
    beta, gamma = getattr(method, "beta", (1 - am + af) ** 2 / 4), getattr(method, "gamma", 0.5 - am + af)
    left = np.array([[1, 0, -beta * h * h], [0, 1, -gamma * h], [(1 - af) * k, (1 - af) * c, 1 - am]])
    right = np.array([[1, h, (0.5 - beta) * h * h], [0, 1, (1 - gamma) * h], [-af * k, -af * c, -am]])
    return np.linalg.solve(left, right)


def steps_of(method, system, dt, count, displacement=1.0, velocity=0.3):
    start = fi.State(displacement=[displacement], velocity=[velocity])
    method = replace(method, dt=dt, allow_coarse_step=True)
    record = fi.Recorder(("mass", "mass.velocity"), ledger=False)
    return fi.integrate(system, STILL, method, count * dt, record, initial=start)


@pytest.mark.parametrize("damping_ratio", [0.0, 0.07])
@pytest.mark.parametrize("method", FAMILY, ids=repr)
def test_every_step_is_the_amplification_matrix_of_the_textbook(method, damping_ratio):
    system, dt = oscillator(damping=2 * damping_ratio), 0.11
    run = steps_of(method, system, dt, 40)
    A = amplification(replace(method, dt=dt), 1.0, damping_ratio)
    state = np.array([1.0, 0.3, -1.0 - 2 * damping_ratio * 0.3])
    for n in range(41):
        # rounding of 40 steps
        np.testing.assert_allclose([run["mass"][n], run["mass.velocity"][n]], state[:2], rtol=0, atol=1e-13)
        state = A @ state


@pytest.mark.parametrize("method", SECOND_ORDER, ids=repr)
def test_the_methods_converge_with_the_square_of_the_step(method):
    system = oscillator(damping=2 * 0.05)
    base = fi.Sine(amplitude=0.1, frequency=0.13)
    steps, ends = 1 / np.array([16, 32, 64]), []
    for dt in [*steps, 1 / 1024]:
        used = replace(method if dt > 1e-3 else fi.Newmark(1.0), dt=float(dt), allow_coarse_step=True)
        start = fi.State(displacement=[1.0])
        ends.append(fi.integrate(system, base, used, 10.0, fi.Recorder(("mass",)), initial=start)["mass"][-1])
    error = np.abs(np.array(ends[:-1]) - ends[-1])
    # the reference itself carries 1/256 of the coarse error
    assert np.polyfit(np.log(steps), np.log(error), 1)[0] == pytest.approx(2.0, abs=0.15)


def test_newmark_with_its_own_weights_is_the_limit_of_its_relatives():
    for method in (fi.HHT(0.1, alpha=0.0), fi.WBZ(0.1, alpha=0.0)):
        assert scheme_of(method) == scheme_of(fi.Newmark(0.1))
    same = scheme_of(fi.MoreauJean(0.1)), scheme_of(fi.Newmark(0.1, contact="energy-consistent"))
    assert same[0]._replace(rigid=False) == same[1]


@pytest.mark.parametrize("method", FAMILY, ids=repr)
def test_banded_dofs_and_modes_agree(reference, method):
    structure = replace(reference, impactors=())
    full = fi.assemble(structure, elements=5)
    modal = fi.reduce(full, modes=10)
    base = fi.Sine(2e-4, 5.0)
    method = replace(method, dt=1e-3)
    one, other = (fi.integrate(system, base, method, 0.5, fi.Recorder(("tip",)))["tip"] for system in (full, modal))
    # eigenvalues of the mesh span 1e6
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.max(np.abs(other)))


@pytest.mark.parametrize("method", FAMILY, ids=repr)
def test_one_case_alone_and_beside_others_agree(small, method):
    empty = fi.without_impactors(small)
    method = replace(method, dt=1e-3)
    alone = fi.frequency_sweep(empty, 2e-4, [5.0], method, 20)
    beside = fi.frequency_sweep(empty, 2e-4, [4.5, 5.0, 5.5], method, 20, threads=1)
    assert beside.peak[1] == alone.peak[0]


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: fi.HHT(1e-3, alpha=0.1), "alpha"),
        (lambda: fi.HHT(1e-3, alpha=-0.5), "alpha"),
        (lambda: fi.WBZ(1e-3, alpha=-1.1), "alpha"),
        (lambda: fi.GeneralizedAlpha(1e-3, spectral_radius=1.1), "spectral_radius"),
        (lambda: fi.MoreauJean(1e-3, theta=0.4), "theta"),
        (lambda: fi.Newmark(1e-3, contact="middle"), "contact"),
        (lambda: fi.Newmark(1e-3, gamma=0.6, contact="energy-consistent"), "gamma"),
        (lambda: fi.Newmark(1e-3, beta=0.3, contact="energy-consistent"), "beta"),
        (lambda: fi.Newmark(1e-3, refine=0), "refine"),
    ],
)
def test_numbers_out_of_range_are_refused(make, key):
    with pytest.raises(fi.InputError, match=key):
        make()


# ---- impulses ---------------------------------------------------------------------------------------


def thrown_at(restitution, method, mass=0.3, speed=0.7, duration=0.4):
    """A ball thrown at the wall of a heavier oscillator."""
    ball = fi.Impactor("ball", "mass", mass, 0.1, fi.Rigid(restitution))
    system = oscillator(2.0**2, impactors=[ball])
    return fi.integrate(system, STILL, method, duration, initial=fi.State(ball_velocity=[speed]))


@pytest.mark.parametrize("restitution", [0.1, 0.4, 1.0])
def test_impulses_keep_the_restitution_exactly(restitution):
    run = thrown_at(restitution, fi.MoreauJean(1e-3))
    impacts = run.impacts
    assert len(impacts) == 1
    assert impacts.approach_speed[0] == pytest.approx(0.7, rel=1e-12)
    assert impacts.rebound_speed[0] == pytest.approx(restitution * 0.7, abs=1e-12)
    # momentum of the two free bodies; the spring of the oscillator acts by less than (w dt)^2
    effective = 1 / (1 / 0.3 + 1 / 1.0)
    assert impacts.impulse[0] == pytest.approx((1 + restitution) * effective * 0.7, rel=1e-5)
    assert impacts.energy_loss[0] == pytest.approx(0.5 * (1 - restitution**2) * effective * 0.49, rel=1e-4, abs=1e-12)
    assert impacts.duration[0] == 0.0
    assert np.isnan(impacts.peak_force[0])
    assert impacts.time[0] == pytest.approx(0.1 / 0.7, abs=1e-12)
    # the work of an impulse is P (v0 + v1)/2, and the trapezoidal rule closes the rest: rounding
    assert run.energy.residual < 1e-12


def test_a_plastic_ball_stays_with_its_wall():
    run = thrown_at(0.0, fi.MoreauJean(1e-3), duration=0.5)
    sticking = run.sticking
    assert len(sticking) == 1
    assert (sticking.impactor[0], sticking.side[0]) == ("ball", 1)
    assert sticking.start[0] == pytest.approx(0.1 / 0.7, abs=1e-12)
    assert np.isnan(sticking.end[0])
    after = run.time > 0.15
    np.testing.assert_allclose(np.diff(run["ball"][after] - run["mass"][after]), 0.0, atol=1e-14)
    # momentum: the pair moves on together
    exact = 0.3 * 0.7 / 1.3
    start = np.flatnonzero(after)[0]
    assert (run["ball"][start + 1] - run["ball"][start]) / 1e-3 == pytest.approx(exact, rel=1e-2)
    assert run.energy.residual < 1e-12


def bouncing(restitution, method, duration, height=0.05):
    """A ball that bounces on the base itself: no structure between."""
    beam = fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", "root", 2e-3, (1.0, height), fi.Rigid(restitution), acceleration=-9.81)
    system = fi.reduce(fi.assemble(fi.Structure(beam, impactors=[ball]), elements=2), modes=1)
    return fi.integrate(system, STILL, method, duration, fi.Recorder(("ball", "contact_force")))


def test_a_bouncing_ball_comes_to_rest_when_ballistics_say_and_then_weighs_what_it_weighs():
    e, h, g = 0.5, 0.05, 9.81
    run = bouncing(e, fi.MoreauJean(1e-4), 0.6)
    fall = math.sqrt(2 * h / g)
    times = fall * (1 + 2 * np.cumsum(e ** np.arange(1, 5)))
    # instants drift by a step an impact
    np.testing.assert_allclose(run.impacts.time[:5], [fall, *times], rtol=0, atol=5e-4)
    np.testing.assert_allclose(run.impacts.restitution[:5], e, rtol=1e-9)
    # the accumulation ends at (1 + e)/(1 - e) times the fall; then the ball rests: force m g in every step
    rest = fall * (1 + e) / (1 - e)
    resting = run.time > rest + 0.02
    np.testing.assert_allclose(run["contact_force"][resting], -2e-3 * g, rtol=1e-9)
    np.testing.assert_allclose(run["ball"][resting], run["ball"][-1], rtol=0, atol=1e-9)
    # a ball that sticks is no row of impacts: a dozen bounces, not 4000 steps
    assert len(run.impacts) < 25
    assert len(run.sticking) == 1
    # the wall pushes, whichever side it is on: the same sign as event-driven
    assert run.sticking.mean_force[0] == pytest.approx(2e-3 * g, rel=1e-2)
    assert run.energy.residual < 1e-12
    assert run.energy.contact_loss[-1] == pytest.approx(2e-3 * g * h, rel=2e-3)


def test_moreau_jean_and_the_event_driven_method_agree_before_chaos(reference):
    system = reduced(with_ball(reference, contact=fi.Rigid(0.6)), 3, 10)
    base, start = fi.Sine(1e-3, 5.2), fi.State(ball_velocity=[0.3])
    exact = fi.integrate(system, base, fi.EventDriven(), 0.25, initial=start).impacts
    error = []
    for dt in (4e-5, 1e-6):
        found = fi.integrate(system, base, fi.MoreauJean(dt), 0.25, initial=start).impacts
        assert len(found) == len(exact) >= 2
        error.append(np.max(np.abs(found.approach_speed / exact.approach_speed - 1)))
    # first order: each impact is met up to a step late
    assert error[0] < 0.02
    assert error[1] < 0.1 * error[0]


@pytest.mark.parametrize("method", [fi.Newmark(1e-4), fi.HHT(1e-4), fi.Newmark(1e-4, contact="energy-consistent")])
def test_a_rigid_contact_wants_impulses(method):
    with pytest.raises(fi.InputError, match=r"ball\.contact.*MoreauJean\(dt\) or EventDriven\(\)"):
        thrown_at(0.5, method)


def test_impulses_want_a_rigid_contact(small):
    with pytest.raises(fi.InputError, match=r"ball\.contact.*must be Rigid.*Newmark"):
        fi.integrate(small, STILL, fi.MoreauJean(1e-4), 0.1)


def test_a_sweep_takes_every_method(reference):
    rigid = with_ball(reference, contact=fi.Rigid(0.6))
    compliant, stiff = (reduced(structure, 2, 5) for structure in (reference, rigid))
    for method in [*FAMILY, fi.Newmark(1.0, refine=10), fi.EventDriven()]:
        impulsive = isinstance(method, fi.MoreauJean | fi.EventDriven)
        used = method if isinstance(method, fi.EventDriven) else replace(method, dt=1e-3 if method.refine > 1 else 1e-4)
        curve = fi.frequency_sweep(stiff if impulsive else compliant, 1e-3, [4.9, 5.2], used, 9)
        assert np.all(curve.impacts_per_cycle > 0)
        assert np.all(np.isnan(curve.peak_force) == impulsive)
        assert np.all(curve.peak > 0)


# ---- methods answer for themselves -----------------------------------------------------------------


@dataclass(frozen=True)
class LinearAcceleration(SteppingMembers):
    """A method of the user's own, here one that is known: linear acceleration, Newmark with beta = 1/6."""

    dt: float
    refine: int = 1
    allow_coarse_step: bool = False
    divergence_limit: float = 1000.0

    @property
    def stability_limit(self):
        """Largest dt omega."""
        return math.sqrt(12.0)

    def scheme(self, step):
        """Constants for a step."""
        return family_scheme(step, 0.0, 0.0, beta=1 / 6, gamma=0.5)


class Renamed:
    """A method that has only its members, and no class in common with others."""

    def __init__(self, inner):
        for name in MEMBERS:
            setattr(self, name, getattr(inner, name))


class Apart(Renamed):
    """The same, which takes its cases one by one."""

    def run_cases(self, *given):
        """Cases by runs."""
        return run_cases_apart(self, *given)

    def __init__(self, inner):
        super().__init__(inner)
        del self.run_cases


def own_methods(system):
    dt = fi.recommended_step(system)
    return [
        (LinearAcceleration(dt), fi.Newmark(dt, beta=1 / 6)),
        (Renamed(fi.HHT(dt)), fi.HHT(dt)),
        (Renamed(fi.EventDriven()), fi.EventDriven()),
    ]


@pytest.mark.parametrize("which", range(3))
def test_a_method_of_ones_own_runs_and_sweeps_like_one_of_ours(small, which):
    own, ours = own_methods(small)[which]
    base, frequencies = fi.Sine(0.2e-3, 5.0), [4.9, 5.3]
    runs = [fi.integrate(small, base, method, 1.0) for method in (own, ours)]
    np.testing.assert_array_equal(runs[0]["tip"], runs[1]["tip"])
    curves = [fi.frequency_sweep(small, 0.2e-3, frequencies, method, 12) for method in (own, ours)]
    np.testing.assert_array_equal(curves[0].peak, curves[1].peak)
    assert curves[0].warnings == curves[1].warnings


def test_cases_that_run_one_by_one_are_those_that_run_together(small):
    # of 13 cycles one runs before those whose last third is measured
    one, other = (
        fi.frequency_sweep(small, 0.2e-3, [4.9, 5.3], method, 13)
        for method in (Apart(fi.EventDriven(samples_per_cycle=1024)), fi.EventDriven(samples_per_cycle=1024))
    )
    # samples miss a crest by (pi/1024)^2/2 of it; impacts make rounding larger
    np.testing.assert_allclose(one.peak, other.peak, rtol=1e-5)
    np.testing.assert_allclose(one.rms, other.rms, rtol=1e-7)
    np.testing.assert_allclose(one.mean_impulse, other.mean_impulse, rtol=1e-7)
    np.testing.assert_allclose(one.energy_residual, other.energy_residual, atol=1e-9)
    assert one.warnings == other.warnings


class ClosedForm(Renamed):
    """An oscillator of 1 rad/s, released at 1 m: its states are known."""

    def run(self, system, excitation, duration, recorder, initial, progress=None):
        """The states, and what a ball does that is pushed for a second."""
        t = initial.time + 0.01 * np.arange(round(duration / 0.01) + 1)
        none = np.zeros((t.size, len(system.contacts)))
        push = none + np.where((t >= 2.0) & (t < 3.0), -0.5, 0.0)[:, None]
        return run_of_states(
            system, excitation, recorder, t, (np.cos(t)[:, None], -np.sin(t)[:, None]), (none, none), push
        )

    def __init__(self):
        super().__init__(fi.EventDriven())
        del self.run


@pytest.mark.parametrize("contacts", [0, 1])
def test_a_run_of_states_has_what_these_show(contacts):
    ball = fi.Impactor("ball", "mass", 0.1, 2.0, fi.KelvinVoigt(1e3, 0.5))
    system, base = oscillator(impactors=[ball] * contacts), fi.Sine(0.0, 1.0 / (2.0 * math.pi))
    pieces = []
    record = fi.Recorder("mass", every=10, start=1.0)
    run = fi.integrate(system, base, ClosedForm(), 4.5 * math.pi, record)
    np.testing.assert_allclose(run["mass"], np.cos(run.time), rtol=0, atol=1e-12)
    assert run.time[0] == 1.0
    # two whole cycles, and of the samples within
    assert run.steady.rms[0] == pytest.approx(math.sqrt(0.5), rel=1e-2)
    assert len(run.impacts) == contacts
    if contacts:
        assert (run.impacts.time[0], run.impacts.side[0]) == (2.0, -1.0)
        assert run.impacts.impulse[0] == pytest.approx(0.5, rel=1e-12)
    # shorter than a cycle there are no amplitudes
    assert np.isnan(fi.integrate(system, base, ClosedForm(), 3.0).steady.rms[0])
    streamed = fi.integrate(system, base, ClosedForm(), 4.5 * math.pi, replace(record, sink=pieces.append))
    np.testing.assert_array_equal(pieces[0].channels["mass"], run["mass"])
    assert (streamed.streamed_to, streamed.time.size) == (run.time[-1], 0)
    assert run.largest("mass").value == pytest.approx(1.0, abs=1e-12)


def test_a_method_of_ones_own_that_lacks_a_member_is_refused_by_its_name(small):
    half = Renamed(fi.HHT(1e-4))
    del half.run_cases
    for work in (
        lambda method: fi.integrate(small, STILL, method, 1.0),
        lambda method: fi.frequency_sweep(small, 1e-4, [5.0], method, 12),
        lambda method: fi.integrators.achieved_restitution(small.contacts[0], method, 0.1),
    ):
        with pytest.raises(fi.InputError, match=r"must be a Newmark, .* or a method of your own .* has run_cases$"):
            work(half)
        for nothing in ("newmark", None, fi.Newmark, 1.0):
            with pytest.raises(fi.InputError, match=r"must be a Newmark, .* or EventDriven$"):
                work(nothing)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_of_a_study_file_has_every_answer(small, name):
    method = METHODS[name].for_system(small)
    require_method(method)
    # the noun itself is no method
    with pytest.raises(fi.InputError, match="must be a Newmark"):
        require_method(METHODS[name])
    grid = method.time_grid(small, STILL, 100.0, fi.Recorder())
    assert grid > 0.0
    assert read_at_least(method, 1) == method
    # a finer grid is never coarser, and its instants are whole parts of a cycle or the step
    assert read_at_least(method, 1024).time_grid(small, STILL, 100.0, fi.Recorder()) <= grid
    assert 0.0 < seconds_of_cycle(method, small, 5.0) < 1.0
    assert seconds_of_cycle(method, small, 5.0, sweep=True) > 0.0


def test_a_method_without_a_step_for_a_law_has_no_restitution_of_its_own(small):
    pair = small.contacts[0]
    for method in (fi.EventDriven(), fi.MoreauJean(1e-4)):
        assert method.achieved_restitution(pair, 0.1) is None
        with pytest.raises(fi.InputError, match="must be a method with a step for the law kelvin-voigt"):
            fi.integrators.achieved_restitution(pair, method, 0.1)


def test_a_conditionally_stable_step_is_refused_beyond_its_limit():
    # central differences of one mode: dt omega <= 2
    system = oscillator(stiffness=9.0)
    for dt, fine in ((0.6666, True), (0.6667, False)):
        method = fi.Newmark(dt, beta=0.0, gamma=0.5)
        assert method.stability_limit == pytest.approx(2.0, rel=1e-15)
        if fine:
            assert method.check(system) == ()
        else:
            with pytest.raises(fi.InputError, match="only conditionally stable"):
                method.check(system)
