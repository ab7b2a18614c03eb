"""The step interface: held tensions, state in and out, determinism, errors."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
import tomli_w

import finger_pin as fp
from finger_pin.simulation.simulator import Simulator

TENSION = np.array([1.2, 1.0, 4.4, 3.1])
START = np.array([0.05, 0.4, 0.5, 0.35])


@pytest.fixture
def simulator(finger: fp.Finger) -> Simulator:
    return Simulator(finger, START)


def walk(simulator: Simulator, steps: int, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    return np.array([simulator.step(TENSION * random.uniform(0.5, 1.5, 4), 1e-3).position for _ in range(steps)])


@pytest.mark.slow
def test_a_step_follows_the_numpy_dynamics_integrated_by_another_method(finger: fp.Finger) -> None:
    simulator = Simulator(finger, START, rtol=1e-8, atol_scale=1e-8)
    for _ in range(3):
        simulator.step(TENSION, 4e-4)
    expected = scipy.integrate.solve_ivp(
        finger.rhs, (0.0, 1.2e-3), finger.rest_state(START), "LSODA", rtol=1e-9, atol=1e-12, args=(TENSION,)
    ).y[:, -1]
    assert simulator.time == pytest.approx(1.2e-3, abs=1e-15)
    np.testing.assert_allclose(simulator.x / finger.layout.scales(), expected / finger.layout.scales(), atol=5e-7)


@pytest.mark.slow
def test_a_fingertip_force_acts_during_its_step_only(finger: fp.Finger) -> None:
    force = np.array([0.2, -0.1, 0.3])
    simulator = Simulator(finger, START, rtol=1e-8, atol_scale=1e-8)
    simulator.step(TENSION, 4e-4, force)
    simulator.step(TENSION, 4e-4)
    x = finger.rest_state(START)
    for pushed in (force, None):
        x = scipy.integrate.solve_ivp(
            finger.rhs, (0.0, 4e-4), x, "LSODA", rtol=1e-9, atol=1e-12, args=(TENSION, pushed)
        ).y[:, -1]
    np.testing.assert_allclose(simulator.x / finger.layout.scales(), x / finger.layout.scales(), atol=5e-7)


def test_the_same_steps_give_the_same_bits(finger: fp.Finger) -> None:
    np.testing.assert_array_equal(walk(Simulator(finger, START), 30), walk(Simulator(finger, START), 30))


def test_a_copy_goes_on_bit_by_bit_and_leaves_the_original_alone(finger: fp.Finger) -> None:
    simulator = Simulator(finger, START)
    walk(simulator, 10)
    twin, before = simulator.clone(), simulator.x
    ahead = walk(twin, 10, seed=1)
    np.testing.assert_array_equal(simulator.x, before)
    np.testing.assert_array_equal(walk(simulator, 10, seed=1), ahead)


def test_a_state_put_back_is_where_the_motion_goes_on_from(finger: fp.Finger) -> None:
    simulator = Simulator(finger, START, rtol=1e-7, atol_scale=1e-7)
    walk(simulator, 10)
    kept = simulator.x
    ahead = walk(simulator, 10, seed=2)
    simulator.x = kept
    np.testing.assert_allclose(walk(simulator, 10, seed=2), ahead, atol=1e-7)


def test_a_corrected_state_moves_as_one_that_is_set_in_fewer_steps(finger: fp.Finger) -> None:
    noise, ends, steps = 1e-6 * np.random.default_rng(4).normal(size=(20, finger.layout.size)), [], []
    for go_on in (Simulator.correct, lambda simulator, x: setattr(simulator, "x", x)):
        simulator = Simulator(finger, START, rtol=1e-3, atol_scale=1e-3)
        for change in noise * finger.layout.scales():
            simulator.step(TENSION, 1e-3)
            go_on(simulator, simulator.x + change)
        ends.append(simulator.x / finger.layout.scales())
        steps.append(sum(float(part.memory.accepted_steps[0]) for part in simulator._stepper.parts))
    np.testing.assert_allclose(*ends, atol=1e-3)
    # Steps that begin with 1 us and grow at most sixfold are four more before they are 1 ms long.
    assert steps[1] - steps[0] > 3 * len(noise)
    with pytest.raises(fp.InputError, match=r"x = .*must be finite"):
        simulator.correct(np.full(finger.layout.size, np.nan))


def test_changing_what_is_returned_changes_nothing_inside(finger: fp.Finger) -> None:
    simulator = Simulator(finger, START)
    state = simulator.step(TENSION, 1e-3)
    before = simulator.x
    state.position[:] = 99.0
    simulator.x[:] = 99.0
    np.testing.assert_array_equal(simulator.x, before)


def test_signals_are_those_of_the_finger_at_the_present_state(finger: fp.Finger) -> None:
    simulator = Simulator(finger, START)
    force = np.array([0.0, 0.1, 0.2])
    simulator.step(TENSION, 2e-3, force)
    expected = finger.evaluate(simulator.x, TENSION, force)
    found = simulator.signals()
    np.testing.assert_allclose(found["joint_reaction"], expected["joint_reaction"], rtol=1e-12)
    np.testing.assert_allclose(found.strands, expected.strands, rtol=1e-12)
    np.testing.assert_allclose(found["joint_acceleration"], expected["joint_acceleration"], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(
    ("arguments", "entry"),
    [
        (([1.0, 1.0, 1.0], 1e-3), "inputs"),
        ((["a", 1.0, 1.0, 1.0], 1e-3), "inputs"),
        (([1.0, np.nan, 1.0, 1.0], 1e-3), "inputs"),
        (([1.0, np.inf, 1.0, -np.inf], 1e-3), "inputs"),
        ((TENSION, 0.0), "dt"),
        ((TENSION, -1.0), "dt"),
        ((TENSION, np.inf), "dt"),
        ((TENSION, np.nan), "dt"),
        ((TENSION, 1e-3, [1.0, 2.0]), "fingertip_force"),
        ((TENSION, 1e-3, [1.0, 2.0, np.nan]), "fingertip_force"),
    ],
)
def test_a_wrong_step_is_named_and_moves_nothing(finger: fp.Finger, arguments: tuple, entry: str) -> None:
    simulator = Simulator(finger, START)
    before = simulator.x
    with pytest.raises(fp.InputError) as caught:
        simulator.step(*arguments)
    assert caught.value.entry == entry
    np.testing.assert_array_equal(simulator.x, before)
    assert simulator.time == 0.0


@pytest.mark.parametrize(
    ("options", "entry"),
    [
        ({"method": "Rodas5"}, "method"),
        ({"rtol": 0.0}, "rtol"),
        ({"atol_scale": 1.0}, "atol_scale"),
        ({"position": [0.0]}, "position"),
        ({"position": [0.0, np.nan, 0.0, 0.0]}, "position"),
    ],
)
def test_a_wrong_option_is_named(finger: fp.Finger, options: dict, entry: str) -> None:
    with pytest.raises(fp.InputError) as caught:
        Simulator(finger, **options)
    assert caught.value.entry == entry


def test_where_the_integrator_cannot_go_on_it_names_time_and_state(finger: fp.Finger) -> None:
    simulator = Simulator(finger, START)
    simulator.step(TENSION, 1e-3)
    broken = simulator.x
    broken[5] = 1e200
    simulator.x = broken
    with pytest.raises(fp.IntegrationError) as caught:
        simulator.step(TENSION, 1e-3)
    assert caught.value.time == pytest.approx(1e-3)
    assert any(name in caught.value.reason for name in finger.layout.names)


def test_an_object_that_holds_addresses_refuses_to_be_copied_alone(finger: fp.Finger) -> None:
    part = fp.Simulator(finger)._stepper.parts[0]
    for each in (part, part.model):
        with pytest.raises(TypeError, match="holds addresses"):
            copy.deepcopy(each)


def test_a_reset_begins_bit_by_bit_as_a_new_one_does(simulator: Simulator) -> None:
    start = [0.1, 0.3, 0.3, 0.2]
    fresh = fp.Simulator(simulator.finger, start)
    simulator.step(np.full(4, 3.0), 0.01, [0.1, 0.0, -0.2])
    simulator.reset(start)
    assert simulator.time == 0.0
    for _ in range(3):
        assert np.array_equal(
            fresh.finger.layout.pack(fresh.step(np.full(4, 2.0), 0.01)),
            simulator.finger.layout.pack(simulator.step(np.full(4, 2.0), 0.01)),
        )
    assert fresh.result().equals(simulator.result())


def test_a_reset_goes_to_any_state_that_is_given_and_refuses_others(simulator: Simulator) -> None:
    state = simulator.step(np.full(4, 2.0), 0.01)
    x = simulator.x
    simulator.step(np.full(4, 4.0), 0.01)
    for initial in (x, state):
        simulator.reset(initial)
        assert np.array_equal(simulator.x, x)
    with pytest.raises(fp.InputError, match="initial"):
        simulator.reset(x[:-1])
    assert np.array_equal(simulator.x, x)


def test_other_parameters_make_the_finger_that_is_read_with_them(simulator: Simulator) -> None:
    simulator.step(np.full(4, 2.0), 0.01)
    key, value = "finger.tendon_friction.coulomb", 0.03
    other = fp.Simulator(fp.Finger(fp.load_finger("ub_stand_in", {key: value})))
    other.x = simulator.x
    simulator.set_parameters({key: value})
    simulator.step(np.full(4, 3.0), 0.01)
    # At times of their own, each as far on as the other.
    other.step(np.full(4, 3.0), 0.01)
    assert np.allclose(other.x, simulator.x, rtol=0.0, atol=1e-9)
    assert other.finger.tendons.surface.tolist() == simulator.finger.tendons.surface.tolist()
    before = simulator.x
    with pytest.raises(fp.InputError, match="must be at least 0"):
        simulator.set_parameters({key: -1.0})
    with pytest.raises(fp.InputError, match=r"controller\.gain: does not act on a finger"):
        simulator.set_parameters({key: 0.1, "controller.gain": 2.0})
    assert np.array_equal(simulator.x, before) and simulator.finger.tendons.surface[0] == value


def test_many_simulators_step_together_bit_by_bit_as_one_by_one(simulator: Simulator) -> None:
    rng = np.random.default_rng(2)
    together = [simulator.clone() for _ in range(5)]
    alone = [each.clone() for each in together]
    for turn in range(6):
        tensions, forces = rng.uniform(0.0, 5.0, (5, 4)), [None] * 5
        if turn == 2:
            forces[1] = [0.0, 0.0, 0.3]
        for each in (together[2], alone[2]) if turn == 3 else ():
            each.set_parameters({"finger.tendon_friction.coulomb": 0.2})
        states = fp.step_many(together, tensions, 0.01, forces)
        for one, tension, force, state in zip(alone, tensions, forces, states, strict=True):
            assert np.array_equal(one.finger.layout.pack(one.step(tension, 0.01, force)), one.finger.layout.pack(state))
    assert fp.step_many([], [], 0.01) == []
    assert together[3].result().equals(alone[3].result())
    with pytest.raises(fp.InputError, match="stands there twice"):
        fp.step_many([simulator, simulator], np.ones((2, 4)), 0.01)


def test_a_palm_moves_along_its_path_and_the_result_has_it(tmp_path: Path) -> None:
    path = {"z": {"amplitude": 0.02, "frequency": 3.0}, "roll": {"amplitude": 0.5, "frequency": 1.0}}
    table = {
        "name": "shaken",
        "hand": {"name": "one", "fingers": {"index": {"finger": "ub_stand_in"}}, "palm": {"path": path}},
        "controller": {"kind": "tensions", "minimum_tension": 2.0},
        "simulation": {
            **{"duration": 0.3, "rtol": 1e-8, "atol_scale": 1e-8},
            # By (20) it would begin a little beyond its range.
            "initial": {"position": {"index.distal": 0.0}},
        },
    }
    (tmp_path / "shaken.toml").write_text(tomli_w.dumps(table))
    scenario = fp.load_scenario(tmp_path / "shaken.toml")
    expected = fp.simulate(scenario)
    simulator = Simulator(scenario.finger, expected.joint_position[0].values, rtol=1e-8, atol_scale=1e-8)
    for _ in range(30):
        simulator.step([2.0] * 4, 1e-2)
    found = simulator.result()
    np.testing.assert_allclose(simulator.state.position, expected.joint_position[-1], atol=1e-6)
    np.testing.assert_allclose(found.palm_position, expected.palm_position, atol=1e-12)
    np.testing.assert_allclose(
        simulator.signals()["joint_acceleration"], expected.joint_acceleration[-1], rtol=1e-3, atol=1e-2
    )
    assert abs(float(found.energy_residual[-1])) < 1e-6


def test_the_state_has_pinocchios_short_names():
    state = fp.Simulator("ub_stand_in", position=[0.0, 0.1, 0.2, 0.3]).state
    assert state.q is state.position and state.v is state.velocity
