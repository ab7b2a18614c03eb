"""Variables of a result at one instant of a motion that goes on."""

from __future__ import annotations

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.stepping.textbook import Statistics, Trajectory
from finger_pin.description.routing import Array
from finger_pin.simulation.motions import Motions
from finger_pin.simulation.variables import RESIDUAL, Variable, variables

_NOTHING = Statistics(0, 0, 0, 0, 0.0)
# Of a reference and a controller, which do not act.
_OF_CONTROLLERS = ("joint_reference", "tracking_error", "joint_torque_command", "torque_shortfall")


def known_variables(loop: ClosedLoop) -> dict[str, Variable]:
    """Return the variables that are known at an instant, by name."""
    return {
        name: each
        for name, each in variables(loop).items()
        # The account is of a whole run.
        if each.booked is None and name not in (*_OF_CONTROLLERS, RESIDUAL)
    }


def instant(loop: ClosedLoop, time: float, x: Array) -> Motions:
    """Return what is known of a state, shape (size,), at a time, s."""
    times = np.array([time])
    return Motions(loop, Trajectory(times, lambda _: x[None], _NOTHING), times)
