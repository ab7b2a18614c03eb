"""Geoms of MuJoCo models as shapes: which pairs touch, where, and an imported hand that grasps."""

import itertools

import mujoco
import numpy as np
import pytest
from mujoco_models import MODELS

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.description.objects import Object
from finger_pin.mechanism.path_elements import path_kinematics

#: Everything overlaps everything: bits, an exclusion, a welded body, a pair that the bits forbid, a mocap body.
CROWD = """<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="a"><joint name="ja" axis="0 1 0"/><geom name="a1" size="0.1" contype="1" conaffinity="2"/>
    <geom name="a2" type="box" size="0.1 0.1 0.1" contype="2" conaffinity="1"/>
    <body name="b"><joint name="jb" axis="0 1 0"/><geom name="b1" type="capsule" size="0.1 0.1"/>
      <body name="c"><joint name="jc" axis="0 1 0"/>
        <geom name="c1" type="cylinder" size="0.1 0.1" contype="2" friction="0.4"/>
        <body name="d"><geom name="d1" size="0.1" contype="3" conaffinity="3"/>
          <geom name="d2" type="ellipsoid" size="0.1 0.1 0.1"/></body>
        <site name="s" pos="0.1 0 0"/></body></body></body>
  <body name="e"><joint name="je" axis="0 1 0"/><geom name="e1" size="0.1" contype="0" conaffinity="0"/></body>
  <body name="m" mocap="true"><geom name="m1" size="0.1"/><body name="n"><geom name="n1" size="0.1"/>
    <body name="o"><joint name="jo" axis="0 1 0"/><geom name="o1" size="0.1"/></body></body></body>
  <body name="f"><joint name="jf" axis="0 1 0"/><geom name="f1" size="0.1" contype="4" conaffinity="7"/></body>
</worldbody>
<contact><exclude body1="f" body2="b"/><pair geom1="e1" geom2="c1"/></contact>
<tendon><fixed name="t"><joint joint="ja" coef="1"/></fixed></tendon></mujoco>"""


@pytest.mark.filterwarnings("ignore:hand. not carried over")
@pytest.mark.parametrize(
    "flags", ["", 'filterparent="disable" override="enable"', 'contact="disable"', 'constraint="disable"']
)
def test_the_pairs_that_touch_are_those_that_mujoco_lets_collide(flags):
    text = CROWD.replace("<mujoco>", f'<mujoco><option o_friction="0.3 0.3 1 1 1"><flag {flags}/></option>')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    met = {frozenset(model.geom(int(g)).name for g in pair) for pair in data.contact.geom}
    tree = fp.from_mujoco(model).tree
    lines = [line.split(":")[0].removeprefix("geoms ") for line in tree.left_out if line.startswith("geoms ")]
    overlapping = {frozenset(line.split(", ")) for line in lines}
    assert not tree.touching and overlapping == {pair for pair in met if "floor" not in pair}
    shapes = {name: shape.surface for body in tree.bodies.values() for name, shape in body.shapes.items()}
    if "con" in flags:
        assert not shapes and "contacts are disabled in the model: its geoms touch nothing" in tree.left_out
        return
    assert 5 < len(overlapping) < 45
    assert [line for line in tree.left_out if line.startswith("geom floor: it overlaps a1, a2")]
    # The greater of 0.4 and MuJoCo's 1 with all that it meets.
    assert shapes["c1"].friction == (0.3 if flags else 1.0)
    assert not flags or set(data.contact.friction[:, 0]) == {0.3} == {each.friction for each in shapes.values()}


def scene(description, gravity, duration, closing):
    """Return a scenario in which the Shadow hand, palm up, bends its fingers and thumb about a bar on its palm."""
    table = demo_motion(description, duration)
    table["finger"]["gravity"] = gravity
    bent = {"FFJ2": 1.3, "MFJ2": 1.3, "RFJ2": 1.3, "LFJ2": 1.3, "FFJ1": 1.3, "MFJ1": 1.3, "RFJ1": 1.3, "LFJ1": 1.3}
    bent |= {"THJ4": 0.9, "THJ3": 1.0, "THJ0": -0.6}
    inputs = {}
    for name in description.tree.actuators:
        value = bent.get(name.rpartition("_")[2], 0.0)
        ramp = {"kind": "points", "times": [0.02, 0.25], "values": [0.0, value]}
        inputs[name] = ramp if closing else {"offset": value}
    table["controller"]["inputs"] = inputs
    bar = {"shape": "cylinder", "radius": 0.018, "length": 0.1, "mass": 0.05, "orientation": [0.0, 1.0, 0.0, 1.0]}
    table["environment"] = {"objects": {"bar": bar | {"position": [0.985, 0.838, 0.1695]}}}
    return read_scenario(table, {"simulation.rtol": 1e-4})


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_the_shadow_hand_closes_on_a_bar_and_holds_it_when_it_is_turned_over():
    description = fp.from_mujoco(MODELS["shadow"]())
    grasp = fp.simulate(scene(description, [0.0, 0.0, -9.81], 0.5, True))
    pushing = grasp.contact_normal_force.isel(time=-1)
    links = {str(name).split("-")[0] for name in pushing.contact[pushing > 0.1].values}
    assert "robot0_C_thdistal" in links and len({link for link in links if "distal" in link}) >= 3
    held = fp.simulate(scene(description, [0.0, 0.0, 9.81], 0.3, False), initial=grasp)
    rise = held.object_position.values[:, 0, 2] - held.object_position.values[0, 0, 2]
    # Let go of, it would rise by 44 cm.
    assert rise.max() < 0.02
    assert abs(held.object_velocity.values[-1]).max() < 0.05


@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_the_shapes_of_a_tree_are_where_mujoco_has_them():
    """A small fixed sphere where each axis of a geom leaves it is as deep in that geom's shape as its radius."""
    model = MODELS["shadow"]()
    data, description = mujoco.MjData(model), fp.from_mujoco(model, meshes="none")
    data.qpos[:] = np.random.default_rng(0).uniform(0.0, 0.3, model.nq)
    mujoco.mj_forward(model, data)
    shapes = {name: shape for body in description.tree.bodies.values() for name, shape in body.shapes.items()}
    geoms = {name.replace(":", "_"): data.geom(name) for name in (model.geom(i).name for i in range(model.ngeom))}
    probes = {}
    for name, shape in shapes.items():
        radius, length = (*shape.sizes, 0.0)[:2]
        end = 0.5 * length + (0.0 if shape.shape == "cylinder" else radius)
        out = 0.5 * np.array(shape.sizes) if shape.shape == "box" else np.array([radius, radius, end])
        for axis in range(3):
            place = geoms[name].xpos + geoms[name].xmat.reshape(3, 3)[:, axis] * out[axis]
            probes[f"at_{name}_{axis}"] = Object(shape="sphere", radius=1e-4, position=tuple(place))
    hand = fp.Hand(description, objects=probes)
    around = hand.scene
    gaps = path_kinematics(around.body, data.qpos, around.contacts.paths, hand.mechanism.coordinates).length
    found = dict(zip(around.contacts.names, gaps[:: around.contacts.law.arms], strict=True))
    for name, axis in itertools.product(shapes, range(3)):
        probe = f"at_{name}_{axis}"
        own = [gap for pair, gap in found.items() if pair.split(".")[0] in (f"{name}-{probe}", f"{probe}-{name}")]
        assert abs(min(own) + 1e-4) < 1e-6 + 2e-7


def test_an_ellipsoid_is_the_same_to_mujoco_when_it_is_written_again():
    """Of a body that a joint moves, and of a free one, whose moments are m (b^2 + c^2) / 5 and so on."""
    text = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/>
      <geom name="tip" type="ellipsoid" size="0.02 0.009 0.012" pos="0.03 0 0" mass="0.1"/></body>
      <body pos="0.2 0 0"><freejoint/><geom name="egg" type="ellipsoid" size="0.03 0.02 0.01" mass="0.3"/></body>
      </worldbody><actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    written = mujoco.MjModel.from_xml_string(fp.to_mjcf(fp.from_mujoco(model)))
    assert np.all(written.geom_type == mujoco.mjtGeom.mjGEOM_ELLIPSOID)
    assert written.geom_size == pytest.approx(model.geom_size, rel=1e-12)
    assert np.sort(written.body_inertia) == pytest.approx(np.sort(model.body_inertia), rel=1e-9)
    assert np.sort(written.body_inertia[-1]) == pytest.approx(0.3 * np.array([5e-4, 1e-3, 1.3e-3]) / 5.0, rel=1e-9)
