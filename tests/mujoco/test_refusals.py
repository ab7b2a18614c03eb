"""Refusals of friction in MuJoCo, in one line that names the cause."""

import mujoco
import pytest
from sliders import XML

import finger_pin as fp
from finger_pin.mujoco import MujocoWarning, specification
from finger_pin.mujoco.self_test import try_self_test


def rope(**options):
    spec = mujoco.MjSpec.from_string(XML.format(integrator="Euler", spring=0, mass=1))
    for name, value in options.items():
        setattr(spec.option, name, value)
    return spec


@pytest.mark.parametrize(
    "tendons, joints, entry",
    [
        ({"rope": {"coulom": 0.1}}, None, "tendons.rope.coulom"),
        ({"rope": {"coulomb": -1.0}}, None, "tendons.rope.coulomb"),
        ({"rope": {"coulomb": [0.1, 0.2]}}, None, "tendons.rope.coulomb"),
        ({"rope": 0.1}, None, "tendons.rope"),
        ({"ropes": {}}, None, "tendons.ropes"),
        ({"rope": {"bends": ["y"]}}, None, "tendons.rope.bends"),
        (None, {"y*": {}}, "joints.y*"),
        (None, {"x": {"coulomb": 2.5}}, "joints.x.coulomb"),
        (None, {"x": {"law": "dahl"}}, "joints.x.law"),
        (None, {"x": {"reversal_speed": 0.1}}, "joints.x.reversal_speed"),
        (None, None, "spec"),
    ],
)
def test_wrong_names_keys_and_numbers_are_named(tendons, joints, entry):
    with pytest.raises(fp.InputError) as caught:
        fp.mujoco.add_friction(rope(), tendons=tendons, joints=joints)
    assert caught.value.entry == entry and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "of, changes, words",
    [
        ("reversals", {}, "of: must have a tree of bodies"),
        ("tree", {"finger.tendon_friction.place": "bends"}, "tendon_friction.place.*canal"),
        ("tree", {"finger.joint_friction.law": "dahl", "finger.tendon_friction.place": "canal"}, "joint_friction.law"),
    ],
)
def test_friction_that_no_written_hand_can_have_is_refused(of, changes, words):
    hand = fp.load_scenario("underactuated" if of == "tree" else of, changes).finger
    with pytest.raises(fp.InputError, match=words):
        fp.mujoco.add_friction(mujoco.MjSpec(), of=hand)


def test_what_cannot_be_is_refused_and_what_is_less_is_warned_of():
    once = rope()
    fp.mujoco.add_friction(once, tendons={"rope": {}})
    refused = [once, "hand.xml"]
    if hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
        refused.append(rope(integrator=mujoco.mjtIntegrator.mjINT_DISCRETE))
        model = once.compile()
        data = mujoco.MjData(model)
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        with pytest.raises(fp.InputError, match="discrete"):
            fp.mujoco.friction(model, data)
    for spec in refused:
        with pytest.raises(fp.InputError):
            fp.mujoco.add_friction(spec, tendons={"rope": {}})
    with pytest.raises(fp.InputError, match="no friction"):
        plain = rope().compile()
        fp.mujoco.friction(plain, mujoco.MjData(plain))
    with pytest.warns(MujocoWarning, match="noslip"):
        fp.mujoco.add_friction(rope(noslip_iterations=3), tendons={"rope": {}})


def test_friction_whose_actuator_is_deleted_leaves_a_model_that_moves_and_takes_no_other_friction():
    """MuJoCo deletes the plugin with its actuator: a plugin that is still listed would be deleted twice."""
    spec = rope()
    actuators = len(spec.actuators)
    fp.mujoco.add_friction(spec, tendons={"rope": {}})
    spec.delete(spec.actuators[-1])
    assert len(spec.actuators) == actuators and not list(spec.plugins)
    model = spec.compile()
    mujoco.mj_step(model, mujoco.MjData(model))
    with pytest.raises(fp.InputError, match=r"^spec: has friction already, or what is left of it[^\n]*$"):
        fp.mujoco.add_friction(spec, tendons={"rope": {}})


def test_a_mujoco_that_does_not_take_actuators_without_a_control_is_told_by_its_version_in_one_line(monkeypatch):
    monkeypatch.setattr(specification, "NO_INPUT", 1)
    with pytest.raises(fp.InputError) as caught:
        try_self_test()
    assert caught.value.entry == f"mujoco {mujoco.__version__}" and "\n" not in str(caught.value)


@pytest.mark.parametrize("gain, integrator, told", [(240.0, "IMPLICITFAST", False), (260.0, "IMPLICIT", True)])
@pytest.mark.parametrize("tendon", ["rope", "pair"])
def test_servos_too_stiff_for_the_step_are_warned_of_from_five_times_the_mass_over_the_step(
    gain, integrator, told, tendon, recwarn
):
    """A mass of 0.1 kg at 2 ms: 250 N s/m is five; two sliders that a tendon pulls together move as half of one."""
    pair = tendon == "pair"
    body = '<body><joint name="{0}" type="slide" axis="1 0 0"/><geom size="0.01" mass="0.1"/></body>'
    over = '<joint joint="a" coef="1"/>' + pair * '<joint joint="b" coef="1"/>'
    spec = mujoco.MjSpec.from_string(
        f"<mujoco><worldbody>{body.format('a')}{body.format('b')}</worldbody><tendon><fixed name='t'>{over}</fixed>"
        f"</tendon><actuator><velocity tendon='t' kv='{0.5 * gain if pair else gain}'/></actuator></mujoco>"
    )
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    fp.mujoco.add_friction(spec, tendons={"t": {}})
    assert [str(each.message).count("spec.option.timestep: ") for each in recwarn] == [1] * told


def test_a_tendon_that_nothing_pulls_is_passed_over_by_stars_and_refused_by_name():
    for pattern in ("rope*", "rope"):
        spec = rope()
        spec.delete(spec.actuator("pull"))
        spec.delete(spec.actuator("push"))
        with pytest.raises(fp.InputError, match="nothing pulls"):
            fp.mujoco.add_friction(spec, tendons={pattern: {}})
