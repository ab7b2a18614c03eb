"""Compiled models in which every tendon and joint has a name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.mujoco.frictions import add_branches as add_branches_of
from finger_pin.mujoco.frictions import pulled_tendons
from finger_pin.mujoco.specification import name_all


class NamedModel:
    """A compiled model, in which unnamed tendons and joints are called by kind and number."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Name all tendons and joints of a model, without changing it."""
        self.model = model
        self.tendons = [model.tendon(i).name or f"tendon_{i}" for i in range(model.ntendon)]
        self.joints = [model.joint(i).name or f"joint_{i}" for i in range(model.njnt)]

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the model."""
        return getattr(self.model, name)

    def tendon(self, key: str | int) -> SimpleNamespace:
        """Return name and id of a tendon."""
        index = self.tendons.index(key) if isinstance(key, str) else int(key)
        return SimpleNamespace(id=index, name=self.tendons[index])

    def joint(self, key: str | int) -> SimpleNamespace:
        """Return name, id and type of a joint."""
        index = self.joints.index(key) if isinstance(key, str) else int(key)
        return SimpleNamespace(id=index, name=self.joints[index], type=self.model.jnt_type[index : index + 1])


def add_branches(spec: mujoco.MjSpec) -> None:
    """Add a tendon without forces along each branch behind a pulley, in whose row the branch's friction acts.

    `finger_pin.mujoco.add_friction` does so by itself; a compiled model cannot have new tendons.

    Args:
        spec: A `mujoco.MjSpec`, which is changed; compile it afterwards.
    """
    name_all(spec)
    try:
        model = spec.compile()
    except ValueError as error:
        raise InputError("spec", " ".join(str(error).split())) from None
    names = pulled_tendons(model, [model.tendon(i).name for i in range(model.ntendon)])
    add_branches_of(spec, model, [name for name in names if f"{name}_branch_1" not in [t.name for t in spec.tendons]])


def branches_of(model: NamedModel, names: list[str]) -> dict[str, list[tuple[str, float]]]:
    """Return the branches of tendons with pulleys, each with one over its divisor, as `add_branches` has made them."""
    branches: dict[str, list[tuple[str, float]]] = {}
    for name in names:
        first, count = (int(each[model.tendon(name).id]) for each in (model.tendon_adr, model.tendon_num))
        pieces = slice(first, first + count)
        divisors = np.asarray(model.wrap_prm[pieces][model.wrap_type[pieces] == mujoco.mjtWrap.mjWRAP_PULLEY])
        named_branches = [(f"{name}_branch_{k}", 1.0 / float(each)) for k, each in enumerate(divisors, start=1)]
        if any(branch not in model.tendons for branch, _ in named_branches):
            reason = "has a pulley, behind which each branch rubs: fp.mujoco.warp.add_branches(spec) before compiling"
            raise InputError(f"tendons.{name}", reason)
        if named_branches:
            branches[name] = named_branches
    return branches
