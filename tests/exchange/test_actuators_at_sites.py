"""Actuators at sites: MuJoCo's own run of wrenches along a site's axes and another's, written and read again."""

import mujoco
import numpy as np
import pytest
from test_mjcf_tree import assert_alike
from test_mujoco_motion import both

import finger_pin as fp
from finger_pin.exceptions import LeftOutWarning

ARM = """<mujoco><compiler angle="radian"/><option timestep="1e-4" integrator="RK4"/>
<default><geom type="capsule" contype="0" conaffinity="0"/></default><worldbody>
<site name="anchor" pos="0.1 0.05 0.2" euler="0.3 -0.5 0.2"/>
<body pos="0 0 0.1"><joint name="shoulder" axis="0 1 0"/><geom size="0.01" fromto="0 0 0 0.1 0 0" mass="0.1"/>
 <site name="upper" pos="0.05 0.01 0" euler="0.1 0.4 -0.2"/>
 <body pos="0.1 0 0"><joint name="elbow" axis="0.2 0.5 1"/><geom size="0.01" fromto="0 0 0 0.08 0.02 0" mass="0.05"/>
  <site name="end" pos="0.08 0.02 0.01" euler="-0.4 0.2 0.7"/></body></body>
<body name="drone" pos="0 1 0.2" euler="0.1 0.2 0"><freejoint/><geom size="0.02" fromto="-0.02 0 0 0.05 0 0"
 mass="0.08"/><site name="rotor" pos="0.05 0.02 0.01" euler="0.1 0 0"/></body></worldbody>
<actuator><motor name="jet" site="end" gear="0.3 0.1 -0.2 0.001 0.002 0.003"/>
<motor name="pull" site="end" refsite="anchor" gear="0 0.4 0.5 0.003 0 0.001"/>
<position name="held" site="end" refsite="anchor" gear="0.8 0.3 0 0 0 0" kp="20" kv="0.5"/>
<motor name="inner" site="end" refsite="upper" gear="0 0.2 0 0.002 0 0.01"/>
<position name="lift" site="rotor" gear="0 0 1 0 0 0.002" kp="0.8"/></actuator>
<keyframe>
<key qpos="0.2 -0.3 0 1 0.2 1 0 0 0" qvel="1 -2 0.1 0 0 1 2 0" ctrl="0.5 0.4 0.1 0.6 0.9"/></keyframe></mujoco>
"""


def test_wrenches_at_sites_move_links_and_a_free_body_as_in_mujoco():
    data, result = both(ARM, 0.2)
    end = {str(name): float(result.joint_position.sel(joint=name)[-1]) for name in result.joint.values}
    assert np.ptp(result.joint_position.sel(joint="elbow").values) > 0.3
    expected = {"shoulder": data.qpos[0], "elbow": data.qpos[1]}
    start = mujoco.MjData(data.model)
    mujoco.mj_forward(data.model, start)
    moved = data.body("drone").xipos - start.body("drone").xipos
    expected |= {f"drone_{axis}": value for axis, value in zip("xyz", moved, strict=True)}
    assert {name: end[name] for name in expected} == pytest.approx(expected, abs=1e-5)
    assert abs(moved[2]) > 0.01


def test_a_model_with_actuators_at_sites_is_written_as_it_was_read():
    model = mujoco.MjModel.from_xml_string(ARM)
    hand = fp.from_mujoco(model)
    again = mujoco.MjModel.from_xml_string(fp.to_mjcf(hand))
    for name, actuator in fp.from_mujoco(again).tree.actuators.items():
        assert_alike(actuator, hand.tree.actuators[name])
    rng, state, other = np.random.default_rng(3), mujoco.MjData(model), mujoco.MjData(again)
    names = ["shoulder", "elbow"]
    for data in (state, other):
        data.ctrl[:] = model.key_ctrl[0]
        for name, angle, speed in zip(names, *rng.normal(size=(2, 2)), strict=True):
            data.joint(name).qpos, data.joint(name).qvel = angle, speed
        rng = np.random.default_rng(3)
        mujoco.mj_forward(data.model, data)
    assert [float(other.joint(name).qacc[0]) for name in names] == pytest.approx(
        [float(state.joint(name).qacc[0]) for name in names], rel=1e-9
    )


@pytest.mark.parametrize(
    "changed, reason",
    [
        (('site="end" refsite="upper"', 'site="upper" refsite="end"'), "inner: its refsite moves beside its site"),
        (('kv="0.5"', 'kv="0.5" gear="1 0 0 0 1 0"'), "held: it drives an angle between sites"),
        (('motor name="jet" site="end"', 'motor name="jet" site="anchor"'), "jet: its site stands still"),
    ],
)
def test_what_a_wrench_cannot_say_is_listed(changed, reason):
    text = ARM.replace('gear="0.8 0.3 0 0 0 0" kp="20" kv="0.5"', 'kp="20" kv="0.5"') if "kv" in changed[0] else ARM
    with pytest.warns(LeftOutWarning):
        hand = fp.from_mujoco(mujoco.MjModel.from_xml_string(text.replace(*changed)))
    assert f"actuator {reason}" in hand.tree.left_out and len(hand.tree.actuators) == 4


def test_statics_refuses_wrenches_without_an_energy_and_keys_without_a_length():
    hand = fp.from_mujoco(mujoco.MjModel.from_xml_string(ARM))
    with pytest.raises(fp.InputError, match=r"actuators\.jet\.wrench: must be a force with axes"):
        fp.analysis.equilibrium(hand, np.zeros(5))
    with pytest.raises(fp.InputError, match=r"jet\.by_length.*needs a length"):
        fp.load_finger(hand, {"finger.tree.actuators.jet.by_length": -1.0})
