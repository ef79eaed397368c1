"""Systems whose fields were computed from one another: the checks of a whole system are left out.

They take longer than a short run does. Only infinite numbers are refused: values may be too large.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np
import scipy.sparse as sparse

from femimpact.errors import check_fields, require
from femimpact.system.consistency import TOGETHER, SystemOrigin
from femimpact.system.contact_pair import ContactPair
from femimpact.system.matrices import FINITE, diagonal_matrix
from femimpact.system.reactions import damped_reactions
from femimpact.system.system import System

__all__ = ["computed_system", "with_checked_fields", "with_checked_pairs", "with_modal_damping"]

FIELDS = tuple(item.name for item in fields(System))

UNDAMPED = ("M", "K", "stiffness_factor", "nodes", "expansion", "sections")
"""Fields that `System.derived_undamped` follows from."""


def computed_system(**values: Any) -> System:
    """The system with these fields, all but `computed_together`, as they follow from sound input.

    Raises
    ------
    InputError
        If a number is infinite.
    """
    system = object.__new__(System)
    system.__dict__.update(values)
    check_fields(system)
    _require_finite(values.items())
    return _together(system, values["contacts"])


def with_checked_fields(system: System, **changes: Any) -> System:
    """The same system with other fields that were computed together.

    Raises
    ------
    InputError
        If a number is infinite.
    """
    _require_finite(changes.items())
    origin = system.computed_together
    return _together(_copy(system, **changes), changes.get("contacts", origin.contacts if origin else ()))


def with_checked_pairs(system: System, contacts: tuple[ContactPair, ...]) -> System:
    """The same system with other numbers of its pairs, which were checked when they were made: no more is checked."""
    return _copy(system, contacts=contacts)


def with_modal_damping(system: System, alpha: float, beta: float) -> System:
    """The same system, on its modes, with C = alpha M + beta K (1/s, s), both >= 0."""
    C = diagonal_matrix(alpha * system.M.diagonal() + beta * system.K.diagonal())
    reactions = damped_reactions(system.reactions, alpha, beta)
    return with_checked_fields(system, C=C, rayleigh=(alpha, beta), reactions=reactions)


def _require_finite(values: Iterable[tuple[str, Any]]) -> None:
    for name, value in values:
        numbers: Any = value.data if sparse.issparse(value) else value  # type: ignore[attr-defined]
        sound = not isinstance(numbers, np.ndarray) or numbers.dtype.kind != "f" or bool(np.isfinite(numbers).all())
        require(sound, name, None, "", FINITE)


def _together(system: System, contacts: tuple[ContactPair, ...]) -> System:
    """The system, whose fields are from now on those that were computed together, with contacts at these places."""
    kept = tuple(system.__dict__[name] for name in TOGETHER)
    system.__dict__["computed_together"] = SystemOrigin(kept, contacts, system.constant_load)
    return system


def _copy(system: System, **changes: Any) -> System:
    copied = object.__new__(System)
    copied.__dict__.update({name: system.__dict__[name] for name in FIELDS} | changes)
    if system.__dict__.get("is_diagonal"):
        # diagonal matrices stay so
        copied.__dict__["is_diagonal"] = True
    if changes.keys().isdisjoint(UNDAMPED):
        copied.__dict__["derived_undamped"] = system.derived_undamped
    return copied
