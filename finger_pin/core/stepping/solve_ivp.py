"""Integration of x' = f(t, x) by `scipy.integrate.solve_ivp`: the readable path, a reference for the compiled one."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import scipy

from finger_pin.cancellation import Stop
from finger_pin.core.steps.trajectory import Statistics, Trajectory, Watch
from finger_pin.typing import Array

# So many steps in a row must advance by so much time each on average, s, and so many are kept in memory at most.
_WINDOW, _LEAST_MEAN_STEP, _MOST_STEPS = 5000, 1e-9, 1_000_000


def integrate(
    rhs: Callable[[float, Array], Array],
    start: Array,
    duration: float,
    *,
    method: str,
    rtol: float,
    atol: Array,
    max_step: float = np.inf,
    watch: Watch | None = None,
    stop: Stop | None = None,
) -> Trajectory:
    """Integrate from time zero with one of scipy's methods.

    Args:
        rhs: f(t, x), pure.
        start: x(0), shape (size,).
        duration: s.
        method: ``Radau``, ``BDF`` or ``LSODA``.
        rtol: Relative tolerance.
        atol: Absolute tolerance, shape (size,).
        max_step: Maximum size of a step, s.
        watch: Called with the simulated time and the state after every step.
        stop: Asked after every step; true ends the integration there.
    """
    began, system, steps = time.perf_counter(), _System(rhs), _StepEnds(watch, stop)
    options = {"method": method, "rtol": rtol, "atol": atol, "max_step": max_step, "dense_output": True}
    if method in ("Radau", "BDF"):
        options["jac"] = _Jacobian(system, atol / rtol)
    # At the edge of what floating point holds, a rejected trial step overflows before its error is measured.
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            solved = scipy.integrate.solve_ivp(system, (0.0, duration), start, events=steps, **options)
            failure = steps.failure or (solved.message if solved.status < 0 else "")
        except (ValueError, scipy.linalg.LinAlgError, _StepFailedError) as error:
            if error is system.error:
                raise
            known = isinstance(error, _StepFailedError)
            failure = str(error) if known else f"the state or its Jacobian is not finite ({error})"
            # What came before the step that failed is computed once more: scipy keeps nothing of it.
            reached, silent = steps.times[-1], _StepEnds()
            solved = reached and scipy.integrate.solve_ivp(system, (0.0, reached), start, events=silent, **options)
    if not solved:
        start = np.array(start, dtype=float)
        nothing = Statistics(0, system.evaluations, 0, 0, time.perf_counter() - began)
        return Trajectory(np.zeros(1), lambda at: np.tile(start, (len(at), 1)), nothing, failure)
    counts = system.evaluations, solved.njev, solved.nlu
    return Trajectory(
        breakpoints=solved.t,
        interpolate=lambda at: np.asarray(solved.sol(at).T),
        statistics=Statistics(len(solved.t) - 1, *counts, time.perf_counter() - began),
        failure=failure,
        interrupted=steps.interrupted,
    )


class _StepFailedError(Exception):
    """A step has ended where it began, or where a number is not finite; scipy would go on."""


class _StepEnds:
    """An event of scipy's that watches the ends of steps, and occurs at the last one if the integration is to stop."""

    terminal = True

    def __init__(self, watch: Watch | None = None, stop: Stop | None = None) -> None:
        self._watch, self._stop, self._end = watch, stop, np.inf
        self.times, self.failure, self.interrupted = list[float](), "", False

    def __call__(self, instant: float, x: Array) -> float:
        # Once it has occurred, scipy looks for the moment.
        if self._end == np.inf:
            if self.times and not instant > self.times[-1]:
                raise _StepFailedError("the step size is less than the spacing between numbers")
            if not np.all(np.isfinite(x)):
                raise _StepFailedError("the state or its Jacobian is not finite")
            self.times.append(float(instant))
            steps = len(self.times) - 1
            if steps and self._watch is not None:
                self._watch(instant, x)
            self.interrupted = bool(steps and self._stop is not None and self._stop())
            if steps >= _MOST_STEPS:
                self.failure = f"after {_MOST_STEPS} steps the trajectory has reached the most that is kept in memory"
            elif steps % _WINDOW == 0 < steps and instant - self.times[-1 - _WINDOW] < _WINDOW * _LEAST_MEAN_STEP:
                self.failure = f"the last {_WINDOW} steps advanced by less than {_LEAST_MEAN_STEP:g} s each"
            if self.interrupted or self.failure:
                self._end = instant
        return self._end - instant


class _Jacobian:
    """The Jacobian by forward differences.

    Those of scipy try a ten times larger difference at every call where a number changes nothing, such as the place of
    an object that nothing touches, until it overflows.
    """

    def __init__(self, rhs: Callable[[float, Array], Array], scale: Array) -> None:
        self._rhs, self._scale = rhs, scale

    def __call__(self, instant: float, x: Array) -> Array:
        at = self._rhs(instant, x)
        steps = np.sqrt(np.finfo(float).eps) * np.maximum(np.abs(x), self._scale)
        moved = x + np.diag(steps)
        # What is added exactly, rounding included.
        columns = [(self._rhs(instant, row) - at) / (row[i] - x[i]) for i, row in enumerate(moved)]
        return np.transpose(columns)


class _System:
    """The right-hand side, counted; keeps an exception that it raises, to distinguish it from one of the solver's."""

    def __init__(self, rhs: Callable[[float, Array], Array]) -> None:
        self.rhs = rhs
        self.evaluations = 0
        self.error: BaseException | None = None

    def __call__(self, instant: float, x: Array) -> Array:
        self.evaluations += 1
        try:
            return self.rhs(instant, x)
        except BaseException as error:
            self.error = error
            raise
