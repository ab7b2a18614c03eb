"""Sensors of an observer: what each reads, and how well; readings by name as arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.inputs import input_indices
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Default noise: of angles, rad, of speeds, rad/s, of forces, N, and of inputs: currents, A, tensions, N, lengths, m.
_NOISE = {"motor_position": 0.0, "motor_velocity": 0.1, "joint_position": 5e-3, "joint_velocity": 0.1}
_FORCE_NOISE, _CURRENT_NOISE, _INPUT_NOISE = 0.05, 5e-3, {"tensions": 0.1, "tendon_winding": 1e-5, "inputs": 1e-3}
# Where a motor has no encoder: steps of one of 12 bits, rad.
_RESOLUTION = 2.0 * np.pi / 4096
# Blocks of the state that sensors may read.
_BLOCKS = ("motor_position", "motor_velocity", "joint_position", "joint_velocity")


@dataclass(frozen=True, eq=False)
class Sensors:
    """All that may be read of a finger, by names as of results: ``motor_position.M1``.

    Attributes:
        inputs: By name the input that it tells, which the observer must have at every step.
        input_deviation: Standard deviation of each input, shape (u,).
        states: By name the number of the estimate that it reads: packed state, then forces at tips.
        deviation: Standard deviation of a reading by name.
        errors: By name of an input or a state ``resolution`` and ``noise``, SI.
    """

    inputs: dict[str, int]
    input_deviation: Array
    states: dict[str, int]
    deviation: dict[str, float]
    errors: dict[str, dict[str, float]]

    @classmethod
    def from_finger(
        cls, finger: Finger, force_names: Iterable[str], sensors: Mapping[str, Mapping[str, float]] | None
    ) -> Sensors:
        """Read what sensors a finger may have, and how well they measure.

        Args:
            finger: The finger.
            force_names: Names of the forces of the estimate, which follow its state.
            sensors: By name ``resolution`` and ``noise`` (a standard deviation) in SI; others keep their defaults.

        Raises:
            InputError: Naming a sensor that is none, or a number that is wrong.
        """
        channels = dict(
            zip(
                (f"motor_current.{name}" for name in finger.actuators.names),
                finger.actuators.channels.tolist(),
                strict=True,
            )
        )
        taken = {*channels.values()}
        inputs = channels | {name: k for name, k in input_indices(finger).items() if k not in taken}
        names = [name.replace("[", ".").removesuffix("]") for name in finger.layout.names]
        states = {name: k for k, name in enumerate(names) if name.partition(".")[0] in _BLOCKS}
        states |= {name: len(names) + k for k, name in enumerate(force_names)}
        settings = {name: dict(each) for name, each in (sensors or {}).items()}
        for name, each in settings.items():
            if name not in inputs and name not in states:
                raise InputError(f"sensors.{name}", f"no such sensor{suggestion(name, [*inputs, *states])}")
            for key, value in each.items():
                if key not in ("resolution", "noise"):
                    raise InputError(f"sensors.{name}.{key}", "must be resolution or noise", value)
                if not 0.0 <= value < np.inf:
                    raise InputError(f"sensors.{name}.{key}", "must be at least 0", value)
        encoders = {f"motor_position.{name}": each.motor.encoder for name, each in finger.description.actuators.items()}

        def error(name: str) -> dict[str, float]:
            kind = name.partition(".")[0]
            noise = _INPUT_NOISE.get(kind, _CURRENT_NOISE) if name in inputs else _NOISE.get(kind, _FORCE_NOISE)
            encoder = encoders.get(name)
            resolution = (encoder.resolution if encoder else _RESOLUTION) if name in encoders else 0.0
            return {"resolution": resolution, "noise": noise} | settings.get(name, {})

        errors = {name: error(name) for name in (*inputs, *states)}
        # A reading is anywhere within a step.
        deviation = {name: np.hypot(each["noise"], each["resolution"] / np.sqrt(12.0)) for name, each in errors.items()}
        of_inputs = np.zeros(finger.mechanism.channels)
        for name, channel in inputs.items():
            of_inputs[channel] = deviation[name]
        if exact := [name for name in settings if name in states and deviation[name] == 0.0]:
            raise InputError(
                f"sensors.{exact[0]}", "must have a resolution or noise: nothing reads exactly", settings[exact[0]]
            )
        return cls(inputs, of_inputs, states, {name: max(float(deviation[name]), 1e-9) for name in states}, errors)

    def places(self, names: Iterable[str]) -> NDArray[np.int64]:
        """Return the numbers of the estimate that sensors read, shape (s,)."""
        return np.array([self.states[name] for name in names], dtype=np.int64)

    def hold(
        self, readings: Mapping[str, float], last: Mapping[str, float], place: float, share: float, *held: Array
    ) -> list[str]:
        """Hold every input between its last two readings, at a place in a part of that time; return what is missing.

        Filled are inputs and their variances, shape (u,) each.
        """
        missing, (inputs, variance) = [], held
        for name, channel in self.inputs.items():
            value, deviation = float(readings[name]), float(self.input_deviation[channel])
            before = last.get(name, value if np.isfinite(value) else 0.0)
            inputs[channel], change = before + place * (value - before), share * (value - before)
            if not np.isfinite(value):
                # It was something between nothing and twice the last one.
                missing.append(name)
                inputs[channel], change = before, 2.0 * before
            # Between two readings it was anything between them.
            variance[channel] = deviation**2 + change**2 / 12.0
        return missing

    def check(self, readings: Mapping[str, Any]) -> None:
        """Refuse names that are none, and missing inputs.

        Raises:
            InputError: Naming the reading.
        """
        for name in readings:
            if name not in self.inputs and name not in self.states:
                raise InputError(
                    f"readings.{name}", f"nothing reads that{suggestion(name, [*self.inputs, *self.states])}"
                )
        if missing := [name for name in self.inputs if name not in readings]:
            raise InputError("readings", f"must have {', '.join(missing)}: the model is driven by it", [*readings])
