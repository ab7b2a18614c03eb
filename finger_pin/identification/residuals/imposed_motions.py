"""Imposed motions: the recorded motion of all joints is prescribed, and efforts and tensions are compared.

Between the readings a joint follows a spline of degree five, whose acceleration is smooth: through all readings, or as
smooth as it can be with its knots if it may pass beside them by the noise that the bench declares (P. Dierckx, Curve
and Surface Fitting with Splines, Oxford 1993, chapter 5). Bristles, springs, stops and tendons act as in any motion.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.interpolate import BSpline, PPoly, make_interp_spline, make_splrep

from finger_pin.control import ClosedLoop
from finger_pin.description.commands import WINDINGS
from finger_pin.description.recordings.bench import IMPOSED
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.parameters.keys import Corrections, corrections
from finger_pin.identification.residuals.motions import RecordedMotion
from finger_pin.identification.residuals.recorded_inputs import without_commands
from finger_pin.identification.residuals.recordings import RANGE_MARGIN, Recording
from finger_pin.mechanism.finger import Finger
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

_SPLINE_DEGREE = 5
# Extension of a motion's last piece, part of its duration, so that its end has an acceleration.
_END_EXTENSION = 1e-9
# A spline follows the noise where readings scatter by so many times its smoothing, and so large a part of the smooth
# motion's acceleration is added by that; it is at most so many times the noise over the square of the period.
_LEAST_EXCESS, _MOST_EXCESS_ACCELERATION, _NOISE_ACCELERATION = 1.5, 0.1, 5.0


class ImposedMotion(RecordedMotion):
    """Recorded motion of all joints, or a window of one, whose effort is compared."""

    def __init__(
        self,
        recording: Recording,
        scenario: Scenario,
        rows: NDArray[np.intp],
        window: int = 0,
        finger: Finger | None = None,
    ) -> None:
        """Put the inputs into the scenario, in place of its own commands; as `RecordedMotion`."""
        scenario, self._dropped = without_commands(scenario, recording)
        super().__init__(recording, scenario, rows, window, finger)

    def warnings(self, searched_keys: Collection[str]) -> list[str]:
        """Return warnings: of a motion's, of commands that are dropped, of splines that follow the noise."""
        dropped = (
            f"{self._entry}: {', '.join(self._dropped)} of the scenario is zero here, as no input gives it: a log of "
            "efforts has all that pulls among its inputs"
        )
        noisy = (_noise_warning(self.recording, name, spline) for name, spline in self._splines.items())
        return [*super().warnings(searched_keys), *([dropped] if self._dropped else []), *filter(None, noisy)]

    def _read_imposed_motion(self, scenario: Scenario) -> None:
        """Fit the splines."""
        recording = self.recording
        entry = f"{self._entry}.inputs"
        self._joint_columns = {joint: f"{IMPOSED}.{joint}" for joint in scenario.finger.joints}
        missing = [joint for joint, name in self._joint_columns.items() if name not in recording.inputs]
        if missing:
            allowed = f"lack {IMPOSED} of {', '.join(missing)}: the motion of every joint is given, or of none"
            raise InputError(entry, allowed)
        for name in recording.inputs:
            if name.startswith(f"{IMPOSED}.") and name not in self._joint_columns.values():
                allowed = f"there is no such joint; there are {', '.join(self._joint_columns)}"
                raise InputError(f"{entry}.{name}", allowed)
        for joint, name in self._joint_columns.items():
            _check_range(f"{entry}.{name}", recording.inputs[name], scenario, joint)
        _check_actuators(entry, recording, scenario)
        self._splines = _splines(recording)

    def ringing(self, scenario: Scenario, nuisance: Mapping[str, float]) -> str:
        """Return an empty text: no joint rings that is given its motion."""
        return ""

    def _loop(self, scenario: Scenario, nuisance: Mapping[str, float]) -> ClosedLoop:
        return super()._loop(scenario, nuisance).with_prescribed_motion(self._prescribed_motion(nuisance))

    def _imposed_corrections(self, nuisance: Mapping[str, float]) -> dict[str, Corrections]:
        return {name: corrections(self.recording.name, name, nuisance) for name in self._joint_columns.values()}

    def _prescribed_motion(self, nuisance: Mapping[str, float]) -> Signal:
        """Return the angles of the joints from the window's start on; beyond the readings their accelerations stay."""
        pieces = []
        for name, correction in self._imposed_corrections(nuisance).items():
            spline = self._splines[name]
            coefficients = correction.scale * spline.c
            coefficients[-1] += correction.offset
            delay = self.recording.settings.inputs[name].delay + correction.delay
            corrected = PPoly(coefficients, spline.x - self._start_time - delay)
            pieces.append(_extended_spline(corrected, float(self._times[-1])))
        return Signal.from_polynomials(pieces)


@lru_cache(maxsize=8)
def _splines(recording: Recording) -> dict[str, PPoly]:
    """Return the splines of the joints' columns over the recording's time, by column."""
    splines, time = {}, recording.time
    for name, values in recording.inputs.items():
        if not name.startswith(f"{IMPOSED}."):
            continue
        entry, smoothing = f"identify.recordings.{recording.name}", recording.settings.inputs[name].smoothing or 0.0
        if len(time) <= _SPLINE_DEGREE:
            raise InputError(f"{entry}.time", f"has {len(time)} rows: the spline of a joint's motion needs six")
        rms = float(np.std(values))
        if smoothing >= rms > 0.0:
            allowed = (
                f"must be below {rms:.3g} rad, the rms of the readings about their mean, which it would smooth away"
            )
            raise InputError(f"{entry}.inputs.{name}.smoothing", allowed, smoothing)
        padded = PPoly.from_spline(_smooth_spline(time, values, smoothing))
        splines[name] = PPoly(padded.c[:, _SPLINE_DEGREE:-_SPLINE_DEGREE], padded.x[_SPLINE_DEGREE:-_SPLINE_DEGREE])
    return splines


def _smooth_spline(time: Array, values: Array, smoothing: float) -> BSpline:
    """Return the spline of degree five with few knots that passes beside the values by a given rms, or through all."""
    if smoothing and np.ptp(values):
        return make_splrep(time, values, k=_SPLINE_DEGREE, s=len(time) * smoothing**2)
    return make_interp_spline(time, values, k=_SPLINE_DEGREE)


def _noise_warning(recording: Recording, name: str, spline: PPoly) -> str:
    """Return a warning about a spline whose accelerations are those of the readings' noise; empty without any."""
    time, values = recording.time, recording.inputs[name]
    smoothing, noise = recording.settings.inputs[name].smoothing or 0.0, _noise(time, values)
    followed = spline.derivative(2)(time)
    largest_excess = _NOISE_ACCELERATION * noise / float(np.median(np.diff(time))) ** 2
    if noise <= _LEAST_EXCESS * smoothing or largest_excess <= _MOST_EXCESS_ACCELERATION * np.std(followed):
        return ""
    smooth = _smooth_spline(time, values, noise).derivative(2)(time)
    excess, acceleration = (float(np.sqrt(np.mean(each**2))) for each in (followed - smooth, smooth))
    if excess <= _MOST_EXCESS_ACCELERATION * acceleration:
        return ""
    return (
        f"identify.recordings.{recording.name}.inputs.{name}.smoothing = {smoothing:g}: the spline follows the noise: "
        f"readings scatter by {noise:.2g} rad about a smooth motion, whose acceleration is {acceleration:.2g} rad/s2 "
        f"rms, and the spline's errs by {excess:.2g}; smoothing = {noise:.2g} leaves that out (times that jitter are "
        "noise of the angle, too)"
    )


def _noise(time: Array, values: Array) -> float:
    """Return the rms noise of readings of a smooth motion by their sixth divided differences, each over its deviation.

    A polynomial of degree five has none (J. von Neumann et al., Ann. Math. Statist. 12, 1941, for the first ones).
    """
    if len(time) < _SPLINE_DEGREE + 2:
        return 0.0
    nodes, windows = (sliding_window_view(each, _SPLINE_DEGREE + 2) for each in (time, values))
    distances = (nodes[:, :, None] - nodes[:, None, :]) / (nodes[:, -1] - nodes[:, 0])[:, None, None]
    weights = 1.0 / np.prod(distances + np.eye(_SPLINE_DEGREE + 2), axis=2)
    differences = np.sum(weights * windows, axis=1) / np.linalg.norm(weights, axis=1)
    return float(np.sqrt(np.mean(differences**2)))


def _extended_spline(spline: PPoly, end: float) -> PPoly:
    """Return a spline whose acceleration stays before its first knot and after its last one, from 0 to an end."""
    c, x = spline.c, spline.x.copy()
    x[-1] += _END_EXTENSION * (x[-1] - x[0])
    for at_end, time in ((False, min(0.0, x[0])), (True, max(end, x[-1]))):
        edge = x[-1 if at_end else 0]
        if time == edge:
            continue
        span, (value, rate, acceleration) = time - edge, (float(spline(edge, order)) for order in range(3))
        if not at_end:
            value, rate = value + rate * span + 0.5 * acceleration * span**2, rate + acceleration * span
        piece = np.array([0.0, 0.0, 0.0, 0.5 * acceleration, rate, value])[:, None]
        c = np.concatenate([c, piece] if at_end else [piece, c], axis=1)
        x = np.append(x, time) if at_end else np.append(time, x)
    return PPoly(c, x)


def _check_range(entry: str, values: Array, scenario: Scenario, joint: str) -> None:
    low, high = scenario.finger.joints[joint].range
    excess = np.maximum(low - values, values - high)
    if scenario.finger.joints[joint].limited and excess.max() > RANGE_MARGIN:
        allowed = f"is beyond the stops of {joint}, {low:.3g} to {high:.3g} rad, in row {int(np.argmax(excess)) + 1}"
        raise InputError(entry, f"{allowed}; widen its range, or limited = false", float(values[np.argmax(excess)]))


def _check_actuators(entry: str, recording: Recording, scenario: Scenario) -> None:
    """Refuse actuators that exert a force without an input: the log has their effort."""
    controller, inputs = scenario.controller, {name.partition(".")[2] for name in recording.inputs}
    inputs |= {name for group in ("inputs", *WINDINGS) for name in getattr(controller, group) or {}}
    follows_reference = any(name.startswith("joint_reference.") for name in recording.inputs)
    for motor, servo in scenario.finger.actuators.items():
        if servo.drive == "position" and not (follows_reference or {motor, *servo.tendons} & inputs):
            allowed = f"lack spool_angle.{motor}, the goal of a position drive: give it, or leave the motor out"
            raise InputError(entry, allowed)
    for tendon, settings in scenario.finger.tendons.items():
        if settings.winch is not None and tendon not in inputs:
            allowed = f"lack tendon_winding.{tendon}, which a winch holds: give it, or leave the winch out"
            raise InputError(entry, allowed)
    for name, actuator in scenario.finger.tree.actuators.items():
        exerts_force = any((actuator.offset, actuator.by_length, actuator.by_speed, actuator.integral, actuator.muscle))
        if exerts_force and name not in inputs:
            allowed = (
                f"lack actuator_input.{name}, which pushes without an input, too: give it, or leave the actuator out"
            )
            raise InputError(entry, allowed)
