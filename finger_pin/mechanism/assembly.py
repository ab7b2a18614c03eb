"""The parts of a finger, assembled: its rows, their order, and the layout of its state."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.objects import Object
from finger_pin.description.routing import Routing
from finger_pin.exceptions import InputError, ScenarioWarning
from finger_pin.mechanism.canals import Canals
from finger_pin.mechanism.joints import JointFriction, JointSprings, StrokeLimiter
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.object_scene import Scene
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows, state_scales
from finger_pin.mechanism.servos import Actuators
from finger_pin.mechanism.sheaths import in_sheaths
from finger_pin.mechanism.sources import source_rows
from finger_pin.mechanism.state import BLOCKS, Layout
from finger_pin.mechanism.tendons import Tendons
from finger_pin.mechanism.tree_mechanism import TreePaths, along_paths
from finger_pin.mechanism.wiring import replace_tables
from finger_pin.typing import Array


class ConstructorArgs(NamedTuple):
    """Arguments of `Finger` besides its description."""

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
    def from_description(cls, description: FingerDescription) -> Parts:
        """Return the parts of a description."""
        routing = Routing.from_description(description)
        return cls(
            routing,
            Tendons(description, routing),
            Actuators.from_description(description, routing),
            JointFriction(description, routing),
            StrokeLimiter(description),
            JointSprings(description),
        )

    @property
    def width(self) -> int:
        """Number of coordinates: joints, masses of passive tendons, spools with play, motors."""
        return len(self.routing.joints) + self.routing.passive + len(self.actuators.inertias)


class Assembly(NamedTuple):
    """A description as coordinates and rows.

    Attributes:
        mechanism: All rows, with those of the scene.
        scene: Objects and contacts; None without any.
        layout: Order and sizes of the packed state.
        drive_matrices: Weights with which drives and passive tendons' hysteresis pull the strands, by table, (s, k).
        wraps: By table of wraps beyond the first ones, which row is of which tendon, shape (t, rows).
        extra_rows: Tables beside the paper's: those of a tree, canals, hysteresis, and rows of the user's own.
    """

    mechanism: Mechanism
    scene: Scene | None
    layout: Layout
    drive_matrices: dict[str, Array]
    wraps: dict[str, Array]
    extra_rows: tuple[Rows, ...]


def assemble(
    description: FingerDescription, body: RigidBody, paths: TreePaths, parts: Parts, args: ConstructorArgs
) -> Assembly:
    """Return the rows of a description, in the order in which their states stand, joined by (18).

    Args:
        description: Of the finger.
        body: Its rigid body.
        paths: Its tendons on that body.
        parts: Its other parts.
        args: Rows, objects and replacements of the user's own.
    """
    _warn_of_turns(description)
    routing, tendons, actuators, joint_friction, stroke_limiter, springs = parts
    width = parts.width
    # Dry friction of a tree's tendons has states of its own, which stand with those of the user's rows.
    joints = np.arange(len(routing.joints))
    of_tree = {table.group: table.embed_coordinates(joints, width) for table in paths.tables}
    dry_friction = [of_tree.pop(group) for group in ("tendon_dry_friction",) if group in of_tree]
    custom_drives = [table for table in args.rows if table.pulls]
    pulling = [*actuators.tendon_rows(width), *source_rows(description, routing, width)]
    pulling, sheaths = in_sheaths(tendons, pulling)
    drives = (*pulling, *sheaths[:2], *custom_drives)
    matrices = tendons.drive_matrices(drives)
    tendon_rows = [along_paths(description, paths, table) for table in tendons.rows(drives, len(actuators.inertias))]
    canals = Canals(description, paths, tendons, [*of_tree.values(), *tendon_rows], matrices, width)
    spring_table, *spring_hysteresis = springs.rows(width)
    further = [*spring_hysteresis, *dry_friction, *sheaths, *args.rows]
    tables = [
        *of_tree.values(),
        *tendon_rows,
        *canals.tables,
        joint_friction.rows(matrices, width, canals.loads),
        stroke_limiter.rows(width),
        spring_table,
        *actuators.rotor_rows(width),
        *(table for table in further if not table.pulls),
    ]
    alone = Mechanism(
        body,
        replace_tables(tables, args.tables),
        (*routing.passive_names, *(f"{name}.spool" for name in actuators.loose_names), *actuators.names),
        np.concatenate([tendons.mass, actuators.inertias]),
        # Also where a tendon's input goes nowhere: the second one of a spool has none.
        routing.actuated,
        moved=description.hand is not None and description.hand.palm.path is not None,
        prescribed=_numbers_on_paths(description, width),
        tendons=("passive_halves", "driven_tendons", *matrices, *canals.wraps),
    )
    scene = Scene.from_mechanism(alone, args.objects, description, paths.placed)
    mechanism = alone if scene is None else scene.extend(alone)
    layout = _state_layout(parts, further, scene, [*of_tree.values()], canals.tables, body.slides)
    check_layout(layout, mechanism)
    extra_rows = (*of_tree.values(), *canals.tables, *further)
    return Assembly(mechanism, scene, layout, matrices, canals.wraps, extra_rows)


def _numbers_on_paths(description: FingerDescription, width: int) -> NDArray[np.int64]:
    """Return numbers for the coordinates of joints with paths, -1 for the others, shape (N,)."""
    on_paths, numbers = description.tree.on_paths, np.full(width, -1)
    numbers[[k for k, name in enumerate(description.joints) if name in on_paths]] = np.arange(len(on_paths))
    return numbers


def _state_layout(
    parts: Parts,
    further: Sequence[Rows],
    scene: Scene | None,
    of_tree: Sequence[Rows],
    canals: Sequence[Rows],
    slides: Sequence[bool],
) -> Layout:
    """Return the layout of all blocks; ``further`` has drives among them, ``slides`` says which joints slide."""
    routing, tendons, motors, friction, *_ = parts
    drives, of_others = (
        state_scales([table for table in further if bool(table.pulls) == pulls]) for pulls in (True, False)
    )

    def dotted(names: Sequence[str], parts: str) -> list[str]:
        return [f"{name}.{part}" for name in names for part in parts.split()]

    free, world, touching = ((), (), ()) if scene is None else (tuple(scene.free), scene.world, scene.contacts.names)
    labels = {
        "position": routing.joints,
        "object_pose": dotted(free, "x y z qx qy qz qw"),
        "world_position": world,
        "passive_position": routing.passive_names,
        "spool_position": motors.loose_names,
        "motor_position": motors.names,
        "velocity": routing.joints,
        "object_velocity": dotted(free, "vx vy vz wx wy wz"),
        "world_velocity": world,
        "passive_velocity": routing.passive_names,
        "spool_velocity": motors.loose_names,
        "motor_velocity": motors.names,
        "contact_bend": dotted(touching, "1 2 3" if scene is not None and scene.contacts.law.arms > 3 else "1 2"),
        "actuator_state": [name for table in of_tree if table.states for name in table.names],
        "elastic_stiction": (
            *tendons.hysteretic_halves,
            *(routing.tendons[motors.tendons[k]] for k in motors.hysteretic_tendons),
        ),
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
    return Layout.from_labels(labels, scaled)


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


def _warn_of_turns(description: FingerDescription) -> None:
    """Warn of powers of an angle that may leave the half turn on either side of its range's middle."""
    for name, coupling in description.tree.couplings.items():
        if coupling.other is None or not any(coupling.higher):
            continue
        joint, hinge = description.joints[coupling.other], description.tree.joints[coupling.other].kind == "hinge"
        if hinge and not (joint.limited and np.ptp(joint.range) <= 2.0 * math.pi):
            warning = f"repeat where {coupling.other} turns by more than half a turn from its range's middle; limit it"
            warnings.warn(
                ScenarioWarning(f"{description.entry('tree.couplings', name)}.powers: {warning}"), stacklevel=4
            )
