"""Friction of finger_pin inside MuJoCo's `mj_step`: `add_friction` gives it to a model, `friction` reads it.

Importing this registers the plugin that computes it, so that models that have it can be loaded.
"""

import importlib
from typing import Any

from finger_pin.exceptions import InputError
from finger_pin.version import installing

try:
    import mujoco as _mujoco  # noqa: F401
except ImportError:
    raise InputError("mujoco", f"is not installed: {installing('mujoco')}") from None

from finger_pin.exchange.mujoco_overlay import add_tendons
from finger_pin.mujoco.friction_signals import Signals, friction
from finger_pin.mujoco.self_test import try_self_test
from finger_pin.mujoco.specification import MujocoWarning, add_friction

try_self_test()


def __getattr__(name: str) -> Any:
    """Return the subpackage ``warp``, which is imported where it is asked for."""
    if name == "warp":
        return importlib.import_module("finger_pin.mujoco.warp")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["MujocoWarning", "Signals", "add_friction", "add_tendons", "friction"]
