"""Data of the page: once the scene, then frames of poses, tendon paths and tensions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from finger_pin.analysis import ForcePolytope
from finger_pin.mechanism.coerce import FingerLike, description_of
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.geometry import LinkPoses, TendonGeometry, Visual, joint_axes
from finger_pin.typing import Array
from finger_pin.views.viewer.scene_objects import ForceSet
from finger_pin.views.viewer.solids import (
    PAGE_COLOURS,
    ROOT,
    SLACK_TENSION,
    Command,
    link_names,
    link_solids,
    looseness,
    pose_command,
    tension_scale,
)

#: Radius of the tube that is drawn for a tendon: most, in parts of the distance between neighbouring tendons and of
#: the width of the narrowest link.
_TUBE_IN_LANE, _TUBE_IN_LINK = 0.34, 0.032
#: Points per span and per radian of the tendons drawn, so that sags and arcs look smooth.
_PATH_RESOLUTION = 11
# Beyond so many times the hand's own extent, the camera does not follow.
_MAX_REACH = 3.0
_MAX_INTEGER = 32767
_GHOST_PATH, _GHOST_COLOUR = f"{ROOT}/ghost", (0.69, 0.50, 1.0)


@dataclass(frozen=True, eq=False)
class Ghost:
    """Second motion, drawn faintly.

    Attributes:
        scene: Its finger.
        title: Its name.
        poses: Of its links in every frame of the motion that is played.
    """

    scene: Scene
    title: str
    poses: LinkPoses

    def header(self) -> dict[str, Any]:
        """Return its part of the page's header."""
        return {"title": self.title, "links": link_names(self.scene.geometry)[1:]}

    def commands(self) -> list[Command]:
        """Return meshcat's commands for the solids of its links."""
        solids = link_solids(self.scene.geometry, self.scene.tube_radius)
        return [solid.command(_GHOST_PATH, _GHOST_COLOUR) for solid in solids if solid.frame != "base"]

    def frames(self) -> Array:
        """Return the frames for the page, shape (m, k, 7), float32."""
        return _pose_numbers(LinkPoses(self.poses.rotation[:, 1:], self.poses.translation[:, 1:]))

    def points_in_view(self) -> Array:
        """Return points that the camera must have in view, shape (m, 3), m."""
        return np.concatenate([self.poses.translation.reshape(-1, 3), self.scene.tips(self.poses).reshape(-1, 3)])


def finger_geometry(finger: FingerLike) -> TendonGeometry:
    """Return the geometry of a finger or hand, or of its description, name or file."""
    model = finger if isinstance(finger, Finger) else None
    description = description_of(finger)
    visuals = None if model is None else model.visuals
    body = None if model is None or visuals is None else model.rigid_body
    return TendonGeometry(description, resolution=_PATH_RESOLUTION, body=body, solids=visuals)


class Scene:
    """A finger prepared for the page.

    Attributes:
        geometry: Its tendons in space.
        strands: Labels of what has a tension: the actuated tendons, two halves of each passive, and given cords.
        size: Length of the finger, m.
        tube_radius: Of the tubes that are drawn for tendons, m.
        tendons: Of every tendon its name, the index of the strand that every point of it shows, and its knots. Cords of
            a tree whose tension is not known have the index behind the last strand.
    """

    def __init__(self, finger: FingerLike, cords: Sequence[str] = ()) -> None:
        """Prepare solids and tendons, and a tree's cords that servos, muscles or springs pull, given by their names."""
        self.geometry = finger_geometry(finger)
        description = self.geometry.description
        halves = [f"{name} {half}" for name in description.passive_names for half in ("proximal", "distal")]
        self._slides = [name for name, joint in description.tree.joints.items() if joint.kind == "slide"]
        self.strands = (*description.actuated_names, *halves, *cords)
        self._widths, self.size = self.geometry.widths, self.geometry.size
        # Points are sent as 16-bit integers; this is their unit, a few micrometres.
        self._point_unit = 1.5 * self.size / _MAX_INTEGER
        self.tube_radius = min(_TUBE_IN_LANE * self.geometry.lanes.spacing, _TUBE_IN_LINK * min(self._widths))
        self.tendons = [
            self._tendon(path.name, path.distal.tolist())
            for path in self.geometry.paths(np.zeros(len(description.joints)))
        ]
        self._strands = [self._strands_of(tendon["name"]) for tendon in self.tendons]

    def _note_on_cords(self) -> str:
        """Return a note on what pulls the cords whose tension is not shown; empty if there are none."""
        tree = self.geometry.description.tree
        path_names = {tendon["name"] for tendon in self.tendons if len(self.strands) in tendon["strand"]}
        names = {name if name in tree.tendons else name.rpartition(".")[0] for name in path_names}
        drives = {each.drives: each for each in tree.actuators.values()}
        pulling = [drives.get(("tendon", name)) for name in names]
        kinds = {("muscles" if each.muscle else "actuators") if each else "springs" for each in pulling}
        return f"cords that {' and '.join(sorted(kinds))} pull; their tension is not shown" if names else ""

    def header(
        self,
        title: str,
        joint_positions: ArrayLike,
        largest_tension: float,
        *,
        forces: ForcePolytope | None = None,
        ghost: Ghost | None = None,
        palm: LinkPoses | None = None,
    ) -> dict[str, Any]:
        """Return the page's header: the data that all frames share.

        Args:
            title: Shown above the legend.
            joint_positions: Postures that the camera must have in view, shape (m, n), rad.
            largest_tension: Tension that the legend must reach, N.
            forces: Drawn at the fingertip of its posture, if given.
            ghost: Another finger, drawn faintly beside this one, if given.
            palm: Poses of the palm at those positions, if it moves.
        """
        geometry, tube = self.geometry, self.tube_radius
        rotation = self.view()
        force_set = ForceSet.from_polytope(forces, self.size) if forces is not None else None
        extra = ([] if force_set is None else [force_set.corners]) + ([] if ghost is None else [ghost.points_in_view()])
        corners = self._in_view(joint_positions, palm, extra)
        commands = [
            pose_command("", rotation, np.zeros(3)),
            *(solid.command() for solid in link_solids(geometry, tube)),
        ]
        for drawn in (force_set, ghost):
            commands += () if drawn is None else drawn.commands()
        return {
            "title": title,
            "commands": commands,
            "ghost": ghost.header() if ghost is not None else None,
            "forces": force_set.note if force_set is not None else "",
            "cords": self._note_on_cords(),
            "links": link_names(geometry),
            "joints": list(geometry.description.joints),
            "slides": self._slides,
            "strands": list(self.strands),
            "tendons": self.tendons,
            "tubeRadius": tube,
            "quantum": self._point_unit,
            "grid": 10.0 ** math.floor(math.log10(float(np.ptp(corners, axis=0).max()) / 4.0)),
            "tips": len(geometry.tips),
            "inView": np.round(_outermost(corners), 5).tolist(),
            "margin": 0.55 * max(self._widths),
            "tensionScale": tension_scale(largest_tension),
            "slackTension": SLACK_TENSION,
            "colours": PAGE_COLOURS,
        }

    def _in_view(self, joint_positions: ArrayLike, palm: LinkPoses | None, extra_points: list[Array]) -> Array:
        """Return the points that the camera must have in view, with some beside the finger, shape (p, 3), m."""
        geometry, rotation = self.geometry, self.view()
        poses = geometry.poses(joint_positions, palm)
        paths = geometry.paths(joint_positions, poses=poses)
        visible = [poses.translation[..., geometry.first_seen :, :], self.tips(poses), *(path.points for path in paths)]
        visible += [*(_box_corners(visual, poses) for visual in geometry.visuals), *extra_points]
        corners: Array = np.concatenate([points.reshape(-1, 3) for points in visible]) @ rotation.T
        if not self._slides:
            return corners
        # Links that have left the hand, such as a falling pen of an imported model, leave the view.
        first_points = np.concatenate([points.reshape(-1, *points.shape[-2:])[0] for points in visible]) @ rotation.T
        middle = first_points.mean(axis=0)
        radius = np.linalg.norm(first_points - middle, axis=1).max()
        near_points: Array = corners[np.linalg.norm(corners - middle, axis=1) <= _MAX_REACH * radius]
        return near_points

    def frames(
        self, time: ArrayLike, joint_position: ArrayLike, tension: ArrayLike, palm: LinkPoses | None = None
    ) -> dict[str, Array]:
        """Return frames for the page, arrays whose first axis is time.

        Args:
            time: Shape (m,), s.
            joint_position: theta, shape (m, n), rad.
            tension: Of every strand, shape (m, s), N.
            palm: Poses of the palm, if it moves.
        """
        q, f = np.asarray(joint_position, dtype=float), np.asarray(tension, dtype=float)
        poses = self.geometry.poses(q, palm)
        empty = np.zeros((*q.shape[:-1], 0, 3))
        points = [empty, *(path.points for path in self.geometry.paths(q, self.looseness(f), poses))]
        paths = np.concatenate(points, axis=-2)
        return {
            "time": np.asarray(time, dtype="<f8"),
            "pose": _pose_numbers(poses),
            "path": np.clip(np.rint(paths / self._point_unit), -_MAX_INTEGER, _MAX_INTEGER).astype("<i2"),
            "tension": f.astype("<f4"),
            "tip": self.tips(poses).astype("<f4"),
            "joint": q.astype("<f4"),
        }

    def tips(self, poses: LinkPoses) -> Array:
        """Return the fingertips, shape (..., f, 3), m, of poses of the links."""
        positions = [
            poses.rotation[..., link, :, :] @ offset + poses.translation[..., link, :]
            for link, offset in self.geometry.tips
        ]
        return np.stack(positions, axis=-2)

    def looseness(self, strand_tension: Array) -> Array:
        """Return the looseness of tendons, shape (..., t), 0 to 1, at tensions of the strands, (..., s), N."""
        # A passive tendon is drawn loose when both its halves are, and a cord without a known tension never.
        shape = strand_tension.shape[:-1]
        tensions = np.concatenate([strand_tension, np.full((*shape, 1), SLACK_TENSION)], axis=-1)
        tendon_tensions = [tensions[..., strands].max(axis=-1) for strands in self._strands]
        tension = np.stack(tendon_tensions, axis=-1) if tendon_tensions else np.zeros((*shape, 0))
        return looseness(tension)

    def _tendon(self, name: str, distal: Sequence[bool]) -> dict[str, Any]:
        first, *others = self._strands_of(name)
        last = len(distal) - 1
        knots = {last} if first < len(self.geometry.description.actuated_names) else {0, last}
        if others and True in distal:
            knots.add(distal.index(True))
        return {"name": name, "strand": [first + int(flag) for flag in distal], "knots": sorted(knots)}

    def _strands_of(self, name: str) -> list[int]:
        """Return the indices of the strands of a tendon: one, two halves, or that behind all if its tension is unknown.

        Args:
            name: Of a path; that of a further branch has a dot and a number after the tendon's.
        """
        for tendon in (name, name.rpartition(".")[0]):
            labels = (tendon, f"{tendon} proximal", f"{tendon} distal")
            if strands := [index for index, label in enumerate(self.strands) if label in labels]:
                return strands
        return [len(self.strands)]

    def view(self) -> Array:
        """Return the rotation from the base frame to the frame of the view, shape (3, 3)."""
        # There z is up, the camera stands on the side of -y, where the axes of most
        # joints point, so that flexion is seen from the side and runs counter-clockwise.
        model, data = self.geometry.model, self.geometry.model.createData()
        pin.forwardKinematics(model, data, np.zeros(model.nq))
        joint = self.geometry.lanes.families[0][0]
        frame = np.array(data.oMi[joint].rotation)
        joint_axis = joint_axes(model)[joint - 1]
        axis = joint_axis if joint_axis.any() else frame[:, 2]
        gravity = np.array(self.geometry.description.gravity)
        up = -gravity / np.linalg.norm(gravity) if gravity.any() else axis
        if abs(up @ axis) > 0.9:
            up = frame[:, 1 if abs(frame[:, 1] @ axis) < 0.5 else 0]
        back = -(axis - (axis @ up) * up)
        back /= np.linalg.norm(back)
        return np.array([np.cross(back, up), back, up])


def _box_corners(visual: Visual, poses: LinkPoses) -> Array:
    """Return the corners of the box around a solid, in all poses of its link."""
    points = visual.geometry.points
    box = np.array(list(product(*zip(points.min(axis=0), points.max(axis=0), strict=True))))
    box = box @ visual.placement.rotation.T
    rotation, translation = poses.rotation[..., visual.link, :, :], poses.translation[..., visual.link, None, :]
    return np.asarray((box + visual.placement.translation) @ np.swapaxes(rotation, -1, -2) + translation)


def _outermost(points: Array) -> Array:
    # The points that are farthest out in some direction of a fan around the sphere: enough to frame them all.
    index = np.arange(200) + 0.5
    polar, azimuth = np.arccos(1.0 - index / 100.0), math.pi * (1.0 + math.sqrt(5.0)) * index
    directions = np.stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)])
    # One row of distances per direction: a maximum along columns takes five times as long.
    return np.asarray(points[np.unique(np.argmax(directions.T @ points.T, axis=1))])


def _pose_numbers(poses: LinkPoses) -> Array:
    """Return x, y, z and quaternion x, y, z, w of poses, shape (..., 7), float32."""
    quaternions = Rotation.from_matrix(poses.rotation.reshape(-1, 3, 3)).as_quat()
    orientations = quaternions.reshape(*poses.translation.shape[:-1], 4)
    return np.concatenate([poses.translation, orientations], axis=-1).astype("<f4")
