"""The signals of a finger at a state, by the names of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mechanism.evaluation import Evaluation
from finger_pin.mechanism.groups import CANALS
from finger_pin.mechanism.rows import RowSignals, weighted_sum
from finger_pin.mechanism.state import State
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class TendonForces:
    """Signals of the tendons, joined when they are asked for; shapes (..., t) unless said otherwise.

    Attributes:
        driven: Signals of the rows of actuated tendons.
        passive: Those of passive tendons.
        strands: f of (12), shape (..., s), N.
        passive_acceleration: p_5'', shape (..., p), m/s2, (13).
        beyond: Signals of wraps beyond the first ones, and which row is of which tendon, shape (t, k).
    """

    driven: RowSignals
    passive: RowSignals
    strands: Array
    passive_acceleration: Array
    beyond: Sequence[tuple[RowSignals, Array]] = ()

    def _of_all_tendons(self, of: Callable[[RowSignals], Array]) -> Array:
        return np.concatenate([of(self.driven), of(self.passive)], axis=-1)

    def _sum(self, of: Callable[[RowSignals], Array]) -> Array:
        """Return the sum over all places where a tendon rubs."""
        return sum((weighted_sum(of(wraps), weights.T) for wraps, weights in self.beyond), self._of_all_tendons(of))

    def at_wraps(self, of: Callable[[RowSignals], Array]) -> Array:
        """Return a signal at every place of the tendons that rub at several, in the order of `Finger.wrap_names`."""
        return np.concatenate(
            [of(self.driven)[..., self._wrapped_tendons()], *(of(wraps) for wraps, _ in self.beyond)], axis=-1
        )

    @property
    def wrap_tension(self) -> Array:
        """Tension behind every place of the tendons that rub at several, N."""
        acting = self.driven.rows.parameters[self.driven.rows.law.parameters.index("acting")]
        first = self.driven.force + acting * self.driven.row.command
        behind = (wraps.row.command + wraps.force for wraps, _ in self.beyond)
        return np.concatenate([first[..., self._wrapped_tendons()], *behind], axis=-1)

    def _wrapped_tendons(self) -> NDArray[np.intp]:
        return np.flatnonzero(self._has_several_wraps()[: self.driven.rows.count])

    @property
    def curvature(self) -> Array:
        """phi, rad, (15)."""
        return self._sum(lambda tendons: tendons.row.curvature)

    @property
    def coefficient(self) -> Array:
        """mu^d, (16), of all curvature together."""
        whole = self._of_all_tendons(lambda tendons: tendons["coefficient"])
        if not self.beyond:
            return whole
        surface = np.concatenate([self.driven.rows.parameters[0], self.passive.rows.parameters[0]])
        return np.where(self._has_several_wraps(), capstan_coefficient(surface, self.curvature), whole)

    def _has_several_wraps(self) -> NDArray[np.bool_]:
        """Return whether each tendon rubs at several places, shape (t,)."""
        mask = np.zeros(self.driven.rows.count + self.passive.rows.count, dtype=bool)
        for _, weights in self.beyond:
            mask |= np.any(weights, axis=1)
        return mask

    @property
    def velocity(self) -> Array:
        """v, m/s, at the first place; (H_c theta')_i, and p_5' for a passive tendon."""
        return self._of_all_tendons(lambda tendons: tendons.row.speed)

    @property
    def friction(self) -> Array:
        """f^f, N, (9c), at all places together."""
        return self._sum(lambda tendons: tendons["friction"])

    @property
    def normal(self) -> Array:
        """F^n = |f| + |f^a|, N, (14), with f before micro-damping."""
        of_first = self._of_all_tendons(lambda tendons: tendons["normal_force"])
        if not self.beyond:
            return of_first
        actuated = self.driven.rows.count
        ends = np.abs(self.strands[..., :actuated]) + np.abs(self.driven.row.command)
        return np.where(self._has_several_wraps(), np.concatenate([ends, of_first[..., actuated:]], axis=-1), of_first)

    @property
    def level(self) -> Array:
        """max(F^n M, g_min), N, at all places together."""
        return self._sum(lambda tendons: tendons["level"])

    @property
    def stiction_rate(self) -> Array:
        """F^s', N/s, (9a), at the first place."""
        return self._of_all_tendons(lambda tendons: tendons.rate)

    @property
    def entering(self) -> Array:
        """f^a, what pulls at the canal's entrance, N; of a passive tendon its proximal half."""
        return np.concatenate([self.driven.row.command, self.strands[..., self.driven.rows.count :: 2]], axis=-1)


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
    """The terms of (18) at one state or at many (leading dimensions are kept), taken apart when they are asked for.

    Attributes:
        state: The state, unpacked.
        command: f^a, shape (..., a), N.
        fingertip_force: F, shape (3,) or (..., 3), of several fingers (f, 3) or (..., f, 3), N, base frame.
        mechanism: The same of the mechanism, with what every row does.
        bodies: Number of velocities of the rigid body, before those of passive tendons.
        drive_matrices: Weights with which further tables pull the strands, by table, as of `Tendons.drive_matrices`.
        wraps: By table of wraps beyond the first ones, which row is of which tendon, shape (t, rows).
    """

    state: State
    command: Array
    fingertip_force: Array
    mechanism: Evaluation
    bodies: int
    drive_matrices: Mapping[str, Array]
    wraps: Mapping[str, Array]

    @cached_property
    def tendons(self) -> TendonForces:
        """Tendon forces and friction."""
        evaluation, masses = self.mechanism, self.state.passive_position.shape[-1]
        driven, passive = evaluation.rows["driven_tendons"], evaluation.rows["passive_tendons"]
        strands = np.concatenate([driven.force, evaluation.rows["passive_halves"].force], axis=-1)
        for table, weights in self.drive_matrices.items():
            strands = strands + weighted_sum(evaluation.rows[table].force, weights.T)
        beyond = [(evaluation.rows[table], weights) for table, weights in self.wraps.items()]
        for wraps, weights in beyond:
            strands = strands + weighted_sum(wraps.force, weights.T @ np.eye(len(weights), strands.shape[-1]))
        acceleration = evaluation.acceleration[..., self.bodies : self.bodies + masses]
        return TendonForces(driven, passive, strands, acceleration, beyond)

    @property
    def cord_tension(self) -> Array:
        """Delivered tensions of the cords that servos, muscles or springs pull, shape (..., c), N, (12)."""
        if CANALS not in self.mechanism.rows:
            return np.zeros((*self.state.position.shape[:-1], 0))
        return self.mechanism.rows[CANALS]["pressing"]

    @property
    def joints(self) -> JointForces:
        """Joint reaction and friction."""
        pins = self.mechanism.rows["joint_friction"]
        return JointForces(pins["normal_force"], pins["friction"], pins["level"], pins.rate)

    @property
    def motors(self) -> MotorForces | None:
        """Signals of the motors; None without any."""
        if "motors" not in self.mechanism.rows:
            return None
        motor, gears = self.mechanism.rows["motors"], self.mechanism.rows["gearboxes"]
        return MotorForces(motor["current"], motor["voltage"], motor.force, gears["friction"], gears.row.load)

    @property
    def limiter_depth(self) -> Array:
        """Signed penetration beyond the range, shape (..., n), rad."""
        return self.mechanism.rows["limiter"]["depth"]

    @property
    def limiter_torque(self) -> Array:
        """tau^r, shape (..., n), N m."""
        return -self.mechanism.rows["limiter"].force

    @property
    def spring_torque(self) -> Array:
        """tau^k of the joints' springs, shape (..., n), N m."""
        springs = self.mechanism.rows["joint_springs"]
        return self._at_joints(-weighted_sum(springs.force, springs.rows.arm))

    @property
    def tendon_torque(self) -> Array:
        """H_c2^T f, shape (..., n), N m, (11)."""
        return self._at_joints(self.mechanism.tendon_torque)

    @property
    def external_torque(self) -> Array:
        """J^T F, shape (..., n), N m, (6)."""
        return self._at_joints(self.mechanism.external)

    @property
    def acceleration(self) -> Array:
        """theta'', shape (..., n), rad/s2, (18)."""
        return self._at_joints(self.mechanism.acceleration)

    @property
    def rate(self) -> Array:
        """Time derivative of the packed state, shape (..., size)."""
        return self.mechanism.rate

    def _at_joints(self, values: Array) -> Array:
        return values[..., : self.state.position.shape[-1]]
