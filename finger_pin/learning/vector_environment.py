"""Many worlds as one vector environment of Gymnasium, stepped side by side in threads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.learning.task import Task
from finger_pin.learning.world import World, advance_all, build_spaces, observe_all, read_action


class VectorEnvironment(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """Worlds of one scenario, each as `Environment` has it: world i seeded with seed + i goes as that one does.

    The compiled core holds no lock of Python, so threads step the worlds side by side; numbers do not depend on how
    many threads there are. An episode that is over begins anew at the next step, whose action does not count.
    """

    def __init__(self, num_envs: int, scenario: Scenario | str | Path, **task: Any) -> None:
        """Prepare worlds.

        Args:
            num_envs: How many.
            scenario: As for `Environment`.
            task: As for `Environment`.

        Raises:
            InputError: Naming the argument, key or variable that is wrong.
        """
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise InputError("num_envs", "must be a whole number above 0", num_envs)
        task.pop("render_mode", None)
        self.task, self.num_envs = Task(**task), int(num_envs)
        first = World.of(scenario, self.task)
        self._worlds = [first, *(first.twin() for _ in range(self.num_envs - 1))]
        self.single_observation_space, self._single = build_spaces(first, self.task.limits)
        self.single_action_space = self._single
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        low, high = (np.tile(each, (self.num_envs, 1)) for each in (self._single.low, self._single.high))
        self.action_space = self._actions = Box(low, high, dtype=np.float32)
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_fps": round(1.0 / self.task.period)}
        self.render_mode = None
        self._randoms: list[np.random.Generator] = []
        self._ended = np.zeros(self.num_envs, dtype=bool)
        self._seen: NDArray[Any] = np.zeros(self.observation_space.shape or (), dtype=np.float32)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin episodes in all worlds, or in those of ``options["reset_mask"]``."""
        mask = np.ones(self.num_envs, dtype=bool)
        if options and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"], dtype=bool)
        seeds: list[int | None]
        if isinstance(seed, list):
            seeds = seed
        else:
            seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs or mask.shape != (self.num_envs,):
            raise InputError("seed and reset_mask", f"must have {self.num_envs} entries, one per world")
        if not self._randoms:
            self._randoms = [np_random(own)[0] for own in seeds]
        else:
            for i in np.flatnonzero(mask):
                if seeds[i] is not None:
                    self._randoms[i] = np_random(seeds[i])[0]
        for i in np.flatnonzero(mask):
            self._worlds[i].begin(self._randoms[i])
            # The others are not measured again: that would age what their sensors delay.
            self._seen[i] = self._worlds[i].observe()[0]
        self._ended[mask] = False
        return self._seen.copy(), self._gathered(
            [{"drawn": world.drawn} if at else {} for world, at in zip(self._worlds, mask, strict=True)]
        )

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Act in all worlds for one control period.

        Raises:
            InputError: If the actions have another shape or are not finite, or the reward is wrong.
        """
        commands = read_action(actions, self._actions)
        begun = self._ended.copy()
        for i, world in enumerate(self._worlds):
            if begun[i]:
                world.begin(self._randoms[i])
            else:
                world.act(commands[i])
        advance_all([world for i, world in enumerate(self._worlds) if not begun[i]])
        self._seen, signals = observe_all(self._worlds)
        rewards, done = self.task.judge(signals, self.num_envs)
        over = np.array([world.over for world in self._worlds])
        rewards, done, over = np.where(begun, 0.0, rewards), done & ~begun, over & ~begun
        self._ended = done | over
        own = [
            {"drawn": world.drawn} if begun[i] else world.info({name: value[i] for name, value in signals.items()})
            for i, world in enumerate(self._worlds)
        ]
        return self._seen.copy(), rewards, done, over, self._gathered(own)

    def _gathered(self, own: list[dict[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for i, each in enumerate(own):
            if each:
                found = self._add_info(found, each, i)
        return found
