"""What is read from a signal or a curve: damping, decays, spectra, transfer functions, shocks, laser."""
