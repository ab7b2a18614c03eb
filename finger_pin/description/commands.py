"""Commands of a controller: its tables by tendon or motor, their units, and the table that a name belongs to."""

from __future__ import annotations

from collections.abc import Collection

#: Tables of a controller by motor or tendon beside tensions, and their units; all of them stand for open loop.
WINDINGS = {"spool_angle": "rad", "tendon_winding": "m", "motor_voltage": "V"}
BY_SOURCE = ("tensions", *WINDINGS)
#: The units of all commands, by their table, and of the supply of a loop; inputs of a tree's actuators have their own.
COMMANDS = {"tensions": "N", **WINDINGS, "supply_voltage": "V", "inputs": ""}
#: All of these tables.
BY_NAME = tuple(COMMANDS)


def command_place(name: str, inputs: Collection[str]) -> tuple[str, str]:
    """Return the table of a controller that a command belongs to, and its name there.

    Args:
        name: A tendon or an actuator of a tree, or a name after that of its table, as in ``spool_angle.M1``.
        inputs: Names of the tree's actuators.
    """
    table, dot, inner = name.partition(".")
    if dot and table in COMMANDS:
        return table, inner
    return ("inputs" if name in inputs else "tensions"), name
