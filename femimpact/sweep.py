"""Stepped-sine sweeps: one base frequency a case, all side by side."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.contact.formulas import RIGID
from femimpact.damping import realised_damping_ratio
from femimpact.energy import energy_residual
from femimpact.errors import DivergenceError, require, require_type
from femimpact.excitation import Sine
from femimpact.identification import DampingEstimate, fit_one_pole, half_power
from femimpact.impacts import impact_statistics
from femimpact.integrators import layout
from femimpact.integrators.block import Block, Progress, prepare, run_block
from femimpact.integrators.dwell import dwell
from femimpact.integrators.event_driven import EventDriven, check_events
from femimpact.integrators.integrate import divergence_message
from femimpact.integrators.newmark import SteppingMethod, require_method
from femimpact.integrators.stepping import check_sampling, check_step, step_notes
from femimpact.signals import SteadyMotion, steady_motion
from femimpact.structure import Position
from femimpact.system import State, System

if TYPE_CHECKING:
    import xarray

__all__ = ["SWEEP_UNITS", "FrequencyResponse", "frequency_sweep"]

WIDEST_BLOCK = 64
"""Cases side by side beyond which a block no longer gains speed but leaves the cache."""

SWEEP_UNITS = {
    "peak": "m",
    "rms": "m",
    "first_harmonic": "m",
    "phase": "rad",
    "impacts_per_cycle": "1",
    "mean_approach_speed": "m/s",
    "largest_approach_speed": "m/s",
    "mean_impulse": "N s",
    "peak_force": "N",
    "cycle_mean_force": "N",
    "energy_residual": "1",
}
"""Numeric columns of a sweep and their units."""

TRANSIENT_LEFT = 0.03
"""Share of the first mode's transient that may be left where measuring begins without a warning."""

IMPACT_NAMES = (
    "impacts_per_cycle", "mean_approach_speed", "largest_approach_speed", "mean_impulse", "peak_force",
    "cycle_mean_force",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Response curve over the base frequency, measured in the last third of each dwell.

    Parameters
    ----------
    frequency : ndarray (n,), Hz
    peak, rms, first_harmonic : ndarray (n,), m
        Of the observed place relative to the base; not a number where a case failed.
    phase : ndarray (n,), rad
        Of the first harmonic relative to the base's displacement.
    steadiness : ndarray (n,) of str
        "periodic", "statistical", "transient" or "failed".
    impacts_per_cycle : ndarray (n,), 1
    mean_approach_speed, largest_approach_speed : ndarray (n,), m/s
    mean_impulse : ndarray (n,), N s
    peak_force : ndarray (n,), N
        Under the law named in `law`.
    cycle_mean_force : ndarray (n,), N
        Integral of the force over the measured time.
    energy_residual : ndarray (n,), 1
        Largest over the base cycles of the whole dwell; not a number without a ledger.
    amplitude : float, m
        Of the base.
    cycles : int
        Whole dwell at each frequency.
    at : str or float
        The observed place.
    start : str
        Frame in which everything was at rest, or "given".
    law : str
    warnings, notes : tuple of str
    """

    frequency: NDArray[Any]
    peak: NDArray[Any]
    rms: NDArray[Any]
    first_harmonic: NDArray[Any]
    phase: NDArray[Any]
    steadiness: NDArray[Any]
    impacts_per_cycle: NDArray[Any]
    mean_approach_speed: NDArray[Any]
    largest_approach_speed: NDArray[Any]
    mean_impulse: NDArray[Any]
    peak_force: NDArray[Any]
    cycle_mean_force: NDArray[Any]
    energy_residual: NDArray[Any]
    amplitude: float
    cycles: int
    at: Position
    start: str
    law: str
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @cached_property
    def damping(self) -> DampingEstimate:
        """One-pole fit of the peak curve."""
        return fit_one_pole(self.frequency, self.peak)

    @cached_property
    def damping_half_power(self) -> DampingEstimate:
        """Half-power estimate of the peak curve."""
        return half_power(self.frequency, self.peak)

    @property
    def peak_amplitude(self) -> float:
        """Largest peak of the curve, m."""
        return float(np.nanmax(self.peak))

    @property
    def peak_frequency(self) -> float:
        """Frequency of the largest peak, Hz."""
        return float(self.frequency[np.nanargmax(self.peak)])

    def to_xarray(self) -> xarray.Dataset:
        """The curve as a labelled dataset over frequency."""
        import xarray

        data: dict[str, Any] = {
            name: ("frequency", np.array(getattr(self, name)), {"units": unit, "long_name": name.replace("_", " ")})
            for name, unit in SWEEP_UNITS.items()
        }
        data["steadiness"] = ("frequency", np.array(self.steadiness, dtype=str))
        frequency = ("frequency", np.array(self.frequency), {"units": "Hz", "long_name": "base frequency"})
        attributes = {
            "base_amplitude_m": self.amplitude,
            "cycles": self.cycles,
            "at": str(self.at),
            "start": self.start,
            "contact_law": self.law,
            "warnings": "; ".join(self.warnings),
        }
        return xarray.Dataset(data, coords={"frequency": frequency}, attrs=attributes)


def frequency_sweep(
    system: System,
    amplitude: float,
    frequencies: ArrayLike,
    method: SteppingMethod | EventDriven,
    cycles: int,
    *,
    initial: State | None = None,
    at: Position = "tip",
    ledger: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> FrequencyResponse:
    """Stepped-sine sweep: each frequency a run of its own from the initial state.

    Parameters
    ----------
    system : System
        Reduced systems are fastest.
    amplitude : float, m
        Of the base displacement, the same at all frequencies.
    frequencies : array_like (n,), Hz
    method : Newmark, HHT, WBZ, GeneralizedAlpha, MoreauJean or EventDriven
    cycles : int
        Whole dwell in base cycles; the last third is measured.
    initial : State, optional
        At rest in the frame of the base by default.
    at : str or float
        The observed place.
    ledger : bool
        Keep the energy residual of every case; costs about half as much again.
    threads : int, optional
        The number of cores by default; the results do not depend on it, to the last bit.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    FrequencyResponse
        A frequency that diverged is a row of not-a-numbers, "failed", with a warning.

    Raises
    ------
    InputError
        If an argument is out of range or the step does not resolve the contact.
    DivergenceError
        If every frequency diverged.
    """
    state = initial or State()
    given: tuple[tuple[Any, Any], ...] = ((system, System), (state, State))
    for value, kind in given:
        require_type(value, kind, kind.__name__.lower())
    f = np.atleast_1d(np.array(frequencies, dtype=float))
    fine = f.ndim == 1 and f.size > 0 and bool(np.all(np.isfinite(f) & (f > 0)))
    require(fine, "frequencies", None, "Hz", "must be one or more numbers > 0")
    whole = isinstance(cycles, (int, np.integer)) and cycles >= 3
    require(whole, "cycles", cycles, "", "must be a whole number >= 3")
    positive = threads is None or (isinstance(threads, int) and threads >= 1)
    require(positive, "threads", threads, "", "must be a whole number >= 1")
    observed, workers = system.point_row(at), threads or _cores()
    warnings: list[str] = []
    if isinstance(method, EventDriven):
        notes: tuple[str, ...] = ()
        columns = _event_columns(
            system, amplitude, f, method, int(cycles), state, observed, ledger, workers, progress, warnings
        )
    else:
        require_method(method)
        notes = step_notes(system, method)
        columns = _stepped_columns(
            system, amplitude, f, method, int(cycles), state, observed, ledger, workers, progress, warnings
        )
    warnings += _steadiness_warnings(f, columns["steadiness"]) + _dwell_warnings(system, f, cycles)
    return FrequencyResponse(
        frequency=_read_only(f),
        **{name: _read_only(column) for name, column in columns.items()},
        amplitude=amplitude,
        cycles=int(cycles),
        at=at,
        start=state.frame if state.is_at_rest else "given",
        law=", ".join(dict.fromkeys(pair.law.name for pair in system.contacts)) or "none",
        warnings=tuple(warnings),
        notes=notes,
    )


def _stepped_columns(
    system: System, amplitude: float, f: NDArray[Any], method: SteppingMethod, cycles: int, state: State,
    observed: NDArray[Any], ledger: bool, workers: int, progress: Progress | None, warnings: list[str],
) -> dict[str, NDArray[Any]]:  # fmt: skip
    """All frequencies by a step method, side by side in blocks."""
    check_sampling(f, method, "frequencies")
    warnings += check_step(system, method)
    groups = _blocks(f, workers)
    blocks = []
    for members in groups:
        steps = [math.ceil(cycles / (f[i] * method.dt)) for i in members]
        starts = [math.ceil((cycles - cycles // 3) / (f[i] * method.dt)) for i in members]
        bases = [Sine(amplitude, float(f[i])) for i in members]
        blocks.append(
            prepare(
                system, bases, method, steps=steps, window_start=starts, initial=state, observed=observed, ledger=ledger
            )
        )
    _run_all(blocks, workers, progress)
    columns = _gather(system, blocks, groups, f, cycles, method, warnings)
    if all(s == "failed" for s in columns["steadiness"]):
        time = min(float(block.diverged.min()) for block in blocks)
        raise DivergenceError(divergence_message(float(f[0]), time, method))
    return columns


def _event_columns(
    system: System, amplitude: float, f: NDArray[Any], method: EventDriven, cycles: int, state: State,
    observed: NDArray[Any], ledger: bool, workers: int, progress: Progress | None, warnings: list[str],
) -> dict[str, NDArray[Any]]:  # fmt: skip
    """All frequencies event-driven, each a run of its own."""
    check_events(system)
    columns = {name: np.full(f.size, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(f.size, "failed", dtype="<U11")
    lock, done = threading.Lock(), [0]

    def run(i: int) -> None:
        try:
            found = dwell(system, Sine(amplitude, float(f[i])), method, cycles, cycles // 3, state, observed, ledger)
        except DivergenceError as error:
            with lock:
                warnings.append(f"at {f[i]:g} Hz: {error}")
            return
        motion = steady_motion(found.cycles, np.array([cycles // 3]))
        for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
            columns[name][i] = getattr(motion, name)[0]
        statistics = impact_statistics(found.totals, found.measured, float(f[i]), "")
        for name in IMPACT_NAMES:
            columns[name][i] = getattr(statistics, name)
        columns["energy_residual"][i] = found.residual
        with lock:
            done[0] += 1
            if progress is not None:
                progress(done[0] / f.size)

    if workers == 1 or f.size == 1:
        for i in range(f.size):
            run(i)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(run, range(f.size)))
    if all(s == "failed" for s in columns["steadiness"]):
        raise DivergenceError(warnings[-1])
    return columns


def _cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _blocks(f: NDArray[Any], workers: int) -> list[NDArray[Any]]:
    """Cases of like length together; as many blocks as workers, none wider than the cache likes."""
    count = max(min(workers, f.size // 2), math.ceil(f.size / WIDEST_BLOCK), 1)
    return [members for members in np.array_split(np.argsort(f, kind="stable"), count) if members.size]


def _run_all(blocks: Sequence[Block], workers: int, progress: Progress | None) -> None:
    stop = threading.Event()
    shares = [0.0] * len(blocks)
    work = [block.steps * block.motion.q.shape[1] for block in blocks]
    lock = threading.Lock()

    def report(index: int, share: float) -> None:
        with lock:
            shares[index] = share
            if progress is not None:
                progress(sum(s * w for s, w in zip(shares, work, strict=True)) / sum(work))

    def run(index: int) -> None:
        run_block(blocks[index], lambda share: report(index, share), stop)

    if len(blocks) == 1 or workers == 1:
        for index in range(len(blocks)):
            run(index)
        return
    with ThreadPoolExecutor(workers) as pool:
        futures = [pool.submit(run, index) for index in range(len(blocks))]
        try:
            for future in futures:
                future.result()
        finally:
            # an interrupt or an error in one block must not leave the others running
            stop.set()


def _gather(
    system: System,
    blocks: Sequence[Block],
    groups: Sequence[NDArray[Any]],
    f: NDArray[Any],
    cycles: int,
    method: SteppingMethod,
    warnings: list[str],
) -> dict[str, NDArray[Any]]:
    """Columns over the frequencies in their given order."""
    columns = {name: np.full(f.size, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(f.size, "failed", dtype="<U11")
    for block, members in zip(blocks, groups, strict=True):
        motion = _motion(block, cycles, members.size)
        totals = block.motion.totals[:, :, : members.size]
        # an impulse has no peak
        totals[4, block.pairs.kind == RIGID] = np.nan
        residual = _residuals(block, cycles) if block.ledger else np.full(members.size, np.nan)
        for c, i in enumerate(members):
            if np.isfinite(block.diverged[c]):
                warnings.append(divergence_message(float(f[i]), float(block.diverged[c]), method))
                continue
            for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
                columns[name][i] = getattr(motion, name)[c]
            columns["energy_residual"][i] = residual[c]
            measured = float(np.diff(block.motion.window[:, c])[0]) * method.dt
            statistics = impact_statistics(totals[:, :, c], measured, float(f[i]), "")
            for name in IMPACT_NAMES:
                columns[name][i] = getattr(statistics, name)
    return columns


def _motion(block: Block, cycles: int, cases: int) -> SteadyMotion:
    # slower cases of the block run on beyond their own dwell: leave those cycles out
    statistics = block.cycle_statistics
    cut = type(statistics)(**{name: getattr(statistics, name)[:cycles] for name in layout.CYCLE_COLUMNS})
    return steady_motion(cut, np.full(cases, cycles // 3))


def _residuals(block: Block, cycles: int) -> NDArray[Any]:
    energy = block.cycles.energy[: cycles + 1, :, : block.cases]
    kinetic, strain, ball, contact, work, structure_loss, contact_loss = np.moveaxis(energy, 1, 0)
    with np.errstate(invalid="ignore", over="ignore"):
        residual = energy_residual(kinetic + strain + ball + contact, work, structure_loss + contact_loss)
        return np.asarray(np.max(np.abs(residual), axis=0))


def _steadiness_warnings(f: NDArray[Any], steadiness: NDArray[Any]) -> list[str]:
    moving = f[steadiness == "transient"]
    if moving.size == 0:
        return []
    return [
        f"not steady at {moving.size} of {f.size} frequencies ({moving.min():.4g} to {moving.max():.4g} Hz): "
        "the two halves of the measured time differ; take more cycles"
    ]


def _dwell_warnings(system: System, f: NDArray[Any], cycles: int) -> list[str]:
    """What is left of the structure's own transient where measuring begins, when that is much."""
    if system.rayleigh is None:
        return []
    omega = 2.0 * math.pi * system.first_frequency
    ratio = float(realised_damping_ratio(*system.rayleigh, omega))
    left = math.exp(-ratio * omega * (cycles - cycles // 3) / float(f.max()))
    if left <= TRANSIENT_LEFT:
        return []
    return [
        f"dwell of {cycles} cycles: {100 * left:.2g} % of the first mode's transient (damping ratio {ratio:.3g}) is "
        f"left where measuring begins: peaks and damping near {system.first_frequency:.4g} Hz want more cycles"
    ]


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array
