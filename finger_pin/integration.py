"""Integration of x' = f(t, x) by scipy's stiff solvers: the textbook path, and the reference for any other."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.integrate
import scipy.linalg

from finger_pin.routing import Array

Progress = Callable[[float], None]
Stop = Callable[[], bool]


@dataclass(frozen=True)
class Statistics:
    """What an integration cost: accepted steps, right-hand sides, Jacobians, factorisations, wall time in s."""

    steps: int
    evaluations: int
    jacobians: int
    factorisations: int
    wall_time: float


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A solution that can be evaluated anywhere up to where it got.

    Attributes:
        breakpoints: Ends of the accepted steps with the start first, shape (k + 1,), s.
        interpolate: Maps times, shape (m,), to packed states, shape (m, size).
        statistics: The cost.
        failure: What the integrator reported if it failed, otherwise empty.
        interrupted: Whether it was asked to stop.
    """

    breakpoints: Array
    interpolate: Callable[[Array], Array]
    statistics: Statistics
    failure: str = ""
    interrupted: bool = False


class _Monitor:
    """Sees every accepted step: reports progress, and ends the integration inside a step when asked to.

    It is given to solve_ivp as an event function, the only place where solve_ivp calls back once a step.
    """

    terminal = True

    def __init__(self, progress: Progress | None, stop: Stop | None) -> None:
        self.progress = progress
        self.stop = stop
        self.reached = 0.0
        self.stop_time = np.inf

    def __call__(self, instant: float, x: Array) -> float:
        if instant > self.reached and self.stop_time == np.inf:
            if self.stop is not None and self.stop():
                self.stop_time = 0.5 * (self.reached + instant)
            self.reached = instant
            if self.progress is not None:
                self.progress(instant)
        return 1.0 if self.stop_time == np.inf else self.stop_time - instant


def integrate(
    rhs: Callable[[float, Array], Array],
    start: Array,
    duration: float,
    *,
    method: str,
    rtol: float,
    atol: Array,
    progress: Progress | None = None,
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
        progress: Called with the simulated time after every step.
        stop: Asked after every step; true ends the integration there.
    """
    began = time.perf_counter()
    monitor = _Monitor(progress, stop)
    reason = ""
    try:
        solution = _solve(rhs, start, duration, method, rtol, atol, monitor)
    except (ValueError, scipy.linalg.LinAlgError) as error:
        # Non-finite numbers in scipy's linear algebra: repeat up to the last good step to keep what was computed.
        reason = f"the state or its Jacobian is not finite ({error})"
        solution = _solve(rhs, start, monitor.reached, method, rtol, atol, _Monitor(None, None))
    if solution.status == -1:
        reason = str(solution.message)
    statistics = Statistics(
        steps=len(solution.t) - 1,
        evaluations=int(solution.nfev),
        jacobians=int(solution.njev),
        factorisations=int(solution.nlu),
        wall_time=time.perf_counter() - began,
    )
    dense = solution.sol
    return Trajectory(
        breakpoints=solution.t,
        interpolate=lambda times: np.asarray(dense(times).T),
        statistics=statistics,
        failure=reason,
        interrupted=solution.status == 1,
    )


def _solve(
    rhs: Callable[[float, Array], Array],
    start: Array,
    duration: float,
    method: str,
    rtol: float,
    atol: Array,
    monitor: _Monitor,
) -> scipy.integrate._ivp.ivp.OdeResult:
    # At the edge of what floating point holds, a rejected trial step overflows before its error is measured.
    with np.errstate(over="ignore", invalid="ignore"):
        return scipy.integrate.solve_ivp(
            rhs,
            (0.0, duration),
            start,
            method=method,
            rtol=rtol,
            atol=atol,
            dense_output=True,
            events=monitor,
        )
