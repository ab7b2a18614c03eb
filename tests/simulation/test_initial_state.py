"""The start of a run: joints by name in the scenario, a packed state, or the end of another run."""

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.exceptions import InputError

START = {
    "simulation.initial.position": {"proximal": 0.4, "distal": 0.2},
    "simulation.initial.velocity": {"medial": -1.0, "distal": 0.5},
}


def short(**entries):
    return fp.load_scenario("fig6", {"simulation.duration": 0.02} | entries)


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
def test_what_is_no_state_of_the_finger_is_refused_in_one_line(initial, said):
    with pytest.raises(InputError, match=said) as caught:
        fp.simulate(short(), initial=initial)
    assert caught.value.entry == "initial" and "\n" not in str(caught.value)


def test_a_result_of_another_finger_or_without_its_state_is_refused():
    result = fp.simulate(short())
    with pytest.raises(InputError, match="is a result of another finger: its tendons must be T1"):
        fp.simulate(short(), initial=result.assign_coords(tendon=list("abcde")))
    with pytest.raises(InputError, match="has no joint_stiction"):
        fp.simulate(short(), initial=result.drop_vars("joint_stiction"))
