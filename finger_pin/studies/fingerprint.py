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
_ABOVE = {"views", "commands"}
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...))
_WRAPPED = ("fget", "fset", "fdel", "__wrapped__", "targetoptions")


class UnknownDependency(Exception):
    """Dependency without a digest; the message names it."""


@cache
def source_digest() -> str:
    """Return a digest of this package's source and of the versions of others."""
    package = Path(__file__).parent.parent
    files = [each for each in sorted(package.rglob("*.py")) if each.relative_to(package).parts[0] not in _ABOVE]
    return str(joblib.hash((versions(), [each.read_bytes() for each in files])))


def digest(thing: Any) -> str:
    """Return a digest of a value: of functions the code, what they enclose, and the user code that they call.

    What installed packages call counts by their names and versions. Files that a function reads are not seen.

    Raises:
        UnknownDependency: If it depends on something without a lasting content, such as a lock or an open file.
    """
    return _digest(thing, frozenset(), {})


#: What holds a function of a user's: descriptors, and that of `functools.cache`.
_WRAPPERS = (property, staticmethod, classmethod, type(source_digest))


def _is_compiled(thing: Any) -> bool:
    """Return whether numba compiles a function; its type is not public."""
    return type(thing).__module__.startswith("numba.") and hasattr(thing, "py_func")


def _digest(thing: Any, names: frozenset[str], known: dict[Any, tuple[Any, str]]) -> str:
    """Return a digest of a thing; of a user's module, only of the parts used by one of some names."""
    if type(thing) in _PLAIN:
        # A text such as "module:NAME" may be that of a user's law.
        module, _, name = str(thing).partition(":")
        named = vars(sys.modules[module]).get(name) if module in sys.modules else None
        return str(joblib.hash((type(thing).__name__, thing, named and _digest(named, names, known))))
    names = _names(thing.__code__) if isinstance(thing, FunctionType) else names
    key = id(thing), names
    if key not in known:
        # Kept, so that no other thing gets its identity meanwhile. In a circle it counts as such.
        known[key] = thing, "circle"
        try:
            parts = _parts(thing, names)
        except (TypeError, ValueError):
            raise UnknownDependency(f"an object of type {type(thing).__name__}") from None
        # joblib tells one thing twice from two equal ones, but not so for texts, and orders sets by their seed.
        digests = [_digest(part, names, known) for part in parts]
        digests = sorted(digests) if isinstance(thing, dict | set | frozenset) else digests
        known[key] = thing, str(joblib.hash([type(thing).__qualname__, *digests]))
    return known[key][1]


def _parts(thing: Any, names: frozenset[str]) -> list[Any]:
    """Return the parts that determine a thing, of which code uses some names."""
    module = getattr(thing, "__module__", None)
    match thing:
        case dict():
            return [*thing.items()]
        case tuple() | list() | set() | frozenset():
            return [*thing]
        case CodeType():
            return [thing.co_code, thing.co_exceptiontable, thing.co_varnames, thing.co_names, thing.co_consts]
        case ModuleType():
            used = {} if _is_installed(thing.__name__) else _chosen(vars(thing), names)
            return [thing.__name__, vars(thing).get("__version__"), used]
        case FunctionType():
            seat = module if _is_installed(module) else _chosen(thing.__globals__, names)
            cells = [each.cell_contents for each in thing.__closure__ or ()]
            return [seat, thing.__code__, thing.__defaults__, thing.__kwdefaults__, cells]
        case type() if _is_installed(module):
            return [module, thing.__qualname__]
        case type():
            written = {each: value for each, value in vars(thing).items() if callable(value) or each[:2] != "__"}
            return [thing.__bases__, written]
        case _ if isinstance(thing, _WRAPPERS) or _is_compiled(thing):
            return [getattr(thing, each, None) for each in _WRAPPED]
        case Finger():
            return [thing.description, thing.constructor_args]
        case BaseModel():
            return [type(thing), thing.model_dump()]
    known = copyreg.dispatch_table.get(type(thing))
    reduced = known(thing) if known else thing.__reduce_ex__(4)
    if not isinstance(reduced, str):
        return [*reduced]
    # By name, as builtin functions; one that NumPy makes of a user's has none.
    if not (reduced.isidentifier() and _is_installed(module or type(thing).__module__)):
        raise TypeError
    return [module, reduced]


def _chosen(space: dict[str, Any], names: frozenset[str]) -> dict[str, Any]:
    return {name: space[name] for name in names & space.keys()}


def _names(code: CodeType) -> frozenset[str]:
    """Return the names of globals and attributes in code, nested functions included."""
    nested = [_names(each) for each in code.co_consts if isinstance(each, CodeType)]
    return frozenset(code.co_names).union(*nested)


@cache
def _is_installed(module: str | None) -> bool:
    """Return true for modules of this package, of Python and of installed packages, not the user's."""
    top = (module or "").partition(".")[0]
    file = getattr(sys.modules.get(top), "__file__", None) or ""
    known = top == "finger_pin" or top in sys.stdlib_module_names
    return known or not {"site-packages", "dist-packages"}.isdisjoint(Path(file).parts)
