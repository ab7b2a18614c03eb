"""URDF of trees of bodies: Pinocchio and yourdfpy read from it the body that the tree itself makes."""

from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from mujoco_models import MODELS

import finger_pin as fp


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::finger_pin.exceptions.LeftOutWarning")
@pytest.mark.parametrize("name", MODELS)
def test_inertia_gravity_and_tip_are_those_of_the_tree(name):
    description = fp.from_mujoco(MODELS[name]())
    body, text = fp.Finger(description).rigid_body, fp.to_urdf(description)
    model = pin.buildModelFromXML(text)
    model.gravity.linear[:] = description.gravity
    data, places = model.createData(), [model.joints[model.getJointId(joint)] for joint in description.joints]
    joints = list(description.tree.joints.values())
    for q in np.random.default_rng(4).uniform(-0.8, 0.8, (4, len(joints))):
        theirs = pin.neutral(model)
        for joint, angle in zip(places, q, strict=True):
            # A hinge that turns on has a cosine and a sine.
            theirs[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
        order = [joint.idx_v for joint in places]
        mass = pin.crba(model, data, theirs)
        mass = np.triu(mass) + np.triu(mass, 1).T
        armature = np.diag([joint.armature for joint in joints])
        ours = body.mass_matrix(q) - armature
        np.testing.assert_allclose(mass[np.ix_(order, order)], ours, atol=1e-9 * np.abs(ours).max())
        gravity = pin.computeGeneralizedGravity(model, data, theirs)[order]
        np.testing.assert_allclose(gravity, body.gravity_torque(q), atol=1e-9)
        pin.framesForwardKinematics(model, data, theirs)
        frames = [f"{tip}_fingertip" if tip else "fingertip" for tip in description.tree.fingertips]
        tips = [data.oMf[model.getFrameId(frame)].translation for frame in frames]
        np.testing.assert_allclose(np.squeeze(tips), body.tip_position(q), atol=1e-12)
    root = ElementTree.fromstring(text)
    assert len(root.findall("joint[limit]")) == len(joints)


def test_ranges_friction_shapes_and_joints_that_follow_are_written_and_the_rest_is_named():
    text = """<mujoco><compiler angle="radian"/><worldbody><body name="a"><joint name="a" axis="0 1 0" range="-0.5 1"
    limited="true" damping="0.02" frictionloss="0.003"/><geom type="capsule" size="0.01" fromto="0 0 0 0.04 0 0"/>
    <body name="b" pos="0.04 0 0"><joint name="b" axis="0 1 0"/><geom type="box" size="0.01 0.005 0.004"/></body></body>
    </worldbody><equality><joint joint1="b" joint2="a" polycoef="0.1 0.7 0 0 0"/></equality></mujoco>"""  # fmt: skip
    root = ElementTree.fromstring(fp.to_urdf(fp.from_mujoco(mujoco.MjModel.from_xml_string(text))))
    joint, other = root.find("joint[@name='a']"), root.find("joint[@name='b']")
    assert (joint.get("type"), other.get("type")) == ("revolute", "continuous")
    assert joint.find("limit").get("lower") == "-0.5" and joint.find("limit").get("upper") == "1.0"
    assert joint.find("dynamics").attrib == {"damping": "0.02", "friction": "0.003"}
    assert other.find("mimic").attrib == {"joint": "a", "multiplier": "0.7", "offset": "0.1"}
    capsule = root.findall("link[@name='a']/collision")
    assert [next(iter(each.find("geometry"))).tag for each in capsule] == ["cylinder", "sphere", "sphere"]
    assert root.find("link[@name='b']/collision/geometry/box").get("size") == "0.02 0.01 0.008"


def test_drag_that_differs_by_direction_is_written_as_its_mean_and_named():
    from finger_pin.mujoco import add_friction

    text = """<mujoco><worldbody><body name="a"><joint name="a"/><geom size="0.01"/></body></worldbody></mujoco>"""
    finger = fp.from_mujoco(mujoco.MjModel.from_xml_string(text)).updated(
        joint_friction={"drag": 0.004, "drag_asymmetry": 0.3}
    )
    urdf, mjcf = fp.to_urdf(finger), fp.to_mjcf(finger)
    assert ElementTree.fromstring(urdf).find("joint[@name='a']/dynamics").get("friction") == "0.004"
    assert float(ElementTree.fromstring(mjcf).find(".//joint[@name='a']").get("frictionloss")) == 0.004
    assert "drag_asymmetry" in urdf and "drag_asymmetry" in mjcf
    spec = mujoco.MjSpec.from_string(mjcf)
    for choice in ({"of": finger}, {"joints": {"*": {"drag": 0.004, "drag_asymmetry": 0.3}}}):
        with pytest.raises(fp.InputError, match=r"drag_asymmetry = 0\.3: must be 0"):
            add_friction(spec, **choice)
