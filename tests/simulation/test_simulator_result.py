"""The past of a simulator, as the Dataset that simulate returns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.simulation.result_folder import ResultFolder
from finger_pin.views.plots import draw_all
from finger_pin.views.viewer.animation import write_animation

TENSION = np.array([1.2, 1.0, 4.4, 3.1])
START = np.array([0.05, 0.4, 0.5, 0.35])


def pushed(simulator: fp.Simulator, steps: int, seed: int) -> fp.Simulator:
    """Step under tensions that jump, with a force on the fingertip now and then."""
    random = np.random.default_rng(seed)
    for step in range(steps):
        force = random.uniform(-0.3, 0.3, 3) if step % 3 == 2 else None
        simulator.step(TENSION * random.uniform(0.5, 1.5, 4), 2e-3, force)
    return simulator


def test_held_tensions_give_the_dataset_of_an_open_loop_scenario(finger: fp.Finger) -> None:
    tensions = dict(zip(finger.routing.tendons, TENSION.tolist(), strict=False))
    entries = {f"controller.tensions.{name}.offset": tension for name, tension in tensions.items()}
    scenario = fp.load_scenario("reversals", {"controller.kind": "tensions", "simulation.duration": 0.02, **entries})
    start = fp.Finger(scenario.finger).rest_state(START)
    expected = fp.simulate(scenario, initial=start)
    simulator = fp.Simulator(fp.Finger(scenario.finger), START)
    for _ in range(20):
        simulator.step(TENSION, 1e-3)
    found = simulator.result()
    assert list(found.variables) == list(expected.variables)
    assert set(found.attrs) == {*expected.attrs, "custom"}
    for name, variable in expected.variables.items():
        assert found[name].dims == variable.dims
        assert found[name].attrs == variable.attrs
    for name in ("time", "joint_position", "tendon_tension", "tendon_command", "energy_exchanged_actuators"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-4, atol=1e-6)


def test_a_result_ends_bit_by_bit_where_the_simulator_stands_and_its_account_closes(finger: fp.Finger) -> None:
    simulator = pushed(fp.Simulator(finger, START), 15, seed=1)
    result = simulator.result()
    np.testing.assert_array_equal(result.joint_position[-1], simulator.state.position)
    np.testing.assert_array_equal(result.tendon_stiction[-1], simulator.state.tendon_stiction)
    supplied = float(abs(result.energy_exchanged_actuators).max())
    assert float(abs(result.energy_exchanged_fingertip).max()) > 1e-6
    assert float(abs(result.energy_residual).max()) < 1e-4 * supplied


def test_at_the_end_of_a_step_the_tensions_and_the_force_of_the_next_one_act(finger: fp.Finger) -> None:
    simulator, force = fp.Simulator(finger, START), np.array([0.1, 0.0, -0.2])
    # The sum of three steps of 0.1 is not 0.3: rounding must not move a sample to the step before.
    for step in range(7):
        simulator.step(TENSION + step, 0.1, step * force)
    result = simulator.result(sample_rate=10.0)
    expected = TENSION + np.minimum(np.arange(8), 6)[:, None]
    np.testing.assert_array_equal(result.tendon_command[:, :4], expected)
    np.testing.assert_array_equal(result.fingertip_force, np.minimum(np.arange(8), 6)[:, None] * force)


def test_a_state_put_in_begins_a_new_result_and_a_copy_has_the_steps_of_both(finger: fp.Finger) -> None:
    simulator = pushed(fp.Simulator(finger, START), 5, seed=2)
    simulator.x = finger.rest_state(START)
    pushed(simulator, 5, seed=3)
    twin = pushed(simulator.clone(), 5, seed=4)
    np.testing.assert_allclose(simulator.result().time[[0, -1]], [0.01, 0.02], rtol=1e-12)
    np.testing.assert_array_equal(simulator.result().joint_position[0], START)
    result = twin.result(sample_rate=500.0)
    np.testing.assert_allclose(result.time, np.linspace(0.01, 0.03, 11), rtol=1e-12)
    np.testing.assert_array_equal(result.joint_position[-1], twin.state.position)


def test_a_copy_keeps_its_result_when_the_other_one_is_given_other_numbers(finger: fp.Finger) -> None:
    simulator = pushed(fp.Simulator(finger, START), 10, 5)
    twin, before = simulator.clone(), simulator.result()
    simulator.set_parameters({"finger.tendon_friction.coulomb": 0.2, "finger.joints.medial.link.mass": 0.1})
    simulator.step(TENSION, 0.01)
    assert np.array_equal(twin.result().tendon_tension, before.tendon_tension)


@pytest.mark.slow
def test_a_result_is_marked_and_drawn_and_saved_like_any_other(finger: fp.Finger, tmp_path: Path) -> None:
    reference = (np.array([0.0, 1.0]), np.array([START[:3], START[:3] + 0.1]))
    result = pushed(fp.Simulator(finger, START), 10, seed=5).result(reference=reference)
    assert result.attrs["custom"] == "loop"
    np.testing.assert_allclose(result.joint_reference[-1, :3], START[:3] + 0.1 * 0.02, atol=1e-4)
    with ResultFolder(tmp_path / "run") as folder:
        folder.write(result)
        draw_all(result, folder.stage / "figures")
        write_animation(result, folder.stage / "animation.html")
        folder.publish()
    assert fp.load(tmp_path / "run").identical(result)
    assert fp.load_scenario(tmp_path / "run" / "scenario.toml").finger == finger.description


def test_before_the_first_step_there_is_no_result(finger: fp.Finger) -> None:
    with pytest.raises(fp.InputError, match="call step"):
        fp.Simulator(finger, START).result()


def test_a_wrong_sample_rate_is_named(finger: fp.Finger) -> None:
    with pytest.raises(fp.InputError) as caught:
        pushed(fp.Simulator(finger, START), 1, seed=6).result(sample_rate=-1.0)
    assert caught.value.entry == "simulation.sample_rate"


def test_the_fingers_of_a_hand_have_forces_of_their_own_in_its_result() -> None:
    scenario = fp.load_scenario("hand")
    simulator = fp.Simulator(fp.Finger(scenario.finger))
    force = np.arange(15.0).reshape(5, 3) / 30.0
    for step in range(3):
        simulator.step(np.full(20, 2.0), 1e-3, step * force)
    result = simulator.result()
    assert result.fingertip_force.dims == ("time", "finger", "axis")
    np.testing.assert_allclose(result.fingertip_force[1], force, rtol=1e-15)
    np.testing.assert_array_equal(result.joint_position[-1], simulator.state.position)
    with pytest.raises(fp.InputError, match="5 times 3 numbers"):
        simulator.step(np.full(20, 2.0), 1e-3, force[0])
