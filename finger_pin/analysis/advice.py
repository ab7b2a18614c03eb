"""Advice before a run: micro-damping that lets friction (9) drive motion, and gravity that moves no joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.laws.bristle import passive_micro_damping
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Postures that are tried, and the arm of the weight, m, that counts as none.
_POSTURES, _LEAST_ARM = 4, 1e-12


# Many runs are of one finger.
def micro_damping_advice(finger: FingerDescription) -> str:
    """Return the warning about micro-damping that can drive motion, in one line; empty if it cannot."""
    tendons, joints = finger.numbers["tendon_friction"], finger.numbers["joint_friction"]
    # The normal force of a tendon is a factor of both coefficients: their ratio counts.
    ratio = tendons["stiction_ratio"]
    warnings = [
        _excess("tendon", finger.tendons, tendons, np.ones_like(ratio), ratio),
        _excess("joint", finger.joints, joints, joints["coulomb"], joints["stiction"]),
    ]
    return "; ".join(filter(None, warnings))


def _excess(kind: str, names: Iterable[str], numbers: Mapping[str, Array], kinetic: Array, static: Array) -> str:
    name_list = list(names)
    micro, b = numbers["micro_damping"], numbers["viscous"]
    limits = passive_micro_damping(b, kinetic, static)
    exceeding = [index for index in range(len(name_list)) if micro[index] > limits[index]]
    if not exceeding:
        return ""
    first = exceeding[0]
    return (
        f"finger.{kind}_friction.micro_damping = {micro[first]:g} can drive the motion of {name_list[first]}: "
        f"friction is passive up to {limits[first]:.3g} (b M^d / (M^c - M^d))"
    )


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
