"""Integration of x' = f(t, x) by scipy's stiff solvers: the readable path, and a reference for the compiled one."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import scipy

from finger_pin.cancellation import Stop
from finger_pin.core.steps.trajectory import Meeting, Statistics, Trajectory, Watch
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
    longest: float = np.inf,
    meeting: Meeting | None = None,
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
        meeting: Finds when bodies meet within a step that does not show it: it is taken again, to end there.
        watch: Called with the simulated time and the state after every step.
        stop: Asked after every step; true ends the integration there.
    """
    began = time.perf_counter()
    system, run = _System(rhs), _Steps([0.0], [], [])
    options: dict[str, Any] = {"rtol": rtol, "atol": atol, "max_step": longest}
    if method in ("Radau", "BDF"):
        options["jac"] = _Jacobian(system, atol / rtol)
    solver = partial(run.solver, getattr(scipy.integrate, method), system, options)
    x, reason, interrupted, current = np.array(start, dtype=float), "", False, None
    while run.times[-1] < duration and not reason and not interrupted:
        current, reason = _take_step(current, partial(solver, x, duration), system, run.times[-1])
        if reason:
            break
        reached, dense = float(current.t), current.dense_output()
        met = None if meeting is None else meeting(run.times[-1], reached, _transposed(dense))
        if met is not None:
            current = solver(x, met)
            continue
        run.times.append(reached)
        run.dense.append(dense)
        x = current.y.copy()
        reason = run.exhausted
        if watch is not None:
            watch(reached, x)
        interrupted = stop is not None and not reason and reached < duration and stop()
    return Trajectory(
        breakpoints=np.array(run.times),
        interpolate=run.interpolant(start),
        statistics=run.statistics(system.evaluations, time.perf_counter() - began),
        failure=reason,
        interrupted=interrupted,
    )


def _take_step(solver: Any, renewed: Callable[[], Any], system: _System, last: float) -> tuple[Any, str]:
    """Take a step, with a new solver if there is none; return the solver, and the step's fault or an empty text."""
    try:
        # At the edge of what floating point holds, a rejected trial step overflows before its error is measured.
        with np.errstate(over="ignore", invalid="ignore"):
            if solver is None or solver.status == "finished":
                solver = renewed()
            return solver, _fault(solver, solver.step(), last)
    except (ValueError, scipy.linalg.LinAlgError) as error:
        if error is system.error:
            raise
        return solver, f"the state or its Jacobian is not finite ({error})"


def _fault(solver: Any, message: str | None, last: float) -> str:
    """Return the fault of a step that scipy has made from a time, s; empty for none."""
    if solver.status == "failed":
        return str(message)
    if not np.all(np.isfinite(solver.y)):
        return "the state is not finite"
    return "" if float(solver.t) > last else "the step size is less than the spacing between numbers"


def _transposed(dense: Any) -> Callable[[Array], Array]:
    return lambda at: np.asarray(dense(at).T)


@dataclass(frozen=True)
class _Steps:
    """The ends of steps with the start first, their interpolants, and the solvers that took them."""

    times: list[float]
    dense: list[Any]
    solvers: list[Any]

    def solver(self, kind: Any, system: _System, options: Mapping[str, Any], x: Array, end: float) -> Any:
        """Return a new solver that starts where the steps end, at a state."""
        self.solvers.append(kind(system, self.times[-1], x, end, **options))
        return self.solvers[-1]

    @property
    def exhausted(self) -> str:
        """The reason to stop, steps that are too short or too many; empty without one."""
        steps = len(self.dense)
        if steps > _MOST_STEPS:
            return f"after {_MOST_STEPS} steps the trajectory has reached the most that is kept in memory"
        if steps % _WINDOW == 0 and self.times[-1] - self.times[-1 - _WINDOW] < _WINDOW * _LEAST_MEAN_STEP:
            return f"the last {_WINDOW} steps advanced by less than {_LEAST_MEAN_STEP:g} s each"
        return ""

    def statistics(self, evaluations: int, wall_time: float) -> Statistics:
        """Return the statistics of the steps."""
        jacobians, factorisations = (sum(int(getattr(each, n)) for each in self.solvers) for n in ("njev", "nlu"))
        return Statistics(len(self.dense), evaluations, jacobians, factorisations, wall_time)

    def interpolant(self, start: Array) -> Callable[[Array], Array]:
        """Return the function from times to states."""
        if not self.dense:
            return lambda at: np.tile(start, (len(at), 1))
        return _transposed(scipy.integrate.OdeSolution(self.times, self.dense))


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
