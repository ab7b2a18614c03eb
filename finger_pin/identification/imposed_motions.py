"""Recorded motions of all joints that are given: the effort that they take is compared, and what pulls beside it.

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
from finger_pin.identification.recordings import BEYOND, Recording
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

_DEGREE = 5
# Part of a motion's length by which its last piece goes on, so that its end has an acceleration.
_ON = 1e-9


class ImposedMotion(RecordedMotion):
    """Recorded motion of all joints, or a window of one, whose effort is compared."""

    def _read_imposed(self, scenario: Scenario) -> None:
        """Fit the splines.

        Raises:
            InputError: If a joint's motion is missing, too short, smoothed away or beyond the joint's stops.
        """
        recording = self.recording
        entry = f"{self._entry}.inputs"
        self._columns = {joint: f"{IMPOSED}.{joint}" for joint in scenario.finger.joints}
        missing = [joint for joint, name in self._columns.items() if name not in recording.inputs]
        if missing:
            allowed = f"lack {IMPOSED} of {', '.join(missing)}: the motion of every joint is given, or of none"
            raise InputError(entry, allowed)
        for name in recording.inputs:
            if name.startswith(f"{IMPOSED}.") and name not in self._columns.values():
                raise InputError(f"{entry}.{name}", f"there is no such joint; there are {', '.join(self._columns)}")
        for joint, name in self._columns.items():
            _check_range(f"{entry}.{name}", recording.inputs[name], scenario, joint)
        _check_actuators(entry, recording, scenario)
        self._splines = _splines(recording)

    def _loop(self, scenario: Scenario, nuisance: Mapping[str, float]) -> ClosedLoop:
        return super()._loop(scenario, nuisance).along(self._motion(nuisance))

    def _imposed(self, nuisance: Mapping[str, float]) -> dict[str, Corrections]:
        return {name: corrections(self.recording.name, name, nuisance) for name in self._columns.values()}

    def _motion(self, nuisance: Mapping[str, float]) -> Signal:
        """Return the angles of the joints from the window's start on; beyond the readings their accelerations stay."""
        pieces = []
        for name, numbers in self._imposed(nuisance).items():
            spline = self._splines[name]
            coefficients = numbers.scale * spline.c
            coefficients[-1] += numbers.offset
            late = self.recording.settings.inputs[name].delay + numbers.delay
            pieces.append(_extended(PPoly(coefficients, spline.x - self._first - late), float(self._times[-1])))
        return Signal.from_polynomials(pieces)


@lru_cache(maxsize=8)
def _splines(recording: Recording) -> dict[str, PPoly]:
    """Return the splines of the joints' columns over the recording's time, by column."""
    splines, time = {}, recording.time
    for name, values in recording.inputs.items():
        if not name.startswith(f"{IMPOSED}."):
            continue
        entry, smoothing = f"identify.recordings.{recording.name}", recording.settings.inputs[name].smoothing or 0.0
        if len(time) <= _DEGREE:
            raise InputError(f"{entry}.time", f"has {len(time)} rows: the spline of a joint's motion needs six")
        size = float(np.std(values))
        if smoothing >= size > 0.0:
            allowed = (
                f"must be below {size:.3g} rad, the rms of the readings about their mean, which it would smooth away"
            )
            raise InputError(f"{entry}.inputs.{name}.smoothing", allowed, smoothing)
        if smoothing and size:
            spline = make_splrep(time, values, k=_DEGREE, s=len(time) * smoothing**2)
        else:
            spline = make_interp_spline(time, values, k=_DEGREE)
        whole = PPoly.from_spline(spline)
        splines[name] = PPoly(whole.c[:, _DEGREE:-_DEGREE], whole.x[_DEGREE:-_DEGREE])
    return splines


def _extended(spline: PPoly, end: float) -> PPoly:
    """Return a spline whose acceleration stays before its first knot and after its last one, from 0 to an end."""
    c, x = spline.c, spline.x.copy()
    x[-1] += _ON * (x[-1] - x[0])
    for late, time in ((False, min(0.0, x[0])), (True, max(end, x[-1]))):
        edge = x[-1 if late else 0]
        if time == edge:
            continue
        way, (value, rate, curve) = time - edge, (float(spline(edge, order)) for order in range(3))
        if not late:
            value, rate = value + rate * way + 0.5 * curve * way**2, rate + curve * way
        piece = np.array([0.0, 0.0, 0.0, 0.5 * curve, rate, value])[:, None]
        c = np.concatenate([c, piece] if late else [piece, c], axis=1)
        x = np.append(x, time) if late else np.append(time, x)
    return PPoly(c, x)


def _check_range(entry: str, values: Array, scenario: Scenario, joint: str) -> None:
    low, high = scenario.finger.joints[joint].range
    beyond = np.maximum(low - values, values - high)
    if scenario.finger.joints[joint].limited and beyond.max() > BEYOND:
        allowed = f"is beyond the stops of {joint}, {low:.3g} to {high:.3g} rad, in row {int(np.argmax(beyond)) + 1}"
        raise InputError(entry, f"{allowed}; widen its range, or limited = false", float(values[np.argmax(beyond)]))


def _check_actuators(entry: str, recording: Recording, scenario: Scenario) -> None:
    """Refuse a tree's actuators that would add forces without an input: what a log has is their effort."""
    inputs = {*(scenario.controller.inputs or {}), *(name.partition(".")[2] for name in recording.inputs)}
    for name, each in scenario.finger.tree.actuators.items():
        acts = any((each.offset, each.by_length, each.by_speed, each.integral, each.muscle))
        if acts and name not in inputs:
            allowed = (
                f"lack actuator_input.{name}, which pushes without an input, too: give it, or leave the actuator out"
            )
            raise InputError(entry, allowed)
