"""Trees in space, for the viewer: tendons lie where their lengths say, solids where MuJoCo has them."""

import mujoco
import numpy as np
import pytest
from mujoco_models import ROUTED, asset, posture

import finger_pin as fp
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.views.viewer.scene import Scene
from finger_pin.views.viewer.video import draw_picture

MOTORS = "".join(f'<motor name="{name}_motor" tendon="{name}" gear="-1" ctrlrange="0 5"/>' for name in ("top", "below"))


@pytest.fixture(scope="module")
def pulled():
    """A model whose tendons are pulled, and its description."""
    model = mujoco.MjModel.from_xml_string(ROUTED.replace("</actuator>", f"{MOTORS}</actuator>"))
    return model, fp.from_mujoco(model)


@pytest.mark.slow
def test_paths_are_as_long_as_their_tendons_and_end_at_their_sites(pulled):
    model, description = pulled
    geometry, hand, data = TendonGeometry(description), fp.Hand(description), mujoco.MjData(model)
    random, wrapped = np.random.default_rng(0), 0
    positions = random.uniform([-1.4, -1.4, -0.01], [1.4, 1.4, 0.01], (120, 3))
    drawn = {path.name: path.points for path in geometry.paths(positions)}
    for name, column, ends in (("top_motor", 0, ("w0", "b1")), ("below_motor", 2, ("w1", "b2"))):
        lengths = np.linalg.norm(np.diff(drawn[name], axis=1), axis=2).sum(axis=1)
        expected = hand.paths.length(positions)[:, column]
        # Chords of arcs of up to half a turn in 11 parts.
        np.testing.assert_allclose(lengths, expected, rtol=4e-3)
        assert np.all(lengths < expected + 1e-12)
        wrapped += np.count_nonzero(lengths < expected - 1e-6)
        for position, points in zip(positions, drawn[name], strict=True):
            data.qpos = position
            mujoco.mj_kinematics(model, data)
            sites = [data.site(site).xpos for site in ends]
            np.testing.assert_allclose(points[[0, -1]], sites, atol=1e-12)
    assert wrapped > 20


def test_cords_that_no_motor_pulls_are_drawn_branch_by_branch_with_ends_at_their_points():
    finger = fp.load_scenario("underactuated").finger
    scene, hand = Scene(finger), fp.Hand(finger)
    position = np.array([0.004, 0.1, -0.3, 0.2, 0.5])
    drawn = {path.name: path.points for path in scene.geometry.paths(position)}
    assert list(drawn) == ["cord", "cord.1"]
    lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in drawn.values()]
    # Two strands for every metre of the block lengthen the cord beside its path.
    tendon = list(hand.paths.cords).index("cord")
    assert sum(lengths) == pytest.approx(float(hand.paths.length(position)[tendon]) - 2.0 * position[0], abs=1e-9)
    # Their colour is no tension's: the strand behind all others.
    assert [set(tendon["strand"]) for tendon in scene.tendons] == [{len(scene.strands)}] * 2
    np.testing.assert_array_equal(scene.looseness(np.zeros((3, 1))), np.zeros((3, 2)))
    assert scene.header("", position[None], 1.0)["cords"]
    assert not Scene("ub_stand_in").header("", np.zeros((1, 4)), 1.0)["cords"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_solids_are_those_that_mujoco_shows_and_stand_where_it_has_them():
    """Of the Shadow hand meshes, but of two links that have boxes; its capsules are hidden."""
    model = mujoco.MjModel.from_xml_path(str(asset("hand/reach.xml")))
    description, data = fp.from_mujoco(model), mujoco.MjData(model)
    geometry = TendonGeometry(description)
    data.qpos = posture(model, np.random.default_rng(1))
    mujoco.mj_kinematics(model, data)
    poses = geometry.poses(data.qpos)
    drawn = {visual.name: visual for visual in geometry.visuals}
    meshes = boxes = 0
    for i in np.flatnonzero((model.geom_group < 3) & (model.body_weldid[model.geom_bodyid] > 0)):
        name = (model.geom(i).name or f"geom_{i}").replace(":", "_")
        visual = drawn.pop(name)
        rotation, place = poses.rotation[visual.link], poses.translation[visual.link]
        np.testing.assert_allclose(rotation @ visual.placement.translation + place, data.geom_xpos[i], atol=1e-9)
        if model.geom_type[i] != mujoco.mjtGeom.mjGEOM_MESH:
            boxes += 1
            continue
        mesh = model.mesh(model.geom_dataid[i])
        points = slice(mesh.vertadr[0], mesh.vertadr[0] + mesh.vertnum[0])
        expected = model.mesh_vert[points] @ data.geom_xmat[i].reshape(3, 3).T + data.geom_xpos[i]
        found = visual.geometry.corners @ (rotation @ visual.placement.rotation).T
        found += rotation @ visual.placement.translation + place
        np.testing.assert_allclose(found, expected, atol=1e-7)
        faces = slice(mesh.faceadr[0], mesh.faceadr[0] + mesh.facenum[0])
        assert visual.geometry.faces[5].tolist() == model.mesh_face[faces][5].tolist()
        meshes += 1
    assert (meshes, boxes, drawn) == (22, 2, {})
    assert len(description.tree.meshes) == 10


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:hand. not carried over")
def test_an_object_that_falls_out_of_a_hand_leaves_the_view():
    description = fp.from_mujoco(str(asset("adroit_hand/adroit_pen.xml")))
    scene, still = Scene(description), np.zeros((2, len(description.joints)))
    falling = still.copy()
    falling[1, list(description.joints).index("OBJTz")] = -20.0
    seen = [np.array(scene.header("", each, 1.0)["inView"]) for each in (still, falling)]
    assert np.ptp(seen[1], axis=0) == pytest.approx(np.ptp(seen[0], axis=0), abs=0.02)


@pytest.mark.parametrize(("axis", "gravity", "up"), [((0, 1, 0), (0, 0, -9.81), 2), ((0, 0, -1), (0, -9.81, 0), 1)])
def test_a_hinge_is_looked_at_along_its_axis_with_what_weighs_below_on_a_grid_of_its_size(axis, gravity, up):
    """The frames of all joints of a model are alike: it is the axis that counts."""
    numbers = [" ".join(map(str, each)) for each in (axis, gravity)]
    text = """<mujoco><option gravity="{1}"/><worldbody><site name="a" pos="-0.03 0 0"/><body>
        <joint axis="{0}"/><geom type="capsule" size="0.008" fromto="0 0 0 0.06 0 0"/><site name="b" pos="0.03 0 0"/>
        </body></worldbody><tendon><spatial><site site="a"/><site site="b"/></spatial></tendon></mujoco>"""
    scene = Scene(fp.from_mujoco(mujoco.MjModel.from_xml_string(text.format(*numbers))))
    np.testing.assert_allclose(scene.view() @ axis, [0.0, -1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(scene.view()[2], np.eye(3)[up], atol=1e-12)
    assert scene.header("", np.zeros((1, 1)), 1.0)["grid"] == 0.01


# Axes of the chain a, b, c differ, and d is on a chain of its own; e slides.
SUMS = """<mujoco><worldbody>
    <body><joint name="a" axis="0 1 0"/><geom size="0.01"/>
      <body pos="0.05 0 0"><joint name="b" axis="0 0 1" range="-60 60" limited="true"/><geom size="0.01"/>
        <body pos="0.04 0 0"><joint name="c" axis="0 1 0.3"/><geom size="0.01" pos="0.03 0 0"/></body></body></body>
    <body pos="0 0.1 0"><joint name="d" axis="1 0 0"/><geom size="0.01" pos="0 0 0.04"/>
      <body pos="0 0 0.05"><joint name="e" type="slide"/><geom size="0.01"/></body></body>
  </worldbody><tendon>
    <fixed name="skipping" stiffness="1"><joint joint="a" coef="0.01"/><joint joint="c" coef="-0.006"/></fixed>
    <fixed name="both" stiffness="1"><joint joint="b" coef="0.008"/><joint joint="d" coef="0.012"/></fixed>
    <fixed name="pulled"><joint joint="b" coef="-0.009"/><joint joint="c" coef="-0.007"/></fixed>
    <fixed name="sliding" stiffness="1"><joint joint="d" coef="0.01"/><joint joint="e" coef="0.5"/></fixed>
    <fixed name="geared" stiffness="1"><joint joint="a" coef="2"/></fixed>
  </tendon><actuator><motor name="motor" tendon="pulled" gear="-1" ctrlrange="0 5"/></actuator></mujoco>"""


def test_sums_of_hinges_wind_around_them_and_are_drawn_longer_by_their_excursion():
    """Straight pieces rest in links and arcs of radius r turn by q, so that lengths are exact but for chords.

    A chord over an angle a is shorter than its arc by a^2 / 24 of it, and arcs turn by four pi at most.
    """
    description, resolution = fp.from_mujoco(mujoco.MjModel.from_xml_string(SUMS)), 60
    geometry = TendonGeometry(description, resolution=resolution)
    positions = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 5))
    positions[0] = 0.0
    drawn = {path.name: path.points for path in geometry.paths(positions)}
    assert set(drawn) == {"motor", "skipping", "both", "both.1"}
    lengths = {name: np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1) for name, points in drawn.items()}
    lengths["both"] += lengths.pop("both.1")
    arms = {"skipping": [0.01, 0, -0.006, 0, 0], "both": [0, 0.008, 0, 0.012, 0], "motor": [0, -0.009, -0.007, 0, 0]}
    poses = geometry.poses(positions)
    for name, arm in arms.items():
        error = np.abs(arm).sum() * 4.0 * np.pi / (24.0 * resolution**2)
        np.testing.assert_allclose(lengths[name] - lengths[name][0], positions @ arm, atol=error)
        assert error < 1e-3 * np.ptp(positions @ arm)
    for tendon, arc in geometry.arcs:
        rotation, place = poses.rotation[:, arc.joint, None], poses.translation[:, arc.joint, None]
        local = np.einsum("mpji,mpj->mpi", rotation, drawn[tendon] - place) @ arc.frame
        distance = np.linalg.norm(local[..., :2], axis=-1)
        on_pulley = np.isclose(distance, abs(arc.radius), atol=1e-12) & (np.abs(local[..., 2]) < 0.01)
        assert np.all(np.count_nonzero(on_pulley, axis=1) > 3)
    assert len(geometry.arcs) == 6


@pytest.mark.slow
def test_a_tree_whose_bodies_may_touch_is_filmed_without_objects():
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(SUMS))
    simulator = fp.Simulator(fp.Finger(description))
    simulator.step([1.0], 1e-4)
    result = simulator.result()
    assert "contact_force" in result and "object_position" not in result
    assert np.ptp(draw_picture(result, np.zeros((0, 3)))) > 0
