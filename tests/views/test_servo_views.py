"""Summary and figure of servos, against the result that they are made of."""

import re

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.studies.metrics import METRICS, Run
from finger_pin.views.plots.energy_account import plot_energy
from finger_pin.views.plots.servo import plot_servo
from finger_pin.views.summary import slack_time, summarize


@pytest.fixture(scope="module")
def result():
    return fp.simulate(fp.load_scenario("servo", {"simulation.duration": 0.05}))


def row(result, name):
    line = next(line for line in summarize(result).splitlines() if line.startswith(f"  {name} "))
    return [float(each) for each in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", line.removeprefix(f"  {name}"))]


def test_the_summary_tells_current_and_power_at_the_terminals_of_every_motor(result):
    for name in ("M1", "M2", "M3", "M4"):
        current, voltage = (result[f"motor_{each}"].sel(motor=name).values for each in ("current", "voltage"))
        power = current * voltage
        expected = [abs(current).max(), np.sqrt(np.mean(current**2)), power.max(), power.mean()]
        np.testing.assert_allclose(row(result, name), expected, atol=5e-4)
    assert max(map(len, summarize(result).splitlines())) <= 80


def test_the_summary_tells_for_how_long_a_tendon_hung_slack_at_its_spool(result):
    assert "slack at the spools: none" in summarize(result)
    hanging = result.copy(deep=True)
    # Ten samples of a millisecond.
    hanging["spool_tension"][20:30, 2] = 0.0
    assert slack_time(hanging) == pytest.approx({"T1": 0.0, "T2": 0.0, "T3": 0.01, "T4": 0.0})
    assert "slack at the spools: T3 0.01 s" in summarize(hanging)


def test_what_motors_supply_counts_as_supplied(result):
    supplied = float(result["energy_exchanged_electrical"][-1])
    assert row(result, "supplied: motors' electronics")[0] == pytest.approx(1e3 * supplied, rel=1e-3)
    assert row(result, "residual, not accounted for")[0] == pytest.approx(
        1e3 * float(result.energy_residual[-1]), rel=1e-3
    )
    above = next(axes for axes in plot_energy(result).axes if axes.get_ylabel() == "energy (mJ)")
    (line,) = [line for line in above.get_lines() if line.get_label() == "supplied"]
    assert line.get_ydata()[-1] == pytest.approx(1e3 * supplied)


def test_the_figure_of_servos_shows_joints_over_spools_both_tensions_currents_and_power(result):
    axes = {each.get_ylabel(): each for each in plot_servo(result).axes}
    # T4 crosses three joints with an arm, M4 pulls it.
    loops = {line.get_label(): line for line in axes["M4: joints (°)"].get_lines()}
    assert set(loops) == {"proximal", "medial", "distal"}
    spool = np.rad2deg(result.motor_position.sel(motor="M4").values)
    np.testing.assert_allclose(loops["distal"].get_xdata(), spool)
    np.testing.assert_allclose(
        loops["distal"].get_ydata(), np.rad2deg(result.joint_position.sel(joint="distal").values)
    )
    ends = {line.get_label(): line.get_ydata() for line in axes["T3 (N)"].get_lines()}
    np.testing.assert_allclose(ends["at the spool"], result.spool_tension.sel(tendon="T3").values)
    np.testing.assert_allclose(ends["at the finger"], result.tendon_tension.sel(tendon="T3").values)
    currents = {line.get_label(): line.get_ydata() for line in axes["current (A)"].get_lines()}
    np.testing.assert_allclose(currents["M2"], result.motor_current.sel(motor="M2").values)
    (power,) = [line for line in axes["power (W)"].get_lines() if line.get_label() == "electrical"]
    np.testing.assert_allclose(power.get_ydata(), (result.motor_current * result.motor_voltage).sum("motor").values)


def test_metrics_of_motors_are_those_of_the_result(result):
    run = Run(fp.load_scenario("servo"))
    run.result = result
    assert METRICS["heat"].measure(run) == float(result.energy_exchanged_motor_heat[-1])
    assert METRICS["current_peak"].measure(run) == float(abs(result.motor_current).max())
    ends = max(float(result[name].max()) for name in ("spool_tension", "tendon_tension"))
    assert METRICS["tension_peak"].measure(run) == ends
    ideal = Run(fp.load_scenario("reversals", {"simulation.duration": 0.002}))
    assert METRICS["heat"].measure(ideal) == METRICS["current_peak"].measure(ideal) == 0.0
