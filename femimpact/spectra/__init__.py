"""Transfer functions, spectra of recorded channels, and shock response spectra."""

from femimpact.spectra.transfer import TransferFunction, harmonic_amplitudes, transfer_function

__all__ = ["TransferFunction", "harmonic_amplitudes", "transfer_function"]
