"""What drives a run: motions of the base, or a force at a place. A new one is a class in a separate file."""

from femimpact.excitation.chirp import Chirp
from femimpact.excitation.excitation import BrokenLine, Excitation, Harmonic, require_excitation
from femimpact.excitation.hammer_blow import HammerBlow
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.point_force import PointForce
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.recorded_base import RecordedBase
from femimpact.excitation.shock import Shock
from femimpact.excitation.sine import Sine
from femimpact.excitation.stepped_sine import SteppedSine
from femimpact.excitation.sums import Sum

__all__ = [
    "BrokenLine", "Chirp", "Excitation", "HammerBlow", "Harmonic", "PiecewisePolynomial", "PointForce", "RandomBase",
    "RecordedBase", "Shock", "Sine", "SteppedSine", "Sum", "require_excitation",
]  # fmt: skip
