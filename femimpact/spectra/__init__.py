"""Transfer functions, spectra of recorded channels, and shock response spectra."""

from femimpact.spectra.densities import Spectrum, amplitude_spectrum, drive_history, spectrum
from femimpact.spectra.estimates import measured_transfer
from femimpact.spectra.shock_response import ShockResponseSpectrum, shock_response_spectrum
from femimpact.spectra.transfer import TransferFunction, harmonic_amplitudes, transfer_function

__all__ = [
    "ShockResponseSpectrum", "Spectrum", "TransferFunction", "amplitude_spectrum", "drive_history",
    "harmonic_amplitudes", "measured_transfer", "shock_response_spectrum", "spectrum", "transfer_function",
]  # fmt: skip
