"""Impacts, contacts and starts of MuJoCo models: what is read moves as in MuJoCo's own step."""

import tomllib

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import finger_pin as fp
from finger_pin.description.loading import read_scenario
from finger_pin.description.surface import Surface
from finger_pin.exchange.mujoco_compliance import impact_damping, restitution

SMOOTH = {"finger.joint_friction.coulomb": 0.0, "finger.joint_friction.stiction": 0.0}
SMOOTH |= {"finger.tendon_friction.coulomb": 0.0, "finger.tendon_friction.viscous": 0.0}


def both(text, seconds, keyframe=None):
    """Return MuJoCo's data and our result at the end of a motion from a keyframe, the first or the reference."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe or 0).id)
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    initial = {"initial": {"keyframe": keyframe}} if keyframe else {}
    table = {"name": "x", "finger": fp.from_mujoco(model).model_dump(mode="python", exclude_none=True)}
    table |= {"controller": {"kind": "tensions"}, "simulation": {"duration": seconds, "sample_rate": 50.0} | initial}
    return data, fp.simulate(read_scenario(table, SMOOTH))


SWING = """<mujoco><compiler angle="radian"/><option timestep="2e-5" gravity="0 0 0"/><worldbody>
<body><joint name="j" axis="0 1 0" JOINT/>
 <geom type="capsule" size=".005" fromto="0 0 0 .04 0 0" mass=".008" contype="0" conaffinity="0"/></body></worldbody>
TENDON<actuator><motor joint="j"/></actuator><keyframe><key qvel="SPEED"/></keyframe></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize("place", ["JOINT", "TENDON"])
@pytest.mark.parametrize("soft", ["", 'solreflimit=".02 .3"', 'solreflimit="-4e4 -60"', 'solreflimit="-1e4 0"'])
@pytest.mark.parametrize("speed", [1.0, 10.0])
def test_stops_throw_back_as_much_of_any_speed_as_in_mujoco(place, soft, speed):
    """A spring and a damper that only push, from k x + b v = 0 on at rest: with critical damping exp(-2) comes back."""
    limited = f'limited="true" range="-1 .1" {soft}'
    # A sum of joint positions that is no cord, and does not rub.
    tendon = f'<tendon><fixed name="t" {limited}><joint joint="j" coef="1"/></fixed></tendon>'
    text = SWING.replace(place, {"JOINT": limited, "TENDON": tendon}[place]).replace("SPEED", str(speed))
    data, result = both(text.replace("JOINT", "").replace("TENDON", ""), 0.1 / speed + 0.08)
    share = -float(data.qvel[0]) / speed
    assert soft or share == pytest.approx(np.exp(-2.0), rel=0.01)
    # MuJoCo's impedance is smaller within the first 1e-3 of the depth.
    assert -float(result.joint_velocity[-1, 0]) / speed == pytest.approx(share, rel=0.02)


def test_a_constraint_stiffer_than_descriptions_allow_is_listed_with_its_size():
    """The stiffness k d / R of a time constant of 4e-5 s, at J = 1 / dof_invweight0 and d = 0.95."""
    limited = 'limited="true" range="-1 .1" solreflimit="-1e12 -100"'
    model = mujoco.MjModel.from_xml_string(SWING.replace("JOINT", limited).replace("SPEED", "0").replace("TENDON", ""))
    found = fp.from_mujoco(model)
    asked = 1e12 / 0.95 * 0.95 / 0.05 / model.dof_invweight0[0]
    assert found.tree.left_out == (f"stops of joint j: stiffness {asked:.2g} by its solref and solimp, 1e+07 here",)
    assert found.stroke_limiter.stiffness == (1e7,)


BALL = """<mujoco><option timestep="1e-3" cone="CONE" gravity="0 0 -200"/><worldbody>
<geom type="plane" size="1 1 .1" friction=".8" condim="DIM"/><body pos="0 0 .0095"><freejoint/>
 <geom name="g" size=".01" mass=".2" friction=".8" condim="DIM" SOFT/></body><body pos="1 0 1"><joint name="j"/>
 <geom size=".01" mass=".2" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j"/></actuator></mujoco>"""


@pytest.mark.parametrize(
    "cone, dim, soft", [("pyramidal", 3, ""), ("elliptic", 3, ""), ("pyramidal", 1, 'solref=".01 1" solmix="3"')]
)
def test_contacts_give_as_in_mujoco_under_a_load(cone, dim, soft):
    text = BALL.replace("CONE", cone).replace("DIM", str(dim)).replace("SOFT", soft)
    # Deep contacts settle with the time constant c d, 0.3 s here.
    data, result = both(text, 2.5)
    # Deeper than the width of solimp, within which MuJoCo's give more.
    assert data.contact.dist[0] < -1e-3
    assert float(result.object_position[-1, 0, 2]) - 0.01 == pytest.approx(data.contact.dist[0], rel=0.01)


TWO_STARTS = """<mujoco><option timestep="1e-3"/><worldbody><geom type="plane" size="1 1 .1" pos="0 0 -.04"/>
<body name="ball" pos=".2 0 -.03"><freejoint/><geom size=".01" mass=".02"/></body>
<body name="f"><joint name="j" axis="0 1 0" damping="3e-3"/>
 <geom type="capsule" size=".004" fromto="0 0 0 .05 0 0" mass=".01" contype="0" conaffinity="0"/></body></worldbody>
<actuator><position name="p" joint="j" kp=".1"/></actuator>
<keyframe><key name="away" qpos=".2 0 -.03 1 0 0 0 0" ctrl=".6"/>
<key name="thrown" qpos=".05 .1 .3 .6 .8 0 0 .1" qvel="1 0 1 0 3 0 .5" ctrl=".2"/></keyframe></mujoco>"""


def test_another_keyframe_moves_free_bodies():
    data, result = both(TWO_STARTS, 0.2, "thrown")
    np.testing.assert_allclose(result.object_position.values[-1, 0], data.qpos[:3], atol=1e-3)
    turned = np.roll(data.qpos[3:7], -1)
    assert abs(result.object_orientation.values[-1, 0] @ turned) == pytest.approx(1.0, abs=1e-5)
    assert float(result.joint_position[-1, 0]) == pytest.approx(data.qpos[7], abs=2e-3)
    # A scenario that is written out has the object in its tree alone, where the keyframe moves it.
    scenario = read_scenario(tomllib.loads(result.attrs["scenario"]))
    assert scenario.environment.objects["ball"].position == (0.05, 0.1, 0.3)


def test_free_bodies_that_tendons_alone_hold_are_a_model():
    ball = '<body name="%s" pos="%s"><freejoint/><geom size=".01" mass=".1"/><site name="%s" pos="0 0 .01"/></body>'
    bodies = ball % ("x", ".1 0 0", "b") + ball % ("y", ".1 .1 -.1", "c")
    tendon = '<spatial stiffness="50" damping="1"><site site="%s"/><site site="%s"/></spatial>'
    text = '<mujoco><option timestep="1e-4"/><worldbody><site name="a"/>%s</worldbody><tendon>%s</tendon></mujoco>'
    data, result = both(text % (bodies, tendon % ("a", "b") + tendon % ("b", "c")), 0.2)
    moved = result.joint_position.sel(joint=["x_x", "x_y", "x_z", "y_x", "y_y", "y_z"]).values[-1]
    starts = [0.1, 0.0, 0.0, 0.1, 0.1, -0.1]
    np.testing.assert_allclose(moved + starts, [*data.qpos[:3], *data.qpos[7:10]], atol=1e-3)
    with pytest.raises(fp.InputError, match="nor a free body of several shapes or held by a tendon or loop"):
        fp.from_mujoco(mujoco.MjModel.from_xml_string(text % (bodies, "")))


THROWN = """<mujoco><option timestep="2e-5" gravity="0 0 0"/><worldbody><geom type="plane" size="1 1 .1" SOFT/>
<body pos="0 0 .0201"><freejoint/><geom size=".02" mass=".05" SOFT/></body>
<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".02" mass=".05" contype="0" conaffinity="0"/></body></worldbody>
<keyframe><key qvel="0 0 -.1 0 0 0 0"/></keyframe></mujoco>"""


@pytest.mark.parametrize("soft", ["", 'solref=".005 1"', 'solref=".01 .3"', 'solref=".01 2"', 'solref="-4e4 -60"'])
def test_contacts_throw_back_as_much_of_an_impact_as_in_mujoco(soft):
    """At 0.1 m/s, within 5 % of that; at 2 s/m, whatever solref says, 87 % would come back."""
    data, result = both(THROWN.replace("SOFT", soft), 0.1)
    position = result.object_position.values[:, 0, 2]
    np.testing.assert_allclose((position[-1] - position[-2]) / 0.02, data.qvel[2], atol=5e-3)
    assert data.qvel[2] < 0.08


@pytest.mark.parametrize("share", [0.05, 0.135, 0.5, 0.95, 0.9995])
def test_the_damping_of_an_impact_is_that_of_its_motion(share):
    """The motion m d'' = -d (1 + c d') from d = 0 at speed 1 ends at d = 0 with that share of it."""
    run = solve_ivp(
        lambda _, x: [x[1], -x[0] * (1.0 + impact_damping(share) * x[1])],
        (0.0, 50.0),
        [0.0, 1.0],
        events=lambda t, x: x[0] + (t == 0.0),
        rtol=1e-9,
        atol=1e-12,
        method="LSODA",
    )
    np.testing.assert_allclose(-run.y_events[0][0][1], share, rtol=1e-3)


@pytest.mark.parametrize("ratio", [0.0, 0.2, 0.7071, 0.999, 1.0, 1.001, 3.0])
def test_the_share_that_a_damped_spring_throws_back_is_that_of_its_motion(ratio):
    run = solve_ivp(
        lambda _, x: [x[1], -x[0] - 2.0 * ratio * x[1]],
        (0.0, 50.0),
        [0.0, 1.0],
        events=lambda t, x: x[0] + 2.0 * ratio * x[1] + (t == 0.0),
        rtol=1e-10,
        atol=1e-13,
    )
    np.testing.assert_allclose(restitution(ratio), -run.y_events[0][0][1], atol=1e-7)


PINCHED = """<mujoco><option timestep="5e-4" cone="elliptic" impratio="20"/>
<default><geom solref=".004 1" condim="DIM" friction=".9 .012 .0001"/></default><worldbody>
<body name="left" pos="0 -.026 .2"><joint name="left" type="slide" axis="0 1 0" damping="4" armature=".02"/>
 <geom name="left_tip" size=".01" mass=".03"/></body>
<body name="right" pos="0 .026 .2"><joint name="right" type="slide" axis="0 -1 0" damping="4" armature=".02"/>
 <geom name="right_tip" size=".01" mass=".03"/></body>
<body name="card" pos=".018 0 .2"><freejoint/><geom name="card" type="box" size=".04 .015 .025" mass=".04"/></body>
</worldbody>
<actuator><motor joint="left"/><motor joint="right"/></actuator>
<keyframe><key qpos="0 0 .018 0 .2 1 0 0 0" ctrl="8 8"/></keyframe></mujoco>"""


def test_a_card_pinched_off_its_centre_stays_level_by_torsional_friction():
    """Bristles of stiffness k_t r^2 on both sides bend by m g d / (2 k_t r^2), r = torsion / mu; without, it falls."""
    data, result = both(PINCHED.replace("DIM", "4"), 0.5)
    level, (x, y, z) = 0.04 * 9.81 * 0.018, result.object_orientation.values[-1, 0, :3]
    stiffness = Surface().tangential_stiffness * (0.012 / 0.9) ** 2
    assert 2.0 * np.arcsin(abs(y)) == pytest.approx(level / (2.0 * stiffness), rel=1e-3)
    assert max(abs(x), abs(z)) < 1e-6
    # MuJoCo's creeps meanwhile.
    assert 2.0 * np.arccos(min(data.qpos[5], 1.0)) < 0.02
    tips = result.contact_moment.values[-1][result.contact_normal_force.values[-1] > 0.0]
    assert np.abs(tips) == pytest.approx([level / 2.0] * 2, rel=1e-3)
    _, fallen = both(PINCHED.replace("DIM", "3"), 0.5)
    assert abs(float(fallen.object_orientation[-1, 0, 1])) > 0.2


def test_torsional_friction_is_written_as_it_was_read_and_rolling_friction_is_listed():
    with pytest.warns(
        fp.exceptions.LeftOutWarning, match="rolling friction .condim 6. of geoms: left_tip and right_tip, left_tip and"
    ):
        first = fp.from_mujoco(mujoco.MjModel.from_xml_string(PINCHED.replace("DIM", "6")))
    written = mujoco.MjModel.from_xml_string(fp.to_mjcf(first))
    assert set(written.pair_dim) == {4}
    assert written.pair_friction[:, :3] == pytest.approx(np.array([[0.9, 0.9, 0.012]] * len(written.pair_dim)))


LED = """<mujoco><compiler angle="radian"/><option timestep="5e-4" cone="elliptic"/><worldbody>
<body name="table" mocap="true"><geom type="plane" size="1 1 .1"/></body>
<body name="block" mocap="true" pos="9 9 9"><geom type="box" size=".05 .05 .02"/></body>
<body name="leader" mocap="true" pos="9 9 9"><geom size=".01"/></body>
<body name="ball" pos=".3 0 .2"><freejoint/><geom size=".02" mass=".05"/></body>
<body name="other" pos="0 .3 .2"><freejoint/><geom size=".02" mass=".05"/></body>
<body name="palm" pos="0 0 .3"><freejoint/><geom type="box" size=".03 .02 .01" mass=".2" contype="0" conaffinity="0"/>
 <body pos=".03 0 0"><joint name="flex" axis="0 1 0" damping="4e-3" armature="2e-5"/>
 <geom type="capsule" size=".006" fromto="0 0 0 .05 0 0" mass=".02" contype="0" conaffinity="0"/></body></body>
</worldbody><equality><weld body1="leader" body2="palm" relpose="0 0 -.05 1 0 0 0" solref=".01 1"/></equality>
<actuator><position joint="flex" kp=".5" kv=".02"/></actuator>
<keyframe><key mpos="0 0 .01 .3 0 .1 0 0 .35" mquat="1 0 0 0 .9 0 0 .1 .96 0 .28 0" ctrl=".8"
 qpos=".3 0 .2 1 0 0 0 0 .3 .2 1 0 0 0 0 0 .3 1 0 0 0 0"/>
<key name="elsewhere" mpos="1 0 .01 .3 0 .1 0 0 .35"/></keyframe></mujoco>"""


def test_mocap_bodies_stay_where_a_keyframe_has_them_and_lead_and_carry_what_is_there():
    """A weld takes a palm to its leader's place and turn, a box and a plane catch balls."""
    with pytest.warns(fp.exceptions.LeftOutWarning, match="keyframe elsewhere: place of mocap body table"):
        data, result = both(LED, 0.6)
    # Bodies that stand still do not touch each other.
    assert not tomllib.loads(result.attrs["scenario"])["finger"]["tree"].get("touching")
    where = dict(zip(result.joint.values, result.joint_position.values[-1], strict=True))
    moved = np.add([where[f"palm_{axis}"] for axis in "xyz"], [0.0, 0.0, 0.3])
    np.testing.assert_allclose(moved, data.body("palm").xpos, atol=1e-3)
    turn = 2.0 * np.arctan2(data.qpos[19], data.qpos[17])
    assert turn > 0.5
    assert abs(where["palm_pitch"]) == pytest.approx(turn, abs=1e-3)
    assert where["flex"] == pytest.approx(data.joint("flex").qpos[0], abs=1e-3)
    balls = [data.body(name).xpos for name in ("ball", "other")]
    np.testing.assert_allclose(result.object_position.values[-1], balls, atol=1e-3)


ELL = """<mujoco><option timestep="2e-4" cone="elliptic"/><default><geom condim="1"/></default><worldbody>
<geom type="plane" size="1 1 .1"/><body name="ell" euler="20 10 30"><freejoint/>
 <geom type="box" size=".03 .008 .008" pos=".02 0 0" mass=".03"/>
 <geom type="capsule" size=".008" fromto="0 0 0 0 .03 0" mass=".02"/></body>
<body pos="1 0 1"><joint name="j"/><geom size=".01" mass=".2" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j"/></actuator>
<keyframe><key name="thrown" qpos="0 0 .3 .96 .2 .1 .15 0" qvel=".3 .1 0 2 3 -4 0"/>
<key name="slid" qpos="0 0 .008 .8 0 0 .6 0" qvel=".3 .1 0 0 0 2 0"/></keyframe></mujoco>"""


@pytest.mark.parametrize("keyframe, seconds", [("thrown", 0.2), ("slid", 0.3)])
def test_a_free_body_of_several_geoms_flies_and_slides_as_in_mujoco(keyframe, seconds):
    """Off its middle, and turning about no principal axis; lying, it slides without friction on both geoms."""
    data, result = both(ELL, seconds, keyframe)
    start = mujoco.MjData(data.model)
    mujoco.mj_forward(data.model, start)
    centre = result.joint_position.sel(joint=["ell_x", "ell_y", "ell_z"]).values[-1] + start.body("ell").xipos
    np.testing.assert_allclose(centre, data.body("ell").xipos, atol=3e-4)
    velocity = result.joint_velocity.sel(joint=["ell_x", "ell_y", "ell_z"]).values[-1]
    moved = np.zeros(6)
    mujoco.mj_objectVelocity(data.model, data, mujoco.mjtObj.mjOBJ_BODY, data.body("ell").id, moved, 0)
    # Which is that of the step before.
    np.testing.assert_allclose(velocity, moved[3:], atol=3e-3)
    joints = fp.from_mujoco(data.model).tree.joints
    turned = Rotation.identity()
    for name in ("ell_yaw", "ell_pitch", "ell_roll"):
        turned *= Rotation.from_rotvec(float(result.joint_position.sel(joint=name)[-1]) * np.array(joints[name].axis))
    meant = Rotation.from_matrix(data.body("ell").xmat.reshape(3, 3))
    assert (Rotation.from_matrix(start.body("ell").xmat.reshape(3, 3)).inv() * meant).magnitude() > 0.3
    assert (meant.inv() * Rotation.from_matrix(start.body("ell").xmat.reshape(3, 3)) * turned).magnitude() < 2e-3


HAMMER = """<mujoco><option timestep="2e-4" cone="elliptic"/><default><geom condim="1"/></default><worldbody>
<geom type="plane" size="1 1 .1"/><body name="hammer" euler="20 10 30"><freejoint/>
 <geom type="box" size=".03 .008 .008" pos=".02 .003 0" euler="0 0 15" mass=".03"/>
 <geom type="box" size=".01 .03 .01" pos="-.02 0 .01" mass=".06" contype="0" conaffinity="0"/></body>
<body pos="1 0 1"><joint name="j"/><geom size=".01" mass=".2" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="j"/></actuator>
<keyframe><key name="thrown" qpos="0 0 .5 .96 .2 .1 .15 0" qvel=".3 .1 0 6 9 -12 0"/>
<key name="dropped" qpos="0 0 .06 .8 .1 0 .6 0" qvel=".1 0 -.3 0 1 2 0"/></keyframe></mujoco>"""


@pytest.mark.parametrize("keyframe, seconds, near", [("thrown", 0.3, 2e-3), ("dropped", 0.06, 2e-3)])
def test_a_free_body_whose_mass_lies_beside_what_touches_is_an_object_with_it(keyframe, seconds, near):
    """It tumbles by more than half a turn about no principal axis, or is dropped on a corner; its energy is kept."""
    data, result = both(HAMMER, seconds, keyframe)
    assert not fp.from_mujoco(data.model).tree.left_out
    geom = data.geom(1)
    np.testing.assert_allclose(result.object_position.values[-1, 0], geom.xpos, atol=near)
    turned = Rotation.from_quat(result.object_orientation.values[-1, 0])
    assert (turned.inv() * Rotation.from_matrix(geom.xmat.reshape(3, 3))).magnitude() < 20.0 * near
    assert abs(float(result.energy_residual[-1])) < 1e-6
    # A free body without joints or tendons has no friction at all, and what has a bearing stands still.
    assert float(result.energy_exchanged_joint_coulomb[-1]) == 0.0


def test_what_is_written_of_an_object_keeps_its_mass_centre_and_inertia():
    model = mujoco.MjModel.from_xml_string(HAMMER)
    written = mujoco.MjModel.from_xml_string(fp.to_mjcf(fp.from_mujoco(model)))
    at = [np.flatnonzero(each.body_dofnum == 6)[0] for each in (model, written)]
    np.testing.assert_allclose(*(each.body_inertia[k] for each, k in zip((model, written), at, strict=True)), rtol=1e-6)
    again, first = (fp.from_mujoco(each).tree.objects["hammer"] for each in (written, model))
    np.testing.assert_allclose(again.centre, first.centre, atol=1e-9)
    np.testing.assert_allclose(again.moments, first.moments, atol=1e-12)


def test_a_free_body_that_turns_where_its_hinges_cannot_is_refused_by_name():
    text = ELL.replace('qpos="0 0 .3 .96 .2 .1 .15 0"', 'qpos="0 0 .3 1 0 1 0 0"').replace('euler="20 10 30"', "")
    with pytest.raises(fp.InputError, match="free body ell: turns where the second of its three hinges"):
        fp.from_mujoco(mujoco.MjModel.from_xml_string(text))
