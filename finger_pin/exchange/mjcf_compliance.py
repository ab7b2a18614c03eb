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
from finger_pin.exchange.mujoco_compliance import IMPACT, LEAST_SHARE, impact_damping, restitution
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.tendon_paths import Placed, TendonPaths
from finger_pin.mechanism.xml_numbers import numbers
from finger_pin.typing import Array

#: The impedance d of constraints that are written, whatever their deflection.
IMPEDANCE = 0.95


def quaternion(orientation: Sequence[float]) -> str:
    """Return a quaternion x, y, z, w with its real part first, as MuJoCo has it."""
    x, y, z, w = orientation
    return numbers(w, x, y, z)


def soft(
    stiffness: float, damping: float, mobility: float, suffix: str = "", *, stop: bool = False, damped: bool = False
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
        damped: Whether the damping is a ratio, 1 for critical.
    """
    share = 1.0 - IMPEDANCE
    reference = share * mobility * stiffness
    damper = share * mobility * damping
    if stop:
        damper = mobility * damping * math.sqrt(share) or 2.0 * math.sqrt(reference)
    if damped:
        damper = 2.0 * damping * math.sqrt(reference)
    if not reference > 0.0:
        return {}
    return {
        f"solref{suffix}": numbers(-reference, -damper),
        f"solimp{suffix}": numbers(IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0),
    }


def impact_ratio(damping: float) -> float:
    """Return the damping ratio that throws back as much of an impact at 0.1 m/s as a contact's damping c, s/m, does."""

    def gap(ratio: float) -> float:
        return impact_damping(restitution(ratio)) - damping * IMPACT

    low, high = 1e-3, float(brentq(lambda ratio: restitution(ratio) - LEAST_SHARE, 1.0, 10.0))
    if gap(low) > 0.0:
        return low
    return float(brentq(gap, low, high)) if gap(high) > 0.0 else high


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
        inverse = np.linalg.inv(body.mass_matrix(q))
        # What a path moves gives way to nothing.
        inverse *= ~np.isin([*tree.joints], [*tree.on_paths])
        arms = paths.arms(q) if tree.tendons else np.zeros((0, len(q)))
        along = np.einsum("ti,ij,tj->t", arms, inverse, arms)
        self.joints = dict(zip(tree.joints, np.diag(inverse).tolist(), strict=True))
        self.tendons = dict(zip(tree.tendons, along.tolist(), strict=True))
        data = body.model.createData()
        pin.computeJointJacobians(body.model, data, q)
        self.bodies = {name: 1.0 / each.mass if each.mass else 0.0 for name, each in tree.objects.items()}
        for name, each in tree.bodies.items():
            jacobian = _jacobian(body.model, data, paths.placed[name], each.centre)
            self.bodies[name] = float(np.trace(jacobian @ inverse @ jacobian.T)) / 3.0
            if _is_slider(tree, name):
                # MuJoCo takes these without their armatures, and alike in all directions.
                self.bodies[name] = 1.0 / each.mass
                moved = [joint for joint, moved in tree.joints.items() if moved.body == name]
                self.joints |= dict.fromkeys(moved, 1.0 / each.mass)


def _is_slider(tree: Tree, name: str) -> bool:
    """Return whether a body is what MuJoCo calls simple: alone on slides along its axes, about its mass centre."""
    moved = [joint for joint in tree.joints.values() if joint.body == name]
    aligned = all(joint.kind == "slide" and np.count_nonzero(joint.axis) == 1 for joint in moved)
    on_base = tree.link_of(tree.bodies[name].parent) is None
    alone = on_base and not any(body.parent == name for body in tree.bodies.values())
    return bool(moved) and aligned and alone and not any(tree.bodies[name].centre) and tree.bodies[name].mass > 0.0


def _jacobian(model: pin.Model, data: pin.Data, placed: Placed, point: Sequence[float]) -> Array:
    """Return dx/dq of a point of a body of a tree, shape (3, n), from data with the joints' Jacobians."""
    if not placed.joint:
        return np.zeros((3, model.nv))
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    along, about = pin.getJointJacobian(model, data, placed.joint, frame).reshape(2, 3, -1)
    away = data.oMi[placed.joint].rotation @ placed.frame.act(np.array(point))
    return np.asarray(along - pin.skew(away) @ about)
