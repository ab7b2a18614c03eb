"""Parts of a finger and their tables of rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.description.finger import FingerDescription
from finger_pin.description.objects import Object
from finger_pin.description.routing import Routing
from finger_pin.exceptions import InputError
from finger_pin.mechanism.actuators import Actuators
from finger_pin.mechanism.canals import Canals
from finger_pin.mechanism.joints import JointFriction, JointSprings, StrokeLimiter
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows, state_scales
from finger_pin.mechanism.scene import Scene
from finger_pin.mechanism.state import BLOCKS, Layout
from finger_pin.mechanism.tendon_paths import TendonPaths
from finger_pin.mechanism.tendons import Tendons
from finger_pin.mechanism.tree import along_paths
from finger_pin.typing import Array


class ConstructorArgs(NamedTuple):
    """What a finger was built from besides its description, as `Finger` takes it."""

    rigid_body: RigidBody | None
    rows: tuple[Rows, ...]
    objects: Mapping[str, Object] | None
    tables: Mapping[str, Callable[[Rows], Rows]]


class Parts(NamedTuple):
    """Parts of a finger, made from its description."""

    routing: Routing
    tendons: Tendons
    actuators: Actuators
    joint_friction: JointFriction
    stroke_limiter: StrokeLimiter
    springs: JointSprings

    @classmethod
    def of(cls, description: FingerDescription) -> Parts:
        """Return the parts of a description."""
        routing = Routing.from_description(description)
        return cls(
            routing,
            Tendons.from_description(description),
            Actuators.from_description(description, routing),
            JointFriction.from_description(description, routing.loads),
            StrokeLimiter.from_description(description),
            JointSprings.from_description(description),
        )

    @property
    def width(self) -> int:
        """Number of coordinates: joints, masses of passive tendons, spools with play, motors."""
        return len(self.routing.joints) + self.routing.passive + len(self.actuators.inertias)

    def hysteresis_rows(self) -> tuple[Rows, ...]:
        """Return the tables of the springs' hysteresis."""
        return tuple(self.springs.hysteresis_rows(self.routing.joints, self.width))

    def drives(self, description: FingerDescription, rows: Sequence[Rows]) -> tuple[Rows, ...]:
        """Return the tables that pull tendons: elastic ones, sources with an end, and those among further tables."""
        sources = self.tendons.sources(description, self.width)
        return (*self.actuators.tendon_rows(self.width), *sources, *(table for table in rows if table.pulls))

    def tables(
        self,
        description: FingerDescription,
        paths: TendonPaths,
        of_tree: tuple[Rows, ...],
        drives: tuple[Rows, ...],
        drive_matrices: dict[str, Array],
    ) -> tuple[list[Rows], Canals]:
        """Return the tables of rows in the order of evaluation, and the canals."""
        joints, width = self.routing.joints, self.width
        tendon_rows = self.tendons.rows(drives, len(self.actuators.inertias))
        tendon_rows = [along_paths(description, paths, table) for table in tendon_rows]
        canals = Canals(description, paths, self.tendons, [*of_tree, *tendon_rows], drive_matrices, width)
        return [
            *of_tree,
            *tendon_rows,
            *canals.tables,
            self.joint_friction.rows(joints, drive_matrices, self.routing.actuated, width, canals.loads),
            self.stroke_limiter.rows(joints, width),
            self.springs.rows(joints, width),
            *self.actuators.rotor_rows(width),
        ], canals


def state_layout(
    tendons: Tendons,
    friction: JointFriction,
    motors: Actuators,
    rows: Sequence[Rows] = (),
    scene: Scene | None = None,
    of_tree: Sequence[Rows] = (),
    canals: Sequence[Rows] = (),
    slides: Sequence[bool] = (),
) -> Layout:
    """Return the layout of tendons, joints, motors, extra rows, drives among them, and a scene; which joints slide."""
    routing = tendons.routing
    drives, of_others = (state_scales([table for table in rows if bool(table.pulls) == own]) for own in (True, False))

    def each(names: Sequence[str], parts: str) -> list[str]:
        return [f"{name}.{part}" for name in names for part in parts.split()]

    free, world, touching = ((), (), ()) if scene is None else (tuple(scene.free), scene.world, scene.contacts.names)
    labels = {
        "position": routing.joints,
        "object_pose": each(free, "x y z qx qy qz qw"),
        "world_position": world,
        "passive_position": routing.passive_names,
        "spool_position": motors.loose_names,
        "motor_position": motors.names,
        "velocity": routing.joints,
        "object_velocity": each(free, "vx vy vz wx wy wz"),
        "world_velocity": world,
        "passive_velocity": routing.passive_names,
        "spool_velocity": motors.loose_names,
        "motor_velocity": motors.names,
        "contact_bend": each(touching, "1 2"),
        "actuator_state": [name for table in of_tree if table.states for name in table.names],
        "elastic_stiction": (*tendons.held, *(routing.tendons[motors.tendons[k]] for k in motors.held)),
        "drives": [name for name, _ in drives],
        "tendon_stiction": routing.tendons,
        "canal_stiction": [name for table in canals if table.states for name in table.names],
        "joint_stiction": () if friction.law.scale is None else routing.joints,
        "gearbox_stiction": motors.names,
        "further": [name for name, _ in of_others],
    }
    # A lumped mass that rings has the velocity that goes with 1 % of its position.
    ringing = np.sqrt(2.0 * tendons.half_stiffness) / np.sqrt(tendons.mass)
    scaled = {
        "passive_velocity": np.maximum(BLOCKS["passive_velocity"].scale, 1e-5 * ringing).tolist(),
        "drives": [scale for _, scale in drives],
        "further": [scale for _, scale in of_others],
    }
    if any(slides):
        # What slides moves as an object does, by centimetres where a joint turns by a radian.
        for block, sliding in (("position", "object_pose"), ("velocity", "object_velocity")):
            turning, along = BLOCKS[block].scale[0], BLOCKS[sliding].scale[0]
            scaled[block] = np.where(slides, along, turning).tolist()
    return Layout.of(labels, scaled)


def check_layout(layout: Layout, mechanism: Mechanism) -> None:
    """Refuse a layout whose blocks are not those of a mechanism, before anything compiled reads a state of it.

    Raises:
        RuntimeError: Naming the first block that ends elsewhere than coordinates or a table's states do.
    """
    turn, middle = mechanism.positions, mechanism.positions + mechanism.coordinates
    last = {"motor_position": turn, "motor_velocity": middle, "further": mechanism.size}
    table_ends = {middle, *(middle + part.stop for part in mechanism.states)}
    states = list(BLOCKS)[list(BLOCKS).index("motor_velocity") :]
    for block, end in zip(BLOCKS, np.cumsum(layout.sizes).tolist(), strict=True):
        if end != last.get(block, end) or (block in states and end not in table_ends):
            raise RuntimeError(f"state.{block} ends at {end}, which the {mechanism.size} numbers of the rows do not")


def check_joints(body: RigidBody, description: FingerDescription) -> None:
    """Refuse a rigid body whose joints are not those of a description, or that has one with several coordinates."""
    if len(body.joints) != len(description.joints):
        raise InputError("finger.joints", f"the rigid body's joints are {', '.join(body.joints)}")
    for name, joint in zip(body.joints, body.model.joints[1:], strict=True):
        if joint.nv != 1:
            raise InputError(f"joint {name}", "a joint of a finger turns or slides", joint.shortname())
