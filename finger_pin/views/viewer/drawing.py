"""Animation of a result in the user's meshcat.Visualizer."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.mechanism.geometry import LinkPoses
from finger_pin.typing import Array
from finger_pin.views.viewer.animation import Playback
from finger_pin.views.viewer.scene import Scene
from finger_pin.views.viewer.solids import (
    FORCE_COLOUR,
    ROOT,
    Command,
    link_names,
    link_solids,
    pose_command,
    set_object,
    strand_colours,
    tension_scale,
)

if TYPE_CHECKING:
    import meshcat

# Sides of the tube of a tendon.
_SIDES = 8


def draw(visualizer: meshcat.Visualizer, result: xr.Dataset, *, speed: float = 1.0, rate: float = 30.0) -> None:
    """Play a result in a ``meshcat.Visualizer``, in real time, and leave the finger in its last posture.

    Nothing but the finger and the objects around it is touched: they stand below the visualizer's path in
    ``finger_pin``, in its base frame. To move it, set the transform of a path and draw there:
    ``draw(visualizer["left"], result)``.

    Args:
        visualizer: The user's own.
        result: Dataset that `simulate` returned or saved.
        speed: Simulated seconds per second; infinite for the last posture at once.
        rate: Most frames per second.
    """
    for name, value in (("speed", speed), ("rate", rate)):
        if not value > 0.0:
            raise InputError(name, "must be above 0", value)
    motion = Playback.from_result(result, rate / speed)
    root = visualizer.path.lower()
    scene, radius, scale = motion.scene, motion.scene.tube_radius, tension_scale(motion.largest)
    objects = motion.objects
    solids = [solid.command() for solid in link_solids(scene.geometry, radius)]
    for command in (*solids, *(objects.commands() if objects else ())):
        _send(visualizer, {**command, "path": root + command["path"]})
    start_time, last = time.monotonic(), len(motion.time) - 1
    for index, frame_time in enumerate((motion.time - motion.time[0]) / speed):
        delay = start_time + frame_time - time.monotonic()
        # A frame that is late by more than a frame is skipped, except the last.
        if delay < -1.0 / rate and index < last:
            continue
        time.sleep(max(0.0, delay))
        palm = motion.palm and LinkPoses(motion.palm.rotation[index], motion.palm.translation[index])
        commands = _frame(scene, motion.position[index], motion.tension[index], scale, palm)
        if objects:
            arrows = enumerate(objects.arrows()[index])
            commands += [
                *objects.frame(index),
                *(_tube(f"contact{c}", ends, radius, FORCE_COLOUR) for c, ends in arrows),
            ]
        for command in commands:
            _send(visualizer, {**command, "path": root + command["path"]})


def _frame(scene: Scene, position: Array, tension: Array, scale: float, palm: LinkPoses | None) -> list[Command]:
    geometry = scene.geometry
    poses = geometry.poses(position, palm)
    commands = [*map(pose_command, link_names(geometry), poses.rotation, poses.translation)]
    colours = strand_colours(tension, scale)
    for path, tendon in zip(geometry.paths(position, scene.looseness(tension), poses), scene.tendons, strict=True):
        commands.append(_tube(path.name, path.points, scene.tube_radius, colours[tendon["strand"]]))
    return commands


def _tube(name: str, points: Array, radius: float, colours: Array) -> Command:
    """Return a tube along points, shape (p, 3), in a colour at each of them, shape (p, 3)."""
    from meshcat.geometry import pack_numpy_array

    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    normals = np.empty_like(points)
    normal_vector = np.array([0.31, 1.0, 0.17])
    for index, direction in enumerate(tangent):
        normal_vector = normal_vector - (normal_vector @ direction) * direction
        normal_vector /= np.linalg.norm(normal_vector)
        normals[index] = normal_vector
    angle = 2.0 * np.pi * np.arange(_SIDES)[:, None] / _SIDES
    normal = np.cos(angle) * normals[:, None] + np.sin(angle) * np.cross(tangent, normals)[:, None]
    ring, side = (each.ravel() for each in np.meshgrid(np.arange(len(points) - 1), np.arange(_SIDES), indexing="ij"))
    first, second = ring * _SIDES + side, ring * _SIDES + (side + 1) % _SIDES
    faces = np.stack([first, second, first + _SIDES, second, second + _SIDES, first + _SIDES], axis=-1).reshape(-1, 3)
    buffers = {
        "position": points[:, None] + radius * normal,
        "normal": normal,
        "color": np.repeat(colours[:, None], _SIDES, axis=1),
    }
    attributes = {name: pack_numpy_array(each.reshape(-1, 3).T.astype(np.float32)) for name, each in buffers.items()}
    index = pack_numpy_array(faces.T.astype(np.uint32))
    shape = {"type": "BufferGeometry", "data": {"attributes": attributes, "index": index}}
    material = {"type": "MeshPhongMaterial", "vertexColors": True, "shininess": 40}
    return set_object(f"{ROOT}/tendons/{name}", "Mesh", shape, material)


@dataclass(frozen=True)
class _LoweredCommand:
    """A command in the form in which meshcat sends it."""

    command: Command

    def lower(self) -> Command:
        return self.command


def _send(visualizer: Any, command: Command) -> None:
    visualizer.window.send(_LoweredCommand(command))
