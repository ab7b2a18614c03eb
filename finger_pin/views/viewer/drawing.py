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
from finger_pin.views.viewer.meshcat_solids import ROOT, Command, link_names, pose_matrix, set_object, solid_commands
from finger_pin.views.viewer.scene import SLACK_TENSION, Scene, tension_scale

if TYPE_CHECKING:
    import meshcat

# Sides of the tube of a tendon.
_SIDES = 8
_SLACK_COLOUR = (0.62, 0.64, 0.67)
# Of a cord without a known tension, which no tension has.
_CORD_COLOUR = (0.93, 0.9, 0.82)
#: Of the arrow of a contact's force, at both ends: that of the page, which no tension has.
FORCE_COLOUR = np.tile(np.array([0xFF, 0x5A, 0x5A]) / 255.0, (2, 1))


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
    for command in (*solid_commands(scene.geometry, radius), *(objects.commands() if objects else ())):
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


def tension_colours(tension: Array, scale: float) -> Array:
    """Return the colour of tensions, shape (..., 3): the upper part of viridis up to a scale, N; grey when loose."""
    from matplotlib import colormaps

    taut = colormaps["viridis"](0.25 + 0.75 * np.clip(tension / scale, 0.0, 1.0))[..., :3]
    looseness = np.clip(1.0 - tension / SLACK_TENSION, 0.0, 1.0)[..., None]
    return np.asarray(taut + looseness * (np.array(_SLACK_COLOUR) - taut))


def strand_colours(tension: Array, scale: float) -> Array:
    """Return the colours of strands, shape (s + 1, 3), the last of which is that of cords without a known tension.

    Args:
        tension: Shape (s,), N.
        scale: As for `tension_colours`.
    """
    return np.concatenate([tension_colours(tension, scale), [_CORD_COLOUR]])


def _frame(scene: Scene, position: Array, tension: Array, scale: float, palm: LinkPoses | None) -> list[Command]:
    geometry = scene.geometry
    poses = geometry.poses(position, palm)
    commands = [_placement(name, poses, index) for index, name in enumerate(link_names(geometry))]
    colours = strand_colours(tension, scale)
    for path, tendon in zip(geometry.paths(position, scene.looseness(tension), poses), scene.tendons, strict=True):
        commands.append(_tube(path.name, path.points, scene.tube_radius, colours[tendon["strand"]]))
    return commands


def _placement(name: str, poses: LinkPoses, index: int) -> Command:
    matrix = pose_matrix(poses.rotation[index], poses.translation[index])
    return {"type": "set_transform", "path": f"{ROOT}/{name}", "matrix": matrix}


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
