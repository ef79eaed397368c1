"""The thing on the shaker: beam, bodies, stops, supports, damping."""

from femimpact.structure.structure import Beam, Impactor, PointMass, Segment, Stop, Structure, Support, glue_impactors

__all__ = ["Beam", "Impactor", "PointMass", "Segment", "Stop", "Structure", "Support", "glue_impactors"]
