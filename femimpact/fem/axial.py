"""What a load along the beam adds to its stiffness, and how much of it the balls would have."""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sparse

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, require
from femimpact.fem.discretisation import Discretisation
from femimpact.structure.axial import Axial
from femimpact.structure.structure import Structure
from femimpact.system.hermite import hermite_rows
from femimpact.system.matrices import Matrix, factor_of_sum, rigid_motions
from femimpact.system.modes import lowest_modes
from femimpact.system.system import System
from femimpact.units import number_text

MOST_SHIFT = 0.01
"""Share of the first frequency by which the balls' weight along the beam may shift it, as runs leave it out."""


def normal_force(grid: Discretisation, load: Axial) -> Array:  # (5, elements) N
    """N in every element as a polynomial in x = -1 to 1: its coefficients by powers; it jumps at bodies, on nodes."""
    half, middle = 0.5 * np.diff(grid.mesh.nodes), 0.5 * (grid.mesh.nodes[1:] + grid.mesh.nodes[:-1])
    mass = half * grid.sections.mass_per_length * grid.sections.mass_polynomial
    pull = np.zeros((4, half.size))
    pull[:3] = load.acceleration_at(middle) * mass
    pull[1:] += load.spin**2 * half * mass
    # from the middle to x, and over the element
    inner = pull / np.arange(1.0, 5.0)[:, None]
    whole = 2.0 * (inner[0] + inner[2])
    beyond = load.tension + np.cumsum(whole[::-1])[::-1] - whole
    for body in grid.structure.masses:
        place = grid.position_of(body.at, f"mass.{body.name}.at")
        beyond[middle < place] += body.mass * load.acceleration_at(place + body.offset)
    return np.concatenate([[beyond + inner.sum(axis=0)], -inner])


def turned_bodies(grid: Discretisation, load: Axial) -> Matrix:  # csr_array (dofs, dofs)
    """Sum of mass a(x + offset) offset w'^2; in the plane of rotation with the rotary inertia, of which M has too much.

    There spin^2 M is taken away, and a body's rotary inertia about its centre feels no spin.
    """
    bodies = grid.structure.masses
    places = [grid.position_of(body.at, f"mass.{body.name}.at") for body in bodies]
    lag = load.spin**2 * (load.spin_plane == "lag")
    moments = [
        body.mass * load.acceleration_at(place + body.offset) * body.offset + lag * body.rotary_inertia
        for body, place in zip(bodies, places, strict=True)
    ]
    turn = hermite_rows(grid.mesh.nodes, places, derivative=1)
    return sparse.csr_array(turn.T @ sparse.diags_array(np.array(moments)) @ turn)


def standing_factor(
    load: Axial,
    factor: Matrix,  # G of the unloaded structure on the free dofs
    added: Matrix,  # stiffness of the load there
) -> Matrix:
    """G of the loaded structure; `InputError` where it has buckled, with the share of the load at which it does."""
    unloaded = sparse.csr_array(factor.T @ factor)

    def loaded(share: float) -> Matrix | None:
        return factor_of_sum(factor, share * added, sparse.csr_array(unloaded + share * added))

    whole = loaded(1.0)
    if whole is not None:
        return whole
    low, high = 0.0, 1.0
    while high - low > 1e-5:
        share = 0.5 * (low + high)
        low, high = (low, share) if loaded(share) is None else (share, high)
    allowed = f"must be at most {number_text(low, 5)} of this load, at which the beam buckles"
    raise InputError([Fault("axial", load, "", allowed)])


def weight_words(structure: Structure, system: System) -> list[str]:
    """Words on the weight of balls and absorbers along the beam, which is left out: by how much it would shift f1.

    Raises `InputError` where that is more than `MOST_SHIFT`.
    """
    if structure.axial is None or not structure.axial.acceleration or not system.balls:
        return []
    value, shift = structure.axial.acceleration, weight_shift(system, structure.axial.acceleration)
    names = ", ".join(pair.name for pair in system.balls)
    words = f"the weight of {names} along the beam is left out: it would shift the first frequency by up to"
    text = f"{words} {number_text(100.0 * shift, 2)} %"
    fault = f"must be smaller, or the balls lighter: {text}, and at most {100.0 * MOST_SHIFT:g} % may be"
    require(shift <= MOST_SHIFT, "axial.acceleration", value, "m/s^2", fault)
    return [f"axial.acceleration = {value:g} m/s^2: {text}"]


def weight_shift(system: System, acceleration: float) -> float:
    """Largest relative change of the first elastic frequency by the weight of balls along the beam.

    A ball of mass m at y adds V = m g [integral of w'^2/2 from root to box + turn (y - w)] in its tilted box, and the
    first term alone while it is held on a wall. It is computed with the first elastic mode and the balls.
    """
    modes = lowest_modes(system, min(rigid_motions(system).shape[1] + 1, system.dofs))
    phi, balls = modes.vectors[:, -1], system.balls
    nodal = system.expansion @ phi
    mass = np.array([1.0, *(pair.mass for pair in balls)])
    free, held, tilted = np.zeros((3, mass.size, mass.size))
    free[0, 0] = (2.0 * math.pi * modes.natural_frequency[-1]) ** 2
    for j, pair in enumerate(balls, start=1):
        x = np.linspace(0.0, pair.position, 2001)
        slope = hermite_rows(system.nodes, x, derivative=1) @ nodal
        deflection, weight = float(pair.direction @ phi), pair.mass * acceleration
        stretch = np.zeros(mass.size)
        stretch[[0, j]] = -deflection, 1.0
        free += pair.free_stiffness * np.outer(stretch, stretch)
        held[0, 0] += weight * np.trapezoid(slope**2, x)
        tilted[0] += weight * slope[-1] * stretch
        tilted[:, 0] += weight * slope[-1] * stretch

    def square(stiffness: Array) -> float:
        """Omega^2 of the motion that has most of the mode."""
        values, vectors = np.linalg.eigh(stiffness / np.sqrt(np.outer(mass, mass)))
        return float(values[np.argmax(np.abs(vectors[0]))])

    loaded = (square(free + held), square(free + held + tilted))
    return max(abs(math.sqrt(max(one / square(free), 0.0)) - 1.0) for one in loaded)
