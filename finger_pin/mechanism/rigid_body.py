"""Rigid-body dynamics (18) on Pinocchio: M, C, G, J, forward and inverse dynamics of any fixed-base model."""

from __future__ import annotations

import copy
import threading
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import cached_property
from finger_pin.exceptions import InputError
from finger_pin.mechanism.model_variants import DepthFirst, depth_first, floating
from finger_pin.mechanism.state import Kinematics, as_floats
from finger_pin.typing import Array

# The two halves of a free body; a quaternion of the spherical one has four numbers.
FREE_JOINTS = ("JointModelTranslation", "JointModelSpherical")


class RigidBody:
    """A Pinocchio model with a fixed base and one or more tips.

    Attributes:
        model: The Pinocchio model. Where its joints are listed level by level, Pinocchio's own M and C of it are wrong:
            `mass_matrix` and `coriolis_matrix` are right in any order.
        tips: Indices of the frames of the tips.
        tip_frame: Index of the first of them, the fingertip.
        supports: Shape (t, joints), one where a joint carries a tip.
        joints: Names of the joints, in the order of the model.
        proximal_axes: e_j of (17) of every joint of the model, the base first, in the frame of the body that has it.
        parent_links: Index of the joint that carries that body, 0 for the base.
        topology: Equal for all bodies that differ in inertias and gravity alone.
    """

    def __init__(
        self, model: pin.Model, tip_frame: str | Sequence[str] = "fingertip", base_axis: Sequence[float] = (1, 0, 0)
    ) -> None:
        """Take a model.

        A free body is a translation joint that carries a spherical one: its velocity is that of the origin in the
        base frame, then the angular velocity in its own.

        Args:
            model: Pinocchio model with a fixed base.
            tip_frame: Name of the frame at the fingertip, or names of several.
            base_axis: e_1, along which the tendons run at the joints next to the base; base frame.
        """
        for name, joint in zip(model.names[1:], model.joints[1:], strict=True):
            if (joint.nq, joint.nv) != (1, 1) and joint.shortname() not in FREE_JOINTS:
                allowed = "only revolute, prismatic, translation and spherical joints are supported"
                raise InputError(f"joint {name}", allowed, joint.shortname())
        names = (tip_frame,) if isinstance(tip_frame, str) else tuple(tip_frame)
        for name in names:
            if not model.existFrame(name):
                raise InputError("tip_frame", "no such frame in the model", name)
        self.model = model
        self.tips = tuple(int(model.getFrameId(name)) for name in names)
        self.tip_frame = self.tips[0] if self.tips else -1
        self.supports = np.zeros((len(self.tips), model.njoints - 1))
        for row, tip in enumerate(self.tips):
            self.supports[row, [k - 1 for k in model.supports[model.frames[tip].parentJoint] if k]] = 1.0
        self.joints: tuple[str, ...] = tuple(model.names[1:])
        self.topology: Hashable = object()
        self._per_thread = threading.local()
        self.proximal_axes: list[Array] = [np.asarray(base_axis, dtype=float)]
        self.parent_links: list[int] = [0]
        for index in range(1, model.njoints):
            offset, parent = np.array(model.jointPlacements[index].translation), int(model.parents[index])
            length = float(np.linalg.norm(offset))
            # At the base, and where axes meet in a point, no link lies in between: the joint has the link of the other.
            shared = parent == 0 or length == 0.0
            self.parent_links.append(self.parent_links[parent] if shared else parent)
            self.proximal_axes.append(self.proximal_axes[parent] if shared else offset / length)

    @cached_property
    def slides(self) -> tuple[bool, ...]:
        """Return whether each joint of the model slides, so that its position is in m."""
        return tuple(joint.shortname().startswith("JointModelP") for joint in self.model.joints[1:])

    @property
    def _data(self) -> pin.Data:
        return self._memory("listed", self.model)

    def _memory(self, name: str, model: pin.Model) -> pin.Data:
        """Return Pinocchio's memory for a model; every thread has its own."""
        memory = vars(self._per_thread)
        if name not in memory:
            memory[name] = model.createData()
        data: pin.Data = memory[name]
        return data

    def __getstate__(self) -> dict[str, Any]:
        """Return the contents of a copy: not the memory of threads."""
        return {name: value for name, value in vars(self).items() if name != "_per_thread"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Initialise as a copy with separate memory."""
        vars(self).update(state, _per_thread=threading.local())

    def with_inertias(self, inertias: Sequence[pin.Inertia], gravity: Sequence[float]) -> RigidBody:
        """Return a body of the same form with other inertias and gravity.

        Args:
            inertias: Of the joints of the model, the base left out.
            gravity: Shape (3,), m/s2.
        """
        twin = copy.copy(self)
        for derived in ("_floating_model", "_depth_first"):
            vars(twin).pop(derived, None)
        twin.model = pin.Model(self.model)
        model_inertias = twin.model.inertias
        for joint, inertia in enumerate(inertias, start=1):
            model_inertias[joint] = inertia
        twin.model.gravity.linear[:] = gravity
        return twin

    @property
    def inertias(self) -> list[pin.Inertia]:
        """Inertias of the joints of the model, the base left out."""
        return list(self.model.inertias)[1:]

    @property
    def mass(self) -> float:
        """Mass of all bodies, kg."""
        return float(pin.computeTotalMass(self.model))

    def position_rate(self, q: Array, v: Array) -> Array:
        """Return q' = E(q) v, shape (..., nq)."""
        q, v = self._floats(q=q, v=v)
        if self.model.nq == self.model.nv:
            return v
        rate = np.zeros(q.shape)
        for joint in self.model.joints[1:]:
            at, part = joint.idx_q, v[..., joint.idx_v : joint.idx_v + joint.nv]
            if joint.nq == joint.nv:
                rate[..., at : at + joint.nq] = part
            else:
                # Half the product of the quaternion with the angular velocity in the body's frame.
                vector, scalar = q[..., at : at + 3], q[..., at + 3]
                rate[..., at : at + 3] = 0.5 * (scalar[..., None] * part + np.cross(vector, part))
                rate[..., at + 3] = -0.5 * np.sum(vector * part, axis=-1)
        return rate

    def _floats(self, *, single: bool = False, **arguments: Array) -> tuple[Array, ...]:
        """Return arguments by name as floats: q of shape (..., nq), others (..., nv)."""
        model = self.model
        return tuple(as_floats(k, v, model.nq if k == "q" else model.nv, single=single) for k, v in arguments.items())

    def external_torque(self, q: Array, forces: Array) -> Array:
        """Return sum of J^T F over the tips, shape (..., nv), for forces of shape (..., t, 3), N, base frame."""
        if q.ndim > 1:
            return np.array([self.external_torque(*each) for each in zip(q, forces, strict=True)])
        reference, total = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, np.zeros(self.model.nv)
        for tip, force in zip(self.tips, forces, strict=True):
            total += pin.computeFrameJacobian(self.model, self._data, q, tip, reference)[:3].T @ force
        return total

    def link_directions(self, q: Array) -> Array:
        """Return e_j of (17), shape (..., joints, 3): along the link before the joint; base frame."""
        (q,) = self._floats(q=q)
        if q.ndim > 1:
            return np.array([self.link_directions(each) for each in q])
        pin.forwardKinematics(self.model, self._data, q)
        return self._directions()

    def placements(self, q: Array) -> tuple[list[pin.SE3], list[Array]]:
        """Return placement and Jacobian of every joint, the base first, at q of shape (nq,).

        A Jacobian's columns are velocity of the body's point at the origin, and angular velocity; base frame.
        """
        (q,), model, data = self._floats(single=True, q=q), self.model, self._data
        pin.computeJointJacobians(model, data, q)
        still, reference = np.zeros((6, model.nv)), pin.ReferenceFrame.WORLD
        twists = [pin.getJointJacobian(model, data, joint, reference) for joint in range(1, model.njoints)]
        return [pin.SE3(each) for each in data.oMi], [still, *(np.asarray(each).reshape(6, -1) for each in twists)]

    def tip_position(self, q: Array) -> Array:
        """Return the fingertip p of (1) at q of shape (..., nq), m, base frame.

        Returns:
            Shape (..., 3); of t tips, as a hand has them, shape (..., t, 3), in the order of `tips`.
        """
        (q,) = self._floats(q=q)
        if q.ndim > 1:
            return np.array([self.tip_position(each) for each in q])
        pin.framesForwardKinematics(self.model, self._data, q)
        return self._per_tip([self._data.oMf[tip].translation for tip in self.tips], 3)

    def jacobian(self, q: Array) -> Array:
        """Return J = dp/dtheta of (6) at q of shape (nq,): shape (3, n), or (t, 3, n) of t tips."""
        (q,), model, data = self._floats(single=True, q=q), self.model, self._data
        reference = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobians = [pin.computeFrameJacobian(model, data, q, tip, reference) for tip in self.tips]
        # Of a single joint Pinocchio returns a vector.
        return self._per_tip([np.reshape(each, (6, -1))[:3] for each in jacobians], 3, model.nv)

    def _per_tip(self, values: list[Array], *shape: int) -> Array:
        """Return values at the tips, of the given shape each; of a single tip without the dimension of tips."""
        return np.array(values).reshape(shape if len(values) == 1 else (len(values), *shape))

    def mass_matrix(self, q: Array) -> Array:
        """Return M(theta) by the composite rigid body algorithm, shape (n, n)."""
        (q,), twin = self._floats(single=True, q=q), self._depth_first
        data = self._memory("depth_first", twin.model)
        return np.array(pin.crba(twin.model, data, q[twin.positions], pin.Convention.WORLD))[twin.matrix]

    def coriolis_matrix(self, q: Array, v: Array) -> Array:
        """Return C(theta, theta') with M' - 2 C skew-symmetric, shape (n, n)."""
        (q, v), twin = self._floats(single=True, q=q, v=v), self._depth_first
        data = self._memory("depth_first", twin.model)
        q, v = q[twin.positions], v[twin.velocities]
        return np.array(pin.computeCoriolisMatrix(twin.model, data, q, v))[twin.matrix]

    def gravity_torque(self, q: Array) -> Array:
        """Return G(theta), shape (n,), N m."""
        return np.array(pin.computeGeneralizedGravity(self.model, self._data, *self._floats(single=True, q=q)))

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Return M a + C v + G by recursive Newton-Euler, shape (n,), N m."""
        return np.array(pin.rnea(self.model, self._data, *self._floats(single=True, q=q, v=v, a=a)))

    def forward_dynamics(self, q: Array, v: Array, torque: Array) -> Array:
        """Return theta'' by the articulated body algorithm, shape (..., n), rad/s2."""
        q, v, torque = self._floats(q=q, v=v, torque=torque)
        if q.ndim == 1:
            return np.array(pin.aba(self.model, self._data, q, v, torque))
        return np.array([self.forward_dynamics(*each) for each in zip(q, v, torque, strict=True)])

    def base_dynamics(self, q: Array, v: Array, a: Array, base: Array) -> tuple[Array, Array]:
        """Return the wrench on the base and the torques on joints for a given motion, by Newton-Euler.

        Args:
            q: Shape (n,).
            v: Shape (n,).
            a: Shape (n,).
            base: Velocity of the base and its acceleration less gravity in its own axes, angular parts first, as in
                `base_motion`; shape (12,) or more.

        Returns:
            Moment and force on the base about its origin, in its axes, shape (6,), and torques, shape (n,).
        """
        model, data = self._floating_model, self._memory("floating", self._floating_model)
        turned = np.r_[3:6, 0:3]
        pose = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        moving, speeding = np.append(base[:6][turned], v), np.append(base[6:12][turned], a)
        efforts = np.array(pin.rnea(model, data, np.append(pose, q), moving, speeding))
        return efforts[:6][turned], efforts[6:]

    @cached_property
    def _floating_model(self) -> pin.Model:
        return floating(self.model)

    @cached_property
    def _depth_first(self) -> DepthFirst:
        return depth_first(self.model)

    def distal_weights(self) -> Array:
        """Return the weight of everything that each joint carries, base frame, shape (n, 3), N."""
        pin.computeSubtreeMasses(self.model, self._data)
        return np.outer(np.array(self._data.mass)[1:], self.model.gravity.linear)

    def kinematics(self, q: Array, v: Array, base: Array | None = None) -> Kinematics:
        """Return kinematics and energies at positions and velocities, for shapes (..., n).

        With a base that moves, (..., 15) or more numbers of `base_motion`, energies are those of the motion in the
        world, where the base has no height; all else is as seen from the base.
        """
        q, v = self._floats(q=q, v=v)
        if q.ndim > 1:
            bases = [None] * len(q) if base is None else base
            rows = [self.kinematics(*row) for row in zip(q, v, bases, strict=True)]
            return Kinematics(*(np.array([getattr(k, name) for k in rows]) for name in Kinematics.__annotations__))
        jacobian = self.jacobian(q)
        # Pinocchio's own has the inertia of rotors for some kinds of joints only.
        kinetic = 0.5 * v @ self.mass_matrix(q) @ v
        potential = pin.computePotentialEnergy(self.model, self._data, q)
        # Only now is every branch placed: a Jacobian places its own alone.
        directions = self._directions()
        if base is not None:
            model, data = self._floating_model, self._memory("floating", self._floating_model)
            pose = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
            moving = np.concatenate([base[3:6], base[:3], v])
            kinetic = pin.computeKineticEnergy(model, data, np.append(pose, q), moving)
            kinetic += 0.5 * self.model.armature @ (v * v)
            centre = pin.centerOfMass(self.model, self._data, q)
            potential = -self.mass * float(base[12:15] @ centre)
        return Kinematics(
            self.tip_position(q), jacobian @ v, jacobian, directions, np.array(kinetic), np.array(potential)
        )

    def _directions(self) -> Array:
        placements = self._data.oMi
        rows = [placements[at].rotation @ axis for at, axis in zip(self.parent_links, self.proximal_axes, strict=True)]
        return np.array(rows[1:])
