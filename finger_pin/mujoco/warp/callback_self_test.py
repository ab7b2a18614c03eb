"""The callbacks tried in the MuJoCo Warp at hand, on a slider whose answer is known."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from importlib import metadata
from typing import Any

import mujoco
import mujoco_warp
import warp as wp

from finger_pin.exceptions import InputError
from finger_pin.mujoco.self_test import SLIDER

_STEPS = 40


@cache
def try_self_test(device: str, attach: Callable[..., Any]) -> None:
    """Hold a slider below the limit of its tendon's friction, and release it above, once in a process and device.

    This rests on MuJoCo Warp's order of callbacks: friction must load with this step's tension, and be the solver's.

    Args:
        device: Name of Warp's device.
        attach: (m, d, mjm, tendons, joints) -> friction that has been added to them.
    """
    entry = f"mujoco_warp {metadata.version('mujoco-warp')}"
    try:
        passed = _holds_and_releases(device, attach)
    except (AttributeError, TypeError, ValueError, RuntimeError) as error:
        raise InputError(entry, f"friction needs another version: {' '.join(str(error).split())}") from None
    if not passed:
        raise InputError(entry, "friction gives a wrong answer in it: use another version")


def _holds_and_releases(device: str, attach: Callable[..., Any]) -> bool:
    tension, friction_force = 10.0, 10.0 * (1.0 - math.exp(-0.3))
    model = mujoco.MjModel.from_xml_string(SLIDER)
    with wp.ScopedDevice(device):
        m, d = mujoco_warp.put_model(model), mujoco_warp.make_data(model, nworld=2, njmax=2, nconmax=1)
        law = {"coulomb": 0.2, "curvature_offset": 1.5, "stiction_ratio": 1.0, "viscous": 0.0}
        friction = attach(m, d, model, {"rope": law}, None)
        shares, travel, loads_match = (0.8, 1.1), [], True
        for step in range(_STEPS):
            # The tension changes at every step, and the drive with it.
            pull = tension * (1.0 + 0.1 * (step % 3))
            d.ctrl.assign([[-pull, pull * (1.0 - share * friction_force / tension)] for share in shares])
            mujoco_warp.step(m, d)
            loads, forces = friction.tension.numpy()[:, 0], friction.friction.numpy()[:, 0]
            loads_match = loads_match and max(abs(loads / pull - 1.0)) < 1e-4
            travel = list(-d.qpos.numpy()[:, 0])
    time = _STEPS * float(model.opt.timestep)
    # Bristles give way by less than 10 F / s0; what is left over pulls it, 0.1 kg, by 1.1 times the mean tension.
    free_travel = 0.5 * 0.1 * 1.1 * friction_force / 0.1 * time**2
    at_rest = abs(forces[0] / (0.8 * friction_force * pull / tension)) - 1.0
    travels_freely = 0.8 * free_travel < travel[1] < 1.2 * free_travel
    return bool(loads_match and travel[0] < 1e-3 and travels_freely and abs(at_rest) < 0.05)
