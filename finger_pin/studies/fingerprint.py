"""Digests of a run's dependencies besides its scenario: source, other packages, metrics, a finger of one's own."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import site
import sys
import sysconfig
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from types import BuiltinFunctionType, CodeType, EllipsisType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from finger_pin.mechanism.finger import Finger

#: Packages whose versions results depend on, and say.
PACKAGES = ("finger-pin", "numba", "numpy", "pin", "scipy", "xarray")
# Imports point down, so nothing above the studies affects their results.
_ABOVE = {"views", "commands"}
# What a class has besides what is written in it.
_OF_CLASSES = {"__dict__", "__weakref__", "__dataclass_fields__", "__dataclass_params__"}


class UnknownDependency(Exception):
    """A dependency that cannot be compared with its earlier self; the message names it."""


@cache
def versions() -> dict[str, str]:
    """Return the versions of `PACKAGES`."""
    return {name: metadata.version(name) for name in PACKAGES}


@cache
def source_digest() -> str:
    """Return a digest of all source of this package that results can depend on, and of the versions of others."""
    package = Path(__file__).parent.parent
    digest = hashlib.sha256(repr(versions()).encode())
    for path in sorted(package.rglob("*.py")):
        if path.relative_to(package).parts[0] not in _ABOVE:
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def code_digest(function: Any) -> str:
    """Return a digest of a function's code, of the values that it has enclosed, and of all of one's own that it uses.

    What is installed counts by its name and version. Files that a function reads are not seen.

    Raises:
        UnknownDependency: If it depends on something that has no digest, such as an object of one's own class.
    """
    digest = hashlib.sha256()
    try:
        for part in _parts(function, frozenset(), {}):
            digest.update(part.encode(errors="backslashreplace") + b"\0")
    except (ValueError, RecursionError) as error:
        raise UnknownDependency(str(error)) from None
    return digest.hexdigest()[:16]


def finger_digest(finger: Finger) -> str:
    """Return a digest of a finger that a caller has built: description, rigid body, rows and their laws, objects.

    Raises:
        UnknownDependency: If a law depends on something that has no digest.
    """
    body, rows, objects = finger.constructor_args
    model = None if body is None else body.model.saveToString()
    described = {name: each.model_dump_json() for name, each in (objects or {}).items()}
    return code_digest((finger.description.model_dump_json(), model, tuple(rows), described))


def _parts(thing: Any, names: frozenset[str], seen: dict[Any, Any]) -> Iterator[str]:
    """Yield the marks of a thing; of a user's own module, only those of the parts used by one of some names."""
    if thing is None or isinstance(thing, bool | int | float | complex | str | bytes | EllipsisType):
        yield repr(thing)
        return
    yield type(thing).__name__
    if (id(thing), names) in seen:
        return
    # Kept, so that no other thing gets its identity meanwhile.
    seen[id(thing), names] = thing
    installed = _is_installed(getattr(thing, "__module__", None))
    inner: list[Any]
    match thing:
        case tuple() | list():
            inner = list(thing)
        case dict():
            inner = [each for item in thing.items() for each in item]
        case set() | frozenset():
            inner = sorted(thing, key=repr)
        case np.ndarray() | np.generic() if thing.dtype != object:
            inner = [str(thing.dtype), thing.shape, thing.tobytes()]
        case CodeType():
            inner = [thing.co_code, thing.co_varnames, thing.co_names, *thing.co_consts]
        case ModuleType():
            inner = [thing.__name__, getattr(thing, "__version__", None)]
            if not _is_installed(thing.__name__):
                inner += [vars(thing)[name] for name in sorted(names & vars(thing).keys())]
        case functools.partial():
            inner = [thing.func, thing.args, thing.keywords]
        case MethodType():
            inner = [thing.__self__, thing.__func__]
        case FunctionType():
            cells = [each.cell_contents for each in thing.__closure__ or ()]
            inner = [thing.__defaults__, thing.__kwdefaults__, *cells]
            if installed:
                inner += [thing.__module__, thing.__qualname__]
            else:
                names = _names(thing.__code__)
                used = sorted(names & thing.__globals__.keys())
                inner += [thing.__code__, *(thing.__globals__[name] for name in used)]
        case type() if not installed:
            inner = [thing.__bases__, {name: each for name, each in vars(thing).items() if name not in _OF_CLASSES}]
        case staticmethod() | classmethod():
            inner = [thing.__func__]
        case property():
            inner = [thing.fget, thing.fset]
        case _ if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
            inner = [type(thing), vars(thing)]
        case type() | BuiltinFunctionType() | np.ufunc() if installed:
            inner = [thing.__module__, thing.__qualname__]
        case _:
            raise UnknownDependency(f"an object of type {type(thing).__name__}")
    for each in inner:
        yield from _parts(each, names, seen)


def _names(code: CodeType) -> frozenset[str]:
    """Return the names of globals and attributes in some code, that of functions within it included."""
    nested = [_names(each) for each in code.co_consts if isinstance(each, CodeType)]
    return frozenset(code.co_names).union(*nested)


@cache
def _is_installed(module: str | None) -> bool:
    """Return whether a module belongs to this package, to Python or to an installed package, not to the user."""
    top = (module or "").partition(".")[0]
    if top in sys.stdlib_module_names or top == "finger_pin":
        return True
    file = getattr(sys.modules.get(top), "__file__", None)
    places = [*site.getsitepackages(), site.getusersitepackages(), *map(sysconfig.get_path, ("purelib", "platlib"))]
    return file is not None and any(Path(file).is_relative_to(place) for place in places)
