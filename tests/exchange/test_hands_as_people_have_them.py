"""Elements that models of hands come with, against MuJoCo or closed forms, at numbers drawn at random."""

import math

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

import finger_pin as fp
from finger_pin.analysis import equilibrium, inverse_kinematics
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario

HEAD = '<compiler angle="radian"/><option timestep="0.001" {option}/>'
PHALANX = '<geom type="capsule" size="0.006" fromto="0 0 0 {length} 0 0" mass="{mass}" contype="0" conaffinity="0"/>'
HINGE = '<joint name="{name}" axis="0 -1 0" range="-0.5 1.6" damping="0.01" armature="1e-4" {more}/>'
# Viscous friction and bristles move no equilibrium, and joints that rub stop before it.
SMOOTH = {f"finger.joint_friction.{key}": 0.0 for key in ("coulomb", "stiction")}


def chain(rest, option="", near="", far="", far_joint=""):
    """Return a model of two phalanges with whatever is said of them."""
    inner, outer = HINGE.format(name="mcp", more=""), HINGE.format(name="pip", more=far_joint)
    text = f"""<mujoco>{HEAD.format(option=option)}<worldbody>
    <body name="near" {near}>{inner}{PHALANX.format(length=0.05, mass=0.06)}
    <body name="far" pos="0.05 0 0" {far}>{outer}{PHALANX.format(length=0.04, mass=0.04)}
    <site name="tip" pos="0.04 0 0"/></body></body></worldbody>{rest}</mujoco>"""
    return mujoco.MjModel.from_xml_string(text)


SERVOS = """<actuator><position name="mcp" joint="mcp" kp="0.6" ctrlrange="-0.5 1.6"/>
<position name="pip" joint="pip" kp="0.4" ctrlrange="-0.5 1.6"/></actuator>"""


def test_bodies_whose_weight_is_compensated_in_part_rest_where_the_rest_of_it_leaves_them():
    """Servos bear what is not compensated: k (u - q) = sum of (1 - c) m g times the lever, joint by joint."""
    random = np.random.default_rng(3)
    for _ in range(3):
        one, two = random.uniform(0.0, 1.2, 2)
        model = chain(SERVOS, near=f'gravcomp="{one}"', far=f'gravcomp="{two}"')
        goal = random.uniform(0.2, 0.9, 2)
        found = equilibrium(fp.from_mujoco(model), {"mcp": goal[0], "pip": goal[1]})
        q, sum_ = found.position, found.position.sum()
        outer = (1.0 - two) * 0.04 * 9.81 * 0.02 * math.cos(sum_)
        inner = (1.0 - one) * 0.06 * 9.81 * 0.025 * math.cos(q[0]) + (1.0 - two) * 0.04 * 9.81 * 0.05 * math.cos(q[0])
        np.testing.assert_allclose([0.6 * (goal[0] - q[0]), 0.4 * (goal[1] - q[1])], [inner + outer, outer], atol=1e-8)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_a_joint_follows_another_by_a_polynomial_from_both_references(degree):
    """The coupling's springs rest where MuJoCo's residual is zero, at random postures."""
    random = np.random.default_rng(degree)
    powers = np.append(random.uniform(-0.4, 0.4, degree + 1), np.zeros(4 - degree))
    coupling = f'<joint joint1="pip" joint2="mcp" polycoef="{" ".join(map(str, powers))}"/>'
    model = chain(f"<equality>{coupling}</equality>{SERVOS}", far_joint='ref="0.2"')
    hand = fp.Hand(fp.from_mujoco(model))
    for q in random.uniform(-0.4, 1.4, (4, 2)):
        data = mujoco.MjData(model)
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        x = hand.rest_state(q)
        rows = {}
        for evaluator in (hand, CompiledFinger(hand)):
            rows = evaluator.evaluate(x, np.zeros(2)).mechanism.rows["coupling"]
            missed = rows.row.length - rows.rows.parameters[1]
            assert missed == pytest.approx(data.efc_pos[:1], abs=1e-12)


@pytest.mark.slow
def test_postures_of_a_fingertip_keep_to_couplings_whatever_their_ratio():
    """The nearest point of the curve that coupled joints leave the tip, found along that curve."""

    def tip(q):
        both = q[0] + q[1]
        return np.array(
            [0.05 * math.cos(q[0]) + 0.04 * math.cos(both), 0.0, 0.05 * math.sin(q[0]) + 0.04 * math.sin(both)]
        )

    for powers in ((0.1, 0.7), (0.0, 0.4, 0.35)):
        text = " ".join(map(str, (*powers, *np.zeros(5 - len(powers)))))
        model = chain(f'<equality><joint joint1="pip" joint2="mcp" polycoef="{text}"/></equality>{SERVOS}')
        finger = fp.Finger(fp.from_mujoco(model))
        curve = [np.array([q, np.polyval(powers[::-1], q)]) for q in np.linspace(0.0, 1.0, 20001)]
        for target in (tip(curve[9000]), tip((0.3, 1.2))):
            gaps = np.linalg.norm([tip(q) - target for q in curve], axis=1)
            found = inverse_kinematics(finger, target)
            assert found.position[1] == pytest.approx(np.polyval(powers[::-1], found.position[0]), abs=1e-9)
            assert found.distance == pytest.approx(gaps.min(), abs=1e-6)
            assert found.reached == (gaps.min() < 1e-6)


LOOP = """<mujoco>{head}<worldbody>
<body name="crank"><joint name="crank" axis="0 -1 0" range="-0.2 1.2"/>
 <geom type="capsule" size="0.004" fromto="0 0 0 0 0 {crank}" mass="0.01" contype="0" conaffinity="0"/>
 <body name="rod" pos="0 0 {crank}"><joint name="rod" axis="0 -1 0"/>
  <geom type="capsule" size="0.003" fromto="0 0 0 {rod} 0 0" mass="0.01" contype="0" conaffinity="0"/></body></body>
<body name="phalanx" pos="{base} 0 0"><joint name="pip" axis="0 -1 0" range="-0.5 1.6"/>
 <geom type="capsule" size="0.006" fromto="0 0 0 0.04 0 0" mass="0.02" contype="0" conaffinity="0"/></body>
</worldbody><equality>{held}</equality>
<actuator><position name="crank" joint="crank" kp="1.0" ctrlrange="-0.2 1.2"/></actuator></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize(("crank", "rod", "base"), [(0.02, 0.04, 0.04), (0.02, 0.045, 0.04), (0.015, 0.04, 0.045)])
def test_a_four_bar_finger_turns_as_its_links_say(crank, rod, base):
    """The loop closes where the phalanx's horn, upright at zero, is as far from the crank's end as the rod is long."""
    held = f'<connect body1="rod" body2="phalanx" anchor="{rod} 0 0"/>'
    text = LOOP.format(head=HEAD.format(option='gravity="0 0 0"'), crank=crank, rod=rod, base=base, held=held)
    model = mujoco.MjModel.from_xml_string(text)
    # The anchor is where the rod ends at the reference, and moves with the phalanx.
    pin = np.array([rod - base, crank])
    goal = 0.5
    end = crank * np.array([-math.sin(goal), math.cos(goal)])

    def gap(q):
        turned = np.array([pin[0] * math.cos(q) - pin[1] * math.sin(q), pin[0] * math.sin(q) + pin[1] * math.cos(q)])
        return np.linalg.norm(turned + np.array([base, 0.0]) - end) - rod

    expected = brentq(gap, 0.1, 1.2)
    found = equilibrium(fp.from_mujoco(model), {"crank": goal}, position=[0.4, -0.4, 0.4])
    assert found.position[0] == pytest.approx(goal, abs=1e-6)
    assert found.position[2] == pytest.approx(expected, abs=1e-6)


def test_welded_bodies_turn_as_one():
    held = '<weld body1="rod" body2="phalanx" relpose="0.04 0 0 1 0 0 0" anchor="0 0 0"/>'
    head = HEAD.format(option='gravity="0 0 0"')
    model = mujoco.MjModel.from_xml_string(LOOP.format(head=head, crank=0.02, rod=0.04, base=0.04, held=held))
    hand = fp.Hand(fp.from_mujoco(model))
    for angle in (0.0, 0.3):
        x = hand.rest_state(np.array([angle, 0.2 - angle, 0.2]))
        lengths = hand.evaluate(x, np.zeros(1)).mechanism.rows["loop"].row.length
        spread = np.ptp(lengths.reshape(3, 3), axis=0)
        # Turned alike, all three points are as far apart.
        np.testing.assert_allclose(spread, 0.0, atol=1e-12)
    turned = hand.evaluate(hand.rest_state(np.array([0.0, 0.0, 0.2])), np.zeros(1)).mechanism.rows["loop"].row.length
    assert np.ptp(turned.reshape(3, 3), axis=0).max() > 1e-3


RATES = """<actuator><position name="mcp" joint="mcp" kp="0.6" timeconst="0.05" ctrlrange="-0.5 1.6"/>
<intvelocity name="pip" joint="pip" kp="0.4" actrange="-0.4 1.5" ctrlrange="-3 3"/></actuator>"""


LATE = """<actuator>
<pid name="mcp" joint="mcp" kp="0.5" kv="0.02" slewmax="3" delay="0.05" nsample="600"/>
<pid name="pip" joint="pip" kp="0.5" ki="2" kv="0.02" imax="0.1" delay="0.12" nsample="1300"/></actuator>"""


@pytest.mark.parametrize("rest", [RATES, "pid", LATE])
def test_servos_that_lag_integrate_have_an_integral_part_or_late_goals_move_as_in_mujoco(rest):
    """Angles over time at steps of MuJoCo so short that its own error is below the tolerance."""
    if rest == "pid":
        numbers = {"kp": 0.5, "ki": 2, "kd": 0.02, "imax": 0.1}
        config = "".join(f'<config key="{key}" value="{value}"/>' for key, value in numbers.items())
        pid = f'<plugin plugin="mujoco.pid"><instance name="pid">{config}</instance></plugin>'
        plugged = 'plugin="mujoco.pid" instance="pid" actdim="1"/>'
        servos = "".join(f'<plugin name="{name}" joint="{name}" {plugged}' for name in ("mcp", "pip"))
        rest = f"<extension>{pid}</extension><actuator>{servos}</actuator>"
    text = f"""<mujoco>{HEAD.format(option='gravity="0 0 0" integrator="RK4"')}<worldbody>
    <body><joint name="mcp" axis="0 -1 0" damping="0.01" armature="1e-4"/>{PHALANX.format(length=0.05, mass=0.06)}
    <body pos="0.05 0 0"><joint name="pip" axis="0 -1 0" damping="0.01" armature="1e-4"/>
    {PHALANX.format(length=0.04, mass=0.04)}</body></body></worldbody>{rest}</mujoco>"""
    spec = mujoco.MjSpec.from_string(text)
    table = demo_motion(fp.from_mujoco(spec), 0.6)
    inputs = {"mcp": 0.9, "pip": 1.2}
    table["controller"]["inputs"] = {name: {"offset": value} for name, value in inputs.items()}
    result = fp.simulate(read_scenario(table, SMOOTH))
    spec.option.timestep = 1e-4
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[:: model.nu // 2] = list(inputs.values())  # The second control of pid is a speed.
    path = []
    for _ in range(6000):
        mujoco.mj_step(model, data)
        path.append(data.qpos.copy())
    ours = result.joint_position.values[[100, 300, 600]]
    np.testing.assert_allclose(ours, np.array(path)[[999, 2999, 5999]], atol=2e-3)
    assert np.abs(result.energy_residual).max() < 1e-5


def test_a_rope_on_a_turning_drum_is_as_long_as_in_mujoco_wherever_its_side_point_is():
    for kind, size in (("cylinder", "0.03 0.01"), ("sphere", "0.03")):
        model = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody><body name="arm"><joint name="arm" axis="0 1 0"/>
        <geom name="drum" type="{kind}" size="{size}" euler="90 0 0" mass="0.05"/>
        <site name="hook" pos="-0.06 0 0.028"/></body>
        <site name="side" pos="0 0 0.06"/><body name="led" pos="0.032 0 -0.12"><joint name="led" axis="0 1 0"/>
        <geom size="0.006" mass="0.02" pos="0 0 0.02"/><site name="eye" pos="0 0.001 0.006"/></body></worldbody>
        <tendon><spatial name="rope"><site site="eye"/><geom geom="drum" sidesite="side"/><site site="hook"/></spatial>
        </tendon></mujoco>""")
        data, hand = mujoco.MjData(model), fp.Hand(fp.from_mujoco(model))
        for q in np.random.default_rng(5).uniform([-1.2, -0.4], [0.4, 0.4], (20, 2)):
            data.qpos[:] = q
            mujoco.mj_forward(model, data)
            assert hand.paths.length(q) == pytest.approx(data.ten_length, abs=1e-9)


def test_a_load_on_a_cable_pulls_with_its_weight_and_is_no_anchor():
    """The boom bears it: 2 (u - q) = (m_boom a / 2 + m_load a) g cos q for a boom of length a."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>{HEAD.format(option="")}<worldbody>
    <body name="boom" pos="0 0 0.2"><joint name="boom" axis="0 -1 0" range="-0.5 1"/>
    {PHALANX.format(length=0.1, mass=0.03)}<site name="end" pos="0.1 0 0"/>
    </body><body name="load" pos="0.1 0 0.1"><freejoint/><geom size="0.01" mass="0.05"/>
    <site name="ring" pos="0 0 0.01"/></body></worldbody><tendon><spatial name="line" limited="true" range="0 0.09">
    <site site="end"/><site site="ring"/></spatial></tendon>
    <actuator><position name="boom" joint="boom" kp="2" ctrlrange="-0.5 1"/></actuator></mujoco>""")
    description = fp.from_mujoco(model)
    description = description.updated(touches_itself=False)
    found = equilibrium(description, {"boom": 0.3})
    expected = brentq(lambda q: 2.0 * (0.3 - q) - (0.03 * 0.05 + 0.05 * 0.1) * 9.81 * math.cos(q), -0.5, 1.0)
    assert found.position[0] == pytest.approx(expected, abs=1e-5)
    assert fp.Hand(description).joint_friction.bearing.tolist() == [True] + [False] * 6


def test_runs_start_from_the_first_keyframe_another_by_name_or_what_is_given_on_top_and_its_inputs_hold():
    keys = '<keyframe><key name="pinch" qpos="0.9 0.7" ctrl="0.9 0.7"/><key name="open" qpos="0.1 0.2"/></keyframe>'
    table = {"name": "posed", "finger": fp.from_mujoco(chain(SERVOS + keys)).model_dump(exclude_none=True)}
    table |= {"controller": {"kind": "tensions"}, "simulation": {"duration": 0.05}}

    def run(**initial):
        more = {f"simulation.initial.{key}": value for key, value in initial.items()}
        return fp.simulate(read_scenario(table, more)).joint_position.values

    first = run()
    assert first[0].tolist() == [0.9, 0.7]
    # Held by the controls that go with it: weight alone moves it.
    assert np.abs(first[-1] - first[0]).max() < 0.1
    assert run(keyframe="open")[0].tolist() == [0.1, 0.2]
    assert run(position={"pip": 0.5})[0].tolist() == [0.9, 0.5]
    with pytest.raises(fp.InputError, match=r"simulation\.initial\.keyframe.*the keyframes are pinch, open"):
        run(keyframe="fist")


def test_limits_of_motors_and_joints_hold_what_they_exert():
    """A motor of gear 3 pulls no more than its control and its joint allow; a tendon no more than its motor does."""
    rest = """<tendon><fixed name="cord"><joint joint="pip" coef="0.01"/></fixed></tendon><actuator>
    <motor name="turn" joint="mcp" gear="3" ctrlrange="-1 1"/>
    <motor name="pull" tendon="cord" gear="-2" ctrlrange="0 10" forcelimited="true" forcerange="-50 8"/></actuator>"""
    model = chain(rest, option='gravity="0 0 0"')
    model.jnt_actfrclimited[0], model.jnt_actfrcrange[0] = 1, (-0.6, 0.9)
    description = fp.from_mujoco(model)
    assert description.tree.actuators["turn"].force_range == pytest.approx((-0.2, 0.3))
    assert description.tendons["pull"].maximum_tension == pytest.approx(16.0)
    hand = fp.Hand(description.updated(tendon_friction=description.tendon_friction.updated(coulomb=0.0)))
    for given, pulled in ((5.0, 5.0), (30.0, 16.0)):
        found = hand.evaluate(hand.rest_state(np.zeros(2)), np.array([given, 0.7]))
        np.testing.assert_allclose(found["joint_torque"], [0.0, -0.01 * pulled], rtol=1e-6)
        assert found.mechanism.rows["actuator"].force == pytest.approx([0.3])


def test_cords_wound_by_servos_load_pins_and_rub_by_their_turn():
    """Two antagonists about a joint: only that which the servo winds is taut, by torque over radius."""
    rest = (
        """<tendon><fixed name="flexor"><joint joint="pip" coef="-0.01"/></fixed>
    <fixed name="extensor"><joint joint="pip" coef="0.008"/></fixed></tendon>"""
        + SERVOS
    )
    hand = fp.Hand(fp.from_mujoco(chain(rest, option='gravity="0 0 0"')))
    assert hand.description.canals == ("flexor", "extensor")
    q = np.array([0.3, 0.4])
    for goal, radii in ((0.9, (0.01, 0.0)), (-0.3, (0.0, 0.008))):
        found = hand.evaluate(hand.rest_state(q), np.array([0.3, goal]))
        torque = 0.4 * abs(goal - 0.4)
        tensions = [torque / each if each else 0.0 for each in radii]
        np.testing.assert_allclose(found.mechanism.rows["tendon_cords"].force, tensions, rtol=1e-12)
        np.testing.assert_allclose(found["joint_reaction"], [0.0, sum(tensions)], rtol=1e-12)
        levels = found.mechanism.rows["tendon_canals"]["level"]
        expected = [2.0 * each * np.tanh(0.5 * 0.11 * 0.4) * 1.5 for each in tensions]
        np.testing.assert_allclose(levels, np.maximum(expected, 1e-4), rtol=1e-9)


def test_a_drum_without_limits_turns_on_as_its_servo_says_and_is_read_where_no_joint_has_any():
    """The damper and the servo share the speed: kv (u - w) = c w, so that it has turned u kv t / (kv + c)."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>{HEAD.format(option='gravity="0 0 0"')}<worldbody>
    <body><joint name="drum" axis="0 1 0" damping="1e-3" armature="1e-5"/><geom size="0.006" mass="0.02"/></body>
    </worldbody><actuator><velocity name="drum" joint="drum" kv="0.05" ctrlrange="-20 20"/></actuator></mujoco>""")
    description = fp.from_mujoco(model)
    assert not description.joints["drum"].limited
    table = demo_motion(description, 2.0)
    table["controller"]["inputs"]["drum"] = {"offset": 15.0}
    result = fp.simulate(read_scenario(table, SMOOTH))
    assert result.joint_position.values[-1, 0] == pytest.approx(15.0 * 0.05 / 0.051 * 2.0, rel=1e-3)


def test_a_free_body_keeps_its_name_unless_a_shape_has_it_and_a_motor_that_its_limit_holds_pulls_nothing():
    worlds = '<geom name="ball" size="0.01" pos="0 0 -1"/>'
    body = '<body name="{name}" pos="0 {y} -2"><freejoint/><geom name="{name}{tail}" size="0.01"/></body>'
    things = body.format(name="cube", y=1, tail="") + body.format(name="ball", y=2, tail="_geom")
    text = f"""<mujoco>{HEAD.format(option="")}<worldbody>{worlds}{things}
    <body><joint name="pip" axis="0 -1 0" range="-0.5 1.6"/>{PHALANX.format(length=0.05, mass=0.05)}</body></worldbody>
    <tendon><fixed name="cord"><joint joint="pip" coef="0.01"/></fixed></tendon><actuator>
    <motor name="pull" tendon="cord" gear="-1" ctrlrange="0 10" forcelimited="true" forcerange="-5 0"/>
    </actuator></mujoco>"""
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(text))
    assert list(description.tree.objects) == ["cube", "ball_object"]
    assert not description.tendons
    hand = fp.Hand(description)
    found = hand.evaluate(hand.rest_state(np.zeros(1)), np.array([7.0]))
    assert found.mechanism.rows["actuator"].force == pytest.approx([0.0])
