"""Variables of a result at the present instant of several worlds, one row per world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, cast

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.interface import ControlSignals
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.signals.compiled_fingers import CompiledFingers
from finger_pin.core.steps.trajectory import Statistics, Trajectory
from finger_pin.learning.action import Action
from finger_pin.mechanism.evaluation import Outputs
from finger_pin.mechanism.state import Motion, State
from finger_pin.references.reference import ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.simulation.motor_variables import LOOP_VARIABLES
from finger_pin.simulation.row_variables import RESIDUAL
from finger_pin.simulation.sampled_trajectory import Quantity, SampledTrajectory
from finger_pin.simulation.variables import variables
from finger_pin.typing import Array

_NO_STATISTICS, _ENDLESS = Statistics(0, 0, 0, 0, 0.0), np.array([np.inf])
# Of a reference and a controller, which do not act.
_CONTROLLER_VARIABLES = ("joint_reference", "tracking_error", "joint_torque_command", "torque_shortfall")


def snapshot(loop: ClosedLoop, time: float, x: Array) -> SampledTrajectory:
    """Return the signals of a state, shape (size,), at a time, s."""
    return SampledTrajectory(loop, Trajectory(_ENDLESS, lambda _: x[None], _NO_STATISTICS), np.array([time]))


# What a step changes in place, and views of it.
_PERSISTENT = {"loop", "times", "packed", "state", "_outputs"}


class BatchedSnapshot(SampledTrajectory):
    """Worlds at their present states, with signals that are computed on first use."""

    def __init__(self, loop: BatchedLoop) -> None:
        """Allocate the present times, shape (w,), s, and packed states, shape (w, size)."""
        self.loop, count = loop, len(loop.loops)
        self._outputs = "all" if loop.accelerated else "no_acceleration"
        self.times, self.packed = np.zeros(count), np.zeros((count, loop.finger.layout.size))

    def clear_signals(self) -> None:
        """Delete the signals of earlier states; views of the states remain."""
        for name in vars(self).keys() - _PERSISTENT:
            delattr(self, name)

    def __getstate__(self) -> dict[str, Any]:
        """Return all attributes but views, which a copy recreates."""
        return {name: value for name, value in vars(self).items() if name in _PERSISTENT and name != "state"}


def instant_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the variables that are defined at an instant, by name."""
    return {
        name: quantity
        for name, quantity in variables(loop).items()
        # The account is of a whole run.
        if quantity.energy_term is None and name not in (*_CONTROLLER_VARIABLES, *LOOP_VARIABLES, RESIDUAL)
    }


@dataclass(frozen=True, eq=False)
class BatchedLoop(ClosedLoop):
    """Batched loop of worlds, each at its own time.

    Attributes:
        loops: Loops of the worlds.
        actions: Actions on them.
        accelerated: Whether accelerations are wanted.
    """

    loops: list[ClosedLoop] = field(default_factory=list)
    actions: list[Action] = field(default_factory=list)
    accelerated: bool = False

    @classmethod
    def from_loops(
        cls, loops: list[ClosedLoop], actions: list[Action], names: Sequence[str], *, separate: bool
    ) -> BatchedLoop:
        """Combine the loops of worlds.

        Args:
            loops: Loops of the worlds; one and the same where they share all parameters.
            actions: Actions on them.
            names: Names of the variables that will be used.
            separate: Whether the worlds differ in parameters.
        """
        template, accelerated = loops[0], "joint_acceleration" in names
        attributes = {each.name: getattr(template, each.name) for each in fields(ClosedLoop)}
        attributes["drives"] = None if actions[0].compiled is None else actions[0]
        if separate:
            attributes["dynamics"] = CompiledFingers([_dynamics(each) for each in loops], accelerated=accelerated)
            attributes["palm"] = template.palm and replace(template.palm, signal=cast(Signal, _PalmSignals(loops)))
        return cls(**attributes, loops=loops, actions=actions, accelerated=accelerated)

    def replace_world(self, index: int, loop: ClosedLoop, action: Action) -> None:
        """Replace a world; all have separate loops afterwards."""
        self.loops[index], self.actions[index] = loop, action
        assert isinstance(self.dynamics, CompiledFingers)
        self.dynamics.replace(index, _dynamics(loop))

    def spool_goals(self, time: Array) -> Array | None:
        """Return the goals of the worlds' motors, each at its own time, shape (w, k), rad."""
        drives = [action.compiled for action in self.actions]
        goals = [
            loop.zero_order_hold(loop.goals, at) for loop, at in zip(drives, time, strict=True) if loop is not None
        ]
        return np.array(goals) if goals else None

    def wound_lengths(self, angle: Array) -> Array:
        """Return the lengths that every world's spools wind in, shape (w, k'), m."""
        return np.array([loop.wound_lengths(goals[None])[0] for loop, goals in zip(self.loops, angle, strict=True)])

    @property
    def shared(self) -> bool:
        """True if all worlds have the same parameters."""
        return not isinstance(self.dynamics, CompiledFingers)

    def force(self, time: Array | float) -> Array:
        """Return F in all worlds, shape (3,) or (w, 3), of several fingers (f, 3) or (w, f, 3), N."""
        if self.shared:
            return super().force(time)
        return np.array([loop.force(instant) for loop, instant in zip(self.loops, np.asarray(time), strict=True)])

    def evaluate(self, time: Array | float, x: Array, outputs: Outputs = "all") -> LoopSignals:
        """Return all signals at times (w,) and states (w, size); the base's motion counts for accelerations alone."""
        times, routing = np.asarray(time), self.finger.routing
        command = np.array([action.inputs for action in self.actions])
        tension = np.zeros((len(times), len(routing.tendons)))
        tension[:, : routing.actuated] = command[:, : routing.actuated]
        inputs = command[:, routing.actuated :]
        control = ControlSignals(np.zeros((len(times), len(routing.joints))), tension, inputs=inputs)
        if self.drives is not None:
            voltages = [action.voltages(instant) for action, instant in zip(self.actions, times, strict=True)]
            command[:, self.drives.channels] = voltages
        base = None
        if outputs == "all" and (self.palm or self.prescribed_motion):
            base = np.array([loop.base(instant) for loop, instant in zip(self.loops, times, strict=True)])
        zeros = np.zeros((len(times), len(routing.joints)))
        finger = self.dynamics.evaluate(x, command, self.force(time), base, outputs)
        return LoopSignals(ReferenceSignals(zeros, zeros), control, finger)

    def motion(self, time: Array, state: State) -> Motion:
        """Return fingertips, base frame, at times (w,) and states; energies are those of a palm at rest."""
        return self.dynamics.motion(state.position, state.velocity)


class _PalmSignals:
    """Batched palm paths, each at its own time."""

    def __init__(self, loops: Sequence[ClosedLoop]) -> None:
        self._loops = loops

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return values and rates at times (w,), shape (w, 6) each."""
        samples = [loop.palm.signal.at(instant) for loop, instant in zip(self._loops, time, strict=True) if loop.palm]
        return np.array([value for value, _ in samples]), np.array([rate for _, rate in samples])


def _dynamics(loop: ClosedLoop) -> CompiledFinger:
    return cast(CompiledFinger, loop.dynamics)
