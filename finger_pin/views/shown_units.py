"""Units in which results are shown: degrees for angles, SI prefixes, and units that differ from joint to joint."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr

from finger_pin.simulation.frames import read_scene
from finger_pin.typing import Array

_DEGREES = {"rad": "°", "rad/s": "°/s", "rad/s^2": "°/s²"}
#: The attribute of the part of a hand's result that is about one finger: its name.
OF_FINGER = "of_finger"
# Thousands of the unit, from 1e-9 to 1e6 times it.
_PREFIXES = ("n", "\N{MICRO SIGN}", "m", "", "k", "M")


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which figures show a quantity: angles are in degrees, all else as it is."""
    return (180.0 / np.pi, _DEGREES[unit]) if unit in _DEGREES else (1.0, unit)


def in_shown_units(result: xr.Dataset) -> xr.Dataset:
    """Return a Dataset with all variables and coordinates in the units that figures show."""
    for name in [name for name, variable in result.variables.items() if variable.attrs.get("units") in _DEGREES]:
        factor, unit = shown_unit(result[name].attrs["units"])
        result = result.assign({name: (factor * result[name]).assign_attrs(result[name].attrs, units=unit)})
    return result


def prefixed(values: Array, unit: str) -> tuple[float, str]:
    """Return the factor and the unit with an SI prefix in which the largest of some values is between 1 and 1000."""
    largest = float(np.max(np.abs(values), initial=0.0))
    thousands = int(np.clip(np.floor(np.log10(largest) / 3.0), -3, 2)) if largest > 0.0 else -1
    return 1000.0**-thousands, _PREFIXES[thousands + 3] + unit


def joints_by_unit(result: xr.Dataset) -> dict[str, list[str]]:
    """Return the names of the joints by the unit of their positions: rad of hinges, m of slides."""
    names = [str(name) for name in result["joint"].values]
    slides = _slide_joints(result)
    return _group_by_key(("m" if name in slides else "rad", name) for name in names)


def shown_joints(result: xr.Dataset) -> dict[str, tuple[float, str]]:
    """Return the factor and the unit in which figures show the position of each joint, by its name in their order."""
    units = {joint: unit for unit, joints in joints_by_unit(result).items() for joint in joints}
    return {str(name): shown_unit(units[str(name)]) for name in result["joint"].values}


def actuators_by_unit(result: xr.Dataset, group: str) -> dict[str, list[str]]:
    """Return the names of a tree's actuators by the unit of their forces: N m on hinges, N on slides and tendons.

    Args:
        result: Of a hand that is given as a tree.
        group: The table of the actuators, such as ``actuator``.
    """
    tree = read_scene(result.attrs).finger.tree
    return _group_by_key((tree.actuators[name].units(tree.joints)[1], name) for name in map(str, result[group].values))


def _slide_joints(result: xr.Dataset) -> set[str]:
    joints, prefix = read_scene(result.attrs).finger.tree.joints, f"{result.attrs.get(OF_FINGER, '')}."
    return {name.removeprefix(prefix) for name, joint in joints.items() if joint.kind == "slide"}


def _group_by_key(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups
