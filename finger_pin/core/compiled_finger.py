"""A finger whose signals come from the compiled core: the same face as `Finger` where signals are asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.core import dynamics as at
from finger_pin.core.plant import Plant, build_plant, build_work, held_control
from finger_pin.core.signals import JOINT_ROWS, TENDON_ROWS, evaluate_many, motion_many
from finger_pin.description.routing import Array
from finger_pin.mechanism.finger import Finger, FingerSignals
from finger_pin.mechanism.joint_friction import JointForces
from finger_pin.mechanism.rigid_body import Motion
from finger_pin.mechanism.tendons import TendonForces


class CompiledFinger:
    """Evaluates a finger without Python inside; not to be shared between threads.

    Attributes:
        finger: The finger.
        plant: Its constants as arrays.
    """

    def __init__(self, finger: Finger, fingertip_force: Array | None = None) -> None:
        """Read a finger.

        Args:
            finger: The finger.
            fingertip_force: F, shape (3,), N, base frame; none by default.
        """
        self.finger = finger
        force = np.zeros(3) if fingertip_force is None else np.asarray(fingertip_force, dtype=float)
        self.plant: Plant = build_plant(finger, force)
        self._work = build_work(self.plant)
        self._control = held_control(self.plant)

    def evaluate(self, x: Array, command: Array, fingertip_force: Array | None = None) -> FingerSignals:
        """Return all signals of (18) at packed states, shape (size,) or (m, size); see `Finger.evaluate`."""
        # Compiled code checks no sizes.
        state = self.finger.layout.unpack(np.asarray(x))
        states = _rows(x, np.atleast_2d(x).shape)
        count, size = states.shape
        commands = _rows(command, (count, self.plant.actuated))
        force = np.zeros(3) if fingertip_force is None else np.asarray(fingertip_force, dtype=float)
        forces = _rows(force, (count, 3))
        plant = self.plant._replace(fingertip_force=np.zeros(3), loaded=bool(np.any(force)))
        tendons, joints = plant.coupling.shape
        rates = np.zeros((count, size))
        strands = np.zeros((count, plant.strand_coupling.shape[0]))
        of_tendons = np.zeros((TENDON_ROWS, count, tendons))
        of_joints = np.zeros((JOINT_ROWS, count, joints))
        # An earlier evaluation with a fingertip force leaves its rows behind.
        self._work.joint[[at.ALONG, at.EXTERNAL]] = 0.0
        evaluate_many(plant, self._control, commands, forces, states, self._work, rates, strands, of_tendons, of_joints)
        if np.ndim(x) == 1:
            rates, strands, commands = rates[0], strands[0], commands[0]
            of_tendons, of_joints = of_tendons[:, 0], of_joints[:, 0]
        rate = self.finger.layout.unpack(rates)
        return FingerSignals(
            state=state,
            command=commands,
            fingertip_force=force,
            tendons=TendonForces(
                curvature=of_tendons[at.CURVATURE],
                coefficient=of_tendons[at.COEFFICIENT],
                velocity=of_tendons[at.SPEED],
                friction=of_tendons[at.LOSS],
                normal=of_tendons[at.NORMAL],
                level=of_tendons[at.LEVEL],
                stiction_rate=rate.tendon_stiction,
                strands=strands,
                passive_acceleration=rate.passive_velocity,
            ),
            joints=JointForces(
                reaction=of_joints[at.REACTION],
                friction=of_joints[at.J_LOSS],
                level=of_joints[at.J_LEVEL],
                stiction_rate=rate.joint_stiction,
            ),
            limiter_depth=of_joints[at.DEPTH],
            limiter_torque=of_joints[at.LIMITER],
            spring_torque=np.zeros_like(state.position),
            tendon_torque=strands @ plant.strand_coupling,
            external_torque=of_joints[at.EXTERNAL],
            acceleration=rate.velocity,
            rate=rates,
        )

    def motion(self, position: Array, velocity: Array) -> Motion:
        """Return fingertip and energies of the rigid body at positions and velocities, shape (n,) or (m, n)."""
        shape = (np.atleast_2d(position).shape[0], len(self.plant.parents))
        tips, kinetic, potential = np.zeros((shape[0], 3)), np.zeros(shape[0]), np.zeros(shape[0])
        motion_many(self.plant, _rows(position, shape), _rows(velocity, shape), self._work, tips, kinetic, potential)
        if np.ndim(position) == 1:
            return Motion(tips[0], kinetic[0], potential[0])
        return Motion(tips, kinetic, potential)


def _rows(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return a copy of one kind alone, of which the core has one compilation: writable, contiguous, of floats."""
    return np.array(np.broadcast_to(values, shape), dtype=float, order="C")
