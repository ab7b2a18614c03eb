"""Tasks that ship: reach a point, press on a plate that moves, hold a ball while the palm is shaken."""

from __future__ import annotations

from functools import cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from finger_pin.description.loading import load_scenario
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.learning.distributions import Uniform
from finger_pin.learning.environment import Environment
from finger_pin.learning.task import Signals
from finger_pin.learning.vector_environment import VectorEnvironment
from finger_pin.mechanism.finger import Finger

# At these tolerances angles err by less than a thousandth of a radian rms, which no policy feels.
_COARSE = {"simulation.method": "Rodas4", "simulation.rtol": 1e-2, "simulation.atol_scale": 1e-2}
# Distances at which a reward has fallen to a quarter, m and N.
_NEAR, _GENTLE = 0.02, 0.5
# A ball that is further than this from between the fingertips is lost, m.
_LOST = 0.025


@cache
def _scenario(name: str, overrides: tuple[tuple[str, Any], ...] = ()) -> Scenario:
    return load_scenario(name, {**_COARSE, **dict(overrides)})


@cache
def _paper_finger() -> Finger:
    return Finger("ub")


def fingertip_goal(random: np.random.Generator) -> dict[str, Array]:
    """Return the fingertip position at a posture that the passive tendon allows, each joint within its middle 80 %."""
    finger = _paper_finger()
    limiter, coupling = finger.stroke_limiter, _scenario("fig6").coupling(finger.routing)
    margin = 0.1 * (limiter.upper - limiter.lower)
    free = random.uniform(limiter.lower + margin, limiter.upper - margin)
    return {"goal": finger.rigid_body.tip_position(coupling.matrix @ free + coupling.offset)}


def wanted_force(random: np.random.Generator) -> dict[str, Array]:
    """Return a normal force between 0.5 and 3 N."""
    return {"wanted_force": random.uniform(0.5, 3.0, 1)}


def _nearness(distance: Array, scale: float) -> Array:
    return 1.0 - np.tanh(distance / scale)


def _reached(signals: Signals) -> Array:
    return _nearness(np.linalg.norm(signals["fingertip_position"] - signals["goal"], axis=-1), _NEAR)


def _pressed(signals: Signals) -> Array:
    pressed = signals["contact_normal_force"].sum(axis=-1)
    return _nearness(np.abs(pressed - signals["wanted_force"][..., 0]), _GENTLE)


def _from_grip(signals: Signals) -> Array:
    """Return how far the ball is from the middle of the fingertips, shape (worlds,), m."""
    middle = signals["fingertip_position"].mean(axis=-2)
    return np.asarray(np.linalg.norm(signals["object_position"][..., 0, :] - middle, axis=-1))


def _held(signals: Signals) -> Array:
    return _nearness(_from_grip(signals), _NEAR)


def _lost(signals: Signals) -> NDArray[np.bool_]:
    return np.asarray(_from_grip(signals) > _LOST)


def _reach() -> dict[str, Any]:
    return {
        "scenario": _scenario("fig6"),
        "reward": _reached,
        "observation": ("joint_position", "joint_velocity", "fingertip_position"),
        "draw": fingertip_goal,
        "start": "random",
    }


def _press() -> dict[str, Any]:
    plate = "environment.objects.plate.path.z"
    return {
        "scenario": _scenario("press", ((f"{plate}.amplitude", 0.002), (f"{plate}.frequency", 0.5))),
        "reward": _pressed,
        "observation": ("joint_position", "joint_velocity", "contact_normal_force"),
        "draw": wanted_force,
        "randomise": {f"{plate}.phase": Uniform(0.0, 2.0 * np.pi), f"{plate}.frequency": Uniform(0.2, 1.0)},
    }


def _grasp() -> dict[str, Any]:
    return {
        "scenario": _scenario("pinch"),
        "reward": _held,
        "done": _lost,
        "observation": ("joint_position", "joint_velocity", "fingertip_position", "object_position"),
        "privileged": ("contact_normal_force",),
        "randomise": {
            "hand.palm.path.y.amplitude": Uniform(0.0, 0.015),
            "hand.palm.path.y.frequency": Uniform(1.0, 4.0),
            "environment.objects.ball.mass": Uniform(0.02, 0.04),
        },
    }


TASKS = {"Reach-v0": _reach, "Press-v0": _press, "Grasp-v0": _grasp}


def make(name: str, render_mode: str | None = None, **task: Any) -> Environment:
    """Return a task that ships, with other fields than its own where they are given."""
    return Environment(render_mode=render_mode, **{**TASKS[name](), **task})


def make_vector(name: str, num_envs: int = 1, render_mode: str | None = None, **task: Any) -> VectorEnvironment:
    """Return many worlds of a task that ships."""
    return VectorEnvironment(num_envs, **{**TASKS[name](), **task})


def register() -> None:
    """Tell Gymnasium of the tasks."""
    for name in TASKS:
        if f"finger_pin/{name}" not in gymnasium.registry:
            gymnasium.register(
                f"finger_pin/{name}",
                entry_point="finger_pin.learning.tasks:make",
                vector_entry_point="finger_pin.learning.tasks:make_vector",
                kwargs={"name": name},
            )
