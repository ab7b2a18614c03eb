"""The compiler: numba, with a cache that survives processes and never serves stale code.

numba notices a change of a function's own file, not of the functions that it calls. The cache folder is therefore
named after a digest of every source file that is compiled. Where no folder can be written, everything is compiled
anew in each process.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numba
import platformdirs

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _digest() -> str:
    package = Path(__file__).parent.parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted([*package.glob("core/*.py"), *package.glob("laws/*.py")]):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> str | None:
    root = os.environ.get("FINGER_PIN_CACHE_DIR") or platformdirs.user_cache_dir("finger_pin")
    folder = Path(root) / _digest()
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
    """Return whether compiled code is at hand, so that the first simulation starts at once."""
    return CACHE_FOLDER is not None and any(Path(CACHE_FOLDER).rglob("*.nbi"))


def compiled(function: _Function) -> _Function:
    """Return the function compiled, to be called by compiled code only, where it is inlined."""
    return _compile(function, cache=False, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def compiled_loosely(function: _Function) -> _Function:
    """Return the function compiled as `compiled` does, with sums in whatever order vector instructions like."""
    loose = {"contract", "reassoc"}
    return _compile(
        function, cache=False, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=loose
    )


def compiled_apart(function: _Function) -> _Function:
    """Return the function compiled, to be called by compiled code only, as a unit of its own.

    The time that compilation takes grows faster than the size of what is inlined into one function.
    """
    return _compile(function, cache=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)


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
        return numba.njit(**{"nogil": True, **_OPTIONS, **kind})(function)  # type: ignore[no-any-return]
