"""Batch of worlds of one scenario, stepped and observed together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from finger_pin.description.loading import ScenarioLike
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.learning.estimates import PREFIX, estimates_of
from finger_pin.learning.sensors import measurements
from finger_pin.learning.task import Task, all_finite
from finger_pin.learning.world import World
from finger_pin.mechanism.coerce import FingerLike
from finger_pin.simulation.simulators import Instants, advance, instant_variables
from finger_pin.typing import Array

_Indices = NDArray[np.int64]


class Worlds:
    """Batch of worlds, the first dimension of all arrays.

    Attributes:
        task: The task of the policy.
        worlds: The worlds.
    """

    def __init__(self, scenario: ScenarioLike, task: Task, count: int, finger: FingerLike | None) -> None:
        """Build the worlds."""
        world_template = World.from_scenario(scenario, task, finger)
        self.task, self.worlds = task, [world_template, *(world_template.twin() for _ in range(count - 1))]
        self._estimates = estimates_of([world.simulator for world in self.worlds], task)
        available = instant_variables(world_template.simulator.loop)
        self._true = [name for name in task.variables if not name.startswith(PREFIX)]
        for name in self._true:
            if name not in available:
                entry = "observation" if name in task.sensors else "privileged"
                raise InputError(entry, f"no such variable; there are {choices(name, available)}", name)
        self._instants = Instants([world.simulator for world in self.worlds], self._true)
        self._measurements = measurements(task.sensors, count, task.period)
        self._context: dict[str, Array] = {}
        self._randoms = [np.random.default_rng(0)] * count
        self.reset(range(count), self._randoms)

    def spaces(self) -> tuple[Box, Box]:
        """Return the spaces of one world's observations and actions, both of 32-bit floats."""
        low, high = self.worlds[0].action.action_range(self.task.limits)
        observations = self.observe(np.arange(1), for_reward=False)[0]
        return Box(-np.inf, np.inf, observations.shape[1:], np.float32), Box(
            low.astype(np.float32), high.astype(np.float32)
        )

    def reset(self, indices: Sequence[int], randoms: Sequence[np.random.Generator]) -> None:
        """Reset some worlds.

        Args:
            indices: Their indices.
            randoms: Generators of all worlds, for all draws.
        """
        self._randoms = list(randoms)
        for i in indices:
            world = self.worlds[i]
            world.reset(randoms[i])
            for name, measurement in self._measurements.items():
                measurement.reset(i, world.sensors[name])
            for name, value in world.context.items():
                if name not in self._context:
                    self._context[name] = np.zeros((len(self.worlds), *value.shape))
                self._context[name][i] = value
        if self._estimates:
            self._estimates.reset(indices, [world.sensors for world in self.worlds], self._randoms)

    def act(self, actions: Array, indices: Sequence[int]) -> None:
        """Act in some worlds for a control period, shape (w, k).

        Where actions arrive within the period, it has several pieces.
        """
        for i in indices:
            self.worlds[i].act(actions[i])
        acting = list(indices)
        while acting:
            inputs, whole = zip(*[self.worlds[i].next_piece() for i in acting], strict=True)
            lengths = self._estimates.cut(acting, whole) if self._estimates else whole
            advance([self.worlds[i].simulator for i in acting], inputs, lengths)
            if self._estimates:
                self._estimates.follow(acting, self._randoms)
            acting = [i for i in acting if self.worlds[i].is_acting]

    def observe(self, indices: _Indices, *, for_reward: bool = True) -> tuple[NDArray[np.float32], dict[str, Array]]:
        """Return the observations in some worlds, shape (k, o), and the true signals in all by name, shapes (w, ...).

        Without ``for_reward`` signals are only those that sensors read.
        """
        read = [name for name in self._true if for_reward or name in self.task.sensors]
        signals = self._instants.read(read) if read else {}
        signals |= self._estimates.values() if self._estimates else {}
        count = len(indices)
        all_worlds = count == len(self.worlds)
        observations = {name: value if all_worlds else value[indices] for name, value in self._context.items()}
        for name, measurement in self._measurements.items():
            observations[name] = measurement.sample(
                signals[name] if all_worlds else signals[name][indices], indices, self._randoms
            )
        observations |= self.task.derive(observations, count)
        columns = [observations[name] for name in (*self.task.observed_names, *self._context)]
        flat = [values if values.ndim == 2 else values.reshape(count, -1) for values in columns]
        signals |= {name: value.copy() for name, value in self._context.items()}
        signals["action"] = np.array([world.action.last_action for world in self.worlds])
        return np.concatenate(flat, axis=1, dtype=np.float32), signals

    @property
    def over(self) -> NDArray[np.bool_]:
        """A mask of the worlds whose episode is truncated, shape (w,)."""
        return np.array([world.over for world in self.worlds])


def read_actions(actions: Any, low: Array, high: Array) -> Array:
    """Return actions as an array within their bounds, of their shape."""
    try:
        array = np.asarray(actions, dtype=float)
    except (TypeError, ValueError):
        raise InputError("action", "must be numbers", actions) from None
    if array.shape != low.shape:
        raise InputError("action", f"must have shape {low.shape}", list(array.shape))
    if not all_finite(array):
        raise InputError("action", "must be finite", array.tolist())
    return np.asarray(np.minimum(np.maximum(array, low), high))


def read_render_mode(mode: str | None) -> str | None:
    """Return the mode of pictures."""
    if mode not in (None, "rgb_array"):
        raise InputError("render_mode", 'must be "rgb_array" or None', mode)
    return mode
