"""Estimates of observers among what a policy sees: one in every world, which reads the motors of that world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError
from finger_pin.learning.sensors import Measurement, Sensor
from finger_pin.learning.task import Task
from finger_pin.observation.estimate import Estimate
from finger_pin.observation.observer import Observer
from finger_pin.simulation.simulator import Simulator
from finger_pin.simulation.simulators import Instants
from finger_pin.typing import Array

#: What names of estimates begin with.
PREFIX = "estimated."
_READ = ("motor_position", "motor_current")
_OPTIONS = ("uncertain", "sensors", "forces", "period", "level")
# Readings within this time, s, of the end of a piece are at it.
_TIME_TOLERANCE = 1e-9


def estimates_of(simulators: Sequence[Simulator], task: Task) -> Estimates | None:
    """Return the estimates of worlds that a task asks for, before anything is drawn; None if it asks for none.

    Raises:
        InputError: If a name is none, or the scenario has not what an observer needs.
    """
    names = [name for name in task.variables if name.startswith(PREFIX)]
    for name in task.observer if isinstance(task.observer, Mapping) else [task.observer]:
        if name not in _OPTIONS:
            raise InputError(f"observer.{name}", f"must be one of {', '.join(_OPTIONS)}{suggestion(name, _OPTIONS)}")
        if not names:
            raise InputError(f"observer.{name}", f"has no effect: nothing observed or privileged begins with {PREFIX}")
    return Estimates(simulators, task, names) if names else None


class Estimates:
    """Observers of worlds with the scenario's own numbers, and what they tell."""

    def __init__(self, simulators: Sequence[Simulator], task: Task, names: Sequence[str]) -> None:
        """Make an observer for every world.

        Args:
            simulators: Of the worlds, with the numbers that observers know.
            task: The task.
            names: Of the estimates, `PREFIX` before each.
        """
        finger, scenario = simulators[0].finger, simulators[0].scenario
        other = finger.constructor_args
        if finger.description != scenario.finger or other.rows or other.tables or other.rigid_body:
            raise InputError(
                "finger", f"must be one that its description tells, for {names[0]}: its observer has no more"
            )
        self._motors = {f"{kind}.{name}": (kind, k) for kind in _READ for k, name in enumerate(finger.actuators.names)}
        known = {kind: _known(task.sensors[kind]) for kind in _READ if kind in task.sensors}
        sensors = {name: known[kind] for name, (kind, _) in self._motors.items() if kind in known}
        for name, each in task.observer.get("sensors", {}).items():
            sensors[name] = {**sensors.get(name, {}), **each}
        options = {**task.observer, "sensors": sensors}
        self._observers = [Observer(scenario, **options) for _ in simulators]
        inputs, self._errors = self._observers[0].sensors.inputs, self._observers[0].sensors.errors
        if lacking := [name for name in inputs if name not in self._motors]:
            allowed = f"needs a motor with a current at every tendon; without are {', '.join(lacking)}"
            raise InputError(names[0], allowed)
        if not inputs:
            raise InputError(names[0], "needs motors, and there are none")
        self._names = {name: name.removeprefix(PREFIX) for name in names}
        told = self._by_name(self._observers[0].start())
        for name, short in self._names.items():
            if short not in told:
                raise InputError(name, f"no such estimate; there are {', '.join(PREFIX + each for each in told)}")
        count = len(simulators)
        self._values = {name: np.zeros((count, *told[short].shape)) for name, short in self._names.items()}
        self._measured = {name: Measurement(count, 0) for name in self._motors}
        self._instants, self._readings = Instants(simulators, _READ), np.zeros(count, dtype=np.int64)

    def _by_name(self, estimate: Estimate) -> dict[str, Array]:
        """Return an estimate by name; of a finger's only tip without a dimension for it, as variables of results."""
        alone = self._observers[0].tips == ("",)
        return {
            name: value[0] if alone and name.startswith(("touched", "fingertip_force")) else value
            for name, value in estimate.variables().items()
        }

    def values(self) -> dict[str, Array]:
        """Return the last estimates by name, shapes (worlds, ...)."""
        return {name: value.copy() for name, value in self._values.items()}

    def reset(
        self, indices: Sequence[int], sensors: Sequence[Mapping[str, Sensor]], randoms: Sequence[np.random.Generator]
    ) -> None:
        """Start the observers of some worlds at rest where motors tell.

        Args:
            indices: Of these worlds.
            sensors: Of all worlds, as drawn for the episode.
            randoms: Generators of all worlds.
        """
        for i in indices:
            for name, (kind, _) in self._motors.items():
                error = self._errors[name]
                default = Sensor(quantisation=error["resolution"], noise=error["noise"])
                self._measured[name].reset(i, sensors[i].get(kind, default))
        read = self._read(indices, [name for name, (kind, _) in self._motors.items() if kind == _READ[0]], randoms)
        for row, i in enumerate(indices):
            angles = {name.removeprefix(f"{_READ[0]}."): float(values[row]) for name, values in read.items()}
            self._readings[i] = 0
            self._keep(i, self._observers[i].start(motor_position=angles))

    def _read(
        self, indices: Sequence[int], names: Sequence[str], randoms: Sequence[np.random.Generator]
    ) -> dict[str, Array]:
        """Return what sensors of some worlds read now, by name, shape (k,) each."""
        rows, true = np.array(indices, dtype=np.int64), self._instants.read()
        columns = {name: true[self._motors[name][0]][rows, self._motors[name][1]] for name in names}
        return {name: self._measured[name].sample(values, rows, randoms) for name, values in columns.items()}

    def _keep(self, world: int, estimate: Estimate) -> None:
        values = self._by_name(estimate)
        for name, short in self._names.items():
            self._values[name][world] = values[short]

    def _next_reading(self, world: int) -> float:
        return float((self._readings[world] + 1) * self._observers[world].period)

    def cut(self, indices: Sequence[int], lengths: Sequence[float]) -> list[float]:
        """Return the lengths of pieces, s, of some worlds, none beyond its next reading."""
        rests = [self._next_reading(i) - self._instants.simulators[i].time for i in indices]
        return [
            rest if rest < length - _TIME_TOLERANCE else length for rest, length in zip(rests, lengths, strict=True)
        ]

    def follow(self, indices: Sequence[int], randoms: Sequence[np.random.Generator]) -> None:
        """Read the motors of those worlds of which a reading is due, and go on by a period."""
        simulators = self._instants.simulators
        due = [i for i in indices if simulators[i].time > self._next_reading(i) - _TIME_TOLERANCE]
        due = [i for i in due if not simulators[i].failure]
        if not due:
            return
        read = self._read(due, list(self._motors), randoms)
        for row, i in enumerate(due):
            self._readings[i] += 1
            self._keep(i, self._observers[i].step({name: float(values[row]) for name, values in read.items()}))


def _known(sensor: Sensor) -> dict[str, float]:
    """Return what an observer is told of a sensor, but for perfect ones, of which it keeps its defaults."""
    told = {"resolution": sensor.quantisation, "noise": sensor.noise}
    return {name: value for name, value in told.items() if value}
