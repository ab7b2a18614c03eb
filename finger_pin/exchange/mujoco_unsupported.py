"""Elements of a MuJoCo model switched off or not supported: flags applied, elements listed or refused by name."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.exchange.mujoco_names import Names, model_name
from finger_pin.typing import Array

# Arrays that each flag makes zero; older versions lack some.
_ZEROED = {
    "spring": ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_stiffnesspoly"),
    "damper": ("dof_damping", "dof_dampingpoly", "tendon_damping", "tendon_dampingpoly", "actuator_dampingpoly"),
    "gravity": ("body_gravcomp",),
    "frictionloss": ("dof_frictionloss", "tendon_frictionloss"),
    "limit": ("jnt_limited", "tendon_limited"),
    "equality": ("eq_active0",),
    "contact": ("geom_contype", "geom_conaffinity"),
    "clampctrl": ("actuator_ctrllimited",),
}
# Kind of element, array, and feature that is listed where the array is not zero.
_LISTED = (
    ("joint", "jnt_stiffnesspoly", "a stiffness that grows with the deflection"),
    ("joint", "dof_dampingpoly", "damping that grows with the speed"),
    ("joint", "jnt_springyield", "a spring that yields"),
    ("tendon", "tendon_armature", "armature"),
    ("tendon", "tendon_stiffnesspoly", "a stiffness that grows with the stretch"),
    ("tendon", "tendon_dampingpoly", "damping that grows with the speed"),
    ("tendon", "tendon_springyield", "a spring that yields"),
    ("geom", "geom_adhesion", "adhesion"),
    ("geom", "geom_surfacevel", "a surface that moves, as a belt does"),
    ("pair", "pair_adhesion", "adhesion"),
    ("pair", "pair_solreffriction", "solreffriction, by which what sticks creeps"),
    ("actuator", "actuator_dampingpoly", "damping that grows with the speed"),
)
# MuJoCo's default.
_DEFAULT_SOLREF = 0.02, 1.0
_CONSTRAINTS = {"frictionloss", "limit", "equality", "contact"}
# Flags that are obeyed elsewhere.
_HANDLED_ELSEWHERE = {"constraint", "filterparent", "actuation"}


class LeftOutElements:
    """Elements left out of a model.

    Attributes:
        mujoco: The module.
        model: The compiled model.
    """

    def __init__(self, mujoco: Any, model: Any) -> None:
        """Check all elements but equalities and actuators."""
        self.mujoco, self.model = mujoco, model
        self._lines: list[str] = []
        self._moving_lines: list[str] = []
        for what, array, feature in _LISTED:
            self._list_nonzero(what, array, feature)
        self._list_creep("joint", model.dof_frictionloss > 0.0, model.dof_solref, model.dof_jntid)
        lossy = model.tendon_frictionloss > 0.0
        self._list_creep("tendon", lossy, model.tendon_solref_fri, range(model.ntendon))
        if "contact" in disabled(mujoco, model):
            self.add("contacts are disabled in the model: its geoms touch nothing", moves=False)
        flags = without_counterpart(mujoco, model)
        if flags:
            self.add(f"flags about how MuJoCo computes: {', '.join(flags)}", moves=False)
        if "override" in _flag_names(mujoco.mjtEnableBit, model.opt.enableflags):
            self.add("override of the margin, solref and solimp of contacts", moves=False)
        if model.opt.density or model.opt.viscosity:
            self.add("the medium: nothing is dragged")
        for count, what in (
            (model.nflex, "flexible bodies"),
            (model.nplugin - len(set(model.actuator_plugin[model.actuator_plugin >= 0])), "plugins"),
        ):
            if count:
                self.add(f"{what}: {count}")

    def lines(self) -> list[str]:
        """Return the elements left out, a line each."""
        return list(dict.fromkeys(self._lines))

    def moving_lines(self) -> list[str]:
        """Return the lines about elements that move or carry something."""
        return list(dict.fromkeys(self._moving_lines))

    def add(self, line: str, moves: bool = True) -> None:
        """List an unsupported element and whether it moves or carries anything."""
        self._lines.append(line)
        if moves:
            self._moving_lines.append(line)

    def _list_nonzero(self, what: str, attribute: str, feature: str) -> None:
        """List every element with a nonzero attribute that older versions lack."""
        values = getattr(self.model, attribute, None)
        if values is None or not len(values):
            return
        for i in np.flatnonzero(np.any(np.reshape(values, (len(values), -1)), axis=1)):
            self.add(f"{self._name(what, self.model.dof_jntid[i] if attribute.startswith('dof') else i)}: {feature}")

    def _list_creep(self, what: str, lossy: NDArray[np.bool_], solref: NDArray[np.float64], owner: Any) -> None:
        """List dry friction with a ``solreffriction`` of its own, which is not read."""
        for i in np.flatnonzero(lossy & np.any(solref != _DEFAULT_SOLREF, axis=1)):
            self.add(f"{self._name(what, owner[i])}: solreffriction, by which its dry friction creeps", moves=False)

    def _name(self, what: str, i: Any) -> str:
        return f"{what} {model_name(self.model, what, i)}"


@dataclass(frozen=True, eq=False)
class ElementReader:
    """The model that readers of its elements share.

    Attributes:
        mujoco: The module.
        model: The compiled model.
        names: Of its elements.
        left_out: List of the elements left out.
    """

    mujoco: Any
    model: Any
    names: Names
    left_out: LeftOutElements

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Mask of the bodies that joints move, shape (nbody,): the world and mocap bodies stand still."""
        weld = self.model.body_weldid
        return np.asarray((weld > 0) & (self.model.body_mocapid[weld] < 0))

    @property
    def colliding(self) -> list[int]:
        """Geoms that touch something by their bits, or by a pair that is listed."""
        model, pairs = self.model, "contact" not in disabled(self.mujoco, self.model)
        listed = {int(each) for each in (*model.pair_geom1, *model.pair_geom2) if pairs}
        return [i for i in range(model.ngeom) if model.geom_contype[i] or model.geom_conaffinity[i] or i in listed]

    def start_data(self, keyframe: int = 0) -> Any:
        """Return the model's data where runs start: at a keyframe, or at its reference without any."""
        data = self.mujoco.MjData(self.model)
        if self.model.nkey:
            self.mujoco.mj_resetDataKeyframe(self.model, data, keyframe)
        data.qpos[:] = self.at_edges(data.qpos)
        self.mujoco.mj_kinematics(self.model, data)
        self.mujoco.mj_comPos(self.model, data)
        self.mujoco.mj_comVel(self.model, data)
        return data

    def at_edges(self, qpos: Array) -> Array:
        """Return positions whose joints beyond their ranges are at the edges, which only equalities can forbid."""
        model, placed = self.model, np.array(qpos)
        if not np.any(model.eq_active0):
            for i in np.flatnonzero(model.jnt_limited & (model.jnt_type != self.mujoco.mjtJoint.mjJNT_BALL)):
                low, high = within_margin(model.jnt_range[i], float(model.jnt_margin[i]))
                placed[model.jnt_qposadr[i]] = np.clip(placed[model.jnt_qposadr[i]], low, high)
        return placed


def within_margin(ends: Array, margin: float) -> list[float]:
    """Return a range less its margin at both ends: no less than its middle, where both ends push."""
    low, high = (float(each) for each in ends)
    middle, half = 0.5 * (low + high), max(0.5 * (high - low) - margin, 1e-9 + 1e-6 * (high - low))
    return [middle - half, middle + half] if margin else [low, high]


def _flag_names(bits: Any, value: int) -> set[str]:
    return {name.split("_")[1].lower() for name, bit in bits.__members__.items() if "_" in name and value & int(bit)}


def disabled(mujoco: Any, model: Any) -> set[str]:
    """Return the flags that a model disables, by the names that its XML has for them."""
    flags = _flag_names(mujoco.mjtDisableBit, model.opt.disableflags)
    return flags | (_CONSTRAINTS if "constraint" in flags else set())


def apply_flags(mujoco: Any, model: Any) -> Any:
    """Return a copy of a model without the elements that its flags disable, and with the friction that they set.

    Mocap bodies are where the first keyframe has them.
    """
    copied = copy.copy(model)
    if model.nkey:
        mocap = np.flatnonzero(model.body_mocapid >= 0)
        copied.body_pos[mocap] = model.key_mpos[0].reshape(-1, 3)[model.body_mocapid[mocap]]
        copied.body_quat[mocap] = model.key_mquat[0].reshape(-1, 4)[model.body_mocapid[mocap]]
    flags = disabled(mujoco, model)
    if hasattr(model, "actuator_armature"):
        _add_actuator_inertia(mujoco, copied)
    for array in (name for flag in flags & set(_ZEROED) for name in _ZEROED[flag]):
        values = getattr(copied, array, None)
        if values is not None:
            values[:] = 0
    if "gravity" in flags:
        copied.opt.gravity[:] = 0.0
    if "override" in _flag_names(mujoco.mjtEnableBit, model.opt.enableflags):
        copied.geom_friction[:, 0] = copied.pair_friction[:, 0] = model.opt.o_friction[0]
    return copied


def _add_actuator_inertia(mujoco: Any, model: Any) -> None:
    """Add armature and damping of actuators to the joints or tendons that they drive."""
    for i in np.flatnonzero(model.actuator_armature + model.actuator_damping):
        target, ratio = int(model.actuator_trnid[i, 0]), float(model.actuator_gear[i, 0]) ** 2
        if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON:
            damping, armature = model.tendon_damping, model.tendon_armature
        elif model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_SITE:
            continue
        elif model.jnt_type[target] != mujoco.mjtJoint.mjJNT_FREE:
            damping, armature, target = model.dof_damping, model.dof_armature, int(model.jnt_dofadr[target])
        else:
            continue
        damping[target] += ratio * model.actuator_damping[i]
        armature[target] += ratio * model.actuator_armature[i]


def without_counterpart(mujoco: Any, model: Any) -> list[str]:
    """Return the flags of a model that mean nothing here: those of MuJoCo's way of computing."""
    enabled = _flag_names(mujoco.mjtEnableBit, model.opt.enableflags) - {"override"}
    return sorted(disabled(mujoco, model) - set(_ZEROED) - _HANDLED_ELSEWHERE | enabled)


def is_disabled(mujoco: Any, model: Any, actuator: int) -> str | None:
    """Return the reason for which an actuator does not act, or not as it seems, or None."""
    if "actuation" in disabled(mujoco, model):
        return "actuation is disabled in the model"
    disabled_group = model.opt.disableactuator & (1 << int(model.actuator_group[actuator]))
    return f"its group {int(model.actuator_group[actuator])} is disabled in the model" if disabled_group else None
