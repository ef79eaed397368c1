"""Digits of the orbits of `orbit_cases.MODELS`, their multipliers and derivatives, by arithmetic of 50 digits.

    python tests/orbit_reference.py      writes tests/data/orbit_derivatives.json, in some minutes

Nothing of the package's flow is used: the motion from event to event is a series of Taylor of the augmented linear
system, an event the root of its condition, and a derivative a central difference of whole periods with a step of 1e-16
of the scale, whose error is some 1e-30. From the package come the order of the events and a first guess of times and
state, which Newton's method takes to 30 digits.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mpmath as mp
import numpy as np
from orbit_cases import HELD_BALL, MODELS, Model

import femimpact as fi

mp.mp.dps = 50
STEP = mp.mpf(10) ** -16
FILE = Path(__file__).parent / "data" / "orbit_derivatives.json"


class Reference:
    """A model with its numbers as mpmath's; z = (u, y, u', y', sin, cos, 1) of the drive's phase."""

    def __init__(self, model: Model, **numbers: mp.mpf) -> None:
        self.model = model
        self.n, self.balls = len(model.omega), [j for j, pair in enumerate(model.pairs) if pair[1] is not None]
        self.d = self.n + len(self.balls)
        self.omega = 2 * mp.pi * numbers.get("frequency", mp.mpf(model.frequency))
        self.amplitude = numbers.get("amplitude", mp.mpf(model.amplitude))
        self.restitution = numbers.get("restitution", mp.mpf(model.law[0]))
        self.gap = [mp.mpf(pair[2]) + numbers.get("gap", 0) for pair in model.pairs]
        # p of ub, x_j = rows_j p + share_j ub
        self.rows, self.share = [], []
        for j, (shape, mass, _) in enumerate(model.pairs):
            row = [mp.mpf(value) * (1 if mass is None else -1) for value in shape] + [mp.mpf(0)] * len(self.balls)
            if mass is not None:
                row[self.n + self.balls.index(j)] = mp.mpf(1)
            self.rows.append(row)
            self.share.append(mp.mpf(1) if mass is None and model.in_space else mp.mpf(0))
        self.mass = [mp.mpf(1)] * self.n + [mp.mpf(model.pairs[j][1]) for j in self.balls]
        if "mass" in numbers:
            self.mass[self.n] = numbers["mass"]
        self.law = tuple(numbers.get(key, mp.mpf(model.law[i])) for i, key in enumerate(("stiffness", "damping")))
        self.factor = numbers.get("factor", mp.mpf(1))

    def matrix(self, pressed: dict[int, int]) -> mp.matrix:
        """Rate of the augmented state while pairs are pressed on sides."""
        d, model = self.d, self.model
        A = mp.zeros(2 * d + 3)
        s, c, one = 2 * d, 2 * d + 1, 2 * d + 2
        for i in range(d):
            A[i, d + i] = 1
            if i < self.n:
                omega = mp.mpf(model.omega[i])
                A[d + i, i], A[d + i, d + i] = -(omega**2), -2 * mp.mpf(model.ratio) * self.factor * omega
                A[d + i, s] = mp.mpf(model.base_load[i]) * self.amplitude * self.omega**2
            else:
                A[d + i, s], A[d + i, one] = self.amplitude * self.omega**2, mp.mpf(model.acceleration)
        held = (mp.mpf(model.held[0]), self.factor * mp.mpf(model.held[1]))
        springs = [(j, 0, *held) for j in self.balls] + [(j, side, *self.law) for j, side in pressed.items()]
        for j, side, k, b in springs:
            row, share = self.rows[j], self.share[j]
            for i in range(d):
                # the force k (x - w) + b x' against the row; the springs of balls have no wall
                for m in range(d):
                    A[d + i, m] -= row[i] * k * row[m] / self.mass[i]
                    A[d + i, d + m] -= row[i] * b * row[m] / self.mass[i]
                A[d + i, one] += row[i] * k * side * self.gap[j] / self.mass[i]
                A[d + i, s] -= row[i] * k * share * self.amplitude / self.mass[i]
                A[d + i, c] -= row[i] * b * share * self.amplitude * self.omega / self.mass[i]
        A[s, c], A[c, s] = self.omega, -self.omega
        return A

    def propagated(self, A: mp.matrix, z: mp.matrix, time: mp.mpf) -> mp.matrix:
        """e^{A t} z by Taylor's series, in steps that leave it all but some digits."""
        # A has squares of frequencies
        steps = max(int(mp.ceil(abs(time) * mp.sqrt(mp.mnorm(A, 1)) / 8)), 1)
        h = time / steps
        for _ in range(steps):
            term, k = z.copy(), 0
            while mp.mnorm(term, 1) > mp.mpf(10) ** -60:
                k += 1
                term = A * term * (h / k)
                z = z + term
        return z

    def condition(self, kind: str, j: int, side: int, z: mp.matrix) -> mp.mpf:
        """Distance of a pair from its wall, or its force."""
        x, rate = self.gap_motion(j, z)
        if kind in ("release", "press again"):
            return self.law[0] * (side * x - self.gap[j]) + self.law[1] * side * rate
        return side * x - self.gap[j]

    def gap_motion(self, j: int, z: mp.matrix) -> tuple[mp.mpf, mp.mpf]:
        """Gap coordinate of a pair and its rate."""
        row, d = self.rows[j], self.d
        base, speed = self.amplitude * z[2 * d], self.amplitude * self.omega * z[2 * d + 1]
        x, rate = (mp.fsum(row[i] * z[first + i] for i in range(d)) for first in (0, d))
        return x + self.share[j] * base, rate + self.share[j] * speed

    def struck(self, j: int, z: mp.matrix) -> mp.matrix:
        """The state after a rigid impact."""
        _, rate = self.gap_motion(j, z)
        row, after = self.rows[j], z.copy()
        compliance = mp.fsum(row[i] ** 2 / self.mass[i] for i in range(self.d))
        for i in range(self.d):
            after[self.d + i] -= row[i] / self.mass[i] * (1 + self.restitution) * rate / compliance
        return after

    def period(self, state: list[mp.mpf], events: list[tuple[str, int, int, mp.mpf]], most: int | None = None):
        """State one period after t = 0 with events at times that are guessed; or state and phase after one of them."""
        z, now = mp.matrix([*state, mp.mpf(0), mp.mpf(1), mp.mpf(1)]), mp.mpf(0)
        pressed: dict[int, int] = {}
        for number, (kind, j, side, guess) in enumerate(events):
            A = self.matrix(pressed)
            z, now = self.propagated(A, z, guess - now), guess
            for _ in range(40):
                slope = A * z
                value = self.condition(kind, j, side, z)
                # the condition is affine in the state
                rate = self.condition(kind, j, side, z + slope) - value
                step = -value / rate
                z, now = self.propagated(A, z, step), now + step
                if abs(step) < mp.mpf(10) ** -40:
                    break
            if kind == "impact":
                z = self.struck(j, z)
            elif kind in ("touch", "press again"):
                pressed[j] = side
            else:
                pressed.pop(j, None)
            if most == number:
                return list(z[: 2 * self.d]), self.omega * now
        return list(self.propagated(self.matrix(pressed), z, 2 * mp.pi / self.omega - now)[: 2 * self.d]), None


def difference(function, scale: list[mp.mpf]) -> mp.matrix:
    """Central differences of a list by shifts of several numbers."""
    columns = []
    for i, unit in enumerate(scale):
        ahead, behind = function(i, STEP * unit), function(i, -STEP * unit)
        columns.append([(a - b) / (2 * STEP * unit) for a, b in zip(ahead, behind, strict=True)])
    return mp.matrix(columns).T


def derivatives(orbit: fi.orbits.PeriodicOrbit, model: Model) -> dict[str, list]:
    """State and monodromy at t = 0, multipliers, times of the events, and derivatives by parameters.

    The latter are those of state and phase at the first event.
    """
    log, start = orbit.events, orbit.state
    events = [
        (str(kind), int(j), int(side), mp.mpf(float(time)))
        for kind, j, side, time in zip(log.kind, log.pair, log.side, log.time, strict=True)
    ]
    reference = Reference(model)
    state = [mp.mpf(float(v)) for v in np.concatenate(
        [start.displacement, start.ball_displacement, start.velocity, start.ball_velocity])]  # fmt: skip
    scale = [mp.mpf(1)] * len(state)

    def shifted(i: int, by: mp.mpf) -> list[mp.mpf]:
        return [value + (by if k == i else 0) for k, value in enumerate(state)]

    size = len(state)
    for _ in range(2):
        M = difference(lambda i, by: reference.period(shifted(i, by), events)[0], scale)
        left = mp.matrix(reference.period(state, events)[0]) - mp.matrix(state)
        step = mp.lu_solve(mp.eye(size) - M, left)
        state = [value + step[k] for k, value in enumerate(state)]
        print("  Newton:", mp.nstr(mp.mnorm(step, 1), 3))
    M = difference(lambda i, by: reference.period(shifted(i, by), events)[0], scale)
    times = [reference.period(state, events, most=k)[1] / reference.omega for k in range(len(events))]
    multipliers = sorted(mp.eig(M, left=False, right=False), key=abs, reverse=True)
    found = {
        "state": [float(value) for value in state],
        "times": [float(value) for value in times],
        "multipliers": [[float(mp.re(value)), float(mp.im(value))] for value in multipliers],
        "monodromy": [[float(M[i, j]) for j in range(size)] for i in range(size)],
    }

    def first_event(of: Reference, at: list[mp.mpf]) -> list[mp.mpf]:
        after, phase = of.period(at, events, most=0)
        return [*after, phase]

    values = {"frequency": model.frequency, "amplitude": model.amplitude, "gap": 0, "factor": 1}
    law = ("restitution",) if model.is_rigid else ("stiffness", "damping")
    values |= dict(zip(law, model.law, strict=False))
    if model.pairs[0][1] is not None:
        # of the first ball
        values["mass"] = model.pairs[0][1]
    for name, value in values.items():

        def varied(by: mp.mpf, name: str = name, value: float = value) -> Reference:
            return Reference(model, **{name: mp.mpf(value) + by})

        moved = difference(lambda _, by, varied=varied: varied(by).period(state, events)[0], [mp.mpf(1)])
        rates = list(mp.lu_solve(mp.eye(size) - M, moved))

        def moving(_: int, by: mp.mpf, rates: list = rates, varied=varied) -> list[mp.mpf]:
            return first_event(varied(by), [v + by * rate for v, rate in zip(state, rates, strict=True)])

        along = difference(moving, [mp.mpf(1)])
        found[name] = [float(along[k]) for k in range(size + 1)]
    return found


if __name__ == "__main__":
    made = {}
    for name, model in (MODELS | {"held ball": HELD_BALL}).items():
        print(name)
        made[name] = derivatives(model.orbit(), replace(model))
    FILE.write_text(json.dumps(made, indent=1) + "\n")
