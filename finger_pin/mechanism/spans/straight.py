"""A straight span: the distance of two points."""

from __future__ import annotations

import math
from typing import Any

from finger_pin.mechanism.spans.span import Span


def straight_value(y: Any, p: Any, out: Any) -> None:
    """Fill in length, no turn, and pull; no pull between coincident points."""
    length = math.sqrt((y[3] - y[0]) ** 2 + (y[4] - y[1]) ** 2 + (y[5] - y[2]) ** 2)
    share = 1.0 / length if length > 0.0 else 0.0
    out[0] = length
    out[1] = 0.0
    for i in range(3):
        out[5 + i] = share * (y[3 + i] - y[i])
        out[2 + i] = -out[5 + i]


def straight_slopes(y: Any, p: Any, out: Any) -> None:
    """Fill in the slopes: (I - d d^T) / length, for the direction d."""
    length = math.sqrt((y[3] - y[0]) ** 2 + (y[4] - y[1]) ** 2 + (y[5] - y[2]) ** 2)
    share = 1.0 / length if length > 0.0 else 0.0
    for i in range(3):
        out[i] = 0.0
        out[3 + i] = 0.0
        for j in range(3):
            across = share * (1.0 * (i == j) - share * share * (y[3 + i] - y[i]) * (y[3 + j] - y[j]))
            out[6 + 6 * i + j] = across
            out[9 + 6 * i + j] = -across
            out[24 + 6 * i + j] = -across
            out[27 + 6 * i + j] = across


#: The distance of the points.
STRAIGHT = Span("straight", (), straight_value, straight_slopes)
