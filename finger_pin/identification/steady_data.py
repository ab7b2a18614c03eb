"""Steady readings: the closed forms of a scenario's tendons and servos for every row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from finger_pin.analysis.steady import steady_state
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.problem import At, NuisanceParameter, own_number
from finger_pin.identification.recordings import Recording
from finger_pin.typing import Array

# Change of a number that slopes are taken by, of its size or its range.
_CHANGE = 1e-5
_OUTPUTS = ("tendon_tension", "tendon_friction", "motor_current")


class SteadyReadings:
    """Recording of steady states compared with a scenario.

    Attributes:
        recording: The recording.
        load: The pull at the entrance of the canals, shape (m, a), N.
        scenario: Whose states they are.
        own: Nothing is to be found for them alone.
    """

    def __init__(self, recording: Recording, scenario: Scenario) -> None:
        """Find the inputs.

        Raises:
            InputError: If one names nothing that the scenario has, if the tension of a tendon is missing, or if all of
                one are negative.
        """
        self.recording, self.scenario, finger = recording, scenario, scenario.finger
        self.own: tuple[NuisanceParameter, ...] = ()
        self._entry = f"identify.recordings.{recording.name}"
        rows = len(recording.speed)
        joints, tendons = list(finger.joints), list(finger.actuated_names)
        self.load, self._position = np.zeros((rows, len(tendons))), np.zeros((rows, len(joints)))
        if scenario.simulation.initial is not None:
            for joint, angle in scenario.simulation.initial.position.items():
                self._position[:, joints.index(joint)] = angle
        for name, values in recording.inputs.items():
            variable, _, label = name.partition(".")
            if variable in ("tendon_command", "spool_tension"):
                if np.any(values < 0.0):
                    row = int(np.flatnonzero(values < 0.0)[0]) + 1
                    hint = "" if np.any(values > 0.0) else "; scale = -1 turns the sign of a column"
                    below = f"is below 0 N in row {row}, and a tendon only pulls{hint}"
                    raise InputError(f"{self._entry}.inputs.{name}", below)
                self.load[:, self._place(f"inputs.{name}", label, tendons)] = values
            elif variable == "joint_position":
                self._position[:, self._place(f"inputs.{name}", label, joints)] = values
            else:
                allowed = "a steady state is given tendon_command, spool_tension and joint_position"
                raise InputError(f"{self._entry}.inputs.{name}", allowed)
        places = {"motor_current": list(finger.actuators)}
        self._outputs = []
        for name in recording.outputs:
            variable, _, label = name.partition(".")
            if variable not in _OUTPUTS:
                raise InputError(f"{self._entry}.outputs.{name}", f"a steady state has {', '.join(_OUTPUTS)}")
            self._outputs.append((variable, self._place(f"outputs.{name}", label, places.get(variable, tendons))))

    def compute(self, scenario: Scenario, own: Mapping[str, float]) -> list[Array]:
        """Return the computed values of every output, shape (m,) each."""
        held = self.recording.settings.at_rest
        found = steady_state(scenario.finger, self.load, self.recording.speed, self._position, held)
        by_name = {"tendon_tension": found.tension, "tendon_friction": found.friction, "motor_current": found.current}
        name = self.recording.name
        return [
            own_number(own, name, output, "scale", 1.0) * by_name[variable][:, place]
            + own_number(own, name, output, "offset")
            for output, (variable, place) in zip(self.recording.outputs, self._outputs, strict=True)
        ]

    def slopes(self, at: At, values: Array, sizes: Array) -> list[Array]:
        """Return the derivatives of the outputs by the values, shape (m, p) each; by differences."""
        columns = []
        for k, size in enumerate(_CHANGE * sizes):
            ends = []
            for change in (size, -size):
                moved = values.copy()
                moved[k] += change
                try:
                    ends.append((moved[k], self.compute(*at(moved))))
                except InputError:
                    # At the edge of what is allowed there is one side only.
                    ends.append((values[k], self.compute(*at(values))))
            (right, up), (left, down) = ends
            columns.append([(u - d) / (right - left) for u, d in zip(up, down, strict=True)])
        return [np.stack(each, axis=1) for each in zip(*columns, strict=True)]

    def tune(self, factor: float) -> None:
        """Do nothing: a closed form has no errors."""

    def _place(self, where: str, label: str, names: Sequence[str]) -> int:
        if label not in names:
            raise InputError(f"{self._entry}.{where}", f"there is no {label}; there are {', '.join(names) or 'none'}")
        return names.index(label)
