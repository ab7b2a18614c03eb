"""Digests by value, equal in all processes: of the package, and of the other inputs of a run."""

from __future__ import annotations

import copyreg
import sys
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import joblib
from pydantic import BaseModel

from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.recording import versions

# Imports point down, so nothing above the studies affects their results.
_EXCLUDED = {"commands", "learning", "views", "identification"}
_PLAIN_TYPES = (type(None), bool, int, float, complex, str, bytes, type(...))
_WRAPPED_ATTRIBUTES = ("fget", "fset", "fdel", "__wrapped__", "targetoptions")


class UnknownDependency(Exception):
    """Dependency without a digest; the message names it."""


@cache
def source_digest() -> str:
    """Return a digest of this package's source and of the versions of others."""
    package = Path(__file__).parent.parent
    files = [path for path in sorted(package.rglob("*.py")) if path.relative_to(package).parts[0] not in _EXCLUDED]
    return str(joblib.hash((versions(), [path.read_bytes() for path in files])))


def digest(value: Any) -> str:
    """Return a digest of a value: of functions the code, their closures, and the user code that they call.

    Installed packages count by their names and versions. Files that a function reads do not count.

    Raises:
        UnknownDependency: If it depends on something without a lasting content, such as a lock or an open file.
    """
    return _digest(value, frozenset(), {})


#: What holds a function of a user's: descriptors, and that of `functools.cache`.
_WRAPPERS = (property, staticmethod, classmethod, type(source_digest))


def _is_compiled(value: Any) -> bool:
    """Return whether numba compiles a function; its type is not public."""
    return type(value).__module__.startswith("numba.") and hasattr(value, "py_func")


def _digest(value: Any, names: frozenset[str], digests: dict[Any, tuple[Any, str]]) -> str:
    """Return a digest of a value; of a user's module, only of the members with some names."""
    if type(value) in _PLAIN_TYPES:
        # A text such as "module:NAME" may be that of a user's law.
        module, _, name = str(value).partition(":")
        member = vars(sys.modules[module]).get(name) if module in sys.modules else None
        return str(joblib.hash((type(value).__name__, value, member and _digest(member, names, digests))))
    names = _names(value.__code__) if isinstance(value, FunctionType) else names
    key = id(value), names
    if key not in digests:
        # The value is stored so that its identity is not reused; a value that contains itself counts as "circle".
        digests[key] = value, "circle"
        try:
            parts = _parts(value, names)
        except (TypeError, ValueError):
            raise UnknownDependency(f"an object of type {type(value).__name__}") from None
        # joblib distinguishes one object twice from two equal ones, except for texts, and orders sets by their seed.
        part_digests = [_digest(part, names, digests) for part in parts]
        part_digests = sorted(part_digests) if isinstance(value, dict | set | frozenset) else part_digests
        digests[key] = value, str(joblib.hash([type(value).__qualname__, *part_digests]))
    return digests[key][1]


def _parts(value: Any, names: frozenset[str]) -> list[Any]:
    """Return the parts that determine a value, of a namespace the members with some names."""
    module = getattr(value, "__module__", None)
    match value:
        case dict():
            return [*value.items()]
        case tuple() | list() | set() | frozenset():
            return [*value]
        case CodeType():
            return [value.co_code, value.co_exceptiontable, value.co_varnames, value.co_names, value.co_consts]
        case ModuleType():
            members = {} if _is_installed(value.__name__) else _select(vars(value), names)
            return [value.__name__, vars(value).get("__version__"), members]
        case FunctionType():
            namespace = module if _is_installed(module) else _select(value.__globals__, names)
            cells = [name.cell_contents for name in value.__closure__ or ()]
            return [namespace, value.__code__, value.__defaults__, value.__kwdefaults__, cells]
        case type() if _is_installed(module):
            return [module, value.__qualname__]
        case type():
            attributes = {name: value for name, value in vars(value).items() if callable(value) or name[:2] != "__"}
            return [value.__bases__, attributes]
        case _ if isinstance(value, _WRAPPERS) or _is_compiled(value):
            return [getattr(value, name, None) for name in _WRAPPED_ATTRIBUTES]
        case Finger():
            return [value.description, value.constructor_args]
        case BaseModel():
            return [type(value), value.model_dump()]
    reducer = copyreg.dispatch_table.get(type(value))
    reduced = reducer(value) if reducer else value.__reduce_ex__(4)
    if not isinstance(reduced, str):
        return [*reduced]
    # By name, as builtin functions; one that NumPy makes of a user's has none.
    if not (reduced.isidentifier() and _is_installed(module or type(value).__module__)):
        raise TypeError
    return [module, reduced]


def _select(space: dict[str, Any], names: frozenset[str]) -> dict[str, Any]:
    return {name: space[name] for name in names & space.keys()}


def _names(code: CodeType) -> frozenset[str]:
    """Return the names of globals and attributes in code, nested functions included."""
    nested = [_names(each) for each in code.co_consts if isinstance(each, CodeType)]
    return frozenset(code.co_names).union(*nested)


@cache
def _is_installed(module: str | None) -> bool:
    """Return true for modules that the source's digest or versions cover, not for the user's own."""
    top, *rooms = (module or "").split(".")
    path = getattr(sys.modules.get(top), "__file__", None) or ""
    in_library = (top == "finger_pin" and _EXCLUDED.isdisjoint(rooms[:1])) or top in sys.stdlib_module_names
    return in_library or not {"site-packages", "dist-packages"}.isdisjoint(Path(path).parts)
