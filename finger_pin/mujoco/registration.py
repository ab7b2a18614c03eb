"""The plugin in MuJoCo: compiled callbacks in its table of plugins, tried on a known answer when it is made."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import mujoco

from finger_pin.core.jit import address_of
from finger_pin.exceptions import InputError
from finger_pin.exchange import mujoco_friction as table
from finger_pin.mujoco import kernel
from finger_pin.mujoco.layout import Contact, Data, Kinds, Model, layout

_CALLBACKS = (
    *("nstate", "nsensordata", "init", "destroy", "copy", "reset", "compute", "advance", "visualize"),
    *("actuator_act_dot", "sdf_distance", "sdf_gradient", "sdf_staticdistance", "sdf_attribute", "sdf_aabb"),
)


class _Plugin(ctypes.Structure):
    """mjpPlugin."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("nattribute", ctypes.c_int),
        ("attributes", ctypes.POINTER(ctypes.c_char_p)),
        ("capabilityflags", ctypes.c_int),
        ("needstage", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in _CALLBACKS),
    )


def _callbacks(model: Model, data: Data, contact: Contact, kinds: Kinds) -> dict[str, int]:
    """Return the addresses of the callbacks, with offsets as constants."""

    def nstate(m: int, instance: int) -> int:
        return kernel.signals(m, instance, model)

    def init(m: int, d: int, instance: int) -> int:
        return kernel.init(m, d, instance, model, data, kinds)

    def copy(to: int, m: int, d: int, instance: int) -> None:
        kernel.copy(to, d, instance, data)

    def reset(m: int, state: int, data: int, instance: int) -> None:
        kernel.reset(m, state, instance, model)

    def compute(m: int, d: int, instance: int, capability: int) -> None:
        kernel.compute(m, d, instance, model, data, kinds)

    def advance(m: int, d: int, instance: int) -> None:
        kernel.advance(m, d, instance, model, data, contact, kinds)

    signatures: dict[Any, str] = {
        nstate: "int32(intp, int32)",
        init: "int32(intp, intp, int32)",
        copy: "void(intp, intp, intp, int32)",
        reset: "void(intp, intp, intp, int32)",
        compute: "void(intp, intp, int32, int32)",
        advance: "void(intp, intp, int32)",
    }
    return {each.__name__: address_of(made, each, announced=False) for each, made in signatures.items()}


def _library() -> ctypes.CDLL:
    """Return the MuJoCo that Python has loaded."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise InputError(f"mujoco {mujoco.__version__}", f"friction finds no library of MuJoCo in {folder}")


@cache
def register() -> None:
    """Give MuJoCo the plugin, once in a process."""
    callbacks = _callbacks(*layout())
    library, plugin = _library(), _Plugin()
    library.mjp_defaultPlugin(ctypes.byref(plugin))
    plugin.name, plugin.capabilityflags = table.PLUGIN.encode(), 1
    plugin.nattribute, plugin.attributes = 1, (ctypes.c_char_p * 1)(table.COUNT.encode())
    for name, address in callbacks.items():
        setattr(plugin, name, address)
    library.mjp_registerPlugin.restype = ctypes.c_int
    if library.mjp_registerPlugin(ctypes.byref(plugin)) < 0:
        raise InputError(f"mujoco {mujoco.__version__}", "friction: MuJoCo does not take the plugin")
