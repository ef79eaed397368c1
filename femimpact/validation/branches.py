"""Branches of periodic orbits: two closed forms, a beam's frequency response, and the digits of a compliant orbit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.contact.laws import KelvinVoigt, Rigid
from femimpact.excitation.drives import PointForce
from femimpact.excitation.harmonic import Sine
from femimpact.fem.assembly import assemble
from femimpact.orbits.branch import Branch, continue_orbit
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
from femimpact.orbits.search import find_orbit, two_impact_orbits
from femimpact.orbits.switching import switch_branch
from femimpact.structure.beam import Beam
from femimpact.structure.damping import Rayleigh
from femimpact.structure.structure import Impactor, PointMass, Stop, Structure
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case
from femimpact.validation.closed_forms import (
    ClosedForm,
    box_coefficients,
    box_fold,
    box_orbits,
    stop_coefficients,
    stop_harmonic,
    stop_orbits,
)

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


@cache
def _beside(compared: Compared) -> tuple[tuple[PeriodicOrbit, ClosedForm], ...]:
    """Each orbit of the branch with that of the closed form, by their speeds."""
    branch, pairs = compared.branch(), list[tuple[PeriodicOrbit, ClosedForm]]()
    for value in compared.values:
        orbits = sorted(branch.at(value), key=lambda orbit: float(orbit.impacts.approach_speed[0]))
        pairs.extend(zip(orbits, compared.exact(value), strict=True))
    return tuple(pairs)


def _worst(pairs: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """The pair of a reference and what is computed that are farthest apart, relative to the reference."""
    return max(pairs, key=lambda pair: abs(pair[1] / pair[0] - 1.0))


def _apart(computed: ArrayLike, exact: ArrayLike) -> float:
    """Largest distance of a multiplier from the nearest one of the other set, over the largest modulus or 1."""
    distance = np.abs(np.asarray(computed)[:, None] - np.asarray(exact))
    size = max(1.0, float(np.abs(exact).max()))
    return float(max(distance.min(axis=0).max(), distance.min(axis=1).max())) / size


def speed(compared: Compared) -> Case:
    """Approach speed of the impacts, over all values."""
    pairs = [(exact, float(rate)) for orbit, (exact, *_) in _beside(compared) for rate in orbit.impacts.approach_speed]
    return Case(
        f"{compared.name}: speed", compared.source, f"approach speed, worst of {len(pairs)}", "m/s", *_worst(pairs),
        1e-9, DIGITS,
    )  # fmt: skip


def phase(compared: Compared) -> Case:
    """Phase of the force at the impact on the + wall."""
    pairs = []
    for orbit, (_, exact, _) in _beside(compared):
        at = float(orbit.events.time[orbit.events.side > 0][0]) * 2.0 * math.pi * orbit.excitation.frequency
        pairs.append((exact, exact + math.remainder(at - exact, 2.0 * math.pi)))
    return Case(
        f"{compared.name}: phase", compared.source, f"phase of the impact, worst of {len(pairs)}", "rad",
        *_worst(pairs), 1e-9, DIGITS,
    )  # fmt: skip


def multipliers(compared: Compared) -> Case:
    """Multipliers, of a symmetric orbit those of its half map."""
    far = [
        _apart(orbit.half_multipliers if orbit.is_symmetric else orbit.multipliers, np.linalg.eigvals(matrix))
        for orbit, (*_, matrix) in _beside(compared)
    ]
    return Case(
        f"{compared.name}: multipliers", compared.source,
        f"largest difference of {len(far)} sets over the largest modulus or 1", "1", 0.0, max(far), 1e-9, DIGITS,
    )  # fmt: skip


def bifurcation(
    name: str, source: str, kind: str, unit: str, branch: Callable[[], Branch], exact: Callable[[], float]
) -> Case:
    """The value of a branch at a bifurcation: the nearest one of its kind."""
    value = exact()
    computed = [point.value for point in branch().bifurcations if point.kind == kind]
    nearest = min(computed, key=lambda point: abs(point - value), default=math.nan)
    return Case(f"{name}: {kind}", source, "value of the parameter", unit, value, nearest, 1e-10, LOCATED)


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
    system = System.from_matrices([[1.0]], [[2 * ZETA]], [[1.0]], points={"tip": [1.0]}, impactors=[ball])
    orbit, *_ = two_impact_orbits(system, PointForce("tip", Sine(1.0, omega / (2 * math.pi))))
    return continue_orbit(orbit, parameter, (low, high), points=points)


OVER_GAP = partial(box_branch, GAP, 7.5, 53.0)
OVER_FREQUENCY = partial(box_branch, FREQUENCY, 0.165, 0.21, 1.1)
NEAR_RESONANCE = partial(box_branch, FREQUENCY, 0.154, 0.158, 0.98, 20.0, 12)
OVER_RESTITUTION = partial(box_branch, OF_BALL, 0.5, 0.9, 1.15)
OF_A_NARROW_BOX = partial(box_branch, OF_BALL, 0.1, 1.0, 1.0, 16.0, 12)

BOX = (
    Compared(
        "two impacts over the gap", HALF_CYCLE, OVER_GAP,
        lambda gap: box_orbits(MU, RESTITUTION, ZETA, OMEGA, 2 * gap), (8.0, 15.0, 30.0, 51.3, 51.45),
    ),
    Compared(
        "two impacts over the frequency", HALF_CYCLE, OVER_FREQUENCY,
        lambda f: box_orbits(MU, RESTITUTION, ZETA, 2 * math.pi * f, CLEARANCE), (0.17, 0.18, 0.19),
    ),
    Compared(
        "two impacts over the restitution", HALF_CYCLE, OVER_RESTITUTION,
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


BOX_BIFURCATIONS: tuple[Callable[[], Case], ...] = (
    partial(
        bifurcation, "two impacts over the gap", HALF_CYCLE, "fold", "m", OVER_GAP,
        lambda: box_fold(MU, RESTITUTION, ZETA, OMEGA) / 2,
    ),
    partial(
        bifurcation, "two impacts over the gap", HALF_CYCLE, "symmetry-breaking", "m", OVER_GAP,
        partial(_breaking, BOX[0].exact, 7.6, 9.0),
    ),
    partial(
        bifurcation, "two impacts over the gap", HALF_CYCLE, "grazing", "m", OVER_GAP,
        lambda: box_coefficients(MU, RESTITUTION, ZETA, OMEGA)[-1],
    ),
    partial(
        bifurcation, "two impacts over the frequency", HALF_CYCLE, "fold", "Hz", OVER_FREQUENCY,
        lambda: _root(lambda f: box_fold(MU, RESTITUTION, ZETA, 2 * math.pi * f) - CLEARANCE, 0.185, 0.2),
    ),
    partial(
        bifurcation, "two impacts near resonance", HALF_CYCLE, "symmetry-breaking", "Hz", NEAR_RESONANCE,
        partial(_breaking, lambda f: box_orbits(MU, RESTITUTION, ZETA, 2 * math.pi * f, 20.0), 0.1555, 0.1575),
    ),
    partial(
        bifurcation, "two impacts over the restitution", HALF_CYCLE, "fold", "1", OVER_RESTITUTION,
        lambda: _root(lambda e: box_fold(MU, e, ZETA, 1.15) - CLEARANCE, 0.5, 0.95),
    ),
    partial(
        bifurcation, "two impacts in a narrow box over the restitution", HALF_CYCLE, "symmetry-breaking", "1",
        OF_A_NARROW_BOX, partial(_breaking, lambda e: box_orbits(MU, e, ZETA, OMEGA, 16.0), 0.55, 0.85),
    ),
)  # fmt: skip


# ---- an oscillator before one stop, from its grazing on ------------------------------------------

DAMPING, STOP, FORCE = 0.1, 1.0, 0.25
"""Damping ratio, place of the stop (m), and amplitude of the force (N)."""
LINEAR_HALF = "derived here (linear half of the orbit)"


@cache
def before_the_stop() -> Branch:
    """The branch without impacts, above the resonance, down to the frequency at which it reaches the stop."""
    wall = Stop("wall", "tip", (STOP, math.inf), Rigid(RESTITUTION))
    system = System.from_matrices([[1.0]], [[2 * DAMPING]], [[1.0]], points={"tip": [1.0]}, stops=[wall])
    push = PointForce("tip", Sine(FORCE, 0.19))
    return continue_orbit(find_orbit(system, push, guess=State()), FREQUENCY, (0.15, 0.2))


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


def _grazing() -> float:
    """Where the linear response reaches the stop."""
    return _root(lambda f: FORCE * stop_coefficients(DAMPING, RESTITUTION, 2 * math.pi * f)[-1] - STOP, 0.16, 0.2)


def _stop_fold() -> float:
    """Where both speeds are one."""

    def discriminant(f: float) -> float:
        x, tail, amplitude = stop_coefficients(DAMPING, RESTITUTION, 2 * math.pi * f)
        return FORCE * amplitude * math.hypot(x, tail) / abs(tail) - STOP

    return _root(discriminant, 0.17, 0.2)


STOP_BIFURCATIONS: tuple[Callable[[], Case], ...] = tuple(
    partial(bifurcation, name, LINEAR_HALF, kind, "Hz", branch, exact)
    for name, kind, branch, exact in (
        ("no impact before a stop", "grazing", before_the_stop, _grazing),
        (NAME, "grazing", impact_branch, _grazing),
        (NAME, "fold", impact_branch, _stop_fold),
        (NAME, "period-doubling", impact_branch, partial(_breaking, ONE_IMPACT.exact, 0.151, 0.165)),
    )
)


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


def _stop_in_space() -> System:
    wall = Stop("wall", "tip", (STOP, math.inf), Rigid(RESTITUTION), fixed_to="space")
    return System.from_matrices(
        [[1.0]], [[2 * DAMPING]], [[1.0]], points={"tip": [1.0]}, base_load=[1.0], stops=[wall]
    )  # fmt: skip


@cache
def space_branch() -> Branch:
    """The branch with one impact in each cycle, on both sides of the resonance."""
    frequency = 0.16
    ((speed, phase, _),), omega = space_orbits(frequency), 2 * math.pi * frequency
    moved, rate = FORCE * math.sin(phase), FORCE * omega * math.cos(phase)
    start = State([STOP - moved], [-RESTITUTION * speed - rate], time=phase % (2 * math.pi) / omega)
    orbit = find_orbit(_stop_in_space(), Sine(FORCE, frequency), guess=start)
    return continue_orbit(orbit, FREQUENCY, (0.12, 0.2), points=8)


SPACE = Compared(
    "one impact at a stop in space", LINEAR_HALF, space_branch, space_orbits, (0.157, 0.162, 0.17)
)  # fmt: skip


def space_clearance() -> Case:
    """Distance at which the motion turns back before a stop in space."""
    omega = 2.0
    force, _ = _in_space(omega)
    exact = STOP - force / math.hypot(1 - omega**2, 2 * DAMPING * omega)
    orbit = find_orbit(_stop_in_space(), Sine(FORCE, omega / (2 * math.pi)), guess=State())
    return Case(
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
    wall = Stop("wall", "tip", (0.0, math.inf), Rigid(RESTITUTION))
    system = System.from_matrices([[1.0]], [[2 * DAMPING]], [[1.0]], points={"tip": [1.0]}, stops=[wall])
    push = PointForce("tip", Sine(1.0, SECOND / (2 * math.pi)))
    start = State([0.0], [-RESTITUTION * speed], time=phase % (2 * math.pi) / SECOND)
    return continue_orbit(find_orbit(system, push, 2, guess=start), FREQUENCY, (0.5, 0.8), points=8)


SECOND_CYCLES = Compared(
    "one impact in two cycles", LINEAR_HALF, second_branch, second_orbits, (0.63, 0.635, 0.643)
)  # fmt: skip


def second_harmonic() -> Case:
    """Component at the frequency of the force of all points, over both cycles of each orbit."""
    branch = second_branch()
    exact = [
        stop_harmonic(DAMPING, RESTITUTION, 2 * math.pi * f, second_orbits(f)[0], cycles=2)
        for f in branch.values.tolist()
    ]
    return Case(
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
DENSE = "derived here (assembled matrices)"


@cache
def beam_branch() -> Branch:
    """Its orbit through both resonances, on all its modes."""
    system = reduce(assemble(BEAM, elements=2), modes=4)
    orbit = find_orbit(system, Sine(SHAKEN, 5.3), guess=State())
    return continue_orbit(orbit, FREQUENCY, (4.0, 36.0))


def _dense() -> tuple[System, list[NDArray[np.float64]]]:
    """The assembled system with its matrices M, C and K."""
    system = assemble(BEAM, elements=2)
    return system, [np.asarray(matrix.toarray()) for matrix in (system.M, system.C, system.K)]


def beam_response() -> Case:
    """Amplitude at the tip of all points of the branch."""
    branch, (system, (M, C, K)) = beam_branch(), _dense()
    pairs = []
    for frequency, computed in zip(branch.values.tolist(), branch.first_harmonic.tolist(), strict=True):
        omega = 2 * math.pi * frequency
        moved = np.linalg.solve(K - omega**2 * M + 1j * omega * C, SHAKEN * omega**2 * system.base_load)
        pairs.append((abs(complex(system.point_row("tip") @ moved)), computed))
    return Case(
        "beam over the frequency: response", DENSE, f"amplitude at the tip, worst of {len(pairs)}", "m",
        *_worst(pairs), 1e-9, "rounding of modes and of matrices with squares of frequencies over six decades",
    )  # fmt: skip


def beam_multipliers() -> Case:
    """Multipliers of all points: e^(s T) of the roots s of the matrices."""
    branch, (_, (M, C, K)) = beam_branch(), _dense()
    rates = np.linalg.eigvals(
        np.block([[np.zeros_like(M), np.eye(len(M))], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    )
    far = [
        _apart(computed, np.exp(rates / frequency))
        for frequency, computed in zip(branch.values.tolist(), branch.multipliers, strict=True)
    ]
    return Case(
        "beam over the frequency: multipliers", DENSE, f"largest difference of {len(far)} sets", "1", 0.0, max(far),
        1e-9, "rounding of the roots of the matrices",
    )  # fmt: skip


def beam_bifurcations() -> Case:
    """A linear motion has none."""
    return Case(
        "beam over the frequency: bifurcations", "derived here (linear)", "their number", "1", 0.0,
        float(len(beam_branch().bifurcations)), 1e-3, "a whole number",
    )  # fmt: skip


# ---- a ball in a box on a beam, on three modes ---------------------------------------------------

NEIMARK_SACKER = (5.256771598, 5.266205630)
"""Frequencies, Hz, between which the orbit is unstable, by the half map of a dense mesh; on 80 elements they are
5.256771744 and 5.266205907."""


@cache
def box_on_a_beam() -> Branch:
    """The symmetric orbits around both points, in steps that are longer than their distance."""
    beam = Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = Impactor("ball", "tip", 3.43e-3, 2e-3, Rigid(0.8))
    structure = Structure(beam, [PointMass("box", "tip", 0.02290976)], [ball], Rayleigh(0.0029, (1, 2)))
    orbit, *_ = two_impact_orbits(reduce(assemble(structure, elements=80), modes=3), Sine(0.2037e-3, 5.24))
    return continue_orbit(orbit, FREQUENCY, (4.9, 5.6), points=6)


def neimark_sacker(number: int) -> Case:
    """The first or the second of two points within one step."""
    computed = [point.value for point in box_on_a_beam().bifurcations if point.kind == "neimark-sacker"]
    return Case(
        f"two impacts on a beam: Neimark-Sacker point {number + 1} of 2", "derived here (half-cycle map)",
        "frequency", "Hz", NEIMARK_SACKER[number], (*computed, math.nan, math.nan)[number], 1e-7,
        "the mesh of 80 elements",
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


@cache
def compliant_orbit() -> PeriodicOrbit:
    """The orbit of a ball between Kelvin-Voigt walls on one mode."""
    ball = Impactor("ball", "tip", 3.43e-3, 2e-3, KelvinVoigt(stiffness=3000.0, damping=2.0))
    system = System.from_matrices(
        [[1.0]], [[2 * 0.0029 * NATURAL]], [[NATURAL**2]], points={"tip": [6.2]}, base_load=[0.178], impactors=[ball]
    )
    near = State([-9.8e-5], [-1.68e-3], [-9e-6], [-0.0507])
    return find_orbit(system, Sine(0.2037e-3, 5.3), guess=near)


def compliant_times() -> Case:
    """Times of the six events."""
    return Case(
        "compliant walls: times of events", MPMATH, "time, worst of 6", "s",
        *_worst(zip(COMPLIANT_TIMES, compliant_orbit().events.time.tolist(), strict=True)), 1e-10, DIGITS,
    )  # fmt: skip


def compliant_state() -> Case:
    """State at the start of the period."""
    orbit = compliant_orbit()
    unit = 2e-3 * np.repeat([1.0, NATURAL], 2)
    far = float(np.max(np.abs(state_vector(orbit.state) - COMPLIANT_STATE) / unit))
    return Case(
        "compliant walls: state", MPMATH, "largest difference over gap and gap x w", "1", 0.0, far, 1e-10, DIGITS
    )


def compliant_multipliers() -> Case:
    """Multipliers: two conjugate pairs."""
    exact = np.concatenate([COMPLIANT_MULTIPLIERS, np.conj(COMPLIANT_MULTIPLIERS)])
    return Case(
        "compliant walls: multipliers", MPMATH, "largest difference", "1", 0.0,
        _apart(compliant_orbit().multipliers, exact), 1e-10, DIGITS,
    )  # fmt: skip


COMPARED = (*BOX, ONE_IMPACT, SPACE, SECOND_CYCLES)

CASES: tuple[Callable[[], Case], ...] = (
    *(partial(check, compared) for compared in COMPARED for check in (speed, phase, multipliers)),
    space_clearance, second_harmonic, *BOX_BIFURCATIONS, *STOP_BIFURCATIONS, partial(neimark_sacker, 0),
    partial(neimark_sacker, 1), beam_response, beam_multipliers, beam_bifurcations,
    compliant_times, compliant_state, compliant_multipliers,
)  # fmt: skip
"""The cases of this subject, in the order of the table."""
