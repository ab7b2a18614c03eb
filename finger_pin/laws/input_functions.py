"""Inputs number by number: the paper's controller (19), (22), signals over time, and the motion of a palm.

The path of a palm is its place p in the world and its attitude R = Rz(yaw) Ry(pitch) Rx(roll). In the palm's axes its
velocity is (omega, w) with w = R^T p', and the rate of these numbers is its acceleration; gravity, R^T g, is taken off,
so that bodies at rest on a palm at rest feel their weight (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 5).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from finger_pin.typing import Array, Number, Numbers, Numeric


def proportional_torque(gain: Numeric, reference: Numeric, position: Numeric) -> Numeric:
    """Return tau^d = K_P (theta^d - theta), N m, equation (19)."""
    return gain * (reference - position)


def internal_level(minimum: Numeric, minimal: Numeric, internal: Numeric) -> Numeric:
    """Return (f0 - f^m) / f^k; its largest entry is lambda of (22)."""
    return (minimum - minimal) / internal


def harmonic(time: Numeric, offset: Numeric, amplitude: Numeric, frequency: Numeric, phase: Numeric) -> Numeric:
    """Return offset + amplitude sin(2 pi frequency time + phase), rad."""
    return offset + amplitude * np.sin(2.0 * np.pi * frequency * time + phase)


def harmonic_rate(time: Numeric, amplitude: Numeric, frequency: Numeric, phase: Numeric) -> Numeric:
    """Return the time derivative of `harmonic`, rad/s."""
    circular = 2.0 * np.pi * frequency
    return amplitude * circular * np.cos(circular * time + phase)


def quintic(s: Numeric, c5: Numeric, c4: Numeric, c3: Numeric, c2: Numeric, c1: Numeric, c0: Numeric) -> Numeric:
    """Return c5 s^5 + ... + c1 s + c0, by Horner's rule."""
    return ((((c5 * s + c4) * s + c3) * s + c2) * s + c1) * s + c0


def quintic_rate(s: Numeric, c5: Numeric, c4: Numeric, c3: Numeric, c2: Numeric, c1: Numeric) -> Numeric:
    """Return the derivative of `quintic` with respect to s."""
    return (((5.0 * c5 * s + 4.0 * c4) * s + 3.0 * c3) * s + 2.0 * c2) * s + c1


def quintic_curvature(s: Numeric, c5: Numeric, c4: Numeric, c3: Numeric, c2: Numeric) -> Numeric:
    """Return the second derivative of `quintic` with respect to s."""
    return ((20.0 * c5 * s + 12.0 * c4) * s + 6.0 * c3) * s + 2.0 * c2


def base_motion(
    first: Sequence[Number] | Array,
    second: Sequence[Number] | Array,
    third: Sequence[Number] | Array,
    turns: Sequence[Number] | Array,
    gravity: Sequence[Number] | Array,
) -> Numbers:
    """Return 27 numbers: omega, w, omega', w' - R^T g, R^T g, and the rates of the first twelve.

    Args:
        first: Rates of x, y, z, roll, pitch, yaw; numbers, or arrays that broadcast.
        second: Their second derivatives.
        third: Their third derivatives.
        turns: Sine and cosine of roll, pitch and yaw, in turn.
        gravity: g in the world, three numbers.
    """
    sr, cr, sp, cp, sy, cy = turns
    r1, p1, y1 = first[3], first[4], first[5]
    r2, p2, y2 = second[3], second[4], second[5]
    r3, p3, y3 = third[3], third[4], third[5]
    # Sines and cosines of roll and pitch, and what yaw is multiplied by, with two derivatives each.
    sr1, cr1, sp1, cp1 = cr * r1, -sr * r1, cp * p1, -sp * p1
    sr2, cr2 = cr * r2 - sr * r1 * r1, -sr * r2 - cr * r1 * r1
    sp2, cp2 = cp * p2 - sp * p1 * p1, -sp * p2 - cp * p1 * p1
    u, u1, u2 = cp * sr, cp1 * sr + cp * sr1, cp2 * sr + 2.0 * cp1 * sr1 + cp * sr2
    t, t1, t2 = cp * cr, cp1 * cr + cp * cr1, cp2 * cr + 2.0 * cp1 * cr1 + cp * cr2
    a0, b0, c0 = r1 - y1 * sp, p1 * cr + y1 * u, y1 * t - p1 * sr
    a1 = r2 - y2 * sp - y1 * sp1
    b1 = p2 * cr + p1 * cr1 + y2 * u + y1 * u1
    c1 = y2 * t + y1 * t1 - p2 * sr - p1 * sr1
    a2 = r3 - y3 * sp - 2.0 * y2 * sp1 - y1 * sp2
    b2 = p3 * cr + 2.0 * p2 * cr1 + p1 * cr2 + y3 * u + 2.0 * y2 * u1 + y1 * u2
    c2 = y3 * t + 2.0 * y2 * t1 + y1 * t2 - p3 * sr - 2.0 * p2 * sr1 - p1 * sr2
    vx, vy, vz = _turned_back(sr, cr, sp, cp, sy, cy, first[0], first[1], first[2])
    ex, ey, ez = _turned_back(sr, cr, sp, cp, sy, cy, second[0], second[1], second[2])
    jx, jy, jz = _turned_back(sr, cr, sp, cp, sy, cy, third[0], third[1], third[2])
    gx, gy, gz = _turned_back(sr, cr, sp, cp, sy, cy, gravity[0], gravity[1], gravity[2])
    # w' = R^T p'' - omega x w, w'' = R^T p''' - omega x R^T p'' - omega' x w - omega x w'.
    wx, wy, wz = ex - (b0 * vz - c0 * vy), ey - (c0 * vx - a0 * vz), ez - (a0 * vy - b0 * vx)
    hx = jx - (b0 * ez - c0 * ey) - (b1 * vz - c1 * vy) - (b0 * wz - c0 * wy)
    hy = jy - (c0 * ex - a0 * ez) - (c1 * vx - a1 * vz) - (c0 * wx - a0 * wz)
    hz = jz - (a0 * ey - b0 * ex) - (a1 * vy - b1 * vx) - (a0 * wy - b0 * wx)
    # Of gravity R^T g the rate is -omega x R^T g.
    kx, ky, kz = hx + b0 * gz - c0 * gy, hy + c0 * gx - a0 * gz, hz + a0 * gy - b0 * gx
    velocity, acceleration = (a0, b0, c0, vx, vy, vz), (a1, b1, c1, wx - gx, wy - gy, wz - gz)
    return velocity + acceleration + (gx, gy, gz) + (a1, b1, c1, wx, wy, wz) + (a2, b2, c2, kx, ky, kz)


def _turned_back(
    sr: Number, cr: Number, sp: Number, cp: Number, sy: Number, cy: Number, x: Number, y: Number, z: Number
) -> Numbers:
    """Return R^T (x, y, z)."""
    along, across = cy * x + sy * y, cy * y - sy * x
    up = sp * along + cp * z
    return cp * along - sp * z, cr * across + sr * up, cr * up - sr * across
