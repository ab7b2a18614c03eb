"""simulate(): repeatable, interruptible, and with a user's own blocks."""

import signal
from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.interface import ControlSignals
from finger_pin.description.simulation_settings import METHODS
from finger_pin.exceptions import InputError, IntegrationError, Interrupted
from finger_pin.references.reference import ReferenceSignals


def short(duration=0.02, **settings):
    return fp.load_scenario("reversals", {"simulation.duration": duration} | settings)


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


def test_methods_agree_on_the_motion(fig6_runs):
    """Python and compiled right-hand sides, and multistep, Runge-Kutta and Rosenbrock methods."""
    reference = fig6_runs["Radau"]
    moved = float(np.ptp(reference.joint_position.values, axis=0).max())
    for method in METHODS:
        difference = abs(fig6_runs[method].joint_position - reference.joint_position).max()
        assert float(difference) < 2e-4 * moved


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


@pytest.mark.slow
def test_a_reference_of_one_s_own_is_followed():
    result = fp.simulate(short(), reference=Hold((0.02, 0.3, 0.5, 0.346)))
    np.testing.assert_array_equal(result.joint_reference, np.broadcast_to([0.02, 0.3, 0.5, 0.346], (21, 4)))
    np.testing.assert_allclose(result.joint_position[0], [0.02, 0.3, 0.5, 0.346], rtol=1e-15)
    np.testing.assert_allclose(result.joint_position[-1], [0.02, 0.3, 0.5, 0.346], atol=0.02)


@pytest.mark.slow
def test_a_controller_of_one_s_own_is_obeyed():
    """T1 alone pulls: joints 1 and 2 are turned positively with the same radius, against friction and gravity."""
    result = fp.simulate(short(), controller=Constant((4.0, 0.0, 0.0, 0.0, 0.0)), reference=Hold((0.0, 0.5, 0.5, 0.4)))
    np.testing.assert_array_equal(result.tendon_command, np.broadcast_to([4.0, 0, 0, 0, 0], (21, 5)))
    torque = result.joint_torque.values
    np.testing.assert_allclose(torque[:, 0], 8e-3 * (result.tendon_tension[:, 0] - result.tendon_tension[:, 1]))
    assert float(result.joint_position[-1, 0]) > 0.01


@pytest.mark.parametrize("method", METHODS)
def test_progress_rises_to_the_end(fig6_runs, fig6_progress, method):
    assert np.all(np.diff(fig6_progress[method]) > 0.0)
    assert fig6_progress[method][-1] == pytest.approx(fig6_runs[method].attrs["end_time"], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
def test_an_interruption_keeps_what_was_computed(fig6_runs, method):
    seen = []
    scenario = short(0.1, **{"simulation.method": method})
    with pytest.raises(Interrupted) as caught:
        fp.simulate(scenario, progress=seen.append, stop=lambda: seen[-1] > 0.004)
    error = caught.value
    assert 0.0035 < error.time < 0.008
    assert float(error.result.time[-1]) <= error.time < float(error.result.time[-1]) + 1e-3
    whole = fig6_runs[method].sel(time=error.result.time)
    np.testing.assert_allclose(error.result.joint_position, whole.joint_position, atol=1e-7)
    assert f"t = {error.time:.6g} s" in str(error)


@pytest.mark.parametrize("method", ["Rodas5P", "Rodas4"])
def test_an_interruption_of_the_compiled_core_keeps_what_was_computed(method, reversals):
    seen = []
    scenario = fp.load_scenario("reversals", {"simulation.method": method})
    with pytest.raises(Interrupted) as caught:
        fp.simulate(scenario, progress=seen.append, stop=lambda: seen[-1] > 2.0)
    error = caught.value
    assert np.all(np.diff(seen) > 0.0) and seen[-1] < 3.0
    assert 1.5 < error.time <= seen[-1]
    assert error.result.attrs["interrupted"] == f"interrupted at t = {error.time:.6g} s of 8 s"
    assert error.time - 1e-3 < float(error.result.time[-1]) <= error.time
    whole = reversals.sel(time=error.result.time)
    np.testing.assert_allclose(error.result.joint_position, whole.joint_position, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Radau", "LSODA"])
def test_a_failed_integration_raises_and_keeps_what_was_computed(method):
    controller = Constant((1.0, 1.0, 4.0, 3.0, 3.0), broken_after=0.004)
    with pytest.raises(IntegrationError) as caught:
        fp.simulate(short(**{"simulation.method": method}), controller=controller)
    error = caught.value
    assert 0.002 < error.time <= 0.0044
    assert float(error.result.time[-1]) <= error.time * (1.0 + 1e-9)
    assert len(error.result.time) > 2
    assert np.all(np.isfinite(error.result.joint_position))
    assert error.reason and error.advice in str(error)


@pytest.mark.slow
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


def test_a_sampled_controller_approaches_the_continuous_one_in_proportion_to_its_period():
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.1})
    reference = fp.simulate(scenario).joint_position
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


def test_an_observer_sees_rising_times_and_the_signals_of_the_dynamics_and_changes_nothing():
    scenario = short()
    seen = []
    observed = fp.simulate(scenario, observe=lambda time, signals: seen.append((time, signals)))
    np.testing.assert_array_equal(observed.joint_position, fp.simulate(scenario).joint_position)
    times = [time for time, _ in seen]
    assert len(times) > 3 and np.all(np.diff(times) > 0.0) and times[-1] == observed.end_time
    signals = seen[-1][1].finger
    np.testing.assert_allclose(signals.state.position, observed.joint_position[-1], rtol=1e-12)
    np.testing.assert_allclose(signals["joint_reaction"], observed.joint_reaction[-1], rtol=1e-9)


def test_names_and_paths_will_do_for_a_scenario_and_a_finger(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text('extends = "reversals"\n[simulation]\nduration = 0.002\n', encoding="utf-8")
    expected = fp.simulate(fp.load_scenario(path))
    assert fp.simulate(path).equals(expected) and fp.simulate(str(path)).equals(expected)
    with pytest.raises(fp.InputError, match="did you mean fig6"):
        fp.simulate("fgi6")
    assert fp.Finger("ub_stand_in").description == fp.load_finger("ub_stand_in")
    with pytest.raises(fp.InputError, match="no such finger"):
        fp.Finger("no_such_hand")


@pytest.mark.parametrize("late", [False, True])
def test_ctrl_c_in_python_keeps_what_was_computed(late):
    """Before the end, and when all steps are done."""
    prepared, presses = fp.prepare(short(0.3)), []

    def once(time):
        if not presses and time > (0.29 if late else 0.01):
            presses.append(time)
            signal.raise_signal(signal.SIGINT)

    for run in (lambda: fp.simulate(prepared.scenario(), progress=once), lambda: prepared.simulate(progress=once)):
        presses.clear()
        with pytest.raises(KeyboardInterrupt) as caught:
            run()
        assert presses and float(caught.value.result.time[-1]) == pytest.approx(caught.value.time, abs=1e-3)
        assert (caught.value.time > 0.29) == late
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_surrounds_a_finger_makes_a_scene_of_it():
    around = fp.load_scenario("press")
    alone = around.updated(environment={"objects": None})
    fingers = [ClosedLoop.from_scenario(scenario).finger for scenario in (alone, around)]
    assert [finger.scene is not None for finger in fingers] == [False, True]
