"""The restitution that a published resonance implies: a scan, since it is the one unknown that decides the curve."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.contact.laws import KELVIN_VOIGT, RIGID
from femimpact.errors import (
    Fault,
    InputError,
    check_fields,
    checked,
    column,
    in_range,
    items,
    quantity,
    real_array,
    require,
    require_type,
)
from femimpact.fem.assembly import assemble
from femimpact.identification import amplitude_ratio_damping
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.integrators.stepping.operators import recommended_step
from femimpact.progress import Progress, check_progress, draws_progress
from femimpact.structure.structure import Structure
from femimpact.sweep import FrequencyResponse, peak_curves
from femimpact.system.modes import with_checked_pairs
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import flat_columns, frame_of, named_column

if TYPE_CHECKING:
    import pandas


LEAST_POINTS = 4
"""Frequencies of a sweep that the fit of a resonance needs."""


@dataclass(frozen=True, eq=False)
class RestitutionScan:
    """Resonance of the beam with its ball over the restitution of the contact.

    `scan["peak_frequency"]` reads a column.

    Parameters
    ----------
    restitution : ndarray (n,), 1
    peak_frequency : ndarray (n,), Hz
    peak_amplitude : ndarray (n,), m
    amplitude_ratio : ndarray (n,), 1
        Largest peak without balls over largest peak with them.
    damping_fit, damping_half_power : ndarray (n,), 1
        Of the curve with balls.
    damping_amplitude_ratio : ndarray (n,), 1
        Damping without balls times the amplitude ratio.
    steadiness : ndarray (n,) of str
        Of the motion at the largest peak: see `FrequencyResponse`. Where it is not "periodic" a value of one start is a
        sample, which another start changes: figures mark it.
    curves : tuple of FrequencyResponse
    starts : int
        Number of starts that the columns are medians over; 1 where they are those of `curves`.

    Raises
    ------
    InputError
        If there is not one curve for each restitution.
    """

    restitution: Array = field(metadata=column("1", "restitutions"))
    peak_frequency: Array = field(metadata=column("Hz", "restitutions"))
    peak_amplitude: Array = field(metadata=column("m", "restitutions"))
    amplitude_ratio: Array = field(metadata=column("1", "restitutions"))
    damping_fit: Array = field(metadata=column("1", "restitutions"))
    damping_half_power: Array = field(metadata=column("1", "restitutions"))
    damping_amplitude_ratio: Array = field(metadata=column("1", "restitutions"))
    steadiness: NDArray[np.str_] = field(metadata=column("", "restitutions", of="text"))
    curves: tuple[FrequencyResponse, ...] = field(metadata=items(FrequencyResponse))
    starts: int = field(default=1, metadata=quantity("1", at_least=1, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)
        each = len(self.curves) == self.restitution.size
        require(each, "curves", len(self.curves), "", f"must be {self.restitution.size}, one for each restitution")

    @property
    def is_sample(self) -> NDArray[np.bool_]:
        """True where the largest peak is one start's value of a motion that is not periodic, (n,) of bool."""
        return np.asarray((self.steadiness != "periodic") & (self.starts == 1))

    def __getitem__(self, name: str) -> Array:
        return named_column(self, name)

    def to_pandas(self) -> pandas.DataFrame:
        """The columns over the restitution; units in `attrs["units"]`."""
        return frame_of(*flat_columns(self), index="restitution")

    def misfit(self, peak_frequency: float, amplitude_ratio: float, frequency_scale: float = 0.1) -> Array:
        """Distance of each restitution from a published resonance.

        sqrt[((f - f_published)/frequency_scale)^2 + ln(R/R_published)^2/ln(1.25)^2]

        Parameters
        ----------
        peak_frequency : float, Hz
        amplitude_ratio : float, 1
        frequency_scale : float, Hz
            Difference that counts as much as 25 % in the ratio; the step of the published sweep.

        Returns
        -------
        ndarray (n,), 1
            Below about 1: within the step of the sweep and 25 % of the ratio.

        Raises
        ------
        InputError
            If an argument is not > 0.
        """
        peak_frequency, amplitude_ratio, frequency_scale = (
            checked(key, value, quantity(unit, above=0.0))
            for key, value, unit in (
                ("peak_frequency", peak_frequency, "Hz"),
                ("amplitude_ratio", amplitude_ratio, "1"),
                ("frequency_scale", frequency_scale, "Hz"),
            )
        )
        by_frequency = (self.peak_frequency - peak_frequency) / frequency_scale
        by_ratio = np.log(self.amplitude_ratio / amplitude_ratio) / np.log(1.25)
        return np.asarray(np.hypot(by_frequency, by_ratio))

    def best(self, peak_frequency: float, amplitude_ratio: float) -> int:
        """Index of the restitution with the least misfit."""
        return int(np.argmin(self.misfit(peak_frequency, amplitude_ratio)))


def with_restitution(structure: Structure, restitution: float) -> Structure:
    """The same structure with another restitution in every contact.

    Raises `InputError` if a contact cannot be given one: it is neither `Rigid` nor a `KelvinVoigt` that was given a
    restitution.
    """
    require_type(structure, Structure, "structure")
    impactors = []
    for ball in structure.impactors:
        varied = ball.contact.with_restitution(restitution)
        if varied is None:
            allowed = "must be rigid, or kelvin-voigt with a restitution, to be varied"
            raise InputError([Fault(f"impactor.{ball.name}.contact", ball.contact.name, "", allowed)])
        impactors.append(dataclasses.replace(ball, contact=varied))
    return dataclasses.replace(structure, impactors=tuple(impactors))


@draws_progress
def scan_restitution(
    structure: Structure,
    restitutions: ArrayLike,
    empty: FrequencyResponse,
    *,
    elements: int,
    modes: int,
    frequencies: ArrayLike,
    cycles: int,
    initial: State | None = None,
    progress: Progress | bool | None = None,
) -> RestitutionScan:
    """One sweep for each restitution, beside one sweep without balls.

    Parameters
    ----------
    structure : Structure
        Its contacts have a restitution. Rigid and Kelvin-Voigt ones are run by the event-driven method, others are
        stepped by Newmark.
    restitutions : array_like (n,), 1
    empty : FrequencyResponse
        The sweep without balls; gives base amplitude, reference peak and reference damping.
    elements, modes : int
        Mesh and reduction.
    frequencies : array_like, Hz
    cycles : int
        Dwell at each frequency.
    initial : State, optional
    progress : callable or bool, optional
        Called with the share done, 0 to 1; True draws a bar.

    Returns
    -------
    RestitutionScan

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range, or a contact cannot be given a restitution.
    """
    require_type(empty, FrequencyResponse, "empty")
    systems = systems_over_restitution(structure, restitutions, elements=elements, modes=modes)
    return scan_systems(systems, empty, frequencies=frequencies, cycles=cycles, initial=initial, progress=progress)


def systems_over_restitution(
    structure: Structure, restitutions: ArrayLike, *, elements: int, modes: int
) -> tuple[tuple[float, System], ...]:
    """Each restitution with its reduced system, made once where several starts are scanned.

    Parameters and Raises are those of `scan_restitution`.
    """
    require_type(structure, Structure, "structure")
    of_one = quantity("1", above=0.0, at_most=1.0)
    allowed = "must be one or more numbers > 0 and <= 1"
    values = np.atleast_1d(real_array("restitutions", restitutions, "1", allowed))
    sound = values.ndim == 1 and values.size > 0 and all(in_range(value, of_one) for value in values.tolist())
    require(sound, "restitutions", values if values.ndim > 1 else restitutions, "1", allowed)
    # modes do not depend on the laws of contacts
    first = reduce(assemble(with_restitution(structure, float(values[0])), elements=elements), modes)
    return tuple((value, _with_laws_of(first, with_restitution(structure, value))) for value in values.tolist())


def _with_laws_of(system: System, structure: Structure) -> System:
    """The system with the contact laws that the structure's balls have."""
    laws = {ball.name: ball.contact for ball in structure.impactors}
    pairs = tuple(dataclasses.replace(pair, law=laws.get(pair.name, pair.law)) for pair in system.contacts)
    return with_checked_pairs(system, pairs)


def scan_systems(
    systems: Sequence[tuple[float, System]],
    empty: FrequencyResponse,
    *,
    frequencies: ArrayLike,
    cycles: int,
    initial: State | None = None,
    step: int = 1,
    progress: Progress | bool | None = None,
) -> RestitutionScan:
    """One curve for each restitution with its system; else as `scan_restitution`.

    With a `step` above 1, a power of two, a curve has only the frequencies where its largest peak may be: every
    `step`-th one, and those between that are beside a point near the largest peak. See `sweep.peak_curves`.
    """
    report, state = check_progress(progress), State() if initial is None else initial
    require_type(state, State, "initial")
    points = real_array("frequencies", frequencies, "Hz", "must be finite numbers")
    require(points.size >= LEAST_POINTS, "frequencies", points.size, "points", f"must hold at least {LEAST_POINTS}")
    curves: list[FrequencyResponse] = []
    for method, systems_of_method in _by_method(systems):
        curves += peak_curves(
            systems_of_method,
            method,
            frequencies,
            cycles,
            amplitude=empty.amplitude,
            acceleration=empty.acceleration,
            initial=state,
            step=step,
        )
        if report is not None:
            report(len(curves) / len(systems))
    peaks = np.array([curve.peak_amplitude for curve in curves])
    by_ratio = [amplitude_ratio_damping(empty.damping, empty.peak_amplitude, peak).ratio for peak in peaks]
    return RestitutionScan(
        restitution=np.array([restitution for restitution, _ in systems]),
        peak_frequency=np.array([curve.peak_frequency for curve in curves]),
        peak_amplitude=peaks,
        amplitude_ratio=empty.peak_amplitude / peaks,
        damping_fit=np.array([curve.damping.ratio for curve in curves]),
        damping_half_power=np.array([curve.damping_half_power.ratio for curve in curves]),
        damping_amplitude_ratio=np.array(by_ratio),
        steadiness=np.array([str(curve.steadiness[np.nanargmax(curve.peak)]) for curve in curves]),
        curves=tuple(curves),
    )


def _by_method(systems: Sequence[tuple[float, System]]) -> list[tuple[Method, list[System]]]:
    """Methods, each with the systems in their order that it runs together: steps depend on the restitution."""
    alone = [system for _, system in systems]
    if all(pair.parameters.kind in (RIGID, KELVIN_VOIGT) for system in alone for pair in system.contacts):
        return [(EventDriven(), alone)]
    return [(Newmark(dt=recommended_step(system)), [system]) for system in alone]
