"""Starts of recorded motions: angles and speeds that their columns begin with."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.recordings import RANGE_MARGIN, Recording
from finger_pin.identification.scenario_parameters import NuisanceParameter, corrections

# Half range of an estimated start about the recorded one, rad.
_START_MARGIN = 0.3
# Number of samples at a window's start for the line that gives its position and velocity.
_START_SAMPLES = 9
# Distance of a start from the recorded one above which to warn, part of the joint's range.
_FAR_START_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class RecordedStart:
    """Line through the first samples of a joint's column.

    Attributes:
        column: Its name.
        angle: At the first sample, rad.
        speed: rad/s.
        delay: Known delay of the column, s.
    """

    column: str
    angle: float
    speed: float
    delay: float

    def corrected(self, recording: str, nuisance: Mapping[str, float]) -> tuple[float, float]:
        """Return angle, rad, and speed, rad/s, of the joint with a scale, offset and delay that are being found."""
        scale, offset, delay = corrections(recording, self.column, nuisance)
        return scale * (self.angle + self.speed * (self.delay + delay)) + offset, scale * self.speed


def recorded_starts(recording: Recording, rows: NDArray[np.intp], joints: Collection[str]) -> dict[str, RecordedStart]:
    """Return the starts of rows of a recording, by joint, without joints that are not read there."""
    starts = {}
    for name, values in recording.outputs.items():
        variable, _, joint = name.partition(".")
        samples = rows[:_START_SAMPLES][np.isfinite(values[rows[:_START_SAMPLES]])]
        if variable != "joint_position" or joint not in joints or not len(samples):
            continue
        degree = 1 if len(samples) > 3 else 0
        line = np.polyfit(recording.time[samples] - recording.time[rows[0]], values[samples], degree)
        delay = recording.settings.outputs[name].delay
        starts[joint] = RecordedStart(name, float(line[-1]), float(line[0]) if degree else 0.0, delay)
    return starts


def check_reachable(entry: str, starts: Mapping[str, tuple[float, float]], scenario: Scenario) -> None:
    """Refuse starts whose angles are far beyond joints' ranges."""
    for joint, (angle, _) in starts.items():
        low, high = scenario.finger.joints[joint].range
        if not low - RANGE_MARGIN <= angle <= high + RANGE_MARGIN:
            allowed = f"cannot be reached: {joint} begins at {angle:.3g} rad, and its range is {low:.3g} to {high:.3g}"
            raise InputError(entry, allowed)


def start_parameters(
    recording: str, window: int, starts: Mapping[str, tuple[float, float]]
) -> tuple[NuisanceParameter, ...]:
    """Return the nuisance parameters of joints' starts, near the recorded ones."""
    prefix = f"recordings.{recording}.start.{window}"
    return tuple(
        NuisanceParameter(f"{prefix}.{joint}", angle - _START_MARGIN, angle + _START_MARGIN, angle)
        for joint, (angle, _) in starts.items()
    )


def far_start_warning(
    recording: Recording, starts: Mapping[str, RecordedStart], position: Mapping[str, float], scenario: Scenario
) -> str:
    """Return a warning about a joint whose motion starts far from its recording's start; empty without any."""
    for joint, start in starts.items():
        low, high = scenario.finger.joints[joint].range
        angle = start.corrected(recording.name, {})[0]
        if abs(angle - position[joint]) > _FAR_START_SHARE * (high - low):
            return (
                f"identify.recordings.{recording.name}: {joint} begins at {angle:.3g} rad, and the scenario starts at "
                f'{position[joint]:.3g} rad; with start = "recorded" it starts where the recording does'
            )
    return ""
