"""Trajectory at the saved times, its signals, and the quantities of a result that follow from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.interface import ControlSignals
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.caching import cached_property
from finger_pin.mechanism.evaluation import ContactPoints, Outputs
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.rows import Energy
from finger_pin.mechanism.state import BLOCKS, Motion, State
from finger_pin.references.reference import ReferenceSignals
from finger_pin.simulation.energy import Account, Flows, account, energies, powers
from finger_pin.typing import Array

#: Frames of variables with components; the base's, a palm's if there is one, is that of all but the palm's own.
BASE_FRAME, WORLD_FRAME = "base", "world"

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

    @cached_property
    def touching(self) -> ContactPoints:
        """Contacts in space."""
        scene, mechanism = self.loop.finger.scene, self.finger.mechanism
        assert scene is not None
        return mechanism.touching or scene.touching(self.state, mechanism.rows[scene.contacts.group].force)

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


class Quantity(NamedTuple):
    """A variable of a result.

    Attributes:
        dims: Names of its dimensions, time first.
        value: Function that returns its values from a sampled trajectory.
        units: SI.
        long_name: In words.
        equation: Number of its equation in the paper; empty for none.
        frame: Whose axes its components are along, `BASE_FRAME` or `WORLD_FRAME`; empty for what has none.
        energy_term: Its part in the energy account, if any.
    """

    dims: tuple[str, ...]
    value: Callable[[SampledTrajectory], Array]
    units: str
    long_name: str
    equation: str = ""
    frame: str = ""
    energy_term: Energy | None = None

    @property
    def attributes(self) -> dict[str, str]:
        """Unit, name, frame and equation, and its part in the account."""
        metadata = {"units": self.units, "long_name": self.long_name} | ({"frame": self.frame} if self.frame else {})
        if self.energy_term is not None:
            metadata |= {"account": self.energy_term.kind, "label": self.energy_term.label}
        return metadata | {"equation": f"({self.equation})"} if self.equation else metadata


def state_block(block: str, single: bool = False) -> Quantity:
    """Return the variable of a block of the state; without a second dimension if ``single``."""
    entry = BLOCKS[block]

    def value(samples: SampledTrajectory) -> Array:
        values: Array = getattr(samples.state, block)
        return values[:, 0] if single else values

    return Quantity(
        ("time",) if single else ("time", entry.dimension), value, entry.unit, entry.long_name, entry.equation
    )
