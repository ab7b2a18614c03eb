"""Products of vectors and symmetric matrices of three, as tuples."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

#: A vector.
Triple: TypeAlias = tuple[float, float, float]
#: Three vectors, such as the columns of a matrix.
Triples: TypeAlias = tuple[Triple, Triple, Triple]

ZERO: Triple = (0.0, 0.0, 0.0)


class Symmetric(NamedTuple):
    """A symmetric matrix of three."""

    xx: float
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float


class Quadratic(NamedTuple):
    """A quadratic function u^T H u / 2 + g . u."""

    hessian: Symmetric
    gradient: Triple


def dot(a: Triple, b: Triple) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Triple, b: Triple) -> Triple:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def norm(a: Triple) -> float:
    """Return |a|."""
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def add(a: Triple, b: Triple) -> Triple:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(factor: float, a: Triple) -> Triple:
    """Return a vector times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


def divide(a: Triple, divisor: float) -> Triple:
    """Return a vector divided by a number, which rounds otherwise than its inverse times the vector."""
    return a[0] / divisor, a[1] / divisor, a[2] / divisor


def weighted_sum(weights: Triple, vectors: Triples) -> Triple:
    """Return the sum of three vectors times their weights: the product of the matrix of these columns and a vector."""
    u, (f, g, e) = weights, vectors
    return (
        u[0] * f[0] + u[1] * g[0] + u[2] * e[0],
        u[0] * f[1] + u[1] * g[1] + u[2] * e[1],
        u[0] * f[2] + u[1] * g[2] + u[2] * e[2],
    )


def unit_vector(axis: int) -> Triple:
    """Return the unit vector along x, y or z: axis 0, 1 or 2."""
    return 1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2)


def product(h: Symmetric, a: Triple) -> Triple:
    """Return H a."""
    return (
        h.xx * a[0] + h.xy * a[1] + h.xz * a[2],
        h.xy * a[0] + h.yy * a[1] + h.yz * a[2],
        h.xz * a[0] + h.yz * a[1] + h.zz * a[2],
    )


def inverse(h: Symmetric) -> Symmetric:
    """Return the inverse of a matrix."""
    a, b, c, d, e, f = h
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    inverse_determinant = 1.0 / (a * aa + b * ab + c * ac)
    return Symmetric(
        *(aa * inverse_determinant, ab * inverse_determinant, ac * inverse_determinant),
        *(
            (a * f - c * c) * inverse_determinant,
            (b * c - a * e) * inverse_determinant,
            (a * d - b * b) * inverse_determinant,
        ),
    )


def perpendicular_vectors(a: Triple) -> tuple[Triple, Triple]:
    """Return two unit vectors across a unit vector (Duff et al., J. Computer Graphics Techniques 6(1), 2017)."""
    x, y, z = a
    sign = 1.0 if z >= 0.0 else -1.0
    k = -1.0 / (sign + z)
    return (1.0 + sign * x * x * k, sign * x * y * k, -sign * x), (x * y * k, sign + y * y * k, -y)
