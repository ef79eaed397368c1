"""What a table of impacts adds up to, beside the ledger and the momentum of the same run."""

from __future__ import annotations

import math

import numpy as np

import femimpact as fi
from femimpact import core
from femimpact.excitation.excitation import Excitation


def in_progress(response: fi.response.Response) -> dict[str, tuple[float, float]]:
    """Impulse (N s, positive where the + wall pushes) and loss (J) of event-driven compliant contacts not yet over."""
    held, found = response.final_state.continuation.held, {}
    for j, pair in enumerate(response.system.contacts):
        side = float(np.sign(held.state[j]))
        if side != 0.0 and not isinstance(pair.law, fi.Rigid):
            found[pair.name] = (side * float(held.touch[core.events.PUSHED, j]), float(held.touch[core.events.LOST, j]))
    return found


def impulses(response: fi.response.Response, name: str) -> tuple[float, float]:
    """Sum of the impulses (N s) of a pair, signed by the wall and of their sizes: all impacts and sticking phases."""
    impacts, sticking = response.impacts, response.sticking
    own = np.concatenate([
        (table.side * table.impulse)[table.impactor == name] for table in (impacts, sticking)
    ])  # fmt: skip
    return float(own.sum()), float(np.abs(own).sum())


def loss_left(response: fi.response.Response) -> float:
    """Contact loss of the ledger beside that of the table and of contacts in progress, over the energy put in."""
    listed = float(response.impacts.energy_loss.sum()) + sum(loss for _, loss in in_progress(response).values())
    return abs(listed - float(response.energy.contact_loss[-1])) / response.energy.largest_input


def momentum_left(response: fi.response.Response, initial: fi.State, name: str) -> float:
    """What a ball's change of momentum leaves of all impulses on it, over the sum of their sizes.

    m (y' + ub') = m a t - sum of side x impulse, y' relative to the base, of a ball without a centring spring.
    """
    system, base = response.system, response.base
    j = [pair.name for pair in system.contacts].index(name)
    pair, begin, end = system.contacts[j], response.start, response.final_state.time
    before, after = (state.relative_to_base(system, base)[3][j] for state in (initial, response.final_state))
    moved = 0.0 if isinstance(base, fi.PointForce) else float(base.velocity(end)) - float(base.velocity(begin))
    listed, size = impulses(response, name)
    listed += in_progress(response).get(name, (0.0, 0.0))[0]
    given = pair.mass * pair.acceleration * (end - begin)
    # rounding is that of the largest speed and of the largest impulse, also of a ball that was hardly touched
    scale = size + abs(given) + pair.mass * (abs(before) + abs(after) + abs(moved) + largest_base_speed(base))
    scale += float(np.max(response.impacts.impulse, initial=0.0))
    left = abs(pair.mass * (after - before + moved) - given + listed)
    return left / scale if scale > 0.0 else left


def largest_base_speed(base: Excitation) -> float:
    """Of a sine, m/s; 0 for others."""
    return base.amplitude * 2.0 * math.pi * base.frequency if isinstance(base, fi.Sine) else 0.0
