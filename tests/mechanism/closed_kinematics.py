"""The kinematics of the paper's finger by hand: equation (1), and its links from Table I."""

from functools import partial

import numpy as np
from validation import kinematics

LENGTHS = A1, A2, A3, A4 = 20.2e-3, 45.0e-3, 29.9e-3, 21.8e-3
equation_1 = partial(kinematics.equation_1, LENGTHS)


def frames(q):
    """Rotation and origin of the four links and of the fingertip: Rz(theta1) Rx(90 deg), then turns about z."""
    c, s = np.cos(q[0]), np.sin(q[0])
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    result = [(rotation, np.zeros(3))]
    origin = rotation @ [A1, 0, 0]
    rotation = rotation @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for angle, length in zip(q[1:], LENGTHS[1:], strict=True):
        c, s = np.cos(angle), np.sin(angle)
        rotation = rotation @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        result.append((rotation, origin))
        origin = origin + rotation @ [length, 0, 0]
    return [*result, (rotation, origin)]
