"""Trajectory at the saved times, its signals, and the quantities of a result that follow from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.interface import ControlSignals
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.caching import cached_property
from finger_pin.mechanism.evaluation import Outputs
from finger_pin.mechanism.signals import FingerSignals, Quantity
from finger_pin.mechanism.state import Motion, State
from finger_pin.references.reference import ReferenceSignals
from finger_pin.simulation.energy import Account, Flows, account, energies, powers
from finger_pin.typing import Array

#: Variables that need states, plans and no more of the finger's signals than forces.
_FORCE_VARIABLES = frozenset(
    {
        "joint_position",
        "joint_velocity",
        "joint_reference",
        "tracking_error",
        "joint_torque_command",
        "joint_torque",
        "tendon_command",
        "tendon_tension",
        "fingertip_position",
    }
)


class SampledTrajectory:
    """A trajectory at times, with signals that are computed on first use.

    The signals are recomputed from the states by the evaluation that the dynamics use.

    Attributes:
        loop: The system.
        trajectory: Its solution.
        times: Shape (m,), s, as far as the trajectory goes.
    """

    def __init__(
        self, loop: ClosedLoop, trajectory: Trajectory, times: Array, names: Sequence[str] | None = None
    ) -> None:
        """Store the trajectory; signals are computed on first use.

        Args:
            loop: The system.
            trajectory: Its solution.
            times: Shape (m,), in order, s.
            names: Names of `variables` that will be used; by default all.
        """
        self._outputs: Outputs = "all" if names is None or "joint_acceleration" in names else "no_acceleration"
        if names is not None and _FORCE_VARIABLES.issuperset(names):
            self._outputs = "row_forces"
        self.loop, self.trajectory = loop, trajectory
        self.times = times[times <= trajectory.breakpoints[-1] * (1.0 + 1e-12)]

    @cached_property
    def packed(self) -> Array:
        """The packed states, shape (m, size)."""
        return self.trajectory.interpolate(self.times)

    @cached_property
    def state(self) -> State:
        """The states by name."""
        return self.loop.finger.layout.unpack(self.packed)

    @cached_property
    def reference(self) -> ReferenceSignals:
        """The reference."""
        return self.signals.reference if "signals" in vars(self) else self.loop.reference.at(self.times)

    @cached_property
    def control(self) -> ControlSignals:
        """The commands."""
        return self.signals.control

    @cached_property
    def signals(self) -> LoopSignals:
        """All signals of the finger."""
        return self.loop.evaluate(self.times, self.packed, self._outputs)

    @property
    def finger(self) -> FingerSignals:
        """Signals of the finger, by the names of the paper."""
        return self.signals.finger

    @property
    def force(self) -> Array:
        """F, shape (m, 3), of several fingers (m, f, 3), N, base frame."""
        return np.broadcast_to(self.loop.force(self.times), (len(self.times), *self.loop.fingertip_force.shape))

    @property
    def spool_goals(self) -> Array | None:
        """theta_m^d of the motors in position drive, shape (m, k), rad; None without loops."""
        drives = None if self.loop.drives is None else self.loop.drives.compiled
        return None if drives is None else drives.zero_order_hold(drives.goals, self.times)

    def wound_lengths(self, angle: Array) -> Array:
        """Return the lengths that spools at angles (m, k), rad, wind in of their k' cords, shape (m, k'), m."""
        return angle @ self.loop.finger.actuators.spools.T

    def values_of(self, variable: Quantity) -> Array:
        """Return the values of a variable, shape (m, ...)."""
        return variable.value(self.finger if variable.of_finger else self)

    @cached_property
    def motion(self) -> Motion:
        """Fingertips, and energies of the rigid body."""
        return self.loop.motion(self.times, self.state)

    @cached_property
    def stored(self) -> dict[str, Array]:
        """The energies by name, J."""
        return energies(self.loop.finger, self.finger, self.motion)

    @cached_property
    def powers(self) -> Flows:
        """Powers supplied and lost, W."""
        return powers(self.finger)

    @cached_property
    def account(self) -> Account:
        """The energy account."""
        return account(self.loop, self.trajectory, self.times, self.signals, self.motion)
