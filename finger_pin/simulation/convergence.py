"""Convergence of a result: the run repeated at a tighter tolerance, and the time at which the two part."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.cancellation import Stop
from finger_pin.control.interface import Controller
from finger_pin.control.user_controllers import Samples
from finger_pin.description.loading import ScenarioLike, load_scenario, to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError, ScenarioWarning
from finger_pin.mechanism.coerce import FingerLike, resolve_finger
from finger_pin.references.reference import Reference
from finger_pin.simulation.accuracy import LEAST_TOLERANCES, with_tighter_tolerances
from finger_pin.simulation.initial_state import custom_parts
from finger_pin.simulation.recording import recorded_custom_parts
from finger_pin.simulation.simulate import simulate
from finger_pin.typing import Array

FACTOR, LIMIT = 100.0, 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class Convergence:
    """A run against its repetition at a tighter tolerance.

    As long as the runs stay together, their difference is the error of the run, because the repetition's is far less.

    Attributes:
        time: Shape (m,), s.
        joints: Names, n of them.
        difference: theta of the run less that of the repetition, shape (m, n), rad.
        limit: Runs that differ by more than this have parted, rad.
        rtol: Relative tolerance of the repetition.
        atol_scale: Absolute tolerance of the repetition over the scale of each kind of state.
    """

    time: Array
    joints: tuple[str, ...]
    difference: Array
    limit: float
    rtol: float
    atol_scale: float

    @property
    def largest(self) -> Array:
        """The largest difference of each joint, shape (n,), rad."""
        return np.asarray(np.abs(self.difference).max(axis=0))

    @property
    def parting_time(self) -> float | None:
        """The first time at which a joint differs by more than the limit, s; None if the runs stay together."""
        parted = np.flatnonzero(np.abs(self.difference).max(axis=1) > self.limit)
        return float(self.time[parted[0]]) if len(parted) else None

    @property
    def converged(self) -> bool:
        """True if the runs stay together."""
        return self.parting_time is None

    @property
    def verdict(self) -> str:
        """The outcome for a user, in a sentence or two."""
        repeated = f"repeated at rtol {self.rtol:g}, atol_scale {self.atol_scale:g}"
        if self.parting_time is None:
            return f"Converged: {repeated}, the motion is the same within {self.largest.max():.1e} rad."
        return (
            f"Warning: {repeated}, the run parts at t = {self.parting_time:.6g} s, by more than {self.limit:g} rad. "
            "What comes after that depends on the tolerance. Loops that hunt are that sensitive: "
            "try a smaller simulation.rtol and atol_scale, or a smaller controller.gain."
        )

    def __repr__(self) -> str:
        """Return the verdict: the arrays are thousands of numbers."""
        return f"<{type(self).__name__}: {self.verdict}>"

    def attach(self, result: xr.Dataset) -> xr.Dataset:
        """Return a result with the convergence check: its difference as a variable, its numbers as attributes."""
        attributes = {"units": "rad", "long_name": "joint angle less that of the run repeated at a tighter tolerance"}
        # A run that was interrupted may be longer than its repetition, or shorter.
        values = np.full((result.sizes["time"], len(self.joints)), np.nan)
        values[: len(self.time)] = self.difference
        checked = result.assign(convergence_difference=(("time", "joint"), values, attributes))
        return checked.assign_attrs(
            convergence=self.verdict,
            convergence_rtol=self.rtol,
            convergence_atol_scale=self.atol_scale,
            convergence_limit=self.limit,
            convergence_parting_time=math.nan if self.parting_time is None else self.parting_time,
        )


def scenario_to_repeat(scenario: Scenario, factor: float = FACTOR) -> Scenario:
    """Return a scenario with tolerances divided by a factor; refuse a factor that tightens nothing.

    Raises:
        InputError: If the factor is not above 1, or a tolerance is as tight as it can be.
    """
    if not 1.0 < factor < math.inf:
        raise InputError("factor", "must be above 1 and finite", factor)
    tighter = with_tighter_tolerances(scenario, factor)
    for name, least in LEAST_TOLERANCES.items():
        tolerance = getattr(scenario.simulation, name)
        if not getattr(tighter.simulation, name) < tolerance:
            allowed = f"must be above {least:g}, so that the run can be repeated at a tighter tolerance"
            raise InputError(f"simulation.{name}", allowed, tolerance)
    return tighter


def check_convergence(
    scenario: ScenarioLike,
    result: xr.Dataset | None = None,
    *,
    factor: float = FACTOR,
    limit: float = LIMIT,
    controller: Controller | Samples | None = None,
    reference: Reference | Samples | None = None,
    fingertip_force: Samples | None = None,
    finger: FingerLike | None = None,
    initial: ArrayLike | xr.Dataset | None = None,
    control_period: float | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Stop | None = None,
) -> Convergence:
    """Return the difference of a run to its repetition at a tighter tolerance, and the time at which they part.

    Args:
        scenario: The scenario, simulated already or now, its name, or the path of a file.
        result: Dataset of `simulate` for it; simulated now by default.
        factor: By which both tolerances are divided.
        limit: Joints that differ by more than this have parted, rad.
        controller: As for `simulate`.
        reference: As for `simulate`.
        fingertip_force: As for `simulate`.
        finger: As for `simulate`.
        initial: As for `simulate`.
        control_period: As for `simulate`.
        progress: Called with the simulated time of each run, s.
        stop: Called now and then; true ends the simulation that is running.

    Raises:
        InputError: If the tolerances cannot be tightened, the result is of another scenario, or it had a controller,
            reference, force, finger or initial state that is not among these arguments.
        IntegrationError: If an integrator cannot go on.
        Interrupted: After Ctrl-C, or if ``stop`` returned true.
    """
    scenario = load_scenario(scenario)
    tighter = scenario_to_repeat(scenario, factor)
    if not 0.0 < limit < math.inf:
        raise InputError("limit", "must be above 0 and finite", limit)
    finger = resolve_finger(finger, scenario)
    if result is not None:
        _check_same_run(result, scenario, custom_parts(controller, reference, fingertip_force, initial, finger))

    run = partial(
        simulate,
        controller=controller,
        reference=reference,
        fingertip_force=fingertip_force,
        finger=finger,
        initial=initial,
        control_period=control_period,
        progress=progress,
        stop=stop,
    )
    first = run(scenario) if result is None else result
    # The first run has given the warnings of both.
    with warnings.catch_warnings(action="ignore", category=ScenarioWarning):
        return _compare(first, run(tighter), limit, tighter)


def _check_same_run(result: xr.Dataset, scenario: Scenario, custom: str) -> None:
    """Refuse the result of another scenario, or one with other custom parts."""
    if result.attrs["scenario"] != to_toml(scenario):
        raise InputError("result", "is of another scenario")
    if recorded_custom_parts(result) != custom:
        raise InputError("result", f"had {recorded_custom_parts(result) or 'nothing'} of its own: give the same here")


def _compare(first: xr.Dataset, second: xr.Dataset, limit: float, tighter: Scenario) -> Convergence:
    """Return the difference of two runs, the second at the tolerances of ``tighter``, as far as both go."""
    count = min(first.sizes["time"], second.sizes["time"])
    angles = [each["joint_position"].transpose("time", "joint").values[:count] for each in (first, second)]
    return Convergence(
        time=np.asarray(second["time"].values[:count]),
        joints=tuple(map(str, first["joint"].values)),
        difference=angles[0] - angles[1],
        limit=limit,
        rtol=tighter.simulation.rtol,
        atol_scale=tighter.simulation.atol_scale,
    )
