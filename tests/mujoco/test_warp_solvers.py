"""Friction in MuJoCo Warp with each of its solvers, behind pulleys and in trees that sleep, and its code for a GPU."""

import math

import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_warp")

import warp as wp
from test_what_mujoco_switches_off import TWO
from warp_worlds import HOOK, advance, control, in_c, in_warp

from finger_pin.mujoco.warp import kernels, row_kernels


def test_a_branch_behind_a_pulley_pulls_as_the_capstan_law_says():
    """10 N before the pulley, half of it in each branch, whose guides turn it by one right angle."""
    spec = mujoco.MjSpec.from_string("""<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody>
    <site name="start" pos="0 0 -0.05"/><site name="pulley"/>
    <site name="left" pos="0.1 0.02 0"/><site name="left_guide" pos="0.15 0.02 0"/>
    <site name="right" pos="0.1 -0.02 0"/><site name="right_guide" pos="0.15 -0.02 0"/>
    <body name="a" pos="0.15 0.02 0.2"><joint name="a" type="slide" axis="0 0 1" damping="2" stiffness="200"/>
    <geom size="0.006" mass="0.05"/><site name="a_tip"/></body>
    <body name="b" pos="0.15 -0.02 -0.2"><joint name="b" type="slide" axis="0 0 1" damping="2" stiffness="200"/>
    <geom size="0.006" mass="0.05"/><site name="b_tip"/></body></worldbody>
    <tendon><spatial name="cord"><site site="start"/><site site="pulley"/>
    <pulley divisor="2"/><site site="left"/><site site="left_guide"/><site site="a_tip"/>
    <pulley divisor="2"/><site site="right"/><site site="right_guide"/><site site="b_tip"/></spatial></tendon>
    <actuator><motor name="pull" tendon="cord" gear="-1" ctrlrange="0 20"/></actuator></mujoco>""")
    law = {"coulomb": 0.2, "viscous": 0.0, "stiction_ratio": 1.0, "stiffness": 1e6}
    m, d, friction = in_warp(spec, 2, {"*": law}, None)
    advance(m, d, 10.0 * np.minimum(1.0, np.arange(700) / 500)[:, None])
    np.testing.assert_allclose(friction.turn.numpy()[:, 1:], 0.5 * math.pi, atol=1e-5)
    pulled = 200.0 * abs(d.qpos.numpy())
    np.testing.assert_allclose(pulled, 5.0 * math.exp(-0.1 * math.pi), rtol=0.01)


@pytest.mark.parametrize("solver, jacobian", [("CG", "dense"), ("CG", "sparse"), ("Newton", "sparse")])
def test_every_solver_gives_the_plugin_s_motion(solver, jacobian):
    option = f'<option solver="{solver}" jacobian="{jacobian}" tolerance="1e-10" iterations="200"'
    text = HOOK.replace("<option", option)
    m, d, friction = in_warp(mujoco.MjSpec.from_string(text), 2)
    assert m.is_sparse == (jacobian == "sparse") and int(m.opt.solver) == getattr(
        mujoco.mjtSolver, f"mjSOL_{solver.upper()}"
    )
    model, data, signals = in_c(mujoco.MjSpec.from_string(text))
    given = [control(model, step) for step in range(100)]
    for each in given:
        data.ctrl[:] = each
        mujoco.mj_step(model, data)
    advance(m, d, given)
    assert abs(data.qpos[0]) > 0.01
    np.testing.assert_allclose(d.qpos.numpy()[1], data.qpos, atol=1e-6)
    np.testing.assert_allclose(friction.friction.numpy()[1], signals.friction, rtol=1e-3)


def test_a_tree_that_friction_holds_falls_asleep_keeps_its_bristles_and_holds_when_it_is_woken():
    found = {}
    for sleep in ("disable", "enable"):
        law = {"floor": 1.25, "stiffness": 5e4, "viscous": 0.0}
        m, d, friction = in_warp(
            mujoco.MjSpec.from_string(TWO.format(sleep=sleep)), 2, {"rope": {"curvature_offset": 1.0}}, {"y": law}
        )
        advance(m, d, np.full((60, 1), 0.2))
        found[sleep] = d.qpos.numpy().copy()
    # The one that is held falls asleep while it still creeps up to the level by less than it has crept.
    np.testing.assert_allclose(found["enable"][:, 0], found["disable"][:, 0], rtol=1e-5)
    np.testing.assert_allclose(found["enable"][:, 1], found["disable"][:, 1], rtol=1e-2)
    asleep = d.tree_asleep.numpy()
    assert np.all(asleep[:, 0] < 0) and np.all(asleep[:, 1] >= 0)
    # The spring pulls with 1 N.
    bristles = friction.state.numpy()[:, friction.index("y"), 0]
    np.testing.assert_allclose(bristles, 1.0, rtol=0.01)
    held = d.qpos.numpy()[0, 1]
    d.qfrc_applied.assign(np.array([[0.0, 0.1], [0.0, 0.0]], np.float32))
    advance(m, d, np.full((60, 1), 0.2))
    woken = d.qpos.numpy()[:, 1]
    # Bristles give way by more than F / s0, as they near the level, and then hold; the other world sleeps on.
    assert d.tree_asleep.numpy()[0, 1] < 0 and 1.0 < (woken[0] - held) / (0.1 / 5e4) < 20.0
    assert d.tree_asleep.numpy()[1, 1] >= 0 and woken[1] == held
    assert abs(d.qvel.numpy()[0, 1]) < 1e-6


@pytest.mark.parametrize("module", [kernels, row_kernels])
def test_kernels_compile_for_an_h100(module, tmp_path):
    wp.compile_aot_module(module, arch=90, module_dir=tmp_path, use_ptx=True)
    (code,) = tmp_path.glob("*.ptx")
    names = [name for name, each in vars(module).items() if isinstance(each, wp.Kernel) and name[0] != "_"]
    text = code.read_text("utf-8")
    assert ".target sm_90" in text and names and all(f".entry {name}_" in text for name in names)
