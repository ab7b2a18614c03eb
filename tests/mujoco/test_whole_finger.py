"""The whole model in MuJoCo: the paper's finger with friction, and hands read from MuJoCo."""

import mujoco
import numpy as np
import pytest
from mujoco_models import ROUTED
from validation import mujoco_motion

import finger_pin as fp
from finger_pin.description.exercise import exercise
from finger_pin.description.loading import read_scenario

DURATION = 0.06


def test_the_paper_s_finger_in_mujoco_nears_our_motion_at_the_first_order_of_its_step(monkeypatch):
    monkeypatch.setattr(mujoco_motion, "DURATION", DURATION)
    settings = {"duration": DURATION, "rtol": 1e-9, "atol_scale": 1e-10, "sample_rate": 1000.0}
    overrides = {f"simulation.{key}": value for key, value in settings.items()}
    scenario = fp.load_scenario("fig6", {"finger.stroke_limiter.stiffness": 0.0, **overrides})
    result = fp.simulate(scenario)
    ours = result["joint_position"].values
    text = fp.to_mjcf(scenario.finger, posture=tuple(ours[0]), shapes=False, friction=True)
    model = mujoco.MjModel.from_xml_string(text)
    errors = np.array([abs(mujoco_motion.follow(scenario, model, h) - ours).max() for h in (1e-5, 5e-6, 2.5e-6)])
    assert abs(result["tendon_stiction"].values).max() > 0.2 and abs(ours[-1] - ours[0]).max() > 0.003
    assert errors[-1] < 1e-5
    assert np.all(errors[:-1] / errors[1:] > 1.8)


def test_a_routed_hand_with_our_friction_moves_in_mujoco_as_here():
    """What `from_mujoco` reads and simulates, and the model itself with the same friction, at the first order."""
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(ROUTED))
    still = {"simulation.duration": 0.1, "simulation.rtol": 1e-9, "simulation.atol_scale": 1e-9}
    still |= {"finger.stroke_limiter.stiffness": 1e-9, "simulation.sample_rate": 100.0}
    scenario = read_scenario(exercise(description), still)
    result = fp.simulate(scenario)
    pulled = next(iter(scenario.controller.tensions.values()))
    given = {**scenario.controller.inputs, **scenario.controller.tensions}
    spec = mujoco.MjSpec.from_string(ROUTED)
    fp.mujoco.add_friction(spec, tendons={"branched": {}}, joints={"*": {"viscous": 0.0}})
    model = spec.compile()
    model.jnt_limited[:] = 0
    signals = [given[model.actuator(i).name] for i in range(model.nu)]
    errors = []
    for step in (5e-5, 2.5e-5):
        data, model.opt.timestep, error, every = mujoco.MjData(model), step, 0.0, round(0.01 / step)
        for count in range(1, 10 * every + 1):
            swing = [2.0 * np.pi * each.frequency * data.time + each.phase for each in signals]
            data.ctrl = [s.offset + s.amplitude * np.sin(angle) for s, angle in zip(signals, swing, strict=True)]
            mujoco.mj_step(model, data)
            if count % every == 0:
                error = max(error, abs(data.qpos - result.joint_position.values[count // every]).max())
        errors.append(error)
    assert pulled is not None and abs(result.tendon_stiction.values).max() > 0.01
    assert np.ptp(result.joint_position.values, axis=0).max() > 0.05
    assert errors[-1] < 1e-3 and errors[0] / errors[1] > 1.8


def test_levels_and_turns_are_those_that_our_evaluation_finds_for_a_hand():
    hand = fp.Finger("ub_hand")
    text = fp.to_mjcf(fp.load_hand("ub_hand"), friction=True, shapes=False)
    model = mujoco.MjModel.from_xml_string(text)
    data, random = mujoco.MjData(model), np.random.default_rng(4)
    joints = len(hand.routing.joints)
    q, tension = random.uniform(0.1, 0.8, joints), random.uniform(2.0, 9.0, model.nu)
    data.qpos[:joints], data.ctrl[:] = q, tension
    mujoco.mj_forward(model, data)
    signals = fp.mujoco.friction(model, data)
    turn = dict(zip(signals.names, signals.turn, strict=True))
    load = dict(zip(signals.names, signals.tension, strict=True))
    expected = hand.routing.curvature(q)
    for name, phi in zip(hand.routing.tendons, expected, strict=True):
        assert turn[name if name in turn else f"{name}_mass"] == pytest.approx(phi, rel=1e-12)
    # (17) at rest, without a force outside: what the strands that cross a joint pull with.
    strands = np.zeros(hand.routing.loads.shape[1])
    strands[: model.nu] = tension
    passive = hand.tendons.half_stiffness[0] * np.stack(hand.tendons.stretch(q, data.qpos[joints:]), axis=-1)
    strands[model.nu :] = np.maximum(passive, 0.0).ravel()
    for name, reaction in zip(hand.routing.joints, hand.routing.loads @ strands, strict=True):
        assert load[name] == pytest.approx(reaction, rel=1e-12)
