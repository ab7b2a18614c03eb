"""One world of an environment: a scenario in steps, what a policy sees of it, and what is drawn for an episode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.compiled import sampled_control
from finger_pin.core.stepping.batch import advance_together
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.description.family import Family
from finger_pin.description.loading import load_scenario
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import nearest
from finger_pin.exceptions import InputError
from finger_pin.learning.action import Action
from finger_pin.learning.instant import instant, known_variables
from finger_pin.learning.randomisation import Randomisation
from finger_pin.learning.sensors import Measurement
from finger_pin.learning.task import Task
from finger_pin.simulation.motions import Motions
from finger_pin.simulation.recording import record
from finger_pin.simulation.variables import variables
from finger_pin.views.viewer.video import draw_picture

if TYPE_CHECKING:
    import xarray as xr

# Starts that are drawn anew where bodies overlap.
_TRIES = 100


class World:
    """One world.

    Attributes:
        task: What is asked of the policy.
        stepper: What moves.
        drawn: What was drawn for the episode: numbers by key, and what the task draws.
        reason: Why the motion cannot go on; empty if it can.
    """

    def __init__(self, family: Family, task: Task, randomisation: Randomisation) -> None:
        """Build the scenario; use `of` or `twin`."""
        self.task, self._family, self._randomisation = task, family, randomisation
        self.drawn: dict[str, Any] = {}
        self.context: dict[str, Array] = {}
        self.reason, self._step = "", 0
        self._build(family.scenario)

    @classmethod
    def of(cls, scenario: Scenario | str | Path, task: Task) -> World:
        """Return a world of a scenario.

        Raises:
            InputError: Naming the key or variable that is wrong.
        """
        scenario = load_scenario(scenario)
        if scenario.simulation.method not in TABLEAUS:
            raise InputError("simulation.method", f"must be one of {', '.join(TABLEAUS)}", scenario.simulation.method)
        randomisation = Randomisation(task)
        world = cls(Family(scenario, randomisation.keys), task, randomisation)
        known = known_variables(world._loop)
        for name in task.variables:
            if name not in known:
                near = nearest(name, known)
                hint = f"; did you mean {near}?" if near else ""
                raise InputError("observation", f"no such variable; there are {', '.join(known)}{hint}", name)
        # What cannot be drawn is said now, not at the hundredth reset.
        world.begin(np.random.default_rng(0))
        return world

    def twin(self) -> World:
        """Return another world of the same scenario and task."""
        return World(self._family, self.task, self._randomisation)

    def _build(self, scenario: Scenario) -> None:
        """Build what moves, under inputs that are held."""
        loop = ClosedLoop.from_scenario(scenario).compiled()
        self._scenario, self._origin = scenario, loop
        self.action = Action(self.task.action, loop.finger, self.task.duration)
        driven = self.action if self.action.drives is not None else None
        self._loop = replace(loop, controller=self.action, drives=driven)
        self.stepper = self._stepper_at(loop.initial_state())
        if self.action.drives is not None:
            self.stepper.drive(self.action.drives)
        table = variables(self._loop)
        self._variables = {name: table[name] for name in self.task.variables if name in table}

    def _stepper_at(self, x: Array) -> Stepper:
        """Return a stepper that starts from a state."""
        loop, settings = self._origin, self._scenario.simulation
        return Stepper(
            loop.finger.mechanism,
            sampled_control(loop),
            x,
            TABLEAUS[settings.method](),
            settings.rtol,
            settings.atol_scale * loop.finger.layout.scales(),
            loop.fingertip_force,
        )

    @property
    def time(self) -> float:
        """Simulated time of the episode, s."""
        return self._step * self.task.period

    @property
    def over(self) -> bool:
        """Whether the episode is truncated: its time is over, or the motion cannot go on."""
        return bool(self.reason) or self._step >= self.task.steps

    def begin(self, random: np.random.Generator) -> None:
        """Begin an episode.

        Raises:
            InputError: If what is drawn is not allowed.
        """
        self._random, self.reason, self._step = random, "", 0
        self.drawn = self._randomisation.draw(random)
        if self._randomisation.keys:
            self._build(self._family.at([self.drawn[key] for key in self._randomisation.keys]))
        self._begun = self._start()
        self.stepper.restart(self._begun, time=0.0)
        task = self.task
        context = {} if task.draw is None else task.draw(random)
        self.context = {name: np.asarray(value, dtype=float) for name, value in context.items()}
        self.drawn |= self.context
        self._measurements = {
            name: Measurement(self._randomisation.sensor(name, sensor, self.drawn), name, task.period)
            for name, sensor in task.sensors.items()
        }
        self.action.begin(self._randomisation.delay(self.drawn, task.delay))

    def _start(self) -> Array:
        """Return the packed state at the start."""
        loop, task = self._origin, self.task
        if task.start == "reference":
            return loop.initial_state()
        around, joints = loop.finger.surroundings, len(loop.finger.routing.joints)
        for _ in range(_TRIES):
            if callable(task.start):
                position = np.asarray(task.start(self._random), dtype=float)
                if position.shape != (joints,) or not np.isfinite(position).all():
                    raise InputError("start", f"must return {joints} finite angles, rad", position.tolist())
            else:
                limiter, coupling = loop.finger.stroke_limiter, self._scenario.coupling(loop.finger.routing)
                free = self._random.uniform(limiter.lower, limiter.upper)
                position = np.clip(coupling.matrix @ free + coupling.offset, limiter.lower, limiter.upper)
            x = loop.rest_state(position, np.zeros(joints))
            if around is None:
                return x
            try:
                state = loop.finger.layout.unpack(x)
                assert state.object_pose is not None
                around.check(position, state.object_pose)
            except InputError as error:
                problem = error
            else:
                return x
        raise problem

    def act(self, action: Array) -> None:
        """Take an action, which holds from the next period on, or later by its delay."""
        self.action.take(action, self.time)

    def next_end(self) -> float:
        """Hold what acts now, and return until when, s; the time that it has reached where the period is over."""
        end = (self._step + 1) * self.task.period
        now = self.stepper.time
        return now if self.reason or now >= end else self.action.next_piece(self.stepper, now, end)

    def end_period(self) -> None:
        """Count a control period."""
        self._step += 1

    def note(self, status: int) -> None:
        """Take note of how a stepper ended a piece."""
        if status:
            self.reason = self.stepper.failure(status, self._loop.finger.layout.names)

    def observe(self) -> tuple[Array, dict[str, Array]]:
        """Return what the policy sees, shape (o,), and the truth by name."""
        motions = self._motions()
        signals = {name: each.value(motions)[0] for name, each in self._variables.items()}
        seen = [self._measurements[name].sample(signals[name], self._random).ravel() for name in self._measurements]
        seen += [value.ravel() for value in self.context.values()]
        signals |= self.context
        signals["action"] = self.action.given
        return np.concatenate(seen, dtype=np.float32), signals

    def _motions(self) -> Motions:
        return instant(self._loop, self.stepper.time, self.stepper.x)

    def info(self, signals: Mapping[str, Array]) -> dict[str, Any]:
        """Return what goes beside an observation: privileged variables, and why the motion cannot go on if so."""
        found: dict[str, Any] = {}
        if self.task.privileged:
            found["privileged"] = {name: signals[name] for name in self.task.privileged}
        if self.reason:
            found["reason"] = self.reason
        return found

    def result(self, sample_rate: float) -> xr.Dataset:
        """Return the episode so far, integrated again step by step, as a Dataset with its energy account."""
        if not self._step:
            raise InputError("result", "is of steps, and there are none yet: call step")
        stepper, end = self._stepper_at(self._begun), self.stepper.time
        if self.action.drives is not None:
            stepper.drive(self.action.again())
        held = self.action.replayed() if self.action.drives is None else None
        trajectory = integrate_compiled(stepper, end, self._loop.finger.layout.names, held=held)
        times = np.arange(round(end * sample_rate) + 1) / sample_rate
        motions = Motions(self._loop, trajectory, times)
        found = record(self._scenario, motions, self._scenario.simulation.method)
        found.attrs["own"] = "policy"
        return found

    def picture(self) -> NDArray[np.uint8]:
        """Return a picture of the present posture, seen from where all postures are in view, of bytes."""
        motions = self._motions()
        method = self._scenario.simulation.method
        found = record(self._scenario, motions, method, list(known_variables(self._loop)))
        return draw_picture(found, self._stage)

    @cached_property
    def _stage(self) -> Array:
        """Fingertips at the corners of the joints' ranges, shape (k, 3), m."""
        limiter, body = self._loop.finger.stroke_limiter, self._loop.finger.rigid_body
        corners = np.array([limiter.lower, limiter.upper, 0.5 * (limiter.lower + limiter.upper)])
        return np.array([body.tip_position(corner) for corner in corners]).reshape(-1, 3)


def build_spaces(world: World, limits: Any) -> tuple[Box, Box]:
    """Return the spaces of observations and actions, both of 32-bit floats."""
    low, high = world.action.limited(limits)
    observation, _ = world.observe()
    return Box(-np.inf, np.inf, observation.shape, np.float32), Box(low.astype(np.float32), high.astype(np.float32))


def read_action(action: Any, space: Box) -> Array:
    """Return an action as an array within its bounds.

    Raises:
        InputError: If it has another shape, or is not finite.
    """
    found = np.asarray(action, dtype=float)
    if found.shape != space.shape:
        raise InputError("action", f"must have shape {space.shape}", list(found.shape))
    if not np.isfinite(found).all():
        raise InputError("action", "must be finite", found.tolist())
    return np.asarray(np.clip(found, space.low, space.high), dtype=float)


def advance_all(worlds: Sequence[World]) -> None:
    """Advance worlds by a control period, side by side in threads without Python in between.

    Where actions arrive within the period, it has several pieces.
    """
    while True:
        ends = [world.next_end() for world in worlds]
        due = [(world, end) for world, end in zip(worlds, ends, strict=True) if end > world.stepper.time]
        if not due:
            break
        if len(due) == 1:
            statuses = [due[0][0].stepper.advance(due[0][1])]
        else:
            statuses = advance_together([world.stepper for world, _ in due], [end for _, end in due])
        for (world, _), status in zip(due, statuses, strict=True):
            world.note(status)
    for world in worlds:
        world.end_period()


def observe_all(worlds: Sequence[World]) -> tuple[Array, dict[str, Array]]:
    """Return what policies see, shape (w, o), and the truth by name, with the worlds in front."""
    seen, signals = zip(*(world.observe() for world in worlds), strict=True)
    return np.stack(seen), {name: np.stack([each[name] for each in signals]) for name in signals[0]}
