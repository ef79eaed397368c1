"""Reference cases of structures and oscillators in closed form."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.contact.laws import Rigid
from femimpact.convergence.study import converge_elements
from femimpact.excitation.harmonic import Sine
from femimpact.fem.assembly import assemble
from femimpact.integrators import methods
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import HHT, WBZ, GeneralizedAlpha, MoreauJean, Newmark
from femimpact.response.channels import QuantityAt
from femimpact.response.response import Response
from femimpact.structure.beam import Beam, Rayleigh, Segment
from femimpact.structure.structure import Impactor, PointMass, Structure, Support, glue_impactors
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.beams import (
    BENDING_STIFFNESS,
    ELEMENTS,
    LENGTH,
    MASS_PER_LENGTH,
    MESH,
    ROOTS,
    computed_root,
    mesh_error,
    modes_of,
    uniform_beam,
)
from femimpact.validation.case import Case, oscillator

STEPS = 20
"""Steps in a period."""


@dataclass(frozen=True)
class Method:
    """A method of time integration and its amplification, known from its formula.

    Parameters
    ----------
    name, source : str
    make : callable
        The method with a step (s).
    amplification : callable
        Of omega dt: the matrix (k, k) that one step applies to an undamped oscillator's state.
    """

    name: str
    source: str
    make: Callable[[float], methods.Method]
    amplification: Callable[[float], Array]


def alpha_amplification(angle: float, beta: float, gamma: float, mass: float, force: float) -> Array:
    """One step on (u, dt v, dt^2 a) of u'' = -omega^2 u, angle = omega dt.

    Inertia is taken `mass` of a step, the spring `force` of a step before the end.
    """
    w = angle**2
    ahead = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [(1 - force) * w, 0.0, 1 - mass]])
    behind = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1 - gamma], [-force * w, 0.0, -mass]])
    return np.linalg.solve(ahead, behind)


def second_order(angle: float, mass: float, force: float) -> Array:
    """The same with gamma = 1/2 - mass + force and beta = (1 - mass + force)^2/4."""
    return alpha_amplification(angle, (1 - mass + force) ** 2 / 4, 0.5 - mass + force, mass, force)


def theta_amplification(angle: float, theta: float) -> Array:
    """One step of the theta rule on (u, dt v)."""
    w = angle**2
    ahead = np.array([[1.0, -theta], [theta * w, 1.0]])
    behind = np.array([[1.0, 1 - theta], [-(1 - theta) * w, 1.0]])
    return np.linalg.solve(ahead, behind)


METHODS = (
    Method(
        "Newmark 1/4, 1/2", "Newmark (1959)", Newmark,
        partial(alpha_amplification, beta=0.25, gamma=0.5, mass=0.0, force=0.0),
    ),
    Method(
        "Newmark 0.3025, 0.6", "Newmark (1959)", partial(Newmark, beta=0.3025, gamma=0.6),
        partial(alpha_amplification, beta=0.3025, gamma=0.6, mass=0.0, force=0.0),
    ),
    Method(
        "HHT, alpha -0.1", "Hilber et al. (1977)", partial(HHT, alpha=-0.1), partial(second_order, mass=0.0, force=0.1)
    ),
    Method(
        "WBZ, alpha -0.1", "Wood et al. (1980)", partial(WBZ, alpha=-0.1), partial(second_order, mass=-0.1, force=0.0)
    ),
    Method(
        "generalised alpha, r = 0.5", "Chung and Hulbert (1993)", partial(GeneralizedAlpha, spectral_radius=0.5),
        partial(second_order, mass=0.0, force=1 / 3),
    ),
    Method("Moreau-Jean, theta 1/2", "Jean (1999)", MoreauJean, partial(theta_amplification, theta=0.5)),
)  # fmt: skip
"""Methods of the cases; another one is another entry."""


def _free_vibration(method: methods.Method, periods: int) -> Response:
    """An undamped oscillator of 1 Hz, let go at 1 m."""
    return integrate(
        oscillator(omega=2 * math.pi), Sine(0.0, 1.0), method, float(periods), initial=State(displacement=[1.0])
    )


def _root(method: Method) -> tuple[complex, complex]:
    """Principal root (complex) over one step of free vibration: of the amplification matrix, and of a computed run."""
    roots = np.linalg.eigvals(method.amplification(2 * math.pi / STEPS))
    exact = complex(max(roots, key=lambda root: (abs(root), root.imag)))
    # 100 steps on, the third root of a method has decayed
    u = _free_vibration(method.make(1 / STEPS), 10)["tip"][100:]
    # two principal roots: u[n+2] = p u[n+1] + q u[n]
    p, q = np.linalg.lstsq(np.column_stack([u[1:-1], u[:-2]]), u[2:])[0]
    computed = complex(max(np.roots([1.0, -p, -q]), key=lambda root: root.imag))
    return complex(exact.real, abs(exact.imag)), computed


def free_vibration() -> Iterator[Case]:
    """Relative error of the period of a free vibration, and the damping ratio that the method adds."""
    for method in METHODS:
        roots = _root(method)
        period, computed = (2 * math.pi / (math.atan2(root.imag, root.real) * STEPS) - 1 for root in roots)
        source = f"{method.source}, amplification matrix"
        yield Case(
            f"{method.name}: period, {STEPS} steps a period", source, "period elongation", "1", period, computed, 1e-9,
            "200 steps of rounding over an elongation of 1 %",
        )  # fmt: skip
        damping, computed = (-math.log(abs(root)) / math.atan2(root.imag, root.real) for root in roots)
        # the average acceleration has none: its root lies on the unit circle, to rounding
        damping = 0.0 if abs(damping) < 1e-14 else damping
        yield Case(
            f"{method.name}: damping, {STEPS} steps a period", source, "numerical damping ratio", "1", damping,
            computed, 1e-10, "200 steps of rounding",
        )  # fmt: skip


def energy_is_kept() -> Iterator[Case]:
    """The average acceleration keeps the energy of an undamped linear structure."""
    energy = _free_vibration(Newmark(1 / STEPS), 1000).energy
    assert energy is not None
    stored = energy.stored
    yield Case(
        "Newmark 1/4, 1/2: energy of 1000 free periods", "Hughes (1987)", "largest change of energy", "1", 0.0,
        float(np.max(np.abs(stored / stored[0] - 1))), 1e-10, "20,000 steps of rounding",
    )  # fmt: skip


OSCILLATOR_CASES = (free_vibration, energy_is_kept)
"""The cases of this subject, in the order of the table."""


BEAM_MASS = MASS_PER_LENGTH * LENGTH


def _shape(x: float) -> NDArray[np.float64]:
    """(w, w', w'', w''') of both motions cosh - cos and sinh - sin that a clamped root allows, derivatives by x."""
    c, s, ch, sh = math.cos(x), math.sin(x), math.cosh(x), math.sinh(x)
    return np.array([[ch - c, sh - s], [sh + s, ch - c], [ch + c, sh + s], [sh - s, ch + c]])


def _tip_conditions(x: float, mass: float, inertia: float, offset: float = 0.0) -> NDArray[np.float64]:
    """Moment and shear at a tip with a body: mass over rho A L, inertia over rho A L^3, offset of its centre over L."""
    w, slope, moment, shear = _shape(x)
    centre = w + offset * x * slope
    return np.array([moment - inertia * x**3 * slope - offset * mass * x**2 * centre, shear + mass * x * centre])


def _tip_body_root(mode: int, mass: float, inertia: float, offset: float = 0.0) -> float:
    from scipy.optimize import brentq

    def determinant(x: float) -> float:
        return float(np.linalg.det(_tip_conditions(x, mass, inertia, offset)) / math.cosh(x))

    grid = np.linspace(0.3, 12.0, 400)
    values = [determinant(x) for x in grid]
    below = [i for i in range(grid.size - 1) if values[i] * values[i + 1] < 0][mode - 1]
    return float(brentq(determinant, grid[below], grid[below + 1], xtol=1e-15, rtol=1e-14))


def tip_body() -> Iterator[Case]:
    """Frequency with a body at the tip that has a rotary inertia, its centre at the tip or beyond it."""
    for offset, mode in itertools.product((0.0, 0.1), (1, 2)):
        mass, inertia = 0.5, 0.02
        root = _tip_body_root(mode, mass, inertia, offset)
        body = PointMass("box", "tip", mass * BEAM_MASS, inertia * BEAM_MASS * LENGTH**2, offset * LENGTH)
        beyond = f" and its centre {offset:g} L beyond" if offset else ""
        yield Case(
            f"cantilever, tip body with rotary inertia{beyond}, mode {mode}", "derived here (transcendental equation)",
            "beta L", "1", root, computed_root(Structure(uniform_beam(), masses=(body,)), mode), mesh_error(root), MESH,
        )  # fmt: skip


def uniform_beams() -> Iterator[Case]:
    """A ball glued to the tip is a tip mass; a beam on two pins has beta L = n pi."""
    ball = Impactor("ball", "tip", 0.5 * BEAM_MASS, 1e-3, Rigid(0.5))
    root = _tip_body_root(1, 0.5, 0.0)
    yield Case(
        "cantilever, ball of 0.5 beam masses glued to the tip", "derived here (transcendental equation)", "beta L", "1",
        root, computed_root(glue_impactors(Structure(uniform_beam(), impactors=(ball,))), 1), mesh_error(root), MESH,
    )  # fmt: skip
    pinned = Structure(uniform_beam(), supports=(Support("pinned", "root"), Support("pinned", "tip")))
    for mode in (1, 2):
        root = mode * math.pi
        yield Case(
            f"beam on two pins, mode {mode}", "Blevins (1979), table 8-1", "beta L", "1", root,
            computed_root(pinned, mode), mesh_error(root), MESH,
        )  # fmt: skip


def stepped_beam() -> Iterator[Case]:
    """Two halves, the inner one of twice the thickness: deflection, slope, moment and shear go on at the joint."""
    from scipy.optimize import brentq

    half, thick = 0.5, 2.0
    # of the thicker half: EI by thick^3, rho A by thick, so beta by thick^-1/2
    stiff, slower = thick**3, thick**-0.5

    def free(z: float) -> NDArray[np.float64]:
        c, s, ch, sh = math.cos(z), math.sin(z), math.cosh(z), math.sinh(z)
        return np.array([[c, s, ch, sh], [-s, c, sh, ch], [-c, -s, ch, sh], [s, -c, sh, ch]])

    def determinant(x: float) -> float:
        inner = _shape(slower * x * half)
        scale = np.array([1.0, slower, stiff * slower**2, stiff * slower**3])
        matrix = np.zeros((6, 6))
        matrix[:4, :2], matrix[:4, 2:] = scale[:, None] * inner, -free(0.0)
        matrix[4:, 2:] = free(x * half)[2:]
        return float(np.linalg.det(matrix))

    root = float(brentq(determinant, 1.9, 3.2, xtol=1e-15, rtol=1e-14))
    outer = uniform_beam().segments[0]
    width, thickness = outer.rectangle
    beam = Beam(
        tuple(
            Segment(LENGTH / 2, outer.young_modulus, outer.density, width, factor * thickness, name=name)
            for name, factor in (("inner", thick), ("outer", 1.0))
        )
    )
    yield Case(
        "cantilever of two thicknesses, mode 1", "derived here (determinant of six conditions)", "beta L", "1", root,
        computed_root(Structure(beam), 1), mesh_error(root), MESH,
    )  # fmt: skip


def stress_of_tube() -> Iterator[Case]:
    """Stress at the root of a clamped tube under a force at its tip: F L over the section modulus."""
    diameter, wall, force = 0.012, 0.001, 2.0
    beam = Beam.tube(length=LENGTH, diameter=diameter, wall=wall, young_modulus=210e9, density=7850.0)
    system = assemble(Structure(beam), 4)
    bent = np.linalg.solve(system.K.toarray(), force * system.point_row("tip"))
    stress = QuantityAt("surface_stress", "root").reading(system).displacement @ bent
    modulus = math.pi * (diameter**4 - (diameter - 2.0 * wall) ** 4) / (32.0 * diameter)
    yield Case(
        "clamped tube under a force at its tip", "derived here (pi (D^4 - d^4)/(32 D))", "stress at the root", "Pa",
        -force * LENGTH / modulus, float(stress), 1e-9, "rounding: a cubic is the exact deflection",
    )  # fmt: skip


def _closed_mode(mode: int, mass: float) -> tuple[float, float]:
    """Effective mass over the beam's, and (tip displacement)^2 times the beam's mass, of a cantilever's mode."""
    from scipy.integrate import quad

    x = _tip_body_root(mode, mass, 0.0)
    first, second = _tip_conditions(x, mass, 0.0)[0]
    share = np.array([1.0, -first / second])

    def w(z: float) -> float:
        return float(_shape(x * z)[0] @ share)

    tip = w(1.0)
    square = quad(lambda z: w(z) ** 2, 0.0, 1.0, epsabs=0.0, epsrel=1e-12)[0] + mass * tip**2
    mean = quad(w, 0.0, 1.0, epsabs=0.0, epsrel=1e-12)[0] + mass * tip
    return mean**2 / square, tip**2 / square


def masses_of_modes() -> Iterator[Case]:
    """Effective mass (phi^T M r)^2/(phi^T M phi) of a mode, and the one that the first puts against a ball."""
    mass, source = 0.5, "derived here (quadrature of the closed form)"
    mesh = f"(beta h)^4 of {ELEMENTS} cubic elements over some hundred"
    structure = Structure(uniform_beam(), masses=(PointMass("box", "tip", mass * BEAM_MASS),))
    for mode in (1, 2):
        yield Case(
            f"cantilever with a tip mass of 0.5 beam masses, mode {mode}: effective mass", source, "effective mass",
            "kg", _closed_mode(mode, mass)[0] * BEAM_MASS, float(modes_of(structure, mode).effective_mass[mode - 1]),
            1e-7, mesh,
        )  # fmt: skip
    ball = 0.1 * BEAM_MASS
    structure = Structure(uniform_beam(), impactors=(Impactor("ball", "tip", ball, 1e-3, Rigid(0.5)),))
    yield Case(
        "cantilever against a ball of 0.1 beam masses", source, "effective mass of the contact", "kg",
        1 / (1 / ball + _closed_mode(1, 0.0)[1] / BEAM_MASS), assemble(structure, ELEMENTS).contacts[0].effective_mass,
        1e-7, mesh,
    )  # fmt: skip


DAMPING = Rayleigh(ratio=(0.02, 0.03), modes=(1, 2))


def _rayleigh_ratio(square: float) -> float:
    """Damping ratio of that damping at (beta L)^2."""
    first, second = (root**2 for root in ROOTS[:2])
    alpha, beta = np.linalg.solve([[0.5 / first, 0.5 * first], [0.5 / second, 0.5 * second]], (0.02, 0.03))
    return float(0.5 * (alpha / square + beta * square))


def damping_of_mode_3() -> Iterator[Case]:
    """Rayleigh damping given at two modes, at the third."""
    structure = Structure(uniform_beam(), damping=DAMPING)
    computed = float(modes_of(structure, 3).damping_ratio[2])
    yield Case(
        "cantilever, 2 % and 3 % in modes 1 and 2", "derived here (two linear equations)", "damping ratio of mode 3",
        "1", _rayleigh_ratio(ROOTS[2] ** 2), computed, 1e-7, "the mesh and the 8 decimals of the roots",
    )  # fmt: skip


def _corrected(coefficients: bool = True) -> System:
    """One mode of the cantilever, and the residual vector of its tip; damped by two coefficients, or their matrix C."""
    ball = Impactor("ball", "tip", 0.1 * BEAM_MASS, 1e-3, Rigid(0.5))
    structure = Structure(uniform_beam(), impactors=(ball,), damping=DAMPING)
    system = assemble(structure, ELEMENTS)
    return reduce(system if coefficients else replace(system, rayleigh=None), 1, static_correction=True)


def residual_vector() -> Iterator[Case]:
    """One mode and the residual vector of the tip have the static flexibility of all modes there, L^3/(3 E I).

    The second Ritz frequency is that of the first mode and the deflection z^2 (3 - z)/2 under an end load.
    """
    from scipy.integrate import quad
    from scipy.linalg import eigh

    system = _corrected()
    direction = system.contacts[0].direction
    yield Case(
        "cantilever, one mode and its static correction", "MacNeal (1971); F L^3/(3 E I)", "flexibility at the tip",
        "m/N", LENGTH**3 / (3 * BENDING_STIFFNESS), float(direction @ (direction / system.K.diagonal())), 1e-9,
        "cubic elements are exact for end loads: rounding only",
    )  # fmt: skip
    x = _tip_body_root(1, 0.0, 0.0)
    first, second = _tip_conditions(x, 0.0, 0.0)[0]

    def mode(z: float) -> float:
        return float(_shape(x * z)[0] @ [1.0, -first / second])

    def bent(z: float) -> float:
        return 0.5 * z**2 * (3 - z)

    pairs = ((mode, mode), (mode, bent), (bent, bent))
    products = [quad(lambda z, f=f, g=g: f(z) * g(z), 0.0, 1.0, epsrel=1e-12)[0] for f, g in pairs]
    shape_shape, shape_static, static_static = products
    # the mode turns K into x^4 M; of the other, the integral of (3 - 3 z)^2 is 3
    stiffness = [[x**4 * shape_shape, x**4 * shape_static], [x**4 * shape_static, 3.0]]
    squares = eigh(stiffness, [[shape_shape, shape_static], [shape_static, static_static]], eigvals_only=True)
    root, source = float(squares[1]) ** 0.25, "derived here (Ritz, by quadrature)"
    mesh = f"the mode's (beta h)^4 of {ELEMENTS} cubic elements"
    omega = math.sqrt(float(system.K.diagonal()[1]))
    yield Case(
        "cantilever, frequency of the static correction", source, "beta L", "1", root,
        LENGTH * math.pow(omega**2 * MASS_PER_LENGTH / BENDING_STIFFNESS, 0.25), 1e-7, mesh,
    )  # fmt: skip
    for quantity, damped in (("damping", system), ("damping by C", _corrected(coefficients=False))):
        omega = math.sqrt(float(damped.K.diagonal()[1]))
        yield Case(
            f"cantilever, {quantity} of the static correction", source, "damping ratio", "1",
            _rayleigh_ratio(root**2), float(damped.C.diagonal()[1]) / (2 * omega), 1e-7, mesh,
        )  # fmt: skip


def mesh_order() -> Iterator[Case]:
    """Frequencies of cubic elements converge with the fourth power of their length."""
    computed = float(converge_elements(Structure(uniform_beam()), (4, 8, 16), modes=1).fitted_order[0])
    yield Case(
        "cantilever, mode 1 over 4, 8 and 16 elements", "Strang and Fix (1973)", "order of convergence", "1", 4.0,
        computed, 9e-3, "the next term of the error, (beta h)^6, on 4 elements",
    )  # fmt: skip


CASES = (
    tip_body,
    uniform_beams,
    stepped_beam,
    stress_of_tube,
    masses_of_modes,
    damping_of_mode_3,
    residual_vector,
    mesh_order,
)
"""The cases of this subject, in the order of the table."""
