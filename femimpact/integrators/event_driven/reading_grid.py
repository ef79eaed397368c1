"""At which instants an event-driven run is read, and what a base cycle is on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from femimpact.errors import require
from femimpact.excitation import Excitation
from femimpact.integrators.driving import drive_of
from femimpact.integrators.event_driven.settings import EventSettings
from femimpact.response.response import Recorder
from femimpact.system.system import System

__all__ = ["ReadingGrid", "reading_grid"]

SAMPLES_OF_A_PERIOD = 20
"""Readings in a period of the highest kept mode, under a drive by samples."""

MOST_SAMPLES = 1_000_000
"""Readings of a run under a drive by samples, where no interval is given."""

LEAST_SAMPLES = 8
"""Readings in a base cycle, of which its rms and harmonic are taken."""

WHOLE = 1e-9
"""Share of itself by which rounding may put a number of samples off a whole one."""


@dataclass(frozen=True)
class ReadingGrid:
    """Instants at which a run is read.

    Parameters
    ----------
    interval : float, s
    per_cycle : float
        Samples in what counts as a base cycle: those of a period of a sine, which need not be a whole number; under a
        drive by samples `LEAST_SAMPLES` or more.
    follows_cycles : bool
        Whether there are `EventSettings.samples_per_cycle` in each.
    chosen : tuple of str
        A note on how the interval was chosen where the drive is given by samples.
    """

    interval: float
    per_cycle: float
    follows_cycles: bool = False
    chosen: tuple[str, ...] = ()


def reading_grid(
    system: System, excitation: Excitation, method: EventSettings, duration: float, recorder: Recorder
) -> ReadingGrid:
    """The instants at which a run is read: as the recorder has them, or as they suit the drive.

    Without an interval of the recorder there are `samples_per_cycle` in a cycle of a sine. A drive by samples is read
    at their interval, or at 1/20 of the period of the highest kept mode if that is less, and at no more than 10^6
    instants.

    Parameters
    ----------
    system : System
        On its modes.
    excitation : Excitation
    method : EventSettings
    duration : float, s
    recorder : Recorder

    Returns
    -------
    ReadingGrid

    Raises
    ------
    InputError
        If the interval of the recorder leaves fewer than 8 readings in a cycle of a sine.
    """
    drive, chosen = drive_of(system, excitation), tuple[str, ...]()
    if not drive.in_pieces and recorder.interval is None:
        samples = method.samples_per_cycle
        return ReadingGrid((2.0 * math.pi / drive.omega) / samples, float(samples), follows_cycles=True)
    longest = 1.0 / (LEAST_SAMPLES * excitation.frequency)
    if recorder.interval is not None:
        interval = recorder.interval
        allowed = f"must be <= {longest:.4g} s, {LEAST_SAMPLES} readings in a cycle; Recorder.every keeps fewer of them"
        resolved = drive.in_pieces or interval <= longest * (1.0 + WHOLE)
        require(resolved, "record.interval", interval, "s", allowed)
    elif drive.line is not None:
        interval, chosen = _suited(system, drive.line.interval, "the interval of the samples that drive it", duration)
    elif drive.pieces is not None:
        knots = drive.pieces.knots
        mean = float(knots[-1] - knots[0]) / (knots.size - 1)
        interval, chosen = _suited(system, mean, "the mean length of the polynomials that drive it", duration)
    per_cycle = 1.0 / (excitation.frequency * interval)
    if abs(per_cycle - round(per_cycle)) <= WHOLE * per_cycle:
        per_cycle = float(round(per_cycle))
    # the largest line of a record may lie near its last one
    return ReadingGrid(interval, max(per_cycle, float(LEAST_SAMPLES)), chosen=chosen)


def _suited(system: System, between: float, reason: str, duration: float) -> tuple[float, tuple[str, ...]]:
    """Interval (s) that suits a drive with a time between its samples or knots (s), and a note that says so."""
    highest = math.sqrt(float(np.max(system.K.diagonal() / system.M.diagonal()))) / (2.0 * math.pi)
    period = 1.0 / highest if highest > 0.0 else math.inf
    finest = between
    if period / SAMPLES_OF_A_PERIOD < between:
        finest = period / SAMPLES_OF_A_PERIOD
        reason = f"1/{SAMPLES_OF_A_PERIOD} of the period of the highest kept mode, {highest:.4g} Hz"
    interval = finest
    # the state at the start is one of them
    if duration > (MOST_SAMPLES - 1) * finest:
        interval = duration / (MOST_SAMPLES - 1)
        reason = f"so that there are no more than {MOST_SAMPLES:,} readings; {finest:.4g} s would be {reason}"
    return interval, (
        f"read every {interval:.4g} s, {reason}; Recorder(interval=) sets another one, and largest(channel) of the "
        "response finds what lies between",
    )
