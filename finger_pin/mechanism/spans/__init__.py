"""Pieces of paths through space: straight, wrapped about a cylinder or a sphere, or a function of a coordinate."""

from finger_pin.mechanism.spans.cylinder import CYLINDER
from finger_pin.mechanism.spans.polynomial import ANGLE, RISE
from finger_pin.mechanism.spans.span import STRAIGHT, WrapSegment
from finger_pin.mechanism.spans.sphere import SPHERE
from finger_pin.mechanism.spans.wrench import COUPLE, THRUST

#: All kinds.
SPANS = (STRAIGHT, CYLINDER, SPHERE, ANGLE, RISE, THRUST, COUPLE)

__all__ = ["ANGLE", "COUPLE", "CYLINDER", "RISE", "SPANS", "SPHERE", "STRAIGHT", "THRUST", "WrapSegment"]
