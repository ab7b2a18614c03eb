"""Many worlds as one vector environment of Gymnasium, stepped side by side in threads."""

from __future__ import annotations

import copy
from typing import Any, Self

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from finger_pin.description.loading import ScenarioLike
from finger_pin.exceptions import InputError
from finger_pin.learning.task import Task
from finger_pin.learning.worlds import Worlds, read_actions, read_render_mode
from finger_pin.mechanism.coerce import FingerLike


class VectorEnvironment(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """Many worlds of one scenario; world i with seed + i repeats `Environment` with that seed.

    The compiled core releases the GIL, so threads step the worlds side by side; results do not depend on the number
    of threads. An episode that is over restarts at the next step, whose action does not count.
    """

    def __init__(
        self,
        num_envs: int,
        scenario: ScenarioLike,
        *,
        finger: FingerLike | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        """Prepare worlds.

        Args:
            num_envs: Number of worlds.
            scenario: As for `Environment`.
            finger: As for `Environment`.
            render_mode: As for `Environment`.
            task: As for `Environment`.
        """
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise InputError("num_envs", "must be a whole number above 0", num_envs)
        self.task, self.num_envs, self.render_mode = (
            Task.from_entries(task),
            int(num_envs),
            read_render_mode(render_mode),
        )
        self._worlds = Worlds(scenario, self.task, self.num_envs, finger)
        self.single_observation_space, action_box = self._worlds.spaces()
        self.single_action_space = action_box
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        low, high = (np.tile(bound, (self.num_envs, 1)) for bound in (action_box.low, action_box.high))
        self.action_space, self._limits = Box(low, high, dtype=np.float32), (low.astype(float), high.astype(float))
        self.metadata = {
            "autoreset_mode": AutoresetMode.NEXT_STEP,
            "render_modes": ["rgb_array"],
            "render_fps": round(1.0 / self.task.period),
        }
        self._generators: list[np.random.Generator] = []
        self._ended, self._indices = np.zeros(self.num_envs, dtype=bool), np.arange(self.num_envs)
        self._observations: NDArray[Any] = np.zeros(self.observation_space.shape or (), dtype=np.float32)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Reset all worlds, or those of ``options["reset_mask"]``."""
        mask = np.ones(self.num_envs, dtype=bool)
        if options and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"], dtype=bool)
        first = [None] * self.num_envs if seed is None else seed
        seeds = first if isinstance(first, list) else [first + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs or mask.shape != (self.num_envs,):
            raise InputError("seed and reset_mask", f"must have {self.num_envs} entries, one per world")
        if not self._generators:
            self._generators = [np_random(world_seed)[0] for world_seed in seeds]
        else:
            for i in np.flatnonzero(mask):
                if seeds[i] is not None:
                    self._generators[i] = np_random(seeds[i])[0]
        # The other worlds are not measured again, which would advance their delayed sensors.
        restarted = np.flatnonzero(mask)
        self._worlds.reset(restarted.tolist(), self._generators)
        if len(restarted):
            self._observations[restarted] = self._worlds.observe(restarted, for_reward=False)[0]
        self._ended[mask] = False
        return self._observations.copy(), self._draw_info(restarted)

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Act in all worlds for one control period.

        Raises:
            InputError: If the actions have another shape or are not finite, or the reward is wrong.
            gymnasium.error.ResetNeeded: Before the first `reset`.
        """
        if not self._generators:
            raise ResetNeeded("there are no episodes yet: call reset before step")
        commands, worlds = read_actions(actions, *self._limits), self._worlds
        fresh = self._ended.copy()
        indices = np.flatnonzero(fresh)
        worlds.reset(indices.tolist(), self._generators)
        worlds.act(commands, np.flatnonzero(~fresh).tolist())
        self._observations, signals = worlds.observe(self._indices)
        rewards, terminated = self.task.judge(signals, self.num_envs)
        rewards, terminated, truncated = np.where(fresh, 0.0, rewards), terminated & ~fresh, worlds.over & ~fresh
        self._ended = terminated | truncated
        info = self._draw_info(indices)
        if self.task.privileged:
            privileged = {name: signals[name] for name in self.task.privileged}
            info |= {"privileged": privileged | {f"_{name}": ~fresh for name in privileged}, "_privileged": ~fresh}
        for i in np.flatnonzero(truncated).tolist():
            if worlds.worlds[i].reason:
                info = self._add_info(info, {"reason": worlds.worlds[i].reason}, i)
        return self._observations.copy(), rewards, terminated, truncated, info

    def __copy__(self) -> Self:
        """Return an independent environment: two that share their worlds would step each other."""
        return copy.deepcopy(self)

    def render(self) -> tuple[NDArray[Any], ...] | None:
        """Return a picture of every world, shape (height, width, 3) each, of bytes."""
        if self.render_mode is None:
            return None
        return tuple(world.picture() for world in self._worlds.worlds)

    def _draw_info(self, restarted: NDArray[np.int64]) -> dict[str, Any]:
        info: dict[str, Any] = {}
        for i in restarted.tolist():
            info = self._add_info(info, {"drawn": self._worlds.worlds[i].sampled}, i)
        return info
