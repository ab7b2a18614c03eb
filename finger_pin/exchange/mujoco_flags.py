"""Flags of a MuJoCo model, carried out in the model itself, so that nobody else has to ask for them."""

from __future__ import annotations

import copy
from typing import Any

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
