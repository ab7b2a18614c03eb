"""Compiled code: machine code that is loaded where an earlier process has kept it, and compiled where not.

Loading takes LLVM alone. The compiler, numba, is imported when something is to be compiled, which `compiler` does.

The folder of what is kept is named after a digest of every source file that is compiled, of the processor and of the
compiler's version, so that no stale code is served. Where no folder can be written, everything is compiled anew in each
process. What takes its time is said once, as a warning of the logger ``finger_pin``, which Python prints on standard
error unless logging is set up otherwise.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import multiprocessing
import os
import threading
from collections.abc import Callable
from functools import cache, cached_property
from importlib import import_module, metadata
from itertools import count
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar

import llvmlite
import platformdirs
from llvmlite import binding as llvm

from finger_pin.files import replacing

_Function = TypeVar("_Function", bound=Callable[..., Any])
# Where compiled code stands.
_COMPILED = ("core/*.py", "laws/*.py", "mechanism/pieces.py", "mechanism/spans/*.py", "mechanism/gaps/*.py")
_LOGGER = logging.getLogger("finger_pin")


def _root() -> str:
    return os.environ.get("FINGER_PIN_CACHE_DIR") or platformdirs.user_cache_dir("finger_pin")


def _digest() -> str:
    package = Path(__file__).parent.parent
    processor = f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    digest = hashlib.sha256(f"{metadata.version('numba')} {llvmlite.__version__} {processor}".encode())
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


def is_cached() -> bool:
    """Return whether compiled code is in the cache, so that the first simulation starts at once."""
    return CACHE_FOLDER is not None and any(Path(CACHE_FOLDER).glob("*.o"))


@cache
def _say(text: str) -> None:
    """Warn once in a process, and not in those that a process starts."""
    if multiprocessing.parent_process() is None:
        _LOGGER.warning(text)


class Later:
    """What compiled code uses, made when the first code that uses it is compiled."""

    def __init__(self, make: Callable[[], Any]) -> None:
        """Keep what makes it."""
        self._make = make

    @cached_property
    def made(self) -> Any:
        """What numba is to see in its place."""
        return self._make()


class _Inlined(Later):
    """A function that is called by compiled code only."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(lambda: import_module("finger_pin.core.compiler").inlined(function, **options))
        self.function = function


def compiled(function: _Function) -> _Function:
    """Return the function compiled, to be called by compiled code only, where it is inlined."""
    return _Inlined(function)  # type: ignore[return-value]


def compiled_loosely(function: _Function) -> _Function:
    """Return the function compiled as `compiled` does, with sums in whatever order vector instructions like."""
    return _Inlined(function, fastmath={"contract", "reassoc"})  # type: ignore[return-value]


def intrinsic(name: str) -> Any:
    """Return a function of `intrinsics`, to be called by compiled code only."""
    return Later(lambda: getattr(import_module("finger_pin.core.intrinsics"), name))


class Unit:
    """A function of an address and a number that returns an integer, compiled on first use, or found on disk."""

    def __init__(self, function: Callable[[int, float], int]) -> None:
        """Compile nothing yet."""
        assert isinstance(function, FunctionType)
        self._function = function

    @cached_property
    def address(self) -> int:
        """Where compiled code finds it."""
        return address_of("int64(int64, float64)", self._function, kept=True)

    @cached_property
    def _call(self) -> Callable[[int, float], int]:
        return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_double)(self.address)

    def __call__(self, address: int, number: float = 0.0) -> int:
        """Call it; other threads may run meanwhile."""
        return self._call(address, number)


_number = count()
# Two threads may ask for the same.
_lock = threading.RLock()


def address_of(signature: str, function: FunctionType, *, kept: bool) -> int:
    """Return the address of the function compiled for C; it lives as long as the process.

    Args:
        signature: As numba writes it, of pointers and numbers.
        function: The function.
        kept: Whether it is found on disk by later processes; for functions of this package only, whose digest names
            the folder, and of others that call nothing else.
    """
    text = function.__code__
    own = hashlib.sha256(text.co_code + repr((text.co_names, text.co_consts)).encode()).hexdigest()[:8]
    name = f"{function.__module__}.{function.__qualname__}-{own if kept else next(_number)}"
    path = Path(CACHE_FOLDER) / f"{name}.o" if kept and CACHE_FOLDER is not None else None
    with _lock:
        code = path.read_bytes() if path is not None and path.exists() else b""
        if not code:
            if kept:
                _announce()
            code, portable = import_module("finger_pin.core.compiler").machine_code(signature, function, name)
            if path is not None and portable:
                _keep(path, code)
        engine = _engine()
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        return int(engine.get_function_address(name))


@cache
def _engine() -> Any:
    """Return what holds all machine code."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def _announce() -> None:
    often = "once for this version" if CACHE_FOLDER else f"in every run, as {_root()} cannot be written"
    advice = "" if CACHE_FOLDER else "; FINGER_PIN_CACHE_DIR may name another folder"
    _say(f"Compiling the model, {often}: about half a minute{advice} ...")


def _keep(path: Path, code: bytes) -> None:
    """Keep code for later processes; a full disk costs the next run half a minute and not this one its results."""
    try:
        with replacing(path) as temporary:
            Path(temporary).write_bytes(code)
    except OSError as error:
        _say(f"the compile cache {CACHE_FOLDER} cannot be written: {error.strerror}; the next run compiles again")
