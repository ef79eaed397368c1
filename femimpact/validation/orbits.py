"""Periodic motions with impacts beside closed forms: runs that settle on them, orbits, branches and bifurcations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.contact.laws import KelvinVoigt, Rigid
from femimpact.design.ball import damper_curve
from femimpact.excitation.drives import Drives, PointForce
from femimpact.excitation.harmonic import Sine
from femimpact.fem.assembly import assemble
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import integrate
from femimpact.orbits.branch import Branch, continue_orbit
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
from femimpact.orbits.search import find_orbit, two_impact_orbits
from femimpact.orbits.switching import switch_branch
from femimpact.response.response import Response
from femimpact.structure.beam import Beam, Rayleigh
from femimpact.structure.structure import Impactor, PointMass, Stop, Structure
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case, oscillator
from femimpact.validation.closed_forms import (
    ClosedForm,
    box_coefficients,
    box_fold,
    box_orbits,
    stop_coefficients,
    stop_harmonic,
    stop_orbits,
)
from femimpact.validation.contacts import shaken_floor

ORBITS = (
    # mass ratio, restitution, damping ratio, frequency ratio, total clearance; speed of the ball; largest eigenvalue
    (0.1, 0.8, 0.01, 1.0, 20.0, 7.696818, 0.9515),
    (0.1, 0.6, 0.01, 1.0, 24.0, 7.527982, 0.8785),
    (0.05, 0.7, 0.005, 1.0, 40.0, 15.249852, 0.9604),
    (0.1, 0.8, 0.01, 0.98, 20.0, 9.475270, 1.2605),
)
"""Two impacts in each cycle, M = K = F = 1: the project's table, compared with an event-driven simulation before."""


# ---- an oscillator that hits one stop ------------------------------------------------------------


def _at_a_stop(omega: float, stop: float, leads: tuple[float, ...]) -> tuple[Response, float, float]:
    """400 cycles against a stop, a sine of force for each lead of its phase; exact speed and phase of the impacts."""
    damping, restitution = 0.05, 0.8
    speed, phase, _ = stop_orbits(damping, restitution, omega, stop)[-1]
    system = oscillator(damping, stops=[Stop("wall", "tip", (stop, math.inf), Rigid(restitution))])
    forces = tuple(PointForce("tip", Sine(1.0, omega / (2 * math.pi), phase + lead)) for lead in leads)
    drive = forces[0] if len(forces) == 1 else Drives(forces=forces)
    # 1 % too fast: the motion has to find the orbit
    start = State([stop], [-1.01 * restitution * speed])
    return integrate(system, drive, EventDriven(), 400 * 2 * math.pi / omega, initial=start), speed, phase


def stop_once_a_cycle() -> Iterator[Case]:
    """An oscillator pushed by a sine against one rigid stop, one impact in each cycle."""
    for omega, stop in ((1.5, 0.0), (2.0, 0.3), (2.5, 0.0)):
        run, speed, _ = _at_a_stop(omega, stop, (0.0,))
        yield Case(
            f"oscillator against a stop at {stop:g}, {omega:g} w0", "derived here (linear half of the orbit)",
            "impact speed after 400 cycles", "m/s", speed, float(run.impacts.approach_speed[-1]), 1e-11,
            "rounding; the start's 1 % have decayed",
        )  # fmt: skip


def several_forces() -> Iterator[Case]:
    """The same under two sines of force at one place, together one: the phase at its impacts is that of their sum."""
    run, _, phase = _at_a_stop(2.5, 0.0, (math.pi / 3, -math.pi / 3))
    yield Case(
        "oscillator against a stop under two forces at one place", "derived here (linear half of the orbit)",
        "phase of the impact after 400 cycles", "rad", phase % (2 * math.pi), float(run.impacts.phase[-1]), 1e-9,
        "rounding; the start's 1 % have decayed",
    )  # fmt: skip


# ---- a ball between two walls on an oscillator ---------------------------------------------------


def _approach_speeds(exact: PeriodicOrbit, off: float, cycles: int) -> NDArray[np.float64]:
    """Approach speeds of a run started beside the orbit, the ball `off` too fast."""
    start = replace(exact.state, ball_velocity=(1 + off) * np.asarray(exact.state.ball_velocity))
    run = integrate(exact.system, exact.excitation, EventDriven(), cycles * exact.period, initial=start)
    return np.asarray(run.impacts.approach_speed)


def _growth(exact: PeriodicOrbit) -> float:
    """Largest eigenvalue of the half-cycle map, from how a small disturbance grows or decays."""
    off = _approach_speeds(exact, 1e-7, 20)[:36] / float(exact.impacts.approach_speed[0]) - 1
    # four states at an impact: the deviations obey a recurrence of order four
    columns = np.column_stack([off[k : off.size - 4 + k] for k in range(4)])
    # each equation in units of its size, for one that grows
    weight = 1 / np.max(np.abs(columns), axis=1)
    factors = np.linalg.lstsq(weight[:, None] * columns, weight * off[4:])[0]
    return float(np.max(np.abs(np.roots([1.0, *-factors[::-1]]))))


def ball_in_a_box() -> Iterator[Case]:
    """Two impacts in each cycle: speed of the ball, and growth of a small disturbance."""
    for mu, e, zeta, ratio, clearance, speed, growth in ORBITS:
        ball = Impactor("ball", "tip", mu, clearance / 2, Rigid(e))
        push = PointForce("tip", Sine(1.0, ratio / (2 * math.pi)))
        # the faster one in closed form
        exact, *_ = two_impact_orbits(oscillator(zeta, impactors=[ball]), push)
        # a stable orbit is found from 1 % off, the unstable one is followed for ten impacts
        speeds = _approach_speeds(exact, 0.01, 200) if growth < 1 else _approach_speeds(exact, 0.0, 5)
        name = f"ball in a box, mu = {mu:g}, e = {e:g}, {ratio:g} w0 ({'stable' if growth < 1 else 'unstable'})"
        source = "derived here (half-cycle map)"
        yield Case(
            f"{name}: speed", source, "speed of the ball", "m/s", speed,
            float(speeds[-1]) * (1 + e) / (2 * (1 + mu)), 5.1e-7 / speed, "6 decimals of the table",
        )  # fmt: skip
        yield Case(
            f"{name}: growth", source, "largest eigenvalue, absolute", "1", growth, _growth(exact), 1e-4,
            "4 decimals of the table; the disturbance of 1e-7 is small, not infinitely so",
        )  # fmt: skip


# ---- a ball in a box whose motion is given ---------------------------------------------------------

GIVEN_BOX = (
    # restitution, amplitude over gap; loss per cycle over m w^2 A^2, effective mass over m: derived by hand
    (0.6, 0.5, 3.380523548, 2.079039683),
    (0.6, 0.25, 8.835629346, 2.532549222),
    (0.8, 0.1, 20.457521895, 5.675926615),
    (0.6, 0.5 / math.pi, 16.0, 0.0),
)


def given_box() -> Iterator[Case]:
    """The curve of a damper beside its numbers, and runs beside it; the last point is that of the largest loss."""
    for e, level, *known in GIVEN_BOX:
        loss, mass = (float(damper_curve(level, e)[name].squeeze()) for name in ("loss", "effective_mass"))
        k, name = (1 - e) / (1 + e), f"ball in a given box, e = {e:g}, A/d = {level:.4g}"
        v = math.sqrt(loss / (4 * k))
        # at the + wall, 1 % too fast
        base = Sine(level, 5.0, math.atan2(math.pi / 2 * v - 1 / level, -k * v))
        start = State(ball_displacement=[1.0], ball_velocity=[-1.01 * level * base.omega * v * (1 - k)])
        run = integrate(shaken_floor(Rigid(e), (1.0, 1.0)), base, EventDriven(), 60.0, initial=start).impacts
        taken = float(run.energy_loss[-2:].sum()) / (level * base.omega) ** 2
        pushes = float(np.sum(run.side[-2:] * run.impulse[-2:] * np.sin(run.phase[-2:])))
        of_runs = taken, 10.0 * pushes / (level * base.omega**2)
        for word, number, *both in zip(("loss", "effective mass"), known, (loss, mass), of_runs, strict=True):
            yield Case(
                f"{name}: {word}", "derived here (half-cycle map)", f"{word} of the curve or a run, the worse", "1",
                number, max(both, key=lambda one: abs(one - number)), 1e-9, "9 decimals of the numbers",
            )  # fmt: skip


# ---- branches --------------------------------------------------------------------------------------

LOCATED = "bifurcations are located to a relative 1e-10"
DIGITS = "both in double precision; the run that verifies an orbit adds its rounding"


@dataclass(frozen=True)
class Compared:
    """A branch, and its orbits in closed form at some values of the parameter: both sheets where there are two."""

    name: str
    source: str
    branch: Callable[[], Branch]
    exact: Callable[[float], list[ClosedForm]]
    values: tuple[float, ...]


def _worst(pairs: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """The pair of a reference and what is computed that are farthest apart, relative to the reference."""
    return max(pairs, key=lambda pair: abs(pair[1] / pair[0] - 1.0))


def _apart(computed: ArrayLike, exact: ArrayLike) -> float:
    """Largest distance of a multiplier from the nearest one of the other set, over the largest modulus or 1."""
    distance = np.abs(np.asarray(computed)[:, None] - np.asarray(exact))
    size = max(1.0, float(np.abs(exact).max()))
    return float(max(distance.min(axis=0).max(), distance.min(axis=1).max())) / size


def beside(compared: Compared) -> Iterator[Case]:
    """Speed, phase and multipliers of each orbit of a branch beside the closed form with the same rank of speeds.

    The phase is that of the force at the impact on the + wall; a symmetric orbit has the multipliers of its half map.
    """
    branch = compared.branch()
    speeds, phases, far = list[tuple[float, float]](), list[tuple[float, float]](), list[float]()
    for value in compared.values:
        orbits = sorted(branch.at(value), key=lambda orbit: float(orbit.impacts.approach_speed[0]))
        for orbit, (speed, phase, matrix) in zip(orbits, compared.exact(value), strict=True):
            speeds += [(speed, rate) for rate in orbit.impacts.approach_speed.tolist()]
            at = float(orbit.events.time[orbit.events.side > 0][0]) * 2.0 * math.pi * orbit.excitation.frequency
            phases.append((phase, phase + math.remainder(at - phase, 2.0 * math.pi)))
            multipliers = orbit.half_multipliers if orbit.is_symmetric else orbit.multipliers
            far.append(_apart(multipliers, np.linalg.eigvals(matrix)))
    name, source = compared.name, compared.source
    yield Case(
        f"{name}: speed", source, f"approach speed, worst of {len(speeds)}", "m/s", *_worst(speeds), 1e-9, DIGITS,
    )  # fmt: skip
    yield Case(
        f"{name}: phase", source, f"phase of the impact, worst of {len(phases)}", "rad", *_worst(phases), 1e-9, DIGITS,
    )  # fmt: skip
    yield Case(
        f"{name}: multipliers", source, f"largest difference of {len(far)} sets over the largest modulus or 1", "1",
        0.0, max(far), 1e-9, DIGITS,
    )  # fmt: skip


def nearest_bifurcation(branch: Branch, kind: str, exact: float) -> float:
    """The value of a branch at its bifurcation of a kind, the nearest to a value; not a number if there is none."""
    values = (point.value for point in branch.bifurcations if point.kind == kind)
    return min(values, key=lambda value: abs(value - exact), default=math.nan)


def bifurcation(name: str, source: str, kind: str, unit: str, branch: Branch, exact: float) -> Case:
    """The value of a branch at a bifurcation."""
    computed = nearest_bifurcation(branch, kind, exact)
    return Case(f"{name}: {kind}", source, "value of the parameter", unit, exact, computed, 1e-10, LOCATED)


# ---- a ball in a box, two impacts in each cycle --------------------------------------------------

MU, RESTITUTION, ZETA, OMEGA, CLEARANCE = 0.1, 0.8, 0.01, 1.0, 60.0
"""Mass ratio, restitution, damping ratio, frequency ratio, and total clearance (m) under a force of 1 N."""
HALF_CYCLE = "derived here (half-cycle map)"
GAP, FREQUENCY, OF_BALL = "impactor.ball.gap", "base.frequency", "impactor.ball.contact.restitution"


@cache
def box_branch(
    parameter: str, low: float, high: float, omega: float = OMEGA, clearance: float = CLEARANCE, points: int = 2000
) -> Branch:
    """The branch of the faster orbit of the box over a parameter."""
    ball = Impactor("ball", "tip", MU, clearance / 2, Rigid(RESTITUTION))
    orbit, *_ = two_impact_orbits(
        oscillator(ZETA, impactors=[ball]), PointForce("tip", Sine(1.0, omega / (2 * math.pi)))
    )
    return continue_orbit(orbit, parameter, (low, high), points=points)


BOX = (
    Compared(
        "two impacts over the gap", HALF_CYCLE, partial(box_branch, GAP, 7.5, 53.0),
        lambda gap: box_orbits(MU, RESTITUTION, ZETA, OMEGA, 2 * gap), (8.0, 15.0, 30.0, 51.3, 51.45),
    ),
    Compared(
        "two impacts over the frequency", HALF_CYCLE, partial(box_branch, FREQUENCY, 0.165, 0.21, 1.1),
        lambda f: box_orbits(MU, RESTITUTION, ZETA, 2 * math.pi * f, CLEARANCE), (0.17, 0.18, 0.19),
    ),
    Compared(
        "two impacts over the restitution", HALF_CYCLE, partial(box_branch, OF_BALL, 0.5, 0.9, 1.15),
        lambda e: box_orbits(MU, e, ZETA, 1.15, CLEARANCE), (0.73, 0.8, 0.88),
    ),
)  # fmt: skip
"""Speeds above 1 m/s: a run leaves the orbit of a slower impact by rounding over its speed."""


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(function, low, high, xtol=1e-15, rtol=1e-14))


def _breaking(of: Callable[[float], list[ClosedForm]], low: float, high: float) -> float:
    """Where a multiplier of the faster orbit's map is -1."""
    return _root(lambda value: float(np.linalg.det(of(value)[-1][-1] + np.eye(of(value)[-1][-1].shape[0]))), low, high)


def bifurcations_of_the_box() -> Iterator[Case]:
    """Bifurcations of a ball in a box, over the gap (m), the frequency (Hz) and the restitution."""
    gap, frequency, restitution = BOX

    def near(f: float) -> list[ClosedForm]:
        return box_orbits(MU, RESTITUTION, ZETA, 2 * math.pi * f, 20.0)

    def narrow(e: float) -> list[ClosedForm]:
        return box_orbits(MU, e, ZETA, OMEGA, 16.0)

    near_resonance = box_branch(FREQUENCY, 0.154, 0.158, 0.98, 20.0, 12)
    of_a_narrow_box = box_branch(OF_BALL, 0.1, 1.0, 1.0, 16.0, 12)
    fold = _root(lambda f: box_fold(MU, RESTITUTION, ZETA, 2 * math.pi * f) - CLEARANCE, 0.185, 0.2)
    for name, kind, unit, branch, exact in (
        (gap.name, "fold", "m", gap.branch(), box_fold(MU, RESTITUTION, ZETA, OMEGA) / 2),
        (gap.name, "symmetry-breaking", "m", gap.branch(), _breaking(gap.exact, 7.6, 9.0)),
        (gap.name, "grazing", "m", gap.branch(), box_coefficients(MU, RESTITUTION, ZETA, OMEGA)[-1]),
        (frequency.name, "fold", "Hz", frequency.branch(), fold),
        ("two impacts near resonance", "symmetry-breaking", "Hz", near_resonance, _breaking(near, 0.1555, 0.1575)),
        (
            restitution.name, "fold", "1", restitution.branch(),
            _root(lambda e: box_fold(MU, e, ZETA, 1.15) - CLEARANCE, 0.5, 0.95),
        ),
        (
            "two impacts in a narrow box over the restitution", "symmetry-breaking", "1", of_a_narrow_box,
            _breaking(narrow, 0.55, 0.85),
        ),
    ):  # fmt: skip
        yield bifurcation(name, HALF_CYCLE, kind, unit, branch, exact)


# ---- an oscillator before one stop, from its grazing on ------------------------------------------

DAMPING, STOP, FORCE = 0.1, 1.0, 0.25
"""Damping ratio, place of the stop (m), and amplitude of the force (N)."""
LINEAR_HALF = "derived here (linear half of the orbit)"


def _with_stop(place: float, fixed_to: str = "base", **others: Any) -> System:
    wall = Stop("wall", "tip", (place, math.inf), Rigid(RESTITUTION), fixed_to=fixed_to)
    return oscillator(DAMPING, stops=[wall], **others)


@cache
def before_the_stop() -> Branch:
    """The branch without impacts, above the resonance, down to the frequency at which it reaches the stop."""
    push = PointForce("tip", Sine(FORCE, 0.19))
    return continue_orbit(find_orbit(_with_stop(STOP), push, guess=State()), FREQUENCY, (0.15, 0.2))


@cache
def impact_branch() -> Branch:
    """The branch with one impact in each cycle that begins where the one without impacts ends."""
    grazing = next(point for point in before_the_stop().bifurcations if point.kind == "grazing")
    (orbit,) = switch_branch(grazing)
    return continue_orbit(orbit, FREQUENCY, (0.15, 0.2))


NAME = "one impact from grazing on"
ONE_IMPACT = Compared(
    NAME, LINEAR_HALF, impact_branch,
    lambda f: stop_orbits(DAMPING, RESTITUTION, 2 * math.pi * f, STOP, FORCE), (0.152, 0.16, 0.172, 0.18),
)  # fmt: skip


def bifurcations_at_the_stop() -> Iterator[Case]:
    """Where the linear response reaches the stop, where both speeds are one, and where a multiplier is -1."""

    def reach(f: float) -> float:
        return FORCE * stop_coefficients(DAMPING, RESTITUTION, 2 * math.pi * f)[-1] - STOP

    def discriminant(f: float) -> float:
        x, tail, amplitude = stop_coefficients(DAMPING, RESTITUTION, 2 * math.pi * f)
        return FORCE * amplitude * math.hypot(x, tail) / abs(tail) - STOP

    grazing, doubling = _root(reach, 0.16, 0.2), _breaking(ONE_IMPACT.exact, 0.151, 0.165)
    for name, kind, branch, exact in (
        ("no impact before a stop", "grazing", before_the_stop(), grazing),
        (NAME, "grazing", impact_branch(), grazing),
        (NAME, "fold", impact_branch(), _root(discriminant, 0.17, 0.2)),
        (NAME, "period-doubling", impact_branch(), doubling),
    ):
        yield bifurcation(name, LINEAR_HALF, kind, "Hz", branch, exact)


# ---- one impact at a stop that does not move with the base ---------------------------------------


def _in_space(omega: float) -> tuple[float, float]:
    """Amplitude and lead of the force on the motion in space of an oscillator whose base moves as a sine."""
    return FORCE * math.hypot(1, 2 * DAMPING * omega), math.atan2(2 * DAMPING * omega, 1)


def space_orbits(frequency: float) -> list[ClosedForm]:
    """The faster orbit, with the phase of the base."""
    omega = 2 * math.pi * frequency
    force, lead = _in_space(omega)
    speed, phase, matrix = stop_orbits(DAMPING, RESTITUTION, omega, STOP, force)[-1]
    return [(speed, phase - lead, matrix)]


@cache
def space_branch() -> Branch:
    """The branch with one impact in each cycle, on both sides of the resonance."""
    frequency = 0.16
    ((speed, phase, _),), omega = space_orbits(frequency), 2 * math.pi * frequency
    moved, rate = FORCE * math.sin(phase), FORCE * omega * math.cos(phase)
    start = State([STOP - moved], [-RESTITUTION * speed - rate], time=phase % (2 * math.pi) / omega)
    orbit = find_orbit(_with_stop(STOP, "space", base_load=[1.0]), Sine(FORCE, frequency), guess=start)
    return continue_orbit(orbit, FREQUENCY, (0.12, 0.2), points=8)


SPACE = Compared(
    "one impact at a stop in space", LINEAR_HALF, space_branch, space_orbits, (0.157, 0.162, 0.17)
)  # fmt: skip


def space_clearance() -> Iterator[Case]:
    """Distance at which the motion turns back before a stop in space."""
    omega = 2.0
    force, _ = _in_space(omega)
    exact = STOP - force / math.hypot(1 - omega**2, 2 * DAMPING * omega)
    orbit = find_orbit(_with_stop(STOP, "space", base_load=[1.0]), Sine(FORCE, omega / (2 * math.pi)), guess=State())
    yield Case(
        "no impact at a stop in space: clearance", "derived here (linear)", "smallest clearance", "m", exact,
        orbit.smallest_clearance, 1e-9, "the crest is found to 1e-9",
    )  # fmt: skip


# ---- one impact at a stop in every second cycle ---------------------------------------------------

SECOND = 4.0
"""Frequency ratio near which an oscillator at a stop at its rest has one impact in two cycles."""


def second_orbits(frequency: float) -> list[ClosedForm]:
    """The orbit of two cycles."""
    return stop_orbits(DAMPING, RESTITUTION, 2 * math.pi * frequency, 0.0, 1.0, 2)[-1:]


@cache
def second_branch() -> Branch:
    """The branch of orbits of two cycles."""
    ((speed, phase, _),) = second_orbits(SECOND / (2 * math.pi))
    push = PointForce("tip", Sine(1.0, SECOND / (2 * math.pi)))
    start = State([0.0], [-RESTITUTION * speed], time=phase % (2 * math.pi) / SECOND)
    return continue_orbit(find_orbit(_with_stop(0.0), push, 2, guess=start), FREQUENCY, (0.5, 0.8), points=8)


SECOND_CYCLES = Compared(
    "one impact in two cycles", LINEAR_HALF, second_branch, second_orbits, (0.63, 0.635, 0.643)
)  # fmt: skip


def second_harmonic() -> Iterator[Case]:
    """Component at the frequency of the force of all points, over both cycles of each orbit."""
    branch = second_branch()
    exact = [
        stop_harmonic(DAMPING, RESTITUTION, 2 * math.pi * f, second_orbits(f)[0], cycles=2)
        for f in branch.values.tolist()
    ]
    yield Case(
        "one impact in two cycles: first harmonic", LINEAR_HALF, f"amplitude at the tip, worst of {len(branch)}", "m",
        *_worst(zip(exact, branch.first_harmonic.tolist(), strict=True)), 1e-4,
        "sums over 256 samples in a cycle, of a harmonic that is a tenth of the peak",
    )  # fmt: skip


# ---- a beam without impacts ----------------------------------------------------------------------

SHAKEN = 1e-3
"""Amplitude of the base, m."""
BEAM = Structure(
    Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
    [PointMass("box", "tip", 0.023)], damping=Rayleigh(0.05, (1, 2)),
)  # fmt: skip
"""Its first two natural frequencies are near 5.3 and 33 Hz."""


def beam_branch() -> Branch:
    """Its orbit through both resonances, on all its modes."""
    system = reduce(assemble(BEAM, elements=2), modes=4)
    orbit = find_orbit(system, Sine(SHAKEN, 5.3), guess=State())
    return continue_orbit(orbit, FREQUENCY, (4.0, 36.0))


def of_a_beam() -> Iterator[Case]:
    """The branch of a linear motion beside the assembled matrices: response, multipliers e^(s T), no bifurcations."""
    branch, system = beam_branch(), assemble(BEAM, elements=2)
    M, C, K = (np.asarray(matrix.toarray()) for matrix in (system.M, system.C, system.K))
    rates = np.linalg.eigvals(
        np.block([[np.zeros_like(M), np.eye(len(M))], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    )
    responses, far, source = list[tuple[float, float]](), list[float](), "derived here (assembled matrices)"
    for frequency, computed, multipliers in zip(
        branch.values.tolist(), branch.first_harmonic.tolist(), branch.multipliers, strict=True
    ):
        omega = 2 * math.pi * frequency
        moved = np.linalg.solve(K - omega**2 * M + 1j * omega * C, SHAKEN * omega**2 * system.base_load)
        responses.append((abs(complex(system.point_row("tip") @ moved)), computed))
        far.append(_apart(multipliers, np.exp(rates / frequency)))
    yield Case(
        "beam over the frequency: response", source, f"amplitude at the tip, worst of {len(responses)}", "m",
        *_worst(responses), 1e-9, "rounding of modes and of matrices with squares of frequencies over six decades",
    )  # fmt: skip
    yield Case(
        "beam over the frequency: multipliers", source, f"largest difference of {len(far)} sets", "1", 0.0, max(far),
        1e-9, "rounding of the roots of the matrices",
    )  # fmt: skip
    yield Case(
        "beam over the frequency: bifurcations", "derived here (linear)", "their number", "1", 0.0,
        float(len(branch.bifurcations)), 1e-3, "a whole number",
    )  # fmt: skip


# ---- a ball in a box on a beam, on three modes ---------------------------------------------------

NEIMARK_SACKER = (5.256771598, 5.266205630)
"""Frequencies, Hz, between which the orbit is unstable, by the half map of a dense mesh; on 80 elements they are
5.256771744 and 5.266205907."""


def neimark_sacker() -> Iterator[Case]:
    """The symmetric orbits around both points, in steps that are longer than their distance."""
    beam = Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = Impactor("ball", "tip", 3.43e-3, 2e-3, Rigid(0.8))
    structure = Structure(beam, [PointMass("box", "tip", 0.02290976)], [ball], Rayleigh(0.0029, (1, 2)))
    orbit, *_ = two_impact_orbits(reduce(assemble(structure, elements=80), modes=3), Sine(0.2037e-3, 5.24))
    branch = continue_orbit(orbit, FREQUENCY, (4.9, 5.6), points=6)
    computed = [point.value for point in branch.bifurcations if point.kind == "neimark-sacker"]
    for number, exact in enumerate(NEIMARK_SACKER):
        yield Case(
            f"two impacts on a beam: Neimark-Sacker point {number + 1} of 2", HALF_CYCLE, "frequency", "Hz", exact,
            (*computed, math.nan, math.nan)[number], 1e-7, "the mesh of 80 elements",
        )  # fmt: skip


# ---- a ball between compliant walls --------------------------------------------------------------

NATURAL = 2 * math.pi * 5.3
COMPLIANT_TIMES = (
    0.045988084424602255, 0.048626507592518464, 0.0492948487180586,
    0.1403277070661117, 0.1429661302340279, 0.14363447135956803,
)  # fmt: skip
"""Touch, release and separation at the + wall and at the - wall, s."""
COMPLIANT_STATE = (-9.763192333806e-05, -8.911013954129368e-06, -0.001681996484473828, -0.050690979440412336)
"""At t = 0: mode, ball (m), and their rates."""
COMPLIANT_MULTIPLIERS = (0.5829617079972196 + 0.4208058565740481j, -0.22456490380332386 + 0.08299735697366087j)
"""One of each conjugate pair."""
MPMATH = "made once by mpmath (tests/orbit_reference.py)"


def compliant_walls() -> Iterator[Case]:
    """The orbit of a ball between Kelvin-Voigt walls on one mode: events, start of the period, multipliers."""
    ball = Impactor("ball", "tip", 3.43e-3, 2e-3, KelvinVoigt(stiffness=3000.0, damping=2.0))
    system = oscillator(0.0029, NATURAL, 6.2, base_load=[0.178], impactors=[ball])
    near = State([-9.8e-5], [-1.68e-3], [-9e-6], [-0.0507])
    orbit = find_orbit(system, Sine(0.2037e-3, 5.3), guess=near)
    yield Case(
        "compliant walls: times of events", MPMATH, "time, worst of 6", "s",
        *_worst(zip(COMPLIANT_TIMES, orbit.events.time.tolist(), strict=True)), 1e-10, DIGITS,
    )  # fmt: skip
    unit = 2e-3 * np.repeat([1.0, NATURAL], 2)
    far = float(np.max(np.abs(state_vector(orbit.state) - COMPLIANT_STATE) / unit))
    yield Case(
        "compliant walls: state", MPMATH, "largest difference over gap and gap x w", "1", 0.0, far, 1e-10, DIGITS
    )
    exact = np.concatenate([COMPLIANT_MULTIPLIERS, np.conj(COMPLIANT_MULTIPLIERS)])
    yield Case(
        "compliant walls: multipliers", MPMATH, "largest difference", "1", 0.0, _apart(orbit.multipliers, exact), 1e-10,
        DIGITS,
    )  # fmt: skip


CASES: tuple[Callable[[], Iterator[Case]], ...] = (
    stop_once_a_cycle, several_forces, ball_in_a_box, given_box,
    *(partial(beside, compared) for compared in (*BOX, ONE_IMPACT, SPACE, SECOND_CYCLES)),
    space_clearance, second_harmonic, bifurcations_of_the_box, bifurcations_at_the_stop, neimark_sacker, of_a_beam,
    compliant_walls,
)  # fmt: skip
"""The cases of this subject, in the order of the table."""
