"""Integration by CVODE of SUNDIALS, where the package scikit-sundae is installed: an independent reference."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np
import scipy

from finger_pin.core.stepping.textbook import Meeting, Statistics, Stop, Trajectory, Watch
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError


def integrate_cvode(
    rhs: Callable[[float, Array], Array],
    start: Array,
    duration: float,
    *,
    rtol: float,
    atol: Array,
    longest: float = np.inf,
    meeting: Meeting | None = None,
    watch: Watch | None = None,
    stop: Stop | None = None,
) -> Trajectory:
    """Integrate from time zero with CVODE's variable-order BDF; between its steps with cubic Hermite polynomials.

    Args:
        rhs: f(t, x), pure.
        start: x(0), shape (size,).
        duration: s.
        rtol: Relative tolerance.
        atol: Absolute tolerance, shape (size,).
        longest: The longest step, s.
        meeting: As for `textbook.integrate`.
        watch: Called with the simulated time and the state after every step.
        stop: Asked after every step; true ends the integration there.

    Raises:
        InputError: If scikit-sundae is not installed.
    """
    if importlib.util.find_spec("sksundae") is None:
        raise InputError("simulation.method", "needs the package scikit-sundae, which is not installed", "CVODE")
    from sksundae.cvode import CVODE

    began = time.perf_counter()
    evaluations = 0

    def fill(instant: float, x: Array, rate: Array) -> None:
        nonlocal evaluations
        evaluations += 1
        rate[:] = rhs(instant, x)

    # Zero is no limit.
    most = longest if np.isfinite(longest) else 0.0
    solver = CVODE(fill, rtol=rtol, atol=atol, max_step=most, max_num_steps=100_000, linsolver="dense")
    solver.init_step(0.0, start)
    times, states, rates = [0.0], [start], [rhs(0.0, start)]
    reason, interrupted, jacobians, end = "", False, 0, duration
    while times[-1] < duration and not reason and not interrupted:
        found = solver.step(end, method="onestep", tstop=end)
        instant, x = float(np.ravel(found.t)[-1]), np.array(np.atleast_2d(found.y)[-1])
        if not found.success or not np.isfinite(x).all() or instant <= times[-1]:
            reason = " ".join(str(found.message).split())
            break
        rate = rhs(instant, x)
        if meeting is not None:
            between = [times[-1], instant], [states[-1], x], [rates[-1], rate]
            met = meeting(times[-1], instant, scipy.interpolate.CubicHermiteSpline(*between))
            if met is not None:
                end = met
                solver.init_step(times[-1], states[-1])
                continue
        times.append(instant)
        states.append(x)
        rates.append(rate)
        jacobians = int(found.njev)
        if instant >= end:
            end = duration
        if watch is not None:
            watch(instant, x)
        interrupted = stop is not None and instant < duration and stop()
    statistics = Statistics(len(times) - 1, evaluations, jacobians, 0, time.perf_counter() - began)
    breakpoints = np.array(times)
    if len(times) == 1:
        return Trajectory(breakpoints, lambda at: np.tile(start, (len(at), 1)), statistics, reason, interrupted)
    spline = scipy.interpolate.CubicHermiteSpline(breakpoints, np.array(states), np.array(rates))
    return Trajectory(breakpoints, lambda at: np.asarray(spline(at)), statistics, reason, interrupted)
