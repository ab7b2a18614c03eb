"""MuJoCo models on which our reading is compared with MuJoCo."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np

HEAD = '<compiler angle="radian"/><option gravity="1 2 -9"><flag contact="disable"/></option>'
#: Two links, every kind of path, actuators that push and pull, servos, springs, dampers and rotors.
ROUTED = f"""<mujoco>{HEAD}<worldbody>
<site name="w0" pos="-0.05 0 0.03"/><site name="w1" pos="-0.05 0.01 -0.03"/>
<geom name="fixed" type="sphere" size="0.012" pos="-0.02 0.012 -0.015"/>
<body name="a"><joint name="j1" axis="0 1 0" damping="0.02" stiffness="0.3" springref="0.2" armature="0.001"/>
 <geom type="capsule" size="0.01" fromto="0 0 0 0.1 0 0"/>
 <geom name="c1" type="cylinder" size="0.011 0.02" euler="1.57 0.2 0"/><site name="side1" pos="0 0 0.03"/>
 <site name="a1" pos="0.04 0.002 0.018"/><site name="a2" pos="0.04 0.01 -0.015"/><site name="a3" pos="0.08 0 0.018"/>
 <body name="b" pos="0.1 0 0" euler="0.1 0.2 0.3"><joint name="j2" axis="0 1 0.2" pos="0.005 0 0" ref="0.3"/>
  <joint name="slider" type="slide" axis="1 0.2 0" ref="0.01" stiffness="50" damping="0.5" range="-0.02 0.03"/>
  <geom type="box" size="0.04 0.01 0.012" pos="0.04 0 0.003" euler="0.3 0 0"/>
  <geom name="c2" type="sphere" size="0.014" pos="0.003 0 0"/><site name="side2" pos="0 0.001 0.03"/>
  <site name="in2" pos="0.004 0.001 0.004"/><site name="b1" pos="0.04 0.004 0.018"/>
  <site name="b2" pos="0.03 -0.01 -0.018"/><site name="tip" pos="0.08 0 0"/></body></body></worldbody>
<tendon>
 <spatial name="top" stiffness="200" springlength="0.05 0.06" damping="0.3"><site site="w0"/>
  <geom geom="c1" sidesite="side1"/><site site="a1"/><site site="a3"/><geom geom="c2" sidesite="side2"/>
  <site site="b1"/></spatial>
 <spatial name="branched"><site site="w1"/><geom geom="fixed"/><site site="a2"/><pulley divisor="2"/><site site="a2"/>
  <geom geom="c2" sidesite="in2"/><site site="b2"/><pulley divisor="3"/><site site="a1"/><site site="b1"/></spatial>
 <spatial name="below"><site site="w1"/><geom geom="c1"/><site site="a2"/><geom geom="c2"/><site site="b2"/></spatial>
 <fixed name="sum" stiffness="20" springlength="0.01" damping="0.3"><joint joint="j1" coef="0.1"/>
  <joint joint="j2" coef="-0.2"/><joint joint="slider" coef="1"/></fixed></tendon>
<actuator><position name="servo" joint="j1" kp="2" kv="0.05" ctrlrange="-1 1" forcerange="-0.8 0.8"/>
 <motor name="pull" tendon="branched" gear="-1" ctrlrange="0 20"/>
 <general name="affine" tendon="top" gear="2" gainprm="-1" biastype="affine" biasprm="0.1 -3 -0.2"/></actuator>
</mujoco>"""


def asset(path):
    """Return the path of a model of `gymnasium-robotics`, which is not imported for it."""
    spec = importlib.util.find_spec("gymnasium_robotics")
    return Path(spec.submodule_search_locations[0], "envs", "assets", path)


MODELS = {
    "routed": lambda: mujoco.MjModel.from_xml_string(ROUTED),
    "shadow": lambda: mujoco.MjModel.from_xml_path(str(asset("hand/reach.xml"))),
    "adroit": lambda: mujoco.MjModel.from_xml_path(str(asset("adroit_hand/adroit_hammer.xml"))),
}


def arms(model, data):
    """Return MuJoCo's dL/dq, shape (t, nv)."""
    dense = np.zeros((model.ntendon, model.nv))
    for row, first, count in zip(dense, model.ten_J_rowadr, model.ten_J_rownnz, strict=True):
        row[model.ten_J_colind[first : first + count]] = data.ten_J[first : first + count]
    return dense


def posture(model, random):
    """Return joint positions within the ranges, or of about half a radian."""
    free = random.uniform(-0.6, 0.6, model.nq)
    within = random.uniform(*model.jnt_range.T)
    return np.where(model.jnt_limited == 1, within, free)


LINK = '<body><joint name="j" axis="0 1 0"/><geom type="box" size="0.1 0.1 0.1"/><site name="s" pos="0.1 0 0"/></body>'
FIXED = '<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>'


def model_of(body, rest):
    return mujoco.MjModel.from_xml_string(f"<mujoco>{HEAD}<worldbody>{body}</worldbody>{rest}</mujoco>")
