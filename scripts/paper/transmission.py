"""The share of its command that a tendon delivers, by posture: the capstan law that (9), (14) and (16) make.

A tendon that slides at speed v settles where f = f^a - f^f, f^f = (f + f^a) M s + b v, with s the sign of v, so that

    f / f^a = (1 - M s - (d s + b v) / f^a) / (1 + M s)

with a drag d that no load makes.

Fast enough for M = mu^d = tanh(mu_e phi / 2), and without viscous friction, this is exp(-mu_e phi) when pulling and
exp(mu_e phi) when releasing. At rest anything between the ratios for M = mu^c, beyond which it breaks away, may occur.
A passive tendon delivers to its distal half what reaches its mass from the proximal one, by the same equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from finger_pin.analysis.locking import sliding_velocity
from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.laws import bristle as friction
from finger_pin.laws.capstan import PASSIVE_FRICTION, capstan_coefficient, sliding_tension
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

# Since its last reversal a tendon has slid by this many bristle lengths F^n M / s0: exp(-5) from steady sliding.
_SETTLED = 5.0


@dataclass(frozen=True, eq=False, repr=False)
class TransmissionEfficiency(BriefRepr):
    """Delivered over commanded tension, f / f^a, of every tendon; shapes (..., t).

    Attributes:
        curvature: phi, rad, (15).
        pulling: In steady sliding towards the actuator, exp(-mu_e phi).
        releasing: In steady sliding away from it, exp(mu_e phi).
        least: At rest, where it breaks away towards the actuator, (1 - mu^c) / (1 + mu^c).
        greatest: At rest, where it breaks away from it, the inverse.
    """

    curvature: Array
    pulling: Array
    releasing: Array
    least: Array
    greatest: Array


@dataclass(frozen=True, eq=False, repr=False)
class TransmissionInMotion(BriefRepr):
    """Delivered over commanded tension along a simulation; shapes (m, t); not a number without a command.

    Attributes:
        curvature: phi, rad.
        ratio: f / f^a; of a passive tendon f5_4 / f5_3.
        settled: Share that steady sliding at this posture and speed would deliver.
        sliding: Whether the tendon has slid far enough since its last reversal for that to be comparable.
        direction: Sign of v: 1 towards the actuator.
    """

    curvature: Array
    ratio: Array
    settled: Array
    sliding: NDArray[np.bool_]
    direction: Array


def transmission_efficiency(finger: FingerLike, position: Array) -> TransmissionEfficiency:
    """Return the transmission efficiency of every tendon in steady sliding and at rest.

    Args:
        finger: Any finger.
        position: theta, shape (..., n), rad.
    """
    finger = as_finger(finger)
    tendons = finger.tendons
    routing = tendons.routing
    curvature = routing.curvature(np.asarray(position, dtype=float))
    kinetic = capstan_coefficient(tendons.surface, curvature)
    # rho mu^d above 1 leaves nothing to deliver: the tendon does not move.
    static = np.minimum(tendons.stiction_ratio * kinetic, 1.0)
    with np.errstate(divide="ignore"):
        pulling, least = (1.0 - kinetic) / (1.0 + kinetic), (1.0 - static) / (1.0 + static)
        return TransmissionEfficiency(curvature, pulling, 1.0 / pulling, least, 1.0 / least)


def coupling_in_motion(tendons: Tendons, position: Array, velocity: Array) -> Array:
    """Return the joint torques per unit of command, of a passive tendon per unit of its mean tension, shape (t, n), m.

    All tendons slide steadily as the joints move, fast enough for mu^d. Where the rows of H_c balance each other under
    positive tensions, force closure, so may these: then friction of the tendons alone cannot lock the finger.

    Args:
        tendons: The tendon layer.
        position: theta, shape (n,), rad.
        velocity: theta', shape (n,), rad/s; signs and ratios matter.
    """
    routing, actuated = tendons.routing, tendons.routing.actuated
    direction = np.sign(sliding_velocity(tendons, velocity))
    share = tendons.in_sliding(position, direction)[0][:actuated]
    kinetic = capstan_coefficient(tendons.surface, routing.curvature(position))
    part = (direction * kinetic)[actuated:, None]
    passive = (1.0 + part) * routing.proximal_coupling + (1.0 - part) * routing.distal_coupling
    return np.concatenate([share * routing.actuated_coupling, passive])


def workspace_postures(finger: FingerLike, samples: int = 9) -> Array:
    """Return a grid of postures over the ranges of all joints, shape (m, n), rad.

    Joints that passive tendons drive follow the others as inextensible tendons demand, (4); postures in which one of
    them would leave its range are left out.

    Args:
        finger: Any finger.
        samples: Angles per free joint.
    """
    finger = as_finger(finger)
    low, high = finger.stroke_limiter.lower, finger.stroke_limiter.upper
    coupling = PassiveCoupling.from_routing(finger.routing, finger.tendons.slack, bands=False)
    axes = [np.linspace(low[joint], high[joint], samples) for joint in coupling.free]
    postures = coupling.posture(np.array(list(product(*axes))))
    inside = np.all((postures >= low - 1e-9) & (postures <= high + 1e-9), axis=1)
    return np.asarray(postures[inside])


def flexion_postures(finger: FingerLike, samples: int = 41) -> Array:
    """Return postures over the ranges of the last two free joints, rad, shape (samples, samples, n); others near zero.

    A finger of one free joint moves that one alone along the first axis. (4) holds, ranges of driven joints are not
    looked at.

    Args:
        finger: Any finger.
        samples: Angles per joint.
    """
    finger = as_finger(finger)
    low, high = finger.stroke_limiter.lower, finger.stroke_limiter.upper
    coupling = PassiveCoupling.from_routing(finger.routing, finger.tendons.slack, bands=False)
    postures = np.tile(np.clip(np.zeros(len(low)), low, high), (samples, samples, 1))
    for axis, joint in enumerate(coupling.free[-2:]):
        angles = np.linspace(low[joint], high[joint], samples)
        postures[..., joint] = angles[:, None] if axis == 0 else angles
    return coupling.posture(postures[..., coupling.free])


def transmission_in_motion(finger: FingerLike, result: xr.Dataset) -> TransmissionInMotion:
    """Return the transmission of every tendon along a simulation and that of steady sliding.

    Args:
        finger: The finger that was simulated.
        result: Dataset of `simulate`.
    """
    finger = as_finger(finger)
    tendons = finger.tendons
    actuated = tendons.routing.actuated
    command, delivered, speed, normal, curvature = (
        np.array(result[name].transpose("time", "tendon").values)
        for name in (
            "spool_tension" if "spool_tension" in result else "tendon_command",
            "tendon_tension",
            "tendon_velocity",
            "tendon_normal_force",
            "tendon_curvature",
        )
    )
    if tendons.routing.passive:
        proximal = result["passive_tension_proximal"].transpose("time", ...).values
        command[:, actuated:] = proximal.reshape(len(command), -1)
    kinetic = capstan_coefficient(tendons.surface, curvature)
    coefficient = friction.friction_coefficient(speed, kinetic, tendons.stiction_ratio * kinetic, *tendons.stribeck)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(command > 0.0, delivered / command, np.nan)
        settled = sliding_tension(command, coefficient, speed, tendons.viscous, tendons.drag) / command
    slid = _since_reversal(result["time"].values, speed)
    numbers = dict(zip(PASSIVE_FRICTION.parameters, tendons.friction[:, : len(tendons.routing.tendons)], strict=True))
    level = np.maximum(normal * coefficient + tendons.drag, numbers["floor"])
    bristle = friction.bristle_deflection(level, numbers["stiffness"], numbers["hardening"])
    sliding = (slid > _SETTLED * bristle) & np.isfinite(ratio)
    return TransmissionInMotion(curvature, ratio, settled, sliding, np.sign(speed))


def _since_reversal(time: Array, speed: Array) -> Array:
    """Return the distance that each tendon has slid since its velocity last changed sign, shape (m, t), m."""
    path = np.concatenate(
        [
            np.zeros((1, speed.shape[1])),
            np.cumsum(0.5 * np.abs(speed[1:] + speed[:-1]) * np.diff(time)[:, None], axis=0),
        ]
    )
    turned = np.concatenate([np.ones((1, speed.shape[1]), dtype=bool), np.sign(speed[1:]) != np.sign(speed[:-1])])
    return np.asarray(path - np.maximum.accumulate(np.where(turned, path, 0.0), axis=0))
