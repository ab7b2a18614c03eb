"""Spatial algebra, compiled: motion vectors (angular, linear), force vectors (moment, force), inertias.

Everything is read before anything is written: the compiler cannot know that what is written is not read again.
"""

from __future__ import annotations

from typing import Any

from finger_pin.core.jit import compiled


@compiled
def motion_cross(a: Any, b: Any, out: Any) -> None:
    """Fill out = a x b for motion vectors."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    u = a[1] * b[5] - a[2] * b[4] + a[4] * b[2] - a[5] * b[1]
    v = a[2] * b[3] - a[0] * b[5] + a[5] * b[0] - a[3] * b[2]
    w = a[0] * b[4] - a[1] * b[3] + a[3] * b[1] - a[4] * b[0]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, u, v, w


@compiled
def add_force_cross(a: Any, f: Any, out: Any) -> None:
    """Add a x* f to out, a motion vector acting on a force vector."""
    x = out[0] + a[1] * f[2] - a[2] * f[1] + a[4] * f[5] - a[5] * f[4]
    y = out[1] + a[2] * f[0] - a[0] * f[2] + a[5] * f[3] - a[3] * f[5]
    z = out[2] + a[0] * f[1] - a[1] * f[0] + a[3] * f[4] - a[4] * f[3]
    u = out[3] + a[1] * f[5] - a[2] * f[4]
    v = out[4] + a[2] * f[3] - a[0] * f[5]
    w = out[5] + a[0] * f[4] - a[1] * f[3]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, u, v, w


@compiled
def apply_inertia(inertia: Any, a: Any, out: Any) -> None:
    """Fill out = I a; an inertia is (mass, first moment h, second moment about O: xx xy xz yy yz zz)."""
    m, hx, hy, hz = inertia[0], inertia[1], inertia[2], inertia[3]
    x = inertia[4] * a[0] + inertia[5] * a[1] + inertia[6] * a[2] + hy * a[5] - hz * a[4]
    y = inertia[5] * a[0] + inertia[7] * a[1] + inertia[8] * a[2] + hz * a[3] - hx * a[5]
    z = inertia[6] * a[0] + inertia[8] * a[1] + inertia[9] * a[2] + hx * a[4] - hy * a[3]
    u = m * a[3] - hy * a[2] + hz * a[1]
    v = m * a[4] - hz * a[0] + hx * a[2]
    w = m * a[5] - hx * a[1] + hy * a[0]
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, u, v, w


@compiled
def dot(a: Any, b: Any) -> Any:
    """Return the scalar product of a motion and a force vector."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
