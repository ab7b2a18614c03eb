"""Passivity of law (9): the limit of micro-damping beyond which friction can drive motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.laws.bristle import passive_micro_damping
from finger_pin.typing import Array


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
