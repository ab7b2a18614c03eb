"""Integration of x' = f(t, x) by scipy's stiff solvers: the textbook path, and the reference for any other."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy

from finger_pin.description.routing import Array

_MOST_STALLED = 1000
# So many steps in a row must advance by so much time each on average, s, and so many are kept in memory at most.
_WINDOW, _LEAST_MEAN_STEP, _MOST_STEPS = 5000, 1e-9, 1_000_000

Watch = Callable[[float, Array], None]
Stop = Callable[[], bool]


@dataclass(frozen=True)
class Statistics:
    """What an integration cost: accepted steps, right-hand sides, Jacobians, factorisations, wall time in s."""

    steps: int
    evaluations: int
    jacobians: int
    factorisations: int
    wall_time: float


class Apart(Protocol):
    """The motion of what moves apart from the rest, with steps of its own."""

    @property
    def times(self) -> Array:
        """Ends of its steps with the start first, s."""

    def powers(self, times: Array, force: Array, base: Array | None) -> Array:
        """Return its powers at times, and that of the forces at its tips, shape (m, powers + 1), W."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A solution that can be evaluated anywhere up to where it got.

    Attributes:
        breakpoints: Ends of the accepted steps with the start first, shape (k + 1,), s.
        interpolate: Maps times, shape (m,), to packed states, shape (m, size).
        statistics: The cost.
        failure: What the integrator reported if it failed, otherwise empty.
        interrupted: Whether it was asked to stop.
        estimated_error: Of the joints' angles, root mean square over joints and time, rad; NaN where not estimated.
        islands: Motions of what moves apart, where the core computes all inputs itself; none otherwise.
    """

    breakpoints: Array
    interpolate: Callable[[Array], Array]
    statistics: Statistics
    failure: str = ""
    interrupted: bool = False
    estimated_error: float = np.nan
    islands: tuple[Apart, ...] = ()


class _Broken(Exception):
    """The integrator produced something that it cannot go on from."""


class _Monitor:
    """Sees every accepted step: shows it, and ends the integration inside a step when asked to.

    It is given to solve_ivp as an event function, the only place where solve_ivp calls back once a step.
    """

    terminal = True

    def __init__(self, watch: Watch | None, stop: Stop | None, bounded: bool = True) -> None:
        self.bounded = bounded
        self.watch = watch
        self.stop = stop
        self.reached = 0.0
        self.stop_time = np.inf
        self.calls_here = 0
        self.steps = 0
        self.window_start = 0.0

    def __call__(self, instant: float, x: Array) -> float:
        if self.stop_time < np.inf:
            # solve_ivp finds the root of this function: the time to stop at.
            return self.stop_time - instant
        if not np.all(np.isfinite(x)):
            raise _Broken("the state is not finite")
        self.calls_here = 0 if instant > self.reached else self.calls_here + 1
        if self.calls_here > _MOST_STALLED:
            raise _Broken("the step size is less than the spacing between numbers")
        if instant > self.reached:
            self.steps += 1
            if self.bounded and self.steps % _WINDOW == 0:
                if instant - self.window_start < _WINDOW * _LEAST_MEAN_STEP:
                    raise _Broken(f"the last {_WINDOW} steps advanced by less than {_LEAST_MEAN_STEP:g} s each")
                self.window_start = float(instant)
            if self.bounded and self.steps > _MOST_STEPS:
                raise _Broken(f"after {_MOST_STEPS} steps the trajectory has reached the most that is kept in memory")
            if self.watch is not None:
                self.watch(float(instant), x)
            if self.stop is not None and self.stop():
                self.stop_time = 0.5 * (self.reached + instant)
                return self.stop_time - instant
            self.reached = float(instant)
        return 1.0


def integrate(
    rhs: Callable[[float, Array], Array],
    start: Array,
    duration: float,
    *,
    method: str,
    rtol: float,
    atol: Array,
    longest: float = np.inf,
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
        longest: The longest step, s.
        watch: Called with the simulated time and the state after every step.
        stop: Asked after every step; true ends the integration there.
    """
    began = time.perf_counter()
    system, monitor = _System(rhs), _Monitor(watch, stop)
    options: dict[str, Any] = {} if method == "LSODA" else {"jac": _Jacobian(system, atol / rtol)}

    def solve(end: float, monitor: _Monitor) -> Any:
        # At the edge of what floating point holds, a rejected trial step overflows before its error is measured.
        with np.errstate(over="ignore", invalid="ignore"):
            return scipy.integrate.solve_ivp(
                system,
                (0.0, end),
                start,
                method=method,
                rtol=rtol,
                atol=atol,
                max_step=longest,
                dense_output=True,
                events=monitor,
                **options,
            )

    reason = ""
    try:
        solution = solve(duration, monitor)
    except (_Broken, ValueError, scipy.linalg.LinAlgError) as error:
        if error is system.error:
            raise
        if isinstance(error, _Broken):
            reason = str(error)
        else:
            reason = f"the state or its Jacobian is not finite ({error})"
        # Repeat up to the last good step, to keep what was computed.
        try:
            solution = solve(monitor.reached, _Monitor(None, None, bounded=False)) if monitor.reached > 0.0 else None
        except (ValueError, scipy.linalg.LinAlgError):
            # The Jacobian at that step's end, by differences.
            solution = None
    if solution is None:
        nothing = Statistics(0, system.evaluations, 0, 0, time.perf_counter() - began)
        return Trajectory(np.zeros(1), lambda at: np.tile(start, (len(at), 1)), nothing, failure=reason)
    if solution.status == -1 and not reason:
        reason = str(solution.message)
    dense = solution.sol
    return Trajectory(
        breakpoints=solution.t,
        interpolate=lambda at: np.asarray(dense(at).T),
        statistics=Statistics(
            steps=len(solution.t) - 1,
            evaluations=system.evaluations,
            jacobians=int(solution.njev),
            factorisations=int(solution.nlu),
            wall_time=time.perf_counter() - began,
        ),
        failure=reason,
        interrupted=solution.status == 1,
    )


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
