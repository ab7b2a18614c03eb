"""Tendons on some joints of any Pinocchio model, for example a whole hand: the rigid body that they act on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.mechanism.rigid_body import RigidBody


def on_model(
    description: FingerDescription,
    model: pin.Model,
    joints: Mapping[str, str] | Mapping[str, Mapping[str, str]],
    tip_frame: str | Mapping[str, str],
    configuration: Array | None,
    base_axis: Sequence[float] | Mapping[str, Sequence[float]],
    visuals: pin.GeometryModel | None,
) -> tuple[RigidBody, pin.GeometryModel]:
    """Return rigid body and solids of a finger on a model whose other joints are locked.

    Arguments and errors are those of `Finger.from_model`.
    """
    fingers = ("",) if description.hand is None else tuple(description.hand.fingers)
    named = _by_joint(joints)
    tips, axes = (
        _by_finger(each, fingers, what) for each, what in ((tip_frame, "tip_frame"), (base_axis, "base_axis"))
    )
    for name in description.joints:
        if name not in named:
            raise InputError(f"joints.{name}", "is missing: name the model's joint")
    chosen = [named[name] for name in description.joints]
    for name, wanted in named.items():
        if name not in description.joints or not model.existJointName(wanted):
            raise InputError(f"joints.{name}", "no such joint in the description or the model", wanted)
    indices = [int(model.getJointId(name)) for name in chosen]
    if indices != sorted(set(indices)):
        raise InputError("joints", "must follow the model's order, each joint once", chosen)
    locked = [index for index in range(1, model.njoints) if index not in indices]
    posture = pin.neutral(model) if configuration is None else np.asarray(configuration, dtype=float)
    if posture.shape != (model.nq,):
        raise InputError("configuration", f"must be {model.nq} numbers, one per coordinate of the model", posture)
    solids = pin.GeometryModel() if visuals is None else visuals
    reduced, shown = pin.buildReducedModel(model, solids, locked, posture)
    reduced.gravity.linear[:] = description.gravity
    body = RigidBody(reduced, tips)
    for index, name in enumerate(description.joints, start=1):
        if body.carriers[index] == 0:
            own = fingers.index(name.split(".")[0]) if len(fingers) > 1 or fingers[0] else 0
            body.proximal_axes[index] = np.asarray(axes[own], dtype=float)
    return body, shown


def _by_joint(joints: Mapping[str, str] | Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return names of a model's joints by those of a description, which have dots in a hand."""
    found: dict[str, str] = {}
    for name, given in joints.items():
        found |= {name: given} if isinstance(given, str) else {f"{name}.{own}": each for own, each in given.items()}
    return found


def _by_finger(given: Any, fingers: tuple[str, ...], entry: str) -> list[Any]:
    """Return one item for each finger, of one for all or of a table by finger."""
    if not isinstance(given, Mapping):
        if entry == "tip_frame" and len(fingers) > 1:
            raise InputError(entry, f"must be a table with a frame for each of {', '.join(fingers)}", given)
        return [given] * len(fingers)
    for name in fingers:
        if name not in given:
            raise InputError(f"{entry}.{name}", f"is missing: there must be one for each of {', '.join(fingers)}")
    return [given[name] for name in fingers]
