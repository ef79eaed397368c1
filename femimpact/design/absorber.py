"""The absorber of a given mass that leaves a structure on a moving base the smallest resonance of its first mode."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg
from scipy.optimize import minimize

from femimpact.arrays import Array, Complex
from femimpact.errors import LARGEST, choice, instance, place, quantity, require, takes, text
from femimpact.fem.assembly import assemble
from femimpact.structure.structure import Absorber, Position, Structure
from femimpact.system.modes import solve_modes
from femimpact.system.state import STILL
from femimpact.system.system import System

BAND = (0.3, 2.0)
"""Lowest and highest frequency of the search, over that of the first mode."""

POINTS = 400
"""Frequencies of the search around both peaks, and half as many over the band."""

RATIOS = (1e-6, 1.0)
"""Masses of absorbers that are looked for, over that of the first mode at their place."""


@takes(
    structure=instance(Structure), mass=quantity("kg", above=0.0, at_most=LARGEST), at=place(), name=text(),
    elements=quantity("1", at_least=1, integer=True), under=choice("base", "force"),
)  # fmt: skip
def tuned_absorber(
    structure: Structure,
    mass: float,
    at: Position = "tip",
    *,
    name: str = "absorber",
    elements: int = 20,
    under: str = "base",
) -> Absorber:
    """The absorber whose spring and dashpot leave the smallest resonance of the first mode.

    Parameters
    ----------
    structure : Structure
        Of its contacts balls and stops are left out; absorbers that it has stay as they are.
    mass : float, kg
        Of the absorber's body.
    at : str or float
        Where it stands: "root", "tip", "mid", a body's name, or metres from the root.
    name : str
        Of the absorber.
    elements : int
        Of the mesh on which the response is computed.
    under : {"base", "force"}
        What drives the structure: a sine of the base, or a sine force at the absorber's place.

    Returns
    -------
    Absorber
        With it the largest steady displacement of the place relative to the base, over all frequencies of a sine of
        the base of one displacement amplitude, or of a force of one amplitude, around the first mode, is the smallest
        that any stiffness and damping leave.

    Raises
    ------
    InputError
        If the structure is not held, the place is at rest in its first mode, or the mass is below 1e-6 or above 1 of
        that of the mode there.

    Notes
    -----
    A body of mass m on k and c pulls on its place with D (w + ub), D = m omega^2 (k + i omega c)/(k + i omega c -
    m omega^2). With the response of the structure alone to the base, R ub, and to a force at the place, G, that leaves
    w = (R + G D)/(1 - G D) ub, in closed form. Its largest value is minimised over k and c from the optimum of an
    undamped mass under an acceleration of its base (Warburton, 1982): with the mass ratio mu = m phi1^2 a frequency of
    sqrt(1 - mu/2)/(1 + mu) of the first one, and a damping ratio of sqrt(3 mu/(4 (1 + mu)(2 - mu))). Those numbers are
    for one acceleration at all frequencies; one displacement amplitude weighs the upper of the two peaks more, and the
    structure is damped. Under a force at the place w = G/(1 - G D) F, of which the optimum of an undamped mass is near
    a frequency of 1/(1 + mu) and a damping ratio of sqrt(3 mu/(8 (1 + mu))) (Brock, 1946).

    Examples
    --------
    >>> import femimpact as fi
    >>> absorber = fi.tuned_absorber(structure, mass=2e-3, at="tip")
    >>> damped = fi.Structure(structure.beam, structure.masses, damping=structure.damping, absorbers=[absorber])
    >>> damped.absorbers[0].mass
    0.002
    """
    system = assemble(structure, elements)
    row = system.point_row(at)
    held = system.first_frequency > 0.0
    require(held, "structure", "with rigid motions", "", "must be held: a mechanism has no first mode to damp")
    modes = solve_modes(system, min(2, system.dofs))
    first, shape = 2.0 * math.pi * float(modes.natural_frequency[0]), modes.vectors[:, 0]
    moved = abs(float(row @ shape))
    still = moved <= STILL * float(np.linalg.norm(row) * np.linalg.norm(shape))
    require(not still, "at", at, "", "must be a place that moves in mode 1")
    ratio, (least, most) = mass * moved**2, RATIOS
    allowed = (
        f"must be {least / moved**2:.4g} to {most / moved**2:.4g} kg: the mass of mode 1 there is {moved**-2:.4g} kg"
    )
    require(least <= ratio <= most, "mass", mass, "kg", allowed)
    following = 2.0 * math.pi * float(modes.natural_frequency[-1])
    # halfway to the second mode, on a scale of octaves, its own resonance begins
    highest = min(BAND[1], math.sqrt(following / first)) if system.dofs > 1 else BAND[1]
    # the peaks of a light absorber lie sqrt(mu) apart, or within the width of the structure's own
    around = 2.0 * max(math.sqrt(ratio), float(modes.damping_ratio[0])) * np.linspace(-1.0, 1.0, POINTS)
    shares = np.concatenate([1.0 + around, np.linspace(BAND[0], highest, POINTS // 2)])
    omega = first * shares[(shares >= BAND[0]) & (shares <= highest)]
    to_base, to_force = _structure_alone(system, row, omega)
    # of a force over the static displacement of the mode
    driven, carried = (to_base, to_force) if under == "base" else (mass / ratio * first**2 * to_force, 0.0)
    start = math.sqrt(1.0 - 0.5 * ratio) / (1.0 + ratio), math.sqrt(0.75 * ratio / ((1.0 + ratio) * (2.0 - ratio)))

    def largest(logarithms: Array) -> float:
        tuning, damped = np.exp(logarithms)
        pull = _pull(mass, mass * (tuning * first) ** 2, 2.0 * damped * mass * tuning * first, omega)
        return float(np.abs((driven + carried * pull) / (1.0 - to_force * pull)).max())

    best = np.log(start)
    # the largest of two peaks has an edge where they are equal, on which one simplex may come to rest
    for size in (0.1, 0.02, 0.005):
        simplex = best + size * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        options: Any = {"initial_simplex": simplex, "xatol": 1e-6, "fatol": 1e-9, "maxiter": 400}
        best = minimize(largest, best, method="Nelder-Mead", options=options).x
    tuning, damped = (float(value) for value in np.exp(best))
    return Absorber(name, at, mass, mass * (tuning * first) ** 2, 2.0 * damped * mass * tuning * first)


def _pull(mass: float, stiffness: float, damping: float, omega: Array) -> Complex:
    """D (N/m): force of an absorber on its place over the absolute displacement there, at angular frequencies."""
    hung = stiffness + 1j * omega * damping
    inertia = mass * omega**2
    return np.asarray(inertia * hung / (hung - inertia))


def _structure_alone(system: System, row: Array, omega: Array) -> tuple[Complex, Complex]:
    """Displacement of a place over that of the base, and over a force there (m/N), at angular frequencies (rad/s)."""
    others = [pair for pair in system.contacts if pair.kind == "absorber"]
    answers = np.empty((omega.size, 2), dtype=complex)
    for i, w in enumerate(omega):
        matrix = sparse.csc_array(system.K + 1j * w * system.C - w**2 * system.M)
        load = w**2 * np.asarray(system.base_load, dtype=complex)
        for pair in others:
            pull = _pull(pair.mass, pair.free_stiffness, pair.free_damping, np.array([w]))[0]
            matrix = matrix - pull * sparse.csc_array(np.outer(pair.direction, pair.direction))
            load = load + pull * pair.direction
        answers[i] = row @ scipy.sparse.linalg.spsolve(matrix, np.column_stack([load, row])).reshape(-1, 2)
    return answers[:, 0], answers[:, 1]
