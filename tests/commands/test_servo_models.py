"""The comparison of friction models of servos: formulas by hand, closed forms, and our core under the same friction."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import servo_models
from servo_models import Motion, advance, core_errors, fit, friction_level, quantities, simulate

from finger_pin.description.loading import load_bench
from finger_pin.identification.residuals.recordings import read_recording

PAGE = Path(servo_models.__file__).parents[1] / "finger_pin" / "identification" / "README.md"
# At a speed of v_s the exponential is 1/e for any alpha.
SHARE = math.exp(-1.0)
VALUES = {"K_v": 0.1, "K_c": 0.05, "K_l": 0.2, "K_cs": 0.02, "K_ls": 0.5, "K_m": 0.3, "K_e": 0.1}
VALUES |= {"K_ms": 0.4, "K_es": 0.6, "K_mq": 0.7, "K_eq": 0.9, "v_s": 2.0, "alpha": 3.0}
FIRST = {"torque_constant": 0.4, "resistance": 3.5, "inertia": 0.002}


# Per model: friction as it lifts (0.5 N m against 0.3), as it lets down (0.2 against 0.6), as both drive, and at rest.
@pytest.mark.parametrize(
    ("model", "lifting", "lowering", "together", "resting"),
    [
        ("M1", 0.25, 0.25, 0.25, 0.05),
        ("M2", 0.25 + 0.02 * SHARE, 0.25 + 0.02 * SHARE, 0.25 + 0.02 * SHARE, 0.07),
        ("M3", 0.25 + 0.16, 0.25 + 0.16, 0.25 + 0.04, 0.05 + 0.16),
        ("M4", 0.41 + 0.42 * SHARE, 0.41 + 0.42 * SHARE, 0.29 + 0.12 * SHARE, 0.21 + 0.42),
        ("M5", 0.43 + 0.40 * SHARE, 0.37 + 0.46 * SHARE, 0.37 + 0.04 * SHARE, 0.23 + 0.40),
        ("M6", 0.43 + 0.481 * SHARE, 0.37 + 0.488 * SHARE, 0.37 + 0.04 * SHARE, 0.23 + 0.481),
    ],
)
def test_friction_is_that_of_the_equations(model, lifting, lowering, together, resting):
    p = quantities({name: VALUES[name] for name in servo_models.MODELS[model]})
    for way in (1.0, -1.0):
        assert friction_level(0.5 * way, -0.3 * way, 2.0, p) == pytest.approx(lifting, rel=1e-12)
        assert friction_level(0.2 * way, -0.6 * way, -2.0, p) == pytest.approx(lowering, rel=1e-12)
        assert friction_level(0.5 * way, 0.3 * way, 2.0, p) == pytest.approx(together, rel=1e-12)
        assert friction_level(0.5 * way, -0.3 * way, 0.0, p) == pytest.approx(resting, rel=1e-12)


def test_a_rotor_sticks_below_its_friction_stops_within_a_step_and_slides_above():
    p, rig, step = quantities({**FIRST, "K_c": 0.05}), np.array([1.0, 7.0, 99.0, 0.0, 0.006]), 0.005
    # The motor's torque at rest is 0.4 / 3.5 * 7 = 0.8 N m a radian of error; 0.05 N m holds 0.0625 rad.
    assert advance(0.0, 0.0, 0.0624, rig, p, step) == (0.0, 0.0)
    angle, speed = advance(0.0, 0.0, -0.1, rig, p, step)
    assert speed == pytest.approx(-(0.08 - 0.05) / 0.008 * step) and angle == pytest.approx(0.5 * step * speed)
    # 0.008 kg m2 at 0.03 rad/s are stopped within 5 ms by 0.048 N m, at 0.04 rad/s by 0.064.
    assert advance(0.0, 0.03, 0.0, rig, p, step) == (0.5 * step * 0.03, 0.0)
    _, speed = advance(0.0, 0.04, 0.0, rig, p, step)
    back = 0.4**2 / 3.5 * 0.04
    assert speed == pytest.approx(0.04 - (0.05 + back) / 0.008 * step)


def motion(goal, gain, step=0.002, gravity=0.48, limit=99.0):
    count = len(goal)
    rig = np.array([gain, 7.0, limit, gravity, 0.005])
    return Motion("made up", goal, rig, step, np.arange(count, dtype=float), np.zeros(count), False)


@pytest.mark.parametrize("limit", [99.0, 1.0])
def test_a_saturated_motor_speeds_up_as_in_closed_form(limit):
    made = motion(np.full(1000, 1e6), 1.0, 1e-4, 0.0, limit)
    values = {**FIRST, "K_v": 0.01, "K_c": 0.05}
    torque, damping = (0.4 / 3.5 * 7.0, 0.4**2 / 3.5 + 0.01) if limit == 99.0 else (0.4 * 1.0, 0.01)
    time, rate = 1e-4 * np.arange(1000), damping / 0.007
    expected = (torque - 0.05) / damping * (time - (1.0 - np.exp(-rate * time)) / rate)
    # Steps of speed are explicit: their first-order error is a step times the rate at most.
    assert simulate(made, values) == pytest.approx(expected, abs=1e-4 * rate * expected[-1])


@pytest.mark.slow
def test_parameters_of_a_simulated_recording_come_back():
    truth = {**FIRST, "K_v": 0.005, "K_c": 0.01, "K_l": 0.15}
    time = 0.002 * np.arange(2000)
    blanks = [motion(np.sin((1.0 + time) * time), gain) for gain in (0.5, 2.0)]
    made = [each._replace(measured=simulate(each, truth)) for each in blanks]
    found = fit(made, tuple(truth), {}, 120)
    assert np.abs(np.concatenate(servo_models.errors(made, found))).mean() < 2e-3
    # Torque constant and resistance are told by their quotient alone where nothing else depends on them.
    assert found["torque_constant"] / found["resistance"] == pytest.approx(0.4 / 3.5, rel=0.05)
    assert found["K_l"] == pytest.approx(0.15, abs=0.015)


def test_our_core_moves_as_the_small_simulation_does_under_one_friction():
    scenario, settings = load_bench(servo_models.BENCH)
    recordings = [read_recording(name, settings.recordings[name]) for name in ("st_kp200", "ud_kp800")]
    values = {**FIRST, "K_v": 0.013, "K_c": 0.02, "K_l": 0.0, "K_ls": 0.0}
    for recording, residuals in zip(recordings, core_errors(recordings, values, {}), strict=True):
        made = servo_models.read_motion(scenario, recording, 5e-4)
        # Bristles of 50 N m/rad bend by 0.4 mrad, the horn by 2 mrad.
        assert simulate(made, values) == pytest.approx(made.measured - residuals, abs=0.01)
        assert np.ptp(made.measured) > 0.8


def test_our_numbers_are_those_of_the_page():
    lines = dict(line.split()[:2] for line in PAGE.read_text("utf-8").splitlines() if ".servo.motor." in line)
    keys = {f"finger.actuators.servo.motor.{servo_models.KEYS[name]}": v for name, v in servo_models.OURS.items()}
    assert {key: float(value) for key, value in lines.items()} == keys


def test_published_parameters_are_read_by_their_symbols(tmp_path):
    for model in servo_models.MODELS:
        entries = {"kt": 0.4, "load_friction_base": 0.1, "model": model, "q_offset": 0.03}
        (tmp_path / f"{model.lower()}.json").write_text(json.dumps(entries))
    expected = {"torque_constant": 0.4, "K_l": 0.1, "offset": 0.03}
    assert dict(servo_models.published(tmp_path)) == dict.fromkeys(servo_models.MODELS, expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--step", "1"], "--step"), (["--published", "nowhere"], "m1.json"), (["--current-limit", "0"], "current")],
)
def test_a_wrong_argument_is_refused_in_one_line(arguments, words, capsys):
    assert servo_models.main(["--only", "M1", "--generations", "0", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
