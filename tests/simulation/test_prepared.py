"""Prepared scenarios: many runs with other numbers, bit for bit those of scenarios that are read anew."""

import itertools
import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop, compiled_control
from finger_pin.core.tables.mechanism_parameters import compile_mechanism
from finger_pin.description.loading import ParametrisedScenario, read_scenario
from finger_pin.exceptions import InputError, Interrupted

SCENARIOS = ("reversals", "stick_slip", "servo", "servo_position", "press", "pinch", "hand", "grasp")

# The other fingers have the keys of the first, the hand of `grasp` is that of `hand`, and other scenarios of one finger
# have that of `reversals`.
ALIKE = re.compile(
    r"grasp\.hand\.|hand\.hand\.fingers\.(?!thumb)|pinch\.hand\.fingers\.(?!left)"
    r"|(stick_slip|servo|servo_position|press)\.finger\.(?!actuators)"
)
# Of a band there is a pretension or a slack length; on a palm that moves free objects have no damping.
APART = re.compile(r"passive_tendon\.slack$|environment\.objects\.\w+\.(angular_)?damping$")


def numbers(table, above=()):
    """Give the keys and values of all numbers and lists of numbers of a table."""
    for name, value in table.items():
        key = (*above, name)
        if isinstance(value, dict):
            yield from numbers(value, key)
        elif isinstance(value, float) or (isinstance(value, tuple) and value and isinstance(value[0], float)):
            yield ".".join(key), value


def changed(value):
    """Return a number, or all numbers of a list, changed a little."""
    if isinstance(value, tuple):
        return [changed(each) for each in value]
    return 1.03 * value or 1e-3


def whole(value):
    """Return an integer near a number, or near all of a list."""
    return [whole(each) for each in value] if isinstance(value, tuple) else round(value) or 1


def read_alike(name, key, value, family):
    """Return whether a value may stand at a key; what the family makes of it, or says, is what reading it anew does."""
    try:
        read = fp.load_scenario(name, {key: value})
    except InputError as error:
        with pytest.raises(InputError) as said:
            family.with_values([value])
        assert str(said.value) == str(error)
        return False
    assert family.with_values([value]) == read, key
    return True


def same(one, other):
    """Whether tables of tables of arrays and numbers are the same, bit for bit."""
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return np.array_equal(one, other)


def built(scenario):
    """Return all that a run of a scenario computes with."""
    loop = ClosedLoop.from_scenario(scenario)
    return compile_mechanism(loop.finger.mechanism), compiled_control(loop), loop.initial_state(), loop.fingertip_force


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_every_number_that_ships_makes_what_reading_it_anew_does(name):
    """The scenario of each number, and of an integer there; and, of all together, everything a run computes with."""
    scenario, together = fp.load_scenario(name), {}
    for key, value in numbers(scenario.model_dump(mode="python", exclude_none=True)):
        if ALIKE.match(f"{name}.{key}"):
            continue
        family = ParametrisedScenario(scenario, [key])
        # Keys of a finger of a hand are those of a finger.
        if not key.startswith("hand.fingers."):
            read_alike(name, key, whole(value), family)
        if read_alike(name, key, changed(value), family) and not APART.search(key):
            together[key] = changed(value)
    assert len(together) > 20
    family = ParametrisedScenario(scenario, [*together])
    assert same(built(family.with_values([*together.values()])), built(fp.load_scenario(name, together)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "finger"), [("reversals", ""), ("servo_position", ""), ("pinch", "left"), ("hand", "thumb")]
)
def test_a_run_records_bit_for_bit_what_simulating_the_scenario_read_anew_does(name, finger):
    key = f"hand.fingers.{finger}.finger.tendon_friction.coulomb" if finger else "finger.tendon_friction.coulomb"
    record = ["tendon_tension", "joint_position", "energy_exchanged_tendon_coulomb"]
    prepared = fp.prepare(name, [key, "simulation.duration"], record)
    # What is bound for one run serves the next.
    prepared.run([0.2, 0.02])
    run = prepared.run([0.09, 0.05])
    read = fp.simulate(fp.load_scenario(name, {key: 0.09, "simulation.duration": 0.05}))
    whole = prepared.simulate([0.09, 0.05])
    assert whole.equals(read)
    for each in record:
        assert np.array_equal(run[each], read[each].values)
        assert run.units(each) == read[each].units


@pytest.mark.parametrize("name", ["reversals", "servo_position", "pinch", "hand"])
def test_variables_that_need_only_forces_have_the_bits_of_the_whole_result(name):
    scenario = fp.load_scenario(name, {"simulation.duration": 0.05})
    joints = ("position", "velocity", "reference", "torque_command", "torque")
    record = [f"joint_{each}" for each in joints]
    record += ["tracking_error", "tendon_command", "tendon_tension", "fingertip_position"]
    run, whole = fp.prepare(scenario, record=record).run(), fp.simulate(scenario)
    for each in record:
        assert np.array_equal(run[each], whole[each].values), each


@pytest.mark.slow
def test_runs_in_several_threads_at_once_give_the_bits_of_one_after_the_other():
    prepared = fp.prepare("stick_slip", ["finger.tendon_friction.coulomb", "simulation.duration"])
    values = [(coulomb, 0.2) for coulomb in np.linspace(0.05, 0.15, 12)]
    alone = [prepared.run(each) for each in values]
    with ThreadPoolExecutor(4) as pool:
        beside = list(pool.map(prepared.run, values))
    for one, other in zip(alone, beside, strict=True):
        assert np.array_equal(one["joint_position"], other["joint_position"])
        assert np.array_equal(one["tendon_tension"], other["tendon_tension"])


@pytest.mark.parametrize(
    "key",
    [
        "finger.gravity[2]",
        "finger.passive_tendon.mass",
        "finger.tendons.T3.crossings.proximal.radius",
        "finger.joints.medial.link.mass",
        "finger.joints.distal.range[1]",
        "controller.gain",
    ],
)
def test_a_run_has_the_bits_of_the_first_one_whatever_ran_before(key):
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.02, "finger.gravity": [0.0, 0.0, -9.81]})
    names = ["joint_position", "tendon_tension", "joint_torque"]
    several = fp.prepare(scenario, [key], names)
    value = several.values[0]
    for factor in (1.0, 1.1, 0.9, 1.0):
        again, first = several.run([factor * value]), fp.prepare(scenario, [key], names).run([factor * value])
        for name in names:
            assert np.array_equal(again[name], first[name])


def test_a_value_that_changes_the_structure_rebuilds_the_finger():
    motors = fp.prepare("servo", ["finger.actuators.*.motor", "simulation.duration"], ["motor_current"])
    other = {"finger.actuators.*.motor": "XC330-M288", "simulation.duration": 0.02}
    assert np.array_equal(
        motors.run([*other.values()])["motor_current"], fp.simulate(fp.load_scenario("servo", other)).motor_current
    )
    fingers = fp.prepare("reversals", ["finger", "reference", "simulation.duration"], ["joint_position"])
    planar = {"finger": "planar", "reference": {"joints": {}}, "simulation.duration": 0.02}
    run, read = (
        fingers.run([*planar.values()]),
        fp.prepare(fp.load_scenario("reversals", planar), [], ["joint_position"]),
    )
    assert np.array_equal(run["joint_position"], read.run()["joint_position"])
    assert run["joint_position"].shape != fingers.run(["ub_stand_in", {"joints": {}}, 0.02])["joint_position"].shape


def test_one_number_of_a_list_and_a_star_stand_for_themselves():
    prepared = fp.prepare("servo", ["finger.gravity[2]", "finger.actuators.*.spool_radius"])
    gravity, radius = (0.0, 0.0, -1.62), 0.009
    read = fp.load_scenario("servo", {"finger.gravity": gravity, "finger.actuators.*.spool_radius": radius})
    assert prepared.scenario([gravity[2], radius]) == read
    assert prepared.values[0] == fp.load_scenario("servo").finger.gravity[2]


@pytest.mark.parametrize(
    ("keys", "values", "said"),
    [
        (["finger.tendon_friction.coulom"], None, "did you mean finger.tendon_friction.coulomb?"),
        (["finger.joints.elbow.link.mass"], None, "no such joint"),
        (["finger.gravity[3]"], None, "[0] to [2]"),
        (["finger.tendon_friction.coulomb"], [-0.1], "finger.tendon_friction.coulomb = -0.1: must be at least 0"),
        (["finger.joint_friction.stiction"], [1e-5], "finger.joint_friction.stiction"),
        (["controller.gain"], [np.nan], "controller.gain = nan: must be a finite number"),
        (["controller.gain"], [1.0, 2.0], "values = 2: must be 1"),
    ],
)
def test_what_is_wrong_is_refused_in_one_line(keys, values, said):
    with pytest.raises(InputError) as error:
        fp.prepare("reversals", keys).run(values)
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("scenario", "key", "said"),
    [
        ("hand", "finger.tendon_friction.coulomb", "there is a hand; keys of its fingers begin with hand.fingers"),
        ("reversals", "hand.fingers.index.scale", "there is one finger"),
    ],
)
def test_a_key_of_a_finger_is_none_of_a_hand_and_the_other_way_round(scenario, key, said):
    with pytest.raises(InputError, match=said):
        fp.prepare(scenario, [key])
    with pytest.raises(InputError, match=said):
        fp.Simulator("ub_stand_in" if scenario == "reversals" else "ub_hand").set_parameters({key: 0.1})


def test_a_variable_that_the_result_does_not_have_is_refused():
    with pytest.raises(InputError, match="did you mean joint_position"):
        fp.prepare("reversals", record=["joint_positon"])


def test_what_is_interrupted_is_the_begin_of_the_whole():
    looks = itertools.count()
    prepared = fp.prepare("reversals", ["simulation.duration"])
    with pytest.raises(Interrupted) as said:
        prepared.run([2.0], stop=lambda: next(looks) == 3)
    found, whole = said.value.result, prepared.run([2.0])
    assert 0.0 < float(found.time[-1]) < 2.0
    assert np.allclose(found.joint_position, whole["joint_position"][: found.sizes["time"]], rtol=0.0, atol=1e-13)


def test_what_is_prepared_and_what_is_stepped_print_in_one_line_what_they_are():
    prepared = fp.prepare("reversals", ["controller.gain"], ["joint_position"])
    assert repr(prepared) == "Prepared(reversals, controller.gain=1.0; records joint_position)"
    simulator = fp.Simulator("ub_stand_in", position=[0.0, 0.3, 0.25, 0.2])
    assert repr(simulator) == "Simulator(ub_stand_in at t = 0 s, theta = [0, 0.3, 0.25, 0.2] rad)"


ARM_AND_BALL = """<mujoco><worldbody>
  <body name="arm"><joint name="turn" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.01" mass="0.1"/></body>
  <body name="ball" pos="1 0 0"><freejoint/><geom size="0.02" mass="0.06"/></body>
</worldbody></mujoco>"""


def test_keys_of_an_imported_object_act_beside_objects_of_the_scenario():
    mujoco = pytest.importorskip("mujoco")
    finger = fp.from_mujoco(mujoco.MjModel.from_xml_string(ARM_AND_BALL)).model_dump(exclude_none=True)
    other = {"shape": "sphere", "radius": 0.01, "mass": 0.1, "position": [2.0, 0.0, 0.0]}
    scenario = read_scenario({"name": "arm", "finger": finger, "environment": {"objects": {"other": other}}})
    key = "finger.tree.objects.ball.mass"
    for changed_mass in (
        ParametrisedScenario(scenario, [key]).with_values([0.5]),
        fp.load_scenario(scenario, {key: 0.5}),
    ):
        assert {name: each.mass for name, each in changed_mass.environment.objects.items()} == {
            "ball": 0.5,
            "other": 0.1,
        }
