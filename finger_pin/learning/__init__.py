"""Environments for learning: any scenario, with friction, slack and servos, and every number open to be drawn.

Importing this room registers ``finger_pin/Reach-v0``, ``finger_pin/Press-v0`` and ``finger_pin/Grasp-v0`` with
Gymnasium, which comes with the extra ``gymnasium``.
"""

from finger_pin.version import installing

try:
    import gymnasium as _gymnasium  # noqa: F401 - asked for first, so that who lacks it is told what to install
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"finger_pin.learning needs Gymnasium: {installing('gymnasium')}") from error

from finger_pin.learning.distributions import Choice, LogUniform, Normal, Uniform
from finger_pin.learning.environment import Environment
from finger_pin.learning.sensors import Sensor
from finger_pin.learning.task import per_world
from finger_pin.learning.tasks import register
from finger_pin.learning.vector_environment import VectorEnvironment

__all__ = ["Choice", "Environment", "LogUniform", "Normal", "Sensor", "Uniform", "VectorEnvironment", "per_world"]


register()
