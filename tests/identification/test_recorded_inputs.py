"""Inputs as people record them: with a wrong zero, a wrong gain or late, as parts of a supply, several in one file."""

import numpy as np
import pytest
from intervals import COULOMB, DRAG, MOTION, STEADY, TURN, motion, readings
from scipy.integrate import solve_ivp

import finger_pin as fp
from finger_pin.description.loading import load_bench
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.description.validation import validate
from finger_pin.identification.residuals.models import fitted_residuals
from finger_pin.identification.residuals.recordings import read_recording

BENT = {"finger.tendons.T1.curvature_offset": TURN}


def column(what):
    return f"recordings.pull.tendon_command.T1.{what}"


def test_the_zero_and_the_gain_of_what_pulls_are_found_from_steady_readings():
    data = readings(np.random.default_rng(1), 0.15, 0.4, 0.0)
    data["in"] = (data["in"] - 0.3) / 1.1
    bounds = {COULOMB: (0.01, 0.5), column("offset"): (-1.0, 1.0), column("scale"): (0.5, 2.0)}
    overrides = {**BENT, DRAG: 0.4}
    found = fp.identify(
        "canal", parameters=bounds, recordings={"pull": STEADY}, data={"pull": data}, overrides=overrides, starts=1
    )
    true = [0.15, 0.3, 1.1]
    # Within three standard deviations, as a regression of these tables has them.
    assert np.all(np.abs(found.estimate.values - true) < [0.003, 0.08, 0.01]) and found.determined.all()
    assert list(found.units.values) == ["1", "N", "1"]


@pytest.mark.slow
def test_how_late_an_input_is_and_its_wrong_zero_are_found_from_a_motion():
    """The motion is integrated apart from the package; the load cell of the pull tells 0.2 N too little, 20 ms late."""
    data = motion(np.random.default_rng(2), 0.15, 0.4, 0.0)
    data["in"] = 6.0 - 6.0 * np.cos(2.0 * np.pi * 0.4 * (data["t"] - 0.02)) - 0.2
    bounds = {COULOMB: (0.01, 0.5), column("offset"): (-1.0, 1.0), column("delay"): (-0.1, 0.1)}
    found = fp.identify(
        "canal",
        parameters=bounds,
        recordings={"pull": {**MOTION, "settle": 0.2}},
        data={"pull": data},
        overrides={**BENT, DRAG: 0.4},
        starts=1,
    )
    assert found.estimate.values == pytest.approx([0.15, 0.2, 0.02], rel=0.05)
    assert list(found.units.values) == ["1", "N", "s"]


@pytest.mark.slow
def test_a_stop_is_found_though_where_the_search_starts_nothing_touches_it():
    """The drum is pulled to 1.8 rad and stopped at 1.2: a stop at 4 rad, where the scenario has it, is not felt."""
    time = np.arange(0.0, 3.5, 0.02)
    pull = 6.0 * time
    made = fp.simulate(
        fp.load_scenario("canal", {"finger.joints.drum.range": [-1.0, 1.2], "simulation.sample_rate": 50.0}),
        controller=(time, {"T1": pull}),
    )
    angle = made.joint_position.sel(joint="drum").values[: len(time)]
    stop = "finger.joints.drum.range[1]"
    told = {"time": "t", "inputs": {"tendon_command.T1": "in"}, "outputs": {"joint_position.drum": "angle"}}
    data = {"t": time, "in": pull, "angle": angle + np.random.default_rng(3).normal(0.0, 1e-3, len(time))}
    found = fp.identify(
        "canal", parameters={stop: (0.5, 4.0)}, recordings={"pull": told}, data={"pull": data}, profiles=False
    )
    assert float(found.estimate[0]) == pytest.approx(1.2, abs=2e-3)


@pytest.mark.parametrize(
    ("viscous", "rows", "rings"), [(0.0, 400, True), (0.0, 60, False), (2e-3, 400, False)], ids=["", "short", "damped"]
)
def test_what_rings_undamped_is_said_only_where_steps_follow_it(viscous, rows, rings):
    """Undamped, four seconds take four times the steps of a damped drum, and the first half second 1.4 times."""
    data = motion(np.random.default_rng(6), 0.15, 0.4, 0.0)
    entries = {"parameters": {COULOMB: (0.1, 0.2)}, "recordings": {"pull": MOTION}}
    scenario, settings = load_bench("canal", {**BENT, DRAG: 0.4, "finger.joint_friction.viscous": viscous}, entries)
    table = {name: values[:rows] for name, values in data.items()}
    problem = fitted_residuals(scenario, settings, [read_recording("pull", settings.recordings["pull"], table)])
    said = problem.models[0].ringing(problem.models[0].scenario, {})
    assert ("tendon_stiction[T1] rings almost undamped at" in said) == rings and bool(said) == rings


@pytest.mark.slow
def test_a_motor_is_found_under_a_supply_that_sags_beside_its_goal():
    """J w' = K (V(t) - K w) / R - b w of a motor that unwinds a slack cord at the limit of its loop, by scipy."""
    time, motor = np.arange(0.0, 0.4, 0.005), "finger.actuators.servo.motor."
    supply = 7.0 - 6.0 * time

    def rates(t, x):
        return x[1], (-0.5 * (7.0 - 6.0 * t + 0.5 * x[1]) / 5.0 - 0.01 * x[1]) / 2e-3

    angle = solve_ivp(rates, (0.0, 0.4), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    overrides = {
        "finger.actuators.servo.motor": {
            **{"voltage": 7.0, "torque_constant": 0.4, "resistance": 5.0, "maximum_current": 3.0, "inertia": 2e-3},
            **{"friction": {"coulomb": 0.0, "viscous": 0.01}, "encoder": {"range": [-60.0, 9.0]}},
        },
        "finger.actuators.servo.position_loop": {"proportional": 3.0, "period": 0.001},
    }
    found = []
    for inputs in ({"spool_angle.servo": "goal"}, {"spool_angle.servo": "goal", "supply_voltage.servo": "volts"}):
        told = {"time": "t", "inputs": inputs, "outputs": {"motor_position.servo": "angle"}}
        data = {"t": time, "goal": np.full_like(time, -50.0), "volts": supply, "angle": angle}
        result = fp.identify(
            "wound",
            parameters={motor + "torque_constant": (0.2, 0.9)},
            recordings={"free": told},
            data={"free": data},
            overrides=overrides,
            starts=1,
            profiles=False,
            refits=False,
        )
        found.append(float(result.estimate[0]))
    assert found[1] == pytest.approx(0.5, rel=5e-3) and abs(found[0] - 0.5) > 0.05, found


@pytest.mark.slow
def test_a_motor_is_found_from_the_speeds_that_a_servo_in_velocity_mode_was_sent():
    """PI on the speed, U = V (k_d (w* - w) + k_i int (w* - w)), of a motor that unwinds a slack cord, by scipy."""
    time = np.arange(0.0, 0.6, 0.005)
    speed = -np.select([time < 0.2, time < 0.4], [2.0, 6.0], 3.0)

    def rates(t, x):
        error = speed[np.searchsorted(time, t, side="right") - 1] - x[1]
        voltage = 7.0 * (0.05 * error + 0.5 * x[2])
        return x[1], (0.5 * (voltage - 0.5 * x[1]) / 5.0 - 0.01 * x[1]) / 2e-3, error

    angle = solve_ivp(rates, (0.0, 0.6), [0.3, 0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12, max_step=1e-3).y[0]
    overrides = {
        "finger.actuators.servo.motor": {
            **{"voltage": 7.0, "torque_constant": 0.4, "resistance": 5.0, "maximum_current": 3.0, "inertia": 2e-3},
            **{"friction": {"coulomb": 0.0, "viscous": 0.01}, "encoder": {"range": [-60.0, 9.0]}},
        },
        "finger.actuators.servo.position_loop": {"proportional": 0.5, "derivative": 0.05, "period": 0.0005},
    }
    goal = {"column": "speed", "unit": "deg/s", "integrate": True}
    told = {"time": "t", "inputs": {"spool_angle.servo": goal}, "outputs": {"motor_position.servo": "angle"}}
    result = fp.identify(
        "wound",
        parameters={"finger.actuators.servo.motor.torque_constant": (0.2, 0.9)},
        recordings={"free": told},
        data={"free": {"t": time, "speed": np.rad2deg(speed), "angle": angle - 0.3}},
        overrides=overrides,
        starts=1,
        profiles=False,
        refits=False,
    )
    assert float(result.estimate[0]) == pytest.approx(0.5, rel=0.01)


def test_the_integral_of_a_speed_begins_where_the_motor_stands():
    told = {"inputs": {"spool_angle.M1": {"column": "pwm", "integrate": True}}}
    # Rows 0 and 0.1 s: 50 rad/s for 0.1 s.
    np.testing.assert_allclose(recording(told).inputs["spool_angle.M1"], [0.0, 5.0])
    moved = told | {"outputs": {"motor_position.M1": {"column": "angle", "offset": 0.7}}}
    np.testing.assert_allclose(recording(moved).inputs["spool_angle.M1"], [0.7, 5.7])
    with pytest.raises(fp.InputError, match=r"motor_voltage\.M1\.integrate = true: is for inputs spool_angle and"):
        recording({"inputs": {"motor_voltage.M1": {"column": "pwm", "integrate": True}}})


@pytest.mark.parametrize(
    ("column", "values", "what", "bounds", "said"),
    [
        (
            "supply_voltage",
            4.5,
            "scale",
            (0.9, 1.2),
            r"scale = 1\.2: .*supply_voltage\.servo.* reaches .* beyond 0 V to",
        ),
        ("supply_voltage", 0.3, "offset", (-0.5, 0.5), r"offset = -0\.5: .*supply_voltage\.servo.* reaches from -0\.2"),
        ("motor_voltage", 4.5, "scale", (0.9, 1.2), r"scale = 1\.2: controller\.motor_voltage\.servo.* reaches 5\.4 V"),
        (
            "spool_angle",
            2.0,
            "scale",
            (0.9, 1e5),
            r"scale = 100000: finger.*encoder\.range.* the motion takes the spool",
        ),
    ],
)
def test_bounds_of_a_column_that_its_motor_cannot_follow_are_refused_before_the_search(
    column, values, what, bounds, said
):
    time = np.arange(0.0, 1.0, 0.1)
    inputs = {f"{column}.servo": "in"} | ({"spool_angle.servo": "goal"} if column == "supply_voltage" else {})
    told = {"time": "t", "inputs": inputs, "outputs": {"motor_position.servo": "angle"}}
    data = {"one": {"t": time, "goal": time, "in": np.full_like(time, values), "angle": time}}
    parameters = {f"recordings.one.{column}.servo.{what}": bounds}
    with pytest.raises(
        fp.InputError, match=rf"^identify\.recordings\.one\.parameters\.{column}\.servo\..*with .*{said}"
    ):
        fp.identify("wound", parameters=parameters, recordings={"one": told}, data=data)


PWM = {
    "time": "t",
    "rows": {"trial": "slow"},
    "inputs": {"motor_voltage.M1": {"column": "pwm", "scale": 0.01, "supply": "volts"}},
    "outputs": {"motor_position.M1": "angle"},
}
TABLE = {
    "trial": ["slow", "fast", "slow"],
    "t": [0.0, 0.0, 0.1],
    "pwm": [50.0, 80.0, -100.0],
    "volts": [7.0, 7.2, 6.0],
    "angle": [0.0, 0.1, 0.2],
}


def recording(change):
    return read_recording("one", validate(RecordingSettings, PWM | change, ("identify", "recordings", "one")), TABLE)


def test_a_pulse_width_is_its_part_of_the_supply_in_the_rows_of_its_trial():
    np.testing.assert_allclose(recording({}).inputs["motor_voltage.M1"], [3.5, -6.0])
    np.testing.assert_array_equal(recording({}).outputs["motor_position.M1"], [0.0, 0.2])
    np.testing.assert_array_equal(
        recording({"rows": {"volts": 6.0}, "kind": "steady", "time": None, "speed": 1.0}).speed, [1.0]
    )


@pytest.mark.parametrize(
    "change, said",
    [
        ({"rows": {"trail": "slow"}}, r"rows\.trail: no such column; there are trial.*did you mean trial"),
        ({"rows": {"trial": "slwo"}}, r"rows\.trial = .slwo.: no row has it; there are slow, fast"),
        ({"rows": {"trial": "fast", "t": 0.1}}, "rows: no row has all of them"),
        (
            {"inputs": {"spool_angle.M1": {"column": "pwm", "supply": "volts"}}},
            r"inputs\.spool_angle\.M1\.supply = .volts.: is for a part of a voltage, without a unit",
        ),
        (
            {"inputs": {"motor_voltage.M1": {"column": "pwm", "unit": "V", "supply": "volts"}}},
            "is for a part of a voltage, without a unit",
        ),
        (
            {"inputs": {"motor_voltage.M1": {"column": "pwm", "supply": "battery"}}},
            r"motor_voltage\.M1\.supply = .battery.: no such column",
        ),
    ],
)
def test_rows_and_supplies_that_are_not_there_are_refused_by_their_entry(change, said):
    with pytest.raises(fp.InputError, match=said):
        recording(change)


def test_what_a_motion_cannot_be_given_is_refused_with_what_it_can():
    told = {**MOTION, "inputs": {"motor_position.M1": "in"}}
    data = {"pull": dict.fromkeys(("t", "in", "out", "angle"), 0.1 * np.arange(5.0))}
    with pytest.raises(
        fp.InputError, match=r"inputs\.motor_position\.M1: a motion is given tendon_command, spool_angle"
    ):
        fp.identify("canal", parameters={COULOMB: (0.01, 0.5)}, recordings={"pull": told}, data=data)


@pytest.mark.slow
def test_the_difference_of_two_tensions_is_compared_with_a_column():
    key, truth = "finger.tendon_friction.coulomb", 0.13
    run = fp.simulate(fp.load_scenario("reversals", {key: truth, "simulation.duration": 0.3}))
    first, second = (run.tendon_tension.sel(tendon=name).values for name in ("T1", "T2"))
    data = {"both": {"t": run.time.values, "torque": 8e-3 * (first - second)}}
    column = {"column": "torque", "scale": 125.0}
    both = {"time": "t", "outputs": {"tendon_tension.T1-T2": column}}
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.3})
    found = fp.identify(scenario, parameters={key: [0.05, 0.3]}, recordings={"both": both}, data=data, starts=1)
    np.testing.assert_allclose(found.estimate, truth, rtol=1e-3)
    both["outputs"] = {"tendon_tension.T1-T9": column}
    with pytest.raises(fp.InputError, match=r"there is no T9; there are .* and A-B for a difference"):
        fp.identify(scenario, parameters={key: [0.05, 0.3]}, recordings={"both": both}, data=data, starts=1)
