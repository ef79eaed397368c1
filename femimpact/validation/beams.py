"""Reference cases of beams, uniform and tapered: frequencies and static deflections in closed form."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.laws import Rigid
from femimpact.excitation.harmonic import Sine
from femimpact.fem.assembly import assemble
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import integrate
from femimpact.response.response import Recorder
from femimpact.structure.axial import Axial
from femimpact.structure.beam import Beam, Rayleigh, Segment
from femimpact.structure.structure import PointMass, Stop, Structure
from femimpact.system.modes import Modes, solve_modes, solve_stiffness
from femimpact.system.reduction import reduce
from femimpact.validation.case import Case

LENGTH, WIDTH, THICKNESS, YOUNG_MODULUS, DENSITY = 0.3, 0.02, 1e-3, 70e9, 2700.0
BENDING_STIFFNESS = YOUNG_MODULUS * WIDTH * THICKNESS**3 / 12
MASS_PER_LENGTH = DENSITY * WIDTH * THICKNESS
ELEMENTS = 80
ROOTS = (1.87510407, 4.69409113, 7.85475744, 10.99554073, 14.13716839)
"""beta L of the clamped-free beam, 8 decimals: Blevins (1979), table 8-1."""


def uniform_beam() -> Beam:
    """The cantilever of these cases."""
    return Beam.uniform(
        length=LENGTH, width=WIDTH, thickness=THICKNESS, young_modulus=YOUNG_MODULUS, density=DENSITY
    )  # fmt: skip


def beam_frequency(root: float) -> float:
    """Natural frequency (Hz) of beta L."""
    return (root / LENGTH) ** 2 * math.sqrt(BENDING_STIFFNESS / MASS_PER_LENGTH) / (2 * math.pi)


MESH = f"(beta h)^4/2880 of {ELEMENTS} cubic elements, and 1e-9 of rounding"


def mesh_error(root: float, rounding: float = 1e-9) -> float:
    """Relative error of beta L: cubic elements raise omega^2 by (beta h)^4/720, beta L goes with its fourth root."""
    return 1.2 * (root / ELEMENTS) ** 4 / 2880 + rounding


def modes_of(structure: Structure, count: int) -> Modes:
    """The lowest modes on the mesh of these cases."""
    return solve_modes(assemble(structure, ELEMENTS), count)


def computed_root(structure: Structure, mode: int) -> float:
    """Beta L of a mode, by the bending stiffness and the mass per length of the cantilever."""
    omega = 2 * math.pi * float(modes_of(structure, mode).natural_frequency[mode - 1])
    return LENGTH * math.pow(omega**2 * MASS_PER_LENGTH / BENDING_STIFFNESS, 0.25)


def cantilever_root() -> Iterator[Case]:
    """Roots of 1 + cos x cosh x = 0."""
    for mode, root in enumerate(ROOTS[:3], start=1):
        yield Case(
            f"cantilever, mode {mode}", "Blevins (1979), table 8-1", "beta L", "1", root,
            computed_root(Structure(uniform_beam()), mode), mesh_error(root, 5e-9 / root),
            f"(beta h)^4/2880 of {ELEMENTS} cubic elements, and the 8 decimals of the reference",
        )  # fmt: skip


def tip_mass_root() -> Iterator[Case]:
    """Roots of 1 + cos x cosh x + ratio x (cos x sinh x - sin x cosh x) = 0, ratio = tip mass/beam mass."""
    from scipy.optimize import brentq

    def determinant(x: float, ratio: float) -> float:
        # over cosh x, which would overflow digits
        c, s, t = math.cos(x), math.sin(x), math.tanh(x)
        return 1 / math.cosh(x) + c + ratio * x * (c * t - s)

    beam = uniform_beam()
    for ratio, mode in itertools.product((0.5, 2.0), (1, 2, 3)):
        # between the root of the clamped-pinned beam below and that of the clamped-free one
        below = 0.1 if mode == 1 else (mode - 0.75) * math.pi - 0.01
        root = float(brentq(determinant, below, ROOTS[mode - 1], (ratio,), xtol=1e-15, rtol=1e-15))
        structure = Structure(beam, masses=(PointMass("box", "tip", ratio * beam.mass),))
        yield Case(
            f"cantilever with a tip mass of {ratio:g} beam masses, mode {mode}",
            "derived here (transcendental equation)", "beta L", "1", root, computed_root(structure, mode),
            mesh_error(root), MESH,
        )  # fmt: skip


def tip_flexibility() -> Iterator[Case]:
    """Static deflection of the tip under a force there, L^3/(3 E I)."""
    probe = Stop("probe", "tip", (math.inf, 0.1), Rigid(0.5))
    system = assemble(Structure(uniform_beam(), stops=(probe,)), ELEMENTS)
    yield Case(
        "cantilever, static tip deflection of 1 N", "derived here (F L^3/(3 E I))", "deflection", "m",
        LENGTH**3 / (3 * BENDING_STIFFNESS), system.contacts[0].flexibility, 1e-9,
        "cubic elements are exact for end loads: rounding only",
    )  # fmt: skip


def thick_cantilever() -> Iterator[Case]:
    """A bar that shears: F L^3/(3 EI) + F L/(kGA), and the transfer matrix of (w, t, M, Q), M = Q = 0 at the tip."""
    from scipy.linalg import expm
    from scipy.optimize import brentq

    shear = {"shear_modulus": 26e9, "shear_factor": 0.85}
    beam = Beam.uniform(length=0.1, width=0.02, thickness=0.013, young_modulus=70e9, density=2700.0, **shear)
    (bar,) = beam.segments
    kga, rotary = 0.85 * 26e9 * 0.02 * 0.013, 2700.0 * 0.02 * 0.013**3 / 12.0

    def determinant(frequency: float) -> float:
        squared, rates = (2.0 * math.pi * frequency) ** 2, np.zeros((4, 4))
        rates[[0, 0, 1, 2], [1, 3, 2, 3]] = 1.0, 1.0 / kga, 1.0 / bar.bending_stiffness, -1.0
        rates[[2, 3], [1, 0]] = -rotary * squared, -bar.mass_per_length * squared
        return float(np.linalg.det(expm(0.1 * rates)[2:, 2:]))

    system = assemble(Structure(beam, stops=(Stop("probe", "tip", (math.inf, 0.1), Rigid(0.5)),)), ELEMENTS)
    exact, computed = 0.1**3 / (3.0 * bar.bending_stiffness) + 0.1 / kga, system.contacts[0].flexibility
    source = "derived here (F L^3/(3 E I) + F L/(k G A))", "deflection", "m"
    yield Case("bar that shears, tip under 1 N", *source, exact, computed, 1e-12, "exact for end loads: rounding only")
    source, reason = ("derived here (transfer matrix)", "frequency", "Hz"), f"order 2 of {ELEMENTS} elements"
    for mode, bound in enumerate((5e-7, 2e-5, 1e-4), start=1):
        computed = float(solve_modes(system, 3).natural_frequency[mode - 1])
        exact = float(brentq(determinant, 0.97 * computed, 1.03 * computed, xtol=1e-9))
        yield Case(f"bar that shears, mode {mode}", *source, exact, computed, bound, reason)


def _modal_series(frequency: float, alpha: float, beta: float) -> float:
    """Tip amplitude over base amplitude, relative motion: the sum over the clamped-free modes.

    phi(L) = 2 (-1)^(n+1) and the mean of phi is 2 s/x, for phi of unit mean square.
    """
    omega, total = 2 * math.pi * frequency, 0j
    for n, x in enumerate((*ROOTS, *((n + 0.5) * math.pi for n in range(5, 10)))):
        s = (math.sinh(x) - math.sin(x)) / (math.cosh(x) + math.cos(x))
        natural = 2 * math.pi * beam_frequency(x)
        total += (-1) ** n * 4 * s / x * omega**2 / (natural**2 - omega**2 + 1j * omega * (alpha + beta * natural**2))
    return abs(total)


def base_sine() -> Iterator[Case]:
    """Steady tip amplitude of a cantilever on a base that moves as a sine."""
    for ratio in (0.5, 1.0, 3.0):
        damping, first, second = 0.05, beam_frequency(ROOTS[0]), beam_frequency(ROOTS[1])
        structure = Structure(uniform_beam(), damping=Rayleigh(ratio=damping, frequencies=(first, second)))
        alpha = 4 * math.pi * damping * first * second / (first + second)
        beta = damping / (math.pi * (first + second))
        base = Sine(1e-3, ratio * first)
        # the transient has fallen by exp(-0.05 2 pi 20) = 2e-3 at 20 periods, so wait for 80
        wait, keep = 80 / first, 20 / base.frequency
        run = integrate(
            reduce(assemble(structure, ELEMENTS), 10), base, EventDriven(), wait + keep, Recorder(("tip",), start=wait)
        )
        angle = base.omega * run.time
        in_phase, quadrature = np.linalg.lstsq(np.column_stack([np.sin(angle), np.cos(angle)]), run["tip"])[0]
        yield Case(
            f"cantilever on a shaken base, {ratio:g} f1", "derived here (modal series, 10 modes)",
            "tip over base amplitude", "1", _modal_series(base.frequency, alpha, beta),
            math.hypot(in_phase, quadrature) / base.amplitude, 2e-7,
            "the roots to 8 decimals, at resonance times 2 x 10; mesh 1e-9, transient 1e-11",
        )  # fmt: skip


def axial_load() -> Iterator[Case]:
    """Beams that hang and spin: power series of w'''' - (n w')' = omega^2 w in x/L, n = N L^2/EI."""
    from scipy.optimize import brentq

    def determinant(omega: float, force: tuple[float, ...]) -> float:
        k, shapes = np.arange(80.0), np.eye(80, 2, -2)
        for i in range(76):
            bent = sum((i + 1) * (i + 2 - j) * n * shapes[i + 2 - j] for j, n in enumerate(force))
            shapes[i + 4] = (omega**2 * shapes[i] + bent) / math.prod(range(i + 1, i + 5))
        return float(np.linalg.det([k * (k - 1) @ shapes, k * (k - 1) * (k - 2) @ shapes]))

    unit = math.sqrt(BENDING_STIFFNESS / MASS_PER_LENGTH) / LENGTH**2
    source, quantity = "derived here (power series)", "omega L^2 sqrt(rho A/EI)"
    reason = f"order 4, {ELEMENTS} cubic elements: 9e-9 at eta 12"
    for name, load, force in (
        ("hangs", Axial(acceleration=20.0 * unit**2 * LENGTH), (20.0, -20.0)),
        ("spins, eta 3", Axial(spin=3.0 * unit), (4.5, 0.0, -4.5)),
        ("spins, eta 12", Axial(spin=12.0 * unit), (72.0, 0.0, -72.0)),
    ):
        omega = 2.0 * math.pi * float(modes_of(Structure(uniform_beam(), axial=load), 1).natural_frequency[0]) / unit
        exact = brentq(determinant, 0.999 * omega, 1.001 * omega, (force,), xtol=1e-14, rtol=1e-14)
        yield Case(f"cantilever that {name}, mode 1", source, quantity, "1", float(exact), omega, 2e-8, reason)


CASES = (cantilever_root, tip_mass_root, tip_flexibility, thick_cantilever, base_sine, axial_load)
"""The cases of this subject, in the order of the table."""


ROOT_THICKNESS = 4e-3
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
    """

    ratio: float  # size of the section at the tip over that at the root; above 1 the tip is the thick end
    both: bool = False  # whether the width tapers too
    body: float = 0.0  # mass at the tip over rho A c of the root

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
            LENGTH,
            YOUNG_MODULUS,
            DENSITY,
            WIDTH,
            ROOT_THICKNESS,
            end_width=width,
            end_thickness=self.ratio * ROOT_THICKNESS,
        )
        mass = self.body * segment.mass_per_length * self.ends[0] * LENGTH
        return Structure(Beam((segment,)), masses=(PointMass("body", "tip", mass),) if mass else ())

    def frequency(self, wavenumber: float) -> float:
        """Frequency (Hz) of k."""
        speed = math.sqrt(YOUNG_MODULUS / (12.0 * DENSITY)) * ROOT_THICKNESS / LENGTH**2
        return wavenumber**2 * speed / self.ends[0] / (2.0 * math.pi)

    def wavenumbers(self, count: int) -> NDArray[np.float64]:
        """The lowest k, (count,): roots of the determinant of the conditions at both ends."""
        from scipy.optimize import brentq

        def determinant(k: float) -> float:
            return float(np.linalg.det(self._conditions(k)))

        # 2 k sqrt(x) grows by about pi over the beam from mode to mode
        grid = np.linspace(0.0, (count + 1) * math.pi / abs(np.diff(np.sqrt(self.ends))[0]) / 2.0, 200 * count)[1:]
        values = [determinant(k) for k in grid]
        changes = [
            (a, b)
            for (a, b), (u, v) in zip(itertools.pairwise(grid), itertools.pairwise(values), strict=True)
            if u * v < 0.0
        ]
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
        """J, Y, I and K of an order at 2 k sqrt(x), (4,), with signs, and I and K in a scale common to the beam."""
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


def tapered_modes() -> Iterator[Case]:
    """Natural frequencies of cantilevers that taper, and of a pyramid with the thickness h of its tip as published."""
    for name, beam in (
        ("wedge, half as thick at the tip", TaperedCantilever(0.5)),
        ("cantilever with both dimensions halved at the tip", TaperedCantilever(0.5, both=True)),
    ):
        for mode, k in enumerate(beam.wavenumbers(3).tolist(), start=1):
            computed = modes_of(beam.structure, mode).natural_frequency[mode - 1]
            yield Case(
                f"{name}, mode {mode}", "derived here (determinant of Bessel functions)", "frequency", "Hz",
                beam.frequency(k), float(computed), 1.1 * beam.mesh_error(k, ELEMENTS) + 1e-9,
                f"h^4/1440 int EI w''''^2/int EI w''^2 of {ELEMENTS} cubic elements, and 1e-9 of rounding",
            )  # fmt: skip
    beam = TaperedCantilever(0.25, both=True)
    speed = math.sqrt(YOUNG_MODULUS / (12.0 * DENSITY)) * beam.ratio * ROOT_THICKNESS / LENGTH**2
    for mode, published in enumerate(PYRAMID, start=1):
        computed = modes_of(beam.structure, mode).natural_frequency[mode - 1]
        yield Case(
            f"cantilever with both dimensions 4 to 1, mode {mode}", "Mabie and Rogers (1972)",
            "omega L^2/h sqrt(12 rho/E)", "1", published, 2.0 * math.pi * float(computed) / speed, 5e-4,
            "the digits of the source, which integrates numerically; the mesh leaves 1e-6",
        )  # fmt: skip


def wedge_flexibility() -> Iterator[Case]:
    """Static deflection of a wedge's tip under a force there, the integral of (L - x)^2/(E I)."""
    from scipy.integrate import quad

    beam = TaperedCantilever(0.5)
    segment = beam.structure.beam.segments[0]
    exact = quad(lambda s: (1.0 - s) ** 2 / (1.0 - 0.5 * s) ** 3, 0.0, 1.0, epsabs=0.0, epsrel=1e-13)[0]
    system = assemble(beam.structure, ELEMENTS)
    row = system.point_row("tip")
    yield Case(
        "wedge, static tip deflection of 1 N", "derived here (int (L - x)^2/(E I), by quadrature)", "deflection", "m",
        exact * LENGTH**3 / segment.bending_stiffness, float(row @ solve_stiffness(system, row)), 4e-9,
        f"h^4/720 int EI w''''^2/int EI w''^2 of {ELEMENTS} cubic elements is 2.1e-9, and 1e-9 of rounding",
    )  # fmt: skip


TAPER_CASES = (tapered_modes, wedge_flexibility)
"""The cases of this subject, in the order of the table."""
