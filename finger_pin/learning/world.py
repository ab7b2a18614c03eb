"""One world of an environment: the simulator of a scenario, and the draws of an episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario
from finger_pin.exceptions import InputError
from finger_pin.learning.action import Action
from finger_pin.learning.randomisation import Randomisation
from finger_pin.learning.sensors import Sensor
from finger_pin.learning.task import Task
from finger_pin.mechanism.coerce import FingerLike, is_other_hand, resolve_finger, with_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.simulator import Simulator
from finger_pin.simulation.simulators import Instants
from finger_pin.typing import Array
from finger_pin.views.viewer import draw_picture

if TYPE_CHECKING:
    import xarray as xr

# Starts that are drawn anew where bodies overlap, and parts of the way from the last one to the reference.
_MAX_STARTS, _WAY_STEPS = 100, 32


class World:
    """World of an environment: the simulator of a scenario, and the draws of an episode.

    Attributes:
        task: The task of the policy.
        simulator: The scenario in steps.
        action: Turns actions into its inputs.
        sampled: Draws of the episode: parameters by key, and those of the task.
        context: Draws of the task.
        sensors: The sensors of the episode.
    """

    def __init__(
        self, simulator: Simulator, task: Task, randomisation: Randomisation, nominal: tuple[Finger, PassiveCoupling]
    ) -> None:
        """Take a simulator; use `from_scenario` or `twin`."""
        self.simulator, self.task, self._randomisation, self._nominal = simulator, task, randomisation, nominal
        self.sampled: dict[str, Any] = {}
        self.context: dict[str, Array] = {}
        self.sensors: dict[str, Sensor] = {}
        self._step = 0
        self.action = Action(task.action, simulator.finger, *nominal)

    @classmethod
    def from_scenario(cls, scenario: ScenarioLike, task: Task, finger: FingerLike | None = None) -> World:
        """Return a world of a scenario, on a custom finger if there is one."""
        loaded = load_scenario(scenario)
        custom_finger = resolve_finger(finger, loaded)
        scenario = with_finger(loaded, custom_finger)
        simulator = Simulator.from_scenario(scenario, finger=custom_finger, goals=True)
        randomisation = Randomisation(task)
        for key in randomisation.keys if is_other_hand(custom_finger, scenario) else ():
            if key.startswith("hand."):
                raise InputError("randomise", "does not act: the hand that was given is not the scenario's", key)
        family = ParametrisedScenario(scenario, randomisation.keys)
        for values in randomisation.corner_values():
            # Wrong ranges are refused now, not at the hundredth reset.
            family.with_values(values)
        # Drives use the parameters of the scenario, not the drawn ones.
        nominal = simulator.finger, scenario.coupling(simulator.finger.routing)
        return cls(simulator, task, randomisation, nominal)

    def twin(self) -> World:
        """Return another world of the same scenario and task; they share the parts that no reset changes."""
        return World(self.simulator.clone(), self.task, self._randomisation, self._nominal)

    @property
    def time(self) -> float:
        """Simulated time of the episode, s."""
        return self._step * self.task.period

    @property
    def reason(self) -> str:
        """Reason of a failed motion; empty otherwise."""
        return self.simulator.failure

    @property
    def over(self) -> bool:
        """True if the episode is truncated: its time is over, or the motion failed."""
        return bool(self.reason) or self._step >= self.task.steps

    def reset(self, random: np.random.Generator) -> None:
        """Reset for an episode."""
        self._random, self._step, task = random, 0, self.task
        self.sampled = self._randomisation.sample_context(random)
        if self._randomisation.keys:
            self._set_parameters({key: self.sampled[key] for key in self._randomisation.keys})
        self._draw_start()
        self.context = self._draw_context()
        self.sampled |= self.context
        self.sensors = {
            name: self._randomisation.sensor(name, sensor, self.sampled) for name, sensor in task.sensors.items()
        }
        self.action.reset(self._randomisation.delay(self.sampled, task.delay))

    def _set_parameters(self, values: Mapping[str, Any]) -> None:
        """Give the simulator the parameters that were drawn."""
        finger = self.simulator.finger
        try:
            self.simulator.set_parameters(values)
        except InputError as error:
            if error.entry != "values":
                raise
            raise InputError("randomise", error.allowed, dict(values)) from None
        if self.simulator.finger is not finger:
            self.action = Action(self.task.action, self.simulator.finger, *self._nominal)

    def _draw_context(self) -> dict[str, Array]:
        """Return the task's draws for an episode, by name."""
        if self.task.draw is None:
            return {}
        returned = self.task.draw(self._random)
        if not isinstance(returned, Mapping):
            raise InputError("draw", "must return arrays by name", returned)
        draws = {name: np.asarray(value, dtype=float) for name, value in returned.items()}
        shapes = {name: value.shape for name, value in self.context.items()}
        for name, value in draws.items():
            if not np.isfinite(value).all():
                raise InputError(f"draw.{name}", "must be finite", value.tolist())
            if shapes.get(name, value.shape) != value.shape:
                raise InputError(f"draw.{name}", f"must keep its shape {shapes[name]}", list(value.shape))
        return draws

    def _draw_start(self) -> None:
        """Reset the simulator to a start that is drawn."""
        simulator, task = self.simulator, self.task
        if task.start == "reference":
            simulator.reset()
            return
        finger = simulator.finger
        joints = len(finger.routing.joints)
        for _ in range(_MAX_STARTS):
            if callable(task.start):
                position = np.asarray(task.start(self._random), dtype=float)
                if position.shape != (joints,) or not np.isfinite(position).all():
                    raise InputError("start", f"must return {joints} finite angles, rad", position.tolist())
            else:
                limiter, coupling = finger.stroke_limiter, simulator.scenario.coupling(finger.routing)
                free_position = self._random.uniform(limiter.lower, limiter.upper)
                position = np.clip(coupling.posture(free_position[coupling.free]), limiter.lower, limiter.upper)
            if self._starts_at(position):
                return
        # The nearest free posture on the way to the reference: a training must not end here.
        reference = simulator.loop.reference.at(0.0).position
        for share in np.arange(1.0, _WAY_STEPS) / _WAY_STEPS:
            if self._starts_at(position + share * (reference - position)):
                return
        simulator.reset()

    def _starts_at(self, position: Array) -> bool:
        """Reset the simulator to a posture; return whether no bodies are deep in each other there."""
        try:
            self.simulator.reset(position)
        except InputError:
            return False
        return True

    def act(self, action: Array) -> None:
        """Start a control period with an action."""
        self.action.apply(action, self.time)
        self._step += 1

    def next_piece(self) -> tuple[Array, float]:
        """Return the inputs of the next piece of the control period, and its length, s."""
        now = self.simulator.time
        inputs, end = self.action.next_piece(now, self.time)
        return inputs, end - now

    @property
    def is_acting(self) -> bool:
        """True if the control period has a further piece."""
        return self.simulator.time < self.time and not self.reason

    def result(self, sample_rate: float) -> xr.Dataset:
        """Return the episode so far, repeated step by step, as a Dataset with its energy account."""
        dataset = self.simulator.result(sample_rate=sample_rate)
        dataset.attrs["custom"] = "policy"
        return dataset

    def picture(self) -> NDArray[np.uint8]:
        """Return a picture of the present posture, from a point with all postures in view, of bytes."""
        goal = self.context.get("goal")
        marked = goal if goal is not None and goal.shape == (3,) else None
        return draw_picture(Instants([self.simulator]).dataset(), self._extreme_tips, marked)

    @cached_property
    def _extreme_tips(self) -> Array:
        """Fingertips at the corners of the joints' ranges, shape (k, 3), m."""
        limiter, body = self.simulator.finger.stroke_limiter, self.simulator.finger.rigid_body
        corners = np.array([limiter.lower, limiter.upper, 0.5 * (limiter.lower + limiter.upper)])
        return np.array([body.tip_position(corner) for corner in corners]).reshape(-1, 3)
