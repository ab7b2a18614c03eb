"""Tasks that ship: reach a point, press on a plate that moves, hold a ball while the palm is shaken."""

from __future__ import annotations

from functools import cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from finger_pin.description.loading import load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.learning.distributions import Uniform
from finger_pin.learning.environment import Environment
from finger_pin.learning.sensors import Sensor
from finger_pin.learning.task import Function, Signals
from finger_pin.learning.vector_environment import VectorEnvironment
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

#: At these tolerances angles err by about a thousandth of a radian, which no policy feels.
COARSE_TOLERANCES = {"simulation.method": "Rodas4", "simulation.rtol": 1e-2, "simulation.atol_scale": 2e-2}
# Most tensions, N, half of which hold the finger in the air, and half of which press on things with a newton or two.
_REACH_LIMITS, _PRESS_LIMITS = (2.0, 2.0, 8.8, 6.2), (12.0, 12.0, 25.0, 8.0)
# Errors over which the halves of a reward fall off, m and N: the first leads there, the second asks for more.
_DISTANCE_SCALES, _FORCE_SCALES, _HALF_WEIGHTS = np.array([0.06, 0.015]), np.array([2.0, 0.3]), np.array([0.5, 0.5])
# What a newton on the ball costs.
_FORCE_COST = 0.1
# A ball that is further than this from between the fingertips is lost, m.
_LOST_DISTANCE = 0.025


@cache
def _scenario(name: str, overrides: tuple[tuple[str, Any], ...] = ()) -> Scenario:
    return load_scenario(name, {**COARSE_TOLERANCES, **dict(overrides)})


@cache
def _paper_finger() -> Finger:
    return Finger("ub_stand_in")


def fingertip_goal(random: np.random.Generator) -> dict[str, Array]:
    """Return the fingertip position at a posture that the passive tendon allows, each joint within its middle 80 %."""
    finger = _paper_finger()
    limiter, coupling = finger.stroke_limiter, _scenario("reversals").coupling(finger.routing)
    margin = 0.1 * (limiter.upper - limiter.lower)
    free = random.uniform(limiter.lower + margin, limiter.upper - margin)
    return {"goal": finger.rigid_body.tip_position(coupling.posture(free[coupling.free]))}


def wanted_force(random: np.random.Generator) -> dict[str, Array]:
    """Return a normal force between 0.5 and 3 N."""
    return {"wanted_force": random.uniform(0.5, 3.0, 1)}


def _closeness(error: Array, scales: Array) -> Array:
    """Return 1 for no error, and 0 for a large one."""
    return np.asarray(1.0 - np.tanh(error[:, None] / scales) @ _HALF_WEIGHTS)


def _norm(vector: Array) -> Array:
    # Faster than numpy.linalg.norm for three components.
    return np.asarray(np.sqrt(np.vecdot(vector, vector)))


def to_goal(signals: Signals) -> Array:
    """Return the vector from the fingertip to the goal, shape (worlds, 3), m."""
    return np.asarray(signals["goal"] - signals["fingertip_position"])


def missing_force(signals: Signals) -> Array:
    """Return the wanted force less that of all contacts, shape (worlds, 1), N."""
    return np.asarray(signals["wanted_force"] - signals["contact_normal_force"].sum(axis=-1, keepdims=True))


def from_grip(signals: Signals) -> Array:
    """Return the vector from the middle of the fingertips to the ball, palm frame, shape (worlds, 3), m."""
    middle = signals["fingertip_position"].mean(axis=-2)
    return np.asarray(signals["object_position"][..., 0, :] - middle)


def _reach_reward(signals: Signals) -> Array:
    return _closeness(_norm(to_goal(signals)), _DISTANCE_SCALES)


def _press_reward(signals: Signals) -> Array:
    return _closeness(np.abs(missing_force(signals)[..., 0]), _FORCE_SCALES)


def _grip_reward(signals: Signals) -> Array:
    closeness = _closeness(_norm(from_grip(signals)), _DISTANCE_SCALES)
    return np.asarray(closeness - _FORCE_COST * signals["contact_normal_force"].sum(axis=-1))


def _ball_is_lost(signals: Signals) -> NDArray[np.bool_]:
    return np.asarray(_norm(from_grip(signals)) > _LOST_DISTANCE)


def _observations(*names: str, **functions: Function) -> dict[str, Sensor | Function]:
    return {name: Sensor() for name in names} | functions


def _reach_task() -> dict[str, Any]:
    return {
        "scenario": _scenario("reversals", (("title", "the fingertip reaches a point"),)),
        "limits": (0.0, _REACH_LIMITS),
        "reward": _reach_reward,
        "observation": _observations("joint_position", "joint_velocity", "fingertip_position", to_goal=to_goal),
        "draw": fingertip_goal,
        "start": "random",
    }


def _press_task() -> dict[str, Any]:
    plate = "environment.objects.plate.path.z"
    return {
        "scenario": _scenario(
            "press",
            (
                ("title", "the fingertip presses on a plate that moves"),
                (f"{plate}.amplitude", 0.002),
                (f"{plate}.frequency", 0.5),
            ),
        ),
        "limits": (0.0, _PRESS_LIMITS),
        "reward": _press_reward,
        # Friction hides the commands: without tensions a policy knows neither its last action nor its effect.
        "observation": _observations(
            "tendon_tension", "joint_position", "joint_velocity", "contact_normal_force", missing_force=missing_force
        ),
        "draw": wanted_force,
        "randomise": {f"{plate}.phase": Uniform(0.0, 2.0 * np.pi), f"{plate}.frequency": Uniform(0.2, 1.0)},
    }


def _grasp_task() -> dict[str, Any]:
    return {
        "scenario": _scenario("pinch", (("title", "two fingers hold a ball while the palm is shaken"),)),
        "limits": (0.0, _PRESS_LIMITS * 2),
        "reward": _grip_reward,
        "done": _ball_is_lost,
        "observation": _observations(
            "joint_position",
            "joint_velocity",
            "fingertip_position",
            "object_position",
            "palm_position",
            from_grip=from_grip,
        ),
        "privileged": ("contact_normal_force",),
        "randomise": {
            "hand.palm.path.y.amplitude": Uniform(0.0, 0.015),
            "hand.palm.path.y.frequency": Uniform(1.0, 4.0),
            "environment.objects.ball.mass": Uniform(0.02, 0.04),
        },
    }


TASKS = {"Reach-v0": _reach_task, "Press-v0": _press_task, "Grasp-v0": _grasp_task}


def make(name: str, render_mode: str | None = None, **task: Any) -> Environment:
    """Return the environment of a shipped task, with some fields replaced."""
    return Environment(render_mode=render_mode, **{**TASKS[name](), **task})


def make_vector(name: str, num_envs: int = 1, render_mode: str | None = None, **task: Any) -> VectorEnvironment:
    """Return many worlds of a task that ships."""
    return VectorEnvironment(num_envs, render_mode=render_mode, **{**TASKS[name](), **task})


def register() -> None:
    """Register the tasks in Gymnasium."""
    for name in TASKS:
        if f"finger_pin/{name}" not in gymnasium.registry:
            gymnasium.register(
                f"finger_pin/{name}",
                entry_point="finger_pin.learning.tasks:make",
                vector_entry_point="finger_pin.learning.tasks:make_vector",
                kwargs={"name": name},
            )
