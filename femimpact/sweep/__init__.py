"""Stepped-sine sweeps."""

from femimpact.sweep.curve import SWEEP_UNITS, FrequencyResponse
from femimpact.sweep.sweep import frequency_sweep

__all__ = ["SWEEP_UNITS", "FrequencyResponse", "frequency_sweep"]
