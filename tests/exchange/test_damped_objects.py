"""Damping of free bodies: MuJoCo's own run of what is thrown, a closed form, what is written, and what cannot be."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_mjcf_tree import assert_alike
from test_mujoco_motion import both

import finger_pin as fp
from finger_pin.exceptions import LeftOutWarning

DAMPING = 0.004
THROWN = f"""<mujoco><option timestep="1e-4" integrator="RK4"/><worldbody>
<body><joint name="j"/><geom size="0.01" mass="0.1" contype="0" conaffinity="0"/></body>
<body name="block" pos="1 0 2" euler="10 20 30"><joint type="free" damping="{DAMPING}"/>
<geom name="g" type="box" size="0.03 0.02 0.05" mass="0.05" euler="0 40 0"/></body></worldbody>
<keyframe><key qpos="0 1 0 2 0.9 0.1 0.3 0.2" qvel="0 2 -1 3 8 -5 12"/></keyframe></mujoco>"""


def test_a_thrown_body_that_is_damped_flies_and_turns_as_in_mujoco_and_closes_the_account():
    data, result = both(THROWN, 0.3)
    np.testing.assert_allclose(result.object_position[-1, 0], data.body("block").xpos, atol=1e-7)
    # The frame of the object is that of the geom.
    turn = Rotation.from_matrix(data.geom("g").xmat.reshape(3, 3))
    assert (turn * Rotation.from_quat(result.object_orientation.values[-1, 0]).inv()).magnitude() < 1e-6
    assert (turn * Rotation.from_quat(result.object_orientation.values[0, 0]).inv()).magnitude() > 0.1
    # m v' = -d v - m g.
    rate, g = DAMPING / 0.05, 9.81
    expected = 2.0 - g / rate * 0.3 + (3.0 + g / rate) * -np.expm1(-rate * 0.3) / rate
    assert float(result.object_position[-1, 0, 2]) == pytest.approx(expected, abs=1e-7)
    lost = float(result.energy_exchanged_object_damping[-1])
    assert lost > 0.01 and float(abs(result.energy_residual).max()) < 1e-6 * lost


def test_damping_of_objects_is_written_as_it_was_read_and_another_of_turning_is_named():
    hand = fp.from_mujoco(mujoco.MjModel.from_xml_string(THROWN))
    text = fp.to_mjcf(hand)
    again = fp.from_mujoco(mujoco.MjModel.from_xml_string(text))
    assert_alike(again.tree.objects["block"], hand.tree.objects["block"])
    assert hand.tree.objects["block"].angular_damping == DAMPING and "angular_damping" not in text
    other = fp.load_finger(hand, {"finger.tree.objects.block.angular_damping": 1e-5})
    assert "angular_damping of object block, 1e-05 N m s/rad, which is its damping, 0.004" in fp.to_mjcf(other)


def test_damping_at_another_point_than_the_middle_of_a_geom_is_listed():
    aside = THROWN.replace('name="g"', 'name="g" pos="0.01 0 0"').replace('damping="', 'frictionloss="1e-3" damping="')
    with pytest.warns(LeftOutWarning):
        hand = fp.from_mujoco(mujoco.MjModel.from_xml_string(aside))
    assert set(hand.tree.left_out) >= {
        "free body block: damping at another point than the middle of its geom",
        "free body block: friction loss",
    }
    with pytest.raises(fp.InputError, match=r"damping = 0\.1: is for objects with a mass"):
        fp.load_finger(hand, {"finger.tree.objects": {"wall": {"shape": "sphere", "radius": 1.0, "damping": 0.1}}})
