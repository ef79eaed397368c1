"""Polynomials between knots drive the event-driven method exactly, and no crossing is missed under them."""

import dataclasses
import itertools
import math

import mpmath as mp
import numpy as np
import pytest
import scipy.integrate
from builders import REFERENCE, reduced, with_ball
from reference_events import Oscillator

import femimpact as fi
from femimpact.excitation.piecewise_polynomial import fitted, pieces_of

OMEGA, ZETA, MASS, BALL, GAP, RESTITUTION = 10.0 * math.pi, 0.01, 1.0, 0.1, 1e-3, 0.7


@dataclasses.dataclass(frozen=True, eq=False)
class Own:
    """A user's class whose closed form is made of polynomials."""

    closed_form: fi.excitation.PiecewisePolynomial
    frequency = 5.0
    phase = math.nan
    amplitude = 1e-3

    def displacement(self, time):
        """Of the base."""
        return self.closed_form.displacement(time)

    def velocity(self, time):
        """Of the base."""
        return self.closed_form.velocity(time)

    def acceleration(self, time):
        """Of the base."""
        return self.closed_form.value(time)


def in_a_box(contact=None, modes=1):
    """One oscillator with a ball."""
    ball = fi.Impactor("ball", at="mass", mass=BALL, gap=GAP, contact=contact or fi.Rigid(restitution=RESTITUTION))
    whole = fi.System.from_matrices(
        [[MASS]], [[2.0 * ZETA * OMEGA * MASS]], [[OMEGA**2 * MASS]], points={"mass": [1.0]}, impactors=[ball]
    )
    return fi.reduce(whole, modes=modes)


def random_pieces(seed=3, count=40):
    """Pieces of degree 5 of many lengths, with jumps between them."""
    rng = np.random.default_rng(seed)
    knots = np.cumsum(np.concatenate([[0.0], rng.uniform(0.02, 0.08, count)]))
    return fi.excitation.PiecewisePolynomial(knots, rng.normal(size=(count, 6)) / 0.05 ** np.arange(6))


def of_ends(pieces):
    """The same history in 30 digits."""

    def s(time):
        k = int(np.searchsorted(pieces.knots, float(time), side="right")) - 1
        later, total = time - mp.mpf(pieces.knots[k]), mp.mpf(0)
        for coefficient in pieces.coefficients[k][::-1]:
            total = total * later + mp.mpf(coefficient)
        return total

    return s


def same_impacts(run, expected, share):
    """Times and approach speeds agree; every impact multiplies a difference."""
    times, speeds = (np.array([row[i] for row in expected]) for i in (0, 2))
    assert np.abs(run.impacts.time[: times.size] - times).max() <= share
    assert np.abs(run.impacts.approach_speed[: times.size] / speeds - 1.0).max() <= 100.0 * share


@pytest.mark.impacts
def test_the_first_ten_impacts_under_quintic_pieces_are_those_of_30_digits():
    pieces = random_pieces()
    exact = Oscillator(OMEGA, ZETA, MASS, BALL, GAP, RESTITUTION, of_ends(pieces)).impacts(pieces.knots[1:], 10)
    run = fi.integrate(in_a_box(), Own(pieces), fi.EventDriven(), 1.0, fi.Recorder(interval=1e-3))
    same_impacts(run, exact, 1e-12)


@pytest.mark.impacts
def test_the_energy_balance_closes_under_pieces_as_under_a_sine():
    # 8 modes, of which the fast ones turn several times in a piece and the slow ones hardly do
    for contact in (fi.Rigid(restitution=0.7), fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)):
        system = reduced(with_ball(REFERENCE, contact=contact), 8)
        run = fi.integrate(system, Own(random_pieces()), fi.EventDriven(), 2.0, fi.Recorder(interval=1e-3))
        assert len(run.impacts) > 10
        assert run.energy.residual < 1e-11


def test_a_broken_line_as_polynomials_is_the_broken_line():
    rng = np.random.default_rng(1)
    base = fi.RecordedBase(rng.normal(size=200), 0.01, initial_velocity=0.2)
    pieces, times = pieces_of(base.closed_form), np.linspace(0.0, 2.5, 1001)
    # sums in another order
    for name, other in (("displacement", base.displacement), ("velocity", base.velocity), ("value", base.acceleration)):
        np.testing.assert_allclose(getattr(pieces, name)(times), other(times), atol=1e-13)
    system = reduced(with_ball(REFERENCE, contact=fi.Rigid(restitution=0.7)), 4)
    record = fi.Recorder(interval=1e-3)
    one, other = (fi.integrate(system, drive, fi.EventDriven(), 0.5, record) for drive in (base, Own(pieces)))
    np.testing.assert_array_equal(one["tip"], other["tip"])


def test_pieces_that_are_split_anywhere_are_the_same_motion():
    # a polynomial on the intervals between more knots: Taylor's series about each of them
    whole = random_pieces(count=6)
    shifted = [np.polynomial.Polynomial(row) for row in whole.coefficients]
    knots, rows = [], []
    for i, (a, b) in enumerate(zip(whole.knots[:-1], whole.knots[1:], strict=True)):
        for part in (0.0, 0.3, 0.7):
            knots.append(a + part * (b - a))
            own = [shifted[i].deriv(n)(part * (b - a)) / math.factorial(n) if n else shifted[i](part * (b - a))
                   for n in range(6)]  # fmt: skip
            rows.append(own)
    split = fi.excitation.PiecewisePolynomial([*knots, whole.knots[-1]], rows)
    record = fi.Recorder(interval=1e-3, channels=("mass",))
    alone = fi.without_impactors(in_a_box())
    one, other = (fi.integrate(alone, Own(p), fi.EventDriven(), 0.25, record)["mass"] for p in (whole, split))
    np.testing.assert_allclose(one, other, atol=1e-12 * np.abs(one).max())


def test_the_motion_is_the_convolution():
    pieces = random_pieces(count=10)
    alone = fi.without_impactors(in_a_box())
    run = fi.integrate(alone, Own(pieces), fi.EventDriven(), 0.4, fi.Recorder(interval=0.01, channels=("mass",)))
    decay, turning = ZETA * OMEGA, OMEGA * math.sqrt(1.0 - ZETA**2)

    def response(time):
        def weighed(tau):
            answer = np.exp(-decay * (time - tau)) * np.sin(turning * (time - tau)) / turning
            return float(-pieces.value(tau) * answer)

        ends = [*pieces.knots[pieces.knots < time], time]
        parts = [scipy.integrate.quad(weighed, a, b, epsabs=1e-15)[0] for a, b in itertools.pairwise(ends)]
        return sum(parts)

    expected = np.array([response(time) for time in run.time[::8]])
    np.testing.assert_allclose(run["mass"][::8], expected, atol=1e-12)


@pytest.mark.impacts
def test_no_crossing_is_missed_under_pieces():
    # the events of the search, against a fine scan of the motion that it leaves out the walls of
    rng = np.random.default_rng(5)
    for seed in range(40):
        pieces = random_pieces(seed, 12)
        scale = float(np.abs(pieces.displacement(np.linspace(0.0, 0.4, 400))).max())
        gap = scale * 10.0 ** rng.uniform(-3, -0.5)
        system = in_a_box()
        pair = dataclasses.replace(system.contacts[0], gaps=(gap, gap))
        far = dataclasses.replace(pair, gaps=(1e9, 1e9))
        near, open_ = (dataclasses.replace(system, contacts=(own,)) for own in (pair, far))
        record = fi.Recorder(interval=2e-5, channels=("ball.gap",))
        free = fi.integrate(open_, Own(pieces), fi.EventDriven(), 0.3, record)
        first = free.time[np.abs(free["ball.gap"]) > gap]
        run = fi.integrate(near, Own(pieces), fi.EventDriven(), 0.3, fi.Recorder(interval=1e-3))
        assert (len(run.impacts) > 0) == (first.size > 0)
        if first.size:
            assert first[0] - 2e-5 - 1e-12 <= run.impacts.time[0] <= first[0] + 1e-12


def test_a_history_that_begins_later_leaves_all_at_rest_until_then():
    late = fi.excitation.PiecewisePolynomial([0.2, 0.3], [[5.0, -3.0, 1.0]])
    run = fi.integrate(in_a_box(), Own(late), fi.EventDriven(), 0.4, fi.Recorder(interval=1e-2, channels=("mass",)))
    assert np.all(run["mass"][run.time < 0.2] == 0.0)
    assert np.abs(run["mass"][run.time > 0.25]).min() > 0.0


def test_displacement_velocity_and_value_are_derivatives_of_one_another():
    pieces = random_pieces(count=5)
    h = np.diff(pieces.knots)
    # inside the pieces, by Gauss points, which integrate polynomials of this degree exactly
    nodes, weights = np.polynomial.legendre.leggauss(6)
    inner = pieces.knots[:-1, None] + 0.5 * h[:, None] * (1.0 + nodes)
    for lower, upper in ((pieces.displacement, pieces.velocity), (pieces.velocity, pieces.value)):
        change = lower(pieces.knots[1:] - 1e-300) - lower(pieces.knots[:-1])
        np.testing.assert_allclose(0.5 * h * (upper(inner) @ weights), change, atol=1e-13)


def test_six_gauss_points_leave_the_error_that_is_promised():
    # a sine of 100 pieces of 0.28 rad: (0.28)^6/(720 924) of its amplitude, and moments to rounding
    knots = 0.28 * np.arange(101)
    pieces = dataclasses.replace(fitted(np.sin, knots), initial_velocity=-1.0, starts=None)
    times = np.linspace(0.0, 28.0, 20_001)[:-1]
    assert np.abs(pieces.value(times) - np.sin(times)).max() <= 1.05 * 0.28**6 / (720 * 924)
    assert np.abs(pieces.displacement(times) + np.sin(times)).max() <= 1e-11


@pytest.mark.parametrize(
    ("knots", "coefficients", "more", "words"),
    [
        ([0.0, 2.0, 1.0], [[1.0], [1.0]], {}, r"knots = '2 and then 1' s: must be 2 or more finite numbers that rise"),
        ([0.0, 1.0, 1.0], [[1.0], [1.0]], {}, r"knots = '1 and then 1' s.*rise"),
        ([0.0, math.nan], [[1.0]], {}, r"knots.*must be 2 or more finite numbers"),
        ([0.0], [], {}, r"knots.*must be 2 or more"),
        ([0.0, 1.0], [[1.0] * 7], {}, r"coefficients.*in 1 rows, one less than knots, of 1 to 6: degree 0 to 5"),
        ([0.0, 1.0], [[]], {}, r"coefficients.*degree 0 to 5"),
        ([0.0, 1.0], [[math.inf]], {}, r"coefficients.*must be finite"),
        ([0.0, 1e300], [[1e300]], {}, r"coefficients.*must move the base by finite sizes"),
        ([0.0, 1.0], [[1.0]], {"starts": [[0.0, 0.0], [5.0, 1.0]]}, r"starts.*must be the integrals of the pieces"),
        ([0.0, 1.0], [[1.0]], {"starts": [[0.0, 0.0]]}, r"starts.*in 2 rows of 2"),
    ],
)
def test_pieces_that_are_none_are_refused_in_one_line(knots, coefficients, more, words):
    with pytest.raises(fi.InputError, match=words) as refusal:
        fi.excitation.PiecewisePolynomial(knots, coefficients, **more)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("ratio", [3.0, 20.0, 200.0])
def test_a_mode_far_below_the_drive_keeps_its_digits(ratio):
    # pieces of 0.28 rad of a sine, whose derivatives over powers of the mode's frequency are up to ratio^5
    frequency, end = 5.0 * 1.0371 * ratio, 40.0 / (5.0 * ratio)
    base = fi.Sine(1e-3, frequency)
    knots = np.linspace(0.0, 1.01 * end, math.ceil(1.01 * end * base.omega / 0.28) + 1)
    pieces = dataclasses.replace(
        fitted(base.acceleration, knots), initial_velocity=base.amplitude * base.omega, starts=None
    )
    record = fi.Recorder(interval=0.1 / frequency, channels=("mass",))
    alone = fi.without_impactors(in_a_box())
    one, other = (fi.integrate(alone, drive, fi.EventDriven(), end, record) for drive in (base, Own(pieces)))
    np.testing.assert_allclose(other["mass"], one["mass"], atol=1e-10 * np.abs(one["mass"]).max())
    assert other.energy.residual < 1e-11
