"""A run to be measured, and metrics of its response: hysteresis, settling, heat in windings, margin of a grip."""

from __future__ import annotations

import numpy as np
import xarray as xr

from finger_pin.cancellation import Stop
from finger_pin.description.caching import cached_property
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import with_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.simulate import simulate
from finger_pin.studies.executor import without_scenario_warnings
from finger_pin.typing import Array

#: Parts of its travel in which the ways of a fingertip are compared.
HYSTERESIS_BINS = 20
# Variables that command a finger, besides inputs of rows.
_COMMAND_VARIABLES = ("tendon_command", "tendon_winding", "spool_angle")
#: Share of its travel from its end that a joint is settled within.
SETTLING_BAND = 0.02
#: Share of a run, at its end, that a grip is judged by.
GRIP_SHARE = 0.1


class Run:
    """Scenario and its lazily computed simulation.

    Attributes:
        scenario: The scenario; of a custom finger it has the description.
    """

    def __init__(self, scenario: ScenarioLike, stop: Stop | None = None, finger: Finger | None = None) -> None:
        """Store a scenario, the function that stops its simulation, and a custom finger."""
        self.scenario, self._stop, self._finger = with_finger(load_scenario(scenario), finger), stop, finger

    def parts(self) -> dict[str, tuple[Scenario, Finger]]:
        """Return scenario and finger of every finger of a hand, or of the only one, by name."""
        parts = self.scenario.parts()
        custom_finger = self._finger if len(parts) == 1 else None
        return {name: (part, custom_finger or Finger(part.finger)) for name, part in parts.items()}

    @cached_property
    def result(self) -> xr.Dataset:
        """The Dataset of `simulate`."""
        # Studies simulate many designs, have a metric for the margin, and show the progress bar.
        with without_scenario_warnings():
            return simulate(self.scenario, finger=self._finger, progress=lambda time: None, stop=self._stop)


def rows(result: xr.Dataset, name: str, dimension: str) -> Array:
    """Return a variable of a result by time and one more dimension."""
    return np.asarray(result[name].transpose("time", dimension).values)


def winding_temperature(run: Run) -> float:
    """Return the highest temperature of any winding, degC: C T' = R i^2 - (T - T_a) / R_th, from T_a on.

    Between samples the heat is linear in time, for which the equation is solved in closed form.
    """
    temperatures = []
    for name, actuator in run.scenario.finger.actuators.items():
        winding = actuator.motor.winding
        if winding is None:
            continue
        _, resistance, _ = actuator.motor.constants
        time = run.result["time"].values
        level = winding.thermal_resistance * resistance * run.result["motor_current"].sel(motor=name).values ** 2
        steps = np.diff(time) / winding.time_constant
        decay, rise = np.exp(-steps), 0.0
        # Integrals of exp(-(h - s)) times 1 and s / h over a step of h time constants.
        weight_sum = -np.expm1(-steps)
        late_weight = np.where(steps > 1e-4, 1.0 - weight_sum / np.maximum(steps, 1e-300), 0.5 * steps)
        heating = level[:-1] * (weight_sum - late_weight) + level[1:] * late_weight
        peak = 0.0
        for factor, step_rise in zip(decay, heating, strict=True):
            rise = factor * rise + step_rise
            peak = max(peak, rise)
        temperatures.append(winding.ambient + peak)
    if not temperatures:
        raise InputError("finger.actuators", "the metric winding_temperature needs motor.winding of a motor")
    return float(max(temperatures))


def fingertip_hysteresis(run: Run) -> float:
    """Return the largest distance of the fingertip on the way out from that on the way back, m.

    Direction and place are those of the reference fingertip along the line on which it moves most; both directions are
    compared in `HYSTERESIS_BINS` parts of its travel by the mean of the tip less the reference. Without a
    reference the command replaces it, and a cubic of it the path. Of a hand the largest of its fingers.
    """
    hystereses = [
        _hysteresis(run, name, finger, tip)
        for name, (_, finger) in run.parts().items()
        for tip in range(len(finger.rigid_body.tips))
    ]
    if all(np.isnan(hystereses)):
        moving_part = "the reference" if has_reference(run.scenario) else "without a reference the command"
        raise InputError("fingertip_hysteresis", f"{moving_part} must move to and fro")
    return float(np.nanmax(hystereses))


def has_reference(scenario: Scenario) -> bool:
    """Return whether a scenario has references; with prescribed tensions it may have none."""
    return scenario.controller.kind != "tensions" or bool(scenario.reference.joints)


def _commands(result: xr.Dataset, prefix: str) -> Array:
    """Return the moving commands of a finger, each over its range, shape (m, k)."""
    commands = [np.zeros((result.sizes["time"], 0))]
    for name, variable in result.data_vars.items():
        if name in _COMMAND_VARIABLES or str(name).endswith("_input"):
            dims = [column for column in variable.dims if column != "time"]
            columns = np.asarray(variable.transpose("time", ...).values).reshape(result.sizes["time"], -1)
            names = [str(label) for label in variable[dims[0]].values] if dims else [""]
            commands.append(columns[:, [label.startswith(prefix) for label in names]])
    signals = np.hstack(commands)
    span = np.ptp(signals, axis=0)
    return np.asarray(signals[:, span > 0.0] / span[span > 0.0])


def _hysteresis(run: Run, name: str, finger: Finger, tip_index: int) -> float:
    """Return the hysteresis of one fingertip, m; nan where nothing goes to and fro."""
    result = run.result
    prefix = f"{name}." if any("." in str(joint) for joint in result["joint"].values) else ""
    finger_result = result.sel(joint=[*finger.routing.joints])

    def tip_positions(variable: str) -> Array:
        angles = rows(finger_result, variable, "joint")
        return finger.motion(angles, np.zeros_like(angles)).tip.reshape(len(angles), -1, 3)[:, tip_index]

    has_path, tip = has_reference(run.scenario), tip_positions("joint_position")
    path = tip_positions("joint_reference") if has_path else _commands(result, prefix)
    centred = path - path.mean(axis=0)
    travelled = centred @ np.linalg.svd(centred, full_matrices=False)[2][0] if centred.any() else np.zeros(len(tip))
    travel = float(np.ptp(travelled))
    if travel < 1e-9:
        return np.nan
    ideal = path if has_path else np.vander(travelled, 4) @ np.linalg.lstsq(np.vander(travelled, 4), tip, rcond=None)[0]
    bins = np.minimum((HYSTERESIS_BINS * (travelled - travelled.min()) / travel).astype(int), HYSTERESIS_BINS - 1)
    outward = np.gradient(travelled) > 0.0
    error, largest = tip - ideal, np.nan
    for index in range(HYSTERESIS_BINS):
        forward, backward = (error[(bins == index) & direction] for direction in (outward, ~outward))
        if len(forward) and len(backward):
            largest = np.fmax(largest, np.linalg.norm(forward.mean(axis=0) - backward.mean(axis=0)))
    return float(largest)


def settling_time(run: Run) -> float:
    """Return the time from which every joint stays within 2 % of its travel about its last position, s."""
    position = rows(run.result, "joint_position", "joint")
    deviation = np.abs(position - position[-1])
    # A joint that moves by rounding alone has settled.
    outside = np.any(deviation > np.maximum(SETTLING_BAND * deviation.max(axis=0), 1e-9), axis=1)
    time = run.result["time"].values
    return float(time[np.flatnonzero(outside)[-1] + 1] - time[0]) if outside.any() else 0.0


def grip_margin(run: Run) -> float:
    """Return the friction margin of contacts over the last tenth of the run.

    1 - f^t / (largest friction at that normal force), the least of all closed contacts and all times: 1 without
    friction, 0 where a contact slides or nothing is touched.
    """
    result = run.result
    if "contact_friction" not in result:
        return 0.0
    time = result["time"].values
    final = time >= time[-1] - GRIP_SHARE * (time[-1] - time[0])
    level, friction, normal = (
        rows(result, f"contact_{name}", "contact")[final] for name in ("level", "friction", "normal_force")
    )
    closed = (normal > 0.0) & (level > 0.0)
    return float(np.clip(np.min(1.0 - friction[closed] / level[closed]), 0.0, 1.0)) if closed.any() else 0.0
