"""One world as an environment of Gymnasium."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, Self

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from finger_pin.description.loading import ScenarioLike
from finger_pin.learning.task import Task
from finger_pin.learning.worlds import Worlds, read_actions, read_render_mode
from finger_pin.mechanism.coerce import FingerLike

if TYPE_CHECKING:
    import xarray as xr

_FIRST_WORLD = np.zeros(1, dtype=np.int64)


class Environment(gymnasium.Env[NDArray[Any], NDArray[Any]]):
    """A scenario as an environment of Gymnasium: a policy acts once per control period.

        environment = fp.learning.Environment("fig6", reward=lambda signals: -abs(signals["joint_velocity"]).sum(-1))
        observation, _ = environment.reset(seed=1)
        observation, reward, terminated, truncated, info = environment.step(environment.action_space.sample())

    The draws of `reset` are in its ``info["drawn"]``, the privileged variables of a step in ``info["privileged"]``; a
    motion that cannot go on truncates the episode, and ``info["reason"]`` says why. Observations are 32-bit floats in
    the units of the result's variables; actions are in N, rad or m.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self, scenario: ScenarioLike, *, finger: FingerLike | None = None, render_mode: str | None = None, **task: Any
    ) -> None:
        """Prepare a scenario for episodes.

        Args:
            scenario: The scenario: from `load_scenario`, or the name of one, or the path of a file. Its controller
                and reference do not act; the reference's start is where episodes begin. Its tolerances are those of
                the motion.
            finger: Replaces the finger that the scenario describes, as for `fp.simulate`, and its objects where it is
                built already; draws change both.
            render_mode: ``"rgb_array"`` for pictures, or None.
            task: The fields of `Task`:

                reward: A function of the signals, which returns one number per world: a mapping of the variables that
                    are observed or privileged, of what ``draw`` returned, and of ``action``, each with the worlds in
                    front, shape (worlds, ...). One of a single world's signals is given to `per_world` first.
                action: ``"tension"``, N, and of an imported hand the inputs of its actuators, each within its range;
                    ``"spool_angle"``, the goal of motors in position drive, rad; or
                    ``"tendon_winding"``, the length that their spools have drawn in, of several tendons the first,
                    or ideal winches, m; or ``"joint_position"``, goals of the joints that no passive tendon drives,
                    rad, for which drives turn the spools as the scenario's own finger needs it, whatever numbers are
                    drawn.
                limits: Least and largest action; by default 0 to 20 N or a source's most, what inputs' ranges allow,
                    or what the joints' ranges need.
                observation: Names of variables of the result; or for each a `Sensor`, and under names of their own
                    functions, such as the reward is, of what sensors show and ``draw`` returned.
                    ``estimated.`` before a name of `fp.observe`'s result, ``estimated.joint_position_low``, is what an
                    observer of the scenario, which knows no draw, makes of ``motor_position`` and ``motor_current``.
                observer: Arguments of that observer, as of `fp.observe`: ``uncertain``, ``sensors``, ``forces``,
                    ``period``, ``level``.
                privileged: Variables that the policy does not see, for rewards, critics and logs.
                done: A function of the signals: whether the task has ended (terminated).
                period: Of control, s.
                delay: Time from an action to its arrival at the finger, s.
                duration: Of an episode, s, after which it is truncated.
                draw: A function of a generator that returns values of an episode, such as a goal, as arrays by name;
                    they are observed after the variables.
                start: ``"reference"``, ``"random"`` within the joints' ranges, or a function of a generator that
                    returns theta, shape (n,), rad. Where bodies overlap it is drawn again, up to a hundred times;
                    the last draw is then moved towards the reference until they do not.
                randomise: Distributions by dotted key of the scenario, drawn at every reset; also ``action.delay``, s,
                    and ``observation.NAME.offset``, ``.noise``, ``.quantisation`` of a sensor. Or the path of an
                    identified scenario: its parameters are drawn from their intervals.
        """
        self.task, self.render_mode = Task.from_entries(task), read_render_mode(render_mode)
        self._worlds = Worlds(scenario, self.task, 1, finger)
        self.observation_space, actions = self._worlds.spaces()
        self.action_space, self._limits = actions, (actions.low.astype(float), actions.high.astype(float))
        self._has_episode = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Reset with sampled parameters, start and goal; the seed determines them."""
        super().reset(seed=seed)
        self._has_episode = True
        self._worlds.reset((0,), [self.np_random])
        observations, _ = self._worlds.observe(_FIRST_WORLD, for_reward=False)
        return observations[0], {"drawn": dict(self._worlds.worlds[0].sampled)}

    def step(self, action: NDArray[Any]) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Act for one control period.

        Raises:
            InputError: If the action has another shape or is not finite, or the reward is wrong.
            gymnasium.error.ResetNeeded: Before the first `reset`.
        """
        if not self._has_episode:
            raise ResetNeeded("there is no episode yet: call reset before step")
        worlds, world = self._worlds, self._worlds.worlds[0]
        worlds.act(read_actions(action, *self._limits)[None], (0,))
        observations, signals = worlds.observe(_FIRST_WORLD)
        reward, done = self.task.judge(signals, 1)
        info: dict[str, Any] = {"reason": world.reason} if world.reason else {}
        if self.task.privileged:
            info["privileged"] = {name: signals[name][0] for name in self.task.privileged}
        return observations[0], float(reward[0]), bool(done[0]), world.over, info

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the numbers of an action: tendons and actuators, motors, or joints."""
        return self._worlds.worlds[0].action.names

    def __copy__(self) -> Self:
        """Return an independent environment: two that share their worlds would step each other."""
        return copy.deepcopy(self)

    def render(self) -> NDArray[Any] | None:
        """Return a picture of the present posture, shape (height, width, 3), of bytes."""
        if self.render_mode is None:
            return None
        return self._worlds.worlds[0].picture()

    def result(self, *, sample_rate: float = 1000.0) -> xr.Dataset:
        """Return the episode so far as `simulate` returns a run: for figures, `fp.view` and `fp.save`."""
        return self._worlds.worlds[0].result(sample_rate)
