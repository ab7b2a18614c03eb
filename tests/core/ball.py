"""A gap of the tests' own, between a point and a ball about the frame's origin: closed forms, short and smooth."""

import math

from finger_pin.mechanism.gaps.gap import Gap


def _value(y, p, out):
    r = math.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2)
    out[0] = r - p[0]
    nx, ny, nz = y[0] / r, y[1] / r, y[2] / r
    across = math.sqrt(ny * ny + nz * nz)
    ty, tz = nz / across, -ny / across
    for i, number in enumerate((nx, ny, nz, 0.5 * y[0], 0.5 * y[1], 0.5 * y[2], 0.0, ty, tz)):
        out[1 + i] = number
    out[10], out[11], out[12] = ny * tz - nz * ty, -nx * tz, nx * ty


def _slopes(y, p, out):
    r = math.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2)
    nx, ny, nz = y[0] / r, y[1] / r, y[2] / r
    across = math.sqrt(ny * ny + nz * nz)
    ty, tz = nz / across, -ny / across
    for i in range(78):
        out[i] = 0.0
    for c in range(3):
        n = nx if c == 0 else ny if c == 1 else nz
        dx, dy, dz = ((c == 0) - n * nx) / r, ((c == 1) - n * ny) / r, ((c == 2) - n * nz) / r
        along = ty * dz - tz * dy
        uy, uz = (dz - ty * along) / across, (-dy - tz * along) / across
        out[c], out[6 + c], out[12 + c] = dx, dy, dz
        out[18 + 7 * c] = 0.5
        out[42 + c], out[48 + c] = uy, uz
        out[54 + c] = dy * tz + ny * uz - dz * ty - nz * uy
        out[60 + c] = -dx * tz - nx * uz
        out[66 + c] = dx * ty + nx * uy
        out[72 + c] = n


BALL = Gap("ball", ("radius",), _value, _slopes)
