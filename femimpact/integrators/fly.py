"""One event-driven run: from a system and an excitation to its response."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.energy import BALANCED, CLOSED, EnergyLedger, unbalanced
from femimpact.errors import DivergenceError, in_range, quantity, require
from femimpact.excitation import Excitation
from femimpact.history import HistoryPiece, Snapshots, Stream
from femimpact.impacts import Impacts, Riding, impact_statistics
from femimpact.integrators.compliant import is_compliant
from femimpact.integrators.driving import drive_of
from femimpact.integrators.event_driven import EventDriven, check_events, force_directions, outputs_of
from femimpact.integrators.event_run import run_event_driven
from femimpact.integrators.event_state import EventRun, Keep, new_run
from femimpact.integrators.layout import CYCLE_COLUMNS, ENERGY_COLUMNS, IMPACT_COLUMNS
from femimpact.integrators.pass_through import pass_through
from femimpact.integrators.recording import check_memory
from femimpact.integrators.threads import Progress
from femimpact.reduction import truncation_notes
from femimpact.response import Channel, Recorder, Response, on_beam, resolve_channels
from femimpact.signals import CycleStatistics, SteadyMotion, no_steady_motion, steady_motion
from femimpact.system import State, System

__all__ = ["cycle_statistics", "fly", "grid_interval"]


def grid_interval(method: EventDriven, excitation: Excitation) -> float:
    """Time (s) between two samples of an event-driven run."""
    return 1.0 / (excitation.frequency * method.samples_per_cycle)


def fly(
    system: System,
    excitation: Excitation,
    method: EventDriven,
    duration: float,
    recorder: Recorder,
    initial: State,
    progress: Progress | None = None,
) -> Response:
    """Event-driven motion of structure and balls; see `integrate`.

    Raises
    ------
    InputError
        If the system is not on its modes, its contacts are neither all rigid nor all Kelvin-Voigt, or an
        argument is out of range.
    DivergenceError
        If impacts do not resolve.
    """
    check_events(system)
    interval = grid_interval(method, excitation)
    fits = in_range(duration, quantity("s", at_least=interval))
    require(fits, "duration", duration, "s", f"must be a finite number >= one sample, {interval:g} s")
    samples = round(duration / interval)
    channels = resolve_channels(system, recorder.channels)
    check_memory(system, recorder, len(channels), samples, interval, excitation.frequency)
    first, first_field = (min(round(t / interval), samples) for t in (recorder.start, recorder.snapshots_start))
    window = (interval * (2 * samples // 3), math.inf)
    run = new_run(
        system,
        drive_of(system, excitation),
        method,
        outputs_of(system, system.point_row(system.default_place), channels),
        window,
        recorder.ledger,
        Keep(recorder.every, first, recorder.snapshots, first_field),
        recorder.impacts,
    )
    u, v, y, y_rate = initial.relative_to_base(system, excitation)
    balls = len(system.balls)
    position, velocity = np.concatenate([u, y[:balls]]), np.concatenate([v, y_rate[:balls]])
    run.piece_samples = 0 if recorder.sink is None else recorder.piece_samples
    stream = Stream(read=partial(_history, run, system, excitation, channels), clear=run.clear, sink=recorder.sink)
    # the start belongs to the first piece
    through = is_compliant(system) or (not system.contacts and run.drive.samples is None)
    (pass_through if through else run_event_driven)(run, position, velocity, samples, progress, stream.hand_over)
    return _response(run, system, excitation, stream, samples, window[0])


def cycle_statistics(run: EventRun) -> CycleStatistics:
    """Statistics of every whole base cycle of a run."""
    table = np.concatenate([np.zeros((0, len(CYCLE_COLUMNS))), *run.cycles])
    return CycleStatistics(**{name: table[:, [i]] for i, name in enumerate(CYCLE_COLUMNS)})


def _history(
    run: EventRun, system: System, excitation: Excitation, channels: tuple[Channel, ...], samples_before: int,
    snapshots_before: int,
) -> HistoryPiece:  # fmt: skip
    """What the run holds of its history now."""
    keep, width = run.keep, len(run.outputs.force)
    values = np.concatenate([np.zeros((0, width)), *run.samples])
    number = samples_before + np.arange(values.shape[0])
    time = _read_only(run.interval * (keep.first + keep.every * number))
    return HistoryPiece(
        time=time,
        channels={
            channel.name: _read_only(on_beam(system, channel) * values[:, i + 1]) for i, channel in enumerate(channels)
        },
        units={channel.name: channel.unit for channel in channels},
        energy=_ledger(run, time) if run.ledger else None,
        snapshots=_snapshots(run, system, snapshots_before) if keep.snapshots else None,
        base=excitation,
    )


def _response(
    run: EventRun, system: System, excitation: Excitation, stream: Stream, samples: int, begin: float
) -> Response:
    interval, left = run.interval, stream.left()
    length = samples * interval - begin
    laws = ", ".join(dict.fromkeys(pair.law.name for pair in system.contacts)) or "none"
    totals = run.contact.totals.copy()
    # an impulse has no peak
    totals[4, [pair.parameters.kind == RIGID for pair in system.contacts]] = math.nan
    frequency = excitation.frequency
    impacts = _impacts(run, system, excitation)
    energy = left.energy
    warnings = []
    if energy is not None:
        bound = max(CLOSED, run.rounding / energy.largest_input) if energy.largest_input > 0.0 else CLOSED
        if not energy.residual <= BALANCED:
            raise DivergenceError(unbalanced(energy.residual))
        if energy.residual > bound:
            warnings.append(
                f"energy residual {energy.residual:.2g} of the energy put in, above {bound:.2g}: an event-driven run "
                "closes to rounding unless its modes span too many decades; keep fewer"
            )
    if impacts.dropped:
        warnings.append(
            f"{impacts.dropped} impacts beyond the first {len(impacts)} are not in the table (Recorder.impacts)"
        )
    return Response(
        time=left.time,
        channels=left.channels,
        units=left.units,
        impacts=impacts,
        riding=_riding(run, system),
        statistics=impact_statistics(totals, length, frequency, laws),
        statistics_of={
            pair.name: impact_statistics(totals[:, j : j + 1], length, frequency, pair.law.name)
            for j, pair in enumerate(system.contacts)
        },
        steady=_steady(cycle_statistics(run)),
        energy=energy,
        snapshots=left.snapshots,
        base=excitation,
        system=system,
        warnings=tuple(warnings),
        notes=(*truncation_notes(system), *_open_contacts(run, system)),
        streamed_to=stream.streamed_to,
    )


def _steady(cycles: CycleStatistics) -> SteadyMotion:
    finished = cycles.samples.shape[0]
    return steady_motion(cycles, np.array([max(finished // 3, 1)])) if finished else no_steady_motion()


def _impacts(run: EventRun, system: System, excitation: Excitation) -> Impacts:
    met = int(run.contact.tally[0])
    table = run.contact.impacts[: min(met, run.contact.impacts.shape[0])]
    columns = {name: _read_only(table[:, i]) for i, name in enumerate(IMPACT_COLUMNS)}
    pair, time = columns.pop("pair"), columns["time"]
    names = np.array([contact.name for contact in system.contacts] or [""])
    return Impacts(
        **columns,
        phase=_read_only(np.mod(2.0 * np.pi * excitation.frequency * time + excitation.phase, 2.0 * np.pi)),
        impactor=names[pair.astype(int)],
        energy_to_modes=_read_only(table[:, len(IMPACT_COLUMNS) :]),
        law={contact.name: contact.law.name for contact in system.contacts},
        dropped=met - table.shape[0],
    )


def _riding(run: EventRun, system: System) -> Riding:
    rides = run.rides
    names = np.array([system.contacts[ride.pair].name for ride in rides], dtype=str)
    end = run.interval * sum(piece.shape[0] for piece in run.cycles) * run.method.samples_per_cycle
    lasting = np.array([(ride.end if math.isfinite(ride.end) else end) - ride.start for ride in rides])
    impulse = np.array([ride.impulse for ride in rides])
    return Riding(
        impactor=names,
        side=np.array([float(ride.side) for ride in rides]),
        start=np.array([ride.start for ride in rides]),
        end=np.array([ride.end for ride in rides]),
        impulse=impulse,
        mean_force=np.divide(impulse, lasting, out=np.zeros_like(impulse), where=lasting > 0),
    )


def _open_contacts(run: EventRun, system: System) -> tuple[str, ...]:
    """Notes on what lasts at the end, and has no row in its table yet."""
    rides = (
        f"{system.contacts[pair].name} rides on its {'+' if side > 0 else '-'} wall since t = {start:.4g} s"
        for pair, (side, start, _) in sorted(run.open_rides.items())
    )
    touching = (
        f"{system.contacts[pair].name} is in contact at the end: that contact counts in forces and energies but is "
        "no finished impact"
        for pair in run.touching
    )
    return (*rides, *touching)


def _ledger(run: EventRun, time: NDArray[Any]) -> EnergyLedger:
    table = np.concatenate([np.zeros((0, len(ENERGY_COLUMNS) + run.system.dofs)), *run.energy])
    columns = {name: _read_only(table[:, i]) for i, name in enumerate(ENERGY_COLUMNS)}
    of_mode = _read_only(table[:, len(ENERGY_COLUMNS) :])
    return EnergyLedger(time=time, structure_loss_of_mode=of_mode, **columns)


def _snapshots(run: EventRun, system: System, before: int) -> Snapshots:
    n, keep = system.dofs, run.keep
    fields = np.concatenate([np.zeros((0, 2, n + len(system.balls))), *run.fields])
    u, v = (np.asarray((system.expansion @ fields[:, k, :n].T).T) for k in (0, 1))
    return Snapshots(
        time=_read_only(run.interval * (keep.first_snapshot + keep.snapshots * (before + np.arange(fields.shape[0])))),
        displacement=_read_only(u),
        velocity=_read_only(v),
        ball_displacement=_read_only(fields[:, 0, n:]),
        ball_velocity=_read_only(fields[:, 1, n:]),
        contact_force=_read_only(_forces(system, fields)),
    )


def _forces(system: System, fields: NDArray[Any]) -> NDArray[Any]:
    """Contact forces (N) on the beam in whole motions; none of an impulse."""
    force = np.zeros((fields.shape[0], len(system.contacts)))
    if not is_compliant(system):
        return force
    x, rate = (-(fields[:, k] @ force_directions(system)) for k in (0, 1))
    for j, pair in enumerate(system.contacts):
        on = -1.0 if pair.is_stop else 1.0
        for side, gap in zip((1.0, -1.0), pair.gaps, strict=True):
            depth = side * x[:, j] - gap
            push = pair.parameters.stiffness * depth + pair.parameters.damping * side * rate[:, j]
            force[:, j] += on * side * np.where(depth > 0.0, np.maximum(push, 0.0), 0.0)
    return force


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
