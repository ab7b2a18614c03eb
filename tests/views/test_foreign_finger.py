"""Fingers on a model of the user's own: figures and page take one, and several at once, with the model's meshes."""

import example_robot_data
import numpy as np
import pinocchio as pin
import pytest
from paper.plot_workspace import plot_workspace
from unpacked_page import unpacked

import finger_pin as fp
from finger_pin.analysis import force_polytope, self_locking_map
from finger_pin.description.finger_description import HandSettings
from finger_pin.description.validation import validate
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.views import plots, view_forces
from finger_pin.views.viewer import write_animation

# The hand's URDF says 10 N m of dry friction.
pytestmark = pytest.mark.filterwarnings("ignore::finger_pin.exceptions.LeftOutWarning")

POSITION = (0.1, 0.5, 0.6, 0.4)
NAMES = ("spread", "proximal", "medial", "distal")
FIRST = {"index": 0, "thumb": 12, "middle": 4, "ring": 8}
TENDONS = {
    "T1": {"spread": 10.0, "proximal": 10.0},
    "T2": {"spread": -10.0, "proximal": 10.0},
    "T3": {"medial": 9.0},
    "T4": {"proximal": -8.0, "medial": -7.0, "distal": -6.0},
    "T5": {"medial": -5.0, "distal": 7.0},
}
AXIS = (0.0, 0.0, 1.0)


def joints_of(finger):
    return {name: f"joint_{FIRST[finger] + index}.0" for index, name in enumerate(NAMES)}


@pytest.fixture(scope="module")
def robot():
    return example_robot_data.load("allegro_right_hand")


@pytest.fixture(scope="module")
def description(network):
    return network(list(NAMES), TENDONS, passive=["T5"])


@pytest.fixture(scope="module")
def foreign(robot, description):
    """The index finger of the Allegro hand, pulled by five tendons."""
    return fp.Finger.from_model(description, robot.model, joints_of("index"), "link_3.0_tip", base_axis=AXIS)


@pytest.fixture(scope="module")
def hand(description):
    fingers = {finger: {"finger": description.model_dump()} for finger in FIRST}
    return HandSettings.model_validate({"name": "allegro", "fingers": fingers}).joined()


@pytest.fixture(scope="module")
def whole(robot, hand):
    """All four fingers of the hand."""
    joints = {finger: joints_of(finger) for finger in FIRST}
    tips = {finger: f"link_{at + 3}.0_tip" for finger, at in FIRST.items()}
    return fp.Finger.from_model(hand, robot.model, joints, tips, base_axis=AXIS, visuals=robot.visual_model)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_sections")
def test_every_figure_of_a_finger_takes_it(foreign):
    figures = [
        plot_workspace(foreign),
        plots.plot_force_polytope(foreign, POSITION, 20.0),
        plots.plot_radius_sensitivity(foreign, POSITION, (0.0, 0.0, 0.5)),
        plots.plot_critical_friction(foreign),
        plots.plot_self_locking_map(self_locking_map(foreign, samples=3)),
    ]
    for figure in figures:
        figure.canvas.draw()
    # The workspace, in cm, is that of the fingertip of the model.
    tip = 1e2 * foreign.rigid_body.tip_position(np.zeros(4))
    low, high = np.array([getattr(figures[0].axes[0], f"get_{axis}lim")() for axis in "xyz"]).T
    assert np.all((low < tip) & (tip < high))


def test_the_viewer_shows_the_tendons_of_one_without_meshes(foreign):
    polytope = force_polytope(foreign, POSITION, 20.0)
    with view_forces(foreign, polytope, open_browser=False, block=False) as shown:
        assert shown.url.startswith("http://127.0.0.1")
    with pytest.raises(fp.InputError, match=r"joints\.spread\.link.*viewer") as caught:
        view_forces(foreign.description, polytope, open_browser=False, block=False)
    assert "\n" not in str(caught.value)


def test_a_model_cannot_be_exported_by_its_description_alone(foreign):
    with pytest.raises(fp.InputError, match=r"joints\.spread\.link"):
        fp.to_mjcf(foreign.description)


def test_several_fingers_on_one_model_are_each_as_alone(robot, description, whole):
    """Under forces at their own tips; the others are locked in place."""
    rng = np.random.default_rng(3)
    x = whole.rest_state(rng.uniform(0.0, 1.0, 16), rng.normal(size=16))
    command, force = rng.uniform(0.0, 8.0, 16), rng.normal(size=(4, 3))
    found = whole.evaluate(x, command, force)
    posture = pin.neutral(robot.model)
    assert whole.rigid_body.joints == tuple(joint for finger in FIRST for joint in joints_of(finger).values())
    for index, (finger, at) in enumerate(FIRST.items()):
        tip = f"link_{at + 3}.0_tip"
        alone = fp.Finger.from_model(description, robot.model, joints_of(finger), tip, posture, base_axis=AXIS)
        own = slice(4 * index, 4 * index + 4)
        state = found.state
        start = alone.rest_state(state.position[own], state.velocity[own])
        each = alone.evaluate(start, command[own], force[index])
        np.testing.assert_allclose(found["joint_acceleration"][own], each["joint_acceleration"], rtol=1e-9)
        np.testing.assert_allclose(found["joint_reaction"][own], each["joint_reaction"], rtol=1e-12)
        assert whole.routing.tendons[own] == tuple(f"{finger}.T{i}" for i in range(1, 5))


def test_tendons_on_a_model_change_their_length_by_radius_times_angle(whole):
    """Wound on its joints as on those of a finger made of links, (3)."""
    geometry = TendonGeometry(whole.description, resolution=60, body=whole.rigid_body)
    theta = np.full(16, 0.5)

    def lengths(position):
        paths = geometry.paths(position)
        return np.array([np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum() for path in paths])

    changed = lengths(theta + 0.1) - lengths(theta)
    actuated = whole.routing.actuated
    expected = -0.1 * whole.coupling.sum(axis=1)
    np.testing.assert_allclose(changed[:actuated], expected[:actuated], atol=2e-6)


def test_a_tendon_over_two_chains_of_a_model_is_drawn_on_each_and_changes_by_radius_times_angle():
    """(3): the pieces on both together; c is not carried by b, which comes before it."""
    model, inertia = pin.Model(), pin.Inertia(0.1, np.array([0.02, 0.0, 0.0]), 1e-5 * np.eye(3))
    for name, parent, place in (("a", 0, [0.0, 0.0, 0.0]), ("b", 1, [0.05, 0.0, 0.0]), ("c", 0, [0.0, 0.1, 0.0])):
        joint = model.addJoint(parent, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array(place)), name)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", 2, pin.SE3(np.eye(3), np.array([0.04, 0.0, 0.0])), pin.FrameType.OP_FRAME))
    crossings = {"a": {"radius": 0.01}, "b": {"radius": 0.008}, "c": {"radius": -0.006}}
    joints = {name: {"range": [-0.5, 0.9]} for name in crossings}
    finger = {"name": "forked", "joints": joints, "tendons": {"T": {"crossings": crossings}}}
    described = validate(fp.FingerDescription, finger, ("finger",))
    whole = fp.Finger.from_model(described, model, {name: name for name in crossings}, "tip")
    geometry = TendonGeometry(described, resolution=60, body=whole.rigid_body)
    paths = geometry.paths(np.array([[0.2, 0.3, 0.1], [0.3, 0.35, 0.03]]))
    assert [path.name for path in paths] == ["T", "T.1"]
    lengths = [np.linalg.norm(np.diff(path.points, axis=1), axis=2).sum(axis=1) for path in paths]
    expected = -(0.01 * 0.1 + 0.008 * 0.05), -0.006 * 0.07
    np.testing.assert_allclose(np.diff(lengths, axis=1)[:, 0], expected, atol=2e-6)


def test_links_and_tips_of_a_model_are_where_pinocchio_has_them(robot, whole):
    geometry = TendonGeometry(whole.description, body=whole.rigid_body, solids=whole.visuals)
    theta = np.linspace(0.1, 0.9, 16)
    poses = geometry.poses(theta)
    tips = [poses.rotation[link] @ offset + poses.translation[link] for link, offset in geometry.tips]
    np.testing.assert_allclose(tips, whole.motion(theta, np.zeros(16)).tip, atol=1e-15)
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, theta)
    placed = pin.GeometryData(robot.visual_model)
    pin.updateGeometryPlacements(model, data, robot.visual_model, placed)
    assert len(geometry.visuals) == len(placed.oMg)
    for visual, expected in zip(geometry.visuals, placed.oMg, strict=True):
        place = poses.rotation[visual.link] @ visual.placement.translation + poses.translation[visual.link]
        np.testing.assert_allclose(place, expected.translation, atol=1e-12)
        np.testing.assert_allclose(
            poses.rotation[visual.link] @ visual.placement.rotation, expected.rotation, atol=1e-12
        )


def test_a_hand_on_a_model_is_simulated_and_its_page_has_the_meshes(whole, hand, tmp_path):
    swing = {"offset": 0.5, "amplitude": 0.2, "frequency": 1.0}
    joints = {finger: {"proximal": swing, "medial": swing} for finger in FIRST}
    table = {"name": "allegro", "hand": hand.hand.model_dump(), "reference": {"joints": joints}}
    scenario = fp.Scenario.model_validate(table | {"simulation": {"duration": 0.02}})
    result = fp.simulate(scenario, finger=whole)
    assert result.sizes["joint"] == 16 and float(abs(result.energy_residual).max()) < 1e-7
    scene, _ = unpacked(write_animation(result, tmp_path / "hand.html", finger=whole).read_text("utf-8"))
    solids = [each["object"]["geometries"][0]["type"] for each in scene["commands"] if each["type"] == "set_object"]
    assert solids.count("BufferGeometry") > 20 and "ring.T5" in {tendon["name"] for tendon in scene["tendons"]}


@pytest.mark.parametrize(
    ("change", "entry"),
    [
        ({"joints": {"index": {"spread": "joint_0.0"}}}, "joints.index.proximal"),
        ({"tip_frame": {"index": "link_3.0_tip"}}, "tip_frame.thumb"),
        ({"tip_frame": "link_3.0_tip"}, "tip_frame"),
    ],
)
def test_a_finger_that_is_left_out_is_named(robot, hand, change, entry):
    given = {"joints": {finger: joints_of(finger) for finger in FIRST}}
    given["tip_frame"] = {finger: f"link_{at + 3}.0_tip" for finger, at in FIRST.items()}
    with pytest.raises(fp.InputError) as caught:
        fp.Finger.from_model(hand, robot.model, **(given | change))
    assert caught.value.entry == entry
