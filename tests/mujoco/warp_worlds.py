"""Worlds of MuJoCo Warp with our friction, and the same model in C MuJoCo with our plugin."""

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from mujoco_models import ROUTED, asset

import finger_pin as fp

wp.config.log_level = wp.LOG_ERROR

#: The hook of the room's page, on a lever and a wrap.
HOOK = """<mujoco><option timestep="0.002"/><worldbody><site name="anchor" pos="-0.03 0 -0.01"/><body name="hook">
<joint name="hinge" axis="0 1 0" range="-0.2 1.2" armature="1e-5"/>
<geom type="capsule" size="0.008" fromto="0 0 0 0.06 0 0"/>
<geom name="pulley" type="cylinder" size="0.007 0.01" euler="90 0 0"/><site name="below" pos="0 0 -0.02"/>
<site name="insertion" pos="0.03 0 -0.008"/></body></worldbody><tendon><spatial name="flexor"><site site="anchor"/>
<geom geom="pulley" sidesite="below"/><site site="insertion"/></spatial></tendon>
<actuator><motor name="pull" tendon="flexor" gear="-1" ctrlrange="0 20"/></actuator></mujoco>"""
#: A slider that its tendon holds back from a motor on its joint.
SLIDER = """<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody><body>
<joint name="x" type="slide" axis="1 0 0"/><geom size="0.01" mass="0.1"/></body></worldbody>
<tendon><fixed name="rope"><joint joint="x" coef="-1"/></fixed></tendon>
<actuator><motor name="pull" tendon="rope" gear="-1"/><motor name="push" joint="x"/></actuator></mujoco>"""


def routed():
    """Return two links with every kind of path, and a ball that hits them and loads their pins."""
    spec = mujoco.MjSpec.from_string(ROUTED.replace('<flag contact="disable"/>', ""))
    ball = spec.worldbody.add_body(name="ball", pos=[0.08, 0.0, 0.1])
    ball.add_freejoint()
    ball.add_geom(size=[0.01, 0, 0], mass=0.02)
    return spec


MODELS = {
    "hook": lambda: mujoco.MjSpec.from_string(HOOK),
    "routed": routed,
    "shadow": lambda: mujoco.MjSpec.from_file(str(asset("hand/reach.xml"))),
}
TENDONS, JOINTS = {"*": {"coulomb": 0.12, "curvature_offset": 1.0}}, {"*": {}}


def in_warp(spec, worlds=1, tendons=TENDONS, joints=JOINTS, rows=200, contacts=60):
    """Return MuJoCo Warp's model and data with friction, and this."""
    fp.mujoco.warp.add_branches(spec)
    model = spec.compile()
    size = {"njmax": rows, "njmax_nnz": rows * model.nv, "nconmax": contacts}
    m, d = mjw.put_model(model), mjw.make_data(model, nworld=worlds, **size)
    return m, d, fp.mujoco.warp.add_friction(m, d, model, tendons=tendons, joints=joints)


def in_c(spec, tendons=TENDONS, joints=JOINTS):
    """Return MuJoCo's model and data with our plugin, and its signals."""
    fp.mujoco.add_friction(spec, tendons=tendons, joints=joints)
    model = spec.compile()
    data = mujoco.MjData(model)
    return model, data, fp.mujoco.friction(model, data)


def control(model, step):
    """Return controls, each to and fro about the middle of its range."""
    low, high = np.where(model.actuator_ctrllimited[: model.nu, None], model.actuator_ctrlrange[: model.nu], [-1, 1]).T
    swing = np.sin(0.013 * step * (1.0 + 0.1 * np.arange(model.nu)))
    return (0.5 * (low + high) + 0.25 * (high - low) * swing).astype(np.float32)


def advance(m, d, controls):
    """Step all worlds under controls, shape (steps, nu) or (steps, worlds, nu)."""
    for each in controls:
        d.ctrl.assign(np.broadcast_to(each, d.ctrl.shape).astype(np.float32))
        mjw.step(m, d)
