"""Results of a run: channels and history, impacts, the energy ledger, regimes."""
