"""Selections of tendons and joints: names with stars, keys of the descriptions, checked as these are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Annotated, Any

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings
from finger_pin.description.parameters import per_item
from finger_pin.description.validation import Description, quantity, real, suggestion, validate
from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_friction import check_friction


class RoutedFriction(TendonFrictionSettings):
    """Law (9) for a tendon, and the turn of its path."""

    curvature_offset: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="rad", source="(15)", doc="phi_off, the turn that the model does not show."
    )
    bends: tuple[str, ...] | None = quantity(
        None, unit="1", source="(15)", doc="Of a fixed tendon, the joints whose angle bends its path; all if left out."
    )


def match_names(
    patterns: Mapping[str, Mapping[str, Any]] | None, names: list[str], entry: str, kind: type[Description]
) -> dict[str, tuple[Any, bool]]:
    """Return the checked keys of every name that matches, and whether it was written without stars."""
    tables: dict[str, dict[str, Any]] = {}
    explicit = set()
    if not isinstance(patterns or {}, Mapping):
        raise InputError(entry, "must be a table of names, with keys for each", patterns)
    for pattern, keys in (patterns or {}).items():
        if not isinstance(keys, Mapping):
            raise InputError(f"{entry}.{pattern}", "must be a table of keys", keys)
        matching = [name for name in names if fnmatchcase(name, pattern)]
        if not matching:
            hint = suggestion(pattern, names)
            raise InputError(f"{entry}.{pattern}", f"matches none of {', '.join(names) or 'no names'}{hint}")
        for key, value in validate(kind, dict(keys), (entry, pattern)):
            if key in ("law", "reversal_speed") and key in keys and value != "lugre":
                raise InputError(
                    f"{entry}.{pattern}.{key}", 'is for our own step: in MuJoCo\'s there is "lugre"', value
                )
            if key == "drag_asymmetry" and value:
                allowed = "must be 0: friction in the step of MuJoCo is alike in both directions"
                raise InputError(f"{entry}.{pattern}.{key}", allowed, value)
            if isinstance(value, tuple) and key != "bends":
                raise InputError(f"{entry}.{pattern}.{key}", "must be one number", list(value))
        for name in matching:
            tables[name] = tables.get(name, {}) | dict(keys)
        explicit |= {pattern} & set(matching)
    return {name: (validate(kind, keys, (entry, name)), name in explicit) for name, keys in tables.items()}


def friction_keys(description: FingerDescription) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]:
    """Return the keys with which the tendons and joints of a tree rub as the description says, by name.

    They are for the model that `to_mjcf` writes, which has viscous friction of joints and the loss of tendons already.
    """
    tendon_settings, joint_settings = description.tendon_friction, description.joint_friction
    check_friction(description, tendon_settings.place != "canal")
    written_names = {name: each.along or name for name, each in description.tendons.items()}
    written_names |= {name: name for name in description.canals}
    tendons = {}
    for index, (name, written) in enumerate(written_names.items()):
        cord = description.cord(name)
        keys = _values_at(tendon_settings, index, len(written_names)) | {"curvature_offset": cord.offset}
        if not cord.through_space:
            turns = {element.name: element.turn for element in cord.elements if element.turn}
            if set(turns.values()) - {1.0}:
                allowed = "must be 1 rad per rad in MuJoCo; or leave out friction"
                raise InputError(f"{description.entry('tendons', name)}: turn over its joints", allowed, turns)
            keys |= {"bends": tuple(turns)}
        loss = description.tree.tendons[written].friction if written in description.tree.tendons else 0.0
        tendons[written] = keys | {"drag": max(keys["drag"] - loss, 0.0)}
    bearings = dict(zip(description.joints, description.bearings, strict=True))
    joints = {
        name: _values_at(joint_settings, index, len(bearings)) | {"viscous": 0.0}
        for index, (name, rubs) in enumerate(bearings.items())
        if rubs
    }
    return tendons, joints


def _values_at(settings: TendonFrictionSettings | JointFrictionSettings, index: int, count: int) -> dict[str, Any]:
    """Return the numbers of one of several tendons or joints."""
    # In a hand some fingers may have no stiffness.
    numbers = {key: float(values[index]) for key, values in per_item(settings, count).items()}
    return {key: value for key, value in numbers.items() if key != "reversal_speed" and not math.isnan(value)}
