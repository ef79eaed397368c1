"""One run: from a system and a base motion to its response."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.energy import EnergyLedger
from femimpact.errors import DivergenceError, in_range, quantity, require, require_type
from femimpact.excitation import Excitation, PointForce, RecordedBase, Sine
from femimpact.impacts import Impacts, Riding, impact_statistics
from femimpact.integrators import layout
from femimpact.integrators.block import Block, Progress, prepare, run_block
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.fly import fly
from femimpact.integrators.kernels.keeping import keep
from femimpact.integrators.newmark import SteppingMethod, require_method
from femimpact.integrators.recording import check_memory, memory_needed, record_of
from femimpact.integrators.stepping import check_sampling, check_step, step_notes
from femimpact.reduction import truncation_notes
from femimpact.response import Channel, Recorder, Response, Snapshots, on_beam, resolve_channels
from femimpact.signals import no_steady_motion, steady_motion
from femimpact.system import State, System

__all__ = ["check_memory", "divergence_message", "integrate", "memory_needed"]


def integrate(
    system: System,
    excitation: Excitation,
    method: SteppingMethod | EventDriven,
    duration: float,
    record: Recorder | None = None,
    initial: State | None = None,
    progress: Progress | None = None,
) -> Response:
    """Motion of structure and balls under a moving base or a force, from an initial state.

    M u'' + C u' + K u = -M r ub'' + b F(t) + sum_j b_j F_j,  m_j (y_j'' + ub'') = m_j g_j - F_j

    Parameters
    ----------
    system : System
        Physical or reduced.
    excitation : Sine, PointForce or RecordedBase
    method : Newmark, HHT, WBZ, GeneralizedAlpha, MoreauJean or EventDriven
    duration : float, s
        Rounded to whole steps, or to whole samples.
    record : Recorder, optional
        What to keep; by default the tip, the balls and the contact forces at every step.
    initial : State, optional
        At rest in the frame of the base by default.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    Response
        Displacements relative to the base, m; contact force on the structure, N.

    Raises
    ------
    InputError
        If the step does not resolve the contact, the run would keep too much, or an argument is
        out of range.
    DivergenceError
        If the motion is not finite or grows without bound.
    """
    recorder, start = record or Recorder(), initial or State()
    given: tuple[tuple[Any, Any], ...] = ((system, System), (recorder, Recorder), (start, State))
    for value, kind in given:
        require_type(value, kind, kind.__name__.lower())
    if isinstance(method, EventDriven):
        return fly(system, excitation, method, duration, recorder, start, progress)
    require_method(method)
    known = isinstance(excitation, Sine | PointForce | RecordedBase)
    require(known, "excitation", type(excitation).__name__, "", "must be a Sine, a PointForce or a RecordedBase")
    fits = in_range(duration, quantity("s", at_least=method.dt))
    require(fits, "duration", duration, "s", f"must be a finite number >= one step, {method.dt:g} s")
    check_sampling(np.array([excitation.frequency]), method, "frequency")
    warnings = list(check_step(system, method))
    steps = round(duration / method.dt)
    channels = resolve_channels(system, recorder.channels)
    kept = record_of(system, recorder, channels, steps, method, excitation)
    window_start = 2 * steps // 3
    block = prepare(
        system,
        [excitation],
        method,
        steps=[steps],
        window_start=[window_start],
        initial=start,
        observed=system.point_row(system.default_place),
        ledger=recorder.ledger,
        record=kept,
    )
    _keep_first(block)
    run_block(block, progress)
    if np.isfinite(block.diverged[0]):
        raise DivergenceError(divergence_message(excitation.frequency, float(block.diverged[0]), method))
    if kept.tally[3] > kept.impacts.shape[0]:
        lost = int(kept.tally[3] - kept.impacts.shape[0])
        warnings.append(f"{lost} impacts beyond the first {recorder.impacts} are not in the table (Recorder.impacts)")
    return _response(block, system, excitation, method, recorder, channels, tuple(warnings))


def divergence_message(frequency: float, time: float, method: SteppingMethod) -> str:
    """Words for a run that grew without bound, and the way out."""
    return (
        f"the motion at {frequency:g} Hz is not finite or grew without bound before t = {time:.4g} s with "
        f"dt = {method.dt:.3g} s: take a smaller dt (recommended_step gives one), a contact law with damping, "
        f"or raise divergence_limit ({method.divergence_limit:g})"
    )


def _keep_first(block: Block) -> None:
    """Keep the state at t = 0 where it is asked for."""
    if block.record.channels.shape[0] + block.record.fields.shape[0] > 0:
        keep(0, block.operator, block.pairs, block.motion, block.record, block.ledger)


def _response(
    block: Block,
    system: System,
    excitation: Excitation,
    method: SteppingMethod,
    recorder: Recorder,
    channels: tuple[Channel, ...],
    warnings: tuple[str, ...],
) -> Response:
    record, dt = block.record, method.dt
    every, first, stride, first_field = (int(value) for value in record.stride)
    time = _read_only((first + every * np.arange(record.channels.shape[0])) * dt)
    impacts = _impacts(record, system, excitation)
    laws = ", ".join(dict.fromkeys(pair.law.name for pair in system.contacts)) or "none"
    window = float(block.steps - block.motion.window[0, 0]) * dt
    totals = block.motion.totals[:, :, 0]
    # an impulse has no peak
    totals[4, block.pairs.kind == RIGID] = np.nan
    energy = _ledger(record, time) if recorder.ledger else None
    if energy is not None and energy.residual > recorder.residual_limit:
        warnings = (*warnings, _residual_warning(energy.residual, recorder.residual_limit))
    per_ball = {
        pair.name: impact_statistics(totals[:, j : j + 1], window, excitation.frequency, pair.law.name)
        for j, pair in enumerate(system.contacts)
    }
    cycles = block.cycle_statistics
    finished = int(np.count_nonzero(cycles.samples[:, 0]))
    return Response(
        time=time,
        channels={
            channel.name: _read_only(on_beam(system, channel) * record.channels[:, i])
            for i, channel in enumerate(channels)
        },
        units={channel.name: channel.unit for channel in channels},
        impacts=impacts,
        riding=_riding(block, system),
        statistics=impact_statistics(totals, window, excitation.frequency, laws),
        statistics_of=per_ball,
        steady=steady_motion(cycles, np.array([max(finished // 3, 1)])) if finished else no_steady_motion(),
        energy=energy,
        snapshots=_snapshots(record, system, first_field, stride, dt) if recorder.snapshots else None,
        base=excitation,
        system=system,
        warnings=warnings,
        notes=(*step_notes(system, method), *truncation_notes(system), *_open_contacts(block, system)),
    )


def _residual_warning(residual: float, limit: float) -> str:
    return (
        f"energy residual {residual:.2g} exceeds {limit:g}: the method or the contact law makes or loses energy that "
        "the ledger cannot name; take a smaller dt, or raise Recorder.residual_limit"
    )


def _open_contacts(block: Block, system: System) -> tuple[str, ...]:
    """Notes on balls that touch at the end: their contact is in the forces, not in the table of impacts."""
    touch = block.motion.touch[:, :, 0]
    return tuple(
        f"{pair.name} is in contact at the end, under force for {touch[layout.DURATION, j]:.3g} s of it: that "
        "contact counts in forces and energies but is no finished impact"
        for j, pair in enumerate(system.contacts)
        if touch[layout.OPEN, j] != 0.0
    )


def _ledger(record: layout.Record, time: NDArray[Any]) -> EnergyLedger:
    columns = {name: _read_only(record.energy[:, i]) for i, name in enumerate(layout.ENERGY_COLUMNS)}
    of_mode = _read_only(record.energy[:, len(layout.ENERGY_COLUMNS) :])
    return EnergyLedger(time=time, structure_loss_of_mode=of_mode, **columns)


def _impacts(record: layout.Record, system: System, excitation: Excitation) -> Impacts:
    count = min(int(record.tally[3]), record.impacts.shape[0])
    columns = {name: _read_only(record.impacts[:count, i]) for i, name in enumerate(layout.IMPACT_COLUMNS)}
    names = np.array([pair.name for pair in system.contacts] or [""])
    columns["impactor"] = names[columns.pop("pair").astype(int)]
    return Impacts(
        **columns,
        phase=_read_only(np.mod(2.0 * np.pi * excitation.frequency * columns["time"] + excitation.phase, 2.0 * np.pi)),
        energy_to_modes=_read_only(record.impacts[:count, len(layout.IMPACT_COLUMNS) :]),
        law={pair.name: pair.law.name for pair in system.contacts},
        dropped=int(record.tally[3]) - count,
    )


def _riding(block: Block, system: System) -> Riding:
    """Rigid contacts that took an impulse in three or more steps in a row: a ball that moves with its wall.

    Each begins with an impact, which has its own row in the table of impacts once the contact has ended;
    the impulses of the two tables are the same.
    """
    record, touch, dt = block.record, block.motion.touch[:, :, 0], block.scheme.dt
    count = min(int(record.tally[3]), record.impacts.shape[0])
    rows = [(*row[:3], row[7], row[5], row[0] + row[7]) for row in record.impacts[:count]]
    for j in np.flatnonzero(touch[layout.OPEN]):
        time, side, duration, impulse = (
            touch[row, j] for row in (layout.START, layout.SIDE, layout.DURATION, layout.IMPULSE)
        )
        rows.append((time, j, side, duration, impulse, np.nan))
    rows = [row for row in rows if block.pairs.kind[int(row[1])] == RIGID and row[3] > 1.5 * dt]
    if not rows:
        return Riding.none()
    start, pair, side, duration, impulse, end = (np.array(column) for column in zip(*rows, strict=True))
    return Riding(
        impactor=np.array([system.contacts[int(j)].name for j in pair]),
        side=_read_only(side),
        start=_read_only(start),
        end=_read_only(end),
        impulse=_read_only(side * impulse),
        mean_force=_read_only(side * impulse / duration),
    )


def _snapshots(record: layout.Record, system: System, first: int, stride: int, dt: float) -> Snapshots:
    dofs, balls = system.dofs, slice(system.dofs, system.dofs + len(system.balls))
    u, v = (np.asarray((system.expansion @ record.fields[:, k, :dofs].T).T) for k in (0, 1))
    return Snapshots(
        time=_read_only((first + stride * np.arange(record.fields.shape[0])) * dt),
        displacement=_read_only(u),
        velocity=_read_only(v),
        ball_displacement=_read_only(record.fields[:, 0, balls]),
        ball_velocity=_read_only(record.fields[:, 1, balls]),
        contact_force=_read_only(record.forces * [-1.0 if pair.is_stop else 1.0 for pair in system.contacts]),
    )


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
