"""One of many cases: its system with its gaps and laws, and its start."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from femimpact.integrators.answers import SineCases
from femimpact.system.computed import with_checked_pairs
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["start_of", "with_contacts_of"]


def with_contacts_of(system: System, cases: SineCases, case: int) -> System:
    """The system with the gaps and the laws of a case."""
    laws = cases.laws[int(cases.law_of[case])]
    contacts = []
    for pair, gaps, law in zip(system.contacts, cases.gaps[case].tolist(), laws, strict=True):
        same = pair.gaps == tuple(gaps) and pair.law == law
        contacts.append(pair if same else replace(pair, gaps=tuple(gaps), law=law))
    if all(one is other for one, other in zip(contacts, system.contacts, strict=True)):
        return system
    return with_checked_pairs(system, tuple(contacts))


def start_of(cases: SineCases, case: int) -> State:
    """The start of a case."""
    given: dict[str, Any] = {}
    # what is not given may be that of the static state
    placed = cases.ball_displacement[case]
    if placed.size and not np.isnan(placed).any():
        given["ball_displacement"] = placed
    if np.any(cases.ball_velocity[case]):
        given["ball_velocity"] = cases.ball_velocity[case]
    return replace(cases.initial, **given)
