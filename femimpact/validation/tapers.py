"""Beams whose thickness, or thickness and width, taper to one point: modes in Bessel functions, statics of M/EI."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from femimpact.fem.assembly import assemble
from femimpact.structure.beam import Beam, Segment
from femimpact.structure.structure import PointMass, Structure
from femimpact.system.modes import solve_modes, solve_stiffness
from femimpact.validation.case import Case

__all__ = ["CASES", "TaperedCantilever"]

LENGTH, WIDTH, THICKNESS, YOUNG_MODULUS, DENSITY = 0.3, 0.02, 4e-3, 70e9, 2700.0
ELEMENTS = 80
PYRAMID = (23.289, 73.9, 165.23)
"""omega L^2/h sqrt(12 rho/E) of a cantilever with both dimensions 4 to 1, h at the tip: Mabie and Rogers (1972)."""

PLUS = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class TaperedCantilever:
    """A truncated wedge or pyramid, clamped at the end where x = c, with its closed form.

    With x from the point to which the beam tapers, rho A ~ x^n and E I ~ x^(n+2): n = 1 where the thickness tapers,
    n = 2 where the width does too. A mode obeys (x^(n+2) w'')'' = k^4 x^n w, with k^4 = omega^2 c^2 rho A/(E I) of the
    root. This is D D w = k^4 w with D w = x^-n (x^(n+1) w')', and D w = -+ k^2 w has the solutions
    w = x^(-n/2) F_n(2 k sqrt(x)) with F = J, Y and F = I, K. A derivative of x^(-m/2) F_m by x is
    -k x^(-(m+1)/2) F_(m+1), with + for I, and one of x^(m/2) F_m is k x^((m-1)/2) F_(m-1), with - for K. So
    w'' = k^2 x^(-n/2-1) F_(n+2), and (x^(n+2) w'')' = k^3 x^((n+1)/2) F_(n+1).

    Parameters
    ----------
    ratio : float, 1
        Size of the section at the tip over that at the root; above 1 the tip is the thick end.
    both : bool
        Whether the width tapers too.
    body : float, 1
        Mass at the tip over rho A c of the root.
    """

    ratio: float
    both: bool = False
    body: float = 0.0

    @property
    def power(self) -> int:
        """The n of rho A ~ x^n."""
        return 2 if self.both else 1

    @property
    def ends(self) -> tuple[float, float]:
        """Places x of root and tip, in lengths of the beam."""
        root = 1.0 / abs(1.0 - self.ratio)
        return root, root - math.copysign(1.0, 1.0 - self.ratio)

    @property
    def structure(self) -> Structure:
        """The cantilever itself."""
        width = self.ratio * WIDTH if self.both else None
        segment = Segment(
            LENGTH, YOUNG_MODULUS, DENSITY, WIDTH, THICKNESS, end_width=width, end_thickness=self.ratio * THICKNESS
        )
        mass = self.body * segment.mass_per_length * self.ends[0] * LENGTH
        return Structure(Beam((segment,)), masses=(PointMass("body", "tip", mass),) if mass else ())

    def frequency(self, wavenumber: float) -> float:
        """Frequency (Hz) of k."""
        speed = math.sqrt(YOUNG_MODULUS / (12.0 * DENSITY)) * THICKNESS / LENGTH**2
        return wavenumber**2 * speed / self.ends[0] / (2.0 * math.pi)

    def wavenumbers(self, count: int) -> NDArray[np.float64]:
        """The lowest k, (count,): roots of the determinant of the conditions at both ends."""
        from scipy.optimize import brentq

        def determinant(k: float) -> float:
            return float(np.linalg.det(self._conditions(k)))

        # 2 k sqrt(x) grows by about pi over the beam from mode to mode
        grid = np.linspace(0.0, (count + 1) * math.pi / abs(np.diff(np.sqrt(self.ends))[0]) / 2.0, 200 * count)[1:]
        values = [determinant(k) for k in grid]
        changes = [(a, b) for (a, b), (u, v) in zip(pairwise(grid), pairwise(values), strict=True) if u * v < 0.0]
        return np.array([brentq(determinant, a, b, xtol=1e-14, rtol=1e-14) for a, b in changes[:count]])

    def mesh_error(self, wavenumber: float, elements: int) -> float:
        """Relative error of the frequency on equal cubic elements, h^4/1440 int E I w''''^2 / int E I w''^2.

        The relative error of omega^2 is that of the energy of the mode's best approximation (Strang and Fix, 1973):
        of w'', a linear function in each element misses int w''''^2 h^4/720.
        """
        from scipy.integrate import quad

        def energy(order: int) -> float:
            curve = self.shape(wavenumber, order)

            def density(x: float) -> float:
                return x ** (self.power + 2) * curve(x) ** 2

            return float(quad(density, min(self.ends), max(self.ends))[0])

        return energy(4) / energy(2) / (1440.0 * elements**4)

    def shape(self, wavenumber: float, derivative: int) -> Callable[[float], float]:
        """The mode of k, or its derivative of order 2 or 4 by x, up to one factor, as a function of x."""
        order = self.power + derivative
        shares = np.linalg.svd(self._conditions(wavenumber))[2][-1]

        def curve(x: float) -> float:
            row = self._row(order, x, wavenumber, PLUS)
            return float(wavenumber**derivative * x ** (-0.5 * order) * (row @ shares))

        return curve

    def _row(self, order: int, x: float, k: float, signs: tuple[float, ...]) -> NDArray[np.float64]:
        """J, Y, I and K of an order at 2 k sqrt(x), (4,), with signs, and I and K in a scale of the whole beam."""
        from scipy.special import iv, jv, kv, yv

        z, low, high = (2.0 * k * math.sqrt(place) for place in (x, *sorted(self.ends)))
        values = jv(order, z), yv(order, z), math.exp(-high) * iv(order, z), math.exp(low) * kv(order, z)
        return np.array(signs) * values

    def _conditions(self, k: float) -> NDArray[np.float64]:
        """At the root w = w' = 0, at the tip w'' = 0 and the shear force is the body's inertia; (4, 4)."""
        n, (root, tip) = self.power, self.ends
        outward = math.copysign(1.0, tip - root)
        shear = root ** -(n + 1) * tip ** (0.5 * (n + 1)) * self._row(n + 1, tip, k, (1.0, 1.0, 1.0, -1.0))
        inertia = outward * self.body * k * tip ** (-0.5 * n) * self._row(n, tip, k, PLUS)
        held = self._row(n, root, k, PLUS), self._row(n + 1, root, k, (-1.0, -1.0, 1.0, -1.0))
        return np.array([*held, self._row(n + 2, tip, k, PLUS), shear + inertia])


def tapered_mode(name: str, beam: TaperedCantilever, mode: int) -> Case:
    """A natural frequency of a cantilever that tapers."""
    k = float(beam.wavenumbers(mode)[-1])
    found = solve_modes(assemble(beam.structure, ELEMENTS), mode).natural_frequency[mode - 1]
    return Case(
        f"{name}, mode {mode}", "derived here (determinant of Bessel functions)", "frequency", "Hz",
        beam.frequency(k), float(found), 1.1 * beam.mesh_error(k, ELEMENTS) + 1e-9,
        f"h^4/1440 int EI w''''^2/int EI w''^2 of {ELEMENTS} cubic elements, and 1e-9 of rounding",
    )  # fmt: skip


def published_mode(mode: int) -> Case:
    """Frequency of a pyramid of 4 to 1, as omega L^2/h sqrt(12 rho/E) with the thickness h of the tip."""
    beam = TaperedCantilever(0.25, both=True)
    speed = math.sqrt(YOUNG_MODULUS / (12.0 * DENSITY)) * beam.ratio * THICKNESS / LENGTH**2
    found = solve_modes(assemble(beam.structure, ELEMENTS), mode).natural_frequency[mode - 1]
    return Case(
        f"cantilever with both dimensions 4 to 1, mode {mode}", "Mabie and Rogers (1972)", "omega L^2/h sqrt(12 rho/E)",
        "1", PYRAMID[mode - 1], 2.0 * math.pi * float(found) / speed, 5e-4,
        "the digits of the source, which integrates numerically; the mesh leaves 1e-6",
    )  # fmt: skip


def wedge_flexibility() -> Case:
    """Static deflection of a wedge's tip under a force there, the integral of (L - x)^2/(E I)."""
    from scipy.integrate import quad

    beam = TaperedCantilever(0.5)
    segment = beam.structure.beam.segments[0]
    exact = quad(lambda s: (1.0 - s) ** 2 / (1.0 - 0.5 * s) ** 3, 0.0, 1.0, epsabs=0.0, epsrel=1e-13)[0]
    system = assemble(beam.structure, ELEMENTS)
    row = system.point_row("tip")
    return Case(
        "wedge, static tip deflection of 1 N", "derived here (int (L - x)^2/(E I), by quadrature)", "deflection", "m",
        exact * LENGTH**3 / segment.bending_stiffness, float(row @ solve_stiffness(system, row)), 4e-9,
        f"h^4/720 int EI w''''^2/int EI w''^2 of {ELEMENTS} cubic elements is 2.1e-9, and 1e-9 of rounding",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    *(partial(tapered_mode, "wedge, half as thick at the tip", TaperedCantilever(0.5), mode) for mode in (1, 2, 3)),
    *(
        partial(tapered_mode, "cantilever with both dimensions halved at the tip", TaperedCantilever(0.5, True), mode)
        for mode in (1, 2, 3)
    ),
    *(partial(published_mode, mode) for mode in (1, 2, 3)),
    wedge_flexibility,
)
"""The cases of this subject, in the order of the table."""
