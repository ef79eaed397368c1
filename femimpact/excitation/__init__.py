"""Excitations of a run: motions of the base, or a force at a place. A new one is a class in a separate file."""

from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import Drives
from femimpact.excitation.excitation import BrokenLine, Excitation, Harmonic, require_excitation
from femimpact.excitation.forces import HammerBlow, PointForce
from femimpact.excitation.harmonic import Sine, SteppedSine
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.records import RecordedBase
from femimpact.excitation.shock import Shock
from femimpact.excitation.sums import Sum

__all__ = [
    "BrokenLine", "Chirp", "Drives", "Excitation", "HammerBlow", "Harmonic", "PiecewisePolynomial", "PointForce",
    "RandomBase", "RecordedBase", "Shock", "Sine", "SteppedSine", "Sum", "require_excitation",
]  # fmt: skip
