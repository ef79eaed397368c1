"""Contact of one scalar pair: when a ball touches, which wall, with what force, and how fast it rebounds."""

from femimpact.contact.collision import Collision, integrated_collision
from femimpact.contact.custom_law import CustomLaw
from femimpact.contact.law import ContactLaw, a_law, collide, contact_force, contact_potential, require_law, resolve
from femimpact.contact.laws import ALUMINIUM, STEEL, Material, hertz_stiffness, loss_factor, spring_and_dashpot

__all__ = [
    "ALUMINIUM",
    "STEEL",
    "Collision",
    "ContactLaw",
    "CustomLaw",
    "Material",
    "a_law",
    "collide",
    "contact_force",
    "contact_potential",
    "hertz_stiffness",
    "integrated_collision",
    "loss_factor",
    "require_law",
    "resolve",
    "spring_and_dashpot",
]
