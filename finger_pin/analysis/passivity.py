"""Passivity of law (9): the limit of micro-damping beyond which friction can drive motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from finger_pin.description.finger import FingerDescription
from finger_pin.laws.bristle import passive_micro_damping
from finger_pin.typing import Array


# Many runs are of one finger.
def micro_damping_advice(finger: FingerDescription) -> str:
    """Return the warning about micro-damping that can drive motion, in one line; empty if it cannot."""
    tendons, joints = finger.numbers["tendon_friction"], finger.numbers["joint_friction"]
    # The normal force of a tendon is a factor of both coefficients: their ratio counts.
    ratio = tendons["stiction_ratio"]
    warnings = [
        _exceeded("tendon", finger.tendons, tendons, np.ones_like(ratio), ratio),
        _exceeded("joint", finger.joints, joints, joints["coulomb"], joints["stiction"]),
    ]
    return "; ".join(filter(None, warnings))


def _exceeded(kind: str, names: Iterable[str], numbers: Mapping[str, Array], kinetic: Array, static: Array) -> str:
    listed = list(names)
    micro, b = numbers["micro_damping"], numbers["viscous"]
    most = passive_micro_damping(b, kinetic, static)
    wrong = [index for index in range(len(listed)) if micro[index] > most[index]]
    if not wrong:
        return ""
    first = wrong[0]
    return (
        f"finger.{kind}_friction.micro_damping = {micro[first]:g} can drive the motion of {listed[first]}: "
        f"friction is passive up to {most[first]:.3g} (b M^d / (M^c - M^d))"
    )
