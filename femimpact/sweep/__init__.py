"""Stepped-sine sweeps."""

from femimpact.sweep.curve import ONE_START, SWEEP_UNITS, FrequencyResponse, on_grid
from femimpact.sweep.sweep import frequency_sweep

__all__ = ["ONE_START", "SWEEP_UNITS", "FrequencyResponse", "frequency_sweep", "on_grid"]
