"""Digests of a run's dependencies besides its scenario: source, other packages, metrics, a custom finger."""

from __future__ import annotations

import dataclasses
import functools
import pickle
import site
import sys
import sysconfig
from functools import cache
from importlib import metadata
from pathlib import Path
from types import BuiltinFunctionType, CodeType, EllipsisType, FunctionType, MethodType, ModuleType, NoneType
from typing import Any

import joblib
import numpy as np

from finger_pin.mechanism.finger import Finger

#: Packages whose versions results depend on, and say.
PACKAGES = ("finger-pin", "numba", "numpy", "pin", "scipy", "xarray")
# Imports point down, so nothing above the studies affects their results.
_ABOVE = {"views", "commands"}
# What a class has besides what is written in it, what wrappers of functions hold, and what a name says enough of.
_OF_CLASSES = {"__dict__", "__weakref__", "__dataclass_fields__", "__dataclass_params__", "__firstlineno__"}
_PARTS = ("func", "args", "keywords", "__self__", "__func__", "fget", "fset")
_NAMED = (type, BuiltinFunctionType, np.ufunc)
_PLAIN = (NoneType, bool, int, float, complex, str, bytes, EllipsisType)


class UnknownDependency(Exception):
    """Dependency without a digest; the message names it."""


@cache
def versions() -> dict[str, str]:
    """Return the versions of `PACKAGES`."""
    return {name: metadata.version(name) for name in PACKAGES}


@cache
def source_digest() -> str:
    """Return a digest of this package's source and of the versions of others."""
    package = Path(__file__).parent.parent
    files = [each for each in sorted(package.rglob("*.py")) if each.relative_to(package).parts[0] not in _ABOVE]
    return str(joblib.hash((versions(), [each.read_bytes() for each in files])))


def code_digest(function: Any) -> str:
    """Return a digest of a function: its code, the values that it encloses, the user code that it calls.

    What is installed counts by its name and version. Files that a function reads are not seen.

    Raises:
        UnknownDependency: If it depends on something that has no digest, such as an object of a user's class.
    """
    try:
        return str(joblib.hash(_content(function, frozenset(), {})))
    except (ValueError, RecursionError, pickle.PicklingError) as error:
        raise UnknownDependency(str(error)) from None


def finger_digest(finger: Finger) -> str:
    """Return a digest of a custom finger: description, rigid body, rows and their laws, objects, replaced tables.

    Raises:
        UnknownDependency: If a law depends on something that has no digest.
    """
    given = finger.constructor_args
    model = None if given.rigid_body is None else given.rigid_body.model.saveToString()
    described = {name: each.model_dump_json() for name, each in (given.objects or {}).items()}
    return code_digest((finger.description.model_dump_json(), model, given.rows, described, dict(given.tables)))


def _content(thing: Any, names: frozenset[str], seen: dict[Any, Any]) -> Any:
    """Return a thing in values that joblib can hash; of a user's module, only the parts used by one of some names."""
    if isinstance(thing, FunctionType | type | ModuleType | CodeType):
        # Pickle, and so joblib, knows these by their names alone.
        if (id(thing), names) in seen:
            return None
        # Kept, so that no other thing gets its identity meanwhile.
        seen[id(thing), names] = thing
    installed = _is_installed(getattr(thing, "__module__", None))
    inner: list[Any]
    match thing:
        case tuple() | list():
            inner = list(thing)
        case set() | frozenset():
            inner = sorted(thing, key=repr)
        case dict():
            inner = [each for item in thing.items() for each in item]
        case CodeType():
            inner = [thing.co_code, thing.co_varnames, thing.co_names, *thing.co_consts]
        case ModuleType():
            inner = [thing.__name__, getattr(thing, "__version__", None)]
            if not _is_installed(thing.__name__):
                inner += [vars(thing)[name] for name in sorted(names & vars(thing).keys())]
        case FunctionType():
            cells = [each.cell_contents for each in thing.__closure__ or ()]
            inner = [thing.__defaults__, thing.__kwdefaults__, *cells]
            if installed:
                inner += [thing.__module__, thing.__qualname__]
            else:
                names = _names(thing.__code__)
                used = sorted(names & thing.__globals__.keys())
                inner += [thing.__code__, *(thing.__globals__[name] for name in used)]
        case functools.partial() | MethodType() | staticmethod() | classmethod() | property():
            inner = [getattr(thing, part, None) for part in _PARTS]
        case type() if not installed:
            inner = [thing.__bases__, {name: each for name, each in vars(thing).items() if name not in _OF_CLASSES}]
        case _ if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
            inner = [type(thing), vars(thing)]
        case np.ndarray() | np.generic() if thing.dtype != object:
            return thing
        case _ if isinstance(thing, _PLAIN) or (installed and isinstance(thing, _NAMED)):
            return thing
        case _:
            raise UnknownDependency(f"an object of type {type(thing).__name__}")
    return [type(thing).__name__, *(_content(each, names, seen) for each in inner)]


def _names(code: CodeType) -> frozenset[str]:
    """Return the names of globals and attributes in code, nested functions included."""
    nested = [_names(each) for each in code.co_consts if isinstance(each, CodeType)]
    return frozenset(code.co_names).union(*nested)


@cache
def _is_installed(module: str | None) -> bool:
    """Return true for modules of this package, of Python and of installed packages, not the user's."""
    top = (module or "").partition(".")[0]
    if top in sys.stdlib_module_names or top == "finger_pin":
        return True
    file = getattr(sys.modules.get(top), "__file__", None)
    places = [*site.getsitepackages(), site.getusersitepackages(), *map(sysconfig.get_path, ("purelib", "platlib"))]
    return file is not None and any(Path(file).is_relative_to(place) for place in places)
