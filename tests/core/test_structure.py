"""Structure and parameters of a mechanism: which numbers keep the one, and that both make the whole."""

from dataclasses import replace

import numpy as np
import pytest
from palm_cases import alone_under_turned_gravity, changed, scenario_of
from random_mechanisms import random_mechanism, random_states
from test_any_mechanism import assert_same

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledMechanism
from finger_pin.core.tables.inputs import held_control
from finger_pin.core.tables.islands import Selection, selections
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.mechanism.mechanism import Mechanism


def leaves(table):
    return [leaf for each in table for leaf in (leaves(each) if isinstance(each, tuple) else [each])]


def test_a_mechanism_with_other_numbers_has_the_structure_and_islands_of_the_first():
    keys = ("tendon_friction.coulomb", "joint_friction.stiction", "joints.medial.link.mass")
    more = {f"hand.fingers.index.finger.{key}": value for key, value in zip(keys, (0.07, 0.03, 0.041), strict=True)}
    one, other = (fp.Finger(fp.load_scenario("hand", each)).mechanism for each in ({}, more))
    (structure, numbers), (same, changed) = compile_mechanism(one), compile_mechanism(other)
    assert same is structure
    control = held_control(one.channels, one.coordinates)
    islands = selections(structure, control)
    assert len(islands) > 1 and selections(same, control) is islands
    for island in islands:
        anew = Selection.from_island(structure, island.island, control)
        assert all(map(np.array_equal, leaves(island.structure), leaves(anew.structure)))
        assert all(map(np.array_equal, leaves(island.parameters(changed)), leaves(anew.parameters(changed))))
    pairs = [(leaves(island.parameters(numbers)), leaves(island.parameters(changed))) for island in islands]
    assert sum(not all(map(np.array_equal, *pair)) for pair in pairs) == 1


@pytest.mark.parametrize("seed", range(3))
def test_arms_are_parameters_but_one_that_becomes_zero_changes_the_structure(seed):
    rng = np.random.default_rng(300 + seed)
    mechanism = random_mechanism(rng)
    structure, _ = compile_mechanism(mechanism)

    def with_arms(change):
        rows = [replace(table, arm=change(table.arm), measure=change(table.measure)) for table in mechanism.listed]
        return Mechanism(mechanism.body, rows, mechanism.lumps, mechanism.inertia, mechanism.channels)

    x, command = random_states(mechanism, rng, 5), rng.uniform(-0.5, 3.0, mechanism.channels)
    for change, kept in ((lambda arm: 1.3 * arm, True), (lambda arm: arm * (np.arange(arm.shape[1]) > 0), False)):
        other = with_arms(change)
        assert (compile_mechanism(other)[0] is structure) == kept
        assert_same(CompiledMechanism(other).evaluate(x, command), other.evaluate(x, command), other)


@pytest.mark.parametrize("prefix", ["finger", "hand.fingers.left.finger"])
def test_numbers_beside_a_tree_keep_the_structure_of_its_rows_and_of_free_objects(prefix):
    """Wrenches, loops, weights, powers of couplings, cords, and dampers of objects have pieces of paths."""
    push = {"wrench": {"body": "slider", "force": [0.1, 0.2, 0.0], "torque": [0.0, 0.01, 0.0], "axes": "other"}}
    finger, ball = changed(tree__actuators__push=push), {"shape": "sphere", "radius": 0.01, "mass": 0.01}
    ball |= {"position": [0.5, 0.0, 0.0], "angular_damping": 1e-5}
    around = {"environment": {"objects": {"ball": ball}}}
    alone = prefix == "finger"
    scenario = (
        alone_under_turned_gravity("left", finger, **around) if alone else scenario_of({"left": finger}, **around)
    )

    def structure(**entries):
        keys = {key.replace("__", "."): value for key, value in entries.items()}
        objects = {key: keys.pop(key) for key in [*keys] if key.startswith("environment")}
        one = fp.load_scenario(scenario, {f"{prefix}.{key}": value for key, value in keys.items()} | objects)
        return compile_mechanism(fp.Finger(one.finger, objects=one.environment.objects).mechanism)[0]

    first = structure()
    assert {"gravity_compensation", "loop", "coupling", "object_damping"} <= {
        table.group for table in fp.Finger(scenario.finger, objects=scenario.environment.objects).mechanism.rows
    }
    assert structure(tendon_friction__coulomb=[0.15, 0.25], joint_friction__viscous=1e-4) is first
    assert structure(joints__thrust__range=[-0.02, 0.02], stroke_limiter__stiffness=60.0) is first
    assert structure(environment__objects__ball__angular_damping=2e-5) is first
    # Powers of an angle are measured from the middle of its range.
    assert structure(joints__bend__range=[-0.4, 1.5]) is not first


FRICTION = {"tendon_friction.viscous": 0.7, "tendon_friction.drag": 0.02, "joint_friction.viscous": 1e-4}
LEFT = "hand.fingers.left.finger"
# Beside the finger; of the palm the path alone.
MOVED = {"hand.palm.path.y.amplitude": 0.01, "environment.objects.ball.mass": 0.04}
AT_BENDS = {"tendon_friction.place": "bends"}
SHEATHED = {
    "actuators.servo.tendon_pieces": 3,
    "tendons.flexor.curvature_offset": 0.5,
    "tendon_friction.stiction_ratio": 1.0,
}


@pytest.mark.parametrize(
    ("name", "prefix", "first", "values", "kept"),
    [
        ("reversals", "finger", {}, {**FRICTION, "stroke_limiter.stiffness": 32.0}, True),
        ("reversals", "finger", AT_BENDS, FRICTION, True),
        ("wound", "finger", SHEATHED, FRICTION, True),
        ("underactuated", "finger", {}, FRICTION, True),
        ("press", "finger", {}, FRICTION, True),
        ("pinch", LEFT, {}, FRICTION, True),
        ("pinch", "", {}, MOVED, True),
        ("reversals", "finger", {}, AT_BENDS, False),
        ("reversals", "finger", {}, {"joint_friction.law": "dahl"}, False),
        ("reversals", "finger", {}, {"passive_tendon.mass": 0.01}, False),
        ("pinch", LEFT, {}, {"joints.medial.link.mass": 0.02}, False),
    ],
)
def test_a_finger_with_changed_values_has_the_bits_of_one_built_anew(name, prefix, first, values, kept):
    before, after = ({f"{prefix}.{key}".lstrip("."): each for key, each in keys.items()} for keys in (first, values))
    scenario = fp.load_scenario(name, before)
    other = fp.load_scenario(scenario, after)
    finger, anew = (fp.Finger(each.finger, objects=each.environment.objects) for each in (scenario, other))
    changed, evaluator = finger.changed(other.finger, other.environment.objects), CompiledMechanism(finger.mechanism)
    assert (changed.mechanism.wiring is finger.mechanism.wiring) == kept
    (structure, expected), (same, numbers) = compile_mechanism(anew.mechanism), compile_mechanism(changed.mechanism)
    assert same is structure
    assert evaluator.rebind(changed.mechanism) == (evaluator.structure is compile_mechanism(finger.mechanism)[0])
    for each in (numbers, evaluator.parameters):
        assert all(map(np.array_equal, leaves(each), leaves(expected)))
    assert changed.description == anew.description and changed.layout == anew.layout
    assert (changed.scene and changed.scene.objects) == (anew.scene and anew.scene.objects)
    assert np.array_equal(changed.tendons.friction, anew.tendons.friction)


def test_objects_around_a_finger_that_had_none_are_there_after_a_change():
    finger = fp.Finger("ub")
    ball = fp.load_scenario("pinch").environment.objects["ball"]
    assert finger.changed(finger.description, {"ball": ball}).scene is not None
    held = fp.Finger("ub", objects={"ball": ball})
    assert held.changed(held.description, None).scene is None
    heavier = held.changed(held.description, {"ball": ball.updated(mass=0.1)})
    assert heavier.scene.mass == [0.1] and heavier.constructor_args.objects["ball"].mass == 0.1
