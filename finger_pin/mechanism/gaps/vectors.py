"""Products of vectors and symmetric matrices of three, as tuples; matrices are xx, xy, xz, yy, yz, zz."""

from __future__ import annotations

from typing import Any

import numpy as np


def dot(a: Any, b: Any) -> Any:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Any, b: Any) -> Any:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def turned(h: Any, x: float, y: float, z: float) -> Any:
    """Return the product of a matrix and a vector."""
    return h[0] * x + h[1] * y + h[2] * z, h[1] * x + h[3] * y + h[4] * z, h[2] * x + h[4] * y + h[5] * z


def inverse_matrix(a: float, b: float, c: float, d: float, e: float, f: float) -> Any:
    """Return the inverse of a matrix."""
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    whole = 1.0 / (a * aa + b * ab + c * ac)
    return aa * whole, ab * whole, ac * whole, (a * f - c * c) * whole, (b * c - a * e) * whole, (a * d - b * b) * whole


def perpendicular_vectors(a: float, b: float, c: float) -> Any:
    """Return two unit vectors across a unit vector (Duff et al., J. Computer Graphics Techniques 6(1), 2017)."""
    sign = 1.0 if c >= 0.0 else -1.0
    k = -1.0 / (sign + c)
    return (1.0 + sign * a * a * k, sign * a * b * k, -sign * a), (a * b * k, sign + b * b * k, -b)


def size(a: Any) -> Any:
    """Return |a|."""
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
