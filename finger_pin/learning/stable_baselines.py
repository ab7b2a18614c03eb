"""Vector environment of stable-baselines3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from finger_pin.learning.vector_environment import VectorEnvironment


class StableBaselinesEnvironment(VecEnv):
    """`VectorEnvironment` as stable-baselines3 takes it: actions from -1 to 1, automatic resets."""

    def __init__(self, worlds: VectorEnvironment) -> None:
        """Wrap a vector environment."""
        space = worlds.single_action_space
        assert isinstance(space, Box)
        shape = space.shape
        # The base class reads its attributes.
        self.worlds = worlds
        super().__init__(worlds.num_envs, worlds.single_observation_space, Box(-1.0, 1.0, shape, np.float32))
        self._middle, self._half = 0.5 * (space.high + space.low), 0.5 * (space.high - space.low)
        self._actions = np.zeros((worlds.num_envs, *shape))

    def reset(self) -> NDArray[Any]:
        """Return first observations, with the seeds that `seed` has set."""
        observations, _ = self.worlds.reset(seed=list(self._seeds))
        self._reset_seeds()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store actions for `step_wait`."""
        self._actions = self._middle + self._half * actions

    def step_wait(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Return observations, rewards, the ends of episodes, and infos with their last observations."""
        observations, rewards, terminated, truncated, vector_info = self.worlds.step(self._actions)
        dones = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for world, reason in enumerate(vector_info.get("reason", [])):
            if reason:
                infos[world]["reason"] = reason
        if dones.any():
            for world in np.flatnonzero(dones).tolist():
                time_limit = bool(truncated[world] and not terminated[world])
                infos[world] |= {"terminal_observation": observations[world], "TimeLimit.truncated": time_limit}
            observations, _ = self.worlds.reset(options={"reset_mask": dones})
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """End the threads."""
        self.worlds.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the worlds, once for each."""
        return [getattr(self.worlds, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all worlds."""
        setattr(self.worlds, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Return the result of a method of the worlds, once for each."""
        value = getattr(self.worlds, method_name)(*args, **kwargs)
        return [value for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Return False for every world: none is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[Any] | None]:
        """Return a picture of every world, if the worlds have a ``render_mode``."""
        return self.worlds.render() or [None] * self.num_envs
