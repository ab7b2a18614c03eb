"""The observer against runs whose truth is known, against the equations of its filter, and with bad readings."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.description.loading import ParametrisedScenario
from finger_pin.exceptions import InputError
from finger_pin.observation import record

TOUCHED = {"kind": "points", "times": [1.0, 1.05, 1.4, 1.45], "values": [0.0, -1.0, -1.0, 0.0]}


def readings_of(run):
    """Return times and columns as a motor tells them, in steps of its encoder and of 1 mA."""
    angle = np.round(run.motor_position.values[:, 0] / 0.00153) * 0.00153
    current = np.round(run.motor_current.values[:, 0] / 1e-3) * 1e-3
    return run.time.values, {"motor_position.servo": angle, "motor_current.servo": current}


@pytest.fixture(scope="module")
def run():
    return fp.simulate(fp.load_scenario("wound", {"simulation.duration": 2.5}))


@pytest.fixture(scope="module")
def observed(run):
    return fp.observe("wound", readings_of(run))


def rms(values):
    return np.sqrt(np.mean(np.asarray(values) ** 2, axis=0))


def test_a_true_model_gives_angles_and_tensions_that_no_sensor_reads(run, observed):
    # Joints turn by 1.2 rad and cords pull up to 9 N.
    assert (rms(observed.joint_position.values - run.joint_position.values[1:]) < 0.04).all()
    assert (rms(observed.tendon_tension.values - run.tendon_tension.values[1:]) < 0.8).all()
    assert (rms(observed.spool_tension.values - run.spool_tension.values[1:]) < 1.0).all()
    # Also where the slack cord gets taut.
    assert float(observed.spool_tension.sel(time=slice(0.3, 1.0)).max()) < 4.0
    assert not observed.touched.any()
    assert observed.consistency[-1] < 1.5


def test_bands_hold_what_fingers_with_other_numbers_do():
    observer = fp.observe("wound")
    family = ParametrisedScenario(fp.load_scenario("wound", {"simulation.duration": 2.5}), observer.uncertainty.keys)
    inside, errors, halves = [], [], []
    for seed in range(3):
        draw = np.random.default_rng(seed).standard_normal(len(family.keys))
        values = observer.uncertainty.values + observer.uncertainty.deviations * draw
        truth = fp.simulate(family.with_values(values.tolist()))
        result = fp.observe("wound", readings_of(truth))
        position = truth.joint_position.values[1:]
        inside.append((position >= result.joint_position_low.values) & (position <= result.joint_position_high.values))
        errors.append(result.joint_position.values - position)
        halves.append(0.5 * (result.joint_position_high - result.joint_position_low).values)
    assert np.mean(inside) > 0.85
    assert (rms(np.concatenate(errors)) < 0.1).all()
    assert (np.concatenate(halves).mean(axis=0) / 1.96 / rms(np.concatenate(errors)) < 4.0).all()


def test_an_estimate_that_cannot_be_predicted_stays_and_says_why():
    """A current of 1 MA drives the spool beyond every physical range within a period."""
    observer = fp.observe("wound")
    observer.start()
    readings = {"motor_current.servo": 0.0, "motor_position.servo": 0.0}
    for _ in range(3):
        before = observer.step(readings)
    failed = observer.step({"motor_current.servo": 1e6, "motor_position.servo": np.nan})
    assert "motor_velocity[servo]" in failed.failure and not before.failure
    assert np.array_equal(failed.joint_position.value, before.joint_position.value)
    assert (failed.joint_position.high >= before.joint_position.high).all()
    assert failed.time == pytest.approx(before.time + observer.period)
    # The jump of the current is of this period and the next.
    assert [bool(observer.step(readings).failure) for _ in range(2)] == [True, False]


def test_a_force_at_the_tip_is_seen_soon_and_gone_soon():
    truth = fp.simulate(
        fp.load_scenario("wound", {"simulation.duration": 2.5, "environment.fingertip_force_signal.y": TOUCHED})
    )
    result = fp.observe("wound", readings_of(truth))
    touched = result.time.values[result.touched.values]
    assert 1.0 < touched[0] < 1.1
    assert 1.3 < touched[-1] < 1.6
    # It presses against the flexing finger, and its own direction alone is felt by the cord.
    pressed = result.fingertip_force.sel(time=1.3, method="nearest").values
    assert pressed[1] < -0.1


def test_a_filter_step_is_that_of_schmidt(run):
    observer = fp.observe("wound")
    _times, columns = readings_of(run)
    for k in range(1, 400):
        observer.step({name: values[k] for name, values in columns.items()})
    before, state = observer._covariance.copy(), observer._periods.x.copy()
    observer._periods.limit_bristles()
    observer.step({name: values[400] for name, values in columns.items()})
    derivatives, filters = observer._periods.derivatives, observer._filter
    n, u, p = len(state), 1, len(observer.uncertainty.keys)
    a = np.eye(n + 3 + p)
    a[:n, :n], a[:n, n : n + 3], a[:n, n + 3 :] = (
        derivatives[:, :n],
        derivatives[:, n + u : n + u + 3],
        derivatives[:, n + u + 3 :],
    )
    a[n : n + 3, n : n + 3] = np.diag(filters.decay)
    predicted = a @ before @ a.T
    predicted[:n, :n] += np.outer(derivatives[:, n], derivatives[:, n]) * filters.input_variance[0]
    predicted[: n + 3, : n + 3] += np.diag(filters.noise)
    row = np.arange(n + 3 + p) == filters.places[0]
    gain = predicted[:, row][:, 0] / (predicted[row, row][0] + filters.variance[0])
    gain[n + 3 :] = 0.0
    # No correction is longer than it may be.
    innovation = filters.innovations[0] * np.sqrt(predicted[row, row][0] + filters.variance[0])
    gain *= min(1.0, np.min(filters.reach / np.abs(gain[:n] * innovation)))
    rest = np.eye(n + 3 + p) - np.outer(gain, row)
    expected = rest @ predicted @ rest.T + filters.variance[0] * np.outer(gain, gain)
    # Bristles are no less certain than their levels.
    kept = np.ones(len(expected))
    kept[:n] = np.minimum(1.0, filters.levels / np.sqrt(expected.diagonal()[:n]))
    expected *= np.outer(kept, kept)
    scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    assert np.abs((observer._covariance - expected) / scale).max() < 2e-3
    np.testing.assert_array_equal(observer._covariance[n + 3 :, n + 3 :], np.diag(observer.uncertainty.deviations**2))


def test_bad_readings_are_skipped_and_counted(run):
    times, columns = readings_of(run)
    times, columns = times.copy(), {name: values.copy() for name, values in columns.items()}
    columns["motor_position.servo"][300:310] = np.nan
    columns["motor_current.servo"][600:603] = np.nan
    columns["motor_position.servo"][900] = 50.0
    times[1200] = times[1100]
    times[1201] = np.nan
    kept = np.r_[0:1500, 1600 : len(times)]
    result = fp.observe("wound", (times[kept], {name: values[kept] for name, values in columns.items()}))
    assert result.attrs["skipped"] == ["motor_position.servo: 11", "motor_current.servo: 3"]
    assert result.attrs["left_out"] == ["1 rows without a time", "1 rows whose clock went back"]
    truth = run.joint_position.interp(time=result.time).values
    assert (rms(result.joint_position.values - truth) < 0.03).all()


def test_a_missing_current_is_held_and_may_be_anything_to_twice_its_size(run):
    observer = fp.observe("wound", sensors={"motor_current.servo": {"noise": 1e-3}})
    for current in (0.25, 0.3, np.inf, np.nan):
        observer.step({"motor_position.servo": 0.0, "motor_current.servo": current})
    assert observer._periods.inputs[0] == pytest.approx(0.3)
    assert observer._filter.input_variance[0] == pytest.approx(1e-6 + 0.6**2 / 12.0)


def test_an_observer_without_forces_and_one_of_rare_readings_tell_angles(run):
    times, columns = readings_of(run)
    rare = times[::10], {name: values[::10] for name, values in columns.items()}
    result = fp.observe("wound", rare, forces=())
    assert result.sizes.get("fingertip", 0) == 0
    truth = run.joint_position.sel(time=result.time, method="nearest").values
    assert (rms(result.joint_position.values - truth) < 0.04).all()


def test_deviations_of_bristles_stay_within_their_levels(run):
    observer, (_, columns) = fp.observe("wound"), readings_of(run)
    for k in range(1, 300):
        observer.step({name: values[k] for name, values in columns.items()})
    bent = slice(2 * observer.finger.mechanism.coordinates, None)
    levels = observer._periods.limit_bristles()
    deviations = np.sqrt(observer._covariance.diagonal()[: len(levels)])
    assert (deviations <= levels * (1.0 + 1e-6)).all()
    assert (levels[bent] < observer.finger.layout.scales()[bent]).any()


def test_motor_that_stands_still_tells_nothing_of_a_force(observed):
    assert (observed.fingertip_force_observable.sel(time=0.15, method="nearest") < 0.05).all()
    assert float(observed.fingertip_force_observable.sel(time=1.3, method="nearest").max()) > 0.2


def test_a_finger_with_ideal_sources_is_driven_by_their_tensions():
    truth = fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.5}))
    pulled = truth.tendon_command.sel(tendon=["T1", "T2", "T3", "T4"])
    tensions = {f"tensions.{name}": pulled.sel(tendon=name) for name in pulled.tendon.values}
    result = fp.observe("reversals", (truth.time.values, {name: values.values for name, values in tensions.items()}))
    assert "spool_tension" not in result
    assert (rms(result.joint_position.values - truth.joint_position.values[1:]) < 0.05).all()


def test_readings_that_are_all_beyond_belief_make_the_model_inconsistent(run):
    times, columns = readings_of(run)
    columns["motor_position.servo"] = columns["motor_position.servo"] + np.where(np.arange(len(times)) % 5, 20.0, 0.0)
    result = fp.observe("wound", (times[:300], {name: values[:300] for name, values in columns.items()}))
    assert float(result.consistency.max()) > 3.0


def test_a_joint_encoder_narrows_its_band(run, observed):
    times, columns = readings_of(run)
    columns["joint_position.mcp"] = run.joint_position.sel(joint="mcp").values
    result = fp.observe("wound", (times, columns), sensors={"joint_position.mcp": {"noise": 1e-3}})
    width = (result.joint_position_high - result.joint_position_low).mean("time")
    without = (observed.joint_position_high - observed.joint_position_low).mean("time")
    assert float(width.sel(joint="mcp")) < 0.2 * float(without.sel(joint="mcp"))


def test_intervals_of_an_identification_are_its_uncertainty():
    parameters = ["finger.tendon_friction.coulomb", "finger.joints.mcp.spring.stiffness"]
    fit = xr.Dataset(
        {"lower": ("parameter", [0.14, 0.07]), "upper": ("parameter", [0.16, 0.09])}, {"parameter": parameters}
    )
    uncertainty = fp.observe("wound", uncertain=fit).uncertainty
    assert list(uncertainty.keys) == parameters
    np.testing.assert_allclose(uncertainty.deviations, np.array([0.02, 0.02]) / 2.0 / 1.96)
    fit["upper"][0] = np.inf
    with pytest.raises(InputError, match="open end"):
        fp.observe("wound", uncertain=fit)


def test_stars_stand_for_each_number_alone():
    observer = fp.observe("wound", uncertain={"finger.joints.*.spring.stiffness": 0.1})
    assert [key.split(".")[2] for key in observer.uncertainty.keys] == ["mcp", "pip", "dip"]
    np.testing.assert_allclose(observer.uncertainty.deviations, [0.008, 0.005, 0.003])


def test_a_record_keeps_its_size_and_its_whole_time(run, monkeypatch):
    monkeypatch.setattr(record, "_MOST_ROWS", 100)
    result = fp.observe("wound", readings_of(run))
    assert result.sizes["time"] <= 100
    assert result.attrs["stride"] == 32
    np.testing.assert_allclose(np.diff(result.time), 0.032, rtol=1e-9)
    assert float(result.time[0]) < 0.002 and float(result.time[-1]) > 2.5 - 0.033


def test_a_file_with_other_names_and_units_is_read(run, tmp_path: Path):
    times, columns = readings_of(run)
    table = np.column_stack(
        [1e3 * times, np.degrees(columns["motor_position.servo"]), 1e3 * columns["motor_current.servo"]]
    )
    path = tmp_path / "log.csv"
    np.savetxt(path, table[:300], delimiter=",", header="ticks,angle,current", comments="")
    names = {
        "motor_position.servo": {"column": "angle", "unit": "deg"},
        "motor_current.servo": {"column": "current", "unit": "mA"},
    }
    result = fp.observe("wound", {"path": str(path), "time": {"column": "ticks", "unit": "ms"}, "columns": names})
    expected = fp.observe("wound", (times[:300], {name: values[:300] for name, values in columns.items()}))
    np.testing.assert_allclose(result.joint_position, expected.joint_position, atol=1e-9)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"period": 0.0}, "period = 0.0: must be above 0"),
        ({"level": 1.0}, "level = 1.0: must be above 0 and below 1"),
        ({"forces": ["thumb"]}, "forces.thumb: no such tip"),
        ({"forces": {"fingertip": -1.0}}, "forces.fingertip = -1.0: must be above 0 N"),
        ({"uncertain": {"finger.tendon_friction.coulom": 0.1}}, "finger.tendon_friction.coulom"),
        ({"uncertain": {"finger.tendon_friction.coulomb": -0.1}}, "must be a part of the value, at least 0"),
        ({"sensors": {"motor_position.serwo": {}}}, "sensors.motor_position.serwo: no such sensor"),
        ({"sensors": {"motor_position.servo": {"gain": 1.0}}}, "must be resolution or noise"),
        ({"sensors": {"motor_position.servo": {"noise": 0.0, "resolution": 0.0}}}, "nothing reads exactly"),
    ],
)
def test_wrong_arguments_are_named(settings, message):
    with pytest.raises(InputError, match=message):
        fp.observe("wound", **settings)


def test_wrong_readings_are_named():
    observer = fp.observe("wound")
    with pytest.raises(InputError, match=r"must have motor_current.servo: the model is driven by it"):
        observer.step({"motor_position.servo": 0.0})
    with pytest.raises(InputError, match=r"readings.motor_angle.servo: nothing reads that"):
        observer.step({"motor_angle.servo": 0.0, "motor_current.servo": 0.0})
    with pytest.raises(InputError, match="no such motor"):
        observer.start(motor_position={"serwo": 0.0})
