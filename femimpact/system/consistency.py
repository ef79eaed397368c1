"""Whether the fields of a system go together: a few checks of one made anew, and none of a sound copy.

Stiffness factor, modes, base load, masses and contacts follow from M, C, K and the points. A system keeps the
very objects that were computed together, so that a copy with another one of them is distinguished from a sound copy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse

from femimpact.errors import Fault, InputError, checked, quantity, require, require_name, require_type
from femimpact.system.matrices import (
    FINITE,
    check_semidefinite,
    checked_matrix,
    checked_row,
    same_product,
    sound_sparse,
)
from femimpact.system.reactions import check_reactions

__all__ = [
    "TOGETHER", "SystemOrigin", "check_contacts", "check_damping", "check_factor", "check_shapes", "check_unchanged",
]  # fmt: skip

TOGETHER = (
    "M", "C", "K", "stiffness_factor", "base_load", "rigid_translation", "nodes", "expansion", "points", "total_mass",
    "first_frequency", "rayleigh", "directions", "reactions", "sections", "constant_resultant", "first_left_out",
)  # fmt: skip
"""Fields of a system that are computed from one another."""


class SystemOrigin(NamedTuple):
    """What a system was when its fields were computed from one another."""

    fields: tuple[Any, ...]
    contacts: tuple[Any, ...]
    constant_load: Any


def check_shapes(system: Any) -> None:
    """Refuse fields of a system that are no matrices, rows and places of as many dofs as its base load has."""
    n, nodes = system.dofs, system.nodes
    require(n > 0, "base_load", "empty", "kg", "must have one dof or more")
    shapes = {"M": (n, n), "C": (n, n), "K": (n, n), "stiffness_factor": (None, n), "expansion": (2 * nodes.size, n)}
    for name, expected in shapes.items():
        matrix = getattr(system, name)
        given = getattr(matrix, "shape", ())
        dense = name == "expansion" and isinstance(matrix, np.ndarray)
        fits = (sparse.issparse(matrix) or dense) and len(given) == 2
        fits = fits and all(size is None or size == own for size, own in zip(expected, given, strict=True))
        allowed = f"must be a sparse matrix with {n} columns, one for each dof"
        require(fits, name, given or type(matrix).__name__, "", allowed)
        entries = matrix if dense else sound_sparse(name, matrix).data
        sound = entries.dtype.kind == "f" and bool(np.all(np.isfinite(entries)))
        require(sound, name, None, "", FINITE)
    increasing = nodes.size == 0 or (nodes.size > 1 and bool(np.all(np.diff(nodes) > 0)))
    require(increasing, "nodes", None, "m", "must be two or more increasing positions, or none")
    pair = system.rayleigh is None or (isinstance(system.rayleigh, tuple) and len(system.rayleigh) == 2)
    require(pair, "rayleigh", system.rayleigh, "", "must be two numbers, alpha (1/s) and beta (s), or None")
    for key in ("points", "directions"):
        require_type(getattr(system, key), Mapping, key)
    for name, at in system.points.items():
        require_type(name, str, "points")
        checked(f"points.{name}", at, quantity("m", finite=False))
    for name, row in system.directions.items():
        require_name(name, system.points, "directions")
        checked_row(f"directions.{name}", row, n)
    check_reactions(system.reactions, n)
    if system.sections is not None:
        elements = system.sections.region.size
        allowed = f"must be those of the {max(nodes.size - 1, 0)} elements between the nodes"
        require(elements == nodes.size - 1, "sections", elements, "", allowed)
    for pair_ in system.contacts:
        fits = pair_.direction.shape == (n,)
        require(fits, f"{pair_.name}.direction", pair_.direction.shape, "", f"must have {n} entries, one for each dof")


def check_factor(system: Any) -> None:
    """Refuse a stiffness and a factor of it that are not of one structure."""
    fits = same_product(system.K, lambda x: system.stiffness_factor.T @ (system.stiffness_factor @ x))
    require(fits, "stiffness_factor", None, "", "must be G with K = G^T G")


def check_damping(system: Any) -> None:
    """Refuse a damping matrix that is not the one of its coefficients, or that feeds energy in."""
    shape = getattr(system.C, "shape", None)
    fits = sparse.issparse(system.C) and shape == system.M.shape
    require(fits, "C", shape or type(system.C).__name__, "", f"must be a sparse matrix of shape {system.M.shape}")
    if system.rayleigh is None:
        check_semidefinite("C", checked_matrix("C", system.C))
        return
    pair = isinstance(system.rayleigh, tuple) and len(system.rayleigh) == 2
    require(pair, "rayleigh", system.rayleigh, "", "must be two numbers, alpha (1/s) and beta (s), or None")
    alpha, beta = system.rayleigh
    fits = same_product(system.C, lambda x: alpha * (system.M @ x) + beta * (system.K @ x))
    allowed = "must be alpha and beta of C = alpha M + beta K: replace both, or give rayleigh=None for another damping"
    require(fits, "rayleigh", system.rayleigh, "", allowed)


def check_unchanged(system: Any, origin: SystemOrigin) -> bool:
    """Refuse fields that others follow from; whether the damping, from which none does, is another one."""
    changed = [
        name
        for name, kept in zip(TOGETHER, origin.fields, strict=True)
        if getattr(system, name) is not kept and not _same_number(getattr(system, name), kept)
    ]
    stale = [name for name in changed if name not in ("C", "rayleigh")]
    if stale:
        allowed = (
            "cannot be replaced: the fields of a System are computed from one another (stiffness factor, modes, base "
            "load, masses, contacts); change the Structure and assemble it again, or use "
            "System.from_matrices(M, C, K, points=...)"
        )
        raise InputError([Fault(name, None, "", allowed) for name in stale])
    return bool(changed)


def _same_number(value: Any, kept: Any) -> bool:
    return isinstance(kept, float | tuple) and isinstance(value, float | tuple) and value == kept


def check_contacts(system: Any, origin: SystemOrigin) -> None:
    """Refuse contacts at places that the system was not made with."""
    for pair in system.contacts:
        known = any(pair is other or pair.shares_place(other) for other in origin.contacts)
        allowed = (
            "must be at a place that the system has a contact at, with that one's direction, position, first_mode and "
            "flexibility: add contacts to the Structure and assemble it again, or use System.from_matrices"
        )
        require(known, f"contacts.{pair.name}", None, "", allowed)
