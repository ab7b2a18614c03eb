"""Messages where friction cannot work in MuJoCo Warp, callbacks of others, and the law's text in single precision."""

import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_warp")

import mujoco_warp as mjw
import warp as wp
from mujoco_models import ROUTED
from warp_worlds import SLIDER, advance, in_warp

import finger_pin as fp
from finger_pin.laws.bristle import friction_coefficient, friction_level
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mujoco import friction_step
from finger_pin.mujoco.warp import callback_self_test, kernel_functions
from finger_pin.mujoco.warp.friction_callbacks import attach_friction

ROPE = {"rope": {"curvature_offset": 1.0}}


def refused(text=SLIDER, rows=20, change=None, **chosen):
    """Return the error of adding friction."""
    model = mujoco.MjModel.from_xml_string(text)
    m, d = mjw.put_model(model), mjw.make_data(model, njmax=rows, nconmax=5)
    if change:
        change(m)
    with pytest.raises(fp.InputError) as caught:
        fp.mujoco.warp.add_friction(m, d, model, **(chosen or {"tendons": ROPE}))
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.parametrize(
    "entry, keys",
    [
        ("m.opt.integrator", {"text": SLIDER.replace("<option", '<option integrator="discrete"')}),
        ("d.njmax", {"rows": 0}),
        ("tendons.ropes", {"tendons": {"ropes": {}}}),
        ("tendons.rope.colomb", {"tendons": {"rope": {"colomb": 0.1}}}),
        ("joints.x.coulomb", {"joints": {"x": {"coulomb": -1.0}}}),
        ("mjm", {"joints": {}}),
        ("mjm", {"text": SLIDER[: SLIDER.index("<actuator>")] + "</mujoco>", "joints": {"x": {}}}),
        ("tendons.branched", {"text": ROUTED, "tendons": {"branched": {}}}),
    ],
)
def test_settings_that_cannot_work_are_refused_by_their_entry(entry, keys):
    assert refused(**keys).entry == entry


@pytest.mark.parametrize("switch", ["CONSTRAINT", "FRICTIONLOSS", "ACTUATION", "SENSOR"])
def test_switches_that_take_friction_away_are_named_also_later(switch):
    bit = int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{switch}"))

    def change(m):
        m.opt.disableflags |= bit

    assert refused(change=change).entry == "m.opt.disableflags" and switch.lower() in str(refused(change=change))
    if switch != "ACTUATION":
        m, d, _ = in_warp(mujoco.MjSpec.from_string(SLIDER), 1, ROPE, None)
        change(m)
        with pytest.raises(fp.InputError, match=switch.lower()):
            mjw.step(m, d)


def test_friction_is_added_once_and_steps_the_data_it_was_added_with():
    spec = mujoco.MjSpec.from_string(SLIDER)
    m, d, friction = in_warp(spec, 1, ROPE, None)
    model = spec.compile()
    with pytest.raises(fp.InputError, match="has friction already"):
        fp.mujoco.warp.add_friction(m, d, model, tendons=ROPE)
    with pytest.raises(fp.InputError, match="the data that friction was added with"):
        mjw.step(m, mjw.make_data(model, njmax=20))
    with pytest.raises(fp.InputError, match="shape"):
        friction.state = np.zeros((2, 1, 5))
    with pytest.raises(fp.InputError, match="mask"):
        friction.reset(np.array([True, True]))


def test_callbacks_set_before_are_called_first_and_ones_set_later_are_refused():
    model, called = mujoco.MjModel.from_xml_string(SLIDER), []
    m, d = mjw.put_model(model), mjw.make_data(model, njmax=20)

    def double(m, d):
        called.append("bias")
        d.actuator_force.assign(2.0 * d.actuator_force.numpy())

    m.callback.act_bias, m.callback.sensor = double, lambda m, d, stage: called.append(int(stage))
    friction = fp.mujoco.warp.add_friction(m, d, model, tendons=ROPE)
    advance(m, d, [[5.0, 0.0]])
    assert called == [1, 2, "bias", 3] and friction.tension.numpy()[0, 0] == pytest.approx(10.0)
    ours = m.callback.act_bias
    m.callback.act_bias = double
    with pytest.raises(fp.InputError, match="set it before"):
        mjw.step(m, d)
    m.callback.act_bias, m.callback.sensor = ours, None
    with pytest.raises(fp.InputError, match="set it before"):
        mjw.step(m, d)


@pytest.mark.parametrize("change", ["before actuators", "after the solver", "not at all"])
def test_a_version_that_calls_back_at_another_time_is_refused_in_one_line(monkeypatch, change):
    step = mjw.step

    def other(m, d):
        ours, count = m.callback.act_bias, []

        def late(m, d, stage):
            count.append(stage)
            if change == "after the solver" and int(stage) == 3:
                ours(m, d)

        m.callback.act_bias, m.callback.sensor = None, late
        m.callback.control = ours if change == "before actuators" else None
        monkeypatch.setattr(type(ours.__self__), "_sensor", late)
        step(m, d)
        m.callback.act_bias = ours

    monkeypatch.setattr(mjw, "step", other)
    monkeypatch.setattr(fp.mujoco.warp.Friction, "_check", lambda *_: None)
    with pytest.raises(fp.InputError, match=r"^mujoco_warp .*: friction gives a wrong answer"):
        callback_self_test.try_self_test.__wrapped__("cpu", attach_friction)


def test_the_law_s_text_is_the_laws():
    random = np.random.default_rng(3)
    for _ in range(50):
        speed, pressing, turn, surface = random.normal(), *random.uniform(0.0, 9.0, 2), random.uniform(0.0, 0.5)
        stribeck, exponent, floor, drag = 0.3, float(random.integers(1, 3)), 1e-4, random.uniform()
        kinetic = capstan_coefficient(surface, turn)
        expected = friction_level(
            pressing, friction_coefficient(speed, kinetic, 1.5 * kinetic, stribeck, exponent), floor, drag
        )
        found = friction_step.sliding_level(False, surface, 1.5, stribeck, exponent, floor, drag, speed, pressing, turn)
        assert found == pytest.approx(expected, rel=1e-14)
        # (9a) at this speed and level for a while, in closed form.
        force, level = random.normal(), expected
        exact = np.copysign(level, speed) + (force - np.copysign(level, speed)) * np.exp(-abs(0.7 * speed) / level)
        change, left = friction_step.slide(force, 0.7 * speed, level)
        assert force + change == pytest.approx(exact, rel=1e-13, abs=1e-14)
        assert left == pytest.approx(np.exp(-abs(0.7 * speed) / level), rel=1e-13)


@wp.kernel
def _slid(force: wp.array[float], moved: wp.array[float], level: wp.array[float], found: wp.array2d[float]):
    i = wp.tid()
    change, _left = kernel_functions.slide(force[i], moved[i], level[i])
    found[i, 0] = change
    found[i, 1] = kernel_functions.capstan(0.1, wp.abs(moved[i]))


def test_single_precision_keeps_the_digits_of_small_changes():
    force, moved, level = np.array(
        [[1.0, 1e-9, 2.0], [0.3, 0.155, 2.0], [0.3, 0.165, 2.0], [-3.0, 1e-6, 3.5], [0.1, -1e-4, 0.2], [5.0, 80.0, 2.0]]
    ).T
    found = wp.zeros((len(force), 2), dtype=float)
    wp.launch(_slid, len(force), [wp.array(each, dtype=float) for each in (force, moved, level)], [found])
    steady = np.copysign(level, moved)
    np.testing.assert_allclose(found.numpy()[:, 0], -(steady - force) * np.expm1(-abs(moved) / level), rtol=1.5e-6)
    np.testing.assert_allclose(found.numpy()[:, 1], np.tanh(0.05 * abs(moved)), rtol=1e-6)
