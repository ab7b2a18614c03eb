"""The controllers of a hand's fingers side by side: each has its own, and a lambda of its own in (22)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from finger_pin.control.measurement import MeasuringController
from finger_pin.control.open_loop import OpenLoopTensions
from finger_pin.control.proportional import Controller, ControlSignals, ProportionalController
from finger_pin.control.reference import ReferenceSignals
from finger_pin.control.signal import Signal
from finger_pin.description.routing import Array, Routing


def joined_controller(controllers: Sequence[Controller], routing: Routing) -> Controller:
    """Return the controller of a hand from those of its fingers, in the order of the routing's.

    Where all are the paper's, or all give tensions in open loop, so does the whole, and is compiled like them.
    """
    paper = [each for each in controllers if isinstance(each, ProportionalController)]
    if len(paper) == len(controllers):
        return _joined_paper(paper, routing)
    schedules = [each for each in controllers if isinstance(each, OpenLoopTensions)]
    if len(schedules) == len(controllers):
        return OpenLoopTensions(Signal.joined([each.signal for each in schedules]), routing)
    if any(isinstance(each, MeasuringController) for each in controllers):
        return MeasuringHandController(controllers, routing)
    return HandController(controllers, routing)


def _joined_paper(controllers: Sequence[ProportionalController], routing: Routing) -> ProportionalController:
    tendons, joints = len(routing.tendons), len(routing.joints)
    gain, damping, minimum, internal = np.zeros(joints), np.zeros(joints), np.zeros(tendons), np.zeros(tendons)
    inverse, loop = np.zeros((tendons, joints)), np.zeros(tendons, dtype=np.int64)
    for index, (each, (turned, pulled)) in enumerate(zip(controllers, routing.fingers, strict=True)):
        gain[turned], damping[turned] = each.gain, each.damping
        minimum[pulled], internal[pulled] = each.minimum, each.internal
        inverse[np.ix_(pulled, turned)], loop[pulled] = each.inverse, index
    return ProportionalController(gain, minimum, inverse, internal, damping, loop)


class HandController:
    """Controllers of any kind, one for each finger.

    Attributes:
        controllers: In the order of the routing's fingers.
        routing: Of the hand.
    """

    def __init__(self, controllers: Sequence[Controller], routing: Routing) -> None:
        """Put controllers side by side."""
        self.controllers, self.routing = tuple(controllers), routing

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


class MeasuringHandController(HandController, MeasuringController):
    """The same where some listen to tension sensors."""

    def sense(self, tension: Array, elapsed: float) -> None:
        """Pass delivered tensions, shape (t,), N, on to those that listen, with the time since the last ones, s."""
        for controller, (_, tendons) in zip(self.controllers, self.routing.fingers, strict=True):
            if isinstance(controller, MeasuringController):
                controller.sense(tension[tendons], elapsed)
