"""Digest of all that a compiled function depends on: compiled code is kept on disk as long as it is the same.

Of this package it is the code of all files that hold compiled functions or what these name, without comments and
docstrings; how a description is read, and which rows a finger has, is of no matter to compiled code. Of a function
from elsewhere, such as a law in a user's script, it is the code object that numba compiles, and the values that the
function takes for constants: those of its closure, its defaults and its globals, and all functions among them. Unlike
the text of the file, the code object is what was imported, and tells two lambdas of a line apart.
"""

from __future__ import annotations

import ast
import dis
import hashlib
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
import platformdirs
from numba.extending import is_jitted

from finger_pin.files import write_text

#: Rooms and modules that hold compiled functions, or what these take for constants.
COMPILED_MODULES = (
    "finger_pin.core",
    "finger_pin.description.tree_couplings",
    "finger_pin.exchange.mujoco_friction",
    "finger_pin.laws",
    "finger_pin.mechanism.gaps",
    "finger_pin.mechanism.spans",
    "finger_pin.mujoco",
    "finger_pin.observation.filter",
    "finger_pin.references",
)
# Their names tell what they have, as their versions are part of the digest.
_VERSIONED_PACKAGES = {"builtins", "cmath", "llvmlite", "math", "numba", "numpy", "operator"}
_PLAIN_TYPES = (int, float, complex, str, bytes, bool, type(None), slice)


class Undigestible(Exception):
    """Exception for an object that a later process could not recognise."""


def source_digest(function: FunctionType) -> str:
    """Return a digest of a function with all that it depends on.

    Raises:
        Undigestible: If it takes for a constant what is none, or stands in no module that another process could import.
    """
    return _hashed(f"{_package_digest()} {_function(function, ())}")[:16]


def cache_root() -> Path:
    """Return the folder of compiled code; it may not be writable."""
    return Path(os.environ.get("FINGER_PIN_CACHE_DIR") or platformdirs.user_cache_dir("finger_pin"))


@cache
def _package_digest() -> str:
    """Return a digest of the package's code and of the versions that compile it."""
    root = Path(__file__).parents[3]
    places = [root / module.replace(".", "/") for module in COMPILED_MODULES]
    rooms = [path for place in places for path in place.rglob("*.py")]
    paths = sorted([*rooms, *(path for place in places if (path := place.with_suffix(".py")).is_file())])
    texts = {path.relative_to(root).as_posix(): path.read_bytes() for path in paths}
    versions = (sys.version, numba.__version__, llvmlite.__version__, np.__version__)
    # Parsing takes a second: of files that are the same to the byte the digest is kept.
    digest_file = cache_root() / f"source-{_hashed(f'{versions} {texts}')}"
    with suppress(OSError):
        if len(digest := digest_file.read_text()) == 64:
            return digest
    digest = _hashed(f"{versions} { {name: _syntax(text) for name, text in texts.items()} }")
    with suppress(OSError):
        write_text(digest_file, digest)
    return digest


def _syntax(text: bytes) -> str:
    """Return the syntax tree of a module without comments, positions and docstrings."""
    tree = ast.parse(text)
    _drop_docstrings(tree)
    return ast.dump(tree)


def _drop_docstrings(node: ast.Module | ast.ClassDef | ast.FunctionDef) -> None:
    strings = [each for each in node.body if isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)]
    node.body = [each for each in node.body if each not in strings]
    for statement in node.body:
        if isinstance(statement, ast.ClassDef | ast.FunctionDef):
            _drop_docstrings(statement)


def _hashed(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _function(function: FunctionType, above: tuple[FunctionType, ...]) -> str:
    """Return a digest of a function that others above it call."""
    if function in above:
        return f"calls back {above.index(function)}"
    if function.__module__ not in sys.modules:
        # What is kept on disk names the modules that it is of.
        raise Undigestible(f"{function.__qualname__} stands in no module")
    names = frozenset(_names(function.__code__))
    text = [function.__module__, function.__qualname__, _code(function.__code__)]
    for name, value in _values(function, names):
        text.append(f"{name} = {_constant_text(value, names, (*above, function))}")
    return _hashed("\n".join(text))


def _code(code: CodeType) -> str:
    # Nobody loads the docstring, which is a constant all the same.
    loaded = [each.argval for each in dis.get_instructions(code) if each.opcode in dis.hasconst]
    constants = [
        _code(each) if isinstance(each, CodeType) else _constant_text(each, frozenset(), ()) for each in loaded
    ]
    signature = (code.co_argcount, code.co_flags, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return _hashed(f"{code.co_code.hex()} {signature} {constants}")


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _values(function: FunctionType, names: frozenset[str]) -> Iterator[tuple[str, Any]]:
    """Yield the closure, defaults and globals of a function, except those that the package defines."""
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents
    yield "defaults", (function.__defaults__, function.__kwdefaults__)
    attributes = vars(sys.modules[function.__module__]) if _is_ours(function) else {}
    for name in sorted(names & function.__globals__.keys()):
        value = function.__globals__[name]
        if name not in attributes or attributes[name] is not value:
            yield name, value


def _is_ours(value: object) -> bool:
    return (getattr(value, "__module__", None) or "").startswith(COMPILED_MODULES)


def _constant_text(value: Any, names: frozenset[str], above: tuple[FunctionType, ...]) -> str:
    """Return a text that differs for constants that differ; of a module, for the attributes of some names."""

    def described(part: object) -> str:
        return _constant_text(part, names, above)

    if isinstance(value, _PLAIN_TYPES):
        return repr(value)
    if is_jitted(value):
        dispatcher: Any = value
        return f"{described(dispatcher.targetoptions)} {_function(dispatcher.py_func, above)}"
    if isinstance(value, numba.types.Type):
        # The type of a table has its layout.
        return f"{value.name} {described(getattr(value, 'kinds', {}))}"
    if isinstance(value, ModuleType):
        if value.__name__.partition(".")[0] in _VERSIONED_PACKAGES:
            return value.__name__
        return f"{value.__name__} {described({name: vars(value)[name] for name in names & vars(value).keys()})}"
    if isinstance(value, tuple):
        return f"{type(value).__qualname__} {[described(each) for each in value]}"
    if isinstance(value, dict):
        return f"{sorted((name, described(each)) for name, each in value.items())}"
    if isinstance(value, set | frozenset):
        return f"{sorted(described(each) for each in value)}"
    if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
        return f"{value.dtype.descr} {value.shape} {value.tobytes().hex()}"
    module, name = str(getattr(value, "__module__", None)), getattr(value, "__qualname__", None)
    if isinstance(value, np.ufunc) and any(value is each for each in vars(np).values()):
        return f"numpy {value}"
    if name is not None and module.partition(".")[0] in _VERSIONED_PACKAGES:
        return f"{module}.{name}"
    if isinstance(value, FunctionType):
        return _function(value, above)
    if isinstance(value, type) and issubclass(value, tuple):
        return f"{module}.{name} {getattr(value, '_fields', '')}"
    if name is not None and _is_ours(value):
        return f"{module}.{name}"
    raise Undigestible(f"{value!r} is no constant of compiled code")
