"""Metrics: scalar measures of the quality of a design.

Metrics of the motion are taken over the whole run, its start from rest included, and are means over time, not over
samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cloudpickle
import numpy as np
import xarray as xr

from finger_pin.analysis import force_polytope, self_locking_margin, spring_return
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.groups import JOINT_LOSSES, TENDON_LOSSES
from finger_pin.mechanism.rows import LOST
from finger_pin.references.reference import SignalReference
from finger_pin.simulation.energy import account_entries
from finger_pin.studies.response import (
    Run,
    fingertip_hysteresis,
    grip_margin,
    has_reference,
    rows,
    settling_time,
    winding_temperature,
)
from finger_pin.typing import Array

#: Greatest tension for the metric of the fingertip force, N.
FORCE_TENSION = 20.0
_NO_TENDONS = "needs finger.tendons, and there are none: servos and muscles of a tree pull its own cords"
_NO_REFERENCE = "needs a reference: controller.kind is tensions, and reference.joints is empty"


@dataclass(frozen=True)
class Metric:
    """Scalar measure of the quality of a run.

    Attributes:
        name: Name by which it is asked for.
        unit: SI unit.
        long_name: Its name in words.
        measure: Takes a run and returns the number. Other processes call it.
        needs_reference: Whether it has no meaning without a reference of the joints.
        needs_tendons: Whether it has no meaning without tendons that ideal sources pull, or passive ones.
    """

    name: str
    unit: str
    long_name: str
    measure: Callable[[Run], float]
    needs_reference: bool = False
    needs_tendons: bool = False

    def missing_part(self, scenario: Scenario) -> str:
        """Return a message on the part that the metric needs and a scenario lacks; empty if there is none."""
        if self.needs_reference and not has_reference(scenario):
            return _NO_REFERENCE
        return _NO_TENDONS if self.needs_tendons and not scenario.finger.tendons else ""


def resolve_metrics(names: Iterable[str | Metric]) -> tuple[Metric, ...]:
    """Return metrics by name; instances of `Metric` are kept."""
    chosen: dict[str, Metric] = {}
    for choice in names:
        if isinstance(choice, str) and choice not in METRICS:
            hint = suggestion(choice, METRICS)
            raise InputError("metric", f"there is no such metric; there are {', '.join(METRICS)}{hint}", choice)
        metric = METRICS[choice] if isinstance(choice, str) else choice
        try:
            cloudpickle.dumps(metric)
        except Exception as error:
            problem = f"cannot be sent to other processes: {type(error).__name__}: {error}"
            raise InputError("metric", problem, metric.name) from None
        if metric.name in chosen:
            raise InputError("metric", "must not come twice", metric.name)
        chosen[metric.name] = metric
    if not chosen:
        raise InputError("metric", f"at least one is needed; there are {', '.join(METRICS)}")
    return tuple(chosen.values())


def scenario_metrics(scenario: Scenario, names: Iterable[str | Metric] | None = None) -> tuple[Metric, ...]:
    """Return metrics by name, or those of `DEFAULT_METRICS` that mean something for a scenario."""
    chosen = resolve_metrics(DEFAULT_METRICS if names is None else names)
    if names is None:
        return tuple(metric for metric in chosen if not metric.missing_part(scenario))
    for metric in chosen:
        if missing := metric.missing_part(scenario):
            raise InputError("metric", missing, metric.name)
    return chosen


def tracking_rms(run: Run) -> float:
    """Return the root of the mean over time and joints of (theta^d - theta)^2, rad."""
    return float(np.sqrt(_time_mean(run.result, np.mean(_errors(run) ** 2, axis=1))))


def tracking_peak(run: Run) -> float:
    """Return the largest |theta^d - theta| of any joint, rad."""
    return float(np.max(np.abs(_errors(run))))


def _errors(run: Run) -> Array:
    """Return theta^d - theta, shape (m, n), rad, of a run that has a reference."""
    if not has_reference(run.scenario):
        raise InputError("metric", _NO_REFERENCE, "tracking error")
    return rows(run.result, "tracking_error", "joint")


def tension_peak(run: Run) -> float:
    """Return the largest tension at either end of any tendon, N: f^a or f^m, f, f5_3 or f5_4."""
    return float(max(np.max(ends) for ends in _end_tensions(run) if ends.size))


def tension_mean(run: Run) -> float:
    """Return the mean over time and tendons of the delivered tension f, N; of passive tendons f5_4."""
    return _time_mean(run.result, np.mean(_delivered_tension(run), axis=1))


def losses(run: Run) -> float:
    """Return the energy lost, J, without the heat in the windings."""
    return sum(float(each[-1]) for each in account_entries(run.result, LOST).values()) - heat(run)


def losses_tendons(run: Run) -> float:
    """Return the energy lost to the friction of the tendons, J."""
    return sum(_final_value(run.result, each.name) for each in TENDON_LOSSES)


def losses_joints(run: Run) -> float:
    """Return the energy lost to the friction of the joints, J."""
    return sum(_final_value(run.result, each.name) for each in JOINT_LOSSES)


def slack_time(run: Run) -> float:
    """Return the time with a tendon, or half of a passive one, without tension at an end, s."""
    delivered = [np.min(_delivered_tension(run), axis=1)]
    if "spool_tension" in run.result:
        delivered.append(rows(run.result, "spool_tension", "tendon").min(axis=1))
    if "passive_tension_proximal" in run.result:
        delivered.append(_proximal_tension(run.result).min(axis=1))
    slack = (np.min(delivered, axis=0) <= 0.0).astype(float)
    return float(np.trapezoid(slack, run.result["time"].values))


def heat(run: Run) -> float:
    """Return the heat in the windings of the motors, J; 0 for a finger without motors."""
    return _final_value(run.result, "motor_heat") if "motor_current" in run.result else 0.0


def current_peak(run: Run) -> float:
    """Return the largest current of any motor, A; 0 for a finger without motors."""
    result = run.result
    return float(np.max(np.abs(result["motor_current"].values))) if "motor_current" in result else 0.0


def locking_margin(run: Run) -> float:
    """Return the ratio of critical to actual stiction of the joints."""
    return self_locking_margin(run.scenario).margin


def return_ratio(run: Run) -> float:
    """Return the least tension on the way out over that on the way in; of a hand that of its worst finger."""
    return min(spring_return(finger).ratio for _, finger in run.parts().values())


def fingertip_force(run: Run) -> float:
    """Return the largest fingertip force that is possible in every direction, N.

    It is the radius of the largest ball around zero in the polytope of forces, without friction, at the mean posture
    of the reference, with tensions up to `FORCE_TENSION`; of a hand that of its weakest finger.
    """
    return min(_fingertip_force(*part) for part in run.parts().values())


def _fingertip_force(scenario: Scenario, finger: Finger) -> float:
    times = scenario.simulation.duration * (np.arange(500) + 0.5) / 500
    posture = np.mean(SignalReference.from_scenario(scenario, finger.routing).at(times).position, axis=0)
    tips = finger.description.tree.tip_names or (None,)
    sets = [force_polytope(finger, posture, FORCE_TENSION, tip=tip).offsets for tip in tips]
    return min(float(np.min(offsets)) if offsets.size else 0.0 for offsets in sets)


def _proximal_tension(result: xr.Dataset) -> Array:
    values = np.asarray(result["passive_tension_proximal"].transpose("time", ...).values)
    return values.reshape(len(values), -1)


def _delivered_tension(run: Run) -> Array:
    """Return f, shape (m, t), N, of a run that has tendons."""
    if not run.result.sizes["tendon"]:
        raise InputError("metric", _NO_TENDONS, "tension")
    return rows(run.result, "tendon_tension", "tendon")


def _end_tensions(run: Run) -> list[Array]:
    """Return the tensions at both ends of all tendons; planned ones of passive tendons are no commands."""
    result, delivered = run.result, _delivered_tension(run)
    if "spool_tension" in result:
        return [delivered, rows(result, "spool_tension", "tendon")]
    command = rows(result, "tendon_command", "tendon")
    if "passive_tension_proximal" not in result:
        return [delivered, command]
    proximal = _proximal_tension(result)
    return [delivered, proximal, command[:, : command.shape[1] - proximal.shape[1]]]


def _time_mean(result: xr.Dataset, values: Array) -> float:
    time = result["time"].values
    return float(np.trapezoid(values, time) / (time[-1] - time[0]))


def _final_value(result: xr.Dataset, name: str) -> float:
    return float(result[f"energy_exchanged_{name}"][-1])


#: All metrics by name.
METRICS = {
    metric.name: metric
    for metric in (
        Metric("tracking_rms", "rad", "tracking error, rms over time and joints", tracking_rms, True),
        Metric("tracking_peak", "rad", "largest tracking error of any joint", tracking_peak, True),
        Metric("tension_peak", "N", "largest tension at either end of any tendon", tension_peak, needs_tendons=True),
        Metric("tension_mean", "N", "delivered tension, mean over time and tendons", tension_mean, needs_tendons=True),
        Metric("losses", "J", "energy lost, but for the heat in windings", losses),
        Metric("losses_tendons", "J", "energy lost to the friction of the tendons", losses_tendons),
        Metric("losses_joints", "J", "energy lost to the friction of the joints", losses_joints),
        Metric("slack_time", "s", "time with a slack tendon", slack_time, needs_tendons=True),
        Metric("heat", "J", "heat in the windings of the motors", heat),
        Metric("winding_temperature", "degC", "highest temperature of a winding", winding_temperature),
        Metric("fingertip_hysteresis", "m", "fingertip on the way out and back, apart at most", fingertip_hysteresis),
        Metric("settling_time", "s", "time until all joints stay near their end", settling_time),
        Metric("grip_margin", "1", "friction that contacts have left at the end, share", grip_margin),
        Metric("current_peak", "A", "largest current of any motor", current_peak),
        Metric("self_locking_margin", "1", "critical over actual joint friction", locking_margin, True),
        Metric("return_ratio", "1", "tension at which springs return over that which winds in", return_ratio),
        Metric(
            "fingertip_force",
            "N",
            f"fingertip force that is possible in every direction with tensions up to {FORCE_TENSION:g} N",
            fingertip_force,
            True,
        ),
    )
}
#: Those that a sweep measures when none is named.
DEFAULT_METRICS = ("tracking_rms", "tracking_peak", "tension_peak", "tension_mean", "losses", "slack_time")
