"""What a load along the beam adds to its stiffness, and how much the balls, which are left out of it, would add."""

from __future__ import annotations

import math

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import require
from femimpact.fem.discretisation import Discretisation
from femimpact.structure.axial import Axial
from femimpact.structure.structure import Structure
from femimpact.system.hermite import hermite_rows
from femimpact.system.matrices import rigid_motions
from femimpact.system.modes import lowest_modes
from femimpact.system.system import System
from femimpact.units import number_text

MOST_SHIFT = 0.01
"""Share of the first frequency by which the weight of balls along the beam, which is left out, may shift it."""


def axial_forces(grid: Discretisation, load: Axial) -> tuple[Array, Array]:
    """N in every element as a polynomial in x = -1 to 1, (5, elements) in N, and m a(x + e) e of every body, N m."""
    half, middle = 0.5 * np.diff(grid.mesh.nodes), 0.5 * (grid.mesh.nodes[1:] + grid.mesh.nodes[:-1])
    mass = half * grid.sections.mass_per_length * grid.sections.mass_polynomial
    pull = np.zeros((4, half.size))
    pull[:3] = load.acceleration_at(middle) * mass
    pull[1:] += load.spin**2 * half * mass
    # from the middle to x, and over the element
    inner = pull / np.arange(1.0, 5.0)[:, None]
    whole = 2.0 * (inner[0] + inner[2])
    beyond = load.tension + np.cumsum(whole[::-1])[::-1] - whole
    moments = np.zeros(len(grid.structure.masses))
    for j, body in enumerate(grid.structure.masses):
        place = grid.position_of(body.at, f"mass.{body.name}.at")
        force = body.mass * load.acceleration_at(place + body.offset)
        # a body is on a node
        beyond[middle < place] += force
        moments[j] = force * body.offset
    return np.concatenate([[beyond + inner.sum(axis=0)], -inner]), moments


def weight_words(structure: Structure, system: System) -> list[str]:
    """Words on the weight of balls and absorbers along the beam, which is left out: by how much it would shift f1.

    Raises `InputError` where that is more than `MOST_SHIFT`.
    """
    if structure.axial is None or not structure.axial.acceleration or not system.balls:
        return []
    value, names = structure.axial.acceleration, ", ".join(pair.name for pair in system.balls)
    shift = weight_shift(system, value)
    percent = f"{number_text(100.0 * shift, 2)} %"
    words = f"the weight of {names} along the beam is left out: it would shift the first frequency by up to {percent}"
    allowed = f"must be smaller, or the balls lighter: {words}, and at most {100.0 * MOST_SHIFT:g} % may be"
    require(shift <= MOST_SHIFT, "axial.acceleration", value, "m/s^2", allowed)
    return [f"axial.acceleration = {value:g} m/s^2: {words}"]


def weight_shift(system: System, acceleration: float) -> float:
    """Largest relative change of the first elastic frequency by the weight of balls along the beam.

    A ball of mass m at y adds V = m g [integral of w'^2/2 from root to box + turn (y - w)] in its tilted box, and the
    first term alone while it is held on a wall. It is computed with the first elastic mode and the balls.
    """
    balls, modes = system.balls, lowest_modes(system, min(rigid_motions(system).shape[1] + 1, system.dofs))
    phi = modes.vectors[:, -1]
    mass, spring = np.array([(pair.mass, pair.free_stiffness) for pair in balls]).T
    x = np.outer([pair.position for pair in balls], np.linspace(0.0, 1.0, 2001))
    turn = (hermite_rows(system.nodes, x.ravel(), derivative=1) @ (system.expansion @ phi)).reshape(x.shape)
    # y - w of every ball, by the mode's coordinate and the balls'
    stretch = np.column_stack([[-(pair.direction @ phi) for pair in balls], np.eye(len(balls))])
    free, held, tilt = np.zeros((3, len(balls) + 1, len(balls) + 1))
    free[0, 0] = (2.0 * math.pi * modes.natural_frequency[-1]) ** 2
    free += stretch.T @ (spring[:, None] * stretch)
    held[0, 0] = acceleration * mass @ np.trapezoid(turn**2, x)
    tilt[0] = (acceleration * mass * turn[:, -1]) @ stretch
    size = np.sqrt(np.append(1.0, mass))

    def square(stiffness: Array) -> float:
        """Omega^2 of the motion that has most of the mode."""
        values, vectors = np.linalg.eigh(stiffness / np.outer(size, size))
        return max(float(values[np.argmax(np.abs(vectors[0]))]), 0.0)

    loaded = (square(free + held), square(free + held + tilt + tilt.T))
    return max(abs(math.sqrt(one / square(free)) - 1.0) for one in loaded)
