"""The finger in viser: the viewer's scene, moved to every state that is played."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import viser

from finger_pin.control import PalmPath
from finger_pin.description.primitives import Geometry
from finger_pin.mechanism.geometry import LinkPoses
from finger_pin.playground.session import Reading, Session
from finger_pin.typing import Array
from finger_pin.views.viewer.scene import Scene
from finger_pin.views.viewer.scene_objects import SceneObjects
from finger_pin.views.viewer.solids import (
    ARROW_LENGTH,
    CAMERA_DIRECTION,
    FORCE_COLOUR,
    ROOT,
    Solid,
    link_names,
    link_solids,
    newton_length,
    strand_colours,
    tension_scale,
)

# Of the cross to drag the tip, in parts of the finger's length.
_CROSS_SIZE = 0.16
# Largest force that an arrow shows in full length, N; tension that the colours reach at first, N.
_LARGE_FORCE, _SCALE = 5.0, 4.0
# The camera, from the middle of what it sees, and how far away, in parts of its extent.
_CAMERA_DISTANCE, _CAMERA_SHIFT = 1.5, 0.16
# Instants of the scenario's own motion that are in view.
_VIEW_SAMPLES = 25
# Largest opacity to which links are raised from that of the viewer's page, whose ground is brighter.
_MAX_OPACITY = 0.42
# Share that is left after a frame of the largest tension, to which the colours reach.
_PEAK_DECAY = 0.995
_SPRING_COLOUR = (255, 134, 180)
_NO_LINES = np.zeros((0, 2, 3))
# What adds a geometry to a viser scene, and its arguments.
_METHODS: dict[str, tuple[str, Callable[[Geometry], dict[str, Any]]]] = {
    "box": ("add_box", lambda shape: {"dimensions": shape.scale}),
    "cylinder": ("add_cylinder", lambda shape: {"radius": shape.scale[0], "height": shape.scale[2]}),
    "ball": ("add_icosphere", lambda shape: {"scale": shape.scale}),
    "mesh": ("add_mesh_simple", lambda shape: {"vertices": shape.corners, "faces": shape.faces}),
}


class Stage:
    """A session's finger and its objects in a viser scene.

    Attributes:
        scene: The finger, prepared for drawing.
        scale: Tension at the upper end of the colours, N.
        crosses: A control for every fingertip, which the mouse drags.
    """

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        """Draw all bodies."""
        self.scene, self._session, self._peak = (Scene(session.finger, session.finger.cord_names), session, _SCALE)
        self.scale = _SCALE
        self._viser, self._turn = server.scene, self.scene.view()
        self._viser.set_up_direction("+z")
        self._palm = PalmPath.from_hand(session.scenario.hand, 0.0, session.finger)
        geometry, self._by_name = self.scene.geometry, dict(session.scenario.environment.objects or {})
        self._root = self._viser.add_frame(ROOT, show_axes=False)
        self._links = [self._viser.add_frame(f"{ROOT}/{name}", show_axes=False) for name in link_names(geometry)]
        for solid in link_solids(geometry, self.scene.tube_radius):
            self._add_solid(f"{ROOT}/{solid.frame}/{solid.name}", solid)
        tips = self.scene.tips(geometry.poses(session.simulator.state.position))
        self._objects = self._add_objects(tips.mean(axis=0))
        self._strands = [tendon["strand"] for tendon in self.scene.tendons]
        width = 2.0 * self.scene.tube_radius
        self._taut_lines, self._slack_lines = (
            self._viser.add_line_segments(f"{ROOT}/{name}", _NO_LINES, (200, 200, 200), thickness=line_width)
            for name, line_width in (("taut", width), ("slack", 0.45 * width))
        )
        self._force_scale = newton_length(ARROW_LENGTH * self.scene.size, _LARGE_FORCE)
        arrow_radius = 0.6 * self.scene.tube_radius
        self._contacts = self._viser.add_arrows(
            f"{ROOT}/contacts",
            _NO_LINES,
            np.array(255.0 * FORCE_COLOUR[0], dtype=np.uint8),
            shaft_radius=arrow_radius,
            head_radius=2.5 * arrow_radius,
            head_length=6.0 * arrow_radius,
        )
        self._springs = self._viser.add_line_segments(
            f"{ROOT}/springs", _NO_LINES, _SPRING_COLOUR, thickness=0.5 * width
        )
        self.crosses = [
            self._viser.add_transform_controls(
                f"{ROOT}/tip{index}",
                _CROSS_SIZE * self.scene.size,
                disable_rotations=True,
                depth_test=False,
                position=tip,
                visible=False,
            )
            for index, tip in enumerate(tips)
        ]
        self._set_camera(server)

    def _add_solid(self, path: str, solid: Solid) -> None:
        """Add a solid of the viewer's scene."""
        options: dict[str, Any] = {
            "color": tuple(round(255 * component) for component in solid.colour),
            "opacity": max(solid.opacity, min(_MAX_OPACITY, 1.5 * solid.opacity)),
            "flat_shading": solid.geometry.kind in ("box", "mesh"),
            "position": solid.translation,
            "wxyz": _wxyz(solid.rotation),
            "cast_shadow": False,
            "receive_shadow": False,
        }
        method, arguments = _METHODS[solid.geometry.kind]
        getattr(self._viser, method)(path, **arguments(solid.geometry), **options)

    def _add_objects(self, middle: Array) -> list[Any]:
        """Draw the objects around the finger; return the frames of the free ones."""
        scene = self._session.finger.scene
        if scene is None:
            return []
        by_name = self._by_name
        free, contacts = tuple(scene.free), np.zeros((1, 0, 9))
        drawn = SceneObjects(by_name, free, np.zeros((1, 0, 7)), contacts, np.zeros(0), self.scene.size, middle)
        frames = {name: self._viser.add_frame(self._path(name), show_axes=False) for name in by_name}
        for name, frame in frames.items():
            turn, pose = self._turn if self._is_in_world(name) else np.eye(3), by_name[name].pose
            frame.position = turn @ pose[:3]
            frame.wxyz = _wxyz(turn @ pin.Quaternion(pose[3:]).toRotationMatrix())
            for solid in drawn.solids(name):
                self._add_solid(f"{self._path(name)}/{solid.name}", solid)
        return [frames[name] for name in free]

    def _is_in_world(self, name: str) -> bool:
        """Return whether an object is placed in the world, not on the palm."""
        return self._by_name[name].frame == "world"

    def _path(self, name: str) -> str:
        return f"/world/{name}" if self._is_in_world(name) else f"{ROOT}/object_{name}"

    def _set_camera(self, server: viser.ViserServer) -> None:
        """Point the camera at the finger."""
        times = np.linspace(0.0, self._session.scenario.simulation.duration, _VIEW_SAMPLES)
        header = self.scene.header("", self._session.postures(times), self.scale, palm=self._palm_poses(times))
        points = np.array(header["inView"])
        low, high = points.min(axis=0), points.max(axis=0)
        middle, extent = 0.5 * (low + high), float(np.linalg.norm(high - low))
        direction = CAMERA_DIRECTION / np.linalg.norm(CAMERA_DIRECTION)
        right = np.cross([0.0, 0.0, 1.0], CAMERA_DIRECTION)
        camera = server.initial_camera
        camera.near, camera.far, camera.fov = 0.02 * extent, 50.0 * extent, 0.8
        # The controls stand at the right.
        camera.look_at = middle + _CAMERA_SHIFT * extent * right
        camera.position = camera.look_at + _CAMERA_DISTANCE * extent * direction

        @server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            if client.camera.aspect < 1.0:
                # On a phone they stand below.
                distance = _CAMERA_DISTANCE * extent / client.camera.aspect**0.85
                target = middle - [0.0, 0.0, 0.25 * distance]
                # Moving a viser camera also moves its target, which is therefore set last.
                client.camera.position = target + distance * direction
                client.camera.look_at = target

        floor = (middle[0], middle[1], low[2] - header["margin"])
        cell = float(header["grid"])
        side = 10.0 * cell * np.ceil(1.5 * extent / (10.0 * cell))
        self._viser.add_grid(
            "/grid",
            side,
            side,
            cell_size=cell,
            section_size=5.0 * cell,
            position=floor,
            cell_color=(48, 54, 62),
            section_color=(70, 78, 90),
        )

    def _palm_poses(self, times: Array) -> LinkPoses | None:
        """Return the poses of a palm that moves at times (m,), s."""
        if self._palm is None:
            return None
        place, rotation = self._palm.place(times)
        return LinkPoses(rotation, place)

    def show(self, reading: Reading) -> None:
        """Move all bodies and tendons to a state."""
        geometry = self.scene.geometry
        root, palm = self._turn, self._palm_poses(np.array([reading.time]))
        poses = geometry.poses(reading.position)
        for frame, rotation, place in zip(self._links, poses.rotation, poses.translation, strict=True):
            frame.wxyz, frame.position = _wxyz(rotation), place
        if palm is not None:
            root = root @ palm.rotation[0]
        self._root.wxyz = _wxyz(root)
        self._root.position = np.zeros(3) if palm is None else self._turn @ palm.translation[0]
        for frame, pose in zip(self._objects, reading.objects, strict=True):
            frame.position, frame.wxyz = pose[:3], pose[[6, 3, 4, 5]]
        self._show_tendons(reading, poses)
        self._show_forces(reading, poses)

    def _show_tendons(self, reading: Reading, poses: LinkPoses) -> None:
        scene = self.scene
        self._peak = max(_SCALE, _PEAK_DECAY * self._peak, float(reading.strands.max(initial=0.0)))
        self.scale = tension_scale(self._peak)
        looseness = scene.looseness(reading.strands)
        paths = scene.geometry.paths(reading.position, looseness, poses)
        # Line colours are linear light intensities, screen colours are not.
        colours = (255.0 * strand_colours(reading.strands, self.scale) ** 2.2).astype(np.uint8)
        lines: tuple[list[Array], list[Array]] = ([], [])
        shades: tuple[list[Array], list[Array]] = ([], [])
        for path, strands, slack in zip(paths, self._strands, looseness, strict=True):
            index = int(slack > 0.5)
            lines[index].append(np.stack([path.points[:-1], path.points[1:]], axis=1))
            shade = colours[strands]
            shades[index].append(np.stack([shade[:-1], shade[1:]], axis=1))
        for handle, points, shade in zip((self._taut_lines, self._slack_lines), lines, shades, strict=True):
            handle.points = np.concatenate([_NO_LINES, *points]).astype(np.float32)
            handle.colors = np.concatenate([_NO_LINES.astype(np.uint8), *shade])

    def _show_forces(self, reading: Reading, poses: LinkPoses) -> None:
        session, springs = self._session, []
        tips = self.scene.tips(poses)
        for cross, handle, tip in zip(self.crosses, session.handles, tips, strict=True):
            if handle is not None:
                springs.append([tip, handle])
            elif cross.visible:
                cross.position = tip
        self._springs.points = np.reshape(np.array(springs, dtype=np.float32), (-1, 2, 3))
        self._springs.colors = np.tile(np.array(_SPRING_COLOUR, dtype=np.uint8), (len(springs), 2, 1))
        if reading.contacts is not None:
            closed = np.any(reading.contacts.force != 0.0, axis=-1)
            points, force = reading.contacts.point[closed], reading.contacts.force[closed]
            self._contacts.points = np.stack([points, points + self._force_scale * force], axis=1).astype(np.float32)


def _wxyz(rotation: Array) -> Array:
    return np.asarray(pin.Quaternion(rotation).coeffs()[[3, 0, 1, 2]])
