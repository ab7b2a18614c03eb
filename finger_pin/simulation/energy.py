"""The energy account: where the energy is, where it enters and where it goes.

    d/dt (kinetic + gravity + springs + limiter + bristles) = actuators + fingertip force - losses

It closes to the integrator's tolerance, or a sign somewhere is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.laws import bristle as friction
from finger_pin.laws.limiter import limiter_energy, limiter_loss
from finger_pin.laws.passive_tendon import half_energy
from finger_pin.laws.spring import spring_energy, spring_loss
from finger_pin.mechanism.finger import Finger, FingerSignals
from finger_pin.mechanism.rigid_body import Kinematics, Motion


@dataclass(frozen=True, eq=False)
class Energies:
    """What is stored, shape (...,), J."""

    kinetic: Array
    gravity: Array
    passive_tendon: Array
    limiter: Array
    joint_springs: Array
    tendon_bristles: Array
    joint_bristles: Array

    @property
    def total(self) -> Array:
        """Sum of all."""
        return np.asarray(sum(vars(self).values()))


@dataclass(frozen=True, eq=False)
class Powers:
    """What enters (actuators, fingertip force) and what is lost (the rest), shape (...,), W.

    Slack is the difference that cutting a tension at zero makes: (f^a - f^f) v where f = 0. What the micro-damping
    takes while the bristles follow the motion it may return in part while they spring back.
    """

    actuators: Array
    fingertip: Array
    tendon_coulomb: Array
    tendon_viscous: Array
    tendon_micro_damping: Array
    joint_coulomb: Array
    joint_viscous: Array
    joint_micro_damping: Array
    limiter: Array
    joint_springs: Array
    slack: Array

    @property
    def net(self) -> Array:
        """Supplied less lost."""
        return np.asarray(2.0 * (self.actuators + self.fingertip) - sum(vars(self).values()))


def energies(finger: Finger, signals: FingerSignals, motion: Motion | Kinematics) -> Energies:
    """Return the stored energies at the given signals."""
    state, tendons, joints = signals.state, finger.tendons, finger.joint_friction
    halves = tendons.stretch(state.position, state.passive_position)
    return Energies(
        kinetic=motion.kinetic_energy + 0.5 * np.sum(tendons.mass * state.passive_velocity**2, axis=-1),
        gravity=motion.potential_energy,
        passive_tendon=sum((np.sum(half_energy(s, tendons.half_stiffness), axis=-1) for s in halves), np.zeros(())),
        limiter=np.sum(limiter_energy(signals.limiter_depth, finger.stroke_limiter.stiffness), axis=-1),
        joint_springs=np.sum(spring_energy(state.position, finger.springs.stiffness, finger.springs.rest), axis=-1),
        tendon_bristles=np.sum(friction.bristle_energy(state.tendon_stiction, tendons.stiffness), axis=-1),
        joint_bristles=np.sum(friction.bristle_energy(state.joint_stiction, joints.stiffness), axis=-1),
    )


def powers(finger: Finger, signals: FingerSignals) -> Powers:
    """Return the powers supplied and lost at the given signals."""
    state, tendons, joints = signals.state, signals.tendons, signals.joints
    actuated = finger.routing.actuated
    pulled = tendons.velocity[..., :actuated]
    delivered, loss = tendons.strands[..., :actuated], tendons.friction[..., :actuated]
    limiter = finger.stroke_limiter
    return Powers(
        actuators=np.sum(signals.command * pulled, axis=-1),
        fingertip=np.sum(signals.external_torque * state.velocity, axis=-1),
        tendon_coulomb=np.sum(friction.coulomb_loss(state.tendon_stiction, tendons.velocity, tendons.level), axis=-1),
        tendon_viscous=np.sum(friction.viscous_loss(tendons.velocity, finger.tendons.viscous), axis=-1),
        tendon_micro_damping=np.sum(
            friction.micro_loss(tendons.stiction_rate, tendons.velocity, finger.tendons.lag), axis=-1
        ),
        joint_coulomb=np.sum(friction.coulomb_loss(state.joint_stiction, state.velocity, joints.level), axis=-1),
        joint_viscous=np.sum(friction.viscous_loss(state.velocity, finger.joint_friction.viscous), axis=-1),
        joint_micro_damping=np.sum(
            friction.micro_loss(joints.stiction_rate, state.velocity, finger.joint_friction.lag), axis=-1
        ),
        limiter=np.sum(
            limiter_loss(signals.limiter_torque, signals.limiter_depth, state.velocity, limiter.stiffness), axis=-1
        ),
        joint_springs=np.sum(spring_loss(state.velocity, finger.springs.damping), axis=-1),
        # Only where a tension is cut: a wrong tension elsewhere then shows in the residual.
        slack=np.sum(np.where(delivered > 0.0, 0.0, (signals.command - loss) * pulled), axis=-1),
    )
