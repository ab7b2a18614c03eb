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


_SOLVERS = {"Radau": scipy.integrate.Radau, "BDF": scipy.integrate.BDF, "LSODA": scipy.integrate.LSODA}


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
    system = _System(rhs)
    times, pieces, reason, interrupted = [0.0], [], "", False
    solver = None
    # At the edge of what floating point holds, a rejected trial step overflows before its error is measured.
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            solver = _SOLVERS[method](system, 0.0, start, duration, rtol=rtol, atol=atol)
            while solver.status == "running" and not (reason or interrupted):
                message = solver.step()
                if solver.status == "failed":
                    reason = str(message)
                elif not np.all(np.isfinite(solver.y)):
                    reason = "the state is not finite"
                elif solver.t <= times[-1]:
                    reason = "the step size is less than the spacing between numbers"
                else:
                    times.append(float(solver.t))
                    pieces.append(solver.dense_output())
                    if progress is not None:
                        progress(times[-1])
                    interrupted = stop is not None and stop()
        except (ValueError, scipy.linalg.LinAlgError) as error:
            if error is system.error:
                raise
            # Non-finite numbers in scipy's linear algebra.
            reason = f"the state or its Jacobian is not finite ({error})"
    statistics = Statistics(
        steps=len(pieces),
        evaluations=system.evaluations,
        jacobians=int(solver.njev) if solver else 0,
        factorisations=int(solver.nlu) if solver else 0,
        wall_time=time.perf_counter() - began,
    )
    dense = scipy.integrate.OdeSolution(times, pieces, alt_segment=method != "Radau") if pieces else None
    return Trajectory(
        breakpoints=np.array(times),
        interpolate=lambda at: np.asarray(dense(at).T) if dense else np.tile(start, (len(at), 1)),
        statistics=statistics,
        failure=reason,
        interrupted=interrupted,
    )


class _System:
    """The right-hand side, counted; keeps an exception that it raises, to tell it from one of the solver's."""

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
