"""Contact of one scalar pair: when a ball touches, which wall, with what force, and how fast it rebounds."""

from femimpact.contact.collision import Collision, integrated_collision
from femimpact.contact.law import ContactLaw, a_law, collide, contact_force, contact_potential, require_law, resolve
from femimpact.contact.laws.custom_law import CustomLaw
from femimpact.contact.laws.kelvin_voigt import KelvinVoigt, spring_and_dashpot
from femimpact.contact.laws.power_law import (
    Flores,
    GonthierCarvalhoMartins,
    Hertz,
    HuntCrossley,
    LankaraniNikravesh,
    PowerLaw,
    loss_factor,
)
from femimpact.contact.laws.rigid import Rigid
from femimpact.contact.laws.switching_spring import SwitchingSpring
from femimpact.contact.material import ALUMINIUM, STEEL, Material, hertz_stiffness
from femimpact.contact.parameters import ContactParameters

__all__ = [
    "ALUMINIUM",
    "STEEL",
    "Collision",
    "ContactLaw",
    "ContactParameters",
    "CustomLaw",
    "Flores",
    "GonthierCarvalhoMartins",
    "Hertz",
    "HuntCrossley",
    "KelvinVoigt",
    "LankaraniNikravesh",
    "Material",
    "PowerLaw",
    "Rigid",
    "SwitchingSpring",
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
