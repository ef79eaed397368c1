"""Contact of one scalar pair: when a ball touches, which wall, with what force, and what comes back."""

from femimpact.contact.collision import Collision, collide, contact_force, contact_potential
from femimpact.contact.laws import (
    ALUMINIUM,
    STEEL,
    ContactLaw,
    CustomLaw,
    Flores,
    GonthierCarvalhoMartins,
    Hertz,
    HuntCrossley,
    KelvinVoigt,
    LankaraniNikravesh,
    Material,
    PowerLaw,
    Rigid,
    SwitchingSpring,
    hertz_stiffness,
    require_law,
)
from femimpact.contact.parameters import ContactParameters, resolve

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
    "collide",
    "contact_force",
    "contact_potential",
    "hertz_stiffness",
    "require_law",
    "resolve",
]
