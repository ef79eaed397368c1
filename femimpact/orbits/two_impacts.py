"""Symmetric orbits with two impacts in a period, in closed form: one on each of two equal walls."""

from __future__ import annotations

import math

import numpy as np

from femimpact.errors import instance, require, takes
from femimpact.excitation import Excitation
from femimpact.integrators.event_driven.loop_data import check_events
from femimpact.orbits.equations import IMPACT, EventStates, Sequence, event_maps
from femimpact.orbits.flow import HybridSystem, hybrid_system
from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.orbits.search import GRAZING, one_sine, orbit_near
from femimpact.orbits.verification import OtherMotionError
from femimpact.system.system import System


@takes(system=instance(System))
def two_impact_orbits(system: System, excitation: Excitation) -> tuple[PeriodicOrbit, ...]:
    """The symmetric orbits with one impact on each wall in a period of the excitation: at most two, in closed form.

    With the propagator P over half a period and the impulse q (1 + e) of a unit approach speed, the motion just after
    the impact on the + wall is z_p(theta) + v a, (I + P) a = q (1 + e): linear in the approach speed v. That the gap
    is closed there, at that speed, makes

        (g + v alpha)^2 + v^2 (1 + beta)^2/omega^2 = |X|^2,

    a quadratic in v, with alpha and beta what the gap and its rate read of P a, and X the amplitude of the gap in the
    steady response.

    Parameters
    ----------
    system : System
        On its modes, with one rigid ball or stop between equal walls, and no constant force.
    excitation : Sine or PointForce

    Returns
    -------
    tuple of PeriodicOrbit
        Stable and unstable, the higher approach speed first. A solution that is no motion of the system, because it
        meets a wall once more or leaves the gap, is not among them, nor is one whose impacts have no speed.

    Raises
    ------
    InputError
        If the system or the excitation is another one, or a natural frequency without damping.
    DivergenceError
        If rounding keeps a solution from being confirmed, as beside a natural frequency with next to no damping.
    """
    check_events(system)
    sine = one_sine(excitation)
    walls = [j for j, pair in enumerate(system.contacts) if pair.has_walls]
    require(len(walls) == 1, "system", f"{len(walls)} pairs with walls", "", "must have one ball or stop with walls")
    pair = system.contacts[walls[0]]
    require(pair.parameters.is_rigid, f"{pair.name}.contact", pair.law.name, "", "must be Rigid")
    equal = pair.gaps[0] == pair.gaps[1]
    require(equal, f"{pair.name}.gap", pair.gaps, "m", "must be the same on both sides")
    hybrid, orbits = hybrid_system(system, sine), list[PeriodicOrbit]()
    constant = bool(np.any(hybrid.constant))
    require(not constant, "system", "constant forces", "", "must have none: with gravity no orbit is symmetric")
    for guess in _solutions(hybrid, walls[0]):
        try:
            orbits.append(orbit_near(system, sine, guess))
        except OtherMotionError:
            continue
    return tuple(orbits)


def _solutions(hybrid: HybridSystem, pair: int) -> list[EventStates]:
    """Roots of the quadratic with a positive speed, the larger one first."""
    flow, d, pairs = hybrid.flow(np.zeros(hybrid.gaps.shape[0])), hybrid.mass.size, hybrid.gaps.shape[0]
    sequence = Sequence(
        (IMPACT, IMPACT), np.full(2, pair), np.array([1.0, -1.0]), np.zeros((2, pairs)), np.zeros(2), 1
    )  # fmt: skip
    rows = event_maps(hybrid, EventStates(sequence, np.zeros((2, 2 * d)), np.array([0.0, math.pi])))
    half = flow.over(np.array([math.pi / hybrid.omega]))[0][0]
    after = np.linalg.solve(np.eye(2 * d) + half, rows.impulse[0])
    alpha, beta = (float(row[0] @ (half @ after)) for row in (rows.row, rows.speed_row))
    in_space = -hybrid.in_space[pair] * hybrid.amplitude
    # the gap in the steady response: along sin(theta) and along cos(theta)
    along = np.array([float(rows.row[0] @ steady) for steady in (flow.steady_sine, flow.steady_cosine)])
    along[0] += in_space
    gap, tail = float(hybrid.gaps[pair, 0]), (1.0 + beta) / float(hybrid.omega)
    roots = np.roots([alpha**2 + tail**2, 2.0 * alpha * gap, gap**2 - float(along @ along)])
    guesses, least = [], GRAZING * gap * float(hybrid.omega)
    for speed in sorted((float(root.real) for root in roots if root.imag == 0.0 and root.real > least), reverse=True):
        # X = R sin(theta + lead)
        lead = math.atan2(along[1], along[0])
        phase = math.atan2(gap + speed * alpha, speed * tail) - lead
        state = speed * after + flow.steady(np.array([phase]))[0]
        phases = phase % (2.0 * math.pi) + np.array([0.0, math.pi])
        guesses.append(EventStates(sequence, np.array([state, -state]), phases))
    return guesses
