"""Variables of the mechanism's rows: signals of tables, the energy account, and motors with their position loops."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rows import LOST, Rows
from finger_pin.simulation.energy import flow_terms, stored_terms
from finger_pin.simulation.sampled_trajectory import Quantity, SampledTrajectory, state_block
from finger_pin.typing import Array

_TIME, _MOTOR = ("time",), ("time", "motor")
RESIDUAL = "energy_residual"
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
        name: Quantity(_MOTOR, partial(motor_signal, name=attribute), units, long_name, equation)
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
        name: Quantity(_MOTOR, partial(sampled_signal, name=history), unit, text)
        for name, (history, unit, text) in zip(LOOP_VARIABLES[1:], texts, strict=True)
    }


def extra_row_variables(tables: tuple[Rows, ...]) -> dict[str, Quantity]:
    """Return the signals of the rows of some tables, by name."""

    def row_signal(run: SampledTrajectory, group: str, name: str) -> Array:
        rows = run.finger.mechanism.rows[group]
        return np.asarray(getattr(rows.row, name))

    def force(run: SampledTrajectory, group: str) -> Array:
        return run.finger.mechanism.rows[group].force

    def law_signal(run: SampledTrajectory, group: str, index: int) -> Array:
        return run.finger.mechanism.rows[group].signals[index]

    quantities: dict[str, Quantity] = {}
    for table in tables:
        group = table.group
        units = {"length": table.unit, "speed": f"{table.unit}/s", "force": "N m" if table.unit == "rad" else "N"}
        values: dict[str, Callable[[SampledTrajectory], Array]] = {"force": partial(force, group=group)}
        values |= {name: partial(row_signal, group=group, name=name) for name in ("length", "speed")}
        values |= {name: partial(law_signal, group=group, index=i) for i, name in enumerate(table.law.signals)}
        if np.any(table.channels >= 0):
            values["input"] = partial(row_signal, group=group, name="command")
        if table.law.scale is not None:
            values["state"] = partial(row_signal, group=group, name="state")
        for name, value in values.items():
            unit = units.get(name, "SI") if table.unit else "SI"
            quantities[f"{group}_{name}"] = Quantity(("time", group), value, unit, f"{name} of {table.law.name}")
    return quantities


def cord_variables(finger: Finger) -> dict[str, Quantity]:
    """Return the tension of the cords that no motor of the finger pulls, by the name of the variable; empty if none."""
    if not finger.cord_names:
        return {}
    text = "delivered tension of a cord that servos, muscles or springs pull; negative where a servo pushes it"
    return {"cord_tension": Quantity(("time", "cord"), lambda run: run.finger.cord_tension, "N", text, "12")}


def account_variables(finger: Finger) -> dict[str, Quantity]:
    """Return the stored energies, the powers, their integrals and the residual of the account, by name."""

    def stored(run: SampledTrajectory, name: str) -> Array:
        return run.stored[name]

    def power(run: SampledTrajectory, name: str) -> Array:
        return run.powers[name]

    def work(run: SampledTrajectory, name: str) -> Array:
        return run.account.works[name]

    table = {}
    for term in stored_terms(finger):
        table[f"energy_{term.name}"] = Quantity(
            _TIME, partial(stored, name=term.name), "J", f"energy stored: {term.label}", energy_term=term
        )
    # Supplied powers come before losses.
    for term in sorted(flow_terms(finger.mechanism.energies), key=lambda term: term.kind == LOST):
        name, text = term.name, f"{term.kind}: {term.label}"
        table[f"power_{name}"] = Quantity(_TIME, partial(power, name=name), "W", f"power {text}", energy_term=term)
        table[f"energy_exchanged_{name}"] = Quantity(
            _TIME, partial(work, name=name), "J", f"energy {text}", energy_term=term
        )
    text = "stored energy less its start, less supplied, plus lost: zero for an exact integration"
    table[RESIDUAL] = Quantity(_TIME, lambda run: run.account.residual, "J", text)
    return table
