"""Friction while MuJoCo lets trees sleep, or has actuation disabled."""

import mujoco
import numpy as np
import pytest
from sliders import slider

from finger_pin.mujoco import add_friction, friction

TWO = """<mujoco><option gravity="0 0 0" sleep_tolerance="1e-3"><flag sleep="{sleep}"/></option><worldbody>
<body><joint name="x" type="slide" axis="1 0 0"/><geom size="0.01" mass="0.1"/></body>
<body pos="0 1 0"><joint name="y" type="slide" axis="1 0 0" stiffness="100" springref="0.01"/>
<geom size="0.01" mass="0.1"/></body></worldbody>
<tendon><fixed name="rope"><joint joint="x" coef="-1"/></fixed></tendon>
<actuator><motor name="pull" tendon="rope" gear="-1"/></actuator></mujoco>"""


def test_a_tree_that_friction_holds_falls_asleep_keeps_its_bristles_and_holds_when_it_is_woken():
    found = {}
    for sleep in ("disable", "enable"):
        spec = mujoco.MjSpec.from_string(TWO.format(sleep=sleep))
        law = {"floor": 1.25, "stiffness": 5e4, "viscous": 0.0}
        add_friction(spec, tendons={"rope": {"curvature_offset": 1.0}}, joints={"y": law})
        model = spec.compile()
        found[sleep] = data = mujoco.MjData(model)
        data.ctrl[:] = 0.2
        mujoco.mj_step(model, data, 3000)
    assert found["enable"].qpos[0] == pytest.approx(found["disable"].qpos[0], rel=1e-9)
    # The one that is driven is awake.
    assert data.tree_asleep[0] < 0 <= data.tree_asleep[1]
    bristles = friction(model, data).bristle.copy()
    # The spring pulls with 1 N.
    assert bristles[1] == pytest.approx(1.0, rel=0.01)
    held, data.qfrc_applied[1] = data.qpos[1], 0.1
    mujoco.mj_step(model, data, 500)
    # Bristles give way by more than F / s0, as they near the level, and then hold.
    assert data.tree_asleep[1] < 0 and 1.0 < (data.qpos[1] - held) / (0.1 / 5e4) < 20.0
    assert abs(data.qvel[1]) < 1e-8


def test_what_is_left_without_actuation_is_the_drag():
    model = slider(0.1, coulomb=0.2, curvature_offset=1.0, drag=0.5)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    data = mujoco.MjData(model)
    data.ctrl[0], data.qfrc_applied[0] = 10.0, 1.5
    mujoco.mj_step(model, data, 500)
    assert data.qvel[0] == pytest.approx(1.0 / 0.1, rel=1e-3)


def test_inverse_dynamics_leave_out_what_friction_holds():
    model = slider(0.1, coulomb=0.2, curvature_offset=1.0)
    data, held = mujoco.MjData(model), 8.0 * (1.0 - np.exp(-0.2))
    data.ctrl[:] = 10.0, held - 10.0
    mujoco.mj_step(model, data, 500)
    mujoco.mj_forward(model, data)
    assert abs(data.qacc[0]) < 1e-6 and data.qfrc_constraint[0] == pytest.approx(-held, rel=1e-6)
    mujoco.mj_inverse(model, data)
    # It is at rest under a force, so that the force is what they should find: they find the floor of the friction.
    assert abs(data.qfrc_inverse[0]) <= 1e-4 and data.qfrc_actuator[0] == pytest.approx(held)
