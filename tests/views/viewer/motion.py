"""A motion to look at, and where it puts the finger, worked out by hand."""

import json

import numpy as np
import xarray as xr

import finger_pin as fp

DURATION = 4.0


def table(finger):
    return fp.load_finger(finger).model_dump(mode="json", exclude_none=True)


def joint_position(t):
    """The references of the scenario reversals; the distal joint in a fixed ratio to the medial one."""
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
        attrs={"title": "a <test> motion", "finger": json.dumps(table("ub_stand_in"))},
    )
