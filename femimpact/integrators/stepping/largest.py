"""The largest value of any channel of a stepped run: the run once more, with the channels read at every step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from femimpact.response.channels import Channel
from femimpact.response.history import HistoryPiece
from femimpact.response.largest import Largest, LargestSample
from femimpact.response.response import Recorder

__all__ = ["find_largest"]

PIECE = 10_000
"""Steps in memory at once."""

NO_LIMIT = 1e30
"""Bytes: a piece is all that is kept."""


def find_largest(
    run: Callable[[Recorder], Any], recorder: Recorder, channels: tuple[Channel, ...]
) -> tuple[Largest, ...]:
    """Largest values of channels over all steps of a run.

    Parameters
    ----------
    run : callable
        The run, with what it is to keep: its steps have the same bits whatever that is.
    recorder : Recorder
        Of the run before.
    channels : tuple of Channel

    Returns
    -------
    tuple of Largest
    """
    found = [LargestSample() for _ in channels]

    def take(piece: HistoryPiece) -> None:
        for one, channel in zip(found, channels, strict=True):
            one.add(piece.channels[channel.name], piece.time)

    every_step = replace(
        recorder, channels=channels, every=1, start=0.0, snapshots=0, state_at=None, impacts=0, ledger=False,
        memory_limit=NO_LIMIT, sink=take, piece_samples=PIECE,
    )  # fmt: skip
    run(every_step)
    return tuple(
        Largest(one.value, one.time or 0.0, channel.unit) for one, channel in zip(found, channels, strict=True)
    )
