"""Elements of a MuJoCo model switched off or not supported: flags applied, elements listed or refused by name."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.exchange.mujoco_names import Names

# What each flag takes out: the arrays that it makes zero; older versions lack some.
_ZEROED = {
    "spring": ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_stiffnesspoly"),
    "damper": ("dof_damping", "dof_dampingpoly", "tendon_damping", "tendon_dampingpoly"),
    "gravity": ("body_gravcomp",),
    "frictionloss": ("dof_frictionloss", "tendon_frictionloss"),
    "limit": ("jnt_limited", "tendon_limited"),
    "equality": ("eq_active0",),
    "contact": ("geom_contype", "geom_conaffinity"),
    "clampctrl": ("actuator_ctrllimited",),
}
_CONSTRAINTS = {"frictionloss", "limit", "equality", "contact"}
# Obeyed elsewhere.
_ASKED_FOR = {"constraint", "filterparent", "actuation"}


class Rest:
    """Elements left out of a model.

    Attributes:
        mujoco: The module.
        model: The compiled model.
    """

    def __init__(self, mujoco: Any, model: Any) -> None:
        """Check all elements but equalities and actuators."""
        self.mujoco, self.model = mujoco, model
        self._listed: list[str] = []
        self._moving: list[str] = []
        self._every("joint", "jnt_stiffnesspoly", "a stiffness that grows with the deflection")
        self._every("joint", "dof_dampingpoly", "damping that grows with the speed", by_dof=True)
        self._every("joint", "jnt_springyield", "a spring that yields")
        self._every("tendon", "tendon_actfrclimited", "a limit on what actuators exert on it together")
        self._every("tendon", "tendon_armature", "armature")
        self._every("tendon", "tendon_stiffnesspoly", "a stiffness that grows with the stretch")
        self._every("tendon", "tendon_dampingpoly", "damping that grows with the speed")
        self._every("tendon", "tendon_springyield", "a spring that yields")
        if "contact" in disabled(mujoco, model):
            self.add("contacts are disabled in the model: its geoms touch nothing", moves=False)
        flags = without_counterpart(mujoco, model)
        if flags:
            self.add(f"flags about how MuJoCo computes: {', '.join(flags)}", moves=False)
        if model.opt.density or model.opt.viscosity:
            self.add("the medium: nothing is dragged")
        for count, what in (
            (model.nflex, "flexible bodies"),
            (model.nplugin - len(set(model.actuator_plugin[model.actuator_plugin >= 0])), "plugins"),
            (model.nmocap, "mocap bodies"),
        ):
            if count:
                self.add(f"{what}: {count}", moves=what != "mocap bodies")

    def listed(self) -> list[str]:
        """Return the elements left out, a line each."""
        return list(dict.fromkeys(self._listed))

    def moving(self) -> list[str]:
        """Return those among them that move or carry something, a line each."""
        return list(dict.fromkeys(self._moving))

    def add(self, line: str, moves: bool = True) -> None:
        """List an unsupported element and whether it moves or carries anything."""
        self._listed.append(line)
        if moves:
            self._moving.append(line)

    def _every(self, what: str, attribute: str, has: str, by_dof: bool = False) -> None:
        """List every element with a nonzero attribute that older versions lack."""
        values = getattr(self.model, attribute, None)
        if values is None or not len(values):
            return
        for i in np.flatnonzero(np.any(np.reshape(values, (len(values), -1)), axis=1)):
            index = self.model.dof_jntid[i] if by_dof else i
            name = getattr(self.model, what)(index).name or f"{what}_{index}"
            self.add(f"{what} {name}: {has}")


@dataclass(frozen=True, eq=False)
class ElementReader:
    """The model that readers of its elements share.

    Attributes:
        mujoco: The module.
        model: The compiled model.
        names: Of its elements.
        rest: List of the elements left out.
    """

    mujoco: Any
    model: Any
    names: Names
    rest: Rest


def _set(bits: Any, value: int) -> set[str]:
    return {name.split("_")[1].lower() for name, bit in bits.__members__.items() if "_" in name and value & int(bit)}


def disabled(mujoco: Any, model: Any) -> set[str]:
    """Return the flags that a model disables, by the names that its XML has for them."""
    found = _set(mujoco.mjtDisableBit, model.opt.disableflags)
    return found | (_CONSTRAINTS if "constraint" in found else set())


def apply_flags(mujoco: Any, model: Any) -> Any:
    """Return a copy of a model without the elements that its flags disable, and with the friction that they set."""
    found = copy.copy(model)
    flags = disabled(mujoco, model)
    for array in (each for flag in flags & set(_ZEROED) for each in _ZEROED[flag]):
        values = getattr(found, array, None)
        if values is not None:
            values[:] = 0
    if "gravity" in flags:
        found.opt.gravity[:] = 0.0
    if "override" in _set(mujoco.mjtEnableBit, model.opt.enableflags):
        found.geom_friction[:, 0] = model.opt.o_friction[0]
    return found


def without_counterpart(mujoco: Any, model: Any) -> list[str]:
    """Return the flags of a model that mean nothing here: those of MuJoCo's way of computing."""
    enabled = _set(mujoco.mjtEnableBit, model.opt.enableflags) - {"override"}
    return sorted(disabled(mujoco, model) - set(_ZEROED) - _ASKED_FOR | enabled)


def is_disabled(mujoco: Any, model: Any, actuator: int) -> str | None:
    """Return the reason for which an actuator does not act, or not as it seems, or None."""
    if "actuation" in disabled(mujoco, model):
        return "actuation is disabled in the model"
    if model.opt.disableactuator & (1 << int(model.actuator_group[actuator])):
        return f"its group {int(model.actuator_group[actuator])} is disabled in the model"
    delay = getattr(model, "actuator_delay", None)
    return "its control is delayed" if delay is not None and delay[actuator] > 0.0 else None
