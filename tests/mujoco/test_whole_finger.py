"""The whole model in MuJoCo: the paper's finger with friction, and hands read from MuJoCo."""

import mujoco
import numpy as np
import pytest
from motions import differences, ours
from mujoco_models import ROUTED, asset
from validation import mujoco_motion

import finger_pin as fp
from finger_pin.mujoco import add_friction, friction

DURATION = 0.06


@pytest.mark.slow
def test_the_paper_s_finger_in_mujoco_nears_our_motion_at_the_first_order_of_its_step(monkeypatch):
    monkeypatch.setattr(mujoco_motion, "DURATION", DURATION)
    settings = {"duration": DURATION, "rtol": 1e-9, "atol_scale": 1e-10, "sample_rate": 1000.0}
    overrides = {f"simulation.{key}": value for key, value in settings.items()}
    scenario = fp.load_scenario("reversals", {"finger.stroke_limiter.stiffness": 0.0, **overrides})
    result = fp.simulate(scenario)
    ours = result["joint_position"].values
    text = fp.to_mjcf(scenario.finger, posture=tuple(ours[0]), shapes=False, friction=True)
    model = mujoco.MjModel.from_xml_string(text)
    errors = np.array([abs(mujoco_motion.follow(scenario, model, h) - ours).max() for h in (1e-5, 5e-6, 2.5e-6)])
    assert abs(result["tendon_stiction"].values).max() > 0.2 and abs(ours[-1] - ours[0]).max() > 0.003
    assert errors[-1] < 1e-5
    assert np.all(errors[:-1] / errors[1:] > 1.8)


@pytest.mark.slow
def test_a_routed_hand_with_our_friction_moves_in_mujoco_as_here():
    """What `from_mujoco` reads and simulates, and the model itself with the same friction, at the first order."""
    spec = mujoco.MjSpec.from_string(ROUTED)
    spec.joint("slider").limited = 0
    scenario, result = ours(spec, 0.1)
    add_friction(spec, tendons={"branched": {}, "top": {}}, joints={"*": {"viscous": 0.0}})
    errors = differences(spec.compile(), scenario, result, (5e-5, 2.5e-5))
    assert abs(result.tendon_stiction.values).max() > 0.01
    assert np.ptp(result.joint_position.values, axis=0).max() > 0.05
    assert errors[-1] < 1e-3 and errors[0] / errors[1] > 1.8


@pytest.mark.slow
def test_a_hand_that_was_changed_and_written_rubs_in_mujoco_as_here():
    """Other coefficients of every tendon and joint, and a turn that the model does not show."""
    spec = mujoco.MjSpec.from_string(ROUTED)
    spec.joint("slider").limited = 0
    scenario, _ = ours(spec, 0.1)
    assert ([*scenario.finger.tendons], scenario.finger.canals) == (["pull"], ("top",))
    changes = {"tendon_friction.coulomb": [0.1, 0.2], "tendon_friction.drag": [0.0, 0.2]}
    changes |= {"joint_friction.coulomb": [1e-3, 2e-3, 4e-3], "joint_friction.stiction": 6e-3}
    changes |= {"joint_friction.drag": [0.0, 5e-3, 0.1], "tree.tendons.top.curvature_offset": 0.8}
    scenario = fp.load_scenario(scenario, {f"finger.{key}": value for key, value in changes.items()})
    result = fp.simulate(scenario)
    text = fp.to_mjcf(scenario.finger, limits=False)
    smooth, rough = mujoco.MjSpec.from_string(text), mujoco.MjSpec.from_string(text)
    add_friction(rough, of=scenario.finger)
    errors = differences(rough.compile(), scenario, result, (5e-5, 2.5e-5))
    assert errors[-1] < 1e-3 and errors[0] / errors[1] > 1.8
    assert differences(smooth.compile(), scenario, result, (5e-5,))[0] > 0.02


def test_the_shadow_hand_with_friction_in_all_joints_moves_in_mujoco_as_here():
    spec = mujoco.MjSpec.from_file(str(asset("hand/reach.xml")))
    # Without its cords, which would load the pins.
    for each in spec.tendons:
        spec.delete(each)
    for each in spec.joints:
        each.limited = 0
    for each in spec.geoms:
        each.contype = each.conaffinity = 0
    scenario, result = ours(spec, 0.05)
    add_friction(spec, joints={"*": {"viscous": 0.0}})
    errors = differences(spec.compile(), scenario, result, (1e-4, 5e-5))
    # All 24 rub at what the model's friction loss is.
    np.testing.assert_allclose(abs(result.joint_stiction.values).max(axis=0), 1e-3, rtol=0.3)
    assert np.ptp(result.joint_position.values, axis=0).max() > 0.3
    assert errors[-1] < 2e-4 and errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


def test_levels_and_turns_are_those_that_our_evaluation_finds_for_a_hand():
    hand = fp.Finger("ub_hand")
    text = fp.to_mjcf(fp.load_hand("ub_hand"), friction=True, shapes=False)
    model = mujoco.MjModel.from_xml_string(text)
    data, random = mujoco.MjData(model), np.random.default_rng(4)
    joints = len(hand.routing.joints)
    q, tension = random.uniform(0.1, 0.8, joints), random.uniform(2.0, 9.0, model.nu)
    data.qpos[:joints], data.ctrl[:] = q, tension
    mujoco.mj_forward(model, data)
    signals = friction(model, data)
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


JAW = """<body pos="{x} 0 0"><joint name="{name}" type="slide" axis="{way} 0 0" stiffness="150" springref="-0.02"
damping="0.5"/><geom type="box" size="0.005 0.02 0.02" mass="0.05" solref="0.005 1"/></body>"""
GRIPPER = f"""<mujoco><option cone="elliptic" impratio="50"/><worldbody>
{JAW.format(name="left", x=-0.025, way=1)}{JAW.format(name="right", x=0.025, way=-1)}
<body name="box"><freejoint/><geom type="box" size="0.018 0.01 0.01" mass="0.05" solref="0.005 1"/></body></worldbody>
<tendon><fixed name="left"><joint joint="left" coef="-1"/></fixed>
<fixed name="right"><joint joint="right" coef="-1"/></fixed></tendon>
<actuator><motor tendon="left" gear="-1"/><motor tendon="right" gear="-1"/></actuator></mujoco>"""


def test_a_grasp_that_is_let_go_by_half_is_held_by_friction_and_lost_by_mujoco_s_own():
    """Springs open the jaws with 3.3 N; 12 N close them, of 2.5 N friction keeps up to 2.5 exp(0.6) = 4.6 N."""
    fallen = {}
    for name in ("our", "constant"):
        spec = mujoco.MjSpec.from_string(GRIPPER)
        if name == "our":
            law = {"coulomb": 0.2, "curvature_offset": 3.0, "viscous": 0.0, "stiction_ratio": 1.0}
            add_friction(spec, tendons={"*": law})
        else:
            for tendon in spec.tendons:
                tendon.frictionloss = 2.5 * (np.exp(0.6) - 1.0)
        model = spec.compile()
        data = mujoco.MjData(model)
        for tension, steps in ((12.0, 50), (2.5, 5000)):
            data.ctrl[:] = tension
            mujoco.mj_step(model, data, steps)
        fallen[name] = -data.body("box").xpos[2]
    # What is left of 0.5 mm in ten seconds is the creep of MuJoCo's contacts.
    assert fallen["our"] < 1e-3 and fallen["constant"] > 1.0
