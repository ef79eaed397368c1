"""Static equilibrium of structure, balls and stops under constant forces: contacts push, and never pull.

K u = f + sum_j b_j F_j. A ball at rest passes all of its constant force on, F_j = m_j g_j, whichever of spring and wall
carries it. Walls of stops, with p_i their penetration and c_i the compliance of their law, are the complementarity
problem 0 <= F_i, p_i <= c_i F_i, one of them with equality.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from femimpact.arrays import Array
from femimpact.contact.laws import KELVIN_VOIGT, POWER, RIGID, ContactParameters
from femimpact.errors import checked, kind_of, quantity, require
from femimpact.system.contact_pair import ContactPair
from femimpact.system.matrices import (
    rigid_motions,
    stiffness_solver,
)

EXACT = 1e-9
"""Residual, as a share of the largest term, that rounding may leave of a complementarity problem."""

MOST_ROUNDS = 200

LAWS = "must be Rigid, KelvinVoigt or a power law without loss for a static state that presses it"


class StaticContacts(NamedTuple):
    """A static state with its contact forces."""

    displacement: Array  # (dofs,) m
    other: Array  # (pairs,) y: the balls' displacements, and of stops the one given; m
    normal: Array  # (pairs,) force of the walls, positive at the + wall; N
    depth: Array  # (pairs,) penetration >= 0 of compliant walls; m


def static_state(system: Any, stop_displacement: float = 0.0) -> tuple[Array, Array]:
    """Displacements of structure and balls at rest under constant forces and contacts, relative to the base.

    Parameters
    ----------
    system : System
    stop_displacement : float, m
        y of the stops that are fixed in space: the base's displacement at that time.

    Returns
    -------
    u : ndarray (dofs,), m
    y : ndarray (pairs,), m
        Of every pair; x = y - b @ u is what its gaps bound. A ball that a constant force presses rests on its
        wall, one that nothing holds is in the middle, x = 0. Rigid motions r that nothing holds have no share,
        r^T M u = 0.

    Raises
    ------
    InputError
        If the constant load does work on a rigid motion that nothing holds, a pressed contact's law has no static
        force, a ball has neither wall nor spring against its constant force, or rigid walls leave the structure no
        place.

    Notes
    -----
    With D the directions of the walls, A = D^T K^-1 D and q the penetrations without contact, the forces minimise
    F^T (A + diag c) F / 2 - q^T F over F >= 0 (the dual of the least potential energy; Cottle, Pang and Stone, The
    Linear Complementarity Problem, 1992). As a problem of least distance it is one of non-negative least squares
    (Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23), which finds the walls that push, also where
    there are more of them than dofs; one linear system of these gives the forces. A power law is made linear at the
    last penetration until the forces stay (Newton).
    """
    contacts = static_contacts(system, stop_displacement)
    return contacts.displacement, contacts.other


def static_contacts(system: Any, stop_displacement: float = 0.0) -> StaticContacts:
    """The same with the contact forces; see `static_state`."""
    fits = all(hasattr(system, name) for name in ("stiffness_factor", "constant_load", "contacts"))
    require(fits, "system", kind_of(system), "", "must be a System")
    offset = checked("stop_displacement", stop_displacement, quantity("m"))
    pairs = system.contacts
    rigid = rigid_motions(system)
    held = system.first_frequency > 0.0 or rigid.shape[1] > 0
    require(held, "initial", "static", "", "needs a structure that is held: K is singular, a static state is not one")
    solve = stiffness_solver(system)
    x, normal, depth, y = np.zeros((4, len(pairs)))
    load = np.array(system.constant_load)
    loaded = [pair.name for pair in pairs if not pair.is_stop and pair.acceleration]
    allowed = f"is not known of balls that meet under a constant force, {', '.join(loaded)}: run until they rest"
    require(not (loaded and system.meetings), "initial", "static", "", allowed)
    for j, pair in enumerate(pairs):
        if pair.is_stop:
            y[j] = offset if pair.fixed_to == "space" else 0.0
            plain = pair.free_stiffness == 0.0 and not getattr(pair.law, "free_stiffness", 0.0)
            require(plain, f"{pair.name}.contact", pair.law.name, "", LAWS)
        else:
            x[j], normal[j], depth[j] = _ball_at_rest(pair)
            load += pair.direction * (pair.mass * pair.acceleration)
    _require_no_work(rigid, load, system.M.diagonal())
    u = solve(load)
    walls = [
        (j, side, gap)
        for j, pair in enumerate(pairs) if pair.kind == "stop"
        for side, gap in zip((1.0, -1.0), pair.gaps, strict=True) if math.isfinite(gap)
    ]  # fmt: skip
    if walls:
        u = _pushed(system, walls, solve, u, y, normal, depth)
    pressed = [pair.name for j, pair in enumerate(pairs) if pair.is_stop and normal[j] != 0.0]
    allowed = f"needs a structure that is held where stops press it, {', '.join(pressed)}: K is singular, a mechanism"
    require(not pressed or not rigid.size, "initial", "static", "", allowed)
    for j, pair in enumerate(pairs):
        if not pair.is_stop:
            y[j] = x[j] + pair.direction @ u
    for j, (first, second) in system.meetings.items():
        y[j] = y[first] - y[second]
    return StaticContacts(u, y, normal, depth)


def _require_no_work(rigid: Array, load: Array, mass: Array) -> None:
    """Raise where a constant load would set a mechanism going."""
    # r^T M r = 1, and so the work goes with the load over the root of the mass
    still = np.abs(rigid.T @ load) <= EXACT * np.linalg.norm(load / np.sqrt(mass))
    allowed = (
        "needs a structure that is held: K is singular, as a mechanism leaves a rigid motion free, on which the "
        "constant load does work"
    )
    require(bool(np.all(still)), "initial", "static", "", allowed)


def _ball_at_rest(pair: ContactPair) -> tuple[float, float, float]:
    """Place x (m) of a ball at rest, the force of its walls (N, positive at the + wall) and its penetration (m)."""
    load = pair.mass * pair.acceleration
    spring = pair.free_stiffness + getattr(pair.law, "free_stiffness", 0.0)
    if load == 0.0:
        return 0.0, 0.0, 0.0
    side = math.copysign(1.0, load)
    gap = pair.gaps[0] if side > 0.0 else pair.gaps[1]
    if abs(load) <= spring * gap:
        return load / spring, 0.0, 0.0
    held = math.isfinite(gap)
    require(held, f"{pair.name}.gaps", pair.gaps, "m", "must be finite where a constant force presses the ball")
    parameters, pressed = pair.parameters, abs(load) - spring * gap
    _require_static(pair)
    if parameters.kind == RIGID:
        return side * gap, side * pressed, 0.0
    if parameters.kind == KELVIN_VOIGT:
        depth = pressed / (parameters.stiffness + spring)
    else:
        depth = (pressed / parameters.stiffness) ** (1.0 / parameters.exponent)
        if spring > 0.0:
            from scipy.optimize import brentq

            k, n = parameters.stiffness, parameters.exponent
            depth = brentq(lambda p: k * p**n + spring * p - pressed, 0.0, depth, xtol=1e-300, rtol=1e-15)
    return side * (gap + depth), side * (pressed - spring * depth), depth


def _is_static(pair: ContactPair) -> bool:
    """True if a law has a force at rest that follows from its penetration alone."""
    kind = pair.parameters.kind
    return kind in (RIGID, KELVIN_VOIGT) or (kind == POWER and pair.parameters.damping == 0.0)


def _require_static(pair: ContactPair) -> None:
    require(_is_static(pair), f"{pair.name}.contact", pair.law.name, "", LAWS)


def _pushed(
    system: Any,
    walls: list[tuple[int, float, float]],  # of stops: number of the pair, side and gap (m)
    solve: Callable[[Array], Array], u: Array, y: Array, normal: Array, depth: Array,
) -> Array:  # fmt: skip
    """Displacements with the forces of the stops' walls, which are written into `normal` and `depth`."""
    pairs = system.contacts
    directions = np.array([side * pairs[j].direction for j, side, _ in walls])
    shift = np.array([side * y[j] - gap for j, side, gap in walls])
    displacements = solve(directions.T)
    compliance = directions @ displacements
    compliance = 0.5 * (compliance + compliance.T)
    laws = [pairs[j].parameters for j, _, _ in walls]
    known = np.array([_is_static(pairs[j]) for j, _, _ in walls])
    force = np.zeros(len(walls))
    if np.any(known):
        names = ", ".join(dict.fromkeys(pairs[j].name for j, _, _ in walls))
        chosen = [law for law, fine in zip(laws, known, strict=True) if fine]
        free = (shift - directions @ u)[known]
        force[known] = _forces_of_laws(chosen, compliance[np.ix_(known, known)], free, names)
    u = u + displacements @ force
    overlap = shift - directions @ u
    rigid = (force > 0.0) & np.array([law.kind == RIGID for law in laws])
    if np.any(rigid):
        # once more for what rounding has left of the gaps
        more = np.linalg.lstsq(compliance[np.ix_(rigid, rigid)], overlap[rigid])[0]
        u = u + displacements[:, rigid] @ more
        overlap = shift - directions @ u
    for i, (j, side, _) in enumerate(walls):
        if not known[i] and overlap[i] > 0.0:
            _require_static(pairs[j])
        if force[i] > 0.0:
            normal[j] = side * force[i]
            depth[j] = 0.0 if laws[i].kind == RIGID else max(overlap[i], 0.0)
    return u


def _forces_of_laws(laws: list[ContactParameters], compliance: Array, free: Array, names: str) -> Array:
    """Forces (N) of the walls by their laws; `free` is the penetration (m) of each without any contact."""
    stiffness = np.array([law.stiffness for law in laws])
    exponent = np.array([law.exponent for law in laws])
    curved = np.array([law.kind == POWER and law.exponent != 1.0 for law in laws])
    softness = np.where(curved, 0.0, 1.0 / stiffness)
    if not np.any(curved):
        return _complementary(compliance, softness, free, names)
    k, n = stiffness[curved], exponent[curved]
    force, before = np.zeros((2, free.size))
    # from above: where the force bends upwards, Newton's steps do not overshoot
    depth = np.full(k.size, np.max(np.abs(free)))
    for _ in range(MOST_ROUNDS):
        depth = np.maximum(depth, 1e-12 * (np.max(np.abs(free)) + 1e-300))
        elastic, slope = k * depth**n, k * n * depth ** (n - 1.0)
        softness[curved] = 1.0 / slope
        moved = free.copy()
        moved[curved] -= depth - elastic / slope
        before, force = force, _complementary(compliance, softness, moved, names)
        depth = (free - compliance @ force)[curved]
        if np.max(np.abs(force - before)) <= 1e-14 * np.max(np.abs(force)):
            return force
    # an open wall may keep its bound on the depth from settling in the last digit
    small = np.max(np.abs(force - before)) <= EXACT * np.max(np.abs(force))
    require(bool(small), "initial", "static", "", f"is not found for the power laws of {names}")
    return force


def _complementary(compliance: Array, softness: Array, free: Array, names: str) -> Array:
    """F >= 0 with (A + diag c) F >= q and equality where F > 0.

    Raises `InputError` if there is none: rigid walls that leave the structure no place.
    """
    total = compliance + np.diag(softness)
    scale = np.sqrt(np.maximum(np.diag(total), 0.0))
    yielding = scale > 0.0
    size = np.max(np.abs(free))
    # a wall where nothing yields has no force to be found: it must not be pressed
    fine = bool(np.all(free[~yielding] <= EXACT * size))
    force = np.zeros(free.size)
    if fine and np.any(free > 0.0):
        part = total[np.ix_(yielding, yielding)] / np.outer(scale[yielding], scale[yielding])
        target = free[yielding] / scale[yielding]
        solved, fine = _solved(part, target)
        force[yielding] = solved / scale[yielding]
    allowed = f"is not one: the rigid stops among {names} leave the structure no place"
    require(fine, "initial", "static", "", allowed)
    return force


def _solved(part: Array, target: Array) -> tuple[Array, bool]:
    """Solution of the problem with ones on its diagonal, and True where one was found.

    F are the multipliers of the least |z| with H^T z >= q, where H^T H is the matrix: with x >= 0 of the least
    |[H; q^T] x - [0; 1]|, F = x/(1 - q^T x), and there is none where 1 - q^T x = 0.
    """
    from scipy.optimize import nnls

    values, vectors = scipy.linalg.eigh(part)
    factor = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    scaled = target / target.max()
    ahead = np.append(np.zeros(target.size), 1.0)
    guess = nnls(np.vstack([factor, scaled]), ahead, maxiter=100 * target.size)[0]
    active = guess > 0.0
    force = np.zeros(target.size)
    if 1.0 - float(scaled @ guess) <= EXACT:
        return force, False
    for _ in range(10 * target.size + 10):
        force = np.zeros(target.size)
        if np.any(active):
            force[active] = np.linalg.lstsq(part[np.ix_(active, active)], target[active])[0]
        left = target - part @ force
        pull, press = np.where(active, -force, 0.0), left
        if pull.max() > EXACT * np.abs(force).max():
            active[np.argmax(pull)] = False
        elif press.max() > EXACT * np.abs(target).max():
            worst = int(np.argmax(press))
            if active[worst]:
                return force, False
            active[worst] = True
        else:
            return np.maximum(force, 0.0), True
    return force, False
