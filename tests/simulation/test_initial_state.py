"""The start of a run: joints by name in the scenario, a packed state, or the end of another run."""

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.description.tables import list_scenarios
from finger_pin.exceptions import InputError
from finger_pin.simulation.initial_state import with_initial_state
from finger_pin.simulation.setup import Setup
from finger_pin.simulation.variables import LOOP_VARIABLES

START = {
    "simulation.initial.position": {"proximal": 0.4, "distal": 0.2},
    "simulation.initial.velocity": {"medial": -1.0, "distal": 0.5},
}


def short(**entries):
    return fp.load_scenario("reversals", {"simulation.duration": 0.02} | entries)


def test_joints_start_where_the_scenario_says_and_the_others_on_their_reference():
    result = fp.simulate(short(**START))
    reference = result.joint_reference.values[0]
    np.testing.assert_allclose(result.joint_position[0], [reference[0], 0.4, reference[2], 0.2], rtol=1e-14)
    np.testing.assert_array_equal(result.joint_velocity[0], [0.0, 0.0, -1.0, 0.5])
    np.testing.assert_array_equal(result.tendon_stiction[0], 0.0)
    np.testing.assert_array_equal(result.joint_stiction[0], 0.0)
    # Both halves of T5 alike: p = (r35 theta3 + r45 theta4) / 2, and its mass moves so that they stay alike.
    assert float(result.passive_position[0]) == pytest.approx(0.5 * (3.5e-3 * reference[2] + 5e-3 * 0.2), rel=1e-12)
    assert float(result.passive_velocity[0]) == pytest.approx(0.5 * (3.5e-3 * -1.0 + 5e-3 * 0.5), rel=1e-12)
    assert "custom" not in result.attrs


def test_a_scenario_with_a_start_is_written_and_read_back(tmp_path):
    path = tmp_path / "again.toml"
    path.write_text(fp.to_toml(short(**START)))
    assert fp.load_scenario(path) == short(**START)


def test_a_packed_state_is_where_the_run_starts():
    scenario = short()
    finger = fp.Finger(scenario.finger)
    x = finger.rest_state(np.array([0.05, 0.3, 0.6, 0.4])) + 1e-5 * np.arange(19)
    result = fp.simulate(scenario, initial=x)
    state = finger.layout.unpack(x)
    for name in ("position", "velocity", "stiction"):
        np.testing.assert_allclose(
            result[f"joint_{name}"][0], getattr(state, f"joint_{name}" if name == "stiction" else name)
        )
    np.testing.assert_allclose(result.tendon_stiction[0], state.tendon_stiction)
    assert float(result.passive_position[0]) == pytest.approx(state.passive_position[0])
    assert result.attrs["custom"] == "initial state"


def test_a_run_continued_from_a_result_is_the_run_that_did_not_stop():
    tight = {"simulation.rtol": 1e-9, "simulation.atol_scale": 1e-9}
    whole = fp.simulate(short(**tight, **{"simulation.duration": 0.1}))
    first = fp.simulate(short(**tight, **{"simulation.duration": 0.06}))
    rest = short(**tight, **{"simulation.duration": 0.04, "simulation.start_time": 0.06})
    second = fp.simulate(rest, initial=first)
    np.testing.assert_array_equal(second.joint_position[0], first.joint_position[-1])
    np.testing.assert_allclose(second.joint_reference, whole.joint_reference[60:], atol=1e-14)
    np.testing.assert_allclose(second.joint_position, whole.joint_position[60:], atol=1e-7)
    np.testing.assert_allclose(second.tendon_stiction, whole.tendon_stiction[60:], atol=1e-4)


SPRING = {"stiffness": 0.1, "rest": 0.2, "hysteresis": 0.2}
#: Everything of a finger that has a state besides those of shipped scenarios: scenario, overrides, and the block.
FEATURES = {
    "passive tendon's hysteresis": ("reversals", {"finger.passive_tendon.hysteresis": 0.1}, "elastic_stiction"),
    "elastic tendons' hysteresis": ("servo", {"finger.actuators.*.tendon_hysteresis": 0.1}, "elastic_stiction"),
    "play": ("servo_position", {"finger.actuators.*.motor.friction.backlash": 0.01}, "spool_position"),
    "springs' hysteresis": ("reversals", {"finger.joints.medial.spring": SPRING}, "further"),
    "bends": ("reversals", {"finger.tendon_friction.place": "bends"}, "canal_stiction"),
    "position loops": ("servo_position", {"finger.actuators.*.position_loop.integral": 20.0}, "motor_position"),
}
CASES = {name: (name, {}, "velocity") for name in list_scenarios()} | FEATURES


@pytest.mark.slow
@pytest.mark.parametrize(("name", "overrides", "block"), CASES.values(), ids=CASES)
def test_every_number_of_the_state_is_read_from_a_result(name, overrides, block):
    """Against the packed state of the integrator itself."""
    # In half a second hands close round what is to be grasped.
    first = 0.0 if name == "grasp" else 0.5
    begin, middle = (
        fp.load_scenario(name, {"simulation.duration": 0.02, "simulation.start_time": start} | overrides)
        for start in (first, first + 0.02)
    )
    setup = Setup.from_scenario(begin)
    x = setup.integrate().interpolate(begin.sample_times()[-1:])[0]
    assert np.any(getattr(setup.loop.finger.layout.unpack(x), block))
    found = with_initial_state(ClosedLoop.from_scenario(middle), fp.simulate(begin)).initial_state()
    np.testing.assert_allclose(found, x, rtol=1e-9, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("feature", ["passive tendon's hysteresis", "elastic tendons' hysteresis", "position loops"])
@pytest.mark.parametrize("parts", [(0.05, 0.05), (0.0505, 0.0495)], ids=["aligned", "between samples"])
def test_two_runs_one_after_the_other_are_one(feature, parts):
    name, overrides, _ = FEATURES[feature]
    tight = {"simulation.rtol": 1e-11, "simulation.atol_scale": 1e-11, "simulation.sample_rate": 2000.0} | overrides
    whole, found, begin = fp.simulate(fp.load_scenario(name, tight | {"simulation.duration": sum(parts)})), None, 0.0
    for part in parts:
        clock = {"simulation.start_time": begin, "simulation.duration": part}
        found, begin = fp.simulate(fp.load_scenario(name, tight | clock), initial=found), begin + part
    for variable in ("joint_position", "elastic_stiction", *LOOP_VARIABLES):
        if variable in whole:
            ours, theirs = found[variable].values[-1], whole[variable].values[-1]
            np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max(initial=1.0), err_msg=variable)


def test_a_sampled_controller_starts_anew_and_that_is_said():
    scenario = short(**{"controller.sampling.period": 1e-3})
    with pytest.warns(fp.exceptions.ScenarioWarning, match="the sampled controller starts anew"):
        fp.simulate(scenario, initial=fp.simulate(scenario))


def test_a_result_whose_loops_are_missing_is_refused():
    result = fp.simulate(fp.load_scenario("servo_position", {"simulation.duration": 0.01}))
    with pytest.raises(InputError, match="has no position_loop_integral"):
        fp.simulate("servo_position", initial=result.drop_vars("position_loop_integral"))


def test_a_saved_result_of_a_finger_without_passive_tendon_is_continued(tmp_path):
    path = tmp_path / "planar.toml"
    path.write_text('finger = "planar"\n[reference.joints.proximal]\noffset = 0.3\n[simulation]\nduration = 0.005\n')
    scenario = fp.load_scenario(path)
    first = fp.simulate(scenario)
    fp.save(first, tmp_path / "first.nc")
    second = fp.simulate(scenario, initial=fp.load(tmp_path / "first.nc"))
    np.testing.assert_array_equal(second.joint_velocity[0], first.joint_velocity[-1])


@pytest.mark.parametrize(
    ("initial", "said"),
    [
        (np.zeros(18), "must be 19 finite numbers"),
        (np.full(19, np.nan), "must be 19 finite numbers"),
        ("rest", "must be a result, or a packed state of 19 numbers"),
        (xr.Dataset(), "its joints must be abduction, proximal, medial, distal"),
    ],
)
def test_an_array_that_is_no_state_of_the_finger_is_refused_in_one_line(initial, said):
    with pytest.raises(InputError, match=said) as caught:
        fp.simulate(short(), initial=initial)
    assert caught.value.entry == "initial" and "\n" not in str(caught.value)


def test_a_result_of_another_finger_or_without_its_state_is_refused():
    result = fp.simulate(short())
    with pytest.raises(InputError, match="is a result of another finger: its tendons must be T1"):
        fp.simulate(short(), initial=result.assign_coords(tendon=list("abcde")))
    with pytest.raises(InputError, match="has no joint_stiction"):
        fp.simulate(short(), initial=result.drop_vars("joint_stiction"))
