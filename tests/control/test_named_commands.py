"""Commands by name: files, arrays, custom controllers and steps take the same names, those of actuators among them."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import read_scenario

mujoco = pytest.importorskip("mujoco")

# A servo on one joint, and a cord that turns the other one.
HAND = """<mujoco><option gravity="0 0 0"/><worldbody>
  <body name="near"><joint name="swing" axis="0 1 0" damping="0.02"/>
    <geom type="capsule" size="0.01" fromto="0 0 0 0 0 0.1"/>
    <body name="far" pos="0 0 0.1"><joint name="curl" axis="0 1 0" stiffness="0.1" damping="0.02"/>
      <geom type="capsule" size="0.01" fromto="0 0 0 0 0 0.1"/></body></body></worldbody>
  <tendon><fixed name="cord"><joint joint="curl" coef="-0.01"/></fixed></tendon>
  <actuator><position name="servo" joint="swing" kp="2" kv="0.1"/></actuator></mujoco>"""
TIMES = np.linspace(0.0, 0.2, 21)
NAMES = ("cord", "servo")
GOAL, PULL = 0.5 * np.sin(9.0 * TIMES), 4.0 + 2.0 * np.cos(7.0 * TIMES)


def scenario(**controller):
    table = fp.from_mujoco(mujoco.MjModel.from_xml_string(HAND)).model_dump(exclude_none=True)
    table["tendons"] = {"cord": {"along": "cord"}}
    simulation = {"duration": 0.2, "sample_rate": 100.0}
    return read_scenario({"name": "hand", "finger": table, "controller": controller, "simulation": simulation})


def motion(result):
    return result.joint_position.values


class ByName:
    """Controller that follows the samples."""

    def __init__(self, names):
        """Take names, or none for the order of the inputs."""
        self.names = names

    def command(self, time, reference, position, velocity):
        numbers = [float(np.interp(time, TIMES, column)) for column in (PULL, GOAL)]
        return dict(zip(self.names, numbers, strict=True)) if self.names else numbers


@pytest.fixture(scope="module")
def expected():
    samples = {"kind": "samples", "times": TIMES.tolist()}
    goals, pulls = ({**samples, "values": values.tolist()} for values in (GOAL, PULL))
    return motion(fp.simulate(scenario(kind="tensions", inputs={"servo": goals}, tensions={"cord": pulls})))


@pytest.mark.parametrize("names", [NAMES, ("tensions.cord", "inputs.servo")])
def test_files_and_arrays_have_the_names_of_tables(names, expected, tmp_path):
    given = (TIMES, dict(zip(names, (PULL, GOAL), strict=True)))
    np.testing.assert_array_equal(motion(fp.simulate(scenario(), controller=given)), expected)
    columns = np.column_stack([TIMES, PULL, np.rad2deg(GOAL)]).tolist()
    rows = [",".join(map(repr, row)) for row in columns]
    (tmp_path / "goals.csv").write_text("\n".join(["t,pull,goal [deg]", *rows]))
    file = {"path": str(tmp_path / "goals.csv"), "columns": dict(zip(names, ("pull", "goal"), strict=True))}
    np.testing.assert_allclose(motion(fp.simulate(scenario(file=file))), expected, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("names", [NAMES, ("tensions.cord", "inputs.servo"), ()])
def test_custom_controllers_may_return_tensions_by_name(names, expected):
    sampled = fp.simulate(scenario(), controller=ByName(names), control_period=1e-3)
    np.testing.assert_allclose(motion(sampled), expected, atol=3e-3)
    np.testing.assert_allclose(sampled.actuator_input[:, 0], GOAL, atol=5e-3)
    if names != NAMES:
        return
    # Without a period it is asked at any time, and its straight lines are the samples' to the tolerances.
    continuous = fp.simulate(scenario(), controller=ByName(names))
    np.testing.assert_allclose(motion(continuous), expected, atol=1e-3)


def test_a_simulator_steps_with_inputs_by_name():
    finger = fp.Finger(scenario().finger)
    states = []
    for inputs in ([4.0, 0.3], {"servo": 0.3, "cord": 4.0}, {"inputs.servo": 0.3, "tensions.cord": 4.0}):
        simulator = fp.Simulator(finger, [0.0, 0.0])
        states.append([simulator.step(inputs, 0.01).position for _ in range(20)][-1])
    np.testing.assert_array_equal(states[0], states[1])
    np.testing.assert_array_equal(states[0], states[2])


@pytest.mark.parametrize(
    ("commands", "says"),
    [
        ({"cord": 1.0}, "must have all of tensions.cord, inputs.servo; missing: inputs.servo"),
        ({"cord": 1.0, "srvo": 0.1}, "srvo: no such input; there are tensions.cord, inputs.servo"),
        ({"cord": 1.0, "inputs.cord": 0.1}, "inputs.cord: no such input; there are tensions.cord, inputs.servo"),
        ([1.0], "must return the inputs of servo too: by name, or behind the tensions"),
        ({"cord": 1.0, "servo": np.nan}, "must be finite"),
        ({"cord": -1.0, "servo": 0.1}, "must be finite and not negative, that of cord is not"),
    ],
)
def test_an_input_that_is_missing_or_unknown_is_named(commands, says):
    class Wrong:
        def command(self, time, reference, position, velocity):
            return commands

    with pytest.raises(fp.InputError) as refused:
        fp.simulate(scenario(), controller=Wrong(), control_period=0.01)
    assert says in str(refused.value)


def test_names_of_nothing_list_tendons_and_actuators():
    with pytest.raises(fp.InputError, match="no such tendon or actuator; there are cord, servo"):
        fp.simulate(scenario(), controller=(TIMES, {"thumb": PULL}))
