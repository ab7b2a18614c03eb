"""Meshes of MuJoCo models that touch by primitives: places, choices, files, and grasps beside MuJoCo's."""

import re

import mujoco
import numpy as np
import pytest
from mesh_points import box, mesh, ring, tapered
from scipy.spatial.transform import Rotation

import finger_pin as fp
from finger_pin.commands.application import run
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.description.surface import Surface
from finger_pin.exceptions import InputError

STIFF = 'solref="-200000 -400" solimp="0.98 0.99 0.001"'
FRUSTUM = [
    (0.5 * x * k, 0.5 * y * m, z)
    for x, y, z in ((0.01, 0.016, -0.006), (0.008, 0.012, 0.006))
    for k in (-1, 1)
    for m in (-1, 1)
]
#: A link that is a mesh or a primitive, beside a ball that it overlaps at the start, and one that it does not.
TWIN = """<mujoco><asset>{asset}</asset><worldbody><body name="a" pos="0 0 0.1" euler="10 0 30">
  <joint name="j" axis="0 1 0"/><geom name="link" {geom} mass="0.2"/></body>
  <body name="b" pos="0 0 0.1"><joint name="k" axis="0 1 0"/><geom name="near" size="0.012" pos="0.03 0.02 0"/></body>
  <body name="c" pos="0 0 0.1"><joint name="l" axis="0 1 0"/><geom name="far" size="0.01" pos="-0.03 0 0"/></body>
</worldbody><actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""
#: Pads with half sides of 5 mm at one end close on a peg of 10 mm from 30 mm off its middle.
PADS = f"""<mujoco><option timestep="0.0005" gravity="0 0 0"/>
<asset>{mesh("pad", FRUSTUM)}</asset><default><geom mass="0.008" {STIFF}/></default><worldbody>
 <body name="left" pos="-0.03 0 0"><joint name="left" type="slide" axis="1 0 0" range="0 0.05" damping="2"/>
  <geom name="left_pad" type="mesh" mesh="pad"/></body>
 <body name="right" pos="0.03 0 0"><joint name="right" type="slide" axis="-1 0 0" range="0 0.05" damping="2"/>
  <geom name="right_pad" type="mesh" mesh="pad"/></body>
 <body name="peg"><geom name="peg" type="cylinder" size="0.010 0.02"/></body></worldbody>
<actuator><motor name="close_left" joint="left" ctrlrange="0 5"/>
 <motor name="close_right" joint="right" ctrlrange="0 5"/></actuator></mujoco>"""
FINGER = """<body name="{name}" pos="0 0 {z}"><joint name="{name}" axis="0 {y} 0" damping="0.01"/>
 <geom name="{name}_link" type="mesh" mesh="link" euler="0 90 0" mass="0.02"/></body>"""
LINK = mesh("link", tapered(0.008, 0.006, 0.05))
#: Two fingers along x, hulls of balls of 8 and 6 mm that are 50 mm apart, close on a ball between their tips.
HAND = f"""<mujoco><option timestep="0.0005" gravity="0 0 0"/><asset>{LINK}</asset>
<default><geom {STIFF}/></default><worldbody><geom name="ball" size="0.015" pos="0.045 0 0"/>
{FINGER.format(name="left", z=-0.04, y=-1)}{FINGER.format(name="right", z=0.04, y=1)}</worldbody>
<actuator><motor name="left" joint="left" ctrlrange="0 1"/>
 <motor name="right" joint="right" ctrlrange="0 1"/></actuator>
</mujoco>"""


def distances(hand):
    """Return the largest distance of every fitted mesh from its hull, m, by geom."""
    lines = [
        re.match(r"geom (\w+): its mesh touches as an? (\w+), at most ([\d.]+) mm", each) for each in hand.tree.left_out
    ]
    return {each[1]: 1e-3 * float(each[3]) for each in lines if each}


def at_rest(hand, pushes, seconds):
    """Return the joints of a hand after its motors have pushed for some time."""
    table = demo_motion(hand, seconds)
    table["controller"]["inputs"] = {name: {"offset": value} for name, value in pushes.items()}
    result = fp.simulate(read_scenario(table, {"finger.joint_friction.coulomb": 0.0}))
    return result.joint_position[-1].to_series()


def at_rest_in_mujoco(text, pushes, seconds):
    """Return the same of MuJoCo, which collides the hulls of meshes."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name, value in pushes.items():
        data.actuator(name).ctrl = value
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return {model.joint(i).name: data.qpos[i] for i in range(model.njnt)}


def twins():
    """Return a model with a mesh in a frame of its own, and one with the primitive that it is."""
    turn, shift = Rotation.from_euler("xyz", [20, 30, 40], degrees=True), np.array([0.03, 0.01, 0.005])
    corners = turn.apply(box(0.02, 0.03, 0.05)) + shift
    quat = " ".join(f"{each:.15g}" for each in turn.as_quat()[[3, 0, 1, 2]])
    plain = f'type="box" size="0.01 0.015 0.025" pos="0.03 0.01 0.005" quat="{quat}"'
    texts = TWIN.format(asset=mesh("m", corners), geom='type="mesh" mesh="m"'), TWIN.format(asset="", geom=plain)
    return [mujoco.MjModel.from_xml_string(each) for each in texts]


@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_a_mesh_that_is_a_box_touches_what_the_box_in_its_place_touches():
    """Shapes, pairs and overlaps at the start; corners of meshes are 32-bit floats."""
    meshed, plain = (fp.from_mujoco(each).tree for each in twins())
    assert meshed.touching == plain.touching == (("link", "far"), ("near", "far"))
    assert meshed.left_out[1:] == plain.left_out
    assert plain.left_out[-1] == "geoms link, near: they overlap where runs start, and never touch"
    ours, theirs = (each.bodies["a"].shapes["link"] for each in (meshed, plain))
    np.testing.assert_allclose(ours.position, theirs.position, atol=1e-7)
    # The axes may come in another order.
    turned = (Rotation.from_quat(ours.orientation).inv() * Rotation.from_quat(theirs.orientation)).as_matrix()
    np.testing.assert_allclose(np.abs(turned) @ theirs.sides, ours.sides, atol=1e-6)
    np.testing.assert_allclose(ours.surface.stiffness, theirs.surface.stiffness, rtol=1e-4)
    assert ours.surface.friction == theirs.surface.friction


def test_pads_of_meshes_close_on_a_peg_within_the_distance_that_is_listed():
    """By geometry after 30 - 10 - 5 mm; rows of the description say so, and MuJoCo, to which a pad is its hull."""
    hand = fp.from_mujoco(mujoco.MjSpec.from_string(PADS))
    far = distances(hand)
    assert set(far) == {"left_pad", "right_pad"} and max(far.values()) < 0.0015
    pushes = {"close_left": 2.0, "close_right": 2.0}
    found, theirs = at_rest(hand, pushes, 0.3), at_rest_in_mujoco(PADS, pushes, 0.3)
    for side in ("left", "right"):
        assert abs(theirs[side] - 0.015) < 1e-4
        assert abs(found[side] - 0.015) < far[f"{side}_pad"]


def test_fingers_of_meshes_close_on_a_ball_as_in_mujoco_within_the_distance_that_is_listed():
    """A finger's place at the ball, 45 mm from its joint, differs by the distance of the capsule from the hull."""
    hand = fp.from_mujoco(mujoco.MjSpec.from_string(HAND))
    assert {shape.shape for body in ("left", "right") for shape in hand.tree.bodies[body].shapes.values()} == {
        "capsule"
    }
    pushes = {"left": 0.1, "right": 0.1}
    found, theirs = at_rest(hand, pushes, 1.0), at_rest_in_mujoco(HAND, pushes, 1.0)
    for side in ("left", "right"):
        assert 0.3 < theirs[side] < 0.5
        assert abs(found[side] - theirs[side]) * 0.045 < distances(hand)[f"{side}_link"] < 0.0015


def test_without_primitives_meshes_are_left_out_and_fingers_close_through_the_ball():
    with pytest.warns(match="geom left_link: a mesh touches nothing here"):
        hand = fp.from_mujoco(mujoco.MjSpec.from_string(HAND), meshes="none")
    assert not any(hand.tree.bodies[body].shapes for body in ("left", "right"))
    assert at_rest(hand, {"left": 0.1, "right": 0.1}, 0.3)["left"] > 1.0


@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_meshes_are_chosen_by_geom_before_mesh_before_body():
    def kinds(choice):
        tree = fp.from_mujoco(mujoco.MjSpec.from_string(HAND), meshes=choice).tree
        return [tree.bodies[side].shapes.get(f"{side}_link") for side in ("left", "right")]

    def names(choice):
        return [shape and shape.shape for shape in kinds(choice)]

    assert names({}) == names("fit") == names("capsule") == ["capsule", "capsule"]
    assert names("ellipsoid") == names({"link": "ellipsoid"}) == ["ellipsoid", "ellipsoid"]
    assert names({"left": "box"}) == ["box", "capsule"]
    assert names({"left": "box", "link": "cylinder", "right_link": "none"}) == ["cylinder", None]
    # By hand it is the same as the best where that is of the kind.
    assert kinds("capsule") == kinds("fit")


@pytest.mark.parametrize(
    ("choice", "line"),
    [
        ({"middle": "box"}, "meshes.middle: no geom, mesh or body of this name has a mesh that collides; "),
        ({"ball": "box"}, "meshes.ball: no geom, mesh or body of this name has a mesh that collides; "),
        ({"left": "cone"}, 'meshes.left = "cone": must be fit, none, sphere, box, capsule, cylinder or ellipsoid'),
        ("hull", 'meshes = "hull": must be fit, none, sphere, box, capsule, cylinder or ellipsoid'),
        (3, "meshes = 3: must be a text, or texts by the names of geoms, meshes or bodies"),
    ],
)
def test_choices_that_there_are_not_are_refused(choice, line):
    with pytest.raises(InputError, match=re.escape(line)):
        fp.from_mujoco(mujoco.MjSpec.from_string(HAND), meshes=choice)


def test_primitives_are_drawn_over_their_meshes_and_written_to_files_that_read_the_same():
    tree = fp.from_mujoco(mujoco.MjSpec.from_string(HAND)).tree
    assert {key: solid.kind for key, solid in tree.bodies["left"].solids.items()} == {
        "left_link_mesh": "mesh",
        "left_link": "capsule",
    }
    text = fp.to_mjcf(fp.from_mujoco(mujoco.MjSpec.from_string(HAND)))
    model = mujoco.MjModel.from_xml_string(text)
    assert model.geom("left_link").type == mujoco.mjtGeom.mjGEOM_CAPSULE and model.geom("left_link").conaffinity
    assert model.geom("left_link_mesh").type == mujoco.mjtGeom.mjGEOM_MESH
    assert not model.geom("left_link_mesh").contype and not model.geom("left_link_mesh").conaffinity
    again = fp.from_mujoco(model).tree
    assert again.touching == tree.touching and not [each for each in again.left_out if "mesh" in each]
    for name in ("left", "right"):
        ours, theirs = (each.bodies[name].shapes[f"{name}_link"] for each in (tree, again))
        np.testing.assert_allclose([*ours.sizes, *ours.position], [*theirs.sizes, *theirs.position], rtol=1e-12)


@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_a_model_without_meshes_that_collide_is_read_as_before():
    plain = twins()[1]
    assert fp.from_mujoco(plain) == fp.from_mujoco(plain, meshes="none")


def test_a_free_body_that_is_a_mesh_is_an_object():
    """A disc about x, whose axis is that of the largest moment of inertia, while MuJoCo's third is the smallest."""
    coin = """<body name="coin" pos="0.2 0 0.1" euler="0 0 90"><freejoint/>
      <geom name="g" type="mesh" mesh="coin" mass="0.1"/></body></worldbody>"""
    corners = np.concatenate([0.02 * ring()[:, [2, 0, 1]] + [x, 0.0, 0.0] for x in (-0.004, 0.004)])
    text = HAND.replace("</asset>", mesh("coin", corners) + "</asset>").replace("</worldbody>", coin)
    found = fp.from_mujoco(mujoco.MjSpec.from_string(text)).tree.objects["coin"]
    assert found.shape == "cylinder" and found.mass == 0.1
    np.testing.assert_allclose(found.sizes, [0.02, 0.008], rtol=0.005)
    np.testing.assert_allclose(found.position, [0.2, 0.0, 0.1], atol=1e-8)
    axis = Rotation.from_quat(found.orientation).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.abs(axis), [0.0, 1.0, 0.0], atol=1e-6)


def test_the_command_line_chooses_by_name(tmp_path, capsys):
    path = tmp_path / "hand.xml"
    path.write_text(HAND)
    options = ["--mujoco", str(path), "--duration", "0.01", "--no-figures", "--output", str(tmp_path / "out")]
    assert run("simulate", [*options, "--meshes", "left=box, right_link=none"]) == 0
    said = capsys.readouterr().out
    assert "geom left_link: its mesh touches as a box, " in said
    assert "geom right_link: a mesh touches nothing here" in said
    assert run("simulate", [*options, "--meshes", "left=box,left=none"]) == 2
    assert "--meshes: left=box,left=none: names one twice" in capsys.readouterr().err
    assert run("simulate", [*options, "--meshes", "left"]) == 2
    assert 'meshes = "left": must be fit, none, sphere' in capsys.readouterr().err


@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_a_body_that_turns_about_its_mass_centre_touches_with_a_stiffness_that_is_no_rounding():
    """Its mobility is zero but for rounding, and so is that of the base."""
    text = """<mujoco><worldbody><geom name="base" type="box" size="0.1 0.1 0.1" pos="0.3 0 0"/>
      <body pos="0.13 0.27 0.31" euler="1 2 3"><joint name="j" pos="0.03 0.01 0.02" axis="0.6 0.8 0.1"/>
      <geom name="wheel" size="0.05" pos="0.03 0.01 0.02" mass="0.1"/></body></worldbody>
      <actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    assert 0.0 < model.body_invweight0[1, 0] < 1e-20
    (shape,) = fp.from_mujoco(model).tree.bodies["body_1"].shapes.values()
    assert shape.surface.stiffness == Surface().stiffness
