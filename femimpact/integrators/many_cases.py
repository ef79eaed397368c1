"""Many dwells of one system, each with excitation, gaps, contact laws and start of its own, by any method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.answers import SineCases, SineDwellResults, SineDwells
from femimpact.integrators.methods import Method
from femimpact.integrators.threads import Progress
from femimpact.response.signals import SteadyMotion
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["run_cases", "start_of", "with_contacts_of"]

Array = NDArray[np.float64]


def run_cases(
    system: System, cases: SineCases, method: Method, observed: Array, instants: int, workers: int = 1,
    progress: Progress | None = None,
) -> SineDwellResults:  # fmt: skip
    """Results of all cases in their order.

    A method may have a member `run_cases` that takes them as they are, and `takes_several_systems` where each may have
    a system of its own. For another one, cases that differ in their frequency alone run together.

    Parameters
    ----------
    system : System
    cases : SineCases
    method : Method
    observed : ndarray (dofs,)
        Row of the observed place.
    instants : int
        Of a measured cycle at which the energy ledger is read; 0 for no ledger. Without `run_cases` it is read at
        the ends of cycles.
    workers : int
        Threads at most.
    progress : callable, optional

    Returns
    -------
    SineDwellResults

    Raises
    ------
    InputError
        If a case cannot be run at all.
    """
    own: Callable[..., SineDwellResults] | None = getattr(method, "run_cases", None)
    if own is not None:
        return own(system, cases, observed, instants, workers, progress)
    groups, parts, done = list(_alike(cases)), list[SineDwellResults](), 0
    for members in groups:
        first = int(members[0])
        dwells = SineDwells(
            float(cases.amplitude[first]), cases.frequency[members], cases.cycles[members], cases.measured[members],
            float(cases.phase[first]),
        )  # fmt: skip
        whole, start = with_contacts_of(system, cases, first), start_of(cases, first)
        parts.append(method.run_dwells(whole, dwells, start, observed, instants > 0, workers))
        done += members.size
        if progress is not None:
            progress(done / cases.frequency.size)
    return _in_order(parts, np.argsort(np.concatenate(groups)))


def with_contacts_of(system: System, cases: SineCases, case: int) -> System:
    """The system with the gaps and the laws of a case."""
    laws = cases.laws[int(cases.law_of[case])]
    contacts = []
    for pair, gaps, law in zip(system.contacts, cases.gaps[case].tolist(), laws, strict=True):
        same = pair.gaps == tuple(gaps) and pair.law == law
        contacts.append(pair if same else replace(pair, gaps=tuple(gaps), law=law))
    if all(one is other for one, other in zip(contacts, system.contacts, strict=True)):
        return system
    return replace(system, contacts=tuple(contacts))


def start_of(cases: SineCases, case: int) -> State:
    """The start of a case."""
    given: dict[str, Any] = {}
    # what is not given may be that of the static state
    for name in ("ball_displacement", "ball_velocity"):
        values = getattr(cases, name)[case]
        if np.any(values):
            given[name] = values
    return replace(cases.initial, **given)


def _alike(cases: SineCases) -> Iterator[NDArray[np.intp]]:
    """Cases that differ in their frequency and its dwell alone."""
    count = cases.frequency.size
    columns = (cases.amplitude, cases.phase, cases.gaps, cases.law_of, cases.ball_displacement, cases.ball_velocity)
    rows = np.hstack([np.asarray(values, dtype=float).reshape(count, -1) for values in columns])
    found: dict[bytes, list[int]] = {}
    for case in range(count):
        found.setdefault(rows[case].tobytes(), []).append(case)
    return (np.array(members) for members in found.values())


def _in_order(parts: list[SineDwellResults], order: NDArray[np.intp]) -> SineDwellResults:
    """All parts in one, their cases in the order of a permutation."""
    motion = {
        item.name: np.concatenate([getattr(part.motion, item.name) for part in parts])[order]
        for item in fields(SteadyMotion)
    }
    failures = [failure for part in parts for failure in part.failures]
    return SineDwellResults(
        motion=SteadyMotion(**motion),
        totals=np.concatenate([part.totals for part in parts], axis=2)[:, :, order],
        **{name: np.concatenate([getattr(part, name) for part in parts])[order] for name in
           ("duration", "residual", "bound")},
        failures=tuple(failures[i] for i in order.tolist()),
        warnings=tuple(dict.fromkeys(text for part in parts for text in part.warnings)),
    )  # fmt: skip
