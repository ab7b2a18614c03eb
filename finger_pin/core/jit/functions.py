"""Functions compiled by numba, and kept in its cache on disk.

Numba keeps code beside the file that a function stands in, under the function's name, as long as that file is the
same. It sees neither what a function calls in other files nor which globals it was given: so functions are handed to
it under a name that has a digest of all that they reach (`digests`), as if they stood in an empty file of the cache's
folder. Of processes that ask for the same at once one compiles, and the others wait.
Where no folder can be written, everything is compiled anew in each process. What takes its time is said once, as a
warning of the logger ``finger_pin``, which Python prints on standard error unless logging is set up otherwise.
"""

from __future__ import annotations

import ast
import builtins
import ctypes
import inspect
import logging
import multiprocessing
import os
import textwrap
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import cache
from pathlib import Path
from pickle import UnpicklingError
from types import FunctionType
from typing import Any, TypeVar

import filelock
import numba

from finger_pin.core.jit.digests import Undigestible, cache_root, source_digest
from finger_pin.description.caching import cached_property
from finger_pin.exceptions import InputError

_Function = TypeVar("_Function", bound=Callable[..., Any])
_LOGGER = logging.getLogger("finger_pin")

# Of all that is compiled: IEEE arithmetic is kept, so that NaN stays NaN; only a product and a sum may be fused.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}
# Arrays are free to pass only where calls are inlined; nobody calls these functions from outside.
_INLINED = {**_OPTIONS, "forceinline": True, "no_cfunc_wrapper": True, "no_cpython_wrapper": True}
# How long to wait for a process that compiles the same, s; one that has ended, however, is not waited for.
_LONGEST_WAIT = 300.0


def njit_inline(function: _Function) -> _Function:
    """Return the function compiled once, to be inlined by the optimiser at each of the places that call it."""
    return numba.njit(**_INLINED)(function)  # type: ignore[no-any-return]


def njit_always_inline(function: _Function) -> _Function:
    """Return a function that is inlined into its callers when compiled.

    Numba optimises each function of `njit_inline` with all that it calls, and makes machine code of it, though only
    what calls it is ever run: of a chain of calls, the last function would be optimised as often as the chain is long.
    What is inlined here it copies twice for each caller in the chain, block by block with all names of the function: of
    one with 150 blocks and 1,500 names that takes longer than to optimise it.
    """
    return numba.njit(inline="always", **_OPTIONS)(function)  # type: ignore[no-any-return]


def njit_reassociate(function: _Function) -> _Function:
    """Return the function compiled as `njit_inline` does, with sums in any order, for vector instructions."""
    return numba.njit(**_INLINED | {"fastmath": {"contract", "reassoc"}})(function)  # type: ignore[no-any-return]


@cache
def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a plain function compiled, with all plain functions that it calls."""
    assert isinstance(function, FunctionType)
    code, global_names = function.__code__, function.__globals__
    if _may_raise(function):
        raise InputError(
            f"law.{function.__qualname__}", "must raise no exception, as compiled code tells it nobody; return nan"
        )
    called = {name: global_names[name] for name in code.co_names if isinstance(global_names.get(name), FunctionType)}
    world = {**global_names, **{name: inlined(each) for name, each in called.items()}}
    return njit_inline(FunctionType(code, world, function.__name__, function.__defaults__, function.__closure__))


def _may_raise(function: FunctionType) -> bool:
    """Return whether a function from outside this package has a ``raise`` or an ``assert``."""
    if function.__module__.startswith("finger_pin."):
        return False
    try:
        nodes = ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function))))
        return any(isinstance(node, ast.Raise | ast.Assert) for node in nodes)
    except SyntaxError:
        # The line of a lambda, which can do neither.
        return False
    except (OSError, TypeError):
        # Without a text, whoever raises an exception names it.
        global_names = vars(builtins) | function.__globals__
        named = [global_names.get(name) for name in function.__code__.co_names]
        return any(isinstance(each, type) and issubclass(each, BaseException) for each in named)


class CompiledFunction:
    """A function of an address and a number that returns an integer, compiled on first use, or found on disk."""

    def __init__(self, function: Callable[[int, float], int]) -> None:
        """Wrap a function, compiled on first use."""
        assert isinstance(function, FunctionType)
        self._function, self.__module__ = function, function.__module__

    def __reduce__(self) -> str:
        """Return the name; addresses differ between processes."""
        return self._function.__qualname__

    @cached_property
    def address(self) -> int:
        """Its address for compiled code."""
        return address_of("int64(int64, float64)", self._function)

    @cached_property
    def _call(self) -> Callable[[int, float], int]:
        return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_double)(self.address)

    def compile(self) -> None:
        """Compile the function, or load it from the cache."""
        assert self.address

    @property
    def kept(self) -> bool:
        """Return whether its compiled code is on disk."""
        named = _named(self._function)
        return named is not None and _is_kept(named)

    def __call__(self, address: int, number: float = 0.0) -> int:
        """Call the compiled function without holding the GIL."""
        return self._call(address, number)


# Two threads may ask for the same.
_lock = threading.RLock()
if hasattr(os, "register_at_fork"):
    # No compilation is under way then, and none of numba's own locks is held.
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release)
_kept_alive: list[Any] = []


def address_of(signature: str, function: Callable[..., Any], announced: bool = True) -> int:
    """Return the address of the function compiled for C; it lives as long as the process.

    Args:
        signature: As numba writes it, of pointers and numbers.
        function: The function. Nothing tells the caller of an exception: it must raise none.
        announced: Whether it is said that compiling takes its time.
    """
    assert isinstance(function, FunctionType)
    result: Any
    with _lock:
        named = _named(function)
        on_disk = named is not None and _is_kept(named)
        if announced and not on_disk:
            _announce()
        try:
            with nullcontext() if on_disk or named is None else _exclusively(named):
                result = numba.cfunc(signature, cache=named is not None, **_OPTIONS)(named or function)
        except (OSError, EOFError, UnpicklingError) as error:
            reason = getattr(error, "strerror", None) or repr(error)
            _warn_once(f"the compile cache {cache_root()} cannot be used: {reason}; the next run compiles again")
            result = numba.cfunc(signature, **_OPTIONS)(function)
        _kept_alive.append(result)
        return result.address  # type: ignore[no-any-return]


def cache_place() -> Path | None:
    """Return the lock file of the compiled code, or None if it cannot be kept."""
    place = cache_root() / "compiled.py"
    try:
        if not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            place.touch()
    except OSError:
        return None
    return place if os.access(place.parent, os.W_OK) else None


def _named(function: FunctionType) -> FunctionType | None:
    """Return the function under the name for numba's cache, or None if it cannot be cached."""
    place = cache_place()
    try:
        name = f"{function.__name__}-{source_digest(function)}"
    except Undigestible:
        return None
    if place is None:
        return None
    code = function.__code__.replace(co_filename=str(place), co_firstlineno=1)
    named = FunctionType(code, function.__globals__, name, function.__defaults__, function.__closure__)
    named.__qualname__ = name
    return named


@contextmanager
def _exclusively(named: FunctionType) -> Iterator[None]:
    """Let one process at a time compile a function for the cache; the others then load it from disk."""
    lock = filelock.FileLock(cache_root() / f"{named.__name__.rpartition('-')[2]}.lock", timeout=_LONGEST_WAIT)
    # Where files cannot be locked, each process compiles for itself.
    with suppress(OSError, NotImplementedError):
        lock.acquire()
    try:
        yield
    finally:
        if lock.is_locked:
            with suppress(OSError):
                Path(lock.lock_file).unlink()
            lock.release()


def _is_kept(named: FunctionType) -> bool:
    folder = Path(getattr(numba.config, "CACHE_DIR", "") or cache_root())
    return any(folder.rglob(f"*{named.__name__}*.nbc"))


def _announce() -> None:
    lasting = cache_place() is not None
    often = "once for this version" if lasting else f"in every run, as {cache_root()} cannot be written"
    advice = "" if lasting else "; FINGER_PIN_CACHE_DIR may name another folder"
    _warn_once(f"Compiling the model, {often}: about a minute{advice} ...")


@cache
def _warn_once(text: str) -> None:
    """Warn once in a process, and not in those that a process starts."""
    if multiprocessing.parent_process() is None:
        _LOGGER.warning(text)
