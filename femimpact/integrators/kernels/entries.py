"""Entries from Python into functions that compiled ones call; each is compiled when Python first calls it."""

from __future__ import annotations

from femimpact.integrators.kernels import balance, crossing, events, keeping, ledger
from femimpact.integrators.kernels.compiling import entry

__all__ = [
    "collide_all",
    "comes_to_rest",
    "derivatives",
    "keep",
    "look_at_all",
    "measure",
    "read_coordinates",
    "write_balance",
    "write_energy",
]

collide_all = entry(events.collide_all)
comes_to_rest = entry(events.comes_to_rest)
derivatives = entry(crossing.derivatives)
keep = entry(keeping.keep)
look_at_all = entry(events.look_at_all)
measure = entry(crossing.measure)
read_coordinates = entry(crossing.read_coordinates)
write_balance = entry(balance.write_balance)
write_energy = entry(ledger.write_energy)
