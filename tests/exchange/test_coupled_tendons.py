"""Tendons that follow others, by a bar or a pulley between them: two fingers whose cords share one motor."""

import re
import tomllib

import mujoco
import numpy as np
import pytest
from scipy.optimize import root

import finger_pin as fp
from finger_pin.description.loading import read_scenario

SMOOTH = {"finger.joint_friction.coulomb": 0.0, "finger.joint_friction.stiction": 0.0}
SMOOTH |= {"finger.tendon_friction.coulomb": 0.0, "finger.tendon_friction.viscous": 0.0}
# Where a cord leaves the palm and where it ends on a finger, m.
INLET, END = np.array([-0.03, 0.01]), np.array([0.02, 0.005])
PULL, STIFFNESS = 2.0, 0.02


def finger(name, side, stiffness):
    """Return a finger of one hinge beside the palm's middle, and the site where its cord leaves the palm."""
    x, y = INLET
    return f"""<body pos="0 {0.02 * side} 0"><joint name="{name}" axis="0 0 1" stiffness="{stiffness}" damping="1e-3"/>
     <geom type="capsule" size=".004" fromto="0 0 0 .04 0 0" mass=".01" contype="0" conaffinity="0"/>
     <site name="{name}_end" pos="{END[0]} {END[1] * side} 0"/></body>
     <site name="{name}_inlet" pos="{x} {(0.02 + y) * side} 0"/>"""


def gripper(equality="", stiffness=STIFFNESS, step=5e-5, motor="motor"):
    """Return two fingers as MJCF, of which a motor pulls the left one's cord."""
    cords = "".join(
        f'<spatial name="{name}"><site site="{name}_inlet"/><site site="{name}_end"/></spatial>'
        for name in ("left", "right")
    )
    return f"""<mujoco><compiler angle="radian"/><option timestep="{step}" gravity="0 0 0" integrator="implicit"/>
    <worldbody>{finger("left", 1, STIFFNESS)}{finger("right", -1, stiffness)}</worldbody><tendon>{cords}</tendon>
    <equality>{equality}</equality>
    <actuator><{motor} name="motor" tendon="left" gear="-1" ctrlrange="0 9"/></actuator>
    <keyframe><key ctrl="{PULL}"/></keyframe></mujoco>"""


def bar(coefficients="0 1", softness='solref=".004 1" solimp=".99 .99"', names='tendon1="left" tendon2="right"'):
    return f'<tendon name="bar" {names} polycoef="{coefficients} 0 0 0" {softness}/>'


def described(text):
    """Return what is read of an MJCF as a table."""
    return fp.from_mujoco(mujoco.MjModel.from_xml_string(text)).model_dump(mode="python", exclude_none=True)


def scenario(finger, settings, **simulation):
    table = {"name": "gripper", "finger": finger, "controller": {"kind": "tensions"}, "simulation": simulation}
    return read_scenario(table, settings)


def closing(description, seconds):
    """Return a run from the posture where the cords are let go, without friction."""
    finger = description.model_dump(mode="python", exclude_none=True)
    return fp.simulate(scenario(finger, SMOOTH, duration=seconds, sample_rate=200.0))


def in_mujoco(text, seconds, *controls):
    """Return MuJoCo's data at the end of a motion from the first keyframe, with other controls if given."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[: len(controls)] = controls
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return data


def length(q, side):
    """Return a cord's length and its slope by the angle that its finger turns by, by trigonometry."""
    inlet = np.array([INLET[0], INLET[1] * side])
    end = np.array([np.cos(q), np.sin(q)]) * END[0] + np.array([-np.sin(q), np.cos(q)]) * END[1] * side
    turned = np.array([-np.sin(q), np.cos(q)]) * END[0] - np.array([np.cos(q), np.sin(q)]) * END[1] * side
    size = np.linalg.norm(end - inlet)
    return size, turned @ (end - inlet) / size


def balance(stiffness, ratio, offset, compliance):
    """Return both angles and the bar's force F, by moments about the hinges: cords have PULL - F and ratio F."""

    def residual(unknown):
        left, right, force = unknown[0], unknown[1], 10.0 * unknown[2]
        (long_1, arm_1), (long_2, arm_2), (start, _) = length(left, 1), length(right, -1), length(0.0, 1)
        difference = (long_1 - start) - ratio * (long_2 - start) - offset
        moments = STIFFNESS * left + (PULL - force) * arm_1, stiffness * right + ratio * force * arm_2
        return 100.0 * moments[0], 100.0 * moments[1], 1e3 * (difference + compliance * force)

    found = root(residual, [0.5, -0.5, 0.1], tol=1e-13)
    assert found.success
    return found.x * [1.0, 1.0, 10.0]


@pytest.mark.parametrize("stiffness, ratio, offset", [(0.02, 1.0, 0.0), (0.05, 1.0, 0.0), (0.03, 0.5, 0.001)])
def test_two_cords_on_a_bar_share_a_motor_s_force_as_virtual_work_says(stiffness, ratio, offset):
    """The bar takes F from the cord that is pulled, and gives ratio F to the other: F dL_1 = ratio F dL_2."""
    text = gripper(bar(f"{offset} {ratio}"), stiffness)
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(text))
    assert not description.tree.left_out
    result = closing(description, 1.0)
    left, right, force = balance(stiffness, ratio, offset, 1.0 / description.tree.couplings["bar"].stiffness)
    if ratio == 1.0 and stiffness == STIFFNESS:
        assert (left, force) == (pytest.approx(-right, abs=1e-3), pytest.approx(0.5 * PULL, rel=1e-3))
    np.testing.assert_allclose(result.joint_position.values[-1], [left, right], atol=3e-4)
    assert result.coupling_force.values[-1, 0] == pytest.approx(force, rel=3e-4)
    data = in_mujoco(text, 1.0)
    np.testing.assert_allclose(data.qpos, [left, right], atol=3e-4)
    assert data.efc_force[0] == pytest.approx(force, rel=3e-4)
    rest = fp.analysis.equilibrium(description, {"motor": PULL})
    np.testing.assert_allclose(rest.position, [left, right], atol=1e-6)
    settled = fp.analysis.settled_posture(description, {"motor": PULL})
    np.testing.assert_allclose(settled, [left, right], atol=1e-6)
    assert np.abs(result.energy_residual).max() < 1e-6


def test_without_a_bar_one_finger_takes_all_of_the_motor_s_force():
    result = closing(fp.from_mujoco(mujoco.MjModel.from_xml_string(gripper())), 1.0)
    left, right = result.joint_position.values[-1]
    assert right == 0.0
    assert STIFFNESS * left == pytest.approx(-PULL * length(left, 1)[1], rel=1e-3)
    assert left > 1.2 * balance(STIFFNESS, 1.0, 0.0, 0.0)[0]


def test_the_fingers_close_as_in_mujoco_s_step_made_small():
    """Its error is of order one in the step: twice the end at a step less that at its double has none of it."""
    text = gripper(bar("0 .7"), 0.03)
    there = closing(fp.from_mujoco(mujoco.MjModel.from_xml_string(text)), 0.05).joint_position.values[-1]
    coarse, fine = (in_mujoco(text.replace('"5e-05"', f'"{step}"'), 0.05).qpos for step in (1e-4, 5e-5))
    assert abs(there).min() > 0.15
    np.testing.assert_allclose(there, 2.0 * fine - coarse, atol=6e-5)
    assert np.abs(fine - there).max() < 0.7 * np.abs(coarse - there).max()


def test_a_bar_that_is_written_as_mjcf_and_read_again_moves_the_same():
    # Lengths count from the references, and joints that have the names of tendons do not matter.
    text = gripper(bar(".001 .7"), 0.03).replace('<joint name="right"', '<joint name="right" ref=".1"')
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(text))
    written = fp.to_mjcf(description)
    again = fp.from_mujoco(mujoco.MjModel.from_xml_string(written))
    one, other = description.tree.couplings["bar"], again.tree.couplings["bar"]
    assert (other.tendon, other.other, other.ratio, other.offset) == ("left", "right", 0.7, 0.001)
    assert (other.stiffness, other.damping) == pytest.approx((one.stiffness, one.damping), rel=1e-9)
    start, end = (closing(each, 0.05).joint_position.values[-1] for each in (description, again))
    np.testing.assert_allclose(start, end, atol=1e-8)
    # The bar pulls the cords by a millimetre at once, and MuJoCo's acts with an inertia of its own.
    moved = in_mujoco(written.replace('<option timestep="0.001"', '<option timestep="5e-05"'), 0.05, PULL)
    np.testing.assert_allclose(moved.qpos, end, atol=1e-3)
    assert scenario(tomllib.loads(fp.to_toml(description)), {}).finger.tree == description.tree


def test_a_cord_is_held_at_a_length_by_a_bar_to_nothing():
    """Its growth from where the model's joints are at their references is that of the polynomial's first number."""
    text = gripper(bar("-.004", names='tendon1="right"'))
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(text))
    right = fp.analysis.equilibrium(description, {"motor": 0.0}).position[1]
    assert length(right, -1)[0] - length(0.0, -1)[0] == pytest.approx(-0.004, abs=2e-5)


def test_cords_rub_by_the_tensions_that_the_bar_leaves_and_gives():
    """The cord that follows slides over a corner of the palm at the bar's force, and by the capstan law."""
    corner = '<site name="start" pos="-.03 -.06 0"/></worldbody>'
    through = '<spatial name="right"><site site="start"/><site site="right_inlet"/>'
    text = gripper(bar("0 .7", softness=""), 0.03).replace("</worldbody>", corner)
    finger = described(text.replace('<spatial name="right"><site site="right_inlet"/>', through))
    settings = {"finger.tendon_friction.viscous": 0.0, "finger.tendon_friction.floor": 1e-9}
    hand = fp.Finger(scenario(finger, settings).finger)
    q = np.array([0.25, -0.3])
    (long_1, arm_1), (long_2, arm_2) = length(q[0], 1), length(q[1], -1)
    # Both are drawn in, the one that follows at 1 m/s, where friction is that of sliding.
    v = np.array([-0.7 / arm_1, -1.0 / arm_2])
    bar_of, start = hand.description.tree.couplings["bar"], length(0.0, 1)[0]
    force = -bar_of.stiffness * (long_1 - start - 0.7 * (long_2 - start))
    assert 0.1 < force < PULL
    x = hand.rest_state(q, v)
    for _ in range(50):
        found = hand.evaluate(x, [PULL])
        rows = found.mechanism.rows
        canals = rows["tendon_canals"]
        found.state.canal_stiction[:] = np.sign(canals.row.speed) * canals["level"]
        x = hand.layout.pack(found.state)
    assert canals.rows.names == ("left", "right")
    np.testing.assert_allclose(canals.row.command, [PULL - force, 0.7 * force], rtol=1e-9)
    end = np.array([np.cos(q[1]), np.sin(q[1])]) * END[0] - np.array([-np.sin(q[1]), np.cos(q[1])]) * END[1]
    way = end - [INLET[0], -INLET[1]]
    turn = np.arccos(way[1] / np.linalg.norm(way))
    kept = np.exp(-0.11 * turn)
    np.testing.assert_allclose((canals.row.command + canals.force)[1], 0.7 * force * kept, rtol=1e-4)


def test_postures_of_a_fingertip_keep_to_a_bar():
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(gripper(bar())))
    tip = next(iter(description.tree.tip_names))
    found = fp.analysis.inverse_kinematics(description, [0.035, 0.04, 0.0], tip=tip).position
    assert abs(found[0]) > 0.2 and found[1] == pytest.approx(-found[0], abs=1e-6)


def test_a_bar_in_a_hand_has_its_finger_s_name_and_scale():
    pair = described(gripper(bar(".001 .7")))
    hand = {"fingers": {"one": {"finger": pair, "scale": 2.0}}}
    joined = read_scenario({"name": "pair", "hand": hand, "controller": {"kind": "tensions"}}, {}).finger
    held = joined.tree.couplings["one.bar"]
    assert (held.tendon, held.other, held.ratio, held.offset) == ("one.left", "one.right", 0.7, 0.002)


HELD = {"tendon": "left", "other": "right", "ratio": 1.0, "stiffness": 1e4, "damping": 10.0}


@pytest.mark.parametrize(
    "changes, says",
    [
        ({"joint": "left"}, "bar: needs a joint or a tendon that follows, and not both"),
        ({"tendon": None}, "bar: needs a joint or a tendon that follows, and not both"),
        ({"powers": [0.1]}, "bar.powers: is of joints: a tendon follows by a ratio"),
        ({"rolling": [0.1, 0.1]}, "bar.rolling: is of joints: a tendon follows by a ratio"),
        ({"stiffness": None}, "bar.stiffness: is missing: that of tendons has no default"),
        ({"damping": None}, "bar.damping: is missing: that of tendons has no default"),
        ({"other": "left"}, 'bar.other = "left": must be another tendon'),
        ({"other": None}, "bar.other: is missing"),
        ({"other": "rihgt"}, 'bar.other = "rihgt": no such tendon; there are left, right'),
        ({"tendon": "lift"}, 'bar.tendon = "lift": no such tendon; there are left, right'),
    ],
)
def test_bars_that_hold_nothing_are_refused_in_a_line(changes, says):
    table = described(gripper().replace('ctrlrange="0 9"', 'ctrlrange="-9 9"'))
    bars = {key: value for key, value in (HELD | changes).items() if value is not None}
    with pytest.raises(fp.InputError, match=re.escape(f"couplings.{says}")) as refused:
        scenario(table | {"tree": table["tree"] | {"couplings": {"bar": bars}}}, {})
    assert "\n" not in str(refused.value)


def test_a_cord_on_a_bar_is_pulled_by_actuators_of_the_tree():
    """A tendon of the finger along it would rub by its own tension beside the bar's, not by the sum of both."""
    table = described(gripper())
    table["tree"] |= {"couplings": {"bar": HELD}}
    with pytest.raises(fp.InputError, match=r"tendons\.motor\.along.* is for a tendon without coupling"):
        scenario(table, {})
