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
from finger_pin.studies.executor import quiet
from finger_pin.typing import Array

#: Parts of its travel in which the ways of a fingertip are compared.
HYSTERESIS_BINS = 20
# Variables that command a finger, besides inputs of rows.
_COMMANDS = ("tendon_command", "tendon_winding", "spool_angle")
#: Share of its travel from its end that a joint is settled within.
SETTLED = 0.02
#: Share of a run, at its end, that a grip is judged by.
GRIP_TIME = 0.1


class Run:
    """Scenario and its lazily computed simulation.

    Attributes:
        scenario: The scenario; of a custom finger it has the description.
    """

    def __init__(self, scenario: ScenarioLike, stop: Stop | None = None, finger: Finger | None = None) -> None:
        """Keep a scenario, the function that stops its simulation, and a finger that replaces its own."""
        self.scenario, self._stop, self._finger = with_finger(load_scenario(scenario), finger), stop, finger

    def parts(self) -> dict[str, tuple[Scenario, Finger]]:
        """Return scenario and finger of every finger of a hand, or of the only one, by name."""
        parts = self.scenario.parts()
        custom_finger = self._finger if len(parts) == 1 else None
        return {name: (part, custom_finger or Finger(part.finger)) for name, part in parts.items()}

    @cached_property
    def result(self) -> xr.Dataset:
        """The Dataset of `simulate`."""
        # Studies look at many designs, and at the margin by its metric; they have a bar of their own.
        with quiet():
            return simulate(self.scenario, finger=self._finger, progress=lambda time: None, stop=self._stop)


def rows(result: xr.Dataset, name: str, dimension: str) -> Array:
    """Return a variable of a result by time and one more dimension."""
    return np.asarray(result[name].transpose("time", dimension).values)


def winding_temperature(run: Run) -> float:
    """Return the highest temperature of any winding, degC: C T' = R i^2 - (T - T_a) / R_th, from T_a on.

    Between samples the heat is linear in time, for which the equation is solved in closed form.

    Raises:
        InputError: If no motor says how its winding warms up.
    """
    highest = []
    for name, actuator in run.scenario.finger.actuators.items():
        winding = actuator.motor.winding
        if winding is None:
            continue
        _, resistance, _ = actuator.motor.constants
        time = run.result["time"].values
        level = winding.thermal_resistance * resistance * run.result["motor_current"].sel(motor=name).values ** 2
        steps = np.diff(time) / winding.time_constant
        kept, above = np.exp(-steps), 0.0
        # Of the integral of exp(-(h - s)) times 1 and s / h over a step of h time constants.
        whole = -np.expm1(-steps)
        late = np.where(steps > 1e-4, 1.0 - whole / np.maximum(steps, 1e-300), 0.5 * steps)
        gained = level[:-1] * (whole - late) + level[1:] * late
        peak = 0.0
        for share, more in zip(kept, gained, strict=True):
            above = share * above + more
            peak = max(peak, above)
        highest.append(winding.ambient + peak)
    if not highest:
        raise InputError("finger.actuators", "the metric winding_temperature needs motor.winding of a motor")
    return float(max(highest))


def fingertip_hysteresis(run: Run) -> float:
    """Return the largest distance of the fingertip on the way out from that on the way back, m.

    Way and place are those of the fingertip of the reference along the direction in which it moves most; the ways are
    compared in `HYSTERESIS_BINS` parts of its travel by the mean of the tip less that of the reference. Without a
    reference they are those of the command, and the tip's is less a cubic of it. Of a hand the largest of its fingers.

    Raises:
        InputError: If neither moves to and fro.
    """
    by_finger = [
        _hysteresis(run, name, finger, tip)
        for name, (_, finger) in run.parts().items()
        for tip in range(len(finger.rigid_body.tips))
    ]
    if all(np.isnan(by_finger)):
        what = "the reference" if has_reference(run.scenario) else "without a reference the command"
        raise InputError("fingertip_hysteresis", f"{what} must move to and fro")
    return float(np.nanmax(by_finger))


def has_reference(scenario: Scenario) -> bool:
    """Return whether a scenario has references: one of given tensions has none unless it states them."""
    return scenario.controller.kind != "tensions" or bool(scenario.reference.joints)


def _commands(result: xr.Dataset, prefix: str) -> Array:
    """Return the moving commands of a finger, each over its range, shape (m, k)."""
    commands = [np.zeros((result.sizes["time"], 0))]
    for name, variable in result.data_vars.items():
        if name in _COMMANDS or str(name).endswith("_input"):
            dims = [column for column in variable.dims if column != "time"]
            columns = np.asarray(variable.transpose("time", ...).values).reshape(result.sizes["time"], -1)
            names = [str(label) for label in variable[dims[0]].values] if dims else [""]
            commands.append(columns[:, [label.startswith(prefix) for label in names]])
    stacked = np.hstack(commands)
    span = np.ptp(stacked, axis=0)
    return np.asarray(stacked[:, span > 0.0] / span[span > 0.0])


def _hysteresis(run: Run, name: str, finger: Finger, tip_index: int) -> float:
    """Return the hysteresis of one fingertip, m; nan where nothing goes to and fro."""
    result = run.result
    prefix = f"{name}." if any("." in str(each) for each in result["joint"].values) else ""
    of_finger = result.sel(joint=[prefix + joint for joint in finger.routing.joints])

    def tip_of(variable: str) -> Array:
        angles = rows(of_finger, variable, "joint")
        return finger.motion(angles, np.zeros_like(angles)).tip.reshape(len(angles), -1, 3)[:, tip_index]

    tracked, tip = has_reference(run.scenario), tip_of("joint_position")
    course = tip_of("joint_reference") if tracked else _commands(result, prefix)
    centred = course - course.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0] if centred.any() else np.zeros(len(tip))
    travel = float(np.ptp(along))
    if travel < 1e-9:
        return np.nan
    wanted = course if tracked else np.vander(along, 4) @ np.linalg.lstsq(np.vander(along, 4), tip, rcond=None)[0]
    place = np.minimum((HYSTERESIS_BINS * (along - along.min()) / travel).astype(int), HYSTERESIS_BINS - 1)
    out = np.gradient(along) > 0.0
    error, apart = tip - wanted, np.nan
    for part in range(HYSTERESIS_BINS):
        there, back = (error[(place == part) & way] for way in (out, ~out))
        if len(there) and len(back):
            apart = np.fmax(apart, np.linalg.norm(there.mean(axis=0) - back.mean(axis=0)))
    return float(apart)


def settling_time(run: Run) -> float:
    """Return the time from which every joint stays within 2 % of its travel about its last position, s."""
    position = rows(run.result, "joint_position", "joint")
    away = np.abs(position - position[-1])
    # A joint that rounding alone moves is where it ends.
    outside = np.any(away > np.maximum(SETTLED * away.max(axis=0), 1e-9), axis=1)
    time = run.result["time"].values
    return float(time[np.flatnonzero(outside)[-1] + 1] - time[0]) if outside.any() else 0.0


def grip_margin(run: Run) -> float:
    """Return the friction margin of contacts over the last tenth of the run.

    1 - f^t / (what friction can be at that normal force), the least of all contacts that are closed and all times: 1
    where nothing rubs, 0 where something slides, and where nothing is touched.
    """
    result = run.result
    if "contact_friction" not in result:
        return 0.0
    time = result["time"].values
    last = time >= time[-1] - GRIP_TIME * (time[-1] - time[0])
    level, friction, normal = (
        rows(result, f"contact_{name}", "contact")[last] for name in ("level", "friction", "normal_force")
    )
    closed = (normal > 0.0) & (level > 0.0)
    return float(np.clip(np.min(1.0 - friction[closed] / level[closed]), 0.0, 1.0)) if closed.any() else 0.0
