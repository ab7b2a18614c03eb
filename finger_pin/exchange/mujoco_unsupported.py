"""Elements of a MuJoCo model that are not carried over: listed, or refused by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_flags import disabled, without_counterpart
from finger_pin.exchange.mujoco_names import Names


class Rest:
    """Elements left out of a model.

    Attributes:
        mujoco: The module.
        model: The compiled model.
    """

    def __init__(self, mujoco: Any, model: Any) -> None:
        """Check all elements but equalities and actuators.

        Raises:
            InputError: If the model has muscles.
        """
        self.mujoco, self.model = mujoco, model
        self._listed: list[str] = []
        self._moving: list[str] = []
        self._refuse_muscles()
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

    def _refuse_muscles(self) -> None:
        model, mujoco = self.model, self.mujoco
        for i in range(getattr(model, "nactuator", model.nu)):
            kinds = (
                model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_MUSCLE,
                model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_MUSCLE,
                model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_MUSCLE,
            )
            if any(kinds):
                raise InputError(f"actuator {model.actuator(i).name or i}", "is a muscle; muscles are not supported")

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
