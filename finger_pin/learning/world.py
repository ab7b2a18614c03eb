"""One world of an environment: a scenario in steps, and the draws of an episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.closed_loop import ClosedLoop, sampled_control
from finger_pin.core.stepping.batch_stepper import NO_END
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.description.caching import cached_property
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.learning.action import Action
from finger_pin.learning.randomisation import Randomisation
from finger_pin.learning.sensors import Sensor
from finger_pin.learning.snapshot import instant_variables, snapshot
from finger_pin.learning.task import Task
from finger_pin.mechanism.coerce import FingerLike, is_other_hand, resolve_finger, with_finger, with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.recording import record
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.typing import Array
from finger_pin.views.viewer.video import draw_picture

if TYPE_CHECKING:
    import xarray as xr

# Starts that are drawn anew where bodies overlap, and parts of the way from the last one to the reference.
_MAX_STARTS, _WAY_STEPS = 100, 32


class World:
    """World of an environment: a scenario in steps, and the draws of an episode.

    Attributes:
        task: The task of the policy.
        origin: The scenario's own loop, whose controller does not act.
        action: Controller that applies the actions in its place.
        stepper: Its stepper.
        sampled: Draws of the episode: parameters by key, and those of the task.
        context: Draws of the task.
        sensors: The sensors of the episode.
        reason: Reason of a failed motion; empty otherwise.
        now: Simulated time that the motion has reached, s.
    """

    def __init__(
        self,
        family: ParametrisedScenario,
        task: Task,
        randomisation: Randomisation,
        finger: Finger | None,
        origin: ClosedLoop | None = None,
    ) -> None:
        """Build the scenario, or share another world's loop; use `from_scenario` or `twin`."""
        self.task, self._family, self._randomisation, self._custom_finger = task, family, randomisation, finger
        self.sampled: dict[str, Any] = {}
        self.context: dict[str, Array] = {}
        self.sensors: dict[str, Sensor] = {}
        self._nominal: tuple[Finger, PassiveCoupling] | None = None
        self.reason, self._step, self.now = "", 0, 0.0
        self._build(family.scenario, origin)
        self.stepper = self._stepper_at(self.origin.initial_state())

    @classmethod
    def from_scenario(cls, scenario: ScenarioLike, task: Task, finger: FingerLike | None = None) -> World:
        """Return a world of a scenario, on a custom finger if there is one."""
        loaded = load_scenario(scenario)
        custom_finger = resolve_finger(finger, loaded)
        scenario = with_finger(loaded, custom_finger)
        if scenario.simulation.method not in TABLEAUS:
            raise InputError("simulation.method", f"must be one of {', '.join(TABLEAUS)}", scenario.simulation.method)
        randomisation = Randomisation(task)
        for key in randomisation.keys if is_other_hand(custom_finger, scenario) else ():
            if key.startswith("hand."):
                raise InputError("randomise", "does not act: the hand that was given is not the scenario's", key)
        family = ParametrisedScenario(scenario, randomisation.keys)
        for values in randomisation.corner_values():
            # Wrong ranges are refused now, not at the hundredth reset.
            family.with_values(values)
        world = cls(family, task, randomisation, custom_finger)
        available = instant_variables(world.origin)
        for name in task.variables:
            if name not in available:
                entry = "observation" if name in task.sensors else "privileged"
                raise InputError(entry, f"no such variable; there are {choices(name, available)}", name)
        return world

    def twin(self) -> World:
        """Return another world of the same scenario and task; they share the parts that no reset changes."""
        origin = None if self._randomisation.keys else self.origin
        return World(self._family, self.task, self._randomisation, self._custom_finger, origin)

    @property
    def rebuilt(self) -> bool:
        """True if every episode builds a new loop and stepper."""
        return bool(self._randomisation.keys)

    def _build(self, scenario: Scenario, origin: ClosedLoop | None = None) -> None:
        """Build the loop and the action."""
        if origin is None:
            finger = self._custom_finger
            if self._nominal is not None:
                finger = with_parameters_of(self._nominal[0], self._family.scenario, scenario)
                if finger.layout.names != self._nominal[0].layout.names:
                    raise InputError("randomise", "must keep what the state consists of", self.sampled)
            origin = ClosedLoop.from_scenario(scenario, finger=finger).compiled()
        self._scenario, self.origin = scenario, origin
        finger, family = self.origin.finger, self._family.scenario
        # Drives use the parameters of the scenario, not the drawn ones.
        self._nominal = self._nominal or (finger, family.coupling(finger.routing))
        self.action = Action(self.task.action, finger, self.task.duration, *self._nominal)

    @property
    def loop(self) -> ClosedLoop:
        """The loop, with the actions in the place of its controller."""
        drives = self.action if self.action.compiled is not None else None
        return replace(self.origin, controller=self.action, drives=drives)

    def _stepper_at(self, x: Array) -> Stepper:
        """Return a stepper that starts from a state, with the loops of the action if there are any."""
        loop, settings = self.origin, self._scenario.simulation
        stepper = Stepper.from_finger(
            loop.finger,
            sampled_control(loop),
            x,
            loop.fingertip_force,
            method=settings.method,
            rtol=settings.rtol,
            atol_scale=settings.atol_scale,
        )
        if self.action.compiled is not None:
            stepper.drive(self.action.compiled)
        return stepper

    @property
    def time(self) -> float:
        """Simulated time of the episode, s."""
        return self._step * self.task.period

    @property
    def over(self) -> bool:
        """True if the episode is truncated: its time is over, or the motion failed."""
        return bool(self.reason) or self._step >= self.task.steps

    def reset(self, random: np.random.Generator) -> None:
        """Reset for an episode."""
        self._random, self.reason, self._step, self.now = random, "", 0, 0.0
        self.sampled = self._randomisation.sample_context(random)
        if self._randomisation.keys:
            self._build(self._family.with_values([self.sampled[key] for key in self._randomisation.keys]))
        self._start_state = self._draw_start()
        if self.rebuilt:
            self.stepper = self._stepper_at(self._start_state)
        else:
            self.stepper.restart(self._start_state, time=0.0)
        task = self.task
        self.context = self._draw_context()
        self.sampled |= self.context
        self.sensors = {
            name: self._randomisation.sensor(name, sensor, self.sampled) for name, sensor in task.sensors.items()
        }
        self.action.reset(self._randomisation.delay(self.sampled, task.delay))

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

    def _draw_start(self) -> Array:
        """Return the packed state at the start."""
        loop, task = self.origin, self.task
        if task.start == "reference":
            return loop.initial_state()
        joints = len(loop.finger.routing.joints)
        for _ in range(_MAX_STARTS):
            if callable(task.start):
                position = np.asarray(task.start(self._random), dtype=float)
                if position.shape != (joints,) or not np.isfinite(position).all():
                    raise InputError("start", f"must return {joints} finite angles, rad", position.tolist())
            else:
                limiter, coupling = loop.finger.stroke_limiter, self._scenario.coupling(loop.finger.routing)
                free_position = self._random.uniform(limiter.lower, limiter.upper)
                position = np.clip(coupling.matrix @ free_position + coupling.offset, limiter.lower, limiter.upper)
            x = loop.rest_state(position, np.zeros(joints))
            if self._is_free(x):
                return x
        # The nearest free posture on the way to the reference: a training must not end here.
        reference = loop.reference.at(0.0).position
        for share in np.arange(1.0, _WAY_STEPS) / _WAY_STEPS:
            x = loop.rest_state(position + share * (reference - position), np.zeros(joints))
            if self._is_free(x):
                return x
        return loop.initial_state()

    def _is_free(self, x: Array) -> bool:
        """Return whether no bodies are deep in each other at a packed state."""
        finger = self.origin.finger
        if finger.scene is None:
            return True
        try:
            finger.scene.check(finger.layout.unpack(x))
        except InputError:
            return False
        return True

    def act(self, action: Array) -> float:
        """Start a control period with an action; return the end of its first piece, s."""
        self.action.apply(action, self.time)
        self._step += 1
        return self._next_end()

    def finish_piece(self, end: float, status: int) -> float:
        """Record the status with which a stepper ended a piece; return the end of the next, s, or `NO_END`."""
        self.now = end
        if status:
            self.now = self.stepper.time
            self.reason = self.stepper.failure(status, self.origin.finger.layout.names)
        return self._next_end()

    def _next_end(self) -> float:
        """Apply the present inputs, and return the time of their end, s; `NO_END` after the period."""
        end = self._step * self.task.period
        if self.reason or self.now >= end:
            return NO_END
        return self.action.next_piece(self.stepper, self.now, end)

    def result(self, sample_rate: float) -> xr.Dataset:
        """Return the episode so far, repeated step by step, as a Dataset with its energy account."""
        if not self._step:
            raise InputError("result", "is of steps, and there are none yet: call step")
        stepper, end = self._stepper_at(self._start_state), self.stepper.time
        if self.action.compiled is not None:
            stepper.drive(self.action.restarted_drives())
        controller = self.action.recorded_inputs()
        trajectory = integrate_compiled(stepper, end, self.origin.finger.layout.names, controller=controller)
        # Rounding must not move a sample beyond the end.
        times = np.minimum(np.arange(int(end * sample_rate * (1.0 + 1e-12)) + 1) / sample_rate, end)
        samples = SampledTrajectory(self.loop, trajectory, times)
        dataset = record(self._scenario, samples, self._scenario.simulation.method)
        dataset.attrs["custom"] = "policy"
        return dataset

    def picture(self) -> NDArray[np.uint8]:
        """Return a picture of the present posture, from a point with all postures in view, of bytes."""
        method = self._scenario.simulation.method
        samples = snapshot(self.loop, self.stepper.time, self.stepper.x)
        dataset = record(self._scenario, samples, method, list(instant_variables(self.origin)))
        goal = self.context.get("goal")
        return draw_picture(dataset, self._extreme_tips, goal if goal is not None and goal.shape == (3,) else None)

    @cached_property
    def _extreme_tips(self) -> Array:
        """Fingertips at the corners of the joints' ranges, shape (k, 3), m."""
        limiter, body = self.origin.finger.stroke_limiter, self.origin.finger.rigid_body
        corners = np.array([limiter.lower, limiter.upper, 0.5 * (limiter.lower + limiter.upper)])
        return np.array([body.tip_position(corner) for corner in corners]).reshape(-1, 3)
