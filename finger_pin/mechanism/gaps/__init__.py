"""Gaps: signed distances of two bodies' surfaces, with normals, contact points, and all slopes in closed form."""

from finger_pin.mechanism.gaps.distance import PRISM
from finger_pin.mechanism.gaps.ellipsoids import ELLIPSOIDS
from finger_pin.mechanism.gaps.prism import prism_parameters
from finger_pin.mechanism.gaps.signed_distance import SignedDistance

__all__ = ["ELLIPSOIDS", "PRISM", "SignedDistance", "prism_parameters"]
