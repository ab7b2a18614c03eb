"""Keyframes of a MuJoCo model as postures of a tree, or its reference without any."""

from __future__ import annotations

import numpy as np

from finger_pin.exchange.mujoco_actuators import ActuatorReader
from finger_pin.exchange.mujoco_free import FreeBodies, LedBodies
from finger_pin.exchange.mujoco_names import Table, distinct
from finger_pin.exchange.mujoco_shapes import Shapes
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

# Activations that are no larger are none.
_SAME = 1e-9


def read_keyframes(
    read: ElementReader, actuators: ActuatorReader, free: FreeBodies, led: LedBodies, shapes: Shapes, joints: list[int]
) -> Table:
    """Return positions, speeds and inputs of all keyframes by name; of a model without any its reference at rest.

    Free bodies that are objects are where the first keyframe has them, unless a later one says otherwise.
    """
    model, data, keyframes = read.model, read.start_data(), []
    names = distinct("keyframe", [model.key(k).name for k in range(model.nkey)]) or ["reference"]
    for k, name in enumerate(names):
        recorded = (model.key_qpos[k], model.key_qvel[k], model.key_ctrl[k], model.key_act[k]) if model.nkey else None
        qpos, qvel, ctrl, act = recorded or (data.qpos, data.qvel, data.ctrl, data.act)
        position = {read.names.joints[i]: float(qpos[model.jnt_qposadr[i]]) for i in joints}
        velocity = {read.names.joints[i]: float(qvel[model.jnt_dofadr[i]]) for i in joints}
        for i in free.kept:
            position |= free.position(i, qpos)
            velocity |= free.velocity(i, qpos, qvel)
        position |= led.position(k)
        moving = {key: speed for key, speed in velocity.items() if speed}
        inputs, moved = actuators.inputs(ctrl), shapes.object_states(k)
        keyframes.append(
            {"position": position, "velocity": moving, "inputs": inputs, **({"objects": moved} if moved else {})}
        )
        _list_rest(read, led, name, k, act)
    return dict(zip(names, keyframes, strict=True))


def _list_rest(read: ElementReader, led: LedBodies, name: str, k: int, act: Array) -> None:
    """List what of a keyframe is left out: activations, and places of mocap bodies that stand still."""
    model = read.model
    for body in led.still if k else ():
        at = int(model.body_mocapid[body])
        if any(
            np.any(np.diff(keys.reshape(model.nkey, -1, size)[[0, k], at], axis=0))
            for keys, size in ((model.key_mpos, 3), (model.key_mquat, 4))
        ):
            line = f"place of mocap body {read.names.bodies[body]}, which is where the first keyframe has it"
            read.rest.add(f"keyframe {name}: {line}")
    if np.any(np.abs(act) > _SAME):
        read.rest.add(f"keyframe {name}: activations of its actuators, which start at zero")
