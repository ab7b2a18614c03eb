"""Signals of frictions in a MuJoCo model, as views of MuJoCo's memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_friction import ELEMENT, NAME, SIGNAL, SIGNALS
from finger_pin.mujoco.registration import register
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals of all frictions, live views of ``data``; N and N m.

    Attributes:
        names: Of the tendons and joints, shape (k,).
        level: Friction of steady sliding, by the speed and load of the last step.
        friction: Friction of the last step, along the tendon's length or the joint's coordinate, against the motion.
        bristle: F^s of (9a), the part of it that is elastic.
        tension: Its load, N: of a tendon its tension, of a joint the reaction (17).
        turn: phi, rad, of a tendon.
    """

    names: tuple[str, ...]
    level: Array
    friction: Array
    bristle: Array
    tension: Array
    turn: Array

    def index(self, name: str) -> int:
        """Return the index of a tendon or joint in the arrays."""
        return friction_index(name, self.names)


def friction_index(name: str, names: Sequence[str]) -> int:
    """Return the index of a friction by its name."""
    if name not in names:
        raise InputError(f"friction.{name}", f"there are {', '.join(names)}")
    return names.index(name)


def friction(model: mujoco.MjModel, data: mujoco.MjData) -> Signals:
    """Return the friction of tendons and joints of a model that `add_friction` has prepared.

    Arrays are parts of ``data``, without copies, where the model has one such hand; of several attached ones they are
    joined, and copies.
    """
    register()
    if int(model.opt.integrator) == int(getattr(mujoco.mjtIntegrator, "mjINT_DISCRETE", -1)):
        raise InputError("model.opt.integrator", "friction needs Euler, RK4, implicit or implicitfast", "discrete")
    actuators = [
        i for i in range(model.nactuator) if model.actuator_plugin[i] >= 0 and _tuple_index(model, i) is not None
    ]
    if not actuators:
        raise InputError("model", "has no friction: add_friction(spec, ...) before compiling it")
    signals = [_signals(model, data, i) for i in actuators]
    if len(signals) == 1:
        return signals[0]
    arrays = {
        name: np.concatenate([getattr(each, name) for each in signals])
        for name in Signals.__annotations__
        if name != "names"
    }
    return Signals(tuple(name for each in signals for name in each.names), **arrays)


def _tuple_index(model: mujoco.MjModel, actuator: int) -> int | None:
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator) or ""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TUPLE, name)
    return index if index >= 0 and name.endswith(NAME) else None


def _signals(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> Signals:
    table = _tuple_index(model, actuator)
    assert table is not None
    element = int(model.tuple_adr[table])
    end, activation = element + int(model.tuple_size[table]), int(model.actuator_actadr[actuator])
    names = []
    while element < end:
        kind = mujoco.mjtObj(int(model.tuple_objtype[element]))
        names.append(mujoco.mj_id2name(model, kind, int(model.tuple_objid[element])))
        element += int(model.tuple_objprm[element + ELEMENT.length])
    first = int(model.plugin_stateadr[model.actuator_plugin[actuator]])
    states = data.plugin_state[first : first + SIGNALS * len(names)].reshape(-1, SIGNALS)
    level, force, load, turn = (states[:, k] for k in SIGNAL)
    return Signals(tuple(names), level, force, data.act[activation : activation + len(names)], load, turn)
