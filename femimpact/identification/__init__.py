"""Damping and frequency from a response curve or a free decay: arrays in, estimates out."""

from femimpact.identification.bandwidth import (
    UNRESOLVED,
    DampingEstimate,
    PeakResolution,
    amplitude_ratio_damping,
    half_power,
    peak_resolution,
    resolution_warnings,
)
from femimpact.identification.decay import DecayEstimate, DecayMode, identify_decay
from femimpact.identification.one_pole import fit_one_pole, one_pole_amplitude

__all__ = [
    "UNRESOLVED", "DampingEstimate", "DecayEstimate", "DecayMode", "PeakResolution", "amplitude_ratio_damping",
    "fit_one_pole", "half_power", "identify_decay", "one_pole_amplitude", "peak_resolution", "resolution_warnings",
]  # fmt: skip
