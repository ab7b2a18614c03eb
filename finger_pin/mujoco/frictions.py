"""The frictions of a compiled MuJoCo model: their elements, rows of the solver, and loads."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings, bristles
from finger_pin.description.parameters import per_item
from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_friction import BRANCH, LINK, PIN, TENDON, Coefficients, PluginFriction
from finger_pin.mujoco.name_matching import RoutedFriction
from finger_pin.typing import Array

# Kinds of joints that have one coordinate.
_SINGLE = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
# Fixed tendons whose coefficients agree to this share are parallel.
_PARALLEL = 1e-9
# Coefficients that settings of tendons and of joints both state as they are.
_SAME_KEYS = ("coulomb", "viscous", "stribeck_velocity", "stribeck_exponent", "micro_damping")


def frictions(
    model: mujoco.MjModel,
    tendons: dict[str, tuple[Any, bool]],
    joints: dict[str, tuple[Any, bool]],
    branches: dict[str, list[tuple[str, float]]],
) -> list[PluginFriction]:
    """Return the frictions that users have asked for, folded into as few rows as hold them.

    A fixed tendon over one joint acts in that joint's row, and fixed tendons that are multiples of each other share
    one. Each branch behind a pulley, a tendon that `add_branches` has made, follows the friction of its tendon.
    """
    plugin_frictions: list[PluginFriction] = []
    spatial_rows: list[tuple[str, Array]] = []
    for name, (law, explicit) in tendons.items():
        share = _link_share(model, model.tendon(name).id, list(tendons))
        if not share and not _is_pulled(model, model.tendon(name).id):
            if explicit:
                allowed = "nothing pulls it: no actuator, spring, limit or equality of tendons"
                raise InputError(f"tendons.{name}", allowed)
            continue
        row, of_joint, ratio = _row(model, name, spatial_rows)
        kind = LINK if share else TENDON
        numbers = _tendon_law(model, name, law)
        # What neither bends it nor has a pin that it loads would be passed over at every step.
        crossed = tuple(each for each in _crossed(model, name, law) if each[2] or each[1] in joints)
        constrained = _limited_or_coupled(model, model.tendon(name).id)
        plugin_frictions.append(
            PluginFriction(kind, name, row, of_joint, ratio, numbers, crossed, share / abs(ratio), constrained)
        )
        # Drag and what the model does not show count once.
        branch_numbers = numbers._replace(drag=0.0, curvature_offset=0.0)
        for number, (branch, part) in enumerate(branches.get(name, []), start=1):
            crossed = tuple(each for each in _crossed(model, branch, law) if each[1] in joints)
            elements = ((False, name, part), *crossed)
            friction = PluginFriction(BRANCH, branch, branch, False, 1.0, branch_numbers, elements, float(number))
            plugin_frictions.append(friction)
    for name, (law, explicit) in joints.items():
        if int(model.joint(name).type[0]) in _SINGLE:
            loss = float(model.dof_frictionloss[model.jnt_dofadr[model.joint(name).id]])
            stiffness, hardening = _bristles(law, loss)
            numbers = Coefficients(
                **{key: getattr(law, key) for key in _SAME_KEYS},
                stiction=law.stiction,
                stiffness=stiffness,
                floor=max(law.floor, loss),
                drag=law.drag,
                curvature_offset=0.0,
                hardening=hardening,
            )
            plugin_frictions.append(PluginFriction(PIN, name, name, True, 1.0, numbers))
        elif explicit:
            raise InputError(f"joints.{name}", "must be a joint that turns or slides about one axis")
    return _with_joint_loss(model, plugin_frictions)


def add_branches(
    spec: mujoco.MjSpec, model: mujoco.MjModel, names: Iterable[str]
) -> dict[str, list[tuple[str, float]]]:
    """Add a tendon for the friction along each branch behind a pulley.

    Returns:
        By tendon, the names of its branches, each with one over its divisor.
    """
    kinds, branches = mujoco.mjtWrap, dict[str, list[tuple[str, float]]]()
    for name in names:
        branch, named_branches = None, list[tuple[str, float]]()
        for k in _pieces(model, model.tendon(name).id):
            kind, object_id = model.wrap_type[k], int(model.wrap_objid[k])
            if kind == kinds.mjWRAP_PULLEY:
                named_branches.append((f"{name}_branch_{len(named_branches) + 1}", 1.0 / float(model.wrap_prm[k])))
                branch = spec.add_tendon(name=named_branches[-1][0], rgba=(0.0, 0.0, 0.0, 0.0))
            elif branch is not None and kind == kinds.mjWRAP_SITE:
                branch.wrap_site(model.site(object_id).name)
            elif branch is not None:
                side = int(model.wrap_prm[k])
                branch.wrap_geom(model.geom(object_id).name, model.site(side).name if side >= 0 else "")
        if named_branches:
            branches[name] = named_branches
    return branches


def _with_joint_loss(model: mujoco.MjModel, plugin_frictions: list[PluginFriction]) -> list[PluginFriction]:
    """Return frictions, the constant one of a joint in whose row tendons act as the drag of the first of these."""
    rows = {friction.row for friction in plugin_frictions if friction.kind == PIN}
    frictions_with_loss = []
    for friction in plugin_frictions:
        if friction.row_of_joint and not friction.of_joint and friction.row not in rows:
            rows.add(friction.row)
            loss = float(model.dof_frictionloss[model.jnt_dofadr[model.joint(friction.row).id]]) / abs(friction.ratio)
            friction = replace(friction, law=friction.law._replace(drag=friction.law.drag + loss))
        frictions_with_loss.append(friction)
    return frictions_with_loss


def pulled_tendons(model: mujoco.MjModel, names: Iterable[str]) -> list[str]:
    """Return the tendons among some that an actuator, a spring, a limit or an equality pulls."""
    return [name for name in names if _is_pulled(model, model.tendon(name).id)]


def _is_pulled(model: mujoco.MjModel, tendon: int) -> bool:
    """Return whether a tendon has an actuator, a spring, a limit or an equality of its own."""
    kinds = mujoco.mjtTrn
    has_actuator = (model.actuator_trntype == kinds.mjTRN_TENDON) & (model.actuator_trnid[:, 0] == tendon)
    return bool(has_actuator.any() or model.tendon_stiffness[tendon] > 0.0 or _limited_or_coupled(model, tendon))


def _limited_or_coupled(model: mujoco.MjModel, tendon: int) -> bool:
    coupled = model.eq_type == mujoco.mjtEq.mjEQ_TENDON
    couplings = coupled & ((model.eq_obj1id == tendon) | (model.eq_obj2id == tendon))
    return bool(couplings.any() or model.tendon_limited[tendon])


def _link_share(model: mujoco.MjModel, tendon: int, names: list[str]) -> float:
    """Return the share of a fixed tendon in the drive of the only joint that it runs over; see `PluginFriction`.

    Zero of all others, and of those that have an actuator or a spring of their own.
    """
    kinds, coefficients = mujoco.mjtTrn, _coefficients(model, tendon)
    has_actuator = (model.actuator_trntype == kinds.mjTRN_TENDON) & (model.actuator_trnid[:, 0] == tendon)
    if np.count_nonzero(coefficients) != 1 or has_actuator.any() or model.tendon_stiffness[tendon] > 0.0:
        return 0.0
    joint = int(np.flatnonzero(coefficients)[0])
    on_joint = (model.actuator_trntype == kinds.mjTRN_JOINT) | (model.actuator_trntype == kinds.mjTRN_JOINTINPARENT)
    if not np.any(on_joint & (model.actuator_trnid[:, 0] == joint)):
        return 0.0
    all_coefficients = [_coefficients(model, model.tendon(name).id) for name in names]
    arms = [each[joint] for each in all_coefficients if np.count_nonzero(each) == 1 and each[joint]]
    agreeing = sum(arm * coefficients[joint] > 0.0 for arm in arms)
    return float((1.0 if agreeing == len(arms) else -1.0) / agreeing)


def _coefficients(model: mujoco.MjModel, tendon: int) -> Array:
    """Return the coefficients of a fixed tendon, shape (joints,); zeros of a spatial one."""
    coefficients = np.zeros(model.njnt)
    for k in _pieces(model, tendon):
        if model.wrap_type[k] == mujoco.mjtWrap.mjWRAP_JOINT:
            coefficients[model.wrap_objid[k]] += model.wrap_prm[k]
    return coefficients


def _pieces(model: mujoco.MjModel, tendon: int) -> range:
    return range(int(model.tendon_adr[tendon]), int(model.tendon_adr[tendon] + model.tendon_num[tendon]))


def _row(model: mujoco.MjModel, name: str, earlier_rows: list[tuple[str, Array]]) -> tuple[str, bool, float]:
    """Return the row that a tendon acts in: its joint's, an earlier parallel one's, or its own."""
    coefficients = _coefficients(model, model.tendon(name).id)
    joints = np.flatnonzero(coefficients)
    if len(joints) == 1:
        return model.joint(joints[0]).name, True, float(coefficients[joints[0]])
    for other, other_coefficients in earlier_rows if len(joints) else []:
        ratio = float(coefficients @ other_coefficients / (other_coefficients @ other_coefficients))
        if np.abs(coefficients - ratio * other_coefficients).max() <= _PARALLEL * np.abs(coefficients).max():
            return other, False, ratio
    if len(joints):
        earlier_rows.append((name, coefficients))
    return name, False, 1.0


def _tendon_law(model: mujoco.MjModel, name: str, law: Any) -> Coefficients:
    drag = law.drag or float(model.tendon_frictionloss[model.tendon(name).id])
    stiffness, hardening = _bristles(law, drag)
    return Coefficients(
        **{key: getattr(law, key) for key in _SAME_KEYS},
        stiction=law.stiction_ratio,
        stiffness=stiffness,
        floor=law.floor,
        drag=drag,
        curvature_offset=law.curvature_offset,
        hardening=hardening,
    )


def _bristles(law: JointFrictionSettings | TendonFrictionSettings, level: float) -> tuple[float, float]:
    """Return the stiffness of bristles and its growth with their force, of friction that has a level without load."""
    numbers = bristles(law, per_item(law, 1), level)
    return float(numbers["stiffness"][0]), float(numbers["hardening"][0])


def _crossed(model: mujoco.MjModel, name: str, law: RoutedFriction) -> tuple[tuple[bool, str, float], ...]:
    """Return the joints that a tendon crosses before its first pulley, with 1 for those that bend a fixed one."""
    tendon, moving = model.tendon(name).id, None
    weights = dict.fromkeys(np.flatnonzero(_coefficients(model, tendon)), 1.0)
    for k in _pieces(model, tendon):
        kind, object_id = model.wrap_type[k], model.wrap_objid[k]
        if kind == mujoco.mjtWrap.mjWRAP_PULLEY:
            break
        if kind != mujoco.mjtWrap.mjWRAP_JOINT:
            body = model.site_bodyid[object_id] if kind == mujoco.mjtWrap.mjWRAP_SITE else model.geom_bodyid[object_id]
            previous, moving = moving, _moving_joints(model, int(body))
            weights |= dict.fromkeys(sorted(moving ^ previous) if previous is not None else (), 0.0)
    names = {int(j): model.joint(int(j)).name for j in weights}
    bends = set(names.values()) if law.bends is None else set(law.bends)
    for joint in law.bends or ():
        if joint not in names.values():
            raise InputError(f"tendons.{name}.bends", f"must be joints of it: {', '.join(names.values())}", joint)
    turns = {j: model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE for j in names}
    return tuple(
        (True, names[j], weight * float(turns[j] and names[j] in bends))
        for j, weight in ((int(j), weight) for j, weight in weights.items())
        if int(model.jnt_type[j]) in _SINGLE
    )


def _moving_joints(model: mujoco.MjModel, body: int) -> set[int]:
    """Return the joints that move a body."""
    joints = set[int]()
    while body:
        first = int(model.body_jntadr[body])
        joints |= set(range(first, first + int(model.body_jntnum[body])))
        body = int(model.body_parentid[body])
    return joints
