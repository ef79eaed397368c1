"""Impacts of a ball in the box of one oscillator, in 30 digits: no step, no fit and no rule of femimpact is shared.

Relative to the base x'' + 2 zeta w x' + w^2 x = -s(t) + F(t)/m, y'' = -s(t). A panel is gone through by Gauss-Legendre
quadrature of the convolution, and a crossing |y - x| = gap is found in it by scanning and by the secant rule.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np

POINTS = 20
"""Of the quadrature of a panel; its error is that of order 40."""

SCANNED = 12
"""Instants of a panel at which a crossing is looked for."""


class Oscillator:
    """State of oscillator and ball, and the panels that it goes through."""

    def __init__(
        self,
        omega: float,
        zeta: float,
        mass: float,
        ball: float,
        gap: float,
        restitution: float,
        s: Callable[[Any], Any],
        force: Callable[[Any], Any] = lambda _: 0,
    ) -> None:
        mp.mp.dps = 30
        self.masses, self.gap, self.e, self.s = (mp.mpf(mass), mp.mpf(ball)), mp.mpf(gap), mp.mpf(restitution), s
        self.force = force
        self.decay = mp.mpf(zeta) * omega
        self.turning = mp.sqrt(mp.mpf(omega) ** 2 - self.decay**2)
        self.state = [mp.mpf(0)] * 4
        self.time = mp.mpf(0)
        self.nodes, self.weights = zip(*_gauss(POINTS), strict=True)

    def after(self, t: Any) -> list[Any]:
        """x, x', y and y' at a time (s) in the present panel."""
        (x, v, y, u), h, d, w = self.state, t - self.time, self.decay, self.turning
        decayed, c, s = mp.exp(-d * h), mp.cos(w * h), mp.sin(w * h)
        found = [
            decayed * (x * c + (v + d * x) / w * s), decayed * (v * c - (d * v + (d * d + w * w) * x) / w * s),
            y + u * h, u,
        ]  # fmt: skip
        for node, weight in zip(self.nodes, self.weights, strict=True):
            left = h * (1 - node)
            at = self.time + h * node
            push = -self.s(at) * weight * h
            forced = push + self.force(at) / self.masses[0] * weight * h
            decayed, c, s = mp.exp(-d * left), mp.cos(w * left), mp.sin(w * left)
            found[0] += forced * decayed * s / w
            found[1] += forced * decayed * (c - d / w * s)
            found[2] += push * left
            found[3] += push
        return found

    def clearance(self, t: Any, side: int) -> Any:
        """What is left to a wall at a time (s)."""
        found = self.after(t)
        return self.gap - side * (found[2] - found[0])

    def crossing(self, end: Any) -> tuple[Any, int] | None:
        """Time (s) and side of the first crossing before the end of the panel."""
        times = [self.time + (end - self.time) * k / SCANNED for k in range(1, SCANNED + 1)]
        before = self.time
        for t in times:
            x, _, y, _ = self.after(t)
            for side in (1, -1):
                if side * (y - x) > self.gap:
                    low, high = before, t
                    for _ in range(12):
                        middle = (low + high) / 2
                        low, high = (middle, high) if self.clearance(middle, side) > 0 else (low, middle)
                    return mp.findroot(lambda at, side=side: self.clearance(at, side), (low, high), tol=1e-50), side
            before = t
        return None

    def impacts(self, panels: np.ndarray, most: int) -> list[tuple[float, int, float]]:
        """Time (s), side and approach speed (m/s) of the first impacts; panels end at these times (s)."""
        found: list[tuple[float, int, float]] = []
        for end in map(mp.mpf, panels):
            while self.time < end:
                met = self.crossing(end)
                until = end if met is None else met[0]
                self.state, self.time = self.after(until), until
                if met is None:
                    continue
                m, ball = self.masses
                speed = self.state[3] - self.state[1]
                push = (1 + self.e) * speed / (1 / m + 1 / ball)
                self.state[1] += push / m
                self.state[3] -= push / ball
                found.append((float(until), met[1], float(abs(speed))))
                if len(found) == most:
                    return found
        return found


def _gauss(count: int) -> list[tuple[Any, Any]]:
    """Nodes on 0 to 1 and weights of Gauss-Legendre quadrature."""
    rough, _ = np.polynomial.legendre.leggauss(count)
    rule = []
    for start in rough:
        x = mp.findroot(lambda z: mp.legendre(count, z), mp.mpf(float(start)))
        slope = count * (x * mp.legendre(count, x) - mp.legendre(count - 1, x)) / (x * x - 1)
        rule.append(((1 + x) / 2, 1 / ((1 - x * x) * slope**2)))
    return rule
