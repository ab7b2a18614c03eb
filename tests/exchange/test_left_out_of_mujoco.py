"""Elements of a MuJoCo model that are not carried over: listed, or refused by name."""

import tomllib
import warnings
from contextlib import nullcontext

import mujoco
import pytest
from mujoco_models import FIXED, LINK, ROUTED, model_of

import finger_pin as fp
from finger_pin.description.loading import read_scenario
from finger_pin.exceptions import ScenarioWarning

pytestmark = pytest.mark.filterwarnings("ignore:hand. not carried over")


def test_elements_that_are_not_carried_over_are_listed():
    straight = '<spatial name="straight"><site site="s"/><site site="base"/></spatial></tendon>'
    curved = '<tendon name="both" tendon1="t" tendon2="straight" polycoef="0 1 .1 0 0"/>'
    rest = f"""{FIXED.replace("</tendon>", straight)}<equality>{curved}
    <connect name="led" body1="w" body2="hand" anchor="0 0 0"/></equality>
    <actuator><velocity joint="j" kv="1"/><general joint="j" dyntype="user" actdim="2" actrange="-1 1"/>
    <adhesion body="w" ctrlrange="0 1"/></actuator>"""
    body = LINK.replace("<body>", '<body name="w">').replace('name="j"', 'name="j" springref="1"')
    thing = '<body name="thing"><freejoint/><geom size="0.1"/><geom size="0.1"/></body><body name="hand" mocap="true"/>'
    model = model_of(body + '<site name="base"/>' + thing, rest)
    description = fp.from_mujoco(model)
    assert description.tree.left_out == (
        "contacts are disabled in the model: its geoms touch nothing",
        "actuator actuator_1: it has dynamics of its own",
        "actuator actuator_2: it drives a body",
        "equality both: its polynomial is not linear",
        "free body thing: an object is one sphere, box, cylinder, capsule or ellipsoid",
    )
    assert list(description.tree.actuators) == ["actuator_0"]
    assert list(description.tree.bodies) == ["w", "hand"]


def test_ball_joints_are_refused_by_name():
    ball = '<body pos="1 0 0"><joint name="shoulder" type="ball"/><geom size="0.1"/></body>'
    with pytest.raises(fp.InputError, match="joint shoulder: is a ball joint"):
        fp.from_mujoco(model_of(LINK + ball, FIXED))


def test_a_file_that_mujoco_refuses_is_refused_in_its_words_on_one_line(tmp_path):
    (tmp_path / "hand.xml").write_text(ROUTED.replace('joint="j1" kp', 'joint="j9" kp'))
    with pytest.raises(fp.InputError, match="unknown transmission target 'j9'") as refused:
        fp.from_mujoco(tmp_path / "hand.xml")
    assert "\n" not in str(refused.value)
    with pytest.raises(fp.InputError, match=r"must be a mujoco\.MjModel"):
        fp.from_mujoco(7)
    with pytest.raises(fp.InputError, match="no_such"):
        fp.from_mujoco(tmp_path / "no_such.xml")


def test_a_wrap_that_a_point_lies_inside_of_is_listed_and_left_out_as_it_never_wraps():
    tendon = '<spatial name="t"><site site="w"/><geom geom="pin"/><site site="s"/></spatial>'
    body = '<geom name="pin" type="cylinder" size="0.05 0.1" pos="0 0 1"/><site name="w" pos="0.02 0.02 3"/>' + LINK
    model = model_of(body, f"<tendon>{tendon}</tendon>")
    description = fp.from_mujoco(model)
    assert "wrap pin: w lies inside of it, so that the path goes straight" in description.tree.left_out
    data = mujoco.MjData(model)
    data.qpos = [0.3]
    mujoco.mj_forward(model, data)
    assert fp.Hand(description).paths.length(data.qpos) == pytest.approx(data.ten_length, rel=1e-14)


def test_what_moves_or_carries_anything_is_warned_of_once_and_what_does_not_is_only_listed():
    plain = model_of(LINK, FIXED)
    assert fp.from_mujoco(plain).tree.left_out
    driven = (
        FIXED + '<actuator><velocity name="spin" joint="j" kv="1"/><adhesion name="stick" body="w" ctrlrange="0 1"/>'
    )
    model = model_of(LINK.replace("<body>", '<body name="w">'), driven + "</actuator>")
    with pytest.warns(fp.exceptions.LeftOutWarning) as told:
        fp.from_mujoco(model, "gripper")
    assert [str(each.message) for each in told] == ["gripper: not carried over: actuator stick: it drives a body"]


CAM = """<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="cam" axis="0 1 0" RANGE/><geom type="capsule" size=".005" fromto="0 0 0 .04 0 0"/></body>
<body pos="0 1 0"><joint name="lever" axis="0 1 0"/><geom type="capsule" size=".005" fromto="0 0 0 .04 0 0"/></body>
</worldbody><equality><joint joint1="lever" joint2="cam" polycoef="0 .02 .05 0 0"/></equality></mujoco>"""


@pytest.mark.parametrize(("limits", "warned"), [('range="-3 3"', False), ('range="-1 6"', True), ("", True)])
def test_powers_of_an_angle_beyond_half_a_turn_are_warned_of_whoever_wrote_them(limits, warned):
    """The finger is read from TOML: nothing of MuJoCo's list is left."""
    model = mujoco.MjModel.from_xml_string(CAM.replace("RANGE", limits))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = tomllib.loads(fp.to_toml(fp.from_mujoco(model)))
    table["tree"].pop("left_out", None)
    scenario = read_scenario({"name": "cam", "finger": table})
    expected = pytest.warns(ScenarioWarning, match=r"powers: repeat where cam turns") if warned else nullcontext()
    with expected:
        fp.Finger(scenario.finger)
