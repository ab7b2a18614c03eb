"""Friction as elements of a `mujoco.MjSpec`: an actuator that stands for it, a tuple of numbers, rows of the solver."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from finger_pin.description.friction import JointFrictionSettings
from finger_pin.exceptions import InputError, ScenarioWarning
from finger_pin.exchange.mujoco_friction import COUNT, GROUP, LEAST_LOSS, NAME, NO_INPUT, PLUGIN, PluginFriction
from finger_pin.mechanism.coerce import FingerLike, description_of
from finger_pin.mujoco.frictions import add_branches, frictions, pulled_tendons
from finger_pin.mujoco.name_matching import RoutedFriction, friction_keys, match_names
from finger_pin.mujoco.registration import register

Keys = Mapping[str, Mapping[str, Any]]

# Attributes that an actuator inherits from a model's default class.
_CLASS_ATTRIBUTES = (
    *("actearly", "actlimited", "actrange", "armature", "biasprm", "biastype", "ctrllimited", "ctrlrange", "damping"),
    *("delay", "dynprm", "dyntype", "forcelimited", "forcerange", "gainprm", "interp", "nsample"),
)
# Damping times step over mass above which dampers and servos weaken the solver's rows.
_STIFF_RATIO = 5.0


class MujocoWarning(ScenarioWarning):
    """Warning about an option or time step of a MuJoCo model that weakens friction."""


def add_friction(
    spec: mujoco.MjSpec, tendons: Keys | None = None, joints: Keys | None = None, *, of: FingerLike | None = None
) -> None:
    """Add friction that grows with tension, and holds, to a MuJoCo model.

    Tendons rub in their canals by (9), (14) and (16), joints on their pins by (9) and (17). Names may have stars
    (``*``); of several entries that match, later ones go on top. With stars, tendons that nothing pulls are passed
    over. A friction loss that the model has stays, as what a friction is at least: ``drag`` of a tendon, ``floor`` of
    a joint.

    Args:
        spec: A `mujoco.MjSpec`, which is changed; compile it afterwards.
        tendons: By name, keys of ``finger.tendon_friction`` (coulomb, stiction_ratio, stiffness, viscous,
            stribeck_velocity, floor, stribeck_exponent, micro_damping, drag), ``curvature_offset``, rad, the turn that
            the model does not show, and for fixed tendons ``bends``, the joints whose angle bends the path.
        joints: By name, keys of ``finger.joint_friction``.
        of: The finger or hand with a tree of bodies whose friction it is, where `to_mjcf` has written the model;
            ``tendons`` and ``joints`` go on top.
    """
    if of is not None:
        tendons, joints = (_merged(*each) for each in zip(_described_friction(of), (tendons, joints), strict=True))
    register()
    if not isinstance(spec, mujoco.MjSpec):
        raise InputError("spec", "must be a mujoco.MjSpec", type(spec).__name__)
    # The class of the actuator stays where that is deleted, as do a tuple, losses and longer keyframes.
    if spec.find_default(NAME) is not None:
        raise InputError("spec", "has friction already, or what is left of it: add all of it in one call to a new spec")
    if int(spec.option.integrator) == int(getattr(mujoco.mjtIntegrator, "mjINT_DISCRETE", -1)):
        raise InputError("spec.option.integrator", "friction needs Euler, RK4, implicit or implicitfast", "discrete")
    warn_if_noslip(spec.option, "spec.option")
    name_all(spec)
    try:
        model = spec.compile()
    except ValueError as error:
        raise InputError("spec", " ".join(str(error).split())) from None
    tendon_laws = match_names(tendons, [model.tendon(i).name for i in range(model.ntendon)], "tendons", RoutedFriction)
    joint_laws = match_names(joints, [model.joint(i).name for i in range(model.njnt)], "joints", JointFrictionSettings)
    branches = add_branches(spec, model, pulled_tendons(model, tendon_laws))
    if branches:
        model = spec.compile()
    plugin_frictions = frictions(model, tendon_laws, joint_laws, branches)
    if not plugin_frictions:
        raise InputError("spec", "nothing pulls the tendons, and no joints are named: there is no friction to add")
    warn_if_stiff(model, plugin_frictions, "spec.option.timestep")
    _write(spec, model, plugin_frictions)


def _described_friction(finger: FingerLike) -> tuple[Keys, Keys]:
    description = description_of(finger)
    if not description.tree.bodies:
        raise InputError("of", "must have a tree of bodies; friction of others is written by to_mjcf(friction=True)")
    return friction_keys(description)


def _merged(keys: Keys, overrides: Keys | None) -> Keys:
    return {**keys, **{name: {**keys.get(name, {}), **each} for name, each in (overrides or {}).items()}}


def warn_if_noslip(option: Any, entry: str) -> None:
    """Warn of iterations that take the bristles away."""
    if option.noslip_iterations:
        reason = "they take the bristles away, so that friction creeps"
        warnings.warn(MujocoWarning(f"{entry}.noslip_iterations: {reason}"), stacklevel=3)


def warn_if_stiff(model: mujoco.MjModel, plugin_frictions: list[PluginFriction], entry: str) -> None:
    """Warn where dampers or servos are stiff for the step."""
    stiff = sorted({each.row for each in plugin_frictions if _damping(model, each) > _STIFF_RATIO})
    if stiff:
        reason = "a step is long for the dampers or servos there, and friction stops too little: take shorter steps"
        warnings.warn(MujocoWarning(f"{entry}: {', '.join(stiff)}: {reason}"), stacklevel=3)


def _damping(model: mujoco.MjModel, friction: PluginFriction) -> float:
    """Return h D / m of a friction: dampers and servos on it and its row are implicit, and its solver sees none."""
    places = {(friction.of_joint, friction.name), (friction.row_of_joint, friction.row)}
    return float(model.opt.timestep * sum(_damping_rate(model, *each) for each in places))


def _damping_rate(model: mujoco.MjModel, of_joint: bool, name: str) -> float:
    """Return D / m of a joint or a tendon, 1/s."""
    kinds = mujoco.mjtTrn
    if of_joint:
        element = model.joint(name).id
        dof = int(model.jnt_dofadr[element])
        gain, weight = model.dof_damping[dof], model.dof_invweight0[dof]
        is_acting = np.isin(model.actuator_trntype, (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)))
    else:
        element = model.tendon(name).id
        gain, weight = model.tendon_damping[element], model.tendon_invweight0[element]
        is_acting = model.actuator_trntype == kinds.mjTRN_TENDON
    is_acting &= (model.actuator_trnid[:, 0] == element) & (model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE)
    if model.opt.integrator in (mujoco.mjtIntegrator.mjINT_IMPLICIT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST):
        gain = gain - np.sum(model.actuator_biasprm[is_acting, 2] * model.actuator_gear[is_acting, 0] ** 2)
    return float(gain * weight)


def name_all(spec: mujoco.MjSpec) -> None:
    """Name unnamed elements for the table and branches."""
    elements_by_kind = {"tendon": spec.tendons, "joint": spec.joints, "site": spec.sites, "geom": spec.geoms}
    for what, elements in elements_by_kind.items():
        for index, element in enumerate(elements):
            element.name = element.name or f"{what}_{index}"


def _write(spec: mujoco.MjSpec, model: mujoco.MjModel, plugin_frictions: list[PluginFriction]) -> None:
    """Add actuator, tuple and plugin, and prepare the rows."""
    elements = [element for each in plugin_frictions for element in each.elements()]
    kinds, names, values = zip(*elements, strict=True)
    types = {"joint": mujoco.mjtObj.mjOBJ_JOINT, "tendon": mujoco.mjtObj.mjOBJ_TENDON}
    spec.add_tuple(name=NAME, objtype=[types[each] for each in kinds], objname=list(names), objprm=list(values))
    states = sum(each.states for each in plugin_frictions)
    for key in spec.keys:
        if len(key.act):
            key.act = np.append(np.array(key.act), np.zeros(states))
    spec.activate_plugin(PLUGIN)
    plugin = spec.add_plugin(name=NAME, plugin_name=PLUGIN, active=True)
    plugin.config = {COUNT: str(len(plugin_frictions))}
    # In a class of its own, so that XML keeps what makes it an actuator without an input; no default of the model acts.
    default, defaults = spec.add_default(NAME, spec.default), mujoco.MjSpec()
    for field in _CLASS_ATTRIBUTES:
        # Older versions of MuJoCo have some of them.
        if hasattr(defaults.default.actuator, field):
            setattr(default.actuator, field, getattr(defaults.default.actuator, field))
    default.actuator.gaintype, default.actuator.ctrlspec = mujoco.mjtGain.mjGAIN_DCMOTOR, NO_INPUT
    target, kind = _target(spec, plugin_frictions)
    actuator = spec.add_actuator(default, name=NAME, trntype=kind, target=target, actdim=states)
    actuator.gaintype, actuator.ctrlspec = mujoco.mjtGain.mjGAIN_DCMOTOR, NO_INPUT
    actuator.dyntype, actuator.biastype = mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtBias.mjBIAS_NONE
    actuator.gear, actuator.group, actuator.plugin = np.zeros(6), GROUP, plugin
    for friction in plugin_frictions:
        row = spec.joint(friction.row) if friction.row_of_joint else spec.tendon(friction.row)
        row.frictionloss = max(float(row.frictionloss), abs(friction.ratio) * friction.least_level, LEAST_LOSS)


def _target(spec: mujoco.MjSpec, plugin_frictions: list[PluginFriction]) -> tuple[str, mujoco.mjtTrn]:
    """Return a harmless target for the actuator: a driven element of an active tree."""
    for actuator in spec.actuators:
        if actuator.trntype in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_TENDON):
            return actuator.target, actuator.trntype
    kind = mujoco.mjtTrn.mjTRN_JOINT if plugin_frictions[0].of_joint else mujoco.mjtTrn.mjTRN_TENDON
    return plugin_frictions[0].name, kind
