"""Pieces of paths through space: straight, or wrapped about a cylinder or a sphere, a kind a file."""

from finger_pin.mechanism.spans.cylinder import CYLINDER
from finger_pin.mechanism.spans.span import Span
from finger_pin.mechanism.spans.sphere import SPHERE
from finger_pin.mechanism.spans.straight import STRAIGHT

#: All kinds.
SPANS = (STRAIGHT, CYLINDER, SPHERE)

__all__ = ["CYLINDER", "SPANS", "SPHERE", "STRAIGHT", "Span"]
