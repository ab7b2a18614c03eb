"""Friction added to a model of MuJoCo Warp: its callbacks, its arrays, and its state."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import warp as wp

from finger_pin.description.friction import JointFrictionSettings
from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_friction import SIGNAL, Coefficients, PluginFriction
from finger_pin.mujoco.friction_signals import friction_index
from finger_pin.mujoco.frictions import frictions, pulled_tendons
from finger_pin.mujoco.name_matching import RoutedFriction, match_names
from finger_pin.mujoco.specification import Keys, warn_if_noslip, warn_if_stiff
from finger_pin.mujoco.warp import kernels, row_kernels
from finger_pin.mujoco.warp.callback_self_test import try_self_test
from finger_pin.mujoco.warp.friction_table import build_table, check_rows, losses
from finger_pin.mujoco.warp.names import NamedModel, branches_of
from finger_pin.mujoco.warp.structures import (
    LAWS,
    MEMORIES,
    NEVER,
    ForceInputs,
    PinInputs,
    RowInputs,
    TendonInputs,
    allocate,
)

_DISCRETE = int(getattr(mujoco.mjtIntegrator, "mjINT_DISCRETE", -1))
#: Switches that must stay as they are, with what they are for.
_REQUIRED_SWITCHES = {
    mujoco.mjtDisableBit.mjDSBL_CONSTRAINT: "the solver's rows are its force",
    mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS: "the solver's rows are its force",
    mujoco.mjtDisableBit.mjDSBL_ACTUATION: "it is computed after actuators",
    mujoco.mjtDisableBit.mjDSBL_SENSOR: "the solver's forces are read after sensors",
}


class Friction:
    """Frictions of all worlds, as arrays on the device of shape (worlds, frictions); N and N m.

    Coefficients may be written in place at any time, also after a graph was captured; signals are those of the last
    step.

    Attributes:
        names: Of the tendons and joints.
        coulomb: mu_e of a tendon, M^d of a joint.
        stiction: M^c / M^d of a tendon, M^c of a joint.
        stiffness: N/m, N m/rad.
        viscous: N s/m, N m s/rad.
        stribeck_velocity: m/s, rad/s.
        floor: Of a joint its constant friction loss where that is more.
        stribeck_exponent: 1 or 2.
        micro_damping: N s/m, N m s/rad.
        drag: Of a tendon its constant friction loss where it was not given.
        curvature_offset: rad, of a tendon.
        hardening: Growth of the stiffness with the bristles' force, 1/m, 1/rad; 0 where a stiffness was given.
        level: Friction of steady sliding.
        friction: Friction, along the tendon's length or the joint's coordinate, against the motion.
        tension: Load, N: of a tendon its tension, of a joint the reaction (17).
        turn: phi, rad, of a tendon.
    """

    def __init__(self, m: Any, d: Any, model: NamedModel, plugin_frictions: list[PluginFriction]) -> None:
        """Make the arrays, and set the callbacks of ``m``; see `add_friction`."""
        self.names = tuple(each.name for each in plugin_frictions)
        self._data, self._device = d, d.qpos.device
        self._model = m
        with wp.ScopedDevice(self._device):
            self._table = build_table(model, plugin_frictions)
            rows = self._table.sharing_first.shape[0] - 1
            self._arrays = s = allocate(d.nworld, len(plugin_frictions), rows, d.ten_J.shape[1])
            law = np.array([each.law for each in plugin_frictions], np.float32).T[:, None]
            s.law.assign(np.broadcast_to(law, (LAWS, d.nworld, len(plugin_frictions))).copy())
            self._all_worlds = wp.full((d.nworld,), True, dtype=bool)
        columns = Coefficients(*(s.law[k] for k in range(LAWS)))
        self.coulomb, self.stiction = columns.coulomb, columns.stiction
        self.stiffness, self.viscous = columns.stiffness, columns.viscous
        self.stribeck_velocity, self.stribeck_exponent = columns.stribeck_velocity, columns.stribeck_exponent
        self.floor, self.micro_damping, self.drag = columns.floor, columns.micro_damping, columns.drag
        self.curvature_offset, self.hardening = columns.curvature_offset, columns.hardening
        self.level, self.friction = s.signals[SIGNAL.level], s.signals[SIGNAL.force]
        self.tension, self.turn = s.signals[SIGNAL.load], s.signals[SIGNAL.turn]
        self._inputs: dict[Any, tuple[list[Any], Any]] = {}
        self._previous_act_bias, self._previous_sensor = m.callback.act_bias, m.callback.sensor
        m.callback.act_bias, m.callback.sensor = self._act_bias, self._sensor

    def index(self, name: str) -> int:
        """Return the index of a tendon or joint in the arrays."""
        return friction_index(name, self.names)

    @property
    def state(self) -> Any:
        """A copy of the state, shape (worlds, frictions, 5): bristles' force, N, and loads that the last step leaves.

        With ``qpos``, ``qvel`` and the like it makes a state of the simulation; those are written at any time, before
        or after it.
        """
        self._finish()
        return wp.clone(self._arrays.memory)

    @state.setter
    def state(self, value: Any) -> None:
        shape = self._arrays.memory.shape
        values = value if isinstance(value, wp.array) else np.asarray(value, np.float32)
        if tuple(values.shape) != tuple(shape):
            raise InputError("state", f"must have the shape (worlds, frictions, {MEMORIES}), {shape}", values.shape)
        self._arrays.memory.assign(values)
        self._arrays.clock.fill_(NEVER)

    def reset(self, mask: Any = None) -> None:
        """Put the friction of all worlds at rest, or of those with True in a mask, an array of shape (worlds,).

        A world whose time goes back is reset at its next step by itself.
        """
        worlds, count = self.level.shape
        if mask is None:
            mask = self._all_worlds
        elif not isinstance(mask, wp.array):
            mask = wp.array(np.asarray(mask, bool), dtype=bool, device=self._device)
        if mask.shape != (worlds,) or mask.dtype is not wp.bool:
            raise InputError("mask", f"must be of shape ({worlds},) and of bool", mask.shape)
        wp.launch(kernels.reset_worlds, (worlds, count), inputs=[self._arrays, mask], device=self._device)

    def _finish(self) -> None:
        """Finish the last step, up to the present time, and start the clock there."""
        m, d = self._model, self._data
        self._launch(kernels.finish_step, self.level.shape[1], TendonInputs, m.opt, m, d)
        wp.copy(self._arrays.clock, d.time)

    def _act_bias(self, m: Any, d: Any) -> None:
        """Write this step's rows: the callback that MuJoCo Warp calls once forces of actuators are known."""
        if self._previous_act_bias:
            self._previous_act_bias(m, d)
        self._check(m, d)
        self._finish()
        t = self._table
        self._launch(kernels.tendons, t.tendons.shape[0], TendonInputs, m.opt, m, d)
        self._launch(kernels.pins, t.pins.shape[0], PinInputs, m.opt, m, d)
        self._launch(row_kernels.write_rows, m.nv + m.ntendon, RowInputs, d.efc, m.opt, m, d)

    def _launch(self, kernel: Any, count: int, kind: Any, *owners: Any) -> None:
        """Launch a kernel for every world and the first of a count, with the fields of a struct from their owners."""
        if not count:
            return
        values = [next(getattr(owner, name) for owner in owners if hasattr(owner, name)) for name in kind.vars]
        previous, inputs = self._inputs.get(kind, ((), None))
        # Filling a struct takes longer than a launch, and arrays are seldom others.
        if len(previous) != len(values) or not all(map(operator.is_, previous, values)):
            inputs = kind()
            for name, value in zip(kind.vars, values, strict=True):
                setattr(inputs, name, value)
            self._inputs[kind] = values, inputs
        shape = (self._data.nworld, count)
        wp.launch(kernel, shape, inputs=[self._table, self._arrays, inputs], device=self._device)

    def _sensor(self, m: Any, d: Any, stage: Any) -> None:
        """Record the solver's forces: the callback that MuJoCo Warp calls while its rows are still this step's."""
        if self._previous_sensor:
            self._previous_sensor(m, d, stage)
        if int(stage) != int(mujoco.mjtStage.mjSTAGE_ACC):
            return
        if m.callback.act_bias != self._act_bias:
            raise InputError("m.callback.act_bias", "was set after friction was added, which is in it: set it before")
        self._launch(row_kernels.record, self.level.shape[1], ForceInputs, d.efc, d.contact, m, d)

    def _check(self, m: Any, d: Any) -> None:
        """Refuse other data, and options that leave no room for friction."""
        check_options(m.opt, "m.opt")
        if d.time.ptr != self._data.time.ptr:
            raise InputError("d", "must be the data that friction was added with: add it to another model for others")
        if m.callback.sensor != self._sensor:
            raise InputError("m.callback.sensor", "was set after friction was added, which is in it: set it before")


def check_options(option: Any, entry: str) -> None:
    """Refuse an integrator or a switch that leaves no room for friction."""
    if int(option.integrator) == _DISCRETE:
        raise InputError(f"{entry}.integrator", "friction needs Euler, RK4, implicit or implicitfast", "discrete")
    for bit, purpose in _REQUIRED_SWITCHES.items():
        if int(option.disableflags) & int(bit):
            name = bit.name.removeprefix("mjDSBL_").lower()
            raise InputError(f"{entry}.disableflags", f"friction needs what it disables: {purpose}", name)


def add_friction(
    m: Any, d: Any, mjm: mujoco.MjModel, tendons: Keys | None = None, joints: Keys | None = None
) -> Friction:
    """Add friction that grows with tension, and holds, to the worlds of MuJoCo Warp.

    Names, keys and their meaning are those of `finger_pin.mujoco.add_friction`. Then call `mujoco_warp.step`, captured
    or not. Callbacks ``act_bias`` and ``sensor`` of ``m`` that were set before are called first.

    Args:
        m: Of `mujoco_warp.put_model`, which is changed: it has friction losses where there was none.
        d: Of `mujoco_warp.put_data` or ``make_data``, with room for the solver's rows in ``njmax``.
        mjm: The model that they were made of, without `finger_pin.mujoco.add_friction`.
        tendons: By name, as there.
        joints: By name, as there.

    Returns:
        Coefficients, signals and state of all worlds.
    """
    try_self_test(str(d.qpos.device), attach_friction)
    return attach_friction(m, d, mjm, tendons, joints)


def attach_friction(m: Any, d: Any, mjm: mujoco.MjModel, tendons: Keys | None, joints: Keys | None) -> Friction:
    """Add friction without the self-test."""
    if not isinstance(mjm, mujoco.MjModel):
        raise InputError("mjm", "must be a mujoco.MjModel", type(mjm).__name__)
    if (m.nv, m.ntendon, m.njnt, m.nactuator) != (mjm.nv, mjm.ntendon, mjm.njnt, mjm.nactuator):
        raise InputError("mjm", "must be the model that m was made of")
    callback: Callable[..., None] | None = m.callback.act_bias
    if isinstance(getattr(callback, "__self__", None), Friction):
        raise InputError("m", "has friction already: add all of it in one call to a new model")
    check_options(m.opt, "m.opt")
    if not m.nactuator:
        raise InputError(
            "mjm", "has no actuators: MuJoCo Warp computes friction after them, and does not where none is"
        )
    warn_if_noslip(m.opt, "m.opt")
    model = NamedModel(mjm)
    tendon_laws = match_names(tendons, model.tendons, "tendons", RoutedFriction)
    joint_laws = match_names(joints, model.joints, "joints", JointFrictionSettings)
    plugin_frictions = frictions(model, tendon_laws, joint_laws, branches_of(model, pulled_tendons(model, tendon_laws)))
    if not plugin_frictions:
        raise InputError("mjm", "nothing pulls the tendons, and no joints are named: there is no friction to add")
    warn_if_stiff(model, plugin_frictions, "mjm.opt.timestep")
    of_dofs, of_tendons = losses(model, plugin_frictions)
    check_rows(model, d, of_dofs, of_tendons)
    for array, least in ((m.dof_frictionloss, of_dofs), (m.tendon_frictionloss, of_tendons)):
        if array.size:
            array.assign(np.maximum(array.numpy(), least).astype(np.float32))
    return Friction(m, d, model, plugin_frictions)
