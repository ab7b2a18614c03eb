"""What a MuJoCo model's flags switch off, in the model itself, so that nobody else has to ask for them."""

from __future__ import annotations

import copy
from typing import Any

# What each flag takes out: the arrays that it makes zero.
_ZEROED = {
    "mjDSBL_SPRING": ("jnt_stiffness", "tendon_stiffness"),
    "mjDSBL_DAMPER": ("dof_damping", "tendon_damping"),
    "mjDSBL_FRICTIONLOSS": ("dof_frictionloss", "tendon_frictionloss"),
    "mjDSBL_LIMIT": ("jnt_limited", "tendon_limited"),
    "mjDSBL_EQUALITY": ("eq_active0",),
    "mjDSBL_CLAMPCTRL": ("actuator_ctrllimited",),
}


def obeyed(mujoco: Any, model: Any) -> Any:
    """Return a copy of a model without what its flags for springs, dampers, losses, limits and equalities disable."""
    found = copy.copy(model)
    for name, arrays in _ZEROED.items():
        if model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, name)):
            for array in arrays:
                getattr(found, array)[:] = 0
    return found


def undriven(mujoco: Any, model: Any, actuator: int) -> str | None:
    """Return why an actuator does not act, or not as it seems; None where it does."""
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION):
        return "actuation is disabled in the model"
    if model.opt.disableactuator & (1 << int(model.actuator_group[actuator])):
        return f"its group {int(model.actuator_group[actuator])} is disabled in the model"
    delay = getattr(model, "actuator_delay", None)
    return "its control is delayed" if delay is not None and delay[actuator] > 0.0 else None
