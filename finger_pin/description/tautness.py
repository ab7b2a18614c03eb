"""Tautness of fingers without force closure: joint springs keep the tendons taut."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from finger_pin.description.actuators import Actuator
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.description.validation import expand, problem
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class Tautness:
    """The least excess of all tensions over their minimum, in the posture of least help from the springs.

    At rest the tendons balance the springs, H_c^T f = k (theta - theta_0); gravity is left out. The torques that
    tensions of at least f0 exert are a convex set, and the torque of the springs is affine in the posture. So the
    tensions exist at all postures within the ranges if they exist at the corners, and the spare tension, the largest e
    with f >= f0 + e, is concave in the posture: it is least at a corner. Each corner is a linear programme. Joints that
    follow a passive tendon (20) are where the others put them, which is affine too.

    Attributes:
        spare: e at the worst corner, N; minus infinity where no tensions at all hold the posture.
        posture: theta there, shape (n,), rad.
        minimum: f0, shape (t,), N.
        joints: Names of the joints.
    """

    spare: float
    posture: Array
    minimum: Array
    joints: tuple[str, ...]

    @classmethod
    def from_finger(
        cls, finger: FingerDescription, routing: Routing, coupling: PassiveCoupling, minimum: Array
    ) -> Tautness:
        """Solve the programmes of all corners of a finger without force closure."""
        # Importing it takes a while, which only who needs it shall wait for.
        from scipy.optimize import linprog

        joints = list(finger.joints.values())
        stiffness = np.array([joint.spring.stiffness if joint.spring else 0.0 for joint in joints])
        rest = np.array([joint.spring.rest if joint.spring else 0.0 for joint in joints])
        tendons = len(minimum)
        scale = np.max(np.abs(routing.coupling))
        worst = (np.inf, np.zeros(len(joints)))
        for corner in product(*(joints[index].range for index in coupling.free)):
            posture = coupling.posture(np.array(corner))
            torque = stiffness * (posture - rest) - routing.coupling.T @ minimum
            programme = linprog(
                np.append(np.zeros(tendons), -1.0),
                A_eq=np.hstack([routing.coupling.T / scale, np.zeros((len(joints), 1))]),
                b_eq=torque / scale,
                A_ub=np.hstack([-np.eye(tendons), np.ones((tendons, 1))]),
                b_ub=np.zeros(tendons),
                bounds=(None, None),
            )
            spare = float(programme.x[-1]) if programme.status == 0 else -np.inf
            if spare < worst[0]:
                worst = (spare, posture)
        return cls(*worst, minimum, tuple(finger.joints))

    @property
    def holds(self) -> bool:
        """Whether all tendons can be taut, and at their minimum at least, at all postures."""
        return self.spare >= 0.0 and bool(np.all(self.minimum + self.spare > 0.0))

    def __str__(self) -> str:
        """Return a sentence: the least excess of tension under the springs, and its posture."""
        where = ", ".join(f"{name} {angle:.3g}" for name, angle in zip(self.joints, self.posture, strict=True))
        if self.spare == -np.inf:
            return f"no tensions hold it against its springs at {where} rad"
        if self.holds:
            return f"the springs keep all tendons taut, {self.spare:.3g} N above their minimum or more"
        return f"its springs leave a tendon {max(-self.spare, 0.0):.3g} N short of its minimum tension at {where} rad"


def check_currents(actuators: dict[str, Actuator], tension: dict[str, float]) -> None:
    """Refuse a motor that cannot exert the tensions, N by tendon, that keep its tendons taut at rest."""
    for name, actuator in actuators.items():
        motor, count = actuator.motor, len(actuator.tendons)
        # Several tendons on a spool have the tension that they are built with.
        taut = [tension[actuator.tendons[0]]] if count == 1 else expand(actuator.pretension, count)
        constant, resistance, _ = motor.constants
        needed = abs(float(actuator.radii @ taut)) / constant
        if needed > min(motor.maximum_current, motor.voltage / resistance):
            tensions = ", ".join(
                f"{each:.3g} N of {tendon}" for each, tendon in zip(taut, actuator.tendons, strict=True)
            )
            if needed > motor.maximum_current:
                entry, limit, unit = "maximum_current", motor.maximum_current, "A"
            else:
                entry, limit, needed, unit = "voltage", motor.voltage, needed * resistance, "V"
            allowed = f"pretension alone needs {needed:.3g} {unit}: {tensions} at rest"
            raise problem(f"finger.actuators.{name}.motor.{entry}", allowed, limit)
