"""Keyframes of a MuJoCo model as postures of a tree, or its reference without any."""

from __future__ import annotations

import numpy as np

from finger_pin.exchange.mujoco_actuators import ActuatorReader
from finger_pin.exchange.mujoco_free import FreeBodies, MocapBodies
from finger_pin.exchange.mujoco_names import Table, distinct
from finger_pin.exchange.mujoco_shapes import Shapes
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

# Greatest activation that counts as zero.
_LEAST_ACTIVATION = 1e-9


def read_keyframes(
    reader: ElementReader,
    actuators: ActuatorReader,
    free: FreeBodies,
    mocap: MocapBodies,
    shapes: Shapes,
    joints: list[int],
) -> Table:
    """Return positions, speeds and inputs of all keyframes by name; of a model without any its reference at rest.

    What lies beyond a range is at its edge, and listed, where no equality could forbid it.
    Free bodies that are objects are where the first keyframe has them, unless a later one says otherwise.
    """
    model, data, keyframes = reader.model, reader.start_data(), []
    names = distinct("keyframe", [model.key(k).name for k in range(model.nkey)]) or ["reference"]
    for k, name in enumerate(names):
        keyframe = (model.key_qpos[k], model.key_qvel[k], model.key_ctrl[k], model.key_act[k]) if model.nkey else None
        theirs, qvel, ctrl, act = keyframe or (model.qpos0, data.qvel, data.ctrl, data.act)
        qpos = reader.at_edges(theirs)
        for i in joints:
            at = model.jnt_qposadr[i]
            if qpos[at] != theirs[at]:
                line = f"its {theirs[at]:g} for joint {reader.names.joints[i]}, beyond the range, is {qpos[at]:g} here"
                reader.left_out.add(f"keyframe {name}: {line}", moves=False)
        position = {reader.names.joints[i]: float(qpos[model.jnt_qposadr[i]]) for i in joints}
        velocity = {reader.names.joints[i]: float(qvel[model.jnt_dofadr[i]]) for i in joints}
        for i in free.converted:
            position |= free.position(i, qpos)
            velocity |= free.velocity(i, qpos, qvel)
        position |= mocap.position(k)
        moving = {key: speed for key, speed in velocity.items() if speed}
        inputs, moved = actuators.inputs(ctrl), shapes.object_states(k)
        keyframes.append(
            {"position": position, "velocity": moving, "inputs": inputs, **({"objects": moved} if moved else {})}
        )
        _list_left_out(reader, mocap, name, k, act)
    return dict(zip(names, keyframes, strict=True))


def _list_left_out(reader: ElementReader, mocap: MocapBodies, name: str, k: int, act: Array) -> None:
    """List what of a keyframe is left out: activations, and places of mocap bodies that stand still."""
    model = reader.model
    for body in mocap.fixed if k else ():
        index = int(model.body_mocapid[body])
        if any(
            np.any(np.diff(keys.reshape(model.nkey, -1, size)[[0, k], index], axis=0))
            for keys, size in ((model.key_mpos, 3), (model.key_mquat, 4))
        ):
            line = f"place of mocap body {reader.names.bodies[body]}, which is where the first keyframe has it"
            reader.left_out.add(f"keyframe {name}: {line}")
    if np.any(np.abs(act) > _LEAST_ACTIVATION):
        reader.left_out.add(f"keyframe {name}: activations of its actuators, which start at zero")
