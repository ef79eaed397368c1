"""The largest value of any channel of an event-driven run: that run once more, with the channel as what is observed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femimpact.excitation import Excitation
from femimpact.integrators.channel_rows import channel_rows
from femimpact.integrators.event_driven.alone import block_alone, closed_drive, pieces
from femimpact.integrators.event_driven.block import EXTREMES, no_cycles, run_block
from femimpact.integrators.event_driven.reading_grid import reading_grid
from femimpact.integrators.event_driven.settings import EventSettings
from femimpact.integrators.event_driven.store import outputs_alone
from femimpact.response.channels import Channel
from femimpact.response.columns import MAXIMUM, MINIMUM
from femimpact.response.largest import Largest
from femimpact.response.response import Recorder
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["find_largest"]


def find_largest(
    system: System, excitation: Excitation, method: EventSettings, duration: float, recorder: Recorder, initial: State,
    channels: tuple[Channel, ...],
) -> tuple[Largest, ...]:  # fmt: skip
    """Largest values of channels over a run, each found as the peak of a cycle is, to 1e-9 of itself.

    Parameters
    ----------
    system, excitation, method, duration, recorder, initial
        As of `run_events`: the motion has the bits of that run.
    channels : tuple of Channel

    Returns
    -------
    tuple of Largest
    """
    return tuple(
        _largest(system, excitation, method, duration, recorder, initial, channel) for channel in channels
    )  # fmt: skip


def _largest(
    system: System, excitation: Excitation, method: EventSettings, duration: float, recorder: Recorder, initial: State,
    channel: Channel,
) -> Largest:  # fmt: skip
    grid, drive = reading_grid(system, excitation, method, duration, recorder), closed_drive(system, excitation)
    samples = round(duration / grid.interval)
    parts = list(pieces(grid, recorder.seen_from(initial.time), samples))
    outputs = outputs_alone(system, channel_rows(system, drive, (channel,), springs_apart=True), drive)
    # a piece takes the place of a base cycle
    whole = replace(grid, per_cycle=float(max(end - done for done, end in parts)))
    block, sampling = block_alone(
        system, excitation, drive, method, outputs, initial, whole, float(np.inf), None, 0
    )  # fmt: skip
    extremes, most = no_cycles(1, 1), float(method.most_events)
    for done, end in parts:
        begin = sampling.first + done
        block.cases.sample[0] = begin
        block.grid = block.grid._replace(
            origin=np.array([begin]), cycle=np.zeros(1, dtype=np.int64), cycles=extremes, kept=np.full(end - done, -1)
        )
        run_block(block, np.array([begin]), np.array([begin + end - done]), np.array([most * max(end - done, 1)]))
    row, times = extremes[0, 0], extremes[0, 0, -EXTREMES:]
    # the sooner one of two of one size
    which = MAXIMUM if (row[MAXIMUM], -times[MAXIMUM]) >= (-row[MINIMUM], -times[MINIMUM]) else MINIMUM
    return Largest(float(row[which]), float(times[which]), channel.unit)
