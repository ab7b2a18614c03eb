"""Imposed motions: the recorded motion of all joints is prescribed, and efforts and tensions are compared.

Between the readings a joint follows a spline of degree five, whose acceleration is smooth: through all readings, or as
smooth as it can be with its knots if it may pass beside them by the noise that the bench declares (P. Dierckx, Curve
and Surface Fitting with Splines, Oxford 1993, chapter 5). Bristles, springs, stops and tendons act as in any motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from scipy.interpolate import PPoly, make_interp_spline, make_splrep

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.description.recordings.bench import IMPOSED
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.motions import RecordedMotion
from finger_pin.identification.recorded_inputs import Corrections, corrections
from finger_pin.identification.recordings import RANGE_MARGIN, Recording
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

_SPLINE_DEGREE = 5
# Extension of a motion's last piece, part of its duration, so that its end has an acceleration.
_END_EXTENSION = 1e-9


class ImposedMotion(RecordedMotion):
    """Recorded motion of all joints, or a window of one, whose effort is compared."""

    def _read_imposed_motion(self, scenario: Scenario) -> None:
        """Fit the splines.

        Raises:
            InputError: If a joint's motion is missing, too short, smoothed away or beyond the joint's stops.
        """
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
        if smoothing and rms:
            spline = make_splrep(time, values, k=_SPLINE_DEGREE, s=len(time) * smoothing**2)
        else:
            spline = make_interp_spline(time, values, k=_SPLINE_DEGREE)
        padded = PPoly.from_spline(spline)
        splines[name] = PPoly(padded.c[:, _SPLINE_DEGREE:-_SPLINE_DEGREE], padded.x[_SPLINE_DEGREE:-_SPLINE_DEGREE])
    return splines


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
    """Refuse a tree's actuators that exert a force without an input: the log has their effort."""
    inputs = {*(scenario.controller.inputs or {}), *(name.partition(".")[2] for name in recording.inputs)}
    for name, actuator in scenario.finger.tree.actuators.items():
        exerts_force = any((actuator.offset, actuator.by_length, actuator.by_speed, actuator.integral, actuator.muscle))
        if exerts_force and name not in inputs:
            allowed = (
                f"lack actuator_input.{name}, which pushes without an input, too: give it, or leave the actuator out"
            )
            raise InputError(entry, allowed)
