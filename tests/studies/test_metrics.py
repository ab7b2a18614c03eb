"""Metrics against numbers worked out by hand, and against the energy account."""

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.analysis import largest_force
from finger_pin.description.actuators import Winding
from finger_pin.studies.metrics import FORCE_TENSION, METRICS, Metric, Run, resolve_metrics, scenario_metrics

# Uneven times: means over samples would be others.
TIME = np.array([0.0, 1.0, 2.0, 6.0])


@pytest.fixture(scope="module")
def made():
    """A run whose signals are written down here."""
    run = Run(fp.load_scenario("reversals"))
    run.result = xr.Dataset(
        {
            "tracking_error": (("time", "joint"), [[0.3, 0.0], [0.3, 0.0], [-0.3, -0.4], [-0.3, -0.4]]),
            "tendon_tension": (("time", "tendon"), [[1.0, 3.0], [0.0, 3.0], [0.0, 3.0], [4.0, 3.0]]),
            "tendon_command": (("time", "tendon"), [[1.0, 99.0], [5.0, 99.0], [1.0, 99.0], [1.0, 99.0]]),
            "passive_tension_proximal": ("time", [2.0, 7.0, 2.0, 2.0]),
        },
        {"time": TIME, "joint": ["a", "b"], "tendon": ["T1", "T2"]},
    )
    return run


def test_the_rms_error_is_a_mean_over_time(made):
    squares = np.array([0.09, 0.09, 0.25, 0.25]) / 2
    integral = 0.5 * (squares[:-1] + squares[1:]) @ np.diff(TIME)
    assert METRICS["tracking_rms"].measure(made) == pytest.approx(np.sqrt(integral / 6.0))


def test_the_peak_error_counts_both_signs(made):
    assert METRICS["tracking_peak"].measure(made) == 0.4


def test_the_peak_tension_is_at_any_end_but_not_what_is_planned_for_a_passive_tendon(made):
    assert METRICS["tension_peak"].measure(made) == 7.0
    made.result["passive_tension_proximal"][1] = 2.0
    assert METRICS["tension_peak"].measure(made) == 5.0


def test_the_mean_tension_is_over_time_and_tendons(made):
    # T1: 0.5 in the first second, 0 in the second one, 2 in the last four; T2: 3.
    assert METRICS["tension_mean"].measure(made) == pytest.approx(0.5 * ((0.5 + 0.0 + 8.0) / 6.0 + 3.0))


def test_slack_time_counts_from_half_an_interval_before_to_half_after(made):
    assert METRICS["slack_time"].measure(made) == pytest.approx(0.5 + 1.0 + 2.0)


def test_losses_are_what_was_supplied_and_not_stored():
    run = Run(fp.load_scenario("reversals", {"simulation.duration": 0.1}))
    result = run.result
    stored = ("kinetic", "gravity", "passive_tendon", "limiter", "joint_springs", "tendon_bristles", "joint_bristles")
    gain = sum(float(result[f"energy_{name}"][-1] - result[f"energy_{name}"][0]) for name in stored)
    supplied = float(result["energy_exchanged_actuators"][-1])
    assert METRICS["losses"].measure(run) == pytest.approx(supplied - gain, rel=1e-4)
    parts = METRICS["losses_tendons"].measure(run) + METRICS["losses_joints"].measure(run)
    assert 0.0 < parts <= METRICS["losses"].measure(run) * (1.0 + 1e-12)


def test_the_self_locking_margin_falls_as_the_joints_friction_grows():
    margins = [
        METRICS["self_locking_margin"].measure(
            Run(fp.load_scenario("reversals", {"finger.joint_friction.stiction": static}))
        )
        for static in (3.5e-4, 7.0e-4)
    ]
    # M^c is scaled until it locks: twice the friction is half the factor.
    assert margins[0] == pytest.approx(2.0 * margins[1])


def test_the_fingertip_force_is_possible_in_every_direction_and_no_more_is():
    scenario = fp.load_scenario("reversals")
    force = METRICS["fingertip_force"].measure(Run(scenario))
    finger = fp.Finger(scenario.finger)
    # Whole periods: the mean of every sinusoid is its offset.
    posture = np.array([0.0, 0.6108652381980153, 0.6108652381980153, 0.0])
    posture[3] = (0.0035 * posture[2] - 1.0 / 5e4) / 0.005
    directions = np.random.default_rng(1).normal(size=(60, 3))
    reach = [largest_force(finger, posture, each, FORCE_TENSION) for each in directions]
    assert force <= min(reach)
    assert force > 0.7 * min(reach)


def test_metrics_of_the_statics_simulate_nothing():
    run = Run(fp.load_scenario("reversals"))
    METRICS["self_locking_margin"].measure(run)
    METRICS["fingertip_force"].measure(run)
    assert "result" not in vars(run)


def test_metrics_are_chosen_by_name_and_a_misspelt_one_is_told_the_nearest():
    own = Metric("own", "1", "of one's own", len)
    assert resolve_metrics(["losses", own]) == (METRICS["losses"], own)
    with pytest.raises(fp.InputError, match="did you mean tracking_rms"):
        resolve_metrics(["tracking_rsm"])
    for names in ([], ["losses", "losses"]):
        with pytest.raises(fp.InputError):
            resolve_metrics(names)


def test_a_design_beyond_self_locking_is_measured_without_a_warning():
    """The tests make an error of every warning, so `simulate` alone stops there."""
    friction = {"finger.joint_friction.coulomb": 6e-3, "finger.joint_friction.stiction": 8e-3}
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.02} | friction)
    with pytest.raises(fp.exceptions.SelfLockingWarning):
        fp.simulate(scenario)
    assert METRICS["self_locking_margin"].measure(Run(scenario)) < 1.0
    assert METRICS["tension_peak"].measure(Run(scenario)) > 0.0


@pytest.mark.slow
def test_the_hysteresis_of_a_fingertip_is_the_chord_between_its_two_ways():
    """One joint turns by 0.05 rad less than it is told to, either way: 2 L sin(0.05) at the end of three links."""
    run, time, behind = Run(fp.load_scenario("reversals")), np.linspace(0.0, 4.0, 4001), 0.05
    proximal = np.array([0.0, 1.0, 0.0, 0.0])
    wanted = (0.7 - 0.3 * np.cos(np.pi * time))[:, None] * proximal
    reached = wanted - behind * np.sign(np.sin(np.pi * time))[:, None] * proximal
    data = {"joint_reference": (("time", "joint"), wanted), "joint_position": (("time", "joint"), reached)}
    run.result = xr.Dataset(data, {"time": time, "joint": list(run.scenario.finger.joints)})
    length = 45.0e-3 + 29.9e-3 + 21.8e-3
    assert METRICS["fingertip_hysteresis"].measure(run) == pytest.approx(2.0 * length * np.sin(behind), rel=0.02)
    run.result["joint_position"] = run.result["joint_reference"]
    assert METRICS["fingertip_hysteresis"].measure(run) == 0.0


def open_loop(command):
    """A run of given tensions whose second joint is 0.05 rad behind the first of them, and that tension, N."""
    run, time = Run(fp.load_scenario("wound")), np.linspace(0.0, 4.0, 4001)
    finger = run.scenario.finger
    pull, joints = command(time), list(finger.joints)
    reached = 0.3 * pull - 0.05 * np.sign(np.gradient(pull))
    angles = reached[:, None] * (np.arange(len(joints)) == 1)
    pulls = pull[:, None] * (np.arange(len(finger.tendons)) == 0)
    data = {"joint_position": (("time", "joint"), angles), "tendon_command": (("time", "tendon"), pulls)}
    data["joint_reference"] = data["tracking_error"] = (("time", "joint"), 0.0 * angles)
    run.result = xr.Dataset(data, {"time": time, "joint": joints, "tendon": list(finger.tendons)})
    return run


@pytest.mark.slow
def test_without_a_reference_the_hysteresis_is_that_over_the_command():
    """The chord 2 L sin(0.05) between the ways, L from the joint to the tip; a pull without return has none."""
    run = open_loop(lambda time: 3.0 - np.cos(np.pi * time))
    finger = fp.Finger(run.scenario.finger)
    zero = np.zeros(len(finger.routing.joints))
    length = np.linalg.norm(finger.rigid_body.jacobian(zero)[:, 1])
    assert METRICS["fingertip_hysteresis"].measure(run) == pytest.approx(2.0 * length * np.sin(0.05), rel=0.02)
    with pytest.raises(fp.InputError, match="must move to and fro"):
        METRICS["fingertip_hysteresis"].measure(open_loop(lambda time: 1.0 + time))


def test_what_needs_a_reference_says_so_where_there_is_none():
    """No metric of joints' errors is a number, by name or by default, of a search as of a sweep."""
    run = open_loop(lambda time: 3.0 - np.cos(np.pi * time))
    lacking = [name for name, metric in METRICS.items() if metric.needs_reference]
    assert {"tracking_rms", "tracking_peak"} <= set(lacking)
    for name in lacking:
        with pytest.raises(fp.InputError, match="needs a reference"):
            scenario_metrics(run.scenario, [name])
    for name in ("tracking_rms", "tracking_peak"):
        with pytest.raises(fp.InputError, match="needs a reference"):
            METRICS[name].measure(run)
    over, short = {"finger.tendon_friction.coulomb": [0.1]}, {"simulation.duration": 0.01}
    with pytest.raises(fp.InputError, match="needs a reference"):
        fp.sweep("wound", over, metrics=["tracking_rms"], overrides=short)
    with pytest.raises(fp.InputError, match="needs a reference"):
        fp.optimise("wound", ["finger.tendon_friction.coulomb=0.1:0.2"], minimise=["tracking_rms"], constraints=[])
    study = fp.sweep("wound", over, overrides=short)
    assert "tracking_rms" not in study and float(study.tension_peak[0]) >= 0.0


def test_the_settling_time_of_a_first_order_response_is_four_time_constants():
    """1 - exp(-t / T) is within 2 % of its end from t = T ln 50 on."""
    run = Run(fp.load_scenario("reversals"))
    time = np.linspace(0.0, 10.0, 100_001)
    moved = np.stack([1.0 - np.exp(-time / 0.5), 0.0 * time], axis=1)
    run.result = xr.Dataset({"joint_position": (("time", "joint"), moved)}, {"time": time})
    assert METRICS["settling_time"].measure(run) == pytest.approx(0.5 * np.log(50.0), abs=2e-4)
    run.result = run.result * 0.0
    assert METRICS["settling_time"].measure(run) == 0.0


def test_a_winding_warms_up_as_its_closed_form_and_a_motor_without_its_numbers_is_told():
    scenario = fp.load_scenario("servo")
    motor = scenario.finger.actuators["M1"].motor
    warm = motor.updated(winding=Winding(thermal_resistance=8.0, time_constant=20.0, ambient=30.0))
    actuators = {name: each.updated(motor=warm) for name, each in scenario.finger.actuators.items()}
    run, time = Run(scenario.updated(finger={"actuators": actuators})), np.array([0.0, 0.1, 5.0, 30.0])
    current = np.array([[0.5], [0.5], [0.5], [0.5]]) * np.array([1.0, 0.2, 0.0, 0.0])
    run.result = xr.Dataset({"motor_current": (("time", "motor"), current)}, {"time": time, "motor": list(actuators)})
    expected = 30.0 + 8.0 * motor.constants[1] * 0.25 * (1.0 - np.exp(-30.0 / 20.0))
    assert METRICS["winding_temperature"].measure(run) == pytest.approx(expected, rel=1e-12)
    # Heat that grows evenly: the integral of exp(-(t - s) / T) s ds.
    run.result["motor_current"] = run.result.motor_current * 0.0 + np.sqrt(time)[:, None]
    grown = 8.0 * motor.constants[1] * (30.0 - 20.0 * (1.0 - np.exp(-30.0 / 20.0)))
    assert METRICS["winding_temperature"].measure(run) == pytest.approx(30.0 + grown, rel=1e-12)
    with pytest.raises(fp.InputError, match=r"needs motor\.winding"):
        METRICS["winding_temperature"].measure(Run(scenario))


def test_the_grip_margin_is_the_friction_that_is_left_at_the_end():
    run, time = Run(fp.load_scenario("reversals")), np.linspace(0.0, 1.0, 11)
    closed = np.array([1.0, 1.0, 0.0])
    signals = {"normal_force": closed, "level": 0.8 * closed, "friction": [0.2, 0.6, 0.0]}
    data = {f"contact_{name}": (("time", "contact"), np.tile(each, (11, 1))) for name, each in signals.items()}
    run.result = xr.Dataset(data, {"time": time})
    # It slid while it closed.
    run.result["contact_friction"][0] = run.result["contact_level"][0]
    assert METRICS["grip_margin"].measure(run) == pytest.approx(0.25)
