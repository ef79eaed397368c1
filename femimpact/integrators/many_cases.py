"""Many dwells of one system, each with its own excitation, gaps, contact laws and start, by any method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.answers import SineCases, SineDwellResults, SineDwells
from femimpact.integrators.cases import start_of, with_contacts_of
from femimpact.integrators.methods import Method
from femimpact.integrators.threads import Progress
from femimpact.response.signals import SteadyMotion
from femimpact.system.system import System

__all__ = ["run_cases"]

Array = NDArray[np.float64]


def run_cases(
    system: System, cases: SineCases, method: Method, observed: Array, instants: int, workers: int = 1,
    progress: Progress | None = None,
) -> SineDwellResults:  # fmt: skip
    """Results of all cases in their order.

    A method may have a member `run_cases` that takes them as they are, and `takes_several_systems` where each may have
    a separate system and any start and law. For another one, and of methods with steps for static starts and laws
    that are functions, cases that differ in their frequency alone run together.

    Parameters
    ----------
    system : System
    cases : SineCases
    method : Method
    observed : ndarray (dofs,)
        Row of the observed place.
    instants : int
        Of a measured cycle at which the energy ledger is read; 0 for no ledger. Of methods with steps it is
        read at the ends of cycles.
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
    whole = getattr(method, "takes_several_systems", False)
    if own is not None and (whole or _are_plain(system, cases)):
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


def _are_plain(system: System, cases: SineCases) -> bool:
    """Whether no start follows from statics, and no law is a function: the cases of a step may differ in the rest."""
    static = cases.initial.is_static_on(system) or bool(np.any(cases.gaps < 0.0))
    pairs = [(law, pair) for laws in cases.laws for law, pair in zip(laws, system.contacts, strict=True)]
    return not static and all(law.force_function(pair.effective_mass) is None for law, pair in pairs)


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
