"""Units of joints and of what drives them, which differ from joint to joint in a hand that is given as a tree."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import xarray as xr

from finger_pin.description.scene_metadata import read_scene


def joints_by_unit(result: xr.Dataset) -> dict[str, list[str]]:
    """Return the names of the joints by the unit of their positions: rad of hinges, m of slides."""
    names = [str(name) for name in result["joint"].values]
    slides = _slides(result)
    return _grouped(("m" if name in slides else "rad", name) for name in names)


def actuators_by_unit(result: xr.Dataset, group: str) -> dict[str, list[str]]:
    """Return the names of a tree's actuators by the unit of their forces: N m on hinges, N on slides and tendons.

    Args:
        result: Of a hand that is given as a tree.
        group: The table of the actuators, such as ``actuator``.
    """
    tree, slides = read_scene(result.attrs).finger.tree, _slides(result)
    assert tree is not None

    def units() -> Iterator[tuple[str, str]]:
        for name in map(str, result[group].values):
            joint = tree.actuators[name].joint
            yield ("N" if joint is None or joint in slides else "N m"), name

    return _grouped(units())


def _slides(result: xr.Dataset) -> set[str]:
    tree = read_scene(result.attrs).finger.tree
    return set() if tree is None else {name for name, joint in tree.joints.items() if joint.kind == "slide"}


def _grouped(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for key, value in pairs:
        found.setdefault(key, []).append(value)
    return found
