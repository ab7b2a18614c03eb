"""What an environment asks of a policy: action, observation, reward, end, and what is drawn at every reset."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.learning.distributions import Distribution
from finger_pin.learning.sensors import Sensor

#: What a reward or an end is told: variables by name, what was drawn for the episode, and ``action``.
Signals = Mapping[str, Array]
#: Ways in which a policy acts.
ACTIONS = ("tension", "motor_position", "tendon_length")


@dataclass(frozen=True, eq=False)
class Task:
    """A task on a scenario; arguments of `Environment`, where they are explained."""

    reward: Callable[[Signals], ArrayLike]
    action: str = "tension"
    limits: tuple[ArrayLike, ArrayLike] | None = None
    observation: Sequence[str] | Mapping[str, Sensor] = ("joint_position", "joint_velocity")
    privileged: Sequence[str] = ()
    done: Callable[[Signals], ArrayLike] | None = None
    period: float = 0.02
    delay: float = 0.0
    duration: float = 2.0
    draw: Callable[[np.random.Generator], Mapping[str, ArrayLike]] | None = None
    start: str | Callable[[np.random.Generator], ArrayLike] = "reference"
    randomise: Mapping[str, Distribution] | str | os.PathLike[str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check what does not depend on the scenario."""
        if self.action not in ACTIONS:
            raise InputError("action", f"must be one of {', '.join(ACTIONS)}", self.action)
        for name in ("reward", "done", "draw"):
            value = getattr(self, name)
            if not callable(value) and (name == "reward" or value is not None):
                raise InputError(name, "must be a function", value)
        for name in ("period", "duration"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not 0.0 < value < np.inf:
                raise InputError(name, "must be above 0 and finite, s", value)
        if isinstance(self.start, str) and self.start not in ("reference", "random"):
            raise InputError("start", 'must be "reference", "random" or a function of a generator', self.start)

    @property
    def steps(self) -> int:
        """Control periods of an episode."""
        return max(round(self.duration / self.period), 1)

    @property
    def sensors(self) -> Mapping[str, Sensor]:
        """The sensor of every observed variable; perfect ones unless given."""
        given = self.observation
        return dict(given) if isinstance(given, Mapping) else {name: Sensor() for name in given}

    @property
    def variables(self) -> tuple[str, ...]:
        """All variables that are computed after a step, observed ones first."""
        return tuple(dict.fromkeys([*self.sensors, *self.privileged]))

    def judge(self, signals: Signals, worlds: int) -> tuple[Array, Array]:
        """Return rewards and whether the end is reached, for all worlds, shape (worlds,) each.

        Raises:
            InputError: If a function returns another shape, or a reward is not finite.
        """
        reward = _shaped("reward", self.reward(signals), worlds, float)
        if not np.isfinite(reward).all():
            raise InputError("reward", "must return finite numbers", reward.tolist())
        if self.done is None:
            return reward, np.zeros(worlds, dtype=bool)
        return reward, _shaped("done", self.done(signals), worlds, bool)


def _shaped(name: str, value: Any, worlds: int, kind: type) -> Array:
    found: NDArray[Any] = np.asarray(value, dtype=kind)
    if found.shape != (worlds,):
        allowed = f"must return one value per world, shape ({worlds},): signals have the worlds in front"
        raise InputError(name, allowed, list(found.shape))
    return found
