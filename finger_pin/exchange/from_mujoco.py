"""A MuJoCo model as a description: bodies, joints, tendons, couplings and actuators; other elements are listed.

MuJoCo resolves defaults, classes and includes; what is read here is its compiled model (`mujoco.MjModel`).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.tree_parts import Tip
from finger_pin.description.validation import MOST_ANGLE, validate
from finger_pin.exceptions import InputError, LeftOutWarning
from finger_pin.exchange.mujoco_actuators import ActuatorReader
from finger_pin.exchange.mujoco_compliance import read_stops
from finger_pin.exchange.mujoco_equalities import linked_bodies, read_equalities
from finger_pin.exchange.mujoco_free import FreeBodies, MocapBodies
from finger_pin.exchange.mujoco_keyframes import read_keyframes
from finger_pin.exchange.mujoco_meshes import Meshes
from finger_pin.exchange.mujoco_names import Names, Table, entry_name, quaternion
from finger_pin.exchange.mujoco_overlay import add_tendons
from finger_pin.exchange.mujoco_shapes import Shapes
from finger_pin.exchange.mujoco_tendons import TendonReader, passed_bodies
from finger_pin.exchange.mujoco_unsupported import ElementReader, LeftOutElements, apply_flags, within_margin
from finger_pin.mechanism.body_places import rotation
from finger_pin.version import installing

_LEAST_FRICTION = 1e-7


def from_mujoco(
    model: Any,
    name: str = "hand",
    *,
    tendons: Mapping[str, Mapping[str, Any]] | str | Path | None = None,
    meshes: Mapping[str, str] | str = "fit",
) -> FingerDescription:
    """Return the description of a MuJoCo model, to be simulated, written with `to_toml` and changed by keys.

    Motors that can only pull a tendon, through space or around hinges, become tendons of the hand, with friction along
    their path and slack; their tension is their force, N. Other actuators exert what MuJoCo's do. Friction of tendons
    and joints, which MuJoCo has not, gets this package's defaults, but for viscous friction of joints, which is the
    model's. Other tendons rub alike where springs, ranges, servos or what drives their joint pull them. Ranges, less
    their margins, are guarded by (2), which is as stiff as ``solref`` and ``solimp`` ask at the model's own inertia, as
    are equalities. Joints' friction loss is the least level of (9). Without a keyframe, the reference is one. A free
    body that a tendon passes moves by three slides and three hinges, of which the second must not come to a right
    angle; others, and geoms of the world, become objects. Mocap bodies are led along the paths of six joints,
    ``tree.joints.NAME_x.path`` and so on. Names keep letters, digits and underscores: ``a/b`` is
    ``a_b``. What is not carried over stands in ``tree.left_out``, and is warned of where it moves or carries anything.

    Args:
        model: A `mujoco.MjModel`, or the path of an XML file.
        name: Of the hand.
        tendons: Tendons to lay over a model that has none, or not all; see `add_tendons`. The model has to be a file
            then, or a `mujoco.MjSpec`.
        meshes: What touches in the place of meshes that collide: with ``fit`` the primitive that fits the convex hull
            of each best, which is listed in ``tree.left_out`` with its distance; with ``none`` nothing; or a kind for
            all: sphere, box, capsule, cylinder or ellipsoid. A mapping gives one of these to geoms, meshes or bodies by
            name, and ``fit`` to others.

    Raises:
        InputError: If it is neither, MuJoCo refuses the file, it has ball joints or nothing that drives it, or there is
            no such choice for meshes, or no mesh that collides of such a name.
    """
    plugins: list[str] = []
    try:
        import mujoco
    except ImportError:
        raise InputError("model", f"needs MuJoCo: {installing('mujoco')}") from None
    if isinstance(model, str | Path) and Path(model).is_fifo():
        raise InputError(f"model {model}", "is a pipe, which may never end; give a file")
    if isinstance(model, str | Path | mujoco.MjSpec):
        try:
            spec = model.copy() if isinstance(model, mujoco.MjSpec) else mujoco.MjSpec.from_file(str(model))
            plugins = [plugin.plugin_name for plugin in spec.plugins]
            if tendons is not None:
                add_tendons(spec, tendons)
            model = spec.compile()
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"model {model}", " ".join(str(error).split())) from None
    elif tendons is not None:
        raise InputError("model", "must be a file or a mujoco.MjSpec to lay tendons over it", type(model).__name__)
    if not isinstance(model, mujoco.MjModel):
        raise InputError("model", "must be a mujoco.MjModel, or the path of an XML file", type(model).__name__)
    reader = _Reader(mujoco, model, plugins, meshes)
    description = reader.with_tips(validate(FingerDescription, reader.table(name), ("finger",)))
    if moving := reader.left_out.moving_lines():
        warnings.warn(LeftOutWarning(f"{name}: not carried over: {'; '.join(moving)}"), stacklevel=2)
    return description


class _Reader:
    """Reader of a MuJoCo model, element by element."""

    def __init__(self, mujoco: Any, model: Any, plugins: list[str], meshes: Mapping[str, str] | str) -> None:
        model = apply_flags(mujoco, model)
        self.left_out, self.names = LeftOutElements(mujoco, model), Names.from_model(model, plugins)
        self.meshes = Meshes(ElementReader(mujoco, model, self.names, self.left_out), meshes)
        self.mujoco, self.model = mujoco, self.meshes.model
        model = self.model
        self._reader = ElementReader(mujoco, model, self.names, self.left_out)
        self.shapes = Shapes(self._reader)
        kinds = mujoco.mjtJoint
        for i in np.flatnonzero(model.jnt_type == kinds.mjJNT_BALL):
            allowed = "is a ball joint; joints have to turn or slide about one axis"
            raise InputError(f"joint {self.names.joints[i]}", allowed)
        self.actuators = ActuatorReader(*vars(self._reader).values())
        self.kept_joints = [i for i in range(model.njnt) if model.jnt_type[i] != kinds.mjJNT_FREE]
        self.free = FreeBodies(self._reader, passed_bodies(self._reader))
        self.bodies = self._bodies()
        self.mocap = MocapBodies(self._reader, self.bodies, set(self.names.joints).union(*self.free.labels.values()))

    def table(self, name: str) -> Table:
        """Return the description as a table."""
        model = self.model
        if not self.kept_joints and not self.free.converted:
            allowed = "has no joint that turns or slides, nor a free body of several shapes or held by a tendon or loop"
            raise InputError("model", allowed)
        reader = TendonReader(*vars(self._reader).values())
        tendons = {self.names.tendons[i]: reader.table(i) for i in range(model.ntendon)}
        bodies = self.bodies
        actuators, pulled = self.actuators.table(), self.actuators.pulled_tendons()
        couplings, loops = read_equalities(self._reader)
        joints, moving, loss = self._joints()
        stops = read_stops(self._reader, joints)
        objects, pairs = self.shapes.objects(self.free.object_bodies), self.shapes.pairs(bodies)
        keyframes = read_keyframes(self._reader, self.actuators, self.free, self.mocap, self.shapes, self.kept_joints)
        self.shapes.set_apart(objects, bodies)
        return {
            "name": entry_name(name),
            "gravity": model.opt.gravity.tolist(),
            "joints": joints,
            "tendons": pulled,
            "joint_friction": {"viscous": 0.0, "floor": np.maximum(loss, _LEAST_FRICTION).tolist()},
            **({"stroke_limiter": stops} if stops else {}),
            "touches_itself": bool(pairs),
            "tree": {
                "bodies": self._world_body() | {self.names.bodies[i]: self._body(i) for i in bodies},
                "joints": moving,
                "tendons": tendons,
                "couplings": couplings,
                "loops": loops,
                "actuators": actuators,
                "keyframes": keyframes,
                "objects": objects,
                "touching": pairs,
                "meshes": self.meshes.surfaces(bodies),
                "left_out": self.left_out.lines(),
            },
        }

    def _joints(self) -> tuple[Table, Table, list[float]]:
        """Return the joints of the finger, those of its tree, and their losses by friction, in the bodies' order."""
        rows, model = list[tuple[int, str, Table, Table, float]](), self.model
        for i in self.kept_joints:
            loss = float(model.dof_frictionloss[model.jnt_dofadr[i]])
            rows.append((int(model.jnt_bodyid[i]), self.names.joints[i], self._joint(i), self._tree_joint(i), loss))
        free_joints = [(int(model.jnt_bodyid[i]), self.free.joints(i)) for i in self.free.converted]
        free_joints += [(body, self.mocap.joints(body)) for body in self.mocap.labels]
        rows += [(body, *joint, 0.0) for body, joints in free_joints for joint in joints]
        rows.sort(key=lambda row: row[0])
        return {row[1]: row[2] for row in rows}, {row[1]: row[3] for row in rows}, [row[4] for row in rows]

    def _bodies(self) -> list[int]:
        """Return the bodies that move, are passed by tendons, or carry such bodies, parents first."""
        model = self.model
        bodies = passed_bodies(self._reader, sides=True) | linked_bodies(self.mujoco, model)
        bodies |= self.shapes.fixed_bodies()
        moving: set[int] = set()
        for i in range(1, model.nbody):
            has_joints = any(model.jnt_bodyid[j] == i for j in (*self.kept_joints, *self.free.converted))
            if has_joints or int(model.body_parentid[i]) in moving:
                moving.add(i)
        bodies |= moving
        for i in range(model.nbody - 1, 0, -1):
            if i in bodies:
                bodies.add(int(model.body_parentid[i]))
        return sorted(bodies - {0})

    def _world_body(self) -> Table:
        """Return the body that has the shapes of the world; none without any."""
        shapes = self.shapes.body_shapes(0)
        return {self.names.bodies[0]: {"shapes": shapes, "solids": self.meshes.solids(0)}} if shapes else {}

    def _body(self, i: int) -> Table:
        model = self.model
        return {
            **self.names.carrier(int(model.body_parentid[i]), "parent"),
            "position": model.body_pos[i].tolist(),
            "orientation": quaternion(model.body_quat[i]),
            # A motion that is prescribed takes no mass.
            **({} if i in self.mocap else self._inertia(i)),
            "solids": self.meshes.solids(i),
            "shapes": self.shapes.body_shapes(i),
        }

    def _inertia(self, i: int) -> Table:
        model, axes = self.model, rotation(quaternion(self.model.body_iquat[i]))
        moments = axes @ np.diag(model.body_inertia[i]) @ axes.T
        return {
            "mass": float(model.body_mass[i]),
            "gravity_compensation": float(model.body_gravcomp[i]),
            "centre": model.body_ipos[i].tolist(),
            "inertia": [float(moments[indices]) for indices in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
        }

    def _joint(self, i: int) -> Table:
        model = self.model
        spring = {
            "stiffness": float(model.jnt_stiffness[i]),
            "rest": float(model.qpos_spring[model.jnt_qposadr[i]]),
            "damping": float(model.dof_damping[int(model.jnt_dofadr[i])]),
        }
        limited, ends = bool(model.jnt_limited[i]), within_margin(model.jnt_range[i], float(model.jnt_margin[i]))
        if limited and max(map(abs, ends)) > MOST_ANGLE:
            name = self.names.joints[i]
            self.left_out.add(f"joint {name}: its range {ends} is cut to {-MOST_ANGLE} and {MOST_ANGLE}")
            ends = np.clip(ends, -MOST_ANGLE, MOST_ANGLE).tolist()
            limited = ends[0] < ends[1]
        half_range = math.pi if model.jnt_type[i] == self.mujoco.mjtJoint.mjJNT_HINGE else 1.0
        return {
            "range": ends if limited else [-half_range, half_range],
            "limited": limited,
            **({"spring": spring} if spring["stiffness"] or spring["damping"] else {}),
        }

    def _tree_joint(self, i: int) -> Table:
        model, hinge = self.model, self.mujoco.mjtJoint.mjJNT_HINGE
        return {
            "body": self.names.bodies[model.jnt_bodyid[i]],
            "kind": "hinge" if model.jnt_type[i] == hinge else "slide",
            "axis": model.jnt_axis[i].tolist(),
            "anchor": model.jnt_pos[i].tolist(),
            "reference": float(model.qpos0[model.jnt_qposadr[i]]),
            "armature": float(model.dof_armature[model.jnt_dofadr[i]]),
        }

    def with_tips(self, description: FingerDescription) -> FingerDescription:
        """Return a description with fingertips: the first site called one on every link, and ends without such."""
        model, tree, sites = self.model, description.tree, dict[str, dict[str, Tip]]()
        jointed = self._jointed_bodies()
        for i in range(model.nsite):
            body = int(model.site_bodyid[i])
            carrier = tree.link_of(self.names.bodies[body]) if body in jointed else None
            if "tip" in model.site(i).name.lower() and carrier is not None:
                tip = Tip(body=self.names.bodies[body], position=model.site_pos[i].tolist())
                tip_name = entry_name(model.site(i).name).removesuffix("_fingertip")
                sites.setdefault(carrier, {tip_name: tip})
        free_names = {self.names.bodies[i] for i in (*self.free.labels, *self.mocap.labels)}
        every = not self.kept_joints
        ends = {name: {name: each} for name, each in tree.tips.items() if every or name not in free_names}
        tips = {name: tip for each in (ends | sites).values() for name, tip in each.items()}
        return description.updated(tree=tree.updated(tips=tips))

    def _jointed_bodies(self) -> set[int]:
        """Return the bodies that joints move which turn or slide."""
        parents, bodies = self.model.body_parentid, {int(self.model.jnt_bodyid[j]) for j in self.kept_joints}
        for i in range(1, self.model.nbody):
            bodies |= {i} if int(parents[i]) in bodies else set()
        return bodies
