"""Springs as MuJoCo's soft constraints, at the inertia that MuJoCo counts with, and numbers as MJCF has them.

The way back from `mujoco_compliance`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from finger_pin.description.tree import Tree
from finger_pin.exchange.mujoco_compliance import IMPACT_SPEED, LEAST_RESTITUTION, impact_damping, restitution
from finger_pin.mechanism.body_places import Placed
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.tendon_paths import TendonPaths
from finger_pin.mechanism.xml_numbers import numbers
from finger_pin.typing import Array

#: The impedance d of constraints that are written, whatever their deflection.
IMPEDANCE = 0.95


def quaternion(orientation: Sequence[float]) -> str:
    """Return a quaternion x, y, z, w with its real part first, as MuJoCo has it."""
    x, y, z, w = orientation
    return numbers(w, x, y, z)


def soft(
    stiffness: float, damping: float, mobility: float, suffix: str = "", *, stop: bool = False, is_ratio: bool = False
) -> dict[str, str]:
    """Return ``solref`` and ``solimp`` with which a constraint is a spring beside a damper under loads, or a stop.

    It is `soft_spring` of `mujoco_compliance` the other way round: a spring of k and a damper of b need
    a_ref = -(1 - d) A b v - (1 - d) A k r, with A the mobility. A stop throws back as much of an impact with a damper
    of b A sqrt(1 - d); one without a damper gets critical damping.

    Args:
        stiffness: k, N/m or N m/rad.
        damping: b, N s/m or N m s/rad.
        mobility: A, acceleration per force along the constraint, 1/kg or 1/(kg m2).
        suffix: Of the attributes' names.
        stop: Whether it bounces.
        is_ratio: Whether the damping is a ratio, 1 for critical.
    """
    compliance_share = 1.0 - IMPEDANCE
    reference = compliance_share * mobility * stiffness
    damper = compliance_share * mobility * damping
    if stop:
        damper = mobility * damping * math.sqrt(compliance_share) or 2.0 * math.sqrt(reference)
    if is_ratio:
        damper = 2.0 * damping * math.sqrt(reference)
    if not reference > 0.0:
        return {}
    return {
        f"solref{suffix}": numbers(-reference, -damper),
        f"solimp{suffix}": numbers(IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0),
    }


def impact_ratio(damping: float) -> float:
    """Return the damping ratio that throws back as much of an impact at 0.1 m/s as a contact's damping c, s/m, does."""

    def excess(ratio: float) -> float:
        return impact_damping(restitution(ratio)) - damping * IMPACT_SPEED

    low, high = 1e-3, float(brentq(lambda ratio: restitution(ratio) - LEAST_RESTITUTION, 1.0, 10.0))
    if excess(low) > 0.0:
        return low
    return float(brentq(excess, low, high)) if excess(high) > 0.0 else high


class Mobility:
    """Accelerations per force of a tree with its joints at their references, as MuJoCo's ``invweight0``.

    Attributes:
        joints: Per torque on each joint, by name, 1/(kg m2), or 1/kg of one that slides.
        tendons: Per tension of each tendon, by name, 1/kg.
        bodies: Per force at each body's mass centre, mean of all directions, by name, 1/kg; of objects by their masses.
    """

    def __init__(self, tree: Tree, body: RigidBody, paths: TendonPaths) -> None:
        """Evaluate the rigid body of a tree, and its tendons."""
        q = paths.references
        inverse_mass = np.linalg.inv(body.mass_matrix(q))
        # What a path moves gives way to nothing.
        inverse_mass *= ~np.isin([*tree.joints], [*tree.on_paths])
        arms = paths.arms(q) if tree.tendons else np.zeros((0, len(q)))
        tendon_mobility = np.einsum("ti,ij,tj->t", arms, inverse_mass, arms)
        self.joints = dict(zip(tree.joints, np.diag(inverse_mass).tolist(), strict=True))
        self.tendons = dict(zip(tree.tendons, tendon_mobility.tolist(), strict=True))
        data = body.model.createData()
        pin.computeJointJacobians(body.model, data, q)
        self.bodies = {name: 1.0 / part.mass if part.mass else 0.0 for name, part in tree.objects.items()}
        for name, part in tree.bodies.items():
            jacobian = _jacobian(body.model, data, paths.placed[name], part.centre)
            self.bodies[name] = float(np.trace(jacobian @ inverse_mass @ jacobian.T)) / 3.0
            if _is_slider(tree, name):
                # MuJoCo takes these without their armatures, and alike in all directions.
                self.bodies[name] = 1.0 / part.mass
                self.joints |= dict.fromkeys(tree.joints_of(name), 1.0 / part.mass)


def _is_slider(tree: Tree, name: str) -> bool:
    """Return whether a body is what MuJoCo calls simple: alone on slides along its axes, about its mass centre."""
    joints = [tree.joints[joint] for joint in tree.joints_of(name)]
    aligned = all(joint.kind == "slide" and np.count_nonzero(joint.axis) == 1 for joint in joints)
    on_base = tree.link_of(tree.bodies[name].parent) is None
    is_alone = on_base and not any(body.parent == name for body in tree.bodies.values())
    return bool(joints) and aligned and is_alone and not any(tree.bodies[name].centre) and tree.bodies[name].mass > 0.0


def _jacobian(model: pin.Model, data: pin.Data, placed: Placed, point: Sequence[float]) -> Array:
    """Return dx/dq of a point of a body of a tree, shape (3, n), from data with the joints' Jacobians."""
    if not placed.joint:
        return np.zeros((3, model.nv))
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    linear, angular = pin.getJointJacobian(model, data, placed.joint, frame).reshape(2, 3, -1)
    lever = data.oMi[placed.joint].rotation @ placed.frame.act(np.array(point))
    return np.asarray(linear - pin.skew(lever) @ angular)
