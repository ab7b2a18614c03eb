"""Keyframes of a MuJoCo model as postures of a tree, or its reference without any."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.exchange.mujoco_actuators import ActuatorReader
from finger_pin.exchange.mujoco_free import FreeBodies
from finger_pin.exchange.mujoco_names import Table, distinct
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

# What free bodies and activations may differ by without a word, m or 1.
_SAME = 1e-9


def read_keyframes(read: ElementReader, actuators: ActuatorReader, free: FreeBodies, joints: list[int]) -> Table:
    """Return positions, speeds and inputs of all keyframes by name; of a model without any its reference at rest."""
    model, data, found = read.model, read.start_data(), []
    names = distinct("keyframe", [model.key(k).name for k in range(model.nkey)]) or ["reference"]
    for k, name in enumerate(names):
        given = (model.key_qpos[k], model.key_qvel[k], model.key_ctrl[k], model.key_act[k]) if model.nkey else None
        qpos, qvel, ctrl, act = given or (data.qpos, data.qvel, data.ctrl, data.act)
        position = {read.names.joints[i]: float(qpos[model.jnt_qposadr[i]]) for i in joints}
        velocity = {read.names.joints[i]: float(qvel[model.jnt_dofadr[i]]) for i in joints}
        for i in free.kept:
            position |= free.position(i, qpos)
        moving = {key: speed for key, speed in velocity.items() if speed}
        found.append({"position": position, "velocity": moving, "inputs": actuators.inputs(ctrl)})
        _list_rest(read, free, name, k, act)
    return dict(zip(names, found, strict=True))


def _list_rest(read: ElementReader, free: FreeBodies, name: str, k: int, act: Array) -> None:
    """List what a keyframe says besides: activations, speeds of free bodies in the tree, and where others lie."""
    model = read.model
    if np.any(np.abs(act) > _SAME):
        read.rest.add(f"keyframe {name}: activations of its actuators, which start at zero")
    if not model.nkey:
        return
    if any(np.any(model.key_qvel[k][_span(model, i, 6)]) for i in free.kept):
        read.rest.add(f"keyframe {name}: speeds of free bodies that tendons or loops hold")
    for body in free.loose if k else ():
        joint = int(model.body_jntadr[body])
        moved = np.any(np.abs(model.key_qpos[k] - model.key_qpos[0])[_span(model, joint, 7)] > _SAME)
        if moved or np.any(np.abs(model.key_qvel[k] - model.key_qvel[0])[_span(model, joint, 6)] > _SAME):
            read.rest.add(f"keyframe {name}: free body {read.names.bodies[body]} starts as in the first keyframe")


def _span(model: Any, joint: int, size: int) -> slice:
    """Return the places of a free joint in qpos, of which it has 7 numbers, or qvel, 6."""
    first = int((model.jnt_qposadr if size == 7 else model.jnt_dofadr)[joint])
    return slice(first, first + size)
