"""Free bodies of a MuJoCo model: those that tendons pass as joints of the tree, others for objects; mocap bodies."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_equalities import linked_bodies
from finger_pin.exchange.mujoco_names import Table, unused_name
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

_SLIDES, _TURNS = ("x", "y", "z"), ("yaw", "pitch", "roll")
# Least cosine of the middle hinge's angle: below it the other two turn about one axis.
_LEAST_COSINE = 1e-6
# Half range of slides for searches and pictures, m.
_SLIDE_RANGE = 1.0


class FreeBodies:
    """Bodies with free joints.

    Attributes:
        converted: Free joints that become slides and hinges: of the bodies that tendons pass, that carry other joints,
            or that touch with several shapes or have parts, where an object has one shape.
        object_bodies: The other bodies with free joints.
        labels: Names of the slides and hinges of bodies.
    """

    def __init__(self, reader: ElementReader, passed: set[int]) -> None:
        """Find the free bodies of a model, given those that tendons pass."""
        self.model, self.names, mujoco = reader.model, reader.names, reader.mujoco
        self._colliding = reader.colliding
        model = self.model
        joints = [int(i) for i in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)]
        trees = {i: self._carried_bodies(int(model.jnt_bodyid[i])) for i in joints}
        linked = linked_bodies(mujoco, model)
        moving = {int(model.jnt_bodyid[i]) for i in range(model.njnt) if i not in joints}
        joined = passed | moving | linked
        self.converted = [i for i in joints if trees[i] & joined or self._has_several_geoms(trees[i])]
        for i in self.converted:
            condition = "its middle hinge of three must not come to a right angle"
            name, first = self.names.bodies[int(model.jnt_bodyid[i])], int(model.jnt_dofadr[i])
            dofs = slice(first, first + 6)
            reader.left_out.add(f"free body {name}: {condition}", moves=False)
            if np.any(model.dof_damping[dofs]) or np.any(model.dof_armature[dofs]):
                reader.left_out.add(f"free body {name}: damping and armature are those of its slides and hinges")
            if np.any(model.dof_frictionloss[dofs]):
                reader.left_out.add(f"free body {name}: friction loss")
        used = {*self.names.joints}
        bodies = model.jnt_bodyid[self.converted].tolist()
        self.labels = {body: _labels(self.names.bodies[body], used) for body in bodies}
        self.object_bodies = [int(model.jnt_bodyid[i]) for i in joints if i not in self.converted]
        # Upwards is the axis of the first hinge: what hangs turns about it as often as it likes.
        gravity = model.opt.gravity
        up = -gravity / np.linalg.norm(gravity) if np.any(gravity) else np.array([0.0, 0.0, 1.0])
        across = np.cross(np.eye(3)[int(np.argmin(np.abs(up)))], up)
        across /= np.linalg.norm(across)
        self._axes = np.column_stack([np.cross(across, up), across, up])

    def _carried_bodies(self, body: int) -> set[int]:
        bodies = {body}
        for i in range(body + 1, self.model.nbody):
            if int(self.model.body_parentid[i]) in bodies:
                bodies.add(i)
        return bodies

    def _has_several_geoms(self, carried: set[int]) -> bool:
        touching = int(np.count_nonzero(np.isin(self.model.geom_bodyid[self._colliding], [*carried])))
        return touching > (len(carried) == 1)

    def _reference_pose(self, joint: int) -> tuple[int, str, Array]:
        """Return the body of a joint, its name, and its rotation at the model's reference."""
        body = int(self.model.jnt_bodyid[joint])
        return body, self.names.bodies[body], _rotation(self.model.body_quat[body])

    def joints(self, joint: int) -> Iterator[tuple[str, Table, Table]]:
        """Yield names, joints and their motion: along the base's axes, then about axes through the mass centre."""
        model = self.model
        body, name, rotation = self._reference_pose(joint)
        first = int(model.jnt_dofadr[joint])
        numbers = [
            (float(model.dof_damping[k]), {"armature": float(model.dof_armature[k])}) for k in range(first, first + 6)
        ]
        axes = rotation.T @ np.column_stack([np.eye(3), self._axes[:, ::-1]])
        yield from _slides_and_hinges(name, self.labels[body], axes, model.body_ipos[body].tolist(), numbers)

    def position(self, joint: int, qpos: Array) -> dict[str, float]:
        """Return the positions of a body's slides and hinges in a state of the model."""
        model = self.model
        body, _, rotation = self._reference_pose(joint)
        address = int(model.jnt_qposadr[joint])
        current = _rotation(qpos[address + 3 : address + 7])
        centre = model.body_ipos[body]
        displacement = qpos[address : address + 3] + current @ centre - model.body_pos[body] - rotation @ centre
        angles = _euler(self._axes.T @ current @ rotation.T @ self._axes)
        return dict(zip(self.labels[body], [*displacement.tolist(), *angles.tolist()], strict=True))

    def velocity(self, joint: int, qpos: Array, qvel: Array) -> dict[str, float]:
        """Return the speeds of a body's slides and hinges in a state of the model."""
        body, name, _ = self._reference_pose(joint)
        address, first = int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])
        current, omega = _rotation(qpos[address + 3 : address + 7]), qvel[first + 3 : first + 6]
        velocity = qvel[first : first + 3] + current @ np.cross(omega, self.model.body_ipos[body])
        yaw, pitch, _ = [*self.position(joint, qpos).values()][3:]
        # What one after the other turns by: about z, about y turned by yaw, and about x turned by both.
        frames = Rotation.from_euler("Z", yaw), Rotation.from_euler("ZY", [yaw, pitch])
        axes = np.column_stack([[0.0, 0.0, 1.0], frames[0].apply([0.0, 1.0, 0.0]), frames[1].apply([1.0, 0.0, 0.0])])
        if omega.any() and abs(math.cos(pitch)) < _LEAST_COSINE:
            allowed = "turns where the second of its three hinges is at a right angle, which has no speed for it"
            raise InputError(f"model: free body {name}", f"{allowed}; give another start")
        rates = np.zeros(3) if not omega.any() else np.linalg.solve(axes, self._axes.T @ current @ omega)
        return dict(zip(self.labels[body], [*velocity.tolist(), *rates.tolist()], strict=True))


def _rotation(real_first: Array) -> Array:
    """Return the rotation of a quaternion w, x, y, z."""
    return np.asarray(Rotation.from_quat(np.roll(real_first, -1)).as_matrix())


def _labels(body: str, used: set[str]) -> list[str]:
    """Return unused names of a body's slides and hinges, which are used from now on."""
    labels = [unused_name(f"{body}_{what}", used, "of_body") for what in (*_SLIDES, *_TURNS)]
    used.update(labels)
    return labels


def _slides_and_hinges(
    body: str, labels: list[str], axes: Array, anchor: list[float], numbers: Sequence[tuple[float, Table]]
) -> Iterator[tuple[str, Table, Table]]:
    """Yield names, joints and their motion; axes have shape (3, 6), in the body's frame, numbers damping and more."""
    for k, (label, axis, (damping, extra)) in enumerate(zip(labels, axes.T, numbers, strict=True)):
        is_slide = k < len(_SLIDES)
        half_range = _SLIDE_RANGE if is_slide else math.pi
        spring = {"spring": {"stiffness": 0.0, "damping": damping}} if damping else {}
        yield (
            label,
            {"range": [-half_range, half_range], "limited": False, **spring},
            {
                "body": body,
                "kind": "slide" if is_slide else "hinge",
                "axis": axis.tolist(),
                "anchor": anchor,
                "bearing": False,
                **extra,
            },
        )


class MocapBodies:
    """Mocap bodies: those that the model needs move along paths, by slides along and hinges about the base's axes.

    Attributes:
        bodies: The bodies that move along paths, at rest unless a scenario says otherwise.
        fixed: Mocap bodies that stand still: what carries joints or planes, and what nothing touches or holds.
        labels: Names of their slides and hinges.
    """

    def __init__(self, reader: ElementReader, bodies: Collection[int], used: Collection[str]) -> None:
        """Find the mocap bodies among the bodies of a tree, which has joints of some names."""
        model, self._reader, names, self.fixed = reader.model, reader, {*used}, list[int]()
        planes = [i for i in reader.colliding if model.geom_type[i] == reader.mujoco.mjtGeom.mjGEOM_PLANE]
        self.labels: dict[int, list[str]] = {}
        for body in (int(each) for each in np.flatnonzero(model.body_mocapid >= 0)):
            carried = model.body_rootid == body
            reasons = {
                "it carries joints": bool(np.any(model.body_jntnum[carried])),
                "it has a plane": bool(np.any(carried[model.geom_bodyid[planes]])),
                "nothing touches it or is held by it": body not in bodies,
            }
            if any(reasons.values()):
                reason = next(text for text, there in reasons.items() if there)
                reader.left_out.add(f"body {reader.names.bodies[body]}: mocap, stands still, as {reason}", moves=False)
                self.fixed.append(body)
            else:
                self.labels[body] = _labels(reader.names.bodies[body], names)

    def __contains__(self, body: int) -> bool:
        """Return whether a body is led or carried by one that is."""
        return int(self._reader.model.body_rootid[body]) in self.labels

    def joints(self, body: int) -> Iterator[tuple[str, Table, Table]]:
        """Yield names, joints and their motion."""
        axes = _rotation(self._reader.model.body_quat[body]).T @ np.column_stack([np.eye(3), np.eye(3)[:, ::-1]])
        label = self._reader.names.bodies[body]
        yield from _slides_and_hinges(label, self.labels[body], axes, [0.0] * 3, [(0.0, {"path": {}})] * 6)

    def position(self, keyframe: int) -> dict[str, float]:
        """Return the positions of slides and hinges at a keyframe."""
        model, data, positions = self._reader.model, self._reader.start_data(keyframe), dict[str, float]()
        for body, labels in self.labels.items():
            rotation = data.xmat[body].reshape(3, 3) @ _rotation(model.body_quat[body]).T
            angles = _euler(rotation)
            displacement = data.xpos[body] - model.body_pos[body]
            positions |= dict(zip(labels, [*displacement.tolist(), *angles.tolist()], strict=True))
        return positions


def _euler(rotation: Array) -> Array:
    """Return yaw, pitch and roll of a rotation; where yaw and roll have one axis, any share of the turn will do."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Gimbal lock")
        return np.asarray(Rotation.from_matrix(rotation).as_euler("ZYX"))
