"""Attributes of MuJoCo's schema, one by one: what moves a model in MuJoCo is carried over, or is listed."""

import re

import mujoco
import numpy as np
import pytest
from mujoco_schema import ALL, SCHEMA, kind_of

import finger_pin as fp
from finger_pin.description.loading import read_scenario

pytestmark = pytest.mark.filterwarnings("ignore:hand. not carried over")
#: Where defaults belong that several elements have.
HOMES = {name: ("body", name) for name in ("joint", "geom", "site")} | {"mesh": ("asset", "mesh")}
HOMES |= {name: ("asset", name) for name in ("texture", "material")}
HOMES |= {"tendon": ("spatial",), "equality": ("connect",), "velocity": ("actuator", "velocity")}


def schema():
    """Yield the names of elements, from the root, and the attributes of each, of MuJoCo as it is installed."""
    path = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        if head := re.match(r"( *)(?:\(world\))?(\w+) \(.\)", line[:30]):
            path[len(head[1]) // 3 :] = [head[2]]
        place = tuple(path[1:]) or ("mujoco",)
        if place[0] == "default" and len(place) > 1:
            place = (*HOMES.get(place[1], place[1:2]), *place[2:])
        for attribute in line[30:].split():
            yield place, attribute


def test_every_attribute_of_the_installed_schema_is_carried_listed_or_of_no_effect():
    known = list(schema())
    assert len(known) > 1000
    assert [(place, attribute) for place, attribute in known if kind_of(place, attribute) is None] == []
    assert kind_of(("joint",), "of_a_new_release") is None
    attributes = {attribute for _, attribute in known}
    named = {each for kinds in SCHEMA.values() for names in kinds.values() for each in names.split()}
    assert named - attributes == {ALL}


MODEL = """<mujoco><compiler angle="radian"/><option timestep="1e-3" OPTION/>
<worldbody><geom name="floor" type="plane" size="1 1 .1" pos="0 0 -.1" PLANE/><site name="w" pos="-.05 0 .03"/>
<body name="a" BODY><joint name="j" axis="0 1 0" damping="2e-3" JOINT/>
 <geom type="capsule" size=".005" fromto="0 0 0 .05 0 0" mass=".02"/><site name="s" pos=".03 0 .01"/>
 <body name="b" pos=".05 0 0"><joint name="k" axis="0 1 0" damping="1e-3"/><geom size=".008" mass=".01"/></body></body>
<body name="ball" pos=".2 0 -.06"><joint type="free" name="f" FREE/><geom name="gball" size=".01" mass=".02" BALL/>
</body></worldbody><contact>CONTACT</contact>
<tendon><fixed name="t" TENDON><joint joint="j" coef=".01"/><joint joint="k" coef=".01"/></fixed></tendon>
<equality><joint name="e" joint1="k" joint2="j" polycoef="0 .5 0 0 0" EQUALITY/></equality>
<actuator><position name="p" joint="j" kp=".3" DRIVE/><motor name="m" tendon="t" MOTOR/></actuator>
<keyframe><key qpos=".1 .2 .2 0 -.06 1 0 0 0" ctrl=".5 .5" KEY/></keyframe></mujoco>"""
LIMITED = 'limited="true" range="-.1 .2"'
PAIR = '<pair geom1="gball" geom2="floor" '
#: By place in the model, attributes that it has or has not.
EXAMPLES = {
    "OPTION": ['gravity="0 0 -1"', 'density="1000"', 'viscosity="1"', 'wind="1 0 0" density="10"'],
    "PLANE": ['contype="2" conaffinity="2"', 'friction="2"', 'surfacevel="1 0 0"'],
    "BODY": ['gravcomp="1"', 'quat="1 .1 0 0"'],
    "JOINT": [
        'armature="1e-3"',
        'frictionloss=".01"',
        'frictionloss=".01" solreffriction=".2 1"',
        'ref=".3"',
        'pos=".01 0 0"',
        'springdamper=".1 1"',
        'springref=".5" stiffness=".1"',
        'stiffness=".1 .5 2"',
        'springyield=".01" stiffness=".5"',
        'actuatorfrcrange="-.01 .01"',
        'actuatorgravcomp="true" actuatorfrcrange="-.01 .01"',
        LIMITED,
        f'{LIMITED} margin=".1"',
        f'{LIMITED} solreflimit=".1 1"',
        f'{LIMITED} solimplimit=".5 .6 .01"',
    ],
    "FREE": ['damping=".1"', 'armature=".1"', 'frictionloss=".1"', 'stiffness="10"'],
    "BALL": ['contype="2" conaffinity="2"', 'solref=".1 1"', 'margin=".005"', 'surfacevel="1 0 0"'],
    "CONTACT": ['<exclude body1="ball" body2="world"/>', f'{PAIR} margin=".01"/>', f'{PAIR} solref=".1 1"/>'],
    "TENDON": [
        'actuatorfrcrange="-.1 .1"',
        'armature="1"',
        'damping="3"',
        'damping="1 5 5"',
        'frictionloss=".3"',
        'stiffness="100 10 10"',
        'springyield=".01" stiffness="100"',
        'stiffness="100" springlength="0"',
        'limited="true" range="-.001 .002"',
        'limited="true" range="-.001 .002" solreflimit=".1 1"',
    ],
    "EQUALITY": ['active="false"', 'solref=".1 1"', 'solimp=".5 .6 .01"'],
    "DRIVE": [
        'armature="1e-3"',
        'damping=".01"',
        'damping=".01 .1 .1"',
        'ctrlrange="-.1 .1"',
        'forcerange="-.01 .01"',
        'delay=".05" nsample="50"',
        'gear="2"',
        'kv=".01"',
        'timeconst=".05"',
        'dampratio="1"',
    ],
    "MOTOR": ['armature="1"', 'damping=".5"', 'ctrlrange="0 .1"', 'ctrlrange=".2 .3" gear="-1"', 'forcerange="-.1 .1"'],
    "KEY": ['qvel="1 2 0 0 0 0 0 0"', 'qvel="0 0 .5 0 0 0 0 10"'],
}


def model_with(**given):
    """Return the model with attributes at some of its places; the ball slides."""
    given = dict.fromkeys(EXAMPLES, "") | {"KEY": 'qvel="0 0 1 0 0 0 0 0"'} | given
    text = re.sub(r"\b(" + "|".join(EXAMPLES) + r")\b", lambda place: given[place[0]], MODEL)
    return mujoco.MjModel.from_xml_string(text)


def end_of(model, seconds=0.2):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return data.qpos


@pytest.mark.slow
@pytest.mark.parametrize("place", EXAMPLES)
def test_no_attribute_that_moves_a_model_in_mujoco_is_passed_over(place):
    """Its motion changes by more than 1e-3: what is read changes in more than its list, or a line is new there."""
    plain = model_with()
    before, end = fp.from_mujoco(plain), end_of(plain)
    moving = 0
    for example in EXAMPLES[place]:
        model = model_with(**{place: example})
        if np.abs(end_of(model) - end).max() > 1e-3:
            moving += 1
            found = fp.from_mujoco(model)
            assert found != before, example
    assert moving >= len(EXAMPLES[place]) - 1


ARM = """<mujoco><compiler angle="radian"/><option timestep="2e-4" gravity="0 0 0"/><worldbody>
<body name="base" pos=".1 0 0"><site name="o" pos="-.02 0 0"/></body>
<body name="a"><joint name="j" axis="0 1 0" damping="2e-3" armature="1e-5"/>
 <geom type="capsule" size=".005" fromto="0 0 0 .04 0 0" mass=".008" contype="0" conaffinity="0"/>
 <body name="b" pos=".04 0 0"><joint name="k" axis="0 1 0" damping="2e-3" armature="1e-6" LIMIT/>
  <geom type="capsule" size=".005" fromto="0 0 0 .025 0 0" mass=".005" contype="0" conaffinity="0"/>
  <site name="e" pos=".04 0 0"/></body></body>
<site name="p" pos="-.03 0 .01"/><site name="q" pos="-.05 0 .02"/></worldbody>TENDON
<equality>EQUALITY</equality><actuator><position joint="j" kp="2"/><motor joint="k"/>MOTOR</actuator>
<keyframe><key ctrl="CTRL" qvel="0 VELOCITY"/></keyframe></mujoco>"""
STIFF = 'solref=".005 1"'
STILL = '<tendon><spatial name="t"><site site="p"/><site site="q"/></spatial></tendon>'
#: A load on a coupling, a stop, welds and connections by other solver settings, a start with a speed, an idle tendon.
MOTIONS = {
    "coupling": {"EQUALITY": '<joint joint1="k" joint2="j"/>', "CTRL": ".8 -.02"},
    "stiff coupling": {"EQUALITY": f'<joint joint1="k" joint2="j" {STIFF}/>', "CTRL": ".8 -.02"},
    "stop": {"LIMIT": 'limited="true" range="-1 .1"', "CTRL": ".3 .02"},
    "stiff stop": {"LIMIT": 'limited="true" range="-1 .1" solreflimit="-2e4 -200"', "CTRL": ".3 .02"},
    "weld": {"EQUALITY": '<weld body1="a" body2="b" anchor=".03 .03 0"/>', "CTRL": ".3 .001"},
    "fixed": {"EQUALITY": '<connect site1="e" site2="o"/>', "CTRL": ".3 .01"},
    "speed": {"CTRL": ".3 0", "VELOCITY": "20"},
    "still tendon": {"TENDON": STILL, "MOTOR": '<position tendon="t" kp="100"/>', "CTRL": ".3 0 .2"},
    "armature": {"MOTOR": '<motor joint="k" gear="3" armature="1e-5" damping="1e-4"/>', "CTRL": ".3 .001 .001"},
}
SMOOTH = {"finger.joint_friction.coulomb": 0.0, "finger.joint_friction.stiction": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_elements_that_are_carried_over_move_as_in_mujoco(name):
    given = {"VELOCITY": "0"} | MOTIONS[name]
    text = re.sub(r"\b(LIMIT|TENDON|EQUALITY|MOTOR|CTRL|VELOCITY)\b", lambda place: given.get(place[0], ""), ARM)
    model = mujoco.MjModel.from_xml_string(text)
    seconds = 0.05 if name in ("speed", "armature") else 1.0
    table = {"name": "x", "finger": fp.from_mujoco(model).model_dump(mode="python", exclude_none=True)}
    table |= {"controller": {"kind": "tensions"}, "simulation": {"duration": seconds, "sample_rate": 20.0}}
    result = fp.simulate(read_scenario(table, SMOOTH))
    expected = end_of(model, seconds)
    assert np.abs(expected).max() > 0.02
    # Friction without a level is 1e-7 N m, and MuJoCo's steps are of first order.
    np.testing.assert_allclose(result.joint_position.values[-1], expected, rtol=0.01, atol=2e-3)


def test_names_of_actuators_are_their_own_and_controls_find_them():
    body = '<body><joint name="j" axis="0 1 0"/><geom size=".1" mass="1"/></body>'
    tendon = '<tendon><fixed name="t"><joint joint="j" coef="-.01"/></fixed></tendon>'
    motors = (
        '<motor tendon="t" gear="-1" ctrlrange="0 10"/><motor joint="j"/><motor tendon="t" gear="-1" ctrlrange="2 9"/>'
    )
    key = '<keyframe><key ctrl="4 .5 3"/></keyframe>'
    text = f"<mujoco><worldbody>{body}</worldbody>{tendon}<actuator>{motors}</actuator>%s</mujoco>"
    found = fp.from_mujoco(mujoco.MjModel.from_xml_string(text % key))
    assert found.tree.keyframes["keyframe_0"].inputs == {"actuator_0": 4.0, "actuator_1": 0.5, "actuator_2": 3.0}
    # One that never lets go of its tendon keeps the lower end of its range; what nobody commands pulls with nothing.
    assert list(found.tendons) == ["actuator_0"] and found.tree.actuators["actuator_2"].input_range == (2.0, 9.0)
    silent = fp.from_mujoco(mujoco.MjModel.from_xml_string(text % ""))
    assert set(silent.tree.keyframes["reference"].inputs.values()) == {0.0}


def test_motors_may_be_called_as_the_tendon_that_they_pull_or_as_another():
    """Names of tendons and of actuators are apart in MuJoCo; what is pulled has the same arms by any name."""
    body = '<body><joint name="j" axis="0 1 0"/><geom size=".1" mass="1"/></body>'
    tendon = '<fixed name="%s"><joint joint="j" coef="%g"/></fixed>'
    tendons = "".join(tendon % each for each in (("t", -0.01), ("s", 0.02)))
    motor = '<motor name="%s" tendon="%s" gear="-1" ctrlrange="0 10"/>'
    crossed = ["s_motor", "t_motor"]
    for first, second, names in (("t", "s", ["t", "s"]), ("a", "b", ["a", "b"]), ("s", "t", crossed)):
        motors = motor % (first, "t") + motor % (second, "s")
        text = f"<mujoco><worldbody>{body}</worldbody><tendon>{tendons}</tendon><actuator>{motors}</actuator>"
        found = fp.from_mujoco(mujoco.MjModel.from_xml_string(f'{text}<keyframe><key ctrl="4 3"/></keyframe></mujoco>'))
        assert list(found.tendons) == names
        assert found.tree.keyframes["keyframe_0"].inputs == dict(zip(names, (4.0, 3.0), strict=True))
        np.testing.assert_allclose(fp.Finger(found).coupling[:, 0], [0.01, -0.02])


CROWD = """<mujoco><worldbody>
<geom name="floor" type="plane" size="1 1 .1" pos="0 0 -.01" priority="PRIORITY" friction=".3"/>
<body name="a" pos="0 0 .3"><joint name="j" type="slide"/><geom name="pad" size=".02" mass=".1" friction="1.2"/></body>
<body name="ball" pos=".2 0 .1"><freejoint/><geom name="g" size=".02" mass=".1" friction=".2"/></body>
<body name="cube" pos=".4 0 .1"><freejoint/>
 <geom name="c" type="box" size=".02 .02 .02" mass=".1" friction=".2"/></body>
</worldbody><contact>CONTACT</contact></mujoco>"""


@pytest.mark.parametrize("contact", ["", '<exclude body1="ball" body2="cube"/>', '<pair geom1="pad" geom2="g"/>'])
@pytest.mark.parametrize("priority", [0, 1])
def test_pairs_touch_and_rub_as_in_mujoco_or_are_listed(priority, contact):
    """Of all three pairs of each: what `mj_contactParam` mixes where they overlap, and no contact where it has none."""
    model = mujoco.MjModel.from_xml_string(CROWD.replace("PRIORITY", str(priority)).replace("CONTACT", contact))
    found = fp.from_mujoco(model)
    contacts = next(table for table in fp.Hand(found).mechanism.rows if table.group == "contacts")
    data = mujoco.MjData(model)
    # All at one place: every pair that may touch does.
    data.qpos[:] = [0.0, 0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0]
    model.geom_pos[0, 2] = 0.3
    mujoco.mj_forward(model, data)
    names = {"g": "ball", "c": "cube"}
    theirs = {
        frozenset(names.get(n, n) for n in (model.geom(int(i)).name for i in each.geom)): each.friction[0]
        for each in data.contact
    }
    level = contacts.parameters[contacts.law.parameters.index("kinetic")]
    ours = {frozenset(n.split(".")[0].split("-")): v for n, v in zip(contacts.names, level, strict=True)}
    assert set(ours) == set(theirs)
    listed = next((line for line in found.tree.left_out if line.startswith("friction of pairs")), "")
    for pair, friction in theirs.items():
        told = all(dict(ball="g", cube="c").get(name, name) in listed for name in pair)
        assert ours[pair] == pytest.approx(friction) or (told and ours[pair] > friction), sorted(pair)
