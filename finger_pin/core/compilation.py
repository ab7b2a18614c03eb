"""The compiler: numba, with a cache that survives processes and never serves stale code.

numba notices a change of a function's own file, not of the functions that it calls. The cache folder is therefore
named after a digest of every source file that is compiled. Where no folder can be written, everything is compiled
anew in each process. What takes its time is said once, as a warning of the logger ``finger_pin``, which Python prints
on standard error unless logging is set up otherwise.
"""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import platformdirs
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

_Function = TypeVar("_Function", bound=Callable[..., Any])
# Where compiled code stands.
_COMPILED = ("core/*.py", "laws/*.py", "mechanism/pieces.py", "mechanism/spans/*.py", "mechanism/gaps/*.py")
_LOGGER = logging.getLogger("finger_pin")


def _root() -> str:
    return os.environ.get("FINGER_PIN_CACHE_DIR") or platformdirs.user_cache_dir("finger_pin")


def _digest() -> str:
    package = Path(__file__).parent.parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted([path for room in _COMPILED for path in package.glob(room)]):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> str | None:
    folder = Path(_root()) / _digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError:
        return None
    return str(folder)


CACHE_FOLDER = _cache_folder()


_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    # IEEE arithmetic is kept, so that NaN stays NaN; only a product and a sum may be fused.
    "fastmath": {"contract"},
    # Nothing is allocated, so reference counting, which would cost half of the time, is left out; and the
    # tables of arrays that every function takes are free to pass only when calls are inlined.
    "_nrt": False,
}


def is_cached() -> bool:
    """Return whether compiled code is in the cache, so that the first simulation starts at once."""
    return CACHE_FOLDER is not None and any(Path(CACHE_FOLDER).rglob("*.nbi"))


@cache
def _say(text: str) -> None:
    """Warn once in a process, and not in those that a process starts."""
    if multiprocessing.parent_process() is None:
        _LOGGER.warning(text)


class _Announcer(event.Listener):
    """Says that the model is being compiled."""

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"].py_func.__module__.startswith("finger_pin."):
            often = "once for this version" if CACHE_FOLDER else f"in every run, as {_root()} cannot be written"
            advice = "" if CACHE_FOLDER else "; FINGER_PIN_CACHE_DIR may name another folder"
            _say(f"Compiling the model, {often}: about half a minute{advice} ...")

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]


class _Cache(FunctionCache):
    """numba's cache, where a full disk costs the next run half a minute and not this one its results."""

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError as error:
            _say(f"the compile cache {CACHE_FOLDER} cannot be written: {error.strerror}; the next run compiles again")


class _Text(JITCodeLibrary):
    """Code that is only inlined: what calls it optimises it, and it becomes no machine code of its own.

    That saves a fourth of all compiling. Numba asks a library's generator for one thing only here, to store an address.
    """

    @property
    def codegen(self) -> _Text:
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Store nothing: there is no machine code that would read it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True


class _TextCompiler(Compiler):
    """Compiles to `_Text`."""

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        own = library or _Text(target.codegen(), "inlined")  # type: ignore[no-untyped-call]
        super().__init__(typing, target, own, *rest)  # type: ignore[no-untyped-call]


_INLINED: dict[str, Any] = {
    "cache": False,
    "forceinline": True,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _TextCompiler,
}


def compiled(function: _Function) -> _Function:
    """Return the function compiled, to be called by compiled code only, where it is inlined."""
    return _compile(function, **_INLINED)


def compiled_loosely(function: _Function) -> _Function:
    """Return the function compiled as `compiled` does, with sums in whatever order vector instructions like."""
    return _compile(function, fastmath={"contract", "reassoc"}, **_INLINED)


def entry(function: _Function) -> _Function:
    """Return the function compiled on first use, to be called from Python."""
    return _compile(function, cache=CACHE_FOLDER is not None, no_cfunc_wrapper=True)


# Addresses that were handed out; the code behind them lives as long as these do.
_alive: list[Any] = []


def address_of(signature: Any, function: _Function, *, kept: bool) -> int:
    """Return the address of the function compiled for C.

    Args:
        signature: numba's, of pointers and numbers.
        function: The function.
        kept: Whether it is found on disk by later processes; for functions of this package only, whose digest names
            the folder.
    """
    keep = kept and CACHE_FOLDER is not None
    with _cache_directory():
        code = numba.cfunc(signature, cache=keep, **_OPTIONS)(function)
    _alive.append(code)
    return int(code.address or 0)


@contextmanager
def _cache_directory() -> Iterator[None]:
    earlier = numba.config.CACHE_DIR
    if CACHE_FOLDER is not None:
        numba.config.CACHE_DIR = CACHE_FOLDER
    try:
        yield
    finally:
        numba.config.CACHE_DIR = earlier


def _compile(function: _Function, **kind: Any) -> _Function:
    with _cache_directory():
        dispatcher = numba.njit(**{"nogil": True, **_OPTIONS, **kind})(function)
        if kind["cache"]:
            dispatcher._cache = _Cache(function)  # type: ignore[no-untyped-call]
        return dispatcher  # type: ignore[no-any-return]
