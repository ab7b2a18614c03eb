"""Whether gravity acts on the joints of a finger at all."""

from __future__ import annotations

import numpy as np

from finger_pin.mechanism.finger import Finger

# Postures that are tried, and the arm of the weight, m, that counts as none.
_POSTURES, _LEAST_ARM = 4, 1e-12


def weight_advice(finger: Finger) -> str:
    """Return the warning about gravity that moves no joint in any posture, in one line; empty if it moves one."""
    body, limiter = finger.rigid_body, finger.stroke_limiter
    gravity = np.asarray(body.model.gravity.linear)
    shares = np.random.default_rng(0).uniform(size=(_POSTURES, len(limiter.lower)))
    weight = body.mass * float(np.linalg.norm(gravity))
    postures = limiter.lower + shares * (limiter.upper - limiter.lower)
    if weight == 0.0 or any(np.any(np.abs(body.gravity_torque(each)) > _LEAST_ARM * weight) for each in postures):
        return ""
    entry, values = "finger" if finger.description.hand is None else "hand", ", ".join(f"{each:g}" for each in gravity)
    return f"{entry}.gravity = [{values}] moves no joint, as all axes are along it: the links weigh nothing in this run"
