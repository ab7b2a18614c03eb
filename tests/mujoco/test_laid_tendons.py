"""Tendons laid over a model without any: the same in MuJoCo and in what we read of it."""

import tomllib

import mujoco
import numpy as np
import pytest
from motions import differences, ours

import finger_pin as fp

BARE = """<mujoco><compiler angle="radian"/><worldbody><body name="palm"><geom size="0.02" mass="0.1"/>
<body name="near" pos="0.03 0 0"><joint name="mcp" axis="0 1 0" range="-0.2 1.4" damping="0.002"/>
<geom type="capsule" size="0.006" fromto="0 0 0 0.04 0 0" mass="0.01"/>
<body name="far" pos="0.04 0 0"><joint name="pip" axis="0 1 0" range="0 1.4" damping="0.002"/>
<geom type="capsule" size="0.005" fromto="0 0 0 0.03 0 0" mass="0.008"/></body></body></body></worldbody></mujoco>"""
LAID = """
[tendons.extensor]
joints = { mcp = 0.006, pip = 0.004 }
pull = 20.0

[tendons.flexor.path]
start = { kind = "point", body = "palm", position = [0.0, 0.0, -0.004] }
wheel = { kind = "cylinder", body = "near", radius = 0.006, orientation = [0.7071068, 0, 0, 0.7071068], \
side = [0, -0.1, 0] }
guide = { kind = "point", body = "near", position = [0.03, 0.0, -0.004] }
end = { kind = "point", body = "far", position = [0.02, 0.0, -0.006] }
"""


@pytest.mark.parametrize("mcp, wrapped", [(-0.1, True), (0.4, False)])
def test_they_have_the_same_lengths_arms_and_pulls_there_and_here(tmp_path, mcp, wrapped):
    (tmp_path / "laid.toml").write_text(LAID)
    (tmp_path / "bare.xml").write_text(BARE)
    described = fp.from_mujoco(tmp_path / "bare.xml", tendons=tmp_path / "laid.toml")
    assert list(described.tendons) == ["extensor", "flexor"] and not described.tree.actuators
    spec = mujoco.MjSpec.from_string(BARE)
    fp.mujoco.add_tendons(spec, tmp_path / "laid.toml")
    fp.mujoco.add_friction(spec, tendons={"*": {"coulomb": 0.12}}, joints={"*": {}})
    model = spec.compile()
    data, hand = mujoco.MjData(model), fp.Hand(described)
    data.qpos, data.ctrl = [mcp, 0.3], [1.0, 3.0]
    mujoco.mj_forward(model, data)
    assert data.ten_wrapnum[model.tendon("flexor").id] == (5 if wrapped else 3)
    order = [model.tendon(name).id for name in described.tree.tendons]
    np.testing.assert_allclose(hand.paths.length(data.qpos), data.ten_length[order], atol=1e-12)
    dense = np.zeros((2, 2))
    mujoco.mju_sparse2dense(dense, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind)
    np.testing.assert_allclose(hand.paths.arms(data.qpos), dense[order], atol=1e-12)
    # The extensor's turn is that of its joints, (15) with an offset of zero, the flexor's that of its path.
    signals = fp.mujoco.friction(model, data)
    assert signals.turn[signals.index("extensor")] == pytest.approx(abs(mcp) + 0.3)
    assert signals.turn[signals.index("flexor")] == pytest.approx(hand.paths.turn(data.qpos)[order.index(1)], abs=1e-9)
    assert signals.tension[signals.index("flexor")] == pytest.approx(3.0)


@pytest.mark.slow
def test_they_move_alike_there_and_here_with_friction_around_joints_and_along_a_path():
    spec = mujoco.MjSpec.from_string(BARE)
    fp.mujoco.add_tendons(spec, tomllib.loads(LAID)["tendons"])
    for each in (*spec.joints, *spec.tendons):
        each.limited = 0
    scenario, result = ours(spec, 0.1)
    fp.mujoco.add_friction(spec, tendons={"*": {}}, joints={"*": {"viscous": 0.0}})
    errors = differences(spec.compile(), scenario, result, (5e-5, 2.5e-5))
    assert np.all(abs(result.tendon_stiction.values).max(axis=0) > 0.01)
    assert np.ptp(result.joint_position.values, axis=0).max() > 0.05
    assert errors[-1] < 1e-3 and errors[0] / errors[1] > 1.8


@pytest.mark.parametrize(
    "tendons, entry",
    [
        ({"t": {"joints": {"mpc": 0.01}}}, "tendons.t.joints.mpc"),
        ({"t": {"joints": {"mcp": 0.01}, "pul": 1.0}}, "tendons.t.pul"),
        ({"t": {}}, "tendons.t"),
        ({"t": {"joints": {"mcp": 0.01}, "stiffness": 1.0, "slack": 0.0}}, "tendons.t.slack"),
        ({"t": {"joints": {"mcp": 0.01}, "path": {}}}, "tendons.t"),
        ("nowhere.toml", "tendons nowhere.toml"),
    ],
)
def test_wrong_tendons_are_named(tendons, entry):
    with pytest.raises(fp.InputError) as caught:
        fp.mujoco.add_tendons(mujoco.MjSpec.from_string(BARE), tendons)
    assert caught.value.entry == entry
