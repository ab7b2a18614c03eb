"""simulate(): the Dataset of the interface, its units and consistency, its files, and a user's own blocks."""

from dataclasses import dataclass

import netCDF4
import numpy as np
import pinocchio as pin
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.control.proportional import ControlSignals
from finger_pin.control.reference import ReferenceSignals
from finger_pin.description.scenario import METHODS
from finger_pin.exceptions import InputError, IntegrationError, Interrupted

JOINT, TENDON, AXIS, TIME = ("time", "joint"), ("time", "tendon"), ("time", "axis"), ("time",)

#: Variables that other programs hold on to: dims and unit.
INTERFACE = {
    "joint_position": (JOINT, "rad"),
    "joint_velocity": (JOINT, "rad/s"),
    "joint_acceleration": (JOINT, "rad/s2"),
    "joint_reference": (JOINT, "rad"),
    "tracking_error": (JOINT, "rad"),
    "fingertip_position": (AXIS, "m"),
    "tendon_command": (TENDON, "N"),
    "tendon_tension": (TENDON, "N"),
    "passive_tension_proximal": (TIME, "N"),
    "tendon_friction": (TENDON, "N"),
    "tendon_friction_coefficient": (TENDON, "1"),
    "tendon_curvature": (TENDON, "rad"),
    "passive_position": (TIME, "m"),
    "passive_velocity": (TIME, "m/s"),
    "joint_torque_command": (JOINT, "N m"),
    "joint_torque": (JOINT, "N m"),
    "joint_friction": (JOINT, "N m"),
    "joint_reaction": (JOINT, "N"),
    "limiter_torque": (JOINT, "N m"),
    "energy_residual": (TIME, "J"),
}


def short(duration=0.02, **settings):
    return fp.load_scenario("fig6", {"simulation.duration": duration} | settings)


@pytest.fixture(scope="module", params=["Rodas5P", "Radau"])
def result(request, fig6_runs):
    """The start of fig6 by the compiled core and by the textbook path."""
    return fig6_runs[request.param]


@pytest.mark.parametrize("name", INTERFACE)
def test_the_dataset_has_every_variable_of_the_interface(result, name):
    dims, unit = INTERFACE[name]
    assert result[name].dims == dims
    assert result[name].attrs["units"] == unit


def test_every_variable_says_its_unit_and_name_and_is_finite(result):
    for name, variable in result.variables.items():
        assert variable.attrs["long_name"], name
        if variable.dtype.kind == "f":
            assert variable.attrs["units"], name
            assert np.all(np.isfinite(variable.values)), name
    for name in result:
        if name.startswith("energy_"):
            assert result[name].attrs["units"] == "J"
        if name.startswith("power_"):
            assert result[name].attrs["units"] == "W"


@pytest.mark.parametrize(
    ("name", "equation"),
    [
        ("fingertip_position", "(1)"),
        ("tendon_curvature", "(15)"),
        ("tendon_friction_coefficient", "(16)"),
        ("joint_reaction", "(17)"),
        ("joint_acceleration", "(18)"),
        ("joint_torque_command", "(19)"),
        ("tendon_tension", "(12)"),
    ],
)
def test_variables_carry_the_paper_s_equation_numbers(result, name, equation):
    assert result[name].attrs["equation"] == equation


def test_coordinates_are_named_after_the_finger(result):
    assert list(result.joint.values) == ["abduction", "proximal", "medial", "distal"]
    assert list(result.tendon.values) == ["T1", "T2", "T3", "T4", "T5"]
    assert list(result.axis.values) == ["x", "y", "z"]
    assert result.time.attrs["units"] == "s"


def test_samples_obey_equation_18(result):
    """M theta'' + C theta' + G from Pinocchio's Newton-Euler recursion against the recorded torques."""
    body = fp.Finger(fp.load_finger("ub")).rigid_body
    data = body.model.createData()
    net = result.joint_torque - result.joint_friction - result.limiter_torque + result.external_torque
    for index in range(0, len(result.time), 7):
        state = (result[f"joint_{name}"].values[index] for name in ("position", "velocity", "acceleration"))
        np.testing.assert_allclose(pin.rnea(body.model, data, *state), net.values[index], rtol=1e-8, atol=1e-10)


def test_samples_obey_the_tendon_equations(result):
    """(11) with T5's two tensions, (12) for T1 to T4, (15), (16) and the tracking error, from recorded signals only."""
    f = [result.tendon_tension.sel(tendon=name).values for name in result.tendon.values]
    proximal = result.passive_tension_proximal.values
    r = np.array([8.0, 6.3, 5.3, 3.5, 5.0]) * 1e-3
    torque = [
        r[0] * (f[0] - f[1]),
        r[0] * (f[0] + f[1]) - r[2] * f[3],
        r[1] * f[2] - r[2] * f[3] - r[3] * proximal,
        r[4] * f[4] - r[2] * f[3],
    ]
    np.testing.assert_allclose(result.joint_torque, np.transpose(torque), rtol=1e-9, atol=1e-12)
    actuated = result.isel(tendon=slice(0, 4))
    delivered = np.maximum(0.0, actuated.tendon_command - actuated.tendon_friction)
    np.testing.assert_allclose(actuated.tendon_tension, delivered, rtol=1e-12)
    np.testing.assert_allclose(result.tendon_friction_coefficient, np.tanh(0.055 * result.tendon_curvature), rtol=1e-12)
    np.testing.assert_allclose(result.tracking_error, result.joint_reference - result.joint_position, atol=1e-15)
    np.testing.assert_allclose(result.joint_torque_command, result.tracking_error, rtol=1e-12, atol=1e-15)


def test_recorded_velocity_and_acceleration_are_derivatives_of_finely_sampled_positions():
    result = fp.simulate(short(0.01, **{"simulation.sample_rate": 1e5}))
    q, v, a = (result[f"joint_{name}"].values for name in ("position", "velocity", "acceleration"))
    for values, rates in ((q, v), (v, a)):
        change = np.cumsum(0.5 * (rates[1:] + rates[:-1]), axis=0) * 1e-5
        np.testing.assert_allclose(change, values[1:] - values[0], atol=1e-3 * np.ptp(values, axis=0).max())


def test_the_fingertip_is_equation_1_at_the_recorded_angles(result):
    q = result.joint_position.values
    t2, t23, t234 = np.cumsum(q[:, 1:], axis=1).T
    reach = 0.0202 + 0.045 * np.cos(t2) + 0.0299 * np.cos(t23) + 0.0218 * np.cos(t234)
    height = 0.045 * np.sin(t2) + 0.0299 * np.sin(t23) + 0.0218 * np.sin(t234)
    expected = np.stack([np.cos(q[:, 0]) * reach, np.sin(q[:, 0]) * reach, height], axis=1)
    np.testing.assert_allclose(result.fingertip_position, expected, atol=1e-15)


def test_the_simulation_starts_at_rest_on_the_reference(result):
    start = result.isel(time=0)
    np.testing.assert_allclose(start.tracking_error, 0.0, atol=1e-12)
    np.testing.assert_array_equal(start.joint_velocity, 0.0)
    np.testing.assert_array_equal(start.tendon_stiction, 0.0)
    assert float(start.passive_position) == pytest.approx(
        0.5 * float(3.5e-3 * start.joint_position[2] + 5e-3 * start.joint_position[3]), rel=1e-9
    )
    assert float(start.energy_residual) == 0.0


@pytest.mark.parametrize(
    ("duration", "rate", "expected"),
    [
        (0.005, 1000.0, [0.0, 0.001, 0.002, 0.003, 0.004, 0.005]),
        (0.0053, 1000.0, [0.0, 0.001, 0.002, 0.003, 0.004, 0.005, 0.0053]),
        (0.003, 300.0, [0.0, 0.003]),
        (0.01, 300.0, [0.0, 1.0 / 300.0, 2.0 / 300.0, 0.01]),
        (0.0007, 1000.0, [0.0, 0.0007]),
    ],
)
def test_samples_are_multiples_of_the_period_and_the_end(duration, rate, expected):
    result = fp.simulate(short(duration, **{"simulation.sample_rate": rate}))
    np.testing.assert_allclose(result.time, expected, rtol=1e-12)
    assert result.attrs["end_time"] == duration


def test_attributes_say_how_the_result_was_made(result):
    attributes = result.attrs
    assert attributes["method"] in ("Rodas5P", "Radau")
    assert (attributes["rtol"], attributes["atol_scale"]) == (1e-6, 1e-6)
    for name in ("steps", "evaluations", "jacobians", "factorisations"):
        assert attributes[f"solver_{name}"] > 0
    assert attributes["solver_wall_time"] > 0.0
    assert attributes["version_pin"] and attributes["version_finger_pin"]
    assert "minimum_tension = 1.0" in attributes["scenario"]


def test_methods_agree_on_the_motion(fig6_runs):
    """Python and compiled right-hand sides, and multistep, Runge-Kutta and Rosenbrock methods."""
    reference = fig6_runs["Radau"]
    moved = float(np.ptp(reference.joint_position.values, axis=0).max())
    for method in METHODS:
        difference = abs(fig6_runs[method].joint_position - reference.joint_position).max()
        assert float(difference) < 2e-4 * moved


def test_a_result_survives_its_file(result, tmp_path):
    path = tmp_path / "trajectory.nc"
    fp.save(result, path)
    loaded = fp.load_result(path)
    xr.testing.assert_identical(loaded, result)
    with netCDF4.Dataset(path) as raw:
        assert raw.data_model == "NETCDF4"
        assert raw["tendon_tension"].units == "N"


def test_the_recorded_scenario_repeats_the_trajectory_exactly(tmp_path):
    first = fp.simulate(short(**{"controller.gain": 1.3, "simulation.sample_rate": 700.0}))
    path = tmp_path / "scenario.toml"
    path.write_text(first.attrs["scenario"])
    again = fp.simulate(fp.load_scenario(path))
    assert again.attrs["scenario"] == first.attrs["scenario"]
    for name in first:
        np.testing.assert_array_equal(again[name], first[name], err_msg=name)


def test_the_same_scenario_twice_is_the_same_trajectory():
    first, second = fp.simulate(short()), fp.simulate(short())
    xr.testing.assert_equal(first, second)


@dataclass(frozen=True)
class Hold:
    """A reference that stays where it is."""

    position: tuple[float, ...]

    def at(self, time):
        shape = (*np.shape(time), len(self.position))
        return ReferenceSignals(np.broadcast_to(self.position, shape).copy(), np.zeros(shape))


@dataclass(frozen=True)
class Constant:
    """A controller that pulls with fixed tensions, until it breaks if it is told to."""

    tension: tuple[float, ...]
    broken_after: float = np.inf

    def command(self, time, reference, position, velocity):
        shape = position.shape[:-1]
        tension = np.broadcast_to(self.tension, (*shape, len(self.tension))).copy()
        tension[np.broadcast_to(np.asarray(time) > self.broken_after, shape)] = np.nan
        return ControlSignals(np.zeros_like(position), tension)


def test_a_reference_of_one_s_own_is_followed():
    result = fp.simulate(short(), reference=Hold((0.02, 0.3, 0.5, 0.346)))
    np.testing.assert_array_equal(result.joint_reference, np.broadcast_to([0.02, 0.3, 0.5, 0.346], (21, 4)))
    np.testing.assert_allclose(result.joint_position[0], [0.02, 0.3, 0.5, 0.346], rtol=1e-15)
    np.testing.assert_allclose(result.joint_position[-1], [0.02, 0.3, 0.5, 0.346], atol=0.02)


def test_a_controller_of_one_s_own_is_obeyed():
    """T1 alone pulls: joints 1 and 2 are turned positively with the same radius, against friction and gravity."""
    result = fp.simulate(short(), controller=Constant((4.0, 0.0, 0.0, 0.0, 0.0)), reference=Hold((0.0, 0.5, 0.5, 0.4)))
    np.testing.assert_array_equal(result.tendon_command, np.broadcast_to([4.0, 0, 0, 0, 0], (21, 5)))
    torque = result.joint_torque.values
    np.testing.assert_allclose(torque[:, 0], 8e-3 * (result.tendon_tension[:, 0] - result.tendon_tension[:, 1]))
    assert float(result.joint_position[-1, 0]) > 0.01


@pytest.mark.parametrize("method", METHODS)
def test_progress_rises_to_the_end(method):
    seen = []
    fp.simulate(short(**{"simulation.method": method}), progress=seen.append)
    assert np.all(np.diff(seen) > 0.0)
    assert seen[-1] == pytest.approx(0.02, rel=1e-12)


@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
def test_an_interruption_keeps_what_was_computed(method):
    seen = []
    scenario = short(**{"simulation.method": method})
    with pytest.raises(Interrupted) as caught:
        fp.simulate(scenario, progress=seen.append, stop=lambda: seen[-1] > 0.008)
    error = caught.value
    assert 0.007 < error.time < 0.012
    assert float(error.result.time[-1]) <= error.time < float(error.result.time[-1]) + 1e-3
    whole = fp.simulate(scenario).sel(time=error.result.time)
    np.testing.assert_allclose(error.result.joint_position, whole.joint_position, atol=1e-7)
    assert f"t = {error.time:.6g} s" in str(error)


@pytest.mark.parametrize("method", ["Rodas5P", "Rodas4"])
def test_an_interruption_of_the_compiled_core_keeps_what_was_computed(method, fig6):
    seen = []
    scenario = fp.load_scenario("fig6", {"simulation.method": method})
    with pytest.raises(Interrupted) as caught:
        fp.simulate(scenario, progress=seen.append, stop=lambda: seen[-1] > 2.0)
    error = caught.value
    assert np.all(np.diff(seen) > 0.0) and seen[-1] < 3.0
    assert 1.5 < error.time <= seen[-1]
    assert error.time - 1e-3 < float(error.result.time[-1]) <= error.time
    whole = fig6.sel(time=error.result.time)
    np.testing.assert_allclose(error.result.joint_position, whole.joint_position, atol=1e-3)


@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
def test_a_failed_integration_raises_and_keeps_what_was_computed(method):
    controller = Constant((1.0, 1.0, 4.0, 3.0, 3.0), broken_after=0.01)
    with pytest.raises(IntegrationError) as caught:
        fp.simulate(short(**{"simulation.method": method}), controller=controller)
    error = caught.value
    assert 0.002 < error.time <= 0.011
    assert float(error.result.time[-1]) <= error.time * (1.0 + 1e-9)
    assert len(error.result.time) > 2
    assert np.all(np.isfinite(error.result.joint_position))
    assert error.reason and error.advice in str(error)


def test_a_failure_in_the_first_step_keeps_the_start():
    controller = Constant((1.0, 1.0, 4.0, 3.0, 3.0), broken_after=0.0)
    with pytest.raises(IntegrationError) as caught:
        fp.simulate(short(), controller=controller)
    assert caught.value.time < 1e-3
    assert len(caught.value.result.time) == 1


def test_an_error_in_a_controller_of_one_s_own_is_raised_as_it_is():
    class Broken:
        def command(self, time, reference, position, velocity):
            raise ValueError("not what you think")

    with pytest.raises(ValueError, match="not what you think"):
        fp.simulate(short(), controller=Broken())


def test_a_sampled_controller_is_asked_once_a_period_and_held_between():
    """T1's command counts the calls; samples of the result lie in the middle of the periods."""

    class Counting:
        def __init__(self):
            self.times = []

        def command(self, time, reference, position, velocity):
            self.times.append(time)
            return ControlSignals(np.zeros(4), np.array([len(self.times), 1.0, 4.0, 3.0, 3.0]))

    controller = Counting()
    scenario = short(**{"simulation.sample_rate": 2000.0})
    result = fp.simulate(scenario, controller=controller, control_period=1e-3)
    np.testing.assert_allclose(controller.times, np.arange(20) * 1e-3, atol=1e-15)
    np.testing.assert_array_equal(result.tendon_command[1::2, 0], np.arange(1, 21))
    assert float(abs(result.energy_residual).max()) < 1e-5 * float(abs(result.energy_exchanged_actuators).max())


def test_a_sampled_controller_approaches_the_continuous_one_in_proportion_to_its_period(fig6_runs):
    scenario = fp.load_scenario("fig6", {"simulation.duration": 0.15})
    reference = fig6_runs["Rodas5P"].joint_position
    differences = [
        float(abs(fp.simulate(scenario, control_period=period).joint_position - reference).max())
        for period in (1e-3, 1e-4)
    ]
    assert differences[0] < 0.01 * float(np.ptp(reference.values, axis=0).max())
    assert 7.0 < differences[0] / differences[1] < 14.0


@pytest.mark.parametrize(
    ("period", "method", "entry"), [(0.0, "Rodas5P", "control_period"), (1e-3, "BDF", "simulation.method")]
)
def test_a_control_period_that_cannot_be_is_refused_by_name(period, method, entry):
    with pytest.raises(InputError) as caught:
        fp.simulate(short(**{"simulation.method": method}), control_period=period)
    assert caught.value.entry == entry


def test_a_finger_without_passive_tendon_has_no_passive_variables(tmp_path):
    path = tmp_path / "planar.toml"
    path.write_text(
        'finger = "planar"\n[controller]\nkind = "proportional"\n'
        "[reference.joints.proximal]\noffset = 0.3\n[simulation]\nduration = 0.01\n"
    )
    result = fp.simulate(fp.load_scenario(path))
    assert not [name for name in result if name.startswith("passive")]
    assert result.tendon_tension.shape == (11, 3)
    assert float(abs(result.energy_residual).max()) < 1e-10
    fp.save(result, tmp_path / "r.nc")
    xr.testing.assert_identical(fp.load_result(tmp_path / "r.nc"), result)


def test_two_passive_tendons_get_a_dimension_of_their_own():
    """The passive tendon of the paper's finger doubled: each of the two carries its own tension."""
    table = fp.load_scenario("fig6", {"simulation.duration": 0.01}).model_dump()
    tendons = table["finger"]["tendons"]
    tendons["T6"] = {
        "kind": "passive",
        "curvature_offset": 0.3,
        "crossings": {"proximal": {"radius": -3e-3}, "medial": {"radius": 3e-3}},
    }
    # The medial joint then follows the proximal one.
    del table["reference"]["joints"]["medial"]
    result = fp.simulate(fp.Scenario.model_validate(table))
    assert list(result.passive_tendon.values) == ["T5", "T6"]
    for name in ("passive_position", "passive_velocity", "passive_tension_proximal"):
        assert result[name].dims == ("time", "passive_tendon")
    assert list(result.tendon.values) == ["T1", "T2", "T3", "T4", "T5", "T6"]
    planned = 5e4 * 3e-3 * (result.joint_reference[:, 1] - result.joint_reference[:, 2])
    np.testing.assert_allclose(planned, 1.0, rtol=1e-9)
    assert float(abs(result.energy_residual).max()) < 1e-9


def test_an_observer_sees_rising_times_and_the_signals_of_the_dynamics_and_changes_nothing():
    scenario = short()
    seen = []
    observed = fp.simulate(scenario, observe=lambda time, signals: seen.append((time, signals)))
    np.testing.assert_array_equal(observed.joint_position, fp.simulate(scenario).joint_position)
    times = [time for time, _ in seen]
    assert len(times) > 3 and np.all(np.diff(times) > 0.0) and times[-1] == observed.end_time
    signals = seen[-1][1].finger
    np.testing.assert_allclose(signals.state.position, observed.joint_position[-1], rtol=1e-12)
    np.testing.assert_allclose(signals.joints.reaction, observed.joint_reaction[-1], rtol=1e-9)


def test_names_and_paths_will_do_for_a_scenario_and_a_finger(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text('extends = "fig6"\n[simulation]\nduration = 0.002\n', encoding="utf-8")
    expected = fp.simulate(fp.load_scenario(path))
    assert fp.simulate(path).equals(expected) and fp.simulate(str(path)).equals(expected)
    with pytest.raises(fp.InputError, match="did you mean fig6"):
        fp.simulate("fgi6")
    assert fp.Finger("ub").description == fp.load_finger("ub")
    with pytest.raises(fp.InputError, match="no such finger"):
        fp.Finger("no_such_hand")
