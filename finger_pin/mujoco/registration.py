"""The plugin in MuJoCo: compiled callbacks in its table of plugins, tried on a known answer when it is made."""

from __future__ import annotations

import ctypes
import hashlib
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
from numba import cfunc, types

from finger_pin.exceptions import InputError
from finger_pin.exchange import mujoco_friction as table
from finger_pin.laws import bristle, capstan
from finger_pin.mujoco import constraint_rows, elements, kernel, loads, memory, vector_functions, vectorised_law
from finger_pin.mujoco.layout import layout

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


def _fingerprint() -> str:
    """Return a hash of the files that callbacks come from: numba sees one of them, not those that it calls."""
    functions = (vector_functions, vectorised_law, constraint_rows)
    modules = (kernel, elements, *functions, loads, memory, table, bristle, capstan)
    texts = (Path(str(each.__file__)).read_bytes() for each in modules)
    return hashlib.sha256(b"".join(texts)).hexdigest()


def _compiled(at: Any, of: Any, contact: Any, kinds: Any, constructor_args: str) -> dict[str, Any]:
    """Return the callbacks. Offsets are constants of theirs, and numba keeps compiled code by them."""
    word, whole, nothing = types.intp, types.int32, types.void
    options: dict[str, Any] = {"cache": True, "error_model": "numpy"}

    @cfunc(whole(word, whole), **options)
    def nstate(m: Any, instance: Any) -> Any:
        _ = constructor_args
        return kernel.signals(m, instance, at)

    @cfunc(whole(word, word, whole), **options)
    def init(m: Any, d: Any, instance: Any) -> Any:
        _ = constructor_args
        return kernel.init(m, d, instance, at, of, kinds)

    @cfunc(nothing(word, word, word, whole), **options)
    def copy(to: Any, m: Any, d: Any, instance: Any) -> None:
        _ = constructor_args
        kernel.copy(to, d, instance, of)

    @cfunc(nothing(word, word, word, whole), **options)
    def reset(m: Any, state: Any, data: Any, instance: Any) -> None:
        _ = constructor_args
        kernel.reset(m, state, instance, at)

    @cfunc(nothing(word, word, whole, whole), **options)
    def compute(m: Any, d: Any, instance: Any, capability: Any) -> None:
        _ = constructor_args
        kernel.compute(m, d, instance, at, of, kinds)

    @cfunc(nothing(word, word, whole), **options)
    def advance(m: Any, d: Any, instance: Any) -> None:
        _ = constructor_args
        kernel.advance(m, d, instance, at, of, contact, kinds)

    return {each.__name__: each for each in (nstate, init, copy, reset, compute, advance)}


def _library() -> Any:
    """Return the MuJoCo that Python has loaded."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise InputError(f"mujoco {mujoco.__version__}", f"friction finds no library of MuJoCo in {folder}")


@cache
def register() -> dict[str, Any]:
    """Give MuJoCo the plugin, once in a process, and return its callbacks.

    Raises:
        InputError: If this version of MuJoCo cannot have it.
    """
    callbacks = _compiled(*layout(), _fingerprint())
    library, plugin = _library(), _Plugin()
    library.mjp_defaultPlugin(ctypes.byref(plugin))
    plugin.name, plugin.capabilityflags = table.PLUGIN.encode(), 1
    plugin.nattribute, plugin.attributes = 1, (ctypes.c_char_p * 1)(table.COUNT.encode())
    for name, callback in callbacks.items():
        setattr(plugin, name, callback.address)
    library.mjp_registerPlugin.restype = ctypes.c_int
    if library.mjp_registerPlugin(ctypes.byref(plugin)) < 0:
        raise InputError(f"mujoco {mujoco.__version__}", "friction: MuJoCo does not take the plugin")
    return callbacks
