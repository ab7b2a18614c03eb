"""The signals of a finger at a state, by the names of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.mechanism.evaluation import Evaluation
from finger_pin.mechanism.rows import RowSignals, combined
from finger_pin.mechanism.state import State

_TABLES = ("passive_halves", "driven_tendons", "passive_tendons", "joint_friction", "limiter", "joint_springs")


@dataclass(frozen=True, eq=False)
class TendonForces:
    """Signals of the tendons; shapes (..., t) unless said otherwise.

    Attributes:
        curvature: phi, rad, (15).
        coefficient: mu^d, (16).
        velocity: v, m/s; (H_c theta')_i, and p_5' for a passive tendon.
        friction: f^f, N, (9c).
        normal: F^n = |f| + |f^a|, N, (14), with f before micro-damping.
        level: max(F^n M, g_min), N.
        stiction_rate: F^s', N/s, (9a).
        entering: f^a, what pulls at the canal's entrance, N; of a passive tendon its proximal half.
        strands: f of (12), shape (..., s), N.
        passive_acceleration: p_5'', shape (..., p), m/s2, (13).
    """

    curvature: Array
    coefficient: Array
    velocity: Array
    friction: Array
    normal: Array
    level: Array
    stiction_rate: Array
    entering: Array
    strands: Array
    passive_acceleration: Array


@dataclass(frozen=True, eq=False)
class JointForces:
    """Signals of the joints' friction; shapes (..., n).

    Attributes:
        reaction: R, N, (17).
        friction: tau^f, N m, (9c).
        level: max(R M, g_min), N m.
        stiction_rate: F^s', N m/s, (9a).
    """

    reaction: Array
    friction: Array
    level: Array
    stiction_rate: Array


@dataclass(frozen=True, eq=False)
class MotorForces:
    """Signals of the motors; shapes (..., m).

    Attributes:
        current: i, A.
        voltage: U, V.
        torque: tau = K_t i, N m.
        friction: tau_g, N m, (9c).
        load: N, the torque that the gears carry, N m.
    """

    current: Array
    voltage: Array
    torque: Array
    friction: Array
    load: Array


@dataclass(frozen=True, eq=False)
class FingerSignals:
    """The terms of (18) at one state or at many (leading dimensions are kept).

    Attributes:
        state: The state, unpacked.
        command: f^a, shape (..., a), N.
        fingertip_force: F, shape (3,) or (..., 3), of several fingers (f, 3) or (..., f, 3), N, base frame.
        tendons: Tendon forces and friction.
        joints: Joint reaction and friction.
        limiter_depth: Signed penetration beyond the range, shape (..., n), rad.
        limiter_torque: tau^r, shape (..., n), N m.
        spring_torque: tau^k of the joints' springs, shape (..., n), N m.
        tendon_torque: H_c2^T f, shape (..., n), N m, (11).
        external_torque: J^T F, shape (..., n), N m, (6).
        acceleration: theta'', shape (..., n), rad/s2, (18).
        rate: Time derivative of the packed state, shape (..., size).
        mechanism: The same of the mechanism, with what every row does.
        motors: Signals of the motors; None without any.
    """

    state: State
    command: Array
    fingertip_force: Array
    tendons: TendonForces
    joints: JointForces
    limiter_depth: Array
    limiter_torque: Array
    spring_torque: Array
    tendon_torque: Array
    external_torque: Array
    acceleration: Array
    rate: Array
    mechanism: Evaluation
    motors: MotorForces | None = None

    @classmethod
    def of(
        cls,
        found: Evaluation,
        state: State,
        command: Array,
        force: Array,
        torque: Array,
        bodies: int,
        pulled: dict[str, Array],
    ) -> FingerSignals:
        """Take the rows' signals apart by the paper's names.

        Args:
            found: Evaluation of the mechanism.
            state: The state, unpacked.
            command: f^a, shape (..., a), N.
            force: F, N.
            torque: H_c2^T f, shape (..., n), N m.
            bodies: Number of velocities of the rigid body, before those of passive tendons.
            pulled: Weights with which further tables pull the strands, by table, as of `Tendons.pulled`.
        """
        joints, passive_tendons = torque.shape[-1], state.passive_position.shape[-1]
        halves, driven, passive, pins, limiter, springs = (found.rows[name] for name in _TABLES)
        strands, motors = np.concatenate([driven.force, halves.force], axis=-1), None
        for table, weights in pulled.items():
            strands = strands + combined(found.rows[table].force, weights.T)
        if "motors" in found.rows:
            motor, gears = (found.rows[name] for name in ("motors", "gearboxes"))
            motors = MotorForces(motor["current"], motor["voltage"], motor.force, gears["friction"], gears.row.load)

        def both(of: Callable[[RowSignals], Array]) -> Array:
            return np.concatenate([of(driven), of(passive)], axis=-1)

        return cls(
            state=state,
            command=command,
            fingertip_force=force,
            tendons=TendonForces(
                curvature=both(lambda tendons: tendons.row.curvature),
                coefficient=both(lambda tendons: tendons["coefficient"]),
                velocity=both(lambda tendons: tendons.row.speed),
                friction=both(lambda tendons: tendons["friction"]),
                normal=both(lambda tendons: tendons["normal_force"]),
                level=both(lambda tendons: tendons["level"]),
                stiction_rate=both(lambda tendons: tendons.rate),
                entering=np.concatenate([driven.row.command, strands[..., driven.rows.count :: 2]], axis=-1),
                strands=strands,
                passive_acceleration=found.acceleration[..., bodies : bodies + passive_tendons],
            ),
            joints=JointForces(
                reaction=pins["normal_force"], friction=pins["friction"], level=pins["level"], stiction_rate=pins.rate
            ),
            limiter_depth=limiter["depth"],
            limiter_torque=-limiter.force,
            spring_torque=-combined(springs.force, springs.rows.arm)[..., :joints],
            tendon_torque=torque,
            external_torque=found.external[..., :joints],
            acceleration=found.acceleration[..., :joints],
            rate=found.rate,
            mechanism=found,
            motors=motors,
        )
