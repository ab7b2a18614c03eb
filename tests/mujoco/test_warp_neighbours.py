"""Friction in Newton's SolverMuJoCo and in mjlab, as its page shows: the same numbers as in MuJoCo Warp alone."""

import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco_warp")

import mujoco
from warp_worlds import HOOK, TENDONS, advance, in_warp

import finger_pin as fp

PAGE = Path(fp.mujoco.warp.__file__).with_name("README.md")


def shown(package):
    """Return the names after the page's first snippet, and after the one that imports a package."""
    first, *others = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    (block,) = (each for each in others if re.search(rf"^(import|from) {package}\b", each, re.MULTILINE))
    names = {}
    for code in (first, block):
        exec(code, names)
    return names


@pytest.mark.filterwarnings("ignore")
def test_newton_s_solver_steps_friction_as_mujoco_warp_does():
    pytest.importorskip("newton")
    names = shown("newton")
    _, d, friction = in_warp_after(20, tendons=TENDONS, joints=None)
    np.testing.assert_allclose(names["state"].joint_q.numpy(), d.qpos.numpy()[0, 0], atol=1e-6)
    np.testing.assert_allclose(names["friction"].level.numpy()[-1], friction.level.numpy()[0], rtol=1e-3)


@pytest.mark.filterwarnings("ignore")
def test_mjlab_s_worlds_have_coefficients_of_their_own_and_move_as_in_mujoco_warp():
    pytest.importorskip("mjlab")
    env = shown("mjlab")["env"]
    coulomb, level = (each.numpy()[:, 0] for each in (env.friction.coulomb, env.friction.level))
    assert 0.05 <= coulomb.min() < 0.1 < 0.25 < coulomb.max() <= 0.3
    _, d, friction = in_warp_after(
        100, tendons={"*": {"coulomb": float(coulomb[3]), "curvature_offset": 1.0}}, joints=None
    )
    np.testing.assert_allclose(env.sim.wp_data.qpos.numpy()[3], d.qpos.numpy()[0], atol=1e-6)
    np.testing.assert_allclose(level[3], friction.level.numpy()[0, 0], rtol=1e-3)


def in_warp_after(steps, **chosen):
    """Return a hook in MuJoCo Warp after steps under 5 N, with its friction."""
    m, d, friction = in_warp(mujoco.MjSpec.from_string(HOOK), 1, **chosen)
    advance(m, d, np.full((steps, 1), 5.0))
    return m, d, friction
