"""Entries from Python into functions that compiled ones call; each is compiled when Python first calls it."""

from __future__ import annotations

from femimpact.integrators.compiled.compiling import entry
from femimpact.integrators.stepping import keeping, ledger

__all__ = ["keep", "write_energy"]

keep = entry(keeping.keep)
write_energy = entry(ledger.write_energy)
