"""Inputs of a finger: by name in place of an array in their order, and some time after they were commanded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.description.commands import command_place
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Arrivals within this time, s, coincide: a step between them would have no length.
_TIME_TOLERANCE = 1e-12
#: Numbers in the order of the inputs, or by name.
Inputs = ArrayLike | Mapping[str, float]


def input_delays(finger: FingerDescription, routing: Routing) -> Array:
    """Return the delays of all inputs, shape (u,), s: none of actuated tendons, then those of a tree's actuators."""
    return np.array([*np.zeros(routing.actuated), *(each.delay for each in finger.tree.actuators.values())])


class InputQueue:
    """Commands on their way; an input is zero until its first one arrives.

    Attributes:
        delays: Of each input, shape (u,), s.
    """

    def __init__(self, delays: Array) -> None:
        """Create an empty queue."""
        self.delays, self._longest = delays, float(np.max(delays, initial=0.0))
        self._values = np.zeros(len(delays))
        self._pending: list[tuple[float, Array]] = []

    def add(self, time: float, values: Array) -> None:
        """Command values, shape (u,), at a time, s, not before those of earlier commands."""
        if self._longest:
            self._pending.append((time, values))
        else:
            self._values = values

    def at(self, time: float) -> Array:
        """Return the values that have arrived by a time, s, shape (u,); never ask for an earlier one again."""
        if self._pending:
            latest = time + _TIME_TOLERANCE
            for commanded, values in self._pending:
                self._values = np.where(commanded + self.delays <= latest, values, self._values)
            self._pending = [each for each in self._pending if each[0] + self._longest > latest]
        return self._values

    def next_arrival(self, time: float, end: float) -> float:
        """Return when the next value arrives after a time, s, at most the end."""
        if not self._pending:
            return end
        arrivals = [commanded + delay for commanded, _ in self._pending for delay in set(self.delays.tolist())]
        return min([each for each in arrivals if time + _TIME_TOLERANCE < each < end - _TIME_TOLERANCE], default=end)

    def copy(self) -> InputQueue:
        """Return a copy that goes on by itself."""
        twin = InputQueue(self.delays)
        twin._values, twin._pending = self._values, self._pending[:]
        return twin


def input_indices(finger: Finger, *, goals: bool = False) -> dict[str, int]:
    """Return the indices of the inputs by name, as in ``tensions.T1``: those of winches are ``tendon_winding``.

    ``motor_voltage`` is that of a motor in position drive, or ``spool_angle`` where its input is the goal of its loop;
    ``inputs`` are of a tree's actuators.
    """
    description, routing = finger.description, finger.routing
    tendons = list(routing.tendons[: routing.actuated])
    positioned = {name: each.tendons for name, each in description.actuators.items() if each.drive == "position"}
    driven = {tendon for cords in positioned.values() for tendon in cords}
    kinds = ["tendon_winding" if winched else "tensions" for winched in routing.winched]
    indices = {f"{kinds[index]}.{tendon}": index for index, tendon in enumerate(tendons) if tendon not in driven}
    kind = "spool_angle" if goals else "motor_voltage"
    indices |= {f"{kind}.{name}": tendons.index(cords[0]) for name, cords in positioned.items()}
    return indices | {f"inputs.{name}": routing.actuated + k for k, name in enumerate(description.tree.actuators)}


def inputs_by_name(
    entry: str, commands: Mapping[str, Any], finger: Finger, *, with_loops: bool = False, goals: bool = False
) -> Array:
    """Return the inputs that commands by name stand for, shape (channels,).

    Args:
        entry: That gives them, for messages.
        commands: A number by name: of `input_indices`, or of a tendon or an actuator of a tree alone.
        finger: The finger.
        with_loops: Whether motors in position drive have loops, which give them their voltages.
        goals: Whether their inputs are goals of these loops.
    """
    indices = input_indices(finger, goals=goals)
    if with_loops:
        indices = {name: index for name, index in indices.items() if not name.startswith("motor_voltage.")}
    inputs, missing = np.zeros(finger.mechanism.channels), dict(indices)
    for name, value in commands.items():
        full_name = ".".join(command_place(name, finger.description.tree.actuators))
        if full_name not in indices:
            raise InputError(f"{entry}.{name}", f"no such input; there are {choices(full_name, indices)}")
        inputs[indices[full_name]] = value
        missing.pop(full_name, None)
    if missing:
        raise InputError(entry, f"must have all of {', '.join(indices)}; missing: {', '.join(missing)}")
    return inputs
