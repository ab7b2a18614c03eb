"""The posture that motors tell: their cords are just taut, and springs share the lengths."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.optimize

from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.validation import finite_vector, suggestion
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.typing import Array

# By how much motors may miss their angles, rad, where springs store a joule less; and by how little, in the root of a
# joule a radian, the posture that is near counts beside springs.
_MISFIT, _NEAR = 1e-4, 1e-3


def taut_posture(
    finger: FingerLike, motor_position: Mapping[str, float], near: Array, coupling: PassiveCoupling
) -> tuple[Array, Array]:
    """Return the posture in which taut cords turn motors to angles, shape (n,), and how joints may turn then, (n, n).

    Of many such postures it is that in which springs store least. What joints may turn by without any motor is the
    second array times changes of angles, to first order.

    Args:
        finger: The finger or its description.
        motor_position: By motor theta_m, rad; others follow.
        near: A posture, shape (n,), rad, for joints that neither motors nor springs tell of.
        coupling: The joints that passive tendons drive.

    Raises:
        InputError: Naming a motor that is none, or an angle that is not finite.
    """
    finger = as_finger(finger)
    names, limiter = finger.actuators.names, finger.stroke_limiter
    for name in motor_position:
        if name not in names:
            raise InputError(f"motor_position.{name}", f"no such motor{suggestion(name, names)}")
    told = [names.index(name) for name in motor_position]
    angles = finite_vector("motor_position", np.array([*motor_position.values()], dtype=float), len(told))
    springs = [joint.spring for joint in finger.description.joints.values()]
    stiffness = np.array([0.0 if each is None else each.stiffness for each in springs])

    def misfit(base: Array) -> Array:
        theta = coupling.posture(base[coupling.free])
        motors = finger.layout.unpack(finger.rest_state(theta)).motor_position[told]
        stored = np.sqrt(0.5 * stiffness) * (theta - finger.springs.rest)
        return np.concatenate([(motors - angles) / _MISFIT, stored, _NEAR * (base - near)])

    bounds = limiter.lower, limiter.upper
    solved = scipy.optimize.least_squares(misfit, np.clip(near, *bounds), bounds=bounds)
    by_joints = _MISFIT * solved.jac[: len(told)]
    still = np.eye(len(near)) - np.linalg.pinv(by_joints, rcond=1e-6) @ by_joints
    return coupling.posture(solved.x[coupling.free]), coupling.matrix @ still
