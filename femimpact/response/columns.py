"""Columns of the tables that a run fills, in the order in which compiled loops write them."""

from __future__ import annotations

__all__ = [
    "APPROACH_SUM",
    "COUNT",
    "CYCLE_COLUMNS",
    "ENERGY_COLUMNS",
    "FORCE_TIME",
    "IMPACT_COLUMNS",
    "IMPULSE_SUM",
    "LARGEST_APPROACH",
    "MAXIMUM",
    "MINIMUM",
    "PEAK_FORCE",
    "TOTAL_COLUMNS",
]

# the first two are extremes of the motion, the others sums over samples; see signals.CycleStatistics
CYCLE_COLUMNS = ("maximum", "minimum", "square", "sine", "cosine", "samples")
MAXIMUM, MINIMUM = range(2)
ENERGY_COLUMNS = ("kinetic", "strain", "ball", "contact", "work", "structure_loss", "contact_loss")
IMPACT_COLUMNS = (
    "time", "pair", "side", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss",
)  # fmt: skip
TOTAL_COLUMNS = ("count", "approach_speed", "approach_speed_max", "impulse", "peak_force", "force_time")
COUNT, APPROACH_SUM, LARGEST_APPROACH, IMPULSE_SUM, PEAK_FORCE, FORCE_TIME = range(6)
# the first four count impacts that end within the window; the last two every force in it, sticking included
