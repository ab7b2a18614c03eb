"""Friction in MuJoCo Warp: the plugin's in C MuJoCo, closed forms, and worlds that are alike to the last bit."""

import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_warp")

import mujoco_warp as mjw
import warp as wp
from warp_worlds import HOOK, JOINTS, MODELS, SLIDER, TENDONS, advance, control, in_c, in_warp

import finger_pin as fp

LAW = {"coulomb": 0.2, "curvature_offset": 1.0, "stiction_ratio": 1.0, "viscous": 0.0}
STEPS = 250


def controls(spec, steps=STEPS):
    """Return controls of a model's actuators, shape (steps, nu)."""
    model = spec.compile()
    return np.array([control(model, k) for k in range(steps)])


# Single precision: MuJoCo Warp alone differs by as much, most where a ball bounces.
@pytest.mark.parametrize("name, worlds, allowed", [("hook", 64, 2e-7), ("routed", 3, 1e-4), ("shadow", 3, 3e-6)])
def test_worlds_move_as_one_in_c_with_the_plugin(name, worlds, allowed):
    m, d, friction = in_warp(MODELS[name](), worlds)
    model, data, signals = in_c(MODELS[name]())
    assert friction.names == signals.names and (name != "routed" or "branched_branch_2" in friction.names)
    pins, contacts = [i for i, each in enumerate(friction.names) if each in ("j1", "j2")], 0
    for each in controls(MODELS[name]()):
        data.ctrl[:] = each
        mujoco.mj_step(model, data)
        advance(m, d, each[None])
        contacts = max(contacts, data.ncon)
    np.testing.assert_allclose(d.qpos.numpy(), np.tile(data.qpos, (worlds, 1)), atol=allowed)
    np.testing.assert_allclose(friction.state.numpy()[:, :, 0], np.tile(signals.bristle, (worlds, 1)), atol=1e-3)
    for signal in ("level", "tension", "turn", "friction"):
        expected = getattr(signals, signal)
        found, scale = getattr(friction, signal).numpy()[0], max(abs(expected))
        # Without what a contact loads pins with, which depends on where a ball is to a micrometre.
        free = np.setdiff1d(np.arange(len(found)), pins)
        np.testing.assert_allclose(found[free], expected[free], atol=3e-4 * scale, err_msg=signal)
    assert (name == "routed") <= (contacts > 0) and max(signals.level) > 0.05


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_every_integrator_gives_the_plugin_s_motion(integrator):
    found = []
    for _ in range(2):
        spec = mujoco.MjSpec.from_string(HOOK.replace("<option", f'<option integrator="{integrator}"'))
        found.append(spec)
    m, d, _ = in_warp(found[0])
    model, data, _ = in_c(found[1])
    for step in range(100):
        data.ctrl[:] = control(model, step)
        mujoco.mj_step(model, data)
    advance(m, d, [control(model, step) for step in range(100)])
    assert abs(data.qpos[0]) > 0.01
    assert d.qpos.numpy()[0, 0] == pytest.approx(data.qpos[0], abs=1e-6)


def test_a_slider_creeps_below_50_nm_s_and_breaks_away_within_a_thousandth():
    """The tendon delivers 10 N exp(-0.2) at least, by the capstan law; the other motor pushes against the rest."""
    borne = 10.0 * (1.0 - np.exp(-0.2))
    shares = np.concatenate([[0.8], np.linspace(0.99, 1.01, 21)])
    m, d, friction = in_warp(mujoco.MjSpec.from_string(SLIDER), len(shares), {"rope": LAW}, None)
    given = np.stack([np.full_like(shares, 10.0), -10.0 + shares * borne], axis=1)
    advance(m, d, np.tile(given, (500, 1, 1)))
    before = d.qpos.numpy()[:, 0].copy()
    advance(m, d, np.tile(given, (500, 1, 1)))
    moved = abs(d.qpos.numpy()[:, 0] - before)
    assert moved[0] < 50e-9
    # What 0.1 % of 1.8 N too much moves 0.1 kg by in the second of two seconds is 27 mm.
    assert np.all(moved[shares < 0.9995] < 1e-3) and np.all(moved[shares > 1.0005] > 1e-2)
    assert friction.friction.numpy()[0, 0] == pytest.approx(-0.8 * borne, rel=1e-4)


@pytest.fixture(scope="module")
def together():
    """Two models of four routed worlds under controls of their own, and where one of them ends."""
    given = controls(MODELS["routed"](), 120)[:, None] * np.array([1.0, 0.7, 0.4, 0.1])[:, None]
    m, d, friction = in_warp(MODELS["routed"](), 4)
    advance(m, d, given)
    return given, m, d, friction


def ends(d, friction):
    return [each.numpy().copy() for each in (d.qpos, d.qvel, friction.state, friction.level, friction.friction)]


def test_a_world_alone_moves_as_among_others_to_the_last_bit(together):
    given, _, d, friction = together
    m, alone, own = in_warp(MODELS["routed"](), 1)
    advance(m, alone, given[:, 2:3])
    for one, every in zip(ends(alone, own), ends(d, friction), strict=True):
        assert np.array_equal(one[0], every[2]) and not np.array_equal(every[1], every[2])


def test_a_captured_graph_moves_as_steps_do_to_the_last_bit(together):
    given, _, d, friction = together
    m, again, own = in_warp(MODELS["routed"](), 4)
    with wp.ScopedCapture() as capture:
        mjw.step(m, again)
    mjw.reset_data(m, again)
    own.reset()
    for each in given:
        again.ctrl.assign(each.astype(np.float32))
        wp.capture_launch(capture.graph)
    for one, other in zip(ends(again, own), ends(d, friction), strict=True):
        assert np.array_equal(one, other)


def test_coefficients_written_after_a_capture_act_in_their_worlds():
    m, d, friction = in_warp(mujoco.MjSpec.from_string(SLIDER), 3, {"rope": LAW}, None)
    with wp.ScopedCapture() as capture:
        mjw.step(m, d)
    surface = np.array([[0.1], [0.2], [0.4]], np.float32)
    friction.coulomb.assign(surface)
    d.ctrl.assign(np.tile(np.array([10.0, 0.0], np.float32), (3, 1)))
    for _ in range(300):
        wp.capture_launch(capture.graph)
    # It is drawn in without load but its mass: friction is what the capstan law takes of 10 N.
    np.testing.assert_allclose(friction.friction.numpy(), 10.0 * np.expm1(-surface), rtol=1e-3)
    np.testing.assert_allclose(friction.turn.numpy(), 1.0)


def test_a_state_that_is_set_again_gives_the_same_motion_to_the_last_bit(together):
    given, m, d, friction = together
    kept = [wp.clone(each) for each in (d.qpos, d.qvel, d.act, d.time, d.qacc_warmstart)]
    state = friction.state
    first, second = given[:40], given[40:80]
    advance(m, d, first)
    expected = ends(d, friction)
    advance(m, d, second)
    for array, value in zip((d.qpos, d.qvel, d.act, d.time, d.qacc_warmstart), kept, strict=True):
        wp.copy(array, value)
    friction.state = state
    advance(m, d, first)
    for one, other in zip(ends(d, friction), expected, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("by_time", [True, False])
def test_worlds_that_are_reset_start_at_rest_and_others_go_on(by_time):
    spec = mujoco.MjSpec.from_string(SLIDER)
    m, d, friction = in_warp(spec, 2, {"rope": LAW}, None)
    given = np.tile(np.array([10.0, -9.0]), (50, 1))
    advance(m, d, given[:1])
    first = ends(d, friction)
    advance(m, d, given)
    before = friction.state.numpy()
    mask = wp.array([True, False], dtype=bool)
    mjw.reset_data(m, d, reset=mask)
    if not by_time:
        friction.reset(mask)
        assert not friction.state.numpy()[0].any() and np.array_equal(friction.state.numpy()[1], before[1])
    advance(m, d, given[:1])
    for one, other in zip(ends(d, friction), first, strict=True):
        assert np.array_equal(one[0], other[0])
    assert abs(friction.state.numpy()[1, 0, 0]) > 0.5


HELD = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="a"><joint name="x" type="slide" axis="1 0 0" stiffness="300"/><geom size="0.01" mass="0.1"/></body>
<body name="b" pos="0 1 0"><joint name="y" type="slide" axis="1 0 0" stiffness="50"/><geom size="0.01" mass="0.1"/>
</body></worldbody><tendon><fixed name="rope"><joint joint="x" coef="-1"/><joint joint="y" coef="-1"/></fixed>
<fixed name="other" limited="true" range="-0.003 1"><joint joint="x" coef="-1"/></fixed></tendon>
<equality><tendon tendon1="other" tendon2="rope" polycoef="0 0.5 0 0 0"/></equality>
<actuator><dcmotor name="m" tendon="rope" gear="-30" resistance="2" motorconst="0.1"/></actuator></mujoco>"""


def test_limits_and_equalities_pull_tendons_as_in_the_plugin():
    m, d, friction = in_warp(mujoco.MjSpec.from_string(HELD), 2)
    model, data, signals = in_c(mujoco.MjSpec.from_string(HELD))
    for _ in range(300):
        data.ctrl[:] = 4.0
        mujoco.mj_step(model, data)
    advance(m, d, np.full((300, 1), 4.0))
    pull = abs(model.actuator("m").gear[0] * data.actuator_force[0])
    assert signals.tension[signals.index("rope")] > 1.1 * pull and signals.tension[signals.index("other")] > 0.5
    np.testing.assert_allclose(friction.tension.numpy()[1], signals.tension, rtol=1e-4)
    np.testing.assert_allclose(d.qpos.numpy()[1], data.qpos, atol=1e-7)


def test_the_bend_of_a_fixed_tendon_and_parallel_ones_are_as_in_the_plugin():
    links = """<mujoco><worldbody><body><joint name="p" axis="0 1 0"/><geom size="0.01" pos="0.03 0 0" mass="0.02"/>
    <body pos="0.03 0 0"><joint axis="0 1 0"/><geom size="0.01" pos="0.03 0 0" mass="0.02"/></body></body></worldbody>
    <tendon><fixed name="in"><joint joint="p" coef="0.01"/></fixed><fixed name="out"><joint joint="p" coef="-0.02"/>
    </fixed></tendon><actuator><motor joint="p" ctrlrange="-0.04 0.04"/></actuator></mujoco>"""
    m, d, friction = in_warp(mujoco.MjSpec.from_string(links), 2)
    model, data, signals = in_c(mujoco.MjSpec.from_string(links))
    for step in range(100):
        data.ctrl[:] = control(model, step)
        mujoco.mj_step(model, data)
    advance(m, d, [control(model, step) for step in range(100)])
    assert friction.names == ("in", "out", "p", "joint_1") == signals.names
    np.testing.assert_allclose(d.qpos.numpy()[0], data.qpos, atol=1e-5)
    for signal in ("level", "tension", "turn"):
        np.testing.assert_allclose(getattr(friction, signal).numpy()[0], getattr(signals, signal), rtol=1e-3, atol=1e-5)


def test_signals_are_found_by_name_and_the_state_has_their_bristles():
    m, d, friction = in_warp(mujoco.MjSpec.from_string(HOOK), 1, TENDONS, JOINTS)
    advance(m, d, np.full((20, 1), 5.0))
    flexor = friction.index("flexor")
    assert friction.tension.numpy()[0, flexor] == pytest.approx(5.0)
    assert friction.state.shape == (1, 2, 5)
    with pytest.raises(fp.InputError, match="flexor, hinge"):
        friction.index("finger")
