"""Motions of MuJoCo models here and there, in which every actuator goes to and fro."""

import mujoco
import numpy as np

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario


def ours(spec, duration):
    """Return the scenario in which every actuator of a model goes to and fro, and our motion, without ranges."""
    still = {"simulation.duration": duration, "simulation.rtol": 1e-9, "simulation.atol_scale": 1e-9}
    still |= {"simulation.sample_rate": 100.0}
    hand = fp.from_mujoco(spec)
    if any(joint.limited for joint in hand.joints.values()):
        still |= {"finger.stroke_limiter.stiffness": 1e-9}
    scenario = read_scenario(demo_motion(hand), still)
    return scenario, fp.simulate(scenario)


def differences(model, scenario, result, steps):
    """Return MuJoCo's largest differences from our motion by time step, rad or m."""
    given = {**scenario.controller.inputs, **scenario.controller.tensions}
    signals = [given[model.actuator(i).name.replace(":", "_")] for i in range(model.nu)]
    positions, errors = result.joint_position.values, []
    for step in steps:
        data, model.opt.timestep, error, every = mujoco.MjData(model), step, 0.0, round(0.01 / step)
        data.qpos = positions[0]
        for count in range(1, (len(positions) - 1) * every + 1):
            swing = [2.0 * np.pi * each.frequency * data.time + each.phase for each in signals]
            data.ctrl = [s.offset + s.amplitude * np.sin(angle) for s, angle in zip(signals, swing, strict=True)]
            mujoco.mj_step(model, data)
            if count % every == 0:
                error = max(error, abs(data.qpos - positions[count // every]).max())
        errors.append(error)
    return errors
