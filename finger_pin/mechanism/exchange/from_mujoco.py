"""A MuJoCo model as a description: bodies, joints, tendons, couplings and actuators; other elements are listed.

MuJoCo resolves defaults, classes and includes; what is read here is its compiled model (`mujoco.MjModel`).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from finger_pin.description.meshes import Mesh
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.description.validation import MOST_ANGLE, validate
from finger_pin.exceptions import InputError
from finger_pin.mechanism.exchange.mujoco_actuators import ActuatorReader
from finger_pin.mechanism.exchange.mujoco_equalities import read_equalities
from finger_pin.mechanism.exchange.mujoco_flags import obeyed
from finger_pin.mechanism.exchange.mujoco_names import Names, Table, entry_name, quaternion
from finger_pin.mechanism.exchange.mujoco_overlay import lay_tendons
from finger_pin.mechanism.exchange.mujoco_shapes import Shapes
from finger_pin.mechanism.exchange.mujoco_tendons import STOP, TendonReader
from finger_pin.mechanism.exchange.mujoco_unsupported import ElementReader, Rest
from finger_pin.mechanism.routes import rotation

# Stiffness with which the range of a joint stops it where it slides, N/m.
_STOP_SLIDING = 1e4
_LEAST_FRICTION = 1e-7
# Groups from this one on are hidden in MuJoCo's viewer, unless one asks for them.
_HIDDEN = 3


def from_mujoco(
    model: Any, name: str = "hand", *, tendons: Mapping[str, Mapping[str, Any]] | str | Path | None = None
) -> FingerDescription:
    """Return the description of a MuJoCo model, to be simulated, written with `to_toml` and changed by keys.

    Motors that can only pull a tendon, through space or around hinges, become tendons of the hand, with friction along
    their path and slack; their tension is their force, N. Other actuators exert what MuJoCo's do. Friction of tendons
    and joints, which MuJoCo has not, gets this package's defaults, but for viscous friction of joints, which is the
    model's. Ranges are guarded by (2) in place of MuJoCo's soft constraints. Joints' friction loss is the least level
    of (9). What is not carried over stands in ``tree.left_out``.

    Args:
        model: A `mujoco.MjModel`, or the path of an XML file.
        name: Of the hand.
        tendons: Tendons to lay over a model that has none, or not all; see `lay_tendons`. The model has to be a file
            then, or a `mujoco.MjSpec`.

    Raises:
        InputError: If it is neither, MuJoCo refuses the file, or it has muscles, ball joints or nothing that drives it.
    """
    try:
        import mujoco
    except ImportError:
        raise InputError("model", "needs MuJoCo: pip install 'finger-pin[mujoco]'") from None
    if isinstance(model, str | Path | mujoco.MjSpec):
        try:
            spec = model.copy() if isinstance(model, mujoco.MjSpec) else mujoco.MjSpec.from_file(str(model))
            if tendons is not None:
                lay_tendons(spec, tendons)
            model = spec.compile()
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"model {model}", " ".join(str(error).split())) from None
    elif tendons is not None:
        raise InputError("model", "must be a file or a mujoco.MjSpec to lay tendons over it", type(model).__name__)
    if not isinstance(model, mujoco.MjModel):
        raise InputError("model", "must be a mujoco.MjModel, or the path of an XML file", type(model).__name__)
    return validate(FingerDescription, _Reader(mujoco, model).table(name), ("finger",))


class _Reader:
    """Reads a model, element by element."""

    def __init__(self, mujoco: Any, model: Any) -> None:
        self.mujoco, self.model = mujoco, obeyed(mujoco, model)
        model = self.model
        self.rest = Rest(mujoco, model)
        self.names = Names.of(model)
        self._read = ElementReader(mujoco, model, self.names, self.rest)
        self.shapes = Shapes(self._read)
        kinds = mujoco.mjtJoint
        for i in np.flatnonzero(model.jnt_type == kinds.mjJNT_BALL):
            raise InputError(
                f"joint {self.names.joints[i]}", "is a ball joint; joints have to turn or slide about one axis"
            )
        self.actuators = ActuatorReader(*vars(self._read).values())
        self.kept_joints = [i for i in range(model.njnt) if model.jnt_type[i] != kinds.mjJNT_FREE]

    def table(self, name: str) -> Table:
        """Return the description as a table."""
        model = self.model
        if not self.kept_joints:
            raise InputError("model", "has no joints that turn or slide")
        dofs = model.jnt_dofadr[self.kept_joints]
        sliding = model.jnt_type[self.kept_joints] == self.mujoco.mjtJoint.mjJNT_SLIDE
        reader = TendonReader(*vars(self._read).values())
        tendons = {self.names.tendons[i]: reader.table(i) for i in range(model.ntendon)}
        bodies = self._bodies()
        actuators, pulled = self.actuators.table(), self.actuators.pulled()
        couplings, differences = read_equalities(self._read)
        return {
            "name": entry_name(name),
            "gravity": model.opt.gravity.tolist(),
            "joints": {self.names.joints[i]: self._joint(i) for i in self.kept_joints},
            "tendons": pulled,
            "joint_friction": {
                "viscous": 0.0,
                "floor": np.maximum(model.dof_frictionloss[dofs], _LEAST_FRICTION).tolist(),
            },
            "stroke_limiter": {"stiffness": np.where(sliding, _STOP_SLIDING, STOP).tolist()},
            "tree": {
                "bodies": {self.names.bodies[i]: self._body(i) for i in bodies},
                "joints": {self.names.joints[i]: self._moving(i) for i in self.kept_joints},
                "tendons": tendons | {_free(name, tendons): each for name, each in differences.items()},
                "couplings": couplings,
                "actuators": actuators,
                "tip": self._tip(),
                "touching": self.shapes.pairs(bodies),
                "meshes": self._meshes(bodies),
                "left_out": self.rest.listed(),
            },
        }

    def _bodies(self) -> list[int]:
        """Return the bodies that move, that tendons pass or that carry these, parents first."""
        model, types = self.model, self.mujoco.mjtWrap
        sites = model.wrap_objid[model.wrap_type == types.mjWRAP_SITE]
        wraps = model.wrap_objid[(model.wrap_type == types.mjWRAP_SPHERE) | (model.wrap_type == types.mjWRAP_CYLINDER)]
        needed = {int(each) for each in (*model.site_bodyid[sites], *model.geom_bodyid[wraps])}
        needed |= {self._tip_body()[0]}
        moved: set[int] = set()
        for i in range(1, model.nbody):
            own = any(model.jnt_bodyid[j] == i for j in self.kept_joints)
            if own or int(model.body_parentid[i]) in moved:
                moved.add(i)
        needed |= moved
        for i in range(model.nbody - 1, 0, -1):
            if i in needed:
                needed.add(int(model.body_parentid[i]))
        return sorted(needed - {0})

    def _body(self, i: int) -> Table:
        model = self.model
        turned = rotation(quaternion(model.body_iquat[i]))
        moments = turned @ np.diag(model.body_inertia[i]) @ turned.T
        return {
            **self.names.carrier(int(model.body_parentid[i]), "parent"),
            "position": model.body_pos[i].tolist(),
            "orientation": quaternion(model.body_quat[i]),
            "mass": float(model.body_mass[i]),
            "centre": model.body_ipos[i].tolist(),
            "inertia": [float(moments[place]) for place in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
            "solids": self._solids(i),
            "shapes": self.shapes.of_body(i),
        }

    def _solids(self, body: int) -> Table:
        """Return the visible geoms of a body, or all if none is; meshes of moving bodies only."""
        model, kinds, found = self.model, self.mujoco.mjtGeom, {}
        own = np.flatnonzero(model.geom_bodyid == body)
        shown = own[model.geom_group[own] < _HIDDEN]
        for i in shown if len(shown) else own:
            kind, size = model.geom_type[i], model.geom_size[i]
            place = {"position": model.geom_pos[i].tolist(), "orientation": quaternion(model.geom_quat[i])}
            radius, length = float(size[0]), 2.0 * float(size[1])
            if kind == kinds.mjGEOM_SPHERE:
                found[self.names.geoms[i]] = {"kind": "sphere", "radius": radius, **place}
            elif kind == kinds.mjGEOM_CAPSULE or kind == kinds.mjGEOM_CYLINDER:
                name = "capsule" if kind == kinds.mjGEOM_CAPSULE else "cylinder"
                found[self.names.geoms[i]] = {"kind": name, "radius": radius, "length": length, **place}
            elif kind == kinds.mjGEOM_BOX or kind == kinds.mjGEOM_ELLIPSOID:
                found[self.names.geoms[i]] = {"kind": "box", "sides": (2.0 * size).tolist(), **place}
            elif kind == kinds.mjGEOM_MESH and model.body_weldid[body]:
                # A forearm that stands still would be in the way.
                name = self.names.meshes[model.geom_dataid[i]]
                found[self.names.geoms[i]] = {"kind": "mesh", "mesh": name, **place}
        return found

    def _meshes(self, bodies: list[int]) -> Table:
        """Return the meshes that the solids of bodies are made of."""
        model, names = self.model, self.names.meshes
        used = {solid.get("mesh") for i in bodies for solid in self._solids(i).values()}
        found = {}
        for i in range(model.nmesh):
            points = slice(model.mesh_vertadr[i], model.mesh_vertadr[i] + model.mesh_vertnum[i])
            faces = slice(model.mesh_faceadr[i], model.mesh_faceadr[i] + model.mesh_facenum[i])
            if names[i] in used:
                found[names[i]] = Mesh.packed(model.mesh_vert[points], model.mesh_face[faces])
        return found

    def _joint(self, i: int) -> Table:
        model, dof = self.model, int(self.model.jnt_dofadr[i])
        spring = {
            "stiffness": float(model.jnt_stiffness[i]),
            "rest": float(model.qpos_spring[model.jnt_qposadr[i]]),
            "damping": float(model.dof_damping[dof]),
        }
        limited = bool(model.jnt_limited[i])
        return {
            "range": model.jnt_range[i].tolist() if limited else [-MOST_ANGLE, MOST_ANGLE],
            **({"spring": spring} if spring["stiffness"] or spring["damping"] else {}),
        }

    def _moving(self, i: int) -> Table:
        model = self.model
        hinge = model.jnt_type[i] == self.mujoco.mjtJoint.mjJNT_HINGE
        return {
            "body": self.names.bodies[model.jnt_bodyid[i]],
            "kind": "hinge" if hinge else "slide",
            "axis": model.jnt_axis[i].tolist(),
            "anchor": model.jnt_pos[i].tolist(),
            "reference": float(model.qpos0[model.jnt_qposadr[i]]),
            "armature": float(model.dof_armature[model.jnt_dofadr[i]]),
        }

    def _tip_body(self) -> tuple[int, Array]:
        """Return a body and a point of it: the first site called a tip, or the origin of the last body that moves."""
        model = self.model
        for i in range(model.nsite):
            if "tip" in model.site(i).name.lower() and model.body_weldid[model.site_bodyid[i]]:
                return int(model.site_bodyid[i]), model.site_pos[i]
        return int(model.jnt_bodyid[self.kept_joints[-1]]), np.zeros(3)

    def _tip(self) -> Table:
        body, position = self._tip_body()
        return {**self.names.carrier(body, "body"), "position": position.tolist()}


def _free(name: str, taken: Table) -> str:
    """Return a name that is not taken."""
    return _free(f"{name}_equality", taken) if name in taken else name
