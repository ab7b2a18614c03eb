"""Delays of actuators: from rest without gravity, a motion under late commands is the same motion, later."""

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.inputs import InputQueue
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.playground.session import Session
from finger_pin.simulation.simulators import step_many

DELAY = 0.05
MODEL = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="turn" damping="0.02" armature="0.002"/>
<geom type="capsule" size="0.006" fromto="0 0 0 0.06 0 0" mass="0.02"/></body></worldbody>
<actuator><position name="servo" joint="turn" kp="0.4" kv="0.03"/></actuator></mujoco>"""


def finger(delay):
    description = fp.from_mujoco(mujoco.MjModel.from_xml_string(MODEL))
    return fp.load_finger(description, {"finger.tree.actuators.servo.delay": delay})


def scenario(delay, signal):
    table = demo_motion(finger(delay), 0.4)
    table["controller"]["inputs"] = {"servo": signal}
    return read_scenario(table, {"simulation.rtol": 1e-9})


def in_open_loop(signal):
    return lambda delay: fp.simulate(scenario(delay, signal)).joint_position.values[:, 0]


class Ramp:
    def command(self, time, reference, position, velocity):
        return {"servo": 2.0 * time + 0.3}


def under_a_controller(delay):
    """At a period that the delay is no multiple of."""
    scene = scenario(delay, {"offset": 0.0})
    return fp.simulate(scene, controller=Ramp(), control_period=0.008).joint_position.values[:, 0]


def in_steps(delay):
    """One step by itself, one beside another, one by a clone, in turn; samples between them are from the record."""
    simulator, other = (fp.Simulator(finger(delay), [0.0], rtol=1e-9) for _ in range(2))
    for k in range(50):
        command = {"servo": 0.3 + 0.016 * k}
        if k % 3 == 0:
            simulator.step(command, 0.008)
        elif k % 3 == 1:
            step_many([simulator, other], [command, command], 0.008)
        else:
            simulator = simulator.clone()
            simulator.step(command, 0.008)
    return simulator.result().joint_position.values[:, 0]


def in_an_environment(delay):
    from finger_pin.learning import Environment

    world = Environment(
        scenario(delay, {"offset": 0.0}),
        action="tension",
        limits=(-2.0, 2.0),
        reward=lambda signals: signals["action"][:, 0],
        period=0.008,
        duration=0.4,
        start=lambda random: [0.0],
        observation=["joint_position"],
    )
    world.reset(seed=0)
    for k in range(50):
        world.step(np.array([0.3 + 0.016 * k]))
    return world.result().joint_position.values[:, 0]


def in_play(delay):
    """Inputs change every millisecond, so that the sine is missed by its change in half of one."""
    session = Session(scenario(delay, {"amplitude": 0.7, "frequency": 4.0, "phase": 0.4}), rtol=1e-8)
    angles = [0.0]
    for _ in range(400):
        session.step()
        angles.append(session.simulator.state.position[0])
    return np.array(angles)


WAYS = {
    "constant": in_open_loop({"offset": 0.7}),
    "sine": in_open_loop({"amplitude": 0.7, "frequency": 4.0, "phase": 0.4}),
    "step": in_open_loop({"kind": "step", "time": 0.1, "height": 0.5, "offset": 0.2}),
    "samples": in_open_loop({"kind": "samples", "times": [0.0, 0.1, 0.2], "values": [0.3, 0.5, -0.2]}),
    "controller": under_a_controller,
    "steps": in_steps,
    "environment": in_an_environment,
    "play": in_play,
}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_a_late_command_from_any_door_moves_a_servo_as_the_same_one_without_delay_but_later(way):
    at_once, late = WAYS[way](0.0), WAYS[way](DELAY)
    count = round(DELAY * 1000)
    assert np.abs(at_once).max() > 0.1
    np.testing.assert_allclose(late[:count], 0.0, atol=1e-12)
    np.testing.assert_allclose(late[count:], at_once[: len(late) - count], atol=1e-6)


def test_a_run_that_goes_on_remembers_commands_on_their_way():
    signal = {"kind": "step", "time": 0.18, "height": 0.5, "offset": 0.2}
    whole = scenario(DELAY, signal)
    first, rest = (
        fp.load_scenario(whole, {"simulation.duration": 0.2, "simulation.start_time": t}) for t in (0.0, 0.2)
    )
    rest = fp.simulate(rest, initial=fp.simulate(first))
    expected = fp.simulate(whole).joint_position.values[200:]
    np.testing.assert_allclose(rest.joint_position.values, expected, atol=1e-6)


def test_a_controller_of_actuators_with_a_delay_has_to_be_sampled():
    with pytest.raises(fp.InputError, match="control_period: is missing: a controller of actuators with a delay"):
        fp.simulate(scenario(DELAY, {"offset": 0.0}), controller=Ramp())


def test_values_of_several_delays_arrive_in_their_order():
    queue = InputQueue(np.array([0.0, 0.1, 0.25]))
    queue.add(0.0, np.array([1.0, 1.0, 1.0]))
    assert queue.at(0.0).tolist() == [1.0, 0.0, 0.0] and queue.next_arrival(0.0, 0.2) == 0.1
    queue.add(0.05, np.array([2.0, 2.0, 2.0]))
    assert queue.at(0.1).tolist() == [2.0, 1.0, 0.0] and queue.next_arrival(0.1, 0.2) == pytest.approx(0.15)
    assert queue.at(0.26).tolist() == [2.0, 2.0, 1.0] and queue.next_arrival(0.26, 0.29) == 0.29
    assert queue.at(0.3).tolist() == [2.0, 2.0, 2.0]
