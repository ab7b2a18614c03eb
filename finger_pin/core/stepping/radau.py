"""The Radau IIA method of three nodes for a linear equation, from the solutions of single nodes, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.evaluation.condensation import factorise, substitute
from finger_pin.core.jit import compiled

_ROOT = np.sqrt(6.0)
#: The nodes c, and the method's matrix; `WEIGHTS` is its inverse.
NODES = np.array([(4.0 - _ROOT) / 10.0, (4.0 + _ROOT) / 10.0, 1.0])
MATRIX = np.array(
    [
        [(88.0 - 7.0 * _ROOT) / 360.0, (296.0 - 169.0 * _ROOT) / 1800.0, (-2.0 + 3.0 * _ROOT) / 225.0],
        [(296.0 + 169.0 * _ROOT) / 1800.0, (88.0 + 7.0 * _ROOT) / 360.0, (-2.0 - 3.0 * _ROOT) / 225.0],
        [(16.0 - _ROOT) / 36.0, (16.0 + _ROOT) / 36.0, 1.0 / 9.0],
    ]
)
WEIGHTS = np.linalg.inv(MATRIX)


@compiled
def multiply(left: Any, right: Any, columns: int, out: Any) -> None:
    """Fill some columns of a product."""
    for i in range(left.shape[0]):
        row = out[i]
        for c in range(columns):
            row[c] = 0.0
        for k in range(left.shape[1]):
            factor, source = left[i, k], right[k]
            for c in range(columns):
                row[c] += factor * source[c]


@compiled
def join(col: Any, h: float) -> Any:
    """Solve for S at the nodes: the first is eliminated, then the second; false if that is singular."""
    size, count = col.derivative.shape
    first, second, third = col.resolvents[0], col.resolvents[1], col.resolvents[2]
    w, given, square, wide, out = col.weights, col.given, col.square[0], col.wide[0], col.wide[1]
    # Row 2: (1 - w21 w12 R2 R1) Y2 = d2 - w21 R2 d1 + (w21 w13 R2 R1 - w23 R2) Y3.
    w12, w13, w21, w23 = w[0, 1] / h, w[0, 2] / h, w[1, 0] / h, w[1, 2] / h
    multiply(second, first, size, square)
    multiply(second, given[0], count, out)
    for i in range(size):
        for c in range(size):
            product = square[i, c]
            wide[i, c] = w21 * w13 * product - w23 * second[i, c]
            square[i, c] = -w21 * w12 * product
        square[i, i] += 1.0
        for k in range(count):
            wide[i, size + k] = given[1, i, k] - w21 * out[i, k]
    if not factorise(square, size, col.pivots):
        return False
    substitute(square, size, col.pivots, wide, size + count)
    # Row 3: (1 - w31 w13 R3 R1) Y3 = d3 - w31 R3 d1 + (w31 w12 R3 R1 - w32 R3) Y2.
    w31, w32, joining = w[2, 0] / h, w[2, 1] / h, col.square[1]
    multiply(third, given[0], count, out)
    for i in range(size):
        for k in range(count):
            given[2, i, k] -= w31 * out[i, k]
    multiply(third, first, size, square)
    for i in range(size):
        for c in range(size):
            product = square[i, c]
            joining[i, c] = w31 * w12 * product - w32 * third[i, c]
            square[i, c] = -w31 * w13 * product
        square[i, i] += 1.0
    multiply(joining, wide, size + count, out)
    for i in range(size):
        for c in range(size):
            square[i, c] -= out[i, c]
        for k in range(count):
            given[2, i, k] += out[i, size + k]
    if not factorise(square, size, col.pivots):
        return False
    substitute(square, size, col.pivots, given[2], count)
    for i in range(size):
        for k in range(count):
            value = wide[i, size + k]
            for c in range(size):
                value += wide[i, c] * given[2, c, k]
            given[1, i, k] = value
    for i in range(size):
        for k in range(count):
            out[i, k] = w12 * given[1, i, k] + w13 * given[2, i, k]
    multiply(first, out, count, wide)
    for i in range(size):
        for k in range(count):
            given[0, i, k] -= wide[i, k]
    return True
