"""What a load along the beam adds to its stiffness, and how much the balls, which are left out of it, would add."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import require
from femimpact.fem.discretisation import Discretisation
from femimpact.structure.axial import Axial
from femimpact.structure.structure import Structure
from femimpact.system.matrices import rigid_motions
from femimpact.system.modes import lowest_modes
from femimpact.system.system import System
from femimpact.units import number_text

MOST_SHIFT = 0.01
"""Share of the first frequency by which the weight of balls along the beam, which is left out, may shift it."""


def axial_forces(grid: Discretisation, load: Axial, lag: float) -> tuple[Array, list[tuple[float, float, float]]]:
    """N in every element as a polynomial in x = -1 to 1, (5, elements) in N, and (-lag m, m a(x + e) e, e) of bodies.

    With lag in 1/s^2. About its centre a body feels no spin, so that its rotary inertia has no share.
    """

    def acceleration_at(x: Any) -> Any:
        """That of a mass at distances from the root (m), in m/s^2 and positive towards the tip."""
        return load.acceleration + load.spin**2 * (load.hub + x)

    half, middle = 0.5 * np.diff(grid.mesh.nodes), 0.5 * (grid.mesh.nodes[1:] + grid.mesh.nodes[:-1])
    mass = half * grid.sections.mass_per_length * grid.sections.mass_polynomial
    pull = np.zeros((4, half.size))
    pull[:3] = acceleration_at(middle) * mass
    pull[1:] += load.spin**2 * half * mass
    # from the middle to x, and over the element
    inner = pull / np.arange(1.0, 5.0)[:, None]
    whole = 2.0 * (inner[0] + inner[2])
    beyond = load.tension + np.cumsum(whole[::-1])[::-1] - whole
    on_bodies = []
    for body in grid.structure.masses:
        place = grid.position_of(body.at, f"mass.{body.name}.at")
        force = body.mass * acceleration_at(place + body.offset)
        # a body is on a node
        beyond[middle < place] += force
        on_bodies.append((-lag * body.mass, force * body.offset, body.offset))
    return np.concatenate([[beyond + inner.sum(axis=0)], -inner]), on_bodies


def weight_words(structure: Structure, system: System) -> list[str]:
    """Words on the balls' weight along the beam, which is left out; `InputError` where it shifts f1 by over 1 %."""
    pull = structure.axial.acceleration if structure.axial is not None else 0.0
    if not pull or not system.balls:
        return []
    shift, names = weight_shift(system, pull), ", ".join(pair.name for pair in system.balls)
    by = f"would shift the first frequency by up to {number_text(100.0 * shift, 2)} %"
    words = f"the weight of {names} along the beam is left out: it {by}"
    allowed = f"must be smaller, or the balls lighter: {words}, and at most {100.0 * MOST_SHIFT:g} % may be"
    require(shift <= MOST_SHIFT, "axial.acceleration", pull, "m/s^2", allowed)
    return [f"axial.acceleration = {pull:g} m/s^2: {words}"]


def weight_shift(system: System, acceleration: float) -> float:
    """Largest relative change of the first elastic frequency by the weight of balls along the beam.

    A ball of mass m at y adds V = m g [integral of w'^2/2 from root to box + turn (y - w)] in its tilted box, and the
    first term alone while it is held on a wall. It is computed with the first elastic mode and the balls.
    """
    balls, modes = system.balls, lowest_modes(system, min(rigid_motions(system).shape[1] + 1, system.dofs))
    phi = modes.vectors[:, -1]
    mass, spring = np.array([(pair.mass, pair.free_stiffness) for pair in balls]).T
    x = np.outer([pair.position for pair in balls], np.linspace(0.0, 1.0, 2001))
    turn = (system.nodal_rows(x.ravel(), 1) @ (system.expansion @ phi)).reshape(x.shape)
    # y - w of every ball, by the mode's coordinate and the balls'
    stretch = np.column_stack([[-(pair.direction @ phi) for pair in balls], np.eye(len(balls))])
    free = stretch.T @ (spring[:, None] * stretch)
    free[0, 0] += (2.0 * math.pi * modes.natural_frequency[-1]) ** 2
    held, tilt = np.zeros((2, *free.shape))
    held[0, 0] = acceleration * mass @ np.trapezoid(turn**2, x)
    tilt[0] = (acceleration * mass * turn[:, -1]) @ stretch
    size = np.sqrt(np.append(1.0, mass))
    loads = np.array([free, free + held, free + held + tilt + tilt.T])
    values, vectors = np.linalg.eigh(loads / np.outer(size, size))
    # of the motion that has most of the mode
    square = [one[most] for one, most in zip(values, np.abs(vectors[:, 0]).argmax(axis=1), strict=True)]
    return float(np.max(np.abs(np.sqrt(np.maximum(square[1:], 0.0) / square[0]) - 1.0)))
