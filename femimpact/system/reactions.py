"""Reactions of supports: the rows of the equations of motion at the dofs that the supports hold.

For all dofs of the basis, held ones included, with R the reactions (zero at free dofs),

M (u'' + r ub'') + C u' + K u = f + sum_j b_j F_j + R.

The rows of the held dofs, where u = 0 relative to the base, read R from what the free dofs do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, choice, column, optional, quantity, require, require_type

__all__ = ["Reaction", "check_reactions", "damped_reactions", "reduced_reactions", "unloaded_reactions"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reaction:
    """Force or moment of one support on the structure, as a linear reading of its motion.

    reaction = on_acceleration @ u'' + on_velocity @ u' + on_displacement @ u + on_base_acceleration ub'' - constant
    - (forces on the held dof itself: `System.contact_shares`, `System.held_shares`)

    A force is positive along +w and a moment along +dw/dx; see `femimpact.system.sections`. It is the force of this
    one support. The sum over all supports is not the force of the shaker where damping in proportion to the mass
    (alpha of Rayleigh), terms that a user adds or an elastic foundation also act between structure and base.

    With modes left out (`reduce`), this reads the held rows of the kept modes. The sum of the inertia and contact
    forces of the kept modes is another number: both tend to the reaction as modes are added, at different rates.

    Parameters
    ----------
    dof : int, optional
        Number of the held dof on the basis (2 node for w, 2 node + 1 for dw/dx); None for a spring or dashpot to
        the base, which holds none.
    unit : {"N", "N m"}
        Of a force, or of a moment.
    on_acceleration : ndarray (dofs,)
        Row of M (a force: kg and, of slopes, kg m; a moment: kg m and kg m^2).
    on_velocity : ndarray (dofs,)
        Row of C (a force: N s/m, N s).
    on_displacement : ndarray (dofs,)
        Row of K (a force: N/m, N).
    on_base_acceleration : float
        Entry of M r (a force: kg; a moment: kg m), M_hf r_f + M_hh r_h.
    constant : float
        Constant load on the held dof (a force: N; a moment: N m).

    Raises
    ------
    InputError
        If a value is out of range, or the rows are not equally long.
    """

    dof: int | None = field(metadata=optional(quantity("", at_least=0, integer=True)))
    unit: str = field(metadata=choice("N", "N m"))
    on_acceleration: Array = field(metadata=column("kg", "dofs", finite=True))
    on_velocity: Array = field(metadata=column("N s/m", "dofs", finite=True))
    on_displacement: Array = field(metadata=column("N/m", "dofs", finite=True))
    on_base_acceleration: float = field(metadata=quantity("kg"))
    constant: float = field(default=0.0, metadata=quantity("N"))

    def __post_init__(self) -> None:
        check_fields(self)


def damped_reactions(reactions: Mapping[str, Reaction], alpha: float, beta: float) -> dict[str, Reaction]:
    """The same reactions with C = alpha M + beta K (1/s, s), whose rows at held dofs follow from those of M and K."""
    return {
        name: _with_row(item, on_velocity=_row(alpha * item.on_acceleration + beta * item.on_displacement))
        for name, item in reactions.items()
    }


def _with_row(item: Reaction, **rows: Array) -> Reaction:
    """The same reaction with rows that follow from its own: the checks would take longer than making them."""
    copied = object.__new__(Reaction)
    copied.__dict__.update(item.__dict__ | rows)
    return copied


def reduced_reactions(reactions: Mapping[str, Reaction], phi: Array) -> dict[str, Reaction]:
    """The same reactions read from modal coordinates q, u = phi q, with phi (dofs, modes)."""
    return {
        name: replace(
            item,
            on_acceleration=_row(item.on_acceleration @ phi),
            on_velocity=_row(item.on_velocity @ phi),
            on_displacement=_row(item.on_displacement @ phi),
        )
        for name, item in reactions.items()
    }


def unloaded_reactions(reactions: Mapping[str, Reaction]) -> dict[str, Reaction]:
    """The same reactions without a constant load on the held dofs."""
    return {name: replace(item, constant=0.0) for name, item in reactions.items()}


def check_reactions(reactions: Any, dofs: int) -> None:
    """Refuse what is no mapping of names to reactions with rows of this many dofs."""
    require_type(reactions, Mapping, "reactions")
    for name, item in reactions.items():
        require_type(name, str, "reactions")
        require_type(item, Reaction, f"reactions.{name}")
        allowed = f"must have rows of {dofs} entries, one for each dof"
        require(item.on_displacement.size == dofs, f"reactions.{name}", item.on_displacement.size, "", allowed)


def _row(values: ArrayLike) -> Array:
    row = np.array(values, dtype=float)
    row.setflags(write=False)
    return row
