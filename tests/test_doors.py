"""Every door takes what the others take: a scenario, its name or the path of its file; a finger likewise."""

import numpy as np
import pytest

import finger_pin as fp

SHORT = {"simulation.duration": 0.005}


def lengths(scenario):
    runs = fp.sweep(scenario, {"simulation.rtol": [1e-5]}, metrics=["tension_peak"])
    return float(runs.tension_peak.squeeze())


DOORS = {
    "simulate": lambda given: fp.simulate(given).joint_position.values,
    "prepare": lambda given: fp.prepare(given).run()["joint_position"],
    "simulate_many": lambda given: fp.simulate_many([given]).joint_position.values,
    "check_convergence": lambda given: fp.check_convergence(given).difference,
    "sweep": lengths,
    "self_locking_margin": lambda given: fp.analysis.self_locking_margin(given, samples=5).margin,
    "load_scenario": lambda given: fp.simulate(fp.load_scenario(given, {"controller.gain": 0.7})).joint_position.values,
}


@pytest.mark.parametrize("door", DOORS.values(), ids=DOORS.keys())
def test_a_scenario_and_the_path_of_its_file_do_the_same(door, tmp_path):
    path = tmp_path / "short.toml"
    path.write_text('extends = "fig6"\n[simulation]\nduration = 0.005\n')
    np.testing.assert_array_equal(door(fp.load_scenario("fig6", SHORT)), door(str(path)))


def test_a_finger_of_ones_own_is_taken_where_simulate_takes_one():
    scenario, heavy = fp.load_scenario("fig6", SHORT), fp.load_finger("ub", {"finger.joints.medial.link.mass": 0.2})
    finger = fp.Finger(heavy)
    expected = fp.simulate(scenario, finger=finger).joint_position.values
    assert np.any(expected != fp.simulate(scenario).joint_position.values)
    np.testing.assert_array_equal(fp.prepare(scenario, finger=finger).run()["joint_position"], expected)
    many = fp.simulate_many([scenario, scenario], finger=finger)
    np.testing.assert_array_equal(many.joint_position.values, [expected, expected])
    first = fp.simulate(scenario, finger=finger)
    assert fp.check_convergence(scenario, first, finger=finger).converged


def test_values_at_keys_of_a_finger_change_one_of_ones_own():
    plain = fp.prepare("fig6", ["finger.tendon_friction.coulomb"])
    own = fp.prepare("fig6", ["finger.tendon_friction.coulomb"], finger=fp.Finger("ub"))
    for values in (None, [0.2]):
        np.testing.assert_array_equal(own.run(values)["tendon_tension"], plain.run(values)["tendon_tension"])


@pytest.mark.parametrize("kind", [fp.Simulator, fp.Finger, fp.analysis.closure_over_range])
def test_a_finger_may_be_given_by_its_name(kind):
    assert kind("ub") is not None


def test_the_state_has_pinocchios_short_names():
    state = fp.Simulator("ub", position=[0.0, 0.1, 0.2, 0.3]).state
    assert state.q is state.position and state.v is state.velocity


def test_what_a_loop_of_ones_own_needs_stands_at_the_front_door():
    assert issubclass(fp.InputError, fp.FingerPinError) and fp.Law.__name__ == "Law" and fp.Rows.__name__ == "Rows"
