"""Free bodies of a MuJoCo model: those that tendons pass as joints of the tree, others for objects."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_equalities import linked_bodies
from finger_pin.exchange.mujoco_names import Table
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.typing import Array

_SLIDES, _TURNS = ("x", "y", "z"), ("yaw", "pitch", "roll")
# Cosine of the middle hinge below which the other two turn about one axis.
_UPRIGHT = 1e-6
# The range of what searches and pictures go through, m.
_REACH = 1.0


class FreeBodies:
    """Bodies with free joints.

    Attributes:
        kept: Free joints of the bodies that tendons pass, that carry other joints, or that touch with several shapes,
            where an object has one: they become slides and hinges.
        loose: The other bodies with free joints.
    """

    def __init__(self, read: ElementReader, passed: set[int]) -> None:
        """Find the free bodies of a model, given those that tendons pass."""
        self.model, self.names, mujoco = read.model, read.names, read.mujoco
        self._colliding = read.colliding
        model = self.model
        joints = [int(i) for i in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)]
        trees = {i: self._carried(int(model.jnt_bodyid[i])) for i in joints}
        linked = linked_bodies(mujoco, model)
        moving = {int(model.jnt_bodyid[i]) for i in range(model.njnt) if i not in joints}
        self.kept = [i for i in joints if trees[i] & (passed | moving | linked) or self._touches_with_several(trees[i])]
        for i in self.kept:
            about = "its middle hinge of three must not come to a right angle"
            read.rest.add(f"free body {self.names.bodies[int(model.jnt_bodyid[i])]}: {about}", moves=False)
        self.loose = [int(model.jnt_bodyid[i]) for i in joints if i not in self.kept]
        # Upwards is the axis of the first hinge: what hangs turns about it as often as it likes.
        gravity = model.opt.gravity
        up = -gravity / np.linalg.norm(gravity) if np.any(gravity) else np.array([0.0, 0.0, 1.0])
        across = np.cross(np.eye(3)[int(np.argmin(np.abs(up)))], up)
        across /= np.linalg.norm(across)
        self._axes = np.column_stack([np.cross(across, up), across, up])

    def _carried(self, body: int) -> set[int]:
        bodies = {body}
        for i in range(body + 1, self.model.nbody):
            if int(self.model.body_parentid[i]) in bodies:
                bodies.add(i)
        return bodies

    def _touches_with_several(self, carried: set[int]) -> bool:
        return int(np.count_nonzero(np.isin(self.model.geom_bodyid[self._colliding], [*carried]))) > 1

    def _of(self, joint: int) -> tuple[int, str, Array]:
        """Return the body of a joint, its name, and its rotation at the model's reference."""
        body = int(self.model.jnt_bodyid[joint])
        return body, self.names.bodies[body], _rotation(self.model.body_quat[body])

    def joints(self, joint: int) -> Iterator[tuple[str, Table, Table]]:
        """Yield names, joints and their motion: along the base's axes, then about axes through the mass centre."""
        model = self.model
        body, name, turned = self._of(joint)
        first = int(model.jnt_dofadr[joint])
        centre = model.body_ipos[body].tolist()
        for k, (coordinate, axis) in enumerate(zip(_names(name), (*np.eye(3), *self._axes.T[::-1]), strict=True)):
            reach = _REACH if k < len(_SLIDES) else math.pi
            damping, armature = float(model.dof_damping[first + k]), float(model.dof_armature[first + k])
            spring = {"spring": {"stiffness": 0.0, "damping": damping}} if damping else {}
            yield (
                coordinate,
                {"range": [-reach, reach], "limited": False, **spring},
                {
                    "body": name,
                    "kind": "slide" if k < len(_SLIDES) else "hinge",
                    "axis": (turned.T @ axis).tolist(),
                    "anchor": centre,
                    "armature": armature,
                    "bearing": False,
                },
            )

    def position(self, joint: int, qpos: Array) -> dict[str, float]:
        """Return the positions of a body's slides and hinges in a state of the model."""
        model = self.model
        body, name, turned = self._of(joint)
        at = int(model.jnt_qposadr[joint])
        now = _rotation(qpos[at + 3 : at + 7])
        centre = model.body_ipos[body]
        moved = qpos[at : at + 3] + now @ centre - model.body_pos[body] - turned @ centre
        with warnings.catch_warnings():
            # Where the first and the third hinge have one axis, any share of the turn will do.
            warnings.filterwarnings("ignore", "Gimbal lock")
            angles = Rotation.from_matrix(self._axes.T @ now @ turned.T @ self._axes).as_euler("ZYX")
        return dict(zip(_names(name), [*moved.tolist(), *angles.tolist()], strict=True))

    def velocity(self, joint: int, qpos: Array, qvel: Array) -> dict[str, float]:
        """Return the speeds of a body's slides and hinges in a state of the model.

        Raises:
            InputError: If it turns while the middle hinge is at a right angle.
        """
        body, name, _ = self._of(joint)
        at, first = int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])
        now, turning = _rotation(qpos[at + 3 : at + 7]), qvel[first + 3 : first + 6]
        moved = qvel[first : first + 3] + now @ np.cross(turning, self.model.body_ipos[body])
        yaw, pitch, _ = [*self.position(joint, qpos).values()][3:]
        # What one after the other turns by: about z, about y turned by yaw, and about x turned by both.
        after = Rotation.from_euler("Z", yaw), Rotation.from_euler("ZY", [yaw, pitch])
        axes = np.column_stack([[0.0, 0.0, 1.0], after[0].apply([0.0, 1.0, 0.0]), after[1].apply([1.0, 0.0, 0.0])])
        if turning.any() and abs(math.cos(pitch)) < _UPRIGHT:
            allowed = "turns where the second of its three hinges is at a right angle, which has no speed for it"
            raise InputError(f"model: free body {name}", f"{allowed}; give another start")
        rates = np.zeros(3) if not turning.any() else np.linalg.solve(axes, self._axes.T @ now @ turning)
        return dict(zip(_names(name), [*moved.tolist(), *rates.tolist()], strict=True))


def _rotation(real_first: Array) -> Array:
    """Return the rotation of a quaternion w, x, y, z."""
    return np.asarray(Rotation.from_quat(np.roll(real_first, -1)).as_matrix())


def _names(body: str) -> list[str]:
    """Return the names of a body's slides and hinges."""
    return [f"{body}_{what}" for what in (*_SLIDES, *_TURNS)]
