"""The thing on the shaker: beam, bodies, stops, supports, damping."""

from femimpact.structure.beam import Beam, Segment
from femimpact.structure.structure import Impactor, PointMass, Stop, Structure, Support, glue_impactors

__all__ = ["Beam", "Impactor", "PointMass", "Segment", "Stop", "Structure", "Support", "glue_impactors"]
