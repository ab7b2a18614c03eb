"""Recordings of benches as readings of an observer, what it does not know of a scenario, and where it starts."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis import taut_posture
from finger_pin.exceptions import InputError
from finger_pin.views.observation_text import summarize_observed

BENCH = """
extends = "wound"
identify.parameters."finger.tendon_friction.coulomb" = [0.05, 0.5]

[identify.recordings.moved]
file = "log.csv"
time = { column = "clock", unit = "ms" }
outputs."motor_position.servo" = { column = "angle", unit = "deg", scale = -1.0 }
outputs."motor_current.servo" = "current_mA"
outputs."joint_position.mcp" = "filmed_deg"
values = { "finger.tendon_friction.coulomb" = 0.25 }

[identify.recordings.still]
file = "log.csv"
time = { column = "clock", unit = "s" }
outputs."motor_position.servo" = { column = "angle", delay = 0.1 }
outputs."motor_current.servo" = "current_mA"
"""


@pytest.fixture
def bench(tmp_path):
    times = np.arange(200)
    table = np.column_stack([times, -0.1 * times, 0.5 * times, 0.0 * times])
    header = "clock,angle,current_mA [mA],filmed_deg [deg]"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="")
    (tmp_path / "bench.toml").write_text(BENCH)
    return f"{tmp_path / 'bench.toml'}"


def test_a_recording_is_read_by_name_with_its_columns_units_and_values(bench):
    result = fp.observe("wound", f"{bench}:moved")
    k = np.arange(200)
    columns = {"motor_position.servo": np.radians(0.1 * k), "motor_current.servo": 0.5e-3 * k}
    known = fp.load_scenario("wound", {"finger.tendon_friction.coulomb": 0.25})
    expected = fp.observe(known, (1e-3 * k, columns))
    np.testing.assert_allclose(result.joint_position, expected.joint_position, rtol=1e-9, atol=1e-12)
    # What a bench compares with is no reading.
    assert result.attrs["left_out"] == ["joint_position.mcp"]


@pytest.mark.parametrize(
    ("scenario", "name", "message"),
    [
        ("servo_pendulum", "servo_pendulum:ss_kp100", "readings = .*: must have motor_current.servo"),
        ("weights", "weights", "readings = .steady.: must be a recording of a motion"),
        ("spool_finger", "spool_finger", "must be spool_finger:RECORDING; there are first, second"),
        ("spool_finger", "spool_finger:frist", "must be spool_finger:RECORDING; there are first, second"),
        ("wound", "{bench}:still", "delay = 0.1: is not for readings"),
    ],
)
def test_recordings_that_do_not_tell_what_is_needed_are_refused(scenario, name, message, bench):
    with pytest.raises(InputError, match=message):
        fp.observe(scenario, name.format(bench=bench))


def test_objects_that_an_observer_does_not_know_are_told():
    observer = fp.observe("underactuated")
    observer.step(dict.fromkeys(observer.sensors.inputs, 0.0))
    result = observer.result()
    removed = list(fp.load_scenario("underactuated").environment.objects)
    assert result.attrs["removed_objects"] == removed
    assert f"unknown to the observer: {', '.join(removed)}" in " ".join(summarize_observed(result).split())


def test_springs_that_are_twice_as_stiff_as_the_model_make_it_inconsistent():
    stiff = {
        f"finger.joints.{name}.spring.stiffness": 2.0 * joint.spring.stiffness
        for name, joint in fp.load_scenario("wound").finger.joints.items()
    }
    run = fp.simulate(fp.load_scenario("wound", stiff | {"simulation.duration": 2.0}))
    columns = {f"{name}.servo": run[name].values[:, 0] for name in ("motor_position", "motor_current")}
    assert float(fp.observe("wound", (run.time.values, columns)).consistency.max()) > 3.0


def test_springs_share_the_length_that_a_motor_has_wound():
    # Least energy sum k theta^2 / 2 for sum r theta = r_m theta_m: k theta is r times one tension.
    scenario, radius, stiffness = fp.load_scenario("wound"), np.array([10.0, 8.0, 6.0]), np.array([0.08, 0.05, 0.03])
    finger = fp.Finger(scenario.finger)
    taut = finger.layout.unpack(finger.rest_state(np.zeros(3))).motor_position[0]
    arguments = np.zeros(3), scenario.coupling(finger.routing)
    theta, still = taut_posture(finger, {"servo": taut + 1.5}, *arguments)
    np.testing.assert_allclose(theta, radius / stiffness * 8.0 * 1.5 / np.sum(radius**2 / stiffness), rtol=1e-3)
    np.testing.assert_allclose(radius @ still, 0.0, atol=1e-3)
    assert np.linalg.matrix_rank(still, tol=1e-3) == 2
    with pytest.raises(InputError, match="serwo: no such motor"):
        taut_posture(finger, {"serwo": 0.0}, *arguments)


def test_an_observer_starts_where_the_motor_says_that_the_finger_rests():
    now = fp.observe("wound").start(motor_position={"servo": 2.5})
    assert float(now.spool_tension.value[0]) < 1.0
    assert (now.joint_position.high - now.joint_position.low > 0.2).all()
    np.testing.assert_allclose([10.0, 8.0, 6.0] @ now.joint_position.value, 8.0 * 2.5, rtol=1e-2)
