"""Transfer functions, spectra of recorded channels, and shock response spectra."""

from femimpact.spectra.densities import Spectrum, amplitude_spectrum, spectrum
from femimpact.spectra.estimates import measured_transfer
from femimpact.spectra.shock_response import ShockResponseSpectrum, shock_response_spectrum
from femimpact.spectra.transfer import TransferFunction, transfer_function

__all__ = [
    "ShockResponseSpectrum", "Spectrum", "TransferFunction", "amplitude_spectrum", "measured_transfer",
    "shock_response_spectrum", "spectrum", "transfer_function",
]  # fmt: skip
