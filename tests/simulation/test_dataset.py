"""The Dataset of a run: the variables of the interface, their units, and what they must obey; its file."""

import netCDF4
import numpy as np
import pinocchio as pin
import pytest
import xarray as xr

import finger_pin as fp

pytestmark = pytest.mark.slow

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
    return fp.load_scenario("reversals", {"simulation.duration": duration} | settings)


@pytest.fixture(scope="module", params=["Rodas5P", "Radau"])
def result(request, fig6_runs):
    """The start of reversals by the compiled core and by the textbook path."""
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
    body = fp.Finger(fp.load_finger("ub_stand_in")).rigid_body
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


def test_attributes_say_how_the_result_was_made(result):
    attributes = result.attrs
    assert attributes["method"] in ("Rodas5P", "Radau")
    assert (attributes["rtol"], attributes["atol_scale"]) == (1e-6, 1e-6)
    for name in ("steps", "evaluations", "jacobians", "factorisations"):
        assert attributes[f"solver_{name}"] > 0
    assert attributes["solver_wall_time"] > 0.0
    assert attributes["version_pin"] and attributes["version_finger_pin"]
    assert "minimum_tension = 1.0" in attributes["scenario"]


def test_a_result_survives_its_file(result, tmp_path):
    path = tmp_path / "trajectory.nc"
    fp.save(result, path)
    loaded = fp.load(path)
    xr.testing.assert_identical(loaded, result)
    with netCDF4.Dataset(path) as raw:
        assert raw.data_model == "NETCDF4"
        assert raw["tendon_tension"].units == "N"


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
    xr.testing.assert_identical(fp.load(tmp_path / "r.nc"), result)


def test_two_passive_tendons_get_a_dimension_of_their_own():
    """The passive tendon of the paper's finger doubled: each of the two carries its own tension."""
    table = fp.load_scenario("reversals", {"simulation.duration": 0.01}).model_dump()
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
