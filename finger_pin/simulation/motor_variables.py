"""Variables of motors: their motion, torques and currents, and the samples of their position loops."""

from __future__ import annotations

from functools import partial

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.simulation.sampled_trajectory import Quantity, SampledTrajectory, state_block
from finger_pin.typing import Array

_DIMS = ("time", "motor")
#: What a run that goes on needs of its loops' last sample, in the order of `LoopMemory`.
LOOP_VARIABLES = ("position_loop_age", "position_loop_error", "position_loop_integral", "position_loop_voltage")


def motor_variables(loop: ClosedLoop) -> dict[str, Quantity]:
    """Return the variables of the motors of a loop, by name; none without any."""
    actuators = loop.finger.actuators
    if not actuators.names:
        return {}

    def motor_signal(run: SampledTrajectory, name: str) -> Array:
        return np.asarray(getattr(run.finger.motors, name))

    spools = ("spool_position", "spool_velocity") if actuators.loose_names else ()
    table = {name: state_block(name) for name in ("motor_position", "motor_velocity", "gearbox_stiction", *spools)}
    table |= {
        name: Quantity(_DIMS, partial(motor_signal, name=attribute), units, long_name, equation)
        for name, attribute, units, long_name, equation in (
            ("motor_current", "current", "A", "current of the winding", ""),
            ("motor_voltage", "voltage", "V", "voltage at the winding", ""),
            ("motor_torque", "torque", "N m", "torque of the motor, at the spool", ""),
            ("gearbox_friction", "friction", "N m", "friction torque of the gearbox", "9c"),
            ("gearbox_load", "load", "N m", "torque that the gears carry", ""),
        )
    }
    if loop.drives is not None and loop.drives.compiled is not None:
        table |= _loop_variables()
    return table


def _loop_variables() -> dict[str, Quantity]:
    """Return the variables of the last sample of position loops; zero for motors without one."""

    def age(run: SampledTrajectory) -> Array:
        assert run.loop.drives is not None and run.loop.drives.compiled is not None
        drives = run.loop.drives.compiled
        elapsed: Array = run.times - drives.first - drives.period * drives.latest(run.times)
        return np.maximum(elapsed, 0.0)

    def sampled_signal(run: SampledTrajectory, name: str) -> Array:
        assert run.loop.drives is not None and run.loop.drives.compiled is not None
        drives = run.loop.drives.compiled
        values = np.zeros((len(run.times), len(run.loop.finger.actuators.names)))
        values[:, run.loop.finger.actuators.holds] = drives.zero_order_hold(getattr(drives, name), run.times)
        return values

    texts = (
        ("errors", "rad", "commanded less measured angle at the last sample of a position loop, else 0"),
        ("integrals", "rad s", "integral of the error of a position loop, as the loop has it, else 0"),
        ("voltages", "V", "voltage that a position loop has asked for; 1e30 where the motor is let go"),
    )
    ages = Quantity(("time",), age, "s", "time since the last sample of the position loops")
    return {LOOP_VARIABLES[0]: ages} | {
        name: Quantity(_DIMS, partial(sampled_signal, name=history), unit, text)
        for name, (history, unit, text) in zip(LOOP_VARIABLES[1:], texts, strict=True)
    }
