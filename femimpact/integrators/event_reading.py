"""What is read of an event-driven run: samples, energies, snapshots and the statistics of its cycles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.event_state import EventRun, kept_rows, require_finite
from femimpact.integrators.flight_space import Riders
from femimpact.integrators.kernels import entries
from femimpact.integrators.kernels.events import Samples
from femimpact.integrators.layout import CYCLE_COLUMNS, ENERGY_COLUMNS

__all__ = ["gather", "keep_start", "read_with", "samples_of"]


def samples_of(run: EventRun, done: int, count: int) -> Samples:
    """Arrays of one piece; which of its samples are kept and shown."""
    n, d = run.system.dofs, run.balance.mass.size
    kept, shown = kept_rows(run, done, count)
    outputs = len(run.outputs.force)
    nothing = np.zeros((outputs, 0))
    return Samples(
        interval=np.array([run.interval]),
        done=np.array([done, 0], dtype=np.int64),
        weight=nothing.astype(complex),
        particle=nothing,
        particle_rate=nothing,
        sine=np.zeros(outputs, dtype=complex),
        constant=np.zeros(outputs),
        follow=np.zeros(outputs),
        follow_rate=np.zeros(outputs),
        values=np.zeros((count, outputs)),
        kept=kept,
        shown=shown,
        energy=np.zeros(((int(kept.max()) + 1) if run.ledger else 0, len(ENERGY_COLUMNS) + n)),
        fields=np.zeros((int(shown.max()) + 1, 2, d)),
    )


def read_with(run: EventRun, riders: Riders, out: Samples) -> Samples:
    """The piece's arrays with the output rows of who rides now."""
    closed, space = run.space(riders)
    position, rate = run.outputs.position, run.outputs.rate
    weight = position @ space.shape + rate @ space.shape_rate
    sine = position @ space.shape_sine + 1j * space.watch.omega * (rate @ space.shape_sine)
    constant, follow = position @ space.shape_constant, position @ space.shape_follow
    follow_rate = position @ space.shape_follow_rate + rate @ space.shape_follow
    number = {pair: i for i, (pair, _) in enumerate(riders)}
    for o, pair in enumerate(run.outputs.force):
        if pair in number:
            i, wave = number[pair], complex(0.0, -run.drive.amplitude)
            weight[o], sine[o] = closed.force_shape[i], closed.force_harmonic[i] * wave
            constant[o], follow[o] = closed.force_static[i], closed.force_follow[i]
            follow_rate[o] = closed.force_follow_rate[i]
    return out._replace(
        weight=np.ascontiguousarray(weight, dtype=complex),
        particle=np.ascontiguousarray(position @ space.particle_shape),
        particle_rate=np.ascontiguousarray(rate @ space.particle_shape),
        sine=np.ascontiguousarray(sine, dtype=complex),
        constant=constant,
        follow=follow,
        follow_rate=follow_rate,
    )


def keep_start(run: EventRun, position: NDArray[Any], velocity: NDArray[Any]) -> None:
    """The state at t = 0 where it is asked for."""
    if run.keep.every and run.keep.first == 0:
        rows = run.outputs
        run.samples.append((rows.position @ position + rows.rate @ velocity)[None, :])
        if run.ledger:
            run.balance.position[:], run.balance.velocity[:] = position, velocity
            energy = np.zeros((1, len(ENERGY_COLUMNS) + run.system.dofs))
            entries.write_balance(run.balance, energy[0])
            run.energy.append(energy)
    if run.keep.snapshots and run.keep.first_snapshot == 0:
        run.fields.append(np.array([[position, velocity]]))


def gather(run: EventRun, out: Samples, done: int) -> None:
    """Statistics of the piece's whole cycles, and the samples that are kept."""
    require_finite(out.values, (done + out.values.shape[0]) * run.interval)
    per_cycle = run.method.samples_per_cycle
    whole = out.values.shape[0] // per_cycle
    w = out.values[: whole * per_cycle, 0].reshape(whole, per_cycle)
    theta = run.drive.phase + 2.0 * np.pi * (np.arange(per_cycle) + 1) / per_cycle
    columns = (_crests(w), -_crests(-w), (w**2).sum(axis=1), w @ np.sin(theta), w @ np.cos(theta))
    table = np.stack([*columns, np.full(whole, float(per_cycle))], axis=1)
    run.cycles.append(table.reshape(whole, len(CYCLE_COLUMNS)))
    run.samples.append(out.values[out.kept >= 0])
    run.energy.append(out.energy)
    run.fields.append(out.fields)


def _crests(w: NDArray[Any]) -> NDArray[Any]:
    """Largest value of every row, by the parabola through the largest sample and its neighbours."""
    if w.shape[0] == 0:
        return np.zeros(0)
    i = np.clip(np.argmax(w, axis=1), 1, w.shape[1] - 2)
    row = np.arange(w.shape[0])
    before, at, after = w[row, i - 1], w[row, i], w[row, i + 1]
    bend = np.minimum(before + after - 2.0 * at, -1e-300)
    crest = at - 0.125 * (after - before) ** 2 / bend
    inside = np.abs(after - before) <= -2.0 * bend
    return np.asarray(np.where(inside & (at >= before) & (at >= after), crest, w.max(axis=1)))
