"""Frictions as arrays on the device, and the rows of the solver that they need."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
import warp as wp

from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_friction import BRANCH, LEAST_LOSS, LINK, PIN, PluginFriction
from finger_pin.mujoco.warp.names import NamedModel
from finger_pin.mujoco.warp.structures import Table
from finger_pin.typing import Array

# Number of rows of equalities by kind, else one; MuJoCo Warp counts those of flexes.
_EQUALITY_ROWS = {mujoco.mjtEq.mjEQ_CONNECT: 3, mujoco.mjtEq.mjEQ_WELD: 6}


def build_table(model: NamedModel, plugin_frictions: list[PluginFriction]) -> Table:
    """Return the table of frictions on the present device."""
    index = {(each.of_joint, each.name): f for f, each in enumerate(plugin_frictions)}
    rows = [_row(model, each) for each in plugin_frictions]
    row_indices = {row: k for k, row in enumerate(dict.fromkeys(rows))}
    trunks = [index[False, each.linked[0][1]] if each.kind == BRANCH else f for f, each in enumerate(plugin_frictions)]
    t = Table()
    t.kind, t.row, t.trunk = _ints(each.kind for each in plugin_frictions), _ints(rows), _ints(trunks)
    t.element = _ints((model.joint if each.of_joint else model.tendon)(each.name).id for each in plugin_frictions)
    t.ratio = wp.array([each.ratio for each in plugin_frictions], dtype=float)
    shares = [each.linked[0][2] if each.kind == BRANCH else each.share for each in plugin_frictions]
    t.share, t.constrained = wp.array(shares, dtype=float), _ints(each.constrained for each in plugin_frictions)
    t.tendons = _ints(f for f, each in enumerate(plugin_frictions) if not each.of_joint)
    t.pins = _ints(f for f, each in enumerate(plugin_frictions) if each.of_joint)
    t.actuators_first, t.actuators = _lists(_actuators(model, plugin_frictions[trunk]) for trunk in trunks)
    crossed = [[each for each in friction.linked if each[0]] for friction in plugin_frictions]
    t.bends_first, t.bends = _lists([model.joint(name).id for _, name, _ in each] for each in crossed)
    t.weights = wp.array(np.array([weight for each in crossed for *_, weight in each], np.float32), dtype=float)
    loads = [
        [f for f, each in enumerate(crossed) if any(name == friction.name for _, name, _ in each)]
        if friction.kind == PIN
        else []
        for friction in plugin_frictions
    ]
    t.loads_first, t.loads = _lists(loads)
    t.sharing_first, t.sharing = _lists([f for f, row in enumerate(rows) if row == each] for each in row_indices)
    t.row_of = _ints(row_indices.get(row, -1) for row in range(model.nv + model.ntendon))
    return t


def _ints(values: Iterable[Any]) -> Any:
    return wp.array(np.array([int(each) for each in values], np.int32), dtype=int)


def _lists(values: Iterable[list[int]]) -> tuple[Any, Any]:
    """Return where each list starts, with the end of the last, and all lists one after the other."""
    lists = list(values)
    return _ints(np.cumsum([0, *map(len, lists)])), _ints(one for each in lists for one in each)


def _row(model: NamedModel, friction: PluginFriction) -> int:
    if friction.row_of_joint:
        return int(model.jnt_dofadr[model.joint(friction.row).id])
    return int(model.nv) + model.tendon(friction.row).id


def _actuators(model: NamedModel, friction: PluginFriction) -> list[int]:
    """Return the actuators on a tendon, or of a link on its joint."""
    kinds = mujoco.mjtTrn
    if friction.kind == PIN:
        return []
    transmissions, target = [kinds.mjTRN_TENDON], model.tendon(friction.name).id
    if friction.kind == LINK:
        transmissions, target = [kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT], model.joint(friction.row).id
    is_acting = np.isin(model.actuator_trntype, [int(each) for each in transmissions])
    return [int(each) for each in np.flatnonzero(is_acting & (model.actuator_trnid[:, 0] == target))]


def losses(model: NamedModel, plugin_frictions: list[PluginFriction]) -> tuple[Array, Array]:
    """Return the least friction losses of degrees of freedom, shape (nv,), and tendons, by which they have rows."""
    least = np.zeros(model.nv + model.ntendon)
    for friction in plugin_frictions:
        row = _row(model, friction)
        least[row] = max(least[row], abs(friction.ratio) * friction.least_level, LEAST_LOSS)
    return least[: model.nv], least[model.nv :]


def check_rows(model: NamedModel, data: Any, of_dofs: Array, of_tendons: Array) -> None:
    """Refuse data without room for the rows that come before those of contacts, which MuJoCo Warp would leave out."""
    dofs_with_loss = (of_dofs > 0.0) | (model.dof_frictionloss > 0.0)
    tendons_with_loss = (of_tendons > 0.0) | (model.tendon_frictionloss > 0.0)
    limited = model.tendon_limited.astype(bool)
    equalities = sum(_EQUALITY_ROWS.get(mujoco.mjtEq(int(kind)), 1) for kind in model.eq_type)
    fixed = int(dofs_with_loss.sum() + model.jnt_limited.sum())
    required = {"njmax": equalities + fixed + int(tendons_with_loss.sum() + limited.sum())}
    if data.njmax_nnz and data.efc.J_rownnz.shape[-1]:
        entries = model.ten_J_rownnz
        required["njmax_nnz"] = fixed + int(entries[tendons_with_loss].sum() + entries[limited].sum())
    for name, least in required.items():
        if getattr(data, name) < least:
            reason = f"must be at least {least}, for rows of equalities, frictions and limits, and more for contacts"
            raise InputError(f"d.{name}", reason, getattr(data, name))
