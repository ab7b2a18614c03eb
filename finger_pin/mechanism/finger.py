"""The wiring of Fig. 5: tendons, joint friction, stroke limiters and rigid body, joined by equation (18)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from finger_pin.description.loading import load_finger
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.mechanism.joint_friction import JointForces, JointFriction
from finger_pin.mechanism.rigid_body import Motion, RigidBody
from finger_pin.mechanism.state import Layout, State
from finger_pin.mechanism.stroke_limiter import StrokeLimiter
from finger_pin.mechanism.tendons import TendonForces, Tendons
from finger_pin.mechanism.urdf import build_rigid_body


@dataclass(frozen=True, eq=False)
class FingerSignals:
    """Everything that (18) is made of, at one state or at many (leading dimensions are kept).

    Attributes:
        state: The state, unpacked.
        command: f^a, shape (..., a), N.
        fingertip_force: F, shape (3,) or (..., 3), N, base frame.
        tendons: Tendon forces and friction.
        joints: Joint reaction and friction.
        limiter_depth: Signed penetration beyond the range, shape (..., n), rad.
        limiter_torque: tau^r, shape (..., n), N m.
        tendon_torque: H_c2^T f, shape (..., n), N m, (11).
        external_torque: J^T F, shape (..., n), N m, (6).
        acceleration: theta'', shape (..., n), rad/s2, (18).
        rate: Time derivative of the packed state, shape (..., size).
    """

    state: State
    command: Array
    fingertip_force: Array
    tendons: TendonForces
    joints: JointForces
    limiter_depth: Array
    limiter_torque: Array
    tendon_torque: Array
    external_torque: Array
    acceleration: Array
    rate: Array


class Finger:
    """A tendon-driven finger: dynamics for any controller, solver or loop.

    Attributes:
        description: What it was built from.
        rigid_body: M, C, G, J and forward dynamics, on Pinocchio.
        routing: H_c, H_c2, curvature matrix, crossing sets, force closure.
        tendons: The tendon layer.
        joint_friction: The friction of the joints.
        stroke_limiter: The stroke limiters.
        layout: Order and sizes of the packed state.
    """

    def __init__(self, description: FingerDescription | str | Path, rigid_body: RigidBody | None = None) -> None:
        """Build a finger.

        Args:
            description: The finger, or what `load_finger` takes: the name of one, or the path of a file.
            rigid_body: A rigid body whose joints the description names in order; by default the one that the
                description's links make.

        Raises:
            InputError: If the joints of the two differ.
        """
        if isinstance(description, str | Path):
            description = load_finger(description)
        self.description = description
        self.rigid_body = rigid_body or build_rigid_body(description)
        if len(self.rigid_body.joints) != len(description.joints):
            raise InputError("finger.joints", f"the rigid body's joints are {', '.join(self.rigid_body.joints)}")
        self.tendons = Tendons.from_description(description)
        self.routing = self.tendons.routing
        self.joint_friction = JointFriction.from_description(description, self.routing.loads)
        self.stroke_limiter = StrokeLimiter.from_description(description)
        self.layout = Layout(self.routing.joints, self.routing.tendons, self.routing.passive)

    @classmethod
    def from_model(
        cls,
        description: FingerDescription,
        model: pin.Model,
        joints: Mapping[str, str],
        tip_frame: str,
        configuration: Array | None = None,
        base_axis: Sequence[float] = (1.0, 0.0, 0.0),
    ) -> Finger:
        """Route tendons on some joints of any Pinocchio model; its other joints are locked.

        Args:
            description: Joints (no links needed), tendons and friction; its gravity replaces the model's.
            model: For example a whole hand.
            joints: For every joint of the description, in the model's order, the name of the model's joint.
            tip_frame: Frame of the fingertip in the model.
            configuration: Where the other joints are locked, shape (nq,); neutral by default.
            base_axis: e_1 of (17), the unit vector along which the tendons run at the base; model's base frame.

        Raises:
            InputError: If a joint is missing, given twice or out of the model's order, or has several coordinates,
                or the configuration has the wrong size.
        """
        for name in description.joints:
            if name not in joints:
                raise InputError(f"joints.{name}", "is missing: name the model's joint")
        chosen = [joints[name] for name in description.joints]
        for name, wanted in joints.items():
            if name not in description.joints or not model.existJointName(wanted):
                raise InputError(f"joints.{name}", "no such joint in the description or the model", wanted)
        indices = [int(model.getJointId(name)) for name in chosen]
        if indices != sorted(set(indices)):
            raise InputError("joints", "must follow the model's order, each joint once", chosen)
        locked = [index for index in range(1, model.njoints) if index not in indices]
        posture = pin.neutral(model) if configuration is None else np.asarray(configuration, dtype=float)
        if posture.shape != (model.nq,):
            raise InputError("configuration", f"must be {model.nq} numbers, one per coordinate of the model", posture)
        reduced = pin.buildReducedModel(model, locked, posture)
        reduced.gravity.linear[:] = description.gravity
        return cls(description, RigidBody(reduced, tip_frame, base_axis))

    @property
    def coupling(self) -> Array:
        """H_c, shape (t, n), m, (3)."""
        return self.routing.coupling

    @property
    def strand_coupling(self) -> Array:
        """H_c2, shape (s, n), m, (10)."""
        return self.routing.strand_coupling

    def rest_state(self, position: Array) -> Array:
        """Return the packed state at rest at theta, shape (n,): stiction zero, passive tendons in the middle."""
        position = np.asarray(position, dtype=float)
        zeros = [np.zeros(size) for size in self.layout.sizes]
        passive = self.tendons.rest_position(position)
        return self.layout.pack(State(position, zeros[1], passive, zeros[3], zeros[4], zeros[5]))

    def evaluate(self, x: Array, command: Array, fingertip_force: Array | None = None) -> FingerSignals:
        """Return all signals of (18) at a packed state.

        Args:
            x: Packed state, shape (size,) or (m, size).
            command: f^a, shape (a,) or (m, a), N.
            fingertip_force: F, shape (3,) or (m, 3), N, base frame; none by default.
        """
        state, body = self.layout.unpack(x), self.rigid_body
        force = np.zeros(3) if fingertip_force is None else np.asarray(fingertip_force, dtype=float)
        tendons = self.tendons.forces(
            state.position,
            state.velocity,
            state.passive_position,
            state.passive_velocity,
            state.tendon_stiction,
            command,
        )
        if np.any(force):
            kinematics = body.kinematics(state.position, state.velocity)
            directions = kinematics.directions
            external = np.einsum("...ij,...i->...j", kinematics.jacobian, force)
        else:
            directions = np.zeros((*state.position.shape, 3))
            external = np.zeros_like(state.position)
        joints = self.joint_friction.forces(state.velocity, state.joint_stiction, tendons.strands, directions, force)
        depth = self.stroke_limiter.depth(state.position)
        limiter = self.stroke_limiter.torque(depth, state.velocity)
        torque = tendons.strands @ self.routing.strand_coupling
        net = torque - joints.friction - limiter + external
        acceleration = body.forward_dynamics(state.position, state.velocity, net)
        rate = self.layout.pack(
            State(
                position=state.velocity,
                velocity=acceleration,
                passive_position=state.passive_velocity,
                passive_velocity=tendons.passive_acceleration,
                tendon_stiction=tendons.stiction_rate,
                joint_stiction=joints.stiction_rate,
            )
        )
        return FingerSignals(
            state=state,
            command=command,
            fingertip_force=force,
            tendons=tendons,
            joints=joints,
            limiter_depth=depth,
            limiter_torque=limiter,
            tendon_torque=torque,
            external_torque=external,
            acceleration=acceleration,
            rate=rate,
        )

    def motion(self, position: Array, velocity: Array) -> Motion:
        """Return fingertip and energies of the rigid body at positions and velocities, shape (..., n)."""
        found = self.rigid_body.kinematics(position, velocity)
        return Motion(found.tip, found.kinetic_energy, found.potential_energy)

    def rhs(self, time: float, x: Array, command: Array, fingertip_force: Array | None = None) -> Array:
        """Return the time derivative of the packed state, for a solver of one's own; ``time`` is not used."""
        return self.evaluate(x, command, fingertip_force).rate
