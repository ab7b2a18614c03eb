"""A hand that was read from MuJoCo and written again moves in MuJoCo as the model that it was read from."""

import mujoco
import pytest
from mujoco_models import HEAD, MODELS, ROUTED

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.description.surface import Surface

PHALANX = '<geom type="capsule" size="0.006" fromto="0 0 0 {0} 0 0" mass="0.03" contype="0" conaffinity="0"/>'
BODY = """<body name="near" pos="0 0 0.1" euler="0.2 0 0.1"><joint name="mcp" axis="0 -1 0" ref="0.3" range="-0.2 1"
limited="true" stiffness="0.1" springref="0.2" damping="0.01" armature="1e-4" frictionloss="0.002"/>{}<site name="in"
pos="0.01 0 0.008"/><body name="far" pos="0.05 0 0" euler="0 0.3 0"><joint name="pip" axis="0 -1 0" pos="0.002 0 0.001"
ref="-0.2" damping="0.01" armature="1e-4"/>{}<site name="tip" pos="0.04 0 0"/><site name="on" pos="0.01 0 0.007"/>
</body></body><body name="rod" pos="0.02 0.05 0.1"><joint name="rod" type="slide" axis="1 0 0" damping="3"/>{}</body>
"""
BODY = BODY.format(PHALANX.format(0.05), PHALANX.format(0.04), PHALANX.format(0.03))
CORD = '<tendon><spatial name="cord" {}><site site="in"/><site site="on"/></spatial></tendon>'
REST = {
    "polynomial": '<equality><joint joint1="pip" joint2="mcp" polycoef="0.1 0.6 0.2 -0.3 0.1" solref="-900 -40"'
    ' solimp="0.95 0.95 0.001"/></equality>',
    "loop": '<equality><connect body1="far" body2="rod" anchor="0.03 0 0" solref="0.03 0.9"'
    ' solimp="0.95 0.95 0.001"/></equality>',
    "weld": '<equality><weld body1="far" body2="rod" solref="0.03 0.9"/></equality>',
    "muscle": CORD.format("") + '<actuator><muscle name="m" tendon="cord" lengthrange=".02 .06" force="6"/></actuator>',
    "limit": CORD.format('limited="true" range="0 0.035" solreflimit="0.02 0.5" stiffness="300" springlength="0 0.03"'),
    "servos": '<actuator><position name="a" joint="mcp" kp="0.5" kv="0.02" timeconst="0.03" delay="0.05"'
    ' nsample="300"/>'
    '<pid name="b" joint="pip" kp="0.4" kv="0.02" ki="1" imax="0.2"/><pid name="c" joint="rod" kp="90" slewmax="0.2"/>'
    '<intvelocity name="d" joint="rod" kp="20" actrange="-0.01 0.02"/></actuator>',
    "pulled": CORD.format("") + '<actuator><motor name="cord" tendon="cord" gear="-1" ctrlrange="0 9"/></actuator>'
    '<keyframe><key name="bent" qpos="0.5 0.2 0.001" qvel="1 -2 0" ctrl="3"/></keyframe>',
}  # fmt: skip


MODELS_BY_NAME = {name: f"<mujoco>{HEAD}<worldbody>{BODY}</worldbody>{rest}</mujoco>" for name, rest in REST.items()}
MODELS_BY_NAME |= {
    "routed": ROUTED,
    "held up": MODELS_BY_NAME["loop"].replace('name="far"', 'name="far" gravcomp="0.7"'),
}


def moved(model, seconds=0.3, step=2e-4):
    """Return positions by joint after a time, under controls by actuator, or those of the first keyframe."""
    model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    for i in range(model.nu if not data.ctrl.any() else 0):
        first = getattr(model, "actuator_ctrladr", range(model.nu))
        if i < len(model.actuator_trntype):
            data.ctrl[first[i]] = 0.2 + 0.1 * (ord(model.actuator(i).name[0]) % 3)
    for _ in range(round(seconds / step)):
        mujoco.mj_step(model, data)
    return {model.joint(j).name: data.qpos[model.jnt_qposadr[j]] for j in range(model.njnt)}


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS_BY_NAME)
def test_a_model_that_is_read_and_written_moves_in_mujoco_as_before_and_reads_the_same(name):
    model = mujoco.MjModel.from_xml_string(MODELS_BY_NAME[name])
    hand = fp.from_mujoco(model)
    text = fp.to_mjcf(hand)
    again = mujoco.MjModel.from_xml_string(text)
    assert_alike(fp.from_mujoco(again), hand)
    before, after = moved(model), moved(again)
    assert max(abs(before[joint] - model.qpos0[k]) for k, joint in enumerate(before)) > 0.01
    # A weld of MuJoCo turns otherwise than three points do.
    assert after == pytest.approx(before, abs=4e-3 if name == "weld" else 1e-6)


def assert_alike(one, other):
    """Assert that two descriptions are the same to rounding, but for what was left out of their models."""
    first, second = ({k: v for k, v in flat(each.model_dump()).items() if "left_out" not in k} for each in (one, other))
    assert first.keys() == second.keys()
    for key, value in second.items():
        number = isinstance(value, float)
        assert first[key] == (pytest.approx(value, rel=1e-9, abs=1e-9) if number else value), key


def flat(value, above=""):
    """Return the entries of a nested table by their keys."""
    if isinstance(value, dict):
        return {key: leaf for name, each in value.items() for key, leaf in flat(each, f"{above}.{name}").items()}
    if isinstance(value, list | tuple):
        return {key: leaf for k, each in enumerate(value) for key, leaf in flat(each, f"{above}[{k}]").items()}
    return {above: value}


@pytest.mark.filterwarnings("ignore::finger_pin.exceptions.LeftOutWarning")
def test_a_whole_hand_is_written_with_its_meshes_and_what_was_changed():
    hand = fp.load_finger(fp.from_mujoco(MODELS["shadow"]()), {"finger.tree.bodies.robot0_ffdistal.mass": 0.05})
    text = fp.to_mjcf(hand)
    model = mujoco.MjModel.from_xml_string(text)
    assert model.body("robot0_ffdistal").mass[0] == 0.05
    assert (model.nq, model.ntendon, model.nu) == (24, 44, 20) and model.nmesh == len(hand.tree.meshes) == 10
    assert all(line.replace("--", "- -") in text for line in hand.tree.left_out)


CARD = """<worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="arm" pos="0 0 0.05"><joint name="arm" axis="0 1 0" damping="0.002"/>
<geom name="arm" type="capsule" size="0.005" fromto="0 0 0 0.08 0 0" mass="0.02"/></body>
<body name="ball" pos="0.06 0 0.072"><freejoint/><geom name="ball" type="sphere" size="0.015" mass="0.02"/></body>
</worldbody><keyframe><key qpos="0 0.06 0 0.072 1 0 0 0" qvel="0 0 0 -0.1 0 0 0"/></keyframe>"""


def test_objects_touch_as_in_the_model_that_they_were_read_from():
    options = '<option cone="elliptic" impratio="10"/><default><geom solimp="0.95 0.95 0.001"/></default>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{options}{CARD}</mujoco>")
    hand = fp.from_mujoco(model)
    again = mujoco.MjModel.from_xml_string(fp.to_mjcf(hand))
    assert_alike(fp.from_mujoco(again).tree.objects["ball"], hand.tree.objects["ball"])
    before, after = moved(model, 0.2, 1e-4), moved(again, 0.2, 1e-4)
    assert abs(before["arm"]) > 0.1
    assert after["arm"] == pytest.approx(before["arm"], abs=5e-3)


def arm(**tree):
    """An arm of two joints of our own, whose inertias are about their axes."""
    body = {"mass": 0.02, "centre": (0.02, 0.0, 0.0), "inertia": (1e-6, 4e-6, 4e-6, 0.0, 0.0, 0.0)}
    bodies = {"one": body, "two": {**body, "parent": "one", "position": (0.04, 0.0, 0.0)}}
    joints = {name: {"body": name, "axis": (0.0, 0.0, 1.0)} for name in bodies}
    table = {"bodies": bodies, "joints": joints, **tree}
    ranges = {name: {"range": (-1.0, 1.0), "spring": {"stiffness": 0.05, "damping": 2e-3}} for name in joints}
    return fp.FingerDescription.model_validate(
        {"name": "arm", "gravity": (0.0, 0.0, 0.0), "joints": ranges, "tendons": {}, "tree": table,
         "joint_friction": {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0}}
    )  # fmt: skip


def simulated(finger, inputs, seconds=0.3):
    table = demo_motion(finger, seconds)
    table["controller"] |= {"kind": "tensions", "inputs": {name: {"offset": value} for name, value in inputs.items()}}
    return fp.simulate(read_scenario(table)).joint_position.values[-1]


def in_mujoco(finger, inputs, seconds=0.3):
    model = mujoco.MjModel.from_xml_string(fp.to_mjcf(finger, timestep=5e-5))
    data = mujoco.MjData(model)
    for name, value in inputs.items():
        data.ctrl[model.actuator_ctrladr[model.actuator(name).id]] = value
    for _ in range(round(seconds / 5e-5)):
        mujoco.mj_step(model, data)
    return data.qpos


OWN = {
    "slack": {"tendons": {"t": {"path": {"a": {"kind": "point", "position": (0.0, 0.01, 0.0)},
        "b": {"kind": "point", "body": "two", "position": (0.01, 0.01, 0.0)}}, "stiffness": 900.0, "slack": 2e-3}}},
    "rolling": {"couplings": {"r": {"joint": "two", "other": "one", "rolling": (0.008, 0.01), "offset": 0.05}}},
}  # fmt: skip


@pytest.mark.parametrize("name", OWN)
def test_a_tree_of_ones_own_moves_in_mujoco_as_here(name):
    finger = arm(actuators={"push": {"joint": "one"}}, **OWN[name])
    for torque in (0.02, -0.02):
        assert in_mujoco(finger, {"push": torque}) == pytest.approx(simulated(finger, {"push": torque}), abs=4e-3)


@pytest.mark.slow
def test_stops_of_a_tree_and_on_request_of_a_finger_give_by_torque_over_stiffness():
    """A load of 0.08 N m on a stop of 2 N m/rad, beside a joint's spring of 0.05."""
    finger = arm(actuators={"push": {"joint": "one"}}).updated(stroke_limiter={"stiffness": 2.0, "viscous": 0.05})
    depth = (0.08 - 0.05 * 1.0) / (2.0 + 0.05)
    assert in_mujoco(finger, {"push": 0.08}, 2.0)[0] == pytest.approx(1.0 + depth, abs=1e-3)
    free = mujoco.MjModel.from_xml_string(fp.to_mjcf(finger, limits=False))
    assert not free.jnt_limited.any()
    for limits in (None, True):
        model = mujoco.MjModel.from_xml_string(fp.to_mjcf("planar", limits=limits))
        data = mujoco.MjData(model)
        model.opt.gravity, data.qfrc_applied[0] = 0.0, 0.2
        model.dof_damping[0] = 0.05
        for _ in range(20000):
            mujoco.mj_step(model, data)
        stiffness, upper = fp.load_finger("planar").stroke_limiter.stiffness, model.jnt_range[0, 1]
        if limits:
            assert data.qpos[0] == pytest.approx(upper + 0.2 / stiffness, abs=1e-3)
        else:
            assert data.qpos[0] > upper + 0.5


def test_a_tree_without_springs_and_ends_is_written_with_its_masses():
    bodies = {"one": {"mass": 0.1, "inertia": [1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0]}}
    joints, tips = {"one": {"body": "one", "axis": [0.0, 1.0, 0.0]}}, {"tip": {"body": "one"}}
    tree = {"bodies": bodies, "joints": joints, "tips": tips}
    table = {"name": "bare", "joints": {"one": {"range": [-1.0, 1.0]}}, "tendons": {}, "tree": tree}
    text = fp.to_mjcf(fp.FingerDescription.model_validate(table), limits=False)
    model = mujoco.MjModel.from_xml_string(text)
    assert model.nq == 1 and model.body("one").mass == pytest.approx(0.1, rel=1e-12)


POWERS = {"couplings": {"c": {"joint": "two", "other": "one", "powers": (0.0, 0.0, 0.0, 0.1)}}}
BOTH = {"tendons": {"t": {"joints": {"one": 0.01}, "path": OWN["slack"]["tendons"]["t"]["path"]}}}
REFUSED = [
    (POWERS, r"finger.tree.couplings.c.powers .*MuJoCo has powers up to 4"),
    (BOTH, "finger.tree.tendons.t.joints: is not written: a tendon of MuJoCo has joints or a path"),
    ({"actuators": {"a": {"joint": "one", "integral": 2.0, "gain": 3.0}}}, "finger.tree.actuators.a: with integral or"),
]


@pytest.mark.parametrize(("tree", "message"), REFUSED)
def test_a_part_that_mujoco_lacks_is_refused_by_name(tree, message):
    with pytest.raises(fp.InputError, match=message):
        fp.to_mjcf(arm(**tree))


def test_the_damper_of_a_slack_cord_is_named_as_one_that_mujoco_has_at_any_length():
    """Here a slack cord exerts nothing; MuJoCo damps it: 3 N s/m along its path."""
    (cord,) = OWN["slack"]["tendons"].values()
    finger = arm(tendons={"t": {**cord, "damping": 3.0}})
    text = fp.to_mjcf(finger)
    assert "not damped while they are slack" in text and "not damped" not in fp.to_mjcf(arm(**OWN["slack"]))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[0] = -1.0
    mujoco.mj_forward(model, data)
    assert data.ten_length[0] < model.tendon_lengthspring[0, 1]
    assert data.qfrc_damper[0] == pytest.approx(2e-3 + 3.0 * data.ten_J.ravel()[0] ** 2, rel=1e-6)


def test_friction_of_a_tree_is_added_to_what_is_written_without():
    from finger_pin.mujoco import add_friction

    hand = fp.from_mujoco(mujoco.MjModel.from_xml_string(MODELS_BY_NAME["pulled"]))
    with pytest.raises(fp.InputError, match=r"add_friction[(]mujoco[.]MjSpec[.]from_string[(]text[)], of=hand[)]"):
        fp.to_mjcf(hand, friction=True)
    spec = mujoco.MjSpec.from_string(fp.to_mjcf(hand))
    add_friction(spec, {"cord": {"coulomb": 0.3}})
    assert spec.compile().nplugin == 1


def test_every_number_of_a_surface_is_written_or_named_as_left_out():
    def written(**surface):
        ball = {"shape": "sphere", "radius": 0.01, "mass": 0.02, "position": [0.0, 0.0, 0.2], "surface": surface}
        text = fp.to_mjcf(arm(objects={"ball": ball, "floor": {"shape": "half_space", "position": [0.0, 0.0, -1.0]}}))
        return text[: text.index("-->")], text[text.index("-->") :]

    given = {"torsion": 1e-3}
    header, plain = written(**given)
    for name, field in Surface.model_fields.items():
        number = 1.2 if name == "exponent" else 1.5 * given.get(name, field.default)
        assert written(**given | {name: number})[1] != plain or name in header, name
