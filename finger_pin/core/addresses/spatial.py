"""Spatial algebra, compiled: motion vectors (angular, linear), force vectors (moment, force), inertias.

Everything is read before anything is written: the compiler cannot know that what is written is not read again.
"""

from __future__ import annotations

import numpy as np

from finger_pin.core.jit import Vector, njit_inline

_TWO_OVER_PI = 0.6366197723675814
# pi / 2 in parts of 33 bits, whose products with small integers are exact.
_FIRST, _SECOND, _THIRD = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
_LARGE = 1e5


@njit_inline
def motion_cross(a: Vector, b: Vector, out: Vector) -> None:
    """Fill out = a x b for motion vectors."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    u = a[1] * b[5] - a[2] * b[4] + a[4] * b[2] - a[5] * b[1]
    v = a[2] * b[3] - a[0] * b[5] + a[5] * b[0] - a[3] * b[2]
    w = a[0] * b[4] - a[1] * b[3] + a[3] * b[1] - a[4] * b[0]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, u, v, w


@njit_inline
def add_force_cross(a: Vector, f: Vector, out: Vector) -> None:
    """Add a x* f to out, a motion vector acting on a force vector."""
    x = out[0] + a[1] * f[2] - a[2] * f[1] + a[4] * f[5] - a[5] * f[4]
    y = out[1] + a[2] * f[0] - a[0] * f[2] + a[5] * f[3] - a[3] * f[5]
    z = out[2] + a[0] * f[1] - a[1] * f[0] + a[3] * f[4] - a[4] * f[3]
    u = out[3] + a[1] * f[5] - a[2] * f[4]
    v = out[4] + a[2] * f[3] - a[0] * f[5]
    w = out[5] + a[0] * f[4] - a[1] * f[3]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, u, v, w


@njit_inline
def apply_inertia(inertia: Vector, a: Vector, out: Vector) -> None:
    """Fill out = I a; an inertia is (mass, first moment h, second moment about O: xx xy xz yy yz zz)."""
    m, hx, hy, hz = inertia[0], inertia[1], inertia[2], inertia[3]
    x = inertia[4] * a[0] + inertia[5] * a[1] + inertia[6] * a[2] + hy * a[5] - hz * a[4]
    y = inertia[5] * a[0] + inertia[7] * a[1] + inertia[8] * a[2] + hz * a[3] - hx * a[5]
    z = inertia[6] * a[0] + inertia[8] * a[1] + inertia[9] * a[2] + hx * a[4] - hy * a[3]
    u = m * a[3] - hy * a[2] + hz * a[1]
    v = m * a[4] - hz * a[0] + hx * a[2]
    w = m * a[5] - hx * a[1] + hy * a[0]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, u, v, w


@njit_inline
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of a motion and a force vector."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@njit_inline
def sine_cosine(angle: float) -> tuple[float, float]:
    """Return sine and cosine of an angle, rad."""
    if not abs(angle) < _LARGE:
        return np.sin(angle), np.cos(angle)
    turns = np.floor(angle * _TWO_OVER_PI + 0.5)
    x = ((angle - turns * _FIRST) - turns * _SECOND) - turns * _THIRD
    z = x * x
    sine = x + z * x * (_S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * (_S5 + z * _S6)))))
    half = 0.5 * z
    rounded = 1.0 - half
    cosine = rounded + (
        ((1.0 - rounded) - half) + z * z * (_C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * _C6)))))
    )
    quarter = int(turns) & 3
    if quarter == 0:
        return sine, cosine
    if quarter == 1:
        return cosine, -sine
    if quarter == 2:
        return -sine, -cosine
    return -cosine, sine
