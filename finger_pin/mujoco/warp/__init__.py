"""Our friction in MuJoCo Warp: `add_friction` gives it to thousands of worlds that `mujoco_warp.step` steps at once."""

from finger_pin.exceptions import InputError
from finger_pin.version import installing

try:
    import mujoco_warp as _mujoco_warp  # noqa: F401
except ImportError:
    raise InputError("mujoco_warp", f"is not installed: {installing('warp')}") from None

from finger_pin.mujoco.warp.friction_callbacks import Friction, add_friction
from finger_pin.mujoco.warp.names import add_branches

__all__ = ["Friction", "add_branches", "add_friction"]
