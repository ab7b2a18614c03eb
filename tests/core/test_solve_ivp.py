"""The integrators on systems with known solutions, and what is kept when they stop or fail."""

import numpy as np
import pytest

from finger_pin.core.stepping.solve_ivp import integrate

METHODS = ("Radau", "BDF", "LSODA")


def decay(_, x):
    """Two time constants, 1 s and 1 ms: stiff, with solution exp(-t) and exp(-1000 t)."""
    return np.array([-x[0], -1000.0 * x[1]])


def blow_up(_, x):
    """Return x' = x^2, which from 1 is 1 / (1 - t): no solution reaches t = 1."""
    return x * x


def run(rhs, start=(1.0, 1.0), duration=1.0, method="Radau", rtol=1e-8, **settings):
    start = np.array(start)
    return integrate(rhs, start, duration, method=method, rtol=rtol, atol=np.full(len(start), 1e-12), **settings)


@pytest.mark.parametrize("method", METHODS)
def test_a_stiff_decay_follows_its_exponentials_everywhere(method):
    trajectory = run(decay, method=method)
    times = np.linspace(0.0, 1.0, 500)
    exact = np.stack([np.exp(-times), np.exp(-1000.0 * times)], axis=1)
    np.testing.assert_allclose(trajectory.interpolate(times), exact, atol=2e-5)
    steps = trajectory.breakpoints
    np.testing.assert_allclose(trajectory.interpolate(steps)[:, 0], np.exp(-steps), rtol=1e-6)
    assert steps[0] == 0.0 and steps[-1] == 1.0
    assert not trajectory.failure and not trajectory.interrupted


@pytest.mark.parametrize("method", METHODS)
def test_a_smaller_tolerance_gives_a_smaller_error(method):
    ends = [run(decay, method=method, rtol=rtol).interpolate(np.ones(1))[0, 0] for rtol in (1e-3, 1e-6, 1e-9)]
    errors = np.abs(np.array(ends) - np.exp(-1.0))
    assert errors[0] > 10.0 * errors[1] > 100.0 * errors[2]


@pytest.mark.parametrize("method", METHODS)
def test_statistics_count_steps_evaluations_jacobians_and_time(method):
    calls = []
    trajectory = run(lambda t, x: (calls.append(t), decay(t, x))[1], method=method)
    cost = trajectory.statistics
    assert cost.steps == len(trajectory.breakpoints) - 1 > 0
    assert cost.evaluations == len(calls) > cost.steps
    assert cost.jacobians > 0
    assert cost.wall_time > 0.0


@pytest.mark.parametrize("method", METHODS)
def test_progress_rises_through_every_step_to_the_end(method):
    reported = []
    trajectory = run(decay, method=method, watch=lambda time, x: reported.append(time))
    np.testing.assert_array_equal(reported, trajectory.breakpoints[1:])
    assert np.all(np.diff(reported) > 0.0) and reported[-1] == 1.0


@pytest.mark.parametrize("method", METHODS)
def test_a_stop_ends_the_integration_there_and_keeps_what_was_computed(method):
    reported = []
    trajectory = run(decay, method=method, watch=lambda time, x: reported.append(time), stop=lambda: len(reported) == 7)
    assert trajectory.interrupted and not trajectory.failure
    assert len(reported) == 7
    end = trajectory.breakpoints[-1]
    assert 0.0 < end <= reported[-1] < 1.0
    times = np.linspace(0.0, end, 20)
    np.testing.assert_allclose(trajectory.interpolate(times)[:, 0], np.exp(-times), rtol=1e-5)


def test_a_stop_that_never_comes_changes_nothing():
    plain, asked = run(decay), run(decay, stop=lambda: False)
    np.testing.assert_array_equal(plain.breakpoints, asked.breakpoints)
    assert not asked.interrupted


@pytest.mark.parametrize("method", METHODS)
def test_a_singularity_is_a_failure_that_keeps_the_solution_before_it(method):
    trajectory = run(blow_up, start=(1.0,), duration=2.0, method=method, rtol=1e-6)
    assert "step size" in trajectory.failure
    assert 0.99 < trajectory.breakpoints[-1] < 1.01
    times = np.linspace(0.0, 0.9, 20)
    np.testing.assert_allclose(trajectory.interpolate(times)[:, 0], 1.0 / (1.0 - times), rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_a_right_hand_side_that_stops_being_a_number_is_a_failure_with_finite_results(method):
    trajectory = run(lambda t, x: decay(t, x) if t < 0.5 else np.full(2, np.nan), method=method)
    assert trajectory.failure and not trajectory.interrupted
    end = trajectory.breakpoints[-1]
    assert 0.1 < end <= 0.5
    times = np.linspace(0.0, end, 20)
    np.testing.assert_allclose(trajectory.interpolate(times)[:, 0], np.exp(-times), rtol=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_a_failure_at_the_start_leaves_the_start(method):
    trajectory = run(lambda t, x: np.full(2, np.nan), start=(3.0, 4.0), method=method)
    assert trajectory.failure
    np.testing.assert_array_equal(trajectory.breakpoints, [0.0])
    np.testing.assert_array_equal(trajectory.interpolate(np.zeros(2)), [[3.0, 4.0], [3.0, 4.0]])
    assert trajectory.statistics.steps == 0


@pytest.mark.parametrize("method", METHODS)
def test_an_error_of_the_right_hand_side_itself_is_not_taken_for_a_numerical_failure(method):
    def broken(time, x):
        if time > 0.3:
            raise ValueError("gain has the wrong shape")
        return decay(time, x)

    with pytest.raises(ValueError, match="wrong shape"):
        run(broken, method=method)


def test_a_number_that_changes_nothing_does_not_end_a_run_that_asks_for_many_jacobians():
    """Van der Pol's oscillator with a third number: the place, say, of something that nothing touches."""

    def rhs(_, x):
        return np.array([x[1], 50.0 * (1.0 - x[0] ** 2) * x[1] - x[0], 0.0 * x[2] ** 2])

    found = integrate(rhs, np.array([2.0, 0.0, 0.0]), 600.0, method="Radau", rtol=1e-3, atol=np.full(3, 1e-3))
    assert not found.failure and found.statistics.jacobians > 200


@pytest.mark.parametrize("method", METHODS)
def test_no_step_is_longer_than_the_maximum(method):
    trajectory = run(decay, method=method, rtol=1e-3, max_step=0.05)
    assert np.diff(trajectory.breakpoints).max() <= 0.05 * (1.0 + 1e-12)
    assert np.diff(run(decay, method=method, rtol=1e-3).breakpoints).max() > 0.05
