"""Tasks of a policy: action, observation, reward, end, and draws at every reset."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.description.caching import cached_property
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError
from finger_pin.learning.distributions import Distribution, is_number
from finger_pin.learning.sensors import Sensor
from finger_pin.typing import Array

#: What a reward or an end is told: variables by name, what was drawn for the episode, and ``action``.
Signals = Mapping[str, Array]
#: A function of them, for all worlds at once.
Function = Callable[[Signals], ArrayLike]
#: Ways in which a policy acts.
ACTIONS = ("tension", "spool_angle", "tendon_winding", "joint_position")
_FORMER_ACTIONS = {"motor_position": "spool_angle", "tendon_length": "tendon_winding"}


@dataclass(frozen=True, eq=False)
class Task:
    """A task on a scenario; `Environment` explains its arguments."""

    reward: Function
    action: str = "tension"
    limits: tuple[ArrayLike, ArrayLike] | None = None
    observation: Sequence[str] | Mapping[str, Sensor | Function] = ("joint_position", "joint_velocity")
    privileged: Sequence[str] = ()
    done: Function | None = None
    period: float = 0.02
    delay: float = 0.0
    duration: float = 2.0
    draw: Callable[[np.random.Generator], Mapping[str, ArrayLike]] | None = None
    observer: Mapping[str, Any] = field(default_factory=dict)
    start: str | Callable[[np.random.Generator], ArrayLike] = "reference"
    randomise: Mapping[str, Distribution] | str | os.PathLike[str] = field(default_factory=dict)

    @classmethod
    def from_entries(cls, entries: Mapping[str, Any]) -> Task:
        """Return a task with entries by name."""
        names = [task_field.name for task_field in fields(cls)]
        for name in entries:
            if name not in names:
                arguments = ", ".join(["finger", "render_mode", *names])
                raise InputError(name, f"no such argument; there are {arguments}{suggestion(name, names)}")
        if "reward" not in entries:
            raise InputError("reward", "is missing: a function of the signals")
        return cls(**entries)

    def __post_init__(self) -> None:
        """Check the entries that do not depend on the scenario."""
        object.__setattr__(self, "action", _FORMER_ACTIONS.get(self.action, self.action))
        if self.action not in ACTIONS:
            raise InputError("action", f"must be one of {', '.join(ACTIONS)}", self.action)
        for name in ("reward", "done", "draw"):
            value = getattr(self, name)
            if not callable(value) and (name == "reward" or value is not None):
                raise InputError(name, "must be a function", value)
        for name in ("period", "duration"):
            value = getattr(self, name)
            if not is_number(value) or not 0.0 < value < np.inf:
                raise InputError(name, "must be above 0 and finite, s", value)
        if not is_number(self.delay) or not 0.0 <= self.delay < math.inf:
            raise InputError("delay", "must be a finite number of seconds, not negative", self.delay)
        for name in ("observation", "privileged"):
            value = getattr(self, name)
            if isinstance(value, str) or not isinstance(value, Sequence | Mapping):
                raise InputError(name, "must be a list of names of variables", value)
        if not (self.observation or self.draw):
            raise InputError("observation", "must name at least one variable", [])
        for name, source in self._observations.items():
            if not (isinstance(source, Sensor) or callable(source)):
                raise InputError(f"observation.{name}", "must be a Sensor or a function of what is observed", source)
        if isinstance(self.start, str) and self.start not in ("reference", "random"):
            raise InputError("start", 'must be "reference", "random" or a function of a generator', self.start)

    @cached_property
    def steps(self) -> int:
        """Control periods of an episode."""
        return max(round(self.duration / self.period), 1)

    @cached_property
    def _observations(self) -> Mapping[str, Sensor | Function]:
        observation = self.observation
        return dict(observation) if isinstance(observation, Mapping) else {name: Sensor() for name in observation}

    @cached_property
    def observed_names(self) -> tuple[str, ...]:
        """Names of the observed signals, in order, before those drawn for an episode."""
        return tuple(self._observations)

    @cached_property
    def sensors(self) -> Mapping[str, Sensor]:
        """The sensor of every observed variable; perfect ones unless given."""
        return {name: sensor for name, sensor in self._observations.items() if isinstance(sensor, Sensor)}

    def derive(self, signals: Signals, worlds: int) -> dict[str, Array]:
        """Return the observations that are functions of readings and draws, by name, shapes (worlds, ...)."""
        values_by_name = {}
        for name, (entry, function) in self._functions.items():
            value = _evaluate(entry, function, signals)
            if value.shape[:1] != (worlds,):
                allowed = f"must return arrays with the worlds in front, shape ({worlds}, ...); see per_world"
                raise InputError(entry, allowed, list(value.shape))
            if not all_finite(value):
                raise InputError(entry, "must return finite numbers", value.tolist())
            values_by_name[name] = value
        return values_by_name

    @cached_property
    def _functions(self) -> Mapping[str, tuple[str, Function]]:
        """The functions among the observations, with their entries."""
        observed_names = self._observations.items()
        return {name: (f"observation.{name}", each) for name, each in observed_names if not isinstance(each, Sensor)}

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """All variables that are computed after a step, observed ones first."""
        return tuple(dict.fromkeys([*self.sensors, *self.privileged]))

    def judge(self, signals: Signals, worlds: int) -> tuple[Array, Array]:
        """Return rewards and whether the end is reached, for all worlds, shape (worlds,) each."""
        reward = _evaluate_scalar("reward", self.reward, signals, worlds)
        if not all_finite(reward):
            raise InputError("reward", "must return finite numbers", reward.tolist())
        if self.done is None:
            return reward, np.zeros(worlds, dtype=bool)
        done = _evaluate_scalar("done", self.done, signals, worlds)
        if np.isnan(done).any():
            raise InputError("done", "must return whether the task has ended", done.tolist())
        return reward, done != 0.0


def per_world(function: Callable[[Signals], Any]) -> Function:
    """Return a batched function from a function of one world's signals.

    A function of arrays with the worlds in front takes no longer for a hundred worlds than for one; this is for those
    that cannot be written so.
    """

    def batched(signals: Signals) -> Array:
        count = len(next(iter(signals.values())))
        return np.array([function({name: value[world] for name, value in signals.items()}) for world in range(count)])

    return batched


def _evaluate(name: str, function: Function, signals: Signals) -> Array:
    """Return the result of a function of signals; refuse one that reads a signal that does not exist."""
    try:
        value = function(signals)
    except KeyError as error:
        missing_name = error.args[0] if error.args else None
        if missing_name in signals:
            raise
        allowed = f"asks for a signal that it is not told; there are {', '.join(signals)}"
        raise InputError(name, allowed, missing_name) from None
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(name, "must return numbers", value) from None


def _evaluate_scalar(name: str, function: Function, signals: Signals, worlds: int) -> Array:
    """Return the result of a function of signals, one number per world."""
    values = _evaluate(name, function, signals)
    if values.shape != (worlds,):
        allowed = f"must return one value per world, shape ({worlds},): signals have the worlds in front; see per_world"
        raise InputError(name, allowed, list(values.shape))
    return values


def all_finite(values: np.ndarray) -> bool:
    """Return whether all numbers of an array are finite; plain Python is faster for a few."""
    # The sum of squares suffices in most cases.
    return math.isfinite(np.vdot(values, values)) or bool(np.isfinite(values).all())
