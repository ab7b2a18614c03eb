"""Trees of bodies on a palm: each is the finger that it is alone, in another place and to scale."""

import itertools
import tomllib

import numpy as np
import pinocchio as pin
import pytest
from palm_cases import (
    CORNERS,
    ON_PATH,
    OPEN,
    PLACES,
    TREE,
    alone_under_turned_gravity,
    as_bodies,
    changed,
    scenario_of,
    states,
)

import finger_pin as fp
from finger_pin.description.loading import read_scenario
from finger_pin.description.placement import rotation
from finger_pin.description.validation import validate
from finger_pin.mechanism.tree_mechanism import build_body


@pytest.mark.parametrize("right", ["ub", as_bodies("ub")], ids=["beside links", "beside bodies"])
def test_a_finger_of_links_moves_alike_as_the_tree_of_its_bodies(right):
    """With its tendons, friction and controller; the fingers stand so close that they push each other."""
    start = {"simulation": {"duration": 0.03, "initial": {"velocity": {"left.abduction": 15.0}}}, "controller": {}}

    def run(left, right):
        placed = {
            "left": {"finger": left, "position": [0.0, 0.1, 0.0], "orientation": [0.0, 0.0, 0.0]},
            "right": {"finger": right, "position": [0.0, 0.1212, 0.0], "orientation": [0.3, 0.0, 0.0], "scale": 1.3},
        }
        scenario = scenario_of(placed, **start)
        table = scenario.hand.updated(fingers_touch=True)
        scenario = read_scenario({"name": "palm", "hand": table, **start})
        return fp.Finger(scenario.finger), fp.simulate(scenario)

    (links, of_links), (bodies, of_bodies) = run("ub", "ub"), run(as_bodies("ub"), right)
    assert links.layout.names == bodies.layout.names
    q = np.random.default_rng(0).uniform(0.0, 1.0, 8)
    np.testing.assert_allclose(bodies.rigid_body.mass_matrix(q), links.rigid_body.mass_matrix(q), rtol=1e-13)
    np.testing.assert_allclose(bodies.rigid_body.gravity_torque(q), links.rigid_body.gravity_torque(q), rtol=1e-13)
    assert float(abs(of_links.contact_force).max()) > 0.01
    assert {*of_links} == {*of_bodies}
    for name in of_links:
        scale = float(np.nanmax(np.abs(of_links[name].values), initial=0.0))
        np.testing.assert_allclose(of_bodies[name], of_links[name], rtol=1e-9, atol=1e-9 * scale, err_msg=name)


@pytest.mark.parametrize("name", PLACES)
def test_a_tree_accelerates_on_a_palm_as_alone_under_turned_gravity(name):
    scenario = alone_under_turned_gravity(name)
    alone, turn = fp.Finger(scenario.finger), rotation(*PLACES[name]["orientation"])
    placed = fp.Finger(scenario_of({name: TREE}).finger)
    assert placed.layout.names == tuple(each.replace("[", f"[{name}.") for each in alone.layout.names)
    inputs, rng = np.array([2.0, 0.3, -0.5]), np.random.default_rng(5)
    for x in states(alone):
        force = rng.normal(size=3)
        expected, found = alone.evaluate(x, inputs, force), placed.evaluate(x, inputs, turn @ force)
        np.testing.assert_allclose(found.rate, expected.rate, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found["joint_reaction"], expected["joint_reaction"], rtol=1e-9)
        q, v = x[:4], np.zeros(4)
        tip = turn @ alone.motion(q, v).tip + PLACES[name]["position"]
        np.testing.assert_allclose(placed.motion(q, v).tip, tip, atol=1e-15)
    np.testing.assert_allclose(
        fp.simulate(scenario_of({name: TREE})).joint_position, fp.simulate(scenario).joint_position, atol=1e-7
    )


def test_two_trees_of_one_description_move_as_each_alone():
    """One has inputs of its own, both start at their first keyframes."""
    controller = {"kind": "tensions", "inputs": {"left": {"motor": {"offset": -0.6}, "servo": {"offset": 0.2}}}}
    scenario = scenario_of({"left": TREE, "right": TREE}, controller=controller)
    result = fp.simulate(scenario)
    assert result.fingertip_position.dims == ("time", "finger", "axis")
    for name, part in scenario.parts().items():
        alone = fp.simulate(part)
        for variable in ("joint_position", "joint_velocity", "joint_friction"):
            np.testing.assert_array_equal(result[variable].sel(joint=alone.joint), alone[variable])
        np.testing.assert_array_equal(result.tendon_tension.sel(tendon=alone.tendon), alone.tendon_tension)
        np.testing.assert_array_equal(result.fingertip_position.sel(finger=name), alone.fingertip_position)
    start = result.joint_position[0]
    assert start.sel(joint="left.bend") == start.sel(joint="right.bend") == 0.3
    assert (
        float(
            abs(result.joint_velocity[-1].sel(joint="left.swing") - result.joint_velocity[-1].sel(joint="right.swing"))
        )
        > 0.1
    )


def test_a_keyframe_of_one_tree_leaves_the_others_at_their_first():
    simulation = {"duration": 0.001, "initial": {"keyframe": "right.shut", "position": {"left": {"swing": 0.1}}}}
    scenario = scenario_of({"left": TREE, "right": TREE}, simulation=simulation)
    assert [*scenario.finger.tree.keyframes] == ["left.open", "left.shut", "right.open", "right.shut"]
    result = fp.simulate(scenario)
    expected = {"left.bend": 0.3, "left.swing": 0.1, "right.bend": 0.9, "right.swing": -0.2}
    assert {name: float(result.joint_position[0].sel(joint=name)) for name in expected} == expected
    assert float(result.joint_velocity[0].sel(joint="right.bend")) == 0.5
    # The keyframe's tension, and the least that the controller holds without one.
    assert result.tendon_command[0].sel(tendon=["left.pull", "right.pull"]).values.tolist() == [1.5, 1.0]
    assert fp.simulate(scenario.parts()["left"]).joint_position[0].sel(joint="left.bend") == 0.3


def test_a_tree_and_links_have_controllers_of_their_own():
    """Motors of the tree are driven in open loop, tendons of the links by the paper's controller."""
    controller = {"inputs": {"left": {"motor": {"offset": 0.5}}}}
    scenario = scenario_of({"left": TREE, "right": "ub"}, controller=controller, simulation={"duration": 0.005})
    assert {name: part.controller.kind for name, part in scenario.parts().items()} == {
        "left": "tensions",
        "right": "proportional",
    }
    result = fp.simulate(scenario)
    for part in scenario.parts().values():
        alone = fp.simulate(part)
        near = result.joint_position.sel(joint=alone.joint)
        np.testing.assert_allclose(near, alone.joint_position, rtol=0.0, atol=1e-6)


def test_numbers_of_tendons_are_in_the_order_of_the_hand():
    """Pulled tendons of both, then the cords that something else pulls."""
    finger = scenario_of({"left": TREE, "right": TREE | {"tendon_friction": {"coulomb": [0.3, 0.4]}}}).finger
    assert (*finger.tendons, *finger.canals) == ("left.pull", "right.pull", "left.cord", "right.cord")
    assert finger.numbers["tendon_friction"]["coulomb"].tolist() == [0.1, 0.3, 0.2, 0.4]


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_a_scaled_tree_has_the_inertia_weight_and_arms_of_a_similar_body(scale):
    """M_ij = s^(5 - k) with k joints that slide among i and j; weights s^4 and s^3; arms s and 1."""
    plain, scaled = (fp.Finger(scenario_of({"left": {"finger": TREE, "scale": each}}).finger) for each in (1.0, scale))
    slides = np.array([0.0, 0.0, 0.0, 1.0])
    numbers = [finger.numbers["joint_friction"]["coulomb"] for finger in (plain.description, scaled.description)]
    np.testing.assert_allclose(numbers[1], numbers[0] * scale ** (1.0 - slides))
    for q in np.random.default_rng(1).uniform(-0.2, 0.8, (5, 4)) * np.where(slides, 0.01, 1.0):
        similar = q * scale**slides
        expected = plain.rigid_body.mass_matrix(q) * scale ** (5.0 - slides - slides[:, None])
        np.testing.assert_allclose(scaled.rigid_body.mass_matrix(similar), expected, rtol=1e-12, atol=1e-24)
        weight = plain.rigid_body.gravity_torque(q) * scale ** (4.0 - slides)
        np.testing.assert_allclose(scaled.rigid_body.gravity_torque(similar), weight, rtol=1e-12, atol=1e-18)
        tip = PLACES["left"]["position"]
        np.testing.assert_allclose(
            scaled.rigid_body.tip_position(similar) - tip, scale * (plain.rigid_body.tip_position(q) - tip), atol=1e-15
        )
        paths = [build_body(finger.description)[1] for finger in (plain, scaled)]
        arms = paths[0].arms(q) * scale ** (1.0 - slides)
        np.testing.assert_allclose(paths[1].arms(similar), arms, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(paths[1].length(similar), scale * paths[0].length(q), rtol=1e-12)
    assert scaled.description.tree.tendons["left.sum"].rest == (-1e-3 * scale, 1e-3 * scale)
    joints = scaled.description.joints["left.thrust"]
    assert (joints.range, joints.spring.rest) == ((-0.01 * scale, 0.02 * scale), 0.002 * scale)
    points = scaled.description.tree.meshes["left.shell"].unpacked()[0]
    np.testing.assert_allclose(points, scale * CORNERS, rtol=1e-7)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_a_coupling_of_a_scaled_tree_holds_similar_postures(scale):
    """What slides follows a hinge by s times as much, and a hinge follows what slides by 1 / s^k of its k-th power."""
    course = {"joint": "thrust", "other": "bend", "ratio": 0.01, "offset": 0.002, "powers": [0.03, -0.02]}
    back = {"joint": "follow", "other": "thrust", "ratio": 8.0, "offset": 0.1, "powers": [90.0, 700.0]}
    finger = changed(tree__couplings={"course": course, "back": back})
    plain, scaled = (scenario_of({"left": {"finger": finger, "scale": each}}).finger.tree for each in (1.0, scale))

    def position(each, other):
        return np.polynomial.Polynomial([each.offset, each.slope, *each.higher])(other)

    for name, of_joint, of_other in (("course", scale, 1.0), ("back", 1.0, scale)):
        one, two = plain.couplings[f"left.{name}"], scaled.couplings[f"left.{name}"]
        for other in (-0.01, 0.004, 0.02):
            assert position(two, of_other * other) == pytest.approx(of_joint * position(one, other), rel=1e-12)


def test_a_hand_of_trees_is_written_and_read_again(tmp_path):
    (tmp_path / "own.toml").write_text(fp.to_toml(validate(fp.FingerDescription, TREE, ("finger",))))
    scenario = scenario_of({"left": {"finger": TREE, "scale": 1.2}, "right": {"finger": "ub"}})
    again = read_scenario(tomllib.loads(fp.to_toml(scenario)))
    assert again == scenario and again.finger == scenario.finger
    by_base = {"base": str(tmp_path / "own.toml"), "joint_friction": {"coulomb": 1e-5}}
    hand = {"fingers": {"left": {"finger": str(tmp_path / "own.toml")}, "right": {"finger": by_base}}}
    from_files = read_scenario({"name": "palm", "hand": hand, **OPEN})
    assert from_files.finger.tree.bodies.keys() == {
        *(f"{name}.{body}" for name in PLACES for body in TREE["tree"]["bodies"]),
        *("left_mount", "right_mount"),
    }
    whole = tomllib.loads(fp.to_toml(from_files.finger))
    assert whole["fingers"]["right"]["finger"]["joint_friction"]["coulomb"] == 1e-5


def test_mujoco_and_pinocchio_read_the_same_masses_and_inertias():
    mujoco = pytest.importorskip("mujoco")
    description = scenario_of({"left": {"finger": TREE, "scale": 1.2}, "right": TREE}).finger
    body = fp.Finger(description).rigid_body
    model = mujoco.MjModel.from_xml_string(fp.to_mjcf(description))
    data = mujoco.MjData(model)
    heavy = {name: each.mass for name, each in description.bodies.bodies.items() if each.mass}
    assert {name: model.body(name).mass.item() for name in heavy} == pytest.approx(heavy, rel=1e-12)
    assert model.body_mass.sum() == pytest.approx(sum(heavy.values()), rel=1e-12)
    read = pin.buildModelFromXML(fp.to_urdf(description))
    order = [model.joint(name).qposadr.item() for name in body.joints]
    rows = [read.joints[read.getJointId(name)].idx_v for name in body.joints]
    for q in np.random.default_rng(2).uniform(-0.01, 0.02, (4, 8)):
        expected, in_mujoco, in_urdf = body.mass_matrix(q), np.zeros((8, 8)), np.zeros(8)
        data.qpos[order], in_urdf[rows] = q, q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, in_mujoco)
        np.testing.assert_allclose(in_mujoco[np.ix_(order, order)], expected, rtol=1e-9, atol=1e-12)
        upper = np.triu(pin.crba(read, read.createData(), in_urdf))
        of_links = (upper + np.triu(upper, 1).T)[np.ix_(rows, rows)]
        # A URDF has no armature.
        np.testing.assert_allclose(of_links + np.diag(body.model.armature), expected, rtol=1e-9, atol=1e-12)


def test_a_force_on_a_finger_acts_at_each_of_its_tips():
    two = changed(tree__tip=None, tree__tips={"a": {"body": "last"}, "b": {"body": "tip"}})
    environment = {"fingers": {"left": {"fingertip_force": [0.0, 0.0, 1.0]}}}
    result = fp.simulate(scenario_of({"left": two, "right": TREE}, environment=environment))
    assert result.tip.values.tolist() == ["left.a", "left.b", "right"]
    assert result.fingertip_force[0, :, 2].values.tolist() == [1.0, 1.0, 0.0]


def test_shapes_of_different_trees_and_objects_touch():
    """Those of one tree do where it says so."""
    objects = {"ball": {"shape": "sphere", "radius": 0.05, "position": [0.0, 0.0, 0.02]}}
    own = changed(tree__touching=[["core", "end"]], touches_itself=True)
    near = {"left": {"finger": own, "position": [0.0, 0.005, 0.0]}, "right": {"finger": TREE, "position": [0.0] * 3}}
    scenario = scenario_of(near, environment={"objects": objects})
    contacts = fp.Finger(scenario.finger, objects=scenario.environment.objects).scene.contacts.names
    shapes = [f"{name}.{shape}" for name in PLACES for shape in ("core", "end")]
    pairs = {frozenset(pair) for pair in itertools.combinations([*shapes, "ball"], 2)}
    assert {frozenset(name.split("-")) for name in contacts} == pairs - {frozenset(shapes[2:])}
    apart = scenario_of(near).hand.updated(fingers_touch=False)
    assert fp.Finger(apart.joined(), objects={}).scene.contacts.names == ("left.core-left.end",)


@pytest.mark.parametrize(
    ("fingers", "says"),
    [
        (
            {"left": changed(tree__bodies__tip__parent="stm")},
            r"hand\.fingers\.left\.finger\.tree\.bodies\.tip\.parent = \"stm\": no such body before it; .* mean stem",
        ),
        (
            {"left": changed(tree__objects={"ball": {"shape": "sphere", "radius": 0.01}})},
            r"hand\.fingers\.left\.finger\.tree\.objects\.ball: .* put it into environment\.objects",
        ),
        (
            {"left": TREE, "right": changed(joint_friction__law="coulomb", joint_friction__stiction=None)},
            r"hand\.fingers: must have one joint_friction\.law, not lugre, coulomb",
        ),
    ],
    ids=["wrong body", "objects", "two laws"],
)
def test_what_does_not_go_together_is_refused_by_the_name_of_the_entry(fingers, says):
    with pytest.raises(fp.InputError, match=says):
        scenario_of(fingers)


def test_a_path_of_a_joint_that_slides_is_scaled_and_is_for_a_palm_at_rest():
    finger = changed(tree__joints__thrust=ON_PATH, tree__bodies__slider={}, tree__loops={})
    hand = scenario_of({"left": {"finger": finger, "scale": 2.0}, "right": finger}).hand
    paths = hand.joined().tree.on_paths
    assert [paths[f"{name}.thrust"].amplitude for name in PLACES] == [0.02, 0.01]
    moved = {"name": "hand", "fingers": hand.fingers, "palm": {"path": {"x": {"amplitude": 0.01}}}}
    with pytest.raises(
        fp.InputError, match=r"hand\.fingers\.left\.finger\.tree\.joints\.thrust\.path: .* palm at rest"
    ):
        read_scenario({"name": "palm", "hand": moved, **OPEN})


@pytest.mark.parametrize(
    ("table", "says"),
    [
        (
            {"inputs": {"left": {"moter": {}}}},
            "no such actuator; there are left.motor, left.servo; did you mean left.motor",
        ),
        (
            {"inputs": {"middle": {"motor": {}}}},
            "controller.inputs.middle: no such finger; the fingers are left, right",
        ),
    ],
)
def test_inputs_are_of_actuators_that_are_there(table, says):
    with pytest.raises(fp.InputError, match=says):
        scenario_of({"left": TREE, "right": TREE}, controller={"kind": "tensions", **table})
