"""The equations of motion: matrices, contacts, states, modes, reduction."""

from femimpact.system.contact_pair import ContactPair
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors

__all__ = ["ContactPair", "State", "System", "without_impactors"]
