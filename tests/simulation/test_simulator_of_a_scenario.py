"""Simulators of scenarios, goals of position loops, and variables at the present instant."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.simulation.simulators import Instants, step_many

TENSION = np.array([1.2, 1.0, 4.4, 3.1])
COARSE = {"simulation.method": "Rodas4", "simulation.rtol": 1e-4, "simulation.atol_scale": 1e-4}
SERVO = fp.load_scenario("servo_position", COARSE)
GOALS = {f"spool_angle.M{k}": angle for k, angle in zip(range(1, 5), (1.0, 0.5, 2.0, 1.5), strict=True)}


def test_a_scenario_in_steps_moves_as_simulate_under_the_same_tensions() -> None:
    """With a force at the fingertip that varies, which the steps do not name."""
    force = {f"environment.fingertip_force_signal.{axis}": {"amplitude": 0.1, "frequency": 3.0} for axis in "xz"}
    scenario = fp.load_scenario("reversals", {**COARSE, **force, "simulation.duration": 0.1})
    sim = fp.Simulator.from_scenario(scenario)
    np.testing.assert_array_equal(sim.x, fp.prepare(scenario).start)
    whole = fp.simulate(scenario, controller=(np.array([0.0, 0.1]), np.tile(TENSION, (2, 1))))
    for _ in range(10):
        sim.step(TENSION, 0.01)
    np.testing.assert_allclose(sim.state.position, whole.joint_position[-1], atol=1e-4)
    np.testing.assert_allclose(sim.result().fingertip_force[-1], whole.fingertip_force[-1], atol=1e-12)
    with pytest.raises(InputError, match=r"fingertip_force.*varies"):
        sim.step(TENSION, 0.01, [0.1, 0.0, 0.0])


def test_a_force_of_a_step_stands_beside_the_constant_one_of_the_scenario() -> None:
    pushed, plain = (
        fp.Simulator.from_scenario(
            fp.load_scenario("reversals", {**COARSE, "environment.fingertip_force": [force, 0.0, 0.0]})
        )
        for force in (0.3, 0.0)
    )
    pushed.x = plain.x = pushed.x
    one, other = pushed.step(TENSION, 0.02), plain.step(TENSION, 0.02, [0.3, 0.0, 0.0])
    np.testing.assert_allclose(one.position, other.position, atol=1e-6)


def test_numbers_of_surroundings_are_changed_as_by_an_override() -> None:
    key = "environment.fingertip_force"
    changed = fp.Simulator.from_scenario(fp.load_scenario("reversals", COARSE))
    changed.set_parameters({key: [0.2, 0.0, 0.0]})
    made = fp.Simulator.from_scenario(fp.load_scenario("reversals", {**COARSE, key: [0.2, 0.0, 0.0]}))
    np.testing.assert_array_equal(changed.step(TENSION, 0.02).position, made.step(TENSION, 0.02).position)


def test_goals_that_are_held_act_as_those_of_a_scenario_with_constant_spool_angles() -> None:
    """Over more samples than there is room for at the start."""
    scenario = fp.load_scenario(
        SERVO, {"controller": {"kind": "tensions", "spool_angle": _angles()}, "simulation.duration": 1.5}
    )
    sim = fp.Simulator.from_scenario(scenario, goals=True)
    for _ in range(30):
        state = sim.step(GOALS, 0.05)
    whole = fp.simulate(scenario)
    np.testing.assert_allclose(state.motor_position, whole.motor_position[-1], atol=2e-3)
    np.testing.assert_allclose(sim.result().spool_angle[-1], [*GOALS.values()], rtol=1e-12)


def _angles() -> dict[str, dict[str, float]]:
    return {name.partition(".")[2]: {"offset": angle} for name, angle in GOALS.items()}


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_a_copy_with_loops_goes_on_bit_by_bit_alone(copied) -> None:  # type: ignore[no-untyped-def]
    sim = fp.Simulator.from_scenario(SERVO, goals=True)
    sim.step(GOALS, 0.013)
    twin = copied(sim)
    ahead = [twin.step({name: 1.2 * angle for name, angle in GOALS.items()}, 0.013).position for _ in range(3)]
    behind = [sim.step({name: 1.2 * angle for name, angle in GOALS.items()}, 0.013).position for _ in range(3)]
    np.testing.assert_array_equal(ahead, behind)


def test_a_result_of_loops_repeats_the_steps_bit_for_bit_also_from_a_state_that_was_set() -> None:
    sim = fp.Simulator.from_scenario(SERVO, goals=True)
    sim.step(GOALS, 0.05)
    sim.x = sim.x
    for factor in (0.5, 1.5):
        state = sim.step({name: factor * angle for name, angle in GOALS.items()}, 0.05)
    result = sim.result()
    np.testing.assert_array_equal(result.joint_position[-1], state.position)
    np.testing.assert_array_equal(result.motor_position[-1], state.motor_position)


def test_loops_go_on_when_a_force_comes() -> None:
    """A first force builds the integrator of an island anew."""
    sim, plain = (fp.Simulator.from_scenario(SERVO, goals=True) for _ in range(2))
    for each, force in ((sim, [1e-9, 0.0, 0.0]), (plain, None)):
        each.step(GOALS, 0.01)
        state = each.step(GOALS, 0.1, force)
    np.testing.assert_allclose(sim.state.motor_position, state.motor_position, atol=1e-6)


def test_variables_at_an_instant_are_the_last_of_the_result_each_simulator_with_numbers_of_its_own() -> None:
    sims = [fp.Simulator.from_scenario(SERVO, goals=True) for _ in range(2)]
    instants = Instants(sims)
    sims[1].set_parameters({"finger.tendon_friction.coulomb": 0.3, "finger.joints.medial.link.length": 0.03})
    step_many(sims, [GOALS] * 2, [0.05, 0.03])
    present = instants.read()
    assert {"motor_voltage", "tendon_tension", "fingertip_position", "spool_angle"} <= {*present}
    for index, sim in enumerate(sims):
        last = sim.result().isel(time=-1)
        for name, values in present.items():
            scale = np.max(np.abs(last[name].values), initial=1e-6)
            np.testing.assert_allclose(values[index], last[name].values, atol=1e-8 * scale, err_msg=name)


def test_a_simulator_that_fails_says_why_and_the_others_have_stepped() -> None:
    sims = [fp.Simulator("ub_stand_in", rtol=1e-3, atol_scale=1e-3) for _ in range(2)]
    with pytest.raises(IntegrationError):
        for _ in range(10):
            step_many(sims, [[1e9, 0.0, 1e9, 0.0], TENSION], 0.02)
    assert "range" in sims[0].failure and not sims[1].failure and sims[1].time > sims[0].time
    sims[0].reset()
    assert not sims[0].failure


def test_wrong_scenarios_names_and_lengths_are_refused() -> None:
    with pytest.raises(InputError, match=r"simulation\.method = \"Radau\": must be one of"):
        fp.Simulator.from_scenario(fp.load_scenario("reversals", {"simulation.method": "Radau"}))
    sim = fp.Simulator.from_scenario(SERVO, goals=True)
    with pytest.raises(InputError, match=r"spool_angle\.M1"):
        sim.step({"motor_voltage.M1": 1.0}, 0.01)
    with pytest.raises(InputError, match=r"dt.*one per simulator"):
        step_many([sim], [GOALS], [0.01, 0.02])
    with pytest.raises(InputError, match=r"names.*joint_angle"):
        Instants([sim], ["joint_angle"])
