"""Jumps of the length of cords over wraps, beside MuJoCo's lengths."""

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis import path_jumps
from finger_pin.exceptions import PathJumpWarning
from finger_pin.simulation.initial_state import failure_advice

#: An arm that turns past the tangent of its anchor to a drum, over which its cord goes on the upper side.
CRANK = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><site name="from" pos="-0.05 0 0"/>
<body><joint name="hinge" axis="0 1 0" range="-3 {upper}" damping="0.001" armature="1e-5"/>
<geom size="0.01" mass="0.02" pos="0.05 0 0"/><site name="to" pos="0.05 0 0"/></body>
<geom name="drum" type="cylinder" size="0.01 0.02" pos="0.005 0 0" euler="1.5707963 0 0"/>
<site name="side" pos="0.005 0 0.03"/></worldbody><tendon><spatial name="cord" stiffness="20" springlength="0 0.2">
<site site="from"/><geom geom="drum" sidesite="side"/><site site="to"/></spatial></tendon>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"""


def test_the_jump_of_a_length_is_where_mujoco_has_it():
    model = mujoco.MjModel.from_xml_string(CRANK.format(upper=3))
    data, angles, lengths = mujoco.MjData(model), np.linspace(-3.0, 3.0, 6001), []
    for data.qpos[0] in angles:
        mujoco.mj_kinematics(model, data)
        mujoco.mj_tendon(model, data)
        lengths.append(float(data.ten_length[0]))
    steps = np.diff(lengths)
    largest = np.argmax(np.abs(steps))
    assert np.sort(np.abs(steps))[-2] < 1e-4
    (jump,) = path_jumps(fp.from_mujoco(model), [0.5])
    assert (jump.cord, jump.wrap, jump.joint) == ("cord", "drum", "hinge")
    assert angles[largest] <= jump.position <= angles[largest + 1]
    assert jump.size == pytest.approx(steps[largest], abs=1e-4)


def test_a_range_without_the_place_and_a_cord_without_a_wrap_have_no_jump():
    assert path_jumps(fp.from_mujoco(mujoco.MjModel.from_xml_string(CRANK.format(upper=1.4))), [0.5]) == ()
    assert path_jumps("ub_stand_in", np.zeros(4)) == ()


def test_a_run_warns_of_the_jump_and_one_that_ends_there_is_advised_by_it():
    finger = fp.Finger(fp.from_mujoco(mujoco.MjModel.from_xml_string(CRANK.format(upper=3))))
    scenario = fp.load_scenario("pendulum", {"simulation.duration": 0.002})
    scenario = scenario.updated(
        finger=finger.description, controller={"kind": "tensions"}, simulation={"initial": None}
    )
    said = r"length of a cord jumps: cord over drum by -48.2 mm at hinge 1.471"
    with pytest.warns(PathJumpWarning, match=said):
        result = fp.simulate(scenario)
    assert "cord over drum" in result.attrs["path_jump"]
    assert "cord over drum by -48.2 mm" in failure_advice(finger, "it ended", finger.rest_state([1.47]))
    assert "jumps" not in failure_advice(finger, "it ended", finger.rest_state([0.5]))
