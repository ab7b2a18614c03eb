"""What random models have to do in MuJoCo's own step, with our friction there."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from random_fingers import decades
from random_models import DURATION, RandomModel
from random_runs import held_inputs, tight

import finger_pin as fp

# Time step of MuJoCo, s.
_STEP = DURATION / 3200


def mujoco_rubs_alike(model: RandomModel) -> None:
    """A tree written for MuJoCo, with our friction there, is as fast at the end as in a run."""
    table = copy.deepcopy(model.table)
    for joint in table["finger"]["joints"].values():
        joint["limited"] = False
    table["finger"].pop("stroke_limiter", None)
    finger = table["finger"]
    joints = {"law": "lugre", "drag_asymmetry": 0.0, "coulomb": decades(model.rng(53), 1e-5, 3e-3)}
    joints = finger.get("joint_friction", {}) | joints | {"stiction": 1.2 * joints["coulomb"]}
    joints.pop("reversal_speed", None)
    finger["joint_friction"] = joints
    if "tendon_friction" in finger:
        finger["tendon_friction"] |= {"place": "canal"}
    scenario = tight(table)
    run = fp.simulate(scenario)
    pressing = [run[name].min() for name in ("tendon_canals_pressing", "tendon_branches_pressing") if name in run]
    if "cord_tension" in run:
        pressing += [run.cord_tension.min() + 1e-9, run.cord_tension.max() - 1.0]
    if min(pressing, default=1.0) <= 0.0:
        return  # In MuJoCo's step friction takes no more than a cord's tension, and its floor where that is slack.
    if "tendon_dry_friction_level" in run:
        later = run.isel(time=slice(len(run.time) // 2, None))
        if np.any(np.abs(later.tendon_dry_friction_force) < 0.9 * later.tendon_dry_friction_level):
            return  # Bristles of a constant loss that have only begun to bend, where MuJoCo's loss holds at once.
    expected = run.isel(time=[0, -1])
    spec = mujoco.MjSpec.from_string(fp.to_mjcf(scenario.finger, limits=False))
    fp.mujoco.add_friction(spec, of=scenario.finger)
    written, given = spec.compile(), held_inputs(model)
    names = [str(name) for name in expected.joint.values]

    def error(step: float) -> float:
        """Return by how much speeds differ at the end after steps of a length, s."""
        written.opt.timestep = step
        data = mujoco.MjData(written)
        for k, name in enumerate(names):
            joint = written.joint(name)
            data.qpos[joint.qposadr] = expected.joint_position.values[0, k]
            data.qvel[joint.dofadr] = expected.joint_velocity.values[0, k]
        for name, value in given.items():
            data.ctrl[written.actuator_ctrladr[written.actuator(name).id]] = value
        for _ in range(round(DURATION / step)):
            mujoco.mj_step(written, data)
        found = np.array([data.qvel[written.joint(name).dofadr][0] for name in names])
        largest = np.abs(expected.joint_velocity.values).max() + 1e-6
        return float(np.abs(found - expected.joint_velocity.values[-1]).max() / largest)

    # Bristles that only bend differ by a percent where a constant loss holds a cord. Stiff ones need shorter steps.
    assert min(off := error(_STEP), error(_STEP / 4.0) if off > 0.03 else off) < 0.03, f"{off:.3g}"
