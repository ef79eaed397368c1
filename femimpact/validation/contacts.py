"""Reference cases of contacts and of single impacts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from femimpact.contact.collision import Collision
from femimpact.contact.custom_law import CustomLaw
from femimpact.contact.law import ContactLaw, collide, contact_force
from femimpact.contact.laws import (
    STEEL,
    Flores,
    GonthierCarvalhoMartins,
    Hertz,
    HuntCrossley,
    KelvinVoigt,
    LankaraniNikravesh,
    PowerLaw,
    Rigid,
    hertz_stiffness,
)
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Impactor, Meeting, Stop
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case, oscillator

MASS, SPEED, RADIUS = 3.43e-3, 0.26, 0.5 * 9.49e-3
"""A steel ball of 9.49 mm, kg, m/s and m."""
STIFFNESS = 1e10
"""N/m^1.5."""
RELATION = "root of d (1 + e) = ln[(1 + d)/(1 - e d)]"
"""Between loss factor and restitution of every law k p^n (1 + d p'/v)."""


@dataclass(frozen=True)
class Published:
    """A law k p^1.5 (1 + d p'/v) by its author's loss factor d of the restitution asked for."""

    name: str
    source: str
    make: Callable[[float, float], PowerLaw]
    loss: Callable[[float], float]


PUBLISHED = (
    Published("Hunt-Crossley", "Hunt and Crossley (1975)", HuntCrossley, lambda e: 3 * (1 - e) / 2),
    Published(
        "Lankarani-Nikravesh", "Lankarani and Nikravesh (1990)", LankaraniNikravesh, lambda e: 3 * (1 - e**2) / 4
    ),
    Published("Flores", "Flores et al. (2011)", Flores, lambda e: 8 * (1 - e) / (5 * e)),
)
"""Laws that miss the restitution asked for, with their published loss factors."""


def _integrated(law: ContactLaw) -> Collision:
    """One collision under the law's force, by integration in time, not by the closed form."""

    def force(depth: float, rate: float, approach_speed: float) -> float:
        return contact_force(law, depth, rate, approach_speed, MASS)

    return collide(CustomLaw(force), MASS, SPEED)


def hertz() -> Iterator[Case]:
    """A steel ball on steel: contact time 2.9432 p_max/v, peak force k p^1.5 with (2/5) k p^2.5 = m v^2/2."""
    ball = Hertz(hertz_stiffness(RADIUS, STEEL, STEEL))
    impact = collide(ball, MASS, SPEED)
    yield Case(
        "Hertz contact: time", "derived here (gamma functions)", "contact time v/p_max", "1",
        0.8 * math.gamma(0.4) * math.sqrt(math.pi) / math.gamma(0.9),
        impact.contact_time * SPEED / impact.largest_penetration, 1e-9, "quadrature of a smooth integrand, 60 points",
    )  # fmt: skip
    modulus = STEEL.young_modulus / (2 * (1 - STEEL.poisson_ratio**2))
    stiffness = 4 / 3 * modulus * math.sqrt(RADIUS)
    force = stiffness * ((5 * MASS * SPEED**2 / (4 * stiffness)) ** 0.4) ** 1.5
    for way, computed, bound, reason in (
        ("closed form", impact, 1e-12, "rounding"),
        ("integrated", _integrated(ball), 1e-3, "largest of the integrator's own steps"),
    ):
        yield Case(
            f"Hertz contact of steel: peak force, {way}", "derived here (energy; Hertz, 1882)", "peak force", "N",
            force, computed.peak_force, bound, reason,
        )  # fmt: skip


def restitution_of(loss: float) -> float:
    """Root e of d (1 + e) = ln[(1 + d)/(1 - e d)], e > 0."""
    from scipy.optimize import brentq

    def difference(e: float) -> float:
        return loss * (1 + e) - math.log1p(loss) + math.log1p(-e * loss)

    return float(brentq(difference, 1e-9, min(1.0, (1 - 1e-15) / loss), xtol=1e-15))


def _stepped(law: ContactLaw, steps: int) -> float:
    """Restitution of the same collision in the time loop, so many Newmark steps in the contact."""
    ball = Impactor("ball", "tip", MASS, 1e-6, law)
    # a wall that does not move: the structure's row is zero
    system = oscillator(shape=0.0, impactors=[ball])
    contact_time = collide(law, MASS, SPEED).contact_time
    dt = contact_time / steps
    still, method = Sine(0.0, 1 / (400 * dt)), Newmark(dt, divergence_limit=1e6)
    start = State(ball_velocity=[SPEED])
    run = integrate(system, still, method, 1e-6 / SPEED + 1.5 * contact_time, initial=start)
    return float(run.impacts.rebound_speed[0] / run.impacts.approach_speed[0])


def restitutions() -> Iterator[Case]:
    """Restitution under laws that return what is asked, and under those with their authors' loss factors."""
    integrated = "integration to 1e-10 a step; the end of the contact is read from the steps"
    source, unit = "Schwager and Poeschel (2007)", "1"
    linear = {asked: KelvinVoigt(restitution=asked, contact_time=1e-4) for asked in (0.3, 0.5, 0.8)}
    for asked, law in linear.items():
        yield Case(
            f"Kelvin-Voigt, e = {asked:g} asked", source, "restitution", unit, asked, _integrated(law).restitution,
            1e-6, "integration to 1e-10 a step; the end is read from the steps",
        )  # fmt: skip
    for asked, law in linear.items():
        yield Case(
            f"Kelvin-Voigt, e = {asked:g} asked, Newmark T_c/1000", source, "restitution", unit, asked,
            _stepped(law, 1000), 2e-3,
            "first order: the dashpot starts up to one step late, 2 z w0 dt = 2e-3 of the speed",
        )  # fmt: skip
    for asked in linear:
        yield Case(
            f"Gonthier/Carvalho-Martins, e = {asked:g} asked", "Gonthier et al. (2004)", "restitution", unit, asked,
            _integrated(GonthierCarvalhoMartins(STIFFNESS, asked)).restitution, 1e-6, integrated,
        )  # fmt: skip
    for published, asked in itertools.product(PUBLISHED, linear):
        yield Case(
            f"{published.name}, e = {asked:g} asked", f"{published.source}; {RELATION}", "restitution", unit,
            restitution_of(published.loss(asked)), _integrated(published.make(STIFFNESS, asked)).restitution, 1e-6,
            integrated,
        )  # fmt: skip
    for published in PUBLISHED:
        yield Case(
            f"{published.name}, e = 0.5 asked, Newmark T_c/400", f"{published.source}; {RELATION}", "restitution",
            unit, restitution_of(published.loss(0.5)), _stepped(published.make(STIFFNESS, 0.5), 400), 4e-5,
            "second order: (2 pi/400)^2/6, the force of these laws starts and ends at zero",
        )  # fmt: skip


CASES = (hertz, restitutions)
"""The cases of this subject, in the order of the table."""


GRAVITY = 9.81
FREQUENCY = 20.0
"""Frequency of the vibrating table, Hz."""


def free_masses(masses: list[float], restitution: float, gap: float = 0.0) -> System:
    """Bodies in a row, free and a gap (m) apart when their displacements are equal: each meets the next one only."""
    n = len(masses)
    points = {f"mass {i}": np.eye(n)[i] for i in range(n)}
    points |= {f"between {i}": np.eye(n)[i] - np.eye(n)[i + 1] for i in range(n - 1)}
    stops = [Stop(f"contact {i}", f"between {i}", (gap, math.inf), Rigid(restitution)) for i in range(n - 1)]
    zero = np.zeros((n, n))
    return System.from_matrices(np.diag(masses), zero, zero, points=points, stops=stops)


def shaken_floor(law: ContactLaw, gap: tuple[float, float], acceleration: float = 0.0) -> System:
    """A ball between walls that move with the base: the structure has no motion where the ball is."""
    ball = Impactor("ball", "floor", 1.0, gap, law, acceleration=acceleration)
    return System.from_matrices([[1.0]], [[0.1]], [[1.0]], points={"floor": [0.0]}, impactors=[ball])


def _collision_run(masses: list[float], restitution: float, gap: float = 0.0) -> Response:
    """The first body sent against the others with 2 m/s from 1 m away."""
    n = len(masses)
    start = State(displacement=[-1.0] + [0.0] * (n - 1), velocity=[2.0] + [0.0] * (n - 1))
    channels = tuple(f"mass {i}.velocity" for i in range(n))
    return integrate(
        free_masses(masses, restitution, gap), Sine(0.0, 1.0), EventDriven(), 1.0, Recorder(channels), start
    )  # fmt: skip


def collision() -> Iterator[Case]:
    """Velocities after a collision of two free bodies, from momentum and restitution."""
    for restitution, body in itertools.product((0.0, 0.6, 1.0), (0, 1)):
        m = [0.3, 0.7]
        common = 2.0 * m[0] / sum(m)
        # in the frame of the centre of mass each velocity is turned and multiplied by e
        reference = common - restitution * (2.0 - common) if body == 0 else common + restitution * common
        yield Case(
            f"collision of 0.3 and 0.7 kg, e = {restitution:g}, body {body + 1}",
            "derived here (momentum and restitution)", "velocity after", "m/s", reference,
            float(_collision_run(m, restitution)[f"mass {body}.velocity"][-1]), 1e-12, "rounding",
        )  # fmt: skip


def row_of_bodies() -> Iterator[Case]:
    """Equal bodies without loss: a gap apart the last one leaves with the first one's speed, as in Newton's cradle.

    In touch they take part in one impact, in which the first meets the mass of all the others.
    """
    for gap, final in ((1e-3, (0.0, 0.0, 0.0, 0.0, 2.0)), (0.0, (-2 / 3, 4 / 3, 4 / 3))):
        count = len(final)
        run = _collision_run([1.0] * count, 1.0, gap)
        velocities = np.array([run[f"mass {i}.velocity"][-1] for i in range(count)])
        yield Case(
            "Newton's cradle of five" if gap else f"row of {count} bodies in touch",
            "derived here (momentum and energy)", "largest error of the velocities", "m/s", 0.0,
            float(np.max(np.abs(velocities - final))), 1e-12, "rounding",
        )  # fmt: skip


def balls_that_meet() -> Iterator[Case]:
    """A cradle of three and a stack of two on a floor: balls in touch have one impact, others one after the other."""
    lower, upper = 0.01, 0.003
    apart = ((lower - 3 * upper) / (lower + upper), (3 * lower - upper) / (lower + upper))
    for words, masses, gap, restitution, speeds, after in (
        ("cradle of three balls in touch", [lower] * 3, 0.0, 1.0, (1.0, 0.0, 0.0), (-1 / 3, 2 / 3, 2 / 3)),
        ("cradle of three balls apart", [lower] * 3, 1e-6, 1.0, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ("cradle of three balls apart, e = 0.05", [lower] * 3, 1e-2, 0.05, (1.0, 0.0, 0.0), (1 / 3, 1 / 3, 1 / 3)),
        ("stack of two balls in touch", [lower, upper], 0.0, 1.0, (-1.0, -1.0), (1.0, 1.0)),
        ("stack of two balls apart", [lower, upper], 1e-6, 1.0, (-1.0, -1.0), apart),
    ):
        law, names, floors = Rigid(restitution), "abc"[: len(masses)], (0.1, math.inf, math.inf)
        balls = [Impactor(x, "floor", m, (math.inf, g), law) for x, m, g in zip(names, masses, floors, strict=False)]
        met = [Meeting(a + b, (a, b), gap, law) for a, b in itertools.pairwise(names)]
        start = State(ball_displacement=[-0.05 * (speeds[0] > 0.0), *[0.0] * (len(names) - 1)], ball_velocity=speeds)
        system = System.from_matrices([[1.0]], [[0.1]], [[1.0]], points={"floor": [0]}, impactors=balls, meetings=met)
        channels = [f"{x}.velocity" for x in names]
        run = integrate(system, Sine(0.0, 1.0), EventDriven(), 0.2, Recorder(channels), start)
        error = max(abs(float(run[x][-1]) - speed) for x, speed in zip(channels, after, strict=True))
        name, source = f"balls that meet: {words}", "derived here (momentum and restitution)"
        yield Case(name, source, "largest error of the speeds", "m/s", 0.0, error, 1e-12, "rounding")


def at_one_instant() -> Iterator[Case]:
    """Balls of 1 kg that meet a free wall of 1 kg at 1 m/s and at one instant: u+ = -e u- for each of them.

    With momentum the wall then moves at sum (1 + e)/(1 + n), and each ball at that less its e.
    """
    for restitutions in ((0.5, 0.5), (0.9, 0.1), (0.0, 0.0, 0.0)):
        balls = [Impactor(f"ball {k}", "wall", 1.0, 1.0, Rigid(e)) for k, e in enumerate(restitutions)]
        zero, count = np.zeros((1, 1)), len(restitutions)
        system = System.from_matrices([[1.0]], zero, zero, points={"wall": [1.0]}, impactors=balls)
        start = State(ball_velocity=[1.0] * count)
        channels = ("wall.velocity", *(f"{ball.name}.velocity" for ball in balls))
        run = integrate(system, Sine(0.0, 1.0), EventDriven(), 1.5, Recorder(channels), start)
        wall = (count + sum(restitutions)) / (1 + count)
        exact = np.array([wall, *(wall - e for e in restitutions)])
        velocities = np.array([run[channel][-1] for channel in channels])
        # each loses 1/2 (1 - e) p u
        lost = 0.5 * np.sum((1 - np.array(restitutions)) * (1 - exact[1:]))
        off = [*np.abs(velocities - exact), abs(run.impacts.energy_loss.sum() - lost)]
        yield Case(
            f"{count} balls meet a wall at one instant, e = {', '.join(f'{e:g}' for e in restitutions)}",
            "Moreau (1988)", "largest error of the velocities and of the loss (J)", "m/s", 0.0, float(np.max(off)),
            1e-12, "rounding",
        )  # fmt: skip


def ball_comes_to_rest() -> Iterator[Case]:
    """A dropped ball rests after v/g + 2 e v/(g (1 - e)), v = sqrt(2 g h)."""
    for restitution in (0.3, 0.7, 0.95):
        height = 4e-3
        speed = math.sqrt(2 * GRAVITY * height)
        rest = speed / GRAVITY + 2 * restitution * speed / (GRAVITY * (1 - restitution))
        system = shaken_floor(Rigid(restitution), (1.0, height), -GRAVITY)
        run = integrate(system, Sine(0.0, 5.0), EventDriven(), rest + 0.1, Recorder(("ball",)))
        computed = float(run.sticking.start[0]) if run.sticking.start.size == 1 else math.nan
        yield Case(
            f"bouncing ball, e = {restitution:g}", "derived here (geometric series)", "time to rest", "s", rest,
            computed, 1e-12, "rounding; bounces below the closure of 1e-12 m are summed in closed form",
        )  # fmt: skip


def restitution_over_speed() -> Iterator[Case]:
    """A dropped ball with e = .8 (v/.1 m/s)^(-1/4): v_n = c^(4 (1 - q^n)) v_0^(q^n), q = 3/4, c = .8 x .1^(1/4)."""
    height, falling = 0.02, 0.75**5
    law = Rigid(0.8, at_speed=0.1, exponent=-0.25, at_most=0.95)
    run = integrate(shaken_floor(law, (1.0, height), -GRAVITY), Sine(0.0, 5.0), EventDriven(), 1.0, Recorder(("ball",)))
    exact = (0.8 * 0.1**0.25) ** (4 * (1 - falling)) * math.sqrt(2 * GRAVITY * height) ** falling
    name, source, quantity = "ball, restitution over speed", "derived here (recursion)", "speed before impact 6"
    speed, reason = float(run.impacts.approach_speed[5]), "rounding of six flights"
    yield Case(name, source, quantity, "m/s", exact, speed, 1e-13, reason)


def ball_leaves_the_table() -> Iterator[Case]:
    """A ball at rest on a table A sin(w t) leaves it where A w^2 sin(theta) = g."""
    gain = 1.3
    table = Sine(gain * GRAVITY / (2 * math.pi * FREQUENCY) ** 2, FREQUENCY)
    run = integrate(shaken_floor(Rigid(0.4), (1.0, 0.0), -GRAVITY), table, EventDriven(), 2.0)
    phase = np.mod(table.omega * run.sticking.end[:-1], 2 * math.pi)
    exact = math.asin(1 / gain)
    worst = float(phase[np.argmax(np.abs(phase - exact))]) if phase.size else math.nan
    yield Case(
        "ball on a vibrating table: it leaves", "derived here (A w^2 sin = g)", "phase of leaving, the worst of 2 s",
        "rad", exact, worst, 1e-9, "rounding of t w at t = 2 s",
    )  # fmt: skip


THETA = math.acos(1 / 1.3)
"""Phase, 0.69 rad, of the impacts of a bounce that is stable."""


def bouncing(restitution: float, off: float, cycles: float) -> Response:
    """A ball of 1 kg that bounces once in each cycle: cos(theta) = pi g (1 - e)/((1 + e) A w^2).

    A free motion of one period from and to the same height starts with v = g T/2 and ends with -v. The
    impact demands v - A w cos(theta) = e (v + A w cos(theta)). The start is so many times as fast as the orbit.
    """
    pull = math.pi * GRAVITY * (1 - restitution) / (1 + restitution)
    omega = 2 * math.pi * FREQUENCY
    table = Sine(1.3 * pull / omega**2, FREQUENCY, THETA)
    rebound = GRAVITY / (2 * FREQUENCY) - table.amplitude * omega * math.cos(THETA)
    start = State(ball_displacement=[0.0], ball_velocity=[off * rebound])
    system = shaken_floor(Rigid(restitution), (1.0, 0.0), -GRAVITY)
    return integrate(system, table, EventDriven(), cycles / FREQUENCY, initial=start)


def ball_bounces_once_a_cycle() -> Iterator[Case]:
    """One bounce in each cycle, from a start that is 2 % too fast: the motion has to find the orbit."""
    for restitution in (0.5, 0.8):
        run = bouncing(restitution, 1.02, 400)
        yield Case(
            f"ball on a vibrating table: once a cycle, e = {restitution:g}", "derived here (as Holmes, 1982)",
            "phase of the impact after 400 cycles", "rad", THETA, float(run.impacts.phase[-1]), 1e-9,
            "rounding of t w at 400 cycles; the start's 2 % have decayed",
        )  # fmt: skip


def ball_is_left() -> Iterator[Case]:
    """A ball that falls on a free table without rebound stops it alone: what lies there is left by its table.

    With the ball that lies there the impulse would be v/(1/m + 1/(M + m')).
    """
    table, lying, falling, height = 1.0, 0.5, 0.2, 4e-3
    balls = [
        Impactor(name, "table", mass, (1.0, gap), Rigid(0.0), acceleration=-pull)
        for name, mass, gap, pull in (("lying", lying, 0.0, GRAVITY), ("falling", falling, height, 3 * GRAVITY))
    ]
    zero = np.zeros((1, 1))
    system = System.from_matrices([[table]], zero, zero, points={"table": [1.0]}, impactors=balls)
    run = integrate(system, Sine(0.0, 50.0), EventDriven(), 0.04)
    # table and ball are pulled together by the weight of the ball
    speed = math.sqrt(2 * (3 * GRAVITY - lying * GRAVITY / (table + lying)) * height)
    hit = run.impacts.impactor == "falling"
    yield Case(
        "ball that falls beside one that lies on a free table", "derived here (momentum)", "impulse of its impact",
        "N s", speed / (1 / falling + 1 / table), float(run.impacts.impulse[hit][0]), 1e-11, "rounding",
    )  # fmt: skip


def nearly_rigid_meets_its_wall() -> Iterator[Case]:
    """A mass that next to nothing holds, under a sine and a constant force."""
    from scipy.optimize import brentq

    omega, pull, amplitude, rate, gap = 1e-4, 0.7, 0.02, 2 * math.pi * FREQUENCY, 0.4
    stop = Stop("wall", at="mass", gap=(gap, math.inf), contact=Rigid(0.5))
    system = System.from_matrices(
        [[1.0]], [[0.0]], [[omega**2]], points={"mass": [1.0]}, stops=[stop], constant_load=[pull]
    )  # fmt: skip
    run = integrate(system, Sine(amplitude, FREQUENCY), EventDriven(), 1.5, initial=State([0.0], [0.1]))
    steady = amplitude * rate**2 / (omega**2 - rate**2)

    def clearance(time: float) -> float:
        free = (0.1 - steady * rate) / omega * math.sin(omega * time)
        return steady * math.sin(rate * time) + free + 2 * pull * (math.sin(omega * time / 2) / omega) ** 2 - gap

    time = float(run.impacts.time[0])
    yield Case(
        "nearly rigid mass under a sine and a constant force", "derived here (steady and free motions)",
        "time of its impact", "s", float(brentq(clearance, 0.9 * time, 1.1 * time, xtol=1e-15)), time, 1e-13,
        "rounding of the gap over its speed",
    )  # fmt: skip


IMPACT_CASES = (
    collision,
    row_of_bodies,
    balls_that_meet,
    at_one_instant,
    ball_comes_to_rest,
    restitution_over_speed,
    ball_leaves_the_table,
    ball_is_left,
    nearly_rigid_meets_its_wall,
    ball_bounces_once_a_cycle,
)
"""The cases of this subject, in the order of the table."""
