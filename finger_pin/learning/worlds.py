"""Batch of worlds of one scenario, stepped and observed together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from finger_pin.core.stepping.batch_stepper import NO_END, BatchStepper
from finger_pin.description.loading import ScenarioLike
from finger_pin.exceptions import InputError
from finger_pin.learning.sensors import measurements
from finger_pin.learning.snapshot import BatchedLoop, BatchedSnapshot, instant_variables
from finger_pin.learning.task import Task, all_finite
from finger_pin.learning.world import World
from finger_pin.mechanism.coerce import FingerLike
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
        loops, actions = [world.origin for world in self.worlds], [world.action for world in self.worlds]
        self._loop = BatchedLoop.from_loops(loops, actions, task.variables, separate=world_template.rebuilt)
        self._snapshot = BatchedSnapshot(self._loop)
        self._find_variables()
        self._measurements = measurements(task.sensors, count, task.period)
        self._context: dict[str, Array] = {}
        self._randoms = [np.random.default_rng(0)] * count
        self._steppers = BatchStepper([world.stepper for world in self.worlds])
        self.reset(range(count), self._randoms)

    def _find_variables(self) -> None:
        available = instant_variables(self._loop)
        self._variables = {name: available[name] for name in self.task.variables}

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the functions of the variables, which cannot be pickled."""
        return {name: value for name, value in self.__dict__.items() if name != "_variables"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state, and find the functions of the variables again."""
        self.__dict__ |= state
        self._find_variables()

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
            if world.rebuilt:
                self._loop.replace_world(i, world.origin, world.action)
        if self.worlds[0].rebuilt and len(indices):
            self._steppers = BatchStepper([world.stepper for world in self.worlds])

    def act(self, actions: Array, indices: Sequence[int]) -> None:
        """Act in some worlds for a control period, shape (w, k).

        Where actions arrive within the period, it has several pieces.
        """
        worlds, ends = self.worlds, [NO_END] * len(self.worlds)
        for i in indices:
            ends[i] = worlds[i].act(actions[i])
        while max(ends) != NO_END:
            statuses = self._steppers.advance(ends)
            for i in indices:
                if ends[i] != NO_END:
                    ends[i] = worlds[i].finish_piece(ends[i], statuses[i])

    def observe(self, indices: _Indices, *, for_reward: bool = True) -> tuple[NDArray[np.float32], dict[str, Array]]:
        """Return the observations in some worlds, shape (k, o), and the true signals in all by name, shapes (w, ...).

        Without ``for_reward`` signals are only those that sensors read.
        """
        snapshot = self._snapshot
        snapshot.clear_signals()
        snapshot.times[:] = [world.now for world in self.worlds]
        self._steppers.read(snapshot.packed)
        names = self._variables if for_reward else self.task.sensors
        signals = {name: np.array(self._variables[name].value(snapshot)) for name in names}
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
