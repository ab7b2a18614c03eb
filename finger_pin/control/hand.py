"""The controllers of a hand's fingers side by side: each has its own, and a lambda of its own in (22)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from finger_pin.control.loop_controller import LoopController
from finger_pin.control.proportional import ControlSignals
from finger_pin.description.routing import Array, Routing
from finger_pin.references.reference import ReferenceSignals
from finger_pin.references.signal import Signal


def joined_controller(controllers: Sequence[LoopController], routing: Routing) -> LoopController:
    """Return the controller of a hand from those of its fingers, in the order of the routing's.

    Where all are of a kind that can be joined, such as the paper's, so is the whole, and is compiled like them.
    """
    kind, *others = {type(each) for each in controllers}
    joined = None if others else kind.joined(controllers, routing)
    return joined or HandController(controllers, routing)


class HandController(LoopController):
    """Controllers of any kind, one for each finger.

    Attributes:
        controllers: In the order of the routing's fingers.
        routing: Of the hand.
    """

    def __init__(self, controllers: Sequence[LoopController], routing: Routing) -> None:
        """Put controllers side by side."""
        self.controllers, self.routing = tuple(controllers), routing
        self.measures = any(each.measures for each in controllers)

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands of all for shapes (..., n)."""
        torque, lead = np.zeros_like(position), position.shape[:-1]
        tension, shortfall = np.zeros((*lead, len(self.routing.tendons))), np.zeros_like(position)
        limited = False
        for controller, (joints, tendons) in zip(self.controllers, self.routing.fingers, strict=True):
            desired = ReferenceSignals(reference.position[..., joints], reference.velocity[..., joints])
            own = controller.command(time, desired, position[..., joints], velocity[..., joints])
            torque[..., joints], tension[..., tendons] = own.torque, own.tension
            if own.shortfall is not None:
                limited = True
                shortfall[..., joints] = own.shortfall
        return ControlSignals(torque, tension, shortfall if limited else None)

    def sense(self, readings: Mapping[str, Array], elapsed: float) -> None:
        """Pass on the readings of each finger's sensors, with the time since the last ones, s."""
        for controller, (joints, tendons) in zip(self.controllers, self.routing.fingers, strict=True):
            of = {"tendon_tension": tendons, "joint_position": joints, "joint_velocity": joints}
            controller.sense({name: readings[name][places] for name, places in of.items()}, elapsed)

    def signals(self) -> tuple[Signal, ...]:
        """Return the signals that any of them follows."""
        return tuple(signal for each in self.controllers for signal in each.signals())

    def without_memory(self) -> HandController | None:
        """Return the controllers that remember nothing, side by side, if there is one of each."""
        own = [each.without_memory() for each in self.controllers]
        known = [each for each in own if each is not None]
        return HandController(known, self.routing) if len(known) == len(own) else None
