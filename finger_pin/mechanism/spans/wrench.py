"""Spans that carry forces which are no gradient of a length: directions that turn with a body, and couples."""

from __future__ import annotations

from finger_pin.mechanism.gaps.signed_distance import POINT, SLOPE_WIDTH
from finger_pin.mechanism.spans.span import SPAN_OUT, SPAN_OUT_SIZE, SPAN_SLOPE, SPAN_SLOPE_SIZE, WrapSegment, clear
from finger_pin.typing import Pointer


def thrust_value(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in no length and no turn, and for the pull on the second point the vector there from the first."""
    clear(out, SPAN_OUT_SIZE)
    for i in range(3):
        out[SPAN_OUT.second_pull + i] = points[POINT.second + i] - points[POINT.first + i]


def thrust_slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in the slopes of turn, zero, and of pull."""
    clear(out, SPAN_SLOPE_SIZE)
    for i in range(3):
        second = SPAN_SLOPE.second_pull + SLOPE_WIDTH * i
        out[second + POINT.first + i] = -1.0
        out[second + POINT.second + i] = 1.0


def couple_value(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in no length and no turn, and opposite pulls, the second of which is t x (second - first)."""
    clear(out, SPAN_OUT_SIZE)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        along_j = points[POINT.second + j] - points[POINT.first + j]
        along_k = points[POINT.second + k] - points[POINT.first + k]
        pull = p[j] * along_k - p[k] * along_j
        out[SPAN_OUT.first_pull + i], out[SPAN_OUT.second_pull + i] = -pull, pull


def couple_slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in the slopes of turn, zero, and of pull."""
    clear(out, SPAN_SLOPE_SIZE)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        first, second = SPAN_SLOPE.first_pull + SLOPE_WIDTH * i, SPAN_SLOPE.second_pull + SLOPE_WIDTH * i
        for row, sign in ((first, -1.0), (second, 1.0)):
            out[row + POINT.second + k], out[row + POINT.first + k] = sign * p[j], -sign * p[j]
            out[row + POINT.second + j], out[row + POINT.first + j] = -sign * p[k], sign * p[k]


#: A force at the second point by the vector from the first, both on the body that is pushed.
THRUST = WrapSegment("thrust", (), thrust_value, thrust_slopes)
#: Two forces across two points of a body, by a vector t of the frame.
COUPLE = WrapSegment("couple", ("x", "y", "z"), couple_value, couple_slopes)
