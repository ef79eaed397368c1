"""The equations of motion: matrices, contacts, states, modes, reduction."""

from femimpact.system.system import ContactPair, State, System, without_impactors

__all__ = ["ContactPair", "State", "System", "without_impactors"]
