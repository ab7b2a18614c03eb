"""A motion to look at, and where it puts the finger, worked out by hand."""

import json

import numpy as np
import xarray as xr

import finger_pin as fp

LENGTHS = np.array([20.2, 45.0, 29.9, 21.8]) * 1e-3
DURATION = 4.0


def table(finger):
    return fp.load_finger(finger).model_dump(mode="json", exclude_none=True)


def joint_position(t):
    """The references of the scenario fig6; the distal joint in a fixed ratio to the medial one."""
    medial = np.radians(35 - 25 * np.cos(np.pi * t))
    proximal = np.radians(35 - 25 * np.cos(np.pi * t / 2))
    return np.stack([np.radians(8) * np.sin(np.pi * t), proximal, medial, 0.7 * medial], axis=-1)


def tensions(t):
    """T1 is slack in every second half-period of 1 s; the others are not."""
    return np.stack([3 * np.maximum(0, np.sin(np.pi * t)), 2 + 0 * t, 5 + 4 * np.cos(t), 1.5 + t / 2, 3 + t / 4], -1)


def make_result():
    t = np.arange(0, DURATION + 5e-4, 1e-3)
    return xr.Dataset(
        {
            "joint_position": (("time", "joint"), joint_position(t)),
            "tendon_tension": (("time", "tendon"), tensions(t)),
            "passive_tension_proximal": ("time", 0.5 * tensions(t)[:, 4]),
        },
        coords={"time": t},
        attrs={"title": "a <test> motion", "finger": json.dumps(table("ub"))},
    )


def link_frames(q):
    """Rotation and origin of the links and of the fingertip, by hand from Table I."""
    c, s = np.cos(q[0]), np.sin(q[0])
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    result = [(rotation, np.zeros(3))]
    origin = rotation @ [LENGTHS[0], 0, 0]
    rotation = rotation @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for angle, length in zip(q[1:], LENGTHS[1:], strict=True):
        c, s = np.cos(angle), np.sin(angle)
        rotation = rotation @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        result.append((rotation, origin))
        origin = origin + rotation @ [length, 0, 0]
    return [*result, (rotation, origin)]


def fingertip(q):
    """Equation (1)."""
    a1, a2, a3, a4 = LENGTHS
    t1, t2, t23, t234 = q[0], q[1], q[1] + q[2], q[1] + q[2] + q[3]
    reach = a1 + a2 * np.cos(t2) + a3 * np.cos(t23) + a4 * np.cos(t234)
    height = a2 * np.sin(t2) + a3 * np.sin(t23) + a4 * np.sin(t234)
    return np.array([np.cos(t1) * reach, np.sin(t1) * reach, height])
