"""A result as a page that plays it: one HTML text, which loads nothing from elsewhere."""

from __future__ import annotations

import base64
import html
import importlib.util
import json
import os
import zlib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from finger_pin.analysis import ForcePolytope
from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.files import write_text
from finger_pin.mechanism.coerce import FingerLike
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.geometry import LinkPoses
from finger_pin.simulation.frames import read_scene
from finger_pin.simulation.netcdf import require_samples
from finger_pin.typing import Array
from finger_pin.views.viewer.scene import Ghost, Scene
from finger_pin.views.viewer.scene_objects import SceneObjects

Indices = NDArray[np.intp]

#: Frames per second of motion, and most frames of one page: a longer motion gets fewer per second.
FRAME_RATE, MAX_FRAMES = 60.0, 3000
#: Positions out of which the camera's view is found.
_VIEW_POSTURES = 40


def write_animation(
    result: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    forces: ForcePolytope | None = None,
    ghost: xr.Dataset | None = None,
    finger: Finger | None = None,
) -> Path:
    """Write a result as one HTML file that plays it, without a network.

    The file appears whole or not at all; an earlier one is replaced.

    Args:
        result: Dataset that `simulate` returned or saved.
        path: Of the file.
        forces: Drawn at the fingertip of its posture, if given.
        ghost: Another result, whose finger moves faintly beside this one at the same times, if given.
        finger: The finger that moved, if it stands on a model of the user's own (`Finger.from_model`).

    Returns:
        The path of the file.
    """
    write_text(path := Path(path), animation_page(result, forces, ghost, finger))
    return path


def animation_page(
    result: xr.Dataset,
    forces: ForcePolytope | None = None,
    ghost: xr.Dataset | None = None,
    finger: Finger | None = None,
) -> str:
    """Return the page that plays a result, with fingertip forces and a second result if given."""
    motion = Playback.from_result(result, finger=finger)
    stride = slice(None, None, max(1, len(motion.time) // _VIEW_POSTURES))
    palm = motion.palm and LinkPoses(motion.palm.rotation[stride], motion.palm.translation[stride])
    ghost_motion = Playback.from_result(ghost).ghost(motion.time) if ghost is not None else None
    header = motion.scene.header(
        motion.title, motion.position[stride], motion.largest, forces=forces, ghost=ghost_motion, palm=palm
    )
    frames = motion.scene.frames(motion.time, motion.position, motion.tension, motion.palm)
    if ghost_motion is not None:
        frames["ghost"] = ghost_motion.frames()
    if motion.objects is not None:
        header["objects"] = motion.objects.header()
        header["commands"] += motion.objects.commands()
        header["inView"] += np.round(motion.objects.points_in_view() @ motion.scene.view().T, 5).tolist()
        frames |= motion.objects.frames()
    return _render(header, frames)


def posture_page(finger: FingerLike, forces: ForcePolytope, strands: ArrayLike | None = None) -> str:
    """Return the page of a finger at rest in the posture of its fingertip forces.

    Args:
        finger: The finger, its description, its name, or the path of its file.
        forces: Its forces.
        strands: Tensions to show, shape (s,), N; none by default.
    """
    scene = Scene(finger)
    description = scene.geometry.description
    tension = np.zeros((1, len(scene.strands))) if strands is None else np.asarray(strands, dtype=float)[None]
    position = forces.position[None]
    title = description.title or description.name
    header = scene.header(title, position, float(tension.max()), forces=forces)
    return _render(header, scene.frames([0.0], position, tension))


def _render(header: dict[str, Any], frames: dict[str, Array]) -> str:
    """Return the page for the header of a `Scene` and its frames: meshcat's viewer, the player, and the data."""
    columns = [[name, values.dtype.str, values[0].size] for name, values in frames.items()]
    # Points of tendons hardly move from frame to frame: their small differences, point by point, compress well.
    path = frames["path"].reshape(len(frames["path"]), -1)
    frames = frames | {"path": np.diff(path, axis=0, prepend=np.zeros_like(path[:1])).T}
    scene = json.dumps({**header, "columns": columns}, separators=(",", ":"), allow_nan=False)
    return Template(_text("page.html")).substitute(
        title=html.escape(header["title"]),
        style=_text("style.css"),
        script="\n".join(_text(name) for name in ("data.js", "scene.js", "controls.js")),
        meshcat=_meshcat(),
        scene=_packed(scene.encode()),
        frames=_packed(b"".join(values.tobytes() for values in frames.values())),
    )


def _packed(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content)).decode("ascii")


def _text(name: str) -> str:
    return resources.files("finger_pin.views.viewer").joinpath("web", name).read_text(encoding="utf-8")


@cache
def _meshcat() -> str:
    # Found without importing meshcat, which would import IPython and take half a second.
    spec = importlib.util.find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise FingerPinError("the viewer needs the package meshcat, which is not installed")
    return _packed(Path(spec.origin).parent.joinpath("viewer", "dist", "main.min.js").read_bytes())


@dataclass(frozen=True, eq=False)
class Playback:
    """The frames of a film of a result.

    Attributes:
        scene: The finger, prepared for drawing.
        title: Of the scenario or the finger.
        time: Shape (m,), s: samples of the result.
        position: theta, shape (m, n), rad.
        tension: Of every strand, shape (m, s), N.
        palm: Poses of the palm, m of them, if it moves.
        objects: Objects around the finger, if there are any.
    """

    scene: Scene
    title: str
    time: Array
    position: Array
    tension: Array
    palm: LinkPoses | None = None
    objects: SceneObjects | None = None

    @property
    def largest(self) -> float:
        """Largest tension of all, N."""
        return float(self.tension.max(initial=0.0))

    def ghost(self, time: Array) -> Ghost:
        """Return this animation resampled at the frames of another, shape (m,), s, up to its own end."""
        position = np.stack([np.interp(time, self.time, column) for column in self.position.T], axis=-1)
        # The palm of a ghost is shown at rest.
        return Ghost(self.scene, self.title, self.scene.geometry.poses(position))

    @classmethod
    def from_result(cls, result: xr.Dataset, rate: float = FRAME_RATE, finger: Finger | None = None) -> Playback:
        """Choose the frames of a result.

        Args:
            result: Dataset that `simulate` returned or saved.
            rate: Frames per second of motion; fewer where the motion is long or the result has fewer samples.
            finger: The finger that moved, if it stands on a model of the user's own.
        """
        cords = [str(name) for name in result["cord"].values] if "cord_tension" in result else []
        scene = Scene(finger or read_scene(result.attrs).finger, cords)
        require_samples(result)
        time = _read_variable(result, "time")
        frames = _frame_indices(time, rate)
        position = _read_variable(result, "joint_position")[frames]
        tension = _strand_tensions(scene, result, frames)
        for name, values in (("joint_position", position), ("tendon_tension", tension)):
            if not np.isfinite(values).all():
                raise InputError(f"result.{name}", "must be finite")
        title = result.attrs.get("title") or scene.geometry.description.title or scene.geometry.description.name
        palm, stride = _palm(result, frames), slice(None, None, max(1, len(frames) // _VIEW_POSTURES))
        tips = scene.tips(scene.geometry.poses(position[stride])).reshape(-1, 3)
        objects = SceneObjects.from_result(result, time[frames], scene.size, tips.mean(axis=0), palm)
        return cls(scene, title, time[frames], position, tension, palm, objects)


def _strand_tensions(scene: Scene, result: xr.Dataset, frames: Indices) -> Array:
    # The proximal half of a passive tendon has the result's `passive_tension_proximal`.
    description = scene.geometry.description
    tension = _read_variable(result, "tendon_tension")[frames]
    actuated, passive = len(description.actuated_names), len(description.passive_names)
    if passive:
        proximal = _read_variable(result, "passive_tension_proximal")[frames].reshape(len(frames), passive)
        halves = np.stack([proximal, tension[:, actuated:]], axis=-1).reshape(len(frames), 2 * passive)
        tension = np.concatenate([tension[:, :actuated], halves], axis=1)
    if "cord_tension" in result:
        tension = np.concatenate([tension, _read_variable(result, "cord_tension")[frames]], axis=1)
    return tension


def _palm(result: xr.Dataset, frames: Indices) -> LinkPoses | None:
    if "palm_position" not in result:
        return None
    quaternions = _read_variable(result, "palm_orientation")[frames]
    return LinkPoses(Rotation.from_quat(quaternions).as_matrix(), _read_variable(result, "palm_position")[frames])


def _frame_indices(time: Array, rate: float) -> Indices:
    # Frames are samples, without interpolation.
    count = int(np.clip(round((time[-1] - time[0]) * rate) + 1, 2, MAX_FRAMES))
    return np.unique(np.searchsorted((time[1:] + time[:-1]) / 2.0, np.linspace(time[0], time[-1], count)))


def _read_variable(result: xr.Dataset, name: str) -> Array:
    if name not in result:
        raise InputError(f"result.{name}", "is missing; give a result of simulate")
    return np.asarray(result[name], dtype=float)
