"""Single contacts and what they leave in the ledger: times, forces, impulses, energies; balances that must close."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.law import ContactLaw, collide, contact_potential
from femimpact.contact.laws import Hertz, KelvinVoigt, PowerLaw, Rigid, SwitchingSpring
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import MoreauJean, Newmark
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Impactor
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case, oscillator
from femimpact.validation.contacts import FREQUENCY, GRAVITY, shaken_floor

MASS, SPEED = 0.05, 0.3
"""Mass (kg) and speed (m/s) of the ball."""
COMPLIANT = KelvinVoigt(stiffness=2000.0, damping=3.0)
STILL = Sine(0.0, 50.0)
UNITS = {"restitution": "1", "contact time": "s", "peak force": "N", "energy loss": "J"}
"""Numbers of a collision."""

# ---- one collision with a wall that does not move ------------------------------------------------


def _collision_run(
    law: ContactLaw, method: Method, gap: float | tuple[float, float] = 1e-3, speed: float = SPEED
) -> Response:
    """A ball sent from the centre against a wall: the structure's row is zero."""
    ball = Impactor("ball", "tip", MASS, gap, law)
    system = oscillator(shape=0.0, impactors=[ball])
    far = max(gap) if isinstance(gap, tuple) else gap
    return integrate(system, STILL, method, 2 * far / abs(speed) + 0.02, initial=State(ball_velocity=[speed]))


def linear_collision() -> Iterator[Case]:
    """A linear contact by its closed form and event-driven, beside scipy up to the first zero of the force."""
    from scipy.integrate import solve_ivp

    k, c = 2000.0, 3.0

    def force(_: float, state: NDArray[np.float64] | Sequence[float]) -> float:
        return float(k * state[0] + c * state[1])

    def rates(time: float, state: NDArray[np.float64]) -> list[float]:
        return [state[1], -force(time, state) / MASS]

    force.terminal = True  # type: ignore[attr-defined]
    force.direction = -1.0  # type: ignore[attr-defined]
    run: Any = solve_ivp(
        rates, (0.0, 0.1), [0.0, SPEED], "DOP853", events=force, rtol=1e-13, atol=1e-16, dense_output=True
    )
    time, end = float(run.t_events[0][0]), -float(run.y_events[0][0][1])
    depth, rate = run.sol(np.linspace(0.0, time, 20_001))
    exact = end / SPEED, time, float(np.max(k * depth + c * rate)), 0.5 * MASS * (SPEED**2 - end**2)
    closed = collide(COMPLIANT, MASS, SPEED)
    row = _collision_run(COMPLIANT, EventDriven()).impacts
    for way, computed, reason in (
        (
            "closed form", (closed.restitution, closed.contact_time, closed.peak_force, closed.energy_loss),
            "the largest of 20,001 samples, and of a parabola through 2001",
        ),
        (
            "event-driven", (row.restitution[0], row.duration[0], row.peak_force[0], row.energy_loss[0]),
            "the largest of 20,001 samples; integration to 1e-13 a step",
        ),
    ):  # fmt: skip
        for (quantity, unit), reference, number in zip(UNITS.items(), exact, computed, strict=True):
            yield Case(
                f"Kelvin-Voigt, {way}: {quantity}", "integrated here (scipy, DOP853)", quantity, unit, reference,
                float(number), 5e-9, reason,
            )  # fmt: skip


def rigid_steps() -> Iterator[Case]:
    """Moreau and Jean's rule returns e v; and two free bodies, 0.3 kg at 2 m/s into 0.7 kg at rest, e = 0.6."""
    impacts = _collision_run(Rigid(0.6), MoreauJean(1e-4)).impacts
    yield Case(
        "rigid contact, Moreau-Jean", "derived here (Newton's restitution)", "restitution", "1", 0.6,
        float(impacts.restitution[0]), 1e-12, "rounding",
    )  # fmt: skip
    ball = Impactor("ball", "tip", 0.3, 1e-2, Rigid(0.6))
    system = System.from_matrices([[0.7]], [[0.0]], [[0.0]], points={"tip": [1.0]}, impactors=[ball])
    names = ("ball.velocity", "tip.velocity")
    run = integrate(system, STILL, MoreauJean(1e-4), 0.01, Recorder(names), State(ball_velocity=[2.0]))
    common = 2.0 * 0.3
    for body, reference in (("ball", common - 0.6 * (2.0 - common)), ("tip", common + 0.6 * common)):
        yield Case(
            f"collision of 0.3 and 0.7 kg, Moreau-Jean, {body}", "derived here (momentum and restitution)",
            "velocity after", "m/s", reference, float(run[f"{body}.velocity"][-1]), 1e-12, "rounding",
        )  # fmt: skip


def unequal_gaps() -> Iterator[Case]:
    """The instant of the first touch with a gap of 2 mm on the + side and of 5 mm on the - side."""
    for side, speed, gap in (("+", SPEED, 2e-3), ("-", -SPEED, 5e-3)):
        impacts = _collision_run(Rigid(0.6), EventDriven(), (2e-3, 5e-3), speed).impacts
        yield Case(
            f"gaps of 2 mm and 5 mm: first touch on the {side} side", "derived here (gap over speed)", "time", "s",
            gap / SPEED, float(impacts.time[0]), 1e-12, "rounding",
        )  # fmt: skip


def power_peak() -> Iterator[Case]:
    """Peak force of k p^n: k p^(n + 1)/(n + 1) = m v^2/2 at the deepest point."""
    stiffness, steps = 1e5, 2000
    for exponent in (1.2, 1.5):
        law = PowerLaw(stiffness, exponent=exponent)
        method = Newmark(collide(law, MASS, SPEED).contact_time / steps)
        depth = (0.5 * (exponent + 1) * MASS * SPEED**2 / stiffness) ** (1 / (exponent + 1))
        yield Case(
            f"contact force k p^{exponent:g}, Newmark T_c/{steps}", "derived here (energy)", "peak force", "N",
            stiffness * depth**exponent, float(_collision_run(law, method).impacts.peak_force[0]), 2e-5,
            f"second order: (2 pi/{steps})^2, for the period and for the largest of the steps",
        )  # fmt: skip


def stored_energy() -> Iterator[Case]:
    """Work of a Hertz contact's force; and of a switching spring, k_free x up to the wall and k x beyond it."""
    from scipy.integrate import quad

    stiffness, depth = 1e5, 1e-3
    work = quad(lambda p: stiffness * p**1.5, 0.0, depth, epsabs=0.0, epsrel=1e-13)[0]
    yield Case(
        "Hertz contact: stored energy", "derived here (quadrature)", "energy at 1 mm", "J", work,
        contact_potential(Hertz(stiffness), depth, MASS), 1e-12, "rounding",
    )  # fmt: skip
    gap, free, stiffness = 1e-3, 100.0, 2000.0
    run = _collision_run(SwitchingSpring(free, stiffness), Newmark(1e-5))
    energy = np.asarray(run.energy.contact) if run.energy is not None else np.zeros(1)
    # from the largest displacement, not from the ball's kinetic energy: this law makes energy
    x = float(np.max(np.abs(run["ball"])))
    work = 0.5 * free * gap**2 + 0.5 * stiffness * (x**2 - gap**2)
    yield Case(
        "switching spring: stored energy", "derived here (work of k x on either side of the wall)",
        "largest stored energy", "J", work, float(np.max(energy)), 1e-12, "rounding",
    )  # fmt: skip


# ---- balances ------------------------------------------------------------------------------------


def _box(laws: Sequence[ContactLaw], free_stiffness: float = 0.0) -> System:
    """Two modes, a ball of each law in a box on them."""
    return _two_modes(
        [Impactor(f"ball {i}", "tip", 0.1, 2e-3, law, free_stiffness, -0.5) for i, law in enumerate(laws, 1)]
    )  # fmt: skip


def _two_modes(balls: Sequence[Impactor], base_load: Sequence[float] | None = None) -> System:
    omega = 2 * math.pi * np.array([5.0, 31.0])
    return System.from_matrices(
        np.eye(2), np.diag(0.02 * omega), np.diag(omega**2), points={"tip": [1.0, -0.8]}, base_load=base_load,
        impactors=balls,
    )  # fmt: skip


BOX = KelvinVoigt(stiffness=4e3, damping=2.0)
UNEQUAL = (BOX, KelvinVoigt(stiffness=1e3, damping=1.0))
CONSISTENT = Newmark(2e-4, contact="energy-consistent")
BALANCED: dict[str, tuple[Sequence[ContactLaw], float, Method, float]] = {
    "rigid contact, event-driven": ((Rigid(0.6),), 0.0, EventDriven(), 1e-11),
    "Kelvin-Voigt, event-driven": ((BOX,), 0.0, EventDriven(), 1e-10),
    "Kelvin-Voigt, energy-consistent": ((BOX,), 0.0, CONSISTENT, 1e-10),
    "Hertz, energy-consistent": ((Hertz(2e5),), 0.0, replace(CONSISTENT, allow_coarse_step=True), 1e-10),
    "two balls on centring springs, unequal Kelvin-Voigt, event-driven": (UNEQUAL, 5.0, EventDriven(), 1e-10),
    "two balls on centring springs, unequal Kelvin-Voigt, energy-consistent": (UNEQUAL, 5.0, CONSISTENT, 1e-10),
}


def balance() -> Iterator[Case]:
    """Work put in, energy stored and energy lost, each summed separately, over 20 cycles of impacts."""
    for name, (laws, spring, method, bound) in BALANCED.items():
        run = integrate(_box(laws, spring), Sine(1e-3, 5.0), method, 4.0, Recorder(("tip",)))
        closed = run.energy.residual if run.energy is not None and len(run.impacts) > 20 else math.nan
        yield Case(
            f"{name}: energy of 20 cycles", "derived here (balance)", "largest residual over the work", "1", 0.0,
            closed, bound, "rounding of some hundred contacts",
        )  # fmt: skip


def energy_of_modes() -> Iterator[Case]:
    """A rigid impact on two modes at rest: each takes (phi J)^2/2, J = (1 + e) v/(1/m + sum of phi^2)."""
    ball, e, row = 0.1, 0.6, (1.0, -0.8)
    run = integrate(_box([Rigid(e)]), STILL, EventDriven(), 0.02, initial=State(ball_velocity=[-SPEED]))
    # -0.5 m/s^2 over the 2 mm of gap
    impulse = (1 + e) * math.sqrt(SPEED**2 + 2 * 0.5 * 2e-3) / (1 / ball + row[0] ** 2 + row[1] ** 2)
    for mode, phi in enumerate(row):
        yield Case(
            f"rigid impact on two modes at rest, mode {mode + 1}", "derived here (momentum and restitution)",
            "energy to it", "J", 0.5 * (phi * impulse) ** 2, float(run.impacts.energy_to_modes[0, mode]), 1e-11,
            "rounding",
        )  # fmt: skip


def centring_spring() -> Iterator[Case]:
    """A ball on its spring between walls out of reach: x0 cos(sqrt(k/m) t)."""
    stiffness, start, time = 40.0, 1e-3, 1.0
    ways: tuple[tuple[str, Method, ContactLaw, float, str], ...] = (
        ("event-driven", EventDriven(), Rigid(0.6), 1e-12, "rounding"),
        (
            "Newmark", Newmark(1e-4), KelvinVoigt(restitution=0.6, contact_time=0.1), 1e-5,
            "(omega dt)^2/12 = 7e-7 a radian over 28 of them, over 2",
        ),
    )  # fmt: skip
    for way, method, law, bound, reason in ways:
        ball = Impactor("ball", "tip", MASS, 1.0, law, stiffness)
        system = oscillator(0.05, shape=0.0, impactors=[ball])
        run = integrate(system, STILL, method, time, Recorder(("ball",)), State(ball_displacement=[start]))
        yield Case(
            f"ball on a centring spring, {way}", "derived here (cosine)", "displacement after 1 s", "m",
            start * math.cos(math.sqrt(stiffness / MASS) * time), float(run["ball"][-1]), bound, reason,
        )  # fmt: skip


def sticking_impulse() -> Iterator[Case]:
    """A ball that lies on a table A sin(w t): its contact's impulse is m g T and its change of momentum."""
    table = Sine(0.4 * GRAVITY / (2 * math.pi * FREQUENCY) ** 2, FREQUENCY)
    run = integrate(shaken_floor(Rigid(0.4), (1.0, 0.0), -GRAVITY), table, EventDriven(), 1.0125)
    begin = float(run.sticking.start[0])
    end = float(run.time[-1])
    change = float(table.velocity(end) - table.velocity(begin))
    yield Case(
        "ball that lies on a vibrating table", "derived here (momentum)", "impulse of the contact", "N s",
        GRAVITY * (end - begin) + change, float(run.sticking.impulse[0]), 1e-11, "rounding",
    )  # fmt: skip


def table_sums() -> Iterator[Case]:
    """Two balls without rebound, one of which arrives while the other sticks: what their table adds up to."""
    balls = [Impactor(f"ball {i}", "tip", mass, 2e-3, Rigid(0.0)) for i, mass in ((1, 0.1), (2, 0.07))]
    base = Sine(1e-3, 5.0)
    run = integrate(_two_modes(balls, [1.0, 0.3]), base, EventDriven(), 4.0, Recorder(("ball 1.velocity",)))
    yield Case(
        "two balls without rebound, table of impacts", "derived here (balance)", "contact loss", "J",
        float(run.energy.contact_loss[-1]) if run.energy is not None else math.nan,
        float(run.impacts.energy_loss.sum()), 1e-11, "rounding of some hundred impacts",
    )  # fmt: skip
    end = float(run.time[-1])
    moved = float(run["ball 1.velocity"][-1]) + float(base.velocity(end)) - float(base.velocity(0.0))
    tables = (run.impacts, run.sticking)
    pushed = [float(np.sum((table.side * table.impulse)[table.impactor == "ball 1"])) for table in tables]
    yield Case(
        "two balls without rebound, tables of impacts and sticking phases", "derived here (momentum)",
        "change of momentum of one", "N s", balls[0].mass * moved, -sum(pushed), 1e-10,
        "rounding of some hundred impulses, ten times the change",
    )  # fmt: skip


CASES = (
    linear_collision,
    rigid_steps,
    unequal_gaps,
    power_peak,
    stored_energy,
    balance,
    energy_of_modes,
    centring_spring,
    sticking_impulse,
    table_sums,
)
"""The cases of this subject, in the order of the table."""
