"""What drives a run: motions of the base, or a force at a place. A new one is a class in a file of its own."""

from femimpact.excitation.excitation import BrokenLine, Excitation, Harmonic, require_excitation
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.point_force import PointForce
from femimpact.excitation.recorded_base import RecordedBase
from femimpact.excitation.sine import Sine

__all__ = [
    "BrokenLine", "Excitation", "Harmonic", "PiecewisePolynomial", "PointForce", "RecordedBase", "Sine",
    "require_excitation",
]  # fmt: skip
