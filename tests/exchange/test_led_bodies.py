"""Mocap bodies and joints of trees that are moved along paths."""

import warnings

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import finger_pin as fp
from finger_pin.description.loading import read_scenario

#: A hand on a free base that a leader holds, and a block that carries a ball; a plane and what carries joints stand.
LED = """<mujoco><compiler angle="radian"/><option timestep="5e-4" cone="elliptic"/><worldbody>
<body name="table" mocap="true"><geom type="plane" size="1 1 .1"/></body>
<body name="stand" mocap="true" pos="0 1 .5"><body><joint name="door"/><geom size=".01" mass=".1" contype="0"
 conaffinity="0"/></body></body>
<body name="block" mocap="true" pos=".3 0 .1"><geom type="box" size=".05 .05 .02"/></body>
<body name="leader" mocap="true" pos="0 0 .35" quat=".96 0 .28 0"><geom size=".01" contype="0" conaffinity="0"/></body>
<body name="ball" pos=".3 0 .14"><freejoint/><geom size=".02" mass=".05"/></body>
<body name="palm" pos="0 0 .3"><freejoint/><geom type="box" size=".03 .02 .01" mass=".2" contype="0" conaffinity="0"/>
 <body pos=".03 0 0"><joint name="flex" axis="0 1 0" damping="4e-3" armature="2e-5"/>
 <geom type="capsule" size=".006" fromto="0 0 0 .05 0 0" mass=".02" contype="0" conaffinity="0"/></body></body>
</worldbody><equality><weld body1="leader" body2="palm" relpose="0 0 -.05 1 0 0 0" solref=".01 1"/></equality>
<actuator><position joint="flex" kp=".5" kv=".02"/></actuator>
<keyframe>START<key name="away" mpos="0 0 0 0 1 .5 .3 0 .1 .1 .2 .4" mquat="1 0 0 0 1 0 0 0 1 0 0 0 .8 .6 0 0" ctrl=".8"
 qpos="0 .3 0 .14 1 0 0 0 .1 .2 .35 1 0 0 0 0"/></keyframe></mujoco>"""
LED = LED.replace(
    "START",
    '<key mpos="0 0 0 0 1 .5 .3 0 .1 0 0 .35" mquat="1 0 0 0 1 0 0 0 1 0 0 0 .96 0 .28 0" ctrl=".8"'
    ' qpos="0 .3 0 .14 1 0 0 0 0 0 .3 1 0 0 0 0"/>',
)
#: Where paths lead to within 0.3 s, by half a cosine.
SHIFTS = {"leader_x": 0.1, "leader_z": 0.05, "leader_yaw": 0.7, "leader_roll": -0.4, "block_z": 0.03}
DURATION, SECONDS = 0.3, 0.6


def read(model):
    with warnings.catch_warnings():
        # The table that stands where the first keyframe has it.
        warnings.simplefilter("ignore", fp.exceptions.LeftOutWarning)
        return fp.from_mujoco(model)


def run(hand, **more):
    table = {"name": "x", "finger": hand.model_dump(mode="python", exclude_none=True)}
    table |= {"controller": {"kind": "tensions"}, "simulation": {"duration": SECONDS, "sample_rate": 100.0, **more}}
    paths = {
        f"finger.tree.joints.{name}.path": {"kind": "cosine", "times": [0.0, DURATION], "values": [0.0, value]}
        for name, value in SHIFTS.items()
        if "initial" not in more
    }
    loose = {"finger.joint_friction.coulomb": 0.0, "finger.joint_friction.stiction": 0.0}
    return fp.simulate(read_scenario(table, loose | paths))


def led_by_mujoco(model):
    """Return MuJoCo's data, and palm and ball at each step, of a run in which each step sets the mocap bodies."""
    data, kept = mujoco.MjData(model), []
    mujoco.mj_resetDataKeyframe(model, data, 0)
    start, first = data.mocap_pos.copy(), Rotation.from_quat(np.roll(data.mocap_quat[3], -1))
    for _ in range(round(SECONDS / model.opt.timestep)):
        share = 0.5 - 0.5 * np.cos(np.pi * min(data.time / DURATION, 1.0))
        moved = {name: share * value for name, value in SHIFTS.items()}
        data.mocap_pos[3] = start[3] + [moved["leader_x"], 0.0, moved["leader_z"]]
        data.mocap_pos[2] = start[2] + [0.0, 0.0, moved["block_z"]]
        turned = Rotation.from_euler("ZYX", [moved["leader_yaw"], 0.0, moved["leader_roll"]]) * first
        data.mocap_quat[3] = np.roll(turned.as_quat(), 1)
        mujoco.mj_step(model, data)
        kept.append([data.time, *data.body("palm").xpos, *data.body("ball").xpos])
    return data, np.array(kept)


@pytest.mark.slow
def test_a_palm_follows_its_leader_and_a_ball_its_block_as_in_mujoco():
    """MuJoCo's weld takes mocap bodies for at rest, and lags by what its damper over its spring is: 20 ms."""
    model = mujoco.MjModel.from_xml_string(LED)
    data, kept = led_by_mujoco(model)
    hand = read(model)
    result = run(hand)
    joint = {str(name): result.joint_position.sel(joint=name).values for name in result.joint.values}
    where = np.add(np.column_stack([joint[f"palm_{axis}"] for axis in "xyz"]), [0.0, 0.0, 0.3])
    np.testing.assert_allclose(where[-1], data.body("palm").xpos, atol=3e-4)
    np.testing.assert_allclose(result.object_position.sel(object="ball").values[-1], data.body("ball").xpos, atol=1e-3)
    assert joint["flex"][-1] == pytest.approx(data.joint("flex").qpos[0], abs=2e-3)
    # On the way: where MuJoCo's palm is 20 ms later, once the start is over.
    moving = (result.time.values > 0.1) & (result.time.values < 0.25)
    late = [np.interp(result.time.values[moving] + 0.02, kept[:, 0], kept[:, 1 + k]) for k in range(3)]
    np.testing.assert_allclose(where[moving], np.transpose(late), atol=2e-3)
    share = 0.5 - 0.5 * np.cos(np.pi * np.minimum(result.time.values / DURATION, 1.0))
    for name, value in SHIFTS.items():
        np.testing.assert_allclose(joint[name], share * value, atol=1e-7)
    # What leads has no mass: its work is all that comes in besides the servo's.
    assert abs(float(result.energy_residual[-1])) < 1e-5
    assert float(result.energy_exchanged_objects[-1]) > 0.2 * 9.81 * 0.05
    # Neither leaders nor free bodies have bearings; nothing else has friction that takes anything from them.
    assert not np.any(result.joint_friction.sel(joint=[name for name in joint if name not in ("flex", "door")]))


def test_keyframes_place_leaders_and_what_is_written_is_led_alike():
    """Also after a way through MJCF, where leaders are mocap bodies again."""
    model = mujoco.MjModel.from_xml_string(LED)
    hand = read(model)
    away = hand.tree.keyframes["away"].position
    assert [away[f"leader_{axis}"] for axis in "xyz"] == pytest.approx([0.1, 0.2, 0.05], abs=1e-12)
    turned = Rotation.from_euler("ZYX", [away[f"leader_{name}"] for name in ("yaw", "pitch", "roll")])
    turned *= Rotation.from_quat([0.0, 0.28, 0.0, 0.96])
    assert (turned.inv() * Rotation.from_quat([0.6, 0.0, 0.0, 0.8])).magnitude() < 1e-9
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 1)
    mujoco.mj_step(model, data, round(SECONDS / model.opt.timestep))
    result = run(hand, initial={"keyframe": "away"})
    where = result.joint_position.sel(joint=["palm_x", "palm_y", "palm_z"]).values[-1] + np.array([0.0, 0.0, 0.3])
    np.testing.assert_allclose(where, data.body("palm").xpos, atol=3e-4)
    written = mujoco.MjModel.from_xml_string(fp.to_mjcf(hand))
    assert {written.body(i).name for i in range(written.nbody) if written.body_mocapid[i] >= 0} == {"leader", "block"}
    place = written.body("leader").mocapid[0]
    np.testing.assert_allclose(written.key_mpos[1].reshape(-1, 3)[place], [0.1, 0.2, 0.4], atol=1e-12)
    np.testing.assert_allclose(written.key_mquat[1].reshape(-1, 4)[place], [0.8, 0.6, 0.0, 0.0], atol=1e-9)
    again = read(written).tree
    assert list(again.joints) == list(hand.tree.joints)
    assert list(again.on_paths) == list(hand.tree.on_paths)
    assert again.keyframes["away"].position == pytest.approx(away, abs=1e-9)


def test_mocap_bodies_that_cannot_move_along_a_path_are_named():
    model = mujoco.MjModel.from_xml_string(LED)
    with pytest.warns(fp.exceptions.LeftOutWarning):
        # The stand's place in the second keyframe is that of the first.
        hand = fp.from_mujoco(mujoco.MjModel.from_xml_string(LED.replace('"away" mpos="0 0 0', '"away" mpos="1 0 0')))
    for line in (
        "body table: mocap, stands still, as it has a plane",
        "body stand: mocap, stands still, as it carries joints",
        "keyframe away: place of mocap body table, which is where the first keyframe has it",
    ):
        assert line in hand.tree.left_out
    assert not any("stand" in line and "keyframe" in line for line in hand.tree.left_out)
    table = read(model).model_dump(mode="python", exclude_none=True)
    table["tree"]["joints"]["flex"]["path"] = {}
    for armature, allowed in (
        (2e-5, "armature = 2e-05: has no effect"),
        (0.0, r"path: .* move no mass, .* has 0\.02 kg"),
    ):
        table["tree"]["joints"]["flex"]["armature"] = armature
        with pytest.raises(fp.InputError, match=rf"finger\.tree\.joints\.flex\.{allowed}"):
            read_scenario({"name": "x", "finger": table, "controller": {"kind": "tensions"}})


@pytest.mark.slow
def test_statics_leave_leaders_where_they_are():
    hand = read(mujoco.MjModel.from_xml_string(LED))
    alone = hand.tree.updated(objects={}, keyframes={})
    finger = fp.Finger(hand.updated(tree=alone))
    led = [name in hand.tree.on_paths for name in finger.routing.joints]
    assert sum(led) == 12
    position = np.array([hand.tree.keyframes["away"].position[name] for name in finger.routing.joints])
    rest = fp.analysis.equilibrium(finger, [0.5], position=position)
    np.testing.assert_allclose(rest.position[led], position[led], atol=1e-12)
    body = {name: rest.position[finger.routing.joints.index(name)] for name in ("palm_x", "palm_y", "palm_z")}
    # The weld of 5 cm below the leader, as that is turned, gives way by m g / k alone.
    held = np.array([0.1, 0.2, 0.1]) + Rotation.from_quat([0.6, 0.0, 0.0, 0.8]).apply([0.0, 0.0, -0.05])
    np.testing.assert_allclose([*body.values()], held, atol=1e-3)
